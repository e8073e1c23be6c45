"""The file of a short run, which is written in one go when the run has ended.

A file that readers may open while it grows is flushed before and after every change of its lengths, and what is known
of a result afterwards goes into a copy.  A run that takes less than the time for which outputs are held back anyhow
needs neither: its file is made in memory, is added to until all is known, and is then written to its place.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py

from hybrid.store.hdf5_file import beside, image_of, unwritable
from hybrid.store.integrity import sum_behind


class LateFile:
    """A file in memory, open to be added to until it is written to its place."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        """path: its place; file: in memory, nothing of which is held open by others when it is placed."""
        self.path, self.file, self.placed = path, file, False
        self.at_last: Callable[[h5py.File], None] = lambda file: None  # what is added when nothing else is

    def change(self, change: Callable[[h5py.File], None]) -> None:
        """Add to it; ResultError: there is no room for it, and it is dropped."""
        try:
            change(self.file)
        except (OSError, RuntimeError) as error:
            raise self._gone(error) from error
        except BaseException:
            self.drop()
            raise

    def place(self) -> None:
        """Put it in its place, on the disk when this returns; a second call does nothing.

        ResultError: it cannot be written, and is dropped.
        """
        if self.placed:
            return
        self.change(self.at_last)
        new = beside(self.path)
        try:
            image = image_of(self.file)
            with new.open("wb") as file:
                file.writelines((image, sum_behind(image)))
                file.flush()
                os.fsync(file.fileno())
            os.replace(new, self.path)
        except (OSError, RuntimeError) as error:
            raise self._gone(error) from error
        finally:
            self.drop()
            new.unlink(missing_ok=True)

    def drop(self) -> None:
        """Nothing is written of it any more."""
        self.placed = True
        with suppress(OSError, RuntimeError):  # what they say is of a file that nobody wants
            if self.file:
                self.file.id.close()

    def _gone(self, error: Exception) -> Exception:
        self.drop()
        return unwritable(self.path, error, "free some disk space; close programs that hold the file")
