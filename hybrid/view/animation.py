"""A film of a result: the cable coloured by zones, seen from one side or two, and the tension along it; mp4 or gif.

Every frame is an output of the result, none is made up between them.  What does not move is drawn once.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.reader import Result
from hybrid.store.records import Zone
from hybrid.view.decimate import even
from hybrid.view.panels import draw_sea, place_along
from hybrid.view.projections import View, aspect_of, extent_in, magnification, views_of, whole_zones
from hybrid.view.save import COMMENT, check_target, write_file
from hybrid.view.scenery import speed_of
from hybrid.view.style import BODY, GREY, INK, KIND_COLOURS, NORMAL, legend_row, mark, new_page, prefix, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".mp4", ".gif")
# A film of 12 to 30 s shows a motion without tiring; at most so many frames are drawn for it, and a gif, which stores
# each of them nearly whole, gets fewer and smaller ones.
_SECONDS, _FRAMES, _RATE = 12.0, {".mp4": 600, ".gif": 240}, {".mp4": 25.0, ".gif": 12.5}
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
        return f"{self.frames} frames{of}, {self.seconds:.3g} s at {self.factor:g} x real time"


def animate(result: Result, path: str | Path, *, overwrite: bool = False) -> Film:
    """Write a film, in the format of its name; ResultError if nothing moves or it cannot be written.

    overwrite: also replace a file that hybrid did not make.
    """
    target = check_target(path, FORMATS, overwrite=overwrite)
    suffix = target.suffix.lower()
    if suffix == ".mp4" and ffmpeg() is None:
        advice = 'pip install "hybrid-cable[video]", or a name that ends in .gif'
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
        factor = float(f"{span / (pause * len(frames)):.3g}")
    seconds = pause * len(frames)
    pictures = _pictures(result, frames, factor, _DPI[suffix])
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


def _pictures(result: Result, frames: np.ndarray, factor: float, dpi: int) -> Iterator[np.ndarray]:
    """Pixels (height, width, 4) of every frame."""
    figure, foot = new_page(result, [f"{factor:g} × real time"])
    figure.set_size_inches(8.0, 5.12)  # both even in pixels, as x264 wants them
    figure.set_dpi(dpi)
    views = views_of(result)
    tall = aspect_of(views, result) < 1.0
    names = ["shape", "second"][: len(views)]
    page: list[Any] = [[*names, "tension"]] if tall else [names, ["tension"] * len(names)]
    ratios: dict[str, Any] = {} if tall else {"height_ratios": [2.2, 1.0]}
    axes = figure.subplot_mosaic(page, **ratios)
    moving = [part for name, view in zip(names, views, strict=True) for part in _shape(axes[name], result, view)]
    moving += _tension(axes["tension"], result)
    clock = figure.text(0.985, 0.985, "", ha="right", va="top", fontsize=11, fontweight="bold", color=INK)
    kinds = dict.fromkeys(zone.kind for zones in result.zones for zone in zones)
    from matplotlib.lines import Line2D

    entries = [(kind, Line2D([], [], color=KIND_COLOURS.get(kind, INK), linewidth=2.0)) for kind in kinds]
    first = Line2D([], [], color="#B5B5B5", linewidth=0.8)
    legend_row(figure, foot + 0.015, [*entries, ("first shape", first)])
    figure.canvas.draw()
    figure.set_layout_engine("none")
    yield from _moved(figure, result, frames, moving, clock)


def _moved(figure: Figure, result: Result, frames: np.ndarray, moving: list[Any], clock: Any) -> Iterator[np.ndarray]:
    canvas: Any = figure.canvas
    artists = [artist for artist, _ in moving]
    for artist in (*artists, clock):
        artist.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    span = float(np.ptp(result.times)) / max(len(result.times) - 1, 1)
    places = int(np.clip(1 - np.floor(np.log10(span)), 0, 6))
    for i in frames:
        canvas.restore_region(still)
        for artist, move in moving:
            move(artist, int(i))
            artist.axes.draw_artist(artist)
        clock.set_text(f"t = {result.times[i]:.{places}f} s")
        figure.draw_artist(clock)
        yield np.asarray(canvas.buffer_rgba()).copy()


def _shape(ax: Axes, result: Result, view: View) -> list[tuple[Any, Any]]:
    """The surroundings, and what moves in them: artists, and how each is moved to an output."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    draw_sea(ax, view, result)
    ax.plot(*view.project(result.position[0]), color="#B5B5B5", linewidth=0.8, zorder=1)
    wider, taller = magnification(view, result)
    factors = zip((view.across_label.split(",")[0], view.up_label), (wider, taller), strict=True)
    stretch = "".join(f", {name} × {factor:g}" for name, factor in factors if factor > 1.0)
    above = "" if "z" in (view.across_label, view.up_label) else " from above"
    style(ax, f"shape{above}{stretch}", f"{view.across_label} (m)", f"{view.up_label} (m)")
    ax.update_datalim(extent_in(view, result).T)
    ax.margins(0.06)
    ax.autoscale_view()
    ax.set_aspect(taller / wider, adjustable="datalim")
    s = result.s

    def along(line: Any, i: int) -> None:
        _set_pieces(
            line, result, i, lambda where: np.column_stack(view.project(place_along(where, s, result.position[i])))
        )

    def points(where: np.ndarray) -> Any:
        def move(dots: Any, i: int) -> None:
            dots.set_data(*view.project(place_along(where, s, result.position[i])))

        return move

    def dots(where: np.ndarray, **look: Any) -> tuple[Any, Any]:
        line = Line2D([], [], **look)
        ax.add_line(line)
        return line, points(where)

    cable = LineCollection([], linewidths=2.2, zorder=3, capstyle="round")
    ax.add_collection(cable, autolim=False)
    moving = [(cable, along), dots(s[[0]], zorder=4, **mark("s")), dots(s[[-1]], zorder=4, **mark("^"))]
    if "attached" in result:
        moving.append(dots(result["attached"], zorder=3.5, **mark("o", BODY) | {"markersize": 7}))
    return moving


