"""Films: frames are outputs, their number is bounded, their pace is what is said; and what cannot be made is refused."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from reported import reported

import hybrid
from hybrid.errors import ResultError
from hybrid.store.tables import TradeTable
from hybrid.view import matplotlib_backend as backend
from hybrid.view.figure import KIND_COLOURS, is_ours
from hybrid.view.matplotlib_backend import animate
from hybrid.view.several_runs import plot_trade


def test_a_gif_moves_at_the_pace_that_is_said(tmp_path: Path) -> None:
    made = backend.animate(reported(), tmp_path / "run.gif")
    with Image.open(made.path) as image:
        assert image.n_frames == made.frames == 21 and image.info["loop"] == 0
        seconds = made.frames * image.info["duration"] / 1000
        frames = []
        for k in (0, 10, 20):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB"), float))
    assert seconds == pytest.approx(made.seconds) and 10.0 / seconds == pytest.approx(made.factor, rel=0.01)
    assert np.abs(frames[0] - frames[1]).max() > 100, "the cable moves"
    rod = np.array([int(KIND_COLOURS["rod"][k : k + 2], 16) for k in (1, 3, 5)])
    near = [int((np.abs(frame - rod).max(axis=2) < 30).sum()) for frame in frames]
    assert near[2] > 2 * near[0], "rod comes after half the time"
    assert [x.name for x in tmp_path.iterdir()] == ["run.gif"]


def test_a_narrow_page_for_telephones(tmp_path: Path) -> None:
    """The clock, which has the same size in inches, is wider beside the page; the cable moves there as well."""
    with Image.open(backend.animate(reported(outputs=3), tmp_path / "run.gif", width=4.4).path) as image:
        size, first = image.size, np.asarray(image.convert("RGB"), float)
        image.seek(1)
        second = np.asarray(image.convert("RGB"), float)
    assert size == (396, 412) and np.abs(second - first).max() > 100


@pytest.mark.long
def test_an_mp4_plays_everywhere(tmp_path: Path) -> None:
    program = backend.ffmpeg()
    if program is None:
        pytest.skip("no ffmpeg on PATH and no package imageio-ffmpeg: an mp4 cannot be written here")
    made = backend.animate(reported(), tmp_path / "run.mp4")
    said = subprocess.run([program, "-i", str(made.path), "-f", "null", "-"], capture_output=True, text=True).stderr
    assert "h264" in said and "yuv420p" in said and "1200x768" in said
    counted = [int(x) for x in re.findall(r"frame=\s*(\d+)", said)]
    assert counted and counted[-1] == made.frames


@pytest.mark.long
def test_the_number_of_frames_is_bounded_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(backend._FRAMES, ".gif", 24)
    made = backend.animate(reported(outputs=151, points=21), tmp_path / "run.gif")
    assert made.frames <= 24 and f"{made.frames} frames of 151 outputs" in made.text
    assert "of" not in backend.animate(reported(outputs=5), tmp_path / "few.gif").text.split(",")[0]


def test_frames_are_the_outputs_nearest_to_even_times() -> None:
    result = reported(outputs=101)
    assert backend._frames(result, 11).tolist() == list(range(0, 101, 10))
    assert backend._frames(result, 1000).tolist() == list(range(101))


@pytest.mark.parametrize("outputs", [0, 1])
def test_what_does_not_move_is_refused(tmp_path: Path, outputs: int) -> None:
    with pytest.raises(ResultError, match="nothing moves"):
        backend.animate(reported(outputs=outputs), tmp_path / "run.gif")
    assert not list(tmp_path.iterdir())


def test_without_ffmpeg_an_mp4_is_refused_with_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "ffmpeg", lambda: None)
    with pytest.raises(ResultError, match=r"needs the program ffmpeg(.|\n)*\[video\]"):
        backend.animate(reported(), tmp_path / "run.mp4")


def test_a_failing_ffmpeg_is_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "ffmpeg"
    broken.write_text("#!/bin/sh\necho 'no such codec' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(backend, "ffmpeg", lambda: str(broken))
    with pytest.raises(ResultError, match="no such codec"):
        backend.animate(reported(), tmp_path / "run.mp4")
    assert [x.name for x in tmp_path.iterdir()] == ["ffmpeg"]


# What is written: the format of the name, only over files of this program, and whole or not at all.


Write = Callable[..., Any]


def trade(_: Any, path: Path, **more: Any) -> Any:
    return plot_trade(TradeTable("t", "1%", 1.0, 1.0, None, None, (), (), (), 0), path, **more)


WRITERS: list[tuple[Write, str]] = [
    *((hybrid.plot, f"run.{suffix}") for suffix in ("png", "pdf", "svg")),
    (hybrid.plot_zones, "zones.png"), (trade, "trade.svg"), (hybrid.report, "run.html"), (hybrid.report, "run.HTM"),
    (animate, "run.gif"),
]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(("write", "name"), WRITERS, ids=[name for _, name in WRITERS])
def test_a_file_of_ours_is_replaced_and_another_is_not(write: Write, name: str, tmp_path: Path) -> None:
    result, file = reported(outputs=3), tmp_path / name
    write(result, file)
    assert is_ours(file)
    made = file.stat().st_ino
    write(result, str(file))
    assert file.stat().st_ino != made and [x.name for x in tmp_path.iterdir()] == [name]
    file.write_bytes(b"a holiday")
    with pytest.raises(ResultError, match=r"exists and was not made by hybrid\n    try: .*--overwrite"):
        write(result, file)
    assert file.read_bytes() == b"a holiday"
    write(result, file, overwrite=True)
    assert is_ours(file)


def test_a_picture_of_another_program_is_not_ours(tmp_path: Path) -> None:
    for name in ("a.png", "a.pdf", "a.svg"):
        Figure().savefig(tmp_path / name)
        assert not is_ours(tmp_path / name)
    (tmp_path / "empty.png").touch()
    assert is_ours(tmp_path / "empty.png")  # nothing is lost


@pytest.mark.parametrize(
    ("write", "name", "words"),
    [
        (hybrid.report, "run.pdf", "run.pdf: unknown file format\n    expected: .* .html or .htm"),
        (hybrid.report, "run", "unknown file format"),
        (hybrid.plot, "run.html", "unknown file format\n    expected: .* .png, .pdf or .svg"),
        (hybrid.plot_zones, "run.jpg", "unknown file format"),
        (animate, "run.png", "unknown file format\n    expected: .* .mp4 or .gif"),
        (hybrid.plot, "no/run.png", "there is no folder .*no\n    try: "),
        (hybrid.plot, ".", "is a folder\n    try: .*run.png"),
        (animate, "run.avi", "ends in .mp4 or .gif"),
        (animate, "missing/run.gif", "there is no folder"),
        (animate, ".", "is a folder"),
    ],
)
def test_a_name_that_cannot_be_written_is_refused(write: Write, name: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ResultError, match=words):
        write(reported(outputs=2), tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.parametrize(("write", "name"), WRITERS, ids=[name for _, name in WRITERS])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    write: Write, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, file = reported(outputs=3), tmp_path / name

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr(os, "replace", full)
        with pytest.raises(ResultError, match=r"cannot be written\n    detail: .*No space left"):
            write(result, file)
    assert not list(tmp_path.iterdir())
    write(result, file)
    before = file.read_bytes()
    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(ResultError, match="No space left"):
        write(result, file)
    assert file.read_bytes() == before and len(list(tmp_path.iterdir())) == 1
