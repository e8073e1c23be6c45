"""The text of a MoorDyn deck as tables and options.

Rows know their line, cells know what they should be.  A deck is a row of sections, each begun by a line of dashes with
a title.  A table has a row of column names and one of units, which MoorDyn skips without reading them; then a row for
each thing.  What follows !, # or % is a comment.

Of the OPTIONS of a deck, what acts on the lines is read, the rest is sorted by what it concerns.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from hybrid.errors import Complaint, SceneError
from hybrid.scene.base import nearest
from hybrid.scene.sea import MOST_POINTS

# Titles by which MoorDyn 1 and 2 know a section, and older words for the same.
TITLES: dict[str, tuple[str, ...]] = {
    "line types": ("LINE TYPES", "LINE DICTIONARY"),
    "rod types": ("ROD TYPES", "ROD DICTIONARY"),
    "bodies": ("BODIES", "BODY LIST", "BODY PROPERTIES"),
    "rods": ("RODS", "ROD LIST", "ROD PROPERTIES"),
    "points": tuple(f"{x}{y}" for x in ("POINT", "CONNECTION", "NODE") for y in ("S", " LIST", " PROPERTIES")),
    "lines": ("LINES", "LINE LIST", "LINE PROPERTIES"),
    "syrope": ("SYROPE IC",),
    "failure": ("FAILURE", "FAILURES"),
    "control": ("CONTROL", "CONTROLS"),
    "external loads": ("EXTERNAL LOADS",),
    "options": ("OPTIONS", "SOLVER OPTIONS"),
    "outputs": ("OUTPUTS", "OUTPUT"),
}
_SECTIONS = {title: name for name, titles in TITLES.items() for title in titles}
# A title, with or without a remark beside it; the longest that fits: LINE TYPES are no LINES.
_TITLE = re.compile(rf"\b({'|'.join(sorted(_SECTIONS, key=len, reverse=True))})\b")
_ENDS = ("", "NEED THIS LINE", "END")
_TABLES = tuple(name for name in TITLES if name not in ("options", "outputs"))
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")
# MoorDyn 1 of OpenFAST writes the number of rows before a table: "3  NLines  - number of lines".
_COUNT = re.compile(r"\s*\d+\s+N(types|connects|conns|points|lines)\b", re.IGNORECASE)
SHOWN = 70  # characters of a row that a complaint or a note shows
# No quantity of a cable in SI units is larger, and none that must not vanish is smaller than its inverse; squares of
# what is accepted are then finite, too.
LARGEST = 1e15
# Of a row of names or units fewer cells are numbers; with three or more it is one of the data.
FEW_NUMBERS = 3
# Of a title and one that MoorDyn knows (ratio of difflib): LINSE is LINES, SHIP TYPES is not LINE TYPES.
MISSPELT = 0.79


@dataclass(frozen=True)
class Row:
    """A row of a table: its line in the deck (from 1), its text without comment, its cells."""

    line: int
    text: str
    cells: tuple[str, ...]

    @property
    def shown(self) -> str:
        return show(self.text)


@dataclass
class Section:
    """A section of the deck: its title's line, the names of its columns as written, its rows."""

    name: str
    title: str
    line: int
    names: Row | None = None
    rows: list[Row] = field(default_factory=list)


def show(text: str) -> str:
    """Text on one line, printable, and not too long."""
    clean = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return clean if len(clean) <= SHOWN else clean[: SHOWN - 4] + " ..."


