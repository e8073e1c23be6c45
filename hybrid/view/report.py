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
from hybrid.view.decimate import MOST_FRAMES, MOST_ON_CURVE, MOST_VALUES, Kept, Store, even, kept, script_json
from hybrid.view.figure import Panel, short
from hybrid.view.lines import (
    AllLines,
    clearest_view,
    facts_line,
    largest_tensions,
    motions,
    rotations,
    shape,
    tension_ranges,
    views_of_lines,
)
from hybrid.view.modes_page import PagedModes, section
from hybrid.view.notebook import picture
from hybrid.view.panels import end_forces, energy, energy_parts, history, ranges, touchdown
from hybrid.view.plotly_backend import draw, figure_of
from hybrid.view.projections import free_edges, history_points
from hybrid.view.report_parts import (
    caption_html,
    events_html,
    figure_html,
    filled_page,
    footer,
    plot_html,
    settings_html,
    space_html,
    table_html,
    verdict_html,
)
from hybrid.view.report_tables import facts_and_tables, facts_of_all, of_others, statistics_of_all
from hybrid.view.save import PAGES, REPORT_MARK, check_target, write_file
from hybrid.view.scenery import scenery
from hybrid.view.summary import amount, length_of
from hybrid.view.zones import shares, zone_map

LEAST_FRAMES = 50  # of a moving picture, for which points of many lines are left out
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
    made = _Report(result, store)
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


class _Report:
    """What a page shows of the lines of a result: of one all there is, of many the worst."""

    def __init__(self, result: Result, store: Store) -> None:
        self._result, self._every = result, AllLines(result)
        self.facts, self.several = facts_of_all(result, self._every), self._every.outputs > 1
        self._shown = _shown(self._every, [fact.t for fact in self.facts])
        self.scene = scenery(result, self._every, self._shown, store) or None
        self.panels = _panels(result, self._every, self._shown)

    @property
    def subtitle(self) -> list[str]:
        """Outputs, and length of a line alone or number of lines."""
        every, result, n = self._every, self._result, self._every.outputs
        outputs = "no output" if n == 0 else "static, one output" if n == 1 and result.status == "complete" else ""
        outputs = outputs or f"{n} output{'s' * (n != 1)} to t = {short(every.times[-1], 6)} s"
        if every.alone is None:
            return [outputs, *facts_line(result, every)]
        points = len(every.alone.s)
        return [outputs, f"{short(length_of(every.alone), 6)} m of cable, {points} point{'s' * (points != 1)}"]

    def sections(self, numbered: dict[str, list[tuple[int, Panel]]]) -> dict[str, str]:
        """Sections by their names in the template; numbered: the graphs."""
        result, every = self._result, self._every
        return {
            "facts": facts_and_tables(result, every, self.facts),
            "cable": _space(result, every, self.scene, self._shown) if self.scene else "",
            "figures": _graphs(every, numbered),
            "statistics": statistics_of_all(result, every),
            "energy": _energy(every.alone, numbered["energy"]) if every.alone is not None else "",
        }


