"""Errors of extremes and of the statistics of an irregular motion.

Extremes are those over all steps and nodes that limits are held against, which outputs do not show.  Runs to compare
with keep their extremes as the result does.  Of three, each r times as fine as the one before, the two changes give the
order p, the last one the error:

    symbol   meaning                                                   unit
    x        extremes of a run (hybrid.store.limits.extremes_about)    that of the limit
    c, b     change by the last refinement, and by that before         that of x
    r, q     how many times as fine these have made the run            -
    p        order: c/b = q^-p (1 - r^-p)/(1 - q^-p), largest c and b  -
    e        error of the last run: max(c, b q^-p ..)/(r^p - 1)        that of x

An extreme may agree in two runs by chance, or because it stands at another place: so each place has its own change, and
what the change before foretells of the next counts as well.  p may be far below 1: where cells do not show a bend,
finer ones find a sharper one every time.

Where a line snaps or the sea is irregular, runs differ at an instant however fine they are: a snap comes a little
earlier or later.  Extremes over windows and standard deviations converge, and mostly the largest value of a run.
docs/errors.md
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from hybrid.accuracy.error_estimate import Estimate
from hybrid.accuracy.error_order import (
    CLEARLY_FINER,
    COARSER,
    MOST_ORDER,
    ORDER,
    Errors,
    Falls,
    blended,
    refinement,
    snap_times,
    steps_in_rise,
)
from hybrid.kernels.state.state import Floats
from hybrid.model.resolution import RequestedAccuracy
from hybrid.scene.schema import LineScene
from hybrid.simulation.run_sample import END_FORCES, RunSample, every_of
from hybrid.store.integrity import Tree, matched
from hybrid.store.limits import EXTREMES, OF_SECTIONS, RANGES

# Orders that extremes may show: 0.25 makes an error of five times the last change.
LEAST_ORDER, MOST_EXTREME_ORDER = 0.25, 2.0
# The order where two changes do not show it: that of contact and impact.
EXTREME_ORDER = 1.0
# Below this order cells and steps a third as long leave 0.6 of an error, and further results are not worth their time.
STALLED_ORDER = 0.5
# Runs that are less than so many times as fine as the one before show nothing by what they change.
HARDLY_FINER = 1.1


@dataclass(frozen=True)
class ExtremeErrors:
    """Errors of the extremes of a result, by the names of `extremes_about`."""

    run: RunSample
    errors: Mapping[str, np.ndarray]  # e
    changes: Mapping[str, np.ndarray]  # c
    before: Mapping[str, float]  # the largest b
    refined: float  # r
    of_steps: Mapping[str, float]  # part of the last change that shorter steps have made
    orders: Mapping[str, float]  # p
    results: int = 1  # that there were, each finer than the one before

    @classmethod
    def of(
        cls, result: RunSample, coarse: RunSample, rough: RunSample | None, coarsest: RunSample | None
    ) -> ExtremeErrors:
        """From runs to compare with, as of `Estimate`."""
        changes = _changes(result.extremes, coarse.extremes)
        first = _changes(coarse.extremes, coarsest.extremes) if coarsest is not None else {}
        by_steps = _changes(coarse.extremes, rough.extremes) if rough is not None else {}
        errors, shares, orders = dict[str, np.ndarray](), dict[str, float](), dict[str, float]()
        for name, c in changes.items():
            b, most = first.get(name), float(c.max(initial=0.0))
            p = order_of(most, float(b.max(initial=0.0)), COARSER, COARSER) if b is not None else EXTREME_ORDER
            errors[name], orders[name] = _errors(c, b, p, COARSER, COARSER), p
            shown = float(by_steps[name].max(initial=0.0)) / COARSER**p if name in by_steps else 0.5 * most
            shares[name] = min(1.0, shown / most) if most > 0.0 else 0.0
        before = {name: float(b.max(initial=0.0)) for name, b in first.items() if name in changes}
        return cls(result, errors, changes, before, COARSER, shares, orders)

    def after(self, result: RunSample) -> ExtremeErrors:
        """The same of a finer result than that before."""
        cells, steps = refinement(result.resolution, self.run.resolution)
        found, errors = _changes(result.extremes, self.run.extremes), dict[str, np.ndarray]()
        orders = dict(self.orders)
        share = float(np.mean([*self.of_steps.values()] or [0.0]))
        finer = cells ** (1.0 - share) * steps**share
        found = {name: c for name, c in found.items() if name in self.errors}
        for name, c in found.items():
            b = self.changes[name]
            if finer < CLEARLY_FINER:  # what it changes shows no order, and part of the error
                p = self.orders[name]
                shown, left = c / (max(finer, HARDLY_FINER) ** p - 1.0), self.errors[name] / finer**p
                errors[name] = np.maximum(blended(shown, left, finer, p), c)
                continue
            orders[name] = p = order_of(float(c.max(initial=0.0)), float(b.max(initial=0.0)), finer, self.refined)
            errors[name] = _errors(c, b, p, finer, self.refined)
        before = {name: float(self.changes[name].max(initial=0.0)) for name in found}
        refined = max(finer, HARDLY_FINER)
        count = self.results + 1
        return replace(
            self, run=result, errors=errors, changes=found, before=before, refined=refined, orders=orders, results=count
        )

    def stalls(self, name: str) -> bool:
        """Whether a finer result has shown that finer ones still would tell little of an extreme."""
        return self.results > 1 and self.orders.get(name, MOST_EXTREME_ORDER) < STALLED_ORDER

    def set_apart(self, finer: ExtremeErrors) -> ExtremeErrors:
        """The same where a finer result is no better: no error is less than what they differ by."""
        apart = _changes(finer.run.extremes, self.run.extremes)
        return replace(self, errors={name: np.maximum(e, apart.get(name, e)) for name, e in self.errors.items()})

    def largest(self, name: str) -> float:
        """As of `largest_error`; 0: not estimated."""
        return largest_error(name, self.run.extremes[name], self.errors[name]) if name in self.errors else 0.0

    def changes_no_less(self, name: str) -> bool:
        """Whether the last refinement has changed what is held against a limit by no less than the one before."""
        return float(self.changes[name].max(initial=0.0)) >= self.before.get(name, np.nan)

    def checkpoint(self) -> Tree:
        """All but the run, as named arrays and plain values."""
        return {name: x for name, x in vars(self).items() if name != "run"}

    @classmethod
    def restored(cls, tree: Any, run: RunSample) -> ExtremeErrors:
        """From a checkpoint; run: the result that it is of.  ValueError: it is none of its."""
        arrays = {name: run.extremes[name] for name in tree["errors"] if name in run.extremes}
        each = {name: 0.0 for name in arrays}
        template: dict[str, Any] = {"errors": arrays, "changes": arrays}
        template |= {"before": dict.fromkeys(tree["before"], 0.0), "results": 1}
        saved = matched(tree, template | {"refined": 1.0, "of_steps": each, "orders": each}, "errors of extremes")
        return cls(run, **saved)


def largest_error(name: str, x: np.ndarray, e: np.ndarray) -> float:
    """By how much more than the largest x of a limit of sections may be used; of `RANGES` the largest error."""
    return float((x + e).max() - x.max()) if name in OF_SECTIONS else float(e.max(initial=0.0))


def figures(extremes: Mapping[str, np.ndarray], errors: Mapping[str, np.ndarray]) -> str:
    """Errors of extremes by name, as the attribute of a result; of a named quantity NAME smallest and NAME largest."""
    found = dict[str, float]()
    for name, e in errors.items():
        if name in OF_SECTIONS or name in RANGES:
            found[name] = largest_error(name, extremes[name], e)
            continue
        of = name.removeprefix(f"{EXTREMES}/")
        found |= {f"{of} {bound}": float(x) for bound, x in zip(("smallest", "largest"), e, strict=True)}
    return json.dumps(found)


def order_of(last: float, before: float, finer: float, finer_before: float) -> float:
    """Order p by the largest changes of two refinements, each by so many times."""
    if not before > 0.0:
        return LEAST_ORDER if last > 0.0 else MOST_EXTREME_ORDER
    orders = np.linspace(MOST_EXTREME_ORDER, LEAST_ORDER, 1001)
    part = _foretold(orders, finer, finer_before)
    return float(orders[min(int(np.searchsorted(part, last / before)), orders.size - 1)])


def _foretold(p: Any, finer: float, before: float) -> Any:
    """Of a change by a refinement what the next one changes, of order p."""
    return before**-p * (1.0 - finer**-p) / (1.0 - before**-p)


def _errors(c: np.ndarray, b: np.ndarray | None, p: float, finer: float, before: float) -> np.ndarray:
    most = c if b is None else np.maximum(c, b * _foretold(p, finer, before))
    return np.asarray(most / (finer**p - 1.0))


def _changes(fine: Mapping[str, np.ndarray], coarse: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Sizes of what extremes of two runs differ by, of those that both have."""
    both = [name for name, x in fine.items() if name in coarse and x.shape == coarse[name].shape]
    return {name: np.abs(fine[name] - coarse[name]) for name in both}


