"""The law of contact of a line with itself, and its friction.

The curve is the quadratic B-spline whose control points are the nodes: one piece for every inner node p, from the
middle of the cell before it to the middle of the cell after it, with a tangent that has no jumps,

    x(u) = a (1-u)^2/2 r_{p-1} + (1 - a (1-u)^2/2 - b u^2/2) r_p + b u^2/2 r_{p+1},    0 <= u <= 1

with a = b = 1.  The first piece begins at the first node, with a = 2, and the last one ends at the last node, b = 2.
Nodes of several lines stand one after the other; `kind` tells which is the FIRST of a line, or the LAST, or within it,
and so has a piece.

A point of contact is a sample point of one piece p and its foot on another piece q, where their distance d is smallest
along q.  With J the derivative of x - y by the six nodes and n = (x - y)/d, the energy phi(d) of a point has the
gradient phi' J^T n, and with the foot eliminated the second derivative

    H = J^T (phi'' n n^T + (phi'/d)(1 - n n^T)) J - b b^T/c,
    b = phi' (-J^T y'/d + J_v^T n),    c = phi' (|y'|^2 - (x - y).y'')/d

Friction is an elastic travel at every point of contact.  The strands touch where the line from x to y is parted as
their diameters D_p and D_q are, halfway for equal ones.  In a step their surfaces shift against each other there by

    g = P (W_x u_p - W_y u_q - (d/2) (b_p phi_p + b_q phi_q) x n),    P = 1 - n n^T,    b_p = 2 D_p/(D_p + D_q)

with the displacements u of the nodes and the rotation phi = psi d + d x de/l of each strand, between those of the two
cells of a piece.  The travel q of a point, kept along and across strand p, becomes q + g, with the force -k q on p and
k q on q; where that is more than mu N it slides, and q keeps mu N/k.  So nothing creeps, and nothing gives back more
than it has stored.  Off the centre lines the force is a force f on the centre line and a moment -(d/2) b n x f on each
strand, along the chord into the balance of spin, across it as a couple: no angular momentum is lost.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub, vector
from hybrid.kernels.laws.element import chord
from hybrid.kernels.machine.compile import inner

# Distances, in diameters, at which the force of contact begins and becomes infinite: strands stay 0.94 to 1.02 apart.
OUTER, INNER = 1.05, 0.85
STICKS = 100.0  # spring of friction per length, of size/D^2: the force of contact has 50 to 200
WITHIN, FIRST, LAST = range(3)  # kinds of nodes
FOOT_STEPS = 30  # of Newton's method with bisection: it needs about 4
FOOT_TOLERANCE = 1e-14


@inner
def end_factors(kind, p):
    """The factors a and b of piece p."""
    return 2.0 if kind[p - 1] == FIRST else 1.0, 2.0 if kind[p + 1] == LAST else 1.0


@inner
def spline_weights(kind, p, u):
    """Weights of the three nodes of piece p at u."""
    a, b = end_factors(kind, p)
    before, after = 0.5 * a * (1.0 - u) * (1.0 - u), 0.5 * b * u * u
    return (before, 1.0 - before - after, after)


@inner
def end_slopes(kind, r, p):
    """Derivatives by u of piece p at its beginning and at its end."""
    a, b = end_factors(kind, p)
    return scale(a, sub(get3(r, p), get3(r, p - 1))), scale(b, sub(get3(r, p + 1), get3(r, p)))


@inner
def spline_point(r, p, w):
    """Sum of the nodes of piece p with weights w."""
    return (
        w[0] * r[p - 1, 0] + w[1] * r[p, 0] + w[2] * r[p + 1, 0],
        w[0] * r[p - 1, 1] + w[1] * r[p, 1] + w[2] * r[p + 1, 1],
        w[0] * r[p - 1, 2] + w[1] * r[p, 2] + w[2] * r[p + 1, 2],
    )


@inner
def slope(before, after, v):
    """Derivative by v of a piece with those at its beginning and at its end."""
    return (
        (1.0 - v) * before[0] + v * after[0],
        (1.0 - v) * before[1] + v * after[1],
        (1.0 - v) * before[2] + v * after[2],
    )


@inner
def foot(kind, r, q, x):
    """Where x is nearest to piece q, 0 <= v <= 1, and whether that is an end of the piece.

    -1, 1: its beginning or its end, without being a smallest distance of the curve; else 0.
    """
    before, after = end_slopes(kind, r, q)
    bend = sub(after, before)
    # half the derivative of the square
    at_start = dot(sub(spline_point(r, q, spline_weights(kind, q, 0.0)), x), before)
    at_end = dot(sub(spline_point(r, q, spline_weights(kind, q, 1.0)), x), after)
    if at_start >= 0.0:
        return 0.0, -1
    if at_end < 0.0:
        return 1.0, 1
    # away = first + v before + v^2 bend/2, along = before + v bend: their product is c0 + c1 v + c2 v^2 + c3 v^3
    first = sub(sub(get3(r, q), scale(0.5, before)), x)
    c0, c1 = dot(first, before), dot(before, before) + dot(first, bend)
    c2, c3 = 1.5 * dot(before, bend), 0.5 * dot(bend, bend)
    low, high = 0.0, 1.0
    v = at_start / (at_start - at_end)
    for _ in range(FOOT_STEPS):
        g = c0 + v * (c1 + v * (c2 + v * c3))
        if g < 0.0:
            low = v
        else:
            high = v
        rate = c1 + v * (2.0 * c2 + v * 3.0 * c3)
        new = v - g / rate if rate > 0.0 else 0.5 * (low + high)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        step = abs(new - v)
        v = new
        if step < FOOT_TOLERANCE:
            break
    return v, 0


@inner
def barrier(d, width, size):
    """Energy per length, J/m, at the distance d (m) of strands of a diameter (m), and its two derivatives; size: N."""
    inverse = 1.0 / ((OUTER - INNER) * width)
    x = (d - INNER * width) * inverse
    if x >= 1.0:
        return 0.0, 0.0, 0.0
    if x <= 0.0:
        return math.inf, -math.inf, math.inf
    y, log = x - 1.0, math.log(x)
    return (
        -size * y * y * log,
        -size * inverse * (2.0 * y * log + y * y / x),
        -size * inverse * inverse * (2.0 * log + 4.0 * y / x - y * y / (x * x)),
    )


# Columns of a point of contact.
P = 0  # piece,
Q = 1  # and that of its foot
WX = 2  # 3, weights of the nodes of x
WY = 5  # 3, and of y
NORMAL = 8  # 3, n
ALONG = 11  # what the law leaves along n
ACROSS = 12  # and across it
SLOPE = 13  # 3, y'/d
RATES = 16  # 3, weights of y'
FORCE = 19  # phi'
FOLLOWS = 20  # 1/c, 0 where the foot stays at an end of the cable
PLACE = 21  # u
DISTANCE = 22  # d, m
SPRING = 23  # of its friction, N/m
FOOT_PLACE = 24  # v of the foot
POINT = 25


class Foot(NamedTuple):
    """Where another strand is nearest to a point: at v of piece q; stays: whether it is kept at an end of the cable."""

    q: int
    v: float
    stays: bool


@inner
def note_point(kind, r, p, u, nearest, width, size, weight, row):
    """Fill the row of a point at u of piece p, and of its `Foot` on another strand; returns its energy, J.

    weight: m, length that the point stands for.
    """
    q, v, stays = nearest
    w, wy = spline_weights(kind, p, u), spline_weights(kind, q, v)
    away = sub(spline_point(r, p, w), spline_point(r, q, wy))
    d = math.sqrt(dot(away, away))
    energy, first, second = barrier(d, width, size)
    first, second = weight * first, weight * second
    before, after = end_slopes(kind, r, q)
    along, bend = slope(before, after, v), sub(after, before)
    row[P], row[Q] = p, q
    a, b = end_factors(kind, q)
    rates = (a * (v - 1.0), a * (1.0 - v) - b * v, b * v)
    for k in range(3):
        row[WX + k], row[WY + k] = w[k], wy[k]
        row[NORMAL + k], row[SLOPE + k], row[RATES + k] = away[k] / d, along[k] / d, rates[k]
    row[ALONG], row[ACROSS], row[FORCE] = second, first / d, first
    curved = dot(along, along) - dot(away, bend)
    row[FOLLOWS] = 0.0
    if not stays and first != 0.0 and curved > 0.0:
        row[FOLLOWS] = d / (first * curved)
    row[PLACE], row[DISTANCE], row[SPRING] = u, d, weight * STICKS * size / (width * width)
    row[FOOT_PLACE] = v
    return weight * energy


@inner
def add_gradient(row, out):
    """Add the gradient of a point's energy to (N+1, 3) out."""
    p, q, f = int(row[P]), int(row[Q]), row[FORCE]
    for j in range(3):
        for k in range(3):
            out[p - 1 + j, k] += f * row[WX + j] * row[NORMAL + k]
            out[q - 1 + j, k] -= f * row[WY + j] * row[NORMAL + k]


