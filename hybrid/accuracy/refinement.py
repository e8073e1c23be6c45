"""Whether a result is as accurate as asked, and how the next one is refined.

A refinement chooses mesh, step and zones of the finer result, which of the two it returns, and when the finer one
replaces the other.
"""

from __future__ import annotations

import copy
import io
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, log10, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.accuracy.error_estimate import Estimate
from hybrid.accuracy.error_order import Errors, magnitude
from hybrid.accuracy.error_statistics import LARGEST, STATISTICS, ExtremeErrors, StatisticEstimate
from hybrid.errors import AS_MUCH
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Limited, RequestedAccuracy, Resolution
from hybrid.outputs.probes import SIDED_ERRORS as RIGHT_OF
from hybrid.scene.analysis import ALONG, NOT_ASKED, ROUGHEST
from hybrid.simulation.run_sample import END_FORCES, RunSample, Samples

# Part of what is asked that the next run aims at.
AIM = 0.7
# Zones become stricter when the model makes more than the first of what is asked, so that it makes the second.
MOST_OF_MODEL, OF_MODEL = 0.5, 0.25
# A run is at most this much finer than the one before.
MOST_FINER = 3.0
# Factor on cells or steps where the error is met in parts and missed in total.
A_LITTLE = 0.8
COSTLY = 4.0  # times the processor time of its last run, from which on an accuracy announces what it will cost
COSTLY_ACCURACY = "costly accuracy"  # kind of that event
LITTLE = 0.5  # s, below which no cost is announced
# s of processor time that a finer run will take, from which on the errors of the result before it are written first.
WORTH_WRITING = 2.0
END_FORCE = next(iter(END_FORCES.values()))
RAW = {of: raw for raw, of in END_FORCES.items()}  # what runs call the forces at the ends


class Free(NamedTuple):
    """What the program may choose: the mesh, the time step, how much bending zones may neglect."""

    mesh: bool
    steps: bool
    zones: bool
    follows: bool = False  # whether cells follow the curvature


@dataclass(frozen=True)
class Verdict:
    """Estimated error over what is asked, of the quantity where that is largest; and its parts by cause."""

    ratio: float
    mesh: float
    time: float
    model: float
    text: str
    reached: str = ""  # what of it is missed, as this run meets it: an accuracy as a scene writes it
    name: str = ""  # of the quantity
    statistic: str = ""  # of it, that is judged; empty: every output
    limit: str = ""  # that it is held against, with its extremes over all steps


def judge(
    asked: RequestedAccuracy,
    errors: Errors,
    run: RunSample,
    skip: Collection[str] = (),
    extremes: ExtremeErrors | None = None,
) -> Verdict:
    """How the errors of a run compare with what is asked: at a ratio of 1 or less they are met.

    skip: quantities that are not judged; extremes: errors over all steps, by which limits are.
    """
    worst, reached = Verdict(0.0, 0.0, 0.0, 0.0, "nothing is asked"), dict[str, tuple[float, str]]()
    for bound in bounds_of(asked, run):
        name = bound.name
        if bound.size <= 0.0 or name in skip:
            continue
        total, size, over_steps = _decisive(errors, bound, extremes)
        key = "tension" if name in END_FORCES.values() else "line_tension" if name == "tension" else name
        if total > max(size, reached.get(key, (0.0, ""))[0]) and bound.limit is None:
            reached[key] = total, _reached(key, bound.unit, total, bound.of)
        if total / size >= worst.ratio:
            model = _largest(errors, "model", bound)
            mesh, time = (_largest(errors, cause, bound) / size for cause in ("mesh", "time"))
            share = (total - model) / size / (mesh + time) if mesh + time > 0.0 else 0.0
            mesh, time = mesh * share, time * share  # of what they make together, where they cancel
            limit = bound.limit.limit if bound.limit is not None else ""
            if extremes is not None and over_steps:
                by_steps = extremes.of_steps[limit]
                shares = (total / size * x for x in (1.0 - by_steps, by_steps))
                mesh, time = (_as_second_order(x, extremes.orders[limit]) for x in shares)
            text = f"{bound.words}: error {total:.3g} {bound.unit}, asked {size:.3g} {bound.unit}"
            worst = Verdict(total / size, mesh, time, model / size, text, name=name, limit=limit)
    every = [f"all: {100.0 * asked.every:.3g}%"] if asked.every is not None and reached else []
    return replace(worst, reached=", ".join([*every, *(text for _, text in reached.values())]))


