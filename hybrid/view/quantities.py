"""One quantity of a result on axes of one's own: over time, along the cable, its extremes, its spectrum; the shape."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.statistics.moments import welch
from hybrid.store.histories import History, history_of, lies_along
from hybrid.store.reader import Result
from hybrid.store.records import error_words
from hybrid.view.curves import AXES, along, extent
from hybrid.view.figure import (
    ALARM,
    GREY,
    POINT_COLOURS,
    Axis,
    Band,
    Item,
    Line,
    Map,
    Page,
    Panel,
    distinct_texts,
    prefix,
    save_figure,
    short,
    title_of,
)
from hybrid.view.lines import AllLines, bodies_in, page
from hybrid.view.panels import energy, only_line, page_of, profiles, shape, touchdown
from hybrid.view.panels import history as over_time
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
from hybrid.view.zones import counted, share_of_rod, why_rods, zone_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_quantity(
    result: Result,
    quantity: str = "tension",
    *,
    at: Any = None,
    envelope: bool = False,
    spectrum: bool = False,
    times: tuple[float | None, float | None] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw one quantity, and return the axes.

    quantity: a name of `result.names`, of a group with its slash, such as "work/drag"; end forces are those of every
    step.  at: arc lengths (m) whose histories are drawn; None: of a quantity along the line its last profile within the
    range of all outputs.  envelope: the lowest and highest value along the line, over every accepted step where the
    file has them.  spectrum: of the histories, by Welch's method.  times: from and to, s.
    ax: matplotlib axes to draw on; None: those of a new figure, `ax.figure`.  ResultError: what is not there.
    """
    result = only_line(result, "a quantity")
    if not len(result.times):
        raise ResultError("the result has no output to draw")
    if envelope and (spectrum or at is not None or times is not None):
        raise ResultError("an envelope is of all times and places\n    try:      without at, times and spectrum")
    if envelope:
        panel = _enveloped(result, quantity)
    elif at is None and not spectrum and times is None and _has_profile(result, quantity):
        panel = profiles(result, quantity)
    elif spectrum:
        panel = _spectra(result, quantity, at, times)
    else:
        panel = _histories(result, quantity, at, times)
    return draw_on(panel, ax)


