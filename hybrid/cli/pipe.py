"""The output and error streams where they are no terminal, as in `hybrid schema | head`, `hybrid schema > file`."""

from __future__ import annotations

import io
import os
import sys
from typing import Any

OUTPUT = "the output"  # name of the stream, for messages


class _Stream(io.FileIO):
    """A stream to a pipe or file: what cannot be written is dropped, of a full disk with an error that names it.

    What nobody reads any more, as behind `| head`, is no error.
    """

    dropped = False
    name_told = ""  # in errors; "": there are none

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            self.dropped = True
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            if self.name_told and not isinstance(error, BrokenPipeError):
                raise OSError(error.errno, error.strerror, self.name_told) from None
            return memoryview(data).nbytes


def guard_output() -> None:
    """Let a reader that has gone end no command, cause no error message and change no exit code."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        try:
            piped = not os.isatty(stream.fileno())
        except (OSError, ValueError, AttributeError):  # a stream without a file, as in tests; none under pythonw
            continue
        if piped and isinstance(stream, io.TextIOWrapper):
            raw = _Stream(stream.fileno(), "w", closefd=False)
            raw.name_told = OUTPUT if name == "stdout" else ""
            to = io.BufferedWriter(raw)
            setattr(
                sys, name, io.TextIOWrapper(to, stream.encoding, stream.errors, line_buffering=stream.line_buffering)
            )


def reader_has_gone() -> bool:
    """Whether output was dropped because its reader has closed the pipe."""
    return bool(getattr(getattr(getattr(sys.stdout, "buffer", None), "raw", None), "dropped", False))
