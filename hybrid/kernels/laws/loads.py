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

from hybrid.kernels.laws import drag_law
from hybrid.kernels.machine.compile import inner

split, half_cell, body = inner(drag_law.split), inner(drag_law.half_cell), inner(drag_law.body)


@inner
def half_cell_drag(u, d, il, cn, ct):
    """Drag force on one half cell, B = df/du and L = df/de."""
    ut, un, square = split(u, d)
    s = np.sqrt(square)
    a = ut if ut.real > 0.0 else -ut  # |ut|
    i = 1.0 / s if s.real > 0.0 else 0.0 * s
    f, p, q = half_cell(ut, un, a, s, d, cn, ct)

    # df/du = -cn (|un| P + un un^T/|un|) - 2 ct |ut| d d^T; products that appear twice are written once
    c1, c2, c3 = -p, -cn * i, p - 2.0 * ct * a
    x, y, z = c2 * un[0], c2 * un[1], c2 * un[2]
    dx, dy, dz = c3 * d[0], c3 * d[1], c3 * d[2]
    xy, xz, yz = x * un[1] + dx * d[1], x * un[2] + dx * d[2], y * un[2] + dy * d[2]
    B = (
        c1 + x * un[0] + dx * d[0], xy, xz,
        xy, c1 + y * un[1] + dy * d[1], yz,
        xz, yz, c1 + z * un[2] + dz * d[2],
    )  # fmt: skip

    # df/de = (1/l) { cn [|un| (d un^T + ut P) + (ut/|un|) un un^T] - ct [2 |ut| d un^T + |ut| ut P] }
    b1, b2, b3 = il * (p * ut - q), il * (p - 2.0 * ct * a), il * cn * ut * i
    x, y, z = b2 * un[0] - b1 * d[0], b2 * un[1] - b1 * d[1], b2 * un[2] - b1 * d[2]  # beside d
    ux, uy, uz = b3 * un[0], b3 * un[1], b3 * un[2]
    L = (
        b1 + d[0] * x + ux * un[0], d[0] * y + ux * un[1], d[0] * z + ux * un[2],
        d[1] * x + uy * un[0], b1 + d[1] * y + uy * un[1], d[1] * z + uy * un[2],
        d[2] * x + uz * un[0], d[2] * y + uz * un[1], b1 + d[2] * z + uz * un[2],
    )  # fmt: skip
    return f, B, L


@inner
def half_cell_added_mass(vd, d, il, an, at, ca):
    """Inertia of the water carried along: f = -an P vd - at d (d.vd), D = ca df/dvd, L = df/de."""
    t = vd[0] * d[0] + vd[1] * d[1] + vd[2] * d[2]
    n = (vd[0] - t * d[0], vd[1] - t * d[1], vd[2] - t * d[2])
    f = (-an * n[0] - at * t * d[0], -an * n[1] - at * t * d[1], -an * n[2] - at * t * d[2])
    c1, c2 = -ca * an, ca * (an - at)
    x, y, z = c2 * d[0], c2 * d[1], c2 * d[2]
    xy, xz, yz = x * d[1], x * d[2], y * d[2]
    D = (c1 + x * d[0], xy, xz, xy, c1 + y * d[1], yz, xz, yz, c1 + z * d[2])
    b = il * (an - at)
    bt = b * t
    x, y, z = b * n[0] - bt * d[0], b * n[1] - bt * d[1], b * n[2] - bt * d[2]
    L = (
        bt + d[0] * x, d[0] * y, d[0] * z,
        d[1] * x, bt + d[1] * y, d[1] * z,
        d[2] * x, d[2] * y, bt + d[2] * z,
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
