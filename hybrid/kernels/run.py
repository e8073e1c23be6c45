"""The compiled entries to all that needs the march (a step, a static solve, block rows), and to runs of many steps.

One kernel for each kind of line, so that neither is compiled for a scene that does not have it.  A run calls it by its
address: what stands around the solver is compiled once for both kinds, and beside them (simulation.first_use).  All get
a table of addresses (kernels.binding); kernels.entry and solve.run have their faces for Python.

A run goes through phases, BEGIN_STEP - TRY - JUDGE - SAMPLE - END_STEP, and returns where Python has to decide; called
again it goes on with the phase that follows, as if it had not returned.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.accept import accept, collapses, end_step, judge, keep_imposed, note_try, watch, watch_push
from hybrid.kernels.books import (
    AFTER_START,
    ASK_BEFORE,
    ASK_SAMPLES,
    ASK_STEPS,
    ASK_TRIES,
    ASKS,
    AT_STOP,
    BEGIN_STEP,
    CLOCK_SIZE,
    COLLAPSES,
    CONTROLLED,
    COUNT_SIZE,
    CUT_ANGLE,
    CUT_SHORT,
    END_STEP,
    FAILED,
    FLAGS,
    HIDES_ITSELF,
    IS_BENT,
    IS_CUT,
    ITERATIONS_CUT,
    JUDGE,
    LOG,
    MEETS_ITSELF,
    MOST_ITERATIONS,
    MUTE_CUTS,
    MUTE_SLACK,
    NEARS_ITSELF,
    NEW_STATE,
    NOW,
    OUTCOME,
    PARITY,
    PARTS_ITSELF,
    PAUSED,
    PHASE,
    QUOTA,
    RATES,
    RHO,
    RHO_BEFORE,
    ROWS,
    SAMPLE,
    SAMPLED,
    SLACK_STEP,
    SOLVE,
    START,
    STEP_BEFORE,
    STEPPED,
    STEPS_CUT,
    STEPS_SLACK,
    STOP,
    TAKEN,
    TRIED,
    TRY,
    TRY_END,
    TRYING,
    WORKS,
    WORST,
    Books,
    sample_size,
)
from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.end_motion import ends_at, sea_at
from hybrid.kernels.extremes import first_strains, note_extremes
from hybrid.kernels.newton import ADDRESS, GAIN, OK, RUN, STEP, Limits, Task, ask_contact, solve
from hybrid.kernels.powers import find_powers
from hybrid.kernels.references import caller, reader
from hybrid.kernels.report import REPORT_SIZE
from hybrid.kernels.sampling import sample_step
from hybrid.kernels.self_distance import HIDES, MEETS, NEARS, PARTS, UNBENT, is_bent
from hybrid.kernels.state import (
    Ends,
    Floats,
    Line,
    Moves,
    Sea,
    State,
    Work,
    blank_line,
    blank_state,
    no_ends,
    no_moves,
    no_sea,
    no_work,
)
from hybrid.kernels.step_control import begin_step, end_of_try, take_past


class Job(NamedTuple):
    """Arguments of the entry."""

    task: Task
    line: Line
    sea: Sea
    ends: Ends
    moves: Moves
    old: State  # of a run: two states in turn, the one of even parity first
    new: State
    was: Floats  # (N+1, 4) a push out of the plane before a step; empty where there is none; likewise
    now: Floats  # (N+1, 4) and after it
    work: Work
    books: Books
    following: NDArray[np.int64]  # of a run: table of what follows the model error (kernels.bending_error)
    zone_table: NDArray[np.int64]  # of a kernels.zone_step.ZoneJob, of a run whose zones move
    itself_table: NDArray[np.int64]  # of a kernels.self_distance.ItselfJob, of a line that could come near itself
    contact: NDArray[
        np.int64
    ]  # (3,) of kernels.self_contact: address, 0: no contact; what is asked; whether it is near
    contact_table: NDArray[np.int64]  # of a kernels.self_contact.ContactJob
    reel_table: NDArray[np.int64]  # of a kernels.payout.ReelJob, of a line that is paid out
    zones: int = 0  # address of kernels.zone_step.follow_zones; 0: zones stay, or Python follows them
    itself: int = 0  # address of kernels.self_distance.watch_itself; UNBENT: until the line is bent; 0: never
    solver: int = 0  # of a run: address of the kernel of the line's kind, which solves its steps
    reel: int = 0  # address of kernels.payout.pay_out; 0: the length of the line stays
    iterated: int = 0  # of a run: address of kernels.payout.iterate; 0: iterations need nothing of it
    follower: int = 0  # and of what is called with `following` after every step; 0: nothing
    quantities: int = 0  # address of kernels.named_quantities.note_quantities; 0: none are asked for


def blank_books(cells: int = 1, rows: int = 1) -> Books:
    """Books of a line of so many cells, with room for so many rows of log and samples, extremes unwanted."""
    z, nodes = np.zeros, cells + 1
    return Books(
        clock=z(CLOCK_SIZE), counts=z(COUNT_SIZE, np.int64), outputs=z(0), power=z((2, RATES)), work=z((2, WORKS)),
        report=z((3, REPORT_SIZE)), tension=z((2, cells)), twist=z((2, 2)), velocity=z((2, 3)), imposed=z((2, 2, 21)), loaded=z(2, np.int8), base=z(0, np.int64), placed=z((0, 3)),
        borne=np.full(cells, np.inf), worst=z((WORST, 4)), log=z((rows, len(LOG))),
        samples=z((rows, sample_size(cells))), model_error=z((2, 0)), strains=z((0, 3)), start=z((nodes, 3)), marks=z(nodes, np.int8),
        right=np.arange(nodes),
        extremes=z((4, 0, nodes)), touch=z((3, 0)), asked=z((0, 0)), reached=z((0, 0)), path=z((0, 0)), radii=z((0, 2)), walls=z((0, 0)),
    )  # fmt: skip


def blank_job() -> Job:
    """A job of one cell with the types that every job has."""
    state = blank_state(1)
    limits, none = Limits(1.0, 1.0, 1), np.zeros((0, 4))
    task = Task(0, limits=limits)
    return Job(
        task, blank_line(1), no_sea(1), no_ends(), no_moves(), state, state, none, none, no_work(), blank_books(),
        np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(3, np.int64), np.zeros(0, np.int64),
        np.zeros(0, np.int64),
    )  # fmt: skip


read = reader(blank_job())
call_solver, call_follower, call_zones, call_itself = caller((0, 0, 0.0, 0)), caller(0), caller(0), caller(0)
call_reel, call_quantities = caller(0), caller(0)


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
    clock, count, asks = books.clock, books.counts, job.books.counts[ASKS] & ASK_STEPS
    dt = clock[TRY_END] - clock[NOW]
    gains = job.contact[ADDRESS] != 0 and count[OUTCOME] == OK and job.reel == 0
    gains = gains and ask_contact(job.contact, job.contact_table, GAIN) > 0.0
    verdict = judge(clock, count, work.report, dt, gains)
    if verdict < 0:
        return FAILED
    if verdict > 0:
        accept(line, ends, old, new, books, work, clock[TRY_END], dt)
        count[FLAGS] = watch(line, ends, old, new, books, work.report, clock[NOW], dt)
        if count[IS_CUT]:
            count[CUT_SHORT] += 1
            if count[CUT_SHORT] == 1:
                count[FLAGS] |= ITERATIONS_CUT
        if collapses(clock, count, dt):
            count[FLAGS] |= COLLAPSES
        if job.was.shape[0] > 0:
            count[FLAGS] |= watch_push(clock, work.report)
        if clock[CUT_ANGLE] > 0.0 and clock[MUTE_CUTS] == 0.0:
            count[FLAGS] |= STEPS_CUT
        if clock[SLACK_STEP] > 0.0 and clock[MUTE_SLACK] == 0.0:
            count[FLAGS] |= STEPS_SLACK
        if job.follower != 0:
            count[FLAGS] |= call_follower(job.follower, job.following)
        count[FLAGS] |= watch_itself(job, new)
        if books.extremes.shape[1] > 0:
            note_extremes(line, sea, ends, new, books, clock[NOW])
        if job.quantities != 0:
            call_quantities(job.quantities, table)
        if job.zones != 0:
            asks |= call_zones(job.zones, job.zone_table)
        if job.reel != 0:
            asks |= call_reel(job.reel, job.reel_table)
        if count[FLAGS] != 0 or asks:
            return STEPPED
    return -1


@inner
def between_steps(table, job, old, new):
    """The phases before a try; `new` is the state now.  -1 when one is to be made, else what to return."""
    clock, count = job.books.clock, job.books.counts
    if count[PHASE] == START:
        find_powers(job.line, job.ends, job.books.velocity, new, job.books.report[0], job.books.power[0])
        keep_imposed(job.ends, job.books.imposed)
        if count[NEW_STATE] and job.books.extremes.shape[1] > 0:
            first_strains(job.line, job.ends, new, job.books)
            note_extremes(job.line, job.sea, job.ends, new, job.books, clock[NOW])
        if count[NEW_STATE] and job.quantities != 0:
            call_quantities(job.quantities, table)
        count[PHASE] = count[AFTER_START]
    if count[PHASE] == SAMPLE:
        if not sample_step(job.line, job.sea, old, new, job.books):
            return PAUSED
        count[PHASE] = END_STEP
        if count[ASKS] & ASK_SAMPLES:
            return SAMPLED
    if count[PHASE] == END_STEP:
        end_step(job.line, new, clock, count)
    if count[PHASE] == BEGIN_STEP:
        if not clock[NOW] < clock[STOP]:
            return AT_STOP
        if count[QUOTA] <= 0 or count[ROWS] == job.books.log.shape[0]:
            return PAUSED
        count[QUOTA] -= 1
        begin_step(clock, count)
        count[PHASE] = TRY
    if count[PHASE] == TRY:
        if count[ROWS] == job.books.log.shape[0] or count[QUOTA] < 0:  # one step may be cut into many, or cost as many
            return PAUSED
        clock[TRY_END] = end_of_try(clock, job.moves)
        count[PHASE] = SOLVE
        if count[ASKS] & ASK_BEFORE:
            return TRYING
    return -1


@inner
def solve_job(plane, space, job):
    """Do the task of a job for one kind of line (kernels.configuration); of a run, the step that it tries.

    Returns as kernels.newton.solve.
    """
    task, clock, old, new, was, now = job.task, job.books.clock, job.old, job.new, job.was, job.now
    iterated = 0
    if task.what == RUN:
        iterated = job.iterated
        if job.books.counts[PARITY]:
            old, new, was, now = job.new, job.old, job.now, job.was
        dt = clock[TRY_END] - clock[NOW]
        limits, cut = task.limits, job.books.counts[MOST_ITERATIONS] > 0
        if cut:
            left = job.books.counts[MOST_ITERATIONS] - job.books.counts[TAKEN]
            limits = Limits(limits.reach, limits.scale, min(left, limits.most))
        fixed = job.books.counts[CONTROLLED] == 0
        task = Task(STEP, dt, clock[STEP_BEFORE], clock[RHO], 0.0, 0.0, False, limits, cut, clock[RHO_BEFORE], fixed)
    return solve(
        plane, space, task, job.line, job.sea, job.ends, old, new, was, now, job.work, job.books.strains, job.contact,
        job.contact_table, iterated, job.reel_table,
    )  # fmt: skip


@kernel
def in_plane(table):
    job = read(table)
    return solve_job(job.line.plane, None, job)


@kernel
def in_space(table):
    return solve_job(None, 1, read(table))


@kernel
def run(table):
    """Steps of a line of either kind until a code of kernels.books is returned.

    The states and pushes of the job take turns: which is now, books.counts[PARITY] tells.
    """
    job = read(table)
    sea, moves, books, report = job.sea, job.moves, job.books, job.work.report
    clock, count = books.clock, books.counts
    while True:
        old, new = job.old, job.new
        if count[PARITY]:
            old, new = job.new, job.old
        code = between_steps(table, job, new, old)
        if code >= 0:
            return code
        if count[PHASE] == SOLVE:
            ends_at(clock[TRY_END], moves, sea, job.ends, books.velocity)
            sea_at(clock[TRY_END], sea)
            if job.zones != 0:
                call_zones(job.zones, job.zone_table)
            take_past(clock, count)
            if job.reel != 0:
                call_reel(job.reel, job.reel_table)
            outcome, it, left, where = call_solver(job.solver, table)
            note_try(clock, count, report, outcome, it, left, where)
            count[PHASE] = JUDGE
            if job.reel != 0:
                call_reel(job.reel, job.reel_table)
            if job.zones != 0 and (count[OUTCOME] != OK or call_zones(job.zones, job.zone_table) != 0):
                return TRIED
            if count[ASKS] & ASK_TRIES:
                return TRIED
        code = conclude(table, job, old, new)
        if code >= 0:
            return code
