"""What every obstacle does to every node: its pressure; where one moves, travel of friction, force, work and wrench."""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, mat_vec, scale, sub
from hybrid.kernels.laws.obstacles import (
    carry_obstacles,
    grip,
    half_cell,
    meets,
    reach_of,
    row3,
    row9,
    surface_velocity,
    swept,
    transposed,
    way_along,
    way_with,
)
from hybrid.kernels.laws.surfaces import Z3, gradient_of_normal, is_far, surface
from hybrid.kernels.machine.compile import inner, linked_kernel
from hybrid.kernels.state.report import (
    ANGLE,
    CONTACT_WORK,
    EACH,
    ENDED,
    FORCE,
    FRICTION,
    FRICTION_WORK,
    MU,
    OBSTACLE_WORK,
    OFFSET,
    ONSET_OF,
    RIDES,
    ROLLED,
    SEEN,
    SEEN_FORCE,
    SEEN_MOMENT,
    SEEN_TURN,
    SLIP,
    SWEEP,
    TRAVEL,
    TURNED,
)
from hybrid.kernels.state.state import ROWS, blank_state, in_sea, no_sea


@inner
def pressed(line, sea, k, i, x, state):
    """Force N of obstacle k on node i at x along its normal n, with how that bends: N, n, curvature."""
    reach = reach_of(sea, k, i, state.e)
    if is_far(sea, k, x, reach):
        return 0.0, Z3, (0.0, Z3, 0.0)
    d, n, curved = surface(sea, k, x)
    if d > reach:
        return 0.0, n, curved
    v, moves = state.v, line.moved.shape[0] > 0
    vi = get3(v, i)
    if moves:
        vi = sub(vi, surface_velocity(sea.carried, k, x))
    p, pd, N = 0.5 * sea.obstacles[k, ONSET_OF] - d, -dot(n, vi), 0.0
    if i > 0 and meets(line, sea, moves, k, i - 1):
        before = scale(-1.0, get3(state.e, i - 1))
        N += half_cell(line, sea, k, i - 1, x, p, pd, before, get3(v, i - 1), 0.0)[0]
    if i < line.h.shape[0] and meets(line, sea, moves, k, i):
        N += half_cell(line, sea, k, i, x, p, pd, get3(state.e, i), get3(v, i + 1), 0.0)[0]
    return N, n, curved


@linked_kernel(in_sea(blank_state(1), 0), 0.0)
def pressure_of_obstacles(line, sea, state, i):
    """Force per length (N/m) of all obstacles across node i, over its half cells."""
    x, F, length = get3(state.r, i), Z3, 0.0
    for k in range(sea.obstacles.shape[0]):
        N, n, _ = pressed(line, sea, k, i, x, state)
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
    rows = sea.obstacles
    for i in range(u.shape[0]):
        x = get3(state.r, i)
        for k in range(rows.shape[0]):
            N, n, curved = pressed(line, sea, k, i, x, state)
            f, q = scale(N, n), Z3
            if line.bits & FRICTION and rows[k, MU] > 0.0 and N > 0.0:
                t = way_along(sea.carried, k, row3(was, i, EACH * k), x, get3(u, i))
                rub, _, _, q = grip(t, n, gradient_of_normal(curved, n), N, rows[k, MU], rows[k, SLIP])
                f = add(f, rub)
            for j in range(3):
                now[i, EACH * k + TRAVEL + j], now[i, EACH * k + FORCE + j] = q[j], f[j]


@inner
def mean_force(old, new, i, at):
    """Mean over a step of a force in a row of State.grip."""
    a, b = row3(old.grip, i, at + FORCE), row3(new.grip, i, at + FORCE)
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


@inner
def normals_of_step(sea, k, x, u):
    """Normals of obstacle k where a node was before the step, and where it is, at x after the displacement u."""
    _, before, _ = surface(sea, k, swept(sea.carried, k, sub(x, u)))
    _, after, _ = surface(sea, k, x)
    return mat_vec(transposed(row9(sea.carried, k, SWEEP)), before), after


@linked_kernel(lambda: (no_sea(1), blank_state(1), blank_state(1), ROWS, np.zeros(1)))
def book_obstacles(sea, old, new, u, report):
    """Work of obstacles in a step: what they push by as they move, and along and across their normals beside that."""
    for i in range(u.shape[0]):
        for k in range(sea.obstacles.shape[0]):
            f0, f1 = row3(old.grip, i, EACH * k + FORCE), row3(new.grip, i, EACH * k + FORCE)
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
        f = row3(state.grip, i, EACH * k + FORCE)
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
        place = row3(sea.carried, k, ENDED)
        if sea.carried[k, RIDES] != 0.0:  # the middle of the shape
            place = add(place, mat_vec(row9(sea.carried, k, TURNED), row3(sea.carried, k, OFFSET)))
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
