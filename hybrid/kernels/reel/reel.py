"""What a line that is paid out knows beside its arrays: its reel, its winch, and the table of kernels for its length.

symbol  meaning                                                    unit
L       unstretched length that is out                             m
c       its rate, positive where line is paid out                  m/s
p       place of the last material node                            m

Places, nodes and cells count here from the far end towards the fairlead, whichever end of the line that is.

A winch may hold a tension: its rotor in a step of generalized-alpha, and what the line answers (docs/theory.md, 19).

I       inertia of the drum and its drive, as a mass at the line   kg
B(c)    force that the drive loses at the rate c, with its limit   N
P       pull of the line at the fairlead                           N

I dc/dt + B(c) = P - T(t)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hybrid.kernels.algebra.block_elimination import ROW, SPAN, substitute
from hybrid.kernels.algebra.kept_factors import add_to_right, solve_backward, solve_forward
from hybrid.kernels.algebra.plane import COLUMNS as PLANAR_COLUMNS
from hybrid.kernels.algebra.plane import (
    TRIPLE,
    add_to_right_planar,
    row_in_plane,
    solve_backward_planar,
    solve_forward_planar,
    substitute_planar,
)
from hybrid.kernels.algebra.rotations import get3
from hybrid.kernels.laws.axial_law import SHIFT, has_law
from hybrid.kernels.laws.element import chord
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.machine.references import NamedNumbers, by_reference, reader
from hybrid.kernels.mesh.remesh import COLUMNS
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.report import PLANAR, REPORT_SIZE, STIFFNESS_DAMPING
from hybrid.kernels.state.state import Ends, Floats, Line, Rows, Sea, State, blanks
from hybrid.kernels.step.step_control import radius_of_step, scheme

# --- a winch that holds a tension --------------------------------------------------------------


class Winch(NamedNumbers):
    """A winch that holds a tension."""

    tension: float  # N, that it holds; 0: there is no such winch
    begin: float  # s, when its brake opens, and over which time its tension goes there from the pull of that moment
    ramp: float
    inertia: float  # kg, N s/m, m/s
    damping: float
    max_rate: float
    held: float  # N, the pull when the brake opens
    length_now: float  # m, m/s, m/s2: L, c and both accelerations before the step
    rate_now: float
    true_now: float
    algorithmic_now: float
    cv: float  # of the step that is tried
    ca: float
    be: float
    dt: float
    least: float  # m, lengths between which the winch has line
    most: float


# Part of the largest rate over which its limit sets in, and beyond which it takes a force of `TENSION` more to go.
CORNER = 0.01


@inner
def tension_held(winch, t):
    """Tension, N, that the winch holds at t."""
    x = min(max((t - winch.begin) / winch.ramp, 0.0), 1.0)
    part = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    return winch.held + part * (winch.tension - winch.held)


@inner
def losses(winch, rate):
    """Force B, N, that the drive loses at a rate, and its derivative: damping, and a limit that sets in smoothly."""
    force, slope = winch.damping * rate, winch.damping
    corner = CORNER * winch.max_rate
    beyond = abs(rate) - winch.max_rate
    if beyond > 0.0:
        steep = winch.tension / corner
        more, grows = 0.5 * steep * beyond * beyond / corner, steep * beyond / corner
        if beyond > corner:
            more, grows = steep * (beyond - 0.5 * corner), steep
        force += math.copysign(more, rate)
        slope += grows
    return force, slope


@inner
def predict(winch, rho, before, rho_before, dt):
    """L, c and dc/dt at the end of a step, with the algorithmic acceleration kept (kernels.step.step.predict_nodes)."""
    s = scheme(radius_of_step(rho, before, rho_before, dt), before, rho_before, dt)
    winch.cv, winch.ca, winch.be, winch.dt = s.cv, s.ca, s.be, dt
    c, vd, a = winch.rate_now, winch.true_now, winch.algorithmic_now
    length = winch.length_now + dt * c + 0.5 * dt * dt * a
    return length, c + dt * a, (s.am * a - s.af * vd) / (1.0 - s.af) + s.ca * s.be * dt * dt * a


@inner
def accept(winch, length, rate, acceleration):
    """A step is accepted: L, c and dc/dt where it ends."""
    dt, be, a = winch.dt, winch.be, winch.algorithmic_now
    without = winch.length_now + dt * winch.rate_now + dt * dt * (0.5 - be) * a
    winch.algorithmic_now = (length - without) / (be * dt * dt)
    winch.length_now, winch.rate_now, winch.true_now = length, rate, acceleration


@inner
def at_its_end(winch):
    """Whether the winch has no more line to pay out, or none to take in."""
    return winch.tension > 0.0 and not winch.least <= winch.length_now <= winch.most


@inner
def last_change(line):
    """Where the change of tension of the last cell stands in the equations eliminated in X."""
    n = line.h.shape[0]
    return n * TRIPLE + PLANAR_COLUMNS - 1 if line.bits & PLANAR else n * ROW + SPAN - 1


@inner
def by_length(line, state, winch, c):
    """How the law of length of cell c answers to its length, which grows at a rate that answers with it."""
    shift = line.law[c, SHIFT] if has_law(line, c) else 0.0
    return (1.0 + shift + line.ck[c] * state.T[c]) * grown(line, winch, c)


@inner
def grown(line, winch, c):
    """1 + tau cv of cell c, if it is damped: how its damped length answers to its length."""
    return 1.0 + line.tau[c] * winch.cv if line.bits & STIFFNESS_DAMPING and line.ck[c] > 0.0 else 1.0


@inner
def softness(line, state, winch, X):
    """How the tension of the last cell answers to its unstretched length, N/m, in the equations eliminated in X.

    The fairlead stays, so that the law of length of that cell alone has the new length; what stands before it answers
    by the first column of the block before.
    """
    c, moves = line.h.shape[0] - 1, 0.0
    if line.bits & PLANAR:
        e = row_in_plane(line.plane, state.e, c)
        size, p = math.sqrt(e[0] * e[0] + e[1] * e[1]), c * TRIPLE
        moves = (e[0] * X[p + PLANAR_COLUMNS] + e[1] * X[p + 2 * PLANAR_COLUMNS]) / size
    else:
        d, _, _ = chord(get3(state.e, c))
        p = c * ROW
        moves = d[0] * X[p + SPAN] + d[1] * X[p + 2 * SPAN] + d[2] * X[p + 3 * SPAN]
    return by_length(line, state, winch, c) / (grown(line, winch, c) * moves - line.h[c] * line.ck[c])


@inner
def answer_of_cell(line, state, winch, X, W, columns, c, at):
    """The same of any cell c, behind nodes that ride or with the fairlead at the start.

    How the tension before node `at` answers to its length, N/m, and the change of that tension in the equations
    eliminated in X, N.  X has room for the factors of another right-hand side; columns: (3, N+1, 5), of which the first
    keeps what `lengthen_cell` adds to the right-hand sides.
    """
    forward, column, x = columns[0], columns[1], columns[2]
    n = line.h.shape[0]
    x[:] = 0.0
    x[c + 1, 0] = by_length(line, state, winch, c)
    if line.bits & PLANAR:
        solve_forward_planar(line.plane, X, x, forward)
    else:
        solve_forward(X, W, x, forward, False, 0)
    for i in range(n + 1):
        for k in range(5):
            column[i, k] = forward[i, k]
    if line.bits & PLANAR:
        solve_backward_planar(line.plane, X, column)
        substitute_planar(line.plane, X, x)
    else:
        solve_backward(X, column, 0)
        substitute(X, x, False, None)
    return column[at, 0], x[at, 0]


@inner
def lengthen_cell(line, X, change, columns):
    """The equations eliminated in X with a cell that is longer by a change, m, behind `answer_of_cell`."""
    if line.bits & PLANAR:
        add_to_right_planar(X, change, columns[0])
    else:
        add_to_right(X, change, columns[0])


# --- the reel ----------------------------------------------------------------------------------

# Parts of a cell: a node enters when that much of the cell after it is out, and leaves when only that much is left.
ENTERS, LEAVES = 0.85, 0.35
# Steps over which new cells get their true lengths, at least; steps that follow the motion are so short that these have
# passed when the next node enters.
FEWEST_STEPS = 8


class ReelNumbers(NamedNumbers):
    """What a line that is paid out knows of its length, c its rate and p the place of the last material node."""

    length: float  # L, c and the rate of c at the end of the try
    rate: float
    acceleration: float
    place: float  # p
    longest: float  # m, the last cell: beyond the first a node enters, below the second one leaves
    shortest: float
    length_before: float  # L before the last step
    due: float  # 1 when a node is to enter or to leave
    flux: float  # W, into the line by what the corrected force of the fairlead does not do
    flux_before: float  # and before the last step
    side: float  # 1 where the fairlead is the end of the line, -1 where it is the start
    far: float  # m, arc length of the far end
    spring: float  # N m/rad, of an angular spring between the fairlead and a clamped line; infinite: rigid
    changed: float  # s, when the last node entered or left; over which forces that balance its neighbours end
    easing: float
    lift: float  # kg/m2, lift per length of what sheds vortices (kernels.laws.water): rho/2 D Cv


class ReelStage(NamedNumbers):
    """How far the balance at the winch has come."""

    riding_on: float
    balance_on: float
    unbalanced: float
    flow_known: float
    # Of a winch that holds a tension, of a line with a joined end (kernels.junctions.sheaves_and_winches): what is asked of it;
    # the block row of the cell that grows, and what its length puts there per m; the block row with the tension before the
    # fairlead; N out of balance at the rotor, and how that grows with the length by itself, N/m.
    lengthens: float
    grows_at: float
    puts: float
    pulls_at: float
    out_of_balance: float
    alone: float
    change: float  # m, of the length


# What may be asked: to be corrected with the lines; to take its change.
WAITS, MOVES = 1.0, 2.0
# Columns of `Reel.flow`.
LENGTH_OF = 0
FLOW = 1
STRAIN_OF = 2  # 3
TURN_FLOW = 5  # 3
FLOWS = 8


class Reel(NamedTuple):
    """What a line that is paid out knows beside its arrays; N cells."""

    numbers: ReelNumbers
    law: Floats  # (K, 8) s, from which on a row holds; coefficients of L in the time since then, highest power first
    pieces: Floats  # (P, 1 + COLUMNS) m, where a piece of the material begins; its row (kernels.mesh.remesh)
    rest: Floats  # (1, COLUMNS) of the cell before the last material node
    rest_length: Floats  # (1,) m, its length
    true: Floats  # (N,) m, lengths of cells
    lack: Floats  # (N,) m, that cells lacked when they were made
    rate: Floats  # (N,) m/s, its rate then
    since: Floats  # (N,) s, when that was
    span: Floats  # (N,) s, over which they get it
    # (N+1, 10) before the last step, of cells or nodes: length; mass, weight, stiffness (3), strain without load (3);
    # compliance of cells
    before: Floats
    clamp: Floats  # (3,) rad, turn of the element at a clamp, before the last step
    report: Floats  # (REPORT_SIZE,) this and the next: work arrays
    made: Floats  # (2, COLUMNS)
    layer: Floats  # (m+1,) m, how far before the fairlead the nodes that ride with it are; that is the last, 0
    # (m+1, 6) N, by which the forces on them are more because they do not move as the material does, on the fairlead 0
    # where it is held; and the forces without
    riding: Floats
    # 1 while these, or `balance`, are among the forces on the line; while `balance` is to be found; where the last
    # assembly since the last step had `flow` in it; of a winch of a joined line what is above
    stage: ReelStage
    balance: Floats  # (N+1, 3) N, forces on nodes, in the order of the line, that balanced them at CHANGED
    plain: Floats  # (N+1, 3) N, the forces on the line without them
    winch: Winch  # of a winch that holds a tension (kernels.reel.reel)
    # (N+1, FLOWS) of a line that is damped in proportion to stiffness, else empty: of cells length and flow, m/s, of
    # elements strain without stress and flow, rad/s (kernels.reel.payout_work)
    flow: Floats
    columns: Floats  # (3, N+1, 5) that such a winch at the start, or at a clamp, works in; else empty
    volumes: (
        Floats  # (N+2, 1 + 4 L) of a line with L layers that slip (kernels.reel.paid_length), else empty: of elements
    )
    bent: Floats  # (2,) rad, bend at a clamp of such a line before the last step, without its spring


def blank_reel(
    cells: int, law: Floats, pieces: Floats, winch: Winch, layer: Floats, columns: bool, damped: bool, slips: int = 0
) -> Reel:
    """A reel of a line of so many cells.

    columns: whether such a winch needs another right-hand side; damped: see `flow`; slips: layers that do.
    """
    z, n = np.zeros, cells + 1
    lengths = z((1, COLUMNS)), z(1), z(cells), z(cells), z(cells), np.full(cells, -np.inf), np.ones(cells), z((n, 10))
    riding = layer, z((layer.size, 6)), ReelStage(), z((n, 3)), z((n, 3)), winch
    flow = z((n if damped else 0, FLOWS)), z((3, n, 5) if columns else (3, 0, 5))
    reports = z(3), z(REPORT_SIZE), z((2, COLUMNS))
    volumes = z((n + 1 if slips else 0, 1 + 4 * slips))
    given = ReelNumbers(changed=-np.inf), law, pieces
    return Reel(*(*given, *lengths, *reports, *riding, *flow, volumes, z(2)))


by_reference(blank_reel(1, np.zeros((1, 8)), np.zeros((1, 1 + COLUMNS)), Winch(), np.zeros(1), False, False))


class MovingZones(NamedTuple):
    """Of zones that move (kernels.mesh.zone_step.Zones), what they take the work of lengths and stiffness from."""

    lengths: Floats  # (N,) m, at the end of the last step; none where zones stay
    stiff: Rows  # (N+1, 3) N m


def zones_that_stay() -> MovingZones:
    return MovingZones(np.zeros(0), np.zeros((0, 3)))


class ReelJob(NamedTuple):
    """Arguments of the entries: two states in turn as kernels.run.network_run has them, and its clock, counts, work and report."""

    line: Line
    sea: Sea
    ends: Ends
    old: State
    new: State
    clock: Clock
    counts: Counts
    work: Rows  # (2, WORKS)
    velocity: Rows  # (2, 3) m/s, of the ends
    report: Floats  # (REPORT_SIZE,) of the step
    reel: Reel
    X: Floats  # of the line's kernels.state.state.Work
    W: Floats
    zones: MovingZones


blank_reel_job = blanks(ReelJob)
read = reader(blank_reel_job())
