"""What the cable is made of and what surrounds it."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Discriminator, Field, PrivateAttr, Tag

from hybrid.scene.attachments import Attachment
from hybrid.scene.base import (
    Finding,
    Findings,
    NonNegative,
    NonNegativePair,
    Number,
    Pair,
    PlainNumber,
    Positive,
    Table,
    Vector,
    number_or_list,
)
from hybrid.scene.sea import Current, CurrentPoint, CurrentProfile, PowerLawCurrent, Seabed, UniformCurrent
from hybrid.scene.section_laws import (
    Code,
    Creep,
    Curve,
    DynamicStiffness,
    Layer,
    RiserCode,
    SlipLayer,
    Syrope,
    TensionStrain,
    bending_findings,
    capacity_findings,
    first_loading_findings,
    interpolated,
    layers_of,
    refuse_rows,
    rows_of,
    slopes,
)
from hybrid.scene.waves import Waves


class Fluid(Table):
    """The water (or air) around the whole cable; without this table there is none."""

    density: Positive = Field(description="density rho of the fluid; gives buoyancy, drag and added mass [kg/m^3]")
    current: Current | None = Field(
        default=None,
        description="velocity of the fluid (of air: the wind), inertial frame: the same everywhere; or a table with "
        "speed and direction; or a list of {z, velocity} or {z, speed, direction}, linear between its heights and "
        "constant beyond; or by kind; absent: still water [m/s]",
    )
    surface: Number | None = Field(
        default=None, description="height of the still water (sea level, MSL); absent: everything is under water [m]"
    )
    waves: Waves | None = Field(default=None, description="waves on the surface; absent: none")

    def flows(self) -> bool:
        """Whether there is a current anywhere."""
        current = self.current
        if current is None or isinstance(current, UniformCurrent | PowerLawCurrent):
            return current is not None and any(current.flow)
        points = current.table if isinstance(current, CurrentProfile) else current
        return any(any(p.flow) if isinstance(p, CurrentPoint) else p != 0.0 for p in points)

    def _check_levels(self) -> Findings:
        if self.waves is not None and self.surface is None:
            yield [Finding(("surface",), "a number, in m, because waves need a surface", "add `surface: 0` (m)")]
        current = self.current
        if isinstance(current, PowerLawCurrent) and current.bottom >= current.top_under(self.surface):
            top = "the surface" if self.surface is not None else "the top, 0 m without a surface"
            expected = f"a height below {current.top_under(self.surface):.8g} m, {top}"
            fix = "z points up; heights below the surface are negative"
            yield [Finding(("current", "bottom"), expected, fix)]


class Environment(Table):
    """What acts on the cable from outside."""

    gravity: NonNegative = Field(default=9.81, description="acceleration g of gravity, along -z [m/s^2]")
    fluid: Fluid | None = Field(
        default=None,
        description="the fluid around the cable: water, or air (density 1.225, the wind as current); absent: vacuum",
    )
    seabed: Seabed | None = Field(
        default=None,
        description="the ground (sea floor) at the depth of the water; absent: none",
    )

    @property
    def waves(self) -> Waves | None:
        """The waves, if there are any."""
        return self.fluid.waves if self.fluid is not None else None

    @property
    def depth(self) -> float | None:
        """Depth of the water [m] that waves feel, at x = y = 0; None: deep, or no surface."""
        if self.fluid is None or self.fluid.surface is None:
            return None
        if self.seabed is not None:
            return self.fluid.surface - self.seabed.height(0.0, 0.0)
        return self.fluid.waves.depth if self.fluid.waves is not None else None


class Drag(Table):
    """Morison drag per length: 1/2 density x diameter x coefficient x |u| u, normal and tangential part."""

    normal: NonNegative = Field(default=0.0, description="normal drag coefficient Cd, on the diameter [-]")
    tangential: NonNegative = Field(
        default=0.0, description="tangential drag coefficient, on the circumference pi x diameter [-]"
    )


class AddedMass(Table):
    """Fluid that moves with the cable, as a multiple of the displaced mass."""

    normal: NonNegative = Field(default=0.0, description="added mass coefficient Ca = Cm - 1 across the cable [-]")
    tangential: NonNegative = Field(default=0.0, description="added mass coefficient along the cable [-]")


class Vortices(Table):
    """Vortex-induced vibration across line and flow, by lift whose phase locks in to the motion.

    It locks in within a range of frequencies; in motion only, and in space.
    """

    lift: Positive = Field(default=1.2, description="lift coefficient Cv: 1/2 density x diameter x Cv x |u|^2 [-]")
    center: Positive = Field(
        default=0.144, description="frequency of shedding in phase with the motion, over |u|/diameter [-]"
    )
    low: Positive = Field(default=0.08, description="the least frequency to which it locks in, over |u|/diameter [-]")
    high: Positive = Field(
        default=0.206, description="the largest frequency to which it locks in, over |u|/diameter [-]"
    )
    ramp: NonNegative = Field(default=0.0, description="time over which the lift grows at the start; 0: at once [s]")

    def _check_in_order(self) -> Findings:
        if not self.low < self.center < self.high:
            expected = f"a number between low, {self.low:g}, and high, {self.high:g}"
            yield [Finding(("center",), expected, "is low above high, or center beyond one of them?")]


class Damping(Table):
    """Rayleigh damping; a plain number means `mass`."""

    mass: NonNegative = Field(default=0.0, description="mass-proportional damping, mainly to settle a cable [1/s]")
    stiffness: NonNegative = Field(
        default=0.0, description="stiffness-proportional damping of stretch, bending and twist [s]"
    )


# One number for a round section, two for the material axes a1, a2 (or transverse, polar).
OneOrTwo = Annotated[
    Annotated[NonNegative, Tag("<number>")] | Annotated[NonNegativePair, Tag("<list>")],
    Discriminator(number_or_list),
]


# Mean densities of a section, kg/m^3, that no reading but another unit explains: nothing that is laid or moored is
# lighter than foam, and the lightest usual line with its mass in g/m has 300 000.  Beyond
# DENSITIES (a studless chain has 28 000 by the diameter of its bar) an event says that it is implausible.
SECTION_DENSITIES = (15.0, 300_000.0)
DENSITIES = (50.0, 25_000.0)  # kg/m^3, plausible ones, with room: from hollow and foamed to solid heavy metal
USUAL_DENSITIES = (300.0, 12_000.0)  # kg/m^3: what a corrected unit should lead to
# Slips of units: the key, what its value is divided by, and the unit it was written in.
_SLIPS = (
    ("mass", 1e3, "in g/m or kg/km"),
    ("diameter", 1e3, "in mm"),
    ("diameter", 1e2, "in cm"),
    ("mass", 1e-3, "in t/m"),
    ("diameter", 0.5, "a radius"),
)


def _other_units(density: float, mass: float, diameter: float) -> str:
    """The unit from which an impossible mean density, kg/m^3, most likely comes, and what to write instead."""
    for key, divisor, unit in _SLIPS:
        corrected = density / divisor if key == "mass" else density * divisor**2
        if USUAL_DENSITIES[0] <= corrected <= USUAL_DENSITIES[1]:
            value = (mass if key == "mass" else diameter) / divisor
            return f"is {key} {unit}? then {key}: {value:.6g}"
    return "check mass (kg/m) and diameter (m); without a diameter there is no volume to compare with"


class Around(NamedTuple):
    """What is around a line, and no key of its contact says."""

    rubs_on_others: bool = False  # it touches other lines with friction
    in_plane: bool = False  # its network has two dimensions, where lines touch themselves if that is asked
    ends_are_set: bool = False  # from outside: no scene says how near they come to each other


class Contact(Table):
    """What the cable touches beside the seabed: itself."""

    self: bool | None = Field(
        default=None,
        description="whether parts of the cable that are no neighbours keep a diameter apart in a run; needs the "
        "diameter of every section; absent: where these are given, the model has rods and the cable can reach "
        "itself, from when it comes near itself on, else parts pass through each other, and an event says where",
    )
    friction: NonNegative = Field(
        default=0.0,
        description="coefficient of friction between parts of the cable that touch each other, with `self` [-]",
    )
    _around: Around = PrivateAttr(default=Around())

    @property
    def around(self) -> Around:
        """What is known of the line from outside of this table."""
        return self._around

    @property
    def rubs(self) -> bool:
        """Whether friction with itself or other lines may turn the line about its axis."""
        return self._around.rubs_on_others or (self.friction > 0.0 and self.self is not False)

    def within(self, **known: bool) -> Contact:
        """The same of a line of which more is known: keys of `Around`."""
        found = self.model_copy()
        found._around = self._around._replace(**known)
        return found


# Strain that a section bears which says nothing: beyond that of steel, chain and most ropes.
USUAL_STRAIN = 0.05
# Stress, Pa, over the cross-section of `diameter`, that no cable bears: wire ropes break at 1.1 to 1.3 GPa of it, ropes
# of the strongest fibres at 1.2, the hardest drawn wire and carbon rods at 3.  Where that is a strain below the second,
# the diameter or the stiffness says nothing of the section: a line that is meant not to stretch.
STRONGEST, LEAST_STRAIN = 3e9, 0.02


# Young's modulus of steel, Pa.
STEEL = 2.07e11


class Pipe(Table):
    """A round pipe that carries all of a section: for wall tension and von Mises stress; changes no other result."""

    wall: Positive = Field(description="wall thickness [m]")
    outer_diameter: Positive | None = Field(
        default=None, description="outer diameter of the pipe, without coatings; absent: diameter of the section [m]"
    )
    modulus: Positive = Field(default=STEEL, description="Young's modulus of the wall; absent: that of steel [Pa]")
    pressure: NonNegative = Field(
        default=0.0, description="pressure inside over that of the air, at the height pressure_z [Pa]"
    )
    pressure_z: Number | None = Field(
        default=None, description="height at which pressure is given; absent: the surface of the water, else 0 [m]"
    )
    content_density: NonNegative = Field(
        default=0.0, description="density of the content, whose weight is part of the section's mass [kg/m^3]"
    )
    max_stress: Positive | None = Field(
        default=None,
        description="largest von Mises stress allowed; changes nothing that is computed; absent: none [Pa]",
    )


class Section(Table):
    """A stretch of cable with constant properties, per metre of unstretched length."""

    length: Positive = Field(description="unstretched length [m]")
    mass: Positive = Field(description="mass per length in air, the weight over gravity [kg/m]")
    diameter: Positive | None = Field(
        default=None, description="outer diameter (OD); needed by buoyancy, drag and added mass [m]"
    )
    axial_stiffness: Positive | None = Field(
        default=None, description="axial stiffness EA (modulus E x area); absent: inextensible [N]"
    )
    tension_strain: TensionStrain | None = Field(
        default=None,
        description="instead of axial_stiffness: rows [strain, tension in N] from [0, 0] on, both rising, straight "
        "between them; in compression the first piece goes on; or {file: rope.csv} [-, N]",
    )
    dynamic_stiffness: DynamicStiffness | None = Field(
        default=None,
        description="of a fibre rope, whose axial_stiffness, tension_strain or syrope is the static one; absent: the "
        "same, however fast",
    )
    syrope: Syrope | None = Field(
        default=None,
        description="instead of axial_stiffness: of polyester, whose tension over strain depends on its highest mean "
        "tension so far",
    )
    creep: Creep | None = Field(
        default=None,
        description="of a rope with axial_stiffness or tension_strain: strain that grows with the logarithm of time; "
        "absent: none",
    )
    max_strain: Positive | None = Field(
        default=None,
        description="strain that the section bears, stretched or compressed; a computation that exceeds it stops; "
        "absent: the last of tension_strain or syrope.curve, or 0.05, or with a `diameter` what 3 GPa over its area "
        "make of it, if "
        "that is between 0.02 and 0.05, because no wire, fibre rope or rod bears more; an inextensible section has "
        "none [-]",
    )
    bending_stiffness: OneOrTwo | None = Field(
        default=None,
        description="bending stiffness EI (modulus E x second moment of area), or [about a1, about a2]; needed in "
        "rod zones [N m^2]",
    )
    moment_curvature: tuple[Pair, ...] | None = Field(
        default=None,
        description="instead of bending_stiffness: rows [curvature, bending moment] from [0, 0] on, both rising, "
        "straight between them and beyond the last, the same about any axis, elastic; stiffness-proportional damping "
        "is that of the first piece [1/m, N m]",
    )
    first_loading: bool = Field(
        default=False,
        description="whether moment_curvature is that of a first loading, whose layers slip at its rows: unloading "
        "goes back along twice the curve (Masing), and the slopes fall from row to row",
    )
    bending_slip: tuple[SlipLayer, ...] = Field(
        default=(),
        description="layers that slip on each other, beside the bending_stiffness or moment_curvature that is left "
        "when all of them do: hysteresis of moment over curvature, the same about any axis; absent: none",
    )
    stiffness_per_tension: NonNegative = Field(
        default=0.0,
        description="by how much the bending stiffness grows with tension, that at the start of a step, about both "
        "axes: N m^2 per N; absent: not [m^2]",
    )
    torsional_stiffness: NonNegative | None = Field(
        default=None,
        description="torsional stiffness GJ; absent: bending stiffness / 1.3, of a table that of its first piece "
        "[N m^2]",
    )
    tension_torque: Number | None = Field(
        default=None,
        description="torque that a tension makes in a section held against turning, of a helical armour; its sign is "
        "that of the lay: a free end turns by minus tension_torque over torsional_stiffness per metre and N; absent: "
        "none [N m per N]",
    )
    min_bend_radius: Positive | None = Field(
        default=None,
        description="smallest bend radius allowed; changes nothing that is computed: reports say how near the cable "
        "comes to it; absent: none [m]",
    )
    max_tension: Positive | None = Field(
        default=None,
        description="largest tension allowed (minimum breaking load over the safety factor, say); changes nothing that "
        "is computed; absent: none [N]",
    )
    min_tension: Number | None = Field(
        default=None,
        description="smallest tension allowed, 0 where the cable must not be slack, negative for a compression that it "
        "bears; changes nothing that is computed; absent: none [N]",
    )
    max_contact_force: Positive | None = Field(
        default=None,
        description="largest force per length allowed with which the seabed, obstacles, other lines or the line itself "
        "press on it (crushing); where lines cross, that of the contact over the cells that bear it; changes nothing "
        "that is computed; absent: none [N/m]",
    )
    capacity: tuple[Pair, ...] | None = Field(
        default=None,
        description="what it bears of tension and bending together: corners [tension, curvature] of a polygon around "
        "no load, from [largest tension, 0] round to [0, largest curvature], or on to [-largest compression, 0]; "
        "changes nothing that is computed: the result has capacity_used; absent: none [N, 1/m]",
    )
    code: Code | None = Field(
        default=None,
        description="a code that it is checked by; changes nothing that is computed: the result has code_used; absent: "
        "none",
    )
    rotary_inertia: OneOrTwo | None = Field(
        default=None,
        description="rotary inertia per length: transverse, or [transverse, polar]; "
        "absent: that of a solid round section, or none without a diameter [kg m]",
    )
    intrinsic_curvature: Vector | None = Field(
        default=None, description="curvatures about a1 and a2 and twist of the unloaded cable, material axes [1/m]"
    )
    pipe: Pipe | None = Field(
        default=None, description="the wall of a pipe, for wall_tension and von_mises in the result; absent: neither"
    )
    drag: Drag | None = Field(default=None, description="drag coefficients Cd; need a fluid and a diameter")
    added_mass: AddedMass | None = Field(
        default=None, description="added mass coefficients Ca; need a fluid and a diameter"
    )
    vortices: Vortices | None = Field(
        default=None, description="vortex-induced vibration; needs a fluid and a diameter; absent: none"
    )
    damping: Annotated[Damping, PlainNumber(("mass",))] | None = Field(
        default=None, description="internal damping; a plain number is the mass-proportional part"
    )

    @property
    def damped(self) -> Damping:
        """Its damping, of nothing where none is given."""
        return self.damping or Damping()

    @property
    def anisotropic(self) -> bool:
        """Whether the two bending stiffnesses differ, so that the material axes matter."""
        return isinstance(self.bending_stiffness, tuple) and self.bending_stiffness[0] != self.bending_stiffness[1]

    @property
    def stretch_table(self) -> Curve | None:
        """Rows of strain and tension [N] of a section that has a table of them, of polyester its original curve."""
        if self.syrope is not None:
            return self.syrope.rows
        return rows_of(self.tension_strain) if self.tension_strain is not None else None

    @property
    def curve(self) -> Curve | None:
        """Rows of strain and tension [N], of a section that is stretched by no constant stiffness; else None."""
        if (table := self.stretch_table) is not None:
            return table
        if (self.dynamic_stiffness is None and self.creep is None) or self.axial_stiffness is None:
            return None
        return (0.0, 0.0), (1.0, self.axial_stiffness)

    @property
    def stiffness(self) -> float | None:
        """Axial stiffness [N]; of a table its stiffest piece, of a rope the dynamic one without mean tension."""
        if self.dynamic_stiffness is not None:
            return self.dynamic_stiffness.constant
        return max(slopes(table)) if (table := self.stretch_table) is not None else self.axial_stiffness

    @property
    def strain_limit(self) -> float:
        """Strain that is borne, where the section stretches.

        max_strain, or without one the last of a table, or what STRONGEST over its cross-section makes of it, if that is
        less than usual and not below LEAST_STRAIN.
        """
        if self.max_strain is not None:
            return self.max_strain
        if (table := self.stretch_table) is not None:
            return table[-1][0]
        if self.diameter is None or self.axial_stiffness is None:
            return USUAL_STRAIN
        by_stress = STRONGEST * 0.25 * math.pi * self.diameter**2 / self.axial_stiffness
        return min(USUAL_STRAIN, max(LEAST_STRAIN, by_stress))

    @property
    def borne(self) -> float:
        """Tension at that strain, at rest [N]; infinite where nothing stretches."""
        if self.stiffness is None:
            return math.inf
        return interpolated(self.curve, self.strain_limit) if self.curve else self.stiffness * self.strain_limit

    def strain(self, tension: float) -> float:
        """Strain at rest under a tension [N]."""
        if self.stiffness is None:
            return 0.0
        return interpolated(self.curve, tension, over_tension=True) if self.curve else tension / self.stiffness

    @property
    def turns(self) -> bool:
        """Whether its cross-sections are given an inertia of their own."""
        return self.rotary_inertia is not None and self.rotary_inertia not in (0, (0, 0))

    @property
    def initial_bending(self) -> tuple[float, float] | None:
        """Bending stiffness [N m^2] about both axes, of a table that without bend, without layers; None: not given."""
        if self.moment_curvature is not None:
            stiffness = slopes(self.moment_curvature)[-1 if self.first_loading else 0]
            return stiffness, stiffness
        b = self.bending_stiffness
        return b if b is None or isinstance(b, tuple) else (b, b)

    @property
    def elastic_table(self) -> Curve | None:
        """Rows of curvature and moment of a section that bends elastically by a table; else None."""
        return None if self.first_loading else self.moment_curvature

    @property
    def slip_layers(self) -> tuple[Layer, ...]:
        """Layers that slip, and last one that does not, whose stiffness is what tension adds."""
        given = tuple((x.stiffness, x.moment, x.per_tension, 0.0) for x in self.bending_slip)
        given += layers_of(self.moment_curvature) if self.first_loading and self.moment_curvature else ()
        return given + (((0.0, math.inf, 0.0, self.stiffness_per_tension),) if self.stiffness_per_tension else ())

    @property
    def weakest_bending(self) -> float | None:
        """The smaller bending stiffness [N m^2], of a table that of its softest piece; None if none is given."""
        if self.moment_curvature is not None:
            return min(slopes(self.moment_curvature))
        return min(self.bending_stiffness) if isinstance(self.bending_stiffness, tuple) else self.bending_stiffness

    def _check_turns_about_its_axis_too(self) -> Findings:
        if isinstance(self.rotary_inertia, tuple) and self.rotary_inertia[0] > 0.0 == self.rotary_inertia[1]:
            expected = "a number > 0, in kg m: no section turns across its axis with inertia and about it without"
            fix = f"twice the transverse one, that of a round section: {2.0 * self.rotary_inertia[0]:g}"
            yield [Finding(("rotary_inertia", 1), expected, fix)]

    def _check_tension_twists(self) -> Findings:
        if not self.tension_torque:
            return
        missing = [
            Finding((key,), f"a number > 0, in {unit}, because tension_torque {why}", f"add `{key}: ...` ({unit})")
            for key, unit, why in (
                ("axial_stiffness", "N", "lengthens a cable that turns"),
                ("torsional_stiffness", "N m^2", "turns it"),
            )
            if not getattr(self, key) and (key != "axial_stiffness" or self.curve is None)
        ]
        most = math.inf if self.diameter is None else self.diameter
        if abs(self.tension_torque) > most:
            expected = f"at most the diameter, {most:g} m in size: the armour lies within it, and 0.1 of it is much"
            missing.append(Finding(("tension_torque",), expected, "is it in N mm per N? then divide it by 1000"))
        if missing:
            yield missing

    def _check_density_is_possible(self) -> Findings:
        if self.diameter is None:
            return
        area = 0.25 * math.pi * self.diameter**2
        density, (least, most) = self.mass / area, SECTION_DENSITIES
        if not least <= density <= most:
            expected = (
                f"{least * area:.3g} to {most * area:.3g} kg/m with a diameter of {self.diameter:g} m: a mean density "
                f"of {least:g} to {most:g} kg/m^3; this one is {density:.3g} kg/m^3"
            )
            yield [Finding(("mass",), expected, _other_units(density, self.mass, self.diameter))]

    def _check_one_law_of_stretch(self) -> Findings:
        table, dynamic = self.tension_strain, self.dynamic_stiffness
        if table is not None and self.axial_stiffness is not None:
            fix = "leave one of the two out"
            yield [Finding(("axial_stiffness",), "nothing, because tension_strain says how it stretches", fix)]
        if table is not None:
            refuse_rows(table, "tension_strain")
        if self.creep is not None and self.syrope is not None:
            yield [Finding(("creep",), "nothing, because the curves of syrope have it", "leave creep out")]
        if self.creep is not None and self.curve is None:
            expected = "an axial_stiffness or tension_strain beside it: what does not stretch does not creep"
            yield [Finding(("creep",), expected, "add `axial_stiffness: ...` (N)")]
        if self.syrope is not None:  # whose curves depend on the highest mean tension
            for key in ("axial_stiffness", "tension_strain"):
                if getattr(self, key) is not None:
                    expected = "nothing, because syrope says how it stretches"
                    yield [Finding((key,), expected, "leave one of the two out")]
            last = self.syrope.rows[-1][0]
            if self.max_strain is not None and self.max_strain > last:
                expected = f"at most the strain of the last row of syrope.curve, {last:g}"
                yield [Finding(("max_strain",), expected, "leave it out, or add rows there")]
            fault = self.syrope.first_fault(dynamic) if dynamic is not None else None
            if dynamic is None:
                fix = "add `dynamic_stiffness: {constant: ..., relaxation_time: ...}`"
                yield [Finding(("dynamic_stiffness",), "a table, because syrope remembers the mean tension", fix)]
            yield [fault[1]] if fault is not None else []
            return
        if dynamic is None:
            return
        if self.curve is None:
            expected = "an axial_stiffness, tension_strain or syrope beside it, the static one"
            yield [Finding(("dynamic_stiffness",), expected, "add `axial_stiffness: ...` (N)")]
        else:
            stiffest = max(slopes(self.curve))
            if not dynamic.constant > stiffest:
                expected = f"more than the largest static stiffness, {stiffest:.6g} N"
                fix = "a rope answers stiffer to what is fast; are the two exchanged?"
                yield [Finding(("dynamic_stiffness", "constant"), expected, fix)]

    def _check_one_law_of_bending(self) -> Findings:
        if self.moment_curvature is None:
            return
        if self.bending_stiffness is not None:
            fix = "leave one of the two out"
            yield [Finding(("bending_stiffness",), "nothing, because moment_curvature says how it bends", fix)]
        found = bending_findings(self.moment_curvature)
        yield (Finding(("moment_curvature", *x.at), x.expected, x.fix, x.given) for x in found)

    def _check_layers_slip(self) -> Findings:
        found: list[Finding] = []
        if self.first_loading:
            found += first_loading_findings(self.moment_curvature)
        if (self.first_loading or self.bending_slip) and self.torsional_stiffness == 0.0:
            expected = "a number > 0, in N m^2: layers that have slipped lie in a direction about the axis"
            found.append(Finding(("torsional_stiffness",), expected, "leave it out for bending stiffness / 1.3"))
        if (self.bending_slip or self.stiffness_per_tension) and not self.weakest_bending:
            left = "when all layers of bending_slip slip" if self.bending_slip else "without tension"
            expected = f"a number > 0, in N m^2: what is left {left}"
            found.append(Finding(("bending_stiffness",), expected, "add `bending_stiffness: ...` (N m^2)"))
        yield found

    def _check_limits_leave_room(self) -> Findings:
        if self.min_tension is not None and self.max_tension is not None and self.min_tension >= self.max_tension:
            expected = f"a tension below max_tension, {self.max_tension:g} N"
            yield [Finding(("min_tension",), expected, "are the two exchanged?")]

    def _check_capacity_goes_round(self) -> Findings:
        found = capacity_findings(self.capacity) if self.capacity is not None else []
        yield (Finding(("capacity", *x.at), x.expected, x.fix, x.given) for x in found)

    def _check_code_has_what_it_checks(self) -> Findings:
        if self.code is not None:
            yield (Finding(("code", *x.at), x.expected, x.fix, x.given) for x in self.code.findings())
        if isinstance(self.code, RiserCode) and self.pipe is None:
            yield [Finding(("pipe",), "the wall that DNV-OS-F201 checks", "add `pipe: {wall: ...}` (m)")]

    def _check_pipe_fits(self) -> Findings:
        if self.pipe is None:
            return
        given = self.pipe.outer_diameter
        outer = given if given is not None else self.diameter
        if outer is None:
            fix = "add `outer_diameter: ...` (m), or a diameter of the section"
            yield [Finding(("pipe", "outer_diameter"), "a number, in m", fix, "nothing")]
        assert outer is not None
        if given is not None and self.diameter is not None and given > self.diameter * (1.0 + 1e-9):
            expected = f"at most the diameter of the section, {self.diameter:g} m, coatings included"
            yield [Finding(("pipe", "outer_diameter"), expected, "check both diameters (m)")]
        if 2.0 * self.pipe.wall >= outer:
            expected = f"less than half the outer diameter, {0.5 * outer:g} m"
            yield [Finding(("pipe", "wall"), expected, "wall is in m, one wall alone")]

    def _check_frame_needs_torsion(self) -> Findings:
        reason = ""
        if self.anisotropic:
            reason = "two different bending stiffnesses"
        if self.intrinsic_curvature is not None and any(self.intrinsic_curvature):
            reason = "intrinsic_curvature"
        if reason and self.torsional_stiffness is None:
            expected = f"a number, in N m^2, because with {reason} the twist of the cable matters"
            yield [Finding(("torsional_stiffness",), expected, "add `torsional_stiffness: ...` (N m^2)")]


class Cable(Table):
    """The cable, from s = 0 at the start to s = length at the end."""

    sections: tuple[Section, ...] = Field(min_length=1, description="sections in order from s = 0 on")
    attachments: tuple[Attachment, ...] = Field(
        default=(), description="floats, clumps and modules on the cable, in any order"
    )

    @property
    def length(self) -> float:
        """Unstretched length of the whole cable [m]."""
        return sum(section.length for section in self.sections)

    @property
    def reach(self) -> float:
        """Length at which the first of its sections bears no more, pulled straight [m]."""
        most = min(x.borne for x in self.sections)  # N
        return self.length + (sum(x.length * x.strain(most) for x in self.sections) if math.isfinite(most) else 0.0)

    @property
    def inextensible(self) -> bool:
        """Whether no section can stretch."""
        return all(section.stiffness is None for section in self.sections)
