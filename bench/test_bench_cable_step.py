"""What a step and a run of one cable cost, by cells, kind and dimension, beside another checkout of this package if one is named.

HYBRID_OTHER=/path/to/checkout pytest bench/test_bench_cable_step.py -m bench -n 0 -s -o faulthandler_timeout=0

Both run in turns, each in a process of its own, some tenths of a second at a time; of each the shortest counts, because
whatever else a machine does only adds to it.  Of the same code twice it is 0.98 to 1.02, and up to 1.04 in rods of 1000 cells.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cable_steps import CASES, RUNS

import hybrid

pytestmark = pytest.mark.bench
ROUNDS = int(os.environ.get("HYBRID_BENCH_ROUNDS", "25"))
MOST = 1.03  # of the other checkout's step
HERE = Path(hybrid.__file__).parents[1]


class Costs:
    """A process that imports `hybrid` from a checkout, and runs cases there."""

    def __init__(self, checkout: Path) -> None:
        env = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-P", str(Path(__file__).with_name("cable_steps.py"))]
        self._process = subprocess.Popen(command, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def of(self, case: str) -> float:
        """Microseconds a step, or milliseconds a run."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(case, file=self._process.stdin, flush=True)
        return float(self._process.stdout.readline())

    def close(self) -> None:
        self._process.communicate()


@pytest.mark.parametrize(("cases", "unit"), [(CASES, "us"), (RUNS, "ms")], ids=["steps", "runs"])
def test_costs_of_one_cable(cases: list[str], unit: str) -> None:
    other = os.environ.get("HYBRID_OTHER")
    places = [Costs(HERE), *([Costs(Path(other))] if other else [])]
    over, ratios = {}, []
    print()
    for case in cases:
        for place in places:
            place.of(case)  # compiles, and warms caches
        least = np.min([[place.of(case) for place in places] for _ in range(ROUNDS)], axis=0)
        line = f"{case:20} {least[0]:9.1f} {unit}"
        if other:
            ratios.append(least[0] / least[1])
            line += f"   {least[1]:9.1f} {unit} there, ratio {ratios[-1]:.3f}"
            over |= {case: ratios[-1]} if ratios[-1] > MOST else {}
        print(line, flush=True)
    for place in places:
        place.close()
    if other:
        print(
            f"{len(cases)} rows, {min(ratios):.3f} to {max(ratios):.3f}, median {np.median(ratios):.3f}, {len(over)} above {MOST}"
        )
    assert not over
