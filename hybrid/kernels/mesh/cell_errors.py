"""What a cell makes wrong, and how long it may be where waves run.

Errors count against the shares that the scene allows: one rule for the kind of a cell and its length.

    symbol   meaning                                                        unit
    e_k      error of leaving bending out of a cell: of its kind            m, N, 1/m, N m
    e_h      error of interpolating along a cell: of its length             the same
    share    error that is allowed, infinite where nothing is asked         the same
    lam, l0  sqrt(EI/T), over which a taut rod bends; min(lam, (EI/w)^(1/3))  m
    kappa    curvature at a node                                            1/m
    angle    of a kink or between a clamp and the line                      rad

Each has four parts: position, tension, curvature and bending moment.  A cell whose largest e_k/share is below 1 may
be a catenary, any other is rod; either is as long as e_h allows (docs/theory.md, 13).

Waves are seen from the velocities of nodes, over time.

    symbol   meaning                                                        unit
    v        velocity of a node                                             m/s
    W        longest cell that the waves of late allow at a node            m
    error    of a velocity between two nodes, that is allowed               m/s
    tau      time in which W changes by a factor of e at most               s
    finer    fineness: all lengths asked for are so many times as short     1

A wave shorter than the cells bends no node of theirs, but moves them: a cell of length h interpolates the velocity
with the error h^2 |v''| / 8.  What a change of cells leaves in the velocities lasts a few steps, and v'' of a wave
passes zero twice a period: so log W follows that length no faster than t/tau, whatever the steps are, and is near its
median.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.laws.closed_forms import fade
from hybrid.kernels.machine.compile import inner

POSITION, TENSION, CURVATURE, MOMENT = range(4)
QUANTITIES = 4


class CellError(NamedTuple):
    """An error of a cell."""

    position: float  # m
    tension: float  # N
    curvature: float  # 1/m
    moment: float  # N m


@inner
def over_shares(error, shares):
    """The largest part of an error over its share."""
    most = error.position / shares[POSITION]
    most = max(most, error.tension / shares[TENSION])
    most = max(most, error.curvature / shares[CURVATURE])
    return max(most, error.moment / shares[MOMENT])


# --- e_k: bending left out ------------------------------------------------------------------------


@inner
def layer_length(EI, w, T):
    """l0; not zero, where there is no bending stiffness either."""
    lam = max(math.sqrt(EI / T), 1e-300)
    if w * lam * lam * lam <= EI:  # the other one is longer; taut lines need no root of it
        return lam
    return min(lam, (EI / w) ** (1.0 / 3.0))


@inner
def lack_of_bend(EI, w, T, kappa, bends):
    """Of a smooth curve; bends: |kappa''|, 1/m^3.

    Bending holds it lam^2 kappa off the catenary, takes EI kappa^2/2 of the tension, and smooths kappa over l0.
    """
    l0 = layer_length(EI, w, T)
    return CellError(EI * kappa / T, 0.5 * EI * kappa * kappa, l0 * l0 * bends, EI * kappa)


@inner
def lack_at_clamp(EI, w, T, angle):
    """Of a clamp: the line leaves it along lam angle exp(-s/lam), with a curvature of angle/lam."""
    l0 = layer_length(EI, w, T)
    return CellError(math.sqrt(EI / T) * angle, 0.5 * T * angle * angle, angle / l0, EI * angle / l0)


@inner
def lack_at_kink(EI, w, T, angle):
    """Of a kink: as of two clamps at half of the angle."""
    return lack_at_clamp(EI, w, T, 0.5 * angle)


@inner
def edge_length(T, k):
    """Over which a taut line without bending stiffness comes to rest on a bed of stiffness k, N/m2: sqrt(T/k)."""
    return math.sqrt(T / k) if k > 0.0 else 0.0


@inner
def lack_at_edge(EI, w, T, k, h):
    """Of the place where contact with a bed of stiffness k, N/m2, begins, against a rod on cells of h, m; 0: short ones.

    On a hard bed the curvature jumps by w/T there, of which a rod has half.  A soft one makes a kink of that jump, of a
    slope J = w/(T sqrt(T/k)), and a rod rounds it: it has J l0/2 less at most; on cells of h by J h/(1/f - f), with the
    f of kernels.laws.closed_forms: those that are longer than l0 show no more of it.
    """
    l0 = layer_length(EI, w, T)
    part = fade(h * h / (l0 * l0))
    rounds = h / (1.0 / part - part) if h > 1e-3 * l0 else 0.5 * l0
    lack = lack_of_bend(EI, w, T, 0.5 * w / T, 0.0)
    curvature = w / T * rounds / (max(2.0 * rounds, h) + edge_length(T, k))
    return CellError(lack.position, lack.tension, curvature, lack.moment)


@inner
def lack_of_torque(T, torque, turn):
    """Of a torque along a line that turns through `turn`, rad, in all: as of forces across it."""
    return CellError(abs(torque) * turn / (2.0 * T), 0.0, 0.0, 0.0)


@inner
def lack_of_moment(EI, T, moment):
    """Of a moment given at an end."""
    kappa = moment / max(EI, 1e-300)
    return CellError(moment / T, 0.5 * moment * kappa, kappa, moment)


# --- e_h: interpolation ---------------------------------------------------------------------------


@inner
def error_of_length(EI, w, kappa, bends, h):
    """Of a cell of length h: what a chord, or a straight line between the values at its ends, is off by."""
    part = 0.125 * h * h
    return CellError(part * kappa, part * w * kappa, part * bends, part * EI * bends)


@inner
def longest_cell(EI, w, kappa, bends, shares):
    """h at which e_h reaches its share, m."""
    over = over_shares(error_of_length(EI, w, kappa, bends, 1.0), shares)
    return 1.0 / math.sqrt(over) if over > 0.0 else math.inf


@inner
def longest_behind_hinge(part):
    """h/l0 at which a straight line from 0 at a hinge to kappa (1 - exp(-h/l0)) is off that curve by `part` of kappa.

    Off it is by 1 - m + m log m with m = (1 - exp(-x))/x, x = h/l0; this is its inverse to 16 %, on the safe side.
    """
    return math.sqrt(8.0 * part) * (1.0 - part) ** -1.2


@inner
def longest_in_wave(error, bends):
    """Its square, m^2: the length at which a straight line between two velocities is off by `error`, m/s.

    bends: |v''|, 1/(m s).
    """
    return 8.0 * error / bends


# --- what a line has ------------------------------------------------------------------------------


@inner
def tension_beside(T, i):
    """The lower tension of the cells beside node i, N."""
    return min(T[max(i - 1, 0)], T[min(i, T.shape[0] - 1)])


@inner
def lowest_beside(kinds, T, i):
    """The lowest tension beside node i, N, its floor at least."""
    return max(tension_beside(T, i), kinds.floor[i], 1e-300)


@inner
def bending_length(kinds, T, i):
    """l0 at node i."""
    return layer_length(kinds.EI[i], kinds.w[i], lowest_beside(kinds, T, i))


@inner
def node_curvature(line, turn, i):
    """kappa at node i; at a joint that of the rod beside it, because a joint has a kink."""
    n = line.h.shape[0]
    if 0 < i < n and line.spin[i] != line.spin[i - 1]:
        i = i + 1 if line.spin[i] else i - 1
    return turn[i] / line.hn[i] if 0 < i < n or line.element[i] else 0.0


@inner
def second_slope(s, i, before, k, after):
    """|kappa''| at an inner node i of arc length s[i], m, from the curvature there and at the nodes beside it."""
    a, b = s[i] - s[i - 1], s[i + 1] - s[i]
    return abs(2.0 * ((after - k) / b - (k - before) / a) / (a + b))


WAVES = 1.0 / 3.0  # of the share of the curvature: part of the spread of velocities that lengths may make them wrong by
TAU = 0.5  # ramp times
QUIET = 0.05  # of the tolerance: a line that moves by less in a ramp time counts as one that moves by that
SHORTEST_WAVE = 1.2  # of l0: cells for waves are no shorter, which bending spreads
AT_REST = 3.0  # base cells: so long are the cells that a line at rest allows, more than any is


@inner
def spread_of_velocity(v):
    """How much the velocities of nodes differ, m/s: it does not matter how fast the line is towed."""
    total = 0.0
    for j in range(3):
        low = high = v[0, j]
        for i in range(1, v.shape[0]):
            low, high = min(low, v[i, j]), max(high, v[i, j])
        total += (high - low) * (high - low)
    return math.sqrt(total)


@inner
def velocity_bends(line, v, i):
    """|v''| at an inner node i, 1/(m s)."""
    a, b = line.s[i] - line.s[i - 1], line.s[i + 1] - line.s[i]
    total = 0.0
    for j in range(3):
        x = (v[i + 1, j] - v[i, j]) / b - (v[i, j] - v[i - 1, j]) / a
        total += x * x
    return 2.0 * math.sqrt(total) / (a + b)


@inner
def longest_at_rest(zones, i):
    """Its square, m^2: W at node i while nothing moves."""
    of = zones.kinds.base_of_cell
    H = AT_REST * max(zones.H[of[max(i - 1, 0)]], zones.H[of[min(i, of.shape[0] - 1)]])
    return H * H


@inner
def fill_between(line, zones, i, j):
    """W^2 of nodes i to j - 1, of which it is not known, on a line between those of nodes i - 1 and j."""
    place, waves, s, n = zones.place, zones.waves, line.s, line.h.shape[0]
    for k in range(i, j):
        if i > 0 and j <= n:
            before, after = waves[place[i - 1]], waves[place[j]]
            waves[place[k]] = before + (s[k] - s[i - 1]) / (s[j] - s[i - 1]) * (after - before)
        elif i > 0:
            waves[place[k]] = waves[place[i - 1]]
        else:
            waves[place[k]] = waves[place[j]] if j <= n else longest_at_rest(zones, k)


@inner
def know_new_nodes(line, zones):
    """W^2 of nodes that have come, as of those beside them; of a line that begins to move, as at rest."""
    i, n = 0, line.h.shape[0]
    while i <= n:
        j = i
        while j <= n and zones.waves[zones.place[j]] == 0.0:
            j += 1
        if j > i:
            fill_between(line, zones, i, j)
        i = j + 1


@inner
def note_waves(line, state, zones, error, time, finer):
    """W^2 of inner nodes into zones.waves, after a step; error: m/s; time: the length of the step over tau.

    A kink of the velocity, at a joint or a point load, lies at a node: it is no wave.
    """
    know_new_nodes(line, zones)
    place, waves, kinds = zones.place, zones.waves, zones.kinds
    most = math.exp(2.0 * time)
    for i in range(1, line.h.shape[0]):
        k, aim = place[i], longest_at_rest(zones, i)
        if kinds.node[i] == 0 and line.spin[i] == line.spin[i - 1]:
            bends = velocity_bends(line, state.v, i)
            if aim * bends > 8.0 * error:
                aim = longest_in_wave(error, bends)
        if aim < waves[k]:
            least = SHORTEST_WAVE * bending_length(kinds, state.T, i) / finer
            waves[k] = min(waves[k], max(aim, waves[k] / most, least * least))
        else:
            waves[k] = min(aim, waves[k] * most)


@inner
def lower_by_waves(zones):
    """Wanted lengths at nodes are those of waves at most, there and at the nodes beside."""
    place, waves, wanted = zones.place, zones.waves, zones.wanted
    n = wanted.shape[0] - 1
    for i in range(n + 1):
        W = math.inf
        for k in range(max(i - 1, 1), min(i + 2, n)):
            if waves[place[k]] > 0.0:
                W = min(W, waves[place[k]])
        if wanted[i] * wanted[i] > W:
            wanted[i] = math.sqrt(W)
