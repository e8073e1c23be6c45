"""Waves on the sea of a scene: regular, irregular by a spectrum, given wave by wave, or measured.

Directions in degrees from x, counter-clockwise seen from above.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AliasChoices, Discriminator, Field, Tag, model_validator

from hybrid.scene.base import Finding, Kinds, Number, Place, Positive, Table, Text, Whole, by_kind, refuse

if TYPE_CHECKING:
    from hybrid.scene.stream_function import SteadyWave
    from hybrid.scene.wave_files import Recorded

_RAMP = "time over which the sea grows from nothing, smoothly; absent: there from the beginning [s]"
_DIRECTION = "direction (heading) in which the waves travel, from x counter-clockwise seen from above [deg]"
_DEPTH = "depth of the water for the length of the waves; absent: down to the seabed, or deep without one [m]"
_HEIGHT = "significant wave height Hs, four standard deviations of the elevation [m]"
_PEAK = "period Tp at the peak of the spectrum [s]"
_SPREADING = "how the directions of its waves spread about `direction`; absent: all waves travel the same way"
_SEED = "seed of the random phases and directions: another seed, another sea [-]"
_COUNT = "number of waves in the sum [-]"
# Period of the zero crossings of a Pierson-Moskowitz spectrum, in peak periods: (4/(5 pi))^(1/4).
CROSSINGS = (1.25 * math.pi) ** -0.25

# A height, its key, the period of most energy and its key: what is compared with the height of waves that break.
Size = tuple[float, Place, float, Place]


class Spreading(Table):
    """Directions of waves about the mean: in proportion to cos^2s of half the angle (Longuet-Higgins et al. 1963)."""

    exponent: Positive = Field(
        le=1000, description="exponent s: about 10 of a wind sea, 25 to 75 of swell; more is narrower [-]"
    )


class RegularWaves(Table):
    """Linear (Airy) waves of one period: elevation height / 2 x cos(k x - w t + phase) along their direction."""

    kind: Literal["regular"] = Field(default="regular", description="one period, linear (Airy)")
    height: Positive = Field(description="height H from trough to crest [m]")
    period: Positive = Field(description="period T [s]")
    direction: Number = Field(default=0.0, description=_DIRECTION)
    phase: Number = Field(default=0.0, description="phase at x = y = 0 and t = 0; 0 is a crest [deg]")
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.period

    @property
    def waves_in_sum(self) -> int:
        """Number of linear waves."""
        return 1

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        yield self.height, ("height",), self.period, ("period",)

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield ("direction",), self.direction


class StreamFunctionWaves(Table):
    """Waves of one period and finite height, steady: crests are sharper than troughs, and nothing is stretched."""

    kind: Literal["stream_function"] = Field(
        default="stream_function", description="one period, finite height (stream function of Rienecker and Fenton)"
    )
    height: Positive = Field(description="height H from trough to crest [m]")
    period: Positive = Field(description="period T, where there is no current [s]")
    direction: Number = Field(default=0.0, description=_DIRECTION)
    phase: Number = Field(default=0.0, description="phase at x = y = 0 and t = 0; 0 is a crest [deg]")
    order: Whole = Field(default=20, ge=5, le=40, description="number of harmonics of its Fourier series [-]")
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

    def steady(self, depth: float, gravity: float) -> SteadyWave:
        """The wave in water of a depth (m; infinity: deep).  Only after validation: there is one then."""
        from hybrid.scene.stream_function import steady_wave

        found = steady_wave(self.height, depth, gravity, self.order, self.period)
        if found is None:
            expected = "a wave that does not break"
            refuse([Finding(("environment", "fluid", "waves", "height"), expected, "lower waves, or a longer period")])
        assert found is not None
        return found

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.period

    @property
    def waves_in_sum(self) -> int:
        """Number of harmonics."""
        return self.order

    def sizes(self) -> Iterator[Size]:
        """Nothing: whether it breaks is found with the wave."""
        yield from ()

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield ("direction",), self.direction


PeriodicWaves = RegularWaves | StreamFunctionWaves


class Spectrum(Table):
    """What irregular seas have in common: a direction, spreading, a seed and a number of waves."""

    if TYPE_CHECKING:
        direction: float
        spreading: Spreading | None
        seed: int
        components: int

    @property
    def waves_in_sum(self) -> int:
        """Number of linear waves."""
        return self.components

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield ("direction",), self.direction
        if self.spreading is not None:
            yield ("spreading",), self.direction + 90.0


class JonswapWaves(Spectrum):
    """Irregular waves: a sum of linear waves with random phases and a JONSWAP spectrum."""

    kind: Literal["jonswap"] = Field(default="jonswap", description="a spectrum of periods: irregular waves")
    significant_height: Positive = Field(
        validation_alias=AliasChoices("significant_height", "height"), description=_HEIGHT
    )
    peak_period: Positive = Field(validation_alias=AliasChoices("peak_period", "period"), description=_PEAK)
    gamma: Number = Field(default=3.3, ge=1, description="peak enhancement; 1 is a Pierson-Moskowitz sea [-]")
    direction: Number = Field(default=0.0, description=_DIRECTION)
    spreading: Spreading | None = Field(default=None, description=_SPREADING)
    seed: Whole = Field(default=1, ge=0, description=_SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=_COUNT)
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.peak_period

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        yield self.significant_height, ("significant_height",), self.peak_period, ("peak_period",)


class PiersonMoskowitzWaves(Spectrum):
    """Irregular waves of a fully grown sea: the spectrum of Pierson and Moskowitz, by its height and one period (ISSC,
    Bretschneider)."""

    kind: Literal["pierson_moskowitz"] = Field(
        default="pierson_moskowitz", description="the spectrum of a fully grown sea (ISSC, Bretschneider)"
    )
    significant_height: Positive = Field(description=_HEIGHT)
    peak_period: Positive | None = Field(default=None, description="period Tp at the peak of the spectrum, or [s]")
    zero_crossing_period: Positive | None = Field(
        default=None, description="period Tz between zero crossings, 0.7104 of that at the peak [s]"
    )
    direction: Number = Field(default=0.0, description=_DIRECTION)
    spreading: Spreading | None = Field(default=None, description=_SPREADING)
    seed: Whole = Field(default=1, ge=0, description=_SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=_COUNT)
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

    usual = ("peak_period",)

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.peak_period if self.peak_period is not None else (self.zero_crossing_period or 0.0) / CROSSINGS

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        key = "peak_period" if self.peak_period is not None else "zero_crossing_period"
        yield self.significant_height, ("significant_height",), self.main_period, (key,)

    @model_validator(mode="after")
    def _one_period(self) -> PiersonMoskowitzWaves:
        if self.peak_period is None and self.zero_crossing_period is None:
            refuse([Finding(("peak_period",), "a number > 0, in s", "add peak_period, or zero_crossing_period")])
        if self.peak_period is not None and self.zero_crossing_period is not None:
            expected = "nothing, because peak_period says it"
            refuse([Finding(("zero_crossing_period",), expected, "leave one of them out")])
        return self


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
    direction: Number = Field(default=0.0, description=_DIRECTION)
    spreading: Spreading | None = Field(default=None, description=_SPREADING)
    seed: Whole = Field(default=1, ge=0, description=_SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=_COUNT)
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

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


OneSpectrum = Annotated[
    Annotated[JonswapWaves, Tag("<jonswap>")]
    | Annotated[PiersonMoskowitzWaves, Tag("<pierson_moskowitz>")]
    | Annotated[OchiHubbleWaves, Tag("<ochi_hubble>")],
    Discriminator(by_kind),
    Kinds(("jonswap", "pierson_moskowitz", "ochi_hubble"), usual=("jonswap",)),
]


class SumOfWaves(Table):
    """Swell and wind sea: irregular seas, each with its spectrum and direction, on the same water."""

    kind: Literal["sum"] = Field(default="sum", description="swell and wind sea: several spectra together")
    spectra: tuple[OneSpectrum, ...] = Field(
        min_length=2, max_length=8, description="the seas; phases of all are independent, whatever their seeds"
    )
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

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

    @model_validator(mode="after")
    def _one_sea(self) -> SumOfWaves:
        for i, x in enumerate(self.spectra):
            for key in ("depth", "ramp"):
                if getattr(x, key) is not None:
                    expected = "nothing, because all seas of a sum have the same"
                    refuse([Finding(("spectra", i, key), expected, f"give it beside spectra, as waves.{key}")])
        return self


class _OfFile(Table):
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

    def _refuse_unreadable(self) -> None:
        from hybrid.scene.motion_file import RecordRefused, check_file

        try:
            check_file(self.file)
            assert self.recorded
        except RecordRefused as refused:
            refuse([refused.finding])


class GivenWaves(_OfFile):
    """Linear waves given one by one: the sum of amplitude x cos(k x' - frequency t + phase), x' along its direction."""

    kind: Literal["components"] = Field(default="components", description="waves given one by one, in a file")
    file: Text = Field(
        min_length=1,
        description="CSV file with columns amplitude,frequency,direction,phase (m, rad/s, deg, deg), a row for every "
        "wave; relative to the scene file",
    )
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

    @property
    def recorded(self) -> Recorded:
        """The waves of the file.  Only after validation: it is readable then."""
        from hybrid.scene.wave_files import given_waves

        status = os.stat(self.file)
        return given_waves(self.file, status.st_mtime_ns, status.st_size)

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield from ((("file",), heading) for heading in sorted({float(x) for x in self.recorded.waves[:, 3]}))

    @model_validator(mode="after")
    def _readable(self) -> GivenWaves:
        self._refuse_unreadable()
        return self


class RecordedWaves(_OfFile):
    """A measured elevation at a place as the sum of its harmonics, all in one direction: there it is as measured."""

    kind: Literal["record"] = Field(default="record", description="a measured elevation of the surface, in a file")
    file: Text = Field(
        min_length=1,
        description="CSV file with columns t,elevation (s, m) at equal steps, from t = 0 or before to the end of the "
        "run; relative to the scene file",
    )
    position: tuple[Number, Number] = Field(default=(0.0, 0.0), description="x and y of where it was measured [m]")
    direction: Number = Field(default=0.0, description=_DIRECTION)
    shortest_period: Positive | None = Field(
        default=None, description="waves of shorter periods are left out, and noted; absent: none are [s]"
    )
    longest_period: Positive | None = Field(
        default=None, description="waves of longer periods are left out, and noted; absent: none are [s]"
    )
    depth: Positive | None = Field(default=None, description=_DEPTH)
    ramp: Positive | None = Field(default=None, description=_RAMP)

    @property
    def recorded(self) -> Recorded:
        """The waves of the file.  Only after validation: it is readable then."""
        from hybrid.scene.wave_files import recorded_waves

        status, band = os.stat(self.file), (self.shortest_period or 0.0, self.longest_period or math.inf)
        return recorded_waves(self.file, band, self.direction, status.st_mtime_ns, status.st_size)

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield ("direction",), self.direction

    @model_validator(mode="after")
    def _readable(self) -> RecordedWaves:
        short, long = self.shortest_period or 0.0, self.longest_period or math.inf
        if long <= short:
            refuse([Finding(("longest_period",), f"more than shortest_period, {short:g} s", "swap them")])
        self._refuse_unreadable()
        return self


Waves = Annotated[
    Annotated[RegularWaves, Tag("<regular>")]
    | Annotated[StreamFunctionWaves, Tag("<stream_function>")]
    | Annotated[JonswapWaves, Tag("<jonswap>")]
    | Annotated[PiersonMoskowitzWaves, Tag("<pierson_moskowitz>")]
    | Annotated[OchiHubbleWaves, Tag("<ochi_hubble>")]
    | Annotated[SumOfWaves, Tag("<sum>")]
    | Annotated[GivenWaves, Tag("<components>")]
    | Annotated[RecordedWaves, Tag("<record>")],
    Discriminator(by_kind),
    Kinds(
        ("regular", "stream_function", "jonswap", "pierson_moskowitz", "ochi_hubble", "sum", "components", "record"),
        usual=("regular",),
    ),
]
