"""Curvature of rods whose stiffness is on its way in or out: what the line would have if it had all of it.

Where a rod has grown past a joint, the kink of that joint stays until the stiffness of its element has come: a bend of
one cell that no rod has.  The same forces across the line are in balance with its turns now and with all of the stiffness:

    T w^_i - D(K w^)_i = T w_i - D(p K w)_i,    D(M)_i = (M_i+1 - M_i)/h_i - (M_i - M_i-1)/h_i-1

Hence w^ = p w + M/K, where M is what its neighbours bear of what an element lacks:

    (T/K)_i M_i - D(M)_i = T_i (1 - p_i) w_i

A joint has p = 0; of the catenary behind it the curvature of its next node goes on, as in kernels.laws.closed_forms.
Beyond a clamp there is no cell, and an end without a clamp has M = 0.  It is exact for small turns at rest.

    symbol  meaning                                                                             unit
    w, w^   turn of the chords at a node now; with all of the stiffness; vectors across both    rad
    p       part of the bending stiffness that an element has; its torsion has all of it        1
    K       all of that stiffness: EI over the length of the node                               N m
    M       see above                                                                           N m
    T, h    tension at a node; length of a cell                                                 N, m

Columns of books.strains while it is solved, from the first node on: M_i = d_i - c_i M_i+1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, get9, scale
from hybrid.kernels.laws.element import chord
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import Floats

# Columns of books.strains.
RAW = 0  # curvature of elements
BENT = 3  # curvature of results
C = 4  # c and d of above
D = 5
WHOLE = 1.0 - 1e-9  # p from which on a rod has all of its stiffness
LINE = 2  # first row of books.hinges of pieces of the line
EI, END, GJ = range(3)  # columns of these
FOLDED = 1e-12  # 1 + cos(x) of cells that are as good as folded onto each other
SLACK = 2.5e-5  # least h T/K, for lines with hardly any tension: M fades within some 200 cells


class Rods(NamedTuple):
    """Of a state and of `Books` what is needed here: the same of a step and of an output."""

    e: Floats
    T: Floats
    strains: Floats
    hinges: Floats
    marks: NDArray[np.int8]


@inner
def of_chords(line, e, i):
    """Curvature, 1/m, at node i of the circle that its two chords are tangents of."""
    d, _, _ = chord(get3(e, i - 1))
    dn, _, _ = chord(get3(e, i))
    s, cosine = cross(d, dn), 1.0 + dot(d, dn)
    half = math.sqrt(dot(s, s)) / cosine if cosine > FOLDED else math.sqrt(2.0 / FOLDED)  # tan(x/2)
    return 2.0 * half / line.hn[i]


@inner
def across(a, b):
    """Direction across a and b."""
    x = cross(a, b)
    length = math.sqrt(dot(x, x))
    return scale(1.0 / length, x) if length > 0.0 else (0.0, 1.0, 0.0)


@called
def bend_direction(line, e, i):
    """Direction across both chords at inner node i; of a line in a plane its normal, or against it."""
    a, b = chord(get3(e, i - 1))[0], chord(get3(e, i))[0]
    if line.bits & PLANAR:
        normal = get3(line.plane, 2)
        return normal if dot(normal, cross(a, b)) >= 0.0 else scale(-1.0, normal)
    return across(a, b)


@inner
def bend_at(line, ends, rods, i):
    """Curvature of the chords at a node of a rod, a vector, 1/m; 0 at an end without an element."""
    n = line.h.shape[0]
    if 0 < i < n:
        size = rods.strains[i, RAW] if line.element[i] else of_chords(line, rods.e, i)
        return scale(size, bend_direction(line, rods.e, i))
    if not line.element[i]:
        return (0.0, 0.0, 0.0)
    R, d = get9(ends.frame, 0 if i == 0 else 1), chord(get3(rods.e, min(i, n - 1)))[0]
    t = (R[2], R[5], R[8])
    return scale(rods.strains[i, RAW], across(t, d) if i == 0 else across(d, t))


@inner
def piece_at(pieces, s):
    """Row of `pieces`, books.hinges, of the piece that lies at s (m)."""
    low, high = LINE, pieces.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        if s < pieces[middle, END]:
            high = middle
        else:
            low = middle + 1
    return low


@inner
def part_of_stiffness(line, i, pieces):
    """p of the element at node i, 1 where it has all of its stiffness or that is not known; pieces: books.hinges."""
    if not line.element[i] or pieces[LINE, EI] <= 0.0:
        return 1.0
    a, b, s = max(i - 1, 0), min(i, line.h.shape[0] - 1), line.s
    j = piece_at(pieces, 0.5 * (s[a] + s[a + 1]))
    half = 0.5 * line.h[a]
    bends, twists = half / pieces[j, EI], half / pieces[j, GJ]  # by a moment, rad per N m
    if a != b:
        k, half = piece_at(pieces, 0.5 * (s[b] + s[b + 1])), 0.5 * line.h[b]
        bends, twists = bends + half / pieces[k, EI], twists + half / pieces[k, GJ]
    else:  # an angular spring at a clamp does not twist
        bends = line.hn[i] / pieces[j, EI]
    if line.kb[i, 2] > 0.0:  # of no swivel: all of its torsion is there, whatever lengths are under way
        bends /= twists * line.kb[i, 2]
    part = line.kb[i, 0] * bends
    return part if 0.0 < part < WHOLE else 1.0


@inner
def all_stiffness(line, i, pieces, way):
    """K of node i; at a joint of the rod on its side `way` (-1, 1)."""
    j = i if line.element[i] else i + way
    return line.kb[j, 0] / part_of_stiffness(line, j, pieces) * (line.hn[j] / line.hn[i])


@inner
def goes_on_outside(line, marks, i):
    """Whether inner node i is of a catenary, without what may make a kink there."""
    return not line.element[i] and not line.spin[i - 1] and not line.spin[i] and not marks[i]


@inner
def balance(line, ends, rods, i, a, b):
    """Diagonal and right side of the balance of node i of the rod from node a to b, if a is not an end that turns."""
    n, h, pieces, inside = line.h.shape[0], line.h, rods.hinges, a < i < b
    way = 1 if i == a else -1
    K, rod = all_stiffness(line, i, pieces, way), min(max(i, a), b - 1)
    T = 0.5 * (rods.T[i - 1] + rods.T[i]) if inside else rods.T[rod]
    T = max(T, SLACK * K / h[rod])
    lack = 1.0 - part_of_stiffness(line, i, pieces) if line.element[i] else 1.0
    rhs = scale(T * lack * line.hn[i], bend_at(line, ends, rods, i))
    diagonal = T / K + (1.0 / h[i - 1] if i > a else 0.0) + (1.0 / h[i] if i < b else 0.0)
    outer = i - way
    if not inside and 0 < outer < n and goes_on_outside(line, rods.marks, outer):
        cell = 1.0 / h[min(i, outer)]
        diagonal += cell
        rhs = add(
            rhs, scale(K * line.hn[i] * cell * of_chords(line, rods.e, outer), bend_direction(line, rods.e, outer))
        )
    return diagonal, rhs


@inner
def turns_freely(line, i):
    """Whether node i is an end of the line that has no moment, or one that is given."""
    return (i == 0 or i == line.h.shape[0]) and not line.element[i]


@inner
def get_solved(bent, i):
    return (bent[i, D], bent[i, D + 1], bent[i, D + 2])


@kernel
def restore_rod(line, ends, rods, a, b):
    """Enter into column BENT the curvature of the rod from node a to b with all of its stiffness.

    Of joints into RAW as well: on the side of the catenary it is the same.
    """
    bent, pieces, h, n = rods.strains, rods.hinges, line.h, line.h.shape[0]
    for i in range(a, b + 1):
        if turns_freely(line, i):
            for k in range(4):
                bent[i, C + k] = 0.0
            continue
        diagonal, rhs = balance(line, ends, rods, i, a, b)
        if i > a:
            diagonal -= bent[i - 1, C] / h[i - 1]
            rhs = add(rhs, scale(1.0 / h[i - 1], get_solved(bent, i - 1)))
        bent[i, C] = 1.0 / (h[i] * diagonal) if i < b else 0.0
        for k in range(3):
            bent[i, D + k] = rhs[k] / diagonal
    M = (0.0, 0.0, 0.0)
    for j in range(b - a + 1):
        i = b - j
        M = add(get_solved(bent, i), scale(bent[i, C], M))
        bend, part = bend_at(line, ends, rods, i), 0.0
        if line.element[i]:
            part = part_of_stiffness(line, i, pieces)
        K = all_stiffness(line, i, pieces, 1 if i == a else -1)
        whole = add(scale(part, bend), scale(1.0 / (K * line.hn[i]), M))
        bent[i, BENT] = math.copysign(math.sqrt(dot(whole, whole)), dot(whole, bend))
        if not line.element[i] and 0 < i < n:
            bent[i, RAW] = abs(bent[i, BENT])


@kernel
def restore_stiffness(line, ends, rods):
    """`restore_rod` of all rods with an element that has not all of its stiffness, if that is known."""
    n, pieces, a = line.h.shape[0], rods.hinges, 0
    while pieces[LINE, EI] > 0.0 and a < n:
        if not line.spin[a]:
            a += 1
            continue
        b, soft = a + 1, False
        while b < n and line.spin[b]:
            soft |= line.kb[b, 2] > 0.0 and part_of_stiffness(line, b, pieces) < WHOLE
            b += 1
        if soft:
            restore_rod(line, ends, rods, a, b)
        a = b
