"""Contact of a line with itself in a step: near pairs, limits of corrections, forces and friction.

A step that puts energy in for which no work accounts is repeated.  A run calls `contact_task` by its address, so that
lines without self-contact compile none of it: before a try of a step (PREDICT), to shorten what Newton's method
predicts and corrects so that no two strands pass through each other (SAFE_PART), to put the forces of contact into a
correction (COUPLE), and for the energy at the end (ACCEPT).

Contact couples nodes that are no neighbours, which the block rows along s do not know.  It is added to their solution
x0 with the kept factors of the matrix A: (A - H) x = b + g is x = A^-1 b + A^-1 (g + H x), of which only the nodes in
contact are unknown; GMRES finds them, each product with A^-1 being one more substitution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.kept_factors import carry_given, prepare_sweep, solve_backward, sweep
from hybrid.kernels.algebra.rotations import dot, frame, get3, get9, sub
from hybrid.kernels.contact.self_contact_law import (
    FIRST,
    FORCE,
    GRIP,
    LAST,
    WX,
    WY,
    P,
    Q,
    add_gradient,
    add_held,
    add_held_product,
    add_product,
    hold_point,
    keep_grips,
    link_grips,
)
from hybrid.kernels.contact.self_contact_pairs import (
    CALMS,
    FADES,
    HELD_BETWEEN,
    HELD_WITHIN,
    MOST_PRODUCTS,
    RETURNS,
    SLIP_WITHIN,
    Contact,
    farthest_from_mean,
    find_points,
    first_in_contact,
    foresee_nearness,
    keep_pairs,
    limit,
)
from hybrid.kernels.laws.bending_law import energy_share, stored_by_slip
from hybrid.kernels.laws.element import chord, strain_of_element, turning
from hybrid.kernels.laws.tension_torque import couples
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.energies import Observed, find_powers, loses, observe
from hybrid.kernels.march.zone_torque import twist_energy
from hybrid.kernels.state.books import RATES, Clock, Counts
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    CONTACT_WORK,
    FORCE_A,
    FRICTION_WORK,
    LOST_WORK,
    NET_A,
    OBSTACLE_WORK,
    ROTARY,
    SEABED_ENERGY,
    SELF_CONTACT_ENERGY,
    SELF_FRICTION_WORK,
    STRETCH_ENERGY,
    TOUCHES,
)
from hybrid.kernels.state.state import Ends, Line, Rows, State, Work, blanks
from hybrid.kernels.step.line_step import ACCEPT, ASKED, COUPLE, FIND, JUDGE, NEAR, PREDICT, RADIUS, SAFE_PART, STAND
from hybrid.kernels.step.step_control import before_fixed, radius_of_step, scheme

# --- a correction of Newton's method -----------------------------------------------------------

# GMRES leaves a part of its first residual: PART_LEFT of the part that Newton's method leaves of the correction.
SOLVED = 1e-7  # at least this part
LARGEST_LEFT = 1e-3  # part, at most
PART_LEFT = 0.01
LEAST_LEFT = 1e-11  # diameters, at least


@inner
def find_forces(contact, with_gradient):
    """contact.y = H x + g of the nodes in contact, g where asked."""
    held_on = contact.numbers.friction > 0.0
    x, y = contact.x, contact.y
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        y[i, 0], y[i, 1], y[i, 2], y[i, 3] = 0.0, 0.0, 0.0, 0.0
    for k in range(contact.counts.points):
        add_product(contact.points[k], x, y)
        if with_gradient:
            add_gradient(contact.points[k], y)
        if held_on:
            add_held_product(contact, k, x, y)
            if with_gradient:
                add_held(contact, k, y)


@inner
def enough(s, width, size):
    """Residual that GMRES may leave of the first, s (m), of `size` unknowns of lines of a diameter `width`, m."""
    scale = width * math.sqrt(size)
    return max(s * max(SOLVED, min(PART_LEFT * s / scale, LARGEST_LEFT)), LEAST_LEFT * scale)


@called
def respond(ends, contact, work, with_gradient, begin):
    """contact.z = A^-1 (H x + g) from node `begin` on, g where asked; x of the nodes in contact."""
    find_forces(contact, with_gradient)
    y, z = contact.y, contact.z
    last = y.shape[0] - 1
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        held = (i == 0 and ends.held[0] != 0) or (i == last and ends.held[1] != 0)
        z[i, 0] = 0.0
        for j in range(3):
            z[i, 1 + j] = 0.0 if held else y[i, j]
        z[i, 4] = y[i, 3] * contact.rolls[i]
    first = first_in_contact(contact, 0, last)
    for i in range(begin, first):
        for j in range(5):
            z[i, j] = 0.0
    if with_gradient:
        carry_given(work.X, work.W, contact.marks, z, False, first)
    else:
        sweep(work.X, work.W, contact.sweep, contact.marks, z, False, first)
    return solve_backward(work.X, z, begin)


@inner
def unknowns(contact):
    """Unknowns of a node in contact: its place, with friction the spin of the cell after it too, as a way."""
    return 4 if contact.numbers.friction > 0.0 and contact.numbers.rolls > 0.0 else 3


@inner
def length_of(contact, j, i):
    """Factor, m, of unknown j of node i: a spin (rad) counts by the radius."""
    return 0.5 * contact.width[i] if j == 3 else 1.0


@inner
def inner_product(a, b, size):
    """Of vectors, in four sums: one would wait for itself in every term."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = size - size % 4
    for i in range(0, whole, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(whole, size):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)


