"""What leaving bending out shifts the cable by: one more right-hand side a step (docs/theory.md, 14).

The balance of a cable that bends is that of the one computed plus the forces of the moments left out.  So its
distance from the one computed, x + e, obeys the same equations linearised, J e = - (what is left out), in the same
time scheme, with the matrix that Newton factored last.

    symbol   meaning                                                        shape   unit
    ki       stiffness of a full element at a node, EI/hn                   N+1     N m
    beta     part of it that the node has: 1 rod, 0 catenary or joint       -       -
    theta    turn of the chords at a node (at a clamp, from its tangent)    3       rad
    dM       moment of the rod less that of the line computed               N+1, 3  N m     inertial
    M        the moment left out: (1 - beta)(beta ki theta + dM)            N+1, 3  N m     inertial
    x        the error: dT_{i-1} (N), e_i (m), dpsi_i (rad)                 N+1, 5
    e, ev, ea, evd   error of r, v, a, vd                                   N+1, 4  with the spin's in column 3
    y, z     evp - cv ep, evdp - ca ep: what history adds to cv e, ca e     N+1, 4  m/s, m/s2
    slid     error of the elastic travel of friction                        N+1, 3  m
"""

from __future__ import annotations

import math

from hybrid.kernels.block_elimination import again
from hybrid.kernels.cell import chord
from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.forces import (
    ADDED_MASS,
    BODIES,
    DRAG,
    FLOW,
    FRICTION,
    MASS_DAMPING,
    ROTARY,
    SEABED,
    STIFFNESS_DAMPING,
    SURFACE,
    WAVES,
)
from hybrid.kernels.generalized_alpha import weights
from hybrid.kernels.loads import body_drag, half_cell_added_mass, half_cell_drag
from hybrid.kernels.node_forces import WATER, Z3, get3
from hybrid.kernels.rotations import add, cross, dot, mat_vec, scale, sub
from hybrid.kernels.seabed import contact, friction, pressure
from hybrid.kernels.water import current_at, wetted, wetted_stretch

# Turns beyond this (1 + cosine) count as one of a half turn less 11 degrees: a fold has no direction.
SHARPEST = 0.02


@inner
def bend(a, b):
    """Turn from direction a to b as a vector: twice the tangent of half the angle, as of an element of chords."""
    return scale(2.0 / max(1.0 + dot(a, b), SHARPEST), cross(a, b))


@inner
def chord_of(chords, i):
    """Direction, length and its inverse, as `lay_out` has left them."""
    return (chords[i, 0], chords[i, 1], chords[i, 2]), chords[i, 3], chords[i, 4]


@kernel
def lay_out(e, chords):
    """chords (N, 5): direction, length (m) and its inverse of the chords e (N, 3)."""
    for i in range(e.shape[0]):
        d, l, il = chord(get3(e, i))
        chords[i, 0], chords[i, 1], chords[i, 2], chords[i, 3], chords[i, 4] = d[0], d[1], d[2], l, il


@inner
def share(line, soft, i):
    """beta of node i."""
    if line.element[i] and soft[i] > 0.0:
        return min(0.5 * (line.kb[i, 0] + line.kb[i, 1]) * soft[i], 1.0)
    return 0.0


@inner
def tangent_of(ends, k):
    """Tangent of the frame at the start (k = 0) or end (1)."""
    return (ends.frame[k, 2], ends.frame[k, 5], ends.frame[k, 8])


@inner
def torque_at(line, ends, soft, tangent, chords, i, torque):
    """Moment along the cable at node i of a torque that its rods do not carry."""
    n = chords.shape[0]
    t = Z3
    if i > 0:
        t, _, _ = chord_of(chords, i - 1)
    if i < n:
        d, _, _ = chord_of(chords, i)
        t = add(t, d)
    if (i == 0 and tangent[0]) or (i == n and tangent[1]):
        t = tangent_of(ends, 0 if i == 0 else 1)
    return scale((1.0 - share(line, soft, i)) * torque / math.sqrt(dot(t, t)), t)


