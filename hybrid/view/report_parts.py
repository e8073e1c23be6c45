"""Parts of the page of a report: sections, tables, places of graphs, and natural modes that swing.

Parts are HTML, and there is a template that they fill.  Modes, as `hybrid.modes` returns them, have a page of their
own as well.
"""

from __future__ import annotations

import gzip
import json
import math
import re
from base64 import b64encode
from collections.abc import Collection, Mapping, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.store.envelope import NOT_VERIFIED, UNITS
from hybrid.store.reader import Result
from hybrid.store.records import RODS_AT_START
from hybrid.store.tables import rows_of
from hybrid.view.curves import Store, even
from hybrid.view.figure import (
    GREY,
    PAGES,
    REPORT_MARK,
    Axis,
    Item,
    Line,
    Map,
    Page,
    Panel,
    check_target,
    colour_of,
    prefix,
    save_figure,
    short,
    write_file,
)
from hybrid.view.plotly_backend import draw_graph
from hybrid.view.summary import CAUSES, Fact, amount, attention
from hybrid.view.zones import event_rows

# Rows that are seen at once: the others of a long table, or list, fold away.
MOST_ROWS = 10
_SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)

_SETTINGS = {"accuracy_asked": "accuracy asked", "cells": "cells", "length": "length (m)", "solver": "solver"}
_SETTINGS |= {"static_path": "equilibrium found by", "static_residual": "equilibrium out of balance (N)"}
_SETTINGS |= {"tension_scale": "tension scale (N)", "created": "created"}


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
    held = [f for f in facts if f.key == "quantity" and f.values.get("limit") in ("smallest", "largest")]
    count = sum(len(f.values["limits"]) for f in limits) + len(held)
    if alarms:
        each = [f"<li><b>{escape(f.title)}.</b> {_code(f.text)} {_show(f, several)}</li>" for f in alarms]
        rows, left = "".join(each[:MOST_ROWS]), each[MOST_ROWS:]
        more = f"<details><summary>{len(left)} more</summary><ul>{''.join(left)}</ul></details>" if left else ""
        head = f'<div class="attention" role="alert"><h2>Look at this first</h2><ul>{rows}</ul>{more}</div>'
    else:
        open_ = sum(x["verdict"] == NOT_VERIFIED for f in limits for x in f.values["limits"])
        open_ += sum(f.weight == "note" for f in held)
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


# --- natural modes -----------------------------------------------------------------------------

# Pictures of mode shapes: the equilibrium, and the line at both ends of its swing.

COLUMNS = 3  # panels beside each other
SHAPE_WIDE = 2.8  # inches, of one,
SHAPE_HIGH = 2.5  # and its height
# Views are from this azimuth beside the widest direction of the lines, and from this height, deg.
AZIMUTH, HEIGHT = 35.0, 20.0
SWING = 0.12  # of the largest extent of the scene: the largest shift that is drawn
FACTS = (
    "grey: at rest; blue: one end of the swing, and the other, dashed; shifts are not to scale, twists are not shown"
)


def plot_modes(found: Any, target: Path) -> None:
    """Draw every mode in a panel of its own, all from the same side, as PNG, PDF or SVG."""
    from hybrid.view.matplotlib_backend import draw_page

    save_figure(draw_page(_page(found)), target)


def _page(found: Any) -> Page:
    view = oblique_view(found.position)
    places = {name: np.asarray(r) @ view.T for name, r in found.position.items()}
    every = np.concatenate(list(places.values()))
    extent = np.ptp(np.concatenate([np.asarray(r) for r in found.position.values()]), axis=0)
    size = SWING * max(float(extent.max()), 1e-9)
    span = [(float(x.min()) - 1.5 * size, float(x.max()) + 1.5 * size) for x in every.T]
    blue, panels = colour_of("catenary"), {}
    for k, mode in enumerate(found.modes, start=1):
        items: list[Item] = []
        for name, at in places.items():
            moved = size * np.asarray(mode.shifts[name]) @ view.T
            items.append(Line(at[:, 0], at[:, 1], colour=GREY, width=0.8))
            for sign, look in ((-1.0, {"width": 0.8, "dash": "dash"}), (1.0, {})):
                swung = at + sign * moved
                items.append(Line(swung[:, 0], swung[:, 1], colour=blue, **look))  # type: ignore[arg-type]
        title = f"{k}: {mode.period:.4g} s, {mode.what}"
        panels[str(k)] = Panel(str(k), title, Axis("", "m", *span[0]), Axis("", "m", *span[1]), items, aspect=1.0)
    if not panels:
        return Page(found.title or "(no title)", "", empty="no mode")
    mosaic, inches = grid_of(panels, COLUMNS, SHAPE_WIDE, SHAPE_HIGH, 0.6)
    return Page(found.title or "(no title)", FACTS, 1, panels, mosaic, size=inches)


