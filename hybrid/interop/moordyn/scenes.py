"""The scene of one cable of a deck, as YAML with the lines of the deck in its comments."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from hybrid.errors import Complaint, SceneError
from hybrid.interop.moordyn.cables import Cable, End
from hybrid.interop.moordyn.deck import Deck, Point
from hybrid.interop.moordyn.rows import LEFT_OUT, TAKEN, Note, in_order, note, show
from hybrid.interop.moordyn.tables import Tables, flow, lines_of
from hybrid.scene.read import parse_scene


@dataclass(frozen=True)
class ImportedScene:
    """A scene: its name (line1, line1+2 of one cable; system of all lines), the IDs of its lines, its text, what is to
    be known."""

    name: str
    lines: tuple[int, ...]
    scene: Any  # of a cable, or of several lines
    text: str
    notes: tuple[Note, ...]


def scene_of(deck: Deck, cable: Cable) -> ImportedScene:
    """SceneError, in lines of the deck, if it makes no scene."""
    made = _Maker(deck, cable)
    text = made.text()
    try:
        scene = parse_scene(text)
    except SceneError as error:
        raise SceneError([_of_deck(cable, c) for c in error.complaints], deck.file) from None
    return ImportedScene(cable.name, cable.ids, scene, text, in_order(made.notes))


def _of_deck(cable: Cable, complaint: Complaint) -> Complaint:
    """A complaint about a scene, as one about the lines that it is made of."""
    where = f"{cable.name}, as a scene: {complaint.where}"
    return replace(complaint, where=where, line=cable.lines[0][0].row.line, column=None)


class _Maker(Tables):
    """Text and notes of one cable."""

    def __init__(self, deck: Deck, cable: Cable) -> None:
        super().__init__(deck, [deck.types[line.type] for line, _ in cable.lines])
        self.cable = cable
        self.lengths = [self._length(line) for line, _ in cable.lines]

    def text(self) -> str:
        name = show(Path(self.deck.file).name) or "deck"
        bends = [kind.ei > 0.0 for kind in self.types]
        parts = [
            f"# From the MoorDyn deck {name}, by `hybrid import`: {self.cable.name}.",
            "# Numbers after # are lines of the deck.  SI units, z up, the still water at z = 0.",
            f"title: {json.dumps(f'{self.cable.name} of {name}')}",
            *self._environment(),
            *self._sections(),
            *self._attachments(),
            *self._ends(),
            "initial: equilibrium",
            *self._model(bends),
            *self._mesh([line for line, _ in self.cable.lines], self.lengths),
            "# A deck gives neither the motion of the ends nor the duration: add ends.*.motion and, for motion,",
            "# time: {duration: 60}",
        ]
        self._differences(bends)
        return "\n".join(parts) + "\n"

    # --- tables --------------------------------------------------------------------------------

    def _sections(self) -> list[str]:
        each = self._sections_of([line for line, _ in self.cable.lines], self.types, (self.cable.start, self.cable.end))
        return ["cable:", "  sections:", *(f"    {section}" for section in each)]

    def _attachments(self) -> list[str]:
        items, s = [], 0.0
        for ((line, back), _), length in zip(pairwise(self.cable.lines), self.lengths, strict=False):
            s += length
            kind, id, _ = line.ends[0 if back else 1]
            if kind == "rod":
                self._rod_joint(self.deck.rods[id])
                continue
            point = self.deck.points[id]
            item = self._hung(point, s)
            if item:
                items.append(f"    - {flow(item)}{lines_of([point.row.line])}")
        return ["  attachments:", *items] if items else []

    def _hung(self, point: Point, s: float) -> dict[str, Any]:
        """What a free point puts on the cable at s."""
        if any(point.force):
            why = "a steady force on a point; hybrid has none in the middle of a cable"
            self.notes.append(note(LEFT_OUT, point.row, why, "make it weight or buoyancy of the clump there"))
        lift = self.options.density * point.volume
        if point.mass == 0.0 and lift == 0.0:
            if point.drag_area and self.wet:
                why = "drag of a point without mass and volume"
                self.notes.append(note(LEFT_OUT, point.row, why, "give the point a mass, in kg"))
            return {}
        kind = "float" if lift > point.mass else "clump"
        return {"kind": kind, "at": s, "mass": point.mass} | self._water(point)

    def _ends(self) -> list[str]:
        parts = ["ends:"]
        for name, end in (("start", self.cable.start), ("end", self.cable.end)):
            bends = self.types[0 if name == "start" else -1].ei > 0.0
            data, line = self._held(end, bends)
            parts.append(f"  {name}: {flow(data)}{lines_of([line])}")
            self.notes += [replace(n, instead=n.instead.replace("{end}", name)) for n in end.notes]
        return parts

    def _held(self, end: End, bends: bool) -> tuple[dict[str, Any], int]:
        """The end as a table, and the line of the deck that gives its place."""
        line = end.line
        if end.point is None:
            if end.along is not None and bends:
                # A rod of MoorDyn holds the direction of a line, and no twist.
                return {"kind": "clamped", "position": end.place, "tangent": end.along, "swivel": True}, line
            return {"kind": "pinned", "position": end.place}, line
        force = end.point.force if any(end.point.force) else None
        water = self._water(end.point)
        if not (end.point.mass or water):
            return {"kind": "free"} | ({"force": force} if force else {}), line
        body: dict[str, Any] = {"kind": "body", "initial_guess": end.place, "mass": end.point.mass}
        other = self.cable.end if end is self.cable.start else self.cable.start
        if math.dist(end.place, other.place) > sum(self.lengths) and other.point is None:
            why = "the deck's first place of this point is out of the line's reach; the scene leaves it to the search"
            self.notes.append(note(TAKEN, end.point.row, why))
            del body["initial_guess"]
        return body | water | ({"thrust": force} if force else {}), line

    def _model(self, bends: Sequence[bool]) -> list[str]:
        if all(bends) or not any(bends):
            return []
        why = "a line without EI is part of the cable, so all of it is computed without bending"
        instead = "give bending_stiffness to every section, and leave model out"
        self.notes.append(Note(TAKEN, None, "", why, instead))
        return ["model: catenary"]
