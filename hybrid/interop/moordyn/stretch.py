"""EA and BA of a line type: a number, a table of tension over strain in a file, a static and a dynamic stiffness.

MoorDyn                        hybrid                                    because
EA_s|EA_d, BA_s|BA_d           axial_stiffness = EA_s,                   slow spring EA_1, 1/EA_1 = 1/EA_s - 1/EA_d,
                               dynamic_stiffness.constant = EA_d,        beside BA_s, in series with EA_d beside BA_d
                               .relaxation_time = BA_s/EA_1,
                               damping.stiffness = BA_d/EA_d
EA_s|alpha MBL|beta            .constant = alpha MBL, .per_tension       EA_d grows with the force of the slow spring
a file                         tension_strain                            rows of strain and tension after the header
SYROPE:file|alpha|beta         syrope, dynamic_stiffness                 below
"""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from hybrid.interop.moordyn.rows import DIFFERS, LEFT_OUT, TAKEN, Note, Row, Source, note, number
from hybrid.scene.section_laws import Curve, DynamicStiffness, syrope_of

# Polyester of a deck: EA = SYROPE:file|alpha|beta, the file with its curves, the rows of SYROPE IC.
#
# MoorDyn                          hybrid                              because
# OWC, WCType, k1, k2 of the file  syrope: curve, working, k1, k2      as MoorDyn, which joins 30 points of them
# Tmax of the line                 syrope.highest_tension
# alpha, beta                      dynamic_stiffness.constant,         there ln(1 + beta T/alpha)/beta,
#                                  .per_tension                        equal to first order about the mean tension
# BA_s                             .relaxation_time, BA_s (ds/dT -     of a dashpot beside curve less fast strain,
#                                  1/E) at Tmean                       at the mean tension of the start

WORD = "SYROPE:"
WORKING = {"LINEAR": "linear", "QUADRATIC": "quadratic", "EXP": "exponential"}
KEYS = ("owc", "wctype", "k1", "k2")
READ_FROM = 3  # line of a table of an original curve from which on MoorDyn 2.7.2 reads, less one
LARGEST_SYROPE = 100_000  # bytes of a file
OTHER = "write EA_s|EA_d at the mean tension you expect, in a copy of the deck"


class Polyester(NamedTuple):
    """What a line type says of polyester; fast: alpha and beta; slow: BA_s, N s."""

    curve: Curve
    shape: dict[str, Any]  # working, k1, k2 as of a scene
    fast: tuple[float, float]
    slow: float


class Past(NamedTuple):
    """A row of SYROPE IC, of one line: its highest and its present mean tension, N."""

    row: Row
    highest: float
    mean: float


def settings(source: Source, row: Row, name: str) -> dict[str, str] | None:
    """The cells of a file of Syrope settings beside the deck, by KEYS; None: there is no such file."""
    path = Path(source.file).parent / name
    try:
        if not path.is_file() or path.stat().st_size > LARGEST_SYROPE:
            return None
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None
    found = {}
    for line in text.splitlines():
        cells = line.split()
        if len(cells) > 1 and cells[1].lower() in KEYS:
            found[cells[1].lower()] = cells[0]
    for key in KEYS:
        if key not in found:
            fix = "a row of each: value, then OWC, WCType, k1 or k2"
            source.complain(name, f"no {key}", "rows of OWC, WCType, k1 and k2, as MoorDyn asks for", fix, row.line)
            return {}
    return found


def shape_of(source: Source, row: Row, name: str, found: dict[str, str]) -> dict[str, Any] | None:
    """Working curves as a scene has them; None after a complaint."""
    if found["wctype"].upper() not in WORKING:
        source.complain(name, found["wctype"], "LINEAR, QUADRATIC or EXP", "check WCType", row.line)
        return None
    shape: dict[str, Any] = {"working": WORKING[found["wctype"].upper()]}
    for key in ("k1", "k2"):
        value = number(found[key])
        if value is None or value < 0.0:
            source.complain(name, f"{found[key]} {key}", "a number, >= 0", f"check {key}", row.line)
            return None
        if key == "k1" or shape["working"] != "linear":
            shape[key] = value
    return shape


