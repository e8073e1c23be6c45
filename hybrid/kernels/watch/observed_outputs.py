"""What the states of a batch of outputs mean, in one call.

The balance across the bed beside edges of contact is solved anew on parts of cells.

    (T w')' - (EI w'')'' + q + P(-w, -dw/dt) = 0

over some cells about the edge, each cut into parts, by Newton's method (outputs.edge_errors says what for).  Loads q
are those that balance the nodes.  Heights of the first and last node stay, with the curvature there; at a clamp the
first part turns against its direction.  Without the bed and for T > 0 minus the derivative of the balance is
symmetric and positive definite, and the bed adds to its diagonal: A = L D L^T with two diagonals below the main one,
without pivoting.

    symbol  meaning                                                      unit
    w       height above where contact begins, at nodes                  m
    sinks   -dw/dt                                                       m/s
    k       w'', its curvature across the bed                            1/m
    T, h    tension, length of cells or parts                            N, m
    EI      bending stiffness, 0 of catenaries                           N m2
    q       load per length that is not of the bed                       N/m
    a, b, c main diagonal of A, without the bed, first and second below  N/m

Besides there are moments, strains, energies and bends of catenaries.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import cross, dot, get3
from hybrid.kernels.laws.bending_law import EACH, FROM, KEPT, MOMENT, MOST, STIFF, STIFFENING, STIFFNESS
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.seabed import interval, pressure
from hybrid.kernels.machine.binding import Series
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.state.books import STRAINS
from hybrid.kernels.state.state import (
    ALONG_LINE,
    NO_TURN,
    NODES_OF_LINE,
    Batch,
    Ends,
    Floats,
    Line,
    blank_line,
    no_ends,
)
from hybrid.kernels.watch.soft_rods import BENT, EI, LINE, RAW, C, Rods, part_of_stiffness, restore_stiffness

# Points of a cell at which the bed presses, where its load on nodes is found.
POINTS = 12
# Newton's method:
CHANGE = 1e-9  # it ends where w changes by less than this part of its range, which shows in no curvature
HALF = 6  # every so many rounds it goes half the way, since beside a hard bed it may swing between two answers
ROUNDS = 40  # at most
# Rows of work, and how many.
W, SINKS, TENSION, BED_STIFFNESS, LOAD, MAIN, BELOW, SECOND, PER_LENGTH, PER_PIVOT, FIRST, RIGHT, WORK = range(13)


class Windows(NamedTuple):
    """Some cells of outputs, or parts of cells of one, as in the table above."""

    s: Floats  # (windows, nodes) m
    w: Floats  # (windows, nodes)
    sinks: Floats  # (windows, nodes)
    T: Floats  # (windows, cells)
    EI: Floats  # (windows, nodes)


class LineEnd(NamedTuple):
    """What an end of the line is, at the first nodes of windows; empty arrays: they do not reach to one."""

    k: Floats  # (windows,) 1/m, curvature across the bed of the moment there; of catenaries as of `beyond`
    hn: Floats  # (windows,) m, of the element at a clamp; infinite where the moment is given
    EI: Floats  # (windows,) N m2, of catenaries without moment, whose curvature results take away there; else 0


class Cuts(NamedTuple):
    """Parts of the cells of a window: their ends."""

    cell: NDArray[np.int64]
    part: Floats  # of that cell, from its first node on


class Refined(NamedTuple):
    """What is found of windows."""

    s: Floats  # (windows, nodes of parts) m
    k: Floats  # (windows, nodes of parts) 1/m
    settled: NDArray[np.bool_]  # (windows,) whether it is known


class Bed(NamedTuple):
    """Law of contact with the bed."""

    stiffness: float  # N/m2
    damping: float  # N s/m2
    onset: float  # m


class Clamp(NamedTuple):
    """Curvature at the first node over the slope of the first part of a cell: k + (slope - `slope`) * `per`."""

    k: float  # 1/m
    slope: float  # 1
    per: float  # 1/m; 0 where the moment is given


@inner
def between(x, cell, part):
    """Value on the straight line between the nodes of a cell."""
    return x[cell] + (x[cell + 1] - x[cell]) * part


@inner
def node_tension(T, i):
    """Mean of the tensions of the cells beside node i, at an end what they lead to."""
    n = T.shape[0]
    before = T[i - 1] if i > 0 else 2.0 * T[0] - T[1]
    after = T[i] if i < n else 2.0 * T[n - 1] - T[n - 2]
    return 0.5 * (before + after)


@inner
def pull(x, k, c):
    """T w' - (EI w'')' of cell c, N."""
    return (x.T[c] * (x.w[c + 1] - x.w[c]) - (x.EI[c + 1] * k[c + 1] - x.EI[c] * k[c])) / (x.s[c + 1] - x.s[c])


@inner
def put_loads(x, k, bed, q):
    """q at nodes: with the bed under straight cells it balances them."""
    cells, far, before = x.T.shape[0], 0.0, 0.0
    for c in range(cells):
        h, near, next_far = x.s[c + 1] - x.s[c], 0.0, 0.0
        for m in range(POINTS):
            part = (m + 0.5) / POINTS
            p, _, _ = pressure(
                part, -x.w[c], -x.w[c + 1], x.sinks[c], x.sinks[c + 1], bed.stiffness, bed.damping, bed.onset
            )
            near += (1.0 - part) * p
            next_far += part * p
        after = pull(x, k, c)
        if c > 0:
            q[c] = -(after - before + far + near * h / POINTS) / (0.5 * (x.s[c + 1] - x.s[c - 1]))
        before, far = after, next_far * h / POINTS
    q[0], q[cells] = q[1], q[cells - 1]


@inner
def put_parts(x, EI, cuts, y):
    """Nodes of the parts of the cells of a window x; EI: N m2, at its first node and beyond if positive.

    What changes the tension is spread over parts, not in the nodes, where it would be a load.
    """
    tension = 0.0
    for j in range(y.s.shape[0]):
        c, part = cuts.cell[j], cuts.part[j]
        y.s[j], y.w[j], y.sinks[j] = between(x.s, c, part), between(x.w, c, part), between(x.sinks, c, part)
        y.EI[j] = EI if EI > 0.0 else between(x.EI, c, part)
        T, before = node_tension(x.T, c), tension
        tension = T + (node_tension(x.T, c + 1) - T) * part
        if j > 0:
            y.T[j - 1] = 0.5 * (before + tension)


@inner
def clamp_of(x, y, k, hn):
    """At a clamp the first part of a cell turns against the direction that is held, as the cell does.

    x: cells, y: their parts; k: 1/m, at the clamp; hn: m, infinite where the moment is given.
    """
    h, slope = x.s[1] - x.s[0], (x.w[1] - x.w[0]) / (x.s[1] - x.s[0])
    if not hn < math.inf:
        return Clamp(k, slope, 0.0)
    length = hn - 0.5 * h + 0.5 * (y.s[1] - y.s[0])
    return Clamp(k, slope + k * (length - hn), 1.0 / length)


@inner
def put_curvature(x, clamp, p, k):
    """w'' at nodes; that at the last one stays; p: 1/h."""
    before = (x.w[1] - x.w[0]) * p[0]
    k[0] = clamp.k + (before - clamp.slope) * clamp.per
    for i in range(1, x.T.shape[0]):
        after = (x.w[i + 1] - x.w[i]) * p[i]
        k[i], before = (after - before) / (0.5 * (x.s[i + 1] - x.s[i - 1])), after


@inner
def put_band(x, clamp, p, a, b, c):
    """1/h, and A without the bed, of inner nodes; curvature is given at the ends, and bends there nothing."""
    n = x.T.shape[0]
    for i in range(n + 1):
        a[i], b[i], c[i] = 0.0, 0.0, 0.0
    for i in range(n):
        p[i] = 1.0 / (x.s[i + 1] - x.s[i])
        a[i] += x.T[i] * p[i]
        a[i + 1] += x.T[i] * p[i]
        b[i] -= x.T[i] * p[i]
        if i > 0:
            l, r = p[i - 1], p[i]
            each = x.EI[i] * 2.0 / (1.0 / l + 1.0 / r)
            a[i - 1] += each * l * l
            a[i] += each * (l + r) * (l + r)
            a[i + 1] += each * r * r
            b[i - 1] -= each * l * (l + r)
            b[i] -= each * r * (l + r)
            c[i - 1] = each * l * r
    a[1] += x.EI[0] * clamp.per * p[0] * p[0]


@inner
def correct(x, k, bed, work, part):
    """Go a part of a step of Newton's method; the largest change of w, m, of all of it."""
    n = x.T.shape[0]
    q, a, b, c, h, G, L, z = (
        work[LOAD],
        work[MAIN],
        work[BELOW],
        work[SECOND],
        work[PER_LENGTH],
        work[PER_PIVOT],
        work[FIRST],
        work[RIGHT],
    )  # G: 1/D
    bent = x.EI[1] * k[1]
    before = (x.T[0] * (x.w[1] - x.w[0]) - (bent - x.EI[0] * k[0])) * h[0]
    e = second = z[0] = L[0] = 0.0
    for i in range(1, n):
        bent, beside = x.EI[i + 1] * k[i + 1], bent
        after, half = (x.T[i] * (x.w[i + 1] - x.w[i]) - (bent - beside)) * h[i], 0.5 * (x.s[i + 1] - x.s[i - 1])
        w, sinks = -x.w[i], x.sinks[i]
        p, stiff, _ = pressure(0.0, w, w, sinks, sinks, bed.stiffness, bed.damping, bed.onset)
        pivot, right = a[i] + half * stiff - e * L[i - 1], after - before + half * (q[i] + p) - L[i - 1] * z[i - 1]
        if i > 2:
            second = c[i - 2] * G[i - 2]
            pivot -= c[i - 2] * second
            right -= second * z[i - 2]
        e = b[i] - (c[i - 1] * L[i - 1] if i > 1 else 0.0)
        G[i], z[i], before = 1.0 / pivot, right, after
        L[i] = e * G[i]
    most = next_one = next_two = 0.0
    for j in range(1, n):
        i = n - j
        change = z[i] * G[i]
        if j > 1:
            change -= L[i] * next_one
        if j > 2:
            change -= c[i] * G[i] * next_two
        x.w[i] += part * change
        if not abs(change) <= most:
            most = abs(change)
        next_one, next_two = change, next_one
    return most


