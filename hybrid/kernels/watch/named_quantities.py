"""Extremes of named quantities and of pipes over all accepted steps.

Of pipes, at every node (docs/theory.md, section on outputs): wall tension and von Mises stress.  Tension, curvature and
torque are those of kernels.watch.extremes, pressures those of still water at the height of the node.

    symbol   meaning                                                     shape   unit
    F        tension in the wall                                         -       N
    po, pi   pressure outside and inside, over that of the air           -       Pa
    k0       curvature without load of the section, of which there is no stress  -       1/m
    m, w     mean and half difference of Lame's stresses: radial stress  -       Pa, N
             m - w/d^2, hoop stress m + w/d^2 at the diameter d

Named quantities follow the rules of the outputs (outputs.quantities), whose values they are where a step ends at an
output: forces and angles of the pull at an end, the touchdown point, layback, and clearances of the chords of the line.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub, vector
from hybrid.kernels.laws.seabed import bed_under
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.books import VON_MISES, WALL_TENSION
from hybrid.kernels.state.report import FORCE_A
from hybrid.kernels.state.state import Floats, Sea
from hybrid.kernels.step.line_step import RUN, read
from hybrid.kernels.watch.extremes import curvature_at, has_one_value, load_on_side, tension_at, widen
from hybrid.kernels.watch.sides import element_strain, passed_torque, strain_on_side


class Seen(NamedTuple):
    """What the quantities of a line follow from: one state, or outputs of it."""

    s: Floats  # (N+1,) m
    r: Floats  # (N+1, 3) m
    e: Floats  # (N, 3) m
    sea: Sea
    held: NDArray[np.int8]  # (2,)
    loaded: NDArray[np.int8]  # (2,) 1 where there is a load at the end
    report: Floats  # (REPORT_SIZE,)
    radii: Floats  # (S, 2) as of `Books`
    path: Floats  # (P, PATH_ROW)


# Columns of `walls`: where the section ends, m; outer and inner diameter, m, Young's modulus, Pa, 0: no pipe; pressure
# inside, Pa, at the height PRESSURE_Z, m; specific weight of the content and of the water, N/m3; surface of the water, m;
# curvature without load, 1/m.
SECTION_END, OUTER, INNER, MODULUS, INSIDE, INSIDE_Z, CONTENT, WATER, SURFACE, NATURAL = range(10)
WALL = 10


@inner
def bend_from_natural(curvature, natural, a, b, unknown):
    """Curvature, 1/m, from what has no stress.

    a, b: 1/m, bends from it; natural: 1/m, without load.  Where the way that sections are curved is unknown, it is the most
    that both curvatures can make.
    """
    if not natural > 0.0:
        return curvature
    return curvature + natural if unknown else math.sqrt(a * a + b * b)


@inner
def bend_and_torque(line, ends, state, books, i, side, passed, natural):
    """Curvature, 1/m, as of `bend_from_natural`, and torque, N m, on a side of node i."""
    torque = load_on_side(line, ends, state, books, i, side, passed)[1]
    if not natural > 0.0:
        return curvature_at(line, ends, state, books, i, side), torque
    k = element_strain(line, ends, state, i)
    x, _, a, b, unknown = strain_on_side(line, ends, state, books, i, side, k, passed)
    return bend_from_natural(abs(x), natural, a, b, unknown), torque


@inner
def pressures(wall, z):
    """po and pi at a height; inside the pressure is never negative."""
    outside = wall[WATER] * max(wall[SURFACE] - z, 0.0)
    inside = max(wall[INSIDE] + wall[CONTENT] * (wall[INSIDE_Z] - z), 0.0) if wall[INNER] > 0.0 else 0.0
    return outside, inside


@inner
def tension_of_wall(wall, outside, inside, T):
    """F of a pipe under the tension T."""
    bore, full = 0.25 * math.pi * wall[INNER] ** 2, 0.25 * math.pi * wall[OUTER] ** 2
    return T + inside * bore - outside * full


@inner
def largest_stress(wall, outside, inside, F, curvature, torque):
    """Largest von Mises stress, Pa: at both surfaces of the wall, on both sides of the bend."""
    o2, i2 = wall[OUTER] ** 2, wall[INNER] ** 2
    over = 1.0 / (o2 - i2)
    m, w = (inside * i2 - outside * o2) * over, (inside - outside) * o2 * i2 * over
    even, most = F * over * (4.0 / math.pi), 0.0
    for k in range(2):
        d = wall[INNER] if k == 0 else wall[OUTER]
        change = w / (d * d)
        shear = torque * d * over * (16.0 / math.pi) / (o2 + i2)
        bend = 0.5 * wall[MODULUS] * curvature * d
        for axial in (even - bend, even + bend):
            across = axial - m
            # of the stresses axial, m + change and m - change
            most = max(most, across * across + 3.0 * change * change + 3.0 * shear * shear)
    return math.sqrt(most)


@kernel
def note_pipes(line, ends, state, books, t):
    """Widen the ranges of wall tension and stress to the state at time t (s)."""
    n, walls = line.h.shape[0], books.walls
    zone, section = 0, 0
    for i in range(n + 1):
        passed, zone = passed_torque(line, state.turn, i, zone)
        for side in (-1, 1):
            if side > 0:
                while (
                    i < n and section + 1 < walls.shape[0] and line.s[i] + 0.5 * line.h[i] > walls[section, SECTION_END]
                ):
                    section += 1
                if i == n or (i > 0 and has_one_value(line, books, i)):
                    break
            elif i == 0:
                continue
            wall, column = walls[section], i if side < 0 else books.right[i]
            outside, inside = pressures(wall, state.r[i, 2])
            F = tension_of_wall(wall, outside, inside, tension_at(line, ends, state, books, i, side))
            stress = 0.0
            if wall[MODULUS] > 0.0:
                curvature, torque = bend_and_torque(line, ends, state, books, i, side, passed, wall[NATURAL])
                stress = largest_stress(wall, outside, inside, F, curvature, torque)
            widen(books.extremes, WALL_TENSION, column, F, t)
            widen(books.extremes, VON_MISES, column, stress, t)


@kernel
def observe_pipes(walls, sections, z, T, bend, force, stress):
    """Wall tension and stress (ns, nb) of outputs, at heights z under tensions T; stress is NaN where there is no pipe.

    sections: (ns, nb) rows of `walls`; bend: (5, ns, nb) curvature, torque, and of `bend_from_natural` a, b and whether
    they are unknown.
    """
    for i in range(T.shape[0]):
        for j in range(T.shape[1]):
            wall = walls[sections[i, j]]
            outside, inside = pressures(wall, z[i, j])
            force[i, j] = tension_of_wall(wall, outside, inside, T[i, j])
            stress[i, j] = math.nan
            if wall[MODULUS] > 0.0:
                a, b, unknown = bend[2, i, j], bend[3, i, j], bend[4, i, j] > 0.0
                curvature = bend_from_natural(bend[0, i, j], wall[NATURAL], a, b, unknown)
                stress[i, j] = largest_stress(wall, outside, inside, force[i, j], curvature, bend[1, i, j])


# Kinds, by their names in a scene (scene.quantities.KINDS).
HORIZONTAL_FORCE, VERTICAL_FORCE, FORCE_ALONG, DECLINATION, AZIMUTH, END_ANGLE = range(6)
UPLIFT, UPLIFT_ANGLE, TOUCHDOWN, TOUCHDOWN_EXCURSION, LAYBACK, CLEARANCE = range(6, 12)
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
def pull_at(held, loaded, report, k):
    """f at end k, and whether anything takes it."""
    if not (held[k] or loaded[k]):
        return (0.0, 0.0, 0.0), False
    return vector(report, FORCE_A + 3 * k), True


@inner
def touch_at(sea, s, r, k):
    """Arc length and place of the first point in contact from end k on; NaN: none."""
    n = s.shape[0] - 1
    step = 1 - 2 * k
    i = k * n
    _, here = bed_under(sea, get3(r, i))
    for _ in range(n):
        j = i + step
        _, there = bed_under(sea, get3(r, j))
        if max(here, there) > 0.0:
            x = 0.0
            if here <= 0.0:
                x = min(max(-here / (there - here), 0.0), 1.0)
            a, b = get3(r, i), get3(r, j)
            return s[i] + x * (s[j] - s[i]), add(a, scale(x, sub(b, a)))
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
def part_of_cell(s, asked, c):
    """Where the part of a cell that counts begins and ends, as parts of the cell."""
    if math.isnan(asked[FIRST]):  # all of it
        return 0.0, 1.0
    h = s[c + 1] - s[c]
    begin = min(max((asked[FIRST] - s[c]) / h, 0.0), 1.0)
    return begin, max(min(max((asked[LAST] - s[c]) / h, 0.0), 1.0), begin)


@inner
def radius_at(radii, s):
    """Radius of the section at an arc length; radii: (S, 2) where sections end, m, and their radii, m."""
    k = 0
    while k + 1 < radii.shape[0] and s > radii[k, 0]:
        k += 1
    return radii[k, 1]


@inner
def over_plane(seen, asked, first, last):
    """Least height over a plane of the cells from node `first` to `last`, and its arc length."""
    s, r, n, b = seen.s, seen.r, vector(asked, DIRECTION), vector(asked, POINT)
    least, where = math.inf, math.nan
    here = dot(n, sub(get3(r, first), b))
    for c in range(first, last):
        there, (x, y) = dot(n, sub(get3(r, c + 1), b)), part_of_cell(s, asked, c)
        low, high = here + x * (there - here), here + y * (there - here)
        height = min(low, high) - radius_at(seen.radii, 0.5 * (s[c] + s[c + 1]))
        if height < least:
            least, where = height, s[c] + (y if high < low else x) * (s[c + 1] - s[c])
        here = there
    return least, where


@inner
def from_path(seen, asked, reached, first, last):
    """Least clearance of the cells from node `first` to `last` from a path, and its arc length.

    Along the line a distance changes at most by the length that is passed, so that most cells need no distance.
    """
    s, radii, path = seen.s, seen.radii, seen.path
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
        u, (low, high) = get3(seen.e, c), part_of_cell(s, asked, c)
        if k >= first:
            ahead -= math.sqrt(dot(u, u))
            if ahead > least + widest:
                continue
        a = add(get3(seen.r, c), scale(low, u))
        distance, x, there = nearest_on(a, scale(high - low, u), path, begin, end)
        x = low + x * (high - low)
        found = distance - radius_at(radii, 0.5 * (s[c] + s[c + 1]))
        if k >= first:
            ahead = distance
        if found < least:
            least, where, nearest = found, s[c] + x * (s[c + 1] - s[c]), c
            if asked[OF_PATH] != 0.0:
                where = there
    reached[NEAREST] = nearest
    return least, where


@inner
def nodes_of(s, asked):
    """First and last node of the cells of which a part counts."""
    first, last = 0, s.shape[0] - 1
    if asked[FIRST] == asked[FIRST]:
        while first < last - 1 and s[first + 1] <= asked[FIRST]:
            first += 1
        while last > first + 1 and s[last - 1] >= asked[LAST]:
            last -= 1
    return first, last


@inner
def put_chords(seen, asked):
    """Put chords of the part that counts where a later line finds them."""
    s, path, begin = seen.s, seen.path, int(asked[PATH])
    first, last = nodes_of(s, asked)
    path[begin, 0] = last - first
    if last - first > int(asked[PATH_END]) - begin - 1:
        path[begin, 0], last = -1.0, first
    for c in range(first, last):
        row, (low, high) = path[begin + 1 + c - first], part_of_cell(s, asked, c)
        r, u = add(get3(seen.r, c), scale(low, get3(seen.e, c))), scale(high - low, get3(seen.e, c))
        for k in range(3):
            row[k], row[CHORD + k] = r[k], u[k]
        row[SQUARE], row[RADIUS] = dot(u, u), radius_at(seen.radii, 0.5 * (s[c] + s[c + 1]))
        row[BEGINS], row[SPANS] = s[c] + low * (s[c + 1] - s[c]), (high - low) * (s[c + 1] - s[c])


@inner
def clearance(seen, asked, reached):
    """Least clearance, m, and its arc length."""
    first, last = nodes_of(seen.s, asked)
    if asked[IS_PLANE] != 0.0:
        return over_plane(seen, asked, first, last)
    return from_path(seen, asked, reached, first, last)


@inner
def on_bed(seen, asked, reached, k, begins):
    """Touchdown, its excursion, or layback at end k; begins: whether the state is the first of all."""
    kind = asked[KIND]
    if kind == LAYBACK and asked[TO_TOUCHDOWN] == 0.0:
        x = get3(seen.r, (1 - k) * seen.e.shape[0])
    else:
        s, x = touch_at(seen.sea, seen.s, seen.r, k)
        if kind == TOUCHDOWN:
            return s
    if kind == LAYBACK:
        here = get3(seen.r, k * seen.e.shape[0])
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
def of_pull(seen, asked, reached, k):
    """What follows from the pull at end k; angles in degrees, NaN where there is no pull."""
    kind = asked[KIND]
    f, taken = (0.0, 0.0, 0.0), False
    if asked[IDLE] == 0.0:
        f, taken = pull_at(seen.held, seen.loaded, seen.report, k)
    if kind == HORIZONTAL_FORCE:
        return math.hypot(f[0], f[1])
    if kind == VERTICAL_FORCE:
        return f[2]
    along = vector(asked, DIRECTION)
    if kind == FORCE_ALONG:
        return dot(along, f)
    if UPLIFT <= kind <= UPLIFT_ANGLE:
        n, _ = bed_under(seen.sea, get3(seen.r, k * seen.e.shape[0]))
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


@inner
def value_of(seen, asked, reached, begins):
    """Value of a quantity, and where a clearance is; begins: whether references that are not known are those of now."""
    kind, k = asked[KIND], int(asked[END])
    if kind == CLEARANCE:
        return clearance(seen, asked, reached)
    if kind >= TOUCHDOWN:
        return on_bed(seen, asked, reached, k, begins), math.nan
    return of_pull(seen, asked, reached, k), math.nan


@kernel
def observe_quantity(seen, asked, reached, found):
    """Values and places (2, nb) of a quantity of outputs; all arrays of `seen` but those of the line have outputs first.

    s and path may have one row for all outputs.
    """
    for j in range(found.shape[1]):
        s, path = seen.s[min(j, seen.s.shape[0] - 1)], seen.path[min(j, seen.path.shape[0] - 1)]
        one = Seen(s, seen.r[j], seen.e[j], seen.sea, seen.held[j], seen.loaded, seen.report[j], seen.radii, path)
        reached[NEAREST] = 0.0  # an output by itself has the same place
        found[0, j], found[1, j] = value_of(one, asked, reached, True)


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
    seen = Seen(
        job.line.s, state.r, state.e, job.sea, job.ends.held, books.loaded, books.report[0], books.radii, books.path
    )
    for q in range(books.asked.shape[0]):
        asked, reached = books.asked[q], books.reached[q]
        kind = asked[KIND]
        if kind == CHORDS:
            put_chords(seen, asked)
            continue
        if kind == CLEARANCE and asked[COUNTED] != 0.0 and books.path[int(asked[PATH]), 0] < 0.0:
            reached[SMALLEST], reached[LARGEST] = -math.inf, math.inf  # nobody knows
            continue
        x, place = value_of(seen, asked, reached, begins)
        if x < reached[SMALLEST]:
            reached[SMALLEST], reached[TIMES], reached[PLACES] = x, t, place
        if x > reached[LARGEST]:
            reached[LARGEST], reached[TIMES + 1], reached[PLACES + 1] = x, t, place
    return 0
