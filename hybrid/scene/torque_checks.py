"""Contradictions between sections in which tension makes a torque and the rest of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from hybrid.scene.base import Finding
from hybrid.scene.cable import Cable


def shooting_knows_no_torque(cable: Cable, solver: str) -> Iterator[Finding]:
    """Computed by elimination."""
    for i, section in enumerate(cable.sections):
        if section.tension_torque and solver == "shooting":
            expected = "nothing or 0, because shooting knows no torque of tension"
            yield Finding(("cable", "sections", i, "tension_torque"), expected, "leave solver out")
            return
