"""Runs of a case to compare with: what they keep, and where; pre-runs; what was stopped goes on."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences
from test_late_file import described
from test_result_first import asked, rough, stopped_in  # noqa: F401

import hybrid
import hybrid.solve.network_steps
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution
from hybrid.model.sections import OutputPoints
from hybrid.scene.read import as_scene
from hybrid.scene.root import LINE, in_full
from hybrid.simulation import progress as module
from hybrid.simulation import progress as reports
from hybrid.simulation import run_line, run_sample
from hybrid.simulation.case import Case
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, Progress, ProgressReporter, StatusLine
from hybrid.simulation.run_sample import ALL, MOST_PLACES, RunSample, at_all_points, compared_places
from hybrid.solve.network_steps import CELL_STEPS, NetworkSteps
from tests.inside import calls_of
from tests.scenes import cable_scene, pinned_at

SCENE: dict[str, Any] = cable_scene(
    {"length": 20, "mass": 1.5, "axial_stiffness": 1e6, "bending_stiffness": 50, "diameter": 0.02}, pinned_at(0, 0, 0),
    pinned_at(15, 0, 2, motion={"heave": {"amplitude": 0.4, "period": 2.0}, "ramp": 1.0}), mesh=40,
    time={"duration": 0.8}, output=0.05, accuracy="1%"
)  # fmt: skip
SAME = 1e-8  # of the scale of a quantity


def sample(case: Case, **more: Any) -> RunSample:
    """A run of a case to compare with."""
    return case.sample(NetworkResolution.of(case.lines), **more)[LINE]


def assert_same(a: RunSample, b: RunSample) -> None:
    """All that is compared of two runs is the same."""
    assert (a.steps, a.cells, a.every, a.touches, a.notes) == (
        b.steps,
        b.cells,
        b.every,
        b.touches,
        b.notes,
    )
    for mine, its in ((a.values, b.values), (a.extremes, b.extremes)):
        assert set(mine) == set(its)
        for name in mine:
            one, two = np.asarray(mine[name]), np.asarray(its[name])
            assert one.shape == two.shape, name
            assert np.abs(one - two).max(initial=0.0) <= SAME * max(float(np.abs(one).max(initial=0.0)), 1e-3), name
    for one, two in ((a.forces, b.forces), (a.catenary, b.catenary)):
        np.testing.assert_allclose(one, two, rtol=1e-7, atol=1e-7)


def test_a_pre_run_ends_before_the_run_at_places_of_its_own() -> None:
    case = Case(as_scene(SCENE | {"model": "catenary", "dimension": 3}), None)
    places = np.array([0.0, 3.3, 20.0])
    found = sample(case, points={LINE: places}, until=0.32)
    assert found.values["tension"].shape == (8, 3)


def test_an_output_does_not_depend_on_those_that_are_looked_at_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case(as_scene(SCENE | {"model": "catenary"}), None)
    together = sample(case)
    monkeypatch.setattr(run_line, "WAITING", 1)
    assert_same(together, sample(case))


def test_many_outputs_go_into_a_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    case = Case(as_scene(SCENE | {"model": "catenary"}), None)
    kept = sample(case)
    case.beside_result = tmp_path / "run.h5"
    monkeypatch.setattr("hybrid.simulation.case.MOST_IN_MEMORY", 10)
    stored = sample(case)
    assert stored.rows and len(list(tmp_path.iterdir())) == 1
    assert_same(kept, stored)


def test_errors_that_were_not_estimated_are_made_up_for(monkeypatch: Any, tmp_path: Path) -> None:
    """A result that is complete, but for its errors."""
    tables = SCENE | {"model": "catenary", "time": {"duration": 0.2, "step": 0.02}, "output": {"errors": True}}
    del tables["accuracy"]
    scene, path = in_full(as_scene(tables)), tmp_path / "run.h5"

    def stop(progress: Any) -> None:
        if progress.name == "error estimation":
            raise KeyboardInterrupt

    monkeypatch.setattr("hybrid.simulation.progress.REPORT_EVERY", 0.0)
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene, path, progress=stop)
    assert hybrid.open(path).pending
    assert "error_total_position" in hybrid.resume(path).attributes


def test_a_line_that_is_let_go_is_not_at_rest() -> None:
    """Its end forces then have the order of a start."""
    held = Case(as_scene(SCENE), None)
    ends = {name: dict(x) for name, x in SCENE["ends"].items()}
    ends["start"]["release_at"] = {"time": 0.4}
    assert held.from_rest and not Case(as_scene(SCENE | {"ends": ends}), None).from_rest


# --- How long a call of the compiled run may take: Ctrl-C is heard while zones change every few steps, and in many
# waves ---

SEA = Path(__file__).parents[2] / "examples" / "irregular_sea.yaml"
CELLS = 60  # at the start


def test_changes_of_zones_do_not_put_off_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    """200 steps in calls of 20, in which zones change 17 times."""
    scene = hybrid.load_scene(SEA, ["time.duration=10"])
    monkeypatch.setattr(reports, "REPORT_EVERY", -1.0)
    waves = scene.environment.fluid.waves.components
    monkeypatch.setattr(
        hybrid.solve.network_steps,
        "CELL_STEPS",
        20 * CELLS * (1.0 + waves / hybrid.solve.network_steps.WAVES_OF_A_CELL),
    )
    heard: list[Progress] = []
    hybrid.run(scene, progress=heard.append).close()
    assert len(heard) > 8


def test_calls_in_many_waves_are_shorter() -> None:
    steps = NetworkSteps(0.5)
    steps._cells, most = 1000, int(CELL_STEPS)
    steps.set_quota(most)
    assert steps.counts.quota == CELL_STEPS // 1000
    steps._waves = 90
    steps.set_quota(most)
    assert steps.counts.quota == CELL_STEPS // 10_000


# --- One bar over all passes of a run: which pass, how much of all is done, how long all still take ---

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


# --- Runs are compared at the ends and at some hundred places, however many output points there are; errors are at
# all ---

POINTS = 301


def test_which_places() -> None:
    """All, where there are hardly more; else ends and jumps, those beside them, and the others evenly."""
    s = np.linspace(0.0, 60.0, 601)
    assert compared_places(OutputPoints(s[:101], np.zeros(0))) is ALL
    places = compared_places(OutputPoints(s, s[[250]]))
    assert {0, 1, 2, 248, 249, 250, 251, 252, 598, 599, 600} <= set(places.tolist())
    assert places.size <= MOST_PLACES and np.diff(places).max() <= 7


def test_between_places_the_larger_error_counts() -> None:
    errors = at_all_points(np.array([[1.0, 3.0, 2.0]]), np.array([0, 2, 5]))
    assert errors.tolist() == [[1.0, 3.0, 3.0, 3.0, 3.0, 2.0]]


def test_errors_are_at_all_output_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of runs that are compared at all of them, but for what lies between places."""
    compared = calls_of(monkeypatch, Case, "sample", after=lambda x, *_: np.shape(x[LINE].values["position"])[1])
    scene = described(True) | {"output": {"every": 0.1, "points": POINTS, "errors": True}}
    with hybrid.run(scene, tmp_path / "some.h5") as some:
        places = compared_places(OutputPoints(np.asarray(some["s"]), np.zeros(0)))
        assert set(compared) == {places.size} and places.size <= MOST_PLACES
        monkeypatch.setattr(run_sample, "MOST_PLACES", POINTS)
        with hybrid.run(scene, tmp_path / "all.h5") as all_:
            assert compared[-1] == POINTS
            for name in ("total/position", "mesh/tension", "time/position", "total/end_force_end"):
                mine, its = np.asarray(some.errors[name]), np.asarray(all_.errors[name])
                assert mine.shape == its.shape
                if mine.ndim == 2:
                    np.testing.assert_array_equal(mine[:, places], its[:, places])
                assert mine.max() == pytest.approx(its.max(), rel=0.02)
            assert some.names == all_.names