@inner
def next_vector(contact, k):
    """Orthogonalise basis vector k + 1 against those before; its length goes into the column k."""
    V, H, size = contact.basis, contact.hessenberg, unknowns(contact) * contact.counts.nodes
    new = V[k + 1]
    for j in range(k + 1):
        before = V[j]
        s = inner_product(before, new, size)
        H[j, k] = s
        for i in range(size):
            new[i] -= s * before[i]
    s = math.sqrt(inner_product(new, new, size))
    H[k + 1, k] = s
    if s > 0.0:
        for i in range(size):
            V[k + 1, i] /= s


@inner
def rotate_column(H, k):
    """Givens rotations of column k of the least-squares problem; the residual that is left."""
    cos, sin, rhs = MOST_PRODUCTS, MOST_PRODUCTS + 1, MOST_PRODUCTS + 2
    for j in range(k):
        a, b = H[j, k], H[j + 1, k]
        H[j, k], H[j + 1, k] = H[j, cos] * a + H[j, sin] * b, H[j, cos] * b - H[j, sin] * a
    a, b = H[k, k], H[k + 1, k]
    size = math.sqrt(a * a + b * b)
    H[k, cos], H[k, sin] = a / size, b / size
    H[k, k], H[k + 1, k] = size, 0.0
    H[k + 1, rhs] = -H[k, sin] * H[k, rhs]
    H[k, rhs] = H[k, cos] * H[k, rhs]
    return abs(H[k + 1, rhs])


@inner
def begin_columns(H, s):
    """The least-squares problem of a residual of length s, before the first product."""
    H[: MOST_PRODUCTS + 1, MOST_PRODUCTS + 2] = 0.0
    H[0, MOST_PRODUCTS + 2] = s


@inner
def solve_columns(H, done):
    """Its solution by so many products."""
    rhs, solution = MOST_PRODUCTS + 2, MOST_PRODUCTS + 3
    for j in range(done - 1, -1, -1):
        s = H[j, rhs]
        for k in range(j + 1, done):
            s -= H[j, k] * H[k, solution]
        H[j, solution] = s / H[j, j]


@inner
def combine_vectors(contact, H, done):
    """contact.x of the nodes in contact: the vectors of the basis with that solution."""
    per = unknowns(contact)
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        for m in range(per):
            s = 0.0
            for j in range(done):
                s += H[j, MOST_PRODUCTS + 3] * contact.basis[j, per * k + m]
            contact.x[i, m] = s / length_of(contact, m, i)


