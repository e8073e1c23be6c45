"""A small push out of the plane of a cable that is computed in a plane, carried along with its motion.

Across the plane a small displacement w of the nodes, and a spin psi of the cells of rods, obey linear equations of
their own, whose coefficients come from the motion in the plane.  They are stepped along with it by the same
generalized-alpha, from a small push, so that whatever makes the plane unstable shows as growth: buckling and lifting
of compressed or twisted rods, whirling and parametric resonance of taut lines.  docs/theory.md, 5.

    symbol   meaning                                                     shape  unit
    w        displacement of a node along the normal n of the plane      -      m
    zeta     tilt of a chord out of the plane, (w_{c+1} - w_c)/l         -      rad
    psi      spin of a cell about its chord                              -      rad
    C        dM = C (dth_b - dth_a) - M J dth_a, J = n x                 4      N m, plane
    dMz, dMp dM of an element by the tilt and by the spin of a cell      2      N m, plane
    was, now w, its rate, algorithmic and true acceleration              N+1, 4 m, s

What only damps or turns sections (stiffness-proportional damping, rotary inertia) is left out, which lets a push
grow rather than fade; so is what a chord's tilt does to its contact with the bed, which lies in the plane.
"""

from __future__ import annotations

from typing import NamedTuple

from hybrid.kernels.algebra.plane import (
    angle_between,
    chord2,
    dot2,
    end_chord,
    row_along_normal,
    row_in_plane,
    stiffness_about_normal,
    vector_in_plane,
)
from hybrid.kernels.algebra.rotations import get3, jacobian_functions
from hybrid.kernels.laws.bending_law import moment_share, slip_about_normal
from hybrid.kernels.laws.seabed import bed_under, left_of, soil_force
from hybrid.kernels.laws.water import body_drag, current_at, half_cell_added_mass, half_cell_drag
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.report import (
    ADDED_MASS,
    BENDING_SLIP,
    BODIES,
    DRAG,
    FLOW,
    FRICTION,
    MASS_DAMPING,
    SEABED,
    SOIL,
    SURFACE,
    WAVES,
)

REACH = 4  # an equation of node i reaches to node i + 2, two unknowns a node
BAND = 2 * REACH + 2  # numbers of an equation: its band and its right-hand side
LEAST_SPIN_STIFFNESS = 1e-9  # part of the torsional stiffness that holds a spin which nothing else does
Z2 = (0.0, 0.0)


class Joint(NamedTuple):
    """The element between two cells: its moment and how that answers to the tilt and spin of the cells."""

    M: float  # N m, about the normal of the plane
    dMz_before: tuple[float, float]
    dMp_before: tuple[float, float]
    dMz_after: tuple[float, float]
    dMp_after: tuple[float, float]
    torsion: float  # N m


class Cell(NamedTuple):
    """Chord of a cell in the plane: direction, 1/length (1/m)."""

    d: tuple[float, float]
    il: float


@inner
def moment_stiffness(kappa, M, out, torsion, d):
    """C (in the plane) and C + M J of an element with bend kappa, moment M, stiffness out of the plane and in torsion.

    d: the chord before it.  P = c I - kappa/2 J, c = kappa/2 cot(kappa/2); C = (D + P^T K) P, D = M (g kappa - J/2).
    """
    g, _ = jacobian_functions(kappa * kappa)
    c, half = 1.0 - g * kappa * kappa, 0.5 * kappa
    # in the axes (m, d) of the cell before
    s0, s1 = M * g * kappa + c * out, -0.5 * M + half * torsion
    s2, s3 = 0.5 * M - half * out, M * g * kappa + c * torsion
    a, b = s0 * c + s1 * half, -s0 * half + s1 * c
    e, f = s2 * c + s3 * half, -s2 * half + s3 * c
    # in those of the plane: m = (-d1, d0)
    x, y = d[0], d[1]
    C = (
        a * y * y - (b + e) * x * y + f * x * x,
        -a * x * y - b * y * y + e * x * x + f * x * y,
        -a * x * y + b * x * x - e * y * y + f * x * y,
        a * x * x + (b + e) * x * y + f * y * y,
    )
    return C, (C[0], C[1] - M, C[2] + M, C[3])


@inner
def mat_vec2(A, x):
    return (A[0] * x[0] + A[1] * x[1], A[2] * x[0] + A[3] * x[1])


