"""Points and bodies at which lines meet: their equations, from what every line hands over (kernels.junctions.joined_lines).

An end that is joined to a point moves as the point, one that is joined to a body by  G z = dr + dtheta x rho  of the
body's z = (dr, dtheta), with rho the arm of its fairlead, and where it is clamped to that by dtheta as well.  What a
line hands over,

    S (dT, q_0, q_N) = right-hand side,   rows: length of the last cell, force and moment on the start, on the end,

goes by G^T into the balances of points and bodies: forces, and rho x force and moments.  A force F turns with the arm
of its fairlead, which adds  [F]x [rho]x  to the moment.  A point that lines are clamped to is a body without mass.
Torques through catenary zones stand at the end of this file.
"""

from __future__ import annotations

from typing import NamedTuple

from hybrid.kernels.algebra.block_elimination import substitute
from hybrid.kernels.algebra.rotations import cross, hat, mat_mat, mat_vec, matrix, vector
from hybrid.kernels.algebra.sparse_rows import factor_dense, substitute_dense
from hybrid.kernels.junctions.bodies import (
    FRAME,
    LINES,
    PLACE,
    U,
    X,
    adapt_springs,
    add_own,
    hold_turns,
    move_bodies,
    own_force,
    size_of_moves,
)
from hybrid.kernels.junctions.borders import END, FAR, HELD, NONE, START, STRENGTH, TURNED, read_border, read_network
from hybrid.kernels.junctions.joined_lines import (
    COLUMNS,
    END_TURN,
    LEFT,
    OF,
    SHIFT,
    TURN,
    TURNS,
    WITH_POINT,
    answer_of_end,
    balance_of_start,
    carry_end_turn,
    carry_functional,
    carry_start,
    carry_turn,
    count_right,
    end_row,
    last_block,
    moment_of_end,
    place_frame,
    turns,
)
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.assembly import JOINED, LEAST_SPIN_STIFFNESS
from hybrid.kernels.march.zone_torque import torsional_stiffness
from hybrid.kernels.state.report import MOMENT_A, NET_A
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.line_step import (
    AGAIN,
    BALANCE,
    BEFORE_MARCH,
    BLOCK,
    CORRECTION,
    COUPLE,
    FORCE,
    FORGET,
    HOLD,
    LARGEST_TURN,
    MEASURE,
    NO_NUMBERS,
    RELAX,
    UPDATE,
    read,
    twist_zones,
)

# Columns of S; its rows are as the first of them.
TENSION = 0  # of the start
AT = (1, 7)  # shift and turn (3 each) of the start, of the end
RIGHT = 13  # right-hand side
HANDED = 14


@inner
def first_unknown(joint, tensions, points):
    """Where the unknowns of a point or body begin."""
    return tensions + 3 * joint + 3 * max(joint - points, 0)


@inner
def count_tensions(joints):
    """How many lines hand over their last block, with the tension of its cell."""
    found = 0
    for l in range(joints.shape[0]):
        if joints[l, END] != NONE:
            found += 1
    return found


@inner
def place_ends(l, job, network, given):
    """Arms of the fairleads of a line, frames that are carried, and how far its ends have still to go; given: those are."""
    joints, seats, arms, gaps, points = network.joints, network.seats, network.arms, network.gaps, network.net.shape[0]
    old, new, work, fairleads = network.old, network.new, network.work, network.fairleads
    for k in range(2):
        joint, node = joints[l, k], k * job.line.h.shape[0]
        if joint >= points:
            b = joint - points
            rho = mat_vec(matrix(new[b], FRAME), vector(fairleads[l, k], 0))
            for i in range(3):
                arms[l, k, i] = rho[i]
                if not given:  # by ways, not by places, which far from the origin have few digits
                    begin = old[b, PLACE + i] - job.old.r[node, i]
                    gaps[l, k, i] = begin + rho[i] + (work[b, U + i] - job.work.u[node, i])
            if turns(seats, l, k):
                place_frame(job.ends, k, seats[l, k], new[b])
        if joint >= 0:
            for i in range(3):
                job.ends.position[k, i] = job.old.r[node, i]
                if not given:  # as it is, -u is what it has still to go, too small to be added to a place
                    job.ends.position[k, i] += job.work.u[node, i] + gaps[l, k, i]
        if joint == HELD:
            for i in range(3):
                gaps[l, k, i] = job.ends.position[k, i] - job.old.r[node, i] - job.work.u[node, i]


