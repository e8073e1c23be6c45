"""The scene of one cable of a deck, as YAML with the lines of the deck in its comments.

MoorDyn                      hybrid                         because
Cd, CdAx                     drag.normal, .tangential       both on d and on pi d
Ca, CaAx                     added_mass.normal, .tangential both on the displaced mass
BA >= 0                      damping.stiffness = BA/EA      tension BA x rate of strain
BA < 0                       -BA l sqrt(m/EA), l a segment  BA is then a part of the critical damping of a segment
kBot, cBot                   seabed.stiffness = kBot d ...  pressures on the width of the line
point's M, V, CdA, Ca rho V  clump, float or body           as they are
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from hybrid.errors import Complaint, SceneError
from hybrid.interop.moordyn.cables import Cable, End, between
from hybrid.interop.moordyn.deck import Deck, Line, Point
from hybrid.interop.moordyn.notes import DIFFERS, LEFT_OUT, TAKEN, Note, in_order, note
from hybrid.interop.moordyn.rows import show
from hybrid.interop.moordyn.types import LineType
from hybrid.scene.attachments import sphere_diameter
from hybrid.scene.read import parse_scene
from hybrid.scene.schema import Scene

# Segments whose lengths differ by less are equal: lengths are written with six digits.
SAME_SEGMENT = 1e-6


@dataclass(frozen=True)
class ImportedScene:
    """A cable of a deck: its name (line1, line1+2), the IDs of its lines, the scene, its text, what is to be known."""

    name: str
    lines: tuple[int, ...]
    scene: Scene
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


class _Maker:
    """Text and notes of one cable."""

    def __init__(self, deck: Deck, cable: Cable) -> None:
        self.deck, self.cable, self.options = deck, cable, deck.options
        self.notes: list[Note] = []
        self.lengths = [self._length(line) for line, _ in cable.lines]
        self.types = [deck.types[line.type] for line, _ in cable.lines]
        self.wet = self.options.density > 0.0

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
            *self._mesh(),
            "# A deck gives neither the motion of the ends nor the duration: add ends.*.motion and, for motion,",
            "# time: {duration: 60}",
        ]
        self._differences(bends)
        return "\n".join(parts) + "\n"

    # --- tables --------------------------------------------------------------------------------

    def _environment(self) -> list[str]:
        options = self.options
        parts = [
            "environment:",
            f"  gravity: {_number(options.gravity)}{self._origin('gravity', 'default of MoorDyn')}",
        ]
        if self.wet:
            origin = self._origin("density", "default of MoorDyn")
            parts.append(f"  fluid: {{density: {_number(options.density)}, surface: 0.0}}{origin}")
        bed = self._bed()
        return parts + ([bed] if bed else [])

    def _bed(self) -> str:
        options, width = self.options, self._width()
        if options.bed_stiffness == 0.0:
            row = options.rows["bed_stiffness"]
            self.notes.append(note(TAKEN, row, "a bed without stiffness does nothing; the scene has none"))
            return ""
        z = self._bottom()
        bed: dict[str, Any] = {"z": z, "stiffness": options.bed_stiffness * width}
        if options.bed_damping:
            bed["damping"] = options.bed_damping * width
        along, across = (x or options.friction for x in (options.friction_along, options.friction_across))
        if along or across:
            bed["friction"] = {"axial": along, "lateral": across}
        places = [options.rows[key].line for key in ("depth", "bed_stiffness", "bed_damping") if key in options.rows]
        return f"  seabed: {_flow(bed)}{_lines(places)}"

    def _width(self) -> float:
        """Diameter that bears on the bed, m: one bed has one stiffness per length, MoorDyn's follows the diameter."""
        widths = sorted({kind.diameter for kind in self.types})
        if len(widths) > 1 and self.options.bed_stiffness:
            why = f"kBot and cBot act on the diameter; the bed gets those of the thickest line, {widths[-1]:g} m"
            instead = "set environment.seabed.stiffness to kBot x the diameter of what lies on the bed"
            self.notes.append(Note(TAKEN, None, "", why, instead))
        return widths[-1]

    def _bottom(self) -> float:
        depth = self.options.depth
        lowest = min(
            (p.place[2] for p in self.deck.points.values() if p.kind in ("fixed", "coupled", "free")), default=0.0
        )
        if depth is None or depth == 0.0:
            why = f"without a depth the bed lies at the lowest point of the deck, z = {lowest:g} m, as in MoorDyn"
            self.notes.append(Note(TAKEN, None, "", why, "set environment.seabed.z if it is deeper"))
            return min(lowest, 0.0)
        return -depth

    def _sections(self) -> list[str]:
        parts = ["cable:", "  sections:"]
        for (line, _), kind, length in zip(self.cable.lines, self.types, self.lengths, strict=True):
            section: dict[str, Any] = {
                "length": length, "mass": kind.mass, "diameter": kind.diameter, "axial_stiffness": kind.ea,
            }  # fmt: skip
            if kind.ei:
                section["bending_stiffness"] = kind.ei
            if self.wet and any(kind.drag):
                section["drag"] = dict(zip(("normal", "tangential"), kind.drag, strict=True))
            if self.wet and any(kind.added):
                section["added_mass"] = dict(zip(("normal", "tangential"), kind.added, strict=True))
            tau = self._tau(kind, line, length)
            if tau:
                section["damping"] = {"stiffness": tau}
            parts.append(f"    - {_flow(section)}{_lines([line.row.line, kind.row.line])}")
        return parts

    def _tau(self, kind: LineType, line: Line, length: float) -> float:
        """Damping time of stretch, s: BA/EA."""
        if kind.ba >= 0.0:
            return kind.ba / kind.ea
        segment = length / line.segments
        ba = -kind.ba * segment * math.sqrt(kind.ea * kind.mass)
        why = (
            f"BA is {-kind.ba:g} of the critical damping of one segment of {segment:.4g} m: {ba:.4g} N s, "
            "which is less the more segments there are"
        )
        instead = "leave damping out of the section: hybrid needs none to be stable"
        self.notes.append(note(TAKEN, kind.row, why, instead))
        return ba / kind.ea

    def _attachments(self) -> list[str]:
        items, s = [], 0.0
        for ((line, back), _), length in zip(pairwise(self.cable.lines), self.lengths, strict=False):
            s += length
            point = self.deck.points[line.ends[0 if back else 1][1]]
            item = self._hung(point, s)
            if item:
                items.append(f"    - {_flow(item)}{_lines([point.row.line])}")
        return ["  attachments:", *items] if items else []

    def _hung(self, point: Point, s: float) -> dict[str, Any]:
        """What a free point puts on the cable at s."""
        lift = self.options.density * point.volume
        if point.mass == 0.0 and lift == 0.0:
            if point.drag_area and self.wet:
                why = "drag of a point without mass and volume"
                self.notes.append(note(LEFT_OUT, point.row, why, "give the point a mass, in kg"))
            return {}
        kind = "float" if lift > point.mass else "clump"
        return {"kind": kind, "at": s, "mass": point.mass} | self._water(point)

    def _water(self, point: Point) -> dict[str, float]:
        """Volume, drag and added mass of a point in water."""
        if not self.wet:
            return {}
        added = point.added * self.options.density * point.volume
        if point.volume and point.place[2] > -sphere_diameter(point.volume):
            why = "MoorDyn lifts a point by its volume above the surface as well; hybrid only where it is wet"
            self.notes.append(note(DIFFERS, point.row, why))
        found = {"volume": point.volume, "drag_area": point.drag_area, "added_mass": added}
        return {key: value for key, value in found.items() if value}

    def _ends(self) -> list[str]:
        parts = ["ends:"]
        for name, end in (("start", self.cable.start), ("end", self.cable.end)):
            bends = self.types[0 if name == "start" else -1].ei > 0.0
            data, line = self._held(end, bends)
            parts.append(f"  {name}: {_flow(data)}{_lines([line])}")
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
        if end.point.mass == 0.0:
            return {"kind": "free"}, line
        body: dict[str, Any] = {"kind": "body", "initial_guess": end.place, "mass": end.point.mass}
        other = self.cable.end if end is self.cable.start else self.cable.start
        if math.dist(end.place, other.place) > sum(self.lengths) and other.point is None:
            why = "the deck's first place of this point is out of the line's reach; the scene leaves it to the search"
            self.notes.append(note(TAKEN, end.point.row, why))
            del body["initial_guess"]
        return body | self._water(end.point), line

    def _model(self, bends: Sequence[bool]) -> list[str]:
        if all(bends):
            return []
        if any(bends):
            why = "a line without EI is part of the cable, so all of it is computed without bending"
            instead = "give bending_stiffness to every section, and leave model out"
            self.notes.append(Note(TAKEN, None, "", why, instead))
        return ["model: catenary"]

    def _mesh(self) -> list[str]:
        counts = [line.segments for line, _ in self.cable.lines]
        cells = [length / n for length, n in zip(self.lengths, counts, strict=True)]
        origin = _lines([line.row.line for line, _ in self.cable.lines])
        why = "  # NumSegs; leave mesh out and cells are placed where the cable bends" + origin.replace("  #", ";")
        if sum(counts) == 1:
            row = self.cable.lines[0][0].row
            self.notes.append(note(TAKEN, row, "one segment is no mesh; the scene has two cells"))
            return [f"mesh: {{cells: 2}}{why}"]
        if max(cells) - min(cells) <= SAME_SEGMENT * max(cells):
            return [f"mesh: {{cells: {sum(counts)}}}{why}"]
        nodes, s = [0.0], 0.0
        for length, n in zip(self.lengths, counts, strict=True):
            nodes += [s + length * k / n for k in range(1, n + 1)]
            s += length
        return [f"mesh:{why}", f"  nodes: {_flow(nodes)}"]

    # --- the rest ------------------------------------------------------------------------------

    def _length(self, line: Line) -> float:
        return line.length if line.length > 0.0 else -line.length * between(self.deck, line)

    def _differences(self, bends: Sequence[bool]) -> None:
        """What the programs do differently with this cable."""
        found = [
            (
                "MoorDyn lumps mass at nodes and takes segments as straight springs; hybrid's cells converge to the "
                "continuous cable, and MoorDyn with more segments to the same",
                "",
            )
        ]
        if not all(bends):
            why = "without EI the cable is a catenary, which stops where tension vanishes; MoorDyn's goes on, crumpled"
            found.append((why, "if it does, give bending_stiffness (small for a chain), and leave model out"))
        if any(bends):
            why = "MoorDyn has no torsion; hybrid's rods have GJ = EI/1.3 where torsional_stiffness is left out"
            found.append((why, "with both ends free to turn it does nothing"))
        if any(kind.ba for kind in self.types) and any(bends):
            why = "MoorDyn damps stretch (BA); damping.stiffness of hybrid damps bending and twist by the same time"
            found.append((why, ""))
        if self.options.bed_stiffness and self.options.bed_damping:
            why = "MoorDyn's bed damps on the way up as well and can hold a line down; hybrid's never pulls"
            found.append((why, ""))
        friction = self.options.friction or self.options.friction_along or self.options.friction_across
        if friction:
            why = "MoorDyn's friction fades with the speed and holds nothing at rest; hybrid's holds"
            found.append((why, ""))
        self.notes += [Note(DIFFERS, None, "", why, instead) for why, instead in found]

    def _origin(self, key: str, otherwise: str) -> str:
        row = self.options.rows.get(key)
        return _lines([row.line]) if row is not None else f"  # {otherwise}"


def _lines(lines: Iterable[int]) -> str:
    """A comment that names lines of the deck."""
    named = ", ".join(str(line) for line in dict.fromkeys(lines))
    return f"  # {named}" if named else ""


def _number(x: float) -> str:
    return f"{x:.12g}"  # products of a deck's numbers carry round-off that nobody wants to read


def _flow(data: Any) -> str:
    """A table, list or scalar on one line of YAML."""
    if isinstance(data, dict):
        return "{" + ", ".join(f"{key}: {_flow(value)}" for key, value in data.items()) + "}"
    if isinstance(data, tuple | list):
        return "[" + ", ".join(map(_flow, data)) + "]"
    return _number(data) if isinstance(data, float) else json.dumps(data) if isinstance(data, bool) else str(data)
