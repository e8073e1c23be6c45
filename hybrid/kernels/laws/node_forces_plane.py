"""What acts on a node of a cable in a plane besides the cells themselves: kernels.laws.node_forces with two components.

tests/kernels/test_planar.py holds both against each other for every force.
"""

from __future__ import annotations

from hybrid.kernels.algebra.plane import (
    added_mass2,
    body_drag2,
    dot2,
    drag2,
    friction2,
    madd2,
    mscale2,
    msub2,
    outer2,
    row_in_plane,
    to_space,
    vector_in_plane,
)
from hybrid.kernels.laws.node_forces import Water, wet_parts
from hybrid.kernels.laws.seabed import contact, pressure
from hybrid.kernels.laws.soil import left_of, soil_force
from hybrid.kernels.laws.water import current_at, wetted_stretch
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.state.report import (
    ADDED_MASS,
    ADDED_MASS_POWER,
    BODIES,
    CONTACT_FORCE,
    DRAG,
    DRAG_POWER,
    FLOW,
    FRICTION,
    MASS_DAMPING,
    MASS_DAMPING_POWER,
    SEABED,
    SOIL,
    SURFACE,
    WAVE_POWER,
    WAVES,
)

WATER = DRAG | ADDED_MASS | SURFACE | WAVES | BODIES
Z2 = (0.0, 0.0)
Z4 = (0.0, 0.0, 0.0, 0.0)


@inner
def half_cell_water2(line, c, side, up, water, vi, chord, rates, report):
    """Force of the water on the half cell c before (side -1) or after (+1) a node: f, D (dr_i), L (chord)."""
    bits, (cv, ca) = line.bits, rates
    z, eta, u, U1, b, af = water
    d, l, il = chord
    f, D, L = Z2, Z4, Z4
    if bits & DRAG:
        f, B, L = drag2(u, d, il, line.drag_n[c], line.drag_t[c])
        D = mscale2(cv, B)
        if bits & FLOW:
            D = msub2(D, outer2(1.0, (B[0] * U1[0] + B[1] * U1[1], B[2] * U1[0] + B[3] * U1[1]), up))
    drag = dot2(f, vi)
    added = 0.0
    if bits & ADDED_MASS:
        g, Dg, Lg = added_mass2(b, d, il, line.added_n[c], line.added_t[c], ca)
        f, D, L = (f[0] + g[0], f[1] + g[1]), madd2(D, Dg), madd2(L, Lg)
        added = dot2(g, vi)
    pushed = 0.0
    if bits & WAVES:
        x = line.displaced[c]
        f = (f[0] + x * af[0], f[1] + x * af[1])
        pushed = x * dot2(af, vi)
    wet = 1.0
    if bits & SURFACE:
        x = line.buoy[c]
        f = (f[0] + x * up[0], f[1] + x * up[1])
        pushed += x * dot2(up, vi)
        iD = 1.0 / line.diameter[c]
        xa = (eta - z) * iD + 0.5
        xb = xa - side * 0.5 * l * dot2(d, up) * iD
        wet, wa, wb = wetted_stretch(xa, xb)
        D = madd2(mscale2(wet, D), outer2(-(wa + wb) * iD, f, up))
        L = madd2(mscale2(wet, L), outer2(-side * 0.5 * wb * iD, f, up))
        f = (wet * f[0], wet * f[1])
    report[DRAG_POWER] -= wet * drag
    report[ADDED_MASS_POWER] -= wet * added
    report[WAVE_POWER] += wet * pushed
    return f, D, L


