"""What a study keeps of limits: the part that is used, the part of the time above a value, whole results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping

import hybrid
from hybrid.cli.console import Console
from hybrid.cli.study_commands import _show
from hybrid.errors import SceneError
from hybrid.scene.study import Kept, read_study, study_from
from hybrid.statistics.fatigue import YEAR, life_in_years
from hybrid.statistics.moments import exceedance
from hybrid.store.histories import history_of
from hybrid.store.study_file import accuracy_of_case, open_study, unmet_accuracy
from hybrid.studies.cases import Cases, cases_of
from hybrid.studies.study import _created, _refuse_limits_not_there, _remove_cases
from hybrid.studies.workers import Job, compute_batch, write_outcomes
from hybrid.view.several_runs import html
from tests.called import Call
from tests.scenes import line_between, network_scene

pytestmark = pytest.mark.needs("dask", "zarr", "xarray", "simpleeval", "SALib")

SECTION = "{length: 30, mass: 2, axial_stiffness: 1.0e+6, bending_stiffness: 50, max_tension: 600, min_bend_radius: 2}"
SCENE = f"""
cable: {{sections: [{SECTION}]}}
ends:
  start: {{kind: pinned, position: [0, 0, 0]}}
  end: {{kind: pinned, position: [25, 0, 0], motion: {{heave: {{amplitude: 1, period: 4}}, ramp: 4}}}}
