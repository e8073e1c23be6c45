"""Contact of lines with free bodies that have a shape: obstacles whose pose is an unknown of Newton's method.

Every line has the shape among its obstacles (kernels.laws.obstacles), carried by the body as one that moves.  What lines
do to it, W, goes into the six equations of the body.  In a correction x of the lines and z = (shift, turn) of the body,

    symbol  meaning                                                                     shape
    P       change of the force on a node by z                                          3 x 6
    Q       change of W by the places of a node and of its neighbours                   6 x 9
    R       change of W by z                                                            6 x 6

The forces of contact are objective: where a body and all nodes are shifted or turned together, they turn along.  P follows
from the derivatives by the nodes, then; what the damping of contact does in a turn is right but for the rate of the turn
over that of the steps, which touches Newton's way alone.

Lines are eliminated (matrix A, all but P and Q) with bodies where they are, and R is in the matrix of the bodies.  With
y = Q x the rest is of rank 12 for every body that is touched: corrections are those without P and Q, less the responses
to the columns of P times z and to unit forces on the bodies times y, and z and y solve a small dense system.  Its factors
and the responses serve all corrections of an iteration: those that contact of lines makes of one are many.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, get3, madd, mat_mat, mat_vec, mscale, msub, put, sub, vector
from hybrid.kernels.algebra.sparse_rows import factor_dense, substitute_dense
from hybrid.kernels.junctions.bodies import FRAME, LINES, PLACE, SOFTEST, SPRING, U, V, W, X, matrix
from hybrid.kernels.junctions.borders import (
    answer_right_sides,
    clear_right_side,
    eliminate_right_side,
    keep_corrections,
    push_node,
    put_corrections,
    read_network,
)
from hybrid.kernels.junctions.junctions import count_tensions, first_unknown
from hybrid.kernels.laws.obstacles import force_of_obstacle, put_matrix, transposed
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.report import (
    AXIS,
    BEGAN,
    ENDED,
    OFFSET,
    RADIUS,
    SIDE,
    SPEED,
    STILL_AXIS,
    STILL_SIDE,
    SWEEP,
    TURNED,
    TURNING,
)
from hybrid.kernels.state.report import PLACE as CENTRE
from hybrid.kernels.state.state import Blocks, Rows, blanks
from hybrid.kernels.step.line_step import AGAIN, BEFORE_MARCH, BLOCK, CARRY, CORRECTION, COUPLE, FORCE, HOLD, read

# Columns of a node that touches a body.
OF_LINE = 0
OF_NODE = 1
OF_SLOT = 2  # slot of the body
BY_BODY = 3  # P (3 x 6)
BY_NODES = 21  # Q (6 x 9)
TOUCHED = 75
# Responses of a body: to the columns of P, to unit forces on it.
EACH_BODY = 12
ORIGIN = (0.0, 0.0, 0.0)


class MeetingJob(NamedTuple):
    """Arguments of the entry: S bodies with shapes, in slots; M obstacles; T nodes of all lines."""

    network: NDArray[np.int64]  # as of kernels.junctions.borders.BorderJob
    carriers: NDArray[np.int64]  # (S,) the body of each slot
    slots: NDArray[np.int64]  # (B,) the slot of each body; -1: it has no shape
    found: NDArray[np.int64]  # (1 + S,) nodes that touch, and those that touch each body
    touched: Rows  # (T M, TOUCHED)
    own: Rows  # (S, 36) R
    wrench: Rows  # (S, 6) W
    kept: Rows  # (T, 5) corrections of lines without P and Q
    moved: Rows  # (B, 6) and of bodies
    responses: Blocks  # (12 S, T, 5) of lines
    turned: Blocks  # (12 S, B, 6) of bodies
    coupling: Rows  # (12 S + 5, 12 S + 1), as kernels.algebra.sparse_rows.factor_dense has it
    rank: int = 0


blank_meeting_job = blanks(MeetingJob)
read_meeting = reader(blank_meeting_job())


@inner
def carry_shape(sea, k, old, new, work):
    """Bring obstacle k of a line to where its body is at the end of the step."""
    c = add(vector(old, PLACE), vector(work, U))
    before, R = matrix(old, FRAME), matrix(new, FRAME)
    put(sea.carried[k], BEGAN, vector(old, PLACE))
    put(sea.carried[k], ENDED, c)
    put_matrix(sea.carried[k], SWEEP, mat_mat(R, transposed(before)))
    put(sea.carried[k], SPEED, vector(new, V))
    put(sea.carried[k], TURNING, mat_vec(R, vector(new, W)))
    put_matrix(sea.carried[k], TURNED, R)
    put(sea.obstacles[k], CENTRE, add(c, mat_vec(R, vector(sea.carried[k], OFFSET))))
    put(sea.obstacles[k], AXIS, mat_vec(R, vector(sea.carried[k], STILL_AXIS)))
    put(sea.obstacles[k], SIDE, mat_vec(R, vector(sea.carried[k], STILL_SIDE)))


@inner
def carry_shapes(network):
    """Bring all shapes to where their bodies are."""
    for l in range(network.tables.shape[0]):
        sea = read(network.tables[l]).sea
        for k in range(network.rides.shape[0]):
            b = network.rides[k]
            if b >= 0:
                carry_shape(sea, k, network.old[b], network.new[b], network.work[b])


@inner
def unit_of(c):
    """Shift and turn of a unit of c."""
    unit = (1.0 if c % 3 == 0 else 0.0, 1.0 if c % 3 == 1 else 0.0, 1.0 if c % 3 == 2 else 0.0)
    if c < 3:
        return unit, ORIGIN
    return ORIGIN, unit


@inner
def put_by_body(row, own, force, rho, e, c):
    """Column c of P into a row of `touched`, and of R into `own`; force: F, D, GL, GR; e: chords before, after."""
    F, D, L, R = force
    shift, turn = unit_of(c)
    moved = mat_vec(D, add(shift, cross(turn, rho)))
    moved = add(moved, add(mat_vec(L, cross(turn, e[0])), mat_vec(R, cross(turn, e[1]))))
    dF = sub(cross(turn, F), moved)
    dM = sub(cross(rho, dF), cross(shift, F))
    for j in range(3):
        row[BY_BODY + 6 * j + c] = dF[j]
        own[6 * j + c] -= dF[j]
        own[6 * (3 + j) + c] -= dM[j]


@inner
def put_by_nodes(row, force, rho):
    """Q into a row of `touched`."""
    F, D, L, R = force
    here = msub(madd(D, L), R)
    for n in range(3):
        A = mscale(-1.0, L) if n == 0 else here if n == 1 else R
        for j in range(3):
            shift, _ = unit_of(j)
            dF = mat_vec(A, shift)
            dM = cross(rho, dF)
            if n == 1:
                dM = add(dM, cross(shift, F))
            for i in range(3):
                row[BY_NODES + 9 * i + 3 * n + j] = -dF[i]
                row[BY_NODES + 9 * (3 + i) + 3 * n + j] = -dM[i]


@called
def press_node(network, job, l, i, cv):
    """Contact of node i of line l with bodies: its forces on them, and a row of `touched` for each that it touches."""
    line_job = read(network.tables[l])
    line, sea, e, n = line_job.line, line_job.sea, line_job.new.e, line_job.line.h.shape[0]
    x = add(get3(line_job.old.r, i), get3(line_job.work.u, i))
    for k in range(network.rides.shape[0]):
        b = network.rides[k]
        if b < 0:
            continue
        touches, F, D, L, R = force_of_obstacle(line, sea, k, i, x, line_job.work.u, line_job.new.v, e, cv)
        if not touches:
            continue
        slot, row = job.slots[b], job.touched[job.found[0]]
        job.found[0] += 1
        job.found[1 + slot] += 1
        row[OF_LINE], row[OF_NODE], row[OF_SLOT] = l, i, slot
        rho = sub(x, vector(sea.carried[k], ENDED))
        M = cross(rho, F)
        for j in range(3):
            job.wrench[slot, j] -= F[j]
            job.wrench[slot, 3 + j] -= M[j]
        before = get3(e, i - 1) if i > 0 else ORIGIN
        after = get3(e, i) if i < n else ORIGIN
        force = F, D, L, R
        for c in range(6):
            put_by_body(row, job.own[slot], force, rho, (before, after), c)
        put_by_nodes(row, force, rho)


@inner
def press_bodies(network, job, cv):
    """Forces of contact of all lines on bodies, with what they change by."""
    job.found[:] = 0
    job.own[:, :36] = 0.0
    job.wrench[: job.own.shape[0], :6] = 0.0
    for l in range(network.tables.shape[0]):
        for i in range(read(network.tables[l]).line.s.shape[0]):
            press_node(network, job, l, i, cv)
    for slot in range(job.own.shape[0]):
        for j in range(6):
            network.work[job.carriers[slot], LINES + j] += job.wrench[slot, j]


@inner
def first_of_bodies(network):
    """Where the unknowns of the bodies begin."""
    points = network.net.shape[0]
    return first_unknown(points, count_tensions(network.joints), points)


@inner
def stiffen(network, job):
    """R into the matrix of the bodies."""
    first = first_of_bodies(network)
    for slot in range(job.own.shape[0]):
        at = first + 6 * job.carriers[slot]
        for i in range(6):
            for j in range(6):
                network.A[at + i, at + j] += job.own[slot, 6 * i + j]


@inner
def hold_rolling(network):
    """Springs against turns as weak as SOFTEST of what contact holds of shifts, at the radius of the shape."""
    first, rows = first_of_bodies(network), read(network.tables[0]).sea.obstacles
    for k in range(network.rides.shape[0]):
        b = network.rides[k]
        if b < 0:
            continue
        stiffest, at = 0.0, first + 6 * b
        for j in range(3):
            stiffest = max(stiffest, abs(network.A[at + j, at + j]))
        spring = SOFTEST * stiffest * rows[k, RADIUS] ** 2
        if spring > network.work[b, SPRING]:
            for j in range(3):
                network.A[at + 3 + j, at + 3 + j] -= spring - network.work[b, SPRING]
            network.work[b, SPRING] = spring


@inner
def push_bodies(network, job):
    """W into the right-hand side of the bodies."""
    first, m = first_of_bodies(network), network.A.shape[1] - 1
    for slot in range(job.own.shape[0]):
        for j in range(6):
            network.A[first + 6 * job.carriers[slot] + j, m] -= job.wrench[slot, j]


@inner
def add_column(network, job, slot, c):
    """Column c of P of a body into the right-hand sides of the lines."""
    for t in range(job.found[0]):
        row, o = job.touched[t], BY_BODY + c
        if int(row[OF_SLOT]) == slot:
            push_node(network, int(row[OF_LINE]), int(row[OF_NODE]), (row[o], row[o + 6], row[o + 12]))


@called
def respond(network, job, slot, c):
    """Corrections of all lines and bodies to column c of P of a body, or from 6 on to a unit force or moment on it.

    False if they are not finite.
    """
    for l in range(network.tables.shape[0]):
        clear_right_side(network, l)
    if c < 6:
        add_column(network, job, slot, c)
        for l in range(network.tables.shape[0]):
            eliminate_right_side(network, l)
        return answer_right_sides(network, job.rank)
    at = 3 * network.net.shape[0] + 6 * job.carriers[slot] + c - 6
    network.right[at] = 1.0
    good = answer_right_sides(network, job.rank)
    network.right[at] = 0.0
    return good


@inner
def change_of_wrench(network, job, slot, out):
    """Q x of a body for the corrections of the lines, into out (6,)."""
    for j in range(6):
        out[j] = 0.0
    for t in range(job.found[0]):
        row = job.touched[t]
        if int(row[OF_SLOT]) != slot:
            continue
        line_job, i = read(network.tables[int(row[OF_LINE])]), int(row[OF_NODE])
        x, n = line_job.work.x, line_job.line.h.shape[0]
        for o in range(3):
            if 0 <= i - 1 + o <= n:
                for a in range(3):
                    for j in range(6):
                        out[j] += row[BY_NODES + 9 * j + 3 * o + a] * x[i - 1 + o, 1 + a]


@inner
def select(network, job, column):
    """z and y of the bodies that are touched in the corrections as they are, into a column of the coupling."""
    for slot in range(job.own.shape[0]):
        at = EACH_BODY * slot
        for j in range(6):
            job.coupling[at + j, column] += network.work[job.carriers[slot], X + j]
        change_of_wrench(network, job, slot, network.q)
        for j in range(6):
            job.coupling[at + 6 + j, column] += network.q[j]


@inner
def touches(job, r):
    """Whether response r is of a body that is touched."""
    return job.found[1 + r // EACH_BODY] > 0


@inner
def apply(network, job):
    """Couple corrections that were found without P and Q: less the responses times z and y."""
    last = job.coupling.shape[1] - 1
    for r in range(last):
        job.coupling[r, last] = 0.0
    select(network, job, last)
    substitute_dense(job.coupling, last)
    for r in range(last):
        if touches(job, r):
            put_corrections(network, 1.0, -job.coupling[r, last], job.responses[r], job.turned[r])


@inner
def couple(network, job):
    """Couple the corrections of lines and bodies that touch; 0: that fails."""
    last = job.coupling.shape[1] - 1
    if job.found[0] == 0:
        return 1.0
    keep_corrections(network, job.kept, job.moved)
    for r in range(last):
        for c in range(last):
            job.coupling[r, c] = 1.0 if r == c else 0.0
    for r in range(last):
        if not touches(job, r):
            continue
        if not respond(network, job, r // EACH_BODY, r % EACH_BODY):
            return 0.0
        keep_corrections(network, job.responses[r], job.turned[r])
        select(network, job, r)
    if not factor_dense(job.coupling, last):
        return 0.0
    put_corrections(network, 0.0, 1.0, job.kept, job.moved)
    apply(network, job)
    return 1.0


@kernel
def meet_bodies(table):
    """Answer for bodies that lines touch (kernels.junctions.borders); corrections that are no iteration have none."""
    job = read_meeting(table)
    network = read_network(job.network)
    question, couples = network.phase[0], network.asked.what != CORRECTION
    if question in (BEFORE_MARCH, CARRY):
        carry_shapes(network)
    elif question == FORCE:
        press_bodies(network, job, network.asked.scheme_cv)
    elif question == BLOCK:
        stiffen(network, job)
        push_bodies(network, job)
    elif question == HOLD:
        hold_rolling(network)
    elif question == COUPLE and couples:
        return couple(network, job)
    elif question == AGAIN and couples and job.found[0] > 0:
        apply(network, job)
    return 1.0
