"""Where an edge of contact comes to lie by what is catenary beyond it: estimates against equilibria with joints."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybrid
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.mesh import zone_criteria as c

EI, H, W, RISE = 4.0, 100.0, 10.0, 10.0  # N m2, N, N/m, m: sqrt(EI/H) is 0.2 m


@kernel
def shift_per_length(turn):
    return c.shift_per_length(turn)


def tension_on_the_bed(model: object) -> float:
    """N, of a line of 37.5 m that leaves a hard bed at s = 20 m; `model`: rod, or to so many metres beyond that."""
    if isinstance(model, float):
        zones = [{"catenary": 17.5}, {"rod": 2.5 + model}, {"catenary": 17.520597 - model}]
        model = {"kind": "zones", "zones": zones}
    found = hybrid.static({
        "environment": {"gravity": 10.0, "seabed": {"z": 0, "stiffness": 1e9}},
        "cable": {"sections": [{"length": 37.520597, "mass": 1.0, "bending_stiffness": EI}]},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]},
                 "end": {"kind": "pinned", "position": [33.371257775207795, 0, RISE]}},
        "initial": "equilibrium", "model": model, "mesh": {"cells": 1500},
    })  # fmt: skip
    return float(found.tension[-1, 0])


@pytest.mark.parametrize("u", [0.05, 0.0999, 0.1001, 0.5, 1.325, 2.0])
def test_an_edge_goes_with_the_length_beyond_it(u: float) -> None:
    """The largest of (1 - C) dX + (S - C u) dY over D; 6/u^2 of a shallow line; no step where the formula changes."""
    C, S = math.cosh(u), math.sinh(u)
    exact = math.hypot(1.0 - C, S - C * u) / ((u - S) * S + (C - 1.0) ** 2)
    assert shift_per_length(math.atan(S)) == pytest.approx(exact, rel=0.01 if u > 0.1 else 0.05)


def test_catenaries_in_place_of_rods_are_too_short() -> None:
    """By the integral of lam^2 kappa^2 (t + tan(theta) n), of the second half of this line: its tension shows it.

    kappa = 10/(100 + x^2), lam^2 = 0.4/sqrt(100 + x^2), tan(theta) = x/10, x m of line from the edge.  The place of the
    edge is that of a node of the mesh.
    """
    rod, u = tension_on_the_bed("rod"), math.asinh(1.75)
    C, S = math.cosh(u), math.sinh(u)
    D = (u - S) * S + (C - 1.0) ** 2
    for beyond, closeness in ((2.0, 0.15), (5.0, 0.2), (10.0, 0.3)):
        x = np.linspace(beyond, 17.5, 2001)
        theta, reach = np.arctan(x / 10.0), 40.0 * (100.0 + x * x) ** -2.5
        dx = np.trapezoid(reach * np.cos(2.0 * theta) / np.cos(theta), x)
        dy = np.trapezoid(reach * 2.0 * np.sin(theta), x)
        assert tension_on_the_bed(beyond) - rod == pytest.approx(W * (S * dx + (C - 1.0) * dy) / D, rel=closeness)
        moved = abs((1.0 - C) * dx + (S - C * u) * dy) / D
        assert 0.7 < moved / (shift_per_length(math.atan(S)) * np.trapezoid(reach, x)) < 1.05
