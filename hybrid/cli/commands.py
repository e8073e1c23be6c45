"""The command line: hybrid run | resume | static | plan | plot | report | export | trade | import | schema.

The package imports what a command needs when it runs, so `hybrid --help` costs nothing.
Results and JSON go to the output stream; the live line, notes and errors to the error stream.
"""

from __future__ import annotations

import json
import os
import shlex
import signal
import sys
import threading
import time as clock
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import hybrid
from hybrid.cli.tables import (
    equilibrium_facts,
    equilibrium_table,
    errors_facts,
    errors_table,
    import_said,
    judged,
    plan_table,
    trade_table,
    zones_over_time,
    zones_said,
)

if TYPE_CHECKING:
    from hybrid.cli.console import Voice
    from hybrid.scene.schema import Scene
    from hybrid.store.reader import Result

REFUSED, FAILED, INTERRUPTED = 1, 2, 130

app = typer.Typer(
    help="Dynamics of long cables: flexible catenaries where they are taut, rods where they bend.",
    epilog="Exit codes: 0 done, 1 input refused, 2 computation failed, 130 interrupted.",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
UsageError: Any = typer.BadParameter.__mro__[1]  # typer has no public name for it


def _numbers(text: str) -> list[float]:
    try:
        return [float(x) for x in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"'{text}' is no list of numbers such as 0,1.5,2") from None


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def _window(text: str) -> tuple[float | None, float | None]:
    first, colon, last = text.partition(":")
    try:
        window = (float(first) if first.strip() else None, float(last) if last.strip() else None)
    except ValueError:
        colon = ""
    if not colon:
        raise typer.BadParameter(f"'{text}' is no window of time such as 20:60, 20: or :60")
    return window


def _flag(*names: str, help: str) -> Any:
    return typer.Option(*names, metavar="", help=help)  # it takes no value, so none is named


def _output(help: str) -> Any:
    return typer.Option("--output", "-o", metavar="FILE", help=help)


SceneFile = Annotated[Path, typer.Argument(metavar="SCENE.yaml", help="The scene to read.", show_default=False)]
RunFile = Annotated[Path | None, _output("Result; else SCENE.h5, in this folder.")]
StaticFile = Annotated[Path | None, _output("Result; else SCENE.static.h5, here.")]
Picture = Annotated[Path | None, _output("PNG, PDF or SVG; else RUN.png, RUN.zones.png.")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a value, as in time.step=0.005.")
]
Drawn = Annotated[bool, _flag("--plot", help="Draw it as well, as PNG beside it.")]
Keep = Annotated[bool, _flag("--no-overwrite", help="Refuse to replace an older result.")]
Foreign = Annotated[bool, _flag("--overwrite", help="Replace a file that is not of hybrid.")]
Quiet = Annotated[bool, _flag("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, _flag("--json", help="Print JSON, one object per line.")]


@app.callback(invoke_without_command=True)
def hybrid_(
    context: typer.Context, version: Annotated[bool, _flag("--version", help="Print the version.")] = False
) -> None:
    if version:
        print(f"hybrid {hybrid.__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def run(
    scene: SceneFile, output: RunFile = None, settings: Settings = None,
    plot: Drawn = False, keep: Keep = False, quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Compute the motion of a cable and write it to a file."""
    with _speaking(as_json, quiet) as say:
        asked = _load(say, scene, settings)
        duration = asked.require_time().duration
        target = say.will_write(output or Path(f"{scene.stem}.h5"))
        picture = _picture(target, plot)
        cold = say.compiling(_kernels(asked))
        begin = clock.perf_counter()
        with say.progress() as tell:
            result = hybrid.run(asked, target, progress=tell, overwrite=not keep)
        _ended(say, asked, result, target, clock.perf_counter() - begin, duration, cold, picture)


@app.command()
def resume(
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to go on with.", show_default=False)],
    output: Annotated[Path | None, _output("Another file; else the same.")] = None,
    until: Annotated[float | None, typer.Option(metavar="T", help="Go on until then (s).")] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Other currents, waves, motions, loads ..")
    ] = None,
    start: Annotated[
        float | None, typer.Option("--from", metavar="T", help=".. from then on (s); else from where it is.")
    ] = None,
    plot: Drawn = False, quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Go on with a run that was stopped, beyond its end, or with other loads."""
    with _speaking(as_json, quiet) as say:
        from hybrid.simulation.restart import remainder

        say.source = str(result)
        target, changed = say.will_write(output or result), settings or []
        picture = _picture(target, plot)
        left = remainder(result.resolve(), until, changed, start)
        cold = say.compiling(_kernels(left.scene))
        begin = clock.perf_counter()
        with say.progress() as tell:
            more = hybrid.resume(result, output, until=until, settings=changed, start=start, progress=tell)
        computed = left.scene.require_time().duration - left.reached
        _ended(say, left.scene, more, target, clock.perf_counter() - begin, computed, cold, picture)


@app.command()
def static(
    scene: SceneFile, output: StaticFile = None, settings: Settings = None,
    plot: Drawn = False, keep: Keep = False, quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Find the equilibrium of a cable at t = 0 and write it to a file."""
    with _speaking(as_json, quiet) as say:
        asked = _load(say, scene, settings)
        target = say.will_write(output or Path(f"{scene.stem}.static.h5"))
        picture = _picture(target, plot)
        say.compiling(["newton.newton"])
        from hybrid.cli.console import span

        begin = clock.perf_counter()
        result = hybrid.static(asked, target, overwrite=not keep)
        wall = clock.perf_counter() - begin
        if picture:
            hybrid.plot(result, picture)
        facts = equilibrium_facts(result)
        errors = errors_facts(result)
        say.show(lambda: equilibrium_table(facts))
        if errors:
            say.show(lambda: errors_table(errors, result))
        facts |= {"errors": errors}
        say.events(result.events)
        say.done(f"equilibrium in {span(wall)} of wall time", target, picture, status=result.status, wall=wall, **facts)


@app.command()
def plan(scene: SceneFile, settings: Settings = None, as_json: Json = False) -> None:
    """Say what a run would compute and who asked for it; compute nothing."""
    with _speaking(as_json, False) as say:
        asked = _load(say, scene, settings)

        made = hybrid.plan(asked)
        zones = [asdict(zone) | {"cells": n} for zone, n in zip(made.zones, made.cells, strict=True)]
        say.json("plan", **(asdict(made) | {"zones": zones, "cells": sum(made.cells)}))
        say.show(lambda: plan_table(asked, made))


@app.command()
def plot(
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to draw.", show_default=False)],
    output: Picture = None,
    times: Annotated[Any, typer.Option(metavar="T,T,..", parser=_numbers, help="Earlier shapes to draw (s).")] = None,
    history: Annotated[
        Any, typer.Option(metavar="S,S,..", parser=_numbers, help="Arc lengths to follow over time (m).")
    ] = None,
    zones: Annotated[bool, _flag("--zones", help="Draw zones along s over time instead.")] = False,
    film: Annotated[bool, _flag("--animate", help="Make a film instead, RUN.mp4 or a .gif.")] = False,
    overwrite: Foreign = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Draw a result: shapes, profiles along the cable, histories; its zones over time; or a film."""
    if (zones or film) and (times or history):
        raise typer.BadParameter("--times and --history choose what a page without --zones or --animate shows")
    if zones and film:
        raise typer.BadParameter("--zones and --animate are two pictures: ask for one at a time")
    with _speaking(as_json, quiet) as say, hybrid.open(result) as opened:
        if film:
            _film(say, opened, result, output, overwrite)
            return
        if zones:
            picture = output or result.with_suffix(".zones.png")
            hybrid.plot_zones(opened, picture, overwrite=overwrite)
        else:
            picture = output or result.with_suffix(".png")
            hybrid.plot(opened, picture, times=times, history=history, overwrite=overwrite)
        n = len(opened.times)
        over = f", t = {opened.times[0]:.6g} to {opened.times[-1]:.6g} s" if n > 1 else ""
        say.done(f"{n} output{'s' * (n != 1)}{over}", picture, status=opened.status)


@app.command()
def report(
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to report.", show_default=False)],
    output: Annotated[Path | None, _output("Page; else RUN.html, beside it.")] = None,
    overwrite: Foreign = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write one HTML file that explains a result: what to know first, moving pictures, events, energy, the scene."""
    with _speaking(as_json, quiet) as say, hybrid.open(result) as opened:
        from hybrid.view.summary import facts_of

        page = hybrid.report(opened, output or result.with_suffix(".html"), overwrite=overwrite)
        size, facts = page.stat().st_size, [fact._asdict() for fact in facts_of(opened)] if as_json else []
        say.done(f"{size / 1e6:.1f} MB", page, status=opened.status, size=size, facts=facts)


@app.command()
def export(
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to export.", show_default=False)],
    output: Annotated[Path | None, _output("FILE.nc, .csv or .vtkhdf; else RUN.nc ..")] = None,
    format: Annotated[
        str | None, typer.Option(metavar="FORMAT", help="nc, csv, vtkhdf or fatigue; else what FILE says.")
    ] = None,
    at: Annotated[Any, typer.Option(metavar="S,S,..", parser=_numbers, help="Only at these arc lengths (m).")] = None,
    names: Annotated[Any, typer.Option(metavar="NAME,..", parser=_words, help="Only these fields or groups.")] = None,
    times: Annotated[Any, typer.Option(metavar="A:B", parser=_window, help="Only from A to B (s).")] = None,
    keep: Annotated[bool, _flag("--no-overwrite", help="Refuse to replace an older export.")] = False,
    quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Write a result for xarray, spreadsheets, ParaView, or as cycles for fatigue."""
    from hybrid.exports.api import beside

    with _speaking(as_json, quiet) as say, hybrid.open(result) as opened:
        target = output or beside(result, format)
        made = hybrid.export(opened, target, format=format, names=names, times=times, at=at, overwrite=not keep)
        for text in made.notes:
            say.json("note", text=text)
            say.note(f"note: {text}")
        status = "" if opened.status == "complete" else f"; {opened.status_text}"
        say.done(made.text + status, *made.files, status=opened.status, notes=list(made.notes))


@app.command()
def trade(
    context: typer.Context, scene: SceneFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Else SCENE.trade, beside it.")
    ] = None,
    models: Annotated[
        Any, typer.Option(metavar="KIND,..", parser=_words, help="Else all that the scene admits.")
    ] = None,
    accuracies: Annotated[
        Any, typer.Option(metavar="A,A,..", parser=_words, help="Else 10%,3%,1%,0.3%,0.1%.")
    ] = None,
    reference: Annotated[
        str | None, typer.Option(metavar="A", help="Of the rod to compare with; else 0.03% or finer.")
    ] = None,
    asked_for: Annotated[str, typer.Option("--for", metavar="A", help="Accuracy to recommend a setting for.")] = "1%",
    repeat: Annotated[int, typer.Option(metavar="N", help="Runs of which the median CPU time counts.")] = 1,
    peers: Annotated[bool, _flag("--peers", help="Other programs as well, if installed.")] = False,
    settings: Settings = None, quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Compare models and accuracies on a scene: error against CPU time; say which to take."""
    with _speaking(as_json, quiet) as say:
        asked = _load(say, scene, settings)
        folder = output or scene.with_suffix(".trade")
        say.left = f"{folder} keeps the runs that are done; the same command makes the others"
        say.compiling()
        chosen = {"accuracies": accuracies} if accuracies else {}
        with say.ladder() as told:
            table = hybrid.trade(
                asked, folder, models=models, **chosen, reference=reference, asked_for=asked_for, repeat=repeat,
                peers=peers, told=told, command=shlex.join(["hybrid", *(context.obj or [])]),
            )  # fmt: skip
        for row in table.rows:
            say.json("row", **(asdict(row) | judged(table, row)))
        say.show(lambda: trade_table(table))
        say.show(lambda: table.recommendation)
        best = table.recommended
        facts = {"recommended": best.name if best else None, "cpu": best.cpu if best else None, "runs": len(table.rows)}
        files = [folder / name for name in ("trade.md", "trade.csv", "trade.png")]
        say.done(f"{len(table.rows)} runs", *files, **facts)


@app.command("import")
def import_(
    deck: Annotated[Path, typer.Argument(metavar="DECK", help="A MoorDyn input file.", show_default=False)],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="SCENE.yaml|FOLDER", help="Else this folder.")
    ] = None,
    line: Annotated[int | None, typer.Option(metavar="ID", help="Only the cable with this line.")] = None,
    overwrite: Annotated[bool, _flag("--overwrite", help="Replace scenes that are there.")] = False,
    quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Make scenes of a MoorDyn deck, one for each cable, and say what could not be carried over."""
    with _speaking(as_json, quiet) as say:
        say.source = str(deck)
        made = hybrid.import_moordyn(deck, line)
        files = made.write(output or Path(), overwrite)
        notes = [("", note) for note in made.notes]
        notes += [(name, note) for name, scene in made.scenes.items() for note in scene.notes]
        for name, note in notes:
            say.json("note", scene=name, **asdict(note))
        for text in import_said(made):
            say.note(text)
        lost = sum(note.kind == "left out" for _, note in notes)
        say.done(f"{_count(len(files), 'scene')}, {lost} left out", *files, left_out=lost, notes=len(notes))


@app.command()
def schema() -> None:
    """Print the JSON schema of a scene, for editors."""
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    print(json.dumps(dialect | hybrid.Scene.model_json_schema(), indent=2))


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with its exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        code = typer.main.get_command(app).main(arguments, prog_name="hybrid", standalone_mode=False, obj=arguments)
        sys.stdout.flush()
    except UsageError as error:
        from hybrid.cli.console import Voice

        command = error.ctx.command_path if error.ctx else "hybrid"
        Voice("--json" in arguments, False).error("usage", f"{error.format_message()}\n    try:      {command} --help")
        code = REFUSED
    except BrokenPipeError:  # the reader has gone, as in `hybrid schema | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = INTERRUPTED
    record = sys.modules.get("hybrid.store.writer")
    if record is not None and record.ABANDONED:  # HDF5 would crash when Python lets go of them
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(int(code or 0))
    sys.exit(code)


# ---- what commands share --------------------------------------------------------------------------


@contextmanager
def _speaking(as_json: bool, quiet: bool) -> Iterator[Voice]:
    """The voice of one command; errors become words and exit codes."""
    from hybrid.cli.console import Voice
    from hybrid.errors import ComputationError, ResultError, ResultHeld, SceneError

    voice, code = Voice(as_json, quiet), 0
    in_main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler) if in_main else None
    try:
        yield voice
    except SceneError as error:
        from hybrid.scene.read import located

        voice.refused(located(error, voice.source, voice.settings) if voice.source else error)
        code = REFUSED
    except ComputationError as error:
        voice.failed(error)
        code = FAILED
    except ResultHeld as error:
        voice.error("result", str(error))
        code = REFUSED
    except ResultError as error:
        voice.error("result", str(error), file=voice.written)
        code = FAILED if voice.written else REFUSED
    except KeyboardInterrupt:
        voice.interrupted()
        code = INTERRUPTED
    except Exception:
        head = f"this is a bug in hybrid {hybrid.__version__}; please report it with the scene and these lines"
        voice.error("bug", f"{head}\n{traceback.format_exc()}")
        code = FAILED
    finally:
        if in_main:
            signal.signal(signal.SIGTERM, before)
    if code:
        raise typer.Exit(code)


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"


def _kernels(scene: Scene) -> list[str]:
    """What a run of a scene needs compiled, by the last of each family: step, zones, model error."""
    from hybrid.model.resolution import wants_errors

    needed = ["newton.advance"]
    if scene.model.kind == "adaptive":
        needed.append("zone_criteria.weigh")
    if scene.model.kind == "corrected" or (wants_errors(scene) and scene.model.kind != "rod"):
        needed.append("bending_error.follow")
    return needed


def _ended(
    say: Voice,
    asked: Scene,
    result: Result,
    target: Path,
    wall: float,
    computed: float,
    cold: bool,
    picture: Path | None,
) -> None:
    """What there is to say of a run that has come to its end; computed: s of it, just now."""
    from hybrid.cli.console import span, speed

    if picture:
        hybrid.plot(result, picture)
    steps = len(result["steps/t"]) if "steps/t" in result else 0
    pace = "compilation included" if cold else f"{speed(computed / wall)} x real time"
    duration = asked.require_time().duration
    text = f"{duration:.6g} s in {steps} steps, {span(wall)} of wall time ({pace})"
    if computed < duration:
        text = f"{duration:.6g} s in {steps} steps, the last {computed:.6g} s in {span(wall)} of wall time ({pace})"
    say.events(result.events)
    facts = zones_over_time(result) if asked.model.kind == "adaptive" else {}
    if facts:
        say.show(lambda: zones_said(facts, target))
    errors = errors_facts(result)
    if errors:
        say.show(lambda: errors_table(errors, result))
    else:
        text += "; error not estimated"
    facts |= {"errors": errors}
    say.done(text, target, picture, status=result.status, t=duration, steps=steps, wall=wall, **facts)


def _load(say: Voice, path: Path, settings: list[str] | None) -> Scene:
    from hybrid.scene.read import read_scene

    say.source, say.settings = str(path), settings or []
    scene, renamed = read_scene(path, say.settings)
    for key in renamed:
        say.json("note", text=str(key), **vars(key))
        say.note(f"note: {key}")
    return scene


def _film(say: Voice, result: Result, source: Path, output: Path | None, overwrite: bool) -> None:
    """Make a film, as mp4 where this machine can."""
    from hybrid.view.animation import animate, ffmpeg

    suffix = ".mp4" if output or ffmpeg() else ".gif"
    if suffix == ".gif":
        say.note('note: there is no ffmpeg for mp4, so it is a gif; pip install "hybrid-cable[video]" brings one')
    film = animate(result, output or source.with_suffix(suffix), overwrite=overwrite)
    size = film.path.stat().st_size
    facts = {"status": result.status, "size": size} | {k: v for k, v in film._asdict().items() if k != "path"}
    say.done(f"{film.text}, {size / 1e6:.1f} MB", film.path, **facts)


def _picture(target: Path, plot: bool) -> Path | None:
    """Where a picture beside a result goes, checked before the work; None: none is asked for."""
    from hybrid.view.save import PICTURES, check_target

    return check_target(target.with_suffix(".png"), PICTURES) if plot else None
