"""A motion file: a CSV table of times, positions and rotations, read with care; splines through its samples."""

from __future__ import annotations

import math
import os
import stat
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import ResultError, command_for, optional_package
from hybrid.scene.base import Finding, Findings, xyz

Array = NDArray[np.float64]
F = TypeVar("F", bound=Callable[..., Any])

SHIFT_COLUMNS = ("x", "y", "z")
ROTATION_COLUMNS = ("rx", "ry", "rz")  # rotation vector
ANGLE_COLUMNS = ("roll", "pitch", "yaw")
COLUMNS = "t,x,y,z or t,rx,ry,rz or t,roll,pitch,yaw, or t,x,y,z with rx,ry,rz or roll,pitch,yaw"
# deg, by which an angle may change from row to row: more could be a turn the other way.
LARGEST_CHANGE = 90.0

# Bytes: twelve hours of seven columns at 100 Hz take 400 MB, and 12 samples a period of any sea a hundredth of that.
LARGEST_FILE = 200_000_000

# The fewest rows from which the velocity at the start can be estimated.
FEWEST_ROWS = 6

# Numbers of one or two digits are typed by hand and meant exactly; longer ones are rounded.
ROUNDED = 3

# No end of a cable is further away, in m or degrees; larger numbers are typing errors and overflow.
LARGEST = 1e12

# A time step must not miss a bow of more than this part of the range of a record: six steps a period of a harmonic
# bow by 13 %, which is a poor answer but the same motion.
MISSED = 0.15

# What a path may lead to that is no regular file.
_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


class RecordRefused(Exception):
    """The file cannot be used; `finding` is why, relative to the `motion` table."""

    def __init__(self, expected: str, fix: str, given: str | None = None) -> None:
        self.finding = Finding(("file",), expected, fix, given)
        super().__init__(f"{given or 'motion file'}: expected {expected}")


def netcdf_reader(name: str) -> Any:
    """The package xarray, beside h5netcdf by which it reads a file of this name; RecordRefused without them."""
    try:
        optional_package("h5netcdf", "netCDF", "export")
        return optional_package("xarray", "netCDF", "export")
    except ResultError:
        raise RecordRefused("xarray and h5netcdf, which read netCDF", command_for("export"), name) from None


@dataclass(frozen=True)
class Record:
    """Samples of a motion.

    times: (n,) s, increasing; shift: (n, 3) m, inertial, absolute, or None; rotation: (n, 3) rotation vectors in
    degrees, inertial axes, or None; shift_unit, rotation_unit: what the last written digit of every number is worth.
    """

    times: Array
    shift: Array | None
    rotation: Array | None
    shift_unit: Array | None
    rotation_unit: Array | None
    name: str

    def splines(self) -> Iterator[Any]:
        """C2 splines through the shift [m] and the rotation [deg], of those that are there."""
        for values in (self.shift, self.rotation):
            if values is not None:
                yield spline(self.times, values)

    def within(self, end: float) -> Record:
        """The same without what comes after a time (s), but for rows that a spline up to then needs."""
        n = max(int(np.searchsorted(self.times, end)) + 3, FEWEST_ROWS)
        parts = ("times", "shift", "rotation", "shift_unit", "rotation_unit")
        return replace(self, **{x: y[:n] for x in parts if (y := getattr(self, x)) is not None})


def spline(times: Array, values: Array, base: Array | None = None) -> Any:
    """C2 spline through `values`, counted from their value at t = 0 so that no rounding shows as a jump.

    base: what they are counted from instead, of a record that is blended in and need not start from rest.
    """
    from scipy.interpolate import CubicSpline  # slow to import

    if base is not None:
        return CubicSpline(times, values - base)
    # A record that begins with the computation begins from rest (judge_record sees to it).
    start = (1, np.zeros(3)) if times[0] == 0.0 else "not-a-knot"
    zero = CubicSpline(times, values, bc_type=(start, "not-a-knot"))(0.0)
    return CubicSpline(times, values - zero, bc_type=(start, "not-a-knot"))


