"""Steps of lines that meet at points: what Newton's method asks of all of them, their books, and samples within steps.

They are solved in space (kernels.run.newton).  Samples are rows of the lines and bodies at times within a step (kernels.step.accept).  Ends of lines are where their nodes are, as points are, which have no samples of their own.  Bodies move by the cubic of
their velocities at both ends of the step, and turn by that of their spins; what lines do to them lies on the parabola
through the step before as well, as reactions do.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import get3, mat_vec, vector
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
    book_bodies,
    end_bodies,
    matrix,
    predict_bodies,
    put,
    put_matrix,
)
from hybrid.kernels.junctions.borders import END, NONE, START, ask, read_network
from hybrid.kernels.junctions.junctions import move_joints
from hybrid.kernels.laws.end_motion import sea_at
from hybrid.kernels.laws.obstacle_grip import grip_obstacles
from hybrid.kernels.laws.obstacles import stored_in_contact
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import caller
from hybrid.kernels.march.energies import book_work, find_powers
from hybrid.kernels.march.march import first_bad, measure
from hybrid.kernels.state.books import HEAD, RATES, SAMPLE_POSITION
from hybrid.kernels.state.report import ENDED, LOCAL_ERROR, RESIDUAL, SEABED_ENERGY, SLACKEST_CELL, TOUCHES
from hybrid.kernels.state.report import TURNED as TURNED_AXES
from hybrid.kernels.step.accept import (
    SAME_TIME,
    book_torques,
    frame_between,
    hermite,
    impose_now,
    keep_past,
    parabola,
    sample_head,
    sample_state,
    watch,
)
from hybrid.kernels.step.line_step import (
    ASSEMBLY,
    BEFORE_MARCH,
    CARRY,
    FORCE,
    ITERATION,
    OK,
    PREDICT,
    SINGULAR,
    SLACK,
    STAND,
    STEP,
    TURNED_TOO_FAR,
    Task,
    ask_line,
    begin_line_step,
    call_quantities,
    end_line_step,
    judge_line,
    read,
    round_off_tension,
    rubs,
    size_of,
    states_of,
    with_radius,
)
from hybrid.kernels.step.step import LARGEST_STEP_TURN, find_rates
from hybrid.kernels.step.step_control import Scheme, scheme
from hybrid.kernels.watch.extremes import first_strains, note_extremes

JUNCTIONS = 5
call_solver = caller((0, 0, 0.0, 0))
# Places among the numbers of a job, whose first field is its task.
TASK_WHAT = Task._fields.index("what")
TASK_CV = Task._fields.index("cv")
TASK_CA = Task._fields.index("ca")
TASK_DT = Task._fields.index("dt")


@inner
def march_lines(network):
    """March all lines, and find what they and borders do to points and bodies.

    Returns -1 or a line that failed, and its bad node.
    """
    tables, joints = network.tables, network.joints
    ask(network, BEFORE_MARCH)
    for l in range(tables.shape[0]):
        job = read(tables[l])
        n = job.line.h.shape[0]
        outcome, _, _, where = call_solver(network.solver, tables[l])
        # the last block is not solved yet; forces of a line alone are known whatever its equations are
        known = joints[l, END] != NONE and where == n
        if network.asked.what == ASSEMBLY and joints[l, START] < 0 and joints[l, END] < 0:
            known = job.work.report[RESIDUAL] < math.inf
        if outcome != OK and not (outcome == SINGULAR and known):
            return l, where
    ask(network, FORCE)
    return -1, -1


@inner
def size_up(tables, ca):
    """Size of a correction, over all lines.

    Largest shift as a part of the line's reach, turn and its line and cell, and what Newton compares with its tolerance.
    """
    shift, turn, size, worst, where = 0.0, 0.0, 0.0, 0, -1
    for l in range(tables.shape[0]):
        job = read(tables[l])
        limits, noise = job.task.limits, round_off_tension(job.line, ca, job.task.limits.scale)
        far, turned, cell, change, big = measure(job.new.e, job.new.T, job.work.x)
        shift = max(shift, far / limits.reach)
        if not turned <= turn:
            turn, worst, where = turned, l, cell
        mine = size_of(turned, far, change, big, limits, noise)
        if not mine <= size:
            size = mine
    return shift, turn, size, worst, where


@inner
def carry_lines(tables, s, what):
    """What all lines remember goes to where the last correction has led."""
    for l in range(tables.shape[0]):
        job = read(tables[l])
        ask_line(1, job, states_of(job), s, what, CARRY)


@inner
def begin_lines(tables, s, safe):
    """Predict a step of all lines; returns -1, or a line that turns too far, its turn and its cell.

    safe: part of the way in which no line passes through itself.
    """
    for l in range(tables.shape[0]):
        job = read(tables[l])
        far, turn, cell = begin_line_step(None, 1, job, states_of(job), s, safe)
        if far:
            return l, turn, cell
    return -1, 0.0, -1


@inner
def end_lines(tables, floors, s, task, good):
    """Rates after a step of all lines, and if it is good their reports.

    Returns OK or why the step of a line is refused, the line and its cell.
    """
    for l in range(tables.shape[0]):
        job = read(tables[l])
        find_rates(1, job.line, job.sea, job.old, job.new, job.work.u, s)
        if good:
            far, _, cell = end_line_step(None, 1, task, job, states_of(job), s)
            if far:
                return TURNED_TOO_FAR, l, cell
            move_joints(job)
            outcome = judge_line(job, task.dt, floors[l])
            if outcome != OK:
                return outcome, l, int(job.work.report[SLACKEST_CELL]) if outcome == SLACK else cell
    return OK, -1, -1


@inner
def note_quantities(table, job, t):
    """Ranges of the quantities that are asked of a line, to its state at t (s)."""
    if job.quantities != 0:
        job.books.clock.now = t
        call_quantities(job.quantities, table)


@inner
def note_ranges(tables, t):
    """The same of all lines as they are: cells may have changed since the step, of one of two that are near each other.

    tables: of steps that lead to the states of now.
    """
    for l in range(tables.shape[0]):
        note_quantities(tables[l], read(tables[l]), t)


@inner
def begin_books_of(table, job, t):
    """Powers and extremes of a line as it is, of which the report is known; t: s, now."""
    line, new, books, report = job.line, job.new, job.books, job.work.report
    find_powers(line, job.ends, books.velocity, new, report, books.power[0])
    for k in range(report.shape[0]):
        books.report[0, k] = report[k]
    impose_now(job.ends, books.imposed)
    if books.counts.repeats > 0:  # a state that is known, from which a step is tried once more
        return
    if books.extremes.shape[1] > 0:
        first_strains(line, job.ends, new, books)
        note_extremes(line, job.sea, job.ends, new, books, t)
    note_quantities(table, job, t)


@kernel(inlined=False)
def begin_line(table):
    """Books of a line in other cells, with a report of its first state, as which both count from here."""
    job = read(table)
    for i in range(job.new.bed.shape[0]):
        for k in range(3):
            job.new.bed[i, k] = job.old.bed[i, k]
    move_joints(job)
    begin_books_of(table, job, job.books.clock.now)


@inner
def begin_books(tables, t):
    """Powers of the states as they are, what the seabed stores, and extremes where they are kept; t: s, now."""
    s = Scheme(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for l in range(tables.shape[0]):
        job = read(tables[l])
        line, sea, new, books, report = job.line, job.sea, job.new, job.books, job.work.report
        if line.bits & TOUCHES:
            report[SEABED_ENERGY] = stored_in_contact(line, sea, new.r)
            books.clock.stored = report[SEABED_ENERGY]
            if line.moved.shape[0] > 0:
                grip_obstacles(line, sea, job.work.u, new, new.grip, new.grip)
            for i in range(new.r.shape[0]):
                new.bed[i, 0], new.bed[i, 1], new.bed[i, 2] = get3(sea.bed, i)
        books.clock.now = t
        move_joints(job)
        ask_line(1, job, states_of(job), s, ASSEMBLY, STAND)
        begin_books_of(tables[l], job, t)


@inner
def keep_books(tables, dt, t):
    """Work of a step of all lines, extremes where they are kept, and what there is to look at; t: s, its end."""
    for l in range(tables.shape[0]):
        job = read(tables[l])
        line, new, books, report = job.line, job.new, job.books, job.work.report
        move_joints(job)
        for k in range(RATES):
            books.power[1, k] = books.power[0, k]
        find_powers(line, job.ends, books.velocity, new, report, books.power[0])
        book_work(line, dt, report, books)
        book_torques(job.old, new, dt, books)
        if books.base.shape[0] > 0:
            books.counts.notices |= watch(line, job.ends, job.old, new, books, report, t, dt)
        keep_past(line, job.ends, job.old, books, report)
        if books.extremes.shape[1] > 0:
            note_extremes(line, job.sea, job.ends, new, books, t)
        note_quantities(tables[l], job, t)


@inner
def error_ratio(tables, allowed):
    """Largest error of the step over what is allowed of it, of all lines; reports are those of the step."""
    ratio = 0.0
    for l in range(tables.shape[0]):
        ratio = max(ratio, read(tables[l]).work.report[LOCAL_ERROR] / allowed[l])
    return ratio


@inner
def end_network_step(network, task, s, solved):
    """Rates and reports of a step that is `solved`; OK or why it is refused, with its line (-1: a body) and cell.

    Whoever keeps it books it (book_network_step).
    """
    outcome, line, cell = end_lines(network.tables, network.floors, s, task, solved)
    turned = end_bodies(network.old, network.new, network.work, s)
    if outcome != OK:
        return outcome, line, cell
    if solved and not turned < LARGEST_STEP_TURN:
        return TURNED_TOO_FAR, -1, -1
    return OK, -1, -1


@kernel(inlined=False)
def book_network_step(table):
    """Books of the step that was solved last, and is kept."""
    network = read_network(table)
    dt, t = network.asked.dt, network.asked.time
    keep_books(network.tables, dt, t)
    book_bodies(network.work, dt)


@inner
def predict_step(network, task, t):
    """Predict a step to t (s) of all lines and bodies.

    Its task and scheme, whether something turns too far, and by how much (rad), its line (-1: a body) and cell.
    """
    safe = ask(network, PREDICT)
    task = with_radius(task, network.asked.rho_of_step)
    s = scheme(task.rho, task.before, task.rho_before, task.dt)
    turn, _ = predict_bodies(network.old, network.new, network.work, s)
    if not turn < LARGEST_STEP_TURN:
        return task, s, True, turn, -1, -1
    line, turn, cell = begin_lines(network.tables, s, safe)
    return task, s, line >= 0, turn, line, cell


@inner
def give_scheme(network, task, s):
    """Tell all lines and borders of the scheme with which they are marched; whether anything rubs."""
    rub, tables, numbers = False, network.tables, network.numbers
    network.asked.scheme_cv, network.asked.scheme_ca = s.cv, s.ca
    for l in range(tables.shape[0]):
        network.tables[l, TASK_WHAT] = ITERATION if task.what == STEP else ASSEMBLY
        numbers[l, TASK_CV], numbers[l, TASK_CA], numbers[l, TASK_DT] = s.cv, s.ca, task.dt
        rub = rubs(read(tables[l])) or rub
    return rub


@inner
def first_not_finite(tables):
    """The first line with a correction that is not finite, and where."""
    for l in range(tables.shape[0]):
        job = read(tables[l])
        total = 0.0
        for i in range(job.work.x.shape[0]):
            for k in range(job.work.x.shape[1]):
                total += abs(job.work.x[i, k])
        if not total < math.inf:
            return l, first_bad(job.work.x, job.new.e)
    return -1, -1


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
def carry_sampled(network, sea, rows):
    """Obstacles that bodies carry are where these are in samples, rows of them."""
    for k in range(network.rides.shape[0]):
        b = network.rides[k]
        if b >= 0:
            put(sea.carried[k], ENDED, vector(rows[b], SAMPLE_PLACE))
            put_matrix(sea.carried[k], TURNED_AXES, matrix(rows[b], SAMPLE_AXES))


@inner
def record_sample(steps, network, where):
    """Lines and bodies at a time, as the next rows of the buffers; `network` leads on from the state of now."""
    t, x, dt, k = where
    count = steps.counts.samples
    for b in range(network.work.shape[0]):
        sample_body(network.new, network.old, steps.worked, b, where, steps.bodies[count, b])
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        now, before, books = job.old, job.new, job.books
        carry_sampled(network, job.sea, steps.bodies[count])
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
def rows_of_samples(steps, network):
    """How many samples fit into the buffers."""
    rows = steps.bodies.shape[0]
    for l in range(network.tables.shape[0]):
        rows = min(rows, read(network.tables[l]).books.samples.shape[0])
    return rows


@inner
def is_due(steps, sign):
    """Whether an output is due: until the state of now (sign 1), or before it (-1)."""
    clock, at = steps.clock, steps.counts.output
    return at < steps.outputs.shape[0] and steps.outputs[at] <= clock.now + sign * SAME_TIME * clock.leg_step


@inner
def sample_within(steps, network):
    """Sample the outputs that fall into the last step, but not on its end; 0: the buffers are full before the last."""
    clock, rows = steps.clock, rows_of_samples(steps, network)
    while is_due(steps, -1):
        if steps.counts.samples == rows:
            return 0
        t, dt = steps.outputs[steps.counts.output], clock.last_dt
        record_sample(steps, network, (t, (t - clock.previous) / dt, dt, clock.earlier_dt / dt))
    return 1


@inner
def sample_now(steps, network):
    """Sample the outputs that are due at the state of now, as it is; 0: the buffers are full before the last."""
    rows = rows_of_samples(steps, network)
    while is_due(steps, 1):
        if steps.counts.samples == rows:
            return 0
        record_sample(steps, network, (steps.outputs[steps.counts.output], 1.0, 0.0, 0.0))
    return 1
