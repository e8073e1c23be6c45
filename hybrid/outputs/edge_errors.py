"""Errors of curvature in cells at touchdown, and at ends of the line on the seabed.

Every output is estimated by itself.  An end held at another height than the line lies at has the same layers.
There the load on the line jumps within a cell, and what answers it is as short as sqrt(EI/T), sqrt(T/k) or, of a stiff
line, (EI/k)^(1/4).  How far nodes and straight lines between them are off depends on where in its cell the edge lies,
so that runs on other cells, whose nodes lie otherwise beside it, may agree by chance.  The balance across the bed

    (T w')' - (EI w'')'' + q + P(-w, -dw/dt) = 0

is therefore solved anew over some cells about the edge, each cut into parts (kernels.watch.observed_outputs has the
symbols).  Loads q, weight, drag and inertia among them, are those that balance the nodes; beyond these cells the line
stays.  An end stays where it is, with its moment or, where it is clamped, its direction.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.state.state import Floats, Sea
from hybrid.kernels.watch.observed_outputs import (
    SINKING,
    WORK,
    Bed,
    Cuts,
    LineEnd,
    Refined,
    Windows,
    put_largest,
    refine_windows,
)
from hybrid.outputs.observation import Observation

# What datasets of them begin with, and the quantities that they are of.
EDGE_ERRORS, MISSED = "errors/edges/", ("curvature", "bending_moment")

# Cells on either side of that with the edge, over which what it does fades; parts of each.
REACH, PARTS = 6, 6
# Parts of the cell at an end of the line, each so many times as long as that before it: layers begin at the end itself,
# and the cell may be long for them.
END_PARTS, LONGER = 24, 1.2
# An edge is looked at with another one where it has so many cells on either side in that window; in stretches of fewer
# cells it is not.
WITHIN, FEWEST = 4, 4
# Part of the largest tension that counts as the least: in compression catenaries have no shape, and parts of cells of a
# rod would buckle where cells that are long for it do not; of short ones bending alone decides.
TAUT = 1e-6
NO_END = LineEnd(np.zeros(0), np.zeros(0), np.zeros(0))


def edge_errors(view: Observation) -> dict[str, Floats]:
    """Errors (ns, nb) of curvature, 1/m, and bending moment, N m, at output points; none where nothing touches down."""
    out = np.zeros((len(MISSED), len(view.grid.points), view.columns))
    for (cells, k), found in _places(view).items():
        first, output = np.ascontiguousarray(np.transpose(found))
        _add(out, view, first, output, cells, k)
    return dict(zip(MISSED, out, strict=True))


def _add(
    out: Floats, view: Observation, first: NDArray[np.int64], output: NDArray[np.int64], cells: int, k: int
) -> None:
    """Of windows of so many cells; k: the end of the line, 0 or 1, that they reach to, else -1."""
    nodes = first[:, None] + np.arange(cells + 1)
    way, nodes = (-1.0, nodes[:, ::-1]) if k == 1 else (1.0, nodes)  # an end is always at first nodes
    coarse, end = _windows(view, nodes, output, way), None
    bends, cuts = curvature(coarse), cuts_of(cells, k >= 0)
    if k >= 0:
        coarse, end = _line_end(view, coarse, nodes, output, k)
        bends[:, 0] = end.k
    s, fine, settled = refined(coarse, bends, view.sea, end)
    missed = fine - _shown(coarse, bends, end, cuts)
    missed[~settled] = np.abs(bends).max(axis=1)[~settled, None]  # what they are is not known
    missed[:, -PARTS:] = 0.0  # the line was kept there
    if end is None:
        missed[:, :PARTS] = 0.0
    rows = {node: np.flatnonzero(view.grid.of_line_of(node))[[0, -1]] + [0, 1] for node in set(first.tolist())}
    both = np.stack([missed, missed * between(coarse.EI, cuts)])
    points = np.ascontiguousarray(way * view.grid.points)
    put_largest(s, both, points, np.array([rows[node] for node in first.tolist()]), output, out)


def _places(view: Observation) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """First nodes and outputs of windows about all edges and at ends on the bed: within a zone, between loads.

    By how many cells they have and the end of the line that they reach to, -1 if none.
    """
    spans = np.array(view.grid.spans)
    touches, found = view.depth > 0.0, dict[tuple[int, int], list[tuple[int, int]]]()
    seen = np.zeros((2, view.columns, len(spans)), bool)
    for span, (begin, end) in enumerate(spans[:, :2].tolist()):
        cells = min(2 * REACH + 1, end - begin)
        for k, (node, beside, first) in enumerate(((begin, begin + 1, begin), (end, end - 1, end - cells))):
            if cells >= FEWEST and np.isin(node, view.end_nodes):
                on_bed = touches[node] | touches[beside]
                seen[k, :, span] = on_bed
                found.setdefault((cells, k), []).extend((first, j) for j in np.flatnonzero(on_bed).tolist())
    output, cell = np.nonzero((touches[1:] != touches[:-1]).T)
    span_of = np.searchsorted(spans[:, 0], cell, "right") - 1
    begin, end = spans[span_of, :2].T
    cells = np.minimum(2 * REACH + 1, end - begin)
    near = [seen[0, output, span_of] & (cell < begin + cells - WITHIN)]
    near += [seen[1, output, span_of] & (cell >= end - cells + WITHIN)]
    wanted = (cell < end) & (cells >= FEWEST) & ~near[0] & ~near[1]  # beyond the end: between two lines
    first, last = np.minimum(np.maximum(cell - REACH, begin), end - cells), (-1, -1, 0)
    for j, c, span, a, n in np.transpose([output, cell, span_of, first, cells])[wanted].tolist():
        if last[:2] != (j, span) or c >= last[2] + n - WITHIN:
            found.setdefault((n, -1), []).append((a, j))
            last = j, span, a
    return {key: x for key, x in found.items() if x}


def _of(x: Floats, at: NDArray[np.int64], output: NDArray[np.int64]) -> Floats:
    """Values (windows, ...) of an array (n, nb), or (n, 1) of one that all outputs share."""
    return np.asarray(x[at, output[:, None] if x.shape[1] > 1 else 0])


def _windows(view: Observation, nodes: NDArray[np.int64], output: NDArray[np.int64], way: float) -> Windows:
    """way: 1, or -1 where nodes go towards the start of the line."""
    every = slice(None)
    bends = view.stiffness(every)[:, :2].max(axis=1) * view.of_line("hn", every)
    bends = bends * (view.of_line("element", every) != 0)
    T, EI = _of(view.T, np.minimum(nodes[:, 1:], nodes[:, :-1]), output), _of(bends, nodes, output)
    least = TAUT * np.abs(T).max(axis=1)[:, None]
    s = way * _of(view.of_line("s", every), nodes, output)
    return Windows(
        s, -_of(view.depth, nodes, output), _of(view.bed[:, SINKING], nodes, output), np.maximum(T, least), EI
    )


def _line_end(
    view: Observation, x: Windows, nodes: NDArray[np.int64], output: NDArray[np.int64], k: int
) -> tuple[Windows, LineEnd]:
    """Windows that reach to end k of the line, with the stiffness there, and what holds it."""
    EI, first = x.EI.copy(), nodes[:, 0]
    EI[:, 0] = EI[:, 1]
    rod = EI[:, 0] > 0.0
    normal, _ = planes_under(view.sea, view.r[first, :, output])
    d = view.d[np.minimum(first, nodes[:, 1]), :, output]
    across = (normal * np.cross(view.node_moment[first, :, output], d)).sum(axis=1)
    bends = np.where(rod, across / np.where(rod, EI[:, 0], 1.0), _beyond(curvature(x), x.s))
    element, hn = (_of(view.of_line(name, slice(None)), nodes[:, :1], output)[:, 0] for name in ("element", "hn"))
    hinge = np.where(rod, 0.0, view.grid.hinges[k, 0])
    return x._replace(EI=EI), LineEnd(bends, np.where(rod & (element != 0), hn, np.inf), hinge)


def _beyond(k: Floats, s: Floats) -> Floats:
    """Values (windows,) at first nodes that the two beside them lead to."""
    return np.asarray(k[:, 1] - (k[:, 2] - k[:, 1]) * (s[:, 1] - s[:, 0]) / (s[:, 2] - s[:, 1]))


def _shown(x: Windows, k: Floats, end: LineEnd | None, cuts: Cuts) -> Floats:
    """Curvature across the bed at parts of cells, 1/m, as results have it."""
    found = between(k, cuts)
    if end is None:
        return found
    hinged = end.EI > 0.0
    slope = np.sqrt(x.T[:, 0] / np.where(hinged, end.EI, 1.0))[:, None]  # it fades to nothing at such an end
    fades = np.exp(-slope * (between(x.s, cuts) - x.s[:, :1]))
    return np.asarray(found - np.where(hinged, end.k, 0.0)[:, None] * fades)


def cuts_of(cells: int, end: bool) -> Cuts:
    """Each cell in PARTS; end: the first one in END_PARTS, the shortest at the end of the line."""
    cell, part = np.repeat(np.arange(cells), PARTS), np.tile(np.arange(PARTS) / PARTS, cells)
    if end:
        graded = np.expm1(np.arange(END_PARTS) * np.log(LONGER)) / np.expm1(END_PARTS * np.log(LONGER))
        cell, part = np.append(np.zeros(END_PARTS, np.int64), cell[PARTS:]), np.append(graded, part[PARTS:])
    return Cuts(np.append(cell, cells - 1), np.append(part, 1.0))


def curvature(x: Windows) -> Floats:
    """w'' at nodes; at the first and last that of the nodes beside them."""
    h = np.diff(x.s, axis=1)
    k = np.zeros_like(x.w)
    k[:, 1:-1] = np.diff(np.diff(x.w, axis=1) / h, axis=1) / (0.5 * (h[:, 1:] + h[:, :-1]))
    k[:, 0], k[:, -1] = k[:, 1], k[:, -2]
    return k


def between(x: Floats, cuts: Cuts) -> Floats:
    """Values at nodes, and on straight lines between them at the ends of parts of cells."""
    return np.asarray(x[:, cuts.cell] + (x[:, cuts.cell + 1] - x[:, cuts.cell]) * cuts.part)


def refined(x: Windows, k: Floats, sea: Sea, end: LineEnd | None = None) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Nodes of parts of cells, m, their curvature, and of which windows (n,) it is known; k: `curvature` of cells.

    end: what first nodes are, if they are ends of the line.
    """
    cuts = cuts_of(x.w.shape[1] - 1, end is not None)
    size = len(k), cuts.cell.size
    out = Refined(np.zeros(size), np.zeros(size), np.zeros(len(k), bool))
    windows, ends = Windows(*map(np.ascontiguousarray, x)), LineEnd(*map(np.ascontiguousarray, end or NO_END))
    bed = Bed(float(sea.stiffness), float(sea.damping), float(sea.onset))
    refine_windows(windows, np.ascontiguousarray(k), ends, bed, cuts, np.zeros((WORK, size[1])), out)
    return out


