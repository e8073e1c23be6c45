"""The march along s, its corrections, and what equations leave over.

Each block row is eliminated as soon as it is made (docs/theory.md, 5).  Nodes between two catenary cells, which are
most of them, take a loop of their own: what the other nodes carry along for bending, some 150 numbers, would be most of
what they cost.  They are assembled LANES at a time, in loops of vector instructions, because no node needs what another one
has found: most of what a catenary line costs is the assembly of its balances.  Laws are those of a node by itself
(kernels.laws.node_forces); contact and vortices are added node by node, and nodes with a body or with a cell that passes
through the surface are assembled so.  Work.lanes holds rows of LANES numbers: one array and constant places, by which
the compiler sees that no row is another.  Tensions of cells that are soft enough are eliminated before the
march, but for equilibria: lines that are slack were refused there (two of 116 random networks).

A correction changes positions, chords, tensions, directors and rates.  `plane` is the plane of a line that is computed
in one, else None; `space` is None for such a line, else 1.  numba drops what stands behind `is not None` of the one
that is None, so what the other kind needs is not compiled.

What equations leave over is made by the same functions: what only derivatives need is not compiled.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.block_elimination import (
    KEPT,
    ROW,
    Condensed,
    Length,
    NarrowBalance,
    answer_of_node,
    eliminate_condensed,
    eliminate_narrow,
)
from hybrid.kernels.algebra.plane import carried, chord2, vector_in_plane
from hybrid.kernels.algebra.rotations import (
    add,
    dot,
    get3,
    madd,
    mat_vec,
    mscale,
    msub,
    outer,
    scale,
    spin_about,
    sub,
    transport,
)
from hybrid.kernels.laws.element import Chord, Rates, chord, pull, stretch
from hybrid.kernels.laws.node_forces import (
    TOUCHING,
    Z3,
    Z9,
    node_loads,
    touching_loads,
    water_at,
    weight_and_inertia,
)
from hybrid.kernels.laws.water import half_cell_added_mass, half_cell_drag
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
    ADDED_MASS,
    ADDED_MASS_POWER,
    ASSEMBLED,
    AXIAL_LAW,
    BENDING_LAW,
    BENDING_SLIP,
    BODIES,
    BREAKOUT,
    DRAG,
    DRAG_POWER,
    FLOW,
    FRICTION,
    MASS_DAMPING,
    MAY_MEET,
    MAY_TOUCH,
    MOMENT_A,
    MOMENT_B,
    RESIDUAL,
    RESIDUAL_NODE,
    ROTARY,
    SELF_CONTACT,
    SELF_FRICTION,
    SOIL,
    STIFFNESS_DAMPING,
    SURFACE,
    WAVE_POWER,
    WAVES,
)

AT_REST = 1e30  # 1/s2, ca of a solve for accelerations is larger (solve.stepper.HEAVY), and cv is 0 there as at rest
LANES = 8  # nodes that are assembled at a time: two vectors of four float64
# What the line may have: forces with a place here, and what is no force on such a node.  All else is assembled by node.
FORCES = DRAG | ADDED_MASS | SURFACE | WAVES | BODIES | FLOW | MASS_DAMPING | TOUCHING | SOIL
NO_FORCES = FRICTION | BREAKOUT | ROTARY | BENDING_LAW | BENDING_SLIP
KNOWN = FORCES | NO_FORCES | SELF_CONTACT | SELF_FRICTION | MAY_TOUCH | MAY_MEET
# Rows of Work.lanes.  In, of each cell beside the node, from BEFORE or AFTER on:
BEFORE = 0
AFTER = 10
CHORD = 0  # 3
TENSION = 3
LENGTH = 4
COMPLIANCE = 5
DRAG_N = 6  # of half the cell, as added mass
DRAG_T = 7
ADDED_N = 8
ADDED_T = 9
# of the node:
VELOCITY = 20  # 3
RELATIVE = 23  # 3, to the water
CARRIED = 26  # 3, acceleration relative to the water
SLOPE = 29  # 3, of the current over height
FORCE = 32  # 3, on the node but for cells and the water on them,
DIAGONAL = 35  # and its derivative by the position
# Out: of the node,
BALANCE = 36  # 3
BY_BEFORE = 39  # 9, its derivatives by the chords beside it
BY_AFTER = 48  # 9
BY_PLACE = 57  # 9, and by its position, but for what chords make of that
POWERS = 66  # 2, of drag and of added mass
# of the cell after it,
DIRECTION = 68  # 3
GAP = 71
# and with tensions eliminated (`condense`):
STIFF_BEFORE = 72  # stiffness of the cells beside the node, N/m; 0 where their tension stays an unknown
STIFF_AFTER = 73
BY_NODE_BEFORE = 74  # 9, derivatives by the nodes beside it
BY_NODE_AFTER = 83  # 9
CONDENSED = 92  # 3, its balance with what the gap of the cell after it makes of the tension there
DIRECTION_BEFORE = 95  # 3
ROWS = 98
# The softest that a node may be, as a part of the stiffness of a cell beside it, with whose tension eliminated its
# transverse stiffness loses digits.
SOFTEST = 1e-7


@inner
def number(lanes, row, l):
    return lanes[row * LANES + l]


@inner
def vector3(lanes, row, l):
    return lanes[row * LANES + l], lanes[(row + 1) * LANES + l], lanes[(row + 2) * LANES + l]


@inner
def matrix9(lanes, row, l):
    a, b, c = vector3(lanes, row, l), vector3(lanes, row + 3, l), vector3(lanes, row + 6, l)
    return a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]


@inner
def put(lanes, row, l, x):
    lanes[row * LANES + l] = x


@inner
def put3(lanes, row, l, a):
    lanes[row * LANES + l], lanes[(row + 1) * LANES + l], lanes[(row + 2) * LANES + l] = a


@inner
def put9(lanes, row, l, A):
    put3(lanes, row, l, (A[0], A[1], A[2]))
    put3(lanes, row + 3, l, (A[3], A[4], A[5]))
    put3(lanes, row + 6, l, (A[6], A[7], A[8]))


@inner
def wet_part(line, c, side, z, eta, rise):
    """1 where half cell c before (side -1) or after (+1) a node is under water, 0 where above, 0.5 where neither.

    rise: height of the end of the cell over its start.
    """
    iD = 1.0 / line.diameter[c]
    xa = (eta - z) * iD + 0.5
    xb = xa - side * 0.5 * rise * iD
    if xa >= 1.0 and xb >= 1.0:
        return 1.0
    return 0.0 if xa <= 0.0 and xb <= 0.0 else 0.5


@inner
def put_cell(line, state, lanes, l, o, c, wet):
    """What is needed of cell c beside the node in lane l, in rows from o on."""
    put3(lanes, o + CHORD, l, get3(state.e, c))
    put(lanes, o + TENSION, l, state.T[c])
    put(lanes, o + LENGTH, l, line.h[c])
    put(lanes, o + COMPLIANCE, l, line.ck[c])
    drag_n, drag_t, added_n, added_t = 0.0, 0.0, 0.0, 0.0
    if line.bits & DRAG:
        drag_n, drag_t = wet * line.drag_n[c], wet * line.drag_t[c]
    if line.bits & ADDED_MASS:
        added_n, added_t = wet * line.added_n[c], wet * line.added_t[c]
    put(lanes, o + DRAG_N, l, drag_n)
    put(lanes, o + DRAG_T, l, drag_t)
    put(lanes, o + ADDED_N, l, added_n)
    put(lanes, o + ADDED_T, l, added_t)


@inner
def put_node(line, sea, state, lanes, l, i, z, rates, report):
    """What is needed of node i at height z, in lane l; False: it is assembled by itself, and nothing is reported of it."""
    bits, vi, vdi = line.bits, get3(state.v, i), get3(state.vd, i)
    water = water_at(line, sea, i, z, vi, vdi)
    before, after = 1.0, 1.0
    if bits & SURFACE:
        before = wet_part(line, i - 1, -1.0, z, water.eta, state.e[i - 1, 2])
        after = wet_part(line, i, 1.0, z, water.eta, state.e[i, 2])
        if before == 0.5 or after == 0.5:
            return False
    if bits & BODIES:
        if line.point_drag[i] != 0.0 or line.point_added[i] != 0.0:
            return False
        if (bits & WAVES and line.point_displaced[i] != 0.0) or (bits & SURFACE and line.point_height[i] > 0.0):
            return False
    F, c = weight_and_inertia(line, i, vi, vdi, rates, report)
    pushed = (0.0, 0.0, 0.0)
    if bits & WAVES:
        pushed = scale(before * line.displaced[i - 1] + after * line.displaced[i], water.af)
    if bits & SURFACE:
        pushed = (pushed[0], pushed[1], pushed[2] + (before * line.buoy[i - 1] + after * line.buoy[i]))
    report[WAVE_POWER] += dot(pushed, vi)
    put_cell(line, state, lanes, l, BEFORE, i - 1, before)
    put_cell(line, state, lanes, l, AFTER, i, after)
    put3(lanes, VELOCITY, l, vi)
    put3(lanes, RELATIVE, l, water.u)
    put3(lanes, CARRIED, l, water.b)
    put3(lanes, SLOPE, l, water.U1)
    put3(lanes, FORCE, l, add(F, pushed))
    put(lanes, DIAGONAL, l, c)
    return True


@inner
def half_cell(lanes, l, o, rates):
    """Water and tension of a half cell: water's f, D and L, pull and its derivative, powers of drag and added mass."""
    cv, ca = rates
    v, U1 = vector3(lanes, VELOCITY, l), vector3(lanes, SLOPE, l)
    u, b = vector3(lanes, RELATIVE, l), vector3(lanes, CARRIED, l)
    d, _, il = chord(vector3(lanes, o + CHORD, l))
    f, B, L = half_cell_drag(u, d, il, number(lanes, o + DRAG_N, l), number(lanes, o + DRAG_T, l))
    D, s = mscale(cv, B), mat_vec(B, U1)
    D = (D[0], D[1], D[2] - s[0], D[3], D[4], D[5] - s[1], D[6], D[7], D[8] - s[2])
    g, Dg, Lg = half_cell_added_mass(b, d, il, number(lanes, o + ADDED_N, l), number(lanes, o + ADDED_T, l), ca)
    n, N = pull(d, il, number(lanes, o + TENSION, l))
    return add(f, g), madd(D, Dg), madd(L, Lg), n, N, dot(f, v), dot(g, v)


