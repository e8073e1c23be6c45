"""How much of its capacity a line uses of tension and curvature at once, and of its strength as a mooring line.

    symbol   meaning                                                      unit
    T, k     tension, curvature, at one time and place                    N, 1/m
    c_i      corners (T_i, k_i) of the capacity polygon                   N, 1/m
    u        part that is used: how far (T, k) is on the way from no load -
             to the polygon

Between the directions of two corners u = (p x e)/(c_i x e), with p = (T, k), e = c_{i+1} - c_i and x the cross product
in the plane.  Tension below zero counts as none where the polygon has no compression.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.envelope import GROUP, SCALE, has_envelope
from hybrid.store.stored_result import StoredResult

Floats = np.ndarray
# The field of a result, in percent; its sections with their corners, rows (K, 4) of s from, s to (m), T (N), k (1/m).
NAME, CORNERS = "capacity_used", "capacity"
# Part of the length of a line within which a place is at a border of sections.
NEAR = 1e-9


def used(corners: Floats, T: Floats, k: Floats) -> Floats:
    """Part of the capacity that tensions (N) and curvatures (1/m) use, of any shape; corners: (n, 2)."""
    corners = np.asarray(corners, float)
    if corners[-1, 0] == 0.0:
        T = np.maximum(T, 0.0)
    k = np.abs(k)
    found = np.zeros(np.broadcast_shapes(np.shape(T), np.shape(k)))
    for i, (a, b) in enumerate(pairwise(corners)):
        e = b - a
        here = (a[0] * k - a[1] * T >= 0.0) & (b[0] * k - b[1] * T <= 0.0)
        if i == 0:  # below the first direction there is nothing
            here |= (k == 0.0) & (T >= 0.0)
        if i == len(corners) - 2:
            here |= (k == 0.0) & (T < 0.0)
        part = (T * e[1] - k * e[0]) / (a[0] * e[1] - a[1] * e[0])
        found = np.where(here, part, found)
    return np.where(np.isfinite(T) & np.isfinite(k), found, np.nan)


def most_used(corners: Floats, low: Floats, high: Floats, k: Floats) -> Floats:
    """The largest part that any tension from low to high (N) with any curvature up to k (1/m) uses.

    It is at a corner of that rectangle, or where the way to a corner of the polygon leaves it: to the first, without
    bending.
    """
    corners = np.asarray(corners, float)
    found = np.maximum(used(corners, low, k), used(corners, high, k))
    for T_i, k_i in corners:
        if k_i > 0.0:
            found = np.maximum(found, used(corners, np.clip(k * T_i / k_i, low, high), k))
        for T in (low, high):
            if T_i != 0.0:
                found = np.maximum(found, used(corners, T, np.clip(T * k_i / T_i, 0.0, k)))
    return found


class Stretch(NamedTuple):
    """A section that has a capacity: from a to b (m), corners (n, 2) N, 1/m."""

    a: float
    b: float
    corners: Floats


def stretches_of(result: StoredResult) -> list[Stretch]:
    """The sections of a result that have a capacity."""
    if CORNERS not in result:
        return []
    rows = np.asarray(result[CORNERS])
    places = sorted({(a, b) for a, b in rows[:, :2].tolist()})
    return [Stretch(a, b, rows[(rows[:, 0] == a) & (rows[:, 1] == b), 2:]) for a, b in places]


def _inside(x: Stretch, s: Floats) -> np.ndarray:
    """Which places (n,) m lie in a section; of a place that comes twice the first belongs to the left one."""
    near = NEAR * max(float(s[-1] - s[0]), 1.0)
    twice = np.diff(s) == 0.0
    first, second = np.append(twice, False), np.insert(twice, 0, False)
    return (s >= x.a - near) & (s <= x.b + near) & ~(first & (np.abs(s - x.a) <= near)) & ~(
        second & (np.abs(s - x.b) <= near)
    )  # fmt: skip


def bound_of_steps(result: StoredResult, errors: tuple[float, float] = (0.0, 0.0)) -> float | None:
    """Upper bound of the utilisation of capacity over all steps and nodes.

    By the ranges of tension and curvature over all of them, as if their extremes coincided; None: the result has no
    envelope.  errors: of these ranges, N and 1/m.
    """
    names = [f"{GROUP}/{x}" for x in ("tension_min", "tension_max", "curvature_max")]
    if not has_envelope(result) or any(name not in result for name in names):
        return None
    low, high, k = (np.asarray(result[x]) + e for x, e in zip(names, (-errors[0], *errors), strict=True))
    s = np.asarray(result[SCALE])
    return _largest(result, lambda x, at: most_used(x.corners, low[at], high[at], k[at]), s)


def bound_with_errors(result: StoredResult) -> float | None:
    """The part that no output exceeds, whatever the errors of tension and curvature; None: they are not known."""
    names = ("tension", "curvature", "errors/total/tension", "errors/total/curvature")
    if any(name not in result for name in names):
        return None
    s = result.both_sides("tension")[0]
    T, k, dT, dk = (result.both_sides(name)[1] for name in names)
    return _largest(result, lambda x, at: most_used(x.corners, (T - dT)[:, at], (T + dT)[:, at], (k + dk)[:, at]), s)


def _largest(result: StoredResult, part: Callable[[Stretch, np.ndarray], Floats], s: Floats) -> float | None:
    values = [v for x in stretches_of(result) if (v := part(x, _inside(x, s))).size and np.isfinite(v).any()]
    return max((float(np.nanmax(v)) for v in values), default=None)


# --- mooring lines -------------------------------------------------------------------------------


def mooring_use(
    result: StoredResult, strength: float, factors: tuple[float, ...], pretension: float | StoredResult
) -> tuple[Floats, Floats, Floats]:
    """Utilisation of a mooring line by DNV-OS-E301, u = (T_pre g_pre + (T - T_pre) g_env)/S.

    Returns arc lengths (n,) m, u at the outputs (nt, n), and u of the largest tension of all steps and outputs (n,).
    strength: S, N; factors: g_pre, g_env; pretension: T_pre, N, or the result of an equilibrium under it.  July 2021,
    Ch.2 Sec.2, as the manual of SIMA 4.8 gives it.  ResultError: a pretension of another line.
    """
    if not (0.0 < strength < np.inf and len(factors) == 2 and all(0.0 < x < np.inf for x in factors)):
        raise ResultError("mooring\n    expected: a strength (N) above 0, and two factors above 0")
    s, T = result.both_sides("tension")
    if isinstance(pretension, int | float):
        before = np.full(s.shape, float(pretension))
    else:
        if pretension.lines or abs(float(pretension.s[-1] - result.s[-1])) > 1e-6 * float(result.s[-1] - result.s[0]):
            raise ResultError("mooring\n    expected: the pretension of the same line, or a number in N")
        there, tension = pretension.both_sides("tension")
        before = tension[0] if np.array_equal(there, s) else np.interp(s, there, tension[0])
    most = T.max(axis=0)
    if has_envelope(result) and f"{GROUP}/tension_max" in result:
        most = np.maximum(most, np.interp(s, result[SCALE], result[f"{GROUP}/tension_max"]))
    first, second = factors
    at_outputs, largest = ((before * first + (x - before) * second) / strength for x in (T, most))
    return s, at_outputs, largest


# How near a torque is to throwing a loop, and whether a loop pulled tight kinks before it pops out.
#
# A long rod of bending stiffness EI, N m2, under tension T, N, and torque M, N m, that leaves the straight line in one
# place has the shape (A. B. H. Coyne, IEEE J. Oceanic Eng. 15, 1990; lengths in sqrt(EI/T), m = M/(2 sqrt(EI T)),
# k = sqrt(1 - m^2))
#
#     z = s - 2 k tanh k s,   x + i y = 2 k sech k s exp(i m s).
#
# It is there for m < 1 alone: beyond, the straight rod buckles (Greenhill).  Pulled tighter the loop shrinks with
# sqrt(EI/T) until its two strands touch, and then lies on itself until it slips open: it pops out.  Friction,
# plasticity
# and the structure of the strands are not in it.

# Of the largest tension: a torque that asks for less of it is no torque that throws loops; a tension below is none.
PART_OF_TENSION, NO_TENSION = 1e-4, 1e-6


class PopOut(NamedTuple):
    """A loop of a cable of some diameter as it pops out: tension, N, and the bend radius at its crown, m."""

    tension: float
    radius: float


def formation_tension(torque: Floats, stiffness: Floats) -> Floats:
    """Tension, N, below which a loop can form: M^2/(4 EI); 0 without bending stiffness."""
    square = np.square(torque)
    return np.divide(square, 4.0 * stiffness, out=np.zeros_like(square), where=np.asarray(stiffness) > 0.0)


def formation_ratio(torque: Floats, tension: Floats, stiffness: Floats) -> Floats:
    """The tension below which a loop can form over the one there is, of torque (N m), tension (N) and EI (N m2).

    1 over the formation margin; 0 everywhere where no torque asks for a tension worth speaking of.
    """
    needed = formation_tension(torque, np.broadcast_to(stiffness, torque.shape))
    most = float(np.abs(tension).max())
    if not float(needed.max()) > PART_OF_TENSION * most or most == 0.0:  # without any tension: a start, no scale
        return np.zeros(needed.shape)
    none = NO_TENSION * most
    return np.where(needed > none, needed / np.maximum(tension, none), 0.0)


def strand_distance(m: float) -> float:
    """Least distance of the two strands of a loop, in sqrt(EI/T); NaN where the loop has no crossing of its own."""
    k = np.sqrt(1.0 - m * m)
    s = np.linspace(0.3, 4.0, 4001)
    d = np.hypot(2.0 * (s - 2.0 * k * np.tanh(k * s)), 4.0 * k / np.cosh(k * s) * np.sin(m * s))
    least = np.flatnonzero((d[1:-1] < d[:-2]) & (d[1:-1] <= d[2:])) + 1
    if not least.size:
        return float("nan")
    i = int(least[0])
    bend = d[i - 1] - 2.0 * d[i] + d[i + 1]  # to the foot of the parabola through three points
    return float(d[i] - (d[i + 1] - d[i - 1]) ** 2 / (8.0 * bend))


@cache
def _loops() -> tuple[Floats, Floats]:
    """m of loops that touch themselves, rising, and M D/EI = 2 m delta(m) of each."""
    m = np.linspace(0.0, 0.6, 601)[1:]
    q = 2.0 * m * np.array([strand_distance(float(x)) for x in m])
    there = np.isfinite(q)
    return m[there], q[there]


def pop_out(torque: float, stiffness: float, diameter: float) -> PopOut | None:
    """The loop of a cable of a diameter, m, under a torque, N m, as it pops out; None: none is trapped by its strands.

    Without torque there is no loop; of a torque above about 1.65 EI/D strands do not hold each other.
    """
    m, q = _loops()
    asked = abs(torque) * diameter / stiffness if stiffness > 0.0 else np.inf
    if not q[0] <= asked <= q[-1]:
        if not 0.0 < asked < q[0]:
            return None
        at = float(m[0] * np.sqrt(asked / q[0]))  # delta is m times a constant there
    else:
        at = float(np.interp(np.sqrt(asked), np.sqrt(q), m))
    tension = torque * torque / (4.0 * stiffness * at * at)
    radius = 0.5 * np.sqrt(stiffness / (tension * (1.0 - at * at)))
    return PopOut(float(tension), float(radius))


def kink_torque(stiffness: float, diameter: float, radius: float) -> float:
    """Torque, N m, from which on a loop is bent below the allowed radius, m, before it pops out; inf: none is."""
    m, q = _loops()
    delta = 0.5 * q / m
    crown = diameter / (2.0 * delta * np.sqrt(1.0 - m * m))  # m, falls as m grows, but for the last loops
    low = np.flatnonzero(crown < radius)
    if not low.size:
        return float("inf")
    i = int(low[0])
    if i == 0:
        return float(q[0] * (crown[0] / radius) ** 2 * stiffness / diameter)
    part = (crown[i - 1] - radius) / (crown[i - 1] - crown[i])
    return float((q[i - 1] + part * (q[i] - q[i - 1])) * stiffness / diameter)
