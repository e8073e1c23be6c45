"""How wrong a line is in a result, by all runs of its scene, and how finely it should be computed next.

docs/errors.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hybrid.accuracy.error_estimate import NOTHING, Estimate
from hybrid.accuracy.error_order import COARSER, errors_between, finer_between, snap_excess
from hybrid.accuracy.error_statistics import (
    LARGEST,
    STATISTICS,
    ExtremeErrors,
    StatisticEstimate,
    estimates,
    irregular_notes,
    is_chance,
    resolves_snaps,
    snaps,
    statistics_of,
)
from hybrid.accuracy.refinement import MOST_OF_MODEL, RAW, Free, Judged, Verdict, missed, not_converged, refined
from hybrid.errors import ComputationError, Outcome, SceneError
from hybrid.model.plan import NAMED, WORDS, ModelChoice, output_times
from hybrid.model.resolution import (
    IRREGULAR_REFINEMENTS,
    MOST_REFINEMENTS,
    REFINEMENTS_AT_REST,
    RequestedAccuracy,
    Resolution,
)
from hybrid.model.sections import OutputPoints
from hybrid.scene.schema import LineScene
from hybrid.simulation.run_sample import ALL, END_FORCES, RunSample, compared_places, restored_notes, restored_sample
from hybrid.store.integrity import Tree, matched
from hybrid.store.stored_rows import MissingRows

# A finer run whose error is more than this part of that before it tells that more will not help: zones that change a
# little earlier or later, or friction that holds elsewhere, are what is left.
STALLED = 0.8
# Processor time, s, after which runs are not made finer for what they miss: a longer wait should be asked for.
MOST_CPU = 600.0
# Results of cells half as long, at most, where no equilibrium or motion is found on those of the runs to compare with.
MOST_HALVINGS = 2
# Cells from which on an equilibrium is not made finer: it takes seconds.  No clock, by which the first scene of a run,
# while code is compiled, and one beside others would be less accurate than the same again.
CELLS_AT_REST = 20_000
# How much finer a run of an irregular motion may be made: chance is soon more than cells and steps are.
IRREGULAR_FINER = 2.0
# A run that is hardly finer is not made of it: what it changes is chance.
WORTH_REPEATING = 1.2
# A change of a quantity by less than this part of its largest value is round-off: a thousandth of the least error that
# can be asked for.
ROUND_OFF_OF = 1e-9
# A run of so many times as many cells and steps counts as twice as fine.
TWICE = 1.8
# Values at an instant do not converge where halved cells and steps leave more of a difference than this: order 0.25.
DIVERGES = 0.85


@dataclass
class LineErrors:
    """What is known of the errors of one line, in all runs of its scene, and how finely it should be computed next.

    asked: None asks for an error figure alone.  irregular: extremes and standard deviations are judged from the start
    (accuracy.error_statistics); else where a line snaps and values at an instant do not converge.
    """

    asked: RequestedAccuracy | None
    free: Free
    moves: bool  # whether there is a time
    irregular: bool = False
    choice: ModelChoice = NAMED  # of a scene that leaves the choice
    from_rest: bool = True  # whether it begins from an equilibrium, or is one
    rubs: bool = False  # whether obstacles on which the line may lie have friction
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (nt,) s, of the outputs of a result
    length: float = 0.0  # m, of the line
    held: bool = True  # whether friction may hold the line here or there, so that its tension jumps
    stopped: str = ""  # why it is refined no further although it misses what is asked; empty: more would not help
    runs: list[float] = field(default_factory=list)  # s of processor time, of all runs so far, of all lines
    comparisons: tuple[RunSample, RunSample | None, RunSample | None] | None = None  # for the first result
    estimate: Estimate | None = None  # of the result as it is
    scattered: list[str] = field(default_factory=list)  # end forces whose largest values are by chance: not judged
    extremes: ExtremeErrors | None = None  # of what limits are held against, of a run with limits
    excess: np.ndarray = field(default_factory=lambda: np.zeros(2))  # N, by which snaps may exceed the largest forces
    _ratio: float = np.inf  # of the error of the result to what is asked
    _judged: int = 0  # results
    _failed: Literal["", "at rest", "in motion"] = ""  # how a run to compare with has failed last
    _slow_from: list[float] | None = None  # cells and steps of the first result, where errors fell slowly until then
    _every: int = 1  # outputs to one of which the statistics are
    own_notes: list[tuple[str, str]] = field(default_factory=list)
    _statistics: dict[str, StatisticEstimate] = field(default_factory=dict)
    _of_statistics: Callable[[], dict[str, StatisticEstimate]] | None = None  # what they are to be estimated by

    @property
    def statistics(self) -> dict[str, StatisticEstimate]:
        """Errors of extremes and deviations, if it moves; estimated when asked for, as regular motions never do."""
        if self._of_statistics is not None:
            self._statistics, self._of_statistics = self._of_statistics(), None
        return self._statistics

    @statistics.setter
    def statistics(self, found: dict[str, StatisticEstimate]) -> None:
        self._statistics, self._of_statistics = found, None

    @property
    def notes(self) -> tuple[tuple[str, str], ...]:
        """Events of the result, kind and text: of the control, of the result itself, and of its model error."""
        found = self.estimate
        own = [*self.choice.notes, *self.own_notes, *self._irregular_note()]
        own += not_converged(self.diverging, self.asked)
        return (*own, *((*found.several_equilibria, *found.run.notes, *found.notes) if found is not None else ()))

    @property
    def diverging(self) -> dict[str, float]:
        """As `Estimate.not_converged`; none of an irregular motion, which is judged otherwise."""
        if self.estimate is None or self.irregular:
            return {}
        return {x: left for x, left in self.estimate.not_converged.items() if not self._is_round_off(x)}

    def _is_round_off(self, name: str) -> bool:
        """Whether runs differ in a quantity by no more than round-off, or without friction by less than is asked."""
        assert self.estimate is not None
        raw, unit = RAW.get(name, name), {"bending_moment": "N m", "curvature": "1/m", "position": "m"}.get(name, "N")
        least = self.asked.round_off(unit) if self.asked is not None else 0.0
        asked = self.asked.of_tension if self.asked is not None else None
        part = ROUND_OFF_OF if self.held else min(NOTHING, asked or NOTHING)
        return self.estimate.change(raw)[0] <= max(least, part * self.estimate.size(raw))

    def _irregular_note(self) -> list[tuple[str, str]]:
        """What is judged of an irregular motion, and how far the result may be off in what is not."""
        if self.asked is None or not self.irregular or not self.statistics or self.estimate is None:
            return []
        return irregular_notes(
            self.statistics,
            self.estimate.errors,
            self._left_out,
            self.excess,
            self.asked,
            by_snaps=bool(self._slow_from),
        )

    def finds_no_rest(self, error: ComputationError) -> bool:
        """Whether cells half as long may find the equilibrium that a result has not: its rods fold or buckle."""
        again = error.t is None and error.outcome in (Outcome.UNSTABLE, Outcome.FOLDED)
        again = again and self.asked is not None and self.free.mesh and self._judged < MOST_HALVINGS
        self._judged += again
        return again

    @property
    def halves(self) -> tuple[bool, bool]:
        """Whether cells, and steps, of the next result are half as long, as a run to compare with has failed.

        A motion that fails may do so by either; the runs to compare with are then as fine as the result before.
        """
        if self.asked is None or self._judged >= MOST_HALVINGS or not self._failed:
            return False, False
        return self.free.mesh, self.free.steps and self._failed == "in motion"

    def halve(self) -> None:
        """Forget that errors are not known: a finer result follows."""
        self._judged += 1
        self.own_notes.pop()

    def lacks_errors(self, error: ComputationError | SceneError, what: str = "coarser run to compare with") -> None:
        """Note that errors are not known, as such a run has failed."""
        self._failed = "at rest" if getattr(error, "t", None) is None else "in motion"
        why = str(error).splitlines()[0]
        if isinstance(error, SceneError):
            why = f"expected {error.complaints[0].expected}"
        text = f"error not known: a {what} failed: {why}"
        self.own_notes.append(("no error figure", text))

    @property
    def places(self) -> np.ndarray | None:
        """Of the output points those at which runs are compared, as of `RunSample`; None: there is none yet."""
        run = self.estimate.run if self.estimate is not None else self.comparisons and self.comparisons[0]
        return run.places if run else None

    def judged(self, of_statistics: bool) -> Judged:
        """The errors of the result; of_statistics: with those of extremes and standard deviations."""
        assert self.estimate is not None
        statistics = self.statistics if of_statistics else {}
        return Judged(self.estimate, statistics, tuple(self._left_out), self.extremes)

    @property
    def _left_out(self) -> list[str]:
        """End forces whose largest values are not judged: they are by chance, or a snap may exceed them."""
        allowed = self.allowed_force
        if self.scattered or not self.irregular or allowed is None or not self.excess.max() > allowed:
            return self.scattered
        found = self.statistics.get(LARGEST)
        if found is None:
            return self.scattered
        return [name for raw, name in END_FORCES.items() if raw in found.order]  # a snap pulls at both

    def keep(self, before: Judged, finer: Judged) -> None:
        """Go back to the result before a finer one that is no better."""
        before.set_apart(finer)
        self.estimate, self.statistics, self.extremes = before.estimate, dict(before.statistics), before.extremes
        if self.extremes is not None and finer.extremes is not None:
            self.extremes = self.extremes.set_apart(finer.extremes)

    def verdict(self, asked: RequestedAccuracy) -> Verdict:
        """How the errors compare with what is asked: at every instant, or of extremes and standard deviations."""
        return self.judged(self.irregular).verdict(asked)

    @property
    def allowed_force(self) -> float | None:
        """Error, N, of forces at the ends that is asked; None: none is."""
        if self.asked is None or self.estimate is None:
            return None
        part = self.asked.of_end_force
        return part * self.estimate.run.largest_end_force if part is not None else self.asked.tension

    @property
    def model_misses(self) -> str:
        """Where leaving bending out makes more of the error than is asked allows, how much; else empty."""
        if self.asked is None or self.estimate is None:
            return ""
        found = self.verdict(self.asked)
        misses = found.ratio > 1.0 and found.model > MOST_OF_MODEL
        return f"leaving bending out makes {100 * found.model:.2g} % of what is asked" if misses else ""

    def first_estimate(self, result: RunSample, faster: Callable[[], RunSample | None] = lambda: None) -> bool:
        """Compare the first result with the coarser runs; False: they say nothing of its errors.

        faster: computes the first of them in steps as short as those of the result; None: it fails.
        """
        if self.comparisons is None:
            self.own_notes += result.notes
            return False
        estimate = Estimate(result, *self.comparisons, self.from_rest, self.rubs)
        estimate.length = self.length
        if estimate.share_unknown and (run := faster()) is not None:
            estimate.show_steps(run)
        self.excess = snap_excess(result.forces, self.comparisons[0].forces)
        if not self.irregular:  # else statistics count all steps
            estimate.between = errors_between(self.times, result, self.comparisons[0], self.comparisons[2])
        self._set_statistics(result, *self.comparisons)
        if not estimate.has_mesh:
            few = f"{result.cells} cells are so few that there is nothing coarser to compare with; mesh: at least 8"
            if self.free.follows:
                few = (
                    "cells follow the curvature, and nearly all are base cells, which stay: coarser runs have the same "
                    "ones; a smaller model.curvature_error, or fewer base cells (mesh.cells)"
                )
            self.own_notes.append(("no error figure", f"no error figure: {few}"))
            self.own_notes += [*result.notes, *estimate.notes]
            return False
        if self.moves and not estimate.has_step:
            text = (
                "the share of the time step is not known: runs with longer steps fail, or are halved to what they were"
            )
            fix = "ask for a smaller error" if self.free.steps else "leave time.step out"
            self.own_notes.append(("error uncertain", f"{text}; the error may be larger; {fix}"))
        self.extremes = ExtremeErrors.of(result, *self.comparisons) if result.extremes and self.moves else None
        self.estimate, self.comparisons = estimate, None
        return True

    def next_estimate(self, result: RunSample) -> None:
        """Take over a finer result."""
        estimate = self.estimate
        assert estimate is not None
        self.excess = snap_excess(result.forces, estimate.run.forces)
        estimate.between = finer_between(self.times, estimate.between, result, estimate.run)
        estimate.update(result)
        self.extremes = self.extremes and self.extremes.after(result)
        for name, found in statistics_of(result, self._every).items() if self.statistics else ():
            self.statistics[name].update(found)

    def use_model_errors(self, run: RunSample) -> None:
        """Take what leaving bending out changes from a run, in place of what is known."""
        assert self.estimate is not None
        self.estimate.set_model_errors(run)
        for name, found in statistics_of(run, self._every).items() if self.statistics else ():
            self.statistics[name].set_model_errors(found)

    def state(self) -> tuple[Any, ...]:
        """What a finer result changes, for `go_back`."""
        before = self.judged(True).copied() if self.estimate is not None else None
        return before, self.extremes, self.excess, list(self.own_notes)

    def go_back(self, state: tuple[Any, ...]) -> None:
        """Be as before a finer result."""
        before, self.extremes, self.excess, self.own_notes[:] = state
        if before is not None:
            self.estimate, self.statistics = before.estimate, dict(before.statistics)

    def _set_statistics(self, result: RunSample, *comparisons: RunSample | None) -> None:
        """What errors of extremes and standard deviations are estimated by: the outputs that all runs have."""
        if not self.moves or not (self.irregular or (self.asked is not None and not self.asked.instant)):
            return
        coarse, rough, coarsest = comparisons
        assert coarse is not None
        self._every = max(run.every for run in comparisons if run is not None)
        self._of_statistics = partial(estimates, result, coarse, rough, coarsest, self._every)

    def next_resolution(self) -> Resolution | None:
        """The resolution of the next result; None: what is asked is met, or more of it would not help."""
        assert self.estimate is not None
        if self.asked is None:
            return None
        run, before, asked = self.estimate.run, self._ratio, self.asked
        if self.extremes is not None:  # not what limits ask for whose extremes a finer result showed no better
            asked = replace(asked, limits=tuple(x for x in asked.limits if not self.extremes.stalls(x.limit)))
        verdict = self.verdict(asked)
        if verdict.limit or asked.limits != self.asked.limits:  # what is asked of a limit, and judged, has changed
            before = np.inf
        while verdict.ratio > 1.0 and self._leaves_out(verdict, verdict.ratio / before):
            verdict, before = self.verdict(asked), np.inf
        if not self.irregular and self._slow_from is None:
            self.statistics = {}  # it is judged at every instant from now on
        before *= 1.0 if self.irregular else self.estimate.revised.get(RAW.get(verdict.name, ""), 1.0)
        self._ratio, falls = verdict.ratio, verdict.ratio / before  # 0 for the first
        self._judged += 1
        most = MOST_REFINEMENTS if self.moves else REFINEMENTS_AT_REST
        left = (IRREGULAR_REFINEMENTS if self.irregular else most) + 1 - self._judged
        stalls = falls > STALLED or (left > 0 and verdict.ratio * falls**left > 1.0)
        hopeless = left <= 0 or (stalls if self.moves else run.cells >= CELLS_AT_REST)
        along = self.asked.asks("curvature") or self.asked.asks("bending_moment")
        sharp = run.unresolved and self.free.mesh and (along or not self.irregular)  # else at the instant of a snap
        met = verdict.ratio <= 1.0 and not sharp
        if met or hopeless or sum(self.runs) > MOST_CPU or self._by_chance(verdict):
            return None
        if self.irregular:  # what neglected bending does to it is known as a bound alone, which moves no zones
            found = refined(run.resolution, verdict, self.free._replace(zones=False), IRREGULAR_FINER)
            now = run.resolution
            worth = found and max(found.fineness / now.fineness, now.step / max(found.step, 1e-300)) >= WORTH_REPEATING
            return found if worth else None
        if self.estimate.share_unknown or RAW.get(verdict.name, verdict.name) in self.estimate.shares_mixed:
            verdict = replace(verdict, time=max(verdict.time, verdict.mesh))  # either may be to blame
        found = refined(run.resolution, verdict, self.free)
        if found is None or (self.moves and not verdict.limit) or found.fineness == run.resolution.fineness:
            return found
        # cells that are hardly shorter lie otherwise beside edges of contact: their change says little of what is left;
        # and what is used of a limit grows by about its error, so that less is left
        return replace(found, fineness=max(found.fineness, COARSER * run.resolution.fineness))

    def _leaves_out(self, verdict: Verdict, falls: float) -> bool:
        """Whether what misses does not converge, and is not judged from now on: every instant, then a largest force."""
        if self.asked is None or self.asked.instant or verdict.limit:
            return False
        name = RAW.get(verdict.name, verdict.name)
        if not self.irregular:
            assert self.estimate is not None
            return self._turns_out_to_snap(self.estimate, name, falls)
        if not self.statistics:
            return False
        estimate, of_largest = self.statistics[LARGEST], verdict.statistic == LARGEST
        diverges = falls > STALLED or estimate.falls.get(name, np.nan) > DIVERGES
        if not (diverges or (of_largest and is_chance(self.statistics, LARGEST, name))):
            return False
        if verdict.statistic != LARGEST or verdict.name not in END_FORCES.values():
            return False
        if self._left_out:
            return False
        self.scattered = [name for raw, name in END_FORCES.items() if raw in estimate.order]  # a snap pulls at both
        return True

    def _turns_out_to_snap(self, estimate: Estimate, name: str, falls: float) -> bool:
        """Whether values at an instant do not converge, because the line snaps: in two slow falls, one after the other.

        Each is between runs of which one is twice as fine: in the runs that the first result is compared with, and from
        that to a finer one.  One alone is that of coarse runs, also of a regular motion that converges.
        """
        run = estimate.run
        if self._slow_from is None:
            slow = self._judged == 0 and self.moves and estimate.falls.get(name, np.nan) > DIVERGES
            self._slow_from = [float(run.cells), float(run.steps)] if slow else None
            return False
        if falls <= STALLED:
            self._slow_from = None
            return False
        cells, steps = run.cells / self._slow_from[0], run.steps / self._slow_from[1]
        twice = (cells >= TWICE or not self.free.mesh) and (steps >= TWICE or not self.free.steps)
        self.irregular = twice and falls > STALLED and snaps(run) and resolves_snaps(run)
        return self.irregular

    def _by_chance(self, verdict: Verdict) -> bool:
        """Whether what misses is an end force that another run would differ in as much, however fine."""
        name = RAW.get(verdict.name, "")
        if not self.irregular or not name or verdict.statistic not in self.statistics:
            return False
        diverges = self.statistics[verdict.statistic].falls.get(name, np.nan) > DIVERGES
        return bool(diverges) or is_chance(self.statistics, verdict.statistic, name)

    def note_missed(self, why: str = "") -> None:
        """Say that what was asked is not met, if so, whose doing it is, and what to try.

        why: a finer result did not come to its end; empty: none was to follow.
        """
        if self.asked is None or self.estimate is None:
            return
        verdict = self.verdict(self.asked)
        if verdict.ratio > 1.0:
            text = missed(verdict, self.free, len(self.runs), self._by_chance(verdict), self.stopped)
            self.own_notes.append(("accuracy missed", f"{verdict.text}; {why}" if why else text))

    def checkpoint(self) -> Tree:
        """What it has found until now, as named arrays and plain values."""
        found: dict[str, Any] = {"coarse": self.comparisons and [x and x.checkpoint() for x in self.comparisons]}
        found |= {"estimate": self.estimate and self.estimate.checkpoint(), "every": self._every}
        found |= {"statistics": {name: x.checkpoint() for name, x in self.statistics.items()}}
        found |= {"scattered": list(self.scattered), "excess": self.excess, "choice": list(self.choice)}
        found |= {"irregular": self.irregular, "ratio": self._ratio, "finer": self._judged}
        found |= {"notes": list(self.own_notes), "extremes": self.extremes and self.extremes.checkpoint()}
        return found | {"slow": list(self._slow_from or ()), "places": self.places if self.places is not None else ALL}

    def restore(
        self,
        tree: Mapping[str, Any],
        scene: LineScene,
        points: OutputPoints,
        source: Path | None = None,
        name: str = "",
    ) -> bool:
        """Continue as `checkpoint` has said; False: outputs of runs to compare with are no longer beside the result.

        points: of the result; source: its file; name: of the line.  ResultError or ValueError: it is none of this
        scene.
        """
        template: Tree = {"slow": [0.0] * len(tree.get("slow", ())), "ratio": np.inf, "finer": 0, "every": 1}
        template |= {"irregular": False, "excess": np.zeros(2), "places": ALL, "extremes": None}
        names = ("coarse", "estimate", "statistics", "scattered", "notes", "choice")
        # not in every checkpoint of 0.6
        older: Tree = {"choice": ["", ""], "excess": np.zeros(2), "slow": [], "places": ALL}
        older |= {"extremes": None}  # nor in 1.0
        known = {key: x for key, x in tree.items() if key in template or key in names}
        saved = matched(older | known, template | dict.fromkeys(names), "error control")
        places, found = saved["places"], True
        if places.size and not np.array_equal(places, compared_places(points)):
            raise ValueError("runs are compared at other output points than those of this scene")
        shape = len(output_times(scene)) + 1, places.size or points.s.size, points.jumps.size
        self._ratio, self._judged = saved["ratio"], saved["finer"]
        self._every, self.irregular, self.excess = saved["every"], saved["irregular"], saved["excess"]
        self._slow_from = list(saved["slow"]) or None
        if self._every < 1:
            raise ValueError("statistics of no outputs")
        self.own_notes = list(restored_notes(saved["notes"]))
        if saved["coarse"] is not None:
            try:
                first, second, third = (
                    x and replace(restored_sample(x, scene, shape, source, name), places=places)
                    for x in saved["coarse"]
                )
                self.comparisons = first, second, third
            except MissingRows:
                found = False
        if saved["estimate"] is not None:
            self.estimate = Estimate.restored(saved["estimate"], scene, shape)
            self.estimate.run, self.estimate.length = replace(self.estimate.run, places=places), self.length
            if saved["extremes"]:
                self.extremes = ExtremeErrors.restored(saved["extremes"], self.estimate.run)
        if saved["statistics"]:
            trees = matched(saved["statistics"], dict.fromkeys(STATISTICS), "statistics")
            self.statistics = {key: StatisticEstimate.restored(x, scene, (1, *shape[1:])) for key, x in trees.items()}
        self.choice = ModelChoice(*matched(saved["choice"], ["", ""], "choice"))
        if self.choice.kind not in ("", *WORDS):
            raise ValueError(f"model chosen: got {self.choice.kind!r}, expected one of {', '.join(WORDS)}")
        self.scattered = [key for key in END_FORCES.values() if key in list(saved["scattered"])]
        return found
