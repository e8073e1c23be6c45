"""Three levels of demand: their errors, what meets them at least cost, and that runs are kept."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import hybrid
from hybrid.scene.read import scene_text
from hybrid.scene.root import in_full
from hybrid.store.tables import FAILED, Row
from hybrid.studies import runs
from hybrid.studies.tradeoff import ALONG, LEVELS, LevelRow, LevelTable, level_row, status_of
from tests.studies.test_trade import SAG as SAGS

SAG = {name: x for name, x in SAGS.items() if name not in ("model", "mesh")} | {"time": {"duration": 1.0}}


def values(
    shift: float, force: float, moment: list[list[float]], curvature: list[list[float]]
) -> dict[str, np.ndarray]:
    reaction = np.full((2, 3), [100.0 + force, 0.0, 0.0])
    position = np.full((2, 2, 3), [shift, 0.0, 0.0])
    return {"position": position, "reaction_start": reaction, "bending_moment": np.array(moment),
            "curvature": np.array(curvature)}  # fmt: skip


EXACT = values(0.0, 0.0, [[0.0, 10.0], [4.0, 8.0]], [[0.0, 1.0], [0.4, 0.8]])


def test_errors_are_those_of_each_level() -> None:
    """The largest moment of an output may lie elsewhere; curvature counts at every point."""
    found = values(0.01, 0.5, [[9.8, 0.0], [8.0, 4.0]], [[0.0, 1.04], [0.48, 0.8]])
    done = Row("hybrid", "rod", "level", "done", cpu=1.0)
    a, b, c = (level_row(level, "rod", done, found, EXACT, 20.0) for level in "ABC")
    assert (a.position, a.end_force, a.moment, a.curvature) == pytest.approx((0.0005, 0.005, 0.02, 0.08))
    assert (a.worst, b.worst) == pytest.approx((0.5, 0.5)) and a.meets and b.meets
    assert c.worst == pytest.approx(0.08 / ALONG) and not c.meets
    assert status_of(c) == "error 1.6 times what is asked"


def test_the_cheapest_that_meets_a_level_is_named() -> None:
    rows = (
        LevelRow("A", "rod", "done", "", worst=0.5, cpu=2.0), LevelRow("A", "catenary", "done", "", worst=0.9, cpu=1.0),
        LevelRow("A", "adaptive", "done", "", worst=1.1, cpu=0.5), LevelRow("A", "CableDyn 20", "done", "", worst=0.1, cpu=0.1),
        LevelRow("B", "catenary", FAILED, "no moment"),
    )  # fmt: skip
    table = LevelTable("by hand", Row("hybrid", "rod", "reference", "done", cells=9, steps=9), rows, ())
    best = table.cheapest("A")
    assert best is not None and best.model == "catenary"
    one, two, three = table.sentences()
    assert "catenary, 1 s of CPU time, 2 times less than a rod everywhere" in one
    assert two.endswith("no run met it.") and three.endswith("no run met it.")
    assert "failed: no moment" in table.markdown()


@pytest.mark.long
def test_levels_are_computed_once_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    real = runs.run

    def run(scene: hybrid.Scene, *args: Any, **more: Any) -> hybrid.Result:
        if more:
            made.append(scene.model.kind)
        return real(scene, *args, **more)

    monkeypatch.setattr(runs, "run", run)
    monkeypatch.setattr("hybrid.studies.tradeoff.MODELS", ("rod", "catenary"))
    first = hybrid.trade_levels(SAG, tmp_path)
    assert made == ["rod", "rod", "catenary", "rod", "rod"], "the reference; a catenary is asked for no moment"
    assert [(row.level, row.model) for row in first.rows] == [(x, y) for x in LEVELS for y in ("rod", "catenary")]
    for row in first.rows:
        assert row.meets or row.model == "catenary", row
    made.clear()
    again = hybrid.trade_levels(SAG, tmp_path)
    assert not made and again.rows == first.rows
    read = list(csv.DictReader(io.StringIO((tmp_path / "levels.csv").read_text())))
    assert [x["level"] for x in read] == [row.level for row in first.rows]
    assert "# a line that sags: what each level costs" in (tmp_path / "levels.md").read_text()


@pytest.mark.long
def test_of_several_lines_the_worst_error_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A network of one line has the rows of its cable; a line beside it adds its errors, and keeps what it must."""
    loose = {"position": "3%", "tension": "3%", "bending_moment": "5%", "curvature": "5%"}
    monkeypatch.setattr("hybrid.studies.tradeoff.MODELS", ("rod",))
    monkeypatch.setattr("hybrid.studies.tradeoff.LEVELS", {"C": loose})
    monkeypatch.setattr("hybrid.studies.tradeoff.REFERENCE_OF_LEVELS", loose | {"position": "1%", "tension": "1%"})
    network = in_full(hybrid.validate_scene(SAG))
    data: dict[str, Any] = yaml.safe_load(scene_text(network))
    (section,) = data["lines"]["cable"]["sections"]
    chain = {name: x for name, x in section.items() if name != "bending_stiffness"} | {"length": 13.0}
    data["lines"]["beside"] = {"start": "start", "end": "end", "sections": [chain], "model": "catenary"}
    cable, one, two = (hybrid.trade_levels(x, tmp_path / str(k)) for k, x in enumerate((SAG, network, data)))
    clocks = {"cpu": None}
    assert replace(one.rows[0], **clocks) == replace(cable.rows[0], **clocks)
    (row,) = two.rows
    assert row.moment and row.curvature and row.worst and row.cells and row.cells > (one.rows[0].cells or 0)
    assert [what for what, _ in two.facts if "keeps" in what] == ["not admitted by lines.beside, which keeps its model"]
    assert "# a line that sags" in (tmp_path / "2" / "levels.md").read_text()
