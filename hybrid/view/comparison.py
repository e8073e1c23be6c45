"""Runs laid over each other: one page with their numbers, their curves, and how far they are from the first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import unified_diff
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.envelope import BROKEN, NOT_VERIFIED
from hybrid.store.reader import Result
from hybrid.store.verdicts import section_limits
from hybrid.view import report_parts as parts
from hybrid.view.curves import Store, along, script_json, worst
from hybrid.view.figure import (
    PAGES,
    REPORT_MARK,
    ZERO,
    Axis,
    Item,
    Line,
    Panel,
    check_target,
    prefix,
    short,
    title_of,
    write_file,
)
from hybrid.view.panels import RANGES, end_force, only_line
from hybrid.view.plotly_backend import figure_of
from hybrid.view.projections import views_of
from hybrid.view.summary import amount, length_of
from hybrid.view.zones import warnings_of

Curve = tuple[np.ndarray, np.ndarray]
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
# Extremes in the table: quantity, whether the lowest, heading.
EXTREMES = (
    ("tension", False, "largest tension"), ("tension", True, "lowest tension"),
    ("curvature", False, "largest curvature"), ("bending_moment", False, "largest bending moment"),
    ("torque", False, "largest torque"), ("contact", False, "largest contact force"),
)  # fmt: skip


def write_comparison(
    results: Mapping[str, Result] | Sequence[Result], path: str | Path, *, overwrite: bool = False
) -> Path:
    """Write one page that lays 2 to 6 results over each other and return where it is.

    results: by the name that each has on the page, or in order, which are called by their files; the first is the one
    that others are compared with.  Differences
    at an instant are taken where outputs of both have the same time, at the places of the first, on the left of
    jumps.  ResultError: one or more than six results, several lines in one, or a page that cannot be written.
    """
    if not isinstance(results, Mapping):
        results = {f"{k}: {'in memory' if x.file is None else x.file.stem}": x for k, x in enumerate(results, 1)}
    if not 2 <= len(results) <= len(COLOURS):
        raise ResultError(f"a comparison is of 2 to {len(COLOURS)} results, and {len(results)} were given")
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
        "ranges": ("Along the cable", "Highest and lowest value of all outputs.", _ranges(results)),
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
    page = {
        "title": escape(f"{', '.join(results)}: compared"),
        "subtitle": escape("; ".join(f"{name}: {r.title or '(no title)'}" for name, r in results.items())),
        "verdict": f'<section id="verdict" aria-label="Verdict">{_verdict(results)}</section>',
        "facts": _table(results), "statistics": "", "cable": "", "figures": text, "events": "", "energy": "",
        "settings": _scenes(results), "scene_title": escape(f"Scene of {first} (YAML)"),
        "scene": escape(results[first].scene_text), "footer": escape(parts.footer()), "mark": REPORT_MARK,
        "index": script_json({"scene": None, "figures": figures}),
    }  # fmt: skip
    return parts.filled_page(page, store)


# ---- numbers --------------------------------------------------------------------------------------


def _verdict(results: Mapping[str, Result]) -> str:
    """How each ended, its warnings and its broken limits."""
    lines, bad = [], False
    for name, result in results.items():
        kinds = [event.kind for event, _ in warnings_of(result)]
        held = section_limits(result)
        broken, open_ = ([x.limit for x in held if x.verdict == word] for word in (BROKEN, NOT_VERIFIED))
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
                part = f" ({'+' if x > known else ''}{short(100.0 * (x / known - 1.0), 3)} %)"
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
    for (name, result), colour in zip(results.items(), COLOURS, strict=False):
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
        Line(t, y * factor, name, COLOURS[names.index(name)], 1.5 if names.index(name) == 0 else 1.1)
        for name, (t, y) in found.items()
    ]
    last = max(float(t[-1]) for t, _ in found.values())
    caption = f"{title[:1].upper()}{title[1:]} over time: {', '.join(found)}."
    return Panel(key, title, Axis("t", "s", 0.0, last), Axis(title, unit, peak=peak * factor), items, caption=caption)


def _ranges(results: Mapping[str, Result]) -> list[Panel]:
    panels = []
    for name in RANGES:
        found = {key: along(r, name) for key, r in results.items() if name in r}
        peak = max((float(np.nan_to_num(np.abs(x.values)).max()) for x in found.values()), default=0.0)
        if peak <= ZERO:
            continue
        factor, unit = prefix(next(r.units[name] for r in results.values() if name in r), peak)
        items: list[Item] = []
        for key, x in found.items():
            colour = COLOURS[list(results).index(key)]
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
            if not len(common):
                continue
            sizes = _sizes(base, other, name, common)
            over[key], where[key] = (common, sizes.max(axis=1)), (base.s, sizes.max(axis=0))
        if not over:
            continue
        peak = max(float(y.max()) for _, y in over.values())
        factor, unit = prefix("m" if name == "position" else base.units[name], peak)
        names, title = list(results), f"difference of {title_of(name)}"
        for kind, curves, axis in (("over time", over, Axis("t", "s")), ("along the cable", where, Axis("s", "m"))):
            if kind == "over time" and all(len(t) < 2 for t, _ in curves.values()):
                continue
            items: list[Item] = [Line(x, y * factor, key, COLOURS[names.index(key)]) for key, (x, y) in curves.items()]
            of = "place" if kind == "over time" else "output in common"
            caption = f"Largest {title} from {first} {kind}, of every {of}."
            label = Axis("difference", unit, 0.0, peak=peak * factor)
            panels.append(Panel(f"{name}-{kind.split()[0]}", f"{title}, {kind}", axis, label, items, caption=caption))
    return panels


def _sizes(base: Result, other: Result, name: str, times: np.ndarray) -> np.ndarray:
    """Sizes (nt, ns) of the difference at common times and the places of the first that the other covers."""
    s = np.clip(base.s, other.s[0], other.s[-1])
    rows = [np.searchsorted(np.round(r.times, 9), np.round(times, 9)) for r in (base, other)]
    mine, its = (r.at(s=s, names=[name], side="left")[name][k] for r, k in zip((base, other), rows, strict=True))
    gap = mine - its
    return np.abs(gap) if gap.ndim == 2 else np.linalg.norm(gap, axis=-1)
