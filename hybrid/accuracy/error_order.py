"""How errors follow from what runs differ by: their order, their sizes, and values between outputs.

Forces at the ends differ from run to run between outputs as well: by snaps, and where a line rings.
A snap is a force at the ends that rises after a line that was taut went slack.  Its size follows from how the line lay
while it was slack, which is another in every run, however fine: the largest force of a run can be a smooth one that
converges, and in the next run a snap exceeds it.  A line that rings faster than its outputs is late by another part of
a period in every run: outputs meet that by chance, and few of them show hardly any of it.

    symbol   meaning                                                                unit
    t, F     times at which steps end, force at the end where it is largest          s, N
    peaks    of the forces at start and end in each snap                            N
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import prod
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.resolution import Resolution
from hybrid.simulation.run_sample import END_FORCES, RunSample, beyond_outputs, cubic_spline, every_of

# The order of convergence where three runs do not show it, and the bounds of what they may show.  A smooth motion has
# 2, contact and impact have 1; a figure by 1.5 is 1.6 times too large for the first, half of the second.  Below 1.5 it
# is most often the coarsest run that is too coarse to say: errors are bounded, however coarse a run.
ORDER = 1.5
ORDERS = (ORDER, 2.0)  # bounds of a run from rest; 2 is that of a smooth motion
MOST_ORDER = 3.0  # the largest that three runs may show
# The same of forces at the ends where a motion begins from what is no equilibrium.  At its first output the half cell
# at a held end bears the load that the line beside it falls with, w h/2, which is of order 1; and the waves that begin
# there have all lengths, of which finer cells carry shorter ones (docs/errors.md): more than ORDER is shown by runs
# that are too coarse to carry them.
START_ORDERS = (1.0, ORDER)
# Tension along a line that rubs on obstacles jumps where contact with friction begins: of order 1 (docs/errors.md).
RUBBING_ORDERS = (1.0, ORDERS[1])
# So it is where a ramp has set off vibrations along the line and a halving of cells and steps leaves more than this of
# what forces at the ends differ by, root mean square: less than first order.
BELOW_FIRST = 0.6
# A low order is taken back where a finer run changes the force by less than this part of what it foretold, on average
# and at most: of runs three times as fine, order 1 makes 1.2 of it, ORDER 0.76 and order 2 0.44.
CONFIRMED = 0.6
# A force of ORDER or less that a clearly finer run changes by more than so many times what was foretold, on average and
# at most, converges with the order that comes last: three times as fine, order 1 makes 1.5 times what ORDER foretells.
# What runs that are hardly finer differ by is mostly something else (`blended`).
EXCEEDED = 1.4
CLEARLY_FINER = 1.5  # ratio of cells or steps
LEAST_FORCE_ORDER = 1.0
# Cells and steps of a coarser run are so many times as long.
COARSER = 2.0
# Numbers of a quantity that are compared at a time, so that the memory of a long run stays flat.
MOST = 500_000


class Falls(NamedTuple):
    """Of three runs: difference of the last two over that of the first two, root mean square and largest; and both."""

    mean: float
    largest: float
    change: float  # root mean square of the difference of the last two
    before: float  # the same of the first two


def falls(name: str, result: RunSample, coarse: RunSample, coarsest: RunSample | None) -> Falls:
    """Over all times; NaN: the runs do not show it."""
    if coarsest is None or name not in coarsest.values:
        return Falls(np.nan, np.nan, np.nan, np.nan)
    values, every = coarsest.values[name], coarsest.every
    final, middle = (every_of(len(x.values[name]), every // x.every) for x in (result, coarse))
    rows, sums, largest = max(1, MOST // int(np.prod(values.shape[1:]))), np.zeros(2), np.zeros(2)
    for a in range(0, len(values), rows):  # of all times: peaks jump about
        between, now = coarse.some(name, middle[a : a + rows]), result.some(name, final[a : a + rows])
        for k, change in enumerate((now - between, between - values[a : a + rows])):
            sums[k] += squares(change)
            largest[k] = np.max(magnitude(change, name), initial=largest[k])
    if not (sums > 0.0).all():
        return Falls(np.nan, np.nan, np.nan, np.nan)
    mean = np.sqrt(sums / max(1, int(np.prod(values.shape))))
    return Falls(float(mean[0] / mean[1]), float(largest[0] / largest[1]), float(mean[0]), float(mean[1]))


def refinement(result: Resolution, coarse: Resolution) -> tuple[float, float]:
    """How many times as many cells and steps a resolution asks for."""
    steps = coarse.step / result.step if result.step else 1.0
    return result.fineness / coarse.fineness, steps


def step_share(name: str, coarse: RunSample, rough: RunSample | None, coarsest: RunSample | None) -> float:
    """Part of the change between two runs, of longer cells and steps both, that the steps make, 0 to 1."""
    if rough is None or coarsest is None or name not in rough.values or name not in coarsest.values:
        return 0.0
    same = every_of(len(coarse.values[name]), rough.every // coarse.every)
    rows, sums = max(1, MOST // int(np.prod(rough.values[name].shape[1:]))), np.zeros(2)
    for a in range(0, len(rough.values[name]), rows):
        now = coarse.some(name, same[a : a + rows])
        sums += [squares(now - run.values[name][a : a + rows]) for run in (rough, coarsest)]
    return float(min(1.0, np.sqrt(sums[0] / sums[1]))) if sums[1] > 0.0 else 0.0


def as_halved(found: Falls, finer: tuple[float, float], share: float) -> Falls:
    """What runs would show if the last were COARSER times as fine as the one before; finer: how many times it is.

    share: of the steps in what the first two differ by.  An order p leaves (1 - finer^-p)/(COARSER^p - 1).
    """

    def halved(left: float) -> float:
        low, high = -2.1, 6.3  # of p; the higher, the less is left
        while high - low > 1e-4 and not np.isnan(left):
            p = 0.5 * (low + high)
            cells, steps = (1.0 - x**-p for x in finer)
            of_p = ((1.0 - share) * cells + share * steps) / (COARSER**p - 1.0)
            low, high = (p, high) if of_p > left else (low, p)
        return float(COARSER ** (-0.5 * (low + high))) if not np.isnan(left) else left

    mean = halved(found.mean)
    return Falls(mean, halved(found.largest), mean * found.before, found.before)


def force_orders(found: Falls, from_rest: bool = True, shaken: bool = False) -> tuple[float, float]:
    """Bounds of the order with which a force at an end converges.

    from_rest: in a motion from an equilibrium; shaken: in which a ramp sets off vibrations along the line that matter,
    whose slow fall is not ruled out where it is not known.
    """
    return ORDERS if from_rest and not (shaken and not found.mean <= BELOW_FIRST) else START_ORDERS


def order(found: float, bounds: tuple[float, float]) -> float:
    """The order with which an output converges, the least where it is not shown; a ratio of noise is one as well."""
    return bounds[0] if np.isnan(found) else float(np.clip(-np.log(found) / np.log(COARSER), *bounds))


def times_foretold(
    name: str, p: float, change: np.ndarray, errors: Sequence[tuple[np.ndarray, float]]
) -> tuple[float, float] | None:
    """How many times what p has foretold a finer run changes an output, at most and on average; None: of nothing.

    errors: of the run before, with their sign, by order p, and how many times as fine the run is in what makes them.
    """
    foretold = sum((x * (1.0 - ratio**-p) for x, ratio in errors), np.zeros_like(change))
    most, mean = float(np.max(magnitude(foretold, name), initial=0.0)), squares(foretold)
    if not mean > 0.0:
        return None
    return float(np.max(magnitude(change, name))) / most, float(np.sqrt(squares(change) / mean))


def exceeds(name: str, p: float, change: np.ndarray, errors: Sequence[tuple[np.ndarray, float]]) -> bool:
    """Whether that is more than EXCEEDED times, both, of a clearly finer run; errors: as of `times_foretold`."""
    if not max(ratio for _, ratio in errors) > CLEARLY_FINER:
        return False
    times = times_foretold(name, p, change, errors)
    return times is not None and min(times) > EXCEEDED


def confirmed_order(name: str, p: float, change: np.ndarray, errors: Sequence[tuple[np.ndarray, float]]) -> float:
    """The order of a force at an end that p has foretold, after a finer run has changed it.

    errors: as of `times_foretold`.
    """
    times = times_foretold(name, p, change, errors)
    if p > ORDER or times is None:
        return p
    if max(times) < CONFIRMED:
        return ORDER
    clearly = max(ratio for _, ratio in errors) > CLEARLY_FINER
    return LEAST_FORCE_ORDER if clearly and min(times) > EXCEEDED else p


def start_order(name: str, result: RunSample, coarse: RunSample, coarsest: RunSample | None, finer: float) -> float:
    """The order with which the error by the mesh falls at the first output, within START_ORDERS.

    finer: times as many cells as coarse that the result has; coarsest: None, or without the output: the least order.
    """
    if coarsest is None or name not in coarsest.values:
        return START_ORDERS[0]
    values = [np.asarray(run.values[name][:1]) for run in (result, coarse, coarsest)]
    last, before = (float(magnitude(a - b, name).max()) for a, b in pairwise(values))
    if not (last > 0.0 and before > 0.0):
        return START_ORDERS[1]
    left = last / before
    return order(as_halved(Falls(left, left, last, before), (finer, finer), 0.0).mean, START_ORDERS)


def start_change(fine: RunSample, coarse: RunSample | None) -> float:
    """Largest distance, m, of positions at the first output of two runs, which an equilibrium most often is."""
    if coarse is None or "position" not in fine.values or "position" not in coarse.values:
        return np.nan
    return float(magnitude(np.asarray(fine.values["position"][:1]) - coarse.values["position"][:1], "position").max())


def squares(x: np.ndarray) -> float:
    """Sum of all squares; numpy's norm wakes the threads of BLAS, which takes a hundred times as long."""
    return float((x * x).sum())


