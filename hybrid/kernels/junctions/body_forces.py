"""Forces of lines on free bodies that have a shape, and what they change by (kernels.junctions.body_contact has the symbols)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.algebra.rotations import add, cross, get3, madd, mat_mat, mat_vec, mscale, msub, sub, vector
from hybrid.kernels.junctions.bodies import (
    FRAME,
    LINES,
    NUMBERS,
    PLACE,
    SOFTEST,
    SPRING,
    STATE,
    WORK,
    U,
    V,
    W,
    matrix,
)
from hybrid.kernels.junctions.carried_frames import ANSWER, SEAT
from hybrid.kernels.junctions.joined_lines import COLUMNS, FUNCTIONAL
from hybrid.kernels.junctions.junctions import (
    HANDED,
    count_tensions,
    first_unknown,
)
from hybrid.kernels.laws.obstacle_motion import put_matrix, put_vector, row3, transposed
from hybrid.kernels.laws.obstacles import force_of_obstacle
from hybrid.kernels.machine.compile import called, inner
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.obstacle_rows import (
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
from hybrid.kernels.state.obstacle_rows import PLACE as CENTRE
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.job import read

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
    """Arguments of the entry: what kernels.run.network.solve_system works with, and room.

    S bodies with shapes, in slots; M obstacles; T nodes of all lines.
    """

    phase: NDArray[np.int64]  # (1,) what is asked
    tables: NDArray[np.int64]
    joints: NDArray[np.int64]
    seats: Floats
    arms: Floats
    gaps: Floats  # zeros: ends go nowhere by themselves
    first: NDArray[np.int64]
    columns: Floats
    functional: Floats
    parts: Floats
    answers: Floats
    net: Floats
    bodies: Floats
    old: Floats
    new: Floats
    work: Floats
    S: Floats
    G: Floats
    A: Floats
    q: Floats
    rides: NDArray[np.int64]  # (M,) the body that carries an obstacle; -1: none
    carriers: NDArray[np.int64]  # (S,) the body of each slot
    slots: NDArray[np.int64]  # (B,) the slot of each body; -1: it has no shape
    begins: NDArray[np.int64]  # (L,) where nodes of lines begin
    found: NDArray[np.int64]  # (1 + S,) nodes that touch, and those that touch each body
    touched: Floats  # (T M, TOUCHED)
    own: Floats  # (S, 36) R
    wrench: Floats  # (S, 6) W
    marks: NDArray[np.int64]  # (T,) nodes with a right-hand side
    kept: Floats  # (T, 5) corrections of lines without P and Q
    moved: Floats  # (B, 6) and of bodies
    responses: Floats  # (12 S, T, 5) of lines
    turned: Floats  # (12 S, B, 6) of bodies
    coupling: Floats  # (12 S, 12 S + 1)
    order: NDArray[np.int64]  # (12 S,) exchanges of its rows


def blank_meeting_job() -> MeetingJob:
    """A job with the types that every one has."""
    z, whole, one = np.zeros, np.int64, np.zeros(1, np.int64)
    return MeetingJob(
        one, z((1, 1), whole), z((1, 2), whole), z((1, 2, SEAT)), z((1, 2, 3)), z((1, 2, 3)), one, z((3, 1, SIZE)),
        z(FUNCTIONAL), z((COLUMNS, 1, SIZE)), z((2, ANSWER)), z((1, 3)), z((1, NUMBERS)), z((1, STATE)), z((1, STATE)), z((1, WORK)),
        z((HANDED - 1, HANDED)), z((2, 6, 6)), z((6, 2)), z(COLUMNS), one, one, one, one, one, z((1, TOUCHED)),
        z((1, 36)), z((1, 6)), one, z((2, SIZE)), z((1, 6)), z((EACH_BODY, 2, SIZE)), z((EACH_BODY, 1, 6)), z((EACH_BODY, EACH_BODY + 1)),
        one,
    )  # fmt: skip


read_meeting = reader(blank_meeting_job())


@inner
def carry_shape(sea, k, old, new, work):
    """Bring obstacle k of a line to where its body is at the end of the step."""
    c = add(vector(old, PLACE), vector(work, U))
    before, R = matrix(old, FRAME), matrix(new, FRAME)
    put_vector(sea.carried, k, BEGAN, vector(old, PLACE))
    put_vector(sea.carried, k, ENDED, c)
    put_matrix(sea.carried, k, SWEEP, mat_mat(R, transposed(before)))
    put_vector(sea.carried, k, SPEED, vector(new, V))
    put_vector(sea.carried, k, TURNING, mat_vec(R, vector(new, W)))
    put_matrix(sea.carried, k, TURNED, R)
    put_vector(sea.obstacles, k, CENTRE, add(c, mat_vec(R, row3(sea.carried, k, OFFSET))))
    put_vector(sea.obstacles, k, AXIS, mat_vec(R, row3(sea.carried, k, STILL_AXIS)))
    put_vector(sea.obstacles, k, SIDE, mat_vec(R, row3(sea.carried, k, STILL_SIDE)))


@inner
def carry_shapes(job):
    """Bring all shapes to where their bodies are."""
    for l in range(job.tables.shape[0]):
        sea = read(job.tables[l]).sea
        for k in range(job.rides.shape[0]):
            b = job.rides[k]
            if b >= 0:
                carry_shape(sea, k, job.old[b], job.new[b], job.work[b])


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
def press_node(job, l, i, cv):
    """Contact of node i of line l with bodies: its forces on them, and a row of `touched` for each that it touches."""
    line_job = read(job.tables[l])
    line, sea, e, n = line_job.line, line_job.sea, line_job.new.e, line_job.line.h.shape[0]
    x = add(get3(line_job.old.r, i), get3(line_job.work.u, i))
    for k in range(job.rides.shape[0]):
        b = job.rides[k]
        if b < 0:
            continue
        touches, F, D, L, R = force_of_obstacle(line, sea, k, i, x, line_job.work.u, line_job.new.v, e, cv)
        if not touches:
            continue
        slot, row = job.slots[b], job.touched[job.found[0]]
        job.found[0] += 1
        job.found[1 + slot] += 1
        row[OF_LINE], row[OF_NODE], row[OF_SLOT] = l, i, slot
        rho = sub(x, row3(sea.carried, k, ENDED))
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
def press_bodies(job, cv):
    """Forces of contact of all lines on bodies, with what they change by."""
    for j in range(job.found.shape[0]):
        job.found[j] = 0
    for slot in range(job.own.shape[0]):
        for j in range(36):
            job.own[slot, j] = 0.0
        for j in range(6):
            job.wrench[slot, j] = 0.0
    for l in range(job.tables.shape[0]):
        for i in range(read(job.tables[l]).line.s.shape[0]):
            press_node(job, l, i, cv)
    for slot in range(job.own.shape[0]):
        for j in range(6):
            job.work[job.carriers[slot], LINES + j] += job.wrench[slot, j]


@inner
def first_of_bodies(job):
    """Where the unknowns of the bodies begin."""
    points = job.net.shape[0]
    return first_unknown(points, count_tensions(job.joints), points)


@inner
def stiffen(job):
    """R into the matrix of the bodies."""
    first = first_of_bodies(job)
    for slot in range(job.own.shape[0]):
        at = first + 6 * job.carriers[slot]
        for i in range(6):
            for j in range(6):
                job.A[at + i, at + j] += job.own[slot, 6 * i + j]


@inner
def hold_rolling(job):
    """Springs against turns as weak as SOFTEST of what contact holds of shifts, at the radius of the shape."""
    first, rows = first_of_bodies(job), read(job.tables[0]).sea.obstacles
    for k in range(job.rides.shape[0]):
        b = job.rides[k]
        if b < 0:
            continue
        stiffest, at = 0.0, first + 6 * b
        for j in range(3):
            stiffest = max(stiffest, abs(job.A[at + j, at + j]))
        spring = SOFTEST * stiffest * rows[k, RADIUS] ** 2
        if spring > job.work[b, SPRING]:
            for j in range(3):
                job.A[at + 3 + j, at + 3 + j] -= spring - job.work[b, SPRING]
            job.work[b, SPRING] = spring


@inner
def push_bodies(job):
    """W into the right-hand side of the bodies."""
    first, m = first_of_bodies(job), job.A.shape[1] - 1
    for slot in range(job.own.shape[0]):
        for j in range(6):
            job.A[first + 6 * job.carriers[slot] + j, m] -= job.wrench[slot, j]
