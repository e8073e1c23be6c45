"""The zones of a run: arc length against time, the events that changed them, and the share of rod.

Every output point of every output has one cell, which reaches half way to its neighbours in time and, within its
zone, in s; its colour is the recorded value. Nothing is made up between them: a zone without an output point is grey.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from itertools import groupby, pairwise
from textwrap import wrap
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import EVENTS_BY_WEIGHT, ZONE_EVENTS, weight_of_event
from hybrid.store.reader import Result
from hybrid.store.records import RODS_AT_START, Event, Zone
from hybrid.view.curves import Kept, even
from hybrid.view.figure import (
    ALARM,
    INK,
    NEWS,
    Axis,
    Band,
    Box,
    Item,
    Line,
    Map,
    Marks,
    Panel,
    Text,
    colour_of,
    prefix,
    short,
)
from hybrid.view.projections import STILL, free_edges, whole_zones

# What is shown of each kind, and its colours: shades of the orange and the blue that the kinds have on other pages.
# Lightness falls evenly (in OKLab, 0.93 to 0.32), and none of one kind is near any of the other to colour-blind eyes.
SHOWN = {"rod": "curvature", "catenary": "tension", "corrected": "tension"}
COLOURS = {
    "rod": ("#FCE5BB", "#F2C78E", "#E9A862", "#E08735", "#D1680E", "#B84F04", "#9B3A0D", "#7B2C17", "#5B1F17"),
    "catenary": ("#CFEEF7", "#A6D8EA", "#7FC0DF", "#5AA7D6", "#398CCC", "#2C72B6", "#2158A0", "#204181", "#1D2C5D"),
}
COLOURS["corrected"] = COLOURS["catenary"]  # of 0.6; no result has both
_UNSEEN = "#D9D9D9"
_DECADES = 2.0  # of curvature, at most: what is a hundred times straighter than the tightest bend is straight
_SPAN = 10.0  # a curvature that varies by more is shown by its logarithm
# How events are marked: symbol, face, edge, size (points). Kinds without a row of their own are a warning or a note.
_MARKS = {
    "split": ("^", "#FFFFFF", INK, 3.4),
    "grow": ("+", "#FFFFFF", INK, 3.4),
    "shrink": ("x", "#9E9E9E", INK, 3.4),
    "merge": ("v", "#9E9E9E", INK, 3.4),
    "retry": ("X", ALARM, INK, 3.4),
    "note": ("D", "#F0E442", INK, 4.2),
    "warning": ("D", ALARM, "#FFFFFF", 4.8),
}
_MOST_MARKS = 250  # on paper: more would hide the zones
_MOST_ON_PAGE, _MOST_LISTED = 600, 400  # of a report, where one can be pointed at, and in the list below it
_MOST_CELLS = 150_000  # of the map of a report: a browser colours so many at once
_MOST_COLUMNS = 230  # of a small drawing
_WIDE = 46  # characters on a line of a label: a phone has no more
_ROOM = 0.04  # of the length: a zone of less has no room for a text
_SAME = 1e-12  # of the length: places so close are one, as they are to the recorder


# Criteria by which a stretch is rod, in words.
WHY = {"bend": "bending", "slack": "low tension", "clamp": "a clamp or moment at an end", "edge": "the touchdown"}
WHY |= {"point": "a point load or joint", "torsion": "torsion", "given": "asked for by the scene"}
WHY |= {"contact": "contact with itself"}


class Rod(NamedTuple):
    """A rod at the start of a run, from s_a to s_b (m), and why: criteria in words, the one that asks most first."""

    s_a: float
    s_b: float
    why: tuple[str, ...]


def rods_at_start(result: Result) -> list[Rod]:
    """The first rods of zones that move; of results that do not say why, none."""
    found = json.loads(str(result.attributes.get(RODS_AT_START, "[]")))
    return [Rod(a, b, tuple(WHY.get(name, name) for name in asks)) for a, b, asks in found]


def why_rods(result: Result) -> str:
    """Why stretches are rod: at the start, and of those that became one later; "" where no zones move."""
    first = [
        f"s = {short(x.s_a, 4)} to {short(x.s_b, 4)} m, {', '.join(x.why[:2]) or 'no criterion'}"
        for x in rods_at_start(result)
    ]
    grown = [x.criterion for x in result.events if x.kind in ("split", "grow") and x.criterion]
    later = Counter(WHY.get(x, x) for x in grown)
    parts = [f"rod at the start: {'; '.join(first)}"] if first else []
    parts += [f"rod later: {', '.join(f'{name} × {n}' for name, n in later.most_common())}"] if later else []
    return "; ".join(parts)


class Cells(NamedTuple):
    """The cells of the picture, between edges in time (nt+1,) s and along the cable (n+1,) m.

    kind (n, nt): which of `kinds` the zone there is of; point (n, nt): which output point shows it; -1: none.
    """

    t: np.ndarray
    s: np.ndarray
    kinds: tuple[str, ...]
    kind: np.ndarray
    point: np.ndarray

    def values(self, kind: str, field: np.ndarray) -> np.ma.MaskedArray:
        """A field (nt, ns) in the cells of one kind of zone (n, nt), masked elsewhere."""
        there = (self.kind == self.kinds.index(kind)) & (self.point >= 0)
        return np.ma.masked_array(field[np.arange(there.shape[1]), self.point], ~there)


def cells_of(result: Result) -> Cells:
    """Which zone each cell belongs to, and which output point: the nearest one that shows this zone."""
    times, s = result.times, result.s
    runs = [(zones, len(list(same))) for zones, same in groupby(map(whole_zones, result.zones))]
    bounds = [x for zones, _ in runs for zone in zones for x in zone[1:]]
    edges = np.sort([s[0], *(0.5 * (s[1:] + s[:-1])), s[-1], *bounds])
    edges = edges[np.append(True, np.diff(edges) > _SAME * np.ptp(edges))]
    centres = 0.5 * (edges[1:] + edges[:-1])
    kinds = tuple(dict.fromkeys(zone.kind for zones, _ in runs for zone in zones))
    columns = [np.repeat(_column(zones, kinds, centres, s)[..., None], n, axis=2) for zones, n in runs]
    kind, point = np.concatenate(columns, axis=2)
    return Cells(edges_of(times), edges, kinds, kind, point)


def edges_of(times: np.ndarray) -> np.ndarray:
    """From when to when each output holds (nt+1,), s; a moment alone gets some width."""
    ends = times[[0, -1]] + ([0.0, 0.0] if len(times) > 1 else [-0.5, 0.5])
    return np.concatenate([ends[:1], 0.5 * (times[1:] + times[:-1]), ends[1:]])


def _column(zones: list[Zone], kinds: tuple[str, ...], centres: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Number of the kind and of the output point of every cell at one output (2, n); -1: none."""
    out = np.full((2, len(centres)), -1)
    ends = np.array([zone.s_b for zone in zones])
    shown = np.searchsorted(ends + _SAME * np.ptp(s), s)  # a point on a joint shows the side before it
    for k, zone in enumerate(zones):
        here = (centres > zone.s_a) & (centres < zone.s_b)
        out[0, here] = kinds.index(zone.kind)
        points = np.flatnonzero(shown == k)
        if len(points):
            out[1, here] = points[np.searchsorted(0.5 * (s[points[1:]] + s[points[:-1]]), centres[here])]
    return out


