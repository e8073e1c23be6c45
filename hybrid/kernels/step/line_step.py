"""What Newton's method works on and asks of a line, for one step, in time or at rest (kernels.run.newton).

`plane` and `space`: for which kind of line (kernels.march.march).

`Job` has all that steps of a line need, by reference: it is the table of an entry of kernels.run.newton.

What couples beside the band of a line is a border.  A line and joined lines (kernels.junctions.borders) ask borders the
same questions, in the order in which they stand below.  The borders of a line are one list, `ask_line`, which is all that
Newton's method knows of them.  A border that the line does not have costs a comparison.

    border of a line                  is asked
    torque through catenary zones     BEFORE_MARCH, COUPLE, FORCE           kernels.march.zone_torque
    law of length                     BEFORE_MARCH, CARRY                   kernels.laws.axial_law
    layers that slip                  BEFORE_MARCH, CARRY                   kernels.laws.bending_law
    winch                             BEFORE_MARCH, BALANCE, UPDATE, STAND  kernels.reel.payout
    contact with itself               PREDICT, RADIUS, COUPLE, SAFE_PART,   kernels.contact.self_contact
                                      ACCEPT, JUDGE, STAND

Of joined lines the network asks its own borders to COUPLE, BALANCE and UPDATE: these ask those of its lines.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.bending_law import BEHIND_REST, BEHIND_STEP, IN_MOTION, LOADED_FIRST, update_slip
from hybrid.kernels.laws.tension_torque import linearise_stretch
from hybrid.kernels.machine.compile import called, inner
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.march.march import AT_REST
from hybrid.kernels.march.zone_torque import CORRECT, REPORT, TORQUES, pass_torque
from hybrid.kernels.state.books import Books, blank_books
from hybrid.kernels.state.report import AXIAL_LAW, BENDING_SLIP, FRICTION, HELD_SLIP, SELF_CONTACT_ENERGY, SLACKEST
from hybrid.kernels.state.state import (
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
from hybrid.kernels.step.step import LARGEST_STEP_TURN, States, begin_step, end_step
from hybrid.kernels.step.step_control import Scheme, before_fixed, radius_of_step

OK, NOT_CONVERGED, NOT_FINITE, SINGULAR, SLACK, TURNED_TOO_FAR = range(6)  # errors.Outcome, as kernels see it
CUT_SHORT = -1  # a step that is taken though Newton has not converged in the iterations it may take (Task.cut)
STEP, EQUILIBRIUM, ASSEMBLY, CORRECTION, RUN = range(5)
ITERATION = 6  # as ASSEMBLY, of an iteration of a step that is solved with others
OPEN = -2  # of an iteration: its corrections are found, and are to be made


# Newton stops when the next correction, predicted from the last two by quadratic
# convergence, turns no chord by more than the tolerance (rad) and changes no tension by more
# than it of the largest.  Differences between two ways of computing the same thing
# (ends swapped, scene rotated) then stay near 1e-9, a hundred times above round-off.
TOLERANCE = 1e-9


class Limits(NamedTuple):
    """What Newton works with."""

    reach: float  # m, largest shift of a node in one iteration
    scale: float  # N, tension scale of the scene
    most: int  # iterations
    tolerance: float = TOLERANCE  # of the correction that would come next


class Task(NamedTuple):
    """What is asked of `entry`: one of the tasks above, and the numbers that belong to it."""

    what: int
    dt: float = 0.0  # s, of a step
    before: float = 0.0  # s, the step that led to its start, 0 if none did
    rho: float = 0.0  # spectral radius at infinity
    cv: float = 0.0  # 1/s, dv'/dr' of what is no step
    ca: float = 0.0  # 1/s2, dvd'/dr'
    turning: bool = False  # whether chords are turned instead of shifted (kernels.march.march.update)
    limits: Limits = Limits(1.0, 1.0, 1)
    cut: bool = False  # whether a step is taken as the last iteration has left it, converged or not
    rho_before: float = 0.0  # spectral radius of the step that led to its start
    fixed: bool = False  # whether steps have a fixed length, but for parts of one


# Below this the correction is accepted when it no longer shrinks: round-off of ill-scaled lines.
ROUND_OFF = 1e-6
# Round-off of the length of the line, as a part of it (equal cells are all rounded the same way), and the most, as a
# part of the tension scale, that it may make of a tension: a step so small that it is more does not converge.
ROUND_OFF_LENGTH, MOST_NOISE = 2.5e-16, 1e-3
# A shift of the line as a whole turns nothing; it counts as a part of `reach` times this (that is, of the length).
WHOLE = 0.1
# Changes of tension count against the largest tension of the line, or against this part of
# the tension scale of the scene where that is larger (a line can be free of tension).
LOW_TENSION = 1e-3
# A chord that would turn by more than this in one iteration shortens the whole correction
# (damped Newton): the linearised constraint of length is useless beyond about half a radian.
LARGEST_TURN = 0.7


@inner
def is_march(what):
    """Whether a task is one march of a line, and solves nothing."""
    return what in (ASSEMBLY, ITERATION)


@inner
def round_off_tension(line, ca, scale):
    """What round-off of a cell's length makes of the tension, N, when inertia must account for it in a short step."""
    heavy = 0.0
    length = 0.0
    for i in range(line.h.shape[0]):
        heavy += line.mass[i]
        length += line.h[i]
    return min(ROUND_OFF_LENGTH * length * heavy * ca, MOST_NOISE * scale)


