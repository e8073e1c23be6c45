"""Studies: which cases there are, what is kept, and that nothing is lost or done twice."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from killed_studies import killed_study

import hybrid
from hybrid.errors import ResultError, SceneError
from hybrid.scene.study import Kept, read_study, study_from
from hybrid.store.study_file import DONE, FAILED, KILLED, NOT_WRITTEN, OPEN, StudyFile
from hybrid.studies.cases import cases_of, short_names
from hybrid.studies.study import client_of
from hybrid.studies.workers import collected
from tests.called import Call

pytestmark = pytest.mark.needs("dask", "zarr", "xarray", "simpleeval", "SALib")

SCENE = """
environment: {fluid: {density: 1025}}
cable:
  sections: [{length: 60, mass: 8, diameter: 0.04, axial_stiffness: 1.0e+7, drag: {normal: 1.2}}]
ends:
  start: {kind: pinned, position: [0, 0, -40]}
  end: {kind: pinned, position: [35, 0, 0], motion: {heave: {amplitude: 1.0, period: 5.0}, ramp: 5}}
initial: equilibrium
model: catenary
mesh: {cells: 16}
time: {duration: 6, step: 0.1}
output: {every: 0.5}
"""
STUDY = """
title: heave
scene: scene.yaml
vary:
  A: {key: ends.end.motion.heave.amplitude, values: [0.2, 0.5, 30], unit: m}
  T: {key: ends.end.motion.heave.period, from: 4, to: 7, step: 1, unit: s}