def read_record(path: str | Path) -> Record:
    """Read a motion file; RecordRefused names file and line of what cannot be understood, and repeats none of it."""
    name = Path(path).name
    check_file(path)
    header, table, precisions, numbers = _read(path, _checked_header, f"columns {COLUMNS}")
    if len(numbers) < FEWEST_ROWS:
        fix = "sample more finely; 12 rows a period is the least"
        raise RecordRefused(f"at least {FEWEST_ROWS} rows", fix, f"{name}, {len(numbers)} rows")
    times = table[:, header.index("t")]
    _refuse_falling(times, numbers, name, "sort the rows and drop duplicates")

    def columns(group: tuple[str, ...]) -> tuple[Array | None, Array | None]:
        if group[0] not in header:
            return None, None
        picked = [header.index(c) for c in group]
        return table[:, picked], np.stack([precisions[j].unit(table[:, j]) for j in picked], axis=1)

    shift, shift_unit = columns(SHIFT_COLUMNS)
    rotation, rotation_unit = columns(ROTATION_COLUMNS)
    if rotation is None and "yaw" in header:
        angles, rotation_unit = columns(ANGLE_COLUMNS)
        assert angles is not None
        rotation = _unwound(name, angles, numbers)
    return Record(times, shift, rotation, shift_unit, rotation_unit, name)


def _unwound(name: str, angles: Array, lines: list[int]) -> Array:
    """Rotation vectors (n, 3) deg of roll, pitch and yaw (n, 3) deg, which may jump by full turns where they wrap."""
    from scipy.spatial.transform import Rotation  # slow to import

    smooth = np.unwrap(angles, axis=0, period=360.0)
    for k, column in np.argwhere(np.abs(np.diff(smooth, axis=0)) > LARGEST_CHANGE)[:1]:
        change = smooth[k + 1, column] - smooth[k, column]
        given = f"{name}, line {lines[k + 1]}: {ANGLE_COLUMNS[column]} changes by {change:.4g} deg"
        raise RecordRefused(f"angles that change by at most {LARGEST_CHANGE:g} deg", "sample more finely", given)
    turned = np.degrees(continuous(Rotation.from_euler("xyz", smooth, degrees=True).as_rotvec()))
    for k in np.flatnonzero(np.abs(np.diff(turned, axis=0)).max(axis=1) > LARGEST_CHANGE)[:1]:
        expected = "attitudes that come through a full turn about one axis only, or stay within one"
        given = f"{name}, line {lines[k + 1]}: a full turn of an axis that is tilted"
        raise RecordRefused(expected, "count the turn from another heading, or leave small roll and pitch out", given)
    return turned


def _refuse_falling(times: Array, numbers: list[int], name: str, fix: str) -> None:
    """RecordRefused at the first row whose time is not after that of the row before."""
    for k in np.flatnonzero(np.diff(times) <= 0)[:1]:
        given = f"{name}, line {numbers[k + 1]}: t = {times[k + 1]:.9g} after t = {times[k]:.9g}"
        raise RecordRefused("times that increase strictly", fix, given)


def read_once(most: int, what: str = "a CSV file") -> Callable[[F], F]:
    """What a function makes of a file, made once for as long as the file does not change; RecordRefused: there is none.

    most: how many results are kept.
    """

    def decorate(read: F) -> F:
        known = lru_cache(most)(lambda _changed, _size, *given: read(*given))

        @wraps(read)
        def once(path: str, *more: Any) -> Any:
            status = check_file(path, what)
            return known(status.st_mtime_ns, status.st_size, path, *more)

        return cast(F, once)

    return decorate


@read_once(4)
def read_history(path: str) -> tuple[tuple[float, float, float, float], ...]:
    """Rows (t, x, y, z) of a file that gives a force or a moment (s, N or N m), columns in any order; RecordRefused."""
    name, columns = Path(path).name, ["t", *SHIFT_COLUMNS]
    header, table, _, numbers = _read(path, columns_of(columns, ", in any order"), "columns t,x,y,z")
    if len(numbers) < 2:
        raise RecordRefused("at least 2 rows", "value: [x, y, z] gives a constant load", f"{name}, {len(numbers)} rows")
    table = table[:, [header.index(c) for c in columns]]
    _refuse_falling(table[:, 0], numbers, name, "sort the rows; for a sudden change give two rows a time step apart")
    return tuple((t, x, y, z) for t, x, y, z in table.tolist())


