"""Pairs of features against closed forms, and against the same line computed by something else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError
from hybrid.scene.wave_theory import steady_wave, wavenumber
from tests.combinations.pairs import BASE, CLAMP, END, FAR, START, ZONES, S, Tables
from tests.problems import tables_with
from tests.scenes import cable_scene, pinned_at

EXACT: Tables = {"output.exact": True}


def ran(**changes: Any) -> hybrid.Result:
    """The tiny scene of the pairs with these changes, by key."""
    return hybrid.run(tables_with(BASE, EXACT | changes))


def apart(one: hybrid.Result, two: hybrid.Result, field: str = "position") -> float:
    """Largest difference over the largest value."""
    return float(np.abs(one[field] - two[field]).max() / np.abs(one[field]).max())


# --- rotary inertia, of zones that move -----------------------------------------------------------

HEAVY = {S + "rotary_inertia": [0.6, 0.9]}  # kg m: as much kinetic energy as the mass has, in waves of 2 m


@pytest.mark.parametrize("rods", [[[0, 12]], [[0, 4], [8, 12]]])
@pytest.mark.parametrize("torque", [0.0, 2e-3])
def test_rods_of_zones_that_move_have_the_inertia_of_rods_that_stay(rods: list[list[float]], torque: float) -> None:
    whole = len(rods) == 1
    stays: Tables = {"model": "rod"} if whole else {"model": ZONES, "mesh": None}
    moves = {"model": {"kind": "adaptive", "force_rod": rods} | ({} if whole else {"force_catenary": [[4, 8]]})}
    more = {S + "tension_torque": torque} if torque else {}
    one, two, without = ran(**stays, **HEAVY, **more), ran(**moves, **HEAVY, **more), ran(**stays, **more)
    assert apart(one, two) < 1e-9
    assert apart(one, two, "energy/kinetic") < 1e-6
    assert apart(one, without) > 1e-4


@pytest.mark.long  # 1.1 s
def test_a_taut_line_whose_rods_come_and_go_is_as_slow_as_that_of_rayleigh() -> None:
    """omega^2 = (T k^2 + EI k^4)/(m + J k^2), k = n pi/L, of a line with hinged ends."""
    pull, EI, EA, J, mass, length = 400.0, 200.0, 1e7, 3.0, 2.0, 10.0
    section = {"length": length, "mass": mass, "axial_stiffness": EA, "bending_stiffness": EI,
               "torsional_stiffness": 100.0, "rotary_inertia": J}  # fmt: skip
    far = {"kind": "pinned", "position": [length * (1.0 + pull / EA), 0, 0]}
    found = hybrid.modes(
        cable_scene(section, pinned_at(0, 0, 0), far, gravity=0.0,
                    model={"kind": "adaptive", "force_rod": [[0, length]]}, mesh=100),
        20
    )  # fmt: skip
    omega = np.array([2.0 * np.pi / x.period for x in found.modes])
    for n in (1, 2, 3):
        k = n * np.pi / length
        expected = np.sqrt((pull * k**2 + EI * k**4) / (mass + J * k**2))
        assert np.sum(np.abs(omega / expected - 1.0) < 1e-3) == 2  # in both planes


def test_energy_of_rods_with_inertia_that_come_and_go_is_booked() -> None:
    """What a switch puts in, that of inertia included, is in work/zones; what is left for the scheme stays small."""
    model = {"kind": "adaptive", "hold_time": 0.1, "tolerance": 0.02}
    motion = {"travel": {"by": [-4.0, 0, 0], "over": 2.0}}
    far = {"kind": "pinned", "position": [11.4, 0, 0], "motion": motion}
    more = {"ends.end": far, "time": {"duration": 3.0, "step": 0.01}, "mesh.cells": 48}
    moved = ran(model=model, **HEAVY, **more)
    booked = np.abs(np.diff(moved["work/zones"])).sum()
    own = max(np.abs(ran(model=kind, **HEAVY, **more)["work/scheme"]).max() for kind in ("rod", "catenary"))
    assert sum(x.kind in ("split", "grow") for x in moved.events) > 5 and booked > 0.0
    assert np.abs(moved["work/scheme"]).max() <= 2.0 * own + 0.1 * booked


# --- zones that move, of lines that are clamped to what is free -------------------------------------

SPAN = 20.0  # m, of each of two lines with what is free between them
COMES = {"kind": "adaptive", "hold_time": 0.1, "tolerance": 1e-3}


def between(body: bool, moment: float = 0.0, gravity: float = 9.81, far: Tables | None = None, **line: Any) -> Tables:
    """Two lines along x, clamped to a free body or point between them.

    moment: N m, about x, on the body, until 1 s; far: how lines are connected at their other ends.
    """
    section = {
        "length": SPAN, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 20.0, "torsional_stiffness": 15.0,
        "damping": {"mass": 0.5},
    }  # fmt: skip
    held = {"kind": "clamped"} | ({"tangent": [1, 0, 0]} if body else {}) | (far or {})
    one = {"sections": [section], "mesh": {"cells": 100}} | line
    far = {"start": far, "end": far} if far else {}
    sag = -1.5 if gravity else 0.0
    stretched = SPAN + (0.0 if gravity else 0.005)
    motion = {"travel": {"by": [0.3, 1.0, 0.5] if gravity else [0, 0, 0], "over": 1.0}}
    middle: Tables = {"points": {"m": {"kind": "free", "mass": 30.0, "initial_guess": [0, 0, sag]}}}
    if body:
        load = {"value": [moment, 0, 0], "until": 1.0}
        middle = {
            "points": {"l": {"body": "buoy", "place": [-0.3, 0, 0]}, "r": {"body": "buoy", "place": [0.3, 0, 0]}},
            "bodies": {"buoy": {"mass": 30.0, "inertia": [0.5, 1, 1], "initial_guess": [0, 0, sag], "moment": load}},
        }
    l, r, x = ("l", "r", 0.3) if body else ("m", "m", 0.0)
    middle["points"] |= {
        "a": {"position": [-stretched - x, 0, 0]}, "b": {"position": [stretched + x, 0, 0], "motion": motion},
    }  # fmt: skip
    return middle | {
        "environment": {"gravity": gravity},
        "lines": {"left": {"start": "a", "end": l, "connections": far | {"end": held}} | one,
                  "right": {"start": r, "end": "b", "connections": far | {"start": held}} | one},
        "time": {"duration": 2.0, "step": 0.02}, "output": {"every": 0.1, "points": 41, "exact": True},
    }  # fmt: skip


@pytest.mark.parametrize("body", [True, False])
def test_rods_of_zones_that_move_stay_at_a_clamp_to_what_is_free(body: bool) -> None:
    """And bear its moment as rods do everywhere: 2 sqrt(EI/T) of rod at least, which leave out 1.8 % of it."""
    rod, moved = (hybrid.run(between(body, model=model)) for model in ("rod", COMES))
    for name, k in (("left", -1), ("right", 0)):
        here, there = moved.lines[name], rod.lines[name]
        assert all(zones[k].kind == "rod" and len(zones) > 1 for zones in here.zones)
        M = there["bending_moment"][:, k]
        assert np.abs(here["bending_moment"][:, k] - M).max() < 0.02 * M.max()
        assert np.abs(here.position - there.position).max() < 1e-3 * SPAN
    if body:
        rotation = rod.bodies["buoy/rotation"]
        assert np.abs(moved.bodies["buoy/rotation"] - rotation).max() < 0.02 * np.ptp(rotation)


@pytest.mark.parametrize("body", [True, False])
def test_zones_that_are_given_are_those_that_stay_at_a_clamp_to_what_is_free(body: bool) -> None:
    moves = {"kind": "adaptive", "hold_time": 0.1}
    answers = []
    for kind in ("zones", "adaptive"):
        tables = between(body, mesh=None if kind == "zones" else {"cells": 20})
        for name, rod in (("left", [15, 20]), ("right", [0, 5])):
            pieces = [{"rod": 5, "cells": 5}, {"catenary": 15, "cells": 15}][:: -1 if name == "left" else 1]
            rest = [0, 15] if name == "left" else [5, 20]
            given = moves | {"force_rod": [rod], "force_catenary": [rest]}
            tables["lines"][name]["model"] = {"kind": kind, "zones": pieces} if kind == "zones" else given
        answers.append(hybrid.run(tables))
    for name in ("left", "right"):
        one, two = (x.lines[name] for x in answers)
        assert apart(one, two) < 1e-8 and apart(one, two, "bending_moment") < 1e-6


def test_a_body_between_lines_whose_zones_move_turns_as_their_torsion_has_it() -> None:
    """M L/(2 GJ) under a moment about the lines, which pass the torque through catenaries; then as between rods."""
    far = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 1, 0]}
    rod, moved = (hybrid.run(between(True, 0.6, 0.0, far, model=model)) for model in ("rod", COMES))
    turned = moved.bodies["buoy/rotation"]
    assert all(x.kind == "rod" for zones in rod.lines["left"].zones for x in zones)
    assert any(x.kind == "catenary" for zones in moved.lines["left"].zones for x in zones)
    assert turned[0, 0] == pytest.approx(np.degrees(0.6 * SPAN / 30.0), rel=1e-6)
    assert np.abs(turned - rod.bodies["buoy/rotation"]).max() < 1e-5 * turned[0, 0]


# --- cells to a boundary layer --------------------------------------------------------------------


def at_clamps(payout: Tables, **changes: Any) -> tuple[np.ndarray, int]:
    """Curvature (times, 2) 1/m at both clamps of a line that hardly swings, and its cells at first."""
    found = ran(
        **{START: CLAMP, END: FAR | payout, S + "damping": {"mass": 8.0}, "time": {"duration": 1.5, "step": 0.02},
           "output.every": 0.5} | changes
    )  # fmt: skip
    return found["curvature"][:, [0, -1]], found.mesh[0].s.size - 1


def test_cells_to_a_layer_show_the_bend_at_both_clamps_of_a_line_that_is_paid_out() -> None:
    """Also where new line comes: cells behind the winch ride with it.  Against 400 cells, which are off by 0.08 %."""
    paid: Tables = {"payout": {"rate": 0.2, "ramp": 1.0}}
    true, _ = at_clamps(paid, mesh={"cells": 400})
    even, _ = at_clamps(paid, mesh={"cells": 60})
    assert np.abs(even / true - 1.0).min() > 0.03
    for count, bound in ((2, 0.02), (4, 0.006), (8, 0.0015)):
        found, cells = at_clamps(paid, mesh=None, resolution={"cells_per_layer": count})
        assert np.abs(found / true - 1.0).max() < bound and cells < 120


@pytest.mark.parametrize("paid", [False, True])
def test_base_cells_to_a_layer_of_cells_that_follow_show_the_bend_at_both_clamps(paid: bool) -> None:
    payout: Tables = {"payout": {"rate": 0.2, "ramp": 1.0}} if paid else {}
    true, _ = at_clamps(payout, mesh={"cells": 400})
    follows: Tables = {"model": {"kind": "adaptive", "curvature_error": 0.1}, "mesh": None}
    alone, _ = at_clamps(payout, **follows)
    assert np.abs(alone / true - 1.0).max() > (0.05 if paid else 0.015)
    for count, bound in ((2, 0.025), (4, 0.01), (8, 0.003)):
        found, _ = at_clamps(payout, resolution={"cells_per_layer": count}, **follows)
        assert np.abs(found / true - 1.0).max() < bound


# --- breaks at clamps -----------------------------------------------------------------------------


def knotted(point: Tables, how: Tables, *weak: str, body: bool = False, third: bool = True) -> hybrid.Result:
    """Two lines, and a pinned one below, that meet at m; the lines `weak` break from it at 0.3 s, of a body or a point.

    point: what m is, how: how the two are connected to it.
    """
    section = {
        "mass": 1.0, "axial_stiffness": 1e5, "bending_stiffness": 20.0, "torsional_stiffness": 15.0,
        "damping": {"mass": 0.5},
    }  # fmt: skip
    names = {"left": "m1", "right": "m2", "down": "m3"} if body else dict.fromkeys(("left", "right", "down"), "m")
    tables: Tables = {
        "points": {"a": {"position": [-9, 0, 0]}, "b": {"position": [9, 0, 1]}, "c": {"position": [0, 0, -9]}},
        "time": {"duration": 1.0, "step": 0.01}, "output": {"every": 0.05, "points": 13, "exact": True}, "lines": {},
    }  # fmt: skip
    places = {name: {"body": "m", "place": [0, 0, 0]} for name in names.values()} if body else {"m": point}
    tables["points"] |= places
    tables |= {"bodies": {"m": point}} if body else {}
    for name, start, end, length in (("left", "a", None, 12), ("right", None, "b", 8), ("down", None, "c", 8)):
        at = names[name]
        line: Tables = {"start": start or at, "end": end or at, "sections": [{"length": length} | section]}
        key = "end" if end is None else "start"
        line |= {"model": "rod", "mesh": {"cells": 4 * length}} | (
            {"connections": {key: how}} if name != "down" else {}
        )
        line |= {"break_at": {"time": 0.3, "end": key}} if name in weak else {}
        if third or name != "down":
            tables["lines"][name] = line
    if not third:
        tables["points"].pop("c")
    return hybrid.run(tables)


def test_a_line_that_breaks_off_another_one_leaves_that_as_an_end_that_is_let_go() -> None:
    """The line that stays clamped to the point, alone, is one cable whose clamp is released."""
    found = knotted({"kind": "free", "initial_guess": [1, 0, -2]}, {"kind": "clamped"}, "left", third=False)
    turned = np.radians(found.points["m/rotation"][0])
    assert not turned[[0, 2]].any()
    place, tangent = found.lines["right"].position[0, 0], [np.cos(turned[1]), 0.0, -np.sin(turned[1])]
    section = {"length": 8, "mass": 1.0, "axial_stiffness": 1e5, "bending_stiffness": 20.0, "torsional_stiffness": 15.0,
               "damping": {"mass": 0.5}}  # fmt: skip
    released = {"kind": "clamped", "position": place.tolist(), "tangent": tangent, "release_at": {"time": 0.3}}
    alone = hybrid.run(cable_scene(
        section, released, pinned_at(9, 0, 1), model="rod", mesh=32, time=(1.0, 0.01),
        output={"every": 0.05, "points": 13, "exact": True}
    ))  # fmt: skip
    moved = found.lines["right"].position
    assert np.ptp(moved[:, 0], axis=0).max() > 1.0
    assert np.abs(alone.position - moved).max() < 1e-7


def test_a_point_that_all_clamped_lines_have_left_moves_as_a_body_whose_turns_nothing_feels() -> None:
    clamp = {"kind": "clamped", "tangent": [1, 0, 0]}
    mass: Tables = {"mass": 2.0, "initial_guess": [1, 0, -2]}
    point = knotted({"kind": "free"} | mass, clamp, "left", "right")
    body = knotted({"inertia": [0.3, 0.3, 0.3]} | mass, clamp, "left", "right", body=True)
    for name in ("left", "right", "down"):
        assert np.abs(point.lines[name].position - body.lines[name].position).max() < 1e-8
    assert np.ptp(point.lines["down"].position[:, 0], axis=0).max() > 0.3
    assert np.abs(np.diff(point.points["m/rotation"][7:], axis=0)).max() == 0.0


def test_clamps_at_a_point_that_gives_way_hold_no_longer_and_their_energy_is_booked() -> None:
    """Clamps that only hold the twist are pins; rigid ones go with the energy of their bends."""
    weak: Tables = {"position": [2, 0, -2], "break_at": {"time": 0.3}}
    pins, soft, rigid = (
        knotted(weak, how)
        for how in (
            {"kind": "pinned"},
            {"kind": "clamped", "tangent": [1, 0, 0], "bend_stiffness": 0.0},
            {"kind": "clamped", "tangent": [1, 0, 0]},
        )
    )
    for name in ("left", "right", "down"):
        assert np.abs(pins.lines[name].position - soft.lines[name].position).max() < 1e-8
        line = rigid.lines[name]
        assert np.abs(line["bending_moment"][8:, -1 if name == "left" else 0]).max() < 1e-9
        assert np.abs(line["work/scheme"]).max() < 0.02 * np.ptp(line["energy/kinetic"])


# --- turns of lines that are clamped to what is free ------------------------------------------------


@pytest.mark.parametrize("model", ["rod", COMES], ids=["rod", "moves"])
@pytest.mark.parametrize("at", ["start", "end"])
@pytest.mark.parametrize("body", [True, False])
def test_turns_of_one_of_two_lines_are_shared_by_both(body: bool, at: str, model: Any) -> None:
    """What is between two equal lines turns back by half of them, and both have the torque GJ pi N/L.

    By half a turn and more it is refused: nobody could tell how often it has gone round.
    """
    far = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 1, 0]}
    tables = between(body, 0.0, 0.0, far, model=model, mesh={"cells": 30})
    tables.pop("time"), tables.pop("output")
    connections = tables["lines"]["left"]["connections"]
    for turns in (0.25, 0.9, 1.3):
        sign = 1.0 if at == "end" else -1.0
        line = tables["lines"]["left"] | {"connections": connections | {at: connections[at] | {"turns": turns}}}
        scene = tables | {"lines": tables["lines"] | {"left": line}}
        if turns > 1.0:
            with pytest.raises(ComputationError, match="not twisted by the turns"):
                hybrid.static(scene)
            return
        found = hybrid.static(scene)
        rotation = (found.bodies["buoy/rotation"] if body else found.points["m/rotation"])[0]
        assert rotation == pytest.approx([-sign * 180.0 * turns, 0.0, 0.0], abs=1e-5)
        for name in ("left", "right"):
            torque = found.lines[name]["torque"][0]
            assert torque == pytest.approx(sign * 15.0 * np.pi * turns / SPAN, rel=1e-6)


# --- stress of a pipe that is curved without load ---------------------------------------------------

PIPE = {S + "pipe": {"wall": 0.003, "modulus": 2e8}, S + "intrinsic_curvature": [0.0, 0.02, 0.0]}


def test_a_pipe_that_lies_as_it_was_made_has_no_stress_and_bent_straight_that_of_its_curvature() -> None:
    """sigma = E d/2 |kappa - kappa_0|; outputs and extremes over all steps."""
    kappa, length, d, E = 0.02, 12.0, 0.03, 2e8
    at, along = np.sin(kappa * length) / kappa, (1.0 - np.cos(kappa * length)) / kappa
    bare = {"environment.gravity": 0.0, "model": "rod", "mesh.cells": 48, "time": {"duration": 0.1, "step": 0.02}}
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [0, 1, 0]}
    for sign in (1.0, -1.0):
        free = ran(
            **{START: start, END: {"kind": "free"}} | bare | PIPE | {S + "intrinsic_curvature": [0, sign * kappa, 0]}
        )
        assert free["von_mises"].max() < 1e-6 * E
        assert free["curvature"][0, 1:-1] == pytest.approx(kappa, rel=1e-6)
        assert np.linalg.norm(free.position[0, -1]) == pytest.approx(np.hypot(at, along), rel=1e-3)
        straight = ran(
            **{START: start, END: start | {"position": [length, 0, 0]}} | bare | PIPE
            | {S + "intrinsic_curvature": [0, sign * kappa, 0]}
        )  # fmt: skip
        assert straight["von_mises"] == pytest.approx(0.5 * E * d * kappa, rel=1e-6)
        assert straight.envelope["von_mises_max"].max() == pytest.approx(0.5 * E * d * kappa, rel=1e-6)


def off_its_moment(natural: list[float], cells: int, model: str = "rod") -> tuple[float, float]:
    """How far the stress of a curved pipe is from that of its moment, tension and torque: at the clamp, and elsewhere.

    A catenary has the most that both curvatures can make.
    """
    d, wall, E, EI = 0.03, 0.003, 2e8, 20.0
    curved = PIPE | {S + "intrinsic_curvature": natural}
    found = ran(**{START: CLAMP, "model": model, "mesh.cells": cells} | curved)
    bore = d - 2.0 * wall
    area, polar = 0.25 * np.pi * (d**2 - bore**2), np.pi / 32.0 * (d**4 - bore**4)
    bend = found["bending_moment"] / EI if model == "rod" else found["curvature"] + np.hypot(*natural[:2])
    axial = found["tension"] / area + 0.5 * E * d * bend
    torque = found["torque"] if model == "rod" else 0.0
    off = np.abs(found["von_mises"] / np.sqrt(axial**2 + 3.0 * (0.5 * torque * d / polar) ** 2) - 1.0)
    largest, seen = found.envelope["von_mises_max"].max(), found["von_mises"].max()
    assert seen * (1.0 - 1e-6) <= largest < 1.2 * seen
    return float(off[:, 0].max()), float(off[:, 1:].max())


def test_stress_of_a_curved_pipe_is_that_of_its_moment() -> None:
    """To second order in the cells, as moments are projected on tangents between cells.

    At a clamp to first order where there is torque: its half cell bends about axes that are turned by half its bend
    against those of the clamp, and so is the torque that it bears.  Without torque it is exact there.
    """
    at_clamp, along = np.array([off_its_moment([0.03, 0.05, 0.01], cells) for cells in (24, 48, 96)]).T
    assert along[1] < 2e-5 and np.log2(along[:-1] / along[1:]) == pytest.approx(2.0, abs=0.05)
    assert at_clamp[1] < 5e-4 and np.log2(at_clamp[:-1] / at_clamp[1:]) == pytest.approx(1.0, abs=0.1)
    assert max(off_its_moment([0.05, 0.0, 0.0], 48)) < 1e-9


def test_stress_of_a_curved_pipe_that_is_a_catenary_is_the_most_that_it_can_be() -> None:
    assert max(off_its_moment([0.03, 0.05, 0.01], 48, "catenary")) < 1e-6


# --- friction that has settled on obstacles -------------------------------------------------------

MU, PIPE_RADIUS, STRAND = 0.4, 1.0, 0.01


def over_a_pipe(friction: str = "settled", cells: int = 240) -> Tables:
    """A light rope, 1.5 % stretched, over a pipe below the middle between pins."""
    section = {"length": 4.2, "mass": 0.02, "diameter": 2 * STRAND, "axial_stiffness": 2e4, "bending_stiffness": 1e-3}
    at: Tables = {"kind": "cylinder", "at": [0, 0, -0.3], "axis": [0, 1, 0], "radius": PIPE_RADIUS, "friction": MU}
    return {
        "cable": {"sections": [section]}, "obstacles": {"pipe": at}, "model": "rod", "mesh": {"cells": cells},
        "ends": {k: {"kind": "pinned", "position": [x, 0, 0]} for k, x in (("start", -2), ("end", 2))},
        "initial": {"kind": "equilibrium", "friction": friction}, "contact": {"self": False},
        "output": {"points": 421, "exact": True},
    }  # fmt: skip


def slope_on_the_pipe(line: hybrid.Result) -> float:
    """How fast the logarithm of tension rises by the angle on the pipe, away from its top, on both sides.

    Within half of the contact: towards its edges the pressure fades over sqrt(T/k) = 0.07 m.
    """
    r, T = line.position[0], line.tension[0]
    angle = np.arctan2(r[:, 0], r[:, 2] + 0.3)
    on = np.abs(np.hypot(r[:, 0], r[:, 2] + 0.3) - PIPE_RADIUS - STRAND) < STRAND
    found = []
    for side in (1.0, -1.0):
        a = side * angle
        here = on & (a > 0.04) & (a < 0.18)
        found.append(np.polyfit(a[here], np.log(T[here]), 1)[0])
    assert found[0] == pytest.approx(found[1], rel=0.03)
    return float(np.mean(found))


@pytest.mark.long
def test_friction_that_has_settled_on_a_pipe_is_that_of_the_capstan() -> None:
    """T = T_top e^(mu phi) on both sides of the top, which stays where it lay; without it T is even.

    It stays so when time begins.
    """
    tables = over_a_pipe()
    found, plain = hybrid.static(tables), hybrid.static(over_a_pipe("neglected"))
    assert slope_on_the_pipe(found) == pytest.approx(MU, rel=0.01)
    assert abs(slope_on_the_pipe(plain)) < 0.005
    moved = hybrid.run(tables | {"time": {"duration": 0.2, "step": 0.01}})
    assert np.abs(moved.position - found.position[0]).max() < 1e-6
    assert np.abs(moved.tension - found.tension[0]).max() < 1e-3 * found.tension.max()


# --- vessels in waves of finite height ---

DEPTH, PERIOD, HEIGHT = 40.0, 6.0, 3.0
RAO = """frequency,heading,surge,heave,pitch,surge_phase,heave_phase,pitch_phase
0.8,0,0.9,0.8,1.5,80,10,95
1.3,0,0.5,0.6,1.0,70,20,100
"""


def moved(waves: Tables, rao: Path, **vessel: Any) -> Tables:
    """A line to a vessel, in a sea without drag, so that the vessel alone moves it."""
    fluid = {"density": 1025, "surface": 5.0, "waves": {"period": PERIOD, "phase": 25, "ramp": 6.0} | waves}
    sail = {"rao": str(rao), "origin": [10, 0, 5], "heading": 0.0} | vessel
    return tables_with(BASE, {
        "environment.fluid": fluid, "environment.seabed": {"z": 5.0 - DEPTH, "stiffness": 1e3},
        END + ".motion": {"vessel": sail}, "time": {"duration": 8.0, "step": 0.04}, "output": {"every": 0.4, "points": 13},
    })  # fmt: skip


def of_vessel(tables: Tables) -> np.ndarray:
    """Places (nb, 3) m of the end that it moves."""
    return np.asarray(hybrid.run(tables).position[:, -1])


@pytest.fixture
def rao(tmp_path: Path) -> Path:
    path = tmp_path / "ship.csv"
    path.write_text(RAO)
    return path


def test_a_vessel_moves_by_the_first_harmonic_of_a_wave_of_finite_height(rao: Path) -> None:
    """To round-off that of the regular wave of twice its amplitude, at the phase that it has where the vessel is.

    A table that ends below the frequency of the second harmonic is enough.
    """
    wave = steady_wave(HEIGHT, DEPTH, 9.81, 20, PERIOD)
    assert wave is not None
    first = 2.0 * float(wave.elevation[0])
    assert abs(first / HEIGHT - 1.0) > 0.005  # m: crests are sharp
    finite = moved({"kind": "stream_function", "height": HEIGHT}, rao)
    linear = {"kind": "regular", "height": first, "phase": 25.0}

    linear["phase"] += np.degrees((wave.k - wavenumber(2.0 * np.pi / PERIOD, DEPTH, 9.81)) * 10.0)
    apart = of_vessel(finite) - of_vessel(moved(linear, rao))
    assert np.ptp(of_vessel(finite), axis=0)[[0, 2]].min() > 1.0
    assert np.abs(apart).max() < 1e-9


def test_a_plan_says_which_harmonics_do_not_move_it(rao: Path) -> None:
    for kind in ("stream_function", "regular"):
        contents = hybrid.plan(moved({"kind": kind, "height": HEIGHT}, rao)).contents
        told = [x for x in contents if x.what == "higher harmonics of the waves in the motion of ends.end"]
        assert bool(told) == (kind == "stream_function") and not any(x.on for x in told)


def test_in_low_waves_it_is_the_vessel_of_linear_waves(rao: Path) -> None:
    """With the square of the height, of which the first harmonic and the length differ."""
    off = []
    for height in (1.0, 0.5):
        finite, linear = (of_vessel(moved({"kind": k, "height": height}, rao)) for k in ("stream_function", "regular"))
        off.append(np.abs(finite - linear).max() / np.ptp(linear, axis=0).max())
    assert off[1] < 2e-3 and np.log2(off[0] / off[1]) == pytest.approx(2.0, abs=0.2)
