"""A result in memory without a file: arrays, of which HDF5 knows nothing.

HDF5 takes a third of a short run: to write some ninety datasets, to open them again, and to find out what they are.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import monotonic
from types import SimpleNamespace
from typing import Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.format import (
    Field,
    attributes_of_format,
    check_names,
    scale_values,
    scales_of,
    status_attributes,
    tables_of,
    values_of_fixed,
    write_attributes,
)
from hybrid.store.recorder import STATUS, BaseRecorder

_PAUSE = 0.2  # s: outputs wait in the run no longer than in one that writes a file


class MemoryTarget:
    """Where a result in memory goes: `contents`, once it is recorded."""

    contents: ArrayContents | None = None


# A text, or what makes it when it is asked for: YAML takes a tenth of the equilibrium of some lines.
Text = str | Callable[[], str]
# A file, the bytes of one in memory, which can be amended, or arrays.
Target = Path | io.BytesIO | MemoryTarget


class ArrayDataset:
    """One array with what it says of itself; `valid` until the result is closed."""

    def __init__(self, field: Field, dims: tuple[str, ...], values: np.ndarray) -> None:
        """field: named as the array, with its table; dims: of all of the array, the rows of a table first."""
        self.field, self.dims, self.values, self.valid = field, dims, values, True


class ArrayContents:
    """What a `Result` reads from, as `store.contents.FileContents`, of a result that is complete and in memory."""

    def __init__(
        self, data: Mapping[str, ArrayDataset], groups: Sequence[str], attributes: dict[str, Any],
        texts: Mapping[str, Text], parts: Mapping[str, ArrayContents] | None = None,
    ) -> None:  # fmt: skip
        """parts: results of lines by name, of a result of several."""
        self._parts = dict(parts or {})
        self.order = tuple(self._parts)
        self.data: Mapping[str, Any] = dict(sorted(data.items(), key=lambda item: item[0].split("/")))
        self.groups, self._texts = sorted(groups), dict(texts)
        self.attributes, self.is_open = attributes, True

    def part(self, name: str) -> ArrayContents:
        """The result of a line, which is closed by itself."""
        found = self._parts[name]
        data = {key: ArrayDataset(x.field, x.dims, x.values) for key, x in found.data.items()}
        return ArrayContents(data, found.groups, found.attributes, found._texts)

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
        text = self._texts.get(name, "")
        return text if isinstance(text, str) else text()

    def close(self) -> None:
        """Let go of all arrays; those that were asked for stay with the result."""
        self.is_open = False
        for data in self.data.values():
            data.valid, data.values = False, np.zeros(0)


class ArrayRecorder(BaseRecorder):
    """Keeps one result in memory; arguments and errors as of `store.writer.Recorder`.  It has no checkpoints.

    parts: where results of lines go that are parts of this one; they are closed before it.
    """

    def __init__(
        self, target: MemoryTarget, *, grid_s: np.ndarray, fields: Sequence[Field], step_fields: Sequence[Field],
        attributes: Mapping[str, str | float | int], texts: Mapping[str, Text],
        fixed: Sequence[tuple[Field, np.ndarray]] = (), parts: Mapping[str, MemoryTarget] | None = None,
    ) -> None:  # fmt: skip
        self._parts = dict(parts or {})
        check_names(fields, step_fields, fixed)
        self._target = target
        scales = scales_of(np.size(grid_s), fields, [field for field, _ in fixed])
        self._fixed = {name: ArrayDataset(field, (name,), scale_values(field)) for name, field in scales.items()}
        self._fixed |= {f.name: ArrayDataset(f, f.dims, np.zeros(0)) for f, _ in fixed if f.name not in scales}
        for name, values in values_of_fixed(np.asarray(grid_s, float), fixed).items():
            self._fixed[name].values = values.copy()
        self._attributes: dict[str, Any] = dict(attributes_of_format()) | status_attributes("running", "")
        write_attributes(SimpleNamespace(attrs=self._attributes), attributes)
        self._texts = {name: text for name, text in texts.items() if text}
        self._begin(None, tables_of(fields, step_fields))
        self._flushed, self.closed = -np.inf, False

    @property
    def due(self) -> bool:
        """Whether a run should hand over what it has."""
        return monotonic() - self._flushed > _PAUSE

    def _has_fixed(self, name: str) -> bool:
        return name in self._fixed

    def _fixed_values(self, name: str) -> np.ndarray:
        return self._fixed[name].values

    def checkpoint(self, content: Callable[[], Mapping[str, Any]]) -> None:
        """Nobody goes on with a result in memory."""

    def flush(self) -> None:
        """Nobody else reads it."""
        self._flushed = monotonic()

    def close(self, status: str = "complete", message: str = "") -> None:
        """Note the status, and give the result to its target; a second call does nothing."""
        if self.closed:
            return
        if status not in STATUS:
            raise ValueError(f"status {status!r} is none of {', '.join(STATUS)}")
        self.closed = True
        self._count_left_out()
        for name, values in self._replaced.items():
            if np.shape(values) != self._fixed[name].values.shape:
                raise ResultError(f"{name} has shape {np.shape(values)}, expected {self._fixed[name].values.shape}")
            self._fixed[name].values = np.array(values, self._fixed[name].values.dtype)
        data = dict(self._fixed)
        groups = {name.split("/")[0] for name in data if "/" in name} | {x for x in self._tables if x != "/"}
        for table in self._all:
            for (name, values), field in zip(table.columns().items(), table.fields, strict=True):
                dims = (name,) if name == table.scale else (table.scale, *field.dims)
                data[name] = ArrayDataset(replace(field, name=name), dims, values)
                groups |= {name.split("/")[0]} if "/" in name else set()
            table.drop()
        self._attributes |= status_attributes(status, message)
        parts = {name: part.contents for name, part in self._parts.items() if part.contents is not None}
        self._target.contents = ArrayContents(data, list(groups), self._attributes, self._texts, parts)
