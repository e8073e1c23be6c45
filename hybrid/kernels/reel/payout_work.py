"""Damping, energy and contact of material that is paid out (docs/theory.md, 19).

Damping is in proportion to stiffness.  The cell that grows at the fairlead, and those behind it that ride with it, hold
other material at every moment: not all of the rate of a chord is a rate of strain, nor all of the rate at which an
element turns one of curvature.  What is not (the flow) is taken off.  A cell that gets its length slowly
(kernels.reel.payout_nodes) stretches by less, likewise.

    symbol   meaning                                                              unit
    c        rate at which line comes, positive outwards                          m/s
    eps      strain of a cell without damping, l/h - 1                            -
    x        flow of a cell: rate of its chord at which no material stretches     m/s
    w        flow of an element: rate of its turn at which nothing bends          rad/s

A cell between two faces that material passes with c_a and c_b has x = c_b (1 + eps_b) - c_a (1 + eps_a), so that its
law of length is l + tau (dl/dt - x) = h (1 + ck T): that of a cell without flow, h + tau x/(1 + ck T) long.  An element
has w = c_b kappa_b - c_a kappa_a with the curvatures in the middles of its cells, as if it were bent by tau w without
stress.  What comes off the reel has the strain of the tension at the winch and no stress of bending.
Nodes, cells and chords count from the far end.

Contact is with the seabed and with obstacles, where material flows past nodes.  The fairlead and the nodes that ride
with it do not move as the material there does: in a step it goes by the length that comes less along the line than they
do.  Friction is against the way of the material (docs/theory.md, 19), and what it takes beyond the way of the nodes the
winch gives.  A cell that grows longer lies on what it touches with more material.  Where obstacles move each has a
travel and a force of its own on every node, and friction of each is against that.

A step leaves the energy that comes in with material for the books of the next.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    get3,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    mat_vec,
    matrix,
    put,
    scale,
    sub,
    vec_mat,
    vector,
)
from hybrid.kernels.laws.axial_law import has_law, stretch_work
from hybrid.kernels.laws.bending_law import energy_share, has_bend_law
from hybrid.kernels.laws.element import chord, frames_at, relative_rotation, turning
from hybrid.kernels.laws.obstacle_grip import mean_force
from hybrid.kernels.laws.obstacles import normal_at, stored_along, transposed
from hybrid.kernels.laws.surfaces import surface
from hybrid.kernels.laws.tension_torque import couples, rest_strain
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.mesh.remesh import COMPLIANCE
from hybrid.kernels.reel.paid_length import (
    cell,
    changes_length,
    eased,
    flows,
    growing,
    lack_rate,
    length_that_came,
    node,
    piece_at,
    shift_layers,
)
from hybrid.kernels.reel.reel import FLOW, LENGTH_OF, STRAIN_OF, TURN_FLOW
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import (
    EACH,
    FORCE,
    FORCE_A,
    FRICTION,
    MOMENT_A,
    NET_A,
    STIFFNESS_DAMPING_POWER,
    SWEEP,
    TOUCHES,
    TRAVEL,
)

# --- damping -----------------------------------------------------------------------------------

Z3 = (0.0, 0.0, 0.0)


# --- strain ---------------------------------------------------------------------------------------


@inner
def strain_at(line, state, i):
    """Strain of cell i of the line without damping."""
    _, l, _ = chord(get3(state.e, i))
    return (l - line.h[i]) / line.h[i]


@inner
def elastic_tension(line, state, i):
    """Tension, N, of cell i of the line without that of damping."""
    return strain_at(line, state, i) / line.ck[i] if line.ck[i] > 0.0 else state.T[i]


@inner
def strain_of_face(line, state, reel, j):
    """Strain of the material at node j, from the fairlead's neighbours on."""
    n = line.h.shape[0]
    c = min(j, n - 1)
    a, b = cell(line, reel, c - 1), cell(line, reel, c)
    part = line.h[a] / (line.h[a] + line.h[b])
    if j < n:
        T, U = elastic_tension(line, state, a), elastic_tension(line, state, b)
    else:
        part = 1.0 + line.h[b] / (line.h[a] + line.h[b])
        if reel.numbers.rate > 0.0:  # what comes bears the tension there
            T, U = state.T[a], state.T[b]
        else:
            T, U = elastic_tension(line, state, a), elastic_tension(line, state, b)
    c = reel.pieces[piece_at(reel, line.s[node(line, reel, j)]), 1 + COMPLIANCE]
    return c * (T + part * (U - T))


