"""The lines and bodies of a system at times within its steps, as rows of samples (kernels.step.sampling).

Ends of lines are where their nodes are, as points are, which have no samples of their own.  Bodies move by the cubic of
their velocities at both ends of the step, and turn by that of their spins; what lines do to them lies on the parabola
through the step before as well, as reactions do.
"""

from __future__ import annotations

from hybrid.kernels.algebra.rotations import mat_vec, vector
from hybrid.kernels.junctions.bodies import (
    BEFORE,
    DONE,
    FRAME,
    KINETIC,
    LINES,
    PLACE,
    POTENTIAL,
    V,
    W,
    matrix,
    put,
    put_matrix,
)
from hybrid.kernels.laws.end_motion import sea_at
from hybrid.kernels.laws.obstacle_motion import put_matrix as put_matrix_of
from hybrid.kernels.laws.obstacle_motion import put_vector
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.state.books import (
    HEAD,
    SAMPLE_POSITION,
)
from hybrid.kernels.state.obstacle_rows import ENDED, TURNED
from hybrid.kernels.step.job import read
from hybrid.kernels.step.sampling import SAME_TIME, frame_between, hermite, parabola, sample_head, sample_state

# Numbers of a sample of a body.
SAMPLE_PLACE = 0  # 3, origin, m
SAMPLE_AXES = 3  # 9, frame
SAMPLE_V = 12  # 3, m/s
SAMPLE_W = 15  # 3, in its axes, 1/s
SAMPLE_LINES = 18  # 6, force and moment of its lines
SAMPLE_ENERGIES = 24  # 2, kinetic and potential, J
SAMPLE_DONE = 26  # 3, work of the lines, of damping and of loads, J
BODY_SAMPLE = 29


@inner
def keep_bodies(worked, work):
    """What samples are made of, of the bodies after a step, before it, and before the step before."""
    for b in range(work.shape[0]):
        for k in range(work.shape[1]):
            worked[2, b, k], worked[1, b, k], worked[0, b, k] = worked[1, b, k], worked[0, b, k], work[b, k]


@inner
def sample_body(before, now, worked, b, where, row):
    """Body b at a time as of `sample_state`, from its states before and after the step."""
    _, x, dt, k = where
    place, v, frame = vector(now[b], PLACE), vector(now[b], V), matrix(now[b], FRAME)
    if x < 1.0:
        old = matrix(before[b], FRAME)
        w0, w1 = mat_vec(old, vector(before[b], W)), mat_vec(frame, vector(now[b], W))
        place, v = hermite(x, dt, vector(before[b], PLACE), vector(before[b], V), place, v)
        frame = frame_between(old, frame, w0, w1, x, dt)
    put(row, SAMPLE_PLACE, place)
    put(row, SAMPLE_V, v)
    put_matrix(row, SAMPLE_AXES, frame)
    here, there, earlier = worked[0, b], worked[1, b], worked[2, b]
    for j in range(3):
        row[SAMPLE_W + j] = x * now[b, W + j] + (1.0 - x) * before[b, W + j] if x < 1.0 else now[b, W + j]
        row[SAMPLE_DONE + j] = here[DONE + j]
        if x < 1.0:  # powers change evenly
            row[SAMPLE_DONE + j] = (1.0 - x) * there[DONE + j] + x * here[DONE + j]
            row[SAMPLE_DONE + j] -= 0.5 * x * (1.0 - x) * dt * (here[BEFORE + j] - there[BEFORE + j])
    for j in range(8):
        o = LINES + j if j < 6 else (KINETIC if j == 6 else POTENTIAL)
        row[SAMPLE_LINES + j] = here[o]
        if x < 1.0:
            row[SAMPLE_LINES + j] = parabola(x, k, earlier[o], there[o], here[o])


@inner
def carry_sampled(system, sea, rows):
    """Obstacles that bodies carry are where these are in samples, rows of them."""
    for k in range(system.rides.shape[0]):
        b = system.rides[k]
        if b >= 0:
            put_vector(sea.carried, k, ENDED, vector(rows[b], SAMPLE_PLACE))
            put_matrix_of(sea.carried, k, TURNED, matrix(rows[b], SAMPLE_AXES))


@inner
def take_sample(steps, system, where):
    """Lines and bodies at a time, as the next rows of the buffers; `system` leads on from the state of now."""
    t, x, dt, k = where
    count = steps.counts.samples
    for b in range(system.work.shape[0]):
        sample_body(system.new, system.old, steps.worked, b, where, steps.bodies[count, b])
    for l in range(system.tables.shape[0]):
        job = read(system.tables[l])
        now, before, books = job.old, job.new, job.books
        carry_sampled(system, job.sea, steps.bodies[count])
        row, n = books.samples[count], job.line.h.shape[0]
        if x < 1.0:
            sea_at(t, job.sea)
        sample_head(job.sea, books, x, dt, k, t, row)
        sample_state(job.line, job.sea, before, now, books, where, row)
        for j in range(3):
            row[SAMPLE_POSITION + j] = row[HEAD + j]
            row[SAMPLE_POSITION + 3 + j] = row[HEAD + 3 * n + j]
        if x < 1.0:
            sea_at(steps.clock.now, job.sea)
    steps.counts.samples += 1
    steps.counts.output += 1


@inner
def rows_of_samples(steps, system):
    """How many samples fit into the buffers."""
    rows = steps.bodies.shape[0]
    for l in range(system.tables.shape[0]):
        rows = min(rows, read(system.tables[l]).books.samples.shape[0])
    return rows


@inner
def is_due(steps, sign):
    """Whether an output is due: until the state of now (sign 1), or before it (-1)."""
    clock, at = steps.clock, steps.counts.output
    return at < steps.outputs.shape[0] and steps.outputs[at] <= clock.now + sign * SAME_TIME * clock.leg_step


@inner
def sample_within(steps, system):
    """Sample the outputs that fall into the last step, but not on its end; 0: the buffers are full before the last."""
    clock, rows = steps.clock, rows_of_samples(steps, system)
    while is_due(steps, -1):
        if steps.counts.samples == rows:
            return 0
        t, dt = steps.outputs[steps.counts.output], clock.last_dt
        take_sample(steps, system, (t, (t - clock.previous) / dt, dt, clock.earlier_dt / dt))
    return 1


@inner
def sample_now(steps, system):
    """Sample the outputs that are due at the state of now, as it is; 0: the buffers are full before the last."""
    rows = rows_of_samples(steps, system)
    while is_due(steps, 1):
        if steps.counts.samples == rows:
            return 0
        take_sample(steps, system, (steps.outputs[steps.counts.output], 1.0, 0.0, 0.0))
    return 1