@inner
def balanced(x, clamp, bed, work, k):
    """Find heights in balance, and the curvature; whether they are."""
    low = high = x.w[0]
    for i in range(x.w.shape[0]):
        low, high = min(low, x.w[i]), max(high, x.w[i])
    put_band(x, clamp, work[PER_LENGTH], work[MAIN], work[BELOW], work[SECOND])
    put_curvature(x, clamp, work[PER_LENGTH], k)
    for count in range(ROUNDS):
        change = correct(x, k, bed, work, 0.5 if count % HALF == HALF - 1 else 1.0)
        put_curvature(x, clamp, work[PER_LENGTH], k)
        if change <= CHANGE * (high - low):
            return True
    return False


@inner
def beyond(k, s):
    """Value at the first node that the two beside it lead to."""
    return k[1] - (k[2] - k[1]) * (s[1] - s[0]) / (s[2] - s[1])


@kernel
def refine_windows(windows, k, end, bed, cuts, work, out):
    """Curvature at nodes of parts of cells into `out`; k: of cells, (windows, nodes); work: (WORK, nodes of parts)."""
    last = k.shape[1] - 1
    for n in range(k.shape[0]):
        x = Windows(windows.s[n], windows.w[n], windows.sinks[n], windows.T[n], windows.EI[n])
        bends, EI, hn = out.k[n], 0.0, math.inf
        if end.EI.shape[0] > 0:
            EI, hn = end.EI[n], end.hn[n]
        y = Windows(out.s[n], work[W], work[SINKS], work[TENSION][1:], work[BED_STIFFNESS])
        put_loads(x, k[n], bed, work[RIGHT])
        put_parts(x, EI, cuts, y)
        for j in range(y.s.shape[0]):
            work[LOAD, j] = between(work[RIGHT], cuts.cell[j], cuts.part[j])
        clamp = clamp_of(x, y, 0.0 if EI > 0.0 else k[n, 0], hn)
        bends[bends.shape[0] - 1] = k[n, last]
        out.settled[n] = balanced(y, clamp, bed, work, bends)
        if end.EI.shape[0] > 0 and not y.EI[0] > 0.0:
            bends[0] = beyond(bends, y.s)


