"""Rigid bodies of a network: what they are, and their shapes.

How they float, and how they move where that is known.  Shapes that lines touch are obstacles of every line, carried by
the body.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from hybrid.scene.base import (
    Before,
    Direction,
    Finding,
    Findings,
    Kinds,
    NonNegative,
    Number,
    Positive,
    Reading,
    Table,
    Vector,
    Whole,
    Words,
    numbers,
    turned,
    unit,
    unwrap,
)
from hybrid.scene.ends import Free, Loading, Triple
from hybrid.scene.motion_tables import Motion
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
_VALUES = {"radius": "0.5", "axis": "[0, 0, 1]", "length": "2", "size": "[2, 1, 1]", "rounding": "0.1"}
_EXAMPLES = {key: f"{key}: {value}" for key, value in _VALUES.items()}


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

    def _check_has_what_its_kind_has(self) -> Findings:
        found = []
        for key in (*_EXAMPLES, "rotation"):
            given, has = getattr(self, key) is not None, key in _KEYS[self.kind]
            if given and not has and (key, self.kind) != ("rotation", "box"):
                other = next((kind for kind, keys in _KEYS.items() if key in keys), "box")
                expected = f"nothing, because the kind is {self.kind}"
                found.append(Finding((key,), expected, f"leave it out, or kind: {other}"))
            elif has and not given:
                found.append(Finding((key,), f"the {key} of the {self.kind}", _EXAMPLES[key], "nothing"))
        yield found
        if self.size is not None and self.rounding is not None:
            yield rounded_within(self.size, self.rounding)

    @property
    def across(self) -> float:
        """No straight line is longer within it [m]."""
        if self.size is not None:
            return math.hypot(*self.size)
        return (self.length or 0.0) + 2.0 * (self.radius or 0.0)


def carried_shape(name: str, shape: BodyShape, origin: Triple, rotation: Triple) -> Carried:
    """The shape of a body as an obstacle, where its origin (m) and rotation (deg) are."""
    x, y, z = turned(rotation, shape.place)
    given: dict[str, Any] = {x: getattr(shape, x) for x in ("friction", "stiffness", "damping", "place")}
    given |= {"at": (origin[0] + x, origin[1] + y, origin[2] + z), "body": name, "origin": origin}
    given["body_axes"] = tuple(turned(rotation, x) for x in AXES)
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
    obstacle = carried_shape("", shape, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
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


ROTATION = "roll, pitch and yaw, about x, then y, then z of the inertial frame [deg]"
# Of the largest number of a matrix: how far it may be from symmetric.
SYMMETRIC = 1e-6


class _Diagonal(Reading):
    """Annotation of a square matrix of numbers for which the numbers of its diagonal may stand."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        short = {"type": "array", "prefixItems": [{"type": "number"}] * 6, "minItems": 6, "maxItems": 6}
        return {"anyOf": [handler(schema), short | {"description": "short for a diagonal matrix"}]}

    def function(self, value: Any) -> Any:
        value = unwrap(value)
        if isinstance(value, list | tuple) and not any(isinstance(unwrap(x), list | tuple) for x in value):
            return [[x if i == j else 0.0 for j in range(len(value))] for i, x in enumerate(value)]
        return value


_Row = Annotated[tuple[Number, Number, Number, Number, Number, Number], Before(numbers(6))]
SixBySix = Annotated[
    tuple[_Row, _Row, _Row, _Row, _Row, _Row],
    Before(numbers(6)),
    _Diagonal(),
    Words("six numbers (surge, sway, heave, roll, pitch, yaw), or six rows of six"),
]
Matrix = NDArray[np.float64]


def mass_about(mass: float, place: ArrayLike, inertia: Triple = (0.0, 0.0, 0.0)) -> Matrix:
    """(6, 6) about the origin of a mass (kg) at a place (m) with moments of inertia (kg m^2) about axes through it."""
    c, E = np.array(place), np.eye(3)
    arm = -mass * np.cross(E, c)
    return np.block([[mass * E, arm], [arm.T, np.diag(inertia) + mass * (c @ c * E - np.outer(c, c))]])


def without_turns(motion: Motion) -> Motion | None:
    """A motion that is given by tables without its rotations; None: there is nothing else."""
    return motion.model_copy(update={"roll": None, "pitch": None, "yaw": None}) if motion.shifts() else None


