"""The first shape of a search for equilibrium: an elastic catenary under any dead loads, as a convex problem.

Without bending, the force in a cell follows from the force F at the start of the line and the loads f_i in
between, t_c = F - f_1 - ... - f_c, and the span from all t_c.  The F that gives the right span minimises

    sum of h_c (|t_c| + ck |t_c|^2 / 2)  -  F . span,

the complementary energy, which is convex: Newton's method with a line search finds it from anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hybrid.kernels.laws.closed_forms import find_force
from hybrid.kernels.state.state import Floats

# |t| is rounded off at this part of the largest load, so that a folded or slack line has a minimum too.
ROUNDED = 1e-4
# An inextensible cell is lent this strain at the largest load.
LENT = 1e-4
MOST_ITERATIONS = 100
# Chords shorter than this part of their cells: the loads do not tauten the line, and the shape means nothing.
SLACK = 0.5
# Rounds of finding out how much of a line lies on the seabed: each changes it by a cell or none, but the first.
LAYING = 20
# Where the numbers of a symmetric matrix stand of which six are given.
SYMMETRIC = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
# A slight pull along x where nothing pulls level, as a part of all loads.
SLIGHT = 1e-3
# Bisections of the lift of a floating body: to 1e-9 of it.
FLOATING = 30


class Hanging(NamedTuple):
    """Nodes (N+1, 3) m, tensions (N,) N."""

    r: Floats
    T: Floats


class Pulls(NamedTuple):
    """What a hanging line pulls its ends with."""

    t: Floats  # (N, 3) N, force in the cells, along increasing s
    e: Floats  # (N, 3) m, chords
    stiffness: Floats  # (3, 3) N/m, of t[0] against the span


def hang(loads: Floats, h: Floats, ck: Floats, start: Floats, span: Floats) -> Hanging | None:
    """The shape of a line from `start` over `span` (3,) m under loads (N+1, 3) N; None when it stays slack."""
    found = pulls(loads, h, ck, span)
    if found is None or float((np.linalg.norm(found.e, axis=1) / h).min()) < SLACK:
        return None
    r = start + np.concatenate([np.zeros((1, 3)), np.cumsum(found.e, axis=0)])
    r[-1] = start + span
    return Hanging(r, np.linalg.norm(found.t, axis=1))


def pulls(loads: Floats, h: Floats, ck: Floats, span: Floats) -> Pulls | None:
    """Forces and chords of a line over `span` (3,) m, slack or not, under loads (N+1, 3) N; None without any load."""
    scale = float(np.abs(loads[1:-1].sum(axis=0)).max() + np.linalg.norm(loads[1:-1], axis=1).sum())
    if not scale > 0.0:
        return None
    eps, soft = ROUNDED * scale, np.maximum(ck, LENT / scale)
    below = np.concatenate([np.zeros((1, 3)), np.cumsum(loads[1:-1], axis=0)])

    places, inverse = np.zeros((2, 3)), np.zeros(6)
    places[0], places[1] = span, 0.5 * below[-1] + 0.1 * scale * span / max(float(np.linalg.norm(span)), 1e-12)
    find_force(below, h, soft, places, eps, MOST_ITERATIONS, inverse)
    t = places[1] - below
    e = (h * (1.0 / np.sqrt(np.einsum("ij,ij->i", t, t) + eps**2) + soft))[:, None] * t
    return Pulls(t, e, inverse[SYMMETRIC])


def trail(loads: Floats, h: Floats, ck: Floats, held: int, place: Floats, on_bed: bool = False) -> Hanging | None:
    """The shape of a line held at one end (0 or 1) at `place` (3,) and free at the other; None when it is slack.

    on_bed: the held end lies on a level seabed, which carries the line as far as nothing lifts it.
    """
    # what hangs beyond a cell pulls it
    t = np.cumsum(loads[::-1], axis=0)[::-1][1:] if held == 0 else -np.cumsum(loads, axis=0)[:-1]
    if on_bed:
        away = 1.0 if held == 0 else -1.0
        t[:, 2] = away * np.maximum(away * t[:, 2], 0.0)
    size = np.linalg.norm(t, axis=1)
    if not size.max() > 0.0 or size.min() < 1e-9 * size.max():
        return None
    e = (h * (1.0 / size + ck))[:, None] * t
    r = np.concatenate([np.zeros((1, 3)), np.cumsum(e, axis=0)])
    return Hanging(r + place - r[0 if held == 0 else -1], size)


def laid(
    loads: Floats, h: Floats, ck: Floats, held: int, place: Floats, bed: Callable[[Floats, Floats], Floats]
) -> Hanging | None:
    """As `trail` for a line that is held above the seabed and long enough to lie on it with its free end.

    bed: heights (n,) m of the seabed at x, y (n,) m.  What lies on the bed goes on the way the line came down, without
    tension.
    """
    away = slice(None, None, 1 if held == 0 else -1)  # nodes and cells from the held end on
    lying = np.zeros(h.size + 1, bool)
    shape = None
    for _ in range(LAYING):
        found = trail(np.where(lying[:, None], 0.0, loads), h, ck, held, place) if not lying.all() else None
        if found is None:
            if shape is None:
                return None
            found = shape
        shape, now = found, np.zeros_like(lying)
        r = found.r[away].copy()
        down = np.flatnonzero(r[1:, 2] <= bed(r[1:, 0], r[1:, 1]))
        if down.size:
            first = int(down[0]) + 1
            r[first + 1 :, :2] = r[first, :2] + np.cumsum(h[away][first:])[:, None] * _heading(r[: first + 1], h[away])
            r[first:, 2] = bed(r[first:, 0], r[first:, 1])
            T = found.T[away].copy()
            T[first:], now[away][first:] = 0.0, True
            shape = Hanging(r[away], T[away])
        if (now == lying).all():
            break
        lying = now
    return shape


def _heading(r: Floats, h: Floats) -> Floats:
    """Direction (2,) along the ground of the last chord between nodes r (n, 3) m that has one; cells h (>= n-1,) m."""
    steps = np.diff(r[:, :2], axis=0)
    level = np.hypot(steps[:, 0], steps[:, 1])
    some = np.flatnonzero(level > 1e-6 * h[: level.size])
    return steps[some[-1]] / level[some[-1]] if some.size else np.array([1.0, 0.0])


def moored(
    loads: Floats, lift: float, surface: float, h: Floats, ck: Floats, held: int, place: Floats, on_bed: bool
) -> Hanging | None:
    """As `trail`, with a body at the free end that floats at `surface` (m) on as much of its `lift` (N) as it needs."""
    free = -1 if held == 0 else 0
    low, high, best = 0.0, 1.0, None
    if not np.abs(loads[:, :2]).max() > 0.0:  # still water: any heading will do, so that what lies on the bed has one
        loads = loads + (SLIGHT * float(np.abs(loads).sum()) / loads.shape[0]) * np.array([1.0, 0.0, 0.0])
    for _ in range(FLOATING):
        part = 1.0 if best is None else 0.5 * (low + high)
        lifted = loads.copy()
        lifted[free, 2] += part * lift
        shape = trail(lifted, h, ck, held, place, on_bed)
        if shape is None:
            return best
        best = shape
        if shape.r[free, 2] <= surface:
            if part == 1.0:
                break  # it sinks, or hangs too low to reach the surface
            low = part
        else:
            high = part
    return best
