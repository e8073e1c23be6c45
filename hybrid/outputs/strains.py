"""Curvature and twist on the sides of an observation's stretches.

Rods have them by their elements, catenaries by bends.

At ends of a stretch without an element they follow from the moment that is given there, or from the nodes inside.
Between nodes the vector of curvature is interpolated, across the plane of the bend: its size alone would stay large
where a line bends to one side before a point and to the other side after it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.bending_law import LAST_A, LAST_B, RIGID, beside_spring, curvature_under, parts_without_spring
from hybrid.kernels.laws.closed_forms import FADED, FARTHEST
from hybrid.kernels.march.zone_torque import TORQUE
from hybrid.kernels.state.state import Floats, Line
from hybrid.kernels.watch.observed_outputs import slipped
from hybrid.outputs.observed_states import ObservedStates, SpanEnds, cross, directions_of, dot, ends_of

Integers = NDArray[np.int64]


def _restore(view: ObservedStates, out: Floats, spans: Integers) -> None:
    """Curvature of rods that lack stiffness, as if they had it; where sections meet the moment is one.

    spans: (n, 3) first and last node and first row of the stretches that are rods.
    """
    if not len(view.restored):
        return
    nodes, element, at = view.grid.side_nodes, view.line.element, ends_of(spans)
    whole = view.restored[nodes]
    whole[view.is_end[nodes] & (element[nodes] == 0)] = np.nan  # by the moment that is given there
    whole[~view.side_is_rod] = np.abs(whole[~view.side_is_rod])  # a catenary has the same at a joint
    inner, every = 2 * at.cell + 1 - at.node, slice(None)
    seams = np.flatnonzero(np.isin(at.node, view.changes) & (element[at.node] != 0) & (element[inner] != 0))
    if seams.size:
        EI = view.stiffness(every)[:, 0] * view.of_line("hn", every) / view.parts_of_stiffness
        whole[at.row[seams]] *= EI[at.node[seams]] / EI[inner[seams]]
    out[:, 0] = np.where(np.isnan(whole), out[:, 0], whole)


def strains(view: ObservedStates) -> tuple[Floats, list[tuple[EndLayer, Floats]]]:
    """Curvature and twist (n sides, 2, outputs), 1/m, of what was computed; what fades at ends, and their curvature."""
    nodes, spans = view.grid.side_nodes, np.array(view.grid.spans).reshape(-1, 3)
    rods = np.array([zone.kind == "rod" for zone in view.grid.parts])
    of_rod = view.side_is_rod
    out = np.zeros((nodes.size, 2, view.columns))
    if rods.any():
        mine = nodes[of_rod]
        k = view.element_strains[mine] / view.of_line("hn", mine)[:, None]
        out[of_rod, 0], out[of_rod, 1] = np.hypot(k[:, 0], k[:, 1]), k[:, 2]
        _end_rods(view, out, spans[rods])
    if not rods.all():
        out[~of_rod, 0] = view.bends[nodes[~of_rod]]
        _end_catenaries(view, out, spans[~rods])
    _put_layers_back(view, out, spans, rods)
    if rods.any():
        _restore(view, out, spans[rods])
    return out, _subtract_end_layers(view, out)


def _end_rods(view: ObservedStates, out: Floats, spans: Integers) -> None:
    """At the ends of rods: where no element sits, or stiffness jumps, the strain of the moment; twist of the cell."""
    line, at = view.line, ends_of(spans)
    bare, jumps = _by_moment(view, at)
    if (given := np.flatnonzero(bare | jumps)).size:
        out[at.row[given]] = _strain_of_moment(view, at.node[given], at.cell[given])
    # an angular spring at a clamp bends, but does not twist
    held = np.flatnonzero(~bare & ~jumps & view.is_end[at.node])
    if held.size:
        part = view.of_line("hn", at.node[held]) / (0.5 * view.cell_lengths[at.cell[held]])
        out[at.row[held], 1] *= part
        for k in held[(part > 1.0 / RIGID).any(axis=1)]:
            out[at.row[k], 0] = _beside_spring(view, int(at.node[k]), int(at.cell[k]))
    if line.tension_twist.size:
        beside = np.where(at.cell == at.node, at.cell + 1, at.cell - 1)
        some = np.flatnonzero(np.tile(spans[:, 1] - spans[:, 0] > 1, 2))
        out[at.row[some], 1] -= _twist_to_node(view, at.cell[some], beside[some])


def _by_moment(view: ObservedStates, at: SpanEnds) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Ends of rods (n,) whose strain follows from the moment: without an element, and where stiffness changes.

    The first have no strain of their own; at the second the moment is the same on both sides.
    """
    line = view.line
    bare = line.element[at.node] == 0
    jumps = ~bare & np.isin(at.node, view.changes) & (line.element[2 * at.cell + 1 - at.node] == 1)
    if line.slip_law.size:  # an element between layers of two kinds has one curvature
        jumps &= line.slip_law[at.node, 0] == 0.0
    return bare, jumps


