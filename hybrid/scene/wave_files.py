"""Waves from files: given one by one, or a measured elevation of the surface and its harmonics.

    symbol    meaning                                        unit
    A, w, phi amplitude, angular frequency, phase of a wave  m, 1/s, rad
    X_j       discrete Fourier transform of the elevation    m

The harmonic j of N samples at steps dt from t0 on is (2/N) |X_j| cos(w_j (t - t0) + arg X_j), w_j = 2 pi j/(N dt); the
wave that has it at a place is A cos(k.(x - place) - w t + phi) with phi = w t0 - arg X.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hybrid.scene.motion_file import RecordRefused, read_table

Array = NDArray[np.float64]
GIVEN, RECORD = ["amplitude", "frequency", "direction", "phase"], ["t", "elevation"]
# Waves in a sum: a step takes as long as 40 of a line of 100 cells without waves.
MOST_WAVES = 5000
# Part of the height of a record that is round-off of its digits.
ROUND_OFF = 1e-6
# Samples: of fewer no harmonic is known.
FEWEST = 8
# Part of a step by which times may be off their even grid: they are written with few digits.
UNEVEN = 0.02


@dataclass(frozen=True)
class Recorded:
    """Waves of a file: rows (n, 4) of amplitude (m), frequency (1/s), phase (rad) at its place, direction (deg).

    begin, end: s, of the record; lost: part of its variance that is in no wave; mean: m, of the elevation, left out.
    """

    waves: Array
    begin: float = -math.inf
    end: float = math.inf
    lost: float = 0.0
    mean: float = 0.0

    @property
    def significant_height(self) -> float:
        """Four standard deviations, m."""
        return 4.0 * math.sqrt(0.5 * float(np.sum(self.waves[:, 0] ** 2)))

    @property
    def has_mean(self) -> bool:
        """Whether the mean that is left out is more than round-off."""
        return abs(self.mean) > ROUND_OFF * self.significant_height

    @property
    def shortest(self) -> float:
        """The shortest period of a wave, s."""
        return float(2.0 * np.pi / self.waves[:, 1].max())

    @property
    def longest(self) -> float:
        """The longest period of a wave, s."""
        return float(2.0 * np.pi / self.waves[:, 1].min())

    @property
    def energy_period(self) -> float:
        """Mean period weighted by energy, s."""
        energy = self.waves[:, 0] ** 2
        return float(2.0 * np.pi * np.sum(energy / self.waves[:, 1]) / np.sum(energy))


@lru_cache(maxsize=4)
def given_waves(path: str, _changed: int, _size: int) -> Recorded:
    """Waves given one by one, read once for as long as the file does not change.  RecordRefused."""
    name = os.path.basename(path)
    header, table, lines = read_table(path, columns_of(GIVEN))
    if not 1 <= len(lines) <= MOST_WAVES:
        expected = f"1 to {MOST_WAVES} rows, one for every wave"
        raise RecordRefused(expected, "leave waves of little energy out", f"{name}, {len(lines)} rows")
    amplitude, frequency, direction, phase = (table[:, header.index(x)] for x in GIVEN)
    for column, values in (("amplitude", amplitude), ("frequency", frequency)):
        for bad in np.flatnonzero(values <= 0.0)[:1]:
            fix = "leave waves without amplitude out; a crest at t = 0 has the phase 0, a trough 180"
            given = f"{name}, line {lines[bad]}: {column} = {values[bad]:g}"
            raise RecordRefused(f"a {column} > 0, in {'m' if column == 'amplitude' else 'rad/s'}", fix, given)
    return Recorded(np.column_stack([amplitude, frequency, np.radians(phase), direction]))


@lru_cache(maxsize=4)
def recorded_waves(path: str, band: tuple[float, float], direction: float, _changed: int, _size: int) -> Recorded:
    """Harmonics of a measured elevation with periods (s) in a band, read once for as long as the file does not change.

    RecordRefused.
    """
    name = os.path.basename(path)
    header, table, lines = read_table(path, columns_of(RECORD))
    if len(lines) < FEWEST:
        raise RecordRefused(f"at least {FEWEST} rows", "give the whole record", f"{name}, {len(lines)} rows")
    t, eta = (table[:, header.index(x)] for x in RECORD)
    n = t.size
    step = (t[-1] - t[0]) / (n - 1)
    grid = t[0] + step * np.arange(n)
    for bad in np.flatnonzero(np.abs(t - grid) > UNEVEN * abs(step))[:1]:
        given = f"{name}, line {lines[bad]}: t = {t[bad]:.9g}, not {grid[bad]:.9g}"
        raise RecordRefused("times at equal, rising steps", "interpolate what is missing", given)
    if step <= 0.0:
        raise RecordRefused("times at equal, rising steps", "sort the rows", f"{name}: from {t[0]:g} to {t[-1]:g} s")
    mean = float(eta.mean())
    X = np.fft.rfft(eta - mean)
    j = np.arange(1, (n + 1) // 2)  # the harmonic of two samples has no phase
    period = n * step / j
    kept = (period >= band[0]) & (period <= band[1]) & (np.abs(X[j]) > 0.0)
    j = j[kept]
    if not 1 <= j.size <= MOST_WAVES:
        expected = f"1 to {MOST_WAVES} harmonics, because each is a wave of the sea"
        fix = "shortest_period and longest_period say which to keep; a shorter record has fewer"
        raise RecordRefused(expected, fix, f"{name}, {j.size} harmonics")
    amplitude, w = 2.0 / n * np.abs(X[j]), 2.0 * np.pi * j / (n * step)
    variance = float(np.mean((eta - mean) ** 2))
    lost = max(0.0, 1.0 - 0.5 * float(np.sum(amplitude**2)) / variance)
    waves = np.column_stack([amplitude, w, w * t[0] - np.angle(X[j]), np.full(j.size, direction)])
    return Recorded(waves, float(t[0]), float(t[0] + n * step), lost, mean)


def columns_of(wanted: list[str]) -> Callable[[str, list[str]], list[str]]:
    """Checks a header for these columns, in any order."""

    def checked(name: str, header: list[str]) -> list[str]:
        if sorted(header) == sorted(wanted):
            return header
        given = f"{name} with columns {', '.join(header)[:60]}"
        raise RecordRefused(f"columns {','.join(wanted)}", "name the columns in the first line of the file", given)

    return checked
