"""How ends of lines are held, moved, loaded and paid out, and the points where they end.

Points are fixed, free, guided, or fairleads of bodies; a connection says how a line is held by one.
A line that is paid out from a reel or taken in, at one of its ends: how its length changes with time.

Tangents point along increasing s at *both* ends: at the start into the cable, at the
end out of it.  Directions need not have length one; whoever uses them normalises.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import AliasChoices, Field, PrivateAttr

from hybrid.scene.attachments import ADDED_MASS, DRAG_AREA, HEIGHT, SHAPE, Shape, sphere_diameter
from hybrid.scene.base import (
    After,
    Before,
    Direction,
    Finding,
    Findings,
    Kinds,
    NonNegative,
    Number,
    Positive,
    Table,
    Text,
    Truth,
    Vector,
    Words,
    numbers,
    parallel,
)
from hybrid.scene.cable import Section
from hybrid.scene.motion_tables import TURNS, GivenLoad, Load, Loading, Motion, Triple

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

    def _check_one_source(self) -> Findings:
        given = [name for name in SOURCES if getattr(self, name) is not None]
        fix = f"keep {given[0]}, or leave it out" if given else ""
        yield (Finding((name,), f"nothing, because {given[0]} already gives the length", fix) for name in given[1:])
        if self.rate is not None:
            if self.ramp is None and self.rate != 0.0:
                expected = "a number > 0, in s, because a rate that jumps would be an impact"
                yield [Finding(("ramp",), expected, "add `ramp: ...` (s), such as 5")]
            if self.until is not None and self.until < self.begin + (self.ramp or 0.0):
                expected = f"a time not before begin + ramp, {self.begin + (self.ramp or 0.0):g} s"
                yield [Finding(("until",), expected, "a later time, or a shorter ramp")]
        else:
            words = [("ramp", self.ramp), ("until", self.until), ("begin", self.begin or None)]
            fix = "give rate, or leave it out"
            yield (Finding((name,), "nothing, because it is for rate", fix) for name, x in words if x is not None)
        if self.winch is not None and self.longest is None:
            expected = "the longest length that may be out, in m, because the winch pays out as much as it must"
            yield [Finding(("longest",), expected, "add `longest: ...` (m)")]
        for name in ("rates", "lengths"):
            rows = getattr(self, name) or ()
            if rows and rows[0][0] != 0.0:
                yield [Finding((name, 0, 0), "0, because the rows begin with the motion", "a first row at t = 0 s")]
            for k, (one, other) in enumerate(pairwise(rows), start=1):
                if not other[0] > one[0]:
                    expected = f"a time after that of the row before, {one[0]:g} s"
                    yield [Finding((name, k, 0), expected, "sort the rows")]
            if name == "rates" and rows and rows[0][1] != 0.0:
                expected = "0, because the line is at rest at t = 0"
                yield [Finding((name, 0, 1), expected, "a first row [0, 0]")]

    @property
    def from_outside(self) -> bool:
        """Whether the length is set from Python."""
        return all(getattr(self, name) is None for name in SOURCES)


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


class Failure(Table):
    """When what holds a line gives way: at a time, or after the first step with so large a force, as comes first."""

    time: Positive | None = Field(default=None, description="time at which it gives way [s]")
    tension: Positive | None = Field(default=None, description="force at which it gives way [N]")

    def _check_says_when(self) -> Findings:
        if self.time is None and self.tension is None:
            yield [Finding((), "time or tension", "time: 12 (s) or tension: 50e3 (N), or leave it out")]


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
    swung: bool = False  # by a body that turns: its own motion is not all that moves it


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
        return self._value_of("position")

    @property
    def is_placed(self) -> bool:
        """Whether a position that is held is known, and no first guess of what lines move."""
        return not self._at.moves

    @property
    def is_swung(self) -> bool:
        """Whether a body that turns moves it beside its own motion."""
        return self._at.swung

    @property
    def first_position(self) -> Triple | None:
        """Where the search of the equilibrium puts the end first [m]."""
        return self.held_position or self._value_of("initial_guess") or self._at.near

    @property
    def held_tangent(self) -> Triple | None:
        """Direction that is held, of any length."""
        return self._value_of("tangent")

    @property
    def held_normal(self) -> Triple | None:
        """Direction of the material axis a1 that the scene gives, of any length."""
        return self._value_of("normal")

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
        return self._value_of("motion")

    @property
    def release(self) -> Failure | None:
        """When what is held is let go."""
        return self._value_of("release_at")

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

    def _check_normal_is_across(self) -> Findings:
        tangent, normal = self.held_tangent, self.held_normal
        if tangent is not None and normal is not None and parallel(tangent, normal):
            expected = "a direction across the tangent; this one is parallel to it"
            yield [Finding(("normal",), expected, "any direction not along the tangent will do")]


class Pinned(EndTable):
    """Held at a point, free to turn."""

    kind: Literal["pinned"] = Field(
        default="pinned", description="position fixed, free to turn: ball joint, hinge, anchor"
    )
    position: Vector = Field(description="position of the end, inertial frame [m]")
    motion: Motion | None = Field(default=None, description="how the point moves; absent: not at all")
    payout: Payout | None = Field(default=None, description=PAYOUT)
    release_at: Failure | None = Field(default=None, description=_RELEASE)

    def _check_turning_is_free(self) -> Findings:
        if self.motion is not None:
            turns = [name for name in self.motion.harmonics() if name in TURNS]
            expected = "no rotation, because a pinned end turns freely"
            yield (Finding(("motion", name), expected, "kind: clamped can be turned") for name in turns)


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
    release_at: Failure | None = Field(default=None, description=_RELEASE)

    @property
    def holds_twist(self) -> bool:
        return not self.swivel

    @property
    def spring(self) -> float:
        return math.inf if self.bend_stiffness is None else self.bend_stiffness

    def _check_something_is_held(self) -> Findings:
        if self.swivel and self.bend_stiffness == 0.0:
            expected = "false, because with bend_stiffness 0 nothing is left that is held"
            yield [Finding(("swivel",), expected, "write kind: pinned, without a tangent: it turns freely")]


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

    def _check_only_turns(self) -> Findings:
        yield moved_guides(self.motion)


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

    def _check_is_something(self) -> Findings:
        if not (self.mass or self.volume or self.drag_area):
            yield (
                [Finding(("mass",), "a number > 0, in kg", "give its mass, or `kind: free` for an end without a body")]
            )

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume [m^3], whatever the fluid."""
        return self.volume

    def height_in(self, density: float, gravity: float) -> float:
        """Vertical extent [m]."""
        return self.height if self.height is not None else sphere_diameter(self.volume)


