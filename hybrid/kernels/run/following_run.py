"""A run whose cells follow the curvature, compiled: steps and changes of cells without a return to Python.

Steps and the parts of a change are kernels of their own and called by address: a kernel takes a table of addresses as
constant (kernels.machine.references), so what writes to tables must not be one that reads them.  Tables differ with the side of
the arrays, the parity of the state and the number of cells: each is fixed numbers plus numbers per old and new cell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_distance import boxes_of
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.named_numbers import NamedNumbers
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.mesh.zone_step import ZoneClock, ZoneFlags
from hybrid.kernels.mesh.zone_switch import AFTER, BEFORE, NUMBERS, RELAXES, TIME
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.newton import ASSEMBLY, RUN

Numbers = NDArray[np.int64]


class FollowingCalls(NamedNumbers, number=np.int64):
    """Addresses of the kernels that are called."""

    solver: int
    lay_out: int
    clear: int
    line: int
    begin: int
    kinds: int
    end: int
    renew: int
    before_forces: int
    after_forces: int
    books: int  # of kernels.run.network.begin_line


class FollowingPlaces(NamedNumbers, number=np.int64):
    """Where things are: arrays, tables, memory for samples."""

    side: int  # of the arrays that are in use, and of the line now
    cells: int
    next_cells: int  # of a change that has begun
    changes: int  # so far
    task: int  # where the table of the run has its task, and address and rows of its samples
    alone: int  # 1 where cells may change without Python
    may_wait: int  # 1 where outputs may wait although the cells that they are of change
    waiting: int  # lines whose outputs wait; places of their nodes; numbers of their samples
    placed: int
    used: int
    boxes_at: int  # where the table of kernels.contact.self_distance has the rows of its tree


# Columns of `waiting`.
OFFSET, COUNT, OF_CELLS = range(3)


class FollowingJob(NamedTuple):
    """A run with all that its changes of cells need.  Tables: (..., 3, size) fixed, per old cell, per new cell."""

    calls: FollowingCalls
    at: FollowingPlaces
    clock: Clock  # of the run
    own: Clock  # and of the line, which is another one where there are several
    counts: b.Counts
    work: Floats
    zone_clock: ZoneClock
    zone_counts: ZoneFlags
    numbers: Floats  # (NUMBERS,) of kernels.mesh.zone_switch
    run: Numbers  # table of the run
    run_places: Numbers  # of those of its numbers that follow the cells
    in_run: NDArray[np.int64]  # (2 sides, 3, run_places.size)
    even: Numbers  # likewise its tables in steps from states of even parity, and of odd
    odd: Numbers
    in_odd: NDArray[np.int64]  # likewise of those
    zones: Numbers  # likewise of the table of zones
    zone_places: Numbers
    in_zones: NDArray[np.int64]
    itself: Numbers  # of kernels.contact.self_distance.watch_itself
    itself_places: Numbers  # empty: nobody watches
    in_itself: NDArray[np.int64]
    layouts: NDArray[np.int64]  # (2 sides, size), tables of kernels.mesh.cell_changes.lay_out
    line: Numbers  # table of fill_line
    lines: NDArray[np.int64]  # (2 new sides, 3, size)
    kind: Numbers  # of fill_kinds
    kinds: NDArray[np.int64]
    switch: Numbers  # of begin_switch and end_switch
    switches: NDArray[np.int64]  # (2 old sides x 2 parities, 3, size)
    renewed: Numbers  # of clear_state and renew
    renews: NDArray[np.int64]
    here: NDArray[np.bool_]  # (K+1,) of the finest mesh: nodes now
    waiting: NDArray[np.int64]  # (lines, 3)
    places: Numbers  # nodes of the lines whose outputs wait


def blank_following_job() -> FollowingJob:
    """A job with the types that every one has."""
    z, few, pairs, sides = np.zeros, np.zeros(1, np.int64), np.zeros((1, 3), np.int64), np.zeros((2, 3, 1), np.int64)
    return FollowingJob(
        FollowingCalls(), FollowingPlaces(), b.Clock(), b.Clock(), b.Counts(), z((2, b.WORKS)),
        ZoneClock(), ZoneFlags(), z(NUMBERS), few, few, sides, few, few, sides, few, few, sides, few, few, sides,
        z((2, 1), np.int64), few, sides, few, sides, few, sides, few, sides, z(1, bool), pairs, few,
    )  # fmt: skip


read = reader(blank_following_job())
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
def begin_change(job):
    """Lay out the cells that are planned, and carry the state to them."""
    at, counts, calls = job.at, job.counts, job.calls
    k, n = at.side, at.cells
    m = call_count(calls.lay_out, job.layouts[1 - k])
    at.next_cells = m
    put(job.renews[2 * k + counts.parity], n, m, job.renewed)
    put(job.switches[2 * k + counts.parity], n, m, job.switch)
    put(job.lines[1 - k], n, m, job.line)
    job.numbers[TIME], job.numbers[RELAXES] = job.clock.now, job.zone_counts.relaxing
    call(calls.clear, job.renewed)
    call(calls.line, job.line)
    call(calls.begin, job.switch)


@inner
def put_all(job):
    """The run goes on with the line of now."""
    k, m = job.at.side, job.at.cells
    put_at(job.in_run[k], job.run_places, m, job.run)
    put_at(job.in_zones[k], job.zone_places, m, job.zones)
    if job.itself_places.shape[0] > 0:
        put_at(job.in_itself[k], job.itself_places, m, job.itself)
        job.itself[job.at.boxes_at] = boxes(m)
    put_at(job.in_run[k], job.run_places, m, job.even)
    put_at(job.in_odd[k], job.run_places, m, job.odd)


@inner
def end_change(job):
    """Lengths, books and forces of the new cells, which the run goes on with; the energy is booked."""
    at, calls = job.at, job.calls
    k, n, m = at.side, at.cells, at.next_cells
    put(job.kinds[1 - k], n, m, job.kind)
    call(calls.kinds, job.kind)
    call(calls.end, job.switch)
    call(calls.renew, job.renewed)
    at.side, at.cells, at.changes = 1 - k, m, at.changes + 1
    put_all(job)
    job.own.now = job.clock.now
    call(calls.before_forces, job.run)
    job.run[at.task] = ASSEMBLY
    call_solver(calls.solver, job.run)
    job.run[at.task] = RUN
    call(calls.after_forces, job.run)
    call(calls.books, job.run)
    job.clock.previous = job.clock.now
    job.work[0, b.ZONES] += job.numbers[AFTER] - job.numbers[BEFORE]


# --- entries of parts, for Python -------------------------------------------------------------------


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


# --- outputs, steps -----------------------------------------------------------------------------------


@inner
def keep_rows(job):
    """The outputs that have been sampled of one of several lines wait where they are, with the places of its nodes."""
    at, some = job.at, job.counts.samples - job.at.used
    if some > 0:
        row = job.waiting[at.waiting]
        row[OFFSET], row[COUNT], row[OF_CELLS] = at.used, some, at.cells
        for i in range(job.here.shape[0]):
            if job.here[i]:
                job.places[at.placed] = i
                at.placed += 1
        at.used += some
        at.waiting += 1


@kernel
def ask_cells(table):
    """Whether nothing but the cells of one of several lines is to change, and they may without Python, as a number."""
    job = read(table)
    at, zones = job.at, job.zone_clock
    if at.alone == 0 or job.zone_counts.cells_due == 0 or zones.loudest > 1.0 or job.clock.now >= zones.next_review:
        return 0
    room = at.waiting < job.waiting.shape[0] and at.placed + at.cells + 1 <= job.places.shape[0]
    return 1 if job.counts.samples == at.used or (at.may_wait != 0 and room) else 0


@kernel
def change_cells(table):
    """Other cells of one of several lines, after outputs within the last step."""
    job = read(table)
    keep_rows(job)
    begin_change(job)
    end_change(job)
    return 1
