"""Tables that are no rows of blocks: sparse matrices, narrow bands, small dense ones; where a number lies among knots."""

from __future__ import annotations

import math

from hybrid.kernels.machine.compile import inner, kernel

FEW = 3  # columns of values that are gone through one by one: a loop over so few costs more than the products


@kernel
def add_rows(begin, columns, weights, x, out):
    """Add to out (ns, m) the product of a matrix and x (n, m).

    Row i of the matrix has the weights[begin[i] : begin[i + 1]] in the columns of the same places.
    """
    if out.shape[1] <= FEW:
        for j in range(out.shape[1]):
            for i in range(out.shape[0]):
                total = out[i, j]
                for k in range(begin[i], begin[i + 1]):
                    total += weights[k] * x[columns[k], j]
                out[i, j] = total
        return
    for i in range(out.shape[0]):
        for k in range(begin[i], begin[i + 1]):
            c, w = columns[k], weights[k]
            for j in range(out.shape[1]):
                out[i, j] += w * x[c, j]


@kernel
def is_definite(band):
    """Whether a symmetric matrix is positive definite: its Cholesky factor takes its place.

    band: (b+1, n), row k has the k-th diagonal below the main one, as `scipy.linalg.cholesky_banded` has it (lower).
    """
    below, n = band.shape[0] - 1, band.shape[1]
    for j in range(n):
        pivot = band[0, j]
        if not (pivot > 0.0 and pivot < math.inf):
            return False
        root = math.sqrt(pivot)
        band[0, j] = root
        last = min(below, n - 1 - j)
        for k in range(1, last + 1):
            band[k, j] /= root
        for k in range(1, last + 1):  # column j + k of what is left
            for m in range(k, last + 1):
                band[m - k, j + k] -= band[m, j] * band[k, j]
    return True


@inner
def bracket(x, at, first, last, near):
    """The two of x[first] .. x[last] that interpolation at a place uses, and the weight of the second.

    near: the first of the two at a place nearby, where the search begins: places rise along a line.
    """
    low = min(max(near, first), last) + 1
    while low > first and not x[low - 1] < at:
        low -= 1
    while low <= last and x[low] < at:
        low += 1
    left = max(min(low - 1, last - 1), first)
    right = min(left + 1, last)
    return left, right, (at - x[left]) / (x[right] - x[left]) if left < right else 0.0


@kernel
def linear_rows(x, places, first, last, shift, begin, columns, weights):
    """Rows (outputs.observed_states.Rows) of linear interpolation along x[first] .. x[last], and beyond, at places (ns,).

    shift: (ns,) added to columns; begin: (ns+1,) and columns, weights (2 ns,) written.
    """
    at = left = 0
    for g in range(places.shape[0]):
        begin[g] = at
        left, right, p = bracket(x, places[g], first[g], last[g], left)
        if p != 1.0:
            columns[at], weights[at] = left + shift[g], 1.0 - p
            at += 1
        if p != 0.0:
            columns[at], weights[at] = right + shift[g], p
            at += 1
    begin[places.shape[0]] = at


@kernel
def cubic_rows(x, middles, places, first, last, weight, begin, columns, weights):
    """Rows of the Hermite interpolation along the nodes x[first] .. x[last], with the slopes of parabolas there.

    middles: of the cells; weight: (4,) of the two nodes beside a place and of the next ones, work array; columns,
    weights: (4 ns,); the rest as of linear_rows.
    """
    at = left = 0
    for g in range(places.shape[0]):
        begin[g] = at
        left, right, p = bracket(x, places[g], first[g], last[g], left)
        H, q = x[right] - x[left], 1.0 - p
        weight[0] = weight[3] = 0.0
        weight[1] = q * q * (3.0 - 2.0 * q)
        weight[2] = p * p * (3.0 - 2.0 * p)
        for side in range(2):
            node, part = (right, -(H * q * p * p)) if side else (left, H * q * p * q)
            a, b, share = bracket(middles, x[node], first[g], last[g] - 1, node - 1)
            for end in range(2):
                cell, w = (b, share) if end else (a, 1.0 - share)
                w *= part / (x[cell + 1] - x[cell])
                weight[cell - left + 1] -= w
                weight[cell - left + 2] += w
        for k in range(4):
            if weight[k] != 0.0:
                columns[at], weights[at] = left - 1 + k, weight[k]
                at += 1
    begin[places.shape[0]] = at


@inner
def factor_dense(A, m):
    """Factor the m equations in the rows of A, for `substitute_dense`; False: they are singular.

    By elimination with row pivoting, of rows and columns scaled to a largest number of about 1.
    Most numbers of many lines are 0: a pivot row is subtracted where it has others, from rows that have one in its column.
    A has m+5 rows, m+1 columns; its last rows: scales of the columns; columns and rows of a pivot; scales of the rows;
    the row that was exchanged with each.
    """
    for c in range(m):
        A[m, c] = 0.0
    for r in range(m):
        for c in range(m):
            A[m, c] = max(A[m, c], abs(A[r, c]))
    for c in range(m):
        if not 0.0 < A[m, c] < math.inf:
            return False
        A[m, c] = 1.0 / A[m, c]
    for r in range(m):
        big = 0.0
        for c in range(m):
            A[r, c] *= A[m, c]
            big = max(big, abs(A[r, c]))
        if not big > 0.0:
            return False
        for c in range(m):
            A[r, c] /= big
        A[m + 3, r] = big
    for c in range(m):
        best, where, rows, count = abs(A[c, c]), c, 0, 0
        for r in range(c + 1, m):
            size = abs(A[r, c])
            if size > 0.0:
                A[m + 2, rows] = r
                rows += 1
                if size > best:
                    best, where = size, r
        if not best > 0.0:
            return False
        A[m + 4, c] = where
        if where != c:
            for j in range(m):
                A[c, j], A[where, j] = A[where, j], A[c, j]
        if rows > 0:
            for j in range(c + 1, m):
                if A[c, j] != 0.0:
                    A[m + 1, count] = j
                    count += 1
        for i in range(rows):
            r = int(A[m + 2, i])
            f = A[r, c] / A[c, c]
            A[r, c] = f
            for k in range(count):
                j = int(A[m + 1, k])
                A[r, j] -= f * A[c, j]
    return True


@inner
def substitute_dense(A, m):
    """Solve the equations that `factor_dense` has factored for the right-hand side in their last column, in place."""
    for r in range(m):
        A[r, m] /= A[m + 3, r]
    for c in range(m):
        where = int(A[m + 4, c])
        if where != c:
            A[c, m], A[where, m] = A[where, m], A[c, m]
    for c in range(m):
        if A[c, m] != 0.0:
            for r in range(c + 1, m):
                if A[r, c] != 0.0:
                    A[r, m] -= A[r, c] * A[c, m]
    for c in range(m - 1, -1, -1):
        y = A[c, m]
        for j in range(c + 1, m):
            y -= A[c, j] * A[j, m]
        A[c, m] = y / A[c, c]
    for c in range(m):
        A[c, m] *= A[m, c]


@inner
def interval(knots, x):
    """The interval of rising knots that x lies in, or is nearest to."""
    return interval_within(knots, 0, knots.shape[0] - 1, x)


@inner
def interval_within(knots, low, high, x):
    """As `interval`, of those from knot `low` to knot `high`."""
    while high - low > 1:
        middle = (low + high) // 2
        if knots[middle] <= x:
            low = middle
        else:
            high = middle
    return low
