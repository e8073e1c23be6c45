"""Sheaves that turn freely and winches that hold a tension, as borders: each is one unknown beside all lines and bodies.

z is how all corrections x answer to such an unknown y, with those before it, and with all borders before it; g is what
its own equation leaves over, d how that answers to y with all else still, and q x how it answers to corrections.  Then
y = -(g + q x) / (d + q z), and where x is as it is, whatever else has been added to it, y = -(g + q x) / d.

Sheaves that turn freely under several lines (kernels.laws.obstacle_grip has the symbols): one angle of each for all of them.
Every line has the sheave among its obstacles, with its angle in its state, where all are the same.  M is the sum over the
lines, and p stands on the nodes of all.

Winches that hold a tension, of lines with an end on a point or body that moves (kernels.reel.reel has the symbols): their
lengths.  The rotor is out of balance by  g = I dc/dt + B(c) + T - P,  which falls with the tension before the fairlead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE
from hybrid.kernels.junctions.borders import (
    answer_right_sides,
    clear_right_side,
    eliminate_right_side,
    is_fixed,
    keep_corrections,
    push_node,
    put_corrections,
    read_network,
)
from hybrid.kernels.laws.obstacle_grip import along, moments, roll_sheave
from hybrid.kernels.laws.obstacles import carry_obstacles
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.reel.reel import MOVES, WAITS
from hybrid.kernels.reel.reel import read as read_reel
from hybrid.kernels.state.report import BEARING, FREE, INERTIA, SPIN, TRUE
from hybrid.kernels.state.state import Blocks, Rows, blanks
from hybrid.kernels.step.line_step import AGAIN, COUPLE, STEP, UPDATE, read, wind

# Columns of an unknown: the sheave, or the line of the winch; g, d, and d + q z.
OF, LEFT_OVER, STIFF, YIELDING = range(4)
EACH_UNKNOWN = 4


class UnknownsJob(NamedTuple):
    """Arguments of both entries; T nodes of all lines, K sheaves or winches."""

    network: NDArray[np.int64]  # as of kernels.junctions.borders.BorderJob
    kept: Rows  # (T, 5) corrections of lines without them
    moved: Rows  # (B, 6) and of bodies
    listed: NDArray[np.int64]  # (1,) how many there are in this iteration
    unknowns: Rows  # (K, EACH_UNKNOWN)
    answers: Blocks  # (K, T, 5) z of lines
    carried: Blocks  # (K, B, 6) and of bodies
    rank: int = 0


blank_unknowns_job = blanks(UnknownsJob)
read_unknowns = reader(blank_unknowns_job())


@inner
def change_of(network, job, winds, j):
    """q x of unknown j, of the corrections of all lines; winds: whether it is of a winch."""
    if winds:
        line_job = read(network.tables[int(job.unknowns[j, OF])])
        return -line_job.work.x[int(read_reel(line_job.reel_table).reel.stage.pulls_at), 0]
    total = 0.0
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        total += along(line_job.sea.rolling[2 * j + 1], line_job.work.x)
    return total


@inner
def put_unknowns(network, job, winds, count, with_left):
    """Put the first `count` unknowns into corrections that were found without them.

    with_left: with what their equations leave over.
    """
    for j in range(count):
        left = change_of(network, job, winds, j)
        if with_left:
            left += job.unknowns[j, LEFT_OVER]
        put_corrections(network, 1.0, -left / job.unknowns[j, YIELDING], job.answers[j], job.carried[j])


@inner
def push_along(network, j):
    """- p of sheave number j into the right-hand sides of the lines."""
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        b, x = line_job.sea.rolling[2 * j], line_job.work.x
        clear_right_side(network, l)
        for i in range(x.shape[0]):
            if b[i, 1] != 0.0 or b[i, 2] != 0.0 or b[i, 3] != 0.0:
                push_node(network, l, i, (b[i, 1], b[i, 2], b[i, 3]))
        eliminate_right_side(network, l)


@inner
def lengthen(network, l):
    """1 m more of line l into the right-hand sides of the lines."""
    for k in range(network.tables.shape[0]):
        clear_right_side(network, k)
    line_job = read(network.tables[l])
    n, stage = line_job.line.h.shape[0], read_reel(line_job.reel_table).reel.stage
    i = int(stage.grows_at)
    network.marks[network.begins[l] + i] = 1
    line_job.work.x[i, 0] = line_job.work.X[(n + 1) * ROW + i * KEPT + 62] * stage.puts
    eliminate_right_side(network, l)


@called
def find_answer(network, job, winds, j):
    """How all answer to unknown j, with those before it; False: not finite."""
    if winds:
        lengthen(network, int(job.unknowns[j, OF]))
    else:
        push_along(network, j)
    if not answer_right_sides(network, job.rank):
        return False
    put_unknowns(network, job, winds, j, False)
    job.unknowns[j, YIELDING] = job.unknowns[j, STIFF] + change_of(network, job, winds, j)
    keep_corrections(network, job.answers[j], job.carried[j])
    return True


@inner
def couple(network, job, winds):
    """Put all unknowns into the corrections of the iteration; 0: not finite."""
    count = job.listed[0]
    keep_corrections(network, job.kept, job.moved)
    for j in range(count):
        if not find_answer(network, job, winds, j):
            return 0.0
    put_corrections(network, 0.0, 1.0, job.kept, job.moved)
    put_unknowns(network, job, winds, count, True)
    return 1.0


@inner
def step_of(network, job, winds, j):
    """By how much unknown j changes: a part of what belongs to the corrections as they are."""
    unknown = job.unknowns[j]
    return -network.asked.part * (unknown[LEFT_OVER] + change_of(network, job, winds, j)) / unknown[STIFF]


@inner
def put_equation(job, of, left, stiff):
    """Note one more unknown."""
    row = job.unknowns[job.listed[0]]
    row[OF], row[LEFT_OVER], row[STIFF] = of, left, stiff
    job.listed[0] += 1


# --- sheaves ------------------------------------------------------------------------------------------------


@inner
def moments_of_all(network, k, j, cv):
    """M of sheave k, number j, and its derivative by phi, of all lines, whose Sea.rolling get - p and q."""
    moment = slope = 0.0
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        n, b, q = line_job.line.h.shape[0], line_job.sea.rolling[2 * j], line_job.sea.rolling[2 * j + 1]
        old, new, u = line_job.old, line_job.new, line_job.work.u
        more, steeper = moments(line_job.line, line_job.sea, old.r, u, new, k, b, q, cv)
        moment, slope = moment + more, slope + steeper
        for i in (0, n):
            if is_fixed(line_job.ends, i, n):
                for c in range(SIZE):
                    b[i, c] = q[i, c] = 0.0
    return moment, slope


@inner
def find_sheaves(network, job, cv, ca):
    """Equations of all sheaves that turn freely."""
    first = read(network.tables[0])
    for k in range(first.line.moved.shape[0]):
        if first.line.moved[k] == FREE:
            row, state = first.sea.carried[k], first.new.sheave[k]
            moment, slope = moments_of_all(network, k, job.listed[0], cv)
            left = moment - row[INERTIA] * state[TRUE] - row[BEARING] * state[SPIN]
            put_equation(job, k, left, slope - row[INERTIA] * ca - row[BEARING] * cv)


@inner
def roll_all(network, job):
    """Sheaves turn in the states of all lines."""
    asked = network.asked
    for j in range(job.listed[0]):
        change = step_of(network, job, False, j)
        for l in range(network.tables.shape[0]):
            line_job = read(network.tables[l])
            roll_sheave(line_job.sea, line_job.new, int(job.unknowns[j, OF]), change, asked.scheme_cv, asked.scheme_ca)
    for l in range(network.tables.shape[0]):
        sea = read(network.tables[l]).sea
        carry_obstacles(sea.now[0] - asked.dt, sea.now[0], sea)


@kernel
def spin_sheaves(table):
    """Answer for sheaves that turn freely (kernels.junctions.borders): they turn in steps alone."""
    job = read_unknowns(table)
    network = read_network(job.network)
    question, asked = network.phase[0], network.asked
    if asked.what != STEP:
        return 1.0
    if question == COUPLE:
        job.listed[0] = 0
        find_sheaves(network, job, asked.scheme_cv, asked.scheme_ca)
        return couple(network, job, False)
    if question == AGAIN:
        put_unknowns(network, job, False, job.listed[0], False)
    elif question == UPDATE:
        roll_all(network, job)
    return 1.0


# --- winches ------------------------------------------------------------------------------------------------


@inner
def find_winches(network, job):
    """Equations of all winches that are to be corrected with all lines."""
    for l in range(network.tables.shape[0]):
        line_job = read(network.tables[l])
        if line_job.iterated != 0:
            stage = read_reel(line_job.reel_table).reel.stage
            if stage.lengthens == WAITS:
                put_equation(job, l, stage.out_of_balance, stage.alone)


@inner
def give_lengths(network, job):
    """Winches give line, or take it in."""
    for j in range(job.listed[0]):
        line_job = read(network.tables[int(job.unknowns[j, OF])])
        stage = read_reel(line_job.reel_table).reel.stage
        stage.change, stage.lengthens = step_of(network, job, True, j), MOVES
        wind(line_job, STEP, UPDATE)


@kernel
def wind_lines(table):
    """Answer for winches of joined lines (kernels.junctions.borders): they move in steps alone."""
    job = read_unknowns(table)
    network = read_network(job.network)
    question = network.phase[0]
    if network.asked.what != STEP:
        return 1.0
    if question == COUPLE:
        job.listed[0] = 0
        find_winches(network, job)
        return couple(network, job, True)
    if question == AGAIN:
        put_unknowns(network, job, True, job.listed[0], False)
    elif question == UPDATE:
        give_lengths(network, job)
    return 1.0