def _as_second_order(part: float, p: float) -> float:
    """Part of what is asked, of an error of order p, that by order 2 asks for as much finer cells or steps."""
    return AIM * (part / AIM) ** (2.0 / p) if part > AIM else part


class Bound(NamedTuple):
    """An error that is asked of a quantity, in a unit: over all of the line, or as % of a limit of sections.

    of: that of which a part is asked; used: how much of the limit is used.
    """

    name: str
    unit: str
    size: float
    of: float | None = None
    limit: Limited | None = None
    used: float = 0.0

    @property
    def words(self) -> str:
        """What the error is of."""
        name = self.name.replace("end_force_", "force at the ").replace("_", " ")
        return name if self.limit is None else f"{name} over its limit, {self.limit.limit}"


def bounds_of(asked: RequestedAccuracy, run: RunSample) -> list[Bound]:
    """What is asked of a run that has it."""
    bounds: list[Bound] = []
    step = run.resolution.step if run.steps > 1 else 0.0
    if asked.position is not None:
        position = asked.sized(run.reach).position if asked.of_motion is not None else asked.position
        assert position is not None
        bounds.append(Bound("position", "m", position))
    for name in END_FORCES.values():
        if asked.tension is not None:
            bounds.append(Bound(name, "N", asked.tension))
        if asked.of_end_force is not None:
            size = max(asked.of_end_force * run.largest_end_force, asked.round_off("N", step))
            bounds.append(Bound(name, "N", size, run.largest_end_force))
    for name, unit, part in (
        ("curvature", "1/m", asked.of_curvature),
        ("bending_moment", "N m", asked.of_moment),
        ("tension", "N", asked.of_tension),
    ):
        if part is not None and name in run.values:
            largest = run.largest(name)
            bounds.append(Bound(name, unit, max(part * largest, asked.round_off(unit, step)), largest))
    for x in (limit.at_points(run.places) for limit in asked.limits):
        if x.quantity in run.values:
            used = _used(x, run)
            bounds.append(Bound(x.quantity, "%", 100.0 * x.part(used), limit=x, used=used))
    return bounds


def sizes_of(asked: RequestedAccuracy, run: RunSample) -> dict[str, float]:
    """The errors that are asked over all of the line, by quantity."""
    return {x.name: x.size for x in bounds_of(asked, run) if x.limit is None}


def _used(limit: Limited, run: RunSample) -> float:
    """How much of a limit a run uses over all steps, of an equilibrium at its output points; 1: all of it."""
    if limit.limit in run.extremes:
        return float(run.extremes[limit.limit].max())
    sides = (limit.quantity, limit.allowed), (f"right/{limit.quantity}", limit.allowed_right)
    each = [np.nanmax(run.most(name) / allowed, initial=0.0) for name, allowed in sides if name in run.values]
    return float(max(each))


def asked_text(asked: RequestedAccuracy, run: RunSample) -> str:
    """What is asked of a run, in words and numbers."""
    used = {x.limit.limit: x.used for x in bounds_of(asked, run) if x.limit is not None}
    return asked.describe(run.reach if asked.of_motion is not None else None, used)


def asked_quantities(asked: RequestedAccuracy, run: RunSample) -> str:
    """Names of the quantities of which something is asked of a run, with commas between."""
    return ",".join(dict.fromkeys(bound.name for bound in bounds_of(asked, run)))


def not_asked_text(asked: RequestedAccuracy, errors: Errors, run: RunSample) -> str:
    """That curvature or bending moment are not asked, where the error of one is more than a part; else empty."""
    for name in ("bending_moment", "curvature"):
        largest = run.largest(name) if name in run.values else 0.0
        error = max(errors.largest("total", side) for side in (name, f"right_{name}"))
        if not asked.asks(name) and largest > 0.0 and error > asked.coarsest_part * largest:
            if asked.asks("curvature"):
                continue  # a moment goes with it
            part = float(f"{100.0 * error / largest:.2g}")
            return f"{name.replace('_', ' ')} is not asked, its error is {part:.9g} % of its largest"
    return ""


def figures(
    asked: RequestedAccuracy,
    errors: Sequence[Errors],
    run: RunSample,
    by_chance: Collection[str] = (),
    extremes: ExtremeErrors | None = None,
) -> list[dict[str, str | float | None]]:
    """What is asked of each quantity, and its error, the largest of several; errors: empty where they are not known.

    by_chance: end forces whose largest values are, so that their error misses nothing; extremes: as of `judge`.
    """
    out: list[dict[str, str | float | None]] = []
    for bound in bounds_of(asked, run):
        known = bool(errors) and all(bound.name in x.fields.get("total", {}) for x in errors)
        found = [_decisive(x, bound, extremes)[:2] for x in errors]
        error, size = max(found, key=lambda x: x[0] / max(x[1], 1e-300)) if known else (None, bound.size)
        name = bound.name if bound.limit is None else bound.words
        out.append({"quantity": name, "of": bound.name, "unit": bound.unit, "asked": size, "error": error})
        if bound.name in by_chance:
            out[-1]["by_chance"] = 1.0
    return out


