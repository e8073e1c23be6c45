"""Contact with the seabed and with obstacles of a line that is paid out, where material flows past nodes.

The fairlead and the nodes that ride with it do not move as the material there does: in a step it goes by the length that
comes less along the line than they do.  Friction is against the way of the material (docs/theory.md, 19), and what it
takes beyond the way of the nodes the winch gives.  A cell that grows longer lies on what it touches with more material.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import dot, get3, scale, sub
from hybrid.kernels.laws.obstacles import normal_at, stored_along
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.reel.paid_length import cell, changes_length, growing, node
from hybrid.kernels.reel.reel import LENGTH, LENGTH_BEFORE, SIDE
from hybrid.kernels.state.forces import FRICTION, TOUCHES


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
    return scale(reel.numbers[SIDE] / math.sqrt(dot(e, e)), e)


@inner
def length_that_came(reel):
    """Length, m, that has come out since the last step, up to the end of the try."""
    return reel.numbers[LENGTH] - reel.numbers[LENGTH_BEFORE]


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


@inner
def friction_of_flow(line, sea, old, new, reel):
    """Work, J, of friction on the material that has flown past nodes in an accepted step, beyond the way of the nodes."""
    more, done = length_that_came(reel), 0.0
    for k in range(growing(line, reel) + 1, line.h.shape[0] + 1):
        i = node(line, reel, k)
        f, g = get3(old.bed, i), get3(new.bed, i)
        f = (0.5 * (f[0] + g[0]), 0.5 * (f[1] + g[1]), 0.5 * (f[2] + g[2]))
        if f[0] == 0.0 and f[1] == 0.0 and f[2] == 0.0:
            continue
        n = normal_at(line, sea, get3(new.r, i), False)
        done -= more * dot(sub(f, scale(dot(f, n), n)), tangent(line, old, reel, k))
    return done


@inner
def contact_that_came(line, sea, old, new, reel):
    """Energy, J, of contact with the material by which cells have become longer in an accepted step."""
    came = 0.0
    for c in range(line.h.shape[0]):
        more = line.h[c] - reel.before[c, 0]
        if more != 0.0 and changes_length(line, reel, c):
            came += 0.5 * more * (stored_along(line, sea, old.r, c) + stored_along(line, sea, new.r, c))
    return came
