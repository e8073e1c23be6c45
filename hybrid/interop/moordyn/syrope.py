"""Polyester of a deck: EA = SYROPE:file|alpha|beta, the file with its curves, the rows of SYROPE IC.

MoorDyn                          hybrid                              because
OWC, WCType, k1, k2 of the file  syrope: curve, working, k1, k2      the same formulas; MoorDyn joins 30 points of them
Tmax of the line                 syrope.highest_tension
alpha, beta                      dynamic_stiffness.constant,         there the fast strain is ln(1 + beta T/alpha)/beta,
                                 .per_tension                        equal to first order about the mean tension
BA_s                             .relaxation_time, BA_s (ds/dT -     of a dashpot beside the curve less the fast strain,
                                 1/E) at Tmean                       at the mean tension of the start
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

from hybrid.interop.moordyn.notes import DIFFERS, LEFT_OUT, TAKEN, Note, note
from hybrid.interop.moordyn.rows import Row, Source, number
from hybrid.scene.stretch import Curve, DynamicStiffness
from hybrid.scene.syrope import syrope_of

WORD = "SYROPE:"
WORKING = {"LINEAR": "linear", "QUADRATIC": "quadratic", "EXP": "exponential"}
KEYS = ("owc", "wctype", "k1", "k2")
READ_FROM = 3  # line of a table of an original curve from which on MoorDyn 2.7.2 reads, less one
LARGEST = 100_000  # bytes of a file
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
        if not path.is_file() or path.stat().st_size > LARGEST:
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
            id = source.whole(row, cell, "ID of a line", 1)
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
