"""How the two ends are held, moved and loaded.

Tangents point along increasing s at *both* ends: at the start into the cable, at the
end out of it.  Directions need not have length one; whoever uses them normalises.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import AliasChoices, Discriminator, Field, Tag, model_validator

from hybrid.scene.attachments import ADDED_MASS, DRAG_AREA, HEIGHT, SHAPE, Shape, sphere_diameter
from hybrid.scene.base import (
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
    table_or_list,
)
from hybrid.scene.end_loads import GivenLoad, Load, Loading, Triple
from hybrid.scene.payout import Payout

SHIFTS = ("surge", "sway", "heave")
TURNS = ("roll", "pitch", "yaw")

_TANGENT = "direction of increasing s at this end, inertial frame; any length [-]"
_NORMAL = "direction of the material axis a1 at this end; only its part across the tangent counts; any length [-]"
_TURNS = (
    "turns about the tangent by which this end is twisted against the other, right-handed, counted from `normal`, or "
    "from where the shape carries the frame; may be a fraction; both ends must hold the twist [-]"
)


def smooth_step(x: float) -> tuple[float, float]:
    """10 x^3 - 15 x^4 + 6 x^5 from 0 to 1 and its derivative, C2 at both ends; constant before and after."""
    x = min(max(x, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) ** 2


def way_of_smooth_step(x: float) -> float:
    """The integral of `smooth_step` from 0 to x: 5/2 x^4 - 3 x^5 + x^6, beyond 1 growing like x - 1/2."""
    inside = min(max(x, 0.0), 1.0)
    return inside**4 * (2.5 + inside * (inside - 3.0)) + max(x - 1.0, 0.0)


def _sum(parts: list[tuple[Triple, float]]) -> Triple:
    """The sum of vectors times factors."""
    return (sum(f * v[0] for v, f in parts), sum(f * v[1] for v, f in parts), sum(f * v[2] for v, f in parts))


class Harmonic(Table):
    """amplitude x sin(2 pi t / period + phase)."""

    amplitude: Number = Field(description="amplitude; degrees for roll, pitch and yaw [m or deg]")
    period: Positive = Field(description="period, one over the frequency, 2 pi over omega [s]")
    phase: Number = Field(default=0.0, description="phase [deg]")


Harmonics = Annotated[
    Annotated[Harmonic, Tag("<table>")] | Annotated[tuple[Harmonic, ...], Field(min_length=1), Tag("<list>")],
    Discriminator(table_or_list),
]


class Travel(Table):
    """A smooth move to another place: by x (10 x^3 - 15 x^4 + 6 x^5), x = (t - begin) / over."""

    by: Vector = Field(description="the way from the old place to the new one, inertial frame [m]")
    over: Positive = Field(description="time that it takes [s]")
    begin: NonNegative = Field(default=0.0, description="time at which it begins [s]")


class Vessel(Table):
    """A vessel that carries the end: it moves with the waves of the scene, to first order; it grows with their ramp."""

    rao: Text = Field(
        min_length=1,
        description="CSV file, relative to the scene file: a row for every frequency [rad/s] and heading [deg], the "
        "direction of the waves against that of the vessel (0: from astern, 180: from ahead); columns surge, sway, "
        "heave (m/m), roll, pitch, yaw (deg/m), and surge_phase .. (deg behind the crest at the origin)",
    )
    origin: Vector = Field(description="point of the vessel that the RAO is for, at rest, inertial frame [m]")
    heading: Number = Field(
        default=0.0, description="direction of its bow, counter-clockwise from the inertial x axis [deg]"
    )
    fairlead: Vector | None = Field(
        default=None,
        description="the end in axes of the vessel from its origin (to the bow, to port, up); absent: it follows from "
        "the position of the end, with which it must agree [m]",
    )

    def place(self, fairlead: Triple) -> Triple:
        """Where a point given in axes of the vessel is, at rest, inertial frame [m]."""
        c, s = math.cos(math.radians(self.heading)), math.sin(math.radians(self.heading))
        x, y, z = fairlead
        return self.origin[0] + c * x - s * y, self.origin[1] + s * x + c * y, self.origin[2] + z


class Motion(Table):
    """Prescribed motion of an end, relative to where it is held; it must start from rest, or have a `ramp`.

    What is given adds up; only a file stands alone.
    """

    surge: Harmonics | None = Field(default=None, description="harmonic motion along x, or a list whose sum is meant")
    sway: Harmonics | None = Field(default=None, description="harmonic motion along y, or a list")
    heave: Harmonics | None = Field(default=None, description="harmonic motion along z, or a list")
    roll: Harmonics | None = Field(default=None, description="harmonic rotation about the inertial x axis, or a list")
    pitch: Harmonics | None = Field(default=None, description="harmonic rotation about the inertial y axis, or a list")
    yaw: Harmonics | None = Field(default=None, description="harmonic rotation about the inertial z axis, or a list")
    velocity: Vector | None = Field(
        default=None,
        description="steady travel (tow) at this velocity or speed, reached over `ramp`; inertial frame [m/s]",
    )
    travel: Travel | None = Field(default=None, description="a smooth move to another place")
    follow: Literal["waves"] | None = Field(
        default=None, description="waves: rises and falls with the surface where the end is; needs waves with a ramp"
    )
    vessel: Vessel | None = Field(default=None, description="a vessel that carries the end in the waves of the scene")
    ramp: Positive | None = Field(
        default=None, description="time over which harmonic motion, velocity and a file grow from zero, smoothly [s]"
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns t,x,y,z and/or t,rx,ry,rz (s, m, degrees) in any order; relative to the "
        "scene file; it starts at rest where the end is, or `ramp` blends it in",
    )

    def harmonics(self) -> dict[str, tuple[Harmonic, ...]]:
        """The harmonic motions that are given, by name; one that is no list is a tuple of one."""
        named = {name: getattr(self, name) for name in (*SHIFTS, *TURNS)}
        return {
            name: (given,) if isinstance(given, Harmonic) else given
            for name, given in named.items()
            if given is not None
        }

    def shifts(self) -> list[str]:
        """The keys given that move the end; those of TURNS turn it, and a file may do both."""
        named = (*SHIFTS, "velocity", "travel", "follow", "vessel")
        return [name for name in named if getattr(self, name) is not None]

    def carried(self, t: float) -> tuple[Triple, Triple]:
        """How far velocity and travel have carried the end at t [s], and how fast they do: m and m/s, inertial."""
        ways: list[tuple[Triple, float, float]] = []  # along which vector, how much of it, how fast
        if self.velocity is not None and self.ramp is not None:
            x = t / self.ramp
            ways.append((self.velocity, self.ramp * way_of_smooth_step(x), smooth_step(x)[0]))
        if self.travel is not None:
            grown, rate = smooth_step((t - self.travel.begin) / self.travel.over)
            ways.append((self.travel.by, grown, rate / self.travel.over))
        return _sum([(v, far) for v, far, _ in ways]), _sum([(v, fast) for v, _, fast in ways])

    @model_validator(mode="after")
    def _one_source(self) -> Motion:
        given = [*self.shifts(), *(name for name in TURNS if getattr(self, name) is not None)]
        ramped = [name for name in given if name not in ("travel", "follow", "vessel")]
        if self.vessel is not None:
            fix = "leave it out, or write all of the motion into a file; travel may move the vessel"
            beside = [name for name in given if name not in ("vessel", "travel")]
            refuse(Finding((name,), "nothing, because vessel already gives the motion", fix) for name in beside)
        if self.file is not None:
            fix = "put the whole motion into the file, or leave file out"
            refuse(Finding((name,), "nothing, because file already gives the motion", fix) for name in given)
        elif not given:
            expected = f"at least one of {', '.join((*SHIFTS, *TURNS))}, velocity, travel, follow, vessel, or file"
            refuse([Finding((), expected, "say how the end moves, or leave motion out")])
        elif self.ramp is not None and not ramped:
            expected = "nothing, because a ramp is for velocity and for harmonic motion"
            fix = "leave it out: travel has `over`, and what follows the waves grows with waves.ramp"
            refuse([Finding(("ramp",), expected, fix)])
        if self.velocity is not None and any(self.velocity) and self.ramp is None:
            expected = "a number > 0, in s, because the cable starts at rest and velocity has to grow from zero"
            refuse([Finding(("ramp",), expected, "add `ramp: ...` (s), such as 10")])
        return self


_LOADS: dict[str, Literal["force", "moment"]] = {"force": "force", "moment": "moment", "thrust": "force"}


class Release(Table):
    """When a held end is let go: at a time, or after the first step with so large a force; whichever comes first."""

    time: Positive | None = Field(default=None, description="time at which it is let go [s]")
    tension: Positive | None = Field(
        default=None, description="force between the end and what holds it at which it is let go [N]"
    )

    @model_validator(mode="after")
    def _says_when(self) -> Release:
        if self.time is None and self.tension is None:
            fix = "time: 12 (s) or tension: 50e3 (N), or leave release_at out"
            refuse([Finding((), "time or tension", fix)])
        return self


_RELEASE = "when the end is let go and becomes free, in mid-motion; absent: never"


class EndTable(Table):
    """What the program asks of an end, whatever its kind: by the keys of the kind, or by what it overrides."""

    def _own(self, key: str) -> Any:
        """The value of a key, None where the kind has none."""
        return getattr(self, key) if key in type(self).model_fields else None

    @property
    def held_position(self) -> Triple | None:
        """Position that is held, inertial frame [m]."""
        position: Triple | None = self._own("position")
        return position

    @property
    def first_position(self) -> Triple | None:
        """Where the search of the equilibrium puts the end first [m]."""
        return self.held_position or self._own("initial_guess")

    @property
    def held_tangent(self) -> Triple | None:
        """Direction that is held, of any length."""
        tangent: Triple | None = self._own("tangent")
        return tangent

    @property
    def held_normal(self) -> Triple | None:
        """Direction of the material axis a1 that the scene gives, of any length."""
        normal: Triple | None = self._own("normal")
        return normal

    @property
    def held_turns(self) -> float:
        """Turns about its tangent by which the scene twists the end."""
        turns: float | None = self._own("turns")
        return turns or 0.0

    @property
    def holds_twist(self) -> bool:
        """Whether the end resists that the cable turns about its tangent."""
        return False

    @property
    def fixes_frame(self) -> bool:
        """Whether the scene gives the orientation of the material frame at the end, and the end holds it there."""
        return self.holds_twist and self.held_normal is not None

    @property
    def prescribed_motion(self) -> Motion | None:
        """How what is held moves."""
        motion: Motion | None = self._own("motion")
        return motion

    @property
    def release(self) -> Release | None:
        """When what is held is let go."""
        release: Release | None = self._own("release_at")
        return release

    @property
    def loads(self) -> tuple[GivenLoad, ...]:
        """Forces and moments given at the end."""
        found = []
        for key, what in _LOADS.items():
            load = self._own(key)
            if isinstance(load, Load):
                given = next(name for name in ("value", "history", "file") if getattr(load, name) is not None)
                found.append(GivenLoad(what, (key, given), load))
            elif load is not None:
                found.append(GivenLoad(what, (key,), Load(value=load)))
        return tuple(found)

    @property
    def acts_by_moment(self) -> bool:
        """Whether a tangent is held or a moment given: a cable that ends in a catenary transmits neither."""
        return self.held_tangent is not None or any(load.what == "moment" for load in self.loads)

    @model_validator(mode="after")
    def _normal_is_across(self) -> Self:
        tangent, normal = self.held_tangent, self.held_normal
        if tangent is not None and normal is not None and parallel(tangent, normal):
            expected = "a direction across the tangent; this one is parallel to it"
            refuse([Finding(("normal",), expected, "any direction not along the tangent will do")])
        return self


class Pinned(EndTable):
    """Held at a point, free to turn."""

    kind: Literal["pinned"] = Field(
        default="pinned", description="position fixed, free to turn: ball joint, hinge, anchor"
    )
    position: Vector = Field(description="position of the end, inertial frame [m]")
    motion: Motion | None = Field(default=None, description="how the point moves; absent: not at all")
    payout: Payout | None = Field(
        default=None,
        description="line is paid out here, or taken in, by a winch; at `end` alone; absent: its length stays",
    )
    release_at: Release | None = Field(default=None, description=_RELEASE)

    @model_validator(mode="after")
    def _turning_is_free(self) -> Pinned:
        if self.motion is not None:
            turns = [name for name in self.motion.harmonics() if name in TURNS]
            expected = "no rotation, because a pinned end turns freely"
            refuse(Finding(("motion", name), expected, "kind: clamped can be turned") for name in turns)
        return self


class Clamped(EndTable):
    """Held at a point and in a direction.  The tangent points along increasing s at either end."""

    kind: Literal["clamped"] = Field(default="clamped", description="position and direction fixed: built in")
    position: Vector = Field(description="position of the end, inertial frame [m]")
    tangent: Direction = Field(description=_TANGENT)
    normal: Direction | None = Field(default=None, description=_NORMAL)
    turns: Number = Field(default=0.0, description=_TURNS)
    swivel: Truth = Field(default=False, description="true: free to spin about the tangent, so no torque")
    motion: Motion | None = Field(default=None, description="how the clamp moves and turns; absent: not at all")
    release_at: Release | None = Field(default=None, description=_RELEASE)

    @property
    def holds_twist(self) -> bool:
        return not self.swivel


class Guided(EndTable):
    """Held in a direction, free to move.  The tangent points along increasing s at either end."""

    kind: Literal["guided"] = Field(default="guided", description="direction held, position free")
    tangent: Direction = Field(description=_TANGENT)
    normal: Direction | None = Field(default=None, description=_NORMAL)
    turns: Number = Field(default=0.0, description=_TURNS)
    force: Loading | None = Field(default=None, description="force on the end, inertial frame [N]")
    motion: Motion | None = Field(
        default=None, description="how the direction turns; a guided end takes no translation"
    )

    @property
    def holds_twist(self) -> bool:
        return self.normal is not None

    @model_validator(mode="after")
    def _only_turns(self) -> Guided:
        if self.motion is not None:
            expected = "rotation only, because the position of a guided end is free"
            fix = "use roll, pitch or yaw here; kind: clamped can be moved"
            refuse(Finding(("motion", name), expected, fix) for name in self.motion.shifts())
        return self


class Free(EndTable):
    """Not held."""

    kind: Literal["free"] = Field(default="free", description="neither position nor direction held")
    force: Loading | None = Field(default=None, description="force on the end, inertial frame [N]")
    moment: Loading | None = Field(default=None, description="moment on the end, inertial frame [N m]")


class Body(EndTable):
    """Carries a body, such as a vehicle or a buoy, that moves with the cable and is not held."""

    kind: Literal["body"] = Field(default="body", description="free, with a body on it: vehicle (ROV), vessel, buoy")
    initial_guess: Vector | None = Field(
        default=None,
        validation_alias=AliasChoices("initial_guess", "near"),
        description="where the search of the equilibrium puts the body first, inertial frame; absent: chosen [m]",
    )
    mass: NonNegative = Field(
        description="mass in air, its weight over gravity; 0 only of what has a volume or a drag area [kg]"
    )
    volume: NonNegative = Field(default=0.0, description="displaced volume, for its buoyancy [m^3]")
    height: Positive | None = Field(default=None, description=HEIGHT)
    shape: Shape = Field(default="sphere", description=SHAPE)
    drag_area: NonNegative = Field(default=0.0, description=DRAG_AREA)
    added_mass: NonNegative = Field(default=0.0, description=ADDED_MASS)
    thrust: Loading | None = Field(default=None, description="force of its propellers, inertial frame [N]")

    @model_validator(mode="after")
    def _is_something(self) -> Body:
        if not (self.mass or self.volume or self.drag_area):
            refuse(
                [Finding(("mass",), "a number > 0, in kg", "give its mass, or `kind: free` for an end without a body")]
            )
        return self

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume [m^3], whatever the fluid."""
        return self.volume

    def height_in(self, density: float, gravity: float) -> float:
        """Vertical extent [m]."""
        return self.height if self.height is not None else sphere_diameter(self.volume)


