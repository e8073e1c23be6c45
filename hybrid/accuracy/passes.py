"""`run`, `static` and `resume`, each of which leaves one result, and all passes of a scene in motion.

run      integrate a scene over its duration
static   find its equilibrium
resume   continue a run

Passes are the pre-run, the result, the runs that its errors are estimated by, and finer results.  A result gets written
into it how wrong it may be, how finely it was computed, and what that took.

The result is computed first and is in its place before anything else is tried: what stops later, by Ctrl-C, a kill or a
failure, leaves it there, and the file says what is still to come (`Result.pending`).  `hybrid resume` makes up for it.
"""

from __future__ import annotations

import io
import json
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.accuracy.error_control import ErrorController, comparison_resolutions
from hybrid.accuracy.error_order import Errors, summary
from hybrid.accuracy.error_statistics import figures as extreme_figures
from hybrid.accuracy.line_errors import LineErrors
from hybrid.accuracy.model_choice import (
    CHOSEN,
    can_leave_bending_out,
    chosen_and_surveyed,
    may_touch,
    rods_instead_of_slack,
)
from hybrid.accuracy.refinement import (
    END_FORCE,
    WORTH_WRITING,
    FinerResult,
    Free,
    asked_quantities,
    asked_text,
    beside,
    figures,
    not_asked_text,
    sizes_of,
    times_the_cost,
)
from hybrid.accuracy.run_forecast import Budget
from hybrid.errors import ZONE_EVENTS, ComputationError, ResultError, SceneError
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import NAMED, ModelChoice, output_times, with_models
from hybrid.model.resolution import (
    follows_curvature,
    is_irregular,
    may_be_held,
    mesh_is_free,
    model_is_free,
    requested_accuracy,
    rubs_on_obstacles,
    wants_survey,
    zones_are_free,
)
from hybrid.scene.analysis import AdaptiveModel, missing_time
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.case import Case, CaseAtRest
from hybrid.simulation.first_use import compile_beside, kernels_of
from hybrid.simulation.mesh_survey import CELLS, STEPS
from hybrid.simulation.own_parts import RunPart, checked_parts, require_parts
from hybrid.simulation.progress import (
    ESTIMATION,
    PRE_RUN,
    RESULT,
    Listener,
    ProgressReporter,
    announce_compiling,
    interrupts,
    listener_of,
)
from hybrid.simulation.restart import Remaining, refused, remaining
from hybrid.simulation.run_sample import (
    END_FORCES,
    RunSample,
    Samples,
    at_all_points,
    damped_jolts,
    is_along,
    undersampled_end_forces,
)
from hybrid.store.format import Field, MemoryTarget, Target
from hybrid.store.hdf5_file import GROUP, check_target, locked
from hybrid.store.integrity import Tree
from hybrid.store.limits import EXTREME_ERRORS
from hybrid.store.reader import Result, open_result, written_result
from hybrid.store.records import not_converged_attribute
from hybrid.store.stored_rows import remove_rows
from hybrid.store.whole_file import LateFile
from hybrid.store.writer import Block, Happened, Others, Part, amend, may_be_amended
from hybrid.zones.manager import UserCriterion

if TYPE_CHECKING:
    from hybrid.accuracy.free_vibrations import LostBy

    Lost = Callable[[], LostBy]

UNITS = {"position": "m", "tension": "N", "curvature": "1/m", "bending_moment": "N m"}
UNITS |= {"right_tension": "N", "right_curvature": "1/m", "right_bending_moment": "N m"}
UNITS |= {"end_force_start": "N", "end_force_end": "N"}
CAUSES = {
    "mesh": "error by the mesh",
    "time": "error by the time step",
    "model": "error by neglected bending",
    "total": "error by all causes",
}


Added = dict[str, Others]  # attributes and events, by line


