"""What a page keeps of a long run: frames, points and curves, chosen so that no peak is lost from a curve."""

from __future__ import annotations

import json
from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hybrid.store.reader import Result

# A screen is some 1000 pixels wide and a play of the motion lasts seconds: more frames, points or places on a curve
# are not visible.  Frames times points: a page has up to ten such arrays of 4 bytes, and is to stay below 8 MB.
MOST_FRAMES = 1000
MOST_POINTS = 251
MOST_VALUES = 80_000  # frames times points
MOST_ON_CURVE = 1200
# On paper a panel is two to four inches wide: a curve that turns more than so often in each of so many stretches is a
# block of ink.
STRETCHES = 150
TURNS = 4


class Kept(NamedTuple):
    """Which outputs and which grid points a page shows, of all."""

    frames: np.ndarray
    points: np.ndarray
    outputs: int
    grid: int

    @property
    def notice(self) -> str:
        """What was left out, in a sentence; empty where all is shown."""
        parts = [f"{len(self.frames)} of {self.outputs} outputs"] * (len(self.frames) < self.outputs)
        parts += [f"{len(self.points)} of {self.grid} points along the cable"] * (len(self.points) < self.grid)
        if not parts:
            return ""
        return (
            f"To keep this file small, moving pictures show {' and '.join(parts)}. The summary, the range graphs and "
            "the extremes of histories are those of all of them."
        )


def kept(result: Result, moments: Iterable[float | None] = ()) -> Kept:
    """Frames and points to show, even over the run, with the outputs at the given moments (s) and jumps among them."""
    nt, ns = len(result.times), len(result.s)
    jumps = np.searchsorted(result.s, result["right/s"]) if "right/s" in result else np.zeros(0, int)
    points = np.union1d(even(ns, MOST_POINTS), jumps[even(len(jumps), MOST_POINTS)])
    frames = even(nt, min(MOST_FRAMES, max(2, MOST_VALUES // len(points))))
    asked = [int(np.abs(result.times - t).argmin()) for t in moments if t is not None and nt]
    return Kept(np.unique([*frames, *asked]).astype(int), points, nt, ns)


def even(n: int, most: int) -> np.ndarray:
    """Indices of at most so many of n, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int)) if n else np.zeros(0, int)


def outline(values: np.ndarray, most: int = MOST_ON_CURVE) -> np.ndarray:
    """Indices of a curve (n,) that keep its ends and gaps and, of every short stretch, its lowest and highest value."""
    n, known = len(values), np.isfinite(values)
    if n <= most:
        return np.arange(n)
    low, high = np.where(known, values, np.inf), np.where(known, values, -np.inf)
    bounds = np.linspace(0, n, most // 2 + 1).astype(int)
    found = [a + x for a, b in pairwise(bounds) for x in (low[a:b].argmin(), high[a:b].argmax())]
    gaps = np.flatnonzero(np.diff(known))
    return np.unique([0, *found, *gaps, *(gaps + 1), n - 1])


class Stretches(NamedTuple):
    """A curve that swings too often to be seen: its middle times, and of each stretch the range and the mean."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    mean: np.ndarray


def stretches_of(x: np.ndarray, y: np.ndarray) -> Stretches | None:
    """A history of hours in STRETCHES of one length; None: a picture on paper shows its swings one by one."""
    if len(x) < 4 * STRETCHES or not np.isfinite(y).all() or not (np.diff(x) > 0.0).all():
        return None
    turns = int((np.diff(np.sign(np.diff(y))) != 0.0).sum())
    if turns < TURNS * STRETCHES:
        return None
    bounds = np.linspace(0, len(x), STRETCHES + 1).astype(int)
    rows = [(x[a:b].mean(), y[a:b].min(), y[a:b].max(), y[a:b].mean()) for a, b in pairwise(bounds)]
    return Stretches(*np.array(rows).T)


class Store:
    """Arrays of a page: one block of bytes, and for figures a reference in place of each array."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def add(self, array: Any, kind: str = "f4") -> dict[str, Any]:
        """A reference to the array: where it begins, its type and its shape."""
        data = np.ascontiguousarray(array, dtype=f"<{kind}")
        at = len(self._bytes)
        self._bytes += data.tobytes() + b"\0" * (-data.nbytes % 4)  # typed arrays begin at multiples of their size
        return {"$at": at, "type": kind, "shape": list(data.shape)}

    @property
    def block(self) -> bytes:
        return bytes(self._bytes)


def script_json(data: Any) -> str:
    """JSON that may stand inside a script element: no text in it can end the element, or begin a comment."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
