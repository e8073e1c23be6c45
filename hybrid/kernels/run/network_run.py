"""Steps of several lines that meet at points, many in a call: the compiled loop around kernels.run.network.

Phases, lengths of steps, halvings and codes are those of one cable (kernels.state.books, kernels.step.step_control), with a clock
and counts that all lines have in common.  The states of lines and bodies take turns: NetworkJobs of both parities are
bound once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import dot, mat_vec, matrix, vector
from hybrid.kernels.contact.self_distance import HIDES, MEETS, NEARS, PARTS, UNBENT, is_bent
from hybrid.kernels.junctions.bodies import BEFORE, FORCE, FRAME, LINES, MOMENT, OWN, POWER, STATE, V, W, read_members
from hybrid.kernels.junctions.borders import is_grouped_otherwise, is_touched_alone, read_network
from hybrid.kernels.junctions.junctions import add_pulls
from hybrid.kernels.laws.end_motion import ends_at, load_at, rise, sea_at
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.march.energies import pull
from hybrid.kernels.run.network import error_ratio, is_due, keep_bodies, note_ranges, sample_now, sample_within
from hybrid.kernels.state.books import (
    ASK_BEFORE,
    ASK_STEPS,
    ASK_TRIES,
    AT_STOP,
    BEGIN_STEP,
    END_STEP,
    FAILED,
    HIDES_ITSELF,
    IS_BENT,
    JUDGE,
    LINES_NEAR,
    MEETS_ITSELF,
    NEARS_ITSELF,
    NODES_DUE,
    PARTS_ITSELF,
    PAUSED,
    SAMPLE,
    SOLVE,
    STEPPED,
    TRIED,
    TRY,
    TRYING,
    ZONES_DUE,
    Clock,
    Counts,
)
from hybrid.kernels.state.report import LOCAL_ERROR, RESIDUAL, SLACKEST_CELL, USED_RHO
from hybrid.kernels.state.state import Blocks, Floats, NumberRows, Rows, blanks
from hybrid.kernels.step.accept import note_cuts, renew_accelerations, watch_push
from hybrid.kernels.step.line_step import (
    CUT_SHORT,
    OK,
    SLACK,
    STEP,
    TURNED_TOO_FAR,
    call_follower,
    call_itself,
    call_solver,
    judge_line,
    read,
)
from hybrid.kernels.step.step_control import begin_step, end_of_try, halve, note_past, passes

# Of `lines`: the line (-1: a body) where the last try was worst, and of the last try that was given up; whose end turned
# too far in a step last; and which was slack in one.
LINE, CUT_LINE, TURNED_LINE, SLACK_LINE = range(4)
# What a call returns beside codes of kernels.state.books: lines are to be solved with others, or by themselves, from now on.
REGROUP = 16
# What `run_network` returns beside codes of kernels.state.books: zones, or nodes at a winch, are due, of lines where what
# changes then needs no Python.
CELLS_DUE = 32
# Of `limits`: the reach of Newton's method, m; its iterations at most; the arm by which moments on bodies are compared
# with forces, m; the tolerance of Newton's method.
OF_REACH, OF_ITERATIONS, OF_ARM, OF_TOLERANCE = range(4)


class StepsJob(NamedTuple):
    """Arguments of the entry."""

    # of a kernels.run.network.NetworkJob that leads from the states of even parity to the others
    even: NDArray[np.int64]
    odd: NDArray[np.int64]  # and of one that leads back
    joined_even: NDArray[np.int64]  # the same of the lines that are joined to what moves with them
    joined_odd: NDArray[np.int64]
    joined: NDArray[np.int64]  # (J,) their numbers
    lone: NumberRows  # (L - J, ..) jobs of the others, their task RUN
    lone_lines: NDArray[np.int64]  # (L - J,) and their numbers
    marchers: NDArray[np.int64]  # (L - J,) addresses of the kernels that solve their steps
    clock: Clock  # of all lines
    counts: Counts
    limits: Floats  # (4,) above
    lines: NDArray[np.int64]  # (4,) above
    seen: NDArray[np.int64]  # (L,) bits of kernels.state.books: how near a line came to itself in the last step
    log: Blocks  # (rows, L, len(LOG))
    loads: Rows  # (K, 8) as kernels.state.state.Moves.loads, of the bodies of which one grows or follows a table
    history: Rows  # (H, 4) likewise
    outputs: Floats  # s, times of all outputs
    bodies: Blocks  # (rows, B, BODY_SAMPLE) samples of bodies; those of lines are in their books
    worked: Blocks  # (3, B, WORK) of bodies: now, before the last step, before the step before
    members: NumberRows  # (M, ..) tables of kernels.junctions.bodies.MembersJob, of bodies with members
    with_members: NDArray[np.int64]  # (M,) and which bodies these are
    watched_even: NDArray[np.int64]  # of a kernels.contact.lines_distance.LinesJob, after a step of `even`
    watched_odd: NDArray[np.int64]
    followed: NumberRows  # (Z, ..) tables of kernels.mesh.zone_step.ZoneJob, with this clock and these counts
    due: NDArray[np.int64]  # (Z,) whether they ask for something after the last step
    changed: NumberRows  # (Z, ..) tables of kernels.mesh.remesh.RemeshJob, of lines whose cells follow
    changes: NDArray[np.int64]  # (Z,) 1 where there is one
    paid: NumberRows  # (W, ..) likewise of kernels.reel.reel.ReelJob, of lines that are paid out
    nodes_due: NDArray[np.int64]  # (W,) whether a node is to enter or leave there after the last step
    reeled: NumberRows  # (W, ..) tables of kernels.mesh.remesh.RemeshJob, of lines where that needs no Python
    reels: NDArray[np.int64]  # (W,) 1 where there is one
    beside: NDArray[np.int64]  # of a kernels.run.network_tangents.NetworkTangents
    solver: int = 0  # address of kernels.run.newton.solve_network
    leader: int = 0  # of kernels.junctions.borders.lead_lone; 0: no line can come near what is free
    finder: int = 0  # and of find_near
    book: int = 0  # of book_network_step
    sampler: int = 0  # of sample_network
    stirrer: int = 0  # of kernels.junctions.bodies.update_members; 0: no body has members
    watcher: int = 0  # of kernels.contact.lines_distance.watch_lines; 0: no two lines are watched
    follower: int = 0  # of kernels.mesh.zone_step.advance_zones; 0: no zones move, or Python follows them
    runner: int = 0  # of run_network, and of kernels.mesh.remesh.ask_cells and change_cells; 0: Python changes cells
    asker: int = 0
    changer: int = 0
    payer: int = 0  # of kernels.reel.payout.pay_out; 0: lines keep their lengths
    node_asker: int = 0  # of kernels.mesh.remesh likewise; 0: Python lets nodes enter and leave
    reeler: int = 0
    tangents: int = 0  # of kernels.run.network_tangents.advance_joined; 0: none are followed


blank_steps_job = blanks(StepsJob)
read_steps = reader(blank_steps_job())
call_step, call_book = caller((0, 0, 0.0, 0, 0)), caller(0)
call_sample, call_stir, call_watch = caller(0), caller(0), caller(0)


@inner
def end_of_tries(steps, network):
    """Time at which the present try ends: of the line whose end would turn too far in the least of it."""
    clock, end = steps.clock, math.inf
    for l in range(network.tables.shape[0]):
        angle, step = clock.cut_angle, clock.cut_step
        own = end_of_try(clock, read(network.tables[l]).moves)
        if own < end:
            steps.lines[TURNED_LINE], end = l, own
        else:
            clock.cut_angle, clock.cut_step = angle, step
    return end


@inner
def move_lines(network, t):
    """Ends and sea of all lines at t (s)."""
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        ends_at(t, job.moves, job.sea, job.ends, job.books.velocity)
        sea_at(t, job.sea)


@inner
def load_bodies(bodies, loads, history, t):
    """Forces and moments at t (s) of bodies of which one grows or follows a table."""
    for j in range(loads.shape[0]):
        b = int(loads[j, 0])
        for i in range(3):
            bodies[b, FORCE + i] = bodies[b, MOMENT + i] = 0.0
    for j in range(loads.shape[0]):
        part, _ = rise(t, loads[j, 5])
        b, o = int(loads[j, 0]), FORCE
        if loads[j, 1] == 1.0:
            o = MOMENT
        load = load_at(t, loads[j], history)
        for i in range(3):
            bodies[b, o + i] += part * load[i]


@inner
def renew_water(steps, network):
    """The water around members of bodies at the end of the try, where they go on from the state of now."""
    clock = steps.clock
    for m in range(steps.members.shape[0] if steps.stirrer != 0 else 0):
        job, row = read_members(steps.members[m]), network.old[steps.with_members[m]]
        for k in range(STATE):
            job.state[k] = row[k]
        job.dt[0], job.waves[0] = clock.try_end - clock.now, 1.0
        sea_at(clock.try_end, job.sea)
        call_stir(steps.stirrer, steps.members[m])


@inner
def try_lone(steps, network):
    """Solve the step that is tried of every line that is joined to nothing that moves with it.

    Returns outcome, line, iterations, predicted next correction, and node, of the first that fails, else the largest.
    """
    clock, most, worst = steps.clock, 0, 0.0
    for j in range(steps.lone.shape[0]):
        job, l = read(steps.lone[j]), steps.lone_lines[j]
        own = job.books.clock
        own.now, own.try_end, own.rho = clock.now, clock.try_end, clock.rho
        own.step_before, own.rho_before = clock.last_dt, own.last_rho
        job.books.counts.most_iterations, job.books.counts.taken = steps.counts.most_iterations, steps.counts.taken
        outcome, it, left, where = call_solver(steps.marchers[j], steps.lone[j])
        if outcome == CUT_SHORT:
            outcome, steps.counts.is_cut = OK, 1
        if outcome == OK:
            outcome = judge_line(job, clock.try_end - clock.now, network.floors[l])
            if outcome == SLACK:
                where = int(job.work.report[SLACKEST_CELL])
        if outcome != OK:
            return outcome, l, it, left, where
        most, worst = max(most, it), max(worst, left)
    return OK, -1, most, worst, -1


@inner
def try_step(steps, network):
    """Solve the step that is tried, and note how that ended."""
    clock, counts, asked = steps.clock, steps.counts, network.asked
    table, own = (steps.joined_odd, steps.odd) if counts.parity else (steps.joined_even, steps.even)
    asked.what, asked.dt, asked.time = STEP, clock.try_end - clock.now, clock.try_end
    asked.before, asked.rho_of_step, asked.rho_of_last = clock.last_dt, clock.rho, clock.last_rho
    asked.cv, asked.ca, asked.scale, asked.fixed = 0.0, 0.0, 1.0, 1.0 - counts.controlled
    asked.reach, asked.most, counts.is_cut = steps.limits[OF_REACH], steps.limits[OF_ITERATIONS], 0
    asked.tolerance = steps.limits[OF_TOLERANCE]
    asked.cut = 1.0 if counts.most_iterations > 0 else 0.0
    if counts.most_iterations > 0:
        asked.most = min(asked.most, float(counts.most_iterations - counts.taken))
    for l in range(network.tables.shape[0]):
        books = read(network.tables[l]).books
        books.counts.parity, books.clock.shortest = counts.parity, clock.shortest
        books.counts.controlled = counts.controlled
    outcome, line, it, left, where = OK, -1, 0, 0.0, -1
    if steps.joined.shape[0] > 0 or network.work.shape[0] > 0:
        result, it, left, row, where = call_step(steps.solver, table)
        if result == CUT_SHORT:
            result, counts.is_cut = OK, 1
        outcome, line = result, -1
        if row >= 0:
            line = steps.joined[row]
    if outcome == OK:
        if steps.leader != 0:
            call_book(steps.leader, own)
        result, failed, more, worse, place = try_lone(steps, network)
        outcome, it, left = result, max(it, more), max(left, worse)
        if failed >= 0:
            line, where = failed, place
    counts.outcome, counts.tries, counts.where, clock.correction = outcome, it, where, left
    counts.taken += it
    steps.lines[LINE] = line


@inner
def touches_free(steps, network):
    """Whether a line that was solved by itself has come to touch what is free, at the end of the try."""
    if steps.finder == 0 or steps.counts.outcome != OK:
        return False
    call_book(steps.finder, steps.even if steps.counts.parity else steps.odd)
    return is_touched_alone(network)


@inner
def advance_lines(steps):
    """What zones of all lines do in the present phase (kernels.mesh.zone_step); 1: Python must look at them."""
    clock, due, allowed = steps.clock, 0, math.inf
    if steps.follower == 0:
        return 0
    for k in range(steps.followed.shape[0]):
        steps.due[k] = call_follower(steps.follower, steps.followed[k])
        due |= steps.due[k]
        allowed = min(allowed, clock.allowed)
    clock.allowed = allowed  # which each writes after a step
    return due


@inner
def change_lines(due, may, tables, asker, changer):
    """A change for all lines where it is due and nothing else is; 0: Python has to look, and none has changed."""
    for k in range(due.shape[0]):
        if due[k] != 0 and (may[k] == 0 or call_watch(asker, tables[k]) == 0):
            return 0
    for k in range(due.shape[0]):
        if due[k] != 0:
            call_watch(changer, tables[k])
    return 1


@inner
def pay_lines(steps):
    """What lines that are paid out do in the present phase (kernels.reel.payout); 1: a node is to enter or to leave."""
    due = 0
    if steps.payer == 0:
        return 0
    if steps.counts.phase == SOLVE:
        note_past(steps.clock, steps.counts)
    for k in range(steps.paid.shape[0]):
        steps.nodes_due[k] = call_follower(steps.payer, steps.paid[k])
        due |= steps.nodes_due[k]
    return due


@inner
def give_up(steps):
    """A try is given up, and repeated in another length."""
    counts = steps.counts
    counts.cut_at, steps.lines[CUT_LINE] = counts.where, steps.lines[LINE]
    counts.wasted += counts.tries
    counts.repeats += 1
    counts.phase = TRY


@inner
def judge(steps, network):
    """Whether the try is the step (1), is to be repeated in another length (0), or has failed for good (-1)."""
    clock, counts = steps.clock, steps.counts
    dt, outcome = clock.try_end - clock.now, counts.outcome
    if outcome == OK:
        wrong = counts.controlled and not passes(clock, counts, dt, error_ratio(network.tables, network.allowed))
        if wrong and not 0 < counts.most_iterations <= counts.taken:  # else no iteration is left for a shorter one
            counts.cut_by_error += 1
            give_up(steps)
            return 0
        return 1
    if 0.5 * clock.tried_dt < clock.shortest:
        return -1
    if outcome == SLACK:
        # As of one line: the waves are those of the line that is slack, whatever moves its ends.
        if dt <= read(network.tables[steps.lines[LINE]]).books.clock.wave_step:
            return -1
        clock.slack_step, counts.slack_cell, steps.lines[SLACK_LINE] = dt, counts.where, steps.lines[LINE]
    halve(clock, counts, dt)
    if outcome == TURNED_TOO_FAR:
        counts.cut_by_turn += 1
    else:
        counts.cut_by_newton += 1
    give_up(steps)
    return 0


@inner
def largest_residual(network, arm):
    """Largest force (N) that is left over at a node, a point or, moments by their arm (m), a body; without contact."""
    most, net, work = 0.0, network.net, network.work
    for l in range(network.tables.shape[0]):
        most = max(most, read(network.tables[l]).work.report[RESIDUAL])
    for p in range(net.shape[0]):
        for k in range(3):
            most = max(most, abs(net[p, k]))
    for b in range(work.shape[0]):
        for k in range(3):
            most = max(most, abs(work[b, OWN + k] + work[b, LINES + k]))
            most = max(most, abs(work[b, OWN + 3 + k] + work[b, LINES + 3 + k]) / arm)
    return most


@inner
def watch_itself(job, state):
    """How near the line is to itself after a step, as bits: whether it has become so bent, meets itself, is near."""
    if job.itself == UNBENT:
        return IS_BENT if is_bent(state) else 0
    if job.itself == 0:
        return 0
    found = call_itself(job.itself, job.itself_table)
    bits = (MEETS_ITSELF if found & MEETS else 0) | (NEARS_ITSELF if found & NEARS else 0)
    return bits | (PARTS_ITSELF if found & PARTS else 0) | (HIDES_ITSELF if found & HIDES else 0)


@inner
def accept(steps, network):
    """The step that was tried is taken: clock, log, and what there is to look at."""
    clock, counts = steps.clock, steps.counts
    dt, residual = clock.try_end - clock.now, largest_residual(network, steps.limits[OF_ARM])
    clock.earlier_dt = clock.last_dt if clock.now > clock.previous else 0.0
    clock.previous, clock.now, clock.last_dt = clock.now, clock.try_end, dt
    keep_bodies(steps.worked, network.work)
    counts.parity = 1 - counts.parity
    counts.steps += 1
    counts.iterations = counts.tries
    flags, first = note_cuts(clock, counts, dt), 0
    if steps.joined.shape[0] > 0:
        first = steps.joined[0]
    for j in range(steps.lone.shape[0]):
        job = read(steps.lone[j])
        if job.was.shape[0] > 0:
            job.books.counts.notices |= watch_push(job.books.clock, job.work.report)
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        report, row = job.work.report, steps.log[counts.rows, l]
        job.books.clock.last_rho = report[USED_RHO]
        if l == first:
            clock.last_rho = report[USED_RHO]
        row[0], row[1], row[2], row[3] = clock.now, dt, counts.tries + counts.wasted, clock.correction
        row[4], row[5], row[6] = residual, counts.repeats, report[LOCAL_ERROR]
        row[7], row[8] = pull(report, 0), pull(report, 1)
        steps.seen[l] = watch_itself(job, job.new)
        flags |= job.books.counts.notices | steps.seen[l]
    if steps.watcher != 0:  # the parity is that of the next step
        if call_watch(steps.watcher, steps.watched_even if counts.parity else steps.watched_odd) > 0:
            flags |= LINES_NEAR
    if steps.tangents != 0:
        call_watch(steps.tangents, steps.beside)
    counts.rows += 1
    counts.wasted, counts.phase = 0, SAMPLE
    if advance_lines(steps) != 0:
        flags |= ZONES_DUE
    if pay_lines(steps) != 0:
        flags |= NODES_DUE
    counts.notices = flags


@kernel(inlined=False)
def renew_ended(table):
    """After a step that was shortened: accelerations of lines that share no end with others, as of one line."""
    steps = read_steps(table)
    clock, counts = steps.clock, steps.counts
    if counts.repeats > 0:
        network = read_network(steps.even)
        for l in range(network.tables.shape[0]):
            if network.joints[l, 0] < 0 and network.joints[l, 1] < 0:
                job = read(network.tables[l])
                renew_accelerations(job.line, job.new if counts.parity else job.old, clock.until - clock.begin)
        counts.repeats = 0


@inner
def between_steps(steps, table):
    """The phases before a try; -1 when one is to be made, else what to return.

    Outputs within the step are sampled before Python looks at it, those on its end after that, and at a stop by Python.
    """
    clock, counts = steps.clock, steps.counts
    if counts.phase == SAMPLE:
        if is_due(steps, -1) and call_sample(steps.sampler, table) == 0:
            return PAUSED
        counts.phase = END_STEP
        zones, nodes = steps.changer != 0, steps.reeler != 0
        due = (zones and counts.notices == ZONES_DUE) or (nodes and counts.notices == NODES_DUE)
        if due and not counts.asks & ASK_STEPS:
            return CELLS_DUE
        if counts.notices != 0 or counts.asks & ASK_STEPS:
            return STEPPED
    if counts.phase == END_STEP:
        if not clock.now < clock.stop:
            return AT_STOP
        if is_due(steps, 1) and call_sample(steps.sampler, table) == 0:
            return PAUSED
        counts.phase = TRY
        if counts.controlled or clock.now >= clock.until:
            renew_ended(table)
            counts.phase = BEGIN_STEP
    if counts.phase == BEGIN_STEP:
        if not clock.now < clock.stop:
            return AT_STOP
        if counts.quota <= 0 or counts.rows == steps.log.shape[0]:
            return PAUSED
        counts.quota -= 1
        begin_step(clock, counts)
        counts.phase = TRY
    if counts.phase == TRY:
        if counts.rows == steps.log.shape[0]:  # one step may be cut into many
            return PAUSED
        clock.try_end = end_of_tries(steps, read_network(steps.odd if counts.parity else steps.even))
        counts.phase = SOLVE
        if counts.asks & ASK_BEFORE:
            return TRYING
    return -1


@kernel(inlined=False)
def sample_network(table):
    """Sample the outputs that are due: within the last step where that comes next, else those at the state of now.

    Returns 0 where the buffers are full before the last of them, else 1.
    """
    steps = read_steps(table)
    own, other = (steps.odd, steps.even) if steps.counts.parity else (steps.even, steps.odd)
    if steps.counts.phase == SAMPLE:
        return sample_within(steps, read_network(own))
    if is_due(steps, 1):
        note_ranges(read_network(other).tables, steps.clock.now)
    return sample_now(steps, read_network(own))


@kernel
def run_network(table):
    """Steps of all lines until a code of kernels.state.books is returned."""
    steps = read_steps(table)
    counts = steps.counts
    while True:
        code = between_steps(steps, table)
        if code >= 0:
            return code
        own = steps.odd if counts.parity else steps.even
        network = read_network(own)
        if counts.phase == SOLVE:
            advance_lines(steps)
            if not counts.asks & ASK_BEFORE:
                move_lines(network, steps.clock.try_end)
                load_bodies(network.bodies, steps.loads, steps.history, steps.clock.try_end)
                renew_water(steps, network)
            pay_lines(steps)
            try_step(steps, network)
            counts.phase = JUDGE
            pay_lines(steps)
            if touches_free(steps, network):
                give_up(steps)
                return REGROUP
            if counts.asks & ASK_TRIES:
                return TRIED
            if steps.follower != 0 and (counts.outcome != OK or advance_lines(steps) != 0):
                return TRIED
        verdict = judge(steps, network)
        if verdict < 0:
            return FAILED
        if verdict > 0:
            call_book(steps.book, own)
            accept(steps, network)
            if steps.finder != 0 and is_grouped_otherwise(network):
                return REGROUP


@kernel(inlined=False)
def renew_pulls(table):
    """Bodies feel lines whose cells have changed: their forces, and the power from which the work of these goes on."""
    steps = read_steps(table)
    network = read_network(steps.odd if steps.counts.parity else steps.even)
    bodies, work = network.old, network.work
    if work.shape[0] == 0 or network.rides.shape[0] > 0:  # what presses on shapes of bodies is not known again
        return
    network.net[:, :3] = 0.0
    work[:, LINES : LINES + 6] = 0.0
    add_pulls(network)
    for b in range(work.shape[0]):
        spin = mat_vec(matrix(bodies[b], FRAME), vector(bodies[b], W))
        work[b, POWER] = dot(vector(work[b], LINES), vector(bodies[b], V)) + dot(vector(work[b], LINES + 3), spin)
        work[b, BEFORE] = work[b, POWER]
        for k in range(work.shape[1]):
            steps.worked[0, b, k] = work[b, k]


@kernel
def run_lines(table):
    """`run_network`, with other cells, and nodes that enter or leave, of lines that ask for nothing else.

    These write to tables that steps take as constant, so steps are called by their address.
    """
    steps = read_steps(table)
    while True:
        code = call_watch(steps.runner, table)
        if code != CELLS_DUE:
            return code
        if steps.counts.notices == ZONES_DUE:
            done = change_lines(steps.due, steps.changes, steps.changed, steps.asker, steps.changer)
        else:
            done = change_lines(steps.nodes_due, steps.reels, steps.reeled, steps.node_asker, steps.reeler)
        if done == 0:
            return STEPPED
        renew_pulls(table)
        steps.counts.notices = 0
