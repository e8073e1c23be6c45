"""The march along s: geometry, laws and balance of one node after the other, each block row eliminated as it is born.

The layout of a block row and its elimination are in kernels.block_elimination; symbols as in
kernels.cell, kernels.element and kernels.loads.
"""

from __future__ import annotations

import numpy as np

from hybrid.kernels.block_elimination import KEPT, ROW, SIZE, WIDTH, eliminate_narrow, eliminate_wide
from hybrid.kernels.cell import (
    chord,
    damped_stretch,
    moment_force,
    pull,
    rotary_force,
    stretch,
    turning,
)
from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.element import after, angular_velocity, before, bending, damped_bending
from hybrid.kernels.forces import ROTARY, STIFFNESS_DAMPING
from hybrid.kernels.node_forces import Z3, Z9, get3, node_loads
from hybrid.kernels.report import (
    ASSEMBLED,
    FORCE_A,
    FORCE_B,
    MOMENT_A,
    MOMENT_B,
    REPORT_SIZE,
    RESIDUAL,
    RESIDUAL_NODE,
    STIFFNESS_DAMPING_POWER,
)
from hybrid.kernels.rotations import (
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


@kernel
def march(line, sea, ends, e, u, r, v, vd, T, a1, w, wd, cv, ca, gaps, W, X, report, rows):
    """Assemble and eliminate all block rows for the configuration given.

    Everything belongs to the end of the step.  `u` is the displacement since its start,
    `r` the position then.  Returns -1, or the node whose block was singular.  `rows`
    with N+1 entries receives every assembled block row before elimination (for tests
    and independent solvers); with none it is not touched.  `gaps` with N entries stands
    in for the change of length asked of inextensible cells; with none, the law of length does.
    An X with room for more keeps the factors for another right-hand side (kernels.block_elimination).
    """
    n = e.shape[0]
    kept, next_kept = 0, 0
    if X.shape[0] > (n + 1) * ROW:
        kept, next_kept = (n + 1) * ROW, KEPT
    bits = line.bits
    moving = bits & (ROTARY | STIFFNESS_DAMPING)
    for j in range(ASSEMBLED):
        report[j] = 0.0
    report[RESIDUAL_NODE] = -1.0

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
            report[STIFFNESS_DAMPING_POWER] += loss
        else:
            M, C = bending(Rg, Ra, get3(line.kb, 0), get3(line.k0, 0))
            A, a = after(C, d, il)
    report[MOMENT_A], report[MOMENT_A + 1], report[MOMENT_A + 2] = M

    np_, pNm, pnm, pN0, pn0, pNp, pnp = Z3, Z9, Z3, Z9, Z3, Z9, Z3  # force of cell i-1 and its derivatives
    wide_before = False
    d_before, l_before, il_before = Z3, 0.0, 0.0
    row_before, hck_before, gap_before = Z3, -1.0, 0.0  # there is no cell before the start: dT = 0
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
                report[STIFFNESS_DAMPING_POWER] += loss
            else:
                Mn, C = bending(Ra, Rn, kb, k0)
                An, an = after(C, dn, iln)
                Bn, bn = before(C, Mn, d, il)
            if i + 1 == n:
                An, an = Z9, Z3  # the frame of the end is given

        # --- law: force of cell i and its derivatives
        nc, Nm, nm, N0, n0, Np, npl = Z3, Z9, Z3, Z9, Z3, Z9, Z3
        row, hck, gap = Z3, 1.0, 0.0
        Q = Z3
        if cell:
            nc, N0 = pull(d, il, T[i])
            row, hck, gap = stretch(get3(e, i), d, l, line.h[i], line.ck[i], T[i])
            if bits & STIFFNESS_DAMPING and hck > 0.0:  # what does not stretch has no rate of stretching to damp
                row, late = damped_stretch(d, e1, d1, line.tau[i], cv)
                gap -= late
                along = dot(d, e1)
                report[STIFFNESS_DAMPING_POWER] += line.tau[i] * along * along / hck
            if gaps.shape[0] > 0 and hck == 0.0:
                gap = gaps[i]
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
        F, D, GL, GR = node_loads(
            line, sea, i, r, u, e, v, vd, d_before, l_before, il_before, d, l, il, i > 0, cell, cv, ca, report
        )
        F = add(F, sub(nc, np_))
        held = (i == 0 and ends.held[0]) or (i == n and ends.held[1])
        if i == 0:
            F = add(F, get3(ends.force, 0))
            report[FORCE_A], report[FORCE_A + 1], report[FORCE_A + 2] = F
        if i == n:
            F = add(F, get3(ends.force, 1))
            report[FORCE_B], report[FORCE_B + 1], report[FORCE_B + 2] = F
        if not held:
            big = max(abs(F[0]), abs(F[1]), abs(F[2]))
            if not big <= report[RESIDUAL]:
                report[RESIDUAL], report[RESIDUAL_NODE] = big, i
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
        # lengths in the unit of the balance, so that pivoting compares like with like
        size = 1.0 if held else abs(Dii[0]) + abs(Dii[4]) + abs(Dii[8])
        if not size > 0.0:
            size = 1.0
        if wide or rows.shape[0] > 0:
            for j in range(SIZE * WIDTH):
                W[j] = 0.0
            W[6], W[7], W[8] = -row_before[0], -row_before[1], -row_before[2]
            W[11], W[12], W[13] = row_before[0], row_before[1], row_before[2]
            W[10], W[23] = -hck_before, gap_before
            if held:
                # the unit matrix, in the size of the spin row so that pivoting does not mistake it for a small one
                hold = 1.0
                if cell and line.spin[i]:
                    hold += abs(dot(d, add(bn, a))) + abs(An[0]) + abs(Bn[0]) + abs(A[0]) + abs(A[4]) + abs(A[8])
                    hold += abs(Bn[4]) + abs(Bn[8])
                    if bits & ROTARY:
                        hold += line.polar[i] * ca
                W[WIDTH + 11], W[2 * WIDTH + 12], W[3 * WIDTH + 13] = hold, hold, hold
                rhs = scale(hold, rhs)
            else:
                put(W, 1, 1, pNm, 1.0)
                put(W, 1, 6, madd(pNm, G1), -1.0)
                put(W, 1, 11, Dii, 1.0)
                put(W, 1, 16, msub(G2, Np), 1.0)
                put(W, 1, 20, Np, 1.0)
                for j in range(3):
                    o = (j + 1) * WIDTH
                    W[o + 4] = -pnm[j]
                    W[o + 9] = nm[j] - pn0[j]
                    W[o + 10] = -d_before[j]
                    W[o + 14] = n0[j] - pnp[j]
                    W[o + 15] = d[j]
                    W[o + 19] = npl[j]
            W[WIDTH + 23], W[2 * WIDTH + 23], W[3 * WIDTH + 23] = rhs
            o = 4 * WIDTH
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
                    W[o + 6 + j] = -sm[j]
                    W[o + 11 + j] = sm[j] - s0[j]
                    W[o + 16 + j] = s0[j] - sp[j]
                    W[o + 20 + j] = sp[j]
                W[o + 9] = dot(d, b)
                W[o + 14] = -dot(d, add(bn, a)) - inertia + soft
                W[o + 19] = dot(d, an)
                W[o + 23] = -residual
            else:
                W[o + 14] = 1.0
            if rows.shape[0] > 0:
                for j in range(SIZE * WIDTH):
                    rows[i, j] = W[j]
        if wide:
            for j in range(6, 14):
                W[j] *= size
            W[23] *= size
            good = eliminate_wide(W, X, i, kept, size)
        else:
            sized = (size * row_before[0], size * row_before[1], size * row_before[2])
            hck_sized, gap_sized = size * hck_before, size * gap_before
            if held:
                one = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
                good = eliminate_narrow(sized, hck_sized, gap_sized, Z3, Z9, one, Z3, Z9, rhs, X, i, kept, size)
            else:
                back = scale(-1.0, d_before)
                good = eliminate_narrow(
                    sized, hck_sized, gap_sized, back, mscale(-1.0, G1), Dii, d, G2, rhs, X, i, kept, size
                )
        if not good:
            return i
        kept += next_kept

        # --- step along s
        if i == n - 1:
            report[MOMENT_B], report[MOMENT_B + 1], report[MOMENT_B + 2] = Mn
        d_before, l_before, il_before = d, l, il
        row_before, hck_before, gap_before = row, hck, gap
        np_, pNm, pnm, pN0, pn0, pNp, pnp = nc, Nm, nm, N0, n0, Np, npl
        d, l, il, d1, D1, e1, Ra = dn, lnx, iln, d1n, D1n, e1n, Rn
        A, a, B, b, M = An, an, Bn, bn, Mn
        wide_before = bent
    return -1


def workspace(n_cells: int, keep: bool = False):
    """Arrays the march needs: W, X (with room for the factors, if kept), x, report, and an empty `rows` and `gaps`."""
    return (
        np.zeros(SIZE * WIDTH),
        np.zeros((n_cells + 1) * (ROW + KEPT if keep else ROW)),
        np.zeros((n_cells + 1, SIZE)),
        np.zeros(REPORT_SIZE),
        np.zeros((0, SIZE * WIDTH)),
        np.zeros(0),
    )
