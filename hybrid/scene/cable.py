"""What the cable is made of and what surrounds it."""

from __future__ import annotations

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

    density: Positive = Field(description="density of the fluid; gives buoyancy, drag and added mass [kg/m^3]")
    current: Current | None = Field(
        default=None,
        description="velocity of the fluid, inertial frame: the same everywhere; or a list of {z, velocity}, linear "
        "between its heights and constant beyond; or by kind; absent: still water [m/s]",
    )
    surface: Number | None = Field(
        default=None, description="height of the still water level; absent: everything is under water [m]"
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

    gravity: NonNegative = Field(default=9.81, description="acceleration of gravity, along -z [m/s^2]")
    fluid: Fluid | None = Field(
        default=None,
        description="the fluid around the cable: water, or air (density 1.225, the wind as current); absent: vacuum",
    )
    seabed: Seabed | None = Field(default=None, description="the ground the cable can lie on; absent: none")

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
            return self.fluid.surface - self.seabed.z
        return self.fluid.waves.depth if self.fluid.waves is not None else None


class Drag(Table):
    """Morison drag per length: 1/2 density x diameter x coefficient x |u| u, normal and tangential part."""

    normal: NonNegative = Field(default=0.0, description="normal drag coefficient, on the diameter [-]")
    tangential: NonNegative = Field(
        default=0.0, description="tangential drag coefficient, on the circumference pi x diameter [-]"
    )


class AddedMass(Table):
    """Fluid that moves with the cable, as a multiple of the displaced mass."""

    normal: NonNegative = Field(default=0.0, description="added mass coefficient across the cable [-]")
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


class Section(Table):
    """A stretch of cable with constant properties, per metre of unstretched length."""

    length: Positive = Field(description="unstretched length [m]")
    mass: Positive = Field(description="mass per length, in air [kg/m]")
    diameter: Positive | None = Field(
        default=None, description="outer diameter; needed by buoyancy, drag and added mass [m]"
    )
    axial_stiffness: Positive | None = Field(default=None, description="axial stiffness EA; absent: inextensible [N]")
    bending_stiffness: OneOrTwo | None = Field(
        default=None,
        description="bending stiffness EI, or [about a1, about a2]; needed in rod zones [N m^2]",
    )
    torsional_stiffness: NonNegative | None = Field(
        default=None, description="torsional stiffness GJ; absent: bending stiffness / 1.3 [N m^2]"
    )
    min_bend_radius: Positive | None = Field(
        default=None,
        description="smallest bend radius allowed; changes nothing that is computed: reports say how near the cable "
        "comes to it; absent: none [m]",
    )
    rotary_inertia: OneOrTwo | None = Field(
        default=None,
        description="rotary inertia per length: transverse, or [transverse, polar]; "
        "absent: that of a solid round section, or none without a diameter [kg m]",
    )
    intrinsic_curvature: Vector | None = Field(
        default=None, description="curvatures about a1 and a2 and twist of the unloaded cable, material axes [1/m]"
    )
    drag: Drag | None = Field(default=None, description="drag coefficients; need a fluid and a diameter")
    added_mass: AddedMass | None = Field(
        default=None, description="added mass coefficients; need a fluid and a diameter"
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
    def inextensible(self) -> bool:
        """Whether no section can stretch."""
        return all(section.axial_stiffness is None for section in self.sections)