def write_errors(
    target: Path | io.BytesIO | LateFile, case: Case, control: ErrorController, cpu: float, before: Tree | None
) -> None:
    """Add errors, attributes and events of all lines to the complete result of a case.

    cpu: s, of all passes; before: as of `amend`.
    """

    @cache
    def lost() -> Mapping[str, LostBy]:
        from hybrid.accuracy.free_vibrations import lost_by_lines

        return lost_by_lines(case.scene, control.standing)

    added = dict[str, Others]()

    def of_all(_: Happened) -> Others:
        known = [attributes for attributes, _ in added.values()]
        keys = {x for each in known for x in each if x.startswith("error_")}
        largest: dict[str, str | float | int] = {x: max(float(each[x]) for each in known if x in each) for x in keys}
        largest |= {"effort_runs": len(control.runs), "effort_cpu": cpu}
        largest |= not_converged_attribute(control.lines[name].diverging for name in added)
        events = [(kind, f"line {name}: {text}") for name, (_, each) in added.items() for kind, text in each]
        return largest, [*control.notes, *events]

    parts = [_of_line(case, control, name, cpu, lost, added) for name in control.standing]
    amend(target, parts if "" in case.names.values() else [*parts, Part("", (), (), of_all)], before)


def _of_line(
    case: Case, control: ErrorController, name: str, cpu: float, lost: Callable[[], Mapping[str, LostBy]], added: Added
) -> Part:
    """What is added to the result of a line, and noted in `added` once its errors are written.

    cpu: s, of all passes; lost: finds what steps lose of free vibrations, by line.
    """
    line, result, scene = control.lines[name], control.standing[name], case.lines[name]
    errors = line.estimate.errors if line.estimate is not None else None
    attributes = effort(scene, line, result, cpu)
    fields = error_fields(result, errors) if errors is not None else []
    names = {x.name for x in fields}

    def blocks() -> Iterator[Block]:
        for cause, quantity, begin, values in errors.blocks() if errors is not None else ():
            full = f"errors/{cause}/{quantity}"
            if full in names:
                along = result.places.size and is_along(quantity)
                yield full, begin, at_all_points(values, result.places) if along else values

    called = case.names[name]  # a line without a name is the result itself

    def others(happened: Happened) -> Others:
        found, notes = known(scene, line, result, errors, happened, lambda: lost().get(name, {}))
        if line.asked is not None:
            of = [x.errors for x in line.statistics.values()] if line.irregular else [errors]
            each = figures(line.asked, [x for x in of if x is not None], result, line.scattered, line.extremes)
            found["accuracy_verdicts"] = json.dumps(each)
        added[name] = attributes | found, notes
        return attributes | found, notes if called else [*notes, *control.notes]

    return Part(f"{GROUP}/{called}" if called else "", fields, blocks(), others)


def effort(scene: LineScene, control: LineErrors, result: RunSample, cpu: float) -> dict[str, str | float | int]:
    """What was spent on a result, and what was asked, as its attributes; cpu: s, of all passes."""
    resolution = result.resolution
    attributes: dict[str, str | float | int] = {
        "effort_fineness": resolution.fineness,
        "effort_runs": len(control.runs),
        "effort_cpu": cpu,
        "effort_step": resolution.step,
    }
    if resolution.local is not None:
        attributes["effort_step_error"] = resolution.local
    if isinstance(scene.model, AdaptiveModel):
        attributes["effort_zones"] = resolution.zones
    if control.asked is not None:
        attributes["accuracy_asked"] = asked_text(control.asked, result)
        attributes["accuracy_quantities"] = asked_quantities(control.asked, result)
    return attributes


def known(
    scene: LineScene, control: LineErrors, result: RunSample, errors: Errors | None, happened: Happened, lost: Lost
) -> tuple[dict[str, float | str], list[tuple[str, str]]]:
    """The largest errors, as attributes, and events of a result.

    happened: its events until now; lost: finds what steps lose of free vibrations, by quantity.
    """
    undersampled: list[tuple[str, str]] = []
    if errors is not None and control.moves:
        largest = {name: errors.largest("total", name) for name in errors.fields.get("total", {})}
        changes = [t for t, kind in happened if kind in ZONE_EVENTS]
        undersampled = undersampled_end_forces(np.array([0.0, *output_times(scene)]), result, largest, changes)
        if control.asked is None or control.asked.asks(END_FORCE):
            error = max(largest.get(name, 0.0) for name in END_FORCES.values())
            undersampled += damped_jolts(scene, result, error, control.allowed_force)
        if not control.irregular:
            bounds = None if control.asked is None else sizes_of(control.asked, result)
            from hybrid.accuracy.free_vibrations import uncertain_by_vibrations

            undersampled += uncertain_by_vibrations(lost(), result, largest, bounds, control.length)
    found: dict[str, float | str] = {**summary(errors)} if errors is not None else {}
    if control.extremes is not None:
        found[EXTREME_ERRORS] = extreme_figures(control.extremes.run.extremes, control.extremes.errors)
    found |= not_converged_attribute([control.diverging])
    if errors is not None and control.asked is not None:
        beside = not_asked_text(control.asked, errors, result)
        found |= {"accuracy_not_asked": beside} if beside else {}
        found["accuracy_used"] = control.verdict(control.asked).ratio
    if control.irregular:
        each = [summary(estimate.errors) for estimate in control.statistics.values()]
        for name in each[0] if each else ():
            found[name.replace("error_", "error_extremes_", 1)] = max(x[name] for x in each)
    return found, [*dict(reversed(control.notes)).items(), *undersampled]


