"""Torque that passes through catenary zones, also where zones change (docs/theory.md, 15).

A catenary has no frames, so one number stands for the twist of a zone: the turn of the frame after it against the frame
before it, carried along the chords by the smallest rotations, and counted beyond half a turn.

    symbol   meaning                                                                  unit
    turn     of the frame after the zone (of its cell, or of an end that holds it)     rad
    C        compliance of the zone, with the halves of the rod cells beside it        rad/(N m)
    M        torque, (turn - turn without torque + twist by tension + tau rate)/C      N m
    c_i      (d_{i-1} x d_i)/(1 + d_{i-1}.d_i) at node i of the zone                    -

It answers to the spins of the cells beside it and to all chords:
    d turn = dpsi_after - dpsi_before + sum c_i.(de_{i-1}/l_{i-1} + de_i/l_i).
That couples two cells far apart, which the march does not know: its solution is corrected by that of a small dense
network.

Where zones change, rods get new directors and zones new turns.  Along the old line the twist is known everywhere: how
far its directors turn against one that is carried along the chords by the smallest rotations, and in zones the share of
their turn.  New rods are twisted by it, and new zones begin with what of it lies between the frames beside them, so
that no turn is lost either way.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.algebra.kept_factors import solve_with
from hybrid.kernels.algebra.rotations import add, cross, dot, get3, get9, scale, spin_about, sub, transport
from hybrid.kernels.algebra.sparse_rows import factor_dense, substitute_dense
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.tension_torque import COUPLES, compliance, couples, damped_compliance, twist_of_tensions
from hybrid.kernels.laws.tension_torque import TORQUE as NODE_TORQUE
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.state.report import MOMENT_A, MOMENT_B, STIFFNESS_DAMPING, STIFFNESS_DAMPING_POWER
from hybrid.kernels.state.state import Floats, Line, Torsion, blank_state, no_ends, no_torsion, no_work, on_line

# Parts of `pass_torque`.
TORQUES, CORRECT, REPORT = range(3)
# Columns of State.turn.
TURN = 0
TORQUE = 1
POWER = 2
FIRST, LAST, COMPLIANCE, FREE, TAU = range(5)  # columns of Line.torsion
LOAD, HOLD = 0, 1  # rows of Torsion.passed
# The answers to torques are mostly those of torsion, which does not change, and torques themselves are those of the
# configuration, so that answers touch convergence alone.
SERVES = 96  # iterations for which they serve,
ITERATIONS = 3  # unless a step takes more than so many,
SAME_STEP = 1e-3  # or cv has changed by more than this part of it: round-off of the length of steps does not count
# Torsion.known: cv of the answers, iterations they have served, whether the march keeps its factors now, whether it
# always does, iterations of this step.
OF_CV, SERVED, KEEPS_NOW, KEEPS_ALWAYS, OF_STEP = range(5)


@inner
def frame_before(line, ends, state, a):
    """First director and direction of what lies before cell a: a cell of a rod, or the frame of the start."""
    if a > 0:
        d, _, _ = chord(get3(state.e, a - 1))
        return get3(state.a1, a - 1), d
    R = get9(ends.frame, 0)
    return (R[0], R[3], R[6]), (R[2], R[5], R[8])


@inner
def frame_after(line, ends, state, b):
    """The same of what lies after cell b - 1."""
    if b < line.h.shape[0]:
        d, _, _ = chord(get3(state.e, b))
        return get3(state.a1, b), d
    R = get9(ends.frame, 1)
    return (R[0], R[3], R[6]), (R[2], R[5], R[8])


@inner
def carry(a, d, dn):
    """Director a of d, carried to dn by the smallest rotation, and how that answers to both directions."""
    f = 1.0 / (1.0 + dot(d, dn))
    s = f * dot(a, dn)
    return sub(a, scale(s, add(d, dn))), scale(f, cross(d, dn))


@inner
def find_turn(line, ends, state, slope, a, b):
    """Turn (rad, less than half a turn) of the frame after the cells a to b - 1, and its slopes.

    By the chords of these cells, and by the directions of ends that hold the zone.
    """
    director, d = frame_before(line, ends, state, a)
    none = (0.0, 0.0, 0.0)
    before, at_start, il = none, none, 0.0
    if a > 0:
        il = chord(get3(state.e, a - 1))[2]
    for i in range(a, b):
        dn, _, iln = chord(get3(state.e, i))
        director, c = carry(director, d, dn)
        if i > 0:
            p = scale(il, add(before, c))
            slope[i - 1, 0], slope[i - 1, 1], slope[i - 1, 2] = p
        else:
            at_start = c
        before, d, il = c, dn, iln
    last, dn = frame_after(line, ends, state, b)
    director, c = carry(director, d, dn)
    p = scale(il, add(before, c))
    slope[b - 1, 0], slope[b - 1, 1], slope[b - 1, 2] = p
    if b < line.h.shape[0]:
        p = scale(chord(get3(state.e, b))[2], c)
        slope[b, 0], slope[b, 1], slope[b, 2] = p
    return math.atan2(dot(cross(director, last), dn), dot(director, last)), at_start, c


@inner
def rate_of_ends(ends, k):
    """Spin (1/s) of the frame of end k about its tangent, and rate of the tangent."""
    R = get9(ends.frame, k)
    t = (R[2], R[5], R[8])
    w = get3(ends.spin, k)
    return dot(w, t), cross(w, t)


@inner
def by_chords(slope, x, first, a, b):
    """Change of a turn by the shifts x[:, first:first+3] of the nodes of cells a to b - 1."""
    total = 0.0
    for i in range(a, b):
        total += (
            slope[i, 0] * (x[i + 1, first] - x[i, first])
            + slope[i, 1] * (x[i + 1, first + 1] - x[i, first + 1])
            + slope[i, 2] * (x[i + 1, first + 2] - x[i, first + 2])
        )
    return total


@inner
def turn_rates(line, ends, state, torsion, z):
    """Rate of the turn of zone z: by spins, and by chords (1/s)."""
    n, slope, at_ends = line.h.shape[0], torsion.slope, torsion.directions[z]
    a, b = int(line.torsion[z, FIRST]), int(line.torsion[z, LAST])
    bent = by_chords(slope, state.v, 0, max(a - 1, 0), min(b + 1, n))
    if a > 0:
        before = state.w[a - 1]
    else:
        before, t1 = rate_of_ends(ends, 0)
        bent += dot(get3(at_ends, 0), t1)
    if b < n:
        after = state.w[b]
    else:
        after, t1 = rate_of_ends(ends, 1)
        bent += dot(get3(at_ends, 1), t1)
    return after - before, bent


@inner
def find_torques(line, ends, state, work):
    """Turn and torque of every zone, and what rods beside them feel."""
    torsion = work.torsion
    passed = torsion.passed
    n = line.h.shape[0]
    for z in range(line.torsion.shape[0]):
        a, b = int(line.torsion[z, FIRST]), int(line.torsion[z, LAST])
        turn, at_start, at_end = find_turn(line, ends, state, torsion.slope, a, b)
        turn += 2.0 * math.pi * math.floor((state.turn[z, TURN] - turn) / (2.0 * math.pi) + 0.5)
        torque = turn - line.torsion[z, FREE] + twist_of_tensions(line, state.T, 0, z)
        slope = torsion.directions[z]
        for k in range(3):
            slope[0, k], slope[1, k] = at_start[k], at_end[k]
        if line.bits & STIFFNESS_DAMPING and line.torsion[z, TAU] > 0.0:
            spun, bent = turn_rates(line, ends, state, torsion, z)
            torque += line.torsion[z, TAU] * (spun + bent)
        torque /= line.torsion[z, COMPLIANCE]
        state.turn[z, TURN], state.turn[z, TORQUE] = turn, torque
        if couples(line):
            for i in range(a, b + 1):
                for j in range(COUPLES):
                    work.couple[i, j] = 0.0
                work.couple[i, NODE_TORQUE] = torque
        if a > 0:  # of a rod of one cell the zone before has written
            beside = z > 0 and int(line.torsion[z - 1, LAST]) == a - 1
            passed[LOAD, a - 1] = torque + (passed[LOAD, a - 1] if beside else 0.0)
        if b < n:
            passed[LOAD, b] = -torque


@inner
def finish(line, ends, state, torsion):
    """Power that each torque gains because its zone bends without it; what damping takes out of their torsion (W)."""
    loss = 0.0
    for z in range(line.torsion.shape[0]):
        spun, bent = turn_rates(line, ends, state, torsion, z)
        state.turn[z, POWER] = state.turn[z, TORQUE] * bent
        if line.bits & STIFFNESS_DAMPING:
            drive, soft = spun + bent, line.torsion[z, COMPLIANCE]
            if couples(line):  # what stretch in its cells has lost by itself is that of a line that turns freely
                for c in range(int(line.torsion[z, FIRST]), int(line.torsion[z, LAST])):
                    d, _, _ = chord(get3(state.e, c))
                    along, g = dot(d, sub(get3(state.v, c + 1), get3(state.v, c))), 2.0 * line.tension_twist[c]
                    hck = damped_compliance(line, state, c, along) + g * line.tension_torque[c]
                    drive += g * along / hck
                    soft -= g * g / hck
            loss += line.torsion[z, TAU] * drive * drive / soft
    return loss


@inner
def twist_energy(line, state):
    """Energy, J, of the twist of zones."""
    total = 0.0
    for z in range(line.torsion.shape[0]):
        twist = state.turn[z, TURN] - line.torsion[z, FREE] + twist_of_tensions(line, state.T, 0, z)
        total += 0.5 * twist * twist / line.torsion[z, COMPLIANCE]
    return total


@inner
def report_end_moments(line, ends, state, report):
    """Moments of ends that hold a zone: its torque, about the tangent of the end."""
    n, last = line.h.shape[0], line.torsion.shape[0] - 1
    if line.torsion[0, FIRST] == 0.0:
        _, t = frame_before(line, ends, state, 0)
        for k in range(3):
            report[MOMENT_A + k] += state.turn[0, TORQUE] * t[k]
    if line.torsion[last, LAST] == n:
        _, t = frame_after(line, ends, state, n)
        for k in range(3):
            report[MOMENT_B + k] += state.turn[last, TORQUE] * t[k]


@inner
def solve_columns(line, work, joined):
    """Response of the line to each torque, and to a torque on each cell that is held meanwhile.

    joined: its end is joined to a point (kernels.junctions.joined_lines), and is held there.
    """
    torsion, n = work.torsion, line.h.shape[0]
    zones = line.torsion.shape[0]
    good = True
    for j in range(torsion.columns.shape[0]):
        right = torsion.right
        for i in range(n + 1):
            for k in range(SIZE):
                right[i, k] = 0.0
        if j < zones:
            a, b = int(line.torsion[j, FIRST]), int(line.torsion[j, LAST])
            if a > 0:
                right[a - 1, 4] = 1.0
            if b < n:
                right[b, 4] = -1.0
            if couples(line):
                g = line.tension_twist
                for c in range(a, b):
                    right[c + 1, 0] = 2.0 * g[c]
                if a > 0:
                    right[a, 0] = g[a - 1]
                if b < n:
                    right[b + 1, 0] = g[b]
        else:
            cell = torsion.floating[j - zones]
            right[cell, 4] = torsion.passed[HOLD, cell]
        good = solve_with(work.X, work.W, right, torsion.columns[j], joined) and good
    return good


@inner
def damped_part(line, z, cv):
    """By how much damping makes the turn of zone z count more."""
    if line.bits & STIFFNESS_DAMPING:
        return 1.0 + cv * line.torsion[z, TAU]
    return 1.0


@inner
def turn_by(line, torsion, z, x, cv):
    """Change (rad) by a correction x (N+1, 5) of the turn of zone z, and of the twist by tension as that counts."""
    n = line.h.shape[0]
    a, b = int(line.torsion[z, FIRST]), int(line.torsion[z, LAST])
    total = by_chords(torsion.slope, x, 1, max(a - 1, 0), min(b + 1, n))
    if a > 0:
        total -= x[a - 1, 4]
    if b < n:
        total += x[b, 4]
    return total + twist_of_tensions(line, x[:, 0], 1, z) / damped_part(line, z, cv)


@inner
def unknown_of(line, torsion, j, x, cv):
    """What the correction x makes of unknown j: the change of the turn of a zone, or the spin of a cell that is held."""
    zones = line.torsion.shape[0]
    if j < zones:
        return turn_by(line, torsion, j, x, cv)
    return x[torsion.floating[j - zones], 4]


@inner
def correct(line, state, work, cv, joined):
    """Correct the march's solution work.x for the torques that change with it."""
    torsion, x = work.torsion, work.x
    zones, m = line.torsion.shape[0], torsion.columns.shape[0]
    known = torsion.known
    if known[KEEPS_NOW] > 0.0:
        known[OF_CV], known[SERVED] = cv, 0.0
        if not solve_columns(line, work, joined):
            x[0, 1] = math.nan
            return
        for j in range(m):
            for k in range(m):
                torsion.coupling[j, k] = unknown_of(line, torsion, j, torsion.columns[k], cv)
    known[SERVED] += 1.0
    A = torsion.dense
    for j in range(m):
        for k in range(m):
            A[j, k] = torsion.coupling[j, k]
        A[j, m] = unknown_of(line, torsion, j, x, cv)
        size = 1.0
        if j < zones:
            size = line.torsion[j, COMPLIANCE] / damped_part(line, j, cv)
        A[j, j] += size
    if not factor_dense(A, m):
        x[0, 1] = math.nan
        return
    substitute_dense(A, m)
    for j in range(m):
        y, column = A[j, m], torsion.columns[j]
        for i in range(x.shape[0]):
            for k in range(SIZE):
                x[i, k] -= y * column[i, k]
    for z in range(zones):  # of the configuration that the correction leads to, but for what is not linear
        state.turn[z, TORQUE] += A[z, m]
        change = A[z, m] * line.torsion[z, COMPLIANCE] - twist_of_tensions(line, x[:, 0], 1, z)
        state.turn[z, TURN] += change / damped_part(line, z, cv)


