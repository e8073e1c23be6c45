"""How the kinematics of waves differ a little beside a place: their slopes, for lines beside that of a run.

    symbol   meaning                                                                      unit
    L, U     A w cosh and A w sinh of k(d + S), by sinh kd, of a component                m/s
    S        depth at which components are taken, stretched after Wheeler (laws.water)    m
    theta    phase of a component                                                         rad

Velocity is (kx/k L cos, ky/k L cos, U sin) of theta, acceleration (w kx/k L sin, w ky/k L sin, -w U cos).  By x, y and S
both are symmetric and without trace: five sums each; S and the elevation follow from those of the surface.
"""

from __future__ import annotations

import math

from hybrid.kernels.laws.water import LAST, calm_below, cos_sin, exp_of_small
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.state import LANES

# Columns of slopes.
VELOCITY = 0  # 5, of velocity, 1/s: xx, xy, yy, xz, yz
ACCELERATION = 5  # 5, of acceleration, 1/s2, the same
DEPTH = 10  # 3, of S by x, y, z
ELEVATION = 13  # 2, of the elevation by x and y
SLOPES = 15
# Rows of the room for LANES nodes: x, y, S, elevation, its slopes, the ten sums; then cosine and sine of each component.
SUMS, PHASES = 6, 16


@inner
def surface_beside(sea, r, first, lanes):
    """The first six rows of the room, and phases."""
    waves = sea.waves
    for l in range(LANES):
        i = min(first + l, r.shape[0] - 1)
        lanes[0, l], lanes[1, l], lanes[2, l] = r[i, 0], r[i, 1], r[i, 2]
        for k in range(3, PHASES):
            lanes[k, l] = 0.0
    for j in range(waves.shape[0]):
        A, kx, ky = waves[j, 0], waves[j, 2], waves[j, 3]
        phase = waves[j, 4] - waves[j, 1] * sea.now[0]
        for l in range(LANES):
            c, s = cos_sin(kx * lanes[0, l] + ky * lanes[1, l] + phase)
            lanes[PHASES + 2 * j, l], lanes[PHASES + 1 + 2 * j, l] = c, s
            lanes[3, l] += A * c
            lanes[4, l] -= A * kx * s
            lanes[5, l] -= A * ky * s


@inner
def stretch_beside(sea, lanes, l):
    """S of lane l, in place of the height, and its slopes by x, y, z."""
    part = sea.now[2]
    eta, slope_x, slope_y = part * lanes[3, l], part * lanes[4, l], part * lanes[5, l]
    height, up = lanes[2, l] - sea.surface, sea.stretched * eta
    follows, by_z = -sea.stretched, 1.0
    if height >= eta:
        height, follows, by_z = eta, 1.0 - sea.stretched, 0.0
    S, x, y = height - up, follows * slope_x, follows * slope_y
    if sea.depth < math.inf:
        q = sea.depth / (sea.depth + up)
        less = S * q / (sea.depth + up) * sea.stretched
        S, x, y, by_z = S * q, q * x - less * slope_x, q * y - less * slope_y, q * by_z
        if sea.depth + S < 0.0:
            S, x, y, by_z = -sea.depth, 0.0, 0.0, 0.0
    lanes[2, l] = S
    return x, y, by_z


@inner
def sum_slopes(sea, lanes):
    """The ten sums of the fully grown waves."""
    waves, highest = sea.waves, -math.inf
    for l in range(LANES):
        highest = max(highest, lanes[2, l])
    for j in range(waves.shape[0]):
        w, kx, ky, k = waves[j, 1], waves[j, 2], waves[j, 3], waves[j, 5]
        if k * highest < LAST:
            continue
        q = math.exp(-2.0 * k * sea.depth) if sea.depth < math.inf else 0.0
        speed, xx, xy, yy = sea.orbits[j] / (1.0 - q), kx * kx / k, kx * ky / k, ky * ky / k
        for l in range(LANES):
            y = k * lanes[2, l]
            fade = exp_of_small(max(y, LAST))
            here = speed if y >= LAST else 0.0
            level, up = here * (fade + q / fade), here * (fade - q / fade)
            c, s = lanes[PHASES + 2 * j, l], lanes[PHASES + 1 + 2 * j, l]
            lanes[6, l] -= xx * level * s
            lanes[7, l] -= xy * level * s
            lanes[8, l] -= yy * level * s
            lanes[9, l] += kx * up * c
            lanes[10, l] += ky * up * c
            lanes[11, l] += w * xx * level * c
            lanes[12, l] += w * xy * level * c
            lanes[13, l] += w * yy * level * c
            lanes[14, l] += w * kx * up * s
            lanes[15, l] += w * ky * up * s


@kernel
def wave_slopes(sea, r, lanes, slopes):
    """Fill slopes (N+1, 15) at the positions r (N+1, 3), of the sea of `kernels.laws.water.wave_kinematics`.

    lanes: room (16 + 2 W, LANES).
    """
    part, rate, calm, n = sea.now[2], sea.now[3], calm_below(sea), r.shape[0]
    for first in range(0, n, LANES):
        deep = True
        for i in range(first, min(first + LANES, n)):
            deep = deep and r[i, 2] < calm
            for k in range(SLOPES):
                slopes[i, k] = 0.0
        if deep:
            continue
        surface_beside(sea, r, first, lanes)
        for l in range(LANES):
            x, y, z = stretch_beside(sea, lanes, l)
            if first + l < n:
                i = first + l
                slopes[i, DEPTH], slopes[i, DEPTH + 1], slopes[i, DEPTH + 2] = x, y, z
                slopes[i, ELEVATION], slopes[i, ELEVATION + 1] = part * lanes[4, l], part * lanes[5, l]
        sum_slopes(sea, lanes)
        for i in range(first, min(first + LANES, n)):
            for k in range(5):
                slow = lanes[SUMS + k, i - first]
                slopes[i, VELOCITY + k] = part * slow
                slopes[i, ACCELERATION + k] = part * lanes[SUMS + 5 + k, i - first] + rate * slow


@inner
def along_slopes(row, at, x, y, z):
    """What five slopes from a column on make of (x, y, z), z along S."""
    xx, xy, yy, xz, yz = row[at], row[at + 1], row[at + 2], row[at + 3], row[at + 4]
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y - (xx + yy) * z


@kernel
def waves_beside(flow, slopes, h, rates, beside):
    """Fill the flow (N+1, 7) at h times rates (N+1, 3) from places where it is `flow`."""
    for i in range(flow.shape[0]):
        row = slopes[i]
        x, y = h * rates[i, 0], h * rates[i, 1]
        S = row[DEPTH] * x + row[DEPTH + 1] * y + row[DEPTH + 2] * h * rates[i, 2]
        u, v, w = along_slopes(row, VELOCITY, x, y, S)
        beside[i, 0], beside[i, 1], beside[i, 2] = flow[i, 0] + u, flow[i, 1] + v, flow[i, 2] + w
        u, v, w = along_slopes(row, ACCELERATION, x, y, S)
        beside[i, 3], beside[i, 4], beside[i, 5] = flow[i, 3] + u, flow[i, 4] + v, flow[i, 5] + w
        beside[i, 6] = flow[i, 6] + row[ELEVATION] * x + row[ELEVATION + 1] * y
