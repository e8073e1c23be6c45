"""Soil that remembers: nonlinear penetration with suction, lateral resistance, friction that falls behind a break-out.

    symbol   meaning                                                                              unit
    z        penetration of the centreline below the bed where it lies first                      m
    D        width of the line, its diameter (Line.bed_width)                                     m
    P        force per length on the line along the normal of the bed, below 0: suction           N/m
    Pu       ultimate resistance Nc su D: su = su0 + rho z, Nc = a (z/D)^b, and below z/D = 0.1 as the root of z
             from there                                                                           N/m
    K        normalised stiffness: each branch begins with dP/dz = K Pu/D                         -
    zeta     z K/D                                                                                -
    w        way that a node has slid since it met the bed                                        m

First penetration: P = Pu zeta/(1 + zeta), which no other branch exceeds.  Behind a turning point z0, P0, with the way
x = Pu(z0) |zeta - zeta0|:

    uplift         P = P0 - Q x/(Q + x),  Q = P0 + f Pu(z)      towards suction -f Pu(z)
    repenetration  P = P0 + R x/(R + x),  R = Pu(z) - P0        towards Pu(z)

(Randolph, Quiggin: Non-linear hysteretic seabed model for catenary pipeline contact, OMAE2009-79259.)  Turning points are
where steps begin, so that Newton's method sees one function of z; a step that is taken back leaves nothing behind.  A line
that has left the bed meets it as at first.  At rest P is that of first penetration.

Sideways p = pu y/ym up to pu, y the elastic travel of friction and ym its most, and plastic beyond:
pu = min(3 su + gamma z + J su z/D, 9 su) min(z, D), API's soft clay on the height that is in the soil.
Friction and pu are multiplied by r + (1 - r) exp(-w/l), r what is left behind the break-out; w is that of the step's start.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, dot, get3, scale
from hybrid.kernels.laws.seabed import bed_under
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.state.report import BREAKOUT, FRICTION, SOIL
from hybrid.kernels.state.state import ROWS, Floats, Line, Sea, blank_state, in_sea

# Places of Sea.soil: su0, Pa; rho, Pa/m; a; b; K; f; whether there is lateral resistance; gamma, N/m3; J; of friction
# r along and across, and l, m; part of the law that
# is there, 1; in searches for an equilibrium the rest is linear, Sea.stiffness.
STRENGTH, GRADIENT, BEARING, POWER, STEEP, SUCTION, LATERAL, HEAVY, WEDGE, LEFT_A, LEFT_L, OVER, PART = range(13)
NUMBERS = PART + 1
# Columns of State.soil: z and P at the end of the last step; z0 and P0 of the branch it is on; which (UP, DOWN, else that of
# first penetration); w.
DEPTH, PRESSES, TURN, TURN_P, BRANCH, SLID = range(6)
UP = -1.0  # branches
FIRST = 0.0
DOWN = 1.0
SHALLOW = 0.1  # z/D below which Nc falls with the root of z
MOST_HALVINGS = 60  # of the depth that bears a pressure
DEEP_FLOW = 9.0  # of su: soil that flows round a line sideways, however deep it lies
WEDGE_BEGINS = 3.0


@inner
def bearing(soil, D, z):
    """Pu, N/m, and its slope at z > 0."""
    x = z / D
    su = soil[STRENGTH] + soil[GRADIENT] * z
    if x >= SHALLOW:
        Nc = soil[BEARING] * x ** soil[POWER]
        slope = soil[POWER] * Nc / z
    else:
        Nc = soil[BEARING] * SHALLOW ** soil[POWER] * math.sqrt(x / SHALLOW)
        slope = 0.5 * Nc / z
    return Nc * su * D, (slope * su + Nc * soil[GRADIENT]) * D


@inner
def first_penetration(soil, D, z):
    """P and dP/dz of first penetration at z > 0."""
    most, slope = bearing(soil, D, z)
    zeta = z * soil[STEEP] / D
    part = zeta / (1.0 + zeta)
    return most * part, slope * part + most * soil[STEEP] / (D * (1.0 + zeta) ** 2)


@inner
def along_branch(soil, D, way, z0, P0, z):
    """P and dP/dz at z > 0 on a branch UP or DOWN from z0 > 0, P0."""
    at_turn, _ = bearing(soil, D, z0)
    most, slope = bearing(soil, D, z)
    steep = at_turn * soil[STEEP] / D
    x = steep * (z - z0) * way
    if way == UP:
        Q, slope = P0 + soil[SUCTION] * most, soil[SUCTION] * slope
    else:
        Q = most - P0
    if not Q > 0.0:
        return P0 + way * Q, way * slope
    # P = P0 + way Q x/(Q + x)
    part = 1.0 / (Q + x)
    return P0 + way * Q * x * part, way * (x * x * slope + Q * Q * way * steep) * part * part


@inner
def branch_at(past, i, z):
    """The branch of node i at z: which, and its turning point."""
    way, last = past[i, BRANCH], past[i, DEPTH]
    down = z >= last
    if way == FIRST or not last > 0.0:
        return (FIRST, 0.0, 0.0) if down or not last > 0.0 else (UP, last, past[i, PRESSES])
    if z == last:  # no way has been gone: it may turn either way from here
        return way, past[i, TURN], past[i, TURN_P]
    if down == (way == DOWN):
        return way, past[i, TURN], past[i, TURN_P]
    return -way, last, past[i, PRESSES]


@inner
def soil_pressure(soil, D, past, i, z):
    """P and dP/dz of node i at z; which branch it is on, and its turning point."""
    if not z > 0.0:
        return 0.0, 0.0, FIRST, 0.0, 0.0
    P, slope = first_penetration(soil, D, z)
    way, z0, P0 = branch_at(past, i, z)
    if way == FIRST:
        return P, slope, FIRST, 0.0, 0.0
    Q, other = along_branch(soil, D, way, z0, P0, z)
    if Q < P:
        return Q, other, way, z0, P0
    return P, slope, FIRST, 0.0, 0.0


@inner
def sideways(soil, D, z):
    """pu, N/m, and its slope at z > 0; 0 of soil without lateral resistance."""
    if not soil[LATERAL] > 0.0:
        return 0.0, 0.0
    su = soil[STRENGTH] + soil[GRADIENT] * z
    stress = WEDGE_BEGINS * su + soil[HEAVY] * z + soil[WEDGE] * su * z / D
    slope = WEDGE_BEGINS * soil[GRADIENT] + soil[HEAVY] + soil[WEDGE] * (su + soil[GRADIENT] * z) / D
    if stress > DEEP_FLOW * su:
        stress, slope = DEEP_FLOW * su, DEEP_FLOW * soil[GRADIENT]
    if z < D:
        return stress * z, slope * z + stress
    return stress * D, slope * D


@inner
def left_of(line, sea, past, i):
    """The parts of friction along and across that are left at node i behind a break-out."""
    if not line.bits & BREAKOUT:
        return 1.0, 1.0
    fresh = math.exp(-past[i, SLID] / sea.soil[OVER])
    a, b = sea.soil[LEFT_A], sea.soil[LEFT_L]
    return a + (1.0 - a) * fresh, b + (1.0 - b) * fresh


@inner
def borne_length(line, i):
    """Length, m, of the line that node i presses on the soil with."""
    h = line.footing[i]
    if i > 0:
        h += 0.5 * line.h[i - 1]
    if i < line.h.shape[0]:
        h += 0.5 * line.h[i]
    return h


@linked_kernel(in_sea(ROWS, 0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
def soil_force(line, sea, past, i, p):
    """Of node i at p (of `bed_under`): force along the normal, N, of friction along and across at most, and their slopes."""
    z, D, h = p - 0.5 * sea.onset, line.bed_width[i], borne_length(line, i)
    P, slope, _, _, _ = soil_pressure(sea.soil, D, past, i, z)
    if sea.soil[PART] < 1.0 and z > 0.0:
        rest, onset = (1.0 - sea.soil[PART]) * sea.stiffness, 0.5 * sea.onset
        even = z / (z + onset)
        P = sea.soil[PART] * P + rest * z * even
        slope = sea.soil[PART] * slope + rest * even * (2.0 - even)
    N, DN = h * P, h * slope
    if not (line.bits & FRICTION and z > 0.0):
        return N, DN, 0.0, 0.0, 0.0, 0.0
    a, b = left_of(line, sea, past, i)
    y, more = sideways(sea.soil, D, z)
    rubs, rise = (N, DN) if N > 0.0 else (0.0, 0.0)
    a, b, c = a * sea.friction[0], b * sea.friction[1], b * h
    return N, DN, a * rubs, b * rubs + c * y, a * rise, b * rise + c * more


@kernel
def depth_under(soil, D, P):
    """Depth z, m, in which first penetration bears P > 0, N/m."""
    low, high = 0.0, D
    for _ in range(MOST_HALVINGS):
        if first_penetration(soil, D, high)[0] >= P:
            break
        high *= 2.0
    for _ in range(MOST_HALVINGS):
        z = 0.5 * (low + high)
        if first_penetration(soil, D, z)[0] < P:
            low = z
        else:
            high = z
    return high


@linked_kernel(in_sea(ROWS, ROWS))
def update_soil(line, sea, r, soil):
    """What the nodes of a line at r (N+1, 3) m remember of the soil behind a step, or in an equilibrium, into soil (N+1, 6)."""
    if line.bits & SOIL:
        for i in range(soil.shape[0]):
            _, p = bed_under(sea, get3(r, i))
            z = p - 0.5 * sea.onset
            P, _, way, z0, P0 = soil_pressure(sea.soil, line.bed_width[i], soil, i, z)
            soil[i, DEPTH], soil[i, PRESSES] = max(z, 0.0), P
            soil[i, TURN], soil[i, TURN_P], soil[i, BRANCH] = z0, P0, way


@inner
def remember_between(soil, out, i, a, b, part):
    """Row i of out (M+1, 6) becomes that of a node at this part of the way from node a to node b, which soil (N+1, 6) has.

    It is on the branch of the nearer one, and comes to its own depth by `lie_in_soil`.
    """
    near = a if part < 0.5 else b
    same = soil[a, BRANCH] == soil[b, BRANCH]
    for k in range(soil.shape[1]):
        out[i, k] = (1.0 - part) * soil[a, k] + part * soil[b, k]
    out[i, BRANCH] = soil[near, BRANCH]
    if not same:
        out[i, TURN], out[i, TURN_P] = soil[near, TURN], soil[near, TURN_P]


@linked_kernel(in_sea(ROWS, ROWS))
def lie_in_soil(line, sea, r, soil):
    """Nodes at r (N+1, 3) m have always been as deep as they are, on the branches that soil (N+1, 6) has them on.

    Those that stay where they were remember the same; nodes that are new, or have no branch at their depth, turn there.
    """
    if line.bits & SOIL:
        for i in range(soil.shape[0]):
            _, p = bed_under(sea, get3(r, i))
            z, D, way, P = p - 0.5 * sea.onset, line.bed_width[i], soil[i, BRANCH], 0.0
            if z > 0.0:
                P, _ = first_penetration(sea.soil, D, z)
            if way != FIRST and z > 0.0:
                if way * (z - soil[i, TURN]) < 0.0:
                    soil[i, TURN], soil[i, TURN_P] = z, min(soil[i, TURN_P], P)
                Q, _ = along_branch(sea.soil, D, way, soil[i, TURN], soil[i, TURN_P], z)
                if Q < P:
                    soil[i, DEPTH], soil[i, PRESSES] = z, Q
                    continue
            soil[i, DEPTH], soil[i, PRESSES] = max(z, 0.0), P
            soil[i, TURN], soil[i, TURN_P], soil[i, BRANCH] = 0.0, 0.0, FIRST


@linked_kernel(in_sea(blank_state(1), blank_state(1), ROWS))
def slide_on(line, sea, old, new, u):
    """The ways that nodes have slid in a step, into new.soil; none of a node that does not touch the bed."""
    for i in range(new.soil.shape[0]):
        n, _ = bed_under(sea, get3(new.r, i))
        if not (new.soil[i, DEPTH] > 0.0 if line.bits & SOIL else dot(get3(sea.bed, i), n) > 0.0):
            new.soil[i, SLID] = 0.0
            continue
        t = add(get3(old.slip, i), get3(u, i))
        t = add(add(t, scale(-dot(get3(u, i), n), n)), scale(-1.0, get3(new.slip, i)))
        new.soil[i, SLID] += math.sqrt(dot(t, t))


@kernel
def soil_at_rest(line, sea, r, past, N, most):
    """Forces (N+1,) N along the normal on nodes at rest at r, and most of friction along and across, most (N+1, 2) N.

    past: (N+1, 6) zeros, of soil that has not been pressed on.
    """
    for i in range(N.shape[0]):
        _, p = bed_under(sea, get3(r, i))
        N[i], _, most[i, 0], most[i, 1], _, _ = soil_force(line, sea, past, i, p)


def rest_in_soil(line: Line, sea: Sea, r: Floats, soil: Floats) -> None:
    """What nodes at rest at r (N+1, 3) m remember, into soil (N+1, 6): those of a line without soil nothing."""
    if soil.size:
        update_soil(line, sea, r, soil)
