"""Parts of the page of a report: sections, tables and graphs as HTML, and the template that they fill."""

from __future__ import annotations

import gzip
import re
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

from hybrid.store.reader import Result
from hybrid.view.decimate import Store
from hybrid.view.figure import Map, Panel
from hybrid.view.style import prefix
from hybrid.view.summary import CAUSES, Fact, amount, short
from hybrid.view.zones import event_rows

_SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)

_SETTINGS = {
    "accuracy_asked": "accuracy asked", "cells": "cells", "length": "length (m)", "solver": "solver",
    "static_path": "equilibrium found by", "static_residual": "equilibrium out of balance (N)",
    "tension_scale": "tension scale (N)", "created": "created",
}  # fmt: skip


def filled_page(parts: dict[str, str], store: Store) -> str:
    """The page of these parts, with its numbers, scripts and styles."""
    more = {"data": packed(store.block), "plotly": packed(plotly_script().encode())}
    return filled("report.html", parts | more | {"css": page_file("report.css"), "js": page_file("report.js")})


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


def attention_html(facts: list[Fact], several: bool) -> str:
    """What to look at first, as a section."""
    if not facts:
        return '<div class="attention well"><h2>No warnings, and no limit is broken.</h2></div>'
    rows = "".join(f"<li><b>{escape(f.title)}.</b> {_code(f.text)} {_show(f, several)}</li>" for f in facts)
    return f'<div class="attention" role="alert"><h2>Look at this first</h2><ul>{rows}</ul></div>'


def _code(text: str) -> str:
    """A text, escaped, with what stands between backticks as code."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(text))


def _show(fact: Fact, several: bool) -> str:
    if fact.t is None or not several:
        return ""
    s = f' data-s="{fact.s:.9g}"' if fact.s is not None else ""
    return f'<button class="show" data-t="{fact.t:.9g}"{s}>Show</button>'


def facts_html(facts: list[Fact], several: bool) -> str:
    """The rows of the summary; a warning that stands above is not repeated."""
    rows = []
    for fact in facts:
        if fact.key == "warning" and fact.weight == "alarm":
            continue
        table = _error_table(fact) if fact.key == "errors" and fact.values else ""
        table = _limit_table(fact) if fact.key == "limits" and fact.values else table
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
    rows = []
    for x in fact.values["limits"]:
        unit = "m" if x["limit"] == "min_bend_radius" else "N"
        used = "–" if x["used"] is None else f"{short(100 * x['used'], 3)} %"
        verdict = "broken" if x["broken"] else "kept"
        numbers = [amount(x["allowed"], unit), amount(x["value"], unit), used, short(x["s"], 5), short(x["t"], 5)]
        rows.append([x["limit"], verdict, *numbers])
    return table_html(rows, ["limit", "", "allowed", "reached", "used", "s (m)", "t (s)"], numbers=5)


def table_html(rows: list[list[str]], head: Sequence[str] = (), numbers: int = 0) -> str:
    """A table of texts, which are escaped; numbers: so many columns, the last, hold numbers."""

    def row(cells: Sequence[str], tag: str) -> str:
        looks = [""] * (len(cells) - numbers) + [' class="number"'] * numbers
        return f"<tr>{''.join(f'<{tag}{look}>{escape(x)}</{tag}>' for x, look in zip(cells, looks, strict=True))}</tr>"

    lines = row(head, "th") * bool(head) + "".join(row(cells, "td") for cells in rows)
    return f'<div class="scroll"><table>{lines}</table></div>'


def space_html(scene: dict[str, Any], poster: str, moves: bool, notice: str) -> str:
    """The section of the moving picture; poster: SVG of what a browser without WebGL shows."""
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
        "static": "" if moves else "; a static result",
        "notice": f'<p class="quiet" id="thinned">{escape(notice)}</p>' if notice else "",
    }
    return filled("cable.html", parts)


def figure_html(k: int, panel: Panel) -> str:
    """A graph with its title and caption; k: its number in the index."""
    caption = f"<figcaption>{escape(panel.caption)}</figcaption>" if panel.caption else ""
    return (
        f"<figure><h3>{escape(panel.title[:1].upper() + panel.title[1:])}</h3>{caption}{plot_html(k, panel)}</figure>"
    )


def plot_html(k: int, panel: Panel) -> str:
    """The place of a graph; a map is taller, with its colour bars above."""
    maps = any(isinstance(item, Map) for item in panel.items)
    bars = f'<div class="legend" data-bars="{k}"></div>' if maps else ""
    return f'{bars}<div class="plot{" tall" * maps}" id="plot-{panel.key}" data-figure="{k}"></div>'


def events_html(result: Result, several: bool) -> str:
    """The list of events, as a section; several: whether there is more than one output."""
    rows, left = event_rows(result)
    if not rows:
        return ""
    lines = "".join(
        f'<tr class="{family}"'
        + (f' tabindex="0" data-t="{t:.9g}">' if several else ">")
        + f"<td>{t:.5g}</td><td>{escape(where)}</td><td>{escape(kind)}</td><td>{escape(text)}</td></tr>"
        for t, where, kind, text, family in rows
    )
    note = f'<p class="quiet">{escape(left)}</p>' if left else ""
    hint = " A row takes you to its time." if several else ""
    head = "<tr><th>t (s)</th><th>s (m)</th><th>kind</th><th>what happened, and why</th></tr>"
    count = len(result.events)
    return (
        f'<section id="events"><details{" open" if count <= 12 else ""}><summary>{count} event{"s" * (count != 1)}: '
        f'what the program noticed and did.{hint}</summary><div class="scroll"><table class="events">{head}{lines}'
        f"</table></div>{note}</details></section>"
    )


def settings_html(result: Result) -> str:
    """What was chosen, by the scene or by the program, and with which versions."""
    hidden = {"title", "status", "message", "format", "format_version", "fairleads"}
    given = {k: v for k, v in result.attributes.items() if k not in hidden and not k.startswith(("version_", "error_"))}
    rows = [
        (_SETTINGS.get(k, k.replace("_", " ")), f"{v:.6g}" if isinstance(v, float) else v) for k, v in given.items()
    ]
    if "steps/dt" in result and len(result["steps/dt"]):
        dt = result["steps/dt"]
        low, high = f"{dt.min():.4g}", f"{dt.max():.4g}"
        rows.append(("steps", f"{len(dt)}, of {low} s" if low == high else f"{len(dt)}, of {low} to {high} s"))
    rows += [("version of " + name, version) for name, version in result.versions.items()]
    cells = [[name, str(value)] for name, value in rows]
    return f"<details><summary>Settings and versions</summary>{table_html(cells)}</details>"


def footer() -> str:
    """What the page is made with."""
    from importlib.metadata import version

    return (
        f"Written by hybrid-cable {version('hybrid-cable')}. Pictures by plotly.js, MIT licence, which is part of this "
        "file; the page asks for nothing from the network."
    )
