"""Contact of lines with themselves and each other: one search, one law and one solve.

The lines stand one after the other as one line of kernels.contact, whose arrays are filled from theirs before every
question and whose answers go back to them.  It is asked by the address of `shared_task`, at the last of these lines:
all others have taken their step by then.

Half of the energy of a point of contact between two lines is of each.  The work that other lines do on a line, W, is
that of the mean of their forces before and after a step on its way, with the change of its half: over all lines it is
that of friction.

In a correction of Newton's method it is solved as in kernels.contact.self_contact, with the matrix A of all
lines, points and bodies in place of that of one line: a product with A^-1 carries a right-hand side on the nodes in
contact through the kept factors of the lines, the junctions and back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.algebra.kept_factors import carry_given, prepare_sweep, sweep
from hybrid.kernels.algebra.rotations import get3
from hybrid.kernels.contact.self_contact import (
    begin_columns,
    combine_vectors,
    contact_task,
    energy_without_weight,
    enough,
    find_forces,
    inner_product,
    is_gain,
    is_judged,
    knows_before,
    length_of,
    load_ends,
    load_vector,
    rotate_column,
    solve_columns,
    unknowns,
    work_of_try,
)
from hybrid.kernels.contact.self_contact import read as read_contact
from hybrid.kernels.contact.self_contact_law import FOOT_PLACE, PLACE, P, Q, add_gradient, add_held, arc_length
from hybrid.kernels.contact.self_contact_pairs import (
    BETWEEN,
    HELD_BETWEEN,
    HELD_WITHIN,
    MOST_PRODUCTS,
    SHARES,
    SLIP_WITHIN,
    WITHIN_LINE,
    first_in_contact,
)
from hybrid.kernels.junctions.borders import (
    END,
    NONE,
    answer_right_sides,
    clear_right_side,
    hand_on,
    keep_corrections,
    push_node,
    put_corrections,
    read_network,
    task_of,
)
from hybrid.kernels.junctions.junctions import move_joints
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.report import SELF_CONTACT_ENERGY, SELF_FRICTION_WORK
from hybrid.kernels.state.state import Blocks, Floats, NumberRows, Rows, blanks
from hybrid.kernels.step.line_step import (
    ACCEPT,
    ASKED,
    COUPLE,
    FIND,
    JUDGE,
    NO_SOLUTION,
    PREDICT,
    RADIUS,
    SAFE_PART,
    STAND,
    ask_contact,
    read,
    touches,
    with_radius,
)

KEPT, LATEST = 0, 1  # of `pushes` and `times`: of the state now, and where the try has led
# Columns of `meetings`.
MET = 0  # when two lines met first, s (nan: never)
MET_S = 1  # at which arc lengths, m
MET_OTHER = 2
MEETING = 3


class SharedJob(NamedTuple):
    """Arguments of the entry; K lines that may touch, with N+1 nodes."""

    tables: NumberRows  # (L, ..) jobs of all lines of the network
    lines: NDArray[np.int64]  # (K,) numbers of those that may touch
    begins: NDArray[np.int64]  # (K,) where their nodes begin
    starts: Floats  # (K,) m, their arc lengths as parts of the one line, less their own
    inner: NDArray[np.int64]  # table of a ContactJob of them as one line
    pushes: Blocks  # (2, N+1, 4) N, N m, forces of other lines on nodes, moments on cells
    shares: Blocks  # (2, K, SHARES) of Contact, likewise
    times: Floats  # (2,) s, of what state these are
    meetings: Blocks  # (K, K, MEETING)


blank_shared_job = blanks(SharedJob)
read_shared = reader(blank_shared_job())


@inner
def gather(job, one):
    """Fill the one line from the lines: lengths, state, way and correction of the step that is tried."""
    for k in range(job.lines.shape[0]):
        line_job, at = read(job.tables[job.lines[k]]), job.begins[k]
        line, old, new, work = line_job.line, line_job.old, line_job.new, line_job.work
        if line_job.reel != 0:  # a winch changes its lengths
            for i in range(old.r.shape[0]):
                one.line.s[at + i] = job.starts[k] + line.s[i]
            for i in range(old.w.shape[0]):
                one.line.h[at + i] = line.h[i]
        for i in range(old.r.shape[0]):
            for j in range(3):
                one.old.r[at + i, j], one.old.v[at + i, j] = old.r[i, j], old.v[i, j]
                one.old.a[at + i, j], one.new.v[at + i, j] = old.a[i, j], new.v[i, j]
                one.work.u[at + i, j], one.work.x[at + i, 1 + j] = work.u[i, j], work.x[i, 1 + j]
        for i in range(old.w.shape[0]):
            one.old.w[at + i], one.old.wa[at + i], one.new.w[at + i] = old.w[i], old.wa[i], new.w[i]


@inner
def keep_latest(job):
    """What belongs to the state where the try has led is of the state now."""
    for i in range(job.pushes.shape[1]):
        for j in range(4):
            job.pushes[KEPT, i, j] = job.pushes[LATEST, i, j]
    for k in range(job.lines.shape[0]):
        for j in range(SHARES):
            job.shares[KEPT, k, j] = job.shares[LATEST, k, j]
    job.times[KEPT] = job.times[LATEST]


@inner
def share_clock(job, one):
    """The time of the try for all lines; what belongs to the last try is kept if that led to the time now."""
    clock = one.clock
    for k in range(job.lines.shape[0]):
        own = read(job.tables[job.lines[k]]).books.clock
        own.now, own.try_end = clock.now, clock.try_end
    if job.times[LATEST] == clock.now:
        keep_latest(job)
    for k in range(job.lines.shape[0]):  # of a try that was not taken
        for m in range(job.lines.shape[0]):
            if job.meetings[k, m, MET] > clock.now:
                job.meetings[k, m, MET] = math.nan


@inner
def find_pushes(one, pushes):
    """Forces of other lines on all nodes, moments of their friction on cells, into (N+1, 4).

    Those of all contact, with the opposite sign, stand in contact.y then.
    """
    contact = one.contact
    y = contact.y
    y[:, :4] = 0.0
    for within in (False, True):
        for k in range(contact.counts.points):
            row = contact.points[k]
            if (contact.of[int(row[P])] == contact.of[int(row[Q])]) == within:
                add_gradient(row, y)
                if contact.numbers.friction > 0.0:
                    add_held(contact, k, y)
        if not within:
            for i in range(y.shape[0]):
                for j in range(3):
                    pushes[i, j] = -y[i, j]
                pushes[i, 3] = -y[i, 3] * contact.rolls[i]


@inner
def note_meetings(job, one, t):
    """When and where two lines met first."""
    contact = one.contact
    for k in range(contact.counts.points):
        p, q = int(contact.points[k, P]), int(contact.points[k, Q])
        a, b = contact.of[p], contact.of[q]
        if a < b and not job.meetings[a, b, MET] <= t:
            job.meetings[a, b, MET] = t
            job.meetings[a, b, MET_S] = arc_length(one.line, contact.kind, p, contact.points[k, PLACE])
            job.meetings[a, b, MET_OTHER] = arc_length(one.line, contact.kind, q, contact.points[k, FOOT_PLACE])


@inner
def work_on(job, one, k):
    """Work in the step, J, of other lines on line k of these, and of its friction on itself."""
    begin, nodes = job.begins[k], read(job.tables[job.lines[k]]).line.s.shape[0]
    x, rubs, now, then = one.contact.x, one.contact.numbers.friction > 0.0, job.shares[LATEST, k], job.shares[KEPT, k]
    done = now[BETWEEN] - then[BETWEEN]
    if rubs:
        done += now[HELD_BETWEEN] - then[HELD_BETWEEN] + now[HELD_WITHIN] - then[HELD_WITHIN] + now[SLIP_WITHIN]
    for i in range(begin, begin + nodes):
        for j in range(3):
            done += 0.5 * (job.pushes[KEPT, i, j] + job.pushes[LATEST, i, j]) * one.work.u[i, j]
        if rubs:
            done += 0.5 * (job.pushes[KEPT, i, 3] + job.pushes[LATEST, i, 3]) * x[i, 3]
    return done


@inner
def spread(job, one, phase):
    """Give the lines what contact has: energy, work, force per length, and what it puts on ends that are held."""
    row, last, y = 2 if phase == ACCEPT else 0, 0.0, one.contact.y
    find_pushes(one, job.pushes[LATEST])
    job.times[LATEST] = one.clock.try_end if phase == ACCEPT else one.clock.now
    for k in range(job.lines.shape[0]):
        for j in range(SHARES):
            job.shares[LATEST, k, j] = one.contact.shares[k, j]
    if phase == STAND:
        keep_latest(job)
    note_meetings(job, one, job.times[LATEST])
    for k in range(job.lines.shape[0]):
        line_job, at, shares = read(job.tables[job.lines[k]]), job.begins[k], one.contact.shares[k]
        report, books, n = line_job.work.report, line_job.books, line_job.line.h.shape[0]
        last = shares[BETWEEN] + shares[WITHIN_LINE]
        if one.contact.numbers.friction > 0.0:
            last += shares[HELD_BETWEEN] + shares[HELD_WITHIN]
        report[SELF_CONTACT_ENERGY] = last
        if books.touch.shape[1] > 0:
            for i in range(n + 1):
                books.touch[row, i] = one.touch[row, at + i]
        if phase == ACCEPT:
            report[SELF_FRICTION_WORK] = work_on(job, one, k)
            load_ends(line_job.ends, y, at, n, report)
    return last


@inner
def energy_of(job, one, tried):
    """Energy, J, of motion, strain and contact of all lines, without that of weight: now, or where the try has led."""
    energy = 0.0
    for k in range(job.lines.shape[0]):
        line_job = read(job.tables[job.lines[k]])
        line, ends = line_job.line, line_job.ends
        if tried:
            energy += energy_without_weight(line, ends, one.contact, line_job.new, line_job.work.report)
        else:
            energy += energy_without_weight(line, ends, one.contact, line_job.old, line_job.books.report[0])
    return energy


@inner
def puts_energy_in(job, one):
    """As kernels.contact.self_contact.puts_energy_in, of all lines together."""
    contact, clock = one.contact, one.clock
    numbers = contact.numbers
    if not is_judged(numbers):
        return False
    for k in range(job.lines.shape[0]):
        if read(job.tables[job.lines[k]]).reel != 0:  # what a winch does is not known here
            return False
    if not knows_before(numbers, clock.now):
        numbers.had, numbers.begun = energy_of(job, one, False), clock.now
    numbers.has, numbers.led = energy_of(job, one, True), clock.try_end
    done, missed = 0.0, 0.0
    if numbers.friction > 0.0:
        done = numbers.slip_work + numbers.tried - numbers.stored
    for k in range(job.lines.shape[0]):
        line_job = read(job.tables[job.lines[k]])
        books, line, new, work = line_job.books, line_job.line, line_job.new, line_job.work
        move_joints(line_job)
        velocity, power = books.velocity, books.power[0]
        more, off = work_of_try(line, line_job.ends, contact, velocity, power, new, work, books.clock)
        done += more - work.report[SELF_FRICTION_WORK]
        missed += off
    return is_gain(contact, one.work.u, done, missed)


@kernel
def shared_task(table):
    """What is asked of contact as of kernels.contact.self_contact.contact_task, for lines that stand as one."""
    job = read_shared(table)
    one, last = read_contact(job.inner), read(job.tables[job.lines[job.lines.shape[0] - 1]])
    phase = one.call[ASKED]
    one.counts.controlled, one.counts.parity = last.books.counts.controlled, 0
    if phase == JUDGE:
        return 1.0 if puts_energy_in(job, one) else 0.0
    if phase == PREDICT:
        share_clock(job, one)
    gather(job, one)
    value = contact_task(job.inner)
    if phase in (ACCEPT, STAND):
        return spread(job, one, phase)
    return value


class TouchingJob(NamedTuple):
    """Arguments of the entry; L lines, T nodes of all lines."""

    network: NDArray[np.int64]  # as of kernels.junctions.borders.BorderJob
    shared: NumberRows  # (L, 2) the line that has the contact of a line (-1: none has), where its nodes begin there
    contacts: NumberRows  # (L, ..) tables of kernels.contact.self_contact.ContactJob, of lines that have contact
    kept: Rows  # (T, 5) corrections of lines without contact
    moved: Rows  # (B, 6) and of bodies
    hessenberg: Rows  # as kernels.contact.self_contact_pairs.Contact has it
    rests: NDArray[np.int64]  # (1,) 1: of a state in which no step is tried
    rank: int = 0


blank_touching_job = blanks(TouchingJob)
read_job = reader(blank_touching_job())


@inner
def set_right_side(network, l, contact, first, touches, exactly):
    """The right-hand side of the eliminated line l: forces contact.y on the nodes in contact, or nothing.

    first: where its nodes begin in contact; exactly: not by way of `sweep`.
    """
    clear_right_side(network, l)
    line_job = read(network.tables[l])
    work, n, joined = line_job.work, line_job.line.h.shape[0], network.joints[l, END] != NONE
    begin = first_in_contact(contact, first, n) if touches else n + 1
    for i in range(begin, n + 1):
        if contact.marks[first + i] != 0:
            push_node(network, l, i, get3(contact.y, first + i))
            work.x[i, 4] = contact.y[first + i, 3] * contact.rolls[first + i]
    if begin > n:
        return
    if exactly:
        carry_given(work.X, work.W, contact.marks[first:], work.x, joined, begin)
    else:
        sweep(work.X, work.W, contact.sweep[first:], contact.marks[first:], work.x, joined, begin)
    hand_on(work, joined, begin)


@called
def respond(network, job, with_gradient):
    """Corrections work.x of all lines by the forces of contact at contact.x; False if they are not finite."""
    for l in range(network.tables.shape[0]):
        if touching(network, job, l) > 0:
            find_forces(read_contact(job.contacts[l]).contact, with_gradient)
    for l in range(network.tables.shape[0]):
        lead, touches = max(job.shared[l, 0], 0), False
        contact = read_contact(job.contacts[lead]).contact
        if job.shared[l, 0] >= 0:
            touches = contact.counts.points > 0
        set_right_side(network, l, contact, job.shared[l, 1], touches, with_gradient)
    return answer_right_sides(network, job.rank)


@inner
def prepare_sweeps(network, job):
    """What sweeps take of the factors of lines in contact; returns unknowns of GMRES, and the largest diameter, m."""
    size, width = 0, 0.0
    for l in range(network.tables.shape[0]):
        if job.shared[l, 0] >= 0:
            contact, first = read_contact(job.contacts[job.shared[l, 0]]).contact, job.shared[l, 1]
            line_job = read(network.tables[l])
            n, work = line_job.line.h.shape[0], line_job.work
            if contact.counts.points > 0:
                prepare_sweep(work.X, work.W, contact.sweep[first:], first_in_contact(contact, first, n), n)
        if touching(network, job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            size, width = size + unknowns(contact) * contact.counts.nodes, max(width, contact.numbers.widest)
    return size, width


@inner
def touching(network, job, l):
    """Points of the contact that a line has."""
    line_job = read(network.tables[l])
    if not touches(line_job):
        return 0
    return read_contact(job.contacts[l]).contact.counts.points


@inner
def product(network, job, k, l):
    """Dot product of the vectors k and l of the basis, over all lines."""
    s = 0.0
    for line in range(network.tables.shape[0]):
        if touching(network, job, line) > 0:
            contact = read_contact(job.contacts[line]).contact
            s += inner_product(contact.basis[k], contact.basis[l], unknowns(contact) * contact.counts.nodes)
    return s


@inner
def add_vector(network, job, k, part, l):
    """Add part of basis vector k to vector l; where both are the same, it is multiplied by it."""
    for line in range(network.tables.shape[0]):
        if touching(network, job, line) > 0:
            contact = read_contact(job.contacts[line]).contact
            V = contact.basis
            for i in range(unknowns(contact) * contact.counts.nodes):
                V[l, i] = part * V[l, i] if k == l else V[l, i] + part * V[k, i]


@inner
def put_response(network, job, column, first):
    """Basis vector `column` by what lines have done: the residual at zero (first), or that before it less its product."""
    for l in range(network.tables.shape[0]):
        at = network.begins[l]
        if job.shared[l, 0] >= 0:
            contact, o = read_contact(job.contacts[job.shared[l, 0]]).contact, job.shared[l, 1]
            z, x = contact.z, read(network.tables[l]).work.x
            for i in range(x.shape[0]):
                for j in range(1, SIZE):
                    z[o + i, j] = x[i, j] + job.kept[at + i, j] if first else x[i, j]
                z[o + i, 4] *= contact.rolls[o + i]
    for l in range(network.tables.shape[0]):
        if touching(network, job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            V, per, z = contact.basis, unknowns(contact), contact.z
            for k in range(contact.counts.nodes):
                i = contact.nodes[k]
                for j in range(per):
                    y = z[i, 1 + j] * length_of(contact, j, i)
                    V[column, per * k + j] = y if first else V[column - 1, per * k + j] - y


@inner
def set_unknowns(network, job, column):
    """contact.x of all lines: basis vector `column`; -1: zero."""
    for l in range(network.tables.shape[0]):
        if touching(network, job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            if column >= 0:
                load_vector(contact, column)
            else:
                for k in range(contact.counts.nodes):
                    for j in range(4):
                        contact.x[contact.nodes[k], j] = 0.0


@inner
def find_solution(network, job):
    """GMRES from zero: contact.x = the correction of the nodes in contact of all lines; False: not finite."""
    H = job.hessenberg
    unknown, width = prepare_sweeps(network, job)
    set_unknowns(network, job, -1)
    if not respond(network, job, True):
        return False
    put_response(network, job, 0, True)
    s = math.sqrt(product(network, job, 0, 0))
    begin_columns(H, s)
    left, done = s, 0
    if s > 0.0:
        add_vector(network, job, 0, 1.0 / s, 0)
        most = enough(s, width, unknown)
        while done < MOST_PRODUCTS and left > most:
            set_unknowns(network, job, done)
            if not respond(network, job, False):
                return False
            put_response(network, job, done + 1, False)
            for j in range(done + 1):
                H[j, done] = product(network, job, j, done + 1)
                add_vector(network, job, j, -H[j, done], done + 1)
            size = math.sqrt(product(network, job, done + 1, done + 1))
            H[done + 1, done] = size
            if size > 0.0:
                add_vector(network, job, done + 1, 1.0 / size, done + 1)
            left = rotate_column(H, done)
            done += 1
    solve_columns(H, done)
    for l in range(network.tables.shape[0]):
        if touching(network, job, l) > 0:
            combine_vectors(read_contact(job.contacts[l]).contact, H, done)
    return True


@inner
def put_contact(network, job):
    """Put contact into the corrections of all lines and bodies; NO_SOLUTION: it fails."""
    points = 0
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        if touches(line_job):
            ask_contact(line_job, STAND if job.rests[0] else FIND)
            contact = read_contact(job.contacts[l]).contact
            if contact.counts.overflow:
                return NO_SOLUTION
            points += contact.counts.points
    if points == 0:
        return 1.0
    keep_corrections(network, job.kept, job.moved)
    if not find_solution(network, job) or not respond(network, job, True):
        return NO_SOLUTION
    put_corrections(network, 1.0, 1.0, job.kept, job.moved)
    return 1.0


@inner
def prepare_contact(network):
    """Before a try of a step: the part of the prediction that is safe, of all lines; each line has the radius of all."""
    safe, task, t = 1.0, task_of(network.asked), network.asked.time
    rho = task.rho
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        if touches(job):
            clock = job.books.clock
            clock.now, clock.try_end, clock.step_before, clock.rho = t - task.dt, t, task.before, task.rho
            clock.rho_before = task.rho_before
            safe = min(safe, ask_contact(job, PREDICT))
            rho = min(rho, ask_contact(job, RADIUS))
    common = with_radius(task, rho)
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        if touches(job):
            own = ask_contact(job, RADIUS)
            clock = job.books.clock
            if own > rho:
                clock.rho *= rho / own
            clock.step_before, clock.rho_before = common.before, common.rho_before
    network.asked.rho_of_step = rho
    return safe


@inner
def safe_part(network):
    """The part of a correction by which no line passes through itself or another one."""
    part = 1.0
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        if touches(job):
            part = min(part, ask_contact(job, SAFE_PART))
    return part


@kernel
def touch_network(table):
    """Answer for contact of lines with themselves and each other (kernels.junctions.borders)."""
    job = read_job(table)
    network = read_network(job.network)
    question = network.phase[0]
    if question == PREDICT:
        return prepare_contact(network)
    if question == COUPLE:
        return put_contact(network, job)
    if question == SAFE_PART:
        return safe_part(network)
    return 1.0
