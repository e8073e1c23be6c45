"""Draw a result: `plot_summary` makes one page, the other functions its panels on your own Axes.

Plots read the file, through `read.Result`, and nothing else.  matplotlib is imported when
something is drawn, and never pyplot: no window, no display, no state that outlives a call.

Colours are those of Okabe and Ito, which stay apart for colour-blind eyes.  A zone kind has
one colour on the whole page; points followed over time have others; grey is what was earlier;
sand and water are pale, behind everything.

What a file has beside the cable is drawn, and nothing else: `seabed` (unit normal n and n . x on it), `surface` (z
of the still water), `attached` (arc lengths of floats, clumps and bodies), `touchdown` and `contact`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import EVENTS_BY_WEIGHT, ResultError, weight_of_event
from hybrid.results.read import Result, Zone

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Numbers = Sequence[float] | np.ndarray
_INK, _GREY, _RANGE, _ALARM = "#222222", "#6E6E6E", "#E8E8E8", "#C00000"
_KIND_COLOURS = {"rod": "#D55E00", "catenary": "#0072B2"}  # kinds that are not named here are drawn in ink
_POINT_COLOURS = ("#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
_SAND, _BED, _WATER, _LEVEL, _BODY = "#EEE5D0", "#8C6D31", "#EFF6FA", "#4A90C2", "#F0E442"
_SMALL, _NORMAL = 7.0, 8.0  # type sizes in points, for a page 8 inches wide
_SHAPES = 9  # earlier shapes on a page; more become a blur
_ZERO = 1e-12  # SI; below this a force or moment of any real cable is round-off
_ENTRIES = 8  # of a legend, in a row
_STILL = 1e-6  # of the cable's extent: motion and deflection below this are round-off
_NEAR = 0.4  # of the height of a shape: a seabed or a surface so close to it is shown with it
_NAMES = {"theta": "angle to z", "phi": "azimuth", "bending_moment": "|bending moment|", "shear": "|shear|"}
_NAMES |= {"contact": "contact force"}
_NEWS = ("not judged", "turned in")  # events that warn of nothing
_AXES = ("x", "y", "z")
_NAMES |= {x: f"position {x}" for x in _AXES}


class _View(NamedTuple):
    """A plane to look at: two unit vectors (inertial) and what to write on the axes."""

    across: np.ndarray
    up: np.ndarray
    across_label: str
    up_label: str

    def project(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return position @ self.across, position @ self.up

    @property
    def upright(self) -> bool:
        return bool(self.up[2] == 1.0)


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
    result: Result, path: str | Path | None = None, *, times: _Numbers | None = None, history: _Numbers | None = None
) -> Figure:
    """One page: shape, tension and moment along the cable, and histories at some points.

    path: where to save it (png, pdf, svg ...).  times: which earlier shapes (s).  history:
    which arc lengths to follow (m); else those recorded as `history`, else the middle and
    the ends that move.  A static result shows curvature and tangent in place of histories; a
    cable that touches a seabed also shows the force of contact and, over time, where it does.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(8.0, 6.0), dpi=150)
    FigureCanvasAgg(figure)
    earlier = _telling_times(result) if times is None else np.sort(np.asarray(times, dtype=float))
    foot = _head_and_foot(figure, result, earlier)
    body = (0.0, foot + 0.055, 1.0, 0.865 - foot)  # left, bottom, width, height; the legend is below, the head above
    figure.set_layout_engine(ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05, wspace=0.02, hspace=0.02, rect=body))
    if len(result.times) == 0:
        figure.text(0.5, 0.5, "no output was saved", ha="center", fontsize=_NORMAL, color=_GREY)
    else:
        views, lies = _views(result), _lies(result)
        pages = (_ONE_VIEW_BED, _TWO_VIEWS_BED) if lies else (_ONE_VIEW, _TWO_VIEWS)
        drawn = _ratio(views, result)
        panels, widths, heights, _ = min(pages[len(views) - 1], key=lambda page: abs(math.log(page[3] / drawn)))
        axes = figure.subplot_mosaic(panels, width_ratios=widths, height_ratios=heights)
        points = _history_points(result, history) if len(result.times) > 1 else np.zeros(0)
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
    if path is not None:
        try:
            figure.savefig(path, dpi=150)
        except (OSError, ValueError) as error:
            raise ResultError(f"the figure cannot be saved as {path}\n    detail:   {error}") from error
    return figure


