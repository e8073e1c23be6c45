"""A report of a result: one HTML file that explains itself, works without a network, and moves.

`write_report(result, path)` puts together facts (what to know first), pictures (plotly, drawn in the browser as they
come into view), events, the energy balance and the scene.  Numbers and plotly.js are packed with gzip inside the file:
it takes a third of the space, and browsers of 2023 or later unpack it themselves.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.store.limits import capacity_of, code_of
from hybrid.store.reader import Result
from hybrid.view.decimate import MOST_ON_CURVE, Kept, Store, kept, script_json
from hybrid.view.figure import Panel, short
from hybrid.view.lines_report import ReportOfLines
from hybrid.view.modes_page import PagedModes, section
from hybrid.view.notebook import picture
from hybrid.view.panels import end_forces, energy, energy_parts, history, ranges, touchdown
from hybrid.view.plotly_backend import figure_of
from hybrid.view.projections import free_edges, history_points
from hybrid.view.report_parts import (
    caption_html,
    events_html,
    facts_html,
    figure_html,
    filled_page,
    footer,
    plot_html,
    settings_html,
    space_html,
    statistics_html,
    table_html,
    verdict_html,
)
from hybrid.view.save import PAGES, REPORT_MARK, check_target, write_file
from hybrid.view.scenery import scenery
from hybrid.view.summary import amount, facts_of, length_of
from hybrid.view.zones import shares, zone_map

# Part of the largest displacement that one along another axis needs to be shown.
LEAST_MOVE = 0.02


def write_report(result: Result, path: str | Path, *, overwrite: bool = False, modes: PagedModes | None = None) -> Path:
    """Write the report of a result as .html or .htm and return where it is; ResultError where it cannot be written.

    overwrite: also replace a file that is not a report of hybrid; modes: of its scene (`hybrid.modes`), which it shows.
    """
    target = check_target(path, PAGES, overwrite=overwrite)
    return write_file(target, lambda new: new.write_text(html(result, modes), encoding="utf-8"))


def html(result: Result, modes: PagedModes | None = None) -> str:
    """The page as text."""
    store = Store()
    made = ReportOfLines(result, store) if result.lines else _OfLine(result, store)
    figures = [figure_of(panel, store) for group in made.panels.values() for panel in group]
    numbers = iter(range(len(figures)))
    numbered = {name: [(next(numbers), panel) for panel in group] for name, group in made.panels.items()}
    own = made.sections(numbered)
    parts = {  # in the order of the contents
        "title": escape(result.title or "(no title)"),
        "subtitle": escape("; ".join([*made.subtitle, _computed(result)])),
        "verdict": verdict_html(made.facts, made.several),
        "facts": own["facts"],
        "cable": own["cable"],
        "figures": own["figures"] + (section(modes) if modes is not None else ""),
        "statistics": own["statistics"],
        "events": events_html(result, made.several),
        "energy": own["energy"],
        "settings": settings_html(result),
        "scene": escape(result.scene_text),
        "scene_title": "Scene as it was run (YAML)",
        "footer": escape(footer()),
        "mark": REPORT_MARK,
        "index": script_json({"scene": made.scene, "figures": figures}),
    }
    return filled_page(parts, store)


def _computed(result: Result) -> str:
    """When and with what a result was computed."""
    made = str(result.attributes.get("created", ""))[:16].replace("T", " ")
    return f"computed {made} UTC with hybrid-cable {result.versions.get('hybrid-cable', '?')}"


class _OfLine:
    """What the page of one line has of its own."""

    def __init__(self, result: Result, store: Store) -> None:
        self.facts, self.several = facts_of(result), len(result.times) > 1
        self._result, self._shown = result, kept(result, [fact.t for fact in self.facts])
        self.scene = scenery(result, store, self._shown) or None
        self.panels = _panels(result, self._shown)

    @property
    def subtitle(self) -> list[str]:
        """Outputs and length."""
        n, s = len(self._result.times), self._result.s
        outputs = (
            "no output" if n == 0 else "static, one output" if n == 1 and self._result.status == "complete" else ""
        )
        outputs = outputs or f"{n} output{'s' * (n != 1)} to t = {short(self._result.times[-1], 6)} s"
        return [outputs, f"{short(length_of(self._result), 6)} m of cable, {len(s)} point{'s' * (len(s) != 1)}"]

    def sections(self, numbered: dict[str, list[tuple[int, Panel]]]) -> dict[str, str]:
        """Sections by their names in the template; numbered: the graphs."""
        return {
            "facts": facts_html(self.facts, self.several),
            "cable": _cable(self._result, self.scene, self._shown) if self.scene else "",
            "figures": _graphs(self._result, numbered, self.several),
            "statistics": statistics_html(self._result),
            "energy": _energy(self._result, numbered["energy"]),
        }


def _panels(result: Result, shown: Kept) -> dict[str, list[Panel]]:
    """The graphs of a page, by its sections."""
    along = ranges(result, shown)
    if len(result.times) < 2:
        return {"zones": [], "histories": [], "ranges": along, "energy": []}
    points = history_points(result, None)
    moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
    over = [end_forces(result), history(result, "tension", points)]
    moving = [k for k in range(3) if moves[k] > LEAST_MOVE * moves.max()]
    over += [history(result, "position", points, component=k) for k in moving]
    over += [touchdown(result)] if free_edges(result) else []
    used = (capacity_of(result), code_of(result))
    over += [history(result, x.name, [x.s]) for x in used if x is not None and x.s is not None]
    return {
        "zones": [zone_map(result, shown)] if any(result.zones) else [],
        "histories": [panel for panel in over if panel],
        "ranges": along,
        "energy": [panel for panel in (energy(result, "energy"), energy(result, "work")) if panel],
    }


def _cable(result: Result, scene: dict[str, Any], shown: Kept) -> str:
    title = result.title or "The cable"
    if len(shown.frames) < 2:
        return space_html(scene, picture(result), False, shown.notice, f"{title}: its equilibrium.")
    span = f"t = {short(result.times[0], 5)} to {short(result.times[-1], 5)} s"
    last = f"{title}, {span}; on paper the last shape over earlier ones."
    return space_html(scene, picture(result), True, shown.notice, last)


def _graphs(result: Result, groups: dict[str, list[tuple[int, Panel]]], several: bool) -> str:
    out = ""
    if groups["zones"]:
        out += f'<section id="zones"><h2>Zones over time</h2><p class="quiet">{escape(shares(result))} '
        out += '<span class="screen">Point at a mark, or tap it, to read what happened.</span></p>'
        out += "".join(f"<figure>{plot_html(k, f)}{caption_html(k, f)}</figure>" for k, f in groups["zones"])
        out += "</section>"
    if groups["histories"]:
        figures = "".join(figure_html(k, f) for k, f in groups["histories"])
        bands = any("errors/total" in name for name in result.names)
        note = "Bands are the estimated error." if bands else "Errors were not estimated, so there are no bands."
        if max(len(result.times), len(result["steps/t"]) if "steps/t" in result else 0) > MOST_ON_CURVE:
            note += " Long curves are drawn by the lowest and highest value of every short stretch."
        text = f'<p class="quiet">{note} <span class="screen">Click a graph to set the time.</span></p>'
        out += f'<section id="histories"><h2>Over time</h2>{text}<div class="grid">{figures}</div></section>'
    if groups["ranges"]:
        figures = "".join(figure_html(k, f) for k, f in groups["ranges"])
        explained = "Lowest, mean and highest of all outputs, and now: the time of the slider."
        if not several:
            kinds = list(dict.fromkeys(zone.kind for zone in result.zones[0]))
            explained = f"{shares(result)} Shaded as in the picture above: {', '.join(kinds)}." if kinds else ""
        out += f'<section id="ranges"><h2>Along the cable</h2><p class="quiet">{explained}</p>'
        out += f'<div class="grid">{figures}</div></section>'
    return out


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
    graphs = f'<div class="grid">{"".join(figure_html(k, f) for k, f in figures)}</div>' if figures else ""
    note = "The last line of work, “scheme”, is what no work accounts for: the time scheme's own." if works else ""
    return (
        f'<section id="energy"><h2>Energy</h2>{graphs}<details{"" if figures else " open"}><summary>The energy balance '
        f'at the last output</summary><p class="quiet">{note}</p>{table_html(cells, ["", "of", "J"], 1)}'
        "</details></section>"
    )
