"""A result at a glance, as light HTML: title, status, key facts, and a small drawing of shapes and zones.

The drawing is SVG made by hand, so that a notebook cell costs milliseconds and a few kilobytes.
"""

from __future__ import annotations

from html import escape
from itertools import groupby

import numpy as np

from hybrid.store.reader import Result
from hybrid.store.records import Zone
from hybrid.view.decimate import even
from hybrid.view.projections import View, bed_in, extent_in, magnification, telling_times, views_of, whole_zones
from hybrid.view.style import ALARM, BED, BODY, GREY, INK, KIND_COLOURS, LEVEL, SAND, WATER
from hybrid.view.summary import attention, facts_of, length_of

_WIDTH, _TALL, _STRIP = 460.0, 300.0, 26.0  # of the drawing, and of the strip of zones below it, px
_POINTS, _COLUMNS = 120, 230  # on a curve; of the strip: each is two pixels wide
_SHOWN = ("tension", "bend", "slack", "seabed", "errors")  # facts with a line each
_FRAME = "font-family:system-ui,sans-serif;font-size:13px;line-height:1.45;color:#222;background:#fff;padding:10px 12px"
_FRAME += ";border:1px solid #ddd;border-radius:6px;max-width:900px"


def card(result: Result) -> str:
    """The HTML of one result; it holds no script and asks for nothing from outside."""
    facts = facts_of(result)
    first = attention(facts)
    good = result.status == "complete"
    n, s = len(result.times), result.s
    span = f"t = {result.times[0]:.6g} … {result.times[-1]:.6g} s" if n > 1 else "static" if n and good else ""
    head = f"{n} output{'s' * (n != 1)}" + f", {span}" * bool(span) + f"; {len(s)} points on {length_of(result):.6g} m"
    status = result.status if good else result.status_text.splitlines()[0]
    colour = GREY if good else ALARM
    rows = [(f.title, f.text) for f in facts if f.key in _SHOWN and f.weight != "absent"]
    cells = "".join(
        f'<tr><td style="text-align:left;vertical-align:top;white-space:nowrap;padding:1px 10px 1px 0;color:{GREY};'
        f'border:0;background:#fff">{escape(title)}</td><td style="text-align:left;padding:1px 0;color:{INK};'
        f'border:0;background:#fff">{escape(text)}</td></tr>'
        for title, text in rows
    )
    alarms = [f"{fact.title}: {fact.text.splitlines()[0]}" for fact in first if fact.key != "status"]
    alarm = "".join(f'<div style="color:{ALARM}">{escape(_cut(text))}</div>' for text in alarms[:3])
    alarm += f'<div style="color:{ALARM}">and {len(alarms) - 3} more</div>' if len(alarms) > 3 else ""
    drawing = f'<div style="flex:0 1 {_WIDTH:.0f}px;min-width:220px">{picture(result)}</div>' if n else ""
    title = escape(result.title or "(no title)")
    return (
        f'<div style="{_FRAME}"><div style="font-weight:600;font-size:15px">{title}</div>'
        f'<div style="color:{colour}">{escape(_cut(status))}; {escape(head)}</div>{alarm}'
        f'<div style="display:flex;flex-wrap:wrap;gap:14px;margin-top:6px">{drawing}<table style="flex:1 1 280px;'
        f'border-collapse:collapse;font-size:12.5px;margin:0;display:block;border:0">{cells}</table></div></div>'
    )


def _cut(text: str, most: int = 220) -> str:
    return text if len(text) <= most else text[: most - 2].rsplit(" ", 1)[0] + " …"


def picture(result: Result) -> str:
    """SVG: the last shape by zones over earlier ones, seabed and water; below it the zones over time."""
    view = views_of(result)[0]
    drawing, height = _shapes(result, view)
    strip = _strip(result, height) if len(result.times) > 1 and any(result.zones) else ""
    total = height + (_STRIP + 34.0 if strip else 0.0)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:.0f} {total:.0f}" width="100%" role="img" '
        f'aria-label="shape of the cable" font-family="system-ui,sans-serif" font-size="11">{drawing}{strip}</svg>'
    )