initial: equilibrium
model: rod
mesh: {{cells: 30}}
time: {{duration: 4, step: 0.05}}
output: {{every: 0.1, errors: true}}
"""
COLLECT: dict[str, Any] = {
    "strength": {"quantity": "tension", "take": ["utilisation"]},
    "bend": {"quantity": "curvature", "take": ["utilisation"]},
    "above": {"quantity": "end_force_end", "take": ["exceedance"], "above": 300.0},
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path / "scene.yaml"


def study_of(scene: Path, **more: Any) -> Any:
    values = {"m": {"key": "cable.sections[0].mass", "values": [2.0, 3.0]}}
    return study_from({"scene": str(scene), "vary": values, "collect": COLLECT} | more)


def test_the_part_of_the_time_above_a_value() -> None:
    """Of a sine: a half above nothing, a third above half of its amplitude; of a step, to the sample."""
    t = np.linspace(0.0, 2.0 * np.pi, 20_001)
    assert exceedance(t, np.sin(t), 0.0) == pytest.approx(0.5, abs=1e-6)
    assert exceedance(t, np.sin(t), 0.5) == pytest.approx(1.0 / 3.0, abs=1e-6)
    assert exceedance([0.0, 1.0, 3.0], [[0.0, 5.0], [2.0, 5.0], [0.0, 5.0]], 1.0) == pytest.approx([0.5, 1.0])


@pytest.mark.long  # 1.2 s
def test_limits_and_whole_results_of_cases(scene: Path, tmp_path: Path) -> None:
    cases = cases_of(study_of(scene))
    wanted = {name: Kept.model_validate(kept) for name, kept in COLLECT.items()}
    outcomes = compute_batch(Job(cases.base, cases.keys, cases.rows, wanted, False, 7, str(tmp_path)))
    assert sorted(x.name for x in tmp_path.glob("*.h5")) == ["case-000007.h5", "case-000008.h5"]
    for k, outcome in enumerate(outcomes):
        assert outcome.reason == "" and outcome.status == 1
        with hybrid.open(tmp_path / f"case-{k + 7:06d}.h5") as result:
            used, kept = result.utilisation(), {name: float(values) for name, (_, values) in outcome.kept.items()}
            assert kept["strength"] == pytest.approx(result["envelope/tension_max"].max() / 600.0, rel=1e-12)
            assert kept["strength"] == used["max_tension"].used and used["max_tension"].broken == (kept["strength"] > 1)
            assert kept["bend"] == pytest.approx(2.0 * result["envelope/curvature_max"].max(), rel=1e-12)
            history = history_of(result, "end_force_end")
            assert 0.0 < kept["above"] < 1.0 or k == 1
            assert kept["above"] == pytest.approx(np.mean(history.values > 300.0), abs=0.05)
            assert kept["above"] == float(result.exceedance("end_force_end", 300.0))
    assert outcomes[0].kept["strength"][1] < outcomes[1].kept["strength"][1]


def test_what_is_not_verified_is_not_kept(scene: Path) -> None:
    """Without an error figure nobody knows which part of a limit is used."""
    scene.write_text(SCENE.replace("errors: true", "errors: false"))
    cases = cases_of(study_of(scene))
    wanted = {name: Kept.model_validate(kept) for name, kept in COLLECT.items()}
    (outcome,) = compute_batch(Job(cases.base, cases.keys, cases.rows[:1], wanted, False))
    assert set(outcome.kept) == {"above"} and outcome.absent == ""
    assert "utilisation of min_bend_radius not verified: the error of curvature is not estimated" in outcome.reason


@pytest.mark.slow
def test_a_study_keeps_whole_results(scene: Path, tmp_path: Path) -> None:
    found = hybrid.study(study_of(scene, files=True), tmp_path / "both.zarr", workers=1)
    assert (found["status"].values == 1).all() and found["strength"].attrs["units"] == ""
    with hybrid.open(tmp_path / "both.files" / "case-000001.h5") as result:
        assert float(found["strength"][1]) == result.utilisation()["max_tension"].used
    with pytest.raises(hybrid.ResultError, match="another study"):
        hybrid.study(study_of(scene), tmp_path / "both.zarr", workers=1)
    stale = tmp_path / "both.files" / "case-000009.h5"
    stale.touch()
    hybrid.study(study_of(scene, files=True), tmp_path / "both.zarr", workers=1, overwrite=True)
    assert [x.name for x in sorted(stale.parent.iterdir())] == ["case-000000.h5", "case-000001.h5"]


def test_results_of_a_study_whose_table_is_gone_are_not_taken_for_its_own(scene: Path, tmp_path: Path) -> None:
    folder = tmp_path / "both.files"
    folder.mkdir()
    (folder / "case-000009.h5").touch()
    with pytest.raises(hybrid.ResultError, match=r"holds 1 results.*table is gone"):
        hybrid.study(study_of(scene, files=True), tmp_path / "both.zarr", workers=1)
    assert not (tmp_path / "both.zarr").exists() and (folder / "case-000009.h5").exists()


@pytest.mark.parametrize(
    ("kept", "where"),
    [
        ({"quantity": "tension", "take": ["exceedance"]}, "above"),
        ({"quantity": "tension", "above": 3.0}, "above"),
        ({"quantity": "torque", "take": ["utilisation"]}, "quantity"),
        ({"quantity": "tension", "take": ["utilisation"], "at": 3.0}, "at"),
        ({"quantity": "tension", "take": ["utilisation"], "times": [0.0, 1.0]}, "times"),
    ],
)
def test_what_makes_no_sense_is_refused(scene: Path, kept: dict[str, Any], where: str) -> None:
    with pytest.raises(SceneError) as refused:
        study_of(scene, collect={"x": kept})
    assert refused.value.complaints[0].where.endswith(where)


@pytest.mark.long  # 1.3 s
def test_without_a_limit_nothing_is_kept(scene: Path) -> None:
    scene.write_text(SCENE.replace(", max_tension: 600", ""))
    cases = cases_of(study_of(scene))
    wanted = {"strength": Kept.model_validate(COLLECT["strength"])}
    (outcome, _) = compute_batch(Job(cases.base, cases.keys, cases.rows, wanted, False))
    assert outcome.status == 2 and "no section has a max_tension" in outcome.reason


def test_a_limit_that_no_section_has_is_refused_before_the_first_run(scene: Path, tmp_path: Path) -> None:
    """Known from the scene alone; not where the limit is what is varied."""
    scene.write_text(SCENE.replace(", max_tension: 600", ""))
    with pytest.raises(SceneError) as refused:
        hybrid.study(study_of(scene), tmp_path / "none.zarr", workers=1)
    (complaint,) = refused.value.complaints
    assert complaint.where == "collect.strength.take" and "no section has a max_tension" in complaint.expected
    assert not (tmp_path / "none.zarr").exists()
    varied = study_of(scene, vary={"most": {"key": "cable.sections[0].max_tension", "values": [500.0, 600.0]}})
    _refuse_limits_not_there(cases_of(varied), varied.collect)


def test_of_several_lines_the_line_itself_must_have_the_limit() -> None:
    """Another line's limit is of no use."""
    base = {"lines": {"a": {"sections": [{"max_tension": 5.0}]}, "b": {"sections": [{"max_tension": None}]}}}
    cases = Cases(base, {}, [{}], {}, {}, False, {})
    kept = {"quantity": "tension", "take": ("utilisation",)}
    _refuse_limits_not_there(cases, {"x": Kept(**kept, line="a")})
    with pytest.raises(SceneError, match="no section of line b has a max_tension"):
        _refuse_limits_not_there(cases, {"x": Kept(**kept, line="b")})


