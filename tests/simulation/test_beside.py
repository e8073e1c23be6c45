"""Runs to compare with in threads: the same bits, one listener, and what fails or is stopped ends all of them."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from bits import differences

import hybrid
import hybrid.solve.network_steps
from hybrid.model.network import NetworkResolution
from hybrid.simulation import case as cases
from hybrid.simulation import progress as reports
from hybrid.simulation.case import THREADS, Case, beside, thread_count
from hybrid.simulation.progress import ESTIMATION, RESULT, Progress
from tests.inside import calls_of

TOUCHDOWN = Path(__file__).parents[2] / "examples" / "touchdown.yaml"


@pytest.fixture(autouse=True)
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads for short runs as well."""
    monkeypatch.setattr(cases, "WORTH_THREADS", 0)


def scene(*settings: str) -> hybrid.Scene:
    return hybrid.load_scene(TOUCHDOWN, ["output.errors=true", "time.duration=10", *settings])


@pytest.mark.long
@pytest.mark.parametrize("settings", [["model=catenary"], ["model=rod", "accuracy=2%"], []])
def test_any_number_of_threads_gives_the_same_bits(
    settings: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    used = calls_of(monkeypatch, Case, "sample", lambda *_: threading.current_thread().name)
    for count in ("1", "2", "3"):
        monkeypatch.setenv(THREADS, count)
        used.clear()
        hybrid.run(scene(*settings), tmp_path / f"{count}.h5").close()
        assert (len({*used}) > 1) == (count != "1")
    assert differences(tmp_path / "1.h5", tmp_path / "2.h5") == []
    assert differences(tmp_path / "1.h5", tmp_path / "3.h5") == []


@pytest.mark.parametrize(("model", "runs", "least"), [("rod", 4, 0.5), ("catenary", 5, 1 / 3)])
def test_the_listener_is_called_by_the_thread_that_runs(
    model: str, runs: int, least: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A catenary has one more run, with rods in its place; least: part that the result is of all."""
    monkeypatch.setattr(reports, "REPORT_EVERY", -1.0)
    monkeypatch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 1)
    monkeypatch.setenv(THREADS, "3")
    heard: list[Progress] = []

    def listen(progress: Progress) -> None:
        assert threading.current_thread() is threading.main_thread()
        heard.append(progress)

    hybrid.run(scene(f"model={model}"), progress=listen).close()
    assert {p.runs for p in heard} == {runs}
    assert {p.name for p in heard} == {ESTIMATION, RESULT} and heard[-1].run == runs
    fractions = [p.fraction for p in heard]
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(1.0)
    first = next(p.fraction for p in heard if p.name == ESTIMATION)
    assert first > least, "what other threads have done is left out"
    on_the_way = [p.fraction for p in heard if p.t < p.duration]  # how far the others are by then is a race
    assert max(on_the_way) < 1.0, "what other threads have done is counted twice"


def ended(before: set[threading.Thread]) -> bool:
    """Whether all threads that were not there before come to their end soon."""
    for thread in set(threading.enumerate()) - before:
        thread.join(10.0)
    return set(threading.enumerate()) <= before


@pytest.mark.long
def test_an_interrupt_ends_all_threads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reports, "REPORT_EVERY", -1.0)
    monkeypatch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 1)
    monkeypatch.setenv(THREADS, "2")
    before = set(threading.enumerate())

    def stop(progress: Progress) -> None:
        if progress.name == ESTIMATION and progress.step == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene("model=rod", "time.duration=60"), tmp_path / "run.h5", progress=stop)
    assert ended(before)
    assert [x.name for x in tmp_path.iterdir()] == ["run.h5"]
    with hybrid.open(tmp_path / "run.h5") as result:
        assert "errors are not estimated" in result.pending


def test_a_run_that_fails_ends_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first fails in this thread while the second, of two hours, has just begun; there is no error figure then."""
    monkeypatch.setenv(THREADS, "2")
    monkeypatch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 1)
    before, begun = set(threading.enumerate()), threading.Event()
    case = Case(scene("model=catenary", "time.duration=7200"), None)

    def first() -> None:
        assert begun.wait(10.0)
        raise hybrid.ComputationError(hybrid.errors.Outcome.NOT_CONVERGED, 1.0, 2.0, "made up")

    def second() -> None:
        begun.set()
        case.sample(NetworkResolution.of(case.lines))

    with pytest.raises(hybrid.ComputationError), case.beside([first, second]) as runs:  # type: ignore[list-item]
        runs[0]()
    assert ended(before)


def test_what_fails_in_another_thread_is_raised_in_its_turn() -> None:
    def fails() -> int:
        raise ValueError("second")

    with beside([lambda: 1, fails, lambda: 3], 3, lambda: None, lambda: None) as runs:
        assert runs[0]() == 1
        with pytest.raises(ValueError, match="second"):
            runs[1]()
        assert runs[2]() == 3


@pytest.mark.parametrize("value", ["0", "two", "-1", "1.5"])
def test_a_number_of_threads_that_is_none_is_refused(value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, value)
    with pytest.raises(hybrid.ResultError, match="HYBRID_THREADS") as caught:
        thread_count()
    assert value in str(caught.value) and "HYBRID_THREADS=1" in str(caught.value)