@inner
def load_vector(contact, column):
    """contact.x = the basis vector of a column."""
    x, V, per = contact.x, contact.basis, unknowns(contact)
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        for j in range(per):
            x[i, j] = V[column, per * k + j] / length_of(contact, j, i)


@inner
def find_solution(ends, contact, work):
    """GMRES: contact.x = the correction of the nodes in contact; False: not finite.

    It begins at zero, where the residual is A^-1 (b + g), which falls as Newton converges.  The correction x0 of a line
    without contact stays large, as the force of contact is left out of b: what SOLVED leaves of it would never fall.
    """
    x, z, V, H = contact.x, contact.z, contact.basis, contact.hessenberg
    count, per = contact.counts.nodes, unknowns(contact)
    begin = first_in_contact(contact, 0, contact.marks.shape[0] - 1)
    prepare_sweep(work.X, work.W, contact.sweep, begin, contact.z.shape[0] - 1)
    for k in range(count):
        i = contact.nodes[k]
        for j in range(per):
            x[i, j] = 0.0
    if not respond(ends, contact, work, True, begin):
        return False
    s = 0.0
    for k in range(count):
        i = contact.nodes[k]
        for j in range(per):
            y = (work.x[i, 1 + j] + z[i, 1 + j]) * length_of(contact, j, i)
            V[0, per * k + j] = y
            s += y * y
    s = math.sqrt(s)
    begin_columns(H, s)
    done = 0
    if s > 0.0:
        for i in range(per * count):
            V[0, i] /= s
        left, most = s, enough(s, contact.numbers.widest, per * count)
        while done < min(MOST_PRODUCTS, per * count) and left > most:
            load_vector(contact, done)
            if not respond(ends, contact, work, False, begin):
                return False
            for k in range(count):
                i = contact.nodes[k]
                for j in range(per):
                    V[done + 1, per * k + j] = V[done, per * k + j] - z[i, 1 + j] * length_of(contact, j, i)
            next_vector(contact, done)
            left = rotate_column(H, done)
            done += 1
            contact.counts.products += 1
    solve_columns(H, done)
    combine_vectors(contact, H, done)
    return True


@inner
def solve_contact(ends, contact, work):
    """Put contact into the correction work.x of a line without it; False if it is not finite."""
    if not find_solution(ends, contact, work):
        return False
    if not respond(ends, contact, work, True, 0):
        return False
    z = contact.z
    for i in range(work.x.shape[0]):
        for j in range(5):
            work.x[i, j] += z[i, j]
    return True


# --- a step ------------------------------------------------------------------------------------

# Energy that a step may put in, and all steps together, as a part of the largest energy so far.
MOST_GAIN = 5e-4
# Diameters that the fastest part moves, beside the mean, in the shortest step that is halved.
LEAST_TRAVEL = 0.05


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
            x = sub(strain_of_element(before, after, kb, k0, i), k0)
            share = energy_share(line, i, math.sqrt(x[0] * x[0] + x[1] * x[1]))
            bent += 0.5 * share * (kb[0] * x[0] * x[0] + kb[1] * x[1] * x[1])
            bent += stored_by_slip(line, i, x[0], x[1])
            twisted += 0.5 * kb[2] * x[2] * x[2]
        before = after
    return moving + bent + twisted, longer