# Windows of a run, and the outputs of the result that one has at least.
WINDOWS, LEAST = 50, 20
# What is judged, in this order, and what it is called.
LARGEST = "largest"
# Kinds of the event that says so: of waves, and of a line that snaps.
IRREGULAR, SNAPS = "irregular motion", "snaps"
STATISTICS = {
    LARGEST: "largest value",
    "deviation": "standard deviation",
    "windows_largest": "mean of the windows' largest",
    "windows_smallest": "mean of the windows' smallest",
}
# Steps from slack to the mean force from which on a run shows a snap.
STEPS_IN_RISE = 3
# Windows from which on their scatter is known.
MANY = 10


class StatisticEstimate(Estimate):
    """Errors of one of STATISTICS.

    One number has no field in which mesh and time step could be told apart: their sizes add.
    """

    cancels = False

    def __init__(
        self, result: RunSample, coarse: RunSample, rough: RunSample | None, coarsest: RunSample | None
    ) -> None:
        super().__init__(result, coarse, rough, coarsest)
        self.chance = _chance(result, coarse)  # N, of a mean over windows at start and end: zeros of what is no mean

    def _bounds(self, name: str, found: Falls) -> tuple[float, float]:
        return ORDER, MOST_ORDER  # runs of long steps overshoot snaps, and come back with order 3

    def _shorter(self, fast: RunSample, slow: RunSample) -> float:
        return fast.steps / max(slow.steps, 1)  # of the whole run, as statistics are

    def update(self, result: RunSample) -> None:
        self.chance = _chance(result, self.run)
        super().update(result)

    def checkpoint(self) -> Tree:
        return super().checkpoint() | {"chance": self.chance}

    @classmethod
    def restored(cls, tree: Any, scene: LineScene, shape: tuple[int, int, int]) -> Self:
        self = super().restored(tree, scene, shape)
        found = {"chance": tree.get("chance", np.zeros(2))}
        self.chance = matched(found, {"chance": np.zeros(2)}, "statistics")["chance"]
        return self