@inner
def add_product(row, x, out):
    """Add the second derivative of a point's energy times x (N+1, 3) to out (N+1, 3)."""
    p, q = int(row[P]), int(row[Q])
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    z0, z1, z2, rate = 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        a, b, c = row[WX + j], row[WY + j], row[RATES + j]
        x0, x1, x2 = x[q - 1 + j, 0], x[q - 1 + j, 1], x[q - 1 + j, 2]
        z0 += a * x[p - 1 + j, 0] - b * x0
        z1 += a * x[p - 1 + j, 1] - b * x1
        z2 += a * x[p - 1 + j, 2] - b * x2
        rate -= c * (n[0] * x0 + n[1] * x1 + n[2] * x2)
    normal = n[0] * z0 + n[1] * z1 + n[2] * z2
    more = (row[ALONG] - row[ACROSS]) * normal
    f0, f1, f2 = row[ACROSS] * z0 + more * n[0], row[ACROSS] * z1 + more * n[1], row[ACROSS] * z2 + more * n[2]
    y0, y1, y2 = row[SLOPE], row[SLOPE + 1], row[SLOPE + 2]
    moved = row[FORCE] * row[FORCE] * row[FOLLOWS] * (rate - (y0 * z0 + y1 * z1 + y2 * z2))
    # b = phi' (-J^T y'/d + J_v^T n): of x the weight of y', of the nodes of y also that of n
    f0, f1, f2 = f0 + moved * y0, f1 + moved * y1, f2 + moved * y2
    for j in range(3):
        a, b, c = row[WX + j], row[WY + j], moved * row[RATES + j]
        out[p - 1 + j, 0] += a * f0
        out[p - 1 + j, 1] += a * f1
        out[p - 1 + j, 2] += a * f2
        out[q - 1 + j, 0] += c * n[0] - b * f0
        out[q - 1 + j, 1] += c * n[1] - b * f1
        out[q - 1 + j, 2] += c * n[2] - b * f2