@linked_kernel(on_line(no_ends(), blank_state(1), no_work(), 0, 0.0))
def pass_torque(line, ends, state, work, part, cv):
    """A part of Newton's iteration for a line whose state has turns; cv: dv'/dr' of the scheme, 1/s.

    TORQUES  the torques of the configuration, for the march
    CORRECT  its solution work.x with the torques that change with it; the march has kept its factors
    REPORT   powers of the configuration found, and what it reports: moments of the ends, loss

    A line that is catenary from end to end feels nothing of its torque, unless that lengthens it: it is found after the
    step.
    """
    felt = couples(line) or line.torsion[0, FIRST] > 0.0 or line.torsion[0, LAST] < line.h.shape[0]
    if part == REPORT:
        if not felt:
            find_torques(line, ends, state, work)
        work.report[STIFFNESS_DAMPING_POWER] += finish(line, ends, state, work.torsion)
        report_end_moments(line, ends, state, work.report)
        work.torsion.known[OF_STEP] = 0.0
    elif felt and part == CORRECT:
        # the last block is left unsolved, too, where the end is held and the start is joined (junctions.borders.HELD)
        leaves = ends.held[1] == JOINED or (ends.held[1] != 0 and ends.held[0] == JOINED)
        correct(line, state, work, cv, leaves)
    elif felt:
        known = work.torsion.known
        known[OF_STEP] += 1.0
        other = cv == 0.0 or not abs(known[OF_CV] - cv) <= SAME_STEP * cv
        known[KEEPS_NOW] = 1.0 if other or known[SERVED] >= SERVES or known[OF_STEP] > ITERATIONS else 0.0
        find_torques(line, ends, state, work)


