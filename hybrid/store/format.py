"""What a result file is made of, on disk or in memory.

Fields form tables, which HDF5 gets.  The layout is described in store/reader.py; store/writer.py fills it.  Contents as
arrays in memory are what a `Result` reads from as well, and are written to a file in one go.
"""

from __future__ import annotations

import io
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5i, h5s, h5t

from hybrid.errors import ResultError

FORMAT = "hybrid-cable"
FORMAT_VERSION = 1
# Bytes of a chunk: several outputs together, for quick histories, yet a static result stays small.
_CHUNK_BYTES = 65536
# Bytes of chunks that HDF5 keeps of every dataset: what is written is not read again, and its own 8 MB of each would
# make a long run grow by 80 MB in a million steps (tests/harden/test_harden_long.py).
CACHE = 4 * _CHUNK_BYTES
# Rows of the step log held back before they are written: 1 ms of writing then costs 2 us a step.
BLOCK = 512
# Widths of fixed texts (bytes): a kind is a word, an event a sentence or two.
_KIND, _TEXT = "S32", "S512"
ZoneRows = Sequence[tuple[str, float, float]]  # kinds, and from where to where, m
INDEX = "index"  # description of a dimension that has no scale of its own
STATUS_WIDTHS = {"status": 32, "message": 2048}  # bytes
_RESERVED = {"t", "s", "xyz", "scene", "steps", "zones", "events", "changes", "checkpoint"}


@dataclass(frozen=True)
class Field:
    """One recorded quantity.

    `shape` and `dims` are those at one output time, without t: (ns, 3) and ("s", "xyz").
    A name with a slash (``energy/kinetic``) goes into a group.  `frame` is "inertial",
    "body" or empty.  `dtype` is float64, int64 or S<n> (UTF-8 text of n bytes at most).
    """

    name: str
    unit: str
    description: str
    shape: tuple[int, ...] = ()
    dims: tuple[str, ...] = ()
    frame: str = ""
    nan_ok: bool = False
    dtype: str = "float64"


TIME = Field("t", "s", "output times")
ZONES = (
    Field("t", "s", "time of the first output with these zones"),
    Field("output", "", "number of that output, from 0", dtype="int64"),
    Field("kind", "", "kind of the zone", dtype=_KIND),
    Field("s_a", "m", "begin of the zone, unstretched arc length"),
    Field("s_b", "m", "end of the zone, unstretched arc length"),
)
EVENTS = (
    Field("t", "s", "time of the event"),
    Field("s_a", "m", "begin of the stretch concerned, unstretched arc length"),
    Field("s_b", "m", "end of the stretch concerned, unstretched arc length"),
    Field("kind", "", "kind of the event", dtype=_KIND),
    Field("text", "", "what happened and why", dtype=_TEXT),
    Field("criterion", "", "of a change of zones: the criterion that asks, or held the rod longest", dtype=_KIND),
    Field("value", "", "what that criterion has there: its ratio", nan_ok=True),
    Field("threshold", "", "above which it asks, or below which it lets go", nan_ok=True),
    Field("energy", "J", "energy that all changes of zones at this moment put in, on the first of them", nan_ok=True),
)


