"""Obstacles that a line touches, fixed or moving, by name: planes, spheres, cylinders, boxes, tori, sheaves, meshes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from operator import mul
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hybrid.scene.base import (
    Before,
    Direction,
    Finding,
    Findings,
    Kinds,
    NonNegative,
    Number,
    Positive,
    Table,
    Text,
    Vector,
    Words,
    numbers,
    turned,
    unit,
)
from hybrid.scene.ends import Name
from hybrid.scene.motion_file import LARGEST, RecordRefused, read_once, unreadable
from hybrid.scene.motion_tables import Motion

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

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

    def _check_moves_once(self) -> Findings:
        if self.from_outside and self.motion is not None:
            fix = "leave out the one or the other"
            yield [Finding(("motion",), "nothing, because the obstacle is set from outside", fix)]

    def distance(self, x: tuple[float, float, float]) -> float:
        """Distance [m] of a place to the surface; negative within the solid."""
        raise NotImplementedError

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
        return sum(n * (a - b) for n, a, b in zip(unit(self.normal), x, self.at, strict=True))


class SphereObstacle(_Obstacle):
    """A ball."""

    kind: Literal["sphere"] = Field(default="sphere", description="a ball")
    at: Vector = Field(description="its centre, inertial frame [m]")
    radius: Positive = Field(description="radius [m]")

    def distance(self, x: tuple[float, float, float]) -> float:
        return math.dist(x, self.at) - self.radius


class _Turning(_Obstacle):
    """What those have that turn about an axis of their own."""

    spin: Spin | None = Field(
        default=None, description="how it turns about its axis, as a driven roller; absent: not at all"
    )

    bearing: Bearing | None = Field(
        default=None, description="inertia and bearing with which it turns freely, as a sheave; absent: not at all"
    )

    def _check_turns_once(self) -> Findings:
        if self.spin is not None and self.bearing is not None:
            yield [Finding(("bearing",), "nothing, because the spin is given", "leave out the one or the other")]


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

    def _check_is_round_within_its_size(self) -> Findings:
        yield rounded_within(self.size, self.rounding)

    @property
    def halves(self) -> tuple[float, float, float]:
        """Half lengths [m] of its flat faces."""
        x, y, z = (0.5 * a - self.rounding for a in self.size)
        return x, y, z

    def distance(self, x: tuple[float, float, float]) -> float:
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

    def _check_has_a_hole(self) -> Findings:
        if self.radius >= self.ring:
            expected = f"less than the radius of the ring, {self.ring:g} m"
            yield [Finding(("radius",), expected, "a larger `ring`, or a sphere", f"{self.radius:g}")]

    def distance(self, x: tuple[float, float, float]) -> float:
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
        away, along = _about(x, self.at, self.axis)
        out, along = away - self.radius - self.groove, abs(along)
        if out > 0.0:
            return math.hypot(out, along - self.groove - self.rim) - self.rim
        return max(self.groove - math.hypot(out, along), along - self.groove - 2.0 * self.rim)


# Surfaces of triangles from STL files (text and binary) and OBJ files, checked to be closed and turned outwards.

WHAT, REPAIR = "an STL or OBJ file", "repair the mesh in the program that wrote it"
# Facets that a scene can do with; of its longest edge, how high a triangle is at least whose normal can be told.
MOST_FACETS, FLATTEST = 200_000, 1e-6
# Of a binary STL file: bytes before the facets, and of each.
HEADER, RECORD = 84, 50


class Mesh(NamedTuple):
    """A closed surface: places (V, 3) in units of the file, and triangles (F, 3) of them, turned outwards.

    Fans of triangles that touch at a place only have a corner each there.
    """

    points: Array
    triangles: Whole


class _Soup(NamedTuple):
    """Triangles as a file has them: corners (F, 3, 3), and where each stands in the file."""

    name: str
    corners: Array
    lines: list[int]  # empty: of a binary file

    def place(self, k: int) -> str:
        """Where facet k is: number, line, middle."""
        x, y, z = self.corners[k].mean(axis=0)
        line = f", line {self.lines[k]}" if self.lines else ""
        return f"{self.name}, facet {k + 1}{line} (near {x:.6g}, {y:.6g}, {z:.6g})"


@read_once(8, WHAT)
def read_mesh(path: str) -> Mesh:
    """The surface of a file; RecordRefused says what is wrong with it, and where."""
    name, suffix = Path(path).name, Path(path).suffix.lower()
    if suffix not in (".stl", ".obj"):
        raise RecordRefused(WHAT, "name it *.stl or *.obj as what it is", name)
    try:
        data = Path(path).read_bytes()
    except OSError:
        raise RecordRefused(WHAT, "check the path", f"{path}, which cannot be read") from None
    size = len(data)
    if suffix == ".obj":
        soup = _from_obj(name, data.decode("utf-8-sig", "replace").splitlines())
    elif size >= HEADER and size == HEADER + RECORD * int.from_bytes(data[80:HEADER], "little"):
        soup = _from_binary(name, data)
    elif data.lstrip()[:5].lower() == b"solid":
        soup = _from_text(name, data.decode("utf-8-sig", "replace").splitlines())
    else:
        given = f"{name}, {size} bytes"
        if size >= HEADER:
            facets = int.from_bytes(data[80:HEADER], "little")
            given = f"{given}, where {facets} facets would take {HEADER + RECORD * facets}"
        raise RecordRefused("an STL file, text that begins with solid or binary", "write it anew", given)
    if not len(soup.corners):
        raise RecordRefused("at least 4 triangles", "export the surface, not the curves", f"{name}, which has none")
    if len(soup.corners) > MOST_FACETS:
        given = f"{name}, {len(soup.corners)} facets"
        raise RecordRefused(f"at most {MOST_FACETS} facets", "decimate the mesh to what a line can feel", given)
    return _closed(soup)


def _numbers(name: str, line: int, words: list[str]) -> tuple[float, ...]:
    """Three coordinates of a line."""
    try:
        found = tuple(float(x) for x in words[:3])
    except ValueError:
        found = ()
    if len(found) < 3:
        given = f"{name}, line {line}: {' '.join(words)[:60]!r}"
        raise RecordRefused("three coordinates", "write them as 1.5 -2e-3 0", given)
    return found


def _from_binary(name: str, data: bytes) -> _Soup:
    """Facets of a binary STL file: normal, three corners, two bytes more, each."""
    records = np.frombuffer(data[HEADER:], dtype=np.dtype([("x", "<f4", (4, 3)), ("more", "<u2")]))
    return _Soup(name, np.asarray(records["x"][:, 1:], float), [])


def _from_text(name: str, rows: list[str]) -> _Soup:
    """Facets of an STL file as text: corners between `outer loop` and `endloop`."""
    corners: list[tuple[float, ...]] = []
    lines: list[int] = []
    begun = 0
    for k, row in enumerate(rows, start=1):
        words = row.split()
        key = words[0].lower() if words else ""
        if key == "facet":
            if begun:
                raise RecordRefused("endfacet before the next facet", REPAIR, f"{name}, line {k}")
            begun = k
            lines.append(k)
        elif key == "vertex":
            corners.append(_numbers(name, k, words[1:]))
        elif key == "endfacet":
            if len(corners) != 3 * len(lines) or not begun:
                raise RecordRefused("three lines `vertex x y z` in a facet", REPAIR, f"{name}, line {begun or k}")
            begun = 0
    if begun:
        raise RecordRefused("endfacet", "the file is cut off: write it anew", f"{name}, line {begun}")
    return _Soup(name, np.array(corners, float).reshape(-1, 3, 3), lines)


def _from_obj(name: str, rows: list[str]) -> _Soup:
    """Triangles of an OBJ file; polygons with more corners as fans from their first."""
    places: list[tuple[float, ...]] = []
    found: list[tuple[int, int, int]] = []
    lines: list[int] = []
    for k, row in enumerate(rows, start=1):
        words = row.partition("#")[0].split()
        if not words or words[0] not in ("v", "f"):
            continue
        if words[0] == "v":
            places.append(_numbers(name, k, words[1:]))
            continue
        at = []
        for word in words[1:]:
            number = int(x) if re.fullmatch(r"-?\d{1,9}", x := word.partition("/")[0]) else 0
            number += len(places) if number < 0 else -1
            if not 0 <= number < len(places):
                given = f"{name}, line {k}: {word[:30]!r}"
                expected = f"the number of one of the {len(places)} places before, from 1, or from -1 back"
                raise RecordRefused(expected, "write v before f", given)
            at.append(number)
        if len(at) < 3:
            raise RecordRefused("at least three corners", REPAIR, f"{name}, line {k}: {row.strip()[:60]!r}")
        found += [(at[0], at[j], at[j + 1]) for j in range(1, len(at) - 1)]
        lines += [k] * (len(at) - 2)
    corners = np.array(places, float).reshape(-1, 3)[np.array(found, int).reshape(-1, 3)]
    return _Soup(name, corners, lines)


def _closed(soup: _Soup) -> Mesh:
    """The surface that triangles make: each edge between two of them, turned alike, and all of them outwards."""
    for k in np.flatnonzero(~(np.abs(soup.corners) <= LARGEST).all(axis=(1, 2)))[:1]:
        raise RecordRefused(f"coordinates up to {LARGEST:g}", REPAIR, soup.place(k))
    points, of = np.unique(soup.corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    triangles = of.reshape(-1, 3)
    whole = np.array([triangles[:, k] != triangles[:, (k + 1) % 3] for k in range(3)]).all(axis=0)
    kept = np.flatnonzero(whole)  # one with two corners in a place has no surface, and its neighbours meet without it
    triangles, x = triangles[kept], points[triangles[kept]]
    sides = x[:, [1, 2, 0]] - x
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    height = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / longest
    for k in np.flatnonzero(height < FLATTEST * longest)[:1]:
        given = f"{soup.place(kept[k])}: {height[k]:.2g} high over an edge of {longest[k]:.4g}"
        raise RecordRefused(f"triangles at least {FLATTEST:g} of their longest edge high", REPAIR, given)
    if not len(triangles):
        raise RecordRefused("at least 4 triangles", REPAIR, f"{soup.name}, which has none with an area")
    other = _across(soup, triangles, kept)
    _refuse_inside_out(soup, x, other, kept)
    return _with_fans(points, triangles, other)


def _across(soup: _Soup, triangles: Whole, kept: Whole) -> Whole:
    """The triangle (F, 3) on the other side of each edge, from corner k to k + 1; RecordRefused where it is not one."""
    begin, end = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    size, facet = int(triangles.max()) + 1, np.repeat(np.arange(len(triangles)), 3)
    there, back = begin * size + end, end * size + begin
    order = np.argsort(there, kind="stable")
    rising = there[order]
    twice = np.flatnonzero(np.diff(rising) == 0)
    if twice.size:
        a, b = sorted(facet[order[twice[0] : twice[0] + 2]].tolist())
        expected = "triangles that all go counter-clockwise around their outside, two at every edge"
        fix = "make the normals of the mesh consistent, and leave out triangles that are there twice"
        given = f"{soup.place(kept[b])}, which goes along an edge in the same direction as facet {kept[a] + 1}"
        raise RecordRefused(expected, fix, given)
    at = np.minimum(np.searchsorted(rising, back), rising.size - 1)
    open_ = np.flatnonzero(rising[at] != back)
    if open_.size:
        k = int(open_[0])
        a, b = (", ".join(f"{c:.6g}" for c in soup.corners[kept[facet[k]], j % 3]) for j in (k % 3, k % 3 + 1))
        given = f"{soup.place(kept[facet[k]])}: nothing beside its edge from ({a}) to ({b}); {open_.size} such edges"
        fix = "close the hole, or merge places that should be one; give a sheet its thickness"
        raise RecordRefused("a closed surface", fix, given)
    return np.asarray(facet[order[at]]).reshape(-1, 3)


def _refuse_inside_out(soup: _Soup, x: Array, other: Whole, kept: Whole) -> None:
    """RecordRefused: a shell whose inside is its front, and which is no hollow of another; x: (F, 3, 3)."""
    count, shell = _parts(len(x), np.repeat(np.arange(len(x)), 3), other.ravel())
    p, q, r = np.moveaxis(x - 0.5 * (x.min(axis=(0, 1)) + x.max(axis=(0, 1))), 1, 0)
    volume = np.bincount(shell, np.einsum("ij,ij->i", p, np.cross(q, r)) / 6.0, count)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, shell, x.min(axis=1))
    np.maximum.at(high, shell, x.max(axis=1))
    for k in np.flatnonzero(volume <= 0.0).tolist():
        around = (volume > -volume[k]) & (low <= low[k]).all(axis=1) & (high >= high[k]).all(axis=1)
        if not (volume[k] < 0.0 and around.any()):
            given = f"{soup.place(kept[int(np.argmax(shell == k))])}, on a shell whose volume is {volume[k]:.4g}"
            expected = "triangles that go counter-clockwise seen from outside"
            raise RecordRefused(expected, "turn the surface over (flip its normals)", given)


def _parts(count: int, a: Whole, b: Whole) -> tuple[int, Whole]:
    """Into how many parts pairs (a, b) of `count` things connect them, and the part (count,) of each."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    found = connected_components(coo_array((np.ones(a.size), (a, b)), (count, count)), directed=False)
    return int(found[0]), np.asarray(found[1])