@inner
def torsional_stiffness(line):
    """Torque by which a line resists a turn of one end against the other, N m/rad; 0 of one without such zones.

    Where tension makes a torque, it is that of a line that cannot stretch: with less, Newton's method would go back and
    forth between the turn and the tension.
    """
    soft = 0.0
    for z in range(line.torsion.shape[0]):
        soft += line.torsion[z, COMPLIANCE]
    if not soft > 0.0:
        return 0.0
    for i in range(line.kb.shape[0]):
        if line.element[i] and line.kb[i, 2] > 0.0:
            soft += 1.0 / line.kb[i, 2]
    for c in range(line.tension_twist.shape[0]):
        g, hck = 2.0 * line.tension_twist[c], line.h[c] * compliance(line, c)
        if hck > 0.0:
            soft -= g * g / hck
    return 1.0 / soft


def floating_rods(line: Line, held: np.ndarray) -> np.ndarray:
    """One cell of each rod that a torque passes to and nothing else holds; held: (2,) whether the ends hold the twist."""
    ends_of_zones, first_of_zones = line.torsion[:, LAST].astype(int), line.torsion[:, FIRST].astype(int)
    found = []
    rods = np.flatnonzero(np.diff(np.concatenate([[0], line.spin, [0]]))).reshape(-1, 2)
    for a, b in rods:
        passes = (ends_of_zones == a).any() or (first_of_zones == b).any()
        if passes and not (a == 0 and held[0]) and not (b == line.h.size and held[1]):
            found.append(a)
    return np.array(found, np.int64)


