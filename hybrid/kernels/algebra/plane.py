"""The cable in a plane: its vectors and its block elimination.

The laws are those of kernels.laws (element, water, seabed) with two components, for a configuration that lies in the
plane of p and q; what is left of a rotation there is one angle.  Tests hold the two against each other.  One source for
both is slower: with the drag and added mass of space, called with a third component of zero, an iteration of 1000
catenary cells in a current takes 15 % more, one of rods 9 %.

    symbol   meaning                                              shape  unit     frame
    p, q, n  axes of the plane and its normal, p x q = n          3      -        inertial
    d, l, il direction of a chord, its length, 1/length           2, -   -, m     plane
    m        n x d, the chord turned by a right angle             2      -        plane
    g        derivative of the angle of a chord by e, m/l         2      1/m      plane
    turn, g1 rate of that angle, m.e1/l, and its derivative by e  -, 2   1/s..    about n, plane
    kappa    angle from the chord before a node to that after     -      rad      about n
    k        stiffness of the element against kappa               -      N m      about n
    u, b     velocity and acceleration relative to the water      2      m/s..    plane

Block rows have three unknowns per node instead of five.  Block i has the tension of the cell before node i (dT_{i-1})
and the node's two components in the plane; its rows are the length of that cell and the balance of the node.  After
elimination

    x_i = X_i[5] - X_i[0..2] x_{i+1} - X_i[3..4] dr_{i+2}

with X_i in three rows of six numbers.  Where there is room behind them, what another right-hand side with the same
matrix needs is kept (`solve_again_planar`): KEPT numbers a block, K, the rows over dT_{i-2}.. and dr_{i-1}, the pivot
block and the size of the law of length.  In space: kernels.algebra.block_elimination.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.block_elimination import eliminate6, eliminate7, eliminate8, solve_three
from hybrid.kernels.algebra.rotations import SMALL_SQUARE, arc_over_sine
from hybrid.kernels.machine.compile import inner, kernel


@inner
def dot2(a, b):
    return a[0] * b[0] + a[1] * b[1]


@inner
def outer2(x, a, b):
    """x a b^T, a matrix in row order."""
    return (x * a[0] * b[0], x * a[0] * b[1], x * a[1] * b[0], x * a[1] * b[1])


@inner
def madd2(A, B):
    return (A[0] + B[0], A[1] + B[1], A[2] + B[2], A[3] + B[3])


@inner
def msub2(A, B):
    return (A[0] - B[0], A[1] - B[1], A[2] - B[2], A[3] - B[3])


@inner
def mscale2(x, A):
    return (x * A[0], x * A[1], x * A[2], x * A[3])


@inner
def row_in_plane(plane, A, i):
    """The two components of row i of A that lie in the plane."""
    x, y, z = A[i, 0], A[i, 1], A[i, 2]
    return (
        plane[0, 0] * x + plane[0, 1] * y + plane[0, 2] * z,
        plane[1, 0] * x + plane[1, 1] * y + plane[1, 2] * z,
    )


@inner
def vector_in_plane(plane, a):
    """The two components of a vector of space that lie in the plane."""
    return (
        plane[0, 0] * a[0] + plane[0, 1] * a[1] + plane[0, 2] * a[2],
        plane[1, 0] * a[0] + plane[1, 1] * a[1] + plane[1, 2] * a[2],
    )


@inner
def row_along_normal(plane, A, i):
    """The component of row i of A along the normal."""
    return plane[2, 0] * A[i, 0] + plane[2, 1] * A[i, 1] + plane[2, 2] * A[i, 2]


@inner
def to_space(plane, a):
    """The vector of space that has the components a in the plane and none across it."""
    return (
        a[0] * plane[0, 0] + a[1] * plane[1, 0],
        a[0] * plane[0, 1] + a[1] * plane[1, 1],
        a[0] * plane[0, 2] + a[1] * plane[1, 2],
    )


@inner
def chord2(e):
    """d, l and 1/l of a chord."""
    l = math.sqrt(e[0] * e[0] + e[1] * e[1])
    il = 1.0 / l
    return (il * e[0], il * e[1]), l, il


@inner
def end_chord(plane, frame, k):
    """The direction that the frame of end k prescribes, in the plane."""
    x, y, z = frame[k, 2], frame[k, 5], frame[k, 8]
    return (
        plane[0, 0] * x + plane[0, 1] * y + plane[0, 2] * z,
        plane[1, 0] * x + plane[1, 1] * y + plane[1, 2] * z,
    )


@inner
def carried(plane, a, d, dn):
    """Director a (normal to the chord d of space) when the chord turns within the plane to dn, in the plane."""
    x = plane[2, 0] * a[0] + plane[2, 1] * a[1] + plane[2, 2] * a[2]
    m = to_space(plane, (-d[1], d[0]))
    y = a[0] * m[0] + a[1] * m[1] + a[2] * m[2]
    m = to_space(plane, (-dn[1], dn[0]))
    return (x * plane[2, 0] + y * m[0], x * plane[2, 1] + y * m[1], x * plane[2, 2] + y * m[2])


@inner
def angle_between(a, b):
    """Angle about n from direction a to direction b, between -pi and pi."""
    s, c = a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]
    x = s * s
    if c > 0.0 and x < SMALL_SQUARE:
        return s * arc_over_sine(x)
    return math.atan2(s, c)


@inner
def turning2(d, il, e1, cv):
    """Rate of the angle of a chord, and its derivative with respect to e (e1 follows e with the factor cv)."""
    m = (-d[1], d[0])
    along, turn = dot2(d, e1), il * dot2(m, e1)
    a, b = il * (cv - along * il), -il * turn
    return turn, (a * m[0] + b * d[0], a * m[1] + b * d[1])


@inner
def stiffness_about_normal(plane, a1, c, d, kb, k0, i):
    """Stiffness and stress-free angle of element i about n, for sections whose axes lie as in cell c with chord d.

    Sections that bend differently in two directions have one of them along n, or the scene is not planar.
    """
    m = to_space(plane, (-d[1], d[0]))
    y = a1[c, 0] * m[0] + a1[c, 1] * m[1] + a1[c, 2] * m[2]  # a1 = x n + y m, a2 = d x a1 = y n - x m
    x = row_along_normal(plane, a1, c)
    return kb[i, 0] * x * x + kb[i, 1] * y * y, k0[i, 0] * x + k0[i, 1] * y


@inner
def drag2(u, d, il, cn, ct):
    """Drag on a half cell, its derivatives by u and by e; f = -cn |v| v m - ct |w| w d, u = w d + v m."""
    m = (-d[1], d[0])
    w, v = dot2(u, d), dot2(u, m)
    a, b = abs(w), abs(v)
    f = (-cn * b * v * m[0] - ct * a * w * d[0], -cn * b * v * m[1] - ct * a * w * d[1])
    B = madd2(outer2(-2.0 * cn * b, m, m), outer2(-2.0 * ct * a, d, d))
    # by e: dd = m (m.de)/l, dm = -d (m.de)/l, dw = v (m.de)/l, dv = -w (m.de)/l
    x, y = 2.0 * cn * b * w - ct * a * w, cn * b * v - 2.0 * ct * a * v
    return f, B, outer2(il, (x * m[0] + y * d[0], x * m[1] + y * d[1]), m)


@inner
def added_mass2(b, d, il, an, at, ca):
    """Inertia of the water carried along: f = -an (b.m) m - at (b.d) d, D = ca df/db, and df/de."""
    m = (-d[1], d[0])
    t, s = dot2(b, d), dot2(b, m)
    f = (-an * s * m[0] - at * t * d[0], -an * s * m[1] - at * t * d[1])
    D = madd2(outer2(-ca * an, m, m), outer2(-ca * at, d, d))
    x, y = (an - at) * t, (an - at) * s
    return f, D, outer2(il, (x * m[0] + y * d[0], x * m[1] + y * d[1]), m)


@inner
def body_drag2(u, c):
    """Drag of a body without direction, f = -c |u| u, and df/du."""
    s = math.sqrt(dot2(u, u))
    p, q = -c * s, -c / s if s > 0.0 else 0.0
    return (p * u[0], p * u[1]), (p + q * u[0] * u[0], q * u[0] * u[1], q * u[1] * u[0], p + q * u[1] * u[1])


@inner
def friction2(travel, N, axis, mu, sl):
    """Friction along the bed after an elastic travel: force, df/dN, df/dq, and the part of the travel that is left."""
    a = dot2(travel, axis)
    size = abs(a)
    c, left, slope = 1.0 / sl, 1.0, 1.0
    if size > sl:
        c, left, slope = 1.0 / size, sl / size, 0.0
    g = -mu * c * a
    return (N * g * axis[0], N * g * axis[1]), (g * axis[0], g * axis[1]), outer2(-N * mu * c * slope, axis, axis), left


@inner
def rotary2(d, il, e1, e2, turn, J, cv, ca):
    """Force that turns the cross-sections, J d2/l across the chord, and its derivative with respect to e.

    d2.m is the acceleration of the angle, (m.e2 - 2 (d.e1) turn)/l; its part along d is the cell's own affair.
    """
    m = (-d[1], d[0])
    along, s = dot2(d, e1), dot2(d, e2)
    y = il * (dot2(m, e2) - 2.0 * along * turn)
    # d(turn) = (cv - along/l) (m.de)/l - turn (d.de)/l;  d(along) = cv (d.de) + turn (m.de);  d(m.e2) = ca m.de - s m.de/l
    by_m = il * (ca - s * il - 2.0 * turn * turn - 2.0 * along * (cv - along * il) * il)
    by_d = il * (-2.0 * cv * turn + 2.0 * along * turn * il - y)
    x = J * il
    f = (x * y * m[0], x * y * m[1])
    D = outer2(x, m, ((by_m * m[0] + (by_d - y * il) * d[0]), (by_m * m[1] + (by_d - y * il) * d[1])))
    return f, msub2(D, outer2(x * y * il, d, m))


COLUMNS = 6  # of a row of X_i
TRIPLE = 3 * COLUMNS  # numbers of X_i
WIDE = 13  # of a block row before elimination (kernels.march.assembly_plane)
KEPT = 23  # numbers kept of a block for another right-hand side; K comes first,
LOWER = 4  # then rows over the block before, three of (dT, dr),
PIVOT = 13  # the pivot block, three rows of three,
SIZE_AT = 22  # and the size of the law of length


@inner
def block_times(l, t, X, p):
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
def node_rows_times(l, X, p):
    """l . (dr rows of the block of X at p), as `block_times` without its tension."""
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
def keep(X, k, size, K, lower, pivot):
    """Keep at X[k:] what another right-hand side needs of a block; lower: of the balance, two rows over dT, dr before."""
    for j in range(4):
        X[k + j] = K[j]
    for j in range(6):
        X[k + LOWER + 3 + j] = lower[j]
    for j in range(9):
        X[k + PIVOT + j] = pivot[j]
    X[k + SIZE_AT] = size


@inner
def eliminate2(length, node, X, i, kept):
    """Eliminate the block of node i; False when it is singular.

    length: `Length` of the cell before it; node: its `Balance` (kernels.march.assembly_plane); kept: where its factors
    are kept in X, 0: nowhere.
    """
    row, hck, gap = length
    K, L, back, D, ahead, U, V, b, size = node
    t1, t2 = 0.0, 0.0
    L1, L2, D1, D2, b1, b2 = (L[0], L[1]), (L[2], L[3]), (D[0], D[1]), (D[2], D[3]), b[0], b[1]
    if i >= 2:
        p = (i - 2) * TRIPLE
        x, y = node_rows_times((K[0], K[1]), X, p), node_rows_times((K[2], K[3]), X, p)
        t1, L1, D1, b1 = -x[0], (L1[0] - x[1], L1[1] - x[2]), (D1[0] - x[3], D1[1] - x[4]), b1 - x[5]
        t2, L2, D2, b2 = -y[0], (L2[0] - y[1], L2[1] - y[2]), (D2[0] - y[3], D2[1] - y[4]), b2 - y[5]
    x = y = z = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if i >= 1:
        p = (i - 1) * TRIPLE
        x, y, z = block_times((-row[0], -row[1]), 0.0, X, p), block_times(L1, t1, X, p), block_times(L2, t2, X, p)
    # rows of dT_{i-1}, dr_i | dT_i, dr_{i+1}, dr_{i+2} | right-hand side
    B0 = (-hck - x[0], row[0] - x[1], row[1] - x[2], 0.0, -x[3], -x[4], 0.0, 0.0, gap - x[5])
    B1 = (back[0] - y[0], D1[0] - y[1], D1[1] - y[2], ahead[0], U[0] - y[3], U[1] - y[4], V[0], V[1], b1 - y[5])
    B2 = (back[1] - z[0], D2[0] - z[1], D2[1] - z[2], ahead[1], U[2] - z[3], U[3] - z[4], V[2], V[3], b2 - z[5])
    if kept > 0:
        X[kept + LOWER], X[kept + LOWER + 1], X[kept + LOWER + 2] = 0.0, -row[0], -row[1]
        pivot = (B0[0], B0[1], B0[2], B1[0], B1[1], B1[2], B2[0], B2[1], B2[2])
        keep(X, kept, size, K, (t1, L1[0], L1[1], t2, L2[0], L2[1]), pivot)
    # Gauss-Jordan in registers; a pivot of zero makes everything infinite or NaN, which is seen at the end
    if abs(B1[0]) > abs(B0[0]):
        B0, B1 = B1, B0
    if abs(B2[0]) > abs(B0[0]):
        B0, B2 = B2, B0
    f = 1.0 / B0[0]
    C0 = (f * B0[1], f * B0[2], f * B0[3], f * B0[4], f * B0[5], f * B0[6], f * B0[7], f * B0[8])
    C1, C2 = eliminate8(B1, C0), eliminate8(B2, C0)
    if abs(C2[0]) > abs(C1[0]):
        C1, C2 = C2, C1
    f = 1.0 / C1[0]
    E1 = (f * C1[1], f * C1[2], f * C1[3], f * C1[4], f * C1[5], f * C1[6], f * C1[7])
    E0, E2 = eliminate7(C0, E1), eliminate7(C2, E1)
    f = 1.0 / E2[0]
    F2 = (f * E2[1], f * E2[2], f * E2[3], f * E2[4], f * E2[5], f * E2[6])
    F0, F1 = eliminate6(E0, F2), eliminate6(E1, F2)
    o = i * TRIPLE
    for k in range(COLUMNS):
        X[o + k], X[o + COLUMNS + k], X[o + 2 * COLUMNS + k] = F0[k], F1[k], F2[k]
    return abs(F0[5]) + abs(F1[5]) + abs(F2[5]) < math.inf


@inner
def subtract_chain(A, m, X, p, q):
    """A - m . (rows of dr_{i-1} in X), over dT_{i-1}, dr_i and the right-hand side."""
    return (
        A[0] - m[0] * X[p] - m[1] * X[q],
        A[1] - m[0] * X[p + 1] - m[1] * X[q + 1],
        A[2] - m[0] * X[p + 2] - m[1] * X[q + 2],
        A[3] - m[0] * X[p + 5] - m[1] * X[q + 5],
    )


@inner
def eliminate_chain(length, node, X, i, kept):
    """As `eliminate2` where nothing bends: X_i keeps zeros for dr_{i+2}."""
    row, hck, gap = length
    _, L, back, D, ahead, U, _, b, size = node
    B0 = (-hck, row[0], row[1], gap)
    B1 = (back[0], D[0], D[1], b[0])
    B2 = (back[1], D[2], D[3], b[1])
    if i >= 1:
        p = (i - 1) * TRIPLE + COLUMNS
        q = p + COLUMNS
        B0 = subtract_chain(B0, (-row[0], -row[1]), X, p, q)
        B1 = subtract_chain(B1, (L[0], L[1]), X, p, q)
        B2 = subtract_chain(B2, (L[2], L[3]), X, p, q)
    if kept > 0:
        X[kept + LOWER], X[kept + LOWER + 1], X[kept + LOWER + 2] = 0.0, -row[0], -row[1]
        pivot = (B0[0], B0[1], B0[2], B1[0], B1[1], B1[2], B2[0], B2[1], B2[2])
        keep(X, kept, size, (0.0, 0.0, 0.0, 0.0), (0.0, L[0], L[1], 0.0, L[2], L[3]), pivot)
    G0 = (B0[0], B0[1], B0[2], 0.0, 0.0, 0.0, B0[3])
    G1 = (B1[0], B1[1], B1[2], ahead[0], U[0], U[1], B1[3])
    G2 = (B2[0], B2[1], B2[2], ahead[1], U[2], U[3], B2[3])
    F0, F1, F2 = solve_three(G0, G1, G2)
    o = i * TRIPLE
    for F in (F0, F1, F2):
        X[o], X[o + 1], X[o + 2], X[o + 3], X[o + 4], X[o + 5] = F[0], F[1], F[2], 0.0, 0.0, F[3]
        o += COLUMNS
    return abs(F0[3]) + abs(F1[3]) + abs(F2[3]) < math.inf


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
        x[i, 1], x[i, 2], x[i, 3] = to_space(plane, (a, b))
        y, z = (t, a, b), (y[1], y[2])
    return total < math.inf


@inner
def solve3(A0, A1, A2):
    """Three unknowns from three rows (four numbers, the last the right-hand side), with pivoting."""
    if abs(A1[0]) > abs(A0[0]):
        A0, A1 = A1, A0
    if abs(A2[0]) > abs(A0[0]):
        A0, A2 = A2, A0
    i0 = 1.0 / A0[0]
    f1, f2 = i0 * A1[0], i0 * A2[0]
    B1 = (A1[1] - f1 * A0[1], A1[2] - f1 * A0[2], A1[3] - f1 * A0[3])
    B2 = (A2[1] - f2 * A0[1], A2[2] - f2 * A0[2], A2[3] - f2 * A0[3])
    if abs(B2[0]) > abs(B1[0]):
        B1, B2 = B2, B1
    i1 = 1.0 / B1[0]
    f2 = i1 * B2[0]
    x2 = (B2[2] - f2 * B1[2]) / (B2[1] - f2 * B1[1])
    x1 = i1 * (B1[2] - B1[1] * x2)
    return i0 * (A0[3] - A0[1] * x1 - A0[2] * x2), x1, x2


@inner
def solve_forward_planar(plane, X, b, x):
    """The first half of `solve_again_planar`: what another right-hand side makes of that of every block, into x."""
    n = x.shape[0] - 1
    y0, y1, y2, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0  # of the node before: dT, dr; of the one before that: dr
    for i in range(n + 1):
        k = (n + 1) * TRIPLE + i * KEPT
        f = (
            plane[0, 0] * b[i, 1] + plane[0, 1] * b[i, 2] + plane[0, 2] * b[i, 3],
            plane[1, 0] * b[i, 1] + plane[1, 1] * b[i, 2] + plane[1, 2] * b[i, 3],
        )
        m, p = k + LOWER, k + PIVOT
        c0 = X[k + SIZE_AT] * b[i, 0] - X[m] * y0 - X[m + 1] * y1 - X[m + 2] * y2
        c1 = f[0] - X[k] * z1 - X[k + 1] * z2 - X[m + 3] * y0 - X[m + 4] * y1 - X[m + 5] * y2
        c2 = f[1] - X[k + 2] * z1 - X[k + 3] * z2 - X[m + 6] * y0 - X[m + 7] * y1 - X[m + 8] * y2
        z1, z2 = y1, y2
        y0, y1, y2 = solve3(
            (X[p], X[p + 1], X[p + 2], c0), (X[p + 3], X[p + 4], X[p + 5], c1), (X[p + 6], X[p + 7], X[p + 8], c2)
        )
        x[i, 0], x[i, 1], x[i, 2] = y0, y1, y2


@inner
def solve_backward_planar(plane, X, x):
    """The second half of `solve_again_planar`, in place."""
    n = x.shape[0] - 1
    y, z = (0.0, 0.0, 0.0), (0.0, 0.0)
    total = 0.0
    for i in range(n, -1, -1):
        p = i * TRIPLE
        q, s = p + COLUMNS, p + 2 * COLUMNS
        t = x[i, 0] - X[p] * y[0] - X[p + 1] * y[1] - X[p + 2] * y[2] - X[p + 3] * z[0] - X[p + 4] * z[1]
        a = x[i, 1] - X[q] * y[0] - X[q + 1] * y[1] - X[q + 2] * y[2] - X[q + 3] * z[0] - X[q + 4] * z[1]
        c = x[i, 2] - X[s] * y[0] - X[s + 1] * y[1] - X[s + 2] * y[2] - X[s + 3] * z[0] - X[s + 4] * z[1]
        total += abs(t) + abs(a) + abs(c)
        x[i, 0], x[i, 4] = t, 0.0
        x[i, 1], x[i, 2], x[i, 3] = to_space(plane, (a, c))
        y, z = (t, a, c), (y[1], y[2])
    return total < math.inf


@kernel
def solve_again_planar(plane, X, b, x):
    """As `block_elimination.solve_again` for a cable in a plane.

    b and x (N+1, 5) are of space: what b has across the plane is not read, and x has nothing there and no spin.
    """
    solve_forward_planar(plane, X, b, x)
    return solve_backward_planar(plane, X, x)


@inner
def add_to_right_planar(X, part, x):
    """Add a part of what `solve_forward_planar` has left in x to the right-hand sides of all blocks."""
    for i in range(x.shape[0]):
        for k in range(3):
            X[i * TRIPLE + k * COLUMNS + COLUMNS - 1] += part * x[i, k]
