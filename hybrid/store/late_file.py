"""The file of a short run, which is written in one go when the run has ended.

A file that readers may open while it grows is flushed before and after every change of its lengths, and what is known
of a result afterwards goes into a copy.  A run that takes less than the time for which outputs are held back anyhow
needs neither: its file is made beside its place, is added to until all is known, and then takes its place.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import h5py

from hybrid.store.hdf5_file import beside, redrafted, unwritable
from hybrid.store.integrity import sign_new


class LateFile:
    """A file beside its place, open to be added to until it takes its place."""

    def __init__(self, path: Path, image: bytes) -> None:
        """path: its place; image: the bytes that it begins as.  ResultError: it cannot be written."""
        self.path, self.placed = path, False
        self.at_last: Callable[[h5py.File], None] = lambda file: None  # what is added when nothing else is
        self._new, self._open = beside(path), ExitStack()
        try:
            self._new.write_bytes(image)
            self.file = self._open.enter_context(redrafted(self._new))
        except OSError as error:
            raise self._gone(error) from error

    def change(self, change: Callable[[h5py.File], None]) -> None:
        """Add to it; ResultError: it cannot be written, and is dropped."""
        try:
            change(self.file)
        except (OSError, RuntimeError) as error:
            raise self._gone(error) from error
        except BaseException:
            self.drop()
            raise

    def place(self) -> None:
        """Put it in its place, on the disk when this returns; a second call does nothing.  ResultError as `change`."""
        if self.placed:
            return
        self.change(self.at_last)
        try:
            self._open.close()
            sign_new(self._new)
            with self._new.open("rb") as file:
                os.fsync(file.fileno())
            os.replace(self._new, self.path)
        except (OSError, RuntimeError) as error:
            raise self._gone(error) from error
        finally:
            self.drop()

    def drop(self) -> None:
        """Leave nothing beside its place; nothing is written there any more."""
        self.placed = True
        with suppress(OSError, RuntimeError):  # what they say is of a file that nobody wants
            self._open.close()
        self._new.unlink(missing_ok=True)

    def _gone(self, error: Exception) -> Exception:
        self.drop()
        return unwritable(self.path, error, "free some disk space; close programs that hold the file")
