"""The water: its flow, its forces on cells and members, and vortices.

Its current at a height, the waves that pass, and how much of a cell they wet:

    symbol   meaning                                              shape  unit      frame
    U, U1    velocity of the current and its derivative dU/dz     3      m/s, 1/s  inertial
    z        height                                               -      m
    eta      elevation of the surface                             -      m
    x        wetness coordinate, (eta - z)/D + 1/2                -      -
    A, w, k  amplitude, frequency, wave number of a component     -      m, 1/s, 1/m

Waves are linear (Airy), each component of an irregular sea by itself.  Above and below still
water the kinematics are stretched after Wheeler: the depth at which a component is taken is
scaled so that the moving surface has what linear theory has at the still one.  Components of one
wave of finite height hold up to the surface as they are.

Forces of the water on a half cell or on a body, with their exact derivatives.

A node carries half of each cell that meets it.  `half_cell_drag` gives the force of
the water on one half cell with its exact derivatives; it runs on complex numbers
too, which is how its derivatives are proved.

    symbol   meaning                                            shape  unit     frame
    u        velocity of the node relative to the water         3      m/s      inertial
    vd       acceleration of the node relative to the water     3      m/s2     inertial
    d, il    direction and 1/length of the half cell's chord    3, -   -, 1/m   inertial
    cn, ct   rho D Cn h/4, pi rho D Ct h/4                      -      kg/m
    an, at   added mass of the half cell, normal, tangential    -      kg
    f        force on the node                                  3      N        inertial
    B, D, L  df/du, df/dr (through vd), df/de                   9      N s/m, N/m  inertial

The law of drag itself is called with arrays by the first shape; un and ut are the normal and tangential parts of u.
The tangential coefficient refers to the wetted surface (pi D per length), the normal one to D.

Morison members of a body: drag and wave force on pieces of cylinders that are fixed to it.

Pieces stand in the row of numbers of their body (kernels.junctions.bodies), behind all else.  A piece has the force

    f = w (-cn |un| un - ct |ut| ut + cm (a - d (d.a)))        at its middle, u = v - water

of its velocity u relative to the water and of the water's acceleration a there; un, ut: parts across and along d.

    symbol   meaning                                                   unit
    cn, ct   rho D Cd h/2, pi rho D Ct h/2                              kg/m
    cm       (1 + Ca) rho pi D^2/4 h; the part of Ca that goes with     kg
             the body's own acceleration is in its mass matrix
    w        wetted part

Vortex-induced vibration across a line and its flow: lift whose phase follows the motion (synchronisation).

    symbol       meaning                                                                     unit
    u            velocity of the node relative to the water, across the line un = u - (u.d) d  m/s
    e            direction of the lift, d x un/|un|                                          -
    phi          phase of the lift                                                           rad
    f            frequency of shedding as a part of |un|/D                                   -
    v, a         velocity and acceleration of the node along e                               m/s, m/s2

The lift on half a cell is (h/2) rho/2 D Cv |un|^2 cos(phi) e, and d phi/dt = 2 pi f |un|/D with
f = center + (high - center) S for S > 0, center + (center - low) S else, S = sin(phi_v - phi), where phi_v is the phase of
the motion, atan2(-a/a_rms, v/v_rms): a lift behind the motion is shed faster, one before it slower.

The phase at the end of a step follows from the state at its beginning alone, so that Newton's method sees a given one and
a step that is taken back leaves nothing behind.

M. J. Thorsen, S. Saevik, C. M. Larsen: A simplified method for time domain simulation of cross-flow vortex-induced
vibrations. J. Fluids and Structures 49 (2014) 135-148; as it is in MoorDyn 2.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    get3,
    hat,
    madd,
    mat_mat,
    mat_vec,
    mscale,
    msub,
    outer,
    project,
    scale,
    stack,
    sub,
    vector,
)
from hybrid.kernels.algebra.sparse_rows import interval
from hybrid.kernels.laws.element import Chord, chord
from hybrid.kernels.machine.compile import inner, linked_kernel
from hybrid.kernels.state.report import DRAG_POWER, FLOW, REPORT_SIZE, SURFACE, WAVES
from hybrid.kernels.state.state import LANES, ROWS, blank_state, in_sea, no_sea

# --- the law of drag (Morison); complex numbers and arrays too ---------------------------------


@inner
def split(u: Any, d: Any) -> Any:
    """The tangential part ut of a velocity, the normal part un, and the square of its size."""
    ut = u[0] * d[0] + u[1] * d[1] + u[2] * d[2]
    un = (u[0] - ut * d[0], u[1] - ut * d[1], u[2] - ut * d[2])
    return ut, un, un[0] * un[0] + un[1] * un[1] + un[2] * un[2]


@inner
def half_cell(ut: Any, un: Any, size_t: Any, size_n: Any, d: Any, cn: Any, ct: Any) -> Any:
    """f = -cn |un| un - ct |ut| ut d, with sizes |ut| and |un|; and p = cn |un|, q = ct |ut| ut."""
    p, q = cn * size_n, ct * size_t * ut
    return (-p * un[0] - q * d[0], -p * un[1] - q * d[1], -p * un[2] - q * d[2]), p, q


@inner
def body(u: Any, size: Any, c: Any) -> Any:
    """f = -c |u| u of a body without direction, with size |u|; and p = -c |u|."""
    p = -c * size
    return (p * u[0], p * u[1], p * u[2]), p


# --- flow, forces on cells and members ---------------------------------------------------------

# A component whose motion has faded to this part of its surface value is left out at that depth.
FADED = 1e-4
LAST = math.log(FADED)
# x + TO_WHOLE - TO_WHOLE is x rounded to a whole number; a quarter turn in two parts, the first of 33 bits.
TO_WHOLE = 1.5 * 2.0**52
QUARTER_HIGH, QUARTER_LOW = 1.57079632673412561417, 6.07710050650619224932e-11
# Coefficients of Taylor's series of sine, cosine and exponential.
S3 = -1.0 / math.factorial(3)
S5 = 1.0 / math.factorial(5)
S7 = -1.0 / math.factorial(7)
S9 = 1.0 / math.factorial(9)
S11 = -1.0 / math.factorial(11)
S13 = 1.0 / math.factorial(13)
S15 = -1.0 / math.factorial(15)
C2 = -1.0 / math.factorial(2)
C4 = 1.0 / math.factorial(4)
C6 = -1.0 / math.factorial(6)
C8 = 1.0 / math.factorial(8)
C10 = -1.0 / math.factorial(10)
C12 = 1.0 / math.factorial(12)
C14 = -1.0 / math.factorial(14)
C16 = 1.0 / math.factorial(16)
E2 = 1.0 / math.factorial(2)
E3 = 1.0 / math.factorial(3)
E4 = 1.0 / math.factorial(4)
E5 = 1.0 / math.factorial(5)
E6 = 1.0 / math.factorial(6)
E7 = 1.0 / math.factorial(7)
E8 = 1.0 / math.factorial(8)
E9 = 1.0 / math.factorial(9)
E10 = 1.0 / math.factorial(10)
# Wetness coordinates closer than this are one: their difference quotient would lose digits.
SAME_WETNESS = 1e-4


@inner
def current_at(z, current, part, height):
    """U and U1 at a height, from the table (z, current), times `part`."""
    n = z.shape[0]
    if n == 1 or height <= z[0]:
        return (part * current[0, 0], part * current[0, 1], part * current[0, 2]), (0.0, 0.0, 0.0)
    if height >= z[n - 1]:
        m = n - 1
        return (part * current[m, 0], part * current[m, 1], part * current[m, 2]), (0.0, 0.0, 0.0)
    a = interval(z, height)
    b = a + 1
    q = part / (z[b] - z[a])
    U1 = (q * (current[b, 0] - current[a, 0]), q * (current[b, 1] - current[a, 1]), q * (current[b, 2] - current[a, 2]))
    t = height - z[a]
    U = (part * current[a, 0] + t * U1[0], part * current[a, 1] + t * U1[1], part * current[a, 2] + t * U1[2])
    return U, U1


@inner
def cos_sin(a):
    """Cosine and sine without branches, so that loops over nodes use vector instructions.

    The angle less whole quarter turns (Cody and Waite, in two parts: exact below 10^6 quarters), Taylor's series on
    [-pi/4, pi/4], both within 2e-16, and the quarters turned back.
    """
    quarters = (a * (2.0 / math.pi) + TO_WHOLE) - TO_WHOLE
    x = (a - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW
    m = quarters - 4.0 * ((0.25 * quarters - 0.375 + TO_WHOLE) - TO_WHOLE)
    z = x * x
    s = x * (1.0 + z * (S3 + z * (S5 + z * (S7 + z * (S9 + z * (S11 + z * (S13 + z * S15)))))))
    c = 1.0 + z * (C2 + z * (C4 + z * (C6 + z * (C8 + z * (C10 + z * (C12 + z * (C14 + z * C16)))))))
    C = abs(m - 2.0) - 1.0  # cosine and sine of m quarters
    S = 1.0 - abs(m - 1.0) if m < 2.5 else -1.0
    return C * c - S * s, C * s + S * c


@inner
def exp_of_small(y):
    """exp(y) for -10 <= y <= 10 without branches: the 32nd power of Taylor's series at y/32; within 1e-14 of the value."""
    x = y / 32.0
    q = 1.0 + x * (
        1.0 + x * (E2 + x * (E3 + x * (E4 + x * (E5 + x * (E6 + x * (E7 + x * (E8 + x * (E9 + x * E10))))))))
    )
    q *= q
    q *= q
    q *= q
    q *= q
    return q * q