@inner
def add_pull(joint, report, k, arm, clamped, net, work):
    """The force of an end on its point or body, and where it is clamped there its moment."""
    o, points = NET_A + 3 * k, net.shape[0]
    F = (report[o], report[o + 1], report[o + 2])
    if joint < points:
        for i in range(3):
            net[joint, i] += F[i]
        return
    M = cross(vector(arm, 0), F)
    for i in range(3):
        work[joint - points, LINES + i] += F[i]
        work[joint - points, LINES + 3 + i] += M[i]
        if clamped:
            moment = report[MOMENT_A + 3 * k + i]
            work[joint - points, LINES + 3 + i] += moment if k == START else -moment


@inner
def put_functional(f, low, high, joined, S, e):
    """A functional of the last block and q as row e of S."""
    S[e, RIGHT] = -f[LEFT]
    for b in range(low, high):
        S[e, 1 + b if b < END_TURN else AT[END] + 3 + b - END_TURN] = f[OF + b]
    if joined:
        S[e, TENSION] = f[0]
        for b in range(3):
            S[e, AT[END] + b] = f[1 + b]


@inner
def hand_over(l, job, network, cv):
    """What a line hands over: its rows and columns of S; cv: of this step."""
    joints, seats, columns, parts = network.joints, network.seats, network.columns, network.parts
    gaps, answers, S = network.gaps, network.answers, network.S
    new, work, points = network.new, network.work, network.net.shape[0]
    S[:RIGHT, :HANDED] = 0.0
    start, end = joints[l, START], joints[l, END]
    n, X_, o, f = job.line.h.shape[0], job.work.X, network.first[l], network.functional
    starts, ends = turns(seats, l, START), turns(seats, l, END)
    low, high = used_columns(start >= 0, starts, ends)
    for k in range(2):
        if turns(seats, l, k):
            b = joints[l, k] - points
            answer_of_end(job, k, new[b], work[b], cv, answers[k])
    if start >= 0:
        carry_start(X_, job.work.W, columns, o, n, end != NONE)
    if starts:
        carry_turn(X_, job.work.W, columns, o, n, end != NONE, answers[START])
    if ends:
        carry_end_turn(X_, job.work.W, columns, o, n, answers[END])
    if start >= 0:
        for a in range(6 if starts else 3):
            if a < 3:
                balance_of_start(job.work.rows[0], a, starts, answers[START], f)
            else:
                moment_of_end(START, a - 3, answers[START], f)
            carry_functional(X_, columns, parts[a], o, 0, n, end != NONE, low, high, f)
            put_functional(f, low, high, end != NONE, S, AT[START] + a)
    if end == NONE:
        return
    k = last_block(X_, n)
    for r in range(4):
        e = TENSION if r == 0 else AT[END] - 1 + r
        S[e, TENSION] = end_row(X_, k, r, 0)
        S[e, RIGHT] = X_[k + 64 + r]
        for b in range(3):
            S[e, AT[END] + b] = end_row(X_, k, r, 1 + b)
        for b in range(low, high):
            S[e, 1 + b if b < END_TURN else AT[END] + 3 + b - END_TURN] = -columns[b, o + n, r]
    if ends:
        for a in range(3):
            moment_of_end(END, a, answers[END], f)
            carry_functional(X_, columns, parts[6 + a], o, n - 1, n, True, low, high, f)
            put_functional(f, low, high, True, S, AT[END] + 3 + a)
    for e in range(RIGHT):
        for b in range(3):
            S[e, RIGHT] -= S[e, AT[END] + b] * gaps[l, END, b]


@inner
def lag_of_start(l, job, network, b):
    """What a start has still to go beyond what its place says to the march, which far from the origin is rounded."""
    return network.gaps[l, START, b] - (job.ends.position[START, b] - job.old.r[0, b] - job.work.u[0, b])


@inner
def used_columns(carries, starts, ends):
    """Which columns of D a line has: the first, and the one behind the last."""
    low = SHIFT if carries else END_TURN
    high = COLUMNS if ends else END_TURN if starts else TURN if carries else END_TURN
    return low, high


@inner
def end_matrix(joint, points, arm, clamped, G):
    """G (6, 6) of an end; returns how many rows and columns it has."""
    for i in range(6):
        for j in range(6):
            G[i, j] = 1.0 if i == j else 0.0
    if joint < points:
        return 3, 3
    H = hat(vector(arm, 0))
    for i in range(3):
        for j in range(3):
            G[i, 3 + j] = -H[3 * i + j]
    return 6 if clamped else 3, 6