def bends_without_natural(view: ObservedStates, curvature: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Curvature (ns, outputs) 1/m less the natural one, at output points, and where it is unknown.

    Unknown in catenaries, which do not know which way their sections are curved, and where a joint takes a part of a
    rod's curvature.
    """
    nodes, spans = view.grid.side_nodes, np.array(view.grid.spans).reshape(-1, 3)
    rods = np.array([zone.kind == "rod" for zone in view.grid.parts])
    of_rod = view.side_is_rod
    bend = np.zeros((nodes.size, 2, view.columns))
    mine = nodes[of_rod]
    bend[of_rod] = (view.element_strains[mine, :2] - view.of_line("k0", mine)[:, :2]) / view.of_line("hn", mine)[
        :, None
    ]
    if rods.any():
        at = ends_of(spans[rods])
        bare, jumps = _by_moment(view, at)
        given = np.flatnonzero(bare | jumps)
        if given.size:
            bend[at.row[given]] = _bend_of_moment(view, at.node[given], at.cell[given])[:, :2]
        for k in np.flatnonzero(~bare & ~jumps & view.is_end[at.node]):
            i, cell, row = int(at.node[k]), int(at.cell[k]), at.row[k]
            turn = bend[row] * view.of_line("hn", i)
            bend[row] = bend_without_spring(view, i, cell, turn) / (0.5 * view.cell_lengths[cell])
    plain = np.zeros((nodes.size, 2, view.columns))
    plain[of_rod, 0] = np.hypot(*np.moveaxis(view.element_strains[mine, :2], 1, 0)) / view.of_line("hn", mine)
    if rods.any():
        _end_rods(view, plain, spans[rods])
    touched = ~of_rod[:, None] | (curvature != np.abs(plain[:, 0]))
    unknown = np.asarray(view.grid.sides @ touched.astype(float)) > 0.0
    return np.hypot(*np.moveaxis(np.asarray(view.grid.sides @ bend), 1, 0)), unknown


def _end_catenaries(view: ObservedStates, out: Floats, spans: Integers) -> None:
    """At the ends of catenaries: on from the nodes inside, along a straight line where there are four cells."""
    cells = np.tile(spans[:, 1] - spans[:, 0], 2)
    at = ends_of(spans)
    some = np.flatnonzero(cells == 2), np.flatnonzero(cells == 3), np.flatnonzero(cells >= 4)
    for k in some[:2]:
        out[at.row[k], 0] = out[at.row[k] + at.inward[k], 0]
    if (k := some[2]).size:
        row, node, inward = at.row[k], at.node[k], at.inward[k]
        x, x1, x2 = (view.of_line("s", node + m * inward) for m in range(3))
        p = (x - x1) / (x2 - x1)
        out[row, 0] = np.maximum(0.0, (1 - p) * out[row + inward, 0] + p * out[row + 2 * inward, 0])


def _put_layers_back(view: ObservedStates, out: Floats, spans: Integers, rods: NDArray[np.bool_]) -> None:
    """Curvature of rods beside joints with what these take of it: at the joint that of the catenary goes on.

    What is missing fades into the rod as the discrete layer of a hinge (kernels.laws.closed_forms), node by node; where
    the rod bends to another side than the catenary, across its own direction.  Negative: against that direction.
    """
    for k in np.flatnonzero((rods[:-1] != rods[1:]) & (spans[:-1, 1] == spans[1:, 0])):
        last, first = spans[k, 2] + spans[k, 1] - spans[k, 0], spans[k + 1, 2]
        catenary, span, mine, its, way = (
            (spans[k], spans[k + 1], first, last, 1) if rods[k + 1] else (spans[k + 1], spans[k], last, first, -1)
        )
        if span[1] - span[0] < 2 or catenary[1] - catenary[0] < 2:
            continue
        node, parts, directions = spans[k + 1, 0], _layer(view, spans[k + 1, 0], way, span), view.bend_directions
        before, after = _stiffness_shares(view, node, way)
        turned = directions_of(view.line, np.cross(view.d[node - 1], view.d[node], axis=0)[None])[0]
        turn, held = view.bends[node], before * out[its - way, 0]
        along = (turned * directions[its]).sum(axis=0)
        square = np.maximum(turn * turn + 2.0 * along * turn * held + held * held, 0.0)
        there = np.copysign(np.sqrt(square) / (1.0 + before + after * (1.0 - parts[1])), along * turn + held)
        out[its, 0] = there
        parts = parts[: 1 + int((parts[1:] > FADED).any(axis=1).sum())]
        parts[1:][parts[1:] <= FADED] = 0.0  # of each output by itself: none depends on those beside it
        rows = mine + way * np.arange(len(parts))
        _add_layer(out, rows, there * parts, (directions[rows] * directions[its]).sum(axis=1))


def _subtract_end_layers(view: ObservedStates, out: Floats) -> list[tuple[EndLayer, Floats]]:
    """Subtract from catenaries the layer that fades from a rod, at ends without curvature.

    Returns the layers, and curvatures (outputs,) 1/m of the ends without them.
    """
    directions, taken = view.bend_directions, []
    for layer in end_layers(view):
        end, rows = out[layer.rows[0], 0].copy(), layer.rows
        # all is what the layer is of: its direction is that of the next node
        along = (directions[rows] * directions[rows[0]]).sum(axis=1)
        _add_layer(out, rows, -end * layer.part[layer.at], along)
        out[rows[0], 0] = 0.0
        taken.append((layer, end))
    return taken


def _add_layer(out: Floats, rows: Integers, missing: Floats, along: Floats) -> None:
    """Add curvatures (m, nb) in directions of cosines (m, nb) to those of rows; negative: against its direction."""
    both = out[rows, 0] + missing * along
    square = both * both + missing * missing * (1.0 - np.minimum(along * along, 1.0))
    out[rows, 0] = np.copysign(np.sqrt(square), both)


def _stiffness_shares(view: ObservedStates, node: int, way: int) -> tuple[Floats, Floats]:
    """B (nb,) of kernels.laws.closed_forms on the catenary's side of a joint and on the rod's, along `way`."""
    nodes, cells = np.array([node, node + way]), np.array([node - 1, node])[::way]
    hn, h, T = view.of_line("hn", nodes), view.cell_lengths[cells], view.T[cells[1]]
    EI = view.stiffness(nodes[1:])[0, 0] * hn[1]
    before, after = (np.divide(EI, T * hn[0] * x, out=np.zeros(T.shape), where=T > 0.0) for x in h)
    return before, after


def _layer(view: ObservedStates, node: int, way: int, span: Integers) -> Floats:
    """Parts (m, nb) of a hinge's layer at a node and at those of the rod beside it.

    None is left where there is no stiffness or no tension.
    """
    nodes = node + way * np.arange(1, min(span[1] - span[0], FARTHEST + 1))
    beside, T = np.minimum(nodes, nodes - way), view.T[np.minimum(nodes, nodes - way)]
    EI = view.stiffness(nodes)[:, 0] * view.of_line("hn", nodes)
    square = view.cell_lengths[beside] ** 2 * np.maximum(T, 0.0)
    half = 1.0 + 0.5 * np.divide(square, EI, out=np.full(T.shape, 1e12), where=EI > 0.0)
    found = np.cumprod(np.where(T > 0.0, 1.0 / (half + np.sqrt(half * half - 1.0)), 0.0), axis=0)
    return np.concatenate([np.ones((1, T.shape[1])), found])


def _twist_to_node(view: ObservedStates, cell: Integers, inner: Integers) -> Floats:
    """Twist (n, outputs) 1/m by which tension turns the middle of cells more than their ends at nodes."""
    h, T = view.cell_lengths, view.T
    more = (T[cell] - T[inner]) * (h[cell] / (h[cell] + h[inner]))
    return _twist_per_tension(view, cell) * more


def _twist_per_tension(view: ObservedStates, cell: Integers) -> Floats:
    """Twist (n, outputs or 1) 1/m of cells per tension, 1/N, without torque."""
    return np.asarray(2.0 * view.of_line("tension_twist", cell) / view.cell_lengths[cell])


def part_without_spring(view: ObservedStates, node: int, cell: int, bend: Floats) -> Floats:
    """Part (outputs,) of the bend (2, outputs) rad at an end that the line has, and an angular spring has not."""
    line = view.line
    if line.slip_law.size and line.slip_law[node].any():
        now = slipped(line, view.batch)
        each = zip(now, bend.T, strict=True)
        return np.array([parts_without_spring(line._replace(slip_now=x), node, *map(float, y))[0] for x, y in each])
    if line.bend_law.size:
        return np.array([parts_without_spring(line, node, *map(float, x))[0] for x in bend.T])
    found = 0.5 * view.cell_lengths[cell] / view.of_line("hn", node)
    return np.broadcast_to(found, bend.shape[1:])


def bend_without_spring(view: ObservedStates, node: int, cell: int, bend: Floats) -> Floats:
    """Of the bend (2, outputs) rad at an end, what is not that of an angular spring there."""
    line = view.line
    if line.slip_law.size and line.slip_law[node].any() and part_without_spring(view, node, cell, bend).min() < RIGID:
        each = zip(slipped(line, view.batch), bend.T, strict=True)
        return np.array([beside_spring(line._replace(slip_now=x), node, *map(float, y)) for x, y in each]).T
    return np.asarray(part_without_spring(view, node, cell, bend) * bend)


def _beside_spring(view: ObservedStates, node: int, cell: int) -> Floats:
    """Curvature (outputs,) of the cell beside a clamp with an angular spring."""
    natural = view.of_line("k0", node)[:2]
    bend = view.element_strains[node, :2] - natural
    bend = natural + bend_without_spring(view, node, cell, bend)
    return np.asarray(np.hypot(*bend) / (0.5 * view.cell_lengths[cell]))


def _bend_by_table(line: Line, inner: Integers, side: Integers, moment: Floats, plain: Floats) -> Floats:
    """Curvature (n, 2, outputs) 1/m by the tables of bending, and `plain` where there is no table.

    moment: (n, 2, outputs) N m, on a side of the nodes inner (n,).
    """
    out = plain.copy()
    for j, i in enumerate(inner):
        if line.bend_law[i, LAST_A] + line.bend_law[i, LAST_B] > 0.0:
            M = np.hypot(moment[j, 0], moment[j, 1])
            bent = [curvature_under(line, int(i), int(side[j]), float(x)) for x in M]
            out[j] = moment[j] * np.divide(bent, M, out=np.zeros_like(M), where=M > 0.0)
    return out


def _bend_of_moment(view: ObservedStates, node: Integers, cell: Integers) -> Floats:
    """Curvatures and twist (n, 3, outputs) 1/m from what has no stress, likewise."""
    line = view.line
    torque = np.zeros((node.size, view.columns))
    if view.batch.turn.size:
        for z, (first, last) in enumerate(line.torsion[:, :2]):
            torque[(node == first) | (node == last)] = view.batch.turn[:, z, TORQUE]
    inner = np.where(cell == node, cell + 1, cell)
    B = view.stiffness(inner) * (view.of_line("hn", inner) / view.parts_of_stiffness[inner])[:, None]
    a1, d, M = view.directors(cell), view.d[cell], view.node_moment[node]
    body = np.stack([dot(a1, M), dot(cross(d, a1), M), dot(d, M) + torque], axis=1)
    k = np.divide(body, B, out=np.zeros_like(body), where=np.broadcast_to(B > 0, body.shape))
    if line.bend_law.size:
        k[:, :2] = _bend_by_table(line, inner, np.sign(node - inner), body[:, :2], k[:, :2])
    return np.asarray(k)


def _strain_of_moment(view: ObservedStates, node: Integers, cell: Integers) -> Floats:
    """Curvature and twist (n, 2, outputs) at rods' ends that carry given moments (at a joint that of its zone)."""
    line = view.line
    inner = np.where(cell == node, cell + 1, cell)
    hn = view.of_line("hn", inner)[:, None]
    k = view.of_line("k0", inner) / hn + _bend_of_moment(view, node, cell)
    if line.tension_twist.size:
        k[:, 2] -= _twist_per_tension(view, cell) * view.T[cell]
    if (
        line.slip_law.size and (slips := np.flatnonzero(line.slip_law[inner, 0])).size
    ):  # depends on the way: as beside it
        k[slips, :2] = (view.element_strains[inner, :2] / hn)[slips]
    found = np.stack([np.hypot(k[:, 0], k[:, 1]), k[:, 2]], axis=1)
    found[line.element[inner] == 0] = 0.0
    return found


# Curvature of catenaries beside ends without a moment, where that of a rod fades to nothing: what results take away.
#
# symbol   meaning                                                                    shape     unit
# EI       bending stiffness of the section at the end                                -         N m2
# depth    integral of sqrt(T/EI) from the end on, at nodes                           (m, nb)   1
# part     of the curvature at the end that fades (kernels.laws.closed_forms.left_of)  (m, nb)   1
# end      curvature at the end as the nodes inside lead to                           (nb,)     1/m

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


def end_layers(view: ObservedStates) -> list[EndLayer]:
    """The layers of an observation, each up to where it has faded in all outputs, or the rods or section end."""
    spans = np.array(view.grid.spans).reshape(-1, 3)
    catenary = np.array([zone.kind == "catenary" for zone in view.grid.parts])
    ends = np.stack([view.is_end[spans[:, k]] for k in (0, 1)])
    ends &= catenary & (spans[:, 1] - spans[:, 0] > 1)  # a catenary of one cell knows no curvature
    return [
        _end_layer(view, *_way_in(spans, catenary, int(first), way), way, EI, reach)
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


def _end_layer(
    view: ObservedStates, rows: Integers, all_nodes: Integers, way: int, EI: float, reach: float
) -> EndLayer:
    """reach: m, from the end on, over which the line has that stiffness."""
    nodes = all_nodes[0] + way * np.arange(abs(all_nodes[-1] - all_nodes[0]) + 1)
    far = np.abs(view.of_line("s", nodes) - view.of_line("s", nodes[:1])).max(axis=1)
    nodes = nodes[: max(2, int((far <= (1.0 + SAME_PLACE) * reach).sum()))]
    cells = np.minimum(nodes[1:], nodes[:-1])
    T, h = view.T[cells], view.cell_lengths[cells]
    slope = np.where(T > 0.0, np.sqrt(np.maximum(T, 0.0) / EI), np.inf)  # none is left without tension
    deep = slope * h
    depth = np.concatenate([np.zeros((1, T.shape[1])), np.cumsum(deep, axis=0)])
    at_nodes = np.concatenate([T[:1], 0.5 * (T[1:] + T[:-1]), T[-1:]])
    with np.errstate(invalid="ignore"):
        part = np.maximum(at_nodes / np.where(T[0] > 0.0, T[0], 1.0), 0.0) ** 0.25 * np.exp(-depth)
    part = np.where(T[0] > 0.0, part, 0.0)
    part[0] = 1.0
    gone = part <= FADED
    part[np.logical_or.accumulate(gone, axis=0)] = 0.0  # of each output by itself: none depends on those beside it
    kept = min(1 + int((part > 0.0).sum(axis=0).max()), len(nodes))
    at = np.abs(all_nodes - nodes[0])
    use = at < kept
    return EndLayer(nodes[:kept], way, rows[use], at[use], EI, deep[: kept - 1], part[:kept])


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
