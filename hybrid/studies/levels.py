"""What three levels of demand cost with every model: position and tension; bending moments as well; curvature as well.

Every run asks for the accuracy of its level, and is compared with a rod everywhere of a third of that error.
docs/trade.md
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.scene.read import SceneLike, as_scene, one_line
from hybrid.simulation.progress import interrupts
from hybrid.store.tradeoff_table import Row
from hybrid.studies.runs import RunStore, StudyProgress, level_spec
from hybrid.studies.tradeoff import force_difference, refuse_peers

# Errors that the levels allow.
POSITION = 1e-3  # of the length
TENSION = 0.01  # of the largest end force
ALONG = 0.05  # of the largest moment and curvature
LEVELS = {
    "A": {"position": "0.1%", "tension": "1%"},
    "B": {"position": "0.1%", "tension": "1%", "bending_moment": "5%"},
    "C": {"position": "0.1%", "tension": "1%", "bending_moment": "5%", "curvature": "5%"},
}
MEANS = {
    "A": "position within 0.1 % of the length, end forces within 1 % of the largest",
    "B": "the same, and the largest bending moment of every output within 5 %",
    "C": "the same, and curvature at every point and output within 5 % of the largest",
}
REFERENCE = {"position": "0.03%", "tension": "0.3%", "bending_moment": "1.5%", "curvature": "1.5%"}
# Models that are tried: kinds of `model`, and zones that move whose rods have cells that follow the curvature.
FOLLOWING = "following"
MODELS = "rod", "catenary", "adaptive", FOLLOWING


@dataclass(frozen=True)
class LevelRow:
    """A run of a level; errors are parts as of MEANS, None: there is no such figure.  worst: over what is asked."""

    level: str
    model: str
    status: str
    cause: str
    position: float | None = None
    end_force: float | None = None
    moment: float | None = None
    curvature: float | None = None
    worst: float | None = None
    cells: int | None = None
    steps: int | None = None
    runs: int | None = None
    cpu: float | None = None  # s, of everything

    @property
    def meets(self) -> bool:
        """Whether every error that the level asks for is met."""
        return self.worst is not None and self.worst <= 1.0


@dataclass(frozen=True)
class LevelTable:
    """All rows, and the reference that they are compared with."""

    title: str
    reference: Row
    rows: tuple[LevelRow, ...]
    facts: tuple[tuple[str, str], ...]

    def cheapest(self, level: str) -> LevelRow | None:
        """Of our runs that meet a level the one that costs least."""
        good = [x for x in self.rows if x.level == level and x.meets and x.model in MODELS and x.cpu is not None]
        return min(good, key=lambda row: row.cpu or 0.0, default=None)

    def sentences(self) -> list[str]:
        """For every level the model to take, and what a rod everywhere costs."""
        out = []
        for level in LEVELS:
            best = self.cheapest(level)
            if best is None:
                out.append(f"Level {level} ({MEANS[level]}): no run met it.")
                continue
            rod = next((x for x in self.rows if (x.level, x.model) == (level, "rod") and x.meets), None)
            more = ""
            if rod is not None and rod.cpu and best.cpu and rod != best:
                more = f", {rod.cpu / best.cpu:.2g} times less than a rod everywhere"
            out.append(f"Level {level} ({MEANS[level]}): {best.model}, {best.cpu:.3g} s of CPU time{more}.")
        return out

    def csv(self) -> str:
        """All rows, SI units."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow([x.name for x in fields(LevelRow)])
        for row in self.rows:
            writer.writerow(["" if x is None else x for x in asdict(row).values()])
        return out.getvalue()

    def write(self, folder: Path) -> None:
        """levels.csv and levels.md in the folder."""
        for name, text in (("levels.csv", self.csv()), ("levels.md", self.markdown())):
            (folder / name).write_text(text, encoding="utf-8")

    def markdown(self, level: int = 1) -> str:
        """The page."""
        lines = [f"{'#' * level} {self.title or 'A cable'}: what each level costs", ""]
        lines += [*(f"- {text}" for text in self.sentences()), ""]
        head = "position", "end force", "moment", "curvature", "cells", "steps", "runs", "CPU"
        lines += [f"| level, model | status | {' | '.join(head)} | |"]
        lines += ["|---|---|" + "---:|" * 8 + "---|"]
        for row in self.rows:
            mark = "**cheapest**" if row == self.cheapest(row.level) else ""
            parts = [percent(x) for x in (row.position, row.end_force, row.moment, row.curvature)]
            counts = ["" if x is None else str(x) for x in (row.cells, row.steps, row.runs)]
            cpu = "" if row.cpu is None else f"{row.cpu:.3g} s"
            cells = [f"{row.level} {row.model}", status_of(row), *parts, *counts, cpu, mark]
            lines.append("| " + " | ".join(x.replace("|", "\\|") for x in cells) + " |")
        estimates = f"{self.reference.cells} cells, {self.reference.steps} steps"
        lines += ["", f"Reference: a rod everywhere asked for a third of these errors, {estimates}.", ""]
        lines += ["| measured with | |", "|---|---|", *(f"| {what} | {text} |" for what, text in self.facts), ""]
        return "\n".join(lines)


