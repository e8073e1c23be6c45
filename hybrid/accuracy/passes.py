"""All passes of one scene in motion: the pre-run, the result, the runs that its errors are estimated by, finer results.

The result is computed first and is in its place before anything else is tried: what stops later, by Ctrl-C, a kill or a
failure, leaves it there, and the file says what is still to come (`Result.pending`).  `hybrid resume` makes up for it.
"""

from __future__ import annotations

import io
import time as clock
from dataclasses import replace
from pathlib import Path

import numpy as np

from hybrid.accuracy.budget import Budget
from hybrid.accuracy.error_control import ErrorController, comparison_resolutions
from hybrid.accuracy.error_report import write_errors
from hybrid.accuracy.errors_by_cause import Errors
from hybrid.accuracy.finer_result import FinerResult
from hybrid.accuracy.model_choice import chosen_and_surveyed, rods_instead
from hybrid.accuracy.refinement import WORTH_WRITING, Free, times_the_cost
from hybrid.errors import ComputationError
from hybrid.model.build import zone_plans
from hybrid.model.model_costs import NAMED, ModelChoice
from hybrid.model.plan import output_times
from hybrid.model.resolution import (
    Resolution,
    first_resolution,
    follows_curvature,
    is_irregular,
    may_be_held,
    mesh_is_free,
    requested_accuracy,
    rubs_on_obstacles,
    wants_errors,
    wants_survey,
    zones_are_free,
)
from hybrid.scene.schema import AdaptiveModel, LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.first_use import compile_beside
from hybrid.simulation.mesh_survey import survey_resolution
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, RESULT
from hybrid.simulation.restart import Remaining
from hybrid.simulation.restore import refused
from hybrid.simulation.run_sample import RunSample
from hybrid.store.amend import may_be_amended
from hybrid.store.array_recorder import MemoryTarget, Target
from hybrid.store.named_arrays import Tree
from hybrid.store.stored_rows import remove_rows
from hybrid.store.whole_file import LateFile


