"""What acts on a node besides the cells themselves: inertia, weight, water, bodies, seabed.

Each paragraph stands behind the bit of its force; symbols as in kernels.laws.water and kernels.laws.seabed.  Of a cable
in a plane it is the same with two components: tests/kernels/test_planar.py holds both against each other for every
force.
"""

from __future__ import annotations

from typing import Any, NamedTuple

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
from hybrid.kernels.algebra.rotations import add, dot, get3, madd, mat_vec, mscale, outer, scale, sub
from hybrid.kernels.laws.obstacles import obstacle_forces
from hybrid.kernels.laws.seabed import (
    bed_before,
    bed_beside,
    bed_under,
    contact,
    depth_falls,
    friction,
    left_of,
    pressure,
    soil_force,
)
from hybrid.kernels.laws.water import (
    body_drag,
    current_at,
    half_cell_added_mass,
    half_cell_drag,
    lift_at,
    wetted,
    wetted_stretch,
)
from hybrid.kernels.machine.compile import called, inner, kernel
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
    OBSTACLES,
    SEABED,
    SOIL,
    SURFACE,
    VORTICES,
    WAVE_POWER,
    WAVES,
)

WATER = DRAG | ADDED_MASS | SURFACE | WAVES | BODIES
TOUCHING = VORTICES | SEABED | OBSTACLES
Z3 = (0.0, 0.0, 0.0)
Z9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)


class Water(NamedTuple):
    """The water at a node, in space or in a plane: heights z of the node and eta of the surface, and how it moves.

    u, b: velocity and acceleration of the node relative to it; U1: slope of the current over height; af: its own
    acceleration.
    """

    z: float
    eta: float
    u: Any
    U1: Any
    b: Any
    af: Any


@inner
def half_cell_water(line, c, side, water, vi, chord, rates, report):
    """Force of the water on the half cell c before (side -1) or after (+1) a node: f, D (dr_i), L (chord)."""
    bits, (cv, ca) = line.bits, rates
    z, eta, u, U1, b, af = water
    d, l, il = chord
    f, D, L = Z3, Z9, Z9
    if bits & DRAG:
        f, B, L = half_cell_drag(u, d, il, line.drag_n[c], line.drag_t[c])
        D = mscale(cv, B)
        if bits & FLOW:
            g = mat_vec(B, U1)
            D = (D[0], D[1], D[2] - g[0], D[3], D[4], D[5] - g[1], D[6], D[7], D[8] - g[2])
    drag = dot(f, vi)
    added = 0.0
    if bits & ADDED_MASS:
        g, Dg, Lg = half_cell_added_mass(b, d, il, line.added_n[c], line.added_t[c], ca)
        f, D, L = add(f, g), madd(D, Dg), madd(L, Lg)
        added = dot(g, vi)
    pushed = 0.0
    if bits & WAVES:
        g = scale(line.displaced[c], af)
        f = add(f, g)
        pushed = dot(g, vi)
    wet = 1.0
    if bits & SURFACE:
        f = (f[0], f[1], f[2] + line.buoy[c])
        pushed += line.buoy[c] * vi[2]
        iD = 1.0 / line.diameter[c]
        xa = (eta - z) * iD + 0.5
        xb = xa - side * 0.5 * l * d[2] * iD
        wet, wa, wb = wetted_stretch(xa, xb)
        D = madd(mscale(wet, D), mscale(-(wa + wb) * iD, outer(f, UP)))
        L = madd(mscale(wet, L), mscale(-side * 0.5 * wb * iD, outer(f, UP)))
        f = scale(wet, f)
    report[DRAG_POWER] -= wet * drag
    report[ADDED_MASS_POWER] -= wet * added
    report[WAVE_POWER] += wet * pushed
    return f, D, L


