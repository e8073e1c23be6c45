"""A report of a result: one HTML file that explains itself, works without a network, and moves.

`write_report(result, path)` puts together facts (what to know first), pictures (plotly, drawn in the browser as they
come into view), events, the energy ledger and the scene.  Numbers and plotly.js are packed with gzip inside the file:
it takes a third of the space, and browsers of 2023 or later unpack it themselves.
"""

from __future__ import annotations

import gzip
import re
from base64 import b64encode
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.store.reader import Result
from hybrid.view.decimate import MOST_ON_CURVE, Kept, Store, kept, script_json
from hybrid.view.figures import energy, energy_parts, histories, ranges
from hybrid.view.notebook_card import picture
from hybrid.view.save import PAGES, REPORT_MARK, check_target, write_file
from hybrid.view.scenery import scenery
from hybrid.view.style import prefix
from hybrid.view.summary import CAUSES, Fact, amount, attention, facts_of, length_of, short
from hybrid.view.zone_map import event_rows, shares, zone_map

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
    groups = {
        "zones": zone_map(result, store, shown),
        "histories": histories(result, store),
        "ranges": ranges(result, store, shown),
        "energy": energy(result, store),
    }
    numbered = {name: [] for name in groups}  # type: dict[str, list[tuple[int, dict[str, Any]]]]
    figures: list[dict[str, Any]] = []
    for name, group in groups.items():
        for figure in group:
            numbered[name].append((len(figures), figure))
            figures.append(figure)
    kept_keys = ("data", "layout", "cursor", "now", "bars")
    index = {"scene": scene or None, "figures": [{k: f[k] for k in kept_keys if k in f} for f in figures]}
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
    # In one pass: nothing that is put in is looked at again.
    return re.sub(r"\{\{(\w+)\}\}", lambda m: parts[m[1]], _file("report.html"))


def _file(name: str) -> str:
    return (files("hybrid.view") / "page" / name).read_text(encoding="utf-8")


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
    """The rows of the summary; a warning that stands above is not told twice."""
    rows = []
    for fact in facts:
        if fact.key == "warning" and fact.weight == "alarm":
            continue
        table = _error_table(fact) if fact.key == "errors" and fact.values else ""
        text = f"<dt>{escape(fact.title)}</dt><dd>{_code(fact.text)}{table}</dd>{_show(fact, several)}"
        rows.append(f'<div class="fact {fact.weight}" id="fact-{fact.key}">{text}</div>')
    return f'<dl class="facts">{"".join(rows)}</dl>'


def _error_table(fact: Fact) -> str:
    head = "".join(f'<th class="number">{name}</th>' for name in CAUSES.values())
    rows = ""
    for what, name, unit in (("position", "position", "m"), ("end_force", "end forces", "N")):
        cells = [fact.values.get(f"{cause}_{what}") for cause in CAUSES]
        factor, written = prefix(unit, max((x for x in cells if x is not None), default=0.0))
        said = (f'<td class="number">{"–" if x is None else short(x * factor, 2)}</td>' for x in cells)
        rows += f"<tr><td>{name} ({written})</td>{''.join(said)}</tr>"
    return f'<div class="scroll"><table><tr><th>largest error by</th>{head}</tr>{rows}</table></div>'


