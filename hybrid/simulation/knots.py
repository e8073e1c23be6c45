"""Knots of a line: what is left of it when every bend is drawn straight that nothing holds, and its crossings.

A corner of a polyline may be drawn straight where no other chord passes through the triangle of it and its neighbours.
The ends stay where they are, so a line without a knot becomes one chord (K. Koniaris and M. Muthukumar, 1991).
"""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.state import Floats

# Directions in which crossings are counted; how often what is left is drawn straight anew; fewest crossings of a knot.
DIRECTIONS, ROUNDS, FEWEST = 500, 5, 3
# Part of a chord or triangle by which one that passes beside it counts as passing through.
BESIDE = 1e-9
AWAY = 100.0  # times as far from the middle as they are, to which the ends are led
FLAT = 1e-20  # sine squared of the turn at a corner that is straight already


def _passes(a: Floats, b: Floats, c: Floats, starts: Floats, ends: Floats) -> bool:
    """Whether one of the chords from starts (n, 3) to ends (n, 3) passes through the triangle a, b, c."""
    one, two = b - a, c - a
    normal = np.cross(one, two)
    if not normal @ normal > (FLAT * (one @ one) * (two @ two)):
        return False
    ways = ends - starts
    size = -(ways @ normal)
    crosses = np.abs(size) > 0.0
    off, ways, size = starts[crosses] - a, ways[crosses], size[crosses]
    q = np.cross(off, one)
    u, v = (off * np.cross(ways, two)).sum(axis=1) / size, (ways * q).sum(axis=1) / size
    along = (q @ two) / size
    inside = (u > -BESIDE) & (v > -BESIDE) & (u + v < 1.0 + BESIDE) & (along > -BESIDE) & (along < 1.0 + BESIDE)
    return bool(inside.any())


def _is_held(r: Floats, i: int) -> bool:
    """Whether a chord passes through the triangle of corner i and its neighbours."""
    starts, ends, (a, b, c) = r[:-1], r[1:], r[i - 1 : i + 2]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    near = ((np.minimum(starts, ends) <= high) & (np.maximum(starts, ends) >= low)).all(axis=1)
    near[max(i - 2, 0) : i + 2] = False  # those before and after touch the triangle at its corners only
    return bool(near.any()) and _passes(a, b, c, starts[near], ends[near])


def drawn_straight(r: Floats) -> Floats:
    """The corners (m, 3) that are left of a polyline r (n, 3), m; two of a line without a knot."""
    left = np.asarray(r, float)
    before = len(left) + 1
    while len(left) < before and len(left) > 2:
        before, i = len(left), 1
        while i < len(left) - 1:
            if _is_held(left, i):
                i += 1
            else:
                left = np.delete(left, i, axis=0)
    return left


def _rounded(r: Floats) -> Floats:
    """A polyline r (n, 3) whose corners are cut off between the middles of their chords, where nothing holds them."""
    left = np.empty((2 * len(r) - 1, 3))
    left[::2], left[1::2] = r, 0.5 * (r[1:] + r[:-1])
    i = 2
    while i < len(left) - 1:
        if _is_held(left, i):
            i += 2
        else:
            left, i = np.delete(left, i, axis=0), i + 1
    return left


def crossings(r: Floats) -> int:
    """How often a polyline r (n, 3) crosses itself, as seen from where it does so least."""
    k = np.arange(DIRECTIONS) + 0.5
    z, turn = 1.0 - k / DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * k  # half of a sphere, evenly
    towards = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])
    side = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards), axis=1)])
    x, y = r @ side.T, r @ np.cross(towards, side).T  # (n, directions)
    dx, dy = np.diff(x, axis=0), np.diff(y, axis=0)
    i, j = np.triu_indices(len(dx), 2)
    off_x, off_y = x[j] - x[i], y[j] - y[i]
    size = dx[i] * dy[j] - dy[i] * dx[j]
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (off_x * dy[j] - off_y * dx[j]) / size, (off_x * dy[i] - off_y * dx[i]) / size
    return int(((u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)).sum(axis=0).min())


def _led_away(r: Floats) -> Floats:
    """A line of nodes r (n, 3) m whose ends go straight on, away from its middle, so that none is within the knot."""
    ends = r[[0, -1]]
    out = ends + AWAY * (ends - r.mean(axis=0))
    return np.concatenate([out[:1], r, out[1:]])


def crossings_of_knot(r: Floats) -> int:
    """Crossings of the knot in a line of nodes r (n, 3) m; 0: there is none.

    They are those where the knot is drawn straight so that it shows fewest of what was tried: never less than it has.
    """
    left = drawn_straight(_led_away(r))
    if len(left) <= FEWEST:
        return 0
    found = crossings(left)
    for _ in range(ROUNDS):
        left = drawn_straight(_rounded(left))
        found = min(found, crossings(left))
    return found if found >= FEWEST else 0


def core_of_knot(r: Floats) -> tuple[int, int]:
    """First and last node of the shortest part of a line of nodes r (n, 3) m that still has its knot."""

    def knotted(a: int, b: int) -> bool:
        return len(drawn_straight(r[a : b + 1])) > FEWEST

    first, last = 0, len(r) - 1
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if knotted(middle, last) else (low, middle)
    first, low, high = low, low, last
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if knotted(first, middle) else (middle, high)
    return first, high
