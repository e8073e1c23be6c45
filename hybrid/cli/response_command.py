"""The command response: what a stationary sea does to a scene, linear about its equilibrium."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

import hybrid
from hybrid.cli.app import Json, Quiet, SceneFile, Settings, UsageError, app, flag, load, session
from hybrid.linear.response_results import ADDED, OF_LARGEST, LineResponse, Response

if TYPE_CHECKING:
    from hybrid.modal.api import Modes


MOTIONS = ("x", "y", "z", "roll", "pitch", "yaw")
LEAST = 1e-6  # of the largest: smaller motions are those of round-off


@app.command()
def response(
    scene: SceneFile, settings: Settings = None,
    hours: Annotated[float, typer.Option(metavar="H", help="Largest values of so many hours.")] = 3.0,
    smooth: Annotated[bool, flag("--smooth", help="Without friction of the bed, which else holds the line.")] = False,
    check: Annotated[float | None, typer.Option(metavar="S", help="Compare with a run in time of so many s.")] = None,
    quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Standard deviations and largest values in the waves of a scene, by frequency, without a run in time."""
    if not 0.0 < hours < np.inf:
        raise UsageError(f"--hours: {hours:g} is no time; give a number above 0, such as 3")
    with session(as_json, quiet) as console:
        found = hybrid.response(load(console, scene, settings), friction=not smooth, check=check)
        rows = _rows(found, hours)
        console.show(lambda: _table(found, rows, hours))
        for text in _unresolved(found):
            console.note(text)
        for name, (here, there) in found.checks.items():
            console.note(f"{name}: standard deviation {here:.4g}, in a run of {check:g} s {there:.4g}")
        for note in found.notes:
            console.note(f"note: {note}")
        console.json(
            "response", valid=found.valid, notes=list(found.notes), hours=hours, rows=rows, checks=dict(found.checks)
        )


def _unresolved(found: Response) -> Iterator[str]:
    """Along which part of each line curvature is not known, as it varies too little or too much is left out of it."""
    for name, line in found.lines.items():
        known, deviation = line.resolved("curvature"), line.deviation("curvature")
        if not known.all() and deviation.any():
            of = f"line {name}: " if len(found.lines) > 1 else ""
            most, part = OF_LARGEST * deviation.max(), 100.0 * ADDED["curvature"]
            where = "" if known[deviation.argmax()] else "; where it varies most is such a place"
            yield (
                f"{of}curvature is not known where its standard deviation is below a fifth of the largest, "
                f"{most:.3g} 1/m, or where more than {part:.2g} % of it are left out, "
                f"{100.0 * (1.0 - known.mean()):.0f} % of the line: it may vary several times as much{where}"
            )


def _rows(found: Response, hours: float) -> list[dict[str, Any]]:
    """One for each quantity at the place where it varies most."""
    rows = []
    for name, line in found.lines.items():
        of = f"{name} " if len(found.lines) > 1 else ""
        rows.append(_row(found, line, f"{of}tension", "tension", line.middle, line.mean_tension, "N", hours))
        if (line.mean_curvature > 0.0).any():
            rows.append(_row(found, line, f"{of}curvature", "curvature", line.s, line.mean_curvature, "1/m", hours))
        most = line.deviation("position").max()
        for k, axis in enumerate("xyz"):
            deviation = line.deviation("position")[:, k]
            at = int(deviation.argmax())
            if deviation[at] < LEAST * most:
                continue
            mean = line.mean_position[at, k]
            row = {"quantity": f"{of}{axis}", "unit": "m", "s": line.s[at], "mean": mean, "deviation": deviation[at]}
            row["period"] = line.period("position")[at, k]
            row["largest"] = mean + line.most_probable("position", hours)[at, k]
            each = {key: x if isinstance(x, str) else float(x) for key, x in row.items()}
            rows.append(each | {"valid": found.valid_for("position")})
    for kind, parts, axes in (("point", found.points, "xyz"), ("body", found.bodies, MOTIONS)):
        for name, x in parts.items():
            for k, axis in enumerate(axes):
                unit = "deg" if k > 2 else "m"
                size = float(np.sqrt(0.5 * (np.abs(x[:, k]) ** 2).sum())) * (180.0 / np.pi if k > 2 else 1.0)
                held = {"quantity": f"{kind} {name} {axis}", "unit": unit, "deviation": size}
                rows.append(held | {"valid": found.valid_for("position")})
    return rows


