"""What the states of a batch of outputs mean, in one call.

The balance across the bed beside edges of contact is solved anew on parts of cells.

    (T w')' - (EI w'')'' + q + P(-w, -dw/dt) = 0

over some cells about the edge, each cut into parts, by Newton's method (outputs.probes says what for).  Loads q
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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, dot, get3, get9, scale, sub
from hybrid.kernels.algebra.sparse_rows import interval
from hybrid.kernels.laws.bending_law import EACH, FROM, KEPT, MOMENT, MOST, STIFF, STIFFENING, STIFFNESS
from hybrid.kernels.laws.closed_forms import depth_of
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.obstacles import meets, thinner
from hybrid.kernels.laws.seabed import contact, pressure, with_cell
from hybrid.kernels.laws.surfaces import surface
from hybrid.kernels.machine.binding import Series
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.resolution_checks import strain_of
from hybrid.kernels.state.books import STRAINS
from hybrid.kernels.state.report import DAMPING, ONSET_OF, SEABED
from hybrid.kernels.state.report import STIFFNESS as STIFFNESS_OF
from hybrid.kernels.state.state import (
    ALONG_LINE,
    NO_TURN,
    NODES_OF_LINE,
    Batch,
    Ends,
    Floats,
    Line,
    Rows,
    Sea,
    blanks,
)
from hybrid.kernels.watch.extremes import borne, node_pressure
from hybrid.kernels.watch.named_quantities import pull_at, touch_at
from hybrid.kernels.watch.sides import (
    LAYER,
    Rods,
    bend_direction,
    direction_on_side,
    end_tension,
    is_hinge,
    more_twist,
    of_chords,
    passed_torque,
    put_layers,
    restore_stiffness,
    strain_on_side,
)

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
    q, a, b, c = work[LOAD], work[MAIN], work[BELOW], work[SECOND]
    h, G, L, z = work[PER_LENGTH], work[PER_PIVOT], work[FIRST], work[RIGHT]  # G: 1/D
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


# Columns of what sides of nodes have.
BEND = 0  # 3, curvature, 1/m
TWIST = 3  # 1/m
NATURAL = 4  # 2, bends from what has no stress, 1/m
UNKNOWN = 6  # 1 where these are not known
SIDE_TORQUE = 7  # N m
ACROSS = 8  # 3, moment across the tangent, N m
SIDE = 11
# Columns of what the bed does to nodes.
DEPTH = 0  # m, below where contact begins
SINKING = 1  # m/s, its rate
BORNE = 2  # N/m, what nodes bear
ON_BED = 3
# What touches the bed.
EDGES = 0  # 2, arc lengths of the first and last point, m
PLACES = 2  # 2 x 3, where they are, m
GROUNDED = 8  # m, the length in contact
TOUCH = 9
ON_OBSTACLE = 6  # numbers of what an output presses on an obstacle
# Cells of less depth: between their nodes the layer at an end of a catenary is straight to 0.1 %.
SHALLOW = 0.1
# Largest depth of a cell: beyond, nothing is left of a layer, and its exponential would be zero.
STEEPEST = 700.0


class Output(NamedTuple):
    """One output, and what is found of it."""

    line: Line
    ends: Ends
    r: Rows  # (N+1, 3) m
    e: Rows  # (N, 3) m
    v: Rows  # (N+1, 3) m/s
    a1: Rows  # (N, 3)
    w: Floats  # (N,) 1/s
    T: Floats  # (N,) N
    turn: Rows  # (K, 3) as `State.turn`
    report: Floats  # as of a step
    loaded: NDArray[np.int8]  # (2,) whether a load is at the end
    hinges: Rows  # as of `Books`
    marks: NDArray[np.int8]  # (N+1,) of nodes with two sides, as of `Books`
    strains: Rows  # (N+1, STRAINS) as of `Books`
    moment: Rows  # (N+1, 3) N m, as of kernels.march.energies
    strain: Rows  # (N+1, 3) rad
    energy: Floats  # (5,) J: kinetic, bending, torsion, stretch, potential (of weight and buoyancy)
    bend: Floats  # (N+1,) 1/m, from cell to cell, inside the line; empty: not asked for
    held: Floats  # (N+2,) N, tension at the start, of the cells, at the end
    reaction: Rows  # (2, 3) N, force on the line at its ends: of what takes its pull, else that which is applied
    sides: Rows  # (n sides, SIDE)
    bed: Rows  # (N+1, ON_BED)
    touch: Floats  # (TOUCH,)


_blank = blanks(Output)
_read, _series = reader(_blank()), Series(_blank())


@kernel(inlined=False)
def observe_outputs(tables):
    """Find moment, strain, energy, bend, held, reaction and sides of all outputs, (nb, size) tables of `Output`."""
    for k in range(tables.shape[0]):
        x = _read(tables[k])
        observe(x.line, x.ends, x.e, x.v, x.a1, x.w, x.T, x.turn, Observed(x.moment, x.strain, x.energy))
        high = 0.0
        for i in range(x.r.shape[0]):
            for j in range(3):
                high += x.line.force[i, j] * x.r[i, j]
            if x.line.element[i]:
                strain_of(x.line, x.T, i, get3(x.strain, i), x.strains)
        x.energy[4] = -high
        for i in range(1, min(x.bend.shape[0], x.e.shape[0])):
            x.bend[i] = of_chords(x.line, x.e, i)
        for i in range(x.T.shape[0]):
            x.held[i + 1] = x.T[i]
        for end in range(2):
            at = end * (x.T.shape[0] + 1)
            x.held[at] = end_tension(x.line, x.ends, x, x.report, x.loaded, x.marks, end)
            pull, taken = pull_at(x.ends.held, x.loaded, x.report, end)
            for j in range(3):
                x.reaction[end, j] = -pull[j] if taken else x.ends.force[end, j]
        put_layers(x.line, x.ends, x, x)
        restore_stiffness(x.line, x.ends, Rods(x.e, x.T, x.strains, x.hinges, x.marks))
        put_sides(x)


@inner
def put_sides(x):
    """Enter what is on the sides of all nodes."""
    n, row, zone = x.e.shape[0], 0, 0
    for i in range(n + 1):
        passed, zone = passed_torque(x.line, x.turn, i, zone)
        for side in (-1, 1):
            if 0 <= i + side <= n and (side > 0 or i == n or x.marks[i]):
                put_side(x, row, i, side, passed)
                row += 1


@inner
def put_side(x, row, i, side, passed):
    """Enter what is on a side of node i into a row."""
    line, d, out = x.line, chord(get3(x.e, min(i, i + side)))[0], x.sides[row]
    outer, inward = i == 0 or i == x.e.shape[0], max(i - 1, 0)
    tangent = d if outer else add(chord(get3(x.e, inward))[0], chord(get3(x.e, min(i, x.e.shape[0] - 1)))[0])
    if outer and line.element[i]:
        R = get9(x.ends.frame, 0 if i == 0 else 1)
        tangent = (R[2], R[5], R[8])
    tangent = scale(1.0 / max(math.sqrt(dot(tangent, tangent)), 1e-12), tangent)
    M = get3(x.moment, i)
    along = dot(M, tangent)
    across = sub(M, scale(along, tangent))
    kappa, twist, a, b, unknown = strain_on_side(line, x.ends, x, x, i, side, get3(x.strain, i), passed)
    edge = outer or x.marks[i] != 0
    if edge and line.spin[min(i, i + side)]:
        twist -= more_twist(line, x.T, x.marks, i, side)
    direction = direction_on_side(line, x.e, i, side, edge, across)
    out[TWIST], out[NATURAL], out[NATURAL + 1], out[UNKNOWN] = twist, a, b, unknown
    out[SIDE_TORQUE] = passed + (along if outer else x.strains[i, 2] if line.element[i] else 0.0)
    for j in range(3):
        out[BEND + j], out[ACROSS + j] = kappa * direction[j], across[j]


@kernel
def observe_layers(tables, points, less):
    """Curvature (nb, ns, 3), 1/m, by which layers at ends of catenaries are no straight lines between nodes.

    points: (nb, ns) m, at which it is wanted.
    """
    for k in range(tables.shape[0]):
        x = _read(tables[k])
        n, s = x.e.shape[0], x.line.s
        for end in range(2):
            one, i, way = x.strains[end * n, LAYER + end], end * n, 1 - 2 * end
            if not is_hinge(x.line, x, end) or not one > 0.0:
                continue
            size, one, direction = one, 1.0, bend_direction(x.line, x.e, 1 + end * (n - 2))
            while 0 < i + way < n and one > 0.0 and not x.line.spin[min(i, i + way)]:  # rods keep others there
                j = i + way
                two = x.strains[j, LAYER + end]
                deep = min(depth_of(x.T[min(i, j)], x.hinges[end, 0], x.line.h[min(i, j)]), STEEPEST)
                for p in range(points.shape[1] if deep > SHALLOW else 0):
                    u = (points[k, p] - s[i]) / (s[j] - s[i])
                    if 0.0 < u < 1.0:
                        here = one * (math.exp(-u * deep) - u * math.exp(-deep))  # to nothing where it no longer counts
                        if two > 0.0:
                            here = one ** (1.0 - u) * two**u
                        for m in range(3):
                            less[k, p, m] += ((1.0 - u) * one + u * two - here) * size * direction[m]
                i, one = j, two


@kernel
def observe_bed(tables, sea):
    """Find `bed` and `touch` of all outputs."""
    for k in range(tables.shape[0]):
        x = _read(tables[k])
        n, s, bed = x.e.shape[0], x.line.s, x.bed
        before, here, x.touch[GROUNDED] = 0.0, 0.0, 0.0
        bed[0, DEPTH], bed[0, SINKING], here = node_pressure(sea, x, 0)
        for i in range(n + 1):
            after = 0.0
            if i < n:
                bed[i + 1, DEPTH], bed[i + 1, SINKING], after = node_pressure(sea, x, i + 1)
                high, low = max(bed[i, DEPTH], bed[i + 1, DEPTH]), min(bed[i, DEPTH], bed[i + 1, DEPTH])
                lies = 0.0 if high <= 0.0 else 1.0 if low > 0.0 else high / (high - low)
                x.touch[GROUNDED] += (s[i + 1] - s[i]) * lies
            bed[i, BORNE] = borne(x.line.h, i, before, here, after)
            before, here = here, after
        for end in range(2):
            x.touch[EDGES + end], place = touch_at(sea, s, x.r, end)
            for j in range(3):
                x.touch[PLACES + 3 * end + j] = place[j]


@kernel
def observe_obstacles(tables, sea, out):
    """Find what outputs press on all obstacles, (nb, M, ON_OBSTACLE).

    Resultant (3) and sum of the forces, N, their largest by length, N/m, energy, J; of cells of all obstacles.
    """
    for k in range(tables.shape[0]):
        x = _read(tables[k])
        for obstacle in range(sea.obstacles.shape[0]):
            press_obstacle(x.line, sea, obstacle, x.r, x.v, out[k, obstacle])


@called
def press_obstacle(line, sea, k, r, v, out):
    """The same of one output and obstacle k."""
    rows, n, moves = sea.obstacles, line.h.shape[0], line.moved.shape[0] > 0
    stiffness, damping, o = rows[k, STIFFNESS_OF], rows[k, DAMPING], rows[k, ONSET_OF]
    d, normal, _ = surface(sea, k, get3(r, 0))
    p, rate = 0.5 * o - d, -dot(normal, get3(v, 0))
    force = length = 0.0  # of the half cell before a node
    for j in range(ON_OBSTACLE):
        out[j] = 0.0
    for i in range(n + 1):
        after, beside, there, h = 0.0, p, normal, 0.0
        if i < n:
            h = line.h[i]
            d, there, _ = surface(sea, k, get3(r, i + 1))
            beside, speed = 0.5 * o - d, -dot(there, get3(v, i + 1))
            thin = thinner(line, rows, k, i)
            a, b = p - thin, beside - thin
            if (a > 0.0 or b > 0.0) and meets(line, sea, moves, k, i):
                force += contact(a, b, rate, speed, h, stiffness, damping, o)[0]
                after = contact(b, a, speed, rate, h, stiffness, damping, o)[0]
                out[5] = with_cell(out[5], a, b, h, stiffness, o)
            rate = speed
        for j in range(3):
            out[j] -= force * normal[j]
        out[3] += force
        out[4] = max(out[4], force / (0.5 * (length + h)))
        force, length, p, normal = after, h, beside, there


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


class Along(NamedTuple):
    """What outputs have along their lines, beside the lines."""

    hinges: Floats  # as of `Books`
    loaded: NDArray[np.int8]  # (2,)
    marks: NDArray[np.int8]  # of all nodes
    sides: int  # of all nodes: how many


class Found(NamedTuple):
    """What is found of nb outputs, one behind the other where their lines are others."""

    moment: Floats  # (nb, N+1, 3) N m, as of kernels.march.energies; of catenary alone (1, N+1, 3) of zeros, as strain
    strain: Floats  # (nb, N+1, 3) rad
    energy: Floats  # (nb, 5) J
    bend: Floats  # (nb, N+1) 1/m; of rod alone (nb, 0)
    held: Floats  # (nb, N+2) N
    reaction: Floats  # (nb, 2, 3) N
    sides: Floats  # (nb, n sides, SIDE)
    bed: Floats  # (nb, N+1, ON_BED); without a bed (nb, 0, ON_BED)
    touch: Floats  # (nb, TOUCH)
    tables: NDArray[np.int64]
    kept: tuple[Any, ...]  # what their addresses are of

    def layers(self, points: Floats) -> Floats:
        """As of `observe_layers` at points (nb, ns) m."""
        less = np.zeros((*points.shape, 3))
        observe_layers(self.tables, np.array(points, order="C"), less)  # of one type: read-only arrays have another
        return less


def _find(found: Found, line: Line, sea: Sea) -> Found:
    observe_outputs(found.tables)
    if line.bits & SEABED:
        observe_bed(found.tables, sea)
    return found


def observed(
    line: Line, sea: Sea, batch: Batch, what: Along, varied: Mapping[str, Floats] = MappingProxyType({})
) -> Found:
    """What outputs of one line mean; varied: arrays (nb, ...) of the line by name, where it is another one in every output.

    A bend is 2 tan(x/2) over the length of line around the node, x the angle from cell to cell; zero at the ends.
    """
    nb, n = batch.T.shape
    rods, catenary, touches = bool(line.element.any() or line.spin.any()), not line.spin.all(), line.bits & SEABED
    moment, strain = (np.zeros((nb if rods else 1, n + 1, 3)) for _ in range(2))
    z = np.zeros
    out = {"energy": z((nb, 5)), "bend": z((nb, n + 1 if catenary else 0)), "held": z((nb, n + 2))}
    out |= {"bed": z((nb, n + 1 if touches else 0, ON_BED)), "touch": z((nb, TOUCH))}
    out |= {"reaction": z((nb, 2, 3)), "sides": z((nb, what.sides, SIDE)), "strains": z((nb, n + 1, STRAINS))}
    own = out | ({"moment": moment, "strain": strain} if rods else {})
    state = {name: getattr(batch, name) for name in ("r", "e", "v", "a1", "w", "T", "report")}
    if batch.turn.size:
        state["turn"] = batch.turn
    held = Ends(batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    of_line = {"line.h": batch.h, "line.kb": batch.kb} if batch.h.size else {}
    if line.slip_law.size:
        varied = {**varied, "slip_now": slipped(line, batch)}
    of_line |= {f"line.{name}": x for name, x in varied.items()}
    there = batch.line(0, line)._replace(**{name: x[0] for name, x in varied.items()})
    along = state | own
    given = {"turn": NO_TURN, "moment": moment[0], "strain": strain[0]} | {name: x[0] for name, x in along.items()}
    first = Output(
        there, Ends(*(x[0] for x in held)), hinges=what.hinges, marks=what.marks, loaded=what.loaded, **given
    )
    ends = {f"ends.{name}": x for name, x in held._asdict().items()}
    tables = _series(first, nb, along | of_line | ends)
    kept = {name: x for name, x in out.items() if name != "strains"}
    return _find(Found(moment, strain, **kept, tables=tables, kept=(first, along, of_line, held)), line, sea)


def observed_joined(
    line: Line, sea: Sea, batch: Batch, what: Along, begin: NDArray[np.int64], rows: NDArray[np.int64]
) -> Found:
    """The same of nb outputs of other lines, one behind the other: of nodes (M, ...) in place of (nb, N+1, ...).

    begin, rows: (nb+1,) nodes and sides before each line; line, batch: arrays along all of them, in `batch` with one row;
    between two lines is a cell that belongs to none.  Without catenary there are no bends, (0,).
    """
    nodes, M, catenary, touches = int(begin[1]), begin[-1], not line.spin.all(), line.bits & SEABED
    z, nb = np.zeros, begin.size - 1
    each = {"energy": z((nb, 5)), "touch": z((nb, TOUCH)), "reaction": z((nb, 2, 3))}
    found = {"moment": z((M, 3)), "strain": z((M, 3)), "bend": z(M if catenary else 0)}
    found |= {"bed": z((M if touches else 0, ON_BED)), "held": z(M + nb), "sides": z((rows[-1], SIDE))}
    on_nodes = {"r": batch.r[0], "v": batch.v[0], "marks": what.marks, "strains": np.zeros((M, STRAINS))}
    on_nodes |= {name: found[name] for name in ("moment", "strain", "bend", "bed") if len(found[name])}
    on_nodes |= {f"line.{name}": getattr(line, name) for name in NODES_OF_LINE}
    on_cells = {name: getattr(batch, name)[0] for name in ("e", "a1", "w", "T")}
    on_cells |= {f"line.{name}": getattr(line, name) for name in ALONG_LINE if name not in NODES_OF_LINE}
    cut = {name: x[:nodes] for name, x in on_nodes.items()} | {name: x[: nodes - 1] for name, x in on_cells.items()}
    held = Ends(batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    own = found | {name: x for name, x in cut.items() if "." not in name} | {name: x[0] for name, x in each.items()}
    own |= {"held": found["held"][: nodes + 1], "sides": found["sides"][: rows[1]], "report": batch.report[0]}
    there, held_there = line._replace(**{name: cut[f"line.{name}"] for name in ALONG_LINE}), Ends(*(x[0] for x in held))
    first = Output(there, held_there, turn=NO_TURN, hinges=what.hinges, loaded=what.loaded, **own)
    along = each | {"report": batch.report} | {f"ends.{name}": x for name, x in held._asdict().items()}
    tables = _series(first, nb, along)
    _series.shift(tables, on_nodes, begin[:-1], np.diff(begin))
    _series.shift(tables, on_cells, begin[:-1], np.diff(begin) - 1)
    _series.shift(tables, {"held": found["held"]}, begin[:-1] + np.arange(nb), np.diff(begin) + 1)
    _series.shift(tables, {"sides": found["sides"]}, rows[:-1], np.diff(rows))
    return _find(Found(**found, **each, tables=tables, kept=(first, on_nodes, on_cells, held)), line, sea)
