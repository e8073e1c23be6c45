"""Extremes over all accepted steps: of tension, curvature, moment, torque, contact force, displacement, at every node."""

from __future__ import annotations

import math

from hybrid.kernels.books import CURVATURE, DISPLACEMENT, MOMENT, PRESSURE, TENSION, TORQUE
from hybrid.kernels.cell import chord
from hybrid.kernels.compile import inner
from hybrid.kernels.forces import SEABED
from hybrid.kernels.node_forces import get3
from hybrid.kernels.rotations import cross, dot, sub


@inner
def widen(extremes, what, i, x, t):
    """Widen the range of a quantity at node (or cell) i to x, found at time t."""
    if x < extremes[0, what, i]:
        extremes[0, what, i], extremes[2, what, i] = x, t
    if x > extremes[1, what, i]:
        extremes[1, what, i], extremes[3, what, i] = x, t


@inner
def catenary_curvature(line, state, i):
    """Curvature, 1/m, of a line without element at node i: of the circle that its two chords are tangents of."""
    d, _, _ = chord(get3(state.e, i - 1))
    dn, _, _ = chord(get3(state.e, i))
    s = cross(d, dn)
    return 2.0 * math.sqrt(dot(s, s)) / (max(1.0 + dot(d, dn), 1e-12) * line.hn[i])


@inner
def note_extremes(line, sea, state, books, t):
    """Widen the extremes to the state at time t; books.strains: of its elements."""
    extremes, n = books.extremes, line.h.shape[0]
    normal = get3(sea.normal.reshape(1, 3), 0)
    for i in range(n + 1):
        if i < n:
            widen(extremes, TENSION, i, state.T[i], t)
        curvature = books.strains[i, 0]
        if not line.element[i] and 0 < i < n:
            curvature = catenary_curvature(line, state, i)
        widen(extremes, CURVATURE, i, curvature, t)
        widen(extremes, MOMENT, i, books.strains[i, 1], t)
        widen(extremes, TORQUE, i, books.strains[i, 2], t)
        if line.bits & SEABED:
            widen(extremes, PRESSURE, i, dot(normal, get3(state.bed, i)) / line.hn[i], t)
        x = sub(get3(state.r, i), get3(books.start, i))
        widen(extremes, DISPLACEMENT, i, math.sqrt(dot(x, x)), t)
