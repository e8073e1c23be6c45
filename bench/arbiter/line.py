"""From the scene to the line the arbiter marches over: pieces, meshes, loads, ends.

A *piece* is a stretch of one kind (rod or catenary) in one section, with uniform
properties and its own nodes; a *joint* is where a rod piece meets a catenary piece.
Everything is SI, vectors are inertial with z up unless a comment states body axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.scene.analysis import CatenaryModel, RodModel, RodZone, ZonesModel
from hybrid.scene.cable import Environment, Section
from hybrid.scene.ends import Clamped, End, Guided, Pinned
from hybrid.scene.read import one_line
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene

from .rotations import Array, frame

CELLS = 100  # cells of a line whose scene names none: errors near 1e-3 of the length in a smooth sag
SAME = 1.0e-9  # of the length: nodes nearer than this are one node (arc lengths are sums of decimals)


@dataclass(frozen=True)
class Piece:
    """One stretch of one kind with uniform properties.

    s (n,) m; mass kg/m; weight (3,) N/m net of buoyancy; compliance 1/N; stiffness (3,) N m^2
    (two of bending, torsion) and inertia (3,) kg m, both along the body axes; curvature (3,) 1/m,
    the intrinsic one; drag_n, drag_t N s^2/m^3 per length (1/2 rho D Cn, 1/2 rho pi D Ct); added_n,
    added_t kg/m; damping 1/s; current (3,) m/s.
    """

    rod: bool
    s: Array
    mass: float
    weight: Array
    compliance: float
    stiffness: Array
    inertia: Array
    curvature: Array
    drag_n: float
    drag_t: float
    added_n: float
    added_t: float
    damping: float
    current: Array

    @property
    def round(self) -> bool:
        """Equal in all directions across the axis: turning it about its tangent changes nothing."""
        return bool(self.stiffness[0] == self.stiffness[1] and not self.curvature.any())

    @property
    def unknowns(self) -> int:
        return 12 if self.rod else 6


@dataclass(frozen=True)
class Target:
    """What an end demands at one time: position, velocity, frame (3, 3), angular velocity, all inertial."""

    position: Array | None
    velocity: Array
    frame: Array | None
    spin: Array


@dataclass(frozen=True)
class Hold:
    """One end of the line: what is held, and what is applied.

    place: the position is held; tangent: so is the direction; twist: so is the turn about it.
    What is not held is loaded: force (3,) N and moment (3,) N m on the cable, inertial.
    """

    table: End
    place: bool
    tangent: bool
    twist: bool
    motion: Any = None

    def at(self, t: float) -> Target:
        """Demands at time t (s)."""
        table = self.table
        position = np.array(table.position) if isinstance(table, Pinned | Clamped) else None
        held = None
        if isinstance(table, Clamped | Guided):
            held = frame(np.array(table.tangent), None if table.normal is None else np.array(table.normal))
        if self.motion is None:
            return Target(position, np.zeros(3), held, np.zeros(3))
        return Target(*self.motion.at_time(t))

    def force(self, t: float) -> Array:
        return _loads(self.table, "force", t)

    def moment(self, t: float) -> Array:
        return _loads(self.table, "moment", t)


@dataclass(frozen=True)
class Line:
    """The pieces in order, the two ends, and the length (m)."""

    pieces: tuple[Piece, ...]
    start: Hold
    end: Hold
    length: float
    scene: Scene


def _loads(table: End, what: str, t: float) -> Array:
    """Load (3,) at time t: on up to and including `until` (a step that ends there still feels it)."""
    total = np.zeros(3)
    for load in table.loads:
        if load.what == what and (load.until is None or t <= load.until * (1.0 + 1.0e-12)):
            total += load.at_time(t)
    return total


def refuse(where: str, value: object, expected: str, fix: str) -> SceneError:
    return SceneError([Complaint(where=where, value=str(value), expected=expected, fix=fix)])


def line_of(asked: Scene) -> Line:
    """The line of a scene; SceneError for what the arbiter cannot do."""
    scene = one_line(asked)
    _only_what_is_known(scene)
    length = math.fsum(section.length for section in scene.cable.sections)
    pieces: list[Piece] = []
    for rod, s in _zones(scene, length):
        start = 0.0
        for i, section in enumerate(scene.cable.sections):
            stop = start + section.length
            inside = s[(s > start - SAME * length) & (s < stop + SAME * length)]
            if len(inside) > 1:
                pieces.append(_piece(rod, inside, section, scene.environment, i))
            start = stop
    merged = [pieces[0]]
    for piece in pieces[1:]:
        last = merged[-1]
        alike = all(np.array_equal(getattr(last, k), getattr(piece, k)) for k in vars(piece) if k != "s")
        if alike:
            merged[-1] = Piece(**{**vars(last), "s": np.concatenate([last.s, piece.s[1:]])})
        else:
            merged.append(piece)
    return Line(tuple(merged), _hold(scene.ends.start, merged[0]), _hold(scene.ends.end, merged[-1]), length, scene)


def _only_what_is_known(scene: LineScene) -> None:
    """SceneError for what the arbiter would otherwise leave out in silence."""
    fluid, ends, sections = scene.environment.fluid, scene.ends, scene.cable.sections
    current = None if fluid is None else fluid.current
    motions = [end.prescribed_motion for end in ends.both]
    beyond = {
        "a seabed": scene.environment.seabed is not None,
        "a surface": fluid is not None and fluid.surface is not None,
        "a current that is not a plain vector": current is not None
        and not (isinstance(current, tuple) and isinstance(current[0], float)),
        "attachments": bool(scene.cable.attachments),
        "bodies": bool(ends.bodies()),
        "angular springs (bend_stiffness)": any(end.spring < math.inf for end in ends.both),
        "vessels": any(motion is not None and motion.vessel is not None for motion in motions),
        "turns": any(end.held_turns for end in ends.both),
        "release_at": any(end.release is not None for end in ends.both),
        "payout": any(getattr(end, "payout", None) is not None for end in ends.both),
        "contact.self": bool(scene.contact.self),
        "tension_torque": any(section.tension_torque for section in sections),
        "tension_strain and dynamic_stiffness": any(section.curve is not None for section in sections),
    }
    unknown = [name for name, there in beyond.items() if there]
    if unknown:
        raise refuse("scene", ", ".join(unknown), "a scene without them: the arbiter knows none", "take hybrid itself")


def _zones(scene: LineScene, length: float) -> list[tuple[bool, Array]]:
    """(is it a rod, nodes (n,)) per zone, section boundaries among the nodes."""
    model, mesh = scene.model, scene.mesh
    total, grading = (None, None) if mesh is None else (mesh.cells, mesh.ratio)
    if isinstance(model, ZonesModel):
        kinds = [isinstance(z, RodZone) for z in model.zones]
        spans = [z.rod if isinstance(z, RodZone) else getattr(z, "catenary", 0.0) for z in model.zones]
        wanted = [(z.cells, z.ratio) for z in model.zones]
        if grading is not None and len(kinds) > 1:
            raise refuse("mesh.ratio", grading, "one zone, or a ratio in every zone", "move ratio into the zones")
    elif isinstance(model, RodModel | CatenaryModel):
        kinds, spans, wanted = [isinstance(model, RodModel)], [length], [(None, None)]
    else:
        raise refuse("model.kind", model.kind, "rod, catenary or zones", "take hybrid itself")
    bounds = np.concatenate([[0.0], np.cumsum(spans)])
    if abs(bounds[-1] - length) > 1.0e-6 * length:
        raise refuse("model.zones", f"{bounds[-1]} m", f"{length} m, the length of the cable", "add up the zones")
    bounds[-1] = length
    cuts = np.concatenate([bounds, np.cumsum([x.length for x in scene.cable.sections])])
    open_ = sum(b for (cells, _), b in zip(wanted, spans, strict=True) if cells is None)
    left = (total or CELLS) - (sum(cells or 0 for cells, _ in wanted) if total else 0)
    zones = []
    for rod, a, b, (cells, ratio) in zip(kinds, bounds[:-1], bounds[1:], wanted, strict=True):
        if mesh is not None and mesh.nodes is not None:
            nodes = np.array(mesh.nodes)
        else:
            share = 0 if cells else max(2, round(left * (b - a) / (open_ if total else length)))
            nodes = a + (b - a) * graded(cells or share, ratio or grading or 1.0)
        inside = nodes[(nodes > a) & (nodes < b)]
        fixed = np.concatenate([[a, b], cuts[(cuts > a) & (cuts < b)]])
        apart = np.abs(inside[:, None] - fixed).min(1) > SAME * length
        zones.append((rod, np.unique(np.concatenate([fixed, inside[apart]]))))
    return zones


def graded(cells: int, ratio: float) -> Array:
    """Nodes (cells + 1,) on 0..1 whose last cell is `ratio` times the first, in geometric progression."""
    sizes = np.ones(cells) if cells == 1 else ratio ** (np.arange(cells) / (cells - 1.0))
    return np.concatenate([[0.0], np.cumsum(sizes / sizes.sum())])


def _piece(rod: bool, s: Array, section: Section, around: Environment, i: int) -> Piece:
    where = f"cable.sections[{i}]"
    weight = -section.mass * around.gravity
    drag_n = drag_t = added_n = added_t = 0.0
    current = np.zeros(3)
    if around.fluid is not None and section.diameter is not None:
        rho, d = around.fluid.density, section.diameter
        displaced = rho * math.pi * d**2 / 4.0
        weight += displaced * around.gravity
        if section.drag is not None:
            drag_n = 0.5 * rho * d * section.drag.normal
            drag_t = 0.5 * rho * math.pi * d * section.drag.tangential
        if section.added_mass is not None:
            added_n, added_t = displaced * section.added_mass.normal, displaced * section.added_mass.tangential
        if around.fluid.current is not None:
            current = np.array(around.fluid.current)
    damping = section.damping
    if damping is not None and damping.stiffness:
        expected = "0: the arbiter knows no stiffness-proportional damping"
        raise refuse(f"{where}.damping.stiffness", damping.stiffness, expected, "take hybrid itself")
    stiffness, inertia, curvature = np.zeros(3), np.zeros(3), np.zeros(3)
    if rod:
        if section.bending_stiffness is None:
            raise refuse(f"{where}.bending_stiffness", None, "a value: a rod zone lies here", "give it in N m^2")
        bending = np.broadcast_to(np.array(section.bending_stiffness, float), 2)
        # 1/1.3: a round, solid section of Poisson number 0.3
        torsion = section.torsional_stiffness
        stiffness = np.array([*bending, bending.mean() / 1.3 if torsion is None else torsion])
        inertia = _inertia(section)
        if section.intrinsic_curvature is not None:
            curvature = np.array(section.intrinsic_curvature)
    return Piece(
        rod=rod,
        s=s,
        mass=section.mass,
        weight=np.array([0.0, 0.0, weight]),
        compliance=0.0 if section.axial_stiffness is None else 1.0 / section.axial_stiffness,
        stiffness=stiffness,
        inertia=inertia,
        curvature=curvature,
        drag_n=drag_n,
        drag_t=drag_t,
        added_n=added_n,
        added_t=added_t,
        damping=0.0 if damping is None else damping.mass,
        current=current,
    )


def _inertia(section: Section) -> Array:
    """Rotary inertia (3,) kg m: a solid round section unless the scene gives another, none without a diameter."""
    given = section.rotary_inertia
    if given is None:
        transverse = section.mass * (section.diameter or 0.0) ** 2 / 16.0
        return np.array([transverse, transverse, 2.0 * transverse])
    if isinstance(given, tuple):
        return np.array([given[0], given[0], given[1]])
    return np.array([given, given, 2.0 * given])


def _hold(table: End, piece: Piece) -> Hold:
    """What this end holds; a catenary end passes neither tangent nor moment."""
    tangent = table.held_tangent is not None and piece.rod
    # Without a normal a clamp still holds the twist of a rod that can tell its sides apart; of a
    # round one it holds it in motion only (conditions.py), for in statics any turn is as good.
    twist = tangent and table.holds_twist and (table.held_normal is not None or not piece.round)
    motion = None
    if table.prescribed_motion is not None:
        from hybrid.scene.motion import EndMotion  # only a scene that moves needs it

        still = Hold(table, True, tangent, twist).at(0.0)
        motion = EndMotion(table.prescribed_motion, still.position, still.frame)
    return Hold(table, table.held_position is not None, tangent, twist, motion)
