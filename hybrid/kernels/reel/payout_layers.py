"""Layers that slip of a line that is paid out: how far they have slipped goes with the material (docs/theory.md, 19).

    symbol   meaning                                                                             unit
    p        curvature to which a layer has slipped, on average over a volume (State.layers)     1/m
    volume   the material of an element, from the middle of the cell before it to that of the cell behind it

Volumes of nodes that ride, and the end of that of the last material node, move through the material.  p of one is the
mean over it of what the volumes of before had: constant there plus a limited slope, so that nothing is lost however far
they move.  Where a node enters or leaves they are divided otherwise.  Line comes off the reel straight, with p = 0, and
slips in the half cell at a clamp as that bends it; at a pin, over its half cell, p = 0.  What goes on the reel is
forgotten.  Nodes, cells and volumes count from the far end.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import get3
from hybrid.kernels.laws.bending_slip import (
    EACH,
    FROM,
    KEPT,
    MOMENT,
    MOST,
    STIFF,
    STIFFENING,
    STIFFNESS,
    beside_spring,
    give_of_spring,
    layered,
    pull_at,
    slips,
)
from hybrid.kernels.laws.element import frames_at, strain_of_element
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.reel.paid_length import growing, length_that_came, node, place_of

# Columns of Reel.volumes: where a volume begins, m from the far end; p of all layers, then its slopes, 1/m2.
BEGINS, MEAN = 0, 1
# Volumes before the cell that grows whose p counts: that of the last but two nodes for a slope.
BEFORE = 2


@inner
def begins_at(line, reel, k):
    """Where volume k begins now; that behind the last node is on the reel."""
    n = line.h.shape[0]
    return place_of(line, reel, n) if k > n else 0.5 * (place_of(line, reel, k - 1) + place_of(line, reel, k))


@inner
def bend_of(line, ends, state, i):
    """Bend, rad, of the element at node i of the line, in two components; beside an angular spring of the half cell."""
    Ra, Rb = frames_at(line, ends, state, i)
    k = strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i))
    x, y = k[0] - line.k0[i, 0], k[1] - line.k0[i, 1]
    return beside_spring(line, i, x, y) if give_of_spring(line, i) > 0.0 else (x, y)


@inner
def stick(line, state, i):
    """Let the layers at node i bear what they have in a state, and not slip."""
    law, now, T = line.slip_law, line.slip_now, pull_at(state, i)
    for j in range(0, law.shape[1], EACH):
        if not layered(line, i, j):
            break
        for m in range(KEPT):
            now[i, j + FROM + m] = state.layers[i, j // EACH * KEPT + m]
        now[i, j + MOST] = math.inf if law[i, j + MOMENT] >= 0.0 else law[i, j + MOMENT]
        now[i, j + STIFF] = law[i, j + STIFFNESS] + law[i, j + STIFFENING] * T


# --- how it flows -----------------------------------------------------------------------------------


@inner
def limited(a, b, c, d):
    """The slope between two, (a, b) and (c, d), the same about any axis; none where they go against each other."""
    one, other = a * a + b * b, c * c + d * d
    if not a * c + b * d > 0.0:
        return 0.0, 0.0
    return (a * other + c * one) / (one + other), (b * other + d * one) / (one + other)


@called
def find_volumes(line, state, reel, back):
    """Where the volumes near the fairlead begin of a line that is shorter by `back`, m, and their p, into reel.volumes."""
    n, g, volumes, columns = line.h.shape[0], growing(line, reel), reel.volumes, state.layers.shape[1]
    first = max(g - BEFORE, 1)
    held = line.element[node(line, reel, n)] != 0
    for k in range(first, n + 2):
        volumes[k, BEGINS] = begins_at(line, reel, k)
        if k > g:
            volumes[k, BEGINS] -= back if k > g + 1 else 0.5 * back
        for j in range(columns):
            volumes[k, MEAN + j] = 0.0
            volumes[k, MEAN + columns + j] = 0.0
            if k < n or (k == n and held):
                volumes[k, MEAN + j] = state.layers[node(line, reel, k), j]
    last = n if held else n - 1
    end = volumes[n + 1, BEGINS]
    for k in range(first + 1, last + 1):
        middle = 0.5 * (volumes[k, BEGINS] + volumes[k + 1, BEGINS])
        before = middle - 0.5 * (volumes[k - 1, BEGINS] + volumes[k, BEGINS])
        after = end - middle if k == last else 0.5 * (volumes[k + 1, BEGINS] + volumes[k + 2, BEGINS]) - middle
        for j in range(MEAN, MEAN + columns, KEPT):
            a, b = volumes[k, j] - volumes[k - 1, j], volumes[k, j + 1] - volumes[k - 1, j + 1]
            a, b = a / before, b / before
            c, d = a, b
            if k < last or not held or back > 0.0:  # else what goes on the reel does not count
                other = n + 1 if k == last and held else k + 1
                c, d = (volumes[other, j] - volumes[k, j]) / after, (volumes[other, j + 1] - volumes[k, j + 1]) / after
            volumes[k, columns + j], volumes[k, columns + j + 1] = limited(a, b, c, d)


@called
def mean_between(reel, begin, end, first, j):
    """The mean of column j of p between two places, m, that lie in the volumes from `first` on."""
    volumes, last = reel.volumes, reel.volumes.shape[0] - 1
    columns, found = (volumes.shape[1] - MEAN) // 2, 0.0
    for k in range(first, last + 1):
        a, z = max(volumes[k, BEGINS], begin), end
        middle = volumes[k, BEGINS]
        if k < last:
            z, middle = min(volumes[k + 1, BEGINS], end), 0.5 * (volumes[k, BEGINS] + volumes[k + 1, BEGINS])
        if z > a:
            slope = volumes[k, MEAN + columns + j]
            found += (z - a) * (volumes[k, MEAN + j] + (0.5 * (a + z) - middle) * slope)
    return found / (end - begin)


@kernel
def let_layers_flow(line, before, reel):
    """By how much p of volumes is another at the end of a try because material flows through them, into line.slip_flow.

    before: the state at the start of the try.
    """
    n, g, more, columns = line.h.shape[0], growing(line, reel), length_that_came(reel), line.slip_flow.shape[1]
    if more != 0.0:
        find_volumes(line, before, reel, more)
    for k in range(g, n + 1):
        i = node(line, reel, k)
        for j in range(columns):
            line.slip_flow[i, j] = 0.0
            if more != 0.0 and line.element[i]:
                begin, end = begins_at(line, reel, k), begins_at(line, reel, k + 1)
                p = mean_between(reel, begin, end, max(g - BEFORE, 1), j)
                line.slip_flow[i, j] = p - before.layers[i, j]


@kernel
def stop_flow(line, reel):
    """Between steps nothing flows."""
    for k in range(growing(line, reel), line.h.shape[0] + 1):
        for j in range(line.slip_flow.shape[1]):
            line.slip_flow[node(line, reel, k), j] = 0.0


@kernel
def carry_layers(line, target, state, out, reel, new):
    """p on the volumes of a line (target) that a node has entered or left, near the fairlead; its layers stick.

    state, reel: of the line before.
    """
    g, m, columns = growing(line, reel), target.h.shape[0], state.layers.shape[1]
    first = max(g - BEFORE, 1)
    find_volumes(line, state, reel, 0.0)
    for k in range(first + 1, m + 1):
        i = node(target, new, k)
        if target.element[i]:
            begin, end = begins_at(target, new, k), begins_at(target, new, k + 1)
            for j in range(columns):
                out.layers[i, j] = mean_between(reel, begin, end, first, j)
    for i in range(m + 1):
        stick(target, out, i)


# --- energy -----------------------------------------------------------------------------------------


@called
def remember_bend(line, ends, state, reel):
    """The bend at a clamp that is the fairlead, for the books of the next step."""
    i = node(line, reel, line.h.shape[0])
    if line.element[i] and slips(line, i):
        stick(line, state, i)
        reel.bent[0], reel.bent[1] = bend_of(line, ends, state, i)


@inner
def length_of(reel, k):
    """Length, m, of volume k before the step."""
    return reel.volumes[k + 1, BEGINS] - reel.volumes[k, BEGINS]


@inner
def squared(x, y, h, p, q):
    """Length times the square of what a layer is bent by, 1/m, that has slipped to p, q, and h by x, y."""
    return h * ((x / h - p) ** 2 + (y / h - q) ** 2)


@inner
def bend_before(line, ends, old, reel, k):
    """Bend, rad, of the element at node k before a step, with the strain without stress of then."""
    i = node(line, reel, k)
    if k == line.h.shape[0]:
        return reel.bent[0], reel.bent[1]
    x, y = bend_of(line, ends, old, i)
    return x + line.k0[i, 0] - reel.before[i, 6], y + line.k0[i, 1] - reel.before[i, 7]


@kernel
def layers_that_came(line, ends, old, new, reel):
    """Energy, J, of layers that came in with material through an accepted step.

    As the stiffness of elements (kernels.reel.payout_work): what lengths and p that flow change of it at the bend
    before, and at that behind the step, on average.
    """
    n, g, law, came = line.h.shape[0], growing(line, reel), line.slip_law, 0.0
    if length_that_came(reel) == 0.0:
        return 0.0
    for k in range(g, n + 1):
        i = node(line, reel, k)
        if not (line.element[i] and slips(line, i)):
            continue
        h, was = begins_at(line, reel, k + 1) - begins_at(line, reel, k), length_of(reel, k)
        x, y = bend_before(line, ends, old, reel, k)
        u, v = bend_of(line, ends, new, i)
        dx, dy, T = line.k0[i, 0] - reel.before[i, 6], line.k0[i, 1] - reel.before[i, 7], pull_at(old, i)
        for j in range(0, law.shape[1], EACH):
            if not layered(line, i, j):
                break
            if law[i, j + MOMENT] < 0.0:
                continue
            at, K = j // EACH * KEPT, law[i, j + STIFFNESS] + law[i, j + STIFFENING] * T
            p, q, f, w = old.layers[i, at], old.layers[i, at + 1], line.slip_flow[i, at], line.slip_flow[i, at + 1]
            more = squared(x - dx, y - dy, h, p + f, q + w) - squared(x, y, was, p, q)
            p, q = new.layers[i, at], new.layers[i, at + 1]
            more += squared(u, v, h, p, q) - squared(u + dx, v + dy, was, p - f, q - w)
            came += 0.25 * K * more
    return came
