"""Pages of a study, and pictures of a design.

The page of a study has ranges, response curves, exceedance, parallel coordinates, and a table to sort and filter.  A
design has the lines of every case before and after, and histories that were measured.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from html import escape
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.store.study_file import DONE, FAILED, OPEN, counts_of, open_study, unmet_accuracy
from hybrid.store.tradeoff_table import OURS, Row, TradeTable
from hybrid.view.figure import (
    BED,
    GREY,
    INK,
    KIND_COLOURS,
    PAGES,
    REPORT_MARK,
    SMALL,
    Axis,
    Box,
    Item,
    Line,
    Marks,
    Page,
    Panel,
    Rule,
    Text,
    check_target,
    colour_of,
    save_figure,
    short,
    write_file,
)
from hybrid.view.modes_page import grid_of, oblique_view
from hybrid.view.report_parts import footer, packed, page_file, page_of, plotly_script, table_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 2  # panels beside each other
WIDE = 4.0  # inches, of one,
HIGH = 2.9  # and its height
# Of its widest extent in plan: lines that are no wider across are drawn in one upright plane.
FLAT = 0.05
NUMBERS = 6  # of unknowns in the head


def plot_design(found: Any, target: Path) -> None:
    """Draw every case of what `hybrid.design` returns in a panel, as PNG, PDF or SVG."""
    from hybrid.view.matplotlib_backend import draw_page

    save_figure(draw_page(_design_page(found)), target)


def _design_page(found: Any) -> Page:
    every = [
        np.asarray(r) for shapes in (found.before, found.after) for lines in shapes.values() for r in lines.values()
    ]
    view, across = _view(np.concatenate(every))
    panels = {str(k): _case_panel(found, case, str(k), view, across) for k, case in enumerate(found.after)}
    histories = getattr(found, "histories", ())
    for history in histories:
        panels[str(len(panels))] = _history(history, str(len(panels)))
    mosaic, size = grid_of(panels, COLUMNS, WIDE, HIGH, 0.8)
    changes = [f"{name} {short(found.start[name], 4)} → {short(x, 4)}" for name, x in found.numbers.items()]
    more = f", and {len(changes) - NUMBERS} more" if len(changes) > NUMBERS else ""
    facts = ", ".join(changes[:NUMBERS]) + more
    named = [*panels][-1] if histories else "0"
    return Page(found.title or "(no title)", facts, 2, panels, mosaic, legend=(named,), size=size)


def _case_panel(found: Any, case: str, key: str, view: Any, across: str) -> Panel:
    items: list[Item] = []
    if found.bed is not None and across:
        items.append(Rule("y", [found.bed], colour=BED, dash=""))
    for shapes, label, look in (
        (found.before, "before", {"colour": GREY, "width": 0.9, "dash": "dash"}),
        (found.after, "after", {"colour": colour_of("catenary"), "width": 1.4}),
    ):
        for k, r in enumerate(shapes[case].values()):
            at = np.asarray(r) @ view.T
            items.append(Line(at[:, 0], at[:, 1], label="" if k else label, **look))  # type: ignore[arg-type]
    for r in getattr(found, "measured", {}).get(case, {}).values():
        at = np.asarray(r) @ view.T
        items.append(Marks(at[:, 0], at[:, 1], "o", label="measured", face=""))
    return Panel(key, case, Axis(across, "m"), Axis("z" if across else "", "m"), items, aspect=1.0)


def _history(history: Any, key: str) -> Panel:
    """What was measured over time beside what the scene has of it, before and after."""
    items: list[Item] = [
        Line(history.t, history.before, colour=GREY, width=0.9, dash="dash", label="before"),
        Line(history.t, history.after, colour=colour_of("catenary"), width=1.4, label="after"),
        Marks(history.t, history.measured, "o", label="measured", face=""),
    ]
    return Panel(key, history.case, Axis("t", "s"), Axis(history.result, history.unit), items)


def _view(places: Any) -> tuple[Any, str]:
    """(2, 3): to the right and upwards in the picture, and what is to the right; "": seen from beside and above."""
    flat = places[:, :2] - places[:, :2].mean(axis=0)
    _, sizes, axes = np.linalg.svd(flat, full_matrices=False)
    if sizes[1] > FLAT * sizes[0]:
        return oblique_view({"": places}), ""
    along = axes[0] * np.sign(axes[0][np.abs(axes[0]).argmax()] or 1.0)
    angle = math.degrees(math.atan2(along[1], along[0]))
    name = "x" if abs(angle) < 1.0 else "y" if abs(angle - 90.0) < 1.0 else f"horizontal, {short(angle, 3)}° from x"
    return np.array([[along[0], along[1], 0.0], [0.0, 0.0, 1.0]]), name


STATUS = {OPEN: "open", DONE: "done", FAILED: "failed"}
# Own columns of a study, behind what was varied and kept.
OWN = ("cpu", "steps", "events", "accuracy_used", "accuracy_verdict", "reason")


def write_study_report(study: str | Path, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write the page of a study (a Zarr folder) as .html and return where it is; ResultError where it cannot be."""
    target = check_target(path, PAGES, overwrite=overwrite)
    return write_file(target, lambda new: new.write_text(html(Path(study)), encoding="utf-8"))


