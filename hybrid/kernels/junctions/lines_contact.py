"""Contact of the lines of a system with themselves and each other in a correction of Newton's method, beside the lines' junctions.

As kernels.contact.self_contact_solve, with the matrix A of all lines, points and bodies in place of that of one line: a product
with A^-1 carries a right-hand side on the nodes in contact through the kept factors of the lines, the junctions and back.
kernels.run.network calls `touch_system` by its address, so that systems without contact compile none of it.
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
from hybrid.kernels.junctions.bodies import NUMBERS, STATE, WORK, X
from hybrid.kernels.junctions.carried_frames import ANSWER, SEAT
from hybrid.kernels.junctions.joined_lines import COLUMNS, FUNCTIONAL, last_block
from hybrid.kernels.junctions.joined_sheaves import TURN_ALONG
from hybrid.kernels.junctions.junctions import END, HANDED, START
from hybrid.kernels.junctions.right_sides import answer_right_sides
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.job import read
from hybrid.kernels.step.newton import ADDRESS, FIND, REST, ask_contact


class TouchingJob(NamedTuple):
    """Arguments of the entry: what kernels.run.network.solve_system works with, and room."""

    tables: NDArray[np.int64]
    joints: NDArray[np.int64]
    seats: Floats
    arms: Floats
    gaps: Floats  # zeros: ends go nowhere by themselves
    first: NDArray[np.int64]
    columns: Floats
    functional: Floats
    parts: Floats
    answers: Floats
    net: Floats
    bodies: Floats
    old: Floats
    new: Floats
    work: Floats
    S: Floats
    G: Floats
    A: Floats
    q: Floats
    shared: NDArray[
        np.int64
    ]  # (L, 2) the line that has the contact of a line (-1: none has), where its nodes begin there
    contacts: NDArray[np.int64]  # (L, ..) tables of kernels.contact.self_contact.ContactJob, of lines that have contact
    kept: Floats  # (nodes of all lines, 5) corrections without contact, line after line
    moved: Floats  # (B, 6) likewise of bodies
    hessenberg: Floats  # as kernels.contact.self_contact_pairs.Contact has it
    asked: NDArray[np.int64]  # (1,) 1: of a state in which no step is tried
    phase: NDArray[np.int64]  # (1,) what is asked of meet_bodies and spin_sheaves
    meet_table: NDArray[np.int64]  # of kernels.junctions.body_contact.meet_bodies
    spin_table: NDArray[np.int64]  # of kernels.junctions.joined_sheaves.spin_sheaves
    meet: int = 0  # address of meet_bodies; 0: no body has a shape
    spin: int = 0  # of spin_sheaves; 0: no sheave turns freely


def blank_touching_job() -> TouchingJob:
    """A job with the types that every one has."""
    z, whole = np.zeros, np.int64
    return TouchingJob(
        z((1, 1), whole), z((1, 2), whole), z((1, 2, SEAT)), z((1, 2, 3)), z((1, 2, 3)), z(1, whole), z((3, 1, SIZE)),
        z(FUNCTIONAL), z((COLUMNS, 1, SIZE)), z((2, ANSWER)), z((1, 3)), z((1, NUMBERS)), z((1, STATE)), z((1, STATE)), z((1, WORK)),
        z((HANDED - 1, HANDED)), z((2, 6, 6)), z((6, 2)), z(COLUMNS), z((1, 2), whole), z((1, 1), whole), z((2, SIZE)), z((1, 6)), room_for_products(),
        z(1, whole), z(1, whole), z(1, whole), z(1, whole),
    )  # fmt: skip


def room_for_products() -> Floats:
    """Columns of GMRES, with rotations, right-hand side and solution."""
    return np.zeros((MOST_PRODUCTS + 1, MOST_PRODUCTS + 4))


read_job = reader(blank_touching_job())
call_spin = caller(0)


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
        end = 0 if i == 0 else 1
        fixed = (i == 0 or i == n) and ends.held[end] != 0 and ends.held[end] != JOINED
        if i == 0 and joints[l, START] >= 0:  # the march has replaced its balance by its place
            for a in range(3):
                work.rows[0, (a + 1) * 24 + 23] = contact.y[first, a]
        elif not fixed:
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
def respond(job, cv, with_gradient):
    """Corrections work.x of all lines by the forces of contact at contact.x; False if they are not finite."""
    for l in range(job.tables.shape[0]):
        if touching(job, l) > 0:
            find_forces(read_contact(job.contacts[l]).contact, with_gradient)
    for l in range(job.tables.shape[0]):
        lead, touches = max(job.shared[l, 0], 0), False
        contact = read_contact(job.contacts[lead]).contact
        if job.shared[l, 0] >= 0:
            touches = contact.counts.points > 0
        set_right_side(l, read(job.tables[l]), contact, job.shared[l, 1], job.joints, touches, with_gradient)
    if not answer_right_sides(job, job.asked[0] == 0):
        return False
    if job.spin != 0 and cv > 0.0:
        job.phase[0] = TURN_ALONG
        return call_spin(job.spin, job.spin_table) != 0
    return True


@inner
def prepare_sweeps(job):
    """What sweeps take of the factors of lines in contact; returns unknowns of GMRES, and the largest diameter, m."""
    size, width = 0, 0.0
    for l in range(job.tables.shape[0]):
        if job.shared[l, 0] >= 0:
            contact, first = read_contact(job.contacts[job.shared[l, 0]]).contact, job.shared[l, 1]
            line_job = read(job.tables[l])
            n, work = line_job.line.h.shape[0], line_job.work
            if contact.counts.points > 0:
                prepare_sweep(work.X, work.W, contact.sweep[first:], first_in_contact(contact, first, n), n)
        if touching(job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            size, width = size + unknowns(contact) * contact.counts.nodes, max(width, contact.numbers.widest)
    return size, width


@inner
def touching(job, l):
    """Points of the contact that a line has."""
    line_job = read(job.tables[l])
    if not line_job.contact[ADDRESS] > 0:
        return 0
    return read_contact(job.contacts[l]).contact.counts.points


@inner
def product(job, k, l):
    """Dot product of the vectors k and l of the basis, over all lines."""
    s = 0.0
    for line in range(job.tables.shape[0]):
        if touching(job, line) > 0:
            contact = read_contact(job.contacts[line]).contact
            s += inner_product(contact.basis[k], contact.basis[l], unknowns(contact) * contact.counts.nodes)
    return s


@inner
def add_vector(job, k, part, l):
    """Add part of basis vector k to vector l; where both are the same, it is multiplied by it."""
    for line in range(job.tables.shape[0]):
        if touching(job, line) > 0:
            contact = read_contact(job.contacts[line]).contact
            V = contact.basis
            for i in range(unknowns(contact) * contact.counts.nodes):
                V[l, i] = part * V[l, i] if k == l else V[l, i] + part * V[k, i]


@inner
def put_response(job, column, first):
    """Basis vector `column` by what lines have done: the residual at zero (first), or that before it less its product."""
    at = 0
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        if job.shared[l, 0] >= 0:
            contact, o = read_contact(job.contacts[job.shared[l, 0]]).contact, job.shared[l, 1]
            z, x = contact.z, line_job.work.x
            for i in range(x.shape[0]):
                for j in range(1, SIZE):
                    z[o + i, j] = x[i, j] + job.kept[at + i, j] if first else x[i, j]
                z[o + i, 4] *= contact.rolls[o + i]
        at += line_job.line.s.shape[0]
    for l in range(job.tables.shape[0]):
        if touching(job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            V, per, z = contact.basis, unknowns(contact), contact.z
            for k in range(contact.counts.nodes):
                i = contact.nodes[k]
                for j in range(per):
                    y = z[i, 1 + j] * length_of(contact, j, i)
                    V[column, per * k + j] = y if first else V[column - 1, per * k + j] - y


@inner
def set_unknowns(job, column):
    """contact.x of all lines: basis vector `column`; -1: zero."""
    for l in range(job.tables.shape[0]):
        if touching(job, l) > 0:
            contact = read_contact(job.contacts[l]).contact
            if column >= 0:
                take_vector(contact, column)
            else:
                for k in range(contact.counts.nodes):
                    for j in range(4):
                        contact.x[contact.nodes[k], j] = 0.0


@inner
def combine(job, done):
    """contact.x of all lines: the vectors of the basis with the solution of the least-squares problem."""
    H, solution = job.hessenberg, MOST_PRODUCTS + 3
    for l in range(job.tables.shape[0]):
        if touching(job, l) > 0:
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
def find_solution(job, cv):
    """GMRES from zero: contact.x = the correction of the nodes in contact of all lines; False: not finite."""
    H, rhs, solution = job.hessenberg, MOST_PRODUCTS + 2, MOST_PRODUCTS + 3
    unknown, width = prepare_sweeps(job)
    set_unknowns(job, -1)
    if not respond(job, cv, True):
        return False
    put_response(job, 0, True)
    for i in range(MOST_PRODUCTS + 1):
        H[i, rhs] = 0.0
    s = math.sqrt(product(job, 0, 0))
    H[0, rhs], left, done = s, s, 0
    if s > 0.0:
        add_vector(job, 0, 1.0 / s, 0)
        most = enough(s, width, unknown)
        while done < MOST_PRODUCTS and left > most:
            set_unknowns(job, done)
            if not respond(job, cv, False):
                return False
            put_response(job, done + 1, False)
            for j in range(done + 1):
                H[j, done] = product(job, j, done + 1)
                add_vector(job, j, -H[j, done], done + 1)
            size = math.sqrt(product(job, done + 1, done + 1))
            H[done + 1, done] = size
            if size > 0.0:
                add_vector(job, done + 1, 1.0 / size, done + 1)
            left = rotate_column(H, done)
            done += 1
    for j in range(done - 1, -1, -1):
        s = H[j, rhs]
        for k in range(j + 1, done):
            s -= H[j, k] * H[k, solution]
        H[j, solution] = s / H[j, j]
    combine(job, done)
    return True


@inner
def keep_corrections(job, back):
    """Keep corrections without contact, or (back) add them to what contact has made of them."""
    at = 0
    for l in range(job.tables.shape[0]):
        x = read(job.tables[l]).work.x
        for i in range(x.shape[0]):
            for j in range(SIZE):
                if back:
                    x[i, j] += job.kept[at + i, j]
                else:
                    job.kept[at + i, j] = x[i, j]
        at += x.shape[0]
    for b in range(job.work.shape[0]):
        for j in range(6):
            if back:
                job.work[b, X + j] += job.moved[b, j]
            else:
                job.moved[b, j] = job.work[b, X + j]


@kernel
def touch_system(table):
    """Put contact into the corrections of all lines and bodies; 1: nothing touches, 2: done, 0: it fails."""
    job = read_job(table)
    task, points = read(job.tables[0]).task, 0
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        if line_job.contact[ADDRESS] > 0:
            ask_contact(line_job.contact, line_job.contact_table, REST if job.asked[0] else FIND)
            contact = read_contact(job.contacts[l]).contact
            if contact.counts.overflow:
                return 0
            points += contact.counts.points
    if points == 0:
        return 1
    keep_corrections(job, False)
    if not find_solution(job, task.cv) or not respond(job, task.cv, True):
        return 0
    keep_corrections(job, True)
    return 2
