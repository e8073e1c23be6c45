"""Parts of the page of a report: sections, tables and graphs.

Graphs as SVG, with axes and legends, are for paper, without JavaScript, and until plotly draws.  Made by hand: some 1
ms and 10 kB each, and no library is imported.

Parts are HTML, and there is a template that they fill.
"""

from __future__ import annotations

import gzip
import math
import re
import struct
import zlib
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from hybrid.store.envelope import NOT_VERIFIED, UNITS
from hybrid.store.reader import Result
from hybrid.store.records import RODS_AT_START
from hybrid.store.statistics_table import rows_of
from hybrid.view.curves import Store, outline
from hybrid.view.figure import (
    GREY,
    INK,
    SMALL,
    Area,
    Axis,
    Band,
    Box,
    Item,
    Line,
    Map,
    Marks,
    Panel,
    Rule,
    Text,
    prefix,
    short,
)
from hybrid.view.summary import CAUSES, Fact, amount, attention
from hybrid.view.zones import event_rows

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
        "".join(_entry(place, height, rows, *entry) for entry in entries),
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
            return _line(item, at)
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


def _line(item: Line, at: _Place) -> str:
    k = outline(item.y, _MOST_POINTS) if np.isfinite(item.x).all() else np.arange(len(item.x))
    path = _path(at.x(np.asarray(item.x, float)[k]), at.y(np.asarray(item.y, float)[k]))
    if not path:
        return ""
    look = f'd="{path}" fill="none" stroke-linejoin="round"{_DASHES[item.dash]}'
    below = f'<path {look} stroke="{item.casing}" stroke-width="{item.width + 1.6:g}"/>' if item.casing else ""
    return f'{below}<path {look} stroke="{item.colour}" stroke-width="{item.width:g}"/>'


def _mark(item: Marks, x: float, y: float) -> str:
    """A mark at a place, px."""
    r = 0.62 * item.size
    look = f'fill="{item.face or "none"}" stroke="{item.edge}" stroke-width="{item.edge_width:g}"'
    if item.symbol == "o":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" {look}/>'
    corners = {
        "s": ((-1, -1), (1, -1), (1, 1), (-1, 1)), "D": ((0, -1.3), (1.3, 0), (0, 1.3), (-1.3, 0)),
        "^": ((0, -1.2), (1.1, 0.9), (-1.1, 0.9)), "v": ((0, 1.2), (1.1, -0.9), (-1.1, -0.9)),
    }  # fmt: skip
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


def _entry(place: _Place, height: float, rows: int, row: int, x: float, item: Item) -> str:
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


# Rows that are seen at once: the others of a long table, or list, fold away.
MOST_ROWS = 10
_SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)

_SETTINGS = {
    "accuracy_asked": "accuracy asked", "cells": "cells", "length": "length (m)", "solver": "solver",
    "static_path": "equilibrium found by", "static_residual": "equilibrium out of balance (N)",
    "tension_scale": "tension scale (N)", "created": "created",
}  # fmt: skip


def filled_page(parts: dict[str, str], store: Store) -> str:
    """The page of these parts, with its numbers, scripts and styles."""
    sections = re.findall(r'<section id="(\w+)"><h2>([^<]+)</h2>', "".join(parts.values()))
    links = [("summary", "Summary"), *sections, ("scene", "The scene")]
    more = {"contents": "".join(f'<a href="#{name}">{title}</a>' for name, title in links)}
    more |= {"data": packed(store.block), "plotly": packed(plotly_script().encode())}
    return page_of("report.html", parts | more | {"css": page_file("report.css"), "js": page_file("report.js")})


def page_of(body: str, parts: dict[str, str]) -> str:
    """A whole page: what all pages have (head, title, footer, plotly.js), and a template of what is in it."""
    return filled("page.html", parts | {"body": filled(body, parts)})


def page_file(name: str) -> str:
    """A file of the folder page."""
    return (files("hybrid.view") / "page" / name).read_text(encoding="utf-8")


def filled(name: str, parts: dict[str, str]) -> str:
    """A template with its parts, put in in one pass: nothing that is put in is looked at again."""
    return re.sub(r"\{\{(\w+)\}\}", lambda m: parts[m[1]], page_file(name))


def plotly_script() -> str:
    """plotly.js."""
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()


def packed(data: bytes) -> str:
    """Bytes with gzip, as text of base 64."""
    return b64encode(gzip.compress(data, 9, mtime=0)).decode()


