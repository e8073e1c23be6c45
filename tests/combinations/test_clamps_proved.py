"""Layers that slip beside angular springs at clamps: the spring turns by the moment over its stiffness, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root

import hybrid
from hybrid.kernels.laws.bending_law import EACH, beside_spring, slip_answer
from hybrid.model.build import build
from hybrid.scene.read import as_scene, one_line
from tests.combinations.pairs import ADAPTIVE, BASE, CLAMP, END, FAR, START, ZONES, S, Tables, exchanged
from tests.problems import tables_with
from tests.scenes import cable_scene, clamped_at, pinned_at

SPRING = 30.0  # N m/rad, 1.9 of half a cell
LAYERS = [{"stiffness": 12.0, "moment": 0.4}, {"stiffness": 5.0, "moment": 0.9}]
CASES: dict[str, Tables] = {
    "layers": {"bending_stiffness": 8.0, "bending_slip": LAYERS},
    "one layer": {"bending_stiffness": 8.0, "bending_slip": LAYERS[:1]},
    "two stiffnesses that lock": {"bending_stiffness": [20.0, 8.0]},
}
# (rows of) moments at the free end: along one axis and back, N m; and going round.
AMOUNT = 1.6
ALONG = [[0.0, 0, 0, 0], [10, 0, AMOUNT, 0], [30, 0, -AMOUNT, 0], [45, 0, 0.5 * AMOUNT, 0]]
ROUND = [
    [0.0, 0, 0, 0],
    *([10 + 2.0 * k, 0, AMOUNT * np.cos(0.3 * k), AMOUNT * np.sin(0.3 * k)] for k in range(21)),
]  # fmt: skip


def cantilever(section: Tables, moments: list[list[float]], spring: float | None, **more: Any) -> hybrid.Result:
    """Without weight, under a moment at its free end that changes slowly: bent evenly."""
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [0, 1, 0]}
    plain = {"length": 2.0, "mass": 1e-3, "axial_stiffness": 1e6, "torsional_stiffness": 10.0, "damping": 20.0}
    locks = [{"kind": "bend_restrictor", "range": [0, 2], "radius": 15}] if "slip" not in str(section) else []
    return hybrid.run(
        cable_scene(plain | section, start | ({"bend_stiffness": spring} if spring else {}),
                    {"kind": "free", "moment": {"history": moments}}, attachments=locks, gravity=0,
                    initial={"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0]}, model="rod",
                    contact={"self": False}, mesh=8, time=(moments[-1][0], 0.1),
                    output={"every": 0.5, "points": 9, "exact": True}) | more
    )  # fmt: skip


def turned(r: NDArray[np.float64], about: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (nb, n, 3) m, each output turned by the rotation vector about (nb, 3) rad."""
    angle = np.linalg.norm(about, axis=1)[:, None, None]
    axis = about[:, None] / np.maximum(angle, 1e-300)
    along = (r * axis).sum(axis=-1, keepdims=True) * axis
    return np.asarray(along + np.cos(angle) * (r - along) + np.sin(angle) * np.cross(axis, r))


@pytest.mark.parametrize("moments", [ALONG, ROUND], ids=["along", "round"])
@pytest.mark.parametrize("case", list(CASES))
@pytest.mark.long  # 4 s of 6 cases
def test_a_spring_turns_a_bent_line_by_its_moment_and_leaves_it_its_curvature(case: str, moments: Any) -> None:
    """Against the line on a rigid clamp, turned by M/k: places, curvature at the clamp, what layers lose, energy M^2/2k.

    A moment that goes round is not turned by a rotation about itself.  What is left fades with the rate of the moment.
    """
    rigid, soft = (cantilever(CASES[case], moments, spring) for spring in (None, SPRING))
    M = np.column_stack([np.interp(rigid.t, np.array(moments)[:, 0], np.array(moments)[:, k]) for k in (2, 3)])
    about = np.column_stack([0.0 * M[:, 0], M]) / SPRING
    size = np.abs(turned(rigid.position, about) - rigid.position).max()
    assert size > 0.05
    apart = np.abs(turned(rigid.position, about) - soft.position).max()
    curved = np.abs(soft.curvature[:, 0] - rigid.curvature[:, 0]).max() / rigid.curvature.max()
    stored = soft["energy/bending"] - rigid["energy/bending"] - 0.5 * (M**2).sum(axis=1) / SPRING
    assert apart < 2e-3 * size and curved < 6e-4
    assert np.abs(stored).max() < 1e-3 * rigid["energy/bending"].max()
    if "slip" in str(CASES[case]):
        lost = np.abs(rigid["work/hysteresis"])
        assert lost[-1] > 0.05 * rigid["energy/bending"].max()
        assert np.abs(soft["work/hysteresis"] - rigid["work/hysteresis"]).max() < 1e-3 * lost.max()