Estimates = Mapping[str, StatisticEstimate]


def estimates(
    result: RunSample, coarse: RunSample, rough: RunSample | None, coarsest: RunSample | None, every: int
) -> dict[str, StatisticEstimate]:
    """The errors of each of STATISTICS; arguments as of `Estimate`, every: as of `statistics_of`."""
    runs = [statistics_of(x, every) if x is not None else {} for x in (result, coarse, rough, coarsest)]
    return {x: StatisticEstimate(runs[0][x], runs[1][x], runs[2].get(x), runs[3].get(x)) for x in STATISTICS}


def statistics_of(run: RunSample, every: int) -> dict[str, RunSample]:
    """The same run with each of STATISTICS in place of its outputs: arrays (1, ...).

    every: outputs of the result to one that counts; forces at the ends count at every step.  Reactions become
    (magnitude, 0, 0).  Errors of neglected bending are those at the extremes, and their root mean square.
    """
    values = {name: np.asarray(x)[every_of(len(x), every // run.every)] for name, x in run.values.items()}
    values |= {name: np.linalg.norm(values[name], axis=-1) for name in END_FORCES if name in values}
    count = len(next(iter(values.values()), ()))
    windows = max(1, min(WINDOWS, count * every // LEAST))
    found = {name: _statistics(x, windows) for name, x in values.items()}
    for column, name in enumerate(END_FORCES, start=1):
        if name in found and len(run.forces) > windows:
            found[name] = _of_steps(run.forces[:, 0], run.forces[:, column], windows)
    errors = _model_errors(run, values, every, windows)
    kept = {name: run.forces[:0] for name in STATISTICS}
    if len(run.forces) > windows:
        kept |= {"windows_largest": _of_windows(run.forces, windows, np.maximum)}
        kept |= {"windows_smallest": _of_windows(run.forces, windows, np.minimum)}
    out, plain = {}, replace(run, every=1, rows={}, catenary=run.catenary[:0])
    for k, statistic in enumerate(STATISTICS):
        each = {name: x[k] for name, x in found.items()}
        for name in END_FORCES.keys() & each.keys():
            each[name] = np.stack([each[name], 0.0 * each[name], 0.0 * each[name]], axis=-1)
        model_error = {name: x[k] for name, x in errors.items()}
        out[statistic] = replace(plain, forces=kept[statistic], values=each, model_error=model_error)
    return out


def _chance(after: RunSample, before: RunSample) -> np.ndarray:
    """By how much means over windows of the end forces may be off because runs snap at other instants: (2,) N.

    Twice the standard error of the mean difference of two runs, from its scatter over the windows.
    """
    if not len(after.forces) or after.forces.shape != before.forces.shape:
        return np.zeros(2)
    differences = after.forces[:, 1:] - before.forces[:, 1:]
    return np.asarray(2.0 * np.std(differences, axis=0) / np.sqrt(len(differences)))


def is_chance(found: Estimates, statistic: str, quantity: str) -> bool:
    """Whether a statistic of an end force differs from that of the run before by no more than chance makes it differ.

    quantity: of END_FORCES, as runs call it.  Means over windows do where they differ by less than twice the standard
    error of that difference; then the largest force of the run does where it differs by no more than single windows do.
    """
    means = "windows_largest" if statistic == LARGEST else statistic
    windows, of = found.get(means), list(END_FORCES)
    if windows is None or quantity not in of or not windows.chance.any():
        return False
    count, error = len(windows.run.forces), float(windows.chance[of.index(quantity)])
    by = {x: np.sqrt(3.0) * found[x].changes.get(quantity, (np.nan,))[0] for x in (means, LARGEST)}
    same = bool(count >= MANY and by[means] <= error)
    return same and (statistic != LARGEST or bool(by[LARGEST] <= error * np.sqrt(count)))


def _of_windows(forces: np.ndarray, windows: int, f: np.ufunc) -> np.ndarray:
    """The largest, or smallest, forces (n, 3) of each window, with its number."""
    begins = _begins(forces[:, 0], windows)
    return np.column_stack([np.arange(float(len(begins))), f.reduceat(forces[:, 1:], begins, axis=0)])


def windows_uncertain(found: Estimates, asked: RequestedAccuracy) -> list[tuple[str, str]]:
    """The event that says so where chance may take means over windows of an end force beyond what is asked."""
    if asked.tension is None and asked.of_end_force is None:
        return []
    most, off = found[LARGEST].run.largest_end_force, 0.0
    for estimate in found.values():
        for chance, name in zip(estimate.chance, END_FORCES.values(), strict=True):
            if chance > 0.0:
                off = max(off, chance + estimate.errors.largest("total", name))
    bounds = asked.tension, asked.of_end_force and asked.of_end_force * most
    allowed = min(x for x in bounds if x is not None)
    if off <= allowed:
        return []
    text = (
        f"means of the windows' largest and smallest forces may be off by {off:.2g} N, because the line snaps at other "
        f"instants in every run; {allowed:.2g} N are asked: a longer run, or several seeds, say more"
    )
    return [("windows uncertain", text)]


def irregular_notes(
    found: Estimates, errors: Errors, scattered: Sequence[str], excess: Floats, asked: RequestedAccuracy, by_snaps: bool
) -> list[tuple[str, str]]:
    """What is judged of an irregular motion, and how far the result may be off in what is not.

    errors: at every output; scattered: end forces whose largest values are by chance; excess: (2,) N, by which snaps
    may exceed those at start and end; by_snaps: whether it is so because values at an instant do not converge.
    """
    force = max(errors.largest("total", name) for name in END_FORCES.values())
    position = errors.largest("total", "position")
    why = (
        "the line snaps, and finer runs differ at an instant as much as coarser ones"
        if by_snaps
        else "the motion is irregular"
    )
    text = (
        f"{why}: accuracy is that of largest values, mean extremes of windows and standard "
        f"deviations; at an instant positions may be off by {position:.2g} m, end forces by {force:.2g} N; "
        "accuracy: {instant: 1%} asks for every instant"
    )
    notes = [(SNAPS if by_snaps else IRREGULAR, text)]
    if scattered:
        largest, snaps_by = found[LARGEST].errors, dict(zip(END_FORCES.values(), excess, strict=True))
        by = {x.removeprefix("end_force_"): max(largest.largest("total", x), snaps_by[x]) for x in scattered}
        text = (
            "the largest force is, or may be exceeded by, that of one snap, and these differ from run to run however "
            f"fine they are (at the {', at the '.join(f'{x} {n:.2g} N' for x, n in by.items())}): it is not judged; "
            "the spread over seeds, or a longer run, says more"
        )
        notes.append(("largest force uncertain", text))
    return notes + windows_uncertain(found, asked)


def snaps(run: RunSample) -> bool:
    """Whether the force at an end, of all steps, comes from little to much: a line that slackens and is pulled taut.

    One that is let go, whose force grows from nothing, does not: it converges at every instant after that.
    """
    t = run.forces[:, 0]
    return any(snap_times(t, run.forces[:, k]) for k in (1, 2)) if t.size else False


def resolves_snaps(run: RunSample) -> bool:
    """Whether the force at an end rises over several steps where it snaps: else steps are too long to show anything."""
    t = run.forces[:, 0]
    return max(steps_in_rise(t, run.forces[:, k]) for k in (1, 2)) >= STEPS_IN_RISE


def _windows(x: np.ndarray, windows: int) -> Iterator[np.ndarray]:
    """The outputs after the first, in windows of about the same length."""
    later = x[1:] if len(x) > 1 else x
    return iter(np.array_split(later, min(windows, len(later))))


def _statistics(x: np.ndarray, windows: int) -> np.ndarray:
    """STATISTICS of (nt, ...) over time: (4, 1, ...)."""
    begins = np.cumsum([0, *(len(part) for part in _windows(x, windows))][:-1])
    later = x[1:] if len(x) > 1 else x
    largest, smallest = (f.reduceat(later, begins, axis=0).mean(axis=0) for f in (np.maximum, np.minimum))
    return np.stack([np.max(x, axis=0), np.std(x, axis=0), largest, smallest])[:, None]


def _of_steps(t: np.ndarray, x: np.ndarray, windows: int) -> np.ndarray:
    """STATISTICS of (n,) values at the times (n,) at which steps end: (4, 1)."""
    dt = np.diff(t, prepend=0.0)
    mean = np.average(x, weights=dt)
    deviation = np.sqrt(np.average((x - mean) ** 2, weights=dt))
    begins = _begins(t, windows)
    largest, smallest = (float(np.mean(f.reduceat(x, begins))) for f in (np.maximum, np.minimum))
    return np.array([[x.max()], [deviation], [largest], [smallest]])


def _begins(t: np.ndarray, windows: int) -> np.ndarray:
    """Numbers of the first steps of windows of about the same length; t: (n,) s, when steps end."""
    begins = np.searchsorted(t, np.linspace(0.0, t[-1], windows + 1)[:-1], side="right")
    return np.unique(np.minimum(begins, len(t) - 1))


def _model_errors(run: RunSample, values: Mapping[str, np.ndarray], every: int, windows: int) -> dict[str, np.ndarray]:
    """What errors of neglected bending (nt, ...) make of STATISTICS, to first order: (4, 1, ...)."""
    out = {}
    named = {END_FORCES.get(name, name): x for name, x in values.items()}
    for name, field in run.model_error.items():
        if not len(field):
            continue
        error, value = np.asarray(field)[every_of(len(field), every // run.every)], named.get(name)
        level = np.sqrt(np.mean(error * error, axis=0))
        if value is None or value.shape != error.shape:  # of vectors: no extreme of a component
            out[name] = np.stack([np.max(error, axis=0), level, level, level])[:, None]
            continue
        pairs = list(zip(_windows(value, windows), _windows(error, windows), strict=True))
        most, least = (np.mean([_taken(e, f(x, axis=0)) for x, e in pairs], axis=0) for f in (np.argmax, np.argmin))
        out[name] = np.stack([_taken(error, value.argmax(axis=0)), level, most, least])[:, None]
    return out


def _taken(x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The values of (nt, ...) at the times (...)."""
    return np.asarray(np.take_along_axis(x, np.asarray(at)[None], axis=0)[0])
