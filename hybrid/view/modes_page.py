"""Natural modes that swing: a section of a report, and a page of their own.

Modes are as `hybrid.modes` returns them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.view.curves import even
from hybrid.view.figure import (
    GREY,
    PAGES,
    REPORT_MARK,
    Axis,
    Item,
    Line,
    Page,
    Panel,
    check_target,
    colour_of,
    save_figure,
    short,
    write_file,
)
from hybrid.view.report_parts import footer, page_file, page_of, table_html

# Pictures of mode shapes: the equilibrium, and the line at both ends of its swing.

COLUMNS = 3  # panels beside each other
SHAPE_WIDE = 2.8  # inches, of one,
SHAPE_HIGH = 2.5  # and its height
# Views are from this azimuth beside the widest direction of the lines, and from this height, deg.
AZIMUTH, HEIGHT = 35.0, 20.0
SWING = 0.12  # of the largest extent of the scene: the largest shift that is drawn
FACTS = (
    "grey: at rest; blue: one end of the swing, and the other, dashed; shifts are not to scale, twists are not shown"
)


def plot_modes(found: Any, target: Path) -> None:
    """Draw every mode in a panel of its own, all from the same side, as PNG, PDF or SVG."""
    from hybrid.view.matplotlib_backend import draw_page

    save_figure(draw_page(_page(found)), target)


def _page(found: Any) -> Page:
    view = oblique_view(found.position)
    places = {name: np.asarray(r) @ view.T for name, r in found.position.items()}
    every = np.concatenate(list(places.values()))
    extent = np.ptp(np.concatenate([np.asarray(r) for r in found.position.values()]), axis=0)
    size = SWING * max(float(extent.max()), 1e-9)
    span = [(float(x.min()) - 1.5 * size, float(x.max()) + 1.5 * size) for x in every.T]
    blue, panels = colour_of("catenary"), {}
    for k, mode in enumerate(found.modes, start=1):
        items: list[Item] = []
        for name, at in places.items():
            moved = size * np.asarray(mode.shifts[name]) @ view.T
            items.append(Line(at[:, 0], at[:, 1], colour=GREY, width=0.8))
            for sign, look in ((-1.0, {"width": 0.8, "dash": "dash"}), (1.0, {})):
                swung = at + sign * moved
                items.append(Line(swung[:, 0], swung[:, 1], colour=blue, **look))  # type: ignore[arg-type]
        title = f"{k}: {mode.period:.4g} s, {mode.what}"
        panels[str(k)] = Panel(str(k), title, Axis("", "m", *span[0]), Axis("", "m", *span[1]), items, aspect=1.0)
    if not panels:
        return Page(found.title or "(no title)", "", empty="no mode")
    mosaic, inches = grid_of(panels, COLUMNS, SHAPE_WIDE, SHAPE_HIGH, 0.6)
    return Page(found.title or "(no title)", FACTS, 1, panels, mosaic, size=inches)


def grid_of(
    panels: Collection[str], most: int, wide: float, high: float, room: float
) -> tuple[list[list[str]], tuple[float, float]]:
    """Panels in rows of at most so many, and the size of their page; wide, high: of each; room: for the head."""
    columns = min(most, len(panels))
    rows = math.ceil(len(panels) / columns)
    keys = [*panels, *["."] * (rows * columns - len(panels))]
    mosaic = [keys[columns * row : columns * (row + 1)] for row in range(rows)]
    return mosaic, (max(wide * columns, 5.6), high * rows + room)


def oblique_view(position: Mapping[str, Any]) -> Any:
    """(2, 3): to the right and upwards in the picture, from beside the widest direction and above."""
    every = np.concatenate([np.asarray(r) for r in position.values()])
    flat = every[:, :2] - every[:, :2].mean(axis=0)
    _, _, axes = np.linalg.svd(flat, full_matrices=False)
    along = axes[0] * np.sign(axes[0][np.abs(axes[0]).argmax()] or 1.0)
    angle = math.atan2(along[1], along[0]) + math.radians(AZIMUTH)
    right = np.array([math.cos(angle), math.sin(angle), 0.0])
    away = np.array([-math.sin(angle), math.cos(angle), 0.0])
    up = math.cos(math.radians(HEIGHT)) * np.array([0.0, 0.0, 1.0]) + math.sin(math.radians(HEIGHT)) * away
    return np.array([right, up])


# Natural modes that swing: a section of a report, and a page of their own.

MOST_POINTS = 120  # of a line that are drawn
TICKS = 15  # places at which the turn of its sections is drawn
WIDE = 320.0  # of a picture,
HIGH = 240.0  # and its height
TWISTS = 0.05  # part of the kinetic energy in twist from which turns are drawn
TURN = 1.0  # rad, the largest
TICK = 0.03  # of the picture
SHOWN, LEAST = 3, 0.05  # parts of the energy in the table, and the least of them
EXPLAINED = (
    "About the equilibrium, without drag and damping. Grey: at rest; blue: the mode as it swings, not to scale, each "
    "once in two seconds; ticks across a line show how its sections turn. Masses are parts of all that can move along "
    "x, y, z."
)


def write_modes(found: Any, path: str | Path) -> Path:
    """Write a page of modes as .html and return where it is; ResultError where it cannot be written."""
    target = check_target(path, PAGES)
    return write_file(target, lambda new: new.write_text(html(found), encoding="utf-8"))


def html(found: Any) -> str:
    """The page as text."""
    title = f"Natural modes of {found.title or 'a line'}"
    parts = {
        "title": escape(title), "subtitle": escape(f"{len(found.modes)} modes on {found.cells} cells"),
        "footer": escape(footer()), "mark": REPORT_MARK, "css": page_file("report.css"), "js": "", "data": "",
        "plotly": "", "section": section(found),
    }  # fmt: skip
    return page_of("modes.html", parts)


def section(found: Any) -> str:
    """Table, notes and moving pictures of modes, for a report."""
    head = ["", "period (s)", "error (s)", "moves, by kinetic energy", "mass x (%)", "y", "z"]
    notes = "".join(f"<li>{escape(x)}</li>" for x in found.notes)
    pictures = "".join(_picture(found, k) for k in range(len(found.modes)))
    return (
        f'<section id="modes"><h2>Natural modes</h2><p class="quiet">{escape(EXPLAINED)}</p>'
        f"{table_html([_row(found, k) for k in range(len(found.modes))], head, numbers=3)}"
        f"{f'<ul>{notes}</ul>' if notes else ''}"
        '<p><button type="button" id="swing" aria-pressed="true">Pause</button></p>'
        f'<div class="grid">{pictures}</div><script>{page_file("modes.js")}</script></section>'
    )


def _row(found: Any, k: int) -> list[str]:
    mode = found.modes[k]
    parts = [f"{word} {100.0 * part:.0f} %" for word, part in mode.energy.items() if part >= LEAST][:SHOWN]
    masses = [100.0 * m / a if a > 0.0 else 0.0 for m, a in zip(mode.mass, found.mass, strict=True)]
    error = "not known" if mode.error is None else short(mode.error, 2)
    return [str(k + 1), short(mode.period, 5), error, ", ".join(parts), *(f"{m:.1f}" for m in masses)]


def _picture(found: Any, k: int) -> str:
    """One mode, drawn at an end of its swing, with the numbers that let it move."""
    mode, view = found.modes[k], oblique_view(found.position)
    every = np.concatenate([np.asarray(r) for r in found.position.values()])
    size = SWING * max(float(np.ptp(every, axis=0).max()), 1e-9)
    flat = every @ view.T
    low, high = flat.min(axis=0) - 1.3 * size, flat.max(axis=0) + 1.3 * size
    scale = min(WIDE / (high[0] - low[0]), HIGH / (high[1] - low[1]))
    upright = scale * np.array([1.0, -1.0])
    rest, swings, ticks = [], [], []
    for name, position in found.position.items():
        chosen = even(len(position), MOST_POINTS)
        r, shift = np.asarray(position)[chosen], size * np.asarray(mode.shifts[name])[chosen]
        at = (r @ view.T - 0.5 * (low + high)) * upright + 0.5 * np.array([WIDE, HIGH])
        moved = shift @ view.T * upright
        rest.append(np.round(at, 1).tolist())
        swings.append(np.round(moved, 1).tolist())
        whole = np.asarray(position), size * np.asarray(mode.shifts[name])
        ticks += _ticks(mode, name, *whole, view, upright, low + high)
    lines = "".join(f'<polyline points="{_points(x)}" fill="none" stroke="{GREY}"/>' for x in rest)
    ends = [(np.array(x) + np.array(y)).tolist() for x, y in zip(rest, swings, strict=True)]
    blue = "".join(f'<polyline class="swing" points="{_points(x)}" fill="none"/>' for x in ends)
    turning = "".join('<line class="swing"/>' for _ in ticks)
    data = escape(json.dumps({"rest": rest, "swing": swings, "ticks": ticks}, separators=(",", ":")), quote=True)
    text = f"Mode {k + 1}: {short(mode.period, 4)} s, {mode.what}"
    return (
        f'<figure><svg class="mode" viewBox="0 0 {WIDE:g} {HIGH:g}" role="img" aria-label="{escape(text)}" '
        f'data-mode="{data}"><g stroke-width="1">{lines}</g><g stroke="{colour_of("catenary")}" stroke-width="2">'
        f"{blue}{turning}</g></svg><figcaption>{escape(text)}</figcaption></figure>"
    )


def _points(x: list[list[float]]) -> str:
    return " ".join(f"{a:g},{b:g}" for a, b in x)


def _ticks(mode: Any, name: str, r: Any, shift: Any, view: Any, upright: Any, twice_middle: Any) -> list[list[float]]:
    """Of places along a line: x, y, their shift, two axes across the line in the picture, the largest turn (rad)."""
    if mode.energy.get("twist", 0.0) < TWISTS or name not in mode.twists:
        return []
    twist = np.nan_to_num(np.asarray(mode.twists[name]))
    largest = max(float(np.abs(np.nan_to_num(np.asarray(x))).max()) for x in mode.twists.values()) or 1.0
    d = np.diff(r, axis=0)
    d /= np.maximum(np.linalg.norm(d, axis=1), 1e-300)[:, None]
    away = np.cross(view[0], view[1])
    rows = []
    for c in even(len(d), TICKS):
        n = np.cross(d[c], away)
        n = n / np.linalg.norm(n) if np.linalg.norm(n) > 1e-6 else view[0]
        axes = [TICK * WIDE * (view @ x) * np.sign(upright) for x in (n, np.cross(d[c], n))]
        middle = (0.5 * (r[c] + r[c + 1]) @ view.T - 0.5 * twice_middle) * upright + 0.5 * np.array([WIDE, HIGH])
        moved = 0.5 * (shift[c] + shift[c + 1]) @ view.T * upright
        row = [*middle, *moved, *axes[0], *axes[1], TURN * twist[c] / largest]
        rows.append([round(float(x), 3) for x in row])
    return rows
