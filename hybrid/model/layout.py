"""A mesh whose rods come and go: its cells; where cells follow the curvature, base cells of one or several cells."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh.fill_line import Cable, blank_kinds_job, blank_line_job, fill_kinds
from hybrid.kernels.mesh.zone_criteria import HINGE, NodeKinds, blank_kinds
from hybrid.kernels.state.state import NO_MOVED, NO_PLANE, Floats, Line
from hybrid.model.line import cable_on, inertia_of_zones, on_base, put_points
from hybrid.model.material import LEAST_TENSION, TENSION_FLOOR, Material
from hybrid.model.mesh import Zone


class _Fields(NamedTuple):
    base: Floats  # (n+1,) m, nodes that are always there
    parts: np.ndarray  # (n,) rod cells in a base cell, where they are shortest
    rod: np.ndarray  # (n,) bool
    here: np.ndarray | None = None  # (K+1,) bool, nodes of the finest mesh that are there; None: all that rods have


class Layout(_Fields):
    """Base cells and what they are now.  Its arrays do not change: what follows from them is computed once."""

    @property
    def finest(self) -> Layout:
        """All rod, with the shortest cells."""
        return self._replace(rod=np.ones_like(self.rod), here=None)

    @cached_property
    def starts(self) -> np.ndarray:
        """(n+1,) numbers of the base nodes on the finest mesh, which has starts[-1] cells."""
        return np.concatenate([[0], np.cumsum(self.parts)])

    @cached_property
    def places(self) -> np.ndarray:
        """(N+1,) numbers of the nodes on the finest mesh."""
        there = np.append(np.repeat(self.rod, self.parts), True) if self.here is None else self.here.copy()
        there[self.starts] = True
        return np.flatnonzero(there)

    @property
    def node_flags(self) -> np.ndarray:
        """(K+1,) bool, which nodes of the finest mesh there are."""
        out = np.zeros(self.starts[-1] + 1, bool)
        out[self.places] = True
        return out

    @cached_property
    def first(self) -> np.ndarray:
        """(n+1,) number of the first cell (and node) of each base cell; the last is the number of all."""
        return np.searchsorted(self.places, self.starts)

    @cached_property
    def counts(self) -> np.ndarray:
        """(n,) cells of each base cell now."""
        return np.diff(self.first)

    @cached_property
    def nodes(self) -> Floats:
        """(N+1,) m."""
        places = self.places[:-1]
        of = self.base_of_cell
        inside = (places - self.starts[of]) / self.parts[of]
        s = self.base[of] + inside * (self.base[of + 1] - self.base[of])
        return np.append(s, self.base[-1])

    @cached_property
    def base_of_cell(self) -> np.ndarray:
        """(N,) base cell of every cell."""
        return np.repeat(np.arange(self.rod.size), self.counts)

    @cached_property
    def rod_cells(self) -> np.ndarray:
        """(N,) bool."""
        return np.repeat(self.rod, self.counts)

    @cached_property
    def zones(self) -> tuple[Zone, ...]:
        """Rod and catenary zones in order."""
        return tuple(
            Zone("rod" if self.rod[a] else "catenary", float(self.base[a]), float(self.base[b]))
            for a, b in pairwise(edges(self.rod))
        )


def on_other_parts(old: Layout, x: np.ndarray, source: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Values of the nodes of a finest mesh (K+1,) on that of base cells with twice, or half, as many parts.

    source: (n,) which base cell of the old layout each comes from; parts: (n,).  New nodes have 0; a node that is no
    longer one must have had 0.
    """
    out, begin = np.zeros(parts.sum() + 1, x.dtype), 0
    for j, size in zip(source.tolist(), parts.tolist(), strict=True):
        now = x[old.starts[j] : old.starts[j + 1]]
        more, fewer = max(size // now.size, 1), max(now.size // size, 1)
        out[begin : begin + size : more] = now[::fewer]
        begin += size
    out[-1] = x[-1]
    return out


def of_rods(s: Floats) -> Layout:
    """Rods of one cell each, with nodes s (N+1,) m."""
    return Layout(s, np.ones(s.size - 1, int), np.ones(s.size - 1, bool))


def edges(flags: np.ndarray) -> list[int]:
    """Where runs of equal flags begin, and the end of the last."""
    changes = np.flatnonzero(flags[1:] != flags[:-1]) + 1
    return [0, *changes.tolist(), flags.size]


# A material on base cells whose rods come and go: lines on any cells of them, compiled (kernels.mesh.fill_line).

kinds_of = Packed(lambda n: blank_kinds(n, 1), given=("free",))


class LineOnBase:
    """A material on base cells: its lines, and what criteria know of their nodes."""

    def __init__(self, material: Material, base: Floats) -> None:
        """base: (n+1,) m, nodes that are always there."""
        self._material, self._place, self._bits = material, material.point_nodes(base), 0
        self._cable = cable_on(material, base, 0, inertia_of_zones(material))
        self._line_job, self._kinds_job = Table(blank_line_job), Table(blank_kinds_job)

    @property
    def cable(self) -> Cable:
        """What lines are made of; its points are those of the forces that the last line had."""
        return self._cable

    def line(self, layout: Layout, bits: int, plane: Floats = NO_PLANE, moved: NDArray[np.int8] = NO_MOVED) -> Line:
        """The line on a layout; bits: all forces that are on; moved: as of `Line`, of the obstacles around it."""
        if bits != self._bits:
            put_points(self._material, self._place, self._cable, bits)
            self._bits = bits
        cells = layout.base_of_cell, layout.rod_cells
        line = on_base(self._material, self._cable, layout.nodes, *cells, bits, plane, self._line_job)
        return line._replace(moved=moved)

    def kinds(self, layout: Layout, free: np.ndarray, scale: float) -> NodeKinds:
        """What criteria know of the nodes of a layout; free: (n,) of base cells; scale: tension scale, N."""
        kinds: NodeKinds = kinds_of(layout.base_of_cell.size, free=free)
        self._kinds_job.bind(
            cable=self._cable, base_of_cell=layout.base_of_cell, kinds=kinds, floor_part=TENSION_FLOOR,
            least=LEAST_TENSION * scale,
        )  # fmt: skip
        fill_kinds(self._kinds_job.numbers)
        kinds.node[[0, -1]] = np.where(self._material.hinges[:2, 0] > 0.0, HINGE, kinds.node[[0, -1]])
        return kinds
