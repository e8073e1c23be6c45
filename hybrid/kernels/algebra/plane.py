"""The cable in a plane: cell, element, water and seabed with two components instead of three.

The laws are those of kernels.laws.cell, kernels.laws.element, kernels.laws.loads and kernels.laws.seabed for a configuration that lies in
the plane of p and q; what is left of a rotation there is one angle.  Tests hold the two against each other.
One source for both is slower: with the drag and added mass of space, called with a third component of zero, an iteration
of 1000 catenary cells in a current takes 15 % more, one of rods 9 %.

    symbol   meaning                                              shape  unit     frame
    p, q, n  axes of the plane and its normal, p x q = n          3      -        inertial
    d, l, il direction of a chord, its length, 1/length           2, -   -, m     plane
    m        n x d, the chord turned by a right angle             2      -        plane
    g        derivative of the angle of a chord by e, m/l         2      1/m      plane
    turn, g1 rate of that angle, m.e1/l, and its derivative by e  -, 2   1/s..    about n, plane
    kappa    angle from the chord before a node to that after     -      rad      about n
    k        stiffness of the element against kappa               -      N m      about n
    u, b     velocity and acceleration relative to the water      2      m/s..    plane
"""

from __future__ import annotations

import math

from hybrid.kernels.machine.compile import inner


@inner
def dot2(a, b):
    return a[0] * b[0] + a[1] * b[1]


@inner
def outer2(x, a, b):
    """x a b^T, a matrix in row order."""
    return (x * a[0] * b[0], x * a[0] * b[1], x * a[1] * b[0], x * a[1] * b[1])


@inner
def madd2(A, B):
    return (A[0] + B[0], A[1] + B[1], A[2] + B[2], A[3] + B[3])


@inner
def msub2(A, B):
    return (A[0] - B[0], A[1] - B[1], A[2] - B[2], A[3] - B[3])


@inner
def mscale2(x, A):
    return (x * A[0], x * A[1], x * A[2], x * A[3])


@inner
def row_in_plane(plane, A, i):
    """The two components of row i of A that lie in the plane."""
    x, y, z = A[i, 0], A[i, 1], A[i, 2]
    return (
        plane[0, 0] * x + plane[0, 1] * y + plane[0, 2] * z,
        plane[1, 0] * x + plane[1, 1] * y + plane[1, 2] * z,
    )


@inner
def vector_in_plane(plane, a):
    """The two components of a vector of space that lie in the plane."""
    return (
        plane[0, 0] * a[0] + plane[0, 1] * a[1] + plane[0, 2] * a[2],
        plane[1, 0] * a[0] + plane[1, 1] * a[1] + plane[1, 2] * a[2],
    )


@inner
def row_along_normal(plane, A, i):
    """The component of row i of A along the normal."""
    return plane[2, 0] * A[i, 0] + plane[2, 1] * A[i, 1] + plane[2, 2] * A[i, 2]


@inner
def to_space(plane, a):
    """The vector of space that has the components a in the plane and none across it."""
    return (
        a[0] * plane[0, 0] + a[1] * plane[1, 0],
        a[0] * plane[0, 1] + a[1] * plane[1, 1],
        a[0] * plane[0, 2] + a[1] * plane[1, 2],
    )


@inner
def chord2(e):
    """d, l and 1/l of a chord."""
    l = math.sqrt(e[0] * e[0] + e[1] * e[1])
    il = 1.0 / l
    return (il * e[0], il * e[1]), l, il


@inner
def end_chord(plane, frame, k):
    """The direction that the frame of end k prescribes, in the plane."""
    x, y, z = frame[k, 2], frame[k, 5], frame[k, 8]
    return (
        plane[0, 0] * x + plane[0, 1] * y + plane[0, 2] * z,
        plane[1, 0] * x + plane[1, 1] * y + plane[1, 2] * z,
    )


@inner
def carried(plane, a, d, dn):
    """Director a (normal to the chord d of space) when the chord turns within the plane to dn, in the plane."""
    x = plane[2, 0] * a[0] + plane[2, 1] * a[1] + plane[2, 2] * a[2]
    m = to_space(plane, (-d[1], d[0]))
    y = a[0] * m[0] + a[1] * m[1] + a[2] * m[2]
    m = to_space(plane, (-dn[1], dn[0]))
    return (x * plane[2, 0] + y * m[0], x * plane[2, 1] + y * m[1], x * plane[2, 2] + y * m[2])


@inner
def angle_between(a, b):
    """Angle about n from direction a to direction b, between -pi and pi."""
    s, c = a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]
    x = s * s
    if c > 0.0 and x < 0.04:  # asin as a series in s^2, exact to round-off there
        return s * (1.0 + x * (1 / 6 + x * (3 / 40 + x * (15 / 336 + x * (105 / 3456 + x * (945 / 42240 + x * (
            10395 / 599040 + x * (135135 / 9676800 + x * (2027025 / 175472640 + x * 34459425 / 3530096640)))))))))  # fmt: skip
    return math.atan2(s, c)