@called
def energy_without_weight(line, ends, contact, state, report):
    """Energy, J, of motion, strain and contact of a state with its report; contact.at and .move are used as room."""
    if couples(line):
        parts = contact.energy
        observed = Observed(contact.at, contact.move, parts)
        observe(line, ends, state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
        contact.counts.stale = 1
        held, stretched = parts[0] + parts[1] + parts[2], parts[3]
    else:
        held, stretched = energy_of_line(line, ends, state)
    if line.bits & AXIAL_LAW:
        stretched = report[STRETCH_ENERGY]
    return held + stretched + twist_energy(line, state) + report[SELF_CONTACT_ENERGY]


@inner
def work_of_try(line, ends, contact, velocity, before, state, work, clock):
    """Work, J, of a try as kernels.march.energies books it, with that of weight; and by how much that may be off.

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
def knows_before(numbers, now):
    """Whether the energy HAD before a try is known: it has been asked for, or is that where the last try has led."""
    if numbers.begun != now and numbers.led == now:
        numbers.had, numbers.balance, numbers.begun = numbers.has, numbers.tried_balance, now
    return numbers.begun == now


@inner
def is_gain(contact, u, done, missed):
    """Whether a try from the energy HAD to HAS, on the way u (m), has put in so much that it is repeated in halves.

    done: J, work that accounts for it, which may be off by `missed`.
    """
    numbers = contact.numbers
    numbers.largest = max(numbers.largest, numbers.had)
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
    if not knows_before(numbers, clock.now):
        numbers.had, numbers.begun = energy_without_weight(line, ends, contact, old, books.report[0]), clock.now
    numbers.has, numbers.led = energy_without_weight(line, ends, contact, new, work.report), clock.try_end
    done, missed = work_of_try(line, ends, contact, books.velocity, books.power[0], new, work, clock)
    return is_gain(contact, work.u, done, missed)


class ContactJob(NamedTuple):
    """Arguments of the entry: two states in turn as kernels.run.network_run has them, its clock and counts."""

    line: Line
    ends: Ends
    old: State
    new: State
    work: Work
    clock: Clock
    counts: Counts
    call: NDArray[np.int64]
    contact: Contact
    touch: Rows  # (3, N+1) as kernels.state.books.Books has it, and so have
    velocity: Rows  # (2, 3) m/s
    power: Rows  # (2, RATES) W
    report: Rows  # (3, REPORT_SIZE)


blank_contact_job = blanks(ContactJob)
read = reader(blank_contact_job())


# --- friction -------------------------------------------------------------------------------------


@inner
def keep_last(contact, now):
    """What the last try has left of friction is kept if that was the step that led to the time now."""
    numbers, counts = contact.numbers, contact.counts
    if numbers.since == now:
        counts.grips, numbers.stored, counts.remeshed = counts.fresh, numbers.tried, 0
        for k in range(counts.fresh):
            for j in range(GRIP):
                contact.grips[k, j] = contact.fresh[k, j]
    numbers.since = math.nan
    link_grips(contact, counts.grips)


@inner
def radius(contact, clock, near):
    """Spectral radius at infinity of a step: 0 near contact, and from there back to that of the run."""
    if near:
        return 0.0
    part = (contact.numbers.quiet - CALMS) / RETURNS
    return clock.rho * min(max(part, 0.0), 1.0)


@inner
def find_spins(line, contact, clock, near, old, new, u):
    """contact.x = shifts of nodes and spins of cells in the step that is tried."""
    x, dt = contact.x, clock.try_end - clock.now
    rho = radius_of_step(radius(contact, clock, near), clock.step_before, clock.rho_before, dt)
    cv = scheme(rho, clock.step_before, clock.rho_before, dt).cv
    for i in range(u.shape[0]):
        for k in range(3):
            x[i, k] = u[i, k]
        x[i, 3] = 0.0
        if i < line.h.shape[0] and line.spin[i] and contact.rolls[i] > 0.0:
            ahead = dt * old.wa[i]
            x[i, 3] = dt * old.w[i] + 0.5 * dt * ahead + (new.w[i] - old.w[i] - ahead) / cv


@called
def hold_points(line, contact):
    """Friction of all points of contact at contact.x."""
    numbers = contact.numbers
    other = contact.counts.remeshed != 0
    numbers.slip_work, numbers.tried = 0.0, 0.0
    for l in range(contact.shares.shape[0]):
        for j in (HELD_BETWEEN, HELD_WITHIN, SLIP_WITHIN):
            contact.shares[l, j] = 0.0
    for k in range(contact.counts.points):
        p, q = contact.of[int(contact.points[k, P])], contact.of[int(contact.points[k, Q])]
        work, energy = hold_point(line, contact, k, contact.rubs[p, q], numbers.tries, other)
        numbers.slip_work += work
        numbers.tried += energy
        contact.shares[p, HELD_WITHIN if p == q else HELD_BETWEEN] += 0.5 * energy
        contact.shares[q, HELD_WITHIN if p == q else HELD_BETWEEN] += 0.5 * energy
        if p == q:
            contact.shares[p, SLIP_WITHIN] += work


# --- entry ----------------------------------------------------------------------------------------


@inner
def place(contact, old, u):
    """The nodes of a configuration."""
    for i in range(u.shape[0]):
        for k in range(3):
            contact.at[i, k] = old.r[i, k] + u[i, k]
    contact.counts.stale = 1


@inner
def prepare(line, ends, contact, old, u, now, dt):
    """Before a try of a step of dt from the time now: how much of the prediction is safe, whether it comes to contact.

    The size of the law follows the speed of what meets.  While anything touches it fades to what still moves: what is
    at rest must not depend on how fast it came there.  It does not grow then, which would put energy in.
    """
    numbers, speed = contact.numbers, contact.numbers.speed
    for i in range(u.shape[0]):
        for k in range(3):
            u[i, k] = 0.0
            contact.move[i, k] = dt * old.v[i, k] + 0.5 * dt * dt * old.a[i, k]
    place(contact, old, u)
    keep_pairs(line, ends, contact)
    find_points(line, ends, contact, 0.0)
    numbers.speed = 0.0
    limit(line, ends, contact, 0.0)
    near = numbers.speed > 0.0 or contact.counts.points > 0
    seen = numbers.speed / dt
    if contact.counts.points > 0:
        since = now - numbers.faded if numbers.faded < now else 0.0
        faded = speed / (1.0 + speed * since / (FADES * numbers.widest))
        seen = min(speed, max(faded, seen))
    numbers.speed, numbers.faded = seen, now
    return near


@inner
def charge(line, contact, counts):
    """Take what contact has cost in the try, in steps of the line, from those that the call may still make.

    A look takes about as long as a cell of a step does, and a product a part of its solution.
    """
    cells = line.h.shape[0]
    cost = contact.counts.looks + contact.counts.products * max(cells // 4, 1)
    counts.quota -= cost // cells
    contact.counts.looks, contact.counts.products = cost % cells, 0


@inner
def press(line, contact, touch, row):
    """Force across per length, N/m, at the nodes, into a row of `touch`: of both strands, as the seabed has it."""
    n, kind = line.h.shape[0], contact.kind
    for i in range(n + 1):
        touch[row, i] = 0.0
    for k in range(contact.counts.points):
        point = contact.points[k]
        p, q = int(point[P]), int(point[Q])
        for j in range(3):
            touch[row, p - 1 + j] -= point[WX + j] * point[FORCE]
            touch[row, q - 1 + j] -= point[WY + j] * point[FORCE]
    for i in range(n + 1):
        a, b = line.s[i if kind[i] == FIRST else i - 1], line.s[i if kind[i] == LAST else i + 1]
        touch[row, i] *= 2.0 / (b - a)


@inner
def load_ends(ends, y, first, n, report):
    """Add forces y on the end nodes that are held, `first` and n behind it, to what the report says these bear."""
    for k in range(2):
        if ends.held[k] != 0:
            for j in range(3):
                report[FORCE_A + 3 * k + j] -= y[first + k * n, j]
                report[NET_A + 3 * k + j] -= y[first + k * n, j]


@inner
def push_ends(contact, n):
    """Forces of contact on the end nodes, 0 and n, into contact.y."""
    y = contact.y
    y[0, :3] = y[n, :3] = 0.0
    for i in range(contact.counts.points):
        point = contact.points[i]
        p, q = int(point[P]), int(point[Q])
        if min(p, q) == 1 or max(p, q) == n - 1:
            add_gradient(point, y)
            if contact.numbers.friction > 0.0:
                add_held(contact, i, y)


@kernel
def contact_task(table):
    """What is asked by `call[ASKED]` of the configuration old.r + work.u.

    PREDICT, SAFE_PART: the part of the prediction, of the correction work.x, that is safe; COUPLE: 1, or 0 where it fails; FIND: points of contact
    alone, which kernels.junctions.lines_contact solves for;
    RADIUS: the spectral radius of the step; JUDGE: 1 where the try has put energy in and has to be repeated in halves,
    else 0; ACCEPT, and STAND, where no step is tried: the energy of contact, J.
    """
    job = read(table)
    line, ends, contact, work, phase = job.line, job.ends, job.contact, job.work, job.call[ASKED]
    old, new = (job.new, job.old) if job.counts.parity else (job.old, job.new)
    rubs, numbers = contact.numbers.friction > 0.0, contact.numbers
    if rubs and phase in (PREDICT, STAND):
        keep_last(contact, job.clock.now)
    if phase == PREDICT:
        near = prepare(line, ends, contact, old, work.u, job.clock.now, job.clock.try_end - job.clock.now)
        job.call[NEAR] = 1 if near else 0
        numbers.tries += 1.0
        if near:
            numbers.quiet = 0.0
        return contact.numbers.part
    if phase == RADIUS:
        clock, rho = job.clock, radius(contact, job.clock, job.call[NEAR] != 0)
        if not job.counts.controlled:
            clock.step_before, clock.rho_before = before_fixed(
                clock.try_end - clock.now, clock.step_before, clock.rho_before, rho
            )
        return rho
    if phase == JUDGE:
        if not puts_energy_in(line, ends, contact, job, job.clock, old, new, work):
            return 0.0
        numbers.quiet -= 1.0
        return 1.0
    if phase == SAFE_PART:
        speed = contact.numbers.speed
        for i in range(work.x.shape[0]):
            for k in range(3):
                contact.move[i, k] = work.x[i, 1 + k]
        limit(line, ends, contact, farthest_from_mean(work.u))
        contact.numbers.speed = speed
        return contact.numbers.part
    place(contact, old, work.u)
    if phase == STAND:
        numbers.keeps = -1.0
    find_points(line, ends, contact, farthest_from_mean(work.u))
    if rubs:
        if phase == STAND:
            contact.x[:, :4] = 0.0
        else:
            find_spins(line, contact, job.clock, job.call[NEAR] != 0, old, new, work.u)
        hold_points(line, contact)
    if phase == ACCEPT and rubs:
        keep_grips(line, contact, contact.counts.points)
        contact.counts.fresh, numbers.since = contact.counts.points, job.clock.try_end
        work.report[SELF_FRICTION_WORK] = numbers.slip_work + numbers.tried - numbers.stored
    if numbers.horizon > 0.0 and phase in (ACCEPT, STAND):
        foresee_nearness(line, ends, contact, new.v if phase == ACCEPT else old.v)
    if phase == ACCEPT:
        numbers.quiet += 1.0
        push_ends(contact, line.h.shape[0])
        load_ends(ends, contact.y, 0, line.h.shape[0], work.report)
    if phase in (ACCEPT, STAND):
        press(line, contact, job.touch, 2 if phase == ACCEPT else 0)
    if phase == FIND:
        return 1.0
    if phase != COUPLE:
        return numbers.energy + (numbers.tried if rubs else 0.0)
    charge(line, contact, job.counts)
    if contact.counts.overflow or (contact.counts.points > 0 and not solve_contact(ends, contact, work)):
        return 0.0
    return 1.0
