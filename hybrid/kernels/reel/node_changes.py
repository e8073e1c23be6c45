"""One node more or less at a winch: what a change of cells (kernels.mesh.remesh) calls of a line that is paid out.

Places, nodes and cells count from the far end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.obstacles import stored_in_contact
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.mesh.cell_changes import begin_anew, clear
from hybrid.kernels.mesh.remesh import AFTER, BEFORE, RemeshPlaces, copy_cell, copy_node, move_line
from hybrid.kernels.reel.paid_length import cell, node, piece_at, prepare
from hybrid.kernels.reel.payout_nodes import CarryJob, move_row, place_reel
from hybrid.kernels.reel.reel import Reel
from hybrid.kernels.reel.winch import Winch, at_its_end
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import TOUCHES
from hybrid.kernels.state.state import Blocks, Ends, Floats, Line, Rows, Sea, State, Work, blanks


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
    push: Rows  # (N+1, 4) out of the plane; empty: none
    new_push: Rows
    next_push: Rows
    width: Floats  # (M,) m, diameters of the new cells; empty: nobody watches whether the line meets itself
    nearest: NDArray[np.int64]  # (2,) the pair of its cells that was nearest
    borne: Floats  # (P,) length over unstretched length that pieces bear, as of Reel.pieces
    widths: Floats  # (P,) m, their diameters
    start: Rows  # (M, 3) m, of all material nodes along the line: positions from which displacements count
    bounds: Blocks  # (4, EXTREMES, E) extremes at all nodes, along the line, those that are marked twice
    moment: Rows  # (M+1, 3) this and the next: work arrays
    strain: Rows
    energy: Floats  # (5,)
    numbers: Floats  # (NUMBERS,) of kernels.mesh.remesh
    scale: float  # N, tension scale


blank_node_job = blanks(NodeJob)
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
        join_column(books.extremes, job.bounds, i, at)
        at += 1
        if books.right[i] != i:
            join_column(books.extremes, job.bounds, books.right[i], at)
            at += 1


@kernel
def join_column(extremes, bounds, column, at):
    """Extremes of one column into those at a place."""
    for row in range(bounds.shape[1]):
        x, y = extremes[0, row, column], extremes[1, row, column]
        if np.isfinite(x) and x < bounds[0, row, at]:
            bounds[0, row, at], bounds[2, row, at] = x, extremes[2, row, column]
        if np.isfinite(y) and y > bounds[1, row, at]:
            bounds[1, row, at], bounds[3, row, at] = y, extremes[3, row, column]


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
    """Energy, J, before and after."""
    job = read_node(table)
    for k in range(2):  # one call for both: it is compiled once
        line, state = (job.carry.target, job.carry.out) if k else (job.carry.line, job.carry.state)
        found = energy_of(line, job.ends, state, job.moment, job.strain, job.energy)
        if line.bits & TOUCHES:
            found += stored_in_contact(line, job.sea, state.r)
        job.numbers[AFTER if k else BEFORE] = found


@kernel
def renew_run(table):
    """What a run knows beside the line and its state, as of the beginning; what it knew is kept where it must be."""
    job = read_node(table)
    line, target, clock, forward = job.carry.line, job.carry.target, job.carry.clock, job.carry.new.numbers.side > 0.0
    n, m = line.h.shape[0], target.h.shape[0]
    begin_anew(job, job.carry.out, line.s, target)
    renew_books(job, n, m, forward, min(n, m) - job.carry.new.layer.shape[0] + 1)
    clock.previous = clock.now


class LineJob(NamedTuple):
    """A line, and the same of another length (written), whose places are put into its reel."""

    line: Line
    whole: Line  # with all material nodes that there may be
    out: Line
    reel: Reel  # of `out`
    nodes: Floats  # (M,) m


blank_line_job = blanks(LineJob)
read_line = reader(blank_line_job())


@kernel
def make_line(table):
    """`line_as`, and its reel."""
    job = read_line(table)
    place_reel(job.reel, job.nodes, job.out.h.shape[0] - job.reel.layer.shape[0] + 1)
    line_as(job.line, job.whole, job.out, job.reel)


# --- the planner ----------------------------------------------------------------------------------

OF_REEL = 4  # numbers of a cell that are kept for outputs that wait: lack, rate, since, span


class NodePlanner(NamedTuple):
    """What says when a node enters or leaves, of one of the two sets of arrays."""

    at: RemeshPlaces
    reel: Reel  # with all its room
    winch: Winch
    room: Floats  # for what cells of lines of before lacked


blank_node_planner = blanks(NodePlanner)
read_planner = reader(blank_node_planner())


@kernel
def node_due(table):
    """Whether a node is to enter or leave, and may without Python, as a number."""
    job = read_planner(table)
    return 0 if job.reel.numbers.due == 0.0 or at_its_end(job.winch) else 1


@kernel
def plan_node(table):
    """How many cells there will be."""
    job = read_planner(table)
    reel, n = job.reel, job.at.cells
    return n + 1 if reel.true[n - reel.layer.shape[0]] > reel.numbers.longest else n - 1


@kernel
def keep_reel(table):
    """What cells of the line lack is kept for outputs that wait; how many numbers that are."""
    job = read_planner(table)
    reel, n, o = job.reel, job.at.cells, job.at.placed
    for c in range(n):
        job.room[o + c], job.room[o + n + c] = reel.lack[c], reel.rate[c]
        job.room[o + 2 * n + c], job.room[o + 3 * n + c] = reel.since[c], reel.span[c]
    return OF_REEL * n
