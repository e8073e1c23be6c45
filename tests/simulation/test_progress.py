"""One bar over all passes of a run: which pass, how much of all is done, how long all still take."""

from __future__ import annotations

import io
from typing import Any

import pytest

import hybrid
import hybrid.solve.network_steps
from hybrid.model.resolution import Resolution
from hybrid.simulation import progress as module
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, Progress, ProgressReporter, StatusLine

HANGING = """
cable: {sections: [{length: 10.0, mass: 1.0}]}
ends: {start: {kind: pinned, position: [0, 0, 0]}, end: {kind: pinned, position: [8, 0, 0], motion: {surge: {amplitude: 0.2, period: 2.0}, ramp: 1.0}}}
initial: equilibrium
model: catenary
"""


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> list[Progress]:
    """A listener that hears of every step."""
    monkeypatch.setattr(module, "REPORT_EVERY", -1.0)
    return []


def test_every_pass_is_named_and_one_bar_spans_them(heard: list[Progress]) -> None:
    scene = hybrid.parse_scene(HANGING + "time: {duration: 2.0}\naccuracy: 10 %\n")
    hybrid.run(scene, progress=heard.append).close()
    names = [p.name for k, p in enumerate(heard) if k == 0 or p.run != heard[k - 1].run]
    assert names[:5] == [PRE_RUN, RESULT, ESTIMATION, ESTIMATION, ESTIMATION]
    assert set(names[5:]) <= {REFINEMENT, ESTIMATION}
    planned = [p for p in heard if p.run <= 5]
    assert {p.runs for p in planned} == {5}
    fractions = [p.fraction for p in planned]
    assert fractions == sorted(fractions) and 0.0 < fractions[0] < 0.1 and fractions[-1] == pytest.approx(1.0)
    assert heard[-1].fraction == pytest.approx(1.0) and heard[-1].seconds_left == pytest.approx(0.0)
    assert all(p.seconds_left is None or p.seconds_left >= 0.0 for p in heard)
    assert "run 3 of 5: error estimation" in next(p.text for p in heard if p.run == 3)


def test_a_run_without_an_error_figure_is_one_pass(heard: list[Progress], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 1)  # a step a call
    scene = hybrid.parse_scene(HANGING + "time: {duration: 1.0, step: 0.1}\n")
    hybrid.run(scene, progress=heard.append).close()
    assert {(p.run, p.runs, p.name) for p in heard} == {(1, 1, RESULT)}
    assert [p.step for p in heard[:3]] == [1, 2, 3] and heard[4].fraction == pytest.approx(0.5)
    assert "run 1" not in heard[0].text


def reporter(listener: Any) -> tuple[ProgressReporter, Resolution]:
    made, resolution = ProgressReporter(listener, 10.0), Resolution(1.0, 0.1, None, 1e-3)
    return made, resolution


def test_passes_that_did_not_take_place_are_dropped(heard: list[Progress]) -> None:
    made, resolution = reporter(heard.append)
    made.expect([(ESTIMATION, resolution.coarser(2, 2))] * 3 + [(RESULT, resolution)], resolution)
    made.begin(ESTIMATION, resolution.coarser(2, 2))  # it fails, and the others are not tried
    made.begin(RESULT, resolution)
    made(5.0, 1, 1, ())
    assert (heard[-1].run, heard[-1].runs, heard[-1].name) == (2, 2, RESULT)


def test_a_refinement_is_added_when_it_begins(heard: list[Progress]) -> None:
    made, resolution = reporter(heard.append)
    made.expect([(RESULT, resolution)], resolution)
    made.begin(RESULT, resolution)
    made(10.0, 100, 1, (), finished=True)
    made.begin(REFINEMENT, resolution.coarser(1.0, 0.5))
    made(0.0, 1, 1, ())
    assert (heard[-1].run, heard[-1].runs) == (2, 2)
    assert heard[0].fraction == 1.0 and heard[-1].fraction == pytest.approx(1 / 3)
    assert heard[-1].seconds_left is None, "the speed of the pass before says little"


def test_a_run_that_begins_anew_is_at_its_beginning(heard: list[Progress]) -> None:
    """A line that went slack at 4 of 10 s is computed again with rods: nothing of the result is done then."""
    made, resolution = reporter(heard.append)
    made.begin(RESULT, resolution)
    made(4.0, 40, 1, ())
    made.begin_anew()
    made.begin(RESULT, resolution)
    made(0.0, 0, 1, ())
    assert (heard[-1].fraction, heard[-1].run, heard[-1].runs) == (0.0, 1, 1)


def test_the_pre_run_of_several_lines_is_a_part_of_all(heard: list[Progress], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 1)  # a step a call
    section = {"length": 10.0, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5}
    points = {"a": {"position": [0, 0, 0]}, "b": {"position": [8, 0, 0]}, "c": {"position": [8, 4, 0]}}
    lines = {x: {"start": "a", "end": x, "sections": [section], "model": "catenary"} for x in "bc"}
    scene = {"points": points, "lines": lines, "time": {"duration": 0.5, "step": 0.05}, "accuracy": "10 %"}
    hybrid.run(scene, progress=heard.append).close()
    shown = {p.name: p for p in reversed(heard)}  # the first of each
    assert heard[0].name == PRE_RUN and heard[0].runs == 5
    assert max(p.fraction for p in heard if p.name == PRE_RUN) < 0.5 and shown[RESULT].fraction < 0.5


def test_reports_come_about_ten_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now, heard = [0.0], []
    monkeypatch.setattr(module.clock, "perf_counter", lambda: now[0])
    made, resolution = reporter(heard.append)
    made.begin(RESULT, resolution)
    for k in range(1, 65):
        now[0] = k / 64  # so that times are exact in binary
        made(5.0 * k / 64, k, 2, ())
    assert [p.step for p in heard] == [*range(1, 65, 7)], "7/64 s is the first that is 0.1 s after the last"
    assert heard[-1].seconds_left == pytest.approx(1.0), "5 s of 10, at 5 s a second"


def test_true_shows_a_line_on_the_error_stream(capsys: pytest.CaptureFixture[str]) -> None:
    hybrid.run(hybrid.parse_scene(HANGING + "time: {duration: 1.0, step: 0.1}\n"), progress=True).close()
    out, err = capsys.readouterr()
    assert out == "" and "t = 1 of 1 s, 100 % done" in err and err.endswith("\n")


def test_a_first_use_says_beforehand_that_it_compiles(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "is_warm", lambda kernels: False)
    hybrid.run(hybrid.parse_scene(HANGING + "time: {duration: 1.0, step: 0.1}\n"), progress=True).close()
    assert capsys.readouterr().err.startswith(module.COMPILING + "\n\r")


def test_a_shorter_line_covers_a_longer_one() -> None:
    stream = io.StringIO()
    line = StatusLine(stream)
    for t, runs in ((0.123, 4), (10.0, 1)):
        line(Progress(t, 10.0, 1, 1, (), 0.0, runs=runs))
    line.close()
    line.close()
    long, short = stream.getvalue().strip("\n").split("\r")[1:]
    assert len(long) == len(short) and stream.getvalue().count("\n") == 1


def test_the_line_is_closed_when_the_run_fails() -> None:
    class Closing:
        closed = False

        def __call__(self, progress: Progress) -> None:
            raise KeyboardInterrupt

        def close(self) -> None:
            self.closed = True

    listener = Closing()
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(hybrid.parse_scene(HANGING + "time: {duration: 1.0, step: 0.1}\n"), progress=listener)
    assert listener.closed
