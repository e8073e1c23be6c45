"""What a computation costs, as processor time of this process on one core.

    pytest bench -m bench -s

Each figure is the median of several runs; ratios are taken within one run.  The bounds
are those of the project's first issue, for a server core of 2024; on another machine
quote the ratios.
"""

import time
from statistics import median

import numba
import numpy as np
import pytest
from problems import StepsOfLine, at_rest, suspension
from scipy.linalg import solve_banded

import hybrid
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH, eliminate_wide, substitute
from hybrid.kernels.machine import compiler
from hybrid.kernels.run.newton import assembly, block_rows
from hybrid.model.build import build
from hybrid.scene.read import one_line

pytestmark = pytest.mark.bench
RUNS = 7


def scene(zones, every=20.0, start="straight"):
    """The suspension in zones [(kind, length, cells)], relaxing for 20 s."""
    data = suspension(None, 40).model_dump(exclude_none=True)
    data["model"] = {"kind": "zones", "zones": [{kind: length, "cells": n} for kind, length, n in zones]}
    data |= {"time": {"duration": 20.0, "step": 0.01}, "output": {"every": every}}
    data["dimension"] = 3  # the plane has a bench of its own, test_bench_parts.py
    data["initial"] = {"kind": "straight", "direction": [1, 0, 0]} if start == "straight" else {"kind": "equilibrium"}
    del data["mesh"]
    return hybrid.validate_scene(data)


def moving(zones):
    """A stepper and a state in motion, for timing steps without a driver."""
    model = build(one_line(scene(zones, start="equilibrium")))
    found = at_rest(model, np.inf)
    stepper = StepsOfLine(model)
    state = found.state.lines[0].copy()
    state.v[:, 1] = 0.1 * np.sin(0.25 * np.pi * model.line.s)  # no turn at the guide, no speed at the pin
    stepper.begin(state)
    return model, stepper, state


def cost(zones):
    """Microseconds per cell and iteration, per step, and iterations per step, all included."""
    model, stepper, start = moving(zones)
    cells = model.cells
    steps = max(2, 20_000 // cells)
    each, iterations = [], 0
    for _ in range(RUNS):
        old, new, iterations = start.copy(), start.copy(), 0
        begin = time.process_time()
        for _ in range(steps):
            taken = stepper.step(np.inf, old, new, 0.01, 0.5, 0.01)
            iterations += taken.iterations
            old, new = new, old
        each.append(time.process_time() - begin)
    seconds = median(each)
    return 1e6 * seconds / iterations / cells, 1e6 * seconds / steps, iterations / steps


def test_cost_per_cell_and_iteration():
    per_cell = {}
    for kind, bound in (("rod", 0.65), ("catenary", 0.30)):
        for cells in (200, 1000, 20_000):
            per_cell[kind, cells], step, iterations = cost([(kind, 2.0, cells)])
            print(
                f"{kind:8s} {cells:6d} cells: {per_cell[kind, cells]:.3f} us per cell and iteration, {iterations:.2f} iterations, {step:.0f} us a step"
            )
            if (kind, cells) == ("rod", 200):
                assert step <= 300.0
            assert per_cell[kind, cells] <= bound
        growth = per_cell[kind, 20_000] / per_cell[kind, 200]
        print(f"{kind:8s} cost per cell at 20 000 cells / at 200: {growth:.2f}")
        assert growth <= 1.3


@numba.njit(**compiler._OPTIONS)
def eliminate(rows, W, X):
    """What the march does with block rows once they are assembled."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            W[j] = rows[i, j]
        if not eliminate_wide(W, X, i, 0, 1.0):
            return False
    return True


def test_elimination_against_lapack():
    """Elimination and substitution against solve_banded, on the same system of 1000 rod cells."""
    model, stepper, state = moving([("rod", 2.0, 1000)])
    rows = block_rows(model.line)
    assembly(
        model.line,
        model.sea.at_time(np.inf),
        model.ends.at_time(np.inf),
        state,
        200.0,
        4e4,
        stepper.solver.work._replace(rows=rows),
    )
    W, X, x = stepper.solver.work.W, stepper.solver.work.X, stepper.solver.work.x
    blocks = rows.reshape(1001, SIZE, WIDTH)
    low, up = 14, 13
    ab, i = np.zeros((low + up + 1, SIZE * 1001)), np.arange(1001)
    for k in range(SIZE):
        for c in range(WIDTH - 1):
            column, row = SIZE * (i - 2) + (c if c < 20 else c + 1), SIZE * i + k
            inside = (column >= 0) & (column < SIZE * 1001) & (blocks[:, k, c] != 0)
            ab[up + row[inside] - column[inside], column[inside]] += blocks[inside, k, c]
    rhs = blocks[:, :, -1].ravel()
    assert eliminate(rows, W, X)
    ours, lapack = [], []
    for _ in range(50):
        begin = time.process_time()
        eliminate(rows, W, X)
        substitute(X, x)
        ours.append(time.process_time() - begin)
        begin = time.process_time()
        solve_banded((low, up), ab, rhs, check_finite=False)
        lapack.append(time.process_time() - begin)
    ratio = median(lapack) / median(ours)
    print(
        f"1000 rod cells: elimination {1e6 * median(ours):.0f} us, solve_banded {1e6 * median(lapack):.0f} us, ratio {ratio:.1f}"
    )
    assert ratio >= 5.0


def per_step(zones):
    """Microseconds of a whole run per step (driver, log, ledger; two outputs), and iterations per step."""
    each = []
    for _ in range(RUNS):
        result = hybrid.run(scene(zones))
        each.append(result.steps["cpu"][-1] / len(result.steps["t"]))
    return 1e6 * median(each), result.steps["iterations"].mean()


def test_python_overhead():
    """A run of a line of two cells is nearly all overhead."""
    step, _ = per_step([("catenary", 2.0, 2)])
    kernel = cost([("catenary", 2.0, 2)])[1]
    print(f"two cells: {step:.0f} us a step, of which the compiled call with its arguments takes {kernel:.0f} us")
    assert step <= 50.0


def test_hybrid_against_rod():
    """All-rod over hybrid, whole runs: equal cells, and catenary cells four times as long."""
    rod, _ = per_step([("rod", 2.0, 200)])
    equal, _ = per_step([("catenary", 1.5, 150), ("rod", 0.5, 50)])
    longer, _ = per_step([("catenary", 1.5, 38), ("rod", 0.5, 50)])
    error = {}
    fine = hybrid.static(scene([("catenary", 1.5, 1200), ("rod", 0.5, 400)])).position[0]
    for name, catenary in (("equal", 150), ("longer", 38)):
        coarse = hybrid.static(scene([("catenary", 1.5, catenary), ("rod", 0.5, 50)])).position[0]
        error[name] = np.linalg.norm(coarse - fine, axis=1).max()
    print(f"rod {rod:.0f} us, hybrid {equal:.0f} us a step: ratio {rod / equal:.2f}")
    print(
        f"catenary cells four times longer: {longer:.0f} us, ratio {rod / longer:.2f}, error {error['longer'] / error['equal']:.3f} of that at equal cells"
    )
    assert rod / equal >= 1.6
    # A quarter of the cells are rod in both, so the ratio cannot pass 4 even if catenary cells were free.
    assert rod / longer >= 2.0
    assert error["longer"] <= 1.2 * error["equal"]
