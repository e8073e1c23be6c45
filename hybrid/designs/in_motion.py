"""What results of a motion answer to numbers of the scene.

Where contact begins and ends along a line of cells it goes from node to node: between two of them it answers by half as
much as the line does, and in between by much more.  Its derivative is therefore that of equilibria between which it
goes over several cells.

Derivatives are differences of runs with the steps and cells of a base run.  Where steps follow the motion, a number
that changes them changes results by more than by itself: a small difference of two runs is then wrong by factors.
Steps and cells of the base run are therefore those of every run, whether a scene gives them or its accuracy has chosen
them; runs in which a step was divided, or zones are others, are no neighbours of the base run, and no derivative is
made of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.designs.line_at_rest import LineAtRest
from hybrid.designs.network_at_rest import NetworkAtRest
from hybrid.designs.numbers_and_results import (
    Wanted,
    at_a_bound,
    changed_scene,
    number_of,
    over_time,
    parse_wanted,
    peaks,
    scale_of,
    scene_with,
    size_of,
    smoothed,
)
from hybrid.designs.replay import Course, course_of, replay, with_outputs
from hybrid.designs.tangents import NetworkOthers, Seen, Unfollowed, has_two_sides, step_of
from hybrid.errors import Complaint, ComputationError, Outcome, ResultError, SceneError
from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.attachments import Spread
from hybrid.scene.root import Scene

WAY = "differences of equilibria, from cell to cell"
NAMES = ("touchdown", "touchdown_position", "grounded_length")
# Cells over which contact goes between two equilibria, at least and at most; parts of a number by which they differ, at
# first and at most.
CELLS, PARTS = (2.0, 6.0), (1e-2, 0.2)
TRIES = 8
# Error in parts of what twice the way changes, one draw of what goes up and down with the cells; part of a derivative
# that is never said to be known.
OF_CHANGE, UNSURE = 1.5, 0.02


def is_edge(asked: Scene, text: str) -> bool:
    """Whether a result such as `max hose/touchdown`, or a quantity of the scene, goes by where contact begins."""
    name = text.split("@")[0].split("/")[-1].split(" ")[-1].split(".")[0]
    quantity = asked.output.quantities.get(name)
    if quantity is None:
        return name in NAMES
    seabed = asked.environment.seabed is not None
    return "touchdown" in quantity.kind or (quantity.kind == "layback" and quantity.ends_at(seabed) == "touchdown")


def refuse_edges(asked: Scene, of: Sequence[str]) -> None:
    """SceneError: a result that goes by where contact begins, of what knows derivatives of the line of cells alone."""
    for text in of:
        if is_edge(asked, text):
            expected = "a result that changes evenly: where contact begins goes by the nodes that come to the bed"
            fix = "compare two `hybrid static`, or `hybrid run`; `hybrid seek` finds it"
            raise SceneError([Complaint("of", text, expected, fix)])


def by_cells(
    asked: Scene, rest: NetworkAtRest, key: str, values_of: Callable[[Scene], Floats]
) -> tuple[Floats, Floats]:
    """Derivatives (W,) of where contact begins by a number, and their errors: all of what goes over too few cells.

    rest: the equilibrium; values_of: results (W,) of that of another scene, on cells that go along.
    ComputationError: there is no equilibrium beside this one.
    """
    number, size = number_of(asked, key), size_of(asked, key, number_of(asked, key))
    cell = max(_cell(x) for x in rest.lines)

    def change(step: float) -> Floats:
        more, less = (values_of(changed_scene(asked, key, number + x)) for x in (step, -step))
        if not np.isfinite(more - less).all():
            raise ComputationError(Outcome.NOT_REACHED, None, None, f"{key}: a line no longer lies on the bed")
        return more - less

    step, most, cells, found = PARTS[0] * size, PARTS[1] * size, 0.0, np.zeros(0)
    for k in range(TRIES):
        try:
            found = change(step)
        except (ComputationError, SceneError):
            if k == TRIES - 1:
                raise
            most = step = 0.5 * step
            continue
        cells = float(np.abs(found).max()) / cell
        if CELLS[0] <= cells <= CELLS[1] or (cells < CELLS[0] and step == most):
            break
        step = min(step * min(max(sum(CELLS) / 2.0 / max(cells, 1e-3), 0.1), 10.0), most)
    near = found / (2.0 * step)
    try:
        far = change(2.0 * step) / (4.0 * step)
    except (ComputationError, SceneError):
        return near, np.abs(near)
    few = (np.abs(found) < 0.5 * CELLS[0] * cell) | (np.abs(found) > 2.0 * CELLS[1] * cell)
    return far, np.where(few, np.abs(far), np.maximum(OF_CHANGE * np.abs(far - near), UNSURE * np.abs(far)))


def _cell(line: LineAtRest) -> float:
    """The longest cell in which contact begins or ends, m; of a line without contact of all."""
    lies = planes_under(line.here.sea, line.state.r)[1] > 0.0
    there = np.flatnonzero(lies[1:] != lies[:-1])
    return float(line.model.line.h[there if there.size else slice(None)].max())


# Parts of a number by which runs differ: differences of second order by both, from which one of fourth order follows.
# Of steps that are solved to rounding: of forces at anchors with friction 1e-3 left 4e-5, or found no step, and 3e-4
# left 0.09 (bench/test_bench_tangents.py).
STEP_PARTS = (3e-5, 6e-5)
# How derivatives were found.
TANGENTS, DIFFERENCES = "tangents along the steps", "differences of runs"
# A result that answers by less than this, in parts by parts, has the error of tangents of this.
WEAK = 0.04
# Of the length, by which zones of two runs may differ that are the same.
SAME_ZONE = 0.005
# Of the length, within which a place is at the end of a section.
OF_ENDS = 1e-6


class Slopes(NamedTuple):
    """Results (W,) of the base run; their derivatives (P, W) by numbers, errors of these, and the way to each row."""

    values: Floats
    derivatives: Floats
    errors: Floats
    ways: tuple[str, ...]


def in_motion(asked: Scene, of: Sequence[str], by: Sequence[str]) -> Slopes:
    """Derivatives of results of a run: tangents along its steps or, where these are not known, four runs a number.

    of: `max tension@end`, `std position.z@100`, `max hose/curvature`: max, min, mean, std or last over the outputs, or
    `t=12.5 tension@end`, at a time.
    SceneError: no such key or result; ComputationError: a run fails, or steps or zones of runs with other numbers are
    not those of the base run.
    """
    refuse_edges(asked, of)
    wanted = [parse_wanted(asked, x, moves=True) for x in of]
    at = {name: [x.at for x in wanted if x.line == k and x.at is not None] for name, k in asked.form.names.items()}
    course = course_of(asked)._replace(places=at)
    numbers = {key: number_of(asked, key) for key in by}
    sizes = {key: size_of(asked, key, number) for key, number in numbers.items()}
    apart: dict[str, str] = {}  # why tangents are not known
    found: list[Slopes] = []
    while along := {key: x for key, x in numbers.items() if key not in apart}:
        try:
            found.append(by_tangents(asked, wanted, course, along, sizes))
            break
        except Unfollowed as why:
            which = list(along) if why.number is None else [list(along)[why.number]]
            apart |= {key: str(why) for key in which}
    if apart:
        found.append(by_differences(asked, wanted, course, {key: numbers[key] for key in apart}, sizes))
    ways = tuple(f"{DIFFERENCES}: {apart[key]}" if key in apart else TANGENTS for key in by)
    order = [[*along, *apart].index(key) for key in by]
    derivatives, errors = (
        np.concatenate(x)[order] for x in ([x.derivatives for x in found], [x.errors for x in found])
    )
    return Slopes(found[0].values, derivatives, errors, ways)


def by_tangents(
    asked: Scene,
    wanted: Sequence[Wanted],
    course: Course,
    numbers: Mapping[str, float],
    sizes: Mapping[str, float],
) -> Slopes:
    """Derivatives by tangents along the steps of one run; Unfollowed: they are not known of it.

    They are the means of those to both sides of a number, where the scene may have less of it; half of what these
    differ by is an error.
    """
    # as far as numbers go: far from the origin a step is rounded
    steps = {key: number + step_of(key, sizes[key]) - number for key, number in numbers.items()}

    def other(key: str, d: float) -> Scene:
        return scene_with(asked, [(key,)], np.array([numbers[key] + d]))

    beside: list[tuple[float, tuple[Any, Any | None]]] = []  # steps of numbers; the scenes there and on the other side
    for key, h in steps.items():
        try:
            more, less = other(key, h), other(key, -h)
        except SceneError as error:
            if numbers[key] == 0.0:
                raise at_a_bound(key, 0.0) from error
            raise
        two = has_two_sides([key], numbers[key])
        beside += [(h, (more, less if two else None)), (-h, (less, more if two else None))]
    try:
        base, slopes, off = followed(asked, wanted, course, [x for _, x in beside], [h for h, _ in beside])
    except Unfollowed as why:
        why.number = None if why.number is None else why.number // 2
        raise
    up, down = slopes[::2], slopes[1::2]
    mean, size = 0.5 * (up + down), np.array([[sizes[key]] for key in numbers])
    left = np.maximum(off[::2], off[1::2])[:, None]  # by the last corrections of tangents
    scales = np.array([scale_of(asked, x.name, value) for x, value in zip(wanted, base.values.tolist(), strict=True)])
    errors = left * np.maximum(np.abs(mean), WEAK * scales / size) + 0.5 * np.abs(up - down)
    errors += np.spacing(np.abs(base.values)) / np.array([[h] for h in steps.values()])  # results are rounded, too
    return Slopes(base.values, mean, errors, len(numbers) * (TANGENTS,))


def followed(
    asked: Scene,
    wanted: Sequence[Wanted],
    course: Course,
    pairs: Sequence[tuple[Any, Any | None]],
    steps: Sequence[float],
    smooth: bool = False,
) -> tuple[Motion, Floats, Floats]:
    """A run, derivatives (P, W) of results by numbers, and parts of tangents (P,) by which these may be off.

    pairs: scenes with more of each number by a step, and with less of those that are to be seen from both sides.
    smooth: as of `Motion`, with all peaks of each result in turn, so that W is more.
    """
    each_step = any(x.over == "t" for x in wanted)
    more = places_of_lines(asked, wanted) if smooth else None

    def others_in(course: Course) -> NetworkOthers:
        own = with_outputs(asked, course, each_step=each_step)
        scenes: list[Any] = [tuple(x and with_outputs(x, course, each_step=each_step) for x in pair) for pair in pairs]
        return NetworkOthers(own, scenes, steps, course.lines, more)

    others = others_in(course.as_asked())
    if others.are_flat:
        course = course.as_asked()
    else:
        others = others_in(course)
    base = Motion(asked, wanted, course, smooth=smooth, begun=others.begin)
    of = dict(zip(course.lines, asked.asked_lines, strict=True))  # of lines of the network, their names in the scene
    names = {line: sorted({x.name for x in wanted if x.line == name}) for line, name in of.items()}
    found = others.results({line: x for line, x in names.items() if x})
    here, *beside = [[base.beside({of[k]: x for k, x in y.items()}, wanted) for y in each] for each in found]
    slopes = [(x[0] - (x[1:] or here)[0]) / (h * len(x)) for x, h in zip(beside, steps, strict=True)]
    return base, np.array(slopes), others.errors


def by_differences(
    asked: Scene,
    wanted: Sequence[Wanted],
    course: Course,
    numbers: Mapping[str, float],
    sizes: Mapping[str, float],
) -> Slopes:
    """Derivatives by differences of runs in the steps of one: four for each number."""
    base = Motion(asked, wanted, course)
    slopes, errors = (np.zeros((len(numbers), len(wanted))) for _ in range(2))
    for i, (key, number) in enumerate(numbers.items()):
        found = []
        for part in STEP_PARTS:
            d = part * sizes[key]
            more, less = (
                Motion(scene_with(asked, [(key,)], np.array([number + x])), wanted, base.course, base) for x in (d, -d)
            )
            for each in (more, less):
                each.check(base, key)
            found.append((more.values - less.values) / (2.0 * d))
        slopes[i] = (4.0 * found[0] - found[1]) / 3.0
        errors[i] = np.abs(slopes[i] - found[0])
    return Slopes(base.values, slopes, errors, len(numbers) * (DIFFERENCES,))


def places_of_lines(scene: Scene, wanted: Sequence[Wanted]) -> dict[str, list[float]]:
    """Places that are wanted, m, of lines of the network by name."""
    asked = [x for x in wanted if x.at is not None and np.isfinite(x.at)]
    names = scene.form.names.items()
    return {name: [float(x.at or 0.0) for x in asked if x.line == called] for name, called in names}


class Motion:
    """A run, and results of it; beside a base run extremes are where and when those of that are.

    begin: places (n, 3), m, of output points of every line at first.
    """

    def __init__(
        self,
        scene: Scene,
        wanted: Sequence[Wanted],
        course: Course,
        base: Motion | None = None,
        finer: bool = False,
        smooth: bool = False,
        begun: Callable[..., None] | None = None,
    ) -> None:
        """A run of a scene in the steps of a course.

        course, finer, begun: as of `replay`; smooth: extremes are those of parabolas in time and along the line, at
        whose nodes there are outputs.
        """
        self.course, self.smooth = course, smooth
        self.shapes: dict[Wanted, tuple[int, ...]] = {}
        self._smooth: dict[Wanted, Floats] = {}  # extremes of parabolas, where they have been asked for
        more = places_of_lines(scene, wanted) if smooth else None
        self._cables = {k: x.cable for k, x in scene.asked_lines.items()}
        each_step = any(x.over == "t" for x in wanted)
        with replay(scene, course, finer, more, each_step, begun) as result:
            lines: dict[str, Any] = dict(zip(scene.asked_lines, result.lines.values(), strict=True))
            self.steps = {name: np.array(x["steps/t"]) for name, x in lines.items()}
            self.zones = {name: list(_zones(x)) for name, x in lines.items()}
            self.begin = {name: np.array(x.position[0]) for name, x in lines.items()}
            self._t = {name: np.array(x.t) for name, x in lines.items()}
            self._histories = self._read(lines, wanted, base)
        self.where: list[Any] = [None] * len(wanted) if base is None else list(base.where)
        self.values = self._values(wanted, self.where, base)
        # of each result, when and where peaks are; one of all that are no extremes
        self.peaks: list[list[Any]] = [[where] for where in self.where] if base is None else base.peaks
        if smooth and base is None:
            each = zip(wanted, self.where, strict=True)
            self.peaks = [peaks(self._table(x), x.over, where) for x, where in each]
        if not smooth:
            self._histories, self._smooth = {k: x for k, x in self._histories.items() if k.name == "phi"}, {}

    def beside(self, seen: Mapping[str, Seen], wanted: Sequence[Wanted]) -> Floats:
        """The same results of other outputs, by line, of a scene with another number.

        In these steps, of all peaks in turn: extremes are where they are in this run.  Unfollowed: there are others.
        """
        other = copy(self)
        other._cables, other._t = {k: x.scene.cable for k, x in seen.items()}, {k: x.t for k, x in seen.items()}
        other._histories = other._read(seen, wanted, self)
        if other.shapes != self.shapes:
            raise Unfollowed("outputs of a section are more or fewer")
        return other.at_peaks(wanted, self.peaks)

    def at_peaks(self, wanted: Sequence[Wanted], where: Sequence[Sequence[Any]]) -> Floats:
        """Results at places and times of the peaks of each, which may be those of another run, in turn."""
        each = [(x, place) for x, places in zip(wanted, where, strict=True) for place in places]
        return self._values([x for x, _ in each], [place for _, place in each])

    def _read(
        self, lines: Mapping[str, Any], wanted: Sequence[Wanted], base: Motion | None = None
    ) -> dict[Wanted, Floats]:
        """Histories of results, of which there is one of many times; their shapes are noted.

        base: within half a turn of whose angles angles are.
        """
        out: dict[Wanted, Floats] = {}
        for x in wanted:
            if x.place not in out:
                out[x.place] = self._history(lines[x.line], x)
                if x.name == "phi" and base is not None and out[x.place].shape == base.shapes[x.place]:
                    turns = np.rint((base._histories[x.place] - out[x.place]) / (2.0 * np.pi))
                    out[x.place] = out[x.place] + 2.0 * np.pi * turns
        self._smooth = {}
        self.shapes = {place: history.shape for place, history in out.items()}
        self._cuts = {place: self._cut(lines[place.line], place, shape[-1]) for place, shape in self.shapes.items()}
        return out

    def _cut(self, result: Any, x: Wanted, count: int) -> NDArray[np.bool_]:
        """(count,) which of the places of a history are jumps, where a value may be two; no ends of sections."""
        s = np.asarray(result.s)
        cut = np.zeros(count, bool)
        if count == s.size and self.smooth:
            for item in self._cables[x.line].attachments:
                for at in item.range if isinstance(item, Spread) else (item.at,):
                    cut |= np.abs(s - at) <= OF_ENDS * s[-1]
        return cut

    def _values(self, wanted: Sequence[Wanted], where: list[Any], base: Motion | None = None) -> Floats:
        """Results (W,); where: when and where extremes are, found here where it is not known."""
        values = np.zeros(len(wanted))
        for k, x in enumerate(wanted):
            history = self._histories[x.place]
            if base is not None and history.shape != base.shapes[x.place]:  # it is no neighbour: see check
                continue
            if x.over == "t":
                values[k] = np.interp(x.time, self._t[x.line], history[:, 0])
                continue
            values[k], where[k] = over_time(self._table(x), x.over, where[k])
        return values

    def _table(self, x: Wanted) -> Floats:
        """The history of which a statistic is: of extremes that are those of parabolas, these."""
        history = self._histories[x.place]
        if not self.smooth or x.over not in ("max", "min"):
            return history
        key = x.place._replace(over=x.over)
        if key not in self._smooth:
            self._smooth[key] = smoothed(history, x.over, self._cuts[x.place])
        return self._smooth[key]

    def _history(self, result: Any, x: Wanted) -> Floats:
        """(outputs, places or 1) of a result."""
        try:
            value = np.asarray((result.values if isinstance(result, Seen) else result)[x.name], float)
        except (KeyError, ResultError):
            names = ", ".join(name for name in PROBES if "/" not in name)
            raise SceneError([Complaint("of", x.name, f"one of {names}", "max tension@end")]) from None
        dims = PROBES[x.name].dims if x.name in PROBES else ()
        value = x.component(value)
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
        k = int(np.searchsorted(s, x.at))  # the first point that is not before it
        if k >= s.size or s[k] == x.at or k == 0:
            return value[:, [min(k, s.size - 1)]]
        part = (x.at - s[k - 1]) / (s[k] - s[k - 1])
        return value[:, [k - 1]] + part * (value[:, [k]] - value[:, [k - 1]])

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
