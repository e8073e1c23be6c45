"""The sea around the cable: currents, the seabed and its depths; waves are in `waves.py`.

A bed of depths has them at the crossings of rising x and y, inline or from a CSV file.

Heights count along z; directions in degrees from x, counter-clockwise seen from above.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AliasChoices, ConfigDict, Discriminator, Field, Tag

from hybrid.scene.base import (
    After,
    Before,
    Finding,
    Findings,
    Kinds,
    NonNegative,
    Number,
    Pair,
    PlainNumber,
    Positive,
    Table,
    Text,
    Vector,
    Words,
    numbers,
    refuse,
    unwrap,
)
from hybrid.scene.motion_file import RecordRefused, columns_of, read_once, read_table, unreadable

# More points than any survey of a mooring needs; they are kept in memory three times over.
MOST_POINTS = 4_000_000


class Depths(Table):
    """Depths of the bed at the points of a grid.

    Between them the bed is a smooth surface that never leaves the range of the four depths around; beyond the grid it
    goes on straight.
    """

    x: tuple[Number, ...] = Field(default=(), description="x of the grid's lines, rising [m]")
    y: tuple[Number, ...] = Field(default=(), description="y of the grid's lines, rising [m]")
    depth: tuple[tuple[Number, ...], ...] = Field(
        default=(), description="depth of the bed under `seabed.z`: a row for each x, with a number for each y [m]"
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns x,y,depth, a row for each point of the grid, in any order (m); relative to "
        "the scene file",
    )

    @property
    def surface(self) -> Surface:
        """The grid as arrays.  Only after validation: the file is readable then."""
        return _from_file(self.file) if self.file is not None else _from_lists(self.x, self.y, self.depth)

    def _check_one_grid(self) -> Findings:
        given = [name for name in ("x", "y", "depth") if getattr(self, name)]
        if self.file is not None:
            fix = "leave it out, or leave file out"
            yield (Finding((name,), "nothing, because file already gives the depths", fix) for name in given)
            yield from unreadable(self.file, lambda: self.surface)
            return
        if len(given) < 3:
            fix = "write x: [...], y: [...], depth: [[...], ...], or file: depths.csv"
            yield [Finding((), "x, y and depth, or file", fix)]
        for name in ("x", "y"):
            values = getattr(self, name)
            if len(values) < 2:
                yield [Finding((name,), "at least two numbers, in m", "a level bed needs no depths: give z alone")]
            for k, (a, b) in enumerate(pairwise(values), start=1):
                if not b > a:
                    yield [Finding((name, k), f"a number above the one before, {a:g} m", "sort them")]
        if len(self.depth) != len(self.x):
            expected = f"{len(self.x)} rows, one for each x"
            yield [Finding(("depth",), expected, "rows go with x, columns with y", f"{len(self.depth)} rows")]
        for k, row in enumerate(self.depth):
            if len(row) != len(self.y):
                expected = f"{len(self.y)} numbers, one for each y"
                yield [Finding(("depth", k), expected, "rows go with x, columns with y", f"{len(row)} numbers")]


class Surface(NamedTuple):
    """Depths (n, m, 4) at x (n,) and y (m,): depth, its slopes along x and y, and the rate of these along the other."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    values: NDArray[np.float64]

    def depth_at(self, x: float, y: float) -> tuple[float, float, float]:
        """Depth (m) and its slopes along x and y, as kernels.laws.seabed has them."""
        i = int(np.clip(np.searchsorted(self.x, x, "right") - 1, 0, len(self.x) - 2))
        j = int(np.clip(np.searchsorted(self.y, y, "right") - 1, 0, len(self.y) - 2))
        h, g = self.x[i + 1] - self.x[i], self.y[j + 1] - self.y[j]
        t, s = min(max((x - self.x[i]) / h, 0.0), 1.0), min(max((y - self.y[j]) / g, 0.0), 1.0)
        over_x, over_y = x - self.x[i] - t * h, y - self.y[j] - s * g
        corners = self.values[i : i + 2, j : j + 2]

        def weights(t: float, h: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            s = 1.0 - t
            value = [[s * s * (1.0 + 2.0 * t), h * t * s * s], [t * t * (3.0 - 2.0 * t), -h * t * t * s]]
            slope = [[-6.0 * t * s / h, s * (1.0 - 3.0 * t)], [6.0 * t * s / h, t * (3.0 * t - 2.0)]]
            return np.array(value), np.array(slope)

        (a, da), (b, db) = weights(t, h), weights(s, g)

        def weigh(p: NDArray[np.float64], q: NDArray[np.float64]) -> float:
            # corners[..., [[0, 2], [1, 3]]]: derivative along x counts the rows, that along y the columns
            table = corners[..., [0, 2, 1, 3]].reshape(2, 2, 2, 2)
            return float(np.einsum("ik,jl,ijkl->", p, q, table))

        zx, zy = weigh(da, b), weigh(a, db)
        twist = weigh(da, db) if over_x or over_y else 0.0
        depth = weigh(a, b) + over_x * zx + over_y * zy + over_x * over_y * twist
        return depth, zx + over_y * twist, zy + over_x * twist


def _slopes(values: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slopes along the first axis at the points `at`, limited so that the cubics between are monotone (PCHIP)."""
    from scipy.interpolate import PchipInterpolator  # slow to import

    with np.errstate(over="ignore"):  # of the inverse of a chord that is next to nothing
        return np.asarray(PchipInterpolator(at, values)(at, 1))


def _surface(x: NDArray[np.float64], y: NDArray[np.float64], depth: NDArray[np.float64]) -> Surface:
    """With slopes that keep the depths of every cell of the grid between those of its four corners.

    A bicubic is between the smallest and the largest of its 16 Bezier points.  Those on the edges are between the
    corners with monotone cubics there; slopes at a point, then its mixed derivative, are reduced until the inner ones
    are, in the four cells around it.
    """
    dx, dy = _slopes(depth, x), _slopes(depth.T, y).T
    both = 0.5 * (_slopes(dx.T, y).T + _slopes(dy, x))
    cells = np.stack([depth[:-1, :-1], depth[1:, :-1], depth[:-1, 1:], depth[1:, 1:]])
    low, high = cells.min(axis=0), cells.max(axis=0)
    h, g = np.diff(x)[:, None] / 3.0, np.diff(y)[None, :] / 3.0

    def limit(parts: Callable[[Any, Any, tuple[slice, slice]], tuple[Any, Any]]) -> NDArray[np.float64]:
        """The largest part (n, m), up to 1, of a change that keeps the inner points; (base, change) by `parts`."""
        part = np.ones_like(depth)
        for i, a in ((slice(None, -1), h), (slice(1, None), -h)):
            for j, b in ((slice(None, -1), g), (slice(1, None), -g)):
                base, change = parts(a, b, (i, j))
                room = np.where(change > 0.0, high - base, base - low).clip(0.0)
                within = np.divide(room, abs(change), out=np.ones_like(room), where=abs(change) > room)
                part[i, j] = np.minimum(part[i, j], within)
        return part

    part = limit(lambda a, b, at: (depth[at], a * dx[at] + b * dy[at]))
    dx, dy = part * dx, part * dy
    both = both * limit(lambda a, b, at: (depth[at] + a * dx[at] + b * dy[at], a * b * both[at]))
    return Surface(x, y, np.ascontiguousarray(np.stack([depth, dx, dy, both], axis=-1)))


@lru_cache(maxsize=4)
def _from_lists(x: tuple[float, ...], y: tuple[float, ...], depth: tuple[tuple[float, ...], ...]) -> Surface:
    return _surface(np.array(x), np.array(y), np.array(depth))


@read_once(4)
def _from_file(path: str) -> Surface:
    """The grid of a file; RecordRefused."""
    name = os.path.basename(path)
    header, table, lines = read_table(path, columns_of(["x", "y", "depth"], ", in any order"))
    columns = [table[:, header.index(c)] for c in ("x", "y", "depth")]
    x, of_x = np.unique(columns[0], return_inverse=True)
    y, of_y = np.unique(columns[1], return_inverse=True)
    if len(x) < 2 or len(y) < 2 or len(x) * len(y) > MOST_POINTS:
        expected = f"a grid of at least 2 x and 2 y, and at most {MOST_POINTS} points"
        raise RecordRefused(expected, "one row for each point x, y", f"{name}, {len(x)} x and {len(y)} y")
    found = np.full((len(x), len(y)), -1)
    for k, (i, j) in enumerate(zip(of_x.tolist(), of_y.tolist(), strict=True)):
        if found[i, j] >= 0:
            given = f"{name}, line {lines[k]}: x = {x[i]:.9g}, y = {y[j]:.9g} again"
            raise RecordRefused("each point once", "drop one of the two rows", given)
        found[i, j] = k
    if (found < 0).any():
        i, j = np.argwhere(found < 0)[0]
        given = f"{name}, which has no row for x = {x[i]:.9g}, y = {y[j]:.9g}"
        expected = f"a depth for every pair of its {len(x)} x and {len(y)} y"
        raise RecordRefused(expected, "put scattered soundings on a grid first", given)
    return _surface(x, y, columns[2][found])


# Soil of a seabed that remembers: nonlinear penetration with suction, lateral resistance.

# Part of the diameter at which a bearing factor is counted as that of a line at rest, for guesses and lengths of cells.
USUAL = 0.1

Part = Annotated[NonNegative, Field(le=1.0)]


class LateralSoil(Table):
    """Resistance of the soil beside the cable, API's clay on the height that lies in the soil.

    It is pu y/ym up to pu, y the elastic travel of friction and ym its most, with
    pu = min(3 su + unit_weight z + wedge su z/D, 9 su) x min(z, D).
    """

    unit_weight: NonNegative = Field(default=0.0, description="submerged weight of the soil per volume [N/m^3]")
    wedge: NonNegative = Field(default=0.5, description="J, how the resistance grows with the depth, z/D [-]")


class Soil(Table):
    """Clay: penetration, suction and repenetration, each towards its ultimate resistance (Randolph and Quiggin).

    They follow from the penetration z of the centreline and the diameter D of the cable.
    """

    shear_strength: Positive = Field(description="undrained shear strength at the bed, without depth [Pa]")
    gradient: NonNegative = Field(default=0.0, description="by how much it grows per metre of depth [Pa/m]")
    bearing: Positive = Field(default=6.0, description="a of the bearing factor a (z/D)^power [-]")
    power: Part = Field(default=0.25, description="its power; below z/D = 0.1 the factor falls as the root of z [-]")
    stiffness: Positive = Field(
        default=200.0,
        description="normalised: with what part of ultimate resistance over diameter each turn of the way begins [-]",
    )
    suction: Part = Field(
        default=0.6, description="ultimate suction, as a part of ultimate resistance; 0: the bed does not hold [-]"
    )
    lateral: LateralSoil | None = Field(
        default=None, description="resistance to the side, beside friction, which says its travel; absent: none"
    )

    @property
    def steepest(self) -> float:
        """Stiffness of unloading USUAL diameters below a bed of one strength [N/m per m]."""
        return self.stiffness * self.bearing * USUAL**self.power * self.shear_strength


# The sea around the cable: currents and the seabed; its waves are in `waves.py`.

# --- currents ----------------------------------------------------------------------------------

_RAMP = "time over which the {what} grows from nothing, smoothly; absent: there from the beginning [s]"


_VELOCITY = "velocity of the water{where}, inertial frame; or speed and direction [m/s]"
_SPEED = "speed of the water{where}, in place of velocity, level in its `direction` [m/s]"
_TOWARDS = (
    "direction (heading) towards which the water flows with `speed`, from x counter-clockwise seen from above, as of "
    "waves; absent: 0, along x [deg]"
)


class _Flow(Table):
    """A velocity of the water: as a vector, or level, by its speed and the direction in which it flows."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": ["velocity"]}, {"required": ["speed"]}]})
    usual = ("velocity",)
    if TYPE_CHECKING:
        velocity: Vector | None
        speed: float | None
        direction: float | None

    @property
    def flow(self) -> tuple[float, float, float]:
        """Velocity of the water, inertial frame [m/s]."""
        if self.velocity is not None:
            return self.velocity
        towards, speed = math.radians(self.direction or 0.0), self.speed or 0.0
        return speed * round(math.cos(towards), 15), speed * round(math.sin(towards), 15), 0.0

    def _check_one_way_to_say_it(self) -> Findings:
        if self.velocity is not None:
            given = [key for key in ("speed", "direction") if getattr(self, key) is not None]
            expected = "nothing, because velocity gives both"
            yield (Finding((key,), expected, "leave the one or the other out") for key in given)
        elif self.speed is None:
            expected = "three numbers [x, y, z] in m/s; or a speed in m/s, and a direction in degrees from x towards y"
            yield [Finding(("velocity",), expected, "add `speed: 0.5` and `direction: 0`")]


