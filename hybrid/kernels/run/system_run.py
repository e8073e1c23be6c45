"""Steps of several lines that meet at points, many in a call: the compiled loop around kernels.run.system.

Phases, lengths of steps, halvings and codes are those of one cable (kernels.state.books, kernels.step.step_control), with a clock
and counts that all lines have in common.  The states of lines and bodies take turns: SystemJobs of both parities are
bound once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.junctions.bodies import FORCE, LINES, MOMENT, OWN, STATE, WORK
from hybrid.kernels.junctions.members_water import read_members
from hybrid.kernels.junctions.system_job import (
    BEFORE,
    CA,
    CV,
    DT,
    FIXED,
    MOST,
    REACH,
    RHO_OF_LAST,
    RHO_OF_STEP,
    SCALE,
    TIME,
    WHAT,
    read_system,
)
from hybrid.kernels.laws.end_motion import ends_at, load_at, rise, sea_at
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.march.powers import pull
from hybrid.kernels.run.run import watch_itself
from hybrid.kernels.run.system import error_ratio
from hybrid.kernels.run.system_sampling import BODY_SAMPLE, is_due, keep_bodies, sample_now, sample_within
from hybrid.kernels.state.books import (
    ALLOWED,
    ASK_BEFORE,
    ASK_STEPS,
    ASK_TRIES,
    ASKS,
    AT_STOP,
    BEGIN_STEP,
    CLOCK_SIZE,
    COLLAPSES,
    CONTROLLED,
    CORRECTION,
    COUNT_SIZE,
    CUT_AT,
    CUT_BY_ERROR,
    CUT_BY_NEWTON,
    CUT_BY_TURN,
    EARLIER_DT,
    END_STEP,
    FAILED,
    FLAGS,
    ITERATIONS,
    JUDGE,
    LAST_DT,
    LAST_RHO,
    LINES_NEAR,
    LOG,
    NODES_DUE,
    NOW,
    OUTCOME,
    PARITY,
    PAUSED,
    PHASE,
    PREVIOUS,
    QUOTA,
    REPEATS,
    RHO,
    RHO_BEFORE,
    ROWS,
    SAMPLE,
    SHORTEST,
    SOLVE,
    STEP_BEFORE,
    STEPPED,
    STEPS,
    STOP,
    TRIED,
    TRIED_DT,
    TRIES,
    TRY,
    TRY_END,
    TRYING,
    UNTIL,
    WASTED,
    WHERE,
    ZONES_DUE,
)
from hybrid.kernels.state.report import LOCAL_ERROR, RESIDUAL, SLACKEST, SLACKEST_CELL, USED_RHO
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.accept import collapses
from hybrid.kernels.step.generalized_alpha import SAME
from hybrid.kernels.step.job import call_follower, call_solver, read
from hybrid.kernels.step.newton import OK, SLACK, STEP, TURNED_TOO_FAR
from hybrid.kernels.step.step_control import begin_step, halve, passes, take_past

# Of `lines`: the line (-1: a body) where the last try was worst, and of the last try that was given up.
LINE, CUT_LINE = 0, 1
# Of `limits`: the reach of Newton's method, m; its iterations at most; the arm by which moments on bodies are compared
# with forces, m.
OF_REACH, OF_ITERATIONS, OF_ARM = 0, 1, 2


class StepsJob(NamedTuple):
    """Arguments of the entry."""

    even: NDArray[np.int64]  # of a kernels.run.system.SystemJob that leads from the states of even parity to the others
    odd: NDArray[np.int64]  # and of one that leads back
    joined_even: NDArray[np.int64]  # the same of the lines that are joined to what moves with them
    joined_odd: NDArray[np.int64]
    joined: NDArray[np.int64]  # (J,) their numbers
    lone: NDArray[np.int64]  # (L - J, ..) jobs of the others, their task RUN
    lone_lines: NDArray[np.int64]  # (L - J,) and their numbers
    clock: Floats  # (CLOCK_SIZE,) of kernels.state.books, of all lines
    counts: NDArray[np.int64]  # (COUNT_SIZE,)
    limits: Floats  # (3,) above
    lines: NDArray[np.int64]  # (2,) above
    seen: NDArray[np.int64]  # (L,) bits of kernels.state.books: how near a line came to itself in the last step
    log: Floats  # (rows, L, len(LOG))
    loads: Floats  # (K, 8) as kernels.state.state.Moves.loads, of the bodies of which one grows or follows a table
    history: Floats  # (H, 4) likewise
    outputs: Floats  # s, times of all outputs
    bodies: Floats  # (rows, B, BODY_SAMPLE) samples of bodies; those of lines are in their books
    worked: Floats  # (3, B, WORK) of bodies: now, before the last step, before the step before
    members: NDArray[np.int64]  # (M, ..) tables of kernels.junctions.members_water.MembersJob, of bodies with members
    with_members: NDArray[np.int64]  # (M,) and which bodies these are
    watched_even: NDArray[np.int64]  # of a kernels.junctions.lines_distance.LinesJob, after a step of `even`
    watched_odd: NDArray[np.int64]
    followed: NDArray[np.int64]  # (Z, ..) tables of kernels.mesh.zone_step.ZoneJob, with this clock and these counts
    paid: NDArray[np.int64]  # (W, ..) likewise of kernels.reel.reel.ReelJob, of lines that are paid out
    beside: NDArray[np.int64]  # of a kernels.run.system_tangents.SystemTangents
    solver: int = 0  # address of kernels.run.system.solve_system
    marcher: int = 0  # of the kernel that solves a step of one line
    book: int = 0  # of book_system_step
    sampler: int = 0  # of sample_system
    stirrer: int = 0  # of kernels.junctions.members_water.stir_members; 0: no body has members
    watcher: int = 0  # of kernels.junctions.lines_distance.watch_lines; 0: no two lines are watched
    follower: int = 0  # of kernels.mesh.zone_step.follow_zones; 0: no zones move, or Python follows them
    payer: int = 0  # of kernels.reel.payout.pay_out; 0: lines keep their lengths
    tangents: int = 0  # of kernels.run.system_tangents.follow_system; 0: none are followed


def no_loads() -> tuple[Floats, Floats]:
    """StepsJob.loads and history where none changes."""
    return np.zeros((0, 8)), np.zeros((0, 4))


def blank_steps_job() -> StepsJob:
    """A job with the types that every one has."""
    none, log = np.zeros(1, np.int64), np.zeros((1, 1, len(LOG)))
    clock, counts = np.zeros(CLOCK_SIZE), np.zeros(COUNT_SIZE, np.int64)
    lone = np.zeros((1, 1), np.int64)
    return StepsJob(
        none, none, none, none, none, lone, none, clock, counts, np.zeros(3), none, none, log, *no_loads(),
        np.zeros(0), np.zeros((1, 1, BODY_SAMPLE)), np.zeros((3, 1, WORK)), lone, none,
        none, none, lone, lone, none,
    )  # fmt: skip


read_steps = reader(blank_steps_job())
call_step, call_book = caller((0, 0, 0.0, 0, 0)), caller(0)
call_sample, call_stir, call_watch = caller(0), caller(0), caller(0)


@inner
def end_of_try(clock):
    """Time at which the present try ends."""
    end = clock[NOW] + clock[TRIED_DT]
    return clock[UNTIL] if clock[UNTIL] - end <= SAME * clock[TRIED_DT] else end


@inner
def move_lines(system, t):
    """Ends and sea of all lines at t (s)."""
    for l in range(system.tables.shape[0]):
        job = read(system.tables[l])
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
def stir_water(steps, system):
    """The water around members of bodies at the end of the try, where they go on from the state of now."""
    clock = steps.clock
    for m in range(steps.members.shape[0] if steps.stirrer != 0 else 0):
        job, row = read_members(steps.members[m]), system.old[steps.with_members[m]]
        for k in range(STATE):
            job.state[k] = row[k]
        job.dt[0], job.waves[0] = clock[TRY_END] - clock[NOW], 1.0
        sea_at(clock[TRY_END], job.sea)
        call_stir(steps.stirrer, steps.members[m])


@inner
def try_lone(steps, system):
    """Solve the step that is tried of every line that is joined to nothing that moves with it.

    Returns outcome, line, iterations, predicted next correction, and node, of the first that fails, else the largest.
    """
    clock, most, worst = steps.clock, 0, 0.0
    for j in range(steps.lone.shape[0]):
        job, l = read(steps.lone[j]), steps.lone_lines[j]
        own = job.books.clock
        own[NOW], own[TRY_END], own[RHO] = clock[NOW], clock[TRY_END], clock[RHO]
        own[STEP_BEFORE], own[RHO_BEFORE] = clock[LAST_DT], clock[LAST_RHO]
        outcome, it, left, where = call_solver(steps.marcher, steps.lone[j])
        if outcome == OK and not job.work.report[SLACKEST] > system.floors[l]:
            outcome, where = SLACK, int(job.work.report[SLACKEST_CELL])
        if outcome != OK:
            return outcome, l, it, left, where
        most, worst = max(most, it), max(worst, left)
    return OK, -1, most, worst, -1


@inner
def try_step(steps, system):
    """Solve the step that is tried, and note how that ended."""
    clock, counts, asked, table = steps.clock, steps.counts, system.asked, steps.joined_even
    if counts[PARITY]:
        table = steps.joined_odd
    asked[WHAT], asked[DT], asked[TIME] = STEP, clock[TRY_END] - clock[NOW], clock[TRY_END]
    asked[BEFORE], asked[RHO_OF_STEP], asked[RHO_OF_LAST] = clock[LAST_DT], clock[RHO], clock[LAST_RHO]
    asked[CV], asked[CA], asked[SCALE], asked[FIXED] = 0.0, 0.0, 1.0, 1.0 - counts[CONTROLLED]
    asked[REACH], asked[MOST] = steps.limits[OF_REACH], steps.limits[OF_ITERATIONS]
    for l in range(system.tables.shape[0]):
        books = read(system.tables[l]).books
        books.counts[PARITY], books.clock[SHORTEST] = counts[PARITY], clock[SHORTEST]
        books.counts[CONTROLLED] = counts[CONTROLLED]
    outcome, line, it, left, where = try_lone(steps, system)
    if outcome == OK and (steps.joined.shape[0] > 0 or system.work.shape[0] > 0):
        result, more, worse, row, place = call_step(steps.solver, table)
        outcome, it, left, where = result, max(it, more), max(left, worse), place
        if row >= 0:
            line = steps.joined[row]
    counts[OUTCOME], counts[TRIES], counts[WHERE], clock[CORRECTION] = outcome, it, where, left
    steps.lines[LINE] = line


@inner
def follow_lines(steps):
    """What zones of all lines do in the present phase (kernels.mesh.zone_step); 1: Python must look at them."""
    clock, due, allowed = steps.clock, 0, math.inf
    if steps.follower == 0:
        return 0
    for k in range(steps.followed.shape[0]):
        due |= call_follower(steps.follower, steps.followed[k])
        allowed = min(allowed, clock[ALLOWED])
    clock[ALLOWED] = allowed  # which each writes after a step
    return due


@inner
def pay_lines(steps):
    """What lines that are paid out do in the present phase (kernels.reel.payout); 1: a node is to enter or to leave."""
    due = 0
    if steps.payer == 0:
        return 0
    if steps.counts[PHASE] == SOLVE:
        take_past(steps.clock, steps.counts)
    for k in range(steps.paid.shape[0]):
        due |= call_follower(steps.payer, steps.paid[k])
    return due


@inner
def give_up(steps, cause):
    """A try is given up, and repeated in another length."""
    counts = steps.counts
    counts[cause] += 1
    counts[CUT_AT], steps.lines[CUT_LINE] = counts[WHERE], steps.lines[LINE]
    counts[WASTED] += counts[TRIES]
    counts[REPEATS] += 1
    counts[PHASE] = TRY


@inner
def judge(steps, system):
    """Whether the try is the step (1), is to be repeated in another length (0), or has failed for good (-1)."""
    clock, counts = steps.clock, steps.counts
    dt, outcome = clock[TRY_END] - clock[NOW], counts[OUTCOME]
    if outcome == OK:
        if counts[CONTROLLED] and not passes(clock, counts, dt, error_ratio(system.tables, system.allowed)):
            give_up(steps, CUT_BY_ERROR)
            return 0
        return 1
    if 0.5 * clock[TRIED_DT] < clock[SHORTEST]:
        return -1
    halve(clock, counts, dt)
    give_up(steps, CUT_BY_TURN if outcome == TURNED_TOO_FAR else CUT_BY_NEWTON)
    return 0


@inner
def largest_residual(system, arm):
    """Largest force (N) that is left over at a node, a point or, moments by their arm (m), a body; without contact."""
    most, net, work = 0.0, system.net, system.work
    for l in range(system.tables.shape[0]):
        most = max(most, read(system.tables[l]).work.report[RESIDUAL])
    for p in range(net.shape[0]):
        for k in range(3):
            most = max(most, abs(net[p, k]))
    for b in range(work.shape[0]):
        for k in range(3):
            most = max(most, abs(work[b, OWN + k] + work[b, LINES + k]))
            most = max(most, abs(work[b, OWN + 3 + k] + work[b, LINES + 3 + k]) / arm)
    return most


@inner
def accept(steps, system):
    """The step that was tried is taken: clock, log, and what there is to look at."""
    clock, counts = steps.clock, steps.counts
    dt, residual = clock[TRY_END] - clock[NOW], largest_residual(system, steps.limits[OF_ARM])
    clock[EARLIER_DT] = clock[LAST_DT] if clock[NOW] > clock[PREVIOUS] else 0.0
    clock[PREVIOUS], clock[NOW], clock[LAST_DT] = clock[NOW], clock[TRY_END], dt
    keep_bodies(steps.worked, system.work)
    counts[PARITY] = 1 - counts[PARITY]
    counts[STEPS] += 1
    counts[ITERATIONS] = counts[TRIES]
    flags = COLLAPSES if collapses(clock, counts, dt) else 0
    for l in range(system.tables.shape[0]):
        job = read(system.tables[l])
        report, row = job.work.report, steps.log[counts[ROWS], l]
        if l == 0:
            clock[LAST_RHO] = report[USED_RHO]
        row[0], row[1], row[2], row[3] = clock[NOW], dt, counts[TRIES] + counts[WASTED], clock[CORRECTION]
        row[4], row[5], row[6] = residual, counts[REPEATS], report[LOCAL_ERROR]
        row[7], row[8] = pull(report, 0), pull(report, 1)
        steps.seen[l] = watch_itself(job, job.new)
        flags |= job.books.counts[FLAGS] | steps.seen[l]
    if steps.watcher != 0:  # the parity is that of the next step
        watched = steps.watched_odd
        if counts[PARITY]:
            watched = steps.watched_even
        if call_watch(steps.watcher, watched) > 0:
            flags |= LINES_NEAR
    if steps.tangents != 0:
        call_watch(steps.tangents, steps.beside)
    counts[ROWS] += 1
    counts[WASTED], counts[PHASE] = 0, SAMPLE
    if follow_lines(steps) != 0:
        flags |= ZONES_DUE
    if pay_lines(steps) != 0:
        flags |= NODES_DUE
    counts[FLAGS] = flags


@inner
def between_steps(steps, table):
    """The phases before a try; -1 when one is to be made, else what to return.

    Outputs within the step are sampled before Python looks at it, those on its end after that, and at a stop by Python.
    """
    clock, counts = steps.clock, steps.counts
    if counts[PHASE] == SAMPLE:
        if is_due(steps, -1) and call_sample(steps.sampler, table) == 0:
            return PAUSED
        counts[PHASE] = END_STEP
        if counts[FLAGS] != 0 or counts[ASKS] & ASK_STEPS:
            return STEPPED
    if counts[PHASE] == END_STEP:
        if not clock[NOW] < clock[STOP]:
            return AT_STOP
        if is_due(steps, 1) and call_sample(steps.sampler, table) == 0:
            return PAUSED
        counts[PHASE] = BEGIN_STEP if counts[CONTROLLED] or clock[NOW] >= clock[UNTIL] else TRY
    if counts[PHASE] == BEGIN_STEP:
        if not clock[NOW] < clock[STOP]:
            return AT_STOP
        if counts[QUOTA] <= 0 or counts[ROWS] == steps.log.shape[0]:
            return PAUSED
        counts[QUOTA] -= 1
        begin_step(clock, counts)
        counts[PHASE] = TRY
    if counts[PHASE] == TRY:
        if counts[ROWS] == steps.log.shape[0]:  # one step may be cut into many
            return PAUSED
        clock[TRY_END] = end_of_try(clock)
        counts[PHASE] = SOLVE
        if counts[ASKS] & ASK_BEFORE:
            return TRYING
    return -1


@kernel
def sample_system(table):
    """Sample the outputs that are due: within the last step where that comes next, else those at the state of now.

    Returns 0 where the buffers are full before the last of them, else 1.
    """
    steps = read_steps(table)
    own = steps.even
    if steps.counts[PARITY]:
        own = steps.odd
    if steps.counts[PHASE] == SAMPLE:
        return sample_within(steps, read_system(own))
    return sample_now(steps, read_system(own))


@kernel
def run_system(table):
    """Steps of all lines until a code of kernels.state.books is returned."""
    steps = read_steps(table)
    counts = steps.counts
    while True:
        code = between_steps(steps, table)
        if code >= 0:
            return code
        own = steps.even
        if counts[PARITY]:
            own = steps.odd
        system = read_system(own)
        if counts[PHASE] == SOLVE:
            follow_lines(steps)
            if not counts[ASKS] & ASK_BEFORE:
                move_lines(system, steps.clock[TRY_END])
                load_bodies(system.bodies, steps.loads, steps.history, steps.clock[TRY_END])
                stir_water(steps, system)
            pay_lines(steps)
            try_step(steps, system)
            counts[PHASE] = JUDGE
            pay_lines(steps)
            if counts[ASKS] & ASK_TRIES:
                return TRIED
            if steps.follower != 0 and (counts[OUTCOME] != OK or follow_lines(steps) != 0):
                return TRIED
        verdict = judge(steps, system)
        if verdict < 0:
            return FAILED
        if verdict > 0:
            call_book(steps.book, own)
            accept(steps, system)
