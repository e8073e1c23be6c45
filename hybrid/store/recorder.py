"""A result as it grows in memory: outputs, steps and events are checked, and wait as rows of its tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from math import isfinite, nan
from types import SimpleNamespace, TracebackType
from typing import Any, NamedTuple, Self

import h5py
import numpy as np
from h5py import h5d, h5s, h5t

from hybrid.errors import OMITTED, ResultError
from hybrid.store.format import (
    ArrayContents,
    ArrayDataset,
    Field,
    Header,
    ZoneRows,
    attributes_of_format,
    check_names,
    cut,
    plain_text,
    scale_values,
    scales_of,
    status_attributes,
    tables_of,
    unsound,
    values_of_fixed,
    write_attributes,
)

# Events of a kind that are written, of some 700 bytes each; a run that has more of them goes on, and says how many.
MOST_OF_A_KIND = 10_000
STATUS = ("running", "complete", "interrupted", "failed")

# A run hands over what it has after this long (s), or so many times as long as making that takes: ten outputs of a line
# made together cost little more than one, and one output of each of 100 lines costs more than the steps before it.
_PAUSE, _PART = 0.2, 10.0


def pause(made: float) -> float:
    """How long (s) a run keeps to itself what it has, after a hand-over of which the making took `made` (s)."""
    return max(_PAUSE, _PART * made)


@lru_cache(maxsize=4096)
def _called(field: Field, name: str) -> Field:
    """A field under the name of its dataset: lines that are alike have the same."""
    return replace(field, name=name)


class Mark(NamedTuple):
    """Where a result stands, to come back to."""

    rows: tuple[int, ...]  # of its tables
    last: float  # s, time of the last output
    zones: list[tuple[str, float, float]] | None
    happened: Counter[str]


class Rows:
    """One result as it grows in memory: what does not grow, and tables whose rows wait to be written.

    Errors of its header, and of what it is given, are ResultErrors.
    """

    def __init__(self, header: Header) -> None:
        fields, step_fields, fixed = header.fields, header.step_fields, header.fixed
        check_names(fields, step_fields, fixed)
        self._step_names = [f.name for f in step_fields]
        self._finite_steps = [k for k, f in enumerate(step_fields) if not f.nan_ok]
        self._use(fields, step_fields)
        self._zones: list[tuple[str, float, float]] | None = None
        self.last = -np.inf  # time of the last output, s
        self._happened: Counter[str] = Counter()  # events by kind
        self.kept_events = 0  # rows of events that the last checkpoint keeps
        self._replaced: dict[str, np.ndarray] = {}  # values of what does not grow, that are not written yet
        self.closed = False

        scales = scales_of(np.size(header.grid_s), fields, [field for field, _ in fixed])
        self._fixed = {name: ArrayDataset(field, (name,), scale_values(field)) for name, field in scales.items()}
        self._fixed |= {f.name: ArrayDataset(f, f.dims, np.zeros(0)) for f, _ in fixed if f.name not in scales}
        for name, values in values_of_fixed(np.asarray(header.grid_s, float), fixed).items():
            self._fixed[name].values = values.copy()
        self._attributes: dict[str, Any] = dict(attributes_of_format()) | status_attributes("running", "")
        write_attributes(SimpleNamespace(attrs=self._attributes), header.attributes)
        self._texts = {name: text for name, text in header.texts.items() if text}

    def _use(self, fields: Sequence[Field], step_fields: Sequence[Field]) -> None:
        self._tables = tables_of(fields, step_fields)
        self._all = tuple(Table(group, columns) for group, columns in self._tables.items())
        self._outputs, self._steps, self._zone_rows, self._events = self._all
        self._names = {f.name for f in fields}

    def use_fields(self, fields: Sequence[Field]) -> None:
        """Have outputs of these fields, some of those of the header: before there is one."""
        self._use(fields, self._steps.fields)

    def contents(self, parts: Mapping[str, ArrayContents] | None = None) -> ArrayContents:
        """All of it that is not written; the rows of its tables wait no more.  parts: results of lines by name."""
        data = dict(self._fixed)
        self.sort_events()
        for table in self._all:
            for (name, column), field in zip(table.columns().items(), table.fields, strict=True):
                dims = (name,) if name == table.scale else (table.scale, *field.dims)
                data[name] = ArrayDataset(_called(field, name), dims, column, grows=True)
            table.count += table.waiting
            table.drop()
        self._replaced.clear()
        return ArrayContents(data, [x for x in self._tables if x != "/"], self._attributes, self._texts, parts)

    def sort_events(self) -> None:
        """Put events that wait in the order of their times: outputs tell later than steps do."""
        self._events.sort(self.kept_events)

    def close(self, status: str = "complete", message: str = "") -> None:
        """End the result with a status of STATUS and a message; a second call does nothing."""
        if self.closed:
            return
        if status not in STATUS:
            raise ValueError(f"status {status!r} is none of {', '.join(STATUS)}")
        self.closed = True
        self._count_left_out()
        self._attributes |= status_attributes(status, message)

    # --- what can be taken back -----------------------------------------------------------------------

    def mark(self) -> Mark:
        """Where it stands."""
        rows = tuple(table.count + table.waiting for table in self._all)
        return Mark(rows, self.last, self._zones, self._happened.copy())

    def since(self, mark: Mark) -> int:
        """How many outputs and events came after a mark."""
        stood = zip(self._all, mark.rows, strict=True)
        return sum(x.count + x.waiting - rows for x, rows in stood if x is not self._steps)

    def back_to(self, mark: Mark) -> None:
        """Forget what came after a mark.  ValueError: it is written."""
        for table, rows in zip(self._all, mark.rows, strict=True):
            table.cut_to(rows)
        self.last, self._zones, self._happened = mark.last, mark.zones, mark.happened.copy()

    def resume_after(self, root: h5py.Group, rows: Mapping[str, int], happened: Mapping[str, int]) -> None:
        """Stand behind rows that are in a group of a file; happened: events by kind."""
        for table in self._all:
            table.drop()
            table.count = rows[table.scale] if table.fields else 0
        self._happened = Counter(happened)
        self.last = float(root["t"][-1])
        zones = root["zones"]
        last = zones["output"][:] == zones["output"][-1] if rows["zones/t"] else np.zeros(0, bool)
        kinds = [plain_text(x) for x in zones["kind"][:][last]]
        self._zones = list(zip(kinds, zones["s_a"][:][last].tolist(), zones["s_b"][:][last].tolist(), strict=True))

    # --- what it is given -----------------------------------------------------------------------------

    def save(self, t: float, values: Mapping[str, Any], zones: ZoneRows) -> None:
        """Append an output at time t (s), with the zones (kind, s_a, s_b) that hold then; errors as of `save_batch`."""
        self.save_batch(np.array([t]), {name: np.asarray(x)[None] for name, x in values.items()}, zones)

    def save_batch(
        self, times: np.ndarray, values: Mapping[str, np.ndarray], zones: ZoneRows, later: Sequence[ZoneRows] = ()
    ) -> None:
        """Append outputs of the fields (nb, ...) at the times (nb,), s.

        zones: of all of these outputs, or of the first; later: of each of the others, where they differ.
        The arrays are kept until they are written.  ResultError when a field is missing, unknown, of another shape, or
        not finite; the outputs before the first that is wrong are kept.
        """
        if values.keys() != self._names:
            wrong = ", ".join(sorted(values.keys() ^ self._names))
            raise ResultError(f"the recorder was promised other fields; missing or unknown: {wrong}")
        late = np.diff(times, prepend=self.last) > 0.0
        good = int(np.argmin(np.append(late & np.isfinite(times), False)))  # outputs before the first wrong one
        fields, error = self._outputs.fields[1:], ""
        if good < len(times):
            before = times[good - 1] if good else self.last
            error = f"an output at t = {float(times[good])!r} s cannot follow the one at t = {float(before)!r} s"
        for field in fields:
            first, why = unsound(field, values[field.name], times)
            if first < good:
                good, error = first, why
        if good:
            self._keep(times[:good], [values[field.name][:good] for field in fields], [zones, *later][:good])
        if error:
            raise ResultError(error)

    def _keep(
        self, times: np.ndarray, columns: list[np.ndarray], zones: Sequence[Sequence[tuple[str, float, float]]]
    ) -> None:
        """Let outputs wait, and the zones of the first, or of each, where they are others than before."""
        first = self._outputs.count + self._outputs.waiting
        for k, these in enumerate(zones):
            now = [(str(kind), float(a), float(b)) for kind, a, b in these]
            if not all(isfinite(a) and isfinite(b) for _, a, b in now):
                raise ResultError(f"a zone is not finite at t = {times[k]:.9g} s: {now}")
            if now != self._zones:
                for zone in now:
                    self._zone_rows.add_row((times[k], first + k, *zone))
                self._zones = now
        self._outputs.add([times, *columns])
        self.last = float(times[-1])

    def log(self, values: Mapping[str, float | int]) -> None:
        """Append a row to the log of the steps; errors as of `log_rows`."""
        self.log_rows(np.array([[values[name] for name in self._step_names]], float))

    def log_rows(self, rows: np.ndarray) -> None:
        """Append rows (n, number of step fields) to the log of the steps; written with the next output or block.

        ResultError when one is not finite where it has to be.
        """
        finite = np.isfinite(rows[:, self._finite_steps])
        if not finite.all():
            i, k = np.argwhere(~finite)[0]
            name = self._step_names[self._finite_steps[k]]
            raise ResultError(f"'{name}' of the step log is not finite: {rows[i].tolist()}")
        self._steps.add(list(rows.T.copy()))

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
            self._events.add_row((t, s_a, s_b, kind, text, criterion, value, threshold, energy))

    def _count_left_out(self) -> None:
        """Of events that were too many to write: how many there were."""
        for kind, count in self._happened.items():
            left = count - MOST_OF_A_KIND
            if left > 0:
                text = f"{left} more events '{kind}' are not written, after the first {MOST_OF_A_KIND}"
                row = (max(self.last, 0.0), 0.0, 0.0, OMITTED, text, kind, float(left), nan, nan)
                self._events.add_row(row)

    def replace(self, values: Mapping[str, np.ndarray]) -> None:
        """Other values for quantities of `fixed`, by name; written with the next flush."""
        for name, new in values.items():
            field = self._fixed[name]
            if np.shape(new) != field.values.shape:
                raise ResultError(f"{name} has shape {np.shape(new)}, expected {field.values.shape}")
            field.values = self._replaced[name] = np.array(new, field.values.dtype)

    # --- what is recorded so far ----------------------------------------------------------------------

    def recorded(self) -> Self | None:
        """What is recorded so far; None: nobody keeps it."""
        return self

    def __contains__(self, name: object, /) -> bool:
        return name in self._names or name in self._fixed

    def __getitem__(self, name: str, /) -> np.ndarray:
        """A quantity of `fixed`, or the arc lengths of the grid."""
        return self._fixed[name].values

    def rows_of(self, *names: str) -> Iterator[tuple[np.ndarray, ...]]:
        """Rows (n, ...) of fields over the outputs, so many at a time; "t": their times."""
        return self._outputs.rows_of(names)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        elif issubclass(kind, Exception):
            with suppress(ResultError):  # what cannot be written now, either, is not the news
                self.close("failed", str(error) or kind.__name__)
        else:  # Ctrl-C, or a SystemExit made of a signal
            self.close("interrupted", "stopped from outside")


# A table of a result file: datasets that grow together by rows.

NUMBERS = {"float64": h5t.NATIVE_DOUBLE, "int64": h5t.NATIVE_INT64}

_PIECE = 1_000_000  # numbers of a dataset that are read at a time


class Table:
    """Datasets that grow together by rows; the first is the dimension scale of all.

    Rows wait as arrays until they are written through HDF5's own interface: h5py's slices take twice as long.
    """

    def __init__(self, group: str, fields: Sequence[Field]) -> None:
        self.fields, self._names = tuple(fields), [f"{group}/{field.name}".lstrip("/") for field in fields]
        self.move(None)
        self.scale = self._names[0] if fields else ""  # the first dataset says how many rows are complete
        self._blocks: list[list[np.ndarray]] = []  # waiting to be written, each with one array (n, ...) per field
        self.waiting = self.bytes_waiting = 0  # rows in them, and their bytes
        self.count = 0  # written rows

    def move(self, file: h5py.Group | None) -> None:
        """Write to the datasets of a file, or of a group of it, opened when rows come; None: rows are kept."""
        self._file: h5py.Group | None = file
        self._datasets: list[h5d.DatasetID] = []

    def _open(self) -> None:
        if self._file is not None and not self._datasets:
            self._datasets = [h5d.open(self._file.id, name.encode()) for name in self._names]

    def columns(self) -> dict[str, np.ndarray]:
        """The rows that wait, (n, ...) of each dataset by its name."""
        found = {}
        for k, (name, field) in enumerate(zip(self._names, self.fields, strict=True)):
            parts = [block[k] for block in self._blocks]
            one = parts[0] if len(parts) == 1 else None
            found[name] = np.concatenate([np.zeros((0, *field.shape), field.dtype), *parts]) if one is None else one
        return found

    def rows_of(self, names: Sequence[str]) -> Iterator[tuple[np.ndarray, ...]]:
        """All rows (n, ...) of some datasets, written ones and those that wait, some 8 MB at a time."""
        columns = [self._names.index(name) for name in names]
        if self.count:
            assert self._file is not None
            wide = max(int(np.prod(self.fields[k].shape)) for k in columns)
            some = max(1, _PIECE // max(wide, 1))
            for a in range(0, self.count, some):
                yield tuple(self._file[name][a : min(a + some, self.count)] for name in names)
        for block in self._blocks:
            yield tuple(block[k] for k in columns)

    def sort(self, first: int) -> None:
        """Put the rows that wait in the order of the first dataset.

        Up to so many of all, and behind them the others: a file is cut there where a run goes on.
        """
        if self.waiting > 1:
            columns = list(self.columns().values())
            order = np.lexsort((columns[0], np.arange(self.waiting) >= first - self.count))
            self._blocks = [[x[order] for x in columns]]

    def drop(self) -> None:
        """Forget the rows that wait."""
        self._blocks, self.waiting, self.bytes_waiting = [], 0, 0

    def cut_to(self, rows: int) -> None:
        """Forget all rows but so many.  ValueError: some of them are written."""
        if rows < self.count:
            raise ValueError(f"{self.count} rows are written")
        kept, left = self._blocks, rows - self.count
        self.drop()
        for block in kept:
            self.add([x[:left] for x in block])
            left -= min(left, len(block[0]))

    def add(self, columns: Sequence[np.ndarray]) -> None:
        """Let rows wait: one array (n, ...) per field, which nobody changes any more."""
        if self.fields and len(columns[0]):
            self._blocks.append([np.asarray(x, field.dtype) for field, x in zip(self.fields, columns, strict=True)])
            self.waiting += len(columns[0])
            self.bytes_waiting += sum(x.nbytes for x in self._blocks[-1])

    def add_row(self, row: Sequence[Any]) -> None:
        """Let one row of numbers and texts wait."""
        self.add(
            [
                np.array([cut(x, int(f.dtype[1:])) if f.dtype.startswith("S") else x], f.dtype)
                for f, x in zip(self.fields, row, strict=True)
            ]
        )

    def write(self) -> None:
        """Write the waiting rows to all datasets but the scale."""
        if self.waiting:
            self._open()
        for k in range(1, len(self.fields) if self.waiting else 0):
            self._write_column(k)

    def commit(self, at_once: bool = True) -> None:
        """Write the scale, which tells readers that the rows are complete.

        at_once: flushed by itself: where its numbers cannot be written, HDF5 then stops before its new length, while a
        flush of the whole file goes on with all lengths (rows of zeros in 1 of 40 files of a full disk).  Not needed
        where numbers do not wait in memory (store.hdf5_file).
        """
        if self.waiting:
            self._open()
            self._write_column(0)
            if at_once:
                self._datasets[0].flush()
            self.count += self.waiting
            self.drop()

    def _write_column(self, k: int) -> None:
        parts, data = [block[k] for block in self._blocks], self._datasets[k]
        column = np.ascontiguousarray(parts[0] if len(parts) == 1 else np.concatenate(parts))
        data.set_extent((self.count + len(column), *column.shape[1:]))
        write_rows(data, self.count, column, NUMBERS.get(self.fields[k].dtype) or data.get_type())


def write_rows(data: h5d.DatasetID, begin: int, rows: np.ndarray, kind: Any = None) -> None:
    """Write contiguous rows (n, ...) from row number `begin` on, into room that is there; kind: their type in HDF5."""
    there = data.get_space()
    there.select_hyperslab((begin, *[0] * (rows.ndim - 1)), rows.shape)
    data.write(h5s.create_simple(rows.shape), there, rows, kind)
