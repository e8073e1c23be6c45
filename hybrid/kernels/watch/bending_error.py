"""What neglecting bending shifts the cable by: one more right-hand side a step (docs/theory.md, 14).

The balance of a cable that bends is that of the one computed plus the forces of the moments neglected.  So its
distance from the one computed, x + e, obeys the same equations linearised, J e = - (what is neglected), in the same
time scheme, with the matrix that Newton factored last.

    symbol   meaning                                                        shape   unit
    M        the moment neglected (kernels.watch.neglected_moments)               N+1, 3  N m     inertial
    x        the error: dT_{i-1} (N), e_i (m), dpsi_i (rad)                 N+1, 5
    e, ev, ea, evd   error of r, v, a, vd                                   N+1, 4  with the spin's in column 3
    y, z     evp - cv ep, evdp - ca ep: what history adds to cv e, ca e     N+1, 4  m/s, m/s2
    slid     error of the elastic travel of friction                        N+1, 3  m
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination_plane import solve_again_planar
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.algebra.rotations import add, cross, dot, get3, mat_vec, scale, sub
from hybrid.kernels.laws.bed import bed_before, bed_beside, bed_under
from hybrid.kernels.laws.cell import Chord, Rates
from hybrid.kernels.laws.end_motion import end_turn
from hybrid.kernels.laws.node_forces import Z3, inertia_and_water
from hybrid.kernels.laws.seabed import contact, friction, pressure
from hybrid.kernels.laws.soil import left_of
from hybrid.kernels.laws.tension_torque import twist_of_line
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.books import (
    UNKNOWN_ERROR,
    Clock,
    Counts,
)
from hybrid.kernels.state.report import FRICTION, PLANAR, REPORT_SIZE, ROTARY, SEABED, STIFFNESS_DAMPING
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State, blank_line, blank_state, no_ends, no_sea
from hybrid.kernels.step.generalized_alpha import Scheme, scheme
from hybrid.kernels.watch.neglected_moments import Bending, chord_of, neglected_moments, tabulate_chords, turn_chords

# Torque of the whole line as far as its rods do not carry it: N m, given; rad/(N m), by which it follows from the turn of
# the ends against each other, infinite where it does not; rad, that turn without torque; rad, that turn, counted on.
GIVEN, COMPLIANCE, FREE_TURN, TURN = range(4)
# What is found: which of two errors is now; nodes clipped in the last step; the node that was furthest in it; whether
# the error was finite.
CURRENT, CLIPPED, FURTHEST, FINITE = range(4)


def sampled_size(cells: int) -> int:
    """Numbers of what an output takes of the error: position and velocity with the spins (2, N+1, 4), tension (N),
    moments (N+1, 3), and what of it the two nodes at either end lack (4, 3)."""
    return 12 * cells + 23


class ErrorArrays(NamedTuple):
    """What `advance_error` writes beside the error of the nodes."""

    found: NDArray[np.int64]  # (4,) as named above
    torque: Floats  # (4,) likewise
    sampled: Floats  # (2, sampled_size(N)) after the step and before it
    slid: Floats  # (N+1, 3) m, error of friction's travel, before and after
    x: Floats  # (N+1, 5)
    dM: Floats  # (N+1, 3) N m
    M: Floats  # (N+1, 3) N m
    chords: Floats  # (N, 5) as of `tabulate_chords`
    turned: Floats  # (N, 5) as of `turn_chords`
    b: Floats  # (N+1, 5), right-hand side
    work: Floats  # (4, N+1, 4)
    powers: Floats  # (REPORT_SIZE,)


class History(NamedTuple):
    """What the error before the step adds to its end."""

    y: Floats  # (N+1, 4) m/s
    z: Floats  # (N+1, 4) m/s2
    ahead: Floats  # (N+1, 4) m, the error as predicted
    old: Floats  # (N+1, 4) m, the error before the step
    slid: Floats  # (N+1, 3) m, error of friction's travel before the step
    travel: Floats  # (N+1, 4) filled here: direction in which a node slides, zero where it sticks; travel kept, a part
    powers: Floats  # (REPORT_SIZE,) what the forces report on the way, which is not read


@inner
def seabed_rates(line, sea, i, state, u, history):
    """What history adds to the force of the seabed on node i, and contact at r + e to its linearisation there."""
    v, e, y, ahead, out = state.v, state.e, history.y, history.ahead, history.travel
    x = get3(state.r, i)
    n, p = bed_under(sea, x)
    pd = -dot(n, get3(v, i))
    N = more = 0.0
    yi, q = -dot(n, get3(y, i)), -dot(n, get3(ahead, i))
    k, c, o = sea.stiffness, sea.damping, sea.onset
    for side in (-1, 1):
        j = i + side
        if 0 <= j <= line.h.shape[0]:
            cell = i - 1 if side < 0 else i
            if side < 0:
                m, po = bed_before(sea, n, p, x, get3(e, cell))
            else:
                m, po = bed_beside(sea, n, p, x, get3(e, cell))
            qo = -dot(m, get3(ahead, j))
            near = p > 0.0 or po > 0.0
            if near or p + q > 0.0 or po + qo > 0.0:
                vo = -dot(m, get3(v, j))
                f = f0 = f1 = g0 = g1 = 0.0
                if near:
                    f, f0, f1, g0, g1 = contact(p, po, pd, vo, line.h[cell], k, c, o)
                g, _, _, _, _ = contact(p + q, po + qo, pd, vo, line.h[cell], k, c, o)
                N += f
                more += g - f - f0 * q - f1 * qo + g0 * yi - g1 * dot(m, get3(y, j))
    if line.footing[i] > 0.0 and p > 0.0:
        f, f0, g0 = pressure(0.0, p, p, pd, pd, k, c, o)
        N += line.footing[i] * f
        more += line.footing[i] * g0 * yi
    F = scale(more, n)
    out[i, 0], out[i, 1], out[i, 2], out[i, 3] = 0.0, 0.0, 0.0, 0.0
    if line.bits & FRICTION and N > 0.0:
        w = dot(n, get3(u, i))
        t = (
            sea.slip[i, 0] + u[i, 0] - w * n[0],
            sea.slip[i, 1] + u[i, 1] - w * n[1],
            sea.slip[i, 2] + u[i, 2] - w * n[2],
        )
        along, across = left_of(line, sea, state.soil, i)
        along, across = along * sea.friction[0], across * sea.friction[1]
        _, g, D, part = friction(t, N, get3(sea.axis, i), n, along, across, sea.slip_length)
        # the travel differs by what it did before, and by what the error has moved since
        F = add(F, add(scale(more, g), mat_vec(D, sub(get3(history.slid, i), get3(history.old, i)))))
        size = math.sqrt(dot(t, t))
        if part < 1.0:
            out[i, 0], out[i, 1], out[i, 2] = scale(1.0 / size, t)
        out[i, 3] = part
    return F


@inner
def rates(line, sea, i, state, u, before, after, history):
    """Force that history adds on node i: d(force)/d(v) y + d(force)/d(vd) z, and the seabed's (`seabed_rates`).

    The derivative of the loads by position is affine in the weights of the march, D = K + cv C + ca M, so three of them
    give C y + M z = D(1, 0) y + D(0, 1) z - D(0, 0) (y + z).
    """
    yi, zi = get3(history.y, i), get3(history.z, i)
    v, vd, F = get3(state.v, i), get3(state.vd, i), Z3
    for k in range(3):
        unit, x = Rates(0.0, 0.0), scale(-1.0, add(yi, zi))
        if k == 1:
            unit, x = Rates(1.0, 0.0), yi
        elif k == 2:
            unit, x = Rates(0.0, 1.0), zi
        _, D, _, _ = inertia_and_water(line, sea, i, state.r[i, 2], v, vd, before, after, unit, history.powers)
        F = add(F, mat_vec(D, x))
    if line.bits & SEABED:
        F = add(F, seabed_rates(line, sea, i, state, u, history))
    return F


@inner
def damped_moment(line, i, n, before, after, y):
    """What history adds to the moment of a damped element, to first order in its bend."""
    a, b, along_a, along_b = Z3, Z3, 0.0, 0.0
    tau = line.tau[min(i, n - 1)]
    if i > 0:
        a = scale(before.il, cross(before.d, sub(get3(y, i), get3(y, i - 1))))
        along_a = y[i - 1, 3]
        tau = line.tau[i - 1] if i == n else 0.5 * (tau + line.tau[i - 1])
    if i < n:
        b = scale(after.il, cross(after.d, sub(get3(y, i + 1), get3(y, i))))
        along_b = y[i, 3]
    m = scale(0.5 * tau * (line.kb[i, 0] + line.kb[i, 1]), sub(b, a))
    return add(m, scale(tau * line.kb[i, 2], sub(scale(along_b, after.d), scale(along_a, before.d))))


@inner
def node_moment(line, M, i, n, damped, before, after, y):
    """M of node i and, in a damped element, what history adds to it."""
    m = get3(M, i)
    if damped and line.element[i]:
        m = add(m, damped_moment(line, i, n, before, after, y))
    return m


@inner
def cell_force(line, i, chord, Q, moving, history):
    """Force of cell i that balances the difference Q of the moments at its ends, and the right-hand side of its spin."""
    d, _, il = chord
    force = scale(il, cross(d, Q))
    spin = 0.0
    if line.spin[i]:
        spin = -dot(d, Q)
        if moving and line.bits & ROTARY:
            across = sub(get3(history.z, i + 1), get3(history.z, i))
            across = sub(across, scale(dot(d, across), d))
            force = add(force, scale(line.rotary[i] * il * il, across))
            spin += line.polar[i] * history.z[i, 3]
    return force, spin


@kernel
def right_hand_side(line, sea, ends, chords, state, u, M, moving, history, b):
    """The right-hand side b (N+1, 5) of J x = b; state: after the converged step, u its displacement.

    moving: whether there is a history; without one (statics) it is not read.
    """
    n = state.e.shape[0]
    y = history.y
    damped = moving and line.bits & STIFFNESS_DAMPING
    before, force_before = Chord(Z3, 0.0, 0.0), Z3
    chord = chord_of(chords, 0)
    m = node_moment(line, M, 0, n, damped, before, chord, y)
    gap = 0.0
    for i in range(n + 1):
        after, mn = Chord(Z3, 0.0, 0.0), Z3
        force, spin, next_gap = Z3, 0.0, 0.0
        if i < n:
            if i + 1 < n:
                after = chord_of(chords, i + 1)
            if damped and line.ck[i] > 0.0:
                next_gap = -line.tau[i] * dot(chord.d, sub(get3(y, i + 1), get3(y, i)))
            mn = node_moment(line, M, i + 1, n, damped, chord, after, y)
            force, spin = cell_force(line, i, chord, sub(mn, m), moving, history)
        F = sub(force, force_before)
        if moving:
            F = add(F, rates(line, sea, i, state, u, before, chord, history))
        if (i == 0 and ends.held[0]) or (i == n and ends.held[1]):
            F = Z3
        b[i, 0], b[i, 1], b[i, 2], b[i, 3], b[i, 4] = gap, -F[0], -F[1], -F[2], spin
        before, force_before, gap = chord, force, next_gap
        chord, m = after, mn


@inner
def predict_error(old, s, history):
    """Fill y, z and ahead of `history` from the error before the step."""
    dt, am, af, ga, be, cv, ca = s
    for i in range(old.shape[1]):
        for k in range(4):
            p, q, a, ad = old[0, i, k], old[1, i, k], old[2, i, k], old[3, i, k]
            rp = p + dt * q + dt * dt * (0.5 - be) * a
            history.y[i, k] = q + dt * (1.0 - ga) * a - cv * rp
            history.z[i, k] = (am * a - af * ad) / (1.0 - af) - ca * rp
            history.ahead[i, k] = p + dt * q + 0.5 * dt * dt * a


@inner
def carry_travel(sea, r, slid, travel, old, new, i):
    """The error of friction's travel at node i after the step."""
    q = add(get3(slid, i), sub(get3(new[0], i), get3(old[0], i)))
    normal, _ = bed_under(sea, get3(r, i))
    q = sub(q, scale(dot(normal, q), normal))
    slides = get3(travel, i)
    slid[i, 0], slid[i, 1], slid[i, 2] = scale(travel[i, 3], sub(q, scale(dot(slides, q), slides)))


