"""The suspension of examples/03_suspension_rod.yaml, released and at rest after 20 s, against Exudyn and PyElastica.

Whole runs from the YAML with the file written, CPU time, against the peers' own time loops: each with the fewest cells
and longest steps, of those tried, that end within 0.3 mm of the solution of the boundary value problem.

pytest bench/test_bench_suspension.py -m bench -n 0 -s
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import pytest
from peers import exudyn_suspension, pyelastica_suspension, suspension

import hybrid

pytestmark = pytest.mark.bench
ROUNDS = 3
OURS = (
    (hybrid.run, ["mesh.cells=120", "time.step=0.1"]),
    (hybrid.run, ["mesh.cells=120", "time.step=0.1", "output.errors=true"]),
    (hybrid.run, ["accuracy={position: 0.3 mm}"]),
    (hybrid.static, ["mesh.cells=120", "output.errors=true"]),
)
EXUDYN = ((40, 0.02), (44, 0.05), (44, 0.02), (50, 0.05), (50, 0.02))  # elements and step, s: fewer are farther off
# PyElastica would take 10 to 50 minutes to come to rest: so many seconds of motion are run, and the time is multiplied.
PART = 0.1


def ours(path: Path, command: Callable[..., hybrid.Result], sets: list[str]) -> tuple[float, float]:
    """CPU time (s) of a whole run, and the largest distance (m) to the truth at its end."""
    begin = time.process_time()
    result = command(hybrid.load_scene(suspension.SCENE, sets), path)
    spent = time.process_time() - begin
    s, r = np.asarray(result.s), np.asarray(result.position[-1])
    result.close()
    path.unlink()
    return spent, suspension.distance(s, r[:, 0], r[:, 2])


def test_a_rod_that_comes_to_rest(tmp_path: Path) -> None:
    for what in OURS:  # what is needed is loaded
        ours(tmp_path / "run.h5", *what)
    runs = {
        " ".join([command.__name__, *sets]): [ours(tmp_path / "run.h5", command, sets) for _ in range(ROUNDS)]
        for command, sets in OURS
    }
    spent = {name: median(x[0] for x in found) for name, found in runs.items()}
    for name, found in runs.items():
        print(f"hybrid, {name}: {spent[name]:.3f} s, {1e3 * found[-1][1]:.2f} mm from the truth")
        assert found[-1][1] <= suspension.CLOSE
    there: dict[str, float] = {}
    if exudyn_suspension.available():
        for elements, dt in EXUDYN:
            found = [suspension.elsewhere("exudyn_suspension", elements, dt) for _ in range(ROUNDS)]
            cpu = median(x[0] for x in found)
            print(f"Exudyn, {elements} elements, {dt} s: {cpu:.3f} s, {1e3 * found[-1][1]:.2f} mm")
            if found[-1][1] <= suspension.CLOSE:
                there["Exudyn"] = min(cpu, there.get("Exudyn", np.inf))
    if pyelastica_suspension.available():
        for stiffness in (None, 60.0):
            cpu = suspension.elsewhere("pyelastica_suspension", 120, stiffness, PART)[0] * suspension.DURATION / PART
            words = "as the rod is" if stiffness is None else f"softened to EA {stiffness:g} N"
            print(f"PyElastica, 120 elements, {words}: {cpu:.0f} s, of {PART} s of motion")
            there["PyElastica"] = min(cpu, there.get("PyElastica", np.inf))
    if not there:
        pytest.skip("neither exudyn nor pyelastica is installed: pip install -e '.[bench]'")
    missed = []
    for peer, least in (("Exudyn", 5.0), ("PyElastica", 100.0)):
        for name, cpu in spent.items():
            if peer in there:
                print(f"{peer} / hybrid, {name}: {there[peer] / cpu:.1f}, asked {least:g}")
                missed += [f"{peer}: {there[peer] / cpu:.1f}"] if there[peer] < least * cpu else []
    assert not missed, "; ".join(missed)
