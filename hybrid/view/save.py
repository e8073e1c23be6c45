"""Writing pictures, films and reports: files of others are not replaced, and none is left half written."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

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
