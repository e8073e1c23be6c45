"""Block rows of nodes in space: geometry, laws and balance of one node after the other, for the march (kernels.march.march).

The layout of a block row and its elimination are in kernels.algebra.block_elimination; symbols as in
kernels.laws.element, kernels.laws.element and kernels.laws.water.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from hybrid.kernels.algebra.block_elimination import (
    SIZE,
    WIDTH,
    Length,
    NarrowBalance,
    eliminate_narrow,
    eliminate_wide,
)
from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    frame,
    get3,
    get9,
    hat,
    madd,
    mat_mat,
    mat_vec,
    mscale,
    msub,
    scale,
    sub,
)
from hybrid.kernels.laws.axial_law import LOSS, SHIFT
from hybrid.kernels.laws.bending_law import bending_at, damped_bending_at
from hybrid.kernels.laws.element import (
    Chord,
    after,
    angular_velocity,
    before,
    chord,
    damped_stretch,
    moment_force,
    pull,
    rotary_force,
    stretch,
    turning,
)
from hybrid.kernels.laws.end_forces import note_end
from hybrid.kernels.laws.node_forces import Z3, Z9, node_loads
from hybrid.kernels.laws.tension_torque import (
    Side,
    couple_length,
    couple_rows,
    damping_loss,
    note_element,
    note_end_torque,
    rest_strain,
)
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    RESIDUAL,
    RESIDUAL_NODE,
    ROTARY,
    STIFFNESS_DAMPING,
    STIFFNESS_DAMPING_POWER,
)

UNIT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
# What Ends.held says of an end that a point of a network of lines holds (kernels.run.network): its place is an unknown.
JOINED = 2
# Part of the torsional stiffness that keeps a rod pinned at both ends from spinning freely.
LEAST_SPIN_STIFFNESS = 1e-9


class Cell(NamedTuple):
    """A cell: its chord, how that turns (with damping or rotary inertia), and its frame (where it has a spin)."""

    chord: Chord
    e1: Any
    d1: Any
    D1: Any
    R: Any


class Element(NamedTuple):
    """The moment M at a node: dM = A de_after + a dpsi_after - B de_before - b dpsi_before."""

    M: Any
    A: Any
    a: Any
    B: Any
    b: Any


class Force(NamedTuple):
    """Force f of a cell, its derivatives by chord (N) and spin (n) of the cell before, of itself, of the cell after.

    With them its law of length, row.de - hck dT = gap.
    """

    f: Any
    Nm: Any
    nm: Any
    N0: Any
    n0: Any
    Np: Any
    np: Any
    row: Any
    hck: float
    gap: float


class LoadedCell(NamedTuple):
    """A cell and its force."""

    cell: Cell
    force: Force


class Balance(NamedTuple):
    """The balance of a node, dF = (derivatives) = rhs, of which the law of cells' lengths is multiplied by `size`."""

    G1: Any  # by the chord before
    G2: Any  # by the chord after
    D: Any  # by the position of the node
    rhs: Any
    gap: Any  # of a held node: the way that it has still to go, m
    held: bool
    size: float


@inner
def set_block(W, row, col, A, sign):
    """W[row:row+3, col:col+3] = sign * A."""
    for j in range(3):
        o = (row + j) * WIDTH + col
        W[o] = sign * A[3 * j]
        W[o + 1] = sign * A[3 * j + 1]
        W[o + 2] = sign * A[3 * j + 2]


@inner
def cell_at(line, ends, state, i, cv):
    """Cell i; beyond the last one nothing but the frame that the end gives."""
    if i >= line.h.shape[0]:
        return Cell(Chord(Z3, 0.0, 0.0), Z3, Z3, Z9, get9(ends.frame, 1))
    d, l, il = chord(get3(state.e, i))
    e1, d1, D1, R = Z3, Z3, Z9, Z9
    if line.bits & (ROTARY | STIFFNESS_DAMPING):
        e1 = sub(get3(state.v, i + 1), get3(state.v, i))
        d1, D1 = turning(d, il, e1, cv)
    if line.spin[i]:
        R = frame(get3(state.a1, i), d)
    return Cell(Chord(d, l, il), e1, d1, D1, R)


