"""Write a result in a format of other programs: `export(result, "run.nc")`.

nc      everything, for xarray, MATLAB, Panoply and other programs that read netCDF (`labelled`)
csv     histories at some places, for spreadsheets
vtkhdf  the cable over time, for ParaView (`vtk`)
fatigue cycles of tension and curvature at the places that matter, and the histories they are counted in (`fatigue`)

Exports read files and nothing else.  A file appears when it is whole, and not at all if it cannot be made so.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.results.fatigue import count
from hybrid.results.labelled import image as netcdf
from hybrid.results.part import (
    MARK,
    Numbers,
    Part,
    Window,
    check_place,
    error_name,
    head_lines,
    part_of,
    scene_lines,
    shortfalls,
    write_whole,
)
from hybrid.results.read import Result
from hybrid.results.vtk import image as vtkhdf

SUFFIXES = {"nc": ".nc", "csv": ".csv", "vtkhdf": ".vtkhdf", "fatigue": ".cycles.csv"}
# Decimals of an arc length in the name of a column: micrometres of a kilometre.
_PLACE = ".9g"


class Exported(NamedTuple):
    """What was written: the files, what is in them in a sentence, and what their reader must know."""

    files: tuple[Path, ...]
    text: str
    notes: tuple[str, ...]


def export(
    result: Result,
    path: str | Path | None = None,
    *,
    format: str | None = None,
    names: Sequence[str] | None = None,
    times: Window | None = None,
    at: Numbers | None = None,
    overwrite: bool = True,
) -> Exported:
    """Write a result as netCDF, CSV, VTKHDF or as cycles for fatigue.

    path: the file, whose ending says the format unless `format` does; None: beside the result.  names: fields or
    groups, None for all (of a CSV: tension).  times: from and to, s, None for no limit.  at: arc lengths, m; None for
    all (of a CSV: the ends, and those recorded as `history`).  An older export is replaced if `overwrite`; what is
    not one never is.  ResultError when something is unknown, a package is missing, or the disk says no.
    """
    kind = _format(path, format)
    if path is None and result.file is None:
        raise ResultError(f"a result in memory has no name of its own\n    try:      path='run{SUFFIXES[kind]}'")
    file = Path(path).expanduser() if path is not None else beside(result.file or Path(), kind)
    files = [file]
    if kind == "csv":
        names, at = ["tension"] if names is None else names, _usual_places(result) if at is None else at
    part = part_of(result, names, times, at)
    notes = shortfalls(part)
    if kind == "fatigue":
        if names is not None:
            raise ResultError("fatigue counts tension and curvature; other names cannot be chosen")
        found = count(part_of(result, None, times), [] if at is None else part.s.tolist())
        notes += found.notes
        files.append(file.with_name(file.name.removesuffix(".csv").removesuffix(".cycles") + ".histories.csv"))
    for place in files:
        check_place(place, overwrite)  # before the work
    if kind == "nc":
        images = [netcdf(part)]
    elif kind == "vtkhdf":
        images = [vtkhdf(part)]
    elif kind == "fatigue":
        head = found.head + scene_lines(part)
        images = [
            _table("cycles", head, found.cycle_names, found.cycles),
            _table("histories", head, found.history_names, found.histories),
        ]
    else:
        columns = histories(part)
        head = head_lines(part) + _errors_of(part) + scene_lines(part)
        images = [_table("histories", head, list(columns), list(columns.values()))]
    write_whole(dict(zip(files, images, strict=True)), overwrite)
    t = part.times
    text = f"{len(t)} output{'s' * (len(t) != 1)}, t = {t[0]:.6g}" + (f" to {t[-1]:.6g} s" if len(t) > 1 else " s")
    if kind == "fatigue":
        text = f"{len(found.cycles[0])} cycles at {found.places} places, " + text.partition(", ")[2]
    elif kind == "csv":
        text = f"{len(next(iter(columns.values())))} rows, {len(columns)} columns; " + text
    return Exported(tuple(files), text, tuple(notes))


def beside(source: Path, format: str | None = None) -> Path:
    """The name of an export beside its result."""
    return source.with_suffix(SUFFIXES[_format(None, format)])


def histories(part: Part) -> dict[str, np.ndarray]:
    """Columns over one clock, the clock first: names with unit and place, and values (n,).

    ResultError when the fields lie on different clocks, such as the outputs and the step log.
    """
    result, columns = part.result, {}
    clocks = {name: (result.dims(name) or ("",))[0] for name in part.names}
    inside = {name: clock for name, clock in clocks.items() if clock == "t" or clock.endswith("/t")}
    if len(set(inside.values())) != 1 or len(inside) < len(clocks):
        groups = (f"{clock or 'no time'}: {_some(clocks, clock)}" for clock in sorted(set(clocks.values())))
        raise ResultError(
            f"the columns of a CSV have one clock in common\n    given:    {'; '.join(groups)}\n"
            "    try:      one export for each of them, or nc, which holds them all"
        )
    (clock,) = set(inside.values())
    columns["t (s)"] = part.array(clock)
    for name in part.names:
        if name != clock:
            _unfold(columns, part, name)
    return columns


def _some(clocks: dict[str, str], clock: str) -> str:
    names = [name for name in clocks if clocks[name] == clock]
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _unfold(columns: dict[str, np.ndarray], part: Part, name: str) -> None:
    """One column for each place and component of a field."""
    array, dims = part.array(name), part.result.dims(name)
    unit = part.result.units[name]
    for index in np.ndindex(array.shape[1:]):
        title, place = name, ""
        for dim, k in zip(dims[1:], index, strict=True):
            if dim == "s":
                place = f" at s = {part.s[k]:{_PLACE}} m"
            else:
                title += f" {'xyz'[k] if dim == 'xyz' else k}"
        columns[title + (f" ({unit})" if unit else "") + place] = array[(slice(None), *index)]


def _usual_places(result: Result) -> np.ndarray:
    """The ends, and the places that the scene asks to follow."""
    asked = np.asarray(result["history"], float).ravel() if "history" in result else np.zeros(0)
    return np.unique([result["s"][0], *asked, result["s"][-1]])


def _errors_of(part: Part) -> list[str]:
    """The largest estimated error of every column over s or t, by its name."""
    lines = []
    for name in part.names:
        error, said = error_name(part, name)
        if not error:
            continue
        array, dims, unit = part.array(error), part.result.dims(error), part.result.units[error]
        at = enumerate(part.s) if dims[1:] == ("s",) else [((), None)]
        for k, s in at:
            place = "" if s is None else f" at s = {s:{_PLACE}} m"
            lines.append(f"  {name}{place}: at most {array[:, k].max():.3g} {unit}, {said}")
    return ["errors:", *lines] if lines else ["errors: not estimated (output: {errors: true} in the scene asks for it)"]


def _table(what: str, head: Sequence[str], names: Sequence[str], columns: Sequence[np.ndarray]) -> bytes:
    """A table with a head of comments.  Numbers as Python writes them: 17 digits if need be, a point, no grouping."""
    out = io.StringIO(newline="")
    out.writelines(f"# {line}\n" for line in (f"{MARK}: {what}", *head))
    table = csv.writer(out, lineterminator="\n")
    table.writerow(names)
    table.writerows(zip(*(column.tolist() for column in columns), strict=True))
    return out.getvalue().encode()


def _format(path: str | Path | None, format: str | None) -> str:
    """The format that was asked for, or that the name says."""
    expected = f"    expected: {', '.join(SUFFIXES)}"
    if format is not None:
        if format not in SUFFIXES:
            raise ResultError(f"there is no format '{format}'\n{expected}")
        return format
    if path is None:
        return "nc"
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in SUFFIXES:
        said = f"the name '{Path(path).name}' says no format"
        raise ResultError(f"{said}\n{expected}\n    try:      a name such as run.nc, or say the format")
    return suffix
