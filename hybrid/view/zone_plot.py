"""Draw the zones of a run: `plot_zones` makes one page of arc length against time, and the share of rod below.

Every output point of every output has one cell, which reaches half way to its neighbours in time and, within its
zone, in s; its colour is the recorded value.  Nothing is made up between them: a zone without an output point is grey.
"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.store.reader import Result
from hybrid.store.records import Zone
from hybrid.view.projections import STILL, free_edges, whole_zones
from hybrid.view.save import save_figure
from hybrid.view.style import ALARM, GREY, INK, NORMAL, SMALL, legend_row, new_page, prefix, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

# What is shown of each kind, and its colours: shades of the orange and the blue that the kinds have on other pages.
# Lightness falls evenly (in OKLab, 0.93 to 0.32), and none of one kind is near any of the other to colour-blind eyes.
SHOWN = {"rod": "curvature", "catenary": "tension", "corrected": "tension"}
COLOURS = {
    "rod": ("#FCE5BB", "#F2C78E", "#E9A862", "#E08735", "#D1680E", "#B84F04", "#9B3A0D", "#7B2C17", "#5B1F17"),
    "catenary": ("#CFEEF7", "#A6D8EA", "#7FC0DF", "#5AA7D6", "#398CCC", "#2C72B6", "#2158A0", "#204181", "#1D2C5D"),
}
COLOURS["corrected"] = COLOURS["catenary"]  # no result has both
_UNSEEN = "#D9D9D9"
_DECADES = 2.0  # of curvature, at most: what is a hundred times straighter than the tightest bend is straight
_SPAN = 10.0  # a curvature that varies by more is shown by its logarithm
_MARKS = {
    "split": ("^", "white"),
    "grow": ("+", "white"),
    "shrink": ("x", "#9E9E9E"),
    "merge": ("v", "#9E9E9E"),
    "retry": ("X", ALARM),
}
_MOST_MARKS = 250  # more would hide the zones
_SAME = 1e-12  # of the length: places so close are one, as they are to the recorder


class Cells(NamedTuple):
    """The cells of the picture, between edges in time (nt+1,) s and along the cable (n+1,) m.

    kind (n, nt): which of `kinds` the zone there is of; point (n, nt): which output point shows it; -1: none.
    """

    t: np.ndarray
    s: np.ndarray
    kinds: tuple[str, ...]
    kind: np.ndarray
    point: np.ndarray

    def values(self, kind: str, field: np.ndarray) -> np.ma.MaskedArray:
        """A field (nt, ns) in the cells of one kind of zone (n, nt), masked elsewhere."""
        there = (self.kind == self.kinds.index(kind)) & (self.point >= 0)
        return np.ma.masked_array(field[np.arange(there.shape[1]), self.point], ~there)


def cells_of(result: Result) -> Cells:
    """Which zone each cell belongs to, and which output point: the nearest one that shows this zone."""
    times, s = result.times, result.s
    runs = [(zones, len(list(same))) for zones, same in groupby(map(whole_zones, result.zones))]
    bounds = [x for zones, _ in runs for zone in zones for x in zone[1:]]
    edges = np.sort([s[0], *(0.5 * (s[1:] + s[:-1])), s[-1], *bounds])
    edges = edges[np.append(True, np.diff(edges) > _SAME * np.ptp(edges))]
    centres = 0.5 * (edges[1:] + edges[:-1])
    kinds = tuple(dict.fromkeys(zone.kind for zones, _ in runs for zone in zones))
    columns = [np.repeat(_column(zones, kinds, centres, s)[..., None], n, axis=2) for zones, n in runs]
    kind, point = np.concatenate(columns, axis=2)
    ends = times[[0, -1]] + ([0.0, 0.0] if len(times) > 1 else [-0.5, 0.5])  # a moment alone gets some width
    t = np.concatenate([ends[:1], 0.5 * (times[1:] + times[:-1]), ends[1:]])
    return Cells(t, edges, kinds, kind, point)


def _column(zones: list[Zone], kinds: tuple[str, ...], centres: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Number of the kind and of the output point of every cell at one output (2, n); -1: none."""
    out = np.full((2, len(centres)), -1)
    ends = np.array([zone.s_b for zone in zones])
    shown = np.searchsorted(ends + _SAME * np.ptp(s), s)  # a point on a joint shows the side before it
    for k, zone in enumerate(zones):
        here = (centres > zone.s_a) & (centres < zone.s_b)
        out[0, here] = kinds.index(zone.kind)
        points = np.flatnonzero(shown == k)
        if len(points):
            out[1, here] = points[np.searchsorted(0.5 * (s[points[1:]] + s[points[:-1]]), centres[here])]
    return out


