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
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import isfinite, nan
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

import h5py
import numpy as np

from hybrid.errors import OMITTED, ResultError
from hybrid.store.checkpoint import BEFORE, Checkpoint, create_slots, write_before, write_slot
from hybrid.store.copying import copied, names_in
from hybrid.store.disk_space import ask_for_room
from hybrid.store.format import (
    BLOCK,
    CACHE,
    EVENTS,
    Field,
    annotate,
    attach,
    check_names,
    checked,
    create_scales,
    create_table,
    cut,
    set_status,
    tables_of,
    write_attributes,
    write_texts,
)
from hybrid.store.integrity import sign
from hybrid.store.named_arrays import Tree, pack
from hybrid.store.reader import is_result

# Events of a kind that are written, of some 700 bytes each; a run that has more of them goes on, and says how many.
MOST_OF_A_KIND = 10_000
# Outputs are held back at most this long (s), and so many times as long as writing takes: a reader hardly notices, a
# kill loses no more, and a run that saves a thousand times a second spends 2 % of its time here instead of half.
_PAUSE, _PART = 0.2, 50.0
# The v110 file format is the oldest that has SWMR, so the most other programs can read it.
_LIBVER = ("v110", "v110")
AFTERWARDS = ("error_", "effort_", "accuracy_")  # attributes that `amend` brings
_STATUS = ("running", "complete", "interrupted", "failed")


# Files that HDF5 could not write: it cannot close them either, and letting go of one ends the process.
ABANDONED: list[Any] = []


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

    @property
    def room(self) -> int:
        """Bytes that writing the waiting rows may take: of every dataset, its last chunk and those that follow."""
        rows = len(self.rows)
        return sum(
            x.dtype.itemsize * int(np.prod(x.shape[1:], dtype=int)) * (rows + x.chunks[0]) for x in self.datasets
        )

    @property
    def scale(self) -> str:
        """Name of the first dataset, which says how many rows are complete."""
        return self.datasets[0].name.lstrip("/")

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
            column = np.array([cut(v, int(field.dtype[1:])) for v in values], dtype=data.dtype)
        else:
            column = np.array(values, dtype=field.dtype)
        data.resize(self.count + len(values), axis=0)
        data[self.count :] = column


