"""All that steps of a line need, by reference: what an entry of kernels.run.entry gets as its table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.state.books import Books, blank_books
from hybrid.kernels.state.state import (
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
from hybrid.kernels.step.newton import Limits, Task


class Job(NamedTuple):
    """Arguments of the entry."""

    task: Task
    line: Line
    sea: Sea
    ends: Ends
    moves: Moves
    old: State  # of a run: two states in turn, the one of even parity first
    new: State
    was: Floats  # (N+1, 4) a push out of the plane before a step; empty where there is none; likewise
    now: Floats  # (N+1, 4) and after it
    work: Work
    books: Books
    itself_table: NDArray[
        np.int64
    ]  # of a kernels.contact.self_distance.ItselfJob, of a line that could come near itself
    contact: NDArray[
        np.int64
    ]  # (3,) of kernels.contact.self_contact: address, 0: no contact; what is asked; whether it is near
    contact_table: NDArray[np.int64]  # of a kernels.contact.self_contact.ContactJob
    reel_table: NDArray[np.int64]  # of a kernels.reel.payout.ReelJob, of a line that is paid out
    itself: int = 0  # address of kernels.contact.self_distance.watch_itself; UNBENT: until the line is bent; 0: never
    solver: int = 0  # of a run: address of the kernel of the line's kind, which solves its steps
    reel: int = 0  # address of kernels.reel.payout.pay_out, of a line of several stand_among; 0: its length stays
    iterated: int = 0  # of a run: address of kernels.reel.payout.iterate; 0: iterations need nothing of it
    quantities: int = 0  # address of kernels.watch.named_quantities.note_quantities; 0: none are asked for


def blank_job() -> Job:
    """A job of one cell with the types that every job has."""
    state = blank_state(1)
    limits, none = Limits(1.0, 1.0, 1), np.zeros((0, 4))
    task = Task(0, limits=limits)
    return Job(
        task, blank_line(1), no_sea(1), no_ends(), no_moves(), state, state, none, none, no_work(), blank_books(),
        np.zeros(0, np.int64), np.zeros(3, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64),
    )  # fmt: skip


read = reader(blank_job())
call_solver, call_follower, call_itself = caller((0, 0, 0.0, 0)), caller(0), caller(0)
call_reel, call_quantities = caller(0), caller(0)
