"""Where a twisted rod loses its stability: the lowest eigenvalue of the discrete stiffness passes zero."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import (
    GREENHILL_CLAMPED,
    at_rest,
    build,
    greenhill_clamped,
    lowest,
    order,
    positive_definite,
    ring,
    stiffness,
    twist_uniformly,
    twisted_taut_rod,
)
from scipy.optimize import brentq

from hybrid.scene.read import one_line


def critical_torque(load: float, cells: int, torsional_stiffness: float) -> float:
    """Torque over 2 sqrt(EI T) at which the straight, evenly twisted rod buckles."""
    model = build(one_line(twisted_taut_rod(load, cells, torsional_stiffness)))
    taut = at_rest(model).state.lines[0]

    def stable(ratio: float) -> bool:
        state = taut.copy()
        ends = twist_uniformly(model, state, ratio * 2 * math.sqrt(load) / torsional_stiffness)
        return positive_definite(stiffness(model, ends, state))

    low, high = 1.0, 1.15
    assert stable(low)
    assert not stable(high)
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return 0.5 * (low + high)


def test_greenhill_is_the_published_root():
    """The roots of the closed form are the digits of shared/validation.md."""
    for load, published in GREENHILL_CLAMPED.items():
        assert greenhill_clamped(load) == pytest.approx(published, abs=0.5e-4)


@pytest.mark.long
@pytest.mark.parametrize("torsional_stiffness", [1.0, 100.0], ids=["GJ = EI", "GJ = 100 EI"])
def test_torsional_buckling(torsional_stiffness, report):
    found = np.array([critical_torque(100.0, n, torsional_stiffness) for n in (50, 100)])
    error = found / greenhill_clamped(100.0) - 1
    p = order(error)[0]
    report(
        f"Torsional buckling, L/lambda = 10, GJ/EI = {torsional_stiffness:g}, 100 cells",
        "Greenhill, clamped: 1.0492",
        f"{found[1]:.4f}, {100 * error[1]:+.3f} %, order {p:.2f}",
        "discretisation: 0.2 %, order 2.0 +- 0.1",
    )
    assert abs(found[1] / GREENHILL_CLAMPED[100.0] - 1) <= 2e-3
    assert abs(p - 2.0) <= 0.1


@pytest.mark.slow  # 20 s
@pytest.mark.parametrize(("load", "cells"), [(400.0, 200), pytest.param(1600.0, 400, marks=pytest.mark.slow)])
def test_torsional_buckling_of_longer_rods(load, cells, report):
    """As many cells per sqrt(EI/T) as above: the same 0.2 %."""
    found = critical_torque(load, cells, 1.0)
    report(
        f"Torsional buckling, L/lambda = {math.sqrt(load):g}, {cells} cells",
        f"Greenhill, clamped: {GREENHILL_CLAMPED[load]}",
        f"{found:.4f}, {100 * (found / GREENHILL_CLAMPED[load] - 1):+.3f} %",
        "discretisation: 0.2 %",
    )
    assert abs(found / GREENHILL_CLAMPED[load] - 1) <= 2e-3


def critical_turn(cells: int) -> float:
    """End rotation over 2 pi sqrt(3) EI/GJ at which a flat ring writhes.

    The clamped polygon is out of balance by a part h^2 next to the clamp, which is of the order of the result.
    """
    model = build(one_line(ring(cells, 1.0)))

    def softest_but_rolling(turn: float) -> float:
        state = model.start.copy()
        state.T[:] = 0.0
        ends = twist_uniformly(model, state, turn * 2 * math.pi * math.sqrt(3))
        values = lowest(stiffness(model, ends, state), 3)
        return float(np.delete(values, np.abs(values).argmin())[0])

    return float(brentq(softest_but_rolling, 0.9, 1.05, xtol=1e-7))


@pytest.mark.long
def test_twisted_ring(report):
    error = np.array([critical_turn(n) for n in (20, 40, 80)]) - 1
    p = order(error)
    report(
        "Twisted ring: critical end rotation, 40 cells",
        "Michell, Zajac: 2 pi sqrt(3) EI/GJ",
        f"{100 * error[1]:+.3f} %, order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 0.2 %, order 2.0 +- 0.1",
    )
    assert abs(error[1]) <= 2e-3
    assert np.abs(p - 2.0).max() <= 0.1
