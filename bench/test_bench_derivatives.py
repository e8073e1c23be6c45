"""What a derivative at rest costs, over the equilibrium that it is of.

pytest bench/test_bench_derivatives.py -m bench -n 0 -s

A derivative is what one more number in `by` adds, of the usual cells and of half of them, from which its error is.
CPU time, medians of seven.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from statistics import median
from typing import Any

import pytest

import hybrid

pytestmark = pytest.mark.bench
ROUNDS = 7
NUMBERS = ["cable.sections[0].length", "cable.sections[0].mass", "cable.sections[0].diameter", "environment.gravity"]


def hung(model: str, cells: int) -> hybrid.Scene:
    section = {
        "length": 220.0, "mass": 3.0, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 50.0,
        "torsional_stiffness": 50.0,
    }  # fmt: skip
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [200, 0, 10]}}
    return hybrid.validate_scene(
        {
            "environment": {"fluid": {"density": 1025, "surface": 50}},
            "cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium", "model": model,
            "mesh": {"cells": cells},
        }
    )  # fmt: skip


def spent(what: Callable[[], Any]) -> float:
    """Median CPU time, s, after a first call."""
    what()
    found = []
    for _ in range(ROUNDS):
        begin = clock.process_time()
        what()
        found.append(clock.process_time() - begin)
    return median(found)


@pytest.mark.parametrize("model", ["catenary", "rod"])
@pytest.mark.parametrize("cells", [100, 1000])
def test_a_derivative_over_its_equilibrium(model: str, cells: int) -> None:
    scene = hung(model, cells)
    rest = spent(lambda: hybrid.static(scene))
    of = ["tension@0", "max curvature"]
    one, four = (spent(lambda by=by: hybrid.sensitivity(scene, of, by)) for by in (NUMBERS[:1], NUMBERS))
    each = (four - one) / (len(NUMBERS) - 1)
    print(
        f"{model}, {cells} cells: equilibrium {1e3 * rest:.1f} ms, one more number {1e3 * each:.1f} ms: {each / rest:.2f}"
    )
