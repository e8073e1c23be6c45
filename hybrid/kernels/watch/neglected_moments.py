"""The moments that a cable computed without bending neglects (docs/theory.md, 14, T24).

symbol   meaning                                                        shape   unit
ki       stiffness of a full element at a node, EI/hn                   N+1     N m
beta     part of it that the node has: 1 rod, 0 catenary or joint       -       -
theta    turn of the chords at a node (at a clamp, from its tangent)    3       rad
dM       moment of the rod less that of the line computed               N+1, 3  N m     inertial
M        the moment neglected: (1 - beta)(beta ki theta + dM)           N+1, 3  N m     inertial
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub
from hybrid.kernels.laws.cell import Chord, chord
from hybrid.kernels.laws.node_forces import Z3
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import by_reference
from hybrid.kernels.state.state import Floats

# Turns beyond this (1 + cosine) count as one of a half turn less 11 degrees: a fold has no direction.
SHARPEST = 0.02


@inner
def bend(a, b):
    """Turn from direction a to b as a vector: twice the tangent of half the angle, as of an element of chords."""
    return scale(2.0 / max(1.0 + dot(a, b), SHARPEST), cross(a, b))


class Bending(NamedTuple):
    """What the bending of a line would be if all of it were rod."""

    soft: Floats  # (N+1,) 1/(N m), 1/ki, 0 where there is no bending stiffness
    kinks: NDArray[np.int8]  # (N+1,) 1 where the cable may have one: at point loads, and ends that prescribe a tangent
    tangent: NDArray[np.int8]  # (2,) 1 where an end prescribes one
    floor: Floats  # (N,) N, least tension that counts


by_reference(Bending(np.zeros(2), np.zeros(2, np.int8), np.zeros(2, np.int8), np.zeros(1)))


@inner
def chord_of(chords, i):
    """Direction, length and its inverse, as of `tabulate_chords`."""
    return Chord((chords[i, 0], chords[i, 1], chords[i, 2]), chords[i, 3], chords[i, 4])


@kernel
def tabulate_chords(e, chords):
    """chords (N, 5): direction, length (m) and its inverse of the chords e (N, 3)."""
    for i in range(e.shape[0]):
        d, l, il = chord(get3(e, i))
        chords[i, 0], chords[i, 1], chords[i, 2], chords[i, 3], chords[i, 4] = d[0], d[1], d[2], l, il


@inner
def bending_share(line, soft, i):
    """beta of node i."""
    if line.element[i] and soft[i] > 0.0:
        return min(0.5 * (line.kb[i, 0] + line.kb[i, 1]) * soft[i], 1.0)
    return 0.0


@inner
def soft_at_kink(soft, before, after):
    """1/ki with which the moment at a kink is EI theta / (2 lambda), that between long stretches, at any length of cells.

    before, after: 1/(l T) of the cells beside the node, 0 where there is none.  Between cells of length h a regular 1/ki
    gives that over sqrt(1 + h^2/(4 lambda^2)); a clamp is one half of it (docs/theory.md, 14, T24).
    """
    sides = 2.0 if before > 0.0 and after > 0.0 else 1.0
    a = (before + after) / sides  # 1/(h T)
    x = 0.5 * soft / (sides * a)  # h^2/(4 lambda^2), because soft = sides h/(2 EI)
    return soft - 2.0 * sides * a * math.sqrt(x) * (math.sqrt(1.0 + x) - 1.0)


@inner
def tangent_of(ends, k):
    """Tangent of the frame at the start (k = 0) or end (1)."""
    return (ends.frame[k, 2], ends.frame[k, 5], ends.frame[k, 8])


@inner
def torque_at(line, ends, bending, chords, i, torque):
    """Moment along the cable at node i of a torque that its rods do not carry."""
    n = chords.shape[0]
    t = Z3
    if i > 0:
        t, _, _ = chord_of(chords, i - 1)
    if i < n:
        d, _, _ = chord_of(chords, i)
        t = add(t, d)
    if (i == 0 and bending.tangent[0]) or (i == n and bending.tangent[1]):
        t = tangent_of(ends, 0 if i == 0 else 1)
    return scale((1.0 - bending_share(line, bending.soft, i)) * torque / math.sqrt(dot(t, t)), t)


@inner
def turn_at(ends, bending, i, n, d_before, d):
    """theta of node i between chords d_before and d, and whether there is one."""
    if 0 < i < n:
        return bend(d_before, d), True
    if i == 0 and bending.tangent[0]:
        return bend(tangent_of(ends, 0), d), True
    if i == n and bending.tangent[1]:
        return bend(d_before, tangent_of(ends, 1)), True
    return Z3, False


@inner
def end_moment(line, ends, i, n):
    """dM at an end without a tangent: the moment that a catenary's end is given; a rod's is in the march."""
    if line.spin[0 if i == 0 else n - 1]:
        return Z3
    return scale(-1.0, get3(ends.moment, 0)) if i == 0 else get3(ends.moment, 1)


@inner
def slope_by_torque(line, ends, bending, turned, i, torque, a, d, mt):
    """By how much a torque turns cell i, and the torque's moment after it; mt: that before it."""
    mt_after = torque_at(line, ends, bending, turned, i + 1, torque)
    by = sub(mt_after, mt)
    return scale(a, sub(by, scale(dot(d, by), d))), mt_after


