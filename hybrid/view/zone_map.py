"""The space-time picture of a report: zones along the cable over time, and the events that explain them."""

from __future__ import annotations

from html import escape
from itertools import pairwise
from textwrap import wrap
from types import SimpleNamespace
from typing import Any

import numpy as np

from hybrid.errors import EVENTS_BY_WEIGHT, ZONE_EVENTS, weight_of_event
from hybrid.store.reader import Result
from hybrid.store.records import Event
from hybrid.view.decimate import Kept, Store, outline
from hybrid.view.figures import Spec, colour_scale, layout
from hybrid.view.projections import STILL, free_edges
from hybrid.view.scenery import span_of
from hybrid.view.style import ALARM, INK, NEWS, prefix
from hybrid.view.zone_plot import COLOURS, SHOWN, cells_of, outlines, rod_share

_MOST_CELLS = 150_000  # of the map: a browser colours so many at once
_MOST_MARKS = 600  # events on the map; the worst stay
_MOST_LISTED = 400  # in the list below it
_WIDE = 46  # characters on a line of a label: a phone has no more
_SYMBOLS = {"split": "triangle-up", "grow": "cross-thin", "shrink": "x-thin", "merge": "triangle-down", "retry": "x"}


def zone_map(result: Result, store: Store, shown: Kept) -> list[Spec]:
    """Zones of s over t, coloured by what their kind is about, with boundaries, touchdown and events."""
    if len(result.times) < 2 or not any(result.zones):
        return []
    frames = shown.frames
    cells = cells_of(_thinned(result, frames, shown.points))
    if (most := _MOST_CELLS // len(cells.s)) < len(frames):
        frames = frames[np.linspace(0, len(frames) - 1, max(most, 2)).round().astype(int)]
        cells = cells_of(_thinned(result, frames, shown.points))
    rows, data, bars = np.ix_(frames, shown.points), [], []
    for kind in (kind for kind in SHOWN if kind in cells.kinds):
        name = SHOWN[kind]
        if name not in result:
            continue
        factor, unit = prefix(result.units[name], float(np.abs(result[name]).max()))
        values = cells.values(kind, result[name][rows]).filled(np.nan) * factor
        straight = factor * STILL / (float(np.ptp(result.s)) or 1.0)
        low, high, log = span_of(values, bends=kind == "rod", straight=straight)
        stored = store.add(values)
        data.append(
            {
                "type": "heatmap", "x": store.add(cells.t), "y": store.add(cells.s),
                "z": stored | {"log": log}, "customdata": stored,
                "colorscale": colour_scale(COLOURS[kind]), "showscale": False, "name": kind,
                "zmin": np.log10(low) if log else low, "zmax": np.log10(high) if log else high,
                "hovertemplate": f"{kind}: {name} %{{customdata:.4g}} {unit}<br>t = %{{x:.5g}} s, s = %{{y:.4g}} m",
            }
        )  # fmt: skip
        bars.append(
            {"label": f"{kind}: {name}", "shades": COLOURS[kind], "low": low, "high": high, "unit": unit, "log": log}
        )
    data += _lines(result, store, cells)
    data += _events(result, store)
    figure: Spec = {
        "key": "zones",
        "title": "Zones over time",
        "data": data,
        "bars": bars,
        "cursor": True,
        "tall": True,
    }
    figure["said"] = "What kind of model holds where and when. Point at a mark, or tap it, to read what happened."
    if len(frames) < len(shown.frames):
        figure["said"] += f" {len(frames)} of {len(result.times)} outputs are drawn."
    if len(result.events) > _MOST_MARKS:
        figure["said"] += f" Of {len(result.events)} events the {_MOST_MARKS} that matter most are marked."
    look = layout("t (s)", "s (m)", hovermode="closest")
    look["xaxis"] |= {"range": [float(cells.t[0]), float(cells.t[-1])], "showgrid": False}
    look["yaxis"] |= {"range": [float(cells.s[0]), float(cells.s[-1])], "showgrid": False}
    look["plot_bgcolor"] = "#D9D9D9"
    return [figure | {"layout": look}]


def _thinned(result: Result, frames: np.ndarray, points: np.ndarray) -> Any:
    zones = [result.zones[int(i)] for i in frames]
    return SimpleNamespace(times=result.times[frames], s=result.s[points], zones=zones)


def _lines(result: Result, store: Store, cells: Any) -> list[Spec]:
    """Boundaries of zones, and touchdown."""
    data: list[Spec] = []
    lines = outlines(cells)
    if lines:
        gaps = np.full((1, 2), np.nan)
        joined = np.concatenate([part for line in lines for part in (line, gaps)])
        data.append(_line(store, joined[:, 0], joined[:, 1], "zone boundary", INK, 1.0))
    for n, edge in enumerate(free_edges(result)):
        s = result["touchdown"][:, edge]
        k = outline(np.where(np.isfinite(s), s, np.nanmean(s)))
        casing = _line(store, result.times[k], s[k], "touchdown (white, dark edges)", INK, 3.5) | {"showlegend": n == 0}
        data += [casing, _line(store, result.times[k], s[k], "", "#FFFFFF", 1.8) | {"showlegend": False}]
    return data


def _line(store: Store, x: np.ndarray, y: np.ndarray, name: str, colour: str, width: float) -> Spec:
    return {
        "type": "scatter", "mode": "lines", "x": store.add(x), "y": store.add(y), "name": name,
        "line": {"color": colour, "width": width}, "hoverinfo": "skip", "connectgaps": False,
    }  # fmt: skip


# ---- events ---------------------------------------------------------------------------------------


def sorted_events(result: Result, most: int) -> list[Event]:
    """So many events, the worst and the earliest, in the order of time."""
    order = sorted(result.events, key=lambda e: (e.kind in NEWS, weight_of_event(e.kind), e.t))
    return sorted(order[:most], key=lambda e: e.t)


def label(event: Event) -> str:
    """What an event says of itself, in plotly's tags; its own text is escaped."""
    where = f"s = {event.s_a:.4g} m" if event.s_a == event.s_b else f"s = {event.s_a:.4g} to {event.s_b:.4g} m"
    lines = [f"<b>{escape(event.kind)}</b>", f"t = {event.t:.5g} s, {where}"]
    lines += [escape(line) for line in wrap(event.text, _WIDE)[:12]]
    if event.energy is not None:
        lines.append(f"energy put in: {event.energy:.3g} J")
    return "<br>".join(lines)


def family(kind: str) -> str:
    """ "warning", "zone" or "news"."""
    return "zone" if kind in ZONE_EVENTS else "warning" if kind in EVENTS_BY_WEIGHT and kind not in NEWS else "news"


def _events(result: Result, store: Store) -> list[Spec]:
    events = sorted_events(result, _MOST_MARKS)
    looks = {
        "zone": ("change of zones", "#FFFFFF", INK, 9),
        "news": ("note", "#F0E442", INK, 11),
        "warning": ("warning", ALARM, "#FFFFFF", 13),
    }
    data: list[Spec] = []
    for of, (name, face, edge, size) in looks.items():
        found = [event for event in events if family(event.kind) == of]
        if not found:
            continue
        symbols = [_SYMBOLS.get(e.kind, "diamond").replace("-thin", "") for e in found]
        marker = {"symbol": symbols, "color": face, "size": size, "line": {"color": edge, "width": 1}}
        if of == "zone":
            x = [v for e in found for v in (e.t, e.t, np.nan)]
            y = [v for e in found for v in (e.s_a, e.s_b, np.nan)]
            data.append(_line(store, np.array(x), np.array(y), "", INK, 0.8) | {"showlegend": False})
        data.append(
            {
                "type": "scatter", "mode": "markers", "name": name, "marker": marker, "cliponaxis": False,
                "x": [e.t for e in found], "y": [0.5 * (e.s_a + e.s_b) for e in found],
                "text": [label(e) for e in found], "hovertemplate": "%{text}<extra></extra>",
            }
        )  # fmt: skip
    return data


def event_rows(result: Result) -> tuple[list[tuple[float, str, str, str, str]], str]:
    """Rows of the list of events: time, place, kind, text, family; and what was left out."""
    events = sorted_events(result, _MOST_LISTED)
    rows = [(e.t, f"{e.s_a:.4g} – {e.s_b:.4g}", e.kind, e.text, family(e.kind)) for e in events]
    left = len(result.events) - len(rows)
    return rows, f"{left} more are in the result file: result.events in Python." if left else ""


def shares(result: Result) -> str:
    """How much of the cable was rod, in a sentence."""
    if len(result.times) < 1 or not any(result.zones):
        return ""
    part = 100.0 * rod_share(result)
    low, high = float(part.min()), float(part.max())
    changes = sum(a != b for a, b in pairwise(result.zones))
    if not changes:
        return f"{low:.3g} % of the cable is rod, all the time." if len(result.times) > 1 else f"{low:.3g} % is rod."
    return f"Rod is {low:.3g} to {high:.3g} % of the cable; zones changed at {changes} outputs."
