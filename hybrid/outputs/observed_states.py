"""A batch of states on nodes, cells and ends of a line: what of it was computed, each array made once if needed.

Arrays have the node or cell first, then the component, and the nb outputs of the batch last: one numpy operation serves
the batch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from functools import cached_property
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import Batch, Floats, Line, Sea
from hybrid.kernels.watch.observed_outputs import observed
from hybrid.outputs.output_grid import Grid, ends_of


def last(x: Floats) -> Floats:
    """A copy with the first axis, the outputs, moved to the end."""
    return np.ascontiguousarray(x.transpose(*range(1, x.ndim), 0))


class ObservedStates:
    """A batch of states on nodes and cells, as computed."""

    def __init__(
        self, line: Line, sea: Sea, grid: Grid, batch: Batch, varied: Mapping[str, Floats] = MappingProxyType({})
    ) -> None:
        """varied: arrays (nb, ...) of the line by name, where it is another one in every output."""
        self.line, self.sea, self.grid, self.batch, self._varied = line, sea, grid, batch, varied

    def on(self, grid: Grid) -> Self:
        """The same on other points of the same stretches."""
        other = copy(self)
        other.grid = grid
        for name in ("tension", "tangent", "moment", "torque", "bending_moment", "curvature_twist"):
            other.__dict__.pop(name, None)
        return other

    def of_line(self, name: str, at: int | slice | NDArray[np.int64]) -> Floats:
        """Values of the line at nodes or cells, (..., nb), or (..., 1) where they are the same in all outputs."""
        if name in self._varied:
            return np.moveaxis(self._varied[name][:, at], 0, -1)
        return np.asarray(getattr(self.line, name)[at][..., None])

    def lines(self) -> list[Line]:
        """The line of each output, where it is another one in every output; else none."""
        each = range(self.batch.t.size if self._varied else 0)
        return [self.line._replace(**{name: x[k] for name, x in self._varied.items()}) for k in each]

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

    @cached_property
    def is_end(self) -> NDArray[np.bool_]:
        """(N+1,) whether nodes are those."""
        found = np.zeros(self.line.s.size, bool)
        found[np.asarray(self.end_nodes)] = True
        return found

    def at_end(self, x: Floats, k: int, inward: int = 0) -> Floats:
        """Of values (n, ..., nb) on cells or nodes that at end k, or so many inward: (..., nb)."""
        return x[-1 - inward if k else inward]

    def put_at_end(self, x: Floats, k: int, value: Floats) -> None:
        """Set values (n, ..., nb) on cells or nodes at end k to (..., nb)."""
        x[-1 if k else 0] = value

    def with_ends(self, x: Floats, ends: Sequence[Floats]) -> Floats:
        """Values (N, nb) of cells between those (nb,) of both ends."""
        return np.concatenate([ends[0][None], x, ends[1][None]])

    def by_output(self, x: Floats, dims: Sequence[str]) -> Floats:
        """Values with the outputs first, of those that a probe with these dimensions has found; a new array."""
        return np.array(x.transpose(x.ndim - 1, *range(x.ndim - 1)), order="C")

    def directors(self, cells: NDArray[np.int64]) -> Floats:
        """First directors (n, 3, nb) of cells."""
        return np.moveaxis(self.batch.a1[:, cells], 0, -1)

    def stiffness(self, nodes: slice | NDArray[np.int64]) -> Floats:
        """Stiffness (n, 3, nb or 1) N m of the elements at nodes."""
        return np.moveaxis(self.batch.kb[:, nodes], 0, -1) if self.batch.kb.size else self.line.kb[nodes, :, None]

    def has_element(self, k: int) -> Any:
        """Whether an element sits at end k, of all outputs or of each (nb,)."""
        return bool(self.line.element[-k])

    @property
    def cell_lengths(self) -> Floats:
        """(N, nb or 1) m, unstretched."""
        return self.batch.h.T if self.batch.h.size else self.line.h[:, None]

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
    def _observed(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Moments (N+1, 3, nb) N m, strains (N+1, 3, nb) rad, energies (5, nb) J and bends (N+1, nb) 1/m."""
        M, strain, energy, bend = observed(self.line, self.batch, self._varied)
        if len(M) < self.batch.t.size:  # a catenary has neither
            M = strain = np.broadcast_to(np.zeros(1), (self.batch.t.size, *M.shape[1:]))
        return last(M), last(strain), last(energy), bend.T

    @property
    def element_strains(self) -> Floats:
        """(N+1, 3, nb) rad, of the elements at nodes, as of kernels.watch.observed_outputs."""
        return self._observed[1]

    @property
    def bends(self) -> Floats:
        """(N+1, nb) 1/m, from cell to cell, as of kernels.watch.observed_outputs."""
        return self._observed[3]

    # ---- moments, and which way the line bends ------------------------------------------------

    @property
    def node_moment(self) -> Floats:
        """(N+1, 3, nb) N m, inertial."""
        return self._observed[0]

    @cached_property
    def node_tangent(self) -> Floats:
        """(N+1, 3, nb): halfway between the cells, at an end that of its holder or cell."""
        d = self.d
        t = np.concatenate([d[:1], d[1:] + d[:-1], d[-1:]])
        for k in (0, 1):
            held = np.asarray(self.has_element(k))
            self.put_at_end(t, k, np.where(held, self.batch.frame[:, k, 2::3].T, self.at_end(d, k)))
        return np.asarray(t / np.maximum(size(t), 1e-12)[:, None])

    @property
    def side_is_rod(self) -> NDArray[np.bool_]:
        """(n sides,), whether the stretch of a side is a rod; a catenary has no moment."""
        spans = np.array(self.grid.spans).reshape(-1, 3)
        return np.repeat([zone.kind == "rod" for zone in self.grid.parts], spans[:, 1] - spans[:, 0] + 1)

    @cached_property
    def bend_directions(self) -> Floats:
        """Directions (n sides, 3, nb) of the curvature that was computed, across both chords beside a node.

        Of a line in a plane (n sides, 1, nb), 1 or -1 along the normal.  At ends of the line that of the moment there;
        at ends of stretches that no element bends across, that of the next node in the stretch, as at ends that are
        bent without a moment.
        """
        nodes, d, line = self.grid.side_nodes, self.d, self.line
        inner = np.clip(nodes, 1, max(len(d) - 1, 1))
        out = directions_of(line, cross(d[inner - 1], d[np.minimum(inner, len(d) - 1)]))
        spans = np.array(self.grid.spans).reshape(-1, 3)
        rods, at = np.tile([zone.kind == "rod" for zone in self.grid.parts], 2), ends_of(spans)
        outer = self.is_end[at.node]
        beside = np.flatnonzero(outer | ~rods | (line.element[at.node] == 0))
        out[at.row[beside]] = out[at.row[beside] + at.inward[beside]]
        bent = np.flatnonzero(outer & rods & ~line.k0[at.node].any(axis=1))
        moment = across(self.node_moment[at.node[bent]], self.node_tangent[at.node[bent]])
        out[at.row[bent]] = np.where(size(moment)[:, None] > 0.0, directions_of(line, moment), out[at.row[bent]])
        return out


# Vectors at many places of many outputs: arrays (n, 3, nb).

# Of a node where the line is straight.
ANY_DIRECTION = np.array([0.0, 1.0, 0.0])[:, None]


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


def across(moment: Floats, tangent: Floats) -> Floats:
    """Of moments (n, 3, nb) N m what bends: the part across the tangent."""
    return np.asarray(moment - dot(moment, tangent)[:, None] * tangent)


def directions_of(line: Line, x: Floats) -> Floats:
    """Of vectors (n, 3, outputs), or on which side of the plane of the line they are."""
    if line.bits & PLANAR:
        return np.where(np.einsum("j,njk->nk", line.plane[2], x) < 0.0, -1.0, 1.0)[:, None]
    length = size(x)[:, None]
    return np.where(length > 0.0, x / np.where(length > 0.0, length, 1.0), ANY_DIRECTION)