def error_fields(result: RunSample, errors: Errors) -> list[Field]:
    """Errors by cause and quantity."""
    return [
        Field(
            f"errors/{cause}/{name}",
            UNITS[name],
            f"{CAUSES[cause]} of {name.removeprefix('right_').replace('_', ' ')}"
            f"{' just after the point' * name.startswith('right_')}, estimated",
            (result.places[-1] + 1,) if result.places.size and is_along(name) else shape[1:],
            ("right/s" if name.startswith("right_") else "s",) if len(shape) == 2 else (),
        )
        for cause, quantities in errors.fields.items()
        for name, shape in quantities.items()
    ]


class Passes:
    """Computes a result and, where they are wanted, its errors."""

    def __init__(
        self, case: Case, target: Target, source: Path | None = None, remaining: Remaining[Any] | None = None
    ) -> None:
        """source, remaining: what to continue."""
        self.case, self.target, self.source, self.remaining = case, target, source, remaining
        self.control: ErrorController | None = None
        self._instead: ErrorController | None = None  # of the result in its place, which one of another model will take
        self._choices = dict[str, ModelChoice]()  # of lines whose model was chosen
        self._begin = clock.process_time()

    def compute(self) -> None:
        """All passes."""
        case, remaining = self.case, self.remaining
        resolution = NetworkResolution.of(case.lines) if remaining is None else remaining.resolution
        if not case.wants_errors:
            self._first(self._surveyed(resolution) if remaining is None else resolution, self.target)
            return
        target, kept = self.target, False
        assert not isinstance(target, MemoryTarget)
        case.beside_result = target if isinstance(target, Path) else None
        try:
            self._write(self._to_the_end(resolution, target))
        except KeyboardInterrupt:
            standing = self._standing()
            if standing is not None and case.moves:
                standing.without_refinement("a finer run was stopped from outside")
                self._write(standing, done=False)
            self._place()
            kept = self.control is not None and isinstance(target, Path) and target.exists()  # it can be resumed
            raise
        finally:
            self._place()
            if isinstance(target, Path) and not kept:
                remove_rows(target)

    def _place(self) -> None:
        """What is complete is on the disk: a finer result too, beside the other one."""
        for late in (self.case.late_file, self.case.late_finer):
            if late is not None:
                late.place()

    def _to_the_end(self, resolution: NetworkResolution, target: Path | io.BytesIO) -> ErrorController:
        """The result, as fine as it takes, and its errors; with rods where catenaries that were chosen do not do."""
        case, remaining = self.case, self.remaining
        compute = FinerResult(target, self._first, self._finer, case.decide, goes_on=case.moves)
        if remaining is not None and remaining.before:
            control = self._controls(compute)
            with refused(self.source or Path()):
                control.restore(remaining.before, self.source, resolution)
            case.places |= {name: x.places for name, x in control.lines.items() if x.places is not None}
            proceed = control.proceed
        else:
            resolution = self._surveyed(resolution) if remaining is None else resolution
            control = self._controls(compute)
            first = resolution

            def proceed() -> None:
                control.start(first)

        tried = control.chosen
        try:
            proceed()
            failed = {name: x.model_misses for name, x in control.lines.items() if name in tried and x.model_misses}
            if not failed:
                return control
            self._instead = self._standing()
        except ComputationError as error:
            name = error.line_name or next(iter(case.lines))
            if name not in tried:
                raise
            failed = {name: str(error).splitlines()[0]}
            if case.late_file is not None:
                case.late_file.drop()
                case.late_file = None
            emptied(target, error)
            anew = lambda finely, to: case.record(finely, to, self._result_of())  # noqa: E731  # of another model
            compute = FinerResult(target, anew, self._finer, case.decide, goes_on=case.moves)
        why = "catenaries, which cost less, were tried: "
        self._choices = {name: x.choice for name, x in control.lines.items() if x.choice.kind}
        self._choices |= {name: ModelChoice("rod", why + text) for name, text in failed.items()}
        case.scene = case.with_models({name: "rod" for name in failed})
        more, resolution = chosen_and_surveyed(case, NetworkResolution.of(case.lines), self._choices)
        self._choices |= more
        control = self._controls(compute)
        control.start(resolution)
        return control

    # --- results --------------------------------------------------------------------------------

    def _first(self, resolution: NetworkResolution, to: Target) -> Samples:
        """The first result, or the rest of it."""
        if self.remaining is None or self.remaining.anew or self.source is None or not isinstance(to, Path):
            return self.case.record(resolution, to, self._result_of())
        return self.case.resume(self.source, to, self._result_of())

    def _finer(self, resolution: NetworkResolution, to: Path | io.BytesIO) -> Samples:
        """A finer result beside the one that is there, or the rest of it."""
        self._stands(resolution)
        if isinstance(to, Path) and self.case.moves and self.case.is_unfinished(to, resolution):
            return self.case.resume(to, to, self._result_of())
        return self.case.record(resolution, to, self._result_of())

    def _standing(self) -> ErrorController | None:
        """That of the result in its place; None: its errors are not known yet."""
        return self.control if self.control is not None and self.control.known else self._instead

    def _stands(self, finer: NetworkResolution) -> None:
        """A finer run begins: the errors of the result in its place are written now, if that takes long."""
        standing = self._standing()
        if standing is None or not standing.known:
            return
        run = next(iter(standing.standing.values()))
        if run.cpu * times_the_cost(run.resolution, finer.one) > WORTH_WRITING:
            self._write(standing, done=False)

    def _result_of(self) -> Tree:
        return self.control.checkpoint() if self.control is not None else {}

    def _complete(self) -> Path | io.BytesIO | LateFile:
        """The result, which nothing is to be done to but to add its errors."""
        case, target = self.case, self.target
        assert not isinstance(target, MemoryTarget)
        if case.late_file is not None and may_be_amended(case.late_file):
            return case.late_file
        case.late_file = None  # they go into the file alone
        return target

    def _write(self, control: ErrorController, done: bool = True) -> None:
        cpu = clock.process_time() - self._begin
        write_errors(self._complete(), self.case, control, cpu, {} if done else control.compared)

    # --- how finely -----------------------------------------------------------------------------

    def _controls(self, compute: FinerResult) -> ErrorController:
        """What chooses how finely the case is computed from now on."""
        case = self.case
        lines = {name: self._errors_of(name, scene) for name, scene in case.lines.items()}
        times = output_times(case.lines[next(iter(lines))]) if case.moves else []
        budget = Budget(len(times), sum(x.s.size for x in case.points.values())) if case.moves else None
        self.control = ErrorController(lines, case, compute, compute.decide, budget)
        return self.control

    def _errors_of(self, name: str, scene: LineScene) -> LineErrors:
        """What will be known of the errors of a line."""
        case, held = self.case, may_be_held(scene)
        times, free = output_times(scene) if case.moves else [], free_in(scene)
        free = free if case.moves else free._replace(steps=False)
        asked, irregular = requested_accuracy(scene), case.moves and is_irregular(scene)
        how = self._choices.get(name, NAMED), case.from_rest, rubs_on_obstacles(scene), np.array([0.0, *times])
        return LineErrors(asked, free, case.moves, irregular, *how, scene.length, held)

    def _surveyed(self, resolution: NetworkResolution) -> NetworkResolution:
        """Models, of lines whose scene names none, and cells by a pre-run, if an accuracy is asked for."""
        case, asked = self.case, self.case.scene
        if case.moves:
            surveyed = any(wants_survey(x) for x in case.lines.values())
            passes = [(PRE_RUN, resolution.coarser(CELLS, STEPS).one)] if surveyed else []
            passes += [(RESULT, resolution.one)]
            if case.wants_errors:
                finely = comparison_resolutions(resolution, moves=True)
                passes += [(ESTIMATION, x.one) for x in finely]
                named = (x for x in case.scene.lines.values() if x.model is not None)
                own = may_touch(case.scene)
                rods = replace((resolution if own else finely[0]).one, fineness=1.0)  # on nodes that are given
                passes += [(ESTIMATION, rods)] * any(can_leave_bending_out(x) for x in named)
            case.progress.expect(passes, resolution.one)
        self._choices, found = chosen_and_surveyed(case, resolution)
        if case.scene is not asked and case.moves:
            compile_beside(case.scene)
        return found