@inner
def eliminate_moments(line, ends, bending, chords, turned, T, torque, work, dM, M):
    """Forward elimination: work[:, 0] the upper factor, dM the right-hand side; M: beta ki theta, work[:, 2]: beta."""
    n = T.shape[0]
    upper, d_before, a_before, last, by_before, mt = 0.0, Z3, 0.0, Z3, Z3, Z3
    if torque != 0.0:
        mt = torque_at(line, ends, bending, turned, 0, torque)
    for i in range(n + 1):
        d, a, by = Z3, 0.0, Z3
        if i < n:
            d, _, il = chord_of(chords, i)
            a = il / max(T[i], bending.floor[i])
            if torque != 0.0:
                by, mt = slope_by_torque(line, ends, bending, turned, i, torque, a, d, mt)
        soft, beta = bending.soft[i], bending_share(line, bending.soft, i)
        theta, free = turn_at(ends, bending, i, n, d_before, d)
        rhs, diagonal, lower, k = Z3, 1.0, 0.0, Z3
        if not soft > 0.0:
            free = False
        elif free:
            if bending.kinks[i] and beta == 0.0:
                soft = soft_at_kink(soft, a_before, a)
            diagonal, lower = soft + a_before + a, -a_before
            rhs = scale(1.0 - beta, theta)
            if torque != 0.0:  # it turns chords as well
                rhs = add(rhs, sub(by, by_before))
        else:
            rhs = end_moment(line, ends, i, n)
        if beta > 0.0:
            k = scale(beta / soft, theta)
        M[i, 0], M[i, 1], M[i, 2] = k
        inverse = 1.0 / (diagonal - lower * upper)
        upper = -a * inverse if free else 0.0
        last = scale(inverse, sub(rhs, scale(lower, last)))
        work[i, 0], work[i, 2] = upper, beta
        dM[i, 0], dM[i, 1], dM[i, 2] = last
        d_before, a_before, by_before = d, a, by


@kernel
def neglected_moments(line, ends, bending, chords, turned, T, torque, work, dM, M):
    """The moments dM and M, by one tridiagonal solve from end to end.

    chords: as of `tabulate_chords`; turned: the same as dM without torque turns them, along which a torque acts;
    torque: N m, of the whole line as far as its rods do not carry it; work: (N+1, 3) to work in.
    """
    eliminate_moments(line, ends, bending, chords, turned, T, torque, work, dM, M)
    n = T.shape[0]
    last = get3(dM, n)
    for i in range(n - 1, -1, -1):
        last = sub(get3(dM, i), scale(work[i, 0], last))
        dM[i, 0], dM[i, 1], dM[i, 2] = last
    d_before = Z3
    for i in range(n + 1):
        d = Z3
        if i < n:
            d, _, _ = chord_of(chords, i)
        m = scale(1.0 - work[i, 2], add(get3(M, i), get3(dM, i)))
        # a joint passes no torque to the rod beside it, and a chord feels none of a moment along it
        if i < n and line.spin[i]:
            m = sub(m, scale(dot(m, d), d))
        if i > 0 and line.spin[i - 1]:
            m = sub(m, scale(dot(m, d_before), d_before))
        if torque != 0.0:
            m = add(m, torque_at(line, ends, bending, turned, i, torque))
        M[i, 0], M[i, 1], M[i, 2] = m
        d_before = d


@kernel
def turn_chords(chords, T, floor, dM, turned):
    """The chords `turned` by the moments dM: by the difference of the moments at their ends over l T."""
    for c in range(chords.shape[0]):
        d, l, il = chord_of(chords, c)
        w = scale(il / max(T[c], floor[c]), sub(get3(dM, c + 1), get3(dM, c)))
        t, _, _ = chord(add(d, cross(w, d)))
        turned[c, 0], turned[c, 1], turned[c, 2], turned[c, 3], turned[c, 4] = t[0], t[1], t[2], l, il
