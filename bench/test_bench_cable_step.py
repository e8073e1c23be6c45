"""What a step of one cable costs, by cells, kind and dimension, beside another checkout of this package if one is named.

HYBRID_OTHER=/path/to/checkout pytest bench/test_bench_cable_step.py -m bench -n 0 -s
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from statistics import median

import pytest

import hybrid

pytestmark = pytest.mark.bench
ROUNDS = 5
MOST = 1.03  # of the other checkout's step, as a median of pairs
HERE = Path(hybrid.__file__).parents[1]


def steps(checkout: Path) -> dict[str, float]:
    """Microseconds a step, in a process that imports `hybrid` from there."""
    env = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(Path(__file__).with_name("cable_steps.py"))]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def test_steps_of_one_cable() -> None:
    other = os.environ.get("HYBRID_OTHER")
    places = [HERE, *([Path(other)] if other else [])]
    for place in places:
        steps(place)  # compiles
    rounds = [[steps(place) for place in places] for _ in range(ROUNDS)]
    over = {}
    for case in rounds[0][0]:
        here = median(x[0][case] for x in rounds)
        line = f"{case:20} {here:9.1f} us"
        if other:
            ratio = median(x[0][case] / x[1][case] for x in rounds)
            line += f"   {median(x[1][case] for x in rounds):9.1f} us there, ratio {ratio:.3f}"
            over |= {case: ratio} if ratio > MOST else {}
        print(line)
    assert not over
