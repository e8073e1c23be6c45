"""Shapes of free bodies that lines touch: as obstacles of every line, carried by the body."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from hybrid.scene.base import Direction, Finding, NonNegative, Positive, Table, Vector, refuse, unit
from hybrid.scene.ends import Triple
from hybrid.scene.obstacles import CylinderObstacle, SphereObstacle

_FRICTION = "coefficient of friction (Coulomb) of lines on it, in every direction [-]"
_STIFFNESS = (
    "force per metre of line and metre of penetration; absent: so large that lines go in by a twentieth of their "
    "diameter at most under the tension and weight that the scene asks for [N/m per m]"
)
_DAMPING = "force per metre of line and speed of penetration, in contact [N s/m per m]"
AXES = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_PLACE = "its middle, from the origin of the body in axes of the body [m]"


class CarriedSphere(SphereObstacle):
    """A ball that a body carries, where the body is first looked for."""

    body: str = Field(exclude=True, description="name of the body")
    origin: Triple = Field(exclude=True, description="origin of the body [m]")
    axes: tuple[Triple, Triple, Triple] = Field(exclude=True, description="axes of the body, inertial [-]")
    place: Triple = Field(exclude=True, description="middle of the shape, in axes of the body [m]")

    @property
    def moves(self) -> bool:
        """Always, with its body."""
        return True


class CarriedCylinder(CylinderObstacle):
    """A cylinder that a body carries, where the body is first looked for."""

    body: str = Field(exclude=True, description="name of the body")
    origin: Triple = Field(exclude=True, description="origin of the body [m]")
    axes: tuple[Triple, Triple, Triple] = Field(exclude=True, description="axes of the body, inertial [-]")
    place: Triple = Field(exclude=True, description="middle of the shape, in axes of the body [m]")
    own_axis: Triple = Field(exclude=True, description="axis, in axes of the body [-]")

    @property
    def moves(self) -> bool:
        """Always, with its body."""
        return True


Carried = CarriedSphere | CarriedCylinder


class BodyShape(Table):
    """The surface of a body: a ball, or a round cylinder with half spheres at its ends."""

    kind: Literal["sphere", "cylinder"] = Field(description="a ball, or a round cylinder")
    place: Vector = Field(default=(0.0, 0.0, 0.0), description=_PLACE)
    radius: Positive = Field(description="radius [m]")
    axis: Direction | None = Field(
        default=None, description="of a cylinder: direction of its axis, in axes of the body; any length [-]"
    )
    length: Positive | None = Field(
        default=None, description="of a cylinder: its length, without the half spheres in which it ends [m]"
    )
    friction: NonNegative = Field(default=0.0, description=_FRICTION)
    stiffness: Positive | None = Field(default=None, description=_STIFFNESS)
    damping: NonNegative = Field(default=0.0, description=_DAMPING)

    @model_validator(mode="after")
    def _has_what_its_kind_has(self) -> Self:
        found = []
        for key in ("axis", "length"):
            given = getattr(self, key) is not None
            if given and self.kind == "sphere":
                found.append(Finding((key,), "nothing, because the kind is sphere", "leave it out, or kind: cylinder"))
            elif not given and self.kind == "cylinder":
                example = "axis: [0, 0, 1]" if key == "axis" else "length: 2"
                found.append(Finding((key,), f"the {key} of the cylinder", example, "nothing"))
        if found:
            refuse(found)
        return self


def carried_shape(
    name: str, shape: BodyShape, origin: Triple, rotation: Triple,
    turned: Callable[[Triple, Triple], Triple],
) -> Carried:  # fmt: skip
    """The shape of a body as an obstacle, where its origin (m) and rotation (deg) are.

    turned: turns a vector by a rotation (scene.bodies).
    """
    x, y, z = turned(rotation, shape.place)
    given: dict[str, Any] = {
        "at": (origin[0] + x, origin[1] + y, origin[2] + z), "radius": shape.radius, "friction": shape.friction,
        "stiffness": shape.stiffness, "damping": shape.damping, "body": name, "origin": origin, "place": shape.place,
        "axes": tuple(turned(rotation, x) for x in AXES),
    }  # fmt: skip
    if shape.axis is None:
        return CarriedSphere(**given)
    axis = unit(shape.axis)
    return CarriedCylinder(**given, axis=turned(rotation, axis), length=shape.length, own_axis=axis)


def way_out(shape: BodyShape, start: Triple, towards: tuple[float, ...], margin: float) -> float:
    """How far (m) a straight line goes from a place in a direction of any length until it is `margin` (m) off a shape.

    start, towards: in axes of the body.  At least 0, and never more than once through the shape.
    """
    obstacle = carried_shape("", shape, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), lambda _, x: x)
    size = math.hypot(*towards)
    if not size > 0.0:
        return 0.0
    direction = tuple(x / size for x in towards)
    length = (shape.length or 0.0) + 2.0 * (shape.radius + margin)

    def apart(way: float) -> float:
        x, y, z = (a + way * d for a, d in zip(start, direction, strict=True))
        return obstacle.distance((x, y, z)) - margin

    if apart(0.0) >= 0.0:
        return 0.0
    near, far = 0.0, length
    for _ in range(60):  # convex: the way out is one
        middle = 0.5 * (near + far)
        near, far = (middle, far) if apart(middle) < 0.0 else (near, middle)
    return far
