"""Waves on the sea of a scene: regular, irregular by a spectrum, given wave by wave, or measured.

Directions in degrees from x, counter-clockwise seen from above.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.base import Finding, Kinds, Number, Place, Positive, Table, Text, Whole, by_kind, refuse
from hybrid.scene.spectra import (
    COUNT,
    DEPTH,
    DIRECTION,
    RAMP,
    SEED,
    JonswapWaves,
    OchiHubbleWaves,
    PiersonMoskowitzWaves,
    Size,
    SumOfWaves,
    TorsethaugenWaves,
)

if TYPE_CHECKING:
    from hybrid.scene.stream_function import SteadyWave
    from hybrid.scene.wave_files import Recorded


class RegularWaves(Table):
    """Linear (Airy) waves of one period: elevation height / 2 x cos(k x - w t + phase) along their direction."""

    kind: Literal["regular"] = Field(default="regular", description="one period, linear (Airy)")
    height: Positive = Field(description="height H from trough to crest [m]")
    period: Positive = Field(description="period T [s]")
    direction: Number = Field(default=0.0, description=DIRECTION)
    phase: Number = Field(default=0.0, description="phase at x = y = 0 and t = 0; 0 is a crest [deg]")
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

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
    direction: Number = Field(default=0.0, description=DIRECTION)
    phase: Number = Field(default=0.0, description="phase at x = y = 0 and t = 0; 0 is a crest [deg]")
    order: Whole = Field(default=20, ge=5, le=40, description="number of harmonics of its Fourier series [-]")
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

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
        from hybrid.scene.motion_file import readable

        with readable(self.file):
            assert self.recorded


class GivenWaves(_OfFile):
    """Linear waves given one by one: the sum of amplitude x cos(k x' - frequency t + phase), x' along its direction."""

    kind: Literal["components"] = Field(default="components", description="waves given one by one, in a file")
    file: Text = Field(
        min_length=1,
        description="CSV file with columns amplitude,frequency,direction,phase (m, rad/s, deg, deg), a row for every "
        "wave; relative to the scene file",
    )
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

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
    direction: Number = Field(default=0.0, description=DIRECTION)
    shortest_period: Positive | None = Field(
        default=None, description="waves of shorter periods are left out, and noted; absent: none are [s]"
    )
    longest_period: Positive | None = Field(
        default=None, description="waves of longer periods are left out, and noted; absent: none are [s]"
    )
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

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


class MeasuredWaves(_OfFile):
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
    seed: Whole = Field(default=1, ge=0, description=SEED)
    components: Whole = Field(default=100, ge=1, le=1000, description=COUNT)
    depth: Positive | None = Field(default=None, description=DEPTH)
    ramp: Positive | None = Field(default=None, description=RAMP)

    @property
    def recorded(self) -> Recorded:
        """The waves of the file.  Only after validation: it is readable then."""
        from hybrid.scene.wave_files import spectrum_waves

        status, of = os.stat(self.file), (self.record, self.north, self.components, self.seed)
        return spectrum_waves(self.file, *of, status.st_mtime_ns, status.st_size)

    def headings(self) -> Iterator[tuple[Place, float]]:
        """Directions [deg] that tell in which planes the water moves, with their keys."""
        yield from ((("file",), heading) for heading in sorted({float(x) for x in self.recorded.waves[:, 3]}))

    @model_validator(mode="after")
    def _readable(self) -> MeasuredWaves:
        self._refuse_unreadable()
        return self


Waves = Annotated[
    Annotated[RegularWaves, Tag("<regular>")]
    | Annotated[StreamFunctionWaves, Tag("<stream_function>")]
    | Annotated[JonswapWaves, Tag("<jonswap>")]
    | Annotated[PiersonMoskowitzWaves, Tag("<pierson_moskowitz>")]
    | Annotated[OchiHubbleWaves, Tag("<ochi_hubble>")]
    | Annotated[TorsethaugenWaves, Tag("<torsethaugen>")]
    | Annotated[SumOfWaves, Tag("<sum>")]
    | Annotated[GivenWaves, Tag("<components>")]
    | Annotated[RecordedWaves, Tag("<record>")]
    | Annotated[MeasuredWaves, Tag("<spectrum>")],
    Discriminator(by_kind),
    Kinds(
        (
            "regular",
            "stream_function",
            "jonswap",
            "pierson_moskowitz",
            "ochi_hubble",
            "torsethaugen",
            "sum",
            "components",
            "record",
            "spectrum",
        ),
        usual=("regular",),
    ),
]
