"""Sparse matrices by rows: their product with a batch of values, and whether one with a narrow band is definite."""

from __future__ import annotations

import math

from hybrid.kernels.compile import kernel


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
