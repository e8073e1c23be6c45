"""Contradictions between a line that is paid out and the rest of its scene."""

from __future__ import annotations

from collections.abc import Iterator

from hybrid.scene.base import Finding
from hybrid.scene.cable import Contact
from hybrid.scene.ends import Clamped, Ends, Pinned
from hybrid.scene.payout import Payout


def _winch(ends: Ends) -> tuple[str, Pinned | Clamped, Payout] | None:
    """The end at which line is paid out, by name, and how; the last one of two."""
    found = None
    for name, end in ends.named().items():
        if isinstance(end, Pinned | Clamped) and end.payout is not None:
            found = name, end, end.payout
    return found


def payout_stands_alone(ends: Ends, contact: Contact) -> Iterator[Finding]:
    """Contact with itself knows the diameters on the reel."""
    found = _winch(ends)
    if found is None:
        return
    name = found[0]
    if contact.self:
        for i, section in enumerate(getattr(ends, name).payout.reel or ()):
            if section.diameter is None:
                expected = "a number > 0, in m, which parts of the cable keep apart (contact.self)"
                yield Finding(("ends", name, "payout", "reel", i, "diameter"), expected, "add `diameter: ...` (m)")