@kernel
def left_out(line, ends, soft, tangent, floor, chords, turned, T, torque, work, dM, M):
    """The moments dM and M (docs/theory.md, T24), by one tridiagonal solve from end to end.

    soft: (N+1,) 1/ki, 0 where there is no bending stiffness; chords: as of `lay_out`; turned: the same as dM without
    torque turns them, along which a torque acts;
    tangent: (2,) 1 where an end prescribes one; floor: (N,) N, least tension that counts; torque: N m, of the whole
    line as far as its rods do not carry it; work: (N+1, 3) to work in.
    """
    n = T.shape[0]
    before, d_before, a_before, last, by_before, mt_before = 0.0, Z3, 0.0, Z3, Z3, Z3
    if torque != 0.0:
        mt_before = torque_at(line, ends, soft, tangent, turned, 0, torque)
    for i in range(n + 1):
        d, a, by = Z3, 0.0, Z3
        if i < n:
            d, _, il = chord_of(chords, i)
            a = il / max(T[i], floor[i])
            if torque != 0.0:
                mt = torque_at(line, ends, soft, tangent, turned, i + 1, torque)
                by = sub(mt, mt_before)
                by = scale(a, sub(by, scale(dot(d, by), d)))
                mt_before = mt
        beta = share(line, soft, i)
        work[i, 2] = beta
        theta = Z3
        given = False
        rhs = Z3
        if 0 < i < n:
            theta = bend(d_before, d)
        elif tangent[0 if i == 0 else 1]:
            theta = bend(tangent_of(ends, 0), d) if i == 0 else bend(d_before, tangent_of(ends, 1))
        else:
            given = True
            cell = 0 if i == 0 else n - 1
            if not line.spin[cell]:  # a moment that a catenary's end is given; a rod's is in the march
                rhs = scale(-1.0, get3(ends.moment, 0)) if i == 0 else get3(ends.moment, 1)
        if not soft[i] > 0.0:
            given = True
            rhs = Z3
        diagonal = 1.0
        lower = 0.0
        if not given:
            diagonal = soft[i] + a_before + a
            lower = -a_before
            rhs = scale(1.0 - beta, theta)
            if torque != 0.0:  # it turns chords as well
                rhs = add(rhs, sub(by, by_before))
        # forward elimination: work[:, 0] the upper factor, dM the right-hand side, M keeps beta ki theta for the end
        k = Z3
        if beta > 0.0:
            k = scale(beta / soft[i], theta)
        M[i, 0], M[i, 1], M[i, 2] = k
        inverse = 1.0 / (diagonal - lower * before)
        before = 0.0 if given else -a * inverse
        work[i, 0] = before
        rhs = scale(inverse, sub(rhs, scale(lower, last)))
        last = rhs
        dM[i, 0], dM[i, 1], dM[i, 2] = rhs
        d_before, a_before, by_before = d, a, by
    for i in range(n - 1, -1, -1):
        last = sub(get3(dM, i), scale(work[i, 0], last))
        dM[i, 0], dM[i, 1], dM[i, 2] = last
    d_before = Z3
    for i in range(n + 1):
        d = Z3
        if i < n:
            d, _, _ = chord_of(chords, i)
        left = 1.0 - work[i, 2]
        m = scale(left, add(get3(M, i), get3(dM, i)))
        # a joint passes no torque to the rod beside it, and a chord feels none of a moment along it
        if i < n and line.spin[i]:
            m = sub(m, scale(dot(m, d), d))
        if i > 0 and line.spin[i - 1]:
            m = sub(m, scale(dot(m, d_before), d_before))
        if torque != 0.0:
            m = add(m, torque_at(line, ends, soft, tangent, turned, i, torque))
        M[i, 0], M[i, 1], M[i, 2] = m
        d_before = d


@kernel
def turn(chords, T, floor, dM, turned):
    """Chords as the moments dM turn them: by the difference of the moments at their ends over l T."""
    for c in range(chords.shape[0]):
        d, l, il = chord_of(chords, c)
        w = scale(il / max(T[c], floor[c]), sub(get3(dM, c + 1), get3(dM, c)))
        t, _, _ = chord(add(d, cross(w, d)))
        turned[c, 0], turned[c, 1], turned[c, 2], turned[c, 3], turned[c, 4] = t[0], t[1], t[2], l, il