def status_of(row: LevelRow) -> str:
    """Whether a run meets its level, else by what factor it misses, or why it failed."""
    if row.worst is None:
        return f"{row.status}: {row.cause}"
    text = "meets it" if row.meets else f"error {row.worst:.2g} times what is asked"
    return f"{text}; reports: {row.cause}" if row.cause else text


def trade_levels(
    scene: SceneLike,
    folder: str | Path,
    *,
    repeat: int = 1,
    progress: Callable[[StudyProgress], None] | None = None,
    command: str = "",
    **former: Any,
) -> LevelTable:
    """Compute a scene at the three LEVELS with every model that it admits; what meets each at least cost.

    folder: gets levels.md, levels.csv and, in runs/, what each run has found; a second call does what is missing.
    repeat: of so many runs the median CPU time counts; progress, command: as of `trade`.

    Raises SceneError when the scene is refused, ComputationError when the reference fails.
    """
    refuse_peers(former)
    for name in former:
        raise TypeError(f"trade_levels() got an unexpected keyword argument {name!r}")
    tables = one_line(as_scene(scene))
    tables.require_time()
    specs = []
    for level, asked in LEVELS.items():
        for model in MODELS:
            if model == FOLLOWING and level == "A":
                continue  # what it follows is not asked
            more = {"curvature_error": ALONG} if model == FOLLOWING else {}
            kind = "adaptive" if model == FOLLOWING else model
            specs.append((level, model, level_spec(tables, kind, f"level {level}", asked, more)))
    with interrupts() as stopped:
        store = RunStore(Path(folder), progress, 1 + len(specs), stopped)
        best, exact = store.get(level_spec(tables, "rod", "reference", REFERENCE), required=True)
        rows = []
        for level, model, spec in specs:
            row, values = store.get(replace(spec, times=repeat))
            rows.append(level_row(level, model, row, values, exact, tables.length))
    facts = (*store.facts, *([("command", f"`{command}`")] if command else []))
    table = LevelTable(tables.title, best, tuple(rows), facts)
    table.write(store.folder)
    return table


def level_row(
    level: str, model: str, row: Row, values: Mapping[str, np.ndarray], exact: Mapping[str, np.ndarray], length: float
) -> LevelRow:
    """The row of a run with its errors."""
    out = LevelRow(level, model, row.status, row.cause, cells=row.cells, steps=row.steps, runs=row.runs, cpu=row.cpu)
    if not values:
        return out
    position = float(np.linalg.norm(values["position"] - exact["position"], axis=-1).max()) / length
    out = replace(out, position=position)
    forces = [x for x in ("reaction_start", "reaction_end") if x in values and x in exact]
    largest = max((float(np.linalg.norm(exact[x], axis=-1).max()) for x in forces), default=0.0)
    if largest > 0.0:
        worst = max(float(force_difference(values[x], exact[x]).max()) for x in forces)
        out = replace(out, end_force=worst / largest)
    peak, field = (_relative(values, exact, *x) for x in (("bending_moment", True), ("curvature", False)))
    out = replace(out, moment=peak, curvature=field)
    asked = [(out.position, POSITION), (out.end_force, TENSION)]
    asked += [(out.moment, ALONG)] if level in ("B", "C") else []
    asked += [(out.curvature, ALONG)] if level == "C" else []
    return replace(out, worst=max((x / bound for x, bound in asked if x is not None), default=None))


def _relative(
    values: Mapping[str, np.ndarray], exact: Mapping[str, np.ndarray], name: str, peaks: bool
) -> float | None:
    """Largest error of a quantity (nt, ns) over its largest value; peaks: of the largest of every output."""
    if name not in values or name not in exact:
        return None
    one, other = values[name], exact[name]
    most = float(np.abs(other).max())
    if not most > 0.0:
        return None
    if peaks:
        one, other = np.abs(one).max(axis=1), np.abs(other).max(axis=1)
    return float(np.abs(one - other).max()) / most


def percent(value: float | None) -> str:
    """A part in per cent; empty where there is none."""
    return "" if value is None else f"{100.0 * value:.2g} %"
