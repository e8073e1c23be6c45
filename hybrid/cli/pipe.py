"""The output stream where it is a pipe, as in `hybrid schema | head`."""

from __future__ import annotations

import io
import os
import stat
import sys
from typing import Any


class _Pipe(io.FileIO):
    """The output stream where it is a pipe: what nobody reads any more, as behind `| head`, is dropped."""

    dropped = False

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            self.dropped = True
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return memoryview(data).nbytes


def guard_output() -> None:
    """Let a reader that has gone end no command and cause no error message."""
    try:
        piped = stat.S_ISFIFO(os.fstat(sys.stdout.fileno()).st_mode)
    except (OSError, ValueError):  # a stream without a file, as in tests
        return
    if piped and isinstance(sys.stdout, io.TextIOWrapper):
        old, raw = sys.stdout, io.BufferedWriter(_Pipe(sys.stdout.fileno(), "w", closefd=False))
        sys.stdout = io.TextIOWrapper(raw, old.encoding, old.errors, line_buffering=old.line_buffering)


def reader_has_gone() -> bool:
    """Whether output was dropped because its reader has closed the pipe."""
    return bool(getattr(getattr(getattr(sys.stdout, "buffer", None), "raw", None), "dropped", False))
