"""Sparse matrices by rows: their product with a batch of values, and whether one with a narrow band is definite."""

from __future__ import annotations

import math

from hybrid.kernels.compile import inner, kernel


@kernel
def add_rows(begin, columns, weights, x, out):
    """Add to out (ns, m) the product of a matrix and x (n, m).

    Row i of the matrix has the weights[begin[i] : begin[i + 1]] in the columns of the same places.
    """
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
def bracket(x, at, first, last):
    """The two of x[first] .. x[last] that interpolation at a place uses, and the weight of the second."""
    low, high = first, last + 1
    while low < high:
        middle = (low + high) // 2
        if x[middle] < at:
            low = middle + 1
        else:
            high = middle
    left = max(min(low - 1, last - 1), first)
    right = min(left + 1, last)
    return left, right, (at - x[left]) / (x[right] - x[left]) if left < right else 0.0


@inner
def put_row(count, columns, weights, at, out_columns, out_weights):
    """The first `count` weights of a row behind `at`, by column: those at the same one add up, and zeros go; the end."""
    for i in range(1, count):
        c, w, k = columns[i], weights[i], i
        while k > 0 and columns[k - 1] > c:
            columns[k], weights[k] = columns[k - 1], weights[k - 1]
            k -= 1
        columns[k], weights[k] = c, w
    for i in range(count):
        if i + 1 < count and columns[i + 1] == columns[i]:
            weights[i + 1] += weights[i]
        elif weights[i] != 0.0:
            out_columns[at], out_weights[at] = columns[i], weights[i]
            at += 1
    return at


@kernel
def linear_rows(x, places, first, last, shift, work_columns, work_weights, begin, columns, weights):
    """Rows (outputs.output_grid.Rows) of linear interpolation along x[first] .. x[last], and beyond, at places (ns,).

    shift: (ns,) added to columns; work_columns, work_weights: (10,); begin: (ns+1,) and columns, weights (2 ns,) written.
    """
    at = 0
    for g in range(places.shape[0]):
        begin[g] = at
        left, right, p = bracket(x, places[g], first[g], last[g])
        work_columns[0], work_columns[1] = left + shift[g], right + shift[g]
        work_weights[0], work_weights[1] = 1.0 - p, p
        at = put_row(2, work_columns, work_weights, at, columns, weights)
    begin[places.shape[0]] = at


@kernel
def cubic_rows(x, middles, places, first, last, work_columns, work_weights, begin, columns, weights):
    """Rows of the Hermite interpolation along the nodes x[first] .. x[last], with the slopes of parabolas there.

    middles: of the cells; columns, weights: (10 ns,); the rest as of linear_rows.
    """
    at = 0
    for g in range(places.shape[0]):
        begin[g] = at
        left, right, p = bracket(x, places[g], first[g], last[g])
        H, q = x[right] - x[left], 1.0 - p
        work_columns[0], work_columns[1] = left, right
        work_weights[0], work_weights[1] = q * q * (3.0 - 2.0 * q), p * p * (3.0 - 2.0 * p)
        k = 2
        for side in range(2):
            node, part = (right, -(H * q * p * p)) if side else (left, H * q * p * q)
            a, b, share = bracket(middles, x[node], first[g], last[g] - 1)
            for end in range(2):
                cell, w = (b, share) if end else (a, 1.0 - share)
                w *= part / (x[cell + 1] - x[cell])
                work_columns[k], work_weights[k] = cell, -w
                work_columns[k + 1], work_weights[k + 1] = cell + 1, w
                k += 2
        at = put_row(10, work_columns, work_weights, at, columns, weights)
    begin[places.shape[0]] = at
