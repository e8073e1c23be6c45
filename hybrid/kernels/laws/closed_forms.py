"""Closed forms: the hanging line, and the layer of a bend.

The force in a hanging line: the least of its complementary energy (model.catenary_guess), by Newton with line search.

symbol   meaning                                                         unit
F        force at the start of the line, along increasing s              N
t        force in a cell, F less the loads before it (`below`)           N
size     |t|, rounded off at eps                                         N
soft     compliance of a cell, never 0                                   1/N

The layer in which the curvature of a rod fades to nothing at a hinge: what a joint, or a pin, takes of it.

    symbol   meaning                                            unit
    lam      sqrt(EI/T), over which a bend fades in a taut rod   m
    h        length of a cell                                    m
    f        part of the layer that is left a cell further on    1

Far from the hinge the moment M of a rod is EI times the curvature of the line without stiffness, and what is missing
of it, D, obeys EI D'' = T D.  On equal cells that is D_(i+1) - (2 + (h/lam)^2) D_i + D_(i-1) = 0, hence D_i = D_0 f^i
with f + 1/f = 2 + (h/lam)^2: the discrete layer, which is what the nodes of a rod have, whatever h is.

Beside the end of a catenary, whose cells have no such layer, it is that of the line, (EI/T D')' = D, for tension that
changes little within lam:  D = D_0 (T/T_0)^(1/4) exp(-int ds/lam).

At a joint D_0 is the curvature kappa_J that the line would have at the hinge.  The forces at the hinge, whose rod ends without a
moment, are in balance with the turn of its chords, per length k_J:  with B = lam^2/(h_n h) on either side, a that of the
catenary, b that of the rod,

    (1 + B_a + B_b (1 - f)) kappa_J = k_J + B_a kappa_a

is the same balance with the moments of a line that goes on: kappa_a that of the next node of the catenary, on the other
side f kappa_J more than the rod has.  What loads the hinge alone is in k_J; neighbours do not know it.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import dot, get3, sub
from hybrid.kernels.machine.compile import inner, kernel

# Of the length of the line: by so much its end may miss the span.
CLOSE = 1e-9


@inner
def energy_of(below, h, soft, span, eps, F):
    """Complementary energy, J."""
    energy = -dot(F, span)
    for c in range(h.shape[0]):
        t = sub(F, get3(below, c))
        size = math.sqrt(dot(t, t) + eps * eps)
        energy += h[c] * (size + 0.5 * soft[c] * size * size)
    return energy


@inner
def slopes_of(below, h, soft, span, eps, F):
    """Its gradient (m) and its hessian (xx, yy, zz, yz, xz, xy; m/N)."""
    gx, gy, gz = -span[0], -span[1], -span[2]
    a, b, c, d, e, f = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(h.shape[0]):
        x, y, z = sub(F, get3(below, i))
        size = math.sqrt(x * x + y * y + z * z + eps * eps)
        w = h[i] * (1.0 / size + soft[i])
        k = h[i] / (size * size * size)
        gx, gy, gz = gx + w * x, gy + w * y, gz + w * z
        a, b, c = a + w - k * x * x, b + w - k * y * y, c + w - k * z * z
        d, e, f = d - k * y * z, e - k * x * z, f - k * x * y
    return (gx, gy, gz), (a, b, c, d, e, f)


@inner
def inverse_of(H):
    """The inverse of a symmetric matrix, in the same order."""
    a, b, c, d, e, f = H
    A, B, C = b * c - d * d, a * c - e * e, a * b - f * f
    D, E, G = e * f - a * d, d * f - b * e, d * e - c * f
    i = 1.0 / (a * A + f * G + e * E)
    return i * A, i * B, i * C, i * D, i * E, i * G


@inner
def times(H, v):
    a, b, c, d, e, f = H
    return (a * v[0] + f * v[1] + e * v[2], f * v[0] + b * v[1] + d * v[2], e * v[0] + d * v[1] + c * v[2])


@kernel
def find_force(below, h, soft, places, eps, most, inverse):
    """Find F of a line of N cells in at most `most` iterations.

    below: (N, 3) N; h: (N,) m; soft: (N,) 1/N; places: (2, 3) the span (m), and F (N), which it begins from and leaves;
    inverse: (6,) N/m of the hessian, xx, yy, zz, yz, xz, xy (written).
    """
    span, F, length = get3(places, 0), get3(places, 1), 0.0
    for c in range(h.shape[0]):
        length += h[c]
    energy = energy_of(below, h, soft, span, eps, F)
    for _ in range(most):
        g, H = slopes_of(below, h, soft, span, eps, F)
        back = inverse_of(H)
        inverse[0], inverse[1], inverse[2], inverse[3], inverse[4], inverse[5] = back
        if max(abs(g[0]), abs(g[1]), abs(g[2])) < CLOSE * length:
            break
        x, y, z = times(back, g)
        slope, part, tried, there = -(g[0] * x + g[1] * y + g[2] * z), 1.0, energy, F
        while part > 1e-9:
            there = (F[0] - part * x, F[1] - part * y, F[2] - part * z)
            tried = energy_of(below, h, soft, span, eps, there)
            if tried <= energy + 1e-4 * part * slope + 1e-15 * abs(energy):
                break
            part *= 0.5
        F, energy = there, tried
    places[1, 0], places[1, 1], places[1, 2] = F


FADED = 1e-3  # part of a layer that no longer counts
FARTHEST = 200  # nodes over which it is put back at most


@inner
def fade(square):
    """f, of (h/lam)^2; nothing fades without tension."""
    half = 1.0 + 0.5 * max(square, 0.0)
    return 1.0 / (half + math.sqrt(half * half - 1.0))


@inner
def depth_of(T, EI, h):
    """Integral of sqrt(T/EI) over a cell of h, m: by what the layer of a hinge that the cells know nothing of fades."""
    return math.sqrt(T / EI) * h if T > 0.0 else math.inf


@inner
def left_of(depth, T, end):
    """Part of such a layer at a depth, where the tension is T, N, and at the end `end`, N."""
    return (T / end) ** 0.25 * math.exp(-depth)


@inner
def stiffness_share(EI, T, hn, h):
    """B, of a cell of h, m, beside a node that stands for hn, m; nothing without tension."""
    return EI / (T * hn * h) if T > 0.0 else 0.0


@inner
def at_hinge(turn, along, outer, before, after, part):
    """kappa_J, 1/m, negative where it is against the curvature `outer` of the next node of the catenary.

    turn: of the chords at the hinge, in a direction of cosine `along` to that; before, after: B there and on the rod's
    side; part: f of the rod's first cell.
    """
    held, whole = before * outer, 1.0 + before + after * (1.0 - part)
    square = turn * turn + 2.0 * along * turn * held + held * held
    return math.copysign(math.sqrt(max(square, 0.0)) / whole, along * turn + held)
