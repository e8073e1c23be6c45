"""What results of a motion answer to numbers of the scene: differences of runs with the steps and cells of a base run.

Where steps follow the motion, a number that changes them changes results by more than by itself: a small difference of
two runs is then wrong by factors.  Steps and cells of the base run are therefore those of every run, whether a scene
gives them or its accuracy has chosen them; runs in which a step was divided, or zones are others, are no neighbours of
the base run, and no derivative is made of them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.designs.line_at_rest import AXES, refuse_parts
from hybrid.designs.numbers import changed_scene, number_of
from hybrid.designs.replay import Course, course_of, replay
from hybrid.errors import Complaint, ComputationError, Outcome, ResultError, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.schema import Scene
from hybrid.scene.system import System

NAME = re.compile(r"^(max|min|mean|std|last|t=\S+) (?:([^/@]+)/)?([a-z_]\w*)(?:\.([xyz]))?(?:@(.+))?$")
OF_SECTION = re.compile(r"^sections\[(\d+)\]$")
# Parts of a number by which runs differ: differences of second order by both, from which one of fourth order follows.
PARTS = (1e-3, 2e-3)
# Coordinates differ by parts of this part of the longest line: what they are depends on where the origin is.
PLACE, OF_LENGTH = re.compile(r"(position\[\d\]|\.z|\.surface|\.at\[\d\])$"), 0.1
# Tables of how a scene is computed and written.
COMPUTING = ("time", "output", "mesh", "accuracy", "model", "resolution")
# Of the length, by which zones of two runs may differ that are the same.
SAME_ZONE = 0.005
# Of the length, within which a place is at the end of a section.
OF_ENDS = 1e-6


class Wanted(NamedTuple):
    """A result over the time of a run, in parts; line: "" of one cable; at: m, infinity: the end, None: all places, or

    those of a section; time: s, at which it is wanted (over: "t"), between outputs by the straight line.
    """

    over: str
    line: str
    name: str
    axis: str
    at: float | None
    section: int | None = None
    time: float = math.nan


class Slopes(NamedTuple):
    """Results (W,) of the base run; their derivatives (P, W) by numbers, and errors of these by the step."""

    values: Floats
    derivatives: Floats
    errors: Floats


def in_motion(asked: Scene | System, of: Sequence[str], by: Sequence[str]) -> Slopes:
    """Derivatives of results of a run; four runs for each number.

    of: `max tension@end`, `std position.z@100`, `max hose/curvature`: max, min, mean, std or last over the outputs, or
    `t=12.5 tension@end`, at a time.
    SceneError: no such key or result; ComputationError: a run fails, or steps or zones of runs with other numbers are
    not those of the base run.
    """
    wanted = [parse_history(asked, x) for x in of]
    numbers = [number_of(asked, key) for key in by]
    base = Motion(asked, wanted, course_of(asked))
    slopes, errors = (np.zeros((len(by), len(of))) for _ in range(2))
    for i, (key, number) in enumerate(zip(by, numbers, strict=True)):
        found = []
        for part in PARTS:
            d = part * size_of(asked, key, number)
            more, less = (
                Motion(changed_scene(asked, key, number + x), wanted, base.course, base) for x in (d, -d)
            )  # fmt: skip
            for each in (more, less):
                each.check(base, key)
            found.append((more.values - less.values) / (2.0 * d))
        slopes[i] = (4.0 * found[0] - found[1]) / 3.0
        errors[i] = np.abs(slopes[i] - found[0])
    return Slopes(base.values, slopes, errors)


def size_of(asked: Scene | System, key: str, number: float) -> float:
    """What runs differ by parts of; SceneError: a number of how the scene is computed, which has no derivative."""
    if key.split(".")[0] in COMPUTING:
        expected = "a number of what is computed: of the cable, its ends, what is around it"
        raise SceneError([Complaint("by", key, expected, "cable.sections[0].length, for example")])
    if PLACE.search(key):
        lines = [x.cable.length for x in asked.lines.values()] if isinstance(asked, System) else [asked.length]
        return OF_LENGTH * max(lines)
    return abs(number) or 1.0


def parse_history(asked: Scene | System, text: str) -> Wanted:
    found = NAME.match(text)
    several = isinstance(asked, System)
    example = "max east/tension@end" if several else "max tension@end"
    if found is None or bool(found[2]) != several:
        expected = "max, min, mean, std, last or t=TIME, and NAME@S, of several lines LINE/NAME@S"
        raise SceneError([Complaint("of", text, expected, example)])
    over, line, name, axis, at = found.groups()
    time = math.nan
    if over.startswith("t="):
        over, time = "t", _time_of(asked, text, over.removeprefix("t="))
    section = OF_SECTION.match(at or "")
    at = None if section is not None else at
    if isinstance(asked, System) and line not in asked.lines:
        raise SceneError([Complaint("of", text, f"a line of {', '.join(asked.lines)}", example)])
    cable = asked.lines[line].cable if isinstance(asked, System) else asked.cable
    length, count = cable.length, len(cable.sections)
    if section is not None and int(section[1]) >= count:
        raise SceneError([Complaint("of", text, f"a section of the line, which has {count}, counted from 0", example)])
    try:
        s = {None: None, "start": 0.0, "end": length}[at] if at in (None, "start", "end") else float(at)
    except ValueError:
        raise SceneError([Complaint("of", text, "a number of metres behind @", example)]) from None
    if s is not None and not 0.0 <= s <= length:
        raise SceneError([Complaint("of", text, f"an arc length between 0 and {length:g} m", example)])
    refuse_parts(name, axis or "", "", s)
    if s is None and name in PROBES and "s" in PROBES[name].dims and over not in ("max", "min"):
        raise SceneError([Complaint("of", text, "a place", f"{text}@end")])
    of_section = None if section is None else int(section[1])
    return Wanted(over, line or "", name, axis or "", np.inf if s == length else s, of_section, time)


def _time_of(asked: Scene | System, text: str, number: str) -> float:
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


class Motion:
    """A run, and results of it; beside a base run extremes are where and when those of that are.

    begin: places (n, 3), m, of output points of every line at first.
    """

    def __init__(
        self, scene: Scene | System, wanted: Sequence[Wanted], course: Course, base: Motion | None = None,
        finer: bool = False, smooth: bool = False,
    ) -> None:  # fmt: skip
        """course, finer: as of `replay`; smooth: extremes are those of parabolas in time and along the line,

        at whose nodes there are outputs.
        """
        self.course = course
        more = [x.at for x in wanted if x.at is not None and np.isfinite(x.at)] if smooth else None
        self._cables = {k: x.cable for k, x in scene.lines.items()} if isinstance(scene, System) else {"": scene.cable}
        each_step = any(x.over == "t" for x in wanted)
        with replay(scene, course, finer, more, each_step) as result:
            lines: dict[str, Any] = dict(result.lines) or {"": result}
            self.steps = {name: np.array(x["steps/t"]) for name, x in lines.items()}
            self.zones = {name: list(_zones(x)) for name, x in lines.items()}
            self.begin = {name: np.array(x.position[0]) for name, x in lines.items()}
            self.where: list[Any] = [None] * len(wanted) if base is None else list(base.where)
            self.values = np.zeros(len(wanted))
            self.shapes: list[tuple[int, ...]] = []
            histories: dict[Wanted, Floats] = {}  # of many times there is one
            for k, x in enumerate(wanted):
                place = x._replace(over="", time=0.0)
                if place not in histories:
                    histories[place] = self._history(lines[x.line], x)
                history = histories[place]
                self.shapes.append(history.shape)
                if base is not None and history.shape != base.shapes[k]:  # it is no neighbour: see check
                    continue
                if x.over == "t":
                    self.values[k] = np.interp(x.time, lines[x.line].t, history[:, 0])
                    continue
                self.values[k], self.where[k] = _over(history, x.over, self.where[k])
                if smooth and x.over in ("max", "min"):
                    self.values[k] += _beyond(history, *self.where[k])

    def _history(self, result: Any, x: Wanted) -> Floats:
        """(outputs, places or 1) of a result."""
        try:
            value = np.asarray(result[x.name], float)
        except (KeyError, ResultError):
            names = ", ".join(name for name in PROBES if "/" not in name)
            raise SceneError([Complaint("of", x.name, f"one of {names}", "max tension@end")]) from None
        dims = PROBES[x.name].dims if x.name in PROBES else ()
        if dims[-1:] == ("xyz",):
            value = value[..., AXES.index(x.axis)] if x.axis else np.linalg.norm(value, axis=-1)
        if "edge" in dims:
            value = value[:, -1]
        if "s" not in dims:
            return value[:, None]
        s = np.asarray(result.s)
        if x.section is not None:
            ends = np.cumsum([0.0, *(section.length for section in self._cables[x.line].sections)])
            near = OF_ENDS * ends[-1]
            return value[:, (s >= ends[x.section] - near) & (s <= ends[x.section + 1] + near)]
        if x.at is None:
            return value
        return np.array([[np.interp(min(x.at, s[-1]), s, row)] for row in value])

    def check(self, base: Motion, key: str) -> None:
        """ComputationError where steps or zones are not those of the base run."""
        for name, steps in self.steps.items():
            what = "outputs of a section are more or fewer" if self.shapes != base.shapes else ""
            if not np.array_equal(steps, base.steps[name]):
                what = "a step was divided in one of the runs"
            elif not _alike(self.zones[name], base.zones[name]):
                what = "zones of the runs are others"
            if what:
                detail = f"{key}: {what}, so that their difference is not that of this number alone"
                first = "a smaller time.step, or `model: rod` for zones"
                raise ComputationError(Outcome.NOT_CONVERGED, None, None, detail, first=first)


def _zones(result: Any) -> Iterator[list[tuple[str, float]]]:
    """Of every output kinds of zones, and where they end as parts of the length."""
    for zones in result.zones:
        yield [(x.kind, x.s_b / zones[-1].s_b) for x in zones]


def _alike(one: Sequence[Sequence[tuple[str, float]]], other: Sequence[Sequence[tuple[str, float]]]) -> bool:
    """Whether zones are the same in all outputs."""
    return len(one) == len(other) and all(
        [x for x, _ in a] == [x for x, _ in b]
        and all(abs(x - y) <= SAME_ZONE for (_, x), (_, y) in zip(a, b, strict=True))
        for a, b in zip(one, other, strict=True)
    )


def _over(history: Floats, over: str, where: Any) -> tuple[float, Any]:
    """The statistic of outputs (n, places), and when and where an extreme is; where: None: not known yet."""
    if over in ("max", "min"):
        if where is None:
            flat = np.nanargmax(history) if over == "max" else np.nanargmin(history)
            where = np.unravel_index(int(flat), history.shape)
        return float(history[where]), where
    x = history[:, 0]
    return float({"mean": x.mean(), "std": x.std(), "last": x[-1]}[over]), None


def _beyond(history: Floats, i: int, k: int) -> float:
    """By how much the extremes of parabolas through an extreme and its neighbours in time and place are beyond it.

    Outputs and places count as evenly spaced there: it changes evenly where an extreme goes from one to the next.
    """
    out = 0.0
    for row, j in ((history[:, k], i), (history[i], k)):
        if 0 < j < row.size - 1:
            before, here, after = row[j - 1 : j + 2]
            bent = after - 2.0 * here + before
            if abs(after - before) < 2.0 * abs(bent):  # it is between the neighbours
                out -= (after - before) ** 2 / (8.0 * bent)
    return float(out)