class Source:
    """A deck as sections, and the complaints about it so far."""

    def __init__(self, text: str, file: str) -> None:
        self.file = file
        self.complaints: list[Complaint] = []
        self.fortran: list[Row] = []  # rows with an exponent that only Fortran reads
        self.by_place: list[tuple[Row, str]] = []  # rows that are read by place, whatever their names or length; why
        self.sections: dict[str, Section] = {}
        self.unknown: list[Section] = []
        self.misspelt: set[str] = set()  # sections whose title is not as MoorDyn knows it
        self.lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        self._cut()

    def complain(self, where: str, value: str, expected: str, fix: str, line: int | None) -> None:
        self.complaints.append(Complaint(where, show(value) or "nothing", expected, fix, line))

    def refuse(self) -> None:
        """SceneError with every complaint, if there is one."""
        if self.complaints:
            once = list(dict.fromkeys(self.complaints))
            raise SceneError(sorted(once, key=lambda c: (c.line is None, c.line or 0)), self.file)

    def rows(self, name: str) -> list[Row]:
        section = self.sections.get(name)
        return section.rows if section is not None else []

    def columns(self, row: Row, least: int, most: int, names: Sequence[tuple[str, ...]]) -> bool:
        """Whether a row has at least `least` cells; complains if not.  Beyond `most` MoorDyn reads none."""
        n = len(row.cells)
        if n > most:
            self.by_place.append((row, f"of {n} columns the first {most} are read, as MoorDyn does"))
        if n >= least:
            return True
        counted = f"{least}" if least == most else f"{least} to {most}"
        order = " ".join(each[0] for each in names[:least])
        fix = "write 0 where there is nothing, - where there is no word"
        self.complain(f"{n} columns", row.text, f"{counted} columns: {order}", fix, row.line)
        return False

    # --- cells ---------------------------------------------------------------------------------

    def number(self, row: Row, cell: str, what: str, least: float | None = None, above: float | None = None) -> float:
        """A cell as a finite number, not below `least`, greater than `above`; NaN after a complaint."""
        value = number(cell)
        bounds = f", >= {least:g}" if least is not None else f", > {above:g}" if above is not None else ""
        if value is None:
            fix = "write it with a point: " + cell.replace(",", ".") if number(cell.replace(",", ".")) else ""
            if cell.lower().lstrip("+-") in ("nan", "inf", "infinity"):
                fix = "the program that wrote the deck may have failed there"
            self.complain(what, cell, f"a finite number{bounds}", fix or "check the columns of this row", row.line)
            return math.nan
        if "d" in cell.lower():
            self.fortran.append(row)
        if abs(value) > LARGEST:
            self.complain(what, cell, f"a number of at most {LARGEST:g} in size", "check the unit", row.line)
            return math.nan
        if (least is not None and value < least) or (above is not None and value <= above + 1.0 / LARGEST):
            self.complain(what, cell, f"a number{bounds}", "check the sign, and the columns of this row", row.line)
            return math.nan
        return value

    def integer(self, row: Row, cell: str, what: str, least: int) -> int:
        """A cell as a whole number, not below `least`; `least` after a complaint."""
        if cell.isascii() and cell.isdigit() and len(cell) < 9 and int(cell) >= least:
            return int(cell)
        self.complain(what, cell, f"a whole number, >= {least}", "check the columns of this row", row.line)
        return least

    # --- sections ------------------------------------------------------------------------------

    def _cut(self) -> None:
        current: Section | None = None
        self.begun = {_named(_title(text).upper()) for text in self.lines if "---" in text}
        for n, text in enumerate(self.lines, start=1):
            if "---" in text:
                current = self._begin(text, n)
            elif current is not None and text.strip():
                current.rows.append(Row(n, text, tuple(text.split())))
        for n, text in enumerate(self.lines, start=1):
            if _SECTIONS.get(name := " ".join(text.upper().split()), "") not in ("", *self.sections):
                self._misspelt(name, text, n)
        for section in (*self.sections.values(), *self.unknown):
            self._strip(section)

    def _begin(self, text: str, line: int) -> Section | None:
        title = _title(text)
        words = title.upper()
        name = _named(words) or next((x for x in map(_named, _TITLE.findall(words)) if x not in self.begun), "") or None
        near = get_close_matches(words, _SECTIONS, n=1, cutoff=MISSPELT)
        if words not in _SECTIONS and near and _SECTIONS[near[0]] != name and _SECTIONS[near[0]] not in self.sections:
            self._misspelt(near[0], text, line)
            return None
        if name is None:
            if not self.sections or words in _ENDS:
                return None
            self.unknown.append(Section("", title, line))
            return self.unknown[-1]
        if name in self.sections:
            first = self.sections[name].line
            expected = f"each section once; this one began in line {first}, and MoorDyn reads only the first"
            self.complain(title, text, expected, "put its rows together", line)
            return None
        self.sections[name] = Section(name, title, line)
        return self.sections[name]

    def _misspelt(self, title: str, text: str, line: int) -> None:
        self.misspelt.add(_SECTIONS[title])
        expected = "the title of a section that MoorDyn knows, between dashes"
        self.complain(title, text, expected, f"write ------- {title} -------", line)

    def _strip(self, section: Section) -> None:
        """Take away names, units and comments."""
        rows = section.rows
        if section.name in _TABLES:
            if rows and _COUNT.match(rows[0].text):
                rows = rows[1:]
            head, rows = rows[:2], rows[2:]
            for row in head:
                cells = _uncommented(row).cells
                if sum(number(cell) is not None for cell in cells) >= FEW_NUMBERS:
                    expected = "a row of column names and a row of units; MoorDyn skips two rows without reading them"
                    self.complain(section.title, row.text, expected, "write both rows under the title", row.line)
            section.names = head[0] if head else None
        section.rows = [clean for clean in map(_uncommented, rows) if clean.cells]


