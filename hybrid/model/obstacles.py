"""Obstacles of a scene as numbers: where they are, and how stiff."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hybrid.errors import SceneError
from hybrid.kernels.state.report import (
    ALONG,
    AXIS,
    BEARING,
    BEGAN,
    BEHIND,
    BOX,
    BOX_ROW,
    CARRIED,
    DAMPING,
    FACET,
    FEATURE,
    FEATURES,
    FIRST_CORNER,
    FIXED,
    FLAT,
    FREE,
    FRICTION,
    GROOVE,
    HALF_HEIGHT,
    HALF_LENGTH,
    HIGHEST,
    INERTIA,
    KIND,
    LEAF,
    LOWEST,
    MEETS_FROM,
    MEETS_TO,
    MESH,
    MOVES,
    MU,
    NO_BOXES,
    NO_FACETS,
    NORMAL,
    OBSTACLE,
    OBSTACLES,
    OFFSET,
    ONSET_OF,
    PLACE,
    RADIUS,
    RAMP,
    RATE,
    RIDES,
    RIM,
    RING,
    ROOT,
    ROUND,
    SHEAVE,
    SIDE,
    SLIP,
    STIFFNESS,
    STILL_AXIS,
    STILL_SIDE,
    STRAND,
    SWEEP,
    TORUS,
    TURNED,
    TURNS,
)
from hybrid.kernels.state.state import NO_CARRIED, NO_MOVES, NO_OBSTACLES, Floats, Moves
from hybrid.model.ends import PATH, DrivenEnd, Motion, table_of_motions
from hybrid.model.payout import longest_out, whole_scene, winch_side
from hybrid.model.sections import merged_sections, tension_scale
from hybrid.scene.analysis import Straight
from hybrid.scene.base import unit
from hybrid.scene.bodies import Carried, CarriedBox, CarriedCylinder
from hybrid.scene.motion import Elevation, EndMotion
from hybrid.scene.obstacles import (
    BoxObstacle,
    CylinderObstacle,
    Mesh,
    MeshObstacle,
    Obstacle,
    PlaneObstacle,
    SheaveObstacle,
    SphereObstacle,
    TorusObstacle,
    read_mesh,
)
from hybrid.scene.schema import LineScene, reachable_obstacles

# Parts of the diameter of a line.
DEPTH = 0.02  # how deep it lies in an obstacle under what the scene asks for, where it follows its radius,
DEPTH_AT_POINT = 0.05  # and where it touches it at a point
DEPTH_AT_IMPACT = 0.125  # how deep it goes where it hits one
ONSET = 0.01  # of contact
TRAVEL = 0.01  # elastic, of friction
# Cells to the radius of an obstacle where the program places them, and the most cells that this makes of a line.
CELLS_PER_RADIUS, MOST_CELLS = 4.0, 2000


def obstacle_bits(scene: LineScene) -> int:
    """Bits of kernels.state.report that the obstacles ask for which the line of a scene may touch."""
    touched = reachable_obstacles(scene)
    if not touched:
        return 0
    return OBSTACLES | (FRICTION if any(x.friction for x in touched.values()) else 0)


def kind_of(obstacle: Obstacle) -> int:
    """Of an obstacle in `Line.moved`: whether it moves, or turns freely."""
    if getattr(obstacle, "bearing", None) is not None:
        return FREE
    return MOVES if obstacle.moves else FIXED


def strand_radius(scene: LineScene) -> float:
    """Radius of the line that touches obstacles, where it is thickest, on the reel from which it is paid out too, m."""
    return 0.5 * max(x.diameter or 0.0 for x in whole_scene(scene)[0].cable.sections)


def _pieces(scene: LineScene) -> Floats:
    """Of a line of several diameters, what rows have behind their OBSTACLE columns; of others nothing."""
    whole, begin = whole_scene(scene)
    sections = whole.cable.sections
    radii = np.array([0.5 * (x.diameter or 0.0) for x in sections])
    if (radii == radii[0]).all():
        return np.zeros(0)
    ends = begin + np.cumsum([x.length for x in sections])
    return np.column_stack([ends, radii.max() - radii]).ravel()


def pull_on_obstacles(scene: LineScene) -> float:
    """The tension, N, with which a line of a scene lies on obstacles; of one that is paid out, when it is longest."""
    pull = tension_scale(scene, merged_sections(scene.cable.sections), False)
    longer = longest_out(scene)
    if longer > scene.length:
        whole, _ = whole_scene(scene)
        left, sections = longer, []
        for x in whole.cable.sections[:: 1 if winch_side(scene) else -1]:
            if left > 0.0:
                sections.append(x.model_copy(update={"length": min(x.length, left)}))
            left -= x.length
        pull = max(pull, tension_scale(scene, merged_sections(sections), False))
    return pull


def stiffness_at_impact(mass: float, speed: float, diameter: float) -> float:
    """Stiffness (N/m per m) of an obstacle that a line of a mass (kg/m) and diameter (m) hits at a speed (m/s).

    A line that is stopped as a whole goes p = v sqrt(m/k) deep, as m v^2/2 = k p^2/2.  So does one that is stopped at a
    point: its kinks run on at sqrt(T/m), which presses 2 v sqrt(T m) on a bed of 2 sqrt(k T) N/m, whatever T is.
    """
    return mass * (speed / (DEPTH_AT_IMPACT * diameter)) ** 2


def obstacle_rows(scene: LineScene, pull: float | None = None) -> Floats:
    """(M, OBSTACLE) of the obstacles of a scene, in its order, as kernels.laws.obstacles has them.

    pull: N, tension with which the line lies on them; None: what the scene asks for.
    """
    if not scene.obstacles:
        return NO_OBSTACLES
    pieces = _pieces(scene)
    rows = np.zeros((len(scene.obstacles), OBSTACLE + pieces.size))
    rows[:, OBSTACLE:] = pieces
    strand = strand_radius(scene)
    sections = whole_scene(scene)[0].cable.sections
    least = 0.5 * min(x.diameter or 0.0 for x in sections)  # by which how hard an obstacle is goes
    mass = max(x.mass for x in sections)
    weight = mass * (scene.environment.gravity or 1.0)
    velocity = scene.initial.velocity if isinstance(scene.initial, Straight) else None
    at_impact = stiffness_at_impact(mass, float(np.linalg.norm(velocity or 0.0)), 2.0 * least)
    pull = pull_on_obstacles(scene) if pull is None else pull
    first = facet_tables(scene.obstacles)[2]
    for row, (name, x) in zip(rows, scene.obstacles.items(), strict=True):
        row[PLACE : PLACE + 3], row[STRAND] = x.at, strand
        row[RADIUS] = strand if isinstance(x, MeshObstacle) else bend_radius(x) + strand
        over = scene.length if isinstance(x, PlaneObstacle) else bend_radius(x) + strand
        _put_shape(row, x, strand)
        row[ROOT] = first.get(name, 0)
        # a string under a tension T that half of T presses on a point of a bed of stiffness k: T/2 = 2 sqrt(k T) depth
        at_point = pull / (4.0 * 2.0 * DEPTH_AT_POINT * least) ** 2
        stiffness = max((weight + pull / over) / (2.0 * DEPTH * least), at_point, at_impact)
        row[MU], row[STIFFNESS], row[DAMPING] = x.friction, x.stiffness or stiffness, x.damping
        row[ONSET_OF], row[SLIP] = 2.0 * ONSET * least, 2.0 * TRAVEL * least
    return rows


def bend_radius(x: Obstacle) -> float:
    """Radius, m, to which an obstacle bends a line that lies on it, without that of the line; of a plane 0."""
    if isinstance(x, PlaneObstacle):
        return 0.0
    if isinstance(x, MeshObstacle):
        return facets_of(x).rounding
    return x.rounding if isinstance(x, BoxObstacle) else x.radius


def _put_shape(row: Floats, x: Obstacle, strand: float) -> None:
    """What the surface of an obstacle is into its row, but for its radius; strand: m, radius of the line."""
    if isinstance(x, PlaneObstacle):
        row[KIND], row[AXIS : AXIS + 3] = FLAT, unit(x.normal)
        return
    if isinstance(x, SphereObstacle):
        row[KIND], row[AXIS : AXIS + 3] = ROUND, (0.0, 0.0, 1.0)
        return
    if isinstance(x, MeshObstacle):
        row[KIND], row[HALF_LENGTH : HALF_HEIGHT + 1] = MESH, facets_of(x).half_thickness
        row[RING] = facets_of(x).rounding
        row[AXIS : AXIS + 3], row[SIDE : SIDE + 3], _ = x.axes
        return
    if isinstance(x, BoxObstacle):
        row[KIND], row[HALF_LENGTH : HALF_HEIGHT + 1] = BOX, x.halves
        row[AXIS : AXIS + 3], row[SIDE : SIDE + 3], _ = x.axes
        return
    row[AXIS : AXIS + 3] = axis = unit(x.axis)
    if isinstance(x, CylinderObstacle):
        row[KIND], row[HALF_LENGTH] = ROUND, math.inf if x.length is None else 0.5 * x.length
        return
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    row[SIDE : SIDE + 3] = side / np.linalg.norm(side)
    if isinstance(x, TorusObstacle):
        row[KIND], row[RING] = TORUS, x.ring
    elif isinstance(x, SheaveObstacle):
        row[KIND], row[RING], row[GROOVE], row[RIM] = SHEAVE, x.radius + x.groove, x.groove - strand, x.rim + strand


def least_cells(scene: LineScene) -> float:
    """Cells that a line has at least whose cells follow the radii of obstacles."""
    round_ = [x for x in reachable_obstacles(scene).values() if not isinstance(x, PlaneObstacle)]
    radii = [bend_radius(x) + strand_radius(scene) for x in round_]
    return min(CELLS_PER_RADIUS * scene.length / min(radii), MOST_CELLS) if radii else 0.0


# How obstacles of a scene move, as arrays for kernels.laws.obstacles, and those that are set from outside.


class Courses(NamedTuple):
    """How obstacles move: Sea.courses and Sea.carried, and those that are set from outside, by name."""

    moves: Moves
    carried: Floats
    driven: dict[str, DrivenEnd]


def courses_of(scene: LineScene, rows: Floats, waves: Floats, ramp: float, elevation: Elevation) -> Courses:
    """How the obstacles of a scene move; rows: (M, OBSTACLE) of them at t = 0.

    waves: as of `Surroundings.waves_of_vessels`, ramp: s, over which they grow; elevation: of the surface, as of
    scene.motion.EndMotion.
    """
    if not any(x.moves for x in scene.obstacles.values()):
        return Courses(NO_MOVES, NO_CARRIED, {})
    count, still = len(scene.obstacles), np.eye(3)
    position, frame = np.array([x.at for x in scene.obstacles.values()], float), np.tile(still.ravel(), (count, 1))
    carried, paths = np.zeros((count, CARRIED)), np.zeros((count, PATH))
    carried[:, STILL_AXIS : STILL_AXIS + 3], carried[:, TURNED : TURNED + 9] = rows[:, AXIS : AXIS + 3], frame
    carried[:, STILL_SIDE : STILL_SIDE + 3] = rows[:, SIDE : SIDE + 3]
    motions: dict[int, Motion | DrivenEnd] = {}
    driven = {}
    carried[:, MEETS_FROM], carried[:, MEETS_TO] = -np.inf, -np.inf
    for k, (name, x) in enumerate(scene.obstacles.items()):
        if isinstance(x, Carried):
            position[k], frame[k] = x.origin, np.array(x.body_axes).T.ravel()
            carried[k, OFFSET : OFFSET + 3], carried[k, RIDES] = x.place, 1.0
            carried[k, BEGAN:SWEEP], carried[k, TURNED : TURNED + 9] = [*x.origin, *x.origin], frame[k]
            carried[k, STILL_AXIS : STILL_AXIS + 3] = x.own_axis if isinstance(x, CarriedCylinder) else (0.0, 0.0, 1.0)
            if isinstance(x, CarriedBox):
                carried[k, STILL_AXIS : STILL_AXIS + 3], carried[k, STILL_SIDE : STILL_SIDE + 3], _ = x.own_axes
            carried[k, SWEEP : SWEEP + 9] = still.ravel()
        elif x.from_outside:
            motions[k] = driven[name] = DrivenEnd(paths[k], position[k], frame[k], True, True)
        elif x.motion is not None:
            try:
                motions[k] = EndMotion(x.motion, x.at, still, elevation, (waves, ramp, True))
            except SceneError as error:
                raise SceneError(
                    [replace(each, where=f"obstacles.{name}.{each.where}") for each in error.complaints]
                ) from None
        spin = getattr(x, "spin", None)
        if spin is not None:
            carried[k, RATE], carried[k, RAMP] = spin.rate, spin.ramp
        bearing = getattr(x, "bearing", None)
        if bearing is not None:
            carried[k, INERTIA], carried[k, BEARING] = bearing.inertia, bearing.damping
    return Courses(table_of_motions(motions, position, frame, paths, frame), carried, driven)


# Surfaces of triangles of obstacles as arrays for kernels.laws.surfaces: normals of their features, a tree of boxes.

FLAT_EDGE = 1e-5  # rad; what turns by less at an edge is flat, as coordinates of single precision are
STRAIGHT = 1e-4  # rad; edges whose directions differ by less are one
SHARP = np.radians(40.0)  # what turns by more is a sharp edge, not a part of something round


class Facets(NamedTuple):
    """A surface of triangles: boxes (B, BOX_ROW) and facets (F, FACET).

    rounding: m, smallest radius, 0 where an edge is sharp; then half of its mean thickness (volume over surface), m.
    """

    boxes: Floats
    facets: Floats
    rounding: float
    half_thickness: float


def facets_of(x: MeshObstacle) -> Facets:
    """The surface of an obstacle in axes of its own, m."""
    return _facets(*_key(x))


def facet_tables(obstacles: Mapping[str, Obstacle]) -> tuple[Floats, Floats, dict[str, int]]:
    """Sea.boxes and Sea.facets of all obstacles, and the first row of boxes of each that has some, by name."""
    meshes = {name: x for name, x in obstacles.items() if isinstance(x, MeshObstacle)}
    if not meshes:
        return NO_BOXES, NO_FACETS, {}
    boxes, facets, first = _joined(tuple(_key(x) for x in meshes.values()))
    return boxes, facets, dict(zip(meshes, first, strict=True))


Key = tuple[str, float, int, int]


def _key(x: MeshObstacle) -> Key:
    status = os.stat(x.file)
    return x.file, x.scale, status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8)
def _facets(path: str, scale: float, _changed: int, _size: int) -> Facets:
    mesh = read_mesh(path)
    return surface_of(Mesh(scale * mesh.points, mesh.triangles))


@lru_cache(maxsize=4)
def _joined(keys: tuple[Key, ...]) -> tuple[Floats, Floats, tuple[int, ...]]:
    """Surfaces one behind the other; the arrays are shared by all lines."""
    boxes, facets, first, row, facet = [], [], [], 0, 0
    for each in (_facets(*key) for key in keys):
        moved = each.boxes.copy()
        moved[:, BEHIND] += row
        moved[moved[:, LEAF] >= 0.0, LEAF] += facet
        boxes.append(moved)
        facets.append(each.facets)
        first.append(row)
        row, facet = row + len(moved), facet + len(each.facets)
    return np.concatenate(boxes), np.concatenate(facets), tuple(first)


def surface_of(mesh: Mesh) -> Facets:
    """The arrays of a surface, m."""
    x = mesh.points[mesh.triangles]
    sides = x[:, [1, 2, 0]] - x
    length = np.linalg.norm(sides, axis=2)
    across = np.cross(sides[:, 0], sides[:, 1])
    area = 0.5 * np.linalg.norm(across, axis=1)
    n = 0.5 * across / area[:, None]
    other, turn = _beside(mesh.triangles, n)
    along = sides / length[..., None]
    rows = np.zeros((len(x), FACET))
    rows[:, :NORMAL], rows[:, NORMAL : NORMAL + 3] = x.reshape(-1, 9), n
    features = rows[:, FEATURES:].reshape(-1, 6, FEATURE)
    features[:, :FIRST_CORNER, :TURNS] = _unit(n[:, None] + n[other], n[:, None])
    features[:, :FIRST_CORNER, TURNS] = turn > FLAT_EDGE
    features[:, :FIRST_CORNER, ALONG:] = along
    _put_corners(features[:, FIRST_CORNER:], mesh, n, along, turn > FLAT_EDGE)
    middle = x[:, 0] - 0.5 * (x.min(axis=(0, 1)) + x.max(axis=(0, 1)))
    volume = float(np.einsum("i,ij,ij->", area, middle, n)) / 3.0
    # between the middles of the circles through the corners of two triangles, what is round turns by its radius; where
    # triangles are so long that these tell nothing, between their centres
    opposite = -np.einsum("fki,fki->fk", sides[:, [1, 2, 0]], sides[:, [2, 0, 1]]) * length / (4.0 * area[:, None])
    height = 2.0 * area[:, None] / (3.0 * length)
    apart = [x + _of_other(x, mesh.triangles, other) for x in (opposite, height)]
    convex = np.einsum("fki,fi->fk", x[other].mean(axis=2) - x, n) < 0.0
    radius = np.where(turn > SHARP, 0.0, np.maximum(*apart) / np.maximum(turn, FLAT_EDGE))
    rounding = radius[convex].min(initial=np.inf)
    return Facets(_tree(x), rows, float(rounding), volume / float(area.sum()))


def _beside(triangles: np.ndarray, n: Floats) -> tuple[np.ndarray, Floats]:
    """The triangle (F, 3) across each edge, and by how much, rad, the surface turns there."""
    begin, end = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    size = int(triangles.max()) + 1
    order = np.argsort(begin * size + end)
    other = order[np.searchsorted((begin * size + end)[order], end * size + begin)].reshape(-1, 3) // 3
    turned = np.linalg.norm(np.cross(n[:, None], n[other]), axis=2)
    return other, np.arctan2(turned, np.einsum("fi,fki->fk", n, n[other]))


def _of_other(values: Floats, triangles: np.ndarray, other: np.ndarray) -> Floats:
    """What (F, 3) the triangles across edges have of a value (F, 3) at these edges."""
    same = (triangles[other] == triangles[:, [1, 2, 0], None]).argmax(axis=2)  # where the edge begins there
    return np.asarray(values[other, same])


def _unit(x: Floats, otherwise: Floats) -> Floats:
    """Unit vectors of x; of those without a length another."""
    size = np.linalg.norm(x, axis=-1, keepdims=True)
    return np.asarray(np.where(size > 1e-9, x / np.maximum(size, 1e-9), otherwise))


def _put_corners(features: Floats, mesh: Mesh, n: Floats, along: Floats, turns: np.ndarray) -> None:
    """Features (F, 3, FEATURE) of corners: all facets around one have the same."""
    count, of = len(mesh.points), mesh.triangles
    before = np.roll(along, 1, axis=1)
    angle = np.arctan2(np.linalg.norm(np.cross(along, before), axis=2), -np.einsum("fki,fki->fk", along, before))
    normal = np.zeros((count, 3))
    np.add.at(normal, of, angle[..., None] * n[:, None])
    # each edge once from either end, in the triangle that it goes along; those at which the surface turns
    edges, least, most = np.zeros(count), np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.add.at(edges, of[turns], 1.0)
    reference = np.zeros((count, 3))
    reference[of[turns]] = along[turns]  # of any of them
    aligned = np.cross(along, reference[of])
    np.minimum.at(least, of[turns], aligned[turns])
    np.maximum.at(most, of[turns], aligned[turns])
    straight = (edges == 2.0) & (np.maximum(np.abs(least), np.abs(most)).max(axis=1) < STRAIGHT)
    features[..., :TURNS] = _unit(normal, np.zeros((count, 3)))[of]
    features[..., TURNS] = (edges > 0.0)[of]
    features[..., ALONG:] = np.where(straight[:, None], reference, 0.0)[of]


def _tree(x: Floats) -> Floats:
    """Boxes over triangles x (F, 3, 3), halved along their longest side down to one triangle each."""
    low, high, middle = x.min(axis=1), x.max(axis=1), x.mean(axis=1)
    boxes = np.zeros((2 * len(x) - 1, BOX_ROW))
    waiting = [np.arange(len(x))]
    for row, box in enumerate(boxes):
        held = waiting.pop()
        box[LOWEST:HIGHEST], box[HIGHEST:BEHIND] = low[held].min(axis=0), high[held].max(axis=0)
        box[BEHIND], box[LEAF] = row + 2 * held.size - 1, held[0] if held.size == 1 else -1.0
        if held.size > 1:
            order = held[np.argsort(middle[held, int(np.argmax(np.ptp(middle[held], axis=0)))], kind="stable")]
            waiting += [order[held.size // 2 :], order[: held.size // 2]]
    return boxes