@inner
def flow_of_cell(line, state, reel, k, t):
    """x of cell k at t, m/s."""
    i, g, c = cell(line, reel, k), growing(line, reel), reel.numbers.rate
    if not line.ck[i] > 0.0:
        return 0.0
    x = -lack_rate(reel, t, k) * (1.0 + strain_at(line, state, i))
    if k >= g:
        x += c * (1.0 + strain_of_face(line, state, reel, k + 1))
    if k > g:
        x -= c * (1.0 + strain_of_face(line, state, reel, k))
    return x


# --- bend -----------------------------------------------------------------------------------------


@inner
def spin_beside(line, ends, state, i, side):
    """Angular velocity, rad/s, of the cell before (0) or after (1) node i of the line, or of the end there."""
    c = i - 1 + side
    if c < 0:
        return get3(ends.spin, 0)
    if c >= line.h.shape[0]:
        return get3(ends.spin, 1)
    d, _, il = chord(get3(state.e, c))
    d1, _ = turning(d, il, sub(get3(state.v, c + 1), get3(state.v, c)), 0.0)
    return add(cross(d, d1), scale(state.w[c], d))


@inner
def curvature_at(line, ends, state, reel, j):
    """Curvature, 1/m, and twist, rad/m, at node j, about the axes of the material; 0 where nothing bends."""
    i = node(line, reel, j)
    if not line.element[i]:
        return Z3
    a, b = frames_at(line, ends, state, i)
    return scale(1.0 / line.hn[i], log_rotation(relative_rotation(a, b)))


@inner
def flow_through_middle(line, ends, state, reel, k):
    """Speed of the middle of cell k against its material times the curvature there, rad/s.

    Beyond the last cell, that of the material at a clamp that is the fairlead.
    """
    n, g, c = line.h.shape[0], growing(line, reel), reel.numbers.rate
    if k < g:
        return Z3
    if k == n:
        last = curvature_at(line, ends, state, reel, n)
        if c > 0.0:
            i = node(line, reel, n)
            return scale(2.0 * c / line.h[cell(line, reel, n - 1)], get3(line.k0, i))
        return scale(c, add(last, scale(1.0 / 3.0, sub(last, curvature_at(line, ends, state, reel, n - 1)))))
    before, after = curvature_at(line, ends, state, reel, k), curvature_at(line, ends, state, reel, k + 1)
    # the half cell at a clamp has its curvature at a quarter of the cell
    part = 2.0 / 3.0 if k + 1 == n and line.element[node(line, reel, n)] else 0.5
    return scale(0.5 * c if k == g else c, add(before, scale(part, sub(after, before))))


@inner
def damping_time(line, i):
    """Damping time, s, of the element at node i of the line."""
    n = line.h.shape[0]
    return 0.5 * (line.tau[max(i - 1, 0)] + line.tau[min(i, n - 1)])


# --- on the line ---------------------------------------------------------------------------------


@inner
def put_flow_on(line, ends, state, reel, t):
    """The line with lengths and strains without stress that have the flow at t in them."""
    n, g, flow = line.h.shape[0], growing(line, reel), reel.flow
    for k in range(n):
        flow[cell(line, reel, k), FLOW] = flow_of_cell(line, state, reel, k, t)
    for k in range(n + 1):
        i, w = node(line, reel, k), Z3
        if k >= g and line.element[i]:
            before = flow_through_middle(line, ends, state, reel, k - 1)
            w = sub(flow_through_middle(line, ends, state, reel, k), before)
        for j in range(3):
            flow[i, STRAIN_OF + j], flow[i, TURN_FLOW + j] = line.k0[i, j], w[j]
    for i in range(n):
        flow[i, LENGTH_OF] = line.h[i]
        if flow[i, FLOW] != 0.0:
            line.h[i] += line.tau[i] * flow[i, FLOW] / (1.0 + line.ck[i] * state.T[i])
    for k in range(g, n + 1):
        i = node(line, reel, k)
        for j in range(3):
            line.k0[i, j] += damping_time(line, i) * flow[i, TURN_FLOW + j]
        if flows(line):
            shift_layers(line, flow, i, -1.0)


