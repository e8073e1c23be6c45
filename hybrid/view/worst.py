"""Where a result is at its worst: lowest and highest values, and how near it came to the limits of its sections.

Of the envelope, which knows every accepted step and every node, and of the outputs, which know what is between nodes;
of the outputs alone where a file has no envelope, as of 0.6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.store.envelope import extreme, farthest
from hybrid.store.reader import Result
from hybrid.store.verdicts import quantity_limits, section_limits
from hybrid.view.along import along


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
