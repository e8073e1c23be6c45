"""Contact of a line with itself: the curve, the foot of a point on a piece of it, the law, and its derivatives.

The curve is the quadratic B-spline whose control points are the nodes: one piece for every inner node p, from the
middle of the cell before it to the middle of the cell after it, with a tangent that has no jumps,

    x(u) = a (1-u)^2/2 r_{p-1} + (1 - a (1-u)^2/2 - b u^2/2) r_p + b u^2/2 r_{p+1},    0 <= u <= 1

with a = b = 1.  The first piece begins at the first node, with a = 2, and the last one ends at the last node, b = 2.
Nodes of several lines stand one after the other; `kind` tells which is the FIRST of a line, or the LAST, or within it,
and so has a piece.

A point of contact is a sample point of one piece p and its foot on another piece q, where their distance d is smallest
along q.  With J the derivative of x - y by the six nodes and n = (x - y)/d, the energy phi(d) of a point has the
gradient phi' J^T n, and with the foot eliminated the second derivative

    H = J^T (phi'' n n^T + (phi'/d)(1 - n n^T)) J - b b^T/c,
    b = phi' (-J^T y'/d + J_v^T n),    c = phi' (|y'|^2 - (x - y).y'')/d
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.algebra.rotations import dot, get3, scale, sub
from hybrid.kernels.machine.compile import inner

# Distances, in diameters, at which the force of contact begins and becomes infinite: strands stay 0.94 to 1.02 apart.
OUTER, INNER = 1.05, 0.85
STICKS = 100.0  # spring of friction per length, of size/D^2: the force of contact has 50 to 200
WITHIN, FIRST, LAST = range(3)  # kinds of nodes
FOOT_STEPS = 30  # of Newton's method with bisection: it needs about 4
FOOT_TOLERANCE = 1e-14


@inner
def end_factors(kind, p):
    """The factors a and b of piece p."""
    return 2.0 if kind[p - 1] == FIRST else 1.0, 2.0 if kind[p + 1] == LAST else 1.0


@inner
def spline_weights(kind, p, u):
    """Weights of the three nodes of piece p at u."""
    a, b = end_factors(kind, p)
    before, after = 0.5 * a * (1.0 - u) * (1.0 - u), 0.5 * b * u * u
    return (before, 1.0 - before - after, after)


@inner
def end_slopes(kind, r, p):
    """Derivatives by u of piece p at its beginning and at its end."""
    a, b = end_factors(kind, p)
    return scale(a, sub(get3(r, p), get3(r, p - 1))), scale(b, sub(get3(r, p + 1), get3(r, p)))


@inner
def spline_point(r, p, w):
    """Sum of the nodes of piece p with weights w."""
    return (
        w[0] * r[p - 1, 0] + w[1] * r[p, 0] + w[2] * r[p + 1, 0],
        w[0] * r[p - 1, 1] + w[1] * r[p, 1] + w[2] * r[p + 1, 1],
        w[0] * r[p - 1, 2] + w[1] * r[p, 2] + w[2] * r[p + 1, 2],
    )


@inner
def slope(before, after, v):
    """Derivative by v of a piece with those at its beginning and at its end."""
    return (
        (1.0 - v) * before[0] + v * after[0],
        (1.0 - v) * before[1] + v * after[1],
        (1.0 - v) * before[2] + v * after[2],
    )


@inner
def foot(kind, r, q, x):
    """Where x is nearest to piece q, 0 <= v <= 1, and whether that is an end of the piece.

    -1, 1: its beginning or its end, without being a smallest distance of the curve; else 0.
    """
    before, after = end_slopes(kind, r, q)
    bend = sub(after, before)
    # half the derivative of the square
    at_start = dot(sub(spline_point(r, q, spline_weights(kind, q, 0.0)), x), before)
    at_end = dot(sub(spline_point(r, q, spline_weights(kind, q, 1.0)), x), after)
    if at_start >= 0.0:
        return 0.0, -1
    if at_end < 0.0:
        return 1.0, 1
    # away = first + v before + v^2 bend/2, along = before + v bend: their product is c0 + c1 v + c2 v^2 + c3 v^3
    first = sub(sub(get3(r, q), scale(0.5, before)), x)
    c0, c1 = dot(first, before), dot(before, before) + dot(first, bend)
    c2, c3 = 1.5 * dot(before, bend), 0.5 * dot(bend, bend)
    low, high = 0.0, 1.0
    v = at_start / (at_start - at_end)
    for _ in range(FOOT_STEPS):
        g = c0 + v * (c1 + v * (c2 + v * c3))
        if g < 0.0:
            low = v
        else:
            high = v
        rate = c1 + v * (2.0 * c2 + v * 3.0 * c3)
        new = v - g / rate if rate > 0.0 else 0.5 * (low + high)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        step = abs(new - v)
        v = new
        if step < FOOT_TOLERANCE:
            break
    return v, 0


@inner
def barrier(d, width, size):
    """Energy per length, J/m, at the distance d (m) of strands of a diameter (m), and its two derivatives; size: N."""
    inverse = 1.0 / ((OUTER - INNER) * width)
    x = (d - INNER * width) * inverse
    if x >= 1.0:
        return 0.0, 0.0, 0.0
    if x <= 0.0:
        return math.inf, -math.inf, math.inf
    y, log = x - 1.0, math.log(x)
    return (
        -size * y * y * log,
        -size * inverse * (2.0 * y * log + y * y / x),
        -size * inverse * inverse * (2.0 * log + 4.0 * y / x - y * y / (x * x)),
    )


# Columns of a point of contact.
P = 0  # piece,
Q = 1  # and that of its foot
WX = 2  # 3, weights of the nodes of x
WY = 5  # 3, and of y
NORMAL = 8  # 3, n
ALONG = 11  # what the law leaves along n
ACROSS = 12  # and across it
SLOPE = 13  # 3, y'/d
RATES = 16  # 3, weights of y'
FORCE = 19  # phi'
FOLLOWS = 20  # 1/c, 0 where the foot stays at an end of the cable
PLACE = 21  # u
DISTANCE = 22  # d, m
SPRING = 23  # of its friction, N/m
FOOT_PLACE = 24  # v of the foot
POINT = 25


class Foot(NamedTuple):
    """Where another strand is nearest to a point: at v of piece q; stays: whether it is kept at an end of the cable."""

    q: int
    v: float
    stays: bool


@inner
def note_point(kind, r, p, u, nearest, width, size, weight, row):
    """Fill the row of a point at u of piece p, and of its `Foot` on another strand; returns its energy, J.

    weight: m, length that the point stands for.
    """
    q, v, stays = nearest
    w, wy = spline_weights(kind, p, u), spline_weights(kind, q, v)
    away = sub(spline_point(r, p, w), spline_point(r, q, wy))
    d = math.sqrt(dot(away, away))
    energy, first, second = barrier(d, width, size)
    first, second = weight * first, weight * second
    before, after = end_slopes(kind, r, q)
    along, bend = slope(before, after, v), sub(after, before)
    row[P], row[Q] = p, q
    a, b = end_factors(kind, q)
    rates = (a * (v - 1.0), a * (1.0 - v) - b * v, b * v)
    for k in range(3):
        row[WX + k], row[WY + k] = w[k], wy[k]
        row[NORMAL + k], row[SLOPE + k], row[RATES + k] = away[k] / d, along[k] / d, rates[k]
    row[ALONG], row[ACROSS], row[FORCE] = second, first / d, first
    curved = dot(along, along) - dot(away, bend)
    row[FOLLOWS] = 0.0
    if not stays and first != 0.0 and curved > 0.0:
        row[FOLLOWS] = d / (first * curved)
    row[PLACE], row[DISTANCE], row[SPRING] = u, d, weight * STICKS * size / (width * width)
    row[FOOT_PLACE] = v
    return weight * energy


@inner
def add_gradient(row, out):
    """Add the gradient of a point's energy to (N+1, 3) out."""
    p, q, f = int(row[P]), int(row[Q]), row[FORCE]
    for j in range(3):
        for k in range(3):
            out[p - 1 + j, k] += f * row[WX + j] * row[NORMAL + k]
            out[q - 1 + j, k] -= f * row[WY + j] * row[NORMAL + k]


