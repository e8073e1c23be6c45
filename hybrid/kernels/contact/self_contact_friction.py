"""Friction where a line touches itself: an elastic travel at every point of contact, forces and moments on both strands.

The strands touch halfway between x and y.  In a step their surfaces shift against each other there by

    g = P (W_x u_p - W_y u_q - (d/2) (phi_p + phi_q) x n),    P = 1 - n n^T

with the displacements u of the nodes and the rotation phi = psi d + d x de/l of each strand, between those of the two
cells of a piece.  The travel q of a point, kept along and across strand p, becomes q + g, with the force -k q on p and
k q on q; where that is more than mu N it slides, and q keeps mu N/k.  So nothing creeps, and nothing gives back more
than it has stored.  Off the centre lines the force is a force f on the centre line and a moment -(d/2) n x f on both
strands, along the chord into the balance of spin, across it as a couple: no angular momentum is lost.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub
from hybrid.kernels.contact.self_contact_law import (
    ALONG,
    DISTANCE,
    FOOT_PLACE,
    FORCE,
    NORMAL,
    PLACE,
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
# Friction of a point of contact: force on strand p (N); direction of sliding; its stiffness (N/m); the coefficient where
# it slides, else 0; travel along and across strand p (m).
HELD, SLIDING, GIVES, SLIDES, TRAVEL = 0, 3, 6, 7, 8
# And of the iteration before in the same try: number of the try; its point, as piece and place in it, and the piece of
# the foot; what the surfaces were shifted by (m); 1 where that has turned back, and friction is taken as viscous.
TRY, WHO, WHOSE, BEFORE, TURNS_BACK = 10, 11, 12, 13, 16
HOLD = 17
SHRINKS = 0.9  # part to which a shift falls that goes to none; one that falls by less slides indeed
# What is kept of it from step to step: piece; arc lengths of the point and of its foot (m); travel (m); spring (N/m).
PIECE, AT, FOOT, TRAVELLED, KEPT_SPRING = 0, 1, 2, 3, 5
GRIP = 6


@inner
def arc_length(line, kind, p, u):
    """Arc length, m, at u of piece p."""
    w = spline_weights(kind, p, u)
    return w[0] * line.s[p - 1] + w[1] * line.s[p] + w[2] * line.s[p + 1]


@inner
def turn_of(at, x, p, u):
    """Rotation of the strand at u of piece p by x (N+1, 4): shifts of nodes and spins of cells."""
    total = (0.0, 0.0, 0.0)
    for j in range(2):
        c, part = p - 1 + j, u if j == 1 else 1.0 - u
        d, _, il = chord(sub(get3(at, c + 1), get3(at, c)))
        bent = scale(il, cross(d, sub(get3(x, c + 1), get3(x, c))))
        total = add(total, scale(part, add(bent, scale(x[c, 3], d))))
    return total


@inner
def shift_of(contact, row, x):
    """How x (N+1, 4) shifts the surfaces of the strands against each other at a point, and their centre lines."""
    p, q = int(row[P]), int(row[Q])
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    apart = sub(
        spline_point(x, p, (row[WX], row[WX + 1], row[WX + 2])), spline_point(x, q, (row[WY], row[WY + 1], row[WY + 2]))
    )
    turned = add(turn_of(contact.at, x, p, row[PLACE]), turn_of(contact.at, x, q, row[FOOT_PLACE]))
    g = sub(apart, scale(0.5 * row[DISTANCE], cross(turned, n)))
    return sub(g, scale(dot(g, n), n)), dot(apart, n)


@inner
def load_turn(line, at, m, p, u, out):
    """Add a moment m (N m) on the strand at u of piece p to out (N+1, 4): forces on nodes, moments on cells."""
    for j in range(2):
        c, part = p - 1 + j, u if j == 1 else 1.0 - u
        d, _, il = chord(sub(get3(at, c + 1), get3(at, c)))
        couple = scale(part * il, cross(m, d))
        for k in range(3):
            out[c + 1, k] += couple[k]
            out[c, k] -= couple[k]
        if line.spin[c]:
            out[c, 3] += part * dot(m, d)


@inner
def load(line, contact, row, f, out):
    """Add what a force f (N) on strand p, and its opposite on strand q, are on nodes and cells to out (N+1, 4)."""
    p, q = int(row[P]), int(row[Q])
    for j in range(3):
        for k in range(3):
            out[p - 1 + j, k] += row[WX + j] * f[k]
            out[q - 1 + j, k] -= row[WY + j] * f[k]
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    m = scale(-0.5 * row[DISTANCE], cross(n, f))
    load_turn(line, contact.at, m, p, row[PLACE], out)
    load_turn(line, contact.at, m, q, row[FOOT_PLACE], out)


@inner
def directions(contact, row):
    """Two directions normal to n, the first as near to strand p as can be."""
    p = int(row[P])
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    at = contact.at
    before, after = end_slopes(contact.kind, at, p)
    t = slope(before, after, row[PLACE])
    size = math.sqrt(dot(t, t))
    t = sub(t, scale(dot(t, n), n))
    if not dot(t, t) > 1e-6 * size * size:  # the strand ends on the other: any direction does
        t = (n[1], -n[0], 0.0) if abs(n[2]) < 0.7 else (0.0, n[2], -n[1])
    t = scale(1.0 / math.sqrt(dot(t, t)), t)
    return t, cross(n, t)


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
def hold_point(line, contact, friction, row, hold, number, other_cells):
    """Friction of a point of contact at the shifts and spins contact.x; its work in the step, and its energy (J).

    number: of the try; other_cells: as in `find_grip`.
    """
    first, second = directions(contact, row)
    along, across = find_grip(line, contact, row, other_cells)
    g, _ = shift_of(contact, row, contact.x)
    trial = add(g, add(scale(along, first), scale(across, second)))
    size, spring, most = math.sqrt(dot(trial, trial)), row[SPRING], -friction * row[FORCE]
    hold[GIVES], hold[SLIDES], part = spring, 0.0, 1.0
    if spring * size > most:
        part = most / (spring * size)
        hold[GIVES], hold[SLIDES] = part * spring, friction
    hold[TURNS_BACK] = turns_back(row, hold, trial, hold[SLIDES] > 0.0, number)
    travel = scale(part, trial)
    for k in range(3):
        hold[HELD + k] = -spring * travel[k]
        hold[SLIDING + k] = trial[k] / size if size > 0.0 else 0.0
    hold[TRAVEL], hold[TRAVEL + 1] = dot(travel, first), dot(travel, second)
    return -spring * dot(travel, g), 0.5 * spring * dot(travel, travel)


@inner
def add_held(line, contact, k, out):
    """Add the friction of point k, with the opposite sign, to out (N+1, 4)."""
    hold = contact.holds[k]
    load(line, contact, contact.points[k], (-hold[HELD], -hold[HELD + 1], -hold[HELD + 2]), out)


@inner
def add_held_product(line, contact, k, x, out):
    """Add the change of that by x (N+1, 4), directions and places being kept, to out (N+1, 4)."""
    row, hold = contact.points[k], contact.holds[k]
    g, nearer = shift_of(contact, row, x)
    t = (hold[SLIDING], hold[SLIDING + 1], hold[SLIDING + 2])
    gives = hold[GIVES]
    f = scale(gives, g)
    if hold[SLIDES] > 0.0:
        along = 0.0 if hold[TURNS_BACK] > 0.0 else gives * dot(t, g)
        f = sub(f, scale(along + hold[SLIDES] * row[ALONG] * nearer, t))
    load(line, contact, row, f, out)


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
