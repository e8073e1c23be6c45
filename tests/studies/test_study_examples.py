"""The studies of examples/ are what they say: read whole, and one of them computed with short runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.scene.study import read_study
from hybrid.statistics.fatigue import YEAR, life_in_years
from hybrid.studies.cases import cases_of

pytestmark = pytest.mark.needs("dask", "zarr", "xarray", "simpleeval", "SALib")

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
