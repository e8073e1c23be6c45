"""Natural modes of a network: the eigenvalues of A q = w^2 M q nearest to a frequency, and how many lie below."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import eig_banded
from scipy.sparse.linalg import splu

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.state import Floats
from hybrid.linear.matrices import LinearNetwork

# More modes are found than asked for, so that the last are not cut off from others of the same frequency.
MORE = 4
# Where no frequency is given the shift lies below zero by this part of a size of w^2: what drifts is found too.
BELOW = 1e-3
# Two w^2 are as good as equal below this relative difference.
SAME = 1e-7
# Below this their shapes are any of those between them, by round-off.
EQUAL = 1e-10
# Networks with fewer unknowns that have mass than so many times the modes that are wanted are decomposed whole.
DENSE = 2
# Vectors that are followed together: modes of a line come in pairs of one frequency, of its two planes, and a twist may
# have the same.  What is left of a mode in the next block, and of a vector that the blocks before have all of, of the
# largest 1/(w^2 - shift).
BLOCK = 3
BLOCK_LEFT = 1e-13  # of the largest 1/(w^2 - shift): modes have converged
SPENT = 1e-12  # of the same: a vector of a block adds nothing to those before
# Of a new vector, how much is left of it beside those before, at least.
OWN = 0.5
SHIFTS = 4  # that are tried,
ASIDE = 1.37e-3  # each by this part farther off
LEFT = 1e-3  # residual of a mode's equations, of their largest term, at most,
NO_FORCE = 1e-13  # and of the largest stiffness: round-off
SEED = 1
# A mode costs nothing whose w^2 is below this part of what it were if all that it moves held it,
COSTS_NOTHING = 1e-8
NO_SQUARE = 1e-6  # which counts as at least this part of the largest found


@dataclass(frozen=True)
class Eigen:
    """Modes of a network: w^2 (m,) 1/s^2, increasing, and vectors (q, m) of mass 1.

    missed: modes between zero and the largest found that were not found; None: it could not be counted.
    """

    squares: Floats
    vectors: Floats
    missed: int | None


def lowest_modes(network: LinearNetwork, count: int, near: float | None = None) -> Eigen:
    """The modes nearest to a frequency `near`, rad/s; None: the lowest.  ComputationError where there are fewer."""
    A, M = network.stiffness, network.mass
    tight = (network.tensions > 0.0) & (A.diagonal() == 0.0)  # cells that do not stretch, each of which holds a motion
    most = int((M.diagonal() > 0.0).sum()) - int(tight.sum())
    if most < 1:
        raise ComputationError(Outcome.SINGULAR, None, None, "nothing of this network can move: it has no modes")
    count = min(count, most)
    wanted = min(count + MORE, most)
    shift = near * near if near is not None else -BELOW * network.slow
    squares, vectors = _proved(A, M, shift, wanted)
    order = np.argsort(squares)
    squares, vectors = squares[order], vectors[:, order]
    missed = _missed(network, squares, near is not None)
    chosen = np.arange(count)
    if near is not None:
        away = np.abs(np.sqrt(np.maximum(squares, 0.0)) - near)
        chosen = np.sort(np.argsort(away)[:count])
    return Eigen(squares[chosen], _turned_apart(squares[chosen], vectors[:, chosen]), missed)


def round_off(network: LinearNetwork, found: Eigen) -> Floats:
    """w^2 (m,), 1/s^2, within which that of a mode is none, whatever the stiffest mode that was found with it."""
    size, largest = np.abs(found.vectors), max(float(np.abs(found.squares).max()), 1e-300)
    held = np.einsum("ij,ij->j", size, np.abs(network.stiffness) @ size)
    return np.asarray(COSTS_NOTHING * np.clip(held, NO_SQUARE * largest, largest))


def _turned_apart(squares: Floats, vectors: Floats) -> Floats:
    """Modes of equal w^2, turned among themselves: the first has all of the unknown that moves most, and so on."""
    out = vectors.copy()
    same = np.abs(np.diff(squares)) <= EQUAL * np.maximum(np.abs(squares[1:]), np.abs(squares[:-1]))
    for k in np.flatnonzero(same):
        stop = k + 2
        while stop < len(squares) and same[stop - 1]:
            stop += 1
        row = out[np.argmax(np.einsum("ij,ij->i", out[:, k:stop], out[:, k:stop])), k:stop]
        out[:, k:stop] = out[:, k:stop] @ np.linalg.qr(row[:, None], mode="complete")[0]
    return out


def _proved(A: sparse.csc_array, M: sparse.csc_array, shift: float, count: int) -> tuple[Floats, Floats]:
    """The w^2 nearest to a shift and their vectors, which fulfil the equations; a shift that is a w^2 itself is moved.

    ComputationError: none of the shifts gives them.
    """
    nearest = _every if DENSE * count > (M.diagonal() > 0.0).sum() else _nearest
    for k in range(SHIFTS):
        moved = shift * (1.0 + k * ASIDE)
        try:
            squares, vectors = nearest(A, M, moved, count)
        except (RuntimeError, np.linalg.LinAlgError):  # exactly singular; no convergence
            continue
        size = np.abs(A) @ np.abs(vectors) + np.abs(M) @ np.abs(vectors) * np.abs(squares)
        left = np.abs(A @ vectors - (M @ vectors) * squares)
        round_off = NO_FORCE * float(np.abs(A).max()) * np.abs(vectors).max(axis=0)
        if (left.max(axis=0) <= LEFT * size.max(axis=0) + round_off).all():
            return squares, vectors
    detail = f"modes near a w^2 of {shift:.4g} 1/s^2 do not fulfil their equations, whatever the shift"
    raise ComputationError(Outcome.SINGULAR, None, None, detail)


def _every(A: sparse.csc_array, M: sparse.csc_array, shift: float, count: int) -> tuple[Floats, Floats]:
    """As `_nearest`, from all eigenvalues of M^1/2 (A - shift M)^-1 M^1/2."""
    sizes, axes = np.linalg.eigh(M.toarray())
    there = sizes > 1e-14 * sizes[-1]
    root = axes[:, there] * np.sqrt(sizes[there])
    answer = np.linalg.solve((A - shift * M).toarray(), root)
    inverse, vectors = np.linalg.eigh(root.T @ answer)
    largest = np.argsort(-np.abs(inverse))[:count]
    vectors = answer @ vectors[:, largest]
    vectors /= np.sqrt(np.einsum("ij,ij->j", vectors, M @ vectors))
    return np.einsum("ij,ij->j", vectors, A @ vectors), np.asarray(vectors)


def _nearest(A: sparse.csc_array, M: sparse.csc_array, shift: float, count: int) -> tuple[Floats, Floats]:
    """The w^2 nearest to a shift, by Lanczos on (A - shift M)^-1 M, in blocks, orthogonal in the product of M.

    Its products are too small for threads of BLAS, which wait for each other on a busy machine: 0.2 s for 5 ms.
    """
    factors = splu(sparse.csc_array(A - shift * M))
    W = factors.solve(M @ np.random.default_rng(SEED).normal(size=(A.shape[0], BLOCK)))
    Q, MQ, _ = _orthonormal(W, M, 0.0)
    H, check = np.zeros((0, 0)), 7 * count // 2  # where most have been found
    while True:
        known, size = len(H), Q.shape[1]
        W = factors.solve(MQ[:, known:])
        C = MQ.T @ W
        W -= Q @ C
        W -= Q @ (MQ.T @ W)
        H = np.pad(H, (0, size - known))
        H[:, known:], H[known:] = C, C.T
        largest = float(np.abs(H.diagonal()).max())
        W, MW, R = _orthonormal(W, M, SPENT * largest)
        if W.size:  # what is small has round-off of those before, and where these span all it has nothing else
            W, MW, again = _orthonormal(W - Q @ (MQ.T @ W), M, OWN)
            R = again @ R
        if size >= check or not W.size:
            inverse, axes = _banded(H)
            order = np.argsort(-np.abs(inverse))[:count]
            left = np.abs(R @ axes[known:, order])
            if left.max(initial=0.0) <= BLOCK_LEFT * largest:
                break
            check = size + 4 * BLOCK
        Q, MQ = np.hstack([Q, W]), np.hstack([MQ, MW])
    if order.size < count:
        raise np.linalg.LinAlgError("fewer modes than wanted")
    # what has no mass follows what has: one more round takes the rest of the start out of it
    vectors = factors.solve(np.einsum("ij,jk->ik", MQ, axes[:, order]))
    vectors /= np.sqrt(np.einsum("ij,ij->j", vectors, M @ vectors))
    return np.einsum("ij,ij->j", vectors, A @ vectors), np.asarray(vectors)


def _orthonormal(W: Floats, M: sparse.csc_array, least: float) -> tuple[Floats, Floats, Floats]:
    """Q, M Q and R with W = Q R and Q^T M Q = 1; columns of Q that are no larger than `least` are left out."""
    MW = M @ W
    sizes, axes = np.linalg.eigh(W.T @ MW)
    there = sizes > least * least
    roots = np.sqrt(sizes[there])
    parts, R = axes[:, there] / roots, roots[:, None] * axes[:, there].T
    Q = W @ parts
    if roots.size and roots[0] < 1e-3 * roots[-1]:  # their directions have lost digits
        Q, MQ, again = _orthonormal(Q, M, 0.0)
        return Q, MQ, again @ R
    return Q, MW @ parts, R


def _banded(H: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues and vectors of a symmetric matrix of blocks on and beside its diagonal."""
    band = np.zeros((min(2 * BLOCK, len(H)), len(H)))
    for k, row in enumerate(band):
        row[: len(H) - k] = np.diagonal(H, -k)
    values, vectors = eig_banded(band, lower=True, select="i", select_range=(0, len(H) - 1))
    return values, vectors


