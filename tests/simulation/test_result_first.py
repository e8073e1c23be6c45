"""The result comes first: what stops a run after it leaves it there, says what is missing, and is made up for."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from bits import Stopping, differences
from test_late_file import described
from typer.testing import CliRunner

import hybrid
from hybrid.accuracy import error_control, passes
from hybrid.accuracy.refinement import Verdict
from hybrid.cli.commands import app
from hybrid.cli.console import Console
from hybrid.errors import ComputationError, Outcome
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution
from hybrid.simulation import run as run_module
from hybrid.simulation import zones_at_rest
from hybrid.simulation.case import Case, CaseAtRest
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, Progress
from hybrid.store import whole_file, writer
from hybrid.store.whole_file import LateFile
from hybrid.view.notebook import card
from hybrid.view.panels import page_of
from hybrid.view.summary import facts_of
from tests.scenes import line_between, network_scene

ERRORS, FINER = "its errors are not estimated yet", "the finer result that its accuracy asks for is not computed yet"


def asked(accuracy: str = "0.3%") -> dict[str, Any]:
    """Misses that in its first result, and takes a finer one."""
    scene = described() | {"accuracy": accuracy, "time": {"duration": 2.0}, "output": {"every": 0.1, "points": 11}}
    del scene["mesh"]
    return scene


def two_lines(accuracy: str = "0.3%") -> dict[str, Any]:
    """The same of two lines that meet."""
    section = {"length": 1.0, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 1e5}
    motion = {"heave": {"amplitude": 0.2, "period": 2.0}, "ramp": 2.0}
    return network_scene(
        {"a": {"position": [0, 0, 0]}, "b": {"position": [1.5, 0, 0], "motion": motion},
         "m": {"initial_guess": [0.75, 0, -0.5], "mass": 0.2}},
        {x: line_between(x, "m", section, model="catenary") for x in "ab"}, time={"duration": 1.0}, accuracy=accuracy,
        output=(0.1, 5)
    )  # fmt: skip


def rougher(resolution: Resolution) -> Resolution:
    assert resolution.local is not None
    return replace(resolution.coarser(16.0, 1.0), local=15.0 * resolution.local)


@pytest.fixture
def rough(monkeypatch: pytest.MonkeyPatch) -> None:
    """First results that are far too coarse for what is asked, so that finer ones follow."""
    surveyed = passes.Passes._surveyed

    def made(self: passes.Passes, first: NetworkResolution) -> NetworkResolution:
        return NetworkResolution({name: rougher(x) for name, x in surveyed(self, first).lines.items()})

    monkeypatch.setattr(run_module, "LOOK", 1)
    monkeypatch.setattr(passes.Passes, "_surveyed", made)


def fixed() -> dict[str, Any]:
    """Two lines in steps of fixed length, with errors."""
    scene = two_lines() | {
        "time": {"duration": 1.0, "step": 0.02},
        "output": {"every": 0.1, "points": 5, "errors": True},
    }
    del scene["accuracy"]
    for line in scene["lines"].values():
        line["mesh"] = {"cells": 8}
    return scene


def stopped_in(name: str, scene: dict[str, Any], path: Path) -> None:
    """A run that is stopped, like by Ctrl-C, at the first step that is heard of a pass with this name."""

    def stop(progress: Progress) -> None:
        if progress.name == name and progress.t < progress.duration:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene, path, progress=stop)


@pytest.mark.long
@pytest.mark.parametrize("scene", [asked(), two_lines()], ids=["one", "several"])
@pytest.mark.usefixtures("rough")
def test_stopped_after_the_result(scene: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The result is complete and says what is to come; resumed, it is what it would have been.

    Runs to compare with that had ended are not computed again: those of several lines were.
    """
    Stopping(monkeypatch)
    compared: list[object] = []
    sample = Case.sample
    monkeypatch.setattr(Case, "sample", lambda self, *x, **y: compared.append(x) or sample(self, *x, **y))
    hybrid.run(scene, tmp_path / "whole.h5").close()
    for name, pending in ((ESTIMATION, ERRORS), (REFINEMENT, FINER)):
        folder = tmp_path / name
        folder.mkdir()
        stopped_in(name, scene, folder / "run.h5")
        with hybrid.open(folder / "run.h5") as result:
            assert result.status == "complete" and not result.done
            assert pending in result.pending and "`hybrid resume run.h5`" in result.pending
            assert result.times[-1] == scene["time"]["duration"]
            assert any(x.startswith("error_total") for x in result.attributes) == (name == REFINEMENT)
        left = (folder / ".run.h5.finer").exists()  # from which a finer result goes on
        assert left == (name == REFINEMENT)
        compared.clear()
        hybrid.resume(folder / "run.h5").close()
        assert bool(compared) == (name == ESTIMATION)
        assert differences(tmp_path / "whole.h5", folder / "run.h5") == []
        assert [x.name for x in folder.iterdir()] == ["run.h5"]
        with hybrid.open(folder / "run.h5") as result:
            assert result.done and not result.pending and "amended" not in result.attributes