SAME_PLACE = 1e-6  # diameters between sample points that are the same
NEAREST = 0.13  # diameters from a place to the nearest of sample points that are a quarter of a diameter apart
FOLLOWED = 4.0  # diameters that the foot of a point may go in a step without losing its travel
# Columns of the friction of a point of contact.
HELD = 0  # 3, force on strand p, N
SLIDING = 3  # 3, direction
GIVES = 6  # its stiffness, N/m
SLIDES = 7  # coefficient where it slides, else 0
TRAVEL = 8  # 2, along and across strand p, m
# And of the iteration before in the same try.
TRY = 10  # number of the try
WHO = 11  # its point, as piece and place in it,
WHOSE = 12  # and the piece of the foot
BEFORE = 13  # 3, shift of the surfaces, m
TURNS_BACK = 16  # 1 where that has turned back, and friction is taken as viscous
# What the change of friction by the shape needs.
SHUT = 17  # shift of the surfaces along n, m
OPENS = 18  # 3, change of y' in the step, m
TURNED = 21  # 3, turn of both strands in it, rad
ASIDE = 24  # 3, n x travel from before, m
ABOUT = 27  # 3, turn of the axes along and across about n by a change of y'
LEANS = 30  # slope of strand p along n
HOLD = 31
# How a point turns with one of its four cells.
CHORD = 0  # 3
LONGER = 3  # 3, what the cell has become longer in the step, m
INVERSE = 6  # of its length, 1/m
SHARE = 7  # its part in the turn, times b
SPUN = 8  # its spin in the step, rad
SPINS = 9  # 1 where it has one
ARM = 10
SHRINKS = 0.9  # part to which a shift falls that goes to none; one that falls by less slides indeed
# What is kept of it from step to step.
PIECE = 0
AT = 1  # arc length of the point, m
FOOT = 2  # and of its foot, m
TRAVELLED = 3  # 2, m
KEPT_SPRING = 5  # N/m
GRIP = 6


