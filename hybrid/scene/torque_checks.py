"""Contradictions between sections in which tension makes a torque and the rest of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from hybrid.scene.analysis import AdaptiveModel, Model
from hybrid.scene.base import Finding, Place
from hybrid.scene.cable import Cable
from hybrid.scene.ends import Clamped, Ends, Pinned

LEAVE_OUT = "leave it out, for a line that tension does not twist"


def tension_twists(cable: Cable, ends: Ends, model: Model, solver: str) -> Iterator[Finding]:
    """Computed by elimination, of a line of constant length, with axial stiffnesses that are numbers."""
    at: list[Place] = [("cable", "sections", i) for i, x in enumerate(cable.sections) if x.tension_torque]
    for name, end in ends.named().items():
        reel = end.payout.reel if isinstance(end, Pinned | Clamped) and end.payout is not None else None
        at += [("ends", name, "payout", "reel", i) for i, x in enumerate(reel or ()) if x.tension_torque]
    at = [(*place, "tension_torque") for place in at]
    if not at:
        return
    if solver == "shooting":
        yield Finding(at[0], "nothing or 0, because shooting knows no torque of tension", "leave solver out")
    for name, end in ends.named().items():
        if isinstance(end, Pinned | Clamped) and end.payout is not None:
            expected = f"nothing or 0, because line is paid out (ends.{name}.payout) and its twist is not known then"
            yield Finding(at[0], expected, LEAVE_OUT)
    for i, section in enumerate(cable.sections):
        if section.curve:
            key = "dynamic_stiffness" if section.dynamic_stiffness is not None else "tension_strain"
            expected = "axial_stiffness alone, because tension makes a torque in this line (tension_torque)"
            yield Finding(("cable", "sections", i, key), expected, "give axial_stiffness alone")
    if isinstance(model, AdaptiveModel) and model.curvature_error is not None:
        expected = "nothing or 0, because cells follow the curvature (model.curvature_error)"
        yield Finding(at[0], expected, "leave curvature_error out")
