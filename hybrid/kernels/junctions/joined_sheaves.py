"""Sheaves that turn freely under several lines (kernels.laws.sheaves has the symbols): one angle of each for all of them.

Winches of joined lines are taken with them, and before them (kernels.junctions.joined_winches).

Every line has the sheave among its obstacles, with its angle in its state, where all are the same.  M is the sum over the
lines, p stands on the nodes of all, and z is how lines, points and bodies answer to it, with bodies that lines touch.
kernels.run.network and kernels.junctions.lines_contact call `spin_sheaves` by its address, so that systems without sheaves
and such winches compile none of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.junctions.bodies import NUMBERS, STATE, WORK, X
from hybrid.kernels.junctions.body_contact import (
    clear_right_side,
    eliminate_right_side,
    is_fixed,
    keep_corrections,
    put_corrections,
)
from hybrid.kernels.junctions.carried_frames import ANSWER, SEAT
from hybrid.kernels.junctions.joined_lines import COLUMNS, FUNCTIONAL
from hybrid.kernels.junctions.joined_winches import draw_along, find_lengthenings, give_lengths
from hybrid.kernels.junctions.junctions import HANDED, START
from hybrid.kernels.junctions.network_job import NetworkTask
from hybrid.kernels.junctions.right_sides import answer_right_sides
from hybrid.kernels.laws.obstacle_motion import carry_obstacles
from hybrid.kernels.laws.sheaves import along, moments, roll_sheave
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.obstacle_rows import ALONE, BEARING, FREE, INERTIA, LEFT_OVER, SPIN, TRUE, YIELDING
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.job import read

# What is asked: sheaves are put into the corrections of an iteration; into other corrections of it; they turn by the part
# of a correction that is made.
TURN, TURN_ALONG, ROLL_ON = range(3)


class SpinningJob(NamedTuple):
    """Arguments of the entry: what kernels.run.network.solve_system works with, and room."""

    phase: NDArray[np.int64]  # (1,) what is asked
    asked: NetworkTask
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
    begins: NDArray[np.int64]  # (L,) where nodes of lines begin
    marks: NDArray[np.int64]  # (T,) nodes with a right-hand side
    kept: Floats  # (T, 5) corrections of lines without sheaves
    moved: Floats  # (B, 6) and of bodies
    turned: Floats  # (K, B, 6) z of bodies; that of lines is in their Sea.rolling
    lengthened: Floats  # (W, T, 5) z of lines, of winches
    drawn: Floats  # (W, B, 6) and of bodies
    meet_table: NDArray[np.int64]  # of kernels.junctions.body_contact.meet_bodies
    meet: int = 0  # its address; 0: no body has a shape


def blank_spinning_job() -> SpinningJob:
    """A job with the types that every one has."""
    z, whole, one = np.zeros, np.int64, np.zeros(1, np.int64)
    return SpinningJob(
        one, NetworkTask(), z((1, 1), whole), z((1, 2), whole), z((1, 2, SEAT)), z((1, 2, 3)), z((1, 2, 3)), one,
        z((3, 1, SIZE)), z(FUNCTIONAL), z((COLUMNS, 1, SIZE)), z((2, ANSWER)), z((1, 3)), z((1, NUMBERS)), z((1, STATE)), z((1, STATE)),
        z((1, WORK)), z((HANDED - 1, HANDED)), z((2, 6, 6)), z((6, 2)), z(COLUMNS), one, one, z((2, SIZE)), z((1, 6)),
        z((1, 1, 6)), z((1, 1, SIZE)), z((1, 1, 6)), one,
    )  # fmt: skip


read_spinning = reader(blank_spinning_job())


@inner
def push_along(job, j):
    """- p of sheave number j into the right-hand sides of the lines."""
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        b, x = line_job.sea.rolling[3 * j], line_job.work.x
        clear_right_side(job, l)
        for i in range(x.shape[0]):
            if b[i, 1] == 0.0 and b[i, 2] == 0.0 and b[i, 3] == 0.0:
                continue
            if i == 0 and job.joints[l, START] >= 0:  # the march has replaced its balance by its place
                for a in range(3):
                    line_job.work.rows[0, (a + 1) * 24 + 23] = b[0, 1 + a]
            else:
                job.marks[job.begins[l] + i] = 1
                for a in range(3):
                    x[i, 1 + a] = b[i, 1 + a]
        eliminate_right_side(job, l)


@inner
def along_all(job, j):
    """q . x of sheave number j, of the corrections of all lines."""
    total = 0.0
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        total += along(line_job.sea.rolling[3 * j + 2], line_job.work.x)
    return total


@inner
def turn_one(job, j, change):
    """Sheave number j turns by a change: the corrections of all lines and bodies go along."""
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        x, z = line_job.work.x, line_job.sea.rolling[3 * j + 1]
        for i in range(x.shape[0]):
            for c in range(SIZE):
                x[i, c] += change * z[i, c]
    for b in range(job.work.shape[0]):
        for c in range(6):
            job.work[b, X + c] += change * job.turned[j, b, c]


@inner
def turn_along_all(job, count, with_left):
    """Put the first `count` sheaves into corrections that were found without them.

    with_left: with their residual torques.
    """
    carried, j = read(job.tables[0]).sea.carried, 0
    for k in range(carried.shape[0]):
        if carried[k, INERTIA] > 0.0:
            if j < count:
                left = along_all(job, j)
                if with_left:
                    left += carried[k, LEFT_OVER]
                turn_one(job, j, -left / carried[k, YIELDING])
            j += 1


@inner
def moments_of_all(job, k, j, cv):
    """M of sheave k, number j, and its derivative by phi, of all lines, whose Sea.rolling get - p and q."""
    moment = slope = 0.0
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        n, b, q = line_job.line.h.shape[0], line_job.sea.rolling[3 * j], line_job.sea.rolling[3 * j + 2]
        old, new, u = line_job.old, line_job.new, line_job.work.u
        more, steeper = moments(line_job.line, line_job.sea, old.r, u, new, k, b, q, cv)
        moment, slope = moment + more, slope + steeper
        for i in (0, n):
            if is_fixed(line_job.ends, i, n):
                for c in range(SIZE):
                    b[i, c] = q[i, c] = 0.0
    return moment, slope


@called
def find_answer(job, k, j, cv, ca):
    """How all answer to sheave k, number j, with those before it; False: not finite."""
    first = read(job.tables[0])
    row, state = first.sea.carried[k], first.new.sheave[k]
    moment, slope = moments_of_all(job, k, j, cv)
    push_along(job, j)
    if not answer_right_sides(job, True):
        return False
    draw_along(job, job.lengthened.shape[0], False)
    turn_along_all(job, j, False)
    alone = slope - row[INERTIA] * ca - row[BEARING] * cv
    row[LEFT_OVER] = moment - row[INERTIA] * state[TRUE] - row[BEARING] * state[SPIN]
    row[ALONE], row[YIELDING] = alone, along_all(job, j) + alone
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        x, z = line_job.work.x, line_job.sea.rolling[3 * j + 1]
        for i in range(x.shape[0]):
            for c in range(SIZE):
                z[i, c] = x[i, c]
    for b in range(job.work.shape[0]):
        for c in range(6):
            job.turned[j, b, c] = job.work[b, X + c]
    return True


@inner
def turn_all(job, cv, ca):
    """Put winches and sheaves into the corrections of the iteration; False: not finite."""
    moved, j = read(job.tables[0]).line.moved, 0
    keep_corrections(job, job.kept, job.moved)
    if not find_lengthenings(job):
        return False
    for k in range(moved.shape[0]):
        if moved[k] == FREE:
            if not find_answer(job, k, j, cv, ca):
                return False
            j += 1
    put_corrections(job, job.kept, job.moved)
    draw_along(job, job.lengthened.shape[0], True)
    turn_along_all(job, j, True)
    return True


@inner
def roll_all(job, task):
    """Sheaves turn by a part of what belongs to the corrections as they are, in the states of all lines."""
    first, j = read(job.tables[0]), 0
    for k in range(first.line.moved.shape[0]):
        if first.line.moved[k] == FREE:
            row = first.sea.carried[k]
            change = -job.asked.part * (row[LEFT_OVER] + along_all(job, j)) / row[ALONE]
            j += 1
            for l in range(job.tables.shape[0]):
                line_job = read(job.tables[l])
                roll_sheave(line_job.sea, line_job.new, k, change, task.cv, task.ca)
    for l in range(job.tables.shape[0]):
        sea = read(job.tables[l]).sea
        carry_obstacles(sea.now[0] - task.dt, sea.now[0], sea)


@kernel
def spin_sheaves(table):
    """Do what is asked of winches and sheaves that turn freely (TURN, TURN_ALONG, ROLL_ON); 0: it fails."""
    job = read_spinning(table)
    task, phase = read(job.tables[0]).task, job.phase[0]
    if phase == TURN:
        return 1 if turn_all(job, task.cv, task.ca) else 0
    if phase == ROLL_ON:
        give_lengths(job)
        if job.turned.shape[0] > 0:
            roll_all(job, task)
    else:
        draw_along(job, job.lengthened.shape[0], False)
        turn_along_all(job, job.turned.shape[0], False)
    return 1