@inner
def shortened(x, i, most):
    """Size of the error of node i, m, and the part of it that is kept: at most `most` m."""
    size = math.sqrt(x[i, 1] * x[i, 1] + x[i, 2] * x[i, 2] + x[i, 3] * x[i, 3])
    return size, most / size if size > most else 1.0


class ErrorJob(NamedTuple):
    """Arguments of `advance_error`."""

    line: Line
    sea: Sea
    ends: Ends
    bending: Bending
    even: State  # two states that take turns: the one after the step if counts[PARITY] is even
    odd: State  # else
    u: Floats  # (N+1, 3) m, displacement of the nodes in the step
    clock: Clock  # of the run (kernels.state.books); the last step is 0 s long for an equilibrium
    counts: Counts
    X: Floats  # of the march whose matrix was factored last
    W: Floats
    errors: Floats  # (2, 4, N+1, 4) error of r, v, a, vd, which take turns
    most: float  # m, beyond which an error is no longer one: it is clipped
    arrays: ErrorArrays


def blank_error_job() -> ErrorJob:
    """A job with the types that every one has."""
    state, bending = blank_state(1), Bending(np.zeros(2), np.zeros(2, np.int8), np.zeros(2, np.int8), np.zeros(1))
    clock, counts, none = Clock(), Counts(), np.zeros(1)
    return ErrorJob(
        blank_line(1), no_sea(1), no_ends(), bending, state, state, np.zeros((2, 3)), clock, counts, none, none,
        np.zeros((2, 4, 2, 4)), 1.0, error_arrays(1),
    )  # fmt: skip