@inner
def arc_length(line, kind, p, u):
    """Arc length, m, at u of piece p."""
    w = spline_weights(kind, p, u)
    return w[0] * line.s[p - 1] + w[1] * line.s[p] + w[2] * line.s[p + 1]


@inner
def lever(contact, own, other):
    """b of a strand at its piece `own` on the piece `other`: its part of their distance from axis to axis, twice."""
    return 2.0 * (contact.width[own] / (contact.width[own] + contact.width[other]))


@inner
def keep_arms(line, contact, k):
    """How point k turns with its strands: of the two cells beside each, what contact.arms holds."""
    row, at, x = contact.points[k], contact.at, contact.x
    for j in range(4):
        node, u = int(row[P if j < 2 else Q]), row[PLACE if j < 2 else FOOT_PLACE]
        c, part = node - 1 + j % 2, (u if j % 2 == 1 else 1.0 - u) * lever(contact, node, int(row[Q if j < 2 else P]))
        d, _, il = chord(sub(get3(at, c + 1), get3(at, c)))
        longer, arm = sub(get3(x, c + 1), get3(x, c)), contact.arms[k, j]
        for m in range(3):
            arm[CHORD + m], arm[LONGER + m] = d[m], longer[m]
        arm[INVERSE], arm[SHARE], arm[SPUN] = il, part, x[c, 3]
        arm[SPINS] = 1.0 if line.spin[c] else 0.0


@inner
def turn_of(arm, x, c):
    """The part that cell c has in the turn of its strand by x (N+1, 4): shifts of nodes and spins of cells."""
    d = vector(arm, CHORD)
    bent = scale(arm[INVERSE], cross(d, sub(get3(x, c + 1), get3(x, c))))
    return scale(arm[SHARE], add(bent, scale(x[c, 3], d)))


@inner
def turn_of_strands(contact, k, x):
    """The turn of both strands at point k by x, one and the other together, each times its b."""
    p, q, arms = int(contact.points[k, P]), int(contact.points[k, Q]), contact.arms[k]
    first = add(turn_of(arms[0], x, p - 1), turn_of(arms[1], x, p))
    return add(first, add(turn_of(arms[2], x, q - 1), turn_of(arms[3], x, q)))


@inner
def way_apart(row, x):
    """How x (N+1, 4) shifts the centre lines of the strands against each other at a point."""
    return sub(spline_point(x, int(row[P]), vector(row, WX)), spline_point(x, int(row[Q]), vector(row, WY)))


