"""A line that is paid out or taken in at its end: what changes with its length in every step (docs/theory.md, 19).

The last node is the fairlead, through which material passes; all others are material.  Only the last cell changes its
length, and with it the mass, the loads and the stiffness that it brings to its two nodes.

    symbol  meaning                                                    unit
    L       unstretched length that is out                             m
    c       its rate, positive where line is paid out                  m/s
    p       arc length of the last material node                       m
    K       acceleration of the fairlead less that of the material     m/s2

A run calls `pay_out` by its address (kernels.run), so that lines of a fixed length compile none of it.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels import books as b
from hybrid.kernels.cell import Chord, chord
from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.element import relative_rotation
from hybrid.kernels.node_forces import Z3, get3, inertia_and_water
from hybrid.kernels.reel import (
    ACCELERATION,
    ADDED_N,
    ADDED_T,
    BEND_1,
    BUOY,
    DAMP,
    DIAMETER,
    DISPLACED,
    DRAG_N,
    DRAG_T,
    DUE,
    END,
    FADING,
    FLUX,
    FLUX_BEFORE,
    KAPPA_1,
    LENGTH,
    LONGEST,
    MASS,
    PER_LENGTH,
    PLACE,
    POLAR,
    RATE,
    ROTARY,
    SHORTEST,
    STRETCH,
    TAU,
    WEIGHT,
    read,
)
from hybrid.kernels.report import FORCE_B, LENGTH_OUT, PAYOUT_POWER, PAYOUT_RATE
from hybrid.kernels.rotations import add, dot, frame, log_rotation, scale, sub
from hybrid.kernels.winch import (
    BEGIN,
    CA,
    CV,
    HELD,
    INERTIA,
    LENGTH_NOW,
    RATE_NOW,
    TENSION,
    TRUE_NOW,
    accept,
    at_its_end,
    last_change,
    losses,
    predict,
    softness,
    tension_held,
)

# --- how long the line is -------------------------------------------------------------------------


@inner
def length_at(law, t):
    """L, c and the rate of c at t, just before it where the latter jumps."""
    k = 0
    while k + 1 < law.shape[0] and law[k + 1, 0] < t:
        k += 1
    x = max(t - law[k, 0], 0.0)
    value, rate, twice = 0.0, 0.0, 0.0
    for j in range(1, 8):
        twice = twice * x + 2.0 * rate
        rate = rate * x + value
        value = value * x + law[k, j]
    return value, rate, twice


@inner
def amount_between(pieces, begin, end, out):
    """What the material between two arc lengths has of all that it has per length."""
    for j in range(PER_LENGTH):
        out[j] = 0.0
    for k in range(pieces.shape[0]):
        a = max(pieces[k, 0], begin) if k > 0 else begin
        z = min(pieces[k + 1, 0], end) if k + 1 < pieces.shape[0] else end
        if z > a:
            for j in range(PER_LENGTH):
                out[j] += (z - a) * pieces[k, 1 + j]


@inner
def fill_last_cell(line, reel):
    """Mass, loads and stiffness of the last cell and of its two nodes, for the length that is out."""
    n, rest, q = line.h.shape[0], reel.rest, reel.amount
    length, place = reel.numbers[LENGTH], reel.numbers[PLACE]
    h, c = length - place, n - 1
    amount_between(reel.pieces, place, length, q)
    line.s[n], reel.true[c] = length, h
    for i, share in ((n - 1, 1.0), (n, 0.0)):
        line.mass[i] = 0.5 * (q[MASS] + share * rest[MASS]) + line.point_mass[i]
        line.force[i, 2] = -0.5 * (q[WEIGHT] + share * rest[WEIGHT])
        line.damp[i] = 0.5 * (q[DAMP] + share * rest[DAMP])
        line.hn[i] = 0.5 * (h + share * rest[PER_LENGTH])
    line.ck[c], line.tau[c], line.diameter[c] = q[STRETCH] / h, q[TAU] / h, q[DIAMETER] / h
    line.drag_n[c], line.drag_t[c] = 0.5 * q[DRAG_N], 0.5 * q[DRAG_T]
    line.added_n[c], line.added_t[c] = 0.5 * q[ADDED_N], 0.5 * q[ADDED_T]
    line.buoy[c], line.displaced[c] = 0.5 * q[BUOY], 0.5 * q[DISPLACED]
    line.rotary[c], line.polar[c] = q[ROTARY], q[POLAR]
    if line.element[n - 1]:
        for k in range(3):
            line.kb[n - 1, k] = 2.0 / (q[BEND_1 + k] + rest[BEND_1 + k])
            line.k0[n - 1, k] = 0.5 * (q[KAPPA_1 + k] + rest[KAPPA_1 + k])


@inner
def set_lengths(line, reel, t):
    """Lengths of cells at t: those that are new are on their way to their true ones, by a quintic that ends at rest."""
    for c in range(line.h.shape[0]):
        line.h[c] = reel.true[c]
        x = (t - reel.since[c]) / reel.span[c]
        if x < 1.0:
            x = max(x, 0.0)
            value = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
            fading = x * (1.0 - x) ** 3 * (1.0 + 3.0 * x)
            line.h[c] -= reel.lack[c] * value + reel.span[c] * reel.rate[c] * fading


@inner
def find_length(reel, t):
    """How long the line is at t, of what is prescribed, or of a winch before a step."""
    numbers, winch = reel.numbers, reel.winch
    if winch[TENSION] > 0.0:
        numbers[LENGTH], numbers[RATE], numbers[ACCELERATION] = winch[LENGTH_NOW], winch[RATE_NOW], winch[TRUE_NOW]
    else:
        numbers[LENGTH], numbers[RATE], numbers[ACCELERATION] = length_at(reel.law, t)


@inner
def prepare(line, reel, t):
    """The line with the length of now at t."""
    numbers = reel.numbers
    fill_last_cell(line, reel)
    line.h[line.h.shape[0] - 1] = reel.true[line.h.shape[0] - 1]
    if numbers[FADING] > -np.inf:
        set_lengths(line, reel, t)


# --- the force of the fairlead --------------------------------------------------------------------


@inner
def at_fairlead(line, state, rate, acceleration):
    """Velocity of the material at the fairlead, K, and r' there."""
    n = line.h.shape[0]
    ha, hb = line.h[n - 2], line.h[n - 1]
    beyond = hb / (ha + hb)
    sa, sb = scale(1.0 / ha, get3(state.e, n - 2)), scale(1.0 / hb, get3(state.e, n - 1))
    slope, bend = add(sb, scale(beyond, sub(sb, sa))), scale(2.0 / (ha + hb), sub(sb, sa))
    v = sub(get3(state.v, n), scale(rate, slope))
    va = scale(1.0 / ha, sub(get3(state.v, n - 1), get3(state.v, n - 2)))
    vb = scale(1.0 / hb, sub(v, get3(state.v, n - 1)))
    turns = add(vb, scale(beyond, sub(vb, va)))
    K = add(scale(2.0 * rate, turns), add(scale(rate * rate, bend), scale(acceleration, slope)))
    return v, K, slope