def error_arrays(cells: int) -> ErrorArrays:
    """Those of a line of so many cells that has no error and carries no torque."""
    z, n = np.zeros, cells + 1
    return ErrorArrays(
        np.array([0, 0, -1, 1]), np.array([0.0, np.inf, 0.0, 0.0]), z((2, sampled_size(cells))), z((n, 3)), z((n, 5)),
        z((n, 3)), z((n, 3)), z((cells, 5)), z((cells, 5)), z((n, 5)), z((4, n, 4)), z(REPORT_SIZE),
    )  # fmt: skip


read = reader(blank_error_job())


@inner
def whole_torque(torque, line, ends, e, T):
    """Torque of the whole line as far as its rods do not carry it, N m; a turn of the ends is counted on."""
    if not torque[COMPLIANCE] < math.inf:
        return torque[GIVEN]
    turn = end_turn(e, ends.frame) - torque[TURN] + math.pi
    torque[TURN] += turn - 2.0 * math.pi * math.floor(turn / (2.0 * math.pi)) - math.pi
    return (torque[TURN] - torque[FREE_TURN] + twist_of_line(line, T)) / torque[COMPLIANCE]


@inner
def solve_error(job, state, old, history, s, moving):
    """Solve for the unknowns `x` of the error; whether they are finite."""
    line, ends, bending, arrays = job.line, job.ends, job.bending, job.arrays
    chords, dM, M, work = arrays.chords, arrays.dM, arrays.M, arrays.work
    torque = whole_torque(arrays.torque, line, ends, state.e, state.T)
    tabulate_chords(state.e, chords)
    neglected_moments(line, ends, bending, chords, chords, state.T, 0.0, work[0], dM, M)
    if torque != 0.0:
        turn_chords(chords, state.T, bending.floor, dM, arrays.turned)
        neglected_moments(line, ends, bending, chords, arrays.turned, state.T, torque, work[0], dM, M)
    if moving:
        predict_error(old, s, history)
    right_hand_side(line, job.sea, ends, chords, state, job.u, M, moving, history, arrays.b)
    if line.bits & PLANAR:
        return solve_again_planar(line.plane, job.X, arrays.b, arrays.x)
    return solve_again(job.X, job.W, arrays.b, arrays.x)


