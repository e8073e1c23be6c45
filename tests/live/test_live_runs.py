"""Runs from the live view: progress, frames as they come, stop, an older result that is not replaced unasked; results."""

from __future__ import annotations

import asyncio
import signal
import time
from pathlib import Path

import extras
import pytest

pytestmark = extras.of_file("starlette", "uvicorn", "websockets")

from viewed import SCENE, Page, served

import hybrid
from hybrid.live import session as playing
from hybrid.live.session import Playback
from hybrid.live.workers import WatchedRun, Workers
from tests.scenes import span


@pytest.mark.long
def test_a_run_is_followed_stopped_and_played(tmp_path: Path) -> None:
    scene, result = tmp_path / "scene.yaml", tmp_path / "scene.h5"
    scene.write_text(
        SCENE.replace("duration: 4.0, step: 0.05", "duration: 4000.0, step: 0.01") + "output: {every: 1}\n"
    )
    with served(scene) as (address, _):
        page = Page(address)
        page.hear("picture")
        page.ask(do="stop")
        assert "no run" in page.hear("refused")["text"]
        page.ask(do="run")
        first = page.hear("frames")
        assert first["begin"] == 0 and first["running"] and len(first["head"]["heads"]) == 1
        page.ask(do="run", replace=True)
        assert "under way" in page.hear("refused")["text"]
        more = page.hear(lambda m: m["is"] == "frames" and m["begin"] + len(m["frames"]) > 5)
        times = [frame["t"] for frame in more["frames"]]
        assert times == sorted(times) and times[-1] >= 5.0
        page.ask(do="stop")
        ended = page.hear(lambda m: m["is"] == "state" and m["run"] is not None and not m["run"]["running"])
        assert ended["run"]["ended"] == "interrupted"
        last = page.hear(lambda m: m["is"] == "frames" and not m["running"])
        with hybrid.open(result) as stored:
            assert stored.status == "interrupted" and len(stored.times) > 5
            assert last["frames"][-1]["t"] == pytest.approx(stored.times[-1])
        before = result.stat().st_mtime_ns
        page.ask(do="run")
        assert page.hear("ask")["file"] == "scene.h5"
        assert result.stat().st_mtime_ns == before
        page.edit(SCENE + "# changed\n")
        page.ask(do="run", replace=True)
        assert "save" in page.hear("refused")["text"], "a run reads the file"
        page.close()
    with served(result) as (address, _):
        page = Page(address)
        found = page.hear("frames")
        assert not found["running"] and found["head"]["title"] == "A line"
        page.ask(do="edit", text="x", base=0)
        assert "cannot be changed" in page.hear("refused")["text"]
        page.close()
    assert sorted(x.name for x in tmp_path.iterdir()) == ["scene.h5", "scene.yaml"]


@pytest.mark.long
@pytest.mark.parametrize("delay", [0.0, 0.05, 0.3, 0.8])
def test_a_run_is_stopped_while_it_starts(tmp_path: Path, delay: float) -> None:
    """Also by what a background shell starts, whose SIGINT is ignored: before the process is made, while it imports."""
    scene = tmp_path / "scene.yaml"
    # In water: without damping this motion ends with an error after 200 s of it, which take 0.7 s.
    in_water = SCENE.replace("environment:\n", "environment:\n  fluid: {density: 1025}\n")
    scene.write_text(in_water.replace("duration: 4.0", "duration: 40000.0"))
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with served(scene) as (address, _):
            page = Page(address)
            page.ask(do="run")
            time.sleep(delay)
            page.ask(do="stop")
            ended = page.hear(lambda m: m["is"] == "state" and m["run"] is not None and not m["run"]["running"], 120.0)
            assert ended["run"]["ended"] == "interrupted" and "stopped" in ended["run"]["text"]
            page.ask(do="stop")
            assert "no run" in page.hear("refused")["text"]
            page.close()
    finally:
        signal.signal(signal.SIGINT, before)


def test_frames_of_a_long_run_are_every_second_or_fourth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.h5"
    hybrid.run(hybrid.parse_scene(SCENE + "output: {every: 0.1}\n"), file)
    with hybrid.open(file) as result:
        times = result.times
    assert len(times) == 41
    every = Playback(file)
    assert every.read() == (0, True)
    assert [frame["t"] for frame in every.frames] == pytest.approx(times)
    assert every.read() == (41, False), "nothing is new"
    monkeypatch.setattr(playing, "MOST_FRAMES", 12)
    few = Playback(file)
    few.read()
    assert [frame["t"] for frame in few.frames] == pytest.approx(times[::4])
    assert few.head["facts"] and few.status.startswith("complete")


def test_what_is_no_result_is_said(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    file.write_bytes(b"\x89HDF\r\n\x1a\n nothing")
    broken = Playback(file)
    assert broken.read()[1] and "run.h5" in broken.problem and not broken.frames


@pytest.mark.long
def test_a_scene_whose_name_begins_with_a_hyphen_is_no_option(tmp_path: Path) -> None:
    scene = tmp_path / "-rf.yaml"
    scene.write_text(SCENE.replace("duration: 4.0", "duration: 0.1"))
    run = WatchedRun(scene, tmp_path / "-rf.h5", lambda: None)
    asyncio.run(run.watch())
    assert run.state["ended"] == "complete", run.state
    assert sorted(x.name for x in tmp_path.iterdir()) == ["-rf.h5", "-rf.yaml"]


def test_another_run_of_as_many_outputs_is_shown(tmp_path: Path) -> None:
    """Its text stood beside the frames of the run before."""
    file, given = tmp_path / "a.h5", {"time": (1, 0.1), "output": {"every": 0.5}}
    hybrid.run(span(**given), output=file).close()
    played = Playback(file)
    played.read()
    other = span(**given)
    other["ends"]["end"]["position"] = [80, 0, 20]
    hybrid.run(other, output=file, overwrite=True).close()
    assert played.read() == (0, True)
    assert played.frames[0]["lines"][0]["z"][-1] == 20.0


def test_two_pages_at_once_and_one_after_a_process_has_ended() -> None:
    """The second of two failed, and a process that had ended stayed."""
    text = (Path(__file__).parents[2] / "examples" / "01_hanging_chain.yaml").read_text(encoding="utf-8")
    modes = {"do": "modes", "text": text, "file": "x.yaml"}

    async def ask() -> list[bytes | None]:
        workers = Workers()
        await workers.start()
        found = list(await asyncio.gather(*(workers.ask_spare(modes) for _ in range(2))))
        await workers._spare.stop()
        await workers.ask_spare(modes)
        found.append(await workers.ask_spare(modes))
        await workers.stop()
        return found

    assert all(x is not None and b'"html"' in x for x in asyncio.run(ask()))
