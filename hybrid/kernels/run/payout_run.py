"""A run of a line that is paid out, compiled: steps, and nodes that enter and leave, without a return to Python.

Two sets of arrays with room for the longest line take turns.  Steps and the parts of a change are kernels of their own
and called by address, as in kernels.run.following_run, whose tables these are: fixed numbers plus numbers per old and new
cell.  Places, nodes and cells count from the far end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_distance import boxes_of
from hybrid.kernels.laws.obstacles import stored_in_contact
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.named_numbers import NamedNumbers
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.mesh.cell_changes import clear, copy_state, wave_step
from hybrid.kernels.mesh.fill_line import copy_cell, copy_node, move_line
from hybrid.kernels.mesh.zone_transfer import carry_push
from hybrid.kernels.reel.paid_length import cell, node, prepare
from hybrid.kernels.reel.payout_nodes import CarryJob, blank_carry_job, move_row, place_reel
from hybrid.kernels.reel.reel import Reel, blank_reel
from hybrid.kernels.reel.winch import Winch, at_its_end
from hybrid.kernels.run.following_run import call, call_solver, put, put_at
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books, Clock, blank_books
from hybrid.kernels.state.report import TOUCHES
from hybrid.kernels.state.state import (
    Ends,
    Floats,
    Line,
    Sea,
    State,
    Work,
    blank_line,
    blank_state,
    no_ends,
    no_sea,
    no_work,
)
from hybrid.kernels.step.newton import ASSEMBLY, RUN

Numbers = NDArray[np.int64]


class NodeJob(NamedTuple):
    """One node more or less: what a run has before and after it, in two sets of arrays."""

    carry: CarryJob
    whole: Line  # with all material nodes that there may be
    ends: Ends
    sea: Sea  # of the new cells, as all that follows
    work: Work
    twin: State
    before: Books
    books: Books
    push: Floats  # (N+1, 4) out of the plane; empty: none
    new_push: Floats
    next_push: Floats
    width: Floats  # (M,) m, diameters of the new cells; empty: nobody watches whether the line meets itself
    nearest: NDArray[np.int64]  # (2,) the pair of its cells that was nearest
    borne: Floats  # (P,) length over unstretched length that pieces bear, as of Reel.pieces
    widths: Floats  # (P,) m, their diameters
    start: Floats  # (M, 3) m, of all material nodes along the line: positions from which displacements count
    bounds: Floats  # (4, EXTREMES, E) extremes at all nodes, along the line, those that are marked twice
    moment: Floats  # (M+1, 3) this and the next: work arrays
    strain: Floats
    energy: Floats  # (5,)
    scale: float  # N, tension scale


def blank_node_job() -> NodeJob:
    """A job with the types that every one has."""
    z, books, none = np.zeros, blank_books(), np.zeros((0, 4))
    return NodeJob(
        blank_carry_job(), blank_line(1), no_ends(), no_sea(1), no_work(), blank_state(1), books, books, none, none,
        none, z(0), z(2, np.int64), z(1), z(1), z((2, 3)), z((4, b.EXTREMES, 2)), z((2, 3)), z((2, 3)), z(5), 1.0,
    )  # fmt: skip


read_node = reader(blank_node_job())


# --- one change -----------------------------------------------------------------------------------


@inner
def complete(whole, line, reel, k):
    """Node and cell k have all their material."""
    copy_node(whole, node(whole, reel, k), line, node(line, reel, k))
    copy_cell(whole, cell(whole, reel, k), line, cell(line, reel, k))


@inner
def line_as(line, whole, out, reel):
    """The same line in another number of cells, its length still to be given to it."""
    n, m, rides = line.h.shape[0], out.h.shape[0], reel.layer.shape[0]
    g, grows = n - rides, m - rides
    move_line(line, out, reel.numbers.side > 0.0, min(g, grows) + 1, m - n)
    for k in range(g, grows):
        complete(whole, out, reel, k)
    if grows > g:
        out.s[node(out, reel, grows)] = whole.s[node(whole, reel, grows)]
    for k in range(grows, m + 1):
        i = node(out, reel, k)
        out.force[i, 0], out.force[i, 1] = 0.0, 0.0  # what rounding leaves of those on nodes that ride


@inner
def fold(job, n, forward):
    """Take the extremes of the old nodes into those of all: the fairlead counts for the next node."""
    books, columns = job.before, job.bounds.shape[2]
    at = 0 if forward else columns - job.before.extremes.shape[2]
    for i in range(n + 1):
        take_in(books.extremes, job.bounds, i, at)
        at += 1
        if books.right[i] != i:
            take_in(books.extremes, job.bounds, books.right[i], at)
            at += 1


@kernel
def take_in(extremes, bounds, column, at):
    """Extremes of one column into those at a place."""
    for row in range(bounds.shape[1]):
        x, y = extremes[0, row, column], extremes[1, row, column]
        if np.isfinite(x) and x < bounds[0, row, at]:
            bounds[0, row, at], bounds[2, row, at] = x, extremes[2, row, column]
        if np.isfinite(y) and y > bounds[1, row, at]:
            bounds[1, row, at], bounds[3, row, at] = y, extremes[3, row, column]


@inner
def piece_at(reel, s):
    """The piece of the material at an arc length."""
    place, k = reel.numbers.side * (s - reel.numbers.far), 0
    while k + 1 < reel.pieces.shape[0] and reel.pieces[k + 1, 0] <= place:
        k += 1
    return k


@inner
def renew_books(job, n, m, forward, cut):
    """What a run knows beside its state, of the new nodes and cells."""
    before, books, start, s = job.before, job.books, job.start, job.carry.target.s
    if before.extremes.shape[1] > 0:
        fold(job, n, forward)
    move_row(before.marks, books.marks, forward, cut, m - n)
    column, first = m + 1, 0 if forward else start.shape[0] - 1 - m
    for i in range(m + 1):
        books.right[i] = i
        if books.marks[i]:
            books.right[i] = column
            column += 1
        for j in range(3):
            books.start[i, j] = start[first + i, j]
    for c in range(m):
        piece = piece_at(job.carry.new, 0.5 * (s[c] + s[c + 1]))
        books.borne[c] = job.borne[piece]
        if job.width.shape[0] > 0:
            job.width[c] = job.widths[piece]
    job.nearest[0], job.nearest[1] = -1, -1
    if not forward:
        for k in range(books.base.shape[0]):
            books.base[k] += m - n
    clear(books.tension)
    clear(books.strains)
    for row in range(books.extremes.shape[1]):
        for k in range(books.extremes.shape[2]):
            books.extremes[0, row, k], books.extremes[1, row, k] = np.inf, -np.inf
            books.extremes[2, row, k], books.extremes[3, row, k] = np.nan, np.nan


@kernel
def energy_of(line, ends, state, moment, strain, parts):
    """Kinetic, elastic and potential energy, J; the last three are work arrays (N+1, 3), (N+1, 3), (5,)."""
    observe(line, ends, state.e, state.v, state.a1, state.w, state.T, state.turn, Observed(moment, strain, parts))
    found = parts[0] + parts[1] + parts[2] + parts[3]
    for i in range(line.h.shape[0] + 1):
        for j in range(3):
            found -= line.force[i, j] * state.r[i, j]
    return found


# Parts of a change, in this order; between the first two comes kernels.reel.payout_nodes.carry_node, whose table begins this one.


@kernel
def change_line(table):
    """One node more, or less, at the fairlead: the line and its reel."""
    job = read_node(table).carry
    reel, new = job.reel, job.new
    for k in range(reel.numbers.plain.shape[0]):
        new.numbers.plain[k] = reel.numbers.plain[k]
    new.stage.riding_on, new.stage.balance_on, new.stage.flow_known, new.numbers.due = 0.0, 0.0, 0.0, 0.0
    place_reel(new, job.nodes, job.target.h.shape[0] - reel.layer.shape[0] + 1)
    line_as(job.line, read_node(table).whole, job.target, new)
    prepare(job.target, new, job.clock.now)  # what new cells lack goes by what they are made of


@kernel
def fit_changed(table):
    """The new line has the length of now."""
    job = read_node(table).carry
    prepare(job.target, job.new, job.clock.now)


@kernel
def book_change(table):
    """The energy, J, that the new nodes put in."""
    job = read_node(table)
    more = 0.0
    for k in range(2):  # one call for both: it is compiled once
        line, state = (job.carry.target, job.carry.out) if k else (job.carry.line, job.carry.state)
        found = energy_of(line, job.ends, state, job.moment, job.strain, job.energy)
        if line.bits & TOUCHES:
            found += stored_in_contact(line, job.sea, state.r)
        more = found - more
    job.before.work[0, b.ZONES] += more


@kernel
def renew_run(table):
    """What a run knows beside the line and its state, as of the beginning; what it knew is kept where it must be."""
    job = read_node(table)
    line, target, clock, forward = job.carry.line, job.carry.target, job.carry.clock, job.carry.new.numbers.side > 0.0
    n, m = line.h.shape[0], target.h.shape[0]
    copy_state(job.carry.out, job.twin)
    if job.push.shape[0] > 0:
        carry_push(job.push, line.s, target.s, job.new_push)
        for i in range(m + 1):  # of a state of either parity, as the state
            for k in range(job.new_push.shape[1]):
                job.next_push[i, k] = job.new_push[i, k]
    renew_books(job, n, m, forward, min(n, m) - job.carry.new.layer.shape[0] + 1)
    clear(job.sea.axis)
    clear(job.sea.slip)
    clear(job.sea.slid)
    clear(job.sea.bed)
    clear(job.sea.flow)
    for j in range(job.work.report.shape[0]):
        job.work.report[j] = 0.0
    job.books.clock.wave_step, clock.previous = wave_step(target, job.scale), clock.now
    job.books.counts.parity = 0


class LineJob(NamedTuple):
    """A line, and the same of another length (written), whose places are put into its reel."""

    line: Line
    whole: Line  # with all material nodes that there may be
    out: Line
    reel: Reel  # of `out`
    nodes: Floats  # (M,) m


def blank_line_job() -> LineJob:
    return LineJob(blank_line(1), blank_line(1), blank_line(1), blank_reel(1), np.zeros(2))


read_line = reader(blank_line_job())


@kernel
def make_line(table):
    """`line_as`, and its reel."""
    job = read_line(table)
    place_reel(job.reel, job.nodes, job.out.h.shape[0] - job.reel.layer.shape[0] + 1)
    line_as(job.line, job.whole, job.out, job.reel)


# --- steps and changes ----------------------------------------------------------------------------


class PaidCalls(NamedNumbers, number=np.int64):
    """Addresses of the kernels that are called."""

    solver: int
    change: int
    carry: int
    fit: int
    book: int
    renew: int
    before_forces: int
    stand_still: int
    after_forces: int
    books: int  # of kernels.run.network.begin_line


class PaidPlaces(NamedNumbers, number=np.int64):
    """Where things are: arrays, tables, memory for samples."""

    on: int  # the arrays that are in use, and cells of the line now
    cells: int
    changes: int  # so far
    task: int  # where the table of the run has its task, and address and rows of its samples
    may_wait: int  # 1 where outputs may wait although the line that they are of changes
    waiting: int  # lines whose outputs wait; numbers of their samples
    used: int
    placed: int  # numbers of its reels that wait with them, in the memory for samples
    boxes_at: int  # where the table of kernels.contact.self_distance has the rows of its tree


# Columns of `waiting`, and numbers per cell of a reel behind the samples: lack, rate, since, span.
OFFSET, COUNT, OF_CELLS = range(3)
OF_REEL = 4


class PaidRunJob(NamedTuple):
    """A run with all that nodes which enter and leave need.  Tables: (..., 3, size) fixed, per old cell, per new cell."""

    calls: PaidCalls
    at: PaidPlaces
    clock: Clock  # of the run
    own: Clock  # and of the line, which is another one where there are several
    counts: b.Counts
    winch: Winch
    first: Reel  # in the two sets of arrays, with all their room
    second: Reel
    run: Numbers  # table of the run
    run_places: Numbers  # of those of its numbers that follow the cells
    in_run: NDArray[np.int64]  # (2 sides, 3, run_places.size)
    even: Numbers  # likewise its tables in steps from states of even parity, and of odd
    odd: Numbers
    in_odd: NDArray[np.int64]  # likewise of those
    paid: Numbers  # likewise the table of kernels.reel.payout
    paid_places: Numbers
    in_paid: NDArray[np.int64]
    itself: Numbers  # of kernels.contact.self_distance.watch_itself
    itself_places: Numbers  # empty: nobody watches
    in_itself: NDArray[np.int64]
    node: Numbers  # table of a change
    nodes: NDArray[np.int64]  # (2 old sides x 2 parities, 3, size)
    waiting: NDArray[np.int64]  # (lines, 3)
    room: Floats  # for what cells of lines of before lacked


def blank_paid_run_job() -> PaidRunJob:
    """A job with the types that every one has."""
    z, few, sides, reel = np.zeros, np.zeros(1, np.int64), np.zeros((2, 3, 1), np.int64), blank_reel(1)
    return PaidRunJob(
        PaidCalls(), PaidPlaces(), b.Clock(), b.Clock(), b.Counts(), Winch(), reel, reel, few, few, sides,
        few, few, sides, few, few, sides, few, few, sides, few, sides, z((1, 3), np.int64), z(1),
    )  # fmt: skip


read = reader(blank_paid_run_job())
boxes = inner(boxes_of)


@inner
def reel_of(job):
    return job.second if job.at.on else job.first


@inner
def put_all(job):
    """The run goes on with the line of now; samples of a single one come behind those that wait."""
    at = job.at
    k, m = at.on, at.cells
    put_at(job.in_run[k], job.run_places, m, job.run)
    put_at(job.in_paid[k], job.paid_places, m, job.paid)
    if job.itself_places.shape[0] > 0:
        put_at(job.in_itself[k], job.itself_places, m, job.itself)
        job.itself[at.boxes_at] = boxes(m)
    put_at(job.in_run[k], job.run_places, m, job.even)
    put_at(job.in_odd[k], job.run_places, m, job.odd)


@inner
def change(job):
    """A node enters or leaves, after the outputs of the line as it was."""
    at, calls, counts, reel = job.at, job.calls, job.counts, reel_of(job)
    k, n = at.on, at.cells
    m = n + 1 if reel.true[n - reel.layer.shape[0]] > reel.numbers.longest else n - 1
    put(job.nodes[2 * k + counts.parity], n, m, job.node)
    call(calls.change, job.node)
    call(calls.carry, job.node)
    call(calls.fit, job.node)
    call(calls.book, job.node)
    call(calls.renew, job.node)
    at.on, at.cells, at.changes = 1 - k, m, at.changes + 1
    put_all(job)
    job.own.now = job.clock.now
    call(calls.before_forces, job.run)
    job.run[at.task] = ASSEMBLY
    call_solver(calls.solver, job.run)
    job.run[at.task] = RUN
    call(calls.stand_still, job.paid)
    call(calls.after_forces, job.run)
    call(calls.books, job.run)


@inner
def keep_reel(job, o):
    """What cells of the line lack waits in the room from a number on; returns how many numbers that are."""
    reel, n = reel_of(job), job.at.cells
    for c in range(n):
        job.room[o + c], job.room[o + n + c] = reel.lack[c], reel.rate[c]
        job.room[o + 2 * n + c], job.room[o + 3 * n + c] = reel.since[c], reel.span[c]
    return OF_REEL * n


@inner
def keep_rows(job):
    """The same of one of several lines, whose outputs wait where they are."""
    at, some = job.at, job.counts.samples - job.at.used
    if some > 0:
        row = job.waiting[at.waiting]
        row[OFFSET], row[COUNT], row[OF_CELLS] = at.used, some, at.cells
        at.placed += keep_reel(job, at.placed)
        at.used += some
        at.waiting += 1


@kernel
def ask_node(table):
    """Whether a node of one of several lines is to enter or leave, and may without Python, as a number."""
    job = read(table)
    at = job.at
    if reel_of(job).numbers.due == 0.0 or at_its_end(job.winch):
        return 0
    room = at.waiting < job.waiting.shape[0] and at.placed + OF_REEL * at.cells <= job.room.shape[0]
    return 1 if job.counts.samples == at.used or (at.may_wait != 0 and room) else 0


@kernel
def change_node(table):
    """A node of one of several lines enters or leaves, after outputs within the last step."""
    job = read(table)
    keep_rows(job)
    change(job)
    return 1


@kernel
def put_paid(table):
    """`put_all`."""
    put_all(read(table))
