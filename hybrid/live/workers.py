"""The processes that compute pictures: how they are asked, and what runs in them.

One is at work and one ready, so that a newer text need not wait for an older.  A worker reads one line of JSON and
answers with lines: asked {"do": "picture", "text", "file"} "compiling" perhaps, then "picture" and JSON; asked
{"do": "report", "file"} the report of a result file, or of the last picture with file null: "report" and JSON;
{"do": "modes", "text", "file"} the page of natural modes of a scene: "modes" and JSON.
The first word of an answer and a tab stand before its JSON, so that the server passes it on without reading it.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

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
        self._asked = asyncio.Lock()  # one answer is read at a time

    async def start(self) -> None:
        """Start it, unless it was; it is asked at once, and answers when it is ready."""
        if self._child is not None:
            return
        call = own_process("from hybrid.live.workers import main; main()")
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        how: dict[str, Any] = pipes | {"limit": LONGEST_ANSWER, "start_new_session": True}
        self._child = await asyncio.create_subprocess_exec(*call, **how)

    async def ask(self, asked: dict[str, Any]) -> bytes | None:
        """The JSON of its answer; None: the process has ended."""
        child = self._child
        if child is None or child.stdin is None or child.stdout is None:
            return None
        async with self._asked:
            return await self._answer(child.stdin, child.stdout, asked)

    async def _answer(
        self, to: asyncio.StreamWriter, answers: asyncio.StreamReader, asked: dict[str, Any]
    ) -> bytes | None:
        try:
            to.write(json.dumps(asked).encode() + b"\n")
            await to.drain()
            while line := await answers.readline():
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
        spare = self._spare
        await spare.start()
        found = await spare.ask(asked)
        if found is None and spare is self._spare:  # it has ended
            self._spare = Process()
        return found

    async def _replace(self) -> None:
        """End the process at work, take the other, and start a new one beside it."""
        ended, self._at_work, self._spare = self._at_work, self._spare, Process()
        await ended.stop()
        await self._at_work.start()
        await self._spare.start()

    async def stop(self) -> None:
        """End both."""
        await asyncio.gather(self._at_work.stop(), self._spare.stop())


# The motion of a scene in a process of its own: `hybrid run --json`, its progress, and how it is stopped.

CALL = "from hybrid.cli.commands import main; main(sys.argv[1:])"
LONGEST_LINE = 16_000_000
INSIST = 2.0  # s after which a run that has computed nothing yet is asked again to stop: it may be compiling


class WatchedRun:
    """One run; `state` is what the page shows of it."""

    def __init__(self, scene: Path, target: Path, changed: Callable[[], None]) -> None:
        """changed: called when `state` has changed."""
        self.scene, self.target, self._changed = scene, target, changed
        self.state: dict[str, Any] = {"running": True, "file": target.name, "text": "starting", "fraction": 0.0}
        self._child: asyncio.subprocess.Process | None = None
        self._stopped = False

    async def watch(self) -> None:
        """Start it, and follow it to its end."""
        new_group = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)  # of Windows: signals are for a group there
        asked = "run", _argument(self.scene), "-o", _argument(self.target), "--json"
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        how: dict[str, Any] = {"cwd": self.scene.parent, "limit": LONGEST_LINE, "creationflags": new_group} | pipes
        call = *own_process(CALL), *asked
        self._child = child = await asyncio.create_subprocess_exec(*call, start_new_session=True, **how)
        assert child.stdout is not None
        if self._stopped:
            self._ask_to_stop()  # it was asked for while the process was being made
        with suppress(ValueError):
            while line := await child.stdout.readline():
                with suppress(json.JSONDecodeError):
                    self._hear(json.loads(line))
        await child.wait()
        self.state["running"] = False
        if "ended" not in self.state and self._stopped:
            t = self.state.get("t")
            text = "stopped before it began" if t is None else f"ended at once, after t = {t:.4g} s"
            self.state |= {"ended": "interrupted", "text": text}
        elif "ended" not in self.state:
            self.state |= {"ended": "failed", "text": f"the run ended with exit code {child.returncode}"}
        self._changed()

    def stop(self) -> None:
        """Ask it to stop: its file is complete until then.  A second time ends it at once."""
        if self._stopped and self._child is not None:
            with suppress(ProcessLookupError):
                self._child.kill()
        elif not self._stopped:
            self._stopped = True
            self._ask_to_stop()
        self.state["text"] = "stopping"
        self._changed()

    def _ask_to_stop(self) -> None:
        """By SIGTERM: SIGINT is ignored by what `hybrid view &` starts, until a run hears it by itself."""
        child = self._child
        if child is None or child.returncode is not None:
            return
        with suppress(ProcessLookupError):
            if sys.platform == "win32":
                child.send_signal(signal.CTRL_BREAK_EVENT)
            else:
                child.send_signal(signal.SIGTERM)
        if "t" not in self.state:
            asyncio.get_running_loop().call_later(INSIST, self._ask_to_stop)

    def _hear(self, event: dict[str, Any]) -> None:
        """Take a line of the run."""
        kind = event.get("event")
        if kind == "compiling" and not self._stopped:
            self.state["text"] = "compiling the kernels for this machine (first use only)"
        elif kind == "progress":
            self.state |= {"fraction": event["fraction"], "t": event["t"], "duration": event["duration"]}
            several = f"run {event['run']} of {event['runs']}, {event['name']}: " if event["runs"] > 1 else ""
            left = event["seconds_left"]
            rest = f", {left:.2g} s left" if left is not None else ""
            if not self._stopped:
                self.state["text"] = f"{several}t = {event['t']:.4g} of {event['duration']:g} s{rest}"
        elif kind == "error":
            self.state |= {"ended": "failed", "text": event["message"]}
        elif kind == "done":
            t = event.get("t")
            texts = {"complete": "complete", "interrupted": "stopped" + (f" at t = {t:.4g} s" if t is not None else "")}
            status = str(event.get("status"))
            self.state |= {"ended": status, "text": texts.get(status, status)}
            self.state["fraction"] = 1.0 if status == "complete" else self.state["fraction"]
        else:
            return
        self._changed()


def _argument(file: Path) -> str:
    """The name of a file on a command line in its folder, where one that begins with - would be an option."""
    return f"./{file.name}" if file.name.startswith("-") else file.name


# --- within a worker ---------------------------------------------------------------------------

# A scene whose equilibrium is found before the first text comes, so that the kernels are in memory by then.
SAMPLE = """\
environment: {seabed: {z: -5, stiffness: 1.0e+3}}
cable: {sections: [{length: 20, mass: 1, diameter: 0.02, axial_stiffness: 1.0e+6, bending_stiffness: 1}]}
ends: {start: {kind: pinned, position: [0, 0, -5]}, end: {kind: pinned, position: [16, 0, 0]}}
initial: equilibrium
model: rod
mesh: {cells: 20}
"""


def main() -> None:
    """Answer until the input ends; what anything here prints goes to the error stream."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)
    worker = Worker(answers)
    worker.warm_up()
    for line in sys.stdin:
        worker.answer(json.loads(line))


