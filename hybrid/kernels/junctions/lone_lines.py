"""Lines that are solved by themselves among bodies and sheaves that other lines move.

What moves freely has come to its place before such a line is solved, and the line is in its way at most: one that comes to
touch it is solved with the others, and so is one that is near it at the beginning of a step.  A line that touches nothing
of it is solved by itself as without it.
"""

from __future__ import annotations

from hybrid.kernels.algebra.rotations import get3
from hybrid.kernels.junctions.network_job import read_system
from hybrid.kernels.laws.surfaces import is_far, surface
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.obstacle_rows import FREE, MEETS_FROM, MEETS_TO, ONSET_OF, PLACE, RADIUS, STRAND
from hybrid.kernels.step.job import read

# Of the radius of a line: how far from a body or sheave that is free it is near it.  A step goes a fraction of that where
# a line comes to rest on something; if it touches before it is near, the try of the step is made again.
NEARBY = 1.0
# Of `near`: the line always moves with others.
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
    system = read_system(table)
    first = -1
    for l in range(system.tables.shape[0]):
        if first < 0 and system.alone[l] == 0:
            first = l
    if first < 0:
        return 0
    source = read(system.tables[first])
    for l in range(system.tables.shape[0]):
        if system.alone[l] != 0:
            job = read(system.tables[l])
            for k in range(job.line.moved.shape[0]):
                if is_free(job, system.rides, k):
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
    system = read_system(table)
    for l in range(system.tables.shape[0]):
        if system.near[l] != JOINED:
            system.near[l] = nearness(read(system.tables[l]), system.rides)
    return 0


@inner
def is_touched_alone(system):
    """Whether a line that was solved by itself touches what is free."""
    touched = False
    for l in range(system.near.shape[0]):
        touched |= system.alone[l] != 0 and system.near[l] == TOUCHES
    return touched


@inner
def is_grouped_otherwise(system):
    """Whether the next step is to be solved with other lines by themselves: those near nothing that is free.

    Where nothing is near any, what is free moves with the first line.
    """
    some = False
    for l in range(system.near.shape[0]):
        some |= system.near[l] != APART
    for l in range(system.near.shape[0]):
        alone = system.near[l] == APART and (some or l > 0)
        if alone != (system.alone[l] != 0):
            return True
    return False
