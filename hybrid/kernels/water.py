"""The water: its current at a height, the waves that pass, and how much of a cell they wet.

    symbol   meaning                                              shape  unit      frame
    U, U1    velocity of the current and its derivative dU/dz     3      m/s, 1/s  inertial
    z        height                                               -      m
    eta      elevation of the surface                             -      m
    x        wetness coordinate, (eta - z)/D + 1/2                -      -
    A, w, k  amplitude, frequency, wave number of a component     -      m, 1/s, 1/m

Waves are linear (Airy), each component of an irregular sea by itself.  Above and below still
water the kinematics are stretched after Wheeler: the depth at which a component is taken is
scaled so that the moving surface has what linear theory has at the still one.
"""

from __future__ import annotations

import math

from hybrid.kernels.compile import inner, kernel

# A component whose motion has faded to this part of its surface value is left out at that depth.
FADED = 1e-4
# Wetness coordinates closer than this are one: their difference quotient would lose digits.
SAME_WETNESS = 1e-4


@inner
def current_at(z, current, part, height):
    """U and U1 at a height, from the table (z, current), times `part`."""
    n = z.shape[0]
    if n == 1 or height <= z[0]:
        return (part * current[0, 0], part * current[0, 1], part * current[0, 2]), (0.0, 0.0, 0.0)
    if height >= z[n - 1]:
        m = n - 1
        return (part * current[m, 0], part * current[m, 1], part * current[m, 2]), (0.0, 0.0, 0.0)
    a, b = 0, n - 1
    while b - a > 1:
        m = (a + b) // 2
        if z[m] <= height:
            a = m
        else:
            b = m
    q = part / (z[b] - z[a])
    U1 = (q * (current[b, 0] - current[a, 0]), q * (current[b, 1] - current[a, 1]), q * (current[b, 2] - current[a, 2]))
    t = height - z[a]
    U = (part * current[a, 0] + t * U1[0], part * current[a, 1] + t * U1[1], part * current[a, 2] + t * U1[2])
    return U, U1


@kernel
def wave_kinematics(sea, r, u):
    """Fill sea.flow: velocity and acceleration of the waves at the positions r + u, and the elevation above them.

    A component is A cos(kx x + ky y - w t + phase) at the surface; everything is multiplied by the grown part of the
    sea, sea.now[2], and its rate of growth sea.now[3] counts in the acceleration.
    """
    t, part, rate = sea.now[0], sea.now[2], sea.now[3]
    waves, flow = sea.waves, sea.flow
    for i in range(flow.shape[0]):
        x, y, z = r[i, 0] + u[i, 0], r[i, 1] + u[i, 1], r[i, 2] + u[i, 2] - sea.surface
        eta = 0.0
        for j in range(waves.shape[0]):
            eta += waves[j, 0] * math.cos(waves[j, 2] * x + waves[j, 3] * y - waves[j, 1] * t + waves[j, 4])
        eta *= part
        # Wheeler: the surface keeps what linear theory has at z = 0, the bed what it has there
        s = min(z, eta) - eta
        if sea.depth < math.inf:
            s *= sea.depth / (sea.depth + eta)
            s = max(s, -sea.depth)
        v0 = v1 = v2 = a0 = a1 = a2 = 0.0
        for j in range(waves.shape[0]):
            A, w, kx, ky, phase, k = waves[j, 0], waves[j, 1], waves[j, 2], waves[j, 3], waves[j, 4], waves[j, 5]
            fade = math.exp(k * s)
            if fade < FADED:
                continue
            back = math.exp(-2.0 * k * (sea.depth + s)) if sea.depth < math.inf else 0.0
            full = 1.0 - (math.exp(-2.0 * k * sea.depth) if sea.depth < math.inf else 0.0)
            level, up = A * w * fade * (1.0 + back) / full, A * w * fade * (1.0 - back) / full
            angle = kx * x + ky * y - w * t + phase
            c, sn = math.cos(angle), math.sin(angle)
            v0 += level * kx / k * c
            v1 += level * ky / k * c
            v2 += up * sn
            a0 += level * kx / k * w * sn
            a1 += level * ky / k * w * sn
            a2 -= up * w * c
        flow[i, 0], flow[i, 1], flow[i, 2] = part * v0, part * v1, part * v2
        flow[i, 3], flow[i, 4], flow[i, 5] = part * a0 + rate * v0, part * a1 + rate * v1, part * a2 + rate * v2
        flow[i, 6] = eta


@inner
def wetted(x):
    """Wetted part of a point with wetness coordinate x, its antiderivative and its derivative."""
    if x <= 0.0:
        return 0.0, 0.0, 0.0
    if x >= 1.0:
        return 1.0, x - 0.5, 0.0
    return x * x * (3.0 - 2.0 * x), x * x * x * (1.0 - 0.5 * x), 6.0 * x * (1.0 - x)


@inner
def wetted_stretch(xa, xb):
    """Wetted part of a straight stretch between wetness coordinates xa and xb, and its derivatives by both."""
    ga, Ga, _ = wetted(xa)
    gb, Gb, _ = wetted(xb)
    q = xb - xa
    if abs(q) < SAME_WETNESS:
        g, _, h = wetted(0.5 * (xa + xb))
        return g, 0.5 * h, 0.5 * h
    W = (Gb - Ga) / q
    return W, (W - ga) / q, (gb - W) / q
