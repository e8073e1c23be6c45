"""How long a call of the compiled run may take: Ctrl-C is heard while zones change every few steps, and in many waves."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybrid
import hybrid.solve.network_steps
from hybrid.simulation import progress as reports
from hybrid.simulation.progress import Progress
from hybrid.solve.network_steps import CELL_STEPS, NetworkSteps

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
