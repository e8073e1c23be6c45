"""Modes and response of lines that touch each other, free bodies and sheaves: runs in time, and what must be the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.linear.eigen import lowest_modes
from hybrid.linear.matrices import linear_network
from hybrid.modal.api import equilibrium_of
from hybrid.scene.read import as_scene
from tests.designs.test_touching_lines import beside
from tests.scenes import line_between, network_scene

Tables = dict[str, Any]
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
