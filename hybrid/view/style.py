"""How pictures look: colours, sizes of type, units, axes, and the head and foot of a page.

Colours are those of Okabe and Ito, which stay apart for colour-blind eyes.  A zone kind has
one colour on a whole page; grey is what was earlier; sand and water are pale, behind everything.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from hybrid.errors import EVENTS_BY_WEIGHT, weight_of_event
from hybrid.store.reader import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, GREY, ALARM = "#222222", "#6E6E6E", "#C00000"
KIND_COLOURS = {
    "rod": "#D55E00",
    "catenary": "#0072B2",
    "corrected": "#009E73",
}  # kinds that are not named here are drawn in ink
SAND, BED, BODY = "#EEE5D0", "#8C6D31", "#F0E442"
WATER, LEVEL = "#EFF6FA", "#4A90C2"
DOUBT = "#D55E00"  # of estimated errors
POINT_COLOURS = ("#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
SMALL, NORMAL = 7.0, 8.0  # type sizes in points, for a page 8 inches wide
ZERO = 1e-12  # SI; below this a force or moment of any real cable is round-off
_NAMES = {"theta": "angle to z", "phi": "azimuth", "bending_moment": "|bending moment|", "shear": "|shear|"}
_NAMES |= {"contact": "contact force"} | {x: f"position {x}" for x in "xyz"}
NEWS = (
    "stability not judged",
    "end rotated in",
    "static friction neglected",
    "bending at clamp neglected",
    "bending at point load neglected",
    "zones fixed",
)  # no warnings


def title_of(name: str) -> str:
    return _NAMES.get(name, name.replace("/", " ").replace("_", " "))


def earlier_grey(k: int, count: int) -> str:
    return str(0.7 - 0.3 * k / max(count - 1, 1))


def mark(symbol: str, face: str = INK) -> dict[str, Any]:
    edge = {"markeredgecolor": INK, "markeredgewidth": 0.8}
    return {"linestyle": "", "marker": symbol, "markersize": 4.5, "markerfacecolor": face, **edge}


def prefix(unit: str, peak: float) -> tuple[float, str]:
    """Factor and unit that bring the largest value between 1 and 1000 where engineers do so."""
    if unit == "rad":
        return 180.0 / math.pi, "°"
    if unit == "1/m" and ZERO < peak < 0.01:
        return 1e3, "1/km"
    if unit == "m":
        return (1e3, "mm") if ZERO < peak < 0.01 else (1e-3, "km") if peak >= 1e4 else (1.0, "m")
    if unit.replace("/", " ").split(" ")[0] in ("N", "J", "W", "Pa") and peak > ZERO:
        power = min(max(math.floor(math.log10(peak) / 3.0 + 1e-12), -4), 4)
        return 10.0 ** (-3 * power), ("p", "n", "µ", "m", "", "k", "M", "G", "T")[power + 4] + unit
    return 1.0, unit or "–"


def style(ax: Axes, title: str, across: str = "", up: str = "") -> None:
    from matplotlib.ticker import MaxNLocator

    ax.set_title(title, loc="left", fontsize=NORMAL, color=INK, fontweight="bold")
    ax.tick_params(labelsize=SMALL, width=0.6, length=2.5, color=GREY, labelcolor=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(linewidth=0.6, color=GREY)
    ax.grid(color="#000000", alpha=0.07, linewidth=0.6)
    ax.set_axisbelow(True)
    for axis, label in ((ax.xaxis, across), (ax.yaxis, up)):
        axis.set_label_text(label, fontsize=NORMAL)
        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], min_n_ticks=3))
        axis.get_offset_text().set_fontsize(SMALL)
    ax.ticklabel_format(useOffset=False, scilimits=(-4, 5))


def open_up(ax: Axes, peak: float) -> None:
    """Keep round-off from filling the panel: show at least 0.1 % of the largest value.  Mark where signs change."""
    low, high = ax.get_ylim()
    least = 1e-3 * peak if peak > ZERO else 2.0
    if high - low < least:
        ax.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
    low, high = ax.get_ylim()
    if low < -0.1 * (high - low) < 0.1 * (high - low) < high:
        ax.axhline(0.0, color=GREY, linewidth=0.6, zorder=1)


def new_page(result: Result, facts: list[str]) -> tuple[Figure, float]:
    """A figure of 1200 by 900 pixels, with head and foot; and how high the latter is, as a part of the page.

    Panels will be between the two, with room for two rows of legend below them.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(8.0, 6.0), dpi=150)
    FigureCanvasAgg(figure)
    foot = _head_and_foot(figure, result, facts)
    body = (0.0, foot + 0.055, 1.0, 0.865 - foot)  # left, bottom, width, height; the legend is below, the head above
    figure.set_layout_engine(ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05, wspace=0.02, hspace=0.02, rect=body))
    if len(result.times) == 0:
        figure.text(0.5, 0.5, "no output was saved", ha="center", fontsize=NORMAL, color=GREY)
    return figure, foot


def legend_row(figure: Figure, y: float, entries: list[tuple[str, Any]]) -> None:
    """One row of (name, mark), centred, its foot at the height y of the page."""
    look: dict[str, Any] = {"fontsize": SMALL, "handlelength": 1.6, "columnspacing": 1.5, "borderaxespad": 0.0}
    look |= {"loc": "lower center", "bbox_to_anchor": (0.5, y), "ncols": 8, "frameon": False, "borderpad": 0.1}
    if entries:
        figure.legend([mark for _, mark in entries], [name for name, _ in entries], labelcolor=INK, **look)


def _head_and_foot(figure: Figure, result: Result, facts: list[str]) -> float:
    """Title and facts above the panels, warnings below; the height of the latter, as a part of the page."""
    n, complete = len(result.times), result.status == "complete"
    head = [] if complete else [result.status_text]
    if n:
        span = f"{n} outputs, t = {result.times[0]:.5g} … {result.times[-1]:.5g} s"
        head.append(span if n > 1 else "static" if complete else f"one output, t = {result.times[0]:.5g} s")
    _line(figure, 0.985, result.title or "(no title)", fontsize=10, fontweight="bold", color=INK)
    _line(figure, 0.95, "; ".join([*head, *facts]), fontsize=NORMAL, color=GREY if complete else ALARM)
    events = [e for e in result.events if e.kind in EVENTS_BY_WEIGHT]
    events.sort(key=lambda e: (weight_of_event(e.kind), e.t))
    if not events:
        return 0.0
    kinds = [e.kind for e in events if e.kind not in NEWS]
    names = ", ".join(k + f" (× {kinds.count(k)})" * (kinds.count(k) > 1) for k in dict.fromkeys(kinds))
    note = "; ".join(dict.fromkeys(e.text for e in (events[:1] if kinds else events)))
    note = (f"Warning: {names}; at t = {events[0].t:.4g} s: " if kinds else "Note: ") + note
    return 0.018 + 0.02 * _line(figure, 0.008, note, 2, "bottom", fontsize=SMALL, color=ALARM if kinds else GREY)


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
