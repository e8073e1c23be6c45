"""Statistics of a history (outputs, places): an extreme is the largest of its peaks, each with when and where it is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.state import Floats

# Part of an extreme within which other peaks stand beside it, and so many at most.
BESIDE, MOST = 0.1, 12


def over_time(history: Floats, over: str, where: Any) -> tuple[float, Any]:
    """The statistic of a history, and when and where an extreme is; where: None: not known yet."""
    if over in ("max", "min"):
        if where is None:
            flat = np.nanargmax(history) if over == "max" else np.nanargmin(history)
            where = np.unravel_index(int(flat), history.shape)
        return float(history[where]), where
    x = history[:, 0]
    return float({"mean": x.mean(), "std": x.std(), "last": x[-1]}[over]), None


def peaks(history: Floats, over: str, where: Any) -> list[Any]:
    """When and where peaks are that stand beside an extreme, from the largest on, behind the extreme itself.

    They are the largest of each place over time, as the place of an extreme goes along a line, and of each peak over
    time and place.
    """
    if over not in ("max", "min"):
        return [where]
    high = np.pad(np.nan_to_num(history if over == "max" else -history, nan=-np.inf), 1, constant_values=-np.inf)
    inside, (n, m) = high[1:-1, 1:-1], history.shape
    peak = np.isfinite(inside)
    for i, k in np.argwhere(np.ones((3, 3))) - 1:
        if (i, k) != (0, 0):  # of equal neighbours the first
            beside = high[1 + i : 1 + i + n, 1 + k : 1 + k + m]
            peak &= (inside > beside) if (i, k) < (0, 0) else (inside >= beside)
    peak[np.argmax(inside, axis=0), np.arange(m)] = True
    top = inside[where]
    near = [(int(i), int(k)) for i, k in np.argwhere(peak & (inside >= top - BESIDE * abs(top)))]
    near.sort(key=lambda x: -float(inside[x]))
    first = (int(where[0]), int(where[1]))
    return [first, *[x for x in near if x != first][: MOST - 1]]


def smoothed(history: Floats, over: str, cut: NDArray[np.bool_]) -> Floats:
    """Of every output and place the extreme of parabolas through it and its neighbours in time and place, but for

    these places (places,), where a value may be two.

    Outputs and places count as evenly spaced there.  The largest of all changes evenly, as an extreme goes from one to
    the next: between two it is that of either parabola.
    """
    side, out = 1.0 if over == "max" else -1.0, history.copy()
    for axis in (0, 1):
        x, table = np.moveaxis(history, axis, 0), np.moveaxis(out, axis, 0)
        if x.shape[0] < 3:
            continue
        before, here, after = x[:-2], x[1:-1], x[2:]
        bent = after - 2.0 * here + before
        hill = (side * bent < 0.0) & (np.abs(after - before) < 2.0 * np.abs(bent))  # it is between the neighbours
        if axis == 1:
            hill &= ~(cut[:-2] | cut[1:-1] | cut[2:])[:, None]
        table[1:-1][hill] -= (after - before)[hill] ** 2 / (8.0 * bent[hill])
    return out
