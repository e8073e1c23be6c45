"""Outputs of long runs to compare with, in files beside the result: the same bits, resumed with them or without."""

from __future__ import annotations

import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from bits import Stopping, differences
from test_result_first import make_rough

import hybrid
from hybrid.simulation import case as cases
from hybrid.simulation.progress import REFINEMENT, Progress
from hybrid.store.hdf5_file import opened
from hybrid.store.whole_file import read_before
from tests.inside import calls_of

TOUCHDOWN = Path(__file__).parents[2] / "examples" / "touchdown.yaml"


@pytest.fixture(autouse=True)
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files for short runs as well, and first results that miss what is asked."""
    monkeypatch.setattr(cases, "MOST_IN_MEMORY", 0)
    make_rough(monkeypatch, 8.0, 10.0)


def scene(*settings: str) -> hybrid.Scene:
    return hybrid.load_scene(TOUCHDOWN, list(settings))


def rows(folder: Path) -> list[Path]:
    return sorted(folder.glob(".*.coarse"))


def interrupted(what: hybrid.Scene, path: Path, stopping: Stopping) -> list[Path]:
    """A run that is stopped in a finer result; the files beside it."""

    def stop(progress: Progress) -> None:
        if progress.name == REFINEMENT and progress.t > 5.0:
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


ASKED = ["accuracy={tension: 0.3%}", "time={duration: 7}", "mesh=null"]
CASES = {"rods": [*ASKED, "model=rod"], "model left open": ASKED}
FILES = {"rods": 3, "model left open": 4}  # runs to compare with, and one with rods in place of catenaries


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
            assert len(interrupted(scene(*CASES[name]), folder / "run.h5", stopping)) == FILES[name]
        return folder

    return make


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "harm"), [("model left open", None), *(("rods", harm) for harm in (None, Path.unlink, spoil, shorten))]
)
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
    computed = calls_of(monkeypatch, cases.Case, "sample")
    if harm is not None:
        harm(rows(tmp_path)[1])
    hybrid.resume(tmp_path / "run.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
    assert (len(computed) >= 3) == (harm is not None)
    assert {x.name for x in tmp_path.iterdir()} == {"whole.h5", "run.h5"}


@pytest.mark.long
def test_the_file_of_the_result_does_not_hold_them(made: Callable[[str], Path]) -> None:
    beside = sum(x.stat().st_size for x in rows(made("rods")))
    assert (made("rods") / "run.h5").stat().st_size > beside > 0
    with opened(made("rods") / "run.h5") as file:
        kept = read_before(file)["lines"]["cable"]["coarse"]
    assert len(kept) == 3 and all(x["rows"] and not x["values"] for x in kept)


@pytest.mark.long
def test_into_another_file(made: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those beside the source are used, and stay there: it can be resumed again."""
    Stopping(monkeypatch)
    for file in made("rods").iterdir():
        shutil.copy(file, tmp_path)
    before = (tmp_path / "run.h5").read_bytes()
    hybrid.resume(tmp_path / "run.h5", tmp_path / "other.h5").close()
    assert (tmp_path / "run.h5").read_bytes() == before
    assert differences(tmp_path / "whole.h5", tmp_path / "other.h5") == []
    assert len(rows(tmp_path)) == 3


@pytest.mark.long
def test_killed_and_resumed(made: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """kill -9 in a finer result: the files beside the first are found by another process."""
    Stopping(monkeypatch)
    code = f"""
        import os
        from dataclasses import replace
        import hybrid
        from hybrid.accuracy import passes, refinement
        from hybrid.model.network import NetworkResolution
        from hybrid.simulation import case
        case.MOST_IN_MEMORY, passes.WORTH_WRITING = 0, -1.0
        refinement.LITTLE = float("inf")  # an event that goes by clocks
        surveyed = passes.Passes._surveyed
        def rougher(self, first):
            found = surveyed(self, first).lines
            return NetworkResolution({{k: replace(x.coarser(8.0), local=10.0 * x.local) for k, x in found.items()}})
        passes.Passes._surveyed = rougher
        def kill(progress):
            if progress.name == "refinement":
                os.kill(os.getpid(), 9)
        hybrid.run(hybrid.load_scene({str(TOUCHDOWN)!r}, {CASES["rods"]}), {str(tmp_path / "run.h5")!r}, progress=kill)
    """
    process = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=False)
    assert process.returncode == -9 and len(rows(tmp_path)) == 3
    with hybrid.open(tmp_path / "run.h5") as result:
        assert "finer result" in result.pending and "errors/total/position" in result
    assert not (tmp_path / ".run.h5.lock").exists()  # it was left, and opening has removed it
    computed = calls_of(monkeypatch, cases.Case, "sample")
    hybrid.resume(tmp_path / "run.h5").close()
    assert not computed and not rows(tmp_path)
    assert differences(made("rods") / "whole.h5", tmp_path / "run.h5") == []
