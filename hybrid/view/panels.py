"""Panels of a result, on your own Axes: shape, profiles along the cable, histories, touchdown.

What a file has beside the cable is drawn, and nothing else: `seabed` (unit normal n and n . x on it), `surface` (z
of the still water), `attached` (arc lengths of floats, clumps and bodies), `touchdown` and `contact`.
Points followed over time have colours of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.reader import Result
from hybrid.store.records import Zone
from hybrid.view.projections import (
    STILL,
    Numbers,
    View,
    bed_in,
    extent_in,
    free_edges,
    magnification,
    telling_times,
    view_named,
    views_of,
    whole_zones,
)
from hybrid.view.style import (
    BED,
    BODY,
    DOUBT,
    GREY,
    INK,
    KIND_COLOURS,
    LEVEL,
    POINT_COLOURS,
    SAND,
    SMALL,
    WATER,
    ZERO,
    earlier_grey,
    mark,
    open_up,
    prefix,
    style,
    title_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RANGE = "#E8E8E8"
AXES = ("x", "y", "z")
MOST_CHANGES = 12  # of zones that are marked over time: more would hide the curves


def plot_shape(
    ax: Axes, result: Result, *, times: Numbers | None = None, view: Any = None, points: Numbers = ()
) -> None:
    """The last shape, coloured by zones, over earlier ones and the area swept, in grey; the same scale both ways.

    times: earlier times to show (s), else those whose shapes differ most.  view: None for the
    plane of the largest extent, or two letters such as "xz".  points: arc lengths to mark (m).
    A cable that is nearly straight is drawn with its deflection magnified, and says so.
    Seabed, water, what is attached and where the cable touches down: as the file has them.
    """
    from matplotlib.collections import PolyCollection

    view = view_named(view) if isinstance(view, str) else view or views_of(result)[0]
    position, last, s = result.position, result.position[-1], result.s
    draw_sea(ax, view, result)
    earlier = telling_times(result) if times is None else np.asarray(times, dtype=float)
    outputs = np.array(view.project(position[:: -1 - len(position) // 4000])).transpose(1, 2, 0)  # enough to cover all
    strips = np.concatenate([outputs[:-1], outputs[1:, ::-1]], axis=1)  # there along one shape, back along the next
    # Edges close the seams between strips; as pixels in a PDF, where each strip would weigh as much as a curve.
    name = "range over time" * bool(np.ptp(position, axis=0).max() > STILL * np.ptp(position, axis=(0, 1)).max())
    ax.add_collection(PolyCollection(list(strips), color=_RANGE, lw=0.4, zorder=0.4, rasterized=True, label=name))
    for k, shape in enumerate(result.at(t=earlier, names=["position"])["position"]):
        name = "_" * (k > 0) + "earlier shapes (later: darker)"
        ax.plot(*view.project(shape), color=earlier_grey(k, len(earlier)), linewidth=0.7, zorder=1, label=name)
    zones = whole_zones(result.zones[-1]) or [Zone("cable", float(s[0]), float(s[-1]))]
    for zone in zones:
        inside = s[(s > zone.s_a) & (s < zone.s_b)]
        piece = place_along(np.array([zone.s_a, *inside, zone.s_b]), s, last)
        ax.plot(*view.project(piece), color=KIND_COLOURS.get(zone.kind, INK), lw=2.0, zorder=3, label=zone.kind)
    joints = np.array([z.s_b for z in zones[:-1]])
    if len(joints):
        ax.plot(*view.project(place_along(joints, s, last)), zorder=5, **mark("o", "white"), label="joint")
    for k, marker in ((0, "s"), (-1, "^")):
        ax.plot(*view.project(last[[k]]), zorder=4, **mark(marker), label="end" if k else "start")
    if "attached" in result:
        bodies = view.project(place_along(result["attached"], s, last))
        ax.plot(*bodies, zorder=3.5, **mark("o", BODY) | {"markersize": 8}, label="float, clump, body")
    if "touchdown_position" in result:
        away = np.abs(result["touchdown"][-1] - s[[0, -1]]) > 0.005 * (s[-1] - s[0])  # the ends have their own marks
        places = view.project(result["touchdown_position"][-1][away])  # NaN, of a cable that hangs, is not away
        ax.plot(*places, zorder=5, **mark("v", BED), label="touchdown" if away.any() else "_")
    for k, point in enumerate(points):
        ax.plot(*view.project(place_along(np.array([point]), s, last)), zorder=6, **_point(k), label="_")
    wider, taller = magnification(view, result)
    factors = zip((view.across_label.split(",")[0], view.up_label), (wider, taller), strict=True)
    stretch = "".join(f", {name} × {factor:g}" for name, factor in factors if factor > 1.0)
    above = "" if "z" in (view.across_label, view.up_label) else " from above"
    style(ax, f"shape{above}{_at(result, -1)}{stretch}", f"{view.across_label} (m)", f"{view.up_label} (m)")
    ax.update_datalim(extent_in(view, result).T)
    ax.margins(0.06)
    ax.set_aspect(taller / wider, adjustable="datalim")


def plot_profiles(
    ax: Axes, result: Result, names: str | Sequence[str], *, output: int = -1, times: Numbers = ()
) -> None:
    """One or two quantities of the same unit along s at one output, and their range over all times.

    The zones of that output are shaded, and the estimated error is a band, if the file has one.  Further names after
    the first are dashed, and left
    out where nothing would be seen of them.  times: when else to show the first, in grey.
    """
    names = [names] if isinstance(names, str) else list(names)
    for zone in result.zones[output]:
        ax.axvspan(zone.s_a, zone.s_b, color=KIND_COLOURS.get(zone.kind, INK), alpha=0.10, linewidth=0, zorder=0)
    ax.set_xlim(result.s[0], result.s[-1])
    drawn = [(name, _scalar(result, name)) for k, name in enumerate(names) if k == 0 or name in result]
    peak = float(np.abs(drawn[0][1]).max())
    drawn = drawn[:1] + [(n, v) for n, v in drawn[1:] if np.abs(v).max() > max(ZERO, 5e-3 * peak)]  # what can be seen
    peak = max(float(np.abs(v).max()) for _, v in drawn)
    factor, unit = prefix("m" if names[0] in AXES else result.units[names[0]], peak)
    for k, (name, values) in enumerate(drawn):
        if len(values) > 1:
            low, high = values.min(axis=0) * factor, values.max(axis=0) * factor
            ax.fill_between(result.s, low, high, color=GREY, alpha=0.28 - 0.12 * k, linewidth=0, zorder=2)
            usual = max(np.percentile(high, 90), values[output].max() * factor)
            if len(drawn) == 1 and 0.0 < 10.0 * usual < high.max():  # a spike would press all else to the ground
                ax.set_ylim(low.min() - 0.1 * usual, 1.5 * usual)
                spike = f"peak {high.max():.3g} {unit} at s = {result.s[high.argmax()]:.4g} m"
                ax.text(0.03, 0.91, spike, transform=ax.transAxes, fontsize=SMALL, color=INK)
        for n, t in enumerate(times if k == 0 else ()):
            then = values[int(np.abs(result.times - t).argmin())]
            ax.plot(result.s, then * factor, color=earlier_grey(n, len(times)), linewidth=0.7, zorder=2.5, label="_")
        line: dict[str, Any] = {"color": INK, "linewidth": 1.3, "linestyle": (0, (4, 1.5)) if k else "-"}
        ax.plot(result.s, values[output] * factor, zorder=3, label=title_of(name), **line)
        error = error_of(result, name)
        if error is not None:
            _band(ax, result.s, values[output] * factor, error[output] * factor, name)
    short = title_of(names[0]).replace("bending ", "").replace("contact force", "contact")
    up = ",\n".join([short, *(title_of(n) for n, _ in drawn[1:])])  # on the axis; a title has to leave room for others
    style(ax, (short if drawn[1:] else title_of(names[0])) + _at(result, output), "s (m)", f"{up} ({unit})")
    if len(drawn) > 1:
        ax.legend(fontsize=SMALL, frameon=False, handlelength=2.2)
    open_up(ax, peak * factor)


def plot_history(
    ax: Axes, result: Result, name: str, s: Numbers, *, component: int | None = None, legend: bool = True
) -> None:
    """A quantity over time at the arc lengths s (m).

    component: 0, 1, 2 for x, y, z of a vector, drawn as the change since the first output;
    None for a scalar or the magnitude of a vector.  Dotted lines: the zones changed; bands: the estimated error.
    """
    if "s" not in result.dims(name):
        raise ResultError(f"'{name}' does not depend on s; plot it as result[{name!r}] over result.times")
    values = result.at(s=np.asarray(s, dtype=float), names=[name])[name]
    if component is not None:
        values = values[..., component] - values[0, ..., component]
        label = f"Δ{'xyz'[component]}" if name == "position" else f"Δ{title_of(name)} {'xyz'[component]}"
    else:
        values = np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values
        label = title_of(name)
    peak = float(np.abs(values).max())
    round_off = STILL * float(np.ptp(result.position, axis=(0, 1)).max()) if label.startswith("Δ") else 0.0
    factor, unit = prefix(result.units[name], max(peak, round_off))
    for k, point in enumerate(s):
        ax.plot(result.times, values[:, k] * factor, **_point(k), markevery=[-1], label=f"s = {point:.4g} m")
    error = error_of(result, name)
    for k, point in enumerate(s):
        if error is None:
            break
        at = np.array([np.interp(point, result.s, row) for row in error])
        _band(ax, result.times, values[:, k] * factor, at * factor, name if component is None else "")
    changes = np.unique(result["zones/t"])[1:]
    for k, t in enumerate(changes if len(changes) <= MOST_CHANGES else ()):
        ax.axvline(t, color=GREY, lw=0.9, ls=":", zorder=1, label="_" * (k > 0) + "zones changed")  # one entry
    title = f"{label} over time" if component is None else f"{label} since t = {result.times[0]:.4g} s"
    style(ax, title, "t (s)", f"{label} ({unit})")
    ax.set_xlim(result.times[0], result.times[-1] + 0.025 * np.ptp(result.times))  # room for the dots of the last shape
    open_up(ax, peak * factor)
    if peak < round_off:
        ax.set_ylim(-round_off * factor, round_off * factor)
    if legend:
        ax.legend(fontsize=SMALL, framealpha=0.75, edgecolor="none", handlelength=1.2, borderpad=0.2)


def plot_touchdown(ax: Axes, result: Result) -> None:
    """Between which arc lengths the cable lies on the seabed, over time: sand; nothing while it hangs free."""
    edges, s = result["touchdown"], result.s
    for k in free_edges(result):
        ax.plot(result.times, edges[:, k], color=BED, linewidth=1.3, zorder=3, label=("first", "last")[k] + " contact")
    style(ax, "touchdown over time", "t (s)", "s (m)")
    ax.set_xlim(result.times[0], result.times[-1] + 0.025 * np.ptp(result.times))  # as the histories beside it
    open_up(ax, float(s[-1]))
    low, high = ax.get_ylim()
    ax.fill_between(result.times, *edges.T, color=SAND, linewidth=0, zorder=0.2)
    ax.set_ylim(low, high)


def error_of(result: Result, name: str) -> np.ndarray | None:
    """Estimated error (nt, ns) of a quantity, by all causes; None where the file has none.  Of x, y, z: of position."""
    found = f"errors/total/{'position' if name in AXES else name}"
    return np.asarray(result[found]) if found in result and result.dims(found) == ("t", "s") else None


def _band(ax: Axes, x: np.ndarray, values: np.ndarray, error: np.ndarray, name: str) -> None:
    """The range in which the truth is estimated to lie; of sizes, not below zero."""
    low, high = values - error, values + error
    if name in ("curvature", "bending_moment"):
        low = np.maximum(low, 0.0)
    ax.fill_between(x, low, high, color=DOUBT, alpha=0.35, linewidth=0, zorder=2.8, label="estimated error")


def place_along(where: np.ndarray, s: np.ndarray, position: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(where, s, position[:, k]) for k in range(3)])


def _scalar(result: Result, name: str) -> np.ndarray:
    if name in AXES:
        return np.asarray(result.position[..., AXES.index(name)])
    values = result[name]
    return np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values


def _at(result: Result, output: int) -> str:
    return f" at t = {result.times[output]:.5g} s" if len(result.times) > 1 else ""


def draw_sea(ax: Axes, view: View, result: Result) -> None:
    """Water below its surface and sand below the bed, out to the rims of the panel, whatever these will be."""
    from matplotlib.patches import Polygon

    bed, box = bed_in(view, result), extent_in(view, result)
    middle, far = box.mean(axis=1), 30.0 * float(np.ptp(box, axis=1).max())  # more than any panel shows
    x, deep = middle[0] + far * np.array([-1.0, 1.0]), middle[1] - far
    top = int(np.argmax(view.project(result.position[-1])[1]))
    aside = int(view.project(result.position[-1])[0][top] < middle[0])  # where the cable is not: left or right
    wet = "surface" in result and view.upright
    planes = [(float(result["surface"]), 0.0, WATER, LEVEL, "still water", 2)] if wet else []
    planes += [(*bed, SAND, BED, "seabed", -3)] if bed else []
    for n, (height, rise, fill, line, name, lift) in enumerate(planes):
        z, at = height + rise * x, box[0, aside]
        corners = [(x[0], z[0]), (x[1], z[1]), (x[1], min(z[1], deep)), (x[0], min(z[0], deep))]
        ax.add_artist(Polygon(corners, facecolor=fill, edgecolor="none", zorder=0.1 + 0.1 * n))
        ax.add_artist(Polygon(corners[:2], closed=False, edgecolor=line, linewidth=0.9, zorder=0.6))
        ax.annotate(
            name, (at, height + rise * at), (0, lift), textcoords="offset points", color=line, fontsize=SMALL,
            ha=("left", "right")[aside], va="bottom" if lift > 0 else "top",
        )  # fmt: skip


def _point(k: int) -> dict[str, Any]:
    width = max(1.8 - 0.5 * k, 0.8)  # later curves are thinner, so that coinciding ones all show
    return {"color": POINT_COLOURS[k % len(POINT_COLOURS)], "linewidth": width, "marker": "o", "markersize": 3}
