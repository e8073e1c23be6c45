"""What a `Result` reads from: an HDF5 file, or a group of one; of a result in memory see store.array_contents."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from h5py import h5a, h5ds, h5g, h5o, h5s

from hybrid.store.copying import GROUP
from hybrid.store.format import plain_text
from hybrid.store.hdf5_file import check_format, open_file
from hybrid.store.integrity import readable
from hybrid.store.records import OLD_NAMES

TEXTS = ("scene", "changes")
HIDDEN = ("checkpoint", GROUP)  # what is for the program alone, and results of lines


class Contents(Protocol):
    """Datasets and attributes of a result."""

    data: Mapping[str, Any]  # datasets by the names of today, each with `valid`: whether it can be read
    groups: list[str]
    order: tuple[str, ...]  # names of lines, of a result of several

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the result."""

    @property
    def is_open(self) -> bool:
        """Whether it was not closed."""

    def scales(self) -> list[str]:
        """Names of dimension scales, whose lengths say how many rows are complete; none where all rows are."""

    def dims_of(self, data: Any) -> tuple[str, ...]:
        """Names of the dimensions of a dataset."""

    def units_of(self, data: Any) -> str:
        """The unit of a dataset; empty if it has none."""

    def label(self, name: str) -> dict[str, str]:
        """`units`, `description` and `frame` of a dataset, empty where it has none."""

    def length(self, name: str) -> int:
        """Rows of a dataset now."""

    def values(self, name: str, rows: int | None) -> np.ndarray:
        """The first rows of a dataset; None: all of it."""

    def text(self, name: str) -> str:
        """One of TEXTS; empty if there is none."""

    def close(self) -> None:
        """Let go of it."""


class _Closed:
    """A dataset of a file that was closed before anybody asked for it."""

    valid = False


class _Datasets(Mapping[str, Any]):
    """Datasets of HDF5's own interface by the names of today, each opened when it is asked for."""

    def __init__(self, root: Any, stored: Mapping[str, str]) -> None:
        """stored: names in the file, by those of today."""
        self._root, self._stored, self._opened = root, stored, dict[str, Any]()

    def __getitem__(self, name: str) -> Any:
        if name not in self._opened:
            path = self._stored[name]
            if not self._root:
                return _Closed()
            self._opened[name] = h5o.open(self._root.id, path.encode())
        return self._opened[name]

    def __contains__(self, name: object) -> bool:
        return name in self._stored

    def __iter__(self) -> Iterator[str]:
        return iter(self._stored)

    def __len__(self) -> int:
        return len(self._stored)


class FileContents:
    """The contents of a file, a running one too, or of the bytes of one in memory."""

    def __init__(self, source: Path | io.BytesIO, summed: bool = True, line: str = "") -> None:
        """summed: as of `open_file`; line: of which alone it is, of a result of several lines.  ResultError."""
        self._file = open_file(source, summed)
        try:
            with readable(source):
                check_format(self._file, source)
                self._root: Any = self._file[f"{GROUP}/{line}"] if line else self._file
                self._scan()
                lines = not line and GROUP in self._file
                self.order = tuple(map(plain_text, self._file[GROUP].attrs["order"])) if lines else ()
        except BaseException:
            self._file.close()
            raise

    def _scan(self) -> None:
        names: list[str] = []
        self._root.id.links.visit(lambda path: names.append(path.decode()))
        shown = [n for n in names if n.split("/")[0] not in HIDDEN and n not in TEXTS]
        groups = {n.rpartition("/")[0] for n in shown} - {""}
        # groups are not empty, but for tables of the result itself without columns
        empty = [n for n in shown if "/" not in n and n not in groups]
        groups.update(n for n in empty if isinstance(h5o.open(self._root.id, n.encode()), h5g.GroupID))
        self.groups = sorted(groups)
        self._stored = {OLD_NAMES.get(n, n): n for n in shown if n not in groups}
        self.data: Mapping[str, Any] = _Datasets(self._root, self._stored)

    @property
    def attributes(self) -> dict[str, Any]:
        return {k: _plain(v) for k, v in self._root.attrs.items()}

    @property
    def is_open(self) -> bool:
        return bool(self._file)

    def scales(self) -> list[str]:
        if plain_text(self._root.attrs["status"]) != "running":
            return []
        return [name for name, data in self.data.items() if h5ds.is_scale(data) and dims_of(data) == (name,)]

    def dims_of(self, data: Any) -> tuple[str, ...]:
        return dims_of(data)

    def units_of(self, data: Any) -> str:
        return units_of(data)

    def label(self, name: str) -> dict[str, str]:
        self._refreshed(name)
        attrs = self._root[self._stored[name]].attrs
        return {key: plain_text(attrs.get(key, "")) for key in ("units", "description", "frame")}

    def _refreshed(self, name: str) -> Any:
        """A dataset of HDF5's own interface, whose length is that of now."""
        data = self.data[name]
        if self._file.swmr_mode:
            data.refresh()  # HDF5 may remember it from a moment before
        return data

    def length(self, name: str) -> int:
        return int(self._refreshed(name).shape[0])

    def values(self, name: str, rows: int | None) -> np.ndarray:
        return values_of(self._refreshed(name), rows)

    def text(self, name: str) -> str:
        return plain_text(self._root[name][()]) if name in self._root else ""

    def close(self) -> None:
        self._file.close()


def _plain(value: Any) -> Any:
    return plain_text(value) if isinstance(value, bytes) else value.item() if isinstance(value, np.generic) else value


# --- datasets through HDF5's own interface: objects of h5py take four times as long -----------------


def values_of(data: Any, rows: int | None) -> np.ndarray:
    """The first rows of a dataset; None: all of it."""
    shape = data.shape if rows is None else (rows, *data.shape[1:])
    out = np.empty(shape, data.dtype)
    if out.size:
        there = data.get_space()
        if rows is not None:
            there.select_hyperslab((0,) * len(shape), shape)
        data.read(h5s.create_simple(shape) if shape else h5s.create(h5s.SCALAR), there, out)
    return out


def dims_of(data: Any) -> tuple[str, ...]:
    """Names of the dimensions of a dataset."""
    return tuple(plain_text(h5ds.get_label(data, k)) for k in range(data.rank))


def units_of(data: Any) -> str:
    """The unit of a dataset; empty if it has none."""
    if not h5a.exists(data, b"units"):
        return ""
    attribute = h5a.open(data, b"units")
    value = np.empty(attribute.shape, attribute.dtype)
    attribute.read(value)
    return plain_text(value[()])
