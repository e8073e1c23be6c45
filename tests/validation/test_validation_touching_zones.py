"""Zones that move, and lines that are paid out, beside what is touched: other lines, bodies, obstacles that move."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
import hybrid.simulation.run
from tests.combinations.pairs import scene_of
from tests.scenes import cable_scene, each_line, pinned_at
from tests.simulation.bits import resumed
from tests.validation.test_validation_body_contact import RADIUS, STRAND, on_two_lines, pushed
from tests.validation.test_validation_lines_contact import AREA, DENSITY, crossing, force_between, lowered
from tests.validation.test_validation_lines_contact import RADIUS as ROPE
from tests.validation.test_validation_obstacles_accuracy import DRAGGED, HEAVE, MOVES, PIPE

Tables = dict[str, Any]
TOLERANCE = 2e-3  # of the length of a line
MOVING = {"kind": "adaptive", "always_move": True, "tolerance": TOLERANCE}


def with_zones(network: Tables, **model: Any) -> Tables:
    """A scene of several lines with zones that move in each."""
    return each_line(network, model=MOVING | model)


def kinds(line: Any) -> set[str]:
    """Kinds of all zones at all outputs."""
    return {zone.kind for row in line.zones for zone in row}


def are_rod(line: Any, row: int, places: np.ndarray) -> bool:
    """Whether a line is rod at all of these arc lengths at an output."""
    zones = [z for z in line.zones[row] if z.kind == "rod"]
    return all(any(z.s_a <= s <= z.s_b for z in zones) for s in places)


# --- lines that touch each other -----------------------------------------------------------------------


def limp(network: Tables) -> Tables:
    """The ropes with a twentieth of their bending stiffness, which bends a few cells beside their crossing alone."""
    tables = deepcopy(network)
    for line in tables["lines"].values():
        (section,) = line["sections"]
        line["sections"] = [section | {"bending_stiffness": section["bending_stiffness"] / 20}]
    return tables


@pytest.mark.long
def test_crossing_ropes_at_rest_are_rods_where_they_cross() -> None:
    rods, zones = hybrid.static(limp(crossing(0.1))), hybrid.static(with_zones(limp(crossing(0.1))))
    off, on = force_between(zones, 0)
    assert off == pytest.approx(on, rel=1e-6)
    assert on == pytest.approx(force_between(rods, 0)[1], rel=0.01)
    for name, line in zones.lines.items():
        assert kinds(line) == {"rod", "catenary"} and are_rod(line, 0, line.s[39:42])
        assert apart(line, rods.lines[name]) < TOLERANCE


def test_a_rope_that_comes_down_is_rod_before_it_touches_and_moves_as_rods_do() -> None:
    """Without friction: with it a rod that nothing holds about its axis rolls, and beside catenaries it slides."""
    smooth = limp(lowered()) | {"contact": {}}
    rods, zones = hybrid.run(smooth), hybrid.run(with_zones(smooth))
    first = next(e.t for e in zones.events if e.kind == "lines touch")
    assert first == pytest.approx(next(e.t for e in rods.events if e.kind == "lines touch"), abs=0.011)
    upper, lower = zones.lines["upper"].position, zones.lines["lower"].position
    gap = np.linalg.norm(upper[:, :, None] - lower[:, None], axis=3)
    for name, axis in (("upper", 2), ("lower", 1)):
        line, like = zones.lines[name], rods.lines[name]
        assert kinds(line) == {"rod", "catenary"}
        assert 1e-7 < apart(line, like) < TOLERANCE
        for row, near in enumerate((gap < 2.2 * ROPE).any(axis=axis)):
            assert are_rod(line, row, line.s[near])
    force, like_force = (np.array([force_between(x, k) for k in range(len(x.times))]) for x in (zones, rods))
    late = zones.times > first + 0.3
    assert np.abs(force - like_force)[late].max() < 0.03 * np.abs(like_force[late]).max()


@pytest.mark.long
def test_rods_that_come_and_go_roll_with_their_inertia() -> None:
    """Of lines that nothing holds about their axis: without it ropes that rub were 0.10 m off, and a third of the work."""
    rods = hybrid.run(lowered())
    for model, far in ({"force_rod": [[0, 1]]}, 1e-3), ({}, 0.01):
        zones = hybrid.run(with_zones(lowered(), **model))
        for name, line in zones.lines.items():
            like = rods.lines[name]
            assert apart(line, like) < far, (name, model)
            assert line["work/friction"][-1] == pytest.approx(like["work/friction"][-1], rel=0.1)


def test_what_lines_do_to_each_other_is_booked_through_changes_of_zones() -> None:
    """As of rods, 2e-3 of what the pins do is left; what changes of zones put in is booked and small."""
    lines = hybrid.run(with_zones(limp(lowered()))).lines
    upper, lower = lines["upper"], lines["lower"]
    put_in = np.abs(upper["work/start"]).max() + np.ptp(upper["energy/potential"])
    assert max(np.abs(x["work/scheme"]).max() for x in (upper, lower)) < 2e-3 * put_in
    assert 0.0 < max(np.abs(x["work/zones"]).max() for x in (upper, lower)) < 0.01 * put_in


# --- bodies --------------------------------------------------------------------------------------------


def test_a_ball_rests_on_two_lines_that_are_rods_below_it_alone() -> None:
    rods, zones = hybrid.static(on_two_lines()), hybrid.static(with_zones(on_two_lines()))
    for side in ("left", "right"):
        line = zones.lines[side]
        assert kinds(line) == {"rod", "catenary"} and are_rod(line, 0, line.s[19:22])
        assert apart(line, rods.lines[side]) < 2 * STRAND * 0.05
    np.testing.assert_allclose(zones["bodies/ball/position"], rods["bodies/ball/position"], atol=1e-3)


def test_a_ball_that_falls_on_lines_finds_them_rod_and_moves_with_them_as_with_rods() -> None:
    rods, zones = hybrid.run(pushed()), hybrid.run(with_zones(pushed(), hold_time=0.02))
    ball, like = (np.array(x["bodies/ball/position"]) for x in (zones, rods))
    assert like[:, 2].min() < RADIUS + STRAND - 0.02  # it has struck, and the lines give way
    assert np.abs(ball - like).max() < 9.9 * TOLERANCE
    for line in zones.lines.values():
        assert {z.kind for z in line.zones[-1]} == {"rod", "catenary"}


# --- obstacles that move -------------------------------------------------------------------------------


# Zones beside rods of their mesh; cells that follow, which are asked for a tenth of the curvature, beside fine rods.
@pytest.mark.parametrize(
    ("model", "cells", "part"),
    [("zones that move", 48, 0.02), ("cells that follow", 192, 0.06)],
    ids=["zones", "follow"],
)
@pytest.mark.parametrize("obstacle", ["obstacle that moves", "sheave"])
def test_a_line_that_is_paid_out_over_what_moves_in_zones(obstacle: str, model: str, cells: int, part: float) -> None:
    """Three features at once: catenaries on both sides of the pipe, and what it bears, as of rods everywhere."""
    tables = scene_of("payout", model, obstacle)
    tables["model"] = {**tables["model"], "always_move": True}
    tables["model"].pop("force_rod", None)
    tables["cable"]["sections"][0] |= {"bending_stiffness": 0.2, "torsional_stiffness": 0.2}
    tables |= {"time": {"duration": 1.5, "step": 0.02}, "mesh": {"cells": 48}}
    zones, rods = hybrid.run(tables), hybrid.run(tables | {"model": "rod", "mesh": {"cells": cells}})
    rods_at = [(z.s_a, z.s_b) for z in zones.zones[-1] if z.kind == "rod"]
    assert any(a > 1.0 and b < 8.0 for a, b in rods_at) and {z.kind for z in zones.zones[-1]} == {"rod", "catenary"}
    force, like = (np.array(x["obstacles/pipe/force"]) for x in (zones, rods))
    assert np.abs(like).max() > 20.0
    assert np.abs(force - like).max() < part * np.abs(like).max()
    assert np.nanmax(np.linalg.norm(zones.position - rods.position, axis=2)) < 12.0 * 1e-3


# --- Zones that move on obstacles: rods where a line touches, and the answer of rods everywhere ---

MOVES_ALWAYS = {"kind": "adaptive", "always_move": True, "tolerance": 1e-3}


def fixed(tables: Tables, model: Any) -> Tables:
    """The scene on given cells in given steps."""
    duration = tables["time"]["duration"]
    return tables | {"model": model, "mesh": {"cells": 96}, "time": {"duration": duration, "step": 0.01},
                     "output": {"every": 0.1, "points": 97}}  # fmt: skip


def apart(a: Any, b: Any) -> float:
    return float(np.linalg.norm(np.array(a.position) - np.array(b.position), axis=2).max())


@pytest.mark.parametrize(
    ("tables", "most", "least"),
    [
        pytest.param(HEAVE, 0.01, 0.025, id="heave", marks=pytest.mark.long),
        pytest.param(DRAGGED, 0.01, 0.025, id="dragged", marks=pytest.mark.long),
        pytest.param(MOVES, 12.0 * 1e-3, 12.0 * 1e-3, id="pipe moves"),
    ],
)
def test_a_line_is_rod_where_it_touches_and_moves_as_one_that_is_rod_everywhere(
    tables: Tables, most: float, least: float
) -> None:
    """Catenaries everywhere are off by 3 cm, less on a pipe that moves; zones by less than their tolerance, 12 mm.

    Friction on a pipe that moves is carried through changes of zones.
    """
    rods, zones, catenary = (hybrid.run(fixed(tables, x)) for x in ("rod", MOVES_ALWAYS, "catenary"))
    axis, at = np.array(PIPE["axis"]) / np.linalg.norm(PIPE["axis"]), np.array([PIPE["at"]])
    if tables is MOVES:
        at, grip, like = (
            np.array(x)
            for x in (zones["obstacles/pipe/position"], zones["obstacles/pipe/force"], rods["obstacles/pipe/force"])
        )
        assert np.ptp(at[:, 2]) > 0.2 and np.abs(grip - like).max() < 0.02 * np.abs(like).max()
    w = np.array(zones.position) - at[:, None]
    gap = np.linalg.norm(w - (w @ axis)[..., None] * axis, axis=2) - PIPE["radius"] - 0.025
    assert all(are_rod(zones, row, zones.s[here < 0.02 * 0.05]) for row, here in enumerate(gap))
    assert kinds(zones) == {"rod", "catenary"} and (gap < 0.0).any()
    assert apart(catenary, rods) > least
    assert 1e-4 < apart(zones, rods) < most


@pytest.mark.long
@pytest.mark.parametrize("scene", [DRAGGED, MOVES], ids=["dragged", "pipe moves"])
def test_cells_that_follow_the_curvature_show_a_pipe(scene: Tables) -> None:
    """The curvature on it and elsewhere to the share that is asked."""
    tables = fixed(scene, {"kind": "adaptive", "curvature_error": 0.05})
    del tables["mesh"]
    follows, rods = hybrid.run(tables), hybrid.run(fixed(scene, "rod") | {"mesh": {"cells": 384}})
    kappa = np.array(rods["curvature"])
    error = np.abs(np.array(follows["curvature"]) - kappa).max() / kappa.max()
    assert 1e-3 < error < 0.05


def test_cells_that_follow_name_the_obstacle_whose_radius_they_do_not() -> None:
    """What a line knows of obstacles goes along where its cells change."""
    section = {"length": 11.62, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 20.0}
    over = [[0, 0, 0], [0.9, 0, -1.2], [4.4, 0, 0], [5.6, 0, 0], [9.1, 0, -1.2], [10, 0, 0]]
    result = hybrid.run(cable_scene(
        section | {"damping": {"mass": 1.0}}, pinned_at(0, 0, 0),
        pinned_at(10, 0, 0, motion={"heave": {"amplitude": 0.2, "period": 2}, "ramp": 2}),
        obstacles={"pipe": {"kind": "cylinder", "at": [5, 0, -0.6], "axis": [0, 1, 0], "radius": 0.5, "friction": 0.2}},
        initial={"kind": "points", "points": over}, model={"kind": "adaptive", "curvature_error": 0.05},
        time=(1.25, 0.005), output=0.25
    ))  # fmt: skip
    assert len(result.mesh[-1].s) != len(result.mesh[0].s)
    assert any("on obstacle pipe" in x.text for x in result.events)


# --- lines that are paid out while they touch other lines and bodies: the rest of longer lines, Coulomb's law ---

G, MORE = 9.81, 0.08  # m/s2; m that is paid out
FRICTION, ABOVE = 0.3, 0.04  # m, by how much higher the pins of the upper rope are


def let_out(friction: float, side: str = "end", duration: float = 3.0) -> Tables:
    """The upper rope hangs above the lower one until a winch has let out more of it."""
    tables = crossing(-ABOVE, contact={"friction": friction}, time={"duration": duration, "step": 0.01})
    upper = tables["lines"]["upper"]
    del upper["initial"]
    upper["connections"] = {side: {"kind": "pinned", "payout": {"rate": MORE, "ramp": 0.3, "until": 1.0}}}
    tables["output"] = {"points": 81, "every": 0.1}
    return tables


def longer() -> Tables:
    """At rest with as much rope."""
    tables = crossing(-ABOVE)
    (section,) = tables["lines"]["upper"]["sections"]
    tables["lines"]["upper"]["sections"] = [section | {"length": section["length"] + MORE}]
    tables["lines"]["upper"] |= {
        "mesh": {"cells": 86},
        "initial": {"points": [[-0.4, 0, 0.04], [0, 0, 0.36], [0.4, 0, 0.04]]},
    }
    return tables


@pytest.fixture(scope="module")
def rest() -> Any:
    return hybrid.static(longer())


def pressed(result: Any, row: int, length: float) -> tuple[float, float]:
    """By what the pins of the upper rope bear less than its weight, and those of the lower one more, N."""
    off, on = force_between(result, row)
    return off + DENSITY * AREA * G * (length - 1.0), on


@pytest.mark.parametrize("side", ["end", "start"])
def test_a_rope_that_is_let_out_onto_another_rests_as_one_that_is_longer(side: str, rest: Any) -> None:
    result = hybrid.run(let_out(0.0, side, 6.0))
    assert any(e.kind == "lines touch" and 0.1 < e.t < 1.5 for e in result.events)
    assert result.lines["upper"]["payout/length"][-1] == pytest.approx(1.0 + MORE)
    _, wanted = pressed(rest, 0, 1.0 + MORE)
    off, on = pressed(result, -1, 1.0 + MORE)
    assert wanted > 0.05
    assert on == pytest.approx(wanted, rel=0.01)
    assert off == pytest.approx(on, rel=0.01)
    assert result["contacts/upper/lower/force"][-1, 2] == pytest.approx(on, rel=2e-3)
    lowest, like = (x.lines["upper"].position[-1][:, 2].min() for x in (result, rest))
    assert lowest == pytest.approx(like, abs=0.1 * ROPE)


# --- with friction, both ways ---------------------------------------------------------------------------


def in_and_out(duration: float = 2.4) -> Tables:
    """The rope is let out onto the other one and taken in again, over it, with friction."""
    tables = let_out(FRICTION, duration=duration)
    rates = [[0.0, 0.0], [0.3, 0.1], [0.9, 0.1], [1.2, 0.0], [1.5, 0.0], [1.8, -0.02], [6.0, -0.02]]
    tables["lines"]["upper"]["connections"]["end"]["payout"] = {"rates": rates}
    return tables


@pytest.fixture(scope="module")
def whole() -> hybrid.Result:
    return hybrid.run(in_and_out())


def test_what_a_paid_rope_does_to_another_is_booked(whole: hybrid.Result) -> None:
    """Nodes have entered and left in contact; 1e-3 of what the winch does is left, and friction takes energy."""
    upper, lower = whole.lines["upper"], whole.lines["lower"]
    length = np.array(upper["payout/length"])
    assert np.ptp(length) > 2.0 / 80
    touching = np.array(upper["self_contact"]).max(axis=1) > 0.0
    assert np.ptp(length[touching]) > 1.0 / 80
    winch = np.abs(upper["work/end"]).max()
    assert max(np.abs(x["work/scheme"]).max() for x in (upper, lower)) < 1e-3 * winch
    assert max(np.abs(x["work/zones"]).max() for x in (upper, lower)) < 5e-3 * winch
    assert float(upper["work/friction"][-1] + lower["work/friction"][-1]) < 0.0
    np.testing.assert_allclose(upper["energy/self_contact"], lower["energy/self_contact"], atol=1e-12)


FOLLOWS = {"kind": "adaptive", "tolerance": TOLERANCE, "hold_time": 0.2, "curvature_error": 0.05}


@pytest.mark.long
@pytest.mark.parametrize("upper", ["rod", FOLLOWS], ids=["rod", "follows"])
def test_contact_of_a_paid_rope_with_one_whose_cells_follow_goes_on_to_the_bit(upper: Any, tmp_path: Path) -> None:
    """In a run that is resumed, too, contact has cells as long as they were when its arrays were made, or 3e-9 m off.

    The force at an output within a step is of the rope that is out then: 1.6e-5 off with that behind the step.
    """
    tables = limp(in_and_out(0.8))
    tables["lines"]["upper"]["connections"]["end"]["payout"]["longest"] = 1.11
    for name, model in (("upper", upper), ("lower", FOLLOWS)):
        tables["lines"][name]["model"] = model
    assert np.ptp(resumed(tables, tmp_path, 0.6).lines["upper"]["payout/length"]) > 0.01


def test_first_in_the_scene_or_last_it_is_the_same(whole: hybrid.Result) -> None:
    """The line that grows stands before the other one in the arrays of contact, or behind it.

    Which of two strands looks for feet on the other changes the answer: 1.7e-4 m where a rope comes down without a winch.
    """
    tables = in_and_out()
    tables["lines"] = dict(reversed(tables["lines"].items()))
    other = hybrid.run(tables)
    assert [*other.lines] == ["lower", "upper"]
    for name, line in whole.lines.items():
        np.testing.assert_allclose(other.lines[name].position, line.position, atol=2e-5)


# --- bodies ---------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_ball_goes_down_on_lines_that_are_let_out() -> None:
    """It swings about where it rests on longer lines."""
    paid, like = on_two_lines(), on_two_lines()
    paid["time"], paid["output"]["every"] = {"duration": 8.0, "step": 0.01}, 0.1
    for line, longer in zip(paid["lines"].values(), like["lines"].values(), strict=True):
        (section,) = line["sections"]
        line["connections"] = {"end": {"kind": "pinned", "payout": {"rate": 0.04, "ramp": 1.0, "until": 2.0}}}
        longer["sections"] = [section | {"length": section["length"] + 0.08}]
    moved, rest = hybrid.run(paid), hybrid.static(like)
    height, place = np.array(moved["bodies/ball/position"])[:, 2], float(rest["bodies/ball/position"][-1][2])
    assert height[0] - place > 0.05
    late = height[moved.times > 4.0]
    assert np.ptp(late) < 0.5 * (height[0] - place)
    assert late.mean() == pytest.approx(place, abs=0.02 * (height[0] - place))
