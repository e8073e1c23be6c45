"""One line of a network, as its ends feel it.

Ends of rods whose frame turns with a point or body: how the moment there changes (docs/theory.md, 18).

The element at such an end lies between the cell and a frame  R = R_joint R_seat.  With M of kernels.laws.element,

    dM = A de + a dpsi + G dtheta,

e and psi of the cell, theta (inertial) of the point or body; A and a are those of kernels.march.assembly, and

    at the start   G = -C - [M]x - C_d (W - [w_cell - w_frame]x),       at the end   G = C + C_d W,

with W the change of the frame's angular velocity,  W = cv R' J_l(n)^-1 R^T - [w_frame]x.  Where tension makes a torque
(kernels.laws.tension_torque), the moment changes by  g q dT  with the tension of the cell as well, and the law of
length of the cell by  g q . (1 + tau W) dtheta,  at the start with a minus sign.

The eliminated line is a linear relation between its two ends.  The march leaves of a line
(kernels.algebra.block_elimination) a relation  x_i = b_i - A_i x_{i+1} - C_i dr_{i+2}  and, of an end that is joined to
a point, the last block not yet solved: four rows, the length of the last cell and the balance of the last node, for the
tension of that cell and the point.  Where the start is joined as well, its shift is an unknown, and where a rod is
clamped to what turns, so is that turn:  with q = (shift of the start, turn there, turn at the end),

    x_i = b_i - A_i x_{i+1} - C_i dr_{i+2} + D_i q,

the D_i from the same factors (`carry_start`, `carry_turn`), and what the start bears, its balance, which the march has
replaced by its place, and its moment, is carried to the other end as a linear functional of what follows
(`carry_functional`).
"""

from __future__ import annotations

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE, SPAN
from hybrid.kernels.algebra.kept_factors import carry_block
from hybrid.kernels.algebra.rotations import (
    add,
    dot,
    frame,
    get3,
    get9,
    hat,
    inverse_left_jacobian,
    jacobian_functions,
    madd,
    mat_mat,
    mat_matT,
    mat_vec,
    mscale,
    msub,
    scale,
    sub,
    vec_mat,
    vector,
)
from hybrid.kernels.junctions.bodies import FRAME, START, N, W, matrix
from hybrid.kernels.laws.bending_law import bending_at, damped_bending_at
from hybrid.kernels.laws.element import after, angular_velocity, before, chord, turning
from hybrid.kernels.laws.tension_torque import couples, rest_strain
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.state.report import STIFFNESS_DAMPING

# Numbers of an end.
BY_TURN = 0  # 9, G
BY_CHORD = 9  # 9, A
BY_SPIN = 18  # 3, a
MOMENT = 21  # 3, M, N m
FORCE_BY_TURN = 24  # 9, [d]x G/l, into the balance of nodes
SPIN_BY_TURN = 33  # 3, d.G, into the balance of the spin
BY_TENSION = 36  # 3, of the moment, where tension makes a torque,
LENGTH_BY_TURN = 39  # 3, and of the length of the cell
ANSWER = 42
# Numbers of a seat: frame of the end in axes of its point or body, and whether it turns with that: 0, or one of these.
TURNS, SEAT = 9, 10
WITH_BODY, WITH_POINT = 1.0, 2.0


@inner
def turns(seats, l, k):
    """Whether the frame of end k of line l is carried."""
    return seats[l, k, TURNS] != 0.0


@inner
def place_frame(ends, k, seat, row):
    """Frame and angular velocity of an end from its seat and the state (a row of kernels.junctions.bodies) of what carries it."""
    R = matrix(row, FRAME)
    F, w = mat_mat(R, matrix(seat, 0)), mat_vec(R, vector(row, W))
    for i in range(9):
        ends.frame[k, i] = F[i]
    for i in range(3):
        ends.spin[k, i] = w[i]


@inner
def spin_change(row, work, cv):
    """W: change of the angular velocity (inertial) of a body by a turn."""
    n, R = vector(work, N), matrix(row, FRAME)
    g, _ = jacobian_functions(dot(n, n))
    way = mat_mat(R, mat_matT(inverse_left_jacobian(n, g), matrix(work, START)))
    return msub(mscale(cv, way), hat(mat_vec(R, vector(row, W))))


