"""What kernels of several lines get, and which lines are solved by themselves.

They get the lines, points and bodies of a network, and the task that is asked.  Among bodies and sheaves that other
lines move some lines are solved by themselves.  What moves freely has come to its place before such a line is solved,
and the line is in its way at most: one that comes to touch it is solved with the others, and so is one that is near it
at the beginning of a step.  A line that touches nothing of it is solved by itself as without it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import get3
from hybrid.kernels.laws.surfaces import is_far, surface
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import NamedNumbers, reader
from hybrid.kernels.state.report import FREE, MEETS_FROM, MEETS_TO, ONSET_OF, PLACE, RADIUS, STRAND
from hybrid.kernels.state.state import Blocks, Floats, NumberRows, Rows, blanks
from hybrid.kernels.step.line_step import Limits, Task, read


class NetworkJob(NamedTuple):
    """Arguments of the entries: the lines, points and bodies of a network, and room.

    P points, B bodies, L lines; m tensions of last cells and coordinates of points and bodies.
    """

    asked: NetworkTask
    tables: NumberRows  # (L, ..) jobs of the lines (kernels.run.network_run), their task ASSEMBLY
    numbers: Rows  # the same memory
    joints: NumberRows  # (L, 2) points, then bodies, that start and end are joined to, -1 where they are held
    fairleads: Blocks  # (L, 2, 3) m of ends at bodies, in their axes
    seats: Blocks  # (L, 2, SEAT) frames of ends that turn with bodies (kernels.junctions.joined_lines)
    arms: Blocks  # (L, 2, 3) m, worked in
    gaps: Blocks  # (L, 2, 3) m that ends at bodies have still to go; given for a CORRECTION, else worked in
    floors: Floats  # (L,) N, tension at or below which a catenary cell is slack
    allowed: Floats  # (L,) m, error that a step may make
    first: NDArray[np.int64]  # (L,) where columns of a line begin that carries some
    columns: Blocks  # (3, .., 5), or (COLUMNS, .., 5) where an end turns
    functional: Floats  # (FUNCTIONAL,) worked in, as what follows
    parts: Blocks  # as columns: what right-hand sides count in forces and moments on the start, moments on the end
    answers: Rows  # (2, ANSWER)
    q: Floats  # (COLUMNS,)
    net: Rows  # (P, 3) on return what does not balance at the points, N
    bodies: Rows  # (B, NUMBERS ..) what bodies are (kernels.junctions.bodies)
    old: Rows  # (B, STATE) of bodies
    new: Rows  # (B, STATE)
    work: Rows  # (B, WORK)
    S: Rows  # (HANDED - 1, HANDED)
    G: Blocks  # (2, 6, 6)
    A: Rows  # (m+5, m+1)
    right: Floats  # (3 P + 6 B,) right-hand side of points and bodies themselves, of other corrections of an iteration
    still: Blocks  # (L, 2, 3) zeros: gaps of those
    moves: Floats  # (3,) of corrections, as kernels.junctions.borders has it
    begins: NDArray[np.int64]  # (L,) where nodes of lines begin among those of all
    marks: NDArray[np.int64]  # (T,) nodes with another right-hand side
    rides: NDArray[np.int64]  # (M,) the body that carries an obstacle, -1: none does; empty: no body has a shape
    phase: NDArray[np.int64]  # (1,) what is asked of borders (kernels.junctions.borders)
    near: NDArray[np.int64]  # (L,) of all lines, how near they are to what is free (kernels.junctions.network_job)
    alone: NDArray[np.int64]  # (L,) and whether they are solved by themselves
    borders: NDArray[np.int64]  # (K,) addresses of their kernels, in their order
    border_tables: NumberRows  # (K, ..) and their tables
    solver: int = 0  # address of the kernel that marches a line


class NetworkTask(NamedNumbers):
    """The task (kernels.step.line_step.Task), the time of the new states, s, and the part of a correction that is made."""

    what: float
    dt: float
    before: float
    rho_of_step: float
    cv: float
    ca: float
    reach: float
    scale: float
    most: float
    rho_of_last: float
    fixed: float
    time: float
    part: float
    cut: float  # whether a step is taken as the last iteration has left it, converged or not
    tolerance: float
    scheme_cv: float  # of the scheme of the step that is solved, or as cv, ca
    scheme_ca: float


blank_network_job = blanks(NetworkJob)
read_network = reader(blank_network_job())


@inner
def task_of(asked):
    """The task that is asked."""
    limits = Limits(asked.reach, asked.scale, int(asked.most), asked.tolerance)
    return Task(
        int(asked.what), asked.dt, asked.before, asked.rho_of_step, asked.cv, asked.ca, False, limits, asked.cut != 0.0,
        asked.rho_of_last, asked.fixed != 0.0,
    )  # fmt: skip


# Of the radius of a line: how far from a body or sheave that is free it is near it.  A step goes a fraction of that where
# a line comes to rest on something; if it touches before it is near, the try of the step is made again.
NEARBY = 1.0
# Of `near`: the line cannot reach what is free, and is always solved by itself.
APART_ALWAYS = -2
# It always moves with others.
JOINED = -1
# Nothing that is free is near it.
APART = 0
# Something is.
NEAR = 1
# It touches that.
TOUCHES = 2


@inner
def is_free(job, rides, k):
    """Whether obstacle k moves by what lines do to it."""
    if job.line.moved[k] == FREE:
        return True
    return rides.shape[0] > 0 and rides[k] >= 0


@inner
def copy_obstacle(there, here, k):
    """Obstacle k in the sea of a line is where it is in that of another one."""
    for j in range(there.carried.shape[1]):
        if j != MEETS_FROM and j != MEETS_TO:  # which are of the line
            here.carried[k, j] = there.carried[k, j]
    for j in range(PLACE, RADIUS):
        here.obstacles[k, j] = there.obstacles[k, j]


@kernel
def lead_lone(table):
    """Bring what is free to where it has come among the obstacles of lines that are solved by themselves."""
    network = read_network(table)
    first = -1
    for l in range(network.tables.shape[0]):
        if first < 0 and network.alone[l] == 0:
            first = l
    if first < 0:
        return 0
    source = read(network.tables[first])
    for l in range(network.tables.shape[0]):
        if network.alone[l] != 0:
            job = read(network.tables[l])
            for k in range(job.line.moved.shape[0]):
                if is_free(job, network.rides, k):
                    copy_obstacle(source.sea, job.sea, k)
            for k in range(job.new.sheave.shape[0]):
                for j in range(job.new.sheave.shape[1]):
                    job.new.sheave[k, j] = source.new.sheave[k, j]
    return 1


@inner
def nearness(job, rides):
    """How near a line is to what is free, in the state that its steps lead from."""
    found, rows, r = APART, job.sea.obstacles, job.old.r
    for k in range(job.line.moved.shape[0]):
        if is_free(job, rides, k):
            for i in range(r.shape[0]):
                onset = 0.5 * rows[k, ONSET_OF]
                if is_far(job.sea, k, get3(r, i), onset + NEARBY * rows[k, STRAND]):
                    continue
                gap, _, _ = surface(job.sea, k, get3(r, i))
                gap -= onset
                if not gap > 0.0:
                    return TOUCHES
                if gap < NEARBY * rows[k, STRAND]:
                    found = NEAR
    return found


@kernel
def find_near(table):
    """Find how near lines are to what is free, where steps with this table lead from; returns 0."""
    network = read_network(table)
    for l in range(network.tables.shape[0]):
        if network.near[l] >= APART:
            network.near[l] = nearness(read(network.tables[l]), network.rides)
    return 0


@inner
def is_touched_alone(network):
    """Whether a line that was solved by itself touches what is free."""
    touched = False
    for l in range(network.near.shape[0]):
        touched |= network.alone[l] != 0 and network.near[l] == TOUCHES
    return touched


@inner
def is_grouped_otherwise(network):
    """Whether the next step is to be solved with other lines by themselves: those near nothing that is free.

    Where nothing is near any, what is free moves with the first line that can reach it.
    """
    leads = True
    for l in range(network.near.shape[0]):
        leads &= network.near[l] == APART or network.near[l] == APART_ALWAYS
    for l in range(network.near.shape[0]):
        alone = network.near[l] == APART_ALWAYS
        if network.near[l] == APART:
            alone, leads = not leads, False
        if alone != (network.alone[l] != 0):
            return True
    return False