def torsion_of(line: Line, keep: bool) -> Torsion:
    """What a torque through the catenary zones of a line takes; keep: the march keeps its factors every time."""
    zones = line.torsion.shape[0]
    if not zones:
        return no_torsion()
    n = line.h.size
    held = (line.element[[0, -1]] == 1) & (line.kb[[0, -1], 2] > 0.0)
    floating = floating_rods(line, held)
    unknowns, z = zones + floating.size, np.zeros
    passed = z((2, n))
    passed[HOLD, floating] = 1.0 / line.torsion[:, COMPLIANCE].min()
    answers = z((unknowns, n + 1, SIZE)), np.array([-1.0, 0.0, 1.0, float(keep), 0.0]), z((n + 1, SIZE))
    equations = z((unknowns, unknowns)), z((unknowns + 5, unknowns + 1))
    return Torsion(passed, z((n, 3)), z((zones, 2, 3)), floating, *answers, *equations)


def answers_of(torsion: Torsion) -> dict[str, Floats]:
    """How a line answers to torques through its zones, which serves for several steps; {} without such zones."""
    names = ("known", "columns", "coupling") if torsion.known.size else ()
    return {name: getattr(torsion, name) for name in names}


def torsion_energy(line: Line, turn: Floats, T: Floats) -> Floats:
    """Energy, J, of the twist of zones; turn: (..., K) rad; T: (..., N) N."""
    twist = turn - line.torsion[:, FREE]
    if line.tension_twist.size:
        by_tension = np.stack([T @ share for share in _shares_of_tensions(line)], axis=-1)
        twist = twist + by_tension
    return np.asarray((twist**2 / (2.0 * line.torsion[:, COMPLIANCE])).sum(axis=-1))


