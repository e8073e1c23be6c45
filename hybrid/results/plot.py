"""Draw a result: `plot_summary` makes one page, the other functions its panels on your own Axes.

Plots read the file, through `read.Result`, and nothing else.  matplotlib is imported when
something is drawn, and never pyplot: no window, no display, no state that outlives a call.

Colours are those of Okabe and Ito, which stay apart for colour-blind eyes.  A zone kind has
one colour on the whole page; points followed over time have others.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.results.read import Result, Zone

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _GREY, _ALARM = "#222222", "#777777", "#C00000"
_KIND_COLOURS = {"rod": "#D55E00", "catenary": "#0072B2"}
_OTHER_KINDS = ("#CC79A7", "#F0E442")
_POINT_COLOURS = ("#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
_SMALL, _NORMAL = 6.5, 7.5  # type sizes in points, for a page 8 inches wide
_SHAPES = 9  # earlier shapes on a page; more become a blur
_ZERO = 1e-12  # SI; below this a force or moment of any real cable is round-off
_NAMES = {"theta": "angle to z", "phi": "azimuth"}


class _View(NamedTuple):
    """A plane to look at: two unit vectors (inertial) and what to write on the axes."""

    across: np.ndarray
    up: np.ndarray
    across_label: str
    up_label: str
    title: str

    def project(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return position @ self.across, position @ self.up


def plot_summary(
    result: Result,
    path: str | Path | None = None,
    *,
    times: Sequence[float] | None = None,
    history: Sequence[float] | None = None,
) -> Figure:
    """One page: shape, tension and moment along the cable, and histories at some points.

    path: where to save it (png, pdf, svg ...).  times: which earlier shapes (s).  history:
    which arc lengths to follow (m); else those recorded as `history`, else start, middle
    and end.  A static result shows curvature and tangent in place of histories.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    body = (0.0, 0.0, 1.0, 0.92)  # left, bottom, width, height; the head is above
    engine = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05, wspace=0.02, hspace=0.02, rect=body)
    figure = Figure(figsize=(8.0, 6.0), dpi=150, layout=engine)
    FigureCanvasAgg(figure)
    _head(figure, result)
    if len(result.times) == 0:
        _blank(figure.subplots(), "no output was saved")
    else:
        views = _views(result)
        layout, widths, heights = _layout(result, views)
        axes = figure.subplot_mosaic(layout, width_ratios=widths, height_ratios=heights)
        points = _history_points(result, history) if len(result.times) > 1 else np.zeros(0)
        for k, view in enumerate(views):
            plot_shape(axes[f"shape{k}"], result, times=times, view=view, points=points)
        plot_profiles(axes["p0"], result, "tension")
        plot_profiles(axes["p1"], result, ("bending_moment", "torque"))
        if len(result.times) > 1:
            plot_history(axes["h0"], result, "tension", points, legend=False)
            moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
            plot_history(axes["h1"], result, "position", points, component=int(moves.argmax()), legend=False)
        else:
            extra = [n for n in ("curvature", "theta", "shear") if n in result]
            for panel, name in zip(("h0", "h1"), [*extra, "curvature", "theta"], strict=False):
                plot_profiles(axes[panel], result, name)
        _legend(figure, result, points)
    if path is not None:
        try:
            figure.savefig(path, dpi=150)
        except (OSError, ValueError) as error:
            raise ResultError(f"the figure cannot be saved as {path}\n    detail:   {error}") from error
    return figure


