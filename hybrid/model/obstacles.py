"""Obstacles of a scene as numbers: where they are, and how stiff."""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.state.forces import FRICTION, OBSTACLES
from hybrid.kernels.state.obstacle_rows import (
    AXIS,
    BOX,
    DAMPING,
    FIXED,
    FLAT,
    FREE,
    GROOVE,
    HALF_HEIGHT,
    HALF_LENGTH,
    KIND,
    MESH,
    MOVES,
    MU,
    OBSTACLE,
    ONSET_OF,
    PLACE,
    RADIUS,
    RIM,
    RING,
    ROOT,
    ROUND,
    SHEAVE,
    SIDE,
    SLIP,
    STIFFNESS,
    STRAND,
    TORUS,
)
from hybrid.kernels.state.state import NO_OBSTACLES, Floats
from hybrid.model.facets import facet_tables, facets_of
from hybrid.model.payout import longest_out, whole_scene, winch_side
from hybrid.model.scales import tension_scale
from hybrid.model.sections import merged_sections
from hybrid.scene.analysis import Straight
from hybrid.scene.base import unit
from hybrid.scene.obstacles import (
    BoxObstacle,
    CylinderObstacle,
    MeshObstacle,
    Obstacle,
    PlaneObstacle,
    SheaveObstacle,
    SphereObstacle,
    TorusObstacle,
)
from hybrid.scene.schema import LineScene

# As parts of the diameter of a line: how deep it lies in an obstacle under what the scene asks for, where it follows
# its radius and where it touches it at a point; how deep it goes where it hits one; the onset of contact; the elastic
# travel of friction.
DEPTH, DEPTH_AT_POINT, DEPTH_AT_IMPACT, ONSET, TRAVEL = 0.02, 0.05, 0.125, 0.01, 0.01
# Cells to the radius of an obstacle where the program places them, and the most cells that this makes of a line.
CELLS_PER_RADIUS, MOST_CELLS = 4.0, 2000


def obstacle_bits(scene: LineScene) -> int:
    """Bits of kernels.state.forces that the obstacles of a scene ask for."""
    if not scene.obstacles:
        return 0
    return OBSTACLES | (FRICTION if any(x.friction for x in scene.obstacles.values()) else 0)


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
    round_ = [x for x in scene.obstacles.values() if not isinstance(x, PlaneObstacle)]
    radii = [bend_radius(x) + strand_radius(scene) for x in round_]
    return min(CELLS_PER_RADIUS * scene.length / min(radii), MOST_CELLS) if radii else 0.0
