"""A design file as a problem, and as a component.

A problem has unknowns, equilibria of cases, what results have to keep, and what is minimised; a component has inputs
and outputs with names, units, rows of results and bounds.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.designs.case_results import IN_MOTION, AnyScene, Equilibria, Point
from hybrid.designs.in_motion import is_edge
from hybrid.designs.nearest import Space
from hybrid.designs.numbers_and_results import PART as KEY_PART
from hybrid.designs.numbers_and_results import PLACE, computing, number_of, of_line, scale_of, unit_of_key
from hybrid.errors import SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.base import Finding, Place
from hybrid.scene.read import TaskFile, as_scene, read_text, scene_text
from hybrid.scene.study import NAMED, Design, OfEquilibrium, Unknown
from hybrid.studies.cases import evaluated

# Part of a variable of an expression by which it is differentiated.
PART = 1e-6


class Constraint(NamedTuple):
    """What one result has to keep.

    name: of its target or limit; result: as of `hybrid.sensitivity`; row: of the results; side: 1: at most the bound,
    -1: at least, 0: that; scale: what differences are parts of.
    """

    name: str
    case: str
    result: str
    row: int
    bound: float
    side: int
    scale: float

    def off(self, value: float) -> float:
        """By how many parts a value is beyond the bound; of a target with its sign."""
        part = (value - self.bound) / self.scale
        return part if self.side == 0 else max(self.side * part, 0.0)

    def evened(self, value: float) -> tuple[float, float]:
        """A number that is 0 at the bound, about as far from it as `off`, and its slope.

        By the value; the logarithm of what is positive, which changes more evenly with lengths.
        """
        if self.bound == self.scale and value > 0.0:
            return float(np.log(value / self.bound)), 1.0 / value
        return (value - self.bound) / self.scale, 1.0 / self.scale


class Objective:
    """The expression that is minimised."""

    def __init__(self, text: str, unknowns: Sequence[str], results: Mapping[str, int], task: TaskFile[Design]) -> None:
        """results: rows of those that it may speak of, by name."""
        self.text, self._unknowns, self.results, self._task = text, list(unknowns), dict(results), task

    @property
    def rows(self) -> list[int]:
        """Those of the results that it speaks of."""
        return [*self.results.values()]

    def value(self, point: Point) -> float:
        """SceneError: it is no number there."""
        return self._values([self._names(point)])[0]

    def parts(self, point: Point) -> dict[str, float]:
        """Derivatives by unknowns and results, each by itself; SceneError: it is no number there, or beside it."""
        names, rows, steps = self._names(point), [], []
        for name, x in names.items():
            steps.append(PART * (abs(x) or 1.0))
            rows += [names | {name: x + steps[-1]}, names | {name: x - steps[-1]}]
        values = np.array(self._values(rows))
        return dict(zip(names, ((values[::2] - values[1::2]) / (2.0 * np.array(steps))).tolist(), strict=True))

    def slopes(self, point: Point) -> Floats:
        """(n,) derivatives by unknowns."""
        by_name = self.parts(point)
        out = np.array([by_name[x] for x in self._unknowns])
        for name, row in self.results.items():
            if by_name[name] != 0.0:
                out += by_name[name] * point.slopes[row]
        return out

    def _names(self, point: Point) -> dict[str, float]:
        own = dict(zip(self._unknowns, point.x.tolist(), strict=True))
        return own | {name: float(point.values[row]) for name, row in self.results.items()}

    def _values(self, rows: Sequence[dict[str, float]]) -> list[float]:
        try:
            found = evaluated("minimise", self.text, rows)
        except SceneError as error:
            first = error.complaints[0]
            given = ", ".join(f"{name} = {x:.6g}" for name, x in rows[0].items())
            raise self._task.refusal([Finding(("minimise",), f"{first.expected} (with {given})")]) from None
        for names, x in zip(rows, found, strict=True):
            if isinstance(x, bool) or not isinstance(x, int | float) or not np.isfinite(x):
                given = ", ".join(f"{name} = {value:.6g}" for name, value in names.items())
                expected = f"arithmetic that gives a number; with {given} it gives {x}"
                raise self._task.refusal([Finding(("minimise",), expected)])
        return [float(x) for x in found]


class Within(NamedTuple):
    """Parts of a limit within which it is kept, and active; part of what is minimised within which it is least."""

    kept: float
    active: float
    exact: float


# Of motions coarser: extremes have kinks, their mesh and steps are worth about as much, and a digit more takes as many
# runs again.
AT_REST, MOVING = Within(1e-6, 1e-4, 1e-7), Within(1e-3, 3e-3, 1e-3)
# Parts of a limit within which it is near.
NEAR = 0.01
# Parts of a limit, beside what it is foretold to change by, that a case has to keep from it for not being run.
AWAY = 0.05


class Problem(NamedTuple):
    """objective: None: nothing is minimised."""

    space: Space
    equilibria: Equilibria
    constraints: tuple[Constraint, ...]
    objective: Objective | None

    @property
    def moves(self) -> bool:
        return bool(self.equilibria.motions.rows)

    @property
    def within(self) -> Within:
        return MOVING if self.moves else AT_REST

    def refresh(self, point: Point) -> bool:
        """Take slopes of motions anew, in cases with a limit that is near and in those of what is minimised.

        False: they are differences of runs already.
        """
        spoken = self.objective.rows if self.objective is not None else []
        near = [c.case for c in self.constraints if (point.values[c.row] - c.bound) * c.side >= -NEAR * c.scale]
        return self.moves and point.refresh({*near, *(self.equilibria.wanted[k][0] for k in spoken)})

    def missed(self, point: Point, there: Point, near: float = NEAR) -> set[str]:
        """Cases in which another point is within parts of a limit, or beyond it, and not where slopes foretold."""
        if not self.moves:
            return set()
        foretold = point.foretold(there.x)
        return {
            c.case
            for c in self.constraints
            if (there.values[c.row] - c.bound) * c.side >= -near * c.scale
            and abs(there.values[c.row] - foretold[c.row]) > self.within.kept * c.scale
        }

    def moving(self, point: Point, x: Floats) -> set[str]:
        """Cases of which a search has to know the motion with values x of unknowns.

        Those with a target, with a limit that may be near by what a point and the last run of the case foretell, and
        those of what is minimised.
        """
        equilibria, spoken = self.equilibria, self.objective.rows if self.objective is not None else []
        cases = {equilibria.wanted[k][0] for k in spoken}
        if self.moves:
            foretold, changed = point.foretold(x), np.abs(equilibria.motions.changed(x, len(equilibria.wanted)))
            cases |= {
                c.case
                for c in self.constraints
                if (foretold[c.row] - c.bound) * c.side >= -(AWAY * c.scale + changed[c.row])
            }
        return cases


def problem_of(task: TaskFile[Design], scene: AnyScene) -> Problem:
    """The problem of a design; SceneError: keys, cases or results that the scene does not have."""
    asked = task.asked
    scenes = scenes_of(task, scene)
    space, keys = space_of(task, scene, scenes)
    wanted: dict[tuple[str, str], int] = {}
    constraints, spoken = [], {}

    def row(case: str, result: str) -> int:
        return wanted.setdefault((case, result), len(wanted))

    for name, aim in asked.targets.items():
        case, result = aim.case or next(iter(scenes)), _result(task, ("targets", name), aim, aim.take or "", scene)
        scale = scale_of(scene, aim.quantity, aim.value)
        constraints.append(Constraint(name, case, result, row(case, result), aim.value, 0, scale))
    for name, limit in asked.limits.items():
        for case in limit.cases or scenes:
            for bound, side in ((limit.largest, 1), (limit.smallest, -1)):
                if bound is not None:
                    for result in _pieces(task, ("limits", name), limit, "max" if side > 0 else "min", scene):
                        scale = scale_of(scene, limit.quantity, bound)
                        constraints.append(Constraint(name, case, result, row(case, result), bound, side, scale))
    for name, each in asked.results.items():
        case, result = each.case or next(iter(scenes)), _result(task, ("results", name), each, each.take or "", scene)
        spoken[name] = row(case, result)
    equilibria = Equilibria(scenes, keys, list(wanted))
    objective = Objective(asked.minimise, space.names, spoken, task) if asked.minimise is not None else None
    return Problem(space, equilibria, tuple(constraints), objective)


def begun(problem: Problem) -> Problem:
    """The problem with scales of what has to be 0: what it is where the search begins, or unknowns can make it there.

    ComputationError: there is no equilibrium there; SceneError: results that are not there.
    """
    point = problem.equilibria.point_of(problem.space.start)
    if problem.objective is not None:
        problem.objective.value(point)  # refused before the search
    if all(x.scale for x in problem.constraints):
        return problem
    size = np.maximum(np.abs(point.values), np.abs(point.slopes) @ problem.space.sizes(problem.space.start))
    scaled = [x._replace(scale=x.scale or float(size[x.row]) or 1.0) for x in problem.constraints]
    return problem._replace(constraints=tuple(scaled))


def scenes_of(task: TaskFile[Design], scene: AnyScene) -> dict[str, AnyScene]:
    """The scene of each case; "": there are none.  SceneError: one is refused."""
    if not task.asked.cases:
        return {"": scene}
    text, scenes = scene_text(scene), dict[str, AnyScene]()
    for name, changes in task.asked.cases.items():
        try:
            settings = [f"{key}={json.dumps(value)}" for key, value in changes.items()]
            scenes[name] = read_text(text, overrides=settings)[0]
        except SceneError as error:
            raise _moved(task, ("cases", name), error) from None
    return scenes


def space_of(
    task: TaskFile[Design], scene: AnyScene, scenes: Mapping[str, AnyScene]
) -> tuple[Space, list[tuple[str, ...]]]:
    """The unknowns, and the keys of each; SceneError: keys that are none or of a case, starts out of bounds."""
    found: list[Finding] = []
    start, low, high = list[float](), list[float](), list[float]()
    keys, taken = list[tuple[str, ...]](), list[str]()
    for name, each in task.asked.unknowns.items():
        group = each.keys_of(name)
        place: Place = (
            ("unknowns", name, "keys" if each.keys else "key") if each.key or each.keys else ("unknowns", name)
        )
        for key in group:
            found += _key_findings(key, place, scenes, task.asked.cases, taken)
            taken.append(key)
        keys.append(group)
        if not found:
            begin = each.start if each.start is not None else number_of(next(iter(scenes.values())), group[0])
            bounds = _bounds(each, begin)
            found += _start_findings(name, begin, *bounds)
            for values, x in zip((start, low, high), (begin, *bounds), strict=True):
                values.append(x)
    if found:
        raise task.refusal(found)
    most = np.array([scene.length if PLACE.search(group[0]) else np.inf for group in keys])
    return Space(tuple(task.asked.unknowns), np.array(start), np.array(low), np.array(high), most), keys


def _key_findings(
    key: str, place: Place, scenes: Mapping[str, AnyScene], cases: Mapping[str, Any], taken: Sequence[str]
) -> Iterator[Finding]:
    if part := computing(key):
        expected = f"a key of what is there, not of how it is computed, as {part} is"
        yield Finding(place, expected, "cable.sections[0].length, for example", given=key)
    parts = KEY_PART.findall(key)
    if parts in [KEY_PART.findall(x) for x in taken]:
        yield Finding(place, "the key of a number that nothing else sets", given=key)
    for case, changes in cases.items():
        for (
            other
        ) in changes:  # one that holds the number as well: the unknown would stand in place of what the case sets
            set_by_case = KEY_PART.findall(other)
            if parts[: len(set_by_case)] == set_by_case:
                yield Finding(place, f"a key that no case sets, as {case} does with {other}", given=key)
    try:
        for scene in scenes.values():
            number_of(scene, key)
    except SceneError as error:
        yield Finding(place, error.complaints[0].expected, error.complaints[0].fix, given=key)


def _bounds(each: Unknown, begin: float) -> tuple[float, float]:
    """An unknown without any bound keeps its sign."""
    low, high = (-np.inf if each.low is None else each.low), (np.inf if each.high is None else each.high)
    if each.low is None and begin > 0.0 and high > 0.0:
        low = 0.0
    if each.high is None and begin < 0.0 and low < 0.0:
        high = 0.0
    return low, high


def _start_findings(name: str, begin: float, low: float, high: float) -> Iterator[Finding]:
    if begin == 0.0 and not (np.isfinite(low) and np.isfinite(high)):
        yield Finding(
            ("unknowns", name), "low and high, or a start that is not 0", "low: 1, high: 3", given="0 to start"
        )
    elif not low <= begin <= high:
        expected = f"a start between low and high: the number of the scene, {begin:g}, is not"
        yield Finding(("unknowns", name, "start"), expected)


def _moved(task: TaskFile[Design], at: Place, error: SceneError) -> SceneError:
    """What was refused of a scene, at a place of the design."""
    found = []
    for x in error.complaints:
        changed = task.asked.cases[str(at[1])] if at[0] == "cases" else {}
        place = (*at, x.where) if x.where in changed else at
        found.append(Finding(place, x.expected, x.fix, given=f"{x.where}: {x.value}"))
    return task.refusal(found)


def _result(task: TaskFile[Design], at: Place, asked: OfEquilibrium, take: str, scene: AnyScene) -> str:
    """A result as `hybrid.sensitivity` names it; SceneError: the scene has no such line or section."""
    if at[0] != "targets" and is_edge(scene, asked.quantity):
        fix = "a target, which takes it as it is"
        expected = "a result that changes evenly: where contact begins goes by the nodes that come to the bed"
        raise task.refusal([Finding((*at, "quantity"), expected, fix)])
    if (asked.line or "") not in scene.asked_lines:
        expected = "nothing: the scene has one line" if "" in scene.asked_lines else f"one of: {', '.join(scene.lines)}"
        raise task.refusal([Finding((*at, "line"), expected)])
    place = f"@sections[{asked.section}]" if asked.section is not None else ""
    if asked.at is not None:
        place = f"@{asked.at}" if isinstance(asked.at, str) else f"@{asked.at!r}"
    if asked.over is not None and scene.time is None:
        raise task.refusal([Finding((*at, "over"), "a scene with time, which says how long it moves, in which steps")])
    sections = cable_of(scene, asked.line).sections
    if asked.section is not None and asked.section >= len(sections):
        expected = f"a section of the line, which has {len(sections)}, counted from 0"
        raise task.refusal([Finding((*at, "section"), expected)])
    if asked.over is not None:
        if _has_places(asked) and asked.at is None and asked.over not in ("max", "min"):
            raise task.refusal([Finding((*at, "at"), f"the place whose {asked.over} is meant", "at: end")])
        return f"{asked.over} {of_line(asked.line or '')}{asked.quantity}{place}{IN_MOTION}"
    if _has_places(asked) and asked.at is None and not take:
        raise task.refusal([Finding((*at, "at"), "a place, or take: max or min along the line", "at: end")])
    if take and at[0] != "limits" and not _has_places(asked):
        raise task.refusal([Finding((*at, "take"), f"nothing: {asked.quantity} has one value for the whole line")])
    extreme = f"{take} " if _has_places(asked) and asked.at is None else ""
    return f"{extreme}{of_line(asked.line or '')}{asked.quantity}{place}"


def _has_places(asked: OfEquilibrium) -> bool:
    """Whether a quantity has a value at every place of a line."""
    name = asked.quantity.split(".")[0]
    return name in PROBES and "s" in PROBES[name].dims


def _pieces(task: TaskFile[Design], at: Place, asked: OfEquilibrium, take: str, scene: AnyScene) -> Iterable[str]:
    """The results that a limit holds, of all of a line one for each section.

    Their largest values change evenly where the largest of all jumps from one to another.
    """
    whole = _result(task, at, asked, take, scene)
    count = len(cable_of(scene, asked.line).sections)
    if asked.at is not None or asked.section is not None or count == 1 or not _has_places(asked):
        return [whole]
    return [_result(task, at, asked.model_copy(update={"section": k}), take, scene) for k in range(count)]


def cable_of(scene: AnyScene, line: str | None) -> Any:
    """The cable of a line; None: of the line without a name."""
    return scene.asked_lines[line or ""].cable


def refused_result(task: TaskFile[Design], error: SceneError) -> SceneError:
    """What was refused of results when they were first computed, at the table that asks for them."""
    found = []
    for x in error.complaints:
        places = [
            (table, name, "quantity")
            for table in ("targets", "limits", "results")
            for name, each in getattr(task.asked, table).items()
            if each.quantity == x.value
            or re.search(rf"(^|[ /]){re.escape(each.quantity)}($|@)", x.value)
            or each.quantity.split(".")[0] == x.value
        ]
        if x.where != "of" or not places:
            return error
        found.append(Finding(places[0], x.expected, x.fix))
    return task.refusal(found)


def as_asked(scene: Any, task: TaskFile[Design]) -> AnyScene:
    """The scene of a design; None: that of the file that it names."""
    return as_scene(task.asked.scene if scene is None else scene)


# Arithmetic of a design whose results are wanted and nothing is minimised; the output that has what is.
NOTHING, MINIMISED = "0", "minimised"


class Output(NamedTuple):
    """An output: rows of results (k,), its unit in our words, what it is, bounds and scale where it is a limit.

    low, high: equal for a target, infinite for none.
    """

    rows: np.ndarray
    unit: str
    text: str
    low: float = -np.inf
    high: float = np.inf
    scale: float = 1.0


class Input(NamedTuple):
    """An input: where it begins, its unit in our words, its keys, bounds."""

    start: float
    unit: str
    text: str
    low: float
    high: float


def refuse_ports(task: TaskFile[Design]) -> None:
    """SceneError: what was measured is no output, and OpenMDAO has names without dots, each once."""
    asked, found = task.asked, []
    if asked.measured is not None:
        found.append(Finding(("measured",), "results, limits or minimise: an identification has no outputs"))
    tables = ("unknowns", "results", "targets", "limits")
    taken = [MINIMISED]
    for table in tables:
        for name in getattr(asked, table):
            if not name.isidentifier():
                found.append(Finding((table, name), NAMED, f"length: {{key: {name}}}" if table == "unknowns" else ""))
            elif name in taken:
                found.append(Finding((table, name), f"a name of its own, none of {', '.join(taken)}"))
            taken.append(name)
    if found:
        raise task.refusal(found)


def inputs_of(problem: Problem, scene: AnyScene) -> dict[str, Input]:
    space, keys = problem.space, problem.equilibria.keys
    rows = zip(space.names, space.start.tolist(), keys, space.low.tolist(), space.high.tolist(), strict=True)
    return {
        name: Input(start, unit_of_key(scene, group[0]), ", ".join(group), low, high)
        for name, start, group, low, high in rows
    }


def outputs_of(problem: Problem, task: TaskFile[Design], scene: AnyScene) -> dict[str, Output]:
    """Outputs by name, in the order of the design."""
    out: dict[str, Output] = {}
    results = problem.objective.results if problem.objective is not None else {}
    for name, each in task.asked.results.items():
        out[name] = _output(problem, np.array([results[name]]), scene, each.quantity)
    bounded: Mapping[str, OfEquilibrium] = {**task.asked.targets, **task.asked.limits}
    for name, limit in bounded.items():
        own = [c for c in problem.constraints if c.name == name]
        rows = np.array([*dict.fromkeys(c.row for c in own)])
        low = max((c.bound for c in own if c.side <= 0), default=-np.inf)
        high = min((c.bound for c in own if c.side >= 0), default=np.inf)
        bare = _output(problem, rows, scene, limit.quantity)
        out[name] = bare._replace(low=low, high=high, scale=max(c.scale for c in own) or 1.0)
    return out


def _output(problem: Problem, rows: np.ndarray, scene: AnyScene, quantity: str) -> Output:
    wanted = [problem.equilibria.wanted[k] for k in rows]
    text = "; ".join(f"{result} ({case})" if case else result for case, result in wanted)
    name, own = quantity.split(".")[0], scene.output.quantities or {}  # of a scene, or of its output.quantities
    unit = PROBES[name].unit if name in PROBES else own[name].unit if name in own else ""
    return Output(rows, unit, text)