def verdict_html(facts: list[Fact], several: bool) -> str:
    """What to know first: what is wrong, else that nothing is; limits as a table; the numbers that matter, large."""
    alarms, notes = attention(facts), [f for f in facts if f.key == "warning" and f.weight == "note"]
    limits = [f for f in facts if f.key.startswith("limits") and f.values]
    count = sum(len(f.values["limits"]) for f in limits)
    if alarms:
        each = [f"<li><b>{escape(f.title)}.</b> {_code(f.text)} {_show(f, several)}</li>" for f in alarms]
        rows, left = "".join(each[:MOST_ROWS]), each[MOST_ROWS:]
        more = f"<details><summary>{len(left)} more</summary><ul>{''.join(left)}</ul></details>" if left else ""
        head = f'<div class="attention" role="alert"><h2>Look at this first</h2><ul>{rows}</ul>{more}</div>'
    else:
        open_ = sum(x["verdict"] == NOT_VERIFIED for f in limits for x in f.values["limits"])
        kept = "no limits were given to hold it against" if not count else f"within all {count} limits"
        kept = "within the one limit" if count == 1 else kept
        kept = f"{open_} of {count} limits not verified" if open_ else kept
        told = f"; {len(notes)} note{'s' * (len(notes) > 1)} below" * bool(notes)
        look = "" if count and not notes and not open_ else " open"
        head = f'<div class="attention well{look}"><h2>No warnings; {kept}{told}.</h2></div>'
    tables = "".join(
        f"<h3>{escape(f.title)}</h3>{_limit_table(f)}<p class='quiet'>{escape(f.text)}</p>" for f in limits
    )
    return f'<section id="verdict" aria-label="Verdict">{head}{tables}{_cards(facts, several)}</section>'


def _cards(facts: list[Fact], several: bool) -> str:
    """Numbers that have a headline, large, each with its sentence."""
    cards = ""
    for fact in (f for f in facts if "headline" in f.values):
        number, _, doubt = fact.values["headline"].partition(" (")
        small = f"<small> {escape(doubt.rstrip(')'))}</small>" * bool(doubt)
        cards += (
            f'<div class="card {fact.weight}" id="fact-{fact.key}"><h3>{escape(fact.title)}</h3>'
            f'<p class="large">{escape(number)}{small}</p><p class="quiet">{_code(fact.text)}</p>'
            f"{_show(fact, several)}</div>"
        )
    return f'<div class="cards">{cards}</div>' * bool(cards)


