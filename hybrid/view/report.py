"""A result on a page: the report, which explains itself and moves, and what a cell of a notebook shows.

`write_report(result, path)` puts together facts (what to know first), pictures (plotly, drawn in the browser as they
come into view), events, the energy balance and the scene, in one HTML file that works without a network.  Numbers and
plotly.js are packed with gzip inside the file: it takes a third of the space, and browsers of 2023 or later unpack it
themselves.
Facts, statistics and tables are of lines, of many the worst first, and of points and bodies.

A cell shows the card of the result, and below it the cable in space as a figure of plotly, with a slider over time.
The figure holds all moments that it shows, so that its slider works without a kernel: in a notebook that is opened
again, and in one exported to HTML.
JupyterLab and VS Code draw the figure with plotly's own script.  For pages made of a notebook (nbconvert) the first
result that a kernel shows brings plotly.js, packed, and asks no other host for it.
"""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.envelope import extreme, partner_of
from hybrid.store.limits import capacity_of, code_of
from hybrid.store.reader import Result
from hybrid.view import report_parts as parts
from hybrid.view.curves import MOST_FRAMES as FRAMES_OF_PAGE
from hybrid.view.curves import MOST_ON_CURVE, MOST_VALUES, Kept, Store, even, is_without_moment, kept, script_json
from hybrid.view.figure import ALARM, GREY, INK, PAGES, REPORT_MARK, Panel, check_target, prefix, short, write_file
from hybrid.view.lines import (
    AllLines,
    bodies_of,
    clearest_view,
    facts_line,
    fairleads_of,
    largest_tensions,
    motions,
    points_of,
    rotations,
    scenery,
    shape,
    tension_ranges,
    views_of_lines,
)
from hybrid.view.panels import end_forces, energy, energy_parts, history, ranges, touchdown
from hybrid.view.panels import shape as shape_of_line
from hybrid.view.plotly_backend import NARROW, draw, figure_of
from hybrid.view.projections import free_edges, history_points
from hybrid.view.summary import Fact, amount, attention, facts_of, length_of, limits_of_lines
from hybrid.view.zones import shares, strip, zone_map

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


# --- a cell of a notebook ----------------------------------------------------------------------

# A slider is some 600 pixels wide, and a cell is to stay near 300 kB: places of the slider, points of all lines.
MOST_FRAMES, MOST_POINTS = 81, 121
PLAYED = 12.0  # s that playing all of it takes, at the least
HEIGHT = 460  # pixels: with the slider, what a notebook shows without scrolling
_GRID = "#E4E4E4"


class Arrays(Store):
    """In place of a page's references: the arrays themselves."""

    def add(self, array: Any, kind: str = "f4") -> Any:
        """The array with the type that a page would have."""
        return np.ascontiguousarray(array, dtype=kind)


def plot_space(result: Result, colour: str | None = None) -> Figure:
    """The cable, or all lines, in space (m, inertial frame, z up) as a plotly figure with a slider over time.

    colour: "zone", "tension" or "curvature" of one line, "line" or "tension" of several; None: by zone, or by line.
    Of long runs at most 81 moments and about 121 points are in it.  ResultError: a result without an output, or a
    colour that it does not have.
    """
    from plotly.graph_objects import Figure

    scene = _scene(result)
    if not scene:
        raise ResultError(f"the result holds no output to draw ({result.status_text})")
    ways = {way["key"]: way for way in scene["colours"]}
    if colour is not None and colour not in ways:
        raise ResultError(f"this result cannot be coloured by {colour!r}\n    expected: {' or '.join(ways)}")
    way = ways[colour] if colour is not None else next(iter(ways.values()), None)
    still = [_plane(plane) for plane in scene["planes"] if plane]
    first, moving = len(still), len(scene["times"])
    frames = [
        {"name": str(k), "data": _moment(scene, way, k), "traces": list(range(first, first + 1 + len(scene["marks"])))}
        for k in range(moving)
    ]
    nowhere = {"type": "scatter3d", "mode": "lines", "x": [None], "y": [None], "z": [None], "hoverinfo": "skip"}
    legend = (way or {}).get("legend", [])
    entries = [nowhere | {"name": name, "line": {"color": shade, "width": 6}} for name, shade in legend]
    data = [*still, *frames[0]["data"], *entries]
    layout = _layout(result, scene) | (_controls(scene) if moving > 1 else {})
    return Figure({"data": data, "layout": layout, "frames": frames if moving > 1 else []})


