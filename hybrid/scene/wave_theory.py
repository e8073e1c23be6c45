"""Spectra of irregular seas, and steady waves of finite height.

Directions in degrees from x, counter-clockwise seen from above.

The Fourier series of the stream function (Rienecker and Fenton 1981) meets the conditions at the surface.

    symbol   meaning                                                                        unit
    H, d, T  height from trough to crest, depth, period                                     m, m, s
    k, c     wave number, speed                                                             1/m, m/s
    y        height above the bed                                                           m
    b_j      coefficients of the stream function in axes that move with the wave            m^2/s
    psi      -c y + sum b_j sinh(j k y)/cosh(j k d) cos(j k x), -Q at the surface           m^2/s
    R        Bernoulli's constant, (u^2 + v^2)/2 + g y at the surface                       m^2/s^2

The water at a fixed point beneath the troughs is at rest on average (no Eulerian current), so that c = 2 pi/(k T).
Unknown are the surface at N + 1 places from crest to trough, b_j, c, k, Q and R; Newton's method with derivatives by
complex steps, from a low wave to H.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AliasChoices, Field

from hybrid.scene.base import Finding, Findings, Kinds, Number, Place, Positive, Table, Whole

RAMP = "time over which the sea grows from nothing, smoothly; absent: there from the beginning [s]"
DIRECTION = "direction (heading) in which the waves travel, from x counter-clockwise seen from above [deg]"
DEPTH = "depth of the water for the length of the waves; absent: down to the seabed, or deep without one [m]"
HEIGHT = "significant wave height Hs, four standard deviations of the elevation [m]"
PEAK = "period Tp at the peak of the spectrum [s]"
SPREADING = "how the directions of its waves spread about `direction`; absent: all waves travel the same way"
SEED = "seed of the random phases and directions: another seed, another sea [-]"
COUNT = "number of waves in the sum [-]"
# Period of the zero crossings of a Pierson-Moskowitz spectrum, in peak periods: (4/(5 pi))^(1/4).
CROSSINGS = (1.25 * math.pi) ** -0.25

# A height, its key, the period of most energy and its key: what is compared with the height of waves that break.
Size = tuple[float, Place, float, Place]


class Spreading(Table):
    """Directions of waves about the mean: in proportion to cos^2s of half the angle (Longuet-Higgins et al. 1963)."""

    exponent: Positive = Field(
        le=1000, description="exponent s: about 10 of a wind sea, 25 to 75 of swell; more is narrower [-]"
    )


class OnWater(Table):
    """What all waves have, behind keys of their own."""

    bases_last = True

    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)


class Summed(OnWater):
    """A sum of waves with random phases."""

    seed: Whole = Field(default=1, ge=0, description=SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=COUNT)

    @property
    def waves_in_sum(self) -> int:
        """Number of linear waves."""
        return self.components


class Spectrum(Summed):
    """What irregular seas have in common: a direction and spreading, in most a height and one period."""

    direction: Number = Field(default=0.0, description=DIRECTION)
    spreading: Spreading | None = Field(default=None, description=SPREADING)

    if TYPE_CHECKING:

        @property
        def significant_height(self) -> float: ...
        @property
        def peak_period(self) -> Any: ...

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return float(self.peak_period)

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        yield self.significant_height, ("significant_height",), self.main_period, ("peak_period",)

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield ("direction",), self.direction
        if self.spreading is not None:
            yield ("spreading",), self.direction + 90.0


class JonswapWaves(Spectrum):
    """Irregular waves: a sum of linear waves with random phases and a JONSWAP spectrum."""

    kind: Literal["jonswap"] = Field(default="jonswap", description="a spectrum of periods: irregular waves")
    significant_height: Positive = Field(
        validation_alias=AliasChoices("significant_height", "height"), description=HEIGHT
    )
    peak_period: Positive = Field(validation_alias=AliasChoices("peak_period", "period"), description=PEAK)
    gamma: Number = Field(default=3.3, ge=1, description="peak enhancement; 1 is a Pierson-Moskowitz sea [-]")


class PiersonMoskowitzWaves(Spectrum):
    """Irregular waves of a fully grown sea: the spectrum of Pierson and Moskowitz.

    Its height and one period define it (ISSC, Bretschneider).
    """

    kind: Literal["pierson_moskowitz"] = Field(
        default="pierson_moskowitz", description="the spectrum of a fully grown sea (ISSC, Bretschneider)"
    )
    significant_height: Positive = Field(description=HEIGHT)
    peak_period: Positive | None = Field(default=None, description="period Tp at the peak of the spectrum, or [s]")
    zero_crossing_period: Positive | None = Field(
        default=None, description="period Tz between zero crossings, 0.7104 of that at the peak [s]"
    )

    usual = ("peak_period",)

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.peak_period if self.peak_period is not None else (self.zero_crossing_period or 0.0) / CROSSINGS

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        key = "peak_period" if self.peak_period is not None else "zero_crossing_period"
        yield self.significant_height, ("significant_height",), self.main_period, (key,)

    def _check_one_period(self) -> Findings:
        if self.peak_period is None and self.zero_crossing_period is None:
            yield [Finding(("peak_period",), "a number > 0, in s", "add peak_period, or zero_crossing_period")]
        if self.peak_period is not None and self.zero_crossing_period is not None:
            expected = "nothing, because peak_period says it"
            yield [Finding(("zero_crossing_period",), expected, "leave one of them out")]


class SeaPart(Table):
    """A part of an Ochi-Hubble spectrum: of swell, or of the wind sea."""

    significant_height: Positive = Field(description="significant height of this part [m]")
    peak_period: Positive = Field(description="period at the peak of this part [s]")
    shape: Number = Field(ge=0.5, le=20, description="shape lambda: 1 is Pierson-Moskowitz, more is narrower [-]")


class OchiHubbleWaves(Spectrum):
    """Irregular waves of a spectrum with two peaks: the sum of two parts of three parameters (Ochi and Hubble)."""

    kind: Literal["ochi_hubble"] = Field(default="ochi_hubble", description="a spectrum with two peaks, six parameters")
    parts: tuple[SeaPart, ...] = Field(
        min_length=2, max_length=2, description="swell and wind sea, each with its height, period and shape"
    )

    @property
    def significant_height(self) -> float:
        """Of both parts together [m]."""
        return math.hypot(*(x.significant_height for x in self.parts))

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return max(self.parts, key=lambda x: x.significant_height).peak_period

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        for i, x in enumerate(self.parts):
            here = ("parts", i)
            yield x.significant_height, (*here, "significant_height"), x.peak_period, (*here, "peak_period")


class TorsethaugenWaves(Spectrum):
    """Irregular waves of the North Sea with two peaks, swell and wind sea, by one height and period (Torsethaugen)."""

    kind: Literal["torsethaugen"] = Field(
        default="torsethaugen", description="swell and wind sea of the North Sea, by one height and period"
    )
    significant_height: Positive = Field(description=HEIGHT)
    peak_period: Positive = Field(
        le=25,
        description="period Tp at the higher peak: below 6.6 Hs^(1/3) that of the wind sea, else of the swell [s]",
    )


OneSpectrum = Annotated[
    JonswapWaves | PiersonMoskowitzWaves | OchiHubbleWaves | TorsethaugenWaves, Kinds(usual=("jonswap",))
]


class SumOfWaves(OnWater):
    """Swell and wind sea: irregular seas, each with its spectrum and direction, on the same water."""

    kind: Literal["sum"] = Field(default="sum", description="swell and wind sea: several spectra together")
    spectra: tuple[OneSpectrum, ...] = Field(
        min_length=2, max_length=8, description="the seas; phases of all are independent, whatever their seeds"
    )

    @property
    def significant_height(self) -> float:
        """Of all together [m]."""
        return math.hypot(*(x.significant_height for x in self.spectra))

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return max(self.spectra, key=lambda x: x.significant_height).main_period

    @property
    def waves_in_sum(self) -> int:
        """Number of linear waves."""
        return sum(x.components for x in self.spectra)

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        for i, x in enumerate(self.spectra):
            for height, at, period, at_period in x.sizes():
                yield height, ("spectra", i, *at), period, ("spectra", i, *at_period)

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        for i, x in enumerate(self.spectra):
            yield from ((("spectra", i, *at), heading) for at, heading in x.headings())

    def _check_one_sea(self) -> Findings:
        for i, x in enumerate(self.spectra):
            for key in ("depth", "ramp"):
                if getattr(x, key) is not None:
                    expected = "nothing, because all seas of a sum have the same"
                    yield [Finding(("spectra", i, key), expected, f"give it beside spectra, as waves.{key}")]


Array = NDArray[np.float64]
# Depths of more lengths are deep: cosh is exp to 1e-11.
DEEP = 2.0
# Steps to the height, as parts of it.
FIRST_STEP, LEAST_STEP = 0.25, 1.0 / 64
ITERATIONS = 15  # of Newton's method
SETTLED = 1e-11  # change (lengths in d) at which they end
FAR = 1e4  # size of the unknowns (lengths in d) from which they have failed
# Part of the first harmonic that the last ones may have: of a wave of half the depth, twice as long, 20 leave 0.9 %.
FADED = 0.02
# An imaginary step so small that its square vanishes.
TINY = 1e-100


@dataclass(frozen=True)
class SteadyWave:
    """A steady wave: number 1/m, speed m/s, depth m (two lengths at most), amplitudes of its N harmonics.

    elevation: (N,) m and stream: (N,) m/s; eta = sum elevation_j cos(j phi), and along the wave the water moves with
    u = sum stream_j cosh(j k y)/cosh(j k depth) cos(j phi).
    """

    k: float
    speed: float
    depth: float
    elevation: Array
    stream: Array

    @property
    def left(self) -> float:
        """The larger of the last amplitudes of elevation and velocity, as a part of the first."""
        return max(float(np.abs(x[-2:]).max() / abs(x[0])) for x in (self.elevation, self.stream))

    @property
    def orbits(self) -> Array:
        """Amplitudes (N,) m/s that go with cosh(j k y)/sinh(j k depth), as A w of a linear wave."""
        j = np.arange(1, self.stream.size + 1)
        return np.asarray(self.stream * np.tanh(j * self.k * self.depth))


@lru_cache(maxsize=8)
def steady_wave(
    height: float, depth: float, gravity: float, order: int, period: float = 0.0, length: float = 0.0
) -> SteadyWave | None:
    """The steady wave of a height, m, in water of a depth, m (infinity: deep), of a period, s, or of a length, m.

    gravity: m/s^2; order: N.  None: Newton's method does not converge, as of waves that break.
    """
    k = 2 * math.pi / length if length else 0.0
    k = k or wavenumber(2 * math.pi / period, None if math.isinf(depth) else depth, gravity)
    d = min(depth, DEEP * 2 * math.pi / k)
    given = 2 * math.pi * d / length if length else period * math.sqrt(gravity / d)
    found: list[tuple[float, Array]] = []
    step = FIRST_STEP
    while not found or found[-1][0] < 1.0:
        goal = min((found[-1][0] if found else 0.0) + step, 1.0)
        start = _guess(found, goal, height / d, k * d, order)
        x = _newton(_residuals(goal * height / d, order, given, bool(length)), start)
        if x is None:
            step *= 0.5
            if step < LEAST_STEP:
                return None
            continue
        found = [*found[-1:], (goal, x)]
    return _with_units(found[-1][1], d, gravity, order)


def _guess(found: list[tuple[float, Array]], goal: float, height: float, k: float, order: int) -> Array:
    """A start for Newton's method: the linear wave, or what two heights before say; lengths in d, times sqrt(d/g)."""
    if not found:
        A, c = 0.5 * goal * height, math.sqrt(math.tanh(k) / k)
        eta = A * np.cos(np.pi * np.arange(order + 1) / order)
        b = np.zeros(order)
        b[0] = A * c / math.tanh(k)
        return np.concatenate([eta, b, [c, k, c, 0.5 * c * c]])
    (to, x), (before, y) = found[-1], found[-2] if len(found) > 1 else (0.0, found[-1][1])
    return np.asarray(x + (goal - to) / (to - before) * (x - y))


