"""A server of `hybrid view` in this process, a client that speaks as the page does, and random edits of scenes."""

from __future__ import annotations

import json
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from hybrid.live.server import listen, make_server
from hybrid.live.session import Session, session_of

SCENE = """\
title: A line
environment:
  seabed: {z: -20, stiffness: 2.0e+3}
cable:
  sections:
    - {length: 30, diameter: 0.03, mass: 2.0, axial_stiffness: 1.0e+7, bending_stiffness: 60}
ends:
  start: {kind: pinned, position: [0, 0, -20]}
  end: {kind: pinned, position: [14, 0, 0], motion: {heave: {amplitude: 0.5, period: 4}, ramp: 4}}
initial: equilibrium
model: rod
mesh: {cells: 40}
time: {duration: 4.0, step: 0.05}
"""
LINES = """\
title: Two lines and a buoy
points:
  left: {position: [-30, 0, 0]}
  right: {position: [30, 0, 0]}
  buoy: {kind: free, initial_guess: [0, 0, -10], mass: 50}
lines:
  a: {start: left, end: buoy, sections: [{length: 34, mass: 2, axial_stiffness: 1.0e+6}]}
  b: {start: right, end: buoy, sections: [{length: 34, mass: 2, axial_stiffness: 1.0e+6}]}
"""


@contextmanager
def served(file: Path | None) -> Iterator[tuple[str, Session]]:
    """The address of a server, until the end."""
    session, at = session_of(file), listen()
    server, address, _ = make_server(session, at)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [at]})
    thread.start()
    try:
        while not server.started and thread.is_alive():
            time.sleep(0.01)
        yield address, session
    finally:
        server.should_exit = True
        thread.join(30.0)
        at.close()
        assert not thread.is_alive()


class Page:
    """What the page does with its websocket: text, revision, pictures."""

    def __init__(self, address: str, **more: Any) -> None:
        origin = more.pop("origin", "/".join(address.split("/")[:3]))
        where = address.replace("http:", "ws:") + "live"
        self._open = ExitStack()
        opened = connect(where, origin=origin, max_size=None, proxy=None, **more)
        self.socket: ClientConnection = self._open.enter_context(opened)
        self.text, self.revision = "", -1
        self.got: list[dict[str, Any]] = []

    def hear(self, wanted: str | Callable[[dict[str, Any]], bool], timeout: float = 300.0) -> dict[str, Any]:
        """The next message of a kind, or for which `wanted` is true; what comes before it is kept in `got`."""
        is_it = wanted if callable(wanted) else lambda m: m["is"] == wanted
        end = time.monotonic() + timeout
        while True:
            message = json.loads(self.socket.recv(timeout=max(end - time.monotonic(), 0.01)))
            self.got.append(message)
            if message["is"] == "text" or (message["is"] == "taken" and message["text"] is not None):
                self.text, self.revision = message["text"], message["revision"]
            elif message["is"] == "taken":
                self.revision = message["revision"]
            if is_it(message):
                return message

    def ask(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def edit(self, text: str, base: int | None = None) -> int:
        """Send a text, and wait until it is taken: its revision."""
        self.ask(do="edit", text=text, base=self.revision if base is None else base)
        self.text = text
        self.hear("taken")
        return self.revision

    def picture(self, revision: int) -> dict[str, Any]:
        """The picture of a revision, or a later one."""
        return self.hear(lambda m: m["is"] == "picture" and m["revision"] >= revision)["picture"]

    def close(self) -> None:
        self._open.close()


def exchange(address: str, request: bytes) -> bytes:
    """What a server answers to bytes."""
    host, port = address.split("/")[2].split(":")
    with socket.create_connection((host, int(port)), timeout=10) as at:
        answer = b""
        with suppress(ConnectionError):
            at.sendall(request)
        with suppress(ConnectionError):
            while part := at.recv(65536):
                answer += part
    return answer


def random_edit(rng: random.Random, text: str) -> str:
    """A text with one random change: broken or sound."""
    where = rng.randrange(len(text) + 1)
    lines = text.splitlines(keepends=True) or ["\n"]
    k = rng.randrange(len(lines))
    digits = [i for i, c in enumerate(text) if c.isdigit()] or [0]
    i = rng.choice(digits)
    return rng.choice((
        lambda: text[:where] + rng.choice("{}[]:,-#'\"&*!|>%@`\t\n aZ09.\0\u00e9\u2028\U0001f30a") + text[where:],
        lambda: text[:where] + text[where + rng.randrange(1, 12) :],
        lambda: text[:i] + rng.choice("0123456789e-.") + text[i + 1 :],
        lambda: text[:i] + rng.choice(("0", "99", "-1", "1e9", "null", "nan", "[1, 2]")) + text[i + 1 :],
        lambda: "".join(lines[:k] + lines[k + 1 :]),
        lambda: "".join([*lines[:k], lines[k], *lines[k:]]),
        lambda: "".join([*lines[:k], rng.choice(("  ", "    ")) + lines[k], *lines[k + 1 :]]),
        lambda: "".join(rng.sample(lines, len(lines))),
        lambda: text[:where],
    ))()  # fmt: skip