class CurrentPoint(_Flow):
    """The velocity of the water at a height."""

    z: Number = Field(description="height, inertial frame [m]")
    velocity: Vector | None = Field(default=None, description=_VELOCITY.format(where=" there"))
    speed: NonNegative | None = Field(default=None, description=_SPEED.format(where=" there"))
    direction: Number | None = Field(default=None, description=_TOWARDS)


def _one_way(points: tuple[CurrentPoint, ...]) -> tuple[CurrentPoint, ...]:
    """Heights that only rise or only fall; the first that turns back is refused."""
    up = points[1].z > points[0].z if len(points) > 1 else True
    for i, (a, b) in enumerate(pairwise(points), start=1):
        if a.z == b.z or (b.z > a.z) is not up:
            expected = "heights that only rise or only fall from entry to entry, in m"
            refuse([Finding((i, "z"), expected, "sort the entries by z and drop duplicates")])
    return points


CurrentPoints = Annotated[tuple[CurrentPoint, ...], Field(min_length=2), After(_one_way)]


class UniformCurrent(_Flow):
    """The same velocity everywhere."""

    kind: Literal["uniform"] = Field(default="uniform", description="the same everywhere")
    velocity: Vector | None = Field(default=None, description=_VELOCITY.format(where=""))
    speed: NonNegative | None = Field(default=None, description=_SPEED.format(where=""))
    direction: Number | None = Field(default=None, description=_TOWARDS)
    ramp: Positive | None = Field(default=None, description=_RAMP.format(what="current"))