@inner
def elevate(sea, r, u, first):
    """Heights of the surface over LANES nodes from `first` on, after Wheeler, and what is needed of the components.

    Rows of sea.lanes: 0 x, 1 y, 2 the depth at which components are taken, 3 elevation, from 10 on cosine and sine.
    """
    lanes, waves, part = sea.lanes, sea.waves, sea.now[2]
    for l in range(LANES):
        i = min(first + l, r.shape[0] - 1)
        for k in range(3):
            lanes[k, l] = r[i, k] + u[i, k]
        for k in range(3, 10):
            lanes[k, l] = 0.0
    for j in range(waves.shape[0]):
        A, w, kx, ky, phase = waves[j, 0], waves[j, 1], waves[j, 2], waves[j, 3], waves[j, 4]
        phase -= w * sea.now[0]
        for l in range(LANES):
            lanes[10 + 2 * j, l], lanes[11 + 2 * j, l] = cos_sin(kx * lanes[0, l] + ky * lanes[1, l] + phase)
        for l in range(LANES):  # by itself: with a sum in the loop above, that is not made of vector instructions
            lanes[3, l] += A * lanes[10 + 2 * j, l]
    for l in range(LANES):
        eta = part * lanes[3, l]
        # Wheeler: the surface keeps what linear theory has at z = 0, the bed what it has there
        up = sea.stretched * eta
        s = min(lanes[2, l] - sea.surface, eta) - up
        if sea.depth < math.inf:
            s = max(s * sea.depth / (sea.depth + up), -sea.depth)
        lanes[2, l], lanes[3, l] = s, eta


