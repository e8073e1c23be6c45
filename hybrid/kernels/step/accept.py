"""What follows a try of a step in a compiled run: its judgement, its books, what there is to look at."""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import get3
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.march.zone_torque import POWER
from hybrid.kernels.state.books import (
    BENT,
    COLLAPSES,
    ITERATIONS_CUT,
    JUMPED,
    LEAVES_PLANE,
    NEARS_PLANE,
    PUSH_DIED,
    SLACKENED,
    STEPS_CUT,
    STEPS_SLACK,
    STRETCHED,
    ZONES,
)
from hybrid.kernels.state.report import (
    BEND,
    PLANAR,
    PUSH_ENERGY,
    SELF_FRICTION,
    TOUCHES,
    TWIST,
    WRONG_PIVOTS,
)
from hybrid.kernels.step.sampling import end_frame, holds_twist, twist_at_end

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