@inner
def of_material(line, sea, ends, state, reel):
    """What the force of the fairlead, N, is more because its half cell moves as the material does, and r' there."""
    n, numbers = line.h.shape[0], reel.numbers
    v, K, slope = at_fairlead(line, state, numbers[RATE], numbers[ACCELERATION])
    before, after, z = chord(get3(state.e, n - 1)), Chord(Z3, 0.0, 0.0), ends.position[1, 2]
    vn, an = get3(state.v, n), get3(state.vd, n)
    with_material, _, _, _ = inertia_and_water(line, sea, n, z, v, sub(an, K), before, after, 0.0, 0.0, reel.report)
    with_fairlead, _, _, _ = inertia_and_water(line, sea, n, z, vn, an, before, after, 0.0, 0.0, reel.report)
    return sub(with_material, with_fairlead), slope


@inner
def force_of_fairlead(report, more):
    return (report[FORCE_B] + more[0], report[FORCE_B + 1] + more[1], report[FORCE_B + 2] + more[2])


@inner
def pull_at(force, slope):
    """Pull of the line at the fairlead, N: the size of its force, negative where it pushes."""
    size = math.sqrt(dot(force, force))
    return size if dot(force, slope) <= 0.0 else -size


@inner
def correct_force(line, sea, ends, state, velocity, reel, report):
    """The report of a state: the half cell at the fairlead has the velocity and the acceleration of the material.

    What the end does of power by the difference is kept in the numbers of the reel, to be taken back.  Returns the
    pull of the line there, N.
    """
    numbers = reel.numbers
    more, slope = of_material(line, sea, ends, state, reel)
    force = force_of_fairlead(report, more)
    report[FORCE_B], report[FORCE_B + 1], report[FORCE_B + 2] = force
    report[LENGTH_OUT], report[PAYOUT_RATE] = numbers[LENGTH], numbers[RATE]
    report[PAYOUT_POWER] = numbers[RATE] * dot(force, slope)
    numbers[FLUX] = dot(more, get3(velocity, 1))
    return pull_at(force, slope)


