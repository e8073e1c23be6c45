"""The commands: hybrid run | resume | static | plan | view | plot | report | export | trade | import | schema.

The package imports what a command needs when it runs, so `hybrid --help` costs nothing.
Results and JSON go to the output stream; the progress line, notes and errors to the error stream.
"""

from __future__ import annotations

import json
import shlex
import sys
import time as clock
from copy import copy
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import hybrid
import hybrid.cli.result_commands
import hybrid.cli.statistics_commands
import hybrid.cli.study_commands  # registers its command
from hybrid.cli.app import (
    REFUSED,
    Drawn,
    Json,
    Keep,
    Quiet,
    RunFile,
    SceneFile,
    Settings,
    StaticFile,
    UsageError,
    app,
    flag,
    load,
    output_option,
    picture_beside,
    report_error,
    session,
    words,
)
from hybrid.cli.console import Console, counted, guard_output, raise_lost_output, span, speed

if TYPE_CHECKING:
    from hybrid.scene.root import Scene
    from hybrid.store.reader import Result


@app.command()
def run(
    scene: SceneFile, output: RunFile = None, settings: Settings = None,
    plot: Drawn = False, keep: Keep = False, quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
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
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to go on with.", show_default=False)],
    output: Annotated[Path | None, output_option("Another file; else the same.")] = None,
    until: Annotated[float | None, typer.Option(metavar="T", help="Go on until then (s).")] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Other currents, waves, motions, loads ..")
    ] = None,
    start: Annotated[
        float | None, typer.Option("--from", metavar="T", help=".. from then on (s); else from where it is.")
    ] = None,
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
    scene: SceneFile, output: StaticFile = None, settings: Settings = None,
    plot: Drawn = False, keep: Keep = False, quiet: Quiet = False, as_json: Json = False,
    stiffness: Annotated[
        str | None, typer.Option(metavar="WHAT", help="Stiffness at body:NAME or point:NAME (a cable: start, end).")
    ] = None,
    offsets: Annotated[
        str | None, typer.Option(metavar="WHAT", help="Forces on WHAT, as above, held beside its place ..")
    ] = None,
    reach: Annotated[float | None, typer.Option(metavar="M", help=".. up to so many metres to either side ..")] = None,
    heading: Annotated[float, typer.Option(metavar="DEG", help=".. along a heading from the x axis.")] = 0.0,
) -> None:  # fmt: skip
    """Find the equilibrium of a cable at t = 0 and write it to a file."""
    with session(as_json, quiet) as console:
        asked = load(console, scene, settings)
        from hybrid.cli.result_tables import check_holding, show_equilibrium, show_holding

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
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Else SCENE.trade, in this folder.")
    ] = None,
    models: Annotated[
        Any, typer.Option(metavar="KIND,..", parser=words, help="Else all that the scene admits.")
    ] = None,
    accuracies: Annotated[Any, typer.Option(metavar="A,A,..", parser=words, help="Else 10%,3%,1%,0.3%,0.1%.")] = None,
    reference: Annotated[
        str | None, typer.Option(metavar="A", help="Of the rod to compare with; else 0.03% or finer.")
    ] = None,
    target: Annotated[str, typer.Option("--for", metavar="A", help="Accuracy to recommend a setting for.")] = "1%",
    repeat: Annotated[int, typer.Option(metavar="N", help="Runs of which the median CPU time counts.")] = 1,
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
        with console.study() as listener:
            table = hybrid.trade(
                asked, folder, models=models, **chosen, reference=reference, target=target, repeat=repeat,
                progress=listener, command=shlex.join(["hybrid", *(context.obj or [])]),
            )  # fmt: skip
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
    deck: Annotated[Path, typer.Argument(metavar="DECK", help="A MoorDyn input file.", show_default=False)],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="SCENE.yaml|FOLDER", help="Else this folder.")
    ] = None,
    line: Annotated[int | None, typer.Option(metavar="ID", help="Only the cable with this line.")] = None,
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
    console: Console, asked: Scene, result: Result, target: Path, wall: float, computed: float, cold: bool,
    picture: Path | None,
) -> None:  # fmt: skip
    """Print the summary of a run that has ended; computed: s of it, by this command."""
    from hybrid.cli.result_tables import show_motion

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
