"""What a response by frequency has found: amplitudes of each line, with deviations, spectra, extremes and fatigue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.state import Floats
from hybrid.linear.drag import covariance_of, phases_of, size_deviation
from hybrid.statistics.fatigue import Curve, curve_of, damage, dirlik_damage

HOURS = 3.0
# Part of the largest deviation along a line from which one is known: below it what goes with the square of the motion,
# which is left out, may be several times as much.
OF_LARGEST = 0.2
# Parts that what is left out may add to a deviation: half to three quarters of that come true, which is 3 % here
# (bench/test_bench_response.py).
ADDED = {"tension": 0.045, "curvature": 0.055}
COUNTED = 50  # longest periods in which cycles of few frequencies are counted
PER_PERIOD = 32  # samples of the shortest period that counts
SMALL = 1e-5  # part of the power below which a frequency does not count
VARIES = ("position", "tension", "curvature", "curvature_across")
ALONE = ("tension", "curvature")  # of which notes begin with the quantity and its place


@dataclass(frozen=True)
class LineSpectrum:
    """Power at single frequencies: f (F,) Hz, power (F, ...) in unit squared, half the squares of amplitudes."""

    f: Floats
    power: Floats

    def moment(self, n: int) -> Floats:
        """Sum of f^n power (...), unit squared times Hz^n."""
        return np.asarray(np.tensordot(self.f**n, self.power, axes=1))


@dataclass(frozen=True)
class LineResponse:
    """Response of one line: mean and complex amplitudes at every frequency.

    s: (N+1,) m; middle: (N,) m, of the cells; f: (F,) Hz.  Amplitudes of exp(-2 pi i f t): position (F, N+1, 3) m,
    tension (F, N) N, curvature (F, N+1) 1/m in the plane in which the line is bent at rest, and curvature_across it.
    Means: (N+1, 3), (N,), (N+1,).  left_out: what the rest of quadratic drag and the stretch by swinging, which no
    amplitude has, would add to deviations of tension (N,) and curvature (N+1,), as parts, to the first order.
    shape: part (N+1,) by which the law of drag, which is not normal, changes the deviation of the size of curvature.
    """

    s: Floats
    middle: Floats
    f: Floats
    position: Floats
    tension: Floats
    curvature: Floats
    curvature_across: Floats
    mean_position: Floats
    mean_tension: Floats
    mean_curvature: Floats
    left_out: Mapping[str, Floats] = field(default_factory=dict)
    shape: Floats | float = 0.0

    def spectrum(self, name: str) -> LineSpectrum:
        """Power by frequency of position (F, N+1, 3), tension (F, N), curvature or curvature_across (F, N+1)."""
        if name not in VARIES:
            raise ValueError(f"{name!r}: one of {', '.join(VARIES)}")
        return LineSpectrum(self.f, 0.5 * np.abs(getattr(self, name)) ** 2)

    def deviation(self, name: str) -> Floats:
        """Standard deviation, in the unit of the quantity; of `curvature` that of its size, with what is across."""
        if name != "curvature":
            return np.sqrt(self.spectrum(name).moment(0))
        phases = phases_of(self.f)
        if phases is not None:
            in_plane, aside = (phases @ self.curvature).real, (phases @ self.curvature_across).real
            return np.asarray(np.hypot(self.mean_curvature + in_plane, aside).std(axis=0))
        return np.asarray(size_deviation(self.mean_curvature, self.covariance) * (1.0 + self.shape))

    @property
    def covariance(self) -> Floats:
        """(N+1, 2, 2) 1/m^2, of curvature in the plane of the bend and across it."""
        return covariance_of(np.stack([self.curvature, self.curvature_across], axis=2))

    def resolved(self, name: str) -> NDArray[np.bool_]:
        """Where the linear response is resolved: what it neglects is small beside it.

        The standard deviation is at least `OF_LARGEST` of the largest of the line, and neglected terms add at most
        `ADDED` to it; elsewhere terms of second order may be several times as large.
        """
        deviation = self.deviation(name)
        return np.asarray(
            (deviation >= OF_LARGEST * deviation.max()) & (self.left_out.get(name, 0.0) <= ADDED.get(name, np.inf))
        )

    def period(self, name: str) -> Floats:
        """Mean period between up-crossings, s."""
        spectrum = self.spectrum(name)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sqrt(spectrum.moment(0) / spectrum.moment(2)))

    def most_probable(self, name: str, hours: float = HOURS) -> Floats:
        """Most probable largest deviation from the mean of a Gaussian process in `hours`.

        At most the sum of all amplitudes.  ValueError: hours are no time.
        """
        _above_zero("hours", hours)
        period = self.period(name)
        cycles = np.maximum(3600.0 * hours / np.where(period > 0.0, period, np.inf), 1.0)
        together = np.abs(getattr(self, name)).sum(axis=0)
        return np.minimum(self.deviation(name) * np.sqrt(2.0 * np.log(cycles)), together)

    def damage(self, curve: str | Mapping[str, float | str] | Curve, strength: float, hours: float = HOURS) -> Floats:
        """Fatigue damage (N,) of the tension in `hours`, by a T-N curve over a strength (N).

        By Dirlik's law; of few frequencies, whose sum is no normal process, by counted cycles.  ValueError: strength or
        hours are not above 0, or the curve is one of stress; ResultError: the package rainflow, which counts, is
        missing.
        """
        found = curve_of(curve)
        _above_zero("strength", strength)
        _above_zero("hours", hours)
        if found.kind != "T-N":
            raise ValueError(f"a curve of kind {found.kind}: expected T-N, over the strength; stress is not known here")
        if len(self.f) == 1:
            return np.asarray(3600.0 * hours * self.f[0] / found.cycles(2.0 * np.abs(self.tension[0]) / strength))
        if phases_of(self.f) is not None:
            return self._counted(found, strength) * 3600.0 * hours * self.f[0] / COUNTED
        spectrum = self.spectrum("tension")
        scaled: Any = LineSpectrum(spectrum.f, spectrum.power / strength**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(dirlik_damage(scaled, found, 3600.0 * hours))

    def _counted(self, curve: Curve, strength: float) -> Floats:
        """Damage (N,) in `COUNTED` of the longest periods."""
        power = self.spectrum("tension").power
        counts = self.f[(power > SMALL * power.sum(axis=0)).any(axis=1)]
        if not counts.size:
            return np.zeros(self.middle.size)
        t = np.linspace(0.0, COUNTED / self.f[0], 1 + round(PER_PERIOD * COUNTED * counts[-1] / self.f[0]))
        turned = np.exp(-2j * np.pi * np.outer(t, self.f))
        return np.array([damage((turned @ x).real, curve, 1.0 / strength) for x in self.tension.T])


@dataclass(frozen=True)
class Response:
    """Response of a scene: by the name of a line (`cable` of a scene of one); notes say where it is not valid.

    points: (F, 3) m and bodies: (F, 6) m, rad by name, complex amplitudes.  checks: of a run in time, by quantity where
    it varies most, the standard deviation here and there.
    """

    title: str
    lines: Mapping[str, LineResponse]
    points: Mapping[str, Floats]
    bodies: Mapping[str, Floats]
    rounds: int
    checks: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...]

    @property
    def valid(self) -> bool:
        """Whether nothing speaks against any of it."""
        return not self.notes

    def valid_for(self, name: str) -> bool:
        """Whether nothing speaks against a quantity: what is said of another one alone is no doubt of it.

        ValueError: it is none of `VARIES`."""
        if name not in VARIES:
            raise ValueError(f"{name!r}: one of {', '.join(VARIES)}")
        alone = {of: [x for x in self.notes if f"{of} at s" in x] for of in ALONE}
        others = [x for of, notes in alone.items() if not name.startswith(of) for x in notes]
        return all(x in others for x in self.notes)


def _above_zero(name: str, value: float) -> None:
    if not 0.0 < value < np.inf:
        raise ValueError(f"{name} = {value:g}: expected a number above 0")
