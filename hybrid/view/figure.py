"""A figure as plain data, and pictures on their way to a file.

Of pictures, films and reports, files of others are not replaced, and none is left half written.

A figure has panels with curves, bands, marks, maps and texts. A back end turns it into a picture. Coordinates are in
the units that the axes name, sizes in points. Items are drawn in the order of their list, but `Area`, `Box` and `Map`
lie behind the grid. An item without a label is not in the legend, and items of a panel with one label are one entry.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROGRAM = "hybrid-cable"
REPORT_MARK = "<!-- hybrid report -->"
COMMENT = f"made by {PROGRAM}"  # in a film
# What a file of each format holds where it is ours: a key of its metadata, or the comment of a page.
_MARKS = {
    ".png": f"Software\0{PROGRAM}",
    ".pdf": f"/Creator ({PROGRAM}",
    ".svg": f"<dc:title>{PROGRAM}</dc:title>",
    ".gif": COMMENT,
    ".mp4": COMMENT,
    ".html": REPORT_MARK,
    ".htm": REPORT_MARK,
}
_METADATA = {".png": "Software", ".pdf": "Creator", ".svg": "Publisher"}  # matplotlib's names of these keys
PICTURES, PAGES = tuple(_METADATA), (".html", ".htm")
DPI = 150
_SEARCHED = 65536  # bytes at the head and at the foot of a file: metadata stand there


def check_target(path: str | Path, formats: Sequence[str], *, overwrite: bool = False) -> Path:
    """The path, if a file of one of the formats (suffixes) may be written there; ResultError says why not."""
    target = Path(path).expanduser()
    if target.is_dir():
        raise ResultError(
            f"{target} is a folder\n    try:      name a file in it, such as {target / 'run'}{formats[0]}"
        )
    if target.suffix.lower() not in formats:
        names = " or ".join(filter(None, (", ".join(formats[:-1]), formats[-1])))
        advice = f"{target.with_suffix(formats[0]).name}"
        if ".html" in formats:
            advice += "; a browser prints it as PDF" * (target.suffix.lower() == ".pdf")
        raise ResultError(
            f"{target}: unknown file format\n    expected: a name that ends in {names}\n    try:      {advice}"
        )
    if not target.parent.is_dir():
        raise ResultError(f"there is no folder {target.parent}\n    try:      mkdir -p {target.parent}")
    if target.exists():
        advice = "another name, or delete the file yourself"
        if not (target.is_file() and os.access(target, os.W_OK)):
            raise ResultError(f"{target} exists and is write-protected\n    try:      {advice}")
        if not (overwrite or is_ours(target)):
            advice = "another name, or --overwrite (overwrite=True in Python)"
            raise ResultError(f"{target} exists and was not made by hybrid\n    try:      {advice}")
    return target


def is_ours(file: Path) -> bool:
    """Whether this program made a file, or it is empty: nothing is lost when it is replaced."""
    try:
        with file.open("rb") as stream:
            head = stream.read(_SEARCHED)
            stream.seek(max(file.stat().st_size - _SEARCHED, 0))
            found = head + b"\n" + stream.read(_SEARCHED)
    except OSError:
        return False
    return not head or _MARKS[file.suffix.lower()].encode() in found


def write_file(target: Path, make: Callable[[Path], object]) -> Path:
    """Let `make` write to a name beside the target, then move it there; ResultError where that fails."""
    new = target.with_name(f".{target.stem}.{os.getpid()}.new{target.suffix}")
    try:
        make(new)
        os.replace(new, target)
    except OSError as error:
        advice = "a folder you may write to, with free space"
        raise ResultError(f"{target} cannot be written\n    detail:   {error}\n    try:      {advice}") from error
    finally:
        with suppress(OSError):
            new.unlink(missing_ok=True)
    return target


def save_figure(figure: Figure, path: str | Path | None, *, overwrite: bool = False) -> Figure:
    """Save a figure as PNG, PDF or SVG, in the format of its name; None: nowhere."""
    if path is not None:
        target = check_target(path, PICTURES, overwrite=overwrite)
        write_file(target, lambda new: _save(figure, new))
    return figure


def _save(figure: Figure, new: Path) -> None:
    kind = new.suffix.lower()
    metadata = {_METADATA[kind]: PROGRAM}
    if kind == ".png" and figure.dpi == DPI and hasattr(figure.canvas, "print_png"):
        # savefig draws it twice, once for the layout.  Of zlib's levels 3 takes half the time of 6, and no more bytes.
        figure.canvas.print_png(new, metadata=metadata, pil_kwargs={"compress_level": 3})
    else:
        figure.savefig(new, dpi=DPI, metadata=metadata)


# The import of matplotlib in a command, which draws a picture and ends.


def import_matplotlib() -> None:
    """Without the help that matplotlib writes for the `set` of each of its classes: a third of its import (0.2 s).

    Before anything is drawn; never where somebody else may ask matplotlib for that help.
    """
    import matplotlib.artist

    def mark(cls: Any) -> None:
        cls.set._autogenerated_signature = True  # by which it knows the methods that it has made

    artist: Any = matplotlib.artist.Artist
    artist._update_set_signature_and_docstring = classmethod(mark)


# Colours, sizes of type, names and units of pictures.
#
# Colours are those of Okabe and Ito, which stay apart for colour-blind eyes. A zone kind has
# one colour on a whole page; grey is what was earlier; sand and water are pale, behind everything.

INK = "#222222"
GREY = "#6E6E6E"  # what was earlier
ALARM = "#C00000"
KIND_COLOURS = {
    "rod": "#D55E00",
    "catenary": "#0072B2",
    "corrected": "#009E73",  # of 0.6
}  # kinds that are not named here are drawn in ink
STONE, STONE_EDGE = "#D9D4CF", "#7A726B"
SAND = "#EEE5D0"
BED = "#8C6D31"
BODY = "#F0E442"
WATER, LEVEL = "#EFF6FA", "#4A90C2"
DOUBT = "#8E63B5"  # of estimated errors
TOUCHDOWN = "#CC79A7"  # where contact begins and ends
END_COLOURS = {"start": "#009E73", "end": "#222222"}
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
    "contact begins",
)  # no warnings


def title_of(name: str) -> str:
    return _NAMES.get(name, name.replace("/", " ").replace("_", " "))


def colour_of(kind: str) -> str:
    return KIND_COLOURS.get(kind, INK)


def earlier_grey(k: int, count: int) -> str:
    """The colour of the k-th of so many earlier curves: later ones are darker."""
    level = round(255 * (0.7 - 0.3 * k / max(count - 1, 1)))
    return f"#{level:02X}{level:02X}{level:02X}"


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
        power += power == -1 and " " in unit  # of "mN m" nobody knows what the first letter is
        return 10.0 ** (-3 * power), ("p", "n", "µ", "m", "", "k", "M", "G", "T")[power + 4] + unit
    return 1.0, unit or "–"


def short(value: float, digits: int) -> str:
    """So many digits, without an exponent where a person would write none."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.9g}" if 1e-4 <= abs(rounded) < 1e6 or rounded == 0.0 else f"{rounded:g}"