def test_a_study_that_begins_anew_removes_snapshots_of_failed_cases(tmp_path: Path) -> None:
    for name in ("case-000015.h5", "case-000015.snapshot.npz", "mine.txt"):
        (tmp_path / name).touch()
    _remove_cases(tmp_path)
    assert [x.name for x in tmp_path.iterdir()] == ["mine.txt"]


def test_stats_tell_limits_and_the_time_above_a_value(scene: Path, tmp_path: Path, call: Call) -> None:
    result = hybrid.run(scene, tmp_path / "run.h5", progress=False)
    used, part = result.utilisation()["max_tension"].used, float(result.exceedance("end_force_end", 400.0))
    result.close()
    told = call("stats", "run.h5", "--names", "end_force_end", "--above", "400")
    said = " ".join(told.out.split())
    assert not told.code
    assert f"end_force_end is above 400 N for {100.0 * part:.3g} % of the time" in said
    assert used is not None and f"{100.0 * used:.4g} % of max_tension used" in said
    assert "MBR utilisation of" in said


def test_stats_of_a_run_that_was_stopped_say_so(
    scene: Path, tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.write_text(SCENE.replace("errors: true", "errors: false"))
    Stopping(monkeypatch).stop(20, hybrid.run, scene, tmp_path / "run.h5")
    told = call("stats", "run.h5", "--names", "end_force_end")
    assert not told.code and "note: of a run that has not come to its end; interrupted" in " ".join(told.err.split())


def test_statistics_name_what_has_none(scene: Path) -> None:
    result = hybrid.run(scene, progress=False)
    with pytest.raises(hybrid.ResultError, match=r"^'end_force_end': one value is too few"):
        t = float(result["steps/t"][3])
        result.statistics(["end_force_end"], times=(t, t))


# --- The studies of examples/ are what they say: read whole, and one of them computed with short runs ---

STUDIES = Path(__file__).parents[2] / "examples" / "studies"
CASES = {"heave": 14, "launch_window": 42, "touchdown_fatigue": 6, "storm_seeds": 20, "fatigue_sensitivity": 192}


@pytest.mark.parametrize("name", CASES)
def test_examples_are_read(name: str) -> None:
    assert len(cases_of(read_study(STUDIES / f"{name}.yaml")).rows) == CASES[name]


def test_there_is_no_other_example() -> None:
    studies = {file.stem for file in STUDIES.glob("*.yaml") if "\nscene:" in file.read_text(encoding="utf-8")}
    assert studies == set(CASES)


@pytest.mark.long
def test_life_over_a_scatter_diagram(tmp_path: Path) -> None:
    """Damage of each sea state at every place, times its part of the time, is the rate of the life."""
    study = read_study(STUDIES / "touchdown_fatigue.yaml")
    text = Path(study.scene).read_text(encoding="utf-8").replace("duration: 700, step: 0.1", "duration: 60, step: 0.25")
    (tmp_path / "short.yaml").write_text(text.replace("cells: 80", "cells: 24"), encoding="utf-8")
    kept = {"fatigue": study.collect["fatigue"].model_copy(update={"times": (20.0, 60.0)})}  # type: ignore[index]
    short = study.model_copy(update={"scene": str(tmp_path / "short.yaml"), "collect": kept})
    found = hybrid.study(short, tmp_path / "short.zarr", workers=1)
    assert found["status"].values.tolist() == [1] * 6
    assert found["part"].values.sum() == pytest.approx(1.0)
    years = life_in_years(found["fatigue"].values, found["part"].values, 40.0)
    rate = (found["part"].values[:, None] * found["fatigue"].values).sum(axis=0) / 40.0
    assert years == pytest.approx(1.0 / (rate * YEAR))
    damage = found["fatigue"].values.max(axis=1)
    assert np.all(np.diff(damage[:3]) > 0.0)  # higher waves do more


# --- What a study says of the accuracy asked: how many cases missed it, or have it not verified, the worst, what to
# do ---

FIXED_SCENE = """
environment: {fluid: {density: 1025}, seabed: {z: -41, stiffness: 1.0e+4, friction: 0.0}}
cable: {sections: [{length: 60, mass: 8, diameter: 0.04, axial_stiffness: 1.0e+7, drag: {normal: 1.2}}]}
ends:
  start: {kind: pinned, position: [0, 0, -40]}
  end: {kind: pinned, position: [35, 0, 0], motion: {heave: {amplitude: 1.0, period: 5.0}, ramp: 5}}
initial: equilibrium
accuracy: {position: 2 m, tension: 10%}
model: catenary
mesh: {cells: 16}
time: {duration: 3, step: 0.1}
"""
VARY = {
    "asked": {"key": "accuracy.position", "values": ["2 m", "50 mm", "5 mm", "20 mm", "2 m"]},
    "mu": {"key": "environment.seabed.friction", "values": [0, 0, 0, 0, 0.5]},
}


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of five cases: the first meets what is asked, three miss it, and of the last it is not verified."""
    folder = tmp_path_factory.mktemp("accuracy")
    (folder / "scene.yaml").write_text(FIXED_SCENE)
    collect = {"force": {"quantity": "end_force_end"}}
    asked = study_from({"scene": "scene.yaml", "vary": VARY, "combine": "zip", "collect": collect}, folder)
    cases = cases_of(asked)
    file = _created(folder / "study.zarr", asked, cases, asked.collect, "", len(cases.rows), ())
    write_outcomes(file, 0, compute_batch(Job(cases.base, cases.keys, cases.rows, asked.collect, False)))
    return file.path


def test_which_cases_do_not_meet_it(table: Path) -> None:
    found = open_study(table)
    assert found["accuracy_verdict"].values[0] == "met" and found["accuracy_used"].values[0] < 1.0
    missed, unknown = unmet_accuracy(found)
    assert missed.verdict == "missed" and missed.cases == [1, 2, 3] and missed.done == 5
    assert missed.worst == 2 and missed.used == found["accuracy_used"].values.max() > 4.0
    assert "asked 0.005 m" in missed.text and "try: leave mesh" in missed.text
    assert unknown.verdict == "not verified" and unknown.cases == [4] == [unknown.worst]
    told = "the error of end forces is not known: it does not converge; try: shorter steps and cells"
    assert unknown.text == told  # before `static friction neglected`
    assert not unmet_accuracy(found.isel(case=[0])) and not unmet_accuracy(found.drop_vars("accuracy_verdict"))


@pytest.mark.parametrize("as_json", [False, True], ids=["people", "programs"])
def test_the_summary_and_the_page_say_so(table: Path, as_json: bool, capsys: pytest.CaptureFixture[str]) -> None:
    _show(Console(as_json, False), open_study(table), table, 1.0, None)
    told = capsys.readouterr()
    if as_json:
        rows = [x for x in map(json.loads, told.out.splitlines()) if x["event"] == "accuracy"]
        assert [(x["verdict"], x["worst"]) for x in rows] == [("missed", 2), ("not verified", 4)]
        return
    for text in ("3 of 5 cases missed the accuracy asked, case 2 most of all (", "leave mesh", "1 of 5 cases have the"):
        assert text in told.err and text in html(table)
    assert "accuracy_used" not in told.out


@pytest.mark.parametrize("order", [["few", "many"], ["many", "few"]])
def test_the_largest_share_of_what_was_asked_is_found_in_any_order_of_lines(order):
    """A line first of which no error is known hid by how much another one missed."""
    section = {"length": 30, "mass": 1.5, "diameter": 0.03, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
    of = {"few": ("a", 2), "many": ("b", 8)}
    lines = {name: line_between(of[name][0], "m", section, model="catenary", mesh=of[name][1]) for name in order}
    heave = {"heave": {"amplitude": 0.5, "period": 5}, "ramp": 3}
    points = {
        "a": {"position": [0, 0, 0]},
        "b": {"position": [50, 0, 0]},
        "m": {"position": [25, 0, -10], "motion": heave},
    }
    found = hybrid.run(network_scene(points, lines, fluid={"density": 1025}, time=6, output=(0.5, 11), accuracy="0.1%"))
    verdict, used = accuracy_of_case(found)
    assert "line many" in verdict and used > 1.0
