"""What a converged step says of the mesh: bends and twists that it does not resolve, the lowest tension."""

from __future__ import annotations

import math

from hybrid.kernels.algebra.plane import angle_between, chord2, end_chord, row_in_plane, stiffness_about_normal
from hybrid.kernels.algebra.rotations import frame, get3, get9
from hybrid.kernels.laws.bending_law import (
    RIGID,
    components_about_normal,
    elastic_moment,
    moment_share,
    own_strain,
    parts_without_spring,
    slip_about_normal,
    slips,
)
from hybrid.kernels.laws.element import chord, strain_of_element
from hybrid.kernels.laws.tension_torque import rest_strain
from hybrid.kernels.machine.compile import inner, kernel

# At a clamp whose first cell is longer than sqrt(EI/T) the moment is not resolved, whatever
# the angle; angles above 1/CLAMP rad (3 deg) are worth a word.
CLAMP = 20.0


@inner
def strain_of(line, T, i, k, strains):
    """Curvature (1/m), bending moment and torque (N m) of the element at node i, whose log strain is k (rad)."""
    a, b, _, _, _ = own_strain(line, i, k)
    mx, my = elastic_moment(line, i, k)
    strains[i, 0], strains[i, 1] = math.sqrt(a * a + b * b), math.sqrt(mx * mx + my * my)
    strains[i, 2] = line.kb[i, 2] * (k[2] - rest_strain(line, T, i)[2])


@kernel
def sharpest_in_plane(line, ends, e, T, a1, strains):
    """As `sharpest_in_space` for a cable in a plane: largest bend and its node; there is no twist."""
    bend, at = 0.0, -1
    n, plane = e.shape[0], line.plane
    d, l, _ = chord2(row_in_plane(plane, e, 0))
    for i in range(n + 1):
        before = d if i > 0 else end_chord(plane, ends.frame, 0)
        here = l
        if 0 < i < n:
            d, l, _ = chord2(row_in_plane(plane, e, i))
        if not line.element[i]:
            continue
        angle = angle_between(before, d if i < n else end_chord(plane, ends.frame, 1))
        x = abs(angle)
        if strains.shape[0] > 0:
            k, k0 = stiffness_about_normal(plane, a1, max(i - 1, 0), before if i > 0 else d, line.kb, line.k0, i)
            share = moment_share(line, i, abs(angle - k0))
            strains[i, 0], strains[i, 1] = x / line.hn[i], share * abs(k * (angle - k0))
            if slips(line, i):
                m, _, _ = slip_about_normal(line, a1, max(i - 1, 0), before if i > 0 else d, i, angle - k0)
                strains[i, 1] = abs(share * k * (angle - k0) + m)
            if i == 0 or i == n:
                along, across = components_about_normal(line, a1, max(i - 1, 0), before if i > 0 else d, angle - k0)
                part = parts_without_spring(line, i, along, across)[0]
                if part < RIGID:
                    strains[i, 0] = abs(k0 + part * (angle - k0)) / (0.5 * line.h[min(i, n - 1)])
        if i == 0 or i == n:
            c = min(i, n - 1)
            stiffness = max(line.kb[i, 0], line.kb[i, 1]) * line.hn[i]
            weight = 2.0
            if T[c] > 0.0 and here * here * T[c] > stiffness:
                weight = CLAMP * here * math.sqrt(T[c] / stiffness)
            x *= weight * 0.5 * line.h[c] / line.hn[i]  # of a clamp with an angular spring the part of the cell
        if not x <= bend:
            bend, at = x, i
    return bend, at, 0.0, -1


@kernel
def sharpest_in_space(line, ends, e, T, a1, strains):
    """How far the mesh is from resolving a rod: largest bend and twist of an element, rad, and their nodes (-1: none).

    The element at a clamp or guide stands for half a cell; it counts twice, and CLAMP times
    h/lambda where the cell is longer than lambda = sqrt(EI/T), over which a cable leaves its clamp.
    """
    bend, twist, bend_at, twist_at = 0.0, 0.0, -1, -1
    n = e.shape[0]
    for i in range(n + 1):
        if not line.element[i]:
            continue
        c = min(i, n - 1)
        d, l, _ = chord((e[c, 0], e[c, 1], e[c, 2]))
        Rb = frame((a1[c, 0], a1[c, 1], a1[c, 2]), d)
        weight = 1.0
        if 0 < i < n:
            d, _, _ = chord((e[i - 1, 0], e[i - 1, 1], e[i - 1, 2]))
            Ra = frame((a1[i - 1, 0], a1[i - 1, 1], a1[i - 1, 2]), d)
        else:
            Ra = get9(ends.frame, 0 if i == 0 else 1)
            if i == n:
                Ra, Rb = Rb, Ra
            stiffness = max(line.kb[i, 0], line.kb[i, 1]) * line.hn[i]
            weight = 2.0
            if T[c] > 0.0 and l * l * T[c] > stiffness:
                weight = CLAMP * l * math.sqrt(T[c] / stiffness)
            weight *= 0.5 * line.h[c] / line.hn[i]  # of a clamp with an angular spring the part of the cell
        k = strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i), i)
        x = weight * math.sqrt(k[0] * k[0] + k[1] * k[1])
        y = abs(k[2]) if line.kb[i, 2] > 0.0 else 0.0
        if strains.shape[0] > 0:
            strain_of(line, T, i, k, strains)
        if not x <= bend:
            bend, bend_at = x, i
        if not y <= twist:
            twist, twist_at = y, i
    return bend, bend_at, twist, twist_at


@kernel
def lowest(line, T):
    """Lowest tension of a catenary zone and its cell; infinity and -1 without one."""
    where, low = -1, math.inf
    for i in range(T.shape[0]):
        if not line.spin[i] and not T[i] > low:
            where, low = i, T[i]
    return low, where


@kernel
def lowest_not_held(line, sea, T):
    """As `lowest`, without the cells that lie on the bed and are compressed by less than friction holds there.

    Friction changes the tension by up to mu N from one cell to the next: a compression below that is within what cells
    of this length resolve, and the bed keeps the line from buckling.
    """
    where, low = -1, math.inf
    for i in range(T.shape[0]):
        if not line.spin[i] and not T[i] > low:
            a, b = normal_force(sea, i), normal_force(sea, i + 1)
            if not (a > 0.0 and b > 0.0 and -T[i] < 0.5 * sea.friction[0] * (a + b)):
                where, low = i, T[i]
    return low, where


@inner
def normal_force(sea, i):
    """Force of the bed on a node along the normal of the bed, of a bed of depths upwards, N."""
    n, bed = sea.normal, sea.bed
    return n[0] * bed[i, 0] + n[1] * bed[i, 1] + n[2] * bed[i, 2]
