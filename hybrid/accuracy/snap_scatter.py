"""How far forces at the ends differ from run to run between outputs: by snaps, and where a line rings.

A snap is a force at the ends that rises after a line that was taut went slack.  Its size follows from how the line lay
while it was slack, which is another in every run, however fine: the largest force of a run can be a smooth one that
converges, and in the next run a snap exceeds it.  A line that rings faster than its outputs is late by another part of
a period in every run: outputs meet that by chance, and few of them show hardly any of it.

    symbol   meaning                                                                unit
    t, F     times at which steps end, force at the end where it is largest          s, N
    peaks    of the forces at start and end in each snap                            N
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hybrid.accuracy.error_order import COARSER
from hybrid.kernels.state.state import Floats
from hybrid.simulation.result_checks import beyond_outputs, cubic_spline
from hybrid.simulation.run_sample import END_FORCES, RunSample

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


def joined(times: list[tuple[float, float]]) -> list[tuple[float, float]]:
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