def free_in(scene: LineScene) -> Free:
    """What the scene leaves to the program."""
    time = scene.time
    steps = time is not None and time.controlled and time.tolerance is None
    # where cells follow the curvature its share decides kinds, and the tolerance cells as well: both stay
    follows = follows_curvature(scene)
    return Free(mesh_is_free(scene), steps, zones_are_free(scene) and not follows, follows)


def emptied(target: Target, error: ComputationError | None = None) -> None:
    """Drop what a run has left that is made again with another model; error: with which it failed."""
    if isinstance(target, io.BytesIO):
        target.seek(0)
        target.truncate()
    left = [target, target.with_suffix(".snapshot.npz")] if isinstance(target, Path) else []
    for path in [*left, *([] if error is None or error.snapshot is None else [error.snapshot])]:
        path.unlink(missing_ok=True)


# --- the functions that compute ----------------------------------------------------------------

# Why there is nothing that a criterion could ask for.
NO_ZONES = "a criterion is for zones that move: the scene's model is not adaptive"


def run(
    scene: SceneLike,
    output: str | Path | None = None,
    *,
    progress: bool | Listener = False,
    overwrite: bool = True,
    criterion: UserCriterion | None = None,
    parts: Sequence[RunPart] = (),
) -> Result:
    """Integrate a scene over its duration.

    scene: a Scene, the path of a scene file, or a dict of its tables.  output: the HDF5 file to
    write; None keeps the result in memory.  progress: True for a line on the error stream, or a function that gets a
    `hybrid.simulation.progress.Progress` about ten times a second.  overwrite: replace an existing result (never
    another program's file).  criterion: for zones that move, one more: it gets a `hybrid.NodeState` at every step and
    gives a number (N+1,) per node, 1 or more where the cable must be a rod; of several lines each such one is asked.
    parts: of the run, of one's own (`hybrid.RunPart`), such as one that stops a winch.

    Raises SceneError when the scene is refused, ResultError when the output cannot be written, and ComputationError
    when the computation stops; what was computed until then is in the file, and the last good state beside it.
    """
    scene = as_scene(scene)
    if scene.time is None:
        raise SceneError([missing_time()])
    _check(scene, criterion)
    case = Case(scene, criterion)
    case.parts = checked_parts(parts)
    free = [name for name in scene.lines if criterion is None and model_is_free(scene.asked_scene(name))]
    compile_beside(with_models(scene, dict.fromkeys(free, "rod")))  # most often chosen: they compile the least
    target = _target(output, overwrite, case.wants_errors)
    with locked(_path(output)), _supervised(case, progress):
        if isinstance(target, Path):
            beside(target).unlink(missing_ok=True)  # of a run that was cut off
        while True:
            try:
                Passes(case, target).compute()
                break
            except ComputationError as error:
                instead = rods_instead_of_slack(case.scene, error)
                if instead is None:
                    raise
                emptied(target, error)
                case.progress.begin_anew()
                case.scene, case.late_file, case.late_finer = instead.scene, None, None
                case.notes.append((CHOSEN, instead.text))
    return written_result(target, case.late_file)


