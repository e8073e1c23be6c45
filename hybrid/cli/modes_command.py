"""The command modes: natural periods of a scene about its equilibrium."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import hybrid
from hybrid.cli.app import Json, Quiet, SceneFile, Settings, app, flag, load, session

if TYPE_CHECKING:
    from hybrid.modal.api import Modes

SHOWN = 3  # parts of the energy of a mode, and the least of them
LEAST = 0.05


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
            from hybrid.view.mode_shapes import plot_modes

            plot_modes(found, picture)
        console.show(lambda: _table(found))
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


def _table(found: Modes) -> Any:
    from rich.table import Table

    title = f"{found.title or 'modes'}: {len(found.modes)} modes on {found.cells} cells"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1), min_width=min(len(title), 80))
    for name in ("", "period (s)", "error (s)"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("moves, by kinetic energy")
    table.add_column("mass x, y, z (%)", justify="right", no_wrap=True)
    for k, x in enumerate(found.modes, start=1):
        parts = [f"{word} {100.0 * part:.0f} %" for word, part in x.energy.items() if part >= LEAST][:SHOWN]
        masses = [100.0 * m / a if a > 0.0 else 0.0 for m, a in zip(x.mass, found.mass, strict=True)]
        error = "not known" if x.error is None else f"{x.error:.2g}"
        table.add_row(str(k), f"{x.period:.5g}", error, ", ".join(parts), "  ".join(f"{m:4.1f}" for m in masses))
    return table
