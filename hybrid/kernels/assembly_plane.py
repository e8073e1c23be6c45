"""The march along s for a cable in a plane: three unknowns per node instead of five, and no rotations of space.

Block i has the tension of the cell before node i (dT_{i-1}) and the node's two components in the plane; its rows are
the length of that cell and the balance of the node.  After elimination

    x_i = X_i[5] - X_i[0..2] x_{i+1} - X_i[3..4] dr_{i+2}

with X_i in three rows of six numbers.  States, ends and sea stay what they are, vectors of space: their components
across the plane are neither read nor written.  Symbols as in kernels.plane; docs/theory.md, 5.
"""

from __future__ import annotations

import math

from hybrid.kernels.block_elimination import first_gone, fourth_gone, second_gone, third_gone
from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.forces import ROTARY, STIFFNESS_DAMPING
from hybrid.kernels.node_forces_plane import loads2
from hybrid.kernels.plane import (
    about_normal,
    across2,
    angle_between,
    chord2,
    dot2,
    madd2,
    mscale2,
    msub2,
    outer2,
    part2,
    rotary2,
    spread2,
    turning2,
)
from hybrid.kernels.report import (
    ASSEMBLED,
    FORCE_A,
    FORCE_B,
    MOMENT_A,
    MOMENT_B,
    RESIDUAL,
    RESIDUAL_NODE,
    STIFFNESS_DAMPING_POWER,
)

COLUMNS = 6  # of a row of X_i
TRIPLE = 3 * COLUMNS  # numbers of X_i
WIDE = 13  # of a block row before elimination (keep_rows)
Z2 = (0.0, 0.0)
Z4 = (0.0, 0.0, 0.0, 0.0)


@inner
def end_chord(plane, frame, k):
    """The direction that the frame of end k prescribes, in the plane."""
    x, y, z = frame[k, 2], frame[k, 5], frame[k, 8]
    return (
        plane[0, 0] * x + plane[0, 1] * y + plane[0, 2] * z,
        plane[1, 0] * x + plane[1, 1] * y + plane[1, 2] * z,
    )


@inner
def less2(l, t, X, p):
    """(l, t) . (dr, dT rows of the block of X at p): what it takes from dT, dr, the next dr, the right-hand side."""
    a, b, c = p + COLUMNS, p + 2 * COLUMNS, p
    return (
        l[0] * X[a] + l[1] * X[b] + t * X[c],
        l[0] * X[a + 1] + l[1] * X[b + 1] + t * X[c + 1],
        l[0] * X[a + 2] + l[1] * X[b + 2] + t * X[c + 2],
        l[0] * X[a + 3] + l[1] * X[b + 3] + t * X[c + 3],
        l[0] * X[a + 4] + l[1] * X[b + 4] + t * X[c + 4],
        l[0] * X[a + 5] + l[1] * X[b + 5] + t * X[c + 5],
    )


@inner
def back_by_two(l, X, p):
    """l . (dr rows of the block of X at p), as `less2` without its tension."""
    a, b = p + COLUMNS, p + 2 * COLUMNS
    return (
        l[0] * X[a] + l[1] * X[b],
        l[0] * X[a + 1] + l[1] * X[b + 1],
        l[0] * X[a + 2] + l[1] * X[b + 2],
        l[0] * X[a + 3] + l[1] * X[b + 3],
        l[0] * X[a + 4] + l[1] * X[b + 4],
        l[0] * X[a + 5] + l[1] * X[b + 5],
    )