@inner
def half_cell_rates(line, c, side, z, eta, u, b, y, yz, d, l, il):
    """Change of the force of the water on a half cell when its velocity changes by y and its acceleration by yz."""
    bits = line.bits
    f = Z3
    if bits & DRAG:
        _, B, _ = half_cell_drag(u, d, il, line.drag_n[c], line.drag_t[c])
        f = mat_vec(B, y)
    if bits & ADDED_MASS:
        _, D, _ = half_cell_added_mass(b, d, il, line.added_n[c], line.added_t[c], 1.0)
        f = add(f, mat_vec(D, yz))
    if bits & SURFACE:
        iD = 1.0 / line.diameter[c]
        xa = (eta - z) * iD + 0.5
        wet, _, _ = wetted_stretch(xa, xa - side * 0.5 * l * d[2] * iD)
        f = scale(wet, f)
    return f


@inner
def body_rates(line, i, z, eta, u, y, yz):
    """The same for a body at node i."""
    _, B = body_drag(u, line.point_drag[i])
    f = sub(mat_vec(B, y), scale(line.point_added[i], yz))
    if line.bits & SURFACE and line.point_height[i] > 0.0:
        x = (eta - z) / line.point_height[i] + 0.5
        wet, _, _ = wetted(x)
        if line.point_upright[i]:
            wet = min(max(x, 0.0), 1.0)
        f = scale(wet, f)
    return f


@inner
def seabed_rates(line, sea, i, x, u, v, e, left, right, y, ahead, old, slid, out):
    """What history adds to the force of the seabed on node i, and contact at r + e to its linearisation there.

    y: (N+1, 4); ahead: (N+1, 4) the error as predicted; old: (N+1, 4) the error before the step; slid: (N+1, 3) the
    error of friction's travel then; out: (N+1, 4) the direction in which the node slides, zero where it sticks, and
    the part of the travel that sliding leaves.
    """
    n = (sea.normal[0], sea.normal[1], sea.normal[2])
    p, pd = sea.offset + 0.5 * sea.onset - dot(n, x), -dot(n, get3(v, i))
    N = more = 0.0
    yi, q = -dot(n, get3(y, i)), -dot(n, get3(ahead, i))
    k, c, o = sea.stiffness, sea.damping, sea.onset
    for side in (-1, 1):
        if (side < 0 and left) or (side > 0 and right):
            j = i + side
            cell = i - 1 if side < 0 else i
            po = p + dot(n, get3(e, cell)) if side < 0 else p - dot(n, get3(e, cell))
            qo = -dot(n, get3(ahead, j))
            near = p > 0.0 or po > 0.0
            if near or p + q > 0.0 or po + qo > 0.0:
                vo = -dot(n, get3(v, j))
                f = f0 = f1 = g0 = g1 = 0.0
                if near:
                    f, f0, f1, g0, g1 = contact(p, po, pd, vo, line.h[cell], k, c, o)
                g, _, _, _, _ = contact(p + q, po + qo, pd, vo, line.h[cell], k, c, o)
                N += f
                more += g - f - f0 * q - f1 * qo + g0 * yi - g1 * dot(n, get3(y, j))
    if line.footing[i] > 0.0 and p > 0.0:
        f, f0, g0 = pressure(0.0, p, p, pd, pd, k, c, o)
        N += line.footing[i] * f
        more += line.footing[i] * g0 * yi
    F = scale(more, n)
    out[i, 0], out[i, 1], out[i, 2], out[i, 3] = 0.0, 0.0, 0.0, 0.0
    if line.bits & FRICTION and N > 0.0:
        w = dot(n, get3(u, i))
        t = (
            sea.slip[i, 0] + u[i, 0] - w * n[0],
            sea.slip[i, 1] + u[i, 1] - w * n[1],
            sea.slip[i, 2] + u[i, 2] - w * n[2],
        )
        _, g, D, part = friction(t, N, get3(sea.axis, i), n, sea.friction[0], sea.friction[1], sea.slip_length)
        # the travel differs by what it did before, and by what the error has moved since
        F = add(F, add(scale(more, g), mat_vec(D, sub(get3(slid, i), get3(old, i)))))
        size = math.sqrt(dot(t, t))
        if part < 1.0:
            out[i, 0], out[i, 1], out[i, 2] = scale(1.0 / size, t)
        out[i, 3] = part
    return F


