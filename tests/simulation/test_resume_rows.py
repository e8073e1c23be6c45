"""Outputs of long runs to compare with, in files beside the result: the same bits, resumed with them or without."""

from __future__ import annotations

import shutil
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from bits import Stopping, differences

import hybrid
from hybrid.simulation import case as cases
from hybrid.simulation.progress import RESULT, Progress

TOUCHDOWN = Path(__file__).parents[2] / "examples" / "touchdown.yaml"


@pytest.fixture(autouse=True)
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files for short runs as well."""
    monkeypatch.setattr(cases, "MOST_IN_MEMORY", 0)


def scene(*settings: str) -> hybrid.Scene:
    return hybrid.load_scene(TOUCHDOWN, ["output.errors=true", "time.duration=10", *settings])


def rows(folder: Path) -> list[Path]:
    return sorted(folder.glob(".*.coarse"))


def interrupted(what: hybrid.Scene, path: Path, stopping: Stopping) -> list[Path]:
    """A run that is stopped in its result; the files beside it."""

    def stop(progress: Progress) -> None:
        if progress.name == RESULT and progress.t > 5.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hybrid.run(what, path, progress=stop)
    return rows(path.parent)


def spoil(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def shorten(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-8])


CASES = {"rods": ["model=rod"], "model left open": [], "accuracy": ["accuracy={tension: 0.3%}", "time={duration: 12}"]}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """A folder with a whole run of a case, and with one that was stopped and its files."""

    @cache
    def make(name: str) -> Path:
        folder = tmp_path_factory.mktemp("made")
        with pytest.MonkeyPatch.context() as patched:
            stopping = Stopping(patched)
            with pytest.MonkeyPatch.context() as other:
                other.setattr(cases, "MOST_IN_MEMORY", 10**9)
                hybrid.run(scene(*CASES[name]), folder / "whole.h5").close()
            patched.setattr(cases, "MOST_IN_MEMORY", 0)
            assert len(interrupted(scene(*CASES[name]), folder / "run.h5", stopping)) == 3
        return folder

    return make


@pytest.mark.parametrize("harm", [None, Path.unlink, spoil, shorten])
@pytest.mark.parametrize("name", CASES)
def test_a_stopped_run_goes_on_bit_for_bit(
    name: str,
    harm: Callable[[Path], None] | None,
    made: Callable[[str], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the files, and without one of them: then all runs to compare with are computed again."""
    Stopping(monkeypatch)
    for file in made(name).iterdir():
        shutil.copy(file, tmp_path)
    computed: list[object] = []
    sample = cases.Case.sample
    monkeypatch.setattr(cases.Case, "sample", lambda self, *x: computed.append(x) or sample(self, *x))
    if harm is not None:
        harm(rows(tmp_path)[1])
    hybrid.resume(tmp_path / "run.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
    assert (len(computed) >= 3) == (harm is not None)
    assert {x.name for x in tmp_path.iterdir()} == {"whole.h5", "run.h5"}


def test_the_file_of_the_result_does_not_hold_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted(scene("model=rod"), tmp_path / "run.h5", Stopping(monkeypatch))
    beside = sum(x.stat().st_size for x in rows(tmp_path))
    assert (tmp_path / "run.h5").stat().st_size > beside > 0
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result._contents._file["checkpoint/before"].size < 10_000


def test_into_another_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those beside the source are used, and stay there: it can be resumed again."""
    interrupted(scene("model=rod"), tmp_path / "run.h5", Stopping(monkeypatch))
    hybrid.run(scene("model=rod"), tmp_path / "whole.h5").close()
    hybrid.resume(tmp_path / "run.h5", tmp_path / "other.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "other.h5") == []
    assert len(rows(tmp_path)) == 3


def test_nothing_is_left_where_there_is_no_result(tmp_path: Path) -> None:
    def stop(progress: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene("model=rod"), tmp_path / "run.h5", progress=stop)
    assert not list(tmp_path.iterdir())


def test_killed_and_resumed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """kill -9 in the result: the files beside it are found by another process."""
    code = f"""
        import hybrid
        from hybrid.simulation import case
        case.MOST_IN_MEMORY = 0
        hybrid.run(hybrid.load_scene({str(TOUCHDOWN)!r}, {["output.errors=true", "model=rod", "time.duration=1000"]}),
                   {str(tmp_path / "run.h5")!r})
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)])
    try:
        until = time.monotonic() + 120.0
        while not (tmp_path / "run.h5").exists() or (tmp_path / "run.h5").stat().st_size < 4_000_000:
            assert process.poll() is None and time.monotonic() < until
            time.sleep(0.005)
    finally:
        process.kill()
        process.wait()
    assert len(rows(tmp_path)) == 3
    computed: list[object] = []
    sample = cases.Case.sample
    monkeypatch.setattr(cases.Case, "sample", lambda self, *x: computed.append(x) or sample(self, *x))
    hybrid.resume(tmp_path / "run.h5").close()
    assert not computed and not rows(tmp_path)
    hybrid.run(scene("model=rod", "time.duration=1000"), tmp_path / "whole.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
