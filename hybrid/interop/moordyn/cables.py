"""Which lines of a deck are one cable, and what is at its ends.

Where each cable becomes a scene of its own, lines that meet end to end at a free point where nothing else is attached
are one cable of several sections; every other line is a cable of its own.  What it cannot be held by is left out.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

from hybrid.interop.moordyn.deck import Body, Deck, Line, Point, Rod, Triple
from hybrid.interop.moordyn.rows import LEFT_OUT, TAKEN, Note, note

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