def static(scene: SceneLike, output: str | Path | None = None, *, overwrite: bool = True) -> Result:
    """Find the equilibrium of a scene at t = 0 under its full loads; the result has one output.

    scene, output, overwrite and errors: as of `run`.
    """
    scene = as_scene(scene)
    _check(scene)
    compile_beside(scene, static=True)
    case = CaseAtRest(scene)
    target = _target(output, overwrite, case.wants_errors)
    with locked(_path(output)):
        if isinstance(target, Path):
            beside(target).unlink(missing_ok=True)
        Passes(case, target).compute()
    return written_result(target)


def resume(
    source: str | Path,
    output: str | Path | None = None,
    *,
    until: float | None = None,
    settings: Sequence[str] = (),
    start: float | None = None,
    progress: bool | Listener = False,
    criterion: UserCriterion | None = None,
    parts: Sequence[RunPart] = (),
) -> Result:
    """Continue a run that was cut off, from the last checkpoint in its file; or beyond its end, or with other loads.

    What comes out is, to the last bit, what the run would have been had it not been stopped (but for processor
    times).  output: another file; None: the same.  until: s, a later end.  settings: changes such as
    ``environment.fluid.current=[0.5, 0, 0]`` (currents, waves, and what moves and loads the ends) from `start` (s) on;
    None: from the checkpoint; before it the run is computed anew, into another file.  criterion, parts: as `run` was
    given.

    Raises ResultError when there is nothing to continue or the file is another program's, and else as `run`.
    """
    if not isinstance(source, str | Path):
        raise TypeError(
            f"resume: expected the path of a result file, found {type(source).__name__}; a Result has `.file`"
        )
    path = Path(source).expanduser().resolve()
    target = _path(output) or path
    if not path.is_file():
        open_result(path)  # which says what is there instead
    if target != path:
        check_target(target, True)
    with locked(path), locked(target if target != path else None):
        left, parts = remaining(path, until, settings, start), checked_parts(parts)
        require_parts(parts, left.parts, path)
        if left.anew and target == path:
            why = "a change before the checkpoint computes the run anew"
            raise ResultError(f"{path} would be replaced\n    detail:   {why}\n    try:      another name with -o")
        _check(left.scene, criterion)
        case = Case(left.scene, criterion, left.changes, left.points)
        case.unasked, case.parts = left.unasked, parts
        with _supervised(case, progress):
            Passes(case, target, path, left).compute()
    return written_result(target, case.late_file)


