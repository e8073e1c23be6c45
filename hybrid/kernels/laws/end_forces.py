"""Force of a line on what is at its ends: a support, a point that it carries, a body of its own.

The resultant on an end node has in it what acts on the half cell there.  What acts on a body at the node alone (weight,
water, bed, inertia) is known exactly, and so is the force that balances it, whatever the mesh.  At a support on the
seabed the bed carries nearly all of the half cell: between the support and the depth w/k at which a line rests lies a
layer, shorter than most cells,

    EI p'''' - T p'' + k max(p, 0) = w    (catenary: EI = 0, L = sqrt(T/k)),

which lies on one length of the cell and is free on either side of it.  The force from there, with both nodes of the cell
where they are, takes the place of what the chord makes of it: T p' + w h/2 - what the bed bears of the half cell.  It
changes with all that it depends on without jumps, and where nothing lies both are the same.  Exact of a catenary, and of
a rod whose layer is shorter than what lies; of other rods the free parts are those of a catenary.

    symbol   meaning                                             unit
    p0, p1   depth of the end and of the node next to it         m
    V        force on the bed at the edge of what lies            N
    w, k     submerged weight and stiffness of the bed           N/m, N/m2
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.algebra.rotations import add, dot, get3, scale, sub
from hybrid.kernels.laws.element import Rates
from hybrid.kernels.laws.node_forces import body_water, water_at
from hybrid.kernels.laws.seabed import bed_under, borne_length, contact, pressure
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.report import BODIES, CONTACT_FORCE, FORCE_A, NET_A, SEABED, SOIL, SURFACE

HALVINGS = 52  # of the last cell, which find where a rod leaves the bed: to round-off, as derivatives need it
MOST_BRACKETS = 60  # of Ridders' method, for the same of all lines: 5 in the mean, as many where hardly anything lies
SHORTEST = 1e-18  # of the cell, that lies: less is nothing, and more than nothing is needed to divide by
ROUND_OFF = 2.3e-16  # of the cell, to which the length that lies is known
FAR = 40.0  # layers to a cell from which on the two ends of the cell do not know of each other
LEAST_TENSION = 0.125  # of the weight of a cell: with less it would hang deeper than it is long
STIFF = 9.6  # T h2/EI with which a string sags under its weight as a beam of a length h that turns freely at its ends
SMALL_TENSION = 1e-3  # of sqrt(k EI), below which it does not change how a rod lies


@inner
def body_force(line, sea, i, x, state):
    """What acts on the body at node i alone, its inertia included; x: its place."""
    v, vd = get3(state.v, i), get3(state.vd, i)
    F = sub((0.0, 0.0, line.point_lift[i]), scale(line.point_mass[i], vd))
    if line.bits & BODIES:
        f, _, _ = body_water(line, i, water_at(line, sea, i, x[2], v, vd), v, Rates(0.0, 0.0))
        F = add(F, f)
    if line.bits & SEABED and line.footing[i] > 0.0:
        n, p = bed_under(sea, x)
        all_ = dot(get3(sea.bed, i), n)
        if line.bits & SOIL:
            F = add(F, scale(line.footing[i] / borne_length(line, i), get3(sea.bed, i)))
        elif p > 0.0 and all_ > 0.0:
            q, _, _ = pressure(0.0, p, p, -dot(n, v), -dot(n, v), sea.stiffness, sea.damping, sea.onset)
            F = add(F, scale(min(line.footing[i] * q / all_, 1.0), get3(sea.bed, i)))
    return F


class Layer(NamedTuple):
    """What a line beside a support on the bed is like; a catenary has EI = 0."""

    T: float  # tension that a line of this weight has at least within a cell, N
    w: float
    k: float
    L: float  # length whose weight in the layer the support bears, where it lies at the level of the bed, m
    EI: float  # N m2
    P: float  # product of the two falling roots of EI r^4 - T r^2 + k = 0, 1/m2
    S: float  # their sum, 1/m
    held: float  # part of the slope of a clamp that reaches the line: 0 pinned, 1 clamped


@inner
def layer_of(line, i, j, T, w, k, h):
    """The layer at the support of node i, beside node j."""
    hangs = max(T, w * h * LEAST_TENSION)
    EI = 0.5 * (line.kb[j, 0] + line.kb[j, 1]) * line.hn[j] if line.element[j] else 0.0
    if not EI > 0.0:
        return Layer(hangs, w, k, math.sqrt(max(T, 0.0) / k), 0.0, 0.0, 0.0, 0.0)
    P = math.sqrt(k / EI)
    S = math.sqrt(max(T / EI, SMALL_TENSION * P) + 2.0 * P)
    held = 0.0
    if line.element[i]:
        spring = max(2.0 / (line.kb[i, 0] + line.kb[i, 1]) - line.hn[i] / EI, 0.0)
        held = 1.0 / (1.0 + spring * EI * S)
    return Layer(hangs, w, k, S / P - (1.0 - held) / S, EI, P, S, held)


@inner
def edge_force(layer, length, near, far):
    """Force at an end of a length that lies, between the depths `near` of this end and `far` of the other one."""
    x = length / layer.L
    csch = 1.0 / math.sinh(x) if x < FAR else 0.0
    return layer.k * layer.L * ((far - near) * csch + (layer.w / layer.k - near) * math.tanh(0.5 * x))


@inner
def free_length(layer, V, p):
    """Length from a node at a depth p down to the bed, on which the line presses there with V."""
    if not p < 0.0:
        return 0.0
    root = math.sqrt(V * V - 2.0 * layer.w * layer.T * p)
    return -2.0 * layer.T * p / (root + V) if V > 0.0 else (root - V) / layer.w


@inner
def excess_length(layer, lies, p0, p1):
    """Length of a cell of which so much lies, with what hangs from its nodes at depths p0 and p1."""
    a0, a1 = max(p0, 0.0), max(p1, 0.0)
    free = free_length(layer, edge_force(layer, lies, a0, a1), p0)
    return lies + free + free_length(layer, edge_force(layer, lies, a1, a0), p1)


@inner
def lying_length(layer, p0, p1, h):
    """Length of a cell of h (m) that lies, by Ridders' method (IEEE Trans. Circuits Syst. 26, 1979)."""
    if p0 >= 0.0 and p1 >= 0.0:
        return h
    low, high = SHORTEST * h, h
    under, over = excess_length(layer, low, p0, p1) - h, excess_length(layer, high, p0, p1) - h
    if not under < 0.0:
        return low
    for _ in range(MOST_BRACKETS):
        middle = 0.5 * (low + high)
        half = excess_length(layer, middle, p0, p1) - h
        y = middle - (middle - low) * half / math.sqrt(half * half - under * over)
        rest = excess_length(layer, y, p0, p1) - h
        if rest == 0.0 or high - low <= ROUND_OFF * h:
            return y
        if half < 0.0:
            low, under = middle, half
        else:
            high, over = middle, half
        if rest < 0.0 and y > low:
            low, under = y, rest
        elif rest > 0.0 and y < high:
            high, over = y, rest
    return 0.5 * (low + high)


