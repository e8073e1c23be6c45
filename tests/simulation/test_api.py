"""The door to a computation: what may be given as a scene, and what a failed run leaves."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.simulation.progress import Progress

WIRE: dict[str, Any] = {
    "cable": {"sections": [{"length": 2.0, "mass": 1.0}]},
    "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "free", "force": [0, 0, -20]}},
    "initial": "equilibrium",
    "model": "catenary",
    "mesh": {"cells": 4},
    "time": {"duration": 0.1, "step": 0.05},
}
# Let go and pushed upwards: it goes into compression.
PUSHED = WIRE | {
    "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "free", "force": [0, 0, 400.0]}},
    "initial": {"kind": "straight", "direction": [0, 0, -1]},
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "wire.yaml"
    path.write_text(hybrid.scene_text(hybrid.validate_scene(WIRE)))
    return path


def test_a_scene_is_a_scene_a_path_or_a_dict(file: Path) -> None:
    scene = hybrid.load_scene(file)
    want = hybrid.run(scene)
    for given in (file, str(file), WIRE):
        with hybrid.run(given) as result:
            np.testing.assert_array_equal(result.position, want.position)
        with hybrid.static(given) as rest:
            np.testing.assert_array_equal(rest.position[0], want.position[0])
        assert hybrid.plan(given, measure=False) == hybrid.plan(scene, measure=False)


@pytest.mark.parametrize("given", [None, 3, ["wire.yaml"], b"wire.yaml"])
def test_anything_else_is_refused_with_what_is_expected(given: Any, tmp_path: Path) -> None:
    for call in (hybrid.run, hybrid.static, hybrid.plan, lambda x: hybrid.trade(x, tmp_path / "trade")):
        with pytest.raises(TypeError, match=r"path.*dict") as refused:
            call(given)
        assert type(given).__name__ in str(refused.value)


def test_results_are_taken_as_a_user_may_give_them(file: Path, tmp_path: Path) -> None:
    with hybrid.run(file) as result:
        with pytest.raises(TypeError, match=r"path of a result file, found Result"):
            hybrid.resume(result)  # type: ignore[arg-type]
        with pytest.raises(hybrid.ResultError, match="above: expected a number in the unit of 'tension', found 'a'"):
            result.exceedance("tension", "a")
        named = hybrid.export(result, tmp_path / "a.csv", names="tension").files[0].read_text()
        assert named == hybrid.export(result, tmp_path / "b.csv", names=["tension"]).files[0].read_text()
        page = hybrid.compare([result, result], tmp_path / "both.html").read_text()
        assert "1: in memory" in page and "2: in memory" in page


def test_a_bad_dict_is_refused_like_a_bad_file() -> None:
    with pytest.raises(hybrid.SceneError, match="model"):
        hybrid.run(WIRE | {"model": "string"})


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="has no such pipes")
def test_a_pipe_or_device_is_not_replaced(tmp_path: Path, file: Path) -> None:
    hybrid.run(file, tmp_path / "run.h5")
    os.mkfifo(tmp_path / "pipe")
    for call in (hybrid.run, hybrid.static, lambda _, to: hybrid.resume(tmp_path / "run.h5", to, until=0.2)):
        with pytest.raises(hybrid.ResultError, match="no regular file"):
            call(file, tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()


# --- snapshots -----------------------------------------------------------------------------------


def failed(output: Path | None) -> Path:
    """The snapshot of a run that fails."""
    with pytest.raises(hybrid.ComputationError) as stopped:
        hybrid.run(PUSHED, output)
    assert stopped.value.snapshot is not None and str(stopped.value.snapshot) in str(stopped.value)
    return stopped.value.snapshot


def test_a_snapshot_replaces_a_link_and_does_not_follow_it(tmp_path: Path) -> None:
    victim = tmp_path / "victim.txt"
    victim.write_text("precious")
    link = tmp_path / "run.snapshot.npz"
    link.symlink_to(victim)
    assert failed(tmp_path / "run.h5").resolve() == link.resolve() and not link.is_symlink()
    assert victim.read_text() == "precious"
    with np.load(link) as snapshot:
        assert snapshot["outcome"] == "SLACK" and snapshot["r"].shape == (5, 3)


def test_snapshots_of_runs_in_memory_have_names_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    one, other = failed(None), failed(None)
    assert one != other and one.parent == other.parent == tmp_path
    assert os.stat(one).st_mode & 0o077 == 0, "nobody else reads it"
    with np.load(one) as snapshot:
        assert float(snapshot["t"]) >= 0.0


# --- signals -------------------------------------------------------------------------------------


class Late:
    """A listener that raises a signal when the run has ended, before its handlers are back."""

    def __init__(self, number: signal.Signals) -> None:
        self.number = number

    def __call__(self, _: Progress) -> None:
        pass

    def close(self) -> None:
        signal.raise_signal(self.number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("scene", [WIRE, PUSHED], ids=["complete", "failed"])
def test_a_signal_at_the_very_end_of_a_run_is_not_lost(
    scene: dict[str, Any], number: signal.Signals, tmp_path: Path
) -> None:
    before = signal.signal(number, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            hybrid.run(scene, tmp_path / "run.h5", progress=Late(number))
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == ("complete" if scene is WIRE else "failed")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_has_stopped_a_run_is_raised_once(number: signal.Signals, tmp_path: Path) -> None:
    heard: list[int] = []
    before = signal.signal(number, lambda got, _frame: heard.append(got))
    try:
        with pytest.raises(KeyboardInterrupt):
            hybrid.run(WIRE, tmp_path / "run.h5", progress=lambda _: signal.raise_signal(number))
    finally:
        signal.signal(number, before)
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == "interrupted" and not heard


def test_a_second_signal_ends_a_run_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in an equilibrium that takes long, where no step looks at the first."""
    monkeypatch.setattr("hybrid.simulation.progress.IMPATIENT", 0.0)
    reached: list[str] = []

    def search(*_: object, **__: object) -> None:
        for name in ("first", "second", "third"):
            reached.append(name)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("hybrid.simulation.case.Case._first_state", search)
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(WIRE, tmp_path / "run.h5")
    assert reached == ["first", "second"]
