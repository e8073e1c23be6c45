"""Points where lines of a system end: fixed ones, free ones, guided ones, and fairleads of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.attachments import ADDED_MASS, DRAG_AREA, HEIGHT, SHAPE, Shape
from hybrid.scene.base import After, Finding, Kinds, NonNegative, Positive, Table, Text, Vector, by_kind, refuse
from hybrid.scene.end_loads import GivenLoad, Loading, Triple
from hybrid.scene.ends import Body, Free, moved_guides
from hybrid.scene.motion_tables import Motion

_BREAK = (
    "when what holds the point fails, at a time or after the first step with so large a force of its lines: they hang "
    "on together, and the point is free; lines that were clamped there turn freely then; absent: never"
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


class Failure(Table):
    """When something breaks: at a time, or after the first step with so large a force; whichever comes first."""

    time: Positive | None = Field(default=None, description="time at which it breaks [s]")
    tension: Positive | None = Field(default=None, description="force at which it breaks [N]")

    @model_validator(mode="after")
    def _says_when(self) -> Failure:
        if self.time is None and self.tension is None:
            fix = "time: 12 (s) or tension: 50e3 (N), or leave break_at out"
            refuse([Finding((), "time or tension", fix)])
        return self


class _FreeNear(Free):
    """A free end that the search of the equilibrium puts somewhere first."""

    initial_guess: Vector | None = None


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

    @model_validator(mode="after")
    def _added_mass_has_a_body(self) -> FreePoint:
        if self.added_mass and not self.is_body:
            refuse(
                [Finding(("added_mass",), "0, because the point has no mass, volume or drag area", "add `volume: ...`")]
            )
        return self

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
        return _FreeNear(force=self.force, moment=self.moment, initial_guess=near)


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

    @model_validator(mode="after")
    def _only_turns(self) -> GuidedPoint:
        refuse(moved_guides(self.motion))
        return self


class Fairlead(Table):
    """A point of a body: a fairlead, a padeye, a hang-off.  It moves with the body."""

    instead: ClassVar[Mapping[str, str]] = WINCH

    kind: Literal["fairlead"] = Field(default="fairlead", description="a point of a body, and moves with it")
    body: Name = Field(description="name of the body")
    place: Vector = Field(description="where on the body, from its origin, in axes of the body [m]")
    break_at: Failure | None = Field(default=None, description=_BREAK)


Point = Annotated[
    Annotated[FixedPoint, Tag("<fixed>")]
    | Annotated[FreePoint, Tag("<free>")]
    | Annotated[GuidedPoint, Tag("<guided>")]
    | Annotated[Fairlead, Tag("<fairlead>")],
    Discriminator(by_kind),
    Kinds(
        ("fixed", "free", "guided", "fairlead"),
        usual=("fixed",),
        implied=(("position", "fixed"), ("initial_guess", "free"), ("body", "fairlead")),
    ),
]
