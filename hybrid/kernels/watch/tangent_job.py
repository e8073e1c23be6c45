"""What tangents along the steps of a run work with (kernels.watch.tangents)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.books import Books, Clock, Counts, blank_books
from hybrid.kernels.state.state import (
    LANES,
    Ends,
    Floats,
    Line,
    Moves,
    Sea,
    State,
    Work,
    blank_line,
    blank_state,
    no_ends,
    no_moves,
    no_sea,
    no_work,
)
from hybrid.kernels.watch.wave_slopes import PHASES, SLOPES

# What is counted: steps that were followed; those that did not begin where the one before had ended.
FOLLOWED, BROKEN = range(2)
# Sizes of tangents of positions, m, and of tensions, N, by the number: the largest of all steps, their largest second
# corrections, the most that is left behind the last one; steps; whether the last one had one correction alone.
LARGEST_R, SECOND_R, LEFT_R, LARGEST_T, SECOND_T, LEFT_T, STEPS, ALONE = range(8)
TANGENT_SIZES = 8


class OtherLine(NamedTuple):
    """The line of a scene with more of a number, beside the line of a run."""

    line: Line
    sea: Sea
    ends: Ends
    moves: Moves
    even: State  # which take turns, as those of the run
    odd: State
    rates: State  # tangents, of the last step's end; e and a1 are not used
    spin: Floats  # (N,) rad
    before: State  # the same before the step
    spin_before: Floats  # (N,)
    work: Work
    books: Books  # the clock is that of the run; what is sampled is the other line
    left: Floats  # (N+1, 5) what its equations leave over
    sizes: Floats  # (8,) named above
    same_waves: int  # 1 where its waves are those of the run
    h: float


class TangentJob(NamedTuple):
    """A line of a run and those beside it (kernels.run.network_tangents)."""

    line: Line
    sea: Sea  # that of the run, but with room of its own for what an assembly writes
    ends: Ends
    even: State  # of the run
    odd: State
    work: Work  # of the run, whose last matrix is kept in X
    own: Work  # the same with a report of what the equations of the line leave over
    clock: Clock
    counts: Counts
    left: Floats  # (N+1, 5) what the equations of the line leave over
    last: Floats  # (N+1, 3) m/s2, a of the state that the last step led to
    ahead: Floats  # (N+1, 3) m, where the prediction of a step leads nodes
    slopes: Floats  # (N+1, 15) of waves there (kernels.watch.wave_slopes); empty: none are needed
    lanes: Floats  # (16 + 2 W, LANES) room for them
    found: NDArray[np.int64]  # (2,) named above
    tables: NDArray[np.int64]  # (P, size) of an OtherLine each


def blank_other() -> OtherLine:
    """With the types that every one has."""
    state, z = blank_state(1), np.zeros
    return OtherLine(
        blank_line(1), no_sea(1), no_ends(), no_moves(), state, state, state, z(1), state, z(1), no_work(),
        blank_books(), z((2, 5)), z(TANGENT_SIZES), 0, 1.0,
    )  # fmt: skip


def blank_tangent_job() -> TangentJob:
    """With the types that every one has."""
    state, z = blank_state(1), np.zeros
    return TangentJob(
        blank_line(1), no_sea(1), no_ends(), state, state, no_work(), no_work(), Clock(), Counts(), z((2, 5)),
        z((2, 3)), z((2, 3)), z((0, SLOPES)), z((PHASES, LANES)), z(2, np.int64), z((1, 1), np.int64),
    )  # fmt: skip


read_other, read_job = reader(blank_other()), reader(blank_tangent_job())
