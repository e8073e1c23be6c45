"""Contact of the lines of a system with themselves and each other in a correction of Newton's method, beside the lines' junctions.

As kernels.contact.self_contact_solve, with the matrix A of all lines, points and bodies in place of that of one line: a product
with A^-1 carries a right-hand side on the nodes in contact through the kept factors of the lines, the junctions and back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import ROW, SIZE, SPAN
from hybrid.kernels.algebra.kept_factors import carry_given, prepare_sweep, sweep
from hybrid.kernels.contact.self_contact import read as read_contact
from hybrid.kernels.contact.self_contact_pairs import MOST_PRODUCTS
from hybrid.kernels.contact.self_contact_solve import (
    enough,
    find_forces,
    inner_product,
    length_of,
    rotate_column,
    take_vector,
    unknowns,
)
from hybrid.kernels.junctions.borders import (
    COUPLE,
    END,
    NO_SOLUTION,
    PREDICT,
    SAFE_PART,
    SPECTRAL_RADIUS,
    START,
    add_corrections,
    answer_right_sides,
    is_fixed,
    keep_corrections,
)
from hybrid.kernels.junctions.joined_lines import last_block
from hybrid.kernels.junctions.network_job import read_system, task_of
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.job import read
from hybrid.kernels.step.newton import ADDRESS, FIND, LIMIT, PREPARE, RADIUS, REST, ask_contact, with_radius


class TouchingJob(NamedTuple):
    """Arguments of the entry; L lines, T nodes of all lines."""

    system: NDArray[np.int64]  # as of kernels.junctions.borders.BorderJob
    shared: NDArray[
        np.int64
    ]  # (L, 2) the line that has the contact of a line (-1: none has), where its nodes begin there
    contacts: NDArray[np.int64]  # (L, ..) tables of kernels.contact.self_contact.ContactJob, of lines that have contact
    kept: Floats  # (T, 5) corrections of lines without contact
    moved: Floats  # (B, 6) and of bodies
    hessenberg: Floats  # as kernels.contact.self_contact_pairs.Contact has it
    rests: NDArray[np.int64]  # (1,) 1: of a state in which no step is tried
    rank: int = 0


def blank_touching_job() -> TouchingJob:
    """A job with the types that every one has."""
    z, one, two = np.zeros, np.zeros(1, np.int64), np.zeros((1, 2), np.int64)
    return TouchingJob(one, two, two, z((2, SIZE)), z((1, 6)), room_for_products(), one)


def room_for_products() -> Floats:
    """Columns of GMRES, with rotations, right-hand side and solution."""
    return np.zeros((MOST_PRODUCTS + 1, MOST_PRODUCTS + 4))


read_job = reader(blank_touching_job())


@inner
def first_in_contact(contact, first, n):
    """The first of the n + 1 nodes of a line that is in contact; n + 1: none is.  first: where they begin there."""
    for i in range(n + 1):
        if contact.marks[first + i] != 0:
            return i
    return n + 1


@inner
def set_right_side(l, line_job, contact, first, joints, touches, exactly):
    """The right-hand side of an eliminated line: forces contact.y on the nodes in contact, or nothing.

    first: where its nodes begin in contact; exactly: not by way of `sweep`.
    """
    work, n, ends = line_job.work, line_job.line.h.shape[0], line_job.ends
    x, X_, joined = work.x, work.X, joints[l, END] >= 0
    if joints[l, START] >= 0:
        for a in range(3):
            work.rows[0, (a + 1) * 24 + 23] = 0.0
    begin = first_in_contact(contact, first, n) if touches else n + 1
    for i in range(begin, n + 1):
        for j in range(SIZE):
            x[i, j] = 0.0
        if contact.marks[first + i] == 0:
            continue
        if i == 0 and joints[l, START] >= 0:  # the march has replaced its balance by its place
            for a in range(3):
                work.rows[0, (a + 1) * 24 + 23] = contact.y[first, a]
        elif not is_fixed(ends, i, n):
            for j in range(3):
                x[i, 1 + j] = contact.y[first + i, j]
        x[i, 4] = contact.y[first + i, 3] * contact.rolls[first + i]
    if begin <= n and exactly:
        carry_given(X_, work.W, contact.marks[first:], x, joined, begin)
    elif begin <= n:
        sweep(X_, work.W, contact.sweep[first:], contact.marks[first:], x, joined, begin)
    for i in range(n + 1):
        for k in range(SIZE):
            X_[i * ROW + k * SPAN + SPAN - 1] = x[i, k] if i >= begin else 0.0
    if joined:
        o = last_block(X_, n)
        for k in range(SIZE):
            X_[o + 64 + k] = x[n, k] if n >= begin else 0.0


@called
def respond(system, job, with_gradient):
    """Corrections work.x of all lines by the forces of contact at contact.x; False if they are not finite."""
    for l in range(system.tables.shape[0]):
        if touching(system, job, l) > 0:
            find_forces(read_contact(job.contacts[l]).contact, with_gradient)
    for l in range(system.tables.shape[0]):
        lead, touches = max(job.shared[l, 0], 0), False
        contact = read_contact(job.contacts[lead]).contact
        if job.shared[l, 0] >= 0:
            touches = contact.counts.points > 0
        set_right_side(l, read(system.tables[l]), contact, job.shared[l, 1], system.joints, touches, with_gradient)
    return answer_right_sides(system, job.rank)


@inner
def prepare_sweeps(system, job):
    """What sweeps take of the factors of lines in contact; returns unknowns of GMRES, and the largest diameter, m."""
    size, width = 0, 0.0
    for l in range(system.tables.shape[0]):
        if job.shared[l, 0] >= 0:
            contact, first = read_contact(job.contacts[job.shared[l, 0]]).contact, job.shared[l, 1]
            line_job = read(system.tables[l])
            n, work = line_job.line.h.shape[0], line_job.work
            if contact.counts.points > 0:
                prepare_sweep(work.X, work.W, contact.sweep[first:], first_in_contact(contact, first, n), n)
        if touching(system, job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            size, width = size + unknowns(contact) * contact.counts.nodes, max(width, contact.numbers.widest)
    return size, width


@inner
def touching(system, job, l):
    """Points of the contact that a line has."""
    line_job = read(system.tables[l])
    if not line_job.contact[ADDRESS] > 0:
        return 0
    return read_contact(job.contacts[l]).contact.counts.points


@inner
def product(system, job, k, l):
    """Dot product of the vectors k and l of the basis, over all lines."""
    s = 0.0
    for line in range(system.tables.shape[0]):
        if touching(system, job, line) > 0:
            contact = read_contact(job.contacts[line]).contact
            s += inner_product(contact.basis[k], contact.basis[l], unknowns(contact) * contact.counts.nodes)
    return s


@inner
def add_vector(system, job, k, part, l):
    """Add part of basis vector k to vector l; where both are the same, it is multiplied by it."""
    for line in range(system.tables.shape[0]):
        if touching(system, job, line) > 0:
            contact = read_contact(job.contacts[line]).contact
            V = contact.basis
            for i in range(unknowns(contact) * contact.counts.nodes):
                V[l, i] = part * V[l, i] if k == l else V[l, i] + part * V[k, i]


@inner
def put_response(system, job, column, first):
    """Basis vector `column` by what lines have done: the residual at zero (first), or that before it less its product."""
    for l in range(system.tables.shape[0]):
        at = system.begins[l]
        if job.shared[l, 0] >= 0:
            contact, o = read_contact(job.contacts[job.shared[l, 0]]).contact, job.shared[l, 1]
            z, x = contact.z, read(system.tables[l]).work.x
            for i in range(x.shape[0]):
                for j in range(1, SIZE):
                    z[o + i, j] = x[i, j] + job.kept[at + i, j] if first else x[i, j]
                z[o + i, 4] *= contact.rolls[o + i]
    for l in range(system.tables.shape[0]):
        if touching(system, job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            V, per, z = contact.basis, unknowns(contact), contact.z
            for k in range(contact.counts.nodes):
                i = contact.nodes[k]
                for j in range(per):
                    y = z[i, 1 + j] * length_of(contact, j, i)
                    V[column, per * k + j] = y if first else V[column - 1, per * k + j] - y


@inner
def set_unknowns(system, job, column):
    """contact.x of all lines: basis vector `column`; -1: zero."""
    for l in range(system.tables.shape[0]):
        if touching(system, job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            if column >= 0:
                take_vector(contact, column)
            else:
                for k in range(contact.counts.nodes):
                    for j in range(4):
                        contact.x[contact.nodes[k], j] = 0.0


@inner
def combine(system, job, done):
    """contact.x of all lines: the vectors of the basis with the solution of the least-squares problem."""
    H, solution = job.hessenberg, MOST_PRODUCTS + 3
    for l in range(system.tables.shape[0]):
        if touching(system, job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            per = unknowns(contact)
            for k in range(contact.counts.nodes):
                i = contact.nodes[k]
                for m in range(per):
                    s = 0.0
                    for j in range(done):
                        s += H[j, solution] * contact.basis[j, per * k + m]
                    contact.x[i, m] = s / length_of(contact, m, i)


@inner
def find_solution(system, job):
    """GMRES from zero: contact.x = the correction of the nodes in contact of all lines; False: not finite."""
    H, rhs, solution = job.hessenberg, MOST_PRODUCTS + 2, MOST_PRODUCTS + 3
    unknown, width = prepare_sweeps(system, job)
    set_unknowns(system, job, -1)
    if not respond(system, job, True):
        return False
    put_response(system, job, 0, True)
    for i in range(MOST_PRODUCTS + 1):
        H[i, rhs] = 0.0
    s = math.sqrt(product(system, job, 0, 0))
    H[0, rhs], left, done = s, s, 0
    if s > 0.0:
        add_vector(system, job, 0, 1.0 / s, 0)
        most = enough(s, width, unknown)
        while done < MOST_PRODUCTS and left > most:
            set_unknowns(system, job, done)
            if not respond(system, job, False):
                return False
            put_response(system, job, done + 1, False)
            for j in range(done + 1):
                H[j, done] = product(system, job, j, done + 1)
                add_vector(system, job, j, -H[j, done], done + 1)
            size = math.sqrt(product(system, job, done + 1, done + 1))
            H[done + 1, done] = size
            if size > 0.0:
                add_vector(system, job, done + 1, 1.0 / size, done + 1)
            left = rotate_column(H, done)
            done += 1
    for j in range(done - 1, -1, -1):
        s = H[j, rhs]
        for k in range(j + 1, done):
            s -= H[j, k] * H[k, solution]
        H[j, solution] = s / H[j, j]
    combine(system, job, done)
    return True


@inner
def put_contact(system, job):
    """Put contact into the corrections of all lines and bodies; NO_SOLUTION: it fails."""
    points = 0
    for l in range(system.tables.shape[0]):
        line_job = read(system.tables[l])
        if line_job.contact[ADDRESS] > 0:
            ask_contact(line_job.contact, line_job.contact_table, REST if job.rests[0] else FIND)
            contact = read_contact(job.contacts[l]).contact
            if contact.counts.overflow:
                return NO_SOLUTION
            points += contact.counts.points
    if points == 0:
        return 1.0
    keep_corrections(system, job.kept, job.moved)
    if not find_solution(system, job) or not respond(system, job, True):
        return NO_SOLUTION
    add_corrections(system, 1.0, job.kept, job.moved)
    return 1.0


@inner
def prepare_contact(system):
    """Before a try of a step: the part of the prediction that is safe, of all lines."""
    safe, task, t = 1.0, task_of(system.asked), system.asked.time
    for l in range(system.tables.shape[0]):
        job = read(system.tables[l])
        if job.contact[ADDRESS] > 0:
            clock = job.books.clock
            clock.now, clock.try_end, clock.step_before, clock.rho = t - task.dt, t, task.before, task.rho
            clock.rho_before = task.rho_before
            safe = min(safe, ask_contact(job.contact, job.contact_table, PREPARE))
    return safe


@inner
def largest_radius(system):
    """The spectral radius of a step that is prepared, so that each line has that of all."""
    task = task_of(system.asked)
    rho = task.rho
    for l in range(system.tables.shape[0]):
        job = read(system.tables[l])
        if job.contact[ADDRESS] > 0:
            rho = min(rho, ask_contact(job.contact, job.contact_table, RADIUS))
    common = with_radius(task, rho)
    for l in range(system.tables.shape[0]):
        job = read(system.tables[l])
        if job.contact[ADDRESS] > 0:
            own = ask_contact(job.contact, job.contact_table, RADIUS)
            clock = job.books.clock
            if own > rho:
                clock.rho *= rho / own
            clock.step_before, clock.rho_before = common.before, common.rho_before
    return rho


@inner
def safe_part(system):
    """The part of a correction by which no line passes through itself or another one."""
    part = 1.0
    for l in range(system.tables.shape[0]):
        job = read(system.tables[l])
        if job.contact[ADDRESS] > 0:
            part = min(part, ask_contact(job.contact, job.contact_table, LIMIT))
    return part


@kernel
def touch_system(table):
    """Answer for contact of lines with themselves and each other (kernels.junctions.borders)."""
    job = read_job(table)
    system = read_system(job.system)
    question = system.phase[0]
    if question == PREDICT:
        return prepare_contact(system)
    if question == SPECTRAL_RADIUS:
        return largest_radius(system)
    if question == COUPLE:
        return put_contact(system, job)
    if question == SAFE_PART:
        return safe_part(system)
    return 1.0