@inner
def has_converged(size, before, it, part, tolerance):
    """Outcome OK or NOT_CONVERGED after correction `it`, and the next correction as it is predicted.

    size, before: of this correction and the one before, relative; before: infinite for the first one and behind one
    that was shortened, from which nothing can be predicted; part: of the correction that was made.
    """
    if not before < math.inf:
        return (OK if part == 1.0 and size <= tolerance else NOT_CONVERGED), size
    ratio = size / before
    left = size * min(1.0, ratio * ratio)
    if part == 1.0:
        if size <= tolerance or (it > 1 and size < 1e-3 and left <= 0.1 * tolerance):
            return OK, left
        if it > 4 and size < ROUND_OFF and ratio > 0.3:
            return OK, size
    return NOT_CONVERGED, left


@inner
def with_radius(task, rho):
    """The task of a step with its spectral radius where that of equal steps is rho."""
    before, rho_before = task.before, task.rho_before
    if task.fixed:
        before, rho_before = before_fixed(task.dt, before, rho_before, rho)
    rho = radius_of_step(rho, before, rho_before, task.dt)
    return Task(
        task.what, task.dt, before, rho, task.cv, task.ca, task.turning, task.limits, task.cut, rho_before, task.fixed
    )


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
    itself_table: NDArray[
        np.int64
    ]  # of a kernels.contact.self_distance.ItselfJob, of a line that could come near itself
    contact: NDArray[
        np.int64
    ]  # (3,) of kernels.contact.self_contact: address, 0: no contact; what is asked; whether it is near
    contact_table: NDArray[np.int64]  # of a kernels.contact.self_contact.ContactJob
    reel_table: NDArray[np.int64]  # of a kernels.reel.payout.ReelJob, of a line that is paid out
    itself: int = 0  # address of kernels.contact.self_distance.watch_itself; UNBENT: until the line is bent; 0: never
    reel: int = 0  # address of kernels.reel.payout.pay_out, of a line of several stand_among; 0: its length stays
    iterated: int = 0  # of a run: address of kernels.reel.payout.iterate; 0: iterations need nothing of it
    quantities: int = 0  # address of kernels.watch.named_quantities.note_quantities; 0: none are asked for


def blank_job() -> Job:
    """A job of one cell with the types that every job has."""
    limits, none, state = Limits(1.0, 1.0, 1), np.zeros((0, 4)), blank_state(1)
    tables = np.zeros(0, np.int64), np.zeros(3, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64)
    line = Task(0, limits=limits), blank_line(1), no_sea(1), no_ends(), no_moves()
    return Job(*line, state, state, none, none, no_work(), blank_books(), *tables)


