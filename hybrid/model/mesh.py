"""Where the nodes go, and meshes whose rods come and go.

Zones and sections cut the line, cells fill the pieces, graded if asked.  A mesh whose rods come and go has its cells
or, where cells follow the curvature, base cells of one or several cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import refuse_value
from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh.remesh import Cable, blank_kinds_job, blank_line_job, fill_kinds
from hybrid.kernels.mesh.zone_criteria import NodeKinds, blank_kinds
from hybrid.kernels.state.state import NO_MOVED, NO_PLANE, Floats, Line
from hybrid.model.line import cable_on, inertia_of_zones, on_base, put_points, torsion_zones
from hybrid.model.material import LEAST_TENSION, TENSION_FLOOR, Material, nodes_at

MOST_CELLS = 1_000_000
DEFAULT_CELLS = 100  # of a line whose scene gives none: errors of a smooth sag near 1e-4 of the length


@dataclass(frozen=True)
class Zone:
    """A stretch [s_a, s_b] of one kind, "rod" or "catenary" (m, unstretched)."""

    kind: str
    s_a: float
    s_b: float


@dataclass(frozen=True)
class ZonePlan:
    """A zone as a scene asks for it: kind, length (m), number of cells and grading, None where it leaves them open."""

    kind: str
    length: float
    cells: int | None = None
    ratio: float | None = None


def graded(cells: int, ratio: float) -> Floats:
    """Fractions 0 .. 1 of the nodes of `cells` cells whose lengths grow geometrically to `ratio` times the first."""
    q = ratio ** (1.0 / (cells - 1)) if cells > 1 else 1.0
    lengths = q ** np.arange(cells)
    x = np.concatenate([[0.0], np.cumsum(lengths)])
    return x / x[-1]


def share(total: int, lengths: Sequence[float]) -> list[int]:
    """Distribute `total` cells over stretches in proportion to their lengths, at least two each."""
    whole = sum(lengths)
    exact = [total * length / whole for length in lengths]
    counts = [max(2, int(x)) for x in exact]
    by_rest = sorted(range(len(lengths)), key=lambda i: int(exact[i]) - exact[i])
    for i in by_rest:
        if sum(counts) >= total:
            break
        counts[i] += 1
    return counts


def place_nodes(
    plans: Sequence[ZonePlan],
    cuts: Sequence[float],
    cells: int | None,
    ratio: float | None,
    usual: int = DEFAULT_CELLS,
) -> tuple[Floats, tuple[Zone, ...]]:
    """Nodes s (N+1,) in m and the zones, for zones in order and further `cuts` (m) where a node must lie.

    A cut moves the nearest free node of its zone when that is less than half a cell away
    and is inserted otherwise.  `ratio` grades a line of one zone as a whole.  `usual`: cells of a line whose scene
    says nothing.
    """
    open_zones = [p for p in plans if p.cells is None]
    if cells is None:
        counts = [p.cells or 0 for p in plans]
        known = [(p.cells, p.length) for p in plans if p.cells]
        density = usual / sum(p.length for p in plans) if not known else max(c / x for c, x in known)
        rest = [max(2, round(density * p.length)) for p in open_zones]
    else:
        counts = [p.cells or 0 for p in plans]
        left = cells - sum(counts)
        if left < 2 * len(open_zones) or (not open_zones and left != 0):
            least = f"at least two for each of the other {len(open_zones)} zones"
            expected = f"what the zones ask for ({sum(counts)}) and {least}"
            fix = "leave mesh.cells out, or leave `cells` out of one zone"
            refuse_value("mesh.cells", str(cells), expected, fix)
        rest = share(left, [p.length for p in open_zones]) if open_zones else []
    it = iter(rest)
    counts = [c or next(it) for c in counts]
    refuse_too_many(sum(counts))

    s = [0.0]
    zones = []
    total = sum(p.length for p in plans)
    start = 0.0
    for k, (plan, count) in enumerate(zip(plans, counts, strict=True)):
        stop = total if k == len(plans) - 1 else start + plan.length
        r = plan.ratio if plan.ratio is not None else (ratio if len(plans) == 1 and ratio else 1.0)
        piece = start + (stop - start) * graded(count, r)
        piece[-1] = stop
        s.extend(_with_cuts(piece, [c for c in cuts if start < c < stop])[1:])
        zones.append(Zone(plan.kind, start, stop))
        start = stop
    return np.array(s), tuple(zones)


def thinned(s: Floats, fixed: Sequence[float], parts: int) -> Floats:
    """Every so many-th of the nodes s, at least two cells (or all) between nodes that must stay at `fixed`, m."""
    at = np.unique(np.concatenate([[0], np.searchsorted(s, np.array(fixed) - 1e-9 * s[-1]), [s.size - 1]]).astype(int))
    kept = [np.array([0])]
    for a, b in pairwise(at):
        count = min(b - a, max(2, round((b - a) / parts)))
        kept.append(np.linspace(a, b, count + 1).astype(int)[1:])
    return s[np.concatenate(kept)]


def divided(s: Floats, parts: int) -> Floats:
    """Nodes s with every cell in so many parts."""
    return s if parts == 1 else np.interp(np.arange((s.size - 1) * parts + 1) / parts, np.arange(s.size), s)


def _with_cuts(nodes: Floats, cuts: Sequence[float]) -> list[float]:
    """`nodes` with each cut as a node, in place of the nearest one if that is near; the same from either end.

    Near is less than half of the shorter cell beside it, and than the distance to the cut on the other side.
    """
    h, same = np.diff(nodes), 1e-9 * float(nodes[-1] - nodes[0])
    c = np.array(sorted(x for x in cuts if nodes[0] + same < x < nodes[-1] - same))
    c = c[np.append(np.diff(c) > same, True)[: c.size]]
    k = np.searchsorted(0.5 * (nodes[1:] + nodes[:-1]), c)
    d, gaps = nodes[k] - c, np.concatenate([[np.inf], np.diff(c), [np.inf]])[: c.size + 1]
    half = np.concatenate([[0.0], 0.5 * np.minimum(h[:-1], h[1:]), [0.0]])[k]
    near = np.minimum(half, np.where(d > 0.0, gaps[:-1], gaps[1:])) * (1.0 - 1e-9)
    kept = np.delete(nodes, k[np.abs(d) < np.maximum(near, same)])
    return np.sort(np.concatenate([kept, c])).tolist()


def given_nodes(
    nodes: Sequence[float], plans: Sequence[ZonePlan], cuts: Sequence[float]
) -> tuple[Floats, tuple[Zone, ...]]:
    """The nodes a scene lists itself; every zone boundary and every cut must be among them."""
    s = np.array(nodes, float)
    bounds = np.concatenate([[0.0], np.cumsum([p.length for p in plans])])
    for x in [*bounds, *cuts]:
        i = int(np.argmin(np.abs(s - x)))
        if abs(s[i] - x) > 1e-9 * s[-1]:
            expected = f"a node at {x:g} m, where a zone, a section, modules or an attachment begin"
            given = f"nearest node to {x:g} m is {s[i]:g} m"
            refuse_value("mesh.nodes", given, expected, f"add {x:g} to the list")
        s[i] = x
    return s, tuple(Zone(p.kind, a, b) for p, (a, b) in zip(plans, pairwise(bounds.tolist()), strict=True))


def refuse_too_many(cells: int) -> None:
    """SceneError before anything of that size is allocated."""
    if cells > MOST_CELLS:
        expected = f"at most {MOST_CELLS} cells: a line has never needed more, and memory would"
        refuse_value("mesh.cells", str(cells), expected, "grade the mesh with `ratio` instead")


# Where cells should be short: a density of cells along the cable, from how it bent in an earlier run.
#
# Cells follow the angle they turn through (a chord that turns by theta misses its arc by theta/8 of its length), rods
# also the length over which bending fades; neighbours differ by little, so that waves pass without an echo.

TURN = 0.1  # rad that a cell turns through, at fineness 1
FEWEST = 12.0  # cells of a straight cable, at fineness 1
# Cells to a length sqrt(EI/T) beside what disturbs a rod, and over how many such lengths: bending fades as exp(-x).
LAYER, LAYER_WIDTH = 3.0, 2.0
GROWTH = 0.25  # of the length of cells per length of cable: neighbours differ by about a quarter
# Cells at a place to those in the fade length next to it, by that exponential.
AT_PLACE = 1.0 / (LAYER_WIDTH * (1.0 - np.exp(-1.0 / LAYER_WIDTH)))
SAMPLES = 2000  # places at which the density is known
LEAST_PIECE = 2  # cells of a stretch between two places where a node must lie


@dataclass(frozen=True)
class Grading:
    """Cells per length (K,) 1/m at places s (K,) m, at fineness 1."""

    s: Floats
    density: Floats

    def count(self, a: float, b: float, fineness: float) -> int:
        """Cells of the stretch [a, b]."""
        return max(LEAST_PIECE, round(fineness * float(np.diff(self._number(np.array([a, b])))[0])))

    def cell(self, s: Floats) -> Floats:
        """Length of cells, m, at s (K,) m, at fineness 1."""
        return np.asarray(1.0 / np.interp(s, self.s, self.density))

    def nodes(self, cuts: Sequence[float], fineness: float) -> Floats:
        """Nodes (N+1,) m; one at every cut, the ends of the cable among them."""
        out = [np.array(cuts[:1])]
        for a, b in pairwise(cuts):
            n = self.count(a, b, fineness)
            x = np.linspace(a, b, max(SAMPLES // 4, 8 * n))
            if self.s.size > SAMPLES:  # it has places of its own, where density changes within less
                x = np.union1d(x, self.s[(self.s > a) & (self.s < b)])
            number = self._number(x)
            at = np.interp(np.linspace(number[0], number[-1], n + 1)[1:-1], number, x)
            out += [at, np.array([b])]
        return np.concatenate(out)

    def _number(self, x: Floats) -> Floats:
        """Cells between the start and x."""
        whole = np.concatenate([[0.0], np.cumsum(0.5 * (self.density[1:] + self.density[:-1]) * np.diff(self.s))])
        return np.asarray(np.interp(x, self.s, whole))


def layers(x: Floats, s: Floats, fade: Floats, disturbed: Sequence[float], cells: float = LAYER) -> Floats:
    """Cells per length (M,) 1/m at x (M,) m beside what disturbs a rod, so many at the place itself to a fade length.

    fade: (K,) m at s (K,) m, sqrt(EI/T) where the cable is a rod, zero where it is not; disturbed: m, clamps, joints
    and point loads, beside which a rod bends within that length.
    """
    out = np.zeros(x.size)
    for place in disturbed:
        width = float(np.interp(place, s, fade))
        if width > 0.0:
            out += cells / width * np.exp(-np.abs(x - place) / (LAYER_WIDTH * width))
    return out


def grading(s: Floats, curvature: Floats, beside: Floats, length: float) -> Grading:
    """The density for a curvature (K,) 1/m found at s (K,) m.

    beside: (SAMPLES,) 1/m, further cells at places that are evenly spread over the length.
    """
    x = np.linspace(0.0, length, SAMPLES)
    density = np.interp(x, s, curvature) / TURN + FEWEST / length + beside
    # at most as long as any other cell, and by how much cells may grow on the way from there
    grown = GROWTH * x
    cell = np.minimum.accumulate(1.0 / density - grown) + grown
    cell = np.minimum.accumulate((cell + grown)[::-1])[::-1] - grown
    return Grading(x, 1.0 / cell)


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


# A material on base cells whose rods come and go: lines on any cells of them, compiled (kernels.mesh.remesh).

kinds_of = Packed(lambda n: blank_kinds(n, 1), given=("free",))


class LineOnBase:
    """A material on base cells: its lines, and what criteria know of their nodes."""

    def __init__(self, material: Material, base: Floats) -> None:
        """base: (n+1,) m, nodes that are always there."""
        self._material, self._place, self._bits = material, nodes_at(material.at, base), 0
        self._cable = cable_on(material, base, 0, inertia_of_zones(material))
        self._line_job, self._kinds_job = Table(blank_line_job), Table(blank_kinds_job)

    @property
    def hinged(self) -> np.ndarray:
        """(2,) whether ends turn freely."""
        return np.asarray(self._material.hinges[:2, 0] > 0.0)

    def cable_with(self, bits: int) -> Cable:
        """What lines with these forces (bits) are made of."""
        if bits != self._bits:
            put_points(self._material, self._place, self._cable, bits)
            self._bits = bits
        return self._cable

    def torsion(self, layout: Layout) -> Floats:
        """Zones (K, 5) of the line on a layout that a torque passes through, as `Line.torsion`."""
        s = layout.nodes
        of = self._material.piece(0.5 * (s[:-1] + s[1:]))
        return torsion_zones(self._material, np.diff(s), layout.rod_cells, of)

    def line(self, layout: Layout, bits: int, plane: Floats = NO_PLANE, moved: NDArray[np.int8] = NO_MOVED) -> Line:
        """The line on a layout; bits: all forces that are on; moved: as of `Line`, of the obstacles around it."""
        cells, cable = (layout.base_of_cell, layout.rod_cells), self.cable_with(bits)
        return on_base(self._material, cable, layout.nodes, cells, bits, self._line_job, plane, moved)

    def kinds(self, layout: Layout, free: np.ndarray, scale: float) -> NodeKinds:
        """What criteria know of the nodes of a layout; free: (n,) of base cells; scale: tension scale, N."""
        kinds: NodeKinds = kinds_of(layout.base_of_cell.size, free=free)
        self._kinds_job.bind(cable=self._cable, base_of_cell=layout.base_of_cell, kinds=kinds)
        self._kinds_job.bind(floor_part=TENSION_FLOOR, least=LEAST_TENSION * scale, hinged=self.hinged)
        fill_kinds(self._kinds_job.numbers)
        return kinds
