"""Contradictions between tables: each check looks at the tables its parameters name.

A check returns findings and raises nothing, so all contradictions show at once, also
when another table of the scene cannot be read.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from typing import Any

from hybrid.scene.cable import Cable, Environment
from hybrid.scene.ends import Ends
from hybrid.scene.table import Finding, Place, unit
from hybrid.scene.task import (
    Equilibrium,
    Initial,
    Mesh,
    Model,
    Output,
    Points,
    RodModel,
    RodZone,
    Straight,
    ZonesModel,
)

Position = tuple[float, float, float]

# Positions that differ by less than this part of the cable's length are the same place:
# people write six to eight digits.
SAME_PLACE = 1e-6

# Lengths are sums of what people wrote; only round-off may separate them.
SAME_LENGTH = 1e-9

# Real cables break at a few per cent; beyond this a typing error is more likely than rubber.
LARGEST_STRAIN = 0.5

# An extensible cable may start along a polyline that is somewhat longer or shorter than itself.
POLYLINE_STRETCH = 0.2


def contradictions(tables: Mapping[str, Any]) -> list[Finding]:
    """All contradictions among `tables` (name -> table); checks that lack a table are skipped."""
    found: list[Finding] = []
    for check in CHECKS:
        needs = list(inspect.signature(check).parameters)
        if all(name in tables for name in needs):
            found += check(**{name: tables[name] for name in needs})
    return found


def _at(position: Position) -> str:
    return f"[{position[0]:.8g}, {position[1]:.8g}, {position[2]:.8g}]"


def _along(origin: Position, direction: Position, distance: float) -> Position:
    u = unit(direction)
    return (origin[0] + distance * u[0], origin[1] + distance * u[1], origin[2] + distance * u[2])


def _fluid_and_diameter(environment: Environment, cable: Cable) -> Iterator[Finding]:
    for i, section in enumerate(cable.sections):
        here: Place = ("cable", "sections", i)
        reasons = ["buoyancy"] if environment.fluid is not None else []
        for key, name in (("drag", "drag"), ("added_mass", "added mass")):
            if getattr(section, key) is None:
                continue
            reasons.append(name)
            if environment.fluid is None:
                fix = f"give environment.fluid, such as `fluid: {{density: 1025}}` (kg/m^3), or leave {key} out"
                yield Finding((*here, key), f"no {name} without a fluid", fix)
        if reasons and section.diameter is None:
            expected = f"a number > 0, in m, needed for {' and '.join(reasons)}"
            yield Finding((*here, "diameter"), expected, "add `diameter: ...` (m)")


def _span(cable: Cable, ends: Ends) -> Iterator[Finding]:
    held = ends.held()
    if len(held) < 2:
        return
    distance, length = math.dist(held["start"], held["end"]), cable.length
    place: Place = ("ends", "end", "position")
    given = f"{_at(held['end'])}, which is {distance:.8g} m from the start"
    if cable.inextensible:
        if distance >= length * (1 - SAME_LENGTH):
            expected = f"less than {length:.8g} m from the start, the length of this inextensible cable"
            yield Finding(place, expected, "a longer cable, closer ends, or give axial_stiffness (N)", given)
        return
    elastic = sum(s.length for s in cable.sections if s.axial_stiffness is not None)
    strain = (distance - length) / elastic
    if strain > LARGEST_STRAIN:
        expected = (
            f"at most {length + LARGEST_STRAIN * elastic:.8g} m from the start; the cable is {length:.8g} m long "
            f"and would stretch by {100 * strain:.3g} %"
        )
        yield Finding(place, expected, "a longer cable or closer ends", given)


def _start_is_known(cable: Cable, ends: Ends, initial: Initial) -> Iterator[Finding]:
    if isinstance(initial, Equilibrium):
        if not ends.held():
            expected = "at least one end with a position; a cable that nothing holds has no equilibrium"
            yield Finding(
                ("initial", "kind"), expected, "make an end pinned or clamped, or use initial: {kind: straight}"
            )
    elif isinstance(initial, Straight):
        yield from _straight_start(cable, ends, initial)
    else:
        yield from _polyline_start(cable, ends, initial)


def _straight_start(cable: Cable, ends: Ends, initial: Straight) -> Iterator[Finding]:
    held, length = ends.held(), cable.length
    near = SAME_PLACE * length
    if "start" in held:
        origin: Position | None = held["start"]
    elif "end" in held:
        origin = _along(held["end"], initial.direction, -length)
    else:
        origin = initial.origin
    if origin is None:
        expected = "three numbers [x, y, z], in m, because no end is held and the cable could be anywhere"
        yield Finding(("initial", "origin"), expected, "add `origin: [x, y, z]` (m), the position of s = 0")
        return
    if initial.origin is not None and math.dist(initial.origin, origin) > near:
        expected = f"{_at(origin)}, which follows from the held end"
        yield Finding(("initial", "origin"), expected, "leave origin out")
    if len(held) == 2:
        tip = _along(origin, initial.direction, length)
        if math.dist(tip, held["end"]) > near:
            expected = (
                f"a straight cable that ends at ends.end.position {_at(held['end'])}; this one ends at {_at(tip)}"
            )
            yield Finding(("initial", "direction"), expected, "use `initial: {kind: equilibrium}`; it finds the shape")
    if held and initial.velocity is not None and any(initial.velocity):
        expected = f"rest, because the {next(iter(held))} is held and cannot jump to a velocity"
        yield Finding(("initial", "velocity"), expected, "leave velocity out, or free both ends")


def _polyline_start(cable: Cable, ends: Ends, initial: Points) -> Iterator[Finding]:
    points, length = initial.points, cable.length
    total = sum(math.dist(a, b) for a, b in pairwise(points))
    allowed = SAME_PLACE if cable.inextensible else POLYLINE_STRETCH
    if abs(total - length) > allowed * length:
        why = "the length of the inextensible cable" if cable.inextensible else "the length of the cable, within 20 %"
        expected = f"a polyline {length:.8g} m long, {why}"
        fix = f"move the points, or make the cable {total:.8g} m long"
        yield Finding(("initial", "points"), expected, fix, f"{len(points)} points, {total:.8g} m in all")
    for name, index in (("start", 0), ("end", len(points) - 1)):
        position = ends.held().get(name)
        if position is not None and math.dist(points[index], position) > SAME_PLACE * length:
            expected = f"{_at(position)}, where ends.{name}.position holds the cable"
            yield Finding(("initial", "points", index), expected, "let the polyline begin and end at the held ends")


def _zones_fill(cable: Cable, model: Model) -> Iterator[Finding]:
    if not isinstance(model, ZonesModel):
        return
    total, length = sum(_zone_length(zone) for zone in model.zones), cable.length
    if abs(total - length) > SAME_LENGTH * length:
        what = "too long" if total > length else "too short"
        expected = f"{length:.12g} m, the length of the cable; the zones are {abs(total - length):.6g} m {what}"
        fix = "make the last zone fit, or change the length of a section"
        yield Finding(("model", "zones"), expected, fix, f"zones that add up to {total:.12g} m")


def _zone_length(zone: Any) -> float:
    return zone.rod if isinstance(zone, RodZone) else zone.catenary


def _rods_can_bend(cable: Cable, model: Model) -> Iterator[Finding]:
    for i, section in enumerate(cable.sections):
        over = _rod_over(cable, model, i)
        if not over:
            continue
        here: Place = ("cable", "sections", i)
        if not section.weakest_bending:
            fix = "add `bending_stiffness: ...` (N m^2), or make that stretch a catenary"
            yield Finding((*here, "bending_stiffness"), f"a number > 0, in N m^2, because {over}", fix)
        if section.torsional_stiffness == 0:
            fix = "give a number > 0 (N m^2), or leave it out and it is chosen"
            yield Finding((*here, "torsional_stiffness"), f"a number > 0, in N m^2, because {over}", fix)


def _rod_over(cable: Cable, model: Model, i: int) -> str:
    """Which rod covers section `i`, in words; empty if none does."""
    if isinstance(model, RodModel):
        return f"the whole cable is a rod (model), cable.sections[{i}] included"
    if not isinstance(model, ZonesModel):
        return ""
    begin = sum(section.length for section in cable.sections[:i])
    end = begin + cable.sections[i].length
    a = 0.0
    for k, zone in enumerate(model.zones):
        b = a + _zone_length(zone)
        if isinstance(zone, RodZone) and min(b, end) - max(a, begin) > SAME_LENGTH * cable.length:
            return f"the rod zone model.zones[{k}] (s = {a:.6g} to {b:.6g} m) lies over cable.sections[{i}]"
        a = b
    return ""


def _mesh_spans(cable: Cable, mesh: Mesh | None) -> Iterator[Finding]:
    if mesh is None or mesh.nodes is None:
        return
    length = cable.length
    for index, target in ((0, 0.0), (len(mesh.nodes) - 1, length)):
        if abs(mesh.nodes[index] - target) > SAME_LENGTH * length:
            name = "the first node at the start of the cable" if index == 0 else "the last node at the end of the cable"
            yield Finding(("mesh", "nodes", index), f"{target:.12g} m, {name}")


def _output_on_cable(cable: Cable, output: Output) -> Iterator[Finding]:
    length = cable.length
    for key in ("points", "history"):
        values = getattr(output, key)
        if isinstance(values, tuple):
            for i, s in enumerate(values):
                if s > length * (1 + SAME_LENGTH):
                    yield Finding(("output", key, i), f"an arc length between 0 and {length:.8g} m, the cable's length")


CHECKS: tuple[Callable[..., Iterator[Finding]], ...] = (
    _fluid_and_diameter,
    _span,
    _start_is_known,
    _zones_fill,
    _rods_can_bend,
    _mesh_spans,
    _output_on_cable,
)
