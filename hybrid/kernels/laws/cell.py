"""The cell: what happens between two nodes, tension and the direction of the chord.

    symbol   meaning                                      shape  unit   frame
    e        chord r_{c+1} - r_c                          3      m      inertial
    l, il    |e| and 1/|e|                                -      m, 1/m
    d        e / l                                        3      -      inertial
    h        unstretched length                           -      m
    ck       compliance 1/EA, 0 when inextensible         -      1/N
    T        tension                                      -      N
    e1, e2   de/dt, d2e/dt2                               3      m/s..  inertial
    d1       dd/dt                                        3      1/s    inertial
    tau      stiffness-proportional damping time          -      s
    J        rotary inertia of the cell, h I              -      kg m2
    cv, ca   dv'/dr', dvd'/dr' of the time scheme         -      1/s, 1/s2

Every function returns the quantity and its exact derivative with respect to e.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hybrid.kernels.algebra.rotations import dot, madd, mat_mat, mscale, msub, outer, project, scale, sub
from hybrid.kernels.machine.compile import inner


class Chord(NamedTuple):
    """Direction, length and 1/length of a chord, in space or in a plane."""

    d: Any
    l: float
    il: float


class Rates(NamedTuple):
    """How velocities and accelerations answer to positions in the time scheme: dv'/dr', 1/s, and dvd'/dr', 1/s2."""

    cv: float
    ca: float


@inner
def chord(e):
    """Direction d, length l and 1/l of a chord."""
    l = math.sqrt(dot(e, e))
    il = 1.0 / l
    return scale(il, e), l, il


@inner
def pull(d, il, T):
    """Axial force T d and dn/de = (T/l)(I - d d^T); dn/dT is d."""
    return scale(T, d), mscale(T * il, project(d))


@inner
def stretch(e, d, l, h, ck, T):
    """The law of length, l - h - h ck T = 0, linearised: row.de - hck dT = gap.  l - h is free of cancellation."""
    hck = h * ck
    return d, hck, hck * T - (dot(e, e) - h * h) / (l + h)


@inner
def turning(d, il, e1, cv):
    """d1 = (I - d d^T) e1/l and its derivative with respect to e (e1 follows e with the factor cv)."""
    along = dot(d, e1)
    d1 = scale(il, sub(e1, scale(along, d)))
    P = project(d)
    D = mscale((cv - along * il) * il, P)
    return d1, msub(D, mscale(il, madd(outer(d, d1), outer(d1, d))))


@inner
def damped_stretch(d, e1, d1, tau, cv):
    """As `stretch` with l + tau dl/dt in place of l: the row, and what the gap loses."""
    a = 1.0 + tau * cv
    return (a * d[0] + tau * d1[0], a * d[1] + tau * d1[1], a * d[2] + tau * d1[2]), tau * dot(d, e1)


@inner
def rotary_force(d, il, e1, e2, d1, D1, J, cv, ca):
    """Force J d2/l that turns the cell's cross-sections (d2: normal part of the second derivative of d), and dn/de."""
    along = dot(d, e1)
    e2n = sub(e2, scale(dot(d, e2), d))
    y = scale(il, sub(e2n, scale(2.0 * along, d1)))
    row = (d1[0] + cv * d[0], d1[1] + cv * d[1], d1[2] + cv * d[2])
    P = project(d)
    D = msub(mscale(ca - dot(d, e2) * il, P), mscale(il, outer(d, e2n)))
    D = msub(D, madd(mscale(2.0, outer(d1, row)), mscale(2.0 * along, D1)))
    D = msub(mscale(il, D), mscale(il, outer(y, d)))
    return scale(J * il, y), mscale(J * il, msub(D, mscale(il, outer(y, d))))


@inner
def moment_force(d, il, Q, DQ):
    """Shear d x Q/l that balances the moment difference Q, and its derivative when Q changes by DQ de.

    d(d x Q/l)/de = -[Q]x/l^2 - 2 (d x Q) d^T/l^2 + [d]x DQ/l
    """
    V = (
        il * (d[1] * Q[2] - d[2] * Q[1]),
        il * (d[2] * Q[0] - d[0] * Q[2]),
        il * (d[0] * Q[1] - d[1] * Q[0]),
    )
    i2 = il * il
    H = (0.0, i2 * Q[2], -i2 * Q[1], -i2 * Q[2], 0.0, i2 * Q[0], i2 * Q[1], -i2 * Q[0], 0.0)
    D = msub(H, mscale(2.0 * il, outer(V, d)))
    dx = (0.0, -il * d[2], il * d[1], il * d[2], 0.0, -il * d[0], -il * d[1], il * d[0], 0.0)
    return V, madd(D, mat_mat(dx, DQ))