def _row(
    found: Response, line: LineResponse, label: str, name: str, s: Any, mean: Any, unit: str, hours: float
) -> dict[str, Any]:  # fmt: skip
    deviation = line.deviation(name)
    at = int(deviation.argmax())
    known = name not in ADDED or bool(line.resolved(name)[at])
    return {
        "quantity": label, "unit": unit, "s": float(s[at]), "mean": float(mean[at]), "deviation": float(deviation[at]),
        "valid": found.valid_for(name) and known,
        "period": float(line.period(name)[at]), "largest": float(mean[at] + line.most_probable(name, hours)[at]),
    }  # fmt: skip


def _table(found: Response, rows: list[dict[str, Any]], hours: float) -> Any:
    from rich.table import Table

    title = f"{found.title or 'response'}, where each varies most"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1), min_width=min(len(title), 80))
    table.add_column("quantity")
    for name in ("s (m)", "mean", "standard\ndeviation", "mean\nperiod (s)", f"MPM\nin {hours:g} h"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for row in rows:
        cells = [f"{row[key]:.4g}" if key in row else "" for key in ("s", "mean", "deviation", "period", "largest")]
        table.add_row(row["quantity"] + ("" if row["valid"] else ", not valid"), *cells, row["unit"])
    return table


# The command modes: natural periods of a scene about its equilibrium.

SHOWN = 3  # parts of the energy of a mode, and the least of them
LEAST_SHARE = 0.05


@app.command()
def modes(
    scene: SceneFile, settings: Settings = None,
    count: Annotated[int, typer.Option("--count", metavar="N", help="How many, the longest periods first.")] = 10,
    near: Annotated[float | None, typer.Option(metavar="S", help="Those nearest to this period (s) instead.")] = None,
    smooth: Annotated[bool, flag("--smooth", help="Without friction of the bed, which else holds the line.")] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the shapes: PNG, PDF, SVG; HTML, where they swing.")
    ] = None,
    quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Natural periods and shapes of a cable, or of lines with their points and bodies, about the equilibrium."""
    with session(as_json, quiet) as console:
        from hybrid.view.save import PAGES, PICTURES, check_target

        asked = load(console, scene, settings)
        picture = check_target(plot, (*PICTURES, *PAGES)) if plot is not None else None
        found = hybrid.modes(asked, count, near, friction=not smooth)
        if picture is not None and picture.suffix.lower() in PAGES:
            from hybrid.view.modes_page import write_modes

            write_modes(found, picture)
        elif picture is not None:
            from hybrid.view.modes_page import plot_modes

            plot_modes(found, picture)
        console.show(lambda: _modes_table(found))
        for note in found.notes:
            console.note(f"note: {note}")
        console.json(
            "modes", cells=found.cells, mass=found.mass.tolist(), notes=list(found.notes),
            picture=None if picture is None else str(picture),
            modes=[
                {
                    "period": x.period, "error": x.error, "frequency": x.frequency, "what": x.what,
                    "energy": dict(x.energy), "mass": x.mass.tolist(),
                }
                for x in found.modes
            ],
        )  # fmt: skip


def _modes_table(found: Modes) -> Any:
    from rich.table import Table

    title = f"{found.title or 'modes'}: {len(found.modes)} modes on {found.cells} cells"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1), min_width=min(len(title), 80))
    for name in ("", "period (s)", "error (s)"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("moves, by kinetic energy")
    table.add_column("mass x, y, z (%)", justify="right", no_wrap=True)
    for k, x in enumerate(found.modes, start=1):
        parts = [f"{word} {100.0 * part:.0f} %" for word, part in x.energy.items() if part >= LEAST_SHARE][:SHOWN]
        masses = [100.0 * m / a if a > 0.0 else 0.0 for m, a in zip(x.mass, found.mass, strict=True)]
        error = "not known" if x.error is None else f"{x.error:.2g}"
        table.add_row(str(k), f"{x.period:.5g}", error, ", ".join(parts), "  ".join(f"{m:4.1f}" for m in masses))
    return table