@inner
def assemble_lanes(lanes, rates):
    """The balances of LANES nodes from what stands in their lanes."""
    for l in range(LANES):
        fa, Da, GL, na, Na, drag_a, added_a = half_cell(lanes, l, BEFORE, rates)
        fb, Db, GR, nb, Nb, drag_b, added_b = half_cell(lanes, l, AFTER, rates)
        before, after, c = msub(GL, Na), madd(Nb, GR), number(lanes, DIAGONAL, l)
        A = madd(Da, Db)
        e = vector3(lanes, AFTER + CHORD, l)
        d, length, _ = chord(e)
        h, ck = number(lanes, AFTER + LENGTH, l), number(lanes, AFTER + COMPLIANCE, l)
        _, _, gap = stretch(e, d, length, h, ck, number(lanes, AFTER + TENSION, l))
        put3(lanes, BALANCE, l, add(vector3(lanes, FORCE, l), add(add(fa, fb), sub(nb, na))))
        put9(lanes, BY_BEFORE, l, before)
        put9(lanes, BY_AFTER, l, after)
        put9(lanes, BY_PLACE, l, (A[0] + c, A[1], A[2], A[3], A[4] + c, A[5], A[6], A[7], A[8] + c))
        before_d, _, _ = chord(vector3(lanes, BEFORE + CHORD, l))
        put3(lanes, DIRECTION_BEFORE, l, before_d)
        put3(lanes, DIRECTION, l, d)
        put(lanes, GAP, l, gap)
        put(lanes, POWERS, l, drag_a + drag_b)
        put(lanes, POWERS + 1, l, added_a + added_b)