def rod_share(result: Result) -> np.ndarray:
    """Part of the cable that is rod, at every output (nt,)."""

    def length(zones: list[Zone], *kinds: str) -> float:
        return sum(zone.s_b - zone.s_a for zone in zones if zone.kind in kinds or not kinds)

    return np.array([length(zones, "rod") / (length(zones) or 1.0) for zones in result.zones])


def outlines(cells: Cells) -> list[np.ndarray]:
    """Lines (2, 2) of t and s between cells of different kinds, each as long as it goes."""
    lines = []
    for kind, across, along in ((cells.kind, cells.s, cells.t), (cells.kind.T, cells.t, cells.s)):
        differ = np.pad(np.diff(kind, axis=0) != 0, ((0, 0), (1, 1)))
        for k, n in np.argwhere(differ[:, 1:] & ~differ[:, :-1]):  # where a line begins
            end = n + int(np.argmin(differ[k, n + 1 :]))
            line = np.array([[along[n], across[k + 1]], [along[end], across[k + 1]]])
            lines.append(line if along is cells.t else line[:, ::-1])
    return lines


def span_of(values: np.ndarray, *, bends: bool, straight: float = 0.0) -> tuple[float, float, bool]:
    """From where to where colours run, and whether by the logarithm: bends that span much; tension from zero.

    straight: a bend of round-off, which gets no colours. Tension far from zero, or below it, does not begin there.
    """
    seen = values[np.isfinite(values)]
    if not len(seen):
        return 0.0, (straight if bends else 0.0) or 1.0, False
    low, high = float(seen.min()), float(seen.max())
    if bends:
        if high <= straight:
            return 0.0, straight or 1.0, False
        usual = float(np.percentile(seen, 5))
        return (max(usual, 10.0**-_DECADES * high), high, True) if usual < high / _SPAN else (0.0, high, False)
    low = 0.0 if 0.0 < low < 0.5 * high else low
    least = 1e-3 * max(abs(low), abs(high)) or 1.0  # less would show round-off
    return low, max(high, low + least), False