def _tension(ax: Axes, result: Result) -> list[tuple[Any, Any]]:
    """The tension along the cable over its range of all times."""
    from matplotlib.collections import LineCollection

    tension, s = result.tension, result.s
    factor, unit = prefix("N", float(np.abs(tension).max()))
    ax.fill_between(s, tension.min(axis=0) * factor, tension.max(axis=0) * factor, color=GREY, alpha=0.18, linewidth=0)
    style(ax, "tension, and its range over all times", "s (m)", f"tension ({unit})")
    ax.title.set_fontsize(NORMAL)
    if len(s) > 1:
        ax.set_xlim(s[0], s[-1])
    line = LineCollection([], linewidths=1.8, zorder=3)
    ax.add_collection(line, autolim=False)

    def move(pieces: Any, i: int) -> None:
        row = tension[i] * factor
        _set_pieces(pieces, result, i, lambda where: np.column_stack([where, np.interp(where, s, row)]))

    return [(line, move)]


def _set_pieces(line: Any, result: Result, i: int, curve: Any) -> None:
    """Cut a curve into the zones of an output, each in its colour."""
    s = result.s
    zones = whole_zones(result.zones[i]) or [Zone("cable", float(s[0]), float(s[-1]))]
    inside = ((s > zone.s_a) & (s < zone.s_b) for zone in zones)
    line.set_segments([curve(np.array([z.s_a, *s[here], z.s_b])) for z, here in zip(zones, inside, strict=True)])
    line.set_color([KIND_COLOURS.get(zone.kind, INK) for zone in zones])


# ---- files ----------------------------------------------------------------------------------------


def _write_mp4(path: Path, pictures: Iterator[np.ndarray], rate: float) -> None:
    first = next(pictures)
    height, width = first.shape[:2]
    program = ffmpeg()
    assert program is not None  # asked before
    given = ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", f"{rate:.6g}", "-i", "-"]
    # yuv420p and faststart: what every browser and every office program plays
    kept = [
        "-metadata",
        f"comment={COMMENT}",
        "-an",
        "-c:v",
        "libx264",
        "-crf",
        _CRF,
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
    ]
    command = [program, "-y", "-loglevel", "error", *given, *kept, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None and process.stderr is not None
        try:
            process.stdin.write(first.tobytes())
            for picture in pictures:
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:  # it has given up, and says why
            pass
        said = process.stderr.read().decode("utf-8", "replace").strip()
    if process.returncode:
        raise OSError(said or f"{program} left with code {process.returncode}")


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
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000.0 / rate),
        loop=0,
        optimize=False,
        comment=COMMENT,
    )
