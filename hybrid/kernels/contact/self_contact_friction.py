"""Friction where a line touches itself: an elastic travel at every point of contact, forces and moments on both strands.

The strands touch where the line from x to y is parted as their diameters D_p and D_q are, halfway for equal ones.  In a
step their surfaces shift against each other there by

    g = P (W_x u_p - W_y u_q - (d/2) (b_p phi_p + b_q phi_q) x n),    P = 1 - n n^T,    b_p = 2 D_p/(D_p + D_q)

with the displacements u of the nodes and the rotation phi = psi d + d x de/l of each strand, between those of the two
cells of a piece.  The travel q of a point, kept along and across strand p, becomes q + g, with the force -k q on p and
k q on q; where that is more than mu N it slides, and q keeps mu N/k.  So nothing creeps, and nothing gives back more
than it has stored.  Off the centre lines the force is a force f on the centre line and a moment -(d/2) b n x f on each
strand, along the chord into the balance of spin, across it as a couple: no angular momentum is lost.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub, vector
from hybrid.kernels.contact.self_contact_law import (
    ALONG,
    DISTANCE,
    FOLLOWS,
    FOOT_PLACE,
    FORCE,
    NORMAL,
    PLACE,
    RATES,
    SLOPE,
    SPRING,
    WX,
    WY,
    P,
    Q,
    end_slopes,
    slope,
    spline_point,
    spline_weights,
)
from hybrid.kernels.laws.cell import chord
from hybrid.kernels.machine.compile import inner

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
