"""Where a result is at its worst: lowest and highest values, and how near it came to the limits of its sections.

Of the envelope, which knows every accepted step and every node; of the outputs where a file has none, as of 0.6.  An
envelope is of the line that was computed: where results are corrected for bending that is neglected, outputs count too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.errors import LIMIT_EVENTS
from hybrid.store.envelope import GROUP, SCALE, Judged, extreme, has_envelope, judged
from hybrid.store.reader import Result
from hybrid.view.along import along


class Worst(NamedTuple):
    """A value at s (m) and t (s), and the output and place of `along` nearest to it.

    side: -1 or 1, on the left or on the right of a place with two values, else 0.
    """

    value: float
    s: float
    t: float
    output: int
    place: int
    side: int


def worst(result: Result, name: str, lowest: bool = False) -> Worst:
    """The highest value of a quantity over time and the line, or the lowest one."""
    bound, better = ("min", np.less) if lowest else ("max", np.greater)
    found = [x for values in _sources(result, name) if (x := extreme(values, name, bound)) is not None]
    best = found[0]
    for other in found[1:]:
        best = other if better(other.value, best.value) else best
    output = int(np.abs(result.times - best.t).argmin())
    s = along(result, name).s
    near = np.flatnonzero(np.abs(s - best.s) == np.abs(s - best.s).min())
    return Worst(best.value, best.s, best.t, output, int(near[-1 if best.side > 0 else 0]), best.side)


def is_without_moment(result: Result) -> bool:
    """Whether no output has a rod and no step a bending moment: catenaries have none, and 0 is not that of the line."""
    found = extreme(result, "bending_moment", "max")
    rods = any(zone.kind != "catenary" for zones in result.zones for zone in zones)
    return found is not None and found.value == 0.0 and not rods


def limits_of(result: Result) -> list[Judged]:
    """Every limit that the sections have, where it was broken most or nearly."""
    found: dict[str, Judged] = {}
    names = {"curvature": ("min_bend_radius",), "tension": ("max_tension", "min_tension")}
    for name, limits in names.items():
        for values in _sources(result, name) if name in result else ():
            for x in judged(values):
                known = found.get(x.limit)
                if x.limit in limits and (known is None or x.margin < known.margin):
                    found[x.limit] = x
    return [found[limit] for limit in LIMIT_EVENTS if limit in found]


def _sources(result: Result, name: str) -> list[dict[str, np.ndarray]]:
    """Extremes of a quantity as an envelope has them: of the envelope, of the outputs, or of both."""
    sources = []
    if has_envelope(result) and f"{GROUP}/{name}_max" in result:
        keys = [SCALE, *(f"{GROUP}/{x}" for x in (*LIMIT_EVENTS, *_columns(name)))]
        sources.append({key: result[key] for key in keys if key in result})
    if not sources or any(zone.kind == "corrected" for zone in result.zones[-1]):
        found, t = along(result, name), result.times
        values = {SCALE: found.s}
        for x in ("min", "max"):
            at = found.values.argmin(axis=0) if x == "min" else found.values.argmax(axis=0)
            values |= {f"{GROUP}/{name}_{x}": found.values[at, np.arange(at.size)], f"{GROUP}/{name}_t_{x}": t[at]}
        limits = {f"{GROUP}/{x}": allowed for x in LIMIT_EVENTS if (allowed := found.of(result, x)) is not None}
        sources.append(values | limits)
    return sources


def _columns(name: str) -> list[str]:
    return [f"{name}_{x}" for x in ("min", "max", "t_min", "t_max")]