def around(known: np.ndarray, a: int, b: int) -> tuple[np.ndarray, slice]:
    """Of the outputs whose errors are known, the numbers of those that errors from a to b follow from; and which."""
    first = max(0, int(np.searchsorted(known, a, side="right")) - 1)
    own = slice(first, int(np.searchsorted(known, b - 1)) + 1)
    return known[own], own


def at_all_outputs(error: np.ndarray, known: np.ndarray, a: int, b: int) -> np.ndarray:
    """Errors at the outputs from a to b, by those at `known`.

    In between it is the larger of the two beside it: peaks are not averaged out.
    """
    if known.size == b - a and known[0] == a and known[-1] == b - 1:
        return error
    right = np.clip(np.searchsorted(known, np.arange(a, b)), 1, known.size - 1)
    before, after = error[:-1], error[1:]
    between = np.where(np.abs(before) > np.abs(after), before, after)[right - 1]
    inside = (known >= a) & (known < b)
    between[known[inside] - a] = error[inside]
    return np.asarray(between)


def blended(shown: np.ndarray, expected: np.ndarray, finer: float, p: float) -> np.ndarray:
    """Errors of a run so many times finer than the last, as shown and as expected.

    shown: by the difference of both; expected: from the errors of the last.  Of a run that is hardly finer the first is
    mostly what else differs, such as when zones change, times 1/(finer^p - 1): it counts as far as that is no more than
    in the first estimate.  But no error is smaller than the difference.
    """
    part = (finer**p - 1.0) / (COARSER**p - 1.0)
    if part >= 1.0:
        return shown
    found, least = part * shown + (1.0 - part) * expected, min(1.0, finer**p - 1.0) * shown
    return np.where(np.abs(found) < np.abs(least), least, found)


