"""Lowest and highest values over all accepted steps of the quantities that a scene asks for by name.

They follow the rules of the outputs (outputs.quantities), whose values they are where a step ends at an output: forces
and angles of the pull at an end, the touchdown point, layback, and clearances of the chords of the line.

    symbol   meaning                                                     shape   unit
    f        pull: force of the line on what holds its end               3       N
    a, b     first nodes of a chord of the line and of one of a path     3       m
    u, w     these chords                                                3       m
    x, y     parts of the chords u and w where they are nearest          -       -

A clearance of two lines stands with the later one of them, which finds the chords of the earlier one in the path that
both have: that one has a row of its own (CHORDS), by which it puts them there.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub
from hybrid.kernels.laws.bed import bed_under
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.report import FORCE_A
from hybrid.kernels.step.job import read
from hybrid.kernels.step.newton import RUN
from hybrid.kernels.watch.pipes import note_pipes

# Kinds, by their names in a scene (scene.quantities.KINDS).
(
    HORIZONTAL_FORCE, VERTICAL_FORCE, FORCE_ALONG, DECLINATION, AZIMUTH, END_ANGLE, UPLIFT, UPLIFT_ANGLE, TOUCHDOWN,
    TOUCHDOWN_EXCURSION, LAYBACK, CLEARANCE,
) = range(12)  # fmt: skip
CHORDS = 12  # none of a scene: chords of a line for another one
# Columns of `asked`.
KIND = 0
END = 1  # 0, 1
DIRECTION = 2  # 3, unit direction or normal
TO_TOUCHDOWN = 5  # whether layback goes to the touchdown point
POINT = 6  # 3, of the plane, m
IS_PLANE = 9  # whether there is one
FIRST = 10  # range of arc lengths, m, NaN: all of the line
LAST = 11
PATH = 12  # first and last row of `path`
PATH_END = 13
IDLE = 14  # 1 where the end is joined to a point that nothing else is at, whose force is what Newton left
COUNTED = 15  # 1 where the first row of `path` has the number of chords behind it, -1 where there is no room for them
OF_PATH = 16  # 1 where the arc length is that of `path`
ASKED = 17
# Columns of `reached`.
SMALLEST = 0
LARGEST = 1
TIMES = 2  # 2, when, s
PLACES = 4  # 2, arc length where a clearance was, m
REFERENCE = 6  # 2, place x, y, m, from which excursions count, or azimuth, deg, near the others; NaN: not known
NEAREST = 8  # the cell that was nearest last
REACHED = 9
# The first azimuth is above it, deg, and at most a turn more: lines along an axis are far from both bounds.
LEAST_AZIMUTH = -170.0
# Columns of `path`, behind the first point (3), m.
CHORD = 3  # 3, m
SQUARE = 6  # of its length, m2
RADIUS = 7  # around it, m
BEGINS = 8  # arc length at which it begins, m
SPANS = 9  # its length along the line, m
PATH_ROW = 10


@inner
def row3(row, k):
    return (row[k], row[k + 1], row[k + 2])


@inner
def pull_at(job, k):
    """f at end k, and whether anything takes it."""
    if not (job.ends.held[k] or job.books.loaded[k]):
        return (0.0, 0.0, 0.0), False
    report, at = job.books.report, FORCE_A + 3 * k
    return (report[0, at], report[0, at + 1], report[0, at + 2]), True


@inner
def touch_at(job, state, k):
    """Arc length and place of the first point in contact from end k on; NaN: none."""
    line, sea, n = job.line, job.sea, job.line.h.shape[0]
    step = 1 - 2 * k
    i = k * n
    _, here = bed_under(sea, get3(state.r, i))
    for _ in range(n):
        j = i + step
        _, there = bed_under(sea, get3(state.r, j))
        if max(here, there) > 0.0:
            x = 0.0
            if here <= 0.0:
                x = min(max(-here / (there - here), 0.0), 1.0)
            a, b = get3(state.r, i), get3(state.r, j)
            return line.s[i] + x * (line.s[j] - line.s[i]), add(a, scale(x, sub(b, a)))
        i, here = j, there
    return math.nan, (math.nan, math.nan, math.nan)


@inner
def apart(a, u, path, j):
    """Distance of the chord u from row j of a path, x and y."""
    b, w = (path[j, 0], path[j, 1], path[j, 2]), (path[j, 3], path[j, 4], path[j, 5])
    r, aa, bb, ab = sub(a, b), dot(u, u), path[j, SQUARE], dot(u, w)
    ar, br = dot(u, r), dot(w, r)
    area, x = aa * bb - ab * ab, 0.0
    if area > 1e-12 * aa * bb:
        x = min(max((ab * br - ar * bb) / area, 0.0), 1.0)
    t = (ab * x + br) / bb if bb > 1e-300 else 0.0
    held = min(max(t, 0.0), 1.0)
    if t != held or bb <= 1e-300:
        x = min(max((ab * held - ar) / aa, 0.0), 1.0) if aa > 1e-300 else 0.0
    far = sub(add(r, scale(x, u)), scale(held, w))
    return math.sqrt(dot(far, far)), x, held


@inner
def nearest_on(a, u, path, begin, end):
    """Least distance of the chord u from the surface of a path, x, and the arc length there.

    begin, end: its rows, the last excluded.
    """
    least, part, s = math.inf, 0.0, math.nan
    for j in range(begin, end):
        found, x, y = apart(a, u, path, j)
        found -= path[j, RADIUS]
        if found < least:
            least, part, s = found, x, path[j, BEGINS] + y * path[j, SPANS]
    return least, part, s


@inner
def node_near(s, x):
    """The node nearest to an arc length."""
    best = 0
    for i in range(1, s.shape[0]):
        if abs(s[i] - x) < abs(s[best] - x):
            best = i
    return best


@inner
def radius_at(radii, s):
    """Radius of the section at an arc length; radii: (S, 2) where sections end, m, and their radii, m."""
    k = 0
    while k + 1 < radii.shape[0] and s > radii[k, 0]:
        k += 1
    return radii[k, 1]


@inner
def over_plane(job, state, asked, first, last):
    """Least height over a plane of the cells from node `first` to `last`, and its arc length."""
    line, n, b = job.line, row3(asked, DIRECTION), row3(asked, POINT)
    least, where = math.inf, math.nan
    here = dot(n, sub(get3(state.r, first), b))
    for c in range(first, last):
        there = dot(n, sub(get3(state.r, c + 1), b))
        height = min(here, there) - radius_at(job.books.radii, 0.5 * (line.s[c] + line.s[c + 1]))
        if height < least:
            least, where = height, line.s[c + 1] if there < here else line.s[c]
        here = there
    return least, where


@inner
def from_path(job, state, asked, reached, first, last):
    """Least clearance of the cells from node `first` to `last` from a path, and its arc length.

    Along the line a distance changes at most by the length that is passed, so that most cells need no distance.
    """
    line, radii, path = job.line, job.books.radii, job.books.path
    begin, end = int(asked[PATH]), int(asked[PATH_END])
    if asked[COUNTED] != 0.0:
        begin, end = begin + 1, begin + 1 + int(path[begin, 0])
    widest = 0.0
    for k in range(radii.shape[0]):
        widest = max(widest, radii[k, 1])
    nearest = min(max(int(reached[NEAREST]), first), last - 1)
    least, where, ahead = math.inf, math.nan, -math.inf
    for k in range(first - 1, last):  # the cell that was nearest last comes first
        c = nearest if k < first else k
        u = get3(state.e, c)
        if k >= first:
            ahead -= math.sqrt(dot(u, u))
            if ahead > least + widest:
                continue
        distance, x, there = nearest_on(get3(state.r, c), u, path, begin, end)
        found = distance - radius_at(radii, 0.5 * (line.s[c] + line.s[c + 1]))
        if k >= first:
            ahead = distance
        if found < least:
            least, where, nearest = found, line.s[c] + x * (line.s[c + 1] - line.s[c]), c
            if asked[OF_PATH] != 0.0:
                where = there
    reached[NEAREST] = nearest
    return least, where


@inner
def nodes_of(s, asked):
    """First and last node of the part of a line that counts."""
    first, last = 0, s.shape[0] - 1
    if asked[FIRST] == asked[FIRST]:
        first, last = node_near(s, asked[FIRST]), node_near(s, asked[LAST])
        first = min(first, s.shape[0] - 2)
        last = max(last, first + 1)
    return first, last


@inner
def put_chords(job, state, asked):
    """Put chords of the part that counts where a later line finds them."""
    s, path, begin = job.line.s, job.books.path, int(asked[PATH])
    first, last = nodes_of(s, asked)
    path[begin, 0] = last - first
    if last - first > int(asked[PATH_END]) - begin - 1:
        path[begin, 0], last = -1.0, first
    for c in range(first, last):
        row, r, u = path[begin + 1 + c - first], get3(state.r, c), get3(state.e, c)
        for k in range(3):
            row[k], row[CHORD + k] = r[k], u[k]
        row[SQUARE], row[RADIUS] = dot(u, u), radius_at(job.books.radii, 0.5 * (s[c] + s[c + 1]))
        row[BEGINS], row[SPANS] = s[c], s[c + 1] - s[c]


@inner
def clearance(job, state, asked, reached):
    """Least clearance, m, and its arc length."""
    first, last = nodes_of(job.line.s, asked)
    if asked[IS_PLANE] != 0.0:
        return over_plane(job, state, asked, first, last)
    return from_path(job, state, asked, reached, first, last)


@inner
def on_bed(job, state, asked, reached, k, begins):
    """Touchdown, its excursion, or layback at end k; begins: whether the state is the first of all."""
    kind = asked[KIND]
    if kind == LAYBACK and asked[TO_TOUCHDOWN] == 0.0:
        x = get3(state.r, (1 - k) * job.line.h.shape[0])
    else:
        s, x = touch_at(job, state, k)
        if kind == TOUCHDOWN:
            return s
    if kind == LAYBACK:
        here = get3(state.r, k * job.line.h.shape[0])
        return math.hypot(x[0] - here[0], x[1] - here[1])
    if begins and math.isnan(reached[REFERENCE]):
        reached[REFERENCE], reached[REFERENCE + 1] = x[0], x[1]
    return math.hypot(x[0] - reached[REFERENCE], x[1] - reached[REFERENCE + 1])


@inner
def azimuth(f, reached):
    """Azimuth of the pull, deg, within half a turn of the reference, which is the first one where none is given."""
    x = math.degrees(math.atan2(f[1] + 0.0, f[0]))
    if math.isnan(reached[REFERENCE]):
        reached[REFERENCE] = x + 360.0 if x <= LEAST_AZIMUTH else x
    return x + 360.0 * math.floor((reached[REFERENCE] - x) / 360.0 + 0.5)


@inner
def of_pull(job, state, asked, reached, k):
    """What follows from the pull at end k; angles in degrees, NaN where there is no pull."""
    kind = asked[KIND]
    f, taken = (0.0, 0.0, 0.0), False
    if asked[IDLE] == 0.0:
        f, taken = pull_at(job, k)
    if kind == HORIZONTAL_FORCE:
        return math.hypot(f[0], f[1])
    if kind == VERTICAL_FORCE:
        return f[2]
    along = row3(asked, DIRECTION)
    if kind == FORCE_ALONG:
        return dot(along, f)
    if UPLIFT <= kind <= UPLIFT_ANGLE:
        n, _ = bed_under(job.sea, get3(state.r, k * job.line.h.shape[0]))
        up = dot(n, f)
        aside = sub(f, scale(up, n))
        up = max(up, 0.0)
        return up if kind == UPLIFT else math.degrees(math.atan2(up, math.sqrt(dot(aside, aside))))
    if not taken or not dot(f, f) > 0.0:
        return math.nan
    if kind == DECLINATION:
        return math.degrees(math.atan2(math.hypot(f[0], f[1]), f[2]))
    if kind == AZIMUTH:
        return azimuth(f, reached)
    aside = cross(f, along)
    return math.degrees(math.atan2(math.sqrt(dot(aside, aside)), dot(along, f)))


@kernel
def note_quantities(table):
    """Widen the ranges of all quantities of a run, or of a line of several, to its state; always 0.

    Called after kernels.watch.extremes.note_extremes.
    """
    job = read(table)
    books, state = job.books, job.new
    if job.task.what == RUN and books.counts.parity == 0:
        state = job.old
    t, begins = books.clock.now, books.counts.steps == 0
    if books.walls.shape[0] > 0:
        note_pipes(job.line, job.ends, state, books, t)
    for q in range(books.asked.shape[0]):
        asked, reached = books.asked[q], books.reached[q]
        kind, k, place = asked[KIND], int(asked[END]), math.nan
        if kind == CHORDS:
            put_chords(job, state, asked)
            continue
        if kind == CLEARANCE and asked[COUNTED] != 0.0 and books.path[int(asked[PATH]), 0] < 0.0:
            reached[SMALLEST], reached[LARGEST] = -math.inf, math.inf  # nobody knows
            continue
        if kind == CLEARANCE:
            x, place = clearance(job, state, asked, reached)
        elif kind >= TOUCHDOWN:
            x = on_bed(job, state, asked, reached, k, begins)
        else:
            x = of_pull(job, state, asked, reached, k)
        if x < reached[SMALLEST]:
            reached[SMALLEST], reached[TIMES], reached[PLACES] = x, t, place
        if x > reached[LARGEST]:
            reached[LARGEST], reached[TIMES + 1], reached[PLACES + 1] = x, t, place
    return 0
