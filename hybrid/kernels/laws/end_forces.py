"""Force of a line on what is at its ends: a support, a point that it carries, a body of its own.

The resultant on an end node has in it what acts on the half cell there.  What acts on a body at the node alone (weight,
water, bed, inertia) is known exactly, and so is the force that balances it, whatever the mesh.  At a support on the
seabed the bed carries nearly all of the half cell: between the support and the depth w/k at which a line rests lies a
layer of the length L, shorter than most cells,

    T p'' = k p - w,   L = sqrt(T/k)    (with bending  EI p'''' - T p'' + k p = w),

of which the force at the support follows from the depths of both nodes of the cell.

    symbol   meaning                                             unit
    p0, p1   depth of the end and of the node next to it         m
    w, k     submerged weight and stiffness of the bed           N/m, N/m2
    rest     depth w/k at which a line rests                     m
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, dot, get3, scale, sub
from hybrid.kernels.laws.bed import bed_under
from hybrid.kernels.laws.cell import Rates
from hybrid.kernels.laws.node_forces import Z3, Water, body_water
from hybrid.kernels.laws.seabed import pressure
from hybrid.kernels.laws.soil import borne_length
from hybrid.kernels.laws.water import current_at
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.forces import BODIES, FLOW, SEABED, SOIL, SURFACE, WAVES
from hybrid.kernels.state.report import CONTACT_FORCE, FORCE_A, NET_A

# Halvings that find where a line leaves the bed within the last cell.
HALVINGS = 40
# Layers to a cell from which on the two ends of the cell do not know of each other.
FAR = 40.0


@inner
def body_force(line, sea, i, x, state):
    """What acts on the body at node i alone, its inertia included; x: its place."""
    v, vd = get3(state.v, i), get3(state.vd, i)
    F = sub((0.0, 0.0, line.point_lift[i]), scale(line.point_mass[i], vd))
    if line.bits & BODIES:
        U, U1, w, b, af, eta = Z3, Z3, v, vd, Z3, sea.surface
        if line.bits & FLOW:
            U, U1 = current_at(sea.z, sea.current, sea.now[1], x[2])
            w = sub(w, U)
        if line.bits & WAVES:
            af = (sea.flow[i, 3], sea.flow[i, 4], sea.flow[i, 5])
            w, b = sub(w, get3(sea.flow, i)), sub(b, af)
            eta += sea.flow[i, 6]
        f, _, _ = body_water(line, i, Water(x[2], eta, w, U1, b, af), v, Rates(0.0, 0.0))
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


@inner
def ways(x):
    """1/tanh(x) and 1/sinh(x)."""
    if x > FAR:
        return 1.0, 0.0
    return 1.0 / math.tanh(x), 1.0 / math.sinh(x)


@inner
def lift_off(p0, p1, h, L, T, rest, k):
    """How far from the end, which lies at p0 >= 0, a line leaves the bed before the next node, m; 0: it does not lie."""
    low, high, w = 0.0, h, k * rest
    for _ in range(HALVINGS):
        x = 0.5 * (low + high)
        coth, csch = ways(x / L)
        rise = (rest * coth + (p0 - rest) * csch) / L
        if rise * (h - x) + 0.5 * w * (h - x) ** 2 / T > -p1:
            low = x
        else:
            high = x
    return 0.5 * (low + high)


@inner
def touch_down(p0, p1, h, L, T, rest, k):
    """How far from the end, which lies above the bed (p0 < 0), a line comes down to it before the next node, m, and

    how steeply.
    """
    low, high, w, slope = 0.0, h, k * rest, 0.0
    for _ in range(HALVINGS):
        y = 0.5 * (low + high)
        coth, csch = ways((h - y) / L)
        slope = ((p1 - rest) * csch + rest * coth) / L
        if p0 + slope * y + 0.5 * w * y * y / T < 0.0:
            low = y
        else:
            high = y
    return 0.5 * (low + high), slope


@inner
def bending_layer(line, i, j, k, T):
    """The length L (m) of the layer of a rod at a pinned end, for the force there, and at a clamped one; 0: of no rod.

    With r the two roots of  EI r^4 - T r^2 + k = 0  that fall: R = k L D at a depth D above that of rest, pinned, and
    k (L D - slope/product), clamped.
    """
    stiffness = 0.5 * (line.kb[j, 0] + line.kb[j, 1]) * line.hn[j] if line.element[j] else 0.0
    if not stiffness > 0.0:
        return 0.0, 0.0, 0.0
    product, squares = math.sqrt(k / stiffness), T / stiffness
    total = squares + 2.0 * product
    if not total > 0.0:
        return 0.0, 0.0, 0.0
    total = math.sqrt(total)
    return (squares + product) / (product * total), total / product, product


@inner
def force_at_support(line, sea, ends, state, k, x, found):
    """Force (N) along the normal of the bed with which a line presses on a support; x: its place; found: without the

    layer at the support, which is right where cells are short against it, and where the line does not lie.
    """
    count = line.h.shape[0]
    c, i, inward = k * (count - 1), k * count, 1 - 2 * k
    n, p0 = bed_under(sea, x)
    e = scale(1.0 * inward, get3(state.e, c))
    _, p1 = bed_under(sea, add(x, e))
    p0, p1 = p0 - 0.5 * sea.onset, p1 - 0.5 * sea.onset
    h, T, stiff = line.h[c], state.T[c], sea.stiffness
    weight = line.point_lift[i] - line.force[i, 2]
    if line.bits & SURFACE and x[2] < sea.surface:
        weight -= line.buoy[c]
    rest = 2.0 * weight * n[2] / (h * stiff)
    if not (rest > 0.0 and T > 0.0 and (p0 >= 0.0 or p1 > 0.0)):
        return found
    L, clamped, product = bending_layer(line, i, i + inward, stiff, T)
    if not L > 0.0:
        L = math.sqrt(T / stiff)
    if line.element[i]:
        if p0 < 0.0 or p1 <= 0.0 or not product > 0.0:
            return found
        at = ends.frame[k]
        slope = -inward * (n[0] * at[2] + n[1] * at[5] + n[2] * at[8])
        L = clamped
        force = stiff * (L * (rest - p0) - slope / product)
    elif p0 >= 0.0 and p1 >= 0.0:
        coth, csch = ways(h / L)
        force = stiff * L * ((p1 - rest) * csch - (p0 - rest) * coth)
    elif p0 >= 0.0:
        lies = lift_off(p0, p1, h, L, T, rest, stiff)
        if not lies > 1e-6 * h:
            return found
        coth, csch = ways(lies / L)
        force = stiff * L * (-rest * csch - (p0 - rest) * coth)
    else:
        above, slope = touch_down(p0, p1, h, L, T, rest, stiff)
        force = T * slope + stiff * rest * above
    part = 1.0
    if h / L < FAR:
        part = 1.0 - (h / L / math.sinh(h / L)) ** 2
    return found + part * (force - found)


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