def test_whoever_looks_at_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Pictures, report, card, comparison, statistics, exports, and the command that was stopped."""
    monkeypatch.chdir(tmp_path)
    Stopping(monkeypatch)
    stopped_in(ESTIMATION, described(True), tmp_path / "run.h5")
    with hybrid.open("run.h5") as result:
        facts = {fact.key: fact for fact in facts_of(result)}
        assert ERRORS in facts["status"].text and facts["status"].weight == "alarm"
        assert ERRORS in page_of(result, []).facts and ERRORS in card(result) and ERRORS in repr(result)
        assert result.pending in hybrid.export(result, "run.csv").notes
    told = CliRunner().invoke(app, ["stats", "run.h5"])
    assert told.exit_code == 0 and ERRORS in " ".join(told.output.split())
    console = Console(False, False)
    console.will_write(tmp_path / "no.h5")
    console._file = tmp_path / "run.h5"
    capsys.readouterr()
    console.interrupted()
    assert f"{ERRORS}; `hybrid resume {tmp_path / 'run.h5'}` makes up for it" in capsys.readouterr().err


@pytest.mark.long
def test_stopped_in_the_errors_of_fixed_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Stopping(monkeypatch)
    monkeypatch.setattr(run_module, "LOOK", 1)
    hybrid.run(fixed(), tmp_path / "whole.h5").close()
    stopped_in(ESTIMATION, fixed(), tmp_path / "run.h5")
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == "complete" and ERRORS in result.pending and ERRORS in result.lines["a"].pending
    hybrid.resume(tmp_path / "run.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


def test_stopped_before_the_result_nothing_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Stopping(monkeypatch)
    stopped_in(PRE_RUN, asked(), tmp_path / "run.h5")
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_stopped_in_the_result_what_there_is_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It says that the run has not come to its end, and that its errors are to come, wherever one looks."""
    monkeypatch.chdir(tmp_path)
    Stopping(monkeypatch)
    stopped_in(RESULT, asked(), tmp_path / "run.h5")
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == "interrupted" and ERRORS in result.pending and not result.done
        assert "`hybrid resume run.h5` goes on" in result.pending and result.pending in result.status_text
        assert result.pending in " ".join(hybrid.export(result, "run.csv").notes)
    told = CliRunner().invoke(app, ["stats", "run.h5"])  # it was stopped in its first step
    assert told.exit_code == 1 and "window" not in told.output
    assert "stopped before its first output" in told.output and ERRORS in told.output
    assert "`hybrid resume run.h5` goes on; a shorter output.every" in " ".join(told.output.split())
    console = Console(False, False)
    console.will_write(tmp_path / "no.h5")
    console._file = tmp_path / "run.h5"
    capsys.readouterr()
    console.interrupted()
    text = capsys.readouterr().err
    assert "complete up to t" in text and f"{ERRORS}; `hybrid resume {tmp_path / 'run.h5'}` goes on" in text
    hybrid.resume(tmp_path / "run.h5").close()
    hybrid.run(asked(), tmp_path / "whole.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


@pytest.mark.long
@pytest.mark.usefixtures("rough")
@pytest.mark.parametrize("scene", [asked(), two_lines()], ids=["one", "several"])
def test_errors_are_written_before_a_long_finer_run(
    scene: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are there while it runs, and the file that comes out is the same."""
    hybrid.run(scene, tmp_path / "whole.h5").close()
    monkeypatch.setattr(passes, "WORTH_WRITING", -1.0)
    seen: list[tuple[str, bool]] = []

    def look(progress: Progress) -> None:
        if progress.name == REFINEMENT:
            with hybrid.open(tmp_path / "run.h5") as result:
                line = next(iter(result.lines.values()), result)
                seen.append((result.pending, "errors/total/position" in line))

    hybrid.run(scene, tmp_path / "run.h5", progress=look).close()
    assert seen and all(FINER in text and there for text, there in seen)
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


@pytest.mark.usefixtures("rough")
def test_what_was_added_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A finer run that fails leaves the result before it, whose events and errors are there once."""
    monkeypatch.setattr(passes, "WORTH_WRITING", -1.0)
    record = Case.record

    def failing(self: Case, resolution: Any, target: Any, before: Any = None) -> Any:
        if isinstance(target, Path) and target.name.startswith("."):
            raise ComputationError(Outcome.SINGULAR, 1.0, 0.0)
        return record(self, resolution, target, before)

    monkeypatch.setattr(Case, "record", failing)
    with hybrid.run(asked(), tmp_path / "run.h5") as result:
        kinds = [event.kind for event in result.events]
        assert result.done and len(kinds) == len(set(kinds)) and {"finer run not kept", "accuracy missed"} <= set(kinds)
        assert "errors/total/position" in result


def test_a_comparison_that_fails_leaves_the_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: Case, resolution: Any, points: Any = None, until: Any = None, **more: Any) -> Any:
        raise ComputationError(Outcome.SINGULAR, 1.0, 0.0)

    monkeypatch.setattr(Case, "sample", failing)
    with hybrid.run(described(True), tmp_path / "run.h5") as result:
        (event,) = [x for x in result.events if x.kind == "no error figure"]
        assert event.text.startswith("error not known: a coarser run to compare with failed") and result.done


def test_an_equilibrium_is_there_before_its_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sample = CaseAtRest.sample

    def stopped(self: CaseAtRest, resolution: Any, points: Any = None, *more: Any, **named: Any) -> Any:
        if points is not None:  # of the pre-run
            return sample(self, resolution, points, *more, **named)
        raise KeyboardInterrupt

    monkeypatch.setattr(CaseAtRest, "sample", stopped)
    scene = {key: x for key, x in asked().items() if key not in ("time", "output")}
    with pytest.raises(KeyboardInterrupt):
        hybrid.static(scene, tmp_path / "rest.h5")
    with hybrid.open(tmp_path / "rest.h5") as result:
        assert result.status == "complete" and ERRORS in result.pending and "hybrid static" in result.pending


@pytest.mark.parametrize("scene", [described(), two_lines()], ids=["one", "several"])
def test_a_stop_is_heard_while_the_equilibrium_is_searched(
    scene: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is raised where it comes, not after the search: nothing is written by then."""
    reached: list[str] = []

    def long(*_: Any) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        reached.append("the end of a long search")

    monkeypatch.setattr(zones_at_rest, "equilibrium_of", long)
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene, tmp_path / "run.h5")
    assert not reached and not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.usefixtures("rough")
@pytest.mark.parametrize("kept", [True, False])
def test_of_results_that_follow_each_other_the_last_is_written(
    kept: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once, with its errors; before, a first result, a finer one and a copy with errors were.  None of them waits for
    long: they are where they belong while others are computed."""
    if not kept:
        monkeypatch.setattr(error_control, "is_no_better", lambda *_: Verdict(2.0, 1.0, 1.0, 0.0, "no use"))
    written: list[str] = []
    monkeypatch.setattr(LateFile, "place", _noting(written, LateFile.place))
    monkeypatch.setattr(writer, "pause", lambda _: 100.0)
    for waits, names in ((100.0, {"once.h5"}), (-1.0, {"each.h5", ".each.h5.finer"})):
        monkeypatch.setattr(whole_file, "WAITS", waits)
        written.clear()
        name = "once.h5" if waits > 0.0 else "each.h5"
        with hybrid.run(asked(), tmp_path / name) as result:
            assert result.attributes["effort_runs"] > 4 and result.done
            assert ("finer run not kept" in {x.kind for x in result.events}) == (not kept)
        assert set(written) <= names and (waits < 0.0 or written == ["once.h5"])
    assert {x.name for x in tmp_path.iterdir()} == {"once.h5", "each.h5"}
    assert differences(tmp_path / "once.h5", tmp_path / "each.h5") == []


def _noting(written: list[str], place: Any) -> Any:
    def noting(self: LateFile) -> None:
        if not self.placed:
            written.append(self.path.name)
        place(self)

    return noting


@pytest.mark.long
@pytest.mark.usefixtures("rough")
def test_a_finer_result_is_no_file_before_it_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first one grows, for those who read it; before, the finer one did too, and was copied to add its errors."""
    written: list[str] = []
    monkeypatch.setattr(LateFile, "place", _noting(written, LateFile.place))
    monkeypatch.setattr(writer, "pause", lambda _: -1.0)  # outputs are due at once
    monkeypatch.setattr(whole_file, "WAITS", 100.0)
    with hybrid.run(asked(), tmp_path / "run.h5") as result:
        assert result.attributes["effort_runs"] > 4 and result.done
    assert written == ["run.h5"] and [x.name for x in tmp_path.iterdir()] == ["run.h5"]
