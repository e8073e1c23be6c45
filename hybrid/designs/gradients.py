"""Gradients of results of a line at rest by its unknowns q.

From them one transposed solve has the derivative of a result g by all numbers:  dg/dp = λ·∂R/∂p  with  Aᵀλ = ∂g/∂q
(theory.md, 22).  A result depends on the unknowns near its place, or near the ends of the line.  Only these are moved,
each by itself; that no other one counts is tried with all of the others at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybrid.designs.line_at_rest import LineAtRest, anywhere, steps_along
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.state.state import Floats

# Nodes to either side of a place on which a result there may depend, tried in turn; then it is all of the line.
REACHES = (2, 5)
# What the others may change of a result, as a part of the most that one unknown changes by a movement as large.
OUTSIDE = 1e-8


class Gradients:
    """Of all results of a line: by its unknowns, and by turns of its ends."""

    def __init__(self, line: LineAtRest, turning: Sequence[int] = ()) -> None:
        """turning: ends whose frames turn with what they are joined to."""
        self._line, self._turning = line, list(turning)
        self._every = np.ones((line.model.line.s.size, SIZE), bool)
        self._every[0, 0] = self._every[-1, -1] = False  # there is no cell before the first node, nor behind the last

    def pay_for(self, numbers: int) -> bool:
        """Whether so many numbers are more than the unknowns that are moved, each of which costs what a number does."""
        turned = 3 * len(self._turning)
        fewest = int(np.count_nonzero(self._near(REACHES[0]))) + turned
        return numbers > fewest and numbers > int(np.count_nonzero(self._moved)) + turned

    @cached_property
    def by_unknowns(self) -> Floats:
        """(W, N+1, 5) per m of positions, per N of tensions, per rad of spins."""
        out = np.zeros((len(self._line.wanted), *self._every.shape))
        out[:, self._moved] = self._line.by_state(_each(self._moved)).T
        return out

    @cached_property
    def by_turns(self) -> Floats:
        """(W, 2, 3) per rad, by turns of the ends."""
        out = np.zeros((len(self._line.wanted), 2, 3))
        for k in self._turning:
            turns = np.zeros((3, 2, 3))
            turns[:, k] = np.eye(3)
            out[:, k] = self._line.by_state(np.zeros((3, *self._every.shape)), turns).T
        return out

    def _near(self, reach: int) -> np.ndarray:
        """Which unknowns (N+1, 5) are within a number of nodes of the places of results."""
        near = np.zeros(len(self._every), bool)
        for i in self._line.near():
            near[max(i - reach - 1, 0) : i + reach + 1] = True
        return np.asarray(self._every & near[:, None])

    @cached_property
    def _moved(self) -> np.ndarray:
        """Which unknowns (N+1, 5) are moved."""
        return next((x for x in map(self._near, REACHES) if self._suffices(x)), self._every)

    def _suffices(self, moved: np.ndarray) -> bool:
        """Whether results depend on these unknowns and on no other one."""
        line, others, q = self._line, self._every & ~moved, _each(moved)
        most = np.abs(line.by_state(q) * steps_along(line.state, q)[:, None]).max(axis=0)
        far = anywhere(line.state, SIZE) * others
        change = np.abs(line.by_state(far)[0] * steps_along(line.state, far)[0])
        return bool((change <= OUTSIDE * most).all())


def _each(moved: np.ndarray) -> Floats:
    """(D, N+1, 5) movements of one unknown each."""
    q = np.zeros((int(np.count_nonzero(moved)), *moved.shape))
    q[(np.arange(len(q)), *np.nonzero(moved))] = 1.0
    return q


# Solves with the matrix of an equilibrium and its transpose, to rounding of the matrix.


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
