"""Figures for paper and films: pages, panels and frames drawn by matplotlib.

Never by pyplot: no window, no display, no state that outlives a call. This file is imported when something is drawn.

A film (mp4 or gif) shows the cable coloured by zones, from one side or two, and the tension along it.  Every frame is
an output of the result, none is made up between them.  What does not move is drawn once.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from hybrid.errors import ResultError, command_for
from hybrid.store.reader import Result
from hybrid.view.curves import Stretches, along, even, stretches_of
from hybrid.view.figure import (
    ALARM,
    COMMENT,
    DPI,
    GREY,
    INK,
    NORMAL,
    SMALL,
    Area,
    Band,
    Box,
    Item,
    Line,
    Map,
    Marks,
    Page,
    Panel,
    Rule,
    Text,
    check_target,
    colour_of,
    prefix,
    short,
    write_file,
)
from hybrid.view.lines import AllLines, bodies_in, shapes, speed_of, tensions, views_of_lines
from hybrid.view.panels import cable, framed, page_of, profiles, sea
from hybrid.view.projections import View, aspect_of, pieces_of, views_of

_DASHES: dict[str, Any] = {"": "-", "dash": (0, (4, 1.5)), "dot": ":"}
_ENTRIES = 8  # of a legend, in a row
_FEW = 4  # labels of a legend inside a panel that stand below each other
_SAMPLE, _LETTER = 0.45, 0.055  # inches of its samples of curves with their margins, and of a letter
_LEFT = 0.0125  # of the width of a page: where lines of text begin

# ---- items ----------------------------------------------------------------------------------------


def artists_of(ax: Axes, item: Item, label: str) -> list[Artist]:
    """Draw one item; what was made for it, in the order of drawing."""
    look: dict[str, Any]
    match item:
        case Line():
            if (thinned := stretches_of(item.x, item.y)) is not None:
                return _range_and_mean(ax, item, thinned, label)
            return [_line(ax, item, label)]
        case Marks():
            look = {"linestyle": "", "marker": item.symbol, "markersize": item.size, "label": label}
            look |= {"markerfacecolor": item.face or "none", "markeredgecolor": item.edge}
            return [ax.add_line(Line2D(item.x, item.y, markeredgewidth=item.edge_width, **look))]
        case Band():
            look = {"color": item.colour, "alpha": item.opacity, "linewidth": 0, "label": label}
            return [ax.fill_between(item.x, item.low, item.high, **look)]
        case Area():
            # Edges close the seams; as pixels in a PDF, where each outline would weigh as much as a curve.
            look = {"color": item.fill, "lw": 0.4, "rasterized": len(item.outlines) > 1, "label": label}
            return [ax.add_collection(PolyCollection(list(item.outlines), **look), autolim=False)]
        case Box():
            return [_box(ax, item, label)]
        case Rule():
            draw = ax.axvline if item.axis == "x" else ax.axhline
            look = {"color": item.colour, "linewidth": item.width, "linestyle": _DASHES[item.dash]}
            return [draw(at, label="_" * (k > 0) + label, **look) for k, at in enumerate(item.at)]
        case Map():
            return [_map(ax, item)]
        case Text():
            look = {"ha": item.across, "va": item.up, "fontsize": item.size, "color": item.colour}
            # Only text at "data" outside the axes is left out; a pair of "data" is drawn there, and shrinks the axes.
            pair = tuple("axes fraction" if axis in item.parts else "data" for axis in "xy")
            look["xycoords"] = pair if item.parts else "data"
            place = (item.x, item.y)
            return [ax.annotate(item.text, place, xytext=item.offset, textcoords="offset points", **look)]


def _line(ax: Axes, item: Line, label: str) -> Artist:
    look: dict[str, Any] = {"color": item.colour, "linewidth": item.width, "linestyle": _DASHES[item.dash]}
    if item.casing:
        look["path_effects"] = [Stroke(linewidth=item.width + 1.4, foreground=item.casing), Normal()]
    if item.symbol:
        look |= {"marker": item.symbol, "markersize": item.size, "markevery": [-1] if item.last_only else None}
    return ax.add_line(Line2D(item.x, item.y, label=label, solid_capstyle="round", **look))


def _range_and_mean(ax: Axes, item: Line, thinned: Stretches, label: str) -> list[Artist]:
    """A curve that swings too often to be seen, as the range and the mean of each stretch."""
    band = ax.fill_between(thinned.x, thinned.low, thinned.high, color=item.colour, alpha=0.35, linewidth=0)
    x, y = np.append(thinned.x, item.x[-1]), np.append(thinned.mean, item.y[-1] if item.symbol else thinned.mean[-1])
    mean = item._replace(x=x, y=y, width=min(item.width, 1.0))
    every = f"mean and range of each {short(float(thinned.x[1] - thinned.x[0]), 2)} s"
    look: dict[str, Any] = {"fontsize": SMALL, "color": GREY, "va": "top", "xycoords": "axes fraction"}
    look["bbox"] = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.8}
    return [band, _line(ax, mean, label), ax.annotate(every, (0.02, 0.98), **look)]


def _box(ax: Axes, item: Box, label: str) -> Artist:
    look: dict[str, Any] = {"color": item.colour, "alpha": item.opacity, "linewidth": 0, "label": label}
    if item.x is None:
        return ax.axhspan(*(item.y or ax.get_ylim()), **look)
    part = (0.0, 1.0) if item.y is None else np.interp(item.y, ax.get_ylim(), (0.0, 1.0))
    return ax.axvspan(*item.x, *part, **look)


def _map(ax: Axes, item: Map) -> Artist:
    colours = LinearSegmentedColormap.from_list(item.name, item.shades)
    norm = LogNorm(item.low, item.high, clip=True) if item.log else Normalize(item.low, item.high)
    image = ax.pcolorfast(item.x, item.y, np.ma.masked_invalid(item.values), cmap=colours, norm=norm)
    image.set_label(f"{item.name}: {item.quantity} ({item.unit})")
    return image


# ---- panels ---------------------------------------------------------------------------------------


def draw_panel(panel: Panel, ax: Axes, *, legend: bool | None = None) -> dict[str, Artist]:
    """Draw a panel on any Axes; the images of its maps, by name. legend: inside, overriding the panel."""
    (left, right), (bottom, top) = panel.limits()
    _style(ax, panel)
    free = panel.aspect is not None  # then the panel shows more than these limits, in one direction
    ax.set_xlim(left, right, auto=free)
    ax.set_ylim(bottom, top, auto=free)
    seen: set[str] = set()
    images = {}
    for k, item in enumerate(panel.items):
        label = getattr(item, "label", "") or "_"
        artists = artists_of(ax, item, label if label not in seen else f"_{label}")
        seen.add(label)
        behind = isinstance(item, Area | Box | Map)  # the grid is at 0.5
        for n, artist in enumerate(artists):
            if free and isinstance(item, Marks) and _is_within(item, panel.limits()):
                artist.set_clip_on(False)  # a mark on the rim is drawn whole
            artist.set_zorder((0.1 if behind else 1.0) + 0.001 * k + 0.0001 * n)
        if isinstance(item, Map):
            images[item.name] = artists[0]
    if panel.grid and not free and bottom < -0.1 * (top - bottom) and 0.1 * (top - bottom) < top:  # 0 is well inside
        ax.axhline(0.0, color=GREY, linewidth=0.6, zorder=0.9)
    if panel.aspect is not None:
        # Of its limits matplotlib may cut what is not data; water and sand reach farther and do not count.
        x, y = 0.055 * (right - left), 0.055 * (top - bottom)
        ax.dataLim.set_points(np.array([(left + x, bottom + y), (right - x, top - y)]))
        ax.set_aspect(panel.aspect, adjustable="datalim")
    if panel.legend if legend is None else legend:
        look: Any = {"fontsize": SMALL, "framealpha": 0.75, "edgecolor": "none", "handlelength": 2.0, "borderpad": 0.2}
        ax.legend(ncols=_columns(ax, sorted(seen - {"_"})), **look)
    return images


def _columns(ax: Axes, labels: Sequence[str]) -> int:
    """Columns of a legend inside a panel: one of few labels, of more as many as its width has room for."""
    if len(labels) <= _FEW:
        return 1
    figure = ax.get_figure(root=True)
    assert figure is not None
    wide = ax.get_position().width * figure.get_size_inches()[0]
    return max(1, min(len(labels), int(wide / (_SAMPLE + _LETTER * max(map(len, labels))))))


def _is_within(marks: Marks, limits: tuple[tuple[float, float], tuple[float, float]]) -> bool:
    """Whether all marks are where a panel shows what is there."""
    return all(
        bool(np.all((low <= x) & (x <= high))) for x, (low, high) in zip((marks.x, marks.y), limits, strict=True)
    )


def _style(ax: Axes, panel: Panel) -> None:
    ax.set_title(panel.title, loc="left", fontsize=NORMAL, color=INK, fontweight="bold")
    ax.set_facecolor(panel.fill)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(linewidth=0.6, color=GREY)
    if panel.grid:
        ax.grid(color="#000000", alpha=0.07, linewidth=0.6)
    ax.set_axisbelow(True)
    axes: Any = ((ax.xaxis, panel.x, ax.set_xscale), (ax.yaxis, panel.y, ax.set_yscale))
    for axis, of, scale in axes:
        axis.set_label_text(of.label, fontsize=NORMAL)
        if of.log:  # numbers that people write; over more decades only powers of ten have room
            scale("log")
            wide = of.high is not None and of.low is not None and of.high / of.low > 300.0
            axis.set_major_locator(LogLocator(10.0, subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=12))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        else:
            axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], min_n_ticks=3))
            ax.ticklabel_format(axis=axis.axis_name, useOffset=False, scilimits=(-4, 6))
            axis.get_offset_text().set_fontsize(SMALL)
            if of.ticks:
                axis.set_ticks(of.ticks, of.names or None)
    _small_ticks(ax)


def _small_ticks(ax: Axes) -> None:
    ax.tick_params(labelsize=SMALL, width=0.6, length=2.5, color=GREY, labelcolor=INK)


def new_axes() -> Axes:
    """Axes of a new figure."""
    figure = Figure(figsize=(6.4, 4.0), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure.add_subplot()


# ---- pages ----------------------------------------------------------------------------------------


def draw_page(page: Page) -> Figure:
    """A figure with all panels, named by their keys, and its texts."""
    figure = Figure(figsize=page.size, dpi=DPI)
    FigureCanvasAgg(figure)
    inch = 1.0 / page.size[1]
    _text(figure, 1.0 - 0.09 * inch, page.title, fontsize=10, fontweight="bold", color=INK)
    look: dict[str, Any] = {"fontsize": NORMAL, "color": ALARM if page.alarm[0] else GREY}
    lines = _text(figure, 1.0 - 0.3 * inch, page.facts, page.fact_lines, **look)
    foot = 0.0
    if page.note:
        look = {"fontsize": SMALL, "color": ALARM if page.alarm[1] else GREY}
        foot = (0.108 + 0.12 * _text(figure, 0.048 * inch, page.note, 2, "bottom", **look)) * inch
    top, bottom = 1.0 - (0.34 + 0.14 * lines) * inch, foot + 0.33 * inch  # the legend is below, the head above
    body = (0.0, bottom, 1.0, top - bottom)
    figure.set_layout_engine(ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05, wspace=0.02, hspace=0.02, rect=body))
    if page.empty:
        figure.text(0.5, 0.5, page.empty, ha="center", fontsize=NORMAL, color=GREY)
    if page.panels:
        axes = figure.subplot_mosaic(page.mosaic, width_ratios=page.widths, height_ratios=page.heights)
        for key, panel in page.panels.items():
            images = draw_panel(panel, axes[key], legend=False if key in page.legend else None)
            for name in axes.keys() & images.keys():
                _colour_bar(figure, axes[name], images[name])
        _share_labels([(axes[key], panel) for key, panel in page.panels.items()])
        if page.legend:
            _legends(figure, axes, page, foot)
    return figure


def _share_labels(panels: Sequence[tuple[Axes, Panel]]) -> None:
    """Of panels above one another with one axis, of s or t, only the lowest names it, and numbers it if it can."""
    for ax, panel in panels:
        here = ax.get_position()
        for other, below in panels:
            there = other.get_position()
            column = abs(here.x0 - there.x0) < 1e-6 and there.y0 < here.y0
            if column and panel.aspect is None and panel.x.label == below.x.label:
                ax.set_xlabel("")
                ax.tick_params(labelbottom=panel.limits()[0] != below.limits()[0])


def _legends(figure: Figure, axes: dict[str, Axes], page: Page, foot: float) -> None:
    """Rows below the panels; what has no room in one goes to the next."""
    first, *others = [list(zip(*axes[key].get_legend_handles_labels(), strict=True)) for key in page.legend]
    second = [*first[_ENTRIES:], *(entry for more in others for entry in more)]
    rows = [row[:_ENTRIES] for row in (first, second) if row]
    heights = (0.165, 0.015) if len(rows) > 1 else (0.09,)[: len(rows)]
    look: dict[str, Any] = {"fontsize": SMALL, "handlelength": 1.6, "columnspacing": 1.5, "borderaxespad": 0.0}
    look |= {"loc": "lower center", "ncols": _ENTRIES, "frameon": False, "borderpad": 0.1, "labelcolor": INK}
    for row, y in zip(rows, heights, strict=True):
        figure.legend(*zip(*row, strict=True), bbox_to_anchor=(0.5, foot + y / page.size[1]), **look)


def _colour_bar(figure: Figure, ax: Axes, image: Any) -> None:
    look: dict[str, Any] = {}
    if isinstance(image.norm, LogNorm):
        look = {"ticks": LogLocator(subs=(1.0, 2.0, 5.0)), "format": "%g", "extend": "min", "extendfrac": 0.03}
    bar = figure.colorbar(image, cax=ax, **look)
    bar.set_label(image.get_label(), fontsize=NORMAL)
    bar.outline.set(linewidth=0.6, edgecolor=GREY)
    _small_ticks(ax)
    ax.minorticks_off()


def _text(figure: Figure, y: float, text: str, most: int = 1, va: str = "top", **look: Any) -> int:
    """At most so many lines from the left edge, cut to the width of the page; how many. A $ in them is a $."""
    rest, rows = " ".join(text.split()), list[str]()
    line = figure.text(_LEFT, y, "", va=va, parse_math=False, **look)
    while rest and len(rows) < most:
        end, cut = len(rest), " …" * (len(rows) == most - 1)
        line.set_text(rest)
        while (share := (1.0 - 2.0 * _LEFT) * figure.bbox.width / max(1.0, line.get_window_extent().width)) < 1.0:
            end = min(int(share * end), end - 1)
            end = max(rest.rfind(" ", 0, end + 1), 0) or end  # lines end between words
            line.set_text(rest[:end].rstrip(" ,;:" if cut else None) + cut)
        rows, rest = [*rows, line.get_text()], rest[end:].lstrip()
    line.set_text("\n".join(rows))
    return len(rows)


# ---- films ----------------------------------------------------------------------------------------

Moving = Callable[[int], tuple[str, dict[str, list[Item]]]]


def film(page: Page, moving: Moving, frames: Iterable[int], dpi: int) -> Iterator[np.ndarray]:
    """Pixels (height, width, 4) of every frame: the page, which is drawn once, and on it what moves.

    moving: the time in words, and by the keys of their panels the items of a frame.
    """
    figure = draw_page(page)
    figure.set_dpi(dpi)
    canvas: Any = figure.canvas
    axes = {ax.get_label(): ax for ax in figure.axes}
    look: dict[str, Any] = {"fontsize": 11, "fontweight": "bold", "color": INK, "animated": True}
    across, high = figure.get_size_inches()
    below = 0.0 if across >= 6.0 else 0.2 / high  # on a narrow page beside the subtitle: the title needs the line
    clock = figure.text(0.985, 0.985 - below, "", ha="right", va="top", **look)
    canvas.draw()
    figure.set_layout_engine("none")
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for i in frames:
        canvas.restore_region(still)
        text, parts = moving(int(i))
        for key, items in parts.items():
            for artist in [artist for item in items for artist in artists_of(axes[key], item, "_")]:
                axes[key].draw_artist(artist)
                artist.remove()
        clock.set_text(text)
        figure.draw_artist(clock)
        yield np.asarray(canvas.buffer_rgba()).copy()


# --- films -------------------------------------------------------------------------------------

FORMATS = (".mp4", ".gif")
# A film of 12 to 30 s shows a motion without tiring; at most so many frames are drawn for it, and a gif, which stores
# each of them nearly whole, gets fewer and smaller ones.
_SECONDS, _FRAMES, _RATE = 12.0, {".mp4": 600, ".gif": 240}, {".mp4": 25.0, ".gif": 12.5}
WIDE, _NARROW = 8.0, 6.0  # inches: the page, and the width below which views stand below each other
_DPI = {".mp4": 150, ".gif": 90}
_CRF = "23"  # of x264: its usual quality; lines stay sharp


class Film(NamedTuple):
    """What was written: where, how many frames, how long (s), and how much faster than real time it runs."""

    path: Path
    frames: int
    seconds: float
    factor: float
    outputs: int

    @property
    def text(self) -> str:
        of = f" of {self.outputs} outputs" if self.frames < self.outputs else ""
        return f"{self.frames} frames{of}, {short(self.seconds, 3)} s at {self.factor:g} x real time"


def animate(result: Result, path: str | Path, *, overwrite: bool = False, width: float = WIDE) -> Film:
    """Write a film, in the format of its name; ResultError if nothing moves or it cannot be written.

    overwrite: also replace a file that hybrid did not make.  width: of the page of one cable, inches; on a narrow one
    words are larger beside the picture, and views stand below each other, for telephones.
    """
    target = check_target(path, FORMATS, overwrite=overwrite)
    suffix = target.suffix.lower()
    if suffix == ".mp4" and ffmpeg() is None:
        advice = f"{command_for('video')}, or a name that ends in .gif"
        raise ResultError(f"{target} needs the program ffmpeg, which is not here\n    try:      {advice}")
    n = len(result.times)
    if n < 2:
        held = "one output" if n else "no output"
        raise ResultError(f"the result holds {held}: nothing moves\n    try:      hybrid plot without --animate")
    factor = speed_of(result, _SECONDS)
    span = float(np.ptp(result.times))
    frames = _frames(result, min(_FRAMES[suffix], int(span / factor * _RATE[suffix]) + 1))
    pause = span / factor / len(frames)  # of each frame, s
    if suffix == ".gif":
        pause = max(round(pause, 2), 0.02)  # it counts in hundredths, and viewers slow down what is faster
        factor = float(f"{short(span / (pause * len(frames)), 3)}")
    seconds = pause * len(frames)
    pictures = _pictures(result, frames, factor, _DPI[suffix], width)
    write = _write_mp4 if suffix == ".mp4" else _write_gif
    write_file(target, lambda new: write(new, pictures, 1.0 / pause))
    return Film(target, len(frames), seconds, factor, n)


def ffmpeg() -> str | None:
    """The program that writes mp4: of this machine, or of the package imageio-ffmpeg; None: neither."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # not installed; or installed without the program
        return None


