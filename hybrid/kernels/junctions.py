"""Points and bodies at which lines meet: their equations, from what every line hands over (kernels.joined_lines).

An end that is joined to a point moves as the point, one that is joined to a body by  G z = dr + dtheta x rho  of the
body's z = (dr, dtheta), with rho the arm of its fairlead.  What a line hands over,

    S (dT, q, dr_N) = right-hand side,   rows: length of the last cell, balance of the start, balance of the end,

goes by G^T into the balances of points and bodies: forces, and rho x force as moments.  A force F turns with the arm of
its fairlead, which adds  [F]x [rho]x  to the moment.
"""

from __future__ import annotations

from hybrid.kernels.bodies import LINES, X, add_own, reach_out, vector
from hybrid.kernels.compile import inner
from hybrid.kernels.joined_lines import (
    LEFT,
    OF_START,
    balance_of_start,
    carry_start,
    end_row,
    last_block,
    solve_back,
)
from hybrid.kernels.report import FORCE_A
from hybrid.kernels.rotations import cross, hat, mat_mat
from hybrid.kernels.run import read

START, END = 0, 1
# Columns of S: of the tension, of the start, of the end, and the right-hand side; its rows: the first three.
TENSION, OF = 0, (1, 4)
RIGHT = 7


@inner
def first_unknown(joint, tensions, points):
    """Where the unknowns of a point or body begin."""
    return tensions + 3 * joint + 3 * max(joint - points, 0)


@inner
def count_tensions(joints):
    """How many lines hand over their last block, with the tension of its cell."""
    found = 0
    for l in range(joints.shape[0]):
        if joints[l, END] >= 0:
            found += 1
    return found


@inner
def place_ends(l, job, joints, fairleads, arms, gaps, points, old, new, work, given):
    """Arms of the fairleads of a line, and how far its ends have still to go to them; given: those are."""
    for k in range(2):
        joint, node = joints[l, k], k * job.line.h.shape[0]
        if joint >= points:
            b = joint - points
            rho, place = reach_out(new[b], old[b], work[b], vector(fairleads[l, k], 0))
            for i in range(3):
                arms[l, k, i] = rho[i]
                if not given:
                    gaps[l, k, i] = place[i] - job.old.r[node, i] - job.work.u[node, i]
        if k == START and joint >= 0:
            for i in range(3):
                job.ends.position[0, i] = job.old.r[0, i]
                if not given:  # as it is, -u is what it has still to go, too small to be added to a place
                    job.ends.position[0, i] += job.work.u[0, i] + gaps[l, k, i]


@inner
def add_pull(joint, report, k, arm, net, work):
    """The force of an end on its point or body."""
    o, points = FORCE_A + 3 * k, net.shape[0]
    F = (report[o], report[o + 1], report[o + 2])
    if joint < points:
        for i in range(3):
            net[joint, i] += F[i]
        return
    M = cross(vector(arm, 0), F)
    for i in range(3):
        work[joint - points, LINES + i] += F[i]
        work[joint - points, LINES + 3 + i] += M[i]


@inner
def hand_over(l, job, joints, first, columns, functional, gaps, S):
    """What a line hands over: its rows and columns of S."""
    for r in range(7):
        for c in range(8):
            S[r, c] = 0.0
    start, end = joints[l, START], joints[l, END]
    n, X_, o = job.line.h.shape[0], job.work.X, first[l]
    if start >= 0:
        carry_start(X_, job.work.W, columns, o, n, end >= 0)
        balance_of_start(X_, job.work.rows[0], columns, o, n, end >= 0, functional)
        for a in range(3):
            f = functional[a]
            for b in range(3):
                S[1 + a, 1 + b] = f[OF_START + b]
            S[1 + a, RIGHT] = -f[LEFT]
            if end >= 0:
                S[1 + a, 0] = f[0]
                for b in range(3):
                    S[1 + a, 4 + b] = f[1 + b]
    if end >= 0:
        k = last_block(X_, n)
        for r in range(4):
            e = 0 if r == 0 else 3 + r
            S[e, 0] = end_row(X_, k, r, 0)
            S[e, RIGHT] = X_[k + 64 + r]
            for b in range(3):
                S[e, 4 + b] = end_row(X_, k, r, 1 + b)
                if start >= 0:
                    S[e, 1 + b] = -columns[b, o + n, r]
        for e in range(7):
            for b in range(3):
                S[e, RIGHT] -= S[e, 4 + b] * gaps[l, END, b]


