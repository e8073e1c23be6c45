"""An array that stays in its file: parts are read when they are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np


class StoredArray:
    """A dataset of a complete file that nobody changes; columns: of its second axis, that count; None: all."""

    def __init__(self, path: Path, name: str, columns: np.ndarray | None = None) -> None:
        self._path, self._name, self._columns = path, name, columns
        with self._opened() as file:
            self.shape: tuple[int, ...] = file[name].shape
        if columns is not None:
            self.shape = (self.shape[0], columns.size, *self.shape[2:])

    def _opened(self) -> h5py.File:
        return h5py.File(self._path, "r", locking="best-effort", rdcc_nbytes=0)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Some rows, as an array."""
        with self._opened() as file:
            found = np.asarray(file[self._name][rows])
        return found if self._columns is None else found[:, self._columns]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self[:] if dtype is None else self[:].astype(dtype)
