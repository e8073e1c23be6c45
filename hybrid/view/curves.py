"""Curves along the cable and over time, as a page keeps them.

Quantities have both values where they jump, and curves a gap there.  Of a long run frames, points and curves are chosen
so that no peak is lost from a curve.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hybrid.store.capacity import pop_out
from hybrid.store.envelope import GROUP, SCALE, extreme, farthest, has_envelope
from hybrid.store.reader import Result
from hybrid.store.verdicts import quantity_limits, section_limits

AXES = ("x", "y", "z")


class Along(NamedTuple):
    """Arc lengths s (n,), m, and values (nt, n) there; a jump comes twice, the left value first.

    points (n,): which output point each of them is.
    """

    s: np.ndarray
    values: np.ndarray
    points: np.ndarray

    def curve(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """s and y (..., n) of a curve, with a gap in y at jumps."""
        at = np.flatnonzero(np.diff(self.s) == 0.0) + 1
        return np.insert(self.s, at, self.s[at]), np.insert(np.asarray(y, float), at, np.nan, axis=-1)

    def of(self, result: Result, name: str) -> np.ndarray | None:
        """What else the file has of every output point, (..., ns), here; None if it does not have it."""
        if name not in result:
            return None
        found = result.both_sides(name)[1]
        return found if found.shape[-1] == len(self.s) else found[..., self.points]


def extent(result: Result, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
    """Arc lengths (n,), lowest and highest value there with a gap at jumps, and of what: every step, or every output.

    Every accepted step, and outputs between nodes that go beyond it, where the file has its envelope, except where
    zones are corrected for bending, as in results of 0.6: an envelope is of the line that was computed.
    """
    found = along(result, name)
    low, high = found.values.min(axis=0), found.values.max(axis=0)
    corrected = any(zone.kind == "corrected" for zone in result.zones[-1])
    if has_envelope(result) and not corrected and f"{GROUP}/{name}_max" in result:
        bounds = [result[f"{GROUP}/{name}_{x}"] for x in ("min", "max")]
        if all(np.isfinite(x).all() for x in bounds):
            steps = found._replace(s=result[SCALE])
            steps, low, high = _widened(steps, bounds[0], bounds[1], found, low, high)
            (s, low), (_, high) = (steps.curve(x) for x in (low, high))
            return s, low, high, "every step"
    (s, low), (_, high) = (found.curve(x) for x in (low, high))
    return s, low, high, "every output"


def _widened(
    steps: Along, low: np.ndarray, high: np.ndarray, outputs: Along, lowest: np.ndarray, highest: np.ndarray
) -> tuple[Along, np.ndarray, np.ndarray]:
    """Places of an envelope and its bounds there, with those of outputs between nodes that lie beyond them."""
    near = 1e-9 * float(np.ptp(steps.s))

    def apart(s: np.ndarray) -> np.ndarray:
        """Places that come twice, on their sides."""
        twice, out = np.flatnonzero(np.diff(s) == 0.0), s.copy()
        out[twice] -= near
        out[twice + 1] += near
        return out

    a, b = apart(steps.s), apart(outputs.s)
    low, high = low.copy(), high.copy()
    nearest = np.abs(a - b[:, None]).argmin(axis=1)
    same = np.abs(a[nearest] - b) < 1.5 * near  # at a node there is no other place
    np.minimum.at(low, nearest[same], lowest[same])
    np.maximum.at(high, nearest[same], highest[same])
    more = ~same & ((lowest < np.interp(b, a, low)) | (highest > np.interp(b, a, high)))
    order = np.argsort(np.concatenate([a, b[more]]), kind="stable")
    s, low, high = (
        np.concatenate([x, y[more]])[order] for x, y in ((steps.s, outputs.s), (low, lowest), (high, highest))
    )
    return steps._replace(s=s), low, high


def along(result: Result, name: str) -> Along:
    """A quantity along the cable; of a vector its magnitude, and x, y, z of the position."""
    if name in AXES:
        s, values = result.s, np.asarray(result.position[..., AXES.index(name)])
    else:
        s, values = result.both_sides(name)
        values = np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values
    return Along(s, values, np.searchsorted(result.s, s))


# The loop that the torque of a result would trap.

# Of the largest torque: places with so much of it are judged, for a torque is nearly the same along a cable.
NEARLY = 0.99


def trapped_loop(result: Result, found: Along, torque: np.ndarray) -> dict[str, float] | None:
    """The loop that the largest torque (nt, n) N m would trap, as it pops out.

    Tension (N), bend radius (m), and that over the one allowed, where it is smallest.  None: no diameter is known, or
    no loop is trapped.
    """
    diameter, stiffness = found.of(result, "diameter"), found.of(result, "bending_stiffness")
    if diameter is None or stiffness is None:
        return None
    limit = found.of(result, "min_bend_radius")
    allowed = np.full(diameter.shape, np.nan) if limit is None else limit
    most = np.abs(torque).max(axis=0)
    best: dict[str, float] | None = None
    for k in np.flatnonzero((most >= NEARLY * most.max()) & (diameter > 0.0)):
        loop = pop_out(float(most[k]), float(stiffness[k]), float(diameter[k]))
        if loop is None:
            continue
        margin = loop.radius / float(allowed[k])
        if best is None or margin < best.get("kink_margin", np.inf):
            best = {"pop_out_tension": loop.tension, "pop_out_radius": loop.radius}
            if np.isfinite(margin):
                best["kink_margin"] = margin
    return best


def held_loop(result: Result, found: Along, torque: np.ndarray, tension: np.ndarray) -> dict[str, float] | None:
    """Of the outputs (nt,) at which the line touches itself, that at which a loop is nearest to being pulled open.

    torque, tension: (nt, n) N m, N.  Returns its time (s), and over the largest tension there, the tension at which a
    loop of the torque of that output pops out; None: no contact is computed or found, or no loop is trapped.
    """
    diameter, stiffness = found.of(result, "diameter"), found.of(result, "bending_stiffness")
    if diameter is None or stiffness is None or "energy/self_contact" not in result:
        return None
    best: dict[str, float] | None = None
    for k in np.flatnonzero(np.asarray(result["energy/self_contact"]) > 0.0):
        i = int(np.abs(torque[k]).argmax())
        loop = pop_out(float(torque[k, i]), float(stiffness[i]), float(diameter[i])) if diameter[i] > 0.0 else None
        most = float(tension[k].max())
        if loop is None or not most > 0.0:
            continue
        margin = loop.tension / most
        if best is None or margin < best["pop_out_margin"]:
            best = {"pop_out_margin": margin, "pop_out_time": float(result.times[k])}
    return best


# Where a result is at its worst: lowest and highest values, and how near it came to the limits of its sections.
#
# Of the envelope, which knows every accepted step and every node, and of the outputs, which know what is between nodes;
# of the outputs alone where a file has no envelope, as of 0.6.


class Worst(NamedTuple):
    """A value at s (m) and t (s), and the output and place of `along` nearest to it.

    side: -1 or 1, on the left or on the right of a place with two values, else 0; over: as of `Extreme`.
    """

    value: float
    s: float
    t: float
    output: int
    place: int
    side: int
    over: tuple[float, float] | None = None


def worst(result: Result, name: str, lowest: bool = False) -> Worst:
    """The highest value of a quantity over time and the line, or the lowest one."""
    best = farthest(result, name, "min" if lowest else "max")
    assert best is not None, f"the result has no {name}"
    output = int(np.abs(result.times - best.t).argmin())
    s = along(result, name).s
    near = np.flatnonzero(np.abs(s - best.s) == np.abs(s - best.s).min())
    return Worst(best.value, best.s, best.t, output, int(near[-1 if best.side > 0 else 0]), best.side, best.over)


def is_without_moment(result: Result) -> bool:
    """Whether no output has a rod and no step a bending moment: catenaries have none, and 0 is not that of the line."""
    found = extreme(result, "bending_moment", "max")
    rods = any(zone.kind != "catenary" for zones in result.zones for zone in zones)
    return found is not None and found.value == 0.0 and not rods


def worst_first(result: Result) -> list[str]:
    """Names of lines: broken limits first, then by the part of a limit that is used, then by the largest tension."""

    def rank(name: str) -> tuple[bool, float, float]:
        line = result.lines[name]
        sections, held = section_limits(line), quantity_limits(line)
        parts = [x.used or 0.0 for x in sections]
        parts += [x.value / x.allowed for x in held if x.limit != "smallest" and x.allowed > 0.0]
        broken = any(x.broken for x in sections) or any(x.broken for x in held)
        most = extreme(line, "tension", "max")
        largest = most.value if most is not None else float(np.max(line.tension, initial=0.0))
        return broken, float(np.nanmax([0.0, *parts])), largest

    return sorted(result.lines, key=rank, reverse=True)


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