def _frames(result: Result, most: int) -> np.ndarray:
    """Outputs nearest to even times: a film runs at an even pace, whatever the outputs do."""
    times = result.times
    at = np.linspace(times[0], times[-1], min(most, len(times)))
    right = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    return right - (at - times[right - 1] < times[right] - at)


# ---- frames ---------------------------------------------------------------------------------------


def _pictures(result: Result, frames: np.ndarray, factor: float, dpi: int, width: float) -> Iterator[np.ndarray]:
    """Pixels (height, width, 4) of every frame; width: of the page, inches."""

    every = AllLines(result)
    line = every.alone
    around = every.as_result if line is None else line
    drawn: Callable[[View, int], list[Item]]
    tension: Callable[[int], list[Item]]
    bands: list[Item]
    if line is None:
        views, width, panel = views_of_lines(every), WIDE, tensions(every)
        legend = [(every.label(name), colour, 1.8) for name, colour in every.colours.items()]
        bands = [item for item in panel.items if isinstance(item, Band)]
        drawn, tension = partial(shapes, result, every), lambda i: tensions(every, i).items
    else:
        views, panel = views_of(line), profiles(line, "tension", title="tension, and its range over all times")
        legend = [(x, colour_of(x), 2.0) for x in dict.fromkeys(zone.kind for zones in line.zones for zone in zones)]
        bands = [next(item for item in panel.items if isinstance(item, Band))._replace(opacity=0.18)]
        drawn, tension = lambda view, i: [*cable(line, view, i), *bodies_in(result, view, i)], _by_zones(line)
    seen = dict(zip(("shape", "second"), views, strict=False))
    none, first = np.zeros(0), "first shape" + "s" * (line is None)
    panels = {}
    for name, view in seen.items():  # what does not move; empty lines bring names into the legend
        items: list[Item] = [*sea(around, view), *(Line(none, none, *x) for x in legend)]
        items += [Line(*view.project(x.position[0]), first, "#B5B5B5", 0.8) for x in every.lines.values()]
        panels[name] = framed(around, view, items)
    names, panels["tension"] = list(seen), panel._replace(items=bands)
    tall = line is not None and aspect_of(list(seen.values()), line) < 1.0
    mosaic: list[Any] = [[*names, "tension"]] if tall else [names, ["tension"] * len(names)]
    heights = None if tall else [2.2, 1.0]
    if width < _NARROW and not tall:
        mosaic, heights = [[name] for name in panels], [2.2] * len(names) + [1.4]
    # both sides even in pixels, as x264 wants them
    size = tuple(2.0 * round(0.5 * x * dpi) / dpi for x in (width, 5.12 if width >= _NARROW else 1.04 * width))
    look = {"mosaic": mosaic, "heights": heights, "legend": ["shape"], "size": size}
    page = page_of(result, [f"{factor:g} × real time"], panels=panels, **look)
    span = float(np.ptp(every.times)) / max(every.outputs - 1, 1)
    places = int(np.clip(1 - np.floor(np.log10(span)), 0, 6))

    def moving(i: int) -> tuple[str, dict[str, list[Item]]]:
        items = {name: drawn(view, i) for name, view in seen.items()}
        return f"t = {every.times[i]:.{places}f} s", items | {"tension": tension(i)}

    return film(page, moving, frames, dpi)


