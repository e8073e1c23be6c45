"""The march along s for a cable in a plane: three unknowns per node instead of five, and no rotations of space.

Block i has the tension of the cell before node i (dT_{i-1}) and the node's two components in the plane; its rows are
the length of that cell and the balance of the node.  After elimination

    x_i = X_i[5] - X_i[0..2] x_{i+1} - X_i[3..4] dr_{i+2}

with X_i in three rows of six numbers.  States, ends and sea stay what they are, vectors of space: their components
across the plane are neither read nor written.  Symbols as in physics.plane; docs/theory.md, 5.
"""

from __future__ import annotations

import math

from hybrid.compiled import inner, kernel
from hybrid.physics.loads import (
    ADDED_MASS,
    BODIES,
    DRAG,
    FLOW,
    FRICTION,
    MASS_DAMPING,
    ROTARY,
    SEABED,
    STIFFNESS_DAMPING,
    SURFACE,
    WAVES,
)
from hybrid.physics.plane import (
    about_normal,
    across2,
    added_mass2,
    angle_between,
    body_drag2,
    chord2,
    dot2,
    drag2,
    friction2,
    madd2,
    mscale2,
    msub2,
    outer2,
    part2,
    rotary2,
    spread2,
    turning2,
)
from hybrid.physics.seabed import contact, pressure
from hybrid.physics.water import current_at, wetted, wetted_stretch
from hybrid.solve.blocks import first_gone, fourth_gone, second_gone, third_gone

WATER = DRAG | ADDED_MASS | SURFACE | WAVES | BODIES
REPORTED = 22  # numbers of the report that are the march's (solve.march)
COLUMNS = 6  # of a row of X_i
TRIPLE = 3 * COLUMNS  # numbers of X_i
WIDE = 13  # of a block row before elimination (keep_rows)
Z2 = (0.0, 0.0)
Z4 = (0.0, 0.0, 0.0, 0.0)


@inner
def half_cell_water2(line, c, side, up, z, eta, u, U1, vi, b, af, d, l, il, cv, ca, report):
    """Force of the water on the half cell c before (side -1) or after (+1) a node: f, D (dr_i), L (chord)."""
    bits = line.bits
    f, D, L = Z2, Z4, Z4
    if bits & DRAG:
        f, B, L = drag2(u, d, il, line.drag_n[c], line.drag_t[c])
        D = mscale2(cv, B)
        if bits & FLOW:
            D = msub2(D, outer2(1.0, (B[0] * U1[0] + B[1] * U1[1], B[2] * U1[0] + B[3] * U1[1]), up))
    drag = dot2(f, vi)
    added = 0.0
    if bits & ADDED_MASS:
        g, Dg, Lg = added_mass2(b, d, il, line.added_n[c], line.added_t[c], ca)
        f, D, L = (f[0] + g[0], f[1] + g[1]), madd2(D, Dg), madd2(L, Lg)
        added = dot2(g, vi)
    pushed = 0.0
    if bits & WAVES:
        x = line.displaced[c]
        f = (f[0] + x * af[0], f[1] + x * af[1])
        pushed = x * dot2(af, vi)
    wet = 1.0
    if bits & SURFACE:
        x = line.buoy[c]
        f = (f[0] + x * up[0], f[1] + x * up[1])
        pushed += x * dot2(up, vi)
        iD = 1.0 / line.diameter[c]
        xa = (eta - z) * iD + 0.5
        xb = xa - side * 0.5 * l * dot2(d, up) * iD
        wet, wa, wb = wetted_stretch(xa, xb)
        D = madd2(mscale2(wet, D), outer2(-(wa + wb) * iD, f, up))
        L = madd2(mscale2(wet, L), outer2(-side * 0.5 * wb * iD, f, up))
        f = (wet * f[0], wet * f[1])
    report[12] -= wet * drag
    report[17] -= wet * added
    report[18] += wet * pushed
    return f, D, L


