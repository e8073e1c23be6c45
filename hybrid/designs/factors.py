"""Solves with the matrix of an equilibrium and its transpose, to rounding of the matrix."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybrid.kernels.state.state import Floats


class Factors:
    """Factors of a sparse matrix.

    Each solve is corrected once by what it leaves: rows in N beside rows in m and N m would else lose three digits of
    what hardly answers.
    """

    def __init__(self, matrix: sparse.csc_array) -> None:
        self._matrix, self._factors = matrix, splu(matrix)

    def solve(self, right: Floats, transposed: bool = False) -> Floats:
        """x (n, P) of A x = right, or of its transpose."""
        matrix, kind = (self._matrix.T, "T") if transposed else (self._matrix, "N")
        x = self._factors.solve(right, kind)
        return np.asarray(x + self._factors.solve(right - matrix @ x, kind))