@inner
def wet_parts(line, i, z, eta):
    """Part of a body at node i under water at height z, of which its added mass counts, and their slopes by z, 1/m.

    A body has the added mass that is given where it floats by itself, and deeper.
    """
    iH = 1.0 / line.point_height[i]
    x, most = (eta - z) * iH + 0.5, line.point_floats[i]
    wet, _, slope = wetted(x)
    if line.point_upright[i]:
        wet, slope = min(max(x, 0.0), 1.0), 1.0 if 0.0 < x < 1.0 else 0.0
    slope *= -iH
    if wet < most:
        return wet, slope, wet / most, slope / most
    return wet, slope, 1.0, 0.0


@inner
def body_water(line, i, water, vi, rates):
    """Force of the water on a body at node i, D, and its powers: of drag, of added mass, of waves and buoyancy."""
    bits, (cv, ca) = line.bits, rates
    z, eta, u, U1, b, af = water
    f, B = body_drag(u, line.point_drag[i])
    D = mscale(cv, B)
    if bits & FLOW:
        g = mat_vec(B, U1)
        D = (D[0], D[1], D[2] - g[0], D[3], D[4], D[5] - g[1], D[6], D[7], D[8] - g[2])
    drag, pushed = dot(f, vi), 0.0
    a = line.point_added[i]
    added = scale(-a, b)
    if bits & WAVES:
        g = scale(line.point_displaced[i], af)
        f = add(f, g)
        pushed = dot(g, vi)
    if bits & SURFACE and line.point_height[i] > 0.0:
        f = (f[0], f[1], f[2] + line.point_buoy[i])
        pushed += line.point_buoy[i] * vi[2]
        wet, slope, part, change = wet_parts(line, i, z, eta)
        D = madd(mscale(wet, D), outer(add(scale(slope, f), scale(change, added)), UP))
        f, added = scale(wet, f), scale(part, added)
        drag, pushed, a = wet * drag, wet * pushed, part * a
    D = (D[0] - ca * a, D[1], D[2], D[3], D[4] - ca * a, D[5], D[6], D[7], D[8] - ca * a)
    return add(f, added), D, (drag, dot(added, vi), pushed)


@inner
def bed_travel(sea, i, n, u):
    """Elastic travel of friction of node i on a bed with the normal n, as if it did not slide."""
    w = dot(n, get3(u, i))
    return (
        sea.slip[i, 0] + u[i, 0] - w * n[0],
        sea.slip[i, 1] + u[i, 1] - w * n[1],
        sea.slip[i, 2] + u[i, 2] - w * n[2],
    )


@kernel  # called for every node of a line in soil
def soil_forces(line, sea, i, x, u, past, report):
    """Force of soil that remembers on node i, with friction: whether there is any, F, D; past: what it remembers."""
    n, p = bed_under(sea, x)
    N, DN, along, across, more_along, more_across = soil_force(line, sea, past, i, p)
    for k in range(3):
        sea.slid[i, k], sea.bed[i, k] = 0.0, 0.0
    if N == 0.0 and DN == 0.0:
        return False, Z3, Z9
    F, slope, D = scale(N, n), scale(DN, n), Z9
    report[CONTACT_FORCE] += N
    if line.bits & FRICTION:  # in suction, too, the travel is that of what lies in the soil
        q = bed_travel(sea, i, n, u)
        f, _, D, part = friction(q, 1.0, get3(sea.axis, i), n, along, across, sea.slip_length)
        more, _, _, _ = friction(q, 1.0, get3(sea.axis, i), n, more_along, more_across, sea.slip_length)
        F, slope = add(F, f), add(slope, more)
        sea.slid[i, 0], sea.slid[i, 1], sea.slid[i, 2] = scale(part, q)
    sea.bed[i, 0], sea.bed[i, 1], sea.bed[i, 2] = F
    g = n
    if sea.bed_x.shape[0] > 0:
        g, W = depth_falls(sea, x, n, p)
        D = madd(D, mscale(N, W))
    return True, F, madd(D, mscale(-1.0, outer(slope, g)))


