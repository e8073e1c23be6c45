"""A change of cells in a run: the state goes to the new ones, lengths go on smoothly, and the energy is known."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub
from hybrid.kernels.laws.axial_law import stretch_energy
from hybrid.kernels.laws.cell import chord
from hybrid.kernels.laws.obstacles import stored_in_contact
from hybrid.kernels.laws.tension_torque import stretch_factor, torque_beside
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.zone_torque import twist_energy
from hybrid.kernels.mesh.cell_lengths import arc_less_chord
from hybrid.kernels.mesh.remesh import AFTER, BEFORE, NUMBERS, RELAXES, TIME
from hybrid.kernels.mesh.stiffness_ramp import shares, soften
from hybrid.kernels.mesh.zone_step import Zones, blank_zones
from hybrid.kernels.mesh.zone_transfer import Transfer, blank_transfer, old_cell, put3, transfer_state
from hybrid.kernels.state.report import AXIAL_LAW, PLANAR, TOUCHES
from hybrid.kernels.state.state import Ends, Floats, Sea, no_ends, no_sea


class SwitchJob(NamedTuple):
    """A transfer with what is around it."""

    transfer: Transfer
    ends: Ends
    sea: Sea
    target_sea: Sea
    zones: Zones
    target_zones: Zones
    numbers: Floats  # (NUMBERS,)
    guided: Floats  # (2,) 1 where an end holds the tangent, and with it a frame


def blank_switch_job() -> SwitchJob:
    """A job with the types that every one has."""
    zones = blank_zones(1, 1)
    return SwitchJob(blank_transfer(), no_ends(), no_sea(1), no_sea(1), zones, zones, np.zeros(NUMBERS), np.zeros(2))


read = reader(blank_switch_job())


@inner
def energy(line, sea, ends, state, zones):
    """All energy of a state, J; its strains into those of zones."""
    observed = Observed(zones.moment, zones.strain[1], zones.energy)
    observe(line, ends, state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    total = zones.energy[0] + zones.energy[1] + zones.energy[2] + zones.energy[3] + twist_energy(line, state)
    if line.bits & AXIAL_LAW:
        total += stretch_energy(line, state)
    for i in range(state.r.shape[0]):
        total -= dot(get3(line.force, i), get3(state.r, i))
    return total + stored_in_contact(line, sea, state.r) if line.bits & TOUCHES else total


@inner
def make_stiffness(line, zones):
    """Stiffness of elements as ramps have it now."""
    shares(zones.grown, zones.leaving, zones.haste, 0.0, zones.kinds.base_of_cell, zones.share)
    soften(zones.share, zones.stiff, line.kb)


@inner
def untwist(line, ends, guided, state):
    """Frames of the rods of a planar line, without twist against each other and against its clamps.

    In space a rod that begins twisted turns back within a step; in a plane nothing turns it.
    """
    n, m = get3(line.plane, 2), line.h.shape[0]
    first = 0
    while first < m and not line.spin[first]:
        first += 1
    if first == m:
        return
    k = 0 if guided[0] > 0.0 else 1
    f = ends.frame[k]
    if guided[k] > 0.0:
        a, across = (f[0], f[3], f[6]), cross(n, (f[2], f[5], f[8]))
    else:
        a, across = get3(state.a1, first), cross(n, chord(get3(state.e, first))[0])
    x, y = dot(a, n), dot(a, across)
    size = math.sqrt(x * x + y * y)
    for c in range(first, m):
        if line.spin[c]:
            side = cross(n, chord(get3(state.e, c))[0])
            put3(state.a1, c, scale(1.0 / size, add(scale(x, n), scale(y, side))))


@kernel
def begin_switch(table):
    """Energy before; the state on the new cells."""
    job = read(table)
    transfer = job.transfer
    line = transfer.line
    make_stiffness(line, job.zones)  # a step that was refused has left others
    for c in range(line.h.shape[0]):
        line.h[c] = job.zones.lengths[c]
    job.numbers[BEFORE] = energy(line, job.sea, job.ends, transfer.state, job.zones)
    transfer_state(transfer)
    if transfer.target.bits & PLANAR:
        untwist(transfer.target, job.ends, job.guided, transfer.out)


# --- lengths --------------------------------------------------------------------------------------


@inner
def lengthening(state, c):
    """Rate, m/s, at which the chord of a cell grows longer."""
    return dot(chord(get3(state.e, c))[0], sub(get3(state.v, c + 1), get3(state.v, c)))


@inner
def lack_rate(zones, c, t):
    """Rate, m/s, at which what a cell on its way to its true length lacks grows (kernels.mesh.stiffness_ramp)."""
    duration = zones.clock.letting_go
    x = min(max((t - zones.since[c]) / duration, 0.0), 1.0)
    value = 0.0 if zones.keeps[c] else -30.0 * x * x * (1.0 - x) ** 2
    return zones.lack[c] * value / duration + zones.rate[c] * (1.0 - x) ** 2 * (1.0 + 2.0 * x - 15.0 * x * x)


@inner
def growth(job, c, t):
    """Rate, m/s, at which old cell c grows longer but for what tension makes of it."""
    transfer, zones = job.transfer, job.zones
    rate = lengthening(transfer.state, c)
    if job.numbers[RELAXES] > 0.0:
        line, state = transfer.line, transfer.state
        rate += stretch_factor(line, state, c, torque_beside(line, state, c)) * lack_rate(zones, c, t)
    return rate


@inner
def relax_cell(job, c, t):
    """A new cell goes on with its length, and with the change of it that the old cells under it had."""
    transfer, zones = job.transfer, job.target_zones
    line, target, of = transfer.line, transfer.target, old_cell(transfer, c)
    a, b = of, of + 1  # the old cell that it is a part of, or those that it is made of
    while a > 0 and line.s[a] > target.s[c]:
        a -= 1
    while b < line.h.shape[0] and line.s[b] < target.s[c + 1]:
        b += 1
    total = 0.0
    for k in range(a, b):
        total += growth(job, k, t)
    part = transfer.match.lengths[c] / (line.s[b] - line.s[a])
    stretch = stretch_factor(target, transfer.out, c, torque_beside(line, transfer.state, of))
    zones.lack[c] = zones.true[c] - transfer.match.lengths[c]
    zones.rate[c] = (total * part - lengthening(transfer.out, c)) / stretch
    zones.since[c] = t


@inner
def relax(job, t):
    """Lengths on their way to true ones from t on; what was on its way goes on."""
    zones, before, match = job.target_zones, job.zones, job.transfer.match
    for c in range(match.kept.shape[0]):
        a = match.kept[c]
        zones.keeps[c] = not job.transfer.target.spin[c] and not zones.clock.share > 0.0
        if a < 0:
            relax_cell(job, c, t)
        elif job.numbers[RELAXES] > 0.0:
            zones.lack[c], zones.rate[c], zones.since[c] = before.lack[a], before.rate[a], before.since[a]
        else:
            zones.lack[c], zones.rate[c], zones.since[c] = zones.true[c] - match.lengths[c], 0.0, -np.inf


@kernel
def end_switch(table):
    """Stiffness and lengths of the new cells; energy after."""
    job = read(table)
    transfer, zones = job.transfer, job.target_zones
    target = transfer.target
    for i in range(target.s.shape[0]):
        for k in range(3):
            zones.stiff[i, k] = target.kb[i, k]
    for c in range(target.h.shape[0]):
        a = transfer.match.kept[c]
        zones.true[c], zones.lengths[c] = target.h[c], transfer.match.lengths[c]
        if zones.clock.share > 0.0:
            less = arc_less_chord(target, transfer.out, zones, c)
            zones.true[c] = job.zones.true[a] if a >= 0 else target.h[c] - less
    make_stiffness(target, zones)
    relax(job, job.numbers[TIME])
    for c in range(target.h.shape[0]):
        target.h[c] = transfer.match.lengths[c]
    job.numbers[AFTER] = energy(target, job.target_sea, job.ends, transfer.out, zones)
