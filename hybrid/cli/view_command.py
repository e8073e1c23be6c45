"""hybrid view: a page on this machine that shows a scene while it is written, or plays a result."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hybrid.cli.app import Json, app, flag, session
from hybrid.errors import optional_package

if TYPE_CHECKING:
    from hybrid.cli.console import Console

NEEDED = ("starlette", "uvicorn", "websockets")


@app.command()
def view(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SCENE.yaml|RUN.h5]", help="A scene or a result; none: a new scene.", show_default=False
        ),
    ] = None,
    no_browser: Annotated[bool, flag("--no-browser", help="Print the address, and open no browser.")] = False,
    as_json: Json = False,
) -> None:
    """Show a scene while it is written, or play a result, in the browser of this machine; Ctrl-C ends it."""
    with session(as_json, False) as console:
        import asyncio

        console.source = str(file or "")
        with suppress(KeyboardInterrupt):  # the way to end it
            asyncio.run(_serve(file, console, no_browser))


async def _serve(file: Path | None, console: Console, no_browser: bool) -> None:
    """Serve until the end.  The process that makes pictures starts first, and reads its modules beside this one."""
    from hybrid.live.workers import Workers

    workers = Workers()
    await workers.start()
    try:
        for name in NEEDED:
            optional_package(name, "hybrid view", "view")
        from hybrid.live.server import listen, make_server
        from hybrid.live.session import session_of

        viewed = session_of(file, workers)
        at = listen()
        server, address, once = make_server(viewed, at)
        console.json("view", address=address, file=str(file) if file else None)
        console.show(lambda: f"{file or 'a new scene'}: {address}\nfor browsers of this machine alone; Ctrl-C ends it")
        if not no_browser:
            import webbrowser

            webbrowser.open(once)
        await server.serve(sockets=[at])
    finally:
        await workers.stop()