@inner
def add_product(row, x, out):
    """Add the second derivative of a point's energy times x (N+1, 3) to out (N+1, 3)."""
    p, q = int(row[P]), int(row[Q])
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    z0, z1, z2, rate = 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        a, b, c = row[WX + j], row[WY + j], row[RATES + j]
        x0, x1, x2 = x[q - 1 + j, 0], x[q - 1 + j, 1], x[q - 1 + j, 2]
        z0 += a * x[p - 1 + j, 0] - b * x0
        z1 += a * x[p - 1 + j, 1] - b * x1
        z2 += a * x[p - 1 + j, 2] - b * x2
        rate -= c * (n[0] * x0 + n[1] * x1 + n[2] * x2)
    normal = n[0] * z0 + n[1] * z1 + n[2] * z2
    more = (row[ALONG] - row[ACROSS]) * normal
    f0, f1, f2 = row[ACROSS] * z0 + more * n[0], row[ACROSS] * z1 + more * n[1], row[ACROSS] * z2 + more * n[2]
    y0, y1, y2 = row[SLOPE], row[SLOPE + 1], row[SLOPE + 2]
    moved = row[FORCE] * row[FORCE] * row[FOLLOWS] * (rate - (y0 * z0 + y1 * z1 + y2 * z2))
    # b = phi' (-J^T y'/d + J_v^T n): of x the weight of y', of the nodes of y also that of n
    f0, f1, f2 = f0 + moved * y0, f1 + moved * y1, f2 + moved * y2
    for j in range(3):
        a, b, c = row[WX + j], row[WY + j], moved * row[RATES + j]
        out[p - 1 + j, 0] += a * f0
        out[p - 1 + j, 1] += a * f1
        out[p - 1 + j, 2] += a * f2
        out[q - 1 + j, 0] += c * n[0] - b * f0
        out[q - 1 + j, 1] += c * n[1] - b * f1
        out[q - 1 + j, 2] += c * n[2] - b * f2
