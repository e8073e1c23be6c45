"""Curvature of catenaries beside ends without a moment, where that of a rod fades to nothing: what results take away.

symbol   meaning                                                                    shape     unit
EI       bending stiffness of the section at the end                                -         N m2
depth    integral of sqrt(T/EI) from the end on, at nodes                           (m, nb)   1
part     of the curvature at the end that fades (kernels.laws.hinge_layer.left_of)  (m, nb)   1
end      curvature at the end as the nodes inside lead to                           (nb,)     1/m
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.hinge_layer import FADED
from hybrid.kernels.state.state import Floats
from hybrid.outputs.observed_states import ObservedStates

Integers = NDArray[np.int64]
# Cells of less depth: between their nodes a layer is straight to 0.1 %.
SHALLOW = 0.1
SAME_PLACE = 1e-9  # part of a length


class EndLayer(NamedTuple):
    """The layer beside one end of nb outputs."""

    nodes: Integers  # (m,) from the end on
    way: int  # 1 or -1, from node to node
    rows: Integers  # (k,) of sides of nodes; of loads both
    at: Integers  # (k,) which of the nodes each is
    EI: float
    deep: Floats  # (m-1, nb) depth of each cell
    part: Floats  # (m, nb)
    of_cells: Floats  # (m, nb) what rods of these cells have of it (kernels.laws.hinge_layer.fade)


def end_layers(view: ObservedStates) -> list[EndLayer]:
    """The layers of an observation, each up to where it has faded in all outputs, or the rods or section end."""
    spans = np.array(view.grid.spans).reshape(-1, 3)
    catenary = np.array([zone.kind == "catenary" for zone in view.grid.parts])
    ends = np.stack([view.is_end[spans[:, k]] for k in (0, 1)])
    ends &= catenary & (spans[:, 1] - spans[:, 0] > 1)  # a catenary of one cell knows no curvature
    return [
        _layer(view, *_way_in(spans, catenary, int(first), way), way, EI, reach)
        for mine, way, (EI, reach) in zip(ends, (1, -1), view.grid.hinges[:2, :2].tolist(), strict=True)
        if EI > 0.0
        for first in np.flatnonzero(mine)
    ]


def _way_in(spans: Integers, catenary: NDArray[np.bool_], first: int, way: int) -> tuple[Integers, Integers]:
    """Rows of sides, and their nodes, from an end on through catenary stretches."""
    rows, nodes, k = [], [], first
    while True:
        a, b, o = spans[k]
        inward = np.arange(b - a + 1)[::way]
        rows.append(o + inward)
        nodes.append(a + inward)
        last = int(nodes[-1][-1])
        k += way
        if not 0 <= k < len(spans) or not catenary[k] or last not in spans[k, :2]:
            return np.concatenate(rows), np.concatenate(nodes)


def _layer(view: ObservedStates, rows: Integers, all_nodes: Integers, way: int, EI: float, reach: float) -> EndLayer:
    """reach: m, from the end on, over which the line has that stiffness."""
    nodes = all_nodes[0] + way * np.arange(abs(all_nodes[-1] - all_nodes[0]) + 1)
    far = np.abs(view.of_line("s", nodes) - view.of_line("s", nodes[:1])).max(axis=1)
    nodes = nodes[: max(2, int((far <= (1.0 + SAME_PLACE) * reach).sum()))]
    cells = np.minimum(nodes[1:], nodes[:-1])
    T, h = view.T[cells], view.cell_lengths[cells]
    slope = np.where(T > 0.0, np.sqrt(np.maximum(T, 0.0) / EI), np.inf)  # none is left without tension
    deep = slope * h
    depth = np.concatenate([np.zeros((1, T.shape[1])), np.cumsum(deep, axis=0)])
    half = 1.0 + 0.5 * np.minimum(deep, 1e6) ** 2
    of_cells = np.cumprod(np.concatenate([np.ones((1, T.shape[1])), 1.0 / (half + np.sqrt(half * half - 1.0))]), axis=0)
    at_nodes = np.concatenate([T[:1], 0.5 * (T[1:] + T[:-1]), T[-1:]])
    with np.errstate(invalid="ignore"):
        part = np.maximum(at_nodes / np.where(T[0] > 0.0, T[0], 1.0), 0.0) ** 0.25 * np.exp(-depth)
    part = np.where(T[0] > 0.0, part, 0.0)
    part[0] = 1.0
    gone = part <= FADED
    part[np.logical_or.accumulate(gone, axis=0)] = 0.0  # of each output by itself: none depends on those beside it
    lasts = (part > 0.0).sum(axis=0)
    of_cells = np.where(np.arange(len(nodes))[:, None] <= lasts, of_cells, 0.0)
    kept = min(1 + int(lasts.max()), len(nodes))
    at = np.abs(all_nodes - nodes[0])
    use = at < kept
    return EndLayer(nodes[:kept], way, rows[use], at[use], EI, deep[: kept - 1], part[:kept], of_cells[:kept])


def between_nodes(view: ObservedStates, layer: EndLayer) -> Iterator[tuple[Integers, Floats]]:
    """Output points (p,) in a cell, and by how much (p, nb) the part there is less than on a line between its nodes."""
    s, points = view.of_line("s", layer.nodes), view.grid.points
    mine = view.grid.of_line_of(int(layer.nodes[0]))
    x = layer.way * (points - s[0])
    ends = layer.way * (s - s[0])
    near = np.flatnonzero(mine & (x <= ends[-1]).any(axis=1) & (x >= 0.0).any(axis=1))
    x = x[near]
    deep = layer.deep
    for c in np.flatnonzero((deep > SHALLOW).any(axis=1)):
        inside = (x > ends[c]) & (x < ends[c + 1])
        some = np.flatnonzero(inside.any(axis=1))
        if some.size:
            u = (x[some] - ends[c]) / (ends[c + 1] - ends[c])
            one, two = layer.part[c], layer.part[c + 1]
            q = np.minimum(deep[c], 700.0)
            last = one * (np.exp(-u * q) - u * np.exp(-q))  # to nothing where it no longer counts
            here = np.where(two > 0.0, one ** (1.0 - u) * two**u, last)
            less = (1.0 - u) * one + u * two - here
            yield near[some], np.where(inside[some], less, 0.0)
