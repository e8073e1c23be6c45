"""Write a result in a format of other programs: `export(result, "run.nc")`.

nc      everything, for xarray, MATLAB, Panoply and other programs that read netCDF (`labelled`)
csv     histories at some places, for spreadsheets
vtkhdf  the cable over time, for ParaView (`vtk`)
fatigue cycles of tension and curvature at the places that matter, and the histories they are counted in (`fatigue`)

Exports read files and nothing else.  A file appears when it is complete, and not at all if it cannot be made so.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.exports.fatigue import count
from hybrid.exports.vtk import image as vtkhdf
from hybrid.store.envelope import BEGIN, END, SCALE
from hybrid.store.reader import Result
from hybrid.store.selection import (
    MARK,
    Numbers,
    Part,
    Window,
    check_target,
    error_name,
    head_lines,
    missing_parts,
    netcdf,
    part_of,
    scene_lines,
    write_atomically,
)

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
    names: str | Sequence[str] | None = None,
    times: Window | None = None,
    at: Numbers | None = None,
    overwrite: bool = True,
) -> Exported:
    """Write a result as netCDF, CSV, VTKHDF or as cycles for fatigue.

    path: the file, whose ending gives the format unless `format` does; None: beside the result.  names: fields or
    groups, None for all (of a CSV: tension).  times: from and to, s, None for no limit.  at: arc lengths, m; None for
    all (of a CSV: the ends, and those recorded as `history`).  An older export is replaced if `overwrite`; what is
    not one never is.  ResultError when something is unknown, a package is missing, or the file cannot be written.
    """
    kind, names = format_of(path, format), [names] if isinstance(names, str) else names
    if path is None and result.file is None:
        raise ResultError(f"a result in memory has no name of its own\n    try:      path='run{SUFFIXES[kind]}'")
    file = Path(path).expanduser() if path is not None else (result.file or Path()).with_suffix(SUFFIXES[kind])
    if result.lines and (kind in ("vtkhdf", "fatigue") or (kind == "csv" and names is None)):
        (name, line), *others = result.lines.items()
        if others:
            raise ResultError(
                f"{kind} is of one line, and the result is of several: {', '.join(result.lines)}\n"
                f"    try:      export(result.lines['{name}'], 'run.{name}{SUFFIXES[kind]}'); the command `hybrid "
                "export` makes a file of each"
            )
        result = line
    if kind == "csv":
        names, at = ["tension"] if names is None else names, _usual_places(result) if at is None else at
    if kind == "fatigue" and names is not None:
        raise ResultError("fatigue counts tension and curvature; other names cannot be chosen")
    part = part_of(result, names, times, at)
    files = [file]
    if kind == "fatigue":
        files.append(file.with_name(file.name.removesuffix(".csv").removesuffix(".cycles") + ".histories.csv"))
    for place in files:
        check_target(place, overwrite)  # before the work
    made = _MADE[kind](part)
    write_atomically(dict(zip(files, made.files, strict=True)), overwrite)
    return Exported(tuple(files), made.text + _span(part), (*missing_parts(part), *made.notes))


class _Made(NamedTuple):
    """The content of the files of an export, what to say of it, and what to warn of."""

    files: tuple[bytes | memoryview, ...]
    text: str = ""
    notes: Sequence[str] = ()


def _csv(part: Part) -> _Made:
    columns = histories(part)
    head = head_lines(part) + _span_of_envelope(part) + _errors_of(part) + scene_lines(part)
    rows = len(next(iter(columns.values())))
    text = f"{rows} row{'s' * (rows != 1)}, {len(columns)} columns; "
    return _Made((_table("histories", head, list(columns), list(columns.values())),), text)


def _fatigue(part: Part) -> _Made:
    found = count(part)
    head = found.head + scene_lines(part)
    cycles = _table("cycles", head, found.cycle_names, found.cycles)
    text = f"{len(found.cycles[0])} cycles at {found.places} places; "
    return _Made((cycles, _table("histories", head, found.history_names, found.histories)), text, found.notes)


_MADE = {
    "nc": lambda part: _Made((netcdf(part),)),
    "csv": _csv,
    "vtkhdf": lambda part: _Made((vtkhdf(part),)),
    "fatigue": _fatigue,
}


def _span(part: Part) -> str:
    t = part.times
    return f"{len(t)} output{'s' * (len(t) != 1)}, t = {t[0]:.6g}" + (f" to {t[-1]:.6g} s" if len(t) > 1 else " s")


class File(NamedTuple):
    """A file of an export: its place, the result and names of it (None: all), and the line, "" of all or of one."""

    path: Path
    result: Result
    names: Sequence[str] | None
    line: str = ""

    @property
    def has_places(self) -> bool:
        """Whether what is in it lies along a line."""
        return bool(self.line or not self.result.lines)


def files_of(result: Result, target: Path, kind: str, names: Sequence[str] | None) -> list[File]:
    """The files of an export; of several lines each has one.

    What they share (points, bodies, contacts, events) is in `target` itself: where names ask for it, and in nc, which
    holds everything.  ResultError: a format of lines alone is asked for something shared.
    """
    if not result.lines:
        return [File(target, result, names)]
    lines = result.lines.values()
    shared = [
        n for n in names or () if n.split("/")[0] in _SHARED or (n in result and not any(n in line for line in lines))
    ]
    own = None if names is None else [n for n in names if n not in shared or n.split("/")[0] == "events"]
    if shared and kind not in ("nc", "csv"):
        given = f"    given:    {', '.join(shared)}"
        raise ResultError(f"{kind} is of lines alone\n{given}\n    try:      csv or nc, which hold it")
    files, (stem, dot, rest) = [], target.name.partition(".")
    if own is None or own or not shared:
        for name, line in result.lines.items():
            files.append(File(target.with_name(f"{stem}.{name}{dot}{rest}"), line, own, name))
    return [*files, File(target, result, shared or None)] if shared or (names is None and kind == "nc") else files


# Groups of what several lines share; each line has events of its own as well.
_SHARED = ("points", "bodies", "contacts", "events")


def histories(part: Part) -> dict[str, np.ndarray]:
    """Columns over one clock, the clock first: names with unit and place, and values (n,); an envelope lies over s.

    ResultError when the fields lie on different clocks, such as the outputs and the step log.
    """
    result, columns = part.result, {}
    names = [name for name in part.names if name not in (BEGIN, END)]
    clocks = {name: (result.dims(name) or ("",))[0] for name in names}
    inside = {name: clock for name, clock in clocks.items() if clock in ("t", SCALE) or clock.endswith("/t")}
    if len(set(inside.values())) != 1 or len(inside) < len(clocks):
        groups = (f"{clock or 'no time'}: {_some(clocks, clock)}" for clock in sorted(set(clocks.values())))
        raise ResultError(
            f"the columns of a CSV have one clock in common\n    given:    {'; '.join(groups)}\n"
            "    try:      one export for each of them, or nc, which holds them all"
        )
    (clock,) = set(inside.values())
    columns["s (m)" if clock == SCALE else "t (s)"] = part.array(clock)
    for name in names:
        if name != clock:
            _unfold(columns, part, name)
    return columns


def _span_of_envelope(part: Part) -> list[str]:
    """Of which steps the extremes are, where they are among the columns."""
    if SCALE not in part.names:
        return []
    begin, end = (float(part.result[name]) for name in (BEGIN, END))
    return [f"lowest and highest values of all accepted steps, t = {begin:.9g} to {end:.9g} s, at nodes s"]


def _some(clocks: dict[str, str], clock: str) -> str:
    names = [name for name in clocks if clocks[name] == clock]
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _unfold(columns: dict[str, np.ndarray], part: Part, name: str) -> None:
    """One column for each place and component of a field."""
    array, dims = part.array(name), part.result.dims(name)
    unit = part.result.units[name]
    for index in np.ndindex(array.shape[1:]):
        title, place, after = name, "", None
        for dim, k in zip(dims[1:], index, strict=True):
            if dim == "s":
                place, after = f" at s = {part.s[k]:{_PLACE}} m", part.after(name, float(part.s[k]))
            else:
                title += f" {'xyz'[k] if dim == 'xyz' else k}"
        title += (f" ({unit})" if unit else "") + place
        columns[title + (" before" if after is not None else "")] = array[(slice(None), *index)]
        if after is not None:
            columns[title + " after"] = after


def _usual_places(result: Result) -> np.ndarray:
    """The ends, and the places that the scene asks to follow."""
    asked = np.asarray(result["history"], float).ravel() if "history" in result else np.zeros(0)
    return np.unique([result["s"][0], *asked, result["s"][-1]])


# Vectors whose error is that of another quantity: of the size of an end force.
OF_AN_END = {"reaction_start": "end_force", "reaction_end": "end_force"}


def _errors_of(part: Part) -> list[str]:
    """The largest estimated error of every field at every place."""
    lines = []
    for name in part.names:
        error, which = error_name(part, name)
        total = f"error_total_{OF_AN_END.get(name, name)}"
        if total in part.result.attributes and (not error or part.result.dims(error) != ("t", "s")):
            unit, most = part.result.units[name], float(part.result.attributes[total])
            lines.append(f"  {name}: at most {most:.3g} {unit}, estimated")
        if error and part.result.dims(error) == ("t", "s"):
            most, unit = part.array(error).max(axis=0), part.result.units[error]
            for s, x in zip(part.s, most, strict=True):
                after = part.after(error, float(s))
                sides = [("", x)] if after is None else [(" before", x), (" after", after.max())]
                for side, size in sides:
                    lines.append(f"  {name} at s = {s:{_PLACE}} m{side}: at most {size:.3g} {unit}, {which}")
    return ["errors:", *lines] if lines else ["errors: not estimated (output: {errors: true} in the scene asks for it)"]


def _table(what: str, head: Sequence[str], names: Sequence[str], columns: Sequence[np.ndarray]) -> bytes:
    """A table with a head of comments.  Numbers as Python writes them: 17 digits if need be, a point, no grouping."""
    out = io.StringIO(newline="")
    out.writelines(f"# {line}\n" for line in (f"{MARK}: {what}", *head))
    table = csv.writer(out, lineterminator="\n")
    table.writerow(names)
    table.writerows(zip(*(column.tolist() for column in columns), strict=True))
    return out.getvalue().encode()


def format_of(path: str | Path | None, format: str | None) -> str:
    """The format of a result that was asked for, or that of the name; ResultError when there is none such."""
    expected = f"    expected: {', '.join(SUFFIXES)} of a result; fmu of a scene"
    suffix = Path(path or "").suffix.lower().removeprefix(".")
    if format is None and path is None:
        return "nc"
    if format is None and suffix not in SUFFIXES:
        wrong = f"the name '{Path(path or '').name}' has no known ending"
        raise ResultError(
            f"{wrong}\n{expected}\n    try:      a name such as run{SUFFIXES.get(str(path), '.nc')}, or `--format`"
        )
    if format is None:
        return suffix
    if format not in SUFFIXES:
        raise ResultError(f"there is no format '{format}'\n{expected}")
    if suffix in SUFFIXES and "." + suffix != Path("run" + SUFFIXES[format]).suffix:
        raise ResultError(
            f"the format is {format}, but the name ends with .{suffix}\n    try:      leave one of them out"
        )
    return format