@inner
def put_error(job, state, old, new, history, s, dt, moving):
    """The error `new` after the step from its unknowns; how many nodes were clipped, and the node that was furthest."""
    arrays, x = job.arrays, job.arrays.x
    clipped, where, far = 0, -1, 0.0
    for i in range(x.shape[0]):
        size, part = shortened(x, i, job.most)
        if size > job.most:
            clipped += 1
        if size > far:
            far, where = size, i
        for k in range(4):
            xi = part * x[i, k + 1] if k < 3 else x[i, 4]
            new[0, i, k] = xi
            if moving:
                rp = old[0, i, k] + dt * old[1, i, k] + dt * dt * (0.5 - s.be) * old[2, i, k]
                new[1, i, k] = part * (s.cv * xi + history.y[i, k])
                new[2, i, k] = part * (xi - rp) / (s.be * dt * dt)
                new[3, i, k] = part * (s.ca * xi + history.z[i, k])
            else:
                new[1, i, k], new[2, i, k], new[3, i, k] = 0.0, 0.0, 0.0
        if moving and job.line.bits & FRICTION:
            carry_travel(job.sea, state.r, arrays.slid, history.travel, old, new, i)
    return clipped, where


@inner
def put_sampled(error, arrays):
    """What an output takes of the error now, and what it would have taken before."""
    row, before, n, at = arrays.sampled[0], arrays.sampled[1], error.shape[1], 0
    for j in range(row.shape[0]):
        before[j] = row[j]
    for m in range(2):
        for i in range(n):
            for k in range(4):
                row[at] = error[m, i, k]
                at += 1
    for c in range(1, n):
        row[at] = arrays.x[c, 0]
        at += 1
    for i in range(n):
        for k in range(3):
            row[at] = arrays.dM[i, k]
            at += 1
    for i in (0, 1, n - 2, n - 1):
        for k in range(3):
            row[at] = arrays.M[i, k]
            at += 1