REST: dict[str, Tables] = {
    "slip": {S + "bending_stiffness": 8.0,
             S + "bending_slip": [{"stiffness": 12.0, "moment": 0.4, "per_tension": 1e-3}, {"stiffness": 5.0, "moment": 0.5}]},
    "tension": {S + "stiffness_per_tension": 0.03},
    "table": {S + "moment_curvature": [[0, 0], [0.05, 1.0], [0.15, 2.0], [0.3, 3.0]], S + "first_loading": True,
              S + "bending_stiffness": None},
}  # fmt: skip


@pytest.mark.parametrize("rest", list(REST))
def test_a_clamp_on_a_spring_is_one_turned_by_its_moment(rest: str) -> None:
    """At rest, in space, at both ends: the shape of rigid clamps that are turned by M/k.

    To what it makes that the rotations of the spring and of the half cell, about axes that differ, are added.
    """
    springs = (SPRING, 2.0 * SPRING)
    held = {START: CLAMP | {"bend_stiffness": springs[0]}, END: FAR | {"bend_stiffness": springs[1]},
            "environment": {"gravity": 9.81, "fluid": {"density": 1025, "current": [0.3, 0.4, 0]}},
            S + "drag": {"normal": 1.2}, "time": None, "output": {"points": 13, "exact": True}}  # fmt: skip
    tables = tables_with(BASE, held | REST[rest])
    soft = hybrid.static(tables)
    ends: Tables = {}
    for key, end, moment, k in (
        (START, CLAMP, soft["moment_start"], springs[0]),
        (END, FAR, soft["moment_end"], springs[1]),
    ):
        t, M = np.array(end["tangent"], float), np.asarray(moment)[0]
        t /= np.linalg.norm(t)
        M = M - (M @ t) * t
        way = {x: turned(np.array([[end[x]]], float), -M[None] / k)[0, 0].tolist() for x in ("tangent", "normal")}
        ends[key] = end | way
    rigid = hybrid.static(tables_with(tables, ends))
    unturned = hybrid.static(tables_with(tables, {START: CLAMP, END: FAR}))
    size, bent = np.abs(unturned.position - soft.position).max(), np.abs(unturned.curvature - soft.curvature).max()
    assert size > 5e-3 and bent > 5e-3
    assert np.abs(rigid.position - soft.position).max() < 2e-3 * size
    assert np.abs(rigid.curvature - soft.curvature).max() < 2e-3 * bent


def test_the_bend_beside_a_spring_is_the_root_of_its_balance() -> None:
    """Of 200 states of two layers in two axes: against a root found otherwise; derivatives against differences."""
    tables = tables_with(BASE, {START: CLAMP | {"bend_stiffness": SPRING}} | REST["slip"])
    line = build(one_line(as_scene(tables))).line
    half, noise, apart, slopes = 0.5 * line.h[0], np.random.default_rng(1), [], []
    E = 8.0 / half
    for _ in range(200):
        now = line.slip_now.copy()
        now[0, [0, 1, EACH, EACH + 1]] = 0.1 * noise.normal(size=4)
        for j, (K, m) in enumerate(((12.0, 0.4), (5.0, 0.5))):
            now[0, EACH * j + 2 : EACH * j + 4] = m * noise.uniform(0.3, 2.0), K
        state, x = line._replace(slip_now=now), 0.2 * noise.normal(size=2)

        def balance(z: NDArray[np.float64], now: Any = now, x: Any = x) -> NDArray[np.float64]:
            found = E * z - SPRING * (x - z)
            for j in (0, EACH):
                stuck = now[0, j + 3] * (z / half - now[0, j : j + 2])
                found = found + stuck * min(1.0, now[0, j + 2] / np.hypot(*stuck))
            return np.asarray(found)

        z = root(balance, 0.5 * x, tol=1e-14).x
        mx, my, c11, c12, c22, _ = slip_answer(state, 0, *x)
        moment = np.array([mx, my]) + line.kb[0, :2] * x
        apart.append([np.abs(z - beside_spring(state, 0, *x)).max(), np.abs(moment - SPRING * (x - z)).max()])
        ways = 1e-7 * np.eye(2)
        each = [np.subtract(slip_answer(state, 0, *(x + d))[:2], slip_answer(state, 0, *(x - d))[:2]) for d in ways]
        slopes.append(np.abs(np.array(each) / 2e-7 - [[c11, c12], [c12, c22]]).max())
    assert np.max(apart) < 1e-13
    assert np.sort(slopes)[-3] < 1e-6 * E  # but for one that begins to slip within the difference


