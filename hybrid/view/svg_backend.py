"""Small drawings for a notebook cell and the still picture of a report: panels above one another as SVG.

Made by hand: 1 ms and 17 kB for a run of 500 outputs, where matplotlib's SVG takes 50 ms, 47 kB, and 0.4 s to import.
"""

from __future__ import annotations

from html import escape
from typing import NamedTuple

from hybrid.view.figure import Area, Box, Item, Line, Marks, Panel, Text
from hybrid.view.style import GREY

WIDTH = 460.0  # of a drawing, px
_TALLEST, _STRIP, _FOOT = 280.0, 26.0, 24.0  # of a panel with an aspect, of one without, and of the texts below one
_EDGE = 2.0  # left and right
_LETTER = 7.0  # width of a letter, px, at most
_PIXELS = 1.2  # for each point of a line's width


def draw(panels: list[Panel]) -> str:
    """One drawing of all panels, without axes; below each its caption, and the names of its kinds in their colours."""
    parts, y, width = "", 0.0, WIDTH - 2.0 * _EDGE
    for panel in panels:
        (left, right), (low, high) = panel.limits()
        across, up, height = width / (right - left), _STRIP / (high - low), _STRIP
        if panel.aspect is not None:
            across = min(across, _TALLEST / (panel.aspect * (high - low)))
            up = panel.aspect * across
            height = max(up * (high - low), 40.0)
        place = _Place(0.5 * width, 0.5 * (left + right), across, 0.5 * height, 0.5 * (low + high), up)
        size = f'x="{_EDGE:g}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}"'  # what is outside is cut off
        parts += f"<svg {size}>{''.join(_item(item, place) for item in panel.items)}</svg>"
        y += height + _FOOT
        parts += f'<text x="{_EDGE:g}" y="{y - 10:.0f}" fill="{GREY}">{escape(panel.caption)}</text>'
        parts += _names(panel, y - 10)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {y:.0f}" width="100%" role="img" '
        f'aria-label="shape of the cable" font-family="system-ui,sans-serif" font-size="11">{parts}</svg>'
    )


class _Place(NamedTuple):
    """From data to pixels: the middle of the panel in both, and pixels per unit."""

    x0: float
    left: float
    across: float
    y0: float
    low: float
    up: float

    def x(self, value: float) -> float:
        return self.x0 + self.across * (value - self.left)

    def y(self, value: float) -> float:
        return self.y0 - self.up * (value - self.low)


def _item(item: Item, at: _Place) -> str:
    match item:
        case Line():
            points = " ".join(f"{at.x(x):.1f},{at.y(y):.1f}" for x, y in zip(item.x, item.y, strict=True))
            look = f'fill="none" stroke="{item.colour}" stroke-width="{_PIXELS * item.width:g}" stroke-linejoin="round"'
            return f'<polyline points="{points}" {look}/>'
        case Marks():
            look = f'r="{0.5 * item.size:g}" fill="{item.face or "none"}" stroke="{item.edge}"'
            places = zip(item.x, item.y, strict=True)
            return "".join(f'<circle cx="{at.x(x):.1f}" cy="{at.y(y):.1f}" {look}/>' for x, y in places)
        case Area():
            outlines = (" ".join(f"{at.x(x):.1f},{at.y(y):.1f}" for x, y in points) for points in item.outlines)
            return "".join(f'<polygon points="{points}" fill="{item.fill}"/>' for points in outlines)
        case Box(x=(x0, x1), y=(y0, y1)):
            left, top = round(at.x(x0)), at.y(y1)  # in whole pixels, or seams show between neighbours
            size = f'width="{round(at.x(x1)) - left}" height="{at.y(y0) - top:.1f}"'
            return f'<rect x="{left}" y="{top:.1f}" {size} fill="{item.colour}"/>'
        case Text():
            x, y = at.x(item.x) + item.offset[0], at.y(item.y) - item.offset[1]
            anchor, lift = "end" if item.across == "right" else "start", -2.0 if item.up == "bottom" else 10.0
            y = min(max(y + lift, 10.0), 2.0 * at.y0 - 3.0)  # all of the text is in the frame
            look = f'text-anchor="{anchor}" fill="{item.colour}"'
            return f'<text x="{x:.0f}" y="{y:.0f}" {look}>{escape(item.text)}</text>'
    raise TypeError(f"a small drawing does not show {type(item).__name__}")


def _names(panel: Panel, y: float) -> str:
    parts, x, caption = "", WIDTH - _EDGE, _LETTER * len(panel.caption)
    names = {item.label: item.colour for item in panel.items if isinstance(item, Line | Box) and item.label}
    if x - sum(_LETTER * len(name) + 8.0 for name in names) < caption:  # no room beside it
        return ""
    for name, colour in reversed(names.items()):
        parts += f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="end" fill="{colour}">{escape(name)}</text>'
        x -= _LETTER * len(name) + 8.0
    return parts
