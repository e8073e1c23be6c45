"""A finer result beside the one before it: which of the two a refinement returns, and when it takes its place."""

from __future__ import annotations

import copy
import io
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hybrid.accuracy.error_estimate import Estimate
from hybrid.accuracy.error_order import magnitude
from hybrid.accuracy.error_statistics import LARGEST, STATISTICS, StatisticEstimate
from hybrid.accuracy.extreme_errors import ExtremeErrors
from hybrid.accuracy.refinement import RAW, Verdict, bounds_of, judge
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import RequestedAccuracy
from hybrid.simulation.run_sample import RunSample, Samples

Target = Path | io.BytesIO
Record = Callable[[NetworkResolution, Target], Samples]
T = TypeVar("T")

# The kind of event that says a finer run is not returned.
NOT_KEPT = "finer run not kept"


class Judged(NamedTuple):
    """The errors of a result as they are held against what is asked."""

    estimate: Estimate
    statistics: Mapping[str, StatisticEstimate] = {}  # of an irregular motion; empty: every instant is judged
    scattered: tuple[str, ...] = ()  # end forces whose largest values are by chance: not judged
    extremes: ExtremeErrors | None = None  # of what limits are held against; None: nothing is, or not estimated

    def copied(self) -> Judged:
        """A copy that a finer result leaves as it is."""
        statistics = {k: _copied(x) for k, x in self.statistics.items()}
        return self._replace(estimate=_copied(self.estimate), statistics=statistics)

    def judged_as(self, other: Judged) -> Judged:
        """The same result, of which that counts which counts of another one."""
        found = self.statistics if other.statistics else {}
        return self._replace(statistics=found, scattered=other.scattered)

    def verdict(self, asked: RequestedAccuracy) -> Verdict:
        """How the errors compare with what is asked: at every instant, or of extremes and standard deviations."""
        if not self.statistics:
            return judge(asked, self.estimate.errors, self.estimate.run, extremes=self.extremes)
        verdicts = []
        if asked.of_motion is not None:
            asked = asked.sized(self.estimate.run.reach)
        for statistic, estimate in self.statistics.items():
            of_largest = self.statistics[LARGEST].run
            found = judge(asked, estimate.errors, of_largest, self._skipped(statistic), self.extremes)
            text = found.text.replace(": error", f", {STATISTICS[statistic]}: error")
            verdicts.append(replace(found, text=text, statistic=statistic))
        return max(verdicts, key=lambda found: found.ratio)

    def _skipped(self, statistic: str) -> tuple[str, ...]:
        return self.scattered if statistic == LARGEST else ()

    def set_apart(self, finer: Judged) -> None:
        """A finer result is no better, and either may be wrong: no error is less than what they differ by."""
        self.estimate.set_apart(finer.estimate.run)
        for name, estimate in self.statistics.items():
            if name in finer.statistics:
                estimate.set_apart(finer.statistics[name].run)

    def changes_no_less(self, verdict: Verdict) -> bool:
        """Whether the last refinement has changed what decides by no less than the one before did."""
        if self.extremes is not None and verdict.limit in self.extremes.errors:
            return self.extremes.changes_no_less(verdict.limit)
        estimate = self.statistics[verdict.statistic] if verdict.statistic else self.estimate
        last, before = estimate.changes.get(RAW.get(verdict.name, verdict.name), (np.nan, np.nan))
        return bool(last >= before)

    def holds(self, asked: RequestedAccuracy, other: Judged) -> bool:
        """Whether another result is nowhere further from this one than its error, in what is asked and judged."""
        if not self.statistics:
            return _holds(asked, self.estimate, other.estimate.run, ())
        return all(
            name in other.statistics and _holds(asked, own, other.statistics[name].run, self._skipped(name))
            for name, own in self.statistics.items()
        )


