"""The command line: hybrid run | static | plan | plot | trade | schema.

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
from hybrid.errors import ZONE_EVENTS

if TYPE_CHECKING:
    from hybrid.live import Voice
    from hybrid.model.plan import Plan
    from hybrid.results.read import Result
    from hybrid.results.tradetable import Row, TradeTable
    from hybrid.scene.schema import Scene

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


def _flag(*names: str, help: str) -> Any:
    return typer.Option(*names, metavar="", help=help)  # it takes no value, so none is named


def _output(help: str) -> Any:
    return typer.Option("--output", "-o", metavar="FILE", help=help)


SceneFile = Annotated[Path, typer.Argument(metavar="SCENE.yaml", help="The scene to read.", show_default=False)]
RunFile = Annotated[Path | None, _output("Result; else SCENE.h5, in this folder.")]
StaticFile = Annotated[Path | None, _output("Result; else SCENE.static.h5, here.")]
Picture = Annotated[Path | None, _output("PNG, PDF, SVG ..; else RUN.png, RUN.zones.png.")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a value, as in time.step=0.005.")
]
Drawn = Annotated[bool, _flag("--plot", help="Draw it as well, as PNG beside it.")]
Keep = Annotated[bool, _flag("--no-overwrite", help="Refuse to replace an older result.")]
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
        cold = say.compiling(_kernels(asked))
        from hybrid.live import span, speed

        begin = clock.perf_counter()
        with say.progress() as tell:
            result = hybrid.run(asked, target, progress=tell, overwrite=not keep)
        wall = clock.perf_counter() - begin
        picture = _draw(result, target.with_suffix(".png")) if plot else None
        steps = len(result["steps/t"]) if "steps/t" in result else 0
        pace = "compilation included" if cold else f"{speed(duration / wall)} x real time"
        text = f"{duration:.6g} s in {steps} steps, {span(wall)} of wall time ({pace})"
        say.events(result.events)
        facts = _zones_over_time(result) if asked.model.kind == "adaptive" else {}
        if facts:
            say.show(lambda: _zones_said(facts, target))
        errors = _errors(result)
        if errors:
            say.show(lambda: _errors_table(errors, result))
        else:
            text += "; error not estimated"
        facts |= {"errors": errors}
        say.done(text, target, picture, status=result.status, t=duration, steps=steps, wall=wall, **facts)


@app.command()
def static(
    scene: SceneFile, output: StaticFile = None, settings: Settings = None,
    plot: Drawn = False, keep: Keep = False, quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Find the equilibrium of a cable at t = 0 and write it to a file."""
    with _speaking(as_json, quiet) as say:
        asked = _load(say, scene, settings)
        target = say.will_write(output or Path(f"{scene.stem}.static.h5"))
        say.compiling(["step.newton"])
        from hybrid.live import span

        begin = clock.perf_counter()
        result = hybrid.static(asked, target, overwrite=not keep)
        wall = clock.perf_counter() - begin
        picture = _draw(result, target.with_suffix(".png")) if plot else None
        facts = _equilibrium(result)
        errors = _errors(result)
        say.show(lambda: _equilibrium_table(facts))
        if errors:
            say.show(lambda: _errors_table(errors, result))
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
        say.show(lambda: _plan_table(asked, made))