def html(study: Path) -> str:
    """The page as text."""
    found = open_study(study)
    variables = [name for name in json.loads(found.attrs["variables"]) if name in found]
    results = sorted(
        str(name)
        for name in found.data_vars
        if found[name].dims == ("case",) and name not in (*OWN, "status") and found[name].dtype.kind == "f"
    )
    columns = {"case": _column(found, "case")} | {name: _column(found, name) for name in variables}
    columns["status"] = {"unit": "", "description": "", "values": [STATUS[int(k)] for k in found["status"].values]}
    columns |= {name: _column(found, name) for name in (*results, *OWN) if name in found}
    texts = [name for name, each in columns.items() if any(isinstance(x, str) for x in each["values"])]
    again = f"hybrid study {study.name} --case 0 -o case0.h5"
    data = {"columns": columns, "variables": variables, "results": results, "texts": texts, "again": again}
    counts = counts_of(found["status"].values)
    parts = {
        "title": escape(str(found.attrs["title"])),
        "subtitle": escape(_subtitle(found, counts)),
        "failures": _failures(found) + _accuracy(found),
        "ranges": _ranges(found, results),
        "shares": _shares(found),
        "example": escape(_example(found, variables)),
        "again": escape(again),
        "footer": escape(footer()),
        "mark": REPORT_MARK,
        "css": page_file("report.css") + page_file("study.css"),
        "js": page_file("study.js"),
        "data": packed(json.dumps(data, allow_nan=False).encode()),
        "plotly": packed(plotly_script().encode()),
    }
    return page_of("study.html", parts)


def _column(found: Any, name: str) -> dict[str, Any]:
    values = found[name].values
    if values.dtype.kind == "f":
        plain: list[Any] = [x if np.isfinite(x) else None for x in values.tolist()]
    else:
        plain = [x if isinstance(x, int | str) else str(x) for x in values.tolist()]
    attrs = found[name].attrs
    return {"unit": attrs.get("units", ""), "description": attrs.get("long_name", ""), "values": plain}


def _subtitle(found: Any, counts: dict[str, int]) -> str:
    n, spent = found.sizes["case"], float(np.nansum(found["cpu"].values))
    left = f", {counts['left']} not yet computed" if counts["left"] else ""
    made = str(found.attrs["created"])[:16].replace("T", " ")
    return (
        f"{n} cases of {found.attrs['scene_file']}: {counts['done']} done, {counts['failed']} failed{left}; "
        f"{spent:.3g} s of processor time; begun {made} UTC with hybrid-cable {found.attrs['version_hybrid']}"
    )


def _failures(found: Any) -> str:
    """Reasons of failures, and of what could not be kept of cases that are done, those of most cases first."""
    failed, reason = found["status"].values == FAILED, found["reason"].values
    return _reasons(found, failed, "failed") + _reasons(found, ~failed & (reason != ""), "not kept in full")


def _reasons(found: Any, failed: np.ndarray, what: str) -> str:
    if not failed.any():
        return ""
    reasons: dict[str, list[int]] = {}
    for number, reason in zip(found["case"].values[failed].tolist(), found["reason"].values[failed], strict=True):
        reasons.setdefault(str(reason).split(" (t = ")[0], []).append(number)
    rows = "".join(
        f"<li><b>{len(numbers)} case{'s' * (len(numbers) > 1)}</b>, such as {numbers[0]}: {escape(text)}</li>"
        for text, numbers in sorted(reasons.items(), key=lambda item: -len(item[1]))
    )
    return f'<div class="attention" role="alert"><h2>{int(failed.sum())} {what}</h2><ul>{rows}</ul></div>'


