"""What may contradict in a network: between points, bodies and lines, and in each line alone."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, combinations
from typing import Any

from hybrid.scene.analysis import Equilibrium
from hybrid.scene.base import Finding, Place, nearest
from hybrid.scene.bodies import FixedBody, FreeBody
from hybrid.scene.checks import accuracy_has_errors, contradictions, elevation_has_waves, without_diameter
from hybrid.scene.combinations import holds_rod, refused, tables_of
from hybrid.scene.ends import Clamped, ClampedConnection, Ends, Fairlead, FixedPoint, Free, FreePoint, GuidedPoint
from hybrid.scene.motion_checks import motion_findings
from hybrid.scene.motion_tables import TURNS, Motion, farthest, moving_key, shift, smaller
from hybrid.scene.network import JoinedLine, Network
from hybrid.scene.plane import TYPED, plane_of
from hybrid.scene.quantities import of_several_lines
from hybrid.scene.start_checks import SAME_LENGTH


def findings_of(network: Network, judged: bool = False) -> Iterator[Iterator[Finding]]:
    """What contradicts in a network, in groups: of the first one with findings no later one makes sense.

    judged: whether each line has been by itself, in the short form.
    """
    yield _unknown_names(network)
    yield iter(dict.fromkeys(x for tables in tables_of(network) for x in refused(tables)))
    yield chain(_lonely_points(network), () if network.starts_as_placed else floating_groups(network))
    yield _start_findings(network)
    yield connection_findings(network)
    yield _touching_findings(network)
    yield chain.from_iterable(_body_findings(network, name) for name in network.bodies)
    yield chain.from_iterable(_moment_findings(network, name) for name in network.points)
    yield chain.from_iterable(_line_findings(network, name) for name in network.lines if not judged)
    yield _in_a_plane(network)
    yield travel_findings(network)
    yield elevation_has_waves(network.output, network.environment)
    asked = (x.accuracy for x in network.lines.values() if x.accuracy is not None)
    yield accuracy_has_errors(network.accuracy or next(asked, None), network.output)
    yield of_several_lines(network.output.quantities, network.lines, network.environment.seabed is not None)


def _unknown_names(network: Network) -> Iterator[Finding]:
    for name, line in network.lines.items():
        for key in ("start", "end"):
            yield from _unknown(getattr(line, key), network.points, ("lines", name, key), "point")
    for name, point in network.points.items():
        if isinstance(point, Fairlead):
            yield from _unknown(point.body, network.bodies, ("points", name, "body"), "body")
    for i, pair in enumerate(network.contact.between or () if network.contact is not None else ()):
        for k, name in enumerate(pair):
            yield from _unknown(name, network.lines, ("contact", "between", i, k), "line")
        if pair[0] == pair[1]:
            expected = "two lines; whether a line touches itself is asked by lines.NAME.contact"
            yield Finding(("contact", "between", i), expected, "name another line, or leave the pair out")
    points = network.output.points
    for key, names in (("history", network.output.history), ("points", points if isinstance(points, dict) else {})):
        for name in names:
            yield from _unknown(name, network.lines, ("output", key, name), "line")


def _lonely_points(network: Network) -> Iterator[Finding]:
    for name, point in network.points.items():
        if not network.lines_at(name):
            kind = "a free point" if isinstance(point, FreePoint) else "a point"
            expected = f"{kind} at which a line starts or ends"
            yield Finding(
                ("points", name), expected, f"leave it out, or let a line end there: `end: {name}`", "no line"
            )
        elif isinstance(point, GuidedPoint):
            yield from _guided_findings(network, name)
        elif isinstance(point, FreePoint) and point.initial_guess is None and not network.is_free_end(name):
            expected = "three numbers [x, y, z], in m, from where the equilibrium of the lines that meet here is sought"
            yield Finding(("points", name, "initial_guess"), expected, "add `initial_guess: [x, y, z]` (m)", "nothing")
        elif isinstance(point, FreePoint) and all(network.breaks(*at) for at in network.lines_at(name)):
            line, _ = network.lines_at(name)[0]
            expected = f"a line at point {name} that does not break there and carries what is left"
            fix = "leave it out of one of them, or let it break at its other end"
            yield Finding(("lines", line, "break_at"), expected, fix)
    on = {point.body for point in network.points.values() if isinstance(point, Fairlead)}
    for name in network.bodies:
        if name not in on and name not in network.shaped:
            fix = f"add a point `{{body: {name}, place: [0, 0, 0]}}` and a line to it, or leave the body out"
            yield Finding(("bodies", name), "a body with a fairlead among the points", fix, "no fairlead")


def _guided_findings(network: Network, name: str) -> Iterator[Finding]:
    """What is wrong with a guided point: one line is clamped there, in a direction of the world."""
    (line, end), *others = network.lines_at(name)
    if others:
        expected = "free, because a guided point is the end of one line, and several end here"
        yield Finding(("points", name, "kind"), expected, "clamp the lines to each other: `kind: free`", "guided")
    held, at = network.clamp(line, end), ("lines", line, "connections", end)
    if held is None or held.tangent is None:
        expected = f"the direction in which point {name} holds the line"
        yield Finding((*at, "tangent"), expected, "add `tangent: [0, 0, 1]`", "nothing")
        return
    wrong = [key for key in ("swivel", "bend_stiffness", "payout") if getattr(held, key) not in (None, False)]
    for key in wrong:
        expected = f"nothing, because point {name} is guided: without a `normal` it lets the line spin"
        yield Finding((*at, key), expected, "leave it out")


def floating_groups(network: Network) -> Iterator[Finding]:
    """Free points and bodies from which no way along lines leads to what is fixed: none of them has an equilibrium."""
    ways = [{x.start, x.end} for x in network.lines.values()]
    ways += [{p, f"body {x.body}"} for p, x in network.points.items() if isinstance(x, Fairlead)]
    held = {name for name, point in network.points.items() if isinstance(point, FixedPoint)}
    fluid = network.environment.fluid
    if network.environment.seabed is not None or (fluid is not None and fluid.surface is not None):  # may bear a line
        alone = [x for x in network.lines.values() if network.is_free_end(x.start) and network.is_free_end(x.end)]
        held |= {p for x in alone for p in (x.start, x.end)}  # each of them is judged by itself
    held |= {f"body {name}" for name, body in network.bodies.items() if isinstance(body, FixedBody)}
    while more := {p for way in ways if way & held for p in way} - held:
        held |= more
    for name, point in network.points.items():
        if name not in held and isinstance(point, FreePoint):
            expected = "a free point that lines join to a fixed one, at least by way of others"
            yield Finding(("points", name), expected, "make one of these points `kind: fixed`", "nothing holds it")
    for name in network.bodies:
        if f"body {name}" not in held and name not in network.shaped:
            expected = "a free body that lines join to what is fixed, at least by way of other points"
            yield Finding(("bodies", name), expected, "let one of its lines end at a fixed point", "nothing holds it")


def _start_findings(network: Network) -> Iterator[Finding]:
    """Lines of which some start in equilibrium and others do not, and a velocity that points and bodies do not have."""
    placed = [name for name, line in network.lines.items() if not isinstance(line.initial, Equilibrium)]
    for name, line in network.lines.items() if placed else ():
        if isinstance(line.initial, Equilibrium):
            expected = f"straight or points, because line {placed[0]} starts so, and nothing is in equilibrium then"
            fix = "say so of every line; points and bodies start at rest where initial_guess has them"
            yield Finding(("lines", name, "initial"), expected, fix, "equilibrium")
            continue
        for point in filter(network.is_joined, (line.start, line.end) if any(_velocity(line)) else ()):
            if isinstance(network.points[point], Fairlead) or network.clamped_at(point):
                expected, fix = f"rest, because point {point} turns and starts at rest", "leave velocity out"
            elif len({_velocity(network.lines[other]) for other, _ in network.lines_at(point)}) > 1:
                expected = f"that of the other lines that meet at point {point}"
                fix = "leave velocity out, or give it to all of them"
            else:
                continue
            yield Finding(("lines", name, "initial", "velocity"), expected, fix)


def _velocity(line: JoinedLine) -> tuple[float, ...]:
    """The velocity, m/s, with which a line begins."""
    return tuple(getattr(line.initial, "velocity", None) or (0.0, 0.0, 0.0))


def _touching_findings(network: Network) -> Iterator[Finding]:
    """Lines that touch others have a diameter, and there are others."""
    if network.contact is not None and len(network.lines) == 1:
        expected = "nothing, because there is one line; whether it touches itself is asked by lines.NAME.contact"
        yield Finding(("contact",), expected, "leave it out")
    for name in dict.fromkeys(x for pair in network.touching_pairs for x in pair):
        why = "which lines that touch each other keep apart (contact)"
        yield from without_diameter(network.lines[name].sections, ("lines", name, "sections"), why)


def _body_findings(network: Network, name: str) -> Iterator[Finding]:
    """What is wrong with the motion of a body, or with what is given to act on it."""
    body, still = network.bodies[name], Clamped(position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0))
    if isinstance(body, FreeBody):
        in_water = [key for key in ("volume", "hydrostatics", "damping", "added_mass", "members") if getattr(body, key)]
        if in_water and network.environment.fluid is None:
            expected = f"a fluid, because body {name} has {in_water[0]}"
            yield Finding(("environment",), expected, "add `fluid: {density: 1025}`", "no fluid")
    joined = (x for x in network.lines.values() for p in (x.start, x.end) if network.body_of(p) is body)
    line = next(joined, next(iter(network.lines.values())))
    if name in network.shaped and name in network.obstacles:
        expected = f"a name that no obstacle has, because body {name} has a shape"
        yield Finding(("obstacles", name), expected, "name the one or the other differently")
    ends = Ends(start=still, end=body.end) if isinstance(body, FreeBody) else None
    if isinstance(body, FixedBody):
        moved = Clamped(position=body.position, tangent=(1.0, 0.0, 0.0), motion=body.motion)
        ends = Ends(start=moved, end=Free())
    yield from _load_findings(network, ends, line, ("bodies", name))


def _moment_findings(network: Network, name: str) -> Iterator[Finding]:
    """What is wrong with the moment on a free point."""
    point, still = network.points[name], Clamped(position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0))
    if isinstance(point, FreePoint) and point.moment is not None:
        ends, (line, _) = Ends(start=still, end=Free(moment=point.moment)), network.lines_at(name)[0]
        yield from _load_findings(network, ends, network.lines[line], ("points", name))


def _load_findings(network: Network, ends: Ends | None, line: JoinedLine, at: Place) -> Iterator[Finding]:
    """What is wrong with motions and loads of ends that stand for what is at another place of the network."""
    tables = {"ends": ends, "time": network.time, "cable": line.cable, "environment": network.environment}
    for found in motion_findings(tables):
        where = (*at, *found.at[2:]) if found.at[:1] == ("ends",) else found.at
        yield Finding(where, found.expected, found.fix, found.given)


def contradictions_of(network: Network, name: str, carrying: Sequence[str] = ()) -> list[Finding]:
    """What contradicts in a line, each under the key that the short form has for it; carrying: as of `scene_of`."""
    tables = dict(vars(network.scene_of(name, carrying)))
    if network.output.errors is False:  # that of all lines is judged by itself (`accuracy_has_errors`)
        tables["accuracy"] = None
    return contradictions(tables)


def _line_findings(network: Network, name: str) -> Iterator[Finding]:
    """What is wrong with a line and its points, each under its own key of the network."""
    wrong: dict[Finding, None] = {}  # each once
    line = network.lines[name]
    judged = () if network.is_held(line.start) or network.is_held(line.end) else (("initial", "velocity"),)
    for carrying in ((), *((key,) for key in network.carried(name))):
        found = contradictions_of(network, name, carrying)
        if not found:
            wrong |= dict.fromkeys(motion_findings(vars(network.scene_of(name, carrying))))
        # of an end that nothing holds the first shape is not judged: the other lines at its point hold it
        wrong |= dict.fromkeys(x for x in found if not ((carrying and x.at[:1] == ("initial",)) or x.at in judged))
        if wrong:
            break
    yield from (_of_network(network, name, found) for found in wrong)


def _in_a_plane(network: Network) -> Iterator[Finding]:
    """What leaves the plane of all lines."""
    scenes = {name: network.scene_of(name, network.carried(name)) for name in network.lines if network.dimension == 2}
    tables = [(x.environment, x.ends, x.initial) for x in scenes.values()]
    found = {
        _of_network(network, name, each): None
        for name, x in scenes.items()
        for each in plane_of(x.environment, x.cable, x.ends, x.initial, TYPED, tables)[1]
    }
    yield from found


def _of_network(network: Network, name: str, found: Finding) -> Finding:
    line, at = network.lines[name], found.at
    if at[:1] == ("obstacles",):  # which are those of all lines
        carried = len(at) > 1 and at[1] in network.shaped
        return replace(found, at=("bodies", at[1], "shape", *at[2:])) if carried else found
    if at[:1] == ("cable",):
        at = ("lines", name, *at[1:])
    elif at[:1] in (("model",), ("mesh",), ("resolution",), ("initial",)) or (
        at[:1] == ("accuracy",) and line.accuracy is not None
    ):
        at = ("lines", name, *at)
    elif at[:2] == ("output", "history") or (at[:2] == ("output", "points") and len(at) > 2):
        at = (*at[:2], name, *at[2:])
    elif at[:1] == ("accuracy",):
        expected = f"{found.expected}, in line {name}"
        return Finding(at, expected, f"{found.fix}; or give the other lines an `accuracy` of their own", found.given)
    elif at[:1] == ("ends",) and len(at) > 1:
        point = getattr(line, str(at[1]))
        rest = at[2:]
        if rest[:1] in (("normal",), ("turns",), ("payout",)):
            at = ("lines", name, "connections", *at[1:])
            words = (x.replace("ends.", f"lines.{name}.connections.") for x in (found.expected, found.fix))
            expected, fix = (x.replace("cable.", f"lines.{name}.") for x in words)
            return Finding(at, expected, fix, found.given)
        if rest[:1] == ("tangent",):
            at = ("lines", name, "connections", str(at[1]), *rest)
            return Finding(at, found.expected, found.fix, found.given)
        if isinstance(network.points[point], FreePoint) and rest:
            rest = ({"position": "initial_guess", "thrust": "force"}.get(str(rest[0]), rest[0]), *rest[1:])
        at = ("points", point, *rest)
        if isinstance(found_point := network.points[point], Fairlead):
            moved = rest[:1] == ("motion",)
            at = ("bodies", found_point.body, *rest) if moved else ("points", point, "place")
    given = f"of line {name}: {found.given}" if found.given else None
    return Finding(at, found.expected.replace("ends.", "line's "), found.fix, given)


def _unknown(name: str, known: Mapping[str, Any], at: Place, what: str) -> Iterator[Finding]:
    if name not in known:
        tables = {"point": "points", "body": "bodies", "line": "lines"}[what.split()[-1]]
        expected = f"the name of a {what}: {', '.join(known) or 'there is none'}"
        fix = nearest(name, dict.fromkeys(known, "")) or f"add `{name}: ...` to {tables}"
        yield Finding(at, expected, fix)


# --- how the ends of lines are connected ---------------------------------------------------------


def connection_findings(network: Network) -> Iterator[Finding]:
    """What is wrong with the connections of a network of lines."""
    for name in network.lines:
        for key in ("start", "end"):
            held = network.clamp(name, key)
            if held is not None:
                yield from _clamp_findings(network, name, key, held)
            payout = getattr(network.lines[name].connections, key).payout
            if payout is not None and isinstance(network.points[getattr(network.lines[name], key)], FreePoint):
                fix = "make the point `kind: fixed`, or the fairlead of a body"
                expected = "nothing, because a winch stands on a fixed point or on a body"
                yield Finding(("lines", name, "connections", key, "payout"), expected, fix)
    for name, point in network.points.items():
        if isinstance(point, FixedPoint) and point.motion is not None and not network.clamped_at(name):
            for turn in (x for x in point.motion.harmonics() if x in TURNS):
                fix = "leave it out, or clamp a line there: `connections: {end: {tangent: [0, 0, 1]}}`"
                expected = "no rotation, because lines turn freely at a point"
                yield Finding(("points", name, "motion", turn), expected, fix)
        elif isinstance(point, FreePoint):
            yield from _rigid_point_findings(network, name)


def _clamp_findings(network: Network, name: str, key: str, held: ClampedConnection) -> Iterator[Finding]:
    line, point = network.lines[name], getattr(network.lines[name], key)
    at = ("lines", name, "connections", key)
    stays = network.is_held(point) or isinstance(network.points[point], GuidedPoint)
    if not (stays or holds_rod(line.chosen_model, key, line.cable.length)):
        expected = "pinned, because this end of the line is a catenary, which has no moment"
        yield Finding(at, expected, "give `bending_stiffness` to all sections, and `model: rod`", "clamped")
    if held.tangent is None and not isinstance(network.points[point], FreePoint):
        yield Finding((*at, "tangent"), "the direction of the line at this end", "add `tangent: [0, 0, 1]`", "nothing")


def _rigid_point_findings(network: Network, name: str) -> Iterator[Finding]:
    """What is wrong with lines that are clamped to a free point."""
    here, point = network.clamped_at(name), network.points[name]
    if not here:
        takes = network.is_free_end(name) and isinstance(point, FreePoint) and not point.is_body
        if isinstance(point, FreePoint) and point.moment is not None and not takes:
            expected = "nothing, because all lines turn freely at this point: nothing there takes a moment"
            fix = "leave it out, or clamp two lines there: `connections: {end: clamped}` of one, `{start: clamped}`"
            yield Finding(("points", name, "moment"), expected, fix)
        return
    line, key = here[0]
    at = ("lines", line, "connections", key)
    held = [network.clamp(*x) for x in here]
    if len(here) == 1:
        expected = f"another line that is clamped at point {name}, because a free point alone holds no direction"
        yield Finding(at, expected, "clamp a second line there, or none, or make the point `kind: guided`", "one line")
    elif all(x is not None and x.bend_stiffness == 0.0 for x in held):
        expected = f"a line at point {name} without bend_stiffness 0: nothing holds the direction of the point"
        yield Finding((*at, "bend_stiffness"), expected, "leave it out for one of them", "0")
    elif len(here) > 2 or any(x is not None and x.tangent is not None for x in held):
        for (line, key), x in zip(here, held, strict=True):
            if x is not None and x.tangent is None:
                expected = f"the direction of the line in axes of point {name}, the same for all lines there"
                where = ("lines", line, "connections", key, "tangent")
                yield Finding(where, expected, "add `tangent: [1, 0, 0]`, and fitting ones to the others", "nothing")


# --- how far points that are held may be from each other -----------------------------------------


def travel_findings(network: Network) -> Iterator[Finding]:
    """Points that are, or move, farther from another than all lines between them are long, at the utmost strain."""
    # what is broken reaches anywhere
    duration = network.time.duration if network.time is not None and not network.may_break else 0.0
    placed = {name: network.first_place(name) for name in network.points if network.is_held(name)}
    motions = {name: _motion(network, name) for name in placed}
    beside = _neighbours(network)
    for name, other, reach, between in _held_pairs(placed, motions, beside):
        if not between or _beside(network, name, other):
            continue
        most = reach * (1.0 + SAME_LENGTH)
        distance, t = farthest((placed[name], placed[other]), (motions[name], motions[other]), duration, most)
        if distance <= most:
            continue
        motion, long = motions[name], sum(network.lines[x].cable.length for x in between)
        lines = f"line {between[0]}" if len(between) == 1 else f"lines {', '.join(reversed(between))}"
        expected = f"at most {reach:.8g} m from point {other}, as far as {lines} of {long:.8g} m may reach (max_strain)"
        key = moving_key(motion) if motion is not None and t > 0.0 else ""
        moved = shift(motion, t)
        at = ", ".join(f"{x + by:.6g}" for x, by in zip(placed[name], moved, strict=True))
        far = f"{distance:.8g} m from point {other}"
        if key:
            fix, given = f"longer lines, or {smaller(key)}", f"motion to [{at}] at t = {t:.6g} s, {far}"
            yield Finding(("points", name, "motion", key), expected, fix, given)
        else:
            yield Finding(("points", name), expected, "longer lines, or points that are nearer", f"[{at}], {far}")
        return


def _motion(network: Network, name: str) -> Motion | None:
    """The motion of a fixed point, if tables move it."""
    point = network.points[name]
    motion = point.motion if isinstance(point, FixedPoint) else None
    return motion if motion is not None and moving_key(motion) else None


def _beside(network: Network, a: str, b: str) -> bool:
    """Whether a point is on a body that moves as is known, whose motion is not followed here."""
    bodies = [network.body_of(x) for x in (a, b)]
    return any(isinstance(x, FixedBody) and x.motion is not None for x in bodies)


# Points beside each point: how far (m) they may be from it at most, and the line between them, if it is one.
Neighbours = Mapping[str, list[tuple[str, float, tuple[str, ...]]]]


def _neighbours(network: Network) -> Neighbours:
    """Points beside each point, along a line or on the same free body."""
    beside: dict[str, list[tuple[str, float, tuple[str, ...]]]] = {name: [] for name in network.points}
    for key, line in network.lines.items():
        if line.connections.start.payout is not None or line.connections.end.payout is not None:
            continue
        far = line.cable.length if line.cable.inextensible else line.cable.reach
        beside[line.start].append((line.end, far, (key,)))
        beside[line.end].append((line.start, far, (key,)))
    on: dict[str, list[tuple[str, Fairlead]]] = {}
    for name, x in network.points.items():
        if isinstance(x, Fairlead) and network.is_joined(name):
            on.setdefault(x.body, []).append((name, x))
    for same in on.values():
        for (a, one), (b, two) in combinations(same, 2):
            apart = math.dist(one.place, two.place)
            beside[a].append((b, apart, ()))
            beside[b].append((a, apart, ()))
    return beside


def _held_pairs(
    placed: Mapping[str, Any], motions: Mapping[str, Motion | None], beside: Neighbours
) -> Iterator[tuple[str, str, float, tuple[str, ...]]]:
    """Each two points that are held and that lines or bodies join, in the order of the scene.

    The one that moves, if one does, the other, how far (m) it may be, and the lines between them.
    """
    order = {name: i for i, name in enumerate(placed)}
    ways = {name: _reaches(beside, name) for name in placed}
    for a, i in order.items():
        for b in sorted((x for x in ways[a] if order.get(x, -1) > i), key=order.__getitem__):
            name, other = (a, b) if motions[a] is not None else (b, a)
            reach, between = ways[name][other]
            yield name, other, reach, between


def _reaches(beside: Neighbours, begin: str) -> Mapping[str, tuple[float, tuple[str, ...]]]:
    """How far (m) each point may at most be from one that is held, and by which lines.

    Along lines and bodies that are free.
    """
    reach: dict[str, tuple[float, tuple[str, ...]]] = {}
    queue: list[tuple[float, str, tuple[str, ...]]] = [(0.0, begin, ())]
    while queue:
        far, name, lines = heapq.heappop(queue)
        if name not in reach:
            reach[name] = far, lines
            for other, more, by in beside[name]:
                heapq.heappush(queue, (far + more, other, lines + by))
    return reach
