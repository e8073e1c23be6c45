"""Tables of moment over curvature and bend restrictors: a closed form, the discrete line solved for itself, energy."""

from __future__ import annotations

from functools import cache
from math import asin, cos, pi, radians, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import hybrid
from hybrid.errors import ComputationError, Outcome, SceneError
from tests.scenes import cable_scene, clamped_at, pinned_at

PULL, ANGLE, LENGTH = 5e4, radians(20.0), 8.0
TABLES: dict[str, list[list[float]]] = {
    "locks": [[0, 0], [0.3, 3000], [1.3, 1.003e6]],
    "softens": [[0, 0], [0.01, 900], [0.05, 2000], [1, 11000]],
    "straight": [[0, 0], [0.2, 2000], [0.7, 7000]],
}


def taut(
    cells: int, law: dict[str, Any], force: Any = None, *attached: dict[str, Any], **tables: Any
) -> dict[str, Any]:
    """A line that is clamped at 20 degrees to its pull, without weight."""
    pull = [PULL * cos(ANGLE), 0, PULL * sin(ANGLE)] if force is None else force
    return cable_scene(
        {"length": LENGTH, "mass": 1} | law, clamped_at([0, 0, 0], [1, 0, 0]), {"kind": "free", "force": pull},
        attachments=list(attached), gravity=0, model="rod", contact={"self": False}, mesh=cells
    ) | tables  # fmt: skip


def by_table(cells: int, table: list[list[float]] | None, *attached: dict[str, Any], **tables: Any) -> dict[str, Any]:
    law: dict[str, Any] = {"bending_stiffness": 1e4} if table is None else {"moment_curvature": table}
    return taut(cells, law, None, *attached, **{"output": {"points": 2}} | tables)


def moment_of(kappa: float, table: list[list[float]]) -> float:
    x, M = np.array(table, float).T
    beyond = max(kappa - x[-1], 0.0) * (M[-1] - M[-2]) / (x[-1] - x[-2])
    return float(np.interp(kappa, x, M) + beyond)


def energy_of(kappa: float, table: list[list[float]]) -> float:
    """Integral of the moment, J/m."""
    inside = [x for x, _ in table if 0.0 < x < kappa]
    return float(quad(moment_of, 0.0, kappa, args=(table,), points=inside or None)[0])


def of_clamp(table: list[list[float]]) -> float:
    """Curvature at the clamp of a long line: kappa M - W = T (1 - cos phi)."""
    return brentq(
        lambda k: k * moment_of(k, table) - energy_of(k, table) - PULL * (1 - cos(ANGLE)), 1e-3, 2.0, xtol=1e-13
    )


def of_cells(cells: int, table: list[list[float]]) -> tuple[float, float]:
    """Curvature and moment at the clamp of the line of cells: each turns by its table, M_i+1 = M_i - T h sin(phi - theta_i).

    The end cell has no moment: shot from the clamp.
    """
    h = LENGTH / cells
    x, M = np.array(table, float).T

    def bend(moment: float) -> float:
        slope = (x[-1] - x[-2]) / (M[-1] - M[-2])
        return float(np.interp(moment, M, x) + max(moment - M[-1], 0.0) * slope)

    def angle_at_end(moment: float) -> float:
        theta, m = 0.5 * h * bend(moment), moment
        for _ in range(cells - 1):
            m -= PULL * h * sin(ANGLE - theta)
            if m < 0.0 or theta > ANGLE:
                return -1.0 if m < 0.0 else 1.0
            theta += h * bend(m)
        return m - PULL * h * sin(ANGLE - theta)

    first = brentq(angle_at_end, 10.0, 5e4, xtol=1e-9, rtol=1e-15, maxiter=400)
    return bend(first), first


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", TABLES)
def test_a_clamp_bends_by_its_table(name: str, dimension: int) -> None:
    """The line of cells to 1e-6, and with their square to the continuous line, whatever its table."""
    table, off = TABLES[name], []
    for cells in (80, 160):
        found = hybrid.static(by_table(cells, table, dimension=dimension))
        kappa, moment = of_cells(cells, table)
        assert found.curvature[0, 0] == pytest.approx(kappa, rel=1e-6)
        assert found.bending_moment[0, 0] == pytest.approx(moment, rel=1e-6)
        off.append(abs(found.bending_moment[0, 0] / moment_of(of_clamp(table), table) - 1.0))
    assert off[1] < 2e-3 and 3.0 < off[0] / off[1] < 7.0


