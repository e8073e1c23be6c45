"""Literal shooting: particular and homogeneous solutions marched from s = 0 to L, the far end fitted.

GP (13)-(18) for Newton's correction d: on every piece d = P + H xi, six columns on a rod and three
on a catenary.  At a joint catenary -> rod three columns are born (the turn of the rod, which the
catenary knows nothing about); at a joint rod -> catenary the three conditions of no moment, GP (18),
tie three of the constants and the turn is left behind.  Nothing is re-orthogonalised and nothing is
pivoted along s: the growth of H, exp(L/lambda) on a taut rod with lambda = sqrt(EI/T), costs
its digits, `Fit.condition` measures how many.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .rotations import Array


@dataclass(frozen=True)
class Linear:
    """Newton's linear problem: per piece cell blocks, per meeting blocks, and the rows of the two ends.

    cells[i]: residual (n-1, m), left (n-1, m, m), right (n-1, m, m); meetings[i] between pieces i
    and i+1: residual (r,), left (r, m), right (r, m'); start, end: residual (m/2,), rows (m/2, m).
    spin[i]: piece i opens a run of rods whose turn nothing holds; scales[i] (m,): size of the unknowns.
    """

    cells: list[tuple[Array, Array, Array]]
    meetings: list[tuple[Array, Array, Array]]
    start: tuple[Array, Array]
    end: tuple[Array, Array]
    spin: list[bool]
    scales: list[Array]


@dataclass(frozen=True)
class Fit:
    """The correction per piece (n, m), the growth of the homogeneous solutions, the condition of the far-end fit."""

    change: list[Array]
    growth: float
    condition: float


def march(linear: Linear) -> Fit:
    """Solve the linear problem by one sweep from s = 0 to L; LinAlgError or non-finite numbers where it dies."""
    columns: list[Array] = []  # per piece (n, m, 1 + k): P first, then H
    ties: list[tuple[Array, Array]] = []  # per meeting: xi on the left = first + second xi on the right
    growth = 1.0
    X = _open(linear.start[0], linear.start[1], linear.scales[0])
    for i, (residual, left, right) in enumerate(linear.cells):
        if i:
            X, tie = _pass(X, linear.meetings[i - 1], linear.spin[i], linear.scales[i])
            ties.append(tie)
        step = -np.linalg.solve(right, np.concatenate([residual[..., None], left], 2))
        run = np.empty((len(step) + 1, *X.shape))
        run[0] = X
        for j, cell in enumerate(step):
            X = cell[:, 1:] @ X
            X[:, 0] += cell[:, 0]
            run[j + 1] = X
        columns.append(run)
        size = np.linalg.norm(run[..., 1:] / linear.scales[i][:, None], axis=(1, 2))
        growth = max(growth, float(size.max() / size[0])) if np.isfinite(size).all() else np.inf
    xi, condition = _close(X, linear.end[0], linear.end[1])
    change = [np.empty(0)] * len(columns)
    for i in range(len(columns) - 1, -1, -1):
        change[i] = columns[i][..., 0] + columns[i][..., 1:] @ xi
        if i:
            first, second = ties[i - 1]
            xi = first + second @ xi
    return Fit(change, growth, condition)


def _free(rows: Array, residual: Array) -> tuple[Array, Array]:
    """Smallest solution of rows z = -residual, and an orthonormal basis of what it leaves free (QR)."""
    k = len(rows)
    size = np.linalg.norm(rows, axis=1)
    Q, R = np.linalg.qr((rows / size[:, None]).T, mode="complete")
    first: Array = -Q[:, :k] @ np.linalg.solve(R[:k].T, residual / size)
    return first, Q[:, k:]


def _open(residual: Array, rows: Array, scale: Array) -> Array:
    """Columns (m, 1 + m/2) at s = 0 that satisfy the start conditions."""
    first, basis = _free(rows * scale, residual)
    return scale[:, None] * np.column_stack([first, basis])


def _pass(X: Array, meeting: tuple[Array, Array, Array], spin: bool, scale: Array) -> tuple[Array, tuple[Array, Array]]:
    """Columns on the right of a meeting, and how the constants on the left follow from those on the right."""
    residual, left, right = meeting
    m, count = right.shape[1], X.shape[1] - 1
    tie = np.zeros(count), np.eye(count)
    if left.shape[1] > m:  # rod -> catenary, GP (18): no moment on the left
        tie = _free(left[6:] @ X[:, 1:], residual[6:] + left[6:] @ X[:, 0])
        X = np.column_stack([X[:, 0] + X[:, 1:] @ tie[0], X[:, 1:] @ tie[1]])
        residual, left, right = residual[:6], left[:6], right[:6]
    known, born = np.arange(len(residual)), np.arange(len(residual), m)
    if spin:  # a round rod that nothing holds: its twist is free and its turn about itself is not
        residual, left, right = residual.copy(), left.copy(), right.copy()
        residual[8], left[8], right[8] = 0.0, 0.0, 0.0
        right[8, 11] = 1.0
        known, born = np.array([0, 1, 2, 3, 4, 5, 6, 7, 11]), np.array([9, 10, 8])
    width = X.shape[1]
    out = np.zeros((m, width + len(born)))
    out[born, width + np.arange(len(born))] = scale[born]
    feed = -left @ np.column_stack([X, np.zeros((len(X), len(born)))]) - right[:, born] @ out[born]
    feed[:, 0] -= residual
    out[known] = np.linalg.solve(right[:, known], feed)
    if len(born):
        tie = tie[0], np.column_stack([tie[1], np.zeros((count, len(born)))])
    return out, tie


def _close(X: Array, residual: Array, rows: Array) -> tuple[Array, float]:
    """Constants that fit the far end, and the condition of that fit with rows and columns brought to size one."""
    A, b = rows @ X[:, 1:], residual + rows @ X[:, 0]
    across = np.abs(A).max(1)
    A, b = A / across[:, None], b / across
    down = np.abs(A).max(0)
    A = A / down
    if not np.isfinite(A).all():
        return np.full(len(b), np.nan), np.inf
    condition = float(np.linalg.cond(A))
    return -np.linalg.solve(A, b) / down, condition
