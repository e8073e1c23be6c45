"""Copies of result files: all rows or some, without what is left out.

A run is resumed in a copy, because HDF5 refuses to open a file for writing that a killed process was writing ("file is
already open for write"; the mark can be taken away by h5clear alone), and because the file stays as it is until the
copy is whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import h5py
import numpy as np

from hybrid.errors import ResultError
from hybrid.store.format import chunk_rows, plain_text
from hybrid.store.integrity import check_stored
from hybrid.store.recorder import Table

_BLOCK = 1 << 22  # bytes that are copied at a time


def copied(old: h5py.Group, new: h5py.Group, rows: Mapping[str, int] | None, without: Iterable[str] = ()) -> None:
    """Copy a result to a new file; rows: of every table that are taken, by its scale (None: all that are complete).

    old, new: files, or groups of them; without: datasets, or groups at the top.
    """
    left = set(without)
    whole = [(name, data) for name, data in _datasets(old) if not left & {name, name.split("/")[0]}]
    scales = [name for name, data in whole if data.attrs.get("CLASS") == b"DIMENSION_SCALE"]
    kept = {name: int(old[name].shape[0]) for name in scales} | dict(rows or {})
    _annotations(old, new)
    for name, data in whole:
        _copied_dataset(data, new, name, kept)
    for name in scales:
        new[name].make_scale(plain_text(old[name].attrs.get("NAME", name)))
    for name, data in whole:
        for k, dim in enumerate(data.dims):
            new[name].dims[k].label = dim.label
            if dim.label in kept and dim.label != name:
                new[name].dims[k].attach_scale(new[dim.label])


def names_in(file: h5py.Group, group: str) -> list[str]:
    """Names of all datasets in a group."""
    return [name for name, _ in _datasets(file) if name.startswith(f"{group}/")]


def _datasets(file: h5py.Group) -> Iterator[tuple[str, h5py.Dataset]]:
    found: list[tuple[str, h5py.Dataset]] = []
    file.visititems(lambda name, item: found.append((name, item)) if isinstance(item, h5py.Dataset) else None)
    if file.file.swmr_mode:
        for _, data in found:
            data.refresh()
    return iter(found)


def _copied_dataset(data: h5py.Dataset, new: h5py.Group, name: str, kept: Mapping[str, int]) -> None:
    first = data.dims[0].label if data.ndim else ""
    count = min(kept.get(first, data.shape[0]), data.shape[0]) if data.ndim else 0
    shape = (count, *data.shape[1:]) if data.ndim else ()
    check_stored(data, int(np.prod(shape, dtype=object)))
    grows = data.chunks is not None
    if grows:  # a result that was written in one go has all its rows in one chunk
        rows = min(data.chunks[0], chunk_rows(data.dtype.itemsize * int(np.prod(data.chunks[1:], dtype=int))))
    copy = new.create_dataset(
        name, shape, data.dtype, maxshape=data.maxshape if grows else None,
        chunks=(rows, *data.chunks[1:]) if grows else None,
    )  # fmt: skip
    if not data.ndim:
        copy[()] = data[()]
    else:
        block = max(1, _BLOCK // max(1, data.dtype.itemsize * int(np.prod(data.shape[1:], dtype=int))))
        for a in range(0, count, block):
            copy[a : min(a + block, count)] = data[a : min(a + block, count)]
    _annotations(data, copy)


def _annotations(old: Any, new: Any) -> None:
    """Attributes but those that HDF5 keeps for dimension scales."""
    for key, value in old.attrs.items():
        if key not in ("CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "DIMENSION_LABELS"):
            try:
                new.attrs.create(key, value, dtype=old.attrs.get_id(key).dtype)
            except UnicodeError:
                where = f"attribute '{key}' of {old.name.lstrip('/') or 'the file'}"
                raise ResultError(
                    f"{old.file.filename} cannot be resumed\n    given:    {where}: {value!r:.60}\n"
                    "    expected: text in UTF-8\n    try:      the file as hybrid wrote it, or run its scene again"
                ) from None


# The results of several lines in one file: each in a group `lines/<name>` with the layout of a result of its own.

GROUP = "lines"
# Lines, or tables of lines, that are written between two flushes of a file: the time of a flush grows with more than
# the square of what is new (32 s for 36 000 datasets at once).
TOGETHER = 20
R = TypeVar("R")  # what a line is opened as


def in_turn(tables: Sequence[Table]) -> Iterator[Sequence[Table]]:
    """Tables in groups between which a file is to be flushed."""
    for k in range(0, len(tables), TOGETHER):
        yield tables[k : k + TOGETHER]


def group_of(line: str) -> str:
    """What names of datasets of a line begin with; nothing for the line without a name, whose result is the file."""
    return f"{GROUP}/{line}/" if line else ""


def root_of(file: h5py.File, line: str) -> h5py.Group:
    """The group of a line; the file itself of the line without a name."""
    return file[f"{GROUP}/{line}"] if line else file


def of_part(name: str, counts: Mapping[str, int]) -> dict[str, int]:
    """What a line is told of counts by name, where those of lines begin with where their results are."""
    begin = group_of(name)
    return {key.removeprefix(begin): count for key, count in counts.items() if key.startswith(begin)}


def of_all(counts: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """Counts by name of a system (under the name "") and of its lines as one table."""
    return {group_of(name) + key: count for name, each in counts.items() for key, count in each.items()}


class Lines(Mapping[str, R]):
    """The lines of a result by name, each a result of its own; opened when first asked for."""

    def __init__(self, line: Callable[[str], R], names: tuple[str, ...]) -> None:
        """line: opens the result of a line of that name."""
        self._line, self._names = line, names
        self._opened: dict[str, R] = {}

    def __getitem__(self, name: str) -> R:
        if name not in self._names:
            raise KeyError(f"there is no line '{name}'; there are {', '.join(self._names)}")
        if name not in self._opened:
            self._opened[name] = self._line(name)
        return self._opened[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<lines {', '.join(self._names)}>"
