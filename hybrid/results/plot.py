"""Draw a result: `plot_summary` makes one page, the other functions its panels on your own Axes.

Plots read the file, through `read.Result`, and nothing else.  matplotlib is imported when
something is drawn, and never pyplot: no window, no display, no state that outlives a call.

Colours are those of Okabe and Ito, which stay apart for colour-blind eyes.  A zone kind has
one colour on the whole page; points followed over time have others; grey is what was earlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.results.read import Result, Zone

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _GREY, _ALARM = "#222222", "#6E6E6E", "#C00000"
_KIND_COLOURS = {"rod": "#D55E00", "catenary": "#0072B2"}  # kinds that are not named here are drawn in ink
_POINT_COLOURS = ("#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
_SMALL, _NORMAL = 7.0, 8.0  # type sizes in points, for a page 8 inches wide
_LEFT = 0.0125  # where lines of text begin, as a part of the page's width
_SHAPES = 9  # earlier shapes on a page; more become a blur
_SWEPT = 4000  # strips of the swept area; more take seconds and cover the same
_ZERO = 1e-12  # SI; below this a force or moment of any real cable is round-off
_STILL = 1e-6  # of the cable's extent: motion and deflection below this are round-off
_NAMES = {"theta": "angle to z", "phi": "azimuth", "bending_moment": "|bending moment|", "shear": "|shear|"}
_NAMES |= {x: f"position {x}" for x in "xyz"}
_WARNINGS = ("slack", "unresolved bend", "undamped", "turned in")  # events a picture must not hide, worst first


class _View(NamedTuple):
    """A plane to look at: two unit vectors (inertial) and what to write on the axes."""

    across: np.ndarray
    up: np.ndarray
    across_label: str
    up_label: str
    title: str

    def project(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return position @ self.across, position @ self.up


class _Page(NamedTuple):
    """A way to arrange the panels, and what room (least and most, inches) it leaves for one shape inside its axes."""

    rows: tuple[str, ...]
    width: tuple[float, float]
    height: tuple[float, float]


# s, S: the first and the second view; p, P: profiles along s; h, H: histories (statics: more profiles).
_ONE_VIEW = (
    _Page(("ss", "ph", "PH"), (7.3, 7.3), (1.4, 1.9)),
    _Page(("ssp", "hHP"), (4.7, 4.7), (1.5, 2.7)),
    _Page(("sp", "sP", "sh", "sH"), (2.9, 4.2), (4.3, 4.3)),
    _Page(("sph", "sPH"), (1.7, 2.9), (4.3, 4.3)),
)
_TWO_VIEWS = (
    _Page(("sp", "SP", "hH"), (4.4, 4.4), (1.0, 1.2)),
    _Page(("sph", "SPH"), (1.8, 3.6), (1.9, 1.9)),
    _Page(("sSp", "sSP", "sSh", "sSH"), (1.3, 2.2), (4.3, 4.3)),
)
_ROOM, _FRAME = (8.0, 4.9), (0.65, 0.55)  # inches: all panels together; labels, ticks and title around one of them


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

    figure = Figure(figsize=(8.0, 6.0), dpi=150)
    FigureCanvasAgg(figure)
    foot = 0.03 if _head_and_foot(figure, result) else 0.0
    body = (0.0, foot, 1.0, 0.92 - foot)  # left, bottom, width, height
    figure.set_layout_engine(ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05, wspace=0.02, hspace=0.02, rect=body))
    if len(result.times) == 0:
        _blank(figure.subplots(), "no output was saved")
    else:
        views = _views(result)
        rows, widths, heights = _arrange(result, views)
        axes = figure.subplot_mosaic("\n".join(rows), width_ratios=widths, height_ratios=heights)
        points = _history_points(result, history) if len(result.times) > 1 else np.zeros(0)
        earlier = _telling_times(result) if times is None else np.sort(np.asarray(times, dtype=float))
        for name, view in zip("sS", views, strict=False):
            plot_shape(axes[name], result, times=earlier, view=view, points=points)
        bent = "bending_moment" in result and not set(result["zones/kind"]) <= {"catenary"}
        profiles: list[Any] = ["tension", ("bending_moment", "torque")] if bent else ["tension"]
        profiles += [n for n in ("curvature", "theta") if n in result] + [views[0].up_label, "tension"]
        for name, quantity in zip("pP" if len(points) else "pPhH", profiles, strict=False):
            plot_profiles(axes[name], result, quantity)
        if len(points):
            plot_history(axes["h"], result, "tension", points, legend=False)
            moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
            plot_history(axes["H"], result, "position", points, component=int(moves.argmax()), legend=False)
        for upper, lower in zip(rows[:-1], rows[1:], strict=True):
            for a, b in zip(upper, lower, strict=True):
                if a + b in ("pP", "hH"):  # one above the other, along the same s or t
                    axes[a].set_xlabel("")
                    axes[a].tick_params(labelbottom=False)
        _legend(figure, result, points, earlier)
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
    """The last shape, coloured by zones, over earlier ones and the area swept, in grey; the same scale both ways.

    times: earlier times to show (s), else those whose shapes differ most.  view: None for the
    plane of the largest extent, or two letters such as "xz".  points: arc lengths to mark (m).
    A cable that is nearly straight is drawn with its deflection magnified, and says so.
    """
    from matplotlib.collections import PolyCollection

    view = _letters(view) if isinstance(view, str) else view or _views(result)[0]
    position, s = result.position, result.s
    times = _telling_times(result) if times is None else np.asarray(times, dtype=float)
    strips = np.stack(view.project(position[_evenly_moving(position)]), axis=-1)
    outlines = np.concatenate([strips[:-1], strips[1:, ::-1]], axis=1)  # there along one shape, back along the next
    # Edges close the seams between strips; as pixels in a PDF, where each strip would weigh as much as a curve.
    swept = PolyCollection(outlines, facecolor="0.92", edgecolor="0.92", linewidth=0.4, zorder=0.4, rasterized=True)
    ax.add_collection(swept)
    for k, shape in enumerate(result.at(t=times, names=["position"])["position"]):
        grey = 0.75 - 0.3 * k / max(len(times) - 1, 1)
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
    magnified = _magnified(view, position)
    across, up = (float(np.ptp(p)) for p in view.project(position))
    thin = view.up_label if up < across else view.across_label.split(",")[0]
    stretch = f", {thin} × {magnified:g}" if magnified > 1 else ""
    _style(ax, f"{view.title}{_at(result, -1)}{stretch}")
    ax.set_xlabel(f"{view.across_label} (m)", fontsize=_NORMAL)
    ax.set_ylabel(f"{view.up_label} (m)", fontsize=_NORMAL)
    ax.margins(0.06)
    ax.set_aspect(magnified if up < across else 1.0 / magnified, adjustable="datalim")


def plot_profiles(ax: Axes, result: Result, names: str | Sequence[str], *, output: int = -1) -> None:
    """One or two quantities of the same unit along s at one output, and their range over all times.

    The zones of that output are shaded.  Further names after the first are dashed, and left
    out where they are zero everywhere.
    """
    names = [names] if isinstance(names, str) else list(names)
    for zone in result.zones[output]:
        ax.axvspan(zone.s_a, zone.s_b, color=_colour(zone.kind), alpha=0.10, linewidth=0, zorder=0)
    ax.set_xlim(result.s[0], result.s[-1])
    ax.set_xlabel("s (m)", fontsize=_NORMAL)
    if names[0] not in (*result.names, *"xyz"):
        _blank(ax, f"{_title(names[0])} was not recorded", _title(names[0]) + _at(result, output))
        return
    drawn = [(name, _scalar(result, name)) for name in names if name in (*result.names, *"xyz")]
    peak = float(np.abs(drawn[0][1]).max())
    drawn = drawn[:1] + [(n, v) for n, v in drawn[1:] if np.abs(v).max() > max(_ZERO, 1e-6 * peak)]
    peak = max(float(np.abs(v).max()) for _, v in drawn)
    factor, unit = _prefix("m" if names[0] in "xyz" else result.units[names[0]], peak)
    for k, (name, values) in enumerate(drawn):
        if len(values) > 1:
            low, high = values.min(axis=0) * factor, values.max(axis=0) * factor
            ax.fill_between(result.s, low, high, color=_GREY, alpha=0.28 - 0.12 * k, linewidth=0, zorder=2)
        line: dict[str, Any] = {"color": _INK, "linewidth": 1.3, "linestyle": (0, (4, 1.5)) if k else "-"}
        ax.plot(result.s, values[output] * factor, zorder=3, label=_title(name), **line)
    _style(ax, " and ".join([_title(n) for n, _ in drawn]) + _at(result, output))
    ax.set_ylabel(f"{_title(names[0]).replace('bending ', '')} ({unit})", fontsize=_NORMAL)
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
    the extent across the cable, which may be small too, and if it moves much less that way
    than it moves at all: a taut line sways by little, but that is what there is to see.
    """
    position = result.position.reshape(-1, 3)
    x, y, z = extents = np.ptp(position, axis=0)
    _, middle, largest = np.sort(extents)
    flat = max(min(0.02 * largest, 0.2 * middle), _STILL * largest)
    moves = np.ptp(result.position, axis=0)
    still = max(0.2 * float(np.max(moves)), _STILL * largest)
    normal = min((1, 0, 2), key=lambda k: extents[k])
    if extents[normal] <= flat and moves[:, normal].max() <= still:
        return [_letters("xyz".replace("xyz"[normal], ""))]
    centred = position[:, :2] - position[:, :2].mean(axis=0)
    # The direction of the largest horizontal extent: first right singular vector, from the 2 x 2 Gram matrix.
    direction = np.linalg.eigh(centred.T @ centred)[1][:, 1]
    direction *= math.copysign(1.0, direction[np.argmax(np.abs(direction))])
    sideways = result.position[..., :2] @ np.array([-direction[1], direction[0]])
    if np.ptp(sideways) <= flat and np.ptp(sideways, axis=0).max() <= still:
        angle = math.degrees(math.atan2(direction[1], direction[0]))
        axes, turned = (np.array([*direction, 0.0]), np.array([0.0, 0.0, 1.0])), f"{angle:.3g}° from x"
        return [_View(*axes, f"horizontal, {turned}", "z", "shape")]
    if z >= max(x, y):
        return [_letters("xz"), _letters("yz")]
    return [_letters("xz"), _letters("xy")] if x >= y else [_letters("yz"), _letters("yx")]