End = Annotated[Pinned | Clamped | Guided | Free | Body, Kinds(usual=("pinned",))]


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


# --- points where lines end --------------------------------------------------------------------

_BREAK = (
    "when what holds the point fails, at a time or after the first step with so large a force of its lines: they hang "
    "on together, and the point is free; lines that were clamped there turn freely then; absent: never"
)

_AXES = (
    "in axes of the body; of a fixed point in inertial axes, from where it stands at rest; of a free point in axes of "
    "its own, the same for all lines there"
)

# What to do with a key that ends of one cable have.
WINCH = {"payout": "write it where a line ends: `lines: {NAME: {connections: {end: {payout: ...}}}}`"}

# Names are keys of the result file and of its groups.
FORBIDDEN = "/."


def _without_blanks(name: Any) -> Any:
    """A name that has no blanks around it: without them it might be another one."""
    if isinstance(name, str) and name != name.strip():
        raise ValueError("a name")
    return name


def _a_name(name: str) -> str:
    if not name or any(x in name for x in FORBIDDEN):
        raise ValueError("a name")
    return name


Name = Annotated[Text, Before(_without_blanks), After(_a_name)]


class FixedPoint(Table):
    """A point that is held or moved: an anchor, a fairlead of a vessel whose motion is known."""

    instead: ClassVar[Mapping[str, str]] = WINCH

    kind: Literal["fixed"] = Field(default="fixed", description="held where it is, or moved as `motion` says")
    position: Vector = Field(description="position, inertial frame [m]")
    motion: Motion | None = Field(default=None, description="how the point moves; absent: not at all")
    break_at: Failure | None = Field(default=None, description=_BREAK)


class FreePoint(Table):
    """A point that lines alone hold: a knot, a buoy, a clump, the free end of a line.  It has no moment of inertia."""

    instead: ClassVar[Mapping[str, str]] = WINCH

    kind: Literal["free"] = Field(default="free", description="moves with the lines that meet there")
    initial_guess: Vector | None = Field(
        default=None,
        description="where the search of the equilibrium puts the point first, inertial frame; absent: of the end of "
        "one line where its first shape has it; where lines meet it is needed [m]",
    )
    mass: NonNegative = Field(default=0.0, description="mass in air, its weight over gravity [kg]")
    volume: NonNegative = Field(default=0.0, description="displaced volume, for its buoyancy [m^3]")
    height: Positive | None = Field(default=None, description=HEIGHT)
    shape: Shape = Field(default="sphere", description=SHAPE)
    drag_area: NonNegative = Field(default=0.0, description=DRAG_AREA)
    added_mass: NonNegative = Field(default=0.0, description=ADDED_MASS)
    force: Loading | None = Field(default=None, description="force on the point, inertial frame [N]")
    moment: Loading | None = Field(
        default=None,
        description="moment on a point to which lines are clamped, or on the free end of a rod, inertial frame [N m]",
    )

    def _check_added_mass_has_a_body(self) -> Findings:
        if self.added_mass and not self.is_body:
            yield (
                [Finding(("added_mass",), "0, because the point has no mass, volume or drag area", "add `volume: ...`")]
            )

    @property
    def is_body(self) -> bool:
        """Whether the point is more than a knot."""
        return bool(self.mass or self.volume or self.drag_area)

    @property
    def moments(self) -> tuple[GivenLoad, ...]:
        """Moments that are given; they turn the point, and with it the lines that are clamped there."""
        return Free(moment=self.moment).loads

    @property
    def end(self) -> Body | Free:
        """The end of a line that carries the point, without the moments on it."""
        if not self.is_body:
            return Free(force=self.force)
        given = {k: getattr(self, k) for k in ("mass", "volume", "height", "shape", "drag_area", "added_mass")}
        return Body(**given, thrust=self.force, initial_guess=self.initial_guess)

    def only_end(self, near: Triple | None) -> Body | Free:
        """The end of the one line that ends there; near: where it is first looked for [m], None: nowhere."""
        if self.is_body:
            return self.end.model_copy(update={"initial_guess": near})
        return Free(force=self.force, moment=self.moment).at_point(AtPoint(near=near))