def plot_shape(
    ax: Axes,
    result: Result,
    *,
    times: Sequence[float] | None = None,
    view: Any = None,
    points: Sequence[float] | np.ndarray = (),
) -> None:
    """The last shape, coloured by zones, over earlier ones in grey; the same scale both ways.

    times: earlier times to show (s), else some, evenly spread.  view: None for the plane of
    the largest extent, or two letters such as "xz".  points: arc lengths to mark (m).
    A cable that is nearly straight is drawn with its deflection magnified, and says so.
    """
    view = _letters(view) if isinstance(view, str) else view or _views(result)[0]
    position, s = result.position, result.s
    if times is None:
        shown = np.unique(np.linspace(0, len(result.times) - 1, _SHAPES + 1).round().astype(int))[:-1]
        earlier = position[shown]
    else:
        earlier = result.at(t=np.asarray(times, dtype=float), names=["position"])["position"]
    for k, shape in enumerate(earlier):
        grey = 0.87 - 0.27 * k / max(len(earlier) - 1, 1)
        ax.plot(*view.project(shape), color=str(grey), linewidth=0.7, zorder=1)
    last = position[-1]
    zones = _last_zones(result)
    for zone in zones:
        inside = s[(s > zone.s_a) & (s < zone.s_b)]
        piece = _along(np.array([zone.s_a, *inside, zone.s_b]), s, last)
        ax.plot(*view.project(piece), color=_colour(zone.kind), linewidth=2.0, zorder=3, label=zone.kind)
    joints = np.array([z.s_b for z in zones[:-1]])
    if len(joints):
        ax.plot(*view.project(_along(joints, s, last)), zorder=5, **_mark("o", "white"), label="joint")
    for k, marker in ((0, "s"), (-1, "^")):
        x, y = view.project(last[k])
        ax.plot([x], [y], zorder=4, **_mark(marker), label="end" if k else "start")
    for k, point in enumerate(points):
        x, y = view.project(_along(np.array([point]), s, last))
        ax.plot(x, y, "o", markersize=3, color=_point(k)["color"], zorder=6)
    _style(ax, view.title)
    ax.set_xlabel(f"{view.across_label} (m)", fontsize=_NORMAL)
    ax.set_ylabel(f"{view.up_label} (m)", fontsize=_NORMAL)
    ax.margins(0.06)
    _set_aspect(ax, view, np.concatenate([earlier, last[None]]))


def plot_profiles(ax: Axes, result: Result, names: str | Sequence[str], *, output: int = -1) -> None:
    """One or two quantities of the same unit along s at one output, and their range over all times.

    The zones of that output are shaded.  Further names after the first are dashed, and left
    out where they are zero everywhere.
    """
    names = [names] if isinstance(names, str) else list(names)
    for zone in result.zones[output]:
        ax.axvspan(zone.s_a, zone.s_b, color=_colour(zone.kind), alpha=0.10, linewidth=0, zorder=0)
    t = result.times[output]
    title = f"{_title(names[0])} at t = {t:.5g} s" if len(result.times) > 1 else _title(names[0])
    ax.set_xlim(result.s[0], result.s[-1])
    ax.set_xlabel("s (m)", fontsize=_NORMAL)
    if names[0] == "bending_moment" and set(result["zones/kind"]) == {"catenary"}:
        _blank(ax, "no rod zone,\nso no bending moment", title)
        return
    if names[0] not in result:
        _blank(ax, f"{_title(names[0])} was not recorded", title)
        return
    drawn = [(name, _scalar(result, name)) for name in names if name in result]
    peak = float(np.abs(drawn[0][1]).max())
    drawn = drawn[:1] + [(n, v) for n, v in drawn[1:] if np.abs(v).max() > max(_ZERO, 1e-6 * peak)]
    peak = max(float(np.abs(v).max()) for _, v in drawn)
    factor, unit = _prefix(result.units[names[0]], peak)
    for k, (name, values) in enumerate(drawn):
        if len(values) > 1:
            low, high = values.min(axis=0) * factor, values.max(axis=0) * factor
            ax.fill_between(result.s, low, high, color=_GREY, alpha=0.28 - 0.12 * k, linewidth=0, zorder=2)
        line: dict[str, Any] = {"color": _INK, "linewidth": 1.3, "linestyle": (0, (4, 1.5)) if k else "-"}
        ax.plot(result.s, values[output] * factor, zorder=3, label=_title(name), **line)
    _style(ax, " and ".join([_title(n) for n, _ in drawn]) + title.removeprefix(_title(names[0])))
    ax.set_ylabel(f"{_title(names[0]).removeprefix('bending ')} ({unit})", fontsize=_NORMAL)
    if len(drawn) > 1:
        ax.legend(fontsize=_SMALL, frameon=False, handlelength=2.2)
    _open_up(ax, peak * factor)


