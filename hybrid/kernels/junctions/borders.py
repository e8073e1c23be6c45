"""What kernels of several lines get, and what couples lines beside their bands: borders.

They get the lines, points and bodies of a network, and the task that is asked.  Among bodies and sheaves that other
lines move some lines are solved by themselves.  What moves freely has come to its place before such a line is solved,
and the line is in its way at most: one that comes to touch it is solved with the others, and so is one that is near it
at the beginning of a step.  A line that touches nothing of it is solved by itself as without it.

All borders are asked the same few questions in one order.
Every line is eliminated along s (kernels.march).  What couples it with others is a border of these equations: unknowns y
with columns (what they do to lines, points and bodies), a functional (what these do to its own equations), a small
block (what y does to them) and an update.  Of corrections x that are found without it, with z how all that is before it
answers to its columns, q its functional, d its block and r what its equations leave over,

    y = -(d + q z)^-1 (r + q x),    x becomes x + z y.

Borders that a network does not have are not in its list: it has neither their arrays nor their code, and asks nothing.
The list, and why it has that order, is in solve.line_jobs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import ROW, SIZE, SPAN
from hybrid.kernels.algebra.kept_factors import carry_given
from hybrid.kernels.algebra.rotations import get3
from hybrid.kernels.junctions.bodies import X
from hybrid.kernels.junctions.joined_lines import last_block
from hybrid.kernels.laws.surfaces import is_far, surface
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import NamedNumbers, caller, reader
from hybrid.kernels.march.assembly import JOINED as AT_JUNCTION
from hybrid.kernels.state.report import FREE, MEETS_FROM, MEETS_TO, ONSET_OF, PLACE, RADIUS, STRAND
from hybrid.kernels.state.state import Blocks, Floats, NumberRows, Rows, blanks
from hybrid.kernels.step.line_step import AGAIN, Limits, Task, read

# --- what kernels of several lines get ---------------------------------------------------------

NONE, HELD = -1, -2  # of `joints`


class NetworkJob(NamedTuple):
    """Arguments of the entries: the lines, points and bodies of a network, and room.

    P points, B bodies, L lines; m tensions of last cells and coordinates of points and bodies.
    """

    asked: NetworkTask
    tables: NumberRows  # (L, ..) jobs of the lines (kernels.run.network_run), their task ASSEMBLY or ITERATION
    numbers: Rows  # the same memory
    # (L, 2) points, then bodies, that start and end are joined to, -1: none; HELD: an end that is held where the start is
    # joined, whose last block is left unsolved: a straight line that does not stretch has no tension of its own
    joints: NumberRows
    fairleads: Blocks  # (L, 2, 3) m of ends at bodies, in their axes
    seats: Blocks  # (L, 2, SEAT) frames of ends that turn with bodies (kernels.junctions.joined_lines)
    arms: Blocks  # (L, 2, 3) m, worked in
    gaps: Blocks  # (L, 2, 3) m that ends at bodies have still to go; given for a CORRECTION, else worked in
    floors: Floats  # (L,) N, tension at or below which a catenary cell is slack
    allowed: Floats  # (L,) m, error that a step may make
    first: NDArray[np.int64]  # (L,) where columns of a line begin that carries some
    columns: Blocks  # (3, .., 5), or (COLUMNS, .., 5) where an end turns
    functional: Floats  # (FUNCTIONAL,) worked in, as what follows
    parts: Blocks  # as columns: what right-hand sides count in forces and moments on the start, moments on the end
    answers: Rows  # (2, ANSWER)
    q: Floats  # (COLUMNS,)
    net: Rows  # (P, 3) on return what does not balance at the points, N
    bodies: Rows  # (B, NUMBERS ..) what bodies are (kernels.junctions.bodies)
    old: Rows  # (B, STATE) of bodies
    new: Rows  # (B, STATE)
    work: Rows  # (B, WORK)
    S: Rows  # (HANDED - 1, HANDED)
    G: Blocks  # (2, 6, 6)
    A: Rows  # (m+5, m+1)
    right: Floats  # (3 P + 6 B,) right-hand side of points and bodies themselves, of other corrections of an iteration
    still: Blocks  # (L, 2, 3) zeros: gaps of those
    moves: Floats  # (3,) of corrections, as kernels.junctions.borders has it
    begins: NDArray[np.int64]  # (L,) where nodes of lines begin among those of all
    marks: NDArray[np.int64]  # (T,) nodes with another right-hand side
    rides: NDArray[np.int64]  # (M,) the body that carries an obstacle, -1: none does; empty: no body has a shape
    phase: NDArray[np.int64]  # (1,) what is asked of borders (kernels.junctions.borders)
    near: NDArray[np.int64]  # (L,) of all lines, how near they are to what is free (kernels.junctions.borders)
    alone: NDArray[np.int64]  # (L,) and whether they are solved by themselves
    borders: NDArray[np.int64]  # (K,) addresses of their kernels, in their order
    border_tables: NumberRows  # (K, ..) and their tables
    solver: int = 0  # address of the kernel that marches a line


class NetworkTask(NamedNumbers):
    """The task (kernels.step.line_step.Task), the time of the new states, s, and the part of a correction that is made."""

    what: float
    dt: float
    before: float
    rho_of_step: float
    cv: float
    ca: float
    reach: float
    scale: float
    most: float
    rho_of_last: float
    fixed: float
    time: float
    part: float
    cut: float  # whether a step is taken as the last iteration has left it, converged or not
    tolerance: float
    scheme_cv: float  # of the scheme of the step that is solved, or as cv, ca
    scheme_ca: float


blank_network_job = blanks(NetworkJob)
read_network = reader(blank_network_job())


@inner
def task_of(asked):
    """The task that is asked."""
    limits = Limits(asked.reach, asked.scale, int(asked.most), asked.tolerance)
    what, is_cut, is_fixed = int(asked.what), asked.cut != 0.0, asked.fixed != 0.0
    before, rho, last = asked.before, asked.rho_of_step, asked.rho_of_last
    return Task(what, asked.dt, before, rho, asked.cv, asked.ca, False, limits, is_cut, last, is_fixed)


# Of the radius of a line: how far from a body or sheave that is free it is near it.  A step goes a fraction of that where
# a line comes to rest on something; if it touches before it is near, the try of the step is made again.
NEARBY = 1.0
# Of `near`: the line cannot reach what is free, and is always solved by itself.
APART_ALWAYS = -2
# It always moves with others.
JOINED = -1
# Nothing that is free is near it.
APART = 0
# Something is.
NEAR = 1
# It touches that.
TOUCHES = 2


@inner
def is_free(job, rides, k):
    """Whether obstacle k moves by what lines do to it."""
    if job.line.moved[k] == FREE:
        return True
    return rides.shape[0] > 0 and rides[k] >= 0


@inner
def copy_obstacle(there, here, k):
    """Obstacle k in the sea of a line is where it is in that of another one."""
    for j in range(there.carried.shape[1]):
        if j != MEETS_FROM and j != MEETS_TO:  # which are of the line
            here.carried[k, j] = there.carried[k, j]
    for j in range(PLACE, RADIUS):
        here.obstacles[k, j] = there.obstacles[k, j]


@kernel
def lead_lone(table):
    """Bring what is free to where it has come among the obstacles of lines that are solved by themselves."""
    network = read_network(table)
    first = -1
    for l in range(network.tables.shape[0]):
        if first < 0 and network.alone[l] == 0:
            first = l
    if first < 0:
        return 0
    source = read(network.tables[first])
    for l in range(network.tables.shape[0]):
        if network.alone[l] != 0:
            job = read(network.tables[l])
            for k in range(job.line.moved.shape[0]):
                if is_free(job, network.rides, k):
                    copy_obstacle(source.sea, job.sea, k)
            for k in range(job.new.sheave.shape[0]):
                for j in range(job.new.sheave.shape[1]):
                    job.new.sheave[k, j] = source.new.sheave[k, j]
    return 1


@inner
def nearness(job, rides):
    """How near a line is to what is free, in the state that its steps lead from."""
    found, rows, r = APART, job.sea.obstacles, job.old.r
    for k in range(job.line.moved.shape[0]):
        if is_free(job, rides, k):
            for i in range(r.shape[0]):
                onset = 0.5 * rows[k, ONSET_OF]
                if is_far(job.sea, k, get3(r, i), onset + NEARBY * rows[k, STRAND]):
                    continue
                gap, _, _ = surface(job.sea, k, get3(r, i))
                gap -= onset
                if not gap > 0.0:
                    return TOUCHES
                if gap < NEARBY * rows[k, STRAND]:
                    found = NEAR
    return found


@kernel
def find_near(table):
    """Find how near lines are to what is free, where steps with this table lead from; returns 0."""
    network = read_network(table)
    for l in range(network.tables.shape[0]):
        if network.near[l] >= APART:
            network.near[l] = nearness(read(network.tables[l]), network.rides)
    return 0


@inner
def is_touched_alone(network):
    """Whether a line that was solved by itself touches what is free."""
    touched = False
    for l in range(network.near.shape[0]):
        touched |= network.alone[l] != 0 and network.near[l] == TOUCHES
    return touched


@inner
def is_grouped_otherwise(network):
    """Whether the next step is to be solved with other lines by themselves: those near nothing that is free.

    Where nothing is near any, what is free moves with the first line that can reach it.
    """
    leads = True
    for l in range(network.near.shape[0]):
        leads &= network.near[l] == APART or network.near[l] == APART_ALWAYS
    for l in range(network.near.shape[0]):
        alone = network.near[l] == APART_ALWAYS
        if network.near[l] == APART:
            alone, leads = not leads, False
        if alone != (network.alone[l] != 0):
            return True
    return False


# --- borders -----------------------------------------------------------------------------------

START, END = 0, 1
# Places in `moves`.
FAR = 0  # m, largest shift of unknowns
TURNED = 1  # rad, largest turn
STRENGTH = 2  # of the springs of HOLD, 1 at first

call_border = caller(0.0)


class BorderJob(NamedTuple):
    """Arguments of a border that needs nothing of its own."""

    network: NDArray[np.int64]  # table of the kernels.junctions.borders.NetworkJob that has it
    rank: int = 0  # how many borders are before it


blank_border_job = blanks(BorderJob)
read_border = reader(blank_border_job())


@inner
def ask(network, question):
    """Put a question to all borders, in their order; the least of their answers: the first that is not above 0."""
    answer = 1.0
    for k in range(network.borders.shape[0]):
        network.phase[0] = question
        answer = min(answer, call_border(network.borders[k], network.border_tables[k]))
        if not answer > 0.0:
            break
    return answer


@inner
def answer_right_sides(network, count):
    """Corrections of all by the first borders, so many, to the right-hand sides of lines, and `network.right` of points.

    False: they are not finite.
    """
    for k in range(count):
        network.phase[0] = AGAIN
        if not call_border(network.borders[k], network.border_tables[k]) > 0.0:
            return False
    return True


@inner
def is_fixed(ends, i, n):
    """Whether a node is an end that is held."""
    end = 0 if i == 0 else 1
    return (i == 0 or i == n) and ends.held[end] != 0 and ends.held[end] != AT_JUNCTION


@inner
def clear_right_side(network, l):
    """No right-hand side in the eliminated line l."""
    line_job, n = read(network.tables[l]), read(network.tables[l]).line.h.shape[0]
    X_, x, o = line_job.work.X, line_job.work.x, network.begins[l]
    if network.joints[l, START] >= 0:
        for a in range(3):
            line_job.work.rows[0, (a + 1) * 24 + 23] = 0.0
    for i in range(n + 1):
        network.marks[o + i] = 0
        for j in range(SIZE):
            x[i, j] = 0.0
            X_[i * ROW + j * SPAN + SPAN - 1] = 0.0
    if network.joints[l, END] != NONE:
        at = last_block(X_, n)
        for j in range(SIZE):
            X_[at + 64 + j] = 0.0


@inner
def push_node(network, l, i, force):
    """Add a force on node i to the right-hand side of line l."""
    line_job = read(network.tables[l])
    if i == 0 and network.joints[l, START] >= 0:  # the march has replaced its balance by its place
        for a in range(3):
            line_job.work.rows[0, (a + 1) * 24 + 23] += force[a]
    elif not is_fixed(line_job.ends, i, line_job.line.h.shape[0]):
        network.marks[network.begins[l] + i] = 1
        for a in range(3):
            line_job.work.x[i, 1 + a] += force[a]


@inner
def eliminate_right_side(network, l):
    """Carry the right-hand side of line l through its kept factors."""
    line_job, n = read(network.tables[l]), read(network.tables[l]).line.h.shape[0]
    o, joined, begin = network.begins[l], network.joints[l, END] != NONE, n + 1
    for i in range(n, -1, -1):
        if network.marks[o + i] != 0:
            begin = i
    if begin > n:
        return
    carry_given(line_job.work.X, line_job.work.W, network.marks[o:], line_job.work.x, joined, begin)
    hand_on(line_job.work, joined, begin)


@inner
def hand_on(work, joined, begin):
    """A right-hand side that is carried from block `begin` on stands where the substitution finds it."""
    n = work.x.shape[0] - 1
    for i in range(begin, n + 1):
        for k in range(SIZE):
            work.X[i * ROW + k * SPAN + SPAN - 1] = work.x[i, k]
    if joined:
        at = last_block(work.X, n)
        for k in range(SIZE):
            work.X[at + 64 + k] = work.x[n, k]


@inner
def keep_corrections(network, kept, moved):
    """Corrections of lines and bodies into kept (T, 5), moved (B, 6)."""
    for l in range(network.tables.shape[0]):
        x, o = read(network.tables[l]).work.x, network.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                kept[o + i, j] = x[i, j]
    for b in range(network.work.shape[0]):
        for j in range(6):
            moved[b, j] = network.work[b, X + j]


@inner
def put_corrections(network, own, part, kept, moved):
    """Corrections of lines and bodies become a part `own` of what they are and a part of what is kept."""
    for l in range(network.tables.shape[0]):
        x, o = read(network.tables[l]).work.x, network.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                x[i, j] = own * x[i, j] + part * kept[o + i, j]
    for b in range(network.work.shape[0]):
        for j in range(6):
            network.work[b, X + j] = own * network.work[b, X + j] + part * moved[b, j]
