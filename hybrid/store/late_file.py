"""The file of a short run, which is written in one go when the run has ended.

A file that readers may open while it grows is flushed before and after every change of its lengths, and what is known
of a result afterwards goes into a copy.  A run that takes less than the time for which outputs are held back anyhow
needs neither: its result waits in memory, is added to until all is known, and is then written to its place.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from time import monotonic
from weakref import WeakSet

import numpy as np

from hybrid.store.array_contents import ArrayContents
from hybrid.store.hdf5_file import beside, unwritable
from hybrid.store.integrity import tail_of
from hybrid.store.named_arrays import Tree
from hybrid.store.whole_file import parts_of_file

WAITS = 0.2  # s, that it waits at most while errors of the result are estimated, as outputs are held back
# Bytes of all results in memory whose files are written; of those after them the arrays are read when they are needed.
MOST_STAYING = 256_000_000
_staying: WeakSet[ArrayContents] = WeakSet()


class LateFile:
    """A result in memory, to be added to until it is written to its place."""

    def __init__(
        self, path: Path, contents: ArrayContents, checkpoints: Mapping[int, bytes] | None, before: Tree | None,
        templates: Path | None,
    ) -> None:  # fmt: skip
        """path: its place; checkpoints, before, templates: as of `parts_of_file`."""
        self.path, self.contents, self.placed = path, contents, False
        self._checkpoints, self._templates = checkpoints, templates
        self._made = monotonic()  # s
        self.before = before  # what a run that goes on needs, until all is done

    @property
    def data(self) -> dict[str, np.ndarray]:
        """Its arrays by name."""
        return {name: x.values for name, x in self.contents.data.items()}

    def place_if_due(self) -> None:
        """Put it in its place where it has waited for as long as outputs are held back."""
        if monotonic() - self._made > WAITS:
            self.place()

    def place(self) -> None:
        """Put it in its place, on the disk when this returns; a second call does nothing.

        ResultError: it cannot be written, and is dropped.
        """
        if self.placed:
            return
        self.placed = True
        new = beside(self.path)
        try:
            parts = parts_of_file(self.contents, self._checkpoints, self.before, self._templates)
            size = found = 0
            with new.open("wb") as file:
                for part in parts:
                    file.write(part)
                    size, found = size + len(part), zlib.crc32(part, found)
                file.write(tail_of(size, found))
                file.flush()
                os.fsync(file.fileno())
            os.replace(new, self.path)
        except (OSError, RuntimeError) as error:
            raise unwritable(self.path, error, "free some disk space; close programs that hold the file") from error
        finally:
            new.unlink(missing_ok=True)

    def may_stay(self) -> bool:
        """Whether the contents may stay in memory, where they are read from; a program may keep thousands of results.

        They are then counted until nobody holds them, or they are closed.
        """
        if sum(x.size for x in (*_staying, self.contents)) > MOST_STAYING:
            return False
        _staying.add(self.contents)
        return True

    def drop(self) -> None:
        """Nothing is written of it any more."""
        self.placed = True