def _with_fans(points: Array, triangles: Whole, other: Whole) -> Mesh:
    """The surface with a place for each fan of triangles around one."""
    corner = (triangles[other] == triangles[..., None]).argmax(axis=2)  # the same place in the triangle across
    here = np.arange(3 * len(triangles))
    fan = _parts(here.size, here, (3 * other + corner).ravel())[1]
    first = np.unique(fan, return_index=True)[1]
    return Mesh(points[triangles.ravel()[first]], fan.reshape(-1, 3).astype(np.int64))


def distance_to(mesh: Mesh, x: tuple[float, float, float]) -> float:
    """Distance of a place to a surface, negative within, in units of the file.

    All triangles are looked at, and the solid angles under which they are seen tell what is within.
    """
    corners = np.moveaxis(mesh.points[mesh.triangles] - np.array(x), 1, 0)
    sides = [(corners[k], corners[(k + 1) % 3] - corners[k]) for k in range(3)]
    n = np.cross(sides[0][1], sides[1][1])
    n /= np.linalg.norm(n, axis=1)[:, None]
    height = _dots(corners[0], n)
    within = np.all([_dots(np.cross(side, height[:, None] * n - p), n) >= 0.0 for p, side in sides], axis=0)
    least = np.where(within, np.abs(height), np.inf)
    for p, side in sides:
        part = np.clip(-_dots(p, side) / _dots(side, side), 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(p + part[:, None] * side, axis=1))
    a, b, c = corners
    la, lb, lc = np.linalg.norm(corners, axis=2)
    over = la * lb * lc + _dots(a, b) * lc + _dots(b, c) * la + _dots(c, a) * lb
    half_angle = np.arctan2(_dots(a, np.cross(b, c)), over).sum()  # of what is seen of it: 2 pi within
    return float(-least.min() if half_angle > np.pi else least.min())


def _dots(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", a, b))


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

    def _check_readable(self) -> Findings:
        return unreadable(self.file, lambda: read_mesh(self.file), WHAT)

    def distance(self, x: tuple[float, float, float]) -> float:
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
    PlaneObstacle | SphereObstacle | CylinderObstacle | BoxObstacle | TorusObstacle | SheaveObstacle | MeshObstacle,
    Kinds(
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
