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