@inner
def seabed_forces(line, sea, i, x, u, v, state, cv, report):
    """Contact and friction at node i: whether there are any, F, D, GL, GR."""
    if line.bits & SOIL:
        touches, F, D = soil_forces(line, sea, i, x, u, state.soil, report)
        return touches, F, D, Z9, Z9
    e = state.e
    n, p = bed_under(sea, x)
    left = right = n  # normals of the bed under the nodes beside this one, and how deep these are
    pl = pr = p
    pd = -dot(n, get3(v, i))
    N = DN = NL = NR = 0.0  # force along n; its derivatives by the penetration of node i, and by those beside it
    if i > 0:
        left, pl = bed_before(sea, n, p, x, get3(e, i - 1))
        if p > 0.0 or pl > 0.0:
            h = line.h[i - 1]
            f, f0, f1, g0, g1 = contact(p, pl, pd, -dot(left, get3(v, i - 1)), h, sea.stiffness, sea.damping, sea.onset)
            N, NL, DN = N + f, f1 + cv * g1, DN + f0 + cv * g0
    if i < line.h.shape[0]:
        right, pr = bed_beside(sea, n, p, x, get3(e, i))
        if p > 0.0 or pr > 0.0:
            h = line.h[i]
            f, f0, f1, g0, g1 = contact(
                p, pr, pd, -dot(right, get3(v, i + 1)), h, sea.stiffness, sea.damping, sea.onset
            )
            N, NR, DN = N + f, f1 + cv * g1, DN + f0 + cv * g0
    if line.footing[i] > 0.0 and p > 0.0:
        f, f0, g0 = pressure(0.0, p, p, pd, pd, sea.stiffness, sea.damping, sea.onset)
        N, DN = N + line.footing[i] * f, DN + line.footing[i] * (f0 + cv * g0)
    if N == 0.0 and DN == 0.0 and NL == 0.0 and NR == 0.0:
        for k in range(3):
            sea.slid[i, k], sea.bed[i, k] = 0.0, 0.0
        return False, Z3, Z9, Z9, Z9
    F, slope, q = scale(N, n), n, Z3
    D = Z9
    report[CONTACT_FORCE] += N
    if line.bits & FRICTION and N > 0.0:
        q = bed_travel(sea, i, n, u)
        a, b = left_of(line, sea, state.soil, i)
        a, b = a * sea.friction[0], b * sea.friction[1]
        f, g, D, part = friction(q, N, get3(sea.axis, i), n, a, b, sea.slip_length)
        F, slope, q = add(F, f), add(n, g), scale(part, q)
    sea.slid[i, 0], sea.slid[i, 1], sea.slid[i, 2] = q
    sea.bed[i, 0], sea.bed[i, 1], sea.bed[i, 2] = F
    # penetrations: dp_i = -g.dr_i, dp_{i-1} = -g.(dr_i - de), dp_{i+1} = -g.(dr_i + de), each with g where it is, the
    # normal but for how that turns on a bed of depths
    g = n
    if sea.bed_x.shape[0] > 0:
        g, W = depth_falls(sea, x, n, p)
        D = madd(D, mscale(N, W))
        if NL != 0.0 and i > 0:
            left, _ = depth_falls(sea, sub(x, get3(e, i - 1)), left, pl)
        if NR != 0.0 and i < line.h.shape[0]:
            right, _ = depth_falls(sea, add(x, get3(e, i)), right, pr)
    D = madd(D, mscale(-DN, outer(slope, g)))
    L, R = mscale(NL, outer(slope, left)), mscale(NR, outer(slope, right))
    return True, F, madd(D, mscale(-1.0, madd(L, R))), L, mscale(-1.0, R)


@inner
def weight_and_inertia(line, i, vi, vdi, rates, report):
    """Weight, inertia and damping by mass of node i: force, and its derivative by the position, the same in all directions."""
    m, (cv, ca) = line.mass[i], rates
    F, c = sub(get3(line.force, i), scale(m, vdi)), -ca * m
    if line.bits & MASS_DAMPING:
        b = line.damp[i]
        F, c = sub(F, scale(b, vi)), c - cv * b
        report[MASS_DAMPING_POWER] += b * dot(vi, vi)
    return F, c


