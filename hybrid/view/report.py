"""A report of a result: one HTML file that explains itself, works without a network, and moves.

`write_report(result, path)` puts together facts (what to know first), pictures (plotly, drawn in the browser as they
come into view), events, the energy balance and the scene.  Numbers and plotly.js are packed with gzip inside the file:
it takes a third of the space, and browsers of 2023 or later unpack it themselves.
"""

from __future__ import annotations

import gzip
import re
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.store.reader import Result
from hybrid.view.decimate import MOST_ON_CURVE, Kept, Store, kept, script_json
from hybrid.view.figure import Map, Panel
from hybrid.view.notebook_card import picture
from hybrid.view.panels import end_forces, energy, energy_parts, history, ranges, touchdown
from hybrid.view.plotly_backend import figure_of
from hybrid.view.projections import free_edges, history_points
from hybrid.view.save import PAGES, REPORT_MARK, check_target, write_file
from hybrid.view.scenery import scenery
from hybrid.view.style import prefix
from hybrid.view.summary import CAUSES, Fact, amount, attention, facts_of, length_of, short
from hybrid.view.zones import event_rows, shares, zone_map

_SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


def write_report(result: Result, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write the report of a result as .html or .htm and return where it is; ResultError where it cannot be written.

    overwrite: also replace a file that is not a report of hybrid.
    """
    target = check_target(path, PAGES, overwrite=overwrite)
    return write_file(target, lambda new: new.write_text(html(result), encoding="utf-8"))


def html(result: Result) -> str:
    """The page as text."""
    facts, store = facts_of(result), Store()
    shown = kept(result, [fact.t for fact in facts])
    scene = scenery(result, store, shown)
    panels = _panels(result, shown)
    figures = [figure_of(panel, store) for group in panels.values() for panel in group]
    index = {"scene": scene or None, "figures": figures}
    numbers = iter(range(len(figures)))
    numbered = {name: [(next(numbers), panel) for panel in group] for name, group in panels.items()}
    several = len(result.times) > 1
    parts = {
        "title": escape(result.title or "(no title)"),
        "subtitle": escape(_subtitle(result, shown)),
        "attention": _attention(attention(facts), several),
        "facts": _facts(facts, several),
        "cable": _cable(result, scene, shown) if scene else "",
        "figures": _graphs(result, numbered, several),
        "events": _events(result, several),
        "energy": _energy(result, numbered["energy"]),
        "settings": _settings(result),
        "scene": escape(result.scene_text),
        "footer": escape(_footer()),
        "mark": REPORT_MARK,
        "index": script_json(index),
        "data": _packed(store.block),
        "plotly": _packed(_plotly().encode()),
        "css": _file("report.css"),
        "js": _file("report.js"),
    }
    return _filled("report.html", parts)


def _panels(result: Result, shown: Kept) -> dict[str, list[Panel]]:
    """The graphs of a page, by its sections."""
    along = ranges(result, shown)
    if len(result.times) < 2:
        return {"zones": [], "histories": [], "ranges": along, "energy": []}
    points = history_points(result, None)
    moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
    over = [end_forces(result), history(result, "tension", points)]
    over.append(history(result, "position", points, component=int(moves.argmax())))
    over += [touchdown(result)] if free_edges(result) else []
    return {
        "zones": [zone_map(result, shown)] if any(result.zones) else [],
        "histories": [panel for panel in over if panel],
        "ranges": along,
        "energy": [panel for panel in (energy(result, "energy"), energy(result, "work")) if panel],
    }


def _file(name: str) -> str:
    return (files("hybrid.view") / "page" / name).read_text(encoding="utf-8")


def _filled(name: str, parts: dict[str, str]) -> str:
    """A template with its parts, put in in one pass: nothing that is put in is looked at again."""
    return re.sub(r"\{\{(\w+)\}\}", lambda m: parts[m[1]], _file(name))


def _plotly() -> str:
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()


def _packed(data: bytes) -> str:
    return b64encode(gzip.compress(data, 9, mtime=0)).decode()


# ---- texts ----------------------------------------------------------------------------------------


def _subtitle(result: Result, shown: Kept) -> str:
    n, s = len(result.times), result.s
    outputs = "no output" if n == 0 else "static, one output" if n == 1 and result.status == "complete" else ""
    outputs = outputs or f"{n} output{'s' * (n != 1)} to t = {result.times[-1]:.6g} s"
    size = f"{length_of(result):.6g} m of cable, {len(s)} point{'s' * (len(s) != 1)}"
    made = str(result.attributes.get("created", ""))[:16].replace("T", " ")
    computed = f"computed {made} UTC with hybrid-cable {result.versions.get('hybrid-cable', '?')}"
    return f"{outputs}; {size}; {computed}"


def _attention(facts: list[Fact], several: bool) -> str:
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


def _facts(facts: list[Fact], several: bool) -> str:
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
    return _table(rows, ["largest error by", *CAUSES.values()], numbers=len(CAUSES))


def _limit_table(fact: Fact) -> str:
    rows = []
    for x in fact.values["limits"]:
        unit = "m" if x["limit"] == "min_bend_radius" else "N"
        used = "–" if x["used"] is None else f"{short(100 * x['used'], 3)} %"
        verdict = "broken" if x["broken"] else "kept"
        numbers = [amount(x["allowed"], unit), amount(x["value"], unit), used, short(x["s"], 5), short(x["t"], 5)]
        rows.append([x["limit"], verdict, *numbers])
    return _table(rows, ["limit", "", "allowed", "reached", "used", "s (m)", "t (s)"], numbers=5)


def _table(rows: list[list[str]], head: Sequence[str] = (), numbers: int = 0) -> str:
    """A table of texts, which are escaped; numbers: so many columns, the last, hold numbers."""

    def row(cells: Sequence[str], tag: str) -> str:
        looks = [""] * (len(cells) - numbers) + [' class="number"'] * numbers
        return f"<tr>{''.join(f'<{tag}{look}>{escape(x)}</{tag}>' for x, look in zip(cells, looks, strict=True))}</tr>"

    lines = row(head, "th") * bool(head) + "".join(row(cells, "td") for cells in rows)
    return f'<div class="scroll"><table>{lines}</table></div>'


def _cable(result: Result, scene: dict[str, Any], shown: Kept) -> str:
    moves, usual = len(shown.frames) > 1, scene["speed"]
    speeds = sorted({*_SPEEDS, usual})
    buttons = [
        f'<button type="button" value="{k}" aria-pressed="{"false" if k else "true"}">{escape(colour["key"])}</button>'
        for k, colour in enumerate(scene["colours"])
    ]
    options = [f'<option value="{x:g}"{" selected" * (x == usual)}>{x:g} × real time</option>' for x in speeds]
    parts = {
        "colours": "".join(buttons),
        "poster": picture(result).replace("<svg ", '<svg class="poster" ', 1),
        "time": _filled("time.html", {"speeds": "".join(options)}) if moves else "",
        "static": "" if moves else "; a static result",
        "notice": f'<p class="quiet" id="thinned">{escape(shown.notice)}</p>' if shown.notice else "",
    }
    return _filled("cable.html", parts)


def _graphs(result: Result, groups: dict[str, list[tuple[int, Panel]]], several: bool) -> str:
    out = ""
    if groups["zones"]:
        out += f'<section id="zones"><h2>Zones over time</h2><p class="quiet">{escape(shares(result))} '
        out += "".join(f"{escape(f.caption)}</p>{_plot(k, f)}" for k, f in groups["zones"]) + "</section>"
    if groups["histories"]:
        figures = "".join(_figure(k, f) for k, f in groups["histories"])
        bands = any("errors/total" in name for name in result.names)
        note = "Bands are the estimated error." if bands else "Errors were not estimated, so there are no bands."
        if max(len(result.times), len(result["steps/t"]) if "steps/t" in result else 0) > MOST_ON_CURVE:
            note += " Long curves are drawn by the lowest and highest value of every short stretch."
        text = f'<p class="quiet">{note} Click a graph to set the time.</p>'
        out += f'<section id="histories"><h2>Over time</h2>{text}<div class="grid">{figures}</div></section>'
    if groups["ranges"]:
        figures = "".join(_figure(k, f) for k, f in groups["ranges"])
        explained = "Lowest, mean and highest of all outputs, and now: the time of the slider."
        if not several:
            kinds = list(dict.fromkeys(zone.kind for zone in result.zones[0]))
            explained = f"{shares(result)} Shaded as in the picture above: {', '.join(kinds)}." if kinds else ""
        out += f'<section id="ranges"><h2>Along the cable</h2><p class="quiet">{explained}</p>'
        out += f'<div class="grid">{figures}</div></section>'
    return out


def _figure(k: int, panel: Panel) -> str:
    caption = f"<figcaption>{escape(panel.caption)}</figcaption>" if panel.caption else ""
    return f"<figure><h3>{escape(panel.title[:1].upper() + panel.title[1:])}</h3>{caption}{_plot(k, panel)}</figure>"


def _plot(k: int, panel: Panel) -> str:
    """The place of a graph; a map is taller, with its colour bars above."""
    maps = any(isinstance(item, Map) for item in panel.items)
    bars = f'<div class="legend" data-bars="{k}"></div>' if maps else ""
    return f'{bars}<div class="plot{" tall" * maps}" id="plot-{panel.key}" data-figure="{k}"></div>'


def _events(result: Result, several: bool) -> str:
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


def _energy(result: Result, figures: list[tuple[int, Panel]]) -> str:
    if not len(result.times):
        return ""
    energies, works = energy_parts(result, "energy"), energy_parts(result, "work")
    rows = []
    if works and len(result.times) > 1:
        rows += [("energy", name, y[-1]) for name, y in energies.items()]
        rows.append(("energy", "all energy, since the first output", float(np.sum([y[-1] for y in energies.values()]))))
        rows += [("work", name, y[-1]) for name, y in works.items()]
        rows.append(("work", "all work, since the start", float(np.sum([y[-1] for y in works.values()]))))
    elif energies:
        rows = [("energy", name.replace("_", " "), float(result[f"energy/{name}"][-1])) for name in result["energy"]]
    if not rows:
        return '<section id="energy"><h2>Energy</h2><p class="quiet">No energies were recorded.</p></section>'
    peak = max((abs(y) for _, _, y in rows), default=0.0)
    cells = [
        ["" if name.startswith("all ") else group, name, amount(y, "J") if abs(y) > 1e-12 * peak else "0"]
        for group, name, y in rows
    ]
    graphs = f'<div class="grid">{"".join(_figure(k, f) for k, f in figures)}</div>' if figures else ""
    note = "The last line of work, “scheme”, is what no work accounts for: the time scheme's own." if works else ""
    return (
        f'<section id="energy"><h2>Energy</h2>{graphs}<details{"" if figures else " open"}><summary>The energy balance '
        f'at the last output</summary><p class="quiet">{note}</p>{_table(cells, ["", "of", "J"], 1)}'
        "</details></section>"
    )


_SETTINGS = {
    "accuracy_asked": "accuracy asked", "cells": "cells", "length": "length (m)", "solver": "solver",
    "static_path": "equilibrium found by", "static_residual": "equilibrium out of balance (N)",
    "tension_scale": "tension scale (N)", "created": "created",
}  # fmt: skip


def _settings(result: Result) -> str:
    """What was chosen, by the scene or by the program, and with which versions."""
    hidden = {"title", "status", "message", "format", "format_version"}
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
    return f"<details><summary>Settings and versions</summary>{_table(cells)}</details>"


def _footer() -> str:
    from importlib.metadata import version

    return (
        f"Written by hybrid-cable {version('hybrid-cable')}. Pictures by plotly.js, MIT licence, which is part of this "
        "file; the page asks for nothing from the network."
    )