def _shares_of_tensions(line: Line) -> Floats:
    """(K, N) rad/N, by which tensions twist zones: as `twist_of_tensions`."""
    out = np.zeros((len(line.torsion), line.h.size))
    for row, (a, b) in zip(out, line.torsion[:, [FIRST, LAST]].astype(int), strict=True):
        row[a:b] = 2.0 * line.tension_twist[a:b]
        row[max(a - 1, 0) : a] = line.tension_twist[max(a - 1, 0) : a]
        row[b : b + 1] = line.tension_twist[b : b + 1]
    return out


@inner
def angle_from(a, b, d):
    """Angle (rad, less than half a turn) about d from director a to b."""
    return math.atan2(dot(cross(a, b), d), dot(a, b))


@inner
def find_twist(line, ends, state, twist):
    """Twist (N+2,) rad of a line's cells against the frame of the start, and of the frame of the end."""
    n, zone, zones = line.h.shape[0], 0, line.torsion.shape[0]
    director, d = frame_before(line, ends, state, 0)
    total, c = 0.0, 0
    twist[0] = 0.0
    while c <= n:
        if zone < zones and c == line.torsion[zone, FIRST]:
            b = int(line.torsion[zone, LAST])
            low = line.s[0] if c == 0 else 0.5 * (line.s[c - 1] + line.s[c])
            high = line.s[n] if b == n else 0.5 * (line.s[b] + line.s[b + 1])
            # the twist by tension is as that is along the zone, the rest spread evenly
            by_tension = twist_of_tensions(line, state.T, 0, zone)
            less = line.tension_twist[c - 1] * state.T[c - 1] if couples(line) and c > 0 else 0.0
            for i in range(c, b):
                if couples(line):
                    less += line.tension_twist[i] * state.T[i]
                part = (0.5 * (line.s[i] + line.s[i + 1]) - low) / (high - low)
                twist[i + 1] = total + part * (state.turn[zone, TURN] + by_tension) - less
                if couples(line):
                    less += line.tension_twist[i] * state.T[i]
            total += state.turn[zone, TURN]
            c, zone = b, zone + 1
            director, d = frame_after(line, ends, state, c)
        else:
            here, dn = frame_after(line, ends, state, c)
            moved, _ = carry(director, d, dn)
            total += angle_from(moved, here, dn)
            director, d = here, dn
        twist[c + 1] = total
        c += 1


