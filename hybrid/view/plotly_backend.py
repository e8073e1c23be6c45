"""Figures for a page: panels as plotly's dictionaries, with references into a `Store` in place of arrays, and as SVG.

Texts may come from a scene and are escaped: plotly reads tags in them. Long curves keep the lowest and highest value
of every short stretch.
"""

from __future__ import annotations

import math
import struct
import zlib
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from hybrid.view.curves import Store, outline
from hybrid.view.figure import GREY, INK, SMALL, Area, Axis, Band, Box, Item, Line, Map, Marks, Panel, Rule, Text

Spec = dict[str, Any]
# Of matplotlib's names of marks, plotly's. Screens are coarser than paper: marks and lines are larger there.
_SYMBOLS = {"o": "circle", "s": "square", "^": "triangle-up", "v": "triangle-down", "D": "diamond"}
_SYMBOLS |= {"+": "cross", "x": "x", "X": "x"}
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
        named |= {"title": {"text": escape(of.label), "standoff": 6}, "range": list(limits), "showgrid": panel.grid}
        ticks = {"ticks": "outside", "ticklen": 4, "tickcolor": "#BDBDBD", "exponentformat": "SI"}
        lines = {"zeroline": False, "gridcolor": "#EDEDED", "linecolor": "#BDBDBD", "automargin": True}
        return named | ticks | lines

    up_axis = axis(panel.y, up)
    if panel.aspect:
        up_axis |= {"scaleanchor": "x", "scaleratio": panel.aspect}
    return {
        "font": {"family": _FONT, "size": 13, "color": INK},
        "margin": {"l": 56, "r": 22, "t": 32, "b": 44},  # at the top plotly's buttons, the legend at the foot
        "paper_bgcolor": "#FFFFFF",
        "plot_bgcolor": panel.fill,
        "hovermode": "closest" if any(isinstance(item, Map) for item in panel.items) else "x",
        "xaxis": axis(panel.x, across),
        "yaxis": up_axis,
        "legend": {"orientation": "h", "tracegroupgap": 0, "x": 0, "y": 0, "yanchor": "bottom", "yref": "container"}
        | {"font": {"size": 12}},
        "hoverlabel": {"bgcolor": "#FFFFFF", "bordercolor": "#9E9E9E", "align": "left"}
        | {"font": {"size": 12, "color": INK, "family": _FONT}},
    }


def _annotation(item: Text) -> Spec:
    across, up = ("x domain" if "x" in item.parts else "x"), ("y domain" if "y" in item.parts else "y")
    place = {"x": item.x, "y": item.y, "xref": across, "yref": up, "xshift": item.offset[0], "yshift": item.offset[1]}
    anchors = {"xanchor": item.across, "yanchor": "bottom" if item.up == "baseline" else item.up}
    font = {"color": item.colour, "size": _WIDER * item.size}
    return {"text": escape(item.text), "showarrow": False, "font": font} | place | anchors


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


# Graphs as SVG, with axes and legends: for paper, without JavaScript, and until plotly draws.
#
# Made by hand: some 1 ms and 10 kB each, and no library is imported.

# px; type is readable where a page shows it half as wide as a screen, on a phone and in a column of A4.
WIDTH, HEIGHT = 440.0, 264.0
MAP_WIDTH, MAP_HEIGHT = 620.0, 300.0  # a map has a row of its own
SHAPE_HEIGHT = 420.0  # px, of a shape, which has one, too
_TYPE, _TICK_TYPE = 12, 11
_LETTER = 0.56  # width of a letter on average, of the size of the type
_TOP, _RIGHT, _FOOT, _ROW = 8.0, 10.0, 36.0, 16.0
_MOST_POINTS = 440  # of a curve: two for every two pixels
_PIXELS = (400, 160)  # of a map
_TICKS_ACROSS, _TICKS_UP = 6, 5
_RADIUS = 0.62  # px of a mark for each point of its size
_GRID, _FRAME = "#EDEDED", "#BDBDBD"
_DASHES = {"": "", "dash": ' stroke-dasharray="6 3"', "dot": ' stroke-dasharray="1.5 3"'}


