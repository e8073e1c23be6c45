"""Panels of a result, as data: shape, curves along the cable and over time, energy.

What a file has beside the cable is drawn, and nothing else: `seabed` (unit normal n and n . x on it), `surface` (z
of the still water), `attached` (arc lengths of floats, clumps and bodies), `touchdown` and `contact`.
Points followed over time have colours of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.limits import held_of
from hybrid.store.reader import Result
from hybrid.store.records import not_converged_in
from hybrid.view.curves import AXES, Along, Kept, along, even, extent
from hybrid.view.figure import (
    ALARM,
    BED,
    BODY,
    DOUBT,
    END_COLOURS,
    GREY,
    LEVEL,
    NEWS,
    POINT_COLOURS,
    SAND,
    WATER,
    ZERO,
    Area,
    Axis,
    Band,
    Box,
    Item,
    Line,
    Marks,
    Page,
    Panel,
    Rule,
    Text,
    colour_of,
    earlier_grey,
    prefix,
    short,
    title_of,
)
from hybrid.view.projections import (
    STILL,
    Numbers,
    View,
    bed_in,
    bed_profile,
    extent_in,
    free_edges,
    magnification,
    not_to_scale,
    outlines,
    pieces_of,
    telling_times,
    view_named,
    views_of,
    whole_zones,
)
from hybrid.view.zones import warnings_of

MOST_CHANGES = 12  # of zones that are marked over time: more would hide the curves
FAR_BEYOND = 3.0  # times the range of a curve: an error that large is said, not drawn to its end
RANGES = ("tension", "curvature", "bending_moment", "torque", "shear", "contact", "capacity_used", "code_used")
_SIZES = ("curvature", "bending_moment", "shear")  # quantities that are not below zero
_PARTS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31", "#7F7F7F")


# ---- shape ----------------------------------------------------------------------------------------


def shape(
    result: Result,
    *,
    times: Numbers | None = None,
    view: View | str | None = None,
    points: Numbers = (),
    most: int | None = None,
) -> Panel:
    """The last shape, coloured by zones, over earlier ones and the area swept, in grey; the same scale both ways.

    times: earlier times to show (s), else those whose shapes differ most. view: None for the
    plane of the largest extent, or two letters such as "xz". points: arc lengths to mark (m).
    most: for a small drawing, so many points on a curve, and no area swept.
    A cable that is nearly straight is drawn with its deflection magnified, as its title states.
    Seabed, water, what is attached and where the cable touches down: as the file has them.
    """
    view = view_named(view) if isinstance(view, str) else view or views_of(result)[0]
    position = result.position
    earlier = telling_times(result) if times is None else np.asarray(times, dtype=float)
    items = sea(result, view)
    if most is None:
        outputs = np.array(view.project(position[:: -1 - len(position) // 4000])).transpose(1, 2, 0)  # enough for all
        strips = np.concatenate([outputs[:-1], outputs[1:, ::-1]], axis=1)  # along one shape, and back along the next
        moves = np.ptp(position, axis=0).max() > STILL * np.ptp(position, axis=(0, 1)).max()
        items.append(Area(strips, "#E8E8E8", "range over time" * bool(moves)))
    chosen = even(len(result.s), most or len(result.s))
    for k, then in enumerate(result.at(t=earlier, names=["position"])["position"]):
        grey = earlier_grey(k, len(earlier))
        items.append(Line(*view.project(then[chosen]), "earlier shapes (later: darker)" * (most is None), grey, 0.7))
    items += cable(result, view, -1, joints=True)
    for k, point in enumerate(points):
        at = view.project(_place(np.array([point]), result.s, position[-1]))
        items.append(Marks(*at, "o", face=_colour(k), edge=_colour(k), size=2.6))
    return framed(result, view, items, _time_text(result, -1))


def framed(result: Result, view: View, items: list[Item], when: str = "") -> Panel:
    """Items in the frame of a view: all outputs and what is near to them."""
    wider, taller = magnification(view, result)
    factors = zip((view.across_label.split(",")[0], view.up_label), (wider, taller), strict=True)
    stretch = "".join(f", {name} × {factor:g}" for name, factor in factors if factor > 1.0)
    side = "above" if np.cross(view.across, view.up)[2] > 0.0 else "below"
    above = "" if "z" in (view.across_label, view.up_label) else f" from {side}"
    box = extent_in(view, result)
    margin = 0.06 * np.ptp(box, axis=1, keepdims=True) + (1e-6 * float(np.ptp(box)) or 0.5)
    (left, right), (low, high) = (box + margin * [-1.0, 1.0]).tolist()
    across, up = Axis(view.across_label, "m", left, right), Axis(view.up_label, "m", low, high)
    size = " × ".join(f"{short(x, 4)}" for x in np.ptp(box, axis=1))
    caption = f"{view.across_label} – {view.up_label}, {size} m{stretch}"
    caption += f" ({scale})" if (scale := not_to_scale(view, result)) else ""
    return Panel("shape", f"shape{above}{when}{stretch}", across, up, items, taller / wider, caption=caption)


def cable(result: Result, view: View, output: int, *, joints: bool = False) -> list[Item]:
    """The cable at an output: its zones, its ends, what is attached, where it touches down, obstacles that move."""
    s, position = result.s, result.position[output]
    items, pieces = outlines(result, view, output, moving=True), pieces_of(result, output)
    for kind, where in pieces:
        items.append(Line(*view.project(_place(where, s, position)), kind, colour_of(kind), 2.0))
    if "attached" in result:
        bodies = view.project(_place(result["attached"], s, position))
        items.append(Marks(*bodies, "o", "float, clump, body", BODY, size=10.0))
    items += [Marks(*view.project(position[[k]]), "s^"[k], ("start", "end")[k], size=6.0) for k in (0, -1)]
    if joints and len(pieces) > 1:
        at = view.project(_place(np.array([where[-1] for _, where in pieces[:-1]]), s, position))
        items.append(Marks(*at, "o", "joint", "#FFFFFF"))
    if joints and "touchdown_position" in result:
        away = np.abs(result["touchdown"][output] - s[[0, -1]]) > 0.005 * (s[-1] - s[0])  # the ends have their own
        places = view.project(result["touchdown_position"][output][away])  # NaN, of a cable that hangs, is not away
        items += [Marks(*places, "v", "touchdown", BED)] * bool(away.any())
    return items


def sea(result: Result, view: View) -> list[Item]:
    """Water below its surface, sand below the bed, and obstacles that rest.

    Out to the rims of the panel, whatever these will be.
    """
    bed, box = bed_in(view, result), extent_in(view, result)
    middle, far = box.mean(axis=1), 30.0 * float(np.ptp(box, axis=1).max())  # more than any panel shows
    x, deep = middle[0] + far * np.array([-1.0, 1.0]), middle[1] - far
    top = int(np.argmax(view.project(result.position[-1])[1]))
    aside = int(view.project(result.position[-1])[0][top] < middle[0])  # where the cable is not: left or right
    wet = "surface" in result and view.upright
    planes = [(float(result["surface"]), 0.0, WATER, LEVEL, "still water", 2.0)] if wet else []
    uneven = bed_profile(view, result)
    planes += [(*bed, SAND, BED, "seabed", -3.0)] if bed and uneven is None else []
    items: list[Item] = []
    for height, rise, fill, edge, name, lift in planes:
        z, at = height + rise * x, float(box[0, aside])
        corners = [(x[0], z[0]), (x[1], z[1]), (x[1], min(z[1], deep)), (x[0], min(z[0], deep))]
        items += [Area(np.array([corners]), fill), Line(x, z, colour=edge, width=0.9)]
        side, up = ("left", "right")[aside], "bottom" if lift > 0 else "top"
        items.append(Text(at, height + rise * at, name, edge, (0.0, lift), side, up))
    if uneven is not None:
        floor = min(deep, float(uneven[:, 1].min()))
        outline = np.vstack([uneven, [[uneven[-1, 0], floor], [uneven[0, 0], floor]]])
        items += [Area(outline[None], SAND), Line(uneven[:, 0], uneven[:, 1], "seabed", colour=BED, width=0.9)]
    return items + outlines(result, view, -1, moving=False)


# ---- along the cable ------------------------------------------------------------------------------


def profiles(
    result: Result, names: str | Sequence[str], *, output: int = -1, times: Numbers = (), title: str = ""
) -> Panel:
    """One or two quantities of the same unit along s at one output, and their range over all times; gaps at jumps.

    The range is that of every step where the file has its envelope.  The zones of that output are shaded, and the
    estimated error is a band, if the file has one. Further names after the first are dashed, and left out where they
    would not be visible. times: when else to show the first, in grey.
    """
    names = [names] if isinstance(names, str) else list(names)
    items: list[Item] = _zones_behind(result, output)
    drawn = [(name, along(result, name)) for k, name in enumerate(names) if k == 0 or name in result]
    peak = float(np.abs(drawn[0][1].values).max())
    drawn = drawn[:1] + [(n, v) for n, v in drawn[1:] if np.abs(v.values).max() > max(ZERO, 5e-3 * peak)]  # visible
    peak = max(float(np.abs(v.values).max()) for _, v in drawn)
    factor, unit = prefix("m" if names[0] in AXES else result.units[names[0]], peak)
    bottom: float | None = None
    top: float | None = None
    for k, (name, found) in enumerate(drawn):
        s, values = found.s, found.values * factor
        low = high = values
        if len(values) > 1:
            places, low, high, _ = extent(result, name)
            low, high = low * factor, high * factor
            items.append(Band(places, low, high, colour=GREY, opacity=0.28 - 0.12 * k))
            usual, most = max(float(np.nanpercentile(high, 90)), float(values[output].max())), float(np.nanmax(high))
            if len(drawn) == 1 and 0.0 < 10.0 * usual < most:  # a spike would press all else to the ground
                bottom, top = float(np.nanmin(low)) - 0.1 * usual, 1.5 * usual
                spike = f"peak {short(most, 3)} {unit} at s = {short(places[np.nanargmax(high)], 4)} m"
                items.append(Text(0.03, 0.91, spike, parts="xy"))
        for n, t in enumerate(times if k == 0 else ()):
            then = values[int(np.abs(result.times - t).argmin())]
            items.append(Line(*found.curve(then), colour=earlier_grey(n, len(times)), width=0.7))
        error = _error_along(result, name, found)
        if error is not None:
            items.append(_doubt(s, values[output], error[output] * factor, size=name in _SIZES))
            most, span = float(np.nanmax(error[output])) * factor, float(np.nanmax(high) - np.nanmin(low))
            if len(drawn) == 1 and top is None and 0.0 < FAR_BEYOND * span < most:  # it would press the curve flat
                bottom, top = float(np.nanmin(low)) - 0.1 * span, float(np.nanmax(high)) + span
                place = short(s[np.nanargmax(error[output])], 4)
                items.append(Text(0.03, 0.91, f"error up to {short(most, 2)} {unit} at s = {place} m", parts="xy"))
        items.append(Line(*found.curve(values[output]), title_of(name), width=1.3, dash="dash" * bool(k)))
    name_of = title_of(names[0]).replace("bending ", "").replace("contact force", "contact")
    up = ",\n".join(
        [name_of, *(title_of(n) for n, _ in drawn[1:])]
    )  # on the axis; a title has to leave room for others
    title = title or (name_of if drawn[1:] else title_of(names[0])) + _time_text(result, output)
    y = Axis(up, unit, bottom, top, peak * factor)
    return Panel("-".join(names), title, _along(result), y, items, legend=len(drawn) > 1)


def ranges(result: Result, shown: Kept) -> list[Panel]:
    """Lowest, mean and highest value along the cable, over all outputs; with one output its profile."""
    found = [name for name in RANGES if name in result and len(result.times)]
    sizes = {n: float(np.nan_to_num(np.abs(result[n])).max()) for n in found}
    seen = [n for n in found if n in ("tension", "curvature") or sizes[n] > ZERO]  # else there is none
    return [_range(result, name, shown) for name in seen]


def _range(result: Result, name: str, shown: Kept) -> Panel:
    found, several = along(result, name), len(result.times) > 1
    s, values = found.s, found.values
    bounds_s, low, high, basis = extent(result, name)
    peak = float(np.nanmax(np.abs([low, high])))
    peak = max(float(np.nanmax(np.abs(values))), peak)
    factor, unit = prefix(result.units[name], peak)
    items: list[Item] = []
    error = _error_along(result, name, found)
    if error is not None:
        outer = (values - error).min(axis=0), (values + error).max(axis=0)
        below = np.maximum(outer[0], 0.0) if name in _SIZES else outer[0]
        items.append(Band(s, below * factor, outer[1] * factor, "± error", DOUBT, 0.25))
    if several:
        items += [
            Band(bounds_s, low * factor, high * factor, colour=GREY, opacity=0.22),
            Line(bounds_s, high * factor, "highest", "#B84F04"),
            Line(*found.curve(values.mean(axis=0) * factor), "mean", GREY, dash="dash"),
            Line(bounds_s, low * factor, "lowest", "#2C72B6"),
        ]
    else:
        items += _zones_behind(result, 0)
    some = np.flatnonzero(np.isin(found.points, shown.points))
    x, frames = found._replace(s=s[some]).curve(values[np.ix_(shown.frames, some)] * factor)
    items.append(Line(x, frames[0], "now" * several, width=1.6, frames=frames if several else None))
    allowed = found.of(result, "min_bend_radius") if name == "curvature" else None
    if allowed is not None:
        items.append(Line(*found.curve(factor / allowed), "allowed", ALARM, 1.6, "dot"))
    title = title_of(name).replace("|", "")
    label = title_of(name).replace("bending ", "").replace("contact ", "")
    y = Axis(label, unit, peak=peak * factor)
    caption = f"{title[:1].upper()}{title[1:]} along the cable"
    seen = f": lowest and highest of {basis}, mean of the outputs, and now: the time of the slider."
    caption += seen if several else "."
    return Panel(f"range-{name}", title, _along(result), y, items, caption=caption)


def _along(result: Result) -> Axis:
    return Axis("s", "m", float(result.s[0]), float(result.s[-1]))


def _zones_behind(result: Result, output: int) -> list[Item]:
    zones = whole_zones(result.zones[output])
    return [Box((zone.s_a, zone.s_b), None, colour=colour_of(zone.kind)) for zone in zones]


# ---- over time ------------------------------------------------------------------------------------


def history(result: Result, name: str, s: Numbers, *, component: int | None = None, legend: bool = True) -> Panel:
    """A quantity over time at the arc lengths s (m).

    component: 0, 1, 2 for x, y, z of a vector, drawn as the change since the first output;
    None for a scalar or the magnitude of a vector. Dotted lines: the zones changed; bands: the estimated error, of the
    value on the left where there are two; that on the right is dashed.
    """
    if "s" not in result.dims(name):
        raise ResultError(f"'{name}' does not depend on s; plot it as result[{name!r}] over result.times")
    values, right = (result.at(s=np.asarray(s, dtype=float), names=[name], side=x)[name] for x in ("left", "right"))
    jumps = result["right/s"] if f"right/{name}" in result else np.zeros(0)
    if component is not None:
        values = values[..., component] - values[0, ..., component]
        label = f"Δ{AXES[component]}" if name == "position" else f"Δ{title_of(name)} {AXES[component]}"
        title, caption = (
            f"{label} since t = {short(result.times[0], 4)} s",
            f"Change of {title_of(name)} {AXES[component]}",
        )
    else:
        values = np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values
        label = title_of(name)
        title = f"{label} over time"
        caption = title_of(name)[:1].upper() + title_of(name)[1:]
    caption += f" over time at s = {', '.join(f'{short(x, 4)}' for x in s)} m."
    peak = float(np.abs(values).max() if not jumps.size else max(np.abs(values).max(), np.abs(right).max()))
    round_off = STILL * float(np.ptp(result.position, axis=(0, 1)).max()) if label.startswith("Δ") else 0.0
    factor, unit = prefix(result.units[name], max(peak, round_off))
    error, items = error_of(result, name), list[Item]()
    for k, point in enumerate(s):
        if error is not None:
            at = result.at(s=float(point), names=[_error_name(name)], side="left")[_error_name(name)]
            size = component is None and name in _SIZES
            items.append(_doubt(result.times, values[:, k] * factor, at * factor, size=size))
    for k, point in enumerate(s):
        width = max(1.8 - 0.4 * k, 1.0)  # later curves are thinner, so that coinciding ones all show
        y, label_of = values[:, k] * factor, f"s = {short(point, 4)} m"
        two = bool(np.isclose(point, jumps, rtol=0.0, atol=1e-9 * result.s[-1]).any())
        before = f"{label_of}, before the point" if two else label_of
        items.append(Line(result.times, y, before, _colour(k), width, symbol="o", last_only=True))
        if two:
            items.append(Line(result.times, right[:, k] * factor, f"{label_of}, after it", _colour(k), width, "dash"))
    changes = np.unique(result["zones/t"])[1:]
    if 0 < len(changes) <= MOST_CHANGES:
        items.append(Rule("x", changes.tolist(), "zones changed"))
    bound = round_off * factor if peak < round_off else None
    up = Axis(label, unit, None if bound is None else -bound, bound, peak * factor)
    moved = "displacement" if name == "position" else name
    key = name if component is None else f"{moved}-{AXES[component]}"
    return Panel(key, title, _time(result), up, items, legend=legend, caption=caption, cursor=True)


def end_forces(result: Result) -> Panel | None:
    """Force at each end at every step, or where the file has none at every output."""
    found = {end: force for end in END_COLOURS if (force := end_force(result, end)) is not None}
    peak = max((float(y.max()) for _, y in found.values()), default=0.0)
    factor, unit = prefix("N", peak)
    items: list[Item] = []
    for end in found:
        error = f"errors/total/end_force_{end}"
        known = f"end_force_{end}" not in not_converged_in(result.attributes)
        if known and error in result and f"reaction_{end}" in result:
            middle = np.linalg.norm(result[f"reaction_{end}"], axis=1)
            items.append(_doubt(result.times, middle * factor, result[error] * factor, size=True))
    items += [Line(t, y * factor, f"at the {end}", END_COLOURS[end]) for end, (t, y) in found.items()]
    y = Axis("force", unit, peak=peak * factor)
    caption = "Force that holds or loads each end, at every step."
    return Panel("end-forces", "end forces", _time(result), y, items, caption=caption, cursor=True) if items else None


def end_force(result: Result, end: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Times (s) and the size of the force at an end, N; None: the file has none."""
    if f"steps/end_force_{end}" in result and len(result["steps/t"]):
        return result["steps/t"], result[f"steps/end_force_{end}"]
    if f"reaction_{end}" in result:
        return result.times, np.linalg.norm(result[f"reaction_{end}"], axis=1)
    return None


