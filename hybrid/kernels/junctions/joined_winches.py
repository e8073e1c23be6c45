"""Winches that hold a tension, of lines with an end on a point or body that moves.

Their lengths are unknowns beside those of all lines, points and bodies (kernels.reel.winch has the symbols).
The rotor is out of balance by  a = I dc/dt + B(c) + T - P,  which grows with the length L by  a_L  with all else still, and
falls with the tension before the fairlead.  z is how the corrections x answer to 1 m of L, bodies that lines touch among
them; then  dL = (p x - a) / (a_L - p z),  with p x the change of that tension.  Sheaves and contact answer with these, too.
"""

from __future__ import annotations

from hybrid.kernels.algebra.block_elimination import KEPT, ROW
from hybrid.kernels.junctions.body_contact import (
    add_corrections,
    clear_right_side,
    eliminate_right_side,
    keep_corrections,
)
from hybrid.kernels.junctions.right_sides import answer_right_sides
from hybrid.kernels.machine.compile import called, inner
from hybrid.kernels.reel.reel import (
    MOVES,
    WAITS,
)
from hybrid.kernels.reel.reel import read as read_reel
from hybrid.kernels.step.job import call_reel, read


@inner
def waits(line_job):
    """Whether the winch of a line is to be corrected with all lines."""
    return line_job.iterated != 0 and read_reel(line_job.reel_table).reel.stage.lengthens == WAITS


@inner
def draw_along(job, count, with_left):
    """Put the first `count` winches into corrections that were found without them.

    with_left: with their residual torques.
    """
    w = 0
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        if not waits(line_job):
            continue
        if w < count:
            stage = read_reel(line_job.reel_table).reel.stage
            left = -line_job.work.x[int(stage.pulls_at), 0]
            if with_left:
                left += stage.out_of_balance
            add_corrections(job, -left / stage.yielding, job.lengthened[w], job.drawn[w])
        w += 1


@called
def find_lengthening(job, l, w):
    """How all answer to 1 m more of line l, by winch number w, with those before it; False: not finite."""
    for k in range(job.tables.shape[0]):
        clear_right_side(job, k)
    line_job = read(job.tables[l])
    x, n, stage = line_job.work.x, line_job.line.h.shape[0], read_reel(line_job.reel_table).reel.stage
    i = int(stage.grows_at)
    job.marks[job.begins[l] + i] = 1
    x[i, 0] = line_job.work.X[(n + 1) * ROW + i * KEPT + 62] * stage.puts
    eliminate_right_side(job, l)
    if not answer_right_sides(job, True):
        return False
    draw_along(job, w, False)
    stage.yielding = stage.alone - x[int(stage.pulls_at), 0]
    keep_corrections(job, job.lengthened[w], job.drawn[w])
    return True


@inner
def find_lengthenings(job):
    """How all answer to the lengths of all winches; False: not finite."""
    w = 0
    for l in range(job.tables.shape[0]):
        if waits(read(job.tables[l])):
            if not find_lengthening(job, l, w):
                return False
            w += 1
    return True


@inner
def give_lengths(job):
    """Winches give a part of what belongs to the corrections as they are."""
    for l in range(job.tables.shape[0]):
        line_job = read(job.tables[l])
        if waits(line_job):
            stage = read_reel(line_job.reel_table).reel.stage
            left = stage.out_of_balance - line_job.work.x[int(stage.pulls_at), 0]
            stage.change, stage.lengthens = -job.asked.part * left / stage.alone, MOVES
            call_reel(line_job.iterated, line_job.reel_table)
