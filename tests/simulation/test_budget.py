"""An accuracy has a budget: four times what the first result foretells, by steps, cells and outputs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import differences

import hybrid
from hybrid.accuracy import run_forecast as module
from hybrid.accuracy.run_forecast import OUTPUT, POINT, Budget
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution
from hybrid.simulation.run_sample import RunSample
from tests.scenes import cable_scene, pinned_at

FIRST = Resolution(1.0, 0.1, 1e-3, 1e-3)


def run(resolution: Resolution = FIRST, cells: int = 100, steps: int = 100_000) -> RunSample:
    return RunSample(resolution, {"position": np.zeros((1, 1, 3))}, cells, steps, 0.0)


def test_four_times_what_was_foretold_and_no_more() -> None:
    """Steps of 112 us: 11.2 s, 26.9 s are foretold of all, 107.5 s allowed; 21.3 s are spent with runs to compare."""
    budget = Budget(0, 0)
    budget.spend([run()])
    assert budget.foretold == pytest.approx(2.4 * 11.2) and budget.spent == pytest.approx(1.9 * 11.2)
    assert budget.allows([run()], [FIRST.coarser(1.0, 1.0 / 7.6)])
    assert not budget.allows([run()], [FIRST.coarser(1.0, 1.0 / 7.8)])
    assert budget.beyond == pytest.approx((1.9 + 7.8) / 2.4)
    said = budget.text([run()], [FIRST.coarser(0.5, 1.0 / 4.0)])
    assert "about 2e+02 cells and 4e+05 steps" in said and "4 times the processor time" in said
    again = Budget(0, 0)
    again.restore(budget.checkpoint())
    assert again.allows([run()], [FIRST.coarser(1.0, 1.0 / 7.6)]) and not again.allows(
        [run()], [FIRST.coarser(0.1, 0.1)]
    )


def test_short_runs_are_refined_whatever_it_takes_and_outputs_count() -> None:
    budget = Budget(0, 0)
    budget.spend([run(steps=100)])
    assert budget.allows([run(steps=100)], [FIRST.coarser(0.1, 0.1)])  # 100 times 11 ms
    many = Budget(1000, 1000)
    many.spend([run(steps=100)])
    assert many.foretold == pytest.approx(1000 * (OUTPUT + POINT * 1000), rel=0.05)


def test_what_is_beyond_is_not_computed_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The result that there is stays, and says what it meets; resumed from its first step it is refined no more."""
    scene: dict[str, Any] = cable_scene(
        {"length": 2.0, "mass": 0.5, "axial_stiffness": 1e5}, pinned_at(0, 0, 0),
        pinned_at(1.5, 0, 0, motion={"heave": {"amplitude": 0.2, "period": 2.0}, "ramp": 2.0}), model="catenary",
        time={"duration": 2.0}, accuracy="0.3%", output=(0.1, 11)
    )  # fmt: skip
    from hybrid.accuracy import passes

    surveyed = passes.Passes._surveyed

    def rougher(self: passes.Passes, first: NetworkResolution) -> NetworkResolution:
        return NetworkResolution(
            {
                name: replace(x.coarser(8.0, 1.0), local=10.0 * (x.local or 0.0))
                for name, x in surveyed(self, first).lines.items()
            }
        )

    monkeypatch.setattr(passes.Passes, "_surveyed", rougher)
    with hybrid.run(scene, tmp_path / "free.h5") as free:
        assert free.attributes["effort_runs"] > 4
    monkeypatch.setattr(module, "LEAST", 0.0)
    monkeypatch.setattr(module, "MOST_TIMES", 1.0)
    with hybrid.run(scene, tmp_path / "run.h5") as result:
        (missed,) = [event.text for event in result.events if event.kind == "accuracy missed"]
        assert result.attributes["effort_runs"] == 4 and result.done
        assert "refined no further" in missed and "which this run meets" in missed
    assert differences(tmp_path / "run.h5", tmp_path / "free.h5") != []
