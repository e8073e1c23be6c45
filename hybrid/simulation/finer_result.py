"""A finer result beside the one before it: which of the two a refinement returns, and when it takes its place."""

from __future__ import annotations

import copy
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hybrid.model.resolution import RequestedAccuracy, Resolution
from hybrid.simulation.error_estimate import Estimate
from hybrid.simulation.error_order import magnitude
from hybrid.simulation.refinement import RAW, Verdict, bounds_of
from hybrid.simulation.run_sample import RunSample

Record = Callable[[Resolution, Path | io.BytesIO], RunSample]

# The kind of event that says a finer run is not returned.
NOT_KEPT = "finer run not kept"


class Before(NamedTuple):
    """The result before a finer one: its estimate, and how that compares with what is asked."""

    estimate: Estimate
    verdict: Verdict

    @classmethod
    def of(cls, estimate: Estimate, verdict: Verdict) -> Before:
        """A copy that a finer result leaves as it is."""
        kept = copy.copy(estimate)
        kept.forget_errors()  # those are of the estimate that goes on
        for name in ("order", "falls", "changes", "by_step", "by_mesh"):
            setattr(kept, name, copy.copy(getattr(estimate, name)))
        return cls(kept, verdict)

    def is_better(self, asked: RequestedAccuracy, finer: Estimate, verdict: Verdict) -> bool:
        """Whether a finer result is no better than this one.

        Its error is larger, and either it differs from this one by no more than this one's error, so that the smaller
        figure stands; or the deciding quantity has changed by no less than in the refinement before: one of the two is
        wrong, and nothing shows that it is this one.
        """
        if verdict.ratio <= self.verdict.ratio:
            return False
        raw = RAW.get(verdict.name, verdict.name)
        last, before = finer.changes.get(raw, (np.nan, np.nan))
        return last >= before or self._holds(asked, finer.run)

    def _holds(self, asked: RequestedAccuracy, run: RunSample) -> bool:
        """Whether another result is nowhere further from this one than its error, in what is asked."""
        own, errors = self.estimate.run, self.estimate.errors
        for name, _, _, _ in bounds_of(asked, own):
            raw = RAW.get(name, name)
            if raw not in own.values or raw not in run.values:
                continue
            apart = magnitude(np.asarray(own.values[raw]) - np.asarray(run.values[raw]), raw)
            if float(np.max(apart, initial=0.0)) > errors.largest("total", name):
                return False
        return True


class FinerResult:
    """Records results one after the other; `settle` lets a finer one take the place of that before it, or drops it."""

    def __init__(self, target: Path | io.BytesIO, first: Record, refinement: Record) -> None:
        self.target, self._first, self._refinement = target, first, refinement
        self._done = False
        self._new: Path | io.BytesIO | None = None  # complete, and not settled

    def __call__(self, resolution: Resolution) -> RunSample:
        if not self._done:
            found, self._done = self._first(resolution, self.target), True
            return found
        new = io.BytesIO() if isinstance(self.target, io.BytesIO) else beside(self.target)
        self._new = new
        try:
            return self._refinement(resolution, new)
        except BaseException:
            self.settle(False)
            raise

    def settle(self, kept: bool) -> None:
        """Let what was recorded last count, or not; nothing where that is settled."""
        new, self._new = self._new, None
        if new is None:
            return
        if isinstance(new, Path):
            assert isinstance(self.target, Path)
            try:
                if kept:
                    os.replace(new, self.target)
            finally:
                for left in (new, new.with_suffix(".snapshot.npz")):
                    left.unlink(missing_ok=True)
        elif kept:
            assert isinstance(self.target, io.BytesIO)
            self.target.seek(0)
            self.target.truncate()
            self.target.write(new.getvalue())


def beside(target: Path) -> Path:
    """Where a finer result is computed, until it is complete."""
    return target.with_name(f".{target.name}.finer")
