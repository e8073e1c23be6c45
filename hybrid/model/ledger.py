"""The ledger of a plan: what a scene switches on and who asked, what is off and what would switch it on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi

from hybrid.model.mesh import Zone
from hybrid.model.state import Line
from hybrid.physics.loads import FORCES
from hybrid.scene.schema import Scene

# Mean densities of real cables, kg/m^3, with room: from hollow and foamed to solid heavy metal.
PLAUSIBLE = (50.0, 25_000.0)


@dataclass(frozen=True)
class Entry:
    """A line of the ledger: what, on or off, and who asked (or what would switch it on)."""

    what: str
    on: bool
    why: str
    event: str = ""  # kind of event that a result gets for it: "ignored", "implausible"


def ledger(scene: Scene, line: Line, zones: Sequence[Zone]) -> tuple[Entry, ...]:
    """What is on and who asked for it, what is off and what would switch it on."""
    kinds = {z.kind for z in zones}
    entries = [
        Entry(
            "catenary cells (6th order)",
            "catenary" in kinds,
            "model" if "catenary" in kinds else "no catenary zone in model",
        ),
        Entry(
            "rod cells: bending, torsion (12th order)",
            "rod" in kinds,
            "model" if "rod" in kinds else "no rod zone in model",
        ),
    ]
    joints = sum(a.kind != b.kind for a, b in pairwise(zones))
    entries.append(
        Entry(
            f"spherical joints: {joints}",
            joints > 0,
            "a rod zone meets a catenary zone" if joints else "rod and catenary do not meet",
        )
    )
    extensible = [x.axial_stiffness is not None for x in scene.cable.sections]
    entries.append(Entry("axial compliance", any(extensible), "sections[].axial_stiffness"))
    if "rod" in kinds:
        assumed = [
            i for i, x in enumerate(scene.cable.sections) if x.torsional_stiffness is None and x.bending_stiffness
        ]
        if assumed:
            which = ", ".join(f"sections[{i}]" for i in assumed)
            entries.append(
                Entry(
                    "torsional stiffness = bending stiffness / 1.3",
                    True,
                    f"assumed (solid round section): {which} gives none",
                )
            )
    for i, section in enumerate(scene.cable.sections):
        if section.diameter:
            density = section.mass / (0.25 * pi * section.diameter**2)
            if not PLAUSIBLE[0] <= density <= PLAUSIBLE[1]:
                what = f"sections[{i}] has a mean density of {density:.3g} kg/m^3"
                why = f"mass {section.mass:g} kg/m, diameter {section.diameter:g} m: are both in these units?"
                entries.append(Entry(what, True, why, event="implausible"))
    entries.append(Entry("gravity", scene.environment.gravity != 0, "environment.gravity"))
    entries.append(Entry("buoyancy", scene.environment.fluid is not None, "environment.fluid"))
    entries += [Entry(name, bool(line.bits & bit), needs) for name, (bit, needs) in FORCES.items()]
    for name, end, cell in (("start", scene.ends.start, 0), ("end", scene.ends.end, -1)):
        moving = getattr(end, "motion", None) is not None
        entries.append(Entry(f"ends.{name}: {end.kind}{', moving' if moving else ''}", True, f"ends.{name}"))
        if not line.spin[cell] and (end.kind in ("clamped", "guided") or getattr(end, "moment", None) is not None):
            entries.append(
                Entry(
                    f"moment and tangent at ends.{name}",
                    False,
                    "the cable ends in a catenary zone, which transmits no moment",
                    event="ignored",
                )
            )
    return tuple(entries)
