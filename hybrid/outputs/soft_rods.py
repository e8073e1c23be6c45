"""Curvature of rods whose stiffness is under way, in outputs: what kernels.watch.soft_rods has in every step.

symbol   meaning                                                                    shape            unit
part     part of its bending stiffness that an element has                          (m, nb)          1
K        all of that stiffness, EI over the length of the node                      (m, nb)          N m
bend     curvature of the chords, vectors or along the plane's normal               (m, 3 or 1, nb)  1/m
M        what neighbours bear of what an element lacks                              (m, 3 or 1, nb)  N m
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch.soft_rods import EI, END, GJ, LINE, SLACK, WHOLE
from hybrid.outputs.observed_states import ObservedStates, cross, directions_of

FEW = 4  # outputs
Integers = NDArray[np.int64]
Restored = tuple[Integers, NDArray[np.bool_], Floats]


def restored(view: ObservedStates, out: Floats, spans: Integers, rods: NDArray[np.bool_]) -> list[Restored]:
    """Of each rod with stiffness under way: rows of sides, outputs (nb,) in which it is, and curvature (rows, nb) 1/m.

    out: (n sides, 2, nb) curvature and twist without layers; spans: (n, 3) first and last node and first row of the
    stretches; rods: (n,) which of them are rods.
    """
    found = list[Restored]()
    if view.grid.hinges[LINE, EI] <= 0.0 or not rods.any():
        return found
    first = np.flatnonzero(rods & ~np.append(False, rods[:-1] & (spans[:-1, 1] == spans[1:, 0])))
    for k in first.tolist():
        last = k  # a rod goes on across point loads
        while last + 1 < len(spans) and rods[last + 1] and spans[last, 1] == spans[last + 1, 0]:
            last += 1
        a, b = int(spans[k, 0]), int(spans[last, 1])
        nodes = np.arange(a, b + 1)
        part = parts_of_stiffness(view, nodes, np.minimum(nodes, b - 1))
        twists = view.stiffness(nodes[1:-1])[:, 2] > 0.0  # others have of their stiffness what is beside them
        soft = np.asarray(((part[1:-1] < 1.0) & twists).any(axis=0))
        if not soft.any():
            continue
        rows = np.arange(spans[k, 2], spans[last, 2] + b - spans[last, 0] + 1)
        K, hn = _stiffness(view, nodes, part), view.of_line("hn", nodes)
        whole = _rod_curvature(view, out, rows, nodes, part, K)
        at = view.grid.side_nodes[rows] - a
        curvature = whole[at] * _of_sides(view, spans[k : last + 1], K * hn)
        bare = view.is_end[nodes] & (view.line.element[nodes] == 0)  # by the moment that is given there
        found.append((rows[~bare[at]], soft, curvature[~bare[at]]))
        for node, row in ((a, rows[0] - 1), (b, rows[-1] + 1)):  # a catenary has the same at a joint
            if node not in view.end_nodes:
                found.append((np.array([row]), soft, np.abs(whole[[node - a]])))
    return found


def parts_of_stiffness(view: ObservedStates, nodes: Integers, cells: Integers) -> Floats:
    """(m, nb) of the elements at nodes (m,), each beside one of the cells (m,); 1 where nothing lacks or is known."""
    pieces = view.grid.hinges[LINE:]
    if pieces[0, EI] <= 0.0:
        return np.ones((len(nodes), view.columns))
    ends, bends, twists = view.is_end[nodes], np.zeros((1, 1)), np.zeros((1, 1))
    for beside in (np.where(ends, cells, nodes - 1), np.where(ends, cells, nodes)):
        middle = 0.5 * (view.of_line("s", beside) + view.of_line("s", beside + 1))
        of = pieces[np.searchsorted(pieces[:-1, END], middle, side="right")]
        half = 0.5 * view.cell_lengths[beside] * np.where(ends, 0.5, 1.0)[:, None]
        bends, twists = bends + half / of[..., EI], twists + half / of[..., GJ]  # by a moment, rad per N m
        if ends.any():  # an angular spring at a clamp does not twist
            bends = np.where(ends[:, None], view.of_line("hn", nodes) / of[..., EI], bends)
    kb = view.stiffness(nodes)
    twists = np.where(kb[:, 2] > 0.0, twists * kb[:, 2], 1.0)  # of no swivel: all of its torsion is there, whatever
    part = np.array(np.broadcast_to(kb[:, 0] * bends / twists, (len(nodes), view.columns)))  # lengths are under way
    return np.where((part > 0.0) & (part < WHOLE), part, 1.0)


def _stiffness(view: ObservedStates, nodes: Integers, part: Floats) -> Floats:
    """K of a rod's nodes; of those without an element as of the next one."""
    K, hn = view.stiffness(nodes)[:, 0] / part, view.of_line("hn", nodes)
    for end, beside in ((0, 1), (-1, -2)):
        if view.line.element[nodes[end]] == 0:
            K[end] = K[beside] * (hn[beside] / hn[end])
    return np.asarray(K)


