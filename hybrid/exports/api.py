"""Write a result in a format of other programs: `export(result, "run.nc")`.

nc      everything, for xarray, MATLAB, Panoply and other programs that read netCDF (`labelled`)
csv     histories at some places, for spreadsheets
vtkhdf  the cable over time, for ParaView
fatigue cycles of tension and curvature at the places that matter, and the histories they are counted in

Exports read files and nothing else.  A file appears when it is complete, and not at all if it cannot be made so.

VTKHDF is the format of ParaView for data over time; it is written with h5py, VTK is only needed to read it.  One file
holds all outputs.  At each the cable is one poly line per stretch of zones of one kind, so that a line can be coloured
by it; neighbours share the point between them.  Points carry what is recorded over t and s, lines the kind of their
zone, and field data what is recorded over t alone.  Obstacles are triangles behind the lines, of a kind of their own,
on points behind those of the cable, where what is recorded over s is NaN; endless ones end beyond the cable.
Layout (VTKHDF 2.0, PolyData): every array holds all outputs one behind the other, and /VTKHDF/Steps says where each
begins.  An output is one part, with lines of its own, since zones may have moved.

Places of fatigue: both ends, the touchdown (where in its range the curvature ranges most), the place where the
curvature ranges most of all, and those asked for.  At the ends the tension is the end force of the step log, known at
every step; all else is known at the outputs.  Curvature is counted about one axis fixed in space, the one the cable
bends most about at that place: a magnitude would fold a bend to both sides into half its range.

Not done: stress (it needs the section), S-N curves, damage and life.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from hybrid.errors import ResultError, optional_package
from hybrid.store.envelope import BEGIN, END, SCALE
from hybrid.store.histories import Bends, bends_of
from hybrid.store.obstacle_surfaces import obstacles_at, triangles_of
from hybrid.store.reader import (
    MARK,
    Numbers,
    Part,
    Result,
    Window,
    check_target,
    error_name,
    facts,
    head_lines,
    missing_parts,
    netcdf,
    part_of,
    scene_lines,
    write_atomically,
)

# --- the cable over time, for ParaView ---------------------------------------------------------

# The four kinds of cells of PolyData, in the order of the format; we have lines.
_CELLS = ("Vertices", "Lines", "Polygons", "Strips")
_LINES, _POLYGONS = _CELLS.index("Lines"), _CELLS.index("Polygons")
# In sizes of the box of the cable: how far beyond it endless obstacles go on.
_BEYOND = 0.2


def vtkhdf(part: Part) -> memoryview:
    """The cable over time, as a file.  ResultError when the result has no positions."""
    if "position" not in part.result:
        raise ResultError("a cable without 'position' cannot be drawn\n    try:      a run that records it")
    points, s = part.array("position"), part.s
    if len(s) < 2:
        raise ResultError("a line needs two points\n    try:      two places or more in at")
    surfaces, triangles = _obstacles(part, points)
    points = np.concatenate([points, surfaces], axis=1)
    nt, ns = points.shape[:2]
    memory = io.BytesIO()
    with h5py.File(memory, "w") as out:
        for name, value in facts(part).items():
            out.attrs[name] = value
        out["scene"] = part.result.scene_text
        root = out.create_group("VTKHDF")
        root.attrs["Version"] = (2, 0)
        root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len("PolyData")))
        root["NumberOfPoints"] = np.full(nt, ns)
        root["Points"] = points.reshape(nt * ns, 3)
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = nt
        steps["Values"] = part.times
        steps["PartOffsets"], steps["NumberOfParts"] = np.arange(nt), np.ones(nt, int)
        steps["PointOffsets"] = ns * np.arange(nt)
        kinds, counts, meanings = _write_cells(root, part, triangles)
        _write_point_data(root, part, ns - len(part.s))
        data = root.create_group("CellData").create_dataset("zone_kind", data=kinds)
        data.attrs["meanings"] = meanings
        steps.create_group("CellDataOffsets")["zone_kind"] = np.cumsum(counts) - counts
        _write_field_data(root, part, meanings)
    return memory.getbuffer()


def _obstacles(part: Part, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (nt, n, 3) m of the surfaces of all obstacles, and their triangles (m, 3).

    Triangles count the points of the cable (nt, ns, 3) first, and these behind them.
    """
    flat = points.reshape(-1, 3)
    box = np.array([flat.min(axis=0), flat.max(axis=0)])
    size = _BEYOND * float(np.ptp(box, axis=0).max())
    box += [[-size], [size]]
    rows = range(len(part.result["t"]))[part.rows]
    each = [[triangles_of(body, box) for body in obstacles_at(part.result, k)] for k in rows]
    if not each or not each[0]:
        return np.zeros((len(points), 0, 3)), np.zeros((0, 3), int)
    begins = points.shape[1] + np.cumsum([0, *(len(x) for x, _ in each[0])])
    triangles = [t + begin for (_, t), begin in zip(each[0], begins, strict=False)]
    return np.array([np.concatenate([x for x, _ in bodies]) for bodies in each]), np.concatenate(triangles)