def first_row_is_lost(source: Source, name: str) -> bool:
    """Whether a table beside the deck begins in its third line: MoorDyn 2.7.2 does not read that, whatever it holds."""
    text = (Path(source.file).parent / name).read_text(encoding="utf-8")
    numbers = [all(number(cell) is not None for cell in line.split()) for line in text.splitlines()]
    return numbers.index(True) == READ_FROM - 1


def pasts_of(source: Source, syrope: set[int], notes: list[Note]) -> dict[int, Past]:
    """The rows of SYROPE IC by the IDs of the lines, of which `syrope` are of polyester."""
    found: dict[int, Past] = {}
    for row in source.rows("syrope"):
        if len(row.cells) < 3:
            source.complain("SYROPE IC", row.text, "lines, Tmax and Tmean", "write one row for each line", row.line)
            continue
        *ids, top, mean = row.cells
        highest = source.number(row, top, "Tmax (N)", above=0.0)
        past = Past(row, highest, source.number(row, mean, "Tmean (N)", least=0.0))
        for cell in filter(None, re.split(r"[\s,]+", " ".join(ids))):
            id = source.integer(row, cell, "ID of a line", 1)
            found[id] = past
            if id not in syrope:
                notes.append(note(LEFT_OUT, row, f"line {id} is not of a line type with EA = {WORD}..."))
    return found


def tables_of(rope: Polyester, past: Past, notes: list[Note]) -> tuple[dict[str, Any], dict[str, Any]] | str:
    """`syrope` and `dynamic_stiffness` of a section; or why there are none."""
    constant, grows = rope.fast
    fast = DynamicStiffness(constant=constant, per_tension=grows, relaxation_time=1.0)
    given = rope.shape | {"curve": rope.curve, "highest_tension": past.highest}
    known = syrope_of(given)
    fault = known.first_fault(fast) if not isinstance(known, str) else None
    if fault is not None and rope.curve[fault[0]][1] >= past.highest:  # from the piece on that begins there
        given["curve"] = rope.curve[: fault[0] + 1]
        known = syrope_of(given)
        fault = known.first_fault(fast) if not isinstance(known, str) else None
        most = given["curve"][-1][1]
        why = f"its curve is taken up to {most:g} N: beyond, it would give back more than it took up, or be stiffer "
        notes.append(note(TAKEN, past.row, f"{why}than alpha + beta T"))
    if isinstance(known, str):
        return f"Tmax of {past.highest:g} N: {known}"
    if fault is not None:
        return f"its working curve below Tmax of {past.highest:g} N cannot be: expected {fault[1].expected}"
    mean = min(past.mean, past.highest)
    soft = known.compliance(mean) - 1.0 / (constant + grows * mean)
    why = "MoorDyn's rope relaxes at a rate that changes with its tension; relaxation_time is that at Tmean"
    instead = "where tensions pass Tmax for long, give the longer one of the original curve, BA_s (ds/dT - 1/E) there"
    notes.append(note(DIFFERS, past.row, why, instead))
    if past.mean > 0.0:
        why = "the tension at the start is that of the equilibrium, whatever Tmean is"
        notes.append(note(TAKEN, past.row, why))
    dynamic = {"constant": constant} | ({"per_tension": grows} if grows else {}) | {"relaxation_time": rope.slow * soft}
    return given, dynamic


# EA and BA of a line type: a number, a table of tension over strain in a file, a static and a dynamic stiffness.

LARGEST, MOST_ROWS = 1_000_000, 1000  # bytes of a file; rows of a table
FIX = "two lines of names and units, then rows of strain and tension (N), both rising"


