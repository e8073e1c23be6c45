"""What cells miss of curvature beside places where contact with the seabed begins or ends, of every output by itself,

and beside ends of the line on the bed: what holds them at another height than the line lies at has the same layers.

There the load on the line jumps within a cell, and what answers it is as short as sqrt(EI/T), sqrt(T/k) or, of a stiff
line, (EI/k)^(1/4).  How far nodes and straight lines between them are off depends on where in its cell the edge lies,
so that runs on other cells, whose nodes lie otherwise beside it, may agree by chance.  The balance across the bed

    (T w')' - (EI w'')'' + q + P(-w, -dw/dt) = 0

is therefore solved anew over some cells about the edge, each cut into parts.  Loads q, weight, drag and inertia among
them, are those that balance the nodes; beyond these cells the line stays.  An end stays where it is, with its moment
or, where it is clamped, its direction.

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

from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.state.state import Floats, Sea
from hybrid.outputs.touchdown import contact_pressure, sinking

if TYPE_CHECKING:
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


class LineEnd(NamedTuple):
    """What an end of the line is, at the first nodes of windows."""

    k: Floats  # (windows,) 1/m, curvature across the bed of the moment there; of catenaries as of `_beyond`
    hn: Floats  # (windows,) m, of the element at a clamp; infinite where the moment is given
    EI: Floats  # (windows,) N m2, of catenaries without moment, whose curvature results take away there; else 0


def edge_errors(view: Observation) -> dict[str, Floats]:
    """Errors (ns, nb) of curvature, 1/m, and bending moment, N m, at output points; none where nothing touches down."""
    out = {name: np.zeros((len(view.grid.points), view.columns)) for name in MISSED}
    for (cells, k), found in _places(view).items():
        first, output = np.array(found, np.int64).T
        _add(out, view, first, output, cells, k)
    return out


def _add(
    out: dict[str, Floats], view: Observation, first: NDArray[np.int64], output: NDArray[np.int64], cells: int, k: int
) -> None:
    """Of windows of so many cells; k: the end of the line, 0 or 1, that they reach to, else -1."""
    nodes = first[:, None] + np.arange(cells + 1)
    way, nodes = (-1.0, nodes[:, ::-1]) if k == 1 else (1.0, nodes)  # an end is always at first nodes
    coarse, points, end = _windows(view, nodes, output, way), view.grid.points, None
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
    of_moment = missed * between(coarse.EI, cuts)
    for n, (node, j) in enumerate(zip(first.tolist(), output.tolist(), strict=True)):
        at = way * points[:, j if points.shape[1] > 1 else 0]
        inside = np.flatnonzero((at >= s[n, 0]) & (at <= s[n, -1]) & view.grid.of_line_of(node))
        for name, x in zip(MISSED, (missed, of_moment), strict=True):
            found = np.abs(np.interp(at[inside], s[n], x[n]))
            out[name][inside, j] = np.maximum(out[name][inside, j], found)


def _places(view: Observation) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """First nodes and outputs of windows about all edges and at ends on the bed: within a zone, between loads.

    By how many cells they have and the end of the line that they reach to, -1 if none.
    """
    spans = np.array(view.grid.spans)
    touches, last = view.depth > 0.0, (-1, -1, 0)
    found = dict[tuple[int, int], list[tuple[int, int]]]()
    seen = set[tuple[int, int, int]]()  # output, span, end
    for span, (begin, end) in enumerate(spans[:, :2].tolist()):
        cells = min(2 * REACH + 1, end - begin)
        for k, (node, beside, first) in enumerate(((begin, begin + 1, begin), (end, end - 1, end - cells))):
            if cells < FEWEST or not np.isin(node, view.end_nodes):
                continue
            on_bed = np.flatnonzero(touches[node] | touches[beside]).tolist()
            seen |= {(j, span, k) for j in on_bed}
            if on_bed:
                found.setdefault((cells, k), []).extend((first, j) for j in on_bed)
    for j, cell in np.argwhere((touches[1:] != touches[:-1]).T).tolist():
        span = int(np.searchsorted(spans[:, 0], cell, "right")) - 1
        begin, end = spans[span, :2].tolist()
        cells = min(2 * REACH + 1, end - begin)
        if cell >= end or cells < FEWEST:  # between two lines
            continue
        if (j, span, 0) in seen and cell < begin + cells - WITHIN:
            continue
        if (j, span, 1) in seen and cell >= end - cells + WITHIN:
            continue
        if last[:2] == (j, span) and cell < last[2] + cells - WITHIN:
            continue
        first = min(max(cell - REACH, begin), end - cells)
        found.setdefault((cells, -1), []).append((first, j))
        last = j, span, first
    return found


def _of(x: Floats, at: NDArray[np.int64], output: NDArray[np.int64]) -> Floats:
    """Values (windows, ...) of an array (n, nb), or (n, 1) of one that all outputs share."""
    return np.asarray(x[at, output[:, None] if x.shape[1] > 1 else 0])


def _windows(view: Observation, nodes: NDArray[np.int64], output: NDArray[np.int64], way: float) -> Windows:
    """way: 1, or -1 where nodes go towards the start of the line."""
    every = slice(None)
    bends = view.stiffness(every)[:, :2].max(axis=1) * view.of_line("hn", every)
    bends = bends * (view.of_line("element", every) != 0)
    sinks = sinking(view.sea, view.r, view.v)
    T, EI = _of(view.T, np.minimum(nodes[:, 1:], nodes[:, :-1]), output), _of(bends, nodes, output)
    least = TAUT * np.abs(T).max(axis=1)[:, None]
    s = way * _of(view.of_line("s", every), nodes, output)
    return Windows(s, -_of(view.depth, nodes, output), _of(sinks, nodes, output), np.maximum(T, least), EI)


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


class Cuts(NamedTuple):
    """Parts of the cells of a window: their ends."""

    cell: NDArray[np.int64]
    part: Floats  # of that cell, from its first node on


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


def _along_cells(T: Floats, cuts: Cuts) -> Floats:
    """Tension of parts of cells: what changes it is spread over them, not in the nodes, where it would be a load."""
    beyond = np.concatenate([2.0 * T[:, :1] - T[:, 1:2], T, 2.0 * T[:, -1:] - T[:, -2:-1]], axis=1)
    at_nodes = between(0.5 * (beyond[:, 1:] + beyond[:, :-1]), cuts)
    return np.asarray(0.5 * (at_nodes[:, 1:] + at_nodes[:, :-1]))


def _across(x: Windows, k: Floats) -> Floats:
    """(T w')' - (EI w'')'' of the inner nodes, N, over their half cells; k: w''."""
    h = np.diff(x.s, axis=1)
    return np.diff(x.T * np.diff(x.w, axis=1) / h - np.diff(x.EI * k, axis=1) / h, axis=1)


def refined(x: Windows, k: Floats, sea: Sea, end: LineEnd | None = None) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Nodes of parts of cells, m, their curvature, and of which windows (n,) it is known; k: `curvature` of cells.

    end: what first nodes are, if they are ends of the line.
    """
    h, cuts = np.diff(x.s, axis=1), cuts_of(x.w.shape[1] - 1, end is not None)
    part = (np.arange(2 * PARTS) + 0.5) / (2 * PARTS)
    w, sinks = (y[:, :-1, None] + np.diff(y, axis=1)[:, :, None] * part for y in (x.w, x.sinks))
    presses = contact_pressure(sea, -w, sinks) * h[:, :, None]
    bed = (presses * (1.0 - part)).mean(axis=2)[:, 1:] + (presses * part).mean(axis=2)[:, :-1]
    q = np.zeros_like(x.w)
    q[:, 1:-1] = -(_across(x, k) + bed) / (0.5 * (h[:, 1:] + h[:, :-1]))
    q[:, 0], q[:, -1] = q[:, 1], q[:, -2]
    stiff = x.EI if end is None else np.where(end.EI[:, None] > 0.0, end.EI[:, None], x.EI)
    s, heights, sinking_at = (between(y, cuts) for y in (x.s, x.w, x.sinks))
    parts = Windows(s, heights, sinking_at, _along_cells(x.T, cuts), between(stiff, cuts))
    clamp = None if end is None else _clamped(x, parts, end)
    ends = k[:, [0, -1]]
    if end is not None:
        ends[end.EI > 0.0, 0] = 0.0
    w, settled = _solved(parts, ends, between(q, cuts), sea, clamp)
    bends = _ended(parts._replace(w=w), ends, clamp)
    if end is not None:
        bends[:, 0] = np.where(parts.EI[:, 0] > 0.0, bends[:, 0], _beyond(bends, parts.s))
    return parts.s, bends, settled


class Clamp(NamedTuple):
    """Curvature at first nodes over the slope of the first part of a cell: k + (slope - `slope`) * `per`."""

    slope: Floats  # (windows,) 1
    per: Floats  # (windows,) 1/m; 0 where the moment is given


def _clamped(x: Windows, parts: Windows, end: LineEnd) -> Clamp:
    """At a clamp the first part of a cell turns against the direction that is held, as the cell does."""
    h, part = x.s[:, 1] - x.s[:, 0], parts.s[:, 1] - parts.s[:, 0]
    held = np.isfinite(end.hn)
    length = np.where(held, end.hn, h) - 0.5 * h + 0.5 * part
    slope = (x.w[:, 1] - x.w[:, 0]) / h
    turned = np.where(held, end.k * (length - np.where(held, end.hn, 0.0)), 0.0)
    return Clamp(slope + turned, np.where(held, 1.0 / length, 0.0))


def _ended(x: Windows, k: Floats, clamp: Clamp | None) -> Floats:
    """`curvature`, with that (n, 2) at first and last nodes; clamp: of first nodes that are ends of the line."""
    bends = curvature(x)
    bends[:, [0, -1]] = k
    if clamp is not None:
        bends[:, 0] += ((x.w[:, 1] - x.w[:, 0]) / (x.s[:, 1] - x.s[:, 0]) - clamp.slope) * clamp.per
    return bends


def _solved(x: Windows, k: Floats, q: Floats, sea: Sea, clamp: Clamp | None) -> tuple[Floats, NDArray[np.bool_]]:
    """Heights of nodes in balance, and of which windows they are; k: (n, 2) as of `_ended`."""
    from scipy.linalg import solve_banded  # slow to import

    h = np.diff(x.s, axis=1)
    half, band, w = 0.5 * (h[:, 1:] + h[:, :-1]), _band(x), x.w.copy()
    if clamp is not None:
        band[2, :, 1] -= x.EI[:, 0] * clamp.per / h[:, 0] ** 2
    left, near = np.arange(len(w)), CHANGE * np.ptp(w, axis=1)
    for count in range(ROUNDS):
        now = Windows(x.s[left], w[left], x.sinks[left], x.T[left], x.EI[left])
        bends = _ended(now, k[left], None if clamp is None else Clamp(clamp.slope[left], clamp.per[left]))
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
