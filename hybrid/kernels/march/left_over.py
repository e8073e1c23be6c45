"""What the equations of a configuration in space leave over, without their derivatives and their elimination.

The same functions as in kernels.march.march: what only derivatives need is not compiled.
"""

from __future__ import annotations

from hybrid.kernels.algebra.rotations import add, dot, get3, sub
from hybrid.kernels.laws.cell import Chord, Rates
from hybrid.kernels.laws.node_forces import Z3, Z9, node_loads
from hybrid.kernels.machine.compile import called, inner
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
)
from hybrid.kernels.march.march import catenary_cell, is_bent
from hybrid.kernels.state.report import (
    ASSEMBLED,
    AXIAL_LAW,
    MOMENT_A,
    MOMENT_B,
    RESIDUAL_NODE,
    ROTARY,
    STIFFNESS_DAMPING,
)


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
