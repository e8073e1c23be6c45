"""What a longer time brings: laws fitted to peaks of a record or to largest values of records, with intervals.

A record: its peaks, one per cycle about the mean, that exceed a threshold come at a rate, and what they exceed it by is
Weibull-distributed (exponential with shape 1).  Of the largest value in a time T then
P(x) = exp(-rate T exp(-((x - threshold) / scale)^shape)).
Several records of equal length, such as seeds: their largest values are Gumbel-distributed, P(x) = exp(-exp(-(x - mode)
/ scale)).

Laws are fitted by L-moments, which are closed forms and less disturbed by one large value than maximum likelihood
(J. R. M. Hosking, J. R. Statist. Soc. B 52 (1990) 105); intervals are a parametric bootstrap with a fixed seed.
Histories whose small values matter (a line that goes slack) are negated before and after.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid.errors import ResultError
from hybrid.statistics.moments import checked, cycles_of, mean_over_time

Floats = NDArray[np.float64]

THREE_HOURS = 10800.0  # s
# Fractile that is printed beside the most probable value, and the part of bootstrap values inside an interval.
FRACTILE, CONFIDENCE = 0.9, 0.9
# Bootstrap samples: a hundred lie beyond each end of an interval.
RESAMPLES = 2000
# Peaks, or largest values, that a fit needs; a law of two numbers through fewer says nothing.
LEAST_PEAKS, LEAST_RECORDS = 20, 5
# The threshold that is taken where none is given: this fractile of the peaks.  Of JONSWAP waves the most probable value
# of three hours is then 3 % too large in the mean; with 0.8 it is 6 %, with 0.5 10 %.
USUAL_THRESHOLD = 0.9
EULER = 0.5772156649015329  # Euler's constant: mean of the standard Gumbel law
# Shapes of Weibull laws: with the smallest what is exceeded once in e^7 is 7^10 scales above the threshold, with the
# largest all are alike.  Peaks of a regular motion, all alike but for one of its beginning, ask for less and more.
LEAST_SHAPE, LARGEST_SHAPE = 0.1, 1e9


class Extreme(NamedTuple):
    """The largest value in a time, each number with its interval (low, high) at CONFIDENCE.

    most_probable: maximum (MPM), exceeded once in that time on average; median: exceeded by the largest values of half
    of many such times; fractile: not exceeded with `probability` (P90 with 0.9);
    law: "weibull" or "gumbel", `fitted`: its numbers in words; peaks: that entered the fit; duration: s; beyond: how
    many times the record that is.
    """

    law: str
    most_probable: float
    most_probable_interval: tuple[float, float]
    median: float
    median_interval: tuple[float, float]
    fractile: float
    fractile_interval: tuple[float, float]
    probability: float
    duration: float
    peaks: int
    beyond: float
    fitted: str


def l_moments(x: Floats) -> tuple[Floats, Floats]:
    """First two L-moments (...) of samples (n, ...): the mean, and half the mean difference of two values."""
    ordered = np.sort(x, axis=0)
    n = x.shape[0]
    weight = (np.arange(n) / (n - 1.0)).reshape(-1, *(1,) * (x.ndim - 1))
    first = ordered.mean(axis=0)
    return first, 2.0 * (weight * ordered).mean(axis=0) - first


def fit_gumbel(x: Floats) -> tuple[Floats, Floats]:
    """Mode and scale (...) of Gumbel laws of samples (n, ...)."""
    first, second = l_moments(x)
    scale = second / math.log(2.0)
    return first - EULER * scale, scale


def fit_weibull(y: Floats) -> tuple[Floats, Floats]:
    """Scale and shape (...) of Weibull laws of samples (n, ...) of values above zero."""
    from scipy.special import gamma

    first, second = l_moments(y)
    alike, unlike = (-math.expm1(-math.log(2.0) / x) for x in (LARGEST_SHAPE, LEAST_SHAPE))
    shape = -math.log(2.0) / np.log1p(-np.clip(second / first, alike, unlike))
    return first / gamma(1.0 + 1.0 / shape), shape


def peaks_of(t: ArrayLike, x: ArrayLike) -> Floats:
    """The largest value of every cycle of a history (nt,) about its mean."""
    times, values = checked(t, x)
    mean = float(mean_over_time(times, values))
    return cycles_of(times, values - mean).crests + mean


def of_record(
    t: ArrayLike,
    x: ArrayLike,
    duration: float = THREE_HOURS,
    threshold: float | None = None,
    probability: float = FRACTILE,
) -> Extreme:
    """The largest value of a history x (nt,) in a time of `duration` (s), by its peaks over a threshold.

    threshold: in the unit of x; None: the fractile USUAL_THRESHOLD of the peaks, but so that LEAST_PEAKS are left.
    ResultError with fewer peaks than that.
    """
    check(duration, probability)
    times, _ = checked(t, x)
    peaks = peaks_of(t, x)
    if threshold is None and peaks.size >= LEAST_PEAKS:
        part = max(1.0 - USUAL_THRESHOLD, LEAST_PEAKS / peaks.size)
        threshold = float(np.sort(peaks)[max(peaks.size - math.ceil(part * peaks.size) - 1, 0)])
    over = np.empty(0) if threshold is None else peaks[peaks > threshold] - threshold
    if threshold is None or over.size < LEAST_PEAKS - 1:
        count = over.size if threshold is not None else peaks.size
        raise ResultError(
            f"{f'{count} peaks are' if count != 1 else '1 peak is'} too few to fit a law\n"
            f"    expected: {LEAST_PEAKS} at least\n    try:      a longer run, or a lower threshold"
        )
    number = over.size * duration / (times[-1] - times[0])
    if number < 1.0:
        raise ResultError(f"in {duration:.4g} s less than one peak over {threshold:.6g} is expected; a lower threshold")
    scale, shape = fit_weibull(over)
    # More or fewer peaks and other heights, as chance would have it.
    rng = np.random.default_rng(0)
    counts = np.maximum(rng.poisson(over.size, RESAMPLES), 1)
    drawn = scale * rng.weibull(shape, (over.size, RESAMPLES))
    scales, shapes = fit_weibull(drawn)
    numbers = number * counts / over.size

    def beyond(number: Floats | float, scale: Floats | float, shape: Floats | float, part: float) -> Floats:
        return np.asarray(threshold + scale * np.maximum(np.log(number / part), 0.0) ** (1.0 / shape))

    # P(x) = p where rate T exp(-((x - threshold) / scale)^shape) = -ln p; the most probable value is that of 1.
    def figure(part: float) -> tuple[float, tuple[float, float]]:
        return float(beyond(number, scale, shape, part)), _interval(beyond(numbers, scales, shapes, part))

    figures = *figure(1.0), *figure(math.log(2.0)), *figure(-math.log(probability)), probability, duration
    law = f"Weibull, threshold {threshold:.6g}, scale {float(scale):.4g}, shape {float(shape):.4g}"
    return Extreme("weibull", *figures, int(over.size), duration / float(times[-1] - times[0]), law)


def of_maxima(
    maxima: ArrayLike, record: float, duration: float = THREE_HOURS, probability: float = FRACTILE
) -> Extreme:
    """The largest value in a time of `duration` (s), by the largest values (n,) of n records of `record` (s) each.

    ResultError with less than LEAST_RECORDS, or values that are all alike.
    """
    check(duration, probability)
    check(record, probability)
    values = np.asarray(maxima, float).ravel()
    if values.size < LEAST_RECORDS or not np.all(np.isfinite(values)):
        raise ResultError(
            f"{int(np.isfinite(values).sum())} of {values.size} largest values are numbers\n"
            f"    expected: {LEAST_RECORDS} at least, and all of them\n    try:      more seeds"
        )
    mode, scale = fit_gumbel(values)
    shift = math.log(duration / record)
    if not scale > 0.0:
        raise ResultError(f"{values.size} largest values are all {values[0]:.6g}\n    try:      other seeds")
    rng = np.random.default_rng(0)
    modes, scales = fit_gumbel(rng.gumbel(float(mode), float(scale), (values.size, RESAMPLES)))

    # P(x) = p at -ln(-ln p) scales above the mode.
    def figure(above: float) -> tuple[float, tuple[float, float]]:
        return float(mode + scale * (shift + above)), _interval(modes + scales * (shift + above))

    figures = *figure(0.0), *figure(-math.log(math.log(2.0))), *figure(-math.log(-math.log(probability)))
    law = f"Gumbel, mode {float(mode):.6g}, scale {float(scale):.4g}"
    return Extreme("gumbel", *figures, probability, duration, int(values.size), duration / record, law)


def check(duration: float, probability: float) -> None:
    """ResultError for times and probabilities that are none."""
    if not 0.0 < duration < math.inf:
        raise ResultError(f"duration = {duration:g} s is no time\n    expected: a number above 0")
    if not 0.0 < probability < 1.0:
        raise ResultError(f"probability = {probability:g} is none\n    expected: a number between 0 and 1")


def _interval(values: Floats) -> tuple[float, float]:
    low, high = np.quantile(values, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    return float(low), float(high)
