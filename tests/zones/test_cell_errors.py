"""e_k and e_h of kernels.mesh.cell_errors against errors measured: equilibria of a catenary, or of long cells, and a fine rod."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

import hybrid
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.mesh import cell_errors as e
from hybrid.kernels.mesh import zone_criteria as c
from hybrid.kernels.mesh.cell_errors import CURVATURE, MOMENT, POSITION, TENSION
from tests.scenes import cable_scene, pinned_at

LENGTH, W, GRAVITY = 100.0, 10.0 * 9.80665, 9.80665  # m, N/m
LOW, HIGH = 0.5, 3.0  # measured error over predicted


@kernel
def lack_of_bend(EI, w, T, kappa, bends):
    return e.lack_of_bend(EI, w, T, kappa, bends)


@kernel
def lack_at_clamp(EI, w, T, angle):
    return e.lack_at_clamp(EI, w, T, angle)


@kernel
def lack_at_kink(EI, w, T, angle):
    return e.lack_at_kink(EI, w, T, angle)


@kernel
def lack_at_edge(EI, w, T, k):
    return e.lack_at_edge(EI, w, T, k, 0.0)


@kernel
def lack_of_moment(EI, T, moment):
    return e.lack_of_moment(EI, T, moment)


@kernel
def error_of_length(EI, w, kappa, bends, h):
    return e.error_of_length(EI, w, kappa, bends, h)


@kernel
def longest(EI, w, kappa, bends, shares):
    """The longest cell, and the part of its error over its share."""
    h = e.longest_cell(EI, w, kappa, bends, shares)
    return h, e.over_shares(e.error_of_length(EI, w, kappa, bends, h), shares) if h < np.inf else 0.0


class Measured(NamedTuple):
    """A catenary beside a fine rod."""

    rod: hybrid.Result
    catenary: hybrid.Result

    def largest(self, name: str, a: float = 0.0, b: float = LENGTH) -> float:
        """Largest difference of an output between s = a and b, m."""
        none = np.zeros_like(self.rod.s)[None]  # a catenary's result has no moments
        gap = self.rod[name][-1] - (none if name == "bending_moment" else self.catenary[name])[-1]
        s = self.rod.s
        gap = np.linalg.norm(gap, axis=-1) if gap.ndim == 2 else np.abs(gap)
        return float(gap[(s >= a) & (s <= b)].max())

    def at(self, name: str, s: float, kind: str = "catenary") -> float:
        result = getattr(self, kind)
        return float(np.interp(s, result.s, result[name][-1]))


def scene(model: str, cells: int, EI: float, end: Any, start: Any = None, **more: Any) -> hybrid.Scene:
    section = {"length": LENGTH, "mass": 10.0, "diameter": 0.03, "axial_stiffness": 1e8, "bending_stiffness": EI}
    cable = {"sections": [section]} | more.pop("cable", {})
    ends = {"start": start or {"kind": "pinned", "position": [0, 0, 0]}, "end": end}
    common = {"initial": "equilibrium", "output": {"points": 4001, "errors": False}, "mesh": {"cells": cells}}
    environment = more.pop("environment", {})
    return hybrid.validate_scene(
        {"cable": cable, "ends": ends, "model": model, "environment": {"gravity": GRAVITY} | environment}
        | common
        | more
    )


def measured(EI: float, end: Any, **more: Any) -> Measured:
    return Measured(*(hybrid.static(scene(kind, 2000, EI, end, **more)) for kind in ("rod", "catenary")))


def pinned(x: float, z: float = 0.0) -> dict[str, Any]:
    return {"kind": "pinned", "position": [x, 0, z]}


def assert_within(measured: float, predicted: float) -> None:
    assert LOW < measured / predicted < HIGH, (measured, predicted, measured / predicted)


# --- e_k ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("span", [95.0, 99.0, 99.9])
def test_sag_of_a_tether(span: float) -> None:
    """Position by EI kappa/T, and moment by EI kappa, where the line is sharpest."""
    EI, middle = 2e3, LENGTH / 2
    found = measured(EI, pinned(span))
    lack = lack_of_bend(EI, W, found.at("tension", middle), found.at("curvature", middle), 0.0)
    assert_within(found.largest("position"), lack.position)
    assert_within(found.largest("bending_moment", 20, 80), lack.moment)


@pytest.mark.parametrize("span", [60.0, 70.0])
def test_bend_of_a_deep_sag(span: float) -> None:
    """Tension by EI kappa^2/2, curvature by l0^2 |kappa''|."""
    EI, middle = 2e4, LENGTH / 2
    found = measured(EI, pinned(span))
    s, k = found.catenary.s, found.catenary.curvature[-1]
    bends = float(np.abs(np.gradient(np.gradient(k, s), s))[(s > 40) & (s < 60)].max())
    lack = lack_of_bend(EI, W, found.at("tension", middle), found.at("curvature", middle), bends)
    assert_within(found.largest("tension", 40, 60), lack.tension)
    assert_within(found.largest("curvature", 40, 60), lack.curvature)


@pytest.mark.parametrize("angle", [0.05, 0.3])
def test_layer_at_a_clamp(angle: float) -> None:
    """A taut line that leaves a clamp at an angle: lam angle, and angle/lam of curvature."""
    EI = 2e3
    free = measured(EI, pinned(99.9))
    d = free.catenary.position[-1][1] - free.catenary.position[-1][0]
    a = np.arctan2(d[2], d[0]) + angle
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [float(np.cos(a)), 0, float(np.sin(a))]}
    found = measured(EI, pinned(99.9), start=start)
    T = found.at("tension", 0.0)
    lack = lack_at_clamp(EI, W, T, angle)
    lam = np.sqrt(EI / T)
    assert_within(found.largest("position", 0.0, 6 * lam), lack.position)
    assert_within(found.largest("curvature", 0.0, lam), lack.curvature)
    assert_within(found.largest("bending_moment", 0.0, lam), lack.moment)
    if angle > 0.1:  # else it is what the change of the sag does to all of the line
        assert_within(found.largest("tension", 0.0, 0.5 * lam), lack.tension)


@pytest.mark.parametrize("mass", [20.0, 200.0])
def test_kink_at_a_point_load(mass: float) -> None:
    EI = 2e3
    found = measured(EI, pinned(99.0), cable={"attachments": [{"kind": "clump", "at": 50.0, "mass": mass}]})
    T = found.at("tension", 49.9)
    angle = mass * GRAVITY / T
    lack, lam = lack_at_kink(EI, W, T, angle), np.sqrt(EI / T)
    assert_within(found.largest("position", 45, 55), lack.position + lack_of_bend(EI, W, T, W / T, 0.0).position)
    assert_within(found.largest("curvature", 50 - lam, 50 + lam), lack.curvature)
    assert_within(found.largest("bending_moment", 50 - lam, 50 + lam), lack.moment)
    if mass > 100.0:
        assert_within(found.largest("tension", 49.5, 49.99), lack.tension)


@pytest.mark.parametrize(("EI", "k"), [(2e3, 2e6), (2e4, 2e6), (2e3, 2e4), (2e4, 5e3)])
def test_edge_of_contact(EI: float, k: float) -> None:
    """Where a line comes off a hard bed, its curvature jumps by w/T, of which the rod has half; less on a soft one."""
    bed = {"seabed": {"z": 0.0, "stiffness": k, "damping": 0.0}}
    found = measured(EI, pinned(93.0, 25.0), environment=bed)
    s = float(found.catenary.touchdown[-1][1])
    T = found.at("tension", s)
    lack, lam = lack_at_edge(EI, W, T, k), np.sqrt(EI / T)
    assert_within(found.largest("position", s - 6 * lam, s + 6 * lam), lack.position)
    assert_within(found.largest("curvature", s - 4 * lam, s + 4 * lam), lack.curvature)


def test_a_moment_given_at_an_end() -> None:
    EI, M = 2e3, 3e3
    found = measured(EI, {"kind": "free", "force": [4e4, 0, LENGTH * W / 2], "moment": [0, M, 0]})
    T = found.at("tension", LENGTH)
    lack, lam = lack_of_moment(EI, T, M), np.sqrt(EI / T)
    assert_within(found.largest("position", LENGTH - 6 * lam, LENGTH), lack.position)
    assert_within(found.largest("curvature", LENGTH - lam, LENGTH), lack.curvature)
    assert_within(found.largest("bending_moment", LENGTH - lam, LENGTH), lack.moment)


# --- e_h ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [25, 50])
def test_interpolation_along_cells(cells: int) -> None:
    """h^2 kappa/8 of chords, h^2 |kappa''|/8 of curvature, of a catenary."""
    EI, end = 1.0, pinned(60.0)
    coarse, fine = (hybrid.static(scene("catenary", n, EI, end)) for n in (cells, 4000))
    s, h = fine.s, LENGTH / cells
    inner = (s > 2 * h) & (s < LENGTH - 2 * h)
    k = fine.curvature[-1]
    bends = float(np.abs(np.gradient(np.gradient(k, s), s))[inner].max())
    lack = error_of_length(EI, W, float(k.max()), bends, h)
    assert_within(float(np.abs(coarse.curvature[-1] - k)[inner].max()), lack.curvature)
    nodes = coarse.mesh[0].s if coarse.mesh else np.linspace(0, LENGTH, cells + 1)
    x = np.stack([np.interp(s, nodes, np.interp(nodes, s, fine.position[-1][:, j])) for j in range(3)], axis=1)
    assert_within(float(np.linalg.norm(x - fine.position[-1], axis=1).max()), lack.position)


def test_the_longest_cell_reaches_its_share() -> None:
    shares = np.full(4, np.inf)
    for quantity, share in ((POSITION, 0.1), (TENSION, 50.0), (CURVATURE, 1e-3), (MOMENT, 2.0)):
        shares[:] = np.inf
        shares[quantity] = share
        assert longest(2e3, W, 0.02, 1e-4, shares)[1] == pytest.approx(1.0)
    assert longest(2e3, W, 0.0, 0.0, np.full(4, np.inf))[0] == np.inf


# --- edges of contact ---

EI, H, HEAVY, RISE = 4.0, 100.0, 10.0, 10.0  # N m2, N, N/m, m: sqrt(EI/H) is 0.2 m


@kernel
def shift_per_length(turn):
    return c.shift_per_length(turn)


def tension_on_the_bed(model: object) -> float:
    """N, of a line of 37.5 m that leaves a hard bed at s = 20 m; `model`: rod, or to so many metres beyond that."""
    if isinstance(model, float):
        zones = [{"catenary": 17.5}, {"rod": 2.5 + model}, {"catenary": 17.520597 - model}]
        model = {"kind": "zones", "zones": zones}
    found = hybrid.static(cable_scene(
        {"length": 37.520597, "mass": 1.0, "bending_stiffness": EI}, pinned_at(0, 0, 0),
        pinned_at(33.371257775207795, 0, RISE), gravity=10.0, seabed={"z": 0, "stiffness": 1e9}, model=model, mesh=1500
    ))  # fmt: skip
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
        assert tension_on_the_bed(beyond) - rod == pytest.approx(HEAVY * (S * dx + (C - 1.0) * dy) / D, rel=closeness)
        moved = abs((1.0 - C) * dx + (S - C * u) * dy) / D
        assert 0.7 < moved / (shift_per_length(math.atan(S)) * np.trapezoid(reach, x)) < 1.05
