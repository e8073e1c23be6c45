"""Computes a scene as often and as finely as it takes for the accuracy that is asked.

First the result, which stands from then on, then the runs that its errors are estimated by; where these are larger
than asked, finer results follow, each from what the one before has shown.  What one of several lines asks for, all
get: their steps are the same, and the error of a line may come from the cells of the next.
docs/errors.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.accuracy.error_order import COARSER
from hybrid.accuracy.line_errors import LineErrors
from hybrid.accuracy.model_choice import goes_by_cells, with_model_errors
from hybrid.accuracy.refinement import COSTLY_ACCURACY, NOT_KEPT, costly, is_no_better, not_kept_text
from hybrid.accuracy.run_forecast import Budget
from hybrid.errors import ComputationError, SceneError
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution
from hybrid.scene.schema import LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.restart import resolution_from, resolution_tree
from hybrid.simulation.run_sample import RunSample, Samples, restored_notes
from hybrid.store.integrity import Tree, matched


def comparison_resolutions(
    resolution: NetworkResolution, moves: bool
) -> tuple[NetworkResolution, NetworkResolution, NetworkResolution]:
    """Of the runs to compare with: longer cells and steps; the same cells, longer steps still; longer cells as well.

    moves: whether there are steps at all.
    """
    longer = COARSER if moves else 1.0
    return (
        resolution.coarser(COARSER, longer),
        resolution.coarser(COARSER, longer**2),
        resolution.coarser(COARSER**2, longer**2),
    )


@dataclass
class ErrorController:
    """Chooses mesh, step and zones of one run after the other until the accuracy that is asked is met.

    lines: what is known of the errors of each, by name.  case: computes runs to compare with; result: computes the
    result, and raises ComputationError; decide: lets a finer result take the place of that before it, or drops it.
    Its `checkpoint` is in the file of every result, so that what was cut off continues with `proceed`.
    """

    lines: Mapping[str, LineErrors]
    case: Case
    result: Callable[[NetworkResolution], Samples]
    decide: Callable[[bool], None] = lambda kept: None
    budget: Budget | None = None  # of all results; None: there is no limit
    runs: list[float] = field(default_factory=list)  # s of processor time, of all runs so far
    first: NetworkResolution | None = None  # that the runs to compare with are for; the result may be finer
    next: NetworkResolution | None = None  # of the result that is to be computed
    compared: Tree | None = None  # checkpoint of the first result with its comparisons, as long as that stands
    standing: Samples = field(default_factory=dict)  # the result in its place
    notes: list[tuple[str, str]] = field(default_factory=list)  # events of all lines
    _touching: set[str] = field(default_factory=set)  # lines that could touch themselves in runs to compare with
    _lost: bool = False  # whether the runs to compare with are to be computed again

    def __post_init__(self) -> None:
        for line in self.lines.values():
            line.runs = self.runs

    @property
    def known(self) -> bool:
        """Whether errors of a line are."""
        return any(x.estimate is not None for x in self.lines.values())

    @property
    def chosen(self) -> list[str]:
        """Names of lines that were chosen to be catenaries."""
        return [name for name, x in self.lines.items() if x.choice.kind == "catenary"]

    def start(self, resolution: NetworkResolution) -> None:
        """From a first resolution to the result and its errors."""
        self.first = self.next = resolution
        self.proceed()

    def proceed(self) -> None:
        """The same from the next result on."""
        if self._lost:
            self.runs.clear()
            self.notes.clear()
            for line in self.lines.values():
                line.comparisons = None
                line.own_notes.clear()
            self._lost = False
        unknown: Samples | None = None  # the last result, as long as its errors are not known
        while self.next is not None:
            resolution, own = self.next, len(self.runs)
            try:
                result = self._counted(self.result(resolution))
            except ComputationError as error:
                if not self._goes_on(error, resolution, unknown):
                    return
                continue
            if self.budget is not None:
                self.budget.spend([*result.values()])
            if self.known:
                self._judge_finer(resolution, result)
            else:
                unknown = self._judge_first(result, own)
                if unknown is not None:
                    continue
            if self.next is not None and not any(kind == COSTLY_ACCURACY for kind, _ in self.notes):
                self.notes += costly(self.runs, next(iter(self.standing.values())), self.next.one)
        for line in self.lines.values():
            line.note_missed()

    def _goes_on(self, error: ComputationError, resolution: NetworkResolution, unknown: Samples | None) -> bool:
        """Whether another result follows one that has failed; raises the error where there is none before it."""
        if self.known:
            why = f"a finer run failed: {str(error).splitlines()[0]}"
            self.notes.append((NOT_KEPT, f"{why}; the result is the one before"))
            self.without_refinement(why)
            return False
        if unknown is not None:
            self._lacks_errors(error, "finer run")
            self.standing = unknown
            return False
        if not any([x.finds_no_rest(error) for x in self.lines.values()]):
            raise error
        self.first = self.next = self._halved(resolution, steps=False)
        return True

    def _judge_first(self, result: Samples, own: int) -> Samples | None:
        """Compare a first result with coarser runs; the result itself where a finer one follows, as these fail.

        own: its number among the runs.
        """
        if not self._is_compared:
            self._compare(self.first or _finely(result))
        cells, steps = (any(x) for x in zip(*(x.halves for x in self.lines.values()), strict=True))
        finer = self._halved(_finely(result), steps)
        if not self._is_compared and (cells or steps) and self._allows(result, finer):
            self.decide(True)  # it may be beside the one before
            for line in self.lines.values():
                line.halve()
            self.first = self.next = finer
            return result
        if any(x.asked is not None for x in self.lines.values()):
            # else no finer result follows, and they need not stay in memory
            self.compared = self.checkpoint() | {"runs": np.delete(self.runs, own), "budget": []}
        self.standing, self.next = result, None
        judged = self._estimated(result, {})
        self.decide(True)  # it may be beside one of another model
        if judged:
            self._judge(result, judged, stricter=False)
        return None

    def _lacks_errors(self, error: ComputationError | SceneError, what: str = "coarser run to compare with") -> None:
        for line in self.lines.values():
            line.lacks_errors(error, what)

    def without_refinement(self, why: str) -> None:
        """Say what the result misses as it is, where a finer one did not come to its end."""
        for line in self.lines.values():
            line.note_missed(why)

    # --- how finely -----------------------------------------------------------------------------

    def _halved(self, now: NetworkResolution, steps: bool) -> NetworkResolution:
        """Cells half as long, of lines that leave their mesh open; steps: whether those are, too."""
        finer, longer = 1.0 / COARSER, 1.0 / COARSER if steps else 1.0
        return NetworkResolution(
            {name: x.coarser(finer if self.lines[name].free.mesh else 1.0, longer) for name, x in now.lines.items()}
        )

    def _finer(self, now: NetworkResolution, wanted: Mapping[str, Resolution]) -> NetworkResolution:
        """As fine as the finest that is wanted; what the scene gives stays."""
        if len(now.lines) == 1:
            return NetworkResolution(dict(wanted))
        cells = max(x.fineness / now.lines[name].fineness for name, x in wanted.items())
        steps = min(x.step / now.one.step if now.one.step else 1.0 for x in wanted.values())
        found = {}
        for name, x in now.lines.items():
            free, zones = self.lines[name].free, min(x.zones, wanted[name].zones if name in wanted else x.zones)
            finer = x.coarser(1.0 / cells if free.mesh else 1.0, steps if free.steps else 1.0)
            found[name] = replace(finer, zones=zones)
        return NetworkResolution(found)

    def _allows(self, result: Samples, finer: NetworkResolution) -> bool:
        """Whether the budget does."""
        return self.budget is None or self.budget.allows([*result.values()], [finer.lines[x] for x in result])

    # --- judgement ------------------------------------------------------------------------------

    def _judge(self, result: Samples, judged: Sequence[str], stricter: bool) -> None:
        """Whether the result is as accurate as asked, and what follows.

        judged: lines with errors; stricter: zones of some are others than those whose model error is known.
        """
        if stricter or any(x.estimate is not None and x.estimate.lacks_model_errors() for x in self.lines.values()):
            self._renew_model_errors(result)
        asked = {name: self.lines[name].next_resolution() for name in judged}
        wanted = {name: x for name, x in asked.items() if x is not None}
        for line in self.lines.values():
            line.stopped = ""
        self.next = self._finer(_finely(result), wanted) if wanted else None
        if self.next is not None and not self._allows(result, self.next):
            assert self.budget is not None
            text = self.budget.text([*result.values()], [self.next.lines[x] for x in result])
            for line in self.lines.values():
                line.stopped = text
            self.next = None

    def _judge_finer(self, resolution: NetworkResolution, result: Samples) -> None:
        """The same of a finer result; where it is the last and no better than that before it, that one stays."""
        kept, notes = {k: x.state() for k, x in self.lines.items()}, list(self.notes)
        before = {name: x[0] for name, x in kept.items() if x[0] is not None}
        try:
            known = {k: x.estimate for k, x in self.lines.items() if x.estimate is not None}
            # zones that may leave out less than those of the result before
            stricter = [k for k, x in known.items() if resolution.lines[k].zones < x.run.resolution.zones]
            anew = any(known[k].differs_in_zones(result[k]) for k in stricter) or self._touches_now(result)
            if anew:  # runs to compare with have other zones, or no contact
                self._compare(resolution)
                anew = self._is_compared
            judged = self._estimated(result, before, anew)
            self._judge(result, judged, bool(stricter) and not anew)
        except KeyboardInterrupt:  # in a run to compare with: the finer result stays beside, until it is resumed
            for name, x in self.lines.items():
                x.go_back(kept[name])
            self.notes[:], self.next = notes, resolution
            raise
        asked = {n: x.asked for n, x in self.lines.items() if x.asked is not None}
        if not asked or self.next is not None:
            self._use_finer(result)
            return
        finer = {n: x.judged(x.irregular) for n, x in self.lines.items() if x.estimate is not None}
        found = is_no_better(asked, before, finer)
        if found is None:
            self._use_finer(result)
            return
        for name, line in self.lines.items():
            if name in before and name in finer:
                line.keep(before[name], finer[name])
        self.notes.append((NOT_KEPT, not_kept_text(next(iter(result.values())), found)))
        self.decide(False)

    def _estimated(self, result: Samples, before: Mapping[str, Any], anew: bool = False) -> list[str]:
        """Take over a result; names of the lines whose errors are known with it.

        before: of those whose errors are known without it; anew: whether they are known from runs that are new.
        """
        if not before and self._touches_now(result):
            self._compare(self.first or _finely(result))  # with contact now
        faster, judged = cache(self._in_shorter_steps), []
        for name, line in self.lines.items():

            def shorter(name: str = name) -> RunSample | None:
                return (faster() or {}).get(name)

            if (name not in before or anew) and line.first_estimate(result[name], shorter):
                judged.append(name)
            elif name in before:
                line.next_estimate(result[name])
                judged.append(name)
        return judged

    def _touches_now(self, result: Samples) -> bool:
        """Whether lines touch themselves in a result, and did not where they could not, in runs to compare with."""
        return any(x.touches and name not in self._touching for name, x in result.items())

    def _use_finer(self, result: Samples) -> None:
        self.decide(True)
        self.standing, self.compared = result, None

    # --- runs to compare with -------------------------------------------------------------------

    @property
    def _is_compared(self) -> bool:
        """Whether there are runs to compare with, from which no errors are known yet."""
        return any(x.comparisons is not None for x in self.lines.values())

    def _compare(self, resolution: NetworkResolution) -> None:
        """Compute the runs to compare with; there are none where the first of them fails."""
        for line in self.lines.values():
            line.comparisons = None
        found: list[Samples | None] = [None, None, None]
        each = comparison_resolutions(resolution, self.case.moves)
        which = (0, 1, 2) if self.case.moves else (0, 2)  # without steps the second is the first
        samples = [partial(self.case.sample, each[k]) for k in which]
        with self.case.beside(samples) as runs:
            for k, run in zip(which, runs, strict=True):
                try:
                    found[k] = self._counted(run())
                except (ComputationError, SceneError) as error:  # a scene may have too few of its cells
                    if not k:
                        self._lacks_errors(error)
                        return
                if not k and (first := found[0]) is not None:
                    self._touching = {name for name, x in first.items() if x.touches}
        first = found[0]
        if first is not None and not goes_by_cells(self.case, first):  # when no run beside reads the scene any more
            found[0] = with_model_errors(self.case, first, self.runs)
        for name, line in self.lines.items():
            one, second, third = (None if x is None else x[name] for x in found)
            assert one is not None
            line.comparisons = one, second, third

    def _renew_model_errors(self, result: Samples) -> None:
        """What leaving bending out changes in the result, on its own cells."""
        found = with_model_errors(self.case, result, self.runs)
        for name, line in self.lines.items():
            if line.estimate is not None and found[name] is not result[name]:
                line.use_model_errors(found[name])

    def _in_shorter_steps(self) -> Samples | None:
        """The first of the runs to compare with in steps as short as those of the result; None: it fails."""
        coarse = {name: x.comparisons[0] for name, x in self.lines.items() if x.comparisons is not None}
        finely = {k: x.resolution.coarser(1.0, 1.0 / COARSER) for k, x in coarse.items()}
        finely = {k: replace(x, every=coarse[k].every) for k, x in finely.items()}
        try:
            return self._counted(self.case.sample(NetworkResolution(finely)))
        except ComputationError:
            return None

    def _counted(self, run: Samples) -> Samples:
        self.runs.append(next(iter(run.values())).cpu)
        return run

    # --- checkpoints ----------------------------------------------------------------------------

    def checkpoint(self) -> Tree:
        """What it has found until now, as named arrays and plain values."""
        found: dict[str, Any] = {"runs": np.array(self.runs), "notes": list(self.notes)}
        found |= {"next": self.next and _tree(self.next), "first": self.first and _tree(self.first)}
        found |= {"budget": self.budget.checkpoint() if self.budget is not None else []}
        return found | {"touching": sorted(self._touching), "lines": {k: x.checkpoint() for k, x in self.lines.items()}}

    def restore(
        self, tree: Mapping[str, Any], source: Path | None = None, kept: NetworkResolution | None = None
    ) -> None:
        """Continue as `checkpoint` has said.

        source: the file of the result; kept: how finely it was computed.  Runs to compare with whose outputs are no
        longer beside it are computed again.  ResultError or ValueError: it is none of this scene.
        """
        scenes, points = self.case.lines, self.case.points
        tree = _as_now(tree, scenes, kept)
        template: Tree = {"runs": np.zeros(0)}
        names = ("next", "first", "lines", "budget", "notes", "touching")
        saved = matched(
            {"touching": True, "notes": [], "first": None, "budget": []} | dict(tree),
            template | dict.fromkeys(names),
            "error control",
        )
        self.runs[:] = saved["runs"].tolist()
        touching = saved["touching"]  # whether all could, in files of 1.0
        self._touching = set(scenes if touching is True else touching or ())
        self.notes = list(restored_notes(saved["notes"]))
        self.next, self.first = (x and _resolution(x, scenes) for x in (saved["next"], saved["first"]))
        if self.budget is not None and saved["budget"]:
            self.budget.restore(matched(saved["budget"], [0.0, 0.0], "budget"))
        if (set(saved["lines"]) | self._touching) - set(scenes):
            raise ValueError("errors of other lines")
        for name, line in saved["lines"].items():
            on_disk = scenes[name], points[name], source, self.case.names[name]
            self._lost |= not self.lines[name].restore(line, *on_disk)
        self.standing = {k: x.estimate.run for k, x in self.lines.items() if x.estimate is not None}
        if self.next is None and not self.known:
            raise ValueError("neither a result nor one that is to come")


def _finely(runs: Samples) -> NetworkResolution:
    return NetworkResolution({name: x.resolution for name, x in runs.items()})


def _tree(resolution: NetworkResolution) -> Tree:
    return {name: resolution_tree(x) for name, x in resolution.lines.items()}


def _resolution(tree: Any, scenes: Mapping[str, LineScene]) -> NetworkResolution:
    if set(tree) != set(scenes):
        raise ValueError("resolutions of other lines")
    return NetworkResolution({name: resolution_from(tree[name], x) for name, x in scenes.items()})


def _as_now(
    tree: Mapping[str, Any], scenes: Mapping[str, LineScene], kept: NetworkResolution | None
) -> Mapping[str, Any]:
    """A checkpoint of before as one of now: of a cable, or how finely several lines were computed first."""
    if "lines" in tree:
        return tree
    if "estimate" not in tree:
        return {"runs": np.zeros(0), "next": kept and _tree(kept), "first": tree, "lines": {}}
    (name,) = scenes
    of_all = {key: tree[key] for key in ("runs", "budget") if key in tree}
    finely = {key: tree[key] and {name: tree[key]} for key in ("next", "first") if key in tree}
    return of_all | finely | {"lines": {name: tree}}
