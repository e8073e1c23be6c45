"""The march along s, its corrections, and what equations leave over.

Each block row is eliminated as soon as it is made (docs/theory.md, 5).  Nodes between two catenary cells, which are
most of them, take a loop of their own: what the other nodes carry along for bending, some 150 numbers, would be most of
what they cost.

A correction changes positions, chords, tensions, directors and rates.  `plane` is the plane of a line that is computed
in one, else None; `space` is None for such a line, else 1.  numba drops what stands behind `is not None` of the one
that is None, so what the other kind needs is not compiled.

What equations leave over is made by the same functions: what only derivatives need is not compiled.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, Length, NarrowBalance, eliminate_narrow
from hybrid.kernels.algebra.plane import carried, chord2, vector_in_plane
from hybrid.kernels.algebra.rotations import add, dot, get3, madd, mscale, msub, scale, spin_about, sub, transport
from hybrid.kernels.laws.element import Chord, Rates, chord, pull, stretch
from hybrid.kernels.laws.node_forces import Z3, Z9, node_loads
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.march.assembly import (
    Cell,
    Element,
    Force,
    LoadedCell,
    balance,
    cell_at,
    cell_force,
    element_after,
    element_at_start,
    eliminate,
    fill,
    hold,
    keep_row,
    size_of_spin,
)
from hybrid.kernels.state.report import (
    ASSEMBLED,
    AXIAL_LAW,
    MOMENT_A,
    MOMENT_B,
    RESIDUAL,
    RESIDUAL_NODE,
    ROTARY,
    STIFFNESS_DAMPING,
)


@inner
def is_bent(line, c):
    """Whether cell c has a spin or an element at one of its nodes."""
    return line.element[c] != 0 or line.element[c + 1] != 0 or line.spin[c] != 0


@inner
def catenary_cell(line, state, c, gaps):
    """Chord, force, its derivative by the chord, and the law of length of a cell without bending."""
    e = get3(state.e, c)
    d, l, il = chord(e)
    f, N = pull(d, il, state.T[c])
    _, hck, gap = stretch(e, d, l, line.h[c], line.ck[c], state.T[c])
    if gaps.shape[0] > 0 and hck == 0.0:
        gap = gaps[c]
    return Chord(d, l, il), f, N, hck, gap


@inner
def march_catenaries(line, sea, r, state, i, cv, ca, work, kept, next_kept):
    """Assemble and eliminate the block rows from node i on as long as the cells on both sides are catenaries.

    Returns the next node or, of a block that was singular, that node and False; and what `march` goes on with: force,
    derivative and law of length of the cell before.
    """
    u, X, report, gaps, rates = work.u, work.X, work.report, work.gaps, Rates(cv, ca)
    worst, where = report[RESIDUAL], report[RESIDUAL_NODE]
    before, f, N, hck, gap = catenary_cell(line, state, i - 1, gaps)
    good, n = True, line.h.shape[0]
    while good and i < n and not is_bent(line, i):
        after, fa, Na, hcka, gapa = catenary_cell(line, state, i, gaps)
        F, D, GL, GR = node_loads(line, sea, i, r, u, state, before, after, rates, report)
        F = add(F, sub(fa, f))
        G1, G2 = msub(GL, N), madd(Na, GR)
        D = madd(msub(G1, G2), D)
        big = max(abs(F[0]), abs(F[1]), abs(F[2]))
        if not big <= worst:
            worst, where = big, float(i)
        size = abs(D[0]) + abs(D[4]) + abs(D[8])  # lengths in the unit of the balance, as in `balance`
        if not size > 0.0:
            size = 1.0
        at = (i - 1) * ROW  # a view from the block before on: numba need not ask whether indices are negative
        length = Length(scale(size, before.d), size * hck, size * gap)
        node = NarrowBalance(scale(-1.0, before.d), mscale(-1.0, G1), D, after.d, G2, scale(-1.0, F))
        good = eliminate_narrow(length, node, X[at:], 1, kept - at if kept > 0 else 0, size)
        if good:
            i += 1
            kept += next_kept
            before, f, N, hck, gap = after, fa, Na, hcka, gapa
    report[RESIDUAL], report[RESIDUAL_NODE] = worst, where
    return i, good, Force(f, Z9, Z3, N, Z3, Z9, Z3, before.d, hck, gap)


@kernel
def march(line, sea, ends, r, state, cv, ca, work):
    """Assemble and eliminate all block rows for the configuration given.

    Everything belongs to the end of the step.  work.u is the displacement since its start, r (N+1, 3) the position
    then; state.r is not read.  Returns -1, or the node whose block was singular.  work.rows with N+1 entries receives
    every block row before elimination (for tests and independent solvers); with one that of a held start, which is then
    its balance.  An X with room for more keeps the factors for another right-hand side, and one with room for the
    factors of one block those of the last (kernels.algebra.block_elimination).
    """
    n = line.h.shape[0]
    W, X, report, rows = work.W, work.X, work.report, work.rows
    keeps_start, keeps_rows = rows.shape[0] == 1, rows.shape[0] > 1
    kept, next_kept, last_kept, room = 0, 0, 0, X.shape[0] - (n + 1) * ROW
    known = work.torsion.known
    if room == KEPT:
        last_kept = (n + 1) * ROW
    elif room > 0 and (known.shape[0] == 0 or known[2] + known[3] > 0.0):
        kept, next_kept = (n + 1) * ROW, KEPT
    for j in range(ASSEMBLED):
        report[j] = 0.0
    report[RESIDUAL_NODE] = -1.0

    cell_before = Cell(Chord(Z3, 0.0, 0.0), Z3, Z3, Z9, Z9)
    force_before = Force(Z3, Z9, Z3, Z9, Z3, Z9, Z3, Z3, -1.0, 0.0)  # there is no cell before the start: dT = 0
    bent_before = False
    cell = cell_at(line, ends, state, 0, cv)
    couple, rates = work.couple, Rates(cv, ca)
    here = element_at_start(line, ends, state, cell, cv, couple, report)
    report[MOMENT_A], report[MOMENT_A + 1], report[MOMENT_A + 2] = here.M
    report[MOMENT_B], report[MOMENT_B + 1], report[MOMENT_B + 2] = get3(ends.moment, 1)  # unless an element is there
    simple = rows.shape[0] == 0 and couple.shape[0] == 0 and not line.bits & (STIFFNESS_DAMPING | AXIAL_LAW)
    i = 0
    while i <= n:
        if simple and 0 < i < n and not bent_before and not is_bent(line, i):
            first = i
            i, good, force_before = march_catenaries(line, sea, r, state, i, cv, ca, work, kept, next_kept)
            if not good:
                return i
            kept += (i - first) * next_kept
            cell_before, cell = cell_at(line, ends, state, i - 1, cv), cell_at(line, ends, state, i, cv)
            here = Element(Z3, Z9, Z3, Z9, Z3)
        following = cell_at(line, ends, state, i + 1, cv)
        there = element_after(line, ends, state, i, cell, following, cv, couple, report)
        bent = i < n and is_bent(line, i)
        force = cell_force(line, state, i, cell, here, there, bent, rates, work)
        before, after = LoadedCell(cell_before, force_before), LoadedCell(cell, force)
        node = balance(line, sea, ends, r, state, i, before, after, rates, work)
        wide = bent or bent_before
        if wide or keeps_rows or (keeps_start and i == 0):
            fill(line, state, i, node, before, after, here, there, ca, work)
            if keeps_start and i == 0:
                keep_row(rows, 0, W)
            if node.held:
                hold(W, size_of_spin(line, i, cell, here, there, ca), node.gap[0], node.gap[1], node.gap[2])
            if keeps_rows:
                keep_row(rows, i, W)
        if i == n:
            kept += last_kept
        if not eliminate(W, X, i, kept, node, cell_before, cell, force_before, wide, couple.shape[0] > 0):
            return i
        if i == n - 1:
            report[MOMENT_B], report[MOMENT_B + 1], report[MOMENT_B + 2] = there.M
        kept += next_kept
        cell_before, force_before, bent_before = cell, force, bent
        cell, here = following, there
        i += 1
    return -1


@inner
def carry_director(plane, space, a, e, en):
    """Director a of a cell whose chord turns from e to en, without spin about it."""
    out = a
    if space is not None:
        d, _, _ = chord(e)
        dn, _, _ = chord(en)
        out = transport(a, d, dn)
    if plane is not None:
        p, _, _ = chord2(vector_in_plane(plane, e))
        q, _, _ = chord2(vector_in_plane(plane, en))
        out = carried(plane, a, p, q)
    return out


@inner
def measure(e, T, x):
    """Size of a Newton correction x, and the largest tension.

    Largest shift, largest turn of a chord or spin and its cell, largest change of tension.
    """
    n = e.shape[0]
    shift, turn, pull, big, where = 0.0, 0.0, 0.0, 0.0, -1
    for i in range(n + 1):
        shift = max(shift, abs(x[i, 1]) + abs(x[i, 2]) + abs(x[i, 3]))
        pull = max(pull, abs(x[i, 0]))
        if i < n:
            de = (x[i + 1, 1] - x[i, 1], x[i + 1, 2] - x[i, 2], x[i + 1, 3] - x[i, 3])
            ei = (e[i, 0], e[i, 1], e[i, 2])
            t = max(math.sqrt(dot(de, de) / dot(ei, ei)), abs(x[i, 4]))
            big = max(big, abs(T[i]))
            if t > turn:
                turn, where = t, i
    return shift, turn, where, pull, big


@inner
def turned_chord(e, de):
    """The chord e turned and stretched by de: the same as e + de to first order, but no turn stretches it."""
    d, l, il = chord(e)
    along = dot(d, de)
    across = (de[0] - along * d[0], de[1] - along * d[1], de[2] - along * d[2])
    q = math.sqrt(dot(across, across))
    if not q > 0.0:
        return (e[0] + de[0], e[1] + de[1], e[2] + de[2])
    c, s = (l + along) * math.cos(q * il), (l + along) * math.sin(q * il) / q
    return (c * d[0] + s * across[0], c * d[1] + s * across[1], c * d[2] + s * across[2])


@kernel
def update(plane, space, line, state, cv, ca, part, turning, work):
    """Apply `part` of the correction work.x to everything that depends on it.

    With `turning` chords are turned and stretched by the correction instead of shifted:
    the same to first order, but a large turn does not stretch the line.  Positions then
    follow from the start along the chords, and a held end is met again by the next correction.
    """
    u, x, e, a1 = work.u, work.x, state.e, state.a1
    n = e.shape[0]
    drift = (0.0, 0.0, 0.0)
    for i in range(n):
        ei = get3(e, i)
        de = (part * (x[i + 1, 1] - x[i, 1]), part * (x[i + 1, 2] - x[i, 2]), part * (x[i + 1, 3] - x[i, 3]))
        en = (ei[0] + de[0], ei[1] + de[1], ei[2] + de[2])
        if turning:
            turned = turned_chord(ei, de)
            drift = (drift[0] + turned[0] - en[0], drift[1] + turned[1] - en[1], drift[2] + turned[2] - en[2])
            en = turned
            u[i + 1, 0] += drift[0]
            u[i + 1, 1] += drift[1]
            u[i + 1, 2] += drift[2]
        state.T[i] += part * x[i + 1, 0]
        e[i, 0], e[i, 1], e[i, 2] = en
        if line.spin[i]:
            a = carry_director(plane, space, get3(a1, i), ei, en)
            if space is not None:
                dpsi = part * x[i, 4]
                if dpsi != 0.0:
                    dn, _, _ = chord(en)
                    a = spin_about(a, dn, dpsi)
                state.w[i] += cv * dpsi
                state.wd[i] += ca * dpsi
            a1[i, 0], a1[i, 1], a1[i, 2] = a
    for i in range(n + 1):
        for k in range(3):
            dr = part * x[i, k + 1]
            u[i, k] += dr
            state.v[i, k] += cv * dr
            state.vd[i, k] += ca * dr


@inner
def first_bad(x, e):
    """The first cell that is not finite: its chord, or else its correction (substitution goes backwards)."""
    for i in range(e.shape[0]):
        if not abs(e[i, 0]) + abs(e[i, 1]) + abs(e[i, 2]) < math.inf:
            return i
    for i in range(x.shape[0] - 1, -1, -1):
        if not abs(x[i, 0]) + abs(x[i, 1]) + abs(x[i, 2]) + abs(x[i, 3]) + abs(x[i, 4]) < math.inf:
            return i
    return -1


@inner
def catenaries_left_over(line, sea, r, state, i, cv, ca, work, b):
    """Fill b from node i on as long as the cells on both sides are catenaries; the next node, and the force before it."""
    u, report, gaps, n, rates = work.u, work.report, work.gaps, line.h.shape[0], Rates(cv, ca)
    before, f, N, hck, gap = catenary_cell(line, state, i - 1, gaps)
    while i < n and not is_bent(line, i):
        after, fa, Na, hcka, gapa = catenary_cell(line, state, i, gaps)
        F, _, _, _ = node_loads(line, sea, i, r, u, state, before, after, rates, report)
        F = add(F, sub(fa, f))
        b[i, 0], b[i, 1], b[i, 2], b[i, 3], b[i, 4] = gap, -F[0], -F[1], -F[2], 0.0
        before, f, N, hck, gap = after, fa, Na, hcka, gapa
        i += 1
    return i, Force(f, Z9, Z3, N, Z3, Z9, Z3, before.d, hck, gap)


@called
def left_over_in_space(line, sea, ends, r, state, cv, ca, work, b):
    """Fill b (N+1, 5), a right-hand side of `kept_factors.solve_again`; of a held node it is nothing.

    The rest as of `kernels.march.march.march`, and the report as from there.  No torque passes through catenary zones.
    """
    n = line.h.shape[0]
    report, couple, rates = work.report, work.couple, Rates(cv, ca)
    for j in range(ASSEMBLED):
        report[j] = 0.0
    report[RESIDUAL_NODE] = -1.0
    cell_before = Cell(Chord(Z3, 0.0, 0.0), Z3, Z3, Z9, Z9)
    force_before = Force(Z3, Z9, Z3, Z9, Z3, Z9, Z3, Z3, -1.0, 0.0)
    cell = cell_at(line, ends, state, 0, cv)
    here = element_at_start(line, ends, state, cell, cv, couple, report)
    report[MOMENT_A], report[MOMENT_A + 1], report[MOMENT_A + 2] = here.M
    report[MOMENT_B], report[MOMENT_B + 1], report[MOMENT_B + 2] = get3(ends.moment, 1)
    bent_before, i = False, 0
    simple = couple.shape[0] == 0 and not line.bits & (STIFFNESS_DAMPING | AXIAL_LAW)
    while i <= n:
        if simple and 0 < i < n and not bent_before and not is_bent(line, i):
            i, force_before = catenaries_left_over(line, sea, r, state, i, cv, ca, work, b)
            cell_before, cell = cell_at(line, ends, state, i - 1, cv), cell_at(line, ends, state, i, cv)
            here = Element(Z3, Z9, Z3, Z9, Z3)
        following = cell_at(line, ends, state, i + 1, cv)
        there = element_after(line, ends, state, i, cell, following, cv, couple, report)
        bent = i < n and is_bent(line, i)
        force = cell_force(line, state, i, cell, here, there, bent, rates, work)
        before, after = LoadedCell(cell_before, force_before), LoadedCell(cell, force)
        node = balance(line, sea, ends, r, state, i, before, after, rates, work)
        b[i, 0], b[i, 1], b[i, 2], b[i, 3], b[i, 4] = force_before.gap, 0.0, 0.0, 0.0, 0.0
        if not node.held:
            b[i, 1], b[i, 2], b[i, 3] = node.rhs
        if i < n and line.spin[i]:
            left = dot(cell.chord.d, sub(there.M, here.M))
            if line.bits & ROTARY:
                left -= line.polar[i] * state.wd[i]
            b[i, 4] = -left
        if i == n - 1:
            report[MOMENT_B], report[MOMENT_B + 1], report[MOMENT_B + 2] = there.M
        cell_before, force_before, bent_before = cell, force, bent
        cell, here = following, there
        i += 1
