"""The results of several lines in one file: each in a group `lines/<name>` with the layout of a result of its own."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import h5py

from hybrid.store.amend import change_complete

if TYPE_CHECKING:
    from hybrid.store.reader import Result

GROUP = "lines"


def write_lines(target: Path | io.BytesIO, images: Mapping[str, bytes]) -> None:
    """Put results, each the bytes of a file, into a complete result; ResultError where it cannot be written."""
    change_complete(target, lambda file: _add(file, images))


def _add(file: h5py.File, images: Mapping[str, bytes]) -> None:
    group = file.require_group(GROUP)
    group.attrs["order"] = list(images)
    for name, image in images.items():
        with h5py.File.in_memory(image) as line:
            line.copy(line["/"], group, name=name, expand_refs=True)


class Lines(Mapping[str, "Result"]):
    """The lines of a result by name, each a result of its own; opened when first asked for."""

    def __init__(self, result: Result, names: tuple[str, ...]) -> None:
        self._result, self._names = result, names
        self._opened: dict[str, Result] = {}

    def __getitem__(self, name: str) -> Result:
        if name not in self._names:
            raise KeyError(f"there is no line '{name}'; there are {', '.join(self._names)}")
        if name not in self._opened:
            self._opened[name] = self._result.line(name)
        return self._opened[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<lines {', '.join(self._names)}>"
