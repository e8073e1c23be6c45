"""Obstacles that a line touches, fixed or moving: planes, spheres and cylinders, by name."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.base import (
    Direction,
    Finding,
    Kinds,
    NonNegative,
    Number,
    Positive,
    Table,
    Vector,
    by_kind,
    refuse,
    unit,
)
from hybrid.scene.motion_tables import Motion
from hybrid.scene.points import Name

_FRICTION = "coefficient of friction (Coulomb) of the line on it, in every direction [-]"
_STIFFNESS = (
    "force per metre of line and metre of penetration; absent: so large that the line goes in by a twentieth of its "
    "diameter at most under the tension and weight that the scene asks for [N/m per m]"
)
_DAMPING = "force per metre of line and speed of penetration, in contact [N s/m per m]"
_MOTION = "how it moves, and turns about the place `at`, where it is at t = 0; absent: not at all"


class Spin(Table):
    """Turning of a cylinder about its own axis, which carries along what rubs on it."""

    rate: Number = Field(description="angular velocity about `axis`, right-handed [rad/s]")
    ramp: Positive = Field(description="time over which it grows from zero, smoothly [s]")


class Bearing(Table):
    """A bearing about which a cylinder turns freely, as a sheave does under a line that rubs on it."""

    inertia: Positive = Field(description="moment of inertia about its axis [kg m^2]")
    damping: NonNegative = Field(default=0.0, description="moment of the bearing over the rate of its turn [N m s/rad]")


class _Obstacle(Table):
    """What all obstacles have."""

    friction: NonNegative = Field(default=0.0, description=_FRICTION)
    stiffness: Positive | None = Field(default=None, description=_STIFFNESS)
    damping: NonNegative = Field(default=0.0, description=_DAMPING)
    motion: Motion | None = Field(default=None, description=_MOTION)
    from_outside: bool = Field(
        default=False, description="whether it is moved step by step by `Simulation.set_obstacle`; it rests until it is"
    )

    @model_validator(mode="after")
    def _moves_once(self) -> Self:
        if self.from_outside and self.motion is not None:
            fix = "leave out the one or the other"
            refuse([Finding(("motion",), "nothing, because the obstacle is set from outside", fix)])
        return self

    @property
    def moves(self) -> bool:
        """Whether it does, or turns, or may be set from outside."""
        return self.motion is not None or self.from_outside or any(getattr(self, x, None) for x in ("spin", "bearing"))


class PlaneObstacle(_Obstacle):
    """A wall, ramp or floor: a plane with all that lies behind it."""

    kind: Literal["plane"] = Field(default="plane", description="a plane, solid behind it")
    at: Vector = Field(description="a point of the plane, inertial frame [m]")
    normal: Direction = Field(description="direction out of the solid, towards the line; any length [-]")

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        return sum(n * (a - b) for n, a, b in zip(unit(self.normal), x, self.at, strict=True))


class SphereObstacle(_Obstacle):
    """A ball."""

    kind: Literal["sphere"] = Field(default="sphere", description="a ball")
    at: Vector = Field(description="its centre, inertial frame [m]")
    radius: Positive = Field(description="radius [m]")

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        return math.dist(x, self.at) - self.radius


class CylinderObstacle(_Obstacle):
    """A roller, pile or pipe."""

    kind: Literal["cylinder"] = Field(default="cylinder", description="a round cylinder: a pipe, pile or roller")
    at: Vector = Field(description="the middle of its axis, or any point of an endless one, inertial frame [m]")
    axis: Direction = Field(description="direction of its axis; any length [-]")
    radius: Positive = Field(description="radius [m]")
    length: Positive | None = Field(
        default=None, description="its length, without the half spheres in which it ends; absent: endless [m]"
    )
    spin: Spin | None = Field(
        default=None, description="how it turns about its axis, as a driven roller; absent: not at all"
    )

    bearing: Bearing | None = Field(
        default=None, description="inertia and bearing with which it turns freely, as a sheave; absent: not at all"
    )

    @model_validator(mode="after")
    def _turns_once(self) -> Self:
        if self.spin is not None and self.bearing is not None:
            refuse([Finding(("bearing",), "nothing, because the spin is given", "leave out the one or the other")])
        return self

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        half, a = math.inf if self.length is None else 0.5 * self.length, unit(self.axis)
        w = [p - q for p, q in zip(x, self.at, strict=True)]
        along = min(max(sum(p * q for p, q in zip(w, a, strict=True)), -half), half)
        return math.hypot(*(p - along * q for p, q in zip(w, a, strict=True))) - self.radius


Obstacle = Annotated[
    Annotated[PlaneObstacle, Tag("<plane>")]
    | Annotated[SphereObstacle, Tag("<sphere>")]
    | Annotated[CylinderObstacle, Tag("<cylinder>")],
    Discriminator(by_kind),
    Kinds(("plane", "sphere", "cylinder"), usual=("cylinder",), implied=(("axis", "cylinder"), ("normal", "plane"))),
]
Obstacles = dict[Name, Obstacle]
