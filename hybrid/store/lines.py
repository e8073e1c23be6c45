"""The results of several lines in one file: each in a group `lines/<name>` with the layout of a result of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeVar

import h5py

from hybrid.store.copying import attach_anew
from hybrid.store.hdf5_file import in_memory
from hybrid.store.table import Table

GROUP = "lines"
# Lines, or tables of lines, that are written between two flushes of a file: the time of a flush grows with more than
# the square of what is new (32 s for 36 000 datasets at once).
TOGETHER = 20
R = TypeVar("R")  # what a line is opened as


def add_parts(file: h5py.File, parts: Mapping[str, Callable[[], bytes]]) -> None:
    """Put the results of lines into a new file of a system, one after another; parts: return the bytes of files."""
    group = file.require_group(GROUP)
    group.attrs["order"] = list(parts)
    for k, (name, image) in enumerate(parts.items(), 1):
        part = in_memory(image())
        part.copy("/", group, name=name)
        part.id.close()
        attach_anew(group[name])
        if k % TOGETHER == 0:
            file.flush()


def in_turn(tables: Sequence[Table]) -> Iterator[Sequence[Table]]:
    """Tables in groups between which a file is to be flushed."""
    for k in range(0, len(tables), TOGETHER):
        yield tables[k : k + TOGETHER]


def of_part(name: str, counts: Mapping[str, int]) -> dict[str, int]:
    """What a line is told of counts by name, where those of lines begin with where their results are."""
    begin = f"{GROUP}/{name}/"
    return {key.removeprefix(begin): count for key, count in counts.items() if key.startswith(begin)}


def of_all(counts: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """Counts by name of a system (under the name "") and of its lines as one table."""
    return {
        f"{GROUP}/{name}/{key}" if name else key: count for name, each in counts.items() for key, count in each.items()
    }


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
