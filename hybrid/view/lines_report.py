"""The report of several lines: all of them in space, tables of lines, points and bodies, graphs, events, the scene."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from hybrid.store.envelope import extreme, partner_of
from hybrid.store.reader import Result
from hybrid.view import report_parts as parts
from hybrid.view.along import is_without_moment
from hybrid.view.decimate import Kept, Store, even, kept
from hybrid.view.figure import BODY, INK, Panel, prefix, short
from hybrid.view.lines import (
    AllLines,
    arms_of,
    bodies_of,
    clearest_view,
    facts_line,
    fairleads_of,
    largest_tensions,
    motions,
    points_of,
    rotations,
    shape,
    tension_ranges,
    views_of_lines,
)
from hybrid.view.panels import ranges
from hybrid.view.plotly_backend import colour_scale, draw
from hybrid.view.scenery import box_and_planes, speed_of
from hybrid.view.summary import Fact, amount, facts_of, limits_of_lines
from hybrid.view.zones import COLOURS

# Numbers of the moving picture, all lines together: frames times points, as of one cable.
MOST_VALUES = 80_000
# Facts of a line that are alarms where a limit of its sections is broken.
LIMITED = ("tension", "bend", "slack", "quantity")
# Extremes of each line in the table: quantity, bound, heading, unit.
EXTREMES = (
    ("tension", "max", "largest tension", "N"), ("tension", "min", "smallest tension", "N"),
    ("curvature", "max", "largest curvature", "1/m"), ("bending_moment", "max", "largest bending moment", "N m"),
    ("self_contact", "max", "contact with lines", "N/m"),
)  # fmt: skip


class ReportOfLines:
    """What the page of lines with names has of its own."""

    def __init__(self, result: Result, store: Store) -> None:
        self._result, self._every = result, AllLines(result)
        self.facts, self.several = facts_of_all(result, self._every), self._every.outputs > 1
        self._shown = _kept(self._every)
        self.scene = scenery(result, self._every, self._shown, store) if self._every.outputs else None
        self.panels = _panels(result, self._every, self._shown)

    @property
    def subtitle(self) -> list[str]:
        """Outputs, lines and bodies."""
        n, times = self._every.outputs, self._every.times
        outputs = f"{n} outputs to t = {short(times[-1], 6)} s" if n > 1 else "static, one output" if n else "no output"
        return [outputs, *facts_line(self._result, self._every)]

    def sections(self, numbered: dict[str, list[tuple[int, Panel]]]) -> dict[str, str]:
        """Sections by their names in the template; numbered: the graphs."""
        result, every, plain = self._result, self._every, [f for f in self.facts if f.weight != "alarm"]
        return {
            "facts": _facts(plain, every) + _tables(result, every),
            "cable": _space(result, every, self.scene, self._shown) if self.scene else "",
            "figures": _graphs(numbered, every),
            "statistics": _statistics(result, every),
            "energy": "",
        }


def _statistics(result: Result, every: AllLines) -> str:
    """Statistics of what the scene asks for, and of every line; of many the worst."""
    found = parts.statistics_html(result)
    for name in every.named:
        line = every.lines[name]
        own = parts.statistics_html(line).replace('<section id="statistics">', "<section>")
        found += own.replace("<summary>Statistics of", f"<summary>Line {escape(name)}: statistics of")
    return found + _of_others(every, "hybrid stats") * bool(found)


def _of_others(every: AllLines, command: str) -> str:
    """That lines are left out on the page, and which command has them; "" where none is."""
    others = len(every.lines) - len(every.named)
    text = f"Of the {len(every.named)} worst lines; <code>{command} --line NAME</code> has the others."
    return f'<p class="quiet">{text}</p>' if others else ""


def facts_of_all(result: Result, every: AllLines) -> list[Fact]:
    """What to know first: warnings with the names of lines, how the run ended, and limits of each line."""
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


def _facts(facts: list[Fact], every: AllLines) -> str:
    """Rows of the summary; errors of lines that are not among the worst fold away."""
    several, left = every.outputs > 1, {f"errors-{x}" for x in every.worst if x not in every.named}
    others = parts.facts_html([x for x in facts if x.key in left], several)
    folded = f"<details><summary>Estimated errors of {len(left)} other lines</summary>{others}</details>"
    shown = parts.facts_html([x for x in facts if x.key not in left], several)
    return shown + folded * any(x.key in left for x in facts)


def _kept(every: AllLines) -> dict[str, Kept]:
    """Frames, the same of all lines, and points of each, that the page shows."""
    points = {name: kept(line).points for name, line in every.lines.items()}
    total = sum(map(len, points.values()))
    if total > MOST_VALUES // 50:  # so that at least some frames are left
        part = MOST_VALUES // 50 / total
        points = {name: p[even(len(p), max(5, int(part * len(p))))] for name, p in points.items()}
        total = sum(map(len, points.values()))
    frames = even(every.outputs, min(1000, max(2, MOST_VALUES // total)))
    return {name: Kept(frames, p, every.outputs, len(every.lines[name].s)) for name, p in points.items()}


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


def _tables(result: Result, every: AllLines) -> str:
    """Extremes of all lines, forces at points, and where bodies were."""
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
    if len(result.times):
        out += _points(result) + _bodies(result)
    return out


def _largest(result: Result, name: str, unit: str) -> str:
    sizes = np.linalg.norm(result[name], axis=1)
    k = int(sizes.argmax())
    vector = _vector(result[name][k] * prefix(unit, float(sizes[k]))[0], 4)
    return f"{amount(float(sizes[k]), unit)}\n[{vector}], t = {short(result.times[k], 5)} s"


def _points(result: Result) -> str:
    rows, held = [], fairleads_of(result)
    for name in points_of(result):
        at, force = result[f"points/{name}/position"], f"points/{name}/force"
        row = [name, held.get(name, ""), _vector(at[-1]), _vector(np.ptp(at, axis=0))]
        size = float(np.linalg.norm(result[force], axis=1).max()) if force in result else 0.0
        rows.append((size, [*row, _largest(result, force, "N") if force in result else "–"]))
    if many := len(rows) > parts.MOST_ROWS + 2:
        rows.sort(key=lambda row: -row[0])
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


# ---- graphs ---------------------------------------------------------------------------------------


def _panels(result: Result, every: AllLines, shown: dict[str, Kept]) -> dict[str, list[Panel]]:
    if not every.outputs:
        return {"histories": [], "ranges": []}
    over = (
        [largest_tensions(result, every), *motions(result, every), *rotations(result, every)]
        if every.outputs > 1
        else []
    )
    along = [
        panel._replace(key=f"{panel.key}-{name}", title=f"line {name}: {panel.title}")
        for name in every.named
        for panel in ranges(every.lines[name], shown[name])
    ]
    return {"lines": _of_many(result, every), "histories": over, "ranges": along}


def _of_many(result: Result, every: AllLines) -> list[Panel]:
    """A plan with names, and the tensions of the worst lines, where there are many."""
    if len(every.named) == len(every.lines):
        return []
    plans = [shape(result, every, view)._replace(key="plan") for view in views_of_lines(every) if not view.upright]
    return [*plans, tension_ranges(every)]


def _graphs(groups: dict[str, list[tuple[int, Panel]]], every: AllLines) -> str:
    out = ""
    heads = {
        "lines": ("All lines", "The worst lines are in colour."),
        "histories": ("Over time", "Click a graph to set the time."),
        "ranges": ("Along the lines", "Lowest, mean and highest of all outputs, and now: the time of the slider."),
    }
    for name, figures in groups.items():
        if figures:
            drawn = "".join(parts.figure_html(k, panel) for k, panel in figures)
            title, text = heads[name]
            out += f'<section id="{name}"><h2>{title}</h2><p class="quiet">{text}</p>'
            out += f'<div class="grid">{drawn}</div>{_of_others(every, "hybrid plot") * (name == "ranges")}</section>'
    return out


# ---- in space -------------------------------------------------------------------------------------


def scenery(result: Result, every: AllLines, shown: dict[str, Kept], store: Store) -> dict[str, Any]:
    """What the moving picture needs: all lines as one curve with gaps, points and bodies as marks."""
    frames = next(iter(shown.values())).frames
    box, planes, far = box_and_planes(every.as_result)
    factors = np.maximum(0.45 * np.ptp(box, axis=0).max() / np.ptp(box, axis=0), 1.0)
    gap = np.full((len(frames), 1), np.nan)
    curves: dict[str, list[np.ndarray]] = {"x": [], "y": [], "z": [], "s": [], "tension": [], "line": []}
    for k, name in enumerate(every.colours):
        line, rows = every.lines[name], np.ix_(frames, shown[name].points)
        for axis, at in zip("xyz", line.position[rows].transpose(2, 0, 1), strict=True):
            curves[axis] += [at, gap]
        curves["s"].append(np.append(line.s[shown[name].points], np.nan))
        curves["tension"] += [line.tension[rows], gap]
        curves["line"].append(np.full((len(frames), len(shown[name].points) + 1), k))
    for name in bodies_of(result):
        arms = arms_of(result, name, frames)
        for axis, at in zip("xyz", arms.transpose(2, 0, 1), strict=True):
            curves[axis] += [at, gap]
        curves["s"].append(np.full(arms.shape[1] + 1, np.nan))
        curves["tension"].append(np.zeros((len(frames), arms.shape[1] + 1)))
        curves["line"].append(np.full((len(frames), arms.shape[1] + 1), len(every.lines)))
    tension = np.nan_to_num(np.concatenate(curves["tension"], axis=1))
    factor, unit = prefix("N", float(np.abs(tension).max()))
    named = [(every.label(name), colour) for name, colour in every.colours.items()]
    named += [("bodies", INK)] * bool(bodies_of(result))
    count = len(named)
    steps = [[(k + d) / count, colour] for k, (_, colour) in enumerate(named) for d in (0, 1)]
    by_line: dict[str, Any] = {
        "key": "line",
        "label": "line",
        "values": store.add(np.concatenate(curves["line"], axis=1), "u1"),
    }
    by_line |= {"scale": steps, "legend": [list(x) for x in dict.fromkeys(named)], "low": -0.5, "high": count - 0.5}
    low, high = float(tension.min() * factor), float(tension.max() * factor)
    by_tension: dict[str, Any] = {
        "key": "tension",
        "label": f"tension ({unit})",
        "values": store.add(tension * factor),
        "unit": unit,
    }
    by_tension |= {"scale": colour_scale(COLOURS["catenary"][2:]), "low": low, "high": high or 1.0, "log": False}
    return {
        "times": [float(every.times[k]) for k in frames], "s": store.add(np.concatenate(curves["s"])),
        **{axis: store.add(np.concatenate(curves[axis], axis=1)) for axis in "xyz"},
        "colours": [by_line, by_tension], "marks": _marks(result, frames, store),
        "planes": planes, "far": far, "box": box.T.tolist(), "factors": factors.tolist(), "ink": INK,
        "speed": speed_of(every.as_result),
    }  # fmt: skip


def _marks(result: Result, frames: np.ndarray, store: Store) -> list[dict[str, Any]]:
    """Bodies, then points and an empty mark: the page lists all but the last two in its legend."""
    groups: list[tuple[str, np.ndarray, str, str, int]] = [
        (f"body {n}", result[f"bodies/{n}/position"][frames][:, None], "square", BODY, 6) for n in bodies_of(result)
    ]
    places = np.stack([result[f"points/{n}/position"][frames] for n in points_of(result)], axis=1)
    groups += [("points", places, "circle", INK, 3), ("", places[:, :0], "circle", INK, 1)]
    return [
        {"name": name, "symbol": symbol, "colour": colour, "size": size}
        | {axis: store.add(at[..., k]) for k, axis in enumerate("xyz")}
        for name, at, symbol, colour, size in groups
    ]


def _space(result: Result, every: AllLines, scene: dict[str, Any], shown: dict[str, Kept]) -> str:
    poster = draw([shape(result, every, clearest_view(every))])
    thinned = next(iter(shown.values()))
    moves = len(thinned.frames) > 1
    when = (
        f", t = {short(every.times[0], 5)} to {short(every.times[-1], 5)} s; on paper the last shapes" if moves else ""
    )
    caption = f"{result.title or 'All lines'}{when}."
    section = parts.space_html(scene, poster, moves, thinned.notice, caption)
    return section.replace("<h2>The cable</h2>", "<h2>The lines</h2>")