class Recorder:
    """Writes one result file; a context manager that closes it with the right status.

    target: path, or a BytesIO for a result in memory.  grid_s: (ns,) output arc lengths, m,
    unstretched.  fields: what `save` brings.  step_fields: what `log` brings, time first.
    attributes: more root attributes, `title` among them.  texts: "scene" as YAML, and others.
    fixed: quantities that do not depend on time, with their values; one whose only dimension
    is its own name becomes a dimension scale (the arc lengths of some probes, say).
    outputs: the number of outputs if it is known; it only makes small files smaller.
    overwrite: replace an existing result.  Another program's file is never replaced.
    before: what was found before the run, for whoever goes on with it; None: nobody can, it has no checkpoints.
    """

    def __init__(
        self,
        target: str | Path | io.BytesIO,
        *,
        grid_s: np.ndarray,
        fields: Sequence[Field],
        step_fields: Sequence[Field],
        attributes: Mapping[str, str | float | int],
        texts: Mapping[str, str],
        fixed: Sequence[tuple[Field, np.ndarray]] = (),
        outputs: int | None = None,
        overwrite: bool = False,
        before: Tree | None = None,
    ) -> None:
        check_names(fields, step_fields, fixed)
        tables = tables_of(fields, step_fields)

        def fill(file: h5py.File) -> None:
            write_attributes(file, attributes)
            write_texts(file, texts)
            create_scales(file, np.asarray(grid_s, dtype=float), fields, fixed)
            for group, columns in tables.items():
                create_table(file, group, columns, outputs if group in ("/", "zones") else None)
            if before is not None:
                create_slots(file, before)

        path = None if isinstance(target, io.BytesIO) else Path(target).expanduser().resolve()
        if isinstance(target, io.BytesIO):
            file = h5py.File(target, "w", libver=_LIBVER, rdcc_nbytes=CACHE)
            fill(file)
        else:
            assert path is not None
            check_target(path, overwrite)
            file = _created(path, fill)
        self._write_to(file, path, tables)

    @classmethod
    def again(
        cls, source: h5py.File, path: Path, fields: Sequence[Field], step_fields: Sequence[Field], at: Checkpoint,
        texts: Mapping[str, str], before: Tree,
    ) -> Recorder:  # fmt: skip
        """Go on with a result from one of its checkpoints; what came after is left out.  path: where, perhaps the same.

        ResultError if the file holds other fields, or cannot be written.
        """
        self, tables = cls.__new__(cls), tables_of(fields, step_fields)
        missing = [f.name for group, columns in tables.items() for f in columns if f"{group}/{f.name}" not in source]
        if missing:
            raise ResultError(f"the result has no {', '.join(missing)}: another program has written it")

        scales = [f"{group}/{columns[0].name}".lstrip("/") for group, columns in tables.items()]
        if list(at.rows) != scales or not at.rows["t"] or source["t"][at.rows["t"] - 1] != at.t:
            advice = "its rows are not those of the file\n    try:      run its scene again"
            raise ResultError(f"{source.filename} has a checkpoint that does not fit\n    detail:   {advice}")
        ours = {f.name for f in fields}
        later = {x for x in names_in(source, "errors") if x not in ours} | {BEFORE}  # known only when all is done

        def fill(new: Path) -> None:
            ask_for_room(new, Path(source.filename).stat().st_size, "")
            copied(source, new, _LIBVER, at.rows, later)
            with h5py.File(new, "r+", libver=_LIBVER, locking="best-effort") as file:
                set_status(file, "running", "")
                write_texts(file, texts)
                write_before(file, before)
                for name in [x for x in file.attrs if x.startswith(AFTERWARDS)]:
                    del file.attrs[name]

        self._write_to(_created(path.expanduser().resolve(), None, fill), path, tables)
        for table, count in zip(self._all, at.rows.values(), strict=True):
            table.count = count
        self._happened.update(at.happened)
        self._zones, self._number, self.last = list(at.zones), at.number + 1, float(self._file["t"][-1])
        return self

    def _write_to(self, file: h5py.File, path: Path | None, tables: Mapping[str, Sequence[Field]]) -> None:
        self._file, self.path = file, path
        self._all = tuple(_Table(columns, [file[f"{g}/{f.name}"] for f in columns]) for g, columns in tables.items())
        self._outputs, self._steps, self._zone_rows, self._events = self._all
        fields, step_fields = tables["/"][1:], tables["steps"]
        self._names = {f.name for f in fields}
        self._step_names = [f.name for f in step_fields]
        self._finite_steps = [k for k, f in enumerate(step_fields) if not f.nan_ok]
        self._zones: list[tuple[str, float, float]] | None = None
        self.last = -np.inf  # time of the last output, s
        self._number = 0  # of the next checkpoint
        self.files: Mapping[str, str] = {}  # digests of files that the run reads, for checkpoints
        self._happened: Counter[str] = Counter()  # events by kind
        self._flushed, self._took = -np.inf, 0.0  # when the file was last brought up to date, and how long it took, s
        self.closed = self._broken = False

    def save(self, t: float, values: Mapping[str, Any], zones: Sequence[tuple[str, float, float]]) -> None:
        """Append an output at time t (s), with the zones (kind, s_a, s_b) that hold then.

        ResultError when a field is missing, unknown, of another shape, or not finite.
        """
        if not (isfinite(t) and t > self.last):
            raise ResultError(f"an output at t = {t!r} s cannot follow the one at t = {self.last!r} s")
        if values.keys() != self._names:
            wrong = ", ".join(sorted(values.keys() ^ self._names))
            raise ResultError(f"the recorder was promised other fields; missing or unknown: {wrong}")
        row = [t, *(checked(f, np.asarray(values[f.name]), t) for f in self._outputs.fields[1:])]
        now = [(str(kind), float(a), float(b)) for kind, a, b in zones]
        if not all(isfinite(a) and isfinite(b) for _, a, b in now):
            raise ResultError(f"a zone is not finite at t = {t:.9g} s: {now}")
        if now != self._zones:
            self._zone_rows.rows += [(t, self._outputs.count + len(self._outputs.rows), *zone) for zone in now]
            self._zones = now
        self._outputs.rows.append(row)
        self.last = float(t)

    @property
    def due(self) -> bool:
        """Whether outputs have been held back long enough."""
        return monotonic() - self._flushed > max(_PAUSE, _PART * self._took)

    def log(self, values: Mapping[str, float | int]) -> None:
        """Append a row to the log of the steps; written with the next output or block."""
        row = [values[name] for name in self._step_names]
        for k in self._finite_steps:
            if not isfinite(row[k]):
                raise ResultError(f"'{self._step_names[k]}' of the step log is not finite: {row}")
        self._steps.rows += [row] if row else []
        if len(self._steps.rows) >= BLOCK:  # alone: outputs are written together with their checkpoint
            self._write([self._steps])

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
        if self._happened[kind] <= MOST_OF_A_KIND:
            self._events.rows.append((t, s_a, s_b, kind, text, criterion, value, threshold, energy))

    def _count_left_out(self) -> None:
        """Of events that were too many to write: how many there were."""
        for kind, count in self._happened.items():
            left = count - MOST_OF_A_KIND
            if left > 0:
                text = f"{left} more events '{kind}' are not written, after the first {MOST_OF_A_KIND}"
                row = (max(self.last, 0.0), 0.0, 0.0, OMITTED, text, kind, float(left), nan, nan)
                self._events.rows.append(row)

    def flush(self, content: Callable[[], Mapping[str, Any]] | None = None) -> None:
        """Write what is held back, for readers to see; content: makes `program`, `asks`, `resolution` and `state` of a
        checkpoint."""
        begin = monotonic()
        packed = b""
        if content is not None:
            rows = {table.scale: table.count + len(table.rows) for table in self._all}
            here = {"number": self._number, "t": self.last, "files": self.files, "rows": rows}
            packed = pack({**here, "happened": self._happened, "zones": self._zones or [], **content()})
        self._write([self._events, self._zone_rows, self._steps, self._outputs], packed)
        if packed:
            self._number += 1
            os.fsync(self._file.id.get_vfd_handle())  # a machine that goes down then loses no more than a kill does
        self._flushed = monotonic()
        self._took = self._flushed - begin

    def _write(self, tables: Sequence[_Table], packed: bytes = b"") -> None:
        waiting = [table for table in tables if table.rows]
        if self.path is not None:
            need = sum(table.room for table in waiting) + len(packed)
            ask_for_room(self.path, need, f", then `hybrid resume {self.path}`" if packed else "")
        try:
            for table in waiting:
                table.write()
            if packed:
                write_slot(self._file, self._number, packed)
            # HDF5 may write in any order between two flushes.  So: the data, then the scales that
            # say it is there, and t last, which says that the zones of the output are there too.
            self._file.flush()
            others = [table for table in waiting if table is not self._outputs]
            for table in others:
                table.commit()
            if others:
                self._file.flush()
            if self._outputs in waiting:
                self._outputs.commit()
                self._file.flush()
        except (OSError, RuntimeError) as error:  # HDF5 raises either
            self._broken = True
            advice = f"    detail:   {error}\n    try:      free some disk space"
            raise ResultError(f"{self.path} cannot be written\n{advice}") from error

    def close(self, status: str = "complete", message: str = "") -> None:
        """Write the status and close the file; a second call does nothing."""
        if self.closed:
            return
        if status not in _STATUS:
            raise ValueError(f"status {status!r} is none of {', '.join(_STATUS)}")
        self.closed = True
        if self._broken:
            ABANDONED.append((self._file, self._all))
            return
        try:
            self._count_left_out()
            self.flush()
        except ResultError as error:
            status, message = "failed", str(error)
            raise
        finally:
            if self._broken:
                ABANDONED.append((self._file, self._all))
            else:
                set_status(self._file, status, message)
                self._file.close()
        if self.path is not None and not self._broken:
            sign(self.path)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        elif issubclass(kind, Exception):
            with suppress(ResultError):  # what cannot be written now, either, is not the news
                self.close("failed", str(error) or kind.__name__)
        else:  # Ctrl-C, or a SystemExit made of a signal
            self.close("interrupted", "stopped from outside")