# --- what twists a line ---

# --- turns of an end beside a swivel --------------------------------------------------------------


@pytest.mark.parametrize("model", ["rod", ZONES, ADAPTIVE], ids=["rod", "zones", "moves"])
def test_a_swivel_lets_the_turns_of_an_end_go_back(model: Any) -> None:
    """Whatever the number of turns, also more than cells could hold: the line without them, and no torque at all."""
    swivel: Tables = {"cable.attachments": [{"kind": "swivel", "at": 5.0}], START: CLAMP, END: FAR, "model": model}
    swivel |= {"mesh": None} if model is ZONES else {}
    plain = hybrid.run(tables_with(BASE, swivel))
    held = hybrid.run(tables_with(BASE, swivel | {"cable.attachments": [], END + ".turns": 0.7}))
    assert np.abs(held["torque"]).max() > 1.0
    for turns in (0.7, -5.3, 200.0):
        tables = tables_with(BASE, swivel | {END + ".turns": turns})
        found = hybrid.run(tables)
        assert np.abs(found.position - plain.position).max() < 1e-9
        assert np.abs(found["torque"]).max() < 1e-9
        what = next(x for x in hybrid.plan(tables).contents if x.what.startswith("twist by"))
        assert not what.on and "swivel at s = 5 m lets it turn back" in what.why and not what.event


# --- swivels beside sections that have a direction ------------------------------------------------

BESIDE: Tables = {
    "length": 12.0,
    "mass": 2.0,
    "axial_stiffness": 1e5,
    "torsional_stiffness": 15.0,
    "damping": {"mass": 0.5},
}
IN_PLANE, DOWN = [0.0, 1.0, 0.0], [-0.8, 0.0, 1.0]  # axes of the section at the far clamp: along the normal, or not


def over_a_swivel(beside: Tables, normal: list[float], cells: int = 24, model: Any = "rod") -> hybrid.Result:
    """A section on both sides of a swivel, whose sides lie as their clamps have them, in a vertical plane."""
    far = FAR | {"normal": normal}
    return hybrid.run(tables_with(BASE, {
        "cable": {"sections": [BESIDE | beside], "attachments": [{"kind": "swivel", "at": 5.0}]}, START: CLAMP, END: far,
        "mesh": {"cells": cells}, "model": model,
    }))  # fmt: skip


def of_two_sections(before: Tables, after: Tables, cells: int = 24, model: Any = "rod") -> hybrid.Result:
    """Two sections that meet without a swivel where it is."""
    sections = [BESIDE | {"length": 5.0} | before, BESIDE | {"length": 7.0} | after]
    return hybrid.run(tables_with(BASE, {
        "cable": {"sections": sections}, START: CLAMP, END: FAR, "mesh": {"cells": cells}, "model": model,
    }))  # fmt: skip