@inner
def add_loads(lanes, l, F, D, GL, GR):
    """Add other loads and their derivatives to the balance in a lane."""
    put3(lanes, BALANCE, l, add(vector3(lanes, BALANCE, l), F))
    put9(lanes, BY_BEFORE, l, madd(matrix9(lanes, BY_BEFORE, l), GL))
    put9(lanes, BY_AFTER, l, madd(matrix9(lanes, BY_AFTER, l), GR))
    put9(lanes, BY_PLACE, l, madd(matrix9(lanes, BY_PLACE, l), D))


@inner
def chord_at(state, c):
    d, l, il = chord(get3(state.e, c))
    return Chord(d, l, il)


@inner
def assemble_node(line, sea, r, state, i, l, rates, work):
    """The balance of a node by itself, in lane l."""
    lanes = work.lanes
    before, after = chord_at(state, i - 1), chord_at(state, i)
    na, Na = pull(before.d, before.il, state.T[i - 1])
    nb, Nb = pull(after.d, after.il, state.T[i])
    F, D, GL, GR = node_loads(line, sea, i, r, work.u, state, before, after, rates, work.report)
    put_cell(line, state, lanes, l, BEFORE, i - 1, 0.0)
    put_cell(line, state, lanes, l, AFTER, i, 0.0)
    put3(lanes, BALANCE, l, sub(nb, na))
    put9(lanes, BY_BEFORE, l, mscale(-1.0, Na))
    put9(lanes, BY_AFTER, l, Nb)
    put9(lanes, BY_PLACE, l, Z9)
    add_loads(lanes, l, F, D, GL, GR)
    _, _, gap = stretch(get3(state.e, i), after.d, after.l, line.h[i], line.ck[i], state.T[i])
    put3(lanes, DIRECTION_BEFORE, l, before.d)
    put3(lanes, DIRECTION, l, after.d)
    put(lanes, GAP, l, gap)


