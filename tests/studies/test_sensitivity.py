"""Sensitivity against closed forms: the Ishigami function, a linear one, and a table without a design."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.errors import ResultError
from hybrid.store.study_file import DONE, FAILED, Column, StudyFile
from hybrid.studies.cases import design, scaled

pytestmark = pytest.mark.needs("dask", "zarr", "xarray", "simpleeval", "SALib")

PI = float(np.pi)
BOUNDS = {"a": (-PI, PI), "b": (-PI, PI), "c": (-PI, PI)}


def ishigami(x: np.ndarray) -> np.ndarray:
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def stored(folder: Path, method: str, count: int, function: object, bounds: dict = BOUNDS, failed: int = 0) -> Path:
    """A study whose result `y` is a function of its variables."""
    if method in ("saltelli", "morris"):
        points = design(method, list(bounds), count, 1)
    else:
        points = np.random.default_rng(0).random((count, len(bounds)))
    x = np.array(scaled(points, bounds))
    n = len(x)
    columns = {name: Column("", "", (), x[:, k]) for k, name in enumerate(bounds)}
    attributes = {
        "identity": "", "title": "", "variables": json.dumps(list(columns)), "scene_file": "",
        "sample": json.dumps({"method": method, "count": count, "seed": 1}), "bounds": json.dumps(bounds),
    }  # fmt: skip
    file = StudyFile.create(folder / f"{method}.zarr", columns, n, n, attributes)
    status = np.full(n, DONE, "i1")
    status[:failed] = FAILED
    own = {"status": status, "reason": np.full(n, "", object), "events": np.full(n, "", object)}
    own |= {"cpu": np.ones(n), "steps": np.ones(n, "i8"), "y": function(x)}  # type: ignore[operator]
    file.add(0, {name: Column("", "", (), values) for name, values in own.items()}, {})
    return folder / f"{method}.zarr"


def test_indices_of_sobol(tmp_path: Path) -> None:
    """Ishigami's function: first order 0.3139, 0.4424, 0; total 0.5576, 0.4424, 0.2437."""
    found = {x.variable: x for x in hybrid.sensitivity(stored(tmp_path, "saltelli", 1024, ishigami), "y")}
    assert [found[n].first for n in "abc"] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.03)
    assert [found[n].total for n in "abc"] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.03)
    assert list(found) == ["a", "b", "c"]  # the strongest first


def test_too_few_cases_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match="2 of 8 cases"):
        hybrid.sensitivity(stored(tmp_path, "latin_hypercube", 8, ishigami, failed=6), "y")


def test_elementary_effects_of_a_linear_function(tmp_path: Path) -> None:
    """Slope times range, without deviation."""
    bounds = {"a": (0.0, 2.0), "b": (1.0, 2.0), "c": (5.0, 9.0)}
    made = stored(tmp_path, "morris", 20, lambda x: 3.0 * x[:, 0] - 7.0 * x[:, 1] + 0.5 * x[:, 2], bounds)
    found = hybrid.sensitivity(made, "y")
    assert [(x.variable, x.first) for x in found] == [
        ("b", pytest.approx(7.0)),
        ("a", pytest.approx(6.0)),
        ("c", pytest.approx(2.0)),
    ]
    assert max(x.total for x in found) < 1e-9


def test_rank_correlations_of_any_table(tmp_path: Path) -> None:
    """What grows with a variable, however crookedly, has a rank correlation of 1; failed cases are left out."""
    made = stored(tmp_path, "latin_hypercube", 50, lambda x: np.where(x[:, 0] > -9, np.exp(x[:, 0]), 0.0), failed=5)
    found = hybrid.sensitivity(made, "y")
    assert found[0].variable == "a" and found[0].first == pytest.approx(1.0) and abs(found[1].first) < 0.4


def test_designs_with_gaps_are_refused(tmp_path: Path) -> None:
    made = stored(tmp_path, "saltelli", 8, ishigami, failed=1)
    with pytest.raises(ResultError, match="needs all"):
        hybrid.sensitivity(made, "y")
    with pytest.raises(ResultError, match="expected: one of"):
        hybrid.sensitivity(made, "z")