@inner
def update_waves(sea):
    """Rows 4 to 9 of sea.lanes: velocity and acceleration of the fully grown waves."""
    lanes, waves = sea.lanes, sea.waves
    highest = -math.inf
    for l in range(LANES):
        highest = max(highest, lanes[2, l])
    for j in range(waves.shape[0]):
        w, k = waves[j, 1], waves[j, 5]
        if k * highest < LAST:
            continue
        q = math.exp(-2.0 * k * sea.depth) if sea.depth < math.inf else 0.0
        speed, towards_x, towards_y = sea.orbits[j] / (1.0 - q), waves[j, 2] / k, waves[j, 3] / k
        for l in range(LANES):
            y = k * lanes[2, l]
            fade = exp_of_small(max(y, LAST))
            here = speed if y >= LAST else 0.0
            level, up = here * (fade + q / fade), here * (fade - q / fade)
            c, s = lanes[10 + 2 * j, l], lanes[11 + 2 * j, l]
            lanes[4, l] += towards_x * level * c
            lanes[5, l] += towards_y * level * c
            lanes[6, l] += up * s
            lanes[7, l] += towards_x * w * level * s
            lanes[8, l] += towards_y * w * level * s
            lanes[9, l] -= w * up * c


@inner
def still_below(sea):
    """Height below which all components have faded, whatever the elevation is.

    Depths after Wheeler, d (z - eta)/(d + eta) below still water, are highest in the lowest trough: below z + sum |A|.
    """
    least, highest = math.inf, 0.0
    for j in range(sea.waves.shape[0]):
        least = min(least, sea.waves[j, 5])
        highest += abs(sea.waves[j, 0])
    return sea.surface + LAST / least - highest


