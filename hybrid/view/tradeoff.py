"""The page of a tradeoff study: error against CPU time, a line for every model.

The large panel shows the error relative to the target accuracy, of the quantity where it is largest.
Beside it are the errors themselves. Pages read rows and compute nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.store.tradeoff_table import OURS, Row, TradeTable
from hybrid.view.figure import GREY, INK, KIND_COLOURS, SMALL, Axis, Box, Item, Line, Marks, Page, Panel, Rule, Text
from hybrid.view.save import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours that no kind of zone has, of the same family; other codes are grey, apart by their marks.
COLOURS = {"adaptive": "#CC79A7", "zones": "#56B4E9"} | KIND_COLOURS
MARKS = {"rod": "o", "catenary": "s", "adaptive": "D", "zones": "v"}
_PEER_MARKS = ("P", "X", "p", "d")
_MET, STAR = "#009E73", "#F0E442"
_BESIDE = 1.8  # of the smallest and largest value, times that which an axis leaves beside them
_LEAST_DECADES = 1.0  # a vertical axis spans at least so many, or differences of a few per cent would look like much
# Where the accuracy (of others: the number of elements) stands beside its point, in points of type: in turn on either
# side, so that of points that are close both can be read.
_BESIDE_A_POINT = ((7, 2), (-7, -6), (7, -8), (-7, 4))
_SIZE = (8.0, 5.0)  # of the page, inches
Figures = Callable[[Row], float | None]


def plot_trade(table: TradeTable, path: str | Path | None = None, *, overwrite: bool = False) -> Figure:
    """One page: error against CPU time on logarithmic axes, the front and what is recommended marked.

    path: where to save it, as .png, .pdf or .svg (see plot_summary).
    """
    from hybrid.view.matplotlib_backend import draw_page

    return save_figure(draw_page(_page(table)), path, overwrite=overwrite)


def _page(table: TradeTable) -> Page:
    if not table.choices:
        return Page(table.title or "(no title)", table.recommendation, 2, size=_SIZE, empty="no finished run")
    part = table.target if table.target.strip().endswith("%") else ""
    scale = float(part.strip().rstrip("%")) if part else 1.0
    title, up = "error relative to the target accuracy", ("error / target", "")
    if part:
        title, up = "larger error: position / length, end force / largest", ("error", "%")
    asked = (scale, f"target {table.target}")
    panels = {"score": _panel(table, title, up, lambda row: scale * table.score(row), asked, named=True)}
    for name, unit, bound in (("position", "m", table.bound_position), ("end_force", "N", table.bound_end_force)):
        if any(getattr(row, name) is not None for row in table.choices):
            title = f"error of {'position' if name == 'position' else 'end forces'}"
            limit, doubt = (bound, ""), table.doubt(name)
            panels[name] = _panel(table, title, ("", unit), attrgetter(name), limit, doubt=doubt)
    mosaic = [["score", name if name in panels else "."] for name in ("position", "end_force")]
    look: dict[str, Any] = {"mosaic": mosaic, "widths": [1.7, 1.0], "legend": ["score"], "size": _SIZE}
    return Page(table.title or "(no title)", table.recommendation, 2, panels, **look)


def _panel(
    table: TradeTable,
    title: str,
    up: tuple[str, str],
    figure_of: Figures,
    limit: tuple[float | None, str],
    *,
    doubt: float = 0.0,
    named: bool = False,
) -> Panel:
    """A line for every model, its accuracies in a row; rings: the front; the star: what is recommended.

    limit: the target and its label; doubt: the error of the reference; named: accuracies beside their points.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in table.choices:
        if figure_of(row):
            groups.setdefault((row.code, row.model), []).append(row)
    peers = list(dict.fromkeys(code for code, _ in groups if code != OURS))
    items: list[Item] = []
    for n, ((code, model), rows) in enumerate(groups.items()):
        ours = code == OURS
        colour = COLOURS.get(model, INK) if ours else GREY
        symbol = MARKS.get(model, "h") if ours else _PEER_MARKS[peers.index(code) % len(_PEER_MARKS)]
        dash, name = ("", model) if ours else ("dot", code)
        items.append(Line(*_places(rows, figure_of), name, colour, 1.2, dash, symbol=symbol, size=4.5))
        for k, row in enumerate(rows if named else ()):
            text = row.asked if ours else row.asked.split()[0]
            side, lift = _BESIDE_A_POINT[(n + 2 * k) % len(_BESIDE_A_POINT)]
            x, y = row.cpu or 0.0, figure_of(row) or 0.0
            across = "left" if side > 0 else "right"
            items.append(Text(x, y, text, colour, (side, lift), across, "baseline", SMALL - 1.0))
    front = [row for row in table.front() if figure_of(row)]
    best = [row for row in front if row == table.recommended]
    for chosen, symbol, name, face, size in (
        (front, "o", "Pareto front", "", 10.0),
        (best, "*", "recommended", STAR, 15.0),
    ):
        items += [Marks(*_places(chosen, figure_of), symbol, name, face, INK, 0.9, size)] * bool(chosen)
    costs = [row.cpu for rows in groups.values() for row in rows if row.cpu]
    errors = [z for rows in groups.values() for row in rows if (z := figure_of(row))]
    left, right = _spanned(min(costs), max(costs)) if costs else (0.1, 1.0)
    low, high = _spanned(min(errors), max(errors)) if errors else (0.1, 1.0)
    value, text = limit
    if value and low < value < 3.0 * high:  # a line far from every point would squeeze them
        high = 1.5 * value if value > high / 1.2 else high
        items += [Box(None, (low, value), colour=_MET, opacity=0.05), Rule("y", [value], "", _MET, 1.0, "dash")]
        items.append(Text(1.0, value, text, _MET, (-4.0, 3.0), "right", parts="x"))
    if doubt > low:  # below the error of the reference nothing is known
        items.append(Box(None, (low, doubt), colour=GREY, opacity=0.18))
        items.append(Text(0.0, doubt, "error of the reference", GREY, (4.0, -3.0), up="top", parts="x"))
    cpu = Axis("CPU time", "s", left, right, log=True)
    return Panel("trade", title, cpu, Axis(*up, low, high, log=True), items)


def _places(rows: list[Row], figure_of: Figures) -> tuple[np.ndarray, np.ndarray]:
    return np.array([row.cpu or 0.0 for row in rows]), np.array([figure_of(row) or 0.0 for row in rows])


def _spanned(low: float, high: float) -> tuple[float, float]:
    low, high = low / _BESIDE, high * _BESIDE
    short = 10.0**_LEAST_DECADES / (high / low)
    return (low / short**0.5, high * short**0.5) if short > 1.0 else (low, high)
