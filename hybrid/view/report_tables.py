"""Facts, statistics and tables of a report: of lines, of many the worst first, and of points and bodies."""

from __future__ import annotations

from html import escape

import numpy as np

from hybrid.store.envelope import extreme, partner_of
from hybrid.store.reader import Result
from hybrid.view import report_parts as parts
from hybrid.view.along import is_without_moment
from hybrid.view.figure import prefix, short
from hybrid.view.lines import AllLines, bodies_of, fairleads_of, points_of
from hybrid.view.summary import Fact, amount, facts_of, limits_of_lines

# Facts of a line that are alarms where a limit of its sections is broken.
LIMITED = ("tension", "bend", "slack", "quantity")
# Extremes of each line in the table: quantity, bound, heading, unit.
EXTREMES = (
    ("tension", "max", "largest tension", "N"), ("tension", "min", "smallest tension", "N"),
    ("curvature", "max", "largest curvature", "1/m"), ("bending_moment", "max", "largest bending moment", "N m"),
    ("self_contact", "max", "contact with lines", "N/m"),
)  # fmt: skip


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
    """Rows of the summary, and tables of lines with names, points and bodies."""
    tables = _lines(every) * (every.alone is None)
    if len(result.times):
        tables += _points(result) + _bodies(result)
    return _facts(facts, every) + tables


def _facts(facts: list[Fact], every: AllLines) -> str:
    """Rows of the summary; errors of lines that are not among the worst fold away."""
    if every.alone is None:
        facts = [fact for fact in facts if fact.weight != "alarm"]
    several, left = every.outputs > 1, {f"errors-{x}" for x in every.worst if x not in every.named}
    others = parts.facts_html([x for x in facts if x.key in left], several)
    folded = f"<details><summary>Estimated errors of {len(left)} other lines</summary>{others}</details>"
    shown = parts.facts_html([x for x in facts if x.key not in left], several)
    return shown + folded * any(x.key in left for x in facts)


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