def with_neighbours(error: np.ndarray, first: int, last: int, starts: bool) -> np.ndarray:
    """Sizes (n, ...) of errors: of the outputs from first to last the largest of each and of those beside it.

    Errors of a motion swing about nothing, and estimates do not swing quite as they do: where one of the two passes
    through nothing at an output, the other need not.  starts: the first of them is the start, which does not swing.
    """
    out, kept = error[first:last].copy(), error[first].copy()
    for k in (-1, 1):
        a, b = max(first, -k), min(last, len(error) - k)  # those that have one on this side
        np.maximum(out[a - first : b - first], error[a + k : b + k], out=out[a - first : b - first])
    if starts:
        out[0] = kept
    return out


def magnitude(error: np.ndarray, name: str) -> np.ndarray:
    """Of vectors their length, of numbers their size."""
    if name == "position" or name in END_FORCES:  # einsum takes a third of the time of numpy's norm
        return np.asarray(np.sqrt(np.einsum("...i,...i->...", error, error)))
    return np.asarray(np.abs(error))


# Estimated errors of a result, by cause and output, computed in blocks.


class Block(NamedTuple):
    """Errors of an output by one cause: magnitudes (n, ...) at n output times, from number `begin` on."""

    cause: str
    name: str
    begin: int
    values: np.ndarray