def is_no_better(
    asked: Mapping[str, RequestedAccuracy], before: Mapping[str, Judged], finer: Mapping[str, Judged]
) -> Verdict | None:
    """Of a finer result that is no better than the one before it: what decides; None: it takes its place.

    All by the names of lines.  Its largest error, over what is asked, is larger, and either the two differ by no more
    than the errors of the one before, so that the smaller figures stand; or what decides has changed by no less than in
    the refinement before: one of the two is wrong, and nothing shows that it is the one before.  Of extremes that
    limits are held against it is: cells that are too long make them too mild.
    """
    both = [name for name in asked if name in before and name in finer]
    if not both:
        return None
    least = {name: before[name].judged_as(finer[name]) for name in both}
    verdicts = {name: finer[name].verdict(asked[name]) for name in both}
    worst = max(both, key=lambda name: verdicts[name].ratio)
    found = verdicts[worst]
    if found.limit or found.ratio <= max(least[name].verdict(asked[name]).ratio for name in both):
        return None
    if finer[worst].changes_no_less(found) or all(least[name].holds(asked[name], finer[name]) for name in both):
        return found
    return None


def not_kept_text(finer: RunSample, found: Verdict) -> str:
    """Text of the event; found: of the finer run, what decides."""
    return f"{finer.cells} cells and {finer.steps} steps are no better: {found.text}; the result is the one before"


def _copied(estimate: Any) -> Any:
    kept = copy.copy(estimate)
    kept.forget_errors()  # those are of the estimate that goes on
    for name in ("order", "falls", "changes", "by_step", "by_mesh"):
        setattr(kept, name, copy.copy(getattr(estimate, name)))
    return kept


def _holds(asked: RequestedAccuracy, estimate: Estimate, other: RunSample, skip: tuple[str, ...]) -> bool:
    """Whether another run is nowhere further from that of an estimate than its errors; skip: what is not judged."""
    own, errors = estimate.run, estimate.errors
    for name in dict.fromkeys(bound.name for bound in bounds_of(asked, own)):
        raw = RAW.get(name, name)
        if name in skip or raw not in own.values or raw not in other.values:
            continue
        apart = magnitude(np.asarray(own.values[raw]) - np.asarray(other.values[raw]), raw)
        if float(np.max(apart, initial=0.0)) > errors.largest("total", name):
            return False
    return True


class Replacement:
    """Records finer results beside a complete one; `settle` lets such a one take its place, or drops it."""

    def __init__(
        self, target: Target, waits: Callable[[bool], bool] = lambda kept: False, goes_on: bool = False
    ) -> None:
        """waits: settles one that waits in memory, so that it needs no file; False: none does.

        goes_on: whether one that was stopped stays beside, for whoever goes on with it.
        """
        self.target, self._waits, self.goes_on = target, waits, goes_on
        self._new: Target | None = None  # complete, and not settled

    def finer(self, record: Callable[[Target], T]) -> T:
        """Record a finer result, which is then to be settled.

        One that fails leaves nothing, and one that is stopped leaves only what can be restarted.
        """
        new = io.BytesIO() if isinstance(self.target, io.BytesIO) else beside(self.target)
        self._new = new
        try:
            return record(new)
        except BaseException as error:
            if not (self.goes_on and isinstance(error, KeyboardInterrupt)):
                self.settle(False)
            raise

    def settle(self, kept: bool) -> None:
        """Let what was recorded last count, or not; nothing where that is settled."""
        new, self._new = self._new, None
        if new is None or self._waits(kept):
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


class FinerResult(Replacement):
    """Records results one after the other, those after the first beside it."""

    def __init__(
        self, target: Target, first: Record, refinement: Record, waits: Callable[[bool], bool] = lambda kept: False,
        goes_on: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(target, waits, goes_on)
        self._first, self._refinement = first, refinement
        self._done = False

    def __call__(self, resolution: NetworkResolution) -> Samples:
        if not self._done:
            found, self._done = self._first(resolution, self.target), True
            return found
        return self.finer(lambda new: self._refinement(resolution, new))


def beside(target: Path) -> Path:
    """Where a finer result is computed, until it is complete."""
    return target.with_name(f".{target.name}.finer")