def rod_share(result: Result) -> np.ndarray:
    """Part of the cable that is rod, at every output (nt,)."""

    def length(zones: list[Zone], *kinds: str) -> float:
        return sum(zone.s_b - zone.s_a for zone in zones if zone.kind in kinds or not kinds)

    return np.array([length(zones, "rod") / (length(zones) or 1.0) for zones in result.zones])


def plot_zones(result: Result, path: str | Path | None = None, *, overwrite: bool = False) -> Figure:
    """One page: the zones along s over time, rods by their curvature and catenaries by their tension, and the share
    of rod.

    path: where to save it, as .png, .pdf or .svg (see plot_summary).  Also drawn, where the file has them: where the
    cable touches down, what is attached to it, and where zones were split, merged or a step retried.
    """
    figure, foot = new_page(result, _facts(result))
    if len(result.times):
        cells = cells_of(result)
        kinds = [kind for kind in SHOWN if kind in cells.kinds]
        panels: list[Any] = [["map", kind] for kind in kinds] or [["map", "."]]
        heights = [*(3.0 / len(panels) for _ in panels), 0.8]
        axes = figure.subplot_mosaic([*panels, ["share", "."]], width_ratios=[1.0, 0.022], height_ratios=heights)
        for kind, image in plot_zone_map(axes["map"], result, cells).items():
            _colour_bar(figure, axes[kind], image)
        plot_rod_share(axes["share"], result, cells.t)
        axes["map"].set_xlabel("")
        axes["map"].tick_params(labelbottom=False)
        entries = zip(*axes["map"].get_legend_handles_labels()[::-1], strict=True)
        legend_row(figure, foot + 0.015, list(dict(entries).items()))
    return save_figure(figure, path, overwrite=overwrite)