@inner
def rates(line, sea, i, r, u, e, v, vd, dl, ll, ill, dr, lr, ilr, left, right, y, z, ahead, old, slid, out):
    """Force that history adds on node i: d(force)/d(v) y + d(force)/d(vd) z, and the seabed's (`seabed_rates`)."""
    yi, zi = get3(y, i), get3(z, i)
    bits = line.bits
    F = scale(-line.mass[i], zi)
    if bits & MASS_DAMPING:
        F = sub(F, scale(line.damp[i], yi))
    if bits & WATER:
        h, eta = r[i, 2], sea.surface
        w, b = get3(v, i), get3(vd, i)
        if bits & FLOW:
            U, _ = current_at(sea.z, sea.current, sea.now[1], h)
            w = sub(w, U)
        if bits & WAVES:
            w = sub(w, get3(sea.flow, i))
            b = sub(b, (sea.flow[i, 3], sea.flow[i, 4], sea.flow[i, 5]))
            eta += sea.flow[i, 6]
        if left:
            F = add(F, half_cell_rates(line, i - 1, -1.0, h, eta, w, b, yi, zi, dl, ll, ill))
        if right:
            F = add(F, half_cell_rates(line, i, 1.0, h, eta, w, b, yi, zi, dr, lr, ilr))
        if bits & BODIES:
            F = add(F, body_rates(line, i, h, eta, w, yi, zi))
    if bits & SEABED:
        F = add(F, seabed_rates(line, sea, i, get3(r, i), u, v, e, left, right, y, ahead, old, slid, out))
    return F


@inner
def damped_moment(line, i, n, d_before, il_before, d, il, y):
    """What history adds to the moment of a damped element, to first order in its bend."""
    a, b, along_a, along_b = Z3, Z3, 0.0, 0.0
    tau = line.tau[min(i, n - 1)]
    if i > 0:
        a = scale(il_before, cross(d_before, sub(get3(y, i), get3(y, i - 1))))
        along_a = y[i - 1, 3]
        tau = line.tau[i - 1] if i == n else 0.5 * (tau + line.tau[i - 1])
    if i < n:
        b = scale(il, cross(d, sub(get3(y, i + 1), get3(y, i))))
        along_b = y[i, 3]
    m = scale(0.5 * tau * (line.kb[i, 0] + line.kb[i, 1]), sub(b, a))
    return add(m, scale(tau * line.kb[i, 2], sub(scale(along_b, d), scale(along_a, d_before))))


@kernel
def right_side(line, sea, ends, chords, r, u, e, v, vd, M, y, z, ahead, old, slid, travel, moving, b):
    """The right-hand side b (N+1, 5) of J x = b; chords, r, e, v, vd: the converged step, u its displacement.

    moving: whether there is a history; without one (statics) y, z and what follows are not read.
    """
    n = e.shape[0]
    d_before, l_before, il_before = Z3, 0.0, 0.0
    force_before = Z3
    damped = moving and line.bits & STIFFNESS_DAMPING
    rotary = moving and line.bits & ROTARY
    d, l, il = chord_of(chords, 0)
    m = get3(M, 0)
    if damped and line.element[0]:
        m = add(m, damped_moment(line, 0, n, Z3, 0.0, d, il, y))
    gap = 0.0
    for i in range(n + 1):
        cell = i < n
        dn, ln, iln, mn = Z3, 0.0, 0.0, Z3
        force = Z3
        next_gap = 0.0
        b[i, 4] = 0.0
        if cell:
            mn = get3(M, i + 1)
            if i + 1 < n:
                dn, ln, iln = chord_of(chords, i + 1)
            if damped:
                if line.element[i + 1]:
                    mn = add(mn, damped_moment(line, i + 1, n, d, il, dn, iln, y))
                if line.ck[i] > 0.0:
                    next_gap = -line.tau[i] * dot(d, sub(get3(y, i + 1), get3(y, i)))
            Q = sub(mn, m)
            force = scale(il, cross(d, Q))
            if line.spin[i]:
                b[i, 4] = -dot(d, Q)
            if rotary and line.spin[i]:
                across = sub(get3(z, i + 1), get3(z, i))
                across = sub(across, scale(dot(d, across), d))
                force = add(force, scale(line.rotary[i] * il * il, across))
                b[i, 4] += line.polar[i] * z[i, 3]
        F = sub(force, force_before)
        if moving:
            F = add(
                F,
                rates(
                    line, sea, i, r, u, e, v, vd, d_before, l_before, il_before, d, l, il, i > 0, cell,
                    y, z, ahead, old, slid, travel,
                ),
            )  # fmt: skip
        if (i == 0 and ends.held[0]) or (i == n and ends.held[1]):
            F = Z3
        b[i, 0], b[i, 1], b[i, 2], b[i, 3] = gap, -F[0], -F[1], -F[2]
        d_before, l_before, il_before, force_before, gap = d, l, il, force, next_gap
        d, l, il, m = dn, ln, iln, mn


