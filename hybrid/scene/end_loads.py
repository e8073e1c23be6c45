"""Forces and moments that a scene gives at an end: constant, or a history that is linear between its rows."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.base import (
    Before,
    Finding,
    NonNegative,
    Number,
    Positive,
    Table,
    Text,
    Vector,
    Words,
    numbers,
    refuse,
    value_or_table,
)

Triple = tuple[float, float, float]
Row = tuple[float, float, float, float]  # s, N or N m (3)

LoadRow = Annotated[tuple[Number, Number, Number, Number], Before(numbers(4)), Words("four numbers [t, x, y, z]")]


class Load(Table):
    """A force or moment at an end, inertial frame: one value, or a history; until a time or for good."""

    value: Vector | None = Field(default=None, description="the force or the moment, inertial frame [N or N m]")
    history: tuple[LoadRow, ...] | None = Field(
        default=None,
        min_length=2,
        description="rows [t, x, y, z], linear between them; the first value holds before, the last one after "
        "[s, N or N m]",
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns t,x,y,z as of `history` (s, N or N m); relative to the scene file",
    )
    until: Positive | None = Field(default=None, description="time at which it is let go; absent: never [s]")
    ramp: NonNegative | None = Field(
        default=None,
        description="time over which it grows from nothing; absent: at once, or with a tangent that is turned in [s]",
    )

    @model_validator(mode="after")
    def _one_source(self) -> Load:
        given = [name for name in ("value", "history", "file") if getattr(self, name) is not None]
        if not given:
            fix = "value: [x, y, z] for a constant load, history: [[t, x, y, z], ...] or file for one that changes"
            refuse([Finding((), "value, history or file", fix)])
        fix = f"keep {given[0]}, or leave it out"
        refuse(Finding((name,), f"nothing, because {given[0]} already gives the load", fix) for name in given[1:])
        for k, (one, other) in enumerate(pairwise(self.history or ()), start=1):
            if not other[0] > one[0]:
                expected = f"a time after that of the row before, {one[0]:g} s"
                fix = "sort the rows; for a sudden change give two rows a time step apart"
                refuse([Finding(("history", k, 0), expected, fix)])
        return self


Loading = Annotated[
    Annotated[Vector, Tag("<value>")] | Annotated[Load, Tag("<table>")],
    Discriminator(value_or_table),
]


@dataclass(frozen=True)
class GivenLoad:
    """A force [N] or moment [N m] that a scene gives at an end, inertial frame.

    key: its place below the end; load: as the scene has it.
    """

    what: Literal["force", "moment"]
    key: tuple[str, ...]
    load: Load

    @property
    def until(self) -> float | None:
        """Time at which it stops [s]; None: never."""
        return self.load.until

    @property
    def ramp(self) -> float | None:
        """Time over which it grows [s]; None: at once, or with a tangent that is turned in."""
        return self.load.ramp

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows (t, x, y, z) of a history; none of a constant load, or of a file that cannot be read."""
        if self.load.file is None:
            return self.load.history or ()
        from hybrid.scene.motion_file import RecordRefused, read_history  # numpy, for scenes that need it

        try:
            return read_history(self.load.file)
        except RecordRefused:
            return ()  # motion_checks reports it

    @property
    def values(self) -> tuple[Triple, ...]:
        """All values that are given."""
        return tuple(row[1:] for row in self.rows) or (self.load.value or (0.0, 0.0, 0.0),)

    @property
    def value(self) -> Triple:
        """The load at t = 0, when it has grown."""
        return self.at(0.0)

    def at(self, t: float) -> Triple:
        """The load at t [s], when it has grown and before it is let go."""
        rows = self.rows
        if not rows:
            return self.load.value or (0.0, 0.0, 0.0)
        k = bisect_right(rows, t, key=lambda row: row[0])
        if k in (0, len(rows)):
            return rows[min(k, len(rows) - 1)][1:]
        (t0, *a), (t1, *b) = rows[k - 1], rows[k]
        x, y, z = (p + (q - p) * (t - t0) / (t1 - t0) for p, q in zip(a, b, strict=True))
        return x, y, z
