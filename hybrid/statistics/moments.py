"""Mean, standard deviation, skewness, extremes and periods of histories.

Samples need not be even in time, because an end force is known at every step and steps may have any length: a mean is
the integral over time (trapezoidal rule) divided by the time.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid.errors import ResultError

Floats = NDArray[np.float64]

# A standard deviation below this part of the largest value is round-off: there is no skewness and no period.
STEADY = 1e-9


class Summary(NamedTuple):
    """Of histories (nt, ...): values (...) in the unit of the history, but for skewness [-] and times [s].

    What a history does not have is NaN: the skewness and period of one that is steady, the period and the
    significant range of one with less than two up-crossings of its mean.
    """

    mean: Floats
    standard_deviation: Floats
    skewness: Floats
    minimum: Floats
    t_minimum: Floats
    maximum: Floats
    t_maximum: Floats
    crossing_period: Floats
    significant_range: Floats
    cycles: NDArray[np.int64]

    @property
    def deviation(self) -> Floats:
        """Former name of `standard_deviation`."""
        warnings.warn("deviation is now standard_deviation", DeprecationWarning, stacklevel=2)
        return self.standard_deviation


def checked(t: ArrayLike, x: ArrayLike, least: int = 2) -> tuple[Floats, Floats]:
    """Times (nt,) s that grow, and histories (nt, ...) of finite numbers; ResultError if they are not."""
    times, values = np.asarray(t, float), np.asarray(x, float)
    if times.ndim != 1 or values.ndim == 0 or values.shape[0] != times.size:
        raise ResultError(f"a history has one value for each time: {times.shape} times and {values.shape} values")
    if times.size < least:
        count = "one value is" if times.size == 1 else f"{times.size} values are"
        expected = f"{least} at least; an equilibrium has one, a longer window or shorter output.every may have more"
        raise ResultError(f"{count} too few\n    expected: {expected}")
    if not np.all(np.diff(times) > 0.0):
        raise ResultError("the times of a history must grow")
    if not np.all(np.isfinite(values)):
        raise ResultError(
            "it has no finite value at some times, as the touchdown of a line that touches nothing\n"
            "    try:      a window of times in which it has, or leave the quantity out"
        )
    return times, values


def mean_over_time(t: Floats, x: Floats) -> Floats:
    """Mean (...) over the time of histories (nt, ...)."""
    return np.asarray(np.trapezoid(x, t, axis=0) / (t[-1] - t[0]))


def exceedance(t: ArrayLike, x: ArrayLike, above: float | None = None, below: float | None = None) -> Floats:
    """Part of the time (...) for which histories are above a value, or below one.

    x: (nt, ...) at times t (nt,) s, linear between samples.
    """
    times, values = checked(t, x)
    if above is None:
        assert below is not None
        values, above = -values, -below
    if np.isnan(above):
        raise ResultError("exceedance\n    expected: a number in the unit of the quantity")
    lasts = np.diff(times).reshape(-1, *[1] * (values.ndim - 1))
    least, most = np.minimum(values[1:], values[:-1]), np.maximum(values[1:], values[:-1])
    width = np.where(most > least, most - least, 1.0)
    part = np.where(most > least, np.clip((most - above) / width, 0.0, 1.0), most > above)
    return np.asarray((part * lasts).sum(axis=0) / (times[-1] - times[0]))


def median_over_time(t: ArrayLike, x: ArrayLike) -> Floats:
    """What histories x (nt, ...) at times t (nt,) s are below for half of the time; linear between samples."""
    times, values = checked(t, x)
    lasts = np.diff(times).reshape(-1, *[1] * (values.ndim - 1))
    least, most = np.minimum(values[1:], values[:-1]), np.maximum(values[1:], values[:-1])
    width = np.where(most > least, most - least, 1.0)
    low, high = values.min(axis=0), values.max(axis=0)
    for _ in range(60):  # to round-off
        middle = 0.5 * (low + high)
        part = np.where(most > least, np.clip((middle - least) / width, 0.0, 1.0), middle >= least)
        enough = (part * lasts).sum(axis=0) >= 0.5 * (times[-1] - times[0])
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return np.asarray(high)


def summary(t: ArrayLike, x: ArrayLike) -> Summary:
    """What histories x (nt, ...) at times t (nt,) s amount to; ResultError if they are no histories.

    cycles: from up-crossing of the mean to up-crossing; crossing_period: their mean length, s; significant_range: mean
    of the largest third of their ranges, as the significant height is that of a sea.
    """
    times, values = checked(t, x)
    mean = mean_over_time(times, values)
    off = values - mean
    deviation = np.sqrt(mean_over_time(times, off**2))
    moves = deviation > STEADY * np.abs(values).max(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        skewness = np.where(moves, mean_over_time(times, off**3) / deviation**3, np.nan)
    low, high = values.argmin(axis=0), values.argmax(axis=0)
    shape = values.shape[1:]
    period, significant = np.full(shape, np.nan), np.full(shape, np.nan)
    cycles = np.zeros(shape, int)
    for where in np.ndindex(shape):
        if moves[where]:
            found = cycles_of(times, off[(slice(None), *where)])
            cycles[where] = found.ranges.size
            if found.ranges.size:
                period[where] = (found.t[-1] - found.t[0]) / found.ranges.size
                significant[where] = mean_of_largest_third(found.ranges)
    extremes = values.min(axis=0), times[low], values.max(axis=0), times[high]
    return Summary(mean, deviation, skewness, *extremes, period, significant, cycles)


class Cycles(NamedTuple):
    """Cycles between up-crossings t (n+1,) s: highest and lowest value (n,) of each, and their difference."""

    t: Floats
    crests: Floats
    troughs: Floats
    ranges: Floats


def cycles_of(t: Floats, off: Floats) -> Cycles:
    """Cycles of one history (nt,) about zero."""
    up = np.flatnonzero((off[:-1] < 0.0) & (off[1:] >= 0.0))
    if up.size < 2:
        none = np.empty(0)
        return Cycles(none, none, none, none)
    at = t[up] - off[up] * (t[up + 1] - t[up]) / (off[up + 1] - off[up])
    inside = off[: up[-1] + 1]
    crests = np.maximum.reduceat(inside, up[:-1] + 1)
    troughs = np.minimum.reduceat(inside, up[:-1] + 1)
    return Cycles(at, crests, troughs, crests - troughs)


def mean_of_largest_third(ranges: Floats) -> float:
    """Mean of the largest third of values, of one at least."""
    return float(np.sort(ranges)[-max(1, round(ranges.size / 3)) :].mean())


# Spectra of histories by Welch's method, and what follows from their moments.
#
# P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70; M. K. Ochi, Ocean Waves (1998).

# Segments overlap by a half; of so many a value of the spectrum has a standard deviation of a quarter.
SEGMENTS = 16
# Samples of a segment at least: fewer resolve no peak.
LEAST_SAMPLES = 16
# Even times to a mean step of uneven ones at most: one step that was cut to 1e-7 s would ask for 74 GB.
MOST_FINER = 16


class Spectrum(NamedTuple):
    """One-sided density S (n, ...) in unit squared seconds (per Hz) at frequencies f (n,) Hz.

    spacing: Hz, of the frequencies that a segment resolves.  captured: part (...) of the variance of the record that
    the spectrum has; well below 1 where segments are short for the periods in it, and longer ones are needed.
    """

    f: Floats
    S: Floats
    spacing: float
    captured: Floats | float = 1.0

    def moment(self, n: int) -> Floats:
        """The integral of f^n S (...), unit squared times Hz^n; that of n = -1 leaves f = 0 out."""
        f, S = (self.f[1:], self.S[1:]) if n < 0 else (self.f, self.S)
        return np.asarray(np.trapezoid(f.reshape(-1, *(1,) * (S.ndim - 1)) ** n * S, f, axis=0))

    @property
    def significant(self) -> Floats:
        """Four standard deviations (...): the significant height, if this is an elevation."""
        return np.asarray(4.0 * np.sqrt(self.moment(0)))

    @property
    def peak_period(self) -> Floats:
        """Period (...) of the largest density, s."""
        return np.asarray(1.0 / self.f[1:][self.S[1:].argmax(axis=0)])

    @property
    def crossing_period(self) -> Floats:
        """Mean period (...) between up-crossings of the mean of a Gaussian process, sqrt(m0 / m2), s."""
        return np.asarray(np.sqrt(self.moment(0) / self.moment(2)))


def welch(t: ArrayLike, x: ArrayLike, segment: float | None = None) -> Spectrum:
    """The spectrum of histories x (nt, ...) at times t (nt,) s; those that are uneven are taken linear on even times.

    These are as close as the closest, but MOST_FINER to a mean step at most.
    segment: s, length of the segments (Hann window, a half of overlap, mean taken out); None: an eighth of the record,
    so that there are 15 or more.  ResultError for a segment that is longer than the record or has few samples.
    """
    from scipy.signal import welch as of_scipy

    times, values = checked(t, x, LEAST_SAMPLES)
    step = np.diff(times)
    dt = max(float(step.min()), float(step.mean()) / MOST_FINER) if np.ptp(step) > 1e-6 * step.max() else step.mean()
    count = round((times[-1] - times[0]) / dt) + 1
    even = times[0] + dt * np.arange(count)
    if np.ptp(step) > 1e-6 * step.max():
        flat = values.reshape(times.size, -1)
        values = np.stack([np.interp(even, times, x) for x in flat.T], axis=1).reshape(count, *values.shape[1:])
    samples = round(segment / dt) if segment is not None else max(2 * count // (SEGMENTS + 1), LEAST_SAMPLES)
    if not LEAST_SAMPLES <= samples <= count:
        raise ResultError(
            f"segments of {samples} samples ({samples * dt:.4g} s)\n"
            f"    expected: {LEAST_SAMPLES} to {count} samples, {LEAST_SAMPLES * dt:.4g} to {count * dt:.4g} s"
        )
    f, S = of_scipy(values, 1.0 / dt, "hann", samples, detrend="constant", axis=0)
    variance = values.var(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        captured = np.where(variance > 0.0, np.trapezoid(S, f, axis=0) / variance, 1.0)
    return Spectrum(f, S, 1.0 / (samples * dt), captured)