def _by_zones(line: Result) -> Callable[[int], list[Item]]:
    """What draws the tension along a line at an output, in the colours of its zones."""
    curves = along(line, "tension")
    scale, _ = prefix("N", float(np.abs(curves.values).max()))
    left = np.where(np.diff(curves.s, append=np.inf) == 0.0, np.nextafter(curves.s, -np.inf), curves.s)

    def tension(i: int) -> list[Item]:
        items: list[Item] = []
        for kind, s in pieces_of(line, i):
            last = np.nextafter(s[-1], -np.inf)  # the value on the left, where zones meet
            where = np.array([s[0], *left[(left > s[0]) & (left < last)], last])
            items.append(Line(where, np.interp(where, left, curves.values[i] * scale), kind, colour_of(kind), 1.8))
        return items

    return tension


# ---- files ----------------------------------------------------------------------------------------


def _write_mp4(path: Path, pictures: Iterator[np.ndarray], rate: float) -> None:
    first = next(pictures)
    height, width = first.shape[:2]
    program = ffmpeg()
    assert program is not None  # asked before
    given = ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", f"{short(rate, 6)}", "-i", "-"]
    # yuv420p and faststart: what every browser and every office program plays
    coded = ["-c:v", "libx264", "-crf", _CRF, "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    kept = ["-metadata", f"comment={COMMENT}", "-an", *coded]
    command = [program, "-y", "-loglevel", "error", *given, *kept, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None and process.stderr is not None
        try:
            process.stdin.write(first.tobytes())
            for picture in pictures:
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:  # it has stopped, and reports why
            pass
        report = process.stderr.read().decode("utf-8", "replace").strip()
    if process.returncode:
        raise OSError(report or f"{program} left with code {process.returncode}")


def _write_gif(path: Path, pictures: Iterator[np.ndarray], rate: float) -> None:
    from PIL import Image

    images = [Image.fromarray(picture[..., :3]) for picture in pictures]
    # One palette for all, of frames spread over the film: colours that changed from frame to frame would flicker.
    some = [images[k] for k in even(len(images), 4)]
    width, height = images[0].size
    sheet = Image.new("RGB", (width, height * len(some)))
    for k, image in enumerate(some):
        sheet.paste(image, (0, k * height))
    palette = sheet.quantize(128, dither=Image.Dither.NONE)
    frames = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    look: dict[str, Any] = {"duration": round(1000.0 / rate), "loop": 0, "optimize": False, "comment": COMMENT}
    frames[0].save(path, save_all=True, append_images=frames[1:], **look)