def _title(text: str) -> str:
    return show(text.strip(" \t-=:*"))


def _named(words: str) -> str:
    """The section with whose title, in capitals, some words begin; "" if there is none."""
    found = _TITLE.match(words)
    return _SECTIONS[found[1]] if found else ""


def _uncommented(row: Row) -> Row:
    text = re.split(r"[!#%]", row.text, maxsplit=1)[0]
    return Row(row.line, text, tuple(text.split()))


def number(cell: str) -> float | None:
    """The finite number in a cell, Fortran's 1.0D+8 included; None if there is none."""
    if not _NUMBER.fullmatch(cell) or not cell.isascii():
        return None
    value = float(cell.lower().replace("d", "e"))
    return value if math.isfinite(value) else None


def read_source(path: str | Path) -> Source:
    """The sections of a deck; SceneError if it cannot be read."""
    try:
        raw = Path(path).read_bytes()
    except (OSError, ValueError):
        expected = "a MoorDyn input file that exists and can be read"
        raise SceneError([Complaint("deck", show(str(path)), expected, "check the name and the folder")]) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # m³ and ° of older editors; they stand in comments and units
    return Source(text, str(path))


def simple(name: str) -> str:
    """The name of a column without case and signs: BA/-zeta is bazeta."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def check_names(source: Source, section: str, columns: Sequence[tuple[str, ...]], least: int) -> None:
    """Note columns that are named otherwise than MoorDyn reads them, which is by place.

    columns: the names that are usual for each place, in `simple` form, the first for messages; `least` must be there.
    """
    names = source.sections[section].names
    if names is None or not least <= len(names.cells) <= len(columns):
        return  # names of several words, or a row of another kind: nothing can be checked
    where = {name: i for i, usual in enumerate(columns) for name in usual}
    moved = [i for i, cell in enumerate(names.cells) if where.get(simple(cell), i) != i]
    if moved:
        taken = ", ".join(f"column {i + 1}, {names.cells[i]}, is read as {columns[i][0]}" for i in moved)
        source.by_place.append((names, f"columns are read by place, as MoorDyn does, not by name: {taken}"))


# Notes on a deck beside the scenes made of it.

# Kinds of notes, the weightiest first.
LEFT_OUT = "left out"  # it acts in MoorDyn, and not in the scene
TAKEN = "taken as"  # it acts in the scene in another way than in the deck
DIFFERS = "differs"  # the programs differ whatever the deck gives
NOT_NEEDED = "not needed"  # a setting of MoorDyn's own method
KINDS = (LEFT_OUT, TAKEN, DIFFERS, NOT_NEEDED)


@dataclass(frozen=True)
class Note:
    """What could not be carried over as it stands.

    line: of the deck, from 1; None if it is about no line.  text: as it stands there.  instead: what to do.
    """

    kind: str
    line: int | None
    text: str
    why: str
    instead: str = ""

    def text_in(self, file: str) -> str:
        """The note as errors are written: place and text, then why and what to do."""
        place = f"{file}:{self.line}" if self.line is not None else file
        lines = [f"{place}: {self.kind}{': ' + self.text if self.text else ''}", f"    detail:   {self.why}"]
        if self.instead:
            lines.append(f"    try:      {self.instead}")
        return "\n".join(lines)


def note(kind: str, row: Row, why: str, instead: str = "") -> Note:
    return Note(kind, row.line, row.shown, why, instead)


def in_order(notes: list[Note]) -> tuple[Note, ...]:
    """Every note once; by weight, then by line."""
    return tuple(sorted(dict.fromkeys(notes), key=lambda n: (KINDS.index(n.kind), n.line is None, n.line or 0)))


# A seafloor file of MoorDyn: numbers of x and y, the x, the y, then a row x y z for every point; z is negative.

FIX = "line 1 has the numbers of x and y, line 2 the x, line 3 the y, each further one x y z with z < 0"
LARGEST_FILE = 50_000_000  # bytes


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
        if path.stat().st_size > LARGEST_FILE:
            wrong(f"a file of at most {LARGEST_FILE / 1e6:g} MB")
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