@inner
def stiffness_beside(lanes, l, o, size):
    """Stiffness of a cell beside a node of a size, 0 where its tension stays an unknown."""
    hck = number(lanes, o + LENGTH, l) * number(lanes, o + COMPLIANCE, l)
    return 1.0 / hck if size * hck >= SOFTEST else 0.0


@inner
def condense(lanes):
    """Put dT = (d.de - gap)/hck for the tensions of the cells beside each node, where these are soft enough."""
    for l in range(LANES):
        G1, G2, F = matrix9(lanes, BY_BEFORE, l), matrix9(lanes, BY_AFTER, l), vector3(lanes, BALANCE, l)
        D = madd(msub(G1, G2), matrix9(lanes, BY_PLACE, l))
        size = abs(D[0]) + abs(D[4]) + abs(D[8])
        da, ka = vector3(lanes, DIRECTION_BEFORE, l), stiffness_beside(lanes, l, BEFORE, size)
        db, kb = vector3(lanes, DIRECTION, l), stiffness_beside(lanes, l, AFTER, size)
        put(lanes, STIFF_BEFORE, l, ka)
        put(lanes, STIFF_AFTER, l, kb)
        put9(lanes, BY_NODE_BEFORE, l, msub(outer(scale(ka, da), da), G1))
        put9(lanes, BY_NODE_AFTER, l, madd(outer(scale(kb, db), db), G2))
        put3(lanes, CONDENSED, l, sub(F, scale(kb * number(lanes, GAP, l), db)))


