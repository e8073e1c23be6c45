"""How lines hold a point or a body: its stiffness at the equilibrium, and forces at offsets from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.junctions.bodies import ARM, FORCE, FRAME, MASS, PLACE, STATE, STIFFNESS, V
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.laws.obstacle_grip import grip_obstacles
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.state.report import EACH, FORCE_A, MOMENT_A, STRAND
from hybrid.kernels.state.report import FORCE as FORCE_OF
from hybrid.kernels.state.report import STIFFNESS as STIFFNESS_OF
from hybrid.kernels.state.state import Floats
from hybrid.model.bodies import angles_of, frame_of, seat_of, seated
from hybrid.model.build import in_space
from hybrid.model.network import NetworkModel, build_network
from hybrid.scene.analysis import Equilibrium
from hybrid.scene.base import nearest
from hybrid.scene.bodies import BodyShape, FixedBody, FreeBody, HeldBody
from hybrid.scene.ends import Fairlead, FixedPoint, GuidedPoint
from hybrid.scene.network import JoinedLine, Network
from hybrid.scene.read import SceneLike, as_scene, read_text, scene_text
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.simulation.result_file import marks_of
from hybrid.simulation.run_contact import refuse_within_itself
from hybrid.simulation.run_start import contacts_of
from hybrid.solve.lines_at_rest import LinesAtRest, touching_solver
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import NetworkState

VERTICAL = np.array([0.0, 0.0, 1.0])
# Where the stiffness is that between equilibria: how far these are apart, of the longest line, and rad; where lines
# touch themselves or bodies, of the narrowest diameter, over a part of which contact stiffens, where that is less.
SMALL_SHIFT = 2e-5  # of the longest line
SMALL_TURN = 2e-4  # rad
OF_DIAMETER = 1e-3  # of the narrowest diameter
# Springs that hold a body while a force acts on it resist as it does itself, and at least as this part of the stiffest.
LEAST_SPRING = 1e-3


@dataclass(frozen=True)
class Stiffness:
    """Linearised stiffness of a network at a point, or at the origin of a body, at the equilibrium.

    matrix: (3, 3) N/m of a point, (6, 6) N/m, N/rad, N m/m, N m/rad of a body: force and moment that it takes to shift
    and turn it, inertial axes; other points and bodies that are free follow.  lines: the part of the lines; that of a
    free point has the weight and buoyancy of the point in it.  position (3,) m and rotation (3,) deg are where it is.
    Without friction on the seabed.
    """

    at: str
    matrix: Floats
    lines: Floats
    position: Floats
    rotation: Floats | None


@dataclass(frozen=True)
class Offsets:
    """What lines do to a point or body that is held beside its equilibrium, without friction on the seabed.

    distance: (n,) m along a heading; force: (n, 3) N of the lines on it, inertial; moment: (n, 3) N m about the origin
    of a body or a point to which lines are clamped; restoring: (n,) N, force against the offset; tension: (n,) N, the
    largest by the name of each line.
    """

    at: str
    heading: float  # deg, counter-clockwise from the x axis
    distance: Floats
    force: Floats
    moment: Floats | None
    restoring: Floats
    tension: dict[str, Floats]


def stiffness(scene: SceneLike, at: str) -> Stiffness:
    """Stiffness of the lines at `point:NAME` or `body:NAME`, free or held; from the factors of the equilibrium.

    SceneError where the scene has no such point or body, ComputationError where no equilibrium is found.
    """
    asked = as_scene(scene)
    with asked.form.in_words():
        return _stiffness_at(asked, at)


def _stiffness_at(network: Network, at: str) -> Stiffness:
    """The same of a network."""
    kind, name = target_of(network, at)
    model = build_network(network)
    found = _equilibrium(network, model)
    solver, state, first = found.solver, found.state, 0
    size = 6 if kind == "body" else 3
    free = [*model.free], [*(body.name for body in model.bodies), *model.rigid]
    if kind == "point" and name in free[0]:
        first, position, rotation = 3 * free[0].index(name), _place(network, model, found, name), None
        own = np.zeros((3, 3))
    elif kind == "point" and name in model.rigid:  # whose turns follow
        row = state.bodies[free[1].index(name)]
        first, position, rotation = 3 * len(free[0]) + 6 * free[1].index(name), row[PLACE:FRAME].copy(), None
        own = np.zeros((3, 3))
    elif kind == "body" and name in free[1]:
        b = free[1].index(name)
        first, row = 3 * len(free[0]) + 6 * b, state.bodies[b]
        own, position = _own_stiffness(solver.bodies[b], row), row[PLACE:FRAME].copy()
        rotation = angles_of(row[FRAME:V].reshape(3, 3))
    else:
        solver, state = _let_go(network, model, found, kind, name)
        held = network.bodies[name] if kind == "body" else None
        position = np.array(held.position) if isinstance(held, FixedBody) else _place(network, model, found, name)
        rotation = np.array(held.rotation) if isinstance(held, FixedBody) else None
        first, own = 3 * len(free[0]) + (6 * len(free[1]) if kind == "body" else 0), np.zeros((size, size))
    matrix = _stiffness(solver, state, first, size, len(solver.net))
    if matrix is None:
        raise ComputationError(Outcome.SINGULAR, None, None, f"nothing gives way at {at}: its lines do not stretch")
    return Stiffness(at, matrix, np.asarray(matrix - own, float), position, rotation)


def _equilibrium(network: Network, model: NetworkModel) -> LinesAtRest:
    """Under full loads, without friction.  SceneError: a line that contact is asked for is within itself in it."""
    found = equilibrium_of(network, model, np.inf, friction=False)
    if not found.settled:
        refuse_within_itself(model, found.solver.lines, found.state, moves=False)
    return found


def _stiffness(solver: NetworkSolver, state: NetworkState, first: int, size: int, points: int) -> Floats | None:
    """Stiffness (size, size) N/m, N/rad, .. of one point or body; None: the system is singular.

    It begins at `first` of `NetworkSolver.compliance`; points: how many there are.
    From the factors; where a torque passes through catenaries, which they know roughly, or lines touch themselves or
    bodies, from equilibria under small forces and moments both ways.
    """
    solver.evaluate_forces(state, 0.0)
    found = solver.compliance(state, solver.anchor)
    if found is None:
        return None
    K = _inverse(found[first : first + size, first : first + size])
    if K is None or not _needs_equilibria(solver):
        return K
    before = _settled(solver, state)
    point, b = first // 3, (first - 3 * points) // 6
    load, C, springs = _load_on(solver, points, first, before), np.zeros((size, size)), np.zeros(6)
    if first >= 3 * points:  # so that it turns by little where nothing holds it
        R, mass = before.bodies[b, FRAME:V].reshape(3, 3), solver.bodies[b, MASS : MASS + 36].reshape(6, 6)
        for some in (slice(0, 3), slice(3, size)):
            held = np.abs(K.diagonal()[some])
            springs[some] = np.maximum(held, LEAST_SPRING * held.max(initial=0.0))
        if solver.presses_bodies:  # which may hold it, with what lines give way by
            springs = np.maximum(springs, solver.scale / solver.length * np.repeat([1.0, solver.arm**2], 3))
        for some in (slice(0, 3), slice(3, 6)):  # in axes of the body
            mass[some, some] += R.T @ np.diag(springs[some] / solver.anchor) @ R
    near = min(OF_DIAMETER * _narrowest(solver) / (SMALL_SHIFT * solver.length), 1.0)
    for k in range(size):
        small = near * (SMALL_SHIFT * solver.length if k < 3 else SMALL_TURN)
        part, moved = small * (abs(float(K[k, k])) + springs[k]), []
        for sign in (1.0, -1.0):
            there = before.copy()
            load[k] += sign * part
            try:
                taken = solver.newton_round(there)
            finally:
                load[k] -= sign * part
            if taken.outcome != Outcome.OK:
                detail = f"under a small force both ways, whose answer is the stiffness: {sign * part:.3g} N or N m"
                raise ComputationError(taken.outcome, None, None, detail)
            moved.append(_place_of(solver, there, before, point if first < 3 * points else -1, b)[:size])
        C[:, k] = (moved[0] - moved[1]) / (2.0 * part)
    found = _inverse(C)
    return None if found is None else found - np.diag(springs[:size])


def _inverse(C: Floats) -> Floats | None:
    """None: there is none."""
    try:
        return np.asarray(np.linalg.inv(C), float)
    except np.linalg.LinAlgError:
        return None


def _needs_equilibria(solver: NetworkSolver) -> bool:
    """Whether the factors know the answer of some line only roughly, or not that it touches itself or a body."""
    return any(x.line.torsion.size for x in solver.lines) or bool(solver.in_contact()) or solver.presses_bodies


def _narrowest(solver: NetworkSolver) -> float:
    """The least diameter, m, of lines that touch; infinite: none does."""
    if solver.presses_bodies:
        return 2.0 * float(solver.lines[0].sea.obstacles[:, STRAND].min())
    return solver.narrowest


def _load_on(solver: NetworkSolver, points: int, first: int, state: NetworkState) -> Floats:
    """The force, and of a body the moment behind it, that act from outside on a point or body: a view to change."""
    if first >= 3 * points:
        return np.asarray(solver.bodies[(first - 3 * points) // 6, FORCE : FORCE + 6])
    line, end = next((x, k) for x in solver.lines for k in (0, 1) if x.joints[k] == first // 3)
    return np.asarray(line.ends.force[end])


def _settled(solver: NetworkSolver, state: NetworkState) -> NetworkState:
    """An equilibrium of these lines, with what was held and is free now loaded as it was held."""
    solver.evaluate_forces(state, 0.0)
    _, points, bodies = solver.unbalanced(state, 0.0)
    for point, net in enumerate(points):
        _load_on(solver, len(points), 3 * point, state)[:] -= net
    solver.bodies[:, FORCE : FORCE + 6] -= bodies
    taken, found = solver.newton(state)
    if taken.outcome != Outcome.OK:
        raise ComputationError(taken.outcome, None, None, "as it is, under the forces that hold it")
    return found


def _place_of(solver: NetworkSolver, state: NetworkState, before: NetworkState, point: int, b: int) -> Floats:
    """(6,) how far a point (-1: body b) has moved and turned, m and rad."""
    if point >= 0:
        line, end = next((n, k) for n, x in enumerate(solver.lines) for k in (0, 1) if x.joints[k] == point)
        return np.concatenate([state.lines[line].r[-end] - before.lines[line].r[-end], np.zeros(3)])
    row, old = state.bodies[b], before.bodies[b]
    R = row[FRAME:V].reshape(3, 3) @ old[FRAME:V].reshape(3, 3).T
    turn = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.concatenate([row[PLACE:FRAME] - old[PLACE:FRAME], turn])


def offsets(scene: SceneLike, at: str, distances: Sequence[float], heading: float = 0.0) -> Offsets:
    """Forces of the lines on `point:NAME` or `body:NAME` held at distances (m) from its equilibrium.

    Along a heading (deg, counter-clockwise from the x axis), at the height and rotation that it has there; a point to
    which lines are clamped keeps their directions.
    Errors: as of `stiffness`; the distance at which no equilibrium is found is in the message.
    """
    asked = as_scene(scene)
    target_of(asked, at)
    try:
        known = bool(len(distances)) and bool(np.isfinite([*distances, heading]).all())
    except (TypeError, ValueError):
        known = False
    if not known:
        given = f"{distances!r:.60} m, heading {heading!r:.20}"
        fix = "give finite numbers, such as --reach 20 --heading 90"
        raise SceneError([Complaint("offsets", given, "distances (m) and a heading (deg)", fix)])
    with asked.form.in_words():
        return _offsets_at(asked, at, distances, heading)


def _offsets_at(network: Network, at: str, distances: Sequence[float], heading: float) -> Offsets:
    """The same of a network."""
    kind, name = target_of(network, at)
    model = build_network(network)
    found = _equilibrium(network, model)
    network = network.model_copy(update={"lines": _with_axes(network, model, name)})
    shape = getattr(network.bodies[name], "shape", None) if kind == "body" else None
    if shape is not None:  # which lines may not pass on the way to where they touch it
        network = network.model_copy(update={"lines": _from_where_they_lie(network, found)})
    place = _place(network, model, found, name) if kind == "point" else None
    rigid = kind == "point" and name in network.rigid
    if rigid:
        network = network.model_copy(update={"lines": _clamped_as_they_lie(network, model, found, name)})
    free = [body.name for body in model.bodies]
    rotation = np.zeros(3)
    if kind == "body":
        body = network.bodies[name]
        if isinstance(body, FixedBody):
            place, rotation = np.array(body.position), np.array(body.rotation)
        else:
            row = found.state.bodies[free.index(name)]
            place, rotation = row[PLACE:FRAME].copy(), angles_of(row[FRAME:V].reshape(3, 3))
    assert place is not None
    along = np.array([np.cos(np.radians(heading)), np.sin(np.radians(heading)), 0.0])
    forces, moments, tensions = [], [], []
    which = _points_of(network, kind, name)
    for distance in distances:
        try:
            moved = _held(network, kind, name, (place + distance * along, rotation), shape)
            there = build_network(moved)
            _make_as_hard(moved, there, network, model)
            here = _equilibrium(moved, there)
        except SceneError as error:
            given = f"an offset of {distance:g} m"
            raise SceneError([replace(x, value=f"{given}: {x.value}") for x in error.complaints]) from None
        except ComputationError as error:
            detail = f"at an offset of {distance:g} m; {error.detail}"
            raise ComputationError(error.outcome, error.t, error.s, detail) from None
        force, moment = _contact_on(here, moved, name, place + distance * along)
        for l, ends in enumerate(_ends(moved)):
            for k, point in enumerate(ends):
                if point in which:
                    report = here.solver.work[l].report
                    f = report[FORCE_A + 3 * k : FORCE_A + 3 * k + 3]
                    force += f
                    moment += np.cross(here.state.lines[l].r[-k] - place - distance * along, f)
                    if moved.clamp(there.names[l], ("start", "end")[k]) is not None:
                        m = report[MOMENT_A + 3 * k : MOMENT_A + 3 * k + 3]
                        moment += -m if k else m
        forces.append(force)
        moments.append(moment)
        tensions.append([_largest_tension(here, there, moved, l) for l in range(len(here.state.lines))])
    total = np.array(forces).reshape(-1, 3)
    by_line = dict(zip(model.names, np.array(tensions).reshape(len(forces), -1).T, strict=True))
    about = np.array(moments).reshape(-1, 3) if kind == "body" or rigid else None
    return Offsets(at, heading, np.array(distances, float), total, about, -total @ along, by_line)


def _largest_tension(found: LinesAtRest, model: NetworkModel, network: Network, l: int) -> float:
    """Of the cells of line l, and of its ends, where the force of what holds it is known, N."""
    state, report, line = found.state.lines[l], found.solver.work[l].report, model.models[l]
    marks = marks_of(network.scene_of(model.names[l]), line)
    d = state.e / np.linalg.norm(state.e, axis=1, keepdims=True)
    largest = float(state.T.max())
    for k in (0, 1):
        other = d[-k] if len(d) == 1 or marks[(1, -2)[k]] else d[(1, -2)[k]]  # no tangent is continued across a load
        t = 1.5 * d[-k] - 0.5 * other
        force = report[FORCE_A + 3 * k : FORCE_A + 3 * k + 3] * (1.0 - 2.0 * k)
        largest = max(largest, float(force @ t / np.linalg.norm(t)))
    return largest


def target_of(network: Network, at: str) -> tuple[str, str]:
    """Kind and name of what is asked for, `point:NAME` or `body:NAME`; SceneError where the scene has no such one."""
    kind, _, name = at.partition(":")
    if name not in (network.points if kind == "point" else network.bodies if kind == "body" else ()):
        names = [f"point:{x}" for x, p in network.points.items() if not isinstance(p, Fairlead)]
        names += [f"body:{x}" for x in network.bodies]
        fix = nearest(at, dict.fromkeys(names, "")) or f"write {names[0]}"
        raise SceneError([Complaint("stiffness", at, f"one of {', '.join(names)}", fix)])
    point = network.points.get(name) if kind == "point" else None
    if isinstance(point, Fairlead):
        expected = f"a point that is on no body; {name} is on body {point.body}"
        raise SceneError([Complaint("stiffness", at, expected, f"write body:{point.body}")])
    return kind, name


def _ends(network: Network) -> list[tuple[str, str]]:
    return [(x.start, x.end) for x in network.lines.values()]


def _points_of(network: Network, kind: str, name: str) -> list[str]:
    if kind == "point":
        return [name]
    return [p for p, point in network.points.items() if isinstance(point, Fairlead) and point.body == name]


def _place(network: Network, model: NetworkModel, found: LinesAtRest, point: str) -> Floats:
    """Where a point is in an equilibrium."""
    line, end = network.lines_at(point)[0]
    return np.asarray(found.state.lines[model.names.index(line)].r[-(end == "end")]).copy()


def _with_axes(network: Network, model: NetworkModel, point: str) -> dict[str, JoinedLine]:
    """The lines, with the material axes that clamps have where none are given: no offset twists a line anew.

    point: that is asked for; where it is guided, and holds no twist, it does not when it is held.
    """
    lines = dict(network.lines)
    for l, (name, line) in enumerate(network.lines.items()):
        axes: dict[str, Any] = {}
        for k, (end, at) in enumerate((("start", line.start), ("end", line.end))):
            held, body = network.clamp(name, end), network.body_of(at)
            if held is None or held.normal is not None or held.swivel or at in network.rigid:
                continue
            if isinstance(network.points[at], GuidedPoint):
                axes |= {end: held.model_copy(update={"swivel": True})} if at == point else {}
                continue
            frame = model.models[l].ends.values.frame[k].reshape(3, 3)
            if isinstance(body, FreeBody):
                frame = model.seats[l, k, :TURNS].reshape(3, 3)
            elif body is not None:
                frame = frame_of(body.rotation).T @ frame
            back = 2.0 * np.pi * held.turns  # which are counted from the normal
            normal = np.cos(back) * frame[:, 0] - np.sin(back) * frame[:, 1]
            axes[end] = held.model_copy(update={"normal": tuple(normal.tolist())})
        lines[name] = line.model_copy(update={"connections": line.connections.model_copy(update=axes)})
    return lines


def _clamped_as_they_lie(
    network: Network, model: NetworkModel, found: LinesAtRest, point: str
) -> dict[str, JoinedLine]:
    """The lines, with inertial directions of an equilibrium for those that are clamped to a free point."""
    axes = found.state.bodies[len(model.bodies) + model.rigid.index(point), FRAME:V].reshape(3, 3)
    lines = dict(network.lines)
    for name, end in network.clamped_at(point):
        tangent, normal = seated(model.seats[model.names.index(name), int(end == "end")], axes)
        connections = lines[name].connections
        held = getattr(connections, end).model_copy(update={"tangent": tangent, "normal": normal})
        connections = connections.model_copy(update={end: held})
        lines[name] = lines[name].model_copy(update={"connections": connections})
    return lines


def _from_where_they_lie(network: Network, found: LinesAtRest) -> dict[str, JoinedLine]:
    """The lines, whose equilibria are searched for from that."""
    shapes = (tuple(map(tuple, x.r.tolist())) for x in found.state.lines)
    return {
        name: line.model_copy(update={"initial": Equilibrium(points=points)})
        for (name, line), points in zip(network.lines.items(), shapes, strict=True)
    }


def _held(network: Network, kind: str, name: str, pose: tuple[Floats, Floats], shape: BodyShape | None) -> Network:
    """The network with a point or body held somewhere; pose: place, m, and rotation, deg; shape: of the body."""
    at, turned = (tuple(x.tolist()) for x in pose)
    changed: dict[str, dict[str, Any]] = {"points": {**network.points, name: FixedPoint(position=at)}}
    if kind == "body":
        changed = {"bodies": {**network.bodies, name: FixedBody(position=at, rotation=turned)}}
        if not _points_of(network, kind, name):  # which no scene holds
            del changed["bodies"][name]
    moved: Network = read_text(scene_text(network.model_copy(update=changed)))[0]  # so that lines too short are refused
    if shape is None:
        return moved
    held = HeldBody(position=at, rotation=turned, shape=shape)
    return moved.model_copy(update={"bodies": {**moved.bodies, name: held}})


def _make_as_hard(moved: Network, there: NetworkModel, network: Network, model: NetworkModel) -> None:
    """Let obstacles be as hard as they were with a body or point that presses lines on them, and is held now."""
    before = list(network.surfaces)
    same = [before.index(x) for x in moved.surfaces]
    for new, old in zip(there.models, model.models, strict=True):
        new.sea.values.obstacles[:, STIFFNESS_OF] = old.sea.values.obstacles[same, STIFFNESS_OF]


def _contact_on(found: LinesAtRest, network: Network, body: str, origin: Floats) -> tuple[Floats, Floats]:
    """Force (3,) N of lines that touch a body, and moment (3,) N m about its origin."""
    force, moment, surfaces = np.zeros(3), np.zeros(3), list(network.surfaces)
    if body not in surfaces or body in network.obstacles:
        return force, moment
    at = EACH * surfaces.index(body) + FORCE_OF
    for x, state in zip(found.solver.lines, found.state.lines, strict=True):
        grip = np.zeros_like(state.grip)
        grip_obstacles(x.line, x.sea, np.zeros_like(state.r), state, state.grip, grip)
        pressed = -grip[:, at : at + 3]
        force += pressed.sum(axis=0)
        moment += np.cross(state.r - origin, pressed).sum(axis=0)
    return force, moment


def _let_go(
    network: Network, model: NetworkModel, found: LinesAtRest, kind: str, name: str
) -> tuple[NetworkSolver, NetworkState]:
    """The lines of an equilibrium as they are, with what is held at a point or body free to move."""
    points, bodies = len(model.free), found.solver.bodies
    which = _points_of(network, kind, name)
    numbers, rows = bodies, found.state.bodies
    if kind == "body":
        body = network.bodies[name]
        assert not isinstance(body, FreeBody)
        row = np.zeros(STATE)
        row[PLACE:FRAME], row[FRAME:V] = body.position, frame_of(body.rotation).ravel()
        numbers, rows = np.vstack([bodies, np.zeros(bodies.shape[1])]), np.vstack([rows, row])
    lines = []
    for x, ends in zip(found.solver.lines, _ends(network), strict=True):
        # a point that is let go is numbered between the free points and the bodies
        joints = [j + 1 if kind == "point" and j >= points else j for j in x.joints]
        held, fairleads, seats = x.ends.held.copy(), x.fairleads.copy(), x.seats.copy()
        for k, point in enumerate(ends):
            if point in which:
                joints[k] = points if kind == "point" else points + len(bodies)
                held[k] = JOINED
                found_point = network.points[point]
                if isinstance(found_point, Fairlead):
                    fairleads[k] = found_point.place
                    if x.line.element[-k]:
                        seats[k] = seat_of(x.ends.frame[k], rows[-1, FRAME:V].reshape(3, 3))
        ends_now = x.ends._replace(held=held, position=x.ends.position.copy())
        x = x._replace(line=in_space(x.line))
        lines.append(x._replace(joints=(joints[0], joints[1]), ends=ends_now, fairleads=fairleads, seats=seats))
    points += kind == "point"
    if found.settled:
        solver = touching_solver(lines, points, numbers, lambda: contacts_of(model))
    else:
        solver = NetworkSolver(lines, points, numbers)
    return solver, NetworkState(found.state.lines, rows)


def _own_stiffness(numbers: Floats, row: Floats) -> Floats:
    """(6, 6) of weight, buoyancy and hydrostatics of a body at rest, against shifts and turns (inertial)."""
    R, roll, pitch = row[FRAME:V].reshape(3, 3), numbers[STIFFNESS + 1], numbers[STIFFNESS + 2]
    K, t, arm = np.zeros((6, 6)), R.T @ VERTICAL, R @ numbers[ARM : ARM + 3]
    a = np.array([-pitch * t[0], -roll * t[1], 0.0])
    K[2, 2] = numbers[STIFFNESS]
    for k, turn in enumerate(np.eye(3)):
        dt = R.T @ np.cross(VERTICAL, turn)
        da = np.array([-pitch * dt[0], -roll * dt[1], 0.0])
        change = np.cross(np.cross(turn, arm), VERTICAL) + R @ (np.cross(da, t) + np.cross(a, dt))
        K[3:, 3 + k] = -(change + np.cross(turn, R @ np.cross(a, t)))
    return K