def _residuals(height: float, order: int, given: float, by_length: bool) -> Callable[[NDArray[Any]], NDArray[Any]]:
    """What is to vanish: psi + Q and Bernoulli at N + 1 places, mean and height of the surface, period or length."""
    j = np.arange(1, order + 1)
    angle = np.pi * np.outer(np.arange(order + 1), j) / order
    cosine, sine = np.cos(angle), np.sin(angle)

    def residuals(x: NDArray[Any]) -> NDArray[Any]:
        eta, b, (c, k, Q, R) = x[: order + 1], x[order + 1 : 2 * order + 1], x[2 * order + 1 :]
        rising, falling = np.exp(k * np.outer(eta, j)), np.exp(-k * np.outer(2.0 + eta, j))
        below = 1.0 + np.exp(-2.0 * k * j)
        S, C = (rising - falling) / below, (rising + falling) / below
        stream = -c * (1.0 + eta) + (S * cosine) @ b + Q
        u, v = -c + k * (C * cosine) @ (j * b), k * (S * sine) @ (j * b)
        bernoulli = 0.5 * (u * u + v * v) + eta - R
        mean = 0.5 * (eta[0] + eta[-1]) + np.sum(eta[1:-1])
        last = [mean, eta[0] - eta[-1] - height, k - given if by_length else k * c * given - 2.0 * np.pi]
        return np.concatenate([stream, bernoulli, last])

    return residuals


