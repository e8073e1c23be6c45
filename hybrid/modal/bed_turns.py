"""How the force of a bed of depths answers to the turning of its normal, which the block rows leave out.

A node is pushed by  F = N(p_0, p_1, ..) n  with depths p of the nodes beside it and the normal n at its place.  Block
rows know  dp = -n . dr  alone; here is the rest (docs/theory.md, 4),

    N dn/dr dr + n sum dN/dp_j (p_j - o/2)/n_z dn_z/dr_j dr_j,

of size N times the curvature of the bed: it is all that holds a line in a trough.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.laws.seabed import normal_forces
from hybrid.kernels.state.forces import SEABED
from hybrid.kernels.state.state import Floats, Line, Sea

# Shift of nodes, of the length, by which the force is differentiated.
SHIFT = 1e-8
COLOURS = 3  # a node presses by its own depth and those beside it: every third moves at once


def bed_turns(line: Line, sea: Sea, r: Floats) -> sparse.csr_array | None:
    """(5 (N+1), 5 (N+1)) stiffness, N/m, of the turning of the bed under nodes r (N+1, 3); None: it is a plane."""
    if not line.bits & SEABED or not sea.bed_x.size:
        return None
    n, p = planes_under(sea, r)
    level = sea._replace(bed_x=sea.bed_x[:0], normal=np.array([0.0, 0.0, 1.0]), offset=0.0)

    def pushes(normals: Floats, depths: Floats) -> Floats:
        out = np.zeros(len(r))
        under = np.column_stack([np.zeros((len(r), 2)), 0.5 * sea.onset - depths])  # as deep in a level bed
        normal_forces(line, level, under, out)
        return out[:, None] * normals

    node, step = np.arange(len(r)), SHIFT * float(line.s[-1])
    entries: list[tuple[Floats, np.ndarray, np.ndarray]] = []
    for colour in range(COLOURS):
        moved = node + (colour - node + 1) % COLOURS - 1
        known = (moved >= 0) & (moved < len(r))
        for axis in range(3):
            shift, change = np.zeros_like(r), np.zeros_like(r)
            shift[colour::COLOURS, axis] = step
            for sign in (1.0, -1.0):
                there = pushes(*planes_under(sea, r + sign * shift))
                change += sign * (there - pushes(n, p - sign * (n * shift).sum(axis=1)))
            for k in range(3):
                rows, columns = SIZE * node[known] + 1 + k, SIZE * moved[known] + 1 + axis
                entries.append((-change[known, k] / (2.0 * step), rows, columns))
    values, rows, columns = (np.concatenate(x) for x in zip(*entries, strict=True))
    size, here = SIZE * len(r), values != 0.0
    return sparse.csr_array((values[here], (rows[here], columns[here])), shape=(size, size))
