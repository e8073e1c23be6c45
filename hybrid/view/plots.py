"""Draw a result: `plot_summary` makes one page of the panels in `panels`, arranged to suit the shape.

Plots read the file, through `read.Result`, and nothing else.  matplotlib is imported when
something is drawn, and never pyplot: no window, no display, no state that outlives a call.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.store.reader import Result
from hybrid.view.panels import plot_history, plot_profiles, plot_shape, plot_touchdown
from hybrid.view.projections import (
    Numbers,
    aspect_of,
    history_points,
    telling_times,
    touches_bed,
    views_of,
    whole_zones,
)
from hybrid.view.save import save_figure
from hybrid.view.style import legend_row, new_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ENTRIES = 8  # of a legend, in a row


# Pages for one view and for two: panels, widths of columns, heights of rows, and the width over height that these
# leave for a shape.  s, S: views; p, P: profiles along s; h, H: histories (statics: more profiles).  Where the cable
# lies on a seabed also c, the contact force along s, and T, the touchdown over time.
_BLOCK, _COLUMN = [["p", "h"], ["P", "H"]], [["p"], ["P"], ["h"], ["H"]]
_Pages = list[tuple[list[Any], list[float], list[float], float]]
_ONE_VIEW: _Pages = [([["s", "s"], *_BLOCK], [1, 1], [h, 1, 1], r) for h, r in ((1.3, 5.1), (1.8, 4.2), (2.5, 3.6))]
_ONE_VIEW += [([["s", "s", "p"], ["h", "H", "P"]], [1, 1, 1], [h, 1], r) for h, r in ((0.7, 2.9), (1, 2.4), (2, 1.8))]
_ONE_VIEW += [([["s", _COLUMN]], [w, 1], [1], r) for w, r in ((1.5, 0.97), (1.1, 0.85), (0.8, 0.72))]
_ONE_VIEW += [([["s", _BLOCK]], [w, 1], [1], r) for w, r in ((0.65, 0.64), (0.45, 0.5), (0.3, 0.37))]
_TWO_VIEWS: _Pages = [([["s", "p"], ["S", "P"], ["h", "H"]], [w, 1], [1, 1, 1], r) for w, r in ((1.7, 3.8), (1.2, 3.3))]
_TWO_VIEWS += [([["s", "p", "h"], ["S", "P", "H"]], [w, 1, 1], [1, 1], r) for w, r in ((2.5, 1.7), (1.6, 1.4), (1, 1))]
_TWO_VIEWS += [([["s", "S", _COLUMN]], [1, 1, w], [1], r) for w, r in ((1.2, 0.46), (2, 0.36), (3, 0.29))]

_ROW, _BLOCK_BED = ["h", "T", "H"], [["p", "h"], ["P", "T"], ["c", "H"]]
_BESIDE = [["s", "s", name] for name in "pPc"]
_PAIR = [["s"] * 3 + ["S"] * 3, *([name for name in row for _ in "12"] for row in (["p", "P", "c"], _ROW))]
_ONE_VIEW_BED: _Pages = [
    ([["s"] * 3, ["p", "P", "c"], _ROW], [1] * 3, [h, 1, 1], r) for h, r in ((1, 6.5), (1.5, 5.1), (2.2, 4.1))
]
_ONE_VIEW_BED += [([*_BESIDE, _ROW], [1] * 3, [1, 1, 1, h], r) for h, r in ((1.3, 1.57), (1, 1.48))]
_ONE_VIEW_BED += [([["s", _BLOCK_BED]], [w, 1], [1], r) for w, r in ((0.7, 0.66), (0.5, 0.54), (0.35, 0.42))]
_TWO_VIEWS_BED: _Pages = [(_PAIR, [1] * 6, [h, 1, 1], r) for h, r in ((1, 3.0), (1.5, 2.3), (2.2, 1.9))]
_TWO_VIEWS_BED += [([[[["s"], ["S"]], _BLOCK_BED]], [w, 1], [1], r) for w, r in ((0.75, 1.4), (0.6, 1.2), (0.45, 0.95))]


def plot_summary(
    result: Result,
    path: str | Path | None = None,
    *,
    times: Numbers | None = None,
    history: Numbers | None = None,
    overwrite: bool = False,
) -> Figure:
    """One page: shape, tension and moment along the cable, and histories at some points.

    path: where to save it, as .png, .pdf or .svg; a file that hybrid did not make is replaced only with
    overwrite.  times: which earlier shapes (s).  history:
    which arc lengths to follow (m); else those recorded as `history`, else the middle and
    the ends that move.  A static result shows curvature and tangent in place of histories; a
    cable that touches a seabed also shows the force of contact and, over time, where it does.
    """
    earlier = telling_times(result) if times is None else np.sort(np.asarray(times, dtype=float))
    figure, foot = new_page(result, _facts(result, earlier))
    if len(result.times):
        views, lies = views_of(result), touches_bed(result)
        pages = (_ONE_VIEW_BED, _TWO_VIEWS_BED) if lies else (_ONE_VIEW, _TWO_VIEWS)
        drawn = aspect_of(views, result)
        panels, widths, heights, _ = min(pages[len(views) - 1], key=lambda page: abs(math.log(page[3] / drawn)))
        axes = figure.subplot_mosaic(panels, width_ratios=widths, height_ratios=heights)
        points = history_points(result, history) if len(result.times) > 1 else np.zeros(0)
        for name, view in zip("sS", views, strict=False):
            plot_shape(axes[name], result, times=earlier, view=view, points=points)
        bent = "bending_moment" in result and not set(result["zones/kind"]) <= {"catenary"}
        profiles: list[Any] = ["tension", ("bending_moment", "torque")] if bent else ["tension"]
        angles = ("theta", "phi") if len(views) > 1 else ("theta" if views[0].up_label == "z" else "phi",)
        profiles += [n for n in ("curvature", *angles) if n in result]
        profiles += [views[-1].up_label.replace("across", "z"), "x", "y"]
        profiles[2:2] = ["contact"] * lies
        along, over = ("pPc", "hTH") if lies else ("pP", "hH")
        for name, quantity in zip(along if len(points) else along + over, profiles, strict=False):
            plot_profiles(axes[name], result, quantity, times=earlier if quantity == "contact" else ())
        if len(points):
            plot_history(axes["h"], result, "tension", points, legend=False)
            moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
            plot_history(axes["H"], result, "position", points, component=int(moves.argmax()), legend=False)
        if len(points) and lies:
            plot_touchdown(axes["T"], result)
        for upper, lower in zip(along + over, along[1:] + " " + over[1:] + " ", strict=True):
            if lower in axes and axes[upper].get_position().x0 == axes[lower].get_position().x0:  # one axis of s or t
                axes[upper].set_xlabel("")
                axes[upper].tick_params(labelbottom=False)
        _legends(figure, axes["s"], axes["h"] if len(points) else None, foot)
    return save_figure(figure, path, overwrite=overwrite)


def _facts(result: Result, earlier: np.ndarray) -> list[str]:
    zones = whole_zones(result.zones[-1]) if len(result.times) else []
    facts = []
    if 0 < len(zones) <= 4:  # more are to be seen, not to be read
        facts.append(", ".join(f"{z.kind} {z.s_a:.4g} … {z.s_b:.4g} m" for z in zones))
    if "error_total_position" in result.attributes:
        size = {x: float(result.attributes[f"error_total_{x}"]) for x in ("position", "end_force")}
        facts.insert(0, f"estimated error {size['position']:.2g} m, {size['end_force']:.2g} N at the ends")
    if len(earlier):
        facts.append("earlier shapes at t = " + ", ".join(f"{t:.3g}" for t in earlier) + " s")
    return facts


def _legends(figure: Figure, shape: Axes, history: Axes | None, foot: float) -> None:
    """Two rows below the panels: what the shape shows, and under it what is left of that, and the histories."""
    shown = [dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True)) for ax in (shape, history) if ax]
    first, rest = list(shown[0].items()), [entry for more in shown[1:] for entry in more.items()]
    for row, y in ((first[:_ENTRIES], foot + 0.0275), ([*first[_ENTRIES:], *rest][:_ENTRIES], foot + 0.0025)):
        legend_row(figure, y, row)
