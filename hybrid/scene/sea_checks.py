"""Contradictions about the sea: water, waves, seabed."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hybrid.scene.analysis import Equilibrium, Initial, Straight, Time
from hybrid.scene.base import Finding, Place, unit
from hybrid.scene.cable import Cable, Environment
from hybrid.scene.ends import Ends, Triple
from hybrid.scene.sea import Depths, Seabed
from hybrid.scene.wave_theory import FADED, steady_wave, wavenumber
from hybrid.scene.waves import RecordedWaves, StreamFunctionWaves

# Miche (1944): a wave of height H and length L breaks where H / L reaches 0.142 tanh(k depth).
STEEPEST = 0.142

# How far under the seabed an end may be held, as part of the depth: a cable that rests there has sunk in a little.
SUNK = 1e-3
# The same in soil, m, where ends of cables and chains are buried.
BURIED = 3.0

# s: beyond it waves are tides, and so long that the formulas lose their digits.
LONGEST_PERIOD = 1e5

# Part of a time: round-off.
SAME_TIME = 1e-9

# Two depths that differ by less than this part are the same: people write six digits.
SAME_DEPTH = 1e-6

_WAVES: Place = ("environment", "fluid", "waves")


# Densities of fluids, kg/m^3.
LIQUIDS = (400.0, 3000.0)  # what has a surface: from liquefied gas to the heaviest mud
AIR = (0.5, 2.0)  # over a seabed there is a liquid or air
FLUIDS = (5e-4, 14_000.0)  # else anything from the air at 50 km to mercury
# Sea water in g/cm^3 or t/m^3, which is no usual air, and what it is to be in kg/m^3.
SEA_WATER_IN_GRAMS, WATER = (1.02, 1.03), (950.0, 1100.0)


def fluid_density(environment: Environment) -> Iterator[Finding]:
    """A density that no such fluid has."""
    fluid = environment.fluid
    if fluid is None:
        return
    x, bounds, what = fluid.density, [FLUIDS], "a fluid"
    if fluid.surface is not None:
        bounds, what = [LIQUIDS], "a liquid, because it has a surface"
    elif environment.seabed is not None:
        bounds, what = [AIR, LIQUIDS], "air or a liquid, because it lies over a seabed"
    grams = SEA_WATER_IN_GRAMS[0] <= x <= SEA_WATER_IN_GRAMS[1]
    if any(low <= x <= high for low, high in bounds) and not grams:
        return
    expected = f"{' or '.join(f'{low:g} to {high:g}' for low, high in bounds)} kg/m^3, {what}"
    in_kg = [x * k for k in (1e3, 1e-3) if WATER[0] <= x * k <= WATER[1]]
    fix = "1025 is sea water, 1000 fresh water, in kg/m^3" + ("; 1.225 is air" if fluid.surface is None else "")
    if in_kg:
        fix = f"write {in_kg[0]:g}, in kg/m^3" + ("; for thin air, 1.015" if grams and fluid.surface is None else "")
    yield Finding(("environment", "fluid", "density"), expected, fix)


# --- waves -------------------------------------------------------------------------------------


def waves(environment: Environment) -> Iterator[Finding]:
    """Waves without gravity, of two depths, or so steep that they break."""
    sea = environment.fluid.waves if environment.fluid is not None else None
    if sea is None:
        return
    if environment.gravity == 0.0:
        yield Finding(_WAVES, "no waves without gravity", "give environment.gravity, or leave waves out")
        return
    depth = environment.depth
    if depth is not None and depth <= 0.0:
        return  # the surface is complained of already
    if sea.depth is not None and depth is not None and abs(sea.depth - depth) > SAME_DEPTH * depth:
        expected = f"{depth:.8g} m, the depth of the seabed under the surface at x = y = 0"
        yield Finding((*_WAVES, "depth"), expected, "leave depth out; it follows from the seabed")
    for height, key, period, period_key in sea.sizes():
        if period > LONGEST_PERIOD:
            expected = f"at most {LONGEST_PERIOD:g} s: longer waves are tides"
            fix = "give a tide as environment.fluid.current; periods are in seconds"
            yield Finding((*_WAVES, *period_key), expected, fix)
            continue
        k = wavenumber(2 * math.pi / period, depth, environment.gravity)
        length = 2 * math.pi / k if k > 0.0 else math.inf
        highest = STEEPEST * length * (math.tanh(k * depth) if depth is not None else 1.0)
        if height >= highest:
            water = "deep water" if depth is None else f"{depth:.6g} m of water"
            expected = (
                f"less than {highest:.4g} m, because in {water} waves of {period:.6g} s are {length:.4g} m long, "
                "and higher ones break"
            )
            given = f"Hs = {height:.4g} m" if key == ("file",) else None
            yield Finding((*_WAVES, *key), expected, "lower waves, or a longer period", given)


def wave_is_steady(environment: Environment) -> Iterator[Finding]:
    """A wave of finite height that breaks, or whose series does not converge."""
    sea = environment.waves
    if not isinstance(sea, StreamFunctionWaves) or environment.gravity == 0.0:
        return

    if sea.period > LONGEST_PERIOD:
        fix = "give a tide as environment.fluid.current; periods are in seconds"
        yield Finding((*_WAVES, "period"), f"at most {LONGEST_PERIOD:g} s: longer waves are tides", fix)
        return
    depth = environment.depth
    found = steady_wave(sea.height, depth or math.inf, environment.gravity, sea.order, sea.period)
    water = "deep water" if depth is None else f"{depth:.6g} m of water"
    if found is None:
        expected = f"less, because no wave of {sea.period:g} s in {water} is that high without breaking"
        yield Finding((*_WAVES, "height"), expected, "lower waves, or a longer period")
    elif found.left > FADED:
        expected = f"more, because its last harmonics are {100.0 * found.left:.2g} % of the first in {water}"
        fix = "a larger order, or a lower wave: close to breaking, and in very shallow water, more than 40 are needed"
        yield Finding((*_WAVES, "order"), expected, fix)


def record_lasts(environment: Environment, time: Time | None) -> Iterator[Finding]:
    """A measured elevation that begins after a run, or ends before it: its harmonics would begin anew."""
    sea = environment.waves
    if not isinstance(sea, RecordedWaves) or time is None:
        return
    begin, end = sea.recorded.begin, sea.recorded.end
    if begin > 0.0:
        given = f"{begin:g} to {end:g} s"
        yield Finding((*_WAVES, "file"), "a record from t = 0 on, or before", "shift its times", given)
    elif end < time.duration * (1.0 - SAME_TIME):
        expected = f"at most {end:.8g} s, the end of the record of the sea, which would begin anew"
        yield Finding(("time", "duration"), expected, "a shorter run, or a longer record")


def followed(environment: Environment, ends: Ends) -> Iterator[Finding]:
    """Ends that follow waves which are not there, or are there at once."""
    sea = environment.fluid.waves if environment.fluid is not None else None
    for name, end in ends.named().items():
        motion = end.prescribed_motion
        if motion is None or (motion.follow is None and (motion.vessel is None or motion.vessel.rao is None)):
            continue
        if sea is None:
            fix, key = "give environment.fluid.waves, with a surface and a ramp", "follow"
            if motion.vessel is not None:
                key = "vessel"
            yield Finding(("ends", name, "motion", key), "nothing, because there are no waves to follow", fix)
        elif sea.ramp is None:
            expected = f"a number > 0, in s, because ends.{name} follows the waves and starts from rest"
            yield Finding((*_WAVES, "ramp"), expected, f"add `ramp: {2 * sea.main_period:.6g}` (s), two periods")
            return


# --- the seabed --------------------------------------------------------------------------------


def surface_over_seabed(environment: Environment, ends: Ends) -> Iterator[Finding]:
    """A surface that leaves no water over the seabed where an end is."""
    fluid, seabed = environment.fluid, environment.seabed
    if fluid is None or fluid.surface is None or seabed is None:
        return
    places = {f"ends.{name}": p for name, p in (ends.held() | ends.initial_guesses()).items()} or {
        "x = y = 0": (0.0, 0.0, 0.0)
    }
    if is_a_depth(environment, ends):
        return
    for name, (x, y, _) in places.items():
        bed = seabed.height(x, y)
        if fluid.surface <= bed:
            expected = f"a height above {bed:.8g} m, the seabed at {name}"
            yield Finding(("environment", "fluid", "surface"), expected, "z points up; lower the seabed")
            return


def is_a_depth(environment: Environment, ends: Ends) -> bool:
    """Whether `seabed.z` is above the water, or ends in it, and would be right with the other sign."""
    seabed, fluid = environment.seabed, environment.fluid
    if seabed is None or seabed.z <= 0.0 or fluid is None or fluid.surface is None:
        return False
    places = list((ends.held() | ends.initial_guesses()).values())
    over = [fluid.surface, *(z - (seabed.height(x, y) - seabed.z) for x, y, z in places)]  # over a bed at z = 0
    return min(over) < seabed.z and min(over) >= -(1.0 + SUNK) * seabed.z


def seabed_is_no_depth(environment: Environment, ends: Ends) -> Iterator[Finding]:
    """A depth in place of the height of the bed."""
    if is_a_depth(environment, ends):
        z = environment.seabed.z if environment.seabed is not None else 0.0
        expected = f"the height of the bed, {-z:.8g} m where it is {z:.8g} m under z = 0: z points up"
        yield Finding(("environment", "seabed", "z"), expected, f"write z: {-z:.8g}")


def deepest_place(environment: Environment, seabed: Seabed, length: float) -> float:
    """How far under the bed an end may be, m; length: of the line, m, for the depth where the water has none."""
    depth = length if environment.depth is None else max(environment.depth, 0.0)
    return max(SUNK * depth, BURIED if seabed.soil is not None else 0.0)


def nothing_in_the_ground(environment: Environment, cable: Cable, ends: Ends, initial: Initial) -> Iterator[Finding]:
    """Ends, bodies and initial shapes under the seabed."""
    seabed = environment.seabed
    if seabed is None or is_a_depth(environment, ends):
        return
    sunk = deepest_place(environment, seabed, cable.length)
    fix = "raise it, or lower environment.seabed.z"
    if seabed.depths is not None:
        yield from _within_depths(seabed.depths, ends)
    named: list[tuple[Place, Triple]] = [(("ends", n, "position"), p) for n, p in ends.held().items()]
    named += [(("ends", n, "initial_guess"), p) for n, p in ends.initial_guesses().items()]
    if not isinstance(initial, Equilibrium | Straight):
        named += [(("initial", "points", i), p) for i, p in enumerate(initial.points)]
    for place, (x, y, z) in named:
        under = seabed.height(x, y) - z
        if under > sunk:
            given = f"[{x:.8g}, {y:.8g}, {z:.8g}], which lies {under:.4g} m under the seabed"
            yield Finding(place, f"a place on the seabed or above, z >= {seabed.height(x, y):.8g} m", fix, given)
    if isinstance(initial, Straight) and not ends.held().keys() >= {"start", "end"}:
        yield from _straight_in_the_ground(environment, cable, ends, initial, sunk)
    for name, (x, y, z) in ends.held().items():
        motion = ends.named()[name].prescribed_motion
        travel = motion.travel if motion is not None else None
        if travel is not None:
            x, y, z = x + travel.by[0], y + travel.by[1], z + travel.by[2]
            under = seabed.height(x, y) - z
            if under > sunk:
                given = f"a way to [{x:.8g}, {y:.8g}, {z:.8g}], {under:.4g} m under the seabed"
                where: Place = ("ends", name, "motion", "travel", "by")
                yield Finding(where, "a way that ends on the seabed or above", fix, given)


def _within_depths(depths: Depths, ends: Ends) -> Iterator[Finding]:
    """Ends beside the grid of depths, where nobody knows the bed."""
    grid = depths.surface
    (a, b), (c, d) = ((float(k[0]), float(k[-1])) for k in (grid.x, grid.y))
    for key, places in (("position", ends.held()), ("initial_guess", ends.initial_guesses())):
        for name, (x, y, _) in places.items():
            if not (a <= x <= b and c <= y <= d):
                expected = f"a place over the grid of depths, x from {a:g} to {b:g} m and y from {c:g} to {d:g} m"
                yield Finding(("ends", name, key), expected, "extend the grid to where the cable may go")


def _straight_in_the_ground(
    environment: Environment, cable: Cable, ends: Ends, initial: Straight, sunk: float
) -> Iterator[Finding]:
    """The end of a straight cable that no position places."""
    seabed, held = environment.seabed, ends.held()
    origin, sign = held.get("start") or initial.origin, 1.0
    if "end" in held:
        origin, sign = held["end"], -1.0
    if seabed is None or origin is None:
        return
    u = unit(initial.direction)
    x, y, z = (origin[i] + sign * cable.length * u[i] for i in range(3))
    under = seabed.height(x, y) - z
    if under > sunk:
        given = f"a cable that ends at [{x:.8g}, {y:.8g}, {z:.8g}], {under:.4g} m under the seabed"
        yield Finding(("initial", "direction"), "a cable on the seabed or above", "another direction", given)
