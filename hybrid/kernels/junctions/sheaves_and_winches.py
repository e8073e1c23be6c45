"""Sheaves that turn freely and winches that hold a tension, as borders.

Sheaves that turn freely under several lines (kernels.laws.sheaves has the symbols): one angle of each for all of them.

Every line has the sheave among its obstacles, with its angle in its state, where all are the same.  M is the sum over the
lines, p stands on the nodes of all, and z is how lines, points and bodies answer to it, with all that is before it.

Winches that hold a tension, of lines with an end on a point or body that moves.

Their lengths are unknowns beside those of all lines, points and bodies (kernels.reel.winch has the symbols).
The rotor is out of balance by  a = I dc/dt + B(c) + T - P,  which grows with the length L by  a_L  with all else still, and
falls with the tension before the fairlead.  z is how the corrections x answer to 1 m of L, bodies that lines touch among
them; then  dL = (p x - a) / (a_L - p z),  with p x the change of that tension.  Sheaves and contact answer with these, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE
from hybrid.kernels.junctions.bodies import X
from hybrid.kernels.junctions.borders import (
    AGAIN,
    COUPLE,
    UPDATE,
    add_corrections,
    answer_right_sides,
    clear_right_side,
    eliminate_right_side,
    is_fixed,
    keep_corrections,
    push_node,
    put_corrections,
)
from hybrid.kernels.junctions.network_job import read_network
from hybrid.kernels.laws.obstacles import carry_obstacles
from hybrid.kernels.laws.sheaves import along, moments, roll_sheave
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.reel.reel import MOVES, WAITS
from hybrid.kernels.reel.reel import read as read_reel
from hybrid.kernels.state.report import ALONE, BEARING, FREE, INERTIA, LEFT_OVER, SPIN, TRUE, YIELDING
from hybrid.kernels.state.state import Blocks, Rows, blanks
from hybrid.kernels.step.line_step import STEP, read, wind


class SpinningJob(NamedTuple):
    """Arguments of the entry; T nodes of all lines, K sheaves."""

    network: NDArray[np.int64]  # as of kernels.junctions.borders.BorderJob
    kept: Rows  # (T, 5) corrections of lines without sheaves
    moved: Rows  # (B, 6) and of bodies
    turned: Blocks  # (K, B, 6) z of bodies; that of lines is in their Sea.rolling
    rank: int = 0


blank_spinning_job = blanks(SpinningJob)
read_spinning = reader(blank_spinning_job())


@inner
def push_along(network, j):
    """- p of sheave number j into the right-hand sides of the lines."""
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        b, x = line_job.sea.rolling[3 * j], line_job.work.x
        clear_right_side(network, l)
        for i in range(x.shape[0]):
            if b[i, 1] != 0.0 or b[i, 2] != 0.0 or b[i, 3] != 0.0:
                push_node(network, l, i, (b[i, 1], b[i, 2], b[i, 3]))
        eliminate_right_side(network, l)


@inner
def along_all(network, j):
    """q . x of sheave number j, of the corrections of all lines."""
    total = 0.0
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        total += along(line_job.sea.rolling[3 * j + 2], line_job.work.x)
    return total


@inner
def turn_one(network, job, j, change):
    """Sheave number j turns by a change: the corrections of all lines and bodies go along."""
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        x, z = line_job.work.x, line_job.sea.rolling[3 * j + 1]
        for i in range(x.shape[0]):
            for c in range(SIZE):
                x[i, c] += change * z[i, c]
    for b in range(network.work.shape[0]):
        for c in range(6):
            network.work[b, X + c] += change * job.turned[j, b, c]


@inner
def turn_along_all(network, job, count, with_left):
    """Put the first `count` sheaves into corrections that were found without them.

    with_left: with their residual torques.
    """
    carried, j = read(network.tables[0]).sea.carried, 0
    for k in range(carried.shape[0]):
        if carried[k, INERTIA] > 0.0:
            if j < count:
                left = along_all(network, j)
                if with_left:
                    left += carried[k, LEFT_OVER]
                turn_one(network, job, j, -left / carried[k, YIELDING])
            j += 1


@inner
def moments_of_all(network, k, j, cv):
    """M of sheave k, number j, and its derivative by phi, of all lines, whose Sea.rolling get - p and q."""
    moment = slope = 0.0
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
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
def find_answer(network, job, k, j, cv, ca):
    """How all answer to sheave k, number j, with those before it; False: not finite."""
    first = read(network.tables[0])
    row, state = first.sea.carried[k], first.new.sheave[k]
    moment, slope = moments_of_all(network, k, j, cv)
    push_along(network, j)
    if not answer_right_sides(network, job.rank):
        return False
    turn_along_all(network, job, j, False)
    alone = slope - row[INERTIA] * ca - row[BEARING] * cv
    row[LEFT_OVER] = moment - row[INERTIA] * state[TRUE] - row[BEARING] * state[SPIN]
    row[ALONE], row[YIELDING] = alone, along_all(network, j) + alone
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        x, z = line_job.work.x, line_job.sea.rolling[3 * j + 1]
        for i in range(x.shape[0]):
            for c in range(SIZE):
                z[i, c] = x[i, c]
    for b in range(network.work.shape[0]):
        for c in range(6):
            job.turned[j, b, c] = network.work[b, X + c]
    return True


@inner
def turn_all(network, job, cv, ca):
    """Put sheaves into the corrections of the iteration; False: not finite."""
    moved, j = read(network.tables[0]).line.moved, 0
    keep_corrections(network, job.kept, job.moved)
    for k in range(moved.shape[0]):
        if moved[k] == FREE:
            if not find_answer(network, job, k, j, cv, ca):
                return False
            j += 1
    put_corrections(network, job.kept, job.moved)
    turn_along_all(network, job, j, True)
    return True


@inner
def roll_all(network):
    """Sheaves turn by a part of what belongs to the corrections as they are, in the states of all lines."""
    first, asked, j = read(network.tables[0]), network.asked, 0
    for k in range(first.line.moved.shape[0]):
        if first.line.moved[k] == FREE:
            row = first.sea.carried[k]
            change = -asked.part * (row[LEFT_OVER] + along_all(network, j)) / row[ALONE]
            j += 1
            for l in range(network.tables.shape[0]):
                line_job = read(network.tables[l])
                roll_sheave(line_job.sea, line_job.new, k, change, asked.scheme_cv, asked.scheme_ca)
    for l in range(network.tables.shape[0]):
        sea = read(network.tables[l]).sea
        carry_obstacles(sea.now[0] - asked.dt, sea.now[0], sea)


@kernel
def spin_sheaves(table):
    """Answer for sheaves that turn freely (kernels.junctions.borders): they turn in steps alone."""
    job = read_spinning(table)
    network = read_network(job.network)
    question, asked = network.phase[0], network.asked
    if asked.what != STEP:
        return 1.0
    if question == COUPLE:
        return 1.0 if turn_all(network, job, asked.scheme_cv, asked.scheme_ca) else 0.0
    if question == AGAIN:
        turn_along_all(network, job, job.turned.shape[0], False)
    elif question == UPDATE:
        roll_all(network)
    return 1.0


class WindingJob(NamedTuple):
    """Arguments of the entry; T nodes of all lines, W winches."""

    network: NDArray[np.int64]  # as of kernels.junctions.borders.BorderJob
    kept: Rows  # (T, 5) corrections of lines without winches
    moved: Rows  # (B, 6) and of bodies
    lengthened: Blocks  # (W, T, 5) z of lines
    drawn: Blocks  # (W, B, 6) and of bodies
    rank: int = 0


blank_winding_job = blanks(WindingJob)
read_winding = reader(blank_winding_job())


@inner
def waits(line_job):
    """Whether the winch of a line is to be corrected with all lines."""
    return line_job.iterated != 0 and read_reel(line_job.reel_table).reel.stage.lengthens == WAITS


@inner
def draw_along(network, job, count, with_left):
    """Put the first `count` winches into corrections that were found without them.

    with_left: with their residual torques.
    """
    w = 0
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        if not waits(line_job):
            continue
        if w < count:
            stage = read_reel(line_job.reel_table).reel.stage
            left = -line_job.work.x[int(stage.pulls_at), 0]
            if with_left:
                left += stage.out_of_balance
            add_corrections(network, -left / stage.yielding, job.lengthened[w], job.drawn[w])
        w += 1


@called
def find_lengthening(network, job, l, w):
    """How all answer to 1 m more of line l, by winch number w, with those before it; False: not finite."""
    for k in range(network.tables.shape[0]):
        clear_right_side(network, k)
    line_job = read(network.tables[l])
    x, n, stage = line_job.work.x, line_job.line.h.shape[0], read_reel(line_job.reel_table).reel.stage
    i = int(stage.grows_at)
    network.marks[network.begins[l] + i] = 1
    x[i, 0] = line_job.work.X[(n + 1) * ROW + i * KEPT + 62] * stage.puts
    eliminate_right_side(network, l)
    if not answer_right_sides(network, job.rank):
        return False
    draw_along(network, job, w, False)
    stage.yielding = stage.alone - x[int(stage.pulls_at), 0]
    keep_corrections(network, job.lengthened[w], job.drawn[w])
    return True


@inner
def find_lengthenings(network, job):
    """How all answer to the lengths of all winches; False: not finite."""
    w = 0
    for l in range(network.tables.shape[0]):
        if waits(read(network.tables[l])):
            if not find_lengthening(network, job, l, w):
                return False
            w += 1
    return True


@inner
def give_lengths(network):
    """Winches give a part of what belongs to the corrections as they are."""
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        if waits(line_job):
            stage = read_reel(line_job.reel_table).reel.stage
            left = stage.out_of_balance - line_job.work.x[int(stage.pulls_at), 0]
            stage.change, stage.lengthens = -network.asked.part * left / stage.alone, MOVES
            wind(line_job)


@kernel
def wind_lines(table):
    """Answer for winches of joined lines (kernels.junctions.borders): they move in steps alone."""
    job = read_winding(table)
    network = read_network(job.network)
    question, count = network.phase[0], job.lengthened.shape[0]
    if network.asked.what != STEP:
        return 1.0
    if question == COUPLE:
        keep_corrections(network, job.kept, job.moved)
        if not find_lengthenings(network, job):
            return 0.0
        put_corrections(network, job.kept, job.moved)
        draw_along(network, job, count, True)
    elif question == AGAIN:
        draw_along(network, job, count, False)
    elif question == UPDATE:
        give_lengths(network)
    return 1.0