def tables_of(fields: Sequence[Field], step_fields: Sequence[Field]) -> dict[str, Sequence[Field]]:
    """Columns of the tables of a file, by group."""
    return {"/": (TIME, *fields), "steps": step_fields, "zones": ZONES, "events": EVENTS}


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of the packages that a result depends on."""
    found = {"python": platform.python_version()}
    for package in ("hybrid-cable", "numpy", "h5py", "numba"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # run from a checkout that was not installed
            found[package] = "unknown"
    return found


def attributes_of_format() -> dict[str, str | int]:
    """Root attributes that are the same in all results of this version."""
    numbers = {f"version_{package}": number for package, number in versions().items()}
    return {"format": FORMAT, "format_version": FORMAT_VERSION, **numbers}


def status_attributes(status: str, message: str) -> dict[str, str]:
    """The attributes that say how a run ended, cut to what a file has room for."""
    given = {"status": status, "message": message}
    return {name: cut(given[name], width).decode() for name, width in STATUS_WIDTHS.items()}


def write_attributes(file: Any, attributes: Mapping[str, str | float | int]) -> None:
    """Add attributes to those of a new result; file: of which `attrs` is a mapping."""
    file.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
    for name, value in attributes.items():
        if name in file.attrs:
            raise ResultError(f"the attribute '{name}' is written by the recorder itself")
        file.attrs[name] = value


def write_texts(file: h5py.File, texts: Mapping[str, str]) -> None:
    """Texts as datasets of their own, instead of older ones; empty ones are left out."""
    for name, text in texts.items():
        if name in file:
            del file[name]
        if text:
            h5d.create(file.id, name.encode(), KIND_OF_TEXT, SCALAR).write(h5s.ALL, h5s.ALL, np.array(text, TEXT))


def scales_of(points: int, fields: Sequence[Field], fixed: Sequence[Field]) -> dict[str, Field]:
    """Dimension scales of what does not grow, by name; ResultError where two sizes of a dimension differ.

    Those with INDEX as description count from 0; `s`, and what is in `fixed`, get their values from `values_of_fixed`.
    """
    grid = Field("s", "m", "unstretched arc length from the start, of the output grid", (points,), ("s",))
    scales = {"s": grid} | {f.name: f for f in fixed if f.dims == (f.name,)}
    for field in (*fields, *fixed):
        for dim, size in zip(field.dims, field.shape, strict=True):
            if dim == "xyz":
                axes = Field("xyz", "", "axes of the inertial frame, z up", (3,), ("xyz",), dtype="S1")
                scales.setdefault(dim, axes)
            known = scales.setdefault(dim, Field(dim, "", INDEX, (size,), (dim,), dtype="int64"))
            if known.shape != (size,):
                raise ResultError(f"field '{field.name}' has {size} along {dim}, others have {known.shape[0]}")
    return scales


def scale_values(field: Field) -> np.ndarray:
    """What a new dimension scale holds."""
    if field.name == "xyz":
        return np.array([b"x", b"y", b"z"])
    return np.arange(field.shape[0]) if field.description == INDEX else np.zeros(field.shape, field.dtype)


def add_fixed(file: h5py.File, fixed: Sequence[tuple[Field, np.ndarray]]) -> None:
    """Quantities that do not grow and that the file does not have yet; of the dimensions, scales come first."""
    for field, values in fixed:
        if field.name in file:
            continue
        data = file.create_dataset(field.name, data=checked(field, np.asarray(values, dtype=field.dtype)))
        annotate(data, field.unit, field.description, field.frame)
        if field.dims == (field.name,):
            data.make_scale(field.name)
            data.dims[0].label = field.name
        else:
            attach_scales(data.id, field.dims, [file[d].id for d in field.dims])


def values_of_fixed(grid_s: np.ndarray, fixed: Sequence[tuple[Field, np.ndarray]]) -> dict[str, np.ndarray]:
    """Checked values by name of what does not grow; ResultError."""
    if grid_s.ndim != 1 or len(grid_s) == 0 or not np.isfinite(grid_s).all() or (np.diff(grid_s) <= 0).any():
        raise ResultError("the output grid must be increasing finite arc lengths")
    return {"s": grid_s} | {f.name: checked(f, np.asarray(values, dtype=f.dtype)) for f, values in fixed}


def write_all(data: h5d.DatasetID, values: np.ndarray) -> None:
    """Write all numbers of a dataset that does not grow, by HDF5's own interface: h5py takes eight times as long."""
    if data.shape != values.shape:
        raise ResultError(f"{h5i.get_name(data).decode()} has shape {values.shape}, expected {data.shape}")
    data.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values))


