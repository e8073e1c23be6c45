"""The result comes first: what stops a run after it leaves it there, says what is missing, and is made up for."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences
from controlled import OneLine, made_up
from test_late_file import described
from typer.testing import CliRunner

import hybrid
from hybrid.accuracy import error_control, passes
from hybrid.accuracy import run_forecast as module
from hybrid.accuracy.error_estimate import Estimate
from hybrid.accuracy.error_statistics import STATISTICS, estimates, statistics_of
from hybrid.accuracy.refinement import NOT_KEPT, Free, Judged, Verdict, is_no_better
from hybrid.accuracy.run_forecast import OUTPUT, POINT, Budget
from hybrid.cli.commands import app
from hybrid.cli.console import Console
from hybrid.errors import ComputationError, Outcome
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import RequestedAccuracy, Resolution
from hybrid.simulation import run as run_module
from hybrid.simulation import zones_at_rest
from hybrid.simulation.case import Case, CaseAtRest
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, Progress
from hybrid.simulation.run_sample import RunSample
from hybrid.store import whole_file, writer
from hybrid.store.whole_file import LateFile
from hybrid.view.panels import page_of
from hybrid.view.report import card
from hybrid.view.summary import facts_of
from tests.inside import calls_of
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

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


def make_rough(monkeypatch: pytest.MonkeyPatch, cells: float = 16.0, steps: float = 15.0) -> None:
    """Let first results be far too coarse for what is asked, so that finer ones follow."""
    surveyed = passes.Passes._surveyed

    def made(self: passes.Passes, first: NetworkResolution) -> NetworkResolution:
        each = surveyed(self, first).lines.items()
        return NetworkResolution({k: replace(x.coarser(cells, 1.0), local=steps * (x.local or 0.0)) for k, x in each})

    monkeypatch.setattr(passes.Passes, "_surveyed", made)


@pytest.fixture
def rough(monkeypatch: pytest.MonkeyPatch) -> None:
    """First results that finer ones follow, and runs that are heard at every step."""
    monkeypatch.setattr(run_module, "LOOK", 1)
    make_rough(monkeypatch)


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
    compared = calls_of(monkeypatch, Case, "sample")
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
            missed = [x.text for x in result.events if x.kind == "accuracy missed"]
            lines = len(result.lines) or 1
            assert len(missed) == (lines if name == REFINEMENT else 0) and all("stopped" in x for x in missed)
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
            target.with_suffix(".snapshot.npz").write_bytes(b"as a motion that fails leaves one")
            raise ComputationError(Outcome.SINGULAR, 1.0, 0.0)
        return record(self, resolution, target, before)

    monkeypatch.setattr(Case, "record", failing)
    with hybrid.run(asked(), tmp_path / "run.h5") as result:
        kinds = [event.kind for event in result.events]
        assert result.done and len(kinds) == len(set(kinds)) and {"finer run not kept", "accuracy missed"} <= set(kinds)
        assert "errors/total/position" in result
        assert "failed" in next(x.text for x in result.events if x.kind == "accuracy missed")
    assert [x.name for x in tmp_path.iterdir()] == ["run.h5"]


def test_a_comparison_that_fails_leaves_the_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: Case, resolution: Any, points: Any = None, until: Any = None, **more: Any) -> Any:
        raise ComputationError(Outcome.SINGULAR, 1.0, 0.0)

    monkeypatch.setattr(Case, "sample", failing)
    with hybrid.run(described(True), tmp_path / "run.h5") as result:
        (event,) = [x for x in result.events if x.kind == "no error figure"]
        assert event.text.startswith("error not known: a coarser run to compare with failed") and result.done


@pytest.mark.parametrize("scene", [asked("1%"), two_lines("1%")], ids=["one", "several"])
def test_a_comparison_that_fails_in_motion_is_of_a_finer_result(
    scene: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cells and steps half as long, so that the next is as fine as the result that came to its end."""
    finely = calls_of(monkeypatch, Case, "record", lambda _, resolution, *more: resolution.one)
    sample = Case.sample

    def failing(self: Case, resolution: Any, *more: Any, **named: Any) -> Any:
        if len(finely) == 1:
            raise ComputationError(Outcome.SINGULAR, 1.0, 0.0)
        return sample(self, resolution, *more, **named)

    monkeypatch.setattr(Case, "sample", failing)
    with hybrid.run(scene, tmp_path / "run.h5") as result:
        first, second = finely[:2]
        assert second.fineness == 2.0 * first.fineness and second.step == 0.5 * first.step
        assert "no error figure" not in {x.kind for x in result.events} and result.done


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


