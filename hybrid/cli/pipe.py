"""The output and error streams where they are no terminal, as in `hybrid schema | head`, `hybrid schema > file`."""

from __future__ import annotations

import io
import os
import sys
from typing import Any

OUTPUT = "the output"  # name of the stream, for messages


class _Stream(io.FileIO):
    """A stream to a pipe or file: what cannot be written is dropped, and a computation goes on.

    What nobody reads any more, as behind `| head`, is no error; that a disk is full is one, at the end of the command.
    """

    dropped = False  # as nobody reads it
    error: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            self.dropped = isinstance(error, BrokenPipeError)
            self.error = None if self.dropped else OSError(error.errno, error.strerror, OUTPUT)
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
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
            to = io.BufferedWriter(raw)
            setattr(
                sys, name, io.TextIOWrapper(to, stream.encoding, stream.errors, line_buffering=stream.line_buffering)
            )


def reader_has_gone() -> bool:
    """Whether output was dropped because its reader has closed the pipe."""
    stream = _output_stream()
    return stream is not None and stream.dropped


def raise_lost_output() -> None:
    """Raise, once, that output could not be written."""
    sys.stdout.flush()
    stream = _output_stream()
    if stream is not None and (error := stream.error) is not None:
        stream.error = None
        raise error


def _output_stream() -> _Stream | None:
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw if isinstance(raw, _Stream) else None
