"""How near a torque is to throwing a loop, and whether a loop pulled tight kinks before it pops out.

A long rod of bending stiffness EI, N m2, under tension T, N, and torque M, N m, that leaves the straight line in one
place has the shape (A. B. H. Coyne, IEEE J. Oceanic Eng. 15, 1990; lengths in sqrt(EI/T), m = M/(2 sqrt(EI T)),
k = sqrt(1 - m^2))

    z = s - 2 k tanh k s,   x + i y = 2 k sech k s exp(i m s).

It is there for m < 1 alone: beyond, the straight rod buckles (Greenhill).  Pulled tighter the loop shrinks with
sqrt(EI/T) until its two strands touch, and then lies on itself until it slips open: it pops out.  Friction, plasticity
and the structure of the strands are not in it.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

Floats = np.ndarray
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