# What cells miss of the bending of a rod beside its ends, point loads and joints, where a layer is short for them.
#
# Moments go over to those of a hanging line within the layer fade = sqrt(EI/F), as exp(-s/fade).  On cells that are not
# much shorter results go straight from node to node, and at a clamp or a load the moment itself is too small; coarser
# cells show little of that, because their errors do not fall by any order yet.
#
#     symbol   meaning                                                        unit
#     F        force in the cell beside the end                               N
#     fade     sqrt(EI/F), the length over which bending fades                m
#     x        h/fade, length of the cell beside the end                      1
#     M        moments at the three nodes nearest to the end                  N m
#     B        part of M that fades, M = c + d s + B exp(-s/fade)             N m
#     root     by which a fading part falls from node to node on cells h      1

# Lengths of two cells over which bending fades at most: longer, it is a parabola over them but for round-off.
LONGEST = 1e3


def layer_errors(view: Observation, loads: Iterable[int]) -> dict[str, Floats]:
    """Errors (ns,) of curvature, 1/m, and bending moment, N m, of one output; loads: nodes of point loads.

    Only of the two cells beside an end, a joint or a load.
    """
    out, line = dict[str, Floats](), view.line
    if not view.node_moment.size:
        return out
    points, bends = view.grid.points[:, 0], line.element != 0
    moment, T, d = view.node_moment[..., 0], view.T[:, 0], view.d[..., 0]
    for zone, (first, last, _) in zip(view.grid.parts, view.grid.spans, strict=True):
        if zone.kind != "rod":
            continue
        edges = [first, *(i for i in loads if first < i < last), last]
        for a, b in pairwise(edges):
            if b - a < 6:
                continue
            for node, step in ((a, 1), (b, -1)):
                nodes = node + step * np.arange(3)
                cell, EI = min(node, nodes[1]), line.kb[nodes[1], :2].max() * line.hn[nodes[1]]
                shear = np.cross(d[cell], moment[cell + 1] - moment[cell]) / view.length[cell, 0]
                F = float(np.hypot(T[cell], np.linalg.norm(shear)))
                if EI <= 0.0:
                    continue
                s = abs(line.s[nodes] - line.s[node])
                fade = np.sqrt(EI / max(F, EI / (LONGEST * s[2]) ** 2))
                at = step * (points - line.s[node])
                inside = np.flatnonzero((at >= 0.0) & (at < s[2]))
                turns = line.hn[node] / line.h[cell] if node in (0, line.h.size) else 0.5
                missed = layer_missed(s, moment[nodes], fade, at[inside], turns if bends[node] else 0.0)
                for name, scale in (("curvature", EI), ("bending_moment", 1.0)):
                    found = out.setdefault(name, np.zeros(points.size))
                    found[inside] = np.maximum(found[inside], missed / scale)
    return out


