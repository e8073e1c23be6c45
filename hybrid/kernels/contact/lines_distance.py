"""Whether lines of a network between which no contact is computed overlap: come nearer than the mean of their diameters.

Lines whose boxes are apart in a step cannot meet in it.  Two others that were c apart cannot while

    |M_a - M_b| + R_a + R_b < c

with M the sum of the mean displacements of a line in each step since, and R that of the largest deviations from them:
exact, whatever the steps.  Where that is used up, the distance of all cells on their straight ways in the step is found
anew; cells in boxes of BOX are left out together.

Of lines that touch each other from where they come near, what AHEAD more steps like the last one may close is room that
is used up as well: they are near once cells are less apart than that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, dot, get3, scale, sub
from hybrid.kernels.contact.self_distance import NEIGHBOURS, least_on_the_way, nearest_feet
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.state import Floats, NumberRows, Rows, blanks
from hybrid.kernels.step.line_step import read

BOX = 8  # cells in a box
# Of the width: way from line to line about a joint on which nothing is looked at; legs that leave it by 10 degrees or
# more are apart beyond.  Within half of it from the joint, on either line, another one lies against the joint.
JOINT = 12.0
# Steps that lines which may touch look ahead, and of the mean diameter how far apart they are near at least: contact acts
# from there on.
AHEAD, LEAST_APART = 3.0, 0.05
# Columns of `pairs`.
A = 0  # lines
B = 1
HAVE_MET = 2  # 1: they have met, 2: they are near, 0: neither
ASKS = 3  # 1: contact begins where they are near
CLOSE = 4  # 1: their boxes overlap
WATCHED = 5
MET, NEAR = 1, 2
# Columns of `room`.
APART = 0  # distance, m
WAY = 1  # 3, M_a - M_b at that time, m
SPREAD = 4  # R_a + R_b at that time, m
TIME = 5  # when they met, s
AT = 6  # where, m
OTHER = 7
ROOM = 8
# Columns of `moved`.
MEAN = 0  # 3, M of a line, m
DEVIATION = 3  # R of it, m
LOW = 4  # 3, its box in the last step and AHEAD more, wider by its radius, m
HIGH = 7  # 3
BESIDE = 10  # whether it is beside another one in that
LAST = 11  # 3, mean displacement of the last step, m
LAST_DEVIATION = 14  # largest deviation from it, m
WIDEST = 15  # diameter, m
MOVED = 16


class LinesJob(NamedTuple):
    """Arguments of the entry: K pairs of lines of L."""

    tables: NumberRows  # (L, ..) jobs of the lines, whose last step led from `old` to `new`
    joined: NumberRows  # (L, 2) what the ends are joined to
    begins: NDArray[np.int64]  # (L,) where their cells begin in `width`
    width: Floats  # (N,) m, diameters of the cells of all lines
    clock: Clock  # of all lines, as kernels.run.network_run.StepsJob has it
    pairs: NumberRows  # (K, WATCHED)
    room: Rows  # (K, ROOM)
    moved: Rows  # (L, MOVED)


blank_lines_job = blanks(LinesJob)
read_lines = reader(blank_lines_job())


@inner
def add_motion(moved, before, after):
    """Add the mean displacement of a line in a step to its M, the largest deviation from it to its R."""
    n = after.shape[0]
    x, y, z, square = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        d = sub(get3(after, i), get3(before, i))
        x, y, z = x + d[0], y + d[1], z + d[2]
    mean = (x / n, y / n, z / n)
    for i in range(n):
        d = sub(sub(get3(after, i), get3(before, i)), mean)
        square = max(square, dot(d, d))
    moved[LAST_DEVIATION] = math.sqrt(square)
    for k in range(3):
        moved[LAST + k] = mean[k]
        moved[MEAN + k] += mean[k]
    moved[DEVIATION] += moved[LAST_DEVIATION]


@inner
def box_of(before, after, first, last, ahead):
    """Lowest and highest of the nodes from the first to the last on their ways in a step, and in `ahead` more like it."""
    low, high = (math.inf, math.inf, math.inf), (-math.inf, -math.inf, -math.inf)
    for i in range(first, last + 1):
        a, b = get3(before, i), get3(after, i)
        c = add(b, scale(ahead, sub(b, a)))  # beyond b as seen from a
        low = (min(low[0], min(a[0], c[0])), min(low[1], min(a[1], c[1])), min(low[2], min(a[2], c[2])))
        high = (max(high[0], max(a[0], c[0])), max(high[1], max(a[1], c[1])), max(high[2], max(a[2], c[2])))
    return low, high


@inner
def find_boxes(job):
    """The boxes of all lines in the last step, and AHEAD more."""
    moved = job.moved
    for l in range(job.tables.shape[0]):
        line_job, widest = read(job.tables[l]), 0.0
        n = line_job.line.h.shape[0]
        for i in range(job.begins[l], job.begins[l] + n):
            widest = max(widest, job.width[i])
        low, high = box_of(line_job.old.r, line_job.new.r, 0, n, AHEAD)
        margin = (0.5 + LEAST_APART) * widest
        for k in range(3):
            moved[l, LOW + k], moved[l, HIGH + k] = low[k] - margin, high[k] + margin
        moved[l, BESIDE], moved[l, WIDEST] = 0.0, widest


@inner
def overlap(moved, a, b):
    """Whether the boxes of two lines overlap."""
    for k in range(3):
        if moved[a, LOW + k] > moved[b, HIGH + k] or moved[b, LOW + k] > moved[a, HIGH + k]:
            return False
    return True


@inner
def boxes_apart(low, high, lower, higher):
    """Distance of two boxes, m."""
    square = 0.0
    for k in range(3):
        x = max(low[k] - higher[k], lower[k] - high[k])
        if x > 0.0:
            square += x * x
    return math.sqrt(square)


@inner
def are_neighbours(job, a, b, line, other, i, j, window):
    """Whether cells i and j of two lines lie by ends that are joined to the same."""
    for m in range(2):
        for k in range(2):
            if job.joined[a, m] >= 0 and job.joined[a, m] == job.joined[b, k]:
                p, q = i, j
                way, rest = line.s[i], other.s[j]
                if m == 1:
                    p, way = line.h.shape[0] - 1 - i, line.s[line.h.shape[0]] - line.s[i + 1]
                if k == 1:
                    q, rest = other.h.shape[0] - 1 - j, other.s[other.h.shape[0]] - other.s[j + 1]
                if not (p + q > NEIGHBOURS and way + rest > window):
                    return True
    return False


@inner
def are_at_joint(job, a, b, line, other, s, t, reach):
    """Whether s of line a, or t of line b, is within `reach`, m, of an end that is joined to one of the other line."""
    for m in range(2):
        for k in range(2):
            if job.joined[a, m] >= 0 and job.joined[a, m] == job.joined[b, k]:
                way, rest = abs(s - line.s[m * line.h.shape[0]]), abs(t - other.s[k * other.h.shape[0]])
                if min(way, rest) < reach:
                    return True
    return False


@inner
def cells_apart(before, after, other_before, other_after, i, j):
    """Least distance of two cells on their straight ways in a step, m, and where they are nearest after it."""
    p, q = get3(after, i), get3(other_after, j)
    d, f = sub(get3(after, i + 1), p), sub(get3(other_after, j + 1), q)
    x, y = nearest_feet(p, d, q, f)
    now = sub(add(p, scale(x, d)), add(q, scale(y, f)))
    p, q = get3(before, i), get3(other_before, j)
    d, f = sub(get3(before, i + 1), p), sub(get3(other_before, j + 1), q)
    was = sub(add(p, scale(x, d)), add(q, scale(y, f)))
    u, v = nearest_feet(p, d, q, f)
    first = sub(add(p, scale(u, d)), add(q, scale(v, f)))
    return min(least_on_the_way(now, was), math.sqrt(dot(first, first))), x, y


@inner
def moves_apart(before, after, first, last, before_other, after_other, begin, end):
    """How differently nodes of two lines, from `first` to `last` and from `begin` to `end`, move in a step at most, m."""
    square = 0.0
    for k in range(3):
        low, high, lower, higher = math.inf, -math.inf, math.inf, -math.inf
        for i in range(first, last + 1):
            u = after[i, k] - before[i, k]
            low, high = min(low, u), max(high, u)
        for i in range(begin, end + 1):
            u = after_other[i, k] - before_other[i, k]
            lower, higher = min(lower, u), max(higher, u)
        most = max(high - lower, higher - low)
        square += most * most
    return math.sqrt(square)


@inner
def widest_of(job, line, first, last):
    """The largest diameter of cells of a line from the first to the one before the last, m."""
    widest = 0.0
    for i in range(job.begins[line] + first, job.begins[line] + last):
        widest = max(widest, job.width[i])
    return widest


@inner
def search(job, row, a, b, reach):
    """The least clearance of two lines in their last step, m, and at which arc lengths, into a row of room.

    reach: m, within which cells may be near: closer than AHEAD more steps like the last one may close; -infinity:
    none are looked for.  Returns whether any are.
    """
    one, two = read(job.tables[a]), read(job.tables[b])
    line, other = one.line, two.line
    n, m, best, near = line.h.shape[0], other.h.shape[0], math.inf, False
    at_joint = math.inf  # the least clearance of what is near a joint, where one line lies against what holds the other
    for first in range(0, n, BOX):
        last = min(first + BOX, n)
        low, high = box_of(one.old.r, one.new.r, first, last, 0.0)
        widest = widest_of(job, a, first, last)
        for second in range(0, m, BOX):
            end, ahead = min(second + BOX, m), -math.inf  # within which cells of these boxes may be near
            lower, higher = box_of(two.old.r, two.new.r, second, end, 0.0)
            width = 0.5 * (widest + widest_of(job, b, second, end))
            gap = boxes_apart(low, high, lower, higher) - width
            if gap < reach and not near:
                moves = moves_apart(one.old.r, one.new.r, first, last, two.old.r, two.new.r, second, end)
                ahead = max(AHEAD * moves, LEAST_APART * width)
            if not (gap < best or gap < ahead):
                continue
            for i in range(first, last):
                for j in range(second, end):
                    width = 0.5 * (job.width[job.begins[a] + i] + job.width[job.begins[b] + j])
                    apart, x, y = cells_apart(one.old.r, one.new.r, two.old.r, two.new.r, i, j)
                    clear = apart - width
                    if not (clear < best or (clear < ahead and not near)):
                        continue
                    if are_neighbours(job, a, b, line, other, i, j, JOINT * width):
                        continue
                    s, t = line.s[i] + x * line.h[i], other.s[j] + y * other.h[j]
                    if are_at_joint(job, a, b, line, other, s, t, 0.5 * JOINT * width):
                        at_joint = min(at_joint, max(clear, 0.0))
                        continue
                    if clear < best:
                        best = clear
                        row[AT], row[OTHER] = s, t
                    if clear < ahead and not near:
                        moves = moves_apart(one.old.r, one.new.r, i, i + 1, two.old.r, two.new.r, j, j + 1)
                        near = clear < max(AHEAD * moves, LEAST_APART * width)
    row[APART] = min(best, at_joint)  # what is near a joint may slide away from it: looked at in the next step again
    return near


@inner
def closing(one, other):
    """By how much two lines of `moved` can have closed in the last step, m."""
    square = 0.0
    for k in range(3):
        gone = one[LAST + k] - other[LAST + k]
        square += gone * gone
    return math.sqrt(square) + one[LAST_DEVIATION] + other[LAST_DEVIATION]


@inner
def examine_pair(job, pair, row):
    """Whether two lines are near, or have met, in the last step, in which their boxes overlap; and note it."""
    moved = job.moved
    a, b, ahead = pair[A], pair[B], 0.0
    if pair[ASKS]:
        ahead = max(AHEAD * closing(moved[a], moved[b]), LEAST_APART * 0.5 * (moved[a, WIDEST] + moved[b, WIDEST]))
    spread, square = moved[a, DEVIATION] + moved[b, DEVIATION], 0.0
    for j in range(3):
        gone = moved[a, MEAN + j] - moved[b, MEAN + j] - row[WAY + j]
        square += gone * gone
    if math.sqrt(square) + spread - row[SPREAD] + ahead < row[APART]:
        return
    near = search(job, row, a, b, ahead if pair[ASKS] else -math.inf)
    for j in range(3):
        row[WAY + j] = moved[a, MEAN + j] - moved[b, MEAN + j]
    row[SPREAD] = spread
    if row[APART] < 0.0:
        pair[HAVE_MET], row[TIME] = MET, job.clock.now
    elif near:
        pair[HAVE_MET], row[TIME] = NEAR, job.clock.now


@inner
def forget_distances(pairs, room, l):
    """How far line l is from others is found anew: it has other nodes."""
    for k in range(pairs.shape[0]):
        if pairs[k, A] == l or pairs[k, B] == l:
            room[k, APART] = 0.0


@kernel
def watch_lines(table):
    """Note which pairs of lines have met, or are near, in the step that was taken last; how many are near now."""
    job = read_lines(table)
    pairs, room, moved, near = job.pairs, job.room, job.moved, 0
    find_boxes(job)
    for k in range(pairs.shape[0]):
        pairs[k, CLOSE] = 0
        if not pairs[k, HAVE_MET]:
            if overlap(moved, pairs[k, A], pairs[k, B]):
                pairs[k, CLOSE] = 1
                moved[pairs[k, A], BESIDE] = moved[pairs[k, B], BESIDE] = 1.0
            else:  # how far they have gone since is not followed
                room[k, APART] = 0.0
    for l in range(job.tables.shape[0]):
        if moved[l, BESIDE]:
            line_job = read(job.tables[l])
            add_motion(moved[l], line_job.old.r, line_job.new.r)
    for k in range(pairs.shape[0]):
        if pairs[k, CLOSE]:
            examine_pair(job, pairs[k], room[k])
        near += pairs[k, HAVE_MET] == NEAR
    return near
