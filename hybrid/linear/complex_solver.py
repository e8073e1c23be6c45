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
        keys = []
        for x in matrices:
            columns = np.repeat(np.arange(size), np.diff(x.indptr))
            keys.append(columns.astype(np.int64) * size + x.indices)
        every = np.unique(np.concatenate(keys))
        self._parts = []
        for key, x in zip(keys, matrices, strict=True):
            part = np.zeros(every.size)
            np.add.at(part, np.searchsorted(every, key), x.data)
            self._parts.append(part)
        begin = np.searchsorted(every, np.arange(size + 1, dtype=np.int64) * size)
        self._pattern = sparse.csc_array((np.zeros(every.size, complex), every % size, begin), shape=(size, size))
        either = sparse.csr_array((np.ones(every.size), (every % size, every // size)), shape=(size, size))
        self._order = reverse_cuthill_mckee(sparse.csr_array(either + either.T), symmetric_mode=True)
        place = np.empty(size, int)
        place[self._order] = np.arange(size)
        row, column = place[every % size], place[every // size]
        self._below, self._above = int((row - column).max()), int((column - row).max())
        self._at = self._below + self._above + row - column, column

    def solve(self, factors: Sequence[complex], right: Floats) -> Floats:
        """x (n, ...) for right-hand sides (n, ...); RuntimeError: the matrix is singular."""
        data = sum(z * part for z, part in zip(factors, self._parts, strict=True))
        wide = 2 * self._below + self._above + 1
        if wide > WIDEST:
            self._pattern.data = np.asarray(data, complex)
            return np.asarray(splu(self._pattern).solve(right))
        band = np.zeros((wide, len(right)), complex, order="F")
        band[self._at] = data
        _, _, found, singular = zgbsv(self._below, self._above, band, right[self._order], overwrite_ab=True)
        if singular:
            raise RuntimeError("the matrix is singular")
        out = np.empty_like(found)
        out[self._order] = found
        return out
