"""What follows a try of a step in a compiled run: its judgement, its books, and the state at times within it.

Steps end where the motion asks for it, outputs fall where the user asks for them.  Between the two states of a step
positions are cubic in time by the velocities at both ends (Hermite), chords likewise with lengths that change evenly,
tensions, reactions and the twist at held ends lie on the parabola through the step before as well, frames turn as cubics of their spins,
accelerations change evenly: of second order and more (docs/theory.md, 2).
Such states are rows of a run's samples.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    get3,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    mat_mat,
    mat_vec,
    scale,
    spin_about,
    sub,
    vec_mat,
)
from hybrid.kernels.laws.element import chord, relative_rotation
from hybrid.kernels.laws.end_motion import sea_at, turn_by_vector
from hybrid.kernels.laws.obstacle_grip import sample_obstacles
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.march.march import carry_director
from hybrid.kernels.march.zone_torque import POWER
from hybrid.kernels.state.books import (
    BENDS,
    BENT,
    BENT_BY,
    COLLAPSES,
    HEAD,
    ITERATIONS_CUT,
    JUMPED,
    LEAVES_PLANE,
    NEARS_PLANE,
    PUSH_DIED,
    RATES,
    SAMPLE_FORCE,
    SAMPLE_FRAME,
    SAMPLE_MOMENT,
    SAMPLE_POSITION,
    SAMPLE_REPORT,
    SAMPLE_SEA,
    SAMPLE_SPIN,
    SAMPLE_WORK,
    SLACKENED,
    STEPS_CUT,
    STEPS_SLACK,
    STRETCHED,
    WORKS,
    ZONES,
)
from hybrid.kernels.state.report import (
    ASSEMBLED,
    BEND,
    LENGTH_OUT,
    PAYOUT_RATE,
    PLANAR,
    PUSH_ENERGY,
    REPORT_SIZE,
    SEEN,
    SELF_FRICTION,
    TOUCHES,
    TWIST,
    WRONG_PIVOTS,
)

# --- the state at a time within a step ---------------------------------------------------------

# Of the step: an output so near to its end is its end.
SAME_TIME = 1e-9


@inner
def hermite(x, dt, a, va, b, vb):
    """Value and rate at the part x of a step of dt, from a with rate va to b with rate vb."""
    y = 1.0 - x
    change = sub(b, a)
    lean_a, lean_b = sub(scale(dt, va), change), sub(change, scale(dt, vb))
    value = add(add(scale(y, a), scale(x, b)), scale(x * y, add(scale(y, lean_a), scale(x, lean_b))))
    rate = add(change, add(scale(y * (1.0 - 3.0 * x), lean_a), scale(x * (2.0 - 3.0 * x), lean_b)))
    return value, scale(1.0 / dt, rate)


@inner
def parabola(x, k, earlier, a, b):
    """Value at the part x of a step from a to b; earlier: k steps before a; k = 0: not known, and it is a straight line."""
    line = (1.0 - x) * a + x * b
    if not k > 0.0:
        return line
    return line - x * (1.0 - x) * ((b - a) - (a - earlier) / k) / (1.0 + k)


@inner
def put3(row, at, i, value):
    at += 3 * i
    row[at], row[at + 1], row[at + 2] = value


@inner
def sample_nodes(old, new, x, dt, row):
    """Positions, velocities and accelerations of the nodes."""
    n = old.r.shape[0]
    for i in range(n):
        r, v, vd = get3(new.r, i), get3(new.v, i), get3(new.vd, i)
        if x < 1.0:
            vd = add(scale(1.0 - x, get3(old.vd, i)), scale(x, vd))
            r, v = hermite(x, dt, get3(old.r, i), get3(old.v, i), r, v)
        put3(row, HEAD, i, r)
        put3(row, HEAD + 3 * n, i, v)
        put3(row, HEAD + 6 * n, i, vd)


@inner
def chord_between(old, new, c, x, dt):
    """Chord of cell c: its direction from the cubic, its length by parts."""
    a, b = get3(old.e, c), get3(new.e, c)
    va, vb = sub(get3(old.v, c + 1), get3(old.v, c)), sub(get3(new.v, c + 1), get3(new.v, c))
    e, _ = hermite(x, dt, a, va, b, vb)
    length = (1.0 - x) * math.sqrt(dot(a, a)) + x * math.sqrt(dot(b, b))
    return scale(length / math.sqrt(dot(e, e)), e)


@inner
def frame_between(before, R, w0, w1, x, dt):
    """Frame at the part x of a step of dt from `before` to R, which turn with w0 and w1 (1/s, inertial).

    The rotation vector from `before` on is a cubic with the rates that these give it, as chords are.
    """
    turn = log_rotation(relative_rotation(before, R))
    g, _ = jacobian_functions(dot(turn, turn))
    rate = mat_vec(inverse_left_jacobian(turn, g), vec_mat(w1, before))
    here, _ = hermite(x, dt, (0.0, 0.0, 0.0), vec_mat(w0, before), turn, rate)
    turned, _ = turn_by_vector(here, (0.0, 0.0, 0.0))
    return mat_mat(before, turned)


@inner
def cell_frame(e, a):
    """Frame of a cell with the chord e and the first director a."""
    d, _, _ = chord(e)
    b = cross(d, a)
    return (a[0], b[0], d[0], a[1], b[1], d[1], a[2], b[2], d[2])


@inner
def cell_turn(state, c):
    """Angular velocity of cell c (1/s, inertial): d x dd/dt + w d."""
    d, l, _ = chord(get3(state.e, c))
    rate = sub(get3(state.v, c + 1), get3(state.v, c))
    return add(scale(1.0 / l, cross(d, rate)), scale(state.w[c], d))


@inner
def director_between(line, old, new, c, x, dt, e):
    """First director of cell c with the chord e: that of its frame between both ends of the step, brought to e."""
    if line.bits & PLANAR:
        return carry_director(line.plane, None, get3(old.a1, c), get3(old.e, c), e)
    before, after = cell_frame(get3(old.e, c), get3(old.a1, c)), cell_frame(get3(new.e, c), get3(new.a1, c))
    R = frame_between(before, after, cell_turn(old, c), cell_turn(new, c), x, dt)
    return carry_director(None, 1, (R[0], R[3], R[6]), (R[2], R[5], R[8]), e)


@inner
def sample_cells(line, old, new, x, dt, k, tension, row):
    """Chords, tensions, directors and spins of the cells."""
    n = old.T.shape[0]
    at = HEAD + 9 * (n + 1)
    for c in range(n):
        e, T, a, w = get3(new.e, c), new.T[c], get3(new.a1, c), new.w[c]
        if x < 1.0:
            e = chord_between(old, new, c, x, dt)
            T, w = parabola(x, k, tension[1, c], old.T[c], T), (1.0 - x) * old.w[c] + x * w
            if line.spin[c]:
                a = director_between(line, old, new, c, x, dt, e)
        put3(row, at, c, e)
        row[at + 3 * n + c] = T
        put3(row, at + 4 * n, c, a)
        row[at + 7 * n + c] = w


@inner
def sample_line(line, x, strains, row):
    """Lengths of cells as they are at the end of the step, and stiffness of elements, whose bending changes evenly."""
    n = line.h.shape[0]
    at = HEAD + 9 * (n + 1) + 8 * n
    for c in range(n):
        row[at + c] = line.h[c]
    for i in range(n + 1):
        a, b, c = get3(line.kb, i)
        if x < 1.0 and strains.shape[0] > 0 and strains[i, BENT_BY] > 0.0 and a > 0.0:
            part = x + (1.0 - x) * strains[i, BENT_BY] / a
            a, b = part * a, part * b
        put3(row, at + n, i, (a, b, c))


@inner
def end_frame(imposed, m, k):
    """Frame of end k, now (m = 0) or before the last step (m = 1)."""
    f = imposed[m, k]
    return (f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11])


@inner
def sample_ends(imposed, x, dt, row):
    """What the ends impose: frames as cubics of their spins, the rest by parts."""
    for k in range(2):
        old, new = imposed[1, k], imposed[0, k]
        for j in range(3):
            at = 3 * k + j
            row[SAMPLE_POSITION + at] = (1.0 - x) * old[j] + x * new[j]
            row[SAMPLE_SPIN + at] = (1.0 - x) * old[12 + j] + x * new[12 + j]
            row[SAMPLE_FORCE + at] = (1.0 - x) * old[15 + j] + x * new[15 + j]
            row[SAMPLE_MOMENT + at] = (1.0 - x) * old[18 + j] + x * new[18 + j]
        R = end_frame(imposed, 0, k)
        if x < 1.0:
            w0, w1 = (old[12], old[13], old[14]), (new[12], new[13], new[14])
            R = frame_between(end_frame(imposed, 1, k), R, w0, w1, x, dt)
        for j in range(9):
            row[SAMPLE_FRAME + 9 * k + j] = R[j]


@inner
def twist_at_end(k, R, e, a):
    """Twist (rad) of the element between the frame R of end k and the cell with the chord e and first director a."""
    if k == 0:
        return log_rotation(relative_rotation(R, cell_frame(e, a)))[2]
    return log_rotation(relative_rotation(cell_frame(e, a), R))[2]


@inner
def spin_cells(line, k, angle, e, a1, row):
    """Turn the directors of the rod at end k: at the end by an angle, less and less along the rod, at last by nothing.

    e, a1: where chords and directors begin in the row.
    """
    n = line.h.shape[0]
    c, step, length = k * (n - 1), 1 - 2 * k, 0.0
    while 0 <= c < n and line.spin[c]:
        length += line.h[c]
        c += step
    c, here = k * (n - 1), length
    while 0 <= c < n and line.spin[c]:
        d, _, _ = chord((row[e + 3 * c], row[e + 3 * c + 1], row[e + 3 * c + 2]))
        a = (row[a1 + 3 * c], row[a1 + 3 * c + 1], row[a1 + 3 * c + 2])
        put3(row, a1, c, spin_about(a, d, angle * here / length))
        here -= line.h[c]
        c += step


@inner
def holds_twist(line, k):
    """Whether end k holds the twist of the line."""
    i = k * line.h.shape[0]
    return line.element[i] != 0 and line.kb[i, 2] > 0.0


@inner
def sample_end_twist(line, old, new, imposed, x, k_before, twist, row):
    """Turn the rods at ends that hold the twist.

    The twist of their last elements lies on the parabola through the step before then, as tensions do.
    That of frames which are interpolated one by one is off by next to nothing, times GJ over half a cell.
    twist: of these elements before the last step, and before the step before; k_before: as k of `parabola`.
    """
    n = old.T.shape[0]
    at = HEAD + 9 * (n + 1)
    for k in range(2):
        if not holds_twist(line, k):
            continue
        c, o, a1 = k * (n - 1), SAMPLE_FRAME + 9 * k, at + 4 * n
        R = (row[o], row[o + 1], row[o + 2], row[o + 3], row[o + 4], row[o + 5], row[o + 6], row[o + 7], row[o + 8])
        e = (row[at + 3 * c], row[at + 3 * c + 1], row[at + 3 * c + 2])
        a = (row[a1 + 3 * c], row[a1 + 3 * c + 1], row[a1 + 3 * c + 2])
        after = twist_at_end(k, end_frame(imposed, 0, k), get3(new.e, c), get3(new.a1, c))
        more = parabola(x, k_before, twist[1, k], twist[0, k], after) - twist_at_end(k, R, e, a)
        spin_cells(line, k, -more if k else more, at, a1, row)


@inner
def sample_head(sea, books, x, dt, k, t, row):
    """Time, growth of the sea, ends, report and work."""
    row[0] = t
    for j in range(4):
        row[SAMPLE_SEA + j] = sea.now[j]
    sample_ends(books.imposed, x, dt, row)
    report = books.report
    for j in range(REPORT_SIZE):
        row[SAMPLE_REPORT + j] = report[0, j]
        if x < 1.0:  # what the assembly reports follows from forces; the rest may jump
            row[SAMPLE_REPORT + j] = parabola(x, k if j < ASSEMBLED else 0.0, report[2, j], report[1, j], report[0, j])
    if x < 1.0 and report[0, LENGTH_OUT] > 0.0:
        a, b = (report[1, LENGTH_OUT], 0.0, 0.0), (report[0, LENGTH_OUT], 0.0, 0.0)
        ca, cb = (report[1, PAYOUT_RATE], 0.0, 0.0), (report[0, PAYOUT_RATE], 0.0, 0.0)
        out, rate = hermite(x, dt, a, ca, b, cb)
        row[SAMPLE_REPORT + LENGTH_OUT], row[SAMPLE_REPORT + PAYOUT_RATE] = out[0], rate[0]
    for j in range(WORKS):
        row[SAMPLE_WORK + j] = books.work[0, j]
        if x < 1.0:
            row[SAMPLE_WORK + j] = (1.0 - x) * books.work[1, j] + x * books.work[0, j]
            if j < RATES:  # the powers change evenly
                row[SAMPLE_WORK + j] -= 0.5 * x * (1.0 - x) * dt * (books.power[0, j] - books.power[1, j])


@inner
def sample_state(line, sea, old, new, books, where, row):
    """The state at a time within the last step as a row, with the sea of that time.

    where: that time (s), the part of the step before it, the length of the step (s), and that of the step before as a
    part of it, as k of `parabola`.
    """
    t, x, dt, k = where
    sample_nodes(old, new, x, dt, row)
    sample_cells(line, old, new, x, dt, k, books.tension, row)
    if x < 1.0 and not line.bits & PLANAR:
        sample_end_twist(line, old, new, books.imposed, x, k, books.twist, row)
    at = HEAD + 9 * new.r.shape[0] + 8 * new.T.shape[0]
    if books.counts.varies:
        sample_line(line, x, books.strains, row)
        at += line.h.shape[0] + line.kb.size
    for z in range(new.turn.shape[0]):
        for j in range(3):
            row[at + j] = x * new.turn[z, j] + (1.0 - x) * old.turn[z, j]
        at += 3
    for i in range(books.touch.shape[1]):
        row[at + i] = x * books.touch[0, i] + (1.0 - x) * books.touch[1, i]
    at += books.touch.shape[1]
    if line.moved.shape[0] > 0:
        sample_obstacles(sea, old, new, t, x, row, at)
        at += SEEN * line.moved.shape[0]
    for i in range(new.layers.shape[0]):
        for j in range(new.layers.shape[1]):
            row[at + j] = x * new.layers[i, j] + (1.0 - x) * old.layers[i, j]
        at += new.layers.shape[1]
    for i in range(new.soil.shape[0]):
        for j in range(new.soil.shape[1]):
            row[at + j] = x * new.soil[i, j] + (1.0 - x) * old.soil[i, j]
        at += new.soil.shape[1]


@inner
def sample_step(line, sea, old, new, books):
    """Sample the outputs that fall into the last step; False: the buffer is full before the last of them."""
    clock, count, outputs = books.clock, books.counts, books.outputs
    dt = clock.last_dt
    near = SAME_TIME * dt
    while count.output < outputs.shape[0] and outputs[count.output] <= clock.now + near:
        if count.samples == books.samples.shape[0]:
            return False
        t, x = outputs[count.output], 1.0
        if t < clock.now - near:
            x = (t - clock.previous) / dt
        sea_at(t, sea)
        row, k = books.samples[count.samples], clock.earlier_dt / dt if x < 1.0 else 0.0
        sample_head(sea, books, x, dt, k, t, row)
        sample_state(line, sea, old, new, books, (t, x, dt, k), row)
        count.samples += 1
        count.output += 1
    return True


# --- judgement and books -----------------------------------------------------------------------

# Twist of an element (rad) that could become its opposite unseen: the log strain ends at pi, and a step may add what
# an end turns in it (model.resolution.MOST_TURN); what goes beyond pi comes back as more than this.
LARGEST_TWIST = 2.0
# Growth of the speed of a push out of the plane at which the plane no longer holds: a disturbance of a thousandth of the
# length, which every real cable has, would by then be as large as the cable; swings that come and go stay below a tenth.
GROWN = 1e3
# A push that has died to this part is given anew, so that an instability that begins late is seen as early.
DIED = 1e-3
# Steps that are less than TINY of the longest one, MANY after another, have collapsed: somebody has to know.
TINY, MANY = 1e-3, 200


@inner
def collapses(clock, count, dt):
    """Whether steps have become so short, for so long, after a step of dt that is taken, that somebody has to know."""
    clock.longest = max(clock.longest, dt)
    if not dt < TINY * clock.longest:
        count.tiny_steps = count.cut_by_gain = count.cut_by_turn = count.cut_by_newton = count.cut_by_error = 0
        return False
    count.tiny_steps += 1
    return count.tiny_steps % MANY == 0


@inner
def note_cuts(clock, count, dt):
    """What there is to tell of how a step of dt that is taken was cut, as bits."""
    flags = 0
    if count.is_cut:
        count.cut_short += 1
        if count.cut_short == 1:
            flags |= ITERATIONS_CUT
    if collapses(clock, count, dt):
        flags |= COLLAPSES
    if clock.cut_angle > 0.0 and clock.mute_cuts == 0.0:
        flags |= STEPS_CUT
    if clock.slack_step > 0.0 and clock.mute_slack == 0.0:
        flags |= STEPS_SLACK
    return flags


@inner
def impose_now(ends, imposed):
    """What the ends impose now."""
    for k in range(2):
        for j in range(9):
            imposed[0, k, 3 + j] = ends.frame[k, j]
        for j in range(3):
            imposed[0, k, j], imposed[0, k, 12 + j] = ends.position[k, j], ends.spin[k, j]
            imposed[0, k, 15 + j], imposed[0, k, 18 + j] = ends.force[k, j], ends.moment[k, j]


@inner
def keep_end_twist(line, old, books):
    """Twist of the elements at both ends before the step, and before the one before it."""
    n = old.T.shape[0]
    for k in range(2):
        books.twist[1, k] = books.twist[0, k]
        if holds_twist(line, k):
            c = k * (n - 1)
            books.twist[0, k] = twist_at_end(k, end_frame(books.imposed, 1, k), get3(old.e, c), get3(old.a1, c))


@inner
def keep_past(line, ends, old, books, report):
    """What outputs within the step that was taken are made of, beside its states, and with that of the steps before."""
    for j in range(report.shape[0]):
        books.report[2, j], books.report[1, j], books.report[0, j] = books.report[1, j], books.report[0, j], report[j]
    for c in range(old.T.shape[0]):
        books.tension[1, c], books.tension[0, c] = books.tension[0, c], old.T[c]
    for i in range(books.touch.shape[1]):
        books.touch[1, i], books.touch[0, i] = books.touch[0, i], books.touch[2, i]
    for i in range(books.strains.shape[0]):
        books.strains[i, BENT_BY] = books.strains[i, BENDS]
    for k in range(2):
        for j in range(21):
            books.imposed[1, k, j] = books.imposed[0, k, j]
    impose_now(ends, books.imposed)
    if not line.bits & PLANAR:
        keep_end_twist(line, old, books)


@inner
def book_torques(old, new, dt, books):
    """Work in a step of the torques that zones which are bent pass on."""
    for z in range(new.turn.shape[0]):
        books.work[0, ZONES] += 0.5 * dt * (old.turn[z, POWER] + new.turn[z, POWER])


@inner
def remember_worst(line, old, new, books, t, dt):
    """Of the steps that leave the most out of the motion, how much (m), when, over what, and where (s, m)."""
    worst, most, node = books.worst, -1.0, 0
    for i in range(old.a.shape[0]):
        for k in range(3):
            x = abs(new.a[i, k] - old.a[i, k])
            if x > most:
                most, node = x, i
    left = dt * dt * most
    known = min(books.counts.measured, worst.shape[0])
    books.counts.measured += 1
    at = known
    while at > 0 and left > worst[at - 1, 0]:
        at -= 1
    if at < worst.shape[0]:
        for j in range(min(known, worst.shape[0] - 1), at, -1):
            for k in range(4):
                worst[j, k] = worst[j - 1, k]
        worst[at, 0], worst[at, 1], worst[at, 2], worst[at, 3] = left, t, dt, line.s[node]


@inner
def is_near_plane(line, state, most):
    """Whether all nodes are less than `most`, m, from the plane of the line through its first node."""
    n, r = line.plane[2], state.r
    for i in range(1, r.shape[0]):
        off = (r[i, 0] - r[0, 0]) * n[0] + (r[i, 1] - r[0, 1]) * n[1] + (r[i, 2] - r[0, 2]) * n[2]
        if not abs(off) < most:
            return False
    return True


@inner
def watch(line, ends, old, new, books, report, t, dt):
    """What there is to look at after a step, as bits; and how far the line has moved, how its peak tension varies."""
    clock, flags = books.clock, 0
    peak, before, stretched, slack = new.T[0], old.T[0], False, False
    for c in range(new.T.shape[0]):
        peak, before = max(peak, new.T[c]), max(before, old.T[c])
        slack |= not (line.spin[c] or new.T[c] > clock.slack_limit)
        e, longest = new.e[c], books.borne[c] * line.h[c]
        e2, shortest = e[0] * e[0] + e[1] * e[1] + e[2] * e[2], max(2.0 * line.h[c] - longest, 0.0)
        stretched |= e2 > longest * longest or e2 < shortest * shortest
    clock.least_peak, clock.largest_peak = min(clock.least_peak, peak), max(clock.largest_peak, peak)
    for j in range(books.base.shape[0]):
        for k in range(3):
            clock.moved = max(clock.moved, abs(new.r[books.base[j], k] - books.placed[j, k]))
    remember_worst(line, old, new, books, t, dt)
    if stretched and not books.counts.stiff:
        flags |= STRETCHED
    if books.counts.stiff and peak - before > clock.scaled_jump:
        flags |= JUMPED
    if report[BEND] > clock.bend_limit or report[TWIST] > min(clock.twist_limit, LARGEST_TWIST):
        flags |= BENT
    if slack:
        flags |= SLACKENED
    if clock.near_plane > 0.0 and is_near_plane(line, new, clock.near_plane):
        flags |= NEARS_PLANE
    return flags


@inner
def watch_push(clock, report):
    """By how much a push out of the plane has grown, as bits."""
    energy = report[PUSH_ENERGY]
    if report[WRONG_PIVOTS] > 0.0 or not energy < math.inf:
        clock.push_grown = math.inf
        return LEAVES_PLANE
    if not clock.push_start > 0.0:
        clock.push_start = energy
    clock.push_grown = math.sqrt(energy / clock.push_start) if clock.push_start > 0.0 else 0.0
    if clock.push_grown < DIED:
        return PUSH_DIED
    return LEAVES_PLANE if clock.push_grown >= GROWN else 0


@inner
def renew_accelerations(line, state, dt):
    """After a step of dt that was shortened: accelerations that would undo or multiply what a line has of speeds."""
    if line.bits & TOUCHES:
        damp_impact(state, dt)
    if line.bits & SELF_FRICTION:
        damp_spins(state, dt)


@inner
def damp_spins(state, dt):
    """After shortened steps: friction of the line on itself leaves spin accelerations that would multiply all spins."""
    fastest = 0.0
    for c in range(state.w.shape[0]):
        fastest = max(fastest, abs(state.w[c]))
    for c in range(state.w.shape[0]):
        if abs(state.wa[c]) * dt > fastest:
            state.wa[c], state.wd[c] = 0.0, 0.0


@inner
def damp_impact(state, dt):
    """After shortened steps: an impact on the seabed leaves accelerations that would undo all velocity at once."""
    fastest = 0.0
    for i in range(state.v.shape[0]):
        fastest = max(fastest, abs(state.v[i, 0]), abs(state.v[i, 1]), abs(state.v[i, 2]))
    for i in range(state.v.shape[0]):
        touches = state.bed[i, 0] != 0.0 or state.bed[i, 1] != 0.0 or state.bed[i, 2] != 0.0
        if touches and max(abs(state.a[i, 0]), abs(state.a[i, 1]), abs(state.a[i, 2])) * dt > fastest:
            for k in range(3):
                state.a[i, k], state.vd[i, k] = 0.0, 0.0