# --- energy ---------------------------------------------------------------------------------------


@inner
def rate_of_length(state, i):
    """Rate, m/s, of the length of the chord of cell i of the line."""
    d, _, _ = chord(get3(state.e, i))
    return dot(d, sub(get3(state.v, i + 1), get3(state.v, i)))


@inner
def rate_of_turn(line, ends, state, i):
    """Rate, rad/s, of the log strain of the element at node i of the line."""
    a, b = frames_at(line, ends, state, i)
    k = log_rotation(relative_rotation(a, b))
    g, _ = jacobian_functions(dot(k, k))
    between = sub(spin_beside(line, ends, state, i, 1), spin_beside(line, ends, state, i, 0))
    return mat_vec(inverse_left_jacobian(k, g), vec_mat(between, a))


@inner
def correct_damping_power(line, ends, state, reel, report, was_on):
    """The report of a line that has the flow on it and has just been assembled: what damping loses without the flow.

    was_on: whether it was on when the line was assembled.
    """
    n, flow = line.h.shape[0], reel.flow
    for i in range(n):
        x, h, ck = flow[i, FLOW], flow[i, LENGTH_OF], line.ck[i]
        if x != 0.0:
            rate, assembled = rate_of_length(state, i), line.h[i] if was_on else h
            report[STIFFNESS_DAMPING_POWER] += line.tau[i] / ck * ((rate - x) ** 2 / h - rate * rate / assembled)
    for k in range(growing(line, reel), n + 1):
        i = node(line, reel, k)
        if line.element[i]:
            rate, tau = rate_of_turn(line, ends, state, i), damping_time(line, i)
            for j in range(3):
                w = flow[i, TURN_FLOW + j]
                report[STIFFNESS_DAMPING_POWER] += tau * line.kb[i, j] * (w - 2.0 * rate[j]) * w


@inner
def moment_of_flow(line, ends, state, reel, i):
    """What the flow takes off the moment (N m) of the element at node i of the line."""
    if not line.element[i]:
        return Z3
    a, b = frames_at(line, ends, state, i)
    k, tau = log_rotation(relative_rotation(a, b)), damping_time(line, i)
    g, _ = jacobian_functions(dot(k, k))
    kb, w = get3(line.kb, i), (reel.flow[i, TURN_FLOW], reel.flow[i, TURN_FLOW + 1], reel.flow[i, TURN_FLOW + 2])
    less = (tau * kb[0] * w[0], tau * kb[1] * w[1], tau * kb[2] * w[2])
    return mat_vec(a, vec_mat(less, inverse_left_jacobian(k, g)))


@inner
def correct_end(line, ends, state, reel, report):
    """The report of a line that was assembled without the flow: force and moment at the fairlead."""
    n, k = line.h.shape[0], 1 if reel.numbers.side > 0.0 else 0
    d, _, il = chord(get3(state.e, k * (n - 1)))
    here, beside = (
        moment_of_flow(line, ends, state, reel, k * n),
        moment_of_flow(line, ends, state, reel, 1 + k * (n - 2)),
    )
    shear = scale(il, cross(d, sub(here, beside)))
    for j in range(3):
        report[NET_A + 3 * k + j] += shear[j]
        report[FORCE_A + 3 * k + j] += shear[j]
        report[MOMENT_A + 3 * k + j] -= here[j]


