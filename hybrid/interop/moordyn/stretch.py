"""EA and BA of a line type: a number, a table of tension over strain in a file, a static and a dynamic stiffness.

MoorDyn                        hybrid                                    because
EA_s|EA_d, BA_s|BA_d           axial_stiffness = EA_s,                   slow spring EA_1, 1/EA_1 = 1/EA_s - 1/EA_d,
                               dynamic_stiffness.constant = EA_d,        beside BA_s, in series with EA_d beside BA_d
                               .relaxation_time = BA_s/EA_1,
                               damping.stiffness = BA_d/EA_d
EA_s|alpha MBL|beta            .constant = alpha MBL, .per_tension       EA_d grows with the force of the slow spring
a file                         tension_strain                            rows of strain and tension after the header
SYROPE:file|alpha|beta         syrope, dynamic_stiffness                 hybrid.interop.moordyn.syrope
"""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from hybrid.interop.moordyn.notes import DIFFERS, LEFT_OUT, TAKEN, Note, note
from hybrid.interop.moordyn.rows import Row, Source, number
from hybrid.interop.moordyn.syrope import OTHER, WORD, Polyester, first_row_is_lost, settings, shape_of

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