def _shapes(result: Result, view: View) -> tuple[str, float]:
    """The shapes, and how high they are, px."""
    box = extent_in(view, result)
    wider, taller = magnification(view, result)
    stretch = np.array([wider, taller])
    extent = np.maximum(np.ptp(box, axis=1) * stretch, 1e-9)
    margin, foot = 14.0, 20.0
    scale = min((_WIDTH - 2 * margin) / extent[0], (_TALL - margin - foot) / extent[1])
    height = max(scale * extent[1], 40.0) + margin + foot
    middle = box.mean(axis=1)

    def to_page(across: np.ndarray, up: np.ndarray) -> np.ndarray:
        x = _WIDTH / 2 + scale * wider * (across - middle[0])
        return np.column_stack([x, (height - foot + margin) / 2 - scale * taller * (up - middle[1])])

    def line(position: np.ndarray, colour: str, width: float) -> str:
        points = to_page(*view.project(position[even(len(position), _POINTS)]))
        text = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        return (
            f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-linejoin="round"/>'
        )

    parts = []
    across = np.array([middle[0] - 0.5 * _WIDTH / scale / wider, middle[0] + 0.5 * _WIDTH / scale / wider])
    bottom = height - foot + 4.0
    bed = bed_in(view, result)
    levels = [(float(result["surface"]), 0.0, WATER, LEVEL)] if "surface" in result and view.upright else []
    levels += [(*bed, SAND, BED)] if bed else []
    for level, rise, fill, edge in levels:
        (x0, y0), (x1, y1) = to_page(across, level + rise * across)
        if min(y0, y1) < bottom:
            parts.append(f'<path d="M{x0:.1f},{y0:.1f}L{x1:.1f},{y1:.1f}V{bottom:.1f}H{x0:.1f}Z" fill="{fill}"/>')
            parts.append(f'<path d="M{x0:.1f},{y0:.1f}L{x1:.1f},{y1:.1f}" stroke="{edge}"/>')
    if len(result.times) > 1:
        earlier = result.at(t=telling_times(result), names=["position"])["position"]
        parts += [line(shape, "#C4C4C4", 0.8) for shape in earlier]
    s, last = result.s, result.position[-1]
    for zone in whole_zones(result.zones[-1]) or [Zone("cable", float(s[0]), float(s[-1]))]:
        where = np.array([zone.s_a, *s[(s > zone.s_a) & (s < zone.s_b)], zone.s_b])
        piece = np.column_stack([np.interp(where, s, last[:, k]) for k in range(3)])
        parts.append(line(piece, KIND_COLOURS.get(zone.kind, INK), 2.4))
    if "attached" in result:
        where = np.column_stack([np.interp(result["attached"], s, last[:, k]) for k in range(3)])
        for x, y in to_page(*view.project(where)):
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{BODY}" stroke="{INK}"/>')
    stretched = [
        f"{name} × {factor:g}"
        for name, factor in zip((view.across_label.split(",")[0], view.up_label), (wider, taller), strict=True)
        if factor > 1.0
    ]
    size = " × ".join(f"{x:.4g}" for x in np.ptp(box, axis=1))
    said = f"{view.across_label} – {view.up_label}, {size} m" + "".join(f", {x}" for x in stretched)
    x = f"{margin:.0f}"
    parts.append(f'<text x="{x}" y="{height - 4:.0f}" fill="{GREY}">{escape(said)}</text>')
    kinds = dict.fromkeys(zone.kind for zones in result.zones for zone in zones)
    at = _WIDTH - margin
    for kind in reversed(kinds):
        colour = KIND_COLOURS.get(kind, INK)
        parts.append(f'<text x="{at:.0f}" y="{height - 4:.0f}" text-anchor="end" fill="{colour}">{escape(kind)}</text>')
        at -= 7.0 * len(kind) + 8.0
    return "".join(parts), height


def _strip(result: Result, top: float) -> str:
    """The zones: s upwards, time to the right; columns that are alike are one."""
    s, times = result.s, result.times
    frames = even(len(times), _COLUMNS)
    length, x0, wide = float(s[-1] - s[0]) or 1.0, 14.0, _WIDTH - 28.0
    edges = np.concatenate([[times[0]], 0.5 * (times[frames[1:]] + times[frames[:-1]]), [times[-1]]])
    x = x0 + wide * (edges - times[0]) / (times[-1] - times[0])
    parts, k = [], 0
    y0 = top + 12.0
    for zones, same in groupby(whole_zones(result.zones[int(i)]) for i in frames):
        n = len(list(same))
        for zone in zones:
            y = y0 + _STRIP * (s[-1] - zone.s_b) / length
            size = f'width="{x[k + n] - x[k] + 0.3:.1f}" height="{_STRIP * (zone.s_b - zone.s_a) / length:.1f}"'
            colour = KIND_COLOURS.get(zone.kind, INK)
            parts.append(f'<rect x="{x[k]:.1f}" y="{y:.1f}" {size} fill="{colour}"/>')
        k += n
    foot = f"{y0 + _STRIP + 14:.0f}"
    said = f"zones: s = 0 (below) to {s[-1]:.5g} m, over t = {times[0]:.5g} … {times[-1]:.5g} s"
    return "".join(parts) + f'<text x="{x0:.0f}" y="{foot}" fill="{GREY}">{said}</text>'
