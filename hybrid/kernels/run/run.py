"""The compiled entries to all that needs the march (a step, a static solve, block rows), and to runs of many steps.

One kernel for each kind of line, so that neither is compiled for a scene that does not have it.  A run calls it by its
address: what stands around the solver is compiled once for both kinds, and beside them (simulation.first_use).  All get
a table of addresses (kernels.machine.binding); kernels.run.entry and solve.run have their faces for Python.

A run goes through phases, BEGIN_STEP - TRY - JUDGE - SAMPLE - END_STEP, and returns where Python has to decide; called
again it goes on with the phase that follows, as if it had not returned.
"""

from __future__ import annotations

from hybrid.kernels.contact.self_distance import HIDES, MEETS, NEARS, PARTS, UNBENT, is_bent
from hybrid.kernels.laws.end_motion import ends_at, sea_at
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.powers import find_powers
from hybrid.kernels.state.books import (
    ASK_BEFORE,
    ASK_SAMPLES,
    ASK_STEPS,
    ASK_TRIES,
    AT_STOP,
    BEGIN_STEP,
    END_STEP,
    FAILED,
    HIDES_ITSELF,
    IS_BENT,
    JUDGE,
    MEETS_ITSELF,
    NEARS_ITSELF,
    PARTS_ITSELF,
    PAUSED,
    SAMPLE,
    SAMPLED,
    SOLVE,
    START,
    STEPPED,
    TRIED,
    TRY,
    TRYING,
)
from hybrid.kernels.step.accept import accept, end_step, judge, keep_imposed, note_cuts, note_try, watch, watch_push
from hybrid.kernels.step.job import (
    call_follower,
    call_itself,
    call_quantities,
    call_reel,
    call_solver,
    call_zones,
    read,
)
from hybrid.kernels.step.newton import ADDRESS, GAIN, OK, RUN, STEP, Calls, Limits, Task, ask_contact, solve
from hybrid.kernels.step.sampling import sample_step
from hybrid.kernels.step.step import States
from hybrid.kernels.step.step_control import begin_step, end_of_try, take_past
from hybrid.kernels.watch.extremes import first_strains, note_extremes


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
def conclude(table, job, old, new):
    """After a try: -1, or what to return.  Where the step is accepted its books are kept, and it is looked at."""
    line, sea, ends, books, work = job.line, job.sea, job.ends, job.books, job.work
    clock, count, asks = books.clock, books.counts, job.books.counts.asks & ASK_STEPS
    dt = clock.try_end - clock.now
    gains = job.contact[ADDRESS] != 0 and count.outcome == OK and job.reel == 0
    gains = gains and ask_contact(job.contact, job.contact_table, GAIN) > 0.0
    verdict = judge(clock, count, work.report, dt, gains)
    if verdict < 0:
        return FAILED
    if verdict > 0:
        accept(line, ends, old, new, books, work, clock.try_end, dt)
        count.notices = watch(line, ends, old, new, books, work.report, clock.now, dt)
        count.notices |= note_cuts(clock, count, dt)
        if job.was.shape[0] > 0:
            count.notices |= watch_push(clock, work.report)
        if job.follower != 0:
            count.notices |= call_follower(job.follower, job.following)
        count.notices |= watch_itself(job, new)
        if books.extremes.shape[1] > 0:
            note_extremes(line, sea, ends, new, books, clock.now)
        if job.quantities != 0:
            call_quantities(job.quantities, table)
        if job.zones != 0:
            asks |= call_zones(job.zones, job.zone_table)
        if job.reel != 0:
            asks |= call_reel(job.reel, job.reel_table)
        if count.notices != 0 or asks:
            return STEPPED
    return -1