def plot_history(
    ax: Axes,
    result: Result,
    name: str,
    s: Sequence[float] | np.ndarray,
    *,
    component: int | None = None,
    legend: bool = True,
) -> None:
    """A quantity over time at the arc lengths s (m).

    component: 0, 1, 2 for x, y, z of a vector, drawn as the change since the first output;
    None for a scalar or the magnitude of a vector.  Dotted lines: the zones changed.
    """
    if "s" not in result.dims(name):
        raise ResultError(f"'{name}' does not depend on s; plot it as result[{name!r}] over result.times")
    values = result.at(s=np.asarray(s, dtype=float), names=[name])[name]
    if component is not None:
        values = values[..., component] - values[0, ..., component]
        label = f"Δ{'xyz'[component]}" if name == "position" else f"Δ{_title(name)} {'xyz'[component]}"
    else:
        values = np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values
        label = _title(name)
    peak = float(np.abs(values).max())
    factor, unit = _prefix(result.units[name], peak)
    for k, point in enumerate(s):
        ax.plot(result.times, values[:, k] * factor, **_point(k), label=f"s = {point:.4g} m")
    changes = np.unique(result["zones/t"])[1:]
    if 0 < len(changes) <= 40:  # more would hide the curves
        for t in changes:
            ax.axvline(t, color=_GREY, linewidth=0.6, linestyle=":", zorder=1)
    _style(ax, f"{label} since t = {result.times[0]:.4g} s" if component is not None else f"{label} over time")
    ax.set_xlim(result.times[0], result.times[-1])
    ax.set_xlabel("t (s)", fontsize=_NORMAL)
    ax.set_ylabel(f"{label} ({unit})", fontsize=_NORMAL)
    _open_up(ax, peak * factor)
    if legend:
        ax.legend(fontsize=_SMALL, frameon=True, framealpha=0.75, edgecolor="none", handlelength=1.2, borderpad=0.2)


# ---- what to look at ------------------------------------------------------------------------------


def _views(result: Result) -> list[_View]:
    """One plane if the cable stays in one, else two projections.

    It does if what leaves the plane is less than 2 % of the cable's extent and much less than
    the extent across the cable, which may be small too.
    """
    position = result.position.reshape(-1, 3)
    x, y, z = extents = np.ptp(position, axis=0)
    _, middle, largest = np.sort(extents)
    flat = max(min(0.02 * largest, 0.2 * middle), 1e-6 * largest)
    normal = min((1, 0, 2), key=lambda k: extents[k])
    if extents[normal] <= flat:
        return [_letters("xyz".replace("xyz"[normal], ""))]
    centred = position[:, :2] - position[:, :2].mean(axis=0)
    # The direction of the largest horizontal extent: first right singular vector, from the 2 x 2 Gram matrix.
    direction = np.linalg.eigh(centred.T @ centred)[1][:, 1]
    direction *= math.copysign(1.0, direction[np.argmax(np.abs(direction))])
    if np.ptp(centred @ np.array([-direction[1], direction[0]])) <= flat:
        angle = math.degrees(math.atan2(direction[1], direction[0]))
        axes, turned = (np.array([*direction, 0.0]), np.array([0.0, 0.0, 1.0])), f"{angle:.3g}° from x"
        return [_View(*axes, f"horizontal, {turned}", "z", f"shape in its vertical plane, {turned}")]
    if z >= max(x, y):
        return [_letters("xz"), _letters("yz")]
    return [_letters("xz"), _letters("xy")] if x >= y else [_letters("yz"), _letters("yx")]


