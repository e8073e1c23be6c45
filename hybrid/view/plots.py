"""Pages of a result: `plot_summary` arranges panels to suit the shape, `plot_zones` shows its zones over time.

Pages read the file, through `Result`, and nothing else. matplotlib is imported when something is drawn.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.store.reader import Result
from hybrid.store.records import error_words
from hybrid.view.figure import Map, Page, Panel, distinct_texts, short
from hybrid.view.panels import history as over_time
from hybrid.view.panels import page_of, profiles, refuse_several, shape, touchdown
from hybrid.view.projections import (
    Numbers,
    aspect_of,
    history_points,
    not_to_scale,
    telling_times,
    touches_bed,
    views_of,
    whole_zones,
)
from hybrid.view.save import save_figure
from hybrid.view.zones import counted, share_of_rod, why_rods, zone_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    overwrite. times: which earlier shapes (s). history:
    which arc lengths to follow (m); else those recorded as `history`, else the middle and
    the ends that move. A static result shows curvature and tangent in place of histories; a
    cable that touches a seabed also shows the force of contact and, over time, where it does.
    Of several lines all are drawn, with points and bodies; times and history are of one line, `result.lines[name]`.
    """
    from hybrid.view.matplotlib_backend import draw_page

    if result.lines:
        from hybrid.view.lines import page

        if times is not None or history is not None:
            refuse_several(result, "times and history")
        return save_figure(draw_page(page(result)), path, overwrite=overwrite)
    return save_figure(draw_page(_summary(result, times, history)), path, overwrite=overwrite)


def plot_zones(result: Result, path: str | Path | None = None, *, overwrite: bool = False) -> Figure:
    """One page: the zones along s over time, rods by their curvature and catenaries by their tension, and the share
    of rod.

    path: where to save it, as .png, .pdf or .svg (see plot_summary). Also drawn, where the file has them: where the
    cable touches down, what is attached to it, and where zones were split, merged or a step retried.
    """
    from hybrid.view.matplotlib_backend import draw_page

    refuse_several(result, "zones along s")
    more: dict[str, Any] = {}
    if len(result.times):
        zones = zone_map(result)
        rows = [["map", item.name] for item in zones.items if isinstance(item, Map)] or [["map", "."]]
        more = {"panels": {"map": zones, "share": share_of_rod(result)}, "mosaic": [*rows, ["share", "."]]}
        more |= {"widths": [1.0, 0.022], "legend": ["map"]}
        more["heights"] = [*(3.0 / len(rows) for _ in rows), 0.8]
    return save_figure(
        draw_page(page_of(result, [x for x in (counted(result), why_rods(result)) if x], **more)),
        path,
        overwrite=overwrite,
    )


def _summary(result: Result, times: Numbers | None, history: Numbers | None) -> Page:
    earlier = telling_times(result) if times is None else np.sort(np.asarray(times, dtype=float))
    if not len(result.times):
        return page_of(result, _facts(result, earlier))
    views, lies = views_of(result), touches_bed(result)
    pages, drawn = (_ONE_VIEW_BED, _TWO_VIEWS_BED) if lies else (_ONE_VIEW, _TWO_VIEWS), aspect_of(views, result)
    mosaic, widths, heights, _ = min(pages[len(views) - 1], key=lambda page: abs(math.log(page[3] / drawn)))
    points = history_points(result, history) if len(result.times) > 1 else np.zeros(0)
    panels: dict[str, Panel] = {
        name: shape(result, times=earlier, view=view, points=points) for name, view in zip("sS", views, strict=False)
    }
    bent = "bending_moment" in result and not set(result["zones/kind"]) <= {"catenary"}
    names: list[Any] = ["tension", ("bending_moment", "torque")] if bent else ["tension"]
    angles = ("theta", "phi") if len(views) > 1 else ("theta" if views[0].up_label == "z" else "phi",)
    names += [n for n in ("curvature", *angles) if n in result]
    names += [views[-1].up_label.replace("across", "z"), "x", "y"]
    names[2:2] = ["contact"] * lies
    along, over = ("pPc", "hTH") if lies else ("pP", "hH")
    for key, quantity in zip(along if len(points) else along + over, names, strict=False):
        panels[key] = profiles(result, quantity, times=earlier if quantity == "contact" else ())
    if len(points):
        moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
        panels["h"] = over_time(result, "tension", points)
        panels["H"] = over_time(result, "position", points, component=int(moves.argmax()), legend=False)
        panels |= {"T": touchdown(result)} if lies else {}
    legend = ["s", "h"] if len(points) else ["s"]
    look = {"mosaic": mosaic, "widths": widths, "heights": heights, "legend": legend}
    return page_of(result, _facts(result, earlier), panels=panels, **look)


def _facts(result: Result, earlier: np.ndarray) -> list[str]:
    zones = whole_zones(result.zones[-1]) if len(result.times) else []
    facts = []
    if 0 < len(zones) <= 4:  # more do not fit a line
        facts.append(", ".join(f"{z.kind} {short(z.s_a, 4)} … {short(z.s_b, 4)} m" for z in zones))
    if "error_total_position" in result.attributes:
        facts.insert(0, f"estimated error {error_words(result.attributes)}")
    facts += [text for view in (views_of(result) if len(result.times) else ()) if (text := not_to_scale(view, result))]
    if len(earlier):
        facts.append("earlier shapes at t = " + ", ".join(distinct_texts(earlier)) + " s")
    return facts