class Worker:
    """Answers of one process; it keeps the result of its last picture, for a report."""

    def __init__(self, answers: TextIO) -> None:
        self._answers = answers
        self._last: Any = None

    def warm_up(self) -> None:
        """Bring what the first picture needs into memory, unless it would have to be compiled first."""
        from hybrid.kernels.machine.compile import is_warm
        from hybrid.live.pictures import picture_of
        from hybrid.scene.read import parse_scene
        from hybrid.simulation.first_use import kernels_of

        if is_warm(kernels_of(parse_scene(SAMPLE), static=True)):
            picture_of(SAMPLE, "", lambda: None)
        self._say("ready", {})

    def answer(self, asked: dict[str, Any]) -> None:
        """Answer once; what goes wrong here is a bug of ours, and is said as one."""
        try:
            if asked["do"] == "report":
                self._say("report", self._report(asked["file"]))
            elif asked["do"] == "modes":
                self._say("modes", self._modes(asked["text"], asked["file"]))
            else:
                self._say("picture", self._picture(asked["text"], asked["file"]))
        except Exception:
            text = f"this is a bug in hybrid; please report it with the scene and these lines\n{traceback.format_exc()}"
            bug = {"line": None, "where": "bug", "given": "", "text": text}
            self._say(asked["do"], {"problems": [bug], "notes": [], "bug": True})

    def _picture(self, text: str, file: str) -> dict[str, Any]:
        from hybrid.live.pictures import picture_of

        picture, result = picture_of(text, file, lambda: self._say("compiling", {}))
        self._last = result or self._last
        return picture

    def _report(self, file: str | None) -> dict[str, Any]:
        from hybrid.errors import ResultError
        from hybrid.store.reader import open_result
        from hybrid.view.report import html

        try:
            if file is not None:
                with open_result(Path(file)) as result:
                    return {"html": html(result)}
            return {"html": html(self._last)} if self._last is not None else {"refused": "there is no equilibrium yet"}
        except ResultError as error:
            return {"refused": str(error)}

    def _modes(self, text: str, file: str) -> dict[str, Any]:
        from hybrid.errors import HybridError
        from hybrid.modal.api import modes
        from hybrid.scene.read import read_text
        from hybrid.view.report_parts import html

        try:
            return {"html": html(modes(read_text(text, file)[0]))}
        except HybridError as error:
            return {"refused": str(error)}

    def _say(self, what: str, content: dict[str, Any]) -> None:
        self._answers.write(f"{what}\t{json.dumps(content, allow_nan=False)}\n")
        self._answers.flush()