def _letters(plane: str) -> _View:
    if len(plane) != 2 or not set(plane) <= set("xyz") or plane[0] == plane[1]:
        raise ResultError(f"view '{plane}' is not a plane\n    expected: two of the letters x, y, z, such as 'xz'")
    a, b = ("xyz".index(c) for c in plane)
    side = "from above" if "z" not in plane else "from the side"
    return _View(np.eye(3)[a], np.eye(3)[b], plane[0], plane[1], f"shape {side}, {plane[0]}–{plane[1]}")


def _layout(result: Result, views: list[_View]) -> tuple[list[Any], list[float], list[float]]:
    """Wide shapes above the other panels, tall ones beside them; widths and heights follow the shape."""
    across, up = (float(np.ptp(p)) for p in views[0].project(result.position))
    ratio = across / max(up, 1e-3 * across, 1e-300)
    if ratio >= 1.2:
        rows = [["shape0", f"shape{len(views) - 1}"], ["p0", "h0"], ["p1", "h1"]]
        return rows, [1.0, 1.0], [min(max(5.3 / ratio, 1.2), 1.8), 1.0, 1.0]
    if len(views) == 1:
        return [["shape0", "p0", "h0"], ["shape0", "p1", "h1"]], [min(max(2.2 * ratio, 1.0), 1.7), 1.0, 1.0], [1.0, 1.0]
    return [["shape0", "shape1", panel] for panel in ("p0", "p1", "h0", "h1")], [1.0, 1.0, 1.4], [1.0] * 4


def _history_points(result: Result, history: Sequence[float] | None) -> np.ndarray:
    default = result["history"] if "history" in result else np.linspace(result.s[0], result.s[-1], 3)
    points = np.asarray(default if history is None else history, dtype=float)
    if points.ndim != 1 or len(points) == 0:
        raise ResultError(f"history = {history!r} is no list of arc lengths\n    try:      history=[0.0]")
    return points


def _last_zones(result: Result) -> list[Zone]:
    return result.zones[-1] or [Zone("cable", float(result.s[0]), float(result.s[-1]))]


def _along(where: np.ndarray, s: np.ndarray, position: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(where, s, position[:, k]) for k in range(3)])


def _scalar(result: Result, name: str) -> np.ndarray:
    values = result[name]
    return np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values


# ---- how it looks ---------------------------------------------------------------------------------


def _title(name: str) -> str:
    return _NAMES.get(name, name.replace("/", " ").replace("_", " "))


def _colour(kind: str) -> str:
    return _KIND_COLOURS.get(kind, _OTHER_KINDS[len(kind) % len(_OTHER_KINDS)])


def _mark(symbol: str, face: str = _INK) -> dict[str, Any]:
    edge = {"markeredgecolor": _INK, "markeredgewidth": 0.8}
    return {"linestyle": "", "marker": symbol, "markersize": 4.5, "markerfacecolor": face, **edge}


def _point(k: int) -> dict[str, Any]:
    width = max(1.8 - 0.5 * k, 0.8)  # later curves are thinner, so that coinciding ones all show
    return {"color": _POINT_COLOURS[k % len(_POINT_COLOURS)], "linewidth": width}


def _prefix(unit: str, peak: float) -> tuple[float, str]:
    """Factor and unit that bring the largest value between 1 and 1000 where engineers do so."""
    if unit == "rad":
        return 180.0 / math.pi, "°"
    if unit == "1/m" and _ZERO < peak < 0.01:
        return 1e3, "1/km"
    if unit == "m":
        return (1e3, "mm") if _ZERO < peak < 0.01 else (1e-3, "km") if peak >= 1e4 else (1.0, "m")
    if unit.split(" ")[0] in ("N", "J", "W", "Pa") and peak > _ZERO:
        power = min(max(math.floor(math.log10(peak) / 3.0 + 1e-12), -4), 4)
        return 10.0 ** (-3 * power), ("p", "n", "µ", "m", "", "k", "M", "G", "T")[power + 4] + unit
    return 1.0, unit or "–"