def chunk_rows(size: int) -> int:
    """Rows of so many bytes in a chunk of a table that grows."""
    return max(1, _CHUNK_BYTES // max(size, 1))


def attach_scales(data: h5d.DatasetID, dims: Sequence[str], scales: Sequence[h5d.DatasetID]) -> None:
    """Name the dimensions of a dataset and attach their scales; h5py itself takes four times as long."""
    for k, (dim, scale) in enumerate(zip(dims, scales, strict=True)):
        h5ds.set_label(data, k, dim.encode())
        h5ds.attach_scale(data, scale, k)


TEXT = h5py.string_dtype()
KIND_OF_TEXT, SCALAR = h5t.py_create(TEXT, logical=True), h5s.create(h5s.SCALAR)


def annotate(data: h5py.Dataset | h5d.DatasetID, unit: str, description: str, frame: str = "") -> None:
    """Write what a new dataset is as attributes; "units" and "long_name" are what netCDF programs look for."""
    texts = {"units": unit, "description": description, "long_name": description} | ({"frame": frame} if frame else {})
    to = data if isinstance(data, h5d.DatasetID) else data.id
    for name, text in texts.items():
        h5a.create(to, name.encode(), KIND_OF_TEXT, SCALAR).write(np.array(text, dtype=TEXT))


def check_column(file: h5py.Group, group: str, field: Field) -> None:
    """ResultError unless a dataset is one of the field to which rows can be appended.

    HDF5 never comes back from closing a file in which it could not append.
    """
    name = f"{group}/{field.name}".lstrip("/")
    data = file[name]
    if not isinstance(data, h5py.Dataset):
        found = "a group"
    elif data.dtype.str != np.dtype(field.dtype).str or data.shape is None or data.shape[1:] != field.shape:
        found = f"{data.dtype} of shape {data.shape}"
    elif data.chunks is None or data.maxshape != (None, *field.shape):
        found = f"one that cannot grow (chunks {data.chunks}, maxshape {data.maxshape})"
    else:
        return
    expected = f"{np.dtype(field.dtype)} of shape {('rows', *field.shape)}, that grows"
    where = getattr(file, "filename", "") or file.file.filename
    raise ResultError(
        f"{where} cannot be resumed\n    given:    {name}: {found}\n    expected: {expected}\n"
        "    try:      the file as hybrid wrote it, or run its scene again"
    )


def check_names(
    fields: Sequence[Field], step_fields: Sequence[Field], fixed: Sequence[tuple[Field, np.ndarray]]
) -> None:
    both = [*fields, *(f for f, _ in fixed)]
    for names in ([f.name for f in both], [f.name for f in step_fields]):
        if len(set(names)) < len(names):
            raise ResultError(f"fields given twice: {', '.join(sorted({n for n in names if names.count(n) > 1}))}")
    for field in both:
        if field.name.split("/")[0] in _RESERVED:
            raise ResultError(f"the name '{field.name}' is taken by the recorder itself")
        if len(field.shape) != len(field.dims):
            raise ResultError(f"field '{field.name}' has shape {field.shape} but dims {field.dims}")
    for field in step_fields:
        if field.shape:
            raise ResultError(f"field '{field.name}' of the step log must be a number, not of shape {field.shape}")


def checked(field: Field, values: np.ndarray) -> np.ndarray:
    """The values of a quantity, or ResultError when their shape is wrong or one of them is not finite."""
    if values.shape != field.shape:
        raise ResultError(f"field '{field.name}' has shape {values.shape}, expected {field.shape}")
    if not (field.nan_ok or values.dtype.kind != "f" or np.isfinite(values).all()):
        bad = np.argwhere(~np.isfinite(np.atleast_1d(values)))[0]
        raise ResultError(f"field '{field.name}' is not finite (first at index {tuple(int(k) for k in bad)})")
    return values


def unsound(field: Field, values: np.ndarray, times: np.ndarray) -> tuple[int, str]:
    """How many outputs of a field's values (nb, ...) can be kept, and why the next cannot."""
    if values.shape != (times.size, *field.shape):
        found = values.shape[1:] if len(values) == times.size else values.shape
        return 0, f"field '{field.name}' has shape {found}, expected {field.shape}"
    if field.nan_ok or values.dtype.kind != "f" or np.isfinite(values).all():
        return times.size, ""
    first, *where = np.argwhere(~np.isfinite(values.reshape(times.size, *(field.shape or (1,)))))[0].tolist()
    return first, f"field '{field.name}' is not finite at t = {times[first]:.9g} s (first at index {tuple(where)})"


def fixed_text(text: str, dtype: np.dtype) -> np.ndarray:
    return np.array(cut(text, dtype.itemsize), dtype=dtype)


def cut(text: str, width: int) -> bytes:
    """UTF-8 of at most `width` bytes, cut between characters."""
    return str(text).encode()[:width].decode("utf-8", "ignore").encode()


def set_status(file: h5py.Group, status: str, message: str) -> None:
    for name, text in (("status", status), ("message", message)):
        file.attrs.modify(name, fixed_text(text, file.attrs.get_id(name).dtype))


def plain_text(value: object) -> str:
    """A text that HDF5 gives as bytes or as str."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


# What a result states before its first output: its grid, its fields, and all that does not grow with it.

# A text, or what makes it when it is asked for: YAML takes a tenth of the equilibrium of some lines.
Text = str | Callable[[], str]


def made(text: Text) -> str:
    """The text itself."""
    return text if isinstance(text, str) else text()


class Header(NamedTuple):
    """What a result states before its first output.

    grid_s: (ns,) output arc lengths, m, unstretched.  fields: what `save` brings.  step_fields: what `log` brings,
    time first.  attributes: more root attributes, `title` among them.  texts: "scene" as YAML, and others.
    fixed: quantities that do not depend on time, with their values; one whose only dimension is its own name becomes a
    dimension scale (the arc lengths of some probes, say).
    """

    grid_s: np.ndarray
    fields: Sequence[Field]
    step_fields: Sequence[Field]
    attributes: Mapping[str, str | float | int]
    texts: Mapping[str, Text] = MappingProxyType({})
    fixed: Sequence[tuple[Field, np.ndarray]] = ()


class ArrayDataset:
    """One array with what it says of itself; `valid` until the result is closed."""

    def __init__(self, field: Field, dims: tuple[str, ...], values: np.ndarray, grows: bool = False) -> None:
        """Values of an array of a result in memory.

        field: named as the array, with its table; dims: of all of the array, the rows of a table first; grows: a
        column of a table, to which a restarted run adds rows.
        """
        self.field, self.dims, self.values, self.grows, self.valid = field, dims, values, grows, True


class ArrayContents:
    """What a `Result` reads from, as `store.records.FileContents`, of a result in memory."""

    def __init__(
        self,
        data: Mapping[str, ArrayDataset],
        groups: Sequence[str],
        attributes: dict[str, Any],
        texts: Mapping[str, Text],
        parts: Mapping[str, ArrayContents] | None = None,
    ) -> None:
        """groups: that are there even if they are empty; parts: results of lines by name, of a result of several."""
        self.parts = dict(parts or {})
        self.order = tuple(self.parts)
        self.data: Mapping[str, Any] = {}
        self.groups, self.texts = list(groups), dict(texts)
        self.attributes, self.is_open = attributes, True
        self.add(data)

    def add(self, data: Mapping[str, ArrayDataset]) -> None:
        """More datasets by name, or others instead of those of the same names."""
        every = {**self.data, **data}
        self.data = dict(sorted(every.items(), key=lambda item: item[0].split("/")))
        parents = {name[:k] for name in every for k, x in enumerate(name) if x == "/"}
        self.groups = sorted({*self.groups, *parents})

    @property
    def size(self) -> int:
        """Bytes of all arrays."""
        return sum(x.values.nbytes for each in (self, *self.parts.values()) for x in each.data.values())

    def part(self, name: str) -> ArrayContents:
        """The result of a line, which is closed by itself."""
        found = self.parts[name]
        data = {key: ArrayDataset(x.field, x.dims, x.values) for key, x in found.data.items()}
        return ArrayContents(data, found.groups, found.attributes, found.texts)

    def scales(self) -> list[str]:
        return []

    def dims_of(self, data: ArrayDataset) -> tuple[str, ...]:
        return data.dims

    def units_of(self, data: ArrayDataset) -> str:
        return data.field.unit

    def label(self, name: str) -> dict[str, str]:
        field = self.data[name].field
        return {"units": field.unit, "description": field.description, "frame": field.frame}

    def length(self, name: str) -> int:
        return len(self.data[name].values)

    def values(self, name: str, rows: int | None) -> np.ndarray:
        return np.asarray(self.data[name].values)

    def text(self, name: str) -> str:
        return made(self.texts.get(name, ""))

    def close(self) -> None:
        """Let go of all arrays; those that were asked for stay with the result."""
        self.is_open = False
        for data in self.data.values():
            data.valid, data.values = False, np.zeros(0)


# A result in memory without a file: arrays, of which HDF5 knows nothing.
#
# HDF5 takes a third of a short run: to write some ninety datasets, to open them again, and to find out what they are.


class MemoryTarget:
    """Where a result in memory goes: `contents`, once it is recorded."""

    contents: ArrayContents | None = None


# A file, the bytes of one in memory, which can be amended, or arrays.
Target = Path | io.BytesIO | MemoryTarget