def not_converged(found: Mapping[str, float], asked: RequestedAccuracy | None) -> list[tuple[str, str]]:
    """Events of quantities that finer runs change as much as coarser ones did; found: by how many times as much."""
    texts: dict[str, list[str]] = {}
    for name, times in found.items():
        named = asked is None or asked.asks(name) or (name == "tension" and asked.asks(END_FORCE))
        kind = "error uncertain" if named else "not converged"  # forces at the ends are that tension too
        texts.setdefault(kind, []).append(f"{name.replace('_', ' ')} ({times:.2g} times)")
    end = "the error may be larger than its figure"
    return [(kind, f"{AS_MUCH}: {', '.join(names)}; {end}") for kind, names in texts.items()]


def times_the_cost(now: Resolution, finer: Resolution) -> float:
    """How many times as long as a run a finer one takes."""
    if now.local and finer.local:  # an error of a step of third order, not the longest step, decides how many there are
        steps = float(now.local / finer.local) ** (1.0 / 3.0)
    else:
        steps = now.step / finer.step if finer.step else 1.0
    return finer.fineness / now.fineness * steps


def costly(runs: Sequence[float], before: RunSample, resolution: Resolution) -> list[tuple[str, str]]:
    """Before a finer run: the event that says so where all runs take more than COSTLY times as long as it will.

    runs: s of processor time, until now; before: the last result; resolution: of the finer one.
    """
    one = before.cpu * times_the_cost(before.resolution, resolution)
    total = sum(runs) + one
    if total <= COSTLY * one or total < LITTLE:
        return []
    text = (
        f"run {len(runs) + 1} is made for this accuracy: all of them take about {total:.2g} s of processor time, "
        f"{total / one:.2g} times that run alone"
    )
    return [(COSTLY_ACCURACY, text)]


def missed(verdict: Verdict, free: Free, runs: int, chance: bool, stopped: str = "") -> str:
    """That what was asked is not met, whose doing it is, and what to try.

    runs: how many there were; chance: whether another run would differ in what is missed as much, however fine;
    stopped: why no finer run was made that would help.
    """
    main = max((verdict.mesh, "mesh"), (verdict.time, "time step"), (verdict.model, "model"))[1]
    is_free = {"mesh": free.mesh, "time step": free.steps, "model": free.zones}[main]
    fixed = {"mesh": "mesh (or cells of zones)", "time step": "time.step", "model": "model, or its tolerance"}[main]
    try_ = f"leave {fixed} out"
    if is_free:
        try_ = f"accuracy: {{{verdict.reached}}}, which this run meets"
        try_ += ", or compare with model: rod" * (verdict.model > 0.0)
    if main == "model" and not is_free:
        try_ = "model: adaptive, or rod"
    whose = f"most of it is of the {main}"
    if chance:
        whose = "the line snaps at other instants in every run, and finer ones differ as much"
        try_ = f"a longer run, several seeds, or accuracy: {{{verdict.reached}}}, which this run meets"
    if stopped:
        whose, try_ = stopped, f"accuracy: {{{verdict.reached}}}, which this run meets; or such a mesh and steps"
    if not verdict.reached:  # a verdict on a limit, which no other accuracy settles
        try_ = "mesh.cells and time.step finer than these"
    return f"{verdict.text}; {whose}, {runs} runs; try: {try_}"


def _decisive(errors: Errors, bound: Bound, extremes: ExtremeErrors | None) -> tuple[float, float, bool]:
    """Largest error of what a bound is for, what is asked of it, in its unit, and whether it is that over all steps.

    Over all steps, where it is for a limit, no more is asked than the verdict needs, which is all that is left.
    """
    found, limit = _largest(errors, "total", bound), bound.limit
    if extremes is None or limit is None or limit.limit not in extremes.errors:
        return found, bound.size, False
    over_steps, left = 100.0 * extremes.largest(limit.limit), max(bound.size, 100.0 * (1.0 - bound.used))
    steps = over_steps / left >= found / bound.size
    return (over_steps, left, True) if steps else (found, bound.size, False)