def distinct_texts(values: Iterable[float], digits: int = 3) -> list[str]:
    """Numbers with so many digits, or as many more as it takes until different ones look different."""
    numbers = [float(x) for x in values]
    for n in range(digits, 10):
        texts = [short(x, n) for x in numbers]
        if len(set(texts)) == len(set(numbers)):
            break
    return texts if numbers else []


# A figure as plain data: panels with curves, bands, marks, maps and texts. A back end turns it into a picture.


class Line(NamedTuple):
    """A curve, with a gap where x or y is not finite.

    dash: "", "dash" or "dot"; casing: colour of a wider line below it; symbol: marks on its points, or, with
    `last_only`, on the last one; frames (nf, n): its y at the times that a page can show.
    """

    x: np.ndarray
    y: np.ndarray
    label: str = ""
    colour: str = INK
    width: float = 1.3
    dash: str = ""
    casing: str = ""
    symbol: str = ""
    size: float = 3.0
    last_only: bool = False
    frames: np.ndarray | None = None


class Marks(NamedTuple):
    """Points, with matplotlib's names of symbols; texts: lines to read at each, if a page can, the first a heading."""

    x: np.ndarray
    y: np.ndarray
    symbol: str
    label: str = ""
    face: str = INK  # "": hollow
    edge: str = INK
    edge_width: float = 0.8
    size: float = 4.5
    texts: Sequence[Sequence[str]] = ()