def test_a_straight_table_is_a_stiffness() -> None:
    plain, law = (hybrid.static(by_table(80, x)) for x in (None, TABLES["straight"]))
    assert np.abs(law.position - plain.position).max() < 1e-9
    assert law["energy/bending"][0] == pytest.approx(plain["energy/bending"][0], rel=1e-9)
    assert law.envelope["curvature_max"] == pytest.approx(plain.envelope["curvature_max"], abs=1e-8)


def test_a_restrictor_is_the_table_of_what_it_locks() -> None:
    """Published check of the closed form: 0.3084327 1/m and 11432.71 N m where 1 MN m2 lock at 0.3 1/m."""
    locks = {"kind": "bend_restrictor", "range": [0, 8], "radius": 1 / 0.3, "locked_stiffness": 1e6 - 1e4}
    short = locks | {"range": [0, 1]}
    table, whole, part = (hybrid.static(by_table(640, *x)) for x in ((TABLES["locks"],), (None, locks), (None, short)))
    assert of_clamp(TABLES["locks"]) == pytest.approx(0.3084327, abs=1e-7)
    assert whole.curvature[0, 0] == pytest.approx(0.3084327, rel=1e-5)
    assert whole.bending_moment[0, 0] == pytest.approx(11432.71, rel=1e-4)
    assert np.abs(whole.position - table.position).max() < 1e-9
    assert part.curvature[0, 0] == pytest.approx(whole.curvature[0, 0], rel=1e-3)  # it is locked over 0.7 m


def test_elements_between_tables_have_one_moment() -> None:
    """At a change of section both sides bend as their own tables have it; so do the extremes, and a spring at a clamp."""
    sections = [
        {"length": 0.5, "mass": 1, "moment_curvature": TABLES["softens"]},
        {"length": 0.5, "mass": 1, "moment_curvature": TABLES["locks"]},
        {"length": 7.0, "mass": 1, "bending_stiffness": 1.2e4, "torsional_stiffness": 1e4},
    ]
    scene = by_table(160, None, output={"points": 33}) | {"cable": {"sections": sections}}
    found = hybrid.static(scene)
    beyond = hybrid.static(scene | {"dimension": 2})
    (s, moments), (_, bends) = found.both_sides("bending_moment"), found.both_sides("curvature")
    for place, tables in ((0.5, ("softens", "locks")), (1.0, ("locks", ""))):
        at = np.flatnonzero(np.abs(s - place) < 1e-9)
        assert at.size == 2
        M = moments[0, at]
        assert M[0] == pytest.approx(M[1], rel=1e-9)
        for k, name in zip(at, tables, strict=True):
            table = TABLES[name] if name else [[0, 0], [1, 1.2e4]]
            own = float(np.interp(M[0], *np.array(table, float).T[::-1]))
            assert bends[0, k] == pytest.approx(own, rel=1e-9)
    assert np.abs(found.position - beyond.position).max() < 1e-8
    sprung = scene["ends"]["start"] | {"bend_stiffness": 2e4}
    soft = hybrid.static(scene | {"ends": scene["ends"] | {"start": sprung}})
    M, d = soft.bending_moment[0, 0], np.arctan2(*(soft.position[0, 1] - soft.position[0, 0])[[2, 0]])
    assert 0.8 * found.bending_moment[0, 0] > M
    assert d > M / 2e4  # the spring has turned by that much


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", ["softens", "locks"])
def test_a_spring_at_a_clamp_turns_and_the_line_bends_by_its_table(name: str, dimension: int) -> None:
    """One moment turns the spring and bends the line: curvature, its envelope, and the tangent that the tension is along."""
    scene = by_table(160, TABLES[name], dimension=dimension)
    scene["ends"]["start"]["bend_stiffness"] = 2e4
    found = hybrid.static(scene)
    M = float(found.bending_moment[0, 0])
    own = float(np.interp(M, *np.array(TABLES[name], float).T[::-1]))
    assert own > 0.25
    assert found.curvature[0, 0] == pytest.approx(own, rel=1e-9)
    assert found.envelope["curvature_max"].max() == pytest.approx(own, rel=1e-9)
    assert found.tension[0, 0] == pytest.approx(PULL * cos(ANGLE - M / 2e4), rel=1e-9)
    assert found.envelope["tension_max"][0] == pytest.approx(found.tension[0, 0], rel=1e-9)


