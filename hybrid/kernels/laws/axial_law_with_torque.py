"""Cells whose tension is no multiple of their strain, in a line in which tension makes a torque (docs/theory.md, 15).

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

from hybrid.kernels.algebra.rotations import dot, get3, sub
from hybrid.kernels.laws.axial_law import (
    CREPT,
    LOSS,
    SHIFT,
    WORKING,
    crept,
    follow_law,
    has_law,
    is_dynamic,
    lost_in_step,
    peak_before,
    sliding_power,
    softness_of_damping,
    stiffness_at,
    strain_and_energy_at,
)
from hybrid.kernels.laws.tension_torque import (
    ZONE_COMPLIANCE,
    ZONE_FREE,
    ZONE_TAU,
    ZONE_TORQUE,
    ZONE_TURN,
    turn_rate,
    twist_of_tensions,
    zone_of,
)
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.report import LOST_WORK, STIFFNESS_DAMPING, STRETCH_ENERGY


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


@kernel
def follow_law_with_torque(line, old, new, work, dt, t):
    """As kernels.laws.axial_law.follow_law, which linearises the laws; energy, work and losses with the twist.

    Rates of twist are those of the last march (work.couple); what damping takes out of stretch is booked there.
    """
    follow_law(line, old, new, work, dt, t)
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
    return 0