@inner
def loads_out_of_plane(line, sea, i, state):
    """Loads on node i across the plane: factors of w, its rate, its acceleration, and of the tilt before and after."""
    bits, plane, e = line.bits, line.plane, state.e
    stiff, rate, inert = 0.0, 0.0, line.mass[i]
    before = after = 0.0
    if bits & MASS_DAMPING:
        rate += line.damp[i]
    if bits & (DRAG | ADDED_MASS | BODIES):
        u, b = row_in_plane(plane, state.v, i), row_in_plane(plane, state.vd, i)
        z, eta = state.r[i, 2], sea.surface
        if bits & FLOW:
            U = vector_in_plane(plane, current_at(sea.z, sea.current, sea.now[1], z)[0])
            u = (u[0] - U[0], u[1] - U[1])
        if bits & WAVES:
            U, A = (
                row_in_plane(plane, sea.flow, i),
                vector_in_plane(plane, (sea.flow[i, 3], sea.flow[i, 4], sea.flow[i, 5])),
            )
            u, b = (u[0] - U[0], u[1] - U[1]), (b[0] - A[0], b[1] - A[1])
            eta += sea.flow[i, 6]
        if not (bits & SURFACE and z > eta):
            # in the axes of the plane: the laws of space, of which what acts along the third axis is taken
            u3, b3 = (u[0], u[1], 0.0), (b[0], b[1], 0.0)
            for side in range(2):
                c = i - 1 + side
                if c < 0 or c >= e.shape[0]:
                    continue
                d, _, _ = chord2(row_in_plane(plane, e, c))
                d3, tilt = (d[0], d[1], 0.0), 0.0
                if bits & DRAG:
                    _, B, L = half_cell_drag(u3, d3, 1.0, line.drag_n[c], line.drag_t[c])
                    rate -= B[8]
                    tilt += L[8]
                if bits & ADDED_MASS:
                    _, D, L = half_cell_added_mass(b3, d3, 1.0, line.added_n[c], line.added_t[c], 1.0)
                    inert -= D[8]
                    tilt += L[8]
                if side == 0:
                    before = tilt
                else:
                    after = tilt
            if bits & BODIES:
                _, B = body_drag(u3, line.point_drag[i])
                rate -= B[8]
                inert += line.point_added[i]
    if bits & SEABED and bits & FRICTION:  # a small push does not slide
        f, n = row_in_plane(plane, sea.bed, i), vector_in_plane(plane, sea.normal)
        presses = max(dot2(f, n), 0.0)
        if bits & SOIL:
            _, p = bed_under(sea, get3(state.r, i))
            _, _, _, most, _, _ = soil_force(line, sea, state.soil, i, p)
        else:
            _, part = left_of(line, sea, state.soil, i)
            most = part * sea.friction[1] * presses
        stiff += most / sea.slip_length
    return stiff, rate, inert, before, after


@inner
def first_joint(line, ends, a1, d):
    """The element at the start, before the chord d."""
    plane = line.plane
    if not line.element[0]:
        return Joint(-row_along_normal(plane, ends.moment, 0), Z2, Z2, Z2, Z2, 0.0)
    k, k0 = stiffness_about_normal(plane, a1, 0, d, line.kb, line.k0, 0)
    ghost = end_chord(plane, ends.frame, 0)
    kappa = angle_between(ghost, d)
    share = moment_share(line, 0, abs(kappa - k0))
    M, out = share * k * (kappa - k0), share * (line.kb[0, 0] + line.kb[0, 1] - k)
    if line.bits & BENDING_SLIP:
        m, _, more = slip_about_normal(line, a1, 0, d, 0, kappa - k0)
        M, out = M + m, out + more
    C, _ = moment_stiffness(kappa, M, out, line.kb[0, 2], ghost)
    return Joint(M, Z2, Z2, mat_vec2(C, (d[1], -d[0])), mat_vec2(C, d), line.kb[0, 2])


@inner
def joint_after(line, ends, a1, c, d, dn):
    """The element after cell c with the chord d, before the chord dn."""
    plane, n = line.plane, a1.shape[0]
    if not line.element[c + 1]:
        return Joint(row_along_normal(plane, ends.moment, 1) if c + 1 == n else 0.0, Z2, Z2, Z2, Z2, 0.0)
    k, k0 = stiffness_about_normal(plane, a1, c, d, line.kb, line.k0, c + 1)
    kappa = angle_between(d, dn if c + 1 < n else end_chord(plane, ends.frame, 1))
    share = moment_share(line, c + 1, abs(kappa - k0))
    M, out = share * k * (kappa - k0), share * (line.kb[c + 1, 0] + line.kb[c + 1, 1] - k)
    if line.bits & BENDING_SLIP:
        m, _, more = slip_about_normal(line, a1, c, d, c + 1, kappa - k0)
        M, out = M + m, out + more
    C, CJ = moment_stiffness(kappa, M, out, line.kb[c + 1, 2], d)
    zn, pn = Z2, Z2
    if c + 1 < n:
        zn, pn = mat_vec2(C, (dn[1], -dn[0])), mat_vec2(C, dn)
    return Joint(M, mat_vec2(CJ, (-d[1], d[0])), mat_vec2(CJ, (-d[0], -d[1])), zn, pn, line.kb[c + 1, 2])


