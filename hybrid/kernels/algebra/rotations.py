"""Vectors, matrices and rotations as tuples, for use inside kernels.

A vector is a 3-tuple, a matrix a 9-tuple in row order.  Tuples live in registers
once compiled, which arrays do not, and they read like the formulas of docs/theory.md.

    symbol   meaning                                             shape
    R        frame of a cell, columns (a1, a2, d)                9
    k        log strain: rotation vector with exp[k]x = Ra^T Rb   3
    P        inverse left Jacobian of exp at k                   9
    g        (1 - (q/2) cot(q/2)) / q^2 with q = |k|             -
    g1       g'(q) / q                                           -
"""

from __future__ import annotations

import math

from hybrid.kernels.machine.compile import inner


@inner
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inner
def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inner
def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inner
def scale(x, a):
    return (x * a[0], x * a[1], x * a[2])


@inner
def mat_vec(A, v):
    return (
        A[0] * v[0] + A[1] * v[1] + A[2] * v[2],
        A[3] * v[0] + A[4] * v[1] + A[5] * v[2],
        A[6] * v[0] + A[7] * v[1] + A[8] * v[2],
    )


@inner
def vec_mat(v, A):
    """A^T v."""
    return (
        A[0] * v[0] + A[3] * v[1] + A[6] * v[2],
        A[1] * v[0] + A[4] * v[1] + A[7] * v[2],
        A[2] * v[0] + A[5] * v[1] + A[8] * v[2],
    )


@inner
def mat_mat(A, B):
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@inner
def mat_matT(A, B):
    """A B^T."""
    return (
        A[0] * B[0] + A[1] * B[1] + A[2] * B[2],
        A[0] * B[3] + A[1] * B[4] + A[2] * B[5],
        A[0] * B[6] + A[1] * B[7] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[1] + A[5] * B[2],
        A[3] * B[3] + A[4] * B[4] + A[5] * B[5],
        A[3] * B[6] + A[4] * B[7] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[1] + A[8] * B[2],
        A[6] * B[3] + A[7] * B[4] + A[8] * B[5],
        A[6] * B[6] + A[7] * B[7] + A[8] * B[8],
    )


@inner
def stack(x, y, z):
    """The matrix with three rows."""
    return (x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2])


@inner
def madd(A, B):
    return stack(
        (A[0] + B[0], A[1] + B[1], A[2] + B[2]),
        (A[3] + B[3], A[4] + B[4], A[5] + B[5]),
        (A[6] + B[6], A[7] + B[7], A[8] + B[8]),
    )


@inner
def msub(A, B):
    return stack(
        (A[0] - B[0], A[1] - B[1], A[2] - B[2]),
        (A[3] - B[3], A[4] - B[4], A[5] - B[5]),
        (A[6] - B[6], A[7] - B[7], A[8] - B[8]),
    )


@inner
def mscale(x, A):
    return (x * A[0], x * A[1], x * A[2], x * A[3], x * A[4], x * A[5], x * A[6], x * A[7], x * A[8])


@inner
def outer(a, b):
    return stack(scale(a[0], b), scale(a[1], b), scale(a[2], b))


@inner
def hat(a):
    """[a]x."""
    return (0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0)


@inner
def mat_hat(A, d):
    """A [d]x: each row crossed with d."""
    return stack(cross((A[0], A[1], A[2]), d), cross((A[3], A[4], A[5]), d), cross((A[6], A[7], A[8]), d))


@inner
def project(d):
    """I - d d^T."""
    xy, xz, yz = -d[0] * d[1], -d[0] * d[2], -d[1] * d[2]
    return (1.0 - d[0] * d[0], xy, xz, xy, 1.0 - d[1] * d[1], yz, xz, yz, 1.0 - d[2] * d[2])


@inner
def frame(a1, d):
    """Frame with columns (a1, d x a1, d)."""
    a2 = cross(d, a1)
    return (a1[0], a2[0], d[0], a1[1], a2[1], d[1], a1[2], a2[2], d[2])


@inner
def transport(a1, d, d_new):
    """Carry a1 (normal to d) to the normal plane of d_new by the smallest rotation; exact unit length is restored."""
    s = dot(a1, d_new) / (1.0 + dot(d, d_new))
    x = a1[0] - s * (d[0] + d_new[0])
    y = a1[1] - s * (d[1] + d_new[1])
    z = a1[2] - s * (d[2] + d_new[2])
    s = x * d_new[0] + y * d_new[1] + z * d_new[2]
    x, y, z = x - s * d_new[0], y - s * d_new[1], z - s * d_new[2]
    n = 1.0 / math.sqrt(x * x + y * y + z * z)
    return (n * x, n * y, n * z)


@inner
def spin_about(a1, d, psi):
    """Turn a1 about d by psi."""
    c, s = math.cos(psi), math.sin(psi)
    a2 = cross(d, a1)
    return (c * a1[0] + s * a2[0], c * a1[1] + s * a2[1], c * a1[2] + s * a2[2])


