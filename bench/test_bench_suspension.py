"""The suspension of examples/03_suspension_rod.yaml, released and at rest after 20 s, against Exudyn and PyElastica.

Whole runs from the YAML with the file written, CPU time, against the peers' own time loops: each with the fewest cells
and longest steps, of those tried, that end within 0.3 mm of the solution of the boundary value problem.

pytest bench/test_bench_suspension.py -m bench -n 0 -s
"""

from __future__ import annotations

from pathlib import Path
from statistics import median

import numpy as np
import pytest
from peers import exudyn_suspension, hybrid_suspension, pyelastica_suspension, suspension
from peers.hybrid_suspension import OURS
from peers.suspension import EXUDYN, PART

pytestmark = pytest.mark.bench
ROUNDS = 3


def test_a_rod_that_comes_to_rest(tmp_path: Path) -> None:
    for what in OURS:  # what is needed is loaded
        hybrid_suspension.run(tmp_path / "run.h5", *what)
    runs = {
        " ".join([command.__name__, *sets]): [
            hybrid_suspension.run(tmp_path / "run.h5", command, sets) for _ in range(ROUNDS)
        ]
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