def test_an_unloaded_line_has_its_own_curvature_beside_a_spring() -> None:
    section = {
        "length": LENGTH, "mass": 1, "bending_stiffness": 1e4, "torsional_stiffness": 1e4,
        "intrinsic_curvature": [0.05, 0, 0],
    }  # fmt: skip
    scene = by_table(40, None) | {"cable": {"sections": [section]}}
    scene["ends"] = {"start": scene["ends"]["start"] | {"bend_stiffness": 2e4}, "end": "free"}
    found = hybrid.static(scene)
    assert found.curvature[0] == pytest.approx([0.05] * 2, rel=1e-6)
    assert found.envelope["curvature_max"] == pytest.approx(
        np.full(found.envelope["curvature_max"].shape, 0.05), rel=1e-6
    )


CABLE = {
    "length": 12, "mass": 2.0, "axial_stiffness": 1e5, "torsional_stiffness": 15,
    "moment_curvature": [[0, 0], [0.05, 1.0], [0.15, 2.0], [0.3, 8.0]],
}  # fmt: skip


def swung(step: float, **section: Any) -> dict[str, Any]:
    """A clamped cable that falls from a straight line, without damping: it bends through all of its table."""
    return cable_scene(
        CABLE | section, clamped_at([0, 0, 0], [1, 0.3, 0]), "free",
        initial={"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0.3, 0]}, model="rod",
        contact={"self": False}, mesh=24, time=(1.0, step, 1.0), output={"every": 0.05, "exact": True}
    )  # fmt: skip


@pytest.mark.parametrize("tau", [0.0, 0.01])
def test_energy_is_kept_in_motion(tau: float) -> None:
    """What no work accounts for falls with the square of the step; damping by stiffness takes energy out, and is booked."""
    off = []
    for step in (8e-3, 4e-3):
        found = hybrid.run(swung(step, damping={"stiffness": tau}) if tau else swung(step))
        off.append(np.abs(found["work/scheme"]).max() / found["energy/kinetic"].max())
        assert found.curvature.max() > 0.3
        lost = found["work/stiffness_damping"] if tau else np.zeros(2)
        assert (np.diff(lost) <= 1e-9).all() and (lost[-1] < -0.1 or not tau)
    print(f"energy that no work accounts for, over the largest kinetic energy: {off}")
    assert off[0] < 1e-2 and off[1] < 0.35 * off[0]


@pytest.mark.parametrize("model", ["adaptive", {"kind": "adaptive", "curvature_error": 0.05}], ids=["zones", "cells"])
def test_zones_that_move_bend_as_rods_do(model: Any) -> None:
    """A riser whose head sways through the corner of its table: bends at the clamp, and energy, as of rods everywhere."""
    section = {
        "length": 60, "mass": 30, "diameter": 0.12, "axial_stiffness": 1e8, "drag": {"normal": 1.2},
        "added_mass": {"normal": 1}, "moment_curvature": [[0, 0], [0.05, 500], [0.2, 1000], [0.5, 6000]],
    }  # fmt: skip
    sway = {"surge": {"amplitude": 1.0, "period": 5}, "ramp": 5}
    scene = cable_scene(
        section, clamped_at([0, 0, 0], [0, 0, -1], motion=sway), pinned_at(30, 0, -35), fluid={"density": 1025},
        time=(8, 0.02), contact={"self": False}
    )  # fmt: skip
    rods = hybrid.run(scene | {"model": "rod", "mesh": {"cells": 120}})
    found = hybrid.run(scene | {"model": model, "mesh": {"cells": 120 if model == "adaptive" else 30}})
    assert model != "adaptive" or any(zone.kind == "catenary" for zones in found.zones for zone in zones)
    top = rods.s < 3.0
    assert found.curvature[:, top].max() == pytest.approx(rods.curvature[:, top].max(), rel=3e-2)
    assert rods.curvature.max() > 0.06
    off = [np.abs(x["work/scheme"]).max() / x["energy/kinetic"].max() for x in (rods, found)]
    assert off[1] < max(3.0 * off[0], 2e-2)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"moment_curvature": [[0, 0]], "bending_stiffness": None}, "at least two rows"),
        ({"moment_curvature": [[0, 1], [1, 2]], "bending_stiffness": None}, "no moment without curvature"),
        ({"moment_curvature": [[0, 0], [1, 2], [2, 2]], "bending_stiffness": None}, "a moment above"),
        ({"moment_curvature": [[0, 0], [1, 2], [1, 3]], "bending_stiffness": None}, "a curvature above"),
        ({"moment_curvature": [[0, 0], [1, 2]]}, "because moment_curvature says how it bends"),
    ],
)
def test_what_is_no_table_is_refused(given: dict[str, Any], expected: str) -> None:
    section = {"length": 8, "mass": 1, "bending_stiffness": 1e4} | given
    scene = by_table(40, None) | {"cable": {"sections": [{k: x for k, x in section.items() if x is not None}]}}
    with pytest.raises(SceneError, match=expected):
        hybrid.validate_scene(scene)


