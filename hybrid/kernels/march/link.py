"""Twist, writhe and link of a line between two ends that hold its twist (docs/theory.md, 17).

The line is closed beyond its ends: it goes on straight along their tangents, to infinity, and is closed there along the
shorter arc in the plane of both tangents.

    symbol   meaning                                                                                      unit
    v        direction of view, unit; p, q, v are right-handed                                            -
    u        v without its part along the tangent: a second edge beside the line, as a viewer sees it     -
    Tw       turn of the directors against those carried along the chords by the smallest rotations       rad
    Tv       the same of u, once around the closed line                                                   rad
    C        signed crossings that are seen along v: +1 where the upper strand turns right-handed over the lower one

A line and its edge u link as often as the line crosses itself, C = Tv/2 pi + Wr, so Wr = C - Tv/2 pi: exact for the
polygon, for any v, and as long as two strands are not in each other.  The search for crossings leaves out pairs of
blocks of cells that lie apart, or along each of which the line runs one way: a line that hangs costs one pass.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import add, cross, dot, get9, scale, sub
from hybrid.kernels.laws.element import chord
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.assembly import get3
from hybrid.kernels.march.zone_torque import FIRST, LAST, TURN
from hybrid.kernels.state.state import Ends, Floats, Line

TWIST, WRITHE, LINK, CROSSINGS = range(4)
BLOCK = 16  # cells of a block
# Strands nearer than this part of the line's length are in each other: which is above is not known.
IN_EACH_OTHER = 1e-9
# Two ways in the plane of view that turn by less against each other are parallel: round-off would say where they cross.
PARALLEL = 1e-12
# The cosine of opposite tangents, of which no plane is known, differs from -1 by less.
OPPOSITE = 1e-9
# By how much the view is turned from the side, along the line between the ends and up: by odd parts, so that
# it is along no chord and across no joint of a line that lies straight or in a plane.
ALONG, UP = 0.0137, 0.0291


@inner
def unit(a):
    return scale(1.0 / math.sqrt(dot(a, a)), a)


@inner
def turned(a, d, b, dn):
    """Cosine and sine, times a positive number, of the turn about dn of b against a of d, carried to dn."""
    c = sub(a, scale(dot(a, dn) / (1.0 + dot(d, dn)), add(d, dn)))
    return dot(c, b), dot(cross(c, b), dn)


@inner
def gather(total, re, im, c, s):
    """Add the angle of c + i s, between -pi and pi, to `total` + angle of re + i im, which stays below pi/2."""
    if not c > abs(s):
        return total + math.atan2(s, c), re, im
    f = 1.0 / c
    x, y = f * (re * c - im * s), f * (re * s + im * c)
    if not x > abs(y):
        return total + math.atan2(y, x), 1.0, 0.0
    return total, x, y


@inner
def across(v, d):
    """v without its part along d."""
    return sub(v, scale(dot(v, d), d))


@inner
def tangent_at(ends, k):
    """Tangent of the frame of end k."""
    R = get9(ends.frame, k)
    return (R[2], R[5], R[8])


@inner
def view_of(r, t):
    """p, q, v: v across the line between the ends, or across t, nearly level."""
    n = r.shape[0] - 1
    c = sub(get3(r, n), get3(r, 0))
    length = 0.0
    for k in range(3):
        length = max(length, abs(c[k]))
    if not length > 0.0:
        c = t
    c = unit(c)
    side = (c[1], -c[0], 0.0)
    if not dot(side, side) > 1e-6:
        side = (0.0, 1.0, 0.0)
    side = unit(across(side, c))
    v = unit(add(side, add(scale(ALONG, c), scale(UP, cross(side, c)))))
    p = unit(across(c, v))
    return p, cross(v, p), v


@inner
def twist_of(line, ends, state_a1, e, turn):
    """Turn of the directors from end to end, rad; NaN where a catenary knows none."""
    n, z, i = e.shape[0], 0, 0
    total, re, im = 0.0, 1.0, 0.0
    R = get9(ends.frame, 0)
    a, d = (R[0], R[3], R[6]), (R[2], R[5], R[8])
    while i <= n:  # from what lies before node i to what lies after it
        if i < n and not line.spin[i]:
            if not (z < turn.shape[0] and int(line.torsion[z, FIRST]) == i):
                return math.nan
            total += turn[z, TURN]
            i = int(line.torsion[z, LAST])
            z += 1
            if i == n:
                break
            a, d = get3(state_a1, i), chord(get3(e, i))[0]
            i += 1
            continue
        if i < n:
            b, dn = get3(state_a1, i), chord(get3(e, i))[0]
        else:
            R = get9(ends.frame, 1)
            b, dn = (R[0], R[3], R[6]), (R[2], R[5], R[8])
        c, s = turned(a, d, b, dn)
        total, re, im = gather(total, re, im, c, s)
        a, d = b, dn
        i += 1
    return total + math.atan2(im, re)


@inner
def turn_of_view(e, t0, tn, c, v):
    """Tv, rad; c: from end to start, in whose plane opposite tangents are joined."""
    total, re, im = 0.0, 1.0, 0.0
    d, u = t0, across(v, t0)
    for i in range(e.shape[0]):
        dn = chord(get3(e, i))[0]
        un = across(v, dn)
        x, y = turned(u, d, un, dn)
        total, re, im = gather(total, re, im, x, y)
        d, u = dn, un
    un = across(v, tn)
    x, y = turned(u, d, un, tn)
    total, re, im = gather(total, re, im, x, y)
    last = across(v, t0)
    if dot(tn, t0) > -1.0 + OPPOSITE:
        x, y = turned(un, tn, last, t0)
    else:
        n = unit(cross(tn, c))
        half = sub(scale(2.0 * dot(n, un), n), un)
        x, y = dot(half, last), dot(cross(half, last), t0)
    total, re, im = gather(total, re, im, x, y)
    return total + math.atan2(im, re)


# --- crossings ------------------------------------------------------------------------------------


@inner
def crossing(a, u, au, b, w, bw, near):
    """Sign of the crossing of a + x u and b + y w in the plane of view, 0 <= x < au, 0 <= y < bw; 0: there is none."""
    det = u[0] * w[1] - u[1] * w[0]
    if not abs(det) > PARALLEL * (abs(u[0]) + abs(u[1])) * (abs(w[0]) + abs(w[1])):
        return 0.0
    c0, c1 = b[0] - a[0], b[1] - a[1]
    x, y = (c0 * w[1] - c1 * w[0]) / det, (c0 * u[1] - c1 * u[0]) / det
    if not (0.0 <= x < au and 0.0 <= y < bw):
        return 0.0
    above = a[2] + x * u[2] - b[2] - y * w[2]
    if not abs(above) > near:
        return 0.0
    return 1.0 if (above > 0.0) == (det > 0.0) else -1.0


@inner
def place_in_view(r, p, q, v, seen, blocks):
    """Nodes in the axes of view, from the first one on, and the boxes of the blocks of cells, with their runs."""
    n = r.shape[0] - 1
    first = get3(r, 0)
    for i in range(n + 1):
        x = sub(get3(r, i), first)
        seen[i, 0], seen[i, 1], seen[i, 2] = dot(x, p), dot(x, q), dot(x, v)
    run, forward = 0.0, seen[1, 0] > 0.0
    for k in range(blocks.shape[0]):
        for j in range(2):
            blocks[k, j], blocks[k, 2 + j] = math.inf, -math.inf
        begin, end = k * BLOCK, min((k + 1) * BLOCK, n)
        for i in range(begin, end):
            if (seen[i + 1, 0] > seen[i, 0]) != forward:
                run, forward = run + 1.0, not forward
            if i == begin:
                blocks[k, 4] = run
        blocks[k, 5] = run
        for i in range(begin, end + 1):
            for j in range(2):
                blocks[k, j], blocks[k, 2 + j] = min(blocks[k, j], seen[i, j]), max(blocks[k, 2 + j], seen[i, j])


@inner
def cells_cross(seen, i, j, near):
    a, b = get3(seen, i), get3(seen, j)
    return crossing(a, sub(get3(seen, i + 1), a), 1.0, b, sub(get3(seen, j + 1), b), 1.0, near)


@inner
def count_crossings(seen, blocks, t0, tn, near):
    """Signed crossings of the line and of what it goes on with beyond its ends; t0, tn: tangents in the axes of view."""
    n, total = seen.shape[0] - 1, 0.0
    for k in range(blocks.shape[0]):
        for m in range(k, blocks.shape[0]):
            if blocks[k, 4] == blocks[m, 5]:  # one way all along
                continue
            if (
                blocks[k, 0] > blocks[m, 2]
                or blocks[m, 0] > blocks[k, 2]
                or blocks[k, 1] > blocks[m, 3]
                or blocks[m, 1] > blocks[k, 3]
            ):
                continue
            for i in range(k * BLOCK, min((k + 1) * BLOCK, n)):
                for j in range(max(m * BLOCK, i + 2), min((m + 1) * BLOCK, n)):
                    total += cells_cross(seen, i, j, near)
    start, end, back = get3(seen, 0), get3(seen, n), scale(-1.0, t0)
    for i in range(n):
        a = get3(seen, i)
        u = sub(get3(seen, i + 1), a)
        if i > 0:  # against the way of the line, so the other sign
            total -= crossing(start, back, math.inf, a, u, 1.0, near)
        if i < n - 1:
            total += crossing(a, u, 1.0, end, tn, math.inf, near)
    return total - crossing(start, back, math.inf, end, tn, math.inf, near)


@kernel
def count_link(line, ends, r, e, a1, turn, seen, blocks, out):
    """Twist, writhe, link (turns) and crossings of a state into out (4,).

    r, e, a1, turn as in State; seen: (N+1, 3) and blocks: (B, 6) are work arrays, of B blocks of BLOCK cells.
    """
    n = e.shape[0]
    t0, tn = tangent_at(ends, 0), tangent_at(ends, 1)
    p, q, v = view_of(r, t0)
    place_in_view(r, p, q, v, seen, blocks)
    size = 0.0
    for i in range(n):
        size += line.h[i]
    t0v, tnv = (dot(t0, p), dot(t0, q), dot(t0, v)), (dot(tn, p), dot(tn, q), dot(tn, v))
    c = count_crossings(seen, blocks, t0v, tnv, IN_EACH_OTHER * size)
    view = turn_of_view(e, t0, tn, sub(get3(r, 0), get3(r, n)), v)
    out[TWIST] = twist_of(line, ends, a1, e, turn) / (2.0 * math.pi)
    out[CROSSINGS], out[WRITHE] = c, c - view / (2.0 * math.pi)
    out[LINK] = out[TWIST] + out[WRITHE]


def holds_twist(line: Line) -> bool:
    """Whether both ends hold the twist of a line, through all of its zones."""
    if not line.kb[line.element == 1, 2].all():  # a swivel
        return False
    first, last = line.element[[0, -1]].astype(bool) & (line.kb[[0, -1], 2] > 0.0)
    if not line.spin.all():
        zones = np.count_nonzero(np.diff(np.concatenate([[1], line.spin])) < 0)
        if len(line.torsion) != zones:
            return False
        first = first or line.torsion[0, FIRST] == 0.0
        last = last or line.torsion[-1, LAST] == line.h.size
    return bool(first and last)


def link_of(line: Line, ends: Ends, r: Floats, e: Floats, a1: Floats, turn: Floats) -> Floats:
    """Twist, writhe, link and crossings (4,) of a line whose ends hold the twist; shapes as in State."""
    out, n = np.zeros(4), line.h.size
    count_link(line, ends, r, e, a1, turn, np.zeros((n + 1, 3)), np.zeros((-(-n // BLOCK), 6)), out)
    return out
