"""Write what a run computes: `Recorder`, an HDF5 writer that knows nothing of the physics.

Every dataset is created before the first output, because the file is then switched to
SWMR (single writer, multiple readers): from that moment other processes can read it, and
a kill at any instant leaves a file that opens with all outputs saved before.  SWMR forbids
new datasets, new attributes and variable-length text; so texts have fixed widths, and
`status` and `message` are overwritten in place.  The layout is described in `read`.

Choices.  float64: an energy balance and a derivative of the output lose half their digits,
single precision would leave none.  No compression: the trailing digits of a computed motion
are noise (gzip with shuffle saves a tenth and takes three times as long), while a compressed chunk that grows must
be written to a new place at every output and SWMR does not reuse the old one.
"""

from __future__ import annotations

import io
import os
import platform
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from math import isfinite, nan
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

import h5py
import numpy as np

from hybrid.errors import LEFT_OUT, ResultError
from hybrid.results.intact import NONE, SUM, seal, sign
from hybrid.results.read import FORMAT, FORMAT_VERSION, is_result

# Bytes of a chunk: several outputs together, for quick histories, yet a static result stays small.
_CHUNK_BYTES = 16384
# Bytes of chunks that HDF5 keeps of every dataset: what is written is not read again, and its own 8 MB of each would
# make a long run grow by 80 MB in a million steps (tests/harden/test_harden_long.py).
_CACHE = 4 * _CHUNK_BYTES
# Events of a kind that are written, of some 700 bytes each; a run that has more of them goes on, and says how many.
MOST_OF_A_KIND = 10_000
# Rows of the step log held back before they are written: 1 ms of writing then costs 2 us a step.
_BLOCK = 512
# Outputs are held back at most this long (s): a reader hardly notices, a kill loses no more, and
# a run that saves a thousand times a second spends 1 % of its time here instead of half.
_PAUSE = 0.2
# Widths of fixed texts (bytes): a kind is a word, an event a sentence or two.
_KIND, _TEXT = "S32", "S512"
# The v110 file format is the oldest that has SWMR, so the most other programs can read it.
_LIBVER = ("v110", "v110")
_STATUS = ("running", "complete", "interrupted", "failed")
_RESERVED = {"t", "s", "xyz", "scene", "steps", "zones", "events"}


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