class Passes:
    """Computes a result and, where they are wanted, its errors."""

    def __init__(
        self, case: Case, target: Target, source: Path | None = None, remaining: Remaining[LineScene] | None = None
    ) -> None:
        """source, remaining: what to continue."""
        self.case, self.target, self.source, self.remaining = case, target, source, remaining
        self.control: ErrorController | None = None
        self._instead: ErrorController | None = None  # of the result in its place, which one of another model will take
        self._begin = clock.process_time()

    def compute(self) -> None:
        """All passes."""
        case, remaining = self.case, self.remaining
        resolution = first_resolution(case.scene) if remaining is None else remaining.resolution.one
        if not wants_errors(case.scene):
            self._first(self._surveyed(resolution)[1] if remaining is None else resolution, self.target)
            return
        target, kept = self.target, False
        assert not isinstance(target, MemoryTarget)
        case.beside_result = target if isinstance(target, Path) else None
        try:
            result, errors = self._to_the_end(resolution, target)
            assert self.control is not None
            self._write(self.control, result, errors)
        except KeyboardInterrupt:
            standing = self._standing()
            if standing is not None:
                self._write(standing, *standing.without_refinement("a finer run was stopped from outside"), done=False)
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

    def _to_the_end(self, resolution: Resolution, target: Path | io.BytesIO) -> tuple[RunSample, Errors | None]:
        """The result, as fine as it takes, and its errors; with rods where catenaries that were chosen do not do."""
        case, remaining = self.case, self.remaining
        compute = FinerResult(target, self._first, self._finer, case.settle)
        if remaining is not None and remaining.before:
            control = self._controls(compute)
            with refused(self.source or Path()):
                control.restore(remaining.before, case.scene, case.points, self.source)
            if control.places is not None:
                case.places = control.places
            go_on = control.proceed
        else:
            choice, resolution = self._surveyed(resolution) if remaining is None else (NAMED, resolution)
            control = self._controls(compute, choice)
            first = replace(resolution, follow=_has_joints(case.scene))

            def go_on() -> tuple[RunSample, Errors | None]:
                return control.start(first)

        failed = ""
        try:
            result, errors = go_on()
            failed = control.model_misses
        except ComputationError as error:
            if control.choice.kind != "catenary":
                raise
            failed = str(error).splitlines()[0]
            if case.late_file is not None:
                case.late_file.drop()
                case.late_file = None
            emptied(target, error)
            compute = FinerResult(target, self._anew, self._finer, case.settle)
        if control.choice.kind != "catenary" or not failed:
            return result, errors
        self._instead = self._standing()
        choice, resolution = rods_instead(case, first_resolution(case.scene), failed)
        return self._controls(compute, choice).start(resolution)

    # --- results --------------------------------------------------------------------------------

    def _first(self, resolution: Resolution, to: Target) -> RunSample:
        """The first result, or the rest of it."""
        if self.remaining is None or self.remaining.anew or self.source is None or not isinstance(to, Path):
            return self.case.record(resolution, to, self._found())
        return self.case.resume(self.source, to, self._found())

    def _anew(self, resolution: Resolution, to: Path | io.BytesIO) -> RunSample:
        """The first result of another model."""
        return self.case.record(resolution, to, self._found())

    def _finer(self, resolution: Resolution, to: Path | io.BytesIO) -> RunSample:
        """A finer result beside the one that is there, or the rest of it."""
        self._stands(resolution)
        if isinstance(to, Path) and self.case.is_unfinished(to, resolution):
            return self.case.resume(to, to, self._found())
        return self.case.record(resolution, to, self._found())

    def _standing(self) -> ErrorController | None:
        """That of the result in its place; None: its errors are not known yet."""
        known = self.control is not None and self.control.estimate is not None
        return self.control if known else self._instead

    def _stands(self, finer: Resolution) -> None:
        """A finer run begins: the errors of the result in its place are written now, if that takes long."""
        standing = self._standing()
        if standing is None or standing.estimate is None:
            return
        run = standing.estimate.run
        if run.cpu * times_the_cost(run.resolution, finer) > WORTH_WRITING:
            self._write(standing, run, standing.estimate.errors, done=False)

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

    def _write(self, control: ErrorController, result: RunSample, errors: Errors | None, done: bool = True) -> None:
        cpu = clock.process_time() - self._begin
        before = {} if done else control.compared
        write_errors(self._complete(), self.case.scene, control, result, errors, cpu, before)

    # --- how finely -----------------------------------------------------------------------------

    def _controls(self, compute: FinerResult, choice: ModelChoice = NAMED) -> ErrorController:
        """What chooses how finely the case is computed from now on."""
        case, scene = self.case, self.case.scene
        from_rest = scene.initial.kind == "equilibrium" and not any(end.release for end in scene.ends.both)
        times = output_times(scene)
        self.control = ErrorController(
            requested_accuracy(scene), free_in(scene), True, case.sample, compute, case.beside, is_irregular(scene),
            choice, compute.settle, from_rest, rubs_on_obstacles(scene), np.array([0.0, *times]),
            Budget(len(times), case.points.s.size), may_be_held(scene),
        )  # fmt: skip
        return self.control

    def _surveyed(self, resolution: Resolution) -> tuple[ModelChoice, Resolution]:
        """The model, if the scene names none, and cells by a pre-run, if an accuracy is asked for."""
        case, named = self.case, self.case.scene.model
        passes = [(PRE_RUN, survey_resolution(resolution))] if wants_survey(case.scene) else []
        passes += [(RESULT, resolution)]
        if wants_errors(case.scene):
            passes += [(ESTIMATION, x) for x in comparison_resolutions(resolution, moves=True)]
        case.progress.expect(passes, resolution)
        found = chosen_and_surveyed(case, resolution)
        if case.scene.model != named:
            compile_beside(case.scene)
        return found


def free_in(scene: LineScene) -> Free:
    """What the scene leaves to the program."""
    time = scene.time
    steps = time is not None and time.controlled and time.tolerance is None
    # where cells follow the curvature its share decides kinds, and the tolerance cells as well: both stay
    follows = follows_curvature(scene)
    return Free(mesh_is_free(scene), steps, zones_are_free(scene) and not follows, follows)


def _has_joints(scene: LineScene) -> bool:
    """Whether rods and catenaries may meet on the cells of a result, which then follows itself what that leaves out.

    What a joint does beside it is of the cells there: a coarser run, whose outputs are fewer too, does not show it.
    """
    if isinstance(scene.model, AdaptiveModel):
        return not follows_curvature(scene)
    return len({zone.kind for zone in zone_plans(scene)}) > 1


def emptied(target: Target, error: ComputationError | None = None) -> None:
    """Drop what a run has left that is made again with another model; error: with which it failed."""
    if isinstance(target, io.BytesIO):
        target.seek(0)
        target.truncate()
    left = [target, target.with_suffix(".snapshot.npz")] if isinstance(target, Path) else []
    for path in [*left, *([] if error is None or error.snapshot is None else [error.snapshot])]:
        path.unlink(missing_ok=True)
