"""Pictures of mode shapes: the equilibrium, and the line at both ends of its swing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hybrid.view.figure import Axis, Item, Line, Page, Panel
from hybrid.view.save import save_figure
from hybrid.view.style import GREY, colour_of

COLUMNS, WIDE, HIGH = 3, 2.8, 2.5  # panels beside each other, and the size of one in inches
# Views are from this azimuth beside the widest direction of the lines, and from this height, deg.
AZIMUTH, HEIGHT = 35.0, 20.0
SWING = 0.12  # of the largest extent of the scene: the largest shift that is drawn
FACTS = (
    "grey: at rest; blue: one end of the swing, and the other, dashed; shifts are not to scale, twists are not shown"
)


class DrawnMode(Protocol):
    """What is drawn of a mode."""

    @property
    def period(self) -> float: ...
    @property
    def what(self) -> str: ...
    @property
    def shifts(self) -> Mapping[str, Any]: ...


class DrawnModes(Protocol):
    """What is drawn of all."""

    @property
    def title(self) -> str: ...
    @property
    def position(self) -> Mapping[str, Any]: ...
    @property
    def modes(self) -> Sequence[DrawnMode]: ...


def plot_modes(found: DrawnModes, target: Path) -> None:
    """Draw every mode in a panel of its own, all from the same side, as PNG, PDF or SVG."""
    from hybrid.view.matplotlib_backend import draw_page

    save_figure(draw_page(_page(found)), target)


def _page(found: DrawnModes) -> Page:
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
    columns = min(COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    keys = [*panels, *["."] * (rows * columns - len(panels))]
    mosaic = [keys[columns * row : columns * (row + 1)] for row in range(rows)]
    return Page(
        found.title or "(no title)", FACTS, 1, panels, mosaic, size=(max(WIDE * columns, 5.6), HIGH * rows + 0.6)
    )


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
