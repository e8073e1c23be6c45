"""A line that is paid out from a reel or taken in, at one of its ends: how its length changes with time."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import Field, model_validator

from hybrid.scene.base import Before, Finding, NonNegative, Number, Positive, Table, Text, Words, numbers, refuse
from hybrid.scene.cable import Section

RateRow = Annotated[tuple[NonNegative, Number], Before(numbers(2)), Words("two numbers [t, rate]")]
LengthRow = Annotated[tuple[NonNegative, Positive], Before(numbers(2)), Words("two numbers [t, length]")]

# What says how long the line is.
SOURCES = ("rate", "rates", "lengths", "file", "winch")


class Winch(Table):
    """A winch that holds a tension: inertia times the rate of its rate is the pull of the line less that tension.

    Its brake holds the length up to `begin`; from then on the tension goes, over `ramp`, from the pull of that moment
    to `tension`.
    """

    tension: Positive = Field(description="tension that is held at the fairlead [N]")
    inertia: Positive = Field(
        description="inertia of the drum and its drive as a mass at the line: J / r^2, with the square of the gear "
        "ratio for the motor [kg]"
    )
    damping: NonNegative = Field(default=0.0, description="force that the drive loses, per rate [N s/m]")
    max_rate: Positive | None = Field(
        default=None,
        description="rate beyond which a brake acts: 1 % above it with half the tension, 2 % above it with one and a "
        "half times the tension [m/s]; absent: none",
    )
    begin: NonNegative = Field(default=0.0, description="time up to which a brake holds the length [s]")
    ramp: Positive = Field(
        default=5.0, description="time over which the tension goes to what is held, from the pull at `begin` [s]"
    )


class Payout(Table):
    """Line is paid out at this end, or taken in: the length of `cable` is what is out at t = 0.

    The rate is given, or rates or lengths over time, by rows or a file, or follows from a winch that holds a tension;
    with none of them it is set from Python.
    """

    rate: Number | None = Field(
        default=None, description="rate (speed, velocity) at which line is paid out; negative: it is taken in [m/s]"
    )
    begin: NonNegative = Field(default=0.0, description="time at which the rate begins to grow (start) [s]")
    ramp: Positive | None = Field(
        default=None, description="time over which the rate grows from zero, and ends after `until`, smoothly [s]"
    )
    until: Positive | None = Field(
        default=None, description="time at which the rate begins to end (stop, end); absent: never [s]"
    )
    rates: tuple[RateRow, ...] | None = Field(
        default=None,
        min_length=2,
        description="rows [t, rate], from t = 0 with rate 0 on; a cubic spline between them, constant beyond the last "
        "[s, m/s]",
    )
    lengths: tuple[LengthRow, ...] | None = Field(
        default=None,
        min_length=3,
        description="rows [t, length], from t = 0 with the length of the cable on; a spline of fifth degree that "
        "begins and ends at rest [s, m]",
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns t,rate or t,length, as of `rates` and `lengths`; relative to the scene file",
    )
    winch: Winch | None = Field(default=None, description="winch that holds a tension; it needs `longest`")
    reel: tuple[Section, ...] | None = Field(
        default=None,
        min_length=1,
        description="sections on the reel at t = 0, in the order in which they leave it; absent: as much of the "
        "section of the cable at this end as is needed",
    )
    longest: Positive | None = Field(
        default=None,
        description="longest length that may be out, up to which the result has output points; absent: the longest "
        "that is prescribed [m]",
    )

    @model_validator(mode="after")
    def _one_source(self) -> Payout:
        given = [name for name in SOURCES if getattr(self, name) is not None]
        fix = f"keep {given[0]}, or leave it out" if given else ""
        refuse(Finding((name,), f"nothing, because {given[0]} already gives the length", fix) for name in given[1:])
        if self.rate is not None:
            if self.ramp is None and self.rate != 0.0:
                expected = "a number > 0, in s, because a rate that jumps would be an impact"
                refuse([Finding(("ramp",), expected, "add `ramp: ...` (s), such as 5")])
            if self.until is not None and self.until < self.begin + (self.ramp or 0.0):
                expected = f"a time not before begin + ramp, {self.begin + (self.ramp or 0.0):g} s"
                refuse([Finding(("until",), expected, "a later time, or a shorter ramp")])
        else:
            words = [("ramp", self.ramp), ("until", self.until), ("begin", self.begin or None)]
            fix = "give rate, or leave it out"
            refuse(Finding((name,), "nothing, because it is for rate", fix) for name, x in words if x is not None)
        if self.winch is not None and self.longest is None:
            expected = "the longest length that may be out, in m, because the winch pays out as much as it must"
            refuse([Finding(("longest",), expected, "add `longest: ...` (m)")])
        for name in ("rates", "lengths"):
            self._rows_increase(name)
        return self

    @property
    def from_outside(self) -> bool:
        """Whether the length is set from Python."""
        return all(getattr(self, name) is None for name in SOURCES)

    def _rows_increase(self, name: str) -> None:
        rows = getattr(self, name) or ()
        if rows and rows[0][0] != 0.0:
            refuse([Finding((name, 0, 0), "0, because the rows begin with the motion", "a first row at t = 0 s")])
        for k, (one, other) in enumerate(pairwise(rows), start=1):
            if not other[0] > one[0]:
                expected = f"a time after that of the row before, {one[0]:g} s"
                refuse([Finding((name, k, 0), expected, "sort the rows")])
        if name == "rates" and rows and rows[0][1] != 0.0:
            expected = "0, because the line is at rest at t = 0"
            refuse([Finding((name, 0, 1), expected, "a first row [0, 0]")])
