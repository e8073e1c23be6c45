"""Extremes over all accepted steps at every node, also where cells change.

They are of tension, curvature, moment, torque, contact force and displacement.  Where a quantity may have two values,
at point loads and changes of section, the one on the right has a column of its own (books.right).  They are those of
outputs (kernels.watch.sides): tension of the middles of cells is interpolated to nodes, and taken on both sides of
point loads and changes of section; at the ends it is the pull of what holds them.

Where cells change, those of nodes whose cells stay go on, all others are taken into those of the finest mesh.  Nodes
are those of arc length s, (N+1,) m, before a change and to_s, (M+1,) m, after it; rods, (N,) and to_rods, (M,) tell
which cells are rod.  Extremes are as in kernels.state.books, (4, rows, N+1+K), of K marked nodes behind all; unknown
ones are infinite, and change nothing.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import add, cross, dot, frame, get3, scale, sub
from hybrid.kernels.laws.bending_law import bending_at, damped_bending_at
from hybrid.kernels.laws.element import chord, turning
from hybrid.kernels.laws.obstacle_grip import pressure_of_obstacles
from hybrid.kernels.laws.seabed import PRESSES, bed_under, pressure
from hybrid.kernels.laws.tension_torque import rest_strain
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.march.resolution_checks import sharpest_in_plane, sharpest_in_space
from hybrid.kernels.state.books import (
    BENDS,
    CURVATURE,
    DISPLACEMENT,
    MOMENT,
    OBSTACLE_PRESSURE,
    PRESSURE,
    SEAM,
    SELF_PRESSURE,
    TENSION,
    TORQUE,
    blank_books,
)
from hybrid.kernels.state.report import OBSTACLES, PLANAR, SEABED, SOIL, STIFFNESS_DAMPING
from hybrid.kernels.state.state import blank_state, in_sea, no_ends
from hybrid.kernels.watch.sides import (
    BENT,
    Rods,
    beside,
    element_strain,
    end_tension,
    given_moment,
    is_smooth,
    passed_torque,
    put_layers,
    restore_stiffness,
    strain_on_side,
)


@kernel  # a call costs a nanosecond; inlined at thirty places it costs seconds of compilation
def widen(extremes, what, i, x, t):
    """Widen the range of a quantity in column i to x, found at time t."""
    if x < extremes[0, what, i]:
        extremes[0, what, i], extremes[2, what, i] = x, t
    if x > extremes[1, what, i]:
        extremes[1, what, i], extremes[3, what, i] = x, t


@kernel
def widen_both(extremes, right, what, i, x, t):
    """The same for a quantity that has one value at node i; right: columns of values just after nodes."""
    widen(extremes, what, i, x, t)
    if right[i] != i:
        widen(extremes, what, right[i], x, t)


@inner
def rate_of_cell(state, i):
    """Angular velocity (rad/s) of the frame of a cell."""
    d, _, il = chord(get3(state.e, i))
    d1, _ = turning(d, il, sub(get3(state.v, i + 1), get3(state.v, i)), 0.0)
    return add(cross(d, d1), scale(state.w[i], d))


@inner
def moment_at(line, state, i):
    """Moment (N m) of what is after an inner node on what is before it."""
    if not line.element[i]:
        return (0.0, 0.0, 0.0)
    before, _, _ = chord(get3(state.e, i - 1))
    after, _, _ = chord(get3(state.e, i))
    Ra, Rb = frame(get3(state.a1, i - 1), before), frame(get3(state.a1, i), after)
    kb, k0 = get3(line.kb, i), rest_strain(line, state.T, i)
    if line.bits & STIFFNESS_DAMPING:
        tau = 0.5 * (line.tau[i - 1] + line.tau[i])
        before, after = rate_of_cell(state, i - 1), rate_of_cell(state, i)
        m, _, _, _ = damped_bending_at(line, i, Ra, Rb, kb, k0, tau, before, after)
        return m
    m, _ = bending_at(line, i, Ra, Rb, kb, k0)
    return m


@inner
def tension_at(line, ends, state, books, i, side):
    """Tension at node i, on its side (-1, 1) where it has two."""
    T, h, n = state.T, line.h, line.h.shape[0]
    if i == 0 or i == n:
        return end_tension(line, ends, state, books.report[0], books.loaded, books.marks, 0 if i == 0 else 1)
    if not books.marks[i]:
        return (T[i - 1] * h[i] + T[i] * h[i - 1]) / (h[i - 1] + h[i])
    return beside(T, h, books.marks, i, side)


@inner
def has_one_value(line, books, i):
    """Whether what is before node i is what is after it: no point load, change of section or joint."""
    return books.right[i] == i and (line.element[i] or is_smooth(line, books.marks, i))


@inner
def load_on_side(line, ends, state, books, i, side, passed):
    """Moment and torque (N m) on a side of node i; passed: torque of a zone there."""
    if line.element[i]:
        return books.strains[i, 1], books.strains[i, 2]
    if not line.spin[min(i, i + side)]:
        return 0.0, passed
    m, d = given_moment(line, ends, i), chord(get3(state.e, min(i, i + side)))[0]
    torque = dot(m, d)
    across = sub(m, scale(torque, d))
    return math.sqrt(dot(across, across)), torque + passed


@inner
def curvature_at(line, ends, state, books, i, side):
    """Curvature, 1/m, on a side of node i: of most elements as it has been found."""
    if line.element[i] and not books.marks[i] & SEAM:
        return abs(books.strains[i, BENT])
    k = element_strain(line, ends, state, i)
    return abs(strain_on_side(line, ends, state, books, i, side, k, 0.0)[0])


@inner
def note_sides(line, ends, state, books, i, passed, t):
    """Tension, curvature, moment and torque at a node, on each side that has values of its own."""
    extremes, n, column = books.extremes, line.h.shape[0], books.right[i]
    one = has_one_value(line, books, i)
    for side in (-1, 1):
        if not 0 <= i + side <= n or (side > 0 and i > 0 and one):
            continue
        at = i if side < 0 else column
        moment, torque = load_on_side(line, ends, state, books, i, side, passed)
        widen(extremes, TENSION, at, tension_at(line, ends, state, books, i, side), t)
        widen(extremes, CURVATURE, at, curvature_at(line, ends, state, books, i, side), t)
        widen(extremes, MOMENT, at, moment, t)
        widen(extremes, TORQUE, at, torque, t)


@inner
def first_strains(line, ends, state, books):
    """Strains of a state that no step has led to."""
    if line.bits & PLANAR:
        sharpest_in_plane(line, ends, state.e, state.T, state.a1, books.strains)
    else:
        sharpest_in_space(line, ends, state.e, state.T, state.a1, books.strains)


@inner
def node_pressure(sea, state, i):
    """How deep a node lies below where contact begins, m, the rate of that, m/s, and the pressure of the bed there, N/m."""
    normal, p = bed_under(sea, get3(state.r, i))
    v = -dot(normal, get3(state.v, i))
    return p, v, pressure(0.0, p, p, v, v, sea.stiffness, sea.damping, sea.onset)[0]


@inner
def borne(h, i, before, here, after):
    """Force per length, N/m, that node i bears of pressures at the nodes before, here and after, over its half cells.

    It is what stands in the balance of the nodes, so that it has the weight of what lies still; the pressure itself
    swings about that by up to a quarter beside an anchor and at the touchdown, where cells are longer than sqrt(T/k),
    over which the bed takes up the line.
    """
    force = length = 0.0
    if i > 0:
        force, length = h[i - 1] * (before + 2.0 * here) / 6.0, 0.5 * h[i - 1]
    if i < h.shape[0]:
        force, length = force + h[i] * (2.0 * here + after) / 6.0, length + 0.5 * h[i]
    return force / length


@kernel
def note_contact(line, sea, state, books, t):
    """Force per length that the nodes bear."""
    n = line.h.shape[0]
    before, here = 0.0, node_pressure(sea, state, 0)[2]
    for i in range(n + 1):
        after = node_pressure(sea, state, i + 1)[2] if i < n else 0.0
        pressed = state.soil[i, PRESSES] if line.bits & SOIL else borne(line.h, i, before, here, after)
        widen_both(books.extremes, books.right, PRESSURE, i, pressed, t)
        before, here = here, after


@linked_kernel(in_sea(no_ends(), blank_state(1), blank_books(), 0.0))  # once for begin_line and for book_network_step
def note_extremes(line, sea, ends, state, books, t):
    """Widen the extremes to the state at time t; books.strains: of its elements, books.report: of the state."""
    put_layers(line, ends, state, books)
    restore_stiffness(line, ends, Rods(state.e, state.T, books.strains, books.hinges, books.marks))
    if line.bits & SEABED:
        note_contact(line, sea, state, books, t)
    zone = 0
    for i in range(line.h.shape[0] + 1):
        passed, zone = passed_torque(line, state.turn, i, zone)
        note_sides(line, ends, state, books, i, passed, t)
        books.strains[i, BENDS] = line.kb[i, 0]
        if books.touch.shape[1] > 0:
            widen_both(books.extremes, books.right, SELF_PRESSURE, i, books.touch[0, i], t)
        if line.bits & OBSTACLES:
            pressed = pressure_of_obstacles(line, sea, state, i)
            widen_both(books.extremes, books.right, OBSTACLE_PRESSURE, i, pressed, t)
        x = sub(get3(state.r, i), get3(books.start, i))
        widen_both(books.extremes, books.right, DISPLACEMENT, i, math.sqrt(dot(x, x)), t)


@inner
def cell_under(places, s, i, k):
    """Number of the last of `places` that place i of s belongs behind, from that k of the place before on."""
    last = places.size - 1
    while k < last and places[k + 1] <= s[i] and not (s[i] == places[k] and places[k + 1] == s[i]):
        k += 1
    if i > 0 and s[i] == s[i - 1] and k < last and places[k] == s[i] and places[k + 1] == s[i]:
        k += 1
    return k


@inner
def fold_cell(now, row, columns, near, per, s, first, end, out):
    """Take one row of extremes `now` at both ends of a cell into those at s[first:end], linear between them.

    columns: (2,) of the ends; near: m, where it begins; per: 1/m, of its length, zero where it has none.
    """
    a, b = columns
    for bound in range(2):
        x, y = now[bound, row, a], now[bound, row, b]
        for i in range(first, end):
            part = max((s[i] - near) * per, 0.0)
            value = (1.0 - part) * x + part * y
            if (value > out[bound, row, i]) if bound else (value < out[bound, row, i]):
                out[bound, row, i], out[2 + bound, row, i] = value, now[2 + bound, row, b if part > 0.5 else a]


@kernel
def fold_extremes(places, s, columns, now, out):
    """Take extremes `now` (4, rows, columns) at `places` (m) into those at s, `out` (4, rows, n): lowest, highest, times.

    places, s: m, not decreasing; two equal ones are the left and the right value there, in both.  columns: column of
    `now` of each place.  Rows in which something is not known yet are left out.
    """
    last, rows, known = places.size - 1, out.shape[1], 0
    for row in range(rows):
        finite = True
        for c in columns:
            finite &= np.isfinite(now[0, row, c]) and np.isfinite(now[1, row, c])
        known |= finite << row
    i = k = 0
    while i < s.size:
        k = cell_under(places, s, i, k)
        m, first, i = min(k + 1, last), i, i + 1
        while i < s.size and cell_under(places, s, i, k) == k:
            i += 1
        per = 1.0 / (places[m] - places[k]) if places[m] > places[k] else 0.0
        for row in range(rows):
            if known >> row & 1:
                fold_cell(now, row, (columns[k], columns[m]), places[k], per, s, first, i, out)


@inner
def match_nodes(s, rods, to_s, to_rods, stays):
    """Into `stays` (N+1,), the number of the new node that each old one becomes whose cells stay as they are; else -1."""
    n, i, before = rods.shape[0], 0, True
    for c in range(n):
        while to_s[i] < s[c]:
            i += 1
        same = to_s[i] == s[c] and to_s[i + 1] == s[c + 1] and to_rods[i] == rods[c]
        stays[c] = i if same and before else -1
        before = same
    stays[n] = to_rods.shape[0] if before else -1


@inner
def first_from(s, x, i):
    """Number of the first of s, which do not decrease, that is x at least, from number i on."""
    last = s.shape[0] - 1
    while i < last:
        middle = (i + last) // 2
        if s[middle] < x:
            i = middle + 1
        else:
            last = middle
    return i


@inner
def put_starts(s, places, start, out):
    """Positions from which displacements of nodes s count into `out`, of rows `start` at `places`, some of which they are."""
    at = 0
    for i in range(s.shape[0]):
        at = first_from(places, s[i], at)
        for j in range(3):
            out[i, j] = start[at, j]


@inner
def fold_node(now, column, i, out):
    """Take a column of extremes `now` into those of place i."""
    for row in range(now.shape[1]):
        if now[0, row, column] < out[0, row, i]:
            out[0, row, i], out[2, row, i] = now[0, row, column], now[2, row, column]
        if now[1, row, column] > out[1, row, i]:
            out[1, row, i], out[3, row, i] = now[1, row, column], now[3, row, column]


@inner
def fold_gone(s, now, right, stays, places, bounds):
    """Take extremes `now` of nodes that do not stay, and of the cells beside them, into `bounds` (4, rows, E) at `places`.

    Cells that stay are interpolated once: when they go, or at the end.
    """
    n, at = s.shape[0] - 1, 0
    for i in range(n + 1):
        gone = stays[i] < 0
        if not gone and (i == n or stays[i + 1] >= 0):
            continue
        at = first_from(places, s[i], at)
        begin = at + (2 if right[i] != i else 1)
        if gone:
            fold_node(now, i, at, bounds)
            if right[i] != i:
                fold_node(now, right[i], at + 1, bounds)
        if i < n:
            end = first_from(places, s[i + 1], begin)
            a, per = right[i], 1.0 / (s[i + 1] - s[i])
            for row in range(now.shape[1]):
                if math.isfinite(now[0, row, a]) and math.isfinite(now[0, row, i + 1]):
                    fold_cell(now, row, (a, i + 1), s[i], per, places, begin, end, bounds)


@inner
def carry_column(old, columns, column, to, out):
    """Extremes of a node that stays, from `old`, all numbers of extremes of so many columns."""
    for bound in range(out.shape[0]):
        for row in range(out.shape[1]):
            out[bound, row, to] = old[(bound * out.shape[1] + row) * columns + column]


@inner
def carry_extremes(stays, cells, old, columns, right, to_cells, out):
    """Extremes of all nodes that stay into `out`; right: columns after the new nodes; cells, to_cells: how many."""
    for i in range(cells + 1):
        k = stays[i]
        if k >= 0:
            carry_column(old, columns, i, k, out)
            if right[k] != k:  # marked ones have a second column behind those of all nodes, in their order
                carry_column(old, columns, cells + right[k] - to_cells, right[k], out)
