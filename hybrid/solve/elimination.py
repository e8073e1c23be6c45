"""The march along s: assembly of one block row after the other, eliminated as it is born.

Unknowns of block i: the node (dr_i, 3) and the spin of the cell after it (dpsi_i).  A
row couples the blocks i-2 .. i+1 and the position i+2.  W holds one block row:

    columns  0..3   4..7   8..11  12..15  16..18   19
    block    i-2    i-1    i      i+1     r_{i+2}  right-hand side

After elimination  x_i = X_i[7] - X_i[0..3] x_{i+1} - X_i[4..6] dr_{i+2}:  the linear
relation that everything before node i imposes on what follows (docs/theory.md, 5).
Rows without bending take a 3x3 path in the same march.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.compiled import inner, kernel
from hybrid.physics.cell import (
    chord,
    damped_stretch,
    moment_force,
    rotary_force,
    strain_tension,
    stretch,
    turning,
)
from hybrid.physics.element import after, angular_velocity, before, bending, damped_bending
from hybrid.physics.loads import (
    ADDED_MASS,
    DRAG,
    MASS_DAMPING,
    ROTARY,
    STIFFNESS_DAMPING,
    half_cell_added_mass,
    half_cell_drag,
)
from hybrid.physics.rotations import (
    add,
    cross,
    dot,
    frame,
    hat,
    madd,
    mat_mat,
    mat_vec,
    mscale,
    msub,
    scale,
    sub,
)

WIDTH = 20  # columns of W
ROW = 32  # numbers of X_i
REPORT = 20  # numbers of `report`
# report: 0-2, 3-5 resultant on start and end node; 6-8, 9-11 moment at start and end;
#         12 drag power, 13 mass damping power, 14 stiffness damping power, 15 largest residual, 16 its node,
#         17 power into the added mass
Z3 = (0.0, 0.0, 0.0)
Z9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inner
def get3(A, i):
    return (A[i, 0], A[i, 1], A[i, 2])


@inner
def get9(A, i):
    return (A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4], A[i, 5], A[i, 6], A[i, 7], A[i, 8])


@inner
def put(W, row, col, A, sign):
    """W[row:row+3, col:col+3] = sign * A."""
    for j in range(3):
        o = (row + j) * WIDTH + col
        W[o] = sign * A[3 * j]
        W[o + 1] = sign * A[3 * j + 1]
        W[o + 2] = sign * A[3 * j + 2]


@inner
def take(W, o, swap, X, p, l0, l1, l2, l3):
    """Subtract l . X_p (4 rows of 8) from the eight numbers of W at o; its last column belongs to the right side."""
    kept = W[o + 7]
    t0 = W[o] - l0 * X[p] - l1 * X[p + 8] - l2 * X[p + 16] - l3 * X[p + 24]
    t1 = W[o + 1] - l0 * X[p + 1] - l1 * X[p + 9] - l2 * X[p + 17] - l3 * X[p + 25]
    t2 = W[o + 2] - l0 * X[p + 2] - l1 * X[p + 10] - l2 * X[p + 18] - l3 * X[p + 26]
    t3 = W[o + 3] - l0 * X[p + 3] - l1 * X[p + 11] - l2 * X[p + 19] - l3 * X[p + 27]
    t4 = W[o + 4] - l0 * X[p + 4] - l1 * X[p + 12] - l2 * X[p + 20] - l3 * X[p + 28]
    t5 = W[o + 5] - l0 * X[p + 5] - l1 * X[p + 13] - l2 * X[p + 21] - l3 * X[p + 29]
    t6 = W[o + 6] - l0 * X[p + 6] - l1 * X[p + 14] - l2 * X[p + 22] - l3 * X[p + 30]
    t7 = W[swap] - l0 * X[p + 7] - l1 * X[p + 15] - l2 * X[p + 23] - l3 * X[p + 31]
    W[o] = t0
    W[o + 1] = t1
    W[o + 2] = t2
    W[o + 3] = t3
    W[o + 4] = t4
    W[o + 5] = t5
    W[o + 6] = t6
    W[o + 7] = kept
    W[swap] = t7


@inner
def eliminate_wide(W, X, i):
    """Eliminate block row i (4 unknowns) with pivoting inside the block; False when the block is singular."""
    if i >= 2:
        p = (i - 2) * ROW
        for r in range(3):  # the spin row does not reach back to block i-2
            o = r * WIDTH
            take(W, o + 4, o + 19, X, p, W[o], W[o + 1], W[o + 2], W[o + 3])
    if i >= 1:
        p = (i - 1) * ROW
        for r in range(4):
            o = r * WIDTH
            take(W, o + 8, o + 19, X, p, W[o + 4], W[o + 5], W[o + 6], W[o + 7])
    for c in range(4):
        best, where = abs(W[c * WIDTH + 8 + c]), c
        for r in range(c + 1, 4):
            if abs(W[r * WIDTH + 8 + c]) > best:
                best, where = abs(W[r * WIDTH + 8 + c]), r
        if not best > 0.0:
            return False
        if where != c:
            for j in range(8 + c, 20):
                W[c * WIDTH + j], W[where * WIDTH + j] = W[where * WIDTH + j], W[c * WIDTH + j]
        inv = 1.0 / W[c * WIDTH + 8 + c]
        for j in range(8 + c, 20):
            W[c * WIDTH + j] *= inv
        for r in range(4):
            if r != c:
                f = W[r * WIDTH + 8 + c]
                for j in range(8 + c, 20):
                    W[r * WIDTH + j] -= f * W[c * WIDTH + j]
    x = i * ROW
    for r in range(4):
        for j in range(8):
            X[x + 8 * r + j] = W[r * WIDTH + 12 + j]
    return True


@inner
def eliminate_narrow(L, D, U, b, X, i):
    """Eliminate a row of three unknowns, L dr_{i-1} + D dr_i + U dr_{i+1} = b; X_i keeps zeros elsewhere."""
    b0, b1, b2 = b
    if i >= 1:
        p = (i - 1) * ROW
        D = (
            D[0] - L[0] * X[p] - L[1] * X[p + 8] - L[2] * X[p + 16],
            D[1] - L[0] * X[p + 1] - L[1] * X[p + 9] - L[2] * X[p + 17],
            D[2] - L[0] * X[p + 2] - L[1] * X[p + 10] - L[2] * X[p + 18],
            D[3] - L[3] * X[p] - L[4] * X[p + 8] - L[5] * X[p + 16],
            D[4] - L[3] * X[p + 1] - L[4] * X[p + 9] - L[5] * X[p + 17],
            D[5] - L[3] * X[p + 2] - L[4] * X[p + 10] - L[5] * X[p + 18],
            D[6] - L[6] * X[p] - L[7] * X[p + 8] - L[8] * X[p + 16],
            D[7] - L[6] * X[p + 1] - L[7] * X[p + 9] - L[8] * X[p + 17],
            D[8] - L[6] * X[p + 2] - L[7] * X[p + 10] - L[8] * X[p + 18],
        )
        b0 -= L[0] * X[p + 7] + L[1] * X[p + 15] + L[2] * X[p + 23]
        b1 -= L[3] * X[p + 7] + L[4] * X[p + 15] + L[5] * X[p + 23]
        b2 -= L[6] * X[p + 7] + L[7] * X[p + 15] + L[8] * X[p + 23]
    A0 = (D[0], D[1], D[2], U[0], U[1], U[2], b0)
    A1 = (D[3], D[4], D[5], U[3], U[4], U[5], b1)
    A2 = (D[6], D[7], D[8], U[6], U[7], U[8], b2)
    # Gauss-Jordan on rows of 7 with row pivoting: a cofactor inverse would lose eps (k_axial/k_transverse)^2
    if abs(A1[0]) > abs(A0[0]):
        A0, A1 = A1, A0
    if abs(A2[0]) > abs(A0[0]):
        A0, A2 = A2, A0
    f = 1.0 / A0[0]
    p1, p2, p3, p4, p5, p6 = f * A0[1], f * A0[2], f * A0[3], f * A0[4], f * A0[5], f * A0[6]
    f = A1[0]
    q1, q2, q3, q4, q5, q6 = (
        A1[1] - f * p1,
        A1[2] - f * p2,
        A1[3] - f * p3,
        A1[4] - f * p4,
        A1[5] - f * p5,
        A1[6] - f * p6,
    )
    f = A2[0]
    r1, r2, r3, r4, r5, r6 = (
        A2[1] - f * p1,
        A2[2] - f * p2,
        A2[3] - f * p3,
        A2[4] - f * p4,
        A2[5] - f * p5,
        A2[6] - f * p6,
    )
    if abs(r1) > abs(q1):
        q1, q2, q3, q4, q5, q6, r1, r2, r3, r4, r5, r6 = r1, r2, r3, r4, r5, r6, q1, q2, q3, q4, q5, q6
    f = 1.0 / q1
    q2, q3, q4, q5, q6 = f * q2, f * q3, f * q4, f * q5, f * q6
    f = 1.0 / (r2 - r1 * q2)
    r3, r4, r5, r6 = f * (r3 - r1 * q3), f * (r4 - r1 * q4), f * (r5 - r1 * q5), f * (r6 - r1 * q6)
    q3, q4, q5, q6 = q3 - q2 * r3, q4 - q2 * r4, q5 - q2 * r5, q6 - q2 * r6
    p3, p4, p5, p6 = p3 - p2 * r3 - p1 * q3, p4 - p2 * r4 - p1 * q4, p5 - p2 * r5 - p1 * q5, p6 - p2 * r6 - p1 * q6
    x = i * ROW
    X[x], X[x + 1], X[x + 2], X[x + 7] = p3, p4, p5, p6
    X[x + 8], X[x + 9], X[x + 10], X[x + 15] = q3, q4, q5, q6
    X[x + 16], X[x + 17], X[x + 18], X[x + 23] = r3, r4, r5, r6
    big = abs(p6) + abs(q6) + abs(r6)
    return big < math.inf  # a singular block divides by zero, and infinity or NaN ends here


@inner
def node_loads(line, i, v, vd, dl, ill, dr, ilr, left, right, cv, ca, report):
    """Force on node i but for the cells' own: F, and its derivatives D (dr_i), GL, GR (chord before, after)."""
    vi, vdi = get3(v, i), get3(vd, i)
    m = line.mass[i]
    F = sub(get3(line.force, i), scale(m, vdi))
    c = -ca * m
    D = (c, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0, c)
    GL, GR = Z9, Z9
    bits = line.bits
    if bits & MASS_DAMPING:
        b = line.damp[i]
        F = sub(F, scale(b, vi))
        c = -cv * b
        D = (D[0] + c, D[1], D[2], D[3], D[4] + c, D[5], D[6], D[7], D[8] + c)
        report[13] += b * dot(vi, vi)
    if bits & DRAG:
        u = (vi[0] - line.current[0], vi[1] - line.current[1], vi[2] - line.current[2])
        if left:
            f, Df, GL = half_cell_drag(u, dl, ill, line.drag_n[i - 1], line.drag_t[i - 1], cv)
            F, D = add(F, f), madd(D, Df)
            report[12] -= dot(f, vi)
        if right:
            f, Df, GR = half_cell_drag(u, dr, ilr, line.drag_n[i], line.drag_t[i], cv)
            F, D = add(F, f), madd(D, Df)
            report[12] -= dot(f, vi)
    if bits & ADDED_MASS:
        if left:
            f, Df, L = half_cell_added_mass(vdi, dl, ill, line.added_n[i - 1], line.added_t[i - 1], ca)
            F, D, GL = add(F, f), madd(D, Df), madd(GL, L)
            report[17] -= dot(f, vi)
        if right:
            f, Df, L = half_cell_added_mass(vdi, dr, ilr, line.added_n[i], line.added_t[i], ca)
            F, D, GR = add(F, f), madd(D, Df), madd(GR, L)
            report[17] -= dot(f, vi)
    return F, D, GL, GR


