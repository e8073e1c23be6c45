"""Ends of rods whose frame turns with a point or body: how the moment there changes (docs/theory.md, 18).

The element at such an end lies between the cell and a frame  R = R_joint R_seat.  With M of kernels.laws.element,

    dM = A de + a dpsi + G dtheta,

e and psi of the cell, theta (inertial) of the point or body; A and a are those of kernels.march.assembly, and

    at the start   G = -C - [M]x - C_d (W - [w_cell - w_frame]x),       at the end   G = C + C_d W,

with W the change of the frame's angular velocity,  W = cv R' J_l(n)^-1 R^T - [w_frame]x.  Where tension makes a torque
(kernels.laws.tension_torque), the moment changes by  g q dT  with the tension of the cell as well, and the law of length
of the cell by  g q . (1 + tau W) dtheta,  at the start with a minus sign.
"""

from __future__ import annotations

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
from hybrid.kernels.laws.cell import chord, turning
from hybrid.kernels.laws.element import after, angular_velocity, before
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