only_if: A < 1 or T == 4
derive: {acceleration: A * (2 * pi / T)**2}
collect:
  force: {quantity: end_force_end, take: [max, mean]}
  tension: {quantity: tension, at: [0, 30], take: [max, history]}
  shape: {quantity: tension, take: [profile]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    (folder / "scene.yaml").write_text(SCENE)
    (folder / "heave.yaml").write_text(STUDY)
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> object:
    return hybrid.study(folder / "heave.yaml", workers=2, batch=2)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Address of a scheduler with one worker, for studies that are not about how it starts: that takes seconds."""
    with client_of(1, None) as client:
        yield client.scheduler.address


# ---- cases ----------------------------------------------------------------------------------------


def rows(folder: Path, **study: object) -> list[dict]:
    return cases_of(study_from({"scene": "scene.yaml"} | study, folder)).rows


STEP, CELLS = "time.step", "mesh.cells"


def test_grid_zip_and_ranges(folder: Path) -> None:
    """A grid has every value with every other, the last fastest; whole numbers stay whole."""
    grid = rows(folder, vary={STEP: [0.1, 0.2], CELLS: {"from": 8, "to": 12, "step": 2}})
    assert grid == [{"step": s, "cells": c} for s in (0.1, 0.2) for c in (8, 10, 12)]
    assert all(isinstance(row["cells"], int) for row in grid)
    zipped = rows(folder, vary={STEP: [0.1, 0.2], CELLS: [8, 12]}, combine="zip")
    assert zipped == [{"step": 0.1, "cells": 8}, {"step": 0.2, "cells": 12}]
    assert [r["step"] for r in rows(folder, vary={STEP: {"from": 0.1, "to": 0.3, "count": 3}})] == [0.1, 0.2, 0.3]


@pytest.mark.long  # 1.0 s
def test_conditions_and_derived_columns(folder: Path) -> None:
    study = study_from(
        {
            "scene": "scene.yaml", "vary": {STEP: [0.1, 0.2], CELLS: [8, 12]}, "only_if": "step * cells < 2",
            "derive": {"work": "cells / step"},
        },
        folder,
    )  # fmt: skip
    cases = cases_of(study)
    assert cases.rows == [{"step": 0.1, "cells": 8}, {"step": 0.1, "cells": 12}, {"step": 0.2, "cells": 8}]
    assert cases.derived["work"] == pytest.approx([80.0, 120.0, 40.0])


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_samples_fill_their_bounds(folder: Path, method: str) -> None:
    """Every quarter of each axis has a quarter of the points; the same seed gives the same sample."""
    vary = {STEP: {"low": 0.1, "high": 0.2}, "m": {"key": "cable.sections[0].mass", "low": 5, "high": 9}}
    sample = {"method": method, "count": 32, "seed": 3}
    found = rows(folder, vary=vary, sample=sample)
    for name, low, high in (("step", 0.1, 0.2), ("m", 5.0, 9.0)):
        counts, _ = np.histogram([row[name] for row in found], 4, (low, high))
        assert counts.tolist() == [8, 8, 8, 8]
    assert found == rows(folder, vary=vary, sample=sample) != rows(folder, vary=vary, sample=sample | {"seed": 4})


def test_a_table_of_cases(folder: Path) -> None:
    """Columns are keys of the scene or names of variables; a table is crossed with what is listed."""
    (folder / "cases.csv").write_text("# two\ntime.step, ends.start.position\n0.1, far\n0.2, near\n")
    with pytest.raises(SceneError, match="position"):
        rows(folder, cases="cases.csv")
    (folder / "cases.csv").write_text("time.step\n0.1\n0.2\n")
    found = rows(folder, cases="cases.csv", vary={CELLS: [8, 12]})
    assert found == [{"step": s, "cells": c} for s in (0.1, 0.2) for c in (8, 12)]
    (folder / "cases.csv").write_text("time.step\n0.1, 3\n")
    with pytest.raises(SceneError, match="one for each column"):
        rows(folder, cases="cases.csv")


def test_short_names_are_unlike() -> None:
    names = short_names(["time.step", "a.b", "c.b", "cable.sections[0].mass", "x.case"])
    assert list(names.values()) == ["step", "a_b", "c_b", "mass", "x_case"]


@pytest.mark.parametrize(
    ("study", "text"),
    [
        ({"vary": {"time.stepp": [0.1]}}, "did you mean"),
        ({"vary": {STEP: [-1.0]}}, "time.step"),
        ({"vary": {STEP: []}}, "vary.time.step"),
        ({"vary": {STEP: {"from": 1, "to": 0, "count": 3}}}, ">= from"),
        ({"vary": {STEP: {"low": 0.1, "high": 0.2}}}, "a sample, because"),
        ({"vary": {STEP: [0.1]}, "sample": {"method": "sobol", "count": 6}}, "power of two"),
        ({"vary": {STEP: [0.1, 0.2], CELLS: [8, 9, 10]}, "combine": "zip"}, "equal length"),
        ({"vary": {STEP: [0.1]}, "only_if": "step > 1"}, "only_if"),
        ({"vary": {STEP: [0.1]}, "only_if": "stepp > 1"}, "of step"),
        ({"vary": {STEP: [0.1]}, "only_if": "__import__('os')"}, "arithmetic"),
        ({"vary": {STEP: [0.1]}, "collect": {"x": {"quantity": "tension", "take": ["damage"]}}}, "curve of fatigue"),
        ({"vary": {STEP: [0.1]}, "collect": {"case": {"quantity": "tension"}}}, "a name of letters"),
        ({}, "variables, or a table"),
        ({"vary": {STEP: [0.1] * 1001, CELLS: [8] * 1001}}, "cases"),
        ({"vary": {STEP: [0.1]}, "cases": "nowhere.csv"}, "nowhere.csv"),
        ({"vary": {STEP: [0.1, 0.2]}, "only_if": "step = 0.1"}, "only_if"),
        ({"vary": {"a": {"key": STEP, "values": [0.1]}, "b": {"key": STEP, "values": [0.2]}}}, "sets it too"),
        ({"vary": {STEP: [0.1]}, "derive": {"step": "2 * step"}}, "of its own"),
        ({"vary": {STEP: [0.1]}, "collect": {"x": {"quantity": "curvature", "take": ["damage"], "curve": "D sea"}}}, "tension, of which"),
    ],
)  # fmt: skip
def test_what_is_no_study_is_refused(folder: Path, study: dict, text: str) -> None:
    with pytest.raises(SceneError, match=text):
        cases_of(study_from({"scene": "scene.yaml"} | study, folder))


def test_complaints_have_line_and_column(folder: Path) -> None:
    file = folder / "wrong.yaml"
    file.write_text("scene: scene.yaml\nvary:\n  A: {key: time.step, from: 1}\ncolect: {}\n")
    with pytest.raises(SceneError) as refused:
        read_study(file)
    assert [(c.line, c.where) for c in refused.value.complaints] == [(3, "vary.A"), (4, "colect")]
    assert "collect" in refused.value.complaints[1].fix


def test_a_scene_is_no_study(folder: Path) -> None:
    with pytest.raises(SceneError, match="names a scene and what is varied"):
        read_study(folder / "scene.yaml")


def test_an_address_without_a_port_is_refused() -> None:
    with pytest.raises(ResultError, match="tcp://host:8786"), client_of(None, "foo"):
        pass


# ---- runs -----------------------------------------------------------------------------------------


def test_every_case_is_the_run_of_its_scene(folder: Path, found: object) -> None:
    """What is kept is, to the last bit, what the run alone gives; failures have their reason."""
    ds = found
    assert ds["status"].values.tolist() == [DONE] * 8 + [FAILED]
    assert "is too short" in str(ds["reason"].values[8]) and np.isnan(ds["force_max"].values[8])
    assert ds["A"].attrs["units"] == "m" and ds["tension_max"].dims == ("case", "tension_at")
    assert ds["acceleration"].values[0] == pytest.approx(0.2 * (2 * np.pi / 4.0) ** 2)
    for case in (0, 5):
        settings = [
            f"ends.end.motion.heave.amplitude={ds['A'].values[case]}",
            f"ends.end.motion.heave.period={ds['T'].values[case]}",
        ]
        result = hybrid.run(hybrid.load_scene(folder / "scene.yaml", settings))
        assert ds["force_max"].values[case] == result["steps/end_force_end"].max()
        assert np.array_equal(ds["shape_profile"].values[case], result.tension.max(axis=0))
        assert np.array_equal(
            ds["tension_history"].values[case], result.at(s=[0.0, 30.0], names=["tension"])["tension"]
        )
        assert ds["steps"].values[case] == len(result["steps/t"])


@pytest.mark.long
def test_other_workers_and_batches_give_the_same(folder: Path, found: object, tmp_path: Path) -> None:
    alone = hybrid.study(folder / "heave.yaml", tmp_path / "alone.zarr", workers=1, batch=9)
    for name in alone.data_vars:
        if name != "cpu":
            assert np.array_equal(alone[name].values, found[name].values, equal_nan=name not in ("reason", "events"))


def test_a_second_call_does_what_is_missing(folder: Path, found: object, monkeypatch: pytest.MonkeyPatch) -> None:
    """A complete study starts no worker; of an incomplete one only the open batches are computed."""
    from hybrid.studies import study as study_module

    monkeypatch.setattr(study_module, "client_of", None)
    again = hybrid.study(folder / "heave.yaml")
    assert again.equals(found)


def test_open_batches_are_computed_again(folder: Path, found: object, tmp_path: Path, scheduler: str) -> None:
    import shutil

    copy = tmp_path / "copy.zarr"
    shutil.copytree(folder / "heave.zarr", copy)
    file = StudyFile(copy)
    file.reopen([2, 3])
    assert file.open_batches() == [1] and (file.status == OPEN).sum() == 2
    before = hybrid.open_study(copy)["cpu"].values
    after = hybrid.study(folder / "heave.yaml", copy, scheduler=scheduler)
    assert after["force_max"].equals(found["force_max"])
    changed = np.flatnonzero(after["cpu"].values != before)
    assert set(changed.tolist()) <= {2, 3} and changed.size


@pytest.mark.parametrize("reason", [KILLED, NOT_WRITTEN + "case.h5: No space left on device"])
def test_cases_that_failed_by_what_is_around_them_are_computed_by_the_next_call(
    folder: Path, found: object, tmp_path: Path, scheduler: str, reason: str
) -> None:
    """A killed worker, a full disk: not so a case that failed by itself."""
    import shutil

    copy = tmp_path / "copy.zarr"
    shutil.copytree(folder / "heave.zarr", copy)
    file = StudyFile(copy)
    batch = file.batch
    for case, why in ((0, reason), (batch, "the line goes into compression")):
        file._group["status"][case], file._group["reason"][case] = FAILED, why
    assert StudyFile(copy).failed_around == [0]
    after = hybrid.study(folder / "heave.yaml", copy, scheduler=scheduler)
    assert np.flatnonzero(after["status"].values == FAILED).tolist() == [batch, 8]
    assert after["force_max"].equals(found["force_max"]) and after["reason"].values[0] == ""


def test_another_study_is_not_mixed_in(folder: Path, found: object, tmp_path: Path) -> None:
    """A changed value, what is kept, or the scene: refused, and the results stay; --overwrite begins anew."""
    target = folder / "heave.zarr"
    changes = [
        STUDY.replace("0.5, 30", "0.6, 30"),
        STUDY.replace("[max, mean]", "[max, min]"),
        STUDY.replace("scene: scene.yaml", "scene: other.yaml"),
    ]
    (folder / "other.yaml").write_text(SCENE.replace("mass: 8", "mass: 9"))
    for text in changes:
        (folder / "changed.yaml").write_text(text)
        with pytest.raises(ResultError, match="another study"):
            hybrid.study(folder / "changed.yaml", target)
    assert hybrid.open_study(target).equals(found)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(ResultError, match="no study"):
        hybrid.study(folder / "heave.yaml", tmp_path / "mine", overwrite=True)
    assert (tmp_path / "mine" / "letter.txt").exists()


def test_one_case_again_with_its_whole_result(folder: Path, found: object, tmp_path: Path) -> None:
    result = hybrid.study_case(folder / "heave.zarr", 5, tmp_path / "case.h5")
    assert result["steps/end_force_end"].max() == found["force_max"].values[5]
    with pytest.raises(ResultError, match="0 to 8"):
        hybrid.study_case(folder / "heave.zarr", 9)


def test_equilibria(folder: Path, tmp_path: Path, scheduler: str) -> None:
    """A study at rest is the statics of each scene."""
    vary = {"cable.sections[0].mass": [6, 8]}
    rest = hybrid.study(folder / "scene.yaml", tmp_path / "rest.zarr", vary=vary, static=True, scheduler=scheduler)
    expected = hybrid.static(hybrid.load_scene(folder / "scene.yaml", ["cable.sections[0].mass=6"])).tension.max()
    assert rest["tension_max"].values[0] == pytest.approx(expected, rel=1e-12)


def test_what_can_never_be_kept_ends_the_study(folder: Path, tmp_path: Path, scheduler: str) -> None:
    """A quantity that no result has: said after the first batch; a corrected study takes the place."""
    vary, wrong = {"cable.sections[0].mass": [6, 8]}, {"quantity": "tensoin"}
    with pytest.raises(ResultError, match="did you mean"):
        hybrid.study(
            folder / "scene.yaml", tmp_path / "x.zarr", vary=vary, collect={"x": wrong}, static=True, scheduler=scheduler
        )  # fmt: skip


@pytest.mark.parametrize(("quantity", "fix"), [("touchdown", "kind: touchdown"), ("reaction_end", "end_force_end")])
def test_several_values_at_a_time_are_refused_before_a_run(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, quantity: str, fix: str
) -> None:
    monkeypatch.setattr("hybrid.studies.study.compute_open_batches", lambda *_: pytest.fail("a case was computed"))
    with pytest.raises(SceneError, match=fix) as refused:
        hybrid.study(
            folder / "scene.yaml", tmp_path / "x.zarr", vary={"cable.sections[0].mass": [6, 8]},
            collect={"x": {"quantity": quantity}}, static=True,
        )  # fmt: skip
    assert "collect.x.quantity" in str(refused.value) and not (tmp_path / "x.zarr").exists()


def test_what_is_not_always_there_costs_nothing_else(folder: Path) -> None:
    """Where a touchdown comes and goes its largest value is that of the outputs that have one, its mean has a reason."""
    t = np.linspace(0.0, 3.0, 4)
    result = SimpleNamespace(
        units={"tdp": "m", "pull": "N"}, line=None, values={"t": t, "tdp": np.array([1.0, np.nan, 3.0, 2.0]), "pull": t}
    )
    found = collected(Histories(result), {
        "tdp": Kept(quantity="tdp", take=("max", "min", "mean")), "pull": Kept(quantity="pull", take=("median",)),
    })  # fmt: skip
    assert {name: float(values) for name, (_, values) in found.kept.items()} == {
        "tdp_max": 3.0,
        "tdp_min": 1.0,
        "pull": 1.5,
    }
    assert list(found.reasons) == ["tdp_mean"] and not found.absent
    assert collected(Histories(result), {"x": Kept(quantity="depth")}).absent


class Histories:
    """Of a result what `collected` asks for: histories of one value."""

    def __init__(self, result: SimpleNamespace) -> None:
        self.units, self._values = result.units, result.values

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._values:
            raise ResultError(f"no '{name}'")
        return self._values[name]

    def dims(self, name: str) -> tuple[str, ...]:
        return ("t",)


def test_names_that_mean_two_things_are_refused(folder: Path, tmp_path: Path) -> None:
    vary = {"p_max": {"key": "time.step", "values": [0.1, 0.2]}}
    with pytest.raises(SceneError, match="p_max"):
        collect = {"p": {"quantity": "tension", "take": ["max", "min"]}}
        hybrid.study(folder / "scene.yaml", tmp_path / "y.zarr", vary=vary, collect=collect)


def test_files_are_those_beside_the_scene(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A varied file is looked for beside the scene, not where the study is called; when it changes, --case says so."""
    for where, lift in ((folder, 0.0), (tmp_path, 5.0)):
        (where / "a.csv").write_text("t,x,y,z\n" + "".join(f"{t},35,0,{lift if t > 1 else 0}\n" for t in range(9)))
    (folder / "moved.yaml").write_text(
        SCENE.replace("{heave: {amplitude: 1.0, period: 5.0}, ramp: 5}", "{file: a.csv, ramp: 2}")
    )
    monkeypatch.chdir(tmp_path)
    vary = {"ends.end.motion.file": ["a.csv"]}
    cases = cases_of(study_from({"scene": "moved.yaml", "vary": vary}, folder))
    assert cases.rows == [{"file": str(folder / "a.csv")}] and list(cases.files) == [str(folder / "a.csv")]
    before = cases.identity
    (folder / "a.csv").write_text("t,x,y,z\n" + "".join(f"{t},35,0,0\n" for t in range(12)))
    assert cases_of(study_from({"scene": "moved.yaml", "vary": vary}, folder)).identity != before


@pytest.mark.parametrize("batch", [1, 3])
def test_lengths_that_differ_lose_profiles_alone(folder: Path, tmp_path: Path, scheduler: str, batch: int) -> None:
    """Where one section is longer a profile has other places: it is left out, and what is one number is kept."""
    kept = {"t": {"quantity": "tension", "take": ["max", "profile"]}}
    vary = {"cable.sections[0].length": [60, 62, 60]}
    found = hybrid.study(
        folder / "scene.yaml",
        tmp_path / "l.zarr",
        vary=vary,
        collect=kept,
        static=True,
        scheduler=scheduler,
        batch=batch,
    )
    assert np.isfinite(found["t_profile"].values[[0, 2]]).all()
    assert found["status"].values.tolist() == [DONE] * 3 and np.isfinite(found["t_max"].values).all()
    assert np.isnan(found["t_profile"].values[1]).all() and "t_profile" in str(found["reason"].values[1])


def test_the_command_says_ranges_and_reasons(folder: Path, found: object, tmp_path: Path, call: Call) -> None:
    command = ["study", str(folder / "heave.yaml"), "--json", "--netcdf", str(tmp_path / "x.nc")]
    (tmp_path / "x.nc").write_text("measured for months\n")  # it was written over
    refused = call(*command)
    assert refused.code == 1 and "was not exported by hybrid" in refused.out
    assert (tmp_path / "x.nc").read_text() == "measured for months\n"
    (tmp_path / "x.nc").unlink()
    for _ in range(2):  # one of an earlier call is replaced
        told = call(*command)
        assert not told.code
    lines = told.lines
    largest = next(x for x in lines if x.get("name") == "force_max")
    assert largest["largest"] == np.nanmax(found["force_max"].values) and largest["case"] == 4
    assert next(x for x in lines if x["event"] == "failed")["cases"] == [8]
    import xarray

    with xarray.open_dataset(tmp_path / "x.nc", engine="h5netcdf") as kept:
        assert np.array_equal(kept["force_max"].values, found["force_max"].values, equal_nan=True)


@pytest.mark.long
def test_a_script_needs_no_guard(folder: Path, tmp_path: Path) -> None:
    """Workers do not import the script that calls: it may call at its top level."""
    script = tmp_path / "script.py"
    script.write_text(
        "import hybrid\nprint('once')\n"
        f"found = hybrid.study({str(folder / 'scene.yaml')!r}, 'own.zarr', vary={{'cable.sections[0].mass': [6, 7]}}, "
        "static=True, workers=2)\nprint(found.sizes['case'])\n"
    )
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["once", "2"], done.stderr


LINES = """
environment: {fluid: {density: 1025}}
points:
  a-1: {kind: fixed, position: [0, 0, 0]}
  b: {kind: free, initial_guess: [10, 0, -12], mass: 50}
  c: {kind: fixed, position: [20, 0, 0], motion: {heave: {amplitude: 0.2, period: 4}, ramp: 4}}
lines:
  port: {start: a-1, end: b, sections: [{length: 16, mass: 3, diameter: 0.03, axial_stiffness: 1.0e+6}]}
  star-board: {start: b, end: c, sections: [{length: 16, mass: 3, diameter: 0.03, axial_stiffness: 1.0e+6}]}
time: {duration: 2, step: 0.1}
output: {every: 0.5, quantities: {gap: {kind: clearance, line: port, point: [0, 5, -5]}}}
"""


@pytest.mark.long
def test_several_lines(folder: Path, tmp_path: Path, scheduler: str) -> None:
    """Each case is the run of its scene: of one line, of another whose name is no word, of what stands beside them."""
    (folder / "lines.yaml").write_text(LINES)
    vary = {"m": {"keys": ["lines.port.sections[0].mass", "lines.star-board.sections[0].mass"], "values": [3, 4]},
            "x": {"key": "points.a-1.position[0]", "values": [0.0, -1.0]}}  # fmt: skip
    collect = {
        "port": {"quantity": "tension", "line": "port", "take": ["max", "profile"]},
        "other": {"quantity": "end_force_end", "line": "star-board", "take": ["mean"]},
        "gap": {"quantity": "gap", "take": ["min"]},
    }
    found = hybrid.study(
        folder / "lines.yaml", tmp_path / "lines.zarr", vary=vary, collect=collect, scheduler=scheduler
    )
    assert (found.status.values == DONE).all() and found.sizes["case"] == 4
    text = LINES.replace("mass: 3", "mass: 4").replace("position: [0, 0, 0]", "position: [-1, 0, 0]")
    (tmp_path / "one.yaml").write_text(text)
    result = hybrid.run(hybrid.load_scene(tmp_path / "one.yaml"))
    last = found.isel(case=int(np.flatnonzero((found.m.values == 4) & (found.x.values == -1.0))[0]))
    port, other = result.lines["port"], result.lines["star-board"]
    assert float(last.port_max) == np.nanmax(port["envelope/tension_max"])
    assert np.array_equal(last.port_profile.values, port.tension.max(axis=0)) and last.port_profile.dims == ("port_s",)
    assert float(last.other) == float(other.statistics(["end_force_end"])["end_force_end"].mean)
    assert float(last.gap) == result.gap.min()
    again = hybrid.studies.study.case_of(tmp_path / "lines.zarr", int(last.case))
    assert again.gap.min() == float(last.gap)
    usual = hybrid.study(
        folder / "lines.yaml", tmp_path / "usual.zarr", vary={"m": [3.0]} | {"m": vary["m"]}, scheduler=scheduler
    )
    assert {"port_tension_max", "star_board_end_force_end_mean"} <= set(usual.data_vars)


@pytest.mark.parametrize(("collect", "text"), [
    ({"a": {"quantity": "tension", "line": "prot"}}, "one of port, star-board"),
    ({"a": {"quantity": "tension", "take": ["profile"]}}, "line: port"),
])  # fmt: skip
def test_lines_that_are_not_there_are_refused(folder: Path, tmp_path: Path, collect: dict, text: str) -> None:
    (folder / "lines.yaml").write_text(LINES)
    vary = {"m": {"key": "lines.port.sections[0].mass", "values": [3]}}
    with pytest.raises(SceneError, match=text):
        hybrid.study(folder / "lines.yaml", tmp_path / "no.zarr", vary=vary, collect=collect)
    with pytest.raises(SceneError, match="one line"):
        hybrid.study(folder / "scene.yaml", tmp_path / "no.zarr", vary={"n": {"key": "mesh.cells", "values": [8]}},
                     collect={"a": {"quantity": "tension", "line": "port"}})  # fmt: skip


# ---- kills ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("what", "seed"), [("study", 0), ("worker", 2), ("scheduler", 4)])
def test_killed_and_called_again(folder: Path, found: object, tmp_path: Path, what: str, seed: int) -> None:
    """Whatever was killed, the same call completes the study: every case once, every number the same."""
    target = tmp_path / "killed.zarr"
    code, text = killed_study(folder / "heave.yaml", target, what, seed)
    assert what != "scheduler" or code == 0 or ("scheduler of the study is gone" in text and "Traceback" not in text)
    after = hybrid.study(folder / "heave.yaml", target, workers=2)
    for name in ("status", "force_max", "force_mean", "tension_history", "shape_profile", "steps"):
        assert np.array_equal(after[name].values, found[name].values, equal_nan=True), name
    assert sorted(after["case"].values.tolist()) == list(range(9))


@pytest.mark.slow
def test_a_case_that_kills_its_worker_is_data(
    folder: Path, found: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its batch is computed case by case: it alone has failed, with the reason, and the others are what they were."""

    def deadly(job: object) -> list:  # sent by value: workers do not know this module
        import os as network

        from hybrid.studies.workers import compute_batch

        if any(row["A"] == 0.5 and row["T"] == 6 for row in job.rows):  # type: ignore[attr-defined]
            network.kill(network.getpid(), 9)
        return compute_batch(job)  # type: ignore[arg-type]

    monkeypatch.setattr("hybrid.studies.study.compute_batch", deadly)
    after = hybrid.study(folder / "heave.yaml", tmp_path / "deadly.zarr", workers=2, batch=3)
    dead = (after.A.values == 0.5) & (after["T"].values == 6)
    assert dead.sum() == 1 and "worker died" in str(after.reason.values[dead][0])
    assert after.status.values[dead].tolist() == [FAILED]
    for name in ("status", "force_max", "force_mean", "tension_history", "shape_profile", "steps"):
        assert np.array_equal(after[name].values[~dead], found[name].values[~dead], equal_nan=True), name
