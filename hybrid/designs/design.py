"""Numbers of a scene for which its equilibrium is what is asked: least of something, within limits, as measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.designs.case_results import FINER, IN_MOTION, AnyScene, Equilibria, Point
from hybrid.designs.identify import Apart, Estimate, Measurements, fit, measurements, quantity_of
from hybrid.designs.in_motion import refuse_edges
from hybrid.designs.nearest import Space
from hybrid.designs.numbers_and_results import scene_with, text_of_found
from hybrid.designs.optimum import SETTLED, Optimum, Price, is_active, optimum, reached
from hybrid.designs.problem import (
    NOTHING,
    Constraint,
    Problem,
    as_asked,
    begun,
    inputs_of,
    outputs_of,
    problem_of,
    refuse_ports,
    refused_result,
    scenes_of,
    space_of,
)
from hybrid.errors import ComputationError, Outcome, SceneError, optional_package
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.read import SceneLike, TaskFile
from hybrid.scene.study import DESIGN, Design

if TYPE_CHECKING:
    from hybrid.designs.openmdao_component import DesignComponent


# Parts of the largest that limits are beyond in the nearest that was found, from which one is said to be in the way.
IN_THE_WAY = 1e-3


@dataclass(frozen=True)
class Kept:
    """What a target or a limit came to.

    name, case, result: of which number; value: with the numbers found; bound: what it is to be, at most or least, by
    side (0, 1, -1); active: whether it is at its bound; price: by how much a unit more of it changes what is
    minimised (0 without); finer: the value on cells half as long, of a motion in such steps as well; None: there
    is no equilibrium on these.
    """

    name: str
    case: str
    result: str
    value: float
    bound: float
    side: int
    active: bool
    price: float
    finer: float | None

    @property
    def word(self) -> str:
        return {0: "value", 1: "largest", -1: "smallest"}[self.side]


@dataclass(frozen=True)
class AtBound:
    """An unknown at a bound of its own: `low` or `high`, and its price."""

    name: str
    which: str
    price: float


@dataclass(frozen=True)
class Found:
    """Numbers that were found.

    numbers, start: of unknowns, by name; kept: targets and limits; bounds: unknowns that are at one; minimised: its
    value, and where the search began (None: nothing is); equilibria: that were computed; runs: what those that were are
    worth, of `moving` cases; notes: what is doubtful.
    settled: whether what is minimised is least there; False: the search ended before, and a note says why.
    ways: by case in motion how slopes were found, of all unknowns alike: tangents, or differences of runs, and why.
    scene: with the numbers, without changes of cases; scenes: of each case; before, after: places of nodes (n, 3), m,
    by case and line, where a motion alone is asked of output points where it begins; bed: height of a level seabed, m,
    None: none; file: the scene file, "": none.
    """

    title: str
    numbers: Mapping[str, float]
    start: Mapping[str, float]
    kept: tuple[Kept, ...]
    bounds: tuple[AtBound, ...]
    minimised: float | None
    minimised_at_start: float | None
    equilibria: int
    runs: int
    moving: int
    notes: tuple[str, ...]
    keys: Mapping[str, tuple[str, ...]]
    scene: AnyScene
    scenes: Mapping[str, AnyScene]
    before: Mapping[str, Mapping[str, Floats]]
    after: Mapping[str, Mapping[str, Floats]]
    bed: float | None = None
    file: str = ""
    settled: bool = True
    ways: Mapping[str, str] = field(default_factory=dict)

    def scene_text(self, folder: str | Path | None = None) -> str:
        """The scene as YAML; where it was read from a file, and folder is its own, that text with other numbers."""
        return text_of_found(self.scene, self.file, self.keys, self.numbers, folder)


class MeasuredHistory(NamedTuple):
    """What was measured of a result over time t (m,), s, and what it is with numbers of the start and found (m,)."""

    case: str
    result: str
    unit: str
    t: Floats
    measured: Floats
    before: Floats
    after: Floats


@dataclass(frozen=True)
class Identified(Found):
    """Numbers that were found from what was measured.

    estimates: with standard deviations and 95 % intervals; correlations (n, n), NaN where not known; apart: what cannot
    be told apart; count: numbers that were measured; scatter: root mean square of what is left, in stated deviations
    (stated) or in the unit of what was measured; measured: places (m, 3), m, by case and line; histories: what was
    measured over time.
    """

    estimates: tuple[Estimate, ...] = ()
    correlations: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    apart: tuple[Apart, ...] = ()
    count: int = 0
    scatter: float = 0.0
    stated: bool = True
    measured: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)
    histories: tuple[MeasuredHistory, ...] = ()


def design(
    source: str | PathLike[str] | Mapping[str, Any] | SceneLike | Design,
    *,
    unknowns: Mapping[str, Any] | None = None,
    **more: Any,
) -> Found:
    """Find numbers of a scene for which its equilibrium, or its motion, is what is asked.

    source: the path of a design file; or, with `unknowns`, a scene, or its path.  unknowns and more (cases, results,
    targets, limits, minimise, measured, title): as the keys of a design file, docs/design.md.  What was measured gives
    an `Identified`.

    SceneError: the design or its scene is refused; ComputationError: there is no equilibrium where the search begins,
    or limits and targets cannot be kept together: it says which are in the way.
    """
    task, scene = task_of(source, unknowns, more)
    asked = as_asked(scene, task)
    file = task.asked.scene if scene is None else ""
    if task.asked.measured is not None:
        return _identified(task, asked, file)
    problem = problem_of(task, asked)
    try:
        problem = begun(problem)
    except SceneError as error:
        raise refused_result(task, error) from None
    return _solved(task, asked, problem, file)


def task_of(source: Any, unknowns: Mapping[str, Any] | None, more: Mapping[str, Any]) -> tuple[TaskFile[Design], Any]:
    """The design, and the scene that it is of; None: that of the file that it names."""
    if unknowns is None:
        if more:
            raise TypeError(f"{', '.join(more)}: without unknowns the source is a design file, which says it")
        if isinstance(source, Design):
            source = source.model_dump(exclude_none=True)
        if isinstance(source, Mapping):
            return DESIGN.of_data(source), None
        return DESIGN.read(source), None
    named = isinstance(source, str | PathLike)
    data = {"scene": str(source) if named else "scene", "unknowns": unknowns, **more}
    return DESIGN.of_data(data), None if named else source


def _solved(task: TaskFile[Design], asked: AnyScene, problem: Problem, file: str) -> Found:
    objective, first = problem.objective, problem.equilibria.point_of(problem.space.start)
    best = _reached(problem) if objective is None else optimum(problem, objective)
    point = best.point
    _refuse_what_fights(problem, point)
    notes, finer = _checked(problem, point)
    settled = not best.stopped and best.left <= SETTLED and not best.ran_off
    notes += [_ran_off(problem.space, k, point) for k in best.ran_off]
    if best.stopped:
        notes.append(f"the search ended where it could not go on, which is no optimum: {best.stopped}")
    elif best.left > SETTLED and not best.ran_off:
        notes.append(
            f"the search has not settled, and this is no optimum: {100 * best.left:.3g} % of the slopes of what is "
            "minimised are held up by no limit; give low and high of each unknown, another start, or more cells"
        )
    space, rows = problem.space, zip(problem.constraints, best.prices, strict=True)
    kept, common = (
        (_kept(c, price, point, finer) for c, price in rows),
        _common(task, asked, problem.equilibria, space, point, file),
    )
    least, before = (None if objective is None else objective.value(x) for x in (point, first))
    found = {"minimised": least, "minimised_at_start": before, "settled": settled, "notes": tuple(notes)} | common
    return Found(kept=tuple(kept), bounds=_at_bounds(space, best.bounds), **found)


def _ran_off(space: Space, k: int, point: Point) -> str:
    side = "high" if abs(point.x[k]) > abs(space.start[k]) else "low"
    return (
        f"{space.names[k]} ran off from {space.start[k]:.6g} to {point.x[k]:.6g} and could go on: this "
        f"is no optimum; give a {side} that can be built, or a limit that holds it"
    )


def _common(
    task: TaskFile[Design], asked: AnyScene, equilibria: Equilibria, space: Space, point: Point, file: str
) -> dict[str, Any]:
    """What a `Found` has whatever was asked."""
    motions, by_name = equilibria.motions, {"numbers": point.x.tolist(), "start": space.start.tolist()}
    by_name |= {"keys": equilibria.keys}
    found: dict[str, Any] = {key: dict(zip(space.names, x, strict=True)) for key, x in by_name.items()}
    found |= {"equilibria": equilibria.count, "runs": motions.count, "moving": len(motions.rows)}
    found |= {"scene": scene_with(asked, equilibria.keys, point.x), "ways": dict(motions.ways), "bed": _bed(asked)}
    found |= {"scenes": {case: equilibria.scene(case, point.x) for case in equilibria.scenes}, "file": file}
    shapes = {"before": equilibria.point_of(space.start).shapes(), "after": point.shapes()}
    return found | shapes | {"title": task.asked.title}


def _identified(task: TaskFile[Design], asked: AnyScene, file: str) -> Identified:
    measured = measurements(task, asked)
    scenes = scenes_of(task, asked)
    space, keys = space_of(task, asked, scenes)
    equilibria = Equilibria(scenes, keys, measured.wanted)
    point, found = fit(measured, equilibria, space)
    edges = _at_bounds(space, np.where(space.at_bounds(point.x), 0.0, np.nan))
    found |= {"measured": _places(measured, point), "bounds": edges}
    found |= {"histories": _histories(measured, equilibria.point_of(space.start), point)}
    found |= _common(task, asked, equilibria, space, point, file)
    return Identified(kept=(), minimised=None, minimised_at_start=None, **found)


def _at_bounds(space: Space, prices: Floats) -> tuple[AtBound, ...]:
    """Unknowns at their bounds, with the prices (n, 2) of these; NaN: not there."""
    at = np.argwhere(np.isfinite(prices)).tolist()
    return tuple(AtBound(space.names[i], ("low", "high")[k], float(prices[i, k])) for i, k in at)


def _places(measured: Measurements, point: Point) -> dict[str, dict[str, Floats]]:
    """Places that were measured, with coordinates of the line that was found where they were not."""
    out: dict[str, dict[str, Floats]] = {}
    for (case, name), (s, places) in measured.places.items():
        nodes, r = point.nodes(case, name), point.shapes()[case][name]
        found = np.stack([np.interp(s, nodes, r[:, k]) for k in range(3)], axis=1)
        seen = np.isfinite(places).any(axis=1)
        out.setdefault(case, {})[name] = np.where(np.isfinite(places), places, found)[seen]
    return out


def _histories(measured: Measurements, first: Point, point: Point) -> tuple[MeasuredHistory, ...]:
    """What was measured over time beside runs with the numbers at the start and found."""
    found = []
    for x in measured.histories:
        rows, unit = measured.rows[x.rows], PROBES[quantity_of(x.result)].unit
        values = measured.values[x.rows], first.values[rows], point.values[rows]
        found.append(MeasuredHistory(x.case, x.result, unit, x.t, *values))
    return tuple(found)


def _bed(scene: AnyScene) -> float | None:
    seabed = scene.environment.seabed
    return seabed.z if seabed is not None and seabed.is_level else None


def _reached(problem: Problem) -> Optimum:
    """Where targets and limits are kept, where nothing is minimised."""
    point = reached(problem, problem.space.start)
    prices = [Price(is_active(c, point, problem.within), 0.0) for c in problem.constraints]
    bounds = np.where(problem.space.at_bounds(point.x), 0.0, np.nan)
    return Optimum(point, tuple(prices), bounds, 0.0, "")


def _kept(c: Constraint, price: Price, point: Point, finer: Floats | None) -> Kept:
    value, by_cells = float(point.values[c.row]), None if finer is None else float(finer[c.row])
    return Kept(c.name, c.case, c.result, value, c.bound, c.side, price.active, price.price, by_cells)


def _refuse_what_fights(problem: Problem, point: Point) -> None:
    """ComputationError: what cannot be kept, by how much, and with which unknowns at their bounds."""
    off = [(c.off(point.values[c.row]), c) for c in problem.constraints]
    most = max((abs(x) for x, _ in off), default=0.0)
    if most <= problem.within.kept:
        return
    fights = sorted((x for x in off if abs(x[0]) > IN_THE_WAY * most), key=lambda x: -abs(x[0]))
    words = {0: "is to be", 1: "may be at most", -1: "has to be at least"}
    told = [
        f"{c.name}{f' ({c.case})' if c.case else ''}: {c.result} {words[c.side]} {c.bound:.6g}, and is "
        f"{point.values[c.row]:.6g}"
        for _, c in fights
    ]
    edges = np.any(problem.space.at_bounds(point.x), axis=1)
    named = zip(problem.space.names, point.x, edges, strict=True)
    at = [f"{name} = {x:.6g}{' (its bound)' if edge else ''}" for name, x, edge in named]
    what = "these cannot all be kept" if len(fights) > 1 else "this cannot be kept"
    detail = f"{what}; closest result: " + "; ".join(told) + ", with " + ", ".join(at)
    raise ComputationError(Outcome.NOT_REACHED, None, None, detail)


def _checked(problem: Problem, point: Point) -> tuple[list[str], Floats | None]:
    """What is broken on cells half as long, and results there; None: there is no equilibrium."""
    try:
        finer = problem.equilibria.point_of(point.x, FINER).values
    except ComputationError as error:
        first = str(error).splitlines()[0]
        return [f"not checked on twice the cells: {first}"], None
    notes = []
    for c in problem.constraints:
        off = abs(c.off(finer[c.row]))
        if off > problem.within.active and c.side != 0:
            place = f"{c.name}{f' ({c.case})' if c.case else ''}"
            change = abs(finer[c.row] - point.values[c.row])
            moves = c.result.endswith(IN_MOTION)
            where = "in a free run, with steps and cells half as long," if moves else "on twice the cells"
            notes.append(
                f"{place}: {where} {c.result} is {finer[c.row]:.6g}, {100.0 * off:.2g} % beyond its limit; "
                f"ask for a limit that is {change:.2g} tighter, or for more cells"
            )
    return notes, finer


# A design as a component of OpenMDAO: unknowns are its inputs, results its outputs, with exact derivatives.


def openmdao_component(
    source: str | PathLike[str] | Mapping[str, Any] | SceneLike | Design,
    *,
    unknowns: Mapping[str, Any] | None = None,
    driven: bool = False,
    **more: Any,
) -> DesignComponent:
    """A design as an `ExplicitComponent` of OpenMDAO.

    source, unknowns, more (cases, results, limits, targets, minimise): as of `hybrid.design`; results need no
    `minimise` here.  Inputs are the unknowns, by name; outputs are results, targets and limits by name, a limit with a
    value for each of its cases and sections, and what is minimised as `minimised`.  Units are those of the scene.
    driven: unknowns are design variables with their bounds, limits and targets constraints, what is minimised the
    objective.  Derivatives are exact at rest, of motions those of `hybrid.design`.

    Where there is no equilibrium it raises OpenMDAO's `AnalysisError`.  SceneError: the design or its scene is refused;
    ComputationError: there is no equilibrium where it begins; ResultError: OpenMDAO is not installed.
    """
    optional_package("openmdao.api", "a component of OpenMDAO", "openmdao")
    from hybrid.designs.openmdao_component import DesignComponent

    if unknowns is not None and more.get("results"):
        more.setdefault("minimise", NOTHING)
    task, scene = task_of(source, unknowns, more)
    refuse_ports(task)
    asked = as_asked(scene, task)
    refuse_edges(asked, [x.quantity for x in task.asked.targets.values()])  # a design takes them as they are
    problem = problem_of(task, asked)
    try:
        problem.equilibria.point_of(problem.space.start)
    except SceneError as error:
        raise refused_result(task, error) from None
    return DesignComponent(problem, inputs_of(problem, asked), outputs_of(problem, task, asked), driven)
