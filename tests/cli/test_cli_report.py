"""hybrid report and hybrid plot --animate: what they write, say and refuse."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.view import matplotlib_backend
from tests.called import Call

# A wire of two sections, the second thicker: the larger radius holds at the seam.
SCENE = """\
title: a wire that swings
cable:
  sections:
    - {length: 1.0, mass: 1.0, axial_stiffness: 1.0e5, bending_stiffness: 0.01, min_bend_radius: 0.2, damping: 1.0}
    - {length: 1.0, mass: 1.0, axial_stiffness: 1.0e5, bending_stiffness: 0.01, min_bend_radius: 500, damping: 1.0}
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: {kind: free, force: {value: [5, 0, 0], until: 0.02}}
initial: equilibrium
model: {kind: zones, zones: [{catenary: 1.0, cells: 5}, {rod: 1.0, cells: 5}]}
time: {duration: 0.1, step: 0.005}
output: {every: 0.02, points: 5}
"""


@pytest.fixture(autouse=True)
def folder(call: Call) -> None:
    """Where run.h5 is."""
    hybrid.run(hybrid.parse_scene(SCENE), "run.h5", progress=False)


@pytest.mark.needs("zarr")
def test_a_folder_that_is_no_study_is_refused(call: Call) -> None:
    code, _, err = call("report", ".")
    assert code == 1 and "is no study" in err


def test_a_result_is_not_compared_with_itself(call: Call) -> None:
    code, _, err = call("report", "run.h5", "run.h5")
    assert code == 1 and "compared with itself" in err and "bug" not in err


def test_report_writes_a_page_beside_the_result_and_says_its_size(call: Call) -> None:
    code, out, err = call("report", "run.h5")
    size = Path("run.html").stat().st_size
    assert (code, out, err) == (0, f"{size / 1e6:.1f} MB -> run.html\n", "")
    assert call("report", "run.h5", "-o", "other.html", "-q") == (0, "", "") and Path("other.html").is_file()
    assert call("report", "run.h5")[0] == 0, "its own page is replaced"


def test_report_gives_facts_to_programs(call: Call) -> None:
    code, out, _ = call("report", "run.h5", "--json")
    (said,) = (json.loads(line) for line in out.splitlines())
    assert code == 0 and said["event"] == "done" and said["file"] == "run.html" and said["status"] == "complete"
    facts = {fact["key"]: fact for fact in said["facts"]}
    with hybrid.open("run.h5") as result:
        assert facts["tension"]["values"]["tension"] == result["envelope/tension_max"].max() >= result.tension.max()
    assert facts["bend"]["weight"] == "alarm" and facts["bend"]["values"]["allowed"] == 500.0
    (limit,) = facts["limits"]["values"]["limits"]
    assert limit["limit"] == "min_bend_radius" and limit["broken"] and facts["limits"]["weight"] == "plain"


@pytest.mark.long  # 0.9 s
def test_report_gives_facts_of_every_line_to_programs(call: Call) -> None:
    """Those of several lines together, and of each those that one cable has."""
    rope = {"length": 12, "mass": 2, "diameter": 0.02, "axial_stiffness": 1e5, "max_tension": 20}
    points = {name: {"position": [x, 0, 0]} for name, x in (("a", -10), ("b", 0), ("c", 11))}
    lines = {"west": {"start": "a", "end": "b"}, "east": {"start": "b", "end": "c"}}
    lines = {name: line | {"sections": [rope], "mesh": {"cells": 8}} for name, line in lines.items()}
    with hybrid.run({"points": points, "lines": lines, "time": {"duration": 0.2, "step": 0.05}}, "two.h5") as result:
        said = json.loads(call("report", "two.h5", "--json")[1])
        whole = {fact["key"]: fact for fact in said["facts"]}
        assert set(said["lines"]) == {"west", "east"} and whole["status"]["values"]["status"] == "complete"
        for name, line in result.lines.items():
            facts = {fact["key"]: fact for fact in said["lines"][name]}
            assert {"tension", "bend", "slack", "limits", "errors", "status"} <= set(facts)
            assert facts["tension"]["values"]["tension"] == line["envelope/tension_max"].max()
            (limit,) = facts["limits"]["values"]["limits"]
            assert limit["broken"] == (line["envelope/tension_max"].max() > 20.0)
    assert "lines" not in json.loads(call("report", "run.h5", "--json")[1])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("report", "run.h5", "-o", "."), "is a folder"),
        (("report", "run.h5", "-o", "missing/run.html"), "there is no folder missing"),
        (("report", "run.h5", "-o", "run.h5"), "unknown file format"),
        (("report", "run.h5", "-o", "run.pdf"), "ends in .html or .htm"),
        (("report", "other.h5"), "there is no file"),
        (("plot", "run.h5", "--animate", "-o", "run.avi"), "ends in .mp4 or .gif"),
        (("plot", "run.h5", "--animate", "--zones"), "one at a time"),
        (("plot", "run.h5", "--animate", "--times", "0"), "without --zones or --animate"),
    ],
)
def test_what_cannot_be_written_is_refused(call: Call, arguments: tuple[str, ...], words: str) -> None:
    code, out, err = call(*arguments)
    assert code == 1 and not out and words in err and ("    try:      " in err or "    expected: " in err)
    with hybrid.open("run.h5") as result:
        assert len(result.times) == 6


@pytest.mark.long
def test_a_file_of_others_is_replaced_only_with_overwrite(call: Call) -> None:
    for command, name in (("plot", "run.png"), ("report", "run.html")):
        Path(name).write_bytes(b"a holiday")
        code, _, err = call(command, "run.h5")
        assert code == 1 and "was not made by hybrid" in err and Path(name).read_bytes() == b"a holiday"
        assert call(command, "run.h5", "--overwrite")[0] == 0 and call(command, "run.h5")[0] == 0


def test_a_picture_that_may_not_be_written_stops_a_run_before_it_begins(call: Call) -> None:
    Path("scene.yaml").write_text(SCENE)
    Path("scene.png").write_bytes(b"a holiday")
    code, _, err = call("run", "scene.yaml", "--plot")
    assert code == 1 and "scene.png exists and was not made by hybrid" in err and not Path("scene.h5").exists()


@pytest.mark.long
def test_a_film_is_an_mp4_where_that_can_be_written_else_a_gif(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as bare:
        bare.setattr(matplotlib_backend, "ffmpeg", lambda: None)
        code, out, err = call("plot", "run.h5", "--animate")
    assert code == 0 and "it is a gif" in err and out.endswith("-> run.gif\n") and out.startswith("6 frames, ")
    assert Path("run.gif").read_bytes().startswith(b"GIF89a")
    if matplotlib_backend.ffmpeg() is None:
        pytest.skip("no ffmpeg on PATH and no package imageio-ffmpeg: an mp4 cannot be written here")
    code, out, err = call("plot", "run.h5", "--animate")
    assert (code, err) == (0, "") and out.endswith("-> run.mp4\n") and Path("run.mp4").read_bytes()[4:8] == b"ftyp"


def test_a_film_for_programs(call: Call) -> None:
    code, out, _ = call("plot", "run.h5", "--animate", "-o", "film.gif", "--json")
    said = json.loads(out)
    assert code == 0 and said["frames"] == 6 and said["file"] == "film.gif" and said["factor"] > 0.0


def test_the_allowed_radius_is_in_the_file_and_changes_nothing_else(call: Call) -> None:
    with hybrid.open("run.h5") as result:
        assert result["min_bend_radius"].tolist() == [0.2, 0.2, 0.2, 500.0, 500.0]
        assert result["right/min_bend_radius"].tolist() == [500.0]
        assert result["bending_stiffness"].tolist() == [0.01] * 5
    free = hybrid.run(
        hybrid.parse_scene(SCENE.replace("min_bend_radius: 0.2, ", "").replace("min_bend_radius: 500, ", ""))
    )
    assert "min_bend_radius" not in free
    with hybrid.open("run.h5") as result:
        assert np.array_equal(free.position, result.position) and np.array_equal(free.tension, result.tension)


def test_a_report_needs_neither_kernels_nor_matplotlib(call: Call) -> None:
    code = "import hybrid, sys; hybrid.report(hybrid.open('run.h5'), 'run.html'); "
    code += "assert not {'numba', 'matplotlib', 'pydantic'} & {m.partition('.')[0] for m in sys.modules}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