@inner
def end_moment(line, ends, state, k, cv, way):
    """M, A, a and G of end k, with the direction and 1/length of its cell; way: W."""
    n = line.h.shape[0]
    c, node = k * (n - 1), k * n
    d, _, il = chord(get3(state.e, c))
    R, own, kb = get9(ends.frame, k), frame(get3(state.a1, c), d), get3(line.kb, node)
    k0 = rest_strain(line, state.T, node)
    if line.bits & STIFFNESS_DAMPING:
        e1, spin = sub(get3(state.v, c + 1), get3(state.v, c)), get3(ends.spin, k)
        d1, D1 = turning(d, il, e1, cv)
        w, We, Wp = angular_velocity(d, d1, state.w[c], il, D1, cv)
        if k == 0:
            M, C, Cd, _ = damped_bending_at(line, node, R, own, kb, k0, line.tau[c], spin, w)
            A, a = after(C, d, il)
            A, a = madd(A, mat_mat(Cd, We)), add(a, mat_vec(Cd, Wp))
            G = msub(mat_mat(Cd, msub(hat(sub(w, spin)), way)), madd(C, hat(M)))
        else:
            M, C, Cd, _ = damped_bending_at(line, node, own, R, kb, k0, line.tau[c], w, spin)
            A, a = before(msub(C, mat_mat(Cd, hat(sub(spin, w)))), M, d, il)
            A, a = mscale(-1.0, madd(A, mat_mat(Cd, We))), sub((0.0, 0.0, 0.0), add(a, mat_vec(Cd, Wp)))
            G = madd(C, mat_mat(Cd, way))
    elif k == 0:
        M, C = bending_at(line, node, R, own, kb, k0)
        A, a = after(C, d, il)
        G = mscale(-1.0, madd(C, hat(M)))
    else:
        M, C = bending_at(line, node, own, R, kb, k0)
        A, a = before(C, M, d, il)
        A, a, G = mscale(-1.0, A), sub((0.0, 0.0, 0.0), a), C
    return M, A, a, G, d, il


@inner
def answer_of_end(job, k, row, work, cv, out):
    """The numbers of end k into `out`; row, work: of what carries its frame."""
    line, way = job.line, spin_change(row, work, cv)
    M, A, a, G, d, il = end_moment(line, job.ends, job.new, k, cv, way)
    SG, dG = mscale(il, mat_mat(hat(d), G)), vec_mat(d, G)
    for i in range(9):
        out[BY_TURN + i], out[BY_CHORD + i], out[FORCE_BY_TURN + i] = G[i], A[i], SG[i]
    for i in range(3):
        out[BY_SPIN + i], out[MOMENT + i], out[SPIN_BY_TURN + i] = a[i], M[i], dG[i]
    if couples(line):
        n = line.h.shape[0]
        c = k * (n - 1)
        q = scale(line.tension_twist[c], get3(job.work.couple, k * n))  # AXIS is the first of its numbers
        turned = q
        if line.bits & STIFFNESS_DAMPING:
            turned = add(q, scale(line.tau[c], vec_mat(q, way)))
        for i in range(3):
            out[BY_TENSION + i], out[LENGTH_BY_TURN + i] = q[i], turned[i] if k == 1 else -turned[i]


# Columns of D.
SHIFT = 0  # 3, of the start
TURN = 3  # 3, of the start
END_TURN = 6  # 3, of the end
COLUMNS = 9
# Numbers of a functional, behind those of block i (5).
NEXT = 5  # 5, of block i+1
AFTER = 10  # 3, of r_{i+2}
LEFT = 13  # what is left when all are zero
OF = 14  # of q
FUNCTIONAL = OF + COLUMNS


@inner
def last_block(X, n):
    """Where in X the factors of the last block are."""
    base = (n + 1) * ROW
    return base if X.shape[0] - base == KEPT else base + n * KEPT


@inner
def end_row(X, k, r, c):
    """The number of the last block in row r, for dT (c = 0) or dr (1 to 3); k: where its factors are in X."""
    return X[k + 37 + SIZE * r + c] if X[k + 63] > 0.0 else X[k + 12 + 4 * r + c]


@inner
def put_row(x, o, a, b, c, d, e):
    x[o, 0], x[o, 1], x[o, 2], x[o, 3], x[o, 4] = a, b, c, d, e


@inner
def carry_start(X, W, columns, first, n, joined):
    """D_i of the shift of the start into columns[:3, first : first + n + 1]; joined: the last block is left unsolved."""
    base = (n + 1) * ROW
    unit = X[base + 37 + SIZE + 1] if X[base + 63] > 0.0 else X[base + 17]  # of the row that holds the start
    for i in range(n + 1):
        for b in range(3):
            x = columns[SHIFT + b]
            put_row(x, first + i, 0.0, 0.0, 0.0, 0.0, 0.0)
            if i == 0:
                x[first, b + 1] = unit
            carry_block(X, W, x, i, first + i, n, 0, not (joined and i == n))


@inner
def length_by_turn(X, i, n, answer, b):
    """What a turn puts into the length in block row i (kernels.laws.tension_torque), in the unit of that row."""
    return X[(n + 1) * ROW + i * KEPT + 62] * answer[LENGTH_BY_TURN + b]


