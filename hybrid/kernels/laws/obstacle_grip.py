"""What obstacles do to nodes, and sheaves that lines turn.

Of every obstacle there is its pressure on every node; where one moves, travel of friction, force, work and wrench.

Sheaves turn freely about their axis: one more unknown of Newton's method each.

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

import numpy as np

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, mat_vec, matrix, scale, sub, vector
from hybrid.kernels.laws.obstacles import (
    carry_obstacles,
    grip,
    normal_force,
    swept,
    transposed,
    way_along,
    way_with,
)
from hybrid.kernels.laws.surfaces import Z3, gradient_of_normal, surface
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.state.report import (
    ALGORITHMIC,
    ANGLE,
    CONTACT_WORK,
    EACH,
    ENDED,
    FORCE,
    FREE,
    FRICTION,
    FRICTION_WORK,
    MU,
    OBSTACLE_WORK,
    OFFSET,
    RIDES,
    ROLLED,
    ROLLED_BEFORE,
    ROLLING,
    SEEN,
    SEEN_FORCE,
    SEEN_MOMENT,
    SEEN_TURN,
    SLIP,
    SPIN,
    STILL_AXIS,
    SWEEP,
    TRAVEL,
    TRUE,
    TURNED,
)
from hybrid.kernels.state.state import ROWS, blank_state, in_sea, no_sea

# --- obstacles ---------------------------------------------------------------------------------


@linked_kernel(in_sea(blank_state(1), 0), 0.0)
def pressure_of_obstacles(line, sea, state, i):
    """Force per length (N/m) of all obstacles across node i, over its half cells."""
    x, F, length, moves = get3(state.r, i), Z3, 0.0, line.moved.shape[0] > 0
    for k in range(sea.obstacles.shape[0]):
        N, _, n, _, _, _, _ = normal_force(line, sea, moves, k, i, x, state.v, state.e, 0.0)
        if N != 0.0:
            F = add(F, scale(N, n))
    if i > 0:
        length += 0.5 * line.h[i - 1]
    if i < line.h.shape[0]:
        length += 0.5 * line.h[i]
    return math.sqrt(dot(F, F)) / length


@linked_kernel(in_sea(ROWS, blank_state(1), ROWS, ROWS))
def grip_obstacles(line, sea, u, state, was, now):
    """Travel and force of every obstacle on every node of a state into `now`; was: those before the step, (N+1, 6 M).

    u: (N+1, 3) m, displacements of the nodes in the step.
    """
    rows, moves = sea.obstacles, line.moved.shape[0] > 0
    for i in range(u.shape[0]):
        x = get3(state.r, i)
        for k in range(rows.shape[0]):
            N, _, n, curved, _, _, _ = normal_force(line, sea, moves, k, i, x, state.v, state.e, 0.0)
            f, q = scale(N, n), Z3
            if line.bits & FRICTION and rows[k, MU] > 0.0 and N > 0.0:
                t = way_along(sea.carried, k, vector(was[i], EACH * k), x, get3(u, i))
                rub, _, _, q = grip(t, n, gradient_of_normal(curved, n), N, rows[k, MU], rows[k, SLIP])
                f = add(f, rub)
            for j in range(3):
                now[i, EACH * k + TRAVEL + j], now[i, EACH * k + FORCE + j] = q[j], f[j]


@inner
def mean_force(old, new, i, at):
    """Mean over a step of a force in a row of State.grip."""
    a, b = vector(old.grip[i], at + FORCE), vector(new.grip[i], at + FORCE)
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


@inner
def normals_of_step(sea, k, x, u):
    """Normals of obstacle k where a node was before the step, and where it is, at x after the displacement u."""
    _, before, _ = surface(sea, k, swept(sea.carried, k, sub(x, u)))
    _, after, _ = surface(sea, k, x)
    return mat_vec(transposed(matrix(sea.carried[k], SWEEP)), before), after


@linked_kernel(lambda: (no_sea(1), blank_state(1), blank_state(1), ROWS, np.zeros(1)))
def book_obstacles(sea, old, new, u, report):
    """Work of obstacles in a step: what they push by as they move, and along and across their normals beside that."""
    for i in range(u.shape[0]):
        for k in range(sea.obstacles.shape[0]):
            f0, f1 = vector(old.grip[i], EACH * k + FORCE), vector(new.grip[i], EACH * k + FORCE)
            if dot(f0, f0) + dot(f1, f1) == 0.0:
                continue
            x, ui = get3(new.r, i), get3(u, i)
            with_it = way_with(sea.carried, k, x, ui)
            against = sub(ui, with_it)
            n0, n1 = normals_of_step(sea, k, x, ui)
            along = 0.5 * (dot(n0, against) * dot(n0, f0) + dot(n1, against) * dot(n1, f1))
            report[OBSTACLE_WORK] += 0.5 * (dot(f0, with_it) + dot(f1, with_it))
            report[CONTACT_WORK] += along
            report[FRICTION_WORK] += 0.5 * (dot(f0, against) + dot(f1, against)) - along


@inner
def wrench_on(state, k, place):
    """Force (N) of the line on obstacle k, and moment (N m) about a place."""
    force, moment = Z3, Z3
    for i in range(state.r.shape[0]):
        f = vector(state.grip[i], EACH * k + FORCE)
        if f[0] != 0.0 or f[1] != 0.0 or f[2] != 0.0:
            force, moment = sub(force, f), sub(moment, cross(sub(get3(state.r, i), place), f))
    return force, moment


@linked_kernel(lambda: (no_sea(1), blank_state(1), blank_state(1), 0.0, 0.0, np.zeros(1), 0))
def sample_obstacles(sea, old, new, t, x, row, at):
    """Where obstacles are at t (s), the part x of the last step, and what the line does to them there, into a row."""
    for k in range(new.sheave.shape[0]):
        sea.carried[k, ROLLED] = x * new.sheave[k, ANGLE] + (1.0 - x) * old.sheave[k, ANGLE]
    carry_obstacles(t, t, sea)
    for k in range(new.sheave.shape[0]):
        sea.carried[k, ROLLED] = new.sheave[k, ANGLE]
    for k in range(sea.carried.shape[0]):
        place = vector(sea.carried[k], ENDED)
        if sea.carried[k, RIDES] != 0.0:  # the middle of the shape
            place = add(place, mat_vec(matrix(sea.carried[k], TURNED), vector(sea.carried[k], OFFSET)))
        force, moment = wrench_on(new, k, place)
        if x < 1.0:
            f, m = wrench_on(old, k, place)
            force = add(scale(x, force), scale(1.0 - x, f))
            moment = add(scale(x, moment), scale(1.0 - x, m))
        for j in range(3):
            row[at + j], row[at + SEEN_FORCE + j], row[at + SEEN_MOMENT + j] = place[j], force[j], moment[j]
        for j in range(9):
            row[at + SEEN_TURN + j] = sea.carried[k, TURNED + j]
        at += SEEN


# --- sheaves -----------------------------------------------------------------------------------


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
    axis, last = mat_vec(matrix(sea.carried[k], TURNED), vector(sea.carried[k], STILL_AXIS)), u.shape[0] - 1
    for i in range(last + 1):
        for j in range(5):
            b[i, j] = q[i, j] = 0.0
    for i in range(last + 1 if line.bits & FRICTION else 0):
        x = add(get3(r, i), get3(u, i))
        N, _, n, _, dN, before, after = normal_force(line, sea, True, k, i, x, state.v, state.e, cv)
        if N > 0.0:
            t = way_along(sea.carried, k, vector(sea.grip[i], EACH * k), x, get3(u, i))
            tau = cross(axis, sub(x, vector(sea.carried[k], ENDED)))
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
