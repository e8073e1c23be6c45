"""The functions of this package that compute: each leaves one result, in a file or in memory.

run      integrate a scene over its duration
static   find its equilibrium
resume   continue a run
"""

from __future__ import annotations

import io
import time as clock
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hybrid.accuracy.error_control import ErrorController
from hybrid.accuracy.error_report import write_errors
from hybrid.accuracy.finer_result import FinerResult, beside
from hybrid.accuracy.model_choice import surveyed
from hybrid.accuracy.passes import Passes, emptied, free_in
from hybrid.accuracy.rods_where_slack import CHOSEN, rods_instead_of_slack, rods_of_system
from hybrid.adapt.user_criterion import UserCriterion
from hybrid.errors import ComputationError, ResultError, SceneError
from hybrid.model.model_costs import NAMED, REST, ModelChoice, with_model
from hybrid.model.resolution import (
    Resolution,
    first_resolution,
    model_is_free,
    requested_accuracy,
    wants_errors,
    wants_survey,
)
from hybrid.scene.motion_checks import check_motions
from hybrid.scene.read import SceneLike, as_scene, scene_text
from hybrid.scene.schema import AdaptiveModel, LineScene, missing_time
from hybrid.simulation.case import Case
from hybrid.simulation.first_use import compile_beside, kernels_of
from hybrid.simulation.interrupts import interrupts
from hybrid.simulation.layer_mesh import layered
from hybrid.simulation.progress import (
    Listener,
    ProgressReporter,
    listener_of,
    tell_of_compiling,
)
from hybrid.simulation.restart import Remaining, remaining
from hybrid.simulation.static_case import StaticCase
from hybrid.store.array_recorder import MemoryTarget, Target
from hybrid.store.hdf5_file import check_target
from hybrid.store.lock import locked
from hybrid.store.reader import Result, open_result, written_result

if TYPE_CHECKING:
    from hybrid.scene.network_scene import Network

# Why there is nothing that a criterion could ask for.
NO_ZONES = "a criterion is for zones that move: the scene's model is not adaptive"


def run(
    scene: SceneLike,
    output: str | Path | None = None,
    *,
    progress: bool | Listener = False,
    overwrite: bool = True,
    criterion: UserCriterion | None = None,
) -> Result:
    """Integrate a scene over its duration.

    scene: a Scene, the path of a scene file, or a dict of its tables.  output: the HDF5 file to
    write; None keeps the result in memory.  progress: True for a line on the error stream, or a function that gets a
    `hybrid.simulation.progress.Progress` about ten times a second.  overwrite: replace an existing result (never
    another program's file).  criterion: for zones that move, one more: it gets a `hybrid.NodeState` at every step and
    gives a number (N+1,) per node, 1 or more where the cable must be a rod; of several lines each such one is asked.

    Raises SceneError when the scene is refused, ResultError when the output cannot be written, and ComputationError
    when the computation stops; what was computed until then is in the file, and the last good state beside it.
    """
    scene = as_scene(scene)
    if scene.time is None:
        raise SceneError([missing_time()])
    if not isinstance(scene, LineScene):
        return _several_lines(scene, output, overwrite, progress, criterion)
    check_motions(scene)
    if criterion is not None and not isinstance(scene.model, AdaptiveModel):
        raise TypeError(NO_ZONES)
    chosen = criterion is None and model_is_free(scene)  # most often rods, which need least to be compiled
    compile_beside(with_model(scene, "rod") if chosen else scene)
    case, target = Case(scene, criterion), _target(output, overwrite, wants_errors(scene))
    with locked(_path(output)), _supervised(case, progress):
        if isinstance(target, Path):
            beside(target).unlink(missing_ok=True)  # of a run that was cut off
        try:
            Passes(case, target).compute()
        except ComputationError as error:
            instead = rods_instead_of_slack(scene, error)
            if instead is None:
                raise
            emptied(target, error)
            case.progress.begin_anew()
            case.scene, case.late_file, case.late_finer = instead.scene, None, None
            case.notes.append((CHOSEN, instead.text))
            Passes(case, target).compute()
    return written_result(target, case.late_file)