def _letters(plane: str) -> _View:
    if len(plane) != 2 or not set(plane) <= set("xyz") or plane[0] == plane[1]:
        raise ResultError(f"view '{plane}' is not a plane\n    expected: two of the letters x, y, z, such as 'xz'")
    a, b = ("xyz".index(c) for c in plane)
    title = "shape" if "z" in plane else "shape from above"
    return _View(np.eye(3)[a], np.eye(3)[b], plane[0], plane[1], title)


def _magnified(view: _View, position: np.ndarray) -> float:
    """Factor on the smaller direction of a view: 1, or where it would be a mere line, a round number that opens it."""
    across, up = (float(np.ptp(p)) for p in view.project(position))
    ratio = min(across, up) / max(across, up, 1e-300)
    if not _STILL < ratio < 0.08:  # straighter than that is straight; less straight needs no help
        return 1.0
    most = 0.3 / ratio  # about the shape of the flattest panel
    power = 10.0 ** math.floor(math.log10(most))
    return power * max(m for m in (1, 2, 5) if m * power <= most)


def _arrange(result: Result, views: list[_View]) -> tuple[tuple[str, ...], list[float], list[float]]:
    """The page whose room for the shapes has their proportions; rows of panels, widths and heights."""
    logs = []
    for view in views:
        across, up = (max(float(np.ptp(p)), 1e-300) for p in view.project(result.position))
        stretch = _magnified(view, result.position)
        logs.append(math.log(across / up) + math.copysign(math.log(stretch), across - up))
    ratio = math.exp(sum(logs) / len(logs))
    best, room, fill = _ONE_VIEW[0], (1.0, 1.0), 0.0
    for page in _ONE_VIEW if len(views) == 1 else _TWO_VIEWS:
        width = min(max(ratio * page.height[1], page.width[0]), page.width[1])
        height = min(max(width / ratio, page.height[0]), page.height[1])
        filled = min(ratio * height / width, width / height / ratio)
        if filled > fill:
            best, room, fill = page, (width, height), filled
    parts = []
    for k, line in enumerate((best.rows[0], "".join(row[0] for row in best.rows))):
        shapes = [c for c in line if c in "sS"]
        taken = len(set(shapes)) * (room[k] + _FRAME[k])
        rest = (_ROOM[k] - taken) / max(len(line) - len(shapes), 1)
        parts.append([taken / len(shapes) if c in "sS" else rest for c in line])
    return best.rows, parts[0], parts[1]


