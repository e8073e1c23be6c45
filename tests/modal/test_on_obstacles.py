"""Modes, response and derivatives of lines that rest on obstacles: strings on both sides, a run, two equilibria."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers_and_results import changed_scene
from hybrid.scene.sea import Depths
from tests.modal.test_touching import amplitude
from tests.scenes import cable_scene, pinned_at
from tests.solve.test_bed_of_depths import PLANE, SLOPE, hill, mooring
from tests.validation.obstacle_scenes import over_pipe
from tests.validation.test_validation_obstacles_accuracy import PIPE

Tables = dict[str, Any]
PUSH, AT, SPAN = 0.3, 3.0, 10.0  # m


def string(friction: float) -> Tables:
    """A taut string without weight, pressed up by a thin pipe across it."""
    section = {"length": 9.99, "mass": 0.5, "diameter": 0.01, "axial_stiffness": 1e6}
    pipe = {"kind": "cylinder", "at": [AT, 0, PUSH - 0.055], "axis": [0, 1, 0], "radius": 0.05, "friction": friction}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(SPAN, 0, 0), gravity=0, obstacles={"pipe": pipe},
        initial={"kind": "equilibrium", "points": [[0, 0, 0], [AT, 0, PUSH], [SPAN, 0, 0]]}, model="catenary", mesh=300,
        contact={"self": False}
    )  # fmt: skip


def resting(**pipe: Any) -> Tables:
    """The rope over a pipe, at rest."""
    tables = over_pipe(mesh={"cells": 96}, output={"every": 0.1, "points": 97})
    tables["obstacles"]["pipe"] = PIPE | pipe
    del tables["time"], tables["ends"]["end"]["motion"]
    over = [[0, 0, 0], [2, 0, -1.3], [4, 0, -0.85], [6, 0, -0.9], [10, 0, 3]]
    tables["initial"] = {"kind": "equilibrium", "points": over}
    return tables


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_string_over_a_pipe_swings_as_strings_on_both_sides(friction: float) -> None:
    """Across the pipe each side by itself, with its own length and T; along it both together where it does not stick."""
    tables = string(friction)
    rest = hybrid.static(tables)
    modes = hybrid.modes(tables, count=6)
    found = modes.modes
    assert any("obstacle pipe stays as it is at rest" in x for x in modes.notes)
    lengths = np.array([np.hypot(SPAN - AT, PUSH), np.hypot(AT, PUSH)])
    density = 0.5 * 9.99 / lengths.sum()
    T = np.array([rest.tension[-1][-1], rest.tension[-1][0]])
    right, left = 2.0 * lengths / np.sqrt(T / density)
    across = sorted((right, left, right / 2), reverse=True)
    along = across if friction else [2.0 * lengths.sum() / np.sqrt(T.mean() / density) / n for n in (1, 2, 3)]
    for what, expected in (("in its vertical plane", across), ("sideways", along)):
        periods = [x.period for x in found if x.what.startswith(what)]
        np.testing.assert_allclose(periods[:3], expected[: len(periods)][:3], rtol=4e-3)
        assert len(periods) >= 2


def test_the_response_is_the_motion_of_a_run_and_says_where_it_lifts_off() -> None:
    moved = resting(friction=0.0) | {"time": {"duration": 24.0, "step": 0.01}}
    moved["ends"]["end"]["motion"] = {"heave": {"amplitude": 0.01, "period": 2.0}, "ramp": 4.0}
    run, found = hybrid.run(moved), hybrid.response(moved)
    line = found.lines["cable"]
    for name, at in (("tension", line.middle), ("curvature", line.s)):
        expected = np.interp(run.s, at, np.sqrt(2.0) * line.deviation(name))[4:-4]
        here = np.abs(amplitude(run[name], run.times, 2.0))[4:-4]
        np.testing.assert_allclose(here, expected, atol=0.01 * expected.max())
    assert not any("lift off" in x for x in found.notes)
    moved["ends"]["end"]["motion"]["heave"]["amplitude"] = 0.5
    assert any("lift off obstacle pipe" in x for x in hybrid.response(moved).notes)


def test_derivatives_are_those_of_two_equilibria() -> None:
    keys = {
        "cable.sections[0].length": 1e-4, "cable.sections[0].mass": 1e-4, "ends.end.position[2]": 1e-4,
        "cable.sections[0].bending_stiffness": 1e-3,
    }  # fmt: skip

    def pull(key: str, by: float) -> float:
        tables = resting()
        section, end = tables["cable"]["sections"][0], tables["ends"]["end"]
        if key.startswith("ends"):
            end["position"] = tables["initial"]["points"][-1] = [10, 0, 3 + by]
        else:
            section[key.split(".")[-1]] += by
        return float(hybrid.static(tables).tension[-1][0])

    for x, (key, h) in zip(hybrid.sensitivity(resting(), ["tension@0"], list(keys)), keys.items(), strict=True):
        assert x.derivative == pytest.approx((pull(key, h) - pull(key, -h)) / (2.0 * h), rel=1e-5)


# --- Modes, response and derivatives of lines on a bed of depths: a trough, a plane, two equilibria ---

G = 9.81


def test_a_line_in_a_trough_swings_as_a_pendulum() -> None:
    """As far off its bottom as it is high: w^2 = g kappa + (T/m) (n pi/L)^2, whatever the bed's stiffness."""
    y, length, mass = np.linspace(-8, 8, 17), 100.0, 10.0
    depths = {"x": [-50.0, 0.0, 100.0, 150.0], "y": y.tolist(), "depth": [(-0.025 * y**2).tolist()] * 4}
    slopes = [Depths(**depths).surface.depth_at(50.0, side)[2] for side in (-1e-3, 1e-3)]
    curvature = (slopes[0] - slopes[1]) / 2e-3
    tables = cable_scene(
        {"length": length, "mass": mass, "diameter": 0.05, "axial_stiffness": 1e6}, pinned_at(0, 0, 0),
        pinned_at(1.0005 * length, 0, 0), gravity=G, seabed={"z": 0.0, "stiffness": 1e5, "depths": depths},
        model="catenary", mesh=80
    )  # fmt: skip
    found = hybrid.modes(tables, count=3, friction=False).modes
    assert {x.what for x in found} == {"sideways"}
    exact = [2.0 * math.pi / math.sqrt(G * curvature + 500.0 / mass * (math.pi * n / length) ** 2) for n in (1, 2, 3)]
    np.testing.assert_allclose([x.period for x in found], exact, rtol=5e-4)


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_derivatives_on_a_hill_are_those_of_two_equilibria(model: str) -> None:
    """Of a line that lies on its side; without what the turning normal does they are off by up to a tenth."""
    of = ["tension@250", "position.z@30", "position.y@30", "reaction_end.x"]
    made = mooring(hill(), model=model)
    rest = at_rest(made, of)
    for key in ("cable.sections[0].mass", "ends.end.position[0]", "environment.seabed.stiffness"):
        number = rest.number(key)
        ours, d = rest.by([key])[0], 1e-5 * number
        more, less = (at_rest(changed_scene(made, key, number + x), of).values for x in (d, -d))
        np.testing.assert_allclose(ours, (more - less) / (2.0 * d), rtol=1.5e-5, err_msg=key)


def test_a_response_on_depths_of_a_plane_is_that_on_the_plane() -> None:
    """With what it says of line that lifts off the bed."""
    plane, grid = (
        hybrid.response(mooring(x)) for x in ({"z": -100.0, "slope": list(SLOPE)}, {"z": 0.0, "depths": PLANE})
    )
    assert any("lift off the bed" in x for x in plane.notes)
    assert grid.notes == plane.notes
    for what in ("tension", "curvature"):
        there = plane.lines["cable"].deviation(what)
        np.testing.assert_allclose(grid.lines["cable"].deviation(what), there, rtol=1e-6, atol=1e-9 * there.max())
