"""Contact of a line with itself in a step: pairs of pieces that are near, limits of corrections, and their solution.

A run calls `contact_task` by its address, so that lines without self-contact compile none of it: before a try of a step
(PREPARE), to shorten what Newton's method predicts and corrects so that no two strands pass through each other (LIMIT),
to put the forces of contact into a correction (TOUCH), and for the energy at the end (FINISH).

Contact couples nodes that are no neighbours, which the block rows along s do not know.  It is added to their solution
x0 with the kept factors of the matrix A: (A - H) x = b + g is x = A^-1 b + A^-1 (g + H x), of which only the nodes in
contact are unknown; GMRES finds them, each product with A^-1 being one more substitution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.block_elimination import solve_again
from hybrid.kernels.books import CLOCK_SIZE, COUNT_SIZE, NOW, PARITY, RHO, STEP_BEFORE, TRY_END
from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.generalized_alpha import scheme
from hybrid.kernels.newton import ASKED, FINISH, LIMIT, NEAR, PREPARE, RADIUS, REST, TOUCH
from hybrid.kernels.references import reader
from hybrid.kernels.report import FORCE_A, SELF_FRICTION_WORK
from hybrid.kernels.self_contact_friction import (
    GRIP,
    add_held,
    add_held_product,
    hold_point,
    keep_grips,
    link_grips,
)
from hybrid.kernels.self_contact_law import FORCE, WX, WY, P, Q, add_gradient, add_product
from hybrid.kernels.self_contact_pairs import (
    CALMS,
    ENERGY,
    FADED,
    FADES,
    FRESH,
    FRICTION,
    GRIPS,
    HORIZON,
    KEEPS,
    MOST_PRODUCTS,
    NODES,
    OVERFLOW,
    PART,
    POINTS,
    QUIET,
    RETURNS,
    ROLLS,
    SINCE,
    SLIP_WORK,
    SPEED,
    STALE,
    STORED,
    TRIED,
    TRIES,
    WIDEST,
    Contact,
    blank_contact,
    farthest_from_mean,
    find_points,
    keep_pairs,
    limit,
    look_ahead,
)
from hybrid.kernels.state import Ends, Floats, Line, State, Work, blank_line, blank_state, no_ends, no_work

SOLVED = 1e-7  # residual of GMRES, as a part of the first


class ContactJob(NamedTuple):
    """Arguments of the entry: two states in turn as kernels.run has them, its clock and counts."""

    line: Line
    ends: Ends
    old: State
    new: State
    work: Work
    clock: Floats
    counts: NDArray[np.int64]
    call: NDArray[np.int64]
    contact: Contact
    touch: Floats  # (3, N+1) as kernels.books.Books has it


def blank_contact_job() -> ContactJob:
    """A job with the types that every one has."""
    state = blank_state(1)
    clock, counts = np.zeros(CLOCK_SIZE), np.zeros(COUNT_SIZE, np.int64)
    call = np.zeros(3, np.int64)
    return ContactJob(
        blank_line(1), no_ends(), state, state, no_work(), clock, counts, call, blank_contact(1),
        np.zeros((3, 2)),
    )  # fmt: skip


read = reader(blank_contact_job())


# --- the correction -------------------------------------------------------------------------------


@inner
def respond(line, ends, contact, work, with_gradient):
    """contact.z = A^-1 (H x + g), g where asked; x of the nodes in contact."""
    held_on = contact.numbers[FRICTION] > 0.0
    x, y, b, count = contact.x, contact.y, contact.b, contact.counts[NODES]
    for k in range(count):
        i = contact.nodes[k]
        y[i, 0], y[i, 1], y[i, 2], y[i, 3] = 0.0, 0.0, 0.0, 0.0
    for k in range(contact.counts[POINTS]):
        add_product(contact.points[k], x, y)
        if with_gradient:
            add_gradient(contact.points[k], y)
        if held_on:
            add_held_product(line, contact, k, x, y)
            if with_gradient:
                add_held(line, contact, k, y)
    last = y.shape[0] - 1
    for k in range(count):
        i = contact.nodes[k]
        held = (i == 0 and ends.held[0] != 0) or (i == last and ends.held[1] != 0)
        for j in range(3):
            b[i, 1 + j] = 0.0 if held else y[i, j]
        b[i, 4] = y[i, 3] * contact.numbers[ROLLS]
    good = solve_again(work.X, work.W, b, contact.z)
    for k in range(count):
        i = contact.nodes[k]
        b[i, 1], b[i, 2], b[i, 3], b[i, 4] = 0.0, 0.0, 0.0, 0.0
    return good


@inner
def unknowns(contact):
    """Unknowns of a node in contact: its place, with friction the spin of the cell after it too, as a way."""
    return 4 if contact.numbers[FRICTION] > 0.0 and contact.numbers[ROLLS] > 0.0 else 3


@inner
def length_of(contact, j, i):
    """Factor, m, of unknown j of node i: a spin (rad) counts by the radius."""
    return 0.5 * contact.width[i] if j == 3 else 1.0


@inner
def next_vector(contact, k):
    """Orthogonalise basis vector k + 1 against those before; its length goes into the column k."""
    V, H, size = contact.basis, contact.hessenberg, unknowns(contact) * contact.counts[NODES]
    for j in range(k + 1):
        s = 0.0
        for i in range(size):
            s += V[j, i] * V[k + 1, i]
        H[j, k] = s
        for i in range(size):
            V[k + 1, i] -= s * V[j, i]
    s = 0.0
    for i in range(size):
        s += V[k + 1, i] * V[k + 1, i]
    s = math.sqrt(s)
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
def take_vector(contact, column):
    """contact.x = the basis vector of a column."""
    x, V, per = contact.x, contact.basis, unknowns(contact)
    for k in range(contact.counts[NODES]):
        i = contact.nodes[k]
        for j in range(per):
            x[i, j] = V[column, per * k + j] / length_of(contact, j, i)


@inner
def find_solution(line, ends, contact, work):
    """GMRES: contact.x = the correction of the nodes in contact; False: not finite.

    It begins at zero, where the residual is A^-1 (b + g), which falls as Newton converges.  The correction x0 of a line
    without contact stays large, as the force of contact is left out of b: what SOLVED leaves of it would never fall.
    """
    x, z, V, H = contact.x, contact.z, contact.basis, contact.hessenberg
    count, per, rhs, solution = contact.counts[NODES], unknowns(contact), MOST_PRODUCTS + 2, MOST_PRODUCTS + 3
    for k in range(count):
        i = contact.nodes[k]
        for j in range(per):
            x[i, j] = 0.0
    if not respond(line, ends, contact, work, True):
        return False
    s = 0.0
    for k in range(count):
        i = contact.nodes[k]
        for j in range(per):
            y = (work.x[i, 1 + j] + z[i, 1 + j]) * length_of(contact, j, i)
            V[0, per * k + j] = y
            s += y * y
    s = math.sqrt(s)
    for i in range(MOST_PRODUCTS + 1):
        H[i, rhs] = 0.0
    H[0, rhs] = s
    done = 0
    if s > 0.0:
        for i in range(per * count):
            V[0, i] /= s
        left = s
        while done < min(MOST_PRODUCTS, per * count) and left > SOLVED * s:
            take_vector(contact, done)
            if not respond(line, ends, contact, work, False):
                return False
            for k in range(count):
                i = contact.nodes[k]
                for j in range(per):
                    V[done + 1, per * k + j] = V[done, per * k + j] - z[i, 1 + j] * length_of(contact, j, i)
            next_vector(contact, done)
            left = rotate_column(H, done)
            done += 1
    for j in range(done - 1, -1, -1):
        s = H[j, rhs]
        for k in range(j + 1, done):
            s -= H[j, k] * H[k, solution]
        H[j, solution] = s / H[j, j]
    for k in range(count):
        i = contact.nodes[k]
        for m in range(per):
            s = 0.0
            for j in range(done):
                s += H[j, solution] * V[j, per * k + m]
            x[i, m] = s / length_of(contact, m, i)
    return True


@inner
def solve_contact(line, ends, contact, work):
    """Put contact into the correction work.x of a line without it; False if it is not finite."""
    if not find_solution(line, ends, contact, work) or not respond(line, ends, contact, work, True):
        return False
    z = contact.z
    for i in range(work.x.shape[0]):
        for j in range(5):
            work.x[i, j] += z[i, j]
    return True


# --- friction -------------------------------------------------------------------------------------


@inner
def keep_last(contact, now):
    """What the last try has left of friction is kept if that was the step that led to the time now."""
    numbers, counts = contact.numbers, contact.counts
    if numbers[SINCE] == now:
        counts[GRIPS], numbers[STORED] = counts[FRESH], numbers[TRIED]
        for k in range(counts[FRESH]):
            for j in range(GRIP):
                contact.grips[k, j] = contact.fresh[k, j]
    numbers[SINCE] = math.nan
    link_grips(contact, counts[GRIPS])


@inner
def radius(contact, clock, near):
    """Spectral radius at infinity of a step: 0 near contact, and from there back to that of the run."""
    if near:
        return 0.0
    part = (contact.numbers[QUIET] - CALMS) / RETURNS
    return clock[RHO] * min(max(part, 0.0), 1.0)


@inner
def find_spins(line, contact, clock, near, old, new, u):
    """contact.x = shifts of nodes and spins of cells in the step that is tried."""
    x, dt = contact.x, clock[TRY_END] - clock[NOW]
    cv = scheme(radius(contact, clock, near), clock[STEP_BEFORE], dt).cv
    for i in range(u.shape[0]):
        for k in range(3):
            x[i, k] = u[i, k]
        x[i, 3] = 0.0
        if i < line.h.shape[0] and line.spin[i] and contact.numbers[ROLLS] > 0.0:
            ahead = dt * old.wa[i]
            x[i, 3] = dt * old.w[i] + 0.5 * dt * ahead + (new.w[i] - old.w[i] - ahead) / cv


@inner
def hold_points(line, contact):
    """Friction of all points of contact at contact.x."""
    numbers = contact.numbers
    numbers[SLIP_WORK], numbers[TRIED] = 0.0, 0.0
    for k in range(contact.counts[POINTS]):
        work, energy = hold_point(line, contact, numbers[FRICTION], contact.points[k], contact.holds[k], numbers[TRIES])
        numbers[SLIP_WORK] += work
        numbers[TRIED] += energy


@inner
def rest_points(line, contact):
    """Friction of a state in which no step is tried."""
    for i in range(contact.x.shape[0]):
        for k in range(4):
            contact.x[i, k] = 0.0
    hold_points(line, contact)


# --- entry ----------------------------------------------------------------------------------------


@inner
def place(contact, old, u):
    """The nodes of a configuration."""
    for i in range(u.shape[0]):
        for k in range(3):
            contact.at[i, k] = old.r[i, k] + u[i, k]
    contact.counts[STALE] = 1


@inner
def prepare(line, ends, contact, old, u, now, dt):
    """Before a try of a step of dt from the time now: how much of the prediction is safe, whether it comes to contact.

    The size of the law follows the speed of what meets.  While anything touches it fades to what still moves: what is
    at rest must not depend on how fast it came there.  It does not grow then, which would put energy in.
    """
    numbers, speed = contact.numbers, contact.numbers[SPEED]
    for i in range(u.shape[0]):
        for k in range(3):
            u[i, k] = 0.0
            contact.move[i, k] = dt * old.v[i, k] + 0.5 * dt * dt * old.a[i, k]
    place(contact, old, u)
    keep_pairs(line, ends, contact)
    find_points(line, ends, contact, 0.0)
    numbers[SPEED] = 0.0
    limit(line, ends, contact, 0.0)
    near = numbers[SPEED] > 0.0 or contact.counts[POINTS] > 0
    seen = numbers[SPEED] / dt
    if contact.counts[POINTS] > 0:
        since = now - numbers[FADED] if numbers[FADED] < now else 0.0
        faded = speed / (1.0 + speed * since / (FADES * numbers[WIDEST]))
        seen = min(speed, max(faded, seen))
    numbers[SPEED], numbers[FADED] = seen, now
    return near


@inner
def press(line, contact, touch, row):
    """Force across per length, N/m, at the nodes, into a row of `touch`: of both strands, as the seabed has it."""
    n = line.h.shape[0]
    for i in range(n + 1):
        touch[row, i] = 0.0
    for k in range(contact.counts[POINTS]):
        point = contact.points[k]
        p, q = int(point[P]), int(point[Q])
        for j in range(3):
            touch[row, p - 1 + j] -= point[WX + j] * point[FORCE]
            touch[row, q - 1 + j] -= point[WY + j] * point[FORCE]
    for i in range(n + 1):
        a, b = line.s[max(i - 1, 0)], line.s[min(i + 1, n)]
        touch[row, i] *= 2.0 / (b - a)


@inner
def load_ends(line, ends, contact, report):
    """Add the force of contact on the end nodes that are held to what the report says these bear."""
    y, n = contact.y, line.h.shape[0]
    for k in range(2):
        for j in range(3):
            y[k * n, j] = 0.0
    for i in range(contact.counts[POINTS]):
        point = contact.points[i]
        p, q = int(point[P]), int(point[Q])
        if min(p, q) == 1 or max(p, q) == n - 1:
            add_gradient(point, y)
            if contact.numbers[FRICTION] > 0.0:
                add_held(line, contact, i, y)
    for k in range(2):
        if ends.held[k] != 0:
            for j in range(3):
                report[FORCE_A + 3 * k + j] -= y[k * n, j]


@kernel
def contact_task(table):
    """What is asked by `call[ASKED]` of the configuration old.r + work.u.

    PREPARE, LIMIT: the part of the prediction, of the correction work.x, that is safe; TOUCH: 1, or 0 where it fails;
    RADIUS: the spectral radius of the step; FINISH, and REST, where no step is tried: the energy of contact, J.
    """
    job = read(table)
    line, ends, contact, work, phase = job.line, job.ends, job.contact, job.work, job.call[ASKED]
    old, new = (job.new, job.old) if job.counts[PARITY] else (job.old, job.new)
    rubs, numbers = contact.numbers[FRICTION] > 0.0, contact.numbers
    if rubs and phase in (PREPARE, REST):
        keep_last(contact, job.clock[NOW])
    if phase == PREPARE:
        near = prepare(line, ends, contact, old, work.u, job.clock[NOW], job.clock[TRY_END] - job.clock[NOW])
        job.call[NEAR] = 1 if near else 0
        numbers[TRIES] += 1.0
        if near:
            numbers[QUIET] = 0.0
        return contact.numbers[PART]
    if phase == RADIUS:
        return radius(contact, job.clock, job.call[NEAR] != 0)
    if phase == LIMIT:
        speed = contact.numbers[SPEED]
        for i in range(work.x.shape[0]):
            for k in range(3):
                contact.move[i, k] = work.x[i, 1 + k]
        limit(line, ends, contact, farthest_from_mean(work.u))
        contact.numbers[SPEED] = speed
        return contact.numbers[PART]
    place(contact, old, work.u)
    if phase == REST:
        numbers[KEEPS] = -1.0
    find_points(line, ends, contact, farthest_from_mean(work.u))
    if rubs and phase == REST:
        rest_points(line, contact)
    elif rubs:
        find_spins(line, contact, job.clock, job.call[NEAR] != 0, old, new, work.u)
        hold_points(line, contact)
    if phase == FINISH and rubs:
        keep_grips(line, contact, contact.counts[POINTS])
        contact.counts[FRESH], numbers[SINCE] = contact.counts[POINTS], job.clock[TRY_END]
        work.report[SELF_FRICTION_WORK] = numbers[SLIP_WORK] + numbers[TRIED] - numbers[STORED]
    if numbers[HORIZON] > 0.0 and phase in (FINISH, REST):
        look_ahead(line, ends, contact, new.v if phase == FINISH else old.v)
    if phase == FINISH:
        numbers[QUIET] += 1.0
        load_ends(line, ends, contact, work.report)
    if phase in (FINISH, REST):
        press(line, contact, job.touch, 2 if phase == FINISH else 0)
    if phase != TOUCH:
        return numbers[ENERGY] + (numbers[TRIED] if rubs else 0.0)
    if contact.counts[OVERFLOW] or (contact.counts[POINTS] > 0 and not solve_contact(line, ends, contact, work)):
        return 0.0
    return 1.0
