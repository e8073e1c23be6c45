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

import numpy as np

from hybrid.store.comparison_recorder import ComparisonRecorder
from hybrid.store.hdf5_file import unwritable
from hybrid.store.named_arrays import DIGEST, Tree, matched

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