@kernel
def follow(
    line, sea, ends, soft, tangent, floor, state, u, old, slid, new, torque, dt, before, rho, most, X, W, chords,
    turned, work, b, x, dM, M
):  # fmt: skip
    """The error at the end of a step of dt from that before it, `old`, to `new`: (4, N+1, 4) of r, v, a, vd.

    dt = 0: an equilibrium.  before: s, the step that led to `old`.  slid: (N+1, 3) error of friction's travel, before,
    and after.  most: m, beyond which an error is no longer one: it is clipped.  work: (4, N+1, 4).  Returns whether it
    is finite, how many nodes were clipped, and the node that was furthest.
    """
    n = state.e.shape[0]
    y, z, ahead = work[0], work[1], work[2]
    lay_out(state.e, chords)
    left_out(line, ends, soft, tangent, floor, chords, chords, state.T, 0.0, y, dM, M)
    if torque != 0.0:
        turn(chords, state.T, floor, dM, turned)
        left_out(line, ends, soft, tangent, floor, chords, turned, state.T, torque, y, dM, M)
    cv = ca = be = 0.0
    moving = dt > 0.0
    if moving:
        am, af, ga, be, _ = weights(rho, before / dt)
        cv = ga / (be * dt)
        ca = (1.0 - am) / ((1.0 - af) * be * dt * dt)
        for i in range(n + 1):
            for k in range(4):
                p, q, a, ad = old[0, i, k], old[1, i, k], old[2, i, k], old[3, i, k]
                rp = p + dt * q + dt * dt * (0.5 - be) * a
                y[i, k] = q + dt * (1.0 - ga) * a - cv * rp
                z[i, k] = (am * a - af * ad) / (1.0 - af) - ca * rp
                ahead[i, k] = p + dt * q + 0.5 * dt * dt * a
    right_side(
        line,
        sea,
        ends,
        chords,
        state.r,
        u,
        state.e,
        state.v,
        state.vd,
        M,
        y,
        z,
        ahead,
        old[0],
        slid,
        work[3],
        moving,
        b,
    )
    if not again(X, W, b, x):
        return False, 0, -1
    clipped, where, far = 0, -1, 0.0
    for i in range(n + 1):
        size = math.sqrt(x[i, 1] * x[i, 1] + x[i, 2] * x[i, 2] + x[i, 3] * x[i, 3])
        part = 1.0
        if size > most:
            part = most / size
            clipped += 1
        if size > far:
            far, where = size, i
        for k in range(4):
            xi = part * x[i, k + 1] if k < 3 else x[i, 4]
            new[0, i, k] = xi
            if moving:
                rp = old[0, i, k] + dt * old[1, i, k] + dt * dt * (0.5 - be) * old[2, i, k]
                new[1, i, k] = part * (cv * xi + y[i, k])
                new[2, i, k] = part * (xi - rp) / (be * dt * dt)
                new[3, i, k] = part * (ca * xi + z[i, k])
            else:
                new[1, i, k], new[2, i, k], new[3, i, k] = 0.0, 0.0, 0.0
        if moving and line.bits & FRICTION:
            slides, kept = get3(work[3], i), work[3, i, 3]
            q = add(get3(slid, i), sub(get3(new[0], i), get3(old[0], i)))
            q = sub(q, scale(dot(sea.normal, q), (sea.normal[0], sea.normal[1], sea.normal[2])))
            q = scale(kept, sub(q, scale(dot(slides, q), slides)))
            slid[i, 0], slid[i, 1], slid[i, 2] = q
    return True, clipped, where
