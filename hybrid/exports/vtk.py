"""A result as VTKHDF, the format of ParaView for data over time: the cable as poly lines.

One file holds all outputs.  At each the cable is one poly line per stretch of zones of one kind, so that a line can be
coloured by it; neighbours share the point between them.  Points carry what is recorded over t and s, lines the kind of
their zone, and field data what is recorded over t alone.  Obstacles are triangles behind the lines, of a kind of their
own, on points behind those of the cable, where what is recorded over s is NaN; endless ones end beyond the cable.
The file is written with h5py; VTK is only needed to read it.

Layout (VTKHDF 2.0, PolyData): every array holds all outputs one behind the other, and /VTKHDF/Steps says where each
begins.  An output is one part, with lines of its own, since zones may have moved.
"""

from __future__ import annotations

import io
from typing import Any

import h5py
import numpy as np

from hybrid.errors import ResultError
from hybrid.store.obstacle_surfaces import obstacles_at, triangles_of
from hybrid.store.selection import Part, facts

# The four kinds of cells of PolyData, in the order of the format; we have lines.
_CELLS = ("Vertices", "Lines", "Polygons", "Strips")
_LINES, _POLYGONS = _CELLS.index("Lines"), _CELLS.index("Polygons")
# In sizes of the box of the cable: how far beyond it endless obstacles go on.
_BEYOND = 0.2


def image(part: Part) -> memoryview:
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
        kept = zip(("NumberOfCells", "NumberOfConnectivityIds", "Offsets", "Connectivity"), cells.get(name, nothing),
                   strict=True)  # fmt: skip
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
