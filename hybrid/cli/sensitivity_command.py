"""The command sensitivity: what results at rest answer to the numbers of a scene."""

from __future__ import annotations

import math
from itertools import chain
from typing import TYPE_CHECKING, Annotated, Any

import typer

import hybrid
from hybrid.cli.app import Json, Quiet, SceneFile, Settings, app, flag, load, session, words

if TYPE_CHECKING:
    from hybrid.designs.sensitivity import Derivative
    from hybrid.scene.root import Scene


@app.command()
def sensitivity(
    scene: SceneFile, settings: Settings = None,
    of: Annotated[
        list[Any] | None,
        typer.Option("--of", metavar="RESULT,..", parser=words, help="Results such as tension@0, max curvature."),
    ] = None,
    by: Annotated[
        list[Any] | None,
        typer.Option("--by", metavar="KEY,..", parser=words, help="Numbers; else all of the sections."),
    ] = None,
    motion: Annotated[
        bool, flag("--motion", help="Of a run, in steps that stay: of 'max tension@end', 'std position.z@100'.")
    ] = False,
    quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Derivatives and elasticities (% by %) of an equilibrium, or a motion, by the numbers of its scene."""
    with session(as_json, quiet) as console:
        asked = load(console, scene, settings)
        results, numbers = (list(chain.from_iterable(x or ())) for x in (of, by))
        found = hybrid.sensitivity(asked, results or _results(asked, motion), numbers or _numbers(asked), motion)
        console.show(lambda: _tables(found))
        for x in found:
            console.json("derivative", **x._asdict())


def _results(scene: Scene, motion: bool) -> list[str]:
    """What engineers ask first."""
    tensions = [f"{x}/tension@{end}".lstrip("/") for x in scene.lines for end in ("start", "end")]
    if motion:
        return [f"max {name}" for name in tensions]
    bends = not scene.line_names and scene.scene_of("").model.kind != "catenary"
    return [*tensions, *["max curvature"] * bends]


def _numbers(scene: Scene) -> list[str]:
    """All numbers of the sections that are not 0."""
    out = []
    for line, x in scene.lines.items():
        for i, section in enumerate(x.cable.sections):
            for name, value in section.model_dump().items():
                if isinstance(value, float) and value != 0.0 and name != "max_strain":
                    out.append(f"{scene.key_of(line)}.sections[{i}].{name}")
    return out


def _tables(found: list[Derivative]) -> Any:
    """One for each result, what it answers to most first."""
    from rich.console import Group
    from rich.table import Table

    tables = []
    for result in dict.fromkeys(x.of for x in found):
        rows = [x for x in found if x.of == result]
        rows.sort(key=lambda x: -abs(x.elasticity) if math.isfinite(x.elasticity) else 0.0)
        title = f"{result}: {rows[0].result:.6g}"
        table = Table(title=title, title_justify="left", box=None, padding=(0, 1), min_width=len(title))
        table.add_column("by")
        for name in ("value", "derivative", "error", "% by %"):
            table.add_column(name, justify="right", no_wrap=True)
        for x in rows:
            elastic = f"{x.elasticity:.3g}" if math.isfinite(x.elasticity) else ""
            table.add_row(x.by, f"{x.number:.5g}", f"{x.derivative:.5g}", f"{x.error:.1g}", elastic)
        tables.append(table)
    ways = dict.fromkeys(x.way for x in found)
    return Group(*tables, *(f"by {way}" if len(ways) == 1 else f"{_keys(found, way)} by {way}" for way in ways))


def _keys(found: list[Derivative], way: str) -> str:
    """By which numbers derivatives were found in a way; results, where these are what tells ways apart."""
    own = [x for x in found if x.way == way]
    results = dict.fromkeys(x.of for x in own)
    of_results = sum(x.of in results for x in found) == len(own)
    return ", ".join(results if of_results else dict.fromkeys(x.by for x in own))
