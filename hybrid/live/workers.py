"""The processes that compute pictures: one at work and one ready, so that a newer text need not wait for an older."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

# s that a picture may take while a newer text waits: most take 0.05 s, and another process needs 1 s to be ready.
PATIENCE = 0.5
# Bytes of the longest answer: a report of many outputs.
LONGEST_ANSWER = 256_000_000


def own_process(call: str) -> list[str]:
    """Command of a process of this package, wherever it is started.

    -P: a file of the present folder that is called as a module of this package or of Python is not run.
    """
    package = str(Path(__file__).parents[2])
    return [sys.executable, "-P", "-c", f"import sys; sys.path.insert(0, {package!r}); {call}"]


class Process:
    """One worker, and how it is asked."""

    def __init__(self) -> None:
        self._child: asyncio.subprocess.Process | None = None
        self.compiling = False
        self.ready = asyncio.Event()

    async def start(self) -> None:
        """Start it, unless it was; it is asked at once, and answers when it is ready."""
        if self._child is not None:
            return
        pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
        self._child = await asyncio.create_subprocess_exec(
            *own_process("from hybrid.live.worker import main; main()"), stdin=pipe, stdout=pipe, stderr=nothing,
            limit=LONGEST_ANSWER, start_new_session=True,
        )  # fmt: skip

    async def ask(self, asked: dict[str, Any]) -> bytes | None:
        """The JSON of its answer; None: the process has ended."""
        child = self._child
        if child is None or child.stdin is None or child.stdout is None:
            return None
        try:
            child.stdin.write(json.dumps(asked).encode() + b"\n")
            await child.stdin.drain()
            while line := await child.stdout.readline():
                what, _, content = line.partition(b"\t")
                if what.decode() == asked["do"]:
                    self.compiling = False
                    return content
                self.compiling = what == b"compiling"
                if what == b"ready":
                    self.ready.set()
        except (ConnectionError, ValueError):
            pass
        return None

    async def stop(self) -> None:
        """End it at once."""
        child = self._child
        if child is not None and child.returncode is None:
            with suppress(ProcessLookupError):
                child.kill()
            with suppress(TimeoutError):
                await asyncio.wait_for(child.wait(), 5.0)


class Workers:
    """Pictures of texts, one at a time."""

    def __init__(self) -> None:
        self._at_work, self._spare = Process(), Process()
        self._busy = asyncio.Lock()
        self.killed = 0  # processes that were ended because a newer text waited

    async def start(self) -> None:
        """Start the one at work.  The other starts with its first answer, so that they need not share a processor."""
        await self._at_work.start()

    @property
    def compiling(self) -> bool:
        """Whether kernels are being compiled for the text that was asked last."""
        return self._at_work.compiling

    async def ask(self, asked: dict[str, Any], newer: asyncio.Event | None = None) -> bytes | None:
        """The answer; None: a newer text came (`newer`) and this one took longer than `PATIENCE`, or the process ended.

        A process that compiles kernels is let be: what it has compiled by then would be lost.
        """
        async with self._busy:
            answer = asyncio.ensure_future(self._at_work.ask(asked))
            while newer is not None and not answer.done():
                done, _ = await asyncio.wait([answer], timeout=PATIENCE)
                if not done and newer.is_set() and not self.compiling:
                    self.killed += 1
                    await self._replace()
            found = await answer
            await self._spare.start()
            if found is None and not (newer is not None and newer.is_set()):
                await self._replace()  # it ended by itself: killed from outside, or out of memory
            return found

    async def ask_spare(self, asked: dict[str, Any]) -> bytes | None:
        """The answer of the process that computes no pictures."""
        await self._spare.start()
        return await self._spare.ask(asked)

    async def _replace(self) -> None:
        """End the process at work, take the other, and start a new one beside it."""
        ended, self._at_work, self._spare = self._at_work, self._spare, Process()
        await ended.stop()
        await self._at_work.start()
        await self._spare.start()

    async def stop(self) -> None:
        """End both."""
        await asyncio.gather(self._at_work.stop(), self._spare.stop())