@inner
def load_turn(arm, m, c, out):
    """Add the part that cell c has of a moment m (N m) on its strand to out (N+1, 4): forces on nodes, moments on cells."""
    d = vector(arm, CHORD)
    couple = scale(arm[SHARE] * arm[INVERSE], cross(m, d))
    for k in range(3):
        out[c + 1, k] += couple[k]
        out[c, k] -= couple[k]
    out[c, 3] += arm[SPINS] * arm[SHARE] * dot(m, d)


@inner
def load_turns(contact, k, m, out):
    """Add a moment m (N m) on both strands of point k to out (N+1, 4)."""
    p, q, arms = int(contact.points[k, P]), int(contact.points[k, Q]), contact.arms[k]
    load_turn(arms[0], m, p - 1, out)
    load_turn(arms[1], m, p, out)
    load_turn(arms[2], m, q - 1, out)
    load_turn(arms[3], m, q, out)


@inner
def change_of_turn(arm, x, c, wins):
    """Change, by a change x of shifts and spins, of the part that cell c had in the turn of its strand in the step.

    wins: by how much its part grows.
    """
    d, il, longer = vector(arm, CHORD), arm[INVERSE], vector(arm, LONGER)
    more = sub(get3(x, c + 1), get3(x, c))
    turned = scale(il, sub(more, scale(dot(d, more), d)))
    inverse = scale(il, sub(turned, scale(il * dot(d, more), d)))
    change = add(cross(inverse, longer), scale(arm[SPUN], turned))
    had = add(scale(il, cross(d, longer)), scale(arm[SPUN], d))
    return add(scale(arm[SHARE], change), scale(wins, had))


@inner
def load_change(arm, m, x, c, wins, out):
    """Add the change, by x, of what the part of cell c of a moment m is to out, m being kept; wins: as above."""
    d, il = vector(arm, CHORD), arm[INVERSE]
    more = sub(get3(x, c + 1), get3(x, c))
    turned = scale(il, sub(more, scale(dot(d, more), d)))
    inverse = scale(il, sub(turned, scale(il * dot(d, more), d)))
    couple = cross(m, add(scale(arm[SHARE], inverse), scale(wins * il, d)))
    for k in range(3):
        out[c + 1, k] += couple[k]
        out[c, k] -= couple[k]
    out[c, 3] += arm[SPINS] * dot(m, add(scale(arm[SHARE], turned), scale(wins, d)))


@inner
def directions(contact, row):
    """Two directions normal to n, the first as near to strand p as can be; x' of that, m, 0: it ends on the other."""
    p = int(row[P])
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    at = contact.at
    before, after = end_slopes(contact.kind, at, p)
    t = slope(before, after, row[PLACE])
    size = math.sqrt(dot(t, t))
    t = sub(t, scale(dot(t, n), n))
    if not dot(t, t) > 1e-6 * size * size:  # the strand ends on the other: any direction does
        t, size = (n[1], -n[0], 0.0) if abs(n[2]) < 0.7 else (0.0, n[2], -n[1]), 0.0
    within = math.sqrt(dot(t, t))
    t = scale(1.0 / within, t)
    return t, cross(n, t), within, size


@inner
def find_grip(line, contact, row, other_cells):
    """The travel kept of a point, along and across strand p, from the nearest that was on the same strand; 0: none.

    other_cells: whether the line has other cells than when travels were kept: the nearest is then half the distance of
    two sample points away at most.
    """
    p, width = int(row[P]), contact.width[int(row[P])]
    at = arc_length(line, contact.kind, p, row[PLACE])
    foot = arc_length(line, contact.kind, int(row[Q]), row[FOOT_PLACE])
    along, across, least = 0.0, 0.0, FOLLOWED * width
    beside, within = (1, NEAREST) if other_cells else (0, SAME_PLACE)
    for piece in range(max(p - beside, 1), min(p + beside + 1, contact.heads.shape[0] - 1)):
        k = contact.heads[piece]
        while k >= 0:
            grip = contact.grips[k]
            aside = abs(grip[AT] - at)
            apart = abs(grip[FOOT] - foot) + (aside if other_cells else 0.0)
            if aside < within * width and apart < least:
                least = apart
                along, across = grip[TRAVELLED], grip[TRAVELLED + 1]
            k = contact.links[k]
    return along, across