@inner
def body_water2(line, i, up, water, vi, rates, report):
    """Force of the water on a body at node i, and D."""
    bits, (cv, ca) = line.bits, rates
    z, eta, u, U1, b, af = water
    f, B = body_drag2(u, line.point_drag[i])
    D = mscale2(cv, B)
    if bits & FLOW:
        D = msub2(D, outer2(1.0, (B[0] * U1[0] + B[1] * U1[1], B[2] * U1[0] + B[3] * U1[1]), up))
    drag, pushed = dot2(f, vi), 0.0
    a = line.point_added[i]
    g = (-a * b[0], -a * b[1])
    if bits & WAVES:
        x = line.point_displaced[i]
        f = (f[0] + x * af[0], f[1] + x * af[1])
        pushed = x * dot2(af, vi)
    if bits & SURFACE and line.point_height[i] > 0.0:
        x = line.point_buoy[i]
        f = (f[0] + x * up[0], f[1] + x * up[1])
        pushed += x * dot2(up, vi)
        wet, slope, part, change = wet_parts(line, i, z, eta)
        D = madd2(mscale2(wet, D), outer2(1.0, (slope * f[0] + change * g[0], slope * f[1] + change * g[1]), up))
        f, g = (wet * f[0], wet * f[1]), (part * g[0], part * g[1])
        drag, pushed, a = wet * drag, wet * pushed, part * a
    D = (D[0] - ca * a, D[1], D[2], D[3] - ca * a)
    report[DRAG_POWER] -= drag
    report[ADDED_MASS_POWER] -= dot2(g, vi)
    report[WAVE_POWER] += pushed
    return (f[0] + g[0], f[1] + g[1]), D


@inner
def bed_travel2(plane, sea, i, n, u):
    """Elastic travel of friction of node i on a bed with the normal n, as if it did not slide."""
    ui, slip = row_in_plane(plane, u, i), row_in_plane(plane, sea.slip, i)
    w = dot2(n, ui)
    return slip[0] + ui[0] - w * n[0], slip[1] + ui[1] - w * n[1]


@inner
def soil2(line, sea, i, u, n, p, past, report):
    """Force of soil that remembers on node i at depth p, with friction: F, D; past: what it remembers."""
    plane = line.plane
    N, DN, along, _, more_along, _ = soil_force(line, sea, past, i, p)
    F, slope, D, q = (N * n[0], N * n[1]), (DN * n[0], DN * n[1]), Z4, Z2
    report[CONTACT_FORCE] += N
    if along > 0.0:
        q = bed_travel2(plane, sea, i, n, u)
        f, g, D, kept = friction2(q, along, row_in_plane(plane, sea.axis, i), 1.0, sea.slip_length)
        F, slope = (F[0] + f[0], F[1] + f[1]), (slope[0] + more_along * g[0], slope[1] + more_along * g[1])
        q = (kept * q[0], kept * q[1])
    sea.slid[i, 0], sea.slid[i, 1], sea.slid[i, 2] = to_space(plane, q)
    sea.bed[i, 0], sea.bed[i, 1], sea.bed[i, 2] = to_space(plane, F)
    return F, madd2(D, outer2(-1.0, slope, n))


@inner
def seabed2(line, sea, i, r, u, v, state, cv, report):
    """Contact and friction at node i: F, D, GL, GR.  The bed's normal lies in the plane."""
    plane, e = line.plane, state.e
    n = vector_in_plane(plane, sea.normal)
    p = sea.offset + 0.5 * sea.onset
    for k in range(3):
        p -= sea.normal[k] * (r[i, k] + u[i, k])
    if line.bits & SOIL:
        F, D = soil2(line, sea, i, u, n, p, state.soil, report)
        return F, D, Z4, Z4
    pd = -dot2(n, row_in_plane(plane, v, i))
    N = DN = NL = NR = 0.0
    if i > 0:
        po = p + dot2(n, row_in_plane(plane, e, i - 1))
        if p > 0.0 or po > 0.0:
            vo, h = -dot2(n, row_in_plane(plane, v, i - 1)), line.h[i - 1]
            f, f0, f1, g0, g1 = contact(p, po, pd, vo, h, sea.stiffness, sea.damping, sea.onset)
            N, NL, DN = N + f, f1 + cv * g1, DN + f0 + cv * g0
    if i < line.h.shape[0]:
        po = p - dot2(n, row_in_plane(plane, e, i))
        if p > 0.0 or po > 0.0:
            vo, h = -dot2(n, row_in_plane(plane, v, i + 1)), line.h[i]
            f, f0, f1, g0, g1 = contact(p, po, pd, vo, h, sea.stiffness, sea.damping, sea.onset)
            N, NR, DN = N + f, f1 + cv * g1, DN + f0 + cv * g0
    if line.footing[i] > 0.0 and p > 0.0:
        f, f0, g0 = pressure(0.0, p, p, pd, pd, sea.stiffness, sea.damping, sea.onset)
        N, DN = N + line.footing[i] * f, DN + line.footing[i] * (f0 + cv * g0)
    F, slope, q = (N * n[0], N * n[1]), n, Z2
    D = Z4
    report[CONTACT_FORCE] += N
    if line.bits & FRICTION and N > 0.0:
        q = bed_travel2(plane, sea, i, n, u)
        a, _ = left_of(line, sea, state.soil, i)
        f, g, D, kept = friction2(q, N, row_in_plane(plane, sea.axis, i), a * sea.friction[0], sea.slip_length)
        F, slope, q = (F[0] + f[0], F[1] + f[1]), (n[0] + g[0], n[1] + g[1]), (kept * q[0], kept * q[1])
    sea.slid[i, 0], sea.slid[i, 1], sea.slid[i, 2] = to_space(plane, q)
    sea.bed[i, 0], sea.bed[i, 1], sea.bed[i, 2] = to_space(plane, F)
    S = outer2(1.0, slope, n)
    return F, madd2(D, mscale2(-(DN + NL + NR), S)), mscale2(NL, S), mscale2(-NR, S)


