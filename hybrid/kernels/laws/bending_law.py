"""Moments that are no multiple of the bend: tables and layers that slip.

Layers of a section that slip on each other: moment over curvature with hysteresis, parallel Jenkins elements.

    symbol   meaning                                                                          unit   frame
    x        bend of an element from what has no stress, two components                       rad    Ra
    hn       length that the element stands for                                               m
    K        stiffness that a layer adds while it sticks, K0 + KT max(T, 0) (Line.slip_law)   N m2
    p        curvature to which it has slipped: there it has no moment (State.layers)         1/m    Ra
    m        its moment, K (x/hn - p), of no more than `most` in size                         N m    Ra
    most     its slip moment, m0 + mT max(T, 0), T of the start of the step                   N m

A step maps x to m by radial return: m = most t/|t| where t = K (x/hn - p) is more than `most`, which has the exact
derivative K/hn most/|t| (1 - t t^T/|t|^2); then p moves by (t - m)/K.  At rest p = 0: the curve of a first loading.
A layer whose `most` is below 0 is elastic: m = (|t| + most) t/|t| beyond |t| = -most, and nothing below: what locks at a
curvature, and the bends of a table of moment over curvature, whose K may be below 0.
A layer whose `most` has no bound is a stiffness that grows with tension.  A step has the K of its start; behind it K
changes at that bend, and hn dK |x/hn - p|^2/2 is no work of bending: it is booked beside what is lost.

At a clamp with an angular spring, k = 1/give in series with the half cell and its layers, z is what the half cell bends
by: with E its stiffness without layers, S = k/(k + E) and c = S/k, the moments balance where z + c m(z) = S x.  Beside
the spring and E in series, S m is what the layers add to the moment, and m c m/2 to the energy.

Elements whose moment is no multiple of their bend: tables of moment over curvature, elastic, and the same any way.

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

from hybrid.kernels.algebra.plane import row_along_normal, to_space
from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    d_double_cross,
    dot,
    get3,
    hat,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    madd,
    mat_mat,
    mat_matT,
    mat_vec,
    mscale,
    msub,
    outer,
    scale,
    vec_mat,
)
from hybrid.kernels.algebra.sparse_rows import interval_within
from hybrid.kernels.laws.element import (
    bending,
    damped_bending,
    frames_at,
    relative_rotation,
    strain_of_element,
    swivel,
    turns_freely,
)
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.state.report import AXIAL_LAW, BENDING_LAW, BENDING_SLIP, LOST_WORK
from hybrid.kernels.state.state import blank_state, no_ends, no_work, on_line

# Columns of Line.slip_law, EACH of a layer: K0, N m2; m0, N m, below 0 of an elastic one; mT, m; KT, m2.  K0, KT 0: none (as
# behind the last).  Behind those of a clamp with an angular spring, where there is none, m0 is its give, rad/(N m).
STIFFNESS, MOMENT, PER_TENSION, STIFFENING, EACH = range(5)
# Columns of Line.slip_now, EACH of a layer.
FROM = 0  # 2, p at the start of the step, 1/m
MOST = 2  # N m
STIFF = 3  # K, N m2
KEPT = 2  # columns of a layer in State.layers
# What `update_slip` is asked for: before a march, in motion or at rest; behind a step, an equilibrium.
IN_MOTION, LOADED_FIRST, BEHIND_STEP, BEHIND_REST = range(4)
MOST_TIMES = 60  # iterations of the bend beside a spring
ROUND_OFF = 1e-15  # part of the bend
SHORTEST = 1e-6  # step towards it, as a part
Z3 = (0.0, 0.0, 0.0)
Z9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inner
def slips(line, i):
    """Whether the element at node i has layers that slip, or a stiffness that grows with tension."""
    return (line.bits & BENDING_SLIP) != 0 and layered(line, i, 0)


@inner
def layered(line, i, j):
    """Whether there is a layer j (its first column) at node i."""
    return line.slip_law[i, j + STIFFNESS] != 0.0 or line.slip_law[i, j + STIFFENING] > 0.0


@inner
def trial(line, i, j, x, y, hn):
    """Moment of layer j at node i under the bend x, y of a length hn, as if it stuck.

    j: its first column.  Two components, their size, and the part of them that friction holds.
    """
    K, one = line.slip_now[i, j + STIFF], 1.0 / hn
    a, b = K * (x * one - line.slip_now[i, j + FROM]), K * (y * one - line.slip_now[i, j + FROM + 1])
    size, most = math.sqrt(a * a + b * b), line.slip_now[i, j + MOST]
    if most < 0.0:
        return a, b, size, (size + most) / size if size > -most else 0.0
    return a, b, size, most / size if size > most else 1.0


@inner
def give_of_spring(line, i):
    """How an angular spring in series with the layers at node i turns, rad/(N m); 0: there is none."""
    for j in range(0, line.slip_law.shape[1], EACH):
        if not layered(line, i, j):
            return line.slip_law[i, j + MOMENT]
    return 0.0


@inner
def parts_of_line(line, i, give):
    """S and c of both axes of node i, with an angular spring."""
    a, b = 1.0 - give * line.kb[i, 0], 1.0 - give * line.kb[i, 1]
    return a, b, give * a, give * b


@kernel
def beside_spring(line, i, x, y):
    """z (rad), two components: of the bend x, y of node i what is not that of its angular spring."""
    give, half = give_of_spring(line, i), 0.5 * line.h[min(i, line.h.shape[0] - 1)]
    s, t, c, d = parts_of_line(line, i, give)
    p, q = s * x, t * y
    a, b = p, q
    mx, my, c11, c12, c22, _ = layers_answer(line, i, a, b, half)
    u, v = a + c * mx - p, b + d * my - q
    for _ in range(MOST_TIMES):
        left = u * u + v * v
        if not left > ROUND_OFF * ROUND_OFF * (p * p + q * q):
            break
        j11, j12, j21, j22 = 1.0 + c * c11, c * c12, d * c12, 1.0 + d * c22
        one, part = 1.0 / (j11 * j22 - j12 * j21), 1.0
        da, db = one * (j12 * v - j22 * u), one * (j21 * u - j11 * v)
        while True:
            e, f = a + part * da, b + part * db
            mx, my, c11, c12, c22, _ = layers_answer(line, i, e, f, half)
            u, v = e + c * mx - p, f + d * my - q
            if u * u + v * v < left or part < SHORTEST:
                break
            part *= 0.5
        if not u * u + v * v < left:
            break
        a, b = e, f
    return a, b


@linked_kernel(on_line(0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
def slip_answer(line, i, x, y):
    """As `element_answer`, for what few lines call."""
    return element_answer(line, i, x, y)


@kernel
def element_answer(line, i, x, y):
    """As `layers_answer` of the element at node i under the bend x, y (rad), also beside an angular spring."""
    give = give_of_spring(line, i)
    if give == 0.0:
        return layers_answer(line, i, x, y, line.hn[i])
    a, b = beside_spring(line, i, x, y)
    s, t, c, d = parts_of_line(line, i, give)
    mx, my, c11, c12, c22, stored = layers_answer(line, i, a, b, 0.5 * line.h[min(i, line.h.shape[0] - 1)])
    j11, j12, j21, j22 = 1.0 + c * c11, c * c12, d * c12, 1.0 + d * c22
    one = 1.0 / (j11 * j22 - j12 * j21)
    k11, k12, k22 = one * (c11 * j22 - c12 * j21), one * (c12 * j11 - c11 * j12), one * (c22 * j11 - c12 * j12)
    stored += 0.5 * (c * mx * mx + d * my * my)
    return s * mx, t * my, s * s * k11, s * t * k12, t * t * k22, stored


@kernel
def layers_answer(line, i, x, y, hn):
    """Of the layers of node i whose length hn bends by x, y (rad).

    Moment, N m, in two components; its derivatives 11, 12, 22, N m/rad; the energy that they store, J.
    """
    mx, my, c11, c12, c22, stored = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(0, line.slip_law.shape[1], EACH):
        if not layered(line, i, j):
            break
        K = line.slip_now[i, j + STIFF]
        a, b, size, part = trial(line, i, j, x, y, hn)
        mx, my = mx + part * a, my + part * b
        c = K / hn * part
        c11, c22 = c11 + c, c22 + c
        if 0.0 < part < 1.0:
            c = (c if line.slip_now[i, j + MOST] >= 0.0 else c - K / hn) / (size * size)
            c11, c12, c22 = c11 - c * a * a, c12 - c * a * b, c22 - c * b * b
        stored += 0.5 * hn * (part * size) ** 2 / K if K != 0.0 else 0.0
    return mx, my, c11, c12, c22, stored


@linked_kernel(on_line(0, Z9, Z9, Z3), (Z3, Z9))
def slip_moment(line, i, Ra, Rb, k0):
    """What layers add to M and C of `element.bending`, of the element at node i; nothing of one without."""
    if not layered(line, i, 0):
        return Z3, Z9
    if turns_freely(get3(line.kb, i), k0):
        return across_swivel(line, i, Ra, Rb)
    k = log_rotation(relative_rotation(Ra, Rb))
    mx, my, c11, c12, c22, _ = element_answer(line, i, k[0] - k0[0], k[1] - k0[1])
    n = (mx, my, 0.0)
    g, g1 = jacobian_functions(dot(k, k))
    P = inverse_left_jacobian(k, g)
    D = msub(d_double_cross(k, n, g, g1), mscale(0.5, hat(n)))
    PT = (P[0], P[3], P[6], P[1], P[4], P[7], P[2], P[5], P[8])
    C = mat_mat(madd(D, mat_mat(PT, (c11, c12, 0.0, c12, c22, 0.0, 0.0, 0.0, 0.0))), P)
    return mat_vec(Ra, vec_mat(n, P)), mat_matT(mat_mat(Ra, C), Ra)


@kernel
def across_swivel(line, i, Ra, Rb):
    """The same of an element that turns freely: its bend is without the twist.

    Its layers turn with the cell before; at a clamped start, where that is none of the line, with the first one.
    """
    w, turn = swivel(Ra, Rb, 1.0)
    R = Rb if i == 0 else Ra
    x = vec_mat(w, R)
    mx, my, c11, c12, c22, _ = element_answer(line, i, x[0], x[1])
    M = mat_vec(R, (mx, my, 0.0))
    C = mat_matT(mat_mat(R, (c11, c12, 0.0, c12, c22, 0.0, 0.0, 0.0, 0.0)), R)
    if i == 0:
        return M, msub(mat_mat(C, madd(turn, hat(w))), hat(M))
    return M, mat_mat(C, turn)


@inner
def components_about_normal(line, a1, c, d, bend):
    """A bend (rad) about the normal of the plane, in two components, of sections that lie as in cell c with chord d."""
    m = to_space(line.plane, (-d[1], d[0]))
    return bend * row_along_normal(line.plane, a1, c), bend * (a1[c, 0] * m[0] + a1[c, 1] * m[1] + a1[c, 2] * m[2])


@kernel  # linked, steps in a plane would take 1.15 times as long
def slip_about_normal(line, a1, c, d, i, bend):
    """Of layers of the element at node i of a line in a plane, whose sections lie as in cell c with chord d.

    Moment, N m, about the normal under a bend (rad) about it, its slope, and the stiffness about the other axis, N m/rad.
    """
    if not layered(line, i, 0):
        return 0.0, 0.0, 0.0
    x, y = components_about_normal(line, a1, c, d, 1.0)
    mx, my, c11, c12, c22, _ = element_answer(line, i, bend * x, bend * y)
    slope = c11 * x * x + 2.0 * c12 * x * y + c22 * y * y
    return mx * x + my * y, slope, c11 + c22 - slope


@inner
def stored_by_slip(line, i, x, y):
    """Energy, J, that the layers of the element at node i store under the bend x, y (rad)."""
    return slip_answer(line, i, x, y)[5] if slips(line, i) else 0.0


@inner
def pull_at(state, i):
    """Tension at node i, N, on average of the cells beside it, and not below 0."""
    n = state.T.shape[0]
    return max(0.5 * (state.T[max(i - 1, 0)] + state.T[min(i, n - 1)]), 0.0)


@kernel
def stiffen_beside_spring(line, new, i, x, y):
    """Give the layers of a clamp with an angular spring the stiffness of the tension now, at the bend x, y (rad).

    Energy, J, that they have stored less behind it, from where they have slipped to.
    """
    law, now, stiffens = line.slip_law, line.slip_now, False
    for j in range(0, law.shape[1], EACH):
        stiffens |= layered(line, i, j) and law[i, j + STIFFENING] > 0.0
    if not stiffens:
        return 0.0
    for j in range(0, law.shape[1], EACH):
        for m in range(KEPT):
            now[i, j + FROM + m] = new.layers[i, j // EACH * KEPT + m]
    before = slip_answer(line, i, x, y)[5]
    for j in range(0, law.shape[1], EACH):
        if layered(line, i, j):
            now[i, j + STIFF] = law[i, j + STIFFNESS] + law[i, j + STIFFENING] * pull_at(new, i)
    return before - slip_answer(line, i, x, y)[5]


@linked_kernel(on_line(no_ends(), blank_state(1), blank_state(1), no_work(), 0))
def update_slip(line, ends, old, new, work, part):
    """IN_MOTION, LOADED_FIRST: how far layers have slipped before, and what they bear, for the march.

    BEHIND_STEP, BEHIND_REST: how far they have slipped now, into new.layers, and the work that this has lost.
    """
    law, now, lost = line.slip_law, line.slip_now, 0.0
    after = part >= BEHIND_STEP
    for i in range(law.shape[0]):
        x, y, hn, whole = 0.0, 0.0, line.hn[i], (0.0, 0.0)
        give = give_of_spring(line, i)
        if after and layered(line, i, 0) and line.element[i]:
            Ra, Rb = frames_at(line, ends, new, i)
            k = strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i), i)
            x, y = k[0] - line.k0[i, 0], k[1] - line.k0[i, 1]
            if give > 0.0:
                whole, hn = (x, y), 0.5 * line.h[min(i, line.h.shape[0] - 1)]
                x, y = beside_spring(line, i, x, y)
        for j in range(0, law.shape[1], EACH):
            at = j // EACH * KEPT
            if not layered(line, i, j):
                break
            if not after:
                rest = part == LOADED_FIRST
                for m in range(KEPT):
                    now[i, j + FROM + m] = 0.0 if rest else old.layers[i, at + m]
                    if line.slip_flow.shape[0] > 0 and not rest:
                        now[i, j + FROM + m] += line.slip_flow[i, at + m]
                T = pull_at(new, i) if rest else pull_at(old, i)
                now[i, j + MOST] = law[i, j + MOMENT] + law[i, j + PER_TENSION] * T
                now[i, j + STIFF] = law[i, j + STIFFNESS] + law[i, j + STIFFENING] * T
                continue
            K, p, q = now[i, j + STIFF], 0.0, 0.0
            a, b, _, left = trial(line, i, j, x, y, hn)
            if left < 1.0 and now[i, j + MOST] >= 0.0:
                p, q = (1.0 - left) * a / K, (1.0 - left) * b / K
                lost += hn * left * (a * p + b * q)
            new.layers[i, at], new.layers[i, at + 1] = now[i, j + FROM] + p, now[i, j + FROM + 1] + q
            if part == BEHIND_STEP and law[i, j + STIFFENING] > 0.0 and give == 0.0:
                now[i, j + STIFF] = law[i, j + STIFFNESS] + law[i, j + STIFFENING] * pull_at(new, i)
                bent = (x / line.hn[i] - new.layers[i, at]) ** 2 + (y / line.hn[i] - new.layers[i, at + 1]) ** 2
                lost += 0.5 * line.hn[i] * (K - now[i, j + STIFF]) * bent
        if give > 0.0 and part == BEHIND_STEP:
            lost += stiffen_beside_spring(line, new, i, whole[0], whole[1])
    if part == BEHIND_STEP:
        work.report[LOST_WORK] = (work.report[LOST_WORK] if line.bits & AXIAL_LAW else 0.0) - lost


# Columns of Line.bend_law: of the half cells before and after a node, their first row in Line.bend_table, the row
# behind their last, and their length (m; 0: there is none); then the give of an angular spring (rad per N m).
FIRST_A, LAST_A, HALF_A, FIRST_B, LAST_B, HALF_B, GIVE = range(7)
# Columns of Line.bend_table: curvature, 1/m; moment, N m; energy per length from the first point on, J/m.
CURVATURE, TABLE_MOMENT, ENERGY = range(3)
# Part of the bend at a clamp that is the line's, above which it has no angular spring.
RIGID = 1.0 - 1e-9
# A small change of a bend, as a part of it.
SMALL = 1e-6


@inner
def half_cell(table, law, i, half, M):
    """Bend (rad) of half a cell under the moment M, its slope (rad per N m), its energy (J), and where its piece ends."""
    length = law[i, half + HALF_A]
    if not length > 0.0:
        return 0.0, 0.0, 0.0, math.inf
    first, last = int(law[i, half + FIRST_A]), int(law[i, half + LAST_A])
    j = interval_within(table[:, TABLE_MOMENT], first, last - 1, M)
    c = (table[j + 1, CURVATURE] - table[j, CURVATURE]) / (table[j + 1, TABLE_MOMENT] - table[j, TABLE_MOMENT])
    more = M - table[j, TABLE_MOMENT]
    end = table[j + 1, TABLE_MOMENT] if j + 2 < last else math.inf
    energy = table[j, ENERGY] + 0.5 * c * more * (M + table[j, TABLE_MOMENT])
    return length * (table[j, CURVATURE] + c * more), length * c, length * energy, end


@inner
def bend_under(table, law, i, M):
    """Bend of an element under the moment M, its slope, its energy, and the moment up to which the slope holds."""
    a, ca, wa, ea = half_cell(table, law, i, 0, M)
    b, cb, wb, eb = half_cell(table, law, i, FIRST_B, M)
    give = law[i, GIVE]
    return a + b + give * M, ca + cb + give, wa + wb + 0.5 * give * M * M, min(ea, eb)


@linked_kernel(on_line(0, 0.0), Z3)
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


@linked_kernel(on_line(0, 0, 0.0), 0.0)
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
def without_spring(line, i, x, y):
    """Of the bend x, y (rad) of the element at an end what is not that of its angular spring."""
    part = parts_without_spring(line, i, x, y)[0]
    if part < RIGID and slips(line, i) and give_of_spring(line, i) > 0.0:  # which may bend another way than the spring
        return beside_spring(line, i, x, y)
    return part * x, part * y


@inner
def own_strain(line, i, k):
    """Bends and twist, 1/m, of the element at node i of log strain k (rad), and its bends from what has no stress.

    An angular spring at a clamp bends, but does not twist.
    """
    n, rest, one = line.h.shape[0], get3(line.k0, i), 1.0 / line.hn[i]
    a, b, twist = k[0] - rest[0], k[1] - rest[1], k[2] * one
    if i == 0 or i == n:
        half = 0.5 * line.h[min(i, n - 1)]
        twist *= line.hn[i] / half
        if RIGID * line.hn[i] > half:
            a, b = without_spring(line, i, a, b)
            u, v, one = rest[0] + a, rest[1] + b, 1.0 / half
            return u * one, v * one, twist, a * one, b * one
    return k[0] * one, k[1] * one, twist, a * one, b * one


@inner
def elastic_moment(line, i, k):
    """Bending moment, N m, of the elastic strain of the element at node i, two components."""
    x, y = k[0] - line.k0[i, 0], k[1] - line.k0[i, 1]
    share = moment_share(line, i, math.sqrt(x * x + y * y))
    mx, my = share * line.kb[i, 0] * x, share * line.kb[i, 1] * y
    if slips(line, i):
        a, b, _, _, _, _ = slip_answer(line, i, x, y)
        return mx + a, my + b
    return mx, my


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
    if has_bend_law(line, i):
        M, C = bending_of_law(line, i, Ra, Rb, kb, k0)
    else:
        M, C = bending(Ra, Rb, kb, k0)
    if line.bits & BENDING_SLIP:
        m, c = slip_moment(line, i, Ra, Rb, k0)
        M, C = add(M, m), madd(C, c)
    return M, C


@linked_kernel(on_line(0, Z9, Z9, Z3, Z3), (Z3, Z9))
def bending_of_law(line, i, Ra, Rb, kb, k0):
    """The same of an element that has a table."""
    size, q = direction_of_bend(Ra, Rb, kb, k0)
    secant, more, _ = shares_of_stiffness(line, i, size)
    M, C = bending(Ra, Rb, (secant * kb[0], secant * kb[1], kb[2]), k0)
    return M, madd(C, mscale(more * kb[0], outer(q, q)))


@inner
def damped_bending_at(line, i, Ra, Rb, kb, k0, tau, wa, wb):
    """As `element.damped_bending`, likewise: the damping is that of the stiffness without bend and without layers."""
    kd = scale(tau, kb)
    if has_bend_law(line, i):
        M, C, Cd, loss = damped_bending_of_law(line, i, Ra, Rb, kb, kd, k0, wa, wb)
    else:
        M, C, Cd, loss = damped_bending(Ra, Rb, kb, kd, k0, wa, wb)
    if line.bits & BENDING_SLIP:
        m, c = slip_moment(line, i, Ra, Rb, k0)
        M, C = add(M, m), madd(C, c)
    return M, C, Cd, loss


@linked_kernel(on_line(0, Z9, Z9, Z3, Z3, Z3, Z3, Z3), (Z3, Z9, Z9, 0.0))
def damped_bending_of_law(line, i, Ra, Rb, kb, kd, k0, wa, wb):
    """The same of an element that has a table."""
    size, q = direction_of_bend(Ra, Rb, kb, k0)
    secant, more, _ = shares_of_stiffness(line, i, size)
    M, C, Cd, loss = damped_bending(Ra, Rb, (secant * kb[0], secant * kb[1], kb[2]), kd, k0, wa, wb)
    return M, madd(C, mscale(more * kb[0], outer(q, q))), Cd, loss