def grid_of(
    panels: Collection[str], most: int, wide: float, high: float, room: float
) -> tuple[list[list[str]], tuple[float, float]]:
    """Panels in rows of at most so many, and the size of their page; wide, high: of each; room: for the head."""
    columns = min(most, len(panels))
    rows = math.ceil(len(panels) / columns)
    keys = [*panels, *["."] * (rows * columns - len(panels))]
    mosaic = [keys[columns * row : columns * (row + 1)] for row in range(rows)]
    return mosaic, (max(wide * columns, 5.6), high * rows + room)


def oblique_view(position: Mapping[str, Any]) -> Any:
    """(2, 3): to the right and upwards in the picture, from beside the widest direction and above."""
    every = np.concatenate([np.asarray(r) for r in position.values()])
    flat = every[:, :2] - every[:, :2].mean(axis=0)
    _, _, axes = np.linalg.svd(flat, full_matrices=False)
    along = axes[0] * np.sign(axes[0][np.abs(axes[0]).argmax()] or 1.0)
    angle = math.atan2(along[1], along[0]) + math.radians(AZIMUTH)
    right = np.array([math.cos(angle), math.sin(angle), 0.0])
    away = np.array([-math.sin(angle), math.cos(angle), 0.0])
    up = math.cos(math.radians(HEIGHT)) * np.array([0.0, 0.0, 1.0]) + math.sin(math.radians(HEIGHT)) * away
    return np.array([right, up])


# Natural modes that swing: a section of a report, and a page of their own.

MOST_POINTS = 120  # of a line that are drawn
TICKS = 15  # places at which the turn of its sections is drawn
WIDE = 320.0  # of a picture,
HIGH = 240.0  # and its height
TWISTS = 0.05  # part of the kinetic energy in twist from which turns are drawn
TURN = 1.0  # rad, the largest
TICK = 0.03  # of the picture
SHOWN, LEAST = 3, 0.05  # parts of the energy in the table, and the least of them
EXPLAINED = (
    "About the equilibrium, without drag and damping. Grey: at rest; blue: the mode as it swings, not to scale, each "
    "once in two seconds; ticks across a line show how its sections turn. Masses are parts of all that can move along "
    "x, y, z."
)


def write_modes(found: Any, path: str | Path) -> Path:
    """Write a page of modes as .html and return where it is; ResultError where it cannot be written."""
    target = check_target(path, PAGES)
    return write_file(target, lambda new: new.write_text(html(found), encoding="utf-8"))


def html(found: Any) -> str:
    """The page as text."""
    title = f"Natural modes of {found.title or 'a line'}"
    parts = {"title": escape(title), "subtitle": escape(f"{len(found.modes)} modes on {found.cells} cells")}
    parts |= {"footer": escape(footer()), "mark": REPORT_MARK, "css": page_file("report.css")}
    parts |= {"section": section(found)} | dict.fromkeys(("js", "data", "plotly"), "")
    return page_of("modes.html", parts)


def section(found: Any) -> str:
    """Table, notes and moving pictures of modes, for a report."""
    head = ["", "period (s)", "error (s)", "moves, by kinetic energy", "mass x (%)", "y", "z"]
    notes = "".join(f"<li>{escape(x)}</li>" for x in found.notes)
    pictures = "".join(_picture(found, k) for k in range(len(found.modes)))
    return (
        f'<section id="modes"><h2>Natural modes</h2><p class="quiet">{escape(EXPLAINED)}</p>'
        f"{table_html([_row(found, k) for k in range(len(found.modes))], head, numbers=3)}"
        f"{f'<ul>{notes}</ul>' if notes else ''}"
        '<p><button type="button" id="swing" aria-pressed="true">Pause</button></p>'
        f'<div class="grid">{pictures}</div><script>{page_file("modes.js")}</script></section>'
    )


