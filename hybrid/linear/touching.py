"""What touches in an equilibrium as a part of the matrices of its network: lines, bodies that lines touch, sheaves.

Unknowns here are those of all lines (`SIZE` a node, linear.matrices), behind them those of bodies (6 each), and the
angles of the sheaves that lines turn.  Contact that is closed stays closed.  Where friction sticks, what touches is
held along the other surface by the spring that it has before it slides, as on the bed; a sheave turns with what sticks
to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import sparse

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.contact.self_contact_law import (
    ALONG,
    DISTANCE,
    FOOT_PLACE,
    FORCE,
    NORMAL,
    PLACE,
    SPRING,
    WX,
    WY,
    P,
    Q,
)
from hybrid.kernels.contact.self_contact_pairs import Contact
from hybrid.kernels.junctions.bodies import MASS
from hybrid.kernels.junctions.bodies import PLACE as ORIGIN
from hybrid.kernels.junctions.body_contact import BY_BODY, BY_NODES, OF_LINE, OF_NODE, OF_SLOT, TOUCHED
from hybrid.kernels.laws.obstacle_grip import grip_obstacles
from hybrid.kernels.laws.obstacles import distances, thinner_nodes
from hybrid.kernels.state.report import (
    BEARING,
    EACH,
    ENDED,
    FREE,
    FRICTION,
    INERTIA,
    MU,
    OBSTACLES,
    ONSET_OF,
    SLIP,
    STILL_AXIS,
    TURNED,
)
from hybrid.kernels.state.report import FORCE as FORCE_OF
from hybrid.kernels.state.state import Floats, State
from hybrid.model.bodies import BodyModel
from hybrid.model.build import Model
from hybrid.model.contents import Touching
from hybrid.model.network import NetworkModel, NetworkResolution
from hybrid.scene.ends import FreePoint
from hybrid.scene.network import Network
from hybrid.scene.read import scene_text
from hybrid.simulation.run import static_network
from hybrid.solve.lines_at_rest import contact_stiffness
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import JoinedLine, NetworkState


@dataclass(frozen=True)
class TouchingLines:
    """Lines that touch each other or themselves in an equilibrium: its solver, and friction (L, L) between them."""

    solver: NetworkSolver
    friction: Floats


@dataclass(frozen=True)
class Touch:
    """Places (n,) at which lines touch at rest.  of: numbers of two lines, or of a line and an obstacle."""

    of: tuple[int, int]
    obstacle: bool
    force: Floats  # N
    apart: sparse.csr_array  # (n, unknowns) how far they come apart
    depth: Floats  # m, by which they do so before the force is zero
    slides: sparse.csr_array  # (3 n, unknowns) how far they shift along each other; no rows: friction does not stick
    travel: Floats  # m, at which friction slides; 0: there is none


@dataclass(frozen=True)
class TouchingParts:
    """Matrices over the unknowns of this file, and what they are made of.

    forces: (nodes of all lines, 3) N of contact of lines; sheaves: numbers of the obstacles that have an angle.
    """

    stiffness: sparse.csr_array
    mass: sparse.csr_array
    damping: sparse.csr_array
    forces: Floats
    touches: tuple[Touch, ...] = ()
    sheaves: tuple[int, ...] = ()


@dataclass
class Blocks:
    """Blocks of a matrix, with their rows and columns."""

    rows: list[Any] = field(default_factory=lambda: [np.zeros(0, np.int64)])
    columns: list[Any] = field(default_factory=lambda: [np.zeros(0, np.int64)])
    values: list[Any] = field(default_factory=lambda: [np.zeros(0)])

    def add(self, rows: Any, columns: Any, block: Floats) -> None:
        """Blocks (.., a, b) at rows (.., a) and columns (.., b)."""
        shape = np.shape(block)
        self.rows.append(np.broadcast_to(np.asarray(rows)[..., :, None], shape).ravel())
        self.columns.append(np.broadcast_to(np.asarray(columns)[..., None, :], shape).ravel())
        self.values.append(np.ravel(block))

    def matrix(self, rows: int, columns: int) -> sparse.csr_array:
        """The matrix of this shape, without zeros; what stands in one place is added."""
        entries = np.concatenate(self.values), (np.concatenate(self.rows), np.concatenate(self.columns))
        found = sparse.csr_array(entries, shape=(rows, columns))
        found.eliminate_zeros()
        return found


def places_of(nodes: Any) -> np.ndarray:
    """(.., 3) unknowns that are the places of nodes (..)."""
    return np.asarray(SIZE * np.asarray(nodes)[..., None] + 1 + np.arange(3))


def stiffness_between(contact: Contact, node_of: np.ndarray, size: int) -> sparse.csr_array:
    """(size, size) N/m of contact of lines as it was looked at last; node_of: (N+1,) its nodes among those of all."""
    nodes, second = contact_stiffness(contact)
    at, parts = places_of(node_of[nodes]).reshape(-1, 18), Blocks()
    parts.add(at, at, second)
    return parts.matrix(size, size)


def touching_parts(
    solver: NetworkSolver, states: NetworkState, sticks: bool, touching: TouchingLines | None
) -> TouchingParts:
    """What touches in an equilibrium; sticks: whether friction holds what lies on bodies, sheaves and other lines."""
    counts = [x.line.s.size for x in solver.lines]
    begins = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    bodies, lines = SIZE * int(begins[-1]), len(solver.lines)
    pressed = [_pressed(x, state) for x, state in zip(solver.lines, states.lines, strict=True)]
    sheaves = [k for k in _sheaves(solver) if sticks and any(x[:, k].any() for x in pressed)]
    first = bodies + 6 * len(solver.bodies)  # of the sheaves
    size = first + len(sheaves)
    K, M, C, forces, touches = Blocks(), Blocks(), Blocks(), np.zeros((int(begins[-1]), 3)), list[Touch]()
    if solver.meets:
        smooth = 0 if sticks else FRICTION
        of = [x._replace(line=x.line._replace(bits=x.line.bits & ~smooth)) for x in solver.lines]
        touched = NetworkSolver(of, len(solver.net), solver.bodies)
        for part, cv in ((K, 0.0), (C, 1.0)):
            _add_bodies(part, touched, states, cv, begins)
            if cv:  # less what does not go by the rate
                _add_bodies(part, touched, states, 0.0, begins, -1.0)
    for l in range(lines):
        touches += _on_obstacles(solver, states, l, pressed[l], (begins, bodies, first, size), sticks, sheaves)
    for j, k in enumerate(sheaves):
        row = solver.lines[0].sea.carried[k]
        for part, value in ((M, row[INERTIA]), (C, row[BEARING])):
            part.add([first + j], [first + j], np.full((1, 1), value))
        for touch in (x for x in touches if x.obstacle and x.of[1] == k):
            _turn(K, touch, first + j, _spring(solver, touch))
    stiffness = K.matrix(size, size)
    if touching is not None:
        for contact, of_lines in touching.solver.contacts_at(states):
            if not contact.counts.points:
                continue
            node_of = np.concatenate([begins[k] + np.arange(counts[k]) for k in of_lines])
            stiffness = stiffness + stiffness_between(contact, node_of, size)
            for touch, spring in _of_lines(contact, of_lines, node_of, states, touching, (sticks, size), forces):
                touches.append(touch)
                if spring.any():
                    G = touch.slides
                    stiffness = stiffness + G.T @ sparse.diags_array(np.repeat(spring, 3)) @ G
    return TouchingParts(
        sparse.csr_array(stiffness), M.matrix(size, size), C.matrix(size, size), forces, tuple(touches), tuple(sheaves)
    )


# --- bodies and sheaves -------------------------------------------------------------------------


def _sheaves(solver: NetworkSolver) -> list[int]:
    """Numbers of the obstacles that turn freely."""
    return [int(k) for k in np.flatnonzero(solver.lines[0].line.moved == FREE)]


def _pressed(x: JoinedLine, state: State) -> Floats:
    """(N+1, M, 3) N, forces of all obstacles on the nodes of a line at rest, without friction."""
    count = len(x.sea.obstacles) if x.line.bits & OBSTACLES else 0
    now = np.zeros((x.line.s.size, EACH * count))
    if count:
        grip_obstacles(
            x.line._replace(bits=x.line.bits & ~FRICTION), x.sea, np.zeros_like(state.r), state, state.grip, now
        )
    return now.reshape(x.line.s.size, count, EACH)[:, :, FORCE_OF : FORCE_OF + 3]


def _add_bodies(
    out: Blocks, solver: NetworkSolver, states: NetworkState, cv: float, begins: np.ndarray, part: float = 1.0
) -> None:
    """Add a part of what bodies and the nodes that touch them do to each other (kernels.junctions.body_contact)."""
    rows, own, _, carriers = solver.pressed_bodies(states, cv)
    bodies = SIZE * int(begins[-1]) + 6 * np.asarray(carriers)
    for b, block in zip(bodies, own.reshape(-1, 6, 6), strict=True):
        out.add(b + np.arange(6), b + np.arange(6), -part * block)
    for row in rows:
        l, i = int(row[OF_LINE]), int(row[OF_NODE])
        node, b = int(begins[l]) + i, bodies[int(row[OF_SLOT])] + np.arange(6)
        out.add(places_of(node), b, -part * row[BY_BODY:BY_NODES].reshape(3, 6))
        by_nodes = row[BY_NODES:TOUCHED].reshape(6, 3, 3)
        for n in range(3):
            if begins[l] <= node - 1 + n < begins[l + 1]:
                out.add(b, places_of(node - 1 + n), -part * by_nodes[:, n])


At = tuple[np.ndarray, int, int, int]


def _on_obstacles(
    solver: NetworkSolver, states: NetworkState, l: int, pressed: Floats, at: At, sticks: bool, sheaves: Sequence[int]
) -> Iterator[Touch]:
    """What line l does on the obstacles that it lies on, of which bodies carry some.

    at: where nodes of lines begin, where the unknowns of bodies and sheaves do, and how many there are.
    """
    x, r, (begins, bodies, first, size) = solver.lines[l], states.lines[l].r, at
    if not pressed.any():
        return
    rows, carried = x.sea.obstacles, x.sea.carried
    gaps = distances(x.sea, r) + thinner_nodes(rows, x.line.s)
    for k in range(len(rows)):
        force = np.linalg.norm(pressed[:, k], axis=1)
        i = np.flatnonzero(force > 0.0)
        if not i.size:
            continue
        n, body = pressed[i, k] / force[i, None], int(x.rides[k]) if x.rides.size else -1
        shift, places = Blocks(), 3 * np.arange(i.size)[:, None] + np.arange(3)
        shift.add(places, places_of(begins[l] + i), np.broadcast_to(np.eye(3), (i.size, 3, 3)))
        if body >= 0:
            unknown = np.broadcast_to(bodies + 6 * body + np.arange(6), (i.size, 6))
            arms = r[i] - states.bodies[body, ORIGIN : ORIGIN + 3]
            moves = -np.broadcast_to(np.eye(3), (i.size, 3, 3))
            shift.add(places, unknown, np.concatenate([moves, hats(arms)], axis=2))
        if k in sheaves:
            axis = carried[k, TURNED : TURNED + 9].reshape(3, 3) @ carried[k, STILL_AXIS : STILL_AXIS + 3]
            ways = np.cross(axis, r[i] - carried[k, ENDED : ENDED + 3])
            shift.add(places, np.full((i.size, 1), first + sheaves.index(k)), -ways[:, :, None])
        shifts = shift.matrix(3 * i.size, size)
        rubs = bool(sticks and rows[k, MU] > 0.0)
        travel = np.full(i.size, rows[k, SLIP] if rubs else 0.0)
        depth = 0.5 * rows[k, ONSET_OF] - gaps[k, i]
        yield Touch(
            (l, k), True, force[i], along(n) @ shifts, depth, across(n) @ shifts if rubs else shifts[:0], travel
        )


def _spring(solver: NetworkSolver, touch: Touch) -> Floats:
    """(n,) N/m of friction before it slides on an obstacle; none: of one without friction."""
    rows = solver.lines[touch.of[0]].sea.obstacles
    return np.asarray(rows[touch.of[1], MU] * touch.force / touch.travel) if touch.travel.all() else np.zeros(0)


def _turn(out: Blocks, touch: Touch, angle: int, spring: Floats) -> None:
    """Add what the angle of a sheave does in the springs of friction; that of the nodes is in the matrices of lines."""
    if not spring.size or not touch.slides.shape[0]:
        return
    G = touch.slides
    by_angle = np.asarray(G[:, [angle]].todense()).ravel()
    column = np.asarray(G.T @ (np.repeat(spring, 3) * by_angle))
    there = np.flatnonzero(column)
    out.add(there, [angle], column[there, None])
    others = there[there != angle]
    out.add([angle], others, column[None, others])


def along(n: Floats) -> sparse.csr_array:
    """(n, 3 n): parts along normals (n, 3)."""
    out = Blocks()
    out.add(np.arange(len(n))[:, None], 3 * np.arange(len(n))[:, None] + np.arange(3), n[:, None, :])
    return out.matrix(len(n), 3 * len(n))


def across(n: Floats) -> sparse.csr_array:
    """(3 n, 3 n): parts across normals (n, 3)."""
    out, places = Blocks(), 3 * np.arange(len(n))[:, None] + np.arange(3)
    out.add(places, places, np.eye(3) - n[:, :, None] * n[:, None, :])
    return out.matrix(3 * len(n), 3 * len(n))


def hats(a: Floats) -> Floats:
    """(.., 3, 3) matrices of a x, of vectors (.., 3)."""
    return np.asarray(np.cross(a[..., None, :], np.eye(3)).swapaxes(-1, -2))


# --- lines --------------------------------------------------------------------------------------


def _of_lines(
    contact: Contact,
    lines: Sequence[int],
    node_of: np.ndarray,
    states: NetworkState,
    touching: TouchingLines,
    asked: tuple[bool, int],
    forces: Floats,
) -> Iterator[tuple[Touch, Floats]]:
    """Each pair of lines that touch, and the springs (n,) N/m of its friction; their forces are added to `forces`.

    asked: whether friction sticks, how many unknowns there are.
    """
    rows, (sticks, size) = contact.points[: contact.counts.points], asked
    pieces = rows[:, [P, Q]].astype(np.int64)
    nodes = (pieces[:, :, None] + np.arange(-1, 2)).reshape(-1, 6)
    weights = np.concatenate([rows[:, WX : WX + 3], -rows[:, WY : WY + 3]], axis=1)
    n, force = rows[:, NORMAL : NORMAL + 3], -rows[:, FORCE]
    np.add.at(forces, node_of[nodes], (weights * force[:, None])[:, :, None] * n[:, None, :])
    count = len(rows)
    shift, places = Blocks(), 3 * np.arange(count)[:, None] + np.arange(3)
    for j in range(6):
        shift.add(places, places_of(node_of[nodes[:, j]]), weights[:, j, None, None] * np.eye(3))
    shifts = shift.matrix(3 * count, size)
    who = np.sort(np.asarray(lines)[contact.of[pieces]], axis=1)
    friction = touching.friction[who[:, 0], who[:, 1]] * sticks
    apart, depth = along(n) @ shifts, force / np.maximum(rows[:, ALONG], 1e-300)
    slides = across(n) @ (shifts + _turning(contact, node_of, rows, states, touching, size)) if sticks else shifts[:0]
    spring = np.where(friction > 0.0, rows[:, SPRING], 0.0)
    travel = friction * force / np.maximum(rows[:, SPRING], 1e-300)
    for a, b in np.unique(who, axis=0).tolist():
        here = np.flatnonzero((who == (a, b)).all(axis=1))
        rubs = bool(friction[here].any())
        threes = (3 * here[:, None] + np.arange(3)).ravel() if rubs else here[:0]
        touch = Touch((a, b), False, force[here], apart[here], depth[here], slides[threes], travel[here])
        yield touch, spring[here] * rubs


def _turning(
    contact: Contact, node_of: np.ndarray, rows: Floats, states: NetworkState, touching: TouchingLines, size: int
) -> sparse.csr_array:
    """Shift (3 n, unknowns) of surfaces against each other at points as their strands turn.

    The symbols are of kernels.contact.self_contact_law.
    """
    r = np.concatenate([x.r for x in states.lines])
    spins = np.concatenate([np.append(x.line.spin != 0, False) for x in touching.solver.lines])
    out, places = Blocks(), 3 * np.arange(len(rows))[:, None] + np.arange(3)
    n, distance = hats(rows[:, NORMAL : NORMAL + 3]), rows[:, DISTANCE, None, None]
    for own, other, place in ((P, Q, PLACE), (Q, P, FOOT_PLACE)):
        mine, u = rows[:, own].astype(np.int64), rows[:, place]
        wide, beside = contact.width[mine], contact.width[rows[:, other].astype(np.int64)]
        for j, share in enumerate((1.0 - u, u)):
            part = (share * 2.0 * wide / (wide + beside))[:, None, None]
            cell = node_of[mine - 1 + j]
            e = r[cell + 1] - r[cell]
            l = np.linalg.norm(e, axis=1)
            d = e / l[:, None]
            by_shift = 0.5 * distance * part * (n @ hats(d)) / l[:, None, None]
            out.add(places, places_of(cell + 1), by_shift)
            out.add(places, places_of(cell), -by_shift)
            rolls = (spins[cell] * contact.rolls[mine - 1 + j])[:, None, None]
            out.add(places, (SIZE * cell + 4)[:, None], 0.5 * distance * part * (n @ d[:, :, None]) * rolls)
    return out.matrix(3 * len(rows), size)


# The equilibrium of a scene as one network of lines, points and bodies, whatever the scene is.


@dataclass(frozen=True)
class Rest:
    """The equilibrium of a scene as a network; points and bodies that are free by name, models of lines and bodies.

    touching: lines that touch each other or themselves in it; may_touch: which may touch each other.
    """

    solver: NetworkSolver
    states: NetworkState
    names: tuple[str, ...]
    models: tuple[Model, ...]
    points: tuple[str, ...] = ()
    bodies: tuple[str, ...] = ()
    floats: tuple[BodyModel, ...] = ()
    touching: TouchingLines | None = None
    may_touch: Touching | None = None
    tips: Mapping[tuple[str, int], str] = field(default_factory=dict)  # points that are one end (0, 1) alone, in words


def rest_of(network: Any, resolution: NetworkResolution) -> Rest:
    """The equilibrium of a scene on such cells; ComputationError: there is none."""
    form = network.form
    with form.in_words():
        run = static_network(network, None, lambda: scene_text(network), resolution=resolution)
    assert run.found is not None
    bodies = (*(body.name for body in run.model.bodies), *run.model.rigid)
    found = run.found.solver  # which knows neither waves nor friction
    lines = [x._replace(line=model.line) for x, model in zip(found.lines, run.model.models, strict=True)]
    for body, state, row in zip(run.model.bodies, run.state.bodies, found.bodies, strict=False):
        body.set_added_mass(state)  # as it is wet at rest
        row[MASS : MASS + 36] = body.numbers[MASS : MASS + 36]
    solver, model = NetworkSolver(lines, len(found.net), found.bodies), run.model
    touching = TouchingLines(found, friction_between(model)) if run.found.settled else None
    tips = {end: form.text(f"point {point}") for end, point in _tips(network, model).items()}
    lines_and_points = tuple(model.names), model.models, tuple(model.free)
    return Rest(solver, run.state, *lines_and_points, bodies, model.bodies, touching, model.touching, tips)


def _tips(network: Network, model: NetworkModel) -> dict[tuple[str, int], str]:
    """Free points that are the end (0, 1) of one line alone, by that."""
    ends = [
        ((name, k), getattr(network.lines[name], key)) for name in model.names for k, key in enumerate(("start", "end"))
    ]
    joints = [joint for pair in model.joints for joint in pair]
    free = {name for name, point in network.points.items() if isinstance(point, FreePoint)}
    return {end: point for (end, point), joint in zip(ends, joints, strict=True) if joint < 0 and point in free}


def friction_between(model: NetworkModel) -> Floats:
    """(L, L) coefficients of friction of lines with each other and with themselves."""
    found = np.diag([model.scenes[name].contact.friction for name in model.names])
    if model.touching is not None:
        found[np.ix_(model.touching.lines, model.touching.lines)] = model.touching.friction
    return found