@inner
def eliminate2(row, hck, gap, K, L, back, D, ahead, U, V, b, X, i):
    """Eliminate the block of node i; False when it is singular.

    length   row.(dr_i - dr_{i-1}) - hck dT_{i-1} = gap
    balance  K dr_{i-2} + L dr_{i-1} + back dT_{i-1} + D dr_i + ahead dT_i + U dr_{i+1} + V dr_{i+2} = b
    """
    t1, t2 = 0.0, 0.0
    L1, L2, D1, D2, b1, b2 = (L[0], L[1]), (L[2], L[3]), (D[0], D[1]), (D[2], D[3]), b[0], b[1]
    if i >= 2:
        p = (i - 2) * TRIPLE
        x, y = back_by_two((K[0], K[1]), X, p), back_by_two((K[2], K[3]), X, p)
        t1, L1, D1, b1 = -x[0], (L1[0] - x[1], L1[1] - x[2]), (D1[0] - x[3], D1[1] - x[4]), b1 - x[5]
        t2, L2, D2, b2 = -y[0], (L2[0] - y[1], L2[1] - y[2]), (D2[0] - y[3], D2[1] - y[4]), b2 - y[5]
    x = y = z = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if i >= 1:
        p = (i - 1) * TRIPLE
        x, y, z = less2((-row[0], -row[1]), 0.0, X, p), less2(L1, t1, X, p), less2(L2, t2, X, p)
    # rows of dT_{i-1}, dr_i | dT_i, dr_{i+1}, dr_{i+2} | right-hand side
    B0 = (-hck - x[0], row[0] - x[1], row[1] - x[2], 0.0, -x[3], -x[4], 0.0, 0.0, gap - x[5])
    B1 = (back[0] - y[0], D1[0] - y[1], D1[1] - y[2], ahead[0], U[0] - y[3], U[1] - y[4], V[0], V[1], b1 - y[5])
    B2 = (back[1] - z[0], D2[0] - z[1], D2[1] - z[2], ahead[1], U[2] - z[3], U[3] - z[4], V[2], V[3], b2 - z[5])
    # Gauss-Jordan in registers; a pivot of zero makes everything infinite or NaN, which is seen at the end
    if abs(B1[0]) > abs(B0[0]):
        B0, B1 = B1, B0
    if abs(B2[0]) > abs(B0[0]):
        B0, B2 = B2, B0
    f = 1.0 / B0[0]
    C0 = (f * B0[1], f * B0[2], f * B0[3], f * B0[4], f * B0[5], f * B0[6], f * B0[7], f * B0[8])
    C1, C2 = first_gone(B1, C0), first_gone(B2, C0)
    if abs(C2[0]) > abs(C1[0]):
        C1, C2 = C2, C1
    f = 1.0 / C1[0]
    E1 = (f * C1[1], f * C1[2], f * C1[3], f * C1[4], f * C1[5], f * C1[6], f * C1[7])
    E0, E2 = second_gone(C0, E1), second_gone(C2, E1)
    f = 1.0 / E2[0]
    F2 = (f * E2[1], f * E2[2], f * E2[3], f * E2[4], f * E2[5], f * E2[6])
    F0, F1 = third_gone(E0, F2), third_gone(E1, F2)
    o = i * TRIPLE
    for k in range(COLUMNS):
        X[o + k], X[o + COLUMNS + k], X[o + 2 * COLUMNS + k] = F0[k], F1[k], F2[k]
    return abs(F0[5]) + abs(F1[5]) + abs(F2[5]) < math.inf


@inner
def less_chain(A, m, X, p, q):
    """A - m . (rows of dr_{i-1} in X), over dT_{i-1}, dr_i and the right-hand side."""
    return (
        A[0] - m[0] * X[p] - m[1] * X[q],
        A[1] - m[0] * X[p + 1] - m[1] * X[q + 1],
        A[2] - m[0] * X[p + 2] - m[1] * X[q + 2],
        A[3] - m[0] * X[p + 5] - m[1] * X[q + 5],
    )


