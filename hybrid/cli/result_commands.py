"""Commands that read a result: plot, report, export; export makes FMUs of scenes as well."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import hybrid
from hybrid.cli.app import (
    Foreign,
    Json,
    LineName,
    Picture,
    Quiet,
    Settings,
    UsageError,
    app,
    flag,
    load,
    numbers,
    opened_line,
    output_option,
    session,
    window,
    words,
)
from hybrid.cli.console import Console
from hybrid.errors import ResultError, command_for, optional_package

if TYPE_CHECKING:
    from hybrid.modal.api import Modes
    from hybrid.store.reader import Result


@app.command()
def plot(
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to draw.", show_default=False)],
    output: Picture = None,
    times: Annotated[Any, typer.Option(metavar="T,T,..", parser=numbers, help="Earlier shapes to draw (s).")] = None,
    history: Annotated[
        Any, typer.Option(metavar="S,S,..", parser=numbers, help="Arc lengths to follow over time (m).")
    ] = None,
    zones: Annotated[bool, flag("--zones", help="Draw zones along s over time instead.")] = False,
    quantity: Annotated[
        str | None, typer.Option(metavar="NAME", help="One quantity instead; `hybrid plan --outputs` lists them.")
    ] = None,
    at: Annotated[
        Any, typer.Option(metavar="S,S,..", parser=numbers, help="Its histories at these arc lengths (m).")
    ] = None,
    envelope: Annotated[bool, flag("--envelope", help="Its lowest and highest value along the line.")] = False,
    spectrum: Annotated[bool, flag("--spectrum", help="The spectra of its histories.")] = False,
    film: Annotated[bool, flag("--animate", help="Make a film instead, RUN.mp4 or a .gif.")] = False,
    line: LineName = None,
    overwrite: Foreign = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Draw a result: shapes, profiles along the cable, histories; its zones over time; one quantity; or a film."""
    chosen = at is not None or envelope or spectrum
    if (quantity or chosen) and (zones or film or times or history):
        raise typer.BadParameter("--quantity, --at, --envelope and --spectrum are of a picture of their own")
    if (zones or film) and (times or history):
        raise typer.BadParameter("--times and --history choose what a page without --zones or --animate shows")
    if zones and film:
        raise typer.BadParameter("--zones and --animate are two pictures: ask for one at a time")
    with session(as_json, quiet) as console, opened_line(result, line) as (opened, result):
        from hybrid.view.figure import import_matplotlib, save_figure

        import_matplotlib()
        if film:
            _film(console, opened, result, output, overwrite)
            return
        if zones:
            picture = output or result.with_suffix(".zones.png")
            hybrid.plot_zones(opened, picture, overwrite=overwrite)
        elif quantity or chosen:
            quantity = quantity or "tension"
            picture = output or result.with_suffix(f".{quantity.replace('/', '_')}.png")
            ax = hybrid.plot_quantity(opened, quantity, at=at, envelope=envelope, spectrum=spectrum)
            figure = ax.get_figure(root=True)
            assert figure is not None
            save_figure(figure, picture, overwrite=overwrite)
        else:
            picture = output or result.with_suffix(".png")
            hybrid.plot(opened, picture, times=times, history=history, overwrite=overwrite)
        n = len(opened.times)
        over = f", t = {opened.times[0]:.6g} to {opened.times[-1]:.6g} s" if n > 1 else ""
        console.done(f"{n} output{'s' * (n != 1)}{over}", picture, status=opened.status)


