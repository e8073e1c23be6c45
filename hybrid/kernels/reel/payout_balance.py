"""The forces that balance the nodes around one that has just entered a line at its winch, or left it.

The discrete line is in balance on cells of unequal lengths with places that lie on no smooth curve: where the lengths
of neighbours jump, so do second differences.  A node that is put on the curve through them, or left out, unbalances its
neighbours, which would send waves of bending along the line.  The forces across the line that are missing are put on the
nodes and taken off slowly (paid_length.eased), as the new cells get their lengths (docs/theory.md, 19).
"""

from __future__ import annotations

from hybrid.kernels.algebra.rotations import add, dot, frame, get3, get9, scale, sub
from hybrid.kernels.laws.bending_law import bending_at
from hybrid.kernels.laws.cell import Chord, Rates, chord, moment_force, rotary_force, turning
from hybrid.kernels.laws.node_forces import Z9, node_loads
from hybrid.kernels.machine.compile import called, inner
from hybrid.kernels.reel.paid_length import growing, node
from hybrid.kernels.state.report import ROTARY
from hybrid.kernels.watch.extremes import moment_at

# Nodes before the cell that grows, and behind it, whose elements and cells are others than before; one to spare.
AROUND = 3


@called
def moment_of(line, ends, state, j):
    """Moment at node j: of its element, or what acts on an end."""
    n = line.h.shape[0]
    if 0 < j < n:
        return moment_at(line, state, j)
    k = 0 if j == 0 else 1
    if not line.element[j]:
        return scale(2.0 * k - 1.0, get3(ends.moment, k))
    c = 0 if j == 0 else n - 1
    d, _, _ = chord(get3(state.e, c))
    held, beside = get9(ends.frame, k), frame(get3(state.a1, c), d)
    before, after = (held, beside) if j == 0 else (beside, held)
    M, _ = bending_at(line, j, before, after, get3(line.kb, j), get3(line.k0, j))
    return M


@called
def force_in(line, ends, state, c):
    """Force in cell c."""
    d, _, il = chord(get3(state.e, c))
    f = scale(state.T[c], d)
    if line.element[c] or line.element[c + 1]:
        Q = sub(moment_of(line, ends, state, c + 1), moment_of(line, ends, state, c))
        if line.bits & ROTARY:
            e1 = sub(get3(state.v, c + 1), get3(state.v, c))
            e2 = sub(get3(state.vd, c + 1), get3(state.vd, c))
            d1, D1 = turning(d, il, e1, 0.0)
            Q = sub(Q, scale(line.polar[c] * state.w[c], d1))
            more, _ = rotary_force(d, il, e1, e2, d1, D1, line.rotary[c], 0.0, 0.0)
            f = add(f, more)
        V, _ = moment_force(d, il, Q, Z9)
        f = add(f, V)
    return f


@inner
def find_balance(line, sea, ends, state, reel):
    """The forces that balance the nodes around the cell that grows; those on nodes that ride are on."""
    n, g = line.h.shape[0], growing(line, reel)
    for i in range(n + 1):
        for j in range(3):
            reel.balance[i, j], reel.plain[i, j] = 0.0, 0.0
    for k in range(max(g - AROUND, 1), min(g + AROUND, n - 1) + 1):
        i = node(line, reel, k)
        da, la, ia = chord(get3(state.e, i - 1))
        db, lb, ib = chord(get3(state.e, i))
        before, after = Chord(da, la, ia), Chord(db, lb, ib)
        F, _, _, _ = node_loads(line, sea, i, state.r, reel.plain, state, before, after, Rates(0.0, 0.0), reel.report)
        F = add(F, sub(force_in(line, ends, state, i), force_in(line, ends, state, i - 1)))
        both = add(da, db)
        F = sub(F, scale(dot(F, both) / max(dot(both, both), 1e-300), both))  # tensions balance the rest
        for j in range(3):
            reel.balance[i, j] = -F[j]