def plot_shape(
    ax: Axes, result: Result, *, times: _Numbers | None = None, view: Any = None, points: _Numbers = ()
) -> None:
    """The last shape, coloured by zones, over earlier ones and the area swept, in grey; the same scale both ways.

    times: earlier times to show (s), else those whose shapes differ most.  view: None for the
    plane of the largest extent, or two letters such as "xz".  points: arc lengths to mark (m).
    A cable that is nearly straight is drawn with its deflection magnified, and says so.
    Seabed, water, what is attached and where the cable touches down: as the file has them.
    """
    from matplotlib.collections import PolyCollection

    view = _letters(view) if isinstance(view, str) else view or _views(result)[0]
    position, last, s = result.position, result.position[-1], result.s
    _draw_sea(ax, view, result)
    earlier = _telling_times(result) if times is None else np.asarray(times, dtype=float)
    outputs = np.array(view.project(position[:: -1 - len(position) // 4000])).transpose(1, 2, 0)  # enough to cover all
    strips = np.concatenate([outputs[:-1], outputs[1:, ::-1]], axis=1)  # there along one shape, back along the next
    # Edges close the seams between strips; as pixels in a PDF, where each strip would weigh as much as a curve.
    name = "range over time" * bool(np.ptp(position, axis=0).max() > _STILL * np.ptp(position, axis=(0, 1)).max())
    ax.add_collection(PolyCollection(list(strips), color=_RANGE, lw=0.4, zorder=0.4, rasterized=True, label=name))
    for k, shape in enumerate(result.at(t=earlier, names=["position"])["position"]):
        name = "_" * (k > 0) + "earlier shapes (later: darker)"
        ax.plot(*view.project(shape), color=_earlier_grey(k, len(earlier)), linewidth=0.7, zorder=1, label=name)
    zones = _whole(result.zones[-1]) or [Zone("cable", float(s[0]), float(s[-1]))]
    for zone in zones:
        inside = s[(s > zone.s_a) & (s < zone.s_b)]
        piece = _along(np.array([zone.s_a, *inside, zone.s_b]), s, last)
        ax.plot(*view.project(piece), color=_KIND_COLOURS.get(zone.kind, _INK), lw=2.0, zorder=3, label=zone.kind)
    joints = np.array([z.s_b for z in zones[:-1]])
    if len(joints):
        ax.plot(*view.project(_along(joints, s, last)), zorder=5, **_mark("o", "white"), label="joint")
    for k, marker in ((0, "s"), (-1, "^")):
        ax.plot(*view.project(last[[k]]), zorder=4, **_mark(marker), label="end" if k else "start")
    if "attached" in result:
        bodies = view.project(_along(result["attached"], s, last))
        ax.plot(*bodies, zorder=3.5, **_mark("o", _BODY) | {"markersize": 8}, label="float, clump, body")
    if "touchdown_position" in result:
        away = np.abs(result["touchdown"][-1] - s[[0, -1]]) > 0.005 * (s[-1] - s[0])  # the ends have their own marks
        places = view.project(result["touchdown_position"][-1][away])  # NaN, of a cable that hangs, is not away
        ax.plot(*places, zorder=5, **_mark("v", _BED), label="touchdown" if away.any() else "_")
    for k, point in enumerate(points):
        ax.plot(*view.project(_along(np.array([point]), s, last)), zorder=6, **_point(k), label="_")
    wider, taller = _magnified(view, result)
    factors = zip((view.across_label.split(",")[0], view.up_label), (wider, taller), strict=True)
    stretch = "".join(f", {name} × {factor:g}" for name, factor in factors if factor > 1.0)
    above = "" if "z" in (view.across_label, view.up_label) else " from above"
    _style(ax, f"shape{above}{_at(result, -1)}{stretch}", f"{view.across_label} (m)", f"{view.up_label} (m)")
    ax.update_datalim(_extent(view, result).T)
    ax.margins(0.06)
    ax.set_aspect(taller / wider, adjustable="datalim")


def plot_profiles(
    ax: Axes, result: Result, names: str | Sequence[str], *, output: int = -1, times: _Numbers = ()
) -> None:
    """One or two quantities of the same unit along s at one output, and their range over all times.

    The zones of that output are shaded.  Further names after the first are dashed, and left
    out where nothing would be seen of them.  times: when else to show the first, in grey.
    """
    names = [names] if isinstance(names, str) else list(names)
    for zone in result.zones[output]:
        ax.axvspan(zone.s_a, zone.s_b, color=_KIND_COLOURS.get(zone.kind, _INK), alpha=0.10, linewidth=0, zorder=0)
    ax.set_xlim(result.s[0], result.s[-1])
    drawn = [(name, _scalar(result, name)) for k, name in enumerate(names) if k == 0 or name in result]
    peak = float(np.abs(drawn[0][1]).max())
    drawn = drawn[:1] + [(n, v) for n, v in drawn[1:] if np.abs(v).max() > max(_ZERO, 5e-3 * peak)]  # what can be seen
    peak = max(float(np.abs(v).max()) for _, v in drawn)
    factor, unit = _prefix("m" if names[0] in _AXES else result.units[names[0]], peak)
    for k, (name, values) in enumerate(drawn):
        if len(values) > 1:
            low, high = values.min(axis=0) * factor, values.max(axis=0) * factor
            ax.fill_between(result.s, low, high, color=_GREY, alpha=0.28 - 0.12 * k, linewidth=0, zorder=2)
            usual = max(np.percentile(high, 90), values[output].max() * factor)
            if len(drawn) == 1 and 0.0 < 10.0 * usual < high.max():  # a spike would press all else to the ground
                ax.set_ylim(low.min() - 0.1 * usual, 1.5 * usual)
                spike = f"peak {high.max():.3g} {unit} at s = {result.s[high.argmax()]:.4g} m"
                ax.text(0.03, 0.91, spike, transform=ax.transAxes, fontsize=_SMALL, color=_INK)
        for n, t in enumerate(times if k == 0 else ()):
            then = values[int(np.abs(result.times - t).argmin())]
            ax.plot(result.s, then * factor, color=_earlier_grey(n, len(times)), linewidth=0.7, zorder=2.5, label="_")
        line: dict[str, Any] = {"color": _INK, "linewidth": 1.3, "linestyle": (0, (4, 1.5)) if k else "-"}
        ax.plot(result.s, values[output] * factor, zorder=3, label=_title(name), **line)
    short = _title(names[0]).replace("bending ", "").replace("contact force", "contact")
    up = ",\n".join([short, *(_title(n) for n, _ in drawn[1:])])  # on the axis; a title has to leave room for others
    _style(ax, (short if drawn[1:] else _title(names[0])) + _at(result, output), "s (m)", f"{up} ({unit})")
    if len(drawn) > 1:
        ax.legend(fontsize=_SMALL, frameon=False, handlelength=2.2)
    _open_up(ax, peak * factor)


def plot_history(
    ax: Axes, result: Result, name: str, s: _Numbers, *, component: int | None = None, legend: bool = True
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
    round_off = _STILL * float(np.ptp(result.position, axis=(0, 1)).max()) if label.startswith("Δ") else 0.0
    factor, unit = _prefix(result.units[name], max(peak, round_off))
    for k, point in enumerate(s):
        ax.plot(result.times, values[:, k] * factor, **_point(k), markevery=[-1], label=f"s = {point:.4g} m")
    changes = np.unique(result["zones/t"])[1:]
    for k, t in enumerate(changes if len(changes) <= 40 else ()):  # more would hide the curves
        ax.axvline(t, color=_GREY, lw=0.9, ls=":", zorder=1, label="_" * (k > 0) + "zones changed")  # one entry
    title = f"{label} over time" if component is None else f"{label} since t = {result.times[0]:.4g} s"
    _style(ax, title, "t (s)", f"{label} ({unit})")
    ax.set_xlim(result.times[0], result.times[-1] + 0.025 * np.ptp(result.times))  # room for the dots of the last shape
    _open_up(ax, peak * factor)
    if peak < round_off:
        ax.set_ylim(-round_off * factor, round_off * factor)
    if legend:
        ax.legend(fontsize=_SMALL, framealpha=0.75, edgecolor="none", handlelength=1.2, borderpad=0.2)


def plot_touchdown(ax: Axes, result: Result) -> None:
    """Between which arc lengths the cable lies on the seabed, over time: sand; nothing while it hangs free."""
    edges, s = result["touchdown"], result.s
    known = np.isfinite(edges).all(axis=1)
    held = np.abs(edges[known] - s[[0, -1]]).max(axis=0, initial=0.0) < 0.005 * (s[-1] - s[0])  # lies to its very end
    for k in (0, 1) if held.all() else np.flatnonzero(~held):
        ax.plot(result.times, edges[:, k], color=_BED, linewidth=1.3, zorder=3, label=("first", "last")[k] + " contact")
    _style(ax, "touchdown over time", "t (s)", "s (m)")
    ax.set_xlim(result.times[0], result.times[-1] + 0.025 * np.ptp(result.times))  # as the histories beside it
    _open_up(ax, float(s[-1]))
    low, high = ax.get_ylim()
    ax.fill_between(result.times, *edges.T, color=_SAND, linewidth=0, zorder=0.2)
    ax.set_ylim(low, high)


# ---- what to look at ------------------------------------------------------------------------------


def _views(result: Result) -> list[_View]:
    """One plane if the cable stays in one, else two projections: of a line across x and y, along it and across."""
    x, y, z = extents = np.ptp(result.position, axis=(0, 1))
    normal = min((1, 0, 2), key=lambda k: extents[k])
    if _is_flat(result.position, np.eye(3)[normal]):
        return [_letters("xyz".replace("xyz"[normal], ""))]
    level = result.position[..., :2].reshape(-1, 2)
    ahead = np.linalg.eigh(np.cov(level.T))[1][:, 1]  # the direction of the largest horizontal extent
    ahead *= math.copysign(1.0, ahead[np.argmax(np.abs(ahead))])
    sideways, angle = np.array([-ahead[1], ahead[0], 0.0]), math.degrees(math.atan2(ahead[1], ahead[0]))
    along = _View(np.array([*ahead, 0.0]), np.eye(3)[2], f"horizontal, {angle:.3g}° from x", "z")
    if _is_flat(result.position, sideways):
        return [along]
    if z >= max(x, y) and not _lies(result):
        return [_letters("xz"), _letters("yz")]
    if np.ptp(level @ sideways[:2]) < 0.08 * min(x, y):  # in x-y it would be a mere line
        return [along, along._replace(up=sideways, up_label="across")]
    return [_letters("xz"), _letters("xy")] if x >= y else [_letters("yz"), _letters("yx")]


def _is_flat(position: np.ndarray, normal: np.ndarray) -> bool:
    """Whether what leaves the plane is below 2 % of the extent, and little beside the sag and the motion in it."""
    out = position @ normal
    inside = (position - out[..., None] * normal).reshape(-1, 3)
    across = np.ptp(inside @ np.linalg.eigh(np.cov(inside.T))[1][:, 1])  # of three axes: normal, across, along
    largest, moves = np.ptp(inside, axis=0).max(), np.ptp(position, axis=0).max()
    flat, still = (max(x, _STILL * largest) for x in (min(0.02 * largest, 0.1 * across), 0.2 * moves))
    return bool(np.ptp(out) <= flat and np.ptp(out, axis=0).max() <= still)


def _letters(plane: str) -> _View:
    if len(plane) != 2 or not set(plane) <= set("xyz") or plane[0] == plane[1]:
        raise ResultError(f"view '{plane}' is not a plane\n    expected: two of the letters x, y, z, such as 'xz'")
    return _View(*(np.eye(3)["xyz".index(c)] for c in plane), *plane)


def _whole(zones: list[Zone]) -> list[Zone]:
    """Zones with neighbours of one kind made one, since nothing happens between them."""
    whole: list[Zone] = []
    for zone in zones:
        if whole and whole[-1].kind == zone.kind:
            zone = zone._replace(s_a=whole.pop().s_a)
        whole.append(zone)
    return whole


def _lies(result: Result) -> bool:
    """Whether the cable ever touches a seabed."""
    return "contact" in result and "touchdown" in result and bool(np.isfinite(result["touchdown"]).any())


def _bed_in(view: _View, result: Result) -> tuple[float, float] | None:
    """The seabed in an upright view, where the cable lies: height at the origin, and rise per metre across."""
    if "seabed" not in result or not view.upright:
        return None
    *normal, offset = result["seabed"]
    out, last = np.cross(view.across, view.up), result.position[-1]
    lying = result["contact"][-1] > 0.0 if "contact" in result else np.zeros(len(last), bool)
    depth = float((last[lying] if lying.any() else last).mean(axis=0) @ out)  # of the bed, behind the paper
    return (offset - depth * (normal @ out)) / normal[2], -(normal @ view.across) / normal[2]


def _extent(view: _View, result: Result) -> np.ndarray:
    """What is to be seen, low and high, across and up (2, 2): the cable, and a seabed or a surface near to it."""
    across, up = view.project(result.position)
    box = np.array([[across.min(), across.max()], [up.min(), up.max()]])
    room = _NEAR * max(np.ptp(box[1]), 0.3 * np.ptp(box[0]))
    bed = _bed_in(view, result)
    if bed is not None and np.min(up - bed[0] - bed[1] * across) < room:
        box[1, 0] = min(box[1, 0], max(bed[0] + min(bed[1] * box[0]), box[1, 0] - room)) - 0.1 * room  # a strip of sand
    if "surface" in result and view.upright and box[1, 0] < float(result["surface"]) < box[1, 1] + room:
        box[1, 1] = max(box[1, 1], float(result["surface"]) + 0.1 * room)  # and of air
    return box


def _magnified(view: _View, result: Result) -> tuple[float, float]:
    """Factors across and up: 1, but a round number that opens the smaller one where it would be a mere line."""
    across, up = np.ptp(_extent(view, result), axis=1).tolist()
    ratio = min(across, up) / max(across, up, 1e-300)
    if not _STILL < ratio < 0.08:  # straighter than that is straight; less straight needs no help
        return 1.0, 1.0
    most = 0.32 / ratio  # about the shape of the flattest panel
    power = 10.0 ** math.floor(math.log10(most))
    factor = power * max(m for m in (1, 1.5, 2, 3, 4, 5, 7) if m * power <= most)
    return (1.0, factor) if up < across else (factor, 1.0)


def _ratio(views: list[_View], result: Result) -> float:
    """Width over height as drawn; the geometric mean of the views; of a straight line, something large or small."""
    sizes = np.array([np.ptp(_extent(v, result), axis=1) * _magnified(v, result) for v in views])
    sizes += 1e-9 * sizes.max() + 1e-300
    return float(np.exp(np.mean(np.log(sizes[:, 0] / sizes[:, 1]))))


def _telling_times(result: Result) -> np.ndarray:
    """Times of the earlier shapes that show the motion: the first, then always the one farthest from all taken.

    Even steps of time show nothing of a quick relaxation, and even steps of time or of
    distance travelled fall on the same phases of a periodic motion; this finds its extremes.
    """
    if len(result.times) < 2:
        return np.zeros(0)
    position = result.position[:, :: 1 + len(result.s) // 50]  # 50 points tell shapes apart
    least = _STILL * float(np.max(np.ptp(position.reshape(-1, 3), axis=0)))
    away = np.linalg.norm(position - position[-1], axis=2).max(axis=1)
    taken: list[int] = []
    while len(taken) < _SHAPES and away.max() > least:
        taken.append(int(away.argmax()) if taken else 0)
        away = np.minimum(away, np.linalg.norm(position - position[taken[-1]], axis=2).max(axis=1))
    return np.sort(result.times[taken])


def _history_points(result: Result, history: _Numbers | None) -> np.ndarray:
    """By default the middle and the ends, or where an end is held the quarter point beside it; on a seabed the ends."""
    moves = np.ptp(result.position, axis=0).max(axis=1)
    start, end = (bool(m <= 1e-3 * moves.max()) and not _lies(result) for m in moves[[0, -1]])  # held
    quarters = np.linspace(result.s[0], result.s[-1], 5)[[start, 2, 4 - end]]
    given = result["history"] if history is None and "history" in result else history
    points = np.asarray(quarters if given is None else given, dtype=float)
    if points.ndim != 1 or len(points) == 0:
        raise ResultError(f"history = {history!r} is no list of arc lengths\n    try:      history=[0.0]")
    return points


def _along(where: np.ndarray, s: np.ndarray, position: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(where, s, position[:, k]) for k in range(3)])


def _scalar(result: Result, name: str) -> np.ndarray:
    if name in _AXES:
        return np.asarray(result.position[..., _AXES.index(name)])
    values = result[name]
    return np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values


# ---- how it looks ---------------------------------------------------------------------------------


def _title(name: str) -> str:
    return _NAMES.get(name, name.replace("/", " ").replace("_", " "))


def _at(result: Result, output: int) -> str:
    return f" at t = {result.times[output]:.5g} s" if len(result.times) > 1 else ""


def _earlier_grey(k: int, count: int) -> str:
    return str(0.7 - 0.3 * k / max(count - 1, 1))


def _legends(figure: Figure, shape: Axes, history: Axes | None, foot: float) -> None:
    """Two rows below the panels: what the shape shows, and under it what is left of that, and the histories."""
    shown = [dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True)) for ax in (shape, history) if ax]
    first, rest = list(shown[0].items()), [entry for more in shown[1:] for entry in more.items()]
    for row, y in ((first[:_ENTRIES], foot + 0.0275), ([*first[_ENTRIES:], *rest][:_ENTRIES], foot + 0.0025)):
        look: dict[str, Any] = {"fontsize": _SMALL, "handlelength": 1.6, "columnspacing": 1.5, "borderaxespad": 0.0}
        look |= {"loc": "lower center", "bbox_to_anchor": (0.5, y), "ncols": 8, "frameon": False, "borderpad": 0.1}
        if row:
            figure.legend([mark for _, mark in row], [name for name, _ in row], labelcolor=_INK, **look)


def _draw_sea(ax: Axes, view: _View, result: Result) -> None:
    """Water below its surface and sand below the bed, out to the rims of the panel, whatever these will be."""
    from matplotlib.patches import Polygon

    bed, box = _bed_in(view, result), _extent(view, result)
    middle, far = box.mean(axis=1), 30.0 * float(np.ptp(box, axis=1).max())  # more than any panel shows
    x, deep = middle[0] + far * np.array([-1.0, 1.0]), middle[1] - far
    top = int(np.argmax(view.project(result.position[-1])[1]))
    aside = int(view.project(result.position[-1])[0][top] < middle[0])  # where the cable is not: left or right
    wet = "surface" in result and view.upright
    planes = [(float(result["surface"]), 0.0, _WATER, _LEVEL, "still water", 2)] if wet else []
    planes += [(*bed, _SAND, _BED, "seabed", -3)] if bed else []
    for n, (height, rise, fill, line, name, lift) in enumerate(planes):
        z, at = height + rise * x, box[0, aside]
        corners = [(x[0], z[0]), (x[1], z[1]), (x[1], min(z[1], deep)), (x[0], min(z[0], deep))]
        ax.add_artist(Polygon(corners, facecolor=fill, edgecolor="none", zorder=0.1 + 0.1 * n))
        ax.add_artist(Polygon(corners[:2], closed=False, edgecolor=line, linewidth=0.9, zorder=0.6))
        ax.annotate(
            name, (at, height + rise * at), (0, lift), textcoords="offset points", color=line, fontsize=_SMALL,
            ha=("left", "right")[aside], va="bottom" if lift > 0 else "top",
        )  # fmt: skip


def _mark(symbol: str, face: str = _INK) -> dict[str, Any]:
    edge = {"markeredgecolor": _INK, "markeredgewidth": 0.8}
    return {"linestyle": "", "marker": symbol, "markersize": 4.5, "markerfacecolor": face, **edge}


def _point(k: int) -> dict[str, Any]:
    width = max(1.8 - 0.5 * k, 0.8)  # later curves are thinner, so that coinciding ones all show
    return {"color": _POINT_COLOURS[k % len(_POINT_COLOURS)], "linewidth": width, "marker": "o", "markersize": 3}


def _prefix(unit: str, peak: float) -> tuple[float, str]:
    """Factor and unit that bring the largest value between 1 and 1000 where engineers do so."""
    if unit == "rad":
        return 180.0 / math.pi, "°"
    if unit == "1/m" and _ZERO < peak < 0.01:
        return 1e3, "1/km"
    if unit == "m":
        return (1e3, "mm") if _ZERO < peak < 0.01 else (1e-3, "km") if peak >= 1e4 else (1.0, "m")
    if unit.replace("/", " ").split(" ")[0] in ("N", "J", "W", "Pa") and peak > _ZERO:
        power = min(max(math.floor(math.log10(peak) / 3.0 + 1e-12), -4), 4)
        return 10.0 ** (-3 * power), ("p", "n", "µ", "m", "", "k", "M", "G", "T")[power + 4] + unit
    return 1.0, unit or "–"


def _style(ax: Axes, title: str, across: str = "", up: str = "") -> None:
    from matplotlib.ticker import MaxNLocator

    ax.set_title(title, loc="left", fontsize=_NORMAL, color=_INK, fontweight="bold")
    ax.tick_params(labelsize=_SMALL, width=0.6, length=2.5, color=_GREY, labelcolor=_INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(linewidth=0.6, color=_GREY)
    ax.grid(color="#000000", alpha=0.07, linewidth=0.6)
    ax.set_axisbelow(True)
    for axis, label in ((ax.xaxis, across), (ax.yaxis, up)):
        axis.set_label_text(label, fontsize=_NORMAL)
        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], min_n_ticks=3))
        axis.get_offset_text().set_fontsize(_SMALL)
    ax.ticklabel_format(useOffset=False, scilimits=(-4, 5))