def _largest(errors: Errors, cause: str, bound: Bound) -> float:
    """Largest error of what a bound is for, in its unit, on either side of points where it has two values."""
    name, limit = bound.name, bound.limit
    sides = (name, f"right_{name}") if name in RIGHT_OF else (name,)
    if limit is None:
        return max(errors.largest(cause, side) for side in sides)
    each = zip(sides, (limit.allowed, limit.allowed_right), strict=True)
    return 100.0 * max(errors.largest(cause, side, allowed) for side, allowed in each)


def _reached(key: str, unit: str, total: float, most: float | None) -> str:
    """An accuracy that an error of `total` meets, with a tenth to spare; most: that of which a part is asked."""
    amount = 1.1 * total
    if most is not None and (amount <= ROUGHEST * most or key in ALONG):
        if not most:
            return f"{key}: {NOT_ASKED}"  # a part of nothing
        amount, unit = 100.0 * amount / most, "%"
        if amount > 100.0 * ROUGHEST and key != "bending_moment":
            return f"{key}: {NOT_ASKED}"
        if amount > 100.0 * ROUGHEST:
            return f"{key}: none, its error is {100.0 * total / most:.2g}%"
    digit = 10.0 ** (floor(log10(amount)) - 1) if amount > 0.0 else 1.0
    return f"{key}: {ceil(amount / digit) * digit:.6g} {unit}".replace(" %", "%")


def refined(resolution: Resolution, verdict: Verdict, free: Free, most: float = MOST_FINER) -> Resolution | None:
    """What should meet what is asked, by order 2, at least cost; None: nothing that is free would help.

    most: how much finer cells and steps may be.  Errors of mesh and step add, and cost grows with fineness over step:
    half of what is asked is for each.
    """
    zones, model = resolution.zones, verdict.model
    if free.zones and model > MOST_OF_MODEL:
        zones *= OF_MODEL / model  # at once: zones that are too strict cost what rods do, one run more costs as much
        model = OF_MODEL
    if model >= AIM or (verdict.mesh > 1.0 and not free.mesh) or (verdict.time > 1.0 and not free.steps):
        return None  # what is fixed is wrong by more than is asked
    goal = AIM - model
    mesh = verdict.mesh if free.mesh else 0.0
    time = verdict.time if free.steps else 0.0
    goal_mesh = goal - (verdict.time if not free.steps else min(time, 0.5 * goal))
    goal_time = goal - (verdict.mesh if not free.mesh else min(mesh, 0.5 * goal))
    least = 1.0 / most
    cells = min(max(sqrt(max(goal_mesh, 0.0) / mesh), least), 1.0) if mesh > 0.0 else 1.0
    steps = min(max(sqrt(max(goal_time, 0.0) / time), least), 1.0) if time > 0.0 else 1.0
    if min(cells, steps) > 0.95 and zones == resolution.zones:
        if mesh == time == 0.0:
            return None
        cells, steps = (A_LITTLE, steps) if mesh >= time else (cells, A_LITTLE)
    return replace(resolution.coarser(cells, steps), zones=zones)


Target = Path | io.BytesIO
Record = Callable[[NetworkResolution, Target], Samples]

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


class FinerResult:
    """Records results one after the other, those after the first beside it.

    `decide` lets such a one take its place, or drops it.
    """

    def __init__(
        self, target: Target, first: Record, refinement: Record, waits: Callable[[bool], bool], goes_on: bool
    ) -> None:
        """waits: settles one that waits in memory, so that it needs no file; False: none does.

        goes_on: whether one that was stopped stays beside, for whoever goes on with it.
        """
        self.target, self._first, self._refinement = target, first, refinement
        self._waits, self._goes_on, self._done = waits, goes_on, False
        self._new: Target | None = None  # complete, and not settled

    def __call__(self, resolution: NetworkResolution) -> Samples:
        """Record a result; a finer one is then to be settled.

        One that fails leaves nothing, and one that is stopped leaves only what can be restarted.
        """
        if not self._done:
            found, self._done = self._first(resolution, self.target), True
            return found
        new = io.BytesIO() if isinstance(self.target, io.BytesIO) else beside(self.target)
        self._new = new
        try:
            return self._refinement(resolution, new)
        except BaseException as error:
            if not (self._goes_on and isinstance(error, KeyboardInterrupt)):
                self.decide(False)
            raise

    def decide(self, kept: bool) -> None:
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


def beside(target: Path) -> Path:
    """Where a finer result is computed, until it is complete."""
    return target.with_name(f".{target.name}.finer")
