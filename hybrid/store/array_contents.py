"""The contents of a result as arrays in memory: what a `Result` reads from, and what is written to a file in one go."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.store.format import Field, Text, made


class ArrayDataset:
    """One array with what it says of itself; `valid` until the result is closed."""

    def __init__(self, field: Field, dims: tuple[str, ...], values: np.ndarray, grows: bool = False) -> None:
        """Values of an array of a result in memory.

        field: named as the array, with its table; dims: of all of the array, the rows of a table first; grows: a
        column of a table, to which a restarted run adds rows.
        """
        self.field, self.dims, self.values, self.grows, self.valid = field, dims, values, grows, True


class ArrayContents:
    """What a `Result` reads from, as `store.contents.FileContents`, of a result in memory."""

    def __init__(
        self, data: Mapping[str, ArrayDataset], groups: Sequence[str], attributes: dict[str, Any],
        texts: Mapping[str, Text], parts: Mapping[str, ArrayContents] | None = None,
    ) -> None:  # fmt: skip
        """groups: that are there even if they are empty; parts: results of lines by name, of a result of several."""
        self.parts = dict(parts or {})
        self.order = tuple(self.parts)
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
        return sum(x.values.nbytes for each in (self, *self.parts.values()) for x in each.data.values())

    def part(self, name: str) -> ArrayContents:
        """The result of a line, which is closed by itself."""
        found = self.parts[name]
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


# A result in memory without a file: arrays, of which HDF5 knows nothing.
#
# HDF5 takes a third of a short run: to write some ninety datasets, to open them again, and to find out what they are.


class MemoryTarget:
    """Where a result in memory goes: `contents`, once it is recorded."""

    contents: ArrayContents | None = None


# A file, the bytes of one in memory, which can be amended, or arrays.
Target = Path | io.BytesIO | MemoryTarget