# --- What a refinement returns is never worse than the run before it ---

ASKED = RequestedAccuracy(0.005, None, None)


def comparisons() -> list[RunSample]:
    return [made_up(0.5, 50), made_up(0.5, 25), made_up(0.25, 25)]


def refined(second: RunSample | ComputationError) -> tuple[RunSample, OneLine, list[bool]]:
    """What control returns of a first result and what follows it, and what became of both."""
    samples, results, settled = iter(comparisons()), iter([made_up(), second]), list[bool]()

    def result(_: Resolution) -> RunSample:
        found = next(results)
        if isinstance(found, ComputationError):
            raise found
        return found

    free = Free(True, True, True)
    control = OneLine(ASKED, free, lambda _: next(samples), result, settled.append)
    found, _ = control.start(Resolution(1.0, 0.1, 1e-6, 1e-3))
    return found, control, settled


def test_a_finer_run_that_is_better_is_returned() -> None:
    found, control, settled = refined(made_up(3.0, 300))
    assert found.cells == 300 and settled == [True, True]
    assert not {kind for kind, _ in control.notes} & {NOT_KEPT, "accuracy missed"}


def test_a_finer_run_far_off_does_not_replace_the_one_before() -> None:
    """At one output of one point by 2 m, where 0.02 m were estimated: one of the two is wrong, and the figure says so.

    So it was with a curvature of 53 1/m where 2.6 are true: the finer run was returned.
    """
    found, control, settled = refined(made_up(3.0, 300, off=2.0))
    assert found.cells == 100 and settled == [True, False]
    assert control.line.estimate is not None and control.line.estimate.run is found
    total = {name: x for cause, name, _, x in control.line.estimate.errors.blocks() if cause == "total"}["position"]
    assert total[5, 2] > 2.0 and total[2, 1] < 0.03
    said = dict(control.notes)
    assert "300 cells" in said[NOT_KEPT] and "no better" in said[NOT_KEPT] and "accuracy missed" in said


def test_a_finer_run_that_fails_leaves_the_one_before() -> None:
    found, control, _ = refined(ComputationError(Outcome.SINGULAR, 3.0, 1.0))
    assert found.cells == 100 and control.line.estimate is not None and control.line.estimate.run is found
    said = dict(control.notes)
    assert Outcome.SINGULAR.cause in said[NOT_KEPT] and "a finer run failed" in said["accuracy missed"]


@pytest.mark.parametrize(
    ("off", "ratio", "better"),
    [
        (0.0, 3.0, True),  # within its figure: the smaller one stands
        (0.0, 1.5, False),  # the finer run has a smaller one
        (0.025, 3.0, False),  # beyond its figure, less than the change before: that was too small
        (0.5, 3.0, True),  # more than the change before
    ],
)
def test_which_of_two_results_is_better(off: float, ratio: float, better: bool, monkeypatch) -> None:
    estimate = Estimate(made_up(), *comparisons())
    before = Judged(estimate).copied()
    finer = made_up(1.2, 120)
    everywhere = {"position": np.asarray(finer.values["position"]) - off}
    estimate.update(replace(finer, values=everywhere))
    now, verdict = Judged(estimate), Verdict(2.0, 1.0, 1.0, 0.0, "", name="position")
    ratios = {id(before.estimate): 2.0, id(estimate): ratio}
    monkeypatch.setattr(Judged, "verdict", lambda self, asked: replace(verdict, ratio=ratios[id(self.estimate)]))
    assert (is_no_better({"": ASKED}, {"": before}, {"": now}) is not None) is better
    assert before.estimate.run.cells == 100  # the copy stays what it was
    assert before.estimate.errors.largest("total", "position") == pytest.approx(0.012 * np.sqrt(3.0), rel=1e-3)


