"""The cell between two nodes, and the element at a node.

The cell has tension and the direction of the chord.

    symbol   meaning                                      shape  unit   frame
    e        chord r_{c+1} - r_c                          3      m      inertial
    l, il    |e| and 1/|e|                                -      m, 1/m
    d        e / l                                        3      -      inertial
    h        unstretched length                           -      m
    ck       compliance 1/EA, 0 when inextensible         -      1/N
    T        tension                                      -      N
    e1, e2   de/dt, d2e/dt2                               3      m/s..  inertial
    d1       dd/dt                                        3      1/s    inertial
    tau      stiffness-proportional damping time          -      s
    J        rotary inertia of the cell, h I              -      kg m2
    cv, ca   dv'/dr', dvd'/dr' of the time scheme         -      1/s, 1/s2

Every function returns the quantity and its exact derivative with respect to e.

The element has bending and twist between the two cells that meet at a node (a rod), or nothing (a joint).

    symbol     meaning                                          shape  unit   frame
    Ra, Rb     frames of the cells before and after the node    9      -      columns inertial
    k          log strain, exp[k]x = Ra^T Rb                    3      rad    Ra
    kb         B/hn: stiffness of the element                   3      N m    Ra (principal axes)
    k0         strain without stress                            3      rad    Ra
    P          inverse left Jacobian at k                       9      -      Ra
    M          moment of the part after the node on that before 3      N m    inertial
    w          angular velocity of a cell, d x d1 + w3 d        3      1/s    inertial

With dth = d x de/l + d dpsi the change of M is
    dM = A de_b + a dpsi_b - B de_a - b dpsi_a.

A swivel is an element without torsional stiffness (kb[2] = 0) of a round, straight section.  It knows the directions of
the cells alone, whatever their frames: M = kb (beta/sin beta) d_a x d_b, beta the angle between them, has no component
along either.  (The log strain of a large twist would take part of it for bending.)
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    d_double_cross,
    dot,
    frame,
    get3,
    get9,
    hat,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    madd,
    mat_hat,
    mat_mat,
    mat_matT,
    mat_vec,
    mscale,
    msub,
    outer,
    project,
    scale,
    stack,
    sub,
    vec_mat,
)
from hybrid.kernels.machine.compile import inner


class Chord(NamedTuple):
    """Direction, length and 1/length of a chord, in space or in a plane."""

    d: Any
    l: float
    il: float


class Rates(NamedTuple):
    """How velocities and accelerations answer to positions in the time scheme: dv'/dr', 1/s, and dvd'/dr', 1/s2."""

    cv: float
    ca: float


@inner
def chord(e):
    """Direction d, length l and 1/l of a chord."""
    l = math.sqrt(dot(e, e))
    il = 1.0 / l
    return scale(il, e), l, il


@inner
def pull(d, il, T):
    """Axial force T d and dn/de = (T/l)(I - d d^T); dn/dT is d."""
    return scale(T, d), mscale(T * il, project(d))


@inner
def stretch(e, d, l, h, ck, T):
    """The law of length, l - h - h ck T = 0, linearised: row.de - hck dT = gap.  l - h is free of cancellation."""
    hck = h * ck
    return d, hck, hck * T - (dot(e, e) - h * h) / (l + h)


@inner
def turning(d, il, e1, cv):
    """d1 = (I - d d^T) e1/l and its derivative with respect to e (e1 follows e with the factor cv)."""
    along = dot(d, e1)
    d1 = scale(il, sub(e1, scale(along, d)))
    P = project(d)
    D = mscale((cv - along * il) * il, P)
    return d1, msub(D, mscale(il, madd(outer(d, d1), outer(d1, d))))


@inner
def damped_stretch(d, e1, d1, tau, cv):
    """As `stretch` with l + tau dl/dt in place of l: the row, and what the gap loses."""
    a = 1.0 + tau * cv
    return (a * d[0] + tau * d1[0], a * d[1] + tau * d1[1], a * d[2] + tau * d1[2]), tau * dot(d, e1)


@inner
def rotary_force(d, il, e1, e2, d1, D1, J, cv, ca):
    """Force J d2/l that turns the cell's cross-sections (d2: normal part of the second derivative of d), and dn/de."""
    along = dot(d, e1)
    e2n = sub(e2, scale(dot(d, e2), d))
    y = scale(il, sub(e2n, scale(2.0 * along, d1)))
    row = (d1[0] + cv * d[0], d1[1] + cv * d[1], d1[2] + cv * d[2])
    P = project(d)
    D = msub(mscale(ca - dot(d, e2) * il, P), mscale(il, outer(d, e2n)))
    D = msub(D, madd(mscale(2.0, outer(d1, row)), mscale(2.0 * along, D1)))
    D = msub(mscale(il, D), mscale(il, outer(y, d)))
    return scale(J * il, y), mscale(J * il, msub(D, mscale(il, outer(y, d))))