class Errors:
    """Estimated errors of a run, by cause ("mesh", "time", "model", "total") and output, computed in blocks."""

    def __init__(self, fields: Mapping[str, Mapping[str, tuple[int, ...]]], blocks: Callable[[], Iterator[Block]]):
        """fields: shapes (nt, ...) of all errors, by cause and output; blocks: computes them."""
        self.fields, self._compute = fields, blocks
        self._largest: dict[tuple[str, str], np.ndarray] | None = None  # over time
        numbers = sum(prod(shape) for found in fields.values() for shape in found.values())
        self._kept: list[Block] | None = [] if numbers <= MOST else None  # once they are computed

    @classmethod
    def of(cls, values: Mapping[str, Mapping[str, np.ndarray]]) -> Errors:
        """From magnitudes, by cause and output."""
        shapes = {cause: {name: x.shape for name, x in found.items()} for cause, found in values.items()}
        flat = [Block(cause, name, 0, x) for cause, found in values.items() for name, x in found.items()]
        return cls(shapes, lambda: iter(flat))

    def blocks(self) -> Iterator[Block]:
        """All of them, each computed when it is asked for; few are kept."""
        if self._kept:
            yield from self._kept
            return
        largest: dict[tuple[str, str], np.ndarray] = {}
        kept = []
        for block in self._compute():
            key = block.cause, block.name
            most = np.max(block.values, axis=0, initial=0.0)
            largest[key] = np.maximum(most, largest[key]) if key in largest else most
            if self._kept is not None:
                kept.append(block)
            yield block
        self._largest = largest
        if self._kept is not None:
            self._kept = kept

    def largest(self, cause: str, name: str, allowed: np.ndarray | None = None) -> float:
        """Largest error of an output, or of it over `allowed` (ns,), NaN where nothing is; 0 where not estimated."""
        if self._largest is None:
            for _ in self.blocks():
                pass
        assert self._largest is not None
        found = self._largest.get((cause, name))
        if found is None:
            return 0.0
        return float(np.max(found, initial=0.0) if allowed is None else np.nanmax(found / allowed, initial=0.0))


def summary(errors: Errors) -> dict[str, float]:
    """The largest errors of position (m) and of the end forces (N), by cause, as attributes of a result."""
    out = {}
    for cause in errors.fields:
        out[f"error_{cause}_position"] = errors.largest(cause, "position")
        out[f"error_{cause}_end_force"] = max(errors.largest(cause, name) for name in END_FORCES.values())
    return out


# Part of its largest force to which the force at an end comes back where a line snaps.
SLACKENS = 0.1
# Chance that a snap of all of a run is larger than is foretold: that of two standard deviations.
CHANCE = 0.0228
# Bounds of the order by which forces of all steps converge: of order 1 is what rings, and damped by the step.
BETWEEN_ORDERS = 1.0, 2.0
# Part of the largest force by which one leaves the curve through its outputs where it rings between them: 0.25 in a
# short hose whose clamps turn; peaks that outputs cut off are 0.05 (test_error_figures.py).
RINGS = 0.1
# Times as many cells or steps below which a run is hardly finer, and what it changes is no part of an order.
HARDLY_FINER = 1.5


def snap_times(t: Floats, F: Floats) -> list[tuple[float, float]]:
    """When each snap begins, at the lowest force, and when it is over, at the next fall through the mean force."""
    high = np.average(F, weights=np.diff(t, prepend=0.0)) <= F
    rises, falls = np.flatnonzero(high[1:] & ~high[:-1]) + 1, np.flatnonzero(~high[1:] & high[:-1]) + 1
    low, out = SLACKENS * float(F.max(initial=0.0)), []
    for rise in rises.tolist():
        k = int(np.searchsorted(falls, rise))
        if k == 0:  # the force grows from the start, which no line that was taut before does
            continue
        before = int(falls[k - 1])
        lowest = before + int(F[before:rise].argmin())
        if F[lowest] < low:
            out.append((float(t[lowest]), float(t[falls[k]] if k < falls.size else t[-1])))
    return out


def steps_in_rise(t: Floats, F: Floats) -> float:
    """Steps from the lowest force of a snap to the mean force, the median over all snaps; 0: there are none."""
    mean = np.average(F, weights=np.diff(t, prepend=0.0))
    counts = []
    for begin, end in snap_times(t, F):
        a, b = np.searchsorted(t, (begin, end))
        counts.append(int(np.argmax(F[a : b + 1] >= mean)))
    return float(np.median(counts)) if counts else 0.0