@inner
def body_water2(line, i, up, z, eta, u, U1, vi, b, af, cv, ca, report):
    """Force of the water on a body at node i, and D."""
    bits = line.bits
    f, B = body_drag2(u, line.point_drag[i])
    D = mscale2(cv, B)
    if bits & FLOW:
        D = msub2(D, outer2(1.0, (B[0] * U1[0] + B[1] * U1[1], B[2] * U1[0] + B[3] * U1[1]), up))
    drag = dot2(f, vi)
    a = line.point_added[i]
    f = (f[0] - a * b[0], f[1] - a * b[1])
    D = (D[0] - ca * a, D[1], D[2], D[3] - ca * a)
    added, pushed, wet = -a * dot2(b, vi), 0.0, 1.0
    if bits & WAVES:
        x = line.point_displaced[i]
        f = (f[0] + x * af[0], f[1] + x * af[1])
        pushed = x * dot2(af, vi)
    if bits & SURFACE and line.point_height[i] > 0.0:
        x = line.point_buoy[i]
        f = (f[0] + x * up[0], f[1] + x * up[1])
        pushed += x * dot2(up, vi)
        iH = 1.0 / line.point_height[i]
        x = (eta - z) * iH + 0.5
        wet, _, slope = wetted(x)
        if line.point_upright[i]:
            wet, slope = min(max(x, 0.0), 1.0), 1.0 if 0.0 < x < 1.0 else 0.0
        D = madd2(mscale2(wet, D), outer2(-slope * iH, f, up))
        f = (wet * f[0], wet * f[1])
    report[12] -= wet * drag
    report[17] -= wet * added
    report[18] += wet * pushed
    return f, D


@inner
def seabed2(line, sea, i, r, u, v, e, left, right, cv, report):
    """Contact and friction at node i: F, D, GL, GR.  The bed's normal lies in the plane."""
    plane = line.plane
    n = (
        plane[0, 0] * sea.normal[0] + plane[0, 1] * sea.normal[1] + plane[0, 2] * sea.normal[2],
        plane[1, 0] * sea.normal[0] + plane[1, 1] * sea.normal[1] + plane[1, 2] * sea.normal[2],
    )
    p = sea.offset + 0.5 * sea.onset
    for k in range(3):
        p -= sea.normal[k] * (r[i, k] + u[i, k])
    pd = -dot2(n, part2(plane, v, i))
    N = DN = NL = NR = 0.0
    if left:
        po = p + dot2(n, part2(plane, e, i - 1))
        if p > 0.0 or po > 0.0:
            vo, h = -dot2(n, part2(plane, v, i - 1)), line.h[i - 1]
            f, f0, f1, g0, g1 = contact(p, po, pd, vo, h, sea.stiffness, sea.damping, sea.onset)
            N, NL, DN = N + f, f1 + cv * g1, DN + f0 + cv * g0
    if right:
        po = p - dot2(n, part2(plane, e, i))
        if p > 0.0 or po > 0.0:
            vo, h = -dot2(n, part2(plane, v, i + 1)), line.h[i]
            f, f0, f1, g0, g1 = contact(p, po, pd, vo, h, sea.stiffness, sea.damping, sea.onset)
            N, NR, DN = N + f, f1 + cv * g1, DN + f0 + cv * g0
    if line.footing[i] > 0.0 and p > 0.0:
        f, f0, g0 = pressure(0.0, p, p, pd, pd, sea.stiffness, sea.damping, sea.onset)
        N, DN = N + line.footing[i] * f, DN + line.footing[i] * (f0 + cv * g0)
    F, slope, q = (N * n[0], N * n[1]), n, Z2
    D = Z4
    report[21] += N
    if line.bits & FRICTION and N > 0.0:
        ui, slip = part2(plane, u, i), part2(plane, sea.slip, i)
        w = dot2(n, ui)
        q = (slip[0] + ui[0] - w * n[0], slip[1] + ui[1] - w * n[1])
        f, g, D, kept = friction2(q, N, part2(plane, sea.axis, i), sea.friction[0], sea.slip_length)
        F, slope, q = (F[0] + f[0], F[1] + f[1]), (n[0] + g[0], n[1] + g[1]), (kept * q[0], kept * q[1])
    sea.slid[i, 0], sea.slid[i, 1], sea.slid[i, 2] = spread2(plane, q)
    sea.bed[i, 0], sea.bed[i, 1], sea.bed[i, 2] = spread2(plane, F)
    S = outer2(1.0, slope, n)
    return F, madd2(D, mscale2(-(DN + NL + NR), S)), mscale2(NL, S), mscale2(-NR, S)