class Member(Table):
    """A cylinder of a body that water flows around: drag, added mass and the force of waves after Morison."""

    start: Vector = Field(description="one end of its axis, from the origin of the body in axes of the body [m]")
    end: Vector = Field(description="other end of its axis [m]")
    diameter: Positive = Field(description="diameter [m]")
    drag: NonNegative = Field(default=0.0, description="drag coefficient Cd across the axis, on the diameter [-]")
    axial_drag: NonNegative = Field(
        default=0.0, description="drag coefficient along the axis, on the circumference pi x diameter [-]"
    )
    added_mass: NonNegative = Field(default=0.0, description="added mass coefficient Ca = Cm - 1 across the axis [-]")
    pieces: Annotated[Whole, Field(ge=1, le=200)] = Field(
        default=10, description="pieces into which it is cut; each feels the water at its middle [-]"
    )

    def _check_has_a_length(self) -> Findings:
        if math.dist(self.start, self.end) < 1e-6 * self.diameter:
            yield [Finding(("end",), "a place other than that of the start", "move one of the two")]


class Hydrostatics(Table):
    """A body that floats: how high, and how stiffly the water carries it; moments with its weight and its buoyancy."""

    level: Number = Field(default=0.0, description="height of the origin where the body floats without lines [m]")
    heave: NonNegative = Field(default=0.0, description="stiffness of heave, density g times the waterplane [N/m]")
    roll: Number = Field(default=0.0, description="stiffness of roll, weight times metacentric height [N m/rad]")
    pitch: Number = Field(default=0.0, description="stiffness of pitch [N m/rad]")


class FixedBody(Table):
    """A body that is held, or moves as is known: a platform, a vessel.  It does not feel its lines."""

    kind: Literal["fixed"] = Field(default="fixed", description="held where it is, or moved as `motion` says")
    position: Vector = Field(description="position of the origin of the body, inertial frame [m]")
    rotation: Vector = Field(default=(0.0, 0.0, 0.0), description=f"how the body is turned at rest: {ROTATION}")
    motion: Motion | None = Field(default=None, description="how the body moves and turns; absent: not at all")

    def place(self, place: Triple) -> Triple:
        """Where a point of the body is at rest, inertial [m]."""
        return _placed(self.position, self.rotation, place)

    def surface(self, name: str) -> dict[str, Carried]:
        """As of a free body: lines pass through one that a scene holds."""
        return {}

    @property
    def shift(self) -> Motion | None:
        """The motion of the body without its rotations, as far as tables give it."""
        return None if self.motion is None or self.motion.file is not None else without_turns(self.motion)

    def _check_fairleads_are_points(self) -> Findings:
        vessel = self.motion.vessel if self.motion is not None else None
        if vessel is not None and vessel.rao is None:
            expected = "nothing, because `file` is of the body itself: place of its origin and its rotation"
            yield [Finding(("motion", "vessel"), expected, "leave it out")]
        if vessel is not None and vessel.fairlead is not None:
            expected = "nothing, because lines end at points of kind fairlead"
            yield [Finding(("motion", "vessel", "fairlead"), expected, "leave it out")]


class HeldBody(FixedBody):
    """A body with a shape that is held beside its equilibrium, which is what no scene asks for."""

    shape: BodyShape = Field(exclude=True, description="surface that lines touch")

    def surface(self, name: str) -> dict[str, Carried]:
        """Its shape as an obstacle by the name of the body."""
        return {name: carried_shape(name, self.shape, self.position, self.rotation)}


