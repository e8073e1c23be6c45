"""How near a line comes to itself in a step: the least clearance between cells that are no neighbours along the line.

Cells are in a binary tree of boxes, consecutive ones in each, which is made anew for every state.  Two points count
where the distance between them is less than TURNED of the length of line between them, which no gentle bend is; a part
of the line that turns by less than that allows (a cone of tangents) is left out as a whole, so that a line that hangs
costs one pass over its cells.  Boxes hold cells before and after the step: what passes within a step is found.

A run calls `watch_itself` by its address (kernels.run.network_run), from the step on in which the line is bent so far.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, dot, get3, scale, sub
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import NamedNumbers, by_reference, reader
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.state import Ends, Floats, Line, State, blanks

# Distance of two points over the length of line between them below which they are no neighbours: half a circle has
# 0.64, and two diameters of contact leave a loop of 2.5 diameters.
TURNED = 0.4
SAME = 1e-9  # of a diameter: a clearance that is less by this is the same
NEIGHBOURS = 4  # cells between two cells that count, at least
LEAF = 4  # cells in the smallest box
BOX = 18  # numbers of a box: lowest and highest position, tangent, and displacement where that is asked for
HORIZON = 10.0  # diameters; what is farther away is not looked for
APART = 0.5  # diameters of clearance at which what has met has come apart
DEPTH = 64  # levels of the tree, at most
CLOSE = 1.0  # diameters of clearance below which contact begins to be computed, whatever the line does
INSIDE = 0.15  # diameters that surfaces may be in each other for contact to begin (kernels.contact.self_contact_law)
CLOSING = 3.0  # steps like the last one, in which it is foreseen that two cells come so near
WIDER = 2.0  # by how much farther they have to be apart for contact to end again, and
ENDS = (
    30  # for so many steps: vibrations that contact leaves are damped for as many (kernels.contact.self_contact_pairs)
)
# Cosine of the largest angle, 1 rad, between cells of a bend that has a shape: beyond, its cells cannot tell how near
# the parts beside it are, within so many cells of it.
SHARPEST, BESIDE = 0.5403, 8
# Bits of what `watch_itself` returns.
MEETS = 1
NEARS = 2
PARTS = 4
HIDES = 8
UNBENT = 1  # in place of the address of `watch_itself`, while the line is not bent so far


class Nearest(NamedNumbers):
    """Where the line is nearest to itself."""

    clearance: float  # m, between surfaces, in the last step; the horizon, or infinite, where there is nothing
    distance: float  # m, between the centrelines there
    s: float  # m, where
    other_s: float
    told: float  # 1 where it has been told that surfaces meet, until they have come apart
    meeting: float  # diameters of clearance below which surfaces meet
    least: float  # the same of the least clearance so far, and when, s
    least_distance: float
    least_s: float
    least_other: float
    least_time: float
    waits: float  # 1 where contact has been given up, until surfaces have come apart
    away: float  # steps since two parts were near each other
    hidden: float  # steps since a bend has hidden whether they are


OF_0_6 = 11  # numbers of Nearest in checkpoints of 0.6


class Ahead(NamedNumbers):
    """What is asked of the search for parts that may touch, and its answer.

    asked: -1: nothing, 1: whether contact has to begin, WIDER: whether it may end; seconds: from the state on, in which
    cells move at its velocities, 0: those of the step count; then whether parts are near each other, whether a bend
    hides that, the node of that bend, -1: none was found, and the cells beside it.
    """

    asked: float
    seconds: float
    is_near: float
    is_hidden: float
    sharp: float
    hidden_i: float
    hidden_j: float


class Itself(NamedTuple):
    """What the search works with; P leaves, a power of two."""

    width: Floats  # (N,) m, diameters
    tree: Floats  # (2 P, BOX) node k has the children 2 k and 2 k + 1; the root is 1
    stack: NDArray[np.int64]  # (DEPTH 4, 2) pairs of boxes that are still to be looked at
    found: Nearest
    cells: NDArray[np.int64]  # (2,) the pair that was nearest
    ahead: Ahead


def boxes_of(cells: int) -> int:
    """Rows of the tree of a line of so many cells."""
    leaves = 1
    while leaves * LEAF < cells:
        leaves *= 2
    return 2 * leaves


def blank_itself(width: Floats) -> Itself:
    """For a line of cells of these diameters (N,) m."""
    found = Nearest(clearance=np.inf, distance=np.inf, least=np.inf, hidden=ENDS)
    stack = np.zeros((4 * DEPTH, 2), np.int64)
    ahead = Ahead(asked=-1.0, sharp=-1.0)
    return Itself(width, np.zeros((boxes_of(width.size), BOX)), stack, found, np.full(2, -1, np.int64), ahead)


by_reference(blank_itself(np.ones(1)))


class ItselfJob(NamedTuple):
    """Arguments of the entry: two states in turn as kernels.run.network_run has them, its clock and counts."""

    line: Line
    ends: Ends
    old: State
    new: State
    clock: Clock
    counts: Counts
    itself: Itself


blank_itself_job = blanks(ItselfJob)
read = reader(blank_itself_job())


@inner
def is_bent(state):
    """Whether any chord turns from the line between the ends by so much that the line could come near itself."""
    e = state.e
    c0, c1, c2 = sub(get3(state.r, e.shape[0]), get3(state.r, 0))
    size = TURNED * TURNED * (c0 * c0 + c1 * c1 + c2 * c2)
    for i in range(e.shape[0]):
        x, y, z = e[i, 0], e[i, 1], e[i, 2]
        along = x * c0 + y * c1 + z * c2
        if not (along > 0.0 and along * along > size * (x * x + y * y + z * z)):
            return True
    return False


# --- the tree -------------------------------------------------------------------------------------


@inner
def fill_leaf(tree, leaf, q, before, r, e):
    """The box of the cells of leaf q, at node `leaf`; of no cells an empty one."""
    for k in range(3):
        tree[leaf, k], tree[leaf, 3 + k] = math.inf, -math.inf
        tree[leaf, 6 + k], tree[leaf, 9 + k] = math.inf, -math.inf
    first, last = q * LEAF, min((q + 1) * LEAF, e.shape[0])
    for i in range(first, last):
        f = 1.0 / math.sqrt(e[i, 0] * e[i, 0] + e[i, 1] * e[i, 1] + e[i, 2] * e[i, 2])
        for k in range(3):
            t = f * e[i, k]
            tree[leaf, 6 + k], tree[leaf, 9 + k] = min(tree[leaf, 6 + k], t), max(tree[leaf, 9 + k], t)
    if first < last:
        for i in range(first, last + 1):
            for k in range(3):
                tree[leaf, k] = min(tree[leaf, k], min(before[i, k], r[i, k]))
                tree[leaf, 3 + k] = max(tree[leaf, 3 + k], max(before[i, k], r[i, k]))


@inner
def fill_tree(tree, before, r, e):
    """Boxes of all cells, from the leaves up."""
    leaves = tree.shape[0] // 2
    for q in range(leaves):
        fill_leaf(tree, leaves + q, q, before, r, e)
    fill_parents(tree)


@inner
def travel(before, state, seconds, i):
    """How far node i moves, m: in the step from the positions `before`, and within a time, s, from then on."""
    d = sub(get3(state.r, i), get3(before, i))
    return add(d, scale(seconds, get3(state.v, i)))


@inner
def fill_travels(tree, before, state, seconds):
    """Lowest and highest displacements of the nodes of all boxes."""
    leaves, n = tree.shape[0] // 2, state.e.shape[0]
    for q in range(leaves):
        leaf, first, last = leaves + q, q * LEAF, min((q + 1) * LEAF, n)
        for k in range(3):
            tree[leaf, 12 + k], tree[leaf, 15 + k] = math.inf, -math.inf
        if first < last:
            for i in range(first, last + 1):
                d = travel(before, state, seconds, i)
                for k in range(3):
                    tree[leaf, 12 + k] = min(tree[leaf, 12 + k], d[k])
                    tree[leaf, 15 + k] = max(tree[leaf, 15 + k], d[k])
    for k in range(leaves - 1, 0, -1):
        for j in range(3):
            tree[k, 12 + j] = min(tree[2 * k, 12 + j], tree[2 * k + 1, 12 + j])
            tree[k, 15 + j] = max(tree[2 * k, 15 + j], tree[2 * k + 1, 15 + j])


@inner
def largest_approach(tree, a, b):
    """By how much a node of box a and one of box b come nearer to each other at most, m."""
    square = 0.0
    for k in range(3):
        x = max(tree[a, 15 + k] - tree[b, 12 + k], tree[b, 15 + k] - tree[a, 12 + k])
        square += x * x
    return math.sqrt(square)


@inner
def fill_parents(tree):
    """Boxes of boxes."""
    for k in range(tree.shape[0] // 2 - 1, 0, -1):
        for j in range(3):
            tree[k, j] = min(tree[2 * k, j], tree[2 * k + 1, j])
            tree[k, 3 + j] = max(tree[2 * k, 3 + j], tree[2 * k + 1, 3 + j])
            tree[k, 6 + j] = min(tree[2 * k, 6 + j], tree[2 * k + 1, 6 + j])
            tree[k, 9 + j] = max(tree[2 * k, 9 + j], tree[2 * k + 1, 9 + j])


@inner
def runs_on(tree, a, b, turned):
    """Whether the line runs on from box a to box b, which are the same or neighbours.

    Then no two points of it are nearer than `turned` of the line between them.
    """
    size, along = 0.0, 0.0
    for k in range(3):
        low, high = min(tree[a, 6 + k], tree[b, 6 + k]), max(tree[a, 9 + k], tree[b, 9 + k])
        c = low + high
        size += c * c
        along += min(c * low, c * high)
    return along > 0.0 and along >= turned * math.sqrt(size)  # an empty box, of which nothing is known, has a NaN


@inner
def box_distance(tree, a, b):
    """Distance of two boxes, m; infinite where one is empty."""
    square = 0.0
    for k in range(3):
        x = max(tree[a, k] - tree[b, 3 + k], tree[b, k] - tree[a, 3 + k])
        if x > 0.0:
            square += x * x
    return math.sqrt(square)


# --- two cells ------------------------------------------------------------------------------------


@inner
def nearest_feet(p, d, q, f):
    """Where two segments p + x d and q + y f are nearest, 0 <= x, y <= 1."""
    r = sub(p, q)
    a, e, b = dot(d, d), dot(f, f), dot(d, f)
    c, g = dot(d, r), dot(f, r)
    bottom = a * e - b * b
    x = 0.0
    if bottom > 1e-14 * a * e:
        x = min(max((b * g - c * e) / bottom, 0.0), 1.0)
    y = (b * x + g) / e
    if y < 0.0:
        y, x = 0.0, min(max(-c / a, 0.0), 1.0)
    elif y > 1.0:
        y, x = 1.0, min(max((b - c) / a, 0.0), 1.0)
    return x, y


@inner
def least_on_the_way(w, v):
    """Smallest distance from the origin of what goes from v to w."""
    u = sub(w, v)
    size = dot(u, u)
    x = 1.0
    if size > 0.0:
        x = min(max(-dot(v, u) / size, 0.0), 1.0)
    at = add(v, scale(x, u))
    return math.sqrt(dot(at, at))


@inner
def has_shape(state, ahead, i, j):
    """Whether cells i and j are not beside a bend that has no shape, between them; else SHARP is where that is."""
    e = state.e
    for k in range(max(i + 1, j - BESIDE), min(j, i + BESIDE) + 1):
        if is_sharp(e, k):
            ahead.sharp = k
            return False
    return True


@inner
def is_sharp(e, k):
    """Whether the cells beside node k turn by more than SHARPEST."""
    a, b = get3(e, k - 1), get3(e, k)
    along = dot(a, b)
    return not (along > 0.0 and along * along >= SHARPEST * SHARPEST * dot(a, a) * dot(b, b))


@inner
def note_near(before, state, itself, i, j, clearance):
    """Whether two cells are so near each other, or come so near, that contact between them counts."""
    ahead, width = itself.ahead, 0.5 * (itself.width[i] + itself.width[j])
    square = 0.0
    for p in range(i, i + 2):
        for q in range(j, j + 2):
            d = sub(travel(before, state, ahead.seconds, p), travel(before, state, ahead.seconds, q))
            square = max(square, dot(d, d))
    if not clearance < ahead.asked * (CLOSE * width + CLOSING * math.sqrt(square)):
        return
    if ahead.asked == WIDER:
        ahead.is_near = 1.0
    elif not has_shape(state, ahead, i, j):
        if ahead.is_hidden == 0.0:
            ahead.is_hidden, ahead.hidden_i, ahead.hidden_j = 1.0, i, j
    elif clearance > -2.0 * INSIDE * width:
        ahead.is_near = 1.0


@inner
def compare_cells(line, ends, before, state, itself, i, j):
    """Keep the pair of cells i < j if it was nearer in the step than all before.

    Neighbours do not count; also keeps whether any are near.
    """
    r = state.r
    p, q = get3(r, i), get3(r, j)
    x, y = nearest_feet(p, sub(get3(r, i + 1), p), q, sub(get3(r, j + 1), q))
    now = sub(add(scale(1.0 - x, p), scale(x, get3(r, i + 1))), add(scale(1.0 - y, q), scale(y, get3(r, j + 1))))
    was = sub(
        add(scale(1.0 - x, get3(before, i)), scale(x, get3(before, i + 1))),
        add(scale(1.0 - y, get3(before, j)), scale(y, get3(before, j + 1))),
    )
    distance = least_on_the_way(now, was)
    clearance = distance - 0.5 * (itself.width[i] + itself.width[j])
    found, n, asked = itself.found, line.h.shape[0], itself.ahead.asked > 0.0 and itself.ahead.is_near == 0.0
    if not (asked or clearance < found.clearance):
        return
    s, other = line.s[i] + x * line.h[i], line.s[j] + y * line.h[j]
    between = other - s
    if ends.held[0] != 0 and ends.held[1] != 0:  # from one held end to the other is a way as well
        gap = sub(get3(r, n), get3(r, 0))
        between = min(between, s - line.s[0] + line.s[n] - other + math.sqrt(dot(gap, gap)))
    if not distance < TURNED * between:
        return
    if asked:
        note_near(before, state, itself, i, j, clearance)
    if clearance < found.clearance:
        found.clearance, found.distance, found.s, found.other_s = clearance, distance, s, other
        itself.cells[0], itself.cells[1] = i, j


@inner
def search(line, ends, before, state, itself):
    """The least clearance of the step from the positions `before` to a state, into itself.found, and what is asked."""
    tree, stack, found, width, ahead = itself.tree, itself.stack, itself.found, itself.width, itself.ahead
    leaves, widest = tree.shape[0] // 2, 0.0
    found.clearance, found.distance = math.inf, math.inf
    ahead.is_near, ahead.is_hidden = 0.0, 0.0
    if not is_bent(state):
        return
    for i in range(width.shape[0]):
        widest = max(widest, width[i])
    found.clearance = HORIZON * widest
    fill_tree(tree, before, state.r, state.e)
    if ahead.asked > 0.0:
        fill_travels(tree, before, state, ahead.seconds)
    if itself.cells[0] >= 0 and itself.cells[1] < width.shape[0]:  # what was nearest is likely to be so again
        compare_cells(line, ends, before, state, itself, itself.cells[0], itself.cells[1])
    stack[0, 0], stack[0, 1], top = 1, 1, 1
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if b - a <= 1 and runs_on(tree, a, b, TURNED):
            continue
        within = found.clearance
        if ahead.asked > 0.0 and ahead.is_near == 0.0:
            within = max(within, ahead.asked * (CLOSE * widest + CLOSING * largest_approach(tree, a, b)))
        if not box_distance(tree, a, b) - widest < within:
            continue
        if a >= leaves:
            c, d, n = a - leaves, b - leaves, line.h.shape[0]
            for i in range(c * LEAF, min((c + 1) * LEAF, n)):
                for j in range(max(d * LEAF, i + NEIGHBOURS + 1), min((d + 1) * LEAF, n)):
                    compare_cells(line, ends, before, state, itself, i, j)
            continue
        c, d = 2 * a, 2 * b
        if a == b:
            stack[top, 0], stack[top, 1] = c, c
            stack[top + 1, 0], stack[top + 1, 1] = c + 1, c + 1
            stack[top + 2, 0], stack[top + 2, 1] = c, c + 1
            top += 3
        else:
            for k in range(4):
                stack[top + k, 0], stack[top + k, 1] = c + k // 2, d + k % 2
            top += 4


@inner
def note_found(found, t):
    """Keep the least clearance so far; whether surfaces have met that were apart."""
    margin = SAME * abs(found.distance - found.clearance)  # a line in a plane passes itself at no distance, many times
    if found.distance < math.inf and found.clearance < found.least - (margin if found.least < math.inf else 0.0):
        found.least, found.least_distance, found.least_time = found.clearance, found.distance, t
        found.least_s, found.least_other = found.s, found.other_s
    meets = False
    if found.distance < math.inf:
        width = found.distance - found.clearance
        if not found.clearance < APART * width:
            found.told = 0.0
        meets = found.clearance < found.meeting * width and found.told == 0.0
    else:
        found.told = 0.0
    if meets:
        found.told = 1.0
    return meets


@inner
def note_asked(found, ahead):
    """Bits of the answer: contact has to begin, may end, or a bend hides that.

    The last is reported once, until no bend has hidden it for ENDS steps.
    """
    hidden, told = ahead.is_hidden > 0.0 and ahead.is_near == 0.0, found.hidden < ENDS
    found.hidden = 0.0 if hidden else min(found.hidden + 1.0, ENDS)
    found.away = 0.0 if ahead.is_near > 0.0 else found.away + 1.0
    if ahead.asked == WIDER:
        return PARTS if found.away >= ENDS else 0
    if found.waits > 0.0 and not found.clearance < APART * (found.distance - found.clearance):
        found.waits = 0.0
    if ahead.is_near > 0.0 and found.waits == 0.0 and found.clearance > -INSIDE * (found.distance - found.clearance):
        return NEARS
    return HIDES if hidden and not told else 0


@kernel
def watch_itself(table):
    """Search how near the line came to itself in the step that led to its state.

    MEETS: surfaces have met; where that is asked, NEARS: contact has to begin; PARTS: it may end; HIDES: a bend without
    a shape hides which.
    The states of the job have changed places after the step, as in kernels.run.network_run.
    """
    job = read(table)
    state, before = (job.new, job.old) if job.counts.parity else (job.old, job.new)
    search(job.line, job.ends, before.r, state, job.itself)
    found, ahead = job.itself.found, job.itself.ahead
    asked = note_asked(found, ahead) if ahead.asked > 0.0 else 0
    return (MEETS if note_found(found, job.clock.now) else 0) | asked
