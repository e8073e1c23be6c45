"""Line types of a deck: properties per length, in the columns of MoorDyn 2 or 1, and units that cannot be."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hybrid.interop.moordyn.rows import LEFT_OUT, TAKEN, Note, Row, Section, Source, check_names, note, simple
from hybrid.interop.moordyn.stretch import Stretch, is_word, stretch_of
from hybrid.scene.cable import DENSITIES, SECTION_DENSITIES

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
