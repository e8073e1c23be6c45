"""Winches that hold a tension, of lines with an end on a point or body that moves.

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
from hybrid.kernels.junctions.borders import (
    AGAIN,
    COUPLE,
    UPDATE,
    add_corrections,
    answer_right_sides,
    clear_right_side,
    eliminate_right_side,
    keep_corrections,
    put_corrections,
)
from hybrid.kernels.junctions.network_job import read_system
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.reel.reel import MOVES, WAITS
from hybrid.kernels.reel.reel import read as read_reel
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.job import call_reel, read
from hybrid.kernels.step.newton import STEP


class WindingJob(NamedTuple):
    """Arguments of the entry; T nodes of all lines, W winches."""

    system: NDArray[np.int64]  # as of kernels.junctions.borders.BorderJob
    kept: Floats  # (T, 5) corrections of lines without winches
    moved: Floats  # (B, 6) and of bodies
    lengthened: Floats  # (W, T, 5) z of lines
    drawn: Floats  # (W, B, 6) and of bodies
    rank: int = 0


def blank_winding_job() -> WindingJob:
    """A job with the types that every one has."""
    z = np.zeros
    return WindingJob(np.zeros(1, np.int64), z((2, SIZE)), z((1, 6)), z((1, 1, SIZE)), z((1, 1, 6)))


read_winding = reader(blank_winding_job())


@inner
def waits(line_job):
    """Whether the winch of a line is to be corrected with all lines."""
    return line_job.iterated != 0 and read_reel(line_job.reel_table).reel.stage.lengthens == WAITS


@inner
def draw_along(system, job, count, with_left):
    """Put the first `count` winches into corrections that were found without them.

    with_left: with their residual torques.
    """
    w = 0
    for l in range(system.tables.shape[0]):
        line_job = read(system.tables[l])
        if not waits(line_job):
            continue
        if w < count:
            stage = read_reel(line_job.reel_table).reel.stage
            left = -line_job.work.x[int(stage.pulls_at), 0]
            if with_left:
                left += stage.out_of_balance
            add_corrections(system, -left / stage.yielding, job.lengthened[w], job.drawn[w])
        w += 1


@called
def find_lengthening(system, job, l, w):
    """How all answer to 1 m more of line l, by winch number w, with those before it; False: not finite."""
    for k in range(system.tables.shape[0]):
        clear_right_side(system, k)
    line_job = read(system.tables[l])
    x, n, stage = line_job.work.x, line_job.line.h.shape[0], read_reel(line_job.reel_table).reel.stage
    i = int(stage.grows_at)
    system.marks[system.begins[l] + i] = 1
    x[i, 0] = line_job.work.X[(n + 1) * ROW + i * KEPT + 62] * stage.puts
    eliminate_right_side(system, l)
    if not answer_right_sides(system, job.rank):
        return False
    draw_along(system, job, w, False)
    stage.yielding = stage.alone - x[int(stage.pulls_at), 0]
    keep_corrections(system, job.lengthened[w], job.drawn[w])
    return True


@inner
def find_lengthenings(system, job):
    """How all answer to the lengths of all winches; False: not finite."""
    w = 0
    for l in range(system.tables.shape[0]):
        if waits(read(system.tables[l])):
            if not find_lengthening(system, job, l, w):
                return False
            w += 1
    return True


@inner
def give_lengths(system):
    """Winches give a part of what belongs to the corrections as they are."""
    for l in range(system.tables.shape[0]):
        line_job = read(system.tables[l])
        if waits(line_job):
            stage = read_reel(line_job.reel_table).reel.stage
            left = stage.out_of_balance - line_job.work.x[int(stage.pulls_at), 0]
            stage.change, stage.lengthens = -system.asked.part * left / stage.alone, MOVES
            call_reel(line_job.iterated, line_job.reel_table)


@kernel
def wind_lines(table):
    """Answer for winches of joined lines (kernels.junctions.borders): they move in steps alone."""
    job = read_winding(table)
    system = read_system(job.system)
    question, count = system.phase[0], job.lengthened.shape[0]
    if system.asked.what != STEP:
        return 1.0
    if question == COUPLE:
        keep_corrections(system, job.kept, job.moved)
        if not find_lengthenings(system, job):
            return 0.0
        put_corrections(system, job.kept, job.moved)
        draw_along(system, job, count, True)
    elif question == AGAIN:
        draw_along(system, job, count, False)
    elif question == UPDATE:
        give_lengths(system)
    return 1.0