@pytest.mark.parametrize(
    ("more", "section", "everywhere"),
    [
        ({"accuracy": {"tension": "1%"}}, {}, False),
        ({"accuracy": {"tension": "1%"}}, {"min_bend_radius": 0.1}, True),
        ({"accuracy": {"curvature": "5%"}}, {}, True),
        ({"accuracy": "1%", "model": "rod"}, {}, True),
        ({"output": {"points": POINTS, "errors": True}}, {}, True),
        ({"output": {"points": POINTS, "errors": True}, "model": "catenary"}, {}, False),
    ],
)
def test_where_bends_are_judged_it_is_everywhere(
    more: dict[str, Any], section: dict[str, Any], everywhere: bool
) -> None:
    """A bend of a long line lies between a hundred places."""
    scene = described() | {"model": "adaptive", "output": {"points": POINTS}} | more
    scene["cable"] = {"sections": [scene["cable"]["sections"][0] | {"bending_stiffness": 1e-3} | section]}
    assert (Case(hybrid.validate_scene(scene), None).places[LINE].size == 0) == everywhere


@pytest.mark.long
@pytest.mark.parametrize(("name", "before"), [(ESTIMATION, False), (REFINEMENT, False), (REFINEMENT, True)])
@pytest.mark.usefixtures("rough")
def test_it_is_resumed_at_the_same_places(
    name: str, before: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A result of before goes on at all points: its checkpoint has errors at all of them."""
    Stopping(monkeypatch)
    scene = asked() | {"output": {"every": 0.1, "points": POINTS}}
    with monkeypatch.context() as patched:
        if before:
            patched.setattr(run_sample, "MOST_PLACES", POINTS)
        hybrid.run(scene, tmp_path / "whole.h5").close()
        stopped_in(name, scene, tmp_path / "run.h5")
    hybrid.resume(tmp_path / "run.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