def read_table(path: str | Path, checked: Callable[[str, list[str]], list[str]]) -> tuple[list[str], Array, list[int]]:
    """Column names, numbers (n, columns) and the line of each row of a CSV file; checked: as of `_table`."""
    header, table, _, numbers = _read(path, checked, "check the path")
    return header, table, numbers


def _read(
    path: str | Path, checked: Callable[[str, list[str]], list[str]], fix: str
) -> tuple[list[str], Array, list[Precision], list[int]]:
    """The same with the precision of each column; fix: what to do where the file is no text."""
    try:
        with Path(path).open(encoding="utf-8-sig") as lines:
            header, values, precisions, numbers = _table(Path(path).name, lines, checked)
    except (OSError, UnicodeDecodeError, ValueError):
        raise RecordRefused("a CSV text file", fix, f"{path}, which cannot be read") from None
    return header, np.array(values).reshape(len(numbers), len(header)), precisions, list(numbers)


def columns_of(wanted: list[str], order: str = "") -> Callable[[str, list[str]], list[str]]:
    """Checks a header for these columns, in any order; order: words that say so."""

    def checked(name: str, header: list[str]) -> list[str]:
        if sorted(header) == sorted(wanted):
            return header
        given = f"{name} with columns {', '.join(header)[:60]}"
        expected = f"columns {','.join(wanted)}{order}"
        raise RecordRefused(expected, "name the columns in the first line of the file", given)

    return checked


def check_file(path: str | Path, what: str = "a CSV file") -> os.stat_result:
    """What the system knows of a file; RecordRefused if there is no regular one of bounded size.

    Nothing is opened, so that a pipe cannot wait.
    """
    try:
        status = os.stat(path)
    except FileNotFoundError:
        fix = "check the name; it is relative to the folder of the scene file"
        raise RecordRefused(what, fix, f"{path}, which does not exist") from None
    except (OSError, ValueError):
        raise RecordRefused(what, "check the path", f"{path}, which cannot be read") from None
    if not stat.S_ISREG(status.st_mode):
        kind = next((name for test, name in _KINDS if test(status.st_mode)), "no regular file")
        fix = "name a file; what comes through a pipe or a device has to be written to one first"
        raise RecordRefused(what, fix, f"{path}, which is {kind}")
    if status.st_size > LARGEST_FILE:
        fix = "sample less finely, as 20 rows a period are enough; or cut it to time.duration"
        given = f"{path}, {status.st_size / 1e6:.0f} MB"
        raise RecordRefused(f"a file of at most {LARGEST_FILE / 1e6:.0f} MB", fix, given)
    return status


def unreadable(path: str, read: Callable[[], Any], what: str = "a CSV file") -> Findings:
    """What is wrong with a file that a table names; read: what is made of it."""
    try:
        check_file(path, what)
        read()
    except RecordRefused as refused:
        yield [refused.finding]


def _table(
    name: str, lines: Iterator[str], checked: Callable[[str, list[str]], list[str]]
) -> tuple[list[str], array[float], list[Precision], array[int]]:
    """Column names, values row by row, the precision of each column, and the line of each row.

    checked: the column names as they are to be, RecordRefused where they cannot be.
    """
    header: list[str] = []
    values, numbers = array("d"), array("q")
    precisions: list[Precision] = []
    for i, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip()[0] == "#":
            continue
        cells = [cell.strip() for cell in line.split(",")]
        if not header:
            header = checked(name, cells)
            precisions = [Precision() for _ in header]
            continue
        if len(cells) != len(header):
            given = f"{name}, line {i}: {len(cells)} entries"
            raise RecordRefused(f"{len(header)} numbers in every row", "complete that row", given)
        for column, cell, precision in zip(header, cells, precisions, strict=True):
            values.append(_number(name, i, column, cell))
            precision.add(cell)
        numbers.append(i)
    if not header:
        try:
            checked(name, [])
        except RecordRefused as error:
            raise RecordRefused(error.finding.expected, error.finding.fix, f"{name}, which is empty") from None
        raise RecordRefused("a table", "name the columns in the first line, such as t,x,y,z", f"{name}, which is empty")
    return header, values, precisions, numbers


