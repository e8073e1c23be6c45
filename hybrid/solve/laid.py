"""A line that lies somewhere without tension, before it is pulled to its equilibrium with friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.state.forces import SEABED
from hybrid.kernels.state.state import Ends, Line, Sea, State
from hybrid.solve.flaws import on_obstacles


def laid_without_tension(line: Line, sea: Sea, ends: Ends, state: State) -> State:
    """A copy of an equilibrium whose stretches on the bed and on obstacles have their unstretched length, without

    friction yet.  A stretch keeps its path, and its place at a held end that lies there, too; one without such an end,
    or with two, keeps the place of its middle.  The displacement of a node from here is the travel that friction
    opposes (docs/theory.md, T17b).
    """
    laid, cells = state.copy(), line.h.size
    laid.slip[:] = 0.0
    touches = np.asarray(on_obstacles(line, sea, state).any(axis=0))
    if line.bits & SEABED:
        touches |= planes_under(sea, state.r)[1] > 0.5 * sea.onset
    touches[0] |= bool(ends.held[0]) and bool(touches[1])
    touches[cells] |= bool(ends.held[1]) and bool(touches[cells - 1])
    shortening = (line.h / np.linalg.norm(state.e, axis=1) - 1.0)[:, None] * state.e
    for first, last in _stretches(touches):
        shift = np.vstack([np.zeros(3), np.cumsum(shortening[first:last], axis=0)])
        count, held = last - first, (first == 0 and ends.held[0], last == cells and ends.held[1])
        kept = 0.5 * (shift[count // 2] + shift[(count + 1) // 2])  # of the middle, between two nodes if need be
        if any(held) and not all(held):
            kept = shift[0 if held[0] else count]
        laid.r[first : last + 1] += shift - kept
    for k in np.flatnonzero(ends.held):
        laid.r[-k] = state.r[-k]
    laid.e[:] = np.diff(laid.r, axis=0)
    d = laid.e / np.linalg.norm(laid.e, axis=1)[:, None]
    across = laid.a1 - np.einsum("ij,ij->i", laid.a1, d)[:, None] * d
    laid.a1[:] = across / np.linalg.norm(across, axis=1)[:, None]
    return laid


def _stretches(touches: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last node of every run of nodes that touch, of at least two nodes."""
    turns = np.flatnonzero(np.diff(np.concatenate([[False], touches, [False]]).astype(np.int8)))
    for first, after in turns.reshape(-1, 2):
        if after - first > 1:
            yield int(first), int(after) - 1