def static(scene: SceneLike, output: str | Path | None = None, *, overwrite: bool = True) -> Result:
    """Find the equilibrium of a scene at t = 0 under its full loads; the result has one output.

    scene, output, overwrite and errors: as of `run`.
    """
    scene = as_scene(scene)
    if not isinstance(scene, LineScene):
        return _several_lines(scene, output, overwrite, moves=False)
    check_motions(scene)
    compile_beside(scene, static=True)
    case, begin = StaticCase(scene), clock.process_time()
    target, resolution = _target(output, overwrite, wants_errors(scene)), first_resolution(scene)
    with locked(_path(output)):
        choice, resolution = _surveyed_at_rest(case, resolution)
        scene = case.scene
        if not wants_errors(scene):
            case.record(resolution, target)
            return written_result(target)
        assert not isinstance(target, MemoryTarget)
        compute = FinerResult(target, case.record, case.record)
        free = free_in(scene)._replace(steps=False)
        control = ErrorController(
            requested_accuracy(scene), free, False, case.sample, compute, choice=choice, settle=compute.settle
        )
        result, errors = control.start(resolution)
        write_errors(target, scene, control, result, errors, clock.process_time() - begin)
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
) -> Result:
    """Continue a run that was cut off, from the last checkpoint in its file; or beyond its end, or with other loads.

    What comes out is, to the last bit, what the run would have been had it not been stopped (but for processor
    times).  output: another file; None: the same.  until: s, a later end.  settings: changes such as
    ``environment.fluid.current=[0.5, 0, 0]`` (currents, waves, and what moves and loads the ends) from `start` (s) on;
    None: from the checkpoint; before it the run is computed anew, into another file.  criterion: as `run` was given.

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
        left = remaining(path, until, settings, start)
        if left.anew and target == path:
            why = "a change before the checkpoint computes the run anew"
            raise ResultError(f"{path} would be replaced\n    detail:   {why}\n    try:      another name with -o")
        if not left.flat:
            _move_lines(left.scene, target, progress, path, criterion, left)
            return open_result(target)
        case = Case(left.scene, criterion, left.changes, left.points)
        with _supervised(case, progress):
            Passes(case, target, path, left).compute()
    return written_result(target, case.late_file)


def _several_lines(
    system: Network,
    output: str | Path | None,
    overwrite: bool,
    progress: bool | Listener = False,
    criterion: UserCriterion | None = None,
    *,
    moves: bool = True,
) -> Result:
    """The motion of several lines, or their equilibrium."""
    from hybrid.accuracy.passes_of_lines import PassesOfLines, is_refined, system_with_layers
    from hybrid.simulation.network_run import static_system

    refined = is_refined(system)
    target = _target(output, overwrite, refined)
    with locked(_path(output)):
        if isinstance(target, Path):
            beside(target).unlink(missing_ok=True)  # of a run that was cut off
        if not moves and refined:
            assert not isinstance(target, MemoryTarget)
            PassesOfLines(system, target, False, ProgressReporter(None, 1.0), lambda: False).compute()
        elif not moves:
            resolution = system_with_layers(system, False, ProgressReporter(None, 1.0), lambda: False)
            static_system(system, target, partial(scene_text, system), resolution)
        else:
            _move_lines(system, target, progress, criterion=criterion)
    return written_result(target)


def _move_lines(
    system: Network, target: Target, progress: bool | Listener, source: Path | None = None,
    criterion: UserCriterion | None = None, left: Remaining[Network] | None = None,
) -> None:  # fmt: skip
    """Compute the motion of several lines; source: the result to go on with; left: what is to be done with it."""
    changes = left.changes if left is not None else ()
    source = None if left is not None and left.anew else source
    from hybrid.accuracy.passes_of_lines import PassesOfLines, is_refined, system_with_layers
    from hybrid.simulation.network_run import Recording, run_system

    if criterion is not None and not system.adaptive:
        raise TypeError(NO_ZONES)
    duration, listener = system.require_time().duration, listener_of(progress)
    tell_of_compiling(listener, kernels_of(system))
    with interrupts() as stopped, ProgressReporter(listener, duration) as reporter:
        notes: list[tuple[str, str]] = []
        while True:
            try:
                if is_refined(system):
                    assert not isinstance(target, MemoryTarget), "errors are written into a file"
                    asked = PassesOfLines(system, target, True, reporter, stopped, notes, criterion, changes)
                    asked.compute(source)
                    return
                resolution = None
                if source is None:
                    resolution = system_with_layers(system, True, reporter, stopped, criterion)
                recording = Recording(source=source, notes=notes)
                run_system(
                    system, target, scene_text(system), reporter, stopped, resolution=resolution, recording=recording,
                    criterion=criterion, changes=changes,
                )  # fmt: skip
                return
            except ComputationError as error:
                instead = rods_of_system(system, error) if source is None else None
                if instead is None:
                    raise
                emptied(target, error)
                reporter.begin_anew()
                system = instead.system
                notes.append((CHOSEN, instead.text))


def _surveyed_at_rest(case: StaticCase, resolution: Resolution) -> tuple[ModelChoice, Resolution]:
    """The same of an equilibrium, whose model is rods where the scene names none and asks for an accuracy."""
    if not wants_survey(case.scene):
        return NAMED, layered(case, resolution)
    choice = NAMED
    if model_is_free(case.scene, moves=False):
        choice, case.scene = ModelChoice("rod", REST), with_model(case.scene, "rod")
    return choice, surveyed(case, resolution)


def resolution_at_rest(case: StaticCase) -> Resolution:
    """How finely the equilibrium of a case is computed first; where the scene leaves it open, its model is chosen."""
    check_motions(case.scene)
    return _surveyed_at_rest(case, first_resolution(case.scene))[1]


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
        tell_of_compiling(listener, kernels_of(case.scene))
    with interrupts() as interrupted, ProgressReporter(listener, duration) as reporter:
        case.progress, case.interrupted = reporter, interrupted
        yield