# --- energy ---------------------------------------------------------------------------------------


@inner
def strain_before(line, state, k):
    """Strain of the last element, from what has no stress, squared and weighed with one stiffness k."""
    i = line.h.shape[0] - 1
    da, _, _ = chord(get3(state.e, i - 1))
    db, _, _ = chord(get3(state.e, i))
    turn = log_rotation(relative_rotation(frame(get3(state.a1, i - 1), da), frame(get3(state.a1, i), db)))
    x = sub(turn, get3(line.k0, i))
    return k[0] * x[0] * x[0] + k[1] * x[1] * x[1] + k[2] * x[2] * x[2]


@inner
def remember(line, reel):
    """Lengths, and mass, weight and stiffness of the nodes that change, for the next step."""
    n, before = line.h.shape[0], reel.before
    for c in range(n):
        before[c, 0] = line.h[c]
    for k in range(3):
        before[n, k] = line.kb[n - 1, k]
    for i in range(2):
        before[n + 1 + i, 0], before[n + 1 + i, 1] = line.mass[n - 1 + i], line.force[n - 1 + i, 2]
    reel.numbers[FLUX_BEFORE] = reel.numbers[FLUX]


@inner
def stretch_work(line, state, c):
    """Energy per length, N, that a cell takes up when its unstretched length grows and its ends stay."""
    T = state.T[c]
    return T + 0.5 * line.ck[c] * T * T


@inner
def book(line, old, new, reel, dt):
    """Energy, J, that came in with material through an accepted step of dt, and with lengths that were not true."""
    n, before, numbers = line.h.shape[0], reel.before, reel.numbers
    booked = 0.5 * dt * (numbers[FLUX] + numbers[FLUX_BEFORE])
    for c in range(n):
        more = line.h[c] - before[c, 0]
        if more != 0.0:
            booked -= 0.5 * more * (stretch_work(line, old, c) + stretch_work(line, new, c))
    for j in range(2):
        i = n - 1 + j
        va, vb = get3(old.v, i), get3(new.v, i)
        booked += 0.25 * (line.mass[i] - before[n + 1 + j, 0]) * (dot(va, va) + dot(vb, vb))
        booked -= 0.5 * (line.force[i, 2] - before[n + 1 + j, 1]) * (old.r[i, 2] + new.r[i, 2])
    if line.element[n - 1]:
        more_stiff = sub(get3(line.kb, n - 1), get3(before, n))
        booked += 0.25 * (strain_before(line, old, more_stiff) + strain_before(line, new, more_stiff))
    return booked


# --- entries --------------------------------------------------------------------------------------


