"""Results of short runs, whose file is written in one go when they have ended, and results in memory: as one that grew."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from bits import Stopping, differences

import hybrid
from hybrid.accuracy import passes
from hybrid.simulation.progress import RESULT, Progress
from hybrid.store import whole_file, writer
from hybrid.store.format import ArrayContents, Field, Header, MemoryTarget
from hybrid.store.reader import Result, written_result
from hybrid.store.records import FileContents
from hybrid.store.whole_file import LateFile
from hybrid.store.writer import Recorder
from tests.inside import calls_of
from tests.said import assert_same_results
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

TIMES = ("cpu", "created", "effort_cpu")  # that differ from run to run


def described(errors: bool = False) -> dict[str, Any]:
    section = {"length": 2.0, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 1e5}
    motion = {"heave": {"amplitude": 0.2, "period": 2.0}, "ramp": 2.0}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(1.5, 0, 0, motion=motion), model="catenary", mesh=16, time=(2.0, 0.05),
        output={"every": 0.1, "points": 11, "errors": errors}
    )  # fmt: skip


def contents(path: Path) -> dict[str, Any]:
    """All that a file has, and how, but for times and checkpoints."""
    with h5py.File(path) as file:
        found: dict[str, Any] = {"": {k: str(v) for k, v in file.attrs.items() if k not in TIMES}}

        def visit(name: str, item: Any) -> None:
            if not isinstance(item, h5py.Dataset) or name.startswith("checkpoint/") or name.split("/")[-1] in TIMES:
                return
            said = {k: str(v) for k, v in item.attrs.items() if k in ("units", "description", "frame")}
            dims = [dim.label for dim in item.dims]
            found[name] = str(np.asarray(item[()]).tolist()), item.dtype, item.chunks, item.maxshape, said, dims

        file.visititems(visit)
    return found


def of_two_lines() -> dict[str, Any]:
    """The same cable as two lines that meet."""
    scene = described()
    (section,), ends = scene.pop("cable")["sections"], scene.pop("ends")
    points = {name: {k: v for k, v in end.items() if k != "kind"} for name, end in ends.items()}
    line = {
        "end": "middle", "sections": [section | {"length": 1.0}], "model": scene.pop("model"), "mesh": {"cells": 8},
        "initial": scene.pop("initial"),
    }  # fmt: skip
    del scene["mesh"]
    lines = {"first": line | {"start": "start"}, "second": line | {"start": "end"}}
    return scene | {"points": points | {"middle": {"initial_guess": [0.75, 0, -0.5]}}, "lines": lines}


@pytest.mark.parametrize("scene", [described(False), described(True), of_two_lines()], ids=["plain", "errors", "lines"])
def test_a_file_that_is_late_is_as_one_that_grew(
    scene: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = calls_of(monkeypatch, LateFile, "place", lambda file: file.path)
    monkeypatch.setattr(writer, "pause", lambda _: 1e9)  # none are due, however busy the machine is
    hybrid.run(scene, tmp_path / "late.h5").close()
    assert tmp_path / "late.h5" in made
    made.clear()
    monkeypatch.setattr(writer, "pause", lambda _: -1.0)  # outputs are due at once
    hybrid.run(scene, tmp_path / "grew.h5").close()
    assert not made
    assert contents(tmp_path / "late.h5") == contents(tmp_path / "grew.h5")
    assert {x.name for x in tmp_path.iterdir()} == {"grew.h5", "late.h5"}


def test_the_result_is_read_from_memory_as_from_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writer, "pause", lambda _: 1e9)  # nothing is due, however busy the machine is
    monkeypatch.setattr(whole_file, "WAITS", 1e9)
    with hybrid.run(described(True), tmp_path / "run.h5") as mine, hybrid.open(tmp_path / "run.h5") as its:
        hybrid.run(described(), tmp_path / "run.h5").close()  # neither hears of what takes their place
        assert isinstance(mine._contents, ArrayContents) and isinstance(its._contents, FileContents)
        assert_same_results(mine, its)
        assert len(mine.refresh().names) < len(its.names)  # of the file that is there now
    monkeypatch.setattr(whole_file, "MOST_STAYING", 0)
    with hybrid.run(described(), tmp_path / "run.h5") as result:
        assert isinstance(result._contents, FileContents)


def test_rows_are_added_to_a_copy_of_one_that_was_written_in_one_go(tmp_path: Path) -> None:
    """In chunks of some 64 kB."""
    scene = described() | {"output": {"every": 0.005, "points": 101}}
    longer = scene | {"time": {"duration": 3.0, "step": 0.05}}
    hybrid.run(scene, tmp_path / "run.h5").close()
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["position"].chunks == (27, 101, 3) and file["position"].shape == (401, 101, 3)
    hybrid.resume(tmp_path / "run.h5", until=3.0).close()
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["position"].chunks == (27, 101, 3) and file["position"].shape == (601, 101, 3)
    hybrid.run(longer, tmp_path / "longer.h5").close()
    found = differences(tmp_path / "longer.h5", tmp_path / "run.h5")
    assert [x for x in found if x != "other values: scene" and "message" not in x] == []


@pytest.mark.long
def test_it_is_there_when_the_run_is_stopped_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Stopping(monkeypatch, checkpoints=False)  # a step a call
    hybrid.run(described(True), tmp_path / "whole.h5").close()
    calls: list[int] = []
    for stop, status in ((10, "interrupted"), (60, "complete")):  # in the result, or in the runs to compare with
        calls.clear()
        asked = nullcontext(lambda stop=stop: calls.append(0) or len(calls) >= stop)
        with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
            patched.setattr(passes, "interrupts", lambda asked=asked: asked)
            hybrid.run(described(True), tmp_path / "run.h5")
        with hybrid.open(tmp_path / "run.h5") as result:
            assert result.status == status and (result.times[-1] == 2.0) == (status == "complete")
            assert "errors are not estimated yet" in result.pending
            assert result.pending in result.status_text and not result.done
        hybrid.resume(tmp_path / "run.h5").close()
        assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
    assert {x.name for x in tmp_path.iterdir()} == {"run.h5", "whole.h5"}


def test_who_hears_of_the_progress_can_open_it(tmp_path: Path) -> None:
    seen: list[str] = []

    def look(progress: Progress) -> None:
        if progress.name == RESULT:
            with hybrid.open(tmp_path / "run.h5") as result:
                seen.append(result.status)

    hybrid.run(described(True), tmp_path / "run.h5", progress=look).close()
    assert seen


# --- a result in memory holds the same, under the same names, as one that is written into a file ---

EXAMPLES = Path(__file__).parents[2] / "examples"
Pair = tuple[Result, Result]


@pytest.fixture(scope="module", params=["motion", "at rest"])
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["time.duration=1", "output.errors=false"])
    path = tmp_path_factory.mktemp("pair") / "x.h5"
    compute = hybrid.run if request.param == "motion" else hybrid.static
    compute(scene, path).close()
    with compute(scene) as memory, hybrid.open(path) as file:
        yield memory, file


def test_they_are_the_same(pair: Pair) -> None:
    assert isinstance(pair[0]._contents, ArrayContents)
    assert_same_results(*pair)


def test_closed_it_keeps_what_was_read_and_nothing_else() -> None:
    text = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["output.errors=false"])
    result = hybrid.static(text)
    tension = result.tension
    result.close()
    assert result.tension is tension
    with pytest.raises(hybrid.ResultError, match="was not read before the result was closed"):
        result.position  # noqa: B018
    with pytest.raises(hybrid.ResultError, match="closed"):
        result.label("tension")


def _recorder(target: MemoryTarget) -> Recorder:
    fields, fixed = [Field("x", "m", "a place", (2,), ("s",))], [(Field("k", "", "a number"), np.array(2.0))]
    return Recorder(target, Header(np.array([0.0, 1.0]), fields, (), {"title": "t"}, {"scene": "a: 1"}, fixed))


def test_a_run_that_fails_says_so() -> None:
    target = MemoryTarget()
    with pytest.raises(ValueError, match="why"), _recorder(target) as recorder:
        recorder.save(0.0, {"x": np.zeros(2)}, [("rod", 0.0, 1.0)])
        raise ValueError("why")
    result = written_result(target)
    assert (result.status, result.message, result.x.shape) == ("failed", "why", (1, 2))


def test_what_cannot_be_kept_is_refused() -> None:
    recorder = _recorder(MemoryTarget())
    with pytest.raises(hybrid.ResultError, match="not finite"):
        recorder.save(0.0, {"x": np.array([0.0, np.nan])}, [("rod", 0.0, 1.0)])
    with pytest.raises(hybrid.ResultError, match="k has shape"):
        recorder.replace({"k": np.zeros(3)})
    with pytest.raises(hybrid.ResultError, match="increasing"):
        Recorder(MemoryTarget(), Header(np.array([1.0, 0.0]), (), (), {}))
    with pytest.raises(hybrid.ResultError, match="written by the recorder itself"):
        Recorder(MemoryTarget(), Header(np.array([0.0, 1.0]), (), (), {"status": "x"}))


# A result of several lines in memory: the same numbers as in a file, each line closed by itself.


ROPE = {"length": 60, "mass": 4, "diameter": 0.04, "axial_stiffness": 1e7}
SCENE = network_scene(
    {"west": {"position": [-40, 0, -50]}, "east": {"position": [40, 0, -50]},
     "float": {"initial_guess": [0, 0, -10], "mass": 200, "volume": 1.0}},
    {name: line_between(name, "float", ROPE, mesh=8) for name in ("west", "east")}, title="A float on two legs",
    fluid={"density": 1025}
)  # fmt: skip


def test_arrays_equal_those_of_a_file(tmp_path: Path) -> None:
    result, written = hybrid.static(SCENE), hybrid.static(SCENE, tmp_path / "legs.h5")
    assert isinstance(result._source, MemoryTarget), "no file is made in memory"
    assert result.names == written.names and tuple(result.lines) == ("west", "east") == tuple(written.lines)
    for name in written.lines:
        assert_same_results(result.lines[name], written.lines[name])
    for name in written.names:
        assert np.array_equal(result[name], written[name]) and result.dims(name) == written.dims(name)
    with result.line("west") as line:
        tension = line.tension
    with result.line("west") as again:
        assert np.array_equal(again.tension, tension), "a line that was closed can be opened again"
    written.close()
