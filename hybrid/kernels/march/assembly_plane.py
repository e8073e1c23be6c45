"""The march of a line in a plane, and what its equations leave over.

The march along s for a cable in a plane: three unknowns per node instead of five, and no rotations of space.

States, ends and sea stay what they are, vectors of space: their components
across the plane are neither read nor written.  Symbols as in kernels.algebra.plane; docs/theory.md, 5.
What equations leave over is as in kernels.march.march.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from hybrid.kernels.algebra.block_elimination import ROW, Length
from hybrid.kernels.algebra.plane import (
    KEPT,
    TRIPLE,
    WIDE,
    angle_between,
    chord2,
    dot2,
    eliminate2,
    eliminate_chain,
    end_chord,
    madd2,
    mscale2,
    msub2,
    outer2,
    rotary2,
    row_along_normal,
    row_in_plane,
    stiffness_about_normal,
    to_space,
    turning2,
)
from hybrid.kernels.laws.axial_law import LOSS, SHIFT
from hybrid.kernels.laws.bending_law import has_bend_law, shares_of_stiffness, slip_about_normal
from hybrid.kernels.laws.element import Chord, Rates
from hybrid.kernels.laws.end_forces import note_end
from hybrid.kernels.laws.node_forces import node_loads2
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.state.report import (
    ASSEMBLED,
    AXIAL_LAW,
    BENDING_SLIP,
    MOMENT_A,
    MOMENT_B,
    RESIDUAL,
    RESIDUAL_NODE,
    ROTARY,
    STIFFNESS_DAMPING,
    STIFFNESS_DAMPING_POWER,
)

Z2 = (0.0, 0.0)
Z4 = (0.0, 0.0, 0.0, 0.0)


class Cell(NamedTuple):
    """A cell: its chord, and how its angle answers to that (g); with damping or rotary inertia how it turns."""

    chord: Chord
    g: Any
    e1: Any
    turn: float
    g1: Any
    tau: float


class Element(NamedTuple):
    """The moment M about n at a node: dM = A.de_after - B.de_before."""

    M: float
    A: Any
    B: Any


class Force(NamedTuple):
    """Force f of a cell, its derivatives by the chord before, its own, the one after; its law of length."""

    f: Any
    Nm: Any
    N0: Any
    Np: Any
    row: Any
    hck: float
    gap: float


class LoadedCell(NamedTuple):
    """A cell and its force."""

    cell: Cell
    force: Force


class Balance(NamedTuple):
    """The balance of a node: K dr_{i-2} + L dr_{i-1} + back dT_{i-1} + D dr_i + ahead dT_i + U dr_{i+1} + V dr_{i+2} = b.

    size: the laws of length are multiplied by it, so that pivoting compares like with like.
    """

    K: Any
    L: Any
    back: Any
    D: Any
    ahead: Any
    U: Any
    V: Any
    b: Any
    size: float


@inner
def cell_at(line, state, i, cv):
    """Cell i; nothing beyond the last one."""
    if i >= line.h.shape[0]:
        return Cell(Chord(Z2, 0.0, 0.0), Z2, Z2, 0.0, Z2, 0.0)
    plane, bits = line.plane, line.bits
    d, l, il = chord2(row_in_plane(plane, state.e, i))
    e1, turn, g1, tau = Z2, 0.0, Z2, 0.0
    if bits & (ROTARY | STIFFNESS_DAMPING):
        v, vn = row_in_plane(plane, state.v, i), row_in_plane(plane, state.v, i + 1)
        e1 = (vn[0] - v[0], vn[1] - v[1])
        turn, g1 = turning2(d, il, e1, cv)
    if bits & STIFFNESS_DAMPING:
        tau = line.tau[i]
    return Cell(Chord(d, l, il), (-il * d[1], il * d[0]), e1, turn, g1, tau)


@inner
def elastic(line, i, k, bend):
    """Moment of the element at node i under a bend (rad) from what has no stress, and its slope; k: N m, without bend."""
    if not has_bend_law(line, i):
        return k * bend, k
    secant, more, _ = shares_of_stiffness(line, i, abs(bend))
    return secant * k * bend, (secant + more) * k


@inner
def moment_in_plane(line, a1, c, d, i, k, bend):
    """As `elastic`, with layers that slip; a1, c, d: as of `slip_about_normal`."""
    M, slope = elastic(line, i, k, bend)
    if line.bits & BENDING_SLIP:
        m, more, _ = slip_about_normal(line, a1, c, d, i, bend)
        M, slope = M + m, slope + more
    return M, slope


@inner
def element_at_start(line, ends, state, cell, report):
    """The element between the start and the first cell."""
    plane = line.plane
    M, A = -row_along_normal(plane, ends.moment, 0), Z2
    if line.element[0]:
        d, tau = cell.chord.d, cell.tau
        k, k0 = stiffness_about_normal(plane, state.a1, 0, d, line.kb, line.k0, 0)
        rate = cell.turn - row_along_normal(plane, ends.spin, 0) if line.bits & STIFFNESS_DAMPING else 0.0
        bend = angle_between(end_chord(plane, ends.frame, 0), d) - k0
        M, slope = moment_in_plane(line, state.a1, 0, d, 0, k, bend)
        M += k * tau * rate
        A = (slope * cell.g[0] + k * tau * cell.g1[0], slope * cell.g[1] + k * tau * cell.g1[1])
        report[STIFFNESS_DAMPING_POWER] += k * tau * rate * rate
    return Element(M, A, Z2)


@inner
def element_after(line, ends, state, i, cell, following, report):
    """The element at the node after cell i, before the cell `following` or the end."""
    n, plane = line.h.shape[0], line.plane
    M, A, B = 0.0, Z2, Z2
    if i + 1 == n:
        M = row_along_normal(plane, ends.moment, 1)
    if i < n and line.element[i + 1]:
        d, g, g1 = cell.chord.d, cell.g, cell.g1
        k, k0 = stiffness_about_normal(plane, state.a1, i, d, line.kb, line.k0, i + 1)
        after, late, rate = following.chord.d, 0.5 * (cell.tau + following.tau), following.turn - cell.turn
        if i + 1 == n:
            after, late = end_chord(plane, ends.frame, 1), cell.tau
            rate = row_along_normal(plane, ends.spin, 1) - cell.turn
        M, slope = moment_in_plane(line, state.a1, i, d, i + 1, k, angle_between(d, after) - k0)
        if line.bits & STIFFNESS_DAMPING:
            M += k * late * rate
            report[STIFFNESS_DAMPING_POWER] += k * late * rate * rate
        late *= k
        B = (slope * g[0] + late * g1[0], slope * g[1] + late * g1[1])
        if i + 1 < n:
            g, g1 = following.g, following.g1
            A = (slope * g[0] + late * g1[0], slope * g[1] + late * g1[1])
    return Element(M, A, B)


@inner
def cell_force(line, state, i, cell, here, there, bent, rates, work):
    """Force of cell i between the elements `here` and `there`; of no cell beyond the last one, whose dT is 0."""
    if i >= line.h.shape[0]:
        return Force(Z2, Z4, Z4, Z4, Z2, 1.0, 0.0)
    gaps, report = work.gaps, work.report
    (d, l, il), (cv, ca) = cell.chord, rates
    T, h, m = state.T[i], line.h[i], (-d[1], d[0])
    Nm, Np = Z4, Z4
    f, N0 = (T * d[0], T * d[1]), outer2(T * il, m, m)
    hck = h * line.ck[i]
    row, gap = d, hck * T - (l * l - h * h) / (l + h)
    if line.bits & STIFFNESS_DAMPING and hck > 0.0:  # what does not stretch has no rate of stretching to damp
        tau = cell.tau
        x, y, along = 1.0 + tau * cv, tau * cell.turn, dot2(d, cell.e1)
        row, gap = (x * d[0] + y * m[0], x * d[1] + y * m[1]), gap - tau * along
        if not line.bits & AXIAL_LAW:
            report[STIFFNESS_DAMPING_POWER] += tau * along * along / hck
    if line.bits & AXIAL_LAW:
        gap += h * line.law[i, SHIFT]
        report[STIFFNESS_DAMPING_POWER] += line.law[i, LOSS]
    if gaps.shape[0] > 0 and hck == 0.0:
        gap = gaps[i]
    if bent:
        # shear -m Q/l, whose Q answers to the chords of cells i-1, i, i+1
        x = il * (there.M - here.M)
        f = (f[0] - x * m[0], f[1] - x * m[1])
        y = il * x
        p, q = -2.0 * y * d[0] * d[1], y * (d[0] * d[0] - d[1] * d[1])
        N0 = madd2(N0, (p, q, q, 2.0 * y * d[0] * d[1]))
        N0 = madd2(N0, outer2(il, m, (there.B[0] + here.A[0], there.B[1] + here.A[1])))
        Nm, Np = outer2(-il, m, here.B), outer2(-il, m, there.A)
        if line.bits & ROTARY:
            a, b = row_in_plane(line.plane, state.vd, i), row_in_plane(line.plane, state.vd, i + 1)
            e2 = (b[0] - a[0], b[1] - a[1])
            g, Dg = rotary2(d, il, cell.e1, e2, cell.turn, line.rotary[i], cv, ca)
            f, N0 = (f[0] + g[0], f[1] + g[1]), madd2(N0, Dg)
    return Force(f, Nm, N0, Np, row, hck, gap)


@inner
def balance(line, sea, ends, r, state, i, before, after, rates, work):
    """The balance of node i between two cells and their forces."""
    n, plane, u, report = line.h.shape[0], line.plane, work.u, work.report
    force_before, force = before.force, after.force
    F, D, GL, GR = node_loads2(line, sea, i, r, u, state, before.cell.chord, after.cell.chord, rates, report)
    F = (F[0] + force.f[0] - force_before.f[0], F[1] + force.f[1] - force_before.f[1])
    if i == 0:
        f = row_in_plane(plane, ends.force, 0)
        F = (F[0] + f[0], F[1] + f[1])
    if i == n:
        f = row_in_plane(plane, ends.force, 1)
        F = (F[0] + f[0], F[1] + f[1])
    if i == 0 or i == n:
        x = (r[i, 0] + u[i, 0], r[i, 1] + u[i, 1], r[i, 2] + u[i, 2])
        note_end(line, sea, ends, state, 0 if i == 0 else 1, x, to_space(plane, F), report)
    if (i == 0 and ends.held[0]) or (i == n and ends.held[1]):
        x, y = row_in_plane(plane, ends.position, 0 if i == 0 else 1), row_in_plane(plane, r, i)
        f = row_in_plane(plane, u, i)
        b = (x[0] - y[0] - f[0], x[1] - y[1] - f[1])
        return Balance(Z4, Z4, Z2, (1.0, 0.0, 0.0, 1.0), Z2, Z4, Z4, b, 1.0)
    big = max(abs(F[0]), abs(F[1]))
    if not big <= report[RESIDUAL]:
        report[RESIDUAL], report[RESIDUAL_NODE] = big, i
    G1, G2 = madd2(msub2(force.Nm, force_before.N0), GL), madd2(msub2(force.N0, force_before.Np), GR)
    D = madd2(msub2(G1, G2), D)
    size = abs(D[0]) + abs(D[3])
    if not size > 0.0:
        size = 1.0
    K, V = force_before.Nm, force.Np
    d, ahead = before.cell.chord.d, after.cell.chord.d
    back = (-d[0], -d[1])
    return Balance(K, mscale2(-1.0, madd2(K, G1)), back, D, ahead, msub2(G2, V), V, (-F[0], -F[1]), size)


@inner
def eliminate(node, force_before, X, i, kept, wide):
    """Eliminate the block row of node i, with its law of length in the unit of the balance; False if singular."""
    size, row = node.size, force_before.row
    length = Length((size * row[0], size * row[1]), size * force_before.hck, size * force_before.gap)
    if wide:
        return eliminate2(length, node, X, i, kept)
    return eliminate_chain(length, node, X, i, kept)


@kernel
def march_planar(line, sea, ends, r, state, cv, ca, work):
    """As kernels.march.assembly.march for a cable in the plane `line.plane`.

    work.rows with N+1 entries receives every block row before elimination, three rows of WIDE.  Factors are kept behind
    the X_i where X has room for those of space (kernels.run.newton.workspace).
    """
    n, plane = line.h.shape[0], line.plane
    X, report, rows, rates = work.X, work.report, work.rows, Rates(cv, ca)
    kept, next_kept = 0, 0
    if X.shape[0] > (n + 1) * ROW:
        kept, next_kept = (n + 1) * TRIPLE, KEPT
    for j in range(ASSEMBLED):
        report[j] = 0.0
    report[RESIDUAL_NODE] = -1.0

    cell_before = Cell(Chord(Z2, 0.0, 0.0), Z2, Z2, 0.0, Z2, 0.0)
    force_before = Force(Z2, Z4, Z4, Z4, Z2, -1.0, 0.0)  # there is no cell before the start: dT = 0
    bent_before = False
    cell = cell_at(line, state, 0, cv)
    here = element_at_start(line, ends, state, cell, report)
    for k in range(3):
        report[MOMENT_A + k] = here.M * plane[2, k]
    for i in range(n + 1):
        following = cell_at(line, state, i + 1, cv)
        there = element_after(line, ends, state, i, cell, following, report)
        bent = i < n and (line.element[i] != 0 or line.element[i + 1] != 0 or line.spin[i] != 0)
        force = cell_force(line, state, i, cell, here, there, bent, rates, work)
        before, after = LoadedCell(cell_before, force_before), LoadedCell(cell, force)
        node = balance(line, sea, ends, r, state, i, before, after, rates, work)
        if rows.shape[0] > 0:
            store_block_row(rows, i, node, force_before)
        if not eliminate(node, force_before, X, i, kept, bent or bent_before):
            return i
        if i == n - 1:
            for k in range(3):
                report[MOMENT_B + k] = there.M * plane[2, k]
        kept += next_kept
        cell_before, force_before, bent_before = cell, force, bent
        cell, here = following, there
    return -1


@inner
def store_block_row(rows, i, node, force_before):
    """The block row of node i: columns dr_{i-2}, dr_{i-1}, dT_{i-1}, dr_i, dT_i, dr_{i+1}, dr_{i+2}, right side."""
    K, L, back, D, ahead, U, V, b, _ = node
    row, hck, gap = force_before.row, force_before.hck, force_before.gap
    for j in range(3 * WIDE):
        rows[i, j] = 0.0
    rows[i, 2], rows[i, 3], rows[i, 4], rows[i, 5], rows[i, 6] = -row[0], -row[1], -hck, row[0], row[1]
    rows[i, 12] = gap
    for j in range(2):
        o = (j + 1) * WIDE
        k = 2 * j
        rows[i, o], rows[i, o + 1], rows[i, o + 2], rows[i, o + 3] = K[k], K[k + 1], L[k], L[k + 1]
        rows[i, o + 4], rows[i, o + 5], rows[i, o + 6], rows[i, o + 7] = back[j], D[k], D[k + 1], ahead[j]
        rows[i, o + 8], rows[i, o + 9], rows[i, o + 10], rows[i, o + 11] = U[k], U[k + 1], V[k], V[k + 1]
        rows[i, o + 12] = b[j]


@called
def left_over_in_plane(line, sea, ends, r, state, cv, ca, work, b):
    """As `left_over_in_space`, of a right-hand side of `block_elimination_plane.solve_again_planar`."""
    n, plane = line.h.shape[0], line.plane
    report, rates = work.report, Rates(cv, ca)
    for j in range(ASSEMBLED):
        report[j] = 0.0
    report[RESIDUAL_NODE] = -1.0
    cell_before = Cell(Chord(Z2, 0.0, 0.0), Z2, Z2, 0.0, Z2, 0.0)
    force_before = Force(Z2, Z4, Z4, Z4, Z2, -1.0, 0.0)
    cell = cell_at(line, state, 0, cv)
    here = element_at_start(line, ends, state, cell, report)
    for k in range(3):
        report[MOMENT_A + k] = here.M * plane[2, k]
    for i in range(n + 1):
        following = cell_at(line, state, i + 1, cv)
        there = element_after(line, ends, state, i, cell, following, report)
        bent = i < n and (line.element[i] != 0 or line.element[i + 1] != 0 or line.spin[i] != 0)
        force = cell_force(line, state, i, cell, here, there, bent, rates, work)
        before, after = LoadedCell(cell_before, force_before), LoadedCell(cell, force)
        node = balance(line, sea, ends, r, state, i, before, after, rates, work)
        b[i, 0], b[i, 1], b[i, 2], b[i, 3], b[i, 4] = force_before.gap, 0.0, 0.0, 0.0, 0.0
        if not ((i == 0 and ends.held[0]) or (i == n and ends.held[1])):
            b[i, 1], b[i, 2], b[i, 3] = to_space(plane, node.b)
        if i == n - 1:
            for k in range(3):
                report[MOMENT_B + k] = there.M * plane[2, k]
        cell_before, force_before = cell, force
        cell, here = following, there
