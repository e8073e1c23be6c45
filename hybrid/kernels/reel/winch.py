"""A winch that holds a tension: its rotor in a step of generalized-alpha, and what the line answers (docs/theory.md, 19).

symbol  meaning                                                    unit
I       inertia of the drum and its drive, as a mass at the line   kg
B(c)    force that the drive loses at the rate c, with its limit   N
P       pull of the line at the fairlead                           N

I dc/dt + B(c) = P - T(t)
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.block_elimination import ROW, SPAN, substitute
from hybrid.kernels.algebra.kept_factors import add_to_right, solve_backward, solve_forward
from hybrid.kernels.algebra.plane import (
    COLUMNS,
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
from hybrid.kernels.machine.references import NamedNumbers
from hybrid.kernels.state.report import PLANAR, STIFFNESS_DAMPING
from hybrid.kernels.step.step_control import radius_of_step, scheme


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
    return n * TRIPLE + COLUMNS - 1 if line.bits & PLANAR else n * ROW + SPAN - 1


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
        moves = (e[0] * X[p + COLUMNS] + e[1] * X[p + 2 * COLUMNS]) / size
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
    for i in range(n + 1):
        for k in range(5):
            x[i, k] = 0.0
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
        substitute(X, x)
    return column[at, 0], x[at, 0]


@inner
def lengthen_cell(line, X, change, columns):
    """The equations eliminated in X with a cell that is longer by a change, m, behind `answer_of_cell`."""
    if line.bits & PLANAR:
        add_to_right_planar(X, change, columns[0])
    else:
        add_to_right(X, change, columns[0])
