"""Pages of several runs, laid over each other or of a study, and pictures of a design.

Runs that are compared have one page with their numbers, their curves, and how far they are from the first.
The page of a study has ranges, response curves, exceedance, parallel coordinates, and a table to sort and filter.  A
design has the lines of every case before and after, and histories that were measured.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from difflib import unified_diff
from html import escape
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.envelope import BROKEN, NOT_VERIFIED
from hybrid.store.reader import Result
from hybrid.store.study_file import DONE, FAILED, OPEN, counts_of, open_study, ranges_of, reasons_of, unmet_accuracy
from hybrid.store.tables import OURS, Row, TradeTable
from hybrid.store.verdicts import quantity_limits, section_limits
from hybrid.view import report_parts as parts
from hybrid.view.curves import Store, along, script_json, worst
from hybrid.view.figure import (
    BED,
    GREY,
    INK,
    KIND_COLOURS,
    PAGES,
    REPORT_MARK,
    SMALL,
    ZERO,
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
    prefix,
    save_figure,
    short,
    title_of,
    write_file,
)
from hybrid.view.panels import RANGES, end_force, only_line
from hybrid.view.plotly_backend import figure_of
from hybrid.view.projections import views_of
from hybrid.view.summary import amount, length_of
from hybrid.view.zones import warnings_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# --- runs laid over each other -----------------------------------------------------------------

Curve = tuple[np.ndarray, np.ndarray]
OF_RUNS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
# Extremes in the table: quantity, whether the lowest, heading.
_LARGEST = "tension", "curvature", "bending_moment", "torque"
EXTREMES = [(x, False, f"largest {x.replace('_', ' ')}") for x in _LARGEST]
EXTREMES[1:1] = [("tension", True, "lowest tension")]
EXTREMES += [("contact", False, "largest contact force")]


def write_comparison(
    results: Mapping[str, Result] | Sequence[Result], path: str | Path, *, overwrite: bool = False
) -> Path:
    """Write one page that lays 2 to 6 results over each other and return where it is.

    results: by the name that each has on the page, or in order, which are called by their files; the first is the one
    that others are compared with.  Differences
    at an instant are taken where outputs of both have the same time, at the places that both have, on the left of
    jumps.  ResultError: one or more than six results, several lines in one, or a page that cannot be written.
    """
    if not isinstance(results, Mapping):
        results = {f"{k}: {'in memory' if x.file is None else x.file.stem}": x for k, x in enumerate(results, 1)}
    if not 2 <= len(results) <= len(OF_RUNS):
        raise ResultError(f"a comparison is of 2 to {len(OF_RUNS)} results, and {len(results)} were given")
    results = {name: only_line(result, "a comparison") for name, result in results.items()}
    for result in results.values():
        if not len(result.times):
            raise ResultError("a comparison needs results with an output, and one has none")
    target = check_target(path, PAGES, overwrite=overwrite)
    return write_file(target, lambda new: new.write_text(_html(results), encoding="utf-8"))


def _html(results: Mapping[str, Result]) -> str:
    store = Store()
    groups = {
        "shape": ("Shape", "The last output of each.", [_shape(results)]),
        "histories": ("Over time", "", _histories(results)),
        "ranges": ("Along the cable", "Highest and lowest value of all outputs.", _ranges_along(results)),
        "differences": ("Differences at the same instant", "", _differences(results)),
    }
    text, figures = "", list[dict[str, Any]]()
    for key, (title, note, panels) in groups.items():
        if panels:
            drawn = "".join(parts.figure_html(k, panel, 0) for k, panel in enumerate(panels, len(figures)))
            figures += [figure_of(panel, store) for panel in panels]
            text += f'<section id="{key}"><h2>{title}</h2><p class="quiet">{note}</p>'
            text += f'<div class="grid">{drawn}</div></section>'
    first = next(iter(results))
    page = dict.fromkeys(("statistics", "cable", "events", "energy"), "") | {
        "title": escape(f"{', '.join(results)}: compared"),
        "subtitle": escape("; ".join(f"{name}: {r.title or '(no title)'}" for name, r in results.items())),
        "verdict": f'<section id="verdict" aria-label="Verdict">{_verdict(results)}</section>',
    }
    page |= {"facts": _table(results), "figures": text, "settings": _scenes(results), "mark": REPORT_MARK}
    page |= {"scene_title": escape(f"Scene of {first} (YAML)"), "scene": escape(results[first].scene_text)}
    page |= {"footer": escape(parts.footer()), "index": script_json({"scene": None, "figures": figures})}
    return parts.filled_page(page, store)


# ---- numbers --------------------------------------------------------------------------------------


def _verdict(results: Mapping[str, Result]) -> str:
    """How each ended, its warnings and its broken limits."""
    lines, bad = [], False
    for name, result in results.items():
        kinds = [event.kind for event, _ in warnings_of(result)]
        held = [(x.limit, x.verdict) for x in section_limits(result)]
        held += [(x.name, x.verdict) for x in quantity_limits(result)]
        broken, open_ = ([name for name, verdict in held if verdict == word] for word in (BROKEN, NOT_VERIFIED))
        bad |= bool(kinds or broken) or not result.done
        told = [result.status_text.splitlines()[0], ", ".join(kinds) or "no warnings"]
        told += [f"broken: {', '.join(broken)}"] if broken else []
        told += [f"not verified: {', '.join(open_)}"] if open_ else []
        lines.append(f"<li><b>{escape(name)}.</b> {escape('; '.join(told))}</li>")
    look = "attention" if bad else "attention well"
    head = "How they ended, and what they warn of" if bad else "All are complete, without warnings"
    return f'<div class="{look}"><h2>{head}</h2><ul>{"".join(lines)}</ul></div>'


def _table(results: Mapping[str, Result]) -> str:
    """Extremes and sizes of each, and how far they are from those of the first."""
    rows = [["length", *(f"{short(length_of(r), 6)} m" for r in results.values())]]
    rows.append(["last output at t =", *(f"{short(r.times[-1], 6)} s" for r in results.values())])
    rows.append(["steps", *(str(len(r["steps/t"])) if "steps/t" in r else "–" for r in results.values())])
    for name, lowest, head in EXTREMES:
        found = {key: worst(r, name, lowest=lowest).value for key, r in results.items() if name in r}
        if max(map(abs, found.values()), default=0.0) <= ZERO:
            continue
        cells, known = [], found.get(next(iter(results)))
        for k, (key, r) in enumerate(results.items()):
            if key not in found:  # a cable without bending stiffness has no bending moment
                cells.append("–")
                continue
            x, part = found[key], ""
            if k and known is not None and abs(known) > ZERO:
                part = f" ({'+' if x > known else ''}{short(100.0 * (x - known) / abs(known), 3)} %)"
            cells.append(amount(x, r.units[name]) + part)
        rows.append([head, *cells])
    return parts.table_html(rows, ["", *results], numbers=len(results))


def _scenes(results: Mapping[str, Result]) -> str:
    """What is different in the scenes."""
    (first, base), *others = results.items()
    out = ""
    for name, result in others:
        lines = unified_diff(
            base.scene_text.splitlines(), result.scene_text.splitlines(), first, name, lineterm="", n=1
        )
        text = "\n".join(lines) or "The scenes are the same."
        title = escape(f"What {name} has another way than {first}")
        out += f'<details open><summary>{title}</summary><pre tabindex="0">{escape(text)}</pre></details>'
    return out


# ---- graphs ---------------------------------------------------------------------------------------


def _shape(results: Mapping[str, Result]) -> Panel:
    first = next(iter(results.values()))
    view = views_of(first)[0]
    items: list[Item] = []
    for (name, result), colour in zip(results.items(), OF_RUNS, strict=False):
        items.append(Line(*view.project(result.position[-1]), name, colour, 1.6))
    across, up = Axis(view.across_label, "m"), Axis(view.up_label, "m")
    caption = f"Shapes at the last output, {view.across_label} and {view.up_label}: {', '.join(results)}."
    return Panel("shape", "shapes", across, up, items, aspect=1.0, caption=caption)


def _histories(results: Mapping[str, Result]) -> list[Panel]:
    panels = []
    for end in ("start", "end"):
        each = {name: end_force(r, end) for name, r in results.items()}
        found = {name: force for name, force in each.items() if force is not None and len(force[0]) > 1}
        if found:
            panels.append(_over(f"force at the {end}", "N", found, list(results), f"force-{end}"))
    name = "grounded_length"
    known = {key: (r.times, np.asarray(r[name])) for key, r in results.items() if name in r and len(r.times) > 1}
    if known and max(float(y.max()) for _, y in known.values()) > 0.0:
        panels.append(_over("length on the seabed", "m", known, list(results), name))
    return panels


def _over(title: str, unit: str, found: Mapping[str, Curve], names: list[str], key: str) -> Panel:
    peak = max(float(np.abs(y).max()) for _, y in found.values())
    factor, unit = prefix(unit, peak)
    items: list[Item] = [
        Line(t, y * factor, name, OF_RUNS[names.index(name)], 1.5 if names.index(name) == 0 else 1.1)
        for name, (t, y) in found.items()
    ]
    last = max(float(t[-1]) for t, _ in found.values())
    caption = f"{title[:1].upper()}{title[1:]} over time: {', '.join(found)}."
    return Panel(key, title, Axis("t", "s", 0.0, last), Axis(title, unit, peak=peak * factor), items, caption=caption)


def _ranges_along(results: Mapping[str, Result]) -> list[Panel]:
    panels = []
    for name in RANGES:
        found = {key: along(r, name) for key, r in results.items() if name in r}
        peak = max((float(np.nan_to_num(np.abs(x.values)).max()) for x in found.values()), default=0.0)
        if peak <= ZERO:
            continue
        factor, unit = prefix(next(r.units[name] for r in results.values() if name in r), peak)
        items: list[Item] = []
        for key, x in found.items():
            colour = OF_RUNS[list(results).index(key)]
            items.append(Line(*x.curve(x.values.max(axis=0) * factor), key, colour, 1.4))
            if len(x.values) > 1:
                items.append(Line(*x.curve(x.values.min(axis=0) * factor), "", colour, 0.9, dash="dash"))
        title = title_of(name).replace("|", "")
        caption = f"{title[:1].upper()}{title[1:]} along the cable: highest (dashed: lowest) of all outputs."
        axis = Axis("s", "m", float(min(x.s[0] for x in found.values())), float(max(x.s[-1] for x in found.values())))
        panels.append(
            Panel(f"range-{name}", title, axis, Axis(title, unit, peak=peak * factor), items, caption=caption)
        )
    return panels


def _differences(results: Mapping[str, Result]) -> list[Panel]:
    """Largest difference from the first over time and along the cable, of position and tension."""
    (first, base), *others = results.items()
    panels = []
    for name in ("position", "tension", "curvature"):
        over: dict[str, Curve] = {}
        where: dict[str, Curve] = {}
        for key, other in others:
            if (
                name not in base
                or name not in other
                or abs(length_of(base) - length_of(other)) > 1e-6 * length_of(base)
            ):
                continue
            common = base.times[np.isin(np.round(base.times, 9), np.round(other.times, 9))]
            s = base.s[np.abs(base.s[:, None] - other.s).min(axis=1) <= 1e-9 * length_of(base)]  # between, it bends
            if not len(common) or not len(s):
                continue
            sizes = _sizes(base, other, name, common, s)
            over[key], where[key] = (common, sizes.max(axis=1)), (s, sizes.max(axis=0))
        if not over:
            continue
        peak = max(float(y.max()) for _, y in over.values())
        factor, unit = prefix("m" if name == "position" else base.units[name], peak)
        names, title = list(results), f"difference of {title_of(name)}"
        for kind, curves, axis in (("over time", over, Axis("t", "s")), ("along the cable", where, Axis("s", "m"))):
            if kind == "over time" and all(len(t) < 2 for t, _ in curves.values()):
                continue
            items: list[Item] = [Line(x, y * factor, key, OF_RUNS[names.index(key)]) for key, (x, y) in curves.items()]
            of = "place" if kind == "over time" else "output in common"
            caption = f"Largest {title} from {first} {kind}, of every {of}."
            label = Axis("difference", unit, 0.0, peak=peak * factor)
            panels.append(Panel(f"{name}-{kind.split()[0]}", f"{title}, {kind}", axis, label, items, caption=caption))
    return panels


def _sizes(base: Result, other: Result, name: str, times: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Sizes (nt, ns) of the difference at common times and places s (ns,) m."""
    rows = [np.searchsorted(np.round(r.times, 9), np.round(times, 9)) for r in (base, other)]
    mine, its = (r.at(s=s, names=[name], side="left")[name][k] for r, k in zip((base, other), rows, strict=True))
    gap = mine - its
    return np.abs(gap) if gap.ndim == 2 else np.linalg.norm(gap, axis=-1)


