"""Figures of a report over time and along the cable, as plotly's dictionaries: histories, ranges, energy.

Arrays are references into a `Store`.  Texts that come from a scene are escaped: plotly reads tags in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from hybrid.store.reader import Result
from hybrid.store.records import Zone
from hybrid.view.decimate import Kept, Store, outline
from hybrid.view.projections import STILL, free_edges, history_points, whole_zones
from hybrid.view.style import ALARM, BED, DOUBT, GREY, INK, KIND_COLOURS, POINT_COLOURS, ZERO, prefix, title_of

Spec = dict[str, Any]
_PULLS = {"start": "#0072B2", "end": "#D55E00"}
_PARTS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31", "#7F7F7F")
RANGES = ("tension", "curvature", "bending_moment", "torque", "shear", "contact")


def rgba(colour: str, alpha: float) -> str:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{alpha:g})"


def layout(across: str, up: str, **more: Any) -> Spec:
    """The look that all graphs share."""
    axis: Spec = {"zeroline": False, "gridcolor": "#EDEDED", "linecolor": "#BDBDBD", "ticks": "outside"}
    axis |= {"tickcolor": "#BDBDBD", "ticklen": 4, "automargin": True, "exponentformat": "SI"}
    base: Spec = {
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": INK},
        "margin": {"l": 56, "r": 22, "t": 8, "b": 44},
        "paper_bgcolor": "#FFFFFF", "plot_bgcolor": "#FFFFFF", "hovermode": "x",
        "xaxis": axis | {"title": {"text": across, "standoff": 6}},
        "yaxis": axis | {"title": {"text": up, "standoff": 6}},
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "font": {"size": 12}},
        "hoverlabel": {"bgcolor": "#FFFFFF", "bordercolor": "#9E9E9E", "align": "left"}
        | {"font": {"size": 12, "color": INK, "family": "system-ui, sans-serif"}},
    }  # fmt: skip
    return base | more


def curve(store: Store, x: np.ndarray, y: np.ndarray, name: str, colour: str, unit: str = "", **line: Any) -> Spec:
    """A line; where x or y is not finite it has a gap."""
    return {
        "type": "scatter", "mode": "lines", "x": store.add(x), "y": store.add(y), "name": name,
        "line": {"color": colour, "width": 1.6} | line, "hovertemplate": f"%{{y:.5g}} {unit}",
    }  # fmt: skip


def band(store: Store, x: np.ndarray, low: np.ndarray, high: np.ndarray, name: str, colour: str, **more: Any) -> Spec:
    """The area between two curves."""
    known = np.isfinite(low) & np.isfinite(high)
    x, low, high = x[known], low[known], high[known]
    around = {"x": store.add(np.append(x, x[::-1])), "y": store.add(np.append(low, high[::-1]))}
    look = {"type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": colour, "line": {"width": 0}}
    return look | around | {"name": name, "hoverinfo": "skip"} | more


def histories(result: Result, store: Store) -> list[Spec]:
    """Pulls at the ends, tension and displacement at the points to follow, touchdown: over time."""
    if len(result.times) < 2:
        return []
    points = history_points(result, None)
    figures = [_pulls(result, store), _at_points(result, store, "tension", points, None)]
    moves = np.ptp(result.at(s=points, names=["position"])["position"], axis=0).max(axis=0)
    figures.append(_at_points(result, store, "position", points, int(moves.argmax())))
    if free_edges(result):
        figures.append(_touchdown(result, store))
    return [figure for figure in figures if figure["data"]]


def _pulls(result: Result, store: Store) -> Spec:
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for end in _PULLS:
        if f"steps/end_force_{end}" in result and len(result["steps/t"]):
            found[end] = (result["steps/t"], result[f"steps/end_force_{end}"])
        elif f"reaction_{end}" in result:
            found[end] = (result.times, np.linalg.norm(result[f"reaction_{end}"], axis=1))
    factor, unit = prefix("N", max((float(y.max()) for _, y in found.values()), default=0.0))
    data: list[Spec] = []
    for end, (t, y) in found.items():
        error = f"errors/total/end_force_{end}"
        if error in result and f"reaction_{end}" in result:
            middle = np.linalg.norm(result[f"reaction_{end}"], axis=1)
            k = outline(middle)
            low, high = np.maximum(middle - result[error], 0.0)[k], (middle + result[error])[k]
            data.append(_doubt(store, result.times[k], low * factor, high * factor, not data))
        k = outline(y)
        data.append(curve(store, t[k], y[k] * factor, f"at the {end}", _PULLS[end], unit))
    said = "Force that holds or loads each end, at every step."
    return _over_time("pulls", "End forces", said, data, f"force ({unit})")


def _doubt(store: Store, x: np.ndarray, low: np.ndarray, high: np.ndarray, named: bool) -> Spec:
    look = {"showlegend": named, "legendgroup": "doubt"}
    return band(store, x, low, high, "estimated error", rgba(DOUBT, 0.3), **look)


def _over_time(key: str, title: str, said: str, data: list[Spec], up: str) -> Spec:
    return {"key": key, "title": title, "said": said, "data": data, "layout": layout("t (s)", up), "cursor": True}


def _at_points(result: Result, store: Store, name: str, points: np.ndarray, component: int | None) -> Spec:
    values = result.at(s=points, names=[name])[name]
    if component is not None:
        values = values[..., component] - values[0, ..., component]
    peak = float(np.abs(values).max())
    round_off = STILL * float(np.ptp(result.position, axis=(0, 1)).max())
    factor, unit = prefix(result.units[name], max(peak, round_off if component is not None else 0.0))
    estimated = f"errors/total/{name}"
    error = result[estimated] if estimated in result else None  # noqa: SIM401  a Result is no dict
    data: list[Spec] = []
    for n, s in enumerate(points):
        y = values[:, n]
        k = outline(y)
        if error is not None:
            width = np.array([np.interp(s, result.s, row) for row in error])[k]
            data.append(_doubt(store, result.times[k], (y[k] - width) * factor, (y[k] + width) * factor, not data))
        colour = POINT_COLOURS[n % len(POINT_COLOURS)]
        data.append(curve(store, result.times[k], y[k] * factor, f"s = {s:.4g} m", colour, unit))
    if component is None:
        return _over_time(name, "Tension at points", "At some points of the cable.", data, f"tension ({unit})")
    axis = "xyz"[component]
    said = f"Change of {axis} since the first output, at the same points."
    return _over_time("displacement", f"Displacement, {axis}", said, data, f"Δ{axis} ({unit})")


def _touchdown(result: Result, store: Store) -> Spec:
    data = []
    for edge in free_edges(result):
        s = result["touchdown"][:, edge]
        k = outline(np.where(np.isfinite(s), s, np.nanmean(s)))
        look = {"dash": "dot"} if edge == 0 else {}
        data.append(curve(store, result.times[k], s[k], ("first", "last")[edge] + " contact", BED, "m", **look))
    said = "Arc length where contact with the seabed begins or ends; a gap where nothing touches."
    return _over_time("touchdown", "Touchdown", said, data, "s (m)")


def ranges(result: Result, store: Store, shown: Kept) -> list[Spec]:
    """Lowest, mean and highest value along the cable, over all outputs; with one output its profile."""
    figures = []
    for name in RANGES:
        if name not in result or not len(result.times):
            continue
        values = result[name]
        if np.abs(values).max() <= ZERO and name not in ("tension", "curvature"):
            continue  # there is none
        figures.append(_range(result, store, shown, name, values))
    return figures


def _range(result: Result, store: Store, shown: Kept, name: str, values: np.ndarray) -> Spec:
    s, several = result.s, len(result.times) > 1
    factor, unit = prefix(result.units[name], float(np.abs(values).max()))
    low, high = values.min(axis=0) * factor, values.max(axis=0) * factor
    data: list[Spec] = []
    error = f"errors/total/{name}"
    if error in result and result.dims(error) == ("t", "s"):
        outer = [(values - result[error]).min(axis=0) * factor, (values + result[error]).max(axis=0) * factor]
        if name in ("curvature", "bending_moment", "shear"):  # sizes
            outer[0] = np.maximum(outer[0], 0.0)
        data.append(band(store, s, outer[0], outer[1], "± error", rgba(DOUBT, 0.25)))
    if several:
        data.append(band(store, s, low, high, "range", rgba(GREY, 0.22), showlegend=False))
        data.append(curve(store, s, high, "highest", "#B84F04", unit))
        data.append(curve(store, s, values.mean(axis=0) * factor, "mean", GREY, unit, dash="dash"))
        data.append(curve(store, s, low, "lowest", "#2C72B6", unit))
    first = shown.frames[0]
    now = curve(store, s[shown.points], values[first][shown.points] * factor, "now", INK, unit, width=2)
    data.append(now if several else now | {"name": title_of(name)})
    if name == "curvature" and "min_bend_radius" in result:
        limit = factor / result["min_bend_radius"]
        data.append(curve(store, s, limit, "allowed", ALARM, unit, dash="dot", width=2))
    title = title_of(name).replace("|", "").capitalize()
    figure: Spec = {"key": f"range-{name}", "title": title, "said": "", "data": data}
    figure["layout"] = layout("s (m)", f"{title_of(name).replace('bending ', '').replace('contact ', '')} ({unit})")
    if not several:
        figure["layout"]["shapes"] = [_shade(zone) for zone in whole_zones(result.zones[0])]
    else:
        frames = values[np.ix_(shown.frames, shown.points)] * factor
        figure["now"] = {"trace": data.index(now), "frames": store.add(frames)}
    return figure


def _shade(zone: Zone) -> Spec:
    """A zone as a band behind a profile."""
    fill = {"fillcolor": KIND_COLOURS.get(zone.kind, INK), "opacity": 0.1, "line": {"width": 0}, "layer": "below"}
    return fill | {"type": "rect", "xref": "x", "yref": "paper", "x0": zone.s_a, "x1": zone.s_b, "y0": 0, "y1": 1}


def energy(result: Result, store: Store) -> list[Spec]:
    """Where the energy is, and where it came from, over time."""
    if len(result.times) < 2:
        return []
    figures = []
    for group, title, said in (
        ("energy", "Energy", "Change since the first output, of each kind and of all."),
        ("work", "Work", "Done on the cable since the start, by cause; below zero: taken out."),
    ):
        parts = energy_parts(result, group)
        if not parts:
            continue
        total = np.sum(list(parts.values()), axis=0)
        peak = max(float(np.abs(y).max()) for y in (*parts.values(), total))
        factor, unit = prefix("J", peak)
        seen = {name: y for name, y in parts.items() if np.abs(y).max() > 1e-4 * peak}
        data = []
        for n, (name, y) in enumerate(seen.items()):
            k = outline(y)
            data.append(curve(store, result.times[k], y[k] * factor, escape(name), _PARTS[n % len(_PARTS)], unit))
        k = outline(total)
        data.append(curve(store, result.times[k], total[k] * factor, "all", INK, unit, dash="dash", width=2))
        left = [name for name in parts if name not in seen]
        if left:
            said += f" Too small to be seen: {', '.join(left)}."
        figures.append(_over_time(group, title, said, data, f"{group} ({unit})"))
    return figures


def energy_parts(result: Result, group: str) -> dict[str, np.ndarray]:
    """Energies since the first output, or works, by name (nt,), J."""
    if group not in result:
        return {}
    return {
        name.replace("_", " "): result[f"{group}/{name}"] - (result[f"{group}/{name}"][0] if group == "energy" else 0.0)
        for name in result[group]
        if result.dims(f"{group}/{name}") == ("t",)
    }


def colour_scale(colours: Sequence[str]) -> list[list[Any]]:
    return [[k / (len(colours) - 1), colour] for k, colour in enumerate(colours)]
