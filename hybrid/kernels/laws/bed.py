"""The seabed under a point: a plane, or a surface through depths on a grid.

A bed of depths is the bicubic Hermite surface through the heights at the grid's points.  The slopes there are limited
(scene.depths): height and slope are continuous, a plane comes out as a plane, and between four points no height is
above or below all of theirs.  Beyond the grid the bed goes on straight.

    symbol   meaning                                                     shape   unit
    z        height of the bed at x, y; zx, zy its slopes, zxy the rate  -       m, -, -, 1/m
             of either along the other
    n        unit normal, upwards: (-zx, -zy, 1)/size                    3       -
    p        how deep a point lies below where contact begins, along n   -       m
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import add, dot, scale
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.state.state import Floats, Sea

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


@called
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


@kernel
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
