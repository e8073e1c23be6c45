"""What a run that begins as its scene says starts with, and errors that name their line.

Lines that touch themselves or each other come to their equilibrium by a damped motion with contact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.laws.obstacles import cells_met, depths_in_obstacles
from hybrid.kernels.march.link import LINK, holds_twist, link_of
from hybrid.kernels.state.report import FRICTION, MAY_TOUCH, OBSTACLES, SELF_CONTACT
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.contents import touching, touching_among
from hybrid.model.initial_shape import GIVEN, HUNG, first_state, hung
from hybrid.model.network import NetworkModel
from hybrid.scene.analysis import Points
from hybrid.scene.bodies import FixedBody
from hybrid.scene.ends import FixedPoint
from hybrid.scene.motion import motion_record
from hybrid.scene.motion_tables import Motion, Triple
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import EventLog, slack_remedy
from hybrid.simulation.lines_contact import JUMP, crossed, diameters, jumps, least_bending, shared_of, watched_pairs
from hybrid.solve.contact import SelfContact, SharedContact
from hybrid.solve.lines_at_rest import Group, LinesAtRest, settled_network, touching_solver
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.search import Start, Tally, in_slower_currents, is_in_current
from hybrid.solve.stepper import JoinedLine, LineFailed, NetworkState, hold_by_friction, joined_ends

MOST_NODES = 300  # of a line that is looked at for whether it passes through itself
# Turns by which the link of a line between two clamps may change; and those by which an equilibrium without contact may
# differ from its start, whose shape may have a writhe of its own.
KEPT = 1e-3  # turns
OF_SHAPE = 0.5  # turns
# Parts of a current by whose equilibria lines come to that in all of it.
SLOWER = tuple(np.linspace(0.875, 0.0, 8).tolist())


def with_contact(
    model: NetworkModel, group: Group, without: Callable[[], LinesAtRest], starts: Callable[[], Iterator[Start]]
) -> tuple[NetworkModel, LinesAtRest]:
    """Return an equilibrium without contact or, where that will not do, with it; and the model that it is of.

    With contact it is that to which a damped motion leads from the first start that is apart; the last start is the
    equilibrium without contact.  That is done for lines that contact is asked for, and that would touch, have lost
    turns of their ends or have passed through each other on the way from their first shapes.  It is done, too, for one
    by itself that may touch and has lost turns on all ways.

    starts: begins anew at every call.  An equilibrium within itself comes back where no start is apart.
    """
    try:
        found = without()
    except LineFailed as failed:
        if failed.outcome == Outcome.TURNS_LOST:
            model, group = letting_touch(model, group)
        if not any(_touch(group.lines)) or (first := _first_apart(model, group, starts())) is None:
            raise
        try:
            return model, at_rest_with_contact(model, group, first)
        except LineFailed as too:
            tried = "\n              ".join(x for x in (failed.detail, too.detail) if x)
            raise LineFailed(failed.line, failed.outcome, None, failed.s, tried) from None
    if not any(_touch(group.lines)):
        return model, found
    first_shapes = _before_current(model)
    lost = bool(keeps_turns(group.lines, first_shapes, OF_SHAPE)(found.state)[1])
    lost = lost or _passes_another(model, group, first_shapes, found.state)
    each = zip(_touch(group.lines), model.models, found.state.lines, strict=True)
    lost = lost or any(touches and passes_itself(x, state) for touches, x, state in each)
    if not (lost or _largest_energy(model, group, found.state)):
        return model, found
    last: list[Start] = [] if lost else [("the equilibrium without contact", found.state)]
    before = [("lines hung in still water", first_shapes)] if model.touching is not None else []
    first = _first_apart(model, group, chain(before, starts(), last))
    return model, found if first is None else at_rest_with_contact(model, group, first)


def letting_touch(model: NetworkModel, group: Group) -> tuple[NetworkModel, Group]:
    """Let a line by itself touch itself where it may, and no scene asks for that."""
    if not (group.is_alone and group.lines[0].line.bits & MAY_TOUCH):
        return model, group
    line = touching(group.lines[0].line, 0.0)
    own = replace(model.models[0], line=line)
    return replace(model, models=(own,)), group._replace(lines=[group.lines[0]._replace(line=line)])


def passes_itself(model: Model, state: State) -> bool:
    """Whether a line whose first shape the scene gives would pass through itself on the straight way from there.

    Where it does not, no knot or loop of that shape is lost in the state.  Where it does, one may be, or not.
    """
    if model.start_shape != GIVEN:
        return False
    kept = np.unique(np.linspace(0, model.cells, min(model.cells, MOST_NODES) + 1).round().astype(int))
    way = np.stack([model.start.r[kept], state.r[kept]])
    return jumps(way, way) > 2.0 * JUMP  # every pair of places counts twice


def contact_of(model: Model) -> SelfContact:
    """Contact without friction of the line of a model with itself."""
    return SelfContact(model.line, diameters(model), least_bending(model), model.tension_scale)


def _passes_another(model: NetworkModel, group: Group, first: NetworkState, found: NetworkState) -> bool:
    """Whether a line passes through another one from its first shape to an equilibrium that knows no contact.

    Where a current acts by the equilibria while it grows, as far as there are any: two lines that pass through each
    other twice, first in a weak current and again in a strong one, do not on the straight way.
    """
    if model.touching is None:
        return False
    way = [found]
    if any(is_in_current(group.lines[k].line, group.lines[k].sea) for k in model.touching.lines):
        smooth = [x._replace(line=x.line._replace(bits=x.line.bits & ~FRICTION)) for x in group.lines]
        solver = NetworkSolver(smooth, group.points, group.bodies.copy())
        way += in_slower_currents(solver, found, SLOWER, Tally()) or []
    return any(True for a, b in pairwise((first, *way[::-1])) for _ in crossed(model.touching, a, b))


def crossings(network: Network, model: NetworkModel, rest: NetworkState) -> list[tuple[int, int]]:
    """Numbers of lines, two each, without contact, that cross on the straight way from first shapes to an equilibrium.

    A first shape says on which side of another line one lies where the scene gives it, or it hangs between held places.
    """
    known = [
        x.start_shape == GIVEN or not (network.is_joined(line.start) or network.is_joined(line.end))
        for x, line in zip(model.models, network.lines.values(), strict=True)
    ]
    pairs = watched_pairs(network, model)
    among = touching_among(network, model.scenes, pairs[np.array(known)[pairs].all(axis=1)])
    if among is None:
        return []
    return [*crossed(among, _before_current(replace(model, touching=among)), rest)]


def _before_current(model: NetworkModel) -> NetworkState:
    """The first shapes of all lines, of those that touch others as they hang in still water.

    They say on which side of another line each lies: a current that comes then drives it against the other one, and
    not through it.
    """
    states = [x.start for x in model.models]
    for k in model.touching.lines if model.touching is not None else ():
        x, scene = model.models[k], model.scenes[model.names[k]]
        sea = x.sea.values
        if x.start_shape == HUNG and is_in_current(x.line, sea):
            shape = hung(scene, x.line, sea._replace(current=np.zeros_like(sea.current)))
            if shape is not None:
                states[k] = first_state(scene, x.line, x.cable, x.sea, x.tension_scale, shape)[0]
    return NetworkState(states, model.body_places)


def at_rest_with_contact(model: NetworkModel, group: Group, start: NetworkState, near: bool = False) -> LinesAtRest:
    """The equilibrium with contact that a damped motion reaches from a start that is apart; near: as of that."""
    lines, keeps = group.lines, keeps_turns(group.lines, start, KEPT)
    return settled_network(lines, group.points, group.bodies.copy(), start, lambda: contacts_of(model), keeps, near)


def contacts_of(model: NetworkModel) -> tuple[list[SelfContact | None], SharedContact | None]:
    """Contact without friction of each line that it is asked for, and of lines with each other."""
    own = [contact_of(x) if touches_alone(model, k) else None for k, x in enumerate(model.models)]
    return own, shared_of(model)


def touches_alone(model: NetworkModel, number: int) -> bool:
    """Whether contact is asked for of a line with itself, and not with others."""
    others = model.touching.lines if model.touching is not None else ()
    return bool(model.models[number].line.bits & SELF_CONTACT) and number not in others


def _touch(lines: Iterable[JoinedLine]) -> list[bool]:
    return [bool(x.line.bits & SELF_CONTACT) for x in lines]


def _largest_energy(model: NetworkModel, group: Group, state: NetworkState) -> float:
    """Largest energy, J, of contact of lines that it is asked for; infinite: parts are in each other."""
    each = enumerate(zip(group.lines, model.models, state.lines, strict=True))
    found = [contact_of(m).energy_of(x.line, x.ends, one) for k, (x, m, one) in each if touches_alone(model, k)]
    if model.touching is not None:
        found.append(energy_between(model, group.lines, group.bodies, state)[0])
    return max(found)


def energy_between(
    model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, state: NetworkState
) -> tuple[float, SharedContact]:
    """Energy, J, of contact of lines with each other at rest, and that contact; infinite: they are in each other."""
    solver = touching_solver(lines, len(model.free), bodies, lambda: ([], shared_of(model)))
    assert solver.shared is not None
    return solver.contact_energy(state), solver.shared


def nearness_in(model: NetworkModel, lines: Sequence[JoinedLine], found: LinesAtRest, t: float) -> dict[int, Floats]:
    """How near nodes (N+1,) of lines at rest are to what they may touch, by number: above 1, nearer than two diameters.

    Lines that touch neither themselves nor others are not in it.
    """
    near = dict[int, Floats]()
    for k, (x, state) in enumerate(zip(model.models, found.state.lines, strict=True)):
        if touches_alone(model, k):
            contact = contact_of(x)
            near[k] = contact.watch_nearness(1.0)
            contact.energy_of(x.line, x.ends.at_time(t), state)
    if model.touching is not None:
        bodies = found.bodies
        solver = touching_solver(lines, len(model.free), bodies, lambda: ([], shared_of(model)))
        assert solver.shared is not None
        near |= solver.shared.watch_nearness(1.0)
        solver.contact_energy(found.state)
    return near


def _first_apart(model: NetworkModel, group: Group, starts: Iterable[Start]) -> NetworkState | None:
    """The first start in which no line is within itself, or another."""
    return next((state for _, state in starts if math.isfinite(_largest_energy(model, group, state))), None)


def keeps_turns(
    lines: Sequence[JoinedLine], start: NetworkState, within: float
) -> Callable[[NetworkState], tuple[int, str]]:
    """What tells of the first line whose link in a state is not that of the start.

    Of those whose turns cannot change: contact is asked for, and what holds their twist does not turn.
    """
    holds = [bool(x.line.bits & SELF_CONTACT) and holds_twist(x.line) and not x.seats[:, TURNS].any() for x in lines]
    asked = {k: _link(x, start.lines[k]) for k, x in enumerate(lines) if holds[k]}

    def lost(states: NetworkState) -> tuple[int, str]:
        for k, link in asked.items():
            has = _link(lines[k], states.lines[k])
            if abs(has - link) > within:
                why = "it has gone around a clamp, or its cells are too long for its loops"
                return k, f"the start has a link of {link:.6g} turns, the line in contact {has:.6g}: {why}"
        return -1, ""

    return lost


def _link(x: JoinedLine, state: State) -> float:
    return float(link_of(x.line, x.ends, state.r, state.e, state.a1, state.turn)[LINK])


def refuse_start_in_obstacles(model: Model, state: State, key: str = "initial") -> None:
    """SceneError: a line that begins where the scene has it is deep in an obstacle; key: of its start."""
    line, sea = model.line, model.sea.at_time(0.0)
    if not line.bits & OBSTACLES:
        return
    met = cells_met(sea.carried, line.s) if sea.carried.size else None
    within = depths_in_obstacles(sea, state.r, line.s, met)
    which, node = (int(x) for x in np.unravel_index(np.argmax(within), within.shape))
    if within[which, node] > 1.0:
        given = f"a shape that is in obstacle {model.sea.names[which]} at s = {line.s[node]:.6g} m"
        raise SceneError([Complaint(key, given, "a start outside of obstacles", "move it, or the obstacle")])


def begin_as_placed(
    model: NetworkModel, scenes: Sequence[LineScene], state: NetworkState, events: Sequence[EventLog]
) -> None:
    """Make a start that is no equilibrium ready, line by line.

    Clamps that its shape does not fit are reached smoothly, what is drawn is noted, and what lies still on the seabed
    has the friction that keeps it there.
    """
    each = zip(model.names, model.models, model.joints, scenes, state.lines, events, strict=True)
    for name, x, joints, scene, one, log in each:
        refuse_start_in_obstacles(x, one, f"lines.{name}.initial")
        note_drawn(scene, log)
        rotate_ends_in(scene, x, one, log, (joints[0] < 0, joints[1] < 0))
        hold_by_friction(x.line, x.sea.at_time(0.0), joined_ends(x.ends.at_time(0.0), joints), one)


def blended_of_lines(network: Network) -> Iterator[tuple[str, str]]:
    """Points and bodies of lines, and texts of `note_blended`; empty ones of what has no file."""
    for name, point in network.points.items():
        if isinstance(point, FixedPoint):
            yield name, blended_text(f"points.{name}", point.motion, point.position, bool(network.clamped_at(name)))
    for name, body in network.bodies.items():
        if isinstance(body, FixedBody):
            yield "", blended_text(f"bodies.{name}", body.motion, body.position, True)


def named(failed: LineFailed, model: NetworkModel, first: str = "", left: Path | None = None) -> ComputationError:
    """The same with the name of the line in its detail; first: to try before the usual remedy; left: a snapshot."""
    where = f"line {model.names[failed.line]}" if failed.line >= 0 else "the points"
    detail = f"{where}; {failed.detail}" if failed.detail else where
    if failed.outcome == Outcome.STOPPED:  # by what names itself
        detail = failed.detail
    name = model.names[failed.line] if failed.line >= 0 else ""
    first = first or failed.first
    if not first and failed.line >= 0:
        first = slack_remedy(model.models[failed.line], failed.outcome, failed.s)
    return ComputationError(failed.outcome, failed.t, failed.s, detail, left, first, name)


# What an end does that the start of a cable does not fit: blended in, with an event that says how.
#
# Motion files that do not start at rest where the end is, and tangents that the initial shape does not have; and what
# the
# line itself does not fit: points that are further apart, or nearer to each other, than it is long.

AT_REST = 1e-9  # m, deg, m/s or deg/s, below which a record starts at rest
# Of the strain that a section bears, the part beyond which a line along points starts stretched: 0.1 % of wire.
DRAWN = 0.02


def blended_text(where: str, motion: Motion | None, position: Triple | None, turns: bool) -> str:
    """How the file of a motion begins, and until when it is blended in; empty: it has no file or no ramp.

    position: m, of what moves; turns: whether it holds a direction.
    """
    if motion is None or motion.file is None or motion.ramp is None:
        return ""
    record, parts = motion_record(motion, position, turns), []
    bases = (np.array(position or (0.0, 0.0, 0.0)), np.zeros(3))
    for values, base, units in ((record.shift, bases[0], "m"), (record.rotation, bases[1], "deg")):
        if values is None:
            continue
        first = np.array([np.interp(0.0, record.times, column) for column in values.T])
        i = max(int(np.searchsorted(record.times, 0.0, side="right")) - 1, 0)
        speed = np.linalg.norm((values[i + 1] - values[i]) / (record.times[i + 1] - record.times[i]))
        for size, unit in ((float(np.linalg.norm(first - base)), units), (float(speed), f"{units}/s")):
            parts += [f"{size:.4g} {unit}"] if size > AT_REST else []
    begins = f"begins with {', '.join(parts)}" if parts else "begins at rest where it is held"
    return (
        f"the motion of {where} in {record.name} {begins}: it is blended in over {motion.ramp:g} s (ramp), and "
        "followed exactly from then on"
    )


def note_drawn(scene: LineScene, events: EventLog) -> None:
    """An event for a line that starts stretched, or compressed, as its points are drawn and its ends do not ask for."""
    initial, cable, held = scene.initial, scene.cable, scene.ends.held()
    if not isinstance(initial, Points) or initial.arc_lengths is not None or cable.inextensible:
        return
    fits = max(cable.length, math.dist(held["start"], held["end"]) if len(held) == 2 else 0.0)
    drawn = initial.knots[-1]
    if abs(drawn - fits) > DRAWN * cable.length * min(x.strain_limit for x in cable.sections):
        strain = drawn / cable.length - 1.0
        how = "stretched" if strain > 0.0 else "compressed"
        text = (
            f"a line of {cable.length:.6g} m that starts along {drawn:.6g} m of points, {how} by {abs(strain):.2%}: "
            f"initial.points: expected {fits:.6g} m in all: move the points; or write `kind: equilibrium`, "
            "and it starts at rest; where it is meant, give initial.arc_lengths"
        )
        events.event(0.0, 0.0, cable.length, "implausible", text)


def rotate_ends_in(scene: LineScene, model: Model, state: State, events: EventLog, held: tuple[bool, bool]) -> None:
    """Tangents that the initial shape does not have are reached smoothly, and an event says so.

    held: whether the start and the end are held, and not on what moves by the lines.
    """
    e = state.e
    d = (e[0] / np.linalg.norm(e[0]), e[-1] / np.linalg.norm(e[-1]))
    which = [bool(model.line.element[-k]) and held[k] for k in (0, 1)]
    duration = min(model.time_scale, 0.5 * scene.require_time().duration)
    for k, angle in model.ends.bring_in(d, which, duration):
        s = float(model.line.s[-k])
        text = (
            f"the initial shape misses the tangent prescribed at s = {s:g} m by {np.degrees(angle):.3g} deg: "
            f"it is rotated to it, and a force there grows, over the first {duration:.3g} s; "
            f"start from an equilibrium to avoid this"
        )
        events.event(0.0, s, s, "end rotated in", text)