class _Place(NamedTuple):
    """From data to px: limits, and the rectangle of the axes."""

    low: tuple[float, float]
    high: tuple[float, float]
    left: float
    right: float
    top: float
    bottom: float

    def x(self, value: np.ndarray | float) -> np.ndarray:
        part = (np.asarray(value, float) - self.low[0]) / (self.high[0] - self.low[0])
        return np.asarray(self.left + part * (self.right - self.left))

    def y(self, value: np.ndarray | float) -> np.ndarray:
        part = (np.asarray(value, float) - self.low[1]) / (self.high[1] - self.low[1])
        return np.asarray(self.bottom - part * (self.bottom - self.top))


def draw_graph(panel: Panel) -> str:
    """The panel with axes and legend as an SVG element of the class `still`.  ValueError: an axis is logarithmic."""
    if panel.x.log or panel.y.log:
        raise ValueError(f"{panel.key}: a page has no logarithmic axes")
    (left, right), (low, high) = _of_one_scale(panel)
    width, height = _size(panel)
    across, up = ticks_of(panel.x, left, right, _TICKS_ACROSS), ticks_of(panel.y, low, high, _TICKS_UP)
    entries = _legend(panel.items, width)
    rows = max((row for row, *_ in entries), default=-1) + 1
    wide = max((len(text) for _, text in up), default=0) * _LETTER * _TICK_TYPE
    place = _Place((left, low), (right, high), 24.0 + wide, width - _RIGHT, _TOP, height - _FOOT - rows * _ROW)
    behind = [item for item in panel.items if isinstance(item, Box | Map)]
    before = [item for item in panel.items if not isinstance(item, Box | Map)]
    size = f'x="{place.left:.1f}" y="{place.top:g}" width="{place.right - place.left:.1f}" '
    size += f'height="{place.bottom - place.top:.1f}"'
    view = f'viewBox="{place.left:.1f} {place.top:g} {place.right - place.left:.1f} {place.bottom - place.top:.1f}"'
    inside = f'<svg {size} {view} preserveAspectRatio="none">'  # what is outside is cut off
    parts = [
        f'<rect {size} fill="{panel.fill}"/>{inside}{"".join(_drawn(item, place) for item in behind)}</svg>',
        "".join(_axis(panel, place, across, up)),
        f"{inside}{''.join(_drawn(item, place) for item in before)}</svg>",
        "".join(_entry(height, rows, *entry) for entry in entries),
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="still" viewBox="0 0 {width:g} {height:g}" role="img" '
        f'aria-label="{escape(panel.title)}" font-family="system-ui,sans-serif" font-size="{_TICK_TYPE}" '
        f'fill="{INK}">{"".join(parts)}</svg>'
    )


def _size(panel: Panel) -> tuple[float, float]:
    """Of a drawing, px: a map has a row of its own, and so has a shape."""
    if panel.aspect is not None:
        return MAP_WIDTH, SHAPE_HEIGHT
    return (MAP_WIDTH, MAP_HEIGHT) if any(isinstance(x, Map) for x in panel.items) else (WIDTH, HEIGHT)


def _of_one_scale(panel: Panel) -> tuple[tuple[float, float], tuple[float, float]]:
    """The limits of a panel, of which one pair is wider where both axes are to have one scale."""
    across, up = panel.limits()
    if panel.aspect is None:
        return across, up
    width, height = _size(panel)
    wide = (width - 60.0) / (height - 70.0)  # of the axes, about: beside numbers and legend
    ratio = (across[1] - across[0]) / (panel.aspect * (up[1] - up[0])) / wide
    return _wider(across, max(1.0 / ratio, 1.0)), _wider(up, max(ratio, 1.0))