@pytest.mark.parametrize("model", ["rod", ADAPTIVE], ids=["rod", "moves"])
def test_sides_of_a_swivel_that_lie_across_each_other_bend_as_two_sections(model: Any) -> None:
    """In their plane one bends about its first axis and the other about its second: sections of EI_1 and of EI_2."""
    if model == "rod":
        found = over_a_swivel({"bending_stiffness": [20.0, 8.0]}, DOWN)
        same = of_two_sections({"bending_stiffness": 20.0}, {"bending_stiffness": 8.0})
        assert np.abs(found.position - same.position).max() < 1e-9
        assert np.abs(found["bending_moment"] - same["bending_moment"])[:, [0, 3, 9, 12]].max() < 1e-8
    kappa = {"bending_stiffness": 20.0, "intrinsic_curvature": [0.1, 0, 0]}
    against = kappa | {"intrinsic_curvature": [-0.1, 0, 0]}
    found, same = over_a_swivel(kappa, [0.0, -1.0, 0.0], model=model), of_two_sections(kappa, against, model=model)
    assert np.abs(found.position - same.position).max() < 1e-9
    assert np.abs(found["torque"]).max() < 1e-9


def test_what_curves_without_load_is_straight_over_the_cell_of_a_swivel() -> None:
    """The bend that its element does not have is of the first order in the cells, against a line without a swivel."""
    kappa = {"bending_stiffness": 20.0, "intrinsic_curvature": [0.1, 0, 0]}
    off = [
        np.abs(over_a_swivel(kappa, IN_PLANE, n).position - of_two_sections(kappa, kappa, n).position).max()
        for n in (48, 96, 192)
    ]
    assert np.log2(np.array(off[:-1]) / off[1:]) == pytest.approx(1.0, abs=0.1)


def test_layers_that_slip_do_not_feel_the_twist_of_a_swivel() -> None:
    """Its sides may be turned by any angle against each other: the line is the same, without torque."""
    slip: Tables = {
        S + "bending_stiffness": 8.0,
        S + "bending_slip": [{"stiffness": 12.0, "moment": 0.4, "per_tension": 1e-3}, {"stiffness": 5.0, "moment": 0.5}],
        "cable.attachments": [{"kind": "swivel", "at": 5.0}], START: CLAMP, END: FAR,
    }  # fmt: skip
    plain = hybrid.run(tables_with(BASE, slip))
    for turns in (0.2, 0.4):
        found = hybrid.run(tables_with(BASE, slip | {END + ".turns": turns}))
        assert np.abs(found.position - plain.position).max() < 1e-9
        assert np.abs(found["torque"]).max() < 1e-9


@pytest.mark.parametrize("stiffness", [20.0, [20.0, 8.0]])
def test_a_swivel_at_a_clamp_that_holds_a_direction_says_so(stiffness: Any) -> None:
    tables = tables_with(BASE, {
        "cable": {"sections": [BESIDE | {"bending_stiffness": stiffness}]}, START: CLAMP | {"swivel": True}, END: FAR,
        "mesh": {"cells": 24}, "model": "rod", "time.duration": 0.1,
    })  # fmt: skip
    told = [e.text for e in hybrid.run(tables).events if e.kind == "ignored"]
    assert any("free turning at the swivel of ends.start" in x for x in told) == isinstance(stiffness, list)


def test_layers_turn_with_the_line_at_either_end() -> None:
    section = {
        "length": 8.0, "mass": 2.0, "diameter": 0.04, "axial_stiffness": 1e5, "bending_stiffness": 0.9,
        "torsional_stiffness": 1.0, "bending_slip": [{"stiffness": 1.0, "moment": 0.1}],
    }  # fmt: skip
    turns = {"yaw": {"amplitude": 2, "period": 0.9}, "heave": {"amplitude": 0.02, "period": 1.3}, "ramp": 0.5}
    scene: Tables = cable_scene(
        section, clamped_at([0, 0, 0], [1, 0, -0.5], normal=[0.1, 1, 0.2], swivel=True, motion=turns),
        pinned_at(6, 1.2, 0.7), contact={"self": False}, model="rod", mesh=10, time=(1.0, 1 / 32), output=(1 / 8, 11),
        dimension=3,
    )  # fmt: skip
    one, two = hybrid.run(scene), hybrid.run(exchanged(scene))
    assert np.abs(one.position - two.position[:, ::-1]).max() < 1e-9
    assert np.abs(one["moment_start"] - two["moment_end"]).max() < 1e-8
