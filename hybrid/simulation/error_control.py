"""Computes a scene as often and as finely as it takes for the accuracy that is asked.

First the runs that errors are estimated by, then the result; where its estimated errors are larger than asked, finer
results follow, each from what the one before has shown.
docs/accuracy.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import ComputationError
from hybrid.model.output_points import OutputPoints
from hybrid.model.plan import output_times
from hybrid.model.resolution import RequestedAccuracy, Resolution
from hybrid.scene.schema import Scene
from hybrid.simulation.error_estimate import COARSER, Errors, Estimate
from hybrid.simulation.refinement import Free, Verdict, judge, refined
from hybrid.simulation.restore import resolution_from, resolution_tree
from hybrid.simulation.run_sample import RunSample, restored_notes, restored_sample
from hybrid.store.named_arrays import Tree, matched
from hybrid.store.stored_rows import MissingRows

# A finer run whose error is more than this part of that before it tells that more will not help: zones that change a
# little earlier or later, or friction that holds elsewhere, are what is left.
STALLED = 0.8
# Processor time, s, after which runs are not made finer for what they miss: a longer wait should be asked for.
MOST_CPU = 600.0
# Refinements that may follow the first result.
MOST_REFINEMENTS = 3


def comparison_resolutions(resolution: Resolution, moves: bool) -> tuple[Resolution, Resolution, Resolution]:
    """Of the runs to compare with: longer cells and steps; the same cells, longer steps still; longer cells as well.

    moves: whether there are steps at all.
    """
    longer = COARSER if moves else 1.0
    return (
        resolution.coarser(COARSER, longer),
        resolution.coarser(COARSER, longer**2),
        resolution.coarser(COARSER**2, longer**2),
    )


Samples = Sequence[Callable[[], RunSample]]
Beside = Callable[[Samples], AbstractContextManager[Samples]]


@dataclass
class ErrorController:
    """Chooses mesh, step and zones of one run after the other until the accuracy that is asked is met.

    asked: None asks for an error figure alone.  sample: computes a run to compare with; result: computes the result;
    both raise ComputationError.  beside: computes several of the former at the same time (simulation.beside);
    None: one after the other.  Its `checkpoint` is in the file of every result, so that what was cut off continues
    with `proceed`.
    """

    asked: RequestedAccuracy | None
    free: Free
    moves: bool  # whether there is a time
    sample: Callable[[Resolution], RunSample]
    result: Callable[[Resolution], RunSample]
    beside: Beside | None = None
    runs: list[float] = field(default_factory=list)  # s of processor time, of all runs so far
    next: Resolution | None = None  # of the result that is to be computed
    comparisons: tuple[RunSample, RunSample | None, RunSample | None] | None = None  # for the first result
    estimate: Estimate | None = None  # of the result as it is
    _ratio: float = np.inf  # of the error of the result to what is asked
    _judged: int = 0  # results
    _lost: bool = False  # whether the runs to compare with are to be computed again
    _notes: list[tuple[str, str]] = field(default_factory=list)

    @property
    def notes(self) -> tuple[tuple[str, str], ...]:
        """Events of the result, kind and text: of the control, of the result itself, and of its model error."""
        found = self.estimate
        return (*self._notes, *((*found.run.notes, *found.notes) if found is not None else ()))

    def start(self, resolution: Resolution) -> tuple[RunSample, Errors | None]:
        """From a first resolution to the result and its errors, None where they cannot be estimated."""
        self.comparisons, self.next = self._compute_comparisons(resolution), resolution
        return self.proceed()

    def proceed(self) -> tuple[RunSample, Errors | None]:
        """The same from the next result on."""
        if self._lost and self.next is not None:
            self.runs, self._notes, self._lost = [], [], False
            self.comparisons = self._compute_comparisons(self.next)
        while self.next is not None:
            resolution = self.next
            try:
                result = self._counted(self.result(resolution))
            except ComputationError as error:
                if self.estimate is None:
                    raise
                return self.without_refinement(f"a finer run failed: {str(error).splitlines()[0]}")
            if self.estimate is not None:
                stricter = resolution.zones < self.estimate.run.resolution.zones
                self.estimate.update(result)
                if stricter:
                    self._renew_model_errors(self.estimate, resolution)
            elif not self._first_estimate(result):
                return result, None
            self.next = self._next_resolution()
        assert self.estimate is not None
        errors = self.estimate.errors
        if self.asked is not None:
            verdict = judge(self.asked, errors, self.estimate.run)
            if verdict.ratio > 1.0:
                self._note_missed(verdict)
        return self.estimate.run, errors

    def without_refinement(self, why: str) -> tuple[RunSample, Errors]:
        """The result as it is and its errors, where a finer one did not come to its end."""
        assert self.estimate is not None and self.asked is not None
        run, errors = self.estimate.run, self.estimate.errors
        verdict = judge(self.asked, errors, run)
        if verdict.ratio > 1.0:
            self._notes.append(("accuracy missed", f"{verdict.text}; {why}"))
        return run, errors

    def _compute_comparisons(
        self, resolution: Resolution
    ) -> tuple[RunSample, RunSample | None, RunSample | None] | None:
        """The runs to compare with; None: the first has failed."""
        found: list[RunSample | None] = [None, None, None]
        coarser = [replace(x, follow=k == 0) for k, x in enumerate(comparison_resolutions(resolution, self.moves))]
        which = (0, 1, 2) if self.moves else (0, 2)  # without steps the second is the first
        samples = [partial(self.sample, coarser[k]) for k in which]
        with self.beside(samples) if self.beside is not None else nullcontext(samples) as runs:
            for k, run in zip(which, runs, strict=True):
                try:
                    found[k] = self._counted(run())
                except ComputationError as error:
                    if not k:
                        text = f"no error figure: a coarser run to compare with failed: {str(error).splitlines()[0]}"
                        self._notes.append(("no error figure", text))
                        return None
        assert found[0] is not None
        return found[0], found[1], found[2]

    def _counted(self, run: RunSample) -> RunSample:
        self.runs.append(run.cpu)
        return run

    def _first_estimate(self, result: RunSample) -> bool:
        """Compare the first result with the coarser runs; False: they say nothing of its errors."""
        if self.comparisons is None:
            self._notes += result.notes
            return False
        estimate = Estimate(result, *self.comparisons)
        if not estimate.has_mesh:
            text = f"no error figure: {result.cells} cells are so few that there is nothing coarser to compare with"
            self._notes.append(("no error figure", text))
            self._notes += [*result.notes, *estimate.notes]
            return False
        if self.moves and not estimate.has_step:
            text = (
                "the share of the time step is not known: runs with longer steps fail, or are halved to what they were"
            )
            fix = "ask for a smaller error" if self.free.steps else "leave time.step out"
            self._notes.append(("error uncertain", f"{text}; the error may be larger; {fix}"))
        self.estimate, self.comparisons = estimate, None
        return True

    def _renew_model_errors(self, estimate: Estimate, resolution: Resolution) -> None:
        """Zones have become stricter: what they neglect now."""
        coarser = comparison_resolutions(resolution, self.moves)[0]
        try:
            estimate.set_model_errors(self._counted(self.sample(replace(coarser, follow=True))))
        except ComputationError as error:
            text = f"the effect of neglected bending is that of a run before: {str(error).splitlines()[0]}"
            self._notes.append(("error uncertain", text))

    def _next_resolution(self) -> Resolution | None:
        """The resolution of the next result; None: what is asked is met, or more of it would not help."""
        assert self.estimate is not None
        if self.asked is None:
            return None
        run, before = self.estimate.run, self._ratio
        verdict = judge(self.asked, self.estimate.errors, run)
        self._ratio, falls = verdict.ratio, verdict.ratio / before  # 0 for the first
        self._judged += 1
        left = MOST_REFINEMENTS + 1 - self._judged
        hopeless = left == 0 or falls > STALLED or verdict.ratio * falls**left > 1.0
        met = verdict.ratio <= 1.0 and not (run.unresolved and self.free.mesh)
        if met or hopeless or sum(self.runs) > MOST_CPU:
            return None
        return refined(run.resolution, verdict, self.free)

    def _note_missed(self, verdict: Verdict) -> None:
        """Say that what was asked is not met, whose doing it is, and what to try."""
        main = max((verdict.mesh, "mesh"), (verdict.time, "time step"), (verdict.model, "model"))[1]
        free = {"mesh": self.free.mesh, "time step": self.free.steps, "model": self.free.zones}[main]
        fixed = {"mesh": "mesh (or cells of zones)", "time step": "time.step", "model": "model, or its tolerance"}[main]
        try_ = f"leave {fixed} out"
        if free:
            try_ = f"accuracy: {{{verdict.reached}}}, which this run meets"
            try_ += ", or compare with model: rod" * (verdict.model > 0.0)
        if main == "model" and not free:
            try_ = "model: adaptive, or rod"
        text = f"{verdict.text}; most of it is of the {main}, {len(self.runs)} runs; try: {try_}"
        self._notes.append(("accuracy missed", text))

    def checkpoint(self) -> Tree:
        """What it has found until now, as named arrays and plain values."""
        return {
            "runs": np.array(self.runs), "next": self.next and resolution_tree(self.next),
            "coarse": self.comparisons and [x and x.checkpoint() for x in self.comparisons],
            "estimate": self.estimate and self.estimate.checkpoint(),
            "ratio": self._ratio, "finer": self._judged, "notes": self._notes,
        }  # fmt: skip

    def restore(self, tree: Mapping[str, Any], scene: Scene, points: OutputPoints, source: Path | None = None) -> None:
        """Continue as `checkpoint` has said; points: of the result.  source: its file; runs to compare with whose
        outputs are no longer beside it are computed again.

        ResultError or ValueError: it is none of this scene.
        """
        template = {"runs": np.zeros(0), "ratio": np.inf, "finer": 0}
        saved = matched(tree, template | dict.fromkeys(("next", "coarse", "estimate", "notes")), "error control")
        shape = len(output_times(scene)) + 1, points.s.size, points.jumps.size
        self.runs, self._ratio, self._judged = saved["runs"].tolist(), saved["ratio"], saved["finer"]
        self._notes = list(restored_notes(saved["notes"]))
        self.next = resolution_from(saved["next"], scene) if saved["next"] is not None else None
        if saved["coarse"] is not None:
            try:
                first, second, third = (x and restored_sample(x, scene, shape, source) for x in saved["coarse"])
                self.comparisons = first, second, third
            except MissingRows:
                self._lost = True
        if saved["estimate"] is not None:
            self.estimate = Estimate.restored(saved["estimate"], scene, shape)
        if self.next is None and self.estimate is None:
            raise ValueError("neither a result nor one that is to come")
