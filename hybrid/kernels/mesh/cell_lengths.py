"""How long the cells of rods may be: from curvature and twist as they are, at every step of a run whose cells follow.

    symbol   meaning                                                        unit
    kappa    curvature at a node                                            1/m
    W        wanted length of cells at a node                               m
    finer    fineness: all lengths asked for are so many times as short     1
    l0       min(sqrt(EI/T), (EI/w)^(1/3)), over which a rod bends          m
    twist    of a rod per length                                            rad/m
    delta    what the chord of a cell is shorter by than its arc            m

A cell of length h interpolates the curvature with the error h^2 |kappa''| / 8.  Cells are dyadic parts of base cells: a
part is halved where it is longer than wanted, and two halves become one where that is shorter by far.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import dot, get3, scale, sub
from hybrid.kernels.laws.seabed import bed_under
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.mesh.cell_errors import (
    CURVATURE,
    bending_length,
    lack_at_edge,
    layer_length,
    longest_behind_hinge,
    longest_cell,
    lower_by_waves,
    lowest_beside,
    node_curvature,
    over_shares,
    second_slope,
    tension_beside,
)
from hybrid.kernels.mesh.zone_criteria import EDGE, FORESEEN, depth, raise_ratio
from hybrid.kernels.state.report import SEABED

TURN = 0.3  # rad that a cell turns through
TWIST = 0.25  # rad that a cell of a rod is twisted by: cells that stay have as much (model.build)
SHORTEST_CELL, SHORTEST_SLACK = 0.6, 0.25  # of l0; where a line is slack, layers in motion are sharper than at rest
COMPRESSED_SHARE = (
    0.1  # of the share: what interpolation may make wrong where a line is compressed and its bend wanders
)
JOINT_LAYER = 3.0  # of l0: over which a rod bends less beside a hinge, which is no bend of the line
SHARP = 0.5  # rad: a kink that runs along a line may be as short as this over its curvature, which l0 at rest is not
FLANK = 0.9  # of the cell that interpolates such a kink within its share
NEAR = 3  # nodes to either side whose curvature counts
EDGE_CELL, EDGE_WIDTH = 1.0, 3.0  # of l0: cells beside a contact edge, and how far from it
FARTHEST = 30.0  # of l0: how far an edge is foreseen to go in a step
FARTHEST_KIND = 0.1  # of the line: how far where kinds are chosen, for a ramp time ahead
HORIZON = 2.5  # steps of the way of an edge for which cells are made when they change, so that fewer steps do
STEEPEST = 0.8  # by which W may grow with s: cells beside each other differ by little more than 2
AHEAD = 0.75  # of W from which cells are halved where others must be: changes become fewer
MERGE = 0.5  # of W that two cells made one may be long
STEADY = 2.0  # times the curvature error of lengths: by so much may curvature change along two cells made one
IDLE_STEPS = 4  # for which two cells must have been so short and so evenly bent
FADE = 10.0  # ramp times over which the largest curvature of earlier is forgotten
SAVED = 0.12  # of all cells: so many must go before any goes
KAPPA, BENDS = range(2)  # columns of the work array `moment` of zones: curvature, 1/m, and |kappa''|, 1/m^3, of nodes
SMOOTHED = 0.1  # part by which delta comes nearer to what it is, in a step: at once it is unstable in slack lines


@inner
def is_slack(EI, w, T):
    """Whether weight, not tension, says over what length a line bends: below T0 = (EI w^2)^(1/3)."""
    return EI * w * w > T * T * T


@inner
def part_of_share(line, sea, state, kinds, i):
    """The part of its share that interpolation may make wrong at node i: COMPRESSED_SHARE where the line is compressed.

    A bend that nothing but weight holds wanders by what its cells make of it, and is off by some ten times what a cell
    interpolates wrongly; from T0 on, and on the bed, a line is off by less than that.
    """
    EI, w, T = kinds.EI[i], kinds.w[i], tension_beside(state.T, i)
    if not is_slack(EI, w, T) or (line.bits & SEABED and depth(sea, state.r, i) > 0.0):
        return 1.0
    return COMPRESSED_SHARE + (1.0 - COMPRESSED_SHARE) * max(T, 0.0) / (EI * w * w) ** (1.0 / 3.0)


@inner
def shortest_length(kinds, T, i, kappa, part, limits, finer):
    """Below which cells at node i need not be: what a layer, or a kink on its way, of largest curvature kappa asks for."""
    EI, w, low = kinds.EI[i], kinds.w[i], lowest_beside(kinds, T, i)
    l0 = layer_length(EI, w, low)
    least = (SHORTEST_SLACK if is_slack(EI, w, low) else SHORTEST_CELL) * l0 / finer
    if kappa > 0.0:
        share = limits[CURVATURE] * part
        least = min(least, FLANK * math.sqrt(8.0 * share / kappa) * min(l0, SHARP / kappa))
    return least


@inner
def length_by_turn(kinds, i, k, bends, limits, finer):
    """What curvature k of node i, and |kappa''| there, ask for, m."""
    W = longest_cell(kinds.EI[i], kinds.w[i], k, bends, limits)
    return min(W, TURN / (k * finer)) if k > 0.0 else W


@inner
def find_bends(line, turn, bend):
    """Curvature and |kappa''| of all nodes into bend (N+1, >= 2); the ends have no |kappa''|."""
    n = line.h.shape[0]
    for i in range(n + 1):
        bend[i, KAPPA] = node_curvature(line, turn, i)
    bend[0, BENDS] = bend[n, BENDS] = 0.0
    for i in range(1, n):
        bend[i, BENDS] = second_slope(line.s, i, bend[i - 1, KAPPA], bend[i, KAPPA], bend[i + 1, KAPPA])


@inner
def wanted_length(kinds, T, bend, i, part, limits, finer):
    """W at node i; bend: as of `find_bends`; limits: (4,) errors that interpolation may make, by cells as fine as asked."""
    n = T.shape[0]
    bends, largest = 0.0, bend[i, KAPPA]
    for k in range(max(i - 1, 1), min(i + 2, n)):
        bends = max(bends, bend[k, BENDS])
    for k in range(max(i - NEAR, 1), min(i + NEAR + 1, n)):  # flanks of a kink are as sharp as it
        largest = max(largest, bend[k, KAPPA])
    W = length_by_turn(kinds, i, bend[i, KAPPA], bends / part, limits, finer)
    return max(W, shortest_length(kinds, T, i, largest, part, limits, finer))


@inner
def is_hinge(line, zones, j):
    """Whether a joint of a rod and a catenary is at inner node j, or of rods one of which is being let go or blended in."""
    if line.spin[j] != line.spin[j - 1]:
        return True
    a, b = zones.kinds.base_of_cell[j - 1], zones.kinds.base_of_cell[j]
    return a != b and line.spin[j] == 1 and (zones.leaving[a] != zones.leaving[b] or zones.grown[a] != zones.grown[b])


@inner
def raise_beside(line, zones, j, way, reach, finer):
    """W at nodes from j on, up or down the line: over `reach`, m, and those whose kappa'' the hinge is part of."""
    kinds, s, count = zones.kinds, line.s, 0
    i = j
    while 0 <= i < s.shape[0] and (count <= 2 or abs(s[i] - s[j]) <= reach):
        k = zones.moment[i, KAPPA]
        zones.wanted[i] = max(zones.wanted[i], length_by_turn(kinds, i, k, 0.0, zones.limits, finer))
        i, count = i + way, count + 1


@inner
def raise_at_hinges(line, state, zones, finer):
    """W beside hinges: the layer in which a rod bends less there is of the model.

    Cells as short as it would show a curvature that falls to that of a hinge, sharper with every refinement, and be as
    many at each as a contact edge needs.
    """
    for j in range(1, line.h.shape[0]):
        if is_hinge(line, zones, j):
            reach = JOINT_LAYER * bending_length(zones.kinds, state.T, j)
            raise_beside(line, zones, j, 1, reach, finer)
            raise_beside(line, zones, j, -1, reach, finer)


@inner
def lower_by_twist(zones, finer):
    """W at the nodes of rods: no cell is twisted by more than TWIST, however little the line bends."""
    of, W = zones.kinds.base_of_cell, zones.wanted
    n = of.shape[0]
    for i in range(n + 1):
        twist = zones.kinds.twist[i]
        if twist > 0.0 and (zones.next_rod[of[max(i - 1, 0)]] or zones.next_rod[of[min(i, n - 1)]]):
            W[i] = min(W[i], TWIST / (twist * finer))


@inner
def lower_at_end(line, state, zones, end, way, finer):
    """W at an end node where no moment is: behind it the line is bent as it would be without bending stiffness.

    That is what it bends by beside the layer, at most at the three nodes behind the end, or on a line through two.
    """
    a, b, c = end + way, end + 2 * way, end + 3 * way
    bend, s = zones.moment, line.s
    rises = (bend[a, KAPPA] - bend[b, KAPPA]) * abs(s[a] - s[end]) / abs(s[b] - s[a])
    kappa = max(bend[a, KAPPA] + max(rises, 0.0), bend[b, KAPPA], bend[c, KAPPA])
    l0, T = bending_length(zones.kinds, state.T, end), lowest_beside(zones.kinds, state.T, end)
    taut = l0 * l0 * T >= 0.99 * zones.kinds.EI[end]
    if taut and kappa > zones.limits[CURVATURE]:
        W = l0 * longest_behind_hinge(zones.limits[CURVATURE] / kappa)
        zones.wanted[end] = min(zones.wanted[end], max(W, SHORTEST_CELL * l0 / finer))


@inner
def lower_at_ends(line, state, zones, finer):
    """W at taut ends of rods without a moment: there the curvature falls to 0 over l0, which shorter cells must show."""
    n = line.h.shape[0]
    if n >= 4:
        if line.spin[0] == 1 and not line.element[0]:
            lower_at_end(line, state, zones, 0, 1, finer)
        if line.spin[n - 1] == 1 and not line.element[n]:
            lower_at_end(line, state, zones, n, -1, finer)


@inner
def lower_between(W, s, a, b, to):
    """W at nodes between arc lengths a and b, m, and at the next node on either side, is `to` at most."""
    n = s.shape[0]
    for i in range(n):
        if s[min(i + 1, n - 1)] >= a and s[max(i - 1, 0)] <= b:
            W[i] = min(W[i], to)


@inner
def edge_at(line, sea, state, i):
    """Where in cell i contact with the bed begins or ends, m, and how fast that place goes along the line, m/s."""
    p, q = depth(sea, state.r, i), depth(sea, state.r, i + 1)
    h, part = line.s[i + 1] - line.s[i], p / (p - q)
    normal, _ = bed_under(sea, get3(state.r, i))
    rises = (1.0 - part) * dot(normal, get3(state.v, i)) + part * dot(normal, get3(state.v, i + 1))
    return line.s[i] + part * h, rises * h / (q - p)


@inner
def is_edge(line, sea, state, i):
    """Whether contact with the bed begins or ends in cell i."""
    return (depth(sea, state.r, i) > 0.0) != (depth(sea, state.r, i + 1) > 0.0)


@inner
def lower_at_edge(line, sea, state, zones, i, dt, finer):
    """W about a contact edge in cell i, and over the way that it will go in dt."""
    l0 = bending_length(zones.kinds, state.T, i)
    at, speed = edge_at(line, sea, state, i)
    way = min(max(dt * speed, -FARTHEST * l0), FARTHEST * l0)
    a, b = at + min(way, 0.0) - EDGE_WIDTH * l0, at + max(way, 0.0) + EDGE_WIDTH * l0
    lower_between(zones.wanted, line.s, a, b, EDGE_CELL * l0 / finer)


@inner
def foresee_edge(line, sea, state, zones, stay, i, time):
    """Raise the ratio of base cells over the way that a contact edge in cell i goes in `time`, s.

    The stiffness of rods takes so long to come, and the edge would be there before them.
    """
    kinds, s, n = zones.kinds, line.s, line.h.shape[0]
    low = max(state.T[i], kinds.floor[i], 1e-300)
    at, speed = edge_at(line, sea, state, i)
    farthest = FARTHEST_KIND * (s[n] - s[0])
    way = min(max(time * speed, -farthest), farthest)
    a, b = at + min(way, 0.0), at + max(way, 0.0)
    for c in range(n):  # base cells by their cells: their lengths may be of before, where line is paid out
        if s[c] <= b and s[c + 1] >= a:
            j, h = kinds.base_of_cell[c], line.h[c] if stay else 0.0
            lack = lack_at_edge(kinds.EI[i], kinds.w[i], low, sea.stiffness, h)
            raise_ratio(zones.ratios, EDGE, j, j, min(over_shares(lack, zones.shares), FORESEEN))


@inner
def foresee_edges(line, sea, state, zones, stay, time):
    """`foresee_edge` of all contact edges; stay: cells do, and rods would have the same."""
    if line.bits & SEABED:
        for i in range(line.h.shape[0]):
            if is_edge(line, sea, state, i):
                foresee_edge(line, sea, state, zones, stay, i, time)


@inner
def lower_at_edges(line, sea, state, zones, dt, finer):
    """W about all contact edges, and over the way that they will go in dt; graded."""
    n, W, s = line.h.shape[0], zones.wanted, line.s
    if line.bits & SEABED:
        for i in range(n):
            if is_edge(line, sea, state, i):
                lower_at_edge(line, sea, state, zones, i, dt, finer)
    for i in range(1, n + 1):
        W[i] = min(W[i], W[i - 1] + STEEPEST * (s[i] - s[i - 1]))
    for i in range(n - 1, -1, -1):
        W[i] = min(W[i], W[i + 1] + STEEPEST * (s[i + 1] - s[i]))


@inner
def is_too_long(zones, s):
    """Whether a cell is longer than wanted, and can be cut."""
    W = zones.wanted
    for i in range(s.shape[0] - 1):
        if s[i + 1] - s[i] > min(W[i], W[i + 1]) and zones.place[i + 1] > zones.place[i] + 1:
            return True
    return False


@inner
def find_wanted(line, sea, state, zones, dt, finer):
    """Wanted lengths at nodes for the next HORIZON steps of dt into zones.wanted, graded; whether the next needs others."""
    find_bends(line, zones.kinds.turn, zones.moment)
    for i in range(line.h.shape[0] + 1):
        part = part_of_share(line, sea, state, zones.kinds, i)
        zones.wanted[i] = wanted_length(zones.kinds, state.T, zones.moment, i, part, zones.limits, finer)
    raise_at_hinges(line, state, zones, finer)
    lower_by_twist(zones, finer)
    lower_by_waves(zones)
    lower_at_ends(line, state, zones, finer)
    lower_at_edges(line, sea, state, zones, dt, finer)
    now = is_too_long(zones, line.s)
    if line.bits & SEABED:
        lower_at_edges(line, sea, state, zones, HORIZON * dt, finer)
    return now


@inner
def least_wanted(zones, p, b):
    """Least W of the nodes from the p-th on up to place b on the finest mesh, and of the next one."""
    least = zones.wanted[p]
    while p + 1 < zones.wanted.shape[0] and zones.place[p] < b:
        p += 1
        least = min(least, zones.wanted[p])
    return least


@inner
def is_steady(zones, p, b):
    """Whether curvature changes little from the p-th node to place b on the finest mesh.

    The curvature of a node is that half-way between the middles of its cells.  Where two of these become one that
    place moves by an eighth of its length, and a moment that is another one at once shakes the line.
    """
    q = p + 1
    while q + 1 < zones.wanted.shape[0] and zones.place[q] < b:
        q += 1
    change = abs(zones.moment[q, KAPPA] - zones.moment[p, KAPPA])
    return change <= STEADY * zones.limits[CURVATURE]


@inner
def halves(zones, p, a, size, unit):
    """Whether the part of `size` finest cells of length `unit` from place a on is halved."""
    W, middle, h = least_wanted(zones, p, a + size), a + size // 2, size * unit
    if h > W * AHEAD:
        zones.idle_steps[middle] = 0
        return True
    if not zones.here[middle]:
        return False
    idle = h <= MERGE * W and is_steady(zones, p, a + size)
    zones.idle_steps[middle] = zones.idle_steps[middle] + 1 if idle else 0
    return zones.idle_steps[middle] < IDLE_STEPS


@inner
def plan_base_cell(zones, p, begin, size, unit):
    """Nodes of a base cell of `size` finest cells, into zones.plan.

    p: its first node now.  Parts in their order along the line: the one that begins at an offset is as long as the largest power of two in it.
    """
    offset, part = 0, size
    while offset < size:
        while zones.place[p + 1] <= begin + offset:
            p += 1
        while part > 1 and halves(zones, p, begin + offset, part, unit):
            part //= 2
            zones.plan[begin + offset + part] = True
        offset += part
        part = offset & -offset


@inner
def plan_cells(line, sea, state, zones, dt, finer):
    """Enter into zones.plan which places of the finest mesh should be nodes.

    Returns whether some are needed at once, or many may go; dt: s, of the step before, which the next one is assumed to
    be as long as; finer: fineness.
    """
    at_once = find_wanted(line, sea, state, zones, dt, finer)
    begin, p = 0, 0
    zones.plan[:] = False
    for j in range(zones.parts.shape[0]):
        size = zones.parts[j]
        while zones.place[p] < begin:
            p += 1
        zones.plan[begin] = True
        plan_base_cell(zones, p, begin, size, zones.H[j] / size)
        begin += size
    zones.plan[begin] = True
    gone = 0
    for i in range(zones.place.shape[0]):
        gone += not zones.plan[zones.place[i]]
    return at_once or gone > SAVED * line.h.shape[0]


# --- lengths ----------------------------------------------------------------------------------------


@inner
def second_divided(r, s, i):
    """r'' at a node, 1/m; at an end that of its neighbour."""
    n = s.shape[0] - 1
    i = min(max(i, 1), n - 1)
    a, b = s[i] - s[i - 1], s[i + 1] - s[i]
    one, two = sub(get3(r, i), get3(r, i - 1)), sub(get3(r, i + 1), get3(r, i))
    return scale(2.0 / (a + b), sub(scale(1.0 / b, two), scale(1.0 / a, one)))


@inner
def smooth_bend(line, state, zones, c, k):
    """r'' at a node (c or c + 1) of cell c; where there is a joint or a load, at the other one."""
    n = line.h.shape[0]
    other = c if k > c else c + 1
    if 0 < k < n and (zones.kinds.node[k] != 0 or line.spin[k] != line.spin[k - 1]) and 0 < other < n:
        k = other
    return second_divided(state.r, line.s, k)


@inner
def arc_less_chord(line, state, zones, c):
    """delta of cell c, to fourth order; none where the curvature changes its sign."""
    if line.h.shape[0] < 3:
        return 0.0
    e, h = get3(state.e, c), line.s[c + 1] - line.s[c]
    d = scale(1.0 / math.sqrt(dot(e, e)), e)
    a, b = smooth_bend(line, state, zones, c, c), smooth_bend(line, state, zones, c, c + 1)
    across = dot(a, b) - dot(a, d) * dot(b, d)
    return h * h * h / 24.0 * max(across, 0.0)


@inner
def relax_arcs(line, state, zones):
    """True lengths come nearer to those that make chords as long as the arcs they stand for."""
    for c in range(line.h.shape[0]):
        aim = line.s[c + 1] - line.s[c] - arc_less_chord(line, state, zones, c)
        zones.true[c] += SMOOTHED * (aim - zones.true[c])