def test_a_restrictor_needs_a_bending_stiffness() -> None:
    locks = {"kind": "bend_restrictor", "range": [0, 2], "radius": 3}
    scene = by_table(40, None, locks) | {"model": "catenary"}
    scene["cable"]["sections"] = [{"length": LENGTH, "mass": 1}]
    scene["ends"] = scene["ends"] | {"start": {"kind": "pinned", "position": [0, 0, 0]}}
    with pytest.raises(SceneError, match="what locks there bends until then"):
        hybrid.validate_scene(scene)


# --- A bending stiffness that grows with tension: the clamp of a taut line in closed form, at rest and in motion;
# energy ---

EI, GROWS = 1e4, 0.3  # N m2, m2
BEGIN, END = 5e4, 2e4  # N


def taut_by_tension(cells: int, pull: Any, dimension: int | None = None, **section: Any) -> dict[str, Any]:
    law = {"bending_stiffness": EI, "stiffness_per_tension": GROWS} | section
    force = {"history": pull} if isinstance(pull, list) else [pull * cos(ANGLE), 0, pull * sin(ANGLE)]
    more = {"dimension": dimension} if dimension else {}
    return taut(cells, {k: x for k, x in law.items() if x}, force, **more)


def of_clamp_by_tension(pull: float, grows: float = GROWS) -> float:
    """Moment at the clamp: M dM = -EI(T cos a) T sin a da along the line, a the angle to the pull, EI = EI_0 + c T cos a."""
    return sqrt(2.0 * pull * (EI * (1.0 - cos(ANGLE)) + 0.5 * grows * pull * sin(ANGLE) ** 2))


def falling(step: float, over: float) -> dict[str, Any]:
    """The pull falls in a second, and the line comes to rest."""
    rows = [[0.0, *(BEGIN * x for x in (cos(ANGLE), 0, sin(ANGLE)))]]
    rows += [[t, *(END * x for x in (cos(ANGLE), 0, sin(ANGLE)))] for t in (1.0, over)]
    return taut_by_tension(80, rows, damping=60.0) | {
        "time": {"duration": over, "step": step},
        "output": {"every": step, "points": 81, "exact": True},
    }


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_clamp_of_a_taut_line(dimension: int) -> None:
    """Moment and curvature there, with order 2 in the cells; without it 11 % less moment, 30 % more curvature and more."""
    off = []
    for cells in (100, 200):
        found = hybrid.static(taut_by_tension(cells, BEGIN, dimension))
        off.append(abs(float(found.bending_moment[0, 0]) / of_clamp_by_tension(BEGIN) - 1.0))
        kappa = of_clamp_by_tension(BEGIN) / (EI + GROWS * BEGIN * cos(ANGLE))
        assert found.curvature[0, 0] == pytest.approx(kappa, rel=1e-2)
    print(f"moment off by {off[0]:.1e} and {off[1]:.1e}")
    assert off[1] < 2e-3 and off[0] / off[1] > 1.7
    assert of_clamp_by_tension(BEGIN) > 1.5 * of_clamp_by_tension(BEGIN, 0.0)


