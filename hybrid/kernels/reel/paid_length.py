"""How long a line that is paid out is, and what its length makes.

Of the cells that its length changes (docs/theory.md, 19):

symbol  meaning                                                    unit
L       unstretched length that is out                             m
c       its rate, positive where line is paid out                  m/s
p       place of the last material node                            m

Places, nodes and cells count from the far end towards the fairlead; `node` and `cell` give their numbers in the line.

The forces that balance the nodes around one that has just entered a line at its winch, or left it.

The discrete line is in balance on cells of unequal lengths with places that lie on no smooth curve: where the lengths
of neighbours jump, so do second differences.  A node that is put on the curve through them, or left out, unbalances its
neighbours, which would send waves of bending along the line.  The forces across the line that are missing are put on
the nodes and taken off slowly (paid_length.eased), as the new cells get their lengths (docs/theory.md, 19).

Layers that slip of a line that is paid out: how far they have slipped goes with the material (docs/theory.md, 19).

    symbol   meaning                                                                             unit
    p        curvature to which a layer has slipped, on average over a volume (State.layers)     1/m
    volume   the material of an element, from the middle of the cell before it to that of the cell behind it

Volumes of nodes that ride, and the end of that of the last material node, move through the material.  p of one is the
mean over it of what the volumes of before had: constant there plus a limited slope, so that nothing is lost however far
they move.  Where a node enters or leaves they are divided otherwise.  Line comes off the reel straight, with p = 0, and
slips in the half cell at a clamp as that bends it; at a pin, over its half cell, p = 0.  What goes on the reel is
forgotten.  Nodes, cells and volumes count from the far end.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import add, dot, get3, scale, sub
from hybrid.kernels.laws.axial_law import has_law
from hybrid.kernels.laws.bending_law import (
    EACH,
    FROM,
    HALF_A,
    HALF_B,
    KEPT,
    LAST_A,
    LAST_B,
    MOMENT,
    MOST,
    STIFF,
    STIFFENING,
    STIFFNESS,
    bending_at,
    beside_spring,
    give_of_spring,
    layered,
    pull_at,
    slips,
)
from hybrid.kernels.laws.element import (
    Chord,
    Rates,
    chord,
    frames_at,
    moment_force,
    put_spring,
    rotary_force,
    strain_of_element,
    turning,
)
from hybrid.kernels.laws.node_forces import Z9, node_loads
from hybrid.kernels.laws.tension_torque import couples
from hybrid.kernels.laws.water import LIFT_A, LIFT_B, OFFSET
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.mesh.remesh import B_1, COLUMNS, fill_cell, fill_element, fill_node, move_line
from hybrid.kernels.reel.reel import LENGTH_OF, STRAIN_OF
from hybrid.kernels.state.report import BENDING_LAW, ROTARY, VORTICES
from hybrid.kernels.watch.extremes import moment_at


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


EDGE = 1e-12  # of a cell: a piece that ends so near to a node ends there, but for rounding


@inner
def made_between(pieces, begin, end, out, row):
    """The row of the material between two arc lengths: the mean of its pieces; of stiffness that of their compliances."""
    out[row, :COLUMNS] = 0.0
    for k in range(pieces.shape[0]):
        a = max(pieces[k, 0], begin) if k > 0 else begin
        z = min(pieces[k + 1, 0], end) if k + 1 < pieces.shape[0] else end
        if not z > a:
            continue
        part = (z - a) / (end - begin)
        if part < EDGE:
            continue
        part = 1.0 if part > 1.0 - EDGE else part
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
def piece_at(reel, s):
    """The piece of the material at an arc length."""
    place, k = reel.numbers.side * (s - reel.numbers.far), 0
    while k + 1 < reel.pieces.shape[0] and reel.pieces[k + 1, 0] <= place:
        k += 1
    return k


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
    """Node i between cells of rows a and b of `reel.made`; lengths: as of kernels.mesh.remesh.fill_node."""
    if reel.numbers.side < 0.0:  # in the order of the line, or sums of two products are rounded otherwise
        a, ha, b, hb = b, hb, a, ha
    fill_node(line, i, reel.made, a, ha, b, hb)
    if line.element[i]:
        fill_element(line, i, reel.made, a, ha, b, hb, line.kb[i, 2] == 0.0)
        if line.bits & BENDING_LAW:
            fill_table(line, i, 0.5 * (ha + hb))
    if line.bits & VORTICES:
        half = 0.5 * reel.numbers.lift
        line.wake_law[i, LIFT_A], line.wake_law[i, LIFT_B] = half * ha, half * hb


@inner
def fill_next(line, reel, k, a, before, b, begin, end):
    """Node k behind a cell of row a and length `before`, and cell k between two places, of row b; the length of this."""
    made, h, c = reel.made, end - begin, cell(line, reel, k)
    made_between(reel.pieces, begin, end, made, b)
    reel.true[k] = h
    line.s[node(line, reel, k + 1)] = reel.numbers.far + reel.numbers.side * end
    fill_between(line, reel, node(line, reel, k), a, before, b, h)
    ck = line.ck[c]
    fill_cell(line, c, made, b, h)
    if has_law(line, c):  # which is linearised anew in every iteration, and is one for all that is on the reel
        line.ck[c] = ck
    if couples(line) and line.tension_torque[c] != 0.0:
        line.tension_twist[c] = 0.5 * h * line.tension_torque[c] / made[b, B_1 + 2]
    return h


@inner
def complete(line, reel, nodes, first, last):
    """Cells from `first` on and before `last`, and their nodes, have all their material; nodes: (M,) m, places."""
    a, b, before = 0, 1, nodes[first] - nodes[first - 1]
    made_between(reel.pieces, nodes[first - 1], nodes[first], reel.made, a)
    for k in range(first, last):
        before = fill_next(line, reel, k, a, before, b, nodes[k], nodes[k + 1])
        line.h[cell(line, reel, k)] = before
        a, b = b, a


@inner
def fill_cells(line, reel):
    """Mass, loads and stiffness of the cell that grows, of those behind it and of their nodes, for the length that is out."""
    n, layer, made, a, b = line.h.shape[0], reel.layer, reel.made, 0, 1
    length, begin, g, before = reel.numbers.length, reel.numbers.place, n - reel.layer.shape[0], reel.rest_length[0]
    for j in range(COLUMNS):
        made[a, j] = reel.rest[0, j]
    for k in range(g, n):
        end = length - layer[k - g]
        before = fill_next(line, reel, k, a, before, b, begin, end)
        a, b, begin = b, a, end
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
    """Whether layers slip of a line that is paid out (kernels.reel.paid_length)."""
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
def remove_flow(line, reel):
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
def remove_riding(line, reel):
    """The line as it was before forces of nodes that ride and the flow of damping.

    To the last bit: what a step books goes by differences of these forces.
    """
    if reel.stage.riding_on > 0.0:
        if reel.flow.shape[0] > 0:
            remove_flow(line, reel)
        first = growing(line, reel) + 1
        for k in range(reel.layer.shape[0]):
            i = node(line, reel, first + k)
            for j in range(3):
                line.force[i, j] = reel.riding[k, 3 + j]
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
def remove_balance(line, reel):
    """The forces on the line without them, to the last bit; those on nodes that ride are off."""
    if reel.stage.balance_on > 0.0:
        for i in range(line.h.shape[0] + 1):
            for j in range(3):
                line.force[i, j] = reel.plain[i, j]
        reel.stage.balance_on = 0.0


@inner
def prepare(line, reel, t):
    """The line with the length of now at t."""
    remove_riding(line, reel)
    remove_balance(line, reel)
    fill_cells(line, reel)
    for k in range(growing(line, reel), line.h.shape[0]):
        line.h[cell(line, reel, k)] = reel.true[k]
    set_lengths(line, reel, t)


@inner
def line_as(line, out, reel, nodes):
    """The same line in another number of cells, its length still to be given to it; what comes is made as on the reel."""
    n, m, rides = line.h.shape[0], out.h.shape[0], reel.layer.shape[0]
    g, grows = n - rides, m - rides
    move_line(line, out, reel.numbers.side > 0.0, min(g, grows) + 1, m - n)
    complete(out, reel, nodes, g, grows)
    for k in range(grows, m + 1):
        i = node(out, reel, k)
        out.force[i, 0], out.force[i, 1] = 0.0, 0.0  # what rounding leaves of those on nodes that ride


@inner
def go_round(line, reel, first):
    """Phases of vortices (kernels.laws.water) go on along the line at its nodes from `first` on."""
    law, a, b = line.wake_law, node(line, reel, 0), node(line, reel, 1)
    rate = (law[b, OFFSET] - law[a, OFFSET]) / (line.s[b] - line.s[a])
    for k in range(first, line.h.shape[0] + 1):
        i = node(line, reel, k)
        law[i, OFFSET] = law[a, OFFSET] + rate * (line.s[i] - line.s[a])


@inner
def lie_wide(line, reel, widths, first):
    """Diameters, m, with which nodes from `first` on lie in soil: between those of their cells, of the pieces here."""
    n = line.h.shape[0]
    for k in range(first, n + 1):
        i, c = node(line, reel, k), cell(line, reel, k - 1)
        one, before, after = widths[piece_at(reel, 0.5 * (line.s[c] + line.s[c + 1]))], reel.true[k - 1], 0.0
        other = one
        if k < n:
            c, after = cell(line, reel, k), reel.true[k]
            other = widths[piece_at(reel, 0.5 * (line.s[c] + line.s[c + 1]))]
        line.bed_width[i] = one + after / (before + after) * (other - one)


# Nodes before the cell that grows, and behind it, whose elements and cells are others than before; one to spare.
AROUND = 3


@called
def moment_of(line, ends, state, j):
    """Moment at node j: of its element, or what acts on an end."""
    n = line.h.shape[0]
    if 0 < j < n:
        return moment_at(line, state, j)
    k = 0 if j == 0 else 1
    if not line.element[j]:
        return scale(2.0 * k - 1.0, get3(ends.moment, k))
    before, after = frames_at(line, ends, state, j)
    M, _ = bending_at(line, j, before, after, get3(line.kb, j), get3(line.k0, j))
    return M


@called
def force_in(line, ends, state, c):
    """Force in cell c."""
    d, _, il = chord(get3(state.e, c))
    f = scale(state.T[c], d)
    if line.element[c] or line.element[c + 1]:
        Q = sub(moment_of(line, ends, state, c + 1), moment_of(line, ends, state, c))
        if line.bits & ROTARY:
            e1 = sub(get3(state.v, c + 1), get3(state.v, c))
            e2 = sub(get3(state.vd, c + 1), get3(state.vd, c))
            d1, D1 = turning(d, il, e1, 0.0)
            Q = sub(Q, scale(line.polar[c] * state.w[c], d1))
            more, _ = rotary_force(d, il, e1, e2, d1, D1, line.rotary[c], 0.0, 0.0)
            f = add(f, more)
        V, _ = moment_force(d, il, Q, Z9)
        f = add(f, V)
    return f


@inner
def find_balance(line, sea, ends, state, reel):
    """The forces that balance the nodes around the cell that grows; those on nodes that ride are on."""
    n, g = line.h.shape[0], growing(line, reel)
    for i in range(n + 1):
        for j in range(3):
            reel.balance[i, j], reel.plain[i, j] = 0.0, 0.0
    for k in range(max(g - AROUND, 1), min(g + AROUND, n - 1) + 1):
        i = node(line, reel, k)
        da, la, ia = chord(get3(state.e, i - 1))
        db, lb, ib = chord(get3(state.e, i))
        before, after = Chord(da, la, ia), Chord(db, lb, ib)
        F, _, _, _ = node_loads(line, sea, i, state.r, reel.plain, state, before, after, Rates(0.0, 0.0), reel.report)
        F = add(F, sub(force_in(line, ends, state, i), force_in(line, ends, state, i - 1)))
        both = add(da, db)
        F = sub(F, scale(dot(F, both) / max(dot(both, both), 1e-300), both))  # tensions balance the rest
        for j in range(3):
            reel.balance[i, j] = -F[j]


# Columns of Reel.volumes: where a volume begins, m from the far end; p of all layers, then its slopes, 1/m2.
BEGINS, MEAN = 0, 1
# Volumes before the cell that grows whose p counts: that of the last but two nodes for a slope.
BEFORE = 2


@inner
def begins_at(line, reel, k):
    """Where volume k begins now; that behind the last node is on the reel."""
    n = line.h.shape[0]
    return place_of(line, reel, n) if k > n else 0.5 * (place_of(line, reel, k - 1) + place_of(line, reel, k))


@inner
def bend_of(line, ends, state, i):
    """Bend, rad, of the element at node i of the line, in two components; beside an angular spring of the half cell."""
    Ra, Rb = frames_at(line, ends, state, i)
    k = strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i), i)
    x, y = k[0] - line.k0[i, 0], k[1] - line.k0[i, 1]
    return beside_spring(line, i, x, y) if give_of_spring(line, i) > 0.0 else (x, y)


@inner
def stick(line, state, i):
    """Let the layers at node i bear what they have in a state, and not slip."""
    law, now, T = line.slip_law, line.slip_now, pull_at(state, i)
    for j in range(0, law.shape[1], EACH):
        if not layered(line, i, j):
            break
        for m in range(KEPT):
            now[i, j + FROM + m] = state.layers[i, j // EACH * KEPT + m]
        now[i, j + MOST] = math.inf if law[i, j + MOMENT] >= 0.0 else law[i, j + MOMENT]
        now[i, j + STIFF] = law[i, j + STIFFNESS] + law[i, j + STIFFENING] * T


# --- how it flows -----------------------------------------------------------------------------------


@inner
def limited(a, b, c, d):
    """The slope between two, (a, b) and (c, d), the same about any axis; none where they go against each other."""
    one, other = a * a + b * b, c * c + d * d
    if not a * c + b * d > 0.0:
        return 0.0, 0.0
    return (a * other + c * one) / (one + other), (b * other + d * one) / (one + other)


@called
def find_volumes(line, state, reel, back):
    """Where the volumes near the fairlead begin of a line that is shorter by `back`, m, and their p, into reel.volumes."""
    n, g, volumes, columns = line.h.shape[0], growing(line, reel), reel.volumes, state.layers.shape[1]
    first = max(g - BEFORE, 1)
    held = line.element[node(line, reel, n)] != 0
    for k in range(first, n + 2):
        volumes[k, BEGINS] = begins_at(line, reel, k)
        if k > g:
            volumes[k, BEGINS] -= back if k > g + 1 else 0.5 * back
        for j in range(columns):
            volumes[k, MEAN + j] = 0.0
            volumes[k, MEAN + columns + j] = 0.0
            if k < n or (k == n and held):
                volumes[k, MEAN + j] = state.layers[node(line, reel, k), j]
    last = n if held else n - 1
    end = volumes[n + 1, BEGINS]
    for k in range(first + 1, last + 1):
        middle = 0.5 * (volumes[k, BEGINS] + volumes[k + 1, BEGINS])
        before = middle - 0.5 * (volumes[k - 1, BEGINS] + volumes[k, BEGINS])
        after = end - middle if k == last else 0.5 * (volumes[k + 1, BEGINS] + volumes[k + 2, BEGINS]) - middle
        for j in range(MEAN, MEAN + columns, KEPT):
            a, b = volumes[k, j] - volumes[k - 1, j], volumes[k, j + 1] - volumes[k - 1, j + 1]
            a, b = a / before, b / before
            c, d = a, b
            if k < last or not held or back > 0.0:  # else what goes on the reel does not count
                other = n + 1 if k == last and held else k + 1
                c, d = (volumes[other, j] - volumes[k, j]) / after, (volumes[other, j + 1] - volumes[k, j + 1]) / after
            volumes[k, columns + j], volumes[k, columns + j + 1] = limited(a, b, c, d)


@called
def mean_between(reel, begin, end, first, j):
    """The mean of column j of p between two places, m, that lie in the volumes from `first` on."""
    volumes, last = reel.volumes, reel.volumes.shape[0] - 1
    columns, found = (volumes.shape[1] - MEAN) // 2, 0.0
    for k in range(first, last + 1):
        a, z = max(volumes[k, BEGINS], begin), end
        middle = volumes[k, BEGINS]
        if k < last:
            z, middle = min(volumes[k + 1, BEGINS], end), 0.5 * (volumes[k, BEGINS] + volumes[k + 1, BEGINS])
        if z > a:
            slope = volumes[k, MEAN + columns + j]
            found += (z - a) * (volumes[k, MEAN + j] + (0.5 * (a + z) - middle) * slope)
    return found / (end - begin)


@kernel
def let_layers_flow(line, before, reel):
    """By how much p of volumes is another at the end of a try because material flows through them, into line.slip_flow.

    before: the state at the start of the try.
    """
    n, g, more, columns = line.h.shape[0], growing(line, reel), length_that_came(reel), line.slip_flow.shape[1]
    if more != 0.0:
        find_volumes(line, before, reel, more)
    for k in range(g, n + 1):
        i = node(line, reel, k)
        for j in range(columns):
            line.slip_flow[i, j] = 0.0
            if more != 0.0 and line.element[i]:
                begin, end = begins_at(line, reel, k), begins_at(line, reel, k + 1)
                p = mean_between(reel, begin, end, max(g - BEFORE, 1), j)
                line.slip_flow[i, j] = p - before.layers[i, j]


@kernel
def stop_flow(line, reel):
    """Between steps nothing flows."""
    for k in range(growing(line, reel), line.h.shape[0] + 1):
        line.slip_flow[node(line, reel, k)] = 0.0


@kernel
def carry_layers(line, target, state, out, reel, new):
    """p on the volumes of a line (target) that a node has entered or left, near the fairlead; layers stick.

    state, reel: of the line before, whose layers stick too: its energy is that of the state, whoever looked at it last.
    """
    g, m, columns = growing(line, reel), target.h.shape[0], state.layers.shape[1]
    first = max(g - BEFORE, 1)
    find_volumes(line, state, reel, 0.0)
    for k in range(first + 1, m + 1):
        i = node(target, new, k)
        if target.element[i]:
            begin, end = begins_at(target, new, k), begins_at(target, new, k + 1)
            for j in range(columns):
                out.layers[i, j] = mean_between(reel, begin, end, first, j)
    for i in range(line.h.shape[0] + 1):
        stick(line, state, i)
    for i in range(m + 1):
        stick(target, out, i)


# --- energy -----------------------------------------------------------------------------------------


@called
def remember_bend(line, ends, state, reel):
    """The bend at a clamp that is the fairlead, for the books of the next step."""
    i = node(line, reel, line.h.shape[0])
    if line.element[i] and slips(line, i):
        stick(line, state, i)
        reel.bent[0], reel.bent[1] = bend_of(line, ends, state, i)


@inner
def length_of(reel, k):
    """Length, m, of volume k before the step."""
    return reel.volumes[k + 1, BEGINS] - reel.volumes[k, BEGINS]


@inner
def squared(x, y, h, p, q):
    """Length times the square of what a layer is bent by, 1/m, that has slipped to p, q, and h by x, y."""
    return h * ((x / h - p) ** 2 + (y / h - q) ** 2)


@inner
def bend_before(line, ends, old, reel, k):
    """Bend, rad, of the element at node k before a step, with the strain without stress of then."""
    i = node(line, reel, k)
    if k == line.h.shape[0]:
        return reel.bent[0], reel.bent[1]
    x, y = bend_of(line, ends, old, i)
    return x + line.k0[i, 0] - reel.before[i, 6], y + line.k0[i, 1] - reel.before[i, 7]


@kernel
def layers_that_came(line, ends, old, new, reel):
    """Energy, J, of layers that came in with material through an accepted step.

    As the stiffness of elements (kernels.reel.payout_work): what lengths and p that flow change of it at the bend
    before, and at that behind the step, on average.
    """
    n, g, law, came = line.h.shape[0], growing(line, reel), line.slip_law, 0.0
    if length_that_came(reel) == 0.0:
        return 0.0
    for k in range(g, n + 1):
        i = node(line, reel, k)
        if not (line.element[i] and slips(line, i)):
            continue
        h, was = begins_at(line, reel, k + 1) - begins_at(line, reel, k), length_of(reel, k)
        x, y = bend_before(line, ends, old, reel, k)
        u, v = bend_of(line, ends, new, i)
        dx, dy, T = line.k0[i, 0] - reel.before[i, 6], line.k0[i, 1] - reel.before[i, 7], pull_at(old, i)
        for j in range(0, law.shape[1], EACH):
            if not layered(line, i, j):
                break
            if law[i, j + MOMENT] < 0.0:
                continue
            at, K = j // EACH * KEPT, law[i, j + STIFFNESS] + law[i, j + STIFFENING] * T
            p, q, f, w = old.layers[i, at], old.layers[i, at + 1], line.slip_flow[i, at], line.slip_flow[i, at + 1]
            more = squared(x - dx, y - dy, h, p + f, q + w) - squared(x, y, was, p, q)
            p, q = new.layers[i, at], new.layers[i, at + 1]
            more += squared(u, v, h, p, q) - squared(u + dx, v + dy, was, p - f, q - w)
            came += 0.25 * K * more
    return came
