"""Contradictions between a line that is paid out and the rest of its scene."""

from __future__ import annotations

from collections.abc import Iterator

from hybrid.scene.base import Finding
from hybrid.scene.cable import Contact, Environment
from hybrid.scene.ends import Clamped, Ends, Pinned
from hybrid.scene.obstacles import Obstacles
from hybrid.scene.payout import Payout


def _winch(ends: Ends) -> tuple[str, Pinned | Clamped, Payout] | None:
    """The end at which line is paid out, by name, and how; the last one of two."""
    found = None
    for name, end in ends.named().items():
        if isinstance(end, Pinned | Clamped) and end.payout is not None:
            found = name, end, end.payout
    return found


def reel_has_diameters(
    environment: Environment, ends: Ends, contact: Contact, obstacles: Obstacles
) -> Iterator[Finding]:
    """Contact of the line with itself and with obstacles, and soil, know the diameters on the reel."""
    found = _winch(ends)
    if found is None:
        return
    name = found[0]
    soil = environment.seabed is not None and environment.seabed.soil is not None
    if contact.self or obstacles or soil:
        apart = "which parts of the cable keep apart (contact.self)"
        how = apart if contact.self else "with which it touches obstacles" if obstacles else "needed for soil"
        for i, section in enumerate(getattr(ends, name).payout.reel or ()):
            if section.diameter is None:
                expected = f"a number > 0, in m, {how}"
                yield Finding(("ends", name, "payout", "reel", i, "diameter"), expected, "add `diameter: ...` (m)")