def touchdown(result: Result) -> Panel:
    """Between which arc lengths the cable lies on the seabed, over time: sand; nothing while it hangs free."""
    edges, s, free = result["touchdown"], result.s, free_edges(result)
    named = zip(("first contact", "last contact"), edges.T, strict=True)
    items: list[Item] = [Band(result.times, edges[:, 0], edges[:, 1], colour=SAND, opacity=1.0)]
    items += [Line(result.times, y, name, BED) for k, (name, y) in enumerate(named) if k in free]
    seen = edges[:, free][np.isfinite(edges[:, free])] if free else s[[0, -1]]
    margin = 0.05 * float(np.ptp(seen)) or 0.05
    y = Axis("s", "m", float(seen.min()) - margin, float(seen.max()) + margin, float(s[-1]))
    caption = "Arc length where contact with the seabed begins or ends; a gap where nothing touches."
    return Panel("touchdown", "touchdown over time", _time(result), y, items, caption=caption, cursor=True)


def energy(result: Result, group: str) -> Panel | None:
    """Where the energy is ("energy"), or where it came from ("work"), over time."""
    title, caption = {
        "energy": ("energy", "Change since the first output, of each kind and of all."),
        "work": ("work", "Done on the cable since the start, by cause; below zero: taken out."),
    }[group]
    parts = energy_parts(result, group)
    if not parts or len(result.times) < 2:
        return None
    total = np.sum(list(parts.values()), axis=0)
    peak = max(float(np.abs(y).max()) for y in (*parts.values(), total))
    factor, unit = prefix("J", peak)
    seen = {name: y for name, y in parts.items() if np.abs(y).max() > 1e-4 * peak}
    named = zip(seen.items(), cycle(_PARTS), strict=False)
    items: list[Item] = [Line(result.times, y * factor, name, colour) for (name, y), colour in named]
    items.append(Line(result.times, total * factor, "all", width=1.6, dash="dash"))
    left = [name for name in parts if name not in seen]
    if left:
        caption += f" Too small to show: {', '.join(left)}."
    y = Axis(group, unit, peak=peak * factor)
    return Panel(group, title, _time(result), y, items, caption=caption, cursor=True)


