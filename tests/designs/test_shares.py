"""Shares of the spread of a result of a study by derivatives, against closed forms and the indices of Sobol."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.errors import ResultError, SceneError
from hybrid.store.study_file import StudyFile
from hybrid.view.several_runs import html
from tests.called import Call
from tests.studies.test_study import SCENE as OF_HEAVE

pytestmark = pytest.mark.needs("dask", "zarr", "xarray", "SALib")

G = 9.81
LENGTH, MASS = "cable.sections[0].length", "cable.sections[0].mass"
CHAIN = """
environment: {gravity: 9.81}
cable: {sections: [{length: 40, mass: 5, axial_stiffness: 1.0e+12}]}
ends: {start: {kind: pinned, position: [0, 0, 0]}, end: free}
initial: equilibrium
model: catenary
mesh: {cells: 6}
"""
SPAN = CHAIN.replace("end: free", "end: {kind: pinned, position: [100, 0, 0]}").replace("length: 40", "length: 105")
HEAVE = (
    OF_HEAVE.replace("ramp: 5", "ramp: 2").replace("duration: 6", "duration: 4").replace("output: {every: 0.5}\n", "")
)
BOTH = {"m": {"key": MASS, "low": 4.0, "high": 6.0}, "L": {"key": LENGTH, "low": 30.0, "high": 50.0}}
TOP = {"top": {"quantity": "tension", "at": 0.0}}


def made(folder: Path, scene: str, **asked: object) -> Path:
    """The results of a study of a scene."""
    (folder / "scene.yaml").write_text(scene, encoding="utf-8")
    hybrid.study(folder / "scene.yaml", folder / "study.zarr", workers=1, **asked)
    return folder / "study.zarr"


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """m g L of a hanging chain, of a design for indices of Sobol."""
    folder = tmp_path_factory.mktemp("chain")
    sample = {"method": "saltelli", "count": 64, "seed": 1}
    return made(folder, CHAIN, vary=BOTH, sample=sample, collect=TOP | {"most": {"quantity": "tension"}}, static=True)


@pytest.mark.parametrize("result", ["top", "most"])
def test_a_product(chain: Path, result: str):
    """T = m g L: derivatives g L and g m at the mean; S of independent m, L: L² Vm over L² Vm + m² VL + Vm VL."""
    found = hybrid.shares(chain, result)
    data = hybrid.open_study(chain)
    m, L, y = (data[name].values for name in ("m", "L", result))
    g = {x.variable: x.derivative for x in found.rows}
    assert g == pytest.approx({"m": G * L.mean(), "L": G * m.mean()}, rel=1e-5)
    parts = {"m": G * L.mean() * m.std(), "L": G * m.mean() * L.std()}
    whole = sum(x**2 for x in parts.values())
    assert {x.variable: x.share for x in found.rows} == pytest.approx(
        {k: x**2 / whole for k, x in parts.items()}, rel=1e-5
    )
    left = y - G * L.mean() * (m - m.mean()) - G * m.mean() * (L - L.mean())
    assert found.r2 == pytest.approx(1 - left.var() / y.var(), rel=1e-6) and 0.95 < found.r2 < 0.995
    assert (found.why, found.cases, found.unit) == ("", y.size, "N")
    Vm, VL = 4.0 / 12, 400.0 / 12
    V = 40**2 * Vm + 25 * VL + Vm * VL
    exact = {"m": 40**2 * Vm / V, "L": 25 * VL / V}
    for row in found.rows:
        assert row.low < exact[row.variable] < row.high and row.high - row.low < 0.45
        assert row.share == pytest.approx(exact[row.variable], abs=0.02)
        assert row.first == pytest.approx(exact[row.variable], abs=0.15)  # of 256 cases
    assert [x.variable for x in found.rows] == ["L", "m"]  # the largest first


@pytest.mark.long
def test_where_a_line_does_not_hold_nothing_is_claimed(tmp_path: Path):
    """Tension of a line 1 to 10 m longer than its span goes with the root of that: by the mean it is another."""
    vary = {"L": {"key": LENGTH, "low": 100.3, "high": 110.0}, "m": {"key": MASS, "low": 4.9, "high": 5.1}}
    sample = {"method": "latin_hypercube", "count": 24, "seed": 1}
    study = made(tmp_path, SPAN, vary=vary, sample=sample, collect=TOP, static=True)
    found = hybrid.shares(study, "top")
    assert found.r2 < 0.9 and "of the variance (R²), less than 0.9" in found.why
    assert np.isnan([[x.share, x.low, x.high, x.first, x.total] for x in found.rows]).all()
    data = hybrid.open_study(study)
    means = {LENGTH: float(data.L.mean()), MASS: float(data.m.mean())}
    scene = hybrid.parse_scene(SPAN, overrides=[f"{key}={x!r}" for key, x in means.items()])
    exact = {x.by: x.derivative for x in hybrid.sensitivity(scene, ["tension@0"], list(means))}
    slopes = {x.variable: x.derivative for x in found.rows}
    assert slopes == pytest.approx({"L": exact[LENGTH], "m": exact[MASS]}, rel=1e-9)


@pytest.mark.long
def test_variables_that_go_together_are_no_shares(tmp_path: Path):
    values = {
        "m": {"key": MASS, "values": [4.9, 4.95, 5.0, 5.05, 5.1, 5.2]},
        "L": {"key": LENGTH, "values": [39, 39.5, 40, 41, 41, 43]},
    }
    study = made(tmp_path, CHAIN, vary=values, combine="zip", collect=TOP, static=True)
    found = hybrid.shares(study, "top")
    assert found.r2 > 0.99 and "m and L are not independent: their correlation is 0.9" in found.why
    assert np.isnan([x.share for x in found.rows]).all()


@pytest.mark.long
def test_a_motion(tmp_path: Path):
    """Of runs: derivatives are those of `sensitivity` at the mean, and the line through it explains the cases."""
    vary = {
        "drag": {"key": "cable.sections[0].drag.normal", "low": 1.1, "high": 1.3},
        "A": {"key": "ends.end.motion.heave.amplitude", "low": 0.95, "high": 1.05},
        "mass": {"key": MASS, "low": 7.9, "high": 8.1},
    }
    collect = {"pull": {"quantity": "end_force_end", "take": ["max", "mean"]}}
    sample = {"method": "latin_hypercube", "count": 12, "seed": 1}
    study = made(tmp_path, HEAVE, vary=vary, sample=sample, collect=collect)
    found = hybrid.shares(study, "pull_max")
    assert found.of == "max reaction_end" and found.r2 > 0.98 and not found.why
    assert sum(x.share for x in found.rows) == pytest.approx(1.0)
    data, keys = hybrid.open_study(study), {name: x["key"] for name, x in vary.items()}
    scene = hybrid.parse_scene(HEAVE, overrides=[f"{key}={float(data[name].mean())!r}" for name, key in keys.items()])
    exact = hybrid.sensitivity(scene, ["max reaction_end"], list(keys.values()), motion=True)
    slopes = {keys[x.variable]: x.derivative for x in found.rows}
    assert slopes.keys() == {x.by for x in exact}
    for x in exact:  # means of cases are rounded otherwise, and tangents differ by 2.5e-7 of a number
        assert slopes[x.by] == pytest.approx(x.derivative, rel=1e-7)


@pytest.mark.long
def test_several_keys_of_one_variable_and_one_that_stays(tmp_path: Path):
    """Two halves of the chain that get heavier together; the end is varied by one value alone."""
    two = CHAIN.replace(
        "[{length: 40, mass: 5, axial_stiffness: 1.0e+12}]", "[{length: 20, mass: 5}, {length: 20, mass: 5}]"
    )
    vary = {
        "m": {"keys": [MASS, "cable.sections[1].mass"], "values": [4, 5, 6]},
        "g": {"key": "environment.gravity", "values": [9.81]},
    }
    found = hybrid.shares(made(tmp_path, two, vary=vary, collect=TOP, static=True), "top")
    (row,) = found.rows
    assert row.derivative == pytest.approx(G * 40, rel=1e-6) and row.share == 1.0 and found.r2 == pytest.approx(1.0)


@pytest.mark.long
def test_what_has_no_derivative_is_refused(tmp_path: Path):
    vary = {
        "kind": {"key": "model", "values": ["catenary", "catenary", "adaptive"]},
        "m": {"key": MASS, "values": [4, 5, 6]},
    }
    section = "bending_stiffness: 10, torsional_stiffness: 10, axial_stiffness"
    study = made(
        tmp_path, CHAIN.replace("axial_stiffness", section), vary=vary, combine="zip", static=True,
        collect=TOP | {"two": {"quantity": "tension", "at": [0, 10]}, "least": {"quantity": "tension", "at": 0, "take": ["min"]}},
    )  # fmt: skip
    with pytest.raises(SceneError, match="variables that are numbers"):
        hybrid.shares(study, "top")
    with pytest.raises(ResultError, match="expected: one of"):
        hybrid.shares(study, "two")


@pytest.mark.long
def test_what_is_kept_otherwise_is_refused(tmp_path: Path):
    collect = {
        "pull": {"quantity": "end_force_end", "take": ["deviation", "median"]},
        "late": {"quantity": "tension", "times": [1, 3]},
    }
    study = made(tmp_path, HEAVE, vary={"m": {"key": MASS, "values": [7.9, 8, 8.1]}}, collect=collect)
    for result, what in (("pull_median", "median of end_force_end"), ("late", "max of tension in a part of the time")):
        with pytest.raises(SceneError, match=f"(?s)collect.*{what}"):
            hybrid.shares(study, result)
    file = StudyFile(study)
    del file._group.attrs["collect"]
    with pytest.raises(ResultError, match="of a release that did not write what is kept"):
        hybrid.shares(study, "late")


@pytest.mark.long
def test_the_command_and_the_report(chain: Path, call: Call):
    def said(*words: str) -> str:
        told = call("study", str(chain), *words)
        assert not told.code, told
        return told.out + told.err

    assert "Shares of the spread" not in html(chain) or "shares" in hybrid.open_study(chain).attrs
    text = said("--sensitivity", "top", "--derivatives")
    assert "first order from" in text and "tension@0.0 at the mean; R²" in text and "over 256 cases" in text
    found = hybrid.shares(chain, "top")
    kept = json.loads(hybrid.open_study(chain).attrs["shares"])["top"]
    assert kept["r2"] == found.r2 and kept["rows"][0] == found.rows[0]._asdict()
    page = html(chain)
    assert "Shares of the spread" in page and f"{found.rows[0].share:.4g}" in page and f"R² {found.r2:.4f}" in page
    rows = [json.loads(x) for x in said("--sensitivity", "top", "--derivatives", "--json").splitlines()]
    (row,) = [x for x in rows if x.get("r2")]
    assert row["rows"][0]["variable"] == "L"
    assert call("study", str(chain), "--derivatives").code == 1
