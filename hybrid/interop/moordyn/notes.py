"""Notes on a deck beside the scenes made of it."""

from __future__ import annotations

from dataclasses import dataclass

from hybrid.interop.moordyn.rows import Row

# Kinds of notes, the weightiest first.
LEFT_OUT = "left out"  # it acts in MoorDyn, and not in the scene
TAKEN = "taken as"  # it acts in the scene in another way than in the deck
DIFFERS = "differs"  # the programs differ whatever the deck gives
NOT_NEEDED = "not needed"  # a setting of MoorDyn's own method
KINDS = (LEFT_OUT, TAKEN, DIFFERS, NOT_NEEDED)


@dataclass(frozen=True)
class Note:
    """What could not be carried over as it stands.

    line: of the deck, from 1; None if it is about no line.  text: as it stands there.  instead: what to do.
    """

    kind: str
    line: int | None
    text: str
    why: str
    instead: str = ""

    def text_in(self, file: str) -> str:
        """The note as errors are written: place and text, then why and what to do."""
        place = f"{file}:{self.line}" if self.line is not None else file
        lines = [f"{place}: {self.kind}{': ' + self.text if self.text else ''}", f"    detail:   {self.why}"]
        if self.instead:
            lines.append(f"    try:      {self.instead}")
        return "\n".join(lines)


def note(kind: str, row: Row, why: str, instead: str = "") -> Note:
    return Note(kind, row.line, row.shown, why, instead)


def in_order(notes: list[Note]) -> tuple[Note, ...]:
    """Every note once; by weight, then by line."""
    return tuple(sorted(dict.fromkeys(notes), key=lambda n: (KINDS.index(n.kind), n.line is None, n.line or 0)))
