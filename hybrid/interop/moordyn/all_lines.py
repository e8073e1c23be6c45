"""The scene of all lines of a deck, as YAML with the lines of the deck in its comments: points, and lines between them.

MoorDyn                              hybrid                because
Fixed, Coupled points                fixed points          held; a deck does not say how a vessel moves
Free points; M, V, CdA, Ca rho V     free points           as they are; initial_guess is their place in the deck
points and rods on bodies            fairleads             bodies as in tables.py
points on a Free body, all at its    one free point        the body's moments of inertia then do nothing
reference point, its centre there
free rods without length             sections of one line  the rod hands on the moment of one line to the other
other ends of rods                   fixed points          lines turn freely at points
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from hybrid.errors import Complaint, SceneError
from hybrid.interop.moordyn.deck import Body, Deck, Line, LineType, Point
from hybrid.interop.moordyn.rows import LEFT_OUT, TAKEN, Note, Row, in_order, note, number, show
from hybrid.interop.moordyn.tables import (
    NEAR,
    Cable,
    End,
    Tables,
    body_table,
    chain_of,
    end_of,
    flow,
    held_loads,
    lines_of,
    next_line,
)
from hybrid.scene.ends import Triple
from hybrid.scene.read import parse_scene, read_text

# Two lines are one only where a rod without length joins them: points are points.
JOINTS = ("rod",)
_APART = "; or --separate, for each cable that can be as a scene of its own"


def scene_of_lines(deck: Deck) -> ImportedScene:
    """All lines of a deck as one scene; SceneError, in lines of the deck, if it makes none."""
    made = _SceneMaker(deck)
    text = made.text()
    if made.complaints:
        raise SceneError(sorted(dict.fromkeys(made.complaints), key=lambda c: c.line or 0), deck.file)
    try:
        scene, _ = read_text(text)
    except SceneError as error:
        raise SceneError([made.of_deck(c) for c in error.complaints], deck.file) from None
    return ImportedScene("system", tuple(sorted(deck.lines)), scene, text, in_order(made.notes))


class _SceneMaker(Tables):
    """Text, notes and complaints of all lines of a deck."""

    def __init__(self, deck: Deck) -> None:
        super().__init__(deck, [deck.types[line.type] for line in deck.lines.values()])
        self.points: dict[str, tuple[dict[str, Any], Row]] = {}  # by name, with its row
        self.bodies: dict[str, tuple[dict[str, Any], Row]] = {}
        self.chains: dict[str, list[tuple[Line, bool]]] = {}
        self.complaints: list[Complaint] = []

    def text(self) -> str:
        name = show(Path(self.deck.file).name) or "deck"
        lines = self._lines()
        points = [f"  {key}: {flow(data)}{lines_of([row.line])}" for key, (data, row) in self.points.items()]
        bodies = [f"  {key}: {flow(data)}{lines_of([row.line])}" for key, (data, row) in self.bodies.items()]
        bends = [kind.ei > 0.0 for kind in self.types]
        parts = [
            f"# From the MoorDyn deck {name}, by `hybrid import`.",
            "# Numbers after # are lines of the deck.  SI units, z up, the still water at z = 0.",
            f"title: {json.dumps(name)}",
            *self._environment(),
            "points:",
            *points,
            *(["bodies:", *bodies] if bodies else []),
            "lines:",
            *lines,
            "# A deck gives neither the motion of the points nor the duration: add points.*.motion and, for motion,",
            "# time: {duration: 60, step: 0.05}",
        ]
        self._differences(bends)
        return "\n".join(parts) + "\n"

    def of_deck(self, complaint: Complaint) -> Complaint:
        """A complaint about the scene, as one about the row of the deck that it is of."""
        line = min(x.row.line for x in self.deck.lines.values())
        for kind, name in re.findall(r"(points|bodies|lines)\.([\w+]+)", complaint.where):
            if kind == "points" and name in self.points:
                line = self.points[name][1].line
            elif kind == "bodies" and name in self.bodies:
                line = self.bodies[name][1].line
            elif kind == "lines" and name in self.chains:
                line = self.chains[name][0][0].row.line
        return replace(complaint, where=f"as a scene: {complaint.where}", line=line, column=None)

    def _at_the_bed(self) -> Sequence[LineType]:
        depth = self.options.depth or 0.0
        found = []
        for line in self.deck.lines.values():
            low = min(end_of(self.deck, end).place[2] for end in line.ends)
            found += [self.deck.types[line.type]] if low < -(1.0 - NEAR) * depth else []
        return found or self.types

    # --- lines ---------------------------------------------------------------------------------

    def _lines(self) -> list[str]:
        parts: list[str] = []
        done: set[int] = set()
        for id in sorted(self.deck.lines):
            if id in done:
                continue
            chain = chain_of(self.deck, id, JOINTS)
            done |= {line.id for line, _ in chain}
            name = "line" + "+".join(str(line.id) for line, _ in chain)
            self.chains[name] = chain
            parts += self._line(name, chain)
        return parts

    def _line(self, name: str, chain: Sequence[tuple[Line, bool]]) -> list[str]:
        lines = [line for line, _ in chain]
        types = [self.deck.types[line.type] for line in lines]
        for line in lines:
            why, instead = self.deck.trouble(line)
            if why:
                self._refuse(line.row, why, instead)
        (first, back), (last, last_back) = chain[0], chain[-1]
        if next_line(self.deck, first, 1 if back else 0, JOINTS) is not None:
            for line in lines:
                self._refuse(line.row, "it closes a ring of free rods; a line has two ends", "make one of them Fixed")
        bends = [kind.ei > 0.0 for kind in types]
        ends = {"start": first.ends[1 if back else 0], "end": last.ends[0 if last_back else 1]}
        start, end = (self._point(each, all(bends)) for each in ends.values())
        lengths = [self._length(line) for line in lines]
        for line, turned in chain[:-1]:
            self._rod_joint(self.deck.rods[line.ends[0 if turned else 1][1]])
        places = end_of(self.deck, ends["start"]), end_of(self.deck, ends["end"])
        parts = [f"  {name}:", f"    start: {start}", f"    end: {end}"]
        clamps = {key: self._clamp(each, key == "start") for key, each in ends.items() if all(bends)}
        if held := {key: {"tangent": x, "swivel": True} for key, x in clamps.items() if x is not None}:
            parts.append(f"    connections: {flow(held)}")
        parts.append("    sections:")
        parts += [f"      {section}" for section in self._sections_of(lines, types, places)]
        if any(bends) and not all(bends):
            why = f"{name}: a section without EI is part of it, so all of it is computed without bending"
            self.notes.append(Note(TAKEN, None, "", why, "give bending_stiffness to every section"))
        return parts + [f"    {row}" for row in self._mesh(lines, lengths)]

    def _refuse(self, row: Row, why: str, instead: str) -> None:
        fix = (instead or "leave it out of a copy of the deck") + _APART
        expected = f"a line that can be carried over; {why}"
        self.complaints.append(Complaint("left out", row.shown, expected, fix, row.line))

    # --- points --------------------------------------------------------------------------------

    def _point(self, end: tuple[str, int, str], bends: bool) -> str:
        """Name of the point at the end of a line; it is made at the first."""
        kind, id, letter = end
        row = self.deck.points[id].row if kind == "point" else self.deck.rods[id].row
        body = self._free_body(kind, id)
        name = f"body{body.id}" if body is not None else f"{kind}{id}{letter}"
        if name not in self.points:
            self.points[name] = ({}, row)  # in the order of the lines
            self.points[name] = (self._body_point(body) if body is not None else self._deck_point(end, name, row), row)
        if bends and kind == "rod" and self._clamp(end, True) is not None:
            why = "the rod holds the direction of a line that bends, which is clamped there and spins freely"
            self.notes.append(note(TAKEN, row, why))
        return name

    def _clamp(self, end: tuple[str, int, str], starts: bool) -> Triple | None:
        """Direction of increasing s in which a rod holds an end of a line.

        In axes of the rod's body, or inertial; None: no rod whose direction is prescribed.  starts: the line starts
        there.
        """
        kind, id, letter = end
        rod = self.deck.rods.get(id) if kind == "rod" else None
        if rod is None or rod.kind not in ("fixed", "coupled", "body"):
            return None
        out = [b - a for a, b in zip(rod.a, rod.b, strict=True)]
        size = math.hypot(*out) * (1.0 if (letter == "A") != starts else -1.0)
        return (out[0] / size, out[1] / size, out[2] / size) if size else None

    def _deck_point(self, end: tuple[str, int, str], name: str, row: Row) -> dict[str, Any]:
        kind, id, _ = end
        thing = self.deck.points[id] if kind == "point" else self.deck.rods[id]
        if isinstance(thing, Point) and thing.kind == "free":
            return self._free(thing)
        if thing.kind == "body":
            return self._fairlead(self.deck.bodies[thing.on], end)
        held = end_of(self.deck, end)
        if held.lost is not None:
            self._refuse(row, f"{held.lost.text}: {held.lost.why}", held.lost.instead)
        else:
            self.notes += [replace(n, instead=n.instead.replace("ends.{end}", f"points.{name}")) for n in held.notes]
        return {"position": held.place}

    def _fairlead(self, body: Body, end: tuple[str, int, str]) -> dict[str, Any]:
        kind, id, letter = end
        name = f"body{body.id}"
        if name not in self.bodies:
            self.bodies[name] = (self._body(body, name), body.row)
        if kind == "point":
            return {"kind": "fairlead", "body": name, "place": self.deck.points[id].place}
        rod = self.deck.rods[id]
        return {"kind": "fairlead", "body": name, "place": rod.a if letter == "A" or rod.segments == 0 else rod.b}

    def _body(self, body: Body, name: str) -> dict[str, Any]:
        parts = self._parts(body)
        made = body_table(body, self.options.density, parts)
        if isinstance(made, str) or (body.kind == "free" and any(rod.on == body.id for rod in self.deck.rods.values())):
            why = made if isinstance(made, str) else "a free rigid body with rods, whose mass and drag it has"
            self._refuse(body.row, why, "write Fixed or Coupled and its place at rest")
            return {}
        found, notes = made
        self.notes += [held_loads(point) for point in parts if body.kind != "free"]
        if body.kind == "coupled":
            why = "the calling program of MoorDyn moves this body; a deck does not say how, and the scene holds it"
            instead = f"give bodies.{name}.motion: harmonics, a file, or a vessel with its RAOs"
            self.notes.append(note(TAKEN, body.row, why, instead))
        self.notes += notes
        return found

    def _parts(self, body: Body) -> list[Point]:
        """The points on a body that have a weight, a lift or a drag of their own."""
        return [p for p in self.deck.points.values() if p.kind == "body" and p.on == body.id and p.has_loads]

    def _free(self, point: Point) -> dict[str, Any]:
        found: dict[str, Any] = {"initial_guess": point.place}
        if point.mass:
            found["mass"] = point.mass
        found |= self._water(point)
        return found | ({"force": point.force} if any(point.force) else {})

    def _free_body(self, kind: str, id: int) -> Body | None:
        """The free body that is no more than a point: all that is on it is at its centre."""
        point = self.deck.points[id] if kind == "point" else None
        body = self.deck.bodies.get(point.on) if point is not None and point.kind == "body" else None
        if body is None or body.kind != "free" or any(number(x) != 0.0 for x in body.rest[1].split("|")):
            return None
        there = [p.place for p in self.deck.points.values() if p.kind == "body" and p.on == body.id]
        if any(any(place) for place in there) or any(rod.on == body.id for rod in self.deck.rods.values()):
            return None
        return body if all(number(self._first(body, i)) is not None for i in (0, 3, 4, 5)) else None

    def _first(self, body: Body, i: int) -> str:
        return body.rest[i].split("|")[0]

    def _body_point(self, body: Body) -> dict[str, Any]:
        mass, volume, area, added = (float(number(self._first(body, i)) or 0.0) for i in (0, 3, 4, 5))
        why = "everything on this body is at its centre: it is a point of its mass, volume, drag and added mass"
        if any("|" in body.rest[i] for i in (4, 5)):
            why += "; of several coefficients the first is taken, for all directions"
        self.notes.append(note(TAKEN, body.row, why))
        displaced = volume * added
        for point in self._parts(body):
            mass, volume, area = mass + point.mass, volume + point.volume, area + point.drag_area
            displaced += point.volume * point.added
        added = displaced / volume if volume else 0.0
        return self._free(Point(body.id, body.row, "free", 0, body.place, mass, volume, area, added))


# The scene of one cable of a deck, as YAML with the lines of the deck in its comments.


@dataclass(frozen=True)
class ImportedScene:
    """A scene that was read from a deck, with the text of its file.

    name: line1, or line1+2, of one cable; "network" of all lines.  lines: their IDs in the deck.
    """

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
        line, where = cable.lines[0][0].row.line, f"{cable.name}, as a scene"
        found = [replace(c, where=f"{where}: {c.where}", line=line, column=None) for c in error.complaints]
        raise SceneError(found, deck.file) from None
    return ImportedScene(cable.name, cable.ids, scene, text, in_order(made.notes))


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
