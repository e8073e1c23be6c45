"""What is said of compiled steps outside: how long calls are, how a try ended, samples of a line as views."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.state import books as b
from hybrid.kernels.state.obstacle_rows import SEEN
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import (
    NO_LAYERS_SEEN,
    NO_SOIL,
    NO_SOIL_SEEN,
    NOT_VARYING,
    Batch,
    Floats,
)

# Steps and samples that a call may take before Python writes them down.
ROWS = 512
# Cells times steps of a call: about 0.1 s, after which interrupts are heard and progress is reported.
CELL_STEPS = 200_000
# Waves that cost a cell in a step what all else does.
WAVES_OF_A_CELL = 10
# Numbers that the buffer of samples may hold, 16 MB.
MOST_SAMPLED = 2_000_000
# Of steps that have become short: kernels.state.books.Counts.
LENGTHS = "tiny_steps", "cut_by_gain", "cut_by_turn", "cut_by_newton", "cut_by_error", "cut_at"


class Tried(NamedTuple):
    """How a try ended."""

    outcome: Outcome
    iterations: int  # of Newton's method
    correction: float  # the next one, as it is predicted, relative
    where: int  # cell or node where it was worst


def batch_of_rows(
    rows: Floats,
    cells: int,
    held: np.ndarray,
    varies: bool,
    zones: int,
    touching: int,
    obstacles: int = 0,
    layers: int = 0,
    soil: bool = False,
) -> Batch:
    """Samples (n, size) of a line as views (kernels.state.books.sample_size).

    held: (2,) as `Ends` has it; varies: whether they have lengths and stiffness; zones: that a torque passes through;
    touching: N+1, or 0 where the line does not touch itself; obstacles: of which one moves; layers: numbers of a node;
    soil: whether nodes remember it.
    """
    at, count = 0, len(rows)

    def take(*shape: int) -> Floats:
        nonlocal at
        begin, at = at, at + math.prod(shape)
        return rows[:, begin:at].reshape(count, *shape)

    t, sea, position, frame = take(), take(4), take(2, 3), take(2, 9)
    spin, force, moment, report, work = take(2, 3), take(2, 3), take(2, 3), take(REPORT_SIZE), take(b.WORKS)
    r, v, vd = take(cells + 1, 3), take(cells + 1, 3), take(cells + 1, 3)
    e, T, a1, w = take(cells, 3), take(cells), take(cells, 3), take(cells)
    h, kb = (take(cells), take(cells + 1, 3)) if varies else (NOT_VARYING, NOT_VARYING)
    turn, touch, seen = take(zones, 3), take(touching), take(obstacles, SEEN)
    slipped = take(cells + 1, layers) if layers else NO_LAYERS_SEEN
    remembered = take(cells + 1, NO_SOIL.shape[1]) if soil else NO_SOIL_SEEN
    ends = np.repeat(held[None], count, axis=0)
    return Batch(
        t, r, v, vd, e, T, a1, w, ends, position, frame, spin, force, moment, report, work, sea, h, kb, turn, touch,
        seen, slipped, remembered,
    )  # fmt: skip


def no_extremes(columns: int) -> Floats:
    """Extremes (4, EXTREMES, columns) of nothing: lowest infinite, highest minus infinite, times unknown."""
    out = np.full((4, b.EXTREMES, columns), np.nan)
    out[0], out[1] = np.inf, -np.inf
    return out
