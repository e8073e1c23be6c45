"""What run, static and plan do for a scene of several lines."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hybrid
from hybrid.cli.app import picture_beside
from hybrid.cli.plan_tables import contents_table, system_plan_lines
from hybrid.cli.tables import extremes_facts, judged_text, quantities_facts, unknown_text, verdict_text, verdicts_of
from hybrid.store.records import error_words

if TYPE_CHECKING:
    from hybrid.cli.console import Console
    from hybrid.scene.system import System
    from hybrid.store.reader import Result


def run_lines(console: Console, asked: System, target: Path, plot: bool, keep: bool) -> None:
    """Compute the motion of several lines."""
    console.will_write(target)
    _moved(console, asked, target, picture_beside(target, plot), partial(hybrid.run, asked, target, overwrite=not keep))


def resume_lines(console: Console, asked: System, source: Path, target: Path, plot: bool, **more: Any) -> None:
    """Go on with the motion of several lines; more: as of `hybrid.resume`."""
    _moved(console, asked, target, picture_beside(target, plot), partial(hybrid.resume, source, target, **more))


def _moved(console: Console, asked: System, target: Path, picture: Path | None, compute: Callable[..., Result]) -> None:
    """Compute a motion, and print what it has reached; picture: where all lines are drawn, None: nowhere."""
    from hybrid.cli.progress_line import span
    from hybrid.simulation.first_use import kernels_of_lines

    console.compiling_kernels(kernels_of_lines(asked))
    begin = clock.perf_counter()
    with console.progress() as tell:
        result = compute(progress=tell)
    wall = clock.perf_counter() - begin
    steps = len(result.lines[next(iter(result.lines))]["steps/t"])
    text = f"{asked.require_time().duration:.6g} s in {steps} steps, {span(wall)} of wall time"
    if "error_total_position" in result.attributes:
        text += f"; estimated error {error_words(result.attributes)}"
    else:
        text += "; error not estimated"
    ended(console, result, target, picture, text, steps=steps, wall=wall)


def static_lines(console: Console, asked: System, target: Path, plot: bool, keep: bool) -> None:
    """Find the equilibrium of several lines."""
    from hybrid.cli.progress_line import span
    from hybrid.simulation.first_use import kernels_of_lines

    console.will_write(target)
    picture = picture_beside(target, plot)
    console.compiling_kernels(kernels_of_lines(asked, static=True))
    begin = clock.perf_counter()
    result = hybrid.static(asked, target, overwrite=not keep)
    wall = clock.perf_counter() - begin
    path, residual = (result.attributes[f"static_{x}"] for x in ("path", "residual"))
    text = f"equilibrium in {span(wall)} of wall time ({path}; residual force {residual:.2g} N)"
    ended(console, result, target, picture, text, path=path, residual=residual, wall=wall)


def ended(console: Console, result: Result, target: Path, picture: Path | None, text: str, **facts: Any) -> None:
    """Print what lines and points have reached, and draw them; picture: as of `_moved`."""
    if picture is not None:
        from hybrid.view.matplotlib_import import import_matplotlib

        import_matplotlib()
        hybrid.plot(result, picture)
    lines = {name: extremes_facts(line) | verdicts_of(line) for name, line in result.lines.items()}
    moves = len(result.times) > 1
    held = quantities_facts(result)
    points, bodies = _last(result, "points"), _last(result, "bodies")
    console.events(result.events)
    end = float(result.times[-1]) if moves else None
    meetings = [(x.t, x.text) for x in result.events if x.kind == "lines touch"]
    meetings += [(x.t_force, f"{x.partner}: {x.text}") for x in result.contacts()]
    console.show(lambda: _table(lines, points, bodies, held, end, meetings))
    pictures = [picture] if picture is not None else []
    console.done(
        text, target, *pictures, status=result.status, lines=lines, points=points, bodies=bodies, quantities=held,
        **facts,
    )  # fmt: skip


def _last(result: Result, group: str) -> dict[str, dict[str, Any]]:
    """The last value of all that is known of each point or body, by its name."""
    found: dict[str, dict[str, Any]] = {}
    for full in result.names:
        if full.startswith(f"{group}/"):
            name, _, key = full.removeprefix(f"{group}/").partition("/")
            found.setdefault(name, {})[key] = result[full][-1].tolist()
    return found


def _table(
    lines: dict[str, Any], points: dict[str, Any], bodies: dict[str, Any], held: list[dict[str, Any]],
    end: float | None, meetings: list[tuple[float, str]],
) -> Any:  # fmt: skip
    """end: s, time of the last output, of which points and bodies are; None: of an equilibrium; meetings: of lines,

    when (s) and where they touched first, and with what force.
    """
    from rich.table import Table

    def at(x: dict[str, Any]) -> str:
        when = "" if end is None else f", t = {x['t']:.5g} s"
        return f"{x['value']:.5g} N at s = {x['s']:.5g} m{when}"

    last = "" if end is None else f"at t = {end:.5g} s: "
    table = Table.grid(padding=(0, 2))
    for name, facts in lines.items():
        most, least = facts["tension_max"], facts["tension_min"]
        limits = {x["limit"]: x for x in facts["limits"]}
        low, high = (
            at(x) + judged_text(limits.get(limit), "N", x)
            for x, limit in ((least, "min_tension"), (most, "max_tension"))
        )
        table.add_row(f"line {name}", f"tension {low}, to {high}{unknown_text(facts, 'N')}")
        bent, bend = facts.get("bend_radius_min"), limits.get("min_bend_radius")
        if bent is not None and bend is not None:
            radius = f"{bent['value']:.5g} m at s = {bent['s']:.5g} m" + f", t = {bent['t']:.5g} s" * (end is not None)
            table.add_row("", f"smallest bend radius {radius}{judged_text(bend, 'm', bent)}{unknown_text(facts, 'm')}")
        if (pressed := facts.get("contact_max")) is not None:
            force = f"{pressed['value']:.5g} N/m at s = {pressed['s']:.5g} m" + f", t = {pressed['t']:.5g} s" * (
                end is not None
            )
            held_force = judged_text(limits.get("max_contact_force"), "N/m", pressed)
            table.add_row("", f"largest contact force {force}, of {pressed['partner']}{held_force}")
        for x in facts["quantities"]:
            table.add_row("", x["text"] + x["when"] + x["ending"])
        for each in facts.get("accuracy", ()):
            table.add_row("", verdict_text(each))
    for name, facts in points.items():
        turned = f", turned by {_vector(facts['rotation'], 1e-6)} deg" if "rotation" in facts else ""
        force = f", force of the lines {_vector(facts['force'])} N" if "force" in facts else ""
        moment = f", moment {_vector(facts['moment'])} N m" if "moment" in facts else ""
        table.add_row(f"point {name}", f"{last}{_vector(facts['position'])} m{turned}{force}{moment}")
    for name, facts in bodies.items():
        turned = f"{_vector(facts['position'])} m, turned by {_vector(facts['rotation'], 1e-6)} deg"
        loads = f"force of the lines {_vector(facts['force'])} N, moment {_vector(facts['moment'])} N m"
        table.add_row(f"body {name}", f"{last}{turned}, {loads}")
    for t, text in meetings:
        table.add_row("contact", f"{'' if end is None else f't = {t:.5g} s: '}{text}")
    for x in held:
        table.add_row(x["name"], x["text"] + x["when"] + x["ending"])
    table.columns[0].style = "bold"
    return table


def _vector(x: list[float], least: float = 0.0) -> str:
    zero = max(1e-9 * max(abs(c) for c in x), least)
    return "[" + ", ".join(f"{c if abs(c) > zero else 0.0:.5g}" for c in x) + "]"


def plan_of_lines(console: Console, asked: System, verbose: bool) -> None:
    """Show what a run of several lines would compute."""
    made = hybrid.plan(asked)
    console.json("plan", **asdict(made))
    console.show(lambda: "\n".join(system_plan_lines(asked, made)))
    if verbose:
        for name, line in made.lines.items():
            console.show(partial(str, f"line {name}"))
            console.show(partial(contents_table, line))
