"""How long a line that is paid out is, and what its length makes of the cells that it changes (docs/theory.md, 19).

symbol  meaning                                                    unit
L       unstretched length that is out                             m
c       its rate, positive where line is paid out                  m/s
p       place of the last material node                            m

Places, nodes and cells count from the far end towards the fairlead; `node` and `cell` give their numbers in the line.
"""

from __future__ import annotations

import numpy as np

from hybrid.kernels.laws.axial_law import has_law
from hybrid.kernels.laws.bending_law import HALF_A, HALF_B, LAST_A, LAST_B
from hybrid.kernels.laws.bending_slip import EACH, FROM, KEPT, give_of_spring, layered
from hybrid.kernels.laws.element import put_spring
from hybrid.kernels.laws.tension_torque import couples
from hybrid.kernels.laws.vortices import LIFT_A, LIFT_B
from hybrid.kernels.machine.compile import called, inner
from hybrid.kernels.mesh.fill_line import B_1, COLUMNS, fill_cell, fill_element, fill_node
from hybrid.kernels.reel.reel import (
    LENGTH_OF,
    STRAIN_OF,
)
from hybrid.kernels.state.report import BENDING_LAW, VORTICES


@inner
def length_at(law, t):
    """L, c and the rate of c at t, just before it where the latter jumps."""
    k = 0
    while k + 1 < law.shape[0] and law[k + 1, 0] < t:
        k += 1
    x = max(t - law[k, 0], 0.0)
    value, rate, twice = 0.0, 0.0, 0.0
    for j in range(1, 8):
        twice = twice * x + 2.0 * rate
        rate = rate * x + value
        value = value * x + law[k, j]
    return value, rate, twice


@inner
def made_between(pieces, begin, end, out, row):
    """The row of the material between two arc lengths: the mean of its pieces; of stiffness that of their compliances."""
    for j in range(COLUMNS):
        out[row, j] = 0.0
    for k in range(pieces.shape[0]):
        a = max(pieces[k, 0], begin) if k > 0 else begin
        z = min(pieces[k + 1, 0], end) if k + 1 < pieces.shape[0] else end
        if not z > a:
            continue
        part = (z - a) / (end - begin)
        for j in range(COLUMNS):
            x = pieces[k, 1 + j]
            if part == 1.0:
                out[row, j] = x
            elif B_1 <= j < B_1 + 3:
                out[row, j] += part / x
            else:
                out[row, j] += part * x
        if part == 1.0:
            return
    for j in range(B_1, B_1 + 3):
        out[row, j] = 1.0 / out[row, j]


@inner
def node(line, reel, i):
    """The number in the line of a node counted from the far end."""
    return i if reel.numbers.side > 0.0 else line.h.shape[0] - i


@inner
def cell(line, reel, c):
    """The number in the line of a cell counted from the far end."""
    return c if reel.numbers.side > 0.0 else line.h.shape[0] - 1 - c


@inner
def place_of(line, reel, i):
    """Place, m, of a node."""
    return reel.numbers.side * (line.s[node(line, reel, i)] - reel.numbers.far)


@inner
def length_that_came(reel):
    """Length, m, that has come out since the last step, up to the end of the try."""
    return reel.numbers.length - reel.numbers.length_before


@inner
def growing(line, reel):
    """The cell that grows; the nodes behind it ride with the fairlead."""
    return line.h.shape[0] - reel.layer.shape[0]


@inner
def changes_length(line, reel, c):
    """Whether the length of cell c of the line changes because line is paid out, and not because zones move."""
    k = cell(line, reel, c)  # and back
    return k >= growing(line, reel) or reel.since[k] > -np.inf


@inner
def fill_table(line, i, half):
    """The length, m, of the element at node i, if it has a table of moment: that of both halves, as on all of the reel."""
    if line.bend_law[i, LAST_A] > 0.0:
        line.bend_law[i, HALF_A] = half
    elif line.bend_law[i, LAST_B] > 0.0:
        line.bend_law[i, HALF_B] = half


@inner
def fill_between(line, reel, i, a, ha, b, hb):
    """Node i between cells of rows a and b of `reel.made`; lengths: as of kernels.mesh.fill_line.fill_node."""
    fill_node(line, i, reel.made, a, ha, b, hb)
    if line.element[i]:
        fill_element(line, i, reel.made, a, ha, b, hb, line.kb[i, 2] == 0.0)
        if line.bits & BENDING_LAW:
            fill_table(line, i, 0.5 * (ha + hb))
    if line.bits & VORTICES:
        before, after = (ha, hb) if reel.numbers.side > 0.0 else (hb, ha)
        half = 0.5 * reel.numbers.lift
        line.wake_law[i, LIFT_A], line.wake_law[i, LIFT_B] = half * before, half * after


@inner
def fill_cells(line, reel):
    """Mass, loads and stiffness of the cell that grows, of those behind it and of their nodes, for the length that is out."""
    n, layer, made, a, b = line.h.shape[0], reel.layer, reel.made, 0, 1
    length, begin, g, before = reel.numbers.length, reel.numbers.place, n - reel.layer.shape[0], reel.rest_length[0]
    for j in range(COLUMNS):
        made[a, j] = reel.rest[0, j]
    for k in range(g, n):
        end = length - layer[k - g]
        h, c, i = end - begin, cell(line, reel, k), node(line, reel, k)
        made_between(reel.pieces, begin, end, made, b)
        reel.true[k] = h
        line.s[node(line, reel, k + 1)] = reel.numbers.far + reel.numbers.side * end
        fill_between(line, reel, i, a, before, b, h)
        ck = line.ck[c]
        fill_cell(line, c, made, b, h)
        if has_law(line, c):  # which is linearised anew in every iteration, and is one for all that is on the reel
            line.ck[c] = ck
        if couples(line) and line.tension_torque[c] != 0.0:
            line.tension_twist[c] = 0.5 * h * line.tension_torque[c] / made[b, B_1 + 2]
        a, b, before, begin = b, a, h, end
    i = node(line, reel, n)
    fill_between(line, reel, i, a, before, b, 0.0)
    if line.element[i] and reel.numbers.spring < np.inf:
        put_spring(reel.numbers.spring, line, i)


