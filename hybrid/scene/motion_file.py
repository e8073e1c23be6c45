"""A motion file: a CSV table of times, positions and rotations, read with care; splines through its samples."""

from __future__ import annotations

import math
import os
import stat
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import ResultError, command_for, optional_package
from hybrid.scene.base import Finding, refuse

Array = NDArray[np.float64]

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
    try:
        with Path(path).open(encoding="utf-8-sig") as lines:
            header, values, precisions, numbers = _table(name, lines, _checked_header)
    except (OSError, UnicodeDecodeError, ValueError):
        raise RecordRefused("a CSV text file", f"columns {COLUMNS}", f"{path}, which cannot be read") from None
    if len(numbers) < FEWEST_ROWS:
        fix = "sample more finely; 12 rows a period is the least"
        raise RecordRefused(f"at least {FEWEST_ROWS} rows", fix, f"{name}, {len(numbers)} rows")
    table = np.array(values).reshape(len(numbers), len(header))
    times = table[:, header.index("t")]
    for k in np.flatnonzero(np.diff(times) <= 0)[:1]:
        given = f"{name}, line {numbers[k + 1]}: t = {times[k + 1]:.9g} after t = {times[k]:.9g}"
        raise RecordRefused("times that increase strictly", "sort the rows and drop duplicates", given)

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
        rotation = _unwound(name, angles, list(numbers))
    return Record(times, shift, rotation, shift_unit, rotation_unit, name)


def _unwound(name: str, angles: Array, lines: list[int]) -> Array:
    """Rotation vectors (n, 3) deg of roll, pitch and yaw (n, 3) deg, which may jump by full turns where they wrap."""

    smooth = np.unwrap(angles, axis=0, period=360.0)
    for k, column in np.argwhere(np.abs(np.diff(smooth, axis=0)) > LARGEST_CHANGE)[:1]:
        change = smooth[k + 1, column] - smooth[k, column]
        given = f"{name}, line {lines[k + 1]}: {ANGLE_COLUMNS[column]} changes by {change:.4g} deg"
        raise RecordRefused(f"angles that change by at most {LARGEST_CHANGE:g} deg", "sample more finely", given)
    turned = np.degrees(continuous(vectors_of(matrices_of(np.radians(smooth)))))
    for k in np.flatnonzero(np.abs(np.diff(turned, axis=0)).max(axis=1) > LARGEST_CHANGE)[:1]:
        expected = "attitudes that come through a full turn about one axis only, or stay within one"
        given = f"{name}, line {lines[k + 1]}: a full turn of an axis that is tilted"
        raise RecordRefused(expected, "count the turn from another heading, or leave small roll and pitch out", given)
    return turned


def read_history(path: str | Path) -> tuple[tuple[float, float, float, float], ...]:
    """Rows (t, x, y, z) of a file that gives a force or a moment (s, N or N m), columns in any order; RecordRefused."""
    check_file(path)
    status = os.stat(path)
    return _history(str(path), status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=4)
def _history(path: str, _changed: int, _size: int) -> tuple[tuple[float, float, float, float], ...]:
    """The rows of a history, read once for as long as its file does not change."""
    name = Path(path).name
    try:
        with Path(path).open(encoding="utf-8-sig") as lines:
            header, values, _, numbers = _table(name, lines, _history_header)
    except (OSError, UnicodeDecodeError, ValueError):
        raise RecordRefused("a CSV text file", "columns t,x,y,z", f"{path}, which cannot be read") from None
    if len(numbers) < 2:
        raise RecordRefused("at least 2 rows", "value: [x, y, z] gives a constant load", f"{name}, {len(numbers)} rows")
    table = np.array(values).reshape(len(numbers), len(header))[:, [header.index(c) for c in ("t", *SHIFT_COLUMNS)]]
    times = table[:, 0]
    for k in np.flatnonzero(np.diff(times) <= 0)[:1]:
        given = f"{name}, line {numbers[k + 1]}: t = {times[k + 1]:.9g} after t = {times[k]:.9g}"
        fix = "sort the rows; for a sudden change give two rows a time step apart"
        raise RecordRefused("times that increase strictly", fix, given)
    return tuple((t, x, y, z) for t, x, y, z in table.tolist())


def read_table(path: str | Path, checked: Callable[[str, list[str]], list[str]]) -> tuple[list[str], Array, list[int]]:
    """Column names, numbers (n, columns) and the line of each row of a CSV file; checked: as of `_table`."""
    try:
        with Path(path).open(encoding="utf-8-sig") as lines:
            header, values, _, numbers = _table(Path(path).name, lines, checked)
    except (OSError, UnicodeDecodeError, ValueError):
        raise RecordRefused("a CSV text file", "check the path", f"{path}, which cannot be read") from None
    return header, np.array(values).reshape(len(numbers), len(header)), list(numbers)


def _history_header(name: str, header: list[str]) -> list[str]:
    if sorted(header) == ["t", *SHIFT_COLUMNS]:
        return header
    given = f"{name} with columns {', '.join(header)[:60]}"
    raise RecordRefused("columns t,x,y,z, in any order", "name the columns in the first line of the file", given)


def check_file(path: str | Path, what: str = "a CSV file") -> None:
    """RecordRefused if there is no regular file of bounded size; nothing is opened, so that a pipe cannot wait."""
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


@contextmanager
def readable(path: str, what: str = "a CSV file") -> Iterator[None]:
    """What is read of a file of a table, within, is refused with what is wrong with the file, if anything is."""
    try:
        check_file(path, what)
        yield
    except RecordRefused as refused:
        refuse([refused.finding])


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


def matrices_of(angles: Array) -> Array:
    """Rotation matrices (n, 3, 3) Rz(yaw) Ry(pitch) Rx(roll) of angles (n, 3) rad: roll, pitch, yaw."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles).T, np.sin(angles).T
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.array(rows).transpose(2, 0, 1)


def vectors_of(matrices: Array) -> Array:
    """Rotation vectors (n, 3) rad, of at most half a turn, of rotation matrices (n, 3, 3); by quaternions."""
    m = matrices
    t = np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=1)
    w2 = 1.0 + t.sum(axis=1)  # 4 w^2, 4 x^2, ..
    squares = np.column_stack([w2, 1.0 + 2.0 * t - t.sum(axis=1, keepdims=True)])
    best = squares.argmax(axis=1)
    d = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=1)  # 4 w (x, y, z)
    xy, xz, yz = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    rows = np.stack(
        [
            np.column_stack([squares[:, 0], d]),
            np.column_stack([d[:, 0], squares[:, 1], xy, xz]),
            np.column_stack([d[:, 1], xy, squares[:, 2], yz]),
            np.column_stack([d[:, 2], xz, yz, squares[:, 3]]),
        ],
        axis=1,
    )
    q = rows[np.arange(len(m)), best]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    q = np.where(q[:, :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, q[:, 0])
    return np.asarray(q[:, 1:] * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)[:, None])


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
