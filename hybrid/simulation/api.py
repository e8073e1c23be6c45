"""What people call: computes a scene, as often as its accuracy takes, and leaves one file.

run      integrate a scene over its duration
static   find its equilibrium
"""

from __future__ import annotations

import io
import os
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from hybrid.adapt.manager import UserCriterion
from hybrid.errors import ResultError, SceneError
from hybrid.model.resolution import (
    Resolution,
    first_resolution,
    mesh_is_free,
    requested_accuracy,
    wants_errors,
    zones_are_free,
)
from hybrid.scene.motion_checks import check_motions
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.schema import AdaptiveModel, Scene, missing_time
from hybrid.simulation.case import Case
from hybrid.simulation.error_control import ErrorController, comparison_resolutions
from hybrid.simulation.error_estimate import Errors, RunSample, summary
from hybrid.simulation.mesh_survey import survey_resolution
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, RESULT, Listener, ProgressReporter, listener_of
from hybrid.simulation.refinement import Free
from hybrid.simulation.restart import Remainder, remainder
from hybrid.simulation.restore import refused
from hybrid.simulation.undersampling import undersampled_end_forces
from hybrid.store.format import Field
from hybrid.store.lock import locked
from hybrid.store.named_arrays import Tree
from hybrid.store.reader import Result, open_result
from hybrid.store.writer import amend, check_target

Record = Callable[[Resolution, Path | io.BytesIO], RunSample]


def run(
    scene: SceneLike,
    output: str | Path | None = None,
    *,
    progress: bool | Listener = False,
    overwrite: bool = True,
    criterion: UserCriterion | None = None,
) -> Result:
    """Integrate a scene over its duration.

    scene: a Scene, the path of a scene file, or a dict of its tables.  output: the HDF5 file to write; None keeps the
    result in memory.  progress: True for a line on the error stream, or a function that gets a
    `hybrid.simulation.progress.Progress` about ten times a second.  overwrite: replace an
    existing result (never another program's file).  criterion: for zones that move, one more: it gets a
    `hybrid.NodeState` at every step and gives a number (N+1,) per node, 1 or more where the cable must be a rod.

    Raises SceneError when the scene is refused and ComputationError when the computation
    stops; what was computed until then is in the file, and the last good state beside it.
    """
    scene = as_scene(scene)
    if scene.time is None:
        raise SceneError([missing_time(scene)])
    check_motions(scene)
    if scene.solver == "shooting":
        from hybrid.simulation.arbiter import run_shooting

        with locked(_path(output)):
            return run_shooting(scene, output, overwrite)
    if criterion is not None and not isinstance(scene.model, AdaptiveModel):
        raise TypeError("a criterion is for zones that move: the scene's model is not adaptive")
    case, target = Case(scene, criterion), _target(output, overwrite)
    with locked(_path(output)), _working(case, progress):
        if isinstance(target, Path):
            _beside(target).unlink(missing_ok=True)  # of a run that was cut off
        _run(case, target)
    return open_result(target)


def resume(
    source: str | Path,
    output: str | Path | None = None,
    *,
    until: float | None = None,
    settings: Sequence[str] = (),
    start: float | None = None,
    progress: bool | Listener = False,
    criterion: UserCriterion | None = None,
) -> Result:
    """Go on with a run that was cut off, from the last checkpoint in its file; or beyond its end, or with other loads.

    What comes out is, to the last bit, what the run would have been had it not been stopped (but for processor
    times).  output: another file; None: the same.  until: s, a later end.  settings: changes such as
    ``environment.fluid.current=[0.5, 0, 0]`` (currents, waves, and what moves and loads the ends) from `start` (s) on;
    None: from the checkpoint; before it the run is computed anew, into another file.  criterion: as `run` was given.

    Raises ResultError when there is nothing to go on with or the file is another program's, and else as `run`.
    """
    path = Path(source).expanduser().resolve()
    target = path if output is None else Path(output).expanduser().resolve()
    if not path.is_file():
        open_result(path)  # which says what is there instead
    if target != path:
        check_target(target, True)
    with locked(path), locked(target if target != path else None):
        left = remainder(path, until, settings, start)
        if left.anew and target == path:
            why = "a change before the checkpoint computes the run anew"
            raise ResultError(f"{path} would be replaced\n    detail:   {why}\n    try:      another name with -o")
        case = Case(left.scene, criterion, left.changes)
        with _working(case, progress):
            _run(case, target, path, left)
    return open_result(target)