def _write_cells(root: Any, part: Part, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Lines of all outputs, and triangles (m, 3) that all have; kinds of the cells, cells by output, names of kinds."""
    s, nt, m = part.s, len(part.times), len(triangles)
    segments, meanings = part.zone_kinds(0.5 * (s[:-1] + s[1:]))
    offsets, connectivity, kinds, counts, ids = [], [], [], np.zeros(nt, int), np.zeros(nt, int)
    for i, row in enumerate(segments):
        begins = np.concatenate([[0], 1 + np.flatnonzero(np.diff(row))])
        ends = np.concatenate([begins[1:], [len(row)]])
        lines = [np.arange(a, b + 1) for a, b in zip(begins, ends, strict=True)]
        counts[i], ids[i] = len(lines), sum(map(len, lines))
        offsets.append(np.concatenate([[0], np.cumsum([len(line) for line in lines])]))
        connectivity += lines
        kinds.append(np.append(row[begins], np.full(m, len(meanings), row.dtype)))
    empty = np.zeros(nt, int)
    cell_offsets, id_offsets = np.zeros((nt, 4), int), np.zeros((nt, 4), int)
    cell_offsets[:, _LINES], id_offsets[:, _LINES] = np.cumsum(counts) - counts, np.cumsum(ids) - ids
    cell_offsets[:, _POLYGONS], id_offsets[:, _POLYGONS] = m * np.arange(nt), 3 * m * np.arange(nt)
    cells = {
        "Lines": (counts, ids, np.concatenate(offsets), np.concatenate(connectivity)),
        "Polygons": (empty + m, empty + 3 * m, np.tile(3 * np.arange(m + 1), nt), np.tile(triangles.ravel(), nt)),
    }
    for name in _CELLS:
        group = root.create_group(name)
        nothing = (empty, empty, empty, np.zeros(0, int))  # offsets of no cells: one 0 per part
        named = "NumberOfCells", "NumberOfConnectivityIds", "Offsets", "Connectivity"
        kept = zip(named, cells.get(name, nothing), strict=True)
        for key, value in kept:
            group[key] = value
    root["Steps/CellOffsets"], root["Steps/ConnectivityIdOffsets"] = cell_offsets, id_offsets
    return np.concatenate(kinds), counts + m, [*meanings, *["obstacle"] * bool(m)]


def _write_point_data(root: Any, part: Part, more: int) -> None:
    """What is recorded over t and s, and s itself, which all outputs share; more: points of obstacles in each."""
    data, offsets = root.create_group("PointData"), root.create_group("Steps/PointDataOffsets")
    nt, ns = len(part.times), len(part.s)
    data["s"] = np.append(part.s, np.full(more, np.nan))
    data["s"].attrs["units"] = "m"
    offsets["s"] = np.zeros(nt, int)
    for name in part.names:
        if part.result.dims(name)[:2] == ("t", "s") and name != "position":
            array, short = part.array(name), name.replace("/", "_")
            if more:
                array = np.append(array, np.full((nt, more, *array.shape[2:]), np.nan), axis=1)
            data[short] = array.reshape(nt * (ns + more), *array.shape[2:])
            data[short].attrs["units"] = part.result.units[name]
            offsets[short] = (ns + more) * np.arange(nt)


def _write_field_data(root: Any, part: Part, meanings: list[str]) -> None:
    """What is recorded over t alone, one tuple per output; what does not change, once."""
    nt, result = len(part.times), part.result
    data = root.create_group("FieldData")
    offsets, sizes = root.create_group("Steps/FieldDataOffsets"), root.create_group("Steps/FieldDataSizes")

    def put(name: str, rows: np.ndarray, first: np.ndarray, unit: str) -> None:
        name = name.replace("/", "_")
        data[name] = rows if rows.shape[1] > 1 else rows[:, 0]
        data[name].attrs["units"] = unit
        offsets[name], sizes[name] = first, np.tile([rows.shape[1], 1], (nt, 1))

    for name in dict.fromkeys(["t", *part.names]):  # t too: VTK knows no time of a file with a single output
        dims = result.dims(name)
        if dims[:1] == ("t",) and "s" not in dims:
            put(name, part.array(name).reshape(nt, -1), np.arange(nt), result.units[name])
    if "seabed" in result:
        put("seabed", part.array("seabed").reshape(1, -1), np.zeros(nt, int), "")
    data.attrs["zone_kind"] = ", ".join(f"{k}: {name}" for k, name in enumerate(meanings))


# --- cycles at the places that matter ----------------------------------------------------------

# A sine read n times a period shows 1 - cos(pi/n) less than its range at worst: 5 % for 10.
_SAMPLES = 10
# Cycles of less than this part of the largest range say nothing about how quick the load is.
_MAJOR = 0.1
# Below this part of the largest value at any of the places a cycle is the tolerance of Newton's method, not a load.
_NOISE = 1e-6
# The power of the range by which what is lost is weighed: the slope of S-N curves of chain and of welded steel is 3.
_SLOPE = 3
# A bend is counted about one axis; if less than this part of its square lies about it, the head of the file warns.
_PLANAR = 0.95
# Histories of one interval that show less than this part of the range of an end force are reported to lose some of it.
_KEPT = 0.99
# A touchdown so near to an end of the cable (part of its length) is that end.
_AT_END = 0.005

_SIDES = (", just before the point", ", just after the point")
_UNITS = {"tension": "N", "end_force": "N", "curvature": "1/m"}


class Series(NamedTuple):
    """One quantity at one place: times (n,) s, values (n,), and how the head of the file describes it."""

    place: str
    s: float
    quantity: str
    t: np.ndarray
    values: np.ndarray
    basis: str


class Made(NamedTuple):
    """The content of the files of an export, what to say of it, and what to warn of."""

    files: tuple[bytes | memoryview, ...]
    text: str = ""
    notes: Sequence[str] = ()


def fatigue(chosen: Part) -> Made:
    """Cycles and histories of outputs and steps, at the places that matter and those that were asked for.

    ResultError when there are fewer than three outputs, or rainflow is not installed.
    """
    optional_package("rainflow", "counting cycles", "export")
    part, asked = replace(chosen, at=None), [] if chosen.at is None else chosen.at.tolist()
    if len(part.times) < 3:
        raise ResultError(
            f"{len(part.times)} output{'s have' if len(part.times) > 1 else ' has'} no cycles\n"
            "    try:      a result of `hybrid run`, and a window of time with more outputs"
        )
    bends = bends_of(part.result, part.rows)
    places = _places(part, bends, asked)
    series = [x for s, name in places.items() for x in _series_at(part, bends, s, name)]
    largest = {q: max((np.abs(x.values).max() for x in series if x.quantity == q), default=0.0) for q in _UNITS}
    noise, rows = 0, []
    for x in series:
        for size, mean, number, a, b in _cycles(x.values):
            if size <= _NOISE * largest[x.quantity]:
                noise += 1
                continue
            rows.append((x.place, x.s, x.quantity, _UNITS[x.quantity], size, mean, number, x.t[a], x.t[b]))
    rows.sort(key=lambda row: (row[1], row[2], -row[4]))
    names = ["place", "s (m)", "quantity", "unit", "range", "mean", "count", "t_from (s)", "t_to (s)"]
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(names)
    base, notes = _base(part, series)
    names_of = {f"{x.quantity} ({_UNITS[x.quantity]}) at s = {x.s:.9g} m": x for x in series}
    histories = [base, *(np.interp(base, x.t, x.values) for x in names_of.values())]
    notes += [note for x in series if x.quantity == "end_force" for note in _too_slow(part, x)]
    head = [*head_lines(part), *(f"note: {note}" for note in notes)]
    head += ["cycles: rainflow (ASTM E1049), of every value that was recorded; a count of 0.5 is half a cycle"]
    head += [f"left out: {noise} cycles below {_NOISE:g} of the largest of all places, the solver's tolerance"]
    head += ["not done: stress from tension and curvature, which needs the section; S-N curves; damage"]
    head += [f"{x.quantity} at s = {x.s:.9g} m ({x.place}): {x.basis}" for x in series]
    head += scene_lines(part)
    cycles = _table("cycles", head, names, [np.array(column) for column in columns])
    text = f"{len(rows)} cycles at {len(places)} places; "
    return Made((cycles, _table("histories", head, ["t (s)", *names_of], histories)), text, notes)


# ---- where ----------------------------------------------------------------------------------------


def _places(part: Part, bends: Bends, asked: Sequence[float]) -> dict[float, str]:
    """Arc lengths (m) in their order, and why each is there."""
    s, result = bends.s, part.result
    largest = np.ptp(_about_main_axis(bends.vectors)[0], axis=0)
    ends = _ends(part)
    found = [(s[0], "start" if s[0] in ends else "first output point")]
    found += [(s[-1], "end" if s[-1] in ends else "last output point")]
    if "touchdown" in result:
        edges, length = part.array("touchdown"), s[-1] - s[0]
        for k in (0, 1):
            edge = edges[np.isfinite(edges[:, k]), k]
            if len(edge) and not np.all(np.abs(edge - s[[0, -1]][k]) < _AT_END * length):
                a, b = np.searchsorted(s, [edge.min(), edge.max()])
                near = slice(max(a - 1, 0), b + 1)  # the points on both sides of where it goes
                found.append((s[near][largest[near].argmax()], "touchdown"))
    found.append((s[largest.argmax()], "largest range of curvature"))
    found += [(float(x), "asked for") for x in asked]
    places: dict[float, str] = {}
    for x, why in sorted(found):
        places[float(x)] = f"{places[x]} and {why}" if x in places else why
    return places


def _about_main_axis(bends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The component about the axis of most bending, per place (nt, n), and its share of the square (n,)."""
    axes = np.linalg.eigh(np.einsum("tni,tnj->nij", bends, bends))[1][..., -1]
    values = np.einsum("tni,ni->tn", bends, axes)
    values *= np.where(values.sum(axis=0) < 0.0, -1.0, 1.0)
    whole = (bends**2).sum(axis=(0, 2))
    return values, np.divide((values**2).sum(axis=0), whole, out=np.ones_like(whole), where=whole > 0.0)


# ---- what -----------------------------------------------------------------------------------------


def _ends(part: Part) -> dict[float, str]:
    """Names of end forces by the arc lengths, m, of those ends that are among the output points."""
    zones, s = part.zones[0], part.s
    near = 1e-9 * zones[-1].s_b
    found = {s[0]: "end_force_start"} if s[0] <= zones[0].s_a + near else {}
    return found | ({s[-1]: "end_force_end"} if s[-1] >= zones[-1].s_b - near else {})


def _series_at(part: Part, bends: Bends, s: float, place: str) -> list[Series]:
    """End force or tension, and curvature, at one place; of two values the one that has the larger range."""
    result, times = part.result, part.times
    series = []
    end_force = _ends(part).get(s, "")
    if end_force and f"steps/{end_force}" in result and len(part.array("steps/t")) > 2:
        basis = "magnitude of the force that holds the end (of an end body: of the line on it), at every step"
        series.append(Series(place, s, "end_force", part.array("steps/t"), part.array(f"steps/{end_force}"), basis))
    else:
        found = [result.at(s=s, names=["tension"], side=side)["tension"][part.rows] for side in ("left", "right")]
        k = int(np.ptp(found[1]) > np.ptp(found[0]))
        side = _SIDES[k] if part.after("tension", s) is not None else ""
        series.append(
            Series(place, s, "tension", times, found[k], f"at every output{side}" + _error(part, "tension", s, k))
        )
    values, share = _about_main_axis(bends.interpolated(np.array([s])).vectors)
    k = int(np.ptp(values, axis=0).argmax())
    side = _SIDES[k] if values.shape[1] > 1 else ""
    basis = f"about the axis it bends most about, at every output{side}; zones: " + _kinds(part, s)
    if share[k] < _PLANAR:
        basis += (
            f"; only {100 * share[k]:.0f} % of its square: it bends about other axes too, and those are not counted"
        )
    series.append(Series(place, s, "curvature", times, values[:, k], basis + _error(part, "curvature", s, k)))
    return series


def _kinds(part: Part, s: float) -> str:
    found, names = part.zone_kinds(np.array([s]))
    shares = {name: np.mean(found == k) for k, name in enumerate(names)}
    return ", ".join(f"{name} {100 * share:.0f} % of the outputs" for name, share in shares.items() if share)


def _error(part: Part, name: str, s: float, k: int) -> str:
    """What is known of an error at a place; k: 0 on the left of a jump, 1 on its right."""
    error, basis = error_name(part, name)
    if not error:
        return "; error not estimated"
    most = part.result.at(s=s, names=[error], side=("left", "right")[k])[error][part.rows].max()
    return f"; error at most {most:.3g} {_UNITS[name]}, {basis}"


def _cycles(values: np.ndarray) -> list[Any]:
    """Range, mean, count, and the indices between which it lies, of every cycle."""
    import rainflow

    return list(rainflow.extract_cycles(values.tolist()))


# ---- how well -------------------------------------------------------------------------------------


def _base(part: Part, series: Sequence[Series]) -> tuple[np.ndarray, list[str]]:
    """Times of one interval (n,) s for all histories: that of the outputs, or a whole part of it for the step log."""
    outputs, notes = part.times, []
    gaps = np.diff(outputs)
    every = float(gaps.mean())
    if np.ptp(gaps) > 1e-6 * every:
        every = float(gaps.min())
        notes.append(f"the outputs are {every:.4g} to {gaps.max():.4g} s apart: histories are linear between them")
    logs = [x for x in series if x.quantity == "end_force"]
    steps = [np.median(np.diff(x.t)) for x in logs]
    interval = every / max([1, *(int(np.ceil(every / step - 1e-6)) for step in steps)])
    first, last = max(x.t[0] for x in series), min(x.t[-1] for x in series)
    begin = outputs[0] + interval * np.ceil((first - outputs[0]) / interval - 1e-6)
    base = begin + interval * np.arange(int((last - begin) / interval + 1e-6) + 1)
    for x in logs:
        whole = np.ptp(x.values)
        kept = np.ptp(np.interp(base, x.t, x.values)) / whole if whole > _NOISE * np.abs(x.values).max() else 1.0
        if kept < _KEPT:
            notes.append(
                f"the histories of the end force at s = {x.s:.6g} m show {100 * kept:.1f} % of its range: steps are "
                f"shorter than {interval:.4g} s at times; the cycles are counted at every step"
            )
    return base, notes


def _too_slow(part: Part, log: Series) -> list[str]:
    """A warning when outputs or steps are too far apart for the fastest cycles at an end."""
    cycles = _cycles(log.values)
    largest = max((c[0] for c in cycles), default=0.0)
    major = [c for c in cycles if c[0] >= _MAJOR * largest and largest > _NOISE * np.abs(log.values).max()]
    if not major:
        return []
    # what begins or ends with the record is cut off, and looks quicker than it is
    major = [c for c in major if c[3] > 0 and c[4] < len(log.t) - 1] or major
    period = min(2.0 * (log.t[c[4]] - log.t[c[3]]) for c in major)
    every, step = float(np.diff(part.times).max()), float(np.median(np.diff(log.t)))
    notes = []
    if every * _SAMPLES > period * (1 + 1e-9):
        seen = _cycles(np.interp(part.times, log.t, log.values))
        lost_range = 1.0 - max((c[0] for c in seen), default=0.0) / largest
        weights = [sum(c[2] * c[0] ** _SLOPE for c in found) for found in (cycles, seen)]
        notes.append(
            f"outputs every {every:.4g} s are far apart for cycles of {period:.4g} s in the end force at "
            f"s = {log.s:.6g} m: at the outputs alone its largest range would be {100 * lost_range:.2g} % smaller "
            f"and the sum of count x range^{_SLOPE} {100 * (1 - weights[1] / weights[0]):.2g} % smaller; at other "
            f"places the loss is unknown; "
            f"try output: {{every: {period / _SAMPLES:.2g}}}"
        )
    if step * _SAMPLES > period * (1 + 1e-9):
        notes.append(
            f"steps of {step:.4g} s are long for cycles of {period:.4g} s in the end force at s = {log.s:.6g} m; "
            f"try time.step: {period / _SAMPLES:.2g}"
        )
    return notes


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


def _csv(part: Part) -> Made:
    columns = histories(part)
    head = head_lines(part) + _span_of_envelope(part) + _errors_of(part) + scene_lines(part)
    rows = len(next(iter(columns.values())))
    text = f"{rows} row{'s' * (rows != 1)}, {len(columns)} columns; "
    return Made((_table("histories", head, list(columns), list(columns.values())),), text)


_MADE = {
    "nc": lambda part: Made((netcdf(part),)),
    "csv": _csv,
    "vtkhdf": lambda part: Made((vtkhdf(part),)),
    "fatigue": fatigue,
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