class Stretch(NamedTuple):
    """How a line type stretches.  trouble: why it cannot be carried over, "" if it can."""

    ea: float = math.nan  # N, static; of a table that of its stiffest piece
    ba: float = 0.0  # N s; negative: a part of critical damping
    table: tuple[tuple[float, float], ...] | None = None  # strain and tension, N
    dynamic: dict[str, float] | None = None  # as in a scene
    trouble: str = ""
    instead: str = ""
    polyester: Polyester | None = None  # of which the past of each line makes tables of a scene


def is_word(cell: str) -> bool:
    """Whether a cell that may be a number names a file, or lists several numbers."""
    return number(cell) is None and bool(re.search(r"[A-Za-z]{2}|\|", cell)) and cell.lower() not in ("nan", "inf")


def stretch_of(source: Source, row: Row, ea: str, ba: str, notes: list[Note]) -> Stretch:
    """What the cells EA and BA of a row stand for."""
    parts = ea.split("|")
    if parts[0].upper().startswith(WORD):
        return _polyester(source, row, parts, ba, notes)
    table = None
    if is_word(parts[0]):
        table = _table(source, row, parts[0], notes)
        if table is None:
            instead = "put the file beside the deck, or write EA as a number, in N, in a copy of the deck"
            return Stretch(trouble=f"EA is not one number but {ea}, tension over strain", instead=instead)
        static = max((U - T) / (y - x) for (x, T), (y, U) in pairwise(table))
    else:
        static = source.number(row, parts[0], "EA (N)", above=0.0)
    if len(parts) == 1:
        return Stretch(static, _damping(source, row, ba, notes), table)
    if len(parts) > 3:
        source.complain("EA", ea, "EA_s|EA_d, or EA_s|alpha MBL|beta", "write at most three numbers", row.line)
        return Stretch(static)
    return _rope(source, row, parts, ba, Stretch(static, 0.0, table), notes)


def _polyester(source: Source, row: Row, parts: list[str], ba: str, notes: list[Note]) -> Stretch:
    """A rope of polyester (Syrope)."""
    name = parts[0][len(WORD) :]
    if len(parts) != 3:
        source.complain("EA", "|".join(parts), f"{WORD}file|alpha|beta", "write three parts", row.line)
        return Stretch(1.0)
    found = settings(source, row, name)
    if found is None:
        return Stretch(trouble=f"EA names {name}, which cannot be read beside the deck", instead=OTHER)
    shape = shape_of(source, row, name, found) if found else None
    table = _table(source, row, found["owc"], notes) if shape is not None else None
    if shape is None or table is None:
        trouble = f"{name} names no curve that can be read beside the deck"
        return Stretch(trouble=trouble, instead="put the table that its row OWC names beside the deck")
    if first_row_is_lost(source, found["owc"]):
        why = f"MoorDyn 2.7.2 leaves out the first row of {found['owc']}, and counts k1 from the strain of its second"
        notes.append(note(DIFFERS, row, why, "put a third line before the rows, which it skips, too"))
    constant = source.number(row, parts[1], "alpha (N)", above=0.0)
    grows = source.number(row, parts[2], "beta", least=0.0)
    ba_s, ba_d = _two_dampings(source, row, ba, notes)
    if not ba_s > 0.0:
        trouble = f"BA is {ba}: without damping of the slow spring, in N s, nothing says how fast the rope creeps"
        return Stretch(trouble=trouble, instead="write BA_s|BA_d in N s")
    static = max((U - T) / (y - x) for (x, T), (y, U) in pairwise(table))
    return Stretch(static, ba_d, polyester=Polyester(table, shape, (constant, grows), ba_s))


def _two_dampings(source: Source, row: Row, ba: str, notes: list[Note]) -> tuple[float, float]:
    """BA_s and BA_d, N s, of a rope with two springs."""
    slow, *rest = ba.split("|")
    ba_s = source.number(row, slow, "BA_s (N s)")
    ba_d = source.number(row, rest[0], "BA_d (N s)") if rest else 0.0
    if ba_d < 0.0:
        notes.append(note(LEFT_OUT, row, f"BA_d is {ba_d:g}", "set damping.stiffness, BA_d/EA_d, in s"))
        ba_d = 0.0
    return ba_s, ba_d