@inner
def carry_turn(X, W, columns, first, n, joined, answer):
    """D_i of the turn of what the start is clamped to; answer: of the start (kernels.junctions.joined_lines)."""
    g, o = FORCE_BY_TURN, first
    for i in range(n + 1):
        for b in range(3):
            x = columns[TURN + b]
            put_row(x, o + i, 0.0, 0.0, 0.0, 0.0, 0.0)
            if i == 0:
                x[o, 4] = answer[SPIN_BY_TURN + b]
            elif i == 1:
                longer = length_by_turn(X, 1, n, answer, b)
                put_row(x, o + 1, -longer, -answer[g + b], -answer[g + 3 + b], -answer[g + 6 + b], 0.0)
            carry_block(X, W, x, i, o + i, n, 0, not (joined and i == n))


@inner
def carry_end_turn(X, W, columns, first, n, answer):
    """D_i of the turn of what the end is clamped to: it reaches the last two blocks; those before are zero."""
    g, o = FORCE_BY_TURN, first + n
    for b in range(3):
        x = columns[END_TURN + b]
        for i in range(first, o - 1):  # where the last two may have been, of other cells
            for k in range(x.shape[1]):
                x[i, k] = 0.0
        fx, fy, fz = answer[g + b], answer[g + 3 + b], answer[g + 6 + b]
        put_row(x, o - 1, 0.0, -fx, -fy, -fz, -answer[SPIN_BY_TURN + b])
        carry_block(X, W, x, n - 1, o - 1, n, n - 1, True)
        put_row(x, o, -length_by_turn(X, n, n, answer, b), fx, fy, fz, 0.0)
        carry_block(X, W, x, n, o, n, n - 1, False)


@inner
def balance_of_start(row, a, turning, answer, f):
    """Component a of the balance of the start, as a functional; turning: what it is clamped to turns.

    row: block row of the start with its balance, columns 10 to 22 and right-hand side 23 of its rows 1 to 3.
    """
    o = (a + 1) * 24
    for j in range(13):
        f[j] = row[o + 10 + j]
    f[LEFT] = -row[o + 23]
    for j in range(COLUMNS):
        f[OF + j] = 0.0
    if turning:
        for j in range(3):
            f[OF + TURN + j] = -answer[FORCE_BY_TURN + 3 * a + j]


@inner
def moment_of_end(k, a, answer, f):
    """Component a of the moment of end k on what it is clamped to, M_0 or -M_N, as a functional of its two blocks."""
    sign = 1.0 if k == 0 else -1.0
    f[:FUNCTIONAL] = 0.0
    for j in range(3):
        by = sign * answer[BY_CHORD + 3 * a + j]
        f[1 + j], f[NEXT + 1 + j] = -by, by
        f[OF + (TURN if k == 0 else END_TURN) + j] = sign * answer[BY_TURN + 3 * a + j]
    f[4], f[NEXT] = sign * answer[BY_SPIN + a], sign * answer[BY_TENSION + a]
    f[LEFT] = sign * answer[MOMENT + a]


@inner
def carry_functional(X, columns, parts, first, begin, n, joined, low, high, f):
    """A functional of block `begin` and those behind it becomes one of the last block and q alone.

    low, high: which of the columns there are; joined: whether the last block is left unsolved; parts (.., 5) gets the
    factors of the right-hand sides of the blocks in it.
    """
    for i in range(begin, n if joined else n + 1):
        p = i * ROW
        a0, a1, a2, a3, a4 = f[0], f[1], f[2], f[3], f[4]
        q, s, t, v = p + SPAN, p + 2 * SPAN, p + 3 * SPAN, p + 4 * SPAN
        row = parts[first + i]
        row[0], row[1], row[2], row[3], row[4] = a0, a1, a2, a3, a4
        f[LEFT] += a0 * X[p + 8] + a1 * X[q + 8] + a2 * X[s + 8] + a3 * X[t + 8] + a4 * X[v + 8]
        for b in range(low, high):
            x, o = columns[b], first + i
            f[OF + b] += a0 * x[o, 0] + a1 * x[o, 1] + a2 * x[o, 2] + a3 * x[o, 3] + a4 * x[o, 4]
        for j in range(SIZE):
            f[j] = f[NEXT + j] - (a0 * X[p + j] + a1 * X[q + j] + a2 * X[s + j] + a3 * X[t + j] + a4 * X[v + j])
            f[NEXT + j] = 0.0
        for j in range(3):
            m = SIZE + j
            f[NEXT + 1 + j] = f[AFTER + j] - (
                a0 * X[p + m] + a1 * X[q + m] + a2 * X[s + m] + a3 * X[t + m] + a4 * X[v + m]
            )
            f[AFTER + j] = 0.0


@inner
def count_right(X, parts, first, begin, end, left):
    """What is left of a functional with the right-hand sides X of blocks begin to end - 1; left: with none of them."""
    for i in range(begin, end):
        p, row = i * ROW + SPAN - 1, parts[first + i]
        q, s, t, v = p + SPAN, p + 2 * SPAN, p + 3 * SPAN, p + 4 * SPAN
        left += row[0] * X[p] + row[1] * X[q] + row[2] * X[s] + row[3] * X[t] + row[4] * X[v]
    return left