@kernel
def put_largest(s, missed, points, rows, columns, out):
    """Sizes of what windows miss, at output points, where they are larger than those in `out` (quantities, ns, nb).

    s: (windows, n) m; missed: (quantities, windows, n); points: (ns, nb or 1) m; rows: (windows, 2) first point and that
    after the last one that may lie in a window; columns: (windows,) outputs.
    """
    for n in range(s.shape[0]):
        j = columns[n]
        at = j if points.shape[1] > 1 else 0
        for i in range(rows[n, 0], rows[n, 1]):
            x = points[i, at]
            if s[n, 0] <= x <= s[n, s.shape[1] - 1]:
                c = interval(s[n], x)
                part = (x - s[n, c]) / (s[n, c + 1] - s[n, c])
                for q in range(out.shape[0]):
                    out[q, i, j] = max(out[q, i, j], abs(between(missed[q, n], c, part)))


FOLDED = 1e-12  # 1 + cos(x) of cells that are as good as folded onto each other


class Output(NamedTuple):
    """One output, and what is found of it."""

    line: Line
    ends: Ends
    r: Floats  # (N+1, 3) m
    e: Floats  # (N, 3) m
    v: Floats  # (N+1, 3) m/s
    a1: Floats  # (N, 3)
    w: Floats  # (N,) 1/s
    T: Floats  # (N,) N
    turn: Floats  # (K, 3) as `State.turn`
    moment: Floats  # (N+1, 3) N m, as of kernels.march.energies
    strain: Floats  # (N+1, 3) rad
    energy: Floats  # (5,) J: kinetic, bending, torsion, stretch, potential (of weight and buoyancy)
    bend: Floats  # (N+1,) 1/m, from cell to cell, inside the line; empty: not asked for
    hinges: Floats  # as of `Books`
    marks: NDArray[np.int8]  # (N+1,) nodes with two sides
    rods: Floats  # (N+1, STRAINS) as `Books.strains`, of kernels.watch.soft_rods; empty: not asked for