class CurrentProfile(Table):
    """Velocities at heights: linear between them, constant above the highest and below the lowest."""

    kind: Literal["profile"] = Field(default="profile", description="a table of velocities, linear between heights")
    table: CurrentPoints = Field(description="heights, rising or falling, and the velocity at each")
    ramp: Positive | None = Field(default=None, description=_RAMP.format(what="current"))


class PowerLawCurrent(_Flow):
    """velocity x ((z - bottom) / (top - bottom))^exponent; that of the top above it, nothing below the bottom."""

    kind: Literal["power_law"] = Field(default="power_law", description="a power of the height above the bottom")
    velocity: Vector | None = Field(default=None, description=_VELOCITY.format(where=" at the top"))
    speed: NonNegative | None = Field(default=None, description=_SPEED.format(where=" at the top"))
    direction: Number | None = Field(default=None, description=_TOWARDS)
    top: Number | None = Field(
        default=None, description="height of the top; absent: the surface of the fluid, or 0 without one [m]"
    )
    bottom: Number = Field(description="height at which the current vanishes [m]")
    exponent: Positive = Field(default=1 / 7, description="the power; absent: one seventh [-]")
    veer: Number = Field(
        default=0.0,
        validation_alias=AliasChoices("veer", "turn"),
        description="angle by which the current turns from the top to the bottom, in proportion to the depth, "
        "counter-clockwise seen from above [deg]",
    )
    ramp: Positive | None = Field(default=None, description=_RAMP.format(what="current"))

    def top_under(self, surface: float | None) -> float:
        """Height of the top [m] in a fluid with that surface (None: it has none)."""
        return self.top if self.top is not None else surface if surface is not None else 0.0

    def _check_top_is_above(self) -> Findings:
        if self.top is not None and self.bottom >= self.top:
            expected = f"a height below the top, {self.top:.8g} m"
            yield [Finding(("bottom",), expected, "z points up; heights below the surface are negative")]


