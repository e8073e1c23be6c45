"""One scene, or one result, that is viewed: its text, its pictures, its run, and the browsers that show them."""

from __future__ import annotations

import asyncio
import json
import time as clock
from contextlib import suppress
from pathlib import Path
from typing import Any

from hybrid.errors import SceneError
from hybrid.live import pictures
from hybrid.live.document import (
    Document,
    Refused,
    Stamp,
    example_text,
    examples,
    named_files,
    new_scene,
    questions,
    stamp_of,
)
from hybrid.live.workers import WatchedRun, Workers
from hybrid.scene.read import text_of
from hybrid.store.hdf5_file import is_held, is_result
from hybrid.store.reader import open_result

WATCH = 0.02  # s, between two looks at the scene file,
FOLLOW = 0.2  # s, and at a result
GONE = 1.0  # s, after which a missing file is gone, and not about to be replaced by an editor that saves
WATCH_NAMED = 0.1  # s between two looks at the files that a scene names
# Messages that wait for a browser that does not read: it is let go, and gets everything when it comes back.
MOST_WAITING = 500
STOPPING = 10.0  # s for a run to complete its file when the view ends


class Client:
    """A browser that is connected: what waits to be sent to it."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.waiting: asyncio.Queue[str | None] = asyncio.Queue()  # None: it is let go

    def send(self, message: str) -> None:
        """Send a message when it is read."""
        if self.waiting.qsize() >= MOST_WAITING:
            while not self.waiting.empty():
                self.waiting.get_nowait()
            self.waiting.put_nowait(None)
            return
        self.waiting.put_nowait(message)


class Session:
    """What a page shows, shared by all browsers on it."""

    def __init__(
        self, document: Document | None, playback: Playback | None = None, workers: Workers | None = None
    ) -> None:
        """document: None of a result alone, which `playback` plays; workers: some that are started, or its own."""
        self.document, self.playback = document, playback
        self.workers = workers or Workers()
        self.run: WatchedRun | None = None
        self._clients: list[Client] = []
        self._count = 0
        self._wanted = asyncio.Event()  # a text waits for its picture
        self._picture: bytes | None = None  # the last one with a frame
        self._answer: bytes | None = None  # the last one
        self._answered = -1  # revision of the last one
        self._computing = 0.0  # since when (s), or 0
        self._disk, self._gone = "", 0.0
        self._named: dict[Path, Stamp | None] = {}  # files that the scene names, as they were before it was read
        self._sent_state = ""
        self._tasks: list[asyncio.Task[None]] = []
        self._reading = asyncio.Lock()

    async def start(self) -> None:
        """Start computing, watching and following."""
        await self.workers.start()
        if self.document is not None and self.document.text.strip():
            self._wanted.set()
        work = (self._compute(), self._watch(), self._watch_named(), self._read_new())
        self._tasks = [asyncio.create_task(x) for x in work]

    async def stop(self) -> None:
        """End everything; a run completes its file."""
        if self.run is not None and self.run.state["running"]:
            self.run.stop()
            end = clock.monotonic() + STOPPING
            while self.run.state["running"] and clock.monotonic() < end:
                await asyncio.sleep(0.05)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.workers.stop()

    # ---- browsers -----------------------------------------------------------------------------

    def connect(self) -> Client:
        """A browser comes, or comes back: it gets everything there is."""
        self._count += 1
        client = Client(self._count)
        hello = {"client": client.number, "examples": examples(), "questions": questions()}
        client.send(_message("hello", **hello))
        self._clients.append(client)
        if self.document is not None:
            client.send(self._text())
        elif self.playback is not None:
            client.send(_message("text", revision=0, text=self.playback.text, by=0))
        for answer in dict.fromkeys((self._picture, self._answer)):
            if answer is not None:
                client.send(_picture(self._answered, answer))
        if self.playback is not None and self.playback.head:
            client.send(self._frames(0))
        client.send(self._state())
        self._send_state()
        return client

    @property
    def browsers(self) -> int:
        """How many are connected."""
        return len(self._clients)

    def leave(self, client: Client) -> None:
        """A browser goes."""
        if client in self._clients:
            self._clients.remove(client)
        self._send_state()

    def send_all(self, message: str, but: Client | None = None) -> None:
        """Send a message to all, but one."""
        for client in self._clients:
            if client is not but:
                client.send(message)

    async def hear(self, client: Client, message: str) -> None:
        """Do what a browser asks; what is not done it is told, with the reason."""
        try:
            asked = json.loads(message)
            if not isinstance(asked, dict):
                raise Refused("a message is a JSON object")
            await self._do(client, asked)
        except Refused as refused:
            client.send(_message("refused", text=str(refused)))
        except (ValueError, TypeError, LookupError, ArithmeticError, RecursionError) as error:
            client.send(_message("refused", text=f"not understood: {type(error).__name__}: {error}"[:500]))
        self._send_state()

    async def _do(self, client: Client, asked: dict[str, Any]) -> None:
        what = asked.get("do")
        if what in ("play", "stop"):
            await (self._play() if what == "play" else self._stop_run())
            return
        document = self.document
        if document is None:
            raise Refused("a result is shown, which cannot be changed; `hybrid view SCENE.yaml` edits a scene")
        if what == "edit":
            self._edit(client, document, str(asked["text"]), int(asked["base"]))
        if what == "save":
            name = asked.get("name")
            document.save(None if name is None else str(name), asked.get("force") is True)
            self._disk = ""
            client.send(_message("saved", file=str(document.path and document.path.name)))
        elif what == "reload":
            document.reload()
            self._disk = ""
            self._changed(0)
        elif what == "new":
            self._replace(document, new_scene(str(asked["kind"]), dict(asked["answers"])))
        elif what == "example":
            self._replace(document, example_text(str(asked["name"])))
        elif what == "run":
            self._start_run(client, document, asked.get("replace") is True)
        elif what != "edit":
            raise Refused(f"unknown: {str(what)[:100]!r}")

    # ---- the text -----------------------------------------------------------------------------

    def _edit(self, client: Client, document: Document, text: str, base: int) -> None:
        before = document.revision
        taken = document.edit(text, base)
        if document.revision != before:
            self._wanted.set()
            self.send_all(self._text(client.number), but=client)
        client.send(_message("taken", revision=document.revision, text=None if taken == text else taken))

    def _replace(self, document: Document, text: str) -> None:
        """Another scene in place of this one, which must not be lost."""
        if document.path is not None:
            raise Refused("a new scene takes the place of none: start `hybrid view` without a file")
        document.edit(text, document.revision)
        self._changed(0)

    def _changed(self, by: int) -> None:
        self._wanted.set()
        self.send_all(self._text(by))

    def _text(self, by: int = 0) -> str:
        assert self.document is not None
        return _message("text", revision=self.document.revision, text=self.document.text, by=by)

    async def _watch(self) -> None:
        """Look at the file again and again."""
        while self.document is not None:
            await asyncio.sleep(WATCH)
            try:
                found = self.document.compare_with_disk()
            except SceneError as error:
                self.send_all(_message("refused", text=f"the file on disk is not read: {error}"))
                continue
            if found == "gone":
                self._gone = clock.monotonic()
            elif self._gone and (found or (self.document.path and self.document.path.exists())):
                self._gone, self._disk = 0.0, ""
            if self._gone and clock.monotonic() - self._gone > GONE:
                self._gone, self._disk = 0.0, "gone"
            if found == "taken":
                self._disk = ""
                self._changed(0)
            elif found == "differs":
                self._disk = "differs"
            if found or self._disk == "gone":
                self._send_state()

    async def _watch_named(self) -> None:
        """Look at the files that the scene names, such as motions: where one has changed there is a new picture."""
        while self.document is not None:
            now = {file: stamp_of(file) for file in self._named}
            if now != self._named:
                self._named = now
                self._wanted.set()
            await asyncio.sleep(WATCH_NAMED)

    # ---- pictures -----------------------------------------------------------------------------

    async def _compute(self) -> None:
        """The picture of the text, whenever there is a newer one."""
        while self.document is not None:
            await self._wanted.wait()
            self._wanted.clear()
            revision, text = self.document.revision, self.document.text
            # before they are read, so that no change after that is missed
            self._named = {file: stamp_of(file) for file in named_files(text, self.document.folder)}
            if not text.strip():
                continue
            self._computing = clock.monotonic()
            late = asyncio.get_running_loop().call_later(0.3, self._send_state)
            asked = {"do": "picture", "text": text, "file": self.document.name}
            answer = await self.workers.ask(asked, self._wanted)
            late.cancel()
            self._computing = 0.0
            if answer is None and self._wanted.is_set():
                continue
            answer = answer or _ENDED
            self._answer, self._answered = answer, revision
            if b'"frame": {' in answer:  # within a text the quotes of a key would be escaped
                self._picture = answer
            self.send_all(_picture(revision, answer))
            self._send_state()

    async def report(self, of_motion: bool) -> dict[str, Any]:
        """The report of the equilibrium, or of the result that is played: `html`, or `refused`."""
        if of_motion and self.playback is not None:
            answer = await self.workers.ask_spare({"do": "report", "file": str(self.playback.path.resolve())})
        else:
            answer = await self.workers.ask({"do": "report", "file": None})
        return _page(answer)

    async def modes(self) -> dict[str, Any]:
        """The page of natural modes of the scene as it stands: `html`, or `refused`."""
        if self.document is None:
            return {"refused": "modes are of a scene: open it in place of its result"}
        asked = {"do": "modes", "text": self.document.text, "file": self.document.name}
        return _page(await self.workers.ask_spare(asked))

    # ---- the motion ---------------------------------------------------------------------------

    def _start_run(self, client: Client, document: Document, replace: bool) -> None:
        if document.path is None or document.changed:
            raise Refused("save the scene first: a run reads its file")
        if self.run is not None and self.run.state["running"]:
            raise Refused("a run is under way: stop it first")
        target = document.path.with_suffix(".h5")
        if is_held(target):
            raise Refused(f"{target.name} is being written by another process")
        if target.exists() and not replace:
            client.send(_message("ask", what="replace", file=target.name))
            return
        self.playback = None
        self.run = WatchedRun(document.path, target, self._send_state)
        work = asyncio.create_task(self._run_to_end(self.run))
        self._tasks = [task for task in self._tasks if not task.done()] + [work]

    async def _run_to_end(self, run: WatchedRun) -> None:
        before = run.target.stat().st_mtime_ns if run.target.exists() else 0
        following = asyncio.ensure_future(run.watch())
        while not following.done():
            await asyncio.wait([following], timeout=0.1)
            begun = run.target.exists() and run.target.stat().st_mtime_ns != before and is_held(run.target)
            if begun and self.playback is None:
                self.playback = Playback(run.target)
        await following
        if self.playback is None and run.target.exists() and run.target.stat().st_mtime_ns != before:
            self.playback = Playback(run.target)
        await self._read(again=True)

    async def _stop_run(self) -> None:
        if self.run is None or not self.run.state["running"]:
            raise Refused("no run is under way")
        self.run.stop()

    async def _play(self) -> None:
        """Play the result that lies beside the scene."""
        document = self.document
        if self.playback is None and document is not None and document.path is not None:
            target = document.path.with_suffix(".h5")
            if not await asyncio.to_thread(is_result, target):
                raise Refused(f"there is no result {target.name}: run the scene first")
            self.playback = Playback(target)
        await self._read(again=True)

    async def _read_new(self) -> None:
        """Read what is new in the result that is played."""
        while True:
            if self.playback is not None and (self._clients or not self.playback.head) and self.playback.due:
                await self._read()
            await asyncio.sleep(FOLLOW)

    async def _read(self, again: bool = False) -> None:
        """Read it once; again: send all frames, also those that the page has."""
        playback = self.playback
        if playback is None:
            return
        async with self._reading:
            was = playback.running, playback.problem
            before, new = await asyncio.to_thread(playback.read)
            if new and playback.problem:
                self.send_all(_message("refused", text=playback.problem))
            elif (new or again) and playback.head:
                self.send_all(self._frames(0 if again else before))
            if was != (playback.running, playback.problem):
                self._send_state()

    def _frames(self, begin: int) -> str:
        """Frames from that number on; those before it the page has."""
        assert self.playback is not None
        state = {"running": self.playback.running, "status": self.playback.status}
        return _message("frames", begin=begin, frames=self.playback.frames[begin:], head=self.playback.head, **state)

    # ---- what stands above the pictures -------------------------------------------------------

    def _state(self) -> str:
        document, playback = self.document, self.playback
        path = document.path if document is not None else playback.path if playback is not None else None
        result = path.with_suffix(".h5") if path is not None else None
        state = {
            "file": path.name if path else None,
            "folder": str(document.folder if document is not None else path.parent if path else ""),
            "editable": document is not None,
            "changed": document is not None and document.changed,
            "disk": self._disk,
            "run": self.run.state if self.run is not None else None,
            "result": result.name if result is not None and result.exists() else None,
            "playing": playback.path.name if playback is not None else None,
            "computing": self._computing > 0.0 and clock.monotonic() - self._computing > 0.25,
            "compiling": self.workers.compiling,
            "browsers": len(self._clients),
        }
        return _message("state", **state)

    def _send_state(self) -> None:
        state = self._state()
        if state != self._sent_state:
            self._sent_state = state
            self.send_all(state)


_PROBLEM = {"line": None, "where": "process", "given": "", "text": "the process that computes was ended"}
_ENDED = json.dumps({"problems": [_PROBLEM], "notes": []}).encode()


def _message(kind: str, /, **content: Any) -> str:
    return json.dumps({"is": kind} | content)


def _page(answer: bytes | None) -> dict[str, Any]:
    """A page of an answer, or why there is none."""
    made = json.loads(answer) if answer is not None else {}
    if "problems" in made:
        return {"refused": made["problems"][0]["text"]}
    return dict(made) or {"refused": "the process that makes pages has ended: try again"}


def _picture(revision: int, answer: bytes) -> str:
    return f'{{"is": "picture", "revision": {revision}, "picture": {answer.decode()}}}'


def session_of(path: Path | None, workers: Workers | None = None) -> Session:
    """The session of a scene file, of a result file, or, without a file, of a scene that is still to be written.

    SceneError or ResultError where the file cannot be read.
    """
    if path is None:
        return Session(Document(""), None, workers)
    path = path.expanduser().absolute()
    if path.suffix.lower() in (".h5", ".hdf5") or is_result(path):
        if not is_held(path):
            with suppress(KeyError):
                open_result(path).close()
        return Session(None, Playback(path), workers)
    return Session(Document(text_of(path), path), None, workers)


# Outputs of a result file as the page plays them, those of a running computation as they come.

MOST_FRAMES = 400  # that a page holds
POINTS = 121  # along a line in each,
FEW_POINTS = 41  # and where there are many lines
MANY_LINES = 8
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
        self._cost, self._last = 0.0, -1e9
        self._stamp: Stamp | None = None
        self._made: Any = None  # by which its run is told from another one

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
            stamp = stamp_of(self.path)
            if stamp is None:
                raise FileNotFoundError(f"there is no file {self.path}")
            running = is_held(self.path)
            if self.head and stamp == self._stamp and running == self.running:
                return len(self.frames), False
            self.running = running
            before = self._read()
            self._stamp, self.problem = stamp, ""
            return before, True
        except Exception as error:  # not complete yet, being replaced, or no result: the page says so
            changed, self.problem = str(error) != self.problem, str(error)
            return len(self.frames), changed and not self.running
        finally:
            self._last = clock.monotonic()
            self._cost = self._last - begin

    def _read(self) -> int:
        with open_result(self.path) as result:
            outputs = min(len(next(x for _, x in result.each_line()).times), len(result.times))
            made = result.attributes.get("created"), result.scene_text
            if outputs < self._next or made != self._made:  # another run
                self.frames, self.stride, self._next = [], 1, 0
            self._made = made
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
                self.frames += pictures.frames(result, new, points)
            self._next = outputs
            self.head = pictures.around(result) if outputs else {}
            if outputs:
                self.head |= {"heads": pictures.heads(result), "title": result.title}
                self.head |= {"facts": [] if self.running else pictures.facts(result)}
            return before
