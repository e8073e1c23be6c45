"""The server of the page: for browsers of this machine that know the address, and nobody else.

Every request is held against three things before anything is done: its Host is this machine's loopback address with
our port (a name that is made to lead here has another), its Origin, if it has one, is this page (another page in the
same browser has another; a websocket must have one), and its path begins with a random token (other users of this
machine do not know it).  No path of a request becomes a path of a file.

Other users can read the command lines of this one's programs, so the browser is not started with the token but with a
ticket that leads to the page once.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import cache
from importlib.resources import files
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from hybrid.live.session import Session
from hybrid.scene.network import Network
from hybrid.scene.read import LARGEST_SCENE
from hybrid.scene.schema import CableScene

# Bytes of a message: a scene, twice as long in JSON at worst, and what stands around it.
LARGEST_MESSAGE = 2 * LARGEST_SCENE + 65_536
MOST_BROWSERS = 32
NAMES = ("127.0.0.1", "localhost")
TYPES = {"html": "text/html", "js": "text/javascript", "css": "text/css", "txt": "text/plain"}
EDITOR = "codemirror.js", "yaml.js", "show-hint.js", "codemirror.css", "show-hint.css", "LICENSE.txt"
PAGE = ("live.css", "page.js", "editor.js", "space.js", "graphs.js", *(f"codemirror/{x}" for x in EDITOR))
# The page asks nothing of other hosts, and cannot be shown within another page.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
REPORT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}
HEADERS |= dict.fromkeys(("Cross-Origin-Opener-Policy", "Cross-Origin-Resource-Policy"), "same-origin")


class Guard:
    """Refuses what does not come from the page itself."""

    def __init__(self, app: ASGIApp, port: int, token: str) -> None:
        self.app, self.token = app, token
        self.ticket: str | None = secrets.token_urlsafe(24)  # None: it was used
        self.hosts = {f"{name}:{port}" for name in NAMES} | (set(NAMES) if port == 80 else set())
        self.origins = {f"http://{host}" for host in self.hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket") and not self._allowed(scope):
            if scope["type"] == "websocket":
                await receive()
                await send({"type": "websocket.close", "code": 1008})
            else:
                await PlainTextResponse("not for you\n", 403, headers=HEADERS)(scope, receive, send)
            return
        if self._has_ticket(scope):
            to = {"Location": f"/{self.token}/"}
            await Response(status_code=303, headers=HEADERS | to)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def _has_ticket(self, scope: Scope) -> bool:
        """Whether a request opens the page for the first time by the ticket, which is gone then."""
        path = scope.get("path", "").split("/")[1:]
        if scope["type"] != "http" or scope["method"] != "GET" or len(path) != 1 or self.ticket is None:
            return False
        if not secrets.compare_digest(path[0].encode(), self.ticket.encode()):
            return False
        self.ticket = None
        return True

    def _allowed(self, scope: Scope) -> bool:
        found: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            found.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
        host, origin = found.get("host", []), found.get("origin", [])
        if len(host) != 1 or host[0].lower() not in self.hosts or len(origin) > 1:
            return False
        if origin and origin[0].lower() not in self.origins:
            return False
        if scope["type"] == "websocket" and not origin:
            return False
        if found.get("sec-fetch-site", ["none"])[-1] not in ("none", "same-origin"):
            return False
        first = scope["path"].split("/")[1:2]
        known = [x.encode() for x in (self.token, self.ticket) if x is not None]
        return bool(first) and any(secrets.compare_digest(first[0].encode(), x) for x in known)


def make_app(session: Session, port: int, token: str) -> Guard:
    """The page of a session, for a server that listens at `port` of this machine."""

    async def page(_: Request) -> Response:
        return _asset("live.html", POLICY)

    async def asset(request: Request) -> Response:
        name = request.path_params["name"]
        return _asset(name, POLICY) if name in PAGE else PlainTextResponse("no such page\n", 404)

    async def schema(_: Request) -> Response:
        return JSONResponse(_schemas(), headers=HEADERS)

    async def report(request: Request) -> Response:
        of = request.query_params.get("of")
        made = await (session.modes() if of == "modes" else session.report(of == "motion"))
        if "html" in made:
            return HTMLResponse(made["html"], headers=HEADERS | {"Content-Security-Policy": REPORT_POLICY})
        return PlainTextResponse(made["refused"] + "\n", 409, headers=HEADERS)

    async def connected(websocket: WebSocket) -> None:
        await _serve(websocket, session)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        await session.start()
        try:
            yield
        finally:
            await session.stop()

    at = f"/{token}"
    routes: list[BaseRoute] = [Route(f"{at}/", page), Route(f"{at}/schema.json", schema), Route(f"{at}/report", report)]
    routes += [WebSocketRoute(f"{at}/live", connected), Route(at + "/{name:path}", asset)]
    return Guard(Starlette(routes=routes, lifespan=lifespan), port, token)


async def _serve(websocket: WebSocket, session: Session) -> None:
    """Exchange messages with one browser until it goes."""
    await websocket.accept()
    if session.browsers >= MOST_BROWSERS:
        await websocket.close(1013, f"at most {MOST_BROWSERS} pages at a time")
        return
    client = session.connect()

    async def send() -> None:
        while (message := await client.waiting.get()) is not None:
            await websocket.send_text(message)
        await websocket.close(1013, "too slow: come back")

    sending = asyncio.create_task(send())
    try:
        while True:
            received = await websocket.receive()
            if received["type"] != "websocket.receive":
                break
            await session.hear(client, received.get("text") or "")
    except (WebSocketDisconnect, RuntimeError):
        pass
    finally:
        session.leave(client)
        sending.cancel()
        with suppress(asyncio.CancelledError, Exception):
            await sending


def _asset(name: str, policy: str) -> Response:
    kind = TYPES[name.rsplit(".", 1)[1]]
    headers = HEADERS | {"Content-Security-Policy": policy}
    return Response(_content(name), media_type=f"{kind}; charset=utf-8", headers=headers)


@cache
def _content(name: str) -> bytes:
    """A file of the page; name: one that this module names."""
    return (files("hybrid.live") / "page").joinpath(*name.split("/")).read_bytes()


@cache
def _schemas() -> dict[str, object]:
    """The JSON schemas of the two forms of a scene, for completion and help."""
    return {"cable": CableScene.model_json_schema(), "lines": Network.model_json_schema()}


def listen(port: int = 0) -> socket.socket:
    """A socket at a port of this machine alone, a random one with 0."""
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    found.bind(("127.0.0.1", port))
    found.listen(100)  # a browser that is opened before the server runs waits, and is not refused
    return found


def make_server(session: Session, at: socket.socket) -> tuple[uvicorn.Server, str, str]:
    """A server for a socket of `listen`, the address to open, and one that opens it once, for a command line."""
    port, token = at.getsockname()[1], secrets.token_urlsafe(24)
    app = make_app(session, port, token)
    sockets: dict[str, Any] = {"ws": "websockets-sansio", "ws_max_size": LARGEST_MESSAGE, "ws_max_queue": 8}
    silent: dict[str, Any] = {"log_level": "critical"}
    silent |= dict.fromkeys(("access_log", "server_header", "proxy_headers", "date_header"), False)
    config = uvicorn.Config(app, timeout_graceful_shutdown=2, lifespan="on", **sockets, **silent)
    root = f"http://127.0.0.1:{port}/"
    return uvicorn.Server(config), f"{root}{token}/", f"{root}{app.ticket}"
