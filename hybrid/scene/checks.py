"""Contradictions between tables: each check looks at the tables its parameters name.

A check returns findings and raises nothing, so all contradictions show at once, also
when another table of the scene cannot be read.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from typing import Any

from hybrid.scene import combinations, motion_checks, sea_checks, start_checks
from hybrid.scene.analysis import (
    Accuracy,
    AdaptiveModel,
    CatenaryModel,
    CatenaryZone,
    Equilibrium,
    Initial,
    Mesh,
    Model,
    Output,
    Resolution,
    RodModel,
    RodZone,
    Time,
    ZonesModel,
)
from hybrid.scene.base import Finding, Place
from hybrid.scene.bodies import Carried
from hybrid.scene.cable import Cable, Contact, Environment, Section
from hybrid.scene.ends import Ends, Free
from hybrid.scene.obstacles import Obstacles, SheaveObstacle
from hybrid.scene.plane import TYPED, plane_of
from hybrid.scene.quantities import of_one_line
from hybrid.scene.start_checks import SAME_LENGTH

# Contradictions between a line that is paid out and the rest of its scene.


def _reels(ends: Ends) -> list[tuple[str, tuple[Section, ...]]]:
    """What is on the reel from which line is paid out, by the name of the end."""
    paid = [(name, getattr(end, "payout", None)) for name, end in ends.named().items()]
    return [(name, payout.reel or ()) for name, payout in paid if payout is not None]


def reel_has_diameters(
    environment: Environment, ends: Ends, contact: Contact, obstacles: Obstacles
) -> Iterator[Finding]:
    """Contact of the line with itself and with obstacles, and soil, know the diameters on the reel."""
    soil = environment.seabed is not None and environment.seabed.soil is not None
    for name, reel in _reels(ends)[-1:] if contact.self or obstacles or soil else ():
        apart = "which parts of the cable keep apart (contact.self)"
        how = apart if contact.self else "with which it touches obstacles" if obstacles else "needed for soil"
        yield from without_diameter(reel, ("ends", name, "payout", "reel"), how)


def without_diameter(sections: Iterable[Section], at: Place, why: str) -> Iterator[Finding]:
    """Sections of a list without a diameter; why: what it is for."""
    for i, section in enumerate(sections):
        if section.diameter is None:
            yield Finding((*at, i, "diameter"), f"a number > 0, in m, {why}", "add `diameter: ...` (m)")


# Contradictions between tables: each check looks at the tables its parameters name.

# Error of a step, as a part of the length, that positions of 16 digits can still tell from their own round-off.
FINEST_STEP = 1e-12


def contradictions(tables: Mapping[str, Any]) -> list[Finding]:
    """All contradictions among `tables` (name -> table); checks that lack a table are skipped."""
    found: list[Finding] = []
    for check in CHECKS:
        needs = _needs(check)
        if all(name in tables for name in needs):
            found += check(**{name: tables[name] for name in needs})
    return list(dict.fromkeys([*found, *combinations.refused(tables)]))


@cache
def _needs(check: Callable[..., Iterator[Finding]]) -> tuple[str, ...]:
    """Names of the tables that a check looks at."""
    return tuple(inspect.signature(check).parameters)


def _fluid_and_diameter(environment: Environment, cable: Cable) -> Iterator[Finding]:
    for i, section in enumerate(cable.sections):
        here: Place = ("cable", "sections", i)
        reasons = ["buoyancy"] if environment.fluid is not None else []
        for key, name in (("drag", "drag"), ("added_mass", "added mass"), ("vortices", "vortices")):
            if getattr(section, key) is None:
                continue
            reasons.append(name)
            if environment.fluid is None:
                fix = f"give environment.fluid, such as `fluid: {{density: 1025}}` (kg/m^3), or leave {key} out"
                yield Finding((*here, key), f"no {name} without a fluid", fix)
        if environment.seabed is not None and environment.seabed.soil is not None:
            reasons.append("soil")
        if reasons and section.diameter is None:
            expected = f"a number > 0, in m, needed for {' and '.join(reasons)}"
            yield Finding((*here, "diameter"), expected, "add `diameter: ...` (m)")


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
    return float(zone.rod if isinstance(zone, RodZone) else zone.catenary)


def _rods_can_bend(cable: Cable, model: Model) -> Iterator[Finding]:
    for i, section in enumerate(cable.sections):
        over = _rod_over(cable, model, i)
        if not over:
            continue
        here: Place = ("cable", "sections", i)
        if not section.weakest_bending:
            fix = "add `bending_stiffness: ...` (N m^2), or make that stretch a catenary if it stays taut"
            if isinstance(model, AdaptiveModel):
                fix = (
                    "add `bending_stiffness: ...` (N m^2; small for a chain), "
                    "or fix the zones: `model: {kind: zones, zones: [...]}`"
                )
            yield Finding((*here, "bending_stiffness"), f"a number > 0, in N m^2, because {over}", fix)
        if section.torsional_stiffness == 0:
            fix = "give a number > 0 (N m^2), or leave it out and it is chosen"
            yield Finding((*here, "torsional_stiffness"), f"a number > 0, in N m^2, because {over}", fix)


def _stretches_on_cable(cable: Cable, model: Model) -> Iterator[Finding]:
    if not isinstance(model, AdaptiveModel):
        return
    rods = model.force_rod or ()
    for key in ("force_rod", "force_catenary"):
        for i, (a, b) in enumerate(getattr(model, key) or ()):
            if not a < b <= cable.length * (1 + SAME_LENGTH):
                expected = f"[s_a, s_b] with s_a < s_b <= {cable.length:.8g} m, the length of the cable"
                yield Finding(("model", key, i), expected, "write [from, to], in m")
            elif key == "force_catenary" and any(a < d and c < b for c, d in rods):
                yield Finding(("model", key, i), "a stretch apart from those of force_rod", "let them end before")


# What all that is on a reel has as the section at the winch.
OF_A_REEL = {
    "moment_curvature": "the moment over curvature",
    "bending_slip": "the layers that slip",
    "first_loading": "the layers that slip",
    "stiffness_per_tension": "the stiffness by tension",
    "tension_torque": "the torque of tension",
    "vortices": "the vortices",
    "creep": "the creep",
}


def _laws_on_a_reel(cable: Cable, ends: Ends) -> Iterator[Finding]:
    """Sections on a reel that stretch, or bend, by another table than that at the winch."""
    for name, reel in _reels(ends):
        own = cable.sections[0 if name == "start" else -1]
        for i, section in enumerate(reel):
            if any(getattr(section, key) != getattr(own, key) for key in ("curve", "dynamic_stiffness", "syrope")):
                expected = "the tension over strain of the section at the winch (tension_strain, dynamic_stiffness)"
                laws = ("dynamic_stiffness", "syrope", "tension_strain")
                keys = [key for key in laws if getattr(section, key) is not None]
                at: Place = ("ends", name, "payout", "reel", i, *keys[:1])
                yield Finding(at, expected, "give it the same, or leave these out and give axial_stiffness (N)")
            for key, what in OF_A_REEL.items():
                if getattr(section, key) != getattr(own, key):
                    at = ("ends", name, "payout", "reel", i, *[key][: bool(getattr(section, key))])
                    yield Finding(at, f"{what} of the section at the winch ({key})", "give it the same")
            if section.damped.stiffness != own.damped.stiffness:
                at = ("ends", name, "payout", "reel", i, *["damping"][: section.damping is not None])
                yield Finding(at, "the damping.stiffness of the section at the winch", "give it the same")
            if own.vortices and section.diameter != own.diameter:
                at = ("ends", name, "payout", "reel", i, "diameter")
                yield Finding(at, "the diameter of the section at the winch, which sheds vortices", "give it the same")


def _tolerance_is_felt(cable: Cable, time: Time | None) -> Iterator[Finding]:
    if time is None or time.tolerance is None:
        return
    least = FINEST_STEP * cable.length
    if time.tolerance < least:
        expected = f"at least {least:.3g} m, a millionth of a millionth of the length: below, steps follow round-off"
        yield Finding(
            ("time", "tolerance"), expected, f"{1e-6 * cable.length:.3g}, or leave it out and ask `accuracy: 1%`"
        )


def _in_a_plane(
    environment: Environment, cable: Cable, ends: Ends, initial: Initial, dimension: int | None
) -> Iterator[Finding]:
    if dimension == 2:
        yield from plane_of(environment, cable, ends, initial, TYPED)[1]


def _touches_itself(cable: Cable, contact: Contact) -> Iterator[Finding]:
    """Contact of the cable with itself keeps diameters apart."""
    if contact.self is False and contact.friction > 0.0:
        expected = "0 or nothing, because parts of the cable do not touch each other without contact.self"
        yield Finding(("contact", "friction"), expected, "leave `self: false` out, or leave friction out")
    if contact.self:
        why = "which parts of the cable keep apart (contact.self)"
        yield from without_diameter(cable.sections, ("cable", "sections"), why)


# Of the radius of a line: how wide the section of a groove is at least in which it lies.
LEAST_GROOVE = 1.05


def _touches_obstacles(cable: Cable, obstacles: Obstacles, ends: Ends) -> Iterator[Finding]:
    """A line that touches obstacles has a radius, and its ends are outside of them."""
    if not obstacles:
        return
    yield from without_diameter(cable.sections, ("cable", "sections"), "with which the cable touches obstacles")
    widest = 0.5 * max(section.diameter or 0.0 for section in cable.sections)
    for name, x in obstacles.items():
        if isinstance(x, SheaveObstacle) and x.groove < LEAST_GROOVE * widest:
            expected = f"at least {LEAST_GROOVE * widest:.4g} m, {LEAST_GROOVE:g} times the radius of the cable"
            yield Finding(("obstacles", name, "groove"), expected, "a wider groove", f"{x.groove:g}")
    for key, places in (("position", ends.held()), ("initial_guess", ends.initial_guesses())):
        for end, place in places.items():
            for name, x in obstacles.items():
                if isinstance(x, Carried):  # the end may be of its body, and both are where they are looked for first
                    continue
                if x.distance(place) < 0.0:
                    expected = f"a place outside of obstacles.{name}, in which it lies {-x.distance(place):.3g} m deep"
                    yield Finding(("ends", end, key), expected, "move it, or the obstacle")


def accuracy_has_errors(accuracy: Accuracy | None, output: Output) -> Iterator[Finding]:
    if accuracy is not None and output.errors is False:
        expected = "true or nothing, because accuracy is judged by the error figure"
        yield Finding(("output", "errors"), expected, "leave it out, or leave accuracy out")


def elevation_has_waves(output: Output, environment: Environment) -> Iterator[Finding]:
    if output.elevation and (environment.fluid is None or environment.fluid.waves is None):
        expected = "nothing, because the sea has no waves (environment.fluid.waves)"
        yield Finding(("output", "elevation"), expected, "leave it out, or give waves")


def _quantities(output: Output, cable: Cable, ends: Ends, environment: Environment) -> Iterator[Finding]:
    free = [name for name in ("start", "end") if isinstance(getattr(ends, name), Free)]
    yield from of_one_line(output.quantities, cable.length, free, environment.seabed is not None)


def _pressure_of_pipes(cable: Cable, environment: Environment) -> Iterator[Finding]:
    for i, section in enumerate(cable.sections):
        here: Place = ("cable", "sections", i, "pipe")
        if section.pipe is not None and environment.fluid is not None and environment.fluid.surface is None:
            expected = "nothing, because the fluid has no surface, on which the pressure outside depends"
            yield Finding(here, expected, "add `surface: 0` (m) to environment.fluid, or leave pipe out")


def _moment_is_there(accuracy: Accuracy | None, model: Model) -> Iterator[Finding]:
    if accuracy is None or accuracy.bending_moment is None:
        return
    zones = model.zones if isinstance(model, ZonesModel) else ()
    if isinstance(model, CatenaryModel) or (zones and all(isinstance(zone, CatenaryZone) for zone in zones)):
        expected = "nothing, because a catenary (model) has no bending moment"
        yield Finding(("accuracy", "bending_moment"), expected, "leave it out, or write `model: rod`")


def _rod_over(cable: Cable, model: Model, i: int) -> str:
    """Which rod covers section `i`, in words; empty if none does."""
    if isinstance(model, AdaptiveModel):
        return f"zones move (model) and cable.sections[{i}] may become a rod"
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


def _turns_are_held(cable: Cable, ends: Ends, model: Model) -> Iterator[Finding]:
    """Turns twist a rod between two ends that both hold it."""
    for name, end in ends.named().items():
        if not end.held_turns:
            continue
        here, given = ("ends", name, "turns"), f"{end.held_turns:g}"
        for which, other in ends.named().items():
            if not other.is_twisted_against:
                fix = f"leave turns out, or clamp ends.{which} (guided: give `normal`) without a swivel"
                yield Finding(here, f"0, because ends.{which} turns freely, so that nothing is twisted", fix, given)
        for i, section in enumerate(cable.sections):
            if section.torsional_stiffness is None and not isinstance(model, CatenaryModel):
                expected = f"a number > 0, in N m^2, because ends.{name}.turns twists the cable"
                yield Finding(("cable", "sections", i, "torsional_stiffness"), expected, "add it")


def _axes_are_given(cable: Cable, ends: Ends, model: Model, dimension: int | None) -> Iterator[Finding]:
    """Where two bending stiffnesses differ and an end holds the twist, the scene says where their axes point.

    A clamp alone says nothing of it, and an axis of the world in its place would bend the same cable otherwise when the
    scene is turned.
    """
    if dimension == 2 or isinstance(model, CatenaryModel):
        return
    held = [name for name, end in ends.named().items() if end.holds_twist]
    if not held or any(end.gives_axes for end in ends.both):
        return
    for i, section in enumerate(cable.sections):
        if section.anisotropic:
            expected = (
                f"the direction of the material axis a1 at this clamp, because cable.sections[{i}].bending_stiffness "
                "differs about a1 and a2, and nothing else says where these point"
            )
            fix = "add `normal: [x, y, z]` beside the tangent, or a `swivel` that lets it turn"
            yield Finding(("ends", held[0], "normal"), expected, fix)
            return


def _axes_at_start_are_given(
    cable: Cable, ends: Ends, model: Model, initial: Initial, dimension: int | None
) -> Iterator[Finding]:
    """Where a line that bends otherwise in another direction is not at rest at first, an end says where its axes point.

    At rest a line that turns freely finds them by itself; else axes of the world would stand in their place.
    """
    if dimension == 2 or isinstance(model, CatenaryModel) or isinstance(initial, Equilibrium):
        return
    if any(end.holds_twist or end.gives_axes for end in ends.both):  # as of every start
        return
    for i, section in enumerate(cable.sections):
        bent = any((section.intrinsic_curvature or ())[:2])
        if section.weakest_bending and (section.anisotropic or bent):
            key = "bending_stiffness differs" if section.anisotropic else "intrinsic_curvature is given"
            expected = f"equilibrium, because cable.sections[{i}].{key} about material axes that nothing turns at first"
            fix = "clamp an end with `normal: [x, y, z]`, or begin with `equilibrium`"
            yield Finding(("initial", "kind"), expected, fix, initial.kind)
            return


def _mesh_spans(cable: Cable, mesh: Mesh | None) -> Iterator[Finding]:
    if mesh is None or mesh.nodes is None:
        return
    length = cable.length
    for index, target in ((0, 0.0), (len(mesh.nodes) - 1, length)):
        if abs(mesh.nodes[index] - target) > SAME_LENGTH * length:
            name = "the first node at the start of the cable" if index == 0 else "the last node at the end of the cable"
            yield Finding(("mesh", "nodes", index), f"{target:.12g} m, {name}", f"{target:.12g}")


def _layers_are_meshed(resolution: Resolution | None, model: Model, mesh: Mesh | None) -> Iterator[Finding]:
    """Cells to a layer are for rods whose cells the program places."""
    if resolution is None:
        return
    zones = model.zones if isinstance(model, ZonesModel) else ()
    rods = isinstance(model, RodModel | AdaptiveModel) or any(isinstance(zone, RodZone) for zone in zones)
    why = ""
    if mesh is not None or any(zone.cells or zone.ratio for zone in zones):
        why = f"{'mesh' if mesh is not None else 'model.zones'} already says where the cells are"
    elif not rods:
        why = "no part of the cable is a rod (model), and bending fades in rods alone"
    if why:
        yield Finding(("resolution", "cells_per_layer"), f"nothing, because {why}", "leave out the one or the other")


def _output_on_cable(cable: Cable, output: Output) -> Iterator[Finding]:
    length = cable.length
    for key in ("points", "history"):
        values = getattr(output, key)
        if isinstance(values, tuple):
            for i, s in enumerate(values):
                if s > length * (1 + SAME_LENGTH):
                    expected = f"an arc length between 0 and {length:.8g} m, the cable's length"
                    yield Finding(
                        ("output", key, i), expected, f"{length:.8g} is the end of the cable; or leave it out"
                    )


CHECKS: tuple[Callable[..., Iterator[Finding]], ...] = (
    _fluid_and_diameter,
    start_checks.span,
    start_checks.span_in_motion,
    start_checks.start_is_known,
    start_checks.equilibrium_exists,
    sea_checks.fluid_density,
    start_checks.attachments_on_cable,
    start_checks.restrictors_hold_what_bends,
    start_checks.swivels_turn,
    start_checks.attachments_in_fluid,
    start_checks.bodies_in_fluid,
    start_checks.densities,
    sea_checks.waves,
    sea_checks.wave_is_steady,
    sea_checks.record_lasts,
    sea_checks.followed,
    sea_checks.seabed_is_no_depth,
    sea_checks.surface_over_seabed,
    sea_checks.nothing_in_the_ground,
    motion_checks.friction,
    motion_checks.end_forces,
    _zones_fill,
    _rods_can_bend,
    _stretches_on_cable,
    _laws_on_a_reel,
    _tolerance_is_felt,
    accuracy_has_errors,
    elevation_has_waves,
    _quantities,
    _pressure_of_pipes,
    _moment_is_there,
    _in_a_plane,
    _touches_itself,
    _touches_obstacles,
    _turns_are_held,
    _axes_are_given,
    _axes_at_start_are_given,
    _mesh_spans,
    _layers_are_meshed,
    _output_on_cable,
    reel_has_diameters,
)