def plot_zone_map(ax: Axes, result: Result, cells: Cells | None = None) -> dict[str, Any]:
    """Arc length against time: a colour in every zone, boundaries, touchdown, attachments, events; the images by kind.

    An image holds the values of the file, in the unit that its label names.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap

    cells = cells_of(result) if cells is None else cells
    images: dict[str, Any] = {}
    ax.set_facecolor(_UNSEEN)
    for kind in (kind for kind in SHOWN if kind in cells.kinds):
        values = cells.values(kind, result[SHOWN[kind]])
        peak = float(np.abs(values.compressed()).max(initial=0.0))
        factor, unit = prefix(result.units[SHOWN[kind]], peak)
        colours = LinearSegmentedColormap.from_list(kind, COLOURS[kind])
        least = factor * STILL / np.ptp(cells.s)  # a bend of round-off
        norm = _bends(factor * values, least) if kind == "rod" else _pulls(factor * values)
        images[kind] = ax.pcolorfast(cells.t, cells.s, factor * values, cmap=colours, norm=norm)
        images[kind].set_label(f"{kind}: {SHOWN[kind]} ({unit})")
    if lines := outlines(cells):
        ax.add_collection(LineCollection(lines, color=INK, linewidth=0.8, zorder=2, label="zone boundary"))
    attached = result["attached"].tolist() if "attached" in result else []
    for k, s in enumerate(attached):
        look = _cased(INK, 0.7, "white", 1.7) | {"linestyle": (0, (6, 3)), "zorder": 3}
        ax.axhline(s, **look, label="_" * (k > 0) + "attached")
    _draw_touchdown(ax, result)
    _draw_events(ax, result, cells.t)
    if ((cells.kind >= 0) & (cells.point < 0)).any():
        ax.plot([], [], "s", color=_UNSEEN, label="no output point in the zone")
    title = ", ".join(f"{kind} by {SHOWN[kind]}" for kind in images)
    style(ax, f"zones: {title or 'none that are known'}", "t (s)", "s (m)")
    ax.grid(False)
    _set_limits(ax, result, cells.t)
    ax.set_ylim(cells.s[0], cells.s[-1])
    return images


def plot_rod_share(ax: Axes, result: Result, edges: np.ndarray) -> None:
    """How much of the cable is rod, over time; edges (nt+1,) s: from when to when an output holds."""
    share = 100.0 * rod_share(result)
    mean = float(share @ np.diff(edges)) / np.ptp(edges)
    ax.stairs(np.full(len(share), 100.0), edges, fill=True, color=COLOURS["catenary"][0])
    ax.stairs(share, edges, fill=True, color=COLOURS["rod"][2])
    ax.stairs(share, edges, baseline=None, color=INK, linewidth=0.8)
    low, high = (f"{x:.3g}" for x in (share.min(), share.max()))
    span = f" on average, between {low} and {high} %" * (low != high)
    style(ax, f"share of rod: {mean:.3g} % of the cable{span}", "t (s)", "share (%)")
    _set_limits(ax, result, edges)
    ax.set_ylim(0.0, 100.0)
    ax.set_yticks([0, 50, 100])


# ---- parts of it ----------------------------------------------------------------------------------


def _facts(result: Result) -> list[str]:
    kinds = [event.kind for event in result.events if event.kind in _MARKS]
    counts = ", ".join(f"{kind} × {kinds.count(kind)}" for kind in _MARKS if kind in kinds)
    return [counts + " (too many to mark)" * (len(kinds) > _MOST_MARKS)] * bool(kinds)


def _bends(values: np.ma.MaskedArray, least: float) -> Normalize:
    """Curvature from zero, or by its logarithm where it spans much."""
    from matplotlib.colors import LogNorm, Normalize

    seen = values.compressed()
    high = float(seen.max(initial=least))
    usual = float(np.percentile(seen, 5)) if len(seen) else 0.0
    if high > least and usual < high / _SPAN:
        return LogNorm(max(usual, 10.0**-_DECADES * high), high, clip=True)
    return Normalize(0.0, high)


def _pulls(values: np.ma.MaskedArray) -> Normalize:
    """Tension from zero, unless it is far from that, or below."""
    from matplotlib.colors import Normalize

    seen = values.compressed() if values.count() else np.zeros(1)
    low, high = float(seen.min()), float(seen.max())
    low = 0.0 if 0.0 < low < 0.5 * high else low
    least = 1e-3 * max(abs(low), abs(high)) or 1.0  # less would show round-off
    return Normalize(low, max(high, low + least))


def outlines(cells: Cells) -> list[np.ndarray]:
    """Lines (2, 2) of t and s between cells of different kinds, each as long as it goes."""
    lines = []
    for kind, across, along in ((cells.kind, cells.s, cells.t), (cells.kind.T, cells.t, cells.s)):
        differ = np.pad(np.diff(kind, axis=0) != 0, ((0, 0), (1, 1)))
        for k, n in np.argwhere(differ[:, 1:] & ~differ[:, :-1]):  # where a line begins
            end = n + int(np.argmin(differ[k, n + 1 :]))
            line = np.array([[along[n], across[k + 1]], [along[end], across[k + 1]]])
            lines.append(line if along is cells.t else line[:, ::-1])
    return lines


def _cased(colour: str, width: float, casing: str, outer: float) -> dict[str, Any]:
    """The look of a line in a casing, to be seen on pale and on dark."""
    from matplotlib.patheffects import Normal, Stroke

    return {"color": colour, "linewidth": width, "path_effects": [Stroke(linewidth=outer, foreground=casing), Normal()]}


def _draw_touchdown(ax: Axes, result: Result) -> None:
    """Where contact begins and ends; a gap while there is none, a dot where it is seen at one output only."""
    for n, k in enumerate(free_edges(result)):
        s = result["touchdown"][:, k]
        known = np.concatenate([[False], np.isfinite(s), [False]])
        alone = np.flatnonzero(known[1:-1] & ~known[:-2] & ~known[2:])
        look = _cased("white", 1.1, INK, 2.5) | {"zorder": 4}
        ax.plot(result.times, s, **look, label="_" * (n > 0) + "touchdown")
        ax.plot(result.times[alone], s[alone], ".", markersize=2.5, **look)


def _draw_events(ax: Axes, result: Result, edges: np.ndarray) -> None:
    """Where zones were split, merged or a step retried: how far, and when."""
    events = [event for event in result.events if event.kind in _MARKS and edges[0] <= event.t <= edges[-1]]
    for kind, (symbol, face) in _MARKS.items() if len(events) <= _MOST_MARKS else ():
        at = np.array([(e.t, e.s_a, e.s_b) for e in events if e.kind == kind]).reshape(-1, 3)
        if len(at):
            ax.vlines(*at.T, color=INK, linewidth=0.5, zorder=5)
            look: dict[str, Any] = {"markerfacecolor": face, "markeredgecolor": INK, "markeredgewidth": 0.5}
            middle = 0.5 * (at[:, 1] + at[:, 2])
            ax.plot(at[:, 0], middle, symbol, markersize=3.4, **look, zorder=6, label=kind)


def _colour_bar(figure: Figure, ax: Axes, image: Any) -> None:
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import LogLocator

    look: dict[str, Any] = {}
    if isinstance(image.norm, LogNorm):
        look = {"ticks": LogLocator(subs=(1.0, 2.0, 5.0)), "format": "%g", "extend": "min", "extendfrac": 0.03}
    bar = figure.colorbar(image, cax=ax, **look)
    bar.set_label(image.get_label(), fontsize=NORMAL)
    bar.outline.set(linewidth=0.6, edgecolor=GREY)
    ax.tick_params(labelsize=SMALL, width=0.6, length=2.5, color=GREY, labelcolor=INK)
    ax.minorticks_off()


def _set_limits(ax: Axes, result: Result, edges: np.ndarray) -> None:
    ax.set_xlim(edges[0], edges[-1])
    if len(result.times) == 1:
        ax.set_xticks(result.times)