class GuidedPoint(Table):
    """The end of one line that holds its direction and leaves its place free."""

    instead: ClassVar[Mapping[str, str]] = WINCH

    kind: Literal["guided"] = Field(
        default="guided", description="direction held, place free: the end of one line, which is clamped there"
    )
    force: Loading | None = Field(default=None, description="force on the point, inertial frame [N]")
    motion: Motion | None = Field(
        default=None, description="how the direction turns; a guided point takes no translation"
    )

    def _check_only_turns(self) -> Findings:
        yield moved_guides(self.motion)


class Fairlead(Table):
    """A point of a body: a fairlead, a padeye, a hang-off.  It moves with the body."""

    instead: ClassVar[Mapping[str, str]] = WINCH

    kind: Literal["fairlead"] = Field(default="fairlead", description="a point of a body, and moves with it")
    body: Name = Field(description="name of the body")
    place: Vector = Field(description="where on the body, from its origin, in axes of the body [m]")
    break_at: Failure | None = Field(default=None, description=_BREAK)


Point = Annotated[
    FixedPoint | FreePoint | GuidedPoint | Fairlead,
    Kinds(
        usual=("fixed",),
        implied=(("position", "fixed"), ("initial_guess", "free"), ("body", "fairlead")),
    ),
]


# --- how lines are connected: free to turn, or clamped, rigidly or by an angular spring ----------------


class PinnedConnection(Table):
    """The line turns freely at its point."""

    kind: Literal["pinned"] = Field(default="pinned", description="turns freely, no moment")
    payout: Payout | None = Field(default=None, description=PAYOUT)


class ClampedConnection(Table):
    """The line holds its direction at its point, and its moment acts there.  It needs a rod at that end."""

    kind: Literal["clamped"] = Field(default="clamped", description="direction held: moment and torque pass")
    tangent: Direction | None = Field(
        default=None,
        description=f"direction of increasing s at this end, {_AXES}; any length; absent: two lines that go "
        "straight on at a free point [-]",
    )
    normal: Direction | None = Field(
        default=None,
        description="direction of the material axis a1 at this end, in the same axes; only its part across the tangent "
        "counts; absent: no twist along the first shape between held points, else of a line that is bent the short way "
        "from tangent to tangent [-]",
    )
    turns: Number = Field(default=0.0, description=TWISTED_BY)
    swivel: Truth = Field(default=False, description="true: free to spin about the tangent, so no torque")
    bend_stiffness: NonNegative | None = Field(default=None, description=BEND_STIFFNESS)
    payout: Payout | None = Field(default=None, description=PAYOUT)

    def _check_normal_is_across(self) -> Findings:
        if self.normal is not None and self.tangent is None:
            yield [Finding(("tangent",), "a direction, because a normal is given", "give the direction of the line")]
        if self.normal is not None and self.tangent is not None and parallel(self.tangent, self.normal):
            expected = "a direction across the tangent; this one is parallel to it"
            yield [Finding(("normal",), expected, "any direction not along the tangent will do")]
        if self.swivel and self.bend_stiffness == 0.0:
            expected = "false, because with bend_stiffness 0 nothing is left that is held"
            yield [Finding(("swivel",), expected, "leave the connection out: the line then turns freely")]


Connection = Annotated[
    PinnedConnection | ClampedConnection,
    Kinds(
        usual=("clamped",),
        implied=(
            *((key, "clamped") for key in ("tangent", "normal", "turns", "swivel", "bend_stiffness")),
            ("payout", "pinned"),
        ),
    ),
]


class Connections(Table):
    """How a line is connected to its points at both ends."""

    start: Connection = Field(default=PinnedConnection(), description="at s = 0; absent: it turns freely")
    end: Connection = Field(default=PinnedConnection(), description="at s = length; absent: it turns freely")


# Contact of lines of several with each other: which touch, and their friction.


class LinesContact(Table):
    """Lines that touch each other in a run and at rest: they keep a diameter apart, the mean of theirs.

    Where a scene does not speak of it they touch in runs by given steps, from where they come near each other.
    """

    between: tuple[Annotated[tuple[Name, Name], Field(description="names of two lines")], ...] | None = Field(
        default=None,
        description="pairs of lines that touch each other; absent: all of them; empty: none",
    )
    friction: NonNegative = Field(
        default=0.0, description="coefficient of friction (Coulomb) between lines that touch each other [-]"
    )