def plot_shape(
    result: Result, *, view: str | None = None, times: list[float] | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the last shape over earlier ones, as `plot` does, and return the axes; view: two of x, y, z."""
    result = only_line(result, "a shape")
    return draw_on(shape(result, view=view, times=times), ax)


def plot_zone_map(result: Result, *, ax: Axes | None = None) -> Axes:
    """Draw the zones along s over time, without the page around them, and return the axes."""
    return draw_on(zone_map(only_line(result, "zones along s")), ax)


def plot_energy(result: Result, *, work: bool = False, ax: Axes | None = None) -> Axes:
    """Draw where the energy is, or with `work` where it came from, over time, and return the axes."""
    panel = energy(only_line(result, "energies"), "work" if work else "energy")
    if panel is None:
        raise ResultError("the result has no energies over time")
    return draw_on(panel, ax)


def draw_on(panel: Panel, ax: Axes | None) -> Axes:
    """A panel on axes, or on those of a new figure."""
    from hybrid.view.matplotlib_backend import draw_panel, new_axes

    ax = new_axes() if ax is None else ax
    draw_panel(panel, ax, legend=any(getattr(item, "label", "") for item in panel.items))
    return ax


def _has_profile(result: Result, name: str) -> bool:
    return name in AXES or (name in result and result.dims(name)[:2] == ("t", "s"))


def _histories(result: Result, name: str, at: Any, times: Any) -> Panel:
    found = _history(result, name, at, times)
    values, labels = _columns(result, name, found.values, found.s)
    factor, unit = prefix(found.unit, float(np.nanmax(np.abs(values), initial=0.0)))
    items: list[Item] = [
        Line(found.t, values[:, k] * factor, label, POINT_COLOURS[k % len(POINT_COLOURS)], dash="dash" * (k > 5))
        for k, label in enumerate(labels)
    ]
    title = f"{title_of(name)} over time"
    caption = f"{title[:1].upper()}{title[1:]}, {found.basis}."
    return Panel(f"history-{name}", title, Axis("t", "s"), Axis(title_of(name), unit), items, caption=caption)


def _spectra(result: Result, name: str, at: Any, times: Any) -> Panel:
    history = _history(result, name, at, times)
    found = welch(history.t, history.values)
    factor, unit = prefix(history.unit, float(np.max(np.std(history.values, axis=0))))
    density, labels = _columns(result, name, factor**2 * np.asarray(found.S), history.s)
    seen = _seen(found.f, density)
    items: list[Item] = [
        Line(found.f[seen], density[seen, k], label, POINT_COLOURS[k % len(POINT_COLOURS)])
        for k, label in enumerate(labels)
    ]
    up = Axis(f"density of {title_of(name)}", f"({unit})² s" if " " in unit or "/" in unit else f"{unit}² s", 0.0)
    return Panel(f"spectrum-{name}", f"spectrum of {title_of(name)}", Axis("f", "Hz", 0.0), up, items)


def _seen(f: np.ndarray, density: np.ndarray) -> np.ndarray:
    """Frequencies up to twice that above which a thousandth of the variance lies: the rest is an empty axis."""
    total = np.cumsum(np.atleast_2d(density.T), axis=1)
    share = (total / np.maximum(total[:, -1:], 1e-300)).min(axis=0)
    return np.asarray(f <= 2.0 * f[min(int(np.searchsorted(share, 0.999)), len(f) - 1)])


def _enveloped(result: Result, name: str) -> Panel:
    if not _has_profile(result, name):
        if f"steps/{name}" not in result:
            result.dims(name)  # says what a name that is not there may mean
        raise ResultError(f"'{name}' has no value along the line\n    try:      tension, curvature, bending_moment")
    s, low, high, basis = extent(result, name)
    factor, unit = prefix(result.units[name], float(np.abs([low, high]).max()))
    items: list[Item] = [
        Band(s, low * factor, high * factor, colour=GREY, opacity=0.2),
        Line(s, high * factor, "highest", "#B84F04"),
        Line(s, low * factor, "lowest", "#2C72B6"),
    ]
    allowed = along(result, name).of(result, "min_bend_radius") if name == "curvature" else None
    if allowed is not None:
        items.append(Line(*along(result, name).curve(factor / allowed), "allowed", ALARM, 1.6, "dot"))
    title = f"envelope of {title_of(name)}, {basis}"
    return Panel(f"envelope-{name}", title, Axis("s", "m"), Axis(title_of(name), unit), items)


def _history(result: Result, name: str, at: Any, times: Any) -> History:
    """Histories of a quantity; x, y and z are those of the position."""
    if name in result and result.dims(name) == ("t", "s", "xyz"):
        fix = "x, y or z" if name == "position" else "a quantity of one component"
        raise ResultError(f"'{name}' has three components at every place\n    try:      {fix}")
    if at is None and lies_along(result, name):  # the ends and the middle
        at = result.s[[0, len(result.s) // 2, -1]] if len(result.s) > 2 else result.s
    return history_of(result, name, times, at)


def _columns(result: Result, name: str, values: np.ndarray, s: Any) -> tuple[np.ndarray, list[str]]:
    """Histories as columns, with a label each; of three components their axis."""
    values = np.asarray(values, float)
    if values.ndim == 1:
        return values[:, None], [""]
    values = values.reshape(len(values), -1)
    if s is None:
        last = result.dims(name)[-1] if name in result else ""
        return values, list(AXES) if last == "xyz" else [str(k) for k in range(values.shape[1])]
    labels = [f"s = {short(float(x), 5)} m" for x in s]
    for k in np.flatnonzero(np.diff(s) == 0.0):
        labels[k], labels[k + 1] = f"{labels[k]}, before", f"{labels[k + 1]}, after"
    return values, labels


# Pages of a result: `plot_summary` arranges panels to suit the shape, `plot_zones` shows its zones over time.
#
# Pages read the file, through `Result`, and nothing else. matplotlib is imported when something is drawn.

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
    Bodies are drawn with it.  Of several lines all are drawn, with points and bodies; times and history are of one:
    `result.lines[name]`.
    """
    from hybrid.view.matplotlib_backend import draw_page

    if times is not None or history is not None:
        only_line(result, "times and history")
    alone = AllLines(result).alone
    made = page(result) if alone is None else _summary(result, alone, times, history)
    return save_figure(draw_page(made), path, overwrite=overwrite)


def plot_zones(result: Result, path: str | Path | None = None, *, overwrite: bool = False) -> Figure:
    """One page of zones: along s over time, and the share of rod.

    Rods are drawn by their curvature and catenaries by their tension.

    path: where to save it, as .png, .pdf or .svg (see plot_summary). Also drawn, where the file has them: where the
    cable touches down, what is attached to it, and where zones were split, merged or a step retried.
    """
    from hybrid.view.matplotlib_backend import draw_page

    line = only_line(result, "zones along s")
    more: dict[str, Any] = {}
    if len(line.times):
        zones = zone_map(line)
        rows = [["map", item.name] for item in zones.items if isinstance(item, Map)] or [["map", "."]]
        more = {"panels": {"map": zones, "share": share_of_rod(line)}, "mosaic": [*rows, ["share", "."]]}
        more |= {"widths": [1.0, 0.022], "legend": ["map"]}
        more["heights"] = [*(3.0 / len(rows) for _ in rows), 0.8]
    return save_figure(
        draw_page(page_of(result, [x for x in (counted(line), why_rods(line)) if x], **more)), path, overwrite=overwrite
    )


def _summary(whole: Result, result: Result, times: Numbers | None, history: Numbers | None) -> Page:
    """The page of a line alone, with the bodies of the whole result."""
    earlier = telling_times(result) if times is None else np.sort(np.asarray(times, dtype=float))
    if not len(result.times):
        return page_of(whole, _facts(result, earlier))
    views, lies = views_of(result), touches_bed(result)
    pages, drawn = (_ONE_VIEW_BED, _TWO_VIEWS_BED) if lies else (_ONE_VIEW, _TWO_VIEWS), aspect_of(views, result)
    mosaic, widths, heights, _ = min(pages[len(views) - 1], key=lambda page: abs(math.log(page[3] / drawn)))
    points = history_points(result, history) if len(result.times) > 1 else np.zeros(0)
    panels: dict[str, Panel] = {
        name: shape(result, times=earlier, view=view, points=points) for name, view in zip("sS", views, strict=False)
    }
    for name, view in zip(panels, views, strict=False):
        panels[name] = panels[name]._replace(items=[*panels[name].items, *bodies_in(whole, view, -1)])
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
    return page_of(whole, _facts(result, earlier), panels=panels, **look)


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