# --- studies and designs -----------------------------------------------------------------------

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
    mosaic, size = parts.grid_of(panels, COLUMNS, WIDE, HIGH, 0.8)
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
        return parts.oblique_view({"": places}), ""
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
    results = [x["name"] for x in ranges_of(found)]
    columns = {"case": _column(found, "case")} | {name: _column(found, name) for name in variables}
    columns["status"] = {"unit": "", "description": "", "values": [STATUS[int(k)] for k in found["status"].values]}
    columns |= {name: _column(found, name) for name in (*results, *OWN) if name in found}
    texts = [name for name, each in columns.items() if any(isinstance(x, str) for x in each["values"])]
    again = f"hybrid study {study.name} --case 0 -o case0.h5"
    data = {"columns": columns, "variables": variables, "results": results, "texts": texts, "again": again}
    counts = counts_of(found["status"].values)
    page = {
        "title": escape(str(found.attrs["title"])),
        "subtitle": escape(_subtitle(found, counts)),
        "failures": _failures(found) + _accuracy(found),
        "ranges": _ranges(found),
        "shares": _shares(found),
        "example": escape(_example(found, variables)),
        "again": escape(again),
        "footer": escape(parts.footer()),
        "mark": REPORT_MARK,
        "css": parts.page_file("report.css") + parts.page_file("study.css"),
        "js": parts.page_file("study.js"),
        "data": parts.packed(json.dumps(data, allow_nan=False).encode()),
        "plotly": parts.packed(parts.plotly_script().encode()),
    }
    return parts.page_of("study.html", page)


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
    rows = "".join(
        f"<li><b>{len(numbers)} case{'s' * (len(numbers) > 1)}</b>, such as {numbers[0]}: {escape(text)}</li>"
        for text, numbers in reasons_of(found.isel(case=failed))
    )
    return f'<div class="attention" role="alert"><h2>{int(failed.sum())} {what}</h2><ul>{rows}</ul></div>'


