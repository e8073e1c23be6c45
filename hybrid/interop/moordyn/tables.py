"""Environment, sections, points and mesh of a deck as YAML; comments name the lines of the deck.

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
from typing import Any

from hybrid.interop.moordyn.cables import End, between
from hybrid.interop.moordyn.deck import Deck, Line, LineType, Point, Rod
from hybrid.interop.moordyn.rows import DIFFERS, TAKEN, Note, note
from hybrid.interop.moordyn.stretch import tables_of
from hybrid.scene.attachments import sphere_diameter
from hybrid.scene.cable import Section

# Segments whose lengths differ by less are equal: lengths are written with six digits.
SAME_SEGMENT = 1e-6
# Strain of a line between the places of its ends, beyond which it is too short for them: nylon breaks at 0.2 to 0.4.
MOST_STRAIN = 0.5
NEAR = 0.05  # part of the depth: a line with an end as near to the bed may lie there


class Tables:
    """Tables of a scene of some lines of a deck, and notes on what they lose."""

    def __init__(self, deck: Deck, types: Sequence[LineType]) -> None:
        self.deck, self.types, self.options = deck, types, deck.options
        self.notes: list[Note] = []
        self.wet = self.options.density > 0.0

    def _environment(self) -> list[str]:
        options = self.options
        parts = [
            "environment:",
            f"  gravity: {number_text(options.gravity)}{self._origin('gravity', 'default of MoorDyn')}",
        ]
        if self.wet:
            origin = self._origin("density", "default of MoorDyn")
            parts.append(f"  fluid: {{density: {number_text(options.density)}, surface: 0.0}}{origin}")
        bed = self._bed()
        return parts + ([bed] if bed else [])

    def _bed(self) -> str:
        options, width = self.options, self._width()
        if options.bed_stiffness == 0.0:
            row = options.rows["bed_stiffness"]
            self.notes.append(note(TAKEN, row, "a bed without stiffness does nothing; the scene has none"))
            return ""
        uneven = options.seafloor
        bed: dict[str, Any] = {"z": self._bottom() if uneven is None else 0.0}
        if uneven is not None:
            bed["depths"] = {"x": uneven.x, "y": uneven.y, "depth": uneven.depth}
        bed["stiffness"] = options.bed_stiffness * width
        if options.bed_damping:
            bed["damping"] = options.bed_damping * width
        along, across = (x or options.friction for x in (options.friction_along, options.friction_across))
        if along or across:
            bed["friction"] = {"axial": along, "lateral": across}
        places = [uneven.row.line] if uneven is not None else []
        places += [options.rows[key].line for key in ("depth", "bed_stiffness", "bed_damping") if key in options.rows]
        return f"  seabed: {flow(bed)}{lines_of(places)}"

    def _width(self) -> float:
        """Diameter that bears on the bed, m: one bed has one stiffness per length, MoorDyn's follows the diameter."""
        widths = sorted({kind.diameter for kind in self._at_the_bed()})
        if len({kind.diameter for kind in self.types}) > 1 and self.options.bed_stiffness:
            which = "thickest line" if len(widths) > 1 else "lines that end there"
            why = f"kBot and cBot act on the diameter; the bed gets those of the {which}, {widths[-1]:g} m"
            instead = "set environment.seabed.stiffness to kBot x the diameter of what lies on the bed"
            self.notes.append(Note(TAKEN, None, "", why, instead))
        return widths[-1]

    def _at_the_bed(self) -> Sequence[LineType]:
        """Types of the lines that have an end near the bed; of all lines where none has."""
        return self.types

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

    def _sections_of(self, lines: Sequence[Line], types: Sequence[LineType], ends: tuple[End, End]) -> list[str]:
        """Sections of lines that are one, each in one line of YAML; ends: of the whole."""
        lengths = [self._length(line) for line in lines]
        apart = math.dist(ends[0].place, ends[1].place) if all(end.point is None for end in ends) else 0.0
        strains = self._strains(types, lengths, apart)
        return [self._section(*each) for each in zip(lines, types, lengths, strains, strict=True)]

    def _strains(self, types: Sequence[LineType], lengths: Sequence[float], apart: float) -> list[float]:
        """Strain of each section between ends that are `apart`, m, with room for its weight; 0 where none is needed."""
        over, linear = apart - sum(lengths), all(not (x.stretch.table or x.stretch.polyester) for x in types)
        if over <= 0.0 or not linear:
            return [0.0] * len(types)
        each = list(zip(types, lengths, strict=True))
        T = over / sum(l / x.ea for x, l in each)
        T += self.options.gravity * sum(
            l * abs(x.mass - self.options.density * 0.25 * math.pi * x.diameter**2) for x, l in each
        )
        return [T / x.ea if T / x.ea < MOST_STRAIN else 0.0 for x in types]

    def _section(self, line: Line, kind: LineType, length: float, strain: float) -> str:
        """A section in one line of YAML; strain: that its ends ask for, 0: none."""
        section: dict[str, Any] = {"length": length, "mass": kind.mass, "diameter": kind.diameter}
        how = kind.stretch
        dynamic = how.dynamic
        if how.polyester is not None:
            found = tables_of(how.polyester, self.deck.pasts[line.id], self.notes)
            assert not isinstance(found, str)
            section["syrope"], dynamic = found
        else:
            section |= {"tension_strain": how.table} if how.table is not None else {"axial_stiffness": kind.ea}
        if dynamic is not None:
            section["dynamic_stiffness"] = dynamic
        if strain and strain > Section(**section).strain_limit:
            section["max_strain"] = math.ceil(100.0 * strain) / 100.0
            why = f"it is stretched by up to {strain:.3g} between its ends, more than it bears without max_strain"
            self.notes.append(note(TAKEN, line.row, why, "check its length; give more where its ends move apart"))
        if kind.ei:
            section["bending_stiffness"] = kind.ei
        if self.wet and any(kind.drag):
            section["drag"] = dict(zip(("normal", "tangential"), kind.drag, strict=True))
        if self.wet and any(kind.added):
            section["added_mass"] = dict(zip(("normal", "tangential"), kind.added, strict=True))
        tau = self._tau(kind, line, length)
        if tau:
            section["damping"] = {"stiffness": tau}
        return f"- {flow(section)}{lines_of([line.row.line, kind.row.line])}"

    def _tau(self, kind: LineType, line: Line, length: float) -> float:
        """Damping time of stretch, s: BA/EA."""
        if kind.ba >= 0.0:
            rope, dynamic = kind.stretch.polyester, kind.stretch.dynamic
            return kind.ba / (rope.fast[0] if rope is not None else kind.ea if dynamic is None else dynamic["constant"])
        segment = length / line.segments
        ba = -kind.ba * segment * math.sqrt(kind.ea * kind.mass)
        why = (
            f"BA is {-kind.ba:g} of the critical damping of one segment of {segment:.4g} m: {ba:.4g} N s, "
            "which is less the more segments there are"
        )
        instead = "leave damping out of the section: hybrid needs none to be stable"
        self.notes.append(note(TAKEN, kind.row, why, instead))
        return ba / kind.ea

    def _rod_joint(self, rod: Rod) -> None:
        why = "a free rod without length joins its two lines as one cable; the drag of its faces is left out"
        self.notes.append(note(TAKEN, rod.row, why))

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

    def _mesh(self, lines: Sequence[Line], lengths: Sequence[float]) -> list[str]:
        """Cells of lines that are one, each of them with its segments."""
        counts = [line.segments for line in lines]
        cells = [length / n for length, n in zip(lengths, counts, strict=True)]
        origin = lines_of([line.row.line for line in lines])
        why = "  # NumSegs; leave mesh out and cells are placed where the cable bends" + origin.replace("  #", ";")
        if sum(counts) == 1:
            row = lines[0].row
            self.notes.append(note(TAKEN, row, "one segment is no mesh; the scene has two cells"))
            return [f"mesh: {{cells: 2}}{why}"]
        if max(cells) - min(cells) <= SAME_SEGMENT * max(cells):
            return [f"mesh: {{cells: {sum(counts)}}}{why}"]
        nodes, s = [0.0], 0.0
        for length, n in zip(lengths, counts, strict=True):
            nodes += [s + length * k / n for k in range(1, n + 1)]
            s += length
        return [f"mesh:{why}", f"  nodes: {flow(nodes)}"]

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
            why = (
                "without EI the cable is a catenary; where tension vanishes MoorDyn's goes on, crumpled, and hybrid's "
            )
            why += "stops in a scene with `model: catenary`" if any(bends) else "run begins anew with rods"
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
        return lines_of([row.line]) if row is not None else f"  # {otherwise}"


def lines_of(lines: Iterable[int]) -> str:
    """A comment that names lines of the deck."""
    named = ", ".join(str(line) for line in dict.fromkeys(lines))
    return f"  # {named}" if named else ""


def number_text(x: float) -> str:
    return f"{x:.12g}"  # products of a deck's numbers carry round-off that nobody wants to read


def flow(data: Any) -> str:
    """A table, list or scalar on one line of YAML."""
    if isinstance(data, dict):
        return "{" + ", ".join(f"{key}: {flow(value)}" for key, value in data.items()) + "}"
    if isinstance(data, tuple | list):
        return "[" + ", ".join(map(flow, data)) + "]"
    return number_text(data) if isinstance(data, float) else json.dumps(data) if isinstance(data, bool) else str(data)
