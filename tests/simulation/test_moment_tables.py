"""Tables of moment over curvature and bend restrictors: a closed form, the discrete line solved for itself, energy."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import hybrid
from hybrid.errors import SceneError
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