def _scene(result: Result) -> dict[str, Any]:
    """What there is to draw, with arrays; {} without outputs."""
    every = AllLines(result)
    frames, each = even(every.outputs, MOST_FRAMES), max(5, MOST_POINTS // len(every.lines))
    shown = {
        name: Kept(frames, even(len(line.s), each), every.outputs, len(line.s)) for name, line in every.lines.items()
    }
    return scenery(result, every, shown, Arrays())


def _moment(scene: dict[str, Any], way: dict[str, Any] | None, k: int) -> list[dict[str, Any]]:
    """The curve and the marks of the k-th moment."""
    line: dict[str, Any] = {"width": 6, "color": scene["ink"]}
    hover = "s = %{customdata:.5g} m<br>x = %{x:.5g}, y = %{y:.5g}, z = %{z:.5g} m"
    values = None
    if way is not None:
        values = np.asarray(way["values"])[k].astype("f4")
        line |= {"color": values, "colorscale": way["scale"], "cmin": way["low"], "cmax": way["high"]}
        if way.get("log"):
            line["color"] = np.log10(np.maximum(values, way["low"]))
            line |= {"cmin": np.log10(way["low"]), "cmax": np.log10(way["high"])}
        elif "unit" in way:
            line |= {"showscale": True, "colorbar": {"title": {"text": way["label"]}, "len": 0.7, "thickness": 12}}
    curve = {"type": "scatter3d", "mode": "lines", "name": "cable", "line": line, "showlegend": False}
    curve |= {axis: scene[axis][k] for axis in "xyz"}
    curve |= {"customdata": scene["s"], "hovertemplate": hover + "<extra></extra>"}
    if values is not None and "unit" in (way or {}):
        curve |= {"text": [f"{x:.4g}" for x in values]}
        curve["hovertemplate"] = f"{hover}<br>{(way or {})['key']} %{{text}} {(way or {})['unit']}<extra></extra>"
    marks = []
    for mark in scene["marks"]:
        drawn = {"symbol": mark["symbol"], "color": mark["colour"], "size": mark["size"]}
        named = {"name": mark["name"], "showlegend": bool(mark["name"]), "hoverinfo": "name"}
        places = {axis: mark[axis][k] for axis in "xyz"}
        marks.append({"type": "scatter3d", "mode": "markers", "marker": drawn} | named | places)
    return [curve, *marks]


def _plane(plane: dict[str, Any]) -> dict[str, Any]:
    corners = {key: plane[key] for key in "ijk"} if "i" in plane else {"i": [0, 0], "j": [1, 2], "k": [2, 3]}
    look = {"type": "mesh3d", "color": plane["fill"], "opacity": plane["solid"], "hoverinfo": "skip"}
    where = {axis: plane[axis] for axis in "xyz"}
    return look | where | corners | {"name": plane["name"], "showlegend": True, "flatshading": True}


def _layout(result: Result, scene: dict[str, Any]) -> dict[str, Any]:
    box, title = scene["box"], escape(result.title or "(no title)", quote=False)  # plotly finds no tag in it
    wide, deep = (high - low for low, high in box[:2])
    largest = max(high - low for low, high in box)
    eye = {"x": 0.5, "y": -1.9, "z": 0.5} if wide >= deep else {"x": 1.9, "y": 0.5, "z": 0.5}
    axes = {}
    for axis, (low, high) in zip("xyz", box, strict=True):
        ticks = {"zeroline": False, "nticks": 6 if high - low > 0.3 * largest else 2}
        drawn = {"title": {"text": f"{axis} (m)"}, "backgroundcolor": "#FFFFFF", "gridcolor": _GRID}
        axes[f"{axis}axis"] = drawn | ticks | {"range": [low, high]}
    page = {"height": HEIGHT, "margin": {"l": 0, "r": 0, "t": 36, "b": 0}, "paper_bgcolor": "#FFFFFF"}
    page |= {"title": {"text": title, "font": {"size": 15}, "x": 0.01, "xanchor": "left"}}
    page |= {"legend": {"x": 0.99, "xanchor": "right", "y": 0.99, "yanchor": "top"}, "font": {"color": scene["ink"]}}
    return page | {"scene": {"aspectmode": "data", "camera": {"eye": eye}} | axes}


def _controls(scene: dict[str, Any]) -> dict[str, Any]:
    """The slider, and the buttons that play and stop."""
    times = scene["times"]
    each = 1e3 * max(PLAYED, (times[-1] - times[0]) / scene["speed"]) / len(times)

    def shown(duration: float) -> dict[str, Any]:
        frame = {"duration": duration, "redraw": True}
        return {"mode": "immediate", "fromcurrent": True, "frame": frame, "transition": {"duration": 0}}

    steps = [{"method": "animate", "label": short(t, 4), "args": [[str(k)], shown(0.0)]} for k, t in enumerate(times)]
    slider = {"active": 0, "steps": steps, "x": 0.12, "len": 0.86, "y": 0.0, "pad": {"t": 8, "b": 8}}
    slider |= {"currentvalue": {"prefix": "t = ", "suffix": " s", "xanchor": "left"}, "transition": {"duration": 0}}
    slider |= {"font": {"size": 11}, "ticklen": 3}
    buttons = [
        {"label": "Play", "method": "animate", "args": [None, shown(each)]},
        {"label": "Stop", "method": "animate", "args": [[None], shown(0.0)]},
    ]
    menu = {"type": "buttons", "direction": "left", "buttons": buttons, "showactive": False, "pad": {"t": 28, "r": 8}}
    menu |= {"x": 0.0, "xanchor": "left", "y": 0.0, "yanchor": "top"}
    return {"sliders": [slider], "updatemenus": [menu]}


MIME = "application/vnd.plotly.v1+json"
CONFIG = {"displaylogo": False, "responsive": True}
_scripts_cell: list[str | None] = []  # the cell that brought plotly.js, once one has


def show(result: Result) -> None:
    """Display a result in the cell that runs; NotImplementedError where there is none, as in a terminal."""
    if (shell := _shell()) is None:
        raise NotImplementedError  # IPython then shows what else the result has
    from IPython.display import HTML, display

    display(HTML(result._repr_html_()))
    try:
        figure = plot_space(result)
        display(bundle(figure, with_script=_first(shell)), raw=True)
    except Exception as error:  # a cell must never fail because its result is closed, empty or odd
        reason = (str(error) or type(error).__name__).splitlines()[0]
        display(HTML(f"<small>No picture in space: {escape(reason)}</small>"))


def bundle(figure: Figure, with_script: bool) -> dict[str, Any]:
    """The figure as Jupyter's front ends take it, and as HTML; with_script: plotly.js is in the HTML."""
    data = json.loads(figure.to_json()) | {"config": CONFIG}
    name = f"hybrid-{uuid4().hex}"
    script = parts.page_file("notebook.js").replace("__FIGURE__", script_json(data)).replace("__NAME__", name)
    if with_script:
        script = (
            parts.page_file("unpack.js").replace("__PACKED__", parts.packed(parts.plotly_script().encode())) + script
        )
    page = f'<div id="{name}" style="height:{HEIGHT}px;width:100%;background:#fff"></div><script>{script}</script>'
    return {MIME: data, "text/html": page, "text/plain": "the cable in space, a figure of plotly"}


def _first(shell: Any) -> bool:
    """Whether plotly.js must come with this output: none had it, or the cell that had it runs again."""
    try:
        cell = shell.kernel.get_parent()["metadata"].get("cellId")
    except (AttributeError, KeyError, TypeError):
        cell = None
    if _scripts_cell and (cell is None or cell != _scripts_cell[0]):
        return False
    _scripts_cell[:] = [cell]
    return True


def _shell() -> Any:
    """The shell of IPython in a kernel of Jupyter; None elsewhere."""
    try:
        from IPython import get_ipython
    except ImportError:
        return None
    shell = get_ipython()
    return shell if getattr(shell, "kernel", None) is not None else None


# A result at a glance, as light HTML: title, status, key facts, and a small drawing of shapes and zones.
#
# It costs milliseconds and a few kilobytes.

_POINTS = 120  # on a curve
_SHOWN = ("tension", "bend", "slack", "seabed", "errors")  # facts with a line each
_FRAME = "font-family:system-ui,sans-serif;font-size:13px;line-height:1.45;color:#222;background:#fff;padding:10px 12px"
_FRAME += ";border:1px solid #ddd;border-radius:6px;max-width:900px"


def card(result: Result) -> str:
    """The HTML of one result; it holds no script and asks for nothing from outside."""
    facts = facts_of(result)
    first = attention(facts)
    good = result.done
    n, s = len(result.times), result.s
    span = f"t = {short(result.times[0], 6)} … {short(result.times[-1], 6)} s" if n > 1 else ""
    span = "static" if n == 1 and result.status == "complete" else span
    head = (
        f"{n} output{'s' * (n != 1)}"
        + f", {span}" * bool(span)
        + f"; {len(s)} points on {short(length_of(result), 6)} m"
    )
    status = result.status if good else result.status_text.splitlines()[0]
    colour = GREY if good else ALARM
    rows = [(f.title, f.text) for f in facts if f.key in _SHOWN and f.weight != "absent"]
    cells = "".join(
        f'<tr><td style="text-align:left;vertical-align:top;white-space:nowrap;padding:1px 10px 1px 0;color:{GREY};'
        f'border:0;background:#fff">{escape(title)}</td><td style="text-align:left;padding:1px 0;color:{INK};'
        f'border:0;background:#fff">{escape(text)}</td></tr>'
        for title, text in rows
    )
    alarms = [f"{fact.title}: {fact.text.splitlines()[0]}" for fact in first if fact.key != "status"]
    alarm = "".join(f'<div style="color:{ALARM}">{escape(_cut(text))}</div>' for text in alarms[:3])
    alarm += f'<div style="color:{ALARM}">and {len(alarms) - 3} more</div>' if len(alarms) > 3 else ""
    drawing = f'<div style="flex:0 1 {NARROW:.0f}px;min-width:220px">{picture(result)}</div>' if n else ""
    title = escape(result.title or "(no title)")
    return (
        f'<div style="{_FRAME}"><div style="font-weight:600;font-size:15px">{title}</div>'
        f'<div style="color:{colour}">{escape(_cut(status))}; {escape(head)}</div>{alarm}'
        f'<div style="display:flex;flex-wrap:wrap;gap:14px;margin-top:6px">{drawing}<table style="flex:1 1 280px;'
        f'border-collapse:collapse;font-size:12.5px;margin:0;display:block;border:0">{cells}</table></div></div>'
    )


def _cut(text: str, most: int = 220) -> str:
    return text if len(text) <= most else text[: most - 2].rsplit(" ", 1)[0] + " …"


def picture(result: Result) -> str:
    """SVG: the last shape by zones over earlier ones, seabed and water; below it the zones over time."""
    panels = [shape_of_line(result, most=_POINTS)]
    if len(result.times) > 1 and any(result.zones):
        panels.append(strip(result))
    return draw(panels)


# --- the report --------------------------------------------------------------------------------

# Facts of a line that are alarms where a limit of its sections is broken.
LIMITED = ("tension", "bend", "slack", "quantity")
# Extremes of each line in the table: quantity, bound, heading, unit.
EXTREMES = (
    ("tension", "max", "largest tension", "N"),
    ("tension", "min", "smallest tension", "N"),
    ("curvature", "max", "largest curvature", "1/m"),
    ("bending_moment", "max", "largest bending moment", "N m"),
    ("self_contact", "max", "contact with lines", "N/m"),
)


def statistics_of_all(result: Result, every: AllLines) -> str:
    """Statistics of what the scene asks for, and of every line with a name; of many the worst."""
    found = parts.statistics_html(result)
    for name in filter(None, every.named):
        line = every.lines[name]
        own = parts.statistics_html(line).replace('<section id="statistics">', "<section>")
        found += own.replace("<summary>Statistics of", f"<summary>Line {escape(name)}: statistics of")
    return found + of_others(every, "hybrid stats") * bool(found)


def of_others(every: AllLines, command: str) -> str:
    """That lines are left out on the page, and which command has them; "" where none is."""
    others = len(every.lines) - len(every.named)
    text = f"Of the {len(every.named)} worst lines; <code>{command} --line NAME</code> has the others."
    return f'<p class="quiet">{text}</p>' if others else ""


def facts_of_all(result: Result, every: AllLines) -> list[Fact]:
    """What to know first: of a line alone all, of several warnings with their names, how the run ended, and limits."""
    if every.alone is not None:
        return facts_of(result)
    facts = [*facts_of(result), *limits_of_lines({x: every.lines[x] for x in every.worst})]
    for name in every.worst:
        line = every.lines[name]
        for fact in facts_of(line) if len(line.times) else []:
            if fact.key == "errors" and fact.weight != "absent":
                facts.append(fact._replace(title=f"{fact.title} of line {name}", key=f"{fact.key}-{name}"))
            elif fact.key in LIMITED and fact.weight == "alarm":
                title = f"Line {name}: {fact.title[:1].lower()}{fact.title[1:]}"
                facts.append(fact._replace(title=title, key=f"{fact.key}-{name}", values={}))
    return facts


def facts_and_tables(result: Result, every: AllLines, facts: list[Fact]) -> str:
    """Rows of the summary, and tables of lines with names, points and bodies.

    Errors of lines that are not among the worst fold away.
    """
    tables = _lines(every) * (every.alone is None)
    if len(result.times):
        tables += _points(result) + _bodies(result)
    if every.alone is None:
        facts = [fact for fact in facts if fact.weight != "alarm"]
    several, left = every.outputs > 1, {f"errors-{x}" for x in every.worst if x not in every.named}
    others = parts.facts_html([x for x in facts if x.key in left], several)
    folded = f"<details><summary>Estimated errors of {len(left)} other lines</summary>{others}</details>"
    shown = parts.facts_html([x for x in facts if x.key not in left], several)
    return shown + folded * any(x.key in left for x in facts) + tables


# ---- tables ---------------------------------------------------------------------------------------


def _extreme_text(line: Result, quantity: str, bound: str, unit: str) -> str:
    """A number of the table with its place and time, or that there is none."""
    found = extreme(line, quantity, bound)
    if found is None or (quantity == "bending_moment" and is_without_moment(line)):
        return "–"
    if quantity == "self_contact" and not found.value > 0.0:
        return "–"
    partner = f", {partner_of(line, quantity, found.t) or 'lines'}" * (quantity == "self_contact")
    where = " to ".join(short(s, 5) for s in found.over or (found.s,))
    return f"{amount(found.value, unit)}{partner}\ns = {where} m, t = {short(found.t, 5)} s"


def _lines(every: AllLines) -> str:
    """Extremes of all lines."""
    rows = {
        name: [_extreme_text(line, quantity, bound, unit) for quantity, bound, _, unit in EXTREMES]
        for name, line in every.lines.items()
    }
    seen = [k for k in range(len(EXTREMES)) if any(row[k] != "–" for row in rows.values())]
    lengths = {x: f"{short(float(line.attributes.get('length', line.s[-1])), 6)} m" for x, line in every.lines.items()}
    out = f"<h3>Lines: extremes of all steps{', the worst first' * (len(rows) > len(every.named))}</h3>"
    head = ["line", "length", *(EXTREMES[k][2] for k in seen)]
    shown = [[x, lengths[x], *(rows[x][k] for k in seen)] for x in every.worst]
    out += parts.table_html(shown, head, len(seen) + 1, "lines")
    if any(EXTREMES[k][0] == "bending_moment" and any(row[k] == "–" for row in rows.values()) for k in seen):
        out += '<p class="quiet">A catenary has no bending moment; <code>model: rod</code> computes it.</p>'
    return out


def _largest(result: Result, name: str, unit: str) -> str:
    sizes = np.linalg.norm(result[name], axis=1)
    k = int(sizes.argmax())
    vector = _vector(result[name][k] * prefix(unit, float(sizes[k]))[0], 4)
    return f"{amount(float(sizes[k]), unit)}\n[{vector}], t = {short(result.times[k], 5)} s"


def _points(result: Result) -> str:
    """Where points were, and the largest forces there; "" without points."""
    rows, held = [], fairleads_of(result)
    for name in points_of(result):
        at, force = result[f"points/{name}/position"], f"points/{name}/force"
        row = [name, held.get(name, ""), _vector(at[-1]), _vector(np.ptp(at, axis=0))]
        size = float(np.linalg.norm(result[force], axis=1).max()) if force in result else 0.0
        rows.append((size, [*row, _largest(result, force, "N") if force in result else "–"]))
    if many := len(rows) > parts.MOST_ROWS + 2:
        rows.sort(key=lambda row: -row[0])
    if not rows:
        return ""
    shown = [row if held else [row[0], *row[2:]] for _, row in rows]
    head = ["point", *["on body"] * bool(held), "last place (m)", "range of motion (m)", "largest force of its lines"]
    title = f"<h3>Points{', the largest force first' * many}</h3>"
    return title + parts.table_html(shown, head, 3, "points") + _clamped(result)


def _clamped(result: Result) -> str:
    """Points at which lines are clamped: how they turn, and the moments there."""
    rows = []
    for name in points_of(result):
        turned, moment = f"points/{name}/rotation", f"points/{name}/moment"
        if turned in result:
            x = result[turned]
            rows.append([name, _vector(x[-1]), _vector(np.ptp(x, axis=0)), "–"])
        elif moment in result:
            rows.append([name, "–", "–", _largest(result, moment, "N m")])
    head = ["point with clamped lines", "last roll, pitch, yaw (deg)", "range (deg)", "largest moment of its lines"]
    return parts.table_html(rows, head, numbers=3) if rows else ""


def _bodies(result: Result) -> str:
    moved, loaded = [], []
    for name in bodies_of(result):
        at, turned = result[f"bodies/{name}/position"], result[f"bodies/{name}/rotation"]
        moved.append([name, *(_vector(x) for y in (at, turned) for x in (y[-1], np.ptp(y, axis=0)))])
        loads = (("force", "N"), ("moment", "N m"))
        loaded.append([name, *(_largest(result, f"bodies/{name}/{key}", unit) for key, unit in loads)])
    head = ["body", "last place (m)", "range (m)", "roll, pitch, yaw (deg)", "range (deg)"]
    loads_head = ["body", "largest force of its lines", "largest moment of its lines about its origin"]
    if not moved:
        return ""
    return "<h3>Bodies</h3>" + parts.table_html(moved, head, 4) + parts.table_html(loaded, loads_head, 2)


def _vector(x: np.ndarray, digits: int = 5) -> str:
    least = 1e-9 * float(np.abs(x).max(initial=0.0)) + 1e-9
    return ", ".join(short(float(c), digits) if abs(c) > least else "0" for c in x)


LEAST_FRAMES = 50  # of a moving picture, for which points of many lines are left out
# Part of the largest displacement that one along another axis needs to be shown.
LEAST_MOVE = 0.02


def write_report(result: Result, path: str | Path, *, overwrite: bool = False, modes: Any = None) -> Path:
    """Write the report of a result as .html or .htm and return where it is; ResultError where it cannot be written.

    overwrite: also replace a file that is not a report of hybrid; modes: of its scene (`hybrid.modes`), which it shows.
    """
    target = check_target(path, PAGES, overwrite=overwrite)
    return write_file(target, lambda new: new.write_text(html(result, modes), encoding="utf-8"))


def html(result: Result, modes: Any = None) -> str:
    """The page as text."""
    store, every = Store(), AllLines(result)
    facts, several = facts_of_all(result, every), every.outputs > 1
    shown = _shown(every, [fact.t for fact in facts])
    scene, panels = scenery(result, every, shown, store) or None, _panels(result, every, shown)
    figures = [figure_of(panel, store) for group in panels.values() for panel in group]
    numbers = iter(range(len(figures)))
    numbered = {name: [(next(numbers), panel) for panel in group] for name, group in panels.items()}
    page = {  # in the order of the contents
        "title": escape(result.title or "(no title)"),
        "subtitle": escape("; ".join(_subtitle(result, every))),
        "verdict": parts.verdict_html(facts, several),
        "facts": facts_and_tables(result, every, facts),
        "cable": _space(result, every, scene, shown) if scene else "",
        "figures": _graphs(every, numbered) + (parts.section(modes) if modes is not None else ""),
        "statistics": statistics_of_all(result, every),
        "events": parts.events_html(result, several),
        "energy": _energy(every.alone, numbered["energy"]) if every.alone is not None else "",
        "settings": parts.settings_html(result),
        "scene": escape(result.scene_text),
        "scene_title": "Scene as it was run (YAML)",
        "footer": escape(parts.footer()),
        "mark": REPORT_MARK,
        "index": script_json({"scene": scene, "figures": figures}),
    }
    return parts.filled_page(page, store)


def _subtitle(result: Result, every: AllLines) -> list[str]:
    """Outputs, length of a line alone or number of lines, and when and with what it was computed."""
    n = every.outputs
    outputs = "no output" if n == 0 else "static, one output" if n == 1 and result.status == "complete" else ""
    outputs = outputs or f"{n} output{'s' * (n != 1)} to t = {short(every.times[-1], 6)} s"
    extent = facts_line(result, every)
    if every.alone is not None:
        points = len(every.alone.s)
        extent = [f"{short(length_of(every.alone), 6)} m of cable, {points} point{'s' * (points != 1)}"]
    made = str(result.attributes.get("created", ""))[:16].replace("T", " ")
    return [outputs, *extent, f"computed {made} UTC with hybrid-cable {result.versions.get('hybrid-cable', '?')}"]


def _shown(every: AllLines, moments: list[float | None]) -> dict[str, Kept]:
    """Frames, the same of all lines, and points of each, that the page shows; moments: s, among the frames."""
    one = {name: kept(line) for name, line in every.lines.items()}
    points = {name: x.points for name, x in one.items()}
    total = sum(map(len, points.values()))
    if total > MOST_VALUES // LEAST_FRAMES:  # so that at least some frames are left
        part = MOST_VALUES // LEAST_FRAMES / total
        points = {name: p[even(len(p), max(5, int(part * len(p))))] for name, p in points.items()}
        total = sum(map(len, points.values()))
    frames = even(every.outputs, min(FRAMES_OF_PAGE, max(2, MOST_VALUES // total)))
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
        found["histories"] = [largest_tensions(every)]
    else:
        line = every.alone
        found["zones"] = [zone_map(line, next(iter(shown.values())))] if any(line.zones) else []
        found["histories"] = _histories(line)
        found["energy"] = [panel for panel in (energy(line, "energy"), energy(line, "work")) if panel]
    found["histories"] += [panel for _, panel in (*motions(result, every), *rotations(result, every))]
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
    section = parts.space_html(scene, poster, moves, thinned.notice, caption)
    return section if alone is not None else section.replace("<h2>The cable</h2>", "<h2>The lines</h2>")


def _graphs(every: AllLines, groups: dict[str, list[tuple[int, Panel]]]) -> str:
    """Sections of graphs, those that there are."""
    out, line = "", every.alone
    if groups["zones"] and line is not None:
        out += f'<section id="zones"><h2>Zones over time</h2><p class="quiet">{escape(shares(line))} '
        out += '<span class="screen">Point at a mark, or tap it, to read what happened.</span></p>'
        out += "".join(
            f"<figure>{parts.plot_html(k, f)}{parts.caption_html(k, f)}</figure>" for k, f in groups["zones"]
        )
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
            figures = "".join(parts.figure_html(k, f) for k, f in groups[name])
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
    graphs = f'<div class="grid">{"".join(parts.figure_html(k, f) for k, f in figures)}</div>' if figures else ""
    note = "The last line of work, “scheme”, is what no work accounts for: the time scheme's own." if works else ""
    return (
        f'<section id="energy"><h2>Energy</h2>{graphs}<details{"" if figures else " open"}><summary>The energy balance '
        f'at the last output</summary><p class="quiet">{note}</p>{parts.table_html(cells, ["", "of", "J"], 1)}'
        "</details></section>"
    )
