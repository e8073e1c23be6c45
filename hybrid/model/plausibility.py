"""Numbers of a scene that are possible, and more likely in another unit: each with place, expected range and remedy.

A bound is a property of all materials and seas that are known, with room; what no reading could make right is refused
when the scene is read (`scene/motion_checks.py` and the tables themselves).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import accumulate
from typing import NamedTuple

from hybrid.model.sea import current_table
from hybrid.model.sections import bending_stiffness, rotary_inertia, weight
from hybrid.scene.attachments import BendRestrictor, BendStiffener, Float
from hybrid.scene.cable import DENSITIES, Section
from hybrid.scene.motion_tables import SHIFTS
from hybrid.scene.schema import LineScene
from hybrid.scene.start_checks import apart_in_motion
from hybrid.scene.waves import GivenWaves

G = 9.81  # m/s^2
# Fluids, kg/m^3: gases, and liquids from oil to heavy brine.
GASES, LIQUIDS = (0.05, 10.0), (500.0, 2500.0)
ROUGHEST = 2.0  # friction on a seabed: chain in gravel reaches 1
FASTEST = 5.0  # m/s, current: tidal streams reach 8 m/s in narrows, and above 5 m/s nothing is moored
HEAVIEST = 30.0  # m/s^2, gravity of Jupiter; of a model in a centrifuge none is known here
# Pa, shear strength a metre below the bed of the softest mud that bears anything.
SOFTEST_SOIL = 100.0
# Significant wave height, m: the largest measured by a buoy is 19 m.  Depth of the sea, m: the deepest is 10.9 km.
HIGHEST_SEA, DEEPEST = 25.0, 12_000.0
# Mean period of waves that wind makes, s: the longest swell has 25 s.
SLOWEST_SEA = 40.0
# Drag and added mass coefficients: with vortex-induced vibrations a cable's drag doubles or triples, from 1.2.
LARGEST_COEFFICIENT = 10.0
# Young's modulus, Pa, and speed of tension waves, m/s: ten times those of diamond, so that a line that is meant not to
# stretch passes, and a unit that is wrong by a thousand does not.
STIFFEST, FASTEST_WAVE = 1.2e13, 1e5
# Of metal all through, by mean density, kg/m^3, and speed of tension waves in it, m/s: in wire ropes, spiral strands
# and chains it is 2000 to 4000 m/s and in solid steel 5000, so that with a stiffness in kN it is 60 to 160.
METAL, SLOWEST_IN_METAL = 4000.0, 180.0
# Speed of tension waves in the softest rubber cord, m/s: 1 MPa and 1000 kg/m^3 are 32 m/s.  In the softest line that
# is meant for the strains of fibres and metal, as every section without a max_strain is: 130 m/s in hoses of rubber,
# 300 m/s and more in nylon.
SLOWEST_WAVE, SLOWEST_UNSAID = 10.0, 60.0
# Own length, m, whose weight in air a line bears at least: hoses bear some 100 m, umbilicals and chains 400 to 3000 m,
# ropes 5 km and more, and a thousandth of that where it is in kN.
SHORTEST_BORNE = 5.0
# Strain at rest that no line bears that is denser than fibres, and in which tension runs faster than in hoses and
# rubber: chains, wire ropes and armoured cables break at 0.5 to 2 %.  Fibre ropes are lighter, and bear 3 to 40 %.
# Own length, m, that no rope bears: wire bears 20 km, polyester 45 km, the strongest fibres in ropes 150 km.
STRAINED = 0.01
DENSEST_FIBRE = 1500.0  # kg/m^3
FAST_WAVE = 1000.0  # m/s
LONGEST_BORNE = 200e3  # m of its own length in air that a line may bear: no rope so light bears more
# Diameters of the smallest bend: a line is bent by no less than half of one about itself; steel pipes bear 250 without
# yielding, cables and umbilicals 5 to 60, and 5000 where it is in mm.
SHARPEST, MILDEST = 0.5, 2000.0
# Of a float: part of its weight that lifts at least, and how many times the mass of its line it has at most.
LEAST_LIFT, HEAVIEST_FLOAT = 0.01, 1000.0
# EI over EA d^2: a thin-walled tube of diameter d has 1/8, and no section more; spiral strands and umbilicals have
# 0.001 to 0.06, and a thousand times that where EA is in kN.
STIFFEST_BENDING = 1.0
# Parts of what a pipe's wall gives, EA and EI, between which coatings and armour may lie, and EA of a line that is
# meant not to stretch.
AXIAL_OF_A_PIPE, BENDING_OF_A_PIPE = (0.2, 500.0), (0.2, 5.0)
# Rotary inertia over that of a thin ring of the diameter: armour is near that, and no section has twice as much.
WIDEST_INERTIA = 2.0
# A line at rest sinks into real beds by less than this many of its diameters, or by less than half a metre.
DEEPEST_TRENCH = (10.0, 0.5)
# Speed of an end in a liquid, m/s, by its amplitudes and periods: twice that of the fastest ships.  Force at an end, N,
# that the strongest moorings bear.
FASTEST_END, STRONGEST_LINE = 40.0, 1e8

# Young's modulus, Pa, of the softest elastomers of sleeves; yield strengths, Pa, of the walls of pipes, with room: from
# plastics to the hardest wire.
SOFTEST_SLEEVE, WALLS = 1e5, (1e6, 1e10)
# Diameters of its cable that a bend stiffener has at most: real ones are up to ten times as thick.
THICKEST_SLEEVE = 100.0

HALVINGS = 60  # of the range of a tension, to round-off


class Note(NamedTuple):
    """An implausible number: what, where it stands with expected range and remedy, and the stretch of line (m)."""

    what: str
    why: str
    s: tuple[float, float]


def implausible(scene: LineScene) -> Iterator[Note]:
    """Numbers that are more likely in another unit."""
    whole = (0.0, scene.length)
    for what, why in (*_water(scene), *_bed(scene), *_motions(scene), *_loads(scene)):
        yield Note(what, why, whole)
    for at, what, why in _floats(scene):
        yield Note(what, why, (at, at))
    for x, what, why in _sleeves(scene):
        yield Note(what, why, x.range)
    begins = [*accumulate((x.length for x in scene.cable.sections), initial=0.0)]
    for i, what, why in _too_short(scene):
        yield Note(what, f"cable.sections[{i}].length: {why}", (begins[i], begins[i + 1]))
    for i, (section, begin) in enumerate(zip(scene.cable.sections, begins, strict=False)):
        for what, key, why in (
            *_material(section),
            *_stiffness(section),
            *_limits(section),
            *_checked(section),
            *_use(section, scene),
        ):
            yield Note(what, f"cable.sections[{i}].{key}: {why}", (begin, begin + section.length))


def _water(scene: LineScene) -> Iterator[tuple[str, str]]:
    """The fluid, its current and its waves; gravity and depth."""
    gravity, fluid = scene.environment.gravity, scene.environment.fluid
    if gravity > HEAVIEST:
        why = f"environment.gravity: expected at most {HEAVIEST:g} m/s^2; on earth 9.81: is it in m/s^2?"
        yield f"a gravity of {gravity:g} m/s^2", why
    if fluid is None:
        return
    if not any(low <= fluid.density <= high for low, high in (GASES, LIQUIDS)):
        why = f"expected {LIQUIDS[0]:g} to {LIQUIDS[1]:g} kg/m^3 of a liquid, {GASES[0]:g} to {GASES[1]:g} of a gas"
        yield f"a fluid of {fluid.density:g} kg/m^3", f"environment.fluid.density: {why}: is it in kg/m^3?"
    _, current = current_table(scene)
    fastest = float((current**2).sum(axis=1).max()) ** 0.5
    if fluid.density >= LIQUIDS[0] and fastest > FASTEST:
        why = f"environment.fluid.current: expected at most {FASTEST:g} m/s: is it in m/s?"
        yield f"a current of {fastest:g} m/s", why
    height = getattr(fluid.waves, "significant_height", 0.0)
    if height > HIGHEST_SEA:
        why = f"expected at most {HIGHEST_SEA:g} m; the largest ever measured is 19 m: is it in m?"
        yield f"a significant wave height of {height:g} m", f"environment.fluid.waves.significant_height: {why}"
    if isinstance(fluid.waves, GivenWaves) and fluid.waves.main_period > SLOWEST_SEA:
        why = f"expected at most {SLOWEST_SEA:g} s; frequencies of this file are in rad/s: are these in Hz?"
        yield f"waves of {fluid.waves.main_period:.3g} s", f"environment.fluid.waves.file: {why}"
    depth = scene.environment.depth
    if depth is not None and depth > DEEPEST:
        why = f"expected at most {DEEPEST:g} m; the deepest sea has 10 900 m: is seabed.z in m?"
        yield f"a depth of {depth:g} m", f"environment.seabed: {why}"


def _bed(scene: LineScene) -> Iterator[tuple[str, str]]:
    """The seabed: friction, and how deep the line sinks into it."""
    bed = scene.environment.seabed
    if bed is None:
        return
    if bed.friction is not None and (roughest := max(bed.friction.axial, bed.friction.lateral)) > ROUGHEST:
        why = f"environment.seabed.friction: expected 0 to {ROUGHEST:g}, a coefficient: is it in percent?"
        yield f"friction of {roughest:g}", why
    if bed.soil is not None:
        if bed.soil.shear_strength + bed.soil.gradient < SOFTEST_SOIL:
            why = f"environment.seabed.soil.shear_strength: expected {SOFTEST_SOIL:g} Pa or more: is it in kPa?"
            yield f"soil of {bed.soil.shear_strength:g} Pa", why
        return
    deepest = 0.0
    for section in scene.cable.sections:
        sinks = weight(section, scene) / bed.spring
        diameters, least = DEEPEST_TRENCH
        if sinks > max(diameters * (section.diameter or 0.0), least):
            deepest = max(deepest, sinks)
    if deepest:
        why = "expected 1e3 to 1e6 N/m per m of line: is it in kN/m per m (kPa)? then multiply it by 1000"
        what = f"a line that sinks {deepest:.3g} m into the seabed by its own weight"
        yield what, f"environment.seabed.stiffness, {bed.spring:g} N/m per m: {why}"


def _motions(scene: LineScene) -> Iterator[tuple[str, str]]:
    """Ends that move faster than ships do."""
    fluid = scene.environment.fluid
    if fluid is None or fluid.density < LIQUIDS[0]:
        return
    for name, end in scene.ends.named().items():
        motion = end.prescribed_motion
        for key, harmonics in (motion.harmonics() if motion is not None else {}).items():
            speed = max((2.0 * math.pi * h.amplitude / h.period for h in harmonics), default=0.0)
            if key in SHIFTS and speed > FASTEST_END:
                why = f"expected at most {FASTEST_END:g} m/s: is the amplitude in m and the period in s?"
                yield f"an end that moves at {speed:.3g} m/s", f"ends.{name}.motion.{key}: {why}"


def _loads(scene: LineScene) -> Iterator[tuple[str, str]]:
    """Forces at ends that no line holds."""
    for name, end in scene.ends.named().items():
        for load in end.loads:
            force = max(math.hypot(*value) for value in load.values)
            if load.what == "force" and force > STRONGEST_LINE:
                why = f"expected at most {STRONGEST_LINE:g} N, which the strongest moorings bear: is it in N?"
                yield f"a force of {force:.3g} N at an end", f"ends.{name}.{'.'.join(load.key)}: {why}"


# What is wrong with a section: what, the key, and why.
Wrong = tuple[str, str, str]


def _material(section: Section) -> Iterator[Wrong]:
    """Mass and diameter, drag and added mass."""
    if section.diameter:
        density = section.mass / _area(section)
        if not DENSITIES[0] <= density <= DENSITIES[1]:
            why = (
                f"expected {DENSITIES[0] * _area(section):.3g} to {DENSITIES[1] * _area(section):.3g} kg/m with a "
                f"diameter of {section.diameter:g} m: are mass in kg/m and diameter in m?"
            )
            yield f"a mean density of {density:.3g} kg/m^3, of {section.mass:g} kg/m", "mass", why
        turning = max(rotary_inertia(section)[0], 0.5 * rotary_inertia(section)[1])
        most = section.mass * section.diameter**2 / 8.0
        if turning > WIDEST_INERTIA * most:
            why = f"expected at most {most:.3g} kg m, that of a ring of its diameter, about the axis {2.0 * most:.3g}"
            what = f"a rotary inertia of {turning:.3g} kg m across the axis"
            yield what, "rotary_inertia", f"{why}: is it in kg m? catenaries have none"
    for key, given in (("drag", section.drag), ("added_mass", section.added_mass)):
        largest = max(given.normal, given.tangential) if given is not None else 0.0
        if largest > LARGEST_COEFFICIENT:
            why = f"expected at most {LARGEST_COEFFICIENT:g}, a coefficient without unit; a bare cylinder has about 1"
            yield f"{key.replace('_', ' ')} of {largest:g}", key, why


def _stiffness(section: Section) -> Iterator[Wrong]:
    """Axial stiffness against mass, diameter and bending stiffness."""
    axial, bending = section.stiffness, max(bending_stiffness(section))
    named = ("axial_stiffness", "tension_strain", "syrope")
    key = next((x for x in named if getattr(section, x) is not None), named[0])
    if section.pipe is not None:
        yield from _of_a_pipe(section)
    if axial is None:
        return
    wave = math.sqrt(axial / section.mass)  # m/s
    metal = section.diameter is not None and section.mass / _area(section) > METAL
    unsaid = section.max_strain is None and section.stretch_table is None
    slowest = SLOWEST_IN_METAL if metal else SLOWEST_UNSAID if unsaid else SLOWEST_WAVE
    if wave < slowest:
        least, made = section.mass * slowest**2, "metal" if metal else "hose or fibre" if unsaid else "any rubber"
        why = f"expected more than {least:.3g} N of {section.mass:g} kg/m of {made}: is it in kN? then {1e3 * axial:g}"
        why += "; rubber that stretches so has a max_strain" if unsaid and not metal else ""
        yield f"an axial stiffness of {axial:.3g} N, soft for its mass", key, why
    modulus = axial / _area(section) if section.diameter else 0.0
    if modulus > STIFFEST or wave > FASTEST_WAVE:
        what = f"an axial stiffness of {axial:.3g} N, beyond that of any material"
        most = min(STIFFEST * _area(section) if section.diameter else math.inf, section.mass * FASTEST_WAVE**2)
        why = f"expected at most {most:.3g} N: is it in N? leave it out for a line that does not stretch"
        yield what, key, why
    if section.diameter and bending > STIFFEST_BENDING * axial * section.diameter**2:
        most = axial * section.diameter**2 / 8.0
        why = (
            f"expected at most {most:.3g} N m^2, that of a tube of {section.diameter:g} m with an axial stiffness of "
            f"{axial:.3g} N: is that one in kN, or this one in N mm^2?"
        )
        yield f"a bending stiffness of {bending:.3g} N m^2, beyond that of a tube", "bending_stiffness", why


def _of_a_pipe(section: Section) -> Iterator[Wrong]:
    """Stiffnesses that are far from those of the wall of the pipe that the section is said to be."""
    pipe = section.pipe
    assert pipe is not None
    outer = pipe.outer_diameter or section.diameter
    assert outer is not None
    inner = outer - 2.0 * pipe.wall
    axial = pipe.modulus * 0.25 * math.pi * (outer**2 - inner**2)
    bending = pipe.modulus * math.pi / 64.0 * (outer**4 - inner**4)
    for key, unit, given, own, bounds in (
        ("axial_stiffness", "N", section.axial_stiffness, axial, AXIAL_OF_A_PIPE),
        ("bending_stiffness", "N m^2", max(bending_stiffness(section)) or None, bending, BENDING_OF_A_PIPE),
    ):
        low, high = (part * own for part in bounds)
        if given is not None and not low <= given <= high:
            what = f"{key.replace('_', ' ')} of {given:.3g} {unit} beside a wall that has {own:.3g}"
            why = (
                f"expected {low:.3g} to {high:.3g} {unit}: is it in k{unit}? or check pipe.wall (m), pipe.modulus (Pa)"
            )
            yield what, key, why


def _limits(section: Section) -> Iterator[Wrong]:
    """Limits that no line has: less tension than a few metres of it weigh, bends for which it is too thick or thin."""
    least = SHORTEST_BORNE * section.mass * G
    if section.max_tension is not None and section.max_tension < least:
        why = f"expected more than {least:.3g} N, the weight of {SHORTEST_BORNE:g} m of it in air: is it in kN? then "
        yield f"a largest tension of {section.max_tension:g} N", "max_tension", f"{why}{1e3 * section.max_tension:g}"
    radius = section.min_bend_radius
    if radius is not None and section.diameter:
        low, high = (x * section.diameter for x in (SHARPEST, MILDEST))
        if not low <= radius <= high:
            unit = f"mm? then {1e-3 * radius:g}" if radius > high else f"km? then {1e3 * radius:g}"
            why = f"expected {low:.3g} to {high:.3g} m with a diameter of {section.diameter:g} m: is it in {unit}"
            yield f"a smallest bend radius of {radius:g} m", "min_bend_radius", why


def _checked(section: Section) -> Iterator[Wrong]:
    """Tables of bending, capacity and strengths of codes that are in another unit, or in another order."""
    rows, least = section.moment_curvature, SHORTEST_BORNE * section.mass * G
    if rows and section.diameter and rows[1][0] * section.diameter > 1.0 / SHARPEST:
        why = f"expected less than {1.0 / (SHARPEST * section.diameter):.3g} 1/m, where it is bent about itself"
        what = f"a first curvature of {rows[1][0]:g} 1/m in a table of bending"
        yield what, "moment_curvature", f"{why}: are its columns curvature, moment?"
    code, given = section.code, [("capacity", section.capacity[0][0])] if section.capacity else []
    if code is not None and code.kind == "E301":
        given.append(("code.strength", code.strength))
    for key, value in given:
        if value < least:
            why = f"expected more than {least:.3g} N, the weight of {SHORTEST_BORNE:g} m of it in air"
            yield f"a strength of {value:g} N", key, f"{why}: is it in kN? then {1e3 * value:g}"
    if code is not None and code.kind == "F201" and not WALLS[0] <= code.yield_strength <= WALLS[1]:
        why = f"expected {WALLS[0]:g} to {WALLS[1]:g} Pa: is it in Pa?"
        yield f"a yield strength of {code.yield_strength:g} Pa", "code.yield_strength", why


def _sleeves(scene: LineScene) -> Iterator[tuple[BendStiffener | BendRestrictor, str, str]]:
    """Sleeves into which their cable does not fit, or that add nothing: which, what, and why."""
    ends = [*accumulate(x.length for x in scene.cable.sections)]
    for i, x in enumerate(scene.cable.attachments):
        if not isinstance(x, BendStiffener | BendRestrictor):
            continue
        begins = [0.0, *ends[:-1]]
        within = zip(begins, ends, scene.cable.sections, strict=True)
        d = max((c.diameter or 0.0 for a, b, c in within if a < x.range[1] and b > x.range[0]), default=0.0)
        at = f"cable.attachments[{i}]"
        if isinstance(x, BendRestrictor):
            if x.radius < SHARPEST * d:
                why = f"expected {SHARPEST * d:g} m or more around a cable of {d:g} m: is it in m?"
                yield x, f"a bend restrictor of {x.radius:g} m", f"{at}.radius: {why}"
            continue
        if x.bore is not None and x.bore < d * (1.0 - 1e-9):
            why = f"expected {d:g} m or more, the diameter of the cable in it: is it in m, and a diameter?"
            yield x, f"a bend stiffener with a bore of {x.bore:g} m", f"{at}.bore: {why}"
        if d and x.diameters is not None and max(x.diameters) > THICKEST_SLEEVE * d:
            why = f"expected at most {THICKEST_SLEEVE * d:g} m around a cable of {d:g} m: is it in m?"
            yield x, f"a bend stiffener of {max(x.diameters):g} m", f"{at}.diameters: {why}"
        if x.modulus is not None and x.modulus < SOFTEST_SLEEVE:
            why = f"expected {SOFTEST_SLEEVE:g} Pa or more: is it in Pa? in MPa it were {1e6 * x.modulus:g}"
            yield x, f"a bend stiffener of {x.modulus:g} Pa", f"{at}.modulus: {why}"


def _too_short(scene: LineScene) -> Iterator[tuple[int, str, str]]:
    """Sections that break because the line is shorter than the way between its ends: number, what, and why."""
    held, length, sections = scene.ends.held(), scene.length, scene.cable.sections
    paid = any(getattr(end, "payout", None) is not None or not end.is_placed for end in scene.ends.both)
    if len(held) < 2 or paid:
        return
    apart, when = math.dist(held["start"], held["end"]), ""
    moved = apart_in_motion(scene.ends, scene.time, length)
    if moved is not None and moved.distance > apart:
        apart, when = moved.distance, f" at t = {moved.t:.4g} s"
    if apart <= length:
        return
    low, high = 0.0, max((x.borne for x in sections if x.stiffness is not None), default=0.0)
    for _ in range(HALVINGS):
        tension = 0.5 * (low + high)
        longer = sum(x.length * (1.0 + x.strain(tension)) for x in sections) > apart
        low, high = (low, tension) if longer else (tension, high)
    for i, x in enumerate(sections):
        strain, dense = x.strain(high), x.diameter is not None and x.mass / _area(x) > DENSEST_FIBRE
        breaks = dense and strain > STRAINED and x.stiffness is not None and x.stiffness > x.mass * FAST_WAVE**2
        if x.max_strain is None and x.stretch_table is None and (breaks or high > LONGEST_BORNE * x.mass * G):
            what = (
                f"a line of {length:.6g} m between ends that are {apart:.6g} m apart{when}: {high:.3g} N at rest, which"
            )
            most = f"{LONGEST_BORNE * x.mass * G:.3g} N: no rope so light bears more"
            most = f"a strain of {STRAINED:.0%}: chain, wire and cables break at little more" if breaks else most
            fix = f"{x.length + apart - length:.6g} m or more"
            why = f"expected less than {most}: is it {fix}, or an end elsewhere? what stretches so has a max_strain"
            yield i, f"{what} stretch this section by {strain:.2%}", why


def _floats(scene: LineScene) -> Iterator[tuple[float, str, str]]:
    """Floats that weigh far more than they lift, or than their line does: where, what, and why."""
    fluid, gravity = scene.environment.fluid, scene.environment.gravity
    line = sum(x.mass * x.length for x in scene.cable.sections)
    for i, x in enumerate(scene.cable.attachments):
        if not isinstance(x, Float) or fluid is None or not x.mass:
            continue
        lift = (x.volume_in(fluid.density, gravity) * fluid.density - x.mass) * gravity
        most = HEAVIEST_FLOAT * line
        if x.mass > most or (gravity > 0.0 and lift < LEAST_LIFT * x.mass * gravity):
            if gravity > 0.0:
                most = min(most, max(lift, 0.0) / (LEAST_LIFT * gravity))
            why = f"expected at most {most:.3g} kg of what lifts {lift:.3g} N on a line of {line:.3g} kg: is it in g?"
            fix = f" then {1e-3 * x.mass:g}; or is buoyancy in N, volume in m^3?"
            yield x.at, f"a float of {x.mass:g} kg", f"cable.attachments[{i}].mass: {why}{fix}"


def _use(section: Section, scene: LineScene) -> Iterator[Wrong]:
    """A section that its own weight, hung straight down, stretches by more than it bears."""
    if not section.stiffness:
        return
    depth = scene.environment.depth
    hung = abs(weight(section, scene)) * min(scene.length, math.inf if depth is None else max(depth, 0.0))
    if hung > section.borne:
        why = (
            f"expected more than {hung / section.strain_limit:.3g} N, which {section.strain_limit:.0%} (max_strain) of "
            f"{hung:.3g} N, its weight, asks for: is it in N?"
        )
        yield (
            f"a cable that stretches by {section.strain(hung):.3g} of its length by its own weight",
            "axial_stiffness",
            why,
        )


def _area(section: Section) -> float:
    assert section.diameter is not None
    return 0.25 * math.pi * section.diameter**2