@inner
def force_of_beam(layer, p0, slope, h):
    """Force at a support above the bed, of a rod that comes down to it within h (m) and lies there.

    phi, its slope at xi from where it lies, is (V + w xi)/T + A cosh + B sinh; the slope there, theta, follows from the
    support, linear in A, B and V; the length y that is free from the height of the support.
    """
    EI, P, S = layer.EI, layer.P, layer.S
    T = EI * (S * S - 2.0 * P)
    fade, q, V = math.sqrt(EI / T), layer.w / T, 0.0
    V0, V1 = layer.w * S / P, -EI * P
    A0, A1, B0, B1 = -V0 / T, 1.0 - V1 / T, -fade * (layer.w / (EI * P) + q), fade * S
    low, high, y = 0.0, h, h
    for _ in range(HALVINGS):
        y = 0.5 * (low + high)
        th, sech = math.tanh(y / fade), 1.0 / math.cosh(min(y / fade, FAR))
        clamp, pin = S * layer.held, (1.0 - layer.held) / fade
        rest = clamp * (((V0 / T + q * y) - slope) * sech + A0 + B0 * th)
        rest += pin * (fade * q * sech + A0 * th + B0)
        theta = -rest / (clamp * (V1 / T * sech + A1 + B1 * th) + pin * (A1 * th + B1))
        V, A, B = V0 + V1 * theta, A0 + A1 * theta, B0 + B1 * theta
        if (V / T + 0.5 * q * y) * y + fade * (A * th + B * (1.0 - sech)) / sech < -p0:
            low = y
        else:
            high = y
    return V + layer.w * y