_TIME = Field("t", "s", "output times")
_ZONES = (
    Field("t", "s", "time of the first output with these zones"),
    Field("output", "", "number of that output, from 0", dtype="int64"),
    Field("kind", "", "kind of the zone", dtype=_KIND),
    Field("s_a", "m", "begin of the zone, unstretched arc length"),
    Field("s_b", "m", "end of the zone, unstretched arc length"),
)
_EVENTS = (
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


class _Table:
    """Datasets that grow together by whole rows; the first is the dimension scale of all."""

    def __init__(self, fields: Sequence[Field], datasets: Sequence[h5py.Dataset]) -> None:
        self.fields, self.datasets = tuple(fields), tuple(datasets)
        self.rows: list[Sequence[Any]] = []  # waiting to be written
        self.count = 0  # written rows

    def write(self) -> None:
        """Write the waiting rows to all datasets but the scale."""
        for k in range(1, len(self.fields)):
            self._write_column(k)

    def commit(self) -> None:
        """Write the scale, which tells readers that the rows are complete."""
        self._write_column(0)
        self.count += len(self.rows)
        self.rows = []

    def _write_column(self, k: int) -> None:
        if not self.rows:
            return
        field, data = self.fields[k], self.datasets[k]
        values = [row[k] for row in self.rows]
        if field.dtype.startswith("S"):
            column = np.array([_cut(v, int(field.dtype[1:])) for v in values], dtype=data.dtype)
        else:
            column = np.array(values, dtype=field.dtype)
        data.resize(self.count + len(values), axis=0)
        data[self.count :] = column


class Recorder:
    """Writes one result file; a context manager that closes it with the right status.

    target: path, or a BytesIO for a result in memory.  grid_s: (ns,) output arc lengths, m,
    unstretched.  fields: what `save` brings.  step_fields: what `log` brings, time first.
    attributes: more root attributes, `title` among them.  scene_text: the scene as YAML.
    fixed: quantities that do not depend on time, with their values; one whose only dimension
    is its own name becomes a dimension scale (the arc lengths of some probes, say).
    outputs: the number of outputs if it is known; it only makes small files smaller.
    overwrite: replace an existing result.  Another program's file is never replaced.
    """

    def __init__(
        self,
        target: str | Path | io.BytesIO,
        *,
        grid_s: np.ndarray,
        fields: Sequence[Field],
        step_fields: Sequence[Field],
        attributes: Mapping[str, str | float | int],
        scene_text: str,
        fixed: Sequence[tuple[Field, np.ndarray]] = (),
        outputs: int | None = None,
        overwrite: bool = False,
    ) -> None:
        _check_names(fields, step_fields, fixed)
        self._names = {f.name for f in fields}
        self._step_names = [f.name for f in step_fields]
        self._finite_steps = [k for k, f in enumerate(step_fields) if not f.nan_ok]
        self._zones: list[tuple[str, float, float]] | None = None
        self._happened: Counter[str] = Counter()  # events by kind
        self.last = -np.inf  # time of the last output, s
        self._flushed = -np.inf  # when the file was last brought up to date, s of the clock
        self.closed = False
        tables: tuple[tuple[str, Sequence[Field], int | None], ...] = (
            ("/", (_TIME, *fields), outputs),
            ("steps", step_fields, None),
            ("zones", _ZONES, outputs),
            ("events", _EVENTS, None),
        )

        def fill(file: h5py.File) -> None:
            _write_attributes(file, attributes)
            file.create_dataset("scene", data=scene_text, dtype=h5py.string_dtype()).attrs[SUM] = NONE
            _create_scales(file, np.asarray(grid_s, dtype=float), fields, fixed)
            for table in tables:
                _create_table(file, *table)

        self.path: Path | None = None
        if isinstance(target, io.BytesIO):
            self._file = h5py.File(target, "w", libver=_LIBVER, rdcc_nbytes=_CACHE)
            fill(self._file)
        else:
            self.path = Path(target).expanduser().resolve()
            self._file = _create_file(self.path, fill, overwrite)
        self._outputs, self._steps, self._zone_rows, self._events = (
            _Table(columns, [self._file[f"{group}/{f.name}"] for f in columns]) for group, columns, _ in tables
        )

    def save(self, t: float, values: Mapping[str, Any], zones: Sequence[tuple[str, float, float]]) -> None:
        """Append an output at time t (s), with the zones (kind, s_a, s_b) that hold then.

        ResultError when a field is missing, unknown, of another shape, or not finite.
        """
        if not (isfinite(t) and t > self.last):
            raise ResultError(f"an output at t = {t!r} s cannot follow the one at t = {self.last!r} s")
        if values.keys() != self._names:
            wrong = ", ".join(sorted(values.keys() ^ self._names))
            raise ResultError(f"the recorder was promised other fields; missing or unknown: {wrong}")
        row = [t, *(_checked(f, np.asarray(values[f.name]), t) for f in self._outputs.fields[1:])]
        now = [(str(kind), float(a), float(b)) for kind, a, b in zones]
        if not all(isfinite(a) and isfinite(b) for _, a, b in now):
            raise ResultError(f"a zone is not finite at t = {t:.9g} s: {now}")
        if now != self._zones:
            self._zone_rows.rows += [(t, self._outputs.count + len(self._outputs.rows), *zone) for zone in now]
            self._zones = now
        self._outputs.rows.append(row)
        self.last = float(t)
        if monotonic() - self._flushed > _PAUSE:
            self.flush()

    def log(self, values: Mapping[str, float | int]) -> None:
        """Append a row to the log of the steps; written with the next output or block."""
        row = [values[name] for name in self._step_names]
        for k in self._finite_steps:
            if not isfinite(row[k]):
                raise ResultError(f"'{self._step_names[k]}' of the step log is not finite: {row}")
        self._steps.rows += [row] if row else []
        if len(self._steps.rows) >= _BLOCK:
            self.flush()

    def event(
        self,
        t: float,
        s_a: float,
        s_b: float,
        kind: str,
        text: str,
        *,
        criterion: str = "",
        value: float = nan,
        threshold: float = nan,
        energy: float = nan,
    ) -> None:
        """Note that something happened at time t (s) on s_a <= s <= s_b (m), and why; the rest: of changes of zones."""
        if not (isfinite(t) and isfinite(s_a) and isfinite(s_b)):
            raise ResultError(f"event '{kind}' is not finite: t = {t} s, s = {s_a} ... {s_b} m")
        self._happened[kind] += 1
        if self._happened[kind] > MOST_OF_A_KIND:
            return
        self._events.rows.append((t, s_a, s_b, kind, text, criterion, value, threshold, energy))

    def flush(self) -> None:
        """Write what is held back, for readers to see."""
        others = [table for table in (self._events, self._zone_rows, self._steps) if table.rows]
        try:
            for table in (*others, self._outputs):
                table.write()
            # HDF5 may write in any order between two flushes.  So: the data, then the scales that
            # say it is there, and t last, which says that the zones of the output are there too.
            self._file.flush()
            for table in others:
                table.commit()
            if others:
                self._file.flush()
            self._outputs.commit()
            self._file.flush()
            self._flushed = monotonic()
        except OSError as error:
            advice = f"    detail:   {error}\n    try:      free some disk space"
            raise ResultError(f"{self.path} cannot be written\n{advice}") from error

    def close(self, status: str = "complete", message: str = "") -> None:
        """Write the status and close the file; a second call does nothing."""
        if self.closed:
            return
        if status not in _STATUS:
            raise ValueError(f"status {status!r} is none of {', '.join(_STATUS)}")
        self.closed = True
        try:
            self._count_left_out()
            self.flush()
            seal(self._file)
            for name, text in (("status", status), ("message", message)):
                self._file.attrs.modify(name, _fixed(text, self._file.attrs.get_id(name).dtype))
        finally:
            self._file.close()
        if self.path is not None:
            sign(self.path)

    def _count_left_out(self) -> None:
        """Of events that were too many to write: how many there were."""
        for kind, count in self._happened.items():
            left = count - MOST_OF_A_KIND
            if left > 0:
                text = f"{left} more events '{kind}' are not written, after the first {MOST_OF_A_KIND}"
                row = (max(self.last, 0.0), 0.0, 0.0, LEFT_OUT, text, kind, float(left), nan, nan)
                self._events.rows.append(row)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        elif issubclass(kind, Exception):
            self.close("failed", str(error) or kind.__name__)
        else:  # Ctrl-C, or a SystemExit made of a signal
            self.close("interrupted", "stopped from outside")


def amend(
    target: Path | io.BytesIO,
    fields: Sequence[tuple[Field, np.ndarray]],
    attributes: Mapping[str, str | float | int],
    events: Sequence[tuple[str, str]] = (),
) -> None:
    """Add to a complete result what is known only afterwards.

    fields: quantities over the output times, (nt, ...), with their values; events: kind and text, of all the cable.
    """
    where = target if isinstance(target, io.BytesIO) else target.expanduser().resolve()
    new: Path | io.BytesIO = where
    try:
        if isinstance(where, Path):  # beside it, and then in its place: somebody may be reading
            new = where.with_name(f".{where.name}.{os.getpid()}.new")
            shutil.copyfile(where, new)
        with h5py.File(new, "r+", libver=_LIBVER, locking="best-effort") as file:
            for name, value in attributes.items():
                file.attrs[name] = value
            for field, values in fields:
                _checked(field, values[0], None)
                data = file.create_dataset(field.name, data=values)
                _annotate(data, field.unit, field.description, field.frame)
                _attach(data, ("t", *field.dims), [file["t"], *(file[d] for d in field.dims)])
            if events:
                table = _Table(_EVENTS, [file[f"events/{f.name}"] for f in _EVENTS])
                table.count = len(file["events/t"])
                table.rows = [(0.0, 0.0, float(file["s"][-1]), *event, "", nan, nan, nan) for event in events]
                table.write()
                table.commit()
            seal(file)
        if isinstance(new, Path):
            sign(new)
        if isinstance(where, Path) and isinstance(new, Path):
            os.replace(new, where)
    except OSError as error:
        if isinstance(new, Path):
            new.unlink(missing_ok=True)
        advice = "free some disk space; close programs that hold the file"
        raise ResultError(f"{where} cannot be written\n    detail:   {error}\n    try:      {advice}") from error


def check_target(path: Path, overwrite: bool) -> None:
    """ResultError if a result cannot be written there."""
    if path.exists():
        if path.is_dir():
            raise ResultError(f"{path} is a folder\n    try:      name a file in it, such as {path / 'run.h5'}")
        if not overwrite:
            raise ResultError(f"{path} exists\n    try:      another name, or allow overwriting")
        if not os.access(path, os.W_OK) or (path.stat().st_size and not is_result(path)):
            why = "is not a result of hybrid" if os.access(path, os.W_OK) else "is write-protected"
            raise ResultError(f"{path} exists and {why}\n    try:      another name, or delete the file yourself")
    if not path.parent.is_dir():
        raise ResultError(f"there is no folder {path.parent}\n    try:      mkdir -p {path.parent}")


def _create_file(path: Path, fill: Any, overwrite: bool) -> h5py.File:
    """Make the file under another name, move it into place whole, and open it to readers.

    So an older result survives a failed start, and a reader who has it open keeps what he sees.
    """
    check_target(path, overwrite)
    new = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        with h5py.File(new, "w", libver=_LIBVER, locking="best-effort") as file:
            fill(file)
        os.replace(new, path)
        file = h5py.File(path, "r+", libver=_LIBVER, locking="best-effort", rdcc_nbytes=_CACHE)
        file.swmr_mode = True
    except OSError as error:
        advice = "a folder you may write to, with free space; close programs that hold the file"
        raise ResultError(f"{path} cannot be written\n    detail:   {error}\n    try:      {advice}") from error
    finally:
        new.unlink(missing_ok=True)
    return file


def _write_attributes(file: h5py.File, attributes: Mapping[str, str | float | int]) -> None:
    file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
    file.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
    file.attrs["version_python"] = platform.python_version()
    for package in ("hybrid-cable", "numpy", "h5py", "numba"):
        try:
            file.attrs[f"version_{package}"] = version(package)
        except PackageNotFoundError:  # run from a checkout that was not installed
            file.attrs[f"version_{package}"] = "unknown"
    for name, text, width in (("status", "running", 32), ("message", "", 2048)):
        dtype = h5py.string_dtype("utf-8", width)  # fixed, to be overwritten by `close`
        file.attrs.create(name, _fixed(text, dtype), dtype=dtype)
    for name, value in attributes.items():
        if name in file.attrs:
            raise ResultError(f"the attribute '{name}' is written by the recorder itself")
        file.attrs[name] = value


def _create_scales(
    file: h5py.File, grid_s: np.ndarray, fields: Sequence[Field], fixed: Sequence[tuple[Field, np.ndarray]]
) -> None:
    """The datasets that do not grow: dimension scales first, then the fixed quantities."""
    if grid_s.ndim != 1 or len(grid_s) == 0 or not np.isfinite(grid_s).all() or (np.diff(grid_s) <= 0).any():
        raise ResultError("the output grid must be increasing finite arc lengths")
    scales: dict[str, tuple[Field, np.ndarray]] = {
        "s": (Field("s", "m", "unstretched arc length from the start, of the output grid"), grid_s)
    }
    scales |= {f.name: (f, _checked(f, np.asarray(v), None)) for f, v in fixed if f.dims == (f.name,)}
    for field in (*fields, *(f for f, _ in fixed)):
        for dim, size in zip(field.dims, field.shape, strict=True):
            if dim == "xyz":
                axes = np.array([b"x", b"y", b"z"])
                scales.setdefault(dim, (Field("xyz", "", "axes of the inertial frame, z up", dtype="S1"), axes))
            index = Field(dim, "", "index", dtype="int64")
            known = scales.setdefault(dim, (index, np.arange(size)))[1]
            if len(known) != size:
                raise ResultError(f"field '{field.name}' has {size} along {dim}, others have {len(known)}")
    for name, (field, values) in scales.items():
        data = file.create_dataset(name, data=values)
        _annotate(data, field.unit, field.description, field.frame)
        data.make_scale(name)
        data.dims[0].label = name
    for field, values in fixed:
        if field.name not in scales:
            array = _checked(field, np.asarray(values, dtype=field.dtype), None)
            data = file.create_dataset(field.name, data=array)
            _annotate(data, field.unit, field.description, field.frame)
            _attach(data, field.dims, [file[d] for d in field.dims])


def _create_table(file: h5py.File, group: str, fields: Sequence[Field], rows: int | None) -> None:
    """Datasets that grow along their first dimension, whose scale is the first of them."""
    parent = file.require_group(group)
    for k, field in enumerate(fields):
        is_text = field.dtype.startswith("S")
        dtype = h5py.string_dtype("utf-8", int(field.dtype[1:])) if is_text else np.dtype(field.dtype)
        size = int(dtype.itemsize * np.prod(field.shape, dtype=int))
        chunk = max(1, min(_CHUNK_BYTES // max(size, 1), _BLOCK, rows or _BLOCK))
        data = parent.create_dataset(
            field.name, (0, *field.shape), dtype, maxshape=(None, *field.shape), chunks=(chunk, *field.shape)
        )
        _annotate(data, field.unit, field.description, field.frame)
        if k == 0:
            scale = data
            scale.make_scale(field.name)
            data.dims[0].label = data.name.lstrip("/")
        else:
            _attach(data, (scale.name.lstrip("/"), *field.dims), [scale, *(file[d] for d in field.dims)])


def _attach(data: h5py.Dataset, dims: Sequence[str], scales: Sequence[h5py.Dataset]) -> None:
    for k, (dim, scale) in enumerate(zip(dims, scales, strict=True)):
        data.dims[k].label = dim
        data.dims[k].attach_scale(scale)


def _annotate(data: h5py.Dataset, unit: str, description: str, frame: str = "") -> None:
    data.attrs["units"], data.attrs["description"] = unit, description  # "units": what netCDF programs look for
    data.attrs[SUM] = NONE
    if frame:
        data.attrs["frame"] = frame


def _check_names(
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


def _checked(field: Field, values: np.ndarray, t: float | None) -> np.ndarray:
    """The values, or ResultError when their shape is wrong or one of them is not finite."""
    if values.shape != field.shape:
        raise ResultError(f"field '{field.name}' has shape {values.shape}, expected {field.shape}")
    if not (field.nan_ok or values.dtype.kind != "f" or np.isfinite(values).all()):
        bad = np.argwhere(~np.isfinite(np.atleast_1d(values)))[0]
        at = f" at t = {float(t):.9g} s" if t is not None else ""
        raise ResultError(f"field '{field.name}' is not finite{at} (first at index {tuple(int(k) for k in bad)})")
    return values


def _fixed(text: str, dtype: np.dtype) -> np.ndarray:
    return np.array(_cut(text, dtype.itemsize), dtype=dtype)


def _cut(text: str, width: int) -> bytes:
    """UTF-8 of at most `width` bytes, cut between characters."""
    return str(text).encode()[:width].decode("utf-8", "ignore").encode()
