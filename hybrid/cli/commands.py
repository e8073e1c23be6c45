"""The commands: hybrid plot | report | export | view | run | resume | static | plan | trade | import | schema.

Others stand in statistics_commands.py and study_commands.py.
The package imports what a command needs when it runs, so `hybrid --help` costs nothing.
Results and JSON go to the output stream; the progress line, notes and errors to the error stream.
"""

from __future__ import annotations

import json
import shlex
import sys
import time as clock
from contextlib import AbstractContextManager, ExitStack, suppress
from copy import copy
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import hybrid
import hybrid.cli.statistics_commands
import hybrid.cli.study_commands  # registers its command
from hybrid.cli.app import (
    REFUSED,
    Drawn,
    Foreign,
    Json,
    Keep,
    LineName,
    Picture,
    Quiet,
    RunFile,
    SceneFile,
    Settings,
    StaticFile,
    UsageError,
    app,
    argument,
    flag,
    load,
    numbers,
    opened_line,
    option,
    output_option,
    picture_beside,
    report_error,
    session,
    window,
    words,
)
from hybrid.cli.console import Console, counted, guard_output, raise_lost_output, span, speed
from hybrid.errors import ResultError, command_for, optional_package

if TYPE_CHECKING:
    from hybrid.modal.api import Modes
    from hybrid.scene.root import Scene
    from hybrid.store.reader import Result


# --- commands that read a result; export makes FMUs of scenes as well --------------------------