@inner
def power_of_flow(line, ends, state, reel):
    """Power, W, into the line by the moments and tensions of damping on the flow; the line is without it."""
    n, flow, into = line.h.shape[0], reel.flow, 0.0
    for i in range(n):
        x = flow[i, FLOW]
        if x != 0.0:
            into -= line.tau[i] / (line.h[i] * line.ck[i]) * (rate_of_length(state, i) - x) * x
    for k in range(growing(line, reel), n + 1):
        i = node(line, reel, k)
        if line.element[i]:
            rate, tau = rate_of_turn(line, ends, state, i), damping_time(line, i)
            for j in range(3):
                w = flow[i, TURN_FLOW + j]
                into -= tau * line.kb[i, j] * (rate[j] - w) * w
    return into


@inner
def damped_stretch_work(line, state, i, h):
    """Energy per length, N, that cell i of length h takes up as its unstretched length grows.

    Its ends stay; without that of the tension of damping, which is part of `power_of_flow`.
    """
    _, l, _ = chord(get3(state.e, i))
    if not line.ck[i] > 0.0:
        return state.T[i]
    strain = (l - h) / h
    return strain * (1.0 + 0.5 * strain) / line.ck[i]


# --- energy and contact ------------------------------------------------------------------------


@inner
def rubs(line):
    """Whether friction acts on the line where it lies on something."""
    return line.bits & TOUCHES != 0 and line.bits & FRICTION != 0


@inner
def tangent(line, state, reel, i):
    """Unit vector along the line at node i, of the cells beside it, towards the fairlead."""
    n = line.h.shape[0]
    e = get3(state.e, cell(line, reel, min(i, n - 1)))
    if 0 < i < n:
        x, y = e, get3(state.e, cell(line, reel, i - 1))
        a, b = math.sqrt(dot(x, x)), math.sqrt(dot(y, y))
        e = (x[0] / a + y[0] / b, x[1] / a + y[1] / b, x[2] / a + y[2] / b)
    return scale(reel.numbers.side / math.sqrt(dot(e, e)), e)


@inner
def let_material_rub(line, sea, before, reel):
    """The travel of friction that nodes which ride, and the fairlead, begin the try with: that of the material less.

    before: the state at the start of the try.
    """
    more = length_that_came(reel)
    for k in range(growing(line, reel) + 1, line.h.shape[0] + 1):
        i, along = node(line, reel, k), tangent(line, before, reel, k)
        for j in range(3):
            sea.slip[i, j] = before.slip[i, j] - more * along[j]
        for m in range(line.moved.shape[0]):  # with the obstacle, whose travels turn with it in the step
            at, way = EACH * m + TRAVEL, mat_vec(transposed(matrix(sea.carried[m], SWEEP)), along)
            put(sea.grip[i], at, sub(vector(before.grip[i], at), scale(more, way)))


@inner
def travel_between(force, of_force, travel, of_travel, i, k, part):
    """Travel of friction at a place between nodes i and k; that of the one that touches where the other does not.

    force, travel: tables with a row for each node, in which they stand from a column on.
    """
    a, z = vector(force[i], of_force), vector(force[k], of_force)
    one, other = dot(a, a) > 0.0, dot(z, z) > 0.0
    if one != other:
        return vector(travel[i if one else k], of_travel)
    return add(scale(1.0 - part, vector(travel[i], of_travel)), scale(part, vector(travel[k], of_travel)))


@inner
def put_travels(state, out, new, i, k, part):
    """Travels of friction of a node that has just entered, number `new` of `out`, between nodes i and k of `state`."""
    put(out.slip[new], 0, travel_between(state.bed, 0, state.slip, 0, i, k, part))
    for at in range(0, state.grip.shape[1], EACH):
        found = travel_between(state.grip, at + FORCE, state.grip, at + TRAVEL, i, k, part)
        put(out.grip[new], at + TRAVEL, found)


