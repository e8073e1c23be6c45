"""Contradictions about where the cable is, and what hangs on it.

How far the ends may be apart, where it starts, attachments, and the bodies at its ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import accumulate, pairwise
from typing import NamedTuple

from hybrid.scene.analysis import Equilibrium, Initial, Points, Straight, Time
from hybrid.scene.attachments import (
    BendRestrictor,
    BendStiffener,
    Clump,
    Float,
    Modules,
    Spread,
    Swivel,
    sphere_diameter,
)
from hybrid.scene.base import Finding, Place, unit, xyz
from hybrid.scene.cable import USUAL_DENSITIES, Cable, Environment
from hybrid.scene.ends import Body, Ends, Triple
from hybrid.scene.motion_tables import farthest, moving_key, shift, smaller
from hybrid.scene.obstacles import Obstacles

# Positions that differ by less than this part of the cable's length are the same place:
# people write six to eight digits.
SAME_PLACE = 1e-6

# Lengths are sums of what people wrote; only round-off may separate them.
SAME_LENGTH = 1e-9

# A search for equilibrium may start from a polyline that is longer or shorter by this part: nothing of it is left.
POLYLINE_STRETCH = 0.2

# A motion that starts along a shorter polyline starts compressed, EA times which is a force: a polyline through places
# of a line that turns by half a radian from each chord to the next is shorter than the line by 1 %.
DRAWN_STRAIN = 0.01

# A weight below this part of all weights and lifts is their round-off.
WEIGHTLESS = 1e-9


def _along(origin: Triple, direction: Triple, distance: float) -> Triple:
    u = unit(direction)
    return (origin[0] + distance * u[0], origin[1] + distance * u[1], origin[2] + distance * u[2])


# --- how far the ends may be apart -------------------------------------------------------------


def too_short(cable: Cable, distance: float) -> str | None:
    """What is expected where the ends are `distance` [m] apart and the cable does not reach; None if it does."""
    length = cable.length
    if cable.inextensible:
        if distance < length * (1 - SAME_LENGTH):
            return None
        return f"less than {length:.8g} m from the start, the length of this inextensible cable; it is too short"
    if distance <= cable.reach * (1 + SAME_LENGTH):
        return None
    return (
        f"at most {cable.reach:.8g} m from the start, where a section bears no more (max_strain); the cable, "
        f"{length:.8g} m long, is too short and would stretch by {100 * (distance / length - 1):.3g} %"
    )


def span(cable: Cable, ends: Ends, initial: Initial) -> Iterator[Finding]:
    """Two held ends that the cable does not join, or a body placed out of its reach."""
    if isinstance(initial, Straight) and not all(end.is_placed for end in ends.both):
        return  # one of them is a point that moves, where the straight line ends
    held, near = ends.held(), ends.initial_guesses()
    fix = "a longer cable or closer ends"
    if cable.inextensible:
        fix = "a longer cable, closer ends, or give axial_stiffness (N)"
    if len(held) == 2:
        distance = math.dist(held["start"], held["end"])
        expected = too_short(cable, distance)
        if expected is not None:
            given = f"{xyz(held['end'])}, which is {distance:.8g} m from the start"
            yield Finding(("ends", "end", "position"), expected, fix, given)
    elif near and len(places := held | near) == 2:
        distance, allowed = math.dist(places["start"], places["end"]), cable.length * (1 + POLYLINE_STRETCH)
        if distance > allowed:
            name = "end" if "end" in near else "start"
            expected = f"a place at most {allowed:.8g} m from the other end; the cable is {cable.length:.8g} m long"
            given = f"{xyz(near[name])}, which is {distance:.8g} m from the other end"
            yield Finding(("ends", name, "initial_guess"), expected, "a longer cable or a nearer place", given)


def span_in_motion(cable: Cable, ends: Ends, time: Time | None) -> Iterator[Finding]:
    """Two held ends that move apart farther than the cable joins them, unless line is paid out."""
    held, found = ends.held(), apart_in_motion(ends, time, cable.length if cable.inextensible else cable.reach)
    if found is None or too_short(cable, math.dist(held["start"], held["end"])):
        return
    if (expected := too_short(cable, found.distance)) is None:
        return
    given = f"motion to {xyz(found.place)} at t = {found.t:.6g} s, {found.distance:.8g} m from the other end"
    more = f"a longer cable, {found.distance:.6g} m or more, or {smaller(found.key)}"
    yield Finding(("ends", found.end, "motion", found.key), expected, more, given)


class Apart(NamedTuple):
    """Two ends when they are farthest from each other.

    Distance [m] and time [s]; the end that moves, where it is then, by which key of its motion.
    """

    distance: float
    t: float
    end: str
    key: str
    place: Triple


def apart_in_motion(ends: Ends, time: Time | None, within: float = 0.0) -> Apart | None:
    """When two held ends are farthest from each other; None: they are not held, let go, or another length is paid out.

    within: m, a distance of which only what is beyond is of interest.
    """
    held = ends.held()
    paid = any(getattr(end, "payout", None) is not None or not end.is_placed for end in ends.both)
    if time is None or len(held) < 2 or paid or any(end.release is not None for end in ends.both):
        return None
    start, end = (x.prescribed_motion for x in ends.both)
    distance, t = farthest((held["start"], held["end"]), (start, end), time.duration, within)
    for name, motion in (("end", end), ("start", start)):
        if motion is not None and (key := moving_key(motion)):
            (x, y, z), by = held[name], shift(motion, t)
            return Apart(distance, t, name, key, (x + by[0], y + by[1], z + by[2]))
    return None


# --- where the cable starts --------------------------------------------------------------------


def start_is_known(environment: Environment, cable: Cable, ends: Ends, initial: Initial) -> Iterator[Finding]:
    """An initial shape that gives the place of the cable, and agrees with its ends."""
    loads = net_weight(environment, cable, ends)[1]
    if isinstance(initial, Equilibrium):
        yield from _guess(cable, ends, initial, loads)
    elif isinstance(initial, Straight):
        yield from _straight_start(cable, ends, initial)
    else:
        yield from _polyline_start(cable, ends, initial, loads)


def _guess(cable: Cable, ends: Ends, initial: Equilibrium, loads: float) -> Iterator[Finding]:
    places = ends.held() | ends.initial_guesses()
    if initial.points is not None:
        yield from _polyline_start(cable, ends, initial, loads)
    elif initial.guess in ("catenary", "arc", "span") and len(places) < 2:
        expected = f"auto or straight, because a guess like {initial.guess} goes from one known place to another"
        yield Finding(("initial", "guess"), expected, "hold both ends, or say `initial_guess` where a body is")
    elif initial.guess == "straight" or initial.direction is not None:
        for name in ends.initial_guesses():
            expected = "nothing, because the search starts from a cable straight in a direction (initial)"
            yield Finding(
                ("ends", name, "initial_guess"),
                expected,
                "leave initial_guess out, or the direction and guess: straight",
            )


def equilibrium_exists(
    environment: Environment, cable: Cable, ends: Ends, initial: Initial, obstacles: Obstacles
) -> Iterator[Finding]:
    """A cable that nothing holds rests on the seabed or floats at the surface, or has no equilibrium."""
    if not isinstance(initial, Equilibrium) or ends.held():
        return
    reason, fix = _drifts(environment, cable, ends)
    if reason and obstacles:
        reason = "no end is held, and the search does not find a rest of a cable that obstacles alone hold"
        fix = "hold an end, and let it go in a motion (`release_at`); or start from `initial: {kind: points}`"
    if reason:
        yield Finding(("initial", "kind"), f"at least one end with a position, because {reason}", fix)
    elif initial.points is None and len(ends.initial_guesses()) < 2:
        expected = "a polyline [[x, y, z], ...] to start from, in m, because no end is held and it could be anywhere"
        yield Finding(("initial", "points"), expected, "add `points: [[x, y, z], [x, y, z]]` (m)")


def net_weight(environment: Environment, cable: Cable, ends: Ends) -> tuple[float, float]:
    """Net weight under water, and the sum of all magnitudes, N, positive downwards.

    Of cable, attachments and bodies, less the lift of forces on the ends.
    """
    gravity, density = environment.gravity, environment.fluid.density if environment.fluid is not None else 0.0
    widths = [s.diameter or 0.0 for s in cable.sections]
    masses = [(s.mass * s.length, math.pi / 4 * d * d * s.length) for s, d in zip(cable.sections, widths, strict=True)]
    for item in cable.attachments:
        if isinstance(item, BendRestrictor):
            continue
        if density > 0.0 and gravity > 0.0:  # without, attachments that float are refused elsewhere
            length = item.range[1] - item.range[0] if isinstance(item, Spread) else 1.0
            masses.append((item.mass * length, item.volume_in(density, gravity) * length))
        elif item.kind in ("clump", "swivel"):
            masses.append((item.mass, item.volume))
    masses += [(body.mass, body.volume) for body in ends.bodies().values()]
    down = [gravity * mass for mass, _ in masses]
    up = [gravity * density * volume for _, volume in masses] + [force[2] for force in _forces(ends)]
    return sum(down) - sum(up), sum(down) + sum(map(abs, up))


def _forces(ends: Ends) -> list[Triple]:
    """Forces on the ends at the beginning, N."""
    return [load.value for end in ends.both for load in end.loads if load.what == "force"]


def _drifts(environment: Environment, cable: Cable, ends: Ends) -> tuple[str, str]:
    """Why a cable that nothing holds has no equilibrium, and what to do; empty if it has one."""
    fluid, seabed = environment.fluid, environment.seabed
    weight, gross = net_weight(environment, cable, ends)
    under = "under water" if fluid is not None else "in all"
    hold = "make an end pinned or clamped, or use initial: {kind: straight}"
    if abs(weight) <= WEIGHTLESS * gross:
        return f"nothing holds this cable, and it weighs nothing {under}: it has no height of its own", hold
    if weight > 0.0 and seabed is None:
        reason = f"nothing holds this cable, which weighs {weight:.4g} N {under}, and there is no seabed to carry it"
        return reason, f"{hold}; or give environment.seabed"
    if weight < 0.0 and (fluid is None or fluid.surface is None):
        reason = f"nothing holds this cable, which rises with {-weight:.4g} N, and there is no surface to stop it"
        return reason, f"{hold}; or give environment.fluid.surface"
    rubs = weight > 0.0 and seabed is not None and seabed.friction is not None
    remedy = hold if weight < 0.0 else f"{hold}; or give environment.seabed.friction"
    push = [sum(force[k] for force in _forces(ends)) for k in (0, 1)]
    if not rubs and math.hypot(*push) > WEIGHTLESS * gross:
        return f"nothing holds this cable against the horizontal force of {math.hypot(*push):.4g} N at its ends", remedy
    if not rubs and fluid is not None and fluid.flows() and _drags(cable, ends):
        return "nothing holds this cable against the current, and it drifts", remedy
    if not rubs and seabed is not None and weight > 0.0 and not seabed.is_level:
        return "nothing holds this cable on the slope of the seabed, and it slides", remedy
    return "", ""


def _drags(cable: Cable, ends: Ends) -> bool:
    """Whether a current takes hold of anything."""
    bluff = [getattr(item, "drag_area", 0.0) for item in (*cable.attachments, *ends.bodies().values())]
    return any(bluff) or any(s.drag is not None and (s.drag.normal or s.drag.tangential) for s in cable.sections)


def _straight_start(cable: Cable, ends: Ends, initial: Straight) -> Iterator[Finding]:
    held, length = ends.held(), cable.length
    near = SAME_PLACE * length
    if "start" in held:
        origin: Triple | None = held["start"]
    elif "end" in held:
        origin = _along(held["end"], initial.direction, -length)
    else:
        origin = initial.origin
    if origin is None:
        expected = "three numbers [x, y, z], in m, because no end is held and the cable could be anywhere"
        yield Finding(("initial", "origin"), expected, "add `origin: [x, y, z]` (m), the position of s = 0")
        return
    if initial.origin is not None and math.dist(initial.origin, origin) > near:
        expected = f"{xyz(origin)}, which follows from the held end"
        yield Finding(("initial", "origin"), expected, "leave origin out")
    tip = _along(origin, initial.direction, length)
    if len(held) == 2 and math.dist(tip, held["end"]) > near:
        expected = f"a straight cable that ends at ends.end.position {xyz(held['end'])}; this one ends at {xyz(tip)}"
        yield Finding(("initial", "direction"), expected, "use `initial: {kind: equilibrium}`; it finds the shape")
    yield from _bodies_agree(ends, origin, tip, near)
    if held and initial.velocity is not None and any(initial.velocity):
        expected = f"rest, because the {next(iter(held))} is held and cannot jump to a velocity"
        yield Finding(("initial", "velocity"), expected, "leave velocity out, or free both ends")


def _polyline_start(cable: Cable, ends: Ends, initial: Points | Equilibrium, loads: float) -> Iterator[Finding]:
    points, length = initial.points or (), cable.length
    s = initial.arc_lengths if isinstance(initial, Points) else None
    if s is not None:
        yield from _pieces_fit(points, s, cable, loads)
    else:
        yield from _drawn_as_long(points, cable, ends, loads if isinstance(initial, Points) else None)
    for name, index in (("start", 0), ("end", len(points) - 1)):
        position = ends.held().get(name)
        if position is not None and math.dist(points[index], position) > SAME_PLACE * length:
            expected = f"{xyz(position)}, where ends.{name}.position holds the cable"
            yield Finding(("initial", "points", index), expected, "let the polyline begin and end at the held ends")
    yield from _bodies_agree(ends, points[0], points[-1], SAME_PLACE * length)


def _drawn_as_long(points: tuple[Triple, ...], cable: Cable, ends: Ends, loads: float | None) -> Iterator[Finding]:
    """A polyline of another length than the line; loads: N, all that acts where a motion starts; None: a search."""
    total, length = sum(math.dist(a, b) for a, b in pairwise(points)), cable.length
    fits, less, more, why = length, POLYLINE_STRETCH, POLYLINE_STRETCH, "within 20 %"
    if loads is not None and cable.inextensible:
        less, more, why = SAME_PLACE, SAME_PLACE, "which is inextensible"
    elif loads is not None:
        held = ends.held()
        if len(held) == 2 and all(end.is_placed for end in ends.both):  # so far apart they stretch it in any shape
            fits = max(length, math.dist(held["start"], held["end"]))
        less = _strain_at_start(cable, loads)
        more = max(less, min(POLYLINE_STRETCH, *(x.strain_limit for x in cable.sections)))
        longer = f"within the {100 * more:.3g} % that a section bears (max_strain)"
        why = longer if total > fits else f"within {100 * less:.3g} %"
    if -(less + SAME_LENGTH) * length <= total - fits <= (more + SAME_LENGTH) * length:
        return
    expected = f"a polyline {fits:.8g} m long, the length of the cable, {why}"
    fix = f"move the points, or make the cable {total:.8g} m long"
    yield Finding(("initial", "points"), expected, fix, f"{len(points)} points, {total:.8g} m in all")


def _strain_at_start(cable: Cable, loads: float) -> float:
    """Compression with which a motion may start: max_strain, or what all loads (N) together make, or a drawing."""
    each = [(x.max_strain, min(max(DRAWN_STRAIN, x.strain(loads)), x.strain_limit)) for x in cable.sections]
    return min(by_loads if asked is None else asked for asked, by_loads in each)


def _pieces_fit(points: tuple[Triple, ...], s: tuple[float, ...], cable: Cable, loads: float) -> Iterator[Finding]:
    """Arc lengths of the corners of a polyline that do not end with the cable, or strain a piece too far."""
    length, exact = cable.length, cable.inextensible
    if abs(s[-1] - length) > SAME_PLACE * length:
        fix = "the last arc length is the length of all sections"
        yield Finding(("initial", "arc_lengths", len(s) - 1), f"{length:.8g} m, the length of the cable", fix)
        return
    less, more = (SAME_PLACE, SAME_PLACE) if exact else (_strain_at_start(cable, loads), POLYLINE_STRETCH)
    for i, (a, b) in enumerate(pairwise(zip(points, s, strict=True)), start=1):
        chord, rest = math.dist(a[0], b[0]), b[1] - a[1]
        if not -less * rest - SAME_PLACE * length <= chord - rest <= more * rest + SAME_PLACE * length:
            bound = f"at most {100 * more:.3g} % longer and {100 * less:.3g} % shorter"
            bound = "as long as it, of an inextensible cable" if exact else bound
            expected = f"a chord from point {i - 1} to {i} that is {bound}: {chord:.6g} m over {rest:.6g} m of cable"
            yield Finding(("initial", "arc_lengths", i), expected, "move the point, or change the arc length")
            return


def _bodies_agree(ends: Ends, first: Triple, last: Triple, near: float) -> Iterator[Finding]:
    """Bodies whose first position is not where the initial shape has its ends."""
    for name, position in ends.initial_guesses().items():
        there = first if name == "start" else last
        if math.dist(position, there) > near:
            here: Place = ("ends", name, "initial_guess")
            yield Finding(here, f"{xyz(there)}, where initial puts this end of the cable", "leave initial_guess out")


Hung = Float | Clump | Swivel | Modules | Body

# Mean densities (mass over displaced volume).  The least is a part of the density of the fluid, because a float in the
# air is lighter than air: in sea water 8.2 kg/m^3, which an inflated lift bag exceeds (10), and 51 for a clump, which
# is to weigh on the cable.  The most, in kg/m^3, is more than that of any metal (osmium, 22 600).
LEAST_PART: dict[str, float] = {"float": 0.008, "modules": 0.008, "body": 0.008, "clump": 0.05, "swivel": 0.05}
DENSEST = 25_000.0  # kg/m^3
FOAM_TO_WATER = (20.0, 1000.0)  # kg/m^3, to which a corrected unit of what floats should lead
# Slips of units: the key, the factor that corrects it, and what its value is then taken for.
_SLIPS = (
    ("mass", 1e3, "in t"),
    ("mass", 1e-3, "in g"),
    ("volume", 1e-3, "in litres"),
    ("volume", 1e-6, "in cm^3"),
    ("volume", 1e3, "a thousand times too small"),
    ("volume", 1e6, "a million times too small"),
)

_WATER = "give environment.fluid, such as `fluid: {density: 1025}` (kg/m^3)"


def attachments_on_cable(cable: Cable) -> Iterator[Finding]:
    """Attachments beyond the end of the cable."""
    length = cable.length
    for i, item in enumerate(cable.attachments):
        place: Place = ("range", 1) if isinstance(item, Spread) else ("at",)
        if (item.range[1] if isinstance(item, Spread) else item.at) > length * (1 + SAME_LENGTH):
            expected = f"an arc length between 0 and {length:.8g} m, the cable's length"
            fix = "move it onto the cable, or make the cable longer (cable.sections)"
            yield Finding(("cable", "attachments", i, *place), expected, fix)


def restrictors_hold_what_bends(cable: Cable) -> Iterator[Finding]:
    """Bend restrictors on sections without a bending stiffness, or of a radius that a table has not got beyond."""
    ends = [*accumulate((x.length for x in cable.sections), initial=0.0)]
    for i, item in enumerate(cable.attachments):
        if not isinstance(item, BendRestrictor):
            continue
        for k, section in enumerate(cable.sections):
            if ends[k] < item.range[1] and ends[k + 1] > item.range[0] and not section.weakest_bending:
                expected = f"a bending stiffness of cable.sections[{k}], because what locks there bends until then"
                fix = f"add cable.sections[{k}].bending_stiffness (N m^2)"
                yield Finding(("cable", "attachments", i, "range"), expected, fix)


def swivels_turn(cable: Cable) -> Iterator[Finding]:
    """Swivels where nothing turns about the cable."""
    near = SAME_LENGTH * cable.length
    for i, item in enumerate(cable.attachments):
        if not isinstance(item, Swivel):
            continue
        here: Place = ("cable", "attachments", i)
        if abs(item.at - cable.length) <= near:
            expected = f"an arc length inside the cable, less than {cable.length:.8g} m"
            yield Finding((*here, "at"), expected, "at an end write ends.end.swivel: true (kind clamped)")


def attachments_in_fluid(environment: Environment, cable: Cable) -> Iterator[Finding]:
    """Attachments that need a fluid and have none, or that do in it what their kind does not say."""
    for i, item in enumerate(cable.attachments):
        here: Place = ("cable", "attachments", i)
        if isinstance(item, Clump | Swivel):
            yield from _needs_fluid(here, item, environment)
        elif isinstance(item, BendStiffener | BendRestrictor):
            continue
        elif environment.fluid is None:
            fix = f"{_WATER}; what only weighs is kind: clump"
            yield Finding((*here, "kind"), "a fluid, because nothing floats without one", fix, item.kind)
        elif item.buoyancy is not None and environment.gravity == 0.0:
            measure = "volume (m^3/m)" if isinstance(item, Modules) else "volume (m^3)"
            expected = f"{measure} instead, because without gravity nothing has weight or buoyancy"
            yield Finding((*here, "buoyancy"), expected, "give volume and leave buoyancy out")
        else:
            yield from _floats(here, item, environment.fluid.density, environment.gravity)


def _floats(here: Place, item: Float | Modules, density: float, gravity: float) -> Iterator[Finding]:
    if (
        isinstance(item, Float)
        and item.volume is not None
        and density * item.volume < item.mass <= DENSEST * item.volume
    ):
        expected = f"more than {item.mass / density:.6g} m^3, the volume of fluid that weighs as much as the float"
        yield Finding((*here, "volume"), expected, "use kind: clump for what sinks, with the same mass and volume")
    if isinstance(item, Modules) and item.buoyancy is not None and item.volume_in(density, gravity) < 0.0:
        weight = item.mass * gravity
        expected = f"at least {0.0 - weight:.6g} N/m: modules cannot sink with more than their weight, {weight:.6g} N/m"
        yield Finding((*here, "buoyancy"), expected, "give their mass (kg/m), in air")


def bodies_in_fluid(environment: Environment, ends: Ends) -> Iterator[Finding]:
    """Bodies with what only a fluid gives a meaning to."""
    for name, body in ends.bodies().items():
        yield from _needs_fluid(("ends", name), body, environment)


def _needs_fluid(here: Place, item: Clump | Swivel | Body, environment: Environment) -> Iterator[Finding]:
    if environment.fluid is not None:
        return
    names = {"volume": "buoyancy", "drag_area": "drag", "added_mass": "added mass", "height": "height under water"}
    for key, name in names.items():
        if getattr(item, key):
            yield Finding((*here, key), f"no {name} without a fluid", f"{_WATER}, or leave {key} out")


# --- mass and volume ---------------------------------------------------------------------------


def densities(environment: Environment, cable: Cable, ends: Ends) -> Iterator[Finding]:
    """Attachments and bodies whose mass and volume make no possible density; alone, no possible size."""
    fluid = environment.fluid
    if fluid is None:
        return
    named: list[tuple[Place, Hung]] = [
        (("cable", "attachments", i), item)
        for i, item in enumerate(cable.attachments)
        if not isinstance(item, BendStiffener | BendRestrictor)  # a density is given, or nothing
    ]
    named += [(("ends", name), body) for name, body in ends.bodies().items()]
    for here, item in named:
        if environment.gravity == 0.0 and getattr(item, "buoyancy", None) is not None:
            continue  # refused above: there is no volume to compare with
        volume = item.volume_in(fluid.density, environment.gravity)
        if item.mass > 0.0 and volume > 0.0:
            yield from _density(here, item, volume, fluid.density)
        else:
            yield from _size(here, item, volume, cable.length)


def _density(here: Place, item: Hung, volume: float, fluid: float) -> Iterator[Finding]:
    density, least, most = item.mass / volume, LEAST_PART[item.kind] * fluid, DENSEST
    lift = getattr(item, "buoyancy", None)
    if density >= least and (density <= most or lift is not None):
        return  # a lift that is given by a rounded number may leave next to no volume
    per = "/m" if isinstance(item, Modules) else ""
    given = f"volume {volume:.4g} m^3{per}" if lift is None else f"buoyancy {lift:g} N{per}"
    expected = (
        f"{least * volume:.3g} to {most * volume:.3g} kg{per} with {given}: a mean density of {least:.3g} to "
        f"{most:g} kg/m^3; this one is {density:.3g} kg/m^3"
    )
    yield Finding((*here, "mass"), expected, _other_units(item, density))


def _other_units(item: Hung, density: float) -> str:
    """The units from which an impossible density, kg/m^3, may come, and what to write instead."""
    per = "/m" if isinstance(item, Modules) else ""
    least, most = FOAM_TO_WATER if isinstance(item, Float | Modules) else USUAL_DENSITIES
    units = {"mass": f"kg{per}", "volume": f"m^3{per}"}
    found = []
    for key, factor, what in _SLIPS:
        value = getattr(item, key)  # None: a volume that follows from buoyancy
        corrected = density * factor if key == "mass" else density / factor
        if value is not None and least <= corrected <= most:
            unit = f"{what}{per}" if what.startswith("in ") else what
            found.append(f"is {key} {unit}? then {key}: {value * factor:.6g} ({units[key]})")
    return "; or ".join(found) or f"check mass ({units['mass']}) and {'volume' if item.volume else 'buoyancy'}"


def _size(here: Place, item: Hung, volume: float, length: float) -> Iterator[Finding]:
    """What has a volume alone, or a mass alone and so at least the volume of the densest metal."""
    given = volume > 0.0
    least = volume if given else item.mass / DENSEST
    if isinstance(item, Modules):
        width, shape = math.sqrt(4.0 / math.pi * least), "a cylinder around the cable"
    else:
        width, shape = sphere_diameter(least), "a sphere"
    if width <= length:
        return
    key, unit = ("mass", "kg") if not given else ("volume", "m^3") if item.volume else ("buoyancy", "N")
    per = "/m" if isinstance(item, Modules) else ""
    of = "that volume" if given else f"that mass, of the densest metal ({DENSEST:g} kg/m^3),"
    expected = f"less: {shape} of {of} is {width:.3g} m wide, and the cable is {length:.6g} m long"
    slip = {"mass": "is it in g?", "volume": "is it in litres?", "buoyancy": "is it in mN?"}[key]
    yield Finding((*here, key), expected, f"give it in {unit}{per}; {slip} then {getattr(item, key) / 1e3:.6g}")
