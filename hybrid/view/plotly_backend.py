"""Figures for a page: panels as plotly's dictionaries, with references into a `Store` in place of arrays.

Texts may come from a scene and are escaped: plotly reads tags in them. Long curves keep the lowest and highest value
of every short stretch.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from hybrid.view.curves import Store, outline
from hybrid.view.figure import GREY, INK, Area, Axis, Band, Box, Item, Line, Map, Marks, Panel, Rule, Text

Spec = dict[str, Any]
# Of matplotlib's names of marks, plotly's. Screens are coarser than paper: marks and lines are larger there.
_SYMBOLS = {
    "o": "circle", "s": "square", "^": "triangle-up", "v": "triangle-down", "D": "diamond", "+": "cross", "x": "x",
    "X": "x",
}  # fmt: skip
_LARGER, _WIDER = 2.7, 1.25
_FONT = "system-ui, sans-serif"


def figure_of(panel: Panel, store: Store) -> Spec:
    """What the page's script draws: data and layout, and which curve moves with time."""
    (left, right), (low, high) = panel.limits()
    figure: Spec = {"data": [], "layout": _layout(panel, (left, right), (low, high))}
    readable = not any(isinstance(item, Map) for item in panel.items)
    for item in panel.items:
        if isinstance(item, Line) and item.frames is not None:
            figure["now"] = {"trace": len(figure["data"]), "frames": store.add(item.frames)}
        if isinstance(item, Box | Rule):
            figure["layout"].setdefault("shapes", []).extend(_shapes(item))
        elif isinstance(item, Text):
            figure["layout"].setdefault("annotations", []).append(_annotation(item))
        else:
            figure["data"] += _traces(item, store, panel.y.unit if readable else None)
    seen: set[str] = set()
    for trace in (trace for trace in (*figure["data"], *figure["layout"].get("shapes", ())) if "name" in trace):
        trace["showlegend"] = bool(trace["name"]) and trace["name"] not in seen
        trace["legendgroup"] = trace["name"]
        seen.add(trace["name"])
    return figure | ({"cursor": True} if panel.cursor else {})


def colour_scale(colours: Sequence[str]) -> list[list[Any]]:
    return [[k / (len(colours) - 1), colour] for k, colour in enumerate(colours)]


def _layout(panel: Panel, across: tuple[float, float], up: tuple[float, float]) -> Spec:
    def axis(of: Axis, limits: tuple[float, float]) -> Spec:
        named = {"tickvals": list(of.ticks), "ticktext": [escape(x) for x in of.names]} if of.names else {}
        return named | {
            "title": {"text": escape(of.label), "standoff": 6}, "range": list(limits), "showgrid": panel.grid,
            "zeroline": False, "gridcolor": "#EDEDED", "linecolor": "#BDBDBD", "ticks": "outside", "ticklen": 4,
            "tickcolor": "#BDBDBD", "automargin": True, "exponentformat": "SI",
        }  # fmt: skip

    up_axis = axis(panel.y, up)
    if panel.aspect:
        up_axis |= {"scaleanchor": "x", "scaleratio": panel.aspect}
    return {
        "font": {"family": _FONT, "size": 13, "color": INK},
        "margin": {"l": 56, "r": 22, "t": 32, "b": 44},  # at the top plotly's buttons, the legend at the foot
        "paper_bgcolor": "#FFFFFF", "plot_bgcolor": panel.fill,
        "hovermode": "closest" if any(isinstance(item, Map) for item in panel.items) else "x",
        "xaxis": axis(panel.x, across), "yaxis": up_axis,
        "legend": {"orientation": "h", "tracegroupgap": 0, "x": 0, "y": 0, "yanchor": "bottom", "yref": "container"}
        | {"font": {"size": 12}},
        "hoverlabel": {"bgcolor": "#FFFFFF", "bordercolor": "#9E9E9E", "align": "left"}
        | {"font": {"size": 12, "color": INK, "family": _FONT}},
    }  # fmt: skip


def _annotation(item: Text) -> Spec:
    across, up = ("x domain" if "x" in item.parts else "x"), ("y domain" if "y" in item.parts else "y")
    return {
        "text": escape(item.text), "x": item.x, "y": item.y, "xref": across, "yref": up, "showarrow": False,
        "xanchor": item.across, "yanchor": "bottom" if item.up == "baseline" else item.up,
        "xshift": item.offset[0], "yshift": item.offset[1], "font": {"color": item.colour, "size": _WIDER * item.size},
    }  # fmt: skip


