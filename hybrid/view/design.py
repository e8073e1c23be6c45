"""Pictures of a design: the lines of every case before and after, and histories that were measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hybrid.view.figure import BED, GREY, Axis, Item, Line, Marks, Page, Panel, Rule, colour_of, short
from hybrid.view.modes_page import oblique_view
from hybrid.view.save import save_figure

COLUMNS = 2  # panels beside each other
WIDE = 4.0  # inches, of one,
HIGH = 2.9  # and its height
# Of its widest extent in plan: lines that are no wider across are drawn in one upright plane.
FLAT = 0.05
NUMBERS = 6  # of unknowns in the head

Shapes = Mapping[str, Mapping[str, Any]]


class DrawnDesign(Protocol):
    """What is drawn of a design; places that were `measured`, by case and line, and `histories`, where there are."""

    @property
    def title(self) -> str: ...
    @property
    def numbers(self) -> Mapping[str, float]: ...
    @property
    def start(self) -> Mapping[str, float]: ...
    @property
    def before(self) -> Shapes: ...
    @property
    def after(self) -> Shapes: ...
    @property
    def bed(self) -> float | None: ...


def plot_design(found: DrawnDesign, target: Path) -> None:
    """Draw every case in a panel of its own, as PNG, PDF or SVG."""
    from hybrid.view.matplotlib_backend import draw_page

    save_figure(draw_page(_page(found)), target)


def _page(found: DrawnDesign) -> Page:
    every = [
        np.asarray(r) for shapes in (found.before, found.after) for lines in shapes.values() for r in lines.values()
    ]
    view, across = _view(np.concatenate(every))
    panels = {str(k): _panel(found, case, str(k), view, across) for k, case in enumerate(found.after)}
    histories = getattr(found, "histories", ())
    for history in histories:
        panels[str(len(panels))] = _history(history, str(len(panels)))
    columns = min(COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    keys = [*panels, *["."] * (rows * columns - len(panels))]
    mosaic = [keys[columns * row : columns * (row + 1)] for row in range(rows)]
    changes = [f"{name} {short(found.start[name], 4)} → {short(x, 4)}" for name, x in found.numbers.items()]
    more = f", and {len(changes) - NUMBERS} more" if len(changes) > NUMBERS else ""
    facts = ", ".join(changes[:NUMBERS]) + more
    size = max(WIDE * columns, 5.6), HIGH * rows + 0.8
    named = [*panels][-1] if histories else "0"
    return Page(found.title or "(no title)", facts, 2, panels, mosaic, legend=(named,), size=size)


def _panel(found: DrawnDesign, case: str, key: str, view: Any, across: str) -> Panel:
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
