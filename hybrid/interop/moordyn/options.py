"""OPTIONS of a deck: what acts on the lines is read, the rest is sorted by what it concerns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from hybrid.interop.moordyn.rows import LEFT_OUT, NOT_NEEDED, TAKEN, Note, Row, Source, note, number
from hybrid.scene.base import nearest
from hybrid.scene.depths import MOST_POINTS

# A seafloor file of MoorDyn: numbers of x and y, the x, the y, then a row x y z for every point; z is negative.

FIX = "line 1 has the numbers of x and y, line 2 the x, line 3 the y, each further one x y z with z < 0"
LARGEST = 50_000_000  # bytes


class Seafloor(NamedTuple):
    """Depths (m) under z = 0 at x and y (m): a row for each x."""

    x: list[float]
    y: list[float]
    depth: list[list[float]]
    row: Row


def read_seafloor(source: Source, row: Row, name: str) -> Seafloor | None:
    """The file that a row of the deck names, relative to the deck; complains of what it does not understand.

    None also if there is no such file.
    """

    def wrong(expected: str, line: int | None = None, given: str = "") -> None:
        where = f"{name}, line {line}" if line is not None else name
        source.complain("SeafloorFile", f"{where}{': ' + given if given else ''}", expected, FIX, row.line)

    path = Path(source.file).parent / name
    try:
        if not path.is_file():
            return None
        if path.stat().st_size > LARGEST:
            wrong(f"a file of at most {LARGEST / 1e6:g} MB")
            return None
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        wrong("a text file")
        return None
    table = [[number(cell) for cell in line.split()] for line in lines]
    while table and not table[-1]:
        table.pop()
    head = [[x for x in cells if x is not None] for cells in table[:3]]
    if len(table) < 4 or any(len(a) != len(b) for a, b in zip(head, table, strict=False)) or len(head[0]) != 2:
        wrong("at least four lines of numbers")
        return None
    (n, m), x, y = head
    if not 4 <= n * m <= MOST_POINTS or [len(x), len(y)] != [n, m] or x != sorted(set(x)) or y != sorted(set(y)):
        wrong(f"{n:g} rising x in line 2 and {m:g} rising y in line 3")
        return None
    depth: list[list[float | None]] = [[None] * len(y) for _ in x]
    for k, cells in enumerate(table[3:], start=4):
        if not cells:
            continue
        if len(cells) != 3 or any(c is None for c in cells):
            wrong("three numbers x y z", k, lines[k - 1])
            return None
        a, b, z = (c or 0.0 for c in cells)
        if a not in x or b not in y or not z < 0.0:
            wrong("an x of line 2, a y of line 3 and a height below 0", k, lines[k - 1])
            return None
        depth[x.index(a)][y.index(b)] = -z
    if any(d is None for of_x in depth for d in of_x):
        wrong(f"a height for each of the {len(x)} x {len(y)} points; MoorDyn takes 0 for those that are missing")
        return None
    return Seafloor(x, y, [[d or 0.0 for d in of_x] for of_x in depth], row)


# OPTIONS of a deck: what acts on the lines is read, the rest is sorted by what it concerns.

# What MoorDyn takes where a deck gives nothing: measured with MoorDyn 2.7 (bench/test_moordyn_measured.py).
GRAVITY = 9.80665  # m/s^2
DENSITY = 1025.0  # kg/m^3, of the water
BED_STIFFNESS = 3.0e6  # Pa/m
BED_DAMPING = 3.0e5  # Pa s/m

# Numbers that are read, by the names that versions of MoorDyn know, in lower case; and what each must be at least.
_READ: dict[str, tuple[str, ...]] = {
    "gravity": ("g", "gravity"),
    "density": ("rho", "rhow", "wtrdnsty"),
    "depth": ("wtrdpth",),
    "bed_stiffness": ("kbot", "kb"),
    "bed_damping": ("cbot", "cb"),
    "friction": ("frictioncoefficient",),
    "friction_across": ("mu_kt",),
    "friction_along": ("mu_ka",),
}
_FIELD = {name: field for field, names in _READ.items() for name in names}

_STEPS = ("a setting of MoorDyn's time steps", "time.step, or accuracy, sets how finely hybrid steps")
_REST = (
    "a setting of MoorDyn's search for the rest; hybrid solves for it (initial: equilibrium)",
    "hybrid static SCENE.yaml shows it",
)
_OUTPUT = ("a setting of MoorDyn's own output", "output.every sets how often results are kept")
_SLIDING = ("it blurs MoorDyn's friction; hybrid's holds and slides without it", "")
_UNUSED: dict[str, tuple[str, str]] = (
    dict.fromkeys(("dtm", "dt", "cfl", "tscheme", "inertialf", "inertialf_rampt"), _STEPS)
    | dict.fromkeys(("dtic", "icdt", "tmaxic", "ictmax", "cdscaleic", "icdfac", "threshic", "icthresh"), _REST)
    | {"icgendynamic": _REST}
    | dict.fromkeys(("writelog", "writeunits", "dtout", "disableoutput", "disableouttime", "outswitch"), _OUTPUT)
    | dict.fromkeys(("fricdamp", "cv", "statdynfricscale", "mc"), _SLIDING)
    | dict.fromkeys(("dtwave", "unifycurrentgrid", "wavekin_rampt"), ("a setting of MoorDyn's grid of waves", ""))
)

# What acts, and has another form in a scene; a value of 0 means none.
_ELSEWHERE: dict[str, tuple[str, str]] = {
    "wavekin": ("waves of MoorDyn come from files or from the calling program", "give environment.fluid.waves"),
    "currents": ("currents of MoorDyn come from files", "give environment.fluid.current, a list of {z, velocity}"),
    "waterkin": ("waves and currents of MoorDyn-F come from a file", "give environment.fluid.waves and .current"),
}
_NAMES = (*_FIELD, *_UNUSED, *_ELSEWHERE, "seafloorfile")


@dataclass
class Options:
    """What surrounds the lines; None where the deck gives nothing.  rows: where each was given."""

    rows: dict[str, Row]
    gravity: float = GRAVITY
    density: float = DENSITY
    depth: float | None = None
    bed_stiffness: float = BED_STIFFNESS
    bed_damping: float = BED_DAMPING
    friction: float = 0.0
    friction_across: float = 0.0
    friction_along: float = 0.0
    seafloor: Seafloor | None = None


def read_options(source: Source, notes: list[Note]) -> Options:
    """The options; of one that is given twice the last, as in MoorDyn."""
    found = Options({})
    for row in source.rows("options"):
        if len(row.cells) < 2:
            notes.append(note(LEFT_OUT, row, "not a value and a name, such as 9.81 g; MoorDyn ignores it"))
            continue
        value, name = row.cells[0].strip("\"'"), row.cells[1].lower()
        if name not in _NAMES and row.cells[0].lower() in _NAMES:
            fix = f"write {row.cells[1]} {row.cells[0]}"
            source.complain(row.cells[0], row.text, "the value first, then the name", fix, row.line)
        elif name in _FIELD:
            _read(source, row, _FIELD[name], value, found, notes)
        elif name in _UNUSED:
            notes.append(note(NOT_NEEDED, row, *_UNUSED[name]))
        elif name == "seafloorfile":
            found.seafloor = read_seafloor(source, row, value)
            if found.seafloor is not None:
                why = "MoorDyn has straight lines between the depths, hybrid a smooth bed through them"
                notes.append(note(TAKEN, row, why, "a finer grid makes both alike"))
            elif not source.complaints:
                fix = "put the file there, or give environment.seabed.depths"
                notes.append(note(LEFT_OUT, row, "the depths are in a file that is not beside the deck", fix))
        elif name in _ELSEWHERE:
            if number(value) != 0.0 and value:
                notes.append(note(LEFT_OUT, row, *_ELSEWHERE[name]))
        else:
            why = f"no option of MoorDyn that is known here is called {row.cells[1]}"
            notes.append(note(LEFT_OUT, row, why, nearest(name, _NAMES)))
    _plausible(source, found)
    return found


def _read(source: Source, row: Row, field: str, value: str, found: Options, notes: list[Note]) -> None:
    if field == "depth" and number(value) is None and any(c.isalpha() for c in value) and value.lower() != "nan":
        why = "the depth is read from a file of MoorDyn-F"
        notes.append(note(LEFT_OUT, row, why, "give environment.seabed.depths, as a CSV file with columns x,y,depth"))
        return
    if field in found.rows:
        first = found.rows[field].line
        notes.append(note(TAKEN, row, f"given in line {first} as well; the last one counts, as in MoorDyn"))
    found.rows[field] = row
    setattr(found, field, source.number(row, value, row.cells[1], least=0.0))


def _plausible(source: Source, options: Options) -> None:
    """Complain of values that only another unit explains."""
    row = options.rows.get("density")
    if row is not None and 0.9 <= options.density <= 1.1:  # between these neither water nor air has any kg/m^3
        expected = "a density in kg/m^3: about 1025 for sea water, 1.2 for air"
        source.complain("density", row.text, expected, "t/m^3? write 1025", row.line)
    row = options.rows.get("gravity")
    if row is not None and options.gravity > 100.0:  # ten times that of the earth
        expected = "an acceleration in m/s^2, such as 9.81"
        source.complain("gravity", row.text, expected, "cm/s^2? write 9.81", row.line)
