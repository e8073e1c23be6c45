"""The criteria by which zones move: what each weighs, and where it lets go.

Every criterion is a ratio, what is there over what a catenary can stand: at 1 a stretch becomes a
rod, and below the criterion's `off` it may become a catenary again.  Errors of position that leaving
bending out would make are lengths, and count against the tolerance (m) of the scene.
"""

from __future__ import annotations

from dataclasses import dataclass

BEND, SLACK, CLAMP, POINT, EDGE, TORSION, GIVEN, CONTACT = range(8)


@dataclass(frozen=True)
class Criterion:
    """A criterion: name, the ratio that it is (in words), and the part of 1 below which it lets go."""

    name: str
    ratio: str
    off: float


CRITERIA: tuple[Criterion, ...] = (
    Criterion("bend", "bending length EI kappa/T over the tolerance", 0.25),
    Criterion("slack", "tension floor over tension, now or as it will be a horizon ahead", 0.5),
    Criterion("clamp", "lambda times the angle at a clamp, or moment at an end over T, over the tolerance", 0.25),
    Criterion(
        "point", "lambda times half the kink at a point load, a step of section or a joint, over the tolerance", 0.25
    ),
    Criterion("edge", "EI w/(2 T^2) where contact with the seabed begins, over the tolerance", 0.25),
    Criterion("torsion", "torque^2/(4 EI T) over a half, or torque x turn of the line/(2 T) over the tolerance", 0.25),
    Criterion("given", "what the scene or a function of the user asks for", 0.5),
    Criterion("contact", "two diameters over the distance of the line to itself, now or as it will be", 0.5),
)
