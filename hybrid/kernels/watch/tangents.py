"""What the motion of a line answers to numbers of its scene.

How the kinematics of waves differ a little beside a place: their slopes, for lines beside that of a run.

    symbol   meaning                                                                      unit
    L, U     A w cosh and A w sinh of k(d + S), by sinh kd, of a component                m/s
    S        depth at which components are taken, stretched after Wheeler (laws.water)    m
    theta    phase of a component                                                         rad

Velocity is (kx/k L cos, ky/k L cos, U sin) of theta, acceleration (w kx/k L sin, w ky/k L sin, -w U cos).  By x, y and
S both are symmetric and without trace: five sums each; S and the elevation follow from those of the surface.

Tangents go along the steps of a run (docs/theory.md, 22).  A step solves R(new, old; p) = 0.  With x' the tangent of
what is known of its end (`old`, predicted), another line, of a scene with a little more of p, stands at new + h x';
what its equations leave over, less what those of the line leave over, by h, is the right-hand side of the correction of
x', whose matrix is the one that Newton factored last.

    symbol   meaning
    h        part of a number by which the scene of the other line differs
    rates    tangents of r, v, a, vd, T, w, wa, wd; of the director `spin`, by which it turns about the chord
             beyond what carries it from the chord of the line to that of the other one
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, spin_about, sub
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.end_motion import ends_at, sea_at
from hybrid.kernels.laws.water import LAST, cos_sin, exp_of_small, still_below, wave_kinematics
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.assembly_plane import left_over_in_plane
from hybrid.kernels.march.march import carry_director, left_over_in_space
from hybrid.kernels.state.books import Books, Clock, Counts
from hybrid.kernels.state.report import ASSEMBLED, ROTARY, STIFFNESS_DAMPING, WAVES
from hybrid.kernels.state.state import LANES, Ends, Floats, Line, Moves, NumberRows, Rows, Sea, State, Work, blanks
from hybrid.kernels.step.accept import keep_past, sample_step

# Columns of slopes.
VELOCITY = 0  # 5, of velocity, 1/s: xx, xy, yy, xz, yz
ACCELERATION = 5  # 5, of acceleration, 1/s2, the same
DEPTH = 10  # 3, of S by x, y, z
ELEVATION = 13  # 2, of the elevation by x and y
SLOPES = 15
# Rows of the room for LANES nodes: x, y, S, elevation, its slopes, the ten sums; then cosine and sine of each component.
SUMS, PHASES = 6, 16


@inner
def surface_beside(sea, r, first, lanes):
    """The first six rows of the room, and phases."""
    waves = sea.waves
    for l in range(LANES):
        i = min(first + l, r.shape[0] - 1)
        lanes[0, l], lanes[1, l], lanes[2, l] = r[i, 0], r[i, 1], r[i, 2]
        for k in range(3, PHASES):
            lanes[k, l] = 0.0
    for j in range(waves.shape[0]):
        A, kx, ky = waves[j, 0], waves[j, 2], waves[j, 3]
        phase = waves[j, 4] - waves[j, 1] * sea.now[0]
        for l in range(LANES):
            c, s = cos_sin(kx * lanes[0, l] + ky * lanes[1, l] + phase)
            lanes[PHASES + 2 * j, l], lanes[PHASES + 1 + 2 * j, l] = c, s
            lanes[3, l] += A * c
            lanes[4, l] -= A * kx * s
            lanes[5, l] -= A * ky * s


@inner
def stretch_beside(sea, lanes, l):
    """S of lane l, in place of the height, and its slopes by x, y, z."""
    part = sea.now[2]
    eta, slope_x, slope_y = part * lanes[3, l], part * lanes[4, l], part * lanes[5, l]
    height, up = lanes[2, l] - sea.surface, sea.stretched * eta
    follows, by_z = -sea.stretched, 1.0
    if height >= eta:
        height, follows, by_z = eta, 1.0 - sea.stretched, 0.0
    S, x, y = height - up, follows * slope_x, follows * slope_y
    if sea.depth < math.inf:
        q = sea.depth / (sea.depth + up)
        less = S * q / (sea.depth + up) * sea.stretched
        S, x, y, by_z = S * q, q * x - less * slope_x, q * y - less * slope_y, q * by_z
        if sea.depth + S < 0.0:
            S, x, y, by_z = -sea.depth, 0.0, 0.0, 0.0
    lanes[2, l] = S
    return x, y, by_z


@inner
def sum_slopes(sea, lanes):
    """The ten sums of the fully grown waves."""
    waves, highest = sea.waves, -math.inf
    for l in range(LANES):
        highest = max(highest, lanes[2, l])
    for j in range(waves.shape[0]):
        w, kx, ky, k = waves[j, 1], waves[j, 2], waves[j, 3], waves[j, 5]
        if k * highest < LAST:
            continue
        q = math.exp(-2.0 * k * sea.depth) if sea.depth < math.inf else 0.0
        speed, xx, xy, yy = sea.orbits[j] / (1.0 - q), kx * kx / k, kx * ky / k, ky * ky / k
        for l in range(LANES):
            y = k * lanes[2, l]
            fade = exp_of_small(max(y, LAST))
            here = speed if y >= LAST else 0.0
            level, up = here * (fade + q / fade), here * (fade - q / fade)
            c, s = lanes[PHASES + 2 * j, l], lanes[PHASES + 1 + 2 * j, l]
            lanes[6, l] -= xx * level * s
            lanes[7, l] -= xy * level * s
            lanes[8, l] -= yy * level * s
            lanes[9, l] += kx * up * c
            lanes[10, l] += ky * up * c
            lanes[11, l] += w * xx * level * c
            lanes[12, l] += w * xy * level * c
            lanes[13, l] += w * yy * level * c
            lanes[14, l] += w * kx * up * s
            lanes[15, l] += w * ky * up * s


@kernel
def wave_slopes(sea, r, lanes, slopes):
    """Fill slopes (N+1, 15) at the positions r (N+1, 3), of the sea of `kernels.laws.water.wave_kinematics`.

    lanes: room (16 + 2 W, LANES).
    """
    part, rate, calm, n = sea.now[2], sea.now[3], still_below(sea), r.shape[0]
    for first in range(0, n, LANES):
        deep = True
        for i in range(first, min(first + LANES, n)):
            deep = deep and r[i, 2] < calm
            for k in range(SLOPES):
                slopes[i, k] = 0.0
        if deep:
            continue
        surface_beside(sea, r, first, lanes)
        for l in range(LANES):
            x, y, z = stretch_beside(sea, lanes, l)
            if first + l < n:
                i = first + l
                slopes[i, DEPTH], slopes[i, DEPTH + 1], slopes[i, DEPTH + 2] = x, y, z
                slopes[i, ELEVATION], slopes[i, ELEVATION + 1] = part * lanes[4, l], part * lanes[5, l]
        sum_slopes(sea, lanes)
        for i in range(first, min(first + LANES, n)):
            for k in range(5):
                slow = lanes[SUMS + k, i - first]
                slopes[i, VELOCITY + k] = part * slow
                slopes[i, ACCELERATION + k] = part * lanes[SUMS + 5 + k, i - first] + rate * slow


@inner
def along_slopes(row, at, x, y, z):
    """What five slopes from a column on make of (x, y, z), z along S."""
    xx, xy, yy, xz, yz = row[at], row[at + 1], row[at + 2], row[at + 3], row[at + 4]
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y - (xx + yy) * z


@kernel
def waves_beside(flow, slopes, h, rates, beside):
    """Fill the flow (N+1, 7) at h times rates (N+1, 3) from places where it is `flow`."""
    for i in range(flow.shape[0]):
        row = slopes[i]
        x, y = h * rates[i, 0], h * rates[i, 1]
        S = row[DEPTH] * x + row[DEPTH + 1] * y + row[DEPTH + 2] * h * rates[i, 2]
        u, v, w = along_slopes(row, VELOCITY, x, y, S)
        beside[i, 0], beside[i, 1], beside[i, 2] = flow[i, 0] + u, flow[i, 1] + v, flow[i, 2] + w
        u, v, w = along_slopes(row, ACCELERATION, x, y, S)
        beside[i, 3], beside[i, 4], beside[i, 5] = flow[i, 3] + u, flow[i, 4] + v, flow[i, 5] + w
        beside[i, 6] = flow[i, 6] + row[ELEVATION] * x + row[ELEVATION + 1] * y


# What is counted: steps that were followed; those that did not begin where the one before had ended.
FOLLOWED, BROKEN = range(2)
# Sizes of tangents of positions, m, and of tensions, N, by the number: the largest of all steps, their largest second
# corrections, the most that is left behind the last one; steps; whether the last one had one correction alone.
LARGEST_R, SECOND_R, LEFT_R, LARGEST_T, SECOND_T, LEFT_T, STEPS, ALONE = range(8)
TANGENT_SIZES = 8


class OtherLine(NamedTuple):
    """The line of a scene with more of a number, beside the line of a run."""

    line: Line
    sea: Sea
    ends: Ends
    moves: Moves
    even: State  # which take turns, as those of the run
    odd: State
    rates: State  # tangents, of the last step's end; e and a1 are not used
    spin: Floats  # (N,) rad
    before: State  # the same before the step
    spin_before: Floats  # (N,)
    work: Work
    books: Books  # the clock is that of the run; what is sampled is the other line
    left: Rows  # (N+1, 5) what its equations leave over
    sizes: Floats  # (8,) named above
    same_waves: int  # 1 where its waves are those of the run
    h: float


class TangentJob(NamedTuple):
    """A line of a run and those beside it (kernels.run.network_tangents)."""

    line: Line
    sea: Sea  # that of the run, but with room of its own for what an assembly writes
    ends: Ends
    even: State  # of the run
    odd: State
    work: Work  # of the run, whose last matrix is kept in X
    own: Work  # the same with a report of what the equations of the line leave over
    clock: Clock
    counts: Counts
    left: Rows  # (N+1, 5) what the equations of the line leave over
    last: Rows  # (N+1, 3) m/s2, a of the state that the last step led to
    ahead: Rows  # (N+1, 3) m, where the prediction of a step leads nodes
    slopes: Rows  # (N+1, 15) of waves there (kernels.watch.tangents); empty: none are needed
    lanes: Rows  # (16 + 2 W, LANES) room for them
    found: NDArray[np.int64]  # (2,) named above
    tables: NumberRows  # (P, size) of an OtherLine each


blank_other = blanks(OtherLine)


blank_tangent_job = blanks(TangentJob)
read_other, read_job = reader(blank_other()), reader(blank_tangent_job())


# A second correction that is less than this part of all tangents is left out, behind so many steps that have two.
ENOUGH, JUDGED = 4e-7, 10
# Of a step: an output so near to its end is its end.
ON_STEP = 1e-6


@inner
def put_other(plane, space, line, here, rates, spin, h, there):
    """Fill `there`, where the other line stands: `here` and h times the tangents."""
    n = here.e.shape[0]
    for i in range(n + 1):
        for k in range(3):
            there.r[i, k] = here.r[i, k] + h * rates.r[i, k]
            there.v[i, k] = here.v[i, k] + h * rates.v[i, k]
            there.a[i, k] = here.a[i, k] + h * rates.a[i, k]
            there.vd[i, k] = here.vd[i, k] + h * rates.vd[i, k]
    for c in range(n):
        for k in range(3):
            there.e[c, k] = here.e[c, k] + h * (rates.r[c + 1, k] - rates.r[c, k])
        there.T[c] = here.T[c] + h * rates.T[c]
        there.w[c] = here.w[c] + h * rates.w[c]
        there.wa[c] = here.wa[c] + h * rates.wa[c]
        there.wd[c] = here.wd[c] + h * rates.wd[c]
        a = get3(here.a1, c)
        if line.spin[c]:
            a = carry_director(plane, space, a, get3(here.e, c), get3(there.e, c))
            if space is not None:
                d, _, _ = chord(get3(there.e, c))
                a = spin_about(a, d, h * spin[c])
        there.a1[c, 0], there.a1[c, 1], there.a1[c, 2] = a


@inner
def carried_apart(old, new, other_old, other_new, c):
    """Spin, rad, between two ways to carry the director of cell c to the other line.

    To it before the step and along with it, against along with the line and to the other one behind the step.
    """
    a, to = get3(old.a1, c), get3(other_new.e, c)
    one = carry_director(None, 1, a, get3(old.e, c), get3(other_old.e, c))
    one = carry_director(None, 1, one, get3(other_old.e, c), to)
    two = carry_director(None, 1, a, get3(old.e, c), get3(new.e, c))
    two = carry_director(None, 1, two, get3(new.e, c), to)
    d, _, _ = chord(to)
    return math.atan2(dot(d, cross(two, one)), dot(two, one))


@inner
def predict_rates(space, line, s, was, spin_was, now, spin_now):
    """Tangents of the end of a step as they are predicted, from those before it."""
    dt, am, af, _, be, cv, ca = s
    n = was.T.shape[0]
    for i in range(n + 1):
        for k in range(3):
            a = was.a[i, k]
            now.r[i, k] = was.r[i, k] + dt * was.v[i, k] + 0.5 * dt * dt * a
            now.v[i, k] = was.v[i, k] + dt * a
            now.vd[i, k] = (am * a - af * was.vd[i, k]) / (1.0 - af) + ca * be * dt * dt * a
            now.a[i, k] = a
    for c in range(n):
        now.T[c], spin_now[c] = was.T[c], spin_was[c]
        now.w[c], now.wa[c], now.wd[c] = 0.0, 0.0, 0.0
        if space is not None:
            if line.spin[c]:
                spun = dt * was.w[c] + 0.5 * dt * dt * was.wa[c]
                now.w[c] = was.w[c] + dt * was.wa[c]
                now.wd[c] = (am * was.wa[c] - af * was.wd[c]) / (1.0 - af) + ca * be * dt * dt * was.wa[c]
                if line.bits & ROTARY:
                    spin_now[c] += spun
                else:
                    now.w[c] -= cv * spun
                    now.wd[c] -= ca * spun


@inner
def hold_ends(ends, other, s, now):
    """Held ends are where those of the other line are held."""
    n = now.T.shape[0]
    for k in range(2):
        if ends.held[k] == 1:
            i = 0 if k == 0 else n
            for j in range(3):
                more = (other.ends.position[k, j] - ends.position[k, j]) / other.h - now.r[i, j]
                now.r[i, j] += more
                now.v[i, j] += s.cv * more
                now.vd[i, j] += s.ca * more


@inner
def correct_rates(space, x, s, now, spin_now):
    """Add a correction x (N+1, 5) to tangents."""
    n = now.T.shape[0]
    for i in range(n + 1):
        for k in range(3):
            now.r[i, k] += x[i, k + 1]
            now.v[i, k] += s.cv * x[i, k + 1]
            now.vd[i, k] += s.ca * x[i, k + 1]
    for c in range(n):
        now.T[c] += x[c + 1, 0]
        if space is not None:
            spin_now[c] += x[c, 4]
            now.w[c] += s.cv * x[c, 4]
            now.wd[c] += s.ca * x[c, 4]


@inner
def find_tangent_rates(space, line, s, was, now):
    """Tangents of algorithmic accelerations (kernels.step.step.find_rates)."""
    dt, _, _, ga, be, _, _ = s
    for i in range(now.r.shape[0]):
        for k in range(3):
            rp = was.r[i, k] + dt * was.v[i, k] + dt * dt * (0.5 - be) * was.a[i, k]
            now.a[i, k] = (now.r[i, k] - rp) / (be * dt * dt)
    if space is not None:
        for c in range(now.T.shape[0]):
            if line.spin[c]:
                now.wa[c] = (now.w[c] - was.w[c] - dt * (1.0 - ga) * was.wa[c]) / (ga * dt)


@inner
def foresee_slopes(job, s, old):
    """Slopes of waves where the prediction of the step leads the line of the run."""
    ahead = job.ahead
    for i in range(ahead.shape[0]):
        for k in range(3):
            ahead[i, k] = old.r[i, k] + s.dt * old.v[i, k] + 0.5 * s.dt * s.dt * old.a[i, k]
    wave_slopes(job.sea, ahead, job.lanes, job.slopes)


@inner
def predict_other(job, other, s, there_old, u):
    """What the other line takes from the prediction of its step, to which tangents have come: waves where that leads."""
    line, sea = other.line, other.sea
    if not line.bits & WAVES:
        return
    if other.same_waves:
        waves_beside(job.sea.flow, job.slopes, other.h, other.rates.r, sea.flow)
        return
    for i in range(u.shape[0]):
        for k in range(3):
            u[i, k] = s.dt * there_old.v[i, k] + 0.5 * s.dt * s.dt * there_old.a[i, k]
    wave_kinematics(sea, there_old.r, u)


@inner
def damped_more(line, other, here, there, now, longer, c):
    """Change of the lag of cell c's length behind its stretching, m by the number, without rounding.

    longer: by how much its chord is longer.
    """
    if not line.bits & STIFFNESS_DAMPING or not line.ck[c] > 0.0:
        return 0.0
    d, l, _ = chord(get3(here.e, c))
    faster, to = sub(get3(here.v, c + 1), get3(here.v, c)), sub(get3(there.v, c + 1), get3(there.v, c))
    more, more_v = sub(get3(now.r, c + 1), get3(now.r, c)), sub(get3(now.v, c + 1), get3(now.v, c))
    rate = (l * dot(d, more_v) + dot(more, to) - dot(d, faster) * longer) / (l + other.h * longer)
    turned, _, _ = chord(get3(there.e, c))
    return (other.line.tau[c] - line.tau[c]) / other.h * dot(turned, to) + line.tau[c] * rate


@inner
def length_left(line, other, here, there, now, c):
    """What the law of length of cell c leaves over, by h: without what rounding of lengths would make of tension."""
    if c < 0:
        return 0.0
    h, its = other.h, other.line
    e, more = get3(here.e, c), sub(get3(now.r, c + 1), get3(now.r, c))
    f = (e[0] + h * more[0], e[1] + h * more[1], e[2] + h * more[2])
    longer = dot(add(e, f), more) / (math.sqrt(dot(e, e)) + math.sqrt(dot(f, f)))
    stretched = its.h[c] * its.ck[c] * there.T[c] - line.h[c] * line.ck[c] * here.T[c]
    late = damped_more(line, other, here, there, now, longer, c)
    return (stretched + (its.h[c] - line.h[c])) / h - late - longer


@inner
def largest_correction(x):
    """Of positions, m, and of tensions, N, by the number."""
    r, T = 0.0, 0.0
    for i in range(x.shape[0]):
        T = max(T, abs(x[i, 0]))
        r = max(r, max(abs(x[i, 1]), max(abs(x[i, 2]), abs(x[i, 3]))))
    return r, T


@inner
def note_left(r, T, before_r, before_T, wanted, now, sizes):
    """Keep how large tangents are, and what the last of two or three corrections leaves of them.

    r, T: its sizes, those of the one before.  Tangents converge by equal parts; forces at ends are those before the last
    correction.
    """
    for i in range(now.r.shape[0]):
        for k in range(3):
            sizes[LARGEST_R] = max(sizes[LARGEST_R], abs(now.r[i, k]))
    for c in range(now.T.shape[0]):
        sizes[LARGEST_T] = max(sizes[LARGEST_T], abs(now.T[c]))
    if not wanted and sizes[ALONE] == 0.0:  # else it is what one correction has left in the steps before
        r *= r / before_r if before_r > r else 1.0
        T *= T / before_T if before_T > T else 1.0
    sizes[LEFT_R], sizes[LEFT_T] = max(sizes[LEFT_R], r), max(sizes[LEFT_T], T)


@inner
def is_wanted(books):
    """Whether forces are wanted of the end of the last step."""
    clock, outputs, k = books.clock, books.outputs, books.counts.output
    if k >= outputs.shape[0]:
        return False
    ahead = (outputs[k] - clock.now) / clock.last_dt  # in steps; within one, those before it count as well
    return ahead < (2.0 if abs(ahead - round(ahead)) > ON_STEP else 0.5)


@inner
def needs_two(sizes):
    """Whether one correction of tangents is not enough."""
    enough = sizes[SECOND_R] <= ENOUGH * sizes[LARGEST_R] and sizes[SECOND_T] <= ENOUGH * sizes[LARGEST_T]
    return not enough or sizes[STEPS] < JUDGED


@inner
def leave_apart(job, other, here, there):
    """What the equations of the other line leave over (other.left), less what those of the line do, by h."""
    h, b = other.h, other.left
    for i in range(b.shape[0]):
        b[i, 0] = length_left(job.line, other, here, there, other.rates, i - 1)
        for k in range(1, 5):
            b[i, k] = (b[i, k] - job.left[i, k]) / h


@inner
def leave_over(plane, space, job, other, s, here, there_old, there):
    """Put the other line at the tangents of the end of a step, and leave over what its equations do."""
    line, h, now, was = other.line, other.h, other.rates, other.before
    work, b = other.work, other.left
    put_other(plane, space, line, here, now, other.spin, h, there)
    for i in range(b.shape[0]):
        for k in range(3):
            work.u[i, k] = job.work.u[i, k] + h * (now.r[i, k] - was.r[i, k])
    if space is not None:
        left_over_in_space(line, other.sea, other.ends, there_old.r, there, s.cv, s.ca, work, b)
    if plane is not None:
        left_over_in_plane(line, other.sea, other.ends, there_old.r, there, s.cv, s.ca, work, b)
    leave_apart(job, other, here, there)


@inner
def stay_held(job, x):
    """Held ends are not corrected: rounding would lift one that lies at the very edge of the bed."""
    for k in range(2):
        if job.ends.held[k] == 1:
            i = 0 if k == 0 else x.shape[0] - 1
            x[i, 1], x[i, 2], x[i, 3] = 0.0, 0.0, 0.0


@inner
def turn_over(was, now, spin_was, spin_now):
    """What was now is before the step."""
    for i in range(was.r.shape[0]):
        for k in range(3):
            was.r[i, k], was.v[i, k], was.a[i, k] = now.r[i, k], now.v[i, k], now.a[i, k]
            was.vd[i, k] = now.vd[i, k]
    for c in range(was.T.shape[0]):
        was.T[c], was.w[c], was.wa[c], was.wd[c] = now.T[c], now.w[c], now.wa[c], now.wd[c]
        spin_was[c] = spin_now[c]


@inner
def begin_other(space, job, other, s, there_old):
    """Ends and sea of the other line at the end of a step, and its tangents there as they are predicted."""
    sea, now = other.sea, other.rates
    ends_at(job.clock.now, other.moves, sea, other.ends, other.books.velocity)
    sea_at(job.clock.now, sea)
    turn_over(other.before, now, other.spin_before, other.spin)
    predict_rates(space, other.line, s, other.before, other.spin_before, now, other.spin)
    predict_other(job, other, s, there_old, other.work.u)
    hold_ends(job.ends, other, s, now)


@inner
def carry_spins(plane, space, other, old, new, there_old, there):
    """Spins of directors that are carried to the other line, beside those of this one."""
    line, h = other.line, other.h
    if space is not None:
        if line.bits & (ROTARY | STIFFNESS_DAMPING):
            put_other(plane, space, line, new, other.rates, other.spin, h, there)
            for c in range(old.T.shape[0]):
                if line.spin[c]:
                    other.spin[c] += carried_apart(old, new, there_old, there, c) / h


@inner
def end_other(plane, space, job, other, s, new, there_old, there, report):
    """The other line stands where tangents lead, and its outputs are sampled; report: of the step of the run."""
    line, mine = other.line, other.work.report
    find_tangent_rates(space, line, s, other.before, other.rates)
    put_other(plane, space, line, new, other.rates, other.spin, other.h, there)
    for j in range(mine.shape[0]):
        if j < ASSEMBLED:
            mine[j] = report[j] + mine[j] - job.own.report[j]
        else:
            mine[j] = report[j]
    keep_past(line, other.ends, there_old, other.books, mine)
    sample_step(line, other.sea, there_old, there, other.books)


@inner
def keep_own(plane, space, job, s, old, new):
    """Keep the residuals of the line of the run at the end of a step.

    Also whether the step began where the one before had ended.
    """
    found = job.found
    for i in range(old.a.shape[0]):
        for k in range(3):
            if old.a[i, k] != job.last[i, k]:
                found[BROKEN] = 1
            job.last[i, k] = new.a[i, k]
    found[FOLLOWED] += 1
    if job.slopes.shape[0] > 0:
        foresee_slopes(job, s, old)
    if space is not None:
        left_over_in_space(job.line, job.sea, job.ends, old.r, new, s.cv, s.ca, job.own, job.left)
    if plane is not None:
        left_over_in_plane(job.line, job.sea, job.ends, old.r, new, s.cv, s.ca, job.own, job.left)