@pytest.mark.long
def test_a_pull_that_falls_leads_to_the_rest_under_it_and_its_energy_is_booked() -> None:
    """The end of the motion is the equilibrium; what no work accounts for falls with the step."""
    rest = hybrid.static(taut_by_tension(80, END))
    left = []
    for step in (0.01, 0.005):
        found = hybrid.run(falling(step, 4.0))
        assert found.bending_moment[-1, 0] == pytest.approx(float(rest.bending_moment[0, 0]), rel=1e-4)
        assert found.bending_moment[0, 0] == pytest.approx(of_clamp_by_tension(BEGIN), rel=5e-3)
        booked = float(found["work/hysteresis"][-1])
        left.append(abs(float(found["work/scheme"][-1])))
        print(f"step {step} s: {booked:.3f} J of tension that changes the stiffness, {left[-1]:.4f} J left over")
        assert booked < -50.0  # stored energy falls with the stiffness
    assert left[1] < 1e-2 * abs(booked) and left[1] < 0.6 * left[0]


def heaved(grows: float) -> dict[str, Any]:
    """A line that is bent to 0.4 1/m between clamps of which one is moved up and down."""
    section = {
        "length": 10.0,
        "mass": 2.0,
        "axial_stiffness": 1e6,
        "bending_stiffness": 100.0,
        "damping": {"mass": 0.5},
    }
    motion = {"heave": {"amplitude": 0.5, "period": 2.0}, "ramp": 2.0}
    clamp = {"kind": "clamped", "tangent": [1, 0, 0]}
    return cable_scene(
        section | {"stiffness_per_tension": grows}, clamp | {"position": [0, 0, 0]},
        clamp | {"position": [9.85, 0, 0], "motion": motion}, model="rod", contact={"self": False}, mesh=40,
        time=(4.0, 0.005), output=(0.1, 21)
    )  # fmt: skip


def test_energy_that_the_law_creates_is_told_or_stops_the_run() -> None:
    """It has no potential: K_T kappa^2/2 of 4, 8 and 15 % create 3, 28 and more than 100 % of what is put in."""
    assert "gains energy" not in {x.kind for x in hybrid.run(heaved(0.3)).events}
    (told,) = (x for x in hybrid.run(heaved(1.0)).events if x.kind == "gains energy")
    assert "with stiffness by tension" in told.text and "less stiffness_per_tension" in told.text
    with pytest.raises(ComputationError) as stopped:
        hybrid.run(heaved(2.0))
    assert stopped.value.outcome == Outcome.GAINS_ENERGY and "stiffness_per_tension" in str(stopped.value)


def test_no_stiffness_without_bending_and_refusals() -> None:
    with pytest.raises(SceneError, match="left without tension"):
        hybrid.validate_scene(taut_by_tension(10, BEGIN, bending_stiffness=0))
    with pytest.raises(SceneError, match="what tension adds to stiffness"):
        hybrid.validate_scene(
            taut_by_tension(10, BEGIN) | {"model": "adaptive", "time": {"duration": 1.0, "step": 0.1}}
        )


def test_a_constant_tension_is_a_constant_stiffness() -> None:
    """A straight cantilever under a pull and a small moment bends as one of EI + c T does."""
    pull = [1e4, 0.0, 0.0]
    found = []
    for law in (
        {"stiffness_per_tension": GROWS},
        {"stiffness_per_tension": 0.0, "bending_stiffness": EI + GROWS * 1e4},
    ):
        tables = taut_by_tension(40, 0.0, **law)
        tables["ends"]["end"] = {"kind": "free", "force": pull, "moment": [0, 1.0, 0]}
        found.append(np.asarray(hybrid.static(tables).position[0, :, 2]))
    np.testing.assert_allclose(found[0], found[1], atol=1e-6 * np.abs(found[1]).max())


# --- Bend restrictors on sections with two bending stiffnesses, and tables of moment beside these ---

EI_TWO_AXES, OTHER, LOCKED, RADIUS = 20.0, 50.0, 300.0, 3.0
TABLE = [[0.0, 0.0], [0.1, 4.0], [0.3, 8.0], [1.0, 36.0]]