def first_at_rest(scene: Any) -> tuple[Any, NetworkResolution]:
    """How finely the equilibrium of a scene is computed first, and the scene, with models where it leaves them open."""
    _check(scene)
    case = CaseAtRest(scene)
    _, found = chosen_and_surveyed(case, NetworkResolution.of(case.lines))
    return case.scene, found


def _check(scene: Any, criterion: UserCriterion | None = None) -> None:
    """SceneError: its motions are none; TypeError: there is nothing that a criterion could ask for."""
    if criterion is not None and not scene.adaptive:
        raise TypeError(NO_ZONES)


def _path(output: str | Path | None) -> Path | None:
    """Where a result goes; ResultError for a device or a pipe, which would be replaced by a file, or block."""
    if output is None:
        return None
    path = Path(output).expanduser().resolve()
    if path.exists() and not (path.is_file() or path.is_dir()):
        why = "is no regular file (a device, pipe or socket)"
        raise ResultError(f"{path} {why}\n    try:      the name of a file, such as run.h5; in Python, None for memory")
    return path


def _target(output: str | Path | None, overwrite: bool, amended: bool) -> Target:
    """Where the result goes; ResultError, before anything is computed, if it cannot go there.

    amended: whether it is changed when it is complete: a result in memory is then that of a file.
    """
    path = _path(output)
    if path is None:
        return io.BytesIO() if amended else MemoryTarget()
    check_target(path, overwrite)
    return path


@contextmanager
def _supervised(case: Case, progress: bool | Listener) -> Iterator[None]:
    """Hear of interrupts, and report the progress, until a run is done."""
    duration, listener = case.scene.require_time().duration, listener_of(progress)
    if listener is not None:
        announce_compiling(listener, kernels_of(case.scene))
    with interrupts() as interrupted, ProgressReporter(listener, duration) as reporter:
        case.progress, case.interrupted = reporter, interrupted
        yield
