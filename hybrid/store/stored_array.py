"""An array that stays in its file: parts are read when they are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np


class StoredArray:
    """A dataset of a complete file that nobody changes."""

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name
        with self._opened() as file:
            self.shape: tuple[int, ...] = file[name].shape

    def _opened(self) -> h5py.File:
        return h5py.File(self._path, "r", locking="best-effort", rdcc_nbytes=0)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Some rows, as an array."""
        with self._opened() as file:
            return np.asarray(file[self._name][rows])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self[:] if dtype is None else self[:].astype(dtype)