def _style(ax: Axes, title: str) -> None:
    ax.set_title(title, loc="left", fontsize=_NORMAL, color=_INK, fontweight="bold")
    ax.tick_params(labelsize=_SMALL, width=0.6, length=2.5, color=_GREY, labelcolor=_INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(linewidth=0.6, color=_GREY)
    ax.grid(color="#000000", alpha=0.07, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.ticklabel_format(useOffset=False, scilimits=(-4, 5))
    for axis in (ax.xaxis, ax.yaxis):
        axis.get_offset_text().set_fontsize(_SMALL)


def _blank(ax: Axes, text: str, title: str = "") -> None:
    _style(ax, title)
    ax.set_yticks([])
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", fontsize=_NORMAL, color=_GREY)


def _open_up(ax: Axes, peak: float) -> None:
    """Keep round-off from filling the panel: show at least 0.1 % of the largest value."""
    low, high = ax.get_ylim()
    least = 1e-3 * peak if peak > _ZERO else 2.0
    if high - low < least:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - 0.5 * least, middle + 0.5 * least)


def _set_aspect(ax: Axes, view: _View, position: np.ndarray) -> None:
    across, up = (float(np.ptp(p)) for p in view.project(position))
    ratio = min(across, up) / max(across, up, 1e-300)
    magnified = 1.0
    if 1e-4 < ratio < 0.06:  # straighter than that is straight; less straight needs no help
        magnified = next(m for m in (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000) if m * ratio > 0.12)
        label = view.up_label if up < across else view.across_label.split(",")[0]
        ax.set_title(f"{label} × {magnified:.0f}", loc="right", fontsize=_NORMAL, color=_GREY)
    ax.set_aspect(magnified if up < across else 1.0 / magnified, adjustable="datalim")


def _legend(figure: Figure, result: Result, points: np.ndarray) -> None:
    """Below the panels: what the shape shows, and in a second row the points of the histories."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    zones = _last_zones(result)
    kinds = dict.fromkeys(z.kind for z in zones)
    shown: list[Any] = [Line2D([], [], color=_colour(k), linewidth=2.0, label=k) for k in kinds]
    marks = [("o", "white", "joint")] * (len(zones) > 1) + [("s", _INK, "start"), ("^", _INK, "end")]
    shown += [Line2D([], [], **_mark(symbol, face), label=label) for symbol, face, label in marks]
    if len(result.times) > 1:
        shown.append(Line2D([], [], color="0.7", linewidth=0.8, label="earlier shapes"))
        shown.append(Patch(facecolor=_GREY, alpha=0.28, linewidth=0, label="range over time"))
    rows = [shown]
    if len(points):
        dots: dict[str, Any] = {"marker": "o", "markersize": 3}
        rows.append([Line2D([], [], **_point(k), **dots, label=f"s = {p:.4g} m") for k, p in enumerate(points)])
    columns = max(len(row) for row in rows)
    nothing = Line2D([], [], linestyle="", label=" ")
    padded = [row + [nothing] * (columns - len(row)) for row in rows]
    handles = [row[k] for k in range(columns) for row in padded]  # a legend fills column by column
    look: dict[str, Any] = {"frameon": False, "fontsize": _SMALL, "labelcolor": _INK, "handlelength": 1.6}
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, borderpad=0.1, **look)


def _head(figure: Figure, result: Result) -> None:
    title = textwrap.shorten(result.title or "(no title)", 84, placeholder=" …")
    n = len(result.times)
    facts = f"{n} outputs, t = {result.times[0]:.5g} … {result.times[-1]:.5g} s" if n > 1 else "static" if n else ""
    warning = "" if result.status == "complete" else textwrap.shorten(result.status_text, 120, placeholder=" …")
    figure.text(0.0125, 0.985, title, va="top", fontsize=10, fontweight="bold", color=_INK)
    figure.text(0.0125, 0.95, warning or facts, va="top", fontsize=_NORMAL, color=_ALARM if warning else _GREY)
