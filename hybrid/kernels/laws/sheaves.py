"""Sheaves that turn freely about their axis: one more unknown of Newton's method each.

    symbol   meaning                                                            unit
    phi, w   angle of a sheave, its rate                                        rad, 1/s
    I, c     inertia, damping of the bearing                                    kg m2, N m s
    tau      way of the surface at a node by phi, axis x arm                    m
    p        force of friction on a node by phi                                 N
    M        moment of the line about the axis, - sum of tau . f                N m
    q        change of M by the places of nodes: p where what touches sticks,   N
             and what their pressure does to friction

A step has I w' + c w = M at its end, in the scheme of the line.  With y what a correction of the line is without phi and
z what it is by phi (A z = -p), phi changes by - (g + q . y)/(q . z + d), d = - sum of tau . p - I ca - c cv,
g = M - I w' - c w.  Of several sheaves each is put into corrections after those before it, which turn in its z; whatever else
is added to a correction (contact of the line with itself), each turns by - (g + q . x)/d with the whole of it, x.
How normals turn along the sheave is left out of q.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, mat_vec, scale, sub
from hybrid.kernels.laws.obstacles import normal_force, row3, row9, way_along
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.report import (
    ALGORITHMIC,
    ANGLE,
    EACH,
    ENDED,
    FREE,
    FRICTION,
    MU,
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
    """Friction on a node pressed by N after the way t, over N, and how it changes with the angle."""
    q = sub(t, scale(dot(n, t), n))
    size = math.sqrt(dot(q, q))
    c = 1.0 / sl if size <= sl else 1.0 / size
    y = sub(tau, scale(dot(n, tau), n))
    if size > sl:
        d = scale(c, q)
        y = sub(y, scale(dot(d, y), d))
    return scale(-mu * c, q), scale(mu * c * N, y)


@inner
def add_to_row(rows, i, part, x):
    """Add a part of a vector to the places in row i of (N+1, 5)."""
    for a in range(3):
        rows[i, 1 + a] += part * x[a]


@inner
def moments(line, sea, r, u, state, k, b, q, cv):
    """M of sheave k and its derivative by phi; b: (N+1, 5) gets - p, q: (N+1, 5) the derivative of M by the places."""
    moment = slope = 0.0
    axis, last = mat_vec(row9(sea.carried, k, TURNED), row3(sea.carried, k, STILL_AXIS)), u.shape[0] - 1
    for i in range(last + 1):
        for j in range(5):
            b[i, j] = q[i, j] = 0.0
    for i in range(last + 1 if line.bits & FRICTION else 0):
        x = add(get3(r, i), get3(u, i))
        N, _, n, _, dN, before, after = normal_force(line, sea, True, k, i, x, state.v, state.e, cv)
        if N > 0.0:
            t = way_along(sea.carried, k, row3(sea.grip, i, EACH * k), x, get3(u, i))
            tau = cross(axis, sub(x, row3(sea.carried, k, ENDED)))
            g, p = friction_by_turn(t, n, N, sea.obstacles[k, MU], sea.obstacles[k, SLIP], tau)
            by_force = -dot(tau, g)
            moment += by_force * N
            slope -= dot(tau, p)
            add_to_row(b, i, -1.0, p)
            add_to_row(q, i, 1.0, p)
            add_to_row(q, i, by_force, dN)
            if i > 0:
                add_to_row(q, i - 1, by_force, before)
            if i < last:
                add_to_row(q, i + 1, by_force, after)
    return moment, slope


@inner
def along(q, x):
    """Change of M by a correction x (N+1, 5)."""
    total = 0.0
    for i in range(q.shape[0]):
        total += q[i, 1] * x[i, 1] + q[i, 2] * x[i, 2] + q[i, 3] * x[i, 3]
    return total


@inner
def roll_sheave(sea, new, k, change, cv, ca):
    """Sheave k turns by a change, rad."""
    new.sheave[k, ANGLE] += change
    new.sheave[k, SPIN] += cv * change
    new.sheave[k, TRUE] += ca * change
    sea.carried[k, ROLLED], sea.carried[k, ROLLING] = new.sheave[k, ANGLE], new.sheave[k, SPIN]


@kernel
def find_rates_of_sheaves(old, new, s):
    """Algorithmic accelerations of sheaves at the end of a step."""
    for k in range(new.sheave.shape[0]):
        w, wa = old.sheave[k, SPIN], old.sheave[k, ALGORITHMIC]
        new.sheave[k, ALGORITHMIC] = (new.sheave[k, SPIN] - w - s.dt * (1.0 - s.ga) * wa) / (s.ga * s.dt)
