"""Error against cost of a scene with other programs beside `hybrid trade`, those that are installed and can do it.

From bench: python -m peers.trade SCENE.yaml [-o FOLDER] [--levels] [--accuracies 3%,1%] [--repeat N]

Finished runs are kept in the folder, as those of `hybrid trade` are.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import hybrid
from hybrid.model.plan import output_times
from hybrid.scene.read import SceneLike, as_scene, one_line
from hybrid.scene.root import Scene
from hybrid.simulation.progress import interrupts
from hybrid.store.tables import DONE, FAILED, REFERENCE, Row, TradeTable
from hybrid.studies.runs import RunStore, key_of
from hybrid.studies.tradeoff import ACCURACIES, END_FORCES, LevelTable, force_difference, level_row, with_errors
from hybrid.view.several_runs import plot_trade
from peers import adapters
from peers.adapters.interface import PeerFailed, PeerRun

Found = tuple[Row, dict[str, np.ndarray]]


def trade(scene: SceneLike, folder: Path, *, repeat: int = 1, **more: Any) -> TradeTable:
    """`hybrid.trade`, and a row for every run of another program in its table, page and picture."""
    scene = as_scene(scene)
    table = hybrid.trade(scene, folder, repeat=repeat, **more)
    best = next(row for row in table.rows if row.status == REFERENCE)
    found, exact = others(scene, folder, best.key, repeat)
    rows = tuple(_with_errors(row, values, exact, scene) for row, values in found)
    table = replace(table, rows=table.rows + rows, facts=(*table.facts, *_programs(scene)))
    table.write(folder, "trade.png")
    plot_trade(table, folder / "trade.png", overwrite=True)
    return table


def trade_levels(scene: SceneLike, folder: Path, *, repeat: int = 1, **more: Any) -> LevelTable:
    """`hybrid.trade_levels`, and other programs at level A: they give positions and end forces."""
    scene = as_scene(scene)
    table = hybrid.trade_levels(scene, folder, repeat=repeat, **more)
    found, exact = others(scene, folder, table.reference.key, repeat)
    theirs = [level_row("A", row.name, row, values, exact, scene.length) for row, values in found]
    rows = tuple(sorted([*table.rows, *theirs], key=lambda row: row.level))
    table = replace(table, rows=rows, facts=(*table.facts, *_programs(scene)))
    table.write(folder)
    return table


def others(scene: Scene, folder: Path, reference: str, repeat: int) -> tuple[list[Found], dict[str, np.ndarray]]:
    """What other programs compute, and what the reference, which is kept in the folder under this key, has computed."""
    runs = adapters.peer_runs(scene)
    with interrupts() as stopped:
        store = RunStore(folder, None, len(runs), stopped)
        kept = store.load(reference)
        assert kept is not None, "the reference is kept"
        return [_found(store, run, repeat, scene) for run in runs], kept[1]


def _found(store: RunStore, run: PeerRun, repeat: int, scene: Scene) -> Found:
    """The row of another program, kept as ours are, and what it computes; nothing where it fails."""
    row = Row(run.code, run.model, run.settings, FAILED, run.unsupported)
    if run.unsupported:
        return replace(row, status=adapters.UNSUPPORTED), {}
    row = replace(row, key=key_of(scene, repeat, adapters.fingerprint(run)) + run.tag)
    found = store.load(row.key)
    if found is None:
        store.report(run.name, 0.0)
        try:
            answers = [adapters.compute(run, scene) for _ in range(repeat)]
        except PeerFailed as error:
            return store.save(replace(row, cause=str(error)), {})
        row = replace(row, status=DONE, cells=run.elements, steps=answers[-1].steps)
        found = store.save(replace(row, cpu=median(x.cpu for x in answers)), answers[-1].values)
    return found


def _with_errors(row: Row, values: Mapping[str, np.ndarray], exact: Mapping[str, np.ndarray], scene: Scene) -> Row:
    """The row with its errors; nothing is known where it failed."""
    if not values:
        return row
    forces = np.max([force_difference(values[x], exact[x]) for x in END_FORCES], axis=0)
    # The median tells a transient at the start, or one impact, from an error that lasts.
    worst, usual = [0.0, *output_times(one_line(scene))][int(forces.argmax())], float(np.median(forces))
    cause = f"largest error of its end force at t = {worst:g} s; median error {usual:.3g} N"
    return with_errors(replace(row, cause=cause), values, exact, scene.length)


def _programs(scene: Scene) -> list[tuple[str, str]]:
    """Their versions, for the heading."""
    found = adapters.versions(adapters.peer_runs(scene))
    return [("other programs", found)] if found else []


def main() -> None:
    """Print the page, and write it to the folder."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("scene", type=Path)
    ask.add_argument("-o", "--output", type=Path, help="else SCENE.trade, in this folder")
    ask.add_argument("--levels", action="store_true", help="what three levels of demand cost")
    ask.add_argument("--accuracies", default=",".join(ACCURACIES))
    ask.add_argument("--repeat", type=int, default=1)
    given = ask.parse_args()
    folder = given.output or Path(given.scene.with_suffix(".trade").name)
    command = shlex.join(["python", "-m", "peers.trade", *sys.argv[1:]])
    if given.levels:
        print(trade_levels(given.scene, folder, repeat=given.repeat, command=command).markdown())
    else:
        asked = given.accuracies.split(",")
        print(trade(given.scene, folder, repeat=given.repeat, accuracies=asked, command=command).markdown("trade.png"))


if __name__ == "__main__":
    main()