@inner
def friction_of_flow(line, sea, old, new, reel):
    """Work, J, of friction on the material that has flown past nodes in an accepted step, beyond the way of the nodes."""
    more, done = length_that_came(reel), 0.0
    for k in range(growing(line, reel) + 1, line.h.shape[0] + 1):
        i = node(line, reel, k)
        f, g, x = get3(old.bed, i), get3(new.bed, i), get3(new.r, i)
        f = (0.5 * (f[0] + g[0]), 0.5 * (f[1] + g[1]), 0.5 * (f[2] + g[2]))
        if f[0] == 0.0 and f[1] == 0.0 and f[2] == 0.0:
            continue
        rubbed, moves = (0.0, 0.0, 0.0), line.moved.shape[0] > 0
        for m in range(line.moved.shape[0]):
            g = mean_force(old, new, i, EACH * m)
            _, n, _ = surface(sea, m, x)
            rubbed, f = add(rubbed, sub(g, scale(dot(g, n), n))), sub(f, g)
        n = normal_at(line, sea, x, moves)  # where obstacles move what is left is the bed's
        rubbed = add(rubbed, sub(f, scale(dot(f, n), n)))
        done -= more * dot(rubbed, tangent(line, old, reel, k))
    return done


@inner
def contact_that_came(line, sea, old, new, reel):
    """Energy, J, of contact with the material by which cells have become longer in an accepted step."""
    came = 0.0
    for c in range(line.h.shape[0]):
        more = line.h[c] - reel.before[c, 0]
        if more != 0.0 and changes_length(line, reel, c):
            came += 0.5 * more * (stored_along(line, sea, old.r, c, True) + stored_along(line, sea, new.r, c, False))
    return came


@inner
def end_of(reel):
    """Which end of the line the fairlead is: 0 or 1."""
    return 1 if reel.numbers.side > 0.0 else 0


@inner
def turn_at(line, ends, state, i):
    """Turn, rad, of the element at node i: between its cells, at an end between its cell and what holds that."""
    Ra, Rb = frames_at(line, ends, state, i)
    return log_rotation(relative_rotation(Ra, Rb))


@inner
def bend_that_came(line, state, reel, turn, i, k):
    """Twice the energy, J, that changes of stiffness and strain without load add at node i.

    k: N m, change of stiffness; turn: rad, of the element; reel.before: of the line before.
    With x the strain now and d what it was more before:  (kb + k) x^2 - kb (x + d)^2 = k x^2 - kb (2 x + d) d.
    """
    before = reel.before[i]
    x, d = sub(turn, rest_strain(line, state.T, i)), sub(get3(line.k0, i), (before[6], before[7], before[8]))
    if couples(line):
        d = (d[0], d[1], d[2] - twist_that_came(line, reel, state.T, i))
    if has_bend_law(line, i):
        return bend_by_table_that_came(line, i, x, d, k, before)
    straight = before[3] * (2.0 * x[0] + d[0]) * d[0] + before[4] * (2.0 * x[1] + d[1]) * d[1]
    straight += before[5] * (2.0 * x[2] + d[2]) * d[2]
    return k[0] * x[0] * x[0] + k[1] * x[1] * x[1] + k[2] * x[2] * x[2] - straight


@inner
def twist_that_came(line, reel, T, i):
    """Twist, rad, of the element at node i by tensions T (N,) that longer cells beside it add."""
    more = 0.0
    for c in range(max(i - 1, 0), min(i + 1, line.h.shape[0])):
        if changes_length(line, reel, c):
            more += line.tension_twist[c] * (1.0 - reel.before[c, 0] / line.h[c]) * T[c]
    return more


@inner
def stretch_that_came(line, state, c):
    """Energy per length, N, that cell c takes up as it grows and its ends stay, but for the torsion beside it."""
    taken = stretch_work(line, state, c)
    if couples(line):
        taken += line.tension_twist[c] / line.h[c] * line.tension_torque[c] * state.T[c] * state.T[c]
    return taken


@inner
def bend_by_table_that_came(line, i, x, d, k, before):
    """The same of an element with a table, both halves of one: its share of the stiffness is one of the curvature alone."""
    y, one = (x[0] + d[0], x[1] + d[1], x[2] + d[2]), line.kb[i, 0] / before[3]
    now, then = math.sqrt(x[0] * x[0] + x[1] * x[1]), math.sqrt(y[0] * y[0] + y[1] * y[1])
    more = line.kb[i, 0] * now * now * energy_share(line, i, now)
    more -= before[3] * then * then * energy_share(line, i, then / one)
    return more + k[2] * x[2] * x[2] - before[5] * (2.0 * x[2] + d[2]) * d[2]