@inner
def eliminate_chain(row, hck, gap, L, back, D, ahead, U, b, X, i):
    """As `eliminate2` where nothing bends: X_i keeps zeros for dr_{i+2}."""
    B0 = (-hck, row[0], row[1], gap)
    B1 = (back[0], D[0], D[1], b[0])
    B2 = (back[1], D[2], D[3], b[1])
    if i >= 1:
        p = (i - 1) * TRIPLE + COLUMNS
        q = p + COLUMNS
        B0 = less_chain(B0, (-row[0], -row[1]), X, p, q)
        B1 = less_chain(B1, (L[0], L[1]), X, p, q)
        B2 = less_chain(B2, (L[2], L[3]), X, p, q)
    G0 = (B0[0], B0[1], B0[2], 0.0, 0.0, 0.0, B0[3])
    G1 = (B1[0], B1[1], B1[2], ahead[0], U[0], U[1], B1[3])
    G2 = (B2[0], B2[1], B2[2], ahead[1], U[2], U[3], B2[3])
    if abs(G1[0]) > abs(G0[0]):
        G0, G1 = G1, G0
    if abs(G2[0]) > abs(G0[0]):
        G0, G2 = G2, G0
    f = 1.0 / G0[0]
    C0 = (f * G0[1], f * G0[2], f * G0[3], f * G0[4], f * G0[5], f * G0[6])
    C1, C2 = third_gone(G1, C0), third_gone(G2, C0)
    if abs(C2[0]) > abs(C1[0]):
        C1, C2 = C2, C1
    f = 1.0 / C1[0]
    E1 = (f * C1[1], f * C1[2], f * C1[3], f * C1[4], f * C1[5])
    E0, E2 = fourth_gone(C0, E1), fourth_gone(C2, E1)
    f = 1.0 / E2[0]
    F2 = (f * E2[1], f * E2[2], f * E2[3], f * E2[4])
    a, c = E0[0], E1[0]
    F0 = (E0[1] - a * F2[0], E0[2] - a * F2[1], E0[3] - a * F2[2], E0[4] - a * F2[3])
    F1 = (E1[1] - c * F2[0], E1[2] - c * F2[1], E1[3] - c * F2[2], E1[4] - c * F2[3])
    o = i * TRIPLE
    for F in (F0, F1, F2):
        X[o], X[o + 1], X[o + 2], X[o + 3], X[o + 4], X[o + 5] = F[0], F[1], F[2], 0.0, 0.0, F[3]
        o += COLUMNS
    return abs(F0[3]) + abs(F1[3]) + abs(F2[3]) < math.inf