@called
def assemble_catenaries(line, sea, r, state, first, beyond, cv, ca, work):
    """The balances of nodes from `first` on into Work.lanes, of LANES or those before `beyond`: between catenaries."""
    u, lanes, report, rates = work.u, work.lanes, work.report, Rates(cv, ca)
    count, apart = min(LANES, beyond - first), 0
    for l in range(count):
        i = first + l
        if line.bits & ~KNOWN != 0 or not put_node(line, sea, state, lanes, l, i, r[i, 2] + u[i, 2], rates, report):
            apart |= 1 << l
    assemble_lanes(lanes, rates)
    for l in range(count):
        i = first + l
        if apart >> l & 1:
            assemble_node(line, sea, r, state, i, l, rates, work)
            continue
        report[DRAG_POWER] -= number(lanes, POWERS, l)
        report[ADDED_MASS_POWER] -= number(lanes, POWERS + 1, l)
        if line.bits & TOUCHING:
            before, after = chord_at(state, i - 1), chord_at(state, i)
            touches, F, D, GL, GR = touching_loads(line, sea, i, r, u, state, before, after, cv, report)
            if touches:
                add_loads(lanes, l, F, D, GL, GR)
    condense(lanes)


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
def eliminate_lane(lanes, l, length, stiff_after, X, kept):
    """Eliminate the block row of the node in lane l with the tension of the cell before it, of a `Length`, an unknown.

    stiff_after: as of the cell after it, 0: its tension is an unknown too; X: from the block before on; kept: as there.
    """
    row, hck, gap = length
    G1, G2, F, ahead = matrix9(lanes, BY_BEFORE, l), matrix9(lanes, BY_AFTER, l), vector3(lanes, BALANCE, l), Z3
    D = madd(msub(G1, G2), matrix9(lanes, BY_PLACE, l))
    size = abs(D[0]) + abs(D[4]) + abs(D[8])  # lengths in the unit of the balance, as in `balance`
    if not size > 0.0:
        size = 1.0
    if stiff_after > 0.0:
        G2, F = matrix9(lanes, BY_NODE_AFTER, l), vector3(lanes, CONDENSED, l)
        D = madd(msub(G1, G2), matrix9(lanes, BY_PLACE, l))
    else:
        ahead = vector3(lanes, DIRECTION, l)
    node = NarrowBalance(scale(-1.0, row), mscale(-1.0, G1), D, ahead, G2, scale(-1.0, F))
    return eliminate_narrow(Length(scale(size, row), size * hck, size * gap), node, X, 1, kept, size)


@inner
def march_catenaries(line, sea, r, state, i, cv, ca, work, kept, next_kept):
    """Assemble and eliminate the block rows from node i on as long as the cells on both sides are catenaries.

    Returns the next node or, of a block that was singular, that node and False; and what `march` goes on with: force,
    derivative and law of length of the cell before.
    """
    X, report, gaps, lanes, n = work.X, work.report, work.gaps, work.lanes, line.h.shape[0]
    worst, where = report[RESIDUAL], report[RESIDUAL_NODE]
    before, _, _, hck, gap = catenary_cell(line, state, i - 1, gaps)
    d, l, beyond, good, stiff, g, V = before.d, 0, i, True, 0.0, Z3, Z9
    moves = cv > 0.0 or ca >= AT_REST  # at rest all tensions stay unknowns: what is slack hardly resists
    while beyond < n and not is_bent(line, beyond):
        beyond += 1
    while good and i < beyond:
        if l == 0:
            assemble_catenaries(line, sea, r, state, i, beyond, cv, ca, work)
        F = vector3(lanes, BALANCE, l)
        big = max(abs(F[0]), abs(F[1]), abs(F[2]))
        if not big <= worst:
            worst, where = big, float(i)
        at = (i - 1) * ROW  # a view from the block before on: numba need not ask whether indices are negative
        stiff_after = number(lanes, STIFF_AFTER, l) if moves and kept == 0 and i < beyond - 1 else 0.0
        if stiff > 0.0 and stiff_after > 0.0 and number(lanes, STIFF_BEFORE, l) > 0.0:
            L, U, D = matrix9(lanes, BY_NODE_BEFORE, l), matrix9(lanes, BY_NODE_AFTER, l), matrix9(lanes, BY_PLACE, l)
            cell, F = Condensed(d, stiff, gap, V, g), vector3(lanes, CONDENSED, l)
            good, V, g = eliminate_condensed(cell, L, U, D, F, X[at + ROW :])
        else:
            good = eliminate_lane(lanes, l, Length(d, hck, gap), stiff_after, X[at:], kept - at if kept > 0 else 0)
            V, g = answer_of_node(X[at + ROW :])
        if good:
            d, hck, gap = vector3(lanes, DIRECTION, l), line.h[i] * line.ck[i], number(lanes, GAP, l)
            stiff = stiff_after
            if gaps.shape[0] > 0 and hck == 0.0:
                gap = gaps[i]
            i += 1
            kept += next_kept
            l = l + 1 if l < LANES - 1 else 0
    report[RESIDUAL], report[RESIDUAL_NODE] = worst, where
    _, f, N, hck, gap = catenary_cell(line, state, i - 1, gaps)
    return i, good, Force(f, Z9, Z3, N, Z3, Z9, Z3, d, hck, gap)


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