def _traces(item: Item, store: Store, unit: str | None) -> list[Spec]:
    """unit: of values that are read off a curve; None: on a map its cells and marks are to be read, no curves."""
    match item:
        case Line():
            return _line(item, store, unit)
        case Marks():
            marker = {"symbol": _SYMBOLS[item.symbol], "color": item.face, "size": _LARGER * item.size}
            marker["line"] = {"color": item.edge, "width": 1}
            texts = ["<br>".join([f"<b>{escape(head)}</b>", *map(escape, lines)]) for head, *lines in item.texts]
            hover = {"text": texts, "hovertemplate": "%{text}<extra></extra>"} if texts else {"hoverinfo": "skip"}
            # with no point at all, an entry of the legend alone
            x, y = (values.tolist() if len(values) else [None] for values in (item.x, item.y))
            trace = {"type": "scatter", "mode": "markers", "name": escape(item.label), "marker": marker, "x": x, "y": y}
            return [trace | {"cliponaxis": False} | hover]
        case Band():
            known = np.flatnonzero(np.isfinite(item.low) & np.isfinite(item.high))
            known = known[np.union1d(outline(item.low[known]), outline(item.high[known]))]
            x, low, high = item.x[known], item.low[known], item.high[known]
            around = {"x": store.add(np.append(x, x[::-1])), "y": store.add(np.append(low, high[::-1]))}
            look = {
                "mode": "lines",
                "fill": "toself",
                "fillcolor": _rgba(item.colour, item.opacity),
                "line": {"width": 0},
            }
            return [{"type": "scatter", "name": escape(item.label), "hoverinfo": "skip"} | around | look]
        case Area():
            gaps = np.full((len(item.outlines), 1, 2), np.nan)
            x, y = np.concatenate([item.outlines, gaps], axis=1).reshape(-1, 2).T
            filled: Spec = {"type": "scatter", "name": escape(item.label), "mode": "lines", "line": {"width": 0}}
            filled |= {"x": store.add(x), "y": store.add(y), "fill": "toself", "fillcolor": item.fill}
            return [filled | {"hoverinfo": "skip"}]
        case Map():
            values = store.add(item.values)
            low, high = (float(np.log10(x)) if item.log else x for x in (item.low, item.high))
            template = (
                f"{item.name}: {item.quantity} %{{customdata:.4g}} {item.unit}<br>t = %{{x:.5g}} s, s = %{{y:.4g}} m"
            )
            return [
                {"type": "heatmap", "x": store.add(item.x), "y": store.add(item.y), "z": values | {"log": item.log}}
                | {"customdata": values, "colorscale": colour_scale(item.shades), "showscale": False, "zmin": low}
                | {"zmax": high, "hovertemplate": f"{template}<extra>{item.name}</extra>"}
            ]
    raise TypeError(f"a page does not draw {type(item).__name__}")


def _line(item: Line, store: Store, unit: str | None) -> list[Spec]:
    k = outline(item.y) if np.isfinite(item.x).all() else np.arange(len(item.x))  # of pieces every one is needed
    around = {"type": "scatter", "mode": "lines", "x": store.add(item.x[k]), "y": store.add(item.y[k])}
    look: Spec = {"color": item.colour, "width": _WIDER * item.width} | ({"dash": item.dash} if item.dash else {})
    line = around | {"name": escape(item.label), "line": look}
    line |= {"hoverinfo": "skip"} if unit is None else {"hovertemplate": f"%{{y:.5g}} {unit}"}
    if not item.casing:
        return [line]
    wider = line | {"line": look | {"color": item.casing, "width": look["width"] + 2.0}}
    return [wider | {"name": ""}, line] if item.colour == INK else [wider, line | {"name": ""}]  # the dark one is named


def _shapes(item: Box | Rule) -> list[Spec]:
    if isinstance(item, Box):
        fill = {
            "type": "rect",
            "fillcolor": item.colour,
            "opacity": item.opacity,
            "line": {"width": 0},
            "layer": "below",
        }
        return [fill | _ends("x", item.x) | _ends("y", item.y)]
    look = {"color": item.colour, "width": _WIDER * item.width, "dash": item.dash}
    other = "y" if item.axis == "x" else "x"
    line = {"type": "line", "line": look, "layer": "below", "name": escape(item.label)} | _ends(other, None)
    return [line | _ends(item.axis, (at, at)) for at in item.at]


def _ends(axis: str, ends: tuple[float, float] | None) -> Spec:
    low, high = ends or (0, 1)
    return {f"{axis}ref": axis if ends else "paper", f"{axis}0": low, f"{axis}1": high}


def _rgba(colour: str, alpha: float) -> str:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{alpha:g})"


