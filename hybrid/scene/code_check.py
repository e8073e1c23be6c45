"""Checks of a section by the formulas of codes; they change nothing that is computed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
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


# What a section bears of tension and bending together: the corners of its capacity polygon.

Corners = tuple[tuple[float, float], ...]  # tension (N), curvature (1/m)


def capacity_findings(rows: Corners) -> list[Finding]:
    """What is wrong with the corners of a capacity polygon, from the largest tension round to bending alone.

    Each has to lie further round, as seen from no load, or the part that is used would have two values.
    """
    if len(rows) < 2:
        fix = "give [largest tension, 0], corners, and [0, largest curvature]"
        return [Finding((), "at least two corners [tension, curvature]", fix, f"{len(rows)} corners")]
    for i, (_, k) in enumerate(rows):
        if k < 0.0:
            return [Finding((i, 1), "a curvature >= 0: the same to either side", "leave the other side out")]
    (T, k), (last_T, last_k) = rows[0], rows[-1]
    if not (T > 0.0 and k == 0.0):
        fix = "begin with [largest tension, 0]; tension in N comes first, then curvature in 1/m"
        return [Finding((0,), "the largest tension without bending, [T, 0] with T > 0", fix)]
    if not ((last_T == 0.0 and last_k > 0.0) or (last_T < 0.0 and last_k == 0.0)):
        expected = "the largest curvature without tension, [0, curvature], or the largest compression, [-T, 0]"
        return [Finding((len(rows) - 1,), expected, "end with that corner")]
    for i, ((T, k), (U, m)) in enumerate(pairwise(rows), start=1):
        if not T * m - U * k > 0.0:
            expected = "a corner further round, from tension to bending, as seen from no load"
            return [Finding((i,), expected, "sort the corners")]
    return []
