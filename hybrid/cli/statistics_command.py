"""The command stats: what the histories of a result amount to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from hybrid.cli.app import Json, LineName, Quiet, UsageError, app, numbers, opened_line, session, window, words
from hybrid.errors import ResultError

if TYPE_CHECKING:
    from hybrid.store.reader import Result

HOUR = 3600.0


@app.command()
def stats(
    result: Annotated[Path, typer.Argument(metavar="RUN.h5", help="The result to look at.", show_default=False)],
    names: Annotated[
        Any, typer.Option(metavar="NAME,..", parser=words, help="These quantities; else forces, tension, bending.")
    ] = None,
    at: Annotated[
        Any, typer.Option(metavar="S,S,..", parser=numbers, help="At these arc lengths (m); else where it is largest.")
    ] = None,
    times: Annotated[Any, typer.Option(metavar="A:B", parser=window, help="Only from A to B (s).")] = None,
    hours: Annotated[float, typer.Option(metavar="H", help="Extremes of so many hours.")] = 3.0,
    above: Annotated[
        float | None, typer.Option(metavar="X", help="Also the part of the time above X, in the unit of the quantity.")
    ] = None,
    curve: Annotated[str | None, typer.Option(metavar="NAME", help="Fatigue damage by this curve ..")] = None,
    strength: Annotated[
        float | None, typer.Option(metavar="N", help=".. of tension over this strength (N), or ..")
    ] = None,
    section: Annotated[
        Any, typer.Option(metavar="A,D,E", parser=numbers, help=".. of stress: area (m2), diameter (m), modulus (Pa).")
    ] = None,
    line: LineName = None, quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Statistics of a result: means, deviations, extremes, periods, what three hours bring; fatigue damage."""
    if not 0.0 < hours < np.inf:
        raise UsageError(f"--hours: {hours:g} is no time; give a number above 0, such as 3")
    if curve is None and (strength is not None or section is not None):
        name = "--strength" if strength is not None else "--section"
        raise UsageError(f"{name}: of fatigue damage, which needs a curve; add --curve NAME, such as --curve 'D sea'")
    with session(as_json, quiet) as console, opened_line(result, line) as (opened, result):
        if opened.lines and (names is None or not all(name in opened for name in names)):
            from hybrid.store.histories import usual_names

            own = ",".join(usual_names(opened))
            fix = f"--line {next(iter(opened.lines))}" + (f", or --names {own}" if own else "")
            raise ResultError(f"{result} holds the lines {', '.join(opened.lines)}\n    try:      {fix}")
        from hybrid.store.statistics_table import rows_of

        facts: dict[str, Any] = {}
        if curve is not None:
            s, damage = opened.damage(curve, strength=strength, section=section, times=times, at=at)
            facts = _fatigue_facts(opened, s, damage, times)
        if above is not None and (names is None or len(names) > 1):
            raise ResultError(
                "--above is of one quantity\n    try:      hybrid stats RUN.h5 --names end_force_end --above 5e4"
            )
        rows = rows_of(opened, names, at, times, hours * HOUR, above)
        used = {} if opened.lines else {name: found._asdict() for name, found in opened.utilisation().items()}
        for row in rows:
            console.json("statistics", **row)
        console.show(lambda: _table(rows, hours))
        if opened.status != "complete":
            console.note(f"note: of a run that has not come to its end; {opened.status_text}")
        elif opened.pending:
            console.note(f"note: {opened.pending}")
        without: dict[str, dict[str, None]] = {}
        for row in rows:
            if "no_extreme" in row:
                without.setdefault(row["no_extreme"], {})[row["quantity"]] = None
        for text, of in without.items():
            console.note(f"note: no extreme of {hours:g} h of {', '.join(of)}: {text}")
        for text in [row["beyond_outputs"] for row in rows if "beyond_outputs" in row]:
            console.note(f"note: {text}")
        lines = _limit_lines(opened, rows, above)
        if lines:
            console.show(lambda: "\n".join(lines))
        if curve is not None:
            console.show(lambda: f"fatigue by {curve}: {_fatigue_text(facts)}")
        console.json("done", file=str(result), status=opened.status, fatigue=facts, utilisation=used)


def _table(rows: list[dict[str, Any]], hours: float) -> Any:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("", no_wrap=True)
    for title in (
        "s (m)",
        "mean",
        "deviation",
        "skewness",
        "smallest",
        "largest",
        "period (s)",
        f"in {hours:g} h",
        "90 %",
    ):
        table.add_column(title, justify="right", no_wrap=True)

    def text(x: float | None) -> str:
        return "" if x is None else f"{x:.5g}"

    for row in rows:
        extreme = row["extreme"]
        table.add_row(
            f"{row['quantity']} ({row['unit']})", text(row["s"]), text(row["mean"]), text(row["deviation"]),
            "" if row["skewness"] is None else f"{row['skewness']:.2f}", text(row["minimum"]), text(row["maximum"]),
            text(row["crossing_period"]), text(extreme and extreme["most_probable"]),
            text(extreme and extreme["fractile"]),
        )  # fmt: skip
    return table


def _limit_lines(result: Result, rows: list[dict[str, Any]], above: float | None) -> list[str]:
    """For which part of the time quantities are above a value, which part of the limits of sections is used, and the
    limits of quantities."""
    from hybrid.store.limits import held_of

    found = []
    for row in rows if above is not None else ():
        place = "" if row["s"] is None else f" at s = {row['s']:.5g} m"
        part = f"{100.0 * row['exceedance']:.3g} % of the time"
        found.append(f"{row['quantity']}{place} is above {above:g} {row['unit']} for {part}")
    for x in () if result.lines else result.utilisation().values():
        part = "" if x.used is None else f"{100.0 * x.used:.4g} % of {x.limit} used: "
        found.append(f"{part}{x.text}, s = {x.s:.5g} m, t = {x.t:.5g} s, of every step and output")
    return found + [f"{x.text}{x.when}" + "; BROKEN" * x.broken for x in held_of(result)]


def _fatigue_facts(result: Result, s: np.ndarray, damage: np.ndarray, times: Any) -> dict[str, Any]:
    from hybrid.statistics.fatigue import life_in_years
    from hybrid.store.histories import history_of

    t = history_of(result, "tension", times).t
    k, duration = int(damage.argmax()), float(t[-1] - t[0])
    life = float(life_in_years([damage[k]], [1.0], duration))
    return {
        "s": float(s[k]),
        "damage": float(damage[k]),
        "duration": duration,
        "life": life if np.isfinite(life) else None,
    }


def _fatigue_text(facts: dict[str, Any]) -> str:
    life = "no end" if facts["life"] is None else f"{facts['life']:.3g} years of this"
    return f"most at s = {facts['s']:.5g} m, {facts['damage']:.3g} in {facts['duration']:.6g} s; life {life}"