def _newton(residuals: Callable[[NDArray[Any]], NDArray[Any]], x: Array) -> Array | None:
    """The root near x, with derivatives by complex steps; None: there is none in reach."""
    for _ in range(ITERATIONS):
        J = np.empty((x.size, x.size))
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # x that flies off: it is infinite, or no number, then
                for i in range(x.size):
                    moved = x.astype(complex)
                    moved[i] += 1j * TINY
                    J[:, i] = residuals(moved).imag / TINY
                change = np.linalg.solve(J, residuals(x))
        except np.linalg.LinAlgError:
            return None
        x = x - change
        if not np.isfinite(x).all() or np.abs(x).max() > FAR:
            return None
        if np.abs(change).max() < SETTLED:
            return x
    return None


def _with_units(x: Array, d: float, gravity: float, order: int) -> SteadyWave:
    eta, b, (c, k, _, _) = x[: order + 1], x[order + 1 : 2 * order + 1], x[2 * order + 1 :]
    j, m = np.arange(1, order + 1), np.arange(order + 1)
    weight = np.where((m == 0) | (m == order), 0.5, 1.0)
    E = 2.0 / order * np.cos(np.pi * np.outer(j, m) / order) @ (weight * eta)
    E[-1] *= 0.5
    speed = math.sqrt(gravity * d)
    return SteadyWave(float(k / d), float(c * speed), d, d * E, speed * k * j * b)


# How long linear waves are: the dispersion relation.

# Newton's method on the dispersion relation gains digits quadratically from a start within 5 %.
_MOST_ITERATIONS = 20
# Values of omega^2 depth / gravity beyond which tanh(k depth) is 1, or k depth, to round-off.
_DEEP, _SHALLOW = 20.0, 1e-16


def wavenumber(omega: float, depth: float | None, gravity: float) -> float:
    """Wavenumber k > 0 [1/m] of a linear wave: omega^2 = gravity k tanh(k depth), to round-off.

    omega: angular frequency > 0 [rad/s]; depth [m], None for deep water; gravity > 0 [m/s^2].
    """
    deep = omega * omega / gravity
    if depth is None or deep * depth > _DEEP:
        return deep
    q = deep * depth
    if q < _SHALLOW:
        return omega / math.sqrt(gravity * depth)
    y = q / math.sqrt(math.tanh(q))  # Eckart (1952): k depth within 5 %
    for _ in range(_MOST_ITERATIONS):
        t = math.tanh(y)
        change = (y * t - q) / (t + y * (1.0 - t * t))
        y -= change
        if abs(change) <= 1e-15 * y:
            break
    return y / depth