@inner
def add_shear(A, c, n, T, before, cell, after, joint, next_joint):
    """Shear S_c = T zeta_c + m_c.(dM_{c+1} - dM_c)/l_c into the balances of the nodes c and c+1."""
    d, il = cell
    m = (-d[1], d[0])
    # S_c by zeta and psi of cells c-1, c, c+1
    sz0, sp0 = -il * dot2(m, joint.dMz_before), -il * dot2(m, joint.dMp_before)
    sz1 = T + il * (dot2(m, next_joint.dMz_before) - dot2(m, joint.dMz_after))
    sp1 = il * (dot2(m, next_joint.dMp_before) - dot2(m, joint.dMp_after))
    sz2, sp2 = il * dot2(m, next_joint.dMz_after), il * dot2(m, next_joint.dMp_after)
    a, b, g = sz0 * before.il, sz1 * il, sz2 * after.il  # by w_{c-1} .. w_{c+2}: -a, a - b, b - g, g
    for side in range(2):  # + on node c, - on node c+1
        sign = 1.0 - 2.0 * side
        o = 2 * (c + side) * BAND + REACH - 2 * side
        if c > 0:
            A[o - 2] -= sign * a
            A[o - 1] += sign * sp0
        A[o] += sign * (a - b)
        A[o + 1] += sign * sp1
        A[o + 2] += sign * (b - g)
        if c + 1 < n:
            A[o + 3] += sign * sp2
            A[o + 4] += sign * g


@inner
def add_spin(A, c, n, before, cell, after, joint, next_joint):
    """The row of the spin of cell c: d_c.(dM_{c+1} - dM_c) + Q_c zeta_c = 0."""
    d, il = cell
    o = (2 * c + 1) * BAND + REACH
    rz0, rp0 = -dot2(d, joint.dMz_before) * before.il, -dot2(d, joint.dMp_before)
    rz1 = (dot2(d, next_joint.dMz_before) - dot2(d, joint.dMz_after) + next_joint.M - joint.M) * il
    rp1 = dot2(d, next_joint.dMp_before) - dot2(d, joint.dMp_after)
    rz2, rp2 = dot2(d, next_joint.dMz_after) * after.il, dot2(d, next_joint.dMp_after)
    if c > 0:
        A[o - 3], A[o - 2] = -rz0, rp0
    A[o - 1], A[o + 1] = rz0 - rz1, rz1 - rz2
    A[o] = rp1 - LEAST_SPIN_STIFFNESS * (joint.torsion + next_joint.torsion)
    if c + 1 < n:
        A[o + 2], A[o + 3] = rp2, rz2


@inner
def assemble_cells(line, ends, e, T, a1, A):
    """Shear and spin rows, cell by cell, into A, which is zero."""
    n = e.shape[0]
    plane = line.plane
    before = Cell(Z2, 0.0)
    d, _, il = chord2(row_in_plane(plane, e, 0))
    cell = Cell(d, il)
    joint = first_joint(line, ends, a1, d)
    for c in range(n):
        after = Cell(Z2, 0.0)
        if c + 1 < n:
            d, _, il = chord2(row_in_plane(plane, e, c + 1))
            after = Cell(d, il)
        next_joint = joint_after(line, ends, a1, c, cell.d, after.d)
        add_shear(A, c, n, T[c], before, cell, after, joint, next_joint)
        if line.spin[c]:
            add_spin(A, c, n, before, cell, after, joint, next_joint)
        else:
            A[(2 * c + 1) * BAND + REACH] = -1.0
        before, cell, joint = cell, after, next_joint
    A[(2 * n + 1) * BAND + REACH] = -1.0


@inner
def held(ends, i, n):
    """Whether node i of n cells is held."""
    return (i == 0 and ends.held[0]) or (i == n and ends.held[1])


@inner
def hold_node(A, o):
    """A held node does not move: the equation at o says so."""
    for j in range(-REACH, REACH + 1):
        A[o + j] = 0.0
    A[o] = -1.0


