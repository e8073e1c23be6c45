"""Contact of several lines with each other and themselves: one search, one law and one solve for all of them.

The lines stand one after the other as one line of kernels.contact, whose arrays are filled from theirs before every
question and whose answers go back to them.  It is asked by the address of `shared_task`, at the last of these lines:
all others have taken their step by then.

Half of the energy of a point of contact between two lines is of each.  The work that other lines do on a line, W, is that
of the mean of their forces before and after a step on its way, with the change of its half: over all lines it is that of
friction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_contact import contact_task
from hybrid.kernels.contact.self_contact import read as read_contact
from hybrid.kernels.contact.self_contact_energy import energy_without_weight, is_gain, is_judged, work_of_try
from hybrid.kernels.contact.self_contact_friction import add_held, arc_length
from hybrid.kernels.contact.self_contact_law import FOOT_PLACE, PLACE, P, Q, add_gradient
from hybrid.kernels.contact.self_contact_pairs import (
    BETWEEN,
    HELD_BETWEEN,
    HELD_WITHIN,
    SHARES,
    SLIP_WITHIN,
    WITHIN_LINE,
)
from hybrid.kernels.junctions.junctions import move_joints
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.report import FORCE_A, NET_A, SELF_CONTACT_ENERGY, SELF_FRICTION_WORK
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.job import read
from hybrid.kernels.step.newton import ASKED, FINISH, GAIN, PREPARE, REST

KEPT, LATEST = 0, 1  # of `pushes` and `times`: of the state now, and where the try has led
# Columns of `meetings`.
MET = 0  # when two lines met first, s (nan: never)
MET_S = 1  # at which arc lengths, m
MET_OTHER = 2
MEETING = 3


class SharedJob(NamedTuple):
    """Arguments of the entry; K lines that may touch, with N+1 nodes."""

    tables: NDArray[np.int64]  # (L, ..) jobs of all lines of the system
    lines: NDArray[np.int64]  # (K,) numbers of those that may touch
    begins: NDArray[np.int64]  # (K,) where their nodes begin
    starts: Floats  # (K,) m, their arc lengths as parts of the one line, less their own
    joints: NDArray[np.int64]  # (L, 2) as kernels.junctions.network_job.NetworkJob has it
    inner: NDArray[np.int64]  # table of a ContactJob of them as one line
    pushes: Floats  # (2, N+1, 4) N, N m, forces of other lines on nodes, moments on cells
    shares: Floats  # (2, K, SHARES) of Contact, likewise
    times: Floats  # (2,) s, of what state these are
    meetings: Floats  # (K, K, MEETING)


def blank_shared_job() -> SharedJob:
    """A job with the types that every one has."""
    z, whole = np.zeros, np.int64
    return SharedJob(
        z((1, 1), whole), z(1, whole), z(1, whole), z(1), z((1, 2), whole), z(1, whole), z((2, 1, 4)), z((2, 1, SHARES)),
        z(2), z((1, 1, MEETING)),
    )  # fmt: skip


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
    for i in range(y.shape[0]):
        for j in range(4):
            y[i, j] = 0.0
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
    row, last, y = 2 if phase == FINISH else 0, 0.0, one.contact.y
    find_pushes(one, job.pushes[LATEST])
    job.times[LATEST] = one.clock.try_end if phase == FINISH else one.clock.now
    for k in range(job.lines.shape[0]):
        for j in range(SHARES):
            job.shares[LATEST, k, j] = one.contact.shares[k, j]
    if phase == REST:
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
        if phase == FINISH:
            report[SELF_FRICTION_WORK] = work_on(job, one, k)
            for end in range(2):
                if line_job.ends.held[end] != 0:
                    for j in range(3):
                        report[FORCE_A + 3 * end + j] -= y[at + end * n, j]
                        report[NET_A + 3 * end + j] -= y[at + end * n, j]
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
    """As kernels.contact.self_contact_energy.puts_energy_in, of all lines together."""
    contact, clock = one.contact, one.clock
    numbers = contact.numbers
    if not is_judged(numbers):
        return False
    for k in range(job.lines.shape[0]):
        if read(job.tables[job.lines[k]]).reel != 0:  # what a winch does is not known here
            return False
    if numbers.begun != clock.now:
        if numbers.led == clock.now:
            numbers.had, numbers.balance = numbers.has, numbers.tried_balance
        else:
            numbers.had = energy_of(job, one, False)
        numbers.begun = clock.now
        numbers.largest = max(numbers.largest, numbers.had)
    numbers.has, numbers.led = energy_of(job, one, True), clock.try_end
    done, missed = 0.0, 0.0
    if numbers.friction > 0.0:
        done = numbers.slip_work + numbers.tried - numbers.stored
    for k in range(job.lines.shape[0]):
        line_job = read(job.tables[job.lines[k]])
        books = line_job.books
        move_joints(line_job, job.joints[job.lines[k], 0], job.joints[job.lines[k], 1])
        more, off = work_of_try(
            line_job.line, line_job.ends, contact, books.velocity, books.power[0], line_job.new, line_job.work,
            books.clock,
        )  # fmt: skip
        done += more - line_job.work.report[SELF_FRICTION_WORK]
        missed += off
    return is_gain(contact, one.work.u, done, missed)


@kernel
def shared_task(table):
    """What is asked of contact as of kernels.contact.self_contact.contact_task, for lines that stand as one."""
    job = read_shared(table)
    one, last = read_contact(job.inner), read(job.tables[job.lines[job.lines.shape[0] - 1]])
    phase = one.call[ASKED]
    one.counts.controlled, one.counts.parity = last.books.counts.controlled, 0
    if phase == GAIN:
        return 1.0 if puts_energy_in(job, one) else 0.0
    if phase == PREPARE:
        share_clock(job, one)
    gather(job, one)
    value = contact_task(job.inner)
    if phase in (FINISH, REST):
        return spread(job, one, phase)
    return value