@inner
def element_at_start(line, ends, state, cell, cv, couple, report):
    """The element between the start and the first cell."""
    M, A, a = scale(-1.0, get3(ends.moment, 0)), Z9, Z3
    if line.element[0]:
        d, _, il = cell.chord
        R, kb, k0 = get9(ends.frame, 0), get3(line.kb, 0), rest_strain(line, state.T, 0)
        rates, tau = (Z3, Z9, Z3), 0.0
        if line.bits & STIFFNESS_DAMPING:
            wb, We, Wp = angular_velocity(d, cell.d1, state.w[0], il, cell.D1, cv)
            rates, tau = (wb, We, Wp), line.tau[0]
            M, C, Cd, loss = damped_bending_at(line, 0, R, cell.R, kb, k0, tau, get3(ends.spin, 0), wb)
            A, a = after(C, d, il)
            A, a = madd(A, mat_mat(Cd, We)), add(a, mat_vec(Cd, Wp))
            report[STIFFNESS_DAMPING_POWER] += loss
        else:
            M, C = bending_at(line, 0, R, cell.R, kb, k0)
            A, a = after(C, d, il)
        if couple.shape[0] > 0:
            fixed = (get3(ends.spin, 0), Z9, Z3)
            note_element(couple, line, state.T, 0, Side(R, Z3, 0.0), Side(cell.R, d, il), fixed, rates, tau)
    elif couple.shape[0] > 0:
        note_end_torque(couple, line, 0, M, cell.chord.d, cell.chord.il)
    return Element(M, A, a, Z9, Z3)


@inner
def element_after(line, ends, state, i, cell, following, cv, couple, report):
    """The element at the node after cell i, before the cell `following` or the end."""
    n = line.h.shape[0]
    M, A, a, B, b = Z3, Z9, Z3, Z9, Z3
    if i + 1 == n:
        M = get3(ends.moment, 1)
    if i < n and line.element[i + 1]:
        d, _, il = cell.chord
        dn, _, iln = following.chord
        kb, k0 = get3(line.kb, i + 1), rest_strain(line, state.T, i + 1)
        rates, rates_after, tau = (Z3, Z9, Z3), (Z3, Z9, Z3), 0.0
        if line.bits & STIFFNESS_DAMPING:
            wa, Wae, Wap = angular_velocity(d, cell.d1, state.w[i], il, cell.D1, cv)
            wb, We, Wp = get3(ends.spin, 1), Z9, Z3
            tau = line.tau[i]
            if i + 1 < n:
                wb, We, Wp = angular_velocity(dn, following.d1, state.w[i + 1], iln, following.D1, cv)
                tau = 0.5 * (tau + line.tau[i + 1])
            rates, rates_after = (wa, Wae, Wap), (wb, We, Wp)
            M, C, Cd, loss = damped_bending_at(line, i + 1, cell.R, following.R, kb, k0, tau, wa, wb)
            A, a = after(C, dn, iln)
            A, a = madd(A, mat_mat(Cd, We)), add(a, mat_vec(Cd, Wp))
            B, b = before(msub(C, mat_mat(Cd, hat(sub(wb, wa)))), M, d, il)
            B, b = madd(B, mat_mat(Cd, Wae)), add(b, mat_vec(Cd, Wap))
            report[STIFFNESS_DAMPING_POWER] += loss
        else:
            M, C = bending_at(line, i + 1, cell.R, following.R, kb, k0)
            A, a = after(C, dn, iln)
            B, b = before(C, M, d, il)
        if couple.shape[0] > 0:
            mine = Side(cell.R, d, il)
            other = Side(following.R, dn, iln) if i + 1 < n else Side(following.R, Z3, 0.0)
            note_element(couple, line, state.T, i + 1, mine, other, rates, rates_after, tau)
        if i + 1 == n:
            A, a = Z9, Z3  # the frame of the end is given
    elif couple.shape[0] > 0 and i < n:
        note_end_torque(couple, line, i + 1, M, cell.chord.d, cell.chord.il)
    return Element(M, A, a, B, b)


