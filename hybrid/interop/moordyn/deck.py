"""The tables of a deck: line types, points, bodies, rods, lines.

Two forms are read.  MoorDyn 2: line types with EI (10 columns and more), points of 9 columns, lines with their ends
before their length.  MoorDyn 1: line types without EI (9 columns, added mass before drag), points of 12 columns with a
force, lines with their length before their ends.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from hybrid.interop.moordyn.rows import (
    LEFT_OUT,
    NOT_NEEDED,
    TAKEN,
    TITLES,
    Note,
    Options,
    Row,
    Section,
    Source,
    check_names,
    note,
    number,
    read_options,
    simple,
)
from hybrid.interop.moordyn.stretch import OTHER, Past, Stretch, is_word, pasts_of, stretch_of, tables_of
from hybrid.scene.base import did_you_mean
from hybrid.scene.cable import DENSITIES, SECTION_DENSITIES

# Line types of a deck: properties per length, in the columns of MoorDyn 2 or 1, and units that cannot be.

# Speed of waves of tension sqrt(EA/m), m/s, from rubber to aramid: 100 to 12 000.  EA in kN is out by 30.
SPEEDS = (20.0, 3.0e4)

_TYPE_V2 = (
    ("TypeName", "name", "typename", "linetype", "type"), ("Diam", "diam", "diameter", "d"),
    ("Mass/m", "massm", "massden", "massdeninair", "massdenair", "mass", "w"), ("EA", "ea"),
    ("BA/-zeta", "bazeta", "ba", "zeta"), ("EI", "ei"), ("Cd", "cd", "cdn"), ("Ca", "ca", "can"),
    ("CdAx", "cdax", "cdt"), ("CaAx", "caax", "cat"), ("Cl", "cl"), ("dF", "df"), ("cF", "cf"),
)  # fmt: skip
_ADDED_FIRST = ("can", "cat", "cdn", "cdt")  # after EI, in decks between MoorDyn 1 and 2
_TYPE_V1 = (*_TYPE_V2[:5], ("Can", "can", "ca"), ("Cat", "cat", "caax"), ("Cdn", "cdn", "cd"), ("Cdt", "cdt", "cdax"))


PLAIN = Stretch()


@dataclass(frozen=True)
class LineType:
    """Properties per length of a line.  trouble: why no line of this type can be carried over, "" if it can."""

    name: str
    row: Row
    diameter: float
    mass: float
    ea: float
    ba: float
    ei: float
    drag: tuple[float, float]  # normal, tangential
    added: tuple[float, float]
    trouble: str = ""
    instead: str = ""
    stretch: Stretch = PLAIN


def _types_are_old(section: Section) -> bool:
    """Whether a row of 9 columns is one of MoorDyn 1, or lacks one: the names decide."""
    names = {simple(cell) for cell in section.names.cells} if section.names is not None else set()
    return "ei" not in names and bool(names & {"ca", "can"})


def _added_mass_first(section: Section) -> bool:
    """Whether added mass stands before drag after EI: the names decide."""
    names = section.names.cells[6:10] if section.names is not None else ()
    return tuple(simple(cell) for cell in names) == _ADDED_FIRST


def line_type(source: Source, row: Row, notes: list[Note]) -> LineType | None:
    old = len(row.cells) == len(_TYPE_V1) and _types_are_old(source.sections["line types"])
    between = not old and _added_mass_first(source.sections["line types"])
    names = _TYPE_V1 if old else (*_TYPE_V2[:6], *_TYPE_V1[5:]) if between else _TYPE_V2
    if not old and _types_are_old(source.sections["line types"]):
        expected = "9 columns, as they are named, or 10 with EI behind BA/-zeta"
        fix = "name EI, or take out what stands behind Cdt"
        source.complain(f"{len(row.cells)} columns", row.text, expected, fix, row.line)
        return None
    if not (old or source.columns(row, 10, len(names), names)):
        return None
    check_names(source, "line types", names, least=len(_TYPE_V1) if old else 10)
    name = row.cells[0]
    twin = next((r for r in source.rows("line types") if r.line < row.line and r.cells[0] == name), None)
    if twin is not None:
        fix = "give it another name"
        source.complain("line type", name, f"a name of its own; line {twin.line} has it already", fix, row.line)
    diameter = source.number(row, row.cells[1], "diameter (m)", above=0.0)
    mass = source.number(row, row.cells[2], "mass per length (kg/m)", above=0.0)
    how = stretch_of(source, row, row.cells[3], row.cells[4], notes)
    ea, ba, trouble, instead = how.ea, how.ba, how.trouble, how.instead
    if old and ba > 0.0:
        why = "BA is taken in N s, as MoorDyn 2 does, whatever the row of units"
        notes.append(note(TAKEN, row, why, "if it is in Pa s, multiply damping.stiffness by the area of the line"))
    rest = row.cells[5:]
    ei = 0.0
    if not old:
        if is_word(rest[0]):
            trouble, instead = f"EI is read from {rest[0]}", "write EI as a number, in N m^2, in a copy of the deck"
        else:
            ei = source.number(row, rest[0], "EI (N m^2)", least=0.0)
        rest = rest[1:]
    added_first = old or between
    words = ("Can", "Cat", "Cdn", "Cdt") if added_first else ("Cd", "Ca", "CdAx", "CaAx")
    c = [source.number(row, cell, word, least=0.0) for word, cell in zip(words, rest, strict=False)]
    drag, added = ((c[2], c[3]), (c[0], c[1])) if added_first else ((c[0], c[2]), (c[1], c[3]))
    if between:
        why = "added mass before drag, as the columns are named; MoorDyn 2 reads them as Cd Ca CdAx CaAx all the same"
        notes.append(note(TAKEN, row, why, "for what MoorDyn 2 computes, name and order them Cd Ca CdAx CaAx"))
    if len(rest) > 4 and source.number(row, rest[4], "Cl", least=0.0) > 0.0:
        why = "Cl makes lines vibrate in their own eddies; hybrid has no such force"
        notes.append(note(LEFT_OUT, row, why, "raise drag.normal of the sections by what the vibration adds"))
    _units(source, row, (diameter, mass, ea), notes)
    return LineType(name, row, diameter, mass, ea, ba, ei, drag, added, trouble, instead, how)


def _units(source: Source, row: Row, values: tuple[float, float, float], notes: list[Note]) -> None:
    """Complain of a diameter, mass and EA that a scene refuses, and note those that only another unit explains."""
    diameter, mass, ea = values
    density = mass / (math.pi / 4 * diameter**2) if diameter > 0.0 else math.nan
    (least, most), (low, high) = SECTION_DENSITIES, DENSITIES
    why = f"a line of {{:g}} to {{:g}} kg/m^3; this one has {density:.3g} kg/m^3"
    fix = "diameter in m and mass in kg/m; " + ("mm?" if density < low else "g/m, or a radius?")
    if density < least or density > most:
        source.complain("diameter and mass", f"{diameter:g} {mass:g}", why.format(least, most), fix, row.line)
    elif density < low or density > high:
        notes.append(note(TAKEN, row, f"as it stands, and implausible: expected {why.format(low, high)}", fix))
    speed = math.sqrt(ea / mass) if mass > 0.0 and ea > 0.0 else math.nan
    if speed < SPEEDS[0] or speed > SPEEDS[1]:
        why = f"a line in which tension travels at {SPEEDS[0]:g} to {SPEEDS[1]:g} m/s, sqrt(EA/m); here {speed:.3g}"
        fix = "EA in N: " + ("kN or MN?" if speed < SPEEDS[0] else "or the modulus E, in Pa?")
        notes.append(note(TAKEN, row, f"as it stands, and implausible: expected {why}", fix))


# The tables of a deck: line types, points, bodies, rods, lines.

Triple = tuple[float, float, float]

_POINT_V2 = (
    ("ID", "id", "node", "point"), ("Attachment", "attachment", "type"), ("X", "x"), ("Y", "y"), ("Z", "z"),
    ("Mass", "mass", "m"), ("Volume", "volume", "v"), ("CdA", "cda"), ("Ca", "ca"),
)  # fmt: skip
_POINT_V1 = (*_POINT_V2[:7], ("FX", "fx"), ("FY", "fy"), ("FZ", "fz"), *_POINT_V2[7:])
_LENGTH, _SEGMENTS = ("UnstrLen", "unstrlen", "length"), ("NumSegs", "numsegs", "nsegs")
_A, _B = ("AttachA", "attacha", "nodea", "nodeanch"), ("AttachB", "attachb", "nodeb", "nodefair")
_FLAGS = ("Outputs", "outputs", "lineoutputs", "flagsoutputs", "output")
_LINE_V2 = (("ID", "id", "line"), ("LineType", "linetype", "type"), _A, _B, _LENGTH, _SEGMENTS, _FLAGS)
_LINE_V1 = (*_LINE_V2[:2], _LENGTH, _SEGMENTS, _A, _B, _FLAGS)

# How points, bodies and rods are attached, by the words of MoorDyn.
WORDS = {
    "fixed": ("FIXED", "FIX", "ANCHOR"),
    "coupled": ("COUPLED", "CPLD", "VESSEL", "VES", "FAIRLEAD"),
    "coupled pinned": ("COUPLEDPINNED", "CPLDPIN", "VESPIN", "COUPLED PINNED"),
    "pinned": ("PINNED", "PIN"),
    "free": ("FREE", "CONNECT", "CON", "POINT"),
}
_KIND = {word: kind for kind, words in WORDS.items() for word in words}
_PLURAL = {"point": "points", "rod": "rods", "body": "bodies"}


@dataclass(frozen=True)
class Point:
    """kind: fixed, coupled, free, body, turbine; of the last two `on` is the number."""

    id: int
    row: Row
    kind: str
    on: int
    place: Triple
    mass: float
    volume: float
    drag_area: float
    added: float
    force: Triple = (0.0, 0.0, 0.0)  # steady, N; of MoorDyn 1

    @property
    def has_loads(self) -> bool:
        """Whether it has a weight, a lift or a drag of its own."""
        return bool(self.mass or self.volume or self.drag_area)


@dataclass(frozen=True)
class Body:
    """A rigid body; angles in degrees, as MoorDyn takes them whatever the row of units.

    rest: Mass, CG, I, Volume, CdA, Ca as they are written, each a number or several with | between them.
    """

    id: int
    row: Row
    kind: str
    place: Triple
    angles: Triple
    rest: tuple[str, ...] = ()

    @property
    def has_loads(self) -> bool:
        """Whether it has a mass, an inertia, a volume or a drag of its own."""
        return any(number(x) != 0.0 for cell in (self.rest[i] for i in (0, 2, 3, 4)) for x in cell.split("|"))


@dataclass(frozen=True)
class Rod:
    """A rigid rod from a to b; on: the body that carries it, 0 if none does."""

    id: int
    row: Row
    kind: str
    on: int
    a: Triple
    b: Triple
    segments: int


@dataclass(frozen=True)
class Line:
    """A line from its end A to its end B; each is a point, ("point", id, ""), or the end of a rod, ("rod", id, "A")."""

    id: int
    row: Row
    type: str
    ends: tuple[tuple[str, int, str], tuple[str, int, str]]
    length: float  # m; negative: so many times the distance of the ends
    segments: int


@dataclass
class Deck:
    """The contents of a deck."""

    file: str
    types: dict[str, LineType]
    points: dict[int, Point]
    bodies: dict[int, Body]
    rods: dict[int, Rod]
    lines: dict[int, Line]
    options: Options
    notes: list[Note] = field(default_factory=list)
    pasts: dict[int, Past] = field(default_factory=dict)  # of lines of polyester, by ID

    def trouble(self, line: Line) -> tuple[str, str]:
        """Why a line cannot be carried over, and what to do; "" if it can."""
        kind = self.types[line.type]
        why, instead = kind.trouble, kind.instead
        rope = kind.stretch.polyester
        if not why and rope is not None:
            past = self.pasts.get(line.id)
            instead = OTHER
            if past is None:
                why = "it is of polyester that remembers its highest tension, and no row says which"
                instead = "add a row to SYROPE IC with its Tmax and Tmean, in a copy of the deck"
            elif isinstance(found := tables_of(rope, past, []), str):
                why = found
        return (f"line type {kind.name}: {why}" if why else ""), instead


def read_deck(source: Source, needs_lines: bool = True) -> Deck:
    """The tables of a deck; SceneError with every complaint if it is refused.

    needs_lines: whether one without lines is refused, even if it has points.
    """
    without = not needs_lines and "lines" not in source.sections and bool(source.rows("points"))
    for name, title in () if without else (("line types", "LINE TYPES"), ("lines", "LINES")):
        if name not in (*source.sections, *source.misspelt):
            found = ", ".join(f"{s.title} (line {s.line})" for s in source.sections.values())
            expected = f"a section that begins with a row such as ------- {title} -------"
            found, fix = found or "no section that MoorDyn knows", "check that this is a MoorDyn input file"
            source.complain(title, found, expected, fix, None)
        elif name in source.sections and not source.rows(name) and not source.complaints:
            section = source.sections[name]
            fix = "fill the table: names, units, then one row for each"
            source.complain(section.title, "", "at least one row under names and units", fix, section.line)
    source.refuse()
    notes: list[Note] = []
    types = {x.name: x for x in _each(source, "line types", line_type, notes)}
    bodies = _numbered(source, "bodies", _each(source, "bodies", _body, notes))
    rods = _numbered(source, "rods", _each(source, "rods", _rod, notes))
    points = _numbered(source, "points", _each(source, "points", _point, notes))
    lines = _numbered(source, "lines", _each(source, "lines", _line, notes))
    deck = Deck(source.file, types, points, bodies, rods, lines, read_options(source, notes), notes)
    polyester = {x.id for x in lines.values() if x.type in types and types[x.type].stretch.polyester is not None}
    deck.pasts = pasts_of(source, polyester, notes)
    _hold_together(source, deck)
    source.refuse()
    return deck


def _each(source: Source, name: str, read: Callable[..., object], notes: list[Note]) -> list:
    found = [read(source, row, notes) for row in source.rows(name)]
    return [x for x in found if x is not None]


def _numbered(source: Source, name: str, things: list) -> dict:
    """By ID; MoorDyn counts rows, so the IDs must count them too."""
    if len(things) == len(source.rows(name)):
        for n, thing in enumerate(things, start=1):
            if thing.id != n:
                expected = f"{n}: IDs count the rows from 1, because MoorDyn attaches by place"
                source.complain("ID", str(thing.id), expected, "number the rows in order", thing.row.line)
    return {thing.id: thing for thing in things}


# --- points, bodies, rods ----------------------------------------------------------------------


def _attachment(source: Source, row: Row, cell: str, kinds: Sequence[str]) -> tuple[str, int]:
    """How a thing is attached, and the number of the body or turbine that carries it."""
    word = cell.upper()
    carried = re.fullmatch(r"(BODY|TURBINE)(\d{1,6})(PINNED|PIN)?", word)
    if carried and carried[1].lower() in kinds:
        return carried[1].lower() + (" pinned" if carried[3] else ""), int(carried[2])
    kind = _KIND.get(word)
    if kind is not None and kind in kinds:
        return kind, 0
    known = [WORDS[k][0].title() for k in kinds if k in WORDS] + [f"{k.title()}1" for k in kinds if k not in WORDS]
    near = did_you_mean(cell.title(), known)
    source.complain("attachment", cell, f"one of {', '.join(known)}", near or "check the columns of this row", row.line)
    return kinds[0], 0


def _triple(source: Source, row: Row, cells: Sequence[str], names: str) -> Triple:
    x, y, z = (source.number(row, cell, name) for cell, name in zip(cells, names.split(), strict=True))
    return x, y, z


def _points_are_old(section: Section, row: Row) -> bool:
    """Whether a force stands before drag, as in MoorDyn 1; the names decide where they have either in column 8."""
    eighth = simple(section.names.cells[7]) if section.names is not None and len(section.names.cells) > 7 else ""
    return eighth != "cda" and (eighth == "fx" or len(row.cells) == len(_POINT_V1))


def _point(source: Source, row: Row, notes: list[Note]) -> Point | None:
    old = _points_are_old(source.sections["points"], row)
    names = _POINT_V1 if old else _POINT_V2
    if not source.columns(row, len(names), len(names), names):
        return None
    check_names(source, "points", names, len(names))
    cells = row.cells[: len(names)]
    kind, on = _attachment(source, row, cells[1], ("fixed", "coupled", "free", "body", "turbine"))
    mass = source.number(row, cells[5], "mass (kg)", least=0.0)
    volume = source.number(row, cells[6], "volume (m^3)", least=0.0)
    force = _triple(source, row, cells[7:10], "FX FY FZ") if old else (0.0, 0.0, 0.0)
    if old and kind == "coupled":
        why = "MoorDyn 1 counts the place of a vessel's point from the platform, which is taken to be at 0 0 0"
        notes.append(note(TAKEN, row, why, "shift ends.end.position, if the platform is elsewhere"))
    area, added = (source.number(row, c, n, least=0.0) for c, n in zip(cells[-2:], ("CdA (m^2)", "Ca"), strict=True))
    place = _triple(source, row, cells[2:5], "X Y Z")
    return Point(source.integer(row, cells[0], "ID", 1), row, kind, on, place, mass, volume, area, added, force)


def _body(source: Source, row: Row, notes: list[Note]) -> Body | None:
    columns = "ID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG I Volume CdA Ca"
    if not source.columns(row, 14, 14, [(name,) for name in columns.split()]):
        return None
    kind, _ = _attachment(
        source, row, row.cells[1], ("fixed", "coupled", "free", "pinned", "coupled pinned", "turbine")
    )
    place, angles = (_triple(source, row, row.cells[i : i + 3], n) for i, n in ((2, "X0 Y0 Z0"), (5, "r0 p0 y0")))
    return Body(source.integer(row, row.cells[0], "ID", 1), row, kind, place, angles, row.cells[8:14])


def _rod(source: Source, row: Row, notes: list[Note]) -> Rod | None:
    columns = "ID RodType Attachment Xa Ya Za Xb Yb Zb NumSegs RodOutputs"
    if not source.columns(row, 11, 11, [(name,) for name in columns.split()]):
        return None
    kinds = ("fixed", "coupled", "free", "pinned", "coupled pinned", "body", "turbine")
    kind, on = _attachment(source, row, row.cells[2], kinds)
    a, b = (_triple(source, row, row.cells[i : i + 3], n) for i, n in ((3, "Xa Ya Za"), (6, "Xb Yb Zb")))
    segments = source.integer(row, row.cells[9], "NumSegs", 0)
    return Rod(source.integer(row, row.cells[0], "ID", 1), row, kind, on, a, b, segments)


# --- lines -------------------------------------------------------------------------------------


def _line(source: Source, row: Row, notes: list[Note]) -> Line | None:
    # whether lengths stand before ends, as in MoorDyn 1: their columns are as many, so the names decide
    third = header.cells[2:3] if (header := source.sections["lines"].names) is not None else ()
    old = any(simple(c) in _LENGTH[1:] for c in third)
    names = _LINE_V1 if old else _LINE_V2
    if not source.columns(row, 7, 7, names):
        return None
    check_names(source, "lines", names, len(names))
    cells = row.cells
    length, segments = (cells[2], cells[3]) if old else (cells[4], cells[5])
    ends = tuple(_end(source, row, cell) for cell in (cells[4:6] if old else cells[2:4]))
    unstretched = source.number(row, length, "unstretched length (m)")
    if unstretched == 0.0:
        source.complain("unstretched length (m)", length, "a number other than 0", "check the columns", row.line)
    if cells[6] != "-":
        why = "output flags of a line; hybrid keeps position, velocity, tension along the whole cable"
        instead = "output.points and output.every say where and how often"
        notes.append(Note(NOT_NEEDED, row.line, f"output flags {cells[6]} of line {cells[0]}", why, instead))
    count = source.integer(row, segments, "NumSegs", 1)
    return Line(source.integer(row, cells[0], "ID", 1), row, cells[1], (ends[0], ends[1]), unstretched, count)


def _end(source: Source, row: Row, cell: str) -> tuple[str, int, str]:
    word = cell.upper()
    if point := re.fullmatch(r"(?:P|POINT|C|CON)?(\d{1,8})", word):
        return "point", int(point[1]), ""
    if rod := re.fullmatch(r"R(?:OD)?(\d{1,8})([AB])", word):
        return "rod", int(rod[1]), rod[2]
    source.complain("attachment", cell, "the ID of a point, such as 2, or the end of a rod, such as R1A", "", row.line)
    return "point", 0, ""


# --- do the tables hold together ---------------------------------------------------------------


def _hold_together(source: Source, deck: Deck) -> None:
    """Complain of what points to a row that is not there; a row that is there and wrong is complained of already."""
    names = [row.cells[0] for row in source.rows("line types")]
    count = {kind: len(source.rows(f"{kind}s")) for kind in ("point", "rod")} | {"body": len(source.rows("bodies"))}
    for line in deck.lines.values():
        if line.type not in names:
            expected = f"a name of LINE TYPES: {', '.join(names)}"
            source.complain("line type", line.type, expected, did_you_mean(line.type, names), line.row.line)
        for kind, id, _ in line.ends:
            _check_number(source, line.row, kind, id, count[kind])
    things: list[Point | Rod] = [*deck.points.values(), *deck.rods.values()]
    for thing in things:
        if thing.kind.startswith("body"):
            _check_number(source, thing.row, "body", thing.on, count["body"])


def _check_number(source: Source, row: Row, kind: str, id: int, count: int) -> None:
    if not 1 <= id <= count:
        expected = f"a {kind} that is there: " + (f"1 to {count}" if count else "there is none")
        fix = "check the columns of this row" if count else f"add its section, {TITLES[_PLURAL[kind]][0]}"
        source.complain(f"{kind} {id}", row.text, expected, fix, row.line)
