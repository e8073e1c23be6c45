"""Energy that a step of a line that touches itself puts in though no work accounts for it: such a step is repeated."""

from __future__ import annotations

from hybrid.kernels.books import NOW, RATES, STORED, TRY_END
from hybrid.kernels.compile import inner
from hybrid.kernels.energies import observe
from hybrid.kernels.forces import AXIAL_LAW, SEABED
from hybrid.kernels.powers import find_powers
from hybrid.kernels.report import (
    CONTACT_WORK,
    FRICTION_WORK,
    SEABED_ENERGY,
    SELF_CONTACT_ENERGY,
    SELF_FRICTION_WORK,
    STRETCH_ENERGY,
)
from hybrid.kernels.self_contact_pairs import (
    BALANCE,
    BEGUN,
    GAINED,
    HAD,
    HAS,
    LARGEST,
    LED,
    NARROWEST,
    STALE,
    TRIED_BALANCE,
    farthest_from_mean,
)
from hybrid.kernels.zone_torque import twist_energy

# Energy that a step may put in, and all steps together, as a part of the largest energy so far.
MOST_GAIN = 5e-4
# Diameters that the fastest part moves, beside the mean, in the shortest step that is halved.
LEAST_TRAVEL = 0.05


@inner
def energy_without_weight(line, ends, contact, state, report):
    """Energy, J, of motion, strain and contact of a state with its report; contact.at and .move are used as room."""
    parts = contact.energy
    observe(line, ends, state.e, state.v, state.a1, state.w, state.T, state.turn, contact.at, contact.move, parts)
    contact.counts[STALE] = 1
    if line.bits & AXIAL_LAW:
        parts[3] = report[STRETCH_ENERGY]
    return parts[0] + parts[1] + parts[2] + parts[3] + twist_energy(line, state) + report[SELF_CONTACT_ENERGY]


@inner
def work_of_try(line, ends, contact, velocity, before, state, work, clock):
    """Work, J, of a try as kernels.powers books it, with that of weight; before: W, powers at its beginning."""
    report, done = work.report, work.report[SELF_FRICTION_WORK]
    find_powers(line, ends, velocity, state, report, contact.power)
    for k in range(RATES):
        done += 0.5 * (clock[TRY_END] - clock[NOW]) * (before[k] + contact.power[k])
    if line.bits & SEABED:
        done += report[CONTACT_WORK] + report[SEABED_ENERGY] - clock[STORED] + report[FRICTION_WORK]
    for i in range(work.u.shape[0]):
        for k in range(3):
            done += line.force[i, k] * work.u[i, k]
    return done


@inner
def puts_energy_in(line, ends, contact, books, clock, old, new, work):
    """Whether the try has put in so much energy that it has to be repeated in halves.

    books: velocity (2, 3) m/s of the ends, powers (2, RATES) W and reports of the state now, as kernels.books has them.
    """
    numbers = contact.numbers
    if numbers[BEGUN] != clock[NOW]:
        if numbers[LED] == clock[NOW]:
            numbers[HAD], numbers[BALANCE] = numbers[HAS], numbers[TRIED_BALANCE]
        else:
            numbers[HAD] = energy_without_weight(line, ends, contact, old, books.report[0])
        numbers[BEGUN] = clock[NOW]
        numbers[LARGEST] = max(numbers[LARGEST], numbers[HAD])
    numbers[HAS] = energy_without_weight(line, ends, contact, new, work.report)
    numbers[LED] = clock[TRY_END]
    gain = numbers[HAS] - numbers[HAD]
    gain -= work_of_try(line, ends, contact, books.velocity, books.power[0], new, work, clock)
    numbers[TRIED_BALANCE] = numbers[BALANCE] + gain
    most = MOST_GAIN * numbers[LARGEST]
    if gain <= most and (gain <= 0.0 or numbers[TRIED_BALANCE] <= most):
        return False
    if not farthest_from_mean(work.u) > LEAST_TRAVEL * numbers[NARROWEST]:
        return False
    numbers[GAINED] += 1.0
    return True
