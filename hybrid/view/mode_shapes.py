"""Pictures of mode shapes: the equilibrium, and the line at both ends of its swing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hybrid.view.matplotlib_import import import_matplotlib
from hybrid.view.save import save_figure
from hybrid.view.style import GREY, INK, NORMAL, SMALL, colour_of

COLUMNS, WIDE, HIGH = 3, 2.7, 2.2  # panels beside each other, and the size of one in inches
# Views are from this azimuth beside the widest direction of the lines, and from this height, deg.
AZIMUTH, HEIGHT = 35.0, 20.0
SWING = 0.12  # of the largest extent of the scene: the largest shift that is drawn


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
    """Draw every mode in a panel of its own, all from the same side; shifts are not to scale, twists not shown."""
    import_matplotlib()
    from matplotlib.figure import Figure

    view = _view(found.position)
    places = {name: np.asarray(r) @ view.T for name, r in found.position.items()}
    every = np.concatenate(list(places.values()))
    extent = np.ptp(np.concatenate([np.asarray(r) for r in found.position.values()]), axis=0)
    size = SWING * max(float(extent.max()), 1e-9)
    rows = math.ceil(max(len(found.modes), 1) / COLUMNS)
    columns = min(COLUMNS, max(len(found.modes), 1))
    figure = Figure(figsize=(WIDE * columns, HIGH * rows + 0.4), layout="constrained")
    figure.suptitle(found.title, fontsize=NORMAL + 1, color=INK)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(found.modes) :]:
        axis.set_visible(False)
    for k, (axis, mode) in enumerate(zip(axes, found.modes, strict=False), start=1):
        for name, at in places.items():
            moved = size * np.asarray(mode.shifts[name]) @ view.T
            axis.plot(at[:, 0], at[:, 1], color=GREY, lw=0.8)
            axis.plot(*(at + moved).T, color=colour_of("catenary"), lw=1.2)
            axis.plot(*(at - moved).T, color=colour_of("catenary"), lw=0.7, ls=(0, (3, 2)))
        axis.set_title(f"{k}: {mode.period:.4g} s, {mode.what}", fontsize=SMALL, color=INK)
        axis.set_aspect("equal")
        span = np.ptp(every, axis=0).max() * 0.5 + 1.5 * size
        middle = 0.5 * (every.max(axis=0) + every.min(axis=0))
        tall = max(float(np.ptp(every[:, 1])) * 0.5 + 1.5 * size, 0.35 * span)
        axis.set_xlim(middle[0] - span, middle[0] + span)
        axis.set_ylim(middle[1] - tall, middle[1] + tall)
        axis.set_axis_off()
    save_figure(figure, target)


def _view(position: Mapping[str, Any]) -> Any:
    """(2, 3): to the right and upwards in the picture."""
    every = np.concatenate([np.asarray(r) for r in position.values()])
    flat = every[:, :2] - every[:, :2].mean(axis=0)
    _, _, axes = np.linalg.svd(flat, full_matrices=False)
    along = axes[0] * np.sign(axes[0][np.abs(axes[0]).argmax()] or 1.0)
    angle = math.atan2(along[1], along[0]) + math.radians(AZIMUTH)
    right = np.array([math.cos(angle), math.sin(angle), 0.0])
    away = np.array([-math.sin(angle), math.cos(angle), 0.0])
    up = math.cos(math.radians(HEIGHT)) * np.array([0.0, 0.0, 1.0]) + math.sin(math.radians(HEIGHT)) * away
    return np.array([right, up])
