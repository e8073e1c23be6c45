"""Irregular seas of a scene by their spectra, and several together.

Directions in degrees from x, counter-clockwise seen from above.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AliasChoices, Discriminator, Field, Tag, model_validator

from hybrid.scene.base import Finding, Kinds, Number, Place, Positive, Table, Whole, by_kind, refuse

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
        validation_alias=AliasChoices("significant_height", "height"), description=HEIGHT
    )
    peak_period: Positive = Field(validation_alias=AliasChoices("peak_period", "period"), description=PEAK)
    gamma: Number = Field(default=3.3, ge=1, description="peak enhancement; 1 is a Pierson-Moskowitz sea [-]")
    direction: Number = Field(default=0.0, description=DIRECTION)
    spreading: Spreading | None = Field(default=None, description=SPREADING)
    seed: Whole = Field(default=1, ge=0, description=SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=COUNT)
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.peak_period

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        yield self.significant_height, ("significant_height",), self.peak_period, ("peak_period",)


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
    direction: Number = Field(default=0.0, description=DIRECTION)
    spreading: Spreading | None = Field(default=None, description=SPREADING)
    seed: Whole = Field(default=1, ge=0, description=SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=COUNT)
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

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
    direction: Number = Field(default=0.0, description=DIRECTION)
    spreading: Spreading | None = Field(default=None, description=SPREADING)
    seed: Whole = Field(default=1, ge=0, description=SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=COUNT)
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

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
    direction: Number = Field(default=0.0, description=DIRECTION)
    spreading: Spreading | None = Field(default=None, description=SPREADING)
    seed: Whole = Field(default=1, ge=0, description=SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=COUNT)
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

    @property
    def main_period(self) -> float:
        """The period that carries most energy [s]."""
        return self.peak_period

    def sizes(self) -> Iterator[Size]:
        """Heights and periods."""
        yield self.significant_height, ("significant_height",), self.peak_period, ("peak_period",)


OneSpectrum = Annotated[
    Annotated[JonswapWaves, Tag("<jonswap>")]
    | Annotated[PiersonMoskowitzWaves, Tag("<pierson_moskowitz>")]
    | Annotated[OchiHubbleWaves, Tag("<ochi_hubble>")]
    | Annotated[TorsethaugenWaves, Tag("<torsethaugen>")],
    Discriminator(by_kind),
    Kinds(("jonswap", "pierson_moskowitz", "ochi_hubble", "torsethaugen"), usual=("jonswap",)),
]


class SumOfWaves(Table):
    """Swell and wind sea: irregular seas, each with its spectrum and direction, on the same water."""

    kind: Literal["sum"] = Field(default="sum", description="swell and wind sea: several spectra together")
    spectra: tuple[OneSpectrum, ...] = Field(
        min_length=2, max_length=8, description="the seas; phases of all are independent, whatever their seeds"
    )
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

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