@app.command()
def plot(
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to draw.", show_default=False)],
    output: Picture = None,
    times: Annotated[Any, typer.Option(metavar="T,T,..", parser=_numbers, help="Earlier shapes to draw (s).")] = None,
    history: Annotated[
        Any, typer.Option(metavar="S,S,..", parser=_numbers, help="Arc lengths to follow over time (m).")
    ] = None,
    zones: Annotated[bool, _flag("--zones", help="Draw zones along s over time instead.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Draw a result: shapes, profiles along the cable, histories; or its zones over time."""
    if zones and (times or history):
        raise typer.BadParameter("--times and --history choose what a page without --zones shows")
    with _speaking(as_json, quiet) as say, hybrid.open(result) as opened:
        if zones:
            picture = output or result.with_suffix(".zones.png")
            hybrid.plot_zones(opened, picture)
        else:
            picture = _draw(opened, output or result.with_suffix(".png"), times=times, history=history)
        n = len(opened.times)
        over = f", t = {opened.times[0]:.6g} to {opened.times[-1]:.6g} s" if n > 1 else ""
        say.done(f"{n} output{'s' * (n != 1)}{over}", picture, status=opened.status)


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
            say.json("row", **(asdict(row) | _judged(table, row)))
        say.show(lambda: _trade_table(table))
        say.show(lambda: table.recommendation)
        best = table.recommended
        facts = {"recommended": best.name if best else None, "cpu": best.cpu if best else None, "runs": len(table.rows)}
        files = [folder / name for name in ("trade.md", "trade.csv", "trade.png")]
        say.done(f"{len(table.rows)} runs", *files, **facts)


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
        from hybrid.live import Voice

        command = error.ctx.command_path if error.ctx else "hybrid"
        Voice("--json" in arguments, False).error("usage", f"{error.format_message()}\n    try:      {command} --help")
        code = REFUSED
    except BrokenPipeError:  # the reader has gone, as in `hybrid schema | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = INTERRUPTED
    sys.exit(code)


# ---- what commands share --------------------------------------------------------------------------


@contextmanager
def _speaking(as_json: bool, quiet: bool) -> Iterator[Voice]:
    """The voice of one command; errors become words and exit codes."""
    from hybrid.errors import ComputationError, ResultError, SceneError
    from hybrid.live import Voice

    voice, code = Voice(as_json, quiet), 0
    in_main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler) if in_main else None
    try:
        yield voice
    except SceneError as error:
        voice.refused(error)
        code = REFUSED
    except ComputationError as error:
        voice.failed(error)
        code = FAILED
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


def _kernels(scene: Scene) -> list[str]:
    """What a run of a scene needs compiled, by the last of each family: step, zones, model error."""
    from hybrid.model.effort import wants_errors

    needed = ["step.advance"]
    if scene.model.kind == "adaptive":
        needed.append("criteria.weigh")
    if scene.model.kind == "corrected" or (wants_errors(scene) and scene.model.kind != "rod"):
        needed.append("correct.follow")
    return needed


def _load(say: Voice, path: Path, settings: list[str] | None) -> Scene:
    say.source = str(path)
    return hybrid.load_scene(path, settings or [])


def _draw(result: Result, picture: Path, **chosen: Any) -> Path:
    hybrid.plot(result, picture, **chosen)
    return picture


def _equilibrium(result: Result) -> dict[str, Any]:
    """What one asks of an equilibrium first; None for what its solver does not say."""
    s, tension, position = result.s, result.tension[-1], result.position[-1]
    low, high, bottom = int(tension.argmin()), int(tension.argmax()), int(position[:, 2].argmin())
    force = {end: result[f"reaction_{end}"][-1].tolist() for end in ("start", "end") if f"reaction_{end}" in result}
    return {
        "path": result.attributes.get("static_path", result.message),
        "residual": result.attributes.get("static_residual"),
        "tension_max": {"value": float(tension[high]), "s": float(s[high])},
        "tension_min": {"value": float(tension[low]), "s": float(s[low])},
        "lowest": {"position": position[bottom].tolist(), "s": float(s[bottom])},
        "force": force,
        "zones": [zone._asdict() if hasattr(zone, "_asdict") else asdict(zone) for zone in result.zones[-1]],
    } | _on_the_seabed(result)


def _on_the_seabed(result: Result) -> dict[str, Any]:
    """Touchdown, grounded length and contact force, where there is a seabed; None where nothing touches."""
    if "grounded_length" not in result:
        return {}
    edges = [float(x) if x == x else None for x in result["touchdown"][-1]]
    grounded, force = float(result.grounded_length[-1]), float(result.contact_force[-1])
    return {"touchdown": edges, "grounded_length": grounded, "contact_force": force}


def _equilibrium_table(facts: dict[str, Any]) -> Any:
    from rich.table import Table

    def vector(x: list[float]) -> str:
        zero = 1e-9 * max(abs(c) for c in x)
        return "[" + ", ".join(f"{c if abs(c) > zero else 0.0:.5g}" for c in x) + "]"

    table = Table.grid(padding=(0, 2))
    table.add_row("found by", facts["path"].replace("; ", "\n"))
    if facts["residual"] is not None:
        table.add_row("out of balance", f"{facts['residual']:.2g} N at most")
    for name, key in (("largest tension", "tension_max"), ("smallest tension", "tension_min")):
        table.add_row(name, f"{facts[key]['value']:.5g} N at s = {facts[key]['s']:.5g} m")
    for end, force in facts["force"].items():
        table.add_row(f"force at {end}", f"{vector(force)} N on the cable")
    if facts.get("grounded_length"):
        a, b = facts["touchdown"]
        table.add_row("on the seabed", f"{facts['grounded_length']:.5g} m between s = {a:.5g} and {b:.5g} m")
        table.add_row("contact force", f"{facts['contact_force']:.5g} N")
    elif "grounded_length" in facts:
        table.add_row("on the seabed", "nothing")
    if len(facts["zones"]) > 1:
        table.add_row("zones", "\n".join(f"{z['kind']} {z['s_a']:.5g} to {z['s_b']:.5g} m" for z in facts["zones"]))
    table.add_row("lowest point", f"{vector(facts['lowest']['position'])} m at s = {facts['lowest']['s']:.5g} m")
    table.columns[0].style = "bold"
    return table


def _zones_over_time(result: Result) -> dict[str, Any]:
    """What zones that move have done: shares of the line that were rod, and changes."""
    length = float(result.s[-1])
    shares = [sum(z.s_b - z.s_a for z in zones if z.kind == "rod") / length for zones in result.zones]
    changes = sum(e.kind in ZONE_EVENTS for e in result.events)
    rod = {"least": min(shares), "mean": sum(shares) / len(shares), "most": max(shares)}
    return {"rod": rod, "zone_changes": changes}


def _errors(result: Result) -> dict[str, Any]:
    """The estimated errors: largest of position (m) and of the pulls at the ends (N), by kind; whether they are met."""
    found: dict[str, Any] = {k[6:]: float(x) for k, x in result.attributes.items() if k.startswith("error_")}
    if found and "accuracy_asked" in result.attributes:
        kinds = {event.kind for event in result.events}
        known = not kinds & {"error uncertain", "error beyond estimate"}
        found["met"] = "accuracy missed" not in kinds and (known or None)
    return found


def _errors_table(errors: dict[str, Any], result: Result) -> Any:
    """The same for people: by cause, beside what was asked."""
    from rich.table import Table

    pulls = [result[name] for name in ("reaction_start", "reaction_end") if name in result]
    most = max((float((x**2).sum(axis=1).max()) ** 0.5 for x in pulls), default=0.0)
    table = Table.grid(padding=(0, 2))
    kinds = [kind for kind in ("mesh", "time", "model", "total") if f"{kind}_position" in errors]
    table.add_row("error by", *({"time": "step"}.get(kind, kind) for kind in kinds), "", style="bold")
    for what, unit, whole in (("position", "m", float(result.s[-1])), ("pull", "N", most)):
        total = errors[f"total_{what}"]
        share = (
            f"{100 * total / whole:.2g} % of {'the length' if what == 'position' else f'{_short(whole)} N'}"
            if whole
            else ""
        )
        sizes = (f"{_short(errors[f'{kind}_{what}'])} {unit}" for kind in kinds)
        table.add_row("position" if what == "position" else "pull at ends", *sizes, share)
    if "errors/model/bending_moment" in result or "errors/total/bending_moment" in result:
        names = [f"errors/{kind}/bending_moment" for kind in kinds]
        sizes = (f"{_short(float(result[name].max()))} N m" if name in result else "" for name in names)
        peak = float(result["bending_moment"].max()) if "bending_moment" in result else 0.0
        table.add_row("moment", *sizes, f"of {_short(peak)} N m" if peak else "no rod, no moment: model: rod")
    asked = result.attributes.get("accuracy_asked")
    if not asked:
        return table
    from rich.console import Group

    verdict = {True: "met", False: "MISSED", None: "perhaps met, see the note"}[errors["met"]]
    return Group(table, f"asked {asked}: {verdict}")


def _short(x: float) -> str:
    """Two digits, without an exponent where that is as short."""
    return f"{float(f'{x:.2g}'):.6g}" if 1e-4 <= abs(x) < 1e6 or x == 0.0 else f"{x:.1e}"


def _zones_said(facts: dict[str, Any], file: Path) -> str:
    """The same in a line."""
    rod, changes = facts["rod"], facts["zone_changes"]
    if not changes:
        return f"rod: {rod['mean']:.0%} of the line, all the time"
    times = f"{changes} change{'s' * (changes > 1)} of zones"
    part = f"rod: {rod['least']:.0%} to {rod['most']:.0%} of the line, {rod['mean']:.0%} on the mean"
    return f"{part}; {times}: hybrid plot --zones {file}"


def _judged(table: TradeTable, row: Row) -> dict[str, Any]:
    """What the table says of a row."""
    score = table.score(row) if row.is_choice else None
    return {"score": score, "front": row in table.front(), "recommended": row == table.recommended}


def _trade_table(table: TradeTable) -> Any:
    """The rows as a terminal has room for them."""
    from rich.table import Table

    def part(value: float | None) -> str:
        return "" if value is None else f"{100 * value:.2g} %"

    out = Table(box=None, pad_edge=False, header_style="bold")
    out.add_column("run", no_wrap=True)
    for name in ("position", "pull", "cells", "steps", "CPU"):
        out.add_column(name, justify="right", no_wrap=True)
    out.add_column("", overflow="fold")
    front, best = table.front(), table.recommended
    for row in table.rows:
        said = "take this" if row == best else "front" if row in front else ""
        said = ", ".join(x for x in (said, "" if row.status == "done" else row.status, row.cause) if x)
        style = "bold green" if row == best else "" if row in front else "yellow" if not row.is_choice else "dim"
        figures = [part(row.position_part), part(row.pull_part), str(row.cells or ""), str(row.steps or "")]
        out.add_row(row.name, *figures, f"{row.cpu:.3g} s" if row.cpu else "", said, style=style)
    return out


def _plan_table(scene: Scene, plan: Plan) -> Any:
    from rich.console import Group
    from rich.table import Table

    from hybrid.live import span

    ledger = Table.grid(padding=(0, 3, 0, 0))
    ledger.add_column(no_wrap=True)
    ledger.add_column(overflow="fold")
    for on, what, why in ((True, "on", "asked for by"), (False, "off", "why, or what would ask for it")):
        ledger.add_row(what, why, style="bold")
        for entry in (e for e in plan.ledger if e.on == on):
            ledger.add_row(entry.what, entry.why, style="" if on else "dim")
        ledger.add_row()
    zones = Table.grid(padding=(0, 3, 0, 0))
    zones.add_row("zone", "from", "to", "cells", style="bold")
    moving = plan.base_cells is not None
    for zone, cells in zip(plan.zones, plan.cells, strict=True):
        kind, count = ("as it comes", f"{plan.base_cells} to {cells}") if moving else (zone.kind, str(cells))
        zones.add_row(kind, f"{zone.s_a:.6g} m", f"{zone.s_b:.6g} m", count)
    work = "no time in the scene, so statics only"
    follows = scene.time is not None and scene.time.controlled
    most = "about" if plan.base_cells is None else "at most about"
    if scene.time is not None:
        asked = scene.time.step or plan.step
        shortened = f" ({asked:.6g} s asked, shortened to fit between outputs)" if plan.step < 0.999 * asked else ""
        work = f"{plan.steps} steps of {plan.step:.6g} s{shortened}, {most} {span(plan.seconds)} of computing"
        if follows:
            work = f"{plan.steps} steps or more, as the motion asks, in several runs: {span(plan.seconds)} or more"
    head = [scene.title, ""] if scene.title else []
    size = f"{sum(plan.cells)} cells, {plan.unknowns} unknowns"
    if moving:
        size = f"{plan.base_cells} cells where it is catenary, {size} if all of it is rod"
    return Group(*head, ledger, zones, "", f"{size}; {work}")
