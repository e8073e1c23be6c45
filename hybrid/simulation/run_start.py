"""What a run of several lines begins with: their equilibrium, and the lines as the solver takes them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.junctions.bodies import NUMBERS
from hybrid.kernels.junctions.carried_frames import TURNS
from hybrid.kernels.laws.members import PIECE, PUSH, WATER, WET
from hybrid.kernels.state.report import FRICTION, OBSTACLES, SELF_CONTACT, WAVES
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.network import NetworkModel, balanced_places, starts_between
from hybrid.model.plane import as_kept, leaves_plane, planar
from hybrid.scene.base import dotted
from hybrid.scene.bodies import FixedBody
from hybrid.scene.end_loads import Triple
from hybrid.scene.motion import motion_record
from hybrid.scene.motion_tables import Motion
from hybrid.scene.network_scene import Network, floating_groups
from hybrid.scene.points import Fairlead, FixedPoint
from hybrid.scene.schema import LineScene, Points
from hybrid.simulation.contact_equilibrium import refuse_start_in_obstacles
from hybrid.simulation.diagnostics import borne_strain
from hybrid.simulation.equilibrium import count_turns, equilibrium_of, settling, solve_like
from hybrid.simulation.events import EventLog
from hybrid.simulation.lines_contact_equilibrium import settle, solve_with_contact
from hybrid.simulation.slack_bends import slack_remedy
from hybrid.solve.flaws import ON_BED, rubs_on
from hybrid.solve.joined import JoinedLine, LineFailed, NetworkState, joined_ends
from hybrid.solve.lines_at_rest import LinesAtRest, lines_at_rest, settled_with_friction
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.search import Start
from hybrid.solve.statics import Equilibrium
from hybrid.solve.stepper import Stepper

# Equilibria until the water around members is that of the place found, and what of the largest wetted part, velocity
# and acceleration there counts as the same.
MOST_ROUNDS, SAME_WATER = 40, 1e-8
# Lengths of its line from a held point to the first place of another, beyond which that is named where no equilibrium
# is found; nearer ones are found.
FAR = 3.0


def equilibrium_of_system(system: Network, model: NetworkModel, t: float, friction: bool = True) -> LinesAtRest:
    """Equilibrium with the loads of time t (s; infinity: of full size).  ComputationError: none is found.

    friction: whether it settles on the bed, of lines that ask for that.
    """
    if floating := [Complaint(dotted(x.at), str(x.given), x.expected, x.fix) for x in floating_groups(system)]:
        raise SceneError(floating)
    try:
        numbers = model.body_numbers(t)
        if _are_alone(model, friction):
            return _keep_turns(model, t, _each_alone(system, model, t))
        found = solve_with_contact(model, joined_lines(model, t), numbers, lambda: _starts(system, model))
        _keep_turns(model, t, found)
        if friction and not found.settled:
            first = NetworkState([x.start for x in model.models], model.body_places)
            found = _with_friction(model, t, found, numbers, _ways(model), first)
        if not any(body.members for body in model.bodies):
            return found
        part, before = 1.0, None
        for _ in range(MOST_ROUNDS):  # members feel the water where they come to rest
            there = numbers.copy()
            model.stir(t, found.state.bodies, 0.0, there)
            if _same_water(there, numbers):
                return found
            change = there - numbers
            if before is not None:  # Aitken's factor, for members that the water lifts out of it or pulls under
                more = change - before
                part = float(np.clip(-part * (before * more).sum() / max((more * more).sum(), 1e-300), 0.05, 1.0))
            numbers += part * change
            before = change
            found = solve_from(found, model, t, numbers, found.state, "members where they came to rest")
        told = f"the place of a body and the water around its members do not agree after {MOST_ROUNDS} equilibria; "
        raise LineFailed(-1, Outcome.NOT_CONVERGED, None, None, told + "take a nearer initial_guess, or more pieces")
    except LineFailed as failed:
        raise named(failed, model, _nearer(system)) from None


def _nearer(system: Network) -> str:
    """What to try first where a point is looked for farther away than a line to a held point reaches; else empty."""
    worst, text = FAR, ""
    for name, place in system.guesses.items():
        for line, end in system.lines_at(name):
            other = system.lines[line].end if end == "start" else system.lines[line].start
            if not system.is_held(other):
                continue
            length = sum(section.length for section in system.lines[line].sections)
            away = math.dist(place, system.first_place(other))
            if away > worst * length:
                point, worst = system.points[name], away / length
                key = f"bodies.{point.body}" if isinstance(point, Fairlead) else f"points.{name}"
                text = (
                    f"{key}.initial_guess nearer: {away:.6g} m from points.{other}, line {line} is {length:.6g} m long"
                )
    return text


def solve_from(
    found: LinesAtRest, model: NetworkModel, t: float, bodies: Floats, start: NetworkState, name: str
) -> LinesAtRest:
    """The equilibrium with the loads of time t from a start next to another one, with contact if that has it."""
    lines = joined_lines(model, t)
    if found.alone:
        each = zip(model.models, start.lines, found.alone, strict=True)
        return _keep_turns(model, t, _together(model, t, [solve_like(x, t, state, like) for x, state, like in each]))
    if found.settled:
        return _keep_turns(model, t, settle(model, lines, bodies, start, near=True))
    ways, why = {k: way for k, way in _ways(model).items() if k in found.with_friction}, found.not_settled
    if "start" in ways.values():  # where the lines were laid, which nothing else leads to
        ways = dict.fromkeys(ways, "start")
    else:
        found = lines_at_rest(lines, len(model.free), bodies, [(name, start)])
        found = _keep_turns(model, t, replace(found, not_settled=why))
    return _with_friction(model, t, found, bodies, ways, start)


def _ways(model: NetworkModel) -> dict[int, str]:
    """How friction of the bed settles (`settling`), by number of the lines of which it does."""
    touching = set(model.touching.lines) if model.touching is not None else set()
    each = enumerate(zip(model.names, model.models, strict=True))
    found = {k: settling(model.scenes[name], x, k in touching or model.rides.size > 0) for k, (name, x) in each}
    return {k: way for k, way in found.items() if way}


def _are_alone(model: NetworkModel, friction: bool) -> bool:
    """Whether each line is joined to nothing that moves and asks for no contact: what it finds, no other line knows."""
    joined = bool(model.free or len(model.body_places)) or model.touching is not None
    touches = any(x.line.bits & SELF_CONTACT for x in model.models)
    return not (joined or touches or (not friction and _ways(model)))


def _each_alone(system: Network, model: NetworkModel, t: float) -> LinesAtRest:
    """The equilibria of lines that are joined to nothing that moves, found one by one, as of one cable."""
    found = []
    for k, (name, x) in enumerate(zip(model.names, model.models, strict=True)):
        try:
            kept = replace(x, line=as_kept(x.line, x.plane, x.kept_in))
            found.append(equilibrium_of(model.scenes[name], kept, t))
        except ComputationError as failed:
            detail = failed.detail.replace("ends.", f"lines.{name}.connections.")
            raise LineFailed(k, failed.outcome, None, failed.s, detail, first=failed.first) from None
    return _together(model, t, found)


def _together(model: NetworkModel, t: float, found: Sequence[Equilibrium]) -> LinesAtRest:
    """Equilibria of all lines as one."""
    rubs = frozenset(k for k, x in enumerate(found) if x.with_friction)
    states = NetworkState([x.state for x in found], model.body_places)

    def solver() -> NetworkSolver:
        lines = []
        for k, (x, own, one) in enumerate(zip(joined_lines(model, t), model.models, found, strict=True)):
            line = x.line._replace(bits=x.line.bits & ~WAVES & ~(0 if k in rubs else FRICTION))
            if own.plane is not None and not leaves_plane(own.plane, one.state, own.length):
                line = planar(line, own.plane)  # in which it was found, so that nothing is compiled for space
            lines.append(x._replace(line=line))
        made = NetworkSolver(lines, 0, model.body_numbers(t))
        made.blurred = {k for k, x in enumerate(found) if x.blurred}
        made.evaluate_forces(states, made.anchor)
        return made

    path = max(found, key=lambda x: len(x.path)).path  # of the line that took most ways
    touches, why = any(x.touches for x in found), next((x.unjudged for x in found if x.unjudged), "")
    return LinesAtRest(
        states, path, sum(x.iterations for x in found), max(x.residual for x in found), solver, touches, why, rubs,
        tuple(found), {k: x.not_settled for k, x in enumerate(found)},
    )  # fmt: skip


def _with_friction(
    model: NetworkModel, t: float, found: LinesAtRest, bodies: Floats, ways: Mapping[int, str], first: NetworkState
) -> LinesAtRest:
    """The equilibrium in which friction has settled from one without it, in these ways (`settling`) of lines.

    first: from where lines come to rest where a scene asks for that.  LineFailed: none is found where one is asked for.
    """
    lines, asked = joined_lines(model, t), {k: way for k, way in ways.items() if way != "usual"}
    here = [(x.line, x.sea, x.ends.held, state) for x, state in zip(lines, found.state.lines, strict=True)]
    ways = {k: way for k, way in ways.items() if k in asked or rubs_on(*here[k]) == [ON_BED]}
    if not ways:
        return found
    try:
        laid = settled_with_friction(lines, len(model.free), bodies, ways, found, first)
        return _keep_turns(model, t, replace(laid, not_settled=found.not_settled))
    except LineFailed as failed:
        if len(asked) == len(ways):
            raise
        why = {**found.not_settled, **dict.fromkeys(ways.keys() - asked.keys(), failed.outcome.cause)}
    if asked:
        found = _keep_turns(model, t, settled_with_friction(lines, len(model.free), bodies, asked, found, first))
    return replace(found, not_settled=why)


def _keep_turns(model: NetworkModel, t: float, found: LinesAtRest) -> LinesAtRest:
    """The same equilibrium; LineFailed where a line has lost turns by which its ends, which hold it, twist it.

    A motion with contact keeps them by itself, in the writhe of loops as well (system_contact_equilibrium.settle).
    """
    for k, (name, x, state) in enumerate(zip(model.names, model.models, found.state.lines, strict=True)):
        keeps_link = bool(x.line.bits & SELF_CONTACT) and not model.seats[k, :, TURNS].any()
        keeps_link = found.settled and (found.alone[k].touches if found.alone else keeps_link)
        try:
            count_turns(model.scenes[name], x, t, state, model.turns[k], keeps_link)
        except ComputationError as failed:
            detail = failed.detail.replace("ends.", f"lines.{name}.connections.")
            if model.seats[k, :, TURNS].any():
                detail += "; what it is clamped to may turn by less than half a turn until then (initial_rotation)"
            raise LineFailed(k, failed.outcome, None, failed.s, detail) from None
    return found


def _same_water(there: Floats, taken: Floats) -> bool:
    """Whether wetted parts, velocity and acceleration of the water in numbers of bodies are the same."""
    now, then = (x[:, NUMBERS:].reshape(-1, PIECE) for x in (there, taken))
    return all(
        np.abs(now[:, a:b] - then[:, a:b]).max() <= SAME_WATER * np.abs(now[:, a:b]).max()
        for a, b in ((WET, WATER), (WATER, PUSH), (PUSH, PIECE))
    )


def _starts(system: Network, model: NetworkModel) -> Iterator[Start]:
    """Shapes from which the equilibrium is looked for."""
    several = len(model.models) > 1
    shape = "lines hung between the first places" if several else model.models[0].start_shape
    yield shape, NetworkState([x.start for x in model.models], model.body_places)
    system = system.searched()
    places = balanced_places(system, model)
    if places is not None and len(model.places) + len(model.body_places):
        yield "lines hung between places that balance", NetworkState(*starts_between(system, *places, model))


def joined_lines(model: NetworkModel, t: float) -> list[JoinedLine]:
    """The lines with their ends and their sea at t (s), whose arrays `ends.at` and `sea.at` overwrite."""
    lines = []
    for x, joints, fairleads, seats in zip(model.models, model.joints, model.fairleads, model.seats, strict=True):
        ends, floor, slackens = joined_ends(x.ends.at(t), joints), x.slack_floor, x.slack == "warn"
        lines.append(
            JoinedLine(
                x.line, x.sea.at(t), ends, x.length, x.tension_scale, floor, joints, fairleads, seats, slackens,
                model.rides, borne_strain(x) if x.line.bits & OBSTACLES else np.zeros(0),
                x.payout is not None or x.layout is not None,
                x.payout is not None and x.payout.holds_tension,
            )
        )  # fmt: skip
    return lines


def begin_as_placed(
    model: NetworkModel, scenes: Sequence[LineScene], state: NetworkState, events: Sequence[EventLog]
) -> None:
    """Make a start that is no equilibrium ready, of each line as of one cable: clamps that its shape does not fit are

    reached smoothly, what is drawn is noted, and what lies still on the seabed has the friction that keeps it there.
    """
    each = zip(model.names, model.models, model.joints, scenes, state.lines, events, strict=True)
    for name, x, joints, scene, one, log in each:
        refuse_start_in_obstacles(x, one, f"lines.{name}.initial")
        note_drawn(scene, log)
        rotate_ends_in(scene, x, one, log, (joints[0] < 0, joints[1] < 0))
        stepper = Stepper(x.line, x.length, x.tension_scale)
        stepper.static_friction(x.sea.at(0.0), joined_ends(x.ends.at(0.0), joints), one)


def blended_of_lines(system: Network) -> Iterator[tuple[str, str]]:
    """Points and bodies of lines, and texts of `note_blended`; empty ones of what has no file."""
    for name, point in system.points.items():
        if isinstance(point, FixedPoint):
            yield name, blended_text(f"points.{name}", point.motion, point.position, bool(system.clamped_at(name)))
    for name, body in system.bodies.items():
        if isinstance(body, FixedBody):
            yield "", blended_text(f"bodies.{name}", body.motion, body.position, True)


def named(failed: LineFailed, model: NetworkModel, first: str = "", left: Path | None = None) -> ComputationError:
    """The same with the name of the line in its detail; first: to try before the usual remedy; left: a snapshot."""
    where = f"line {model.names[failed.line]}" if failed.line >= 0 else "the points"
    detail = f"{where}; {failed.detail}" if failed.detail else where
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


def rotate_ends_in(
    scene: LineScene, model: Model, state: State, events: EventLog, held: tuple[bool, bool] = (True, True)
) -> None:
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
