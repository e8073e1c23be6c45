"""The march at the extremes of size and stiffness, against LAPACK on the same equations.

Lines of 1 km, 1 km away from the origin, 10 to 20 000 cells, EI from 1e-9 to 1e6 N m2, in
statics and dynamics.  The bound on agreement is 1e-9 of the largest correction, or the
round-off that bending costs in double precision, where that is more: the element sees
EI/h^3 beside T/h, and a linear solve loses (EI/(T h^2)) (L/h)^2 eps; the last case here
(EI = 1e6, h = 5 cm) loses seven digits in either solver, and Newton mends them.
"""

import itertools

import numpy as np
import pytest
from problems import StepsOfLine, at_rest
from scipy.linalg import solve_banded

import hybrid
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.run.newton import block_rows, correction, workspace_of
from hybrid.model.build import build
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at

LENGTH, FAR = 1000.0, 1000.0
EPS = 2.2e-16


def hanging(kind, cells, stiffness):
    part = max(3, 3 * cells // 10)
    zones = {
        "rod": [{"rod": LENGTH, "cells": cells}],
        "catenary": [{"catenary": LENGTH, "cells": cells}],
        "hybrid": [
            {"rod": 300.0, "cells": part},
            {"catenary": 400.0, "cells": cells - 2 * part},
            {"rod": 300.0, "cells": part},
        ],
    }[kind]
    return hybrid.validate_scene(cable_scene(
        {"length": LENGTH, "mass": 1.0, "bending_stiffness": stiffness, "torsional_stiffness": stiffness},
        pinned_at(FAR, FAR, FAR), pinned_at(FAR + 900.0, FAR, FAR + 100.0), model={"kind": "zones", "zones": zones}
    ))  # fmt: skip


def banded(rows, tension):
    """The block rows of the march as LAPACK wants them: in bands, tensions in units of `tension`, rows of size one."""
    n = rows.shape[0]
    blocks = rows.reshape(n, SIZE, WIDTH).copy()
    blocks[:, :, [0, 5, 10, 15]] *= tension
    blocks /= np.abs(blocks[:, :, :-1]).max(axis=2, keepdims=True)
    low, up = 14, 13
    ab = np.zeros((low + up + 1, SIZE * n))
    i = np.arange(n)
    for k, c in itertools.product(range(SIZE), range(WIDTH - 1)):
        column, row = SIZE * (i - 2) + (c if c < 20 else c + 1), SIZE * i + k
        inside = (column >= 0) & (column < SIZE * n) & (blocks[:, k, c] != 0)
        ab[up + row[inside] - column[inside], column[inside]] += blocks[inside, k, c]
    return (low, up), ab, blocks[:, :, -1].ravel()


def disagreement(model, state, cv, ca):
    """March against LAPACK for one Newton network, relative to the largest correction of each kind of unknown."""
    rows = block_rows(model.line)
    work = workspace_of(model.line)._replace(rows=rows)
    work.u[:] = 0.0
    assert correction(model.line, model.sea.at_time(0.0), model.ends.at_time(0.0), state, cv, ca, work) == -1
    bands, ab, rhs = banded(rows, model.tension_scale)
    reference = solve_banded(bands, ab, rhs).reshape(-1, SIZE)
    reference[:, 0] *= model.tension_scale
    return max(np.abs((work.x - reference)[:, k]).max() / np.abs(reference[:, k]).max() for k in (0, slice(1, 4)))


# Bending does not matter to a catenary, and with most cells the least and the largest stiffness bound those between.
KINDS = [("catenary", 1e-9), *itertools.product(("rod", "hybrid"), (1e-9, 1e-3, 1e3, 1e6))]
LONG = [(kind, 20_000, stiffness) for kind, stiffness in KINDS if stiffness in (1e-9, 1e6)]


@pytest.mark.parametrize(
    ("kind", "cells", "stiffness"),
    [(kind, cells, stiffness) for kind, stiffness in KINDS for cells in (10, 100, 1000)]
    + [pytest.param(*x, marks=pytest.mark.slow) for x in LONG],
)
def test_converges_and_agrees_with_lapack(kind, cells, stiffness):
    model = build(one_line(hanging(kind, cells, stiffness)))
    line = model.line
    found = at_rest(model)
    h, tension = LENGTH / cells, 5600.0
    # relative to the weight: what is out of balance is round-off of moments EI/h^2 per node at worst
    assert found.residual < 1e-9 * model.tension_scale + 100 * EPS * stiffness / h**2

    # a Newton network far from its solution: a wavy line of the right length, and one step of time
    wavy = model.start.copy()
    wavy.e[:, 2] += 0.3 * line.h * np.sin(np.linspace(0, 6, cells))
    wavy.e[:] *= (line.h / np.linalg.norm(wavy.e, axis=1))[:, None]
    bound = 1e-9 + EPS * max(1.0, stiffness / (tension * h**2)) * (LENGTH / h) ** 2
    static = disagreement(model, wavy, 0.0, 0.0)
    moving = disagreement(model, wavy, 200.0, 4e4)
    print(f"{kind}, {cells} cells, EI {stiffness:g}: residual {found.residual:.1e} N, LAPACK {static:.1e} {moving:.1e}")
    assert static < bound
    assert moving < (1e-9 if cells <= 1000 else 1e-8)

    stepper = StepsOfLine(model)
    state = found.state.lines[0].copy()
    state.v[:, 1] = np.sin(np.pi * line.s / LENGTH)
    stepper.begin(state)
    new = state.copy()
    for _ in range(5):
        taken = stepper.step(0.0, state, new, 0.01, 0.5, 0.01)
        assert taken.outcome == 0 and taken.iterations <= 4
        state, new = new, state


@pytest.mark.parametrize("stiffness", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("tension", [1e4, 1e2, 1.0])
def test_long_line_at_low_tension(stiffness, tension):
    """1000 m, 5000 cells, pulled by `tension`: at most four iterations a step."""
    scene = hybrid.validate_scene(cable_scene(
        {"length": 1000.0, "mass": 0.5, "bending_stiffness": stiffness, "torsional_stiffness": stiffness},
        pinned_at(0, 0, 0), {"kind": "free", "force": [tension, 0, 0]}, gravity=0.0,
        initial={"kind": "straight", "direction": [1, 0, 0]}, model={"kind": "rod"}, mesh=5000, time=(1.0, 0.01)
    ))  # fmt: skip
    model = build(one_line(scene))
    stepper = StepsOfLine(model)
    state = model.start.copy()
    x = model.line.s / 1000.0
    state.v[:, 1], state.v[:, 2] = np.sin(3 * np.pi * x) * x, 0.3 * np.sin(5 * np.pi * x) * x
    stepper.begin(state)
    new = state.copy()
    most = 0
    for _ in range(50):
        taken = stepper.step(0.0, state, new, 0.01, 0.5, 0.01)
        assert taken.outcome == 0
        most = max(most, taken.iterations)
        state, new = new, state
    print(f"EI {stiffness}, T {tension}: at most {most} iterations a step")
    assert most <= 4
