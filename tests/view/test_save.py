"""What is written: the format of the name, only over files of this program, and whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from reported import reported

import hybrid
from hybrid.errors import ResultError
from hybrid.store.tradeoff_table import TradeTable
from hybrid.view.animation import animate
from hybrid.view.figure import is_ours
from hybrid.view.study_report import plot_trade

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
