"""Contradictions between the points, bodies and lines of a scene of several lines, and those of each line alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from hybrid.scene.analysis import Equilibrium
from hybrid.scene.base import Finding, Place
from hybrid.scene.bodies import FixedBody, FreeBody
from hybrid.scene.checks import elevation_has_waves
from hybrid.scene.combinations import refused, tables_of
from hybrid.scene.connections import connection_findings
from hybrid.scene.ends import Clamped, Ends, Free
from hybrid.scene.motion_checks import motion_findings
from hybrid.scene.plane import TYPED, plane_of
from hybrid.scene.points import Fairlead, FixedPoint, FreePoint, GuidedPoint
from hybrid.scene.quantities import of_several_lines
from hybrid.scene.schema import Scene
from hybrid.scene.suggestions import nearest
from hybrid.scene.travels import travel_findings

if TYPE_CHECKING:
    from hybrid.scene.system import JoinedLine, System


def system_findings(system: System) -> Iterator[Iterator[Finding]]:
    """What contradicts in a system, in groups: of the first one with findings no later one makes sense."""
    yield _unknown_names(system)
    yield _refused_combinations(system)
    yield chain(_lonely_points(system), () if system.starts_as_placed else floating_groups(system))
    yield _start_findings(system)
    yield connection_findings(system)
    yield _touching_findings(system)
    yield chain.from_iterable(_body_findings(system, name) for name in system.bodies)
    yield chain.from_iterable(_moment_findings(system, name) for name in system.points)
    yield chain.from_iterable(_line_findings(system, name) for name in system.lines)
    yield _in_a_plane(system)
    yield travel_findings(system)
    yield elevation_has_waves(system.output, system.environment)
    yield of_several_lines(system.output.quantities, system.lines, system.environment.seabed is not None)


def _refused_combinations(system: System) -> Iterator[Finding]:
    yield from dict.fromkeys(x for tables in tables_of(system) for x in refused(tables))


def _unknown_names(system: System) -> Iterator[Finding]:
    for name, line in system.lines.items():
        for key in ("start", "end"):
            yield from _unknown(getattr(line, key), system.points, ("lines", name, key), "point")
    for name, point in system.points.items():
        if isinstance(point, Fairlead):
            yield from _unknown(point.body, system.bodies, ("points", name, "body"), "body")
    for i, pair in enumerate(system.contact.between or () if system.contact is not None else ()):
        for k, name in enumerate(pair):
            yield from _unknown(name, system.lines, ("contact", "between", i, k), "line")
        if pair[0] == pair[1]:
            expected = "two lines; whether a line touches itself is asked by lines.NAME.contact"
            yield Finding(("contact", "between", i), expected, "name another line, or leave the pair out")
    points = system.output.points
    for key, names in (("history", system.output.history), ("points", points if isinstance(points, dict) else {})):
        for name in names:
            yield from _unknown(name, system.lines, ("output", key, name), "line")


def _lonely_points(system: System) -> Iterator[Finding]:
    for name, point in system.points.items():
        if not system.lines_at(name):
            kind = "a free point" if isinstance(point, FreePoint) else "a point"
            expected = f"{kind} at which a line starts or ends"
            yield Finding(
                ("points", name), expected, f"leave it out, or let a line end there: `end: {name}`", "no line"
            )
        elif isinstance(point, GuidedPoint):
            yield from _guided_findings(system, name)
        elif isinstance(point, FreePoint) and point.initial_guess is None and not system.is_free_end(name):
            expected = "three numbers [x, y, z], in m, from where the equilibrium of the lines that meet here is sought"
            yield Finding(("points", name, "initial_guess"), expected, "add `initial_guess: [x, y, z]` (m)", "nothing")
        elif isinstance(point, FreePoint) and all(system.breaks(*at) for at in system.lines_at(name)):
            line, _ = system.lines_at(name)[0]
            expected = f"a line at point {name} that does not break there and carries what is left"
            fix = "leave it out of one of them, or let it break at its other end"
            yield Finding(("lines", line, "break_at"), expected, fix)
    on = {point.body for point in system.points.values() if isinstance(point, Fairlead)}
    for name in system.bodies:
        if name not in on and name not in system.shaped:
            fix = f"add a point `{{body: {name}, place: [0, 0, 0]}}` and a line to it, or leave the body out"
            yield Finding(("bodies", name), "a body with a fairlead among the points", fix, "no fairlead")


def _guided_findings(system: System, name: str) -> Iterator[Finding]:
    """What is wrong with a guided point: one line is clamped there, in a direction of the world."""
    (line, end), *others = system.lines_at(name)
    if others:
        expected = "free, because a guided point is the end of one line, and several end here"
        yield Finding(("points", name, "kind"), expected, "clamp the lines to each other: `kind: free`", "guided")
    held, at = system.clamp(line, end), ("lines", line, "connections", end)
    if held is None or held.tangent is None:
        expected = f"the direction in which point {name} holds the line"
        yield Finding((*at, "tangent"), expected, "add `tangent: [0, 0, 1]`", "nothing")
        return
    wrong = [key for key in ("swivel", "bend_stiffness", "payout") if getattr(held, key) not in (None, False)]
    for key in wrong:
        expected = f"nothing, because point {name} is guided: without a `normal` it lets the line spin"
        yield Finding((*at, key), expected, "leave it out")


def floating_groups(system: System) -> Iterator[Finding]:
    """Free points and bodies from which no way along lines leads to what is fixed: none of them has an equilibrium."""
    ways = [{x.start, x.end} for x in system.lines.values()]
    ways += [{p, f"body {x.body}"} for p, x in system.points.items() if isinstance(x, Fairlead)]
    held = {name for name, point in system.points.items() if isinstance(point, FixedPoint)}
    fluid = system.environment.fluid
    if system.environment.seabed is not None or (fluid is not None and fluid.surface is not None):  # may bear a line
        alone = [x for x in system.lines.values() if system.is_free_end(x.start) and system.is_free_end(x.end)]
        held |= {p for x in alone for p in (x.start, x.end)}  # each of them is judged by itself
    held |= {f"body {name}" for name, body in system.bodies.items() if isinstance(body, FixedBody)}
    while more := {p for way in ways if way & held for p in way} - held:
        held |= more
    for name, point in system.points.items():
        if name not in held and isinstance(point, FreePoint):
            expected = "a free point that lines join to a fixed one, at least by way of others"
            yield Finding(("points", name), expected, "make one of these points `kind: fixed`", "nothing holds it")
    for name in system.bodies:
        if f"body {name}" not in held and name not in system.shaped:
            expected = "a free body that lines join to what is fixed, at least by way of other points"
            yield Finding(("bodies", name), expected, "let one of its lines end at a fixed point", "nothing holds it")


def _start_findings(system: System) -> Iterator[Finding]:
    """Lines of which some start in equilibrium and others do not, and a velocity that points do not have."""
    placed = [name for name, line in system.lines.items() if not isinstance(line.initial, Equilibrium)]
    for name, line in system.lines.items() if placed else ():
        if isinstance(line.initial, Equilibrium):
            expected = f"straight or points, because line {placed[0]} starts so, and nothing is in equilibrium then"
            fix = "say so of every line; points and bodies start at rest where initial_guess has them"
            yield Finding(("lines", name, "initial"), expected, fix, "equilibrium")
        elif any(getattr(line.initial, "velocity", None) or ()) and any(map(system.is_joined, (line.start, line.end))):
            expected = "rest, because the points of the line start at rest"
            yield Finding(("lines", name, "initial", "velocity"), expected, "leave velocity out")


def _touching_findings(system: System) -> Iterator[Finding]:
    """Lines that touch others have a diameter, and there are others."""
    if system.contact is not None and len(system.lines) == 1:
        expected = "nothing, because there is one line; whether it touches itself is asked by lines.NAME.contact"
        yield Finding(("contact",), expected, "leave it out")
    for name in dict.fromkeys(x for pair in system.touching_pairs for x in pair):
        for i, section in enumerate(system.lines[name].sections):
            if section.diameter is None:
                expected = "a number > 0, in m, which lines that touch each other keep apart (contact)"
                yield Finding(("lines", name, "sections", i, "diameter"), expected, "add `diameter: ...` (m)")


def _body_findings(system: System, name: str) -> Iterator[Finding]:
    """What is wrong with the motion of a body, or with what is given to act on it."""
    body, still = system.bodies[name], Clamped(position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0))
    if isinstance(body, FreeBody):
        in_water = [key for key in ("volume", "hydrostatics", "damping", "added_mass", "members") if getattr(body, key)]
        if in_water and system.environment.fluid is None:
            expected = f"a fluid, because body {name} has {in_water[0]}"
            yield Finding(("environment",), expected, "add `fluid: {density: 1025}`", "no fluid")
    joined = (x for x in system.lines.values() for p in (x.start, x.end) if system.body_of(p) is body)
    line = next(joined, next(iter(system.lines.values())))
    if name in system.shaped and name in system.obstacles:
        expected = f"a name that no obstacle has, because body {name} has a shape"
        yield Finding(("obstacles", name), expected, "name the one or the other differently")
    ends = Ends(start=still, end=body.end) if isinstance(body, FreeBody) else None
    if isinstance(body, FixedBody):
        moved = Clamped(position=body.position, tangent=(1.0, 0.0, 0.0), motion=body.motion)
        ends = Ends(start=moved, end=Free())
    yield from _load_findings(system, ends, line, ("bodies", name))


def _moment_findings(system: System, name: str) -> Iterator[Finding]:
    """What is wrong with the moment on a free point."""
    point, still = system.points[name], Clamped(position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0))
    if isinstance(point, FreePoint) and point.moment is not None:
        ends, (line, _) = Ends(start=still, end=Free(moment=point.moment)), system.lines_at(name)[0]
        yield from _load_findings(system, ends, system.lines[line], ("points", name))


def _load_findings(system: System, ends: Ends | None, line: JoinedLine, at: Place) -> Iterator[Finding]:
    """What is wrong with motions and loads of ends that stand for what is at another place of the system."""
    tables = {"ends": ends, "time": system.time, "cable": line.cable, "environment": system.environment}
    for found in motion_findings(tables):
        where = (*at, *found.at[2:]) if found.at[:1] == ("ends",) else found.at
        yield Finding(where, found.expected, found.fix, found.given)


def _line_findings(system: System, name: str) -> Iterator[Finding]:
    """What is wrong with a line and its points, each under its own key of the system."""
    wrong: dict[Finding, None] = {}  # each once
    for carrying in ((), *((key,) for key in system.carried(name))):
        try:
            scene = system.scene_of(name, carrying)
            wrong |= dict.fromkeys(motion_findings({key: getattr(scene, key) for key in Scene.model_fields}))
        except ValidationError as error:
            for each in error.errors(include_url=False):
                at = tuple(x for x in each["loc"] if not str(x).startswith("<"))
                for found in (each.get("ctx") or {}).get("findings", ()):
                    wrong[Finding((*at, *found.at), found.expected, found.fix, found.given)] = None
        if wrong:
            break
    yield from (_of_system(system, name, found) for found in wrong)


def _in_a_plane(system: System) -> Iterator[Finding]:
    """What leaves the plane of all lines."""
    scenes = {name: system.scene_of(name, system.carried(name)) for name in system.lines if system.dimension == 2}
    tables = [(x.environment, x.ends, x.initial) for x in scenes.values()]
    found = {
        _of_system(system, name, each): None
        for name, x in scenes.items()
        for each in plane_of(x.environment, x.cable, x.ends, x.initial, TYPED, tables)[1]
    }
    yield from found


def _of_system(system: System, name: str, found: Finding) -> Finding:
    line, at = system.lines[name], found.at
    if at[:1] == ("obstacles",):  # which are those of all lines
        carried = len(at) > 1 and at[1] in system.shaped
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
        if isinstance(system.points[point], FreePoint) and rest:
            rest = ({"position": "initial_guess", "thrust": "force"}.get(str(rest[0]), rest[0]), *rest[1:])
        at = ("points", point, *rest)
        if isinstance(found_point := system.points[point], Fairlead):
            moved = rest[:1] == ("motion",)
            at = ("bodies", found_point.body, *rest) if moved else ("points", point, "place")
    given = f"of line {name}: {found.given}" if found.given else None
    return Finding(at, found.expected.replace("ends.", "line's "), found.fix, given)


def _unknown(name: str, known: Mapping[str, Any], at: Place, what: str) -> Iterator[Finding]:
    if name not in known:
        tables = {"point": "points", "body": "bodies", "line": "lines"}[what]
        expected = f"the name of a {what}: {', '.join(known) or 'there is none'}"
        fix = nearest(name, dict.fromkeys(known, "")) or f"add `{name}: ...` to {tables}"
        yield Finding(at, expected, fix)
