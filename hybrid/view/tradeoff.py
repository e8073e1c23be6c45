"""Draw what a ladder of runs has found: error against CPU time, a line for every model.

The large panel shows what decides: the error over what is asked for, of the quantity where that is largest.
Beside it are the errors themselves.  Plots read rows and compute nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybrid.store.tradeoff_table import OURS, Row, TradeTable
from hybrid.view.save import save_figure
from hybrid.view.style import GREY, INK, KIND_COLOURS, NORMAL, SMALL, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours that no kind of zone has, of the same family; other codes are grey, apart by their marks.
COLOURS = {"adaptive": "#CC79A7", "zones": "#56B4E9"} | KIND_COLOURS
MARKS = {"rod": "o", "catenary": "s", "adaptive": "D", "corrected": "^", "zones": "v"}
_GUEST_MARKS = ("P", "X", "p", "d")
_MET, STAR = "#009E73", "#F0E442"
_BESIDE = 1.8  # of the smallest and largest value, times that which an axis leaves beside them
_LEAST_DECADES = 1.0  # a vertical axis spans at least so many, or differences of a few per cent would look like much
# Where the accuracy (of others: the number of elements) stands beside its point, in points of type: in turn on either
# side, so that of points that are close both can be read.
_BESIDE_A_POINT = ((7, 2), (-7, -6), (7, -8), (-7, 4))
Figures = Callable[[Row], float | None]


def plot_trade(table: TradeTable, path: str | Path | None = None, *, overwrite: bool = False) -> Figure:
    """One page: error against CPU time on logarithmic axes, the front and what is recommended marked.

    path: where to save it, as .png, .pdf or .svg (see plot_summary).
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(8.0, 5.0), dpi=150)
    FigureCanvasAgg(figure)
    head: dict[str, Any] = {"va": "top", "parse_math": False}
    figure.text(0.0125, 0.98, table.title or "(no title)", fontsize=10, fontweight="bold", color=INK, **head)
    figure.text(0.0125, 0.935, _wrapped(table.recommendation), fontsize=NORMAL, color=GREY, **head)
    body = (0.0, 0.075, 1.0, 0.79)  # left, bottom, width, height; the legend is below, the head above
    figure.set_layout_engine(ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05, wspace=0.02, hspace=0.02, rect=body))
    if not table.choices:
        figure.text(0.5, 0.5, "no run came to an end", ha="center", fontsize=NORMAL, color=GREY)
        return save_figure(figure, path, overwrite=overwrite)
    part = table.asked_for if table.asked_for.strip().endswith("%") else ""
    scale = float(part.strip().rstrip("%")) if part else 1.0
    axes = figure.subplot_mosaic([["score", "position"], ["score", "pull"]], width_ratios=[1.7, 1.0])
    panel(axes["score"], table, lambda row: scale * table.score(row), named=True)
    title = (
        "error, the larger of position (of length) and pull (of largest)" if part else "error over what is asked for"
    )
    label(axes["score"], title, "error (%)" if part else "error / asked")
    _limit(axes["score"], scale, f"asked: {table.asked_for}")
    for name, unit, bound in (("position", "m", table.bound_position), ("pull", "N", table.bound_pull)):
        if all(getattr(row, name) is None for row in table.choices):
            axes[name].set_visible(False)
            continue
        panel(axes[name], table, attrgetter(name))
        label(axes[name], f"error of {'position' if name == 'position' else 'pull at the ends'}", f"({unit})")
        if bound:
            _limit(axes[name], bound, "")
        _vague(axes[name], table.doubt(name))
    axes["position"].set_xlabel("")
    handles, names = axes["score"].get_legend_handles_labels()
    figure.legend(
        handles, names, loc="lower center", bbox_to_anchor=(0.5, 0.012), ncols=8, frameon=False, fontsize=SMALL,
        handlelength=1.8, columnspacing=1.4, labelcolor=INK,
    )  # fmt: skip
    return save_figure(figure, path, overwrite=overwrite)