def _shown(every: AllLines, moments: list[float | None]) -> dict[str, Kept]:
    """Frames, the same of all lines, and points of each, that the page shows; moments: s, among the frames."""
    one = {name: kept(line) for name, line in every.lines.items()}
    points = {name: x.points for name, x in one.items()}
    total = sum(map(len, points.values()))
    if total > MOST_VALUES // LEAST_FRAMES:  # so that at least some frames are left
        part = MOST_VALUES // LEAST_FRAMES / total
        points = {name: p[even(len(p), max(5, int(part * len(p))))] for name, p in points.items()}
        total = sum(map(len, points.values()))
    frames = even(every.outputs, min(MOST_FRAMES, max(2, MOST_VALUES // total)))
    asked = [int(np.abs(every.times - t).argmin()) for t in moments if t is not None and every.outputs]
    frames = np.unique([*frames, *asked]).astype(int)
    return {name: Kept(frames, p, every.outputs, one[name].grid) for name, p in points.items()}


def _panels(result: Result, every: AllLines, shown: dict[str, Kept]) -> dict[str, list[Panel]]:
    """The graphs of a page, by its sections."""
    found: dict[str, list[Panel]] = {"zones": [], "lines": [], "histories": [], "ranges": [], "energy": []}
    if not every.outputs:
        return found
    for name in every.named:
        along = ranges(every.lines[name], shown[name])
        if every.alone is None:
            along = [x._replace(key=f"{x.key}-{name}", title=f"line {name}: {x.title}") for x in along]
        found["ranges"] += along
    if len(every.named) < len(every.lines):
        plans = [shape(result, every, view)._replace(key="plan") for view in views_of_lines(every) if not view.upright]
        found["lines"] = [*plans, tension_ranges(every)]
    if every.outputs < 2:
        return found
    if every.alone is None:
        found["histories"] = [largest_tensions(result, every)]
    else:
        line = every.alone
        found["zones"] = [zone_map(line, next(iter(shown.values())))] if any(line.zones) else []
        found["histories"] = _histories(line)
        found["energy"] = [panel for panel in (energy(line, "energy"), energy(line, "work")) if panel]
    found["histories"] += [*motions(result, every), *rotations(result, every)]
    return found


def _histories(result: Result) -> list[Panel]:
    """Graphs over time of a line: forces and motions of some points, touchdown, what is used of limits."""
    points = history_points(result, None)
    moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
    over = [end_forces(result), history(result, "tension", points)]
    moving = [k for k in range(3) if moves[k] > LEAST_MOVE * moves.max()]
    over += [history(result, "position", points, component=k) for k in moving]
    over += [touchdown(result)] if free_edges(result) else []
    used = (capacity_of(result), code_of(result))
    over += [history(result, x.name, [x.s]) for x in used if x is not None and x.s is not None]
    return [panel for panel in over if panel]


def _space(result: Result, every: AllLines, scene: dict[str, Any], shown: dict[str, Kept]) -> str:
    """The section of the moving picture, with what paper shows in its place."""
    alone, thinned = every.alone, next(iter(shown.values()))
    title, moves = result.title or ("All lines" if alone is None else "The cable"), len(thinned.frames) > 1
    poster = draw([shape(result, every, clearest_view(every))]) if alone is None else picture(alone)
    if moves:
        span = f"t = {short(every.times[0], 5)} to {short(every.times[-1], 5)} s"
        caption = f"{title}, {span}; on paper the last shape over earlier ones."
    else:
        caption = f"{title}: its equilibrium."
    section = space_html(scene, poster, moves, thinned.notice, caption)
    return section if alone is not None else section.replace("<h2>The cable</h2>", "<h2>The lines</h2>")


def _graphs(every: AllLines, groups: dict[str, list[tuple[int, Panel]]]) -> str:
    """Sections of graphs, those that there are."""
    out, line = "", every.alone
    if groups["zones"] and line is not None:
        out += f'<section id="zones"><h2>Zones over time</h2><p class="quiet">{escape(shares(line))} '
        out += '<span class="screen">Point at a mark, or tap it, to read what happened.</span></p>'
        out += "".join(f"<figure>{plot_html(k, f)}{caption_html(k, f)}</figure>" for k, f in groups["zones"])
        out += "</section>"
    explained = "Lowest, mean and highest of all outputs, and now: the time of the slider."
    if line is not None and every.outputs < 2:
        kinds = list(dict.fromkeys(zone.kind for zone in line.zones[0])) if len(line.zones) else []
        explained = f"{shares(line)} Shaded as in the picture above: {', '.join(kinds)}." if kinds else ""
    more = of_others(every, "hybrid plot")
    for name, title, text, below in (
        ("lines", "All lines", "The worst lines are in colour.", ""),
        ("histories", "Over time", _of_histories(line), ""),
        ("ranges", "Along the cable" if line is not None else "Along the lines", explained, more),
    ):
        if groups[name]:
            figures = "".join(figure_html(k, f) for k, f in groups[name])
            out += f'<section id="{name}"><h2>{title}</h2><p class="quiet">{text}</p>'
            out += f'<div class="grid">{figures}</div>{below}</section>'
    return out


def _of_histories(line: Result | None) -> str:
    """What there is to know of graphs over time; line: that is alone."""
    click, notes = '<span class="screen">Click a graph to set the time.</span>', []
    if line is not None:
        bands = any("errors/total" in name for name in line.names)
        notes = ["Bands are the estimated error." if bands else "Errors were not estimated, so there are no bands."]
        if max(len(line.times), len(line["steps/t"]) if "steps/t" in line else 0) > MOST_ON_CURVE:
            notes.append("Long curves are drawn by the lowest and highest value of every short stretch.")
    return " ".join([*notes, click])


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