def _rope(source: Source, row: Row, parts: list[str], ba: str, at_rest: Stretch, notes: list[Note]) -> Stretch:
    """A rope with a dynamic stiffness beside the static one."""
    fast = source.number(row, parts[1], "EA_d (N)" if len(parts) == 2 else "alpha MBL (N)", above=0.0)
    grows = source.number(row, parts[2], "beta", least=0.0) if len(parts) == 3 else 0.0
    static = at_rest.ea
    if fast <= static:
        expected = f"a dynamic stiffness above the static one, {static:g} N"
        source.complain("EA", parts[1], expected, "are the two exchanged?", row.line)
        return at_rest
    ba_s, ba_d = _two_dampings(source, row, ba, notes)
    if not ba_s > 0.0:
        why = f"BA is {ba}: without damping of the slow spring, in N s, nothing says how fast the rope creeps"
        notes.append(note(TAKEN, row, f"{why}; static EA alone is taken", "write BA_s|BA_d in N s"))
        return at_rest
    rope = {"constant": fast, "relaxation_time": ba_s * (fast - static) / (static * fast)}
    if grows:
        rope["per_tension"] = grows
        why = "MoorDyn's slow spring stiffens with its force, so that the rope relaxes faster under load; hybrid's "
        notes.append(note(DIFFERS, row, why + "relaxation_time is that without load", ""))
    return at_rest._replace(ba=ba_d, dynamic=rope)


def _damping(source: Source, row: Row, cell: str, notes: list[Note]) -> float:
    """BA of a line with one stiffness."""
    if not is_word(cell):
        return source.number(row, cell, "BA/-zeta")
    first, *rest = cell.split("|")
    if rest and number(first) is not None:
        why = f"of {cell} the first, static BA is taken: EA has no dynamic part"
        notes.append(note(TAKEN, row, why, "set damping.stiffness (s) otherwise"))
        return source.number(row, first, "BA/-zeta")
    notes.append(note(LEFT_OUT, row, f"BA is read from {cell}", "set damping.stiffness, BA/EA, in s"))
    return 0.0


def _table(source: Source, row: Row, name: str, notes: list[Note]) -> tuple[tuple[float, float], ...] | None:
    """Strain and tension (N) in a file beside the deck; None: there is none, or it says something else."""
    path = Path(source.file).parent / name.strip('"')
    try:
        if not path.is_file():
            return None
        text = path.read_text(encoding="utf-8") if path.stat().st_size <= LARGEST else ""
    except (OSError, ValueError):
        return None

    def wrong(expected: str, line: int | None = None, given: str = "") -> None:
        where = f"{name}, line {line}" if line is not None else name
        source.complain("EA", f"{where}{': ' + given if given else ''}", expected, FIX, row.line)

    found: list[tuple[float, float]] = []
    for k, line in enumerate(text.splitlines(), start=1):
        cells = [number(cell) for cell in re.split(r"[\s,]+", line.strip()) if cell]
        if not cells or (None in cells and not found):  # what stands before the table
            continue
        x, y = (*cells, None, None)[:2]
        if x is None or y is None or (found and not (x > found[-1][0] and y > found[-1][1])) or x < 0.0 or y < 0.0:
            wrong("strain and tension, both above those of the row before", k, line)
            return None
        if k <= 2 and not found:
            wrong("two lines before the table, which MoorDyn skips without reading", k, line)
        found.append((x, y))
    if found and found[0] != (0.0, 0.0):
        if found[0][0] == 0.0 or found[0][1] == 0.0:
            wrong("a table that begins with 0 0")
            return None
        notes.append(note(TAKEN, row, f"{name}: tension rises from 0 at no strain to its first row", ""))
        found.insert(0, (0.0, 0.0))
    if not 2 <= len(found) <= MOST_ROWS:
        wrong(f"2 to {MOST_ROWS} rows of strain and tension")
        return None
    return tuple(found)
