"""How long cells may be where waves run: from the velocities of nodes, over time.

    symbol   meaning                                                        unit
    v        velocity of a node                                             m/s
    W        longest cell that the waves of late allow at a node            m
    error    of a velocity between two nodes, that is allowed               m/s
    tau      time in which W changes by a factor of e at most               s
    finer    fineness: all lengths asked for are so many times as short     1

A wave shorter than the cells bends no node of theirs, but moves them: a cell of length h interpolates the velocity with the
error h^2 |v''| / 8.  What a change of cells leaves in the velocities lasts a few steps, and v'' of a wave passes zero
twice a period: so log W follows that length no faster than t/tau, whatever the steps are, and is near its median.
"""

from __future__ import annotations

import math

from hybrid.kernels.machine.compile import inner
from hybrid.kernels.mesh.cell_errors import bending_length, longest_in_wave

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
def follow_waves(line, state, zones, error, time, finer):
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
