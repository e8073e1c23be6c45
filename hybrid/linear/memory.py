"""What remembers, about an equilibrium: layers that slip as a line bends, and soil.

Both have two stiffnesses there, of what loads them first and of small motions to and fro.  By the first, derivatives of
equilibria are known: each equilibrium is one of first loading.  The second is the limit of periodic motions that become
small: a layer that is at its slip moment slips in the first of them, and never again where they bend by less than that
moment over its stiffness; soil unloads and loads again along branches of the same first slope, K Pu/D.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.laws.bending_slip import (
    BEHIND_REST,
    EACH,
    FROM,
    KEPT,
    LOADED_FIRST,
    MOMENT,
    MOST,
    PER_TENSION,
    STIFF,
    STIFFENING,
    STIFFNESS,
    follow_slip,
)
from hybrid.kernels.laws.soil import BRANCH, DEPTH, PRESSES, TURN, TURN_P, UP, settle_in_soil
from hybrid.kernels.state.report import SOIL
from hybrid.kernels.state.state import NO_ADDRESS, Ends, Floats, Line, Sea, State, Work

# Step, of the largest tension, by which moments of layers are differentiated.
PULLED = 1e-5
# Part of the pressure by which a branch begins below that of first penetration, which else would be taken.
BELOW = 1e-9


def pulls(T: Floats) -> Floats:
    """(N+1,) tension at the nodes, N, not below 0, as layers feel it; T: (N,) of cells."""
    return np.asarray(np.maximum(0.5 * (np.append(T[0], T) + np.append(T, T[-1])), 0.0))


def with_layers(line: Line, state: State, sticks: bool) -> Line:
    """The line with what its layers bear in a state: sticking to where they have slipped to, or as loaded first."""
    law = line.slip_law
    if not law.size:
        return line
    now, T = np.zeros_like(law), pulls(state.T)[:, None]
    now[:, STIFF::EACH] = law[:, STIFFNESS::EACH] + law[:, STIFFENING::EACH] * T
    most, elastic = law[:, MOMENT::EACH] + law[:, PER_TENSION::EACH] * T, law[:, MOMENT::EACH] < 0.0
    now[:, MOST::EACH] = np.where(elastic, most, np.inf) if sticks else most
    for k in range(KEPT if sticks else 0):
        now[:, FROM + k :: EACH] = state.layers[:, k::KEPT]
    return line._replace(slip_now=now, slip_at=NO_ADDRESS)


def load_layers(line: Line, ends: Ends, state: State, work: Work) -> None:
    """How far layers slip in a first loading to a state, into its `layers`."""
    if line.slip_law.size:
        for part in (LOADED_FIRST, BEHIND_REST):
            follow_slip(line, ends, state, state, work, part)


def by_layers(line: Line, state: State, sticks: bool, left: Callable[[Line], Floats]) -> sparse.csr_array:
    """What tension changes of the moments of layers, which block rows do not know: (5 (N+1), 5 (N+1)).

    left: (N+1, 5) what is left over of the equations of this state on a line.
    """
    n = state.T.size
    step = PULLED * max(float(np.abs(state.T).max()), 1e-300)
    rows, columns, values = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0)]
    for first in range(min(4, n)):  # a cell's tension is in the moments of its nodes, and these in four rows
        cells = np.arange(first, n, 4)
        both = []
        for sign in (1.0, -1.0):
            T = state.T.copy()
            T[cells] += sign * step
            both.append(left(with_layers(line, state._replace(T=T), sticks)))
        change = (both[0] - both[1]) / (2.0 * step)
        for c in cells.tolist():
            begin = max(c - 1, 0)
            near = change[begin : c + 3]
            i, k = np.nonzero(near)
            rows.append(SIZE * (i + begin) + k)
            columns.append(np.full(i.size, SIZE * (c + 1)))
            values.append(near[i, k])
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_array(entries, shape=(SIZE * (n + 1),) * 2)


def with_soil(line: Line, sea: Sea, state: State, turns: bool) -> State:
    """The state with what soil remembers of it: that it has been pressed on as far and turns there; or nothing."""
    if not line.bits & SOIL:
        return state
    soil = np.zeros_like(state.soil)
    if turns:
        settle_in_soil(line, sea, state.r, soil)
        inside = soil[:, DEPTH] > 0.0
        soil[inside, BRANCH] = UP
        soil[inside, TURN], soil[inside, TURN_P] = soil[inside, DEPTH], (1.0 - BELOW) * soil[inside, PRESSES]
    return state._replace(soil=soil)