class Followers(NamedTuple):
    """How both ends of a line follow the points and bodies that they are joined to.

    at: where the unknowns of those begin; rows, size: how many rows and columns of their G, (2, 6, 6), count.
    """

    at: tuple[int, int]
    rows: tuple[int, int]
    size: tuple[int, int]
    G: Floats


@inner
def add_row(S, r, part, A, e, m, tension, followers):
    """A part of row r of S into row e of A; tension: its column there, -1: none; followers: of the line's ends."""
    at, rows, size, G = followers
    if tension >= 0:
        A[e, tension] += part * S[r, TENSION]
    A[e, m] += part * S[r, RIGHT]
    for k in range(2):
        for i in range(rows[k]):
            value = part * S[r, AT[k] + i]
            if value != 0.0:
                for j in range(size[k]):
                    if G[k, i, j] != 0.0:
                        A[e, at[k] + j] += value * G[k, i, j]


@inner
def spread(l, job, network, tensions, row, m):
    """S of a line into the equations A of all tensions, points and bodies; row: of its tension, -1: none."""
    joints, seats, arms, points = network.joints, network.seats, network.arms, network.net.shape[0]
    S, G, A = network.S, network.G, network.A
    start, end, report, kb = joints[l, START], joints[l, END], job.work.report, job.line.kb
    rows0, size0, rows1, size1 = 0, 0, 0, 0
    if start >= 0:
        rows0, size0 = end_matrix(start, points, arms[l, START], turns(seats, l, START), G[START])
    if end >= 0:
        rows1, size1 = end_matrix(end, points, arms[l, END], turns(seats, l, END), G[END])
    rows, size = (rows0, rows1), (size0, size1)
    at = (first_unknown(max(start, 0), tensions, points), first_unknown(max(end, 0), tensions, points))
    twist_ends(l, seats, job, at, A)
    followers = Followers(at, rows, size, G)
    if row >= 0:
        add_row(S, TENSION, 1.0, A, row, m, row, followers)
    for k in range(2):
        for j in range(size[k]):
            for i in range(rows[k]):
                if G[k, i, j] != 0.0:
                    add_row(S, AT[k] + i, G[k, i, j], A, at[k] + j, m, row, followers)
        if size[k] == 6:
            o = NET_A + 3 * k
            T = mat_mat(hat((report[o], report[o + 1], report[o + 2])), hat(vector(arms[l, k], 0)))
            for i in range(3):
                for j in range(3):
                    A[at[k] + 3 + i, at[k] + 3 + j] += T[3 * i + j]
        if rows[k] == 6:  # of rods that may all spin freely
            node = k * job.line.h.shape[0]
            for i in range(3):
                A[at[k] + 3 + i, at[k] + 3 + i] -= LEAST_SPIN_STIFFNESS * (kb[node, 0] + kb[node, 2])
            if seats[l, k, TURNS] == WITH_POINT:
                # the moment in axes of the point: that of rods which may all spin is then 0 about their axis wherever
                # they are, and so is its change; in inertial axes they would spin at random until all else balances
                o, sign = MOMENT_A + 3 * k, 1.0 if k == START else -1.0
                H = hat((sign * report[o], sign * report[o + 1], sign * report[o + 2]))
                for i in range(3):
                    for j in range(3):
                        A[at[k] + 3 + i, at[k] + 3 + j] += H[3 * i + j]


@inner
def twist_ends(l, seats, job, at, A):
    """By how much a turn of one end of a line changes the torque through its catenary zones on both; at: as of `spread`.

    Lines are eliminated with that torque as it is, and corrected for its change afterwards (kernels.march.zone_torque).
    """
    k = torsional_stiffness(job.line)
    if not k > 0.0:
        return
    frame = job.ends.frame
    for m in range(2):
        for o in range(2):
            if turns(seats, l, m) and turns(seats, l, o):
                part = -k if m == o else k
                for i in range(3):
                    for j in range(3):
                        A[at[m] + 3 + i, at[o] + 3 + j] += part * frame[m, 2 + 3 * i] * frame[o, 2 + 3 * j]


@inner
def assemble_junctions(network, m):
    """Equations (m, m+1) of the last tensions, the points and the bodies, from what the lines hand over."""
    cv, ca = network.asked.scheme_cv, network.asked.scheme_ca
    tables, joints, net, A = network.tables, network.joints, network.net, network.A
    A[:m, : m + 1] = 0.0
    row, tensions, points = 0, count_tensions(joints), net.shape[0]
    for l in range(tables.shape[0]):
        start, end = joints[l, START], joints[l, END]
        if start < 0 and end < 0:
            continue
        job = read(tables[l])
        hand_over(l, job, network, cv)
        for b in range(3 if start >= 0 else 0):
            lag = lag_of_start(l, job, network, b)
            for e in range(RIGHT):
                network.S[e, RIGHT] -= network.S[e, AT[START] + b] * lag
        spread(l, job, network, tensions, row if end != NONE else -1, m)
        if end != NONE:
            row += 1
    add_own(network, first_unknown(points, tensions, points), m, cv, ca)