def panel(ax: Axes, table: TradeTable, figure_of: Figures, named: bool = False) -> None:
    """A line for every model, its accuracies in a row; rings: the front; the star: what is recommended."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in table.choices:
        if figure_of(row):
            groups.setdefault((row.code, row.model), []).append(row)
    guests = list(dict.fromkeys(code for code, _ in groups if code != OURS))
    for (code, model), rows in groups.items():
        ours = code == OURS
        colour = COLOURS.get(model, INK) if ours else GREY
        symbol = MARKS.get(model, "h") if ours else _GUEST_MARKS[guests.index(code) % len(_GUEST_MARKS)]
        line = {"linestyle": "-" if ours else ":", "linewidth": 1.2, "markersize": 4.5, "zorder": 3}
        _points(ax, rows, figure_of, color=colour, marker=symbol, label=model if ours else code, **line)
        for k, row in enumerate(rows if named else ()):
            here = (row.cpu or 0.0, figure_of(row) or 0.0)
            said = row.asked if ours else row.asked.split()[0]
            side, up = _BESIDE_A_POINT[(list(groups).index((code, model)) + 2 * k) % len(_BESIDE_A_POINT)]
            look: dict[str, Any] = {
                "fontsize": SMALL - 1.0,
                "color": colour,
                "zorder": 6,
                "ha": "left" if side > 0 else "right",
            }
            ax.annotate(said, here, (side, up), textcoords="offset points", **look)
    hollow = {"linestyle": "", "markerfacecolor": "none", "markeredgecolor": INK, "markeredgewidth": 0.9}
    front = [row for row in table.front() if figure_of(row)]
    _points(ax, front, figure_of, marker="o", markersize=10, zorder=4, label="front", **hollow)
    best = [row for row in front if row == table.recommended]
    _points(
        ax,
        best,
        figure_of,
        marker="*",
        markersize=15,
        zorder=5,
        label="take this",
        **hollow | {"markerfacecolor": STAR},
    )
    costs = [row.cpu for rows in groups.values() for row in rows if row.cpu]
    errors = [y for rows in groups.values() for row in rows if (y := figure_of(row))]
    if costs:
        ax.set_xlim(*_spanned(min(costs), max(costs)))
        ax.set_ylim(*_spanned(min(errors), max(errors)))


def _points(ax: Axes, rows: list[Row], figure_of: Figures, **look: Any) -> None:
    if rows:
        ax.plot([row.cpu or 0.0 for row in rows], [figure_of(row) or 0.0 for row in rows], **look)


def label(ax: Axes, title: str, up: str) -> None:
    """Logarithmic axes with numbers that people write."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low_high = ax.get_xlim(), ax.get_ylim()
    style(ax, title, "CPU time (s)", up)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(*low_high[0])
    ax.set_ylim(*low_high[1])
    for axis, (low, high) in zip((ax.xaxis, ax.yaxis), low_high, strict=True):
        wide = high / low > 300.0  # beyond that only powers of ten have room
        axis.set_major_locator(LogLocator(10.0, subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=12))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def _spanned(low: float, high: float) -> tuple[float, float]:
    low, high = low / _BESIDE, high * _BESIDE
    short = 10.0**_LEAST_DECADES / (high / low)
    return (low / short**0.5, high * short**0.5) if short > 1.0 else (low, high)


def _limit(ax: Axes, value: float, text: str) -> None:
    """What is asked for: below it is met."""
    low, high = ax.get_ylim()
    if not low < value < 3.0 * high:  # a line far from every point would squeeze them
        return
    if value > high / 1.2:
        ax.set_ylim(low, 1.5 * value)
    ax.axhline(value, color=_MET, linewidth=1.0, linestyle="--", zorder=2)
    ax.axhspan(low, value, color=_MET, alpha=0.05, linewidth=0, zorder=0)
    _say(ax, text, (1.0, value), (-4, 3), ha="right", color=_MET)


def _vague(ax: Axes, doubt: float) -> None:
    """Below the error of the reference nothing is known."""
    low, _ = ax.get_ylim()
    if doubt > low:
        ax.axhspan(low, doubt, color=GREY, alpha=0.18, linewidth=0, zorder=0)
        _say(ax, "error of the reference", (0.0, doubt), (4, -3), va="top", color=GREY)


def _say(ax: Axes, text: str, at: tuple[float, float], beside: tuple[float, float], **look: Any) -> None:
    """A word at a height of the axis, x from 0 to 1."""
    where: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    ax.annotate(text, at, beside, fontsize=SMALL, **where, **look)


def _wrapped(text: str, width: int = 128) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(text, width)[:2])