@kernel
def advance_error(table):
    """The error at the end of a step from that before it; table: of an ErrorJob (kernels.machine.binding).

    Returns UNKNOWN_ERROR where it is not finite (it begins anew from nothing) or where nodes were clipped, else 0.
    """
    job = read(table)
    arrays, found, counts, clock = job.arrays, job.arrays.found, job.counts, job.clock
    state = job.even
    if counts.parity:
        state = job.odd
    old, new = job.errors[found[CURRENT]], job.errors[1 - found[CURRENT]]
    dt = clock.last_dt
    moving = dt > 0.0
    s = Scheme(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if moving:
        s = scheme(clock.last_rho, clock.step_before, clock.rho_before, dt)
    work = arrays.work
    history = History(work[0], work[1], work[2], old[0], arrays.slid, work[3], arrays.powers)
    found[FINITE], found[CLIPPED] = 1, 0
    if solve_error(job, state, old, history, s, moving):
        found[CLIPPED], found[FURTHEST] = put_error(job, state, old, new, history, s, dt, moving)
        found[CURRENT] = 1 - found[CURRENT]
    else:
        found[FINITE], found[FURTHEST] = 0, -1
        for i in range(old.shape[1]):
            for k in range(4):
                old[0, i, k], old[1, i, k], old[2, i, k], old[3, i, k] = 0.0, 0.0, 0.0, 0.0
            for k in range(5):
                arrays.x[i, k] = 0.0
            for k in range(3):
                arrays.slid[i, k] = 0.0
    put_sampled(job.errors[found[CURRENT]], arrays)
    return UNKNOWN_ERROR if found[CLIPPED] > 0 or found[FINITE] == 0 else 0
