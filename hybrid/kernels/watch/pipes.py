"""Wall tension and von Mises stress of pipes over all accepted steps, at every node: docs/theory.md, section on outputs.

Tension, curvature and torque are those of kernels.watch.extremes, pressures those of still water at the height of the node.

    symbol   meaning                                                     shape   unit
    F        tension in the wall                                         -       N
    po, pi   pressure outside and inside, over that of the air           -       Pa
    k0       curvature without load of the section, of which there is no stress  -       1/m
    m, w     mean and half difference of Lame's stresses: radial stress  -       Pa, N
             m - w/d^2, hoop stress m + w/d^2 at the diameter d
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import get3, log_rotation
from hybrid.kernels.laws.bending_law import curvature_under, has_bend_law, parts_without_spring
from hybrid.kernels.laws.bending_slip import slips
from hybrid.kernels.laws.element import frames_at, relative_rotation, strain_of_element
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.zone_torque import FIRST, LAST
from hybrid.kernels.march.zone_torque import TORQUE as PASSED
from hybrid.kernels.state.books import SEAM, VON_MISES, WALL_TENSION
from hybrid.kernels.watch.extremes import (
    BENT,
    at_rod_end,
    beside,
    beside_kink,
    beside_seam,
    end_tension,
    is_smooth,
    widen,
)

# Columns of `walls`: where the section ends, m; outer and inner diameter, m, Young's modulus, Pa, 0: no pipe; pressure
# inside, Pa, at the height PRESSURE_Z, m; specific weight of the content and of the water, N/m3; surface of the water, m;
# curvature without load, 1/m.
SECTION_END, OUTER, INNER, MODULUS, INSIDE, INSIDE_Z, CONTENT, WATER, SURFACE, NATURAL = range(10)
WALL = 10


@inner
def tension_at(line, ends, state, books, i, side):
    """Tension at node i, on its side (-1, 1) where it has two, as kernels.watch.extremes.note_tension has it."""
    T, h, n = state.T, line.h, line.h.shape[0]
    if i == 0 or i == n:
        return end_tension(line, ends, state, books.report[0], books.loaded, books.marks, 0 if i == 0 else 1)
    if not books.marks[i]:
        return (T[i - 1] * h[i] + T[i] * h[i - 1]) / (h[i - 1] + h[i])
    return beside(T, h, books.marks, i, side)


@inner
def bend_and_torque(line, ends, state, books, i, side, passed):
    """Curvature, 1/m, and torque, N m, at node i on its side; passed: N m, that a catenary there passes on."""
    n = line.h.shape[0]
    if line.element[i]:
        curvature = abs(books.strains[i, BENT])
        if books.marks[i] & SEAM:
            curvature = beside_seam(line, books, i, i + side)
        return curvature, books.strains[i, 2]
    if is_smooth(line, books.marks, i):
        return abs(books.strains[i, BENT]), passed
    if i == 0 or i == n:
        side = 1 if i == 0 else -1
    if line.spin[i - 1 if side < 0 else i]:
        curvature, _, torque = at_rod_end(line, ends, state, books, i, side, passed)
        return abs(books.strains[i, BENT]) if 0 < i < n else curvature, torque
    return beside_kink(line, state, books, i, side), passed


@inner
def bend_of_element(line, ends, state, i):
    """Curvature, 1/m, of the element at node i from what has no stress."""
    n = line.h.shape[0]
    Ra, Rb = frames_at(line, ends, state, i)
    k = strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i))
    x, y = k[0] - line.k0[i, 0], k[1] - line.k0[i, 1]
    bend = math.sqrt(x * x + y * y)
    if i == 0 or i == n:
        return parts_without_spring(line, i, x, y)[0] * bend / (0.5 * line.h[min(i, n - 1)])
    return bend / line.hn[i]


@inner
def bend_at_seam(line, ends, state, books, i, side):
    """The same of the element at node i, where sections meet, on its side: the moment is one."""
    j = i + side
    if has_bend_law(line, i):
        return curvature_under(line, i, side, books.strains[i, 1])
    if slips(line, i) or not (line.element[j] and line.kb[j, 0] > 0.0 and line.kb[j, 1] > 0.0):
        return bend_of_element(line, ends, state, i)
    Ra, Rb = frames_at(line, ends, state, i)
    k = log_rotation(relative_rotation(Ra, Rb))
    x = line.kb[i, 0] * (k[0] - line.k0[i, 0]) / line.kb[j, 0]
    y = line.kb[i, 1] * (k[1] - line.k0[i, 1]) / line.kb[j, 1]
    return math.sqrt(x * x + y * y) / line.hn[j]


@inner
def bend_and_torque_curved(line, ends, state, books, i, side, passed, natural):
    """As `bend_and_torque`, where a section is curved without load: from what has no stress.

    A catenary does not know which way its sections are curved: the most that both curvatures can make.
    """
    curvature, torque = bend_and_torque(line, ends, state, books, i, side, passed)
    if line.element[i] and abs(books.strains[i, BENT]) == books.strains[i, 0]:  # no joint takes of it
        if books.marks[i] & SEAM:
            return bend_at_seam(line, ends, state, books, i, side), torque
        return bend_of_element(line, ends, state, i), torque
    n = line.h.shape[0]
    if i == 0 or i == n:
        j = 1 if i == 0 else n - 1
        if line.spin[min(i, n - 1)] and line.element[j]:  # by the moment that is given there
            if slips(line, j):
                return bend_of_element(line, ends, state, j), torque
            return curvature - math.sqrt(line.k0[j, 0] ** 2 + line.k0[j, 1] ** 2) / line.hn[j], torque
    return curvature + natural, torque


@inner
def pressures(wall, z):
    """po and pi at a height; inside the pressure is never negative."""
    outside = wall[WATER] * max(wall[SURFACE] - z, 0.0)
    inside = max(wall[INSIDE] + wall[CONTENT] * (wall[INSIDE_Z] - z), 0.0) if wall[INNER] > 0.0 else 0.0
    return outside, inside


@inner
def largest_stress(wall, outside, inside, F, curvature, torque):
    """Largest von Mises stress, Pa: at both surfaces of the wall, on both sides of the bend."""
    o2, i2 = wall[OUTER] ** 2, wall[INNER] ** 2
    over = 1.0 / (o2 - i2)
    m, w = (inside * i2 - outside * o2) * over, (inside - outside) * o2 * i2 * over
    even, most = F * over * (4.0 / math.pi), 0.0
    for k in range(2):
        d = wall[INNER] if k == 0 else wall[OUTER]
        change = w / (d * d)
        shear = torque * d * over * (16.0 / math.pi) / (o2 + i2)
        bend = 0.5 * wall[MODULUS] * curvature * d
        for axial in (even - bend, even + bend):
            across = axial - m
            # of the stresses axial, m + change and m - change
            most = max(most, across * across + 3.0 * change * change + 3.0 * shear * shear)
    return math.sqrt(most)


@kernel
def note_pipes(line, ends, state, books, t):
    """Widen the ranges of wall tension and stress to the state at time t (s)."""
    n, walls = line.h.shape[0], books.walls
    zone, zones, section = 0, line.torsion.shape[0], 0
    for i in range(n + 1):
        passed = 0.0
        if zone < zones and i >= line.torsion[zone, FIRST]:
            passed = state.turn[zone, PASSED]
            zone += i >= line.torsion[zone, LAST]
        for side in (-1, 1):
            if side > 0:
                while (
                    i < n and section + 1 < walls.shape[0] and line.s[i] + 0.5 * line.h[i] > walls[section, SECTION_END]
                ):
                    section += 1
                one = books.right[i] == i and (line.element[i] or is_smooth(line, books.marks, i))
                if i == n or (i > 0 and one):
                    break
            elif i == 0:
                continue
            wall, column = walls[section], i if side < 0 else books.right[i]
            outside, inside = pressures(wall, state.r[i, 2])
            bore, full = 0.25 * math.pi * wall[INNER] ** 2, 0.25 * math.pi * wall[OUTER] ** 2
            F = tension_at(line, ends, state, books, i, side) + inside * bore - outside * full
            stress = 0.0
            if wall[MODULUS] > 0.0:
                if wall[NATURAL] > 0.0:
                    curvature, torque = bend_and_torque_curved(line, ends, state, books, i, side, passed, wall[NATURAL])
                else:
                    curvature, torque = bend_and_torque(line, ends, state, books, i, side, passed)
                stress = largest_stress(wall, outside, inside, F, curvature, torque)
            widen(books.extremes, WALL_TENSION, column, F, t)
            widen(books.extremes, VON_MISES, column, stress, t)
