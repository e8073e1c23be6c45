"""Torque that tension makes, with constant stiffness and with a law of length.

In a helically armoured cable tension makes a torque, and the cable lengthens as it turns (docs/theory.md, 15).

    symbol   meaning                                                              shape  unit
    c        torque by tension, `tension_torque` of a section                     -      N m per N
    g        twist of half a cell by tension, without torque: h c/(2 GJ)          -      rad/N
    Q        torque at a node: of its element, of the catenary zone, of a load    -      N m
    p        how the twist of an element answers to the turns of its cells        3      -
    s        twist of an element by tension, g_a T_a + g_b T_b                    -      rad

With W = F(eps + c tau) + GJ tau^2/2 per length, Q = GJ tau + c T and T = F'(eps + c tau); F is EA/2 times a square, or
what a law of tension over strain stores.  The torque of an element is kb (k - k0 + s), so that tension takes part of the strain without stress, and the law of length of a cell is
    l - h - h ck T - 2 g c T + g (Q_i + Q_{i+1}) = 0,
of a law of tension over strain with that strain in place of ck T.
Both follow from one function of k, l and T, so that no energy is lost.

A block row does not reach the tension of the cell after next, which the spin and the force of a cell know: in these
rows of the matrix the change of s is (g_a + g_b) dT_a, everywhere, so that torques and forces of the matrix still add
up to nothing.  That slows Newton's method by the difference of both changes, and touches nothing else.  Lines without
such sections have empty arrays here and run none of this.

Of cells whose tension is no multiple of their strain:

    symbol   meaning                                                                              unit
    x        strain of the law, eps + c tau: T = F'(x), of kernels.laws.axial_law                 -
    Te       elastic part of the tension of a damped cell                                         N
    late     strain by which damping makes x less than its tension would: tau x'                  -

The tension is an unknown of its own, so the law is linearised about it as without a torque, and its history is that of
tensions.  What a cell stores and loses is another: its chord alone does not tell x.  Of the law of length it is
    U = T (l - h (1 + x)) + h W(Te) - g c T^2 = h W + g c T^2 - g T (Q_i + Q_{i+1}),
which beside the torsion of elements and zones is stationary in T.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.algebra.block_elimination import WIDTH
from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    frame,
    get3,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    mat_vec,
    scale,
    sub,
)
from hybrid.kernels.laws.axial_law import (
    CREPT,
    LOSS,
    SHIFT,
    WORKING,
    crept,
    has_law,
    is_dynamic,
    linearise_law,
    lost_in_step,
    peak_before,
    sliding_power,
    softness_of_damping,
    stiffness_at,
    strain_and_energy_at,
)
from hybrid.kernels.laws.element import chord, relative_rotation, turns_freely
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.state.report import LOST_WORK, STIFFNESS_DAMPING, STRETCH_ENERGY
from hybrid.kernels.state.state import ROWS, blank_line, blank_state, no_work, on_line

# Columns of Work.couple, of the element at a node.
AXIS = 0  # 3, kb p
AFTER = 3  # 3, how Q answers to the chord
SPIN_AFTER = 6  # and spin of the cell after it,
BEFORE = 7  # 3, and (with a minus sign) to the chord
SPIN_BEFORE = 10  # and spin of the cell before it
STIFF = 11  # kb
TORQUE = 12  # Q
RATE = 13  # of twist, 1/s
COUPLES = 14
# Of Line.torsion, and of State.turn, as kernels.march.zone_torque has them.
ZONE_FIRST, ZONE_LAST, ZONE_COMPLIANCE, ZONE_FREE, ZONE_TAU = range(5)
ZONE_TURN, ZONE_TORQUE = 0, 1


@inner
def couples(line):
    """Whether tension makes a torque anywhere in a line."""
    return line.tension_twist.shape[0] > 0


@inner
def twist_by_tension(line, T, i):
    """s of the element at node i."""
    s = 0.0
    if i > 0:
        s += line.tension_twist[i - 1] * T[i - 1]
    if i < T.shape[0]:
        s += line.tension_twist[i] * T[i]
    return s


@inner
def twist_of_line(line, T):
    """Twist, rad, of all of a line by the tensions T (N,)."""
    s = 0.0
    for c in range(line.tension_twist.shape[0]):
        s += 2.0 * line.tension_twist[c] * T[c]
    return s


@inner
def rest_strain(line, T, i):
    """Strain without stress of the element at node i under the tensions T (N,)."""
    k = get3(line.k0, i)
    if couples(line):
        k = (k[0], k[1], k[2] - twist_by_tension(line, T, i))
    return k


@inner
def axis_of_twist(Ra, Rb):
    """p, and the log strain."""
    k = log_rotation(relative_rotation(Ra, Rb))
    g, _ = jacobian_functions(dot(k, k))
    P = inverse_left_jacobian(k, g)
    return mat_vec(Ra, (P[6], P[7], P[8])), k


class Side(NamedTuple):
    """A side of an element: frame, direction and 1/length of the cell there; 1/length 0 of an end."""

    R: Any
    d: Any
    il: float


Z3 = (0.0, 0.0, 0.0)
Z9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SIDE, RATES = Side(Z9, Z3, 0.0), (Z3, Z9, Z3)  # examples


@linked_kernel(lambda: (ROWS, blank_line(1), np.zeros(1), 0, SIDE, SIDE, RATES, RATES, 0.0))
def note_element(couple, line, T, i, before, after, rates_before, rates_after, tau):
    """What the rows of an element at node i need.

    before, after: its `Side`s; rates: angular velocity (1/s) of each and its derivatives by chord and spin.
    """
    for j in range(COUPLES):
        couple[i, j] = 0.0
    kb = line.kb[i, 2]
    if turns_freely(get3(line.kb, i), get3(line.k0, i)) or kb == 0.0:
        return
    (Ra, da, ila), (Rb, db, ilb) = before, after
    p, k = axis_of_twist(Ra, Rb)
    q = scale(kb, p)
    (wa, Wa, pa), (wb, Wb, pb) = rates_before, rates_after
    A, a = scale(ilb, cross(q, db)), dot(q, db)
    B, b = scale(ila, cross(q, da)), dot(q, da)
    y = (wb[0] - wa[0], wb[1] - wa[1], wb[2] - wa[2])
    rate = dot(p, y)
    if tau > 0.0:
        t = scale(tau, q)
        A, a = (
            add(A, (dot(t, (Wb[0], Wb[3], Wb[6])), dot(t, (Wb[1], Wb[4], Wb[7])), dot(t, (Wb[2], Wb[5], Wb[8])))),
            (a + dot(t, pb)),
        )
        u = cross(y, t)
        B = add(B, (dot(t, (Wa[0], Wa[3], Wa[6])), dot(t, (Wa[1], Wa[4], Wa[7])), dot(t, (Wa[2], Wa[5], Wa[8]))))
        B, b = add(B, scale(ila, cross(u, da))), b + dot(t, pa) + dot(u, da)
    for j in range(3):
        couple[i, AXIS + j], couple[i, AFTER + j], couple[i, BEFORE + j] = q[j], A[j], B[j]
    couple[i, SPIN_AFTER], couple[i, SPIN_BEFORE], couple[i, STIFF], couple[i, RATE] = a, b, kb, rate
    couple[i, TORQUE] = kb * (k[2] - line.k0[i, 2] + twist_by_tension(line, T, i) + tau * rate)


@linked_kernel(lambda: (ROWS, blank_line(1), 0, Z3, Z3, 0.0))
def note_end_torque(couple, line, i, moment, d, il):
    """At a node without element: of a rod's end the torque of the moment (N m) that is given; d, il: of its cell.

    What a catenary zone passes is known before the march (kernels.march.zone_torque).
    """
    n = line.h.shape[0]
    torque = couple[i, TORQUE]
    for j in range(COUPLES):
        couple[i, j] = 0.0
    if line.torsion.shape[0] > 0:
        couple[i, TORQUE] = torque
    elif (i == 0 or i == n) and line.spin[min(i, n - 1)]:
        couple[i, TORQUE] = dot(moment, d)
        for j in range(3):
            x = il * (moment[j] - d[j] * couple[i, TORQUE])
            couple[i, AFTER + j if i == 0 else BEFORE + j] = x if i == 0 else -x


@linked_kernel(lambda: (ROWS, blank_line(1), 0, 0.0), (0.0, 0.0))
def couple_length(couple, line, i, T):
    """Of the law of length of cell i: what its compliance (m/N) and its gap (m) get."""
    g = line.tension_twist[i]
    more = 2.0 * g * line.tension_torque[i]
    return more, more * T - g * (couple[i, TORQUE] + couple[i + 1, TORQUE])


@inner
def turn_rate(couple, line, i):
    """Rate of the twist over cell i of a rod, 1/s: half of that of each element, of one at an end all."""
    n = line.h.shape[0]
    return couple[i, RATE] * (1.0 if i == 0 else 0.5) + couple[i + 1, RATE] * (1.0 if i + 1 == n else 0.5)


@inner
def damped_compliance(line, state, i, along):
    """Compliance, m/N, of cell i against damping, without twist; along: rate, m/s, of what its tension stretches."""
    return line.h[i] * softness_of_damping(line, state, i, line.tau[i] * along / line.h[i])


@linked_kernel(lambda: (ROWS, blank_line(1), blank_state(1), 0, 0.0), 0.0)
def damping_loss(couple, line, state, i, along):
    """Power, W, that damping takes out of cell i but for the torsion of its elements; along: rate of its length, m/s."""
    if line.spin[i]:
        along += line.tension_torque[i] * turn_rate(couple, line, i)
    hck = damped_compliance(line, state, i, along)
    if not line.spin[i]:
        hck += 2.0 * line.tension_twist[i] * line.tension_torque[i]
    return line.tau[i] * along * along / hck


@inner
def twist_of(line, i):
    """g of cell i; 0 where there is none."""
    return line.tension_twist[i] if 0 <= i < line.h.shape[0] else 0.0


@linked_kernel(lambda: (np.zeros(1), ROWS, blank_line(1), ROWS, 0))
def couple_rows(W, couple, line, e, i):
    """Put the tensions into the balance of node i and the spin of cell i, and the twist into the length of cell i-1.

    In the first two an element knows the tension of the cell before it, for both (of the start, that of the first).
    """
    n = line.h.shape[0]
    g1, g2, g3, g4 = twist_of(line, i - 2), twist_of(line, i - 1), twist_of(line, i), twist_of(line, i + 1)
    q = get3(couple, i)
    s0, s1, s2 = g1 + (g2 if i > 1 else 0.0), g2 + (g3 if i > 0 else 0.0), g3 + g4  # of elements i-1, i, i+1
    own = 10 if i > 0 else 15  # column of element i's
    if i > 0:  # force of the cell before, taken from the balance; its length
        d, _, il = chord(get3(e, i - 1))
        before, first = get3(couple, i - 1), 5 if i > 1 else 10
        here, there = scale(il, cross(d, before)), scale(il, cross(d, q))
        if i == 1:
            s0 = g2
        for j in range(3):
            o = (j + 1) * WIDTH
            W[o + first] += s0 * here[j]
            W[o + 10] -= s1 * there[j]
        couple_length_row(W, couple, i, g1, g2, g3)
    if i < n:  # force and spin of the cell after
        d, _, il = chord(get3(e, i))
        after = get3(couple, i + 1)
        here, there = scale(il, cross(d, q)), scale(il, cross(d, after))
        if i == 0:
            s1 = g3
        for j in range(3):
            o = (j + 1) * WIDTH
            W[o + own] -= s1 * here[j]
            W[o + 15] += s2 * there[j]
        if line.spin[i]:
            W[4 * WIDTH + own] -= s1 * dot(d, q)
            W[4 * WIDTH + 15] += s2 * dot(d, after)


@inner
def couple_length_row(W, couple, i, g1, g2, g3):
    """Put the torques at both of its nodes into the length of cell i-1."""
    a, b = couple[i - 1], couple[i]
    for j in range(3):
        W[1 + j] += g2 * a[BEFORE + j]
        W[6 + j] += g2 * (b[BEFORE + j] - a[AFTER + j] - a[BEFORE + j])
        W[11 + j] += g2 * (a[AFTER + j] - b[AFTER + j] - b[BEFORE + j])
        W[16 + j] += g2 * b[AFTER + j]
    W[4] -= g2 * a[SPIN_BEFORE]
    W[5] += g2 * g1 * a[STIFF]
    W[9] += g2 * (a[SPIN_AFTER] - b[SPIN_BEFORE])
    W[10] += g2 * g2 * (a[STIFF] + b[STIFF])
    W[14] += g2 * b[SPIN_AFTER]
    W[15] += g2 * g3 * b[STIFF]


@inner
def stretch_energy(line, i, longer, low, high):
    """Energy, J, of stretch of cell i longer by `longer` (m) beyond that of the twist, with torques at both ends, N m.

    Torsion Q^2/(2 kb) of the elements beside it is not in it.
    """
    g = line.tension_twist[i]
    hck = line.h[i] * line.ck[i] + 2.0 * g * line.tension_torque[i]
    turn = g * (low + high)
    T = (longer + turn) / hck
    return 0.5 * hck * T * T - T * turn if hck > 0.0 else 0.0


@inner
def stretch_factor(line, state, c, torque):
    """Length of cell c over its unstretched length under its tension and a torque (N m)."""
    strain, _ = strain_and_energy_at(line, state, c, state.T[c])
    if couples(line):
        strain += 2.0 * line.tension_twist[c] / line.h[c] * (line.tension_torque[c] * state.T[c] - torque)
    return 1.0 + strain


@inner
def zone_of(line, c):
    """The catenary zone that cell c is of and that a torque passes through; -1: none."""
    for z in range(line.torsion.shape[0]):
        if line.torsion[z, ZONE_FIRST] <= c < line.torsion[z, ZONE_LAST]:
            return z
    return -1


@inner
def twist_of_tensions(line, T, first, z):
    """Twist, rad, of zone z by tensions: T[c + first] of cell c."""
    total, g = 0.0, line.tension_twist
    if couples(line):
        a, b = int(line.torsion[z, ZONE_FIRST]), int(line.torsion[z, ZONE_LAST])
        for c in range(a, b):
            total += 2.0 * g[c] * T[c + first]
        if a > 0:
            total += g[a - 1] * T[a - 1 + first]
        if b < line.h.shape[0]:
            total += g[b] * T[b + first]
    return total


@kernel
def torque_beside(line, state, c):
    """Torque, N m, at a node of cell c, where tension makes one; else 0."""
    if not couples(line):
        return 0.0
    z = zone_of(line, c)
    if z >= 0:
        return state.turn[z, ZONE_TORQUE]
    n = line.h.shape[0]
    i = c if c > 0 and line.element[c] else c + 1
    if i >= n or not line.element[i]:
        return 0.0
    d, _, _ = chord(get3(state.e, i - 1))
    dn, _, _ = chord(get3(state.e, i))
    _, k = axis_of_twist(frame(get3(state.a1, i - 1), d), frame(get3(state.a1, i), dn))
    return line.kb[i, 2] * (k[2] - rest_strain(line, state.T, i)[2])


@inner
def compliance(line, i):
    """Compliance of cell i that turns freely, 1/N."""
    c = line.ck[i]
    if couples(line):
        c += 2.0 * line.tension_twist[i] * line.tension_torque[i] / line.h[i]
    return c


@inner
def rate_of_zone(line, state, z):
    """Rate, 1/s, of the turn of zone z, of which damping makes a part of its torque."""
    row, turn = line.torsion[z], state.turn[z]
    twist = turn[ZONE_TURN] - row[ZONE_FREE] + twist_of_tensions(line, state.T, 0, z)
    return (row[ZONE_COMPLIANCE] * turn[ZONE_TORQUE] - twist) / row[ZONE_TAU] if row[ZONE_TAU] > 0.0 else 0.0


@inner
def rate_of_strain(line, state, couple, i, along):
    """x' of cell i, 1/s, by the rate of its length, m/s; and whether it turns freely.  A zone's twist is that of a torque."""
    c, h = line.tension_torque[i], line.h[i]
    if line.spin[i]:
        return (along + c * turn_rate(couple, line, i)) / h, False
    z = zone_of(line, i)
    if z < 0:
        return along / h, c != 0.0
    return (
        along + 2.0 * line.tension_twist[i] / line.torsion[z, ZONE_COMPLIANCE] * rate_of_zone(line, state, z)
    ) / h, False


@inner
def damping_of(line, state, couple, i, along):
    """`late` of cell i, T - Te (N), and what a cell that turns freely stores otherwise (J)."""
    if not line.bits & STIFFNESS_DAMPING or not line.ck[i] > 0.0:
        return 0.0, 0.0, 0.0
    rate, free = rate_of_strain(line, state, couple, i, along)
    late, g, c = line.tau[i] * rate, line.tension_twist[i], line.tension_torque[i]
    soft = softness_of_damping(line, state, i, late)
    if free:
        late *= line.h[i] * soft / (line.h[i] * soft + 2.0 * g * c)
        soft = softness_of_damping(line, state, i, late)
    damped = late / soft
    return late, damped, g * c * damped * damped if free else 0.0


@inner
def lost_by_peak(line, old, new, couple, i, dt, damped):
    """Work per length, J/m, that a cell which remembers its peak has lost in a step: as `lost_in_step`.

    damped: N, of the tension, at its end.  What is of damping on average is that of the mean rate of the chord.
    """
    before, after = old.T[i] - old.slow[i], new.T[i] - new.slow[i]
    if damped != 0.0:
        e, e_before = get3(new.e, i), get3(old.e, i)
        along = (math.sqrt(dot(e, e)) - math.sqrt(dot(e_before, e_before))) / dt
        late, _, _ = damping_of(line, new, couple, i, along)
        E_before, _ = stiffness_at(line.law, i, old.slow[i])
        E, _ = stiffness_at(line.law, i, new.slow[i])
        before, after = before - E_before * late, after - E * late
    return lost_in_step(line, old, new, i, peak_before(line.law, i, old), before, after)


@linked_kernel(on_line(blank_state(1), blank_state(1), no_work(), 0.0, 0.0))
def linearise_stretch(line, old, new, work, dt, t):
    """As kernels.laws.axial_law.linearise_law; where tension makes a torque, with what that changes."""
    linearise_law(line, old, new, work, dt, t)
    if couples(line):
        count_twist(line, old, new, work, dt, t)


@linked_kernel(on_line(blank_state(1), blank_state(1), no_work(), 0.0, 0.0))
def count_twist(line, old, new, work, dt, t):
    """Energy, work and losses of laws that have been linearised, with the twist.

    Rates of twist are those of the last march (work.couple); what damping takes out of stretch is booked there.
    """
    law, energy, lost, couple = line.law, 0.0, 0.0, work.couple
    for i in range(line.h.shape[0]):
        law[i, LOSS] = 0.0
        if not line.ck[i] > 0.0:
            continue
        e, h, T = get3(new.e, i), line.h[i], new.T[i]
        l = math.sqrt(dot(e, e))
        along = dot(e, sub(get3(new.v, i + 1), get3(new.v, i))) / l
        late, damped, spare = damping_of(line, new, couple, i, along)
        _, stored = strain_and_energy_at(line, new, i, T - damped)
        strain = line.ck[i] * T + law[i, SHIFT] - late
        energy += T * (l - h * (1.0 + strain)) + h * stored + spare
        energy -= line.tension_twist[i] * line.tension_torque[i] * T * T
        if dt > 0.0 and law[i, CREPT] > 0.0:
            lost += 0.5 * h * (old.T[i] + T) * (law[i, CREPT] - crept(law, i, t - dt))
        if not has_law(line, i) or not is_dynamic(line, i):
            continue
        if not law[i, WORKING] > 0.0:
            law[i, LOSS] = h * sliding_power(line, new, i, T - damped - new.slow[i])
        elif dt > 0.0:
            lost += h * lost_by_peak(line, old, new, couple, i, dt, damped)
    work.report[STRETCH_ENERGY] = energy
    work.report[LOST_WORK] = -lost