@inner
def water_at(line, sea, i, z, vi, vdi):
    """The water at node i at height z, which moves with vi and vdi."""
    bits, eta = line.bits, sea.surface
    U1, w, b, af = Z3, vi, vdi, Z3
    if bits & FLOW:
        U, U1 = current_at(sea.z, sea.current, sea.now[1], z)
        w = sub(w, U)
    if bits & WAVES:
        w, af = sub(w, get3(sea.flow, i)), (sea.flow[i, 3], sea.flow[i, 4], sea.flow[i, 5])
        b = sub(b, af)
        eta += sea.flow[i, 6]
    return Water(z, eta, w, U1, b, af)


@inner
def inertia_and_water(line, sea, i, z, vi, vdi, before, after, rates, report):
    """Weight, inertia, damping and water on node i at height z: F, and its derivatives D (dr_i), GL, GR (chords).

    before, after: the chords beside the node.
    """
    bits = line.bits
    F, c = weight_and_inertia(line, i, vi, vdi, rates, report)
    D = (c, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0, c)
    GL, GR = Z9, Z9
    if bits & WATER:
        water = water_at(line, sea, i, z, vi, vdi)
        if i > 0:
            f, Df, GL = half_cell_water(line, i - 1, -1.0, water, vi, before, rates, report)
            F, D = add(F, f), madd(D, Df)
        if i < line.h.shape[0]:
            f, Df, GR = half_cell_water(line, i, 1.0, water, vi, after, rates, report)
            F, D = add(F, f), madd(D, Df)
        if bits & BODIES:
            f, Df, (drag, added, pushed) = body_water(line, i, water, vi, rates)
            F, D = add(F, f), madd(D, Df)
            report[DRAG_POWER] -= drag
            report[ADDED_MASS_POWER] -= added
            report[WAVE_POWER] += pushed
    return F, D, GL, GR


@called
def touching_loads(line, sea, i, r, u, state, before, after, cv, report):
    """Lift by vortices on node i, force of bed and obstacles: whether there is any, F, and derivatives as of `node_loads`."""
    any_of_them, F, D, GL, GR = False, Z3, Z9, Z9, Z9
    x = (r[i, 0] + u[i, 0], r[i, 1] + u[i, 1], r[i, 2] + u[i, 2])
    if line.bits & VORTICES:
        any_of_them = True
        F, D, GL, GR = lift_at(line, sea, i, x[2], state, before, after, cv, report)
    if line.bits & SEABED:
        touches, f, Df, L, R = seabed_forces(line, sea, i, x, u, state.v, state, cv, report)
        if touches:
            any_of_them = True
            F, D, GL, GR = add(F, f), madd(D, Df), madd(GL, L), madd(GR, R)
    if line.bits & OBSTACLES:
        touches, f, Df, L, R = obstacle_forces(line, sea, i, x, u, state.v, state.e, cv)
        if touches:
            any_of_them = True
            F, D, GL, GR = add(F, f), madd(D, Df), madd(GL, L), madd(GR, R)
    return any_of_them, F, D, GL, GR


@kernel  # called for every node, not inlined in each of the loops that do
def node_loads(line, sea, i, r, u, state, before, after, rates, report):
    """Force on node i but for the cells' own: F, and its derivatives D (dr_i), GL, GR (chord before, after)."""
    F, D, GL, GR = inertia_and_water(
        line, sea, i, r[i, 2] + u[i, 2], get3(state.v, i), get3(state.vd, i), before, after, rates, report
    )
    if line.bits & TOUCHING:
        touches, f, Df, L, R = touching_loads(line, sea, i, r, u, state, before, after, rates.cv, report)
        if touches:
            F, D, GL, GR = add(F, f), madd(D, Df), madd(GL, L), madd(GR, R)
    return F, D, GL, GR


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
    if line.bits & FRICTION and (N != 0.0 or DN != 0.0):
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
