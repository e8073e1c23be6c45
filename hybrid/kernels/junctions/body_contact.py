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
kernels.run.network and kernels.junctions.lines_contact call `meet_bodies` by its address, so that systems without such bodies
compile none of it.
"""

from __future__ import annotations

from hybrid.kernels.algebra.block_elimination import ROW, SIZE, SPAN
from hybrid.kernels.algebra.kept_factors import carry_given
from hybrid.kernels.junctions.bodies import X
from hybrid.kernels.junctions.body_forces import (
    BY_BODY,
    BY_NODES,
    EACH_BODY,
    OF_LINE,
    OF_NODE,
    OF_SLOT,
    carry_shapes,
    first_of_bodies,
    hold_rolling,
    press_bodies,
    push_bodies,
    read_meeting,
    stiffen,
)
from hybrid.kernels.junctions.joined_lines import last_block, substitute_dense
from hybrid.kernels.junctions.junctions import END, START, correct_all, gather_right_sides
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.step.job import read

# What is asked: shapes are brought to where their bodies are; forces of contact are found; these and R are put into the
# equations of the bodies; corrections of lines and bodies are coupled; turns that contact does not hold get a spring; of other
# corrections of the same iteration: R is put into the equations, and they are coupled.
CARRY, PRESS, STIFFEN, COUPLE, HOLD, AGAIN = range(6)


@inner
def is_fixed(ends, i, n):
    """Whether a node is an end that is held."""
    end = 0 if i == 0 else 1
    return (i == 0 or i == n) and ends.held[end] != 0 and ends.held[end] != JOINED


@inner
def clear_right_side(job, l):
    """No right-hand side in the eliminated line l."""
    line_job, n = read(job.tables[l]), read(job.tables[l]).line.h.shape[0]
    X_, x, o = line_job.work.X, line_job.work.x, job.begins[l]
    if job.joints[l, START] >= 0:
        for a in range(3):
            line_job.work.rows[0, (a + 1) * 24 + 23] = 0.0
    for i in range(n + 1):
        job.marks[o + i] = 0
        for j in range(SIZE):
            x[i, j] = 0.0
            X_[i * ROW + j * SPAN + SPAN - 1] = 0.0
    if job.joints[l, END] >= 0:
        at = last_block(X_, n)
        for j in range(SIZE):
            X_[at + 64 + j] = 0.0


@inner
def add_column(job, slot, c):
    """Column c of P of a body into the right-hand sides of the lines."""
    for t in range(job.found[0]):
        row = job.touched[t]
        if int(row[OF_SLOT]) != slot:
            continue
        l, i = int(row[OF_LINE]), int(row[OF_NODE])
        line_job = read(job.tables[l])
        if i == 0 and job.joints[l, START] >= 0:  # the march has replaced its balance by its place
            for a in range(3):
                line_job.work.rows[0, (a + 1) * 24 + 23] += row[BY_BODY + 6 * a + c]
        elif not is_fixed(line_job.ends, i, line_job.line.h.shape[0]):
            job.marks[job.begins[l] + i] = 1
            for a in range(3):
                line_job.work.x[i, 1 + a] += row[BY_BODY + 6 * a + c]


@inner
def eliminate_right_side(job, l):
    """Carry the right-hand side of line l through its kept factors."""
    line_job, n = read(job.tables[l]), read(job.tables[l]).line.h.shape[0]
    X_, x, o, joined = line_job.work.X, line_job.work.x, job.begins[l], job.joints[l, END] >= 0
    begin = n + 1
    for i in range(n, -1, -1):
        if job.marks[o + i] != 0:
            begin = i
    if begin > n:
        return
    carry_given(X_, line_job.work.W, job.marks[o:], x, joined, begin)
    for i in range(begin, n + 1):
        for k in range(SIZE):
            X_[i * ROW + k * SPAN + SPAN - 1] = x[i, k]
    if joined:
        at = last_block(X_, n)
        for k in range(SIZE):
            X_[at + 64 + k] = x[n, k]


@called
def respond(job, slot, c):
    """Corrections of all lines and bodies to column c of P of a body, or from 6 on to a unit force or moment on it.

    False if they are not finite.
    """
    m = job.A.shape[1] - 1
    for l in range(job.tables.shape[0]):
        clear_right_side(job, l)
    if c < 6:
        add_column(job, slot, c)
        for l in range(job.tables.shape[0]):
            eliminate_right_side(job, l)
    gather_right_sides(job, m)
    if c >= 6:
        job.A[first_of_bodies(job) + 6 * job.carriers[slot] + c - 6, m] += 1.0
    substitute_dense(job.A, m)
    return correct_all(job, job.net.shape[0], m) < 0


@inner
def change_of_wrench(job, slot, out):
    """Q x of a body for the corrections of the lines, into out (6,)."""
    for j in range(6):
        out[j] = 0.0
    for t in range(job.found[0]):
        row = job.touched[t]
        if int(row[OF_SLOT]) != slot:
            continue
        line_job, i = read(job.tables[int(row[OF_LINE])]), int(row[OF_NODE])
        x, n = line_job.work.x, line_job.line.h.shape[0]
        for o in range(3):
            if 0 <= i - 1 + o <= n:
                for a in range(3):
                    for j in range(6):
                        out[j] += row[BY_NODES + 9 * j + 3 * o + a] * x[i - 1 + o, 1 + a]


@inner
def select(job, column):
    """z and y of the bodies that are touched in the corrections as they are, into a column of the coupling."""
    for slot in range(job.own.shape[0]):
        at = EACH_BODY * slot
        for j in range(6):
            job.coupling[at + j, column] += job.work[job.carriers[slot], X + j]
        change_of_wrench(job, slot, job.q)
        for j in range(6):
            job.coupling[at + 6 + j, column] += job.q[j]


@inner
def keep_corrections(job, kept, moved):
    """Corrections of lines and bodies into kept (T, 5), moved (B, 6)."""
    for l in range(job.tables.shape[0]):
        x, o = read(job.tables[l]).work.x, job.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                kept[o + i, j] = x[i, j]
    for b in range(job.work.shape[0]):
        for j in range(6):
            moved[b, j] = job.work[b, X + j]


@inner
def put_corrections(job, kept, moved):
    """The same back."""
    for l in range(job.tables.shape[0]):
        x, o = read(job.tables[l]).work.x, job.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                x[i, j] = kept[o + i, j]
    for b in range(job.work.shape[0]):
        for j in range(6):
            job.work[b, X + j] = moved[b, j]


@inner
def add_corrections(job, part, kept, moved):
    """A part of kept corrections to those of lines and bodies."""
    for l in range(job.tables.shape[0]):
        x, o = read(job.tables[l]).work.x, job.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                x[i, j] += part * kept[o + i, j]
    for b in range(job.work.shape[0]):
        for j in range(6):
            job.work[b, X + j] += part * moved[b, j]


@inner
def touches(job, r):
    """Whether response r is of a body that is touched."""
    return job.found[1 + r // EACH_BODY] > 0


@inner
def apply(job):
    """Couple corrections that were found without P and Q: less the responses times z and y."""
    last = job.coupling.shape[0]
    for r in range(last):
        job.coupling[r, last] = 0.0
    select(job, last)
    substitute_small(job.coupling, job.order)
    for r in range(last):
        if touches(job, r):
            add_corrections(job, -job.coupling[r, last], job.responses[r], job.turned[r])


@inner
def couple(job):
    """Couple the corrections of lines and bodies that touch; 0: that fails, 1: nothing touches, 2: done."""
    last = job.coupling.shape[0]
    if job.found[0] == 0:
        return 1
    keep_corrections(job, job.kept, job.moved)
    for r in range(last):
        for c in range(last):
            job.coupling[r, c] = 1.0 if r == c else 0.0
    for r in range(last):
        if not touches(job, r):
            continue
        if not respond(job, r // EACH_BODY, r % EACH_BODY):
            return 0
        keep_corrections(job, job.responses[r], job.turned[r])
        select(job, r)
    if not factor_small(job.coupling, job.order):
        return 0
    put_corrections(job, job.kept, job.moved)
    apply(job)
    return 2


@inner
def factor_small(A, order):
    """Factor a dense system (n, n + 1) with row exchanges, which are kept in order (n,); False: it is singular."""
    n = A.shape[0]
    for c in range(n):
        where = c
        for r in range(c + 1, n):
            if abs(A[r, c]) > abs(A[where, c]):
                where = r
        if not abs(A[where, c]) > 0.0:
            return False
        order[c] = where
        if where != c:
            for j in range(n):
                A[c, j], A[where, j] = A[where, j], A[c, j]
        for r in range(c + 1, n):
            A[r, c] /= A[c, c]
            if A[r, c] != 0.0:
                for j in range(c + 1, n):
                    A[r, j] -= A[r, c] * A[c, j]
    return True


@inner
def substitute_small(A, order):
    """Solve a system that `factor_small` has factored for its last column, which becomes the solution."""
    n = A.shape[0]
    for c in range(n):
        if order[c] != c:
            A[c, n], A[order[c], n] = A[order[c], n], A[c, n]
    for c in range(n):
        for r in range(c + 1, n):
            A[r, n] -= A[r, c] * A[c, n]
    for c in range(n - 1, -1, -1):
        for j in range(c + 1, n):
            A[c, n] -= A[c, j] * A[j, n]
        A[c, n] /= A[c, c]


@kernel
def meet_bodies(table):
    """Do what is asked of lines that touch bodies (CARRY, PRESS, STIFFEN, COUPLE, HOLD, AGAIN); 0: it fails."""
    job = read_meeting(table)
    task, phase = read(job.tables[0]).task, job.phase[0]
    if phase == CARRY:
        carry_shapes(job)
    elif phase == PRESS:
        press_bodies(job, task.cv)
    elif phase == STIFFEN:
        stiffen(job)
        push_bodies(job)
    elif phase == HOLD:
        hold_rolling(job)
    elif phase == AGAIN:
        if job.found[0] > 0:
            apply(job)
    else:
        return couple(job)
    return 1
