"""A batch of states, and the output grid that it is brought to.

The grid is reached by interpolation as sparse matrices, of second order and more, zone by zone: a joint, or a point
load, may be a kink, and nothing is drawn across it.  What was computed of a batch is made once, if it is needed.
Arrays have the node or cell first, then the component, and the nb outputs of the batch last: one numpy operation
serves the batch.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from itertools import groupby, pairwise
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.sparse_rows import add_rows, cubic_rows, linear_rows
from hybrid.kernels.state.books import LOADED, SEAM
from hybrid.kernels.state.report import PAYOUT_RATE
from hybrid.kernels.state.state import Batch, Floats, Line, Sea
from hybrid.kernels.watch.observed_outputs import Along, Found, observe_obstacles, observed
from hybrid.model.mesh import Zone
from hybrid.model.sections import SAME_PLACE

Integers = NDArray[np.int64]
NO_HINGES: Floats = np.zeros((3, 3))


class Rows(NamedTuple):
    """A sparse matrix by rows: row i has weights[begin[i] : begin[i+1]] in the columns of the same places."""

    begin: NDArray[np.int64]
    columns: NDArray[np.int64]
    weights: Floats
    outputs: int = 0  # 0: one matrix for all; else so many, one below the other, each for one output
    size: int = 0  # columns of each

    def __matmul__(self, x: Floats) -> Floats:
        """The product with x (n, ...), along its first axis; of several matrices with x (n, ..., outputs)."""
        if self.outputs:
            one = self._replace(outputs=0)
            apart = np.ascontiguousarray(np.moveaxis(x, -1, 0)).reshape(self.outputs * self.size, *x.shape[1:-1])
            found = (one @ apart).reshape(self.outputs, -1, *x.shape[1:-1])
            return np.ascontiguousarray(np.moveaxis(found, 0, -1))
        out = np.zeros((self.begin.size - 1, math.prod(x.shape[1:])))
        x = np.require(x, float, ("C", "W"))
        add_rows(self.begin, self.columns, self.weights, x.reshape(x.shape[0], out.shape[1]), out)
        return out.reshape(-1, *x.shape[1:])


def _rows(count: int, most: int, make: Callable[..., None], *given: Any) -> Rows:
    """Rows for so many points with at most `most` weights each, from a kernel."""
    begin, columns, weights = np.empty(count + 1, np.int64), np.empty(most * count, np.int64), np.empty(most * count)
    make(*given, begin, columns, weights)
    return Rows(begin, columns[: begin[-1]], weights[: begin[-1]])


def linear(x: Floats, at: Floats, first: np.ndarray, last: np.ndarray, shift: np.ndarray | None = None) -> Rows:
    """Interpolation along x[first] .. x[last], and beyond; where first = last, that one counts alone.

    shift: (ns,) added to the columns of points.
    """
    shift = np.zeros(at.size, np.int64) if shift is None else shift
    return _rows(at.size, 2, linear_rows, x, at, first, last, shift)


def stretches(zones: Sequence[Zone], loads: Sequence[float] = ()) -> tuple[Zone, ...]:
    """What joints, and point loads, cut the line into: neighbours of the same kind are made one first.

    loads: arc lengths (m) of floats, clumps and the like: tension jumps there, and a catenary has a kink.
    """
    parts, near = list[Zone](), 1e-9 * zones[-1].s_b
    for kind, same in groupby(zones, lambda zone: zone.kind):
        first, *others = same
        s_a, s_b = first.s_a, (others[-1] if others else first).s_b
        bounds = [s_a]
        bounds += [x for before, x in pairwise([s_a, *sorted(loads)]) if max(before, s_a) + near < x < s_b - near]
        parts += [Zone(kind, a, b) for a, b in pairwise([*bounds, s_b])]
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
        self,
        nodes_s: Floats,
        zones: Sequence[Zone],
        s: Floats,
        loads: Sequence[float] = (),
        changes: Sequence[float] = (),
        after: bool = False,
        kept: Sequence[float] = (),
        hinges: Floats = NO_HINGES,
    ) -> None:
        """Points s (ns,) m on a mesh with nodes nodes_s (N+1,) m.

        loads: arc lengths, m, that cut the line, as of `stretches`; changes: those of them where one section ends
        and the next begins; after: a point on a cut shows the side after it; kept: those of loads where no force acts;
        hinges: (2 + K, 3) as of `Material`.
        """
        nodes_s = np.require(nodes_s, float, ("C", "W"))  # so that kernels have one signature
        self.loads, self.changes, self.after, self.hinges = tuple(loads), tuple(changes), after, hinges
        self.parts, self._kinds = stretches(zones, loads), [zone.kind for zone in zones]
        bounds = np.array([self.parts[0].s_a, *(part.s_b for part in self.parts)])
        cuts = np.abs(nodes_s - bounds[:, None]).argmin(axis=1)  # their nodes
        # first node, last node, offset of the stretch's sides: every joint before it has one side more
        self.spans = [(a, b, a + i) for i, (a, b) in enumerate(pairwise(cuts.tolist()))]
        self.side_nodes = np.concatenate([np.arange(a, b + 1) for a, b, _ in self.spans])

        self._cuts, self._kept = cuts, frozenset(kept)
        self._joints = bounds[1:-1] + (-1e-12 if after else 1e-12) * nodes_s[-1]
        self._put(nodes_s, s)

    def _put(self, nodes_s: Floats, s: Floats) -> None:
        self._x, self.s = nodes_s, np.require(s, float, ("C", "W"))
        self._stretch = np.searchsorted(self._joints, s)
        self._first, self._last = self._cuts[self._stretch], self._cuts[self._stretch + 1]  # of each point's stretch

    def of_line_of(self, node: int) -> NDArray[np.bool_]:
        """(ns,) whether points lie on the line that a node is of: of one line all do."""
        return np.ones(self.s.size, bool)

    @property
    def in_catenary(self) -> NDArray[np.bool_]:
        """(ns,) whether points lie in a catenary."""
        return np.array([part.kind == "catenary" for part in self.parts])[self._stretch]

    def suits(self, nodes_s: Floats, zones: Sequence[Zone]) -> bool:
        """Whether a line of these nodes (N+1,) m and zones has the same cells in the same stretches, but for its ends.

        Its nodes are the same except the first or the last few, and it is cut at nodes that stay.
        """
        if nodes_s.size != self._x.size or [zone.kind for zone in zones] != self._kinds:
            return False
        if not self.loads and len(zones) == 1:
            return True
        inside = self._cuts[1:-1]
        low, high, near = nodes_s[0], nodes_s[-1], 1e-9 * nodes_s[-1]
        cuts = [x for x in self.loads if low + near < x < high - near]
        cuts += [zone.s_a for zone in zones[1:]]
        found = np.unique(cuts) if cuts else np.zeros(0)
        same = found.size == inside.size and bool(np.all(found == nodes_s[inside]))
        return same and bool(np.all(found == self._x[inside]))

    def moved(self, nodes_s: Floats, s: Floats) -> Grid:
        """The grid of the same stretches with nodes (N+1,) m elsewhere in them, and points s (ns,) m."""
        other, made = Grid.__new__(Grid), ("_middles", "nodes", "cells", "chords", "held", "sides", "_grids")
        other.__dict__ = {name: x for name, x in self.__dict__.items() if name not in made}
        other._put(nodes_s, s)
        return other

    @property
    def points(self) -> Floats:
        """(ns, 1) m, or (ns, nb) of a grid that varies: its points, on the line."""
        return self.s[:, None]

    @cached_property
    def _middles(self) -> Floats:
        return np.asarray(0.5 * (self._x[:-1] + self._x[1:]))

    @cached_property
    def nodes(self) -> Rows:
        """Hermite, with slopes of parabolas through the three nearest nodes; of one cell alone there is no other."""
        given = (self._x, self._middles, self.s, self._first, self._last, np.empty(4))
        return _rows(self.s.size, 4, cubic_rows, *given)

    @cached_property
    def cells(self) -> Rows:
        return linear(self._middles, self.s, self._first, self._last - 1)

    @cached_property
    def chords(self) -> Rows:
        n, first = self._x.size, np.zeros_like(self._first)
        return linear(self._x, self.s, first, np.full_like(first, n - 1))

    @cached_property
    def held(self) -> Rows:
        """Columns: start, cells, end; next to an end its value takes part."""
        return linear(self._held_at, self.s, *self._held_between)

    @property
    def _held_at(self) -> Floats:
        return np.concatenate([self._x[:1], self._middles, self._x[-1:]])

    @property
    def _held_between(self) -> tuple[np.ndarray, np.ndarray]:
        """Columns of `held` between which each point lies.

        In a stretch of one cell the values beside it take part, but across point loads: tension goes on at a joint.
        """
        x, middles = self._x, self._middles
        start, end = self._first + 1, self._last.copy()
        single = start == end
        if single.any():
            loads = np.array([x for x in self.loads if x not in self._kept])
            goes_on = np.array([not (np.abs(x[k] - loads) < 1e-9 * x[-1]).any() for k in self._cuts])
            start -= single & goes_on[self._stretch]
            end += single & goes_on[self._stretch + 1]
        start[self.s < middles[0]] = 0
        end[self.s > middles[-1]] = x.size
        return start, end

    @cached_property
    def sides(self) -> Rows:
        return linear(self._x, self.s, self._first, self._last, self._stretch)


class VaryingGrid(Grid):
    """A `Grid` for each of nb outputs, on the same stretches: its matrices multiply the values of each by its own."""

    def __init__(self, nodes_s: Floats, zones: Sequence[Zone], s: Floats, *rest: Any, **named: Any) -> None:
        """Points s (nb, ns) m on nodes nodes_s (nb, N+1) m of every output.

        zones: of the first output; the rest as of `Grid`.
        """
        super().__init__(nodes_s[0], zones, s[0], *rest, **named)
        self._grids = [self.moved(x, at) for x, at in zip(nodes_s, s, strict=True)]

    def _stacked(self, size: int, of: Callable[[Grid], Rows]) -> Rows:
        """One matrix below the other; size: columns of each."""
        parts = [of(grid) for grid in self._grids]
        ends = np.cumsum([0, *(x.columns.size for x in parts)])
        begin = np.concatenate([*(x.begin[:-1] + end for x, end in zip(parts, ends[:-1], strict=True)), ends[-1:]])
        columns = np.concatenate([x.columns + k * size for k, x in enumerate(parts)])
        return Rows(begin, columns, np.concatenate([x.weights for x in parts]), len(parts), size)

    @property
    def points(self) -> Floats:
        return np.stack([grid.s for grid in self._grids], axis=1)

    @cached_property
    def nodes(self) -> Rows:
        return self._stacked(self._x.size, lambda grid: grid.nodes)

    @cached_property
    def cells(self) -> Rows:
        return self._stacked(self._x.size - 1, lambda grid: grid.cells)

    @cached_property
    def chords(self) -> Rows:
        return self._stacked(self._x.size, lambda grid: grid.chords)

    @cached_property
    def held(self) -> Rows:
        return self._stacked(self._x.size + 1, lambda grid: grid.held)

    @cached_property
    def sides(self) -> Rows:
        return self._stacked(len(self.side_nodes), lambda grid: grid.sides)


# --- means over the lengths that output points stand for, so that nothing between them is missed ---


def means_beside(s: Floats, nodes: Floats, values: Floats) -> Floats:
    """Means (ns, nb) of values (nb, N+1) at nodes (N+1,) m, from halfway to the point before to halfway to the next.

    s: (ns,) m, increasing, two at least.  The means times those lengths add up to the integral.
    """
    middles = 0.5 * (s[1:] + s[:-1])
    first, last = 2.0 * s[0] - middles[0], 2.0 * s[-1] - middles[-1]
    edges = np.concatenate([[max(first, nodes[0])], middles, [min(last, nodes[-1])]])
    h = np.diff(nodes)
    total = np.zeros_like(values)
    np.cumsum(0.5 * h * (values[:, 1:] + values[:, :-1]), axis=1, out=total[:, 1:])
    cell = np.clip(np.searchsorted(nodes, edges, side="right") - 1, 0, h.size - 1)
    x = edges - nodes[cell]
    slope = (values[:, cell + 1] - values[:, cell]) / h[cell]
    upto = total[:, cell] + values[:, cell] * x + 0.5 * slope * x * x
    return np.asarray((np.diff(upto, axis=1) / np.diff(edges)).T)


def means_on_line(s: Floats, nodes: Floats, values: Floats) -> Floats:
    """The same (ns,) of one output (N+1,), whose points s (ns,) m may be the same where line is still on a reel."""
    points, which = np.unique(s, return_inverse=True)
    apart = np.append(True, np.diff(points) > SAME_PLACE * (nodes[-1] - nodes[0]))
    points, which = points[apart], (np.cumsum(apart) - 1)[which]
    if points.size == 1:
        return np.full(s.size, np.interp(points[0], nodes, values))
    return np.asarray(means_beside(points, nodes, values[None])[which, 0])


def last(x: Floats) -> Floats:
    """A copy with the first axis, the outputs, moved to the end."""
    return np.ascontiguousarray(x.transpose(*range(1, x.ndim), 0))


class ObservedStates:
    """A batch of states on nodes and cells, as computed."""

    def __init__(
        self,
        line: Line,
        sea: Sea,
        grid: Grid,
        batch: Batch,
        varied: Mapping[str, Floats] = MappingProxyType({}),
        paid: int = 0,
    ) -> None:
        """States of a line on a grid.

        varied: arrays (nb, ...) of the line by name, where it is another one in every output; paid: nodes that go along
        with a winch at the end, negative: at the start.
        """
        self.paid = paid
        self.line, self.sea, self.grid, self.batch, self._varied = line, sea, grid, batch, varied

    def on(self, grid: Grid) -> Self:
        """The same on other points of the same stretches."""
        other = copy(self)
        other.grid = grid
        for name in ("tension", "tangent", "moment", "torque", "bending_moment", "curvature_twist"):
            other.__dict__.pop(name, None)
        return other

    @property
    def velocity(self) -> Floats:
        """(ns, 3, nb) m/s, of the material, which passes nodes that go along with a winch."""
        found = self.grid.nodes @ self.v
        if not self.paid:
            return found
        passed, lengths = np.zeros((len(self.v), self.columns)), self.of_line("h", slice(None))[:, None]
        stretch = self.e / np.where(lengths > 0.0, lengths, 1.0)
        starts, ends = np.asarray(self.end_nodes).reshape(2, -1)  # one, or those of each output
        firsts = starts if self.paid < 0 else ends + 1 - self.paid
        rates = math.copysign(1.0, self.paid) * self.batch.report[:, PAYOUT_RATE]
        for first, rate in zip(firsts, rates.reshape(len(firsts), -1), strict=True):
            passed[first : first + abs(self.paid)] = rate
        return found - (self.grid.nodes @ passed)[:, None] * (self.grid.cells @ stretch)

    def of_line(self, name: str, at: int | slice | NDArray[np.int64]) -> Floats:
        """Values of the line at nodes or cells, (..., nb), or (..., 1) where they are the same in all outputs."""
        if name in self._varied:
            return np.moveaxis(self._varied[name][:, at], 0, -1)
        return np.asarray(getattr(self.line, name)[at][..., None])

    @property
    def varies(self) -> bool:
        """Whether the line is another one in every output."""
        return bool(self._varied)

    def line_of(self, k: int) -> Line:
        """The line at output k."""
        return self.line._replace(**{name: x[k] for name, x in self._varied.items()})

    # ---- how its arrays are laid out ----------------------------------------------------------

    @property
    def columns(self) -> int:
        """Length of the last axis of arrays along the line."""
        return self.batch.t.size

    @cached_property
    def changes(self) -> list[int]:
        """Nodes where one section ends and the next begins."""
        return [int(np.argmin(np.abs(self.line.s - x))) for x in self.grid.changes]

    @property
    def end_nodes(self) -> tuple[int, ...] | NDArray[np.int64]:
        """Nodes at ends of the line."""
        return 0, self.line.h.size

    def at_end(self, x: Floats, k: int) -> Floats:
        """Of values (n, ..., nb) on nodes that at end k: (..., nb)."""
        return x[-1 if k else 0]

    def outputs_last(self, x: Floats) -> Floats:
        """What has been found along the line (nb, n, ...) as (n, ..., nb)."""
        return last(x)

    def by_output(self, x: Floats, dims: Sequence[str]) -> Floats:
        """Values with the outputs first, of those that a probe with these dimensions has found; a new array."""
        return np.array(x.transpose(x.ndim - 1, *range(x.ndim - 1)), order="C")

    def stiffness(self, nodes: slice | NDArray[np.int64]) -> Floats:
        """Stiffness (n, 3, nb or 1) N m of the elements at nodes."""
        return np.moveaxis(self.batch.kb[:, nodes], 0, -1) if self.batch.kb.size else self.line.kb[nodes, :, None]

    # ---- what was computed --------------------------------------------------------------------

    @cached_property
    def r(self) -> Floats:
        """(N+1, 3, nb) m."""
        return last(self.batch.r)

    @cached_property
    def v(self) -> Floats:
        """(N+1, 3, nb) m/s."""
        return last(self.batch.v)

    @cached_property
    def e(self) -> Floats:
        """(N, 3, nb) m, chords."""
        return last(self.batch.e)

    @cached_property
    def T(self) -> Floats:
        """(N, nb) N."""
        return last(self.batch.T)

    @cached_property
    def length(self) -> Floats:
        """(N, nb) m, of the chords."""
        return size(self.e)

    @cached_property
    def d(self) -> Floats:
        """(N, 3, nb) directions of the chords."""
        return np.asarray(self.e / self.length[:, None])

    @cached_property
    def _observed(self) -> Found:
        """What the outputs mean, the outputs first."""
        found = observed(self.line, self.sea, self.batch, self._along, self._varied)
        return found._replace(moment=np.broadcast_to(found.moment, (self.batch.t.size, *found.moment.shape[1:])))

    @property
    def _along(self) -> Along:
        grid, s, ends = self.grid, self.line.s, self.line.s[[0, -1]]
        loaded = [any(abs(x - end) < 1e-9 * s[-1] for x in grid.loads) for end in ends]
        marks = np.bincount(grid.side_nodes, minlength=s.size) > 1
        seams = np.isin(np.arange(s.size), self.changes)
        return Along(
            grid.hinges,
            np.array(loaded, np.int8),
            (marks * (LOADED + SEAM * seams)).astype(np.int8),
            len(grid.side_nodes),
        )

    def loaded(self, k: int) -> bool:
        """Whether there is a point load at end k."""
        return bool(self._along.loaded[k])

    def press_obstacles(self, sea: Sea, outputs: slice, out: Floats) -> None:
        """Enter what some outputs press on obstacles into (nb, M, ON_OBSTACLE); sea: with these as they are then."""
        observe_obstacles(self._observed.tables[outputs], sea, out[outputs])

    @cached_property
    def bends(self) -> Floats:
        """(N+1, nb) 1/m, from cell to cell, as of kernels.watch.observed_outputs."""
        return self.outputs_last(self._observed.bend)

    @cached_property
    def node_moment(self) -> Floats:
        """(N+1, 3, nb) N m, inertial."""
        return self.outputs_last(self._observed.moment)

    @cached_property
    def sides(self) -> Floats:
        """(n sides, SIDE, nb) of kernels.watch.observed_outputs."""
        return self.outputs_last(self._observed.sides)

    @cached_property
    def bed(self) -> Floats:
        """(N+1, ON_BED, nb), likewise."""
        return self.outputs_last(self._observed.bed)

    @property
    def side_is_rod(self) -> NDArray[np.bool_]:
        """(n sides,), whether the stretch of a side is a rod; a catenary has no moment."""
        spans = np.array(self.grid.spans).reshape(-1, 3)
        return np.repeat([zone.kind == "rod" for zone in self.grid.parts], spans[:, 1] - spans[:, 0] + 1)


# Vectors at many places of many outputs: arrays (n, 3, nb).


def cross(a: Floats, b: Floats) -> Floats:
    """a x b of vectors (n, 3, nb)."""
    out = np.empty(np.broadcast(a, b).shape)
    out[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    out[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    out[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out


def dot(a: Floats, b: Floats) -> Floats:
    """a . b of vectors (n, 3, nb)."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def size(a: Floats) -> Floats:
    """Length of vectors (n, 3, nb)."""
    return np.asarray(np.sqrt(dot(a, a)))