@inner
def cell_force(line, state, i, cell, here, there, bent, rates, work):
    """Force of cell i between the elements `here` and `there`; of no cell beyond the last one, whose dT is 0."""
    if i >= line.h.shape[0]:
        return Force(Z3, Z9, Z3, Z9, Z3, Z9, Z3, Z3, 1.0, 0.0)
    gaps, couple, report = work.gaps, work.couple, work.report
    (d, l, il), (cv, ca) = cell.chord, rates
    bits, T, w = line.bits, state.T[i], state.w[i]
    Nm, nm, n0, Np, np = Z9, Z3, Z3, Z9, Z3
    f, N0 = pull(d, il, T)
    row, hck, gap = stretch(get3(state.e, i), d, l, line.h[i], line.ck[i], T)
    if bits & STIFFNESS_DAMPING and hck > 0.0:  # what does not stretch has no rate of stretching to damp
        row, late = damped_stretch(d, cell.e1, cell.d1, line.tau[i], cv)
        gap -= late
        along = dot(d, cell.e1)
        if couple.shape[0] > 0:
            report[STIFFNESS_DAMPING_POWER] += damping_loss(couple, line, state, i, along)
        elif not bits & AXIAL_LAW:
            report[STIFFNESS_DAMPING_POWER] += line.tau[i] * along * along / hck
    if bits & AXIAL_LAW:
        gap += line.h[i] * line.law[i, SHIFT]
        report[STIFFNESS_DAMPING_POWER] += line.law[i, LOSS]
    if gaps.shape[0] > 0 and hck == 0.0:
        gap = gaps[i]
    if couple.shape[0] > 0:
        more, less = couple_length(couple, line, i, T)
        hck, gap = hck + more, gap + less
    if bent:
        Q = sub(there.M, here.M)
        DQ = mscale(-1.0, madd(there.B, here.A))
        q0 = scale(-1.0, add(there.b, here.a))
        if bits & ROTARY:
            G = line.polar[i]
            Q = sub(Q, scale(G * w, cell.d1))
            DQ = msub(DQ, mscale(G * w, cell.D1))
            q0 = sub(q0, scale(G * cv, cell.d1))
            e2 = sub(get3(state.vd, i + 1), get3(state.vd, i))
            fr, Dr = rotary_force(d, il, cell.e1, e2, cell.d1, cell.D1, line.rotary[i], cv, ca)
            f, N0 = add(f, fr), madd(N0, Dr)
        V, DV = moment_force(d, il, Q, DQ)
        f, N0 = add(f, V), madd(N0, DV)
        S = mscale(il, hat(d))
        n0 = scale(il, cross(d, q0))
        Nm, nm = mat_mat(S, here.B), scale(il, cross(d, here.b))
        Np, np = mat_mat(S, there.A), scale(il, cross(d, there.a))
    return Force(f, Nm, nm, N0, n0, Np, np, row, hck, gap)


@inner
def balance(line, sea, ends, r, state, i, before, after, rates, work):
    """The balance of node i between two cells and their forces."""
    n, u, report = line.h.shape[0], work.u, work.report
    force_before, force = before.force, after.force
    F, D, GL, GR = node_loads(line, sea, i, r, u, state, before.cell.chord, after.cell.chord, rates, report)
    F = add(F, sub(force.f, force_before.f))
    held = (i == 0 and ends.held[0] != 0) or (i == n and ends.held[1] == 1)
    if i == 0:
        F = add(F, get3(ends.force, 0))
    if i == n:
        F = add(F, get3(ends.force, 1))
    if i == 0 or i == n:
        x = (r[i, 0] + u[i, 0], r[i, 1] + u[i, 1], r[i, 2] + u[i, 2])
        note_end(line, sea, ends, state, 0 if i == 0 else 1, x, F, report)
    G1, G2 = madd(msub(force.Nm, force_before.N0), GL), madd(msub(force.N0, force_before.Np), GR)
    Dii = madd(msub(G1, G2), D)
    gap, size = Z3, 1.0
    if held:
        k = 0 if i == 0 else 1
        gap = (
            ends.position[k, 0] - r[i, 0] - u[i, 0],
            ends.position[k, 1] - r[i, 1] - u[i, 1],
            ends.position[k, 2] - r[i, 2] - u[i, 2],
        )
    else:
        big = max(abs(F[0]), abs(F[1]), abs(F[2]))
        if not big <= report[RESIDUAL] and not (i == n and ends.held[1] == JOINED):  # a point balances other lines too
            report[RESIDUAL], report[RESIDUAL_NODE] = big, i
        # lengths in the unit of the balance, so that pivoting compares like with like
        size = abs(Dii[0]) + abs(Dii[4]) + abs(Dii[8])
        if not size > 0.0:
            size = 1.0
    return Balance(G1, G2, Dii, scale(-1.0, F), gap, held, size)


@inner
def fill_spin(W, line, state, i, cell, here, there, ca, passed):
    """The row of the spin of cell i: d.(M_{i+1} - M_i) - polar w' = 0, with the torque of a catenary zone beside it."""
    d, _, il = cell.chord
    o = 4 * WIDTH
    if i >= line.h.shape[0] or not line.spin[i]:
        W[o + 14] = 1.0
        return
    A, B, An, Bn = here.A, here.B, there.A, there.B
    Q = sub(there.M, here.M)
    along = dot(d, Q)
    sm = (dot(d, (B[0], B[3], B[6])), dot(d, (B[1], B[4], B[7])), dot(d, (B[2], B[5], B[8])))
    s0 = (
        il * (Q[0] - along * d[0]) - dot(d, (Bn[0] + A[0], Bn[3] + A[3], Bn[6] + A[6])),
        il * (Q[1] - along * d[1]) - dot(d, (Bn[1] + A[1], Bn[4] + A[4], Bn[7] + A[7])),
        il * (Q[2] - along * d[2]) - dot(d, (Bn[2] + A[2], Bn[5] + A[5], Bn[8] + A[8])),
    )
    sp = (dot(d, (An[0], An[3], An[6])), dot(d, (An[1], An[4], An[7])), dot(d, (An[2], An[5], An[8])))
    soft = -LEAST_SPIN_STIFFNESS * (line.kb[i, 2] * line.element[i] + line.kb[i + 1, 2] * line.element[i + 1])
    if soft == 0.0:  # between swivels
        soft = -LEAST_SPIN_STIFFNESS * (line.kb[i, 0] + line.kb[i + 1, 0])
    residual, inertia = along, 0.0
    if line.bits & ROTARY:
        residual -= line.polar[i] * state.wd[i]
        inertia = line.polar[i] * ca
    if passed.shape[1] > 0:
        residual += passed[0, i]
        soft -= passed[1, i]
    for j in range(3):
        W[o + 6 + j] = -sm[j]
        W[o + 11 + j] = sm[j] - s0[j]
        W[o + 16 + j] = s0[j] - sp[j]
        W[o + 20 + j] = sp[j]
    W[o + 9] = dot(d, here.b)
    W[o + 14] = -dot(d, add(there.b, here.a)) - inertia + soft
    W[o + 19] = dot(d, there.a)
    W[o + 23] = -residual