def _gap_above(squares: Floats, least: int) -> float | None:
    """A w^2 in a gap behind at least so many of those found; None: none is wide enough."""
    for k in range(len(squares) - 1, least - 1, -1):
        a, b = squares[k - 1], squares[k]
        if b - a > SAME * max(abs(a), abs(b)):
            return float(0.5 * (a + b))
    return None


def _below(network: LinearNetwork, square: float) -> int | None:
    """How many modes have a smaller w^2 (Sylvester's law of inertia); None: the factors do not tell."""
    A = network.stiffness - square * network.mass - sparse.diags_array(network.tensions)
    try:
        factors = splu(
            sparse.csc_array(A),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )
    except RuntimeError:
        return None
    if not np.array_equal(factors.perm_r, factors.perm_c):
        return None
    return int((factors.U.diagonal() < 0.0).sum()) - int((network.tensions > 0.0).sum())


def _missed(network: LinearNetwork, squares: Floats, between: bool) -> int | None:
    """Modes below a gap near the largest w^2 found, less those found there; between: above one near the least, too."""
    high, low = _gap_above(squares, 1 + between), None
    if between:
        low = _gap_above(-squares[::-1], 2)
        low = None if low is None else -low
    if high is None or (between and (low is None or not low < high)):
        return None
    above, under = _below(network, high), 0 if low is None else _below(network, low)
    if above is None or under is None:
        return None
    return above - under - int(((squares > (-np.inf if low is None else low)) & (squares < high)).sum())