def _checked_header(name: str, header: list[str]) -> list[str]:
    groups = [group for group in (SHIFT_COLUMNS, ROTATION_COLUMNS, ANGLE_COLUMNS) if set(group) <= set(header)]
    twice = ROTATION_COLUMNS in groups and ANGLE_COLUMNS in groups
    if "t" in header and groups and not twice and len(header) == 1 + sum(map(len, groups)):
        return header
    known = [c for c in ("t", *SHIFT_COLUMNS, *ROTATION_COLUMNS, *ANGLE_COLUMNS) if c in header]
    given = f"{name} with {len(header)} columns, of which {', '.join(known) or 'none'} can be used"
    raise RecordRefused(f"columns {COLUMNS}", "name the columns in the first line of the file", given)


def _number(name: str, line: int, column: str, text: str) -> float:
    try:
        value = float(text) if "_" not in text else math.nan  # 1_0 is 10 to Python, and a slip to everybody else
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST:
        given = f"{name}, line {line}: {column} is {'no finite number' if text else 'empty'}"
        raise RecordRefused("finite numbers", "correct or drop that row", given)
    return value


class Precision:
    """How finely the numbers of a column are written.

    Writers round to a number of decimals or to a number of digits and may strip zeros, so the most precise entry of
    the column speaks for all: the coarser of the two readings is taken.
    """

    def __init__(self) -> None:
        self.decimals, self.digits = -300, 1

    def add(self, text: str) -> None:
        """Take one number of the column into account, as it is written."""
        mantissa, _, exponent = text.lower().partition("e")
        whole, _, fraction = mantissa.lstrip("+-").partition(".")
        self.decimals = max(self.decimals, len(fraction) - int(exponent or 0))
        self.digits = max(self.digits, len((whole + fraction).lstrip("0")))

    def unit(self, values: Array) -> Array:
        """What the last digit of each value of the column is worth."""
        if self.digits < ROUNDED:
            return np.zeros(len(values))
        exponents = np.floor(np.log10(np.abs(values) + 1e-300)) - self.digits + 1
        size = np.where(values == 0.0, 0.0, 10.0**exponents)
        return np.maximum(size, 10.0 ** -min(max(self.decimals, -300), 300))


# --- how fast it moves -------------------------------------------------------------------------


def shortest_in(record: Record) -> float:
    """What is to a record as a period is to a harmonic, s.

    Over a step of h a path with acceleration a leaves its chord by a h^2/8; MISSED of its range is too much, and of a
    harmonic a quarter of its period is that long.
    """
    shortest = math.inf
    t = np.linspace(record.times[0], record.times[-1], min(200_000, 4 * record.times.size))
    for path in record.splines():
        reach, bend = float(np.ptp(path(t), axis=0).max()), float(np.abs(path(t, 2)).max())
        if reach > 0.0 and bend > 0.0:
            shortest = min(shortest, 4.0 * math.sqrt(8.0 * MISSED * reach / bend))
    return shortest


def missed_between(record: Record, step: float) -> float | None:
    """Time at which a record departs most from its chord over a step, when that is a large part of its range."""
    last = float(record.times[-1])
    t = np.linspace(0.0, max(last - step, 0.0), min(20_000, max(2, int(4 * last / step))))
    for path in record.splines():
        bow = np.abs(path(t + 0.5 * step) - 0.5 * (path(t) + path(np.minimum(t + step, last)))).max(axis=1)
        reach = float(np.ptp(path(t), axis=0).max())
        if reach > 0.0 and bow.max() > MISSED * reach:
            return float(t[int(bow.argmax())])
    return None


