"""The command seek: numbers of a scene for which its equilibrium is what is asked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import hybrid
from hybrid.cli.app import Json, Quiet, SceneFile, Settings, UsageError, app, load, session, words

if TYPE_CHECKING:
    from hybrid.designs.seek import Sought


@app.command()
def seek(
    scene: SceneFile,
    target: Annotated[
        list[str], typer.Option("--target", metavar="RESULT=VALUE", help="Such as tension@250=25000; more than once.")
    ],
    by: Annotated[Any, typer.Option("--by", metavar="KEY,..", parser=words, help="As many numbers to change.")],
    settings: Settings = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write the scene with the numbers found.")
    ] = None,
    quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Find numbers of a scene with which results of its equilibrium are what is asked."""
    targets = {}
    for each in target:
        name, equals, value = each.rpartition("=")
        try:
            targets[name.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise UsageError(f"--target: '{each}' is no RESULT=VALUE such as tension@250=25000")
    with session(as_json, quiet) as console:
        found = hybrid.seek(load(console, scene, settings), targets, by)
        if output is not None:
            if output.exists():
                raise hybrid.ResultError(f"{output} exists\n    try:      another name")
            output.write_text(hybrid.scene_text(found.scene), encoding="utf-8")
        console.show(lambda: _table(found))
        console.json(
            "sought", numbers=dict(found.numbers), results=dict(found.results), targets=dict(found.targets),
            equilibria=found.equilibria, scene=None if output is None else str(output),
        )  # fmt: skip


def _table(found: Sought) -> Any:
    from rich.table import Table

    table = Table(title=f"found in {found.equilibria} equilibria", title_justify="left", box=None, padding=(0, 2))
    table.add_column("")
    table.add_column("value", justify="right")
    table.add_column("asked", justify="right")
    for key, x in found.numbers.items():
        table.add_row(key, f"{x:.8g}", "")
    for name, x in found.results.items():
        table.add_row(name, f"{x:.8g}", f"{found.targets[name]:.8g}")
    return table