@inner
def set_lengths(line, reel, t):
    """Lengths at t of cells that lacked something: on their way to their true ones, by a quintic that ends at rest."""
    for k in range(line.h.shape[0]):
        if reel.since[k] == -np.inf:
            continue
        c = cell(line, reel, k)
        line.h[c] = reel.true[k]
        x = (t - reel.since[k]) / reel.span[k]
        if x < 1.0:
            x = max(x, 0.0)
            value = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
            fading = x * (1.0 - x) ** 3 * (1.0 + 3.0 * x)
            line.h[c] -= reel.lack[k] * value + reel.span[k] * reel.rate[k] * fading


@inner
def lack_rate(reel, t, c):
    """Rate, m/s, at which what cell c lacks changes."""
    if reel.since[c] == -np.inf:
        return 0.0
    x = min(max((t - reel.since[c]) / reel.span[c], 0.0), 1.0)
    slope = -reel.lack[c] / reel.span[c] * 30.0 * x * x * (1.0 - x) ** 2
    return slope + reel.rate[c] * (1.0 - x) ** 2 * (1.0 + 2.0 * x - 15.0 * x * x)


@inner
def find_length(reel, t):
    """How long the line is at t, of what is prescribed, or of a winch before a step."""
    numbers, winch = reel.numbers, reel.winch
    if winch.tension > 0.0:
        numbers.length, numbers.rate, numbers.acceleration = winch.length_now, winch.rate_now, winch.true_now
    else:
        numbers.length, numbers.rate, numbers.acceleration = length_at(reel.law, t)


@inner
def flows(line):
    """Whether layers slip of a line that is paid out (kernels.reel.payout_layers)."""
    return line.slip_flow.shape[0] > 0


@called
def shift_layers(line, flow, i, sign):
    """The layers at node i, bent as without the flow of damping that is in its strain without stress: -1; 1: and back."""
    law, give, c = line.slip_law, give_of_spring(line, i), min(i, line.h.shape[0] - 1)
    for a in range(KEPT):
        more = sign * (line.k0[i, a] - flow[i, STRAIN_OF + a])
        more *= 2.0 * (1.0 - give * line.kb[i, a]) / flow[c, LENGTH_OF] if give > 0.0 else 1.0 / line.hn[i]
        for j in range(0, law.shape[1], EACH):
            if not layered(line, i, j):
                break
            line.slip_now[i, j + FROM + a] += more
            line.slip_flow[i, j // EACH * KEPT + a] += more


@inner
def take_flow_off(line, reel):
    """The line without it, to the last bit."""
    flow = reel.flow
    for i in range(line.h.shape[0]):
        line.h[i] = flow[i, LENGTH_OF]
    for k in range(growing(line, reel), line.h.shape[0] + 1):
        i = node(line, reel, k)
        if flows(line):
            shift_layers(line, flow, i, 1.0)
        for j in range(3):
            line.k0[i, j] = flow[i, STRAIN_OF + j]


@inner
def take_riding_off(line, reel):
    """The forces on the line without those by which nodes that ride have more; the line without the flow of damping."""
    if reel.stage.riding_on > 0.0:
        if reel.flow.shape[0] > 0:
            take_flow_off(line, reel)
        first = growing(line, reel) + 1
        for k in range(reel.layer.shape[0]):
            i = node(line, reel, first + k)
            for j in range(3):
                line.force[i, j] -= reel.riding[k, j]
        reel.stage.riding_on = 0.0


@inner
def eased(reel, t):
    """What part of the forces that balanced the neighbours of the last new node still acts at t: a quintic from 1 to 0."""
    if reel.numbers.changed == -np.inf:
        return 0.0
    x = min(max((t - reel.numbers.changed) / reel.numbers.easing, 0.0), 1.0)
    return 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


@inner
def put_balance_on(line, reel, t):
    """The forces on the line with those that balanced the neighbours of the last new node, as far as they act at t."""
    part = eased(reel, t)
    if part > 0.0:
        for i in range(line.h.shape[0] + 1):
            for j in range(3):
                reel.plain[i, j] = line.force[i, j]
                line.force[i, j] += part * reel.balance[i, j]
        reel.stage.balance_on = 1.0


@inner
def take_balance_off(line, reel):
    """The forces on the line without them, to the last bit; those on nodes that ride are off."""
    if reel.stage.balance_on > 0.0:
        for i in range(line.h.shape[0] + 1):
            for j in range(3):
                line.force[i, j] = reel.plain[i, j]
        reel.stage.balance_on = 0.0


@inner
def prepare(line, reel, t):
    """The line with the length of now at t."""
    take_riding_off(line, reel)
    take_balance_off(line, reel)
    fill_cells(line, reel)
    for k in range(growing(line, reel), line.h.shape[0]):
        line.h[cell(line, reel, k)] = reel.true[k]
    set_lengths(line, reel, t)