@kernel
def march_planar(line, sea, ends, e, u, r, v, vd, T, a1, cv, ca, X, report, rows):
    """Assemble and eliminate all block rows of a cable in the plane `line.plane`; arguments, report as of kernels.assembly.

    Returns -1, or the node whose block was singular.  `rows` with N+1 entries receives every block row before
    elimination, three rows of WIDE (for tests); with none it is not touched.
    """
    n = e.shape[0]
    bits, plane = line.bits, line.plane
    damped = bits & STIFFNESS_DAMPING
    moving = bits & (ROTARY | STIFFNESS_DAMPING)
    for j in range(ASSEMBLED):
        report[j] = 0.0
    report[RESIDUAL_NODE] = -1.0

    # the first chord, and the element at the start: moment M about n, and how it answers to the chord after it (A)
    # and before it (B): dM = A.de_i - B.de_{i-1}
    d, l, il = chord2(part2(plane, e, 0))
    vi, vdi, vo, vdo = part2(plane, v, 0), part2(plane, vd, 0), part2(plane, v, 1), part2(plane, vd, 1)
    g, turn, g1, tau = (-il * d[1], il * d[0]), 0.0, Z2, 0.0
    if moving:
        turn, g1 = turning2(d, il, (vo[0] - vi[0], vo[1] - vi[1]), cv)
    if damped:
        tau = line.tau[0]
    M, A, B = -across2(plane, ends.moment, 0), Z2, Z2
    if line.element[0]:
        k, k0 = about_normal(plane, a1, 0, d, line.kb, line.k0, 0)
        rate = turn - across2(plane, ends.spin, 0) if damped else 0.0
        M = k * (angle_between(end_chord(plane, ends.frame, 0), d) - k0 + tau * rate)
        A = (k * (g[0] + tau * g1[0]), k * (g[1] + tau * g1[1]))
        report[STIFFNESS_DAMPING_POWER] += k * tau * rate * rate
    report[MOMENT_A], report[MOMENT_A + 1], report[MOMENT_A + 2] = M * plane[2, 0], M * plane[2, 1], M * plane[2, 2]

    force, pNm, pN0, pNp = Z2, Z4, Z4, Z4  # force of cell i-1 and its derivatives
    wide_before = False
    d_before, l_before, il_before = Z2, 0.0, 0.0
    row_before, hck_before, gap_before = Z2, -1.0, 0.0  # there is no cell before the start: dT = 0
    for i in range(n + 1):
        # --- unpack: chord of cell i+1, element at node i+1
        cell = i < n
        bent = cell and (line.element[i] or line.element[i + 1] or line.spin[i])
        dn, ln, iln, vn, vdn = Z2, 0.0, 0.0, Z2, Z2
        gn, turn_n, g1n, tau_n = Z2, 0.0, Z2, 0.0
        Mn, An, Bn = 0.0, Z2, Z2
        if i + 1 < n:
            dn, ln, iln = chord2(part2(plane, e, i + 1))
            vn, vdn = part2(plane, v, i + 2), part2(plane, vd, i + 2)
            gn = (-iln * dn[1], iln * dn[0])
            if moving:
                turn_n, g1n = turning2(dn, iln, (vn[0] - vo[0], vn[1] - vo[1]), cv)
            if damped:
                tau_n = line.tau[i + 1]
        elif cell:
            Mn = across2(plane, ends.moment, 1)
        if cell and line.element[i + 1]:
            k, k0 = about_normal(plane, a1, i, d, line.kb, line.k0, i + 1)
            after, late, rate = dn, 0.5 * (tau + tau_n), turn_n - turn
            if i + 1 == n:
                after, late = end_chord(plane, ends.frame, 1), tau
                rate = across2(plane, ends.spin, 1) - turn
            Mn = angle_between(d, after) - k0
            if damped:
                Mn += late * rate
                report[STIFFNESS_DAMPING_POWER] += k * late * rate * rate
            Mn *= k
            Bn = (k * (g[0] + late * g1[0]), k * (g[1] + late * g1[1]))
            if i + 1 < n:
                An = (k * (gn[0] + late * g1n[0]), k * (gn[1] + late * g1n[1]))

        # --- law: force of cell i and its derivatives
        nc, Nm, N0, Np = Z2, Z4, Z4, Z4
        row, hck, gap = Z2, 1.0, 0.0
        if cell:
            h, m = line.h[i], (-d[1], d[0])
            nc, N0 = (T[i] * d[0], T[i] * d[1]), outer2(T[i] * il, m, m)
            hck = h * line.ck[i]
            row, gap = d, hck * T[i] - (l * l - h * h) / (l + h)
            e1 = (vo[0] - vi[0], vo[1] - vi[1])
            if damped and hck > 0.0:  # what does not stretch has no rate of stretching to damp
                x, y, along = 1.0 + tau * cv, tau * turn, dot2(d, e1)
                row, gap = (x * d[0] + y * m[0], x * d[1] + y * m[1]), gap - tau * along
                report[STIFFNESS_DAMPING_POWER] += tau * along * along / hck
            if bent:
                # shear -m Q/l, whose Q answers to the chords of cells i-1, i, i+1
                x = il * (Mn - M)
                nc = (nc[0] - x * m[0], nc[1] - x * m[1])
                y = il * x
                N0 = madd2(N0, (-2.0 * y * d[0] * d[1], y * (d[0] * d[0] - d[1] * d[1]),
                                y * (d[0] * d[0] - d[1] * d[1]), 2.0 * y * d[0] * d[1]))  # fmt: skip
                N0 = madd2(N0, outer2(il, m, (Bn[0] + A[0], Bn[1] + A[1])))
                Nm, Np = outer2(-il, m, B), outer2(-il, m, An)
                if bits & ROTARY:
                    e2 = (vdo[0] - vdi[0], vdo[1] - vdi[1])
                    f, Df = rotary2(d, il, e1, e2, turn, line.rotary[i], cv, ca)
                    nc, N0 = (nc[0] + f[0], nc[1] + f[1]), madd2(N0, Df)

        # --- balance: residual F of node i and its row
        F, D, GL, GR = loads2(
            line, sea, i, r, u, e, v, vi, vdi, d_before, l_before, il_before, d, l, il, i > 0, cell, cv, ca, report
        )
        F = (F[0] + nc[0] - force[0], F[1] + nc[1] - force[1])
        held = (i == 0 and ends.held[0]) or (i == n and ends.held[1])
        if i == 0:
            f = part2(plane, ends.force, 0)
            F = (F[0] + f[0], F[1] + f[1])
            report[FORCE_A], report[FORCE_A + 1], report[FORCE_A + 2] = spread2(plane, F)
        if i == n:
            f = part2(plane, ends.force, 1)
            F = (F[0] + f[0], F[1] + f[1])
            report[FORCE_B], report[FORCE_B + 1], report[FORCE_B + 2] = spread2(plane, F)
        if not held:
            big = max(abs(F[0]), abs(F[1]))
            if not big <= report[RESIDUAL]:
                report[RESIDUAL], report[RESIDUAL_NODE] = big, i
        G1, G2 = madd2(msub2(Nm, pN0), GL), madd2(msub2(N0, pNp), GR)
        Dii = madd2(msub2(G1, G2), D)
        rhs = (-F[0], -F[1])

        # --- pack, and eliminate at once
        K, L, U, V = pNm, mscale2(-1.0, madd2(pNm, G1)), msub2(G2, Np), Np
        back, ahead = (-d_before[0], -d_before[1]), d
        size = abs(Dii[0]) + abs(Dii[3])  # lengths in the unit of the balance, so that pivoting compares like with like
        if held:
            x, y = part2(plane, ends.position, 0 if i == 0 else 1), part2(plane, r, i)
            f = part2(plane, u, i)
            K, L, U, V, Dii, back, ahead = Z4, Z4, Z4, Z4, (1.0, 0.0, 0.0, 1.0), Z2, Z2
            rhs = (x[0] - y[0] - f[0], x[1] - y[1] - f[1])
            size = 1.0
        if not size > 0.0:
            size = 1.0
        if rows.shape[0] > 0:
            keep_rows(rows, i, row_before, hck_before, gap_before, K, L, back, Dii, ahead, U, V, rhs)
        sized, hck_sized, gap_sized = (size * row_before[0], size * row_before[1]), size * hck_before, size * gap_before
        if bent or wide_before:
            good = eliminate2(sized, hck_sized, gap_sized, K, L, back, Dii, ahead, U, V, rhs, X, i)
        else:
            good = eliminate_chain(sized, hck_sized, gap_sized, L, back, Dii, ahead, U, rhs, X, i)
        if not good:
            return i

        # --- step along s
        if i == n - 1:
            report[MOMENT_B], report[MOMENT_B + 1], report[MOMENT_B + 2] = (
                Mn * plane[2, 0],
                Mn * plane[2, 1],
                Mn * plane[2, 2],
            )
        d_before, l_before, il_before = d, l, il
        row_before, hck_before, gap_before = row, hck, gap
        force, pNm, pN0, pNp = nc, Nm, N0, Np
        d, l, il, g, turn, g1, tau = dn, ln, iln, gn, turn_n, g1n, tau_n
        vi, vdi, vo, vdo = vo, vdo, vn, vdn
        A, B, M = An, Bn, Mn
        wide_before = bent
    return -1