@inner
def node_loads2(line, sea, i, r, u, state, before, after, rates, report):
    """Force on node i but for the cells' own: F, and its derivatives D (dr_i), GL, GR (chord before, after)."""
    bits, plane, (cv, ca) = line.bits, line.plane, rates
    vi, vdi = row_in_plane(plane, state.v, i), row_in_plane(plane, state.vd, i)
    m = line.mass[i]
    F = row_in_plane(plane, line.force, i)
    F = (F[0] - m * vdi[0], F[1] - m * vdi[1])
    c = -ca * m
    if bits & MASS_DAMPING:
        b = line.damp[i]
        F = (F[0] - b * vi[0], F[1] - b * vi[1])
        c -= cv * b
        report[MASS_DAMPING_POWER] += b * dot2(vi, vi)
    D, GL, GR = (c, 0.0, 0.0, c), Z4, Z4
    if bits & WATER:
        up = (plane[0, 2], plane[1, 2])
        z, eta = r[i, 2] + u[i, 2], sea.surface
        U1, w, b, af = Z2, vi, vdi, Z2
        if bits & FLOW:
            U, S = current_at(sea.z, sea.current, sea.now[1], z)
            w = (
                w[0] - plane[0, 0] * U[0] - plane[0, 1] * U[1] - plane[0, 2] * U[2],
                w[1] - plane[1, 0] * U[0] - plane[1, 1] * U[1] - plane[1, 2] * U[2],
            )
            U1 = vector_in_plane(plane, S)
        if bits & WAVES:
            U = row_in_plane(plane, sea.flow, i)
            af = vector_in_plane(plane, (sea.flow[i, 3], sea.flow[i, 4], sea.flow[i, 5]))
            w, b = (w[0] - U[0], w[1] - U[1]), (b[0] - af[0], b[1] - af[1])
            eta += sea.flow[i, 6]
        water = Water(z, eta, w, U1, b, af)
        if i > 0:
            f, Df, GL = half_cell_water2(line, i - 1, -1.0, up, water, vi, before, rates, report)
            F, D = (F[0] + f[0], F[1] + f[1]), madd2(D, Df)
        if i < line.h.shape[0]:
            f, Df, GR = half_cell_water2(line, i, 1.0, up, water, vi, after, rates, report)
            F, D = (F[0] + f[0], F[1] + f[1]), madd2(D, Df)
        if bits & BODIES:
            f, Df = body_water2(line, i, up, water, vi, rates, report)
            F, D = (F[0] + f[0], F[1] + f[1]), madd2(D, Df)
    if bits & SEABED:
        f, Df, L, R = seabed2(line, sea, i, r, u, state.v, state, cv, report)
        F, D, GL, GR = (F[0] + f[0], F[1] + f[1]), madd2(D, Df), madd2(GL, L), madd2(GR, R)
    return F, D, GL, GR
