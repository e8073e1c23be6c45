"""Fixed obstacles that a line touches: planes, spheres and cylinders, by name."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from hybrid.scene.base import Direction, Kinds, NonNegative, Positive, Table, Vector, by_kind, unit
from hybrid.scene.points import Name

_FRICTION = "coefficient of friction (Coulomb) of the line on it, in every direction [-]"
_STIFFNESS = (
    "force per metre of line and metre of penetration; absent: so large that the line goes in by a twentieth of its "
    "diameter at most under the tension and weight that the scene asks for [N/m per m]"
)
_DAMPING = "force per metre of line and speed of penetration, in contact [N s/m per m]"


class _Obstacle(Table):
    """What all obstacles have."""

    friction: NonNegative = Field(default=0.0, description=_FRICTION)
    stiffness: Positive | None = Field(default=None, description=_STIFFNESS)
    damping: NonNegative = Field(default=0.0, description=_DAMPING)


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
    radius: Positive = Field(description="its radius [m]")

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        return math.dist(x, self.at) - self.radius


class CylinderObstacle(_Obstacle):
    """A roller, pile or pipe; it does not turn."""

    kind: Literal["cylinder"] = Field(default="cylinder", description="a round cylinder: a pipe, pile or roller")
    at: Vector = Field(description="the middle of its axis, or any point of an endless one, inertial frame [m]")
    axis: Direction = Field(description="direction of its axis; any length [-]")
    radius: Positive = Field(description="its radius [m]")
    length: Positive | None = Field(
        default=None, description="its length, without the half spheres in which it ends; absent: endless [m]"
    )

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
