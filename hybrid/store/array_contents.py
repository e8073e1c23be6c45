"""The contents of a complete result as arrays in memory, and what of it is known before its first output."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import monotonic
from types import SimpleNamespace
from typing import Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.format import (
    Field,
    Header,
    Text,
    attributes_of_format,
    check_names,
    made,
    scale_values,
    scales_of,
    status_attributes,
    tables_of,
    values_of_fixed,
    write_attributes,
)
from hybrid.store.recorder import STATUS, BaseRecorder, Table, pause


class ArrayDataset:
    """One array with what it says of itself; `valid` until the result is closed."""

    def __init__(self, field: Field, dims: tuple[str, ...], values: np.ndarray, grows: bool = False) -> None:
        """Values of an array of a result in memory.

        field: named as the array, with its table; dims: of all of the array, the rows of a table first; grows: a
        column of a table, to which a restarted run adds rows.
        """
        self.field, self.dims, self.values, self.grows, self.valid = field, dims, values, grows, True


class ArrayContents:
    """What a `Result` reads from, as `store.contents.FileContents`, of a result that is complete and in memory."""

    def __init__(
        self, data: Mapping[str, ArrayDataset], groups: Sequence[str], attributes: dict[str, Any],
        texts: Mapping[str, Text], parts: Mapping[str, ArrayContents] | None = None,
    ) -> None:  # fmt: skip
        """groups: that are there even if they are empty; parts: results of lines by name, of a result of several."""
        self._parts = dict(parts or {})
        self.order = tuple(self._parts)
        self.data: Mapping[str, Any] = {}
        self.groups, self.texts = list(groups), dict(texts)
        self.attributes, self.is_open = attributes, True
        self.add(data)

    def add(self, data: Mapping[str, ArrayDataset]) -> None:
        """More datasets by name, or others instead of those of the same names."""
        every = {**self.data, **data}
        self.data = dict(sorted(every.items(), key=lambda item: item[0].split("/")))
        parents = {name[:k] for name in every for k, x in enumerate(name) if x == "/"}
        self.groups = sorted({*self.groups, *parents})

    @property
    def size(self) -> int:
        """Bytes of all arrays."""
        return sum(x.values.nbytes for x in self.data.values())

    def part(self, name: str) -> ArrayContents:
        """The result of a line, which is closed by itself."""
        found = self._parts[name]
        data = {key: ArrayDataset(x.field, x.dims, x.values) for key, x in found.data.items()}
        return ArrayContents(data, found.groups, found.attributes, found.texts)

    def scales(self) -> list[str]:
        return []

    def dims_of(self, data: ArrayDataset) -> tuple[str, ...]:
        return data.dims

    def units_of(self, data: ArrayDataset) -> str:
        return data.field.unit

    def label(self, name: str) -> dict[str, str]:
        field = self.data[name].field
        return {"units": field.unit, "description": field.description, "frame": field.frame}

    def length(self, name: str) -> int:
        return len(self.data[name].values)

    def values(self, name: str, rows: int | None) -> np.ndarray:
        return np.asarray(self.data[name].values)

    def text(self, name: str) -> str:
        return made(self.texts.get(name, ""))

    def close(self) -> None:
        """Let go of all arrays; those that were asked for stay with the result."""
        self.is_open = False
        for data in self.data.values():
            data.valid, data.values = False, np.zeros(0)


class HeldValues:
    """What a result in memory holds besides its tables: values that do not grow, attributes and texts."""

    def __init__(self, header: Header) -> None:
        """Errors as of `store.writer.Recorder`."""
        fixed = header.fixed
        scales = scales_of(np.size(header.grid_s), header.fields, [field for field, _ in fixed])
        self.fixed = {name: ArrayDataset(field, (name,), scale_values(field)) for name, field in scales.items()}
        self.fixed |= {f.name: ArrayDataset(f, f.dims, np.zeros(0)) for f, _ in fixed if f.name not in scales}
        for name, values in values_of_fixed(np.asarray(header.grid_s, float), fixed).items():
            self.fixed[name].values = values.copy()
        self.attributes: dict[str, Any] = dict(attributes_of_format()) | status_attributes("running", "")
        write_attributes(SimpleNamespace(attrs=self.attributes), header.attributes)
        self.texts = {name: text for name, text in header.texts.items() if text}

    def contents(
        self, groups: Iterable[str], tables: Iterable[Table], replaced: Mapping[str, np.ndarray], status: str,
        message: str, parts: Mapping[str, ArrayContents] | None = None,
    ) -> ArrayContents:  # fmt: skip
        """All of the result, when it is complete; the rows of its tables wait there no more.

        groups: of the tables; replaced: other values of what does not grow; parts: results of lines by name.
        """
        for name, values in replaced.items():
            if np.shape(values) != self.fixed[name].values.shape:
                raise ResultError(f"{name} has shape {np.shape(values)}, expected {self.fixed[name].values.shape}")
            self.fixed[name].values = np.array(values, self.fixed[name].values.dtype)
        data = dict(self.fixed)
        for table in tables:
            for (name, column), field in zip(table.columns().items(), table.fields, strict=True):
                dims = (name,) if name == table.scale else (table.scale, *field.dims)
                data[name] = ArrayDataset(replace(field, name=name), dims, column, grows=True)
            table.drop()
        self.attributes |= status_attributes(status, message)
        return ArrayContents(data, [x for x in groups if x != "/"], self.attributes, self.texts, parts)


# A result in memory without a file: arrays, of which HDF5 knows nothing.
#
# HDF5 takes a third of a short run: to write some ninety datasets, to open them again, and to find out what they are.


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