def layer_missed(s: Floats, M: Floats, fade: float, at: Floats, turns: float) -> Floats:
    """Distance (n,) N m of straight interpolation from a moment that fades with the distance from an end.

    s: (3,) m, nodes from the end on, 0 the first; M: (3, 3) N m; at: (n,) m; turns: cells that bend as much as what
    holds the direction at the end, as of `shown_at_clamp`, 0: the moment is given there.
    """
    e = np.exp(-s / fade)
    part = s[1] / s[2]
    bend = M[0] * (1.0 - part) + M[2] * part - M[1]  # above node 1 of the line through nodes 0 and 2
    B = bend / ((1.0 - part) + e[2] * part - e[1])
    straight = np.stack([np.interp(at, s, x) for x in M.T], axis=1)
    rest = M - B * e[:, None]  # c + d s
    true = rest[0] + (rest[2] - rest[0]) * (at / s[2])[:, None]
    true = true + B / (shown_at_clamp(s[1] / fade, turns) if turns else 1.0) * np.exp(-at / fade)[:, None]
    return np.linalg.norm(true - straight, axis=1)


def shown_at_clamp(x: float, turns: float = 0.5) -> float:
    """Part of the moment at a clamp under tension that cells of x fades show; 1 on short ones.

    turns: cells that bend as much as the half cell at the clamp and an angular spring there.
    Of the balance of moments of cells of equal length: F h phi_j = M_j+1 - M_j, M_j = EI (phi_j - phi_j-1)/h, at the
    clamp M_0 = EI (phi_1 - alpha)/(turns h); exactly it is -EI alpha/(fade + (turns - 1/2) h).
    """
    root = 1.0 + 0.5 * x * x - x * np.sqrt(1.0 + 0.25 * x * x)
    left = 1.0 / (1.0 + turns * (x * x + 1.0 - root))  # phi_1/alpha
    return float((1.0 - left) / (turns * x) * (1.0 + (turns - 0.5) * x))