@inner
def keep_rows(rows, i, row, hck, gap, K, L, back, D, ahead, U, V, b):
    """The block row of node i: columns dr_{i-2}, dr_{i-1}, dT_{i-1}, dr_i, dT_i, dr_{i+1}, dr_{i+2}, right side."""
    for j in range(3 * WIDE):
        rows[i, j] = 0.0
    rows[i, 2], rows[i, 3], rows[i, 4], rows[i, 5], rows[i, 6] = -row[0], -row[1], -hck, row[0], row[1]
    rows[i, 12] = gap
    for j in range(2):
        o = (j + 1) * WIDE
        k = 2 * j
        rows[i, o], rows[i, o + 1], rows[i, o + 2], rows[i, o + 3] = K[k], K[k + 1], L[k], L[k + 1]
        rows[i, o + 4], rows[i, o + 5], rows[i, o + 6], rows[i, o + 7] = back[j], D[k], D[k + 1], ahead[j]
        rows[i, o + 8], rows[i, o + 9], rows[i, o + 10], rows[i, o + 11] = U[k], U[k + 1], V[k], V[k + 1]
        rows[i, o + 12] = b[j]


@kernel
def substitute_planar(plane, X, x):
    """Solve back from the end: x (N+1, 5) receives dT, dr (in space) and no spin; False if one is not finite."""
    n = x.shape[0] - 1
    y = (0.0, 0.0, 0.0)
    z = (0.0, 0.0)
    total = 0.0
    for i in range(n, -1, -1):
        p = i * TRIPLE
        q, s = p + COLUMNS, p + 2 * COLUMNS
        t = X[p + 5] - X[p] * y[0] - X[p + 1] * y[1] - X[p + 2] * y[2] - X[p + 3] * z[0] - X[p + 4] * z[1]
        a = X[q + 5] - X[q] * y[0] - X[q + 1] * y[1] - X[q + 2] * y[2] - X[q + 3] * z[0] - X[q + 4] * z[1]
        b = X[s + 5] - X[s] * y[0] - X[s + 1] * y[1] - X[s + 2] * y[2] - X[s + 3] * z[0] - X[s + 4] * z[1]
        total += abs(t) + abs(a) + abs(b)
        x[i, 0], x[i, 4] = t, 0.0
        x[i, 1], x[i, 2], x[i, 3] = spread2(plane, (a, b))
        y, z = (t, a, b), (y[1], y[2])
    return total < math.inf


