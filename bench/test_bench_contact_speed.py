"""What contact of a line with itself costs: examples/plectoneme.yaml beside the same line without contact.

    pytest bench/test_bench_contact_speed.py -m bench -n 0 -s
    HYBRID_OTHER=/path/to/checkout of 0.6.0 pytest bench/test_bench_contact_speed.py -m bench -n 0 -s -k plectoneme

Processor time, the least of several runs; ratios are taken within one run, so that machines compare.
BEFORE: the same ratios before pivot blocks were factored once, sweeps cut short and friction differentiated exactly.
Steps without contact are shorter than they were, too: with HYBRID_OTHER, whole runs are compared with that checkout's.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import hybrid
from tests.inside import OnlyLine

pytestmark = pytest.mark.bench
EXAMPLE = Path(__file__).parents[1] / "examples" / "plectoneme.yaml"
# (cells, friction): time with contact over that without it, and the tension at the end, N.
BEFORE = {(200, 0.0): (4.6, 77.347557), (400, 0.0): (3.84, 77.253431), (200, 0.2): (23.0, 30.332339)}
COMPILED_BEFORE = 0.73  # compilation of the kernel of contact over that of a line in space
RUNS = 3

COMPILE = """
import sys, time
from hybrid.kernels.machine import kept_code
import hybrid

made = kept_code.KeptCode._compiled
def timed(self, key):
    begin = time.process_time()
    code = made(self, key)
    print(self._function.__qualname__, time.process_time() - begin)
    return code
kept_code.KeptCode._compiled = timed
hybrid.Simulation(sys.argv[1]).advance(0.02)
"""


def scene(cells: int, friction: float | None) -> dict[str, Any]:
    """friction: None: without contact."""
    tables: dict[str, Any] = yaml.safe_load(EXAMPLE.read_text())
    tables["mesh"]["cells"] = cells
    tables["contact"] = {"self": friction is not None} | ({"friction": friction} if friction else {})
    return tables


def measured(cells: int, friction: float | None, runs: int = RUNS) -> tuple[float, int, float, float]:
    """Least processor time, s, of all of the motion; its steps, Newton iterations a step, tension at the end, N."""
    least = float("inf")
    for _ in range(runs):
        simulation = hybrid.Simulation(hybrid.validate_scene(scene(cells, friction)))
        begin = time.process_time()
        simulation.advance(14.0)
        least = min(least, time.process_time() - begin)
    line = OnlyLine(simulation)
    iterations = float(np.mean(simulation.result().steps["iterations"]))
    return least, line.steps, iterations, float(line.state.T[-1])


@pytest.mark.parametrize(("cells", "friction"), BEFORE)
def test_a_plectoneme(cells: int, friction: float) -> None:
    """At most half of what it took, with friction at most 0.35; the tension within 1e-4."""
    measured(cells, friction, 1)  # compiles
    free, *_ = measured(cells, None)
    touching, steps, iterations, tension = measured(cells, friction)
    ratio, before = touching / free, BEFORE[cells, friction]
    print(
        f"\n{cells} cells, friction {friction:g}: {touching:.2f} s, {steps} steps of {iterations:.2f} iterations, {ratio:.2f} of without contact "
        f"(before {before[0]:g}), {ratio / before[0]:.2f} of before; tension {tension:.6f} N, before {before[1]:.6f}"
    )
    assert abs(tension - before[1]) < 1e-4 * before[1]
    other = os.environ.get("HYBRID_OTHER")
    if other:
        here, there = (run_in(Path(x), cells, friction) for x in (Path(hybrid.__file__).parents[1], other))
        print(f"here {here[0]:.2f} s, there {there[0]:.2f} s: {here[0] / there[0]:.2f} of it; {here[1]} and {there[1]} steps, "
              f"tension {here[2]:.6f} and {there[2]:.6f} N")  # fmt: skip


def run_in(checkout: Path, cells: int, friction: float) -> tuple[float, int, float]:
    """Processor time, s, steps, tension at the end, N, in a process that imports `hybrid` from there."""
    env = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(Path(__file__).with_name("plectoneme_run.py")), str(cells), str(friction)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    seconds, steps, tension = json.loads(done.stdout.splitlines()[-1])
    return seconds, steps, tension


def test_compilation(tmp_path: Path) -> None:
    """Of a first scene with contact: what its kernel takes beside that of a line in space."""
    code = subprocess.run(
        [sys.executable, "-c", COMPILE, str(EXAMPLE)], env=os.environ | {"HYBRID_CACHE_DIR": str(tmp_path)},
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    took = {name: float(seconds) for name, seconds in (row.split() for row in code.splitlines())}
    ratio = took["contact_task"] / took["in_space"]
    print(f"\nkernel of contact {took['contact_task']:.1f} s, of a line in space {took['in_space']:.1f} s: ", end="")
    print(f"{ratio:.2f} of it, before {COMPILED_BEFORE}")
