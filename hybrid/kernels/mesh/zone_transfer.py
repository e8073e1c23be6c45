"""From the old cells to the new ones: nothing that stays moves, and nothing is lost.

Nodes that stay keep their positions to the last bit.  Nodes that appear lie on cubics through the old nodes, so that a
rod begins without kinks; nodes that go are dropped.  Mass is exact by construction, linear momentum, where zones change
by themselves, by a small shift of the velocities of the nodes concerned, stretch by stretch; where cells follow the
curvature to second order.  The length that a chord gains or loses when an arc becomes
chords (or chords an arc) is kept: every new cell is given the unstretched length that makes its tension what it was, and
is let go to its true length slowly (kernels.mesh.zone_step).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, spin_about, sub, transport
from hybrid.kernels.laws.element import chord, turns_freely
from hybrid.kernels.laws.seabed import remember_between
from hybrid.kernels.laws.tension_torque import stretch_factor, torque_beside
from hybrid.kernels.laws.water import PHASE
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.report import ROTARY
from hybrid.kernels.state.state import Blocks, Floats, Line, State, blanks

# How the frame at an end of a zone goes on.
CARRIED = 2
CLAMPED = 1
NOTHING = 0


class Match(NamedTuple):
    """Which of the old cells and nodes the new ones are; work arrays of a transfer.  N old, M new cells."""

    same: NDArray[np.int64]  # (M+1,) old node at the same place; -1: none
    left: NDArray[np.int64]  # (M+1,) old cell that a new node lies in; of one that stays, the cell after it
    kept: NDArray[np.int64]  # (M,) old cell that a new one is; -1: it is new
    lengths: Floats  # (M,) m, unstretched, that new cells begin with
    single: NDArray[np.int8]  # (N+1,) 1 where tangent and tension may jump


def blank_match(old: int, new: int) -> Match:
    """Room for a transfer from so many cells to so many."""
    whole = np.zeros
    return Match(
        whole(new + 1, np.int64), whole(new + 1, np.int64), whole(new, np.int64), whole(new), whole(old + 1, np.int8)
    )


class Transfer(NamedTuple):
    """A state on old cells, and room for it on new ones."""

    line: Line
    target: Line
    state: State
    out: State  # zeros
    place: NDArray[np.int64]  # (N+1,) of old nodes: their numbers on the mesh that is rod everywhere
    target_place: NDArray[np.int64]  # (M+1,) and of new ones
    first: NDArray[np.int64]  # (n+1,) first old node of base cells
    kinks: NDArray[np.bool_]  # (n+1,) base nodes where tangent and tension may jump
    clamps: Blocks  # (2, 2, 3) first director and tangent of what holds the twist of an end
    held: NDArray[np.bool_]  # (2,) whether something does
    shifts: NDArray[np.bool_]  # (1,) whether momentum is kept by a shift of velocities
    match: Match


blank_transfer = blanks(Transfer)
read = reader(blank_transfer())


@inner
def put3(A, i, x):
    A[i, 0], A[i, 1], A[i, 2] = x


# --- which is which -------------------------------------------------------------------------------


@inner
def find_match(job):
    """Fill the match but for the lengths."""
    line, target, match, old, new = job.line, job.target, job.match, job.place, job.target_place
    n, m = line.h.shape[0], target.h.shape[0]
    a = 0
    for i in range(m + 1):
        while a < n and old[a + 1] <= new[i]:
            a += 1
        match.same[i] = a if old[a] == new[i] else -1
        match.left[i] = min(a, n - 1)
    for c in range(m):
        a = match.same[c]
        stays = a >= 0 and match.same[c + 1] == a + 1 and line.spin[a] == target.spin[c]
        match.kept[c] = a if stays else -1
    for i in range(n + 1):
        match.single[i] = 0
    for j in range(job.kinks.shape[0]):
        if job.kinks[j]:
            match.single[job.first[j]] = 1
    match.single[0], match.single[n] = 1, 1


# --- nodes ----------------------------------------------------------------------------------------


@inner
def secant(x, s, c):
    """Slope of cell c."""
    return scale(1.0 / (s[c + 1] - s[c]), sub(get3(x, c + 1), get3(x, c)))


@inner
def third_derivative(x, s, single, i):
    """At inner node i, from the second divided differences of the nodes beside it that are smooth.

    That of a node belongs to the mean of the three places that it is made of.
    """
    lo, hi = i if single[i - 1] else i - 1, i if single[i + 1] else i + 1
    if lo == hi:
        return (0.0, 0.0, 0.0)
    one = scale(2.0 / (s[lo + 1] - s[lo - 1]), sub(secant(x, s, lo), secant(x, s, lo - 1)))
    two = scale(2.0 / (s[hi + 1] - s[hi - 1]), sub(secant(x, s, hi), secant(x, s, hi - 1)))
    way = (s[hi - 1] + s[hi] + s[hi + 1] - s[lo - 1] - s[lo] - s[lo + 1]) / 3.0
    return scale(1.0 / way, sub(two, one))


@inner
def slope(x, s, single, i, c, third):
    """Derivative at node i on the side of cell c, of the parabola; one-sided where it may jump.

    third: less what the third derivative makes of it, without which the second one of the cubic is off by a part of a
    cell times that.
    """
    n = s.shape[0] - 1
    if not single[i]:
        ha, hb = s[i] - s[i - 1], s[i + 1] - s[i]
        found = scale(1.0 / (ha + hb), add(scale(hb, secant(x, s, i - 1)), scale(ha, secant(x, s, i))))
        if third:
            found = sub(found, scale(ha * hb / 6.0, third_derivative(x, s, single, i)))
        return found
    far = min(max(c + 1 if c == i else c - 1, 0), n - 1)
    near, hn, hf = secant(x, s, c), s[c + 1] - s[c], s[far + 1] - s[far]
    return add(near, scale(hn / (hn + hf), sub(near, secant(x, s, far))))


@inner
def between(x, s, single, c, part, third):
    """Value at a part of cell c, on a cubic."""
    H, q = s[c + 1] - s[c], part
    a = scale((1.0 + 2.0 * q) * (1.0 - q) ** 2, get3(x, c))
    b = scale(q * q * (3.0 - 2.0 * q), get3(x, c + 1))
    ma = scale(H * q * (1.0 - q) ** 2, slope(x, s, single, c, c, third))
    mb = scale(H * q * q * (q - 1.0), slope(x, s, single, c + 1, c, third))
    return add(add(a, b), add(ma, mb))


@inner
def carry_nodes(x, out, s, at, match, third):
    """What is smooth along the line (N+1, 3) to the new nodes; third: as of `slope`."""
    for i in range(out.shape[0]):
        a = match.same[i]
        if a >= 0:
            put3(out, i, get3(x, a))
        else:
            c = match.left[i]
            put3(out, i, between(x, s, match.single, c, (at[i] - s[c]) / (s[c + 1] - s[c]), third))


@inner
def carry_rows(x, out, s, at, match):
    """Rows of nodes linearly to the new nodes: the travel of friction, what obstacles that move keep, vortices."""
    for i in range(out.shape[0]):
        a, c = match.same[i], match.left[i]
        part = 0.0 if a >= 0 else (at[i] - s[c]) / (s[c + 1] - s[c])
        for k in range(out.shape[1]):
            if a >= 0:
                out[i, k] = x[a, k]
            else:
                out[i, k] = (1.0 - part) * x[c, k] + part * x[c + 1, k]


@inner
def carry_soil(x, out, s, at, match):
    """What nodes remember of the bed (N+1, 6) to the new nodes."""
    for i in range(out.shape[0]):
        a, c = match.same[i], match.left[i]
        if a < 0:
            remember_between(x, out, i, c, c + 1, (at[i] - s[c]) / (s[c + 1] - s[c]))
            continue
        for k in range(out.shape[1]):
            out[i, k] = x[a, k]


@inner
def shorter_way_round(line, state, out, at, match):
    """Phases of vortices at new nodes, between those of the nodes beside them."""
    for i in range(out.wake.shape[0]):
        c = match.left[i]
        if match.same[i] < 0:
            turn = state.wake[c + 1, PHASE] - state.wake[c, PHASE]
            turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
            part = (at[i] - line.s[c]) / (line.s[c + 1] - line.s[c])
            out.wake[i, PHASE] = state.wake[c, PHASE] + part * turn


# --- cells ----------------------------------------------------------------------------------------


@inner
def tension_at(s, T, single, c, at):
    """Tension at a place in cell c: linear between the middles of cells, and to where it may jump."""
    middle = 0.5 * (s[c] + s[c + 1])
    step = 1 if at >= middle else -1
    node = c + 1 if step > 0 else c
    if single[node]:  # on the line from the other side
        step, edge = -step, s[node]
        if single[c + 1 if step > 0 else c]:
            return T[c]
        other = 0.5 * (s[c + step] + s[c + step + 1])
        last = T[c] + (T[c] - T[c + step]) / (middle - other) * (edge - middle)
        if not last * T[c] > 0.0:  # no slack out of nothing
            last = T[c]
        return T[c] + (last - T[c]) * (at - middle) / (edge - middle)
    other = 0.5 * (s[c + step] + s[c + step + 1])
    return T[c] + (T[c + step] - T[c]) * (at - middle) / (other - middle)


@inner
def copy_cell(state, out, a, c):
    put3(out.e, c, get3(state.e, a))
    put3(out.a1, c, get3(state.a1, a))
    out.T[c], out.w[c], out.wa[c], out.wd[c] = state.T[a], state.w[a], state.wa[a], state.wd[a]
    if state.slow.shape[0] > 0:
        out.slow[c] = state.slow[a]
    if state.peak.shape[0] > 0:
        out.peak[c] = state.peak[a]


@inner
def carry_cells(job):
    """Chords, tensions and lengths; of cells that stay all they have."""
    line, target, state, out, match = job.line, job.target, job.state, job.out, job.match
    for c in range(target.h.shape[0]):
        a = match.kept[c]
        if a >= 0:
            copy_cell(state, out, a, c)
            match.lengths[c] = line.h[a]
            continue
        e = sub(get3(out.r, c + 1), get3(out.r, c))
        put3(out.e, c, e)
        middle, of = 0.5 * (target.s[c] + target.s[c + 1]), match.left[c]
        while of + 1 < line.h.shape[0] and line.s[of + 1] <= middle:
            of += 1
        out.T[c] = tension_at(line.s, state.T, match.single, of, middle)
        if state.slow.shape[0] > 0:
            out.slow[c] = tension_at(line.s, state.slow, match.single, of, middle)
        if state.peak.shape[0] > 0:
            out.peak[c] = tension_at(line.s, state.peak, match.single, of, middle)
        torque = torque_beside(line, state, of)
        match.lengths[c] = math.sqrt(dot(e, e)) / stretch_factor(target, out, c, torque)


@inner
def stretch_of_changes(kept, p):
    """Where the run of new cells that begins at p ends."""
    q = p
    while q < kept.shape[0] and kept[q] < 0:
        q += 1
    return q


@inner
def momentum(mass, v, a, b):
    """Of nodes a to b, both included."""
    total = (0.0, 0.0, 0.0)
    for i in range(a, b + 1):
        total = add(total, scale(mass[i], get3(v, i)))
    return total


@inner
def shift(v, by, a, b):
    """Velocities of nodes a to b, b excluded."""
    for i in range(a, b):
        put3(v, i, add(get3(v, i), by))


@inner
def keep_momentum(job):
    """Make the linear momentum of every changed stretch what it was, by one shift of velocity of its inner nodes.

    Nodes at the edge of a stretch are left alone, or cells beyond it would be pulled at their length; what is then
    missing (of a stretch without inner nodes) is a shift of the whole line.
    """
    line, target, state, out, match = job.line, job.target, job.state, job.out, job.match
    m, p = target.h.shape[0], 0
    missing, any_missing = (0.0, 0.0, 0.0), False
    while p < m:
        if match.kept[p] >= 0:
            p += 1
            continue
        q = stretch_of_changes(match.kept, p)
        was = momentum(line.mass, state.v, match.same[p], match.same[q])
        less = sub(was, momentum(target.mass, out.v, p, q))
        inside = 0.0
        for i in range(p + 1, q):
            inside += target.mass[i]
        if q > p + 1:
            shift(out.v, scale(1.0 / inside, less), p + 1, q)
        else:
            missing, any_missing = add(missing, less), True
        p = q
    if any_missing:
        inside = 0.0
        for i in range(1, m):
            inside += target.mass[i]
        shift(out.v, scale(1.0 / inside, missing), 1, m)


@inner
def bend_to_clamps(job, guided):
    """New nodes in the cells at ends that hold the tangent: on cubics that leave along it."""
    line, target, match, out, r = job.line, job.target, job.match, job.out, job.state.r
    n = line.h.shape[0]
    for i in range(target.s.shape[0]):
        c = match.left[i]
        for k in range(2):
            if match.same[i] < 0 and guided[k] > 0.0 and c == k * (n - 1):
                found = slope(r, line.s, match.single, k * n, c, True)
                t = job.clamps[k, 1]
                by = sub(scale(math.sqrt(dot(found, found)), (t[0], t[1], t[2])), found)
                H, q = line.s[c + 1] - line.s[c], (target.s[i] - line.s[c]) / (line.s[c + 1] - line.s[c])
                weight = H * q * q * (q - 1.0) if k else H * q * (1.0 - q) ** 2
                put3(out.r, i, add(get3(out.r, i), scale(weight, by)))


# --- frames ---------------------------------------------------------------------------------------


@inner
def old_cell(job, c):
    """An old cell under the middle of new cell c."""
    middle, of = 0.5 * (job.target.s[c] + job.target.s[c + 1]), job.match.left[c]
    while of + 1 < job.line.h.shape[0] and job.line.s[of + 1] <= middle:
        of += 1
    return of


@inner
def is_fresh(job, c):
    """Whether new cell c is a rod where none was."""
    return job.match.kept[c] < 0 and job.target.spin[c] and not job.line.spin[old_cell(job, c)]


@inner
def direction(out, c):
    return chord(get3(out.e, c))[0]


@inner
def carry_frame(job, c):
    """Director and spins of a rod with other cells: between those of the two old cells whose middles are nearest."""
    line, state, out, s = job.line, job.state, job.out, job.line.s
    at, a = 0.5 * (job.target.s[c] + job.target.s[c + 1]), old_cell(job, c)
    n = line.h.shape[0]
    b = a + 1 if at >= 0.5 * (s[a] + s[a + 1]) else a - 1
    if b < 0 or b >= n or not line.spin[b]:
        b = a
    x = 0.0
    if b != a:
        x = (at - 0.5 * (s[a] + s[a + 1])) / (0.5 * (s[b] + s[b + 1]) - 0.5 * (s[a] + s[a + 1]))
    d = direction(out, c)
    one = transport(get3(state.a1, a), chord(get3(state.e, a))[0], d)
    two = transport(get3(state.a1, b), chord(get3(state.e, b))[0], d)
    put3(out.a1, c, spin_about(one, d, x * math.atan2(dot(cross(one, two), d), dot(one, two))))
    out.w[c] = (1.0 - x) * state.w[a] + x * state.w[b]
    out.wa[c] = (1.0 - x) * state.wa[a] + x * state.wa[b]
    out.wd[c] = (1.0 - x) * state.wd[a] + x * state.wd[b]


@inner
def across(d):
    """A director normal to d."""
    x, y, z = abs(d[0]), abs(d[1]), abs(d[2])
    a = (1.0, 0.0, 0.0) if x <= y and x <= z else ((0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0))
    a = sub(a, scale(dot(a, d), d))
    return scale(1.0 / math.sqrt(dot(a, a)), a)


@inner
def carried(a, d, to):
    """A director carried from one chord to the next by the smallest rotation; of a fold, made normal."""
    if 1.0 + dot(d, to) > 1e-12:
        return transport(a, d, to)
    b = sub(a, scale(dot(a, to), to))
    return scale(1.0 / math.sqrt(dot(b, b)), b)


@inner
def is_swivel(line, i):
    """Whether both sides of node i turn freely against each other."""
    return line.element[i] and turns_freely(get3(line.kb, i), get3(line.k0, i))


@inner
def beside(job, c, k):
    """Director and tangent of what is beyond the fresh rod that begins (k = 0) or ends (1) at cell c; whether it is."""
    out, target = job.out, job.target
    to = c - 1 if k == 0 else c + 1
    if is_swivel(target, c + k):
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), NOTHING
    if 0 <= to < target.h.shape[0]:
        if target.spin[to]:
            return get3(out.a1, to), direction(out, to), CARRIED
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), NOTHING
    if job.held[k]:
        a, t = job.clamps[k, 0], job.clamps[k, 1]
        return (a[0], a[1], a[2]), (t[0], t[1], t[2]), CLAMPED
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), NOTHING


@inner
def is_round(kb, k0):
    """Whether an element bends alike in all directions, from straight."""
    return kb[0] == kb[1] and k0[0] == 0.0 and k0[1] == 0.0


@inner
def spin_loose(job, c, k, angle):
    """Spin the rod that begins at cell c, towards the end k, as a whole, if that changes nothing; whether it does.

    It changes nothing of a round and straight one that turns freely: from joint, swivel or free end on, where no torque
    passes through catenaries.
    """
    target, step, m = job.target, 2 * k - 1, job.target.h.shape[0]
    last = c
    while 0 <= last < m and target.spin[last] and not (last != c and is_swivel(target, last + 1 - k)):
        i = last + k
        if target.element[i] and not is_round(get3(target.kb, i), get3(target.k0, i)):
            return False
        last += step
    if last < 0 or last >= m:
        if job.held[k]:
            return False
    elif not target.spin[last] and job.held[0] and job.held[1]:
        return False
    while c != last and not (k and is_fresh(job, c)):  # fresh ones ahead have no frames yet
        put3(job.out.a1, c, spin_about(get3(job.out.a1, c), direction(job.out, c), angle))
        c += step
    return True


@inner
def make_frames(job, p, q):
    """First directors of the fresh rod cells p to q (excluded): carried on from those beside it, and from clamps.

    Two rods that meet are without twist between them where one of them turns freely.
    """
    out = job.out
    a, t, left = beside(job, p, 0)
    b, u, right = beside(job, q - 1, 1)
    if not left and right:
        for c in range(q - 1, p - 1, -1):
            d = direction(out, c)
            b, u = carried(b, u, d), d
            put3(out.a1, c, b)
        return
    first = p
    if not left:
        t = direction(out, p)
        a, first = across(t), p + 1
        put3(out.a1, p, a)
    for c in range(first, q):
        d = direction(out, c)
        a, t = carried(a, t, d), d
        put3(out.a1, c, a)
    if left and right:  # what is left of the twist is spread, unless nothing holds it
        closing = carried(a, t, u)
        angle = math.atan2(dot(cross(closing, b), u), dot(closing, b))
        if right == CARRIED and spin_loose(job, q, 1, -angle):
            return
        if left == CARRIED and spin_loose(job, p - 1, 0, angle):
            for c in range(p, q):
                put3(out.a1, c, spin_about(get3(out.a1, c), direction(out, c), angle))
            return
        for c in range(p, q):
            part = angle * (c - p + 1) / (q - p + 1)
            put3(out.a1, c, spin_about(get3(out.a1, c), direction(out, c), part))


@inner
def carry_spins(job, p, q):
    """Rates of spin of the fresh rod cells p to q (excluded): between those of the rods beside them."""
    out, target = job.out, job.target
    left = p > 0 and target.spin[p - 1] and not is_swivel(target, p)
    right = q < target.h.shape[0] and target.spin[q] and not is_swivel(target, q)
    if not left and not right:
        return
    a, b = (p - 1 if left else q), (q if right else p - 1)
    for c in range(p, q):
        x = (c - p + 1) / (q - p + 1)
        out.w[c] = (1.0 - x) * out.w[a] + x * out.w[b]
        out.wa[c] = (1.0 - x) * out.wa[a] + x * out.wa[b]
        out.wd[c] = (1.0 - x) * out.wd[a] + x * out.wd[b]


@inner
def carry_frames(job):
    """Frames of rods that are new."""
    target, m = job.target, job.target.h.shape[0]
    for c in range(m):
        if job.match.kept[c] < 0 and target.spin[c] and not is_fresh(job, c):
            carry_frame(job, c)
    p = 0
    while p < m:
        q = p
        while q < m and is_fresh(job, q) and not (q > p and is_swivel(target, q)):
            q += 1
        if q > p:
            make_frames(job, p, q)
            if target.bits & ROTARY:
                carry_spins(job, p, q)
        p = max(q, p + 1)


@inner
def transfer_state(job, guided):
    line, target, state, out, match = job.line, job.target, job.state, job.out, job.match
    find_match(job)
    third = not job.shifts[0]  # where cells follow the curvature, and are what it is known by
    carry_nodes(state.r, out.r, line.s, target.s, match, third)
    if third:
        bend_to_clamps(job, guided)
    carry_nodes(state.v, out.v, line.s, target.s, match, third)
    carry_nodes(state.a, out.a, line.s, target.s, match, third)
    carry_nodes(state.vd, out.vd, line.s, target.s, match, third)
    carry_rows(state.slip, out.slip, line.s, target.s, match)
    carry_rows(state.grip, out.grip, line.s, target.s, match)
    for k in range(out.sheave.shape[0]):
        for j in range(out.sheave.shape[1]):
            out.sheave[k, j] = state.sheave[k, j]
    if state.wake.shape[0] > 0:
        carry_rows(state.wake, out.wake, line.s, target.s, match)
        shorter_way_round(line, state, out, target.s, match)
    if state.soil.shape[0] > 0:
        carry_soil(state.soil, out.soil, line.s, target.s, match)
    carry_cells(job)
    if job.shifts[0]:  # of cells that follow it would be a kick at every change
        keep_momentum(job)
    carry_frames(job)


@kernel
def transfer(table):
    """Carry the state of a Transfer to its new cells."""
    job = read(table)
    transfer_state(job, job.held)


@kernel
def carry_push(push, s, at, out):
    """A push (N+1, 4) on nodes s at other ones, on cubics with the slopes of parabolas: a rod would feel kinks."""
    n, c = s.shape[0] - 1, 0
    for i in range(at.shape[0]):
        while c < n - 1 and s[c + 1] <= at[i]:
            c += 1
        H = s[c + 1] - s[c]
        q = (at[i] - s[c]) / H
        for k in range(4):
            a, b = push_slope(push, s, c, k), push_slope(push, s, c + 1, k)
            near = (1.0 - q) ** 2 * ((1.0 + 2.0 * q) * push[c, k] + q * H * a)
            out[i, k] = near + q * q * ((3.0 - 2.0 * q) * push[c + 1, k] - (1.0 - q) * H * b)


@inner
def push_slope(push, s, i, k):
    """Derivative at node i: of the parabola, at an end of the chord."""
    n = s.shape[0] - 1
    if i == 0 or i == n:
        c = min(i, n - 1)
        return (push[c + 1, k] - push[c, k]) / (s[c + 1] - s[c])
    ha, hb = s[i] - s[i - 1], s[i + 1] - s[i]
    before, after = (push[i, k] - push[i - 1, k]) / ha, (push[i + 1, k] - push[i, k]) / hb
    return (hb * before + ha * after) / (ha + hb)
