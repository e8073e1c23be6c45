"""Sheaves that turn freely about their axis: one more unknown of Newton's method each.

    symbol   meaning                                                            unit
    phi, w   angle of a sheave, its rate                                        rad, 1/s
    I, c     inertia, damping of the bearing                                    kg m2, N m s
    tau      way of the surface at a node by phi, axis x arm                    m
    p        force of friction on a node by phi                                 N
    M        moment of the line about the axis, - sum of tau . f                N m

A step has I w' + c w = M at its end, in the scheme of the line.  With y what a correction of the line is without phi and
z what it is by phi (A z = -p), phi changes by - (g + p . y)/(p . z - sum of tau . p - I ca - c cv), g = M - I w' - c w.
That N changes with the line is left out of dM, which slows Newton's method where it does, and touches nothing else.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.algebra.rotations import add, cross, dot, get3, mat_vec, scale, sub
from hybrid.kernels.laws.obstacle_grip import pressed
from hybrid.kernels.laws.obstacle_motion import carry_obstacles, row3, row9, way_along
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.obstacle_rows import (
    ALGORITHMIC,
    ANGLE,
    BEARING,
    EACH,
    ENDED,
    FREE,
    INERTIA,
    MU,
    ROLL,
    ROLLED,
    ROLLED_BEFORE,
    ROLLING,
    SLIP,
    SPIN,
    STILL_AXIS,
    TRUE,
    TURNED,
)


@kernel
def predict_sheaves(line, sea, old, new, s):
    """The angles at the end of a step with the algorithmic accelerations kept, as those of spins."""
    dt, am, af, _, be, _, ca = s
    for k in range(line.moved.shape[0]):
        if line.moved[k] == FREE:
            w, wa = old.sheave[k, SPIN], old.sheave[k, ALGORITHMIC]
            new.sheave[k, ANGLE] = old.sheave[k, ANGLE] + dt * w + 0.5 * dt * dt * wa
            new.sheave[k, SPIN] = w + dt * wa
            new.sheave[k, TRUE] = (am * wa - af * old.sheave[k, TRUE]) / (1.0 - af) + ca * be * dt * dt * wa
            new.sheave[k, ALGORITHMIC] = wa
            sea.carried[k, ROLLED_BEFORE], sea.carried[k, ROLLED] = old.sheave[k, ANGLE], new.sheave[k, ANGLE]
            sea.carried[k, ROLLING] = new.sheave[k, SPIN]


@inner
def friction_by_turn(t, n, N, mu, sl, tau):
    """Friction on a node pressed by N after the way t, and how it changes with the angle."""
    q = sub(t, scale(dot(n, t), n))
    size = math.sqrt(dot(q, q))
    c = 1.0 / sl if size <= sl else 1.0 / size
    y = sub(tau, scale(dot(n, tau), n))
    if size > sl:
        d = scale(c, q)
        y = sub(y, scale(dot(d, y), d))
    return scale(-mu * c * N, q), scale(mu * c * N, y)


@inner
def moments(line, sea, r, u, state, k, b):
    """M of sheave k and its derivative by phi; b: (N+1, 5) gets - p."""
    moment = slope = 0.0
    axis = mat_vec(row9(sea.carried, k, TURNED), row3(sea.carried, k, STILL_AXIS))
    for i in range(u.shape[0]):
        for j in range(5):
            b[i, j] = 0.0
        x = add(get3(r, i), get3(u, i))
        N, n, _, _ = pressed(line, sea, k, i, x, state)
        if N > 0.0:
            t = way_along(sea.carried, k, row3(sea.grip, i, EACH * k), x, get3(u, i))
            tau = cross(axis, sub(x, row3(sea.carried, k, ENDED)))
            f, p = friction_by_turn(t, n, N, sea.obstacles[k, MU], sea.obstacles[k, SLIP], tau)
            moment -= dot(tau, f)
            slope -= dot(tau, p)
            b[i, 1], b[i, 2], b[i, 3] = -p[0], -p[1], -p[2]
    return moment, slope


@inner
def along(b, x):
    """p . x of a correction."""
    total = 0.0
    for i in range(b.shape[0]):
        total -= b[i, 1] * x[i, 1] + b[i, 2] * x[i, 2] + b[i, 3] * x[i, 3]
    return total


@kernel
def turn_with(line, sea, ends, r, state, work, cv, ca):
    """Put sheaves into a correction that was found without them; how far they turn is in carried[:, ROLL].

    r: (N+1, 3) m, before the step.  Each of several is corrected after those before it.
    """
    j, last = 0, work.x.shape[0] - 1
    for k in range(line.moved.shape[0]):
        if line.moved[k] != FREE:
            continue
        b, z = sea.rolling[2 * j], sea.rolling[2 * j + 1]
        j += 1
        moment, slope = moments(line, sea, r, work.u, state, k, b)
        for end in range(2):
            if ends.held[end]:
                for i in range(5):
                    b[end * last, i] = 0.0
        inertia, bearing = sea.carried[k, INERTIA], sea.carried[k, BEARING]
        left = moment - inertia * state.sheave[k, TRUE] - bearing * state.sheave[k, SPIN]
        solve_again(work.X, work.W, b, z)
        change = -(left + along(b, work.x)) / (along(b, z) + slope - inertia * ca - bearing * cv)
        sea.carried[k, ROLL] = change
        for i in range(z.shape[0]):
            for c in range(5):
                work.x[i, c] += change * z[i, c]


@kernel
def roll_on(line, sea, old, new, s, part):
    """Sheaves turn by the part of their correction that is made."""
    for k in range(line.moved.shape[0]):
        if line.moved[k] == FREE:
            change = part * sea.carried[k, ROLL]
            new.sheave[k, ANGLE] += change
            new.sheave[k, SPIN] += s.cv * change
            new.sheave[k, TRUE] += s.ca * change
            w, wa = old.sheave[k, SPIN], old.sheave[k, ALGORITHMIC]
            new.sheave[k, ALGORITHMIC] = (new.sheave[k, SPIN] - w - s.dt * (1.0 - s.ga) * wa) / (s.ga * s.dt)
            sea.carried[k, ROLLED], sea.carried[k, ROLLING] = new.sheave[k, ANGLE], new.sheave[k, SPIN]
    carry_obstacles(sea.now[0] - s.dt, sea.now[0], sea)
