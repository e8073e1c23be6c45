"""Waves on the sea of a scene, by numbers or from files.

They are regular, irregular by a spectrum, given wave by wave, or measured, as an elevation of the surface:

    symbol    meaning                                        unit
    A, w, phi amplitude, angular frequency, phase of a wave  m, 1/s, rad
    X_j       discrete Fourier transform of the elevation    m

The harmonic j of N samples at steps dt from t0 on is (2/N) |X_j| cos(w_j (t - t0) + arg X_j), w_j = 2 pi j/(N dt);
the wave that has it at a place is A cos(k.(x - place) - w t + phi) with phi = w t0 - arg X.

Directions in degrees from x, counter-clockwise seen from above.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hybrid.scene.base import Finding, Findings, Kinds, Number, Place, Positive, Text, Whole, refuse
from hybrid.scene.motion_file import RecordRefused, columns_of, netcdf_reader, read_once, read_table, unreadable
from hybrid.scene.wave_theory import (
    DIRECTION,
    JonswapWaves,
    OchiHubbleWaves,
    OnWater,
    PiersonMoskowitzWaves,
    Size,
    SteadyWave,
    Summed,
    SumOfWaves,
    TorsethaugenWaves,
    steady_wave,
)

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


@read_once(4)
def given_waves(path: str) -> Recorded:
    """Waves given one by one.  RecordRefused."""
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


@read_once(4)
def recorded_waves(path: str, band: tuple[float, float], direction: float) -> Recorded:
    """Harmonics of a measured elevation with periods (s) in a band.  RecordRefused."""
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


# Waves of a measured spectrum over frequency and direction, in a file: a sum of linear waves that has it.
#
#     symbol   meaning                                              unit
#     E        spectrum of the elevation                            m^2/(Hz deg)
#     S        its integral over directions                         m^2/Hz
#     f, a     frequency, direction                                 Hz, deg
#
# A table of rows frequency, direction, density; or netCDF as wavespectra writes it (freq, dir, efth), whose directions
# are those from which waves come, clockwise from north.

COLUMNS = ["frequency", "direction", "density"]
# Frequencies between which a spectrum is linear, and directions at which its parts are known.
FINE, TURN = 20_001, 360.0
# Part of a circle by which directions may be off even, or a gap may be larger than the others.
GAP = 1.5


def shares(omega: Array, S: Array, n: int, shift: float = 0.0) -> tuple[Array, Array]:
    """Frequencies (n,) of n parts of a spectrum over fine frequencies, in their unit, and the part of energy in each.

    Each has the root mean square of the frequencies of its part: the variance of the sea and that of its rate are then
    those of the spectrum.  Parts are of equal energy; shift: by which part of one all but the outer edges lie lower.
    """
    energy, rate = (
        np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(omega))]) for y in (S, omega**2 * S)
    )
    edges = np.arange(n + 1) / n
    if shift and n > 1:
        edges[1:-1] -= shift / n
    parts = np.interp(edges * energy[-1], energy, rate)
    share = np.diff(edges) if shift else np.full(n, 1.0 / n)
    return np.asarray(
        np.sqrt(np.diff(parts) / (share * energy[-1]) if shift else np.diff(parts) * n / energy[-1])
    ), share


@read_once(4)
def spectrum_waves(path: str, record: int | None, north: float, n: int, seed: int) -> Recorded:
    """n waves of equal energy, each with a direction drawn from those at its frequency; RecordRefused.

    record: which of several spectra of a netCDF file; north: deg, heading of north from x.
    """
    name = os.path.basename(path)
    if path.lower().endswith((".nc", ".h5")):
        f, came, E = _of_wavespectra(path, name, record)
        order = np.argsort((north - 180.0 - came) % TURN)
        a, E = ((north - 180.0 - came) % TURN)[order], E[:, order]
    else:
        f, a, E = _of_table(path, name)
    step = np.diff(np.append(a, a[0] + TURN))
    if a.size > 1 and step.max() > GAP * np.median(step):
        given = f"{name}: {step.max():g} deg between two of {a.size} directions"
        raise RecordRefused("directions all around", "add rows with density 0 where nothing comes from", given)
    width = 0.5 * (step + np.roll(step, 1))  # of each direction
    S = E @ width
    if not S.max() > 0.0:
        raise RecordRefused("waves", "give a spectrum that is above zero somewhere", f"{name}: all zero")
    fine = np.linspace(f[0], f[-1], FINE)
    parts, _ = shares(fine, np.interp(fine, f, S), n)
    draw = np.random.default_rng(seed)
    phase, part = draw.uniform(0.0, 2.0 * np.pi, n), (draw.permutation(n) + draw.uniform(size=n)) / n
    towards = np.array([_direction(x, y, f, a, step, E) for x, y in zip(parts, part, strict=True)])
    variance = float(np.trapezoid(np.interp(fine, f, S), fine))
    amplitude = np.full(n, np.sqrt(2.0 * variance / n))
    return Recorded(np.column_stack([amplitude, 2.0 * np.pi * parts, phase, towards]))


def _direction(x: float, part: float, f: Array, a: Array, step: Array, E: Array) -> float:
    """Direction (deg) up to which a part of the energy at frequency x comes, from the first one round."""
    k = int(np.clip(np.searchsorted(f, x) - 1, 0, f.size - 2))
    weight = (x - f[k]) / (f[k + 1] - f[k])
    D = (1.0 - weight) * E[k] + weight * E[k + 1]
    if a.size == 1:
        return float(a[0])
    closed = np.append(D, D[0])
    sums = np.concatenate([[0.0], np.cumsum(0.5 * (closed[1:] + closed[:-1]) * step)])
    j = int(np.clip(np.searchsorted(sums, part * sums[-1], side="right") - 1, 0, step.size - 1))
    left, p, q, h = part * sums[-1] - sums[j], closed[j], closed[j + 1], step[j]
    root = np.sqrt(max(p * p + 2.0 * (q - p) * left / h, 0.0))  # of p y + (q - p) y^2/(2 h) = left
    return float(a[j] + (2.0 * left / (p + root) if p + root > 0.0 else 0.0))


def _of_table(path: str, name: str) -> tuple[Array, Array, Array]:
    header, table, lines = read_table(path, columns_of(COLUMNS))
    rows = table[:, [header.index(x) for x in COLUMNS]]
    f, a = np.unique(rows[:, 0]), np.unique(rows[:, 1] % TURN)
    i, j = np.searchsorted(f, rows[:, 0]), np.searchsorted(a, rows[:, 1] % TURN)
    if f.size < 2 or len(rows) != f.size * a.size or np.unique(i * a.size + j).size != len(rows):
        given = f"{name}: {len(rows)} rows, {f.size} frequencies, {a.size} directions"
        raise RecordRefused("one row for each frequency and direction", "fill the gaps with density 0", given)
    for bad in np.flatnonzero((rows[:, 2] < 0.0) | (rows[:, 0] <= 0.0))[:1]:
        given = f"{name}, line {lines[bad]}: frequency {rows[bad, 0]:g}, density {rows[bad, 2]:g}"
        raise RecordRefused("frequencies > 0 in Hz, densities >= 0 in m^2/(Hz deg)", "check the row", given)
    E = np.zeros((f.size, a.size))
    E[i, j] = rows[:, 2]
    return f, a, E


def _of_wavespectra(path: str, name: str, record: int | None) -> tuple[Array, Array, Array]:
    """Frequencies (Hz), directions from which waves come (deg from north, clockwise), densities."""
    fix = "write it by wavespectra: dataset.to_netcdf(..), or a CSV file of frequency,direction,density"
    xarray = netcdf_reader(name)
    try:
        with xarray.open_dataset(path) as opened:
            f, came = (np.asarray(opened[x].values, float) for x in ("freq", "dir"))
            every = np.asarray(opened["efth"].transpose(..., "freq", "dir").values, float)
    except Exception as error:  # of any of its engines
        raise RecordRefused("netCDF with freq, dir and efth", fix, f"{name}: {error}"[:200]) from None
    if f.size < 2:
        raise RecordRefused("two frequencies or more", fix, f"{name}: {f.size}")
    every = every.reshape(-1, f.size, came.size)
    if record is None and len(every) > 1:
        raise RecordRefused(f"record: 0 to {len(every) - 1}, which of them", "add `record: 0`", f"{name}: {len(every)}")
    if (record or 0) >= len(every):
        raise RecordRefused(f"a record from 0 to {len(every) - 1}", "count from 0", f"{name}, record {record}")
    E = every[record or 0]
    if not np.isfinite(E).all() or (E < 0.0).any() or (f <= 0.0).any() or (np.diff(f) <= 0.0).any():
        raise RecordRefused("rising frequencies > 0, densities >= 0", "choose another record", name)
    return f, came, E


class _Periodic(OnWater):
    """Waves of one period and direction."""

    if TYPE_CHECKING:
        period: float
        direction: float

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.period

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield ("direction",), self.direction


class RegularWaves(_Periodic):
    """Linear (Airy) waves of one period: elevation height / 2 x cos(k x - w t + phase) along their direction."""

    kind: Literal["regular"] = Field(default="regular", description="one period, linear (Airy)")
    height: Positive = Field(description="height H from trough to crest [m]")
    period: Positive = Field(description="period T [s]")
    direction: Number = Field(default=0.0, description=DIRECTION)
    phase: Number = Field(default=0.0, description="phase at x = y = 0 and t = 0; 0 is a crest [deg]")

    @property
    def waves_in_sum(self) -> int:
        """Number of linear waves."""
        return 1

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        yield self.height, ("height",), self.period, ("period",)


class StreamFunctionWaves(_Periodic):
    """Waves of one period and finite height, steady: crests are sharper than troughs, and nothing is stretched."""

    kind: Literal["stream_function"] = Field(
        default="stream_function", description="one period, finite height (stream function of Rienecker and Fenton)"
    )
    height: Positive = Field(description="height H from trough to crest [m]")
    period: Positive = Field(description="period T, where there is no current [s]")
    direction: Number = Field(default=0.0, description=DIRECTION)
    phase: Number = Field(default=0.0, description="phase at x = y = 0 and t = 0; 0 is a crest [deg]")
    order: Whole = Field(default=20, ge=5, le=40, description="number of harmonics of its Fourier series [-]")

    def steady(self, depth: float, gravity: float) -> SteadyWave:
        """The wave in water of a depth (m; infinity: deep).  Only after validation: there is one then."""
        found = steady_wave(self.height, depth, gravity, self.order, self.period)
        if found is None:
            expected = "a wave that does not break"
            refuse([Finding(("environment", "fluid", "waves", "height"), expected, "lower waves, or a longer period")])
        assert found is not None
        return found

    @property
    def waves_in_sum(self) -> int:
        """Number of harmonics."""
        return self.order

    def sizes(self) -> Iterator[Size]:
        """Nothing: whether it breaks is found with the wave."""
        yield from ()


PeriodicWaves = RegularWaves | StreamFunctionWaves


class _OfFile(OnWater):
    """Waves that a file gives."""

    if TYPE_CHECKING:
        file: str

    @property
    def recorded(self) -> Recorded:
        """The waves of the file.  Only after validation: it is readable then."""
        raise NotImplementedError

    @property
    def significant_height(self) -> float:
        """Four standard deviations of the elevation [m]."""
        return self.recorded.significant_height

    @property
    def main_period(self) -> float:
        """The period that carries most energy: of all, weighted by it [s]."""
        return self.recorded.energy_period

    @property
    def waves_in_sum(self) -> int:
        """Number of linear waves."""
        return len(self.recorded.waves)

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        yield self.significant_height, ("file",), self.main_period, ("file",)

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield from ((("file",), heading) for heading in sorted({float(x) for x in self.recorded.waves[:, 3]}))

    def _check_readable(self) -> Findings:
        return unreadable(self.file, lambda: self.recorded)


class GivenWaves(_OfFile):
    """Linear waves given one by one: the sum of amplitude x cos(k x' - frequency t + phase), x' along its direction."""

    kind: Literal["components"] = Field(default="components", description="waves given one by one, in a file")
    file: Text = Field(
        min_length=1,
        description="CSV file with columns amplitude,frequency,direction,phase (m, rad/s, deg, deg), a row for every "
        "wave; relative to the scene file",
    )

    @property
    def recorded(self) -> Recorded:
        return given_waves(self.file)


class RecordedWaves(_OfFile):
    """A measured elevation at a place as the sum of its harmonics, all in one direction: there it is as measured."""

    kind: Literal["record"] = Field(default="record", description="a measured elevation of the surface, in a file")
    file: Text = Field(
        min_length=1,
        description="CSV file with columns t,elevation (s, m) at equal steps, from t = 0 or before to the end of the "
        "run; relative to the scene file",
    )
    position: tuple[Number, Number] = Field(default=(0.0, 0.0), description="x and y of where it was measured [m]")
    direction: Number = Field(default=0.0, description=DIRECTION)
    shortest_period: Positive | None = Field(
        default=None, description="waves of shorter periods are left out, and noted; absent: none are [s]"
    )
    longest_period: Positive | None = Field(
        default=None, description="waves of longer periods are left out, and noted; absent: none are [s]"
    )

    @property
    def recorded(self) -> Recorded:
        return recorded_waves(self.file, self._band, self.direction)

    @property
    def _band(self) -> tuple[float, float]:
        return self.shortest_period or 0.0, self.longest_period or math.inf

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield ("direction",), self.direction

    def _check_readable(self) -> Findings:
        short, long = self._band
        if long <= short:
            yield [Finding(("longest_period",), f"more than shortest_period, {short:g} s", "swap them")]
        yield from super()._check_readable()


class MeasuredWaves(_OfFile, Summed):
    """Irregular waves of a measured spectrum over frequency and direction: a sum of linear waves with random phases."""

    kind: Literal["spectrum"] = Field(default="spectrum", description="a measured spectrum, in a file")
    file: Text = Field(
        min_length=1,
        description="CSV file with columns frequency,direction,density (Hz, deg, m^2/(Hz deg)), a row for each "
        "frequency and direction of a grid, directions those in which waves travel; or netCDF as wavespectra writes it "
        "(freq, dir, efth), directions from which they come, clockwise from north; relative to the scene file",
    )
    record: Whole | None = Field(default=None, ge=0, description="of netCDF: which of several spectra, from 0 [-]")
    north: Number = Field(default=90.0, description="of netCDF: heading of north from x, counter-clockwise [deg]")

    @property
    def recorded(self) -> Recorded:
        return spectrum_waves(self.file, self.record, self.north, self.components, self.seed)


Waves = Annotated[
    RegularWaves
    | StreamFunctionWaves
    | JonswapWaves
    | PiersonMoskowitzWaves
    | OchiHubbleWaves
    | TorsethaugenWaves
    | SumOfWaves
    | GivenWaves
    | RecordedWaves
    | MeasuredWaves,
    Kinds(usual=("regular",)),
]