@linked_kernel(lambda: (no_sea(1), ROWS, ROWS))
def wave_kinematics(sea, r, u):
    """Fill sea.flow: velocity and acceleration of the waves at the positions r + u, and the elevation above them.

    Where all components have faded it is still water; the elevation, by which only what is near it knows, is left out.

    A component is A cos(kx x + ky y - w t + phase) at the surface; everything is multiplied by the grown part of the
    sea, sea.now[2], and its rate of growth sea.now[3] counts in the acceleration.
    """
    part, rate = sea.now[2], sea.now[3]
    lanes, flow, calm = sea.lanes, sea.flow, still_below(sea)
    for first in range(0, flow.shape[0], LANES):
        deep = True
        for i in range(first, min(first + LANES, flow.shape[0])):
            deep = deep and r[i, 2] + u[i, 2] < calm
            for k in range(7):
                flow[i, k] = 0.0
        if deep:
            continue
        elevate(sea, r, u, first)
        update_waves(sea)
        for i in range(first, min(first + LANES, flow.shape[0])):
            l = i - first
            for k in range(3):
                flow[i, k] = part * lanes[4 + k, l]
                flow[i, 3 + k] = part * lanes[7 + k, l] + rate * lanes[4 + k, l]
            flow[i, 6] = lanes[3, l]


@inner
def wetted(x):
    """Wetted part of a point with wetness coordinate x, its antiderivative and its derivative."""
    if x <= 0.0:
        return 0.0, 0.0, 0.0
    if x >= 1.0:
        return 1.0, x - 0.5, 0.0
    return x * x * (3.0 - 2.0 * x), x * x * x * (1.0 - 0.5 * x), 6.0 * x * (1.0 - x)


@inner
def wetted_stretch(xa, xb):
    """Wetted part of a straight stretch between wetness coordinates xa and xb, and its derivatives by both."""
    ga, Ga, _ = wetted(xa)
    gb, Gb, _ = wetted(xb)
    q = xb - xa
    if abs(q) < SAME_WETNESS:
        g, _, h = wetted(0.5 * (xa + xb))
        return g, 0.5 * h, 0.5 * h
    W = (Gb - Ga) / q
    return W, (W - ga) / q, (gb - W) / q


@inner
def half_cell_drag(u, d, il, cn, ct):
    """Drag force on one half cell, B = df/du and L = df/de."""
    ut, un, square = split(u, d)
    s = np.sqrt(square)
    a = ut if ut.real > 0.0 else -ut  # |ut|
    i = 1.0 / s if s.real > 0.0 else 0.0 * s
    f, p, q = half_cell(ut, un, a, s, d, cn, ct)

    # df/du = -cn (|un| P + un un^T/|un|) - 2 ct |ut| d d^T; products that appear twice are written once
    c1, c2, c3 = -p, -cn * i, p - 2.0 * ct * a
    x, y, z = c2 * un[0], c2 * un[1], c2 * un[2]
    dx, dy, dz = c3 * d[0], c3 * d[1], c3 * d[2]
    xy, xz, yz = x * un[1] + dx * d[1], x * un[2] + dx * d[2], y * un[2] + dy * d[2]
    B = stack(
        (c1 + x * un[0] + dx * d[0], xy, xz),
        (xy, c1 + y * un[1] + dy * d[1], yz),
        (xz, yz, c1 + z * un[2] + dz * d[2]),
    )

    # df/de = (1/l) { cn [|un| (d un^T + ut P) + (ut/|un|) un un^T] - ct [2 |ut| d un^T + |ut| ut P] }
    b1, b2, b3 = il * (p * ut - q), il * (p - 2.0 * ct * a), il * cn * ut * i
    x, y, z = b2 * un[0] - b1 * d[0], b2 * un[1] - b1 * d[1], b2 * un[2] - b1 * d[2]  # beside d
    ux, uy, uz = b3 * un[0], b3 * un[1], b3 * un[2]
    L = stack(
        (b1 + d[0] * x + ux * un[0], d[0] * y + ux * un[1], d[0] * z + ux * un[2]),
        (d[1] * x + uy * un[0], b1 + d[1] * y + uy * un[1], d[1] * z + uy * un[2]),
        (d[2] * x + uz * un[0], d[2] * y + uz * un[1], b1 + d[2] * z + uz * un[2]),
    )
    return f, B, L