def joined(times: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same without overlaps, in order."""
    out: list[tuple[float, float]] = []
    for begin, end in sorted(times):
        if out and begin < out[-1][1]:
            out[-1] = out[-1][0], max(end, out[-1][1])
        else:
            out.append((begin, end))
    return out


def peaks(forces: Floats, times: list[tuple[float, float]]) -> Floats:
    """Largest forces (n, 2) N at start and end within each of n times; forces: (nt, 3) as of `RunSample`."""
    spans = [slice(*np.searchsorted(forces[:, 0], x).tolist()) for x in times]
    return np.array([forces[x, 1:].max(axis=0, initial=0.0) for x in spans]).reshape(-1, 2)


def snap_excess(after: Floats, before: Floats) -> Floats:
    """By how much snaps may exceed the largest forces of a run: (2,) N at start and end, at least 0.

    after, before: forces of all steps of a run and of one that is less fine, as of `RunSample`.  The difference of two
    runs has twice the variance that a snap of one has.  Of n snaps that variance is known as well as n numbers tell it
    (Student's t of n degrees of freedom), and none of the n is to exceed the largest.
    """
    if not (len(after) and len(before)):
        return np.zeros(2)
    pulled = 1 + int(after[:, 1:].max(axis=0).argmax())
    times = joined([x for run in (after, before) for x in snap_times(run[:, 0], run[:, pulled])])
    if not times:
        return np.zeros(2)
    from scipy.special import stdtrit  # 0.2 s to import, and few runs snap

    now, then = peaks(after, times), peaks(before, times)
    deviation, n = np.sqrt(0.5 * np.mean((now - then) ** 2, axis=0)), len(times)
    most = now.max(axis=0) + float(stdtrit(n, 1.0 - CHANCE / n)) * deviation
    return np.asarray(np.maximum(most - after[:, 1:].max(axis=0), 0.0))


class Between(NamedTuple):
    """Errors (nt,) N of an end force around every output, by all steps, and the order with which these converge."""

    errors: Floats
    order: float


def errors_between(
    times: Floats, result: RunSample, coarse: RunSample, coarsest: RunSample | None
) -> dict[str, Between]:
    """By end force, where it leaves the curve through its outputs at `times` (nt,) s; runs: as of `Estimate`."""
    found: dict[str, Between] = {}
    least = RINGS * float(result.forces[:, 1:].max(initial=0.0))
    if not any(off.max() > least for off in beyond_outputs(times, result).values()):
        return found
    for column, (raw, name) in enumerate(END_FORCES.items(), start=1):
        if raw not in result.values or raw not in coarse.values:
            continue
        p, change = BETWEEN_ORDERS[0], _changes(times, result, coarse, column)
        if coarsest is not None and change.max() > 0.0:
            before = float(_changes(times, coarse, coarsest, column).max())
            p = float(np.clip(np.log(max(before / change.max(), 1.0)) / np.log(COARSER), *BETWEEN_ORDERS))
        found[name] = Between(change / (max(_finer(result, coarse)) ** p - 1.0), p)
    return found


def finer_between(
    times: Floats, known: Mapping[str, Between], result: RunSample, before: RunSample
) -> dict[str, Between]:
    """The same of a finer result; known: of that before it."""
    found, finer = {}, _finer(result, before)
    for column, name in enumerate(END_FORCES.values(), start=1):
        if name in known:
            (errors, p), change = known[name], _changes(times, result, before, column)
            if change.max() > errors.max() * (1.0 - max(finer) ** -p):  # more than that order has foretold
                p = BETWEEN_ORDERS[0]
            found[name] = Between(np.maximum(change / (max(finer) ** p - 1.0), errors / min(finer) ** p), p)
    return found


def _changes(times: Floats, after: RunSample, before: RunSample, column: int) -> Floats:
    """Largest change (nt,) N of a force of steps between the outputs beside each output.

    Of the curve and the straight line through longer steps that which is nearer: the one overshoots where a force turns
    at once, the other cuts off smooth peaks.
    """
    t, (known, first) = after.forces[:, 0], np.unique(before.forces[:, 0], return_index=True)
    if known.size < 4:
        return np.zeros(times.size)
    force, then = after.forces[:, column], before.forces[first, column]
    change = np.minimum(*(np.abs(force - curve(known, then, t)) for curve in (cubic_spline, _straight)))
    most = np.zeros(times.size)
    np.maximum.at(most, np.clip(np.searchsorted(times, t), 1, times.size - 1), change)  # since the output before
    return np.asarray(np.maximum(most, np.append(most[1:], 0.0)))


def _straight(x: Floats, y: Floats, at: Floats) -> Floats:
    """Straight lines through points, as of `cubic_spline`."""
    return np.interp(at, x, y)


def _finer(result: RunSample, before: RunSample) -> tuple[float, float]:
    """How many times as many cells and steps a run has; as COARSER counts what is hardly more of both."""
    cells, steps = result.cells / before.cells, result.steps / max(before.steps, 1)
    return max(cells, 1.0), max(steps, 1.0 if cells > HARDLY_FINER or steps > HARDLY_FINER else COARSER)
