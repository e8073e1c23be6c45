"""What a `Result` reads from: an HDF5 file, or a group of one; of a result in memory see store.array_recorder."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from h5py import h5d, h5ds, h5g, h5o

from hybrid.store.format import plain_text
from hybrid.store.hdf5_file import check_format, open_file
from hybrid.store.integrity import readable
from hybrid.store.lines import GROUP
from hybrid.store.names import OLD_NAMES
from hybrid.store.plain_datasets import dims_of, units_of, values_of

TEXTS = ("scene", "changes")
HIDDEN = ("checkpoint", GROUP)  # what is for the program alone, and results of lines


class Contents(Protocol):
    """Datasets and attributes of a result."""

    data: dict[str, Any]  # datasets by the names of today, each with `valid`: whether it can be read
    groups: list[str]
    order: tuple[str, ...]  # names of lines, of a result of several

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the result."""

    @property
    def is_open(self) -> bool:
        """Whether it was not closed."""

    def is_scale(self, data: Any) -> bool:
        """Whether a dataset is a dimension scale."""

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
        self._stored: dict[str, str] = {}  # names in the file, where another version wrote it
        self.data: dict[str, Any] = {}
        groups: set[str] = set()

        def visit(path: bytes) -> None:  # HDF5's own interface: objects of h5py take four times as long
            name = path.decode()
            if name.split("/")[0] in HIDDEN or name in TEXTS:
                return
            found = h5o.open(self._root.id, path)
            if isinstance(found, h5d.DatasetID):
                if name in OLD_NAMES:
                    self._stored[OLD_NAMES[name]] = name
                    name = OLD_NAMES[name]
                self.data[name] = found
            elif isinstance(found, h5g.GroupID):
                groups.add(name)

        self._root.id.links.visit(visit)
        self.groups = sorted(groups)

    @property
    def attributes(self) -> dict[str, Any]:
        return {k: _plain(v) for k, v in self._root.attrs.items()}

    @property
    def is_open(self) -> bool:
        return bool(self._file)

    def is_scale(self, data: Any) -> bool:
        return bool(h5ds.is_scale(data))

    def dims_of(self, data: Any) -> tuple[str, ...]:
        return dims_of(data)

    def units_of(self, data: Any) -> str:
        return units_of(data)

    def label(self, name: str) -> dict[str, str]:
        self._refreshed(name)
        attrs = self._root[self._stored.get(name, name)].attrs
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