def amend(
    target: Path | io.BytesIO,
    fields: Sequence[tuple[Field, np.ndarray]],
    attributes: Mapping[str, str | float | int],
    events: Sequence[tuple[str, str]] = (),
    done: bool = True,
) -> None:
    """Add to a complete result what is known only afterwards.

    fields: quantities over the output times, (nt, ...), with their values; events: kind and text, of all the cable;
    done: whether nothing is left to go on with.
    """
    where = target if isinstance(target, io.BytesIO) else target.expanduser().resolve()
    new: Path | io.BytesIO = where
    try:
        if isinstance(where, Path):  # beside it, and then in its place: somebody may be reading
            new = where.with_name(f".{where.name}.{os.getpid()}.new")
            ask_for_room(where, where.stat().st_size, "")
            with h5py.File(where, "r", locking="best-effort") as old:
                copied(old, new, _LIBVER, None, without={BEFORE} if done else ())
        with h5py.File(new, "r+", libver=_LIBVER, locking="best-effort") as file:
            for name, value in attributes.items():
                file.attrs[name] = value
            for field, values in fields:
                checked(field, values[0], None)
                data = file.create_dataset(field.name, data=values)
                annotate(data, field.unit, field.description, field.frame)
                attach(data, ("t", *field.dims), [file["t"], *(file[d] for d in field.dims)])
            if events:
                table = _Table(EVENTS, [file[f"events/{f.name}"] for f in EVENTS])
                table.count = len(file["events/t"])
                table.rows = [(0.0, 0.0, float(file["s"][-1]), *event, "", nan, nan, nan) for event in events]
                table.write()
                table.commit()
        if isinstance(where, Path) and isinstance(new, Path):
            sign(new)
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


def _created(
    path: Path, fill: Callable[[h5py.File], None] | None, make: Callable[[Path], None] | None = None
) -> h5py.File:
    """Make the file under another name, move it into place whole, and open it to readers.

    So an older result survives a failed start, and a reader who has it open keeps what he sees.
    """
    new = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        if make is not None:
            make(new)
        if fill is not None:
            with h5py.File(new, "w", libver=_LIBVER, locking="best-effort") as file:
                fill(file)
        os.replace(new, path)
        file = h5py.File(path, "r+", libver=_LIBVER, locking="best-effort", rdcc_nbytes=CACHE)
        file.swmr_mode = True
    except OSError as error:
        advice = "a folder you may write to, with free space; close programs that hold the file"
        raise ResultError(f"{path} cannot be written\n    detail:   {error}\n    try:      {advice}") from error
    finally:
        new.unlink(missing_ok=True)
    return file