# ---- panels ---------------------------------------------------------------------------------------


def zone_map(result: Result, shown: Kept | None = None) -> Panel:
    """Arc length against time: a colour in every zone, boundaries, touchdown, attachments, events.

    A map holds the values of the file, in the unit that it names. shown: what a report keeps of a long run; its
    marks can be pointed at, so that it has more of them, and warnings too.
    """
    frames, points = (shown.frames, shown.points) if shown else (np.arange(len(result.times)), np.arange(len(result.s)))
    cells = cells_of(_thinned(result, frames, points))
    if shown and (most := max(_MOST_CELLS // len(cells.s), 2)) < len(frames):
        frames = frames[even(len(frames), most)]
        cells = cells_of(_thinned(result, frames, points))
    rows, items = np.ix_(frames, points), list[Item]()
    for kind in (kind for kind in SHOWN if kind in cells.kinds and SHOWN[kind] in result):
        quantity = SHOWN[kind]
        values = cells.values(kind, result[quantity][rows]).filled(np.nan)
        factor, unit = prefix(result.units[quantity], float(np.nanmax(np.abs(values), initial=0.0)))
        straight = factor * STILL / (float(np.ptp(result.s)) or 1.0)
        span = span_of(values * factor, bends=kind == "rod", straight=straight)
        items.append(Map(cells.t, cells.s, values * factor, kind, quantity, unit, COLOURS[kind], *span))
    title = ", ".join(f"{item.name} by {item.quantity}" for item in items if isinstance(item, Map))
    if lines := outlines(cells):
        joined = np.concatenate([part for line in lines for part in (line, np.full((1, 2), np.nan))])
        items.append(Line(joined[:, 0], joined[:, 1], "zone boundary", width=0.8))
    for s in result["attached"].tolist() if "attached" in result else ():
        ends = cells.t[[0, -1]]
        items.append(Line(ends, np.array([s, s]), "attached", width=0.7, dash="dash", casing="#FFFFFF"))
    items += _touchdown(result)
    if shown:
        items += _events(sorted_events(result, _MOST_ON_PAGE))
    else:
        events = [e for e in result.events if e.kind in ZONE_EVENTS and cells.t[0] <= e.t <= cells.t[-1]]
        items += _events(events) if len(events) <= _MOST_MARKS else []
    if ((cells.kind >= 0) & (cells.point < 0)).any():
        nowhere = np.zeros(0)
        items.append(Marks(nowhere, nowhere, "s", "no output point in the zone", _UNSEEN, _UNSEEN))
    for rod in rods_at_start(result):
        if rod.s_b - rod.s_a > _ROOM * float(np.ptp(result.s)):
            text = ", ".join(rod.why[:2]) or "no criterion"
            items.append(Text(float(cells.t[0]), rod.s_b, text, offset=(3.0, -2.0), up="top"))
    caption = "Zones along the cable over time: rods in shades of their curvature, catenaries of their tension."
    caption += f" {why[0].upper()}{why[1:]}." if (why := why_rods(result)) else ""
    if shown and len(frames) < len(shown.frames):
        caption += f" {len(frames)} of {len(result.times)} outputs are drawn."
    if len(result.events) > _MOST_ON_PAGE:
        caption += f" Of {len(result.events)} events the {_MOST_ON_PAGE} that matter most are marked."
    up = Axis("s", "m", float(cells.s[0]), float(cells.s[-1]))
    title = f"zones: {title or 'none that are known'}"
    return Panel(
        "zones", title, _time(result, cells.t), up, items, grid=False, fill=_UNSEEN, caption=caption, cursor=True
    )


def share_of_rod(result: Result) -> Panel:
    """How much of the cable is rod, over time."""
    share, edges = 100.0 * rod_share(result), edges_of(result.times)
    mean = float(share @ np.diff(edges)) / np.ptp(edges)
    t, y = np.repeat(edges, 2)[1:-1], np.repeat(share, 2)
    items: list[Item] = [
        Band(t, 0.0 * y, np.full(len(t), 100.0), colour=COLOURS["catenary"][0], opacity=1.0),
        Band(t, 0.0 * y, y, colour=COLOURS["rod"][2], opacity=1.0),
        Line(t, y, width=0.8),
    ]
    low, high = (f"{short(x, 3)}" for x in (share.min(), share.max()))
    span = f" on average, between {low} and {high} %" * (low != high)
    up = Axis("share", "%", 0.0, 100.0, ticks=(0.0, 50.0, 100.0))
    return Panel("share", f"share of rod: {short(mean, 3)} % of the cable{span}", _time(result, edges), up, items)


def strip(result: Result) -> Panel:
    """The kinds of the zones along s over time, for a small drawing; outputs that are alike are one."""
    times, s = result.times, result.s
    frames = even(len(times), _MOST_COLUMNS)
    edges = edges_of(times[frames])
    items: list[Item] = []
    k = 0
    for zones, same in groupby(whole_zones(result.zones[int(i)]) for i in frames):
        n = k + len(list(same))
        for kind, s_a, s_b in zones:
            items.append(Box((edges[k], edges[n]), (s_a, s_b), kind, colour_of(kind), 1.0))
        k = n
    caption = f"zones: s = 0 (below) to {short(s[-1], 5)} m, over t = {short(times[0], 5)} … {short(times[-1], 5)} s"
    x, y = Axis("t", "s", float(times[0]), float(times[-1])), Axis("s", "m", float(s[0]), float(s[-1]))
    return Panel("strip", "", x, y, items, caption=caption)


def shares(result: Result) -> str:
    """How much of the cable was rod, in a sentence."""
    if len(result.times) < 1 or not any(result.zones):
        return ""
    part = 100.0 * rod_share(result)
    low, high = float(part.min()), float(part.max())
    changes = sum(a != b for a, b in pairwise(result.zones))
    if not changes or low == high == 100.0:  # of rods alone only the length changes, as it is paid out
        return (
            f"{short(low, 3)} % of the cable is rod, all the time."
            if len(result.times) > 1
            else f"{short(low, 3)} % is rod."
        )
    return f"Rod is {short(low, 3)} to {short(high, 3)} % of the cable; zones changed at {changes} outputs."


def _time(result: Result, edges: np.ndarray) -> Axis:
    alone = (float(result.times[0]),) if len(result.times) == 1 else ()
    return Axis("t", "s", float(edges[0]), float(edges[-1]), ticks=alone)


def _thinned(result: Result, frames: np.ndarray, points: np.ndarray) -> Any:
    zones = [result.zones[int(i)] for i in frames]
    return SimpleNamespace(times=result.times[frames], s=result.s[points], zones=zones)


def _touchdown(result: Result) -> list[Item]:
    """Where contact begins and ends; a gap while there is none, a dot where it is there at one output only."""
    items: list[Item] = []
    for k in free_edges(result):
        s = result["touchdown"][:, k]
        items.append(Line(result.times, s, "touchdown", "#FFFFFF", 1.1, casing=INK))
        known = np.concatenate([[False], np.isfinite(s), [False]])
        alone = np.flatnonzero(known[1:-1] & ~known[:-2] & ~known[2:])
        if len(alone):
            items.append(Marks(result.times[alone], s[alone], "o", face="#FFFFFF", size=2.5))
    return items


# ---- events ---------------------------------------------------------------------------------------


def counted(result: Result) -> str:
    """How many events of each kind changed the zones."""
    kinds = [event.kind for event in result.events if event.kind in ZONE_EVENTS]
    counts = ", ".join(f"{kind} × {kinds.count(kind)}" for kind in _MARKS if kind in kinds)
    return counts + " (too many to mark)" * (len(kinds) > _MOST_MARKS)


def sorted_events(result: Result, most: int) -> list[Event]:
    """So many events, the worst and the earliest, in the order of time."""
    order = sorted(result.events, key=lambda e: (e.kind in NEWS, weight_of_event(e.kind), e.t))
    return sorted(order[:most], key=lambda e: e.t)


def event_rows(result: Result) -> tuple[list[tuple[float, str, str, str, str]], str]:
    """Rows of the list of events: time, place, kind, text, family; and what was left out."""
    events = sorted_events(result, _MOST_LISTED)
    rows = [(e.t, f"{short(e.s_a, 4)} – {short(e.s_b, 4)}", e.kind, e.text, family(e.kind)) for e in events]
    left = len(result.events) - len(rows)
    return rows, f"{left} more are in the result file: result.events in Python." if left else ""


def family(kind: str) -> str:
    """ "warning", "zone" or "news"."""
    return "zone" if kind in ZONE_EVENTS else "warning" if kind in EVENTS_BY_WEIGHT and kind not in NEWS else "news"


def _events(events: Sequence[Event]) -> list[Item]:
    """Marks in the middle of where they were, of changes of zones with a line over their extent."""
    items: list[Item] = []
    names = {"zone": "", "news": "note", "warning": "warning"}
    for name, (symbol, face, edge, size) in _MARKS.items():
        found = [event for event in events if (names[family(event.kind)] or event.kind) == name]
        if not found:
            continue
        at = np.array([(e.t, e.s_a, e.s_b) for e in found])
        if name in ZONE_EVENTS:
            gaps = np.full(len(at), np.nan)
            x, y = (np.column_stack([at[:, k], gaps]).ravel() for k in ([0, 0], [1, 2]))
            items.append(Line(x, y, width=0.5))
        texts = [_event_lines(event) for event in found]
        items.append(Marks(at[:, 0], at[:, 1:].mean(axis=1), symbol, name, face, edge, 0.5, size, texts))
    return items


def extent_of(event: Event) -> str:
    """Where it was, in words."""
    to = "" if event.s_a == event.s_b else f" to {short(event.s_b, 4)}"
    return f"s = {short(event.s_a, 4)}{to} m"


def _event_lines(event: Event) -> list[str]:
    """An event in words, line by line."""
    energy = [] if event.energy is None else [f"energy put in: {short(event.energy, 3)} J"]
    return [event.kind, f"t = {short(event.t, 5)} s, {extent_of(event)}", *wrap(event.text, _WIDE)[:12], *energy]


def warnings_of(result: Result) -> list[tuple[Event, int]]:
    """The first event of every kind that calls an answer into question, the worst kind first, and how many there are.

    News that are no warnings come last.
    """
    kinds: dict[str, list[Event]] = {}
    failed = result.message if result.status == "failed" else ""
    for event in sorted(result.events, key=lambda e: (e.kind in NEWS, weight_of_event(e.kind), e.t)):
        if event.kind in EVENTS_BY_WEIGHT and event.text[:80] not in failed:  # that is reported as how it ended
            kinds.setdefault(event.kind, []).append(event)
    return [(found[0], len(found)) for found in kinds.values()]
