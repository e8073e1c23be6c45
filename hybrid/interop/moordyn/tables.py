"""Cables, bodies, environment, sections, points and mesh of a deck as tables of a scene; comments name its lines.

Where each cable becomes a scene of its own, lines that meet end to end at a free point where nothing else is attached
are one cable of several sections; every other line is a cable of its own.  What it cannot be held by is left out.

MoorDyn                          hybrid                         because
Cd, CdAx                         drag.normal, .tangential       both on d and on pi d
Ca, CaAx                         added_mass.normal, .tangential both on the displaced mass
BA >= 0                          damping.stiffness = BA/EA      tension BA x rate of strain
BA < 0                           -BA l sqrt(m/EA), l a segment  BA is then a part of a segment's critical damping
kBot, cBot                       seabed.stiffness = kBot d ...  pressures on the width of the line
point's M, V, CdA, Ca rho V      clump, float or body           as they are

Rigid bodies, there and back:

Rx(r0) Ry(p0) Rz(y0), degrees    rotation: Rz(yaw) Ry(pitch) Rx(roll), degrees
Fixed, Coupled                   kind: fixed; give `motion`
Free: Mass, CG, I about the CG   mass, centre, inertia
Volume                           volume, its centre at the CG, as measured with MoorDyn 2.7
Ca (rho V)                       added_mass of translations
CdA                              none: the damping of a body is linear
points on a free body: M, V, Ca  part of it, at their places, as MoorDyn counts them
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybrid.interop.moordyn.deck import Body, Deck, Line, LineType, Point, Rod, Triple
from hybrid.interop.moordyn.rows import DIFFERS, LEFT_OUT, TAKEN, Note, note, number
from hybrid.interop.moordyn.stretch import tables_of
from hybrid.scene.attachments import sphere_diameter
from hybrid.scene.base import turned
from hybrid.scene.bodies import AXES, mass_about
from hybrid.scene.cable import Section

_TURBINE = (
    "the place of the turbine stands in the file of FAST.Farm, not in the deck",
    "write Coupled, at its place in the sea",
)
_MOTION = "give ends.{end}.motion: harmonics, or a file with t,x,y,z"
JOINTS = ("point", "rod")  # what two lines that are one cable may meet at


@dataclass(frozen=True)
class End:
    """An end of a cable: held at a place, and in the direction of a rod, or loose with what is on its point.

    line: of the deck, for messages.  along: the direction of a rod that holds it, into the rod; None if nothing does.
    point: of a loose end.  lost: the kind and the words of the note on why no scene can hold it so.
    """

    place: Triple
    line: int
    along: Triple | None = None
    point: Point | None = None
    notes: tuple[Note, ...] = ()
    lost: Note | None = None


@dataclass(frozen=True)
class Cable:
    """Lines from s = 0 on, each with whether it runs from its end B to its end A; what is at both ends."""

    lines: tuple[tuple[Line, bool], ...]
    start: End
    end: End

    @property
    def name(self) -> str:
        """line3, or line1+2 for two that are one cable."""
        return "line" + "+".join(str(line.id) for line, _ in self.lines)

    @property
    def ids(self) -> tuple[int, ...]:
        return tuple(line.id for line, _ in self.lines)


def cables(deck: Deck) -> tuple[list[Cable], list[Note]]:
    """All cables of a deck, by their lowest line, and notes of the lines that make none."""
    found: list[Cable] = []
    notes: list[Note] = []
    done: set[int] = set()
    for id in sorted(deck.lines):
        if id not in done:
            chain = chain_of(deck, id)
            done |= {line.id for line, _ in chain}
            cable, why = _cable(deck, chain)
            notes += why
            if cable is not None:
                found.append(cable)
    return found, notes


def between(deck: Deck, line: Line) -> float:
    """Distance of the ends of a line as the deck places them, m."""
    return math.dist(end_of(deck, line.ends[0]).place, end_of(deck, line.ends[1]).place)


# --- chains ------------------------------------------------------------------------------------


def _attached(deck: Deck, kind: str, id: int) -> list[tuple[Line, int]]:
    """Lines at a point, or at either end of a rod, each with which of its ends (0 or 1) it is."""
    return [(line, k) for _, line in sorted(deck.lines.items()) for k in (0, 1) if line.ends[k][:2] == (kind, id)]


def next_line(deck: Deck, line: Line, k: int, joints: Collection[str]) -> tuple[Line, int] | None:
    """The line that goes on from end k of another, and by which end; None if none does."""
    kind, id, _ = line.ends[k]
    if kind not in joints or (deck.points if kind == "point" else deck.rods)[id].kind != "free":
        return None
    here = _attached(deck, kind, id)
    if len(here) != 2:
        return None
    if kind == "rod" and (deck.rods[id].segments or len({line.ends[k][2] for line, k in here}) != 2):
        return None
    return here[1] if here[0] == (line, k) else here[0]


def chain_of(deck: Deck, id: int, joints: Collection[str] = JOINTS) -> list[tuple[Line, bool]]:
    """The lines that are one cable with line `id`, in order; in the direction of the lowest of them.

    joints: they are one through free points where two meet ("point"), through free rods without length ("rod").
    """
    line = deck.lines[id]
    before = _walk(deck, line, 0, joints)
    if before and before[-1][0] is line:  # a ring: it has been around
        return [(line, False), *before[:-1]]
    # What lies before is walked from the end A of this line away; in the chain it runs towards it.
    return [*((other, not back) for other, back in reversed(before)), (line, False), *_walk(deck, line, 1, joints)]


def _walk(deck: Deck, line: Line, k: int, joints: Collection[str]) -> list[tuple[Line, bool]]:
    """Lines from end k of a line on, each with whether it is walked from B to A; back at the first, it stops."""
    found: list[tuple[Line, bool]] = []
    at, out = line, k
    while (step := next_line(deck, at, out, joints)) is not None:
        at, into = step
        found.append((at, into == 1))
        if at is line:
            break
        out = 1 - into
    return found


def _cable(deck: Deck, chain: list[tuple[Line, bool]]) -> tuple[Cable | None, list[Note]]:
    """The cable of a chain, or why it is none."""
    (first, back), (last, last_back) = chain[0], chain[-1]
    nowhere: list[Note] = []
    if next_line(deck, first, 1 if back else 0, JOINTS) is not None:
        why = "it closes a ring of free points; a cable of hybrid has two ends"
        return None, [note(LEFT_OUT, line.row, why, "make one of its points Fixed or Coupled") for line, _ in chain]
    start, end = end_of(deck, first.ends[1 if back else 0]), end_of(deck, last.ends[0 if last_back else 1])
    for one in (start, end):
        if one.lost is not None:
            why = f"it ends at what no scene has: {one.lost.text}: {one.lost.why}"
            nowhere += [note(LEFT_OUT, line.row, why, one.lost.instead) for line, _ in chain]
    for line, _ in chain:
        why, instead = deck.trouble(line)
        if why:
            nowhere.append(note(LEFT_OUT, line.row, why, instead))
    if nowhere:
        return None, nowhere
    return Cable(tuple(chain), _turned(start, into=False), _turned(end, into=True)), []


def _turned(end: End, into: bool) -> End:
    """The end with the direction of increasing s at it: into the rod at the end of a cable, out of it at the start."""
    if end.along is None or into:
        return end
    return replace(end, along=(-end.along[0], -end.along[1], -end.along[2]))


# --- what is at an end -------------------------------------------------------------------------


def end_of(deck: Deck, end: tuple[str, int, str]) -> End:
    kind, id, letter = end
    if kind != "point":
        return _at_rod(deck, deck.rods[id], letter)
    point = deck.points[id]
    found = _at_point(deck, point)
    loads = found.lost is None and point.kind != "free" and point.has_loads
    return replace(found, notes=(*found.notes, held_loads(point))) if loads else found


def held_loads(point: Point) -> Note:
    """Of a held point with a weight, a lift or a drag of its own."""
    why = (
        "its own weight, lift and drag (Mass, Volume, CdA), which MoorDyn counts in the force on the point or its body"
    )
    return note(LEFT_OUT, point.row, why, "add them to the force of the lines, which they do not change")


def _at_point(deck: Deck, point: Point) -> End:
    if point.kind == "fixed":
        return End(point.place, point.row.line)
    if point.kind == "coupled":
        why = "the calling program of MoorDyn moves this point; a deck does not say how, and the scene holds it"
        return End(point.place, point.row.line, notes=(note(TAKEN, point.row, why, _MOTION),))
    if point.kind == "body":
        return _on_body(deck.bodies[point.on], point.place, None, point.row.line)
    if point.kind == "turbine":
        return End(point.place, point.row.line, lost=note(LEFT_OUT, point.row, *_TURBINE))
    joined = [line.id for line, _ in _attached(deck, "point", point.id)]
    if len(joined) > 2:
        why = f"{len(joined)} lines meet there ({', '.join(map(str, joined))}), which makes no scene of one cable"
        instead = "import the deck as one scene, without --separate and --line"
        return End(point.place, point.row.line, lost=note(LEFT_OUT, point.row, why, instead))
    return End(point.place, point.row.line, point=point)


def _at_rod(deck: Deck, rod: Rod, letter: str) -> End:
    """The end of a rod; a rod of no segments has both ends at A."""
    at_a = letter == "A" or rod.segments == 0
    out = tuple(b - a for a, b in zip(rod.a, rod.b, strict=True))
    size = math.hypot(*out)
    along: Triple | None = None
    if size > 0.0:
        sign = (1.0 if letter == "A" else -1.0) / size
        along = (sign * out[0], sign * out[1], sign * out[2])
    place = rod.a if at_a else rod.b
    if rod.kind == "free" or "pinned" in rod.kind:
        if rod.kind != "free" and letter == "A" and not rod.on:
            why = "a pinned rod turns about its end A; the line is pinned there, and the rod's moment left out"
            fix = _MOTION if rod.kind == "coupled pinned" else ""
            return End(place, rod.row.line, notes=(note(TAKEN, rod.row, why, fix),))
        lost = note(LEFT_OUT, rod.row, "a rigid rod that moves", "replace it by a stiff line, or by a Free point")
        return End(place, rod.row.line, lost=lost)
    if rod.kind == "turbine":
        return End(place, rod.row.line, lost=note(LEFT_OUT, rod.row, *_TURBINE))
    if rod.kind == "body":
        return _on_body(deck.bodies[rod.on], place, along, rod.row.line)
    why = "the rod is left out; it holds the end of the line, and its direction where the line bends"
    if rod.kind == "coupled":
        why += "; the calling program of MoorDyn moves it, and the scene holds it"
        return End(place, rod.row.line, along, notes=(note(TAKEN, rod.row, why, _MOTION),))
    return End(place, rod.row.line, along, notes=(note(TAKEN, rod.row, why),))


def _on_body(body: Body, place: Triple, along: Triple | None, line: int) -> End:
    """What a body carries, where it is at first."""
    there = _rotated(body.angles, place)
    at = (body.place[0] + there[0], body.place[1] + there[1], body.place[2] + there[2])
    held = {
        "fixed": "",
        "free": "a rigid body of its own motion; the scene holds the line where the deck puts the body at first",
        "pinned": "a body that turns freely; the scene holds the line where the deck puts the body at first",
    }.get(body.kind, "the calling program of MoorDyn moves this body; the scene holds the line on it")
    if body.kind == "turbine":
        return End(at, line, lost=note(LEFT_OUT, body.row, *_TURBINE))
    fix = _MOTION
    if body.kind in ("free", "pinned"):
        fix = "give ends.{end}.position and .motion as MoorDyn finds them, or import all lines, whose bodies move"
    notes = (note(TAKEN, body.row, held, fix),) if held else ()
    return End(at, line, _rotated(body.angles, along) if along is not None else None, notes=notes)


def _rotated(angles: Triple, v: Triple) -> Triple:
    """Rx(roll) Ry(pitch) Rz(yaw) v, angles in degrees: the order of MoorDyn, as measured with it."""
    (cx, sx), (cy, sy), (cz, sz) = ((math.cos(a), math.sin(a)) for a in map(math.radians, angles))
    x, y, z = v
    x, y = cz * x - sz * y, sz * x + cz * y
    x, z = cy * x + sy * z, cy * z - sy * x
    return x, cx * y - sx * z, sx * y + cx * z


# --- rigid bodies ------------------------------------------------------------------------------

DAMP = "give `damping`, about its mean motion"


def numbers_of(cell: str) -> list[float] | None:
    """The numbers of a cell such as 0|0|1; None if one is none."""
    found = [number(x) for x in cell.split("|")]
    return None if any(x is None for x in found) else [float(x or 0.0) for x in found]


def three(cell: str, alone: str) -> Triple | None:
    """Three numbers of a cell; one alone is that of z ("z") or of all ("all")."""
    found = numbers_of(cell)
    if found is not None and len(found) == 1:
        found = [0.0, 0.0, found[0]] if alone == "z" else found * 3
    return (found[0], found[1], found[2]) if found is not None and len(found) == 3 else None


def rotation_of(angles: Triple) -> Triple:
    """Roll, pitch, yaw (degrees) as a scene has them, of the angles of a deck."""
    R = [*zip(*(_rotated(angles, x) for x in AXES), strict=True)]
    flat = math.hypot(R[0][0], R[1][0])
    if flat < 1e-12:  # straight up or down: yaw is none of its own
        return _degrees(math.atan2(-R[1][2], R[1][1]), math.atan2(-R[2][0], flat), 0.0)
    return _degrees(math.atan2(R[2][1], R[2][2]), math.atan2(-R[2][0], flat), math.atan2(R[1][0], R[0][0]))


def angles_of(rotation: Triple) -> Triple:
    """The angles of a deck of roll, pitch, yaw of a scene (degrees)."""
    R = [*zip(*(turned(rotation, x) for x in AXES), strict=True)]
    flat = math.hypot(R[0][0], R[0][1])
    if flat < 1e-12:
        return _degrees(math.atan2(R[2][1], R[1][1]), math.atan2(R[0][2], flat), 0.0)
    return _degrees(math.atan2(-R[1][2], R[2][2]), math.atan2(R[0][2], flat), math.atan2(-R[0][1], R[0][0]))


def _degrees(*angles: float) -> Triple:
    x, y, z = (math.degrees(a) + 0.0 for a in angles)
    return x, y, z


def body_row(body: Any, place: Triple, rotation: Triple, density: float, surface: float) -> tuple[str, list[str]]:
    """The row of a body of a scene, at its place (m) and rotation (degrees), without its number; and what is wrong.

    surface: height of the water, m.
    """
    wrong: list[str] = []
    kind = "Free" if body.kind == "free" else "Coupled" if body.motion is not None else "Fixed"
    rest = ["0"] * 6
    if body.kind == "free":
        wrong += [key for key in ("hydrostatics", "damping") if getattr(body, key) is not None]
        wrong += ["members"] if body.members else []
        wrong += [load.what for load in body.end.loads]
        if body.volume and math.dist(body.centre, body.centre_of_buoyancy) > 0.0:
            wrong.append("centre_of_buoyancy")  # MoorDyn's is the centre of mass
        matrix = body.added_mass or [[0.0] * 6 for _ in range(6)]
        if any(matrix[i][j] for i in range(6) for j in range(6) if i != j or i > 2):
            wrong.append("added_mass")
        displaced = density * body.volume
        ca = [matrix[i][i] / displaced if displaced else 0.0 for i in range(3)]
        if any(matrix[i][i] for i in range(3)) and not displaced:
            wrong.append("added_mass")
        ca = [*ca, 0.0, 0.0, 0.0] if any(ca) else [0.0]
        cells = ([body.mass], body.centre, body.inertia, [body.volume], [0.0], ca)
        rest = ["|".join(f"{x:.12g}" for x in cell) for cell in cells]
    x, y, z = place
    numbers = (x, y, z - surface, *angles_of(rotation))
    return f"{kind} {' '.join(f'{x:.12g}' for x in numbers)} {' '.join(rest)}", wrong


def body_table(body: Body, density: float, parts: Sequence[Point] = ()) -> tuple[dict[str, Any], list[Note]] | str:
    """The table of a body, and notes on what is not as in the deck; or why there is none.

    parts: points on it that have a mass, a volume or a drag area of their own.
    """
    turned = rotation_of(body.angles)
    if body.kind in ("fixed", "coupled"):
        return {"kind": "fixed", "position": body.place} | ({"rotation": turned} if any(turned) else {}), []
    if body.kind != "free":
        return "a rigid body that a deck pins; bodies of a scene are fixed or free"
    mass, volume = (numbers_of(body.rest[i]) for i in (0, 3))
    centre, inertia = three(body.rest[1], "z"), three(body.rest[2], "all")
    drag, added = numbers_of(body.rest[4]), numbers_of(body.rest[5])
    if mass is None or volume is None or centre is None or inertia is None or drag is None or added is None:
        return "a rigid body whose mass, CG, I, Volume, CdA and Ca are not all numbers"
    if mass[0] <= 0.0 or min(inertia) < 0.0 or max(inertia) <= 0.0:
        return "a free rigid body without mass or moments of inertia"
    notes = []
    if min(inertia) == 0.0:
        why = f"it has no moment of inertia about some axes; {max(inertia):g} kg m^2 is taken there, too"
        notes.append(note(TAKEN, body.row, why, "give its moments of inertia; at rest they do nothing"))
        x, y, z = (each or max(inertia) for each in inertia)
        inertia = (x, y, z)
    masses = [(mass[0], centre), *((p.mass, p.place) for p in parts)]
    whole, about = _centre(masses)
    turning = _inertia(inertia, masses, about)
    if np.abs(np.tril(turning, -1)).max() > _PRODUCTS * turning.diagonal().min():
        return "a free rigid body that the masses of its points give products of inertia"
    found: dict[str, Any] = {"kind": "free", "initial_guess": body.place, "mass": whole}
    found |= {"initial_rotation": turned} if any(turned) else {}
    found |= {"centre": about} if any(about) else {}
    found["inertia"] = turning.diagonal().tolist()
    if density:
        volumes = [(volume[0], centre), *((p.volume, p.place) for p in parts)]
        displaced, lift = _centre(volumes)
        found |= {"volume": displaced} if displaced else {}
        found |= {"centre_of_buoyancy": lift} if displaced and any(lift) else {}
        moved = (added * 3)[:3] if len(added) == 1 else added[:3]
        found |= _added([density * volume[0] * ca for ca in moved], parts, density)
        if volume[0] and any(added[3:]):
            notes.append(note(LEFT_OUT, body.row, "added inertia of its rotations (Ca)", DAMP))
        if any(drag):
            why = "its drag (CdA); `damping` of a body of hybrid is linear"
            notes.append(note(LEFT_OUT, body.row, why, DAMP))
        if any(p.drag_area for p in parts):
            which = ", ".join(str(p.id) for p in parts if p.drag_area)
            why = f"the drag (CdA) of its points {which}; `damping` of a body of hybrid is linear"
            notes.append(note(LEFT_OUT, body.row, why, DAMP))
    return found, notes


# Products of inertia that round-off leaves, of the smallest moment of inertia.
_PRODUCTS = 1e-9


def _centre(parts: Sequence[tuple[float, Triple]]) -> tuple[float, Triple]:
    """The sum of masses or volumes, and its centre."""
    total = sum(m for m, _ in parts)
    x, y, z = (sum(m * place[i] for m, place in parts) / total if total else 0.0 for i in range(3))
    return total, (x, y, z)


def _inertia(own: Triple, masses: Sequence[tuple[float, Triple]], centre: Triple) -> Any:
    """(3, 3) about the common centre, kg m^2, of the first mass with its own moments and of mass points."""
    return sum((mass_about(m, np.subtract(place, centre))[3:, 3:] for m, place in masses), np.diag(own))


def _added(own: Sequence[float], parts: Sequence[Point], density: float) -> dict[str, Any]:
    """Added mass about the origin: of translations of the body, and of its points at their places."""
    pieces = [(density * p.volume * p.added, p.place) for p in parts if p.volume and p.added]
    if not pieces:
        return {"added_mass": [*own, 0.0, 0.0, 0.0]} if any(own) else {}
    M = np.diag([*own, 0.0, 0.0, 0.0]) + sum(mass_about(m, place) for m, place in pieces)
    return {"added_mass": M.tolist()}


# --- tables as YAML ----------------------------------------------------------------------------

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