@inner
def force_of_layer(layer, p0, p1, slope, h):
    """Force at a support at a depth p0, with the next node at p1, and the part of its layer.

    The part is from 0, where the line leaves the bed at the support, to 1.  Where less than half of the cell lies, its
    force is what the free part leaves of it: round-off of a length that hardly lies would be all of its own force.
    """
    w, a0, a1 = layer.w, max(p0, 0.0), max(p1, 0.0)
    lies = lying_length(layer, p0, p1, h)
    V = edge_force(layer, lies, a0, a1)
    part, force, free = math.tanh(2.0 * lies / layer.L) ** 2, V + w * free_length(layer, V, p0), h - lies
    if free > lies and p0 < 0.0 and p1 >= 0.0:
        force = 0.5 * w * free - layer.T * p0 / free
    elif free > lies and p0 >= 0.0 and p1 < 0.0:
        force = layer.k * layer.L * (2.0 * w / layer.k - a0) * math.tanh(0.5 * lies / layer.L)
        force += layer.T * p1 / free + 0.5 * w * free
    if layer.EI > 0.0:
        turn = layer.EI * layer.P * layer.held
        force -= part * turn * slope
        if p0 < 0.0:
            V, down = w * layer.L, max(slope, 0.0)
            more = force_of_beam(layer, p0, down, h) - V - w * free_length(layer, V, p0) + turn * down
            force += part / math.tanh(lies / layer.L) * more
    return force, part


@inner
def force_at_support(line, sea, ends, state, k, x, found):
    """Force (N) along the normal of the bed with which a line presses on a support.

    x: its place; found: without the layer at the support, which is right where cells are short against it, and where
    the line does not lie.
    """
    count = line.h.shape[0]
    c, i, inward = k * (count - 1), k * count, 1 - 2 * k
    j = i + inward
    n, p0 = bed_under(sea, x)
    e = scale(1.0 * inward, get3(state.e, c))
    _, p1 = bed_under(sea, add(x, e))
    weight = line.point_lift[i] - line.force[i, 2]
    if line.bits & SURFACE and x[2] < sea.surface:
        weight -= line.buoy[c]
    h, stiff, onset = line.h[c], sea.stiffness, sea.onset
    w = 2.0 * weight * n[2] / h
    if not w > 0.0:
        return found
    layer = layer_of(line, i, j, state.T[c] * h / math.sqrt(dot(e, e)), w, stiff, h)
    if line.element[i] and not layer.EI > 0.0:
        return found
    d0, d1 = p0 - 0.5 * onset, p1 - 0.5 * onset
    if d0 <= 0.0 and d1 <= 0.0 and free_length(layer, 0.0, d0) + free_length(layer, 0.0, d1) >= h:
        return found
    borne = 0.0
    if p0 > 0.0 or p1 > 0.0:
        v0, v1 = -dot(n, get3(state.v, i)), -dot(n, get3(state.v, j))
        borne = contact(p0, p1, v0, v1, h, stiff, sea.damping, onset)[0]
    at, slope = ends.frame[k], 0.0
    if line.element[i]:
        slope = -inward * (n[0] * at[2] + n[1] * at[5] + n[2] * at[8])
    force, part = force_of_layer(layer, d0, d1, slope, h)
    chord = (d1 - d0) / h
    coarse = layer.T * chord + 0.5 * w * h - borne
    if line.element[i]:
        coarse += part * 0.5 * (line.kb[i, 0] + line.kb[i, 1]) * (chord - slope) / h
    if layer.EI > 0.0 and count > 1:
        beyond = -inward * dot(n, get3(state.e, c + inward)) / line.h[c + inward]
        coarse -= part * 0.5 * (line.kb[j, 0] + line.kb[j, 1]) * (beyond - chord) / h
    weigh = 1.0
    if h < FAR * layer.L:
        weigh = 1.0 - (h / layer.L / math.sinh(h / layer.L)) ** 2
    if layer.EI > 0.0 and d1 < 0.0:  # a rod so stiff that it cannot come down to the bed from there lies nowhere
        hangs = max(state.T[c], 0.0) + STIFF * layer.EI / (h * h)
        weigh *= max(1.0 - (2.0 * hangs * d1 / (w * h * h)) ** 2, 0.0)
    return found + weigh * (force - coarse)


@kernel  # called for two nodes of a line
def note_end(line, sea, ends, state, k, x, net, report):
    """Keep the resultant on the node at end k, N, and the force of the line on what is there; x: the place of the node."""
    i = k * line.h.shape[0]
    at = NET_A + 3 * k
    report[at], report[at + 1], report[at + 2] = net
    force = net
    if ends.held[k] == 1:
        if line.bits & SEABED and not line.bits & SOIL:
            n, _ = bed_under(sea, x)
            found = -dot(net, n)
            more = force_at_support(line, sea, ends, state, k, x, found) - found
            force = sub(net, scale(more, n))
            report[CONTACT_FORCE] -= more  # the bed bears what the support does not
    else:
        loads = get3(ends.force, k)
        if line.point_mass[i] > 0.0 or line.bits & BODIES:
            loads = add(loads, body_force(line, sea, i, x, state))
        force = scale(-1.0, loads) if ends.held[k] == 0 else sub(net, loads)
    at = FORCE_A + 3 * k
    report[at], report[at + 1], report[at + 2] = force
