"""Extremes of a time longer than a result, where a law of its peaks may say them: not of round-off or past a bound."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hybrid.errors import ResultError
from hybrid.statistics import extremes
from hybrid.statistics.moments import STEADY, mean_over_time

if TYPE_CHECKING:
    from hybrid.store.reader import Result

Floats = np.ndarray

# Forces F and lengths L of a line are computed with 1e-16 of themselves in each of some thousand operations: what
# ranges over less than this part of them is round-off.
ROUND_OFF = 1e-12
# What an angle between two directions cannot exceed, by its unit.
HALF_TURN = {"deg": 180.0, "rad": math.pi}
# Largest peaks are alike where their median exceeds the least of them by less than this part of its height over the
# mean: of a regular motion by some 0.001, of the largest tenth of the peaks of a random sea by 0.14.
ALIKE = 0.02
# Angles that are counted on through full turns.
COUNTED_ON = "rotation"


def extreme_of(
    result: Result, name: str, unit: str, t: Floats, x: Floats, duration: float = extremes.THREE_HOURS, *,
    threshold: float | None = None, smallest: bool = False, probability: float = extremes.FRACTILE,
) -> extremes.Extreme:  # fmt: skip
    """The largest (or smallest) value that a time of `duration` (s) brings of a history x (nt,) at times t (nt,) s.

    threshold: in the unit of x.  ResultError where there are too few peaks, where the history is round-off, where the
    largest peaks are alike, as of a regular motion, and where the law leads beyond what an angle can be.
    """
    sign = -1.0 if smallest else 1.0
    extremes.check(duration, probability)
    _refuse_round_off(result, name, unit, x)
    _refuse_regular(t, sign * x)
    found = extremes.of_record(t, sign * x, duration, None if threshold is None else sign * threshold, probability)
    most = HALF_TURN.get(unit)
    if most is not None and not name.endswith(COUNTED_ON):
        bound = most if not smallest else 0.0 if x.min() >= 0.0 else -most
        reached = sign * found.fractile_interval[1]
        if sign * reached > sign * bound:
            raise ResultError(
                f"the law of its peaks leads to {reached:.4g} {unit}, and the angle is bounded by {bound:.4g} {unit}\n"
                "    try:      the force whose direction it is, or a longer run"
            )
    return found if not smallest else _negated(found)


def _refuse_round_off(result: Result, name: str, unit: str, x: Floats) -> None:
    """ResultError for a history that ranges over no more than round-off of its own size, or of forces and lengths."""
    spread, size = float(np.ptp(x)), float(np.abs(x).max())
    least, of = STEADY * size, f"{size:.3g} {unit}, its size"
    scale = _scale(result, unit)
    if scale is not None and ROUND_OFF * scale > least:
        least, of = ROUND_OFF * scale, f"{scale:.3g} {unit}, the scale of the line"
    if spread <= least:
        raise ResultError(f"it ranges over {spread:.2g} {unit}: round-off of {of}\n    try:      another quantity")


def _refuse_regular(t: Floats, x: Floats) -> None:
    """ResultError for a motion whose largest peaks are alike: a longer time brings no larger ones."""
    peaks = np.sort(extremes.peaks_of(t, x))
    most = max(extremes.LEAST_PEAKS, math.ceil((1.0 - extremes.USUAL_THRESHOLD) * peaks.size))
    largest, mean = peaks[-most:], float(mean_over_time(t, x))
    if peaks.size >= extremes.LEAST_PEAKS and np.median(largest) - largest[0] < ALIKE * (largest[0] - mean):
        raise ResultError("its largest peaks are alike, as of a regular motion: no longer time brings larger ones")


def _scale(result: Result, unit: str) -> float | None:
    """Of a unit, what the largest force F (N) and the length L (m) of a line make of it; None: not known."""
    length = float(np.ptp(result.s)) if not result.lines and "tension" in result and len(result.s) else 0.0
    if not length:
        return None
    force = float(np.nanmax(np.abs(result["tension"]), initial=0.0))
    scales = {"N": force, "N m": force * length, "1/m": 1.0 / length, "m": length, "N/m": force / length}
    return scales.get(unit)


def _negated(found: extremes.Extreme) -> extremes.Extreme:
    """What was found of the negative values, of the values."""

    def turned(interval: tuple[float, float]) -> tuple[float, float]:
        return -interval[1], -interval[0]

    return found._replace(
        most_probable=-found.most_probable, median=-found.median, fractile=-found.fractile,
        most_probable_interval=turned(found.most_probable_interval), median_interval=turned(found.median_interval),
        fractile_interval=turned(found.fractile_interval), fitted=f"of the negative values: {found.fitted}",
    )  # fmt: skip
