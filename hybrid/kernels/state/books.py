"""What a run knows beside its state, as arrays that compiled steps read and write: clock, counts, books, samples.

`Counts.notices` are what Python has to look at.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.references import NamedNumbers
from hybrid.kernels.state.report import REPORT_SIZE, SEEN
from hybrid.kernels.state.state import Floats


class Clock(NamedNumbers):
    """Times of a run, in s where nothing else is said, and what else a step compares."""

    now: float  # time of the state, and of the one before it
    previous: float
    last_dt: float  # length of the step that led there; 0 after a start
    earlier_dt: float  # length of the step before the last; 0: it is not known
    step_before: float  # length of the step before that, as the weights of the scheme took it
    last_rho: float  # spectral radii at infinity of these two steps
    rho_before: float
    stop: float  # where steps must end, and the call with them
    leg_begin: float  # where equal steps to `stop` began, and their length
    leg_step: float
    begin: float  # where the present step was begun, and where it should end
    until: float
    tried_dt: float  # longest length of the present tries
    try_end: float  # where the present one ends
    shortest: float  # below which a step is not tried
    largest: float  # longest step that the controller may choose
    allowed: float  # the same for the time being
    tolerance: float  # m, error of position that a step may make
    next_dt: float  # chosen by the controller
    error_ratio: float  # error over tolerance of the last accepted step
    rho: float  # spectral radius at infinity of equal steps
    floor: float  # N, a catenary cell not above it refuses the step
    stored: float  # J, in the seabed
    scaled_jump: float  # N, jump of tension in a step that is worth a look
    moved: float  # m, largest displacement of a base node since the start
    least_peak: float  # N, lowest and highest of the largest tensions
    largest_peak: float
    bend_limit: float  # rad, of an element, from which on they are worth a look
    twist_limit: float
    slack_limit: float  # N, tension of a catenary cell, likewise
    push_start: float  # J, kinetic energy of the push out of the plane when it was given; 0: unknown
    push_grown: float  # by how much its speed has grown since
    most_turn: float  # rad, through which an end may turn in a step
    cut_angle: float  # rad, s: of the last step that was cut because an end turned further; 0: none was
    cut_step: float
    mute_cuts: float  # 1 when an event has told of that
    wave_step: (
        float  # in which tension waves pass a cell: a longer step that leaves a catenary slack is repeated shorter
    )
    slack_step: float  # of the last step that was; 0: none was
    mute_slack: float  # 1 when an event has told of that
    correction: float  # of the last try: next correction of Newton's method, as predicted
    near_plane: float  # m, distance from its plane below which a line in space has come back to it; 0: it never does
    longest: float  # of the accepted steps so far


class Counts(NamedNumbers, number=np.int64):
    """What a run counts, and what comes next in it."""

    controlled: int  # 1 where the length of steps is controlled by their error
    parity: int  # which of the two states is now
    phase: int  # what comes next (below)
    steps: int  # accepted steps; iterations of the last
    iterations: int
    outcome: int  # of the last try: its outcome, iterations, and the cell or node where it was worst
    tries: int
    where: int
    wasted: int  # iterations of tries given up since the last step, and tries repeated since the step was begun
    repeats: int
    leg_part: int  # equal steps taken, and all of them, from leg_begin to stop
    leg_parts: int
    wary: int  # steps for which the length may not grow
    rows: int  # in the log
    output: int  # next output that is due
    samples: int  # in the buffer
    asks: int  # bits: Python is asked before every try, after it, after every step
    notices: int  # what there is to look at after the last step
    stiff: int  # 1 where no cell stretches
    quota: int  # steps until the call returns
    measured: int  # steps of which `worst` knows
    slack_cell: int  # of the step of Clock.slack_step
    varies: int  # 1 where samples have the lengths of cells and the stiffness of elements, which change in a run
    most_iterations: int  # Newton iterations that a step may take in all its tries; 0: as many as converge
    taken: int  # iterations of all tries since the step was begun
    is_cut: int  # whether the last try was taken though it had not converged, and steps so far that were
    cut_short: int
    # Since the last step that was no small part of the longest: steps; tries cut by energy that contact puts in, by what
    # turns too far, by Newton's method, by their error; the node where the last was.
    tiny_steps: int
    cut_by_gain: int
    cut_by_turn: int
    cut_by_newton: int
    cut_by_error: int
    cut_at: int


# Phases.
BEGIN_STEP, TRY, SOLVE, JUDGE, SAMPLE, END_STEP = range(6)
# Bits of Counts.asks.
ASK_BEFORE = 1  # before every try
ASK_TRIES = 2  # after every try
ASK_STEPS = 4  # after every step
# What a call returns: at STOP; a buffer is full or the quota is used up; a try to come; one to be judged; a step to be
# looked at; a step that fails however small.
AT_STOP, PAUSED, TRYING, TRIED, STEPPED, FAILED = range(6)
# Bits of Counts.notices.
STRETCHED = 1  # a cell bears another length than it may
BENT = 2  # an element, beyond its limits of bend or twist
JUMPED = 4  # the largest tension of a line that does not stretch
SLACKENED = 8  # a catenary
LEAVES_PLANE = 16  # a push out of the plane has grown
PUSH_DIED = 32
STEPS_CUT = 64  # as something turned too far
STEPS_SLACK = 128  # as a cell was slack
IS_BENT = 512  # so far that the line may come near itself
MEETS_ITSELF = 1024
ITERATIONS_CUT = 4096  # a try was taken that had not converged
NEARS_PLANE = 8192
NEARS_ITSELF = 16384
PARTS_ITSELF = 32768
HIDES_ITSELF = 65536
COLLAPSES = 131072  # many steps are tiny
ZONES_DUE = 262144  # of a network: zones of a line are to be looked at
NODES_DUE = 524288  # of a network: a node enters or leaves at a winch
LINES_NEAR = 1048576  # of a network: two lines are near each other, between which contact begins

# --- powers and work --------------------------------------------------------------------------------

RATES = 8  # by their rates: start, end, applied, drag, mass damping, stiffness damping, added mass, waves
CONTACT, FRICTION, ZONES, OBSTACLE, HYSTERESIS = range(RATES, RATES + 5)  # by steps
WORKS = RATES + 5
# Columns of the step log.
LOG = ("t", "dt", "iterations", "correction", "residual", "repeats", "error", "end_force_start", "end_force_end")
# Steps of which the worst is remembered, with (left, t, dt, node).
WORST = 3

# --- extremes ----------------------------------------------------------------------------------------

# Bits of `marks`: what a node has.
LOADED, SEAM = 1, 2  # a point load; where one section ends and the next begins
# Rows of `extremes`.
TENSION, CURVATURE, MOMENT, TORQUE, PRESSURE = range(5)
DISPLACEMENT, SELF_PRESSURE, WALL_TENSION, VON_MISES, OBSTACLE_PRESSURE = range(5, 10)
EXTREMES = 10
STRAINS = 10  # columns of `strains`
BENDS, BENT_BY = 8, 9  # of these: bending stiffness of elements now and before the last step, N m; 0: not known


class Books(NamedTuple):
    """What a run knows beside its state."""

    clock: Clock
    counts: Counts
    outputs: Floats  # s, times of all outputs
    power: Floats  # (2, RATES) W, now and before the last step
    work: Floats  # (2, WORKS) J, since the start of the run, likewise
    report: Floats  # (3, REPORT_SIZE) likewise, and before the step before
    tension: Floats  # (2, N) N, before the last step, and before the step before
    twist: Floats  # (2, 2) rad, of the elements at both ends, likewise
    velocity: Floats  # (2, 3) m/s, of held ends now
    imposed: Floats  # (2, 2, 21) now and before the last step, of each end: position, frame, spin, force, moment
    loaded: NDArray[np.int8]  # (2,) 1 where there is a body at the end
    # (2 + K, 3) of ends where the curvature of a rod fades to nothing: EI, N m2 (0: it does not), how far, m; then of
    # pieces of the line EI, N m2, where they end, m, and GJ, N m2 (zeros: not known)
    hinges: Floats
    base: NDArray[np.int64]  # nodes whose displacement is watched
    placed: Floats  # (base.size, 3) m, where they were at the start
    borne: Floats  # (N,) length over unstretched length that each cell bears
    worst: Floats  # (WORST, 4)
    log: Floats  # (rows, len(LOG))
    samples: Floats  # (rows, sample_size(N))
    # (N+1, STRAINS) of elements: curvature (1/m), bending moment (N m), torque (N m), curvature as results have it, and
    # what kernels.watch.sides finds that by; empty: not wanted
    strains: Floats
    start: Floats  # (N+1, 3) m, positions from which displacements count
    marks: NDArray[np.int8]  # (N+1,)
    right: NDArray[np.int64]  # (N+1,) column of `extremes` for the value just after a node; of K marked nodes behind N
    extremes: Floats  # (4, EXTREMES, N+1+K) lowest, highest, and their times (s); empty: not wanted
    # (3, N+1) N/m, of contact of the line with itself: now, before the last step, where the try has led; empty: there is none
    touch: Floats
    # Of quantities that a scene asks for by name (kernels.watch.named_quantities); none: empty.
    asked: Floats  # (Q, ASKED) what they are
    reached: Floats  # (Q, REACHED) lowest and highest values of all steps
    path: Floats  # (P, PATH_ROW) chords that clearances are to, m
    radii: Floats  # (S, 2) m, where the sections of the line end, and their outer radii
    walls: (
        Floats  # (S, WALL) of sections, in a line that has pipes (kernels.watch.named_quantities); empty: it has none
    )


# A sample, one row: t, sea.now (4), of both ends position (2, 3), frame (2, 9), spin, force and moment (2, 3 each), report,
# work; r, v, vd (N+1, 3 each), e (N, 3), T (N), a1 (N, 3), w (N); where they vary, h (N) and kb (N+1, 3); turns (K, 3)
# of zones that a torque passes through; of a line that touches itself, the force of that (N+1); of obstacles of which one
# moves, SEEN of each (kernels.state.report); how far layers have slipped (N+1, 2 L); what nodes remember of soil (N+1, 6).
SAMPLE_SEA = 1
SAMPLE_POSITION = SAMPLE_SEA + 4
SAMPLE_FRAME = SAMPLE_POSITION + 6
SAMPLE_SPIN = SAMPLE_FRAME + 18
SAMPLE_FORCE = SAMPLE_SPIN + 6
SAMPLE_MOMENT = SAMPLE_FORCE + 6
SAMPLE_REPORT = SAMPLE_MOMENT + 6
SAMPLE_WORK = SAMPLE_REPORT + REPORT_SIZE
HEAD = SAMPLE_WORK + WORKS


def sample_size(
    cells: int, varies: bool = False, zones: int = 0, touches: bool = False, obstacles: int = 0, layers: int = 0
) -> int:
    """Numbers of a sample of a line of so many cells.

    varies: with lengths and stiffness; zones: with turns; touches: with the force of contact with itself; obstacles: of
    which one moves; layers: numbers of a node of what slips, and soil.
    """
    return (
        HEAD
        + 9 * (cells + 1)
        + 8 * cells
        + varies * (cells + 3 * (cells + 1))
        + 3 * zones
        + touches * (cells + 1)
        + SEEN * obstacles
        + layers * (cells + 1)
    )


def blank_books(cells: int = 1, rows: int = 1) -> Books:
    """Books of a line of so many cells, with room for so many rows of log and samples, extremes unwanted."""
    z, nodes = np.zeros, cells + 1
    shapes: dict[str, Any] = {"power": (2, RATES), "work": (2, WORKS), "report": (3, REPORT_SIZE), "outputs": 0}
    shapes |= {"tension": (2, cells), "twist": (2, 2), "velocity": (2, 3), "imposed": (2, 2, 21), "hinges": (3, 3)}
    shapes |= {"placed": (0, 3), "worst": (WORST, 4), "log": (rows, len(LOG)), "samples": (rows, sample_size(cells))}
    shapes |= {"strains": (0, STRAINS), "start": (nodes, 3), "extremes": (4, 0, nodes), "touch": (3, 0)}
    shapes |= dict.fromkeys(("asked", "reached", "path", "walls"), (0, 0)) | {"radii": (0, 2)}
    arrays: dict[str, Any] = {name: z(shape) for name, shape in shapes.items()}
    arrays |= {"borne": np.full(cells, np.inf), "right": np.arange(nodes), "base": z(0, np.int64)}
    return Books(Clock(), Counts(), loaded=z(2, np.int8), marks=z(nodes, np.int8), **arrays)