_KINDS = ("uniform", "profile", "power_law")


def _current_form(value: Any) -> str:
    """Discriminator: a table has its kind, a list of tables is a profile, anything else must be a vector."""
    value = unwrap(value)
    if isinstance(value, Mapping | Table) or (isinstance(value, str) and value in _KINDS):
        return "<table>"
    listed = isinstance(value, Sequence) and not isinstance(value, str | bytes)
    return "<list>" if listed and any(isinstance(x, Mapping | Table) for x in value) else "<vector>"


_FORMS = (
    "three numbers [x, y, z] (or a table with speed and direction, or a list of {z, velocity}, "
    f"or a table with kind: {' | '.join(_KINDS)})"
)

Current = Annotated[
    Annotated[tuple[Number, Number, Number], Before(numbers(3)), Words(_FORMS), Tag("<vector>")]
    | Annotated[CurrentPoints, Tag("<list>")]
    | Annotated[
        UniformCurrent | CurrentProfile | PowerLawCurrent,
        Kinds(
            usual=("uniform",),
            implied=(("table", "profile"), ("bottom", "power_law"), ("speed", "uniform"), ("velocity", "uniform")),
        ),
        Tag("<table>"),
    ],
    Discriminator(_current_form),
]


# --- the seabed --------------------------------------------------------------------------------


