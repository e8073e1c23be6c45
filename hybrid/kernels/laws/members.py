"""Morison members of a body: drag and wave force on pieces of cylinders that are fixed to it.

Pieces stand in the row of numbers of their body (kernels.junctions.bodies), behind all else.  A piece has the force

    f = w (-cn |un| un - ct |ut| ut + cm (a - d (d.a)))        at its middle, u = v - water

of its velocity u relative to the water and of the water's acceleration a there; un, ut: parts across and along d.

    symbol   meaning                                                   unit
    cn, ct   rho D Cd h/2, pi rho D Ct h/2                              kg/m
    cm       (1 + Ca) rho pi D^2/4 h; the part of Ca that goes with     kg
             the body's own acceleration is in its mass matrix
    w        wetted part
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hybrid.kernels.algebra.rotations import add, cross, dot, mat_vec, scale, sub
from hybrid.kernels.machine.compile import inner

# Columns of a piece; places and directions in axes of the body, motion of the water.
MIDDLE = 0  # 3, m
ALONG = 3  # 3, direction
CN = 6  # coefficients of drag across,
CT = 7  # and along,
CM = 8  # and of inertia
WET = 9  # wetted part
WATER = 10  # 3, its velocity, m/s
PUSH = 13  # 3, its acceleration, m/s2
PIECE = 16


@inner
def at(row, o):
    return (row[o], row[o + 1], row[o + 2])


class PieceForce(NamedTuple):
    """Force f, N, on a piece, and the parts of its derivative by u: -p (1 - d d^T) - q un un^T - s d d^T."""

    f: Any
    un: Any
    p: float
    q: float
    s: float


@inner
def piece_force(row, o, d, u):
    """`PieceForce` on the piece at o of a row, direction d, relative velocity u (inertial)."""
    w, cn, ct = row[o + WET], row[o + CN], row[o + CT]
    ut = dot(d, u)
    un = sub(u, scale(ut, d))
    size, a = math.sqrt(dot(un, un)), at(row, o + PUSH)
    push = scale(row[o + CM], sub(a, scale(dot(d, a), d)))
    f = sub(scale(w, push), add(scale(w * cn * size, un), scale(w * ct * abs(ut) * ut, d)))
    q = w * cn / size if size > 0.0 else 0.0
    return PieceForce(f, un, w * cn * size, q, 2.0 * w * ct * abs(ut))


@inner
def piece_change(force, c, d, u, a, du, turn):
    """Change of the `PieceForce` of a piece by du and by a turn of its direction, inertial; c: w cm, a: of the water."""
    f, un, p, q, s = force
    dv = sub(du, cross(turn, u))  # as seen from the piece
    t = dot(d, dv)
    n = sub(dv, scale(t, d))
    da = cross(a, turn)
    push = scale(c, sub(da, scale(dot(d, da), d)))
    drag = add(scale(p, n), add(scale(q * dot(un, n), un), scale(s * t, d)))
    return add(cross(turn, f), sub(push, drag))


@inner
def members_force(row, first, count, R, v, spin):
    """Force and moment about the origin of a body of all its pieces, and their power; spin: inertial."""
    F, M, power = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    for k in range(count):
        o = first + PIECE * k
        arm, d = mat_vec(R, at(row, o + MIDDLE)), mat_vec(R, at(row, o + ALONG))
        here = add(v, cross(spin, arm))
        f = piece_force(row, o, d, sub(here, at(row, o + WATER))).f
        F, M, power = add(F, f), add(M, cross(arm, f)), power + dot(f, here)
    return F, M, power


@inner
def members_change(row, first, count, R, v, spin, dv, dspin, turn):
    """Change of force and moment by changes of velocity and spin (inertial) and a turn; the water stays as it is."""
    dF, dM = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(count):
        o = first + PIECE * k
        arm, d = mat_vec(R, at(row, o + MIDDLE)), mat_vec(R, at(row, o + ALONG))
        darm = cross(turn, arm)
        u = sub(add(v, cross(spin, arm)), at(row, o + WATER))
        force = piece_force(row, o, d, u)
        du, c, a = add(dv, add(cross(dspin, arm), cross(spin, darm))), row[o + WET] * row[o + CM], at(row, o + PUSH)
        df = piece_change(force, c, d, u, a, du, turn)
        dF, dM = add(dF, df), add(dM, add(cross(darm, force.f), cross(arm, df)))
    return dF, dM