@inner
def turns_back(row, hold, trial, slides, number):
    """1 where the shift of a point has turned back in the iterations of a try, until it shrinks no more; keeps it.

    Sliding friction has no stiffness along the shift: Newton's method goes beyond no shift at all, and back.
    """
    who, whose, back = row[P] + row[PLACE], row[Q], 0.0
    if hold[TRY] == number and hold[WHO] == who and hold[WHOSE] == whose:
        before = (hold[BEFORE], hold[BEFORE + 1], hold[BEFORE + 2])
        back = hold[TURNS_BACK]
        if slides:
            if dot(trial, before) < 0.0:
                back = 1.0
            elif dot(trial, trial) > SHRINKS * SHRINKS * dot(before, before):
                back = 0.0
    hold[TRY], hold[WHO], hold[WHOSE] = number, who, whose
    for k in range(3):
        hold[BEFORE + k] = trial[k]
    return back


@inner
def hold_point(line, contact, k, friction, number, other_cells):
    """Friction of point k of contact at the shifts and spins contact.x; its work in the step, and its energy (J).

    number: of the try; other_cells: as in `find_grip`.
    """
    row, hold = contact.points[k], contact.holds[k]
    keep_arms(line, contact, k)
    first, second, within, size = directions(contact, row)
    along, across = find_grip(line, contact, row, other_cells)
    n, q = vector(row, NORMAL), int(row[Q])
    apart, turned = way_apart(row, contact.x), turn_of_strands(contact, k, contact.x)
    shift = sub(apart, scale(0.5 * row[DISTANCE], cross(turned, n)))
    g = sub(shift, scale(dot(shift, n), n))
    kept = add(scale(along, first), scale(across, second))
    trial = add(g, kept)
    opens = spline_point(contact.x, q, vector(row, RATES))
    aside = cross(n, kept)
    hold[SHUT] = dot(shift, n)
    lean = 0.0
    if size > 0.0:
        before, after = end_slopes(contact.kind, contact.at, int(row[P]))
        lean = dot(slope(before, after, row[PLACE]), n)
    hold[LEANS] = lean
    for j in range(3):
        hold[OPENS + j], hold[TURNED + j], hold[ASIDE + j] = opens[j], turned[j], aside[j]
        hold[ABOUT + j] = second[j] / within if size > 0.0 else 0.0
    size, spring, most = math.sqrt(dot(trial, trial)), row[SPRING], -friction * row[FORCE]
    hold[GIVES], hold[SLIDES], part = spring, 0.0, 1.0
    if spring * size > most:
        part = most / (spring * size)
        hold[GIVES], hold[SLIDES] = part * spring, friction
    hold[TURNS_BACK] = turns_back(row, hold, trial, hold[SLIDES] > 0.0, number)
    travel = scale(part, trial)
    for j in range(3):
        hold[HELD + j] = -spring * travel[j]
        hold[SLIDING + j] = trial[j] / size if size > 0.0 else 0.0
    hold[TRAVEL], hold[TRAVEL + 1] = dot(travel, first), dot(travel, second)
    return -spring * dot(travel, g), 0.5 * spring * dot(travel, travel)


@inner
def add_held(contact, k, out):
    """Add the friction of point k, with the opposite sign, to out (N+1, 4)."""
    row, f = contact.points[k], scale(-1.0, vector(contact.holds[k], HELD))
    p, q = int(row[P]), int(row[Q])
    for j in range(3):
        for m in range(3):
            out[p - 1 + j, m] += row[WX + j] * f[m]
            out[q - 1 + j, m] -= row[WY + j] * f[m]
    load_turns(contact, k, scale(-0.5 * row[DISTANCE], cross(vector(row, NORMAL), f)), out)


