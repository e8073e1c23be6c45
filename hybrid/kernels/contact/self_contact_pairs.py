"""Contact of lines with themselves and each other: pairs of pieces that are near, limits of corrections, points.

The lines that may touch stand one after the other as one, their nodes and cells in rows; of one line alone there is
that.  Between two lines is a cell that is none: no piece has it, and what follows another line is no way along a line.

A run has the force per length of all contact at every node, of outputs, too.  What each pair of lines has of it follows
from the same points of contact at the positions of an output, with a law of size 1 N and without friction.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.kept_factors import SWEEP
from hybrid.kernels.algebra.rotations import add, dot, get3, scale, sub
from hybrid.kernels.contact.self_contact_law import (
    ARM,
    DISTANCE,
    FIRST,
    FORCE,
    GRIP,
    HOLD,
    INNER,
    LAST,
    OUTER,
    POINT,
    WITHIN,
    Foot,
    P,
    Q,
    end_factors,
    foot,
    note_point,
    spline_point,
    spline_weights,
)
from hybrid.kernels.contact.self_distance import (
    DEPTH,
    LEAF,
    NEIGHBOURS,
    TURNED,
    box_distance,
    fill_parents,
    nearest_feet,
    runs_on,
)
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.machine.references import NamedNumbers, by_reference, reader
from hybrid.kernels.state.books import RATES
from hybrid.kernels.state.state import Ends, Floats, Line, Rows, blanks
from hybrid.kernels.step.line_step import COUPLE, SAFE_PART

WINDOW = 2.7  # diameters of arc length within which pieces are neighbours: TURNED of it is more than OUTER
SAFE = 0.8  # part of the way to where the force is infinite that a correction may go
IMPACT = 25.0  # size of the law over m' v^2 in a collision at the speed v
# The speed of the law falls by half while strands go so many diameters at it: a collision takes two or three.
FADES = 10.0
# Vibrations that contact leaves are damped for so many steps after it (rho_inf 0), then less and less over so many more:
# of 400 random throws one or two in a hundred then gain energy; without, or with 4 and 8, those that gain are more.
CALMS, RETURNS = 10.0, 20.0
MOST_PRODUCTS = 60  # of GMRES
PAIRS_OF_NODE = 8  # that are kept at most
LEAST_KEEPS = 0.05  # diameters, of KEEPS
FAR = 2.0  # diameters within which parts of the line are near each other
LEAST_NEAR, FORESEEN = 0.5, 2.0  # of `near`: what is looked for; the most of what is only foreseen
# Diameters up to which points of an output count, beyond where the law begins: by FAINT of it.  Within a step positions
# and forces lie on different curves, and what a node bears may have no point at which strands touch.
BEYOND = 1.15
FAINT = 1e-6  # also the part of the way from INNER to OUTER in which the law grows no more
# phi' of `barrier` at the end of that part, of the size 1 N, over the length of the way.
STEEPEST = 2.0 * (FAINT - 1.0) * math.log(FAINT) + (FAINT - 1.0) ** 2 / FAINT


class ContactNumbers(NamedNumbers):
    """What contact knows of its law, of the step, and of energy."""

    part: float  # of a correction that is safe
    energy: float  # J, of contact
    speed: float  # m/s, of the law: with which pieces met; it fades while they touch
    widest: float
    narrowest: float  # m, diameters
    reach: float  # m, distance within which pairs are looked at
    friction: float  # coefficient of friction; 0: none
    stored: float  # J, in the travels that are kept
    tried: float  # J, in those that the last try has led to
    since: float  # s, time that the try led to
    slip_work: float  # J, of friction in the step
    horizon: float  # s, for which it is foreseen how near the line comes to itself; 0: not asked
    keeps: float  # m, for displacements up to which the pairs kept are all that there are; < 0: none are kept
    rolls: float  # 1 where friction turns any line about itself (`rolls`)
    faded: float  # s, time up to which SPEED has faded; nan: it has not begun
    quiet: float  # steps since the last one that was near contact
    tries: float  # of steps so far
    begun: float  # s, times of the states of HAD and HAS; nan: of none
    led: float
    had: float  # J, energy before the step, without that of weight, and where the try has led
    has: float
    balance: float  # J, put in by steps so far though no work accounts for it, likewise
    tried_balance: float
    largest: float  # J, the largest of HAD so far
    gained: float  # tries that were given up because they put energy in


# Of `shares`: energy of contact with other lines, and of a line with itself; in travels of friction likewise; work of
# friction of a line on itself in the step.
BETWEEN, WITHIN_LINE, HELD_BETWEEN, HELD_WITHIN, SLIP_WITHIN = range(5)
SHARES = 5
WATCH, COLLECT = -1, -2  # beside SAFE_PART and COUPLE: how near the line is to itself; keep pairs for all of a step


class ContactCounts(NamedNumbers, number=np.int64):
    """Sizes, flags and counts of the search for pairs.

    stale: the tree is of other positions; remeshed: the grips are of other cells; looks: sample points, and parts of
    pieces, that were searched in the try; products: of GMRES in it.
    """

    points: int
    nodes: int
    overflow: int
    grips: int
    fresh: int
    pairs: int
    stale: int
    remeshed: int
    looks: int
    products: int


FEW = 16  # sample points of a piece that are looked at without asking which may be within reach


class Contact(NamedTuple):
    """What contact works with; N cells, pieces 1 to N-1; L lines."""

    kind: NDArray[np.int64]  # (N+1,) whether a node is the first or last of its line (self_contact_law)
    of: NDArray[np.int64]  # (N+1,) the number of its line
    rolls: Floats  # (N+1,) 1 where friction turns the line about itself; 0: nothing holds its spin, and it is left out
    meets: NDArray[np.int64]  # (L, L) whether two lines, or a line and itself, may touch
    rubs: Floats  # (L, L) coefficients of friction
    joined: NDArray[np.int64]  # (L, 2) what the ends are joined to; those of the same number >= 0 are beside each other
    tips: NDArray[np.int64]  # (L, 2) its first and last node
    shares: Floats  # (L, SHARES) J, energy and work of contact: half of a point between two lines is of each

    width: Floats  # (N+1,) m, diameters of pieces
    samples: NDArray[np.int64]  # (N+1,) sample points of pieces
    stiff: Floats  # (N+1,) N, least size of the law
    mass: Floats  # (N+1,) kg/m
    numbers: ContactNumbers
    counts: ContactCounts
    tree: Floats  # as kernels.contact.self_distance has it, of pieces
    stack: NDArray[np.int64]
    pairs: NDArray[np.int64]  # (L, 2) pieces that may come near each other in a step
    at: Floats  # (N+1, 3) m, nodes
    move: Floats  # (N+1, 3) m, the correction that is to be limited
    near: Floats  # (N+1,) FAR diameters over the distance to other parts of the line, now or foreseen
    points: Floats  # (C, POINT)
    nodes: NDArray[np.int64]  # (N+1,) those in contact
    marks: NDArray[np.int64]  # (N+1,) 1 for those
    energy: Floats  # (5,) J, as kernels.march.energies has it
    power: Floats  # (RATES,) W, where the try has led
    x: Floats  # (N+1, 4) m, displacements in products, and spins of cells, rad
    y: Floats  # (N+1, 4) N, N m
    z: Floats  # (N+1, 5) right-hand side of nodes in contact, and its solution
    sweep: Floats  # (N+1, SWEEP) of the matrix, as kernels.algebra.kept_factors.sweep takes it
    basis: Floats  # (MOST_PRODUCTS + 1, 3 (N+1)); of spins as well with friction: 4 (N+1)
    hessenberg: Floats  # (MOST_PRODUCTS + 1, MOST_PRODUCTS + 4): columns, rotations (2), right-hand side, solution
    # with friction (kernels.contact.self_contact_law); else no rows
    holds: Floats  # (C, HOLD) of the points of contact
    arms: Floats  # (C, 4, ARM) how these turn with their cells
    grips: Floats  # (C, GRIP) what has been kept of the last step
    fresh: Floats  # (C, GRIP) what is kept if the try is taken
    heads: NDArray[np.int64]  # (N+1,) the first grip of a piece, -1: none
    links: NDArray[np.int64]  # (C,) the next of the same piece


def blank_contact(cells: int, points: int = 1, friction: bool = False, lines: int = 1) -> Contact:
    """For lines of so many cells, with room for so many points of contact, with friction or without.

    Nodes are those of one line.
    """
    z, nodes = np.zeros, cells + 1
    held, leaves = points if friction else 0, 1
    while leaves * LEAF < nodes:
        leaves *= 2
    shapes: dict[str, Any] = {"meets": (lines, lines), "joined": (lines, 2), "tips": (lines, 2)}
    shapes |= {"stack": (4 * DEPTH, 2), "pairs": (PAIRS_OF_NODE * nodes, 2), "links": held}
    shapes |= dict.fromkeys(("kind", "of", "samples", "nodes", "marks", "heads"), nodes)
    whole: dict[str, Any] = {name: z(shape, np.int64) for name, shape in shapes.items()}
    whole["kind"][0], whole["kind"][-1], whole["meets"][:], whole["joined"][:] = FIRST, LAST, 1, -1
    whole["samples"][:] = 1
    shapes = {"rubs": (lines, lines), "shares": (lines, SHARES), "tree": (2 * leaves, 12), "points": (points, POINT)}
    shapes |= {"at": (nodes, 3), "move": (nodes, 3), "x": (nodes, 4), "y": (nodes, 4), "z": (nodes, 5), "energy": 5}
    shapes |= dict.fromkeys(("rolls", "width", "stiff", "mass", "near"), nodes)
    shapes |= {"power": RATES, "sweep": (nodes, SWEEP), "hessenberg": (MOST_PRODUCTS + 1, MOST_PRODUCTS + 4)}
    shapes |= {"basis": (MOST_PRODUCTS + 1, (4 if friction else 3) * nodes), "holds": (held, HOLD)}
    shapes |= {"arms": (held, 4, ARM), "grips": (held, GRIP), "fresh": (held, GRIP)}
    real: dict[str, Any] = {name: z(shape) for name, shape in shapes.items()}
    return Contact(numbers=ContactNumbers(), counts=ContactCounts(), **whole, **real)


by_reference(blank_contact(1))


@inner
def hull(kind, r, p, k):
    """Coordinate k of the three points in whose triangle piece p lies."""
    first = r[p - 1, k] if kind[p - 1] == FIRST else 0.5 * (r[p - 1, k] + r[p, k])
    last = r[p + 1, k] if kind[p + 1] == LAST else 0.5 * (r[p, k] + r[p + 1, k])
    return first, r[p, k], last


@inner
def fill_tree(kind, tree, r):
    """Boxes of the pieces of nodes at r, a leaf for LEAF nodes.

    One that holds the end of a line beside another has all tangents: a line does not run on there.
    """
    leaves, n = tree.shape[0] // 2, r.shape[0] - 1
    for q in range(leaves):
        leaf = leaves + q
        for k in range(3):
            tree[leaf, k], tree[leaf, 6 + k] = math.inf, math.inf
            tree[leaf, 3 + k], tree[leaf, 9 + k] = -math.inf, -math.inf
        for i in range(max(q * LEAF, 1), min((q + 1) * LEAF, n)):
            if kind[i] != WITHIN:
                for k in range(3):
                    tree[leaf, 6 + k], tree[leaf, 9 + k] = -1.0, 1.0
                continue
            for j in range(2):
                e = sub(get3(r, i + j), get3(r, i + j - 1))
                f = 1.0 / math.sqrt(dot(e, e))
                for k in range(3):
                    t = f * e[k]
                    tree[leaf, 6 + k], tree[leaf, 9 + k] = min(tree[leaf, 6 + k], t), max(tree[leaf, 9 + k], t)
            for k in range(3):
                a, b, c = hull(kind, r, i, k)
                tree[leaf, k] = min(tree[leaf, k], min(a, min(b, c)))
                tree[leaf, 3 + k] = max(tree[leaf, 3 + k], max(a, max(b, c)))
    fill_parents(tree)


@inner
def hull_distance(kind, r, p, q):
    """Distance, m, of the boxes of two pieces: at most their own, and the less the more a line lies across the axes."""
    square = 0.0
    for k in range(3):
        a, b, c = hull(kind, r, p, k)
        d, e, f = hull(kind, r, q, k)
        x = max(min(a, min(b, c)) - max(d, max(e, f)), min(d, min(e, f)) - max(a, max(b, c)))
        if x > 0.0:
            square += x * x
    return math.sqrt(square)


@inner
def chord_of(kind, r, p):
    """Where piece p begins and ends, and how far, m, it is from the line between these at most."""
    x, y, z = hull(kind, r, p, 0), hull(kind, r, p, 1), hull(kind, r, p, 2)
    a, b, c = (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])
    bend = sub(add(a, c), scale(2.0, b))
    return a, c, 0.25 * math.sqrt(dot(bend, bend))


@inner
def least_distance(kind, r, p, q):
    """What two pieces are apart at least, m, however the line lies."""
    a, c, bow = chord_of(kind, r, p)
    b, d, other = chord_of(kind, r, q)
    along, across = sub(c, a), sub(d, b)
    x, y = nearest_feet(a, along, b, across)
    away = sub(add(a, scale(x, along)), add(b, scale(y, across)))
    return math.sqrt(dot(away, away)) - bow - other


@inner
def are_beside(line, contact, p, q, window):
    """Whether two pieces lie by ends that are joined to the same: neighbours along the network, as along a line."""
    a, b = contact.of[p], contact.of[q]
    for j in range(2):
        for k in range(2):
            if contact.joined[a, j] >= 0 and contact.joined[a, j] == contact.joined[b, k]:
                if a == b and j == k:  # the way goes from one end to the other
                    continue
                m, n = contact.tips[a, j], contact.tips[b, k]
                way = abs(line.s[p] - line.s[m]) + abs(line.s[q] - line.s[n])
                if not (abs(p - m) + abs(q - n) > NEIGHBOURS and way > window):
                    return True
    return False


@inner
def may_touch(line, ends, contact, p, q):
    """Whether two pieces, p before q, are no neighbours, neither along the lines nor from one held end to the other."""
    n, of = line.h.shape[0], contact.of[p]
    window = WINDOW * 0.5 * (contact.width[p] + contact.width[q])
    if contact.meets[of, contact.of[q]] == 0:
        return False
    if of != contact.of[q]:
        return not are_beside(line, contact, p, q, window)
    between = line.s[q] - line.s[p]
    if not (q - p > NEIGHBOURS and between > window):
        return False
    if ends.held[0] != 0 and ends.held[1] != 0:
        return p + n - q > NEIGHBOURS and line.s[p] - line.s[0] + line.s[n] - line.s[q] > window
    return not are_beside(line, contact, p, q, window)


@inner
def largest_difference(move, p, q):
    """Largest difference of the displacements of the nodes of two pieces."""
    square = 0.0
    for i in range(p - 1, p + 2):
        for j in range(q - 1, q + 2):
            d = sub(get3(move, i), get3(move, j))
            square = max(square, dot(d, d))
    return math.sqrt(square)


@inner
def is_beyond(kind, r, p, begin, end, q, reach):
    """Whether the part of piece p between two places on it is farther than `reach`, m, from piece q, however these lie."""
    a, c = spline_point(r, p, spline_weights(kind, p, begin)), spline_point(r, p, spline_weights(kind, p, end))
    b = spline_point(r, p, spline_weights(kind, p, 0.5 * (begin + end)))
    bend = sub(b, scale(0.5, add(a, c)))
    first, last, bow = chord_of(kind, r, q)
    along, across = sub(c, a), sub(last, first)
    x, y = nearest_feet(a, along, first, across)
    away = sub(add(a, scale(x, along)), add(first, scale(y, across)))
    return math.sqrt(dot(away, away)) - bow - math.sqrt(dot(bend, bend)) > reach


@inner
def next_sample(contact, p, q, g, reach):
    """The sample point of piece p from g on that may be within `reach`, m, of piece q; their number: none is."""
    kind, r, count = contact.kind, contact.at, contact.samples[p]
    block = count if count <= FEW else math.ceil(math.sqrt(count))  # of sample points that are looked at together
    if block < count:
        while g < count and g % block == 0:
            if not is_beyond(kind, r, p, g / count, min(g + block, count) / count, q, reach):
                break
            g += block
    contact.counts.looks += 1
    return min(g, count)


@called
def limit_part(line, ends, contact, p, q, width, moved):
    """Shorten the part so that no sample point of piece p comes too near piece q by a difference of `moved`, m."""
    kind, r, numbers, count = contact.kind, contact.at, contact.numbers, contact.samples[p]
    reach, g = INNER * width + numbers.part * moved / SAFE, -1
    while True:
        g = next_sample(contact, p, q, g + 1, reach)
        if g == count:
            return
        x = spline_point(r, p, spline_weights(kind, p, (g + 0.5) / count))
        v, side = foot(kind, r, q, x)
        if side != 0 and kind[q + side] == WITHIN:
            beside = q + side
            if not may_touch(line, ends, contact, min(p, beside), max(p, beside)):
                continue
        away = sub(x, spline_point(r, q, spline_weights(kind, q, v)))
        room = max(SAFE * (math.sqrt(dot(away, away)) - INNER * width), 0.0)
        if room < numbers.part * moved:
            numbers.part = room / moved


@inner
def foot_within(kind, r, p, u, q, reach):
    """The foot of the point at u of piece p on piece q, and whether it is within `reach`, m, where no line runs on."""
    x = spline_point(r, p, spline_weights(kind, p, u))
    v, side = foot(kind, r, q, x)
    away = sub(x, spline_point(r, q, spline_weights(kind, q, v)))
    runs = side != 0 and kind[q + side] == WITHIN
    return Foot(q, v, side != 0), not runs and dot(away, away) < reach * reach


@inner
def length_at(line, contact, p, u):
    """Length, m, of a sample point at u of piece p: half of it, since each strand has points."""
    before, after = end_factors(contact.kind, p)
    return 0.5 * ((1.0 - u) * before * line.h[p - 1] + u * after * line.h[p]) / contact.samples[p]


@called
def gather(line, contact, p, q, width):
    """Keep the points of contact of piece p with their feet on piece q."""
    kind, r, counts, numbers = contact.kind, contact.at, contact.counts, contact.numbers
    count, nearest = contact.samples[p], OUTER * width
    fast = IMPACT * numbers.speed * numbers.speed
    size = 0.5 * (max(contact.stiff[p], fast * contact.mass[p]) + max(contact.stiff[q], fast * contact.mass[q]))
    g = -1
    while True:
        g = next_sample(contact, p, q, g + 1, nearest)
        if g == count:
            return
        u = (g + 0.5) / count
        at, touches = foot_within(kind, r, p, u, q, nearest)
        if not touches:
            continue
        if counts.points == contact.points.shape[0]:
            counts.overflow = 1
            return
        row = contact.points[counts.points]
        energy = note_point(kind, r, p, u, at, width, size, length_at(line, contact, p, u), row)
        numbers.energy += energy
        a, b = contact.of[p], contact.of[q]
        contact.shares[a, WITHIN_LINE if a == b else BETWEEN] += 0.5 * energy
        contact.shares[b, WITHIN_LINE if a == b else BETWEEN] += 0.5 * energy
        counts.points += 1


@inner
def note_near(contact, p, q, width):
    """Keep how near the cells after nodes p and q are, now, and at the end of contact.move if they close in."""
    r, near = contact.at, contact.near
    a, b = get3(r, p), get3(r, q)
    d, f = sub(get3(r, p + 1), a), sub(get3(r, q + 1), b)
    x, y = nearest_feet(a, d, b, f)
    away = sub(add(a, scale(x, d)), add(b, scale(y, f)))
    apart = math.sqrt(dot(away, away))
    left = apart - largest_difference(contact.move, p, q)
    ratio = min(FAR * width / left, FORESEEN) if left > 0.0 else FORESEEN
    ratio = max(ratio, FAR * width / apart)
    for i in (p, p + 1, q, q + 1):
        near[i] = max(near[i], ratio)


@inner
def keep_pair(contact, p, q, room):
    """Keep a pair if displacements up to KEEPS use up its room, m."""
    numbers, count = contact.numbers, contact.counts.pairs
    if not room < 2.0 * numbers.keeps:
        return
    if count == contact.pairs.shape[0]:
        numbers.keeps = -1.0
        return
    contact.pairs[count, 0], contact.pairs[count, 1] = p, q
    contact.counts.pairs = count + 1


@called
def examine_pair(line, ends, contact, phase, p, q):
    """What there is to do for pieces p < q that may touch: limit what is asked, or keep points of contact."""
    apart, width = hull_distance(contact.kind, contact.at, p, q), 0.5 * (contact.width[p] + contact.width[q])
    if phase == COLLECT:
        keep_pair(contact, p, q, apart - OUTER * width)
    elif phase == WATCH:
        note_near(contact, p, q, width)
    elif phase == SAFE_PART:
        moved = largest_difference(contact.move, p, q)
        if SAFE * (apart - INNER * width) < contact.numbers.part * moved:
            limit_part(line, ends, contact, p, q, width, moved)
            limit_part(line, ends, contact, q, p, width, moved)
        if apart - moved < OUTER * width and least_distance(contact.kind, contact.at, p, q) - moved < OUTER * width:
            contact.numbers.speed = max(contact.numbers.speed, moved)
    elif apart < OUTER * width:
        gather(line, contact, p, q, width)
        gather(line, contact, q, p, width)


@called
def examine_pairs(line, ends, contact, phase):
    """Look at all pairs of pieces whose boxes are within REACH, in an order that does not depend on anything else.

    Pairs that are kept for displacements up to KEEPS are found where no cone of tangents is so narrow that these could
    not bring it together.
    """
    tree, stack, n = contact.tree, contact.stack, line.h.shape[0]
    leaves, reach, turned = tree.shape[0] // 2, contact.numbers.reach, TURNED
    if phase == COLLECT:
        turned = max(TURNED, (OUTER + 2.0 * contact.numbers.keeps / contact.numbers.narrowest) / WINDOW)
    if contact.counts.stale:
        fill_tree(contact.kind, tree, contact.at)
        contact.counts.stale = 0
    stack[0, 0], stack[0, 1], top = 1, 1, 1
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if (b - a <= 1 and turned < 1.0 and runs_on(tree, a, b, turned)) or not box_distance(tree, a, b) < reach:
            continue
        if a >= leaves:
            first, second = (a - leaves) * LEAF, (b - leaves) * LEAF
            for p in range(max(first, 1), min(first + LEAF, n)):
                for q in range(max(second, p + 1), min(second + LEAF, n)):
                    if contact.kind[p] == WITHIN == contact.kind[q] and may_touch(line, ends, contact, p, q):
                        examine_pair(line, ends, contact, phase, p, q)
            continue
        c, d = 2 * a, 2 * b
        stack[top, 0], stack[top, 1] = c, d
        stack[top + 1, 0], stack[top + 1, 1] = c + 1, d + 1
        stack[top + 2, 0], stack[top + 2, 1] = c, d + 1
        top += 3
        if a != b:
            stack[top, 0], stack[top, 1] = c + 1, d
            top += 1


@inner
def farthest_from_mean(move):
    """The largest difference of a displacement, m, from their mean."""
    n = move.shape[0]
    m0, m1, m2 = 0.0, 0.0, 0.0
    for i in range(n):
        m0, m1, m2 = m0 + move[i, 0], m1 + move[i, 1], m2 + move[i, 2]
    mean, square = (m0 / n, m1 / n, m2 / n), 0.0
    for i in range(n):
        d = sub(get3(move, i), mean)
        square = max(square, dot(d, d))
    return math.sqrt(square)


@inner
def keep_pairs(line, ends, contact):
    """Keep the pairs that twice the displacements contact.move, or a part of a diameter, may bring together."""
    numbers = contact.numbers
    numbers.keeps = max(2.0 * farthest_from_mean(contact.move), LEAST_KEEPS * numbers.widest)
    numbers.reach, contact.counts.pairs = OUTER * numbers.widest + 2.0 * numbers.keeps, 0
    examine_pairs(line, ends, contact, COLLECT)


@inner
def examine_kept(line, ends, contact, phase, gone):
    """Look at the pairs that are kept, or where displacements have gone farther, m, at all."""
    if gone <= contact.numbers.keeps:
        for k in range(contact.counts.pairs):
            examine_pair(line, ends, contact, phase, contact.pairs[k, 0], contact.pairs[k, 1])
    else:
        examine_pairs(line, ends, contact, phase)


@called
def limit(line, ends, contact, gone):
    """The part of contact.move that is safe; SPEED becomes the largest difference of what may come into contact, m.

    gone: m, largest displacement in the step so far.
    """
    numbers, far = contact.numbers, farthest_from_mean(contact.move) / SAFE
    numbers.reach = OUTER * numbers.widest + 2.0 * far
    numbers.part = 1.0
    examine_kept(line, ends, contact, SAFE_PART, gone + far)


@inner
def foresee_nearness(line, ends, contact, v):
    """How near nodes are to other parts of the line, or will be within HORIZON at the velocities v, m/s."""
    numbers, move = contact.numbers, contact.move
    for i in range(v.shape[0]):
        contact.near[i] = 0.0
        for k in range(3):
            move[i, k] = numbers.horizon * v[i, k]
    numbers.reach = FAR / LEAST_NEAR * numbers.widest + 2.0 * farthest_from_mean(move)
    examine_pairs(line, ends, contact, WATCH)


@called
def find_points(line, ends, contact, gone):
    """The points of contact, their energy, and the nodes in contact; gone: m, largest displacement in the step."""
    counts, numbers = contact.counts, contact.numbers
    for k in range(counts.nodes):
        contact.marks[contact.nodes[k]] = 0
    counts.points, counts.nodes, counts.overflow, numbers.energy = 0, 0, 0, 0.0
    for l in range(contact.shares.shape[0]):
        contact.shares[l, BETWEEN], contact.shares[l, WITHIN_LINE] = 0.0, 0.0
    numbers.reach = OUTER * numbers.widest
    examine_kept(line, ends, contact, COUPLE, gone)
    for k in range(counts.points):
        for of in (P, Q):
            p = int(contact.points[k, of])
            for i in range(p - 1, p + 2):
                if contact.marks[i] == 0:
                    contact.marks[i], contact.nodes[counts.nodes] = 1, i
                    counts.nodes += 1


@inner
def first_in_contact(contact, first, n):
    """The first of the n + 1 nodes of a line that is in contact; n + 1: none is.  first: where they begin there."""
    for i in range(n + 1):
        if contact.marks[first + i] != 0:
            return i
    return n + 1


# --- outputs --------------------------------------------------------------------------------------


class PointsJob(NamedTuple):
    """Arguments of `observe_points`."""

    line: Line
    ends: Ends
    contact: Contact
    r: Rows  # (N+1, 3) m, of an output
    touch: Floats  # (N+1,) N/m, of all contact, at the nodes
    points: Rows  # (C, POINT)


read_points = reader(blanks(PointsJob)())


@inner
def bears(job, p):
    """Whether p is a piece whose nodes all bear a force."""
    touch = job.touch
    return job.contact.kind[p] == WITHIN and touch[p - 1] > 0.0 and touch[p] > 0.0 and touch[p + 1] > 0.0


@called
def add_points(job, p, q, count):
    """Enter points of piece p with their feet on piece q behind `count` rows, while there is room; how many there are."""
    contact, r = job.contact, job.r
    width = 0.5 * (contact.width[p] + contact.width[q])
    for g in range(contact.samples[p]):
        u = (g + 0.5) / contact.samples[p]
        at, counts = foot_within(contact.kind, r, p, u, q, BEYOND * width)
        if not counts:
            continue
        if count < job.points.shape[0]:
            row, length = job.points[count], length_at(job.line, contact, p, u)
            note_point(contact.kind, r, p, u, at, width, 1.0, length, row)
            law = length / ((OUTER - INNER) * width)
            row[FORCE] = max(row[FORCE], -law * STEEPEST) - law * FAINT * max(BEYOND - row[DISTANCE] / width, 0.0)
        count += 1
    return count


@kernel
def observe_points(table):
    """Find points of contact of pieces that bear a force; how many there are, also where there is no room for all.

    Of a row of `points` only pieces, weights, normal, places and FORCE are of the law of outputs.
    """
    job, count = read_points(table), 0
    contact, width, n = job.contact, job.contact.width, job.line.h.shape[0]
    for p in range(1, n):
        if not bears(job, p):
            continue
        for q in range(p + 1, n):
            near = bears(job, q) and hull_distance(contact.kind, job.r, p, q) < BEYOND * 0.5 * (width[p] + width[q])
            if near and may_touch(job.line, job.ends, contact, p, q):
                count = add_points(job, q, p, add_points(job, p, q, count))
    return count