def bent(axis: int, sections: list[dict[str, Any]], attachments: list[dict[str, Any]], cells: int, **more: Any) -> Any:
    """Six metres between a clamp and a pin, sagging in the plane in which it bends about one of its axes."""
    plain = {"mass": 2.0, "axial_stiffness": 1e5, "torsional_stiffness": 30.0, "damping": {"mass": 1.0}}
    normal = [0, 1, 0] if axis == 0 else [0, 0, 1]
    return cable_scene(
        [plain | x for x in sections], clamped_at([0, 0, 0], [1, 0, 0], normal=normal), pinned_at(4.5, 0, 0.5),
        attachments=attachments, model="rod", mesh=cells, output={"points": 25, "exact": True}
    ) | more  # fmt: skip


def about(axis: int) -> list[float]:
    """EI about this axis, more about the other one: bent about the stiffer one it would turn over."""
    return [OTHER, EI_TWO_AXES] if axis else [EI_TWO_AXES, OTHER]


def sleeve(a: float, b: float) -> dict[str, Any]:
    return {"kind": "bend_restrictor", "range": [a, b], "radius": RADIUS, "locked_stiffness": LOCKED}


def apart(one: hybrid.Result, two: hybrid.Result) -> float:
    return float(np.abs(one.position - two.position).max())


@pytest.mark.long
@pytest.mark.parametrize("axis", [0, 1])
def test_about_an_axis_it_is_the_restrictor_of_that_stiffness(axis: int) -> None:
    """All of the line, so that no element is at its edge: at rest, and swinging."""
    moves = {"motion": {"travel": {"by": [-0.5, 0, 0.3], "over": 0.5}}}
    for dimension in (2, 3):
        found = []
        for stiffness in (about(axis), EI_TWO_AXES):
            scene = bent(
                axis, [{"length": 6.0, "bending_stiffness": stiffness}], [sleeve(0, 6)], 30, dimension=dimension
            )
            scene["ends"]["end"] |= moves
            found.append(hybrid.run(scene | {"time": {"duration": 1.0, "step": 0.01}}))
        two, one = found
        assert apart(two, one) < 1e-8
        assert two["bending_moment"] == pytest.approx(one["bending_moment"], abs=1e-6)
        assert two["energy/bending"] == pytest.approx(one["energy/bending"], rel=1e-7)
        assert one["curvature"].max() > 1.1 / RADIUS  # it is locked
        loose = hybrid.static(bent(axis, [{"length": 6.0, "bending_stiffness": EI_TWO_AXES}], [], 30))
        assert float(np.abs(loose.position[0] - two.position[0]).max()) > 0.05


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("what", ["sleeve", "table"])
def test_at_an_edge_it_comes_to_the_same(axis: int, what: str) -> None:
    """Of the element there both halves have one curvature, which jumps from 0.37 to 0.86 1/m: of first order."""
    off = []
    for cells in (48, 96, 192):
        found = []
        for stiffness in (about(axis), EI_TWO_AXES):
            table = {"length": 3.0, "moment_curvature": TABLE}
            first = {"length": 3.0 if what == "table" else 6.0, "bending_stiffness": stiffness}
            sections = [first, table] if what == "table" else [first]
            found.append(hybrid.static(bent(axis, sections, [] if what == "table" else [sleeve(1.5, 3.0)], cells)))
        off.append(apart(*found))
        assert found[1]["curvature"].max() > 1.1 / RADIUS
    assert off[0] < 0.01
    assert 3.6 < off[0] / off[2] < 4.6, off


def test_bent_out_of_its_axes_its_energy_is_kept() -> None:
    """Without damping, with order two in the step: force and energy are of one potential."""
    lost = []
    for step in (0.004, 0.002):
        half = {"length": 3.0, "bending_stiffness": [EI_TWO_AXES, OTHER], "damping": {"mass": 0.0}}
        scene = bent(
            0, [half, {"length": 3.0, "moment_curvature": TABLE, "damping": {"mass": 0.0}}], [sleeve(0, 2)], 24
        )
        scene["ends"]["start"]["normal"] = [0, 1, 0.7]
        scene["ends"]["end"] = {"kind": "free", "force": {"value": [5, 8, 30], "until": 0.5}}
        run = hybrid.run(scene | {"time": {"duration": 1.0, "step": step, "rho_inf": 1.0}})
        moving = run["energy/kinetic"].max()
        assert moving > 5.0 and run["curvature"].max() > 1.05 / RADIUS
        lost.append(np.abs(run["work/scheme"]).max() / moving)
    assert lost[1] < 0.01 and lost[1] < 0.5 * lost[0], lost