# Below this angle the series of the functions of q are exact to round-off (next term < 1e-16); below this square of a
# sine, that of its arc.
SMALL, SMALL_SQUARE = 0.2, 0.04


@inner
def arc_over_sine(x):
    """asin(s)/s as a series in x = s^2."""
    tail = 10395 / 599040 + x * (135135 / 9676800 + x * (2027025 / 175472640 + x * 34459425 / 3530096640))
    return 1.0 + x * (1 / 6 + x * (3 / 40 + x * (15 / 336 + x * (105 / 3456 + x * (945 / 42240 + x * tail)))))


@inner
def log_rotation(E):
    """Rotation vector k of a rotation matrix E, with |k| < pi."""
    v = (0.5 * (E[7] - E[5]), 0.5 * (E[2] - E[6]), 0.5 * (E[3] - E[1]))  # sin(q) * axis
    c = 0.5 * (E[0] + E[4] + E[8] - 1.0)
    x = dot(v, v)
    if c > 0.0 and x < SMALL_SQUARE:
        f = arc_over_sine(x)
    else:
        s = math.sqrt(x)
        f = math.atan2(s, c) / s if s > 0.0 else math.nan  # a half turn has no direction: NaN, found by the step
    return scale(f, v)


@inner
def jacobian_functions(q2):
    """g and g1 of q^2."""
    if q2 < SMALL:
        tail = 691 / 1307674368000 + q2 * (1 / 74724249600 + q2 * 3617 / 10670622842880000)
        g = 1 / 12 + q2 * (1 / 720 + q2 * (1 / 30240 + q2 * (1 / 1209600 + q2 * (1 / 47900160 + q2 * tail))))
        tail = 5 * 691 / 1307674368000 + q2 * (6 / 74724249600 + q2 * 7 * 3617 / 10670622842880000)
        g1 = 2 * (1 / 720 + q2 * (2 / 30240 + q2 * (3 / 1209600 + q2 * (4 / 47900160 + q2 * tail))))
        return g, g1
    q = math.sqrt(q2)
    half = 0.5 * q
    cot = 1.0 / math.tan(half)
    g = (1.0 - half * cot) / q2
    # d/dq [1 - (q/2) cot(q/2)] = -cot/2 + (q/4)(1 + cot^2)
    g1 = ((-0.5 * cot + 0.25 * q * (1.0 + cot * cot)) / q2 - 2.0 * g / q) / q
    return g, g1


@inner
def inverse_left_jacobian(k, g):
    """P = I - [k]x/2 + g [k]x^2."""
    x, y, z = k
    gx, gy, gz = g * x, g * y, g * z
    return stack(
        (1.0 - gy * y - gz * z, 0.5 * z + gx * y, -0.5 * y + gx * z),
        (-0.5 * z + gx * y, 1.0 - gx * x - gz * z, 0.5 * x + gy * z),
        (0.5 * y + gx * z, -0.5 * x + gy * z, 1.0 - gx * x - gy * y),
    )


@inner
def d_double_cross(k, n, g, g1):
    """Derivative with respect to k of g(|k|) k x (k x n)."""
    kn, kk = dot(k, n), dot(k, k)
    w = (k[0] * kn - n[0] * kk, k[1] * kn - n[1] * kk, k[2] * kn - n[2] * kk)
    a = (g1 * w[0] - 2.0 * g * n[0], g1 * w[1] - 2.0 * g * n[1], g1 * w[2] - 2.0 * g * n[2])
    gk = (g * k[0], g * k[1], g * k[2])
    t = g * kn
    return stack(
        (t + gk[0] * n[0] + a[0] * k[0], gk[0] * n[1] + a[0] * k[1], gk[0] * n[2] + a[0] * k[2]),
        (gk[1] * n[0] + a[1] * k[0], t + gk[1] * n[1] + a[1] * k[1], gk[1] * n[2] + a[1] * k[2]),
        (gk[2] * n[0] + a[2] * k[0], gk[2] * n[1] + a[2] * k[1], t + gk[2] * n[2] + a[2] * k[2]),
    )


@inner
def vector(row, o):
    """Three numbers of a row, from o on."""
    return (row[o], row[o + 1], row[o + 2])


@inner
def matrix(row, o):
    return stack(vector(row, o), vector(row, o + 3), vector(row, o + 6))


@inner
def put(row, o, x):
    row[o], row[o + 1], row[o + 2] = x


@inner
def put_matrix(row, o, x):
    for k in range(9):
        row[o + k] = x[k]


@inner
def get3(A, i):
    return (A[i, 0], A[i, 1], A[i, 2])


@inner
def get9(A, i):
    return (A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4], A[i, 5], A[i, 6], A[i, 7], A[i, 8])