End = Annotated[
    Annotated[Pinned, Tag("<pinned>")]
    | Annotated[Clamped, Tag("<clamped>")]
    | Annotated[Guided, Tag("<guided>")]
    | Annotated[Free, Tag("<free>")]
    | Annotated[Body, Tag("<body>")],
    Discriminator(by_kind),
    Kinds(("pinned", "clamped", "guided", "free", "body"), usual=("pinned",)),
]


class Ends(Table):
    """The two ends."""

    start: End = Field(description="the end at s = 0")
    end: End = Field(description="the end at s = length")

    @property
    def both(self) -> tuple[End, End]:
        """Start and end."""
        return self.start, self.end

    def named(self) -> dict[str, End]:
        """The ends by name (`start`, `end`)."""
        return {"start": self.start, "end": self.end}

    def held(self) -> dict[str, Triple]:
        """Positions [m] of the ends that have one, by name (`start`, `end`)."""
        return {name: end.held_position for name, end in self.named().items() if end.held_position is not None}

    def initial_guesses(self) -> dict[str, Triple]:
        """First positions [m] of the bodies that have one, by name (`start`, `end`)."""
        return {name: end.initial_guess for name, end in self.bodies().items() if end.initial_guess is not None}

    @property
    def turns(self) -> float:
        """Turns by which the end is twisted against the start, right-handed about the tangent."""
        return self.end.held_turns - self.start.held_turns

    def bodies(self) -> dict[str, Body]:
        """The bodies at the ends, by name (`start`, `end`)."""
        return {name: end for name, end in self.named().items() if isinstance(end, Body)}

    def files(self) -> list[str]:
        """Files that motions and loads of the ends are read from."""
        motions = [end.prescribed_motion.file for end in self.both if end.prescribed_motion is not None]
        motions += [x.prescribed_motion.vessel.rao for x in self.both
                    if x.prescribed_motion is not None and x.prescribed_motion.vessel is not None]  # fmt: skip
        loads = [given.load.file for end in self.both for given in end.loads]
        winches = [end.payout.file for end in self.both if isinstance(end, Pinned) and end.payout is not None]
        return sorted({path for path in (*motions, *loads, *winches) if path is not None})
