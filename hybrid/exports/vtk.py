"""A result as VTKHDF, the format of ParaView for data over time: the cable as poly lines.

One file holds all outputs.  At each the cable is one poly line per stretch of zones of one kind, so that a line can be
coloured by it; neighbours share the point between them.  Points carry what is recorded over t and s, lines the kind of
their zone, and field data what is recorded over t alone.  The file is written with h5py; VTK is only needed to read it.

Layout (VTKHDF 2.0, PolyData): every array holds all outputs one behind the other, and /VTKHDF/Steps says where each
begins.  An output is one part, with lines of its own, since zones may have moved.
"""

from __future__ import annotations

import io
from typing import Any

import h5py
import numpy as np

from hybrid.errors import ResultError
from hybrid.store.selection import Part, facts

# The four kinds of cells of PolyData, in the order of the format; we have lines.
_CELLS = ("Vertices", "Lines", "Polygons", "Strips")
_LINES = _CELLS.index("Lines")


def image(part: Part) -> memoryview:
    """The cable over time, as a file.  ResultError when the result has no positions."""
    if "position" not in part.result:
        raise ResultError("a cable without 'position' cannot be drawn\n    try:      a run that records it")
    points, s = part.array("position"), part.s
    if len(s) < 2:
        raise ResultError("a line needs two points\n    try:      two places or more in at")
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
        kinds, counts, meanings = _write_lines(root, part)
        _write_point_data(root, part)
        data = root.create_group("CellData").create_dataset("zone_kind", data=kinds)
        data.attrs["meanings"] = meanings
        steps.create_group("CellDataOffsets")["zone_kind"] = np.cumsum(counts) - counts
        _write_field_data(root, part, meanings)
    return memory.getbuffer()


def _write_lines(root: Any, part: Part) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """The lines of all outputs; the kind of zone of each, how many there are per output, and names of the kinds."""
    s, nt = part.s, len(part.times)
    segments, meanings = part.zone_kinds(0.5 * (s[:-1] + s[1:]))
    offsets, connectivity, kinds, counts, ids = [], [], [], np.zeros(nt, int), np.zeros(nt, int)
    for i, row in enumerate(segments):
        begins = np.concatenate([[0], 1 + np.flatnonzero(np.diff(row))])
        ends = np.concatenate([begins[1:], [len(row)]])
        lines = [np.arange(a, b + 1) for a, b in zip(begins, ends, strict=True)]
        counts[i], ids[i] = len(lines), sum(map(len, lines))
        offsets.append(np.concatenate([[0], np.cumsum([len(line) for line in lines])]))
        connectivity += lines
        kinds.append(row[begins])
    empty = np.zeros(nt, int)
    cell_offsets, id_offsets = np.zeros((nt, 4), int), np.zeros((nt, 4), int)
    cell_offsets[:, _LINES], id_offsets[:, _LINES] = np.cumsum(counts) - counts, np.cumsum(ids) - ids
    for name in _CELLS:
        group, ours = root.create_group(name), name == "Lines"
        group["NumberOfCells"] = counts if ours else empty
        group["NumberOfConnectivityIds"] = ids if ours else empty
        group["Offsets"] = np.concatenate(offsets) if ours else empty  # of no cells: one 0 per part
        group["Connectivity"] = np.concatenate(connectivity) if ours else np.zeros(0, int)
    root["Steps/CellOffsets"], root["Steps/ConnectivityIdOffsets"] = cell_offsets, id_offsets
    return np.concatenate(kinds), counts, meanings


def _write_point_data(root: Any, part: Part) -> None:
    """What is recorded over t and s, and s itself, which all outputs share."""
    data, offsets = root.create_group("PointData"), root.create_group("Steps/PointDataOffsets")
    nt, ns = len(part.times), len(part.s)
    data["s"] = part.s
    data["s"].attrs["units"] = "m"
    offsets["s"] = np.zeros(nt, int)
    for name in part.names:
        if part.result.dims(name)[:2] == ("t", "s") and name != "position":
            array, short = part.array(name), name.replace("/", "_")
            data[short] = array.reshape(nt * ns, *array.shape[2:])
            data[short].attrs["units"] = part.result.units[name]
            offsets[short] = ns * np.arange(nt)


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