def energy_parts(result: Result, group: str) -> dict[str, np.ndarray]:
    """Energies since the first output, or works, by name (nt,), J."""
    if group not in result:
        return {}
    return {
        name.replace("_", " "): result[f"{group}/{name}"] - (result[f"{group}/{name}"][0] if group == "energy" else 0.0)
        for name in result[group]
        if result.dims(f"{group}/{name}") == ("t",)
    }


def _time(result: Result) -> Axis:
    first, last = float(result.times[0]), float(result.times[-1])
    return Axis("t", "s", first, last + 0.025 * ((last - first) or 1.0))  # room for the dots of the last shape


# ---- parts ----------------------------------------------------------------------------------------


def error_of(result: Result, name: str) -> np.ndarray | None:
    """Estimated error (nt, ns) of a quantity, by all causes; None where the file has none.

    Or where the figure says nothing, because it does not converge.  Of x, y, z: of position.
    """
    found = _error_name(name)
    if found.rpartition("/")[2] in not_converged_in(result.attributes):
        return None
    return np.asarray(result[found]) if found in result and result.dims(found) == ("t", "s") else None


def _error_along(result: Result, name: str, found: Along) -> np.ndarray | None:
    return found.of(result, _error_name(name)) if error_of(result, name) is not None else None


def _error_name(name: str) -> str:
    return f"errors/total/{'position' if name in AXES else name}"


