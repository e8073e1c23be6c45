"""Outputs of a long run to compare with, in a file beside the result: rows of numbers, one for each output.

What they are is in the checkpoint of the result, with a digest of the file; a file that is not as it was written is
not read.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from hybrid.errors import ResultError
from hybrid.store.envelope import Recorded
from hybrid.store.format import ZoneRows
from hybrid.store.hdf5_file import unwritable
from hybrid.store.integrity import DIGEST, Tree, matched

# What is kept of a run to compare with: arrays of its outputs, and no result that anyone opens.


class ComparisonRecorder:
    """Stands in for a `Recorder` where only arrays are wanted: outputs, events, and some columns of the step log."""

    def __init__(self, columns: Sequence[int] = ()) -> None:
        """columns: of the step log, that are kept."""
        self._columns, self._steps = list(columns), list[np.ndarray]()
        self.times: list[float] = []
        self.events: list[tuple[str, str]] = []  # kind, text
        self._kept: dict[str, list[np.ndarray]] = {}  # batches (nb, ...)
        self._catenary: list[float] = []
        self.rods: set[tuple[float, float]] = set()  # m, stretches that were rod at any output

    @property
    def last(self) -> float:
        """Time of the last output, s."""
        return self.times[-1] if self.times else -np.inf

    def save_batch(
        self, times: np.ndarray, values: Mapping[str, np.ndarray], zones: ZoneRows, later: Sequence[ZoneRows] = ()
    ) -> None:
        """Append outputs at the times (nb,), s, of the fields (nb, ...).  ResultError when one is not finite.

        later: as of `Recorder.save_batch`.
        """
        for name, value in values.items():
            finite = np.isfinite(value).reshape(len(times), -1).all(axis=1)
            if not finite.all():
                raise ResultError(f"{name} is not finite at t = {times[np.argmin(finite)]:.9g} s")
        self.times += times.tolist()
        for each in [zones, *later] if later else [zones] * len(times):
            share = sum((b - a for kind, a, b in each if kind == "catenary"), 0.0) / each[-1][2] if each else 0.0
            self._catenary.append(share)
            self.rods |= {(a, b) for kind, a, b in each if kind == "rod"}
        self._keep(values)

    def recorded(self) -> Recorded | None:
        """Outputs to compare with are held against no limits."""
        return None

    def _keep(self, values: Mapping[str, np.ndarray]) -> None:
        for name, value in values.items():
            self._kept.setdefault(name, []).append(np.asarray(value, float))

    def log_rows(self, rows: np.ndarray) -> None:
        """Append steps: rows of the log."""
        self._steps.append(np.array(rows[:, self._columns], float))

    @property
    def steps(self) -> np.ndarray:
        """The columns that are kept, of all steps."""
        return np.concatenate([np.zeros((0, len(self._columns))), *self._steps])

    @property
    def catenary(self) -> np.ndarray:
        """(nt,) part of the line that was catenary at the outputs."""
        return np.array(self._catenary)

    def event(self, t: float, s_a: float, s_b: float, kind: str, text: str, **more: Any) -> None:
        """Note that something happened at time t (s) from s_a to s_b (m)."""
        self.events.append((kind, f"{text} (at t = {t:.4g} s, s = {0.5 * (s_a + s_b):.4g} m)"))

    def replace(self, values: Mapping[str, np.ndarray]) -> None:
        """What does not grow is not kept."""

    def close(self, status: str, message: str) -> None:
        """There is no file to close."""

    @property
    def names(self) -> list[str]:
        """What is kept."""
        return list(self._kept)

    def __contains__(self, name: str) -> bool:
        return name in self._kept

    def __getitem__(self, name: str) -> np.ndarray:
        """All outputs of a quantity, (nt, ...)."""
        return np.concatenate(self._kept[name])


# Outputs of a long run to compare with, in a file beside the result: rows of numbers, one for each output.

_PIECE = 1 << 20  # numbers, or bytes, that are read at a time
_SUFFIX = ".coarse"


class MissingRows(ValueError):
    """The file of a run to compare with is not there, or not as it was written."""


def rows_path(result: Path, key: str) -> Path:
    """Where the outputs of a run are kept that a result is compared with; key: tells runs apart."""
    return result.with_name(f".{result.name}.{key}{_SUFFIX}")


def remove_rows(result: Path) -> None:
    """Remove all of them."""
    for path in result.parent.iterdir():
        if path.name.startswith(f".{result.name}.") and path.suffix == _SUFFIX:
            path.unlink(missing_ok=True)


class StoredRows:
    """One quantity of such a file: parts are read when they are asked for."""

    def __init__(self, path: Path, count: int, width: int, begin: int, shape: tuple[int, ...]) -> None:
        """count, width: rows, and numbers in a row; begin: number of the first of them; shape: of one output."""
        self.shape = (count, *shape)
        self._path, self._width, self._begin = path, width, begin

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Some rows, as an array."""
        a, b, _ = rows.indices(len(self))
        size = math.prod(self.shape[1:])
        out, some = np.empty((b - a, size)), max(1, _PIECE // self._width)
        with self._path.open("rb") as file:
            file.seek(8 * a * self._width)
            for k in range(0, b - a, some):
                n = min(some, b - a - k)
                piece = np.frombuffer(file.read(8 * n * self._width), "<f8").reshape(n, self._width)
                out[k : k + n] = piece[:, self._begin : self._begin + size]
        return out.reshape(b - a, *self.shape[1:])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self[:] if dtype is None else self[:].astype(dtype)


class RowsRecorder(ComparisonRecorder):
    """A recorder whose outputs go into such a file."""

    def __init__(self, path: Path, columns: Sequence[int] = ()) -> None:
        """columns: of the step log, that are kept in memory."""
        super().__init__(columns)
        self.path, self._file, self._digest = path, self._opened(path), hashlib.blake2b(digest_size=DIGEST)
        self._shapes: dict[str, tuple[int, ...]] = {}

    @staticmethod
    def _opened(path: Path) -> BinaryIO:
        try:
            return path.open("wb")
        except OSError as error:
            raise unwritable(path, error) from error

    def _keep(self, values: Mapping[str, np.ndarray]) -> None:
        self._shapes = {name: x.shape[1:] for name, x in values.items()}
        data = np.concatenate([x.reshape(len(x), -1) for x in values.values()], axis=1).astype("<f8").tobytes()
        self._digest.update(data)
        try:
            self._file.write(data)
        except OSError as error:
            raise unwritable(self.path, error) from error

    def close(self, status: str, message: str) -> None:
        """Close the file."""
        try:
            self._file.close()
        except OSError as error:
            raise unwritable(self.path, error) from error

    @property
    def names(self) -> list[str]:
        """What is kept."""
        return list(self._shapes)

    def __contains__(self, name: str) -> bool:
        return name in self._shapes

    def __getitem__(self, name: str) -> StoredRows:  # type: ignore[override]
        """All outputs of a quantity, (nt, ...)."""
        return _columns(self.path, len(self.times), self._shapes)[name]

    def reference(self) -> Tree:
        """What `rows_from` needs, as plain values."""
        columns = [[name, list(shape)] for name, shape in self._shapes.items()]
        return {"digest": self._digest.hexdigest(), "count": len(self.times), "columns": columns}


def rows_from(reference: Any, path: Path) -> dict[str, StoredRows]:
    """The quantities of a file.  MissingRows: it is not as it was written; ValueError: the reference is none."""
    saved = matched(reference, {"digest": "", "count": 0, "columns": None}, "rows")
    template = [["", [0] * len(shape)] for _, shape in saved["columns"]]
    shapes = {name: tuple(shape) for name, shape in matched(saved["columns"], template, "columns")}
    digest = hashlib.blake2b(digest_size=DIGEST)
    try:
        with path.open("rb") as file:
            while piece := file.read(_PIECE):
                digest.update(piece)
            size = file.tell()
    except OSError as error:
        raise MissingRows(str(error)) from None
    if digest.hexdigest() != saved["digest"] or size != 8 * saved["count"] * sum(map(math.prod, shapes.values())):
        raise MissingRows(f"{path} is another than was written")
    return _columns(path, saved["count"], shapes)


def _columns(path: Path, count: int, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, StoredRows]:
    out, begin, width = {}, 0, sum(map(math.prod, shapes.values()))
    for name, shape in shapes.items():
        out[name] = StoredRows(path, count, width, begin, shape)
        begin += math.prod(shape)
    return out


# An array that stays in its file: parts are read when they are asked for.


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