# --- Bend stiffeners: against the equation of the beam solved for itself, a closed form, and what they weigh ---

EI_STIFFENER = 1e4  # N m2
CONE = {"kind": "bend_stiffener", "range": [0, 3], "diameters": [0.3, 0.15], "bore": 0.12, "modulus": 2.5e8}


def taut_stiffener(cells: int, *attached: dict[str, Any], length: float = LENGTH, **tables: Any) -> dict[str, Any]:
    return taut(cells, {"length": length, "bending_stiffness": EI_STIFFENER}, None, *attached, **tables)


def stiffness(s: float) -> float:
    """N m2, of cable and cone."""
    D = 0.3 - 0.05 * s
    return EI_STIFFENER + (2.5e8 * pi / 64 * (D**4 - 0.12**4) if s < 3.0 else 0.0)


@cache
def of_beam() -> Any:
    """The angle and the moment along the line of (C2)-(C5): shot from the free end, in two parts."""

    def shot(tip: float) -> tuple[Any, Any]:
        def rate(s: float, y: Any) -> list[float]:
            return [y[1] / stiffness(min(s, 3.0 - 1e-12) if inside else 4.0), -PULL * sin(ANGLE - y[0])]

        inside = False
        out = solve_ivp(rate, (LENGTH, 3.0), [tip, 0.0], rtol=1e-11, atol=1e-11, dense_output=True)
        inside = True
        return out, solve_ivp(rate, (3.0, 0.0), out.y[:, -1], rtol=1e-11, atol=1e-11, dense_output=True)

    tip = brentq(lambda x: shot(x)[1].y[0, -1], ANGLE - 1e-3, ANGLE, xtol=1e-15)
    return shot(tip)


def beam_moment(s: float) -> float:
    out, inside = of_beam()
    return float((inside if s < 3.0 else out).sol(s)[1])


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_cone_bends_as_its_beam_does(dimension: int) -> None:
    """Of order 2 in the cells; on 40 cells within 1 % beside the clamp."""
    s, wrong = [0, 0.5, 1, 1.5, 2, 2.5, 4], []
    for cells in (40, 160, 320):
        found = hybrid.static(taut_stiffener(cells, CONE, dimension=dimension, output={"points": s}))
        at = [int(np.argmin(np.abs(found.s - x))) for x in s]
        M = np.array([beam_moment(x) for x in s])
        kappa = M / [stiffness(x) for x in s]
        wrong.append([np.abs(found.bending_moment[0, at] / M - 1), np.abs(found.curvature[0, at] / kappa - 1)])
    errors = np.array(wrong)
    assert errors[0].max() < 1e-2 and errors[0, :, :4].max() < 3e-3
    order = np.log2(errors[1, :, [0, 1, 5, 6]] / errors[2, :, [0, 1, 5, 6]])
    assert order.min() > 1.7 and order.max() < 2.3


def test_a_sleeve_that_bends_evenly() -> None:
    """EI(s) of a line of constant curvature, in closed form; the tension at the clamp is that of its pull."""
    kappa = 0.2
    length = (ANGLE - 2 * asin(0.5 * kappa * np.sqrt(EI_STIFFENER / PULL))) / kappa
    s = np.linspace(0, length, 81)
    more = PULL / kappa * (np.cos(ANGLE - kappa * length) - np.cos(ANGLE - kappa * s))
    assert length == pytest.approx(1.297966, abs=1e-6)
    assert (EI_STIFFENER * kappa + more[[0, 20, 40, 60, 80]]) / kappa == pytest.approx(
        [80384.2, 55130.8, 34929.2, 19864.4, 1e4], abs=0.1
    )
    rows = np.column_stack([s, np.maximum(more, 0.0) / kappa]).tolist()
    sleeve = {"kind": "bend_stiffener", "range": [0, length], "added_stiffness": rows}
    found = hybrid.static(taut_stiffener(400, sleeve, output={"points": [0, 0.3, 0.6, 0.9, 1.2]}))
    assert found.curvature[0, :5] == pytest.approx([kappa] * 5, rel=1e-3)
    assert found.tension[0, 0] == pytest.approx(PULL * cos(ANGLE), rel=1e-4)