def fastest_in(record: Record) -> tuple[float, float]:
    """Largest speed [m/s] and acceleration [m/s^2] between the samples of a record; zero if it shifts nothing."""
    if record.shift is None:
        return 0.0, 0.0
    h = np.diff(record.times)
    velocity = np.diff(record.shift, axis=0) / h[:, None]
    acceleration = np.diff(velocity, axis=0) / (0.5 * (h[:-1] + h[1:]))[:, None]
    return float(np.linalg.norm(velocity, axis=1).max()), float(np.linalg.norm(acceleration, axis=1).max())


# Rotations of a record: roll, pitch and yaw as rotation vectors, turns counted on from row to row.


def continuous(vectors: Array) -> Array:
    """Rotation vectors (n, 3) rad of the same rotations, each the nearest to the one before: turns are counted."""
    out = vectors.copy()
    for i in range(1, len(out)):
        size, before = float(np.linalg.norm(out[i])), out[i - 1]
        if size < 1e-9:  # a number of turns about the axis of the row before
            length = float(np.linalg.norm(before))
            whole = 2.0 * np.pi * round(length / (2.0 * np.pi))
            out[i] += before * (whole / length) if whole > 0.0 else 0.0
            continue
        axis = out[i] / size
        out[i] = axis * (size + 2.0 * np.pi * round((float(axis @ before) - size) / (2.0 * np.pi)))
    return out


# Jumps of velocity in a recorded motion, and whether it fits the end that it moves.
#
# The kink test.  At sample i let c_i be the change of slope, c_i = s_i - s_{i-1}.  Where the
# motion is smooth, c_i is its acceleration times the local sample spacing, so c_i / spacing
# varies slowly from sample to sample; a jump J of velocity adds J to one c_i (or, when it
# falls between two samples, shares it between two neighbours).  So one sample, or a pair, is
# left out, its c is interpolated from the two samples on each side, and the excess J is a kink if
#   - it exceeds ISOLATED times every change of slope among the four samples on either side,
#   - it exceeds NEGLIGIBLE of the top speed, and
#   - the digits of the file cannot explain it.
# A sine of 12 samples a period leaves an excess of 0.01 (single) and 0.1 (pair) of its
# neighbours, a sine that starts without ramp 2 and more, the corner of a triangle any number.

# A velocity jump of 2 % of the top speed is what two-digit data cannot avoid and a cable hardly feels.
NEGLIGIBLE = 0.02

# Half way (in ratio) between the worst smooth signal of 12 samples a period and an unramped sine.
ISOLATED = 1.25

# How many samples on either side count as neighbours: a third of a period at 12 samples a period,
# so the next corner of a triangle is never among them.
NEIGHBOURS = 4

# The file and the scene may round a position differently, but not by more than this part of the excursion.
SAME_START = 1e-3


def judge_record(
    record: Record, position: tuple[float, float, float] | None, duration: float | None, blended: bool = False
) -> list[Finding]:
    """What is wrong with a record as motion of an end that starts from rest at `position` ((3,) m, or None).

    blended: a ramp brings it in, so that it may start anywhere with any velocity.
    """
    found: list[Finding] = []
    times = record.times
    if times[0] > 0:
        given = f"{record.name}, which starts at t = {times[0]:.6g} s"
        found.append(Finding(("file",), "a record that starts at t <= 0", "add a row at t = 0", given))
    if duration is not None and times[-1] < duration * (1 - 1e-9):
        given = f"{record.name}, which ends at t = {times[-1]:.6g} s"
        expected = f"a record that covers time.duration, {duration:.6g} s"
        found.append(Finding(("file",), expected, "a longer record or a shorter duration", given))
    if found:
        return found
    if record.shift is not None and position is not None and not blended:
        fix = "make the first row and the position of the end equal, or give `ramp: ...` (s), which blends it in"
        found += _starts_at(record, record.shift, np.array(position), "position", "m", fix)
    if record.rotation is not None and not blended:
        fix = "rotation counts from the tangent of the end: subtract the first row, or give `ramp: ...` (s)"
        found += _starts_at(record, record.rotation, np.zeros(3), "rotation", "deg", fix)
    for values, unit, name, measure in (
        (record.shift, record.shift_unit, "velocity", "m/s"),
        (record.rotation, record.rotation_unit, "angular velocity", "deg/s"),
    ):
        if values is not None and unit is not None:
            jump = first_jump(times, values, unit, math.inf if duration is None else duration, not blended)
            if jump is not None:
                found.append(_jump_finding(record.name, jump, name, measure))
    return found