def _doubt(x: np.ndarray, values: np.ndarray, error: np.ndarray, *, size: bool) -> Band:
    """The range in which the truth is estimated to lie; of a size, not below zero."""
    low = np.maximum(values - error, 0.0) if size else values - error
    return Band(x, low, values + error, "estimated error", DOUBT, 0.35)


def _place(where: np.ndarray, s: np.ndarray, position: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(where, s, position[:, k]) for k in range(3)])


def _time_text(result: Result, output: int) -> str:
    return f" at t = {short(result.times[output], 5)} s" if len(result.times) > 1 else ""


def _colour(k: int) -> str:
    return POINT_COLOURS[k % len(POINT_COLOURS)]


# A page about a result: its title and facts above, warnings below; what pages of several lines refuse.


def page_of(result: Result, facts: list[str], **more: Any) -> Page:
    """A page about a result: title and facts above the panels, warnings below."""
    n, complete = len(result.times), result.status == "complete"
    head = [] if result.done else [result.status_text]
    if n:
        span = f"{n} outputs, t = {short(result.times[0], 5)} … {short(result.times[-1], 5)} s"
        head.append(span if n > 1 else "static" if complete else f"one output, t = {short(result.times[0], 5)} s")
    found = warnings_of(result)
    alarms = [(event, count) for event, count in found if event.kind not in NEWS]
    note = "; ".join(dict.fromkeys(event.text for event, _ in (alarms[:1] or found)))
    if alarms:
        names = ", ".join(event.kind + f" (× {count})" * (count > 1) for event, count in alarms)
        note = f"Warning: {names}; at t = {short(alarms[0][0].t, 4)} s: {note}"
    elif found:
        note = f"Note: {note}"
    broken = [x for x in held_of(result) if x.broken]
    if broken:
        more_of = f" and {len(broken) - 1} more" * (len(broken) > 1)
        note = f"{note or 'Warning'}{';' if note else ':'} {broken[0].text}{broken[0].when}{more_of}"
    texts, alarm = "; ".join(filter(None, [*head, *facts])), (not result.done, bool(alarms or broken))
    empty = "" if n else "no output was saved"
    return Page(result.title or "(no title)", texts, note=note, alarm=alarm, empty=empty, **more)


def only_line(result: Result, what: str) -> Result:
    """The line of a result of one; ResultError where something of one line is asked of several."""
    (name, line), *others = result.each_line()
    if others:
        advice = f"result.lines['{name}'], or --line {name}"
        raise ResultError(f"{what}: of one line, and the result is of {len(others) + 1}\n    try:      {advice}")
    return line
