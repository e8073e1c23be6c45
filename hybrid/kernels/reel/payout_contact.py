"""Contact with the seabed and with obstacles of a line that is paid out, where material flows past nodes.

The fairlead and the nodes that ride with it do not move as the material there does: in a step it goes by the length that
comes less along the line than they do.  Friction is against the way of the material (docs/theory.md, 19), and what it
takes beyond the way of the nodes the winch gives.  A cell that grows longer lies on what it touches with more material.
Where obstacles move each has a travel and a force of its own on every node, and friction of each is against that.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, dot, get3, mat_vec, scale, sub
from hybrid.kernels.laws.obstacle_grip import mean_force
from hybrid.kernels.laws.obstacle_motion import put_vector, row3, row9, transposed
from hybrid.kernels.laws.obstacles import normal_at, stored_along
from hybrid.kernels.laws.surfaces import surface
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.reel.paid_length import cell, changes_length, growing, length_that_came, node
from hybrid.kernels.state.obstacle_rows import EACH, FORCE, SWEEP, TRAVEL
from hybrid.kernels.state.report import FRICTION, TOUCHES


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
