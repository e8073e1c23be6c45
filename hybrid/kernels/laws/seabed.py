"""The seabed: where it is under a point, its contact and friction, and soil that remembers.

It is a plane, or a surface through depths on a grid.  A bed of depths is the bicubic Hermite surface through the
heights at the grid's points.  The slopes there are limited (scene.sea): height and slope are continuous, a plane
comes out as a plane, and between four points no height is above or below all of theirs.  Beyond the grid the bed goes
on straight.

    symbol   meaning                                                     shape   unit
    z        height of the bed at x, y; zx, zy its slopes, zxy the rate  -       m, -, -, 1/m
             of either along the other
    n        unit normal, upwards: (-zx, -zy, 1)/size                    3       -
    p        how deep a point lies below where contact begins, along n   -       m

Contact and friction are of one half of a cell.  A cell that touches presses on the bed with the force per length

    q = k P(p) + c P'(p) dp/dt, never below 0,   P = p^2/(2 o) for 0 < p < o,  p - o/2 beyond

of the penetration p of its centreline, counted from half an onset o above the bed: the onset then
rounds the corner of the linear law, which is right at and beyond that depth.  It is integrated along the chord with
the shape functions of the nodes, piece by piece between the points where p is 0 or o or q
becomes 0, so that two Gauss points a piece are exact: the force is a smooth function of the configuration while
touchdown travels through a cell, and without damping it has a potential.

    symbol   meaning                                                shape  unit   frame
    p0, p1   penetration at the node and at the other node          -      m
    v0, v1   their rates                                            -      m/s
    k, c, o  stiffness and damping per length, onset                -      N/m2, N s/m2, m
    N        force on the node                                      -      N      along the normal
    q        elastic travel of friction                             3      m      inertial
    sl       its largest length, beyond which the cable slides      -      m

Soil remembers: nonlinear penetration with suction, lateral resistance, friction that falls behind a break-out.

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

import numpy as np

from hybrid.kernels.algebra.rotations import add, dot, get3, madd, outer, scale, stack
from hybrid.kernels.algebra.sparse_rows import interval
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.state.report import BREAKOUT, FRICTION, SOIL
from hybrid.kernels.state.state import ROWS, Floats, Line, Sea, blank_state, in_sea, no_sea

HEIGHTS = 4  # numbers of a point of the grid: z, zx, zy, zxy


@inner
def hermite(t, h):
    """Weights of the values at both ends of an interval h and of the slopes there, and the derivatives of these."""
    s = 1.0 - t
    return (
        (s * s * (1.0 + 2.0 * t), t * t * (3.0 - 2.0 * t), h * t * s * s, -h * t * t * s),
        (-6.0 * t * s / h, 6.0 * t * s / h, s * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)),
    )


@inner
def corner(heights, c, wx, sx, wy, sy):
    return wx * (wy * heights[c, 0] + sy * heights[c, 2]) + sx * (wy * heights[c, 1] + sy * heights[c, 3])


@inner
def weigh(heights, a, b, k, rows):
    """Sum over the four corners of a cell of the grid; k: row of its first corner, rows: of one value of x."""
    return (
        corner(heights, k, a[0], a[2], b[0], b[2])
        + corner(heights, k + 1, a[0], a[2], b[1], b[3])
        + corner(heights, k + rows, a[1], a[3], b[0], b[2])
        + corner(heights, k + rows + 1, a[1], a[3], b[1], b[3])
    )


@linked_kernel(lambda: (no_sea(1), 0.0, 0.0), (0.0, 0.0, 0.0))
def height_on_grid(sea, x, y):
    """z, zx, zy of a bed of depths."""
    i, j = interval(sea.bed_x, x), interval(sea.bed_y, y)
    h, g = sea.bed_x[i + 1] - sea.bed_x[i], sea.bed_y[j + 1] - sea.bed_y[j]
    t, s = min(max((x - sea.bed_x[i]) / h, 0.0), 1.0), min(max((y - sea.bed_y[j]) / g, 0.0), 1.0)
    over_x, over_y = x - (sea.bed_x[i] + t * h), y - (sea.bed_y[j] + s * g)
    if 0.0 < t < 1.0:
        over_x = 0.0
    if 0.0 < s < 1.0:
        over_y = 0.0
    a, da = hermite(t, h)
    b, db = hermite(s, g)
    rows = sea.bed_y.shape[0]
    k = i * rows + j
    heights = sea.bed_heights
    zx, zy = weigh(heights, da, b, k, rows), weigh(heights, a, db, k, rows)
    twist = 0.0
    if over_x != 0.0 or over_y != 0.0:
        twist = weigh(heights, da, db, k, rows)
    z = weigh(heights, a, b, k, rows) + over_x * zx + over_y * zy + over_x * over_y * twist
    return z, zx + over_y * twist, zy + over_x * twist


@inner
def hermite_bends(t, h):
    """Second derivatives of the weights of `hermite`."""
    return (12.0 * t - 6.0) / (h * h), (6.0 - 12.0 * t) / (h * h), (6.0 * t - 4.0) / h, (6.0 * t - 2.0) / h


@inner
def bends_on_grid(sea, x, y):
    """zxx, zxy, zyy of a bed of depths, 1/m; on a line of the grid those of one side."""
    i, j = interval(sea.bed_x, x), interval(sea.bed_y, y)
    h, g = sea.bed_x[i + 1] - sea.bed_x[i], sea.bed_y[j + 1] - sea.bed_y[j]
    t, s = (x - sea.bed_x[i]) / h, (y - sea.bed_y[j]) / g
    at, to = min(max(t, 0.0), 1.0), min(max(s, 0.0), 1.0)
    a, da = hermite(at, h)
    b, db = hermite(to, g)
    rows = sea.bed_y.shape[0]
    k = i * rows + j
    heights = sea.bed_heights
    zxx = zyy = 0.0
    if t == at:  # straight beyond the grid
        bend = hermite_bends(at, h)
        zxx = weigh(heights, bend, b, k, rows) + (s - to) * g * weigh(heights, bend, db, k, rows)
    if s == to:
        bend = hermite_bends(to, g)
        zyy = weigh(heights, a, bend, k, rows) + (t - at) * h * weigh(heights, da, bend, k, rows)
    return zxx, weigh(heights, da, db, k, rows), zyy


@linked_kernel(lambda: (no_sea(1), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
def normal_turns(sea, x, n):
    """dn_i/dx_j of the bed under a point x on a bed of depths: -n_z (I - n n^T) H, H the second derivatives of z."""
    zxx, zxy, zyy = bends_on_grid(sea, x[0], x[1])
    # n . H
    a, b = n[0] * zxx + n[1] * zxy, n[0] * zxy + n[1] * zyy
    return stack(
        (n[2] * (n[0] * a - zxx), n[2] * (n[0] * b - zxy), 0.0),
        (n[2] * (n[1] * a - zxy), n[2] * (n[1] * b - zyy), 0.0),
        (n[2] * n[2] * a, n[2] * n[2] * b, 0.0),
    )


@inner
def depth_falls(sea, x, n, p):
    """g of dp = -g . dx at a point x of a bed of depths, from n and p there, and dn_i/dx_j."""
    W = normal_turns(sea, x, n)
    c = (p - 0.5 * sea.onset) / n[2]
    return (n[0] - c * W[6], n[1] - c * W[7], n[2]), W


@inner
def bed_under(sea, x):
    """n and p of the bed under a point x."""
    n = (sea.normal[0], sea.normal[1], sea.normal[2])
    if sea.bed_x.shape[0] == 0:
        return n, sea.offset + 0.5 * sea.onset - dot(n, x)
    z, zx, zy = height_on_grid(sea, x[0], x[1])
    part = 1.0 / math.sqrt(1.0 + zx * zx + zy * zy)
    return (-part * zx, -part * zy, part), part * (z - x[2]) + 0.5 * sea.onset


@inner
def bed_beside(sea, n, p, x, way):
    """n and p at x + way, from those at x."""
    if sea.bed_x.shape[0] == 0:
        return n, p - dot(n, way)
    return bed_under(sea, add(x, way))


@inner
def bed_before(sea, n, p, x, e):
    """n and p at x - e, from those at x."""
    if sea.bed_x.shape[0] == 0:
        return n, p + dot(n, e)
    return bed_under(sea, add(x, scale(-1.0, e)))


@kernel
def under_points(sea, r, out):
    """n and p of the bed under points r (n, 3) into `out` (n, 4)."""
    for i in range(r.shape[0]):
        n, p = bed_under(sea, (r[i, 0], r[i, 1], r[i, 2]))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = n[0], n[1], n[2], p


def planes_under(sea: Sea, r: Floats) -> tuple[Floats, Floats]:
    """Normals (n, 3) of the bed under points r (n, 3), and how deep these lie below where contact begins (n,), m."""
    if not sea.bed_x.size:
        return np.broadcast_to(sea.normal, (len(r), 3)), sea.offset + 0.5 * sea.onset - r @ sea.normal
    out = np.zeros((len(r), 4))
    under_points(sea, np.ascontiguousarray(r), out)
    return out[:, :3], out[:, 3]


G1, G2 = 0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0  # Gauss points of a piece


@inner
def pressure(x, p0, p1, v0, v1, k, c, o):
    """Force per length at the part x of the way from the node to the other, and dq/dp, dq/dv."""
    p, v = p0 + x * (p1 - p0), v0 + x * (v1 - v0)
    if p <= 0.0:
        return 0.0, 0.0, 0.0
    if p >= o:
        q = k * (p - 0.5 * o) + c * v
        return (q, k, c) if q > 0.0 else (0.0, 0.0, 0.0)
    q = (0.5 * k * p + c * v) * p / o
    return (q, (k * p + c * v) / o, c * p / o) if q > 0.0 else (0.0, 0.0, 0.0)


@inner
def pieces(p0, p1, o):
    """Where p passes 0 and o between the nodes, as parts of the way, in order."""
    if p1 == p0:
        return 1.0, 1.0
    z, y = -p0 / (p1 - p0), (o - p0) / (p1 - p0)
    if z > y:
        z, y = y, z
    return min(max(z, 0.0), 1.0), min(max(y, 0.0), 1.0)


@inner
def released(a, b, p0, p1, v0, v1, k, c, o):
    """Where between a and b, within one piece, damping would begin (or cease) to pull, else b: q is 0 from or up to there.

    Within a piece q is p, or 1, times a linear function, whose zero this is.
    """
    slope, shift = (0.5, 0.0) if p0 + 0.5 * (a + b) * (p1 - p0) < o else (1.0, 0.5 * o)
    fa = k * (slope * (p0 + a * (p1 - p0)) - shift) + c * (v0 + a * (v1 - v0))
    fb = k * (slope * (p0 + b * (p1 - p0)) - shift) + c * (v0 + b * (v1 - v0))
    return a - fa / (fb - fa) * (b - a) if fa * fb < 0.0 else b


@inner
def cut(p0, p1, v0, v1, k, c, o):
    """The parts of the way between the nodes over which q is a polynomial."""
    xb, xd = pieces(p0, p1, o)
    xa = released(0.0, xb, p0, p1, v0, v1, k, c, o)
    xc = released(xb, xd, p0, p1, v0, v1, k, c, o)
    xe = released(xd, 1.0, p0, p1, v0, v1, k, c, o)
    return ((0.0, xa), (xa, xb), (xb, xc), (xc, xd), (xd, xe), (xe, 1.0))


@kernel
def contact(p0, p1, v0, v1, h, k, c, o):
    """Force N on the node at p0, and its derivatives by p0, p1, v0, v1.  Called where one of p0, p1 is positive."""
    if p0 >= o and p1 >= o:
        q0, q1 = k * (p0 - 0.5 * o) + c * v0, k * (p1 - 0.5 * o) + c * v1
        if q0 > 0.0 and q1 > 0.0:  # all of the half cell presses, and q is linear: most of what lies on the bed
            w = h / 6.0
            return w * (2.0 * q0 + q1), 2.0 * w * k, w * k, 2.0 * w * c, w * c
    N = N0 = N1 = V0 = V1 = 0.0
    for a, b in cut(p0, p1, v0, v1, k, c, o):
        w = 0.5 * h * (b - a)
        if w <= 0.0:
            continue
        for g in (G1, G2):
            x = a + g * (b - a)
            q, qp, qv = pressure(x, p0, p1, v0, v1, k, c, o)
            n, m = w * (1.0 - x), x
            N += n * q
            N0 += n * (1.0 - m) * qp
            N1 += n * m * qp
            V0 += n * (1.0 - m) * qv
            V1 += n * m * qv
    return N, N0, N1, V0, V1


@inner
def depth_of(sea, r, i):
    """How deep node i lies below where contact begins, m."""
    _, p = bed_under(sea, (r[i, 0], r[i, 1], r[i, 2]))
    return p


@kernel
def normal_forces(line, sea, r, N):
    """Force N (N+1,) N of the bed along its normal on the nodes of a line at rest."""
    o = sea.onset
    N[:] = 0.0
    for i in range(N.shape[0]):
        p0 = depth_of(sea, r, i)
        if i < line.h.shape[0]:
            p1 = depth_of(sea, r, i + 1)
            if p0 > 0.0 or p1 > 0.0:
                N[i] += contact(p0, p1, 0.0, 0.0, line.h[i], sea.stiffness, sea.damping, o)[0]
                N[i + 1] += contact(p1, p0, 0.0, 0.0, line.h[i], sea.stiffness, sea.damping, o)[0]
        if line.footing[i] > 0.0:
            N[i] += line.footing[i] * pressure(0.0, p0, p0, 0.0, 0.0, sea.stiffness, sea.damping, o)[0]


@inner
def with_cell(energy, p0, p1, h, k, o):
    """Energy and what a cell of h (m) has stored between depths p0 and p1 (m) of its ends, J."""
    xb, xc = pieces(p0, p1, o)
    for a, b in ((0.0, xb), (xb, xc), (xc, 1.0)):
        w = 0.5 * h * (b - a)
        if w <= 0.0:
            continue
        for g in (G1, G2):
            p = p0 + (a + g * (b - a)) * (p1 - p0)
            if p >= o:
                energy += w * k * (0.5 * p * (p - o) + o * o / 6.0)
            elif p > 0.0:
                energy += w * k * p * p * p / (6.0 * o)
    return energy


@kernel
def stored(line, sea, r):
    """Energy (J) that the bed has stored under the line."""
    energy = 0.0
    k, o = sea.stiffness, sea.onset
    for i in range(line.footing.shape[0]):
        if line.footing[i] > 0.0:
            p = depth_of(sea, r, i)
            if p >= o:
                energy += line.footing[i] * k * (0.5 * p * (p - o) + o * o / 6.0)
            elif p > 0.0:
                energy += line.footing[i] * k * p * p * p / (6.0 * o)
    for i in range(line.h.shape[0]):
        p0, p1 = depth_of(sea, r, i), depth_of(sea, r, i + 1)
        if p0 > 0.0 or p1 > 0.0:
            energy = with_cell(energy, p0, p1, line.h[i], k, o)
    return energy


@inner
def friction(q, N, axis, normal, mu_a, mu_l, sl):
    """Friction on a node pressed by N after the elastic travel q (in the plane of the bed).

    Returns the force f, df/dN, df/dq, and the travel that is left after sliding.  The travel
    grows with the node and stores its force elastically, so a cable at rest stays at rest;
    where it exceeds sl the node slides under mu N, axial and lateral part each with its own mu.
    """
    side = (
        normal[1] * axis[2] - normal[2] * axis[1],
        normal[2] * axis[0] - normal[0] * axis[2],
        normal[0] * axis[1] - normal[1] * axis[0],
    )
    a = q[0] * axis[0] + q[1] * axis[1] + q[2] * axis[2]
    b = q[0] * side[0] + q[1] * side[1] + q[2] * side[2]
    size = math.sqrt(a * a + b * b)
    c = 1.0 / sl if size <= sl else 1.0 / size
    a, b = c * a, c * b
    g = (
        -mu_a * a * axis[0] - mu_l * b * side[0],
        -mu_a * a * axis[1] - mu_l * b * side[1],
        -mu_a * a * axis[2] - mu_l * b * side[2],
    )
    aa, ab, bb = 1.0, 0.0, 1.0
    left = sl * c if size > sl else 1.0
    if size > sl:
        aa, ab, bb = 1.0 - a * a, -a * b, 1.0 - b * b
    # df/dq = -N c (mu_a axis (aa axis + ab side) + mu_l side (ab axis + bb side))
    n = -N * c
    ga = (aa * axis[0] + ab * side[0], aa * axis[1] + ab * side[1], aa * axis[2] + ab * side[2])
    gb = (ab * axis[0] + bb * side[0], ab * axis[1] + bb * side[1], ab * axis[2] + bb * side[2])
    D = madd(outer(scale(n * mu_a, axis), ga), outer(scale(n * mu_l, side), gb))
    return (N * g[0], N * g[1], N * g[2]), g, D, left


# --- soil --------------------------------------------------------------------------------------

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