@inner
def add_held_product(contact, k, x, out):
    """Add the change of that by x (N+1, 4) to out (N+1, 4)."""
    row, hold, arms = contact.points[k], contact.holds[k], contact.arms[k]
    p, q, n, y, d = int(row[P]), int(row[Q]), vector(row, NORMAL), vector(row, SLOPE), row[DISTANCE]
    t, gives, force = vector(hold, SLIDING), hold[GIVES], scale(-1.0, vector(hold, HELD))
    z, theta = way_apart(row, x), turn_of_strands(contact, k, x)
    nearer = dot(z, n)
    b = lever(contact, q, p)
    dv = row[FORCE] * row[FOLLOWS] * (dot(y, z) + dot(n, spline_point(x, q, vector(row, RATES))))
    theta = add(theta, add(change_of_turn(arms[0], x, p - 1, 0.0), change_of_turn(arms[1], x, p, 0.0)))
    theta = add(theta, add(change_of_turn(arms[2], x, q - 1, -b * dv), change_of_turn(arms[3], x, q, b * dv)))
    away = sub(z, scale(d * dv, y))
    dn = scale(1.0 / d, sub(away, scale(nearer, n)))
    g = sub(z, scale(0.5 * d, cross(theta, n)))
    g = sub(g, add(scale(dv, vector(hold, OPENS)), scale(0.5, cross(vector(hold, TURNED), away))))
    g = sub(g, scale(hold[SHUT], dn))
    before, after = end_slopes(contact.kind, x, p)
    about = dot(vector(hold, ABOUT), sub(slope(before, after, row[PLACE]), scale(hold[LEANS], dn)))
    g = add(g, scale(about, vector(hold, ASIDE)))
    g = sub(g, scale(dot(g, n), n))
    f = scale(gives, g)
    if hold[SLIDES] > 0.0:
        along = 0.0 if hold[TURNS_BACK] > 0.0 else gives * dot(t, g)
        f = sub(f, scale(along + hold[SLIDES] * row[ALONG] * nearer, t))
    f = sub(f, scale(dot(force, dn), n))
    for j in range(3):
        for m in range(3):
            out[p - 1 + j, m] += row[WX + j] * f[m]
            out[q - 1 + j, m] -= row[WY + j] * f[m] + row[RATES + j] * dv * force[m]
    moment = scale(-0.5 * d, cross(n, force))
    load_turns(contact, k, scale(-0.5, add(cross(away, force), scale(d, cross(n, f)))), out)
    load_change(arms[0], moment, x, p - 1, 0.0, out)
    load_change(arms[1], moment, x, p, 0.0, out)
    load_change(arms[2], moment, x, q - 1, -b * dv, out)
    load_change(arms[3], moment, x, q, b * dv, out)


@inner
def keep_grips(line, contact, count):
    """Write what is to be kept of the friction of `count` points into contact.fresh."""
    for k in range(count):
        row, hold, grip = contact.points[k], contact.holds[k], contact.fresh[k]
        grip[PIECE], grip[AT] = row[P], arc_length(line, contact.kind, int(row[P]), row[PLACE])
        grip[FOOT] = arc_length(line, contact.kind, int(row[Q]), row[FOOT_PLACE])
        grip[TRAVELLED], grip[TRAVELLED + 1], grip[KEPT_SPRING] = hold[TRAVEL], hold[TRAVEL + 1], row[SPRING]


@inner
def link_grips(contact, count):
    """Chain the grips of every piece, so that they are found."""
    for p in range(contact.heads.shape[0]):
        contact.heads[p] = -1
    for k in range(count):
        p = int(contact.grips[k, PIECE])
        contact.links[k], contact.heads[p] = contact.heads[p], k