@inner
def moment_force(d, il, Q, DQ):
    """Shear d x Q/l that balances the moment difference Q, and its derivative when Q changes by DQ de.

    d(d x Q/l)/de = -[Q]x/l^2 - 2 (d x Q) d^T/l^2 + [d]x DQ/l
    """
    V = (
        il * (d[1] * Q[2] - d[2] * Q[1]),
        il * (d[2] * Q[0] - d[0] * Q[2]),
        il * (d[0] * Q[1] - d[1] * Q[0]),
    )
    i2 = il * il
    H = (0.0, i2 * Q[2], -i2 * Q[1], -i2 * Q[2], 0.0, i2 * Q[0], i2 * Q[1], -i2 * Q[0], 0.0)
    D = msub(H, mscale(2.0 * il, outer(V, d)))
    dx = (0.0, -il * d[2], il * d[1], il * d[2], 0.0, -il * d[0], -il * d[1], il * d[0], 0.0)
    return V, madd(D, mat_mat(dx, DQ))


# Stiffness of an angular spring of none, as a part of that of half a cell: nothing, but a number.
NO_SPRING = 1e-12


@inner
def put_spring(spring, line, node):
    """An angular spring in series with the half cell at a clamp.

    The node gets the length of line that would bend as much, so that kb hn stays the bending stiffness.
    """
    rigid = 0.5 * (line.kb[node, 0] + line.kb[node, 1])
    spring = max(spring, NO_SPRING * max(line.kb[node, 0], line.kb[node, 1]))
    for k in range(2):
        line.kb[node, k] = 1.0 / (1.0 / line.kb[node, k] + 1.0 / spring)
    line.hn[node] *= rigid / (0.5 * (line.kb[node, 0] + line.kb[node, 1]))


@inner
def frames_at(line, ends, state, i):
    """Frames before and after node i: of the cells there, or of an end."""
    n = line.h.shape[0]
    Ra, Rb = get9(ends.frame, 0), get9(ends.frame, 1)
    if i > 0:
        d, _, _ = chord(get3(state.e, i - 1))
        Ra = frame(get3(state.a1, i - 1), d)
    if i < n:
        d, _, _ = chord(get3(state.e, i))
        Rb = frame(get3(state.a1, i), d)
    return Ra, Rb


@inner
def relative_rotation(Ra, Rb):
    """Ra^T Rb."""
    return (
        Ra[0] * Rb[0] + Ra[3] * Rb[3] + Ra[6] * Rb[6],
        Ra[0] * Rb[1] + Ra[3] * Rb[4] + Ra[6] * Rb[7],
        Ra[0] * Rb[2] + Ra[3] * Rb[5] + Ra[6] * Rb[8],
        Ra[1] * Rb[0] + Ra[4] * Rb[3] + Ra[7] * Rb[6],
        Ra[1] * Rb[1] + Ra[4] * Rb[4] + Ra[7] * Rb[7],
        Ra[1] * Rb[2] + Ra[4] * Rb[5] + Ra[7] * Rb[8],
        Ra[2] * Rb[0] + Ra[5] * Rb[3] + Ra[8] * Rb[6],
        Ra[2] * Rb[1] + Ra[5] * Rb[4] + Ra[8] * Rb[7],
        Ra[2] * Rb[2] + Ra[5] * Rb[5] + Ra[8] * Rb[8],
    )


