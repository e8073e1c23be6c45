"""All passes of one scene in motion: the pre-run, the result, the runs that its errors are estimated by, finer results.

The result is computed first and is in its place before anything else is tried: what stops later, by Ctrl-C, a kill or a
failure, leaves it there, and the file says what is still to come (`Result.pending`).  `hybrid resume` makes up for it.
"""

from __future__ import annotations

import io
import time as clock
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.accuracy.error_control import ErrorController, comparison_resolutions
from hybrid.accuracy.error_report import write_errors
from hybrid.accuracy.finer_result import FinerResult
from hybrid.accuracy.line_errors import LineErrors
from hybrid.accuracy.model_choice import chosen_and_surveyed
from hybrid.accuracy.model_errors import can_leave_bending_out, may_touch
from hybrid.accuracy.refinement import WORTH_WRITING, Free, times_the_cost
from hybrid.accuracy.run_forecast import Budget
from hybrid.errors import ComputationError
from hybrid.model.model_costs import NAMED, ModelChoice
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import output_times
from hybrid.model.resolution import (
    follows_curvature,
    is_irregular,
    may_be_held,
    mesh_is_free,
    requested_accuracy,
    rubs_on_obstacles,
    wants_survey,
    zones_are_free,
)
from hybrid.scene.schema import LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.first_use import compile_beside
from hybrid.simulation.mesh_survey import CELLS, STEPS
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, RESULT
from hybrid.simulation.restart import Remaining
from hybrid.simulation.restore import refused
from hybrid.simulation.run_sample import Samples
from hybrid.store.amend import may_be_amended
from hybrid.store.array_contents import MemoryTarget, Target
from hybrid.store.named_arrays import Tree
from hybrid.store.stored_rows import remove_rows
from hybrid.store.whole_file import LateFile


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
        compute = FinerResult(target, self._first, self._finer, case.settle, goes_on=case.moves)
        if remaining is not None and remaining.before:
            control = self._controls(compute)
            with refused(self.source or Path()):
                control.restore(remaining.before, case.lines, case.points, self.source, resolution)
            case.places |= {name: x.places for name, x in control.lines.items() if x.places is not None}
            go_on = control.proceed
        else:
            resolution = self._surveyed(resolution) if remaining is None else resolution
            control = self._controls(compute)
            first = resolution

            def go_on() -> None:
                control.start(first)

        tried = control.chosen
        try:
            go_on()
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
            compute = FinerResult(target, self._anew, self._finer, case.settle, goes_on=case.moves)
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
            return self.case.record(resolution, to, self._found())
        return self.case.resume(self.source, to, self._found())

    def _anew(self, resolution: NetworkResolution, to: Path | io.BytesIO) -> Samples:
        """The first result of another model."""
        return self.case.record(resolution, to, self._found())

    def _finer(self, resolution: NetworkResolution, to: Path | io.BytesIO) -> Samples:
        """A finer result beside the one that is there, or the rest of it."""
        self._stands(resolution)
        if isinstance(to, Path) and self.case.moves and self.case.is_unfinished(to, resolution):
            return self.case.resume(to, to, self._found())
        return self.case.record(resolution, to, self._found())

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

    def _found(self) -> Tree:
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
        self.control = ErrorController(lines, case, compute, compute.settle, budget)
        return self.control

    def _errors_of(self, name: str, scene: LineScene) -> LineErrors:
        """What will be known of the errors of a line."""
        case = self.case
        times = output_times(scene) if case.moves else []
        free = free_in(scene)
        return LineErrors(
            requested_accuracy(scene), free if case.moves else free._replace(steps=False), case.moves,
            case.moves and is_irregular(scene), self._choices.get(name, NAMED), case.from_rest,
            rubs_on_obstacles(scene), np.array([0.0, *times]), may_be_held(scene),
        )  # fmt: skip

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
