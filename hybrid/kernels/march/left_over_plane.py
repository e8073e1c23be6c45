"""What the equations of a configuration in a plane leave over (kernels.march.left_over)."""

from __future__ import annotations

from hybrid.kernels.algebra.plane import to_space
from hybrid.kernels.laws.cell import Chord, Rates
from hybrid.kernels.machine.compile import called
from hybrid.kernels.march.assembly_plane import (
    Z2,
    Z4,
    Cell,
    Force,
    LoadedCell,
    balance,
    cell_at,
    cell_force,
    element_after,
    element_at_start,
)
from hybrid.kernels.state.report import ASSEMBLED, MOMENT_A, MOMENT_B, RESIDUAL_NODE


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