@inner
def columns_scaled(A, b):
    """A diag(b)."""
    return stack(
        (A[0] * b[0], A[1] * b[1], A[2] * b[2]),
        (A[3] * b[0], A[4] * b[1], A[5] * b[2]),
        (A[6] * b[0], A[7] * b[1], A[8] * b[2]),
    )


@inner
def turns_freely(kb, k0):
    """Whether an element is a swivel."""
    return kb[2] == 0.0 and kb[0] == kb[1] and k0[0] == 0.0 and k0[1] == 0.0


@inner
def swing_functions(s, c):
    """beta/sin beta and its derivative by cos beta."""
    if s < 1e-3 and c > 0.0:
        return 1.0 + s * s * (1.0 / 6.0 + 3.0 / 40.0 * s * s), -1.0 / 3.0 - 2.0 / 15.0 * s * s
    s = max(s, 1e-12)
    beta = math.atan2(s, c)
    return beta / s, (beta * c - s) / (s * s * s)


@inner
def swing(Ra, Rb):
    """Rotation (rad, inertial) that takes the direction of cell a to that of cell b, without twist."""
    w = cross((Ra[2], Ra[5], Ra[8]), (Rb[2], Rb[5], Rb[8]))
    return scale(swing_functions(math.sqrt(dot(w, w)), Ra[2] * Rb[2] + Ra[5] * Rb[5] + Ra[8] * Rb[8])[0], w)


@inner
def strain_of_element(Ra, Rb, kb, k0, i):
    """Log strain (rad, frame Ra) at node i; of a swivel that of its bend alone, at a start in the frame of the line."""
    if turns_freely(kb, k0):
        return vec_mat(swing(Ra, Rb), Rb if i == 0 else Ra)
    return log_rotation(relative_rotation(Ra, Rb))


@inner
def swivel(Ra, Rb, stiffness):
    """As `bending`, of a swivel of that stiffness, N m."""
    a, b = (Ra[2], Ra[5], Ra[8]), (Rb[2], Rb[5], Rb[8])
    w, c = cross(a, b), dot(a, b)
    g, g1 = swing_functions(math.sqrt(dot(w, w)), c)
    ga, gw = scale(-stiffness * g, b), scale(-stiffness * g1, w)
    C = madd(outer(ga, a), outer(gw, w))
    x = stiffness * g * c
    return scale(stiffness * g, w), (C[0] + x, C[1], C[2], C[3], C[4] + x, C[5], C[6], C[7], C[8] + x)


@inner
def damped_swivel(Ra, Rb, stiffness, k, wa, wb):
    """As `damped_bending`, of a swivel with damping k, N m s: about the mean of both directions nothing is damped."""
    M, C = swivel(Ra, Rb, stiffness)
    b = (Rb[2], Rb[5], Rb[8])
    t = (Ra[2] + b[0], Ra[5] + b[1], Ra[8] + b[2])
    size = 1.0 / math.sqrt(max(dot(t, t), 1e-24))
    t, y = scale(size, t), sub(wb, wa)
    along = dot(t, y)
    across = sub(y, scale(along, t))
    # dt = H dth_b, H = -(1 - t t)[b]x/|d_a + d_b|
    P = project(t)
    H = mat_hat(P, b)
    C = madd(C, mscale(k * size, madd(mscale(along, H), outer(t, vec_mat(y, H)))))
    return add(M, scale(k, across)), C, mscale(k, P), k * dot(across, across)


