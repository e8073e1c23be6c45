"""Whether lines of a system between which no contact is computed overlap: come nearer than the mean of their diameters.

Lines whose boxes are apart in a step cannot meet in it.  Two others that were c apart cannot while

    |M_a - M_b| + R_a + R_b < c

with M the sum of the mean displacements of a line in each step since, and R that of the largest deviations from them:
exact, whatever the steps.  Where that is used up, the distance of all cells on their straight ways in the step is found
anew; cells in boxes of BOX are left out together.
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
from hybrid.kernels.state.books import NOW
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.job import read

BOX = 8  # cells in a box
# Of the width: way from line to line about a joint on which nothing is looked at; legs that leave it by 10 degrees or
# more are apart beyond.
JOINT = 12.0
# Of `pairs`: lines, and whether they have met, 1, or not, 0.
A, B, HAVE_MET, WATCHED = 0, 1, 2, 3
# Of `room`: how far apart they were, m; M_a - M_b and R_a + R_b at that time; when they met, s, and where, m.
APART, WAY, SPREAD, TIME, AT, OTHER, ROOM = 0, 1, 4, 5, 6, 7, 8
# Of `moved`: M, R of a line; its box in the last step, wider by its radius, m; whether it is beside another one in that.
MEAN, DEVIATION, LOW, HIGH, BESIDE, MOVED = 0, 3, 4, 7, 10, 11


class LinesJob(NamedTuple):
    """Arguments of the entry: K pairs of lines of L."""

    tables: NDArray[np.int64]  # (L, ..) jobs of the lines, whose last step led from `old` to `new`
    joined: NDArray[np.int64]  # (L, 2) what the ends are joined to
    begins: NDArray[np.int64]  # (L,) where their cells begin in `width`
    width: Floats  # (N,) m, diameters of the cells of all lines
    clock: Floats  # of all lines, as kernels.run.system_run.StepsJob has it
    pairs: NDArray[np.int64]  # (K, WATCHED)
    room: Floats  # (K, ROOM)
    moved: Floats  # (L, MOVED)


def blank_lines_job() -> LinesJob:
    """A job with the types that every one has."""
    z, whole = np.zeros, np.int64
    return LinesJob(
        z((1, 1), whole), z((1, 2), whole), z(1, whole), z(1), z(1), z((1, WATCHED), whole), z((1, ROOM)),
        z((1, MOVED)),
    )  # fmt: skip


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
    for k in range(3):
        moved[MEAN + k] += mean[k]
    moved[DEVIATION] += math.sqrt(square)


@inner
def box_of(before, after, first, last):
    """Lowest and highest of the nodes from the first to the last on their ways in a step."""
    low, high = (math.inf, math.inf, math.inf), (-math.inf, -math.inf, -math.inf)
    for i in range(first, last + 1):
        a, b = get3(before, i), get3(after, i)
        low = (min(low[0], min(a[0], b[0])), min(low[1], min(a[1], b[1])), min(low[2], min(a[2], b[2])))
        high = (max(high[0], max(a[0], b[0])), max(high[1], max(a[1], b[1])), max(high[2], max(a[2], b[2])))
    return low, high


@inner
def find_boxes(job):
    """The boxes of all lines in the last step."""
    moved = job.moved
    for l in range(job.tables.shape[0]):
        line_job, widest = read(job.tables[l]), 0.0
        n = line_job.line.h.shape[0]
        for i in range(job.begins[l], job.begins[l] + n):
            widest = max(widest, job.width[i])
        low, high = box_of(line_job.old.r, line_job.new.r, 0, n)
        for k in range(3):
            moved[l, LOW + k], moved[l, HIGH + k] = low[k] - 0.5 * widest, high[k] + 0.5 * widest
        moved[l, BESIDE] = 0.0


@inner
def overlap(moved, a, b):
    """Whether the boxes of two lines overlap."""
    apart = False
    for k in range(3):
        apart = apart or moved[a, LOW + k] > moved[b, HIGH + k] or moved[b, LOW + k] > moved[a, HIGH + k]
    return not apart


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
def search(job, row, a, b):
    """The least clearance of two lines in their last step, m, and at which arc lengths, into a row of room."""
    one, two = read(job.tables[a]), read(job.tables[b])
    line, other = one.line, two.line
    n, m, best = line.h.shape[0], other.h.shape[0], math.inf
    for first in range(0, n, BOX):
        low, high = box_of(one.old.r, one.new.r, first, min(first + BOX, n))
        for second in range(0, m, BOX):
            lower, higher = box_of(two.old.r, two.new.r, second, min(second + BOX, m))
            widest = 0.0
            for i in range(first, min(first + BOX, n)):
                widest = max(widest, job.width[job.begins[a] + i])
            thick = 0.0
            for j in range(second, min(second + BOX, m)):
                thick = max(thick, job.width[job.begins[b] + j])
            if not boxes_apart(low, high, lower, higher) - 0.5 * (widest + thick) < best:
                continue
            for i in range(first, min(first + BOX, n)):
                for j in range(second, min(second + BOX, m)):
                    width = 0.5 * (job.width[job.begins[a] + i] + job.width[job.begins[b] + j])
                    apart, x, y = cells_apart(one.old.r, one.new.r, two.old.r, two.new.r, i, j)
                    if apart - width < best and not are_neighbours(job, a, b, line, other, i, j, JOINT * width):
                        best = apart - width
                        row[AT], row[OTHER] = line.s[i] + x * line.h[i], other.s[j] + y * other.h[j]
    row[APART] = best


@kernel
def watch_lines(table):
    """Note which pairs of lines have met in the step that was taken last; how many."""
    job = read_lines(table)
    pairs, room, moved, found = job.pairs, job.room, job.moved, 0
    find_boxes(job)
    for k in range(pairs.shape[0]):
        if not pairs[k, HAVE_MET]:
            if overlap(moved, pairs[k, A], pairs[k, B]):
                moved[pairs[k, A], BESIDE] = moved[pairs[k, B], BESIDE] = 1.0
            else:  # how far they have gone since is not followed
                room[k, APART] = 0.0
    for l in range(job.tables.shape[0]):
        if moved[l, BESIDE]:
            line_job = read(job.tables[l])
            add_motion(moved[l], line_job.old.r, line_job.new.r)
    for k in range(pairs.shape[0]):
        a, b, row = pairs[k, A], pairs[k, B], room[k]
        if pairs[k, HAVE_MET] or not overlap(moved, a, b):
            continue
        spread, square = moved[a, DEVIATION] + moved[b, DEVIATION], 0.0
        for j in range(3):
            gone = moved[a, MEAN + j] - moved[b, MEAN + j] - row[WAY + j]
            square += gone * gone
        if math.sqrt(square) + spread - row[SPREAD] < row[APART]:
            continue
        search(job, row, a, b)
        for j in range(3):
            row[WAY + j] = moved[a, MEAN + j] - moved[b, MEAN + j]
        row[SPREAD] = spread
        if row[APART] < 0.0:
            pairs[k, HAVE_MET], row[TIME] = 1, job.clock[NOW]
            found += 1
    return found
