"""A result in memory without a file: arrays, of which HDF5 knows nothing.

HDF5 takes a third of a short run: to write some ninety datasets, to open them again, and to find out what they are.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from hybrid.store.array_contents import ArrayContents, HeldValues
from hybrid.store.format import check_names, tables_of
from hybrid.store.header import Header
from hybrid.store.recorder import STATUS, BaseRecorder, pause


class MemoryTarget:
    """Where a result in memory goes: `contents`, once it is recorded."""

    contents: ArrayContents | None = None


# A file, the bytes of one in memory, which can be amended, or arrays.
Target = Path | io.BytesIO | MemoryTarget


class ArrayRecorder(BaseRecorder):
    """Keeps one result in memory; errors as of `store.writer.Recorder`.  It has no checkpoints.

    parts: where results of lines go that are parts of this one; they are closed before it.
    """

    def __init__(self, target: MemoryTarget, header: Header, parts: Mapping[str, MemoryTarget] | None = None) -> None:
        self._parts = dict(parts or {})
        check_names(header.fields, header.step_fields, header.fixed)
        self._target, self._held = target, HeldValues(header)
        self._begin(None, tables_of(header.fields, header.step_fields))
        self._flushed, self._pause, self.closed = -np.inf, pause(0.0), False

    @property
    def due(self) -> bool:
        """Whether a run should hand over what it has."""
        return monotonic() - self._flushed > self._pause

    def _has_fixed(self, name: str) -> bool:
        return name in self._held.fixed

    def _fixed_values(self, name: str) -> np.ndarray:
        return self._held.fixed[name].values

    def checkpoint(self, content: Callable[[], Mapping[str, Any]]) -> None:
        """Nobody goes on with a result in memory."""

    def flush(self, made: float = 0.0) -> None:
        """Nobody else reads it; made: s that it took to make what is handed over."""
        self._flushed, self._pause = monotonic(), pause(made)

    def close(self, status: str = "complete", message: str = "") -> None:
        """Note the status, and give the result to its target; a second call does nothing."""
        if self.closed:
            return
        if status not in STATUS:
            raise ValueError(f"status {status!r} is none of {', '.join(STATUS)}")
        self.closed = True
        self._count_left_out()
        parts = {name: part.contents for name, part in self._parts.items() if part.contents is not None}
        self._target.contents = self._held.contents(self._tables, self._all, self._replaced, status, message, parts)