@inner
def carried(plane, a, d, dn):
    """Director a (normal to the chord d of space) when the chord turns within the plane to dn, in the plane."""
    x = plane[2, 0] * a[0] + plane[2, 1] * a[1] + plane[2, 2] * a[2]
    m = spread2(plane, (-d[1], d[0]))
    y = a[0] * m[0] + a[1] * m[1] + a[2] * m[2]
    m = spread2(plane, (-dn[1], dn[0]))
    return (x * plane[2, 0] + y * m[0], x * plane[2, 1] + y * m[1], x * plane[2, 2] + y * m[2])


@kernel
def update_planar(line, e, u, v, vd, T, a1, x, cv, ca, part):
    """Apply `part` of the correction x to everything that depends on it, as kernels.newton.update does in space."""
    n = e.shape[0]
    plane = line.plane
    for i in range(n):
        T[i] += part * x[i + 1, 0]
        d = Z2
        if line.spin[i]:
            d, _, _ = chord2(part2(plane, e, i))
        for k in range(3):
            e[i, k] += part * (x[i + 1, k + 1] - x[i, k + 1])
        if line.spin[i]:
            dn, _, _ = chord2(part2(plane, e, i))
            a1[i, 0], a1[i, 1], a1[i, 2] = carried(plane, (a1[i, 0], a1[i, 1], a1[i, 2]), d, dn)
    for i in range(n + 1):
        for k in range(3):
            dr = part * x[i, k + 1]
            u[i, k] += dr
            v[i, k] += cv * dr
            vd[i, k] += ca * dr


@kernel
def sharpest_planar(line, ends, e, T, clamp):
    """As kernels.newton.sharpest for a cable in a plane: largest bend and its node; there is no twist."""
    bend, at = 0.0, -1
    plane = line.plane
    n = e.shape[0]
    d, l, _ = chord2(part2(plane, e, 0))
    for i in range(n + 1):
        before = d if i > 0 else end_chord(plane, ends.frame, 0)
        here = l
        if 0 < i < n:
            d, l, _ = chord2(part2(plane, e, i))
        if not line.element[i]:
            continue
        x = abs(angle_between(before, d if i < n else end_chord(plane, ends.frame, 1)))
        if i == 0 or i == n:
            c = min(i, n - 1)
            stiffness = max(line.kb[i, 0], line.kb[i, 1]) * line.hn[i]
            weight = 2.0
            if T[c] > 0.0 and here * here * T[c] > stiffness:
                weight = clamp * here * math.sqrt(T[c] / stiffness)
            x *= weight
        if not x <= bend:
            bend, at = x, i
    return bend, at, 0.0, -1