@inner
def half_cell_added_mass(vd, d, il, an, at, ca):
    """Inertia of the water carried along: f = -an P vd - at d (d.vd), D = ca df/dvd, L = df/de."""
    t = vd[0] * d[0] + vd[1] * d[1] + vd[2] * d[2]
    n = (vd[0] - t * d[0], vd[1] - t * d[1], vd[2] - t * d[2])
    f = (-an * n[0] - at * t * d[0], -an * n[1] - at * t * d[1], -an * n[2] - at * t * d[2])
    c1, c2 = -ca * an, ca * (an - at)
    x, y, z = c2 * d[0], c2 * d[1], c2 * d[2]
    xy, xz, yz = x * d[1], x * d[2], y * d[2]
    D = (c1 + x * d[0], xy, xz, xy, c1 + y * d[1], yz, xz, yz, c1 + z * d[2])
    b = il * (an - at)
    bt = b * t
    x, y, z = b * n[0] - bt * d[0], b * n[1] - bt * d[1], b * n[2] - bt * d[2]
    L = stack(
        (bt + d[0] * x, d[0] * y, d[0] * z),
        (d[1] * x, bt + d[1] * y, d[1] * z),
        (d[2] * x, d[2] * y, bt + d[2] * z),
    )
    return f, D, L


@inner
def body_drag(u, c):
    """Drag of a body without direction, f = -c |u| u, and B = df/du."""
    s = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    q = -c / s if s.real > 0.0 else 0.0 * s
    f, p = body(u, s, c)
    return f, stack(
        (p + q * u[0] * u[0], q * u[0] * u[1], q * u[0] * u[2]),
        (q * u[1] * u[0], p + q * u[1] * u[1], q * u[1] * u[2]),
        (q * u[2] * u[0], q * u[2] * u[1], p + q * u[2] * u[2]),
    )


# Columns of a piece; places and directions in axes of the body, motion of the water.
MIDDLE = 0  # 3, m
ALONG = 3  # 3, direction
CN = 6  # coefficients of drag across,
CT = 7  # and along,
CM = 8  # and of inertia
WET = 9  # wetted part
WATER = 10  # 3, its velocity, m/s
PUSH = 13  # 3, its acceleration, m/s2
PIECE = 16


class PieceForce(NamedTuple):
    """Force f, N, on a piece, and the parts of its derivative by u: -p (1 - d d^T) - q un un^T - s d d^T."""

    f: Any
    un: Any
    p: float
    q: float
    s: float


@inner
def piece_force(row, o, d, u):
    """`PieceForce` on the piece at o of a row, direction d, relative velocity u (inertial)."""
    w, cn, ct = row[o + WET], row[o + CN], row[o + CT]
    ut = dot(d, u)
    un = sub(u, scale(ut, d))
    size, a = math.sqrt(dot(un, un)), vector(row, o + PUSH)
    push = scale(row[o + CM], sub(a, scale(dot(d, a), d)))
    f = sub(scale(w, push), add(scale(w * cn * size, un), scale(w * ct * abs(ut) * ut, d)))
    q = w * cn / size if size > 0.0 else 0.0
    return PieceForce(f, un, w * cn * size, q, 2.0 * w * ct * abs(ut))


@inner
def piece_change(force, c, d, u, a, du, turn):
    """Change of the `PieceForce` of a piece by du and by a turn of its direction, inertial; c: w cm, a: of the water."""
    f, un, p, q, s = force
    dv = sub(du, cross(turn, u))  # as seen from the piece
    t = dot(d, dv)
    n = sub(dv, scale(t, d))
    da = cross(a, turn)
    push = scale(c, sub(da, scale(dot(d, da), d)))
    drag = add(scale(p, n), add(scale(q * dot(un, n), un), scale(s * t, d)))
    return add(cross(turn, f), sub(push, drag))