@inner
def note_pull(reel, t, pull):
    """What the pull is when the brake of a winch opens: the last one before."""
    if t <= reel.winch[BEGIN]:
        reel.winch[HELD] = pull


@kernel
def pay_out(table):
    """What a run whose line changes its length does before a try, after it, after a step; 1: Python must look at it."""
    job = read(table)
    line, reel, clock, count = job.line, job.reel, job.clock, job.counts
    phase, numbers, winch = count[b.PHASE], reel.numbers, reel.winch
    if phase == b.SOLVE:
        find_length(reel, clock[b.TRY_END])
        if winch[TENSION] > 0.0:
            dt = clock[b.TRY_END] - clock[b.NOW]
            numbers[LENGTH], numbers[RATE], numbers[ACCELERATION] = predict(
                winch, clock[b.RHO], clock[b.STEP_BEFORE], dt
            )
        prepare(line, reel, clock[b.TRY_END])
        return 0
    if phase == b.JUDGE:
        tried = job.old if count[b.PARITY] else job.new
        pull = correct_force(line, job.sea, job.ends, tried, job.velocity, reel, job.report)
        note_pull(reel, clock[b.TRY_END], pull)
        return 0
    # a step is accepted, and the states have changed places
    state, before = job.old, job.new
    if count[b.PARITY]:
        state, before = before, state
    if winch[TENSION] > 0.0:
        accept(winch, numbers[LENGTH], numbers[RATE], numbers[ACCELERATION])
    job.work[0, END] += book(line, before, state, reel, clock[b.LAST_DT])
    remember(line, reel)
    last = reel.true[line.h.shape[0] - 1]
    if clock[b.NOW] >= numbers[FADING]:
        numbers[FADING] = -np.inf
    numbers[DUE] = 1.0 if last > numbers[LONGEST] or last < numbers[SHORTEST] else 0.0
    return 1 if numbers[DUE] > 0.0 or at_its_end(winch) else 0


@kernel
def wind(table):
    """An iteration of Newton's method has eliminated its equations: the winch corrects the length, and them with it."""
    job = read(table)
    line, reel, clock = job.line, job.reel, job.clock
    numbers, winch, t = reel.numbers, reel.winch, clock[b.TRY_END]
    if t <= winch[BEGIN]:
        return 0
    state, at = job.old if job.counts[b.PARITY] else job.new, last_change(line)
    more, slope = of_material(line, job.sea, job.ends, state, reel)
    pull = pull_at(force_of_fairlead(job.report, more), slope) + job.X[at]
    lost, steep = losses(winch, numbers[RATE])
    answer = softness(line, state, job.X)
    left = winch[INERTIA] * numbers[ACCELERATION] + lost + tension_held(winch, t) - pull
    carried = line.mass[line.h.shape[0]] * math.sqrt(dot(slope, slope))
    stiff = (winch[INERTIA] + carried) * winch[CA] + steep * winch[CV] - answer
    change = -left / stiff
    numbers[LENGTH] += change
    numbers[RATE] += winch[CV] * change
    numbers[ACCELERATION] += winch[CA] * change
    prepare(line, reel, t)
    job.X[at] += answer * change
    return 0


@kernel
def lengthen(table):
    """The line as it is at clock[NOW], without a look at its state."""
    job = read(table)
    find_length(job.reel, job.clock[b.NOW])
    prepare(job.line, job.reel, job.clock[b.NOW])
    remember(job.line, job.reel)


@kernel
def stand_still(table):
    """The same for a state that no step has led to: the line at clock[NOW], and the force of its fairlead."""
    job = read(table)
    find_length(job.reel, job.clock[b.NOW])
    prepare(job.line, job.reel, job.clock[b.NOW])
    state = job.new if job.counts[b.PARITY] else job.old
    pull = correct_force(job.line, job.sea, job.ends, state, job.velocity, job.reel, job.report)
    note_pull(job.reel, job.clock[b.NOW], pull)
    remember(job.line, job.reel)