def _blank() -> Output:
    nodes, cells = np.zeros((2, 3)), np.zeros((1, 3))
    return Output(
        blank_line(1),
        no_ends(),
        nodes,
        cells,
        nodes,
        cells,
        np.zeros(1),
        np.zeros(1),
        NO_TURN,
        nodes,
        nodes,
        np.zeros(5),
        np.zeros(2),
        np.zeros((3, 3)),
        np.zeros(2, np.int8),
        np.zeros((2, STRAINS)),
    )


_read, _series = reader(_blank()), Series(_blank())


@kernel
def observe_outputs(tables):
    """Find moment, strain, energy and bend of all outputs, (nb, size) tables of `Output`."""
    for k in range(tables.shape[0]):
        x = _read(tables[k])
        observe(x.line, x.ends, x.e, x.v, x.a1, x.w, x.T, x.turn, Observed(x.moment, x.strain, x.energy))
        high = 0.0
        for i in range(x.r.shape[0]):
            for j in range(3):
                high += x.line.force[i, j] * x.r[i, j]
        x.energy[4] = -high
        if x.bend.shape[0] > 0:
            before, _, _ = chord(get3(x.e, 0))
            for i in range(1, x.e.shape[0]):
                d, _, _ = chord(get3(x.e, i))
                c = cross(before, d)
                cosine = 1.0 + dot(before, d)
                half = math.sqrt(dot(c, c)) / cosine if cosine > FOLDED else math.sqrt(2.0 / FOLDED)  # tan(x/2)
                x.bend[i] = 2.0 * half / x.line.hn[i]
                before = d