def _open_up(ax: Axes, peak: float) -> None:
    """Keep round-off from filling the panel: show at least 0.1 % of the largest value.  Mark where signs change."""
    low, high = ax.get_ylim()
    least = 1e-3 * peak if peak > _ZERO else 2.0
    if high - low < least:
        ax.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
    low, high = ax.get_ylim()
    if low < -0.1 * (high - low) < 0.1 * (high - low) < high:
        ax.axhline(0.0, color=_GREY, linewidth=0.6, zorder=1)


def _head_and_foot(figure: Figure, result: Result, earlier: np.ndarray) -> float:
    """Title and facts above the panels, warnings below; the height of the latter, as a part of the page."""
    n, complete = len(result.times), result.status == "complete"
    facts = [] if complete else [result.status_text]
    if n:
        span = f"{n} outputs, t = {result.times[0]:.5g} … {result.times[-1]:.5g} s"
        facts.append(span if n > 1 else "static" if complete else f"one output, t = {result.times[0]:.5g} s")
        zones = _whole(result.zones[-1])
        if 0 < len(zones) <= 4:  # more are to be seen, not to be read
            facts.append(", ".join(f"{z.kind} {z.s_a:.4g} … {z.s_b:.4g} m" for z in zones))
    if len(earlier):
        facts.append("earlier shapes at t = " + ", ".join(f"{t:.3g}" for t in earlier) + " s")
    _line(figure, 0.985, result.title or "(no title)", fontsize=10, fontweight="bold", color=_INK)
    _line(figure, 0.95, "; ".join(facts), fontsize=_NORMAL, color=_GREY if complete else _ALARM)
    events = [e for e in result.events if e.kind in EVENTS_BY_WEIGHT]
    events.sort(key=lambda e: (weight_of_event(e.kind), e.t))
    if not events:
        return 0.0
    kinds = [e.kind for e in events if e.kind not in _NEWS]
    names = ", ".join(k + f" (× {kinds.count(k)})" * (kinds.count(k) > 1) for k in dict.fromkeys(kinds))
    note = "; ".join(dict.fromkeys(e.text for e in (events[:1] if kinds else events)))
    note = (f"Warning: {names}; at t = {events[0].t:.4g} s: " if kinds else "Note: ") + note
    return 0.018 + 0.02 * _line(figure, 0.008, note, 2, "bottom", fontsize=_SMALL, color=_ALARM if kinds else _GREY)


def _line(figure: Figure, y: float, text: str, most: int = 1, va: str = "top", **look: Any) -> int:
    """At most so many lines from the left edge, cut to the width of the page; how many.  A $ in them is a $."""
    rest, rows = " ".join(text.split()), list[str]()
    line = figure.text(0.0125, y, "", va=va, parse_math=False, **look)
    while rest and len(rows) < most:
        end, cut = len(rest), " …" * (len(rows) == most - 1)
        line.set_text(rest)
        while (share := 0.975 * figure.bbox.width / max(1.0, line.get_window_extent().width)) < 1.0:
            end = min(int(share * end), end - 1)
            end = end if cut else max(rest.rfind(" ", 0, end + 1), 0) or end  # lines end between words
            line.set_text(rest[:end].rstrip() + cut)
        rows, rest = [*rows, line.get_text()], rest[end:].lstrip()
    line.set_text("\n".join(rows))
    return len(rows)
