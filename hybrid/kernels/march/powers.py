"""Powers into the cable after a step, the work they do, and the pull at its ends."""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.march.zone_torque import FIRST, LAST
from hybrid.kernels.state.books import CONTACT, FRICTION, HYSTERESIS, OBSTACLE, RATES, WORKS
from hybrid.kernels.state.report import (
    ADDED_MASS_POWER,
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
    SEABED_ENERGY,
    SELF_CONTACT,
    SELF_FRICTION_WORK,
    STIFFNESS_DAMPING_POWER,
    TOUCHES,
    WAVE_POWER,
)

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
    return line.law_at.shape[0] > 0 or (line.bits & BENDING_SLIP) != 0


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