@kernel
def observe_soft_rods(tables):
    """Find, of outputs that are observed, curvature of rods that lack stiffness (else NaN), and parts of it (column C)."""
    for k in range(tables.shape[0]):
        x = _read(tables[k])
        for i in range(x.rods.shape[0]):
            x.rods[i, RAW], x.rods[i, BENT] = math.hypot(x.strain[i, 0], x.strain[i, 1]) / x.line.hn[i], math.nan
        restore_stiffness(x.line, x.ends, Rods(x.e, x.T, x.rods, x.hinges, x.marks))
        for i in range(x.rods.shape[0]):
            x.rods[i, C] = part_of_stiffness(x.line, i, x.hinges)


def slipped(line: Line, batch: Batch) -> Floats:
    """`slip_now` (nb, N+1, 4 L) of outputs: their layers bear what they have, as stiff as their tension makes them."""
    n = batch.T.shape[1]
    out = np.full((batch.t.size, *line.slip_now.shape), np.inf)
    elastic = line.slip_law[:, MOMENT::EACH]
    out[:, :, MOST::EACH] = np.where(elastic < 0.0, elastic, np.inf)
    for k in range(KEPT):
        out[:, :, FROM + k :: EACH] = batch.layers[:, :, k::KEPT]
    T = np.maximum(0.5 * (batch.T[:, [0, *range(n)]] + batch.T[:, [*range(n), n - 1]]), 0.0)[:, :, None]
    out[:, :, STIFF::EACH] = line.slip_law[:, STIFFNESS::EACH] + line.slip_law[:, STIFFENING::EACH] * T
    return out


class Found(NamedTuple):
    """What is found of nb outputs, one behind the other where their lines are others."""

    moment: Floats  # (nb, N+1, 3) N m, as of kernels.march.energies; of catenary alone (1, N+1, 3) of zeros, as strain
    strain: Floats  # (nb, N+1, 3) rad
    energy: Floats  # (nb, 5) J
    bend: Floats  # (nb, N+1) 1/m; of rod alone (nb, 0)
    rods: Floats  # (nb, N+1, STRAINS) as of `observe_soft_rods`; (nb, 0, STRAINS): no rods, or nothing known of them