@inner
def assemble_nodes(line, sea, ends, state, s, was, now, A):
    """Loads on the nodes into their balances in A; the push as predicted into `now`."""
    plane, n = line.plane, state.e.shape[0]
    dt, am, af, _, be, cv, ca = s
    for i in range(n + 1):
        o = 2 * i * BAND + REACH
        ai = was[i, 2]
        wp = was[i, 0] + dt * was[i, 1] + 0.5 * dt * dt * ai
        vp = was[i, 1] + dt * ai
        vdp = (am * ai - af * was[i, 3]) / (1.0 - af) + ca * be * dt * dt * ai
        now[i, 0], now[i, 1], now[i, 3] = wp, vp, vdp
        if held(ends, i, n):
            hold_node(A, o)
            continue
        stiff, rate, inert, before, after = loads_out_of_plane(line, sea, i, state)
        A[o] -= stiff + cv * rate + ca * inert
        if before != 0.0:
            _, _, x = chord2(row_in_plane(plane, state.e, i - 1))
            A[o] += before * x
            A[o - 2] -= before * x
        if after != 0.0:
            _, _, x = chord2(row_in_plane(plane, state.e, i))
            A[o] -= after * x
            A[o + 2] += after * x
        A[o + REACH + 1] = rate * (vp - cv * wp) + inert * (vdp - ca * wp)


@inner
def eliminate(A, rows):
    """Forward elimination without pivoting; how many pivots have the wrong sign."""
    wrong = 0
    for i in range(rows):
        o = i * BAND + REACH
        if not A[o] < 0.0:
            wrong += 1
        inverse = 1.0 / A[o]
        A[o] = inverse
        b1, b2, b3, b4, b = A[o + 1], A[o + 2], A[o + 3], A[o + 4], A[o + 5]
        for j in range(1, REACH + 1):
            p = o + j * BAND
            f = A[p - j]
            if f != 0.0:  # a catenary has no equations of spin, and reaches half as far
                f *= inverse
                p -= j
                A[p + 1] -= f * b1
                A[p + 2] -= f * b2
                A[p + 3] -= f * b3
                A[p + 4] -= f * b4
                A[p + j + REACH + 1] -= f * b
    return wrong


@inner
def substitute_push(line, ends, s, was, now, A):
    """Solve back from the end, correct `now`, and return its kinetic energy, J."""
    n = now.shape[0] - 1
    dt, _, _, _, be, cv, ca = s
    energy = 0.0
    x1 = x2 = x3 = x4 = 0.0
    for i in range(2 * n + 1, -1, -1):
        o = i * BAND + REACH
        x = (A[o + 5] - A[o + 1] * x1 - A[o + 2] * x2 - A[o + 3] * x3 - A[o + 4] * x4) * A[o]
        x1, x2, x3, x4 = x, x1, x2, x3
        if i % 2 == 0:
            k = i // 2
            more = -now[k, 0] if held(ends, k, n) else x - now[k, 0]
            now[k, 0] += more
            now[k, 1] += cv * more
            now[k, 2] = was[k, 2] + more / (be * dt * dt)
            now[k, 3] += ca * more
            energy += 0.5 * line.mass[k] * now[k, 1] * now[k, 1]
    return energy


@kernel
def step_out_of_plane(line, sea, ends, state, s, was, now, A):
    """Step the push from `was` to `now` (N+1, 4) over the step of scheme s that led to `state`.

    A: work array with BAND numbers for each of 2 (N+1) equations, and for REACH more.  Returns the kinetic energy
    of the push at the end of the step, J, and how many pivots have the wrong sign: with one, it grows faster than the
    step can follow.
    """
    rows = 2 * (state.e.shape[0] + 1)
    for j in range((rows + REACH) * BAND):  # with room for the rows that the last ones reach to
        A[j] = 0.0
    assemble_cells(line, ends, state.e, state.T, state.a1, A)
    assemble_nodes(line, sea, ends, state, s, was, now, A)
    wrong = eliminate(A, rows)
    return substitute_push(line, ends, s, was, now, A), wrong


@kernel
def wrong_pivots_at_rest(line, sea, ends, state, soft, A):
    """How many pivots of a line at rest have the wrong sign, with springs of `soft` (1/s2) times the mass.

    None: its stiffness across the plane is positive definite.  A: as of `step_out_of_plane`; cleared here.
    """
    n = state.e.shape[0]
    rows = 2 * (n + 1)
    for j in range((rows + REACH) * BAND):
        A[j] = 0.0
    assemble_cells(line, ends, state.e, state.T, state.a1, A)
    for i in range(n + 1):
        o = 2 * i * BAND + REACH
        if held(ends, i, n):
            hold_node(A, o)
        else:
            stiff, _, inert, _, _ = loads_out_of_plane(line, sea, i, state)
            A[o] -= stiff + soft * inert
    return eliminate(A, rows)
