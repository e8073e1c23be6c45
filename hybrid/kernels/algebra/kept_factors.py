"""Another right-hand side of block rows that are eliminated, with the factors that the march has kept behind the X_i.

Layout of what is kept: kernels.algebra.block_elimination.  A right-hand side that is zero before block `begin` is so in
the first sweep, too; one that is wanted from there on is not swept farther back.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE, SPAN
from hybrid.kernels.machine.compile import inner, kernel

# A straight inextensible line that is held at both ends has no compliance: a pivot, as a part of its row, that is none.
NO_PIVOT = 1e-12
SWEEP = 45  # numbers of a block for `sweep`


@inner
def solve4(A0, A1, A2, A3):
    """Four unknowns from four rows (five numbers, the last the right-hand side), with pivoting."""
    if abs(A1[0]) > abs(A0[0]):
        A0, A1 = A1, A0
    if abs(A2[0]) > abs(A0[0]):
        A0, A2 = A2, A0
    if abs(A3[0]) > abs(A0[0]):
        A0, A3 = A3, A0
    i0 = 1.0 / A0[0]
    f1, f2, f3 = i0 * A1[0], i0 * A2[0], i0 * A3[0]
    B1 = (A1[1] - f1 * A0[1], A1[2] - f1 * A0[2], A1[3] - f1 * A0[3], A1[4] - f1 * A0[4])
    B2 = (A2[1] - f2 * A0[1], A2[2] - f2 * A0[2], A2[3] - f2 * A0[3], A2[4] - f2 * A0[4])
    B3 = (A3[1] - f3 * A0[1], A3[2] - f3 * A0[2], A3[3] - f3 * A0[3], A3[4] - f3 * A0[4])
    if abs(B2[0]) > abs(B1[0]):
        B1, B2 = B2, B1
    if abs(B3[0]) > abs(B1[0]):
        B1, B3 = B3, B1
    i1 = 1.0 / B1[0]
    f2, f3 = i1 * B2[0], i1 * B3[0]
    C2 = (B2[1] - f2 * B1[1], B2[2] - f2 * B1[2], B2[3] - f2 * B1[3])
    C3 = (B3[1] - f3 * B1[1], B3[2] - f3 * B1[2], B3[3] - f3 * B1[3])
    if abs(C3[0]) > abs(C2[0]):
        C2, C3 = C3, C2
    i2 = 1.0 / C2[0]
    f3 = i2 * C3[0]
    x3 = (C3[2] - f3 * C2[2]) / (C3[1] - f3 * C2[1])
    x2 = i2 * (C2[2] - C2[1] * x3)
    x1 = i1 * (B1[3] - B1[1] * x2 - B1[2] * x3)
    x0 = i0 * (A0[4] - A0[1] * x1 - A0[2] * x2 - A0[3] * x3)
    return x0, x1, x2, x3


@inner
def solve5(X, k, W, x, i):
    """x_i from the pivot block of the first or last row, kept at X[k:], and the right-hand side in x_i.

    W: room for 30 numbers.
    """
    for r in range(SIZE):
        for j in range(SIZE):
            W[6 * r + j] = X[k + SIZE * r + j]
        W[6 * r + 5] = x[i, r]
    for c in range(SIZE):
        best, where = abs(W[7 * c]), c
        for r in range(c + 1, SIZE):
            if abs(W[6 * r + c]) > best:
                best, where = abs(W[6 * r + c]), r
        if where != c:
            for j in range(c, 6):
                W[6 * c + j], W[6 * where + j] = W[6 * where + j], W[6 * c + j]
        for r in range(c + 1, SIZE):
            f = W[6 * r + c] / W[7 * c]
            for j in range(c + 1, 6):
                W[6 * r + j] -= f * W[6 * c + j]
    for c in range(SIZE - 1, -1, -1):
        y = W[6 * c + 5]
        for j in range(c + 1, SIZE):
            y -= W[6 * c + j] * x[i, j]
        x[i, c] = y / W[7 * c]


@inner
def solve_last(X, k, x, n):
    """The last block of a line whose end is joined to a point, held there: x_n from its right-hand side in x_n."""
    a, rest = X[k + 37] if X[k + 63] > 0.0 else X[k + 12], 0.0
    for j in range(1, 4):
        rest = max(rest, abs(X[k + 37 + j] if X[k + 63] > 0.0 else X[k + 12 + j]))
    x[n, 0] = x[n, 0] / a if abs(a) > NO_PIVOT * rest else 0.0
    for j in range(1, SIZE):
        x[n, j] = 0.0


@inner
def solve_factored(F, row):
    """Solve with the factors of the pivot block of a wide row; F: what is kept of it; row: right-hand side, solution."""
    order, L = int(F[63]), F[37:62]
    y0, y1, y2 = row[order & 7], row[order >> 3 & 7], row[order >> 6 & 7]
    y3, y4 = row[order >> 9 & 7], row[order >> 12 & 7]
    y1 -= L[5] * y0
    y2 -= L[10] * y0 + L[11] * y1
    y3 -= L[15] * y0 + L[16] * y1 + L[17] * y2
    y4 -= L[20] * y0 + L[21] * y1 + L[22] * y2 + L[23] * y3
    y4 *= L[24]
    y3 = L[18] * (y3 - L[19] * y4)
    y2 = L[12] * (y2 - L[13] * y3 - L[14] * y4)
    y1 = L[6] * (y1 - L[7] * y2 - L[8] * y3 - L[9] * y4)
    row[0] = L[0] * (y0 - L[1] * y1 - L[2] * y2 - L[3] * y3 - L[4] * y4)
    row[1], row[2], row[3], row[4] = y1, y2, y3, y4


@inner
def carry_wide(F, x, o, i, begin):
    """The right-hand side of a wide row, in row o of x, less what the rows before it take; it is zero before `begin`."""
    row = x[o]
    b0, b1, b2, b3, b4 = row[0], row[1], row[2], row[3], row[4]
    if i >= begin + 2:
        y = x[o - 2]
        y1, y2, y3, y4 = y[1], y[2], y[3], y[4]
        b0 -= F[69] * y1 + F[70] * y2 + F[71] * y3 + F[72] * y4
        b1 -= F[0] * y1 + F[1] * y2 + F[2] * y3 + F[3] * y4
        b2 -= F[4] * y1 + F[5] * y2 + F[6] * y3 + F[7] * y4
        b3 -= F[8] * y1 + F[9] * y2 + F[10] * y3 + F[11] * y4
    if i >= begin + 1:
        y = x[o - 1]
        y0, y1, y2, y3, y4 = y[0], y[1], y[2], y[3], y[4]
        b0 -= F[12] * y0 + F[13] * y1 + F[14] * y2 + F[15] * y3 + F[16] * y4
        b1 -= F[17] * y0 + F[18] * y1 + F[19] * y2 + F[20] * y3 + F[21] * y4
        b2 -= F[22] * y0 + F[23] * y1 + F[24] * y2 + F[25] * y3 + F[26] * y4
        b3 -= F[27] * y0 + F[28] * y1 + F[29] * y2 + F[30] * y3 + F[31] * y4
        b4 -= F[32] * y0 + F[33] * y1 + F[34] * y2 + F[35] * y3 + F[36] * y4
    row[0], row[1], row[2], row[3], row[4] = b0, b1, b2, b3, b4


@inner
def carry_narrow(F, x, o, i, begin, solved):
    """As `carry_wide` of a narrow row, and its solution where it is to be solved."""
    row = x[o]
    b0, b1, b2, b3 = row[0], row[1], row[2], row[3]
    if i >= begin + 1:
        y = x[o - 1]
        y0, y1, y2 = y[1], y[2], y[3]
        b0 += F[9] * y0 + F[10] * y1 + F[11] * y2
        b1 -= F[0] * y0 + F[1] * y1 + F[2] * y2
        b2 -= F[3] * y0 + F[4] * y1 + F[5] * y2
        b3 -= F[6] * y0 + F[7] * y1 + F[8] * y2
    if solved:
        b0, b1, b2, b3 = solve4(
            (F[12], F[13], F[14], F[15], b0),
            (F[16], F[17], F[18], F[19], b1),
            (F[20], F[21], F[22], F[23], b2),
            (F[24], F[25], F[26], F[27], b3),
        )
    row[0], row[1], row[2], row[3], row[4] = b0, b1, b2, b3, 0.0


@inner
def carry_block(X, W, x, i, o, n, begin, solved):
    """Another right-hand side, in row o of x, becomes that of X_i: of block i of n + 1, from those of the blocks before.

    begin: the first block that has any; solved: whether the pivot block is solved, else it becomes its right-hand side.
    """
    k = (n + 1) * ROW + i * KEPT
    F = X[k:]
    if F[63] > 0.0:
        carry_wide(F, x, o, i, begin)
        if solved:
            if 0 < i < n:
                solve_factored(F, x[o])
            else:
                solve5(X, k + 37, W, x, o)
    else:
        carry_narrow(F, x, o, i, begin, solved)


@inner
def prepare_sweep(X, W, M, begin, n):
    """Fill M (N+1, SWEEP), n = N, with what `sweep` reads of the rows from `begin` on.

    But for the first and the last row: the rows of (x_{i-1}, dr_{i-2}, dpsi_{i-2}) as the solved pivot block has them.
    Worth its time for five sweeps and more.
    """
    for i in range(max(begin, 1), n):
        F, m = X[(n + 1) * ROW + i * KEPT :], M[i]
        if F[63] > 0.0:
            for j in range(SIZE):
                for r in range(SIZE):
                    W[r] = F[12 + SIZE * r + j]
                solve_factored(F, W)
                for r in range(SIZE):
                    m[9 * r + j] = W[r]
            for j in range(4):
                W[0], W[1], W[2], W[3], W[4] = F[69 + j], F[j], F[4 + j], F[8 + j], 0.0
                solve_factored(F, W)
                for r in range(SIZE):
                    m[9 * r + SIZE + j] = W[r]
        else:
            for j in range(SWEEP):
                m[j] = 0.0
            for j in range(3):
                m[1 + j], m[10 + j], m[19 + j], m[28 + j] = solve4(
                    (F[12], F[13], F[14], F[15], -F[9 + j]),
                    (F[16], F[17], F[18], F[19], F[j]),
                    (F[20], F[21], F[22], F[23], F[3 + j]),
                    (F[24], F[25], F[26], F[27], F[6 + j]),
                )


@inner
def solve_pivot(X, W, x, i, n):
    """Solve the pivot block of row i, which is not the last, for the right-hand side in x_i, in place."""
    k = (n + 1) * ROW + i * KEPT
    F, row = X[k:], x[i]
    if F[63] <= 0.0:
        row[0], row[1], row[2], row[3] = solve4(
            (F[12], F[13], F[14], F[15], row[0]),
            (F[16], F[17], F[18], F[19], row[1]),
            (F[20], F[21], F[22], F[23], row[2]),
            (F[24], F[25], F[26], F[27], row[3]),
        )
        row[4] = 0.0
    elif i == 0:
        solve5(X, k + 37, W, x, i)
    else:
        solve_factored(F, row)


@inner
def carry_given(X, W, given, x, joined, begin):
    """As `solve_forward`, of a right-hand side in x itself: only of nodes i with given[i] != 0, none before `begin`."""
    n = x.shape[0] - 1
    for i in range(begin, n + 1):
        if given[i] == 0:
            for j in range(SIZE):
                x[i, j] = 0.0
        carry_block(X, W, x, i, i, n, begin, not (joined and i == n))


@inner
def sweep(X, W, M, given, x, joined, begin):
    """As `carry_given`, faster and with ten times its round-off; M: as `prepare_sweep` has filled it.

    From row to row it waits for one product alone.
    """
    n = x.shape[0] - 1
    y0, y1, y2, y3, y4 = 0.0, 0.0, 0.0, 0.0, 0.0
    z1, z2, z3, z4 = 0.0, 0.0, 0.0, 0.0
    for i in range(begin, n):
        row, m = x[i], M[i]
        b0, b1, b2, b3, b4 = 0.0, 0.0, 0.0, 0.0, 0.0
        if given[i] != 0:
            solve_pivot(X, W, x, i, n)
            b0, b1, b2, b3, b4 = row[0], row[1], row[2], row[3], row[4]
        b0 -= m[5] * z1 + m[6] * z2 + m[7] * z3 + m[8] * z4
        b1 -= m[14] * z1 + m[15] * z2 + m[16] * z3 + m[17] * z4
        b2 -= m[23] * z1 + m[24] * z2 + m[25] * z3 + m[26] * z4
        b3 -= m[32] * z1 + m[33] * z2 + m[34] * z3 + m[35] * z4
        b4 -= m[41] * z1 + m[42] * z2 + m[43] * z3 + m[44] * z4
        b0 -= m[0] * y0 + m[1] * y1 + m[2] * y2 + m[3] * y3 + m[4] * y4
        b1 -= m[9] * y0 + m[10] * y1 + m[11] * y2 + m[12] * y3 + m[13] * y4
        b2 -= m[18] * y0 + m[19] * y1 + m[20] * y2 + m[21] * y3 + m[22] * y4
        b3 -= m[27] * y0 + m[28] * y1 + m[29] * y2 + m[30] * y3 + m[31] * y4
        b4 -= m[36] * y0 + m[37] * y1 + m[38] * y2 + m[39] * y3 + m[40] * y4
        row[0], row[1], row[2], row[3], row[4] = b0, b1, b2, b3, b4
        z1, z2, z3, z4 = y1, y2, y3, y4
        y0, y1, y2, y3, y4 = b0, b1, b2, b3, b4
    if given[n] == 0:
        for j in range(SIZE):
            x[n, j] = 0.0
    carry_block(X, W, x, n, n, n, begin, not joined)


@inner
def solve_forward(X, W, b, x, joined, begin):
    """The first half of `solve_with`: what another right-hand side makes of that of every X_i from `begin` on, into x."""
    n = x.shape[0] - 1
    for i in range(begin, n + 1):
        x[i, 0] = X[(n + 1) * ROW + i * KEPT + 62] * b[i, 0]
        for j in range(1, SIZE):
            x[i, j] = b[i, j]
        carry_block(X, W, x, i, i, n, begin, not (joined and i == n))
    if joined:
        solve_last(X, (n + 1) * ROW + n * KEPT, x, n)


@inner
def solve_backward(X, x, begin):
    """The second half of `solve_with`, in place, back to block `begin`."""
    n = x.shape[0] - 1
    total = 0.0
    z1, z2, z3 = 0.0, 0.0, 0.0
    y0, y1, y2, y3, y4 = x[n, 0], x[n, 1], x[n, 2], x[n, 3], x[n, 4]
    for i in range(n - 1, begin - 1, -1):
        R, row = X[i * ROW :], x[i]
        x0, x1, x2, x3, x4 = row[0], row[1], row[2], row[3], row[4]
        if X[(n + 1) * ROW + i * KEPT + 63] > 0.0:  # what came last is taken last, lest all wait for it
            x0 -= R[5] * z1 + R[6] * z2 + R[7] * z3
            x1 -= R[14] * z1 + R[15] * z2 + R[16] * z3
            x2 -= R[23] * z1 + R[24] * z2 + R[25] * z3
            x3 -= R[32] * z1 + R[33] * z2 + R[34] * z3
            x4 -= R[41] * z1 + R[42] * z2 + R[43] * z3
            x4 -= R[36] * y0 + R[37] * y1 + R[38] * y2 + R[39] * y3 + R[40] * y4
        x0 -= R[0] * y0 + R[1] * y1 + R[2] * y2 + R[3] * y3 + R[4] * y4
        x1 -= R[9] * y0 + R[10] * y1 + R[11] * y2 + R[12] * y3 + R[13] * y4
        x2 -= R[18] * y0 + R[19] * y1 + R[20] * y2 + R[21] * y3 + R[22] * y4
        x3 -= R[27] * y0 + R[28] * y1 + R[29] * y2 + R[30] * y3 + R[31] * y4
        row[0], row[1], row[2], row[3], row[4] = x0, x1, x2, x3, x4
        total += abs(x0) + abs(x1) + abs(x2) + abs(x3) + abs(x4)
        z1, z2, z3 = y1, y2, y3
        y0, y1, y2, y3, y4 = x0, x1, x2, x3, x4
    return total < math.inf


@inner
def solve_with(X, W, b, x, joined):
    """As `solve_again`; joined: the end is joined to a point (kernels.junctions.joined_lines), and is held there."""
    solve_forward(X, W, b, x, joined, 0)
    return solve_backward(X, x, 0)


@inner
def add_to_right(X, part, x):
    """Add a part of what `solve_forward` has left in x to the right-hand sides of all X_i."""
    for i in range(x.shape[0]):
        for k in range(SIZE):
            X[i * ROW + k * SPAN + SPAN - 1] += part * x[i, k]


@kernel
def solve_again(X, W, b, x):
    """Solve with another right-hand side b (N+1, 5) and the factors that the last march kept behind the X_i.

    b: length of the cell before (m), balance of the node (N), spin of the cell after (N m), as the march assembles
    them; of a held node nothing, because it stays.  x as in `substitute`; False if it is not finite.
    """
    return solve_with(X, W, b, x, False)
