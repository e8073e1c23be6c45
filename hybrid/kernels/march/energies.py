"""What a state means: moments, energies and powers, from the same laws the solver uses."""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.algebra.rotations import add, cross, dot, frame, get9, scale, sub
from hybrid.kernels.laws.bending_law import bending_at, damped_bending_at, energy_share
from hybrid.kernels.laws.bending_slip import stored_by_slip
from hybrid.kernels.laws.cell import chord, turning
from hybrid.kernels.laws.element import strain_of_element
from hybrid.kernels.laws.tension_torque import couples, rest_strain, stretch_energy
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.assembly import get3
from hybrid.kernels.march.zone_torque import FIRST, LAST, TORQUE
from hybrid.kernels.state.report import AXIAL_LAW, ROTARY, STIFFNESS_DAMPING
from hybrid.kernels.state.state import Floats


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


@kernel
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
        k = strain_of_element(Ra, Rb, kb, get3(line.k0, i))
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