def _starts_at(record: Record, values: Array, base: Array, what: str, unit: str, fix: str) -> list[Finding]:
    # A record may begin before t = 0; what counts is where it is when the computation begins.
    first = np.array([np.interp(0.0, record.times, column) for column in values.T])
    excursion = float(np.linalg.norm(values - first, axis=1).max())
    if np.linalg.norm(first - base) <= SAME_START * excursion + 1e-9 * float(np.linalg.norm(base)):
        return []
    row = "in its first row" if record.times[0] == 0 else "at t = 0"
    given = f"{record.name}, {xyz(first)} {unit} {row}"
    return [Finding(("file",), f"{xyz(base)} {unit}, the {what} of this end at the start", fix, given)]


def _jump_finding(name: str, jump: tuple[float, float], what: str, unit: str) -> Finding:
    t, size = jump
    if t == 0.0:
        given = f"{name}, which starts with {size:.4g} {unit}"
        fix = "give `ramp: ...` (s), about two periods, which blends it in, or let the record begin at rest"
        return Finding(("file",), f"no {what} at t = 0, because the cable starts at rest", fix, given)
    given = f"{name}, whose {what} jumps by {size:.4g} {unit} at t = {t:.6g} s"
    return Finding(("file",), f"a smooth {what}", "smooth the record there, or sample it more finely", given)


def first_jump(
    times: Array, values: Array, unit: Array, until: float = math.inf, from_rest: bool = True
) -> tuple[float, float] | None:
    """Time and size of the first jump of velocity in [0, until], None if there is none.

    times: (n,) s; values, unit: (n, 3) samples and what their last digits are worth; from_rest: whether a velocity at
    t = 0 is a jump.
    """
    slopes = np.diff(values, axis=0) / np.diff(times)[:, None]
    top = float(np.linalg.norm(slopes, axis=1).max())
    if top == 0.0:
        return None
    start = [_start_speed(times, values[:, j], unit[:, j]) for j in range(values.shape[1])]
    speed, doubt = float(np.linalg.norm([v for v, _ in start])), float(np.linalg.norm([d for _, d in start]))
    if from_rest and speed > NEGLIGIBLE * top + doubt:
        return 0.0, speed
    least = NEGLIGIBLE * top
    jumps = [j for k in range(values.shape[1]) for j in _kinks(times, values[:, k], unit[:, k], least, from_rest)]
    if not jumps:
        jumps = [j for column in values.T for j in _leap_at_the_end(times, column, NEGLIGIBLE * top)]
    jumps = [(max(t, 0.0), size) for t, size in jumps if 0.0 <= t <= until]
    return min(jumps) if jumps else None


def _start_speed(times: Array, x: Array, unit: Array) -> tuple[float, float]:
    """Speed at t = 0 and how far it may be wrong.

    The quintic through the six samples next to 0, held against the quartic and the cubic through
    five and four of them: their differences bound what sparse sampling leaves open (a few per cent
    at 12 samples a period, nothing that shows at 24).
    """
    i = int(np.searchsorted(times, 0.0, side="right")) - 1
    low = max(0, min(i - (2 if times[0] < 0 else 0), len(times) - 6))
    estimates = []
    for n in (4, 5, 6):
        w = _slope_weights(times[low : low + n])
        estimates.append((float(w @ x[low : low + n]), float(np.abs(w) @ unit[low : low + n]) / 2))
    (cubic, _), (quartic, _), (quintic, noise) = estimates
    return abs(quintic), 2 * max(abs(cubic - quartic), abs(quartic - quintic)) + noise


def _slope_weights(t: Array) -> Array:
    """Weights w with w @ x = p'(0), p the polynomial through the samples (t, x)."""
    scale = t[-1] - t[0]
    u = t / scale
    rhs = np.zeros(len(t))
    rhs[1] = 1.0 / scale
    return np.asarray(np.linalg.solve(np.vander(u, increasing=True).T, rhs), dtype=np.float64)