def _of_sides(view: ObservedStates, spans: Integers, whole: Floats) -> Floats:
    """Factors (rows, nb) of the curvature of a rod's stretches: where sections meet, the moment is one."""
    (a, _, start), (_, b, _) = spans[0], spans[-1]
    found = np.ones((spans[-1, 2] + b - spans[-1, 0] + 1 - start, whole.shape[1]))
    for first, last, row in (spans - [0, 0, start]).tolist():
        for node, inner, at in ((first, first + 1, row), (last, last - 1, row + last - first)):
            if node in view.changes and view.line.element[node] and view.line.element[inner]:
                found[at] = whole[node - a] / whole[inner - a]
    return found


def _rod_curvature(
    view: ObservedStates, out: Floats, rows: Integers, nodes: Integers, part: Floats, K: Floats
) -> Floats:
    """Curvature (m, nb) of a rod at its nodes, negative where it is against the direction of its chords."""
    bend, direction = _bends(view, rows, nodes)
    element, hn = (view.line.element[nodes] != 0)[:, None], view.of_line("hn", nodes)
    part = np.where(element, part, 0.0)
    T, link = view.T[nodes[:-1]], 1.0 / np.broadcast_to(view.cell_lengths[nodes[:-1]], (len(nodes) - 1, view.columns))
    T = np.concatenate([T[:1], 0.5 * (T[1:] + T[:-1]), T[-1:]])
    T = np.maximum(T, SLACK * K * np.concatenate([link, link[-1:]]))
    rhs = (T * (1.0 - part) * hn)[:, None] * bend
    diagonal = T / K + np.concatenate([link, 0.0 * link[-1:]]) + np.concatenate([0.0 * link[:1], link])
    upper = np.concatenate([link, 0.0 * link[-1:]])
    for k in (0, -1):
        cell = nodes[-1] if k else nodes[0] - 1
        outer, row = (nodes[-1] + 1, rows[-1] + 2) if k else (nodes[0] - 1, rows[0] - 2)
        if nodes[k] in view.end_nodes:
            if not element[k, 0]:  # it has no moment, or one that is given
                diagonal[k], rhs[k], upper[k] = np.inf, 0.0, 0.0
        elif outer not in view.end_nodes and (view.grid.side_nodes == outer).sum() == 1:
            outside = 1.0 / view.cell_lengths[cell]
            diagonal[k] += outside
            rhs[k] += (K[k] * hn[k] * outside * out[row, 0]) * view.bend_directions[row]
    M = _solved(diagonal, upper, link, rhs)
    whole = part[:, None] * bend + M / (K * hn)[:, None]
    return np.asarray(np.copysign(np.sqrt((whole * whole).sum(axis=1)), (whole * direction).sum(axis=1)))


def _solved(diagonal: Floats, upper: Floats, link: Floats, rhs: Floats) -> Floats:
    """M (m, 3 or 1, nb): diagonal M_i - upper M_i+1 - link M_i-1 = rhs, of diagonal, upper (m, nb), link (m-1, nb)."""
    M = rhs.copy()
    if rhs.shape[2] <= FEW:  # in numbers, to the same bits: an operation on a small array takes ten times as long
        for k in range(rhs.shape[2]):
            _solve_output(diagonal[:, k].tolist(), upper[:, k].tolist(), link[:, k].tolist(), M[:, :, k])
        return M
    pivot, factor = diagonal[0], [upper[0] / diagonal[0]]
    M[0] /= pivot
    for i in range(1, len(M)):
        pivot = diagonal[i] - link[i - 1] * factor[-1]
        factor.append(upper[i] / pivot)
        M[i] = (M[i] + link[i - 1] * M[i - 1]) / pivot
    for i in range(len(M) - 2, -1, -1):
        M[i] += factor[i] * M[i + 1]
    return M


def _solve_output(diagonal: list[float], upper: list[float], link: list[float], M: Floats) -> None:
    """The same of one output, in place of its right side M (m, 3 or 1)."""
    pivots, factors = [diagonal[0]], [upper[0] / diagonal[0]]
    for d, u, l in zip(diagonal[1:], upper[1:], link, strict=True):
        pivots.append(d - l * factors[-1])
        factors.append(u / pivots[-1])
    for j in range(M.shape[1]):
        first, *others = M[:, j].tolist()
        solved = [first / pivots[0]]
        for right, p, l in zip(others, pivots[1:], link, strict=True):
            solved.append((right + l * solved[-1]) / p)
        for i in range(len(link) - 1, -1, -1):
            solved[i] += factors[i] * solved[i + 1]
        M[:, j] = solved


def _bends(view: ObservedStates, rows: Integers, nodes: Integers) -> tuple[Floats, Floats]:
    """Curvature vectors of the chords at nodes, and their directions."""
    direction = np.zeros((len(nodes), *view.bend_directions.shape[1:]))
    direction[view.grid.side_nodes[rows] - nodes[0]] = view.bend_directions[rows]
    strain = view.element_strains[nodes]
    size = np.hypot(strain[:, 0], strain[:, 1]) / view.of_line("hn", nodes)
    size[view.line.element[nodes] == 0] = 0.0
    for node in nodes[[0, -1]].tolist():
        if node not in view.end_nodes:
            at = node - nodes[0]
            direction[at] = directions_of(view.line, cross(view.d[[node - 1]], view.d[[node]]))[0]
            size[at] = view.bends[node]
    return direction * size[:, None], direction