read = reader(blank_job())
call_solver, call_follower, call_itself = caller((0, 0, 0.0, 0)), caller(0), caller(0)
call_quantities = caller(0)


@inner
def size_of(turn, shift, pull, big, limits, noise):
    """What Newton compares with its tolerance, of the correction of a line.

    turn: rad, of a chord; shift: m, of a node; pull, big: N, change of a tension, and the largest one; noise: N, of
    round-off.
    """
    size = max(turn, WHOLE * shift / limits.reach)
    return size if pull < noise else max(size, pull / max(big, LOW_TENSION * limits.scale))


# --- questions ------------------------------------------------------------------------------------------------
# Answered by 1 where nothing else is said; of several borders the least answer counts.

# A step begins; answered by the part of its prediction that is safe.  Of a network `asked.rho_of_step` falls to the
# spectral radius that the step may have.
PREDICT = 0
FORGET = 1  # a solution begins: what was known of another one is found anew
BEFORE_MARCH = 2  # what it carries goes to where its unknowns are
FORCE = 3  # after the march: what lines and it do to points and bodies, or bear, in this state
BALANCE = 4  # what its own equations leave over, when all of that is known
BLOCK = 5  # columns, functional and block that fall on points and bodies, into A
HOLD = 6  # springs against what nothing else holds, in the first iteration of an equilibrium
COUPLE = 7  # its part of the corrections of the iteration; 0: singular, or as below
AGAIN = 8  # its part of other corrections of the iteration, which have no residual; 0: not finite
MEASURE = 9  # the largest shift and turn of its unknowns, into `moves`
SAFE_PART = 10  # answered by the part of the corrections that is safe
UPDATE = 11  # its unknowns move by the part of the corrections that is made
RELAX = 12  # springs of HOLD follow the turns
CARRY = 13  # a solution has ended: what it carries goes to where that has led
# Of a line alone, or of each line.
RADIUS = 14  # answered by the spectral radius that the step may have, where equal steps have the largest one
ACCEPT = 15  # a step is solved: what it reports of it
JUDGE = 16  # 0: the step is to be made in halves, as the border has put energy in
STAND = 17  # what it reports of a state that no step has led to
FIND = 18  # of contact: its points alone, which kernels.junctions.lines_contact solves for
# Answers to COUPLE.
NO_NUMBERS = -1.0  # corrections are not finite
NO_SOLUTION = -2.0  # none were found in the iterations that there are

# Contact of the line with itself: places of `Job.contact` (address, what is asked, whether it is near).
ADDRESS, ASKED, NEAR = range(3)
SHARED = -1  # in place of an address: contact of the line is computed with that of another line

# The largest turn, rad, of a chord in a step of a line that may touch itself: longer ones feed the vibrations that
# contact leaves.
LARGEST_CONTACT_TURN = 0.3

call_contact = caller(0.0)
call_reel = caller(0)


# --- the borders ----------------------------------------------------------------------------------------------


@inner
def twist_zones(space, job, state, cv, question):
    """Answer for a torque through catenary zones; cv: dv'/dr' of the scheme, 1/s."""
    if space is not None:
        if job.work.torsion.known.shape[0] != 0:
            part = -1
            if question == BEFORE_MARCH:
                part = TORQUES
            elif question == COUPLE:
                part = CORRECT
            elif question == FORCE:
                part = REPORT
            if part >= 0:
                pass_torque(job.line, job.ends, state, job.work, part, cv)


@inner
def stretch_by_law(job, states, s, question):
    """Answer for a law of length: it is linearised where the line is."""
    if question in (BEFORE_MARCH, CARRY) and job.line.bits & AXIAL_LAW:
        dt = s.dt
        if not dt > 0.0 and not (s.cv == 0.0 and s.ca < AT_REST):
            dt = -1.0
        linearise_stretch(job.line, states.old, states.new, job.work, dt, job.sea.now[0])


