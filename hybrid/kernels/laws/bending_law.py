"""Elements whose moment is no multiple of their bend: tables of moment over curvature, elastic, and the same any way.

    symbol    meaning                                                                      unit
    x         bend of an element from what has no stress, across its tangent               rad
    kb        its stiffness without bend (Line.kb), as far as it has grown                  N m
    M(x)      moment: secant kb x along x, with slope kb (secant + more)                    N m
    kappa(M)  curvature of a half cell, linear between the points of its table and beyond   1/m

An element is two half cells, and the spring of its clamp, in series: |x| = a kappa_a(M) + b kappa_b(M) + give M is
solved for M, which is exact between two points.  What depends on the size of x alone are three numbers of it.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    madd,
    mat_vec,
    mscale,
    outer,
    scale,
    vec_mat,
)
from hybrid.kernels.laws.axial_law import piece_of
from hybrid.kernels.laws.bending_slip import beside_spring, give_of_spring, slip_moment, slips
from hybrid.kernels.laws.element import bending, damped_bending, relative_rotation, turns_freely
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.state.report import BENDING_LAW, BENDING_SLIP

# Columns of Line.bend_law: of the half cells before and after a node, their first row in Line.bend_table, the row
# behind their last, and their length (m; 0: there is none); then the give of an angular spring (rad per N m).
FIRST_A, LAST_A, HALF_A, FIRST_B, LAST_B, HALF_B, GIVE = range(7)
# Columns of Line.bend_table: curvature, 1/m; moment, N m; energy per length from the first point on, J/m.
CURVATURE, MOMENT, ENERGY = range(3)
# Part of the bend at a clamp that is the line's, above which it has no angular spring.
RIGID = 1.0 - 1e-9
# A small change of a bend, as a part of it.
SMALL = 1e-6


@inner
def slope_of(table, j):
    """Curvature by moment, 1/(N m2), of the piece that begins at row j."""
    return (table[j + 1, CURVATURE] - table[j, CURVATURE]) / (table[j + 1, MOMENT] - table[j, MOMENT])


@inner
def half_cell(table, law, i, half, M):
    """Bend (rad) of half a cell under the moment M, its slope (rad per N m), its energy (J), and where its piece ends."""
    length = law[i, half + HALF_A]
    if not length > 0.0:
        return 0.0, 0.0, 0.0, math.inf
    first, last = int(law[i, half + FIRST_A]), int(law[i, half + LAST_A])
    j = piece_of(table, first, last, MOMENT, M)
    c, more = slope_of(table, j), M - table[j, MOMENT]
    end = table[j + 1, MOMENT] if j + 2 < last else math.inf
    energy = table[j, ENERGY] + 0.5 * c * more * (M + table[j, MOMENT])
    return length * (table[j, CURVATURE] + c * more), length * c, length * energy, end


@inner
def bend_under(table, law, i, M):
    """Bend of an element under the moment M, its slope, its energy, and the moment up to which the slope holds."""
    a, ca, wa, ea = half_cell(table, law, i, 0, M)
    b, cb, wb, eb = half_cell(table, law, i, FIRST_B, M)
    give = law[i, GIVE]
    return a + b + give * M, ca + cb + give, wa + wb + 0.5 * give * M * M, min(ea, eb)


@kernel
def shares_of_stiffness(line, i, x):
    """Secant, tangent less secant, and energy of the element at node i, bent by the size x (rad).

    As parts of its stiffness without bend, the energy of that of this stiffness.
    """
    law, table = line.bend_law, line.bend_table
    low = 0.0
    bend, c0, energy, high = bend_under(table, law, i, low)
    c = c0
    while high < math.inf:
        at, slope, stored, end = bend_under(table, law, i, high)
        if at > x:
            break
        low, bend, c, energy, high = high, at, slope, stored, end
    if low == 0.0:
        return 1.0, 0.0, 1.0
    more = (x - bend) / c
    M = low + more
    stored = energy + more * (low + 0.5 * more) * c
    return M * c0 / x, c0 / c - M * c0 / x, 2.0 * c0 * stored / (x * x)


@inner
def has_bend_law(line, i):
    """Whether the element at node i has a table."""
    return (line.bits & BENDING_LAW) != 0 and line.bend_law[i, LAST_A] + line.bend_law[i, LAST_B] > 0.0


@inner
def moment_share(line, i, x):
    """Secant stiffness of the element at node i, bent by the size x (rad), over that without bend."""
    return shares_of_stiffness(line, i, x)[0] if has_bend_law(line, i) else 1.0


@inner
def energy_share(line, i, x):
    """Energy of the element at node i, bent by the size x (rad), over that of its stiffness without bend."""
    return shares_of_stiffness(line, i, x)[2] if has_bend_law(line, i) else 1.0


@kernel
def curvature_under(line, i, side, M):
    """Curvature (1/m) that a moment (N m) makes on one side (-1, 1) of node i."""
    law, half = line.bend_law, FIRST_A if side < 0 else FIRST_B
    if not law[i, half + HALF_A] > 0.0:  # both halves are of one table
        half = FIRST_A + FIRST_B - half
    return half_cell(line.bend_table, law, i, half, M)[0] / law[i, half + HALF_A]


@kernel
def parts_without_spring(line, i, a, b):
    """The part of the bend a, b (rad) of an end's element that is not of its angular spring.

    Also that part of a small change of the bend.
    """
    x = math.sqrt(a * a + b * b)
    if slips(line, i) and give_of_spring(line, i) > 0.0 and x > 0.0:
        p, q = beside_spring(line, i, a, b)
        r, s = beside_spring(line, i, (1.0 + SMALL) * a, (1.0 + SMALL) * b)
        return (a * p + b * q) / (x * x), (a * (r - p) + b * (s - q)) / (SMALL * x * x)
    if not has_bend_law(line, i):
        part = 0.5 * line.h[min(i, line.h.shape[0] - 1)] / line.hn[i]
        return part, part
    secant, more, _ = shares_of_stiffness(line, i, x)
    turns = line.bend_law[i, GIVE] / bend_under(line.bend_table, line.bend_law, i, 0.0)[1]
    return 1.0 - turns * secant, 1.0 - turns * (secant + more)


@inner
def direction_of_bend(Ra, Rb, kb, k0):
    """Size of the bend (rad) and how it answers to the turn of the cells against each other, q: d size = q.dth."""
    if turns_freely(kb, k0):
        w = cross((Ra[2], Ra[5], Ra[8]), (Rb[2], Rb[5], Rb[8]))
        s = math.sqrt(dot(w, w))
        size = math.atan2(s, Ra[2] * Rb[2] + Ra[5] * Rb[5] + Ra[8] * Rb[8])
        return size, scale(1.0 / max(s, 1e-300), w)
    k = log_rotation(relative_rotation(Ra, Rb))
    x = (k[0] - k0[0], k[1] - k0[1])
    size = math.sqrt(x[0] * x[0] + x[1] * x[1])
    one = 1.0 / max(size, 1e-300)
    P = inverse_left_jacobian(k, jacobian_functions(dot(k, k))[0])
    return size, mat_vec(Ra, vec_mat((one * x[0], one * x[1], 0.0), P))


@inner
def bending_at(line, i, Ra, Rb, kb, k0):
    """As `element.bending`, of the element at node i, by its table if it has one, and with layers that slip."""
    M, C = bending_by_table(line, i, Ra, Rb, kb, k0)
    if line.bits & BENDING_SLIP:
        m, c = slip_moment(line, i, Ra, Rb, k0)
        M, C = add(M, m), madd(C, c)
    return M, C


@inner
def bending_by_table(line, i, Ra, Rb, kb, k0):
    """As `element.bending`, of the element at node i, by its table if it has one."""
    if not has_bend_law(line, i):
        return bending(Ra, Rb, kb, k0)
    return bending_of_law(line, i, Ra, Rb, kb, k0)


@called
def bending_of_law(line, i, Ra, Rb, kb, k0):
    """The same of an element that has a table."""
    size, q = direction_of_bend(Ra, Rb, kb, k0)
    secant, more, _ = shares_of_stiffness(line, i, size)
    M, C = bending(Ra, Rb, (secant * kb[0], secant * kb[1], kb[2]), k0)
    return M, madd(C, mscale(more * kb[0], outer(q, q)))


@inner
def damped_bending_at(line, i, Ra, Rb, kb, k0, tau, wa, wb):
    """As `element.damped_bending`, likewise: the damping is that of the stiffness without bend and without layers."""
    M, C, Cd, loss = damped_bending_by_table(line, i, Ra, Rb, kb, k0, tau, wa, wb)
    if line.bits & BENDING_SLIP:
        m, c = slip_moment(line, i, Ra, Rb, k0)
        M, C = add(M, m), madd(C, c)
    return M, C, Cd, loss


@inner
def damped_bending_by_table(line, i, Ra, Rb, kb, k0, tau, wa, wb):
    """As `element.damped_bending`, likewise."""
    kd = scale(tau, kb)
    if not has_bend_law(line, i):
        return damped_bending(Ra, Rb, kb, kd, k0, wa, wb)
    return damped_bending_of_law(line, i, Ra, Rb, kb, kd, k0, wa, wb)


@called
def damped_bending_of_law(line, i, Ra, Rb, kb, kd, k0, wa, wb):
    """The same of an element that has a table."""
    size, q = direction_of_bend(Ra, Rb, kb, k0)
    secant, more, _ = shares_of_stiffness(line, i, size)
    M, C, Cd, loss = damped_bending(Ra, Rb, (secant * kb[0], secant * kb[1], kb[2]), kd, k0, wa, wb)
    return M, madd(C, mscale(more * kb[0], outer(q, q))), Cd, loss