def storm(fineness: float, steps: int, most: float = 0.0) -> RunSample:
    """A force at the end that snaps, at other instants in every run: off by 3/fineness^2 N, its largest by `most` too."""
    t = np.linspace(0.0, 400.0, 2001)
    force = 500.0 * (1.0 + np.sin(np.pi * (t - 0.2 * round(2.0 / fineness)))) + 3.0 / fineness**2
    force[700] = 1200.0 + 3.0 / fineness**2 + most
    forces = np.column_stack([t[1:], force[1:], force[1:]])
    reaction = np.stack([force, 0.0 * force, 0.0 * force], axis=-1)
    resolution = Resolution(fineness, 10.0 / steps, 1e-6, 1e-3)
    return RunSample(resolution, {"reaction_end": reaction}, round(100 * fineness), steps, 0.0, forces=forces)


@pytest.mark.parametrize("most", [0.0, 60.0])
def test_of_an_irregular_motion_statistics_decide(most: float) -> None:
    """Runs snap at other instants, and statistics agree: the finer one counts, unless its largest force is far off."""
    every = RequestedAccuracy(None, None, 1e-3)
    runs = [storm(0.5, 50), storm(0.5, 25), storm(0.25, 25)]
    first, finer = storm(1.0, 100), storm(1.5, 150, most)
    estimate, found = Estimate(first, *runs), estimates(first, *runs, 1)
    before = Judged(estimate, found).copied()
    ratio = before.verdict(every).ratio
    estimate.update(finer)
    for name, statistic in statistics_of(finer, 1).items():
        found[name].update(statistic)
    now = Judged(estimate, found)
    decides = is_no_better({"": every}, {"": before}, {"": now})
    assert ratio > 1.0 and set(found) == set(STATISTICS)
    if not most:
        assert decides is None and now.verdict(every).ratio < ratio
        return
    assert decides is not None and decides.statistic == "largest" and decides.ratio > ratio
    before.set_apart(now)
    assert before.statistics["largest"].errors.largest("total", "end_force_end") > 58.0  # of 60, 1.7 by cells
    assert before.statistics["deviation"].errors.largest("total", "end_force_end") < 0.1 * most
    # a largest force that is by chance is not judged
    scattered = Judged(estimate, found, ("end_force_end",))
    assert is_no_better({"": every}, {"": Judged(Estimate(first, *runs), found)}, {"": scattered}) is None


def test_of_several_lines_the_worst_decides() -> None:
    """A line whose figure has grown does not bring back a result in which another line was worse still."""

    def pair(off: float, finer_off: float) -> tuple[Judged, Judged]:
        estimate = Estimate(made_up(off=off), *comparisons())
        before = Judged(estimate).copied()
        estimate.update(made_up(1.2, 120, off=finer_off))
        return before, Judged(estimate)

    asked = {"a": ASKED, "b": ASKED}
    far, near = pair(0.0, 2.0), pair(0.0, 0.0)
    assert is_no_better(asked, {"a": far[0], "b": near[0]}, {"a": far[1], "b": near[1]}) is not None
    worse = pair(9.0, 0.5)
    assert is_no_better(asked, {"a": far[0], "b": worse[0]}, {"a": far[1], "b": worse[1]}) is None
    assert is_no_better({}, {"a": far[0]}, {"a": far[1]}) is None  # nothing is asked


@pytest.mark.long
@pytest.mark.usefixtures("rough")
@pytest.mark.parametrize("file", [True, False])
def test_the_file_is_that_of_the_run_before(file, tmp_path, monkeypatch) -> None:
    """Of results in memory and in a file, which is left alone there."""
    path = tmp_path / "run.h5" if file else None
    with hybrid.run(asked()) as both:
        assert both.attributes["effort_runs"] > 4  # a finer run follows the first
        cells = both.attributes["cells"]
    monkeypatch.setattr(error_control, "is_no_better", lambda *_: Verdict(2.0, 1.0, 1.0, 0.0, "no use"))
    with hybrid.run(asked(), path) as result:
        assert result.attributes["cells"] < cells and result.status == "complete"
        assert len(result.steps["t"]) > 0 and result.attributes["error_total_position"] > 0.0
        (said,) = [e.text for e in result.events if e.kind == NOT_KEPT]
        assert "no better" in said and "the result is the one before" in said
    assert [x.name for x in tmp_path.iterdir()] == (["run.h5"] if file else [])


