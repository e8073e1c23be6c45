"""What hangs on the cable or sits in it: floats, clumps and swivels at points, modules over stretches."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import AliasChoices, Discriminator, Field, Tag, model_validator

from hybrid.scene.base import (
    After,
    Finding,
    Kinds,
    NonNegative,
    NonNegativePair,
    Number,
    Positive,
    Table,
    by_kind,
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


class Float(Table):
    """A float at a point of the cable: a mass and a displaced volume, drag and added mass."""

    kind: Literal["float"] = Field(default="float", description="lifts the cable at a point: a buoy")
    at: NonNegative = Field(description="arc length s, its position on the cable [m]")
    buoyancy: Lift | None = Field(
        default=None, description="net lift under water: weight of the displaced fluid minus its own; or volume [N]"
    )
    volume: Positive | None = Field(default=None, description="displaced volume; or buoyancy [m^3]")
    mass: NonNegative = Field(default=0.0, description="mass in air, its weight over gravity [kg]")
    drag_area: NonNegative = Field(default=0.0, description=DRAG_AREA)
    added_mass: NonNegative = Field(default=0.0, description=ADDED_MASS)
    height: Positive | None = Field(default=None, description=HEIGHT)
    shape: Shape = Field(default="sphere", description=SHAPE)

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume [m^3] in a fluid of `density` [kg/m^3] under `gravity` [m/s^2]."""
        return _volume_in(self, density, gravity)

    def height_in(self, density: float, gravity: float) -> float:
        """Vertical extent [m]."""
        return self.height if self.height is not None else sphere_diameter(self.volume_in(density, gravity))

    @model_validator(mode="after")
    def _one_measure(self) -> Float:
        _either(self)
        return self


class Clump(Table):
    """A weight at a point of the cable."""

    kind: Literal["clump"] = Field(default="clump", description="weighs on the cable at a point: a sinker, ballast")
    at: NonNegative = Field(description="arc length s, its position on the cable [m]")
    mass: Positive = Field(description="mass in air, its weight over gravity [kg]")
    volume: NonNegative = Field(default=0.0, description="displaced volume, for its buoyancy [m^3]")
    drag_area: NonNegative = Field(default=0.0, description=DRAG_AREA)
    added_mass: NonNegative = Field(default=0.0, description=ADDED_MASS)
    height: Positive | None = Field(default=None, description=HEIGHT)
    shape: Shape = Field(default="sphere", description=SHAPE)

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume [m^3], whatever the fluid."""
        return self.volume

    def height_in(self, density: float, gravity: float) -> float:
        """Vertical extent [m]."""
        return self.height if self.height is not None else sphere_diameter(self.volume)


class Swivel(Table):
    """A joint at a point of the cable that passes force and bending moment, and no torque."""

    kind: Literal["swivel"] = Field(
        default="swivel", description="lets both sides of the cable turn freely against each other about its axis"
    )
    at: Positive = Field(description="arc length s, its position on the cable, between the ends [m]")
    mass: NonNegative = Field(default=0.0, description="mass in air, its weight over gravity [kg]")
    volume: NonNegative = Field(default=0.0, description="displaced volume, for its buoyancy [m^3]")
    drag_area: NonNegative = Field(default=0.0, description=DRAG_AREA)
    added_mass: NonNegative = Field(default=0.0, description=ADDED_MASS)
    height: Positive | None = Field(default=None, description=HEIGHT)
    shape: Shape = Field(default="sphere", description=SHAPE)

    def volume_in(self, density: float, gravity: float) -> float:
        """Displaced volume [m^3], whatever the fluid."""
        return self.volume

    def height_in(self, density: float, gravity: float) -> float:
        """Vertical extent [m]."""
        return self.height if self.height is not None else sphere_diameter(self.volume)


class Modules(Table):
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

    @model_validator(mode="after")
    def _one_measure_and_a_stretch(self) -> Modules:
        _either(self)
        if self.range[0] >= self.range[1]:
            refuse([Finding(("range",), "two arc lengths, the smaller first, in m", "write [from, to]")])
        return self


def _volume_in(attachment: Float | Modules, density: float, gravity: float) -> float:
    if attachment.buoyancy is None:
        return attachment.volume or 0.0
    return (attachment.buoyancy / gravity + attachment.mass) / density


def _either(attachment: Float | Modules) -> None:
    per = "/m" if isinstance(attachment, Modules) else ""
    both = f"buoyancy (N{per}, net) or volume (m^3{per})"
    if attachment.buoyancy is not None and attachment.volume is not None:
        refuse([Finding(("volume",), f"either {both}, not both", "leave one of them out")])
    if attachment.buoyancy is None and attachment.volume is None:
        refuse([Finding(("buoyancy",), both, f"add `buoyancy: ...` (N{per}), the weight displaced minus its own")])


Attachment = Annotated[
    Annotated[Float, Tag("<float>")]
    | Annotated[Clump, Tag("<clump>")]
    | Annotated[Swivel, Tag("<swivel>")]
    | Annotated[Modules, Tag("<modules>")],
    Discriminator(by_kind),
    Kinds(("float", "clump", "swivel", "modules"), usual=("float",)),
]