def _kinks(times: Array, x: Array, unit: Array, negligible: float, from_rest: bool) -> list[tuple[float, float]]:
    """(time, velocity jump) of every kink of one column."""
    if times[0] == 0.0 and from_rest:
        # The cable is at rest before the record begins, which gives the first samples neighbours.
        n = NEIGHBOURS + 1
        rest = -np.arange(n, 0, -1) * (times[1] - times[0])
        times, x = np.concatenate([rest, times]), np.concatenate([np.full(n, x[0]), x])
        unit = np.concatenate([np.zeros(n), unit])
    h = np.diff(times)
    spacing = (h[:-1] + h[1:]) / 2
    accel = np.diff(np.diff(x) / h) / spacing
    centre = (times[:-2] + times[1:-1] + times[2:]) / 3
    # Every sample may be wrong by half its last digit.
    doubt = ((unit[:-2] + unit[1:-1]) / h[:-1] + (unit[1:-1] + unit[2:]) / h[1:]) / 2 / spacing

    found: list[tuple[int, float]] = []
    for width in (1, 2):
        # Two neighbours on either side; the last two samples of a record have too few to be judged.
        first = np.arange(2, len(accel) - width - 1)
        inside = first[:, None] + np.arange(width)
        near = first[:, None] + np.array([-2, -1, width, width + 1])
        reach = np.r_[-NEIGHBOURS:0, width : width + NEIGHBOURS]
        around = np.clip(first[:, None] + reach, 0, len(accel) - 1)
        w = _weights(centre[near], centre[inside])
        each = np.abs(accel[inside] - np.einsum("nij,nj->ni", w, accel[near])) * spacing[inside]
        excess = each.sum(axis=1)
        unsure = ((doubt[inside] + np.einsum("nij,nj->ni", np.abs(w), doubt[near])) * spacing[inside]).sum(axis=1)
        typical = np.abs(accel[around]).max(axis=1) * spacing[inside].max(axis=1)
        kink = (excess > ISOLATED * typical) & (excess > negligible) & (excess > unsure)
        worst = first + each.argmax(axis=1)
        jump = (np.abs(accel[inside]) * spacing[inside]).max(axis=1)
        sizes = np.abs(accel) * spacing
        for i, size in zip(worst[kink].tolist(), jump[kink].tolist(), strict=True):
            if size <= negligible:  # smooth itself, beside kinks so near each other that they hide each other
                begin = max(i - 2, 0)
                i = begin + int(np.argmax(sizes[begin : i + 3]))
                size = float(sizes[i])
            found.append((i, size))
    # A kink casts its shadow on the samples that are interpolated from it: of neighbours, the largest is meant.
    largest = [k for k in found if all(k[1] >= other[1] for other in found if abs(k[0] - other[0]) <= NEIGHBOURS)]
    return [(float(times[i + 1]), size) for i, size in largest]


def _leap_at_the_end(times: Array, x: Array, negligible: float) -> list[tuple[float, float]]:
    """A leap between the last samples, which have too few neighbours for the kink test: (time, velocity jump).

    A motion of 12 samples a period moves by at most a quarter of its range from one sample to the next, so more
    than half of it, at more than twice the speed just before, is a leap.
    """
    slopes, leaps = np.abs(np.diff(x) / np.diff(times)), np.abs(np.diff(x))
    for i in (len(x) - 3, len(x) - 2):
        jump = float(slopes[i] - slopes[max(i - NEIGHBOURS, 0) : i].max())
        if leaps[i] > 0.5 * np.ptp(x) and jump > 0.5 * slopes[i] and jump > negligible:
            return [(float(times[i]), jump)]
    return []


def _weights(t: Array, at: Array) -> Array:
    """Weights (n, m, 4) that evaluate at `at` (n, m) the cubics through samples at `t` (n, 4) (Lagrange)."""
    w = np.ones((*at.shape, t.shape[1]))
    for j in range(t.shape[1]):
        for k in range(t.shape[1]):
            if k != j:
                w[:, :, j] *= (at - t[:, None, k]) / (t[:, None, j] - t[:, None, k])
    return w
