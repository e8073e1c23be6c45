"""Energies of a state, powers into the cable after a step, their work, and end forces.

They follow from the same laws the solver uses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hybrid.kernels.algebra.rotations import add, cross, dot, frame, get3, get9, scale, sub
from hybrid.kernels.laws.bending_law import bending_at, damped_bending_at, energy_share, stored_by_slip
from hybrid.kernels.laws.element import chord, strain_of_element, turning
from hybrid.kernels.laws.tension_torque import couples, rest_strain, stretch_energy
from hybrid.kernels.machine.compile import inner, linked_kernel
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.march.zone_torque import FIRST, LAST, TORQUE
from hybrid.kernels.state.books import CONTACT, FRICTION, HYSTERESIS, OBSTACLE, RATES, WORKS
from hybrid.kernels.state.report import (
    ADDED_MASS_POWER,
    AXIAL_LAW,
    BENDING_SLIP,
    CONTACT_WORK,
    DRAG_POWER,
    FORCE_A,
    FRICTION_WORK,
    LOST_WORK,
    MASS_DAMPING_POWER,
    MOMENT_A,
    NET_A,
    OBSTACLE_WORK,
    ROTARY,
    SEABED_ENERGY,
    SELF_CONTACT,
    SELF_FRICTION_WORK,
    STIFFNESS_DAMPING,
    STIFFNESS_DAMPING_POWER,
    TOUCHES,
    WAVE_POWER,
)
from hybrid.kernels.state.state import ROWS, Floats, no_ends, on_line


@inner
def stretch_of(line, e, i, low, high):
    """Energy of stretch of cell i between two torques (N m), where tension makes a torque."""
    _, l, _ = chord(get3(e, i))
    return stretch_energy(line, i, l - line.h[i], low, high)


class Observed(NamedTuple):
    """What a state means, to be filled by `observe`.

    M: (N+1, 3) N m inertial, moments of the part after a node on the part before; strain: (N+1, 3) rad, log strains in
    the frame of the cell before; energy: (5,) J, kinetic (structure, with rotary inertia), bending, torsion, stretch
    (not of a line with an axial law, which reports it); gravity is left to the caller.
    """

    M: Floats
    strain: Floats
    energy: Floats


@linked_kernel(on_line(no_ends(), ROWS, ROWS, ROWS, np.zeros(1), np.zeros(1), ROWS, Observed(ROWS, ROWS, np.zeros(5))))
def observe(line, ends, e, v, a1, w, T, turn, observed):
    """Fill `Observed` with the moments, strains and energies of a state.

    T: (N,) N and turn: (K, 3) as of a State are read where tension makes a torque; the torsion of catenary zones is left
    to the caller.
    """
    M, strain, energy = observed
    n = e.shape[0]
    coupled, torque, zone = couples(line), 0.0, 0
    stretches = coupled and not line.bits & AXIAL_LAW
    for j in range(4):
        energy[j] = 0.0
    for i in range(n + 1):
        vi = get3(v, i)
        energy[0] += 0.5 * line.mass[i] * dot(vi, vi)
        left = i > 0
        right = i < n
        M[i, 0], M[i, 1], M[i, 2] = 0.0, 0.0, 0.0
        strain[i, 0], strain[i, 1], strain[i, 2] = 0.0, 0.0, 0.0
        torque_before, torque = torque, 0.0
        if right:
            ei = get3(e, i)
            d, l, il = chord(ei)
            if (
                line.ck[i] > 0.0 and not coupled and not line.bits & AXIAL_LAW
            ):  # from the stretch, because a damped cell's tension is more than elastic
                longer = l - line.h[i]
                energy[3] += 0.5 * longer * longer / (line.h[i] * line.ck[i])
            if line.bits & ROTARY and line.spin[i]:
                d1, _ = turning(d, il, sub(get3(v, i + 1), vi), 0.0)
                energy[0] += 0.5 * line.rotary[i] * dot(d1, d1) + 0.5 * line.polar[i] * w[i] * w[i]
        if not line.element[i]:
            if i == 0 and line.spin[0]:
                m = get3(ends.moment, 0)
                M[i, 0], M[i, 1], M[i, 2] = -m[0], -m[1], -m[2]
            if i == n and line.spin[n - 1]:
                M[i, 0], M[i, 1], M[i, 2] = get3(ends.moment, 1)
            if coupled:
                zone += zone < turn.shape[0] and i > line.torsion[zone, LAST]
                if zone < turn.shape[0] and i >= line.torsion[zone, FIRST]:
                    torque = turn[zone, TORQUE]
                elif i == 0 or i == n:
                    d, _, _ = chord(get3(e, min(i, n - 1)))
                    torque = dot(get3(M, i), d)
                if left and stretches:
                    energy[3] += stretch_of(line, e, i - 1, torque_before, torque)
            continue
        Ra, Rb = get9(ends.frame, 0), get9(ends.frame, 1)
        wa, wb = get3(ends.spin, 0), get3(ends.spin, 1)
        if left:
            d, _, il = chord(get3(e, i - 1))
            Ra = frame(get3(a1, i - 1), d)
            d1, _ = turning(d, il, sub(vi, get3(v, i - 1)), 0.0)
            wa = add(cross(d, d1), scale(w[i - 1], d))
        if right:
            d, _, il = chord(get3(e, i))
            Rb = frame(get3(a1, i), d)
            d1, _ = turning(d, il, sub(get3(v, i + 1), vi), 0.0)
            wb = add(cross(d, d1), scale(w[i], d))
        kb, k0 = get3(line.kb, i), rest_strain(line, T, i)
        k = strain_of_element(Ra, Rb, kb, get3(line.k0, i), i)
        x = sub(k, k0)
        share = energy_share(line, i, math.sqrt(x[0] * x[0] + x[1] * x[1]))
        energy[1] += 0.5 * share * (kb[0] * x[0] * x[0] + kb[1] * x[1] * x[1])
        energy[1] += stored_by_slip(line, i, x[0], x[1])
        energy[2] += 0.5 * kb[2] * x[2] * x[2]
        if coupled:
            torque = kb[2] * x[2]
            if left and stretches:
                energy[3] += stretch_of(line, e, i - 1, torque_before, torque)
        if line.bits & STIFFNESS_DAMPING:
            tau = 0.5 * (line.tau[max(i - 1, 0)] + line.tau[min(i, n - 1)])
            m, _, _, _ = damped_bending_at(line, i, Ra, Rb, kb, k0, tau, wa, wb)
        else:
            m, _ = bending_at(line, i, Ra, Rb, kb, k0)
        M[i, 0], M[i, 1], M[i, 2] = m
        strain[i, 0], strain[i, 1], strain[i, 2] = k


START, APPLIED = 0, 2


@inner
def holds_torque(line, k):
    """Whether end k holds a catenary zone that a torque passes through."""
    zones = line.torsion.shape[0]
    if zones == 0:
        return False
    return line.torsion[0, FIRST] == 0.0 if k == 0 else line.torsion[zones - 1, LAST] == line.h.shape[0]


@inner
def find_powers(line, ends, velocity, state, report, power):
    """Power, W, into the cable by start, end, applied loads, drag, damping by mass and stiffness, added mass, waves.

    velocity: (2, 3) m/s of the ends; report: of the state (kernels.state.report).
    """
    n = line.h.shape[0]
    power[0], power[1], power[APPLIED] = 0.0, 0.0, 0.0
    power[3], power[4], power[5] = -report[DRAG_POWER], -report[MASS_DAMPING_POWER], -report[STIFFNESS_DAMPING_POWER]
    power[6], power[7] = -report[ADDED_MASS_POWER], report[WAVE_POWER]
    for k in range(2):
        node, cell = k * n, k * (n - 1)
        at = NET_A + 3 * k
        if ends.held[k]:
            power[k] -= dot((report[at], report[at + 1], report[at + 2]), get3(velocity, k))
        if not ends.held[k] or ends.held[k] == JOINED:  # of a point that the line carries, the loads on it
            power[APPLIED] += dot(get3(ends.force, k), get3(state.v, node))
        at = MOMENT_A + 3 * k
        if line.element[node] or holds_torque(line, k):
            turning = dot((report[at], report[at + 1], report[at + 2]), get3(ends.spin, k))
            power[k] += turning if k else -turning
        elif line.spin[cell]:
            e, e1 = get3(state.e, cell), sub(get3(state.v, cell + 1), get3(state.v, cell))
            square = dot(e, e)
            omega = add(scale(1.0 / square, cross(e, e1)), scale(state.w[cell] / math.sqrt(square), e))
            power[APPLIED] += dot(get3(ends.moment, k), omega)


@inner
def loses(line):
    """Whether stretch or bend of a line may lose work that a step reports: ropes that remember, layers that slip."""
    return line.bits & (AXIAL_LAW | BENDING_SLIP) != 0


@inner
def book_work(line, dt, report, books):
    """Work, J, of a step of dt: by the mean of its powers; that of the seabed comes by way, not by power."""
    power, work, clock = books.power, books.work, books.clock
    for k in range(WORKS):
        work[1, k] = work[0, k]
    half = 0.5 * dt
    for k in range(RATES):
        work[0, k] += half * (power[1, k] + power[0, k])
    if line.bits & TOUCHES:
        work[0, CONTACT] += report[CONTACT_WORK] + report[SEABED_ENERGY] - clock.stored
        work[0, FRICTION] += report[FRICTION_WORK]
        clock.stored = report[SEABED_ENERGY]
    if line.moved.shape[0] > 0:
        work[0, OBSTACLE] += report[OBSTACLE_WORK]
    if loses(line):
        work[0, HYSTERESIS] += report[LOST_WORK]
    if line.bits & SELF_CONTACT:
        work[0, FRICTION] += report[SELF_FRICTION_WORK]


@inner
def pull(report, k):
    """Magnitude, N, of the force of the line on what holds or loads an end, or is there."""
    at = FORCE_A + 3 * k
    f = (report[at], report[at + 1], report[at + 2])
    return math.sqrt(dot(f, f))
