"""What modes cost: ten of a line of 10 000 cells, catenary and rod, and of a spar on three lines of 1000 cells each.

pytest bench/test_bench_modes.py -m bench -n 0 -s

The equilibrium and the matrices are counted apart from the eigenvalues; CPU time, medians of five.
"""

from __future__ import annotations

import time as clock
from statistics import median

import numpy as np
import pytest

import hybrid
from hybrid.linear.eigen import lowest_modes
from hybrid.linear.matrices import linear_network
from hybrid.modal.api import equilibrium_of

pytestmark = pytest.mark.bench
ROUNDS = 5


def hung(model, cells):
    section = {"length": 99.990048, "mass": 10.0, "axial_stiffness": 2e8}
    if model == "rod":
        section |= {"bending_stiffness": 1e3, "torsional_stiffness": 1e3, "diameter": 0.1}
    return hybrid.validate_scene(
        {
            "cable": {"sections": [section]},
            "ends": {name: {"kind": "pinned", "position": [x, 0, 0]} for name, x in (("start", 0), ("end", 100))},
            "initial": "equilibrium",
            "model": model,
            "mesh": {"cells": cells},
        }
    )


@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_ten_modes_of_ten_thousand_cells(model):
    rest = equilibrium_of(hung(model, 10_000))
    spent = []
    for _ in range(ROUNDS):
        begin = clock.process_time()
        network = linear_network(rest.solver, rest.states, rest.names, True)
        made = clock.process_time()
        found = lowest_modes(network, 10)
        spent.append((made - begin, clock.process_time() - made))
    matrices, eigen = (median(x[k] for x in spent) for k in (0, 1))
    lowest = np.sqrt(found.squares[found.squares > 1e-6])[:2]
    print(
        f"\n{model}: matrices {matrices:.2f} s, ten modes {eigen:.2f} s of CPU; {lowest} rad/s, missed {found.missed}"
    )
    assert found.missed == 0