@kernel
def march(line, ends, e, u, r, v, vd, T, a1, w, wd, cv, ca, W, X, report, rows):
    """Assemble and eliminate all block rows for the configuration given.

    Everything belongs to the end of the step.  `u` is the displacement since its start,
    `r` the position then.  Returns -1, or the node whose block was singular.  `rows`
    with N+1 entries receives every assembled block row before elimination (for tests
    and independent solvers); with none it is not touched.
    """
    n = e.shape[0]
    bits = line.bits
    moving = bits & (ROTARY | STIFFNESS_DAMPING)
    for j in range(REPORT):
        report[j] = 0.0
    report[16] = -1.0

    # the first chord and the element at the start
    d, l, il = chord(get3(e, 0))
    d1, D1, e1 = Z3, Z9, Z3
    if moving:
        e1 = sub(get3(v, 1), get3(v, 0))
        d1, D1 = turning(d, il, e1, cv)
    A, a, B, b = Z9, Z3, Z9, Z3  # element at node i
    M = scale(-1.0, get3(ends.moment, 0))
    Ra = Z9
    if line.spin[0]:
        Ra = frame(get3(a1, 0), d)
    if line.element[0]:
        Rg = get9(ends.frame, 0)
        if bits & STIFFNESS_DAMPING:
            wb, We, Wp = angular_velocity(d, d1, w[0], il, D1, cv)
            M, C, Cd, loss = damped_bending(
                Rg, Ra, get3(line.kb, 0), get3(line.k0, 0), line.tau[0], get3(ends.spin, 0), wb
            )
            A, a = after(C, d, il)
            A, a = madd(A, mat_mat(Cd, We)), add(a, mat_vec(Cd, Wp))
            report[14] += loss
        else:
            M, C = bending(Rg, Ra, get3(line.kb, 0), get3(line.k0, 0))
            A, a = after(C, d, il)
    report[6], report[7], report[8] = M

    np_, pNm, pnm, pN0, pn0, pNp, pnp = Z3, Z9, Z3, Z9, Z3, Z9, Z3  # force of cell i-1 and its derivatives
    wide_before = False
    d_before, il_before = Z3, 0.0
    for i in range(n + 1):
        # --- unpack: chord and frame of cell i+1, element at node i+1
        cell = i < n
        bent = cell and (line.element[i] or line.element[i + 1] or line.spin[i])
        dn, lnx, iln, d1n, D1n, e1n, Rn = Z3, 0.0, 0.0, Z3, Z9, Z3, Z9
        An, an, Bn, bn = Z9, Z3, Z9, Z3
        Mn = Z3
        if i + 1 < n:
            dn, lnx, iln = chord(get3(e, i + 1))
            if moving:
                e1n = sub(get3(v, i + 2), get3(v, i + 1))
                d1n, D1n = turning(dn, iln, e1n, cv)
            if line.spin[i + 1]:
                Rn = frame(get3(a1, i + 1), dn)
        elif cell:
            Mn = get3(ends.moment, 1)
            Rn = get9(ends.frame, 1)
        if cell and line.element[i + 1]:
            kb, k0 = get3(line.kb, i + 1), get3(line.k0, i + 1)
            if bits & STIFFNESS_DAMPING:
                wa_, Wae, Wap = angular_velocity(d, d1, w[i], il, D1, cv)
                wb, We, Wp = get3(ends.spin, 1), Z9, Z3
                tau = line.tau[i]
                if i + 1 < n:
                    wb, We, Wp = angular_velocity(dn, d1n, w[i + 1], iln, D1n, cv)
                    tau = 0.5 * (tau + line.tau[i + 1])
                Mn, C, Cd, loss = damped_bending(Ra, Rn, kb, k0, tau, wa_, wb)
                An, an = after(C, dn, iln)
                An, an = madd(An, mat_mat(Cd, We)), add(an, mat_vec(Cd, Wp))
                Bn, bn = before(msub(C, mat_mat(Cd, hat(sub(wb, wa_)))), Mn, d, il)
                Bn, bn = madd(Bn, mat_mat(Cd, Wae)), add(bn, mat_vec(Cd, Wap))
                report[14] += loss
            else:
                Mn, C = bending(Ra, Rn, kb, k0)
                An, an = after(C, dn, iln)
                Bn, bn = before(C, Mn, d, il)
            if i + 1 == n:
                An, an = Z9, Z3  # the frame of the end is given

        # --- law: force of cell i and its derivatives
        nc, Nm, nm, N0, n0, Np, npl = Z3, Z9, Z3, Z9, Z3, Z9, Z3
        Q = Z3
        if cell:
            Ts = strain_tension(get3(e, i), l, line.h[i], line.ck[i])
            if bits & STIFFNESS_DAMPING:
                nc, N0 = damped_stretch(d, il, line.h[i], line.ck[i], T[i], Ts, e1, d1, line.tau[i], cv)
                along = dot(d, e1)
                report[14] += line.tau[i] * along * along / (line.h[i] * line.ck[i])
            else:
                nc, N0 = stretch(d, il, line.h[i], line.ck[i], T[i], Ts)
            if bent:
                Q = sub(Mn, M)
                DQ = mscale(-1.0, madd(Bn, A))
                q0 = scale(-1.0, add(bn, a))
                if bits & ROTARY:
                    G = line.polar[i]
                    Q = sub(Q, scale(G * w[i], d1))
                    DQ = msub(DQ, mscale(G * w[i], D1))
                    q0 = sub(q0, scale(G * cv, d1))
                    e2 = sub(get3(vd, i + 1), get3(vd, i))
                    fr, Dr = rotary_force(d, il, e1, e2, d1, D1, line.rotary[i], cv, ca)
                    nc, N0 = add(nc, fr), madd(N0, Dr)
                V, DV = moment_force(d, il, Q, DQ)
                nc, N0 = add(nc, V), madd(N0, DV)
                S = mscale(il, hat(d))
                n0 = scale(il, cross(d, q0))
                Nm, nm = mat_mat(S, B), scale(il, cross(d, b))
                Np, npl = mat_mat(S, An), scale(il, cross(d, an))

        # --- balance: residual F of node i and its row
        F, D, GL, GR = node_loads(line, i, v, vd, d_before, il_before, d, il, i > 0, cell, cv, ca, report)
        F = add(F, sub(nc, np_))
        held = (i == 0 and ends.held[0]) or (i == n and ends.held[1])
        if i == 0:
            F = add(F, get3(ends.force, 0))
            report[0], report[1], report[2] = F
        if i == n:
            F = add(F, get3(ends.force, 1))
            report[3], report[4], report[5] = F
        if not held:
            big = max(abs(F[0]), abs(F[1]), abs(F[2]))
            if not big <= report[15]:
                report[15], report[16] = big, i
        G1, G2 = madd(msub(Nm, pN0), GL), madd(msub(N0, pNp), GR)
        Dii = madd(msub(G1, G2), D)
        rhs = scale(-1.0, F)
        wide = bent or wide_before

        # --- pack, and eliminate at once
        if held:
            k = 0 if i == 0 else 1
            rhs = (
                ends.position[k, 0] - r[i, 0] - u[i, 0],
                ends.position[k, 1] - r[i, 1] - u[i, 1],
                ends.position[k, 2] - r[i, 2] - u[i, 2],
            )
        good = True
        if wide or rows.shape[0] > 0:
            for j in range(4 * WIDTH):
                W[j] = 0.0
            if held:
                W[8], W[WIDTH + 9], W[2 * WIDTH + 10] = 1.0, 1.0, 1.0
            else:
                put(W, 0, 0, pNm, 1.0)
                put(W, 0, 4, madd(pNm, G1), -1.0)
                put(W, 0, 8, Dii, 1.0)
                put(W, 0, 12, msub(G2, Np), 1.0)
                put(W, 0, 16, Np, 1.0)
                for j in range(3):
                    o = j * WIDTH
                    W[o + 3] = -pnm[j]
                    W[o + 7] = nm[j] - pn0[j]
                    W[o + 11] = n0[j] - pnp[j]
                    W[o + 15] = npl[j]
            W[19], W[WIDTH + 19], W[2 * WIDTH + 19] = rhs
            o = 3 * WIDTH
            if cell and line.spin[i]:
                # spin row: d.(M_{i+1} - M_i) - polar w' = 0
                Qm = sub(Mn, M)
                along = dot(d, Qm)
                sm = (dot(d, (B[0], B[3], B[6])), dot(d, (B[1], B[4], B[7])), dot(d, (B[2], B[5], B[8])))
                s0 = (
                    il * (Qm[0] - along * d[0]) - dot(d, (Bn[0] + A[0], Bn[3] + A[3], Bn[6] + A[6])),
                    il * (Qm[1] - along * d[1]) - dot(d, (Bn[1] + A[1], Bn[4] + A[4], Bn[7] + A[7])),
                    il * (Qm[2] - along * d[2]) - dot(d, (Bn[2] + A[2], Bn[5] + A[5], Bn[8] + A[8])),
                )
                sp = (dot(d, (An[0], An[3], An[6])), dot(d, (An[1], An[4], An[7])), dot(d, (An[2], An[5], An[8])))
                # 1e-9 of the torsional stiffness keeps a rod pinned at both ends from spinning freely
                soft = -1e-9 * (line.kb[i, 2] * line.element[i] + line.kb[i + 1, 2] * line.element[i + 1])
                residual, inertia = along, 0.0
                if bits & ROTARY:
                    residual -= line.polar[i] * wd[i]
                    inertia = line.polar[i] * ca
                for j in range(3):
                    W[o + 4 + j] = -sm[j]
                    W[o + 8 + j] = sm[j] - s0[j]
                    W[o + 12 + j] = s0[j] - sp[j]
                    W[o + 16 + j] = sp[j]
                W[o + 7] = dot(d, b)
                W[o + 11] = -dot(d, add(bn, a)) - inertia + soft
                W[o + 15] = dot(d, an)
                W[o + 19] = -residual
            else:
                W[o + 11] = 1.0
            if rows.shape[0] > 0:
                for j in range(4 * WIDTH):
                    rows[i, j] = W[j]
        if wide:
            good = eliminate_wide(W, X, i)
        elif held:
            good = eliminate_narrow(Z9, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), Z9, rhs, X, i)
        else:
            good = eliminate_narrow(mscale(-1.0, G1), Dii, G2, rhs, X, i)
        if not good:
            return i

        # --- step along s
        if i == n - 1:
            report[9], report[10], report[11] = Mn
        d_before, il_before = d, il
        np_, pNm, pnm, pN0, pn0, pNp, pnp = nc, Nm, nm, N0, n0, Np, npl
        d, l, il, d1, D1, e1, Ra = dn, lnx, iln, d1n, D1n, e1n, Rn
        A, a, B, b, M = An, an, Bn, bn, Mn
        wide_before = bent
    return -1


@kernel
def substitute(X, x):
    """Solve back from the end: x (N+1, 4) receives dr and dpsi of every block."""
    n = x.shape[0] - 1
    y0, y1, y2, y3, z0, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n, -1, -1):
        p = i * ROW
        for k in range(4):
            q = p + 8 * k
            x[i, k] = (
                X[q + 7]
                - X[q] * y0 - X[q + 1] * y1 - X[q + 2] * y2 - X[q + 3] * y3
                - X[q + 4] * z0 - X[q + 5] * z1 - X[q + 6] * z2
            )  # fmt: skip
        z0, z1, z2 = y0, y1, y2
        y0, y1, y2, y3 = x[i, 0], x[i, 1], x[i, 2], x[i, 3]


def workspace(n_cells: int):
    """Arrays the march needs: W, X, x, report, and an empty `rows`."""
    return (
        np.zeros(4 * WIDTH),
        np.zeros((n_cells + 1) * ROW),
        np.zeros((n_cells + 1, 4)),
        np.zeros(REPORT),
        np.zeros((0, 4 * WIDTH)),
    )
