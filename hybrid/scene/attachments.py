"""What hangs on the cable or sits in it: at points floats, clumps, swivels; over stretches modules and stiffeners."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import AliasChoices, Field

from hybrid.scene.base import (
    After,
    Finding,
    Findings,
    Kinds,
    NonNegative,
    NonNegativePair,
    Number,
    Positive,
    PositivePair,
    Table,
    refuse,
)

HEIGHT = "vertical extent, for the part under water at the surface; absent: that of a sphere of its volume [m]"
Shape = Literal["sphere", "cylinder"]
SHAPE = "how the part under water grows with the draught x of the height: sphere (3 x^2 - 2 x^3), upright cylinder (x)"
DRAG_AREA = "drag area CdA, drag coefficient x frontal area [m^2]"
ADDED_MASS = (
    "mass of the fluid that moves with it; of a body that floats: at the draught at which it floats by itself, and "
    "deeper [kg]"
)


def sphere_diameter(volume: float) -> float:
    """Diameter [m] of a sphere of that volume [m^3]."""
    return 2.0 * math.cbrt(0.75 * volume / math.pi)


def _lifts(value: float) -> float:
    if value < 0.0:
        fix = "use kind: clump for what sinks, with its mass (kg) and volume (m^3)"
        refuse([Finding((), "a number >= 0, in N", fix)])
    return value


Lift = Annotated[Number, After(_lifts), Field(json_schema_extra={"minimum": 0})]


class Hung(Table):
    """What all that hangs on a point of the cable has, behind keys of its own."""

    bases_last = True

    drag_area: NonNegative = Field(default=0.0, description=DRAG_AREA)
    added_mass: NonNegative = Field(default=0.0, description=ADDED_MASS)
    height: Positive | None = Field(default=None, description=HEIGHT)
    shape: Shape = Field(default="sphere", description=SHAPE)

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume [m^3] in a fluid of `density` [kg/m^3] under `gravity` [m/s^2]."""
        raise NotImplementedError

    def height_in(self, density: float, gravity: float) -> float:
        """Vertical extent [m]."""
        return self.height if self.height is not None else sphere_diameter(self.volume_in(density, gravity))


class Float(Hung):
    """A float at a point of the cable: a mass and a displaced volume, drag and added mass."""

    kind: Literal["float"] = Field(default="float", description="lifts the cable at a point: a buoy")
    at: NonNegative = Field(description="arc length s, its position on the cable [m]")
    buoyancy: Lift | None = Field(
        default=None, description="net lift under water: weight of the displaced fluid minus its own; or volume [N]"
    )
    volume: Positive | None = Field(default=None, description="displaced volume; or buoyancy [m^3]")
    mass: NonNegative = Field(default=0.0, description="mass in air, its weight over gravity [kg]")

    def volume_in(self, density: float, gravity: float) -> float:
        return _volume_in(self, density, gravity)

    def _check_one_measure(self) -> Findings:
        return _either(self)


class Weight(Hung):
    """What has a mass and a volume of its own."""

    mass: NonNegative = Field(default=0.0, description="mass in air, its weight over gravity [kg]")
    volume: NonNegative = Field(default=0.0, description="displaced volume, for its buoyancy [m^3]")

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume [m^3], whatever the fluid."""
        return self.volume


class Clump(Weight):
    """A weight at a point of the cable."""

    kind: Literal["clump"] = Field(default="clump", description="weighs on the cable at a point: a sinker, ballast")
    at: NonNegative = Field(description="arc length s, its position on the cable [m]")
    mass: Positive = Field(description="mass in air, its weight over gravity [kg]")


class Swivel(Weight):
    """A joint at a point of the cable that passes force and bending moment, and no torque."""

    kind: Literal["swivel"] = Field(
        default="swivel", description="lets both sides of the cable turn freely against each other about its axis"
    )
    at: Positive = Field(description="arc length s, its position on the cable, between the ends [m]")


class Spread(Table):
    """What lies over a stretch of the cable."""

    range: NonNegativePair = Field(description="[from, to], the arc lengths between which it sits [m]")

    def _check_is_a_stretch(self) -> Findings:
        if self.range[0] >= self.range[1]:
            yield [Finding(("range",), "two arc lengths, the smaller first, in m", "write [from, to]")]


class Modules(Spread):
    """Buoyancy modules, fairings or ballast, spread evenly over a stretch; everything per metre of cable."""

    kind: Literal["modules"] = Field(default="modules", description="spread over a stretch")
    range: NonNegativePair = Field(
        validation_alias=AliasChoices("range", "over"),
        description="[from, to], the arc lengths between which they sit [m]",
    )
    buoyancy: Number | None = Field(
        default=None,
        description="net lift per length: weight of the displaced fluid minus their own; negative for ballast; "
        "or volume [N/m]",
    )
    volume: Positive | None = Field(default=None, description="displaced volume per length; or buoyancy [m^3/m]")
    mass: NonNegative = Field(default=0.0, description="mass per length in air, the weight over gravity [kg/m]")
    drag_area: NonNegative = Field(
        default=0.0, description="normal drag coefficient x frontal area, per length [m^2/m]"
    )
    added_mass: NonNegative = Field(
        default=0.0, description="mass of the fluid that moves with them across the cable, per length [kg/m]"
    )

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume per length [m^3/m] in a fluid of `density` [kg/m^3] under `gravity` [m/s^2]."""
        return _volume_in(self, density, gravity)

    def _check_one_measure(self) -> Findings:
        return _either(self)


StiffnessRow = Annotated[tuple[NonNegative, NonNegative], Field(description="[m from the start of the range, N m^2]")]


