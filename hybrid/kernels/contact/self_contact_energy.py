"""Energy that a step of a line that touches itself puts in though no work accounts for it: such a step is repeated."""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import dot, frame, get3, get9, sub
from hybrid.kernels.contact.self_contact_pairs import (
    CALMS,
    RETURNS,
    farthest_from_mean,
)
from hybrid.kernels.laws.bending_law import energy_share
from hybrid.kernels.laws.bending_slip import stored_by_slip
from hybrid.kernels.laws.cell import chord, turning
from hybrid.kernels.laws.element import strain_of_element
from hybrid.kernels.laws.tension_torque import couples
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import caller_of_six
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.powers import find_powers, loses
from hybrid.kernels.march.zone_torque import twist_energy
from hybrid.kernels.state.books import RATES
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    CONTACT_WORK,
    FRICTION_WORK,
    LOST_WORK,
    OBSTACLE_WORK,
    ROTARY,
    SEABED_ENERGY,
    SELF_CONTACT_ENERGY,
    SELF_FRICTION_WORK,
    STRETCH_ENERGY,
    TOUCHES,
)

# Energy that a step may put in, and all steps together, as a part of the largest energy so far.
MOST_GAIN = 5e-4
# Diameters that the fastest part moves, beside the mean, in the shortest step that is halved.
LEAST_TRAVEL = 0.05
call_observer = caller_of_six(0)


@inner
def energy_of_line(line, ends, state):
    """Energies, J, of motion and bending, and of stretch, of a line in which tension makes no torque.

    As `kernels.march.energies.observe` has them, without the moments, which take most of its time.
    """
    n = line.h.shape[0]
    moving, bent, twisted, longer = 0.0, 0.0, 0.0, 0.0
    before = after = get9(ends.frame, 0)
    for i in range(n + 1):
        vi = get3(state.v, i)
        moving += 0.5 * line.mass[i] * dot(vi, vi)
        if i < n:
            d, l, il = chord(get3(state.e, i))
            if line.ck[i] > 0.0 and not line.bits & AXIAL_LAW:
                more = l - line.h[i]
                longer += 0.5 * more * more / (line.h[i] * line.ck[i])
            if line.bits & ROTARY and line.spin[i]:
                d1, _ = turning(d, il, sub(get3(state.v, i + 1), vi), 0.0)
                moving += 0.5 * line.rotary[i] * dot(d1, d1) + 0.5 * line.polar[i] * state.w[i] * state.w[i]
            after = frame(get3(state.a1, i), d)
        else:
            after = get9(ends.frame, 1)
        if line.element[i]:
            kb, k0 = get3(line.kb, i), get3(line.k0, i)
            x = sub(strain_of_element(before, after, kb, k0), k0)
            share = energy_share(line, i, math.sqrt(x[0] * x[0] + x[1] * x[1]))
            bent += 0.5 * share * (kb[0] * x[0] * x[0] + kb[1] * x[1] * x[1])
            bent += stored_by_slip(line, i, x[0], x[1])
            twisted += 0.5 * kb[2] * x[2] * x[2]
        before = after
    return moving + bent + twisted, longer


@kernel
def observe_coupled(line, ends, state, contact, _1, _2):
    """Energies, J, of a line in which tension makes a torque, into contact.energy; contact.at and .move are used as room.

    Called by its address (Contact.observer), so that contact of other lines compiles none of it.
    """
    observed = Observed(contact.at, contact.move, contact.energy)
    observe(line, ends, state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    contact.counts.stale = 1
    return 0


@called
def energy_without_weight(line, ends, contact, state, report):
    """Energy, J, of motion, strain and contact of a state with its report; contact.at and .move are used as room."""
    if couples(line):
        call_observer(contact.observer[0], line, ends, state, contact, 0, 0)
        parts = contact.energy
        held, stretched = parts[0] + parts[1] + parts[2], parts[3]
    else:
        held, stretched = energy_of_line(line, ends, state)
    if line.bits & AXIAL_LAW:
        stretched = report[STRETCH_ENERGY]
    return held + stretched + twist_energy(line, state) + report[SELF_CONTACT_ENERGY]


@inner
def work_of_try(line, ends, contact, velocity, before, state, work, clock):
    """Work, J, of a try as kernels.march.powers books it, with that of weight; and by how much that may be off.

    before: W, powers at its beginning.  What a power that only rises, or falls, does in between is known but for half
    of its change, and is missed by as much in long steps: of weight, in a heavy line, by far more than contact puts in.
    """
    report, done, missed = work.report, work.report[SELF_FRICTION_WORK], 0.0
    half = 0.5 * (clock.try_end - clock.now)
    find_powers(line, ends, velocity, state, report, contact.power)
    for k in range(RATES):
        done += half * (before[k] + contact.power[k])
        missed += half * abs(contact.power[k] - before[k])
    if line.bits & TOUCHES:
        done += report[CONTACT_WORK] + report[SEABED_ENERGY] - clock.stored + report[FRICTION_WORK]
    if line.moved.shape[0] > 0:
        done += report[OBSTACLE_WORK]
    if loses(line):
        done += report[LOST_WORK]
    for i in range(work.u.shape[0]):
        for k in range(3):
            done += line.force[i, k] * work.u[i, k]
    return done, missed


@inner
def is_judged(numbers):
    """Whether a try is held against its energy: not where nothing is near, and vibrations of contact have been damped."""
    return numbers.quiet < CALMS + RETURNS or numbers.energy > 0.0


@inner
def is_gain(contact, u, done, missed):
    """Whether a try from the energy HAD to HAS, on the way u (m), has put in so much that it is repeated in halves.

    done: J, work that accounts for it, which may be off by `missed`.
    """
    numbers = contact.numbers
    most, gain = MOST_GAIN * numbers.largest, numbers.has - numbers.had - done
    gain = max(gain - missed, 0.0) if gain > 0.0 else min(gain + missed, 0.0)
    numbers.tried_balance = numbers.balance + gain
    if gain <= most and (gain <= 0.0 or numbers.tried_balance <= most):
        return False
    if not farthest_from_mean(u) > LEAST_TRAVEL * numbers.narrowest:
        return False
    numbers.gained += 1.0
    return True


@inner
def puts_energy_in(line, ends, contact, books, clock, old, new, work):
    """Whether the try has put in so much energy that it has to be repeated in halves.

    books: velocity (2, 3) m/s of the ends, powers (2, RATES) W and reports of the state now, as kernels.state.books has them.
    """
    numbers = contact.numbers
    if not is_judged(numbers):
        return False
    if numbers.begun != clock.now:
        if numbers.led == clock.now:
            numbers.had, numbers.balance = numbers.has, numbers.tried_balance
        else:
            numbers.had = energy_without_weight(line, ends, contact, old, books.report[0])
        numbers.begun = clock.now
        numbers.largest = max(numbers.largest, numbers.had)
    numbers.has = energy_without_weight(line, ends, contact, new, work.report)
    numbers.led = clock.try_end
    done, missed = work_of_try(line, ends, contact, books.velocity, books.power[0], new, work, clock)
    return is_gain(contact, work.u, done, missed)