class Band(NamedTuple):
    """The area between two curves over x."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    label: str = ""
    colour: str = GREY
    opacity: float = 0.2


class Area(NamedTuple):
    """Filled outlines (n, points, 2): water or sand, or the many strips that a curve has swept."""

    outlines: np.ndarray
    fill: str
    label: str = ""


class Box(NamedTuple):
    """A shaded rectangle; None: all of the panel."""

    x: tuple[float, float] | None
    y: tuple[float, float] | None
    label: str = ""
    colour: str = GREY
    opacity: float = 0.1


class Rule(NamedTuple):
    """Lines across the panel where x (or y) has certain values."""

    axis: str
    at: Sequence[float]
    label: str = ""
    colour: str = GREY
    width: float = 0.9
    dash: str = "dot"


class Map(NamedTuple):
    """A colour for every cell between edges; values (ny, nx), NaN where there is none; shades from `low` to `high`."""

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    name: str
    quantity: str
    unit: str
    shades: Sequence[str]
    low: float
    high: float
    log: bool = False


class Text(NamedTuple):
    """A short text beside a place; a coordinate named in `parts` runs from 0 to 1 over the panel. offset: points."""

    x: float
    y: float
    text: str
    colour: str = INK
    offset: tuple[float, float] = (0.0, 0.0)
    across: str = "left"  # which side of the text is at the place: left or right,
    up: str = "bottom"  # and bottom, baseline or top
    size: float = 7.0
    parts: str = ""


Item = Line | Marks | Band | Area | Box | Rule | Map | Text


class Axis(NamedTuple):
    """What it shows and in which unit; from where to where (None: what the items span).

    peak: the largest value of the quantity at any time; of round-off beside it a panel is not made full.
    """

    name: str
    unit: str
    low: float | None = None
    high: float | None = None
    peak: float | None = None
    log: bool = False
    ticks: tuple[float, ...] = ()
    names: tuple[str, ...] = ()  # in place of the numbers of ticks

    @property
    def label(self) -> str:
        return f"{self.name} ({self.unit})" if self.name else f"({self.unit})" if self.unit else ""


class Panel(NamedTuple):
    """One pair of axes. aspect: length of a unit of y over that of a unit of x, None: free; legend: inside the panel.

    caption: a sentence for the reader of a page; cursor: x is the time, which a page can move.
    """

    key: str
    title: str
    x: Axis
    y: Axis
    items: list[Item]
    aspect: float | None = None
    legend: bool = False
    grid: bool = True
    fill: str = "#FFFFFF"
    caption: str = ""
    cursor: bool = False

    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """From where to where x and y are shown: as given, else what curves, marks and bands span, and 5 % more."""
        return _limits(self.x, self.items, "x"), _limits(self.y, self.items, "y")


class Page(NamedTuple):
    """Panels on a page with a head, a foot and legends.

    mosaic, widths, heights: which panels (keys) stand where, lists in lists for blocks; a cell with the name of a `Map`
    holds its colour bar. legend: for each row below the panels the panels it explains. note: at the foot.
    """

    title: str
    facts: str
    fact_lines: int = 3  # at most
    panels: dict[str, Panel] = {}  # noqa: RUF012  never written to
    mosaic: list[Any] = []  # noqa: RUF012
    widths: Sequence[float] | None = None
    heights: Sequence[float] | None = None
    legend: Sequence[str] = ()
    note: str = ""
    alarm: tuple[bool, bool] = (False, False)  # facts and note in red
    size: tuple[float, float] = (8.0, 6.0)  # inches
    empty: str = ""  # what to say where there is no panel


def _limits(axis: Axis, items: Sequence[Item], name: str) -> tuple[float, float]:
    parts = [getattr(item, name) for item in items if isinstance(item, Line | Marks)]
    bands = [item for item in items if isinstance(item, Band)]
    parts += [y for band in bands for y in ((band.x,) if name == "x" else (band.low, band.high))]
    values = np.concatenate([np.asarray(part, dtype=float) for part in parts] or [np.zeros(1)])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    low, high = low - 0.05 * (high - low), high + 0.05 * (high - low)
    low, high = low if axis.low is None else axis.low, high if axis.high is None else axis.high
    part, peak = (1e-9, max(abs(low), abs(high))) if axis.peak is None else (1e-3, axis.peak)
    least = part * peak if peak > ZERO else 2.0  # of nothing some room on either side
    if high - low < least:
        low, high = 0.5 * (low + high - least), 0.5 * (low + high + least)
    return low, high


def changes_sign(low: float, high: float) -> bool:
    """Whether zero is well inside an axis, and worth a line."""
    return low < -0.1 * (high - low) < 0.1 * (high - low) < high
