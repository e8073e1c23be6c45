"""Modes, response and derivatives of lines on obstacles, and of lines that touch each other, bodies and sheaves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers_and_results import changed_scene
from hybrid.linear.eigen import lowest_modes
from hybrid.linear.matrices import linear_network
from hybrid.modal.api import equilibrium_of
from hybrid.scene.read import as_scene
from hybrid.scene.sea import Depths
from tests.designs.test_touching_lines import beside
from tests.scenes import cable_scene, line_between, network_scene, pinned_at
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


# --- lines that touch each other, free bodies and sheaves: runs in time, and what must be the same ---

NO_CONTACT = {"contact": {"self": False}}


def crossing(gap: float, friction: float) -> Tables:
    """Two taut wires that cross, pressed on each other where the gap (m) of their pins is below zero."""
    tables = beside(gap) | {"environment": {}, "contact": {"friction": friction}}
    for line in tables["lines"].values():
        line["mesh"], line["sections"] = {"cells": 40}, [line["sections"][0] | {"damping": {"mass": 2.0}}]
    return tables


def drum(friction: float, damping: float = 0.0) -> Tables:
    """A rope over a drum that hangs on two stays."""
    rope = {"length": 7.0, "mass": 1.5, "diameter": 0.03, "axial_stiffness": 2e5, "bending_stiffness": 5.0}
    stay = {"length": 2.4, "mass": 0.3, "diameter": 0.02, "axial_stiffness": 1e5, "damping": {"mass": 3.0}}
    over = [[-2.8, 0.1, -1.5], [-0.65, 0.03, 0.1], [0, 0, 0.62], [0.65, 0, 0.1], [2.6, 0, -1.8]]
    held = {"a": over[0], "b": over[-1], "u": [-0.3, -1.2, 2.3], "w": [0.3, 1.2, 2.3]}
    stays = {"sections": [stay], "model": "catenary", "mesh": {"cells": 6}} | NO_CONTACT
    return network_scene(
        {name: {"position": x} for name, x in held.items()} | {name: {"body": "drum", "place": [0, y, 0]} for name,
            y in (("p", -0.9), ("q", 0.9))},
        {"rope": line_between("a", "b", rope | {"damping": {"mass": 3.0}}, model="rod", mesh=64,
                              initial={"points": over}) | NO_CONTACT,
         "one": {"start": "u", "end": "p"} | stays, "two": {"start": "w", "end": "q"} | stays},
        fluid={"density": 1.0},
        bodies={"drum": {"initial_guess": [0, 0, 0], "mass": 60.0, "inertia": [12.0, 8.0, 12.0],
                         "centre": [0, 0, -0.15], "damping": [120, 120, 120, 24, 16, 24],
                         "shape": {"kind": "cylinder", "axis": [0, 1, 0], "length": 1.6, "radius": 0.6,
                                   "friction": friction, "damping": damping}}}
    )  # fmt: skip


def over_sheave(friction: float, inertia: float = 0.0) -> Tables:
    """A rope over a sheave between two pins; inertia 0: over a drum that stands."""
    section = {"length": 9.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 2e4, "bending_stiffness": 5.0,
               "damping": {"mass": 3.0}}  # fmt: skip
    pipe = {"kind": "cylinder", "at": [4, 0, -2], "axis": [0.1, 1, 0.05], "radius": 0.8, "friction": friction}
    over = [[0, 0, -2.5], [3, 0, -1.3], [4, 0, -1.15], [5, 0.1, -1.3], [8, 0.3, -3]]
    return network_scene(
        {"a": {"position": over[0]}, "b": {"position": over[-1]}},
        {"rope": line_between("a", "b", section, model="rod", mesh=72, initial={"points": over}) | NO_CONTACT},
        gravity=9.81, obstacles={"pipe": pipe | ({"bearing": {"inertia": inertia, "damping": 2.0}} if inertia else {})}
    )  # fmt: skip


def amplitude(x: Any, times: Any, period: float, per: int = 20) -> Any:
    """Complex amplitudes of the first harmonic in the last period of so many outputs."""
    last = slice(-per - 1, -1)
    turn = np.exp(2j * np.pi / period * times[last]).reshape(-1, *[1] * (np.ndim(x) - 1))
    return 2.0 * ((x[last] - x[last].mean(axis=0)) * turn).mean(axis=0)


# Scene, point that moves, period (s), amplitude (m), steps to a period, periods.
RUNS: dict[str, tuple[Tables, str, float, float, int, int]] = {
    "lines": (crossing(-0.1, 0.3), "c", 1.3, 5e-5, 100, 5),
    "a body": (drum(0.3, 1000.0), "b", 1.4, 5e-5, 40, 8),
    "a sheave": (over_sheave(0.3, 0.5), "b", 0.5, 1e-5, 50, 10),
}


@pytest.mark.long
@pytest.mark.parametrize("what", RUNS)
def test_the_response_is_the_motion_of_a_run(what: str) -> None:
    tables, point, period, size, steps, periods = RUNS[what]
    moves = {x: {"amplitude": size, "period": period} for x in ("surge", "sway", "heave")}
    moved = tables | {"points": tables["points"] | {point: tables["points"][point] | {
        "motion": moves | {"ramp": 2.0 * period}}}}  # fmt: skip
    moved |= {"time": {"duration": periods * period, "step": period / steps}}
    moved |= {"output": {"every": period / 20, "points": 41}}
    found, run = hybrid.response(moved), hybrid.run(moved)
    assert not any("contact" in x or "lift" in x for x in found.notes), found.notes
    for name, line in run.lines.items():
        there, here = found.lines[name], amplitude(line.position, line.times, period)
        ours = there.position.sum(axis=0)
        ours = np.stack(
            [np.interp(line.s, there.s, x.real) + 1j * np.interp(line.s, there.s, x.imag) for x in ours.T], 1
        )
        np.testing.assert_allclose(ours, here, atol=0.03 * np.abs(here).max())
    for name, body in found.bodies.items():
        here = amplitude(run[f"bodies/{name}/position"], run.times, period)
        np.testing.assert_allclose(body.sum(axis=0)[:3], here, atol=0.03 * np.abs(here).max())


def squares(tables: Tables, sticks: bool = True) -> Any:
    """w^2 (1/s^2) of the lowest modes on the usual mesh."""
    rest = equilibrium_of(as_scene(tables))
    network = linear_network(rest.solver, rest.states, rest.names, sticks, touching=rest.touching)
    return np.array([x for x in lowest_modes(network, 7).squares if x > 1.0])[:5]


def test_what_does_not_touch_swings_as_without_contact() -> None:
    apart = crossing(0.3, 0.2)
    np.testing.assert_allclose(squares(apart), squares(apart | {"contact": {"between": []}}), rtol=1e-9)


@pytest.mark.long
def test_a_sheave_is_felt_by_friction_alone_and_a_heavy_one_stands() -> None:
    still, light = squares(over_sheave(0.3)), squares(over_sheave(0.3, 0.5))
    np.testing.assert_allclose(squares(over_sheave(0.3, 1e9)), still, rtol=1e-6)
    assert light[0] < 0.7 * still[0]  # the rope runs to and fro over it
    smooth = squares(over_sheave(0.3), sticks=False)
    np.testing.assert_allclose(squares(over_sheave(0.3, 0.5), sticks=False), smooth, rtol=1e-9)
    alone = over_sheave(0.3, 0.5)
    line, ends = alone.pop("lines")["rope"], alone.pop("points")
    alone |= {"cable": {"sections": line["sections"]}, "contact": {"self": False}, "model": "rod", "mesh": line["mesh"],
              "initial": {"kind": "equilibrium"} | line["initial"],
              "ends": {x: {"kind": "pinned"} | ends[y] for x, y in (("start", "a"), ("end", "b"))}}  # fmt: skip
    found = hybrid.modes(alone, 2)
    assert found.modes[0].period == pytest.approx(2.0 * np.pi / np.sqrt(light[0]), rel=1e-6)
    assert abs(found.modes[0].sheaves["pipe"]) > 0.5 and "sheave pipe" in found.modes[0].energy


@pytest.mark.long
@pytest.mark.parametrize(
    ("tables", "size", "says"),
    [
        (crossing(-0.1, 0.3), 0.02, ("contact of lines wire and hose opens and closes", "lines wire and hose slides")),
        (crossing(0.045, 0.0), 0.02, ("lines wire and hose come to touch each other",)),
        (drum(0.0), 0.1, ("lift off body drum",)),
    ],
)
def test_it_says_where_contact_does_not_stay_as_it_is(tables: Tables, size: float, says: tuple[str, ...]) -> None:
    point = "b" if "bodies" in tables else "c"
    motion = {x: {"amplitude": size, "period": 1.2} for x in ("surge", "heave")} | {"ramp": 2.0}
    moved = tables | {"points": tables["points"] | {point: tables["points"][point] | {"motion": motion}}}
    notes = hybrid.response(moved).notes
    assert all(any(x.startswith(("not valid", "line")) and text in x for x in notes) for text in says), notes