def _run(case: Case, target: Path | io.BytesIO, source: Path | None = None, left: Remainder | None = None) -> None:
    """Compute a result, and its errors if they are wanted; source, left: what to go on with."""
    scene, begin = case.scene, clock.process_time()
    assert scene.time is not None
    anew = left is None or left.anew
    control: ErrorController | None = None

    def first(resolution: Resolution, to: Path | io.BytesIO) -> RunSample:
        if anew or source is None or isinstance(to, io.BytesIO):
            return case.record(resolution, to, kept())
        return case.go_on(source, to, kept())

    def later(resolution: Resolution, to: Path | io.BytesIO) -> RunSample:
        if isinstance(to, Path) and case.goes_on(to, resolution):  # one that was cut off
            return case.go_on(to, to, kept())
        return case.record(resolution, to, kept())

    def kept() -> Tree:
        return control.checkpoint() if control is not None else {}

    resolution = first_resolution(scene) if left is None else left.resolution
    if not wants_errors(scene):
        first(resolution, target)
        return
    compute = _kept(target, first, later)
    try:
        control = ErrorController(requested_accuracy(scene), _free(scene), True, case.sample, compute)
        if left is not None and left.before:
            with refused(source or Path()):
                control.restore(left.before, scene)
            final, errors = control.proceed()
        else:
            surveys = left is None and requested_accuracy(scene) is not None
            _expect(case, resolution, surveys and mesh_is_free(scene))
            if surveys:
                resolution = replace(resolution, grading=case.survey(resolution))
            final, errors = control.start(resolution)
    except KeyboardInterrupt:
        if control is not None and control.estimate is not None:
            # stopped in a finer run: the result before it stands, with its figure
            final, errors = control.without_refinement("a finer run was stopped from outside")
            _amend(target, scene, final, errors, control, clock.process_time() - begin, done=False)
        raise
    _amend(target, scene, final, errors, control, clock.process_time() - begin)


def _free(scene: Scene) -> Free:
    """What the scene leaves to the program."""
    time = scene.time
    steps = time is not None and time.controlled and time.tolerance is None
    return Free(mesh_is_free(scene), steps, zones_are_free(scene))


def _expect(case: Case, resolution: Resolution, surveys: bool) -> None:
    """Tell the progress which passes are to come: surveys, whether the first looks how the cable bends."""
    passes = [(PRE_RUN, survey_resolution(resolution))] if surveys else []
    passes += [(ESTIMATION, x) for x in comparison_resolutions(resolution, moves=True)]
    case.progress.expect([*passes, (RESULT, resolution)], resolution)


@contextmanager
def _working(case: Case, progress: bool | Listener) -> Iterator[None]:
    """Hear of interrupts, and tell of the progress, until a run is done."""
    assert case.scene.time is not None
    listener = listener_of(progress)
    with _interrupts() as interrupted, ProgressReporter(listener, case.scene.time.duration) as reporter:
        case.progress, case.interrupted = reporter, interrupted
        yield


def static(scene: SceneLike, output: str | Path | None = None, *, overwrite: bool = True) -> Result:
    """Find the equilibrium of a scene at t = 0 under its full loads; the result has one output.

    scene, output, overwrite and errors: as of `run`.
    """
    scene = as_scene(scene)
    check_motions(scene)
    if scene.solver == "shooting":
        from hybrid.simulation.arbiter import static_shooting

        with locked(_path(output)):
            return static_shooting(scene, output, overwrite)
    case, begin = Case(scene, None), clock.process_time()
    target, resolution = _target(output, overwrite), first_resolution(scene)
    with locked(_path(output)):
        if not wants_errors(scene):
            case.record_equilibrium(resolution, target)
            return open_result(target)
        compute = _kept(target, case.record_equilibrium, case.record_equilibrium)
        free = _free(scene)._replace(steps=False)
        control = ErrorController(requested_accuracy(scene), free, False, case.sample_equilibrium, compute)
        final, errors = control.start(resolution)
        _amend(target, scene, final, errors, control, clock.process_time() - begin)
    return open_result(target)


