"""A film of a result: the cable coloured by zones, from one side or two, and the tension along it; mp4 or gif.

Every frame is an output of the result, none is made up between them.  What does not move is drawn once.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError, command_for
from hybrid.store.reader import Result
from hybrid.view.curves import along, even
from hybrid.view.figure import COMMENT, Band, Item, Line, check_target, colour_of, prefix, short, write_file
from hybrid.view.lines import AllLines, bodies_in, shapes, tensions, views_of_lines
from hybrid.view.panels import cable, framed, page_of, profiles, sea
from hybrid.view.projections import View, aspect_of, pieces_of, views_of
from hybrid.view.scenery import speed_of

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
    from hybrid.view.matplotlib_backend import film

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
