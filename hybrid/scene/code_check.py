"""Checks of a section by the formulas of codes; they change nothing that is computed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from hybrid.scene.base import Finding, Kinds, NonNegative, Positive, Table, by_kind

# Factors of safety classes of DNV-OS-F201.
SAFETY_CLASSES = {"low": 1.04, "normal": 1.14, "high": 1.26}


class MooringCode(Table):
    """A mooring line by DNV-OS-E301 (July 2021), Ch.2 Sec.2: (pretension x its factor + the rest x its)/strength."""

    kind: Literal["E301"] = Field(description="DNV-OS-E301, position mooring")
    strength: Positive = Field(description="characteristic strength of the line [N]")
    pretension_factor: Positive = Field(
        description="factor of the pretension, by class and limit state: no usual one [-]"
    )
    environment_factor: Positive = Field(description="factor of the rest of the tension [-]")
    pretension: NonNegative = Field(
        default=0.0, description="smallest tension of the section at rest without current and waves; 0: none counts [N]"
    )

    def findings(self) -> Iterator[Finding]:
        """Numbers that do not fit each other."""
        yield from _factors("pretension_factor", self.pretension_factor, self.environment_factor)
        if self.pretension >= self.strength:
            expected = f"less than the strength, {self.strength:g} N"
            yield Finding(("pretension",), expected, "check both; they are in N", f"{self.pretension:g}")


class RiserCode(Table):
    """A riser pipe by DNV-OS-F201 (October 2010), Sec.5 D: bending, tension and pressure together; needs `pipe`."""

    kind: Literal["F201"] = Field(description="DNV-OS-F201, dynamic risers")
    yield_strength: Positive = Field(description="characteristic yield stress fy of the wall [Pa]")
    tensile_strength: Positive = Field(description="characteristic tensile strength fu of the wall [Pa]")
    safety_class: Literal["low", "normal", "high"] = Field(
        default="normal", description="safety class: factors 1.04, 1.14, 1.26"
    )
    material_factor: Positive = Field(default=1.15, description="material factor [-]")
    functional_factor: Positive = Field(default=1.1, description="factor of functional tension and moment [-]")
    environment_factor: Positive = Field(default=1.3, description="factor of the rest of tension and moment [-]")
    functional_tension: NonNegative = Field(
        default=0.0, description="smallest tension of the section at rest without current and waves; 0: none counts [N]"
    )
    functional_moment: NonNegative = Field(default=0.0, description="smallest bending moment there, likewise [N m]")
    ovality: Positive = Field(default=0.005, description="(largest - smallest diameter)/diameter f0, for collapse [-]")
    fabrication: Positive = Field(
        default=0.85, description="fabrication factor, for collapse; 0.85: UOE pipe, 1: seamless [-]"
    )

    def findings(self) -> Iterator[Finding]:
        """Numbers that do not fit each other."""
        yield from _factors("functional_factor", self.functional_factor, self.environment_factor)
        if self.tensile_strength < self.yield_strength:
            expected = f"at least yield_strength, {self.yield_strength:g} Pa"
            yield Finding(("tensile_strength",), expected, "are the two exchanged?")

    @property
    def safety(self) -> float:
        """Product of the factors of safety class and material."""
        return SAFETY_CLASSES[self.safety_class] * self.material_factor


def _factors(first: str, factor: float, environment: float) -> Iterator[Finding]:
    """What is known best has the smaller factor: else to leave it at 0 were not on the safe side."""
    if environment < factor:
        expected = f"at least {first}, {factor:g}"
        yield Finding(("environment_factor",), expected, "are the two exchanged?", f"{environment:g}")


Code = Annotated[
    Annotated[MooringCode, Tag("<E301>")] | Annotated[RiserCode, Tag("<F201>")],
    Discriminator(by_kind),
    Kinds(("E301", "F201"), usual=("E301",)),
]
