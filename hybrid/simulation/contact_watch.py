"""Events of outputs where a knot of a line tightens, and where a line leaves a sheave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hybrid.kernels.laws.obstacles import distances
from hybrid.kernels.state.obstacle_rows import (
    AXIS,
    GROOVE,
    INERTIA,
    KIND,
    PLACE,
    RATE,
    RIM,
    RING,
    SHEAVE,
    STRAND,
)
from hybrid.kernels.state.state import Floats, Sea
from hybrid.solve.flaws import TOUCHING

# The part of its length to which a knot has been drawn together when it is said again; points looked at in a cell.
TIGHTER, POINTS = 0.5, 8


class Knot(NamedTuple):
    """What is known of the knot of a line.

    length: m, of the part that has it, or that touches itself without a knot, NaN: never looked at; crossings: 0: none;
    below: m, between the first and the last node that touch, under which it is looked at again.
    """

    length: float = np.nan
    crossings: float = 0.0
    below: float = np.nan


def note_knot(t: float, s: Floats, r: Floats, touch: Floats, known: Knot, event: Callable[..., None]) -> Knot:
    """Write an event where the knot of a line is drawn together to half of what it was; what is known then.

    t: s, of an output; s (N+1,) m, r (N+1, 3) m, touch (N+1,) N/m, the force of the line on itself: of its nodes;
    event: as EventLog.event.  A line is looked at where what touches is another part of it than before.
    """
    pressed = np.flatnonzero(touch > 0.0)
    if pressed.size < 2:
        return known
    span = float(s[pressed[-1]] - s[pressed[0]])
    same = TIGHTER * known.length < span < known.length / TIGHTER
    if not span < known.below if known.crossings else same:
        return known
    count = crossings_of_knot(r)
    if not count:
        return Knot(span, 0.0, np.nan)
    first, last = core_of_knot(r)
    length = float(s[last] - s[first])
    if not known.crossings:
        return Knot(length, float(count), TIGHTER * length)
    if not length < TIGHTER * known.length:
        return known._replace(below=TIGHTER * span)
    text = (
        f"the knot between s = {s[first]:.4g} m and s = {s[last]:.4g} m, of {count} crossings where it shows fewest, "
        f"has been drawn together to {length:.3g} m of line from {known.length:.3g} m"
    )
    event(t, float(s[first]), float(s[last]), "knot tightens", text, value=length, threshold=TIGHTER * known.length)
    return Knot(length, float(count), TIGHTER * length)


def sheaves_of(sea: Sea) -> list[int]:
    """Numbers of the obstacles that a line is said to leave: sheaves, and what turns."""
    turns = sea.carried[:, [RATE, INERTIA]].any(axis=1) if sea.carried.size else np.zeros(len(sea.obstacles), bool)
    return [int(k) for k in np.flatnonzero((sea.obstacles[:, KIND] == SHEAVE) | turns)]


def note_departures(
    t: float, s: Floats, r: Floats, sea: Sea, names: Sequence[str], lay: Floats, event: Callable[..., None]
) -> Floats:
    """Write an event for every sheave that a line has lain on and is off; when and where it lies on each then.

    t: s, of an output; s (N+1,) m, r (N+1, 3) m: of the nodes; sea: with the obstacles where they are; names: of all of
    them; lay: (n, 2) when (s) and at which arc length (m) the line lay on each of `sheaves_of` last, NaN: it is off.

    On a sheave is a line that touches it between its rims, and off it one of which nothing is between them any more;
    on a roller that turns one that touches it, and off one that is a diameter away.
    """
    x = np.linspace(0.0, 1.0, POINTS, endpoint=False)[:, None]
    at = np.append(((1.0 - x) * s[:-1] + x * s[1:]).T.ravel(), s[-1])
    x = x[:, :, None]
    points = np.append(((1.0 - x) * r[:-1] + x * r[1:]).transpose(1, 0, 2).reshape(-1, 3), r[-1:], axis=0)
    gaps, lay = distances(sea, points), lay.copy()
    for n, k in enumerate(sheaves_of(sea)):
        row, gap = sea.obstacles[k], gaps[k]
        strand, off = row[STRAND], points - row[PLACE : PLACE + 3]
        along = off @ row[AXIS : AXIS + 3]
        near, way = gap < 2.0 * strand, "a diameter or more away"
        if row[KIND] == SHEAVE:
            out = np.sqrt(np.maximum((off * off).sum(axis=1) - along * along, 0.0))
            half, rim = row[GROOVE] + row[RIM], row[RIM] - strand
            near = (np.abs(along) < half) & (out < row[RING] + rim)
            beside = abs(along[gap.argmin()]) > half
            way = "beside its rims" if beside else "farther out than its rims"
        lies = near & (gap < TOUCHING * strand)
        if lies.any():
            lay[n] = t, at[lies].mean()
        elif not near.any() and np.isfinite(lay[n, 0]):
            where = float(at[gap.argmin()])
            text = (
                f"the line leaves {names[k]}, on which it lay last at t = {lay[n, 0]:.4g} s, at s = {lay[n, 1]:.4g} m: "
                f"what is nearest now, s = {where:.4g} m, is {way}"
            )
            event(t, where, where, "line leaves the sheave", text, value=float(gap.min()))
            lay[n] = np.nan
    return lay


# Knots of a line: what is left of it when every bend is drawn straight that nothing holds, and its crossings.
#
# A corner of a polyline may be drawn straight where no other chord passes through the triangle of it and its
# neighbours.
# The ends stay where they are, so a line without a knot becomes one chord (K. Koniaris and M. Muthukumar, 1991).

DIRECTIONS = 500  # in which crossings are counted
ROUNDS = 5  # how often what is left is drawn straight anew
FEWEST = 3  # crossings of a knot
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
