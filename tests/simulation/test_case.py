"""Runs of a case to compare with: what they keep, and where; pre-runs; what was stopped goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.model.network import NetworkResolution
from hybrid.scene.read import as_scene
from hybrid.scene.root import LINE, in_full
from hybrid.simulation import line_result
from hybrid.simulation.case import Case
from hybrid.simulation.run_sample import RunSample
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
    monkeypatch.setattr(line_result, "WAITING", 1)
    assert_same(together, sample(case))


def test_many_outputs_go_into_a_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    case = Case(as_scene(SCENE | {"model": "catenary"}), None)
    kept = sample(case)
    case.beside_result = tmp_path / "run.h5"
    monkeypatch.setattr("hybrid.simulation.case.MOST_IN_MEMORY", 10)
    stored = sample(case)
    assert stored.rows and len(list(tmp_path.iterdir())) == 1
    assert_same(kept, stored)


@pytest.mark.parametrize("form", [as_scene, lambda x: in_full(as_scene(x))], ids=["cable", "named"])
def test_errors_that_were_not_estimated_are_made_up_for(form: Any, monkeypatch: Any, tmp_path: Path) -> None:
    """A result that is complete, but for its errors."""
    tables = SCENE | {"model": "catenary", "time": {"duration": 0.2, "step": 0.02}, "output": {"errors": True}}
    del tables["accuracy"]
    scene, path = form(tables), tmp_path / "run.h5"

    def stop(progress: Any) -> None:
        if progress.name == "error estimation":
            raise KeyboardInterrupt

    monkeypatch.setattr("hybrid.simulation.progress.REPORT_EVERY", 0.0)
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene, path, progress=stop)
    assert hybrid.open(path).pending
    assert "error_total_position" in hybrid.resume(path).attributes


@pytest.mark.parametrize("form", [as_scene, lambda x: in_full(as_scene(x))], ids=["cable", "named"])
def test_a_line_that_is_let_go_is_not_at_rest(form: Any) -> None:
    """Its end forces then have the order of a start."""
    held = Case(form(SCENE), None)
    ends = {name: dict(x) for name, x in SCENE["ends"].items()}
    ends["start"]["release_at"] = {"time": 0.4}
    assert held.from_rest and not Case(form(SCENE | {"ends": ends}), None).from_rest


@pytest.mark.long
def test_what_was_stopped_goes_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A result is completed, with its errors."""
    scene = SCENE | {"model": "catenary", "output": {"every": 0.05, "exact": True}}
    whole, path = hybrid.run(scene, tmp_path / "whole.h5"), tmp_path / "cut.h5"

    def stop(progress: Any) -> None:
        if progress.name == "result" and progress.t > 0.3:
            raise KeyboardInterrupt

    monkeypatch.setattr("hybrid.simulation.progress.REPORT_EVERY", 0.0)
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene, path, progress=stop)
    found = hybrid.resume(path)
    np.testing.assert_allclose(found["tension"], whole["tension"], rtol=1e-9)
    assert found.attributes["error_total_position"] > 0.0