def _accuracy(found: Any) -> str:
    """How many cases missed the accuracy asked, or had it not verified, which is worst, and what to do."""
    rows = "".join(f"<li>{escape(str(unmet))}</li>" for unmet in unmet_accuracy(found))
    return f'<div class="attention" role="alert"><h2>Accuracy asked</h2><ul>{rows}</ul></div>' if rows else ""


def _ranges(found: Any, results: list[str]) -> str:
    rows = []
    for name in results:
        values = found[name].values
        if np.isfinite(values).any():
            worst = found["case"].values[int(np.nanargmax(values))]
            figures = (np.nanmin(values), np.nanmedian(values), np.nanmax(values))
            about = (str(found[name].attrs.get(key, "")) for key in ("long_name", "units"))
            rows.append([name, *about, *(f"{x:.5g}" for x in (*figures, worst))])
    return table_html(rows, ("", "what it is", "unit", "smallest", "median", "largest", "in case"), numbers=4)


def _shares(found: Any) -> str:
    """What `hybrid.shares` has found of results: a table of each, or why it claims nothing."""
    parts = []
    for name, each in json.loads(found.attrs.get("shares", "{}")).items():
        heads = ("", "derivative", "share", "first order from", "to", "Sobol: first order", "total")
        keys = ("derivative", "share", "low", "high", "first", "total")
        rows = [[x["variable"], *("" if x[k] != x[k] else f"{x[k]:.4g}" for k in keys)] for x in each["rows"]]
        about = f"R² {each['r2']:.4f} over {each['cases']} cases"
        about = f"No shares: {escape(each['why'])}." if each["why"] else f"{escape(each['of'])} at the mean; {about}."
        table = table_html(rows, heads, numbers=len(keys))
        parts.append(f'<h3>{escape(name)}</h3><p class="quiet">{about}</p>{table}')
    if not parts:
        return ""
    return f'<section id="shares"><h2>Shares of the spread, by derivatives</h2>{"".join(parts)}</section>'


def _example(found: Any, variables: list[str]) -> str:
    """A filter that could be meant."""
    numbers = [name for name in variables if found[name].dtype.kind == "f"]
    parts = [f"{name} > {float(np.nanmedian(found[name].values)):.4g}" for name in numbers[:2]]
    return " and ".join(parts) or "failed"


# The page of a tradeoff study: error against CPU time, a line for every model.
#
# The large panel shows the error relative to the target accuracy, of the quantity where it is largest.
# Beside it are the errors themselves. Pages read rows and compute nothing.

# Colours that no kind of zone has, of the same family; other codes are grey, apart by their marks.
COLOURS = {"adaptive": "#CC79A7", "zones": "#56B4E9"} | KIND_COLOURS
MARKS = {"rod": "o", "catenary": "s", "adaptive": "D", "zones": "v"}
_PEER_MARKS = ("P", "X", "p", "d")
_MET, STAR = "#009E73", "#F0E442"
_BESIDE = 1.8  # of the smallest and largest value, times that which an axis leaves beside them
_LEAST_DECADES = 1.0  # a vertical axis spans at least so many, or differences of a few per cent would look like much
# Where the accuracy (of others: the number of elements) stands beside its point, in points of type: in turn on either
# side, so that of points that are close both can be read.
_BESIDE_A_POINT = ((7, 2), (-7, -6), (7, -8), (-7, 4))
_SIZE = (8.0, 5.0)  # of the page, inches
Figures = Callable[[Row], float | None]


def plot_trade(table: TradeTable, path: str | Path | None = None, *, overwrite: bool = False) -> Figure:
    """One page: error against CPU time on logarithmic axes, the front and what is recommended marked.

    path: where to save it, as .png, .pdf or .svg (see plot_summary).
    """
    from hybrid.view.matplotlib_backend import draw_page

    return save_figure(draw_page(_page(table)), path, overwrite=overwrite)