@inner
def size_of_spin(line, i, cell, here, there, ca):
    """Size of the row of the spin of cell i: a held node has it on its diagonal, lest pivoting takes that for small."""
    hold = 1.0
    if i < line.h.shape[0] and line.spin[i]:
        A, B = here.A, there.B
        hold += abs(dot(cell.chord.d, add(there.b, here.a))) + abs(there.A[0]) + abs(B[0])
        hold += abs(A[0]) + abs(A[4]) + abs(A[8]) + abs(B[4]) + abs(B[8])
        if line.bits & ROTARY:
            hold += line.polar[i] * ca
    return hold


@inner
def fill(line, state, i, node, before, after, here, there, ca, work):
    """The whole block row of node i into work.W, with its balance also where it is held."""
    W, couple, (cell, force), force_before = work.W, work.couple, after, before.force
    for j in range(SIZE * WIDTH):
        W[j] = 0.0
    row, d_before, d = force_before.row, before.cell.chord.d, cell.chord.d
    W[6], W[7], W[8] = -row[0], -row[1], -row[2]
    W[11], W[12], W[13] = row[0], row[1], row[2]
    W[10], W[23] = -force_before.hck, force_before.gap
    set_block(W, 1, 1, force_before.Nm, 1.0)
    set_block(W, 1, 6, madd(force_before.Nm, node.G1), -1.0)
    set_block(W, 1, 11, node.D, 1.0)
    set_block(W, 1, 16, msub(node.G2, force.Np), 1.0)
    set_block(W, 1, 20, force.Np, 1.0)
    for j in range(3):
        o = (j + 1) * WIDTH
        W[o + 4] = -force_before.nm[j]
        W[o + 9] = force.nm[j] - force_before.n0[j]
        W[o + 10] = -d_before[j]
        W[o + 14] = force.n0[j] - force_before.np[j]
        W[o + 15] = d[j]
        W[o + 19] = force.np[j]
    W[WIDTH + 23], W[2 * WIDTH + 23], W[3 * WIDTH + 23] = node.rhs
    fill_spin(W, line, state, i, cell, here, there, ca, work.torsion.passed)
    if couple.shape[0] > 0:
        couple_rows(W, couple, line, state.e, i)


@kernel  # called for two nodes of a line, not inlined for all
def hold(W, unit, x, y, z):
    """Put the way (x, y, z) that a held node has still to go in place of its balance in the block row."""
    for j in range(WIDTH, 4 * WIDTH):
        W[j] = 0.0
    W[WIDTH + 11], W[2 * WIDTH + 12], W[3 * WIDTH + 13] = unit, unit, unit
    W[WIDTH + 23], W[2 * WIDTH + 23], W[3 * WIDTH + 23] = unit * x, unit * y, unit * z


@kernel
def keep_row(rows, i, W):
    """Keep a block row."""
    for j in range(SIZE * WIDTH):
        rows[i, j] = W[j]


@inner
def eliminate(W, X, i, kept, node, cell_before, cell, force_before, wide, couples):
    """Eliminate the block row of node i, which stands in W where it is wide; False when its block is singular."""
    size, row = node.size, force_before.row
    if wide:
        for j in range(1 if couples else 6, 20 if couples else 14):
            W[j] *= size
        W[23] *= size
        return eliminate_wide(W, X, i, kept, size, couples)
    length = Length((size * row[0], size * row[1], size * row[2]), size * force_before.hck, size * force_before.gap)
    if node.held:
        return eliminate_narrow(length, NarrowBalance(Z3, Z9, UNIT, Z3, Z9, node.gap), X, i, kept, size)
    back, L = scale(-1.0, cell_before.chord.d), mscale(-1.0, node.G1)
    narrow = NarrowBalance(back, L, node.D, cell.chord.d, node.G2, node.rhs)
    return eliminate_narrow(length, narrow, X, i, kept, size)
