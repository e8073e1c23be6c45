"""Vortex-induced vibration across a line and its flow: lift whose phase follows the motion (synchronisation).

    symbol       meaning                                                                     unit
    u            velocity of the node relative to the water, across the line un = u - (u.d) d  m/s
    e            direction of the lift, d x un/|un|                                          -
    phi          phase of the lift                                                           rad
    f            frequency of shedding as a part of |un|/D                                   -
    v, a         velocity and acceleration of the node along e                               m/s, m/s2

The lift on half a cell is (h/2) rho/2 D Cv |un|^2 cos(phi) e, and d phi/dt = 2 pi f |un|/D with
f = center + (high - center) S for S > 0, center + (center - low) S else, S = sin(phi_v - phi), where phi_v is the phase of
the motion, atan2(-a/a_rms, v/v_rms): a lift behind the motion is shed faster, one before it slower.

The phase at the end of a step follows from the state at its beginning alone, so that Newton's method sees a given one and
a step that is taken back leaves nothing behind.

M. J. Thorsen, S. Saevik, C. M. Larsen: A simplified method for time domain simulation of cross-flow vortex-induced
vibrations. J. Fluids and Structures 49 (2014) 135-148; as it is in MoorDyn 2.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    get3,
    hat,
    madd,
    mat_mat,
    mat_vec,
    mscale,
    msub,
    outer,
    project,
    scale,
    sub,
)
from hybrid.kernels.laws.drag_law import split as split_velocity
from hybrid.kernels.laws.element import Chord, chord
from hybrid.kernels.laws.water import current_at, wetted_stretch
from hybrid.kernels.machine.compile import inner, linked_kernel
from hybrid.kernels.state.report import DRAG_POWER, FLOW, REPORT_SIZE, SURFACE, WAVES
from hybrid.kernels.state.state import blank_state, in_sea

# Columns of Line.wake_law: lift of the half cells before and after a node, rho/2 D Cv h/2 (kg/m); diameter (m; 0: there
# are no vortices); frequencies; time over which the lift grows (s); phase at the start (rad).
LIFT_A, LIFT_B, DIAMETER, CENTER, LOW, HIGH, RAMP, OFFSET = range(8)
# Columns of State.wake: phase since the start (rad); means of v^2 and a^2; cosine of the phase, as far as lift has grown.
PHASE, MEAN_V, MEAN_A, SHARE = range(4)
# Periods of shedding, of the frequency USUAL |u|/D, over which means are taken.
PERIODS, USUAL = 8.0, 0.17
# Of the speed of the flow: a motion far below it has no phase, or round-off would decide how vortices begin.
STILL, LEAST = 1e-3, 0.1

split = inner(split_velocity)

Z3 = (0.0, 0.0, 0.0)
Z9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CHORD = Chord(Z3, 0.0, 0.0)


@inner
def mean_direction(e, i):
    """Direction of the line at node i: the mean of the chords beside it."""
    n = e.shape[0]
    a, _, _ = chord(get3(e, max(i - 1, 0)))
    b, _, _ = chord(get3(e, min(i, n - 1)))
    t = add(a, b)
    size = math.sqrt(dot(t, t))
    return scale(1.0 / size, t) if size > 1e-9 else b


@inner
def relative_velocity(line, sea, i, z, v):
    """Velocity of node i at height z relative to the water, and the slope of the current by height."""
    u, slope = v, (0.0, 0.0, 0.0)
    if line.bits & FLOW:
        U, slope = current_at(sea.z, sea.current, sea.now[1], z)
        u = sub(u, U)
    if line.bits & WAVES:
        u = sub(u, get3(sea.flow, i))
    return u, slope


@inner
def frequency(law, i, phase, v, a, mean_v, mean_a, speed):
    """Frequency of shedding as a part of |u|/D, by how the motion and the lift are in phase."""
    usual = 2.0 * math.pi * law[i, CENTER] * speed / law[i, DIAMETER]  # 1/s
    x = v / max(math.sqrt(mean_v), STILL * speed)
    y = -a / max(math.sqrt(mean_a), STILL * speed * usual)
    S = (y * math.cos(phase) - x * math.sin(phase)) / max(math.sqrt(x * x + y * y), LEAST)
    return law[i, CENTER] + S * (law[i, HIGH] - law[i, CENTER] if S > 0.0 else law[i, CENTER] - law[i, LOW])


@linked_kernel(in_sea(blank_state(1), blank_state(1), 0.0))
def advance_wake(line, sea, old, new, dt):
    """Phases and means after a step of dt (s) from `old`, into new.wake."""
    law = line.wake_law
    for i in range(law.shape[0]):
        for k in range(4):
            new.wake[i, k] = old.wake[i, k]
        D = law[i, DIAMETER]
        if not D > 0.0:
            continue
        d, v = mean_direction(old.e, i), get3(old.v, i)
        u, _ = relative_velocity(line, sea, i, old.r[i, 2], v)
        _, un, square = split(u, d)
        speed = math.sqrt(square)
        if speed > 0.0:
            e = scale(1.0 / speed, cross(d, un))
            along, gains = dot(v, e), dot(get3(old.vd, i), e)
            part = -math.expm1(-dt * USUAL * speed / (PERIODS * D))
            mean_v = old.wake[i, MEAN_V] + part * (along * along - old.wake[i, MEAN_V])
            mean_a = old.wake[i, MEAN_A] + part * (gains * gains - old.wake[i, MEAN_A])
            f = frequency(law, i, old.wake[i, PHASE] + law[i, OFFSET], along, gains, mean_v, mean_a, speed)
            new.wake[i, PHASE] = old.wake[i, PHASE] + dt * 2.0 * math.pi * f * speed / D
            new.wake[i, MEAN_V], new.wake[i, MEAN_A] = mean_v, mean_a
        x = min(sea.now[0] / law[i, RAMP], 1.0) if law[i, RAMP] > 0.0 else 1.0
        grown = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        new.wake[i, SHARE] = grown * math.cos(new.wake[i, PHASE] + law[i, OFFSET])


@inner
def half_cell_lift(u, d, il, c):
    """f = c |un| d x u on half a cell, B = df/du and L = df/de."""
    ut, un, square = split(u, d)
    s = math.sqrt(square)
    i = 1.0 / s if s > 0.0 else 0.0
    across = cross(d, u)
    B = madd(outer(scale(c * i, across), un), mscale(c * s, hat(d)))
    L = madd(outer(scale(c * i * ut, across), un), mscale(c * s, mat_mat(hat(u), project(d))))
    return scale(c * s, across), B, mscale(-il, L)


@inner
def lift_on(line, sea, i, side, z, u, slope, c, near, cv):
    """The lift on the half cell beside node i on a side (-1, 1): f, D (dr_i), L (chord)."""
    d, l, il = near
    f, B, L = half_cell_lift(u, d, il, c)
    D = mscale(cv, B)
    if line.bits & FLOW:
        g = mat_vec(B, slope)
        D = msub(D, (0.0, 0.0, g[0], 0.0, 0.0, g[1], 0.0, 0.0, g[2]))
    if line.bits & SURFACE:  # how the wetted part changes is left out: it is as slow as the line rises
        cell = i - 1 if side < 0.0 else i
        eta = sea.surface + (sea.flow[i, 6] if line.bits & WAVES else 0.0)
        x = (eta - z) / line.diameter[cell] + 0.5
        wet, _, _ = wetted_stretch(x, x - side * 0.5 * l * d[2] / line.diameter[cell])
        return scale(wet, f), mscale(wet, D), mscale(wet, L)
    return f, D, L


@linked_kernel(in_sea(0, 0.0, blank_state(1), CHORD, CHORD, 0.0, np.zeros(REPORT_SIZE)), (Z3, Z9, Z9, Z9))
def lift_at(line, sea, i, z, state, before, after, cv, report):
    """The lift on node i: F, and its derivatives D (dr_i), GL, GR (chord before, after); its work is booked with drag."""
    law, share, v = line.wake_law, state.wake[i, SHARE], get3(state.v, i)
    F, D, GL, GR = Z3, Z9, Z9, Z9
    u, slope = relative_velocity(line, sea, i, z, v)
    if i > 0 and law[i, LIFT_A] > 0.0:
        F, D, GL = lift_on(line, sea, i, -1.0, z, u, slope, share * law[i, LIFT_A], before, cv)
    if i < line.h.shape[0] and law[i, LIFT_B] > 0.0:
        f, Df, GR = lift_on(line, sea, i, 1.0, z, u, slope, share * law[i, LIFT_B], after, cv)
        F, D = add(F, f), madd(D, Df)
    report[DRAG_POWER] -= dot(F, v)
    return F, D, GL, GR