def _telling_times(result: Result) -> np.ndarray:
    """Times of the earlier shapes that show the motion: the first, then always the one farthest from all taken.

    Steps of time show nothing of a quick relaxation, and steps of time or of distance
    travelled fall on the same phases of a periodic motion; this finds its extremes.
    """
    position = result.position[:, :: max(1, len(result.s) // 50)]  # 50 points tell shapes apart
    least = _STILL * float(np.max(np.ptp(position.reshape(-1, 3), axis=0)))
    away = np.linalg.norm(position - position[-1], axis=2).max(axis=1)
    taken: list[int] = []
    while len(taken) < _SHAPES and away.max() > least:
        taken.append(int(away.argmax()) if taken else 0)
        away = np.minimum(away, np.linalg.norm(position - position[taken[-1]], axis=2).max(axis=1))
    return np.sort(result.times[taken])


def _evenly_moving(position: np.ndarray) -> np.ndarray:
    """Numbers of at most _SWEPT outputs, evenly spread over the distance travelled."""
    if len(position) <= _SWEPT:
        return np.arange(len(position))
    steps = [float(np.linalg.norm(b - a, axis=1).max()) for a, b in zip(position[:-1], position[1:], strict=True)]
    travelled = np.cumsum([0.0, *steps])
    return np.unique(np.searchsorted(travelled, np.linspace(0.0, travelled[-1], _SWEPT)))


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
    if name in "xyz":
        return np.asarray(result.position[..., "xyz".index(name)])
    values = result[name]
    return np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values


# ---- how it looks ---------------------------------------------------------------------------------


def _title(name: str) -> str:
    return _NAMES.get(name, name.replace("/", " ").replace("_", " "))


def _at(result: Result, output: int) -> str:
    return f" at t = {result.times[output]:.5g} s" if len(result.times) > 1 else ""


def _colour(kind: str) -> str:
    return _KIND_COLOURS.get(kind, _INK)


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
    from matplotlib.ticker import MaxNLocator

    ax.set_title(title, loc="left", fontsize=_NORMAL, color=_INK, fontweight="bold")
    ax.tick_params(labelsize=_SMALL, width=0.6, length=2.5, color=_GREY, labelcolor=_INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(linewidth=0.6, color=_GREY)
    ax.grid(color="#000000", alpha=0.07, linewidth=0.6)
    ax.set_axisbelow(True)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], min_n_ticks=3))
        axis.get_offset_text().set_fontsize(_SMALL)
    ax.ticklabel_format(useOffset=False, scilimits=(-4, 5))


