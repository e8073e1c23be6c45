"""Energy and contact of material that is paid out.

Contact is with the seabed and with obstacles, where material flows past nodes.  The fairlead and the nodes that ride
with it do not move as the material there does: in a step it goes by the length that comes less along the line than they
do.  Friction is against the way of the material (docs/theory.md, 19), and what it takes beyond the way of the nodes the
winch gives.  A cell that grows longer lies on what it touches with more material.  Where obstacles move each has a
travel and a force of its own on every node, and friction of each is against that.

A step leaves the energy that comes in with material for the books of the next.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, dot, frame, get3, get9, log_rotation, mat_vec, scale, sub
from hybrid.kernels.laws.axial_law import has_law, stretch_work
from hybrid.kernels.laws.bending_law import energy_share, has_bend_law
from hybrid.kernels.laws.element import chord, relative_rotation
from hybrid.kernels.laws.obstacle_grip import mean_force
from hybrid.kernels.laws.obstacles import normal_at, put_vector, row3, row9, stored_along, transposed
from hybrid.kernels.laws.surfaces import surface
from hybrid.kernels.laws.tension_torque import couples, rest_strain
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.reel.damping import damped_stretch_work
from hybrid.kernels.reel.paid_length import cell, changes_length, eased, growing, length_that_came, node
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import EACH, FORCE, FRICTION, SWEEP, TOUCHES, TRAVEL


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
            at, way = EACH * m + TRAVEL, mat_vec(transposed(row9(sea.carried, m, SWEEP)), along)
            put_vector(sea.grip, i, at, sub(row3(before.grip, i, at), scale(more, way)))


@inner
def travel_between(force, of_force, travel, of_travel, i, k, part):
    """Travel of friction at a place between nodes i and k; that of the one that touches where the other does not.

    force, travel: tables with a row for each node, in which they stand from a column on.
    """
    a, z = row3(force, i, of_force), row3(force, k, of_force)
    one, other = dot(a, a) > 0.0, dot(z, z) > 0.0
    if one != other:
        return row3(travel, i if one else k, of_travel)
    return add(scale(1.0 - part, row3(travel, i, of_travel)), scale(part, row3(travel, k, of_travel)))


@inner
def put_travels(state, out, new, i, k, part):
    """Travels of friction of a node that has just entered, number `new` of `out`, between nodes i and k of `state`."""
    put_vector(out.slip, new, 0, travel_between(state.bed, 0, state.slip, 0, i, k, part))
    for at in range(0, state.grip.shape[1], EACH):
        found = travel_between(state.grip, at + FORCE, state.grip, at + TRAVEL, i, k, part)
        put_vector(out.grip, new, at + TRAVEL, found)


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
    n = line.h.shape[0]
    if i == 0 or i == n:
        c, held = min(i, n - 1), get9(ends.frame, 0 if i == 0 else 1)
        d, _, _ = chord(get3(state.e, c))
        beside = frame(get3(state.a1, c), d)
        return log_rotation(relative_rotation(held, beside) if i == 0 else relative_rotation(beside, held))
    da, _, _ = chord(get3(state.e, i - 1))
    db, _, _ = chord(get3(state.e, i))
    return log_rotation(relative_rotation(frame(get3(state.a1, i - 1), da), frame(get3(state.a1, i), db)))


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