@inner
def members_force(row, first, count, R, v, spin):
    """Force and moment about the origin of a body of all its pieces, and their power; spin: inertial."""
    F, M, power = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    for k in range(count):
        o = first + PIECE * k
        arm, d = mat_vec(R, vector(row, o + MIDDLE)), mat_vec(R, vector(row, o + ALONG))
        here = add(v, cross(spin, arm))
        f = piece_force(row, o, d, sub(here, vector(row, o + WATER))).f
        F, M, power = add(F, f), add(M, cross(arm, f)), power + dot(f, here)
    return F, M, power


@inner
def members_change(row, first, count, R, v, spin, dv, dspin, turn):
    """Change of force and moment by changes of velocity and spin (inertial) and a turn; the water stays as it is."""
    dF, dM = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(count):
        o = first + PIECE * k
        arm, d = mat_vec(R, vector(row, o + MIDDLE)), mat_vec(R, vector(row, o + ALONG))
        darm = cross(turn, arm)
        u = sub(add(v, cross(spin, arm)), vector(row, o + WATER))
        force = piece_force(row, o, d, u)
        du, c, a = (
            add(dv, add(cross(dspin, arm), cross(spin, darm))),
            row[o + WET] * row[o + CM],
            vector(row, o + PUSH),
        )
        df = piece_change(force, c, d, u, a, du, turn)
        dF, dM = add(dF, df), add(dM, add(cross(darm, force.f), cross(arm, df)))
    return dF, dM


# --- vortices ----------------------------------------------------------------------------------

# Columns of Line.wake_law: lift of the half cells before and after a node, rho/2 D Cv h/2 (kg/m); diameter (m; 0: there
# are no vortices); frequencies; time over which the lift grows (s); phase at the start (rad).
LIFT_A, LIFT_B, DIAMETER, CENTER, LOW, HIGH, RAMP, OFFSET = range(8)
# Columns of State.wake: phase since the start (rad); means of v^2 and a^2; cosine of the phase, as far as lift has grown.
PHASE, MEAN_V, MEAN_A, SHARE = range(4)
# Periods of shedding, of the frequency USUAL |u|/D, over which means are taken.
PERIODS, USUAL = 8.0, 0.17
# Of the speed of the flow: a motion far below it has no phase, or round-off would decide how vortices begin.
STILL, LEAST = 1e-3, 0.1

Z3 = (0.0, 0.0, 0.0)
Z9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CHORD = Chord(Z3, 0.0, 0.0)


@inner
def mean_direction(e, i):
    """Direction of the line at node i: the mean of the chords beside it."""
    n = e.shape[0]
    a, _, _ = chord(get3(e, max(i - 1, 0)))
    b, _, _ = chord(get3(e, min(i, n - 1)))
    t = add(a, b)
    size = math.sqrt(dot(t, t))
    return scale(1.0 / size, t) if size > 1e-9 else b


@inner
def relative_velocity(line, sea, i, z, v):
    """Velocity of node i at height z relative to the water, and the slope of the current by height."""
    u, slope = v, (0.0, 0.0, 0.0)
    if line.bits & FLOW:
        U, slope = current_at(sea.z, sea.current, sea.now[1], z)
        u = sub(u, U)
    if line.bits & WAVES:
        u = sub(u, get3(sea.flow, i))
    return u, slope


@inner
def frequency(law, i, phase, v, a, mean_v, mean_a, speed):
    """Frequency of shedding as a part of |u|/D, by how the motion and the lift are in phase."""
    usual = 2.0 * math.pi * law[i, CENTER] * speed / law[i, DIAMETER]  # 1/s
    x = v / max(math.sqrt(mean_v), STILL * speed)
    y = -a / max(math.sqrt(mean_a), STILL * speed * usual)
    S = (y * math.cos(phase) - x * math.sin(phase)) / max(math.sqrt(x * x + y * y), LEAST)
    return law[i, CENTER] + S * (law[i, HIGH] - law[i, CENTER] if S > 0.0 else law[i, CENTER] - law[i, LOW])


