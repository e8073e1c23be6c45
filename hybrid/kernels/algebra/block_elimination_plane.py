"""Block rows of a cable in a plane: their elimination and the solve back, with three unknowns per node instead of five.

Block i has the tension of the cell before node i (dT_{i-1}) and the node's two components in the plane; its rows are
the length of that cell and the balance of the node.  After elimination

    x_i = X_i[5] - X_i[0..2] x_{i+1} - X_i[3..4] dr_{i+2}

with X_i in three rows of six numbers.  Where there is room behind them, what another right-hand side with the same
matrix needs is kept (`solve_again_planar`): KEPT numbers a block, K, the rows over dT_{i-2}.. and dr_{i-1}, the pivot
block and the size of the law of length.  In space: kernels.algebra.block_elimination.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.block_elimination import eliminate5, eliminate6, eliminate7, eliminate8
from hybrid.kernels.algebra.plane import to_space
from hybrid.kernels.machine.compile import inner, kernel

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
    if abs(G1[0]) > abs(G0[0]):
        G0, G1 = G1, G0
    if abs(G2[0]) > abs(G0[0]):
        G0, G2 = G2, G0
    f = 1.0 / G0[0]
    C0 = (f * G0[1], f * G0[2], f * G0[3], f * G0[4], f * G0[5], f * G0[6])
    C1, C2 = eliminate6(G1, C0), eliminate6(G2, C0)
    if abs(C2[0]) > abs(C1[0]):
        C1, C2 = C2, C1
    f = 1.0 / C1[0]
    E1 = (f * C1[1], f * C1[2], f * C1[3], f * C1[4], f * C1[5])
    E0, E2 = eliminate5(C0, E1), eliminate5(C2, E1)
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
