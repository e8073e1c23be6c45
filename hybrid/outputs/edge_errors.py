"""What cells miss of curvature beside places where contact with the seabed begins or ends, of every output by itself.

There the load on the line jumps within a cell, and what answers it is as short as sqrt(EI/T), sqrt(T/k) or, of a stiff
line, (EI/k)^(1/4).  How far nodes and straight lines between them are off depends on where in its cell the edge lies,
so that runs on other cells, whose nodes lie otherwise beside it, may agree by chance.  The balance across the bed

    (T w')' - (EI w'')'' + q + P(-w, -dw/dt) = 0

is therefore solved anew over some cells about the edge, each cut into parts.  Loads q, weight, drag and inertia among
them, are those that balance the nodes; beyond these cells the line stays.

    symbol  meaning                                             shape               unit
    w       height above where contact begins, at nodes         (windows, nodes)    m
    sinks   -dw/dt                                              (windows, nodes)    m/s
    k       w'', its curvature across the bed                   (windows, nodes)    1/m
    T, h    tension, length of cells                            (windows, cells)    N, m
    EI      bending stiffness, 0 of catenaries                  (windows, nodes)    N m2
    q       load per length that is not of the bed              (windows, nodes)    N/m
    band    of d(balance)/dw: diagonals 2 above to 2 below      (5, windows, nodes) N/m
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.state import Floats, Sea
from hybrid.outputs.touchdown import contact_pressure, sinking

if TYPE_CHECKING:
    from hybrid.outputs.observation import Observation

# What datasets of them begin with, and the quantities that they are of.
EDGE_ERRORS, MISSED = "errors/edges/", ("curvature", "bending_moment")

# Cells on either side of that with the edge, over which what it does fades; parts of each.
REACH, PARTS = 6, 6
# An edge is looked at with another one where it has so many cells on either side in that window; in stretches of fewer
# cells it is not.
WITHIN, FEWEST = 4, 4
# Newton's method ends where w changes by less than this part of its range, which shows in no curvature; every so many
# rounds it goes half the way, since beside a hard bed it may swing between two answers; at most so many.
CHANGE, HALF, ROUNDS = 1e-9, 6, 40
# Part of the largest tension that counts as the least: in compression catenaries have no shape, and parts of cells of a
# rod would buckle where cells that are long for it do not; of short ones bending alone decides.
TAUT = 1e-6


class Windows(NamedTuple):
    """Some cells of outputs, as in the table above."""

    s: Floats  # m
    w: Floats
    sinks: Floats
    T: Floats
    EI: Floats


def edge_errors(view: Observation) -> dict[str, Floats]:
    """Errors (ns, nb) of curvature, 1/m, and bending moment, N m, at output points; none where nothing touches down."""
    out = {name: np.zeros((len(view.grid.points), view.columns)) for name in MISSED}
    for cells, found in _places(view).items():
        first, output = np.array(found, np.int64).T
        _add(out, view, first, output, cells)
    return out


def _add(
    out: dict[str, Floats], view: Observation, first: NDArray[np.int64], output: NDArray[np.int64], cells: int
) -> None:
    """Of windows of so many cells."""
    coarse, points = _windows(view, first, output, cells), view.grid.points
    k = curvature(coarse)
    s, fine, settled = refined(coarse, k, view.sea)
    missed = fine - _between(k)
    missed[~settled] = np.abs(k).max(axis=1)[~settled, None]  # what they are is not known
    missed[:, :PARTS] = missed[:, -PARTS:] = 0.0  # the line was kept there
    of_moment = missed * _between(coarse.EI)
    for n, (node, j) in enumerate(zip(first.tolist(), output.tolist(), strict=True)):
        at = points[:, j if points.shape[1] > 1 else 0]
        inside = np.flatnonzero((at >= s[n, 0]) & (at <= s[n, -1]) & view.grid.of_line_of(node))
        for name, x in zip(MISSED, (missed, of_moment), strict=True):
            found = np.abs(np.interp(at[inside], s[n], x[n]))
            out[name][inside, j] = np.maximum(out[name][inside, j], found)


def _places(view: Observation) -> dict[int, list[tuple[int, int]]]:
    """First nodes and outputs of windows about all edges, by how many cells they have: within a zone, between loads."""
    spans = np.array(view.grid.spans)
    touches, last = view.depth > 0.0, (-1, -1, 0)
    found = dict[int, list[tuple[int, int]]]()
    for j, cell in np.argwhere((touches[1:] != touches[:-1]).T).tolist():
        span = int(np.searchsorted(spans[:, 0], cell, "right")) - 1
        begin, end = spans[span, :2].tolist()
        cells = min(2 * REACH + 1, end - begin)
        if cell >= end or cells < FEWEST:  # between two lines
            continue
        if last[:2] == (j, span) and cell < last[2] + cells - WITHIN:
            continue
        first = min(max(cell - REACH, begin), end - cells)
        found.setdefault(cells, []).append((first, j))
        last = j, span, first
    return found


def _windows(view: Observation, first: NDArray[np.int64], output: NDArray[np.int64], cells: int) -> Windows:
    nodes = first[:, None] + np.arange(cells + 1)
    every = slice(None)

    def of(x: Floats, at: NDArray[np.int64]) -> Floats:
        """Values (windows, ...) of an array (n, nb), or (n, 1) of one that all outputs share."""
        return np.asarray(x[at, output[:, None] if x.shape[1] > 1 else 0])

    bends = view.stiffness(every)[:, :2].max(axis=1) * view.of_line("hn", every)
    bends = bends * (view.of_line("element", every) != 0)
    sinks = sinking(view.sea, view.r, view.v)
    T, EI = of(view.T, nodes[:, :-1]), of(bends, nodes)
    least = TAUT * np.abs(T).max(axis=1)[:, None]
    s = of(view.of_line("s", every), nodes)
    return Windows(s, -of(view.depth, nodes), of(sinks, nodes), np.maximum(T, least), EI)


def curvature(x: Windows) -> Floats:
    """w'' at nodes; at the first and last that of the nodes beside them."""
    h = np.diff(x.s, axis=1)
    k = np.zeros_like(x.w)
    k[:, 1:-1] = np.diff(np.diff(x.w, axis=1) / h, axis=1) / (0.5 * (h[:, 1:] + h[:, :-1]))
    k[:, 0], k[:, -1] = k[:, 1], k[:, -2]
    return k


def _between(x: Floats) -> Floats:
    """Values at nodes, and on straight lines between them at the ends of parts of cells."""
    part = np.arange(PARTS) / PARTS
    inner = x[:, :-1, None] + np.diff(x, axis=1)[:, :, None] * part
    return np.concatenate([inner.reshape(len(x), -1), x[:, -1:]], axis=1)


def _along_cells(T: Floats) -> Floats:
    """Tension of parts of cells: what changes it is spread over them, not in the nodes, where it would be a load."""
    beyond = np.concatenate([2.0 * T[:, :1] - T[:, 1:2], T, 2.0 * T[:, -1:] - T[:, -2:-1]], axis=1)
    at_nodes = _between(0.5 * (beyond[:, 1:] + beyond[:, :-1]))
    return np.asarray(0.5 * (at_nodes[:, 1:] + at_nodes[:, :-1]))


def _across(x: Windows, k: Floats) -> Floats:
    """(T w')' - (EI w'')'' of the inner nodes, N, over their half cells; k: w''."""
    h = np.diff(x.s, axis=1)
    return np.diff(x.T * np.diff(x.w, axis=1) / h - np.diff(x.EI * k, axis=1) / h, axis=1)


def refined(x: Windows, k: Floats, sea: Sea) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Nodes of parts of cells, m, their curvature, and of which windows (n,) it is known; k: `curvature` of cells."""
    h = np.diff(x.s, axis=1)
    part, fine = (np.arange(2 * PARTS) + 0.5) / (2 * PARTS), _between(x.w)
    w, sinks = (y[:, :-1, None] + np.diff(y, axis=1)[:, :, None] * part for y in (x.w, x.sinks))
    presses = contact_pressure(sea, -w, sinks) * h[:, :, None]
    bed = (presses * (1.0 - part)).mean(axis=2)[:, 1:] + (presses * part).mean(axis=2)[:, :-1]
    q = np.zeros_like(x.w)
    q[:, 1:-1] = -(_across(x, k) + bed) / (0.5 * (h[:, 1:] + h[:, :-1]))
    q[:, 0], q[:, -1] = q[:, 1], q[:, -2]
    parts = Windows(_between(x.s), fine, _between(x.sinks), _along_cells(x.T), _between(x.EI))
    w, settled = _solved(parts, k[:, [0, -1]], _between(q), sea)
    bends = curvature(parts._replace(w=w))
    bends[:, [0, -1]] = k[:, [0, -1]]
    return parts.s, bends, settled


def _solved(x: Windows, k: Floats, q: Floats, sea: Sea) -> tuple[Floats, NDArray[np.bool_]]:
    """Heights of nodes in balance, and of which windows they are; k: (n, 2) curvature at first and last nodes."""
    from scipy.linalg import solve_banded  # slow to import

    h = np.diff(x.s, axis=1)
    half, band, w = 0.5 * (h[:, 1:] + h[:, :-1]), _band(x), x.w.copy()
    left, near = np.arange(len(w)), CHANGE * np.ptp(w, axis=1)
    for count in range(ROUNDS):
        now = Windows(x.s[left], w[left], x.sinks[left], x.T[left], x.EI[left])
        bends = curvature(now)
        bends[:, [0, -1]] = k[left]
        press, stiff = (f(sea, -now.w[:, 1:-1], now.sinks[:, 1:-1]) for f in (contact_pressure, _slope))
        lacks = np.zeros_like(now.w)
        lacks[:, 1:-1] = _across(now, bends) + half[left] * (q[left, 1:-1] + press)
        matrix = band[:, left].copy()
        matrix[2, :, 1:-1] -= half[left] * stiff
        change = solve_banded((2, 2), matrix.reshape(5, -1), -lacks.ravel(), check_finite=False).reshape(now.w.shape)
        w[left] += change * (0.5 if count % HALF == HALF - 1 else 1.0)
        left = left[~(np.abs(change).max(axis=1) <= near[left])]
        if not left.size:
            break
    return w, ~np.isin(np.arange(len(w)), left)


def _slope(sea: Sea, p: Floats, v: Floats) -> Floats:
    """Derivative of `contact_pressure` by p, N/m2."""
    found = np.where(p < sea.onset, (sea.stiffness * p + sea.damping * v) / sea.onset, sea.stiffness)
    return np.where(contact_pressure(sea, p, v) > 0.0, found, 0.0)


def _band(x: Windows) -> Floats:
    """Derivatives of `_across` by w, as `scipy.linalg.solve_banded` has them; first and last nodes stay."""
    p = 1.0 / np.diff(x.s, axis=1)
    bends = np.zeros((3, *x.w.shape))  # EI w'' of inner nodes by w before, at and after them
    each = x.EI[:, 1:-1] * 2.0 / (1.0 / p[:, 1:] + 1.0 / p[:, :-1])
    bends[0, :, 1:-1], bends[2, :, 1:-1] = each * p[:, :-1], each * p[:, 1:]
    bends[1] = -bends[0] - bends[2]
    before, after = p[:, :-1], p[:, 1:]  # of the cells beside inner nodes
    pull, at = x.T * p, slice(1, -1)
    rows = np.zeros((5, *x.w.shape))  # derivatives of row i by w[i-2] to w[i+2]
    rows[0, :, at] = -bends[0, :, :-2] * before
    rows[1, :, at] = pull[:, :-1] + bends[0, :, at] * (before + after) - bends[1, :, :-2] * before
    rows[3, :, at] = pull[:, 1:] + bends[2, :, at] * (before + after) - bends[1, :, 2:] * after
    rows[4, :, at] = -bends[2, :, 2:] * after
    rows[2, :, at] = -rows[0, :, at] - rows[1, :, at] - rows[3, :, at] - rows[4, :, at]
    rows[2, :, [0, -1]] = 1.0
    band = np.zeros((5, *x.w.shape))
    for d in range(5):  # rows that reach beyond the first or last node have nothing there
        shift = d - 2
        band[2 - shift] = np.roll(rows[d], shift, axis=1)
    return band