@linked_kernel(in_sea(blank_state(1), blank_state(1), 0.0))
def advance_wake(line, sea, old, new, dt):
    """Phases and means after a step of dt (s) from `old`, into new.wake."""
    law = line.wake_law
    for i in range(law.shape[0]):
        for k in range(4):
            new.wake[i, k] = old.wake[i, k]
        D = law[i, DIAMETER]
        if not D > 0.0:
            continue
        d, v = mean_direction(old.e, i), get3(old.v, i)
        u, _ = relative_velocity(line, sea, i, old.r[i, 2], v)
        _, un, square = split(u, d)
        speed = math.sqrt(square)
        if speed > 0.0:
            e = scale(1.0 / speed, cross(d, un))
            along, gains = dot(v, e), dot(get3(old.vd, i), e)
            part = -math.expm1(-dt * USUAL * speed / (PERIODS * D))
            mean_v = old.wake[i, MEAN_V] + part * (along * along - old.wake[i, MEAN_V])
            mean_a = old.wake[i, MEAN_A] + part * (gains * gains - old.wake[i, MEAN_A])
            f = frequency(law, i, old.wake[i, PHASE] + law[i, OFFSET], along, gains, mean_v, mean_a, speed)
            new.wake[i, PHASE] = old.wake[i, PHASE] + dt * 2.0 * math.pi * f * speed / D
            new.wake[i, MEAN_V], new.wake[i, MEAN_A] = mean_v, mean_a
        x = min(sea.now[0] / law[i, RAMP], 1.0) if law[i, RAMP] > 0.0 else 1.0
        grown = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        new.wake[i, SHARE] = grown * math.cos(new.wake[i, PHASE] + law[i, OFFSET])


@inner
def half_cell_lift(u, d, il, c):
    """f = c |un| d x u on half a cell, B = df/du and L = df/de."""
    ut, un, square = split(u, d)
    s = math.sqrt(square)
    i = 1.0 / s if s > 0.0 else 0.0
    across = cross(d, u)
    B = madd(outer(scale(c * i, across), un), mscale(c * s, hat(d)))
    L = madd(outer(scale(c * i * ut, across), un), mscale(c * s, mat_mat(hat(u), project(d))))
    return scale(c * s, across), B, mscale(-il, L)


@inner
def lift_on(line, sea, i, side, z, u, slope, c, near, cv):
    """The lift on the half cell beside node i on a side (-1, 1): f, D (dr_i), L (chord)."""
    d, l, il = near
    f, B, L = half_cell_lift(u, d, il, c)
    D = mscale(cv, B)
    if line.bits & FLOW:
        g = mat_vec(B, slope)
        D = msub(D, (0.0, 0.0, g[0], 0.0, 0.0, g[1], 0.0, 0.0, g[2]))
    if line.bits & SURFACE:  # how the wetted part changes is left out: it is as slow as the line rises
        cell = i - 1 if side < 0.0 else i
        eta = sea.surface + (sea.flow[i, 6] if line.bits & WAVES else 0.0)
        x = (eta - z) / line.diameter[cell] + 0.5
        wet, _, _ = wetted_stretch(x, x - side * 0.5 * l * d[2] / line.diameter[cell])
        return scale(wet, f), mscale(wet, D), mscale(wet, L)
    return f, D, L


@linked_kernel(in_sea(0, 0.0, blank_state(1), CHORD, CHORD, 0.0, np.zeros(REPORT_SIZE)), (Z3, Z9, Z9, Z9))
def lift_at(line, sea, i, z, state, before, after, cv, report):
    """The lift on node i: F, and its derivatives D (dr_i), GL, GR (chord before, after); its work is booked with drag."""
    law, share, v = line.wake_law, state.wake[i, SHARE], get3(state.v, i)
    F, D, GL, GR = Z3, Z9, Z9, Z9
    u, slope = relative_velocity(line, sea, i, z, v)
    if i > 0 and law[i, LIFT_A] > 0.0:
        F, D, GL = lift_on(line, sea, i, -1.0, z, u, slope, share * law[i, LIFT_A], before, cv)
    if i < line.h.shape[0] and law[i, LIFT_B] > 0.0:
        f, Df, GR = lift_on(line, sea, i, 1.0, z, u, slope, share * law[i, LIFT_B], after, cv)
        F, D = add(F, f), madd(D, Df)
    report[DRAG_POWER] -= dot(F, v)
    return F, D, GL, GR
