"""What Newton's method works on and asks of a line, for one step, in time or at rest (kernels.run.newton).

`plane` and `space`: for which kind of line (kernels.march.march).

`Job` has all that steps of a line need, by reference: it is the table of an entry of kernels.run.newton.

What is beside the band of the line is a border.  Newton asks all of them a question in one place, by the function that is
named here, and in this order; of a line that does not have it each costs a comparison.  Of joined lines it asks the same
functions of each line where no border of joined lines takes their place.

    border                     prepare       before_march     after_march  couple      safe_part  carry
    torque through catenaries                torques                       correction             powers
    law of length                            linearised                                           means
    layers that slip                         what they bear                                       slip
    winch                                    nodes that ride  length
    contact with itself        part, radius                                forces      part       energy

Sheaves that turn freely are borders of all lines (kernels.junctions.sheaves_and_winches): a line by itself has none.

The powers of torques and the energy of contact are of a step that is found alone (`end_line_step`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.bending_law import BEHIND_REST, BEHIND_STEP, IN_MOTION, LOADED_FIRST, update_slip
from hybrid.kernels.laws.tension_torque import linearise_stretch
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.machine.references import caller, reader
from hybrid.kernels.march.march import AT_REST
from hybrid.kernels.march.zone_torque import BEFORE_MARCH, CORRECT, pass_torque
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
from hybrid.kernels.step.step import LARGEST_STEP_TURN, begin_step, end_step
from hybrid.kernels.step.step_control import before_fixed, radius_of_step

# The same of a step of a line that may touch itself: longer ones feed the vibrations that contact leaves.
LARGEST_CONTACT_TURN = 0.3

# Contact of the line with itself: places of `contact` (address, what is asked, whether it is near), and what is asked
# (kernels.contact.self_contact).
ADDRESS, ASKED, NEAR = range(3)
SHARED = -1  # in place of an address: contact of the line is computed with that of another line
PREPARE, LIMIT, TOUCH, FINISH, REST, RADIUS, GAIN, FIND = range(8)
call_contact = caller(0.0)
call_reel = caller(0)

OK, NOT_CONVERGED, NOT_FINITE, SINGULAR, SLACK, TURNED_TOO_FAR = range(6)  # errors.Outcome, as kernels see it
CUT_SHORT = -1  # a step that is taken though Newton has not converged in the iterations it may take (Task.cut)
STEP, EQUILIBRIUM, ASSEMBLY, CORRECTION, RUN = range(5)
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


# --- borders of a line: one of them at a time ---------------------------------------------------------------


@inner
def twist_zones(space, job, state, part, cv):
    """A part of what a torque through catenary zones takes (kernels.march.zone_torque), where there is one."""
    if space is not None:
        if job.work.torsion.known.shape[0] != 0:
            pass_torque(job.line, job.ends, state, job.work, part, cv)


@inner
def stretch_by_law(job, states, s):
    """Linearise the law of length where tension is no multiple of strain (kernels.laws.axial_law)."""
    if job.line.bits & AXIAL_LAW:
        dt = s.dt
        if not dt > 0.0 and not (s.cv == 0.0 and s.ca < AT_REST):
            dt = -1.0
        linearise_stretch(job.line, states.old, states.new, job.work, dt, job.sea.now[0])


@inner
def pass_slip(job, states, part):
    """A part of what layers that slip on each other take (kernels.laws.bending_law), if there are any."""
    if job.line.bits & (BENDING_SLIP | HELD_SLIP) == BENDING_SLIP:
        update_slip(job.line, job.ends, states.old, states.new, job.work, part)


@inner
def wind(job):
    """What a line that is paid out does in an iteration of a step (kernels.reel.payout.iterate)."""
    if job.iterated != 0:
        call_reel(job.iterated, job.reel_table)


@inner
def touches(job):
    """Whether contact of the line is computed with the line."""
    return job.contact[ADDRESS] > 0


@inner
def ask_contact(job, what):
    """What kernels.contact.self_contact answers."""
    job.contact[ASKED] = what
    return call_contact(job.contact[ADDRESS], job.contact_table)


@inner
def rubs(job):
    """Whether forces on the line jump between sticking and sliding, or where feet of contact change the piece."""
    return (job.line.bits & FRICTION) != 0 or (touches(job) and job.contact[NEAR] != 0)


@inner
def judge_line(job, dt, floor):
    """Outcome of a step of dt (s) that is solved: in halves where contact has put energy in; slack below floor (N)."""
    may_gain = touches(job) and job.reel == 0 and 0.5 * dt >= job.books.clock.shortest
    if may_gain and ask_contact(job, GAIN) > 0.0:
        return TURNED_TOO_FAR
    return OK if job.work.report[SLACKEST] > floor else SLACK


# --- borders of a line: one question of all of them ----------------------------------------------------------


@inner
def prepare(job, rho):
    """Before a step is tried: the part of its prediction that is safe, and its spectral radius, where equal steps have rho.

    Where the line touches itself the radius is 0: what contact excites within a step must not stay.
    """
    safe = 1.0
    if touches(job):
        safe = ask_contact(job, PREPARE)
        rho = ask_contact(job, RADIUS)
    return safe, rho


@inner
def before_march(space, job, states, s, what):
    """What borders do to the equations of the configuration, before they are assembled."""
    twist_zones(space, job, states.new, BEFORE_MARCH, s.cv)
    stretch_by_law(job, states, s)
    pass_slip(job, states, IN_MOTION if s.dt > 0.0 or s.cv != 0.0 or s.ca >= AT_REST else LOADED_FIRST)
    if what == STEP:
        wind(job)


@inner
def after_march(job, what):
    """What they do to equations that are eliminated, before these are solved."""
    if what == STEP:
        wind(job)


@inner
def couple(space, job, states, s, what, good):
    """Put borders into a correction that was found without them, and is `good` if it is finite; False: that fails."""
    twist_zones(space, job, states.new, CORRECT, s.cv)
    if good and what != CORRECTION and touches(job):
        return ask_contact(job, TOUCH) > 0.0
    return True


@inner
def safe_part(job):
    """The part of a correction that is safe."""
    return ask_contact(job, LIMIT) if touches(job) else 1.0


@inner
def carry(job, states, s, what):
    """What they remember goes to where a solution has led."""
    stretch_by_law(job, states, s)
    if what in (STEP, EQUILIBRIUM):
        pass_slip(job, states, BEHIND_STEP if what == STEP else BEHIND_REST)


# --- a step of a line, whichever Newton solves it ------------------------------------------------------------


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
    if touches(job):
        job.work.report[SELF_CONTACT_ENERGY] = ask_contact(job, FINISH)
    turn, cell = end_step(plane, space, job.line, job.sea, job.ends, states, s, task, job.work, job.books.strains)
    return not turn < most_turn(job), turn, cell
