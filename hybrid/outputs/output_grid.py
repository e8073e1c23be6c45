"""From a mesh to the fixed output grid: interpolation as sparse matrices, of second order and more.

Zone by zone: a joint, or a point load, may be a kink, and nothing is drawn across it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.sparse_rows import add_rows
from hybrid.kernels.state import Floats
from hybrid.model.mesh import Zone


class Rows(NamedTuple):
    """A sparse matrix by rows: row i has weights[begin[i] : begin[i+1]] in the columns of the same places."""

    begin: NDArray[np.int64]
    columns: NDArray[np.int64]
    weights: Floats

    def __matmul__(self, x: Floats) -> Floats:
        """The product with x (n, ...), along its first axis."""
        out = np.zeros((self.begin.size - 1, math.prod(x.shape[1:])))
        x = np.require(x, float, ("C", "W"))
        add_rows(self.begin, self.columns, self.weights, x.reshape(x.shape[0], out.shape[1]), out)
        return out.reshape(-1, *x.shape[1:])


def _sparse(columns: np.ndarray, weights: Floats) -> Rows:
    """One row per output point: its weights (ns, k) at their columns; those at the same column add up, and zeros go."""
    order = np.argsort(columns, axis=1, kind="stable")
    columns, weights = np.take_along_axis(columns, order, 1), np.take_along_axis(weights, order, 1)
    for k in range(1, columns.shape[1]):
        same = columns[:, k] == columns[:, k - 1]
        weights[same, k] += weights[same, k - 1]
        weights[same, k - 1] = 0.0
    kept = weights != 0.0
    return Rows(np.append(0, np.cumsum(kept.sum(axis=1))), columns[kept].astype(np.int64), weights[kept])


def _linear(x: Floats, at: Floats, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, Floats]:
    """Interpolation along x[first] .. x[last], and beyond: the two that count, (..., 2), and their weights at `at`.

    Where first = last, that one counts alone.
    """
    left = np.maximum(np.minimum(np.searchsorted(x, at) - 1, last - 1), first)
    right = np.minimum(left + 1, last)
    p = np.divide(at - x[left], x[right] - x[left], out=np.zeros(at.shape), where=left < right)
    return np.stack([left, right], axis=-1), np.stack([1 - p, p], axis=-1)


def _slopes(x: Floats, node: np.ndarray, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, Floats]:
    """Weights (..., 4) of the derivative at a node from the parabola through the three nearest nodes of first .. last.

    It is linear, and in the middle of a cell it is the slope of the secant; of one cell alone there is no other.
    """
    cell, share = _linear(0.5 * (x[:-1] + x[1:]), x[node], first, last - 1)
    w = share / (x[cell + 1] - x[cell])
    return np.concatenate([cell, cell + 1], axis=-1), np.concatenate([-w, w], axis=-1)


def _cubic(x: Floats, at: Floats, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, Floats]:
    """Weights (ns, 10) of the Hermite interpolation along the nodes x[first] .. x[last]."""
    node, p = _linear(x, at, first, last)
    H = np.diff(x[node])
    of_slope = H * p[:, :1] * p[:, 1:] * p * [1.0, -1.0]
    near, slope = _slopes(x, node, first[:, None], last[:, None])
    columns = np.hstack([node, near.reshape(-1, 8)])
    return columns, np.hstack([p * p * (3 - 2 * p), (of_slope[:, :, None] * slope).reshape(-1, 8)])


def stretches(zones: Sequence[Zone], loads: Sequence[float] = ()) -> tuple[Zone, ...]:
    """What joints, and point loads, cut the line into: neighbours of the same kind are made one first.

    loads: arc lengths (m) of floats, clumps and the like: tension jumps there, and a catenary has a kink.
    """
    whole: list[Zone] = []
    for zone in zones:
        if whole and whole[-1].kind == zone.kind:
            whole[-1] = Zone(zone.kind, whole[-1].s_a, zone.s_b)
        else:
            whole.append(zone)
    parts: list[Zone] = []
    for zone in whole:
        near = 1e-9 * whole[-1].s_b
        kinks = [x for x in loads if zone.s_a + near < x < zone.s_b - near]
        bounds = [zone.s_a, *kinks, zone.s_b]
        parts += [Zone(zone.kind, a, b) for a, b in pairwise(bounds)]
    return tuple(parts)


class Grid:
    """Interpolation from a mesh with its zones to output points s (ns,), as sparse matrices, made when asked for.

    nodes: cubic, from node values (positions, velocities); chords: linear, from node values, across joints as well
    (depth, which the contact force is integrated over); cells: linear, from values at
    the middle of the cells; held: the same with the values at both ends of the line as
    well (tensions, which the supports know); sides: linear, from node values that may differ on the two
    sides of a joint (one entry per stretch and node, `side_nodes`).  A point on a joint
    shows the side before it, or the one `after` it.
    """

    def __init__(
        self, nodes_s: Floats, zones: Sequence[Zone], s: Floats, loads: Sequence[float] = (),
        changes: Sequence[float] = (), after: bool = False,
    ) -> None:  # fmt: skip
        """loads: arc lengths, m, that cut the line, as of `stretches`; changes: those of them where one section ends

        and the next begins; after: a point on a cut shows the side after it.
        """
        self.s = s
        self.loads, self.changes = tuple(loads), tuple(changes)
        self.parts = stretches(zones, loads)
        bounds = np.array([self.parts[0].s_a, *(part.s_b for part in self.parts)])
        cuts = np.abs(nodes_s - bounds[:, None]).argmin(axis=1)  # their nodes
        # first node, last node, offset of the stretch's sides: every joint before it has one side more
        self.spans = [(a, b, a + i) for i, (a, b) in enumerate(pairwise(cuts.tolist()))]
        self.side_nodes = [node for a, b, _ in self.spans for node in range(a, b + 1)]

        self._x = nodes_s
        self._stretch = np.searchsorted(bounds[1:-1] + (-1e-12 if after else 1e-12) * nodes_s[-1], s)
        self._first, self._last = cuts[self._stretch], cuts[self._stretch + 1]  # nodes of the stretch of each point

    @cached_property
    def _middles(self) -> Floats:
        return np.asarray(0.5 * (self._x[:-1] + self._x[1:]))

    @cached_property
    def nodes(self) -> Rows:
        return _sparse(*_cubic(self._x, self.s, self._first, self._last))

    @cached_property
    def cells(self) -> Rows:
        return _sparse(*_linear(self._middles, self.s, self._first, self._last - 1))

    @cached_property
    def chords(self) -> Rows:
        n, first = self._x.size, np.zeros_like(self._first)
        return _sparse(*_linear(self._x, self.s, first, np.full_like(first, n - 1)))

    @cached_property
    def held(self) -> Rows:
        """Columns: start, cells, end; next to an end its value takes part."""
        x, middles = self._x, self._middles
        start = np.where(self.s < middles[0], 0, self._first + 1)
        end = np.where(self.s > middles[-1], x.size, self._last)
        return _sparse(*_linear(np.concatenate([x[:1], middles, x[-1:]]), self.s, start, end))

    @cached_property
    def sides(self) -> Rows:
        node, share = _linear(self._x, self.s, self._first, self._last)
        return _sparse(node + self._stretch[:, None], share)