def _page(table: TradeTable) -> Page:
    if not table.choices:
        return Page(table.title or "(no title)", table.recommendation, 2, size=_SIZE, empty="no finished run")
    part = table.target if table.target.strip().endswith("%") else ""
    scale = float(part.strip().rstrip("%")) if part else 1.0
    title, up = "error relative to the target accuracy", ("error / target", "")
    if part:
        title, up = "larger error: position / length, end force / largest", ("error", "%")
    asked = (scale, f"target {table.target}")
    panels = {"score": _panel(table, title, up, lambda row: scale * table.score(row), asked, named=True)}
    for name, unit, bound in (("position", "m", table.bound_position), ("end_force", "N", table.bound_end_force)):
        if any(getattr(row, name) is not None for row in table.choices):
            title = f"error of {'position' if name == 'position' else 'end forces'}"
            limit, doubt = (bound, ""), table.doubt(name)
            panels[name] = _panel(table, title, ("", unit), attrgetter(name), limit, doubt=doubt)
    mosaic = [["score", name if name in panels else "."] for name in ("position", "end_force")]
    look: dict[str, Any] = {"mosaic": mosaic, "widths": [1.7, 1.0], "legend": ["score"], "size": _SIZE}
    return Page(table.title or "(no title)", table.recommendation, 2, panels, **look)


def _panel(
    table: TradeTable,
    title: str,
    up: tuple[str, str],
    figure_of: Figures,
    limit: tuple[float | None, str],
    *,
    doubt: float = 0.0,
    named: bool = False,
) -> Panel:
    """A line for every model, its accuracies in a row; rings: the front; the star: what is recommended.

    limit: the target and its label; doubt: the error of the reference; named: accuracies beside their points.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in table.choices:
        if figure_of(row):
            groups.setdefault((row.code, row.model), []).append(row)
    peers = list(dict.fromkeys(code for code, _ in groups if code != OURS))
    items: list[Item] = []
    for n, ((code, model), rows) in enumerate(groups.items()):
        ours = code == OURS
        colour = COLOURS.get(model, INK) if ours else GREY
        symbol = MARKS.get(model, "h") if ours else _PEER_MARKS[peers.index(code) % len(_PEER_MARKS)]
        dash, name = ("", model) if ours else ("dot", code)
        items.append(Line(*_places(rows, figure_of), name, colour, 1.2, dash, symbol=symbol, size=4.5))
        for k, row in enumerate(rows if named else ()):
            text = row.asked if ours else row.asked.split()[0]
            side, lift = _BESIDE_A_POINT[(n + 2 * k) % len(_BESIDE_A_POINT)]
            x, y = row.cpu or 0.0, figure_of(row) or 0.0
            across = "left" if side > 0 else "right"
            items.append(Text(x, y, text, colour, (side, lift), across, "baseline", SMALL - 1.0))
    front = [row for row in table.front() if figure_of(row)]
    best = [row for row in front if row == table.recommended]
    for chosen, symbol, name, face, size in (
        (front, "o", "Pareto front", "", 10.0),
        (best, "*", "recommended", STAR, 15.0),
    ):
        items += [Marks(*_places(chosen, figure_of), symbol, name, face, INK, 0.9, size)] * bool(chosen)
    costs = [row.cpu for rows in groups.values() for row in rows if row.cpu]
    errors = [z for rows in groups.values() for row in rows if (z := figure_of(row))]
    left, right = _spanned(min(costs), max(costs)) if costs else (0.1, 1.0)
    low, high = _spanned(min(errors), max(errors)) if errors else (0.1, 1.0)
    value, text = limit
    if value and low < value < 3.0 * high:  # a line far from every point would squeeze them
        high = 1.5 * value if value > high / 1.2 else high
        items += [Box(None, (low, value), colour=_MET, opacity=0.05), Rule("y", [value], "", _MET, 1.0, "dash")]
        items.append(Text(1.0, value, text, _MET, (-4.0, 3.0), "right", parts="x"))
    if doubt > low:  # below the error of the reference nothing is known
        items.append(Box(None, (low, doubt), colour=GREY, opacity=0.18))
        items.append(Text(0.0, doubt, "error of the reference", GREY, (4.0, -3.0), up="top", parts="x"))
    cpu = Axis("CPU time", "s", left, right, log=True)
    return Panel("trade", title, cpu, Axis(*up, low, high, log=True), items)


def _places(rows: list[Row], figure_of: Figures) -> tuple[np.ndarray, np.ndarray]:
    return np.array([row.cpu or 0.0 for row in rows]), np.array([figure_of(row) or 0.0 for row in rows])


def _spanned(low: float, high: float) -> tuple[float, float]:
    low, high = low / _BESIDE, high * _BESIDE
    short = 10.0**_LEAST_DECADES / (high / low)
    return (low / short**0.5, high * short**0.5) if short > 1.0 else (low, high)
