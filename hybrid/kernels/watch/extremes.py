"""Extremes over all accepted steps at every node, also where cells change.

They are of tension, curvature, moment, torque, contact force and displacement.  Where a quantity may have two values,
at point loads and changes of section, the one on the right has a column of its own (books.right).  They follow the
rules of the outputs (outputs.observation): tension of the middles of cells is interpolated to nodes, and taken on both
sides of point loads and changes of section; at the ends it is the pull of what holds them.  A catenary has the
curvature of the circle that two of its chords are tangents of; its ends, joints and marked nodes, where it may have a
kink, have what its inner nodes lead to.

Where cells change, those of nodes whose cells stay go on, all others are taken into those of the finest mesh.  Nodes
are those of arc length s, (N+1,) m, before a change and to_s, (M+1,) m, after it; rods, (N,) and to_rods, (M,) tell
which cells are rod.  Extremes are as in kernels.state.books, (4, rows, N+1+K), of K marked nodes behind all; unknown
ones are infinite, and change nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, frame, get3, get9, log_rotation, scale, sub
from hybrid.kernels.laws.bending_law import (
    RIGID,
    bending_at,
    curvature_under,
    damped_bending_at,
    give_of_spring,
    has_bend_law,
    parts_without_spring,
    slips,
)
from hybrid.kernels.laws.closed_forms import FADED, FARTHEST, at_hinge, depth_of, fade, left_of, stiffness_share
from hybrid.kernels.laws.element import chord, frames_at, relative_rotation, strain_of_element, turning
from hybrid.kernels.laws.obstacle_grip import pressure_of_obstacles
from hybrid.kernels.laws.seabed import bed_under, pressure
from hybrid.kernels.laws.soil import PRESSES
from hybrid.kernels.laws.tension_torque import rest_strain
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.resolution_checks import sharpest_in_plane, sharpest_in_space
from hybrid.kernels.march.zone_torque import FIRST, LAST
from hybrid.kernels.march.zone_torque import TORQUE as PASSED
from hybrid.kernels.state.books import (
    CURVATURE,
    DISPLACEMENT,
    MOMENT,
    OBSTACLE_PRESSURE,
    PRESSURE,
    SEAM,
    SELF_PRESSURE,
    TENSION,
    TORQUE,
)
from hybrid.kernels.state.report import FORCE_A, OBSTACLES, PLANAR, SEABED, SOIL, STIFFNESS_DAMPING
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch.soft_rods import BENT, Rods, bend_direction, of_chords, part_of_stiffness, restore_stiffness

SAME_PLACE = 1e-9  # part of a length


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
def beyond(T, h, near, far):
    """Tension where cell `near` ends, from the middles of two neighbours."""
    return T[near] + (T[near] - T[far]) * h[near] / (h[near] + h[far])


@inner
def beside(T, h, marks, i, side):
    """Tension at node i as the cells on its side (-1, 1) lead to, up to the next kink."""
    near = i - 1 if side < 0 else i
    far = near + side
    if not 0 <= far < h.shape[0] or marks[i + side]:
        far = near
    return beyond(T, h, near, far)


@inner
def second_cell(h, marks, k):
    """The cell from which, beside that at end k, values at the end are extrapolated: none across a kink."""
    n = h.shape[0]
    first = k * (n - 1)
    if n == 1 or marks[n - 1 if k else 1]:
        return first
    return first + 1 - 2 * k


@inner
def beyond_spring(t, d, line, ends, state, i):
    """Tangent of the line at a clamp with tangent t: between it and the chord d, if an angular spring at node i turns."""
    cosine = min(max(dot(t, d), -1.0), 1.0)
    angle = math.acos(cosine)
    x, y = angle, 0.0
    if slips(line, i) and give_of_spring(line, i) > 0.0:
        Ra, Rb = frames_at(line, ends, state, i)
        k = strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i))
        x, y = k[0] - line.k0[i, 0], k[1] - line.k0[i, 1]
    part = parts_without_spring(line, i, x, y)[0]
    if part > RIGID or angle < 1e-6:
        return t
    return add(scale(math.sin(part * angle), t), scale(math.sin((1.0 - part) * angle), d))


@inner
def end_tension(line, ends, state, report, loaded, marks, k):
    """Tension at an end: the force of what holds or loads it along the tangent; beside a body, that of the cable."""
    n = line.h.shape[0]
    first, second = k * (n - 1), second_cell(line.h, marks, k)
    if loaded[k]:
        return beyond(state.T, line.h, first, second)
    d, _, _ = chord(get3(state.e, first))
    d2, _, _ = chord(get3(state.e, second))
    t = sub(scale(1.5, d), scale(0.5, d2))
    if line.element[k * n]:
        R = get9(ends.frame, k)
        t = beyond_spring((R[2], R[5], R[8]), d, line, ends, state, k * n)
    at = FORCE_A + 3 * k
    return (1.0 - 2.0 * k) * dot((report[at], report[at + 1], report[at + 2]), t) / math.sqrt(dot(t, t))


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
def note_tension(line, ends, state, books, t):
    T, h, n = state.T, line.h, line.h.shape[0]
    for k in range(2):
        widen_both(
            books.extremes,
            books.right,
            TENSION,
            k * n,
            end_tension(line, ends, state, books.report[0], books.loaded, books.marks, k),
            t,
        )
    for i in range(1, n):
        if books.marks[i]:
            widen(books.extremes, TENSION, i, beside(T, h, books.marks, i, -1), t)
            widen(books.extremes, TENSION, books.right[i], beside(T, h, books.marks, i, 1), t)
        else:
            widen_both(
                books.extremes, books.right, TENSION, i, (T[i - 1] * h[i] + T[i] * h[i - 1]) / (h[i - 1] + h[i]), t
            )


@inner
def is_smooth(line, marks, i):
    """Whether node i lies inside a catenary, away from loads and changes of section."""
    n = line.h.shape[0]
    return 0 < i < n and not line.element[i] and not line.spin[i - 1] and not line.spin[i] and not marks[i]


@inner
def towards(line, state, marks, i, side):
    """Curvature at what may be a kink, node i, as the nodes on its side (-1, 1) lead to."""
    x = 0.0
    if is_smooth(line, marks, i + side):
        x = of_chords(line, state.e, i + side)
        if is_smooth(line, marks, i + 2 * side) and is_smooth(line, marks, i + 3 * side):
            there = of_chords(line, state.e, i + 2 * side)
            far = abs(line.s[i + side] - line.s[i]) / abs(line.s[i + 2 * side] - line.s[i + side])
            x = max(0.0, x + far * (x - there))
    return x


@inner
def beside_kink(line, state, books, i, side):
    """Curvature of a catenary at what may be a kink, node i, on its side: at a joint that which goes on there."""
    n = line.h.shape[0]
    if 0 < i < n and line.spin[i] != line.spin[i - 1]:
        return books.strains[i, 0]
    if (i == 0 or i == n) and is_hinge(line, books, 0 if i == 0 else 1):
        return 0.0
    return abs(towards(line, state, books.marks, i, side) + books.strains[i, BENT])


@inner
def note_catenary(line, state, books, i, t):
    """Curvature at a node without element; at what may be a kink, on each side, as its neighbours lead to."""
    if is_smooth(line, books.marks, i):
        widen_both(books.extremes, books.right, CURVATURE, i, abs(books.strains[i, BENT]), t)
        return
    n = line.h.shape[0]
    for side in (-1, 1):
        cell = i - 1 if side < 0 else i
        if cell < 0 or cell == n or line.spin[cell]:
            continue
        x = beside_kink(line, state, books, i, side)
        widen(books.extremes, CURVATURE, i if side < 0 else books.right[i], x, t)


@inner
def with_layer(kappa, missing, along):
    """Curvature kappa with what a joint takes of it, in a direction of cosine `along` to it; negative: against it."""
    both = kappa + missing * along
    return math.copysign(math.sqrt(both * both + missing * missing * (1.0 - min(along * along, 1.0))), both)


@inner
def goes_on(line, marks, j, way):
    """Whether the rod goes on beyond node j, without a point load or another section."""
    return not marks[j] and line.spin[min(j, j + way)] != 0


@inner
def layer_part(line, state, j, way, EI):
    """f of the cell before node j of a rod; EI: N m2."""
    T, h = state.T[min(j, j - way)], line.h[min(j, j - way)]
    return fade(h * h * T / EI) if T > 0.0 and EI > 0.0 else 0.0


@inner
def stiffness_at(line, j):
    """EI, N m2, of the element at node j."""
    return line.kb[j, 0] * line.hn[j]


@inner
def is_hinge(line, books, k):
    """Whether the curvature of a rod would fade to nothing at end k, where a catenary of two cells or more ends."""
    n = line.h.shape[0]
    return (
        books.hinges[k, 0] > 0.0
        and n > 1
        and not line.spin[k * (n - 1)]
        and is_smooth(line, books.marks, 1 + k * (n - 2))
    )


@inner
def cut_layer_at_end(line, state, books, k):
    """Take from strains[:, BENT] of a catenary the layer in which the curvature of a rod fades at its end k.

    Where it may have a kink, at point loads, what is taken is there alone: the curvature follows from its neighbours.
    """
    n, EI, T, h = line.h.shape[0], books.hinges[k, 0], state.T, line.h
    way, j = 1 - 2 * k, 1 + k * (n - 2)
    end, direction = towards(line, state, books.marks, k * n, way), bend_direction(state.e, j)
    first, depth = T[k * (n - 1)], 0.0
    while 0 < j < n and T[min(j, j - way)] > 0.0 and not line.spin[min(j, j - way)] and first > 0.0:
        depth += depth_of(T[min(j, j - way)], EI, h[min(j, j - way)])
        part = left_of(depth, 0.5 * max(T[j - 1] + T[j], 0.0), first)
        if part <= FADED or line.spin[j - 1] != line.spin[j]:
            break
        if is_smooth(line, books.marks, j):
            along = dot(bend_direction(state.e, j), direction)
            books.strains[j, BENT] = with_layer(books.strains[j, BENT], -end * part, along)
        else:
            books.strains[j, BENT] = -end * part
        if not abs(line.s[j] - line.s[k * n]) < (1.0 - SAME_PLACE) * books.hinges[k, 1]:  # another stiffness
            break
        j += way


@inner
def put_layers_back(line, ends, state, books):
    """Enter curvature as outputs have it (outputs.strains) into strains[:, BENT].

    Of rods with what joints take of it, of catenaries without what fades at their ends.  At joints themselves that of
    the side of the catenary into strains[:, 0].
    """
    n, bent = line.h.shape[0], books.strains
    for i in range(n + 1):
        bent[i, BENT] = bent[i, 0] if line.element[i] else 0.0
        if is_smooth(line, books.marks, i):
            bent[i, BENT] = of_chords(line, state.e, i)
    for k in range(2):
        if is_hinge(line, books, k):
            cut_layer_at_end(line, state, books, k)
    for i in range(1, n):
        if line.spin[i] == line.spin[i - 1]:
            continue
        way = 1 if line.spin[i] else -1
        own, _, _ = at_rod_end(line, ends, state, books, i, way, 0.0)
        bent[i, 0], bent[i, BENT] = towards(line, state, books.marks, i, -way), own
        j, outer = i + way, i - way
        if not (0 < j < n and is_smooth(line, books.marks, outer) and goes_on(line, books.marks, j, way)):
            continue
        T, EI = state.T[min(j, i)], stiffness_at(line, j)
        direction, part = bend_direction(state.e, outer), layer_part(line, state, j, way, EI)
        before = stiffness_share(EI, T, line.hn[i], line.h[min(outer, i)])
        after = stiffness_share(EI, T, line.hn[i], line.h[min(j, i)])
        along = dot(bend_direction(state.e, j), direction)
        turned = dot(bend_direction(state.e, i), direction)
        there = at_hinge(of_chords(line, state.e, i), turned, of_chords(line, state.e, outer), before, after, part)
        bent[i, 0], bent[i, BENT] = abs(there), with_layer(own, there, along)
        for _ in range(FARTHEST):
            if part <= FADED:
                break
            along = dot(bend_direction(state.e, j), direction)
            bent[j, BENT] = with_layer(bent[j, BENT], there * part, along)
            j += way
            if not (0 < j < n and goes_on(line, books.marks, j, way)):
                break
            part *= layer_part(line, state, j, way, stiffness_at(line, j))


@inner
def cell_bend(line, ends, state, j):
    """Curvature of the element at node j, 1/m."""
    Ra, Rb = frames_at(line, ends, state, j)
    k = log_rotation(relative_rotation(Ra, Rb))
    return math.sqrt(k[0] * k[0] + k[1] * k[1]) / line.hn[j]


@inner
def at_rod_end(line, ends, state, books, i, side, passed):
    """Curvature, moment and torque at node i, where the rod on its side (-1, 1) ends without element."""
    n, cell = line.h.shape[0], i - 1 if side < 0 else i
    d, _, _ = chord(get3(state.e, cell))
    torque, moment = passed, 0.0
    if i == 0 or i == n:
        m = scale(-1.0 if i == 0 else 1.0, get3(ends.moment, 0 if i == 0 else 1))
        torque = dot(m, d)
        across = add(m, scale(-torque, d))
        moment = math.sqrt(dot(across, across))
    j, curvature = i + side, 0.0
    if line.element[j]:
        curvature = math.sqrt(line.k0[j, 0] ** 2 + line.k0[j, 1] ** 2) / line.hn[j]
        stiffness = min(line.kb[j, 0], line.kb[j, 1]) * line.hn[j]
        if slips(line, j):  # what a moment bends depends on the way
            curvature = cell_bend(line, ends, state, j)
        elif has_bend_law(line, j):
            curvature += curvature_under(line, j, -side, moment)
        elif stiffness > 0.0:
            curvature += moment / (stiffness / part_of_stiffness(line, j, books.hinges))
    return curvature, moment, torque


@inner
def note_rod_end(line, ends, state, books, i, passed, t):
    """Curvature, moment and torque where a rod has no element: those of the given moment.

    At a joint none but the torque `passed` of the zone beside it, N m.
    Where the rod is curved without load and a moment is given, the curvature is the largest that both can have.
    """
    n = line.h.shape[0]
    for side in (-1, 1):
        cell = i - 1 if side < 0 else i
        if cell < 0 or cell == n:
            continue
        if not line.spin[cell]:
            if books.right[i] != i:  # the catenary beside the rod has a value of its own there
                widen(books.extremes, MOMENT, i if side < 0 else books.right[i], 0.0, t)
                widen(books.extremes, TORQUE, i if side < 0 else books.right[i], passed, t)
            continue
        curvature, moment, torque = at_rod_end(line, ends, state, books, i, side, passed)
        if 0 < i < n:
            curvature = abs(books.strains[i, BENT])
        at = i if side < 0 else books.right[i]
        widen(books.extremes, CURVATURE, at, curvature, t)
        widen(books.extremes, MOMENT, at, moment, t)
        widen(books.extremes, TORQUE, at, torque, t)


@inner
def beside_seam(line, books, i, j):
    """Curvature at the element of node i, where sections meet, on the side of its neighbour j."""
    if slips(line, i):
        return books.strains[i, 0]
    if has_bend_law(line, i):
        return curvature_under(line, i, j - i, books.strains[i, 1])
    own = min(line.kb[i, 0], line.kb[i, 1]) * line.hn[i]
    stiffness = min(line.kb[j, 0], line.kb[j, 1]) * line.hn[j]
    x, bent, pieces = books.strains[i, 0], abs(books.strains[i, BENT]), books.hinges
    if bent != x:  # of a rod with all of its stiffness
        parts = part_of_stiffness(line, j, pieces) / part_of_stiffness(line, i, pieces) if line.element[j] else 1.0
        x = bent * (own / stiffness * parts if line.element[j] and stiffness > 0.0 else 1.0)
    elif line.element[j] and own > 0.0 and stiffness > 0.0:
        x = max(0.0, x + books.strains[i, 1] * (1.0 / stiffness - 1.0 / own))
    return x


@inner
def note_element(line, books, i, t):
    """Curvature, moment and torque at an element; where sections meet, the curvature of both: the moment is one.

    (Where the stiffness differs, and the cable is curved without load as well, the curvature of a side is the largest
    that this can be.)
    """
    curvature, moment = abs(books.strains[i, BENT]), books.strains[i, 1]
    widen_both(books.extremes, books.right, MOMENT, i, moment, t)
    widen_both(books.extremes, books.right, TORQUE, i, books.strains[i, 2], t)
    if not (books.marks[i] & SEAM):
        widen_both(books.extremes, books.right, CURVATURE, i, curvature, t)
        return
    for j in (i - 1, i + 1):
        widen(books.extremes, CURVATURE, i if j < i else books.right[i], beside_seam(line, books, i, j), t)


@inner
def first_strains(line, ends, state, books):
    """Strains of a state that no step has led to."""
    if line.bits & PLANAR:
        sharpest_in_plane(line, ends, state.e, state.T, state.a1, books.strains)
    else:
        sharpest_in_space(line, ends, state.e, state.T, state.a1, books.strains)


@inner
def node_pressure(sea, state, i):
    """Pressure of the bed at a node, N/m."""
    normal, p = bed_under(sea, get3(state.r, i))
    v = -dot(normal, get3(state.v, i))
    return pressure(0.0, p, p, v, v, sea.stiffness, sea.damping, sea.onset)[0]


@kernel
def note_contact(line, sea, state, books, t):
    """Force per length that the nodes bear, each over its half cells, as outputs have it."""
    n = line.h.shape[0]
    if line.bits & SOIL:
        for i in range(n + 1):
            widen_both(books.extremes, books.right, PRESSURE, i, state.soil[i, PRESSES], t)
        return
    here = node_pressure(sea, state, 0)
    force = length = 0.0  # of the half cell before the node
    for i in range(n + 1):
        after = 0.0
        if i < n:
            after = node_pressure(sea, state, i + 1)
            force += line.h[i] * (2.0 * here + after) / 6.0
            length += 0.5 * line.h[i]
        widen_both(books.extremes, books.right, PRESSURE, i, force / length, t)
        if i < n:
            force, length = line.h[i] * (here + 2.0 * after) / 6.0, 0.5 * line.h[i]
        here = after


@kernel  # once, for lines in a plane and in space, and for both places it is called from: 3 s less of compilation
def note_extremes(line, sea, ends, state, books, t):
    """Widen the extremes to the state at time t; books.strains: of its elements, books.report: of the state."""
    n = line.h.shape[0]
    note_tension(line, ends, state, books, t)
    put_layers_back(line, ends, state, books)
    restore_stiffness(line, ends, Rods(state.e, state.T, books.strains, books.hinges, books.marks))
    if line.bits & SEABED:
        note_contact(line, sea, state, books, t)
    zone, zones = 0, line.torsion.shape[0]
    for i in range(n + 1):
        passed = 0.0
        if zone < zones and i >= line.torsion[zone, FIRST]:
            passed = state.turn[zone, PASSED]
            zone += i >= line.torsion[zone, LAST]
        if line.element[i]:
            note_element(line, books, i, t)
        else:
            note_catenary(line, state, books, i, t)
            if line.spin[max(i - 1, 0)] or line.spin[min(i, n - 1)]:
                note_rod_end(line, ends, state, books, i, passed, t)
            else:
                widen_both(books.extremes, books.right, MOMENT, i, 0.0, t)
                widen_both(books.extremes, books.right, TORQUE, i, passed, t)
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


class Watched(NamedTuple):
    """Nodes with their extremes: s, rods and extremes as above; right: columns of what is after the nodes."""

    s: Floats
    rods: NDArray[np.bool_]
    right: NDArray[np.int64]
    extremes: Floats


@kernel
def pass_on(old, new, stays, places, bounds):
    """All of it, of `Watched` nodes whose arrays do not share memory; stays: (N+1,) room."""
    s, rods, right, now = old
    to_s, to_rods, to_right, out = new
    match_nodes(s, rods, to_s, to_rods, stays)
    fold_gone(s, now, right, stays, places, bounds)
    carry_extremes(stays, rods.shape[0], now.reshape(now.size), now.shape[2], to_right, to_rods.shape[0], out)
