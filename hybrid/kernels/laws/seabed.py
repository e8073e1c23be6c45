"""The seabed: where it is under a point, and its contact and friction.

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
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import add, dot, scale
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.state.state import Floats, Sea, no_sea

HEIGHTS = 4  # numbers of a point of the grid: z, zx, zy, zxy


@inner
def interval(knots, x):
    """The interval of rising knots that x lies in, or is nearest to."""
    low, high = 0, knots.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x < knots[middle]:
            high = middle
        else:
            low = middle
    return low


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
    return (
        n[2] * (n[0] * a - zxx), n[2] * (n[0] * b - zxy), 0.0,
        n[2] * (n[1] * a - zxy), n[2] * (n[1] * b - zyy), 0.0,
        n[2] * n[2] * a, n[2] * n[2] * b, 0.0,
    )  # fmt: skip


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
    for i in range(N.shape[0]):
        N[i] = 0.0
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
    na, nb = n * mu_a, n * mu_l
    D = (
        na * axis[0] * ga[0] + nb * side[0] * gb[0], na * axis[0] * ga[1] + nb * side[0] * gb[1], na * axis[0] * ga[2] + nb * side[0] * gb[2],
        na * axis[1] * ga[0] + nb * side[1] * gb[0], na * axis[1] * ga[1] + nb * side[1] * gb[1], na * axis[1] * ga[2] + nb * side[1] * gb[2],
        na * axis[2] * ga[0] + nb * side[2] * gb[0], na * axis[2] * ga[1] + nb * side[2] * gb[1], na * axis[2] * ga[2] + nb * side[2] * gb[2],
    )  # fmt: skip
    return (N * g[0], N * g[1], N * g[2]), g, D, left
