"""What couples lines beside their bands: borders, all of them asked the same few questions in one order.

Every line is eliminated along s (kernels.march).  What couples it with others is a border of these equations: unknowns y
with columns (what they do to lines, points and bodies), a functional (what these do to its own equations), a small
block (what y does to them) and an update.  Of corrections x that are found without it, with z how all that is before it
answers to its columns, q its functional, d its block and r what its equations leave over,

    y = -(d + q z)^-1 (r + q x),    x becomes x + z y.

Borders that a network does not have are not in its list: it has neither their arrays nor their code, and asks nothing.
The list, and why it has that order, is in solve.borders.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import ROW, SIZE, SPAN
from hybrid.kernels.algebra.kept_factors import carry_given
from hybrid.kernels.junctions.bodies import X
from hybrid.kernels.junctions.joined_lines import last_block
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.state.state import blanks
from hybrid.kernels.step.line_step import read

START, END = 0, 1
# Questions, and what a border does then; it answers 1 where nothing else is said.
PREDICT = 0  # a step begins; answered by the part of its prediction that is safe
SPECTRAL_RADIUS = 1  # answered by the spectral radius that the step may have
FORGET = 2  # a solution begins: what was known of another one is found anew
BEFORE_MARCH = 3  # what it carries goes to where its unknowns are
FORCE = 4  # after the march: what lines and it do to points and bodies in this state
BALANCE = 5  # what its own equations leave over, when all of that is known
BLOCK = 6  # columns, functional and block that fall on points and bodies, into A
HOLD = 7  # springs against what nothing else holds, in the first iteration of an equilibrium
COUPLE = 8  # its part of the corrections of the iteration; 0: singular, or as below
AGAIN = 9  # its part of other corrections of the iteration, which have no residual; 0: not finite
MEASURE = 10  # the largest shift and turn of its unknowns, into `moves`
SAFE_PART = 11  # answered by the part of the corrections that is safe
UPDATE = 12  # its unknowns move by the part of the corrections that is made
RELAX = 13  # springs of HOLD follow the turns
CARRY = 14  # a solution has ended: what it carries goes to where that has led
# Answers to COUPLE.
NO_NUMBERS = -1.0  # corrections are not finite
NO_SOLUTION = -2.0  # none were found in the iterations that there are
# Places in `moves`.
FAR = 0  # m, largest shift of unknowns
TURNED = 1  # rad, largest turn
STRENGTH = 2  # of the springs of HOLD, 1 at first

call_border = caller(0.0)


class BorderJob(NamedTuple):
    """Arguments of a border that needs nothing of its own."""

    network: NDArray[np.int64]  # table of the kernels.junctions.network_job.NetworkJob that has it
    rank: int = 0  # how many borders are before it


blank_border_job = blanks(BorderJob)
read_border = reader(blank_border_job())


@inner
def ask(network, question):
    """Put a question to all borders, in their order; the least of their answers: the first that is not above 0."""
    answer = 1.0
    for k in range(network.borders.shape[0]):
        network.phase[0] = question
        answer = min(answer, call_border(network.borders[k], network.border_tables[k]))
        if not answer > 0.0:
            break
    return answer


@inner
def answer_right_sides(network, count):
    """Corrections of all by the first borders, so many, to the right-hand sides of lines, and `network.right` of points.

    False: they are not finite.
    """
    for k in range(count):
        network.phase[0] = AGAIN
        if not call_border(network.borders[k], network.border_tables[k]) > 0.0:
            return False
    return True


@inner
def is_fixed(ends, i, n):
    """Whether a node is an end that is held."""
    end = 0 if i == 0 else 1
    return (i == 0 or i == n) and ends.held[end] != 0 and ends.held[end] != JOINED


@inner
def clear_right_side(network, l):
    """No right-hand side in the eliminated line l."""
    line_job, n = read(network.tables[l]), read(network.tables[l]).line.h.shape[0]
    X_, x, o = line_job.work.X, line_job.work.x, network.begins[l]
    if network.joints[l, START] >= 0:
        for a in range(3):
            line_job.work.rows[0, (a + 1) * 24 + 23] = 0.0
    for i in range(n + 1):
        network.marks[o + i] = 0
        for j in range(SIZE):
            x[i, j] = 0.0
            X_[i * ROW + j * SPAN + SPAN - 1] = 0.0
    if network.joints[l, END] >= 0:
        at = last_block(X_, n)
        for j in range(SIZE):
            X_[at + 64 + j] = 0.0


@inner
def push_node(network, l, i, force):
    """Add a force on node i to the right-hand side of line l."""
    line_job = read(network.tables[l])
    if i == 0 and network.joints[l, START] >= 0:  # the march has replaced its balance by its place
        for a in range(3):
            line_job.work.rows[0, (a + 1) * 24 + 23] += force[a]
    elif not is_fixed(line_job.ends, i, line_job.line.h.shape[0]):
        network.marks[network.begins[l] + i] = 1
        for a in range(3):
            line_job.work.x[i, 1 + a] += force[a]


@inner
def eliminate_right_side(network, l):
    """Carry the right-hand side of line l through its kept factors."""
    line_job, n = read(network.tables[l]), read(network.tables[l]).line.h.shape[0]
    o, joined, begin = network.begins[l], network.joints[l, END] >= 0, n + 1
    for i in range(n, -1, -1):
        if network.marks[o + i] != 0:
            begin = i
    if begin > n:
        return
    carry_given(line_job.work.X, line_job.work.W, network.marks[o:], line_job.work.x, joined, begin)
    hand_on(line_job.work, joined, begin)


@inner
def hand_on(work, joined, begin):
    """A right-hand side that is carried from block `begin` on stands where the substitution finds it."""
    n = work.x.shape[0] - 1
    for i in range(begin, n + 1):
        for k in range(SIZE):
            work.X[i * ROW + k * SPAN + SPAN - 1] = work.x[i, k]
    if joined:
        at = last_block(work.X, n)
        for k in range(SIZE):
            work.X[at + 64 + k] = work.x[n, k]


@inner
def keep_corrections(network, kept, moved):
    """Corrections of lines and bodies into kept (T, 5), moved (B, 6)."""
    for l in range(network.tables.shape[0]):
        x, o = read(network.tables[l]).work.x, network.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                kept[o + i, j] = x[i, j]
    for b in range(network.work.shape[0]):
        for j in range(6):
            moved[b, j] = network.work[b, X + j]


@inner
def put_corrections(network, kept, moved):
    """The same back."""
    for l in range(network.tables.shape[0]):
        x, o = read(network.tables[l]).work.x, network.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                x[i, j] = kept[o + i, j]
    for b in range(network.work.shape[0]):
        for j in range(6):
            network.work[b, X + j] = moved[b, j]


@inner
def add_corrections(network, part, kept, moved):
    """A part of kept corrections to those of lines and bodies."""
    for l in range(network.tables.shape[0]):
        x, o = read(network.tables[l]).work.x, network.begins[l]
        for i in range(x.shape[0]):
            for j in range(SIZE):
                x[i, j] += part * kept[o + i, j]
    for b in range(network.work.shape[0]):
        for j in range(6):
            network.work[b, X + j] += part * moved[b, j]