@app.command()
def report(
    results: Annotated[
        list[Path],
        typer.Argument(metavar="RUN.h5 ..", help="Result; several to compare; or STUDY.zarr.", show_default=False),
    ],
    output: Annotated[Path | None, output_option("Page; else RUN.html, beside it.")] = None,
    line: LineName = None,
    modes: Annotated[
        int, typer.Option(metavar="N", min=0, max=200, help="Show so many natural modes of the scene, too.")
    ] = 0,
    overwrite: Foreign = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write one HTML file that explains a result, lays several over each other, or shows a study."""
    result = results[0]
    if len(results) > 1:
        _comparison(results, output, line, overwrite, session(as_json, quiet))
        return
    if result.is_dir():
        with session(as_json, quiet) as console:
            from hybrid.view.study_report import write_study_report

            beside = result.resolve().with_suffix(".html") if result.name in ("", "..") else result.with_suffix(".html")
            page = write_study_report(result, output or beside, overwrite=overwrite)
            console.done(f"{page.stat().st_size / 1e6:.1f} MB", page, size=page.stat().st_size)
        return
    with session(as_json, quiet) as console, opened_line(result, line) as (opened, result):
        from hybrid.view.summary import facts_of

        swings = _modes_of(opened, modes) if modes else None
        page = hybrid.report(opened, output or result.with_suffix(".html"), overwrite=overwrite, modes=swings)
        size, found = page.stat().st_size, dict[str, Any]()
        if as_json:
            found["facts"] = [fact._asdict() for fact in facts_of(opened)]
        if as_json and opened.lines:  # each line by its name: the facts that one cable has
            found["lines"] = {name: [fact._asdict() for fact in facts_of(x)] for name, x in opened.lines.items()}
        console.done(f"{size / 1e6:.1f} MB", page, status=opened.status, size=size, **found)


def _modes_of(result: Result, count: int) -> Modes:
    """Natural modes of the scene of a result."""
    from hybrid.scene.read import read_text

    return hybrid.modes(read_text(result.scene_text)[0], count)


def _comparison(
    files: list[Path], output: Path | None, line: str | None, overwrite: bool, session: AbstractContextManager[Console]
) -> None:
    """A page of several results, by the names of their files where these differ."""
    with session as console, ExitStack() as stack:
        names = [file.stem for file in files]
        names = [str(file) for file in files] if len(set(names)) < len(names) else names
        if len(set(names)) < len(names):
            raise ResultError(f"{', '.join(map(str, files))}: a result is compared with itself")
        opened = [stack.enter_context(opened_line(file, line))[0] for file in files]
        target = output or files[0].with_name("_".join(file.stem for file in files) + ".html")
        page = hybrid.compare(dict(zip(names, opened, strict=True)), target, overwrite=overwrite)
        console.done(f"{page.stat().st_size / 1e6:.1f} MB", page, size=page.stat().st_size)


@app.command()
def export(
    result: Annotated[
        Path, typer.Argument(metavar="RUN.h5", help="The result to export, or the scene of an FMU.", show_default=False)
    ],
    output: Annotated[Path | None, output_option("FILE.nc, .csv, .vtkhdf, .fmu; else RUN.nc ..")] = None,
    format: Annotated[
        str | None, typer.Option(metavar="FORMAT", help="nc, csv, vtkhdf, fatigue or fmu; else by the name of FILE.")
    ] = None,
    at: Annotated[Any, typer.Option(metavar="S,S,..", parser=numbers, help="Only at these arc lengths (m).")] = None,
    names: Annotated[Any, typer.Option(metavar="NAME,..", parser=words, help="Only these fields or groups.")] = None,
    times: Annotated[Any, typer.Option(metavar="A:B", parser=window, help="Only from A to B (s).")] = None,
    line: LineName = None,
    moordyn: Annotated[bool, flag("--moordyn", help="The scene of the result as a MoorDyn deck, RUN.txt.")] = False,
    settings: Settings = None,
    keep: Annotated[bool, flag("--no-overwrite", help="Refuse to replace an older export.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write a result for xarray, spreadsheets, ParaView, fatigue; its scene for MoorDyn; or a scene as an FMU."""
    if moordyn:
        given = {"--format": format, "--at": at, "--names": names, "--times": times, "--line": line, "--set": settings}
        if unfit := [name for name, value in given.items() if value]:
            raise UsageError(f"{', '.join(unfit)}: of other exports; --moordyn writes the scene of a result")
        _deck(result, output or result.with_suffix(".txt"), keep, quiet, as_json)
        return
    if "fmu" in (format, (output or Path()).suffix.removeprefix(".").lower()):
        given = {"--at": at, "--names": names, "--times": times, "--line": line}
        if unfit := [name for name, value in given.items() if value is not None]:
            raise UsageError(f"{', '.join(unfit)}: of a result, not of an FMU")
        with session(as_json, quiet) as console:
            scene, unit = load(console, result, settings), output or result.with_suffix(".fmu")
            console.done("co-simulation unit, FMI 3.0", hybrid.export_fmu(scene, unit, overwrite=not keep))
        return
    if settings:
        raise UsageError("--set: changes a scene, and a result has been computed; for an FMU give -o NAME.fmu")
    from hybrid.exports.api import SUFFIXES, files_of, format_of

    with session(as_json, quiet) as console:
        kind, all_made = format_of(output, format), []
        with opened_line(result, line) as (opened, result):
            for file in files_of(opened, output or result.with_suffix(SUFFIXES[kind]), kind, names):
                places, name = at if file.has_places else None, f"{file.line}: " if file.line else ""
                made = hybrid.export(
                    file.result, file.path, format=format, names=file.names, times=times, at=places, overwrite=not keep
                )
                all_made.append(made)
                for text in made.notes:
                    console.json("note", text=text, line=file.line)
                    console.note(f"note: {name}{text}")
            status = "" if opened.done else f"; {opened.status_text}"
            files, notes = [x for made in all_made for x in made.files], [x for made in all_made for x in made.notes]
            console.done(all_made[0].text + status, *files, status=opened.status, notes=notes)


def _deck(source: Path, target: Path, keep: bool, quiet: bool, as_json: bool) -> None:
    """Write the scene of a result as a MoorDyn deck."""
    with session(as_json, quiet) as console, hybrid.open(source) as opened:
        made = hybrid.export_moordyn(opened, target, overwrite=not keep)
        for text in made.notes:
            console.json("note", text=text)
            console.note(f"note: {text}")
        console.done("MoorDyn deck", target, notes=list(made.notes))


def _film(console: Console, result: Result, source: Path, output: Path | None, overwrite: bool) -> None:
    """Make a film, as mp4 where this machine can."""
    from hybrid.view.animation import animate, ffmpeg

    suffix = ".mp4" if output or ffmpeg() else ".gif"
    if suffix == ".gif":
        console.note(f"note: there is no ffmpeg for mp4, so it is a gif; {command_for('video')} brings one")
    film = animate(result, output or source.with_suffix(suffix), overwrite=overwrite)
    size = film.path.stat().st_size
    facts = {"status": result.status, "size": size} | {k: v for k, v in film._asdict().items() if k != "path"}
    console.done(f"{film.text}, {size / 1e6:.1f} MB", film.path, **facts)


# hybrid view: a page on this machine that shows a scene while it is written, or plays a result.

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