@inner
def loads2(line, sea, i, r, u, e, v, vi, vdi, dl, ll, ill, dr, lr, ilr, left, right, cv, ca, report):
    """Force on node i but for the cells' own: F, and its derivatives D (dr_i), GL, GR (chord before, after)."""
    bits, plane = line.bits, line.plane
    m = line.mass[i]
    F = part2(plane, line.force, i)
    F = (F[0] - m * vdi[0], F[1] - m * vdi[1])
    c = -ca * m
    if bits & MASS_DAMPING:
        b = line.damp[i]
        F = (F[0] - b * vi[0], F[1] - b * vi[1])
        c -= cv * b
        report[13] += b * dot2(vi, vi)
    D, GL, GR = (c, 0.0, 0.0, c), Z4, Z4
    if bits & WATER:
        up = (plane[0, 2], plane[1, 2])
        z, eta = r[i, 2] + u[i, 2], sea.surface
        U1, w, b, af = Z2, vi, vdi, Z2
        if bits & FLOW:
            U, S = current_at(sea.z, sea.current, sea.now[1], z)
            w = (
                w[0] - plane[0, 0] * U[0] - plane[0, 1] * U[1] - plane[0, 2] * U[2],
                w[1] - plane[1, 0] * U[0] - plane[1, 1] * U[1] - plane[1, 2] * U[2],
            )
            U1 = (
                plane[0, 0] * S[0] + plane[0, 1] * S[1] + plane[0, 2] * S[2],
                plane[1, 0] * S[0] + plane[1, 1] * S[1] + plane[1, 2] * S[2],
            )
        if bits & WAVES:
            U, A = part2(plane, sea.flow, i), (sea.flow[i, 3], sea.flow[i, 4], sea.flow[i, 5])
            af = (
                plane[0, 0] * A[0] + plane[0, 1] * A[1] + plane[0, 2] * A[2],
                plane[1, 0] * A[0] + plane[1, 1] * A[1] + plane[1, 2] * A[2],
            )
            w, b = (w[0] - U[0], w[1] - U[1]), (b[0] - af[0], b[1] - af[1])
            eta += sea.flow[i, 6]
        if left:
            f, Df, GL = half_cell_water2(line, i - 1, -1.0, up, z, eta, w, U1, vi, b, af, dl, ll, ill, cv, ca, report)
            F, D = (F[0] + f[0], F[1] + f[1]), madd2(D, Df)
        if right:
            f, Df, GR = half_cell_water2(line, i, 1.0, up, z, eta, w, U1, vi, b, af, dr, lr, ilr, cv, ca, report)
            F, D = (F[0] + f[0], F[1] + f[1]), madd2(D, Df)
        if bits & BODIES:
            f, Df = body_water2(line, i, up, z, eta, w, U1, vi, b, af, cv, ca, report)
            F, D = (F[0] + f[0], F[1] + f[1]), madd2(D, Df)
    if bits & SEABED:
        f, Df, L, R = seabed2(line, sea, i, r, u, v, e, left, right, cv, report)
        F, D, GL, GR = (F[0] + f[0], F[1] + f[1]), madd2(D, Df), madd2(GL, L), madd2(GR, R)
    return F, D, GL, GR


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
    """Assemble and eliminate all block rows of a cable in the plane `line.plane`; arguments, report as of solve.march.

    Returns -1, or the node whose block was singular.  `rows` with N+1 entries receives every block row before
    elimination, three rows of WIDE (for tests); with none it is not touched.
    """
    n = e.shape[0]
    bits, plane = line.bits, line.plane
    damped = bits & STIFFNESS_DAMPING
    moving = bits & (ROTARY | STIFFNESS_DAMPING)
    for j in range(REPORTED):
        report[j] = 0.0
    report[16] = -1.0

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
        report[14] += k * tau * rate * rate
    report[6], report[7], report[8] = M * plane[2, 0], M * plane[2, 1], M * plane[2, 2]

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
                report[14] += k * late * rate * rate
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
                report[14] += tau * along * along / hck
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
            report[0], report[1], report[2] = spread2(plane, F)
        if i == n:
            f = part2(plane, ends.force, 1)
            F = (F[0] + f[0], F[1] + f[1])
            report[3], report[4], report[5] = spread2(plane, F)
        if not held:
            big = max(abs(F[0]), abs(F[1]))
            if not big <= report[15]:
                report[15], report[16] = big, i
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
            report[9], report[10], report[11] = Mn * plane[2, 0], Mn * plane[2, 1], Mn * plane[2, 2]
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
    """Apply `part` of the correction x to everything that depends on it, as solve.step.update does in space."""
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
    """As solve.step.sharpest for a cable in a plane: largest bend and its node; there is no twist."""
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