def _accuracy(found: Any) -> str:
    """How many cases missed the accuracy asked, or had it not verified, which is worst, and what to do."""
    rows = "".join(f"<li>{escape(str(unmet))}</li>" for unmet in unmet_accuracy(found))
    return f'<div class="attention" role="alert"><h2>Accuracy asked</h2><ul>{rows}</ul></div>' if rows else ""


def _ranges(found: Any) -> str:
    rows = []
    for x in ranges_of(found):
        if x["case"] is not None:
            figures = (f"{x[key]:.5g}" for key in ("smallest", "median", "largest", "case"))
            rows.append([x["name"], str(found[x["name"]].attrs.get("long_name", "")), x["unit"], *figures])
    return parts.table_html(rows, ("", "what it is", "unit", "smallest", "median", "largest", "in case"), numbers=4)


def _shares(found: Any) -> str:
    """What `hybrid.shares` has found of results: a table of each, or why it claims nothing."""
    tables = []
    for name, each in json.loads(found.attrs.get("shares", "{}")).items():
        heads = ("", "derivative", "share", "first order from", "to", "Sobol: first order", "total")
        keys = ("derivative", "share", "low", "high", "first", "total")
        rows = [[x["variable"], *("" if x[k] != x[k] else f"{x[k]:.4g}" for k in keys)] for x in each["rows"]]
        about = f"R² {each['r2']:.4f} over {each['cases']} cases"
        about = f"No shares: {escape(each['why'])}." if each["why"] else f"{escape(each['of'])} at the mean; {about}."
        table = parts.table_html(rows, heads, numbers=len(keys))
        tables.append(f'<h3>{escape(name)}</h3><p class="quiet">{about}</p>{table}')
    if not tables:
        return ""
    return f'<section id="shares"><h2>Shares of the spread, by derivatives</h2>{"".join(tables)}</section>'


def _example(found: Any, variables: list[str]) -> str:
    """A filter that could be meant."""
    numbers = [name for name in variables if found[name].dtype.kind == "f"]
    terms = [f"{name} > {float(np.nanmedian(found[name].values)):.4g}" for name in numbers[:2]]
    return " and ".join(terms) or "failed"


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
