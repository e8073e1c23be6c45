"""Studies and runs that are killed at random moments.

    pytest bench/test_bench_kills.py -m bench -n 0 -s
    pytest bench/test_bench_kills.py -m bench -n 0 -s -k accuracy

HYBRID_KILLS (50) kills, in turn of the study, of a worker, and of the scheduler of a cluster: every case is present
once, every number the same.  HYBRID_KILLED_RUNS (40) runs with an accuracy, by SIGKILL and SIGINT in turn: each leaves
what it has, which says what is missing, and resumed is what it would have been.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time as clock
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from bits import differences
from killed_studies import PROGRAM, killed_study

import hybrid
from hybrid.errors import ResultError
from hybrid.store.study_file import OPEN, StudyFile

pytestmark = pytest.mark.bench
RUNS = int(os.environ.get("HYBRID_KILLED_RUNS", "40"))
EXAMPLES = Path(__file__).parents[1] / "examples"
# Runs of a second or two whose first result misses what is asked, so that finer ones follow; of several lines too.
ASKED = {
    "one line": [EXAMPLES / "touchdown.yaml", "time.duration=120", "accuracy={tension: 0.2%}", "mesh=null"],
    "several lines": [Path("bridle.yaml")],
}
BRIDLE = """
environment: {fluid: {density: 1025, current: [0.4, 0.1, 0]}}
points:
  west: {position: [-55, 0, -50]}
  east: {position: [55, 5, -50]}
  float: {initial_guess: [0, 0, -10], mass: 300, volume: 1.2, drag_area: 2}
lines:
  west: {start: west, end: float, sections: [&leg {length: 70, mass: 3, diameter: 0.04, axial_stiffness: 2.0e+6, drag: {normal: 1.2}}]}
  east: {start: float, end: east, sections: [*leg]}
time: {duration: 20}
accuracy: 0.3%
"""
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


def killed_run(command: list[str], number: int, after: float) -> tuple[str, float]:
    """A run that is stopped so many s after it began, by a signal; what it has written to the error stream, and how

    long it took to end, s.
    """
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    clock.sleep(after)
    process.send_signal(number)
    begin = clock.monotonic()
    return process.communicate(timeout=300)[1], clock.monotonic() - begin


def left_by(target: Path, said: str, stopped: bool) -> str:
    """What a stopped run has left, in words; AssertionError: it does not say what is missing."""
    if not target.exists():
        assert not stopped or "no result yet: nothing was written" in said or not said, said
        return "nothing yet"
    with hybrid.open(target) as result:
        assert not target.with_name(f".{target.name}.lock").exists()
        if result.status != "complete":
            assert result.status == ("interrupted" if stopped else "running"), result.status_text
            return "a part of the result" if len(result.times) else "nothing yet"
        if result.done:
            return "all"
        assert "hybrid resume" in result.pending and result.pending in result.status_text
        assert not stopped or "makes up for it" in said, said
        return "the result, " + ("errors to come" if "errors are not" in result.pending else "a finer one to come")


@pytest.mark.parametrize("name", ASKED)
def test_kills_of_runs_with_an_accuracy(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked: 40 kills, 40 results that open and say what is missing; resumed, the same bits."""
    monkeypatch.chdir(tmp_path)
    Path("bridle.yaml").write_text(BRIDLE)
    scene, *settings = ASKED[name]
    command = [*PROGRAM, "run", str(scene), *(x for given in settings for x in ("--set", given)), "-o"]
    subprocess.run([*command, "whole.h5"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    begin = clock.monotonic()
    subprocess.run([*command, "whole.h5"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wall, draw, found, same = clock.monotonic() - begin, np.random.default_rng(43), Counter[str](), 0
    ended: list[float] = []
    for k in range(-(-RUNS // len(ASKED))):
        number, target = (signal.SIGKILL, signal.SIGINT)[k % 2], tmp_path / f"run{k}.h5"
        said, took = killed_run([*command, str(target)], number, float(draw.uniform(0.1, 1.0)) * wall)
        left = left_by(target, said, number == signal.SIGINT)
        if number == signal.SIGINT and left != "all":
            ended.append(took)
        found[f"{number.name}: {left}"] += 1
        if target.exists() and left != "all":
            try:
                hybrid.resume(target).close()
            except ResultError as error:  # some ms between the file and its first output
                assert left == "nothing yet" and "no checkpoint" in str(error)
                continue
        same += not target.exists() or differences(tmp_path / "whole.h5", target) == []
        target.unlink(missing_ok=True)
    total = sum(found.values())
    print(f"\n{name}: {total} kills within {wall:.2g} s; " + ", ".join(f"{x} {n}" for x, n in sorted(found.items())))
    print(
        f"{name}: SIGINT to the end of the process {np.median(ended or [0]):.2g} s, at most {max(ended or [0]):.2g} s"
    )
    print(f"{name}: {total} say what is missing, {same} are the same after a resume, or have left nothing")
    assert same >= total - found["SIGKILL: nothing yet"] - found["SIGINT: nothing yet"]