def _cable(result: Result, scene: dict[str, Any], shown: Kept) -> str:
    colours = "".join(
        f'<button type="button" value="{k}" aria-pressed="{str(k == 0).lower()}">{escape(c["key"])}</button>'
        for k, c in enumerate(scene["colours"])
    )
    colour = (
        '<div><span class="quiet" id="by">colour</span><div class="switch" id="colour" role="group" '
        f'aria-labelledby="by">{colours}</div></div>'
    )
    axes = (
        '<div><span class="quiet" id="axes-by">axes</span><div class="switch" id="axes" role="group" '
        'aria-labelledby="axes-by"><button type="button" value="equal" aria-pressed="true">equal</button>'
        '<button type="button" value="stretched" aria-pressed="false">stretched</button></div></div>'
    )
    time = ""
    if len(shown.frames) > 1:
        usual = scene["speed"]
        options = "".join(
            f'<option value="{x:g}"{" selected" if x == usual else ""}>{x:g} × real time</option>'
            for x in sorted({*_SPEEDS, usual})
        )
        time = (
            '<div class="time"><button type="button" id="play" aria-pressed="false">Play</button>'
            '<input type="range" id="time" min="0" max="0" value="0" step="1" aria-label="time">'
            '<output id="now" for="time"></output>'
            f'<select id="pace" aria-label="speed">{options}</select></div>'
        )
    notice = f'<p class="quiet" id="thinned">{escape(shown.notice)}</p>' if shown.notice else ""
    poster = picture(result).replace("<svg ", '<svg class="poster" ', 1)
    hint = (
        "Drag to turn, pinch or scroll to zoom." if time else "Drag to turn, pinch or scroll to zoom; a static result."
    )
    return (
        f'<section id="cable"><h2>The cable</h2><div class="controls">{colour}{axes}</div>'
        f'<div class="plot" id="cable-plot">{poster}</div>{time}<div class="legend" id="cable-legend"></div>'
        f'<p class="quiet"><span id="cable-said"></span> {hint}</p>{notice}'
        "<noscript><p>The pictures need JavaScript; the texts do not.</p></noscript></section>"
    )


def _graphs(result: Result, groups: dict[str, list[tuple[int, dict[str, Any]]]], several: bool) -> str:
    out = ""
    if groups["zones"]:
        out += f'<section id="zones"><h2>Zones over time</h2><p class="quiet">{escape(shares(result))} '
        out += "".join(f"{escape(f['said'])}</p>{_plot(k, f)}" for k, f in groups["zones"]) + "</section>"
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
        said = "Lowest, mean and highest of all outputs, and now: the time of the slider."
        if not several:
            kinds = list(dict.fromkeys(zone.kind for zone in result.zones[0]))
            said = f"{shares(result)} Shaded as in the picture above: {', '.join(kinds)}." if kinds else ""
        out += f'<section id="ranges"><h2>Along the cable</h2><p class="quiet">{said}</p>'
        out += f'<div class="grid">{figures}</div></section>'
    return out


def _figure(k: int, figure: dict[str, Any]) -> str:
    said = f"<figcaption>{escape(figure['said'])}</figcaption>" if figure["said"] else ""
    return f"<figure><h3>{escape(figure['title'])}</h3>{said}{_plot(k, figure)}</figure>"


def _plot(k: int, figure: dict[str, Any]) -> str:
    bars = f'<div class="legend" data-bars="{k}"></div>' if figure.get("bars") else ""
    tall = " tall" if figure.get("tall") else ""
    return f'{bars}<div class="plot{tall}" id="plot-{figure["key"]}" data-figure="{k}"></div>'


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


def _energy(result: Result, figures: list[tuple[int, dict[str, Any]]]) -> str:
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
    cells = "".join(
        f'<tr><td>{group if name[:4] != "all " else ""}</td><td>{escape(name)}</td><td class="number">'
        f"{escape(amount(y, 'J') if abs(y) > 1e-12 * peak else '0')}</td></tr>"
        for group, name, y in rows
    )
    graphs = f'<div class="grid">{"".join(_figure(k, f) for k, f in figures)}</div>' if figures else ""
    open_ = "" if figures else " open"
    note = "The last line of work, “scheme”, is what no work accounts for: the time scheme's own." if works else ""
    return (
        f'<section id="energy"><h2>Energy</h2>{graphs}<details{open_}><summary>The ledger at the last output</summary>'
        f'<p class="quiet">{note}</p><div class="scroll"><table><tr><th></th><th>of</th><th class="number">J</th></tr>'
        f"{cells}</table></div></details></section>"
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
    cells = "".join(f"<tr><td>{escape(name)}</td><td>{escape(str(value))}</td></tr>" for name, value in rows)
    return (
        f'<details><summary>Settings and versions</summary><div class="scroll"><table>{cells}</table></div></details>'
    )


def _footer() -> str:
    from importlib.metadata import version

    return (
        f"Written by hybrid-cable {version('hybrid-cable')}. Pictures by plotly.js, MIT licence, which is part of this "
        "file; the page asks for nothing from the network."
    )
