"""Bend stiffeners: against the equation of the beam solved for itself, a closed form, and what they weigh."""

from __future__ import annotations

from functools import cache
from math import asin, cos, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_moment_tables import ANGLE, LENGTH, PULL
from test_moment_tables import taut as with_law

import hybrid
from hybrid.errors import SceneError
from tests.scenes import cable_scene, clamped_at, pinned_at

EI = 1e4  # N m2
CONE = {"kind": "bend_stiffener", "range": [0, 3], "diameters": [0.3, 0.15], "bore": 0.12, "modulus": 2.5e8}


def taut(cells: int, *attached: dict[str, Any], length: float = LENGTH, **tables: Any) -> dict[str, Any]:
    return with_law(cells, {"length": length, "bending_stiffness": EI}, None, *attached, **tables)


def stiffness(s: float) -> float:
    """N m2, of cable and cone."""
    D = 0.3 - 0.05 * s
    return EI + (2.5e8 * pi / 64 * (D**4 - 0.12**4) if s < 3.0 else 0.0)


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
        found = hybrid.static(taut(cells, CONE, dimension=dimension, output={"points": s}))
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
    length = (ANGLE - 2 * asin(0.5 * kappa * np.sqrt(EI / PULL))) / kappa
    s = np.linspace(0, length, 81)
    more = PULL / kappa * (np.cos(ANGLE - kappa * length) - np.cos(ANGLE - kappa * s))
    assert length == pytest.approx(1.297966, abs=1e-6)
    assert (EI * kappa + more[[0, 20, 40, 60, 80]]) / kappa == pytest.approx(
        [80384.2, 55130.8, 34929.2, 19864.4, 1e4], abs=0.1
    )
    rows = np.column_stack([s, np.maximum(more, 0.0) / kappa]).tolist()
    sleeve = {"kind": "bend_stiffener", "range": [0, length], "added_stiffness": rows}
    found = hybrid.static(taut(400, sleeve, output={"points": [0, 0.3, 0.6, 0.9, 1.2]}))
    assert found.curvature[0, :5] == pytest.approx([kappa] * 5, rel=1e-3)
    assert found.tension[0, 0] == pytest.approx(PULL * cos(ANGLE), rel=1e-4)


def test_a_sleeve_weighs_floats_and_is_dragged_as_a_cone() -> None:
    """Pull of a line that hangs in a current: all weight less buoyancy; across it the drag on the larger diameter."""
    section = {"length": 8, "mass": 60, "diameter": 0.12, "bending_stiffness": EI, "drag": {"normal": 1.0}}
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
        "length": 120, "mass": 30, "diameter": 0.12, "bending_stiffness": EI, "axial_stiffness": 1e8,
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
        hybrid.validate_scene(taut(40, sleeve))


@pytest.mark.parametrize("rows", [[[0, 1e5], [2, 1e4]], [[0, 1e5], [2, 1e4], [1, 1e4], [3, 1e3]]])
def test_rows_cover_the_range_of_a_sleeve(rows: list[list[float]]) -> None:
    with pytest.raises(SceneError, match=r"rows from 0 to 3 m|arc lengths that rise"):
        hybrid.validate_scene(taut(40, {"kind": "bend_stiffener", "range": [0, 3], "added_stiffness": rows}))