@inner
def hand_over_right(l, job, network):
    """The right-hand side of S alone, of a line with another one for the factors with which it has handed over."""
    parts, S, X_ = network.parts, network.S, job.work.X
    start, end = network.joints[l, START], network.joints[l, END]
    n, o = job.line.h.shape[0], network.first[l]
    if start >= 0:
        for a in range(6 if turns(network.seats, l, START) else 3):
            left = -job.work.rows[0, (a + 1) * 24 + 23] if a < 3 else 0.0
            S[AT[START] + a, RIGHT] = -count_right(X_, parts[a], o, 0, n if end != NONE else n + 1, left)
    if end != NONE:
        k = last_block(X_, n)
        for r in range(4):
            S[TENSION if r == 0 else AT[END] - 1 + r, RIGHT] = X_[k + 64 + r]
        if turns(network.seats, l, END):
            for a in range(3):
                S[AT[END] + 3 + a, RIGHT] = -count_right(X_, parts[6 + a], o, n - 1, n, 0.0)


@inner
def gather_right_sides(network, m):
    """Another right-hand side of the equations, of those in the eliminated lines, into the last column of A.

    Of points and bodies themselves it is `right`; ends have nowhere to go.
    """
    tables, joints, seats, arms = network.tables, network.joints, network.seats, network.arms
    points = network.net.shape[0]
    S, G, A, row, tensions = network.S, network.G, network.A, 0, count_tensions(network.joints)
    A[:m, m] = 0.0
    for l in range(tables.shape[0]):
        if joints[l, START] < 0 and joints[l, END] < 0:
            continue
        hand_over_right(l, read(tables[l]), network)
        if joints[l, END] != NONE:
            A[row, m] = S[TENSION, RIGHT]
            row += 1
        for k in range(2):
            joint = joints[l, k]
            if joint >= 0:
                at = first_unknown(joint, tensions, points)
                rows, size = end_matrix(joint, points, arms[l, k], turns(seats, l, k), G[k])
                for j in range(size):
                    for i in range(rows):
                        A[at + j, m] += G[k, i, j] * S[AT[k] + i, RIGHT]
    for r in range(tensions, m):
        A[r, m] += network.right[r - tensions]


@inner
def shift_of(joint, tensions, points, arm, gap, clamped, A, m, q, o):
    """Shift of an end by the correction m of its point or body and its gap.

    Without the gap it goes into q from o on, and its turn from o + 3 on where it is clamped.
    """
    at = first_unknown(joint, tensions, points)
    s = (A[at, m], A[at + 1, m], A[at + 2, m])
    if joint >= points:
        turn = (A[at + 3, m], A[at + 4, m], A[at + 5, m])
        t = cross(turn, vector(arm, 0))
        s = (s[0] + t[0], s[1] + t[1], s[2] + t[2])
        if clamped:
            q[o + 3], q[o + 4], q[o + 5] = turn
    if o == SHIFT:
        q[0], q[1], q[2] = s
    return (s[0] + gap[0], s[1] + gap[1], s[2] + gap[2])


@inner
def correct_all(network, gaps, m, lags):
    """Corrections of all lines and bodies from the solution; returns -1, or a line whose correction is not finite.

    lags: whether starts have still to go what their rounded places leave out.
    """
    tables, joints, seats, arms = network.tables, network.joints, network.seats, network.arms
    points = network.net.shape[0]
    columns, work, A, q = network.columns, network.work, network.A, network.q
    row, tensions = 0, count_tensions(joints)
    for b in range(work.shape[0]):
        at = first_unknown(points + b, tensions, points)
        for k in range(6):
            work[b, X + k] = A[at + k, m]
    for l in range(tables.shape[0]):
        job, start, end = read(tables[l]), joints[l, START], joints[l, END]
        x, n, place = job.work.x, job.line.h.shape[0], (0.0, 0.0, 0.0)
        starts, ends = turns(seats, l, START), turns(seats, l, END)
        low, high = used_columns(start >= 0, starts, ends)
        for b in range(COLUMNS):
            q[b] = 0.0
        if end >= 0:
            far = shift_of(end, tensions, points, arms[l, END], gaps[l, END], ends, A, m, q, END_TURN - 3)
            x[n, 0], x[n, 1], x[n, 2], x[n, 3] = A[row, m], far[0], far[1], far[2]
            row += 1
        elif end == HELD:
            x[n, 0], x[n, 1], x[n, 2], x[n, 3] = A[row, m], gaps[l, END, 0], gaps[l, END, 1], gaps[l, END, 2]
            row += 1
        if start >= 0:
            place = shift_of(start, tensions, points, arms[l, START], gaps[l, START], starts, A, m, q, SHIFT)
            for b in range(3 if lags else 0):
                q[b] += lag_of_start(l, job, network, b)
        if not substitute(job.work.X, x, end != NONE, (columns, network.first[l], low, high, q)):
            return l
        if (
            start >= 0
        ):  # its shift and what it had still to go: to the last digit as the other lines at that point have it
            x[0, 1], x[0, 2], x[0, 3] = place
    return -1


