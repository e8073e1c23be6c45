"""Modes and responses of what remembers, layers that slip and soil: closed forms, and small motions in time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.problems import tables_with
from tests.scenes import cable_scene, clamped_at, pinned_at

SECTION = {
    "length": 10.0, "mass": 4.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": 200.0,
    "torsional_stiffness": 100.0, "damping": {"mass": 2.0},
}  # fmt: skip
CLAMPED: dict[str, Any] = cable_scene(
    SECTION, clamped_at([0, 0, 0], [1, 0, 0]), pinned_at(9, 0, 1), model="rod", mesh=40
)
S = "cable.sections.0."
LAYERS = {S + "bending_slip": [{"stiffness": 300.0, "moment": 5.0, "per_tension": 0.02}]}
PERIOD = 8.0


def periods(tables: dict[str, Any]) -> np.ndarray:
    return np.array([x.period for x in hybrid.modes(tables, 6).modes])


@pytest.mark.long  # 2.9 s
def test_layers_that_stick_are_stiffness():
    stiff = periods(tables_with(CLAMPED, {S + "bending_stiffness": 500.0}))
    stuck = periods(tables_with(CLAMPED, {S + "bending_slip": [{"stiffness": 300.0, "moment": 1e6}]}))
    np.testing.assert_allclose(stuck, stiff, rtol=1e-9)
    assert np.all(periods(tables_with(CLAMPED, LAYERS)) < 0.99 * stiff)  # they slip under weight, and lie straighter


def moved(tables: dict[str, Any], amplitude: float, places: list[float], last: int = 7):
    """Response to a slow heave of the end; parts of its amplitudes, of curvature and tension at places, that a run has

    in the two periods before its `last`.
    """
    heave = {"heave": {"amplitude": amplitude, "period": PERIOD}, "ramp": 4 * PERIOD}
    tables = tables_with(tables, {"ends.end.motion": heave})
    response = hybrid.response(tables)
    line, parts = response.lines["cable"], []
    run = hybrid.run(
        tables | {"time": {"duration": last * PERIOD, "step": 0.02},
                  "output": {"every": PERIOD / 100, "points": places, "exact": True}}
    )  # fmt: skip
    late = run.times > (last - 1.999) * PERIOD
    wave = 2.0 * np.exp(-2j * np.pi / PERIOD * run.times[late]) / np.count_nonzero(late)
    for name, at in (("curvature", line.s), ("tension", line.middle)):
        mine = np.interp(places, at, np.abs(getattr(line, name)[0].reshape(at.size, -1)[:, 0]))
        parts.append(np.abs(wave @ run[name][late]) / mine)
    return response, parts


@pytest.mark.long
@pytest.mark.parametrize("law", [LAYERS, {S + "stiffness_per_tension": 0.3}], ids=["slip", "by tension"])
def test_a_slow_small_motion_of_layers_is_that_in_time(law):
    """Where layers have slipped, and where a stiffness hangs on tension: without that it is off by a quarter."""
    response, (curvature, tension) = moved(tables_with(CLAMPED, law), 1e-3, [0.0, 1.0, 2.0, 5.0, 8.0])
    assert not [x for x in response.notes if "layers" in x]
    np.testing.assert_allclose(curvature, 1.0, atol=2e-3)
    np.testing.assert_allclose(tension[1:], 1.0, atol=2e-3)


def test_layers_that_slip_in_the_motion_are_told():
    """To either side of the curvature that the slip moment makes, 5.5 N m/300 N m2."""
    heave = {"heave": {"amplitude": 0.5, "period": PERIOD}, "ramp": 4 * PERIOD}
    response = hybrid.response(tables_with(CLAMPED, LAYERS | {"ends.end.motion": heave}))
    assert [x for x in response.notes if "layers slip beyond" in x] and not response.valid


SOIL = {"shear_strength": 500.0, "gradient": 900.0}
PIPE = SECTION | {"mass": 40.0, "diameter": 0.2, "bending_stiffness": 2e5, "axial_stiffness": 1e7}


def test_a_pipe_that_heaves_in_soil_has_the_stiffness_of_unloading():
    """omega^2 = K Pu/(D m) at the depth in which first penetration, Pu zeta/(1 + zeta), bears its weight."""
    found = hybrid.modes(
        cable_scene(PIPE, "free", "free", seabed={"z": 0, "soil": SOIL}, model="rod", mesh=20,
                    initial={"kind": "equilibrium", "points": [[0, 0, 0], [10, 0, 0]]}),
        6, near=0.0625
    )  # fmt: skip
    z, D, a, b, K = -found.position["cable"][0, 2], 0.2, 6.0, 0.25, 200.0
    most = a * (z / D) ** b * (500.0 + 900.0 * z) * D
    assert most * K * z / D / (1.0 + K * z / D) == pytest.approx(40.0 * 9.81, rel=1e-9)
    (heave,) = (x for x in found.modes if x.mass[2] > 0.99 * found.mass[2])
    assert heave.period == pytest.approx(2.0 * math.pi / math.sqrt(K * most / (D * 40.0)), rel=1e-9)


@pytest.mark.long
def test_a_slow_small_motion_of_a_line_in_soil_is_that_in_time_and_a_large_one_is_told():
    """Once it has sunk as far as the motion lets it: in the seventh period tension is off by 1.1 % as yet."""
    pipe = cable_scene(
        PIPE | {"length": 30.0}, pinned_at(0, 0, -0.03), pinned_at(29.7, 0, 3), seabed={"z": 0, "soil": SOIL},
        model="rod", mesh=60
    )  # fmt: skip
    response, (curvature, tension) = moved(pipe, 4e-6, [12.0, 15.0, 18.0, 24.0], 20)
    assert response.valid
    np.testing.assert_allclose(curvature, 1.0, atol=4e-3)
    np.testing.assert_allclose(tension, 1.0, atol=1e-3)
    heave = {"heave": {"amplitude": 0.05, "period": PERIOD}, "ramp": 4 * PERIOD}
    large = hybrid.response(tables_with(pipe, {"ends.end.motion": heave}))
    assert [x for x in large.notes if "its stiffness falls by" in x]


# --- Modes and responses of lines whose tension makes a torque and is no multiple of strain ---

TABLE = [[0, 0], [0.002, 100], [0.004, 240], [0.02, 2500]]
SLOPE = (2500.0 - 240.0) / 0.016
PIECE = (0.004 - 240.0 / SLOPE, 1.0 / SLOPE)
EA, E, T = 5e4, 2e5, 600.0
ROPE = {"axial_stiffness": EA, "dynamic_stiffness": {"constant": E, "relaxation_time": 100.0}}
LENGTH, C = 60.0, 5e-3


def line(law: dict[str, Any], gravity: float, x: float, longer: float = 1.0, **more: Any) -> dict[str, Any]:
    """A line between two clamps, twisted by a turn; longer: than 60 m, with the stiffness that makes it the same."""
    section = {
        "length": LENGTH * longer, "mass": 0.6 / longer, "bending_stiffness": 2.0 * longer,
        "torsional_stiffness": 8.0 * longer, "tension_torque": C, "rotary_inertia": 1e-3 / longer,
        "damping": 0.05, "max_strain": 0.05,
    } | law  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 1, 0]}
    motion = {"surge": {"amplitude": 0.01, "period": 3.0}, "heave": {"amplitude": 0.02, "period": 3.0}, "ramp": 6.0}
    return cable_scene(
        section, {**clamp, "position": [0, 0, 0]}, {**clamp, "position": [x, 0, 0], "turns": 1.0, "motion": motion},
        gravity=gravity, model="rod", mesh=24, time=(1.0, 0.05)
    ) | more  # fmt: skip


def same(law: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """A line by a law, and one of a constant stiffness with the same equations about its rest."""
    if law == "table":
        a, b = PIECE
        given, gravity, x = {"tension_strain": TABLE}, 9.81, 60.4
    else:  # straight and of one tension, about which it is as stiff as it is fast
        a, b = T / EA - T / E, 1.0 / E
        given, gravity, x = ROPE, 0.0, LENGTH * (1.0 + T / EA) - 2.0 * np.pi * C
    return line(given, gravity, x), line({"axial_stiffness": (1.0 + a) / b}, gravity, x, 1.0 + a)


@pytest.mark.parametrize("law", ["table", "rope"])
@pytest.mark.long  # 3 s of 2 cases
def test_modes_are_those_of_its_piece(law: str) -> None:
    one, other = (hybrid.modes(x, 12).modes for x in same(law))
    found, expected = (np.array([m.frequency for m in x]) for x in (one, other))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    made, _ = same(law)
    made["cable"]["sections"][0]["tension_torque"] = 0.0
    plain = np.array([m.frequency for m in hybrid.modes(made, 12).modes])
    assert np.abs(plain / found - 1.0).max() > 1e-3


@pytest.mark.parametrize("law", ["table", "rope"])
def test_a_response_is_that_of_its_piece(law: str) -> None:
    one, other = (hybrid.response(x).lines["cable"] for x in same(law))
    for name in ("position", "tension"):
        found, expected = getattr(one, name), getattr(other, name)
        assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max(), name


def test_a_response_as_in_time() -> None:
    """Of a rope, which is as stiff as it is fast where waves are short beside its relaxation time."""
    made, _ = same("rope")
    made |= {"time": {"duration": 60.0, "step": 0.02}, "output": {"every": 0.1, "points": [30.0]}}
    made["cable"]["sections"][0]["damping"] = 0.5
    here = hybrid.response(made).lines["cable"]
    result = hybrid.run(made)
    late = result.times > 42.0
    there = np.sqrt(2.0) * result.tension[late, 0].std()
    at = float(np.interp(30.0, here.middle, np.abs(here.tension[0])))
    assert at == pytest.approx(there, rel=1e-2)