# --- An accuracy has a budget: four times what the first result foretells, by steps, cells and outputs ---

FIRST = Resolution(1.0, 0.1, 1e-3, 1e-3)


def run(resolution: Resolution = FIRST, cells: int = 100, steps: int = 100_000) -> RunSample:
    return RunSample(resolution, {"position": np.zeros((1, 1, 3))}, cells, steps, 0.0)


def test_four_times_what_was_foretold_and_no_more() -> None:
    """Steps of 112 us: 11.2 s, 26.9 s are foretold of all, 107.5 s allowed; 21.3 s are spent with runs to compare."""
    budget = Budget(0, 0)
    budget.spend([run()])
    assert budget.foretold == pytest.approx(2.4 * 11.2) and budget.spent == pytest.approx(1.9 * 11.2)
    assert budget.allows([run()], [FIRST.coarser(1.0, 1.0 / 7.6)])
    assert not budget.allows([run()], [FIRST.coarser(1.0, 1.0 / 7.8)])
    assert budget.beyond == pytest.approx((1.9 + 7.8) / 2.4)
    said = budget.text([run()], [FIRST.coarser(0.5, 1.0 / 4.0)])
    assert "about 2e+02 cells and 4e+05 steps" in said and "4 times the processor time" in said
    again = Budget(0, 0)
    again.restore(budget.checkpoint())
    assert again.allows([run()], [FIRST.coarser(1.0, 1.0 / 7.6)]) and not again.allows(
        [run()], [FIRST.coarser(0.1, 0.1)]
    )


def test_short_runs_are_refined_whatever_it_takes_and_outputs_count() -> None:
    budget = Budget(0, 0)
    budget.spend([run(steps=100)])
    assert budget.allows([run(steps=100)], [FIRST.coarser(0.1, 0.1)])  # 100 times 11 ms
    many = Budget(1000, 1000)
    many.spend([run(steps=100)])
    assert many.foretold == pytest.approx(1000 * (OUTPUT + POINT * 1000), rel=0.05)


def test_what_is_beyond_is_not_computed_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The result that there is stays, and says what it meets; resumed from its first step it is refined no more."""
    make_rough(monkeypatch, 8.0, 10.0)
    with hybrid.run(asked(), tmp_path / "free.h5") as free:
        assert free.attributes["effort_runs"] > 4
    monkeypatch.setattr(module, "LEAST", 0.0)
    monkeypatch.setattr(module, "MOST_TIMES", 1.0)
    with hybrid.run(asked(), tmp_path / "run.h5") as result:
        (missed,) = [event.text for event in result.events if event.kind == "accuracy missed"]
        assert result.attributes["effort_runs"] == 4 and result.done
        assert "refined no further" in missed and "which this run meets" in missed
    assert differences(tmp_path / "run.h5", tmp_path / "free.h5") != []


def test_a_scene_with_too_few_cells_for_coarser_runs_keeps_its_result() -> None:
    """What is refused of a run to compare with was said of the scene, and the result lost."""
    section = {"length": 40, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 20.0}
    payout = {"rate": 1.0, "ramp": 0.5, "until": 0.6}
    scene = cable_scene(section, pinned_at(-25, 0, -20), pinned_at(0, 0, 0, payout=payout), fluid={"density": 1025},
                        initial="equilibrium", model="rod", mesh=6, time=(1, 0.05))  # fmt: skip
    found = hybrid.run(scene | {"output": {"errors": True}})
    (text,) = [x.text for x in found.events if x.kind == "no error figure"]
    assert found.status == "complete" and "a coarser run to compare with failed: expected 4 cells" in text