@inner
def middle(line, c):
    """Arc length (m) that the frame of cell c stands for; c = -1 and N: the ends."""
    n = line.h.shape[0]
    if c < 0:
        return line.s[0]
    return line.s[n] if c == n else 0.5 * (line.s[c] + line.s[c + 1])


@inner
def twist_at(line, twist, x, c):
    """Twist at the arc length x (m): linear between the middles of cells, from c on; and where it was found."""
    while c < line.h.shape[0] and middle(line, c) < x:
        c += 1
    low, high = middle(line, c - 1), middle(line, c)
    part = min(max((x - low) / (high - low), 0.0), 1.0)
    return (1.0 - part) * twist[c] + part * twist[c + 1], c


@inner
def is_kept(line, target, c, o):
    """Whether cell c of the target is the same cell of a rod as cell o of the line."""
    n = line.h.shape[0]
    return (
        o < n
        and line.spin[o] != 0
        and target.spin[c] != 0
        and line.s[o] == target.s[c]
        and line.s[o + 1] == target.s[c + 1]
    )


@inner
def twist_rods(line, target, ends, out, twist):
    """Directors of the rod cells of the target that are new, from the frame before them to the one after them."""
    n = target.h.shape[0]
    p, at, o = 0, 0, 0
    before, at = twist_at(line, twist, target.s[0], at)
    while p < n:
        while o < line.h.shape[0] and line.s[o + 1] <= target.s[p]:
            o += 1
        x, at = twist_at(line, twist, middle(target, p), at)
        if is_kept(line, target, p, o):
            before = x
            p += 1
            continue
        q, low = p, before  # cells p to q - 1 are new, of rods or catenaries
        director, d = frame_before(target, ends, out, p)
        while q < n and not is_kept(line, target, q, o):
            dn, _, _ = chord(get3(out.e, q))
            x, at = twist_at(line, twist, middle(target, q), at)
            director = spin_about(transport(director, d, dn), dn, x - low)
            out.a1[q, 0], out.a1[q, 1], out.a1[q, 2] = director
            d, low = dn, x
            q += 1
            while o < line.h.shape[0] and q < n and line.s[o + 1] <= target.s[q]:
                o += 1
        last, dn = frame_after(target, ends, out, q)
        x, at = twist_at(line, twist, middle(target, q), at)
        left = angle_from(spin_about(transport(director, d, dn), dn, x - low), last, dn)
        begin, end = middle(target, p - 1), middle(target, q)
        for c in range(p, q):  # what is left, because chords are others than before, is spread
            d, _, _ = chord(get3(out.e, c))
            part = left * (middle(target, c) - begin) / (end - begin)
            out.a1[c, 0], out.a1[c, 1], out.a1[c, 2] = spin_about(get3(out.a1, c), d, part)
        before, p = x, q


@kernel
def carry_torque(line, target, ends, state, out, twist):
    """Give a state on new zones the twist of that on the old ones; what is kept of `out` has been carried before.

    line, state: as they were; target, out: as they are, with directors of rod cells that stay; both ends hold the
    twist.  twist: (N+2,) of the old line, to work in.  Directors of catenary cells are written as well.
    """
    find_twist(line, ends, state, twist)
    twist_rods(line, target, ends, out, twist)
    at = 0
    for z in range(target.torsion.shape[0]):
        a, b = int(target.torsion[z, FIRST]), int(target.torsion[z, LAST])
        director, d = frame_before(target, ends, out, a)
        low, at = twist_at(line, twist, middle(target, a - 1), at)
        high, at = twist_at(line, twist, middle(target, b), at)
        for i in range(a, b):
            dn, _, _ = chord(get3(out.e, i))
            director, _ = carry(director, d, dn)
            d = dn
        last, dn = frame_after(target, ends, out, b)
        director, _ = carry(director, d, dn)
        turn = angle_from(director, last, dn)
        out.turn[z, TURN] = turn + 2.0 * math.pi * math.floor((high - low - turn) / (2.0 * math.pi) + 0.5)
