"""Outputs of a result file as the page plays them, those of a running computation as they come."""

from __future__ import annotations

import time as clock
from pathlib import Path
from typing import Any

from hybrid.live import drawing
from hybrid.store.hdf5_file import is_held
from hybrid.store.reader import Result, open_result

# Frames that a page holds, points along a line in each, and lines from which on they are fewer.
MOST_FRAMES, POINTS, FEW_POINTS, MANY_LINES = 400, 121, 41, 8
# Of the time between two looks at most this part goes into reading a file that grows.
SHARE = 0.2


class Playback:
    """The frames of a result that are shown: all, or every second, fourth .. of many; they grow while it is written.

    Reading blocks for some milliseconds to a second: call `read` from a thread.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.frames: list[dict[str, Any]] = []
        self.stride, self._next = 1, 0  # of outputs; the first that was not looked at
        self.head: dict[str, Any] = {}
        self.text = ""  # of the scene
        self.status = ""
        self.running = False
        self.problem = ""
        self._result: Result | None = None
        self._cost, self._last, self._stamp = 0.0, -1e9, (0, 0)

    @property
    def due(self) -> bool:
        """Whether it is time to look again."""
        return clock.monotonic() - self._last > self._cost / SHARE

    def read(self) -> tuple[int, bool]:
        """Look at the file: how many frames were there before, and whether anything is new.

        0 and True: those that the page holds are no longer among them.
        """
        begin = clock.monotonic()
        try:
            stamp = self._stamped()
            running = is_held(self.path)
            if self.head and stamp == self._stamp and running == self.running:
                return len(self.frames), False
            self.running = running
            before = self._read()
            self._stamp, self.problem = stamp, ""
            return before, True
        except Exception as error:  # not complete yet, being replaced, or no result: the page says so
            changed, self.problem = str(error) != self.problem, str(error)
            self.close()
            return len(self.frames), changed and not self.running
        finally:
            self._last = clock.monotonic()
            self._cost = self._last - begin

    def close(self) -> None:
        """Let go of the file."""
        if self._result is not None:
            self._result.close()
            self._result = None

    def _stamped(self) -> tuple[int, int]:
        found = self.path.stat()
        return found.st_mtime_ns, found.st_size

    def _read(self) -> int:
        with open_result(self.path) as result:
            outputs = len(next(x for _, x in result.each_line()).times)
            outputs = min(outputs, len(result.times))
            if outputs < self._next:  # another run has begun
                self.frames, self.stride, self._next = [], 1, 0
            before = len(self.frames)
            self.text, self.status = result.scene_text, result.status_text
            if outputs == self._next and self.head:
                return before
            while outputs / self.stride > MOST_FRAMES:
                self.stride *= 2
                self.frames, before = self.frames[::2], 0
            begin = -(-self._next // self.stride) * self.stride
            new = list(range(begin, outputs, self.stride))
            if not self.running and (outputs - 1) % self.stride:
                new.append(outputs - 1)
            points = POINTS if len(result.lines) <= MANY_LINES else FEW_POINTS
            if new:
                self.frames += drawing.frames(result, new, points)
            self._next = outputs
            self.head = drawing.around(result) if outputs else {}
            if outputs:
                self.head |= {"heads": drawing.heads(result), "title": result.title}
                self.head |= {"facts": [] if self.running else drawing.facts(result)}
            return before
