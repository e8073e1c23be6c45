"""A table of a result file: datasets that grow together by whole rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np

from hybrid.store.format import Field, cut


class Table:
    """Datasets that grow together by whole rows; the first is the dimension scale of all."""

    def __init__(self, fields: Sequence[Field], datasets: Sequence[h5py.Dataset]) -> None:
        self.fields, self.datasets = tuple(fields), tuple(datasets)
        self.rows: list[Sequence[Any]] = []  # waiting to be written
        self.count = 0  # written rows

    def write(self) -> None:
        """Write the waiting rows to all datasets but the scale."""
        for k in range(1, len(self.fields) if self.rows else 0):
            self._write_column(k)

    @property
    def scale(self) -> str:
        """Name of the first dataset, which says how many rows are complete."""
        return self.datasets[0].name.lstrip("/")

    def commit(self) -> None:
        """Write the scale, which tells readers that the rows are complete.

        Flushed by itself: where its numbers cannot be written, HDF5 then stops before its new length, while a flush of
        the whole file goes on with all lengths (rows of zeros in 1 of 40 files of a full disk).
        """
        if self.rows:
            self._write_column(0)
            self.datasets[0].flush()
            self.count += len(self.rows)
            self.rows = []

    def _write_column(self, k: int) -> None:
        field, data = self.fields[k], self.datasets[k]
        values = [row[k] for row in self.rows]
        if field.dtype.startswith("S"):
            column = np.array([cut(v, int(field.dtype[1:])) for v in values], dtype=data.dtype)
        else:
            column = np.array(values, dtype=field.dtype)
        data.resize(self.count + len(values), axis=0)
        data[self.count :] = column
