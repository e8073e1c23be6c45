"""Studies that are killed at random moments: every case present once, every number the same.

    pytest bench/test_bench_kills.py -m bench -n 0 -s

HYBRID_KILLS (50) kills, in turn of the study, of a worker, and of the scheduler of a cluster.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from killed_studies import killed_study

import hybrid
from hybrid.store.study_file import OPEN, StudyFile

pytestmark = pytest.mark.bench
KILLS = int(os.environ.get("HYBRID_KILLS", "50"))
SCENE = """
environment: {fluid: {density: 1025}}
cable: {sections: [{length: 60, mass: 8, diameter: 0.04, axial_stiffness: 1.0e+7, drag: {normal: 1.2}}]}
ends:
  start: {kind: pinned, position: [0, 0, -40]}
  end: {kind: pinned, position: [35, 0, 0], motion: {heave: {amplitude: 1.0, period: 5.0}, ramp: 5}}
initial: equilibrium
model: catenary
mesh: {cells: 16}
time: {duration: 20, step: 0.1}
output: {every: 0.5}
"""
STUDY = """
scene: scene.yaml
vary: {A: {key: ends.end.motion.heave.amplitude, from: 0.2, to: 1.4, count: 13}}
collect: {force: {quantity: end_force_end, take: [max, mean, history]}}
"""


def test_kills(tmp_path: Path) -> None:
    """Asked: 50 kills, every case once, the same result."""
    (tmp_path / "scene.yaml").write_text(SCENE)
    study = tmp_path / "heave.yaml"
    study.write_text(STUDY)
    usual = hybrid.study(study, tmp_path / "usual.zarr", workers=1)
    rows = []
    for k in range(KILLS):
        what, target = ("study", "worker", "scheduler")[k % 3], tmp_path / f"{k}.zarr"
        killed_study(study, target, what, k)
        left = int((StudyFile(target).status == OPEN).sum()) if target.exists() else 13
        after = hybrid.study(study, target, workers=1)
        same = all(
            np.array_equal(after[x].values, usual[x].values)
            for x in ("case", "force_max", "force_mean", "force_history")
        )
        rows.append((what, left, same and bool((after.status.values == 1).all())))
        print(f"\r{k + 1} of {KILLS} kills", end="", flush=True)
    print()
    for what in ("study", "worker", "scheduler"):
        mine = [row for row in rows if row[0] == what]
        if mine:
            print(
                f"{what}: {len(mine)} kills, {sum(row[1] > 0 for row in mine)} with cases left (of 13 {np.mean([row[1] for row in mine]):.1f} on average), "
                f"{sum(row[2] for row in mine)} identical"
            )
    assert all(row[2] for row in rows)
