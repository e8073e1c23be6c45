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
from hybrid.simulation.knots import core_of_knot, crossings_of_knot
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
