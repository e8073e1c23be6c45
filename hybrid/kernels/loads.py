"""Forces of the water on a half cell or on a body, with their exact derivatives.

A node carries half of each cell that meets it.  `half_cell_drag` gives the force of
the water on one half cell with its exact derivatives; it runs on complex numbers
too, which is how its derivatives are proved.

    symbol   meaning                                            shape  unit     frame
    u        velocity of the node relative to the water         3      m/s      inertial
    vd       acceleration of the node relative to the water     3      m/s2     inertial
    d, il    direction and 1/length of the half cell's chord    3, -   -, 1/m   inertial
    cn, ct   rho D Cn h/4, pi rho D Ct h/4                      -      kg/m
    an, at   added mass of the half cell, normal, tangential    -      kg
    f        force on the node                                  3      N        inertial
    B, D, L  df/du, df/dr (through vd), df/de                   9      N s/m, N/m  inertial

The law of drag itself stands in drag_law.py; un and ut are the normal and tangential parts of u.
The tangential coefficient refers to the wetted surface (pi D per length), the normal one to D.
"""

from __future__ import annotations

import numpy as np

from hybrid.kernels import drag_law
from hybrid.kernels.compile import inner

split, half_cell, body = inner(drag_law.split), inner(drag_law.half_cell), inner(drag_law.body)


@inner
def half_cell_drag(u, d, il, cn, ct):
    """Drag force on one half cell, B = df/du and L = df/de."""
    ut, un, square = split(u, d)
    s = np.sqrt(square)
    a = ut if ut.real > 0.0 else -ut  # |ut|
    i = 1.0 / s if s.real > 0.0 else 0.0 * s
    f, p, q = half_cell(ut, un, a, s, d, cn, ct)

    # df/du = -cn (|un| P + un un^T/|un|) - 2 ct |ut| d d^T
    c1, c2, c3 = -p, -cn * i, p - 2.0 * ct * a
    B = (
        c1 + c2 * un[0] * un[0] + c3 * d[0] * d[0], c2 * un[0] * un[1] + c3 * d[0] * d[1], c2 * un[0] * un[2] + c3 * d[0] * d[2],
        c2 * un[1] * un[0] + c3 * d[1] * d[0], c1 + c2 * un[1] * un[1] + c3 * d[1] * d[1], c2 * un[1] * un[2] + c3 * d[1] * d[2],
        c2 * un[2] * un[0] + c3 * d[2] * d[0], c2 * un[2] * un[1] + c3 * d[2] * d[1], c1 + c2 * un[2] * un[2] + c3 * d[2] * d[2],
    )  # fmt: skip

    # df/de = (1/l) { cn [|un| (d un^T + ut P) + (ut/|un|) un un^T] - ct [2 |ut| d un^T + |ut| ut P] }
    b1, b2, b3 = il * (p * ut - q), il * (p - 2.0 * ct * a), il * cn * ut * i
    b4 = -b1
    L = (
        b1 + b4 * d[0] * d[0] + b2 * d[0] * un[0] + b3 * un[0] * un[0],
        b4 * d[0] * d[1] + b2 * d[0] * un[1] + b3 * un[0] * un[1],
        b4 * d[0] * d[2] + b2 * d[0] * un[2] + b3 * un[0] * un[2],
        b4 * d[1] * d[0] + b2 * d[1] * un[0] + b3 * un[1] * un[0],
        b1 + b4 * d[1] * d[1] + b2 * d[1] * un[1] + b3 * un[1] * un[1],
        b4 * d[1] * d[2] + b2 * d[1] * un[2] + b3 * un[1] * un[2],
        b4 * d[2] * d[0] + b2 * d[2] * un[0] + b3 * un[2] * un[0],
        b4 * d[2] * d[1] + b2 * d[2] * un[1] + b3 * un[2] * un[1],
        b1 + b4 * d[2] * d[2] + b2 * d[2] * un[2] + b3 * un[2] * un[2],
    )
    return f, B, L


@inner
def half_cell_added_mass(vd, d, il, an, at, ca):
    """Inertia of the water carried along: f = -an P vd - at d (d.vd), D = ca df/dvd, L = df/de."""
    t = vd[0] * d[0] + vd[1] * d[1] + vd[2] * d[2]
    n = (vd[0] - t * d[0], vd[1] - t * d[1], vd[2] - t * d[2])
    f = (-an * n[0] - at * t * d[0], -an * n[1] - at * t * d[1], -an * n[2] - at * t * d[2])
    c1, c2 = -ca * an, ca * (an - at)
    D = (
        c1 + c2 * d[0] * d[0], c2 * d[0] * d[1], c2 * d[0] * d[2],
        c2 * d[1] * d[0], c1 + c2 * d[1] * d[1], c2 * d[1] * d[2],
        c2 * d[2] * d[0], c2 * d[2] * d[1], c1 + c2 * d[2] * d[2],
    )  # fmt: skip
    b = il * (an - at)
    bt = b * t
    L = (
        bt - bt * d[0] * d[0] + b * d[0] * n[0], -bt * d[0] * d[1] + b * d[0] * n[1], -bt * d[0] * d[2] + b * d[0] * n[2],
        -bt * d[1] * d[0] + b * d[1] * n[0], bt - bt * d[1] * d[1] + b * d[1] * n[1], -bt * d[1] * d[2] + b * d[1] * n[2],
        -bt * d[2] * d[0] + b * d[2] * n[0], -bt * d[2] * d[1] + b * d[2] * n[1], bt - bt * d[2] * d[2] + b * d[2] * n[2],
    )  # fmt: skip
    return f, D, L


@inner
def body_drag(u, c):
    """Drag of a body without direction, f = -c |u| u, and B = df/du."""
    s = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    q = -c / s if s.real > 0.0 else 0.0 * s
    f, p = body(u, s, c)
    return f, (
        p + q * u[0] * u[0], q * u[0] * u[1], q * u[0] * u[2],
        q * u[1] * u[0], p + q * u[1] * u[1], q * u[1] * u[2],
        q * u[2] * u[0], q * u[2] * u[1], p + q * u[2] * u[2],
    )  # fmt: skip
