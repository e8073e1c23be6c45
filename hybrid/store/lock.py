"""The lock on a result file: one process at a time writes it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from glob import escape
from pathlib import Path

from filelock import FileLock, Timeout

from hybrid.errors import ResultError, ResultHeld


@contextmanager
def locked(path: Path | None) -> Iterator[None]:
    """Hold a result for writing, against other processes, until the end; ResultError if one holds it."""
    if path is None:
        yield
        return
    beside = path.with_name(f".{path.name}.lock")
    lock = FileLock(beside, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        advice = "another name with -o, or wait until it has ended"
        raise ResultHeld(f"{path} is being written by another process\n    try:      {advice}") from None
    except OSError as error:
        advice = "a folder you may write to, with free space"
        raise ResultError(f"{path} cannot be written\n    detail:   {error}\n    try:      {advice}") from error
    try:
        for left in path.parent.glob(f".{escape(path.name)}.[0-9]*.new"):  # of a process that was killed
            left.unlink(missing_ok=True)
        yield
    finally:
        beside.unlink(missing_ok=True)
        lock.release()