class FreeBody(Table):
    """A rigid body that water and lines hold, in six degrees of freedom: a buoy, a spar, a vessel."""

    kind: Literal["free"] = Field(default="free", description="moves under its loads and the pull of its lines")
    initial_guess: Vector = Field(
        description="where the search of the equilibrium puts the origin first, inertial frame [m]"
    )
    initial_rotation: Vector = Field(default=(0.0, 0.0, 0.0), description=f"and how it is turned there: {ROTATION}")
    mass: Positive = Field(description="mass, without added mass [kg]")
    centre: Vector = Field(
        default=(0.0, 0.0, 0.0), description="centre of mass, from the origin, in axes of the body [m]"
    )
    inertia: Annotated[tuple[Positive, Positive, Positive], Before(numbers(3)), Words("three numbers > 0")] = Field(
        description="moments of inertia about axes through the centre of mass along those of the body [kg m^2]"
    )
    added_mass: SixBySix | None = Field(
        default=None,
        description="added mass about the origin, in axes of the body: six numbers of the diagonal, or six rows "
        "[kg, kg m, kg m^2]",
    )
    damping: SixBySix | None = Field(
        default=None,
        description="linear damping about the origin, in axes of the body, of its velocity in still water "
        "[N s/m, N s, N m s]",
    )
    volume: NonNegative = Field(default=0.0, description="displaced volume of a body that stays submerged [m^3]")
    centre_of_buoyancy: Vector = Field(
        default=(0.0, 0.0, 0.0), description="centre of that volume, from the origin, in axes of the body [m]"
    )
    hydrostatics: Hydrostatics | None = Field(
        default=None, description="how the body floats at the surface; absent: it does not, and its weight counts"
    )
    members: tuple[Member, ...] = Field(
        default=(),
        description="cylinders fixed to the body on which waves, current and its own motion act; their buoyancy is in "
        "`volume` or `hydrostatics`",
    )
    shape: BodyShape | None = Field(
        default=None, description="surface that lines touch, whichever they are; absent: they pass through the body"
    )
    force: Loading | None = Field(default=None, description="force at the origin, inertial frame [N]")
    moment: Loading | None = Field(default=None, description="moment, inertial frame [N m]")

    def surface(self, name: str) -> dict[str, Carried]:
        """Its shape as an obstacle by the name of the body, where the body is first looked for; empty: it has none."""
        if self.shape is None:
            return {}
        return {name: carried_shape(name, self.shape, self.initial_guess, self.initial_rotation)}

    def place(self, place: Triple) -> Triple:
        """Where a point of the body is first looked for, inertial [m]."""
        return _placed(self.initial_guess, self.initial_rotation, place)

    @property
    def end(self) -> Free:
        """Its given loads, as those of an end."""
        return Free(force=self.force, moment=self.moment)

    @property
    def mass_matrix(self) -> Matrix:
        """(6, 6) of mass, inertia and added mass about the origin, axes of the body."""
        M = mass_about(self.mass, self.centre, self.inertia)
        return M if self.added_mass is None else M + np.array(self.added_mass)

    def _check_floats_or_is_submerged(self) -> Findings:
        if self.volume and self.hydrostatics is not None:
            expected = "nothing, because hydrostatics holds the buoyancy of a body that floats"
            yield [Finding(("volume",), expected, "leave it out, or leave hydrostatics out")]

    def _check_matrices_are_possible(self) -> Findings:
        most, rest = max(self.inertia), sum(self.inertia) - max(self.inertia)
        if most > rest * (1.0 + 1e-9):
            expected = (
                f"moments of which none is more than the other two together; {most:g} is more than {rest:g} kg m^2"
            )
            yield [Finding(("inertia",), expected, "check which axis is which, and the units")]
        for key, given_in in (("added_mass", "kg"), ("damping", "N s/m")):
            if getattr(self, key) is None:
                continue
            matrix = np.array(getattr(self, key))
            big, uneven = max(np.abs(matrix).max(), 1e-300), np.abs(np.tril(matrix - matrix.T))
            if key == "added_mass" and uneven.max() > SYMMETRIC * big:
                i, j = np.argwhere(uneven == uneven.max())[-1].tolist()
                expected = f"a symmetric matrix; here row {i + 1}, column {j + 1} and its mirror image differ"
                yield [Finding((key, i, j), expected, f"{matrix[j, i]:g} ({given_in}), or the mean of both")]
            if key == "damping" and np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0] < -1e-9 * big:
                expected = "a matrix that takes energy, whatever the velocity: no negative eigenvalue"
                yield [Finding((key,), expected, "check signs and units", "a matrix that gives energy")]
        if np.linalg.eigvalsh(self.mass_matrix)[0] < 1e-12 * np.abs(self.mass_matrix).max():
            expected = "a matrix that leaves, with the mass, some inertia to every motion"
            given = "a matrix that leaves none"
            yield [Finding(("added_mass",), expected, "check signs, units and the order surge to yaw", given)]


def _placed(origin: Triple, rotation: Triple, place: Triple) -> Triple:
    x, y, z = turned(rotation, place)
    return origin[0] + x, origin[1] + y, origin[2] + z


RigidBody = Annotated[
    FixedBody | FreeBody, Kinds(usual=("free",), implied=(("position", "fixed"), ("initial_guess", "free")))
]
