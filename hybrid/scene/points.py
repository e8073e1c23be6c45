"""Points where lines end: fixed, free, guided, fairleads of bodies; and how lines are connected to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from hybrid.scene.attachments import ADDED_MASS, DRAG_AREA, HEIGHT, SHAPE, Shape
from hybrid.scene.base import (
    After,
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
    parallel,
)
from hybrid.scene.ends import BEND_STIFFNESS, PAYOUT, TWISTED_BY, AtPoint, Body, Failure, Free, Payout, moved_guides
from hybrid.scene.motion_tables import GivenLoad, Loading, Motion, Triple

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


def _a_name(name: str) -> str:
    if not name or any(x in name for x in FORBIDDEN):
        raise ValueError("a name")
    return name


Name = Annotated[Text, After(_a_name)]


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