@inner
def between_steps(table, job, old, new):
    """The phases before a try; `new` is the state now.  -1 when one is to be made, else what to return."""
    clock, count = job.books.clock, job.books.counts
    if count.phase == START:
        find_powers(job.line, job.ends, job.books.velocity, new, job.books.report[0], job.books.power[0])
        keep_imposed(job.ends, job.books.imposed)
        if count.new_state and job.books.extremes.shape[1] > 0:
            first_strains(job.line, job.ends, new, job.books)
            note_extremes(job.line, job.sea, job.ends, new, job.books, clock.now)
        if count.new_state and job.quantities != 0:
            call_quantities(job.quantities, table)
        count.phase = count.after_start
    if count.phase == SAMPLE:
        if not sample_step(job.line, job.sea, old, new, job.books):
            return PAUSED
        count.phase = END_STEP
        if count.asks & ASK_SAMPLES:
            return SAMPLED
    if count.phase == END_STEP:
        end_step(job.line, new, clock, count)
    if count.phase == BEGIN_STEP:
        if not clock.now < clock.stop:
            return AT_STOP
        if count.quota <= 0 or count.rows == job.books.log.shape[0]:
            return PAUSED
        count.quota -= 1
        begin_step(clock, count)
        count.phase = TRY
    if count.phase == TRY:
        if count.rows == job.books.log.shape[0] or count.quota < 0:  # one step may be cut into many, or cost as many
            return PAUSED
        clock.try_end = end_of_try(clock, job.moves)
        count.phase = SOLVE
        if count.asks & ASK_BEFORE:
            return TRYING
    return -1


@inner
def solve_job(plane, space, job):
    """Do the task of a job for one kind of line (kernels.march.configuration); of a run, the step that it tries.

    Returns as kernels.step.newton.solve.
    """
    task, clock, old, new, was, now = job.task, job.books.clock, job.old, job.new, job.was, job.now
    iterated = 0
    if task.what == RUN:
        iterated = job.iterated
        if job.books.counts.parity:
            old, new, was, now = job.new, job.old, job.now, job.was
        dt = clock.try_end - clock.now
        limits, cut = task.limits, job.books.counts.most_iterations > 0
        if cut:
            left = job.books.counts.most_iterations - job.books.counts.taken
            limits = Limits(limits.reach, limits.scale, min(left, limits.most))
        fixed = job.books.counts.controlled == 0
        task = Task(STEP, dt, clock.step_before, clock.rho, 0.0, 0.0, False, limits, cut, clock.rho_before, fixed)
    states, calls = States(old, new, was, now), Calls(job.contact, job.contact_table, iterated, job.reel_table)
    return solve(plane, space, task, job.line, job.sea, job.ends, states, job.work, job.books.strains, calls)


@kernel
def in_plane(table):
    job = read(table)
    return solve_job(job.line.plane, None, job)


@kernel
def in_space(table):
    return solve_job(None, 1, read(table))


@kernel(inlined=False)
def run(table):
    """Steps of a line of either kind until a code of kernels.state.books is returned.

    The states and pushes of the job take turns: which is now, books.counts[PARITY] tells.
    """
    job = read(table)
    sea, moves, books, report = job.sea, job.moves, job.books, job.work.report
    clock, count = books.clock, books.counts
    while True:
        old, new = job.old, job.new
        if count.parity:
            old, new = job.new, job.old
        code = between_steps(table, job, new, old)
        if code >= 0:
            return code
        if count.phase == SOLVE:
            ends_at(clock.try_end, moves, sea, job.ends, books.velocity)
            sea_at(clock.try_end, sea)
            if job.zones != 0:
                call_zones(job.zones, job.zone_table)
            take_past(clock, count)
            if job.reel != 0:
                call_reel(job.reel, job.reel_table)
            outcome, it, left, where = call_solver(job.solver, table)
            note_try(clock, count, report, outcome, it, left, where)
            count.phase = JUDGE
            if job.reel != 0:
                call_reel(job.reel, job.reel_table)
            if job.zones != 0 and (count.outcome != OK or call_zones(job.zones, job.zone_table) != 0):
                return TRIED
            if count.asks & ASK_TRIES:
                return TRIED
        code = conclude(table, job, old, new)
        if code >= 0:
            return code
