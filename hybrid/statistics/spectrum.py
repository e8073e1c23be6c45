"""Spectra of histories by Welch's method, and what follows from their moments.

P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70; M. K. Ochi, Ocean Waves (1998).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid.errors import ResultError
from hybrid.statistics.moments import checked

Floats = NDArray[np.float64]

# Segments overlap by a half; of so many a value of the spectrum has a standard deviation of a quarter.
SEGMENTS = 16
# Samples of a segment at least: fewer resolve no peak.
LEAST_SAMPLES = 16


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

    segment: s, length of the segments (Hann window, a half of overlap, mean taken out); None: an eighth of the record,
    so that there are 15 or more.  ResultError for a segment that is longer than the record or has few samples.
    """
    from scipy.signal import welch as of_scipy

    times, values = checked(t, x, LEAST_SAMPLES)
    step = np.diff(times)
    dt = float(step.min() if np.ptp(step) > 1e-6 * step.max() else step.mean())
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