def _kept(target: Path | io.BytesIO, first: Record, later: Record) -> Callable[[Resolution], RunSample]:
    """Record results one after the other: a finer one takes the place of that before it when it is complete."""
    done = False

    def compute(resolution: Resolution) -> RunSample:
        nonlocal done
        if not done:
            found, done = first(resolution, target), True
            return found
        if isinstance(target, io.BytesIO):
            new = io.BytesIO()
            found = later(resolution, new)
            target.seek(0)
            target.truncate()
            target.write(new.getvalue())
            return found
        beside = _beside(target)
        try:
            found = later(resolution, beside)
            os.replace(beside, target)
        finally:
            for left in (beside, beside.with_suffix(".snapshot.npz")):
                left.unlink(missing_ok=True)
        return found

    return compute


def _amend(
    target: Path | io.BytesIO, scene: Scene, final: RunSample, errors: Errors | None, control: ErrorController,
    cpu: float, done: bool = True,
) -> None:  # fmt: skip
    """Write how wrong a result may be, how finely it was computed, and what went into that, into its file.

    done: nothing is left to go on with; else the file keeps what a finer result goes on from.
    """
    resolution = final.resolution
    attributes: dict[str, str | float | int] = {
        "effort_fineness": resolution.fineness, "effort_runs": len(control.runs),
        "effort_cpu": cpu, "effort_step": resolution.step,
    }  # fmt: skip
    if resolution.local is not None:
        attributes["effort_step_error"] = resolution.local
    if isinstance(scene.model, AdaptiveModel):
        attributes["effort_zones"] = resolution.zones
    if control.asked is not None:
        attributes["accuracy_asked"] = control.asked.text
    fields: list[tuple[Field, np.ndarray]] = []
    if errors is not None:
        attributes |= summary(errors)
        for kind, quantities in errors.fields.items():
            for name, values in quantities.items():
                unit, dims = UNITS_OF_ERRORS[name], ("s",) if values.ndim == 2 else ()
                text = f"{WORDS_OF_ERRORS[kind]} of {name.replace('_', ' ')}, estimated"
                if kind == "model" and final.model_error:
                    continue  # the run has written it itself
                fields.append((Field(f"errors/{kind}/{name}", unit, text, values.shape[1:], dims), values))
    with open_result(target) as result:
        total = errors.fields.get("total", {}) if errors is not None and control.moves else {}
        undersampled = undersampled_end_forces(result, total)
    amend(target, fields, attributes, [*dict(reversed(control.notes)).items(), *undersampled], done)


UNITS_OF_ERRORS = {
    "position": "m", "tension": "N", "curvature": "1/m", "bending_moment": "N m",
    "end_force_start": "N", "end_force_end": "N",
}  # fmt: skip
WORDS_OF_ERRORS = {
    "mesh": "error by the mesh", "time": "error by the time step", "model": "error by bending that is left out",
    "total": "error by all causes",
}  # fmt: skip


def _beside(target: Path) -> Path:
    """Where a finer result is computed, until it is complete."""
    return target.with_name(f".{target.name}.finer")


def _path(output: str | Path | None) -> Path | None:
    return None if output is None else Path(output).expanduser().resolve()


def _target(output: str | Path | None, overwrite: bool) -> Path | io.BytesIO:
    """Where the result goes; ResultError, before anything is computed, if it cannot go there."""
    path = _path(output)
    if path is None:
        return io.BytesIO()
    check_target(path, overwrite)
    return path


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Catch Ctrl-C and SIGTERM as a flag, so that a run ends between two steps and its file is whole."""
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    seen: list[int] = []
    before = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        before[number] = signal.signal(number, lambda got, _frame: seen.append(got))
    try:
        yield lambda: bool(seen)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