@inner
def turning2(d, il, e1, cv):
    """Rate of the angle of a chord, and its derivative with respect to e (e1 follows e with the factor cv)."""
    m = (-d[1], d[0])
    along, turn = dot2(d, e1), il * dot2(m, e1)
    a, b = il * (cv - along * il), -il * turn
    return turn, (a * m[0] + b * d[0], a * m[1] + b * d[1])


@inner
def stiffness_about_normal(plane, a1, c, d, kb, k0, i):
    """Stiffness and stress-free angle of element i about n, for sections whose axes lie as in cell c with chord d.

    Sections that bend differently in two directions have one of them along n, or the scene is not planar.
    """
    m = to_space(plane, (-d[1], d[0]))
    y = a1[c, 0] * m[0] + a1[c, 1] * m[1] + a1[c, 2] * m[2]  # a1 = x n + y m, a2 = d x a1 = y n - x m
    x = row_along_normal(plane, a1, c)
    return kb[i, 0] * x * x + kb[i, 1] * y * y, k0[i, 0] * x + k0[i, 1] * y


@inner
def drag2(u, d, il, cn, ct):
    """Drag on a half cell, its derivatives by u and by e; f = -cn |v| v m - ct |w| w d, u = w d + v m."""
    m = (-d[1], d[0])
    w, v = dot2(u, d), dot2(u, m)
    a, b = abs(w), abs(v)
    f = (-cn * b * v * m[0] - ct * a * w * d[0], -cn * b * v * m[1] - ct * a * w * d[1])
    B = madd2(outer2(-2.0 * cn * b, m, m), outer2(-2.0 * ct * a, d, d))
    # by e: dd = m (m.de)/l, dm = -d (m.de)/l, dw = v (m.de)/l, dv = -w (m.de)/l
    x, y = 2.0 * cn * b * w - ct * a * w, cn * b * v - 2.0 * ct * a * v
    return f, B, outer2(il, (x * m[0] + y * d[0], x * m[1] + y * d[1]), m)


@inner
def added_mass2(b, d, il, an, at, ca):
    """Inertia of the water carried along: f = -an (b.m) m - at (b.d) d, D = ca df/db, and df/de."""
    m = (-d[1], d[0])
    t, s = dot2(b, d), dot2(b, m)
    f = (-an * s * m[0] - at * t * d[0], -an * s * m[1] - at * t * d[1])
    D = madd2(outer2(-ca * an, m, m), outer2(-ca * at, d, d))
    x, y = (an - at) * t, (an - at) * s
    return f, D, outer2(il, (x * m[0] + y * d[0], x * m[1] + y * d[1]), m)


@inner
def body_drag2(u, c):
    """Drag of a body without direction, f = -c |u| u, and df/du."""
    s = math.sqrt(dot2(u, u))
    p, q = -c * s, -c / s if s > 0.0 else 0.0
    return (p * u[0], p * u[1]), (p + q * u[0] * u[0], q * u[0] * u[1], q * u[1] * u[0], p + q * u[1] * u[1])


@inner
def friction2(travel, N, axis, mu, sl):
    """Friction along the bed after an elastic travel: force, df/dN, df/dq, and the part of the travel that is left."""
    a = dot2(travel, axis)
    size = abs(a)
    c, left, slope = 1.0 / sl, 1.0, 1.0
    if size > sl:
        c, left, slope = 1.0 / size, sl / size, 0.0
    g = -mu * c * a
    return (N * g * axis[0], N * g * axis[1]), (g * axis[0], g * axis[1]), outer2(-N * mu * c * slope, axis, axis), left


@inner
def rotary2(d, il, e1, e2, turn, J, cv, ca):
    """Force that turns the cross-sections, J d2/l across the chord, and its derivative with respect to e.

    d2.m is the acceleration of the angle, (m.e2 - 2 (d.e1) turn)/l; its part along d is the cell's own affair.
    """
    m = (-d[1], d[0])
    along, s = dot2(d, e1), dot2(d, e2)
    y = il * (dot2(m, e2) - 2.0 * along * turn)
    # d(turn) = (cv - along/l) (m.de)/l - turn (d.de)/l;  d(along) = cv (d.de) + turn (m.de);  d(m.e2) = ca m.de - s m.de/l
    by_m = il * (ca - s * il - 2.0 * turn * turn - 2.0 * along * (cv - along * il) * il)
    by_d = il * (-2.0 * cv * turn + 2.0 * along * turn * il - y)
    x = J * il
    f = (x * y * m[0], x * y * m[1])
    D = outer2(x, m, ((by_m * m[0] + (by_d - y * il) * d[0]), (by_m * m[1] + (by_d - y * il) * d[1])))
    return f, msub2(D, outer2(x * y * il, d, m))
