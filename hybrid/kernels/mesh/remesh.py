"""Other cells for a line in the middle of a run: one road for cells that follow, kinds of cells and nodes at a winch.

Two sets of arrays with room for the most cells, the sides, take turns: a change goes from one to the other, and the
tables of the run get the numbers of the other one.  A planner says whether a change is due and how many cells there will
be; the parts of a change fill the new line, carry the state to it, and book what the run knows beside.

Steps, planners and parts are kernels of their own and called by address: a kernel takes a table of addresses as constant
(kernels.machine.references), so what writes to tables must not be one that reads them.  Tables differ with the side, the
parity of the state and the number of cells: each is fixed numbers plus numbers per old and new cell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_distance import boxes_of
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.named_numbers import NamedNumbers
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.newton import ASSEMBLY, RUN

Numbers = NDArray[np.int64]

# Numbers of a change: energy before it and after it, J; its time, s; 1 where lengths were on their way.
BEFORE, AFTER, TIME, RELAXES = range(4)
NUMBERS = 4


class RemeshCalls(NamedNumbers, number=np.int64):
    """Addresses of the kernels that are called."""

    solver: int
    due: int  # with the table of the planner: whether a change is due, and may be made without Python, as a number
    plan: int  # how many cells there will be
    keep: int  # keeps what outputs that wait need of the line that they are of; how many numbers that are
    before_forces: int  # with the table of the run
    after_forces: int
    books: int  # of kernels.run.network.begin_line
    stand: int  # with the table beside, of a line as it is now; 0: none


class RemeshPlaces(NamedNumbers, number=np.int64):
    """Where things are: arrays, tables, memory for samples."""

    side: int  # of the arrays that are in use, and of the line now
    cells: int
    next_cells: int  # of a change that has begun
    changes: int  # so far
    begun: int  # parts of a change up to which nobody but its line has heard of it
    task: int  # where the table of the run has its task
    alone: int  # 1 where cells may change without Python
    may_wait: int  # 1 where outputs may wait although the cells that they are of change
    waiting: int  # lines whose outputs wait; numbers that are kept for them; numbers of their samples
    placed: int
    used: int
    per_node: int  # numbers of a node that are kept at most, and room for all
    room: int
    boxes_at: int  # where the table of kernels.contact.self_distance has the rows of its tree


# Columns of `waiting`, and of `parts`.
OFFSET, COUNT, OF_CELLS = range(3)
ADDRESS, BEGIN, END = range(3)


class RemeshJob(NamedTuple):
    """A run with all that changes of cells need.  Tables: (..., 3, size) fixed, per old cell, per new cell."""

    calls: RemeshCalls
    at: RemeshPlaces
    clock: Clock  # of the run
    own: Clock  # and of the line, which is another one where there are several
    counts: b.Counts
    work: Floats
    numbers: Floats  # (NUMBERS,)
    planners: NDArray[np.int64]  # (2 sides, size) tables of the planner
    parts: NDArray[np.int64]  # (P, 3) address of the kernel of a part, begin and end of its table in `change`
    change: Numbers  # tables of the parts, one behind the other
    changed: NDArray[np.int64]  # (2 old sides x 2 parities, 3, size)
    run: Numbers  # table of the run
    run_places: Numbers  # of those of its numbers that follow the cells
    in_run: NDArray[np.int64]  # (2 sides, 3, run_places.size)
    even: Numbers  # likewise its tables in steps from states of even parity, and of odd
    odd: Numbers
    in_odd: NDArray[np.int64]  # likewise of those
    beside: Numbers  # likewise a table of what moves beside: zones, or the reel
    beside_places: Numbers
    in_beside: NDArray[np.int64]
    itself: Numbers  # of kernels.contact.self_distance.watch_itself
    itself_places: Numbers  # empty: nobody watches
    in_itself: NDArray[np.int64]
    waiting: NDArray[np.int64]  # (lines, 3)


def blank_remesh_job() -> RemeshJob:
    """A job with the types that every one has."""
    z, few, rows, sides = np.zeros, np.zeros(1, np.int64), np.zeros((1, 3), np.int64), np.zeros((2, 3, 1), np.int64)
    return RemeshJob(
        RemeshCalls(), RemeshPlaces(), b.Clock(), b.Clock(), b.Counts(), z((2, b.WORKS)), z(NUMBERS),
        z((2, 1), np.int64), rows, few, sides, few, few, sides, few, few, sides, few, few, sides, few, few, sides, rows,
    )  # fmt: skip


read = reader(blank_remesh_job())
call, call_count, call_solver = caller(None), caller(0), caller((0, 0, 0.0, 0))
boxes = inner(boxes_of)


@inner
def put(numbers, old, new, table):
    """A table for so many old and new cells."""
    for i in range(table.shape[0]):
        table[i] = numbers[0, i] + old * numbers[1, i] + new * numbers[2, i]


@inner
def put_at(numbers, places, cells, table):
    """Numbers of a table for so many cells, at some of its places."""
    for i in range(places.shape[0]):
        table[places[i]] = numbers[0, i] + cells * numbers[2, i]


@inner
def call_parts(job, first, last):
    """Parts of a change, from a number up to another one, which is excluded."""
    for k in range(first, last):
        call(job.parts[k, ADDRESS], job.change[job.parts[k, BEGIN] : job.parts[k, END]])


@inner
def begin_change(job):
    """Lay out the cells that are planned, and carry the state to them."""
    at = job.at
    k, n = at.side, at.cells
    m = call_count(job.calls.plan, job.planners[k])
    at.next_cells = m
    put(job.changed[2 * k + job.counts.parity], n, m, job.change)
    call_parts(job, 0, at.begun)


@inner
def put_all(job):
    """The run goes on with the line of now."""
    k, m = job.at.side, job.at.cells
    put_at(job.in_run[k], job.run_places, m, job.run)
    put_at(job.in_beside[k], job.beside_places, m, job.beside)
    if job.itself_places.shape[0] > 0:
        put_at(job.in_itself[k], job.itself_places, m, job.itself)
        job.itself[job.at.boxes_at] = boxes(m)
    put_at(job.in_run[k], job.run_places, m, job.even)
    put_at(job.in_odd[k], job.run_places, m, job.odd)


@inner
def end_change(job):
    """Lengths, books and forces of the new cells, which the run goes on with; the energy is booked."""
    at, calls = job.at, job.calls
    call_parts(job, at.begun, job.parts.shape[0])
    at.side, at.cells, at.changes = 1 - at.side, at.next_cells, at.changes + 1
    put_all(job)
    job.own.now = job.clock.now
    call(calls.before_forces, job.run)
    job.run[at.task] = ASSEMBLY
    call_solver(calls.solver, job.run)
    job.run[at.task] = RUN
    if calls.stand != 0:
        call(calls.stand, job.beside)
    call(calls.after_forces, job.run)
    call(calls.books, job.run)
    job.clock.previous = job.clock.now
    job.work[0, b.ZONES] += job.numbers[AFTER] - job.numbers[BEFORE]


@inner
def keep_rows(job):
    """The outputs that have been sampled wait where they are, with what they need of the line that they are of."""
    at, some = job.at, job.counts.samples - job.at.used
    if some > 0:
        row = job.waiting[at.waiting]
        row[OFFSET], row[COUNT], row[OF_CELLS] = at.used, some, at.cells
        at.placed += call_count(job.calls.keep, job.planners[at.side])
        at.used += some
        at.waiting += 1


# --- entries ----------------------------------------------------------------------------------------


@kernel
def put_cells(table):
    """`put_all`."""
    put_all(read(table))


@kernel
def begin_cells(table):
    """`begin_change`."""
    begin_change(read(table))


@kernel
def end_cells(table):
    """`end_change`."""
    end_change(read(table))


@kernel
def ask_cells(table):
    """Whether a change is due, and may be made without Python, as a number."""
    job = read(table)
    at = job.at
    if call_count(job.calls.due, job.planners[at.side]) == 0:
        return 0
    room = at.waiting < job.waiting.shape[0] and at.placed + at.per_node * (at.cells + 1) <= at.room
    return 1 if job.counts.samples == at.used or (at.may_wait != 0 and room) else 0


@kernel
def change_cells(table):
    """Other cells, after outputs within the last step."""
    job = read(table)
    keep_rows(job)
    begin_change(job)
    end_change(job)
    return 1
