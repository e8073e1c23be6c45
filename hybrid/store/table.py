"""A table of a result file: datasets that grow together by rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5s, h5t

from hybrid.store.format import Field, cut

NUMBERS = {"float64": h5t.NATIVE_DOUBLE, "int64": h5t.NATIVE_INT64}

_PIECE = 1_000_000  # numbers of a dataset that are read at a time


class Table:
    """Datasets that grow together by rows; the first is the dimension scale of all.

    Rows wait as arrays until they are written through HDF5's own interface: h5py's slices take twice as long.
    """

    def __init__(self, file: h5py.Group | None, group: str, fields: Sequence[Field]) -> None:
        self.fields, self._names = tuple(fields), [f"{group}/{field.name}".lstrip("/") for field in fields]
        self.move(file)
        self.scale = self._names[0] if fields else ""  # the first dataset says how many rows are complete
        self._blocks: list[list[np.ndarray]] = []  # waiting to be written, each with one array (n, ...) per field
        self.waiting = self.bytes_waiting = 0  # rows in them, and their bytes
        self.count = 0  # written rows

    def move(self, file: h5py.Group | None) -> None:
        """Write to the datasets of the same names of another file, or of a group of it; opened when rows come."""
        self._file: h5py.Group | None = file
        self._datasets: list[h5d.DatasetID] = []

    def leave(self) -> None:
        """Hold no datasets, until `move`."""
        self._file, self._datasets = None, []

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

    def drop(self) -> None:
        """Forget the rows that wait."""
        self._blocks, self.waiting, self.bytes_waiting = [], 0, 0

    def add(self, columns: Sequence[np.ndarray]) -> None:
        """Let rows wait: one array (n, ...) per field, which nobody changes any more."""
        if self.fields and len(columns[0]):
            self._blocks.append([np.asarray(x, field.dtype) for field, x in zip(self.fields, columns, strict=True)])
            self.waiting += len(columns[0])
            self.bytes_waiting += sum(x.nbytes for x in self._blocks[-1])

    def add_row(self, row: Sequence[Any]) -> None:
        """Let one row of numbers and texts wait."""
        self.add([
            np.array([cut(x, int(f.dtype[1:])) if f.dtype.startswith("S") else x], f.dtype)
            for f, x in zip(self.fields, row, strict=True)
        ])  # fmt: skip

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