def _wider(limits: tuple[float, float], factor: float) -> tuple[float, float]:
    middle, half = 0.5 * (limits[0] + limits[1]), 0.5 * factor * (limits[1] - limits[0])
    return middle - half, middle + half


# --- axes -------------------------------------------------------------------------------------------


def ticks_of(axis: Axis, low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Round numbers on an axis, at most so many, with their texts; those of the axis where it has its own."""
    if axis.ticks:
        names = axis.names or [f"{x:g}" for x in axis.ticks]
        return [(x, name) for x, name in zip(axis.ticks, names, strict=True) if low <= x <= high]
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(k * power for k in (1.0, 2.0, 5.0, 10.0) if k * power >= rough * (1.0 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    places = max(-math.floor(math.log10(step) + 1e-9), 0)
    large = max(abs(low), abs(high))
    if places > 4 or large >= 1e6:
        digits = max(math.floor(math.log10(large)) - math.floor(math.log10(step) + 1e-9) + 1, 1)
        return [(k * step, f"{k * step:.{digits}g}") for k in range(first, last + 1)]
    return [(k * step, f"{k * step + 0.0:.{places}f}") for k in range(first, last + 1)]


def _axis(
    panel: Panel, place: _Place, across: Sequence[tuple[float, str]], up: Sequence[tuple[float, str]]
) -> Iterator[str]:
    """Grid, numbers and names of both axes."""
    a, b, top, bottom = place.left, place.right, place.top, place.bottom
    for value, text in across:
        x = float(place.x(value))
        yield f'<path d="M{x:.1f} {top:g}V{bottom:.1f}" stroke="{_GRID}"/>' * panel.grid
        yield f'<path d="M{x:.1f} {bottom:.1f}v4" stroke="{_FRAME}"/>'
        yield f'<text x="{x:.1f}" y="{bottom + 15:.1f}" text-anchor="middle">{text}</text>'
    for value, text in up:
        y = float(place.y(value))
        yield f'<path d="M{a:.1f} {y:.1f}H{b:.1f}" stroke="{_GRID}"/>' * panel.grid
        yield f'<path d="M{a - 4:.1f} {y:.1f}h4" stroke="{_FRAME}"/>'
        yield f'<text x="{a - 7:.1f}" y="{y + 4:.1f}" text-anchor="end">{escape(text)}</text>'
    yield f'<path d="M{a:.1f} {top:g}V{bottom:.1f}H{b:.1f}" fill="none" stroke="{_FRAME}"/>'
    middle = 0.5 * (top + bottom)
    look = f'font-size="{_TYPE}" text-anchor="middle"'
    yield f'<text x="{0.5 * (a + b):.1f}" y="{bottom + 31:.1f}" {look}>{escape(panel.x.label)}</text>'
    turn = f'transform="rotate(-90 12 {middle:.1f})"'
    yield f'<text x="12" y="{middle:.1f}" {turn} {look}>{escape(panel.y.label)}</text>'


# --- items ------------------------------------------------------------------------------------------


def _drawn(item: Item, at: _Place) -> str:
    match item:
        case Line():
            return _curve(item, at)
        case Marks():
            shown = np.isfinite(item.x) & np.isfinite(item.y)
            places = zip(at.x(item.x[shown]), at.y(item.y[shown]), strict=True)
            return "".join(_mark(item, x, y) for x, y in places)
        case Band():
            known = np.flatnonzero(np.isfinite(item.low) & np.isfinite(item.high))
            kept = np.union1d(outline(item.low[known], _MOST_POINTS), outline(item.high[known], _MOST_POINTS))
            known = known[kept]
            x = np.append(item.x[known], item.x[known][::-1])
            y = np.append(item.low[known], item.high[known][::-1])
            return f'<path d="{_path(at.x(x), at.y(y))}" fill="{item.colour}" fill-opacity="{item.opacity:g}"/>'
        case Area():
            paths = (_path(at.x(x[:, 0]), at.y(x[:, 1])) for x in item.outlines)
            return f'<path d="{"".join(f"{path}Z" for path in paths if path)}" fill="{item.fill}"/>'
        case Box():
            a, b = (at.left, at.right) if item.x is None else (float(at.x(x)) for x in item.x)
            c, d = (at.bottom, at.top) if item.y is None else (float(at.y(y)) for y in item.y)
            size = f'x="{a:.1f}" y="{d:.1f}" width="{max(b - a, 0.0):.1f}" height="{max(c - d, 0.0):.1f}"'
            return f'<rect {size} fill="{item.colour}" fill-opacity="{item.opacity:g}"/>'
        case Rule():
            look = f'stroke="{item.colour}" stroke-width="{item.width:g}"{_DASHES[item.dash]}'
            if item.axis == "x":
                return "".join(f'<path d="M{at.x(x):.1f} {at.top:g}V{at.bottom:.1f}" {look}/>' for x in item.at)
            return "".join(f'<path d="M{at.left:.1f} {at.y(y):.1f}H{at.right:.1f}" {look}/>' for y in item.at)
        case Map():
            return _map(item, at)
        case Text():
            across = at.left + item.x * (at.right - at.left) if "x" in item.parts else float(at.x(item.x))
            up = at.bottom - item.y * (at.bottom - at.top) if "y" in item.parts else float(at.y(item.y))
            up += _TICK_TYPE * (item.up == "top") - item.offset[1]
            anchor = "end" if item.across == "right" else "start"
            look = f'text-anchor="{anchor}" fill="{item.colour}" font-size="{_TICK_TYPE * item.size / SMALL:.3g}"'
            return f'<text x="{across + item.offset[0]:.1f}" y="{up:.1f}" {look}>{escape(item.text)}</text>'
    raise TypeError(f"a page does not draw {type(item).__name__}")


def _path(x: np.ndarray, y: np.ndarray) -> str:
    """A path through places, px, with a gap where one is not finite."""
    known, out, pen = np.isfinite(x) & np.isfinite(y), [], "M"
    for px, py, there in zip(x.tolist(), y.tolist(), known.tolist(), strict=True):
        if there:
            out.append(f"{pen}{px:.1f} {py:.1f}")
        pen = "L" if there else "M"
    return "".join(out)


def _curve(item: Line, at: _Place) -> str:
    k = outline(item.y, _MOST_POINTS) if np.isfinite(item.x).all() else np.arange(len(item.x))
    path = _path(at.x(np.asarray(item.x, float)[k]), at.y(np.asarray(item.y, float)[k]))
    if not path:
        return ""
    look = f'd="{path}" fill="none" stroke-linejoin="round"{_DASHES[item.dash]}'
    below = f'<path {look} stroke="{item.casing}" stroke-width="{item.width + 1.6:g}"/>' if item.casing else ""
    return f'{below}<path {look} stroke="{item.colour}" stroke-width="{item.width:g}"/>'


def _mark(item: Marks, x: float, y: float) -> str:
    """A mark at a place, px."""
    r = _RADIUS * item.size
    look = f'fill="{item.face or "none"}" stroke="{item.edge}" stroke-width="{item.edge_width:g}"'
    if item.symbol == "o":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" {look}/>'
    corners = {
        "s": ((-1, -1), (1, -1), (1, 1), (-1, 1)),
        "D": ((0, -1.3), (1.3, 0), (0, 1.3), (-1.3, 0)),
        "^": ((0, -1.2), (1.1, 0.9), (-1.1, 0.9)),
        "v": ((0, 1.2), (1.1, -0.9), (-1.1, -0.9)),
    }
    if item.symbol in corners:
        outer = "L".join(f"{x + r * a:.1f} {y + r * b:.1f}" for a, b in corners[item.symbol])
        return f'<path d="M{outer}Z" {look}/>'
    d = f"M{x - r:.1f} {y:.1f}h{2 * r:.1f}M{x:.1f} {y - r:.1f}v{2 * r:.1f}"
    if item.symbol in "xX":
        d = f"M{x - r:.1f} {y - r:.1f}l{2 * r:.1f} {2 * r:.1f}M{x - r:.1f} {y + r:.1f}l{2 * r:.1f} {-2 * r:.1f}"
    around = f'<path d="{d}" stroke="{item.edge}" stroke-width="2.6"/>'
    return f'{around}<path d="{d}" stroke="{item.face or item.edge}" stroke-width="1.4"/>'


def _map(item: Map, at: _Place) -> str:
    """The cells of a map as a picture of as many pixels as can be seen."""
    shown = [np.linspace(edges.min(), edges.max(), n + 1) for edges, n in zip((item.x, item.y), _PIXELS, strict=True)]
    column, row = (
        np.clip(np.searchsorted(edges, 0.5 * (x[1:] + x[:-1]), side="right") - 1, 0, len(edges) - 2)
        for edges, x in zip((np.asarray(item.x), np.asarray(item.y)), shown, strict=True)
    )
    values = np.asarray(item.values, float)[np.ix_(row, column)][::-1]
    scale: Callable[[np.ndarray], np.ndarray] = np.log10 if item.log else np.asarray
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (float(scale(np.array(x))) for x in (item.low, item.high))
        part = np.clip((scale(values) - low) / (high - low), 0.0, 1.0)
    part[np.isfinite(values) & ~np.isfinite(part)] = 0.0  # zero on a logarithmic scale
    colours = np.array([[int(shade[k : k + 2], 16) for k in (1, 3, 5)] for shade in item.shades], float)
    place = np.where(np.isfinite(part), part, 0.0) * (len(colours) - 1)
    rgb = np.stack([np.interp(place, np.arange(len(colours)), colours[:, k]) for k in range(3)], axis=2)
    alpha = np.where(np.isfinite(part), 255.0, 0.0)[..., None]
    x0, x1, y0, y1 = (float(x) for x in (*at.x(shown[0][[0, -1]]), *at.y(shown[1][[0, -1]])))
    size = f'x="{x0:.1f}" y="{y1:.1f}" width="{x1 - x0:.1f}" height="{y0 - y1:.1f}" preserveAspectRatio="none"'
    pixels = np.concatenate([rgb, alpha], axis=2).round().astype(np.uint8)
    return f'<image {size} href="data:image/png;base64,{b64encode(png(pixels)).decode()}"/>'


def png(pixels: np.ndarray) -> bytes:
    """A picture (height, width, 4) of bytes as PNG."""
    high, wide, _ = pixels.shape

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = np.concatenate([np.zeros((high, 1), np.uint8), pixels.reshape(high, -1)], axis=1)  # filter 0
    head = struct.pack(">IIBBBBB", wide, high, 8, 6, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 9)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


# --- legend -----------------------------------------------------------------------------------------


def _legend(items: Sequence[Item], width: float) -> list[tuple[int, float, Item]]:
    """Entries of items with a label, each label once: row, place in it (px), item; rows are filled from the left."""
    out: list[tuple[int, float, Item]] = []
    row, x, seen = 0, 8.0, set()
    for item in items:
        label = getattr(item, "label", "")
        if not label or label in seen:
            continue
        seen.add(label)
        wide = 34.0 + len(label) * _LETTER * _TICK_TYPE
        if x + wide > width and x > 8.0:
            row, x = row + 1, 8.0
        out.append((row, x, item))
        x += wide
    return out


def _entry(height: float, rows: int, row: int, x: float, item: Item) -> str:
    y = height - 5.0 - (rows - 1 - row) * _ROW
    text = f'<text x="{x + 24:.1f}" y="{y:.1f}">{escape(getattr(item, "label", ""))}</text>'
    middle = y - 4.0
    match item:
        case Marks():
            sample = _mark(item, x + 12.0, middle)
        case Band() | Box():
            look = f'fill="{item.colour}" fill-opacity="{max(item.opacity, 0.2):g}"'
            sample = f'<rect x="{x:.1f}" y="{middle - 5:.1f}" width="20" height="10" {look}/>'
        case Line() | Rule():
            colour = getattr(item, "casing", "") if item.colour != INK else ""  # of both the dark one
            look = f'stroke="{colour or item.colour}" stroke-width="{max(item.width, 1.2):g}"{_DASHES[item.dash]}'
            sample = f'<path d="M{x:.1f} {middle:.1f}h20" {look}/>'
        case _:
            sample = f'<circle cx="{x + 12:.1f}" cy="{middle:.1f}" r="3" fill="{GREY}"/>'
    return sample + text


# Small drawings for a notebook cell and the still picture of a report: panels above one another, without axes.

NARROW = 460.0  # width of a drawing, px
_TALLEST, _STRIP, _BELOW = 280.0, 26.0, 24.0  # of a panel with an aspect, of one without, and of the texts below one
_EDGE = 2.0  # left and right
_WIDE_LETTER = 7.0  # width of a letter, px, at most
_THICK = 1.2  # px for each point of a line's width


def draw(panels: list[Panel]) -> str:
    """One drawing of all panels, without axes; below each its caption, and the names of its kinds in their colours."""
    parts, y, width = "", 0.0, NARROW - 2.0 * _EDGE
    for panel in panels:
        (left, right), (low, high) = panel.limits()
        height = _STRIP
        if panel.aspect is not None:
            across = min(width / (right - left), _TALLEST / (panel.aspect * (high - low)))
            height = max(panel.aspect * across * (high - low), 40.0)
            wide, tall = width / (across * (right - left)), height / (panel.aspect * across * (high - low))
            (left, right), (low, high) = _wider((left, right), wide), _wider((low, high), tall)
        place = _Place((left, low), (right, high), 0.0, width, 0.0, height)
        size = f'x="{_EDGE:g}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}"'  # what is outside is cut off
        look = ' shape-rendering="crispEdges"' * (panel.aspect is None)  # or seams show between neighbours
        parts += f"<svg {size}{look}>{''.join(_drawn(_small(item, place), place) for item in panel.items)}</svg>"
        y += height + _BELOW
        parts += f'<text x="{_EDGE:g}" y="{y - 10:.0f}" fill="{GREY}">{escape(panel.caption)}</text>'
        parts += _names(panel, y - 10)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {NARROW:.0f} {y:.0f}" width="100%" role="img" '
        f'aria-label="shape of the cable" font-family="system-ui,sans-serif" font-size="11">{parts}</svg>'
    )


def _small(item: Item, at: _Place) -> Item:
    """An item as a small drawing has it: thicker lines, round marks, texts within the frame."""
    match item:
        case Line():
            return item._replace(width=_THICK * item.width)
        case Marks():
            return item._replace(symbol="o", size=0.5 * item.size / _RADIUS, edge_width=1.0)
        case Text():
            lift = 2.0 if item.up == "bottom" else -10.0
            y = float(at.y(item.y)) - item.offset[1] - lift
            off = float(at.y(item.y)) - min(max(y, 10.0), at.bottom - 3.0)
            return item._replace(up="bottom", offset=(item.offset[0], off), size=SMALL)
    return item


def _names(panel: Panel, y: float) -> str:
    parts, x, caption = "", NARROW - _EDGE, _WIDE_LETTER * len(panel.caption)
    names = {item.label: item.colour for item in panel.items if isinstance(item, Line | Box) and item.label}
    if x - sum(_WIDE_LETTER * len(name) + 8.0 for name in names) < caption:  # no room beside it
        return ""
    for name, colour in reversed(names.items()):
        parts += f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="end" fill="{colour}">{escape(name)}</text>'
        x -= _WIDE_LETTER * len(name) + 8.0
    return parts
