"""Shapes of free bodies that lines touch: as obstacles of every line, carried by the body."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from hybrid.scene.base import (
    Before,
    Direction,
    Finding,
    NonNegative,
    Positive,
    Table,
    Vector,
    Words,
    numbers,
    refuse,
    unit,
)
from hybrid.scene.ends import Triple
from hybrid.scene.obstacles import BoxObstacle, CylinderObstacle, SphereObstacle, rounded_within

_FRICTION = "coefficient of friction (Coulomb) of lines on it, in every direction [-]"
_STIFFNESS = (
    "force per metre of line and metre of penetration; absent: so large that lines go in by a twentieth of their "
    "diameter at most under the tension and weight that the scene asks for [N/m per m]"
)
_DAMPING = "force per metre of line and speed of penetration, in contact [N s/m per m]"
AXES = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_PLACE = "its middle, from the origin of the body in axes of the body [m]"


class _OnBody(Table):
    """What a shape knows of the body that carries it, where the body is first looked for."""

    body: str = Field(exclude=True, description="name of the body")
    origin: Triple = Field(exclude=True, description="origin of the body [m]")
    body_axes: tuple[Triple, Triple, Triple] = Field(exclude=True, description="axes of the body, inertial [-]")
    place: Triple = Field(exclude=True, description="middle of the shape, in axes of the body [m]")

    @property
    def moves(self) -> bool:
        """Always, with its body."""
        return True


class CarriedSphere(_OnBody, SphereObstacle):
    """A ball that a body carries."""


class CarriedCylinder(_OnBody, CylinderObstacle):
    """A cylinder that a body carries."""

    own_axis: Triple = Field(exclude=True, description="axis, in axes of the body [-]")


class CarriedBox(_OnBody, BoxObstacle):
    """A box that a body carries; its rotation is against the axes of the body."""

    @property
    def own_axes(self) -> tuple[Triple, ...]:
        """Its axes (3, 3), in those of the body [-]."""
        return super().axes

    @property
    def axes(self) -> tuple[Triple, ...]:
        """Its axes (3, 3), inertial [-], where the body is first looked for."""
        x, y, z = zip(*self.body_axes, strict=True)
        return tuple((_dot(a, x), _dot(a, y), _dot(a, z)) for a in self.own_axes)


def _dot(a: Triple, b: Triple) -> float:
    return sum(p * q for p, q in zip(a, b, strict=True))


Carried = CarriedSphere | CarriedCylinder | CarriedBox
# What each kind has, of what not all of them have.
_KEYS = {
    "sphere": ("radius",),
    "cylinder": ("radius", "axis", "length"),
    "box": ("size", "rounding"),
}
_EXAMPLES = {"radius": "radius: 0.5", "axis": "axis: [0, 0, 1]", "length": "length: 2", "size": "size: [2, 1, 1]",
             "rounding": "rounding: 0.1"}  # fmt: skip


class BodyShape(Table):
    """The surface of a body: a ball, a round cylinder with half spheres at its ends, or a box with rounded edges."""

    kind: Literal["sphere", "cylinder", "box"] = Field(description="a ball, a round cylinder, or a box")
    place: Vector = Field(default=(0.0, 0.0, 0.0), description=_PLACE)
    radius: Positive | None = Field(default=None, description="of a ball or cylinder: its radius [m]")
    axis: Direction | None = Field(
        default=None, description="of a cylinder: direction of its axis, in axes of the body; any length [-]"
    )
    length: Positive | None = Field(
        default=None, description="of a cylinder: its length, without the half spheres in which it ends [m]"
    )
    size: Annotated[tuple[Positive, Positive, Positive], Before(numbers(3)), Words("three numbers > 0")] | None = Field(
        default=None, description="of a box: its outer length, width and height, along axes of its own [m]"
    )
    rounding: Positive | None = Field(
        default=None, description="of a box: radius of its edges, at most half of the smallest of `size` [m]"
    )
    rotation: Vector | None = Field(
        default=None,
        description="of a box: how it is turned against the body, roll, pitch, yaw, about x, then y, then z of that; "
        "absent: not at all [deg]",
    )
    friction: NonNegative = Field(default=0.0, description=_FRICTION)
    stiffness: Positive | None = Field(default=None, description=_STIFFNESS)
    damping: NonNegative = Field(default=0.0, description=_DAMPING)

    @model_validator(mode="after")
    def _has_what_its_kind_has(self) -> Self:
        found = []
        for key in (*_EXAMPLES, "rotation"):
            given, has = getattr(self, key) is not None, key in _KEYS[self.kind]
            if given and not has and (key, self.kind) != ("rotation", "box"):
                other = next((kind for kind, keys in _KEYS.items() if key in keys), "box")
                expected = f"nothing, because the kind is {self.kind}"
                found.append(Finding((key,), expected, f"leave it out, or kind: {other}"))
            elif has and not given:
                found.append(Finding((key,), f"the {key} of the {self.kind}", _EXAMPLES[key], "nothing"))
        refuse(found)
        if self.size is not None and self.rounding is not None:
            refuse(rounded_within(self.size, self.rounding))
        return self

    @property
    def across(self) -> float:
        """No straight line is longer within it [m]."""
        if self.size is not None:
            return math.hypot(*self.size)
        return (self.length or 0.0) + 2.0 * (self.radius or 0.0)


def carried_shape(
    name: str, shape: BodyShape, origin: Triple, rotation: Triple,
    turned: Callable[[Triple, Triple], Triple],
) -> Carried:  # fmt: skip
    """The shape of a body as an obstacle, where its origin (m) and rotation (deg) are.

    turned: turns a vector by a rotation (scene.bodies).
    """
    x, y, z = turned(rotation, shape.place)
    given: dict[str, Any] = {
        "at": (origin[0] + x, origin[1] + y, origin[2] + z), "friction": shape.friction,
        "stiffness": shape.stiffness, "damping": shape.damping, "body": name, "origin": origin, "place": shape.place,
        "body_axes": tuple(turned(rotation, x) for x in AXES),
    }  # fmt: skip
    if shape.size is not None and shape.rounding is not None:
        own = shape.rotation or (0.0, 0.0, 0.0)
        return CarriedBox(**given, size=shape.size, rounding=shape.rounding, rotation=own)
    given |= {"radius": shape.radius}
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
    length = shape.across + 2.0 * margin

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