@inner
def bending(Ra, Rb, kb, k0):
    """Moment M and C, where dM = C (dth_b - dth_a) + dth_a x M."""
    if turns_freely(kb, k0):
        return swivel(Ra, Rb, kb[0])
    k = log_rotation(relative_rotation(Ra, Rb))
    g, g1 = jacobian_functions(dot(k, k))
    P = inverse_left_jacobian(k, g)
    n = (kb[0] * (k[0] - k0[0]), kb[1] * (k[1] - k0[1]), kb[2] * (k[2] - k0[2]))
    M = mat_vec(Ra, vec_mat(n, P))

    # d(P^T n)/dk at fixed n: P^T n = n + k x n/2 + g k x (k x n)
    D = msub(d_double_cross(k, n, g, g1), mscale(0.5, hat(n)))
    PT = (P[0], P[3], P[6], P[1], P[4], P[7], P[2], P[5], P[8])
    C = mat_mat(madd(D, columns_scaled(PT, kb)), P)
    return M, mat_matT(mat_mat(Ra, C), Ra)


@inner
def damped_bending(Ra, Rb, kb, kd, k0, wa, wb):
    """As `bending` with the moment kd dk/dt added; kd: 3, N m s, tau times the stiffness.

    Returns M, C and Cd, where
    dM = C (dth_b - dth_a) + dth_a x M + Cd (dw_b - dw_a - dth_a x (w_b - w_a)),
    and the power that the damping takes out (W, positive).
    """
    if turns_freely(kb, k0):
        return damped_swivel(Ra, Rb, kb[0], kd[0], wa, wb)
    k = log_rotation(relative_rotation(Ra, Rb))
    g, g1 = jacobian_functions(dot(k, k))
    P = inverse_left_jacobian(k, g)
    y = vec_mat(sub(wb, wa), Ra)
    k1 = mat_vec(P, y)  # dk/dt
    n = (
        kb[0] * (k[0] - k0[0]) + kd[0] * k1[0],
        kb[1] * (k[1] - k0[1]) + kd[1] * k1[1],
        kb[2] * (k[2] - k0[2]) + kd[2] * k1[2],
    )
    M = mat_vec(Ra, vec_mat(n, P))
    loss = kd[0] * k1[0] * k1[0] + kd[1] * k1[1] * k1[1] + kd[2] * k1[2] * k1[2]

    D = msub(d_double_cross(k, n, g, g1), mscale(0.5, hat(n)))
    PT = (P[0], P[3], P[6], P[1], P[4], P[7], P[2], P[5], P[8])
    PTd = columns_scaled(PT, kd)
    # d(P y)/dk at fixed y: P y = y - k x y/2 + g k x (k x y)
    Dy = madd(d_double_cross(k, y, g, g1), mscale(0.5, hat(y)))
    C = mat_mat(madd(madd(D, columns_scaled(PT, kb)), mat_mat(PTd, Dy)), P)
    Cd = mat_mat(PTd, P)
    return M, mat_matT(mat_mat(Ra, C), Ra), mat_matT(mat_mat(Ra, Cd), Ra), loss


@inner
def after(C, d, il):
    """A and a: how M answers to the chord and the spin of the cell after the node."""
    return mscale(il, mat_hat(C, d)), mat_vec(C, d)


@inner
def before(C, M, d, il):
    """B and b: how M answers (with a minus sign) to the chord and the spin of the cell before the node."""
    A, a = after(C, d, il)
    MxS = mscale(il, mat_hat(hat(M), d))
    x, y = a[0] + M[1] * d[2] - M[2] * d[1], a[1] + M[2] * d[0] - M[0] * d[2]
    return madd(A, MxS), (x, y, a[2] + M[0] * d[1] - M[1] * d[0])


@inner
def angular_velocity(d, d1, w3, il, D1, cv):
    """w of a cell and its derivatives with respect to e (matrix) and psi (vector)."""
    w = cross(d, d1)
    # dw/de = [d]x D1 - [d1]x P/l + w3 P/l
    dxD1 = mat_mat(hat(d), D1)
    P = project(d)
    We = madd(msub(dxD1, mscale(il, mat_mat(hat(d1), P))), mscale(w3 * il, P))
    return (w[0] + w3 * d[0], w[1] + w3 * d[1], w[2] + w3 * d[2]), We, scale(cv, d)