@inner
def follow(joint, points, arm, G):
    """G (3, 6) of an end; returns how many columns it has."""
    for i in range(3):
        for j in range(6):
            G[i, j] = 1.0 if i == j else 0.0
    if joint < points:
        return 3
    H = hat(vector(arm, 0))
    for i in range(3):
        for j in range(3):
            G[i, 3 + j] = -H[3 * i + j]
    return 6


@inner
def add_row(S, r, part, A, e, m, tension, at, size, G):
    """A part of row r of S into row e of A; tension: its column there, -1: none; at, size: of the unknowns of both ends."""
    if tension >= 0:
        A[e, tension] += part * S[r, TENSION]
    A[e, m] += part * S[r, RIGHT]
    for k in range(2):
        for i in range(3):
            value = part * S[r, 1 + 3 * k + i]
            if value != 0.0:
                for j in range(size[k]):
                    if G[k, i, j] != 0.0:
                        A[e, at[k] + j] += value * G[k, i, j]


@inner
def spread(l, joints, report, arms, points, tensions, row, S, G, A, m):
    """S of a line into the equations A of all tensions, points and bodies; row: of its tension, -1: none."""
    start, end = joints[l, START], joints[l, END]
    size = (
        follow(start, points, arms[l, START], G[START]) if start >= 0 else 0,
        follow(end, points, arms[l, END], G[END]) if end >= 0 else 0,
    )
    at = (first_unknown(max(start, 0), tensions, points), first_unknown(max(end, 0), tensions, points))
    if row >= 0:
        add_row(S, 0, 1.0, A, row, m, row, at, size, G)
    for k in range(2):
        for j in range(size[k]):
            for i in range(3):
                if G[k, i, j] != 0.0:
                    add_row(S, 1 + 3 * k + i, G[k, i, j], A, at[k] + j, m, row, at, size, G)
        if size[k] == 6:
            o = FORCE_A + 3 * k
            T = mat_mat(hat((report[o], report[o + 1], report[o + 2])), hat(vector(arms[l, k], 0)))
            for i in range(3):
                for j in range(3):
                    A[at[k] + 3 + i, at[k] + 3 + j] += T[3 * i + j]


@inner
def assemble_junctions(
    tables, joints, arms, gaps, first, columns, functional, net, bodies, old, new, work, S, G, A, m, cv, ca
):
    """Equations (m, m+1) of the last tensions, the points and the bodies, from what the lines hand over."""
    for r in range(m):
        for c in range(m + 1):
            A[r, c] = 0.0
    row, tensions, points = 0, count_tensions(joints), net.shape[0]
    for l in range(tables.shape[0]):
        start, end = joints[l, START], joints[l, END]
        if start < 0 and end < 0:
            continue
        job = read(tables[l])
        hand_over(l, job, joints, first, columns, functional, gaps, S)
        spread(l, joints, job.work.report, arms, points, tensions, row if end >= 0 else -1, S, G, A, m)
        if end >= 0:
            row += 1
    add_own(bodies, old, new, work, A, first_unknown(points, tensions, points), m, cv, ca)


@inner
def shift_of(joint, tensions, points, arm, gap, A, m):
    """Shift of an end by the solution, and what is still to go beside it; the last: without that."""
    at = first_unknown(joint, tensions, points)
    q = (A[at, m], A[at + 1, m], A[at + 2, m])
    if joint >= points:
        t = cross((A[at + 3, m], A[at + 4, m], A[at + 5, m]), vector(arm, 0))
        q = (q[0] + t[0], q[1] + t[1], q[2] + t[2])
    return (q[0] + gap[0], q[1] + gap[1], q[2] + gap[2]), q


@inner
def correct_all(tables, joints, arms, gaps, first, columns, points, work, A, m):
    """Corrections of all lines and bodies from the solution; returns -1, or a line whose correction is not finite."""
    row, tensions = 0, count_tensions(joints)
    for b in range(work.shape[0]):
        at = first_unknown(points + b, tensions, points)
        for k in range(6):
            work[b, X + k] = A[at + k, m]
    for l in range(tables.shape[0]):
        job, start, end = read(tables[l]), joints[l, START], joints[l, END]
        x, n, q, place = job.work.x, job.line.h.shape[0], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        if end >= 0:
            far, _ = shift_of(end, tensions, points, arms[l, END], gaps[l, END], A, m)
            x[n, 0], x[n, 1], x[n, 2], x[n, 3] = A[row, m], far[0], far[1], far[2]
            row += 1
        if start >= 0:
            place, q = shift_of(start, tensions, points, arms[l, START], gaps[l, START], A, m)
        if not solve_back(job.work.X, columns, first[l], start >= 0, q, place, x, end >= 0):
            return l
    return -1
