"""The output and error streams where they are pipes, as in `hybrid schema | head`."""

from __future__ import annotations

import io
import os
import stat
import sys
from typing import Any


class _Pipe(io.FileIO):
    """A stream that is a pipe: what nobody reads any more, as behind `| head`, is dropped."""

    dropped = False

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            self.dropped = True
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return memoryview(data).nbytes


def guard_output() -> None:
    """Let a reader that has gone end no command, cause no error message and change no exit code."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        try:
            piped = stat.S_ISFIFO(os.fstat(stream.fileno()).st_mode)
        except (OSError, ValueError, AttributeError):  # a stream without a file, as in tests; none under pythonw
            continue
        if piped and isinstance(stream, io.TextIOWrapper):
            raw = io.BufferedWriter(_Pipe(stream.fileno(), "w", closefd=False))
            setattr(
                sys, name, io.TextIOWrapper(raw, stream.encoding, stream.errors, line_buffering=stream.line_buffering)
            )


def reader_has_gone() -> bool:
    """Whether output was dropped because its reader has closed the pipe."""
    return bool(getattr(getattr(getattr(sys.stdout, "buffer", None), "raw", None), "dropped", False))