def _row(found: Any, k: int) -> list[str]:
    mode = found.modes[k]
    parts = [f"{word} {100.0 * part:.0f} %" for word, part in mode.energy.items() if part >= LEAST][:SHOWN]
    masses = [100.0 * m / a if a > 0.0 else 0.0 for m, a in zip(mode.mass, found.mass, strict=True)]
    error = "not known" if mode.error is None else short(mode.error, 2)
    return [str(k + 1), short(mode.period, 5), error, ", ".join(parts), *(f"{m:.1f}" for m in masses)]


def _picture(found: Any, k: int) -> str:
    """One mode, drawn at an end of its swing, with the numbers that let it move."""
    mode, view = found.modes[k], oblique_view(found.position)
    every = np.concatenate([np.asarray(r) for r in found.position.values()])
    size = SWING * max(float(np.ptp(every, axis=0).max()), 1e-9)
    flat = every @ view.T
    low, high = flat.min(axis=0) - 1.3 * size, flat.max(axis=0) + 1.3 * size
    scale = min(WIDE / (high[0] - low[0]), HIGH / (high[1] - low[1]))
    upright = scale * np.array([1.0, -1.0])
    rest, swings, ticks = [], [], []
    for name, position in found.position.items():
        chosen = even(len(position), MOST_POINTS)
        r, shift = np.asarray(position)[chosen], size * np.asarray(mode.shifts[name])[chosen]
        at = (r @ view.T - 0.5 * (low + high)) * upright + 0.5 * np.array([WIDE, HIGH])
        moved = shift @ view.T * upright
        rest.append(np.round(at, 1).tolist())
        swings.append(np.round(moved, 1).tolist())
        whole = np.asarray(position), size * np.asarray(mode.shifts[name])
        ticks += _ticks(mode, name, *whole, view, upright, low + high)
    lines = "".join(f'<polyline points="{_points(x)}" fill="none" stroke="{GREY}"/>' for x in rest)
    ends = [(np.array(x) + np.array(y)).tolist() for x, y in zip(rest, swings, strict=True)]
    blue = "".join(f'<polyline class="swing" points="{_points(x)}" fill="none"/>' for x in ends)
    turning = "".join('<line class="swing"/>' for _ in ticks)
    data = escape(json.dumps({"rest": rest, "swing": swings, "ticks": ticks}, separators=(",", ":")), quote=True)
    text = f"Mode {k + 1}: {short(mode.period, 4)} s, {mode.what}"
    return (
        f'<figure><svg class="mode" viewBox="0 0 {WIDE:g} {HIGH:g}" role="img" aria-label="{escape(text)}" '
        f'data-mode="{data}"><g stroke-width="1">{lines}</g><g stroke="{colour_of("catenary")}" stroke-width="2">'
        f"{blue}{turning}</g></svg><figcaption>{escape(text)}</figcaption></figure>"
    )


def _points(x: list[list[float]]) -> str:
    return " ".join(f"{a:g},{b:g}" for a, b in x)


def _ticks(mode: Any, name: str, r: Any, shift: Any, view: Any, upright: Any, twice_middle: Any) -> list[list[float]]:
    """Of places along a line: x, y, their shift, two axes across the line in the picture, the largest turn (rad)."""
    if mode.energy.get("twist", 0.0) < TWISTS or name not in mode.twists:
        return []
    twist = np.nan_to_num(np.asarray(mode.twists[name]))
    largest = max(float(np.abs(np.nan_to_num(np.asarray(x))).max()) for x in mode.twists.values()) or 1.0
    d = np.diff(r, axis=0)
    d /= np.maximum(np.linalg.norm(d, axis=1), 1e-300)[:, None]
    away = np.cross(view[0], view[1])
    rows = []
    for c in even(len(d), TICKS):
        n = np.cross(d[c], away)
        n = n / np.linalg.norm(n) if np.linalg.norm(n) > 1e-6 else view[0]
        axes = [TICK * WIDE * (view @ x) * np.sign(upright) for x in (n, np.cross(d[c], n))]
        middle = (0.5 * (r[c] + r[c + 1]) @ view.T - 0.5 * twice_middle) * upright + 0.5 * np.array([WIDE, HIGH])
        moved = 0.5 * (shift[c] + shift[c + 1]) @ view.T * upright
        row = [*middle, *moved, *axes[0], *axes[1], TURN * twist[c] / largest]
        rows.append([round(float(x), 3) for x in row])
    return rows
