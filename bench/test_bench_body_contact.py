"""What lines that touch a free body cost, beside the same lines on an obstacle (pytest bench/test_bench_body_contact.py -m bench -s)."""

from __future__ import annotations

from copy import deepcopy
from time import process_time
from typing import Any

import pytest

import hybrid
from tests.validation.test_validation_body_contact import pushed

MOST = 4.0  # times a step on an obstacle


def cheapest(tables: dict[str, Any]) -> tuple[float, float]:
    """The least processor time of a step of five runs, us, and its iterations."""
    best, result = float("inf"), hybrid.run(tables)
    steps = result.lines["left"]["steps/iterations"]
    for _ in range(5):
        begin = process_time()
        hybrid.run(tables).close()
        best = min(best, process_time() - begin)
    return 1e6 * best / len(steps), float(steps.mean())


@pytest.mark.bench
def test_a_body_costs_a_few_times_an_obstacle() -> None:
    """Two lines of 80 rods, pressed on by a ball of 1e12 kg, or by a fixed one, for 2000 steps: whole runs."""
    tables = pushed(stiffness=1e5)
    tables["environment"], tables["time"] = {"gravity": 0}, {"duration": 10.0, "step": 0.005}
    heavy = {"initial_guess": [4.2, 0.02, 0.57], "mass": 1e12, "inertia": [1e12] * 3,
             "shape": tables["bodies"]["ball"]["shape"]}  # fmt: skip
    other = deepcopy(tables)
    del other["bodies"]
    tables["bodies"], other["obstacles"] = {"ball": heavy}, {"ball": heavy["shape"] | {"at": heavy["initial_guess"]}}
    body, obstacle = cheapest(tables), cheapest(other)
    print(f"\n{'':12}{'us a step':>10}{'iterations':>12}")
    for name, (us, iterations) in (("body", body), ("obstacle", obstacle)):
        print(f"{name:12}{us:10.1f}{iterations:12.2f}")
    print(f"ratio {body[0] / obstacle[0]:.2f}, at most {MOST}")
    assert body[0] < MOST * obstacle[0]