def _code(text: str) -> str:
    """A text, escaped, with what stands between backticks as code."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(text))


def _show(fact: Fact, several: bool) -> str:
    if fact.t is None or not several:
        return ""
    s = f' data-s="{short(fact.s, 9)}"' if fact.s is not None else ""
    return f'<button class="show" data-t="{short(fact.t, 9)}"{s}>Show</button>'


def facts_html(facts: list[Fact], several: bool) -> str:
    """The rows of the summary, without what stands in the verdict."""
    rows = []
    for fact in facts:
        limits = fact.key.startswith("limits") and fact.values
        if limits or "headline" in fact.values or (fact.key == "warning" and fact.weight == "alarm"):
            continue
        table = _error_table(fact) if fact.key.startswith("errors") and fact.values else ""
        text = f"<dt>{escape(fact.title)}</dt><dd>{_code(fact.text)}{table}</dd>{_show(fact, several)}"
        rows.append(f'<div class="fact {fact.weight}" id="fact-{fact.key}">{text}</div>')
    return f'<dl class="facts">{"".join(rows)}</dl>'


def _error_table(fact: Fact) -> str:
    rows = []
    for what, name, unit in (("position", "position", "m"), ("end_force", "end forces", "N")):
        cells = [fact.values.get(f"{cause}_{what}") for cause in CAUSES]
        factor, written = prefix(unit, max((x for x in cells if x is not None), default=0.0))
        rows.append([f"{name} ({written})", *("–" if x is None else short(x * factor, 2) for x in cells)])
    return table_html(rows, ["largest error by", *CAUSES.values()], numbers=len(CAUSES))


def _limit_table(fact: Fact) -> str:
    """Limits with a bar each; of several lines with their names."""
    rows, of_lines = [], "line" in fact.values["limits"][0]
    for x in fact.values["limits"]:
        unit = UNITS.get(x["limit"], "N")
        used = "–" if x["used"] is None else f"{short(100 * x['used'], 3)} %"
        part, verdict = 1.0 if x["broken"] else min(x["used"] or 0.0, 1.0), x["verdict"]
        look = verdict.replace(" ", "-")
        numbers = [amount(x["allowed"], unit), amount(x["value"], unit), used, short(x["s"], 5), short(x["t"], 5)]
        cells = "".join(f'<td class="number">{escape(y)}</td>' for y in numbers)
        bar = f'<span class="used {look}" aria-hidden="true"><i style="width:{short(100 * part, 3)}%"></i></span>'
        names = "".join(f"<td>{escape(x[key])}</td>" for key in ["line"] * of_lines + ["limit"])
        rows.append(f'<tr class="{look}">{names}<td>{verdict}</td><td>{bar}</td>{cells}</tr>')
    heads = ["allowed", "reached", "used", "s (m)", "t (s)"]
    head = "<th>line</th>" * of_lines + "<th>limit</th><th>verdict</th><td></td>"
    head += "".join(f'<th class="number">{x}</th>' for x in heads)
    return folded(rows, f"<tr>{head}</tr>", "limits" + " of-lines" * of_lines, "limits")


def folded(rows: list[str], head: str, look: str, what: str) -> str:
    """A table of rows below a head, of which those after MOST_ROWS fold away; look: its class; what: they are of."""

    def table(some: list[str]) -> str:
        return f'<div class="scroll" tabindex="0"><table class="{look}">{head}{"".join(some)}</table></div>'

    left = rows[MOST_ROWS:]
    if len(left) < 3:  # as many lines as the fold itself takes
        return table(rows)
    return f"{table(rows[:MOST_ROWS])}<details><summary>{len(left)} other {what}</summary>{table(left)}</details>"


def table_html(rows: list[list[str]], head: Sequence[str] = (), numbers: int = 0, what: str = "") -> str:
    """A table of texts, which are escaped; numbers: so many columns, the last, hold numbers.

    what: rows after the first MOST_ROWS fold away, and are called so.  A second line of a text is small.
    """

    def row(cells: Sequence[str], tag: str) -> str:
        looks = [""] * (len(cells) - numbers) + [' class="number"'] * numbers
        each = zip(cells, looks, strict=True)
        return f"<tr>{''.join(f'<{tag}{look}>{_two_lines(x)}</{tag}>' for x, look in each)}</tr>"

    first, lines = row(head, "th") * bool(head), [row(cells, "td") for cells in rows]
    if what:
        return folded(lines, first, "rows", what)
    return f'<div class="scroll" tabindex="0"><table>{first}{"".join(lines)}</table></div>'


def _two_lines(text: str) -> str:
    """A text, escaped, with what stands in its second line small."""
    first, _, second = text.partition("\n")
    return escape(first) + f'<br><span class="at">{escape(second)}</span>' * bool(second)


def space_html(scene: dict[str, Any], poster: str, moves: bool, notice: str, caption: str) -> str:
    """The section of the moving picture; poster: SVG of what paper, and a browser without WebGL, shows."""
    usual = scene["speed"]
    speeds = sorted({*_SPEEDS, usual})
    buttons = [
        f'<button type="button" value="{k}" aria-pressed="{"false" if k else "true"}">{escape(colour["key"])}</button>'
        for k, colour in enumerate(scene["colours"])
    ]
    options = [f'<option value="{x:g}"{" selected" * (x == usual)}>{x:g} × real time</option>' for x in speeds]
    parts = {
        "colours": "".join(buttons),
        "poster": poster.replace("<svg ", '<svg class="poster" ', 1),
        "time": filled("time.html", {"speeds": "".join(options)}) if moves else "",
        "caption": f"<b>Figure 1.</b> {escape(caption)}",
        "notice": f'<p class="quiet" id="thinned">{escape(notice)}</p>' if notice else "",
    }
    return filled("cable.html", parts)


def figure_html(k: int, panel: Panel, before: int = 1) -> str:
    """A graph with its title and caption.

    k: its place in the index; before: figures before that of place 0, such as the cable in space.
    """
    title = panel.title[:1].upper() + panel.title[1:]
    wide = ' class="wide"' * (panel.aspect is not None)
    return f"<figure{wide}><h3>{escape(title)}</h3>{plot_html(k, panel)}{caption_html(k, panel, before)}</figure>"


def caption_html(k: int, panel: Panel, before: int = 1) -> str:
    """A caption that can be quoted."""
    text = panel.caption or f"{panel.title[:1].upper()}{panel.title[1:]}."
    return f"<figcaption><b>Figure {k + 1 + before}.</b> {escape(text)}</figcaption>"


def plot_html(k: int, panel: Panel) -> str:
    """The place of a graph, with its still drawing; a map is taller, with its colour bars above."""
    maps = [item for item in panel.items if isinstance(item, Map)]
    bars = f'<div class="legend">{"".join(map(_bar, maps))}</div>' if maps else ""
    look = " tall" * bool(maps) + " shape" * (panel.aspect is not None)
    place = f'class="plot{look}" id="plot-{panel.key}" data-figure="{k}"'
    return f"{bars}<div {place}>{draw_graph(panel)}</div>"


def _bar(item: Map) -> str:
    """The colours of a map, from its lowest value to its highest."""
    shades = f'<span class="ramp" style="background:linear-gradient(to right,{",".join(item.shades)})"></span>'
    low, high = "≤ " * item.log + short(item.low, 3), f"{short(item.high, 3)} {item.unit}" + " (log.)" * item.log
    name = f"{item.name}: {item.quantity}"
    return f'<span class="bar">{escape(name)}<span>{escape(low)}</span>{shades}{escape(high)}</span>'


def events_html(result: Result, several: bool) -> str:
    """The list of events, as a section; several: whether there is more than one output."""
    rows, left = event_rows(result)
    if not rows:
        return ""
    lines = "".join(
        f'<tr class="{family}"'
        + (f' tabindex="0" data-t="{short(t, 9)}">' if several else ">")
        + f"<td>{short(t, 5)}</td><td>{escape(where)}</td><td>{escape(kind)}</td><td>{escape(text)}</td></tr>"
        for t, where, kind, text, family in rows
    )
    note = f'<p class="quiet">{escape(left)}</p>' if left else ""
    hint = " A row takes you to its time." if several else ""
    head = "<tr><th>t (s)</th><th>s (m)</th><th>kind</th><th>what happened, and why</th></tr>"
    count = len(result.events)
    return (
        f'<section id="events"><h2>Events</h2><details{" open" if count <= 12 else ""}><summary>'
        f"{count} event{'s' * (count != 1)}: "
        f'what the program noticed and did.{hint}</summary><div class="scroll" tabindex="0">'
        f'<table class="events">{head}{lines}</table></div>{note}</details></section>'
    )


def statistics_html(result: Result) -> str:
    """Statistics of the histories, as a section that opens; empty for a result with too few outputs."""
    if len(result.times) < 3 or not result.times[-1] > result.times[0]:
        return ""
    rows, found = [], rows_of(result)
    for x in found:
        extreme = x["extreme"] or {}
        numbers = [x["mean"], x["standard_deviation"], x["minimum"], x["maximum"], x["significant_range"]]
        longer = [extreme.get("most_probable"), extreme.get("fractile")]
        size = max(abs(y) for y in numbers if y is not None)
        factor, unit = prefix(x["unit"], size) if size else (1.0, x["unit"])
        period = "–" if x["crossing_period"] is None else short(x["crossing_period"], 4)
        cells = ["–" if y is None else short(y * factor, 4) for y in (*numbers, *longer)]
        where = "" if x["s"] is None else short(x["s"], 5)
        rows.append([f"{x['quantity']} ({unit})" if unit else x["quantity"], where, *cells[:5], period, *cells[5:]])
    if not rows:
        return ""
    head = [
        "",
        "s (m)",
        "mean",
        "standard deviation",
        "smallest",
        "largest",
        "significant range",
        "period (s)",
        "MPM in 3 h",
        "P90 in 3 h",
    ]
    note = (
        "Of the time from the first output to the last, starts of loads and motions included; along the cable where a "
        "quantity is largest. Significant range: mean of the largest third between up-crossings of the mean; period: "
        "mean time between them; MPM in 3 h: most probable maximum of three hours, by peaks over a threshold; P90 in "
        "3 h: what that maximum does not exceed with a probability of 90 %. “–”: too few peaks or cycles, round-off, "
        "or an angle at its bound. End forces are those of every step, all else is that of the outputs."
    )
    beyond = [x["beyond_outputs"] for x in found if "beyond_outputs" in x]
    more = f"<p>{escape('; '.join(beyond))}.</p>" if beyond else ""
    return (
        f'<section id="statistics"><details><summary>Statistics of {len(rows)} histories</summary>'
        f'<p class="quiet">{note} <code>hybrid stats</code> has other times, places and hours.</p>'
        f"{table_html(rows, head, numbers=len(head) - 1)}{more}</details></section>"
    )


def settings_html(result: Result) -> str:
    """What was chosen, by the scene or by the program, and with which versions."""
    hidden = {"title", "status", "message", "format", "format_version", "fairleads", RODS_AT_START}
    given = {k: v for k, v in result.attributes.items() if k not in hidden and not k.startswith(("version_", "error_"))}
    rows = [
        (_SETTINGS.get(k, k.replace("_", " ")), f"{short(v, 6)}" if isinstance(v, float) else v)
        for k, v in given.items()
    ]
    if "steps/dt" in result and len(result["steps/dt"]):
        dt = result["steps/dt"]
        low, high = f"{short(dt.min(), 4)}", f"{short(dt.max(), 4)}"
        rows.append(("steps", f"{len(dt)}, of {low} s" if low == high else f"{len(dt)}, of {low} to {high} s"))
    rows += [("version of " + name, version) for name, version in result.versions.items()]
    cells = [[name, str(value)] for name, value in rows]
    return f"<details><summary>Settings and versions</summary>{table_html(cells)}</details>"


def footer() -> str:
    """What the page is made with."""
    return (
        f"Written by hybrid-cable {version('hybrid-cable')}. Pictures by plotly.js, MIT licence, which is part of this "
        "file; the page asks for nothing from the network."
    )