def observed(
    line: Line,
    batch: Batch,
    hinges: Floats,
    marks: NDArray[np.int8],
    varied: Mapping[str, Floats] = MappingProxyType({}),
) -> Found:
    """What outputs of one line mean.

    hinges: as of `Books`; marks: (N+1,) nodes with two sides; varied: arrays (nb, ...) of the line by name, where it is another one in every output.
    A bend is 2 tan(x/2) over the length of line around the node, x the angle from cell to cell; zero at the ends.
    """
    nb, n = batch.T.shape
    rods, catenary = bool(line.element.any() or line.spin.any()), not line.spin.all()
    moment, strain = (np.zeros((nb if rods else 1, n + 1, 3)) for _ in range(2))
    energy, bend = np.zeros((nb, 5)), np.zeros((nb, n + 1 if catenary else 0))
    soft = rods and hinges[LINE, EI] > 0.0
    whole = np.zeros((nb, n + 1 if soft else 0, STRAINS))
    own = {"moment": moment, "strain": strain} if rods else {}
    state = {"r": batch.r, "e": batch.e, "v": batch.v, "a1": batch.a1, "w": batch.w, "T": batch.T}
    if batch.turn.size:
        state["turn"] = batch.turn
    held = Ends(batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    of_line = {"line.h": batch.h, "line.kb": batch.kb} if batch.h.size else {}
    if line.slip_law.size:
        varied = {**varied, "slip_now": slipped(line, batch)}
    of_line |= {f"line.{name}": x for name, x in varied.items()}
    there = batch.line(0, line)._replace(**{name: x[0] for name, x in varied.items()})
    first = Output(
        there, Ends(*(x[0] for x in held)),
        **{"turn": NO_TURN} | {name: x[0] for name, x in state.items()}, moment=moment[0], strain=strain[0],
        energy=energy[0], bend=bend[0], hinges=hinges, marks=marks, rods=whole[0],
    )  # fmt: skip
    along = (
        state
        | own
        | of_line
        | {"energy": energy, "bend": bend, "rods": whole}
        | {f"ends.{name}": x for name, x in held._asdict().items()}
    )
    tables = _series(first, nb, along)
    observe_outputs(tables)
    if soft:
        observe_soft_rods(tables)
    return Found(moment, strain, energy, bend, whole)


def observed_joined(
    line: Line, batch: Batch, hinges: Floats, marks: NDArray[np.int8], begin: NDArray[np.int64]
) -> Found:
    """The same of nb outputs of other lines, one behind the other: of nodes (M, ...) in place of (nb, N+1, ...).

    begin: (nb+1,) nodes before each line; line, batch: arrays along all of them, in `batch` with one row; between two
    lines is a cell that belongs to none.  Without catenary there are no bends, (0,).
    """
    nodes, catenary = int(begin[1]), not line.spin.all()
    moment, strain = np.zeros((begin[-1], 3)), np.zeros((begin[-1], 3))
    energy, bend = np.zeros((begin.size - 1, 5)), np.zeros(begin[-1] if catenary else 0)
    soft = line.spin.any() and hinges[LINE, EI] > 0.0
    whole = np.zeros((begin[-1] if soft else 0, STRAINS))
    on_nodes = {"r": batch.r[0], "v": batch.v[0], "moment": moment, "strain": strain, "marks": marks}
    on_nodes |= ({"bend": bend} if catenary else {}) | ({"rods": whole} if soft else {})
    on_nodes |= {f"line.{name}": getattr(line, name) for name in NODES_OF_LINE}
    on_cells = {name: getattr(batch, name)[0] for name in ("e", "a1", "w", "T")}
    on_cells |= {f"line.{name}": getattr(line, name) for name in ALONG_LINE if name not in NODES_OF_LINE}
    cut = {name: x[:nodes] for name, x in on_nodes.items()} | {name: x[: nodes - 1] for name, x in on_cells.items()}
    held = Ends(batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    own = {name: x for name, x in cut.items() if "." not in name}
    first = Output(
        line._replace(**{name: cut[f"line.{name}"] for name in ALONG_LINE}),
        Ends(*(x[0] for x in held)),
        **{"turn": NO_TURN, "bend": bend, "rods": whole} | own,
        energy=energy[0],
        hinges=hinges,
    )
    along = {"energy": energy} | {f"ends.{name}": x for name, x in held._asdict().items()}
    tables = _series(first, energy.shape[0], along)
    _series.shift(tables, on_nodes, begin[:-1], np.diff(begin))
    _series.shift(tables, on_cells, begin[:-1], np.diff(begin) - 1)
    observe_outputs(tables)
    if soft:
        observe_soft_rods(tables)
    return Found(moment, strain, energy, bend, whole)