def _blank(ax: Axes, text: str, title: str = "") -> None:
    _style(ax, title)
    ax.set_yticks([])
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", fontsize=_NORMAL, color=_GREY)


def _open_up(ax: Axes, peak: float) -> None:
    """Keep round-off from filling the panel: show at least 0.1 % of the largest value.  Mark where signs change."""
    low, high = ax.get_ylim()
    least = 1e-3 * peak if peak > _ZERO else 2.0
    if high - low < least:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - 0.5 * least, middle + 0.5 * least)
    low, high = ax.get_ylim()
    if low < -0.1 * (high - low) < 0.1 * (high - low) < high:
        ax.axhline(0.0, color=_GREY, linewidth=0.6, zorder=1)


def _legend(figure: Figure, result: Result, points: np.ndarray, earlier: np.ndarray) -> None:
    """Below the panels: what the shape shows, and in a second row the points of the histories."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    zones = _last_zones(result)
    kinds = dict.fromkeys(z.kind for z in zones)
    shown: list[Any] = [Line2D([], [], color=_colour(k), linewidth=2.0, label=k) for k in kinds]
    marks = [("o", "white", "joint")] * (len(zones) > 1) + [("s", _INK, "start"), ("^", _INK, "end")]
    shown += [Line2D([], [], **_mark(symbol, face), label=label) for symbol, face, label in marks]
    if len(result.times) > 1:
        shown.append(Patch(facecolor="0.85", linewidth=0, label="range over time"))
    if len(earlier):
        when = ", ".join(f"{t:.3g}" for t in earlier[:_SHAPES]) + " …" * (len(earlier) > _SHAPES)
        shown.append(Line2D([], [], color="0.6", linewidth=0.8, label=f"earlier, at t = {when} s"))
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


def _head_and_foot(figure: Figure, result: Result) -> bool:
    """Title and facts above the panels, warnings below; whether there are warnings."""
    n = len(result.times)
    facts = f"{n} outputs, t = {result.times[0]:.5g} … {result.times[-1]:.5g} s" if n > 1 else "static" if n else ""
    if n and 0 < len(result.zones[-1]) <= 4:  # more are to be seen in the panels, not to be read
        facts += "; " + ", ".join(f"{z.kind} {z.s_a:.4g} … {z.s_b:.4g} m" for z in result.zones[-1])
    complete = result.status == "complete"
    _line(figure, 0.985, result.title or "(no title)", fontsize=10, fontweight="bold", color=_INK)
    _line(figure, 0.95, facts if complete else result.status_text, color=_GREY if complete else _ALARM)
    events = sorted((e for e in result.events if e.kind in _WARNINGS), key=lambda e: (_WARNINGS.index(e.kind), e.t))
    if events:
        kinds = [e.kind for e in events]
        names = [k + f" (× {kinds.count(k)})" * (kinds.count(k) > 1) for k in dict.fromkeys(kinds)]
        first = f"{', '.join(names)}; at t = {events[0].t:.4g} s {events[0].text}"
        _line(figure, 0.025, f"Note: {first}", fontsize=_SMALL, color=_ALARM)
    return bool(events)


def _line(figure: Figure, y: float, text: str, **look: Any) -> None:
    """One line from the left edge, cut to the width of the page.  A $ in it is a $."""
    line = figure.text(_LEFT, y, text, va="top", parse_math=False, **({"fontsize": _NORMAL} | look))
    while (share := (1.0 - 2.0 * _LEFT) * figure.bbox.width / line.get_window_extent().width) < 1.0:
        text = text[: min(int(share * len(text)), len(text) - 1)]
        line.set_text(f"{text.rstrip()} …")
