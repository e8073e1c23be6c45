"""Solutions of sums of sparse matrices with complex factors, at many frequencies: the places of numbers stay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse
from scipy.linalg.lapack import zgbsv
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from hybrid.kernels.state.state import Floats

# Bands of more diagonals cost more than sparse factors: the last line on a body has a band of 10, each more adds 5.
WIDEST = 60


class ComplexSolver:
    """Solves  sum_k z_k A_k x = b  for real sparse matrices A_k of one shape.

    Unknowns are put in the order of least bandwidth, in which a line has that of its cells.
    """

    def __init__(self, matrices: Sequence[sparse.csc_array]) -> None:
        size = matrices[0].shape[0]
        keys = [_places(x) for x in matrices]
        self._every = every = np.unique(np.concatenate(keys))
        self._parts = [self._part(x, key) for key, x in zip(keys, matrices, strict=True)]
        begin = np.searchsorted(every, np.arange(size + 1, dtype=np.int64) * size)
        self._pattern = sparse.csc_array((np.zeros(every.size, complex), every % size, begin), shape=(size, size))
        either = sparse.csr_array((np.ones(every.size), (every % size, every // size)), shape=(size, size))
        self._order = reverse_cuthill_mckee(sparse.csr_array(either + either.T), symmetric_mode=True)
        place = np.empty(size, int)
        place[self._order] = np.arange(size)
        row, column = place[every % size], place[every // size]
        self._below, self._above = int((row - column).max()), int((column - row).max())
        self._wide = 2 * self._below + self._above + 1
        self._at = self._below + self._above + row - column + self._wide * column  # in a band by columns

    def replace(self, k: int, matrix: sparse.csc_array) -> bool:
        """Put another matrix in place of A_k; False: it has numbers where no matrix had any, and is not taken."""
        key = _places(matrix)
        if not np.isin(key, self._every).all():
            return False
        self._parts[k] = self._part(matrix, key)
        return True

    def _part(self, x: sparse.csc_array, key: np.ndarray) -> Floats:
        return np.bincount(np.searchsorted(self._every, key), x.data, self._every.size).astype(float)

    def solve(self, factors: Sequence[complex], right: Floats) -> Floats:
        """x (n, ...) for right-hand sides (n, ...); RuntimeError: the matrix is singular."""
        data = np.zeros(self._at.size, complex)
        for z, part in zip(factors, self._parts, strict=True):
            if z.real:
                data.real += z.real * part
            if z.imag:
                data.imag += z.imag * part
        if self._wide > WIDEST:
            self._pattern.data = data
            return np.asarray(splu(self._pattern).solve(right))
        band = np.zeros(self._wide * len(right), complex)
        band[self._at] = data
        band = band.reshape((self._wide, -1), order="F")
        _, _, found, singular = zgbsv(self._below, self._above, band, right[self._order], overwrite_ab=True)
        if singular:
            raise RuntimeError("the matrix is singular")
        out = np.empty_like(found)
        out[self._order] = found
        return out


def _places(x: sparse.csc_array) -> np.ndarray:
    """Of every number of a matrix, increasing by columns."""
    size = x.shape[0]
    return np.repeat(np.arange(size, dtype=np.int64), np.diff(x.indptr)) * size + x.indices