class Friction(Table):
    """Coulomb friction of the seabed on the cable; a plain number means both."""

    axial: NonNegative = Field(description="friction coefficient along the cable (tangential) [-]")
    lateral: NonNegative = Field(description="friction coefficient across the cable (normal, transverse) [-]")
    residual: tuple[NonNegative, NonNegative] | None = Field(
        default=None,
        description="[axial, lateral], what is left of them behind a break-out; absent: they stay [-]",
    )
    breakout: Positive | None = Field(
        default=None, description="way of sliding in which what is lost falls to 1/e, with residual [m]"
    )
    travel: Positive | None = Field(
        default=None,
        description="elastic travel before the cable slides; absent: a hundredth of the smallest diameter, or a tenth "
        "of the penetration at rest [m]",
    )

    def _check_residual_is_less(self) -> Findings:
        if (self.residual is None) != (self.breakout is None):
            key, other = ("breakout", "residual") if self.breakout is None else ("residual", "breakout")
            yield [Finding((key,), f"a value, because {other} is given", f"add `{key}: ...`, or leave {other} out")]
        for k, (key, most) in enumerate((("axial", self.axial), ("lateral", self.lateral)) if self.residual else ()):
            if self.residual is not None and self.residual[k] > most:
                expected = f"at most {most:g}, that of break-out ({key})"
                yield [Finding(("residual", k), expected, "are the two exchanged?")]


class Seabed(Table):
    """A bed, plane or of depths on a grid, that pushes back along its normal like a spring under each metre."""

    usual = ("stiffness",)

    z: Number = Field(
        description="height of the bed at x = y = 0; with `depths`, the height they count down from, usually that of "
        "the surface [m]"
    )
    slope: Pair | None = Field(
        default=None, description="[dz/dx, dz/dy], how steeply the bed rises along x and y; absent: level [-]"
    )
    depths: Depths | None = Field(
        default=None, description="an uneven bed (bathymetry): depths on a grid; absent: a plane"
    )
    stiffness: Positive | None = Field(
        default=None,
        description="force per metre of cable and metre of penetration; either this or soil is given [N/m per m]",
    )
    soil: Soil | None = Field(
        default=None,
        description="instead of stiffness: clay that remembers how deep the cable was, and holds it by suction",
    )
    damping: NonNegative = Field(
        default=0.0, description="force per metre of cable and speed of penetration, in contact [N s/m per m]"
    )
    friction: Annotated[Friction, PlainNumber(("axial", "lateral"))] | None = Field(
        default=None,
        description="friction on the bed (Coulomb, mu); a plain number means axial and lateral; absent: none",
    )

    def height(self, x: float, y: float) -> float:
        """Height of the bed [m] at x, y [m]."""
        if self.depths is not None:
            return self.z - self.depths.surface.depth_at(x, y)[0]
        rise_x, rise_y = self.slope or (0.0, 0.0)
        return self.z + rise_x * x + rise_y * y

    def rise(self, x: float, y: float) -> tuple[float, float]:
        """How steeply the bed rises along x and y, at x, y [m]."""
        if self.depths is not None:
            _, down_x, down_y = self.depths.surface.depth_at(x, y)
            return -down_x, -down_y
        return self.slope or (0.0, 0.0)

    @property
    def is_level(self) -> bool:
        """Whether the bed is as high everywhere."""
        return self.depths is None and not any(self.slope or ())

    @property
    def spring(self) -> float:
        """Its stiffness, of soil that of unloading [N/m per m]."""
        if self.soil is not None:
            return self.soil.steepest
        assert self.stiffness is not None
        return self.stiffness

    def _check_one_resistance(self) -> Findings:
        if self.stiffness is None and self.soil is None:
            yield [Finding(("stiffness",), "a number > 0, in N/m per m", "add `stiffness: ...`, or soil")]
        for key in ("stiffness", "damping") if self.soil is not None else ():
            if getattr(self, key):
                yield [Finding((key,), "nothing, because soil says how the bed resists", f"leave {key} or soil out")]
        travel = self.friction.travel if self.friction is not None else None
        if self.soil is not None and self.soil.lateral is not None and travel is None:
            expected = "a table with `travel`, over which lateral resistance grows"
            fix = "add `friction: {axial: ..., lateral: ..., travel: ...}` (m)"
            yield [Finding(("friction",), expected, fix)]

    def _check_one_shape(self) -> Findings:
        if self.slope is not None and self.depths is not None:
            yield [Finding(("slope",), "nothing, because depths give the shape of the bed", "leave one of them out")]