class BendStiffener(Spread):
    """A sleeve around the cable that adds bending stiffness, and takes no tension and no torque."""

    kind: Literal["bend_stiffener"] = Field(
        default="bend_stiffener", description="stiffens the cable against bending over a stretch"
    )
    diameters: PositivePair | None = Field(
        default=None, description="outer diameters at both ends of the range, linear between them [m]"
    )
    bore: Positive | None = Field(default=None, description="inner diameter, with diameters [m]")
    modulus: Positive | None = Field(default=None, description="Young's modulus, with diameters [Pa]")
    density: Annotated[Positive, Field(le=25_000)] | None = Field(
        default=None,
        description="density of its material, with diameters, for mass and buoyancy; absent: neither [kg/m^3]",
    )
    added_stiffness: Annotated[tuple[StiffnessRow, ...], Field(min_length=2)] | None = Field(
        default=None,
        description="instead of diameters: rows [arc length from the start of the range, bending stiffness that it "
        "adds], linear between them, over the whole range [m, N m^2]",
    )

    @property
    def mass(self) -> float:
        """Mass per length in air [kg/m], mean over the range."""
        return (self.density or 0.0) * self._mean_area

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume per length [m^3/m], mean over the range, whatever the fluid."""
        return self._mean_area if self.density is not None else 0.0

    @property
    def _mean_area(self) -> float:
        a, b = self.range  # the area is a parabola
        return (self.area(a) + 4.0 * self.area(0.5 * (a + b)) + self.area(b)) / 6.0

    def outer(self, s: float) -> float:
        """Outer diameter [m] at an arc length s [m]; 0 where it is given by its stiffness alone."""
        if self.diameters is None:
            return 0.0
        (a, b), (first, last) = self.range, self.diameters
        return first + (last - first) * (s - a) / (b - a)

    def area(self, s: float) -> float:
        """Cross-section [m^2] of its material at s [m]."""
        return 0.25 * math.pi * (self.outer(s) ** 2 - self.bore**2) if self.bore is not None else 0.0

    def second_moment(self, s: float) -> float:
        """Second moment of area [m^4] of its material at s [m]."""
        return math.pi / 64.0 * (self.outer(s) ** 4 - self.bore**4) if self.bore is not None else 0.0

    def stiffness(self, s: float) -> float:
        """Bending stiffness [N m^2] that it adds at s [m]."""
        if self.added_stiffness is None:
            return (self.modulus or 0.0) * self.second_moment(s)
        x = s - self.range[0]
        for (a, low), (b, high) in pairwise(self.added_stiffness):
            if x <= b:
                return low + (high - low) * (x - a) / (b - a)
        return self.added_stiffness[-1][1]

    def _check_one_description(self) -> Findings:
        cone = {"diameters": "m, at both ends", "bore": "m", "modulus": "Pa"}
        if self.added_stiffness is not None:
            given = [key for key in (*cone, "density") if getattr(self, key) is not None]
            if given:
                why = "nothing, because added_stiffness says how stiff it is"
                yield [Finding((given[0],), why, "leave one of the two out; modules over the same range have mass")]
            length, at = self.range[1] - self.range[0], [x for x, _ in self.added_stiffness]
            if not all(a < b for a, b in pairwise(at)):
                fix = "sort the rows, and leave double ones out"
                yield [Finding(("added_stiffness",), "arc lengths that rise", fix)]
            if at[0] != 0.0 or abs(at[-1] - length) > 1e-9 * self.range[1]:
                expected = f"rows from 0 to {length:.8g} m, the length of the range"
                yield [Finding(("added_stiffness",), expected, "arc lengths are counted from the start of the range")]
            return
        lacks = {key: unit for key, unit in cone.items() if getattr(self, key) is None}
        number = "a number ({}), or added_stiffness"
        missing = [Finding((key,), number.format(unit), f"add `{key}: ...` ({unit})") for key, unit in lacks.items()]
        if missing:
            yield missing
        assert self.diameters is not None and self.bore is not None
        if min(self.diameters) < self.bore:
            expected = f"at least the bore, {self.bore:g} m, at both ends"
            yield [Finding(("diameters",), expected, "give outer diameters, in m")]


def _volume_in(attachment: Float | Modules, density: float, gravity: float) -> float:
    if attachment.buoyancy is None:
        return attachment.volume or 0.0
    return (attachment.buoyancy / gravity + attachment.mass) / density


def _either(attachment: Float | Modules) -> Findings:
    per = "/m" if isinstance(attachment, Modules) else ""
    both = f"buoyancy (N{per}, net) or volume (m^3{per})"
    if attachment.buoyancy is not None and attachment.volume is not None:
        yield [Finding(("volume",), f"either {both}, not both", "leave one of them out")]
    if attachment.buoyancy is None and attachment.volume is None:
        yield [Finding(("buoyancy",), both, f"add `buoyancy: ...` (N{per}), the weight displaced minus its own")]


class BendRestrictor(Spread):
    """Half shells around the cable that lock at a bend radius, and let it bend freely until then."""

    kind: Literal["bend_restrictor"] = Field(
        default="bend_restrictor", description="locks the cable at a bend radius over a stretch"
    )
    radius: Positive = Field(description="bend radius of the axis of the cable at which it locks [m]")
    locked_stiffness: Positive | None = Field(
        default=None,
        description="bending stiffness that it adds once it is locked; absent: a hundred times that of the cable "
        "[N m^2]",
    )


Attachment = Annotated[Float | Clump | Swivel | Modules | BendStiffener | BendRestrictor, Kinds(usual=("float",))]
