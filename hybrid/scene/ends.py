"""How the two ends are held, moved and loaded.

Tangents point along increasing s at *both* ends: at the start into the cable, at the
end out of it.  Directions need not have length one; whoever uses them normalises.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.table import (
    Direction,
    Finding,
    Kinds,
    NonNegative,
    Number,
    Positive,
    Table,
    Text,
    Truth,
    Vector,
    by_kind,
    parallel,
    refuse,
    value_or_table,
)

SHIFTS = ("surge", "sway", "heave")
TURNS = ("roll", "pitch", "yaw")

_TANGENT = "direction of increasing s at this end, inertial frame; any length [-]"
_NORMAL = "direction of the material axis a1 at this end; only its part across the tangent counts; any length [-]"


class Harmonic(Table):
    """amplitude x sin(2 pi t / period + phase)."""

    amplitude: Number = Field(description="amplitude; degrees for roll, pitch and yaw [m or deg]")
    period: Positive = Field(description="period [s]")
    phase: Number = Field(default=0.0, description="phase [deg]")


class Motion(Table):
    """Prescribed motion of an end, relative to where it is held; it must start from rest."""

    surge: Harmonic | None = Field(default=None, description="harmonic motion along x")
    sway: Harmonic | None = Field(default=None, description="harmonic motion along y")
    heave: Harmonic | None = Field(default=None, description="harmonic motion along z")
    roll: Harmonic | None = Field(default=None, description="harmonic rotation about the inertial x axis")
    pitch: Harmonic | None = Field(default=None, description="harmonic rotation about the inertial y axis")
    yaw: Harmonic | None = Field(default=None, description="harmonic rotation about the inertial z axis")
    ramp: Positive | None = Field(
        default=None, description="time over which harmonic motion grows from zero, smoothly [s]"
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns t,x,y,z and/or t,rx,ry,rz (s, m, degrees); relative to the scene file",
    )

    def harmonics(self) -> dict[str, Harmonic]:
        """The harmonic motions that are given, by name."""
        named = {name: getattr(self, name) for name in (*SHIFTS, *TURNS)}
        return {name: harmonic for name, harmonic in named.items() if harmonic is not None}

    @model_validator(mode="after")
    def _one_source(self) -> Motion:
        given = list(self.harmonics())
        if self.file is not None:
            fix = "put the whole motion into the file, or leave file out"
            refuse(Finding((name,), "nothing, because file already gives the motion", fix) for name in given)
            if self.ramp is not None:
                fix = "leave ramp out and let the motion in the file start from rest"
                refuse([Finding(("ramp",), "nothing, because a file is followed as it is", fix)])
        elif not given:
            expected = f"at least one of {', '.join((*SHIFTS, *TURNS))}, or file"
            refuse([Finding((), expected, "say how the end moves, or leave motion out")])
        return self


class Load(Table):
    """A force or moment at an end, inertial frame, until a time or for good."""

    value: Vector = Field(description="the force or the moment, inertial frame [N or N m]")
    until: Positive | None = Field(default=None, description="time at which it is let go; absent: never [s]")
    ramp: NonNegative | None = Field(
        default=None,
        description="time over which it grows from nothing; absent: at once, or with a tangent that is turned in [s]",
    )


Loading = Annotated[
    Annotated[Vector, Tag("<value>")] | Annotated[Load, Tag("<table>")],
    Discriminator(value_or_table),
]


def _normal_is_across(tangent: tuple[float, float, float], normal: tuple[float, float, float] | None) -> None:
    if normal is not None and parallel(tangent, normal):
        expected = "a direction across the tangent; this one is parallel to it"
        refuse([Finding(("normal",), expected, "any direction not along the tangent will do")])


class Pinned(Table):
    """Held at a point, free to turn."""

    kind: Literal["pinned"] = Field(default="pinned", description="a ball joint")
    position: Vector = Field(description="position of the end, inertial frame [m]")
    motion: Motion | None = Field(default=None, description="how the point moves; absent: not at all")

    @model_validator(mode="after")
    def _turning_is_free(self) -> Pinned:
        if self.motion is not None:
            turns = [name for name in self.motion.harmonics() if name in TURNS]
            expected = "no rotation, because a pinned end turns freely"
            refuse(Finding(("motion", name), expected, "kind: clamped can be turned") for name in turns)
        return self


class Clamped(Table):
    """Held at a point and in a direction.  The tangent points along increasing s at either end."""

    kind: Literal["clamped"] = Field(default="clamped", description="position and direction held")
    position: Vector = Field(description="position of the end, inertial frame [m]")
    tangent: Direction = Field(description=_TANGENT)
    normal: Direction | None = Field(default=None, description=_NORMAL)
    swivel: Truth = Field(default=False, description="true: free to spin about the tangent, so no torque")
    motion: Motion | None = Field(default=None, description="how the clamp moves and turns; absent: not at all")

    @model_validator(mode="after")
    def _frame(self) -> Clamped:
        _normal_is_across(self.tangent, self.normal)
        return self


class Guided(Table):
    """Held in a direction, free to move.  The tangent points along increasing s at either end."""

    kind: Literal["guided"] = Field(default="guided", description="direction held, position free")
    tangent: Direction = Field(description=_TANGENT)
    normal: Direction | None = Field(default=None, description=_NORMAL)
    force: Loading | None = Field(default=None, description="force on the end, inertial frame [N]")
    motion: Motion | None = Field(
        default=None, description="how the direction turns; a guided end takes no translation"
    )

    @model_validator(mode="after")
    def _frame(self) -> Guided:
        _normal_is_across(self.tangent, self.normal)
        if self.motion is not None:
            shifts = [name for name in self.motion.harmonics() if name in SHIFTS]
            expected = "rotation only, because the position of a guided end is free"
            fix = "use roll, pitch or yaw here; kind: clamped can be moved"
            refuse(Finding(("motion", name), expected, fix) for name in shifts)
        return self


class Free(Table):
    """Not held."""

    kind: Literal["free"] = Field(default="free", description="neither position nor direction held")
    force: Loading | None = Field(default=None, description="force on the end, inertial frame [N]")
    moment: Loading | None = Field(default=None, description="moment on the end, inertial frame [N m]")


End = Annotated[
    Annotated[Pinned, Tag("<pinned>")]
    | Annotated[Clamped, Tag("<clamped>")]
    | Annotated[Guided, Tag("<guided>")]
    | Annotated[Free, Tag("<free>")],
    Discriminator(by_kind),
    Kinds(("pinned", "clamped", "guided", "free"), usual=("pinned",)),
]


class Ends(Table):
    """The two ends."""

    start: End = Field(description="the end at s = 0")
    end: End = Field(description="the end at s = length")

    def held(self) -> dict[str, tuple[float, float, float]]:
        """Positions [m] of the ends that have one, by name (`start`, `end`)."""
        named = {"start": self.start, "end": self.end}
        return {name: end.position for name, end in named.items() if isinstance(end, Pinned | Clamped)}
