"""What the cable is made of and what surrounds it."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.attachments import Attachment
from hybrid.scene.base import (
    Finding,
    NonNegative,
    NonNegativePair,
    Number,
    PlainNumber,
    Positive,
    Table,
    Vector,
    number_or_list,
    refuse,
)
from hybrid.scene.sea import Current, CurrentPoint, CurrentProfile, PowerLawCurrent, Seabed, UniformCurrent, Waves


class Fluid(Table):
    """The water (or air) around the whole cable; without this table there is none."""

    density: Positive = Field(description="density rho of the fluid; gives buoyancy, drag and added mass [kg/m^3]")
    current: Current | None = Field(
        default=None,
        description="velocity of the fluid (of air: the wind), inertial frame: the same everywhere; or a list of "
        "{z, velocity}, linear between its heights and constant beyond; or by kind; absent: still water [m/s]",
    )
    surface: Number | None = Field(
        default=None, description="height of the still water (sea level, MSL); absent: everything is under water [m]"
    )
    waves: Waves | None = Field(default=None, description="waves on the surface; absent: none")

    def flows(self) -> bool:
        """Whether there is a current anywhere."""
        current = self.current
        if current is None or isinstance(current, UniformCurrent | PowerLawCurrent):
            return current is not None and any(current.velocity)
        points = current.table if isinstance(current, CurrentProfile) else current
        return any(any(p.velocity) if isinstance(p, CurrentPoint) else p != 0.0 for p in points)

    @model_validator(mode="after")
    def _levels(self) -> Fluid:
        if self.waves is not None and self.surface is None:
            refuse([Finding(("surface",), "a number, in m, because waves need a surface", "add `surface: 0` (m)")])
        current = self.current
        if isinstance(current, PowerLawCurrent) and current.bottom >= current.top_under(self.surface):
            top = "the surface" if self.surface is not None else "the top, 0 m without a surface"
            expected = f"a height below {current.top_under(self.surface):.8g} m, {top}"
            fix = "z points up; heights below the surface are negative"
            refuse([Finding(("current", "bottom"), expected, fix)])
        return self


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

    def files(self) -> list[str]:
        """Paths of the files that are read."""
        depths = self.seabed.depths if self.seabed is not None else None
        return [depths.file] if depths is not None and depths.file is not None else []

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


# Mean densities of a section, kg/m^3: nothing that is laid or moored is lighter than foam, and a studless chain is
# 28 000 by the diameter of its bar.  USUAL_DENSITIES: what a corrected unit should lead to.
SECTION_DENSITIES, USUAL_DENSITIES = (15.0, 30_000.0), (300.0, 12_000.0)
# Slips of units: the key, what its value is divided by, and the unit it was written in.
_SLIPS = (
    ("mass", 1e3, "in g/m or kg/km"), ("diameter", 1e3, "in mm"), ("diameter", 1e2, "in cm"), ("mass", 1e-3, "in t/m"),
    ("diameter", 0.5, "a radius"),
)  # fmt: skip


def _other_units(density: float, mass: float, diameter: float) -> str:
    """The unit from which an impossible mean density, kg/m^3, most likely comes, and what to write instead."""
    for key, divisor, unit in _SLIPS:
        corrected = density / divisor if key == "mass" else density * divisor**2
        if USUAL_DENSITIES[0] <= corrected <= USUAL_DENSITIES[1]:
            value = (mass if key == "mass" else diameter) / divisor
            return f"is {key} {unit}? then {key}: {value:.6g}"
    return "check mass (kg/m) and diameter (m); without a diameter there is no volume to compare with"


class Contact(Table):
    """What the cable touches beside the seabed: itself."""

    self: bool = Field(
        default=False,
        description="whether parts of the cable that are no neighbours keep a diameter apart in a run; needs "
        "model: rod or adaptive, and the diameter of every section; absent: they pass through each other, and an "
        "event says where",
    )
    friction: NonNegative = Field(
        default=0.0,
        description="coefficient of friction between parts of the cable that touch each other, with `self` [-]",
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
    max_strain: Positive = Field(
        default=0.05,
        description="strain that the section bears; a computation that exceeds it stops; an inextensible section has "
        "none [-]",
    )
    bending_stiffness: OneOrTwo | None = Field(
        default=None,
        description="bending stiffness EI (modulus E x second moment of area), or [about a1, about a2]; needed in "
        "rod zones [N m^2]",
    )
    torsional_stiffness: NonNegative | None = Field(
        default=None, description="torsional stiffness GJ; absent: bending stiffness / 1.3 [N m^2]"
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
    rotary_inertia: OneOrTwo | None = Field(
        default=None,
        description="rotary inertia per length: transverse, or [transverse, polar]; "
        "absent: that of a solid round section, or none without a diameter [kg m]",
    )
    intrinsic_curvature: Vector | None = Field(
        default=None, description="curvatures about a1 and a2 and twist of the unloaded cable, material axes [1/m]"
    )
    drag: Drag | None = Field(default=None, description="drag coefficients Cd; need a fluid and a diameter")
    added_mass: AddedMass | None = Field(
        default=None, description="added mass coefficients Ca; need a fluid and a diameter"
    )
    damping: Annotated[Damping, PlainNumber(("mass",))] | None = Field(
        default=None, description="internal damping; a plain number is the mass-proportional part"
    )

    @property
    def anisotropic(self) -> bool:
        """Whether the two bending stiffnesses differ, so that the material axes matter."""
        return isinstance(self.bending_stiffness, tuple) and self.bending_stiffness[0] != self.bending_stiffness[1]

    @property
    def turns(self) -> bool:
        """Whether its cross-sections are given an inertia of their own."""
        return self.rotary_inertia is not None and self.rotary_inertia not in (0, (0, 0))

    @property
    def weakest_bending(self) -> float | None:
        """The smaller bending stiffness [N m^2], None if none is given."""
        return min(self.bending_stiffness) if isinstance(self.bending_stiffness, tuple) else self.bending_stiffness

    @model_validator(mode="after")
    def _density_is_possible(self) -> Section:
        if self.diameter is None:
            return self
        area = 0.25 * math.pi * self.diameter**2
        density, (least, most) = self.mass / area, SECTION_DENSITIES
        if not least <= density <= most:
            expected = (
                f"{least * area:.3g} to {most * area:.3g} kg/m with a diameter of {self.diameter:g} m: a mean density "
                f"of {least:g} to {most:g} kg/m^3; this one is {density:.3g} kg/m^3"
            )
            refuse([Finding(("mass",), expected, _other_units(density, self.mass, self.diameter))])
        return self

    @model_validator(mode="after")
    def _limits_leave_room(self) -> Section:
        if self.min_tension is not None and self.max_tension is not None and self.min_tension >= self.max_tension:
            expected = f"a tension below max_tension, {self.max_tension:g} N"
            refuse([Finding(("min_tension",), expected, "are the two exchanged?")])
        return self

    @model_validator(mode="after")
    def _frame_needs_torsion(self) -> Section:
        reason = ""
        if self.anisotropic:
            reason = "two different bending stiffnesses"
        if self.intrinsic_curvature is not None and any(self.intrinsic_curvature):
            reason = "intrinsic_curvature"
        if reason and self.torsional_stiffness is None:
            expected = f"a number, in N m^2, because with {reason} the twist of the cable matters"
            refuse([Finding(("torsional_stiffness",), expected, "add `torsional_stiffness: ...` (N m^2)")])
        return self


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
        elastic = [x for x in self.sections if x.axial_stiffness is not None]
        most = min((x.axial_stiffness * x.max_strain for x in elastic if x.axial_stiffness), default=0.0)  # N
        return self.length + sum(x.length * most / x.axial_stiffness for x in elastic if x.axial_stiffness)

    @property
    def inextensible(self) -> bool:
        """Whether no section can stretch."""
        return all(section.axial_stiffness is None for section in self.sections)