# Small drawings for a notebook cell and the still picture of a report: panels above one another as SVG.
#
# Made by hand: 1 ms and 17 kB for a run of 500 outputs, where matplotlib's SVG takes 50 ms, 47 kB, and 0.4 s to import.

WIDTH = 460.0  # of a drawing, px
_TALLEST, _STRIP, _FOOT = 280.0, 26.0, 24.0  # of a panel with an aspect, of one without, and of the texts below one
_EDGE = 2.0  # left and right
_LETTER = 7.0  # width of a letter, px, at most
_PIXELS = 1.2  # for each point of a line's width


def draw(panels: list[Panel]) -> str:
    """One drawing of all panels, without axes; below each its caption, and the names of its kinds in their colours."""
    parts, y, width = "", 0.0, WIDTH - 2.0 * _EDGE
    for panel in panels:
        (left, right), (low, high) = panel.limits()
        across, up, height = width / (right - left), _STRIP / (high - low), _STRIP
        if panel.aspect is not None:
            across = min(across, _TALLEST / (panel.aspect * (high - low)))
            up = panel.aspect * across
            height = max(up * (high - low), 40.0)
        place = _Place(0.5 * width, 0.5 * (left + right), across, 0.5 * height, 0.5 * (low + high), up)
        size = f'x="{_EDGE:g}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}"'  # what is outside is cut off
        parts += f"<svg {size}>{''.join(_item(item, place) for item in panel.items)}</svg>"
        y += height + _FOOT
        parts += f'<text x="{_EDGE:g}" y="{y - 10:.0f}" fill="{GREY}">{escape(panel.caption)}</text>'
        parts += _names(panel, y - 10)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {y:.0f}" width="100%" role="img" '
        f'aria-label="shape of the cable" font-family="system-ui,sans-serif" font-size="11">{parts}</svg>'
    )


class _Place(NamedTuple):
    """From data to pixels: the middle of the panel in both, and pixels per unit."""

    x0: float
    left: float
    across: float
    y0: float
    low: float
    up: float

    def x(self, value: float) -> float:
        return self.x0 + self.across * (value - self.left)

    def y(self, value: float) -> float:
        return self.y0 - self.up * (value - self.low)


def _item(item: Item, at: _Place) -> str:
    match item:
        case Line():
            points = " ".join(f"{at.x(x):.1f},{at.y(y):.1f}" for x, y in zip(item.x, item.y, strict=True))
            look = f'fill="none" stroke="{item.colour}" stroke-width="{_PIXELS * item.width:g}" stroke-linejoin="round"'
            return f'<polyline points="{points}" {look}/>'
        case Marks():
            look = f'r="{0.5 * item.size:g}" fill="{item.face or "none"}" stroke="{item.edge}"'
            places = zip(item.x, item.y, strict=True)
            return "".join(f'<circle cx="{at.x(x):.1f}" cy="{at.y(y):.1f}" {look}/>' for x, y in places)
        case Area():
            outlines = (" ".join(f"{at.x(x):.1f},{at.y(y):.1f}" for x, y in points) for points in item.outlines)
            return "".join(f'<polygon points="{points}" fill="{item.fill}"/>' for points in outlines)
        case Box(x=(x0, x1), y=(y0, y1)):
            left, top = round(at.x(x0)), at.y(y1)  # in whole pixels, or seams show between neighbours
            size = f'width="{round(at.x(x1)) - left}" height="{at.y(y0) - top:.1f}"'
            return f'<rect x="{left}" y="{top:.1f}" {size} fill="{item.colour}"/>'
        case Text():
            x, y = at.x(item.x) + item.offset[0], at.y(item.y) - item.offset[1]
            anchor, lift = "end" if item.across == "right" else "start", -2.0 if item.up == "bottom" else 10.0
            y = min(max(y + lift, 10.0), 2.0 * at.y0 - 3.0)  # all of the text is in the frame
            look = f'text-anchor="{anchor}" fill="{item.colour}"'
            return f'<text x="{x:.0f}" y="{y:.0f}" {look}>{escape(item.text)}</text>'
    raise TypeError(f"a small drawing does not show {type(item).__name__}")


def _names(panel: Panel, y: float) -> str:
    parts, x, caption = "", WIDTH - _EDGE, _LETTER * len(panel.caption)
    names = {item.label: item.colour for item in panel.items if isinstance(item, Line | Box) and item.label}
    if x - sum(_LETTER * len(name) + 8.0 for name in names) < caption:  # no room beside it
        return ""
    for name, colour in reversed(names.items()):
        parts += f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="end" fill="{colour}">{escape(name)}</text>'
        x -= _LETTER * len(name) + 8.0
    return parts
