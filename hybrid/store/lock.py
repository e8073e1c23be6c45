"""The lock on a result file: one process at a time writes it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from hybrid.errors import ResultError, ResultHeld

# s: whoever asks `is_held` holds a lock for some microseconds.
_PATIENCE = 0.2
_OURS: set[Path] = set()  # results that this process holds


def is_held(path: Path) -> bool:
    """Whether another process holds a result for writing; a lock that a killed one has left is removed."""
    if path in _OURS or not _beside(path).exists():
        return False
    try:
        with FileLock(_beside(path), timeout=0):
            with suppress(OSError):  # Windows keeps what is open
                _beside(path).unlink(missing_ok=True)  # it is made anew where the other process has just ended
            return False
    except (Timeout, OSError):
        return True


@contextmanager
def locked(path: Path | None) -> Iterator[None]:
    """Hold a result for writing, against other processes, until the end; ResultError if one holds it."""
    if path is None:
        yield
        return
    beside = _beside(path)
    lock = FileLock(beside, timeout=_PATIENCE)
    try:
        lock.acquire()
    except Timeout:
        if not beside.exists():  # nobody holds it: it cannot be made there
            raise ResultError(f"{path} cannot be written\n    try:      a folder you may write to") from None
        advice = "another name with -o, or wait until it has ended"
        raise ResultHeld(f"{path} is being written by another process\n    try:      {advice}") from None
    except OSError as error:
        advice = "a folder you may write to, with free space"
        raise ResultError(f"{path} cannot be written\n    detail:   {error}\n    try:      {advice}") from error
    try:
        _remove_left(path)
        _OURS.add(path)
        yield
    finally:
        _OURS.discard(path)
        beside.unlink(missing_ok=True)
        lock.release()


def _remove_left(path: Path) -> None:
    """Remove what killed processes have left: beside a result (hdf5_file.beside), and locks of others in its folder."""
    begin, names = f".{path.name}.", set(os.listdir(path.parent))
    for name in names:
        if name.startswith(begin) and name.endswith(".new") and name[len(begin) : -4].isdigit():
            path.with_name(name).unlink(missing_ok=True)
        of = name[1:-5]
        ours = name.startswith(".") and name.endswith(".lock") and of != path.name
        if ours and (of in names or of.endswith(".h5")) and _is_empty(path.with_name(name)):
            is_held(path.with_name(of))  # which removes it, unless it is held


def _is_empty(path: Path) -> bool:
    try:
        return path.stat().st_size == 0
    except OSError:
        return False


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")