@app.command()
def plot(
    result: Annotated[Path, argument("RUN.h5", "The result to draw.")],
    output: Picture = None,
    times: Annotated[Any, option("T,T,..", "Earlier shapes to draw (s).", parser=numbers)] = None,
    history: Annotated[Any, option("S,S,..", "Arc lengths to follow over time (m).", parser=numbers)] = None,
    zones: Annotated[bool, flag("--zones", help="Draw zones along s over time instead.")] = False,
    quantity: Annotated[str | None, option("NAME", "One quantity instead; `hybrid plan --outputs` lists them.")] = None,
    at: Annotated[Any, option("S,S,..", "Its histories at these arc lengths (m).", parser=numbers)] = None,
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
    results: Annotated[list[Path], argument("RUN.h5 ..", "Result; several to compare; or STUDY.zarr.")],
    output: Annotated[Path | None, output_option("Page; else RUN.html, beside it.")] = None,
    line: LineName = None,
    modes: Annotated[int, option("N", "Show so many natural modes of the scene, too.", min=0, max=200)] = 0,
    overwrite: Foreign = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write one HTML file that explains a result, lays several over each other, or shows a study."""
    result = results[0]
    if modes and (len(results) > 1 or result.is_dir()):
        raise UsageError("--modes: of the page of one result")
    if line is not None and result.is_dir():
        raise UsageError("--line: of a result, not of a study")
    if len(results) > 1:
        _comparison(results, output, line, overwrite, session(as_json, quiet))
        return
    if result.is_dir():
        with session(as_json, quiet) as console:
            from hybrid.view.several_runs import write_study_report

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
    result: Annotated[Path, argument("RUN.h5", "The result to export, or the scene of an FMU.")],
    output: Annotated[Path | None, output_option("FILE.nc, .csv, .vtkhdf, .fmu; else RUN.nc ..")] = None,
    format: Annotated[
        str | None, option("FORMAT", "nc, csv, vtkhdf, fatigue or fmu; else by the name of FILE.")
    ] = None,
    at: Annotated[Any, option("S,S,..", "Only at these arc lengths (m).", parser=numbers)] = None,
    names: Annotated[Any, option("NAME,..", "Only these fields or groups.", parser=words)] = None,
    times: Annotated[Any, option("A:B", "Only from A to B (s).", parser=window)] = None,
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
    if (format or (output or Path()).suffix.removeprefix(".").lower()) == "fmu":
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
                places, name = (
                    None if file.result.lines and not file.line else at,
                    f"{file.line}: " if file.line else "",
                )
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
    from hybrid.view.matplotlib_backend import animate, ffmpeg

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
    file: Annotated[Path | None, argument("[SCENE.yaml|RUN.h5]", "A scene or a result; none: a new scene.")] = None,
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


# --- commands that read a scene, and the program -----------------------------------------------


@app.command()
def run(
    scene: SceneFile,
    output: RunFile = None,
    settings: Settings = None,
    plot: Drawn = False,
    keep: Keep = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Compute the motion of a cable and write it to a file."""
    with session(as_json, quiet) as console:
        asked = load(console, scene, settings)
        duration = asked.require_time().duration
        target = console.will_write(output or Path(f"{scene.stem}.h5"))
        picture = picture_beside(target, plot)
        cold = console.compiling(asked)
        begin = clock.perf_counter()
        with console.progress() as show:
            result = hybrid.run(asked, target, progress=show, overwrite=not keep)
        _ended(console, asked, result, target, clock.perf_counter() - begin, duration, cold, picture)


@app.command()
def resume(
    result: Annotated[Path, argument("RUN.h5", "The result to go on with.")],
    output: Annotated[Path | None, output_option("Another file; else the same.")] = None,
    until: Annotated[float | None, option("T", "Go on until then (s).")] = None,
    settings: Annotated[
        list[str] | None, option("KEY=VALUE", "Other currents, waves, motions, loads ..", "--set")
    ] = None,
    start: Annotated[float | None, option("T", ".. from then on (s); else from where it is.", "--from")] = None,
    plot: Drawn = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Go on with a run that was stopped, beyond its end, or with other loads."""
    with session(as_json, quiet) as console:
        from hybrid.simulation.restart import remaining

        console.source = str(result)
        target, changed = console.will_write(output or result), settings or []
        picture = picture_beside(target, plot)
        left = remaining(result.resolve(), until, changed, start)
        cold = console.compiling(left.scene)
        begin = clock.perf_counter()
        with console.progress() as show:
            more = hybrid.resume(result, output, until=until, settings=changed, start=start, progress=show)
        computed = left.scene.require_time().duration - left.reached
        _ended(console, left.scene, more, target, clock.perf_counter() - begin, computed, cold, picture)


@app.command()
def static(
    scene: SceneFile,
    output: StaticFile = None,
    settings: Settings = None,
    plot: Drawn = False,
    keep: Keep = False,
    quiet: Quiet = False,
    as_json: Json = False,
    stiffness: Annotated[
        str | None, option("WHAT", "Stiffness at body:NAME or point:NAME (a cable: start, end).")
    ] = None,
    offsets: Annotated[str | None, option("WHAT", "Forces on WHAT, as above, held beside its place ..")] = None,
    reach: Annotated[float | None, option("M", ".. up to so many metres to either side ..")] = None,
    heading: Annotated[float, option("DEG", ".. along a heading from the x axis.")] = 0.0,
) -> None:
    """Find the equilibrium of a cable at t = 0 and write it to a file."""
    with session(as_json, quiet) as console:
        asked = load(console, scene, settings)
        from hybrid.cli.tables import check_holding, show_equilibrium, show_holding

        check_holding(asked, stiffness, offsets, reach, heading)
        target = console.will_write(output or Path(f"{scene.stem}.static.h5"))
        picture = picture_beside(target, plot)
        console.compiling(asked, static=True)
        begin = clock.perf_counter()
        result = hybrid.static(asked, target, overwrite=not keep)
        wall = clock.perf_counter() - begin
        _draw(result, picture)
        facts = show_equilibrium(console, result)
        text = f"equilibrium in {span(wall)} of wall time"
        console.done(text, target, picture, status=result.status, wall=wall, **facts)
        show_holding(console, asked, stiffness, offsets, reach, heading)


@app.command()
def plan(
    scene: SceneFile,
    settings: Settings = None,
    verbose: Annotated[bool, flag("--verbose", "-v", help="All that is on and off, and why.")] = False,
    outputs: Annotated[
        bool, flag("--outputs", help="Instead: what the result will hold, and what it may, with units.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Show what a run would compute, by which keys of the scene, and how long it takes: first steps are computed."""
    if verbose and outputs:
        raise UsageError("--verbose: of the plan; --outputs shows all that it has")
    with session(as_json, False) as console:
        from hybrid.cli.plan_tables import contents_tables, outputs_table, plan_facts, plan_rows

        asked = load(console, scene, settings)
        if outputs:
            found, more = hybrid.listed_outputs(asked), hybrid.kinds_of_quantities()
            console.json("outputs", recorded=[x._asdict() for x in found], on_request=[x._asdict() for x in more])
            console.show(lambda: outputs_table(found, more))
            return
        made = hybrid.plan(asked)
        console.json("plan", **plan_facts(made))
        console.show(lambda: "\n".join(plan_rows(asked, made)))
        if verbose:
            for content in contents_tables(made):
                console.show(content)


@app.command()
def trade(
    context: typer.Context,
    scene: SceneFile,
    output: Annotated[Path | None, output_option("Else SCENE.trade, in this folder.", "FOLDER")] = None,
    models: Annotated[Any, option("KIND,..", "Else all that the scene admits.", parser=words)] = None,
    accuracies: Annotated[Any, option("A,A,..", "Else 10%,3%,1%,0.3%,0.1%.", parser=words)] = None,
    reference: Annotated[str | None, option("A", "Of the rod to compare with; else 0.03% or finer.")] = None,
    target: Annotated[str, option("A", "Accuracy to recommend a setting for.", "--for")] = "1%",
    repeat: Annotated[int, option("N", "Runs of which the median CPU time counts.")] = 1,
    peers: Annotated[bool, typer.Option("--peers", hidden=True)] = False,
    levels: Annotated[
        bool, flag("--levels", help="Instead: what position and tension, moments, curvature cost with every model.")
    ] = False,
    settings: Settings = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Compare models and accuracies on a scene: error against CPU time; recommend one."""
    if peers:
        from hybrid.studies.tradeoff import PEERS_ARE

        raise UsageError(f"--peers: {PEERS_ARE}")
    given = {"--models": models, "--accuracies": accuracies, "--reference": reference, "--for": target != "1%" or None}
    if levels and (unfit := [name for name, value in given.items() if value is not None]):
        raise UsageError(f"{', '.join(unfit)}: --levels has models, accuracies and a reference of its own")
    with session(as_json, quiet) as console:
        from hybrid.cli.tables import judged, trade_table

        asked = load(console, scene, settings)
        folder = output or Path(scene.with_suffix(".trade").name)
        console.left = f"{folder} keeps the runs that are done; the same command makes the others"
        console.note(f"runs and tables go to the folder {folder}")
        console.compiling(asked)
        if levels:
            _trade_levels(console, asked, folder, repeat, shlex.join(["hybrid", *(context.obj or [])]))
            return
        chosen = {"accuracies": accuracies} if accuracies else {}
        command = shlex.join(["hybrid", *(context.obj or [])])
        how: dict[str, Any] = {"models": models, "reference": reference, "target": target, "repeat": repeat} | chosen
        with console.study() as listener:
            table = hybrid.trade(asked, folder, **how, progress=listener, command=command)
        for row in table.rows:
            console.json("row", **(asdict(row) | judged(table, row)))
        console.show(lambda: trade_table(table))
        console.show(lambda: table.recommendation)
        best = table.recommended
        facts = {"recommended": best.name if best else None, "cpu": best.cpu if best else None, "runs": len(table.rows)}
        files = [folder / name for name in ("trade.md", "trade.csv", "trade.png")]
        console.done(f"{len(table.rows)} runs", *files, **facts)


def _trade_levels(console: Any, scene: Any, folder: Path, repeat: int, command: str) -> None:
    """The three levels of studies.tradeoff, as a table and a sentence for each."""
    from hybrid.cli.tables import level_table

    with console.study() as listener:
        table = hybrid.trade_levels(scene, folder, repeat=repeat, progress=listener, command=command)
    for row in table.rows:
        console.json("row", **asdict(row))
    console.show(lambda: level_table(table))
    console.show(lambda: "\n".join(table.sentences()))
    console.done(f"{len(table.rows)} runs", *(folder / name for name in ("levels.md", "levels.csv")))


@app.command("import")
def import_(
    deck: Annotated[Path, argument("DECK", "A MoorDyn input file.")],
    output: Annotated[Path | None, output_option("Else this folder.", "SCENE.yaml|FOLDER")] = None,
    line: Annotated[int | None, option("ID", "Only the cable with this line.")] = None,
    separate: Annotated[bool, flag("--separate", help="Each cable as a scene of its own.")] = False,
    overwrite: Annotated[bool, flag("--overwrite", help="Replace scenes that are there.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make a scene of a MoorDyn deck, or one for each cable, and say what could not be carried over."""
    with session(as_json, quiet) as console:
        from hybrid.cli.tables import import_notes

        console.source = str(deck)
        made = hybrid.import_moordyn(deck, line, separate)
        files = made.write(output or Path(), overwrite)
        notes = [("", note) for note in made.notes]
        notes += [(name, note) for name, scene in made.scenes.items() for note in scene.notes]
        for name, note in notes:
            console.json("note", scene=name, **asdict(note))
        for text in import_notes(made):
            console.note(text)
        lost = sum(note.kind == "left out" for _, note in notes)
        console.done(f"{counted(len(files), 'scene')}, {lost} left out", *files, left_out=lost, notes=len(notes))


@app.command()
def schema(lines: Annotated[bool, flag("--lines", help="Of scenes with points and lines alone.")] = False) -> None:
    """Print the JSON schema of a scene, for editors."""
    from hybrid.scene.network import Network
    from hybrid.scene.root import Scene

    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    print(json.dumps(dialect | (Network if lines else Scene).model_json_schema(), indent=2))


def _ended(
    console: Console,
    asked: Scene,
    result: Result,
    target: Path,
    wall: float,
    computed: float,
    cold: bool,
    picture: Path | None,
) -> None:
    """Print the summary of a run that has ended; computed: s of it, by this command."""
    from hybrid.cli.tables import show_motion

    _draw(result, picture)
    logged = next(x for _, x in result.each_line())
    steps = len(logged["steps/t"]) if "steps/t" in logged else 0
    pace = "compilation included" if cold else f"computing alone, {speed(computed / wall)} x real time"
    duration = asked.require_time().duration
    text = f"{duration:.6g} s in {steps} steps, {span(wall)} of wall time ({pace})"
    if computed < duration:
        text = f"{duration:.6g} s in {steps} steps, the last {computed:.6g} s in {span(wall)} of wall time ({pace})"
    more, facts = show_motion(console, asked, result, target)
    console.done(text + more, target, picture, status=result.status, t=duration, steps=steps, wall=wall, **facts)


def _draw(result: Result, picture: Path | None) -> None:
    """Draw a result; picture: where to, None: nowhere."""
    if picture is not None:
        from hybrid.view.figure import import_matplotlib

        import_matplotlib()
        hybrid.plot(result, picture)


def _with_command(arguments: list[str]) -> typer.Typer:
    """The program with the command that is called alone: typer takes 40 ms to make all of them, for a list of them."""
    called = [x for x in app.registered_commands if arguments[:1] == [x.name or (x.callback and x.callback.__name__)]]
    if not called:
        return app
    alone = copy(app)
    alone.registered_commands = called
    return alone


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with its exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    guard_output()
    try:
        program = typer.main.get_command(_with_command(arguments))
        code = program.main(arguments, prog_name="hybrid", standalone_mode=False, obj=arguments)
        raise_lost_output()
    except UsageError as error:
        command = error.ctx.command_path if error.ctx else "hybrid"
        Console("--json" in arguments, False).error(
            "usage", f"{error.format_message()}\n    try:      {command} --help"
        )
        code = REFUSED
    except OSError as error:
        code = report_error(Console("--json" in arguments, False), error)
    sys.exit(code)
