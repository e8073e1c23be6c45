"""The functions of this package that compute: each leaves one result, in a file or in memory.

run      integrate a scene over its duration
static   find its equilibrium
resume   continue a run
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hybrid.accuracy.model_choice import CHOSEN, chosen_and_surveyed, rods_instead_of_slack
from hybrid.accuracy.passes import Passes, emptied
from hybrid.accuracy.refinement import beside
from hybrid.errors import ComputationError, ResultError, SceneError
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import with_models
from hybrid.model.resolution import model_is_free
from hybrid.scene.analysis import missing_time
from hybrid.scene.read import SceneLike, as_scene
from hybrid.simulation.case import Case, CaseAtRest
from hybrid.simulation.first_use import compile_beside, kernels_of
from hybrid.simulation.own_parts import RunPart, checked_parts, require_parts
from hybrid.simulation.progress import Listener, ProgressReporter, announce_compiling, interrupts, listener_of
from hybrid.simulation.restart import remaining
from hybrid.store.format import MemoryTarget, Target
from hybrid.store.hdf5_file import check_target, locked
from hybrid.store.reader import Result, open_result, written_result
from hybrid.zones.manager import UserCriterion

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
