"""How the ends of a line are connected to its points: free to turn, or clamped, rigidly or by an angular spring."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.base import Direction, Finding, Kinds, NonNegative, Number, Table, Truth, by_kind, parallel, refuse
from hybrid.scene.combinations import holds_rod
from hybrid.scene.ends import BEND_STIFFNESS, PAYOUT, TWISTED_BY
from hybrid.scene.motion_tables import TURNS
from hybrid.scene.payout import Payout
from hybrid.scene.points import FixedPoint, FreePoint

if TYPE_CHECKING:
    from hybrid.scene.system import System

_AXES = (
    "in axes of the body; of a fixed point in inertial axes, from where it stands at rest; of a free point in axes of "
    "its own, the same for all lines there"
)


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
        "counts; absent: no twist of a line that is bent the short way from tangent to tangent [-]",
    )
    turns: Number = Field(default=0.0, description=TWISTED_BY)
    swivel: Truth = Field(default=False, description="true: free to spin about the tangent, so no torque")
    bend_stiffness: NonNegative | None = Field(default=None, description=BEND_STIFFNESS)
    payout: Payout | None = Field(default=None, description=PAYOUT)

    @model_validator(mode="after")
    def _normal_is_across(self) -> ClampedConnection:
        if self.normal is not None and self.tangent is None:
            refuse([Finding(("tangent",), "a direction, because a normal is given", "give the direction of the line")])
        if self.normal is not None and self.tangent is not None and parallel(self.tangent, self.normal):
            expected = "a direction across the tangent; this one is parallel to it"
            refuse([Finding(("normal",), expected, "any direction not along the tangent will do")])
        if self.swivel and self.bend_stiffness == 0.0:
            expected = "false, because with bend_stiffness 0 nothing is left that is held"
            refuse([Finding(("swivel",), expected, "leave the connection out: the line then turns freely")])
        return self


Connection = Annotated[
    Annotated[PinnedConnection, Tag("<pinned>")] | Annotated[ClampedConnection, Tag("<clamped>")],
    Discriminator(by_kind),
    Kinds(
        ("pinned", "clamped"),
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


def connection_findings(system: System) -> Iterator[Finding]:
    """What is wrong with the connections of a system of lines."""
    for name in system.lines:
        for key in ("start", "end"):
            held = system.clamp(name, key)
            if held is not None:
                yield from _clamp_findings(system, name, key, held)
            payout = getattr(system.lines[name].connections, key).payout
            if payout is not None and isinstance(system.points[getattr(system.lines[name], key)], FreePoint):
                fix = "make the point `kind: fixed`, or the fairlead of a body"
                expected = "nothing, because a winch stands on a fixed point or on a body"
                yield Finding(("lines", name, "connections", key, "payout"), expected, fix)
    for name, point in system.points.items():
        if isinstance(point, FixedPoint) and point.motion is not None and not system.clamped_at(name):
            for turn in (x for x in point.motion.harmonics() if x in TURNS):
                fix = "leave it out, or clamp a line there: `connections: {end: {tangent: [0, 0, 1]}}`"
                expected = "no rotation, because lines turn freely at a point"
                yield Finding(("points", name, "motion", turn), expected, fix)
        elif isinstance(point, FreePoint):
            yield from _rigid_point_findings(system, name)


def _clamp_findings(system: System, name: str, key: str, held: ClampedConnection) -> Iterator[Finding]:
    line, point = system.lines[name], getattr(system.lines[name], key)
    at = ("lines", name, "connections", key)
    if not (system.is_held(point) or holds_rod(line.chosen_model, key, line.cable.length)):
        expected = "pinned, because this end of the line is a catenary, which has no moment"
        yield Finding(at, expected, "give `bending_stiffness` to all sections, and `model: rod`", "clamped")
    if held.tangent is None and not isinstance(system.points[point], FreePoint):
        yield Finding((*at, "tangent"), "the direction of the line at this end", "add `tangent: [0, 0, 1]`", "nothing")


def _rigid_point_findings(system: System, name: str) -> Iterator[Finding]:
    """What is wrong with lines that are clamped to a free point."""
    here, point = system.clamped_at(name), system.points[name]
    if not here:
        takes = system.is_free_end(name) and isinstance(point, FreePoint) and not point.is_body
        if isinstance(point, FreePoint) and point.moment is not None and not takes:
            expected = "nothing, because all lines turn freely at this point: nothing there takes a moment"
            fix = "leave it out, or clamp two lines there: `connections: {end: clamped}` of one, `{start: clamped}`"
            yield Finding(("points", name, "moment"), expected, fix)
        return
    line, key = here[0]
    at = ("lines", line, "connections", key)
    held = [system.clamp(*x) for x in here]
    if len(here) == 1:
        expected = f"another line that is clamped at point {name}, because a free point alone holds no direction"
        yield Finding(at, expected, "clamp a second line there, or none, or make the point `kind: guided`", "one line")
    elif all(x is not None and x.bend_stiffness == 0.0 for x in held):
        expected = f"a line at point {name} without bend_stiffness 0: nothing holds the direction of the point"
        yield Finding((*at, "bend_stiffness"), expected, "leave it out for one of them", "0")
    elif len(here) > 2 or any(x is not None and x.tangent is not None for x in held):
        for (line, key), x in zip(here, held, strict=True):
            if x is not None and x.tangent is None:
                expected = f"the direction of the line in axes of point {name}, the same for all lines there"
                where = ("lines", line, "connections", key, "tangent")
                yield Finding(where, expected, "add `tangent: [1, 0, 0]`, and fitting ones to the others", "nothing")
