"""Contradictions about what hangs on the cable: attachments and the bodies at its ends."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import accumulate

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
from hybrid.scene.base import Finding, Place
from hybrid.scene.cable import USUAL_DENSITIES, Cable, Environment
from hybrid.scene.ends import Body, Ends
from hybrid.scene.start_checks import SAME_LENGTH

Hung = Float | Clump | Swivel | Modules | Body

# Mean densities (mass over displaced volume).  The least is a part of the density of the fluid, because a float in the
# air is lighter than air: in sea water 8.2 kg/m^3, which an inflated lift bag exceeds (10), and 51 for a clump, which
# is to weigh on the cable.  The most, in kg/m^3, is more than that of any metal (osmium, 22 600).
LEAST_PART: dict[str, float] = {"float": 0.008, "modules": 0.008, "body": 0.008, "clump": 0.05, "swivel": 0.05}
DENSEST = 25_000.0
FOAM_TO_WATER = (20.0, 1000.0)  # kg/m^3, to which a corrected unit of what floats should lead
# Slips of units: the key, the factor that corrects it, and what its value is then taken for.
_SLIPS = (
    ("mass", 1e3, "in t"), ("mass", 1e-3, "in g"), ("volume", 1e-3, "in litres"), ("volume", 1e-6, "in cm^3"),
    ("volume", 1e3, "a thousand times too small"), ("volume", 1e6, "a million times too small"),
)  # fmt: skip

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
