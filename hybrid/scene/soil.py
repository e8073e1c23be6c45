"""Soil of a seabed that remembers: nonlinear penetration with suction, lateral resistance."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hybrid.scene.base import NonNegative, Positive, Table

# Part of the diameter at which a bearing factor is counted as that of a line at rest, for guesses and lengths of cells.
USUAL = 0.1

Part = Annotated[NonNegative, Field(le=1.0)]


class LateralSoil(Table):
    """Resistance of the soil beside the cable: pu y/ym up to pu, y the elastic travel of friction and ym its most, with
    pu = min(3 su + unit_weight z + wedge su z/D, 9 su) x min(z, D), API's clay on the height that lies in the soil."""

    unit_weight: NonNegative = Field(default=0.0, description="submerged weight of the soil per volume [N/m^3]")
    wedge: NonNegative = Field(default=0.5, description="J, how the resistance grows with the depth, z/D [-]")


class Soil(Table):
    """Clay: penetration, suction and repenetration, each towards its ultimate resistance, of the penetration z of the
    centreline and the diameter D of the cable (Randolph and Quiggin)."""

    shear_strength: Positive = Field(description="undrained shear strength at the bed, without depth [Pa]")
    gradient: NonNegative = Field(default=0.0, description="by how much it grows per metre of depth [Pa/m]")
    bearing: Positive = Field(default=6.0, description="a of the bearing factor a (z/D)^power [-]")
    power: Part = Field(default=0.25, description="its power; below z/D = 0.1 the factor falls as the root of z [-]")
    stiffness: Positive = Field(
        default=200.0,
        description="normalised: with what part of ultimate resistance over diameter each turn of the way begins [-]",
    )
    suction: Part = Field(
        default=0.6, description="ultimate suction, as a part of ultimate resistance; 0: the bed does not hold [-]"
    )
    lateral: LateralSoil | None = Field(
        default=None, description="resistance to the side, beside friction, which says its travel; absent: none"
    )

    @property
    def steepest(self) -> float:
        """Stiffness of unloading USUAL diameters below a bed of one strength [N/m per m]."""
        return self.stiffness * self.bearing * USUAL**self.power * self.shear_strength
