"""Results that derivatives are asked of: how they are named, and statistics of their histories (outputs, places).

At rest `tension@end`, `max curvature`; in motion `last tension@end`, `t=12.5 tension@100`; of lines with names
`east/tension@end`, `max hose/curvature`.  An extreme over time is the largest of its peaks, each with when and where it
is.
"""

from __future__ import annotations

import math
import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.root import Scene

NAME = re.compile(r"^(?:(max|min|mean|std|last|t=\S+) )?(?:([^/@]+)/)?([a-z_]\w*)(?:\.([xyz]))?(?:@(.+))?$")
OF_SECTION = re.compile(r"^sections\[(\d+)\]$")
AXES = "xyz"
# Part of an extreme within which other peaks stand beside it, and so many at most.
BESIDE, MOST = 0.1, 12


class Wanted(NamedTuple):
    """A result in parts.

    over: at rest `max` or `min` along the line or "", in motion `max`, `min`, `mean`, `std`, `last` or `t` over time;
    line: "" of the one without a name; axis: its component or ""; at: m, infinity: the end, wherever that is, None: no
    place, or all of them, or those of a section; time: s, at which it is wanted (over: "t"), between outputs by the
    straight line.
    """

    over: str
    line: str
    name: str
    axis: str
    at: float | None
    section: int | None = None
    time: float = math.nan

    @property
    def place(self) -> Wanted:
        """Whose history it is of."""
        return self._replace(over="", time=0.0)

    def component(self, value: Floats) -> Floats:
        """The component of a vector that is wanted, or its size; what is no vector itself."""
        if self.name not in PROBES or PROBES[self.name].dims[-1:] != ("xyz",):
            return value
        return np.asarray(value[..., AXES.index(self.axis)] if self.axis else np.linalg.norm(value, axis=-1))


def of_line(name: str) -> str:
    """What results of a line begin with; nothing for a line without a name."""
    return f"{name}/" if name else ""


def parse_wanted(asked: Scene, text: str, moves: bool) -> Wanted:
    """The parts of a result, of a run (moves) or of its equilibrium.  SceneError: it is none."""
    found, first = NAME.match(text), next(iter(asked.asked_lines))
    over, line, name, axis, at = found.groups() if found is not None else ("", "", "", "", "")
    known = bool(over) if moves else over in (None, "max", "min")
    if found is None or not known or (line or "") not in asked.asked_lines:
        of, example = of_line(first and "LINE"), f"{'max ' * moves}{of_line(first)}tension@end"
        ways = f"max, min, mean, std, last or t=TIME, and {of}NAME@S" if moves else f"{of}NAME@S, max or min {of}NAME"
        expected = f"{ways}{' of ' if first else ''}{', '.join(asked.asked_lines)}, such as {example}"
        raise SceneError([Complaint("of", text, expected, example)])
    time = math.nan
    if (over or "").startswith("t="):
        over, time = "t", _time_of(asked, text, over.removeprefix("t="))
    cable, section = asked.asked_lines[line or ""].cable, OF_SECTION.match(at or "")
    if section is not None and int(section[1]) >= len(cable.sections):
        expected = f"a section of the line, which has {len(cable.sections)}, counted from 0"
        raise SceneError([Complaint("of", text, expected, f"sections[{len(cable.sections) - 1}]")])
    s = None if section is not None else _place_of(text, at, cable.length)
    refuse_parts(name, axis or "", "" if moves else over or "", s)
    if s is None and name in PROBES and "s" in PROBES[name].dims and over not in ("max", "min"):
        fix = f"{text}@end" if moves else f"{name}@0, max {name}"
        raise SceneError([Complaint("of", text, "a place" if moves else "a place or an extreme", fix)])
    of_section = None if section is None else int(section[1])
    return Wanted(over or "", line or "", name, axis or "", np.inf if s == cable.length else s, of_section, time)


def _place_of(text: str, at: str | None, length: float) -> float | None:
    """The place of a result, m; None: it has none.  SceneError: it is not on the line."""
    if at is None:
        return None
    try:
        s = {"start": 0.0, "end": length}[at] if at in ("start", "end") else float(at)
    except ValueError:
        raise SceneError([Complaint("of", text, "a number of metres behind @", "tension@0")]) from None
    if not 0.0 <= s <= length:
        raise SceneError([Complaint("of", text, f"an arc length between 0 and {length:g} m", f"tension@{length:g}")])
    return s


def _time_of(asked: Scene, text: str, number: str) -> float:
    """The time of a result, s; SceneError: it is none, or beyond the run."""
    duration = asked.require_time().duration
    try:
        time = float(number)
    except ValueError:
        time = math.nan
    if not 0.0 <= time <= duration:
        expected = f"a time between 0 and {duration:g} s"
        raise SceneError([Complaint("of", text, expected, f"t={0.5 * duration:g} tension@end")])
    return time


def refuse_parts(name: str, axis: str, extreme: str, at: float | None) -> None:
    """SceneError: a component of what is no vector, an extreme along the line or a place of what has one value."""
    if name not in PROBES:
        return
    dims, whole = PROBES[name].dims, f"{name}.{axis}" if axis else name
    if axis and dims[-1:] != ("xyz",):
        raise SceneError([Complaint("of", whole, f"{name}, which has no components", name)])
    if (extreme or at is not None) and "s" not in dims:
        place = "" if at is None else f"@{'end' if np.isinf(at) else f'{at:g}'}"
        expected = f"{whole} alone, which has one value for the whole line"
        raise SceneError([Complaint("of", f"{extreme} {whole}{place}".lstrip(), expected, whole)])


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
    """Extremes of parabolas through every output and place and its neighbours.

    In time and place, but for these places (places,), where a value may be two.
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