@inner
def slip_layers(job, states, s, what, question):
    """Answer for layers that slip on each other: what they bear, and how far they have slipped."""
    if job.line.bits & (BENDING_SLIP | HELD_SLIP) != BENDING_SLIP:
        return
    part = -1
    if question == BEFORE_MARCH:
        part = IN_MOTION if s.dt > 0.0 or s.cv != 0.0 or s.ca >= AT_REST else LOADED_FIRST
    elif question == CARRY and what in (STEP, EQUILIBRIUM):
        part = BEHIND_STEP if what == STEP else BEHIND_REST
    if part >= 0:
        update_slip(job.line, job.ends, states.old, states.new, job.work, part)


@inner
def wind(job, what, question):
    """Answer for a winch: nodes that ride, the length, and the force of its fairlead."""
    if question == STAND:
        if job.reel != 0:
            call_reel(job.reel, job.reel_table)
    elif job.iterated != 0:
        steps = what in (STEP, ITERATION) and question in (BEFORE_MARCH, BALANCE)
        if steps or question == UPDATE:
            call_reel(job.iterated, job.reel_table)


@inner
def touches(job):
    """Whether contact of the line is computed with the line."""
    return job.contact[ADDRESS] > 0


@inner
def ask_contact(job, question):
    """What kernels.contact.self_contact answers."""
    job.contact[ASKED] = question
    return call_contact(job.contact[ADDRESS], job.contact_table)


@inner
def touch_itself(job, s, what, question):
    """Answer for contact of the line with itself."""
    if not touches(job):
        return 1.0
    if question == COUPLE:
        return 1.0 if what == CORRECTION else ask_contact(job, question)
    if question == JUDGE:
        may_gain = job.reel == 0 and 0.5 * s.dt >= job.books.clock.shortest
        return 1.0 - ask_contact(job, question) if may_gain else 1.0
    if question in (ACCEPT, STAND):
        job.work.report[SELF_CONTACT_ENERGY] = ask_contact(job, question)
    elif question in (PREDICT, RADIUS, SAFE_PART):
        return ask_contact(job, question)
    return 1.0


@called
def ask_line(space, job, states, s, what, question):
    """Ask all borders of a line a question; the least of their answers.

    states: between which the line is solved; s: the scheme, and `what` the task.
    """
    twist_zones(space, job, states.new, s.cv, question)
    stretch_by_law(job, states, s, question)
    slip_layers(job, states, s, what, question)
    wind(job, what, question)
    return touch_itself(job, s, what, question)


@inner
def states_of(job):
    """The states between which a line is solved with others."""
    return States(job.old, job.new, job.was, job.now)


@inner
def rubs(job):
    """Whether forces on the line jump between sticking and sliding, or where feet of contact change the piece."""
    return (job.line.bits & FRICTION) != 0 or (touches(job) and job.contact[NEAR] != 0)


# --- a step of a line, whichever Newton solves it -------------------------------------------------------------


@inner
def most_turn(job):
    """The largest turn, rad, of a chord in a step."""
    return LARGEST_STEP_TURN if job.contact[ADDRESS] == 0 else LARGEST_CONTACT_TURN


@inner
def begin_line_step(plane, space, job, states, s, safe):
    """Predict a step of which a part is safe; whether it turns a chord too far, by how much (rad), and its cell."""
    turn, cell = begin_step(plane, space, job.line, job.sea, states.old, states.new, job.work.u, s, safe)
    return not turn < most_turn(job), turn, cell


@inner
def end_line_step(plane, space, task, job, states, s):
    """The report of a step that is solved; whether it turns a chord too far, by how much (rad), and its cell."""
    ask_line(space, job, states, s, STEP, ACCEPT)
    turn, cell = end_step(plane, space, job.line, job.sea, job.ends, states, s, task, job.work, job.books.strains)
    return not turn < most_turn(job), turn, cell


@inner
def judge_line(job, dt, floor):
    """Outcome of a step of dt (s) that is solved: in halves where a border asks for it; slack below floor (N)."""
    s = Scheme(dt, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if not ask_line(1, job, states_of(job), s, STEP, JUDGE) > 0.0:
        return TURNED_TOO_FAR
    return OK if job.work.report[SLACKEST] > floor else SLACK