def test_a_sleeve_weighs_floats_and_is_dragged_as_a_cone() -> None:
    """Pull of a line that hangs in a current: all weight less buoyancy; across it the drag on the larger diameter."""
    section = {"length": 8, "mass": 60, "diameter": 0.12, "bending_stiffness": EI_STIFFENER, "drag": {"normal": 1.0}}
    hung = cable_scene(
        section, clamped_at([0, 0, 0], [0, 0, -1]), "free", attachments=[CONE | {"density": 1200}],
        fluid={"density": 1000, "current": [0.2, 0, 0]}, model="rod", contact={"self": False}, mesh=80
    )  # fmt: skip
    found = hybrid.static(hung)
    volume = pi / 4 * (0.12**2 * 8 + ((0.3**2 + 0.3 * 0.15 + 0.15**2) / 3 - 0.12**2) * 3)
    mass = 60 * 8 + 1200 * (volume - pi / 4 * 0.12**2 * 8)
    assert found.reaction_start[0, 2] == pytest.approx(9.81 * (mass - 1000 * volume), rel=1e-4)
    drag = 500 * 0.2**2 * (0.225 * 3 + 0.12 * 5)
    assert -found.reaction_start[0, 0] == pytest.approx(drag, rel=2e-3)


def test_zones_keep_a_stiffened_clamp_a_rod() -> None:
    """A riser in water whose head sways: the bend beside its clamp is that of rods everywhere."""
    section = {
        "length": 120, "mass": 30, "diameter": 0.12, "bending_stiffness": EI_STIFFENER, "axial_stiffness": 1e8,
        "drag": {"normal": 1.2}, "added_mass": {"normal": 1},
    }  # fmt: skip
    sway = {"surge": {"amplitude": 1.0, "period": 6}, "ramp": 6}
    scene = cable_scene(
        section, clamped_at([0, 0, 0], [0, 0, -1], motion=sway), pinned_at(60, 0, -60),
        attachments=[CONE | {"density": 1150}], fluid={"density": 1025}, time=(10, 0.05), mesh=120,
        contact={"self": False}
    )  # fmt: skip
    rods, zones, cells = (
        hybrid.run(scene | {"model": model} | more)
        for model, more in (
            ("rod", {}), ("adaptive", {}), ({"kind": "adaptive", "curvature_error": 0.02}, {"mesh": {"cells": 40}}),
        )
    )  # fmt: skip
    assert any(zone.kind == "catenary" for zone in zones.zones[-1])
    assert zones.zones[-1][0].kind == "rod" and zones.zones[-1][0].s_b > 3.0
    largest = [x.curvature[:, x.s < 4.0].max() for x in (rods, zones, cells)]
    assert largest[1:] == pytest.approx([largest[0]] * 2, rel=3e-2)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"diameters": [0.3, 0.1]}, "at least the bore"),
        ({"modulus": None}, "a number (Pa)"),
        ({"range": [3, 0]}, "the smaller first"),
        ({"range": [0, 9]}, "between 0 and 8 m"),
        ({"added_stiffness": [[0, 1e5], [3, 1e3]]}, "because added_stiffness says how stiff it is"),
    ],
)
def test_what_describes_no_sleeve_is_refused(given: dict[str, Any], expected: str) -> None:
    sleeve = {key: x for key, x in (CONE | given).items() if x is not None}
    with pytest.raises(SceneError, match=expected.replace("(", r"\(").replace(")", r"\)")):
        hybrid.validate_scene(taut_stiffener(40, sleeve))


@pytest.mark.parametrize("rows", [[[0, 1e5], [2, 1e4]], [[0, 1e5], [2, 1e4], [1, 1e4], [3, 1e3]]])
def test_rows_cover_the_range_of_a_sleeve(rows: list[list[float]]) -> None:
    with pytest.raises(SceneError, match=r"rows from 0 to 3 m|arc lengths that rise"):
        hybrid.validate_scene(taut_stiffener(40, {"kind": "bend_stiffener", "range": [0, 3], "added_stiffness": rows}))
