"""Bending on its way in and out: how much of its stiffness every node has, and the energy that a change of it frees.

grown: (n,) of base cells, 0 to 1; leaving: (n,) those on their way out; haste: (n,) times as fast as the others
that some come in.  Times in paces of the manager.
"""

from __future__ import annotations

import math

from hybrid.kernels.laws.bending_law import energy_share
from hybrid.kernels.machine.compile import inner, kernel

# A rod begins with this part of its stiffness: with none its cells could spin freely.
FIRST = 1e-3


@inner
def moved(x, leaving, haste, dt):
    x += -dt if leaving else dt * haste
    return min(max(x, 0.0), 1.0)


@kernel
def advance(grown, leaving, haste, dt):
    """Move all on by dt."""
    for j in range(grown.size):
        grown[j] = moved(grown[j], leaving[j], haste[j], dt)


@kernel
def shares(grown, leaving, haste, dt, base_of_cell, out):
    """Parts of the stiffness (N+1,) of nodes, dt from now: smooth in time, of the softer cell beside a node."""
    n = base_of_cell.size
    before = 1.0
    for i in range(n):
        j = base_of_cell[i]
        x = moved(grown[j], leaving[j], haste[j], dt)
        part = max(x * x * (3.0 - 2.0 * x), FIRST)
        out[i] = min(before, part) if i > 0 else part
        before = part
    out[n] = before


@kernel
def length_defect(lack, rate, since, keeps, t, duration, true, h):
    """Lengths h (N,) m at t of cells on their way to their true ones; whether any is still under way.

    A quintic from value and rate at `since` to rest at nothing, or, where `keeps`, at the value, after `duration`.
    """
    going = False
    for c in range(h.size):
        x = (t - since[c]) / duration
        if x < 1.0:
            going = True
            x = max(x, 0.0)
            y = (1.0 - x) ** 3
            value = 1.0 if keeps[c] else 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
            h[c] = true[c] - lack[c] * value - duration * rate[c] * x * y * (1.0 + 3.0 * x)
        else:
            h[c] = true[c] - (lack[c] if keeps[c] else 0.0)
    return going


@kernel
def soften(part, stiff, kb):
    """Bending in kb (N+1, 3) = part (N+1,) of stiff (N+1, 3); torsion is all there, so that no torque is lost."""
    for i in range(part.size):
        for k in range(2):
            kb[i, k] = part[i] * stiff[i, k]
        kb[i, 2] = stiff[i, 2]


@kernel
def freed(line, part, stiff, before, after):
    """Energy, J, that a step puts in whose stiffness line.kb is not what it was before, `part` of stiff.

    before, after: strains (N+1, 3) rad at the two ends of the step, from what has no stress.
    """
    total = 0.0
    for i in range(part.size):
        x = energy_share(line, i, math.sqrt(before[i, 0] ** 2 + before[i, 1] ** 2))
        y = energy_share(line, i, math.sqrt(after[i, 0] ** 2 + after[i, 1] ** 2))
        for k in range(2):
            more = line.kb[i, k] - part[i] * stiff[i, k]
            total += more * (x * before[i, k] ** 2 + y * after[i, k] ** 2)
    return 0.25 * total
