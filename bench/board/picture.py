"""The picture: error against CPU time, a panel to every problem and a marker to every program."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from board.answers import Answer, Problem

LOOKS = {
    "hybrid": ("o", "#c2410c"), "CableDyn": ("s", "#1d4ed8"), "MoorDyn": ("^", "#047857"),
    "Exudyn": ("D", "#7c3aed"), "PyElastica": ("v", "#525252"),
    "MoorPy": ("P", "#0e7490"),
}  # fmt: skip
LEAST = 1e-5  # smaller errors are drawn there
INK, FAINT = "#262626", "#d4d4d4"


def points(problem: Problem) -> list[tuple[Answer, float, float]]:
    """Answers that have an error and a cost: error, CPU time (s)."""
    found = [(x, problem.largest_error(x), x.cpu) for x in problem.answers]
    return [(x, max(error, LEAST), cpu) for x, error, cpu in found if error is not None and cpu]


def drawn(problems: list[Problem]) -> list[Problem]:
    """Problems with something to draw, and one truth."""
    return [x for x in problems if points(x) and not x.disputed]


def limits(values: list[float]) -> tuple[float, float]:
    """With room beside the outermost."""
    return min(values) / 2.5, max(values) * 2.5


def percent(value: float, _: object = None) -> str:
    return f"{100 * value:g} %"


def seconds(value: float, _: object = None) -> str:
    return f"{value:g} s"


def panel(axes: Axes, problem: Problem) -> None:
    """One problem."""
    for answer, error, cpu in reversed(points(problem)):  # ours, which come first, on top
        marker, colour = LOOKS[answer.program.split()[0]]
        axes.loglog(
            error, cpu, marker, color=colour, markersize=8, markeredgecolor="white", markeredgewidth=0.8, zorder=3
        )
    axes.set_title(problem.title, loc="left", fontsize=9.5, color=INK, pad=6)
    axes.grid(True, which="major", color=FAINT, linewidth=0.6, zorder=0)
    axes.tick_params(which="both", length=0, labelsize=8, labelcolor=INK)
    for side in axes.spines.values():
        side.set_color(FAINT)
    axes.xaxis.set_major_locator(LogLocator(numticks=12))
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(percent))
    axes.yaxis.set_major_formatter(FuncFormatter(seconds))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())


def figure(problems: list[Problem], columns: int = 3) -> Figure:
    """All problems on the same axes, lower left is best."""
    shown = drawn(problems)
    columns = min(columns, len(shown))
    rows = math.ceil(len(shown) / columns)
    drawing = Figure(figsize=(3.5 * columns + 0.6, 2.5 * rows + 1.0), layout="constrained", facecolor="white")
    grid = drawing.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    everything = [x for problem in shown for x in points(problem)]
    used = list(dict.fromkeys(answer.program.split()[0] for answer, _, _ in everything))
    for axes, problem in zip(grid.flat, shown, strict=False):
        panel(axes, problem)
    for axes in list(grid.flat)[len(shown) :]:
        axes.set_axis_off()
    for k, axes in enumerate(grid.flat):
        if k + columns >= len(shown):
            axes.xaxis.set_tick_params(labelbottom=True)
    grid[0][0].set_xlim(*limits([error for _, error, _ in everything]))
    grid[0][0].set_ylim(*limits([cpu for _, _, cpu in everything]))
    drawing.supxlabel("largest error against the reference (left and down is better)", fontsize=9.5, color=INK)
    drawing.supylabel("CPU time", fontsize=9.5, color=INK)
    marks = [drawing.axes[0].plot([], [], LOOKS[x][0], color=LOOKS[x][1], markersize=8, label=x)[0] for x in used]
    drawing.legend(handles=marks, loc="outside upper left", ncols=len(used), frameon=False, fontsize=9.5)
    return drawing


def draw(problems: list[Problem], file: Path) -> None:
    """Write the picture, as a palette that keeps it small; nothing where no problem has an error and a cost."""
    if not drawn(problems):
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    figure(problems).savefig(file, dpi=130)