@inner
def move_joints(job):
    """Velocity of the ends that are joined to points, for the powers; that of held ends is set from outside."""
    for k in range(2):
        if job.ends.held[k] == JOINED:
            for i in range(3):
                job.books.velocity[k, i] = job.new.v[k * job.line.h.shape[0], i]


@inner
def place_all(network):
    """Ends of all lines go to where their points and bodies are, from which no force is known yet."""
    given = network.asked.what == CORRECTION
    network.net[:, :3] = 0.0
    network.work[:, LINES : LINES + 6] = 0.0
    for l in range(network.tables.shape[0]):
        place_ends(l, read(network.tables[l]), network, given)


@inner
def add_pulls(network):
    """Forces of all lines on points, into `net`, and on bodies, into `work`."""
    for l in range(network.tables.shape[0]):
        for k in range(2):
            joint = network.joints[l, k]
            if joint >= 0:
                report, clamped = read(network.tables[l]).work.report, turns(network.seats, l, k)
                add_pull(joint, report, k, network.arms[l, k], clamped, network.net, network.work)


@inner
def solve_junctions(network, m):
    """Corrections to what is left over; 0, NO_NUMBERS: as of kernels.junctions.borders."""
    if m > 0 and not factor_dense(network.A, m):
        return 0.0
    substitute_dense(network.A, m)
    return 1.0 if correct_all(network, network.gaps, m, True) < 0 else NO_NUMBERS


@inner
def solve_again(network, m):
    """Corrections to other right-hand sides, by the factors of this iteration; 0: they are not finite."""
    gather_right_sides(network, m)
    substitute_dense(network.A, m)
    return 1.0 if correct_all(network, network.still, m, False) < 0 else 0.0


@kernel(inlined=False)
def join_lines(table):
    """Answer for points and bodies at which lines end (kernels.junctions.borders)."""
    network = read_network(read_border(table).network)
    question, asked, m = network.phase[0], network.asked, network.A.shape[1] - 1
    if question == FORGET:
        network.moves[STRENGTH] = 1.0
    elif question == BEFORE_MARCH:
        place_all(network)
    elif question == FORCE:
        add_pulls(network)
    elif question == BALANCE:
        for b in range(network.work.shape[0]):
            own_force(network.bodies[b], network.old[b], network.new[b], network.work[b])
    elif question == BLOCK:
        assemble_junctions(network, m)
    elif question == HOLD:
        hold_turns(network.work, network.A, m - 6 * network.work.shape[0])
    elif question == COUPLE:
        return solve_junctions(network, m)
    elif question == AGAIN:
        return solve_again(network, m)
    elif question == MEASURE:
        network.moves[FAR], network.moves[TURNED] = size_of_moves(network.work)
    elif question == UPDATE:
        move_bodies(network.new, network.work, asked.scheme_cv, asked.scheme_ca, asked.part)
    elif question == RELAX:
        network.moves[STRENGTH] = adapt_springs(
            network.work, network.moves[STRENGTH], network.moves[TURNED], LARGEST_TURN
        )
    return 1.0


@kernel
def twist_lines(table):
    """Answer for torques through catenary zones of lines (kernels.junctions.borders and kernels.march.zone_torque).

    Columns and the small system are those of each line by itself, whose ends stay where corrections have put them: what
    torques do between two ends that turn is in A already (`twist_ends`), and other right-hand sides have no more of it.
    """
    network = read_network(read_border(table).network)
    question = network.phase[0]
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        known = job.work.torsion.known
        if question == FORGET and known.shape[0] > 0:
            known[0] = -1.0
        elif question == COUPLE:
            twist_zones(1, job, job.new, network.asked.scheme_cv, COUPLE)
    return 1.0
