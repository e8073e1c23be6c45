"""Block rows along s: their layout, their elimination, and the solve back.

Unknowns of block i: the tension of the cell before node i (dT_{i-1}), the node (dr_i),
the spin of the cell after it (dpsi_i); its equations, in that order: the length of the
cell before, the balance of the node, the spin of the cell after.  Tension stays an
unknown, so that stiffness never enters as 1/compliance: an inextensible cell is the
case ck = 0 and nothing else.  W holds one block row, five rows of

    columns  0..4   5..9   10..14  15..19  20..22   23
    block    i-2    i-1    i       i+1     r_{i+2}  right-hand side

After elimination  x_i = X_i[8] - X_i[0..4] x_{i+1} - X_i[5..7] dr_{i+2}:  the linear
relation that everything before node i imposes on what follows (docs/theory.md, 5).
Rows without bending have four unknowns and take a path of their own in the same march; between two cells that are soft
enough they have three, because the tension goes first (`eliminate_condensed`), and X_i is the same.

Where X has room for more than the X_i, the march keeps there what another right-hand side of the same
matrix needs (kernels.algebra.kept_factors): KEPT numbers a block,

    wide     0..11 balance against (dr, dpsi) of block i-2;  12..36 against block i-1, after that;  37..61 pivot block
    narrow   0..8 balance against dr_{i-1};  9..11 length;  12..27 pivot block
    both     62 unit of the length row;  63 0 where it is narrow;  64..68 right-hand side of the pivot block
    wide     69..72 length against (dr, dpsi) of block i-2, which tension that makes a torque reaches

Of a wide block 37..61 are the factors L U of its pivot block with its rows exchanged: the inverses of U's diagonal in
its place, L below without its ones; number 63 says in which order L takes the rows (`exchange`).  The first and the
last block keep the pivot block itself, which lines that are joined need (kernels.junctions.joined_lines).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hybrid.kernels.algebra.rotations import add, dot, mat_mat, mat_vec, msub, scale, vec_mat
from hybrid.kernels.machine.compile import inner, kernel

SIZE = 5  # unknowns of a block
WIDTH = 24  # columns of W
SPAN = 9  # columns of X_i
ROW = SIZE * SPAN  # numbers of X_i
KEPT = 73  # numbers kept of a block, for another right-hand side
IN_ORDER = 0 | 1 << 3 | 2 << 6 | 3 << 9 | 4 << 12  # rows of a pivot block as they stand


class Length(NamedTuple):
    """The law of length of the cell before node i, row.(dr_i - dr_{i-1}) - hck dT_{i-1} = gap."""

    row: Any
    hck: float
    gap: float


class NarrowBalance(NamedTuple):
    """The balance of a node without bending, L dr_{i-1} + back dT_{i-1} + D dr_i + ahead dT_i + U dr_{i+1} = b."""

    back: Any
    L: Any
    D: Any
    ahead: Any
    U: Any
    b: Any


class Condensed(NamedTuple):
    """A cell whose tension is eliminated, dT = stiffness (d.(dr_i - dr_{i-1}) - gap), and what is known of its start.

    dr_{i-1} = g + (1 - V) dr_i
    """

    d: Any
    stiffness: float
    gap: float
    V: Any
    g: Any


@inner
def subtract_block(W, o, X, i, l1, l2, l3, l4):
    """Subtract (l1..l3, l4) . (dr, dpsi rows of X_i) from the row of W whose block i+1 begins at column o.

    All is read before anything is written, here and below: that leaves the compiler free.
    Returns what is to be taken from the right-hand side.
    """
    p = i * ROW + SPAN
    q, s, v = p + SPAN, p + 2 * SPAN, p + 3 * SPAN
    t0 = W[o] - l1 * X[p] - l2 * X[q] - l3 * X[s] - l4 * X[v]
    t1 = W[o + 1] - l1 * X[p + 1] - l2 * X[q + 1] - l3 * X[s + 1] - l4 * X[v + 1]
    t2 = W[o + 2] - l1 * X[p + 2] - l2 * X[q + 2] - l3 * X[s + 2] - l4 * X[v + 2]
    t3 = W[o + 3] - l1 * X[p + 3] - l2 * X[q + 3] - l3 * X[s + 3] - l4 * X[v + 3]
    t4 = W[o + 4] - l1 * X[p + 4] - l2 * X[q + 4] - l3 * X[s + 4] - l4 * X[v + 4]
    t5 = W[o + 6] - l1 * X[p + 5] - l2 * X[q + 5] - l3 * X[s + 5] - l4 * X[v + 5]
    t6 = W[o + 7] - l1 * X[p + 6] - l2 * X[q + 6] - l3 * X[s + 6] - l4 * X[v + 6]
    t7 = W[o + 8] - l1 * X[p + 7] - l2 * X[q + 7] - l3 * X[s + 7] - l4 * X[v + 7]
    W[o], W[o + 1], W[o + 2], W[o + 3], W[o + 4] = t0, t1, t2, t3, t4
    W[o + 6], W[o + 7], W[o + 8] = t5, t6, t7
    return l1 * X[p + 8] + l2 * X[q + 8] + l3 * X[s + 8] + l4 * X[v + 8]


@inner
def subtract_tension_row(W, o, X, i, l0):
    """As `subtract_block` for the dT row of X_i."""
    p = i * ROW
    t0, t1, t2 = W[o] - l0 * X[p], W[o + 1] - l0 * X[p + 1], W[o + 2] - l0 * X[p + 2]
    t3, t4, t5 = W[o + 3] - l0 * X[p + 3], W[o + 4] - l0 * X[p + 4], W[o + 6] - l0 * X[p + 5]
    t6, t7 = W[o + 7] - l0 * X[p + 6], W[o + 8] - l0 * X[p + 7]
    W[o], W[o + 1], W[o + 2], W[o + 3], W[o + 4] = t0, t1, t2, t3, t4
    W[o + 6], W[o + 7], W[o + 8] = t5, t6, t7
    return l0 * X[p + 8]


@inner
def subtract_row(W, o, p, f):
    """Subtract f times the row of W at p from the row at o, over the pivot block and all to its right."""
    t0 = W[o + 10] - f * W[p + 10]
    t1 = W[o + 11] - f * W[p + 11]
    t2 = W[o + 12] - f * W[p + 12]
    t3 = W[o + 13] - f * W[p + 13]
    t4 = W[o + 14] - f * W[p + 14]
    t5 = W[o + 15] - f * W[p + 15]
    t6 = W[o + 16] - f * W[p + 16]
    t7 = W[o + 17] - f * W[p + 17]
    t8 = W[o + 18] - f * W[p + 18]
    t9 = W[o + 19] - f * W[p + 19]
    t10 = W[o + 20] - f * W[p + 20]
    t11 = W[o + 21] - f * W[p + 21]
    t12 = W[o + 22] - f * W[p + 22]
    t13 = W[o + 23] - f * W[p + 23]
    W[o + 10] = t0
    W[o + 11] = t1
    W[o + 12] = t2
    W[o + 13] = t3
    W[o + 14] = t4
    W[o + 15] = t5
    W[o + 16] = t6
    W[o + 17] = t7
    W[o + 18] = t8
    W[o + 19] = t9
    W[o + 20] = t10
    W[o + 21] = t11
    W[o + 22] = t12
    W[o + 23] = t13


@inner
def subtract_solved_row(X, x, y, f):
    """Subtract f times the solved row of X at y from that at x."""
    t0 = X[x] - f * X[y]
    t1 = X[x + 1] - f * X[y + 1]
    t2 = X[x + 2] - f * X[y + 2]
    t3 = X[x + 3] - f * X[y + 3]
    t4 = X[x + 4] - f * X[y + 4]
    t5 = X[x + 5] - f * X[y + 5]
    t6 = X[x + 6] - f * X[y + 6]
    t7 = X[x + 7] - f * X[y + 7]
    t8 = X[x + 8] - f * X[y + 8]
    X[x] = t0
    X[x + 1] = t1
    X[x + 2] = t2
    X[x + 3] = t3
    X[x + 4] = t4
    X[x + 5] = t5
    X[x + 6] = t6
    X[x + 7] = t7
    X[x + 8] = t8


@inner
def exchange(order, a, b):
    """Exchange rows a and b of an order: three bits for each row."""
    differ = ((order >> 3 * a) ^ (order >> 3 * b)) & 7
    return order ^ (differ << 3 * a | differ << 3 * b)


@inner
def solve_block(W, X, i, factors):
    """X_i from the five rows of W, with pivoting inside the block; False when the block is singular.

    factors: where those of the pivot block go in X, 0: nowhere.
    A cofactor inverse would lose eps (k_axial/k_transverse)^2.
    """
    order = IN_ORDER
    for c in range(SIZE):
        o = c * WIDTH
        best, where = abs(W[o + 10 + c]), c
        for r in range(c + 1, SIZE):
            if abs(W[r * WIDTH + 10 + c]) > best:
                best, where = abs(W[r * WIDTH + 10 + c]), r
        if not best > 0.0:
            return False
        if where != c:
            p = where * WIDTH
            for j in range(10, WIDTH):
                W[o + j], W[p + j] = W[p + j], W[o + j]
            if factors > 0:
                order = exchange(order, c, where)
                for j in range(c):
                    a, b = factors + SIZE * c + j, factors + SIZE * where + j
                    X[a], X[b] = X[b], X[a]
        inverse = 1.0 / W[o + 10 + c]
        for r in range(c + 1, SIZE):
            f = W[r * WIDTH + 10 + c] * inverse
            if factors > 0:
                X[factors + SIZE * r + c] = f
            subtract_row(W, r * WIDTH, o, f)
        if factors > 0:
            X[factors + (SIZE + 1) * c] = inverse
            for j in range(c + 1, SIZE):
                X[factors + SIZE * c + j] = W[o + 10 + j]
    if factors > 0:
        X[factors + 26] = order
    for c in range(SIZE - 1, -1, -1):
        o, x = c * WIDTH, i * ROW + c * SPAN
        for j in range(SPAN):
            X[x + j] = W[o + 15 + j]
        for r in range(c + 1, SIZE):
            subtract_solved_row(X, x, i * ROW + r * SPAN, W[o + 10 + r])
        inverse = 1.0 / W[o + 10 + c]
        for j in range(SPAN):
            X[x + j] *= inverse
    return True


@inner
def eliminate_wide(W, X, i, kept, size, couples):
    """Eliminate block row i (5 unknowns); False when the block is singular.

    kept: where its factors go in X, 0: nowhere; size: unit of its length row; couples: whether that row reaches back to
    block i-2, as the balance of the node does (kernels.laws.tension_torque).
    """
    if kept > 0:
        for j in range(4):
            X[kept + 69 + j] = W[1 + j]
        for r in range(1, 4):
            for j in range(4):
                X[kept + 4 * (r - 1) + j] = W[r * WIDTH + 1 + j]
        X[kept + 62], X[kept + 63] = size, 1.0
    if i >= 2:
        for r in range(0 if couples else 1, 4):  # the balance of the node reaches back to block i-2
            o = r * WIDTH
            W[o + 23] -= subtract_block(W, o + 5, X, i - 2, W[o + 1], W[o + 2], W[o + 3], W[o + 4])
    if kept > 0:
        for r in range(SIZE):
            for j in range(SIZE):
                X[kept + 12 + SIZE * r + j] = W[r * WIDTH + 5 + j]
    if i >= 1:
        for r in range(SIZE):
            o = r * WIDTH
            l0 = W[o + 5]
            W[o + 23] -= subtract_block(W, o + 10, X, i - 1, W[o + 6], W[o + 7], W[o + 8], W[o + 9])
            if l0 != 0.0:  # the balance of the node, through block i-2
                W[o + 23] -= subtract_tension_row(W, o + 10, X, i - 1, l0)
    factors = 0
    if kept > 0:
        if i > 0 and kept + KEPT < X.shape[0]:
            factors = kept + 37
        for r in range(SIZE):
            for j in range(SIZE if factors == 0 else 0):
                X[kept + 37 + SIZE * r + j] = W[r * WIDTH + 10 + j]
            X[kept + 64 + r] = W[r * WIDTH + 23]
    return solve_block(W, X, i, factors)


@inner
def eliminate_narrow(length, node, X, i, kept, size):
    """Eliminate a block of four unknowns (dT_{i-1}, dr_i); X_i keeps zeros elsewhere.

    length, node: its `Length` and `NarrowBalance`; kept, size: as of a wide one.
    """
    row, hck, gap = length
    back, L, D, ahead, U, b = node
    # rows of dT_{i-1}, dr_i | dT_i, dr_{i+1} | right-hand side
    A0 = (-hck, row[0], row[1], row[2], gap)
    A1 = (back[0], D[0], D[1], D[2], b[0])
    A2 = (back[1], D[3], D[4], D[5], b[1])
    A3 = (back[2], D[6], D[7], D[8], b[2])
    if i >= 1:
        p = (i - 1) * ROW + SPAN
        q, s = p + SPAN, p + 2 * SPAN
        A0 = subtract_node_rows(A0, (-row[0], -row[1], -row[2]), X, p, q, s)
        A1 = subtract_node_rows(A1, (L[0], L[1], L[2]), X, p, q, s)
        A2 = subtract_node_rows(A2, (L[3], L[4], L[5]), X, p, q, s)
        A3 = subtract_node_rows(A3, (L[6], L[7], L[8]), X, p, q, s)
    if kept > 0:
        for j in range(9):
            X[kept + j] = L[j]
        X[kept + 9], X[kept + 10], X[kept + 11] = row
        X[kept + 12], X[kept + 13], X[kept + 14], X[kept + 15] = A0[0], A0[1], A0[2], A0[3]
        X[kept + 16], X[kept + 17], X[kept + 18], X[kept + 19] = A1[0], A1[1], A1[2], A1[3]
        X[kept + 20], X[kept + 21], X[kept + 22], X[kept + 23] = A2[0], A2[1], A2[2], A2[3]
        X[kept + 24], X[kept + 25], X[kept + 26], X[kept + 27] = A3[0], A3[1], A3[2], A3[3]
        X[kept + 62], X[kept + 63] = size, 0.0
        X[kept + 64], X[kept + 65], X[kept + 66], X[kept + 67] = A0[4], A1[4], A2[4], A3[4]
    B0 = (A0[0], A0[1], A0[2], A0[3], 0.0, 0.0, 0.0, 0.0, A0[4])
    B1 = (A1[0], A1[1], A1[2], A1[3], ahead[0], U[0], U[1], U[2], A1[4])
    B2 = (A2[0], A2[1], A2[2], A2[3], ahead[1], U[3], U[4], U[5], A2[4])
    B3 = (A3[0], A3[1], A3[2], A3[3], ahead[2], U[6], U[7], U[8], A3[4])
    # Gauss-Jordan in registers; a pivot of zero makes everything infinite or NaN, which is seen at the end
    if abs(B1[0]) > abs(B0[0]):
        B0, B1 = B1, B0
    if abs(B2[0]) > abs(B0[0]):
        B0, B2 = B2, B0
    if abs(B3[0]) > abs(B0[0]):
        B0, B3 = B3, B0
    f = 1.0 / B0[0]
    C0 = (f * B0[1], f * B0[2], f * B0[3], f * B0[4], f * B0[5], f * B0[6], f * B0[7], f * B0[8])
    C1, C2, C3 = eliminate8(B1, C0), eliminate8(B2, C0), eliminate8(B3, C0)
    if abs(C2[0]) > abs(C1[0]):
        C1, C2 = C2, C1
    if abs(C3[0]) > abs(C1[0]):
        C1, C3 = C3, C1
    f = 1.0 / C1[0]
    D1 = (f * C1[1], f * C1[2], f * C1[3], f * C1[4], f * C1[5], f * C1[6], f * C1[7])
    D0, D2, D3 = eliminate7(C0, D1), eliminate7(C2, D1), eliminate7(C3, D1)
    if abs(D3[0]) > abs(D2[0]):
        D2, D3 = D3, D2
    f = 1.0 / D2[0]
    E2 = (f * D2[1], f * D2[2], f * D2[3], f * D2[4], f * D2[5], f * D2[6])
    E0, E1, E3 = eliminate6(D0, E2), eliminate6(D1, E2), eliminate6(D3, E2)
    f = 1.0 / E3[0]
    F3 = (f * E3[1], f * E3[2], f * E3[3], f * E3[4], f * E3[5])
    big = 0.0
    big += store_row(X, i * ROW, eliminate5(E0, F3))
    big += store_row(X, i * ROW + SPAN, eliminate5(E1, F3))
    big += store_row(X, i * ROW + 2 * SPAN, eliminate5(E2, F3))
    big += store_row(X, i * ROW + 3 * SPAN, F3)
    return big < math.inf


@inner
def answer_of_node(X):
    """V and g of a node whose X_i begins X: dr_i = g + (1 - V) dr_{i+1}, where that is all it answers to."""
    p, q, s = SPAN, 2 * SPAN, 3 * SPAN
    V = (1.0 + X[p + 1], X[p + 2], X[p + 3], X[q + 1], 1.0 + X[q + 2], X[q + 3], X[s + 1], X[s + 2], 1.0 + X[s + 3])
    return V, (X[p + 8], X[q + 8], X[s + 8])


@inner
def solve_three(B0, B1, B2):
    """Solve three equations by Gauss-Jordan with pivoting by rows: rows of 3 unknowns and 4 right-hand sides.

    A pivot of zero makes everything infinite or NaN.
    """
    if abs(B1[0]) > abs(B0[0]):
        B0, B1 = B1, B0
    if abs(B2[0]) > abs(B0[0]):
        B0, B2 = B2, B0
    f = 1.0 / B0[0]
    C0 = (f * B0[1], f * B0[2], f * B0[3], f * B0[4], f * B0[5], f * B0[6])
    C1, C2 = eliminate6(B1, C0), eliminate6(B2, C0)
    if abs(C2[0]) > abs(C1[0]):
        C1, C2 = C2, C1
    f = 1.0 / C1[0]
    D1 = (f * C1[1], f * C1[2], f * C1[3], f * C1[4], f * C1[5])
    D0, D2 = eliminate5(C0, D1), eliminate5(C2, D1)
    f = 1.0 / D2[0]
    E2 = (f * D2[1], f * D2[2], f * D2[3], f * D2[4])
    E0, E1 = eliminate4(D0, E2), eliminate4(D1, E2)
    return E0, E1, E2


@inner
def eliminate_condensed(cell, L, U, D, F, X):
    """Eliminate a node between two cells whose tensions are eliminated; whether it is regular, its V and g (`Condensed`).

    Its balance is  L dr_{i-1} + (D - L - U) dr_i + U dr_{i+1} = -F  but for the gap of the cell before it; X begins with X_i.
    With  R = L V_{i-1} - D,  what it bears but for the cell after it, (R + U) dr_i = U dr_{i+1} + ..., so that V_i is
    (R + U)^-1 R.  Nothing stiff is subtracted from anything stiff.
    """
    d, k, gap, V, g = cell
    R = msub(mat_mat(L, V), D)
    h = add(add(F, scale(k * gap, d)), mat_vec(L, g))
    B0 = (R[0] + U[0], R[1] + U[1], R[2] + U[2], R[0], R[1], R[2], h[0])
    B1 = (R[3] + U[3], R[4] + U[4], R[5] + U[5], R[3], R[4], R[5], h[1])
    B2 = (R[6] + U[6], R[7] + U[7], R[8] + U[8], R[6], R[7], R[8], h[2])
    E0, E1, E2 = solve_three(B0, B1, B2)
    w = scale(k, vec_mat(d, V))
    Y = (E0[0] - 1.0, E0[1], E0[2], E1[0], E1[1] - 1.0, E1[2], E2[0], E2[1], E2[2] - 1.0)
    back = vec_mat(w, Y)
    g1 = (E0[3], E1[3], E2[3])
    tension = dot(w, g1) - k * (dot(d, g) + gap)
    big = store_row(X, 0, (0.0, back[0], back[1], back[2], tension))
    big += store_row(X, SPAN, (0.0, Y[0], Y[1], Y[2], g1[0]))
    big += store_row(X, 2 * SPAN, (0.0, Y[3], Y[4], Y[5], g1[1]))
    big += store_row(X, 3 * SPAN, (0.0, Y[6], Y[7], Y[8], g1[2]))
    return big < math.inf, (E0[0], E0[1], E0[2], E1[0], E1[1], E1[2], E2[0], E2[1], E2[2]), g1


@inner
def eliminate8(b, c):
    f = b[0]
    low = (b[1] - f * c[0], b[2] - f * c[1], b[3] - f * c[2], b[4] - f * c[3])
    high = (b[5] - f * c[4], b[6] - f * c[5], b[7] - f * c[6], b[8] - f * c[7])
    return low + high


@inner
def eliminate7(b, c):
    f = b[0]
    low = (b[1] - f * c[0], b[2] - f * c[1], b[3] - f * c[2], b[4] - f * c[3])
    high = (b[5] - f * c[4], b[6] - f * c[5], b[7] - f * c[6])
    return low + high


@inner
def eliminate6(b, c):
    f = b[0]
    return (b[1] - f * c[0], b[2] - f * c[1], b[3] - f * c[2], b[4] - f * c[3], b[5] - f * c[4], b[6] - f * c[5])


@inner
def eliminate5(b, c):
    f = b[0]
    return (b[1] - f * c[0], b[2] - f * c[1], b[3] - f * c[2], b[4] - f * c[3], b[5] - f * c[4])


@inner
def eliminate4(b, c):
    f = b[0]
    return (b[1] - f * c[0], b[2] - f * c[1], b[3] - f * c[2], b[4] - f * c[3])


@inner
def store_row(X, x, row):
    X[x], X[x + 1], X[x + 2], X[x + 3] = row[0], row[1], row[2], row[3]
    X[x + 8] = row[4]
    return abs(row[4])


@inner
def subtract_node_rows(A, m, X, p, q, s):
    """A - m . (rows of dr_{i-1} in X), over dT_{i-1}, dr_i and the right-hand side."""
    return (
        A[0] - m[0] * X[p] - m[1] * X[q] - m[2] * X[s],
        A[1] - m[0] * X[p + 1] - m[1] * X[q + 1] - m[2] * X[s + 1],
        A[2] - m[0] * X[p + 2] - m[1] * X[q + 2] - m[2] * X[s + 2],
        A[3] - m[0] * X[p + 3] - m[1] * X[q + 3] - m[2] * X[s + 3],
        A[4] - m[0] * X[p + 8] - m[1] * X[q + 8] - m[2] * X[s + 8],
    )


@kernel
def substitute(X, x, joined, more):
    """Solve back from the end: x (N+1, 5) receives dT, dr and dpsi of every block; False if one is not finite.

    joined: the last block is known, in x[n]; more: what blocks have beside their right-hand side, by columns (.., T, 5) of
    which the first block is in row `first`: columns low to high - 1 times q; None: nothing.
    """
    n = x.shape[0] - 1
    last, y = n, (0.0, 0.0, 0.0, 0.0, 0.0)
    z0, z1, z2 = 0.0, 0.0, 0.0
    total = 0.0
    if joined:
        y, last = (x[n, 0], x[n, 1], x[n, 2], x[n, 3], 0.0), n - 1
        x[n, 4] = 0.0
    for i in range(last, -1, -1):
        p = i * ROW
        for k in range(SIZE):
            q = p + SPAN * k
            left = X[q + 8] - X[q] * y[0] - X[q + 1] * y[1] - X[q + 2] * y[2] - X[q + 3] * y[3] - X[q + 4] * y[4]
            x[i, k] = left - X[q + 5] * z0 - X[q + 6] * z1 - X[q + 7] * z2
            if more is not None:
                columns, first, low, high, q = more
                for b in range(low, high):
                    x[i, k] += columns[b, first + i, k] * q[b]
            total += abs(x[i, k])
        z0, z1, z2 = y[1], y[2], y[3]
        y = (x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4])
    return total < math.inf