@inner
def remember(line, ends, state, reel):
    """Lengths, and mass, weight, stiffness and bend without load of the nodes that change, for the next step."""
    n, before = line.h.shape[0], reel.before
    for c in range(n):
        before[c, 0], before[c, 9] = line.h[c], line.ck[c]
    for j in range(growing(line, reel), n + 1):
        i = node(line, reel, j)
        before[i, 1], before[i, 2] = line.mass[i], line.force[i, 2]
        for k in range(3):
            before[i, 3 + k], before[i, 6 + k] = line.kb[i, k], line.k0[i, k]
    i = node(line, reel, n)
    if line.element[i]:
        reel.clamp[0], reel.clamp[1], reel.clamp[2] = turn_at(line, ends, state, i)
    reel.numbers.flux_before, reel.numbers.length_before = reel.numbers.flux, reel.numbers.length


@inner
def leave_to_reel(line, zones, reel):
    """Zones that move book nothing of lengths and stiffness that change because line is paid out."""
    for c in range(zones.lengths.shape[0]):
        if changes_length(line, reel, c):
            zones.lengths[c] = line.h[c]
    for j in range(growing(line, reel), zones.stiff.shape[0]):
        i = node(line, reel, j)
        for k in range(3):
            zones.stiff[i, k] = line.kb[i, k]


@inner
def book(line, ends, old, new, reel, dt):
    """Energy, J, that came in with material through an accepted step of dt, and with lengths that were not true."""
    n, before, numbers = line.h.shape[0], reel.before, reel.numbers
    booked = 0.5 * dt * (numbers.flux + numbers.flux_before)
    for c in range(n):
        more = line.h[c] - before[c, 0]
        if more != 0.0 and changes_length(line, reel, c):
            if reel.flow.shape[0] > 0:
                taken = damped_stretch_work(line, old, c, before[c, 0]) + damped_stretch_work(line, new, c, line.h[c])
            else:
                taken = stretch_that_came(line, old, c) + stretch_that_came(line, new, c)
            booked -= 0.5 * more * taken
        softer = line.ck[c] - before[c, 9]
        if softer != 0.0 and cell(line, reel, c) >= growing(line, reel) and not has_law(line, c):
            booked -= 0.25 * line.h[c] * softer * (old.T[c] * old.T[c] + new.T[c] * new.T[c])
    for j in range(growing(line, reel), n + 1):
        i = node(line, reel, j)
        va, vb = get3(old.v, i), get3(new.v, i)
        booked += 0.25 * (line.mass[i] - before[i, 1]) * (dot(va, va) + dot(vb, vb))
        booked -= 0.5 * (line.force[i, 2] - before[i, 2]) * (old.r[i, 2] + new.r[i, 2])
        if line.element[i]:
            more = (line.kb[i, 0] - before[i, 3], line.kb[i, 1] - before[i, 4], line.kb[i, 2] - before[i, 5])
            if more[0] != 0.0 or more[1] != 0.0 or more[2] != 0.0:
                was = (reel.clamp[0], reel.clamp[1], reel.clamp[2]) if j == n else turn_at(line, ends, old, i)
                done = bend_that_came(line, old, reel, was, i, more)
                booked += 0.25 * (done + bend_that_came(line, new, reel, turn_at(line, ends, new, i), i, more))
    return booked


@inner
def book_contact(line, sea, old, new, reel, work):
    """Work of contact through an accepted step that is of the material which came: friction on it, what it stores."""
    rubbed, stored = friction_of_flow(line, sea, old, new, reel), contact_that_came(line, sea, old, new, reel)
    work[0, b.FRICTION] += rubbed
    work[0, b.CONTACT] -= stored
    work[0, end_of(reel)] += stored - rubbed


@inner
def work_of_balance(old, new, reel, t, dt):
    """Work, J, through an accepted step of dt of the forces that balanced the neighbours of the last new node."""
    part, done = 0.5 * (eased(reel, t - dt) + eased(reel, t)), 0.0
    if part > 0.0:
        for i in range(reel.balance.shape[0]):
            done += dot(get3(reel.balance, i), sub(get3(new.r, i), get3(old.r, i)))
    return part * done
