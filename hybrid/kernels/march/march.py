"""The march along s: each block row is eliminated as it is born (docs/theory.md, 5).

Nodes between two catenary cells, which are most of them, take a loop of their own: what the other nodes carry along for
bending, some 150 numbers, would be most of what they cost.
"""

from __future__ import annotations

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, Length, NarrowBalance, eliminate_narrow
from hybrid.kernels.algebra.rotations import add, get3, madd, mscale, msub, scale, sub
from hybrid.kernels.laws.cell import Chord, Rates, chord, pull, stretch
from hybrid.kernels.laws.node_forces import Z3, Z9, node_loads
from hybrid.kernels.machine.compile import inner, kernel
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
