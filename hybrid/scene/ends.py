"""How the two ends are held, moved and loaded.

Tangents point along increasing s at *both* ends: at the start into the cable, at the
end out of it.  Directions need not have length one; whoever uses them normalises.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import AliasChoices, Discriminator, Field, PrivateAttr, Tag, model_validator

from hybrid.scene.attachments import ADDED_MASS, DRAG_AREA, HEIGHT, SHAPE, Shape, sphere_diameter
from hybrid.scene.base import (
    Direction,
    Finding,
    Kinds,
    NonNegative,
    Number,
    Positive,
    Table,
    Truth,
    Vector,
    by_kind,
    parallel,
    refuse,
)
from hybrid.scene.end_loads import GivenLoad, Load, Loading, Triple
from hybrid.scene.motion_tables import TURNS, Motion
from hybrid.scene.payout import Payout

_TANGENT = "direction of increasing s at this end, inertial frame; any length [-]"
_NORMAL = (
    "direction of the material axis a1 at this end; only its part across the tangent counts; any length; needed at one "
    "end where two bending stiffnesses differ and a clamp holds their axes [-]"
)
TWISTED_BY = (
    "turns about the tangent by which this end is twisted against the other, right-handed, counted from `normal`, or "
    "from where the shape carries the frame; may be a fraction; both ends must hold the twist [-]"
)


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


BEND_STIFFNESS = (
    "of an angular spring between the tangent and the line, as of a bend stiffener or a flexible joint; 0: torque "
    "passes, and no bending moment; absent: rigid [N m/rad]"
)
PAYOUT = "line is paid out here, or taken in, by a winch; at one end alone; absent: its length stays"
_RELEASE = "when the end is let go and becomes free, in mid-motion; absent: never"


class AtPoint(NamedTuple):
    """What an end of a network's line is by the point that it is at, and no key of the end says."""

    moves: bool = False  # by what pulls there, or once something has broken: its position is where it is first
    axes_of_others: bool = False  # it is clamped to a free point, whose axes other lines may give
    twisted: bool = False  # by turns of the other end: nothing there lets it spin
    near: Triple | None = None  # where the search of the equilibrium puts a free end first, m


class EndTable(Table):
    """What the program asks of an end, whatever its kind: by the keys of the kind, or by what it overrides."""

    _at: AtPoint = PrivateAttr(default=AtPoint())

    def at_point(self, at: AtPoint) -> Self:
        """The same at a point of a network."""
        self._at = at
        return self

    def _value_of(self, key: str) -> Any:
        """The value of a key, None where the kind has none."""
        return getattr(self, key) if key in type(self).model_fields else None

    @property
    def held_position(self) -> Triple | None:
        """Position that is held, inertial frame [m]."""
        position: Triple | None = self._value_of("position")
        return position

    @property
    def is_placed(self) -> bool:
        """Whether a position that is held is known, and no first guess of what lines move."""
        return not self._at.moves

    @property
    def first_position(self) -> Triple | None:
        """Where the search of the equilibrium puts the end first [m]."""
        return self.held_position or self._value_of("initial_guess") or self._at.near

    @property
    def held_tangent(self) -> Triple | None:
        """Direction that is held, of any length."""
        tangent: Triple | None = self._value_of("tangent")
        return tangent

    @property
    def held_normal(self) -> Triple | None:
        """Direction of the material axis a1 that the scene gives, of any length."""
        normal: Triple | None = self._value_of("normal")
        return normal

    @property
    def held_turns(self) -> float:
        """Turns about its tangent by which the scene twists the end."""
        turns: float | None = self._value_of("turns")
        return turns or 0.0

    @property
    def spring(self) -> float:
        """Stiffness of the angular spring between a tangent that is held and the cable [N m/rad]; infinite: rigid."""
        return math.inf

    @property
    def holds_twist(self) -> bool:
        """Whether the end resists that the cable turns about its tangent."""
        return False

    @property
    def is_twisted_against(self) -> bool:
        """Whether turns of the other end twist the cable."""
        return self.holds_twist or self._at.twisted

    @property
    def fixes_frame(self) -> bool:
        """Whether the scene gives the orientation of the material frame at the end, and the end holds it there."""
        return self.holds_twist and self.held_normal is not None

    @property
    def gives_axes(self) -> bool:
        """Whether it is known from the end where the material axes point."""
        return self.fixes_frame or self._at.axes_of_others

    @property
    def prescribed_motion(self) -> Motion | None:
        """How what is held moves."""
        motion: Motion | None = self._value_of("motion")
        return motion

    @property
    def release(self) -> Release | None:
        """When what is held is let go."""
        release: Release | None = self._value_of("release_at")
        return release

    @property
    def loads(self) -> tuple[GivenLoad, ...]:
        """Forces and moments given at the end."""
        found = []
        for key, what in _LOADS.items():
            load = self._value_of(key)
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
    payout: Payout | None = Field(default=None, description=PAYOUT)
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
    turns: Number = Field(default=0.0, description=TWISTED_BY)
    swivel: Truth = Field(default=False, description="true: free to spin about the tangent, so no torque")
    bend_stiffness: NonNegative | None = Field(default=None, description=BEND_STIFFNESS)
    motion: Motion | None = Field(default=None, description="how the clamp moves and turns; absent: not at all")
    payout: Payout | None = Field(default=None, description=PAYOUT)
    release_at: Release | None = Field(default=None, description=_RELEASE)

    @property
    def holds_twist(self) -> bool:
        return not self.swivel

    @property
    def spring(self) -> float:
        return math.inf if self.bend_stiffness is None else self.bend_stiffness

    @model_validator(mode="after")
    def _something_is_held(self) -> Clamped:
        if self.swivel and self.bend_stiffness == 0.0:
            expected = "false, because with bend_stiffness 0 nothing is left that is held"
            refuse([Finding(("swivel",), expected, "write kind: pinned, without a tangent: it turns freely")])
        return self


class Guided(EndTable):
    """Held in a direction, free to move.  The tangent points along increasing s at either end."""

    kind: Literal["guided"] = Field(default="guided", description="direction held, position free")
    tangent: Direction = Field(description=_TANGENT)
    normal: Direction | None = Field(default=None, description=_NORMAL)
    turns: Number = Field(default=0.0, description=TWISTED_BY)
    force: Loading | None = Field(default=None, description="force on the end, inertial frame [N]")
    motion: Motion | None = Field(
        default=None, description="how the direction turns; a guided end takes no translation"
    )

    @property
    def holds_twist(self) -> bool:
        return self.normal is not None

    @model_validator(mode="after")
    def _only_turns(self) -> Guided:
        refuse(moved_guides(self.motion))
        return self


def moved_guides(motion: Motion | None) -> Iterator[Finding]:
    """What moves the place of a guided end."""
    expected = "rotation only, because the position of a guided end is free"
    fix = "use roll, pitch or yaw here; kind: clamped can be moved"
    return (Finding(("motion", name), expected, fix) for name in (motion.shifts() if motion is not None else ()))


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
        """First positions [m] of ends that are not held, as far as they are given, by name (`start`, `end`)."""
        known = {name: end.first_position for name, end in self.named().items() if end.held_position is None}
        return {name: place for name, place in known.items() if place is not None}

    @property
    def turns(self) -> float:
        """Turns by which the end is twisted against the start, right-handed about the tangent."""
        return self.end.held_turns - self.start.held_turns

    def bodies(self) -> dict[str, Body]:
        """The bodies at the ends, by name (`start`, `end`)."""
        return {name: end for name, end in self.named().items() if isinstance(end, Body)}
