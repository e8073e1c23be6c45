"""Obstacles that a line touches, fixed or moving, by name: planes, spheres, cylinders, boxes, tori, sheaves, meshes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from operator import mul
from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.base import (
    Before,
    Direction,
    Finding,
    Kinds,
    NonNegative,
    Number,
    Positive,
    Table,
    Text,
    Vector,
    Words,
    by_kind,
    numbers,
    refuse,
    turned,
    unit,
)
from hybrid.scene.motion_file import readable
from hybrid.scene.motion_tables import Motion
from hybrid.scene.points import Name

_FRICTION = "coefficient of friction (Coulomb) of the line on it, in every direction [-]"
_STIFFNESS = (
    "force per metre of line and metre of penetration; absent: so large that the line goes in by a twentieth of its "
    "diameter at most under the tension and weight that the scene asks for, and by an eighth where it hits it at the "
    "velocity at which it starts (`initial`); what moves faster or is hit by what falls needs more [N/m per m]"
)
_DAMPING = "force per metre of line and speed of penetration, in contact [N s/m per m]"
_MOTION = "how it moves, and turns about the place `at`, where it is at t = 0; absent: not at all"


class Spin(Table):
    """Turning of a cylinder, torus or sheave about its own axis, which carries along what rubs on it."""

    rate: Number = Field(description="angular velocity about `axis`, right-handed [rad/s]")
    ramp: Positive = Field(description="time over which it grows from zero, smoothly [s]")


class Bearing(Table):
    """A bearing about which a cylinder, torus or sheave turns freely under a line that rubs on it."""

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


class _Turning(_Obstacle):
    """What those have that turn about an axis of their own."""

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


class CylinderObstacle(_Turning):
    """A roller, pile or pipe."""

    kind: Literal["cylinder"] = Field(default="cylinder", description="a round cylinder: a pipe, pile or roller")
    at: Vector = Field(description="the middle of its axis, or any point of an endless one, inertial frame [m]")
    axis: Direction = Field(description="direction of its axis; any length [-]")
    radius: Positive = Field(description="radius [m]")
    length: Positive | None = Field(
        default=None, description="its length, without the half spheres in which it ends; absent: endless [m]"
    )

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        half, a = math.inf if self.length is None else 0.5 * self.length, unit(self.axis)
        w = [p - q for p, q in zip(x, self.at, strict=True)]
        along = min(max(sum(p * q for p, q in zip(w, a, strict=True)), -half), half)
        return math.hypot(*(p - along * q for p, q in zip(w, a, strict=True))) - self.radius


class _Rotated(_Obstacle):
    """What those have that are turned by angles."""

    rotation: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="how it is turned at t = 0: roll, pitch, yaw, about x, then y, then z of the inertial frame [deg]",
    )

    @property
    def axes(self) -> tuple[tuple[float, float, float], ...]:
        """Its axes (3, 3), inertial [-], at t = 0."""
        return tuple(turned(self.rotation, x) for x in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


class BoxObstacle(_Rotated):
    """A box with rounded edges: a deck, beam, chute or container."""

    kind: Literal["box"] = Field(default="box", description="a box with rounded edges")
    at: Vector = Field(description="its middle, inertial frame [m]")
    size: Annotated[tuple[Positive, Positive, Positive], Before(numbers(3)), Words("three numbers > 0")] = Field(
        description="its outer length, width and height, along axes of its own [m]"
    )
    rounding: Positive = Field(description="radius of its edges, at most half of the smallest of `size` [m]")

    @model_validator(mode="after")
    def _is_round_within_its_size(self) -> Self:
        refuse(rounded_within(self.size, self.rounding))
        return self

    @property
    def halves(self) -> tuple[float, float, float]:
        """Half lengths [m] of its flat faces."""
        x, y, z = (0.5 * a - self.rounding for a in self.size)
        return x, y, z

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        w = [p - q for p, q in zip(x, self.at, strict=True)]
        past = [abs(sum(map(mul, w, a))) - half for a, half in zip(self.axes, self.halves, strict=True)]
        return math.hypot(*(max(p, 0.0) for p in past)) + min(max(past), 0.0) - self.rounding


def rounded_within(size: tuple[float, float, float], rounding: float) -> Iterator[Finding]:
    """What is wrong with the radius [m] of the edges of a box of a size [m]."""
    if 2.0 * rounding > min(size):
        expected = f"at most half of the smallest of `size`, {0.5 * min(size):g} m"
        yield Finding(("rounding",), expected, "a smaller radius, or a larger size", f"{rounding:g}")


class TorusObstacle(_Turning):
    """A ring of round section: a shackle, fairlead or eye, through which a line may pass."""

    kind: Literal["torus"] = Field(default="torus", description="a ring of round section")
    at: Vector = Field(description="its middle, inertial frame [m]")
    axis: Direction = Field(description="direction of its axis; any length [-]")
    ring: Positive = Field(description="radius of the middle of the ring [m]")
    radius: Positive = Field(description="radius of its section, smaller than that of the ring [m]")

    @model_validator(mode="after")
    def _has_a_hole(self) -> Self:
        if self.radius >= self.ring:
            expected = f"less than the radius of the ring, {self.ring:g} m"
            refuse([Finding(("radius",), expected, "a larger `ring`, or a sphere", f"{self.radius:g}")])
        return self

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        away, along = _about(x, self.at, self.axis)
        return math.hypot(away - self.ring, along) - self.radius


class SheaveObstacle(_Turning):
    """A disc with a groove of round section around it, in which a line lies, between rims of round section."""

    kind: Literal["sheave"] = Field(default="sheave", description="a disc with a groove around it")
    at: Vector = Field(description="its middle, inertial frame [m]")
    axis: Direction = Field(description="direction of its axis; any length [-]")
    radius: Positive = Field(description="radius of the disc at the bottom of the groove [m]")
    groove: Positive = Field(
        description="radius of the section of the groove, half as wide as it is; larger than that of the line [m]"
    )
    rim: Positive = Field(description="radius of the section of its rims, each twice that thick [m]")

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        away, along = _about(x, self.at, self.axis)
        out, along = away - self.radius - self.groove, abs(along)
        if out > 0.0:
            return math.hypot(out, along - self.groove - self.rim) - self.rim
        return max(self.groove - math.hypot(out, along), along - self.groove - 2.0 * self.rim)


class MeshObstacle(_Rotated):
    """A closed surface of triangles: a hull, structure or fairlead as it is drawn, with sharp edges."""

    kind: Literal["mesh"] = Field(default="mesh", description="a closed surface of triangles")
    file: Text = Field(
        min_length=1,
        description="STL file, text or binary, or OBJ file, relative to the scene file; every edge is shared by two "
        "triangles, whose corners go counter-clockwise seen from outside",
    )
    at: Vector = Field(description="where the origin of the file is, inertial frame [m]")
    scale: Positive = Field(default=1.0, description="length of a unit of the file: 0.001 for one in millimetres [m]")

    @model_validator(mode="after")
    def _readable(self) -> Self:
        from hybrid.scene.mesh_file import WHAT, read_mesh

        with readable(self.file, WHAT):
            read_mesh(self.file)
        return self

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        from hybrid.scene.mesh_file import distance_to, read_mesh

        w = [(p - q) / self.scale for p, q in zip(x, self.at, strict=True)]
        u, v, z = (sum(map(mul, w, a)) for a in self.axes)
        return self.scale * distance_to(read_mesh(self.file), (u, v, z))


def _about(
    x: tuple[float, float, float], at: tuple[float, float, float], axis: tuple[float, float, float]
) -> tuple[float, float]:
    """How far [m] a place is away from an axis through `at`, and along it."""
    w, a = [p - q for p, q in zip(x, at, strict=True)], unit(axis)
    along = sum(map(mul, w, a))
    return math.hypot(*(p - along * q for p, q in zip(w, a, strict=True))), along


Obstacle = Annotated[
    Annotated[PlaneObstacle, Tag("<plane>")]
    | Annotated[SphereObstacle, Tag("<sphere>")]
    | Annotated[CylinderObstacle, Tag("<cylinder>")]
    | Annotated[BoxObstacle, Tag("<box>")]
    | Annotated[TorusObstacle, Tag("<torus>")]
    | Annotated[SheaveObstacle, Tag("<sheave>")]
    | Annotated[MeshObstacle, Tag("<mesh>")],
    Discriminator(by_kind),
    Kinds(
        ("plane", "sphere", "cylinder", "box", "torus", "sheave", "mesh"),
        usual=("cylinder",),
        implied=(
            ("normal", "plane"),
            ("rounding", "box"),
            ("ring", "torus"),
            ("groove", "sheave"),
            ("axis", "cylinder"),
            ("file", "mesh"),
        ),
    ),
]
Obstacles = dict[Name, Obstacle]
