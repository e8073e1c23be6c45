"""Obstacles that a line touches, fixed or moving.

Of those that move, at the ends of a step:

    symbol   meaning                                                            shape  unit  frame
    c, R     place of an obstacle and its rotation since t = 0                  3, 9   m, -  inertial
    v, w     velocity of that place, and angular velocity                       3      m/s, 1/s
    x0, x    a point that goes with the obstacle, at the begin and the end of
             a step: x = c + R R0^T (x0 - c0)                                   3      m     inertial

An obstacle moves by a motion about its place, turns about its own axis by a spin, or is set from outside.  A spin
leaves the surface where it is, and carries along what rubs on it.

What d, n and K of each kind are is in kernels.laws.surfaces.  A cell presses on the obstacle as on the bed
(kernels.laws.seabed): the penetration is linear between its nodes, and the force per length has a potential.

    symbol   meaning                                                              shape  unit   frame
    d        distance of the centreline to the surface moved out by the radius
             of the strand                                                        -      m
    n        its gradient, the outward normal                                     3      -      inertial
    K        gradient of n                                                        9      1/m    inertial
    p        penetration, o/2 - d with o the onset of contact                     -      m
    N        force on a node along n                                              -      N
    q        elastic travel of friction: the way of the node along the surface    3      m      inertial

Friction acts on the centreline: mu N at most, against the travel, whatever its direction.  A node that touches several
fixed surfaces has one travel, of which each takes the part along itself; what is kept of it lies along all of them.
Where an obstacle moves every one has a travel of its own, which lies in it and turns with it.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    get3,
    madd,
    mat_mat,
    mat_vec,
    matrix,
    mscale,
    outer,
    put,
    put_matrix,
    scale,
    sub,
    vector,
)
from hybrid.kernels.laws.end_motion import (
    driven_frame,
    driven_position,
    frame_at,
    position_at,
    rise,
    rise_integral,
    turn_by_vector,
)
from hybrid.kernels.laws.seabed import bed_under, contact, depth_of, stored, with_cell
from hybrid.kernels.laws.surfaces import E9, Z3, Z9, bent, gradient_of_normal, is_far, surface
from hybrid.kernels.machine.compile import called, inner, kernel, linked_kernel
from hybrid.kernels.state.report import (
    AXIS,
    BEGAN,
    BOX,
    DAMPING,
    ENDED,
    FLAT,
    FRICTION,
    GROOVE,
    HALF_HEIGHT,
    HALF_LENGTH,
    INERTIA,
    KIND,
    MEETS_FROM,
    MEETS_TO,
    MESH,
    MU,
    OBSTACLE,
    OBSTACLES,
    OF_PIECE,
    ONSET_OF,
    PIECE_END,
    PLACE,
    RADIUS,
    RAMP,
    RATE,
    RIDES,
    RIM,
    RING,
    ROLLED,
    ROLLED_BEFORE,
    ROLLING,
    SEABED,
    SEEN_FORCE,
    SEEN_TURN,
    SHEAVE,
    SIDE,
    SLIP,
    SOIL,
    SPEED,
    STIFFNESS,
    STILL_AXIS,
    STILL_SIDE,
    STRAND,
    SWEEP,
    THINNER,
    TURNED,
    TURNING,
)
from hybrid.kernels.state.state import ROWS, Floats, Sea, in_sea, no_sea

PUSH = False, Z3, Z9, Z9, Z9  # an answer of `obstacle_forces`


@inner
def transposed(R):
    """The transpose of a matrix."""
    return R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8]


@called
def pose_at(t, k, sea, rolled):
    """c, v, R without spin, R, w of obstacle k at t (s); rolled: angle (rad) of one that turns freely."""
    moves = sea.courses
    x, v = vector(moves.position[k], 0), (0.0, 0.0, 0.0)
    if moves.prescribed[k, 0]:
        x, v = position_at(t, k, moves, sea)
    R, w = frame_at(t, k, moves)
    if moves.driven[k, 0]:
        x, v = driven_position(t, k, moves)
        R, w = driven_frame(t, k, moves)
    rate, ramp, whole = sea.carried[k, RATE], sea.carried[k, RAMP], R
    if rate != 0.0:
        a = vector(sea.carried[k], STILL_AXIS)
        angle = t
        if ramp > 0.0:
            angle = rise_integral(t, ramp)
        spun, _ = turn_by_vector(scale(rate * angle, a), (0.0, 0.0, 0.0))
        whole = mat_mat(R, spun)
        w = add(w, scale(rate * rise(t, ramp)[0], mat_vec(R, a)))
    if sea.carried[k, INERTIA] > 0.0:
        a = vector(sea.carried[k], STILL_AXIS)
        spun, _ = turn_by_vector(scale(rolled, a), (0.0, 0.0, 0.0))
        whole = mat_mat(R, spun)
        w = add(w, scale(sea.carried[k, ROLLING], mat_vec(R, a)))
    return x, v, R, whole, w


@linked_kernel(lambda: (0.0, 0.0, no_sea(1)))
def carry_obstacles(begin, end, sea):
    """Bring obstacles that move to where they are at `end` (s), and know where they were at `begin`.

    Those that bodies carry are where these are (kernels.junctions.body_contact).
    """
    for k in range(sea.carried.shape[0]):
        if sea.carried[k, RIDES] != 0.0:
            continue
        rolled = sea.carried[k, ROLLED]
        before = rolled
        if begin < end:
            before = sea.carried[k, ROLLED_BEFORE]
        c0, _, _, R0, _ = pose_at(max(begin, 0.0), k, sea, before)
        c, v, bare, R, w = pose_at(end, k, sea, rolled)
        put(sea.carried[k], BEGAN, c0)
        put(sea.carried[k], ENDED, c)
        put_matrix(sea.carried[k], SWEEP, mat_mat(R, transposed(R0)))
        put(sea.carried[k], SPEED, v)
        put(sea.carried[k], TURNING, w)
        put_matrix(sea.carried[k], TURNED, R)
        put(sea.obstacles[k], PLACE, c)
        put(sea.obstacles[k], AXIS, mat_vec(bare, vector(sea.carried[k], STILL_AXIS)))
        put(sea.obstacles[k], SIDE, mat_vec(bare, vector(sea.carried[k], STILL_SIDE)))


@inner
def surface_velocity(carried, k, x):
    """Velocity (m/s) of what goes with obstacle k at x, at the end of the step."""
    return add(vector(carried[k], SPEED), cross(vector(carried[k], TURNING), sub(x, vector(carried[k], ENDED))))


@inner
def swept(carried, k, x):
    """Where a point that goes with obstacle k has come in the step from x."""
    return add(vector(carried[k], ENDED), mat_vec(matrix(carried[k], SWEEP), sub(x, vector(carried[k], BEGAN))))


@inner
def way_with(carried, k, x, u):
    """Way of the surface of obstacle k under a node that has gone by u to x.

    The mean of that from where the node was and of that to where it is, which has no part across a surface that turns
    under a node at rest.
    """
    x0 = sub(x, u)
    back = mat_vec(transposed(matrix(carried[k], SWEEP)), sub(x, vector(carried[k], ENDED)))
    return scale(0.5, add(sub(swept(carried, k, x0), x0), sub(x, add(vector(carried[k], BEGAN), back))))


@inner
def way_along(carried, k, q, x, u):
    """Travel of a node against obstacle k after a step.

    Its travel q before the step, which turns with the obstacle, and its motion against the obstacle since; x: where it
    is, u: its displacement in the step.
    """
    return add(mat_vec(matrix(carried[k], SWEEP), q), sub(x, swept(carried, k, sub(x, u))))


@inner
def grip(t, n, K, N, mu, sl):
    """Friction on a node pressed by N after the way t: f, df/dN, df/dx, and the travel that is left after sliding.

    x: place of the node, with which t moves on and n turns by K dx.
    """
    w = dot(n, t)
    q = sub(t, scale(w, n))
    size = math.sqrt(dot(q, q))
    c = 1.0 / sl if size <= sl else 1.0 / size
    g = scale(-mu * c, q)
    # dq/dx = 1 - n (n + K t)^T - w K; beyond sl the direction of q alone counts
    A = madd(E9, mscale(-1.0, madd(outer(n, add(n, mat_vec(K, t))), mscale(w, K))))
    if size > sl:
        d = scale(c, q)
        A = madd(A, mscale(-1.0, outer(d, sub(d, scale(w, mat_vec(K, d))))))
        q = scale(sl * c, q)
    return scale(N, g), g, mscale(-mu * c * N, A), q


@inner
def thinner(line, rows, k, c):
    """By how much the radius of a line of several diameters is smaller at cell c than that of the strand, m."""
    at = OBSTACLE
    while at + OF_PIECE < rows.shape[1] and 0.5 * (line.s[c] + line.s[c + 1]) > rows[k, at + PIECE_END]:
        at += OF_PIECE
    return rows[k, at + THINNER] if at < rows.shape[1] else 0.0


@inner
def half_cell(line, sea, k, c, x, p, pd, e, v, cv):
    """Contact of half of cell c towards a neighbour at x + e with velocity v: N, dN/dp, dN/dpd, dN/d(place there).

    p, pd: penetration of the node at x, of a line as thick as the strand, and its rate.
    """
    rows, moves = sea.obstacles, line.moved.shape[0] > 0
    d, m, curved = surface(sea, k, add(x, e))
    o = rows[k, ONSET_OF]
    po = 0.5 * o - d
    if rows.shape[1] > OBSTACLE:
        thin = thinner(line, rows, k, c)
        p, po = p - thin, po - thin
    if not (p > 0.0 or po > 0.0):
        return 0.0, 0.0, 0.0, Z3
    if moves:
        v = sub(v, surface_velocity(sea.carried, k, add(x, e)))
    f, f0, f1, g0, g1 = contact(p, po, pd, -dot(m, v), line.h[c], rows[k, STIFFNESS], rows[k, DAMPING], o)
    slope = scale(-(f1 + cv * g1), m)
    if moves:
        slope = add(slope, scale(g1, cross(m, vector(sea.carried[k], TURNING))))
    if g1 != 0.0:
        slope = sub(slope, scale(g1, bent(curved, m, v)))
    return f, f0, g0, slope


@inner
def meets(line, sea, moves, k, c):
    """Whether cell c meets obstacle k: of a body that the line is fixed to only what is beyond the way out of it."""
    if moves:
        from_start, from_end = line.s[c] - line.s[0], line.s[line.h.shape[0]] - line.s[c + 1]
        return from_start >= sea.carried[k, MEETS_FROM] and from_end >= sea.carried[k, MEETS_TO]
    return True


@inner
def reach_of(sea, k, i, e):
    """Distance (m) from obstacle k beyond which node i and its neighbours do not touch.

    Neighbours are nearer to it by no more than their chord: the slope of a distance is 1.
    """
    longest = 0.0
    for c in range(max(i - 1, 0), min(i + 1, e.shape[0])):
        longest = max(longest, e[c, 0] * e[c, 0] + e[c, 1] * e[c, 1] + e[c, 2] * e[c, 2])
    return 0.5 * sea.obstacles[k, ONSET_OF] + math.sqrt(longest)


@inner
def normal_force(line, sea, moves, k, i, x, v, e, cv):
    """Force N with which obstacle k presses on node i at x, and its derivatives.

    N, whether it touches, n, curvature, and how N changes with x, and with the places of the neighbours before and after.
    """
    reach = reach_of(sea, k, i, e)
    if is_far(sea, k, x, reach):
        return 0.0, False, Z3, (0.0, Z3, 0.0), Z3, Z3, Z3
    d, n, curved = surface(sea, k, x)
    if d > reach:
        return 0.0, False, n, curved, Z3, Z3, Z3
    vi = get3(v, i)
    if moves:
        vi = sub(vi, surface_velocity(sea.carried, k, x))
    p, pd = 0.5 * sea.obstacles[k, ONSET_OF] - d, -dot(n, vi)
    N = DN = turned = 0.0
    L, R, dN = Z3, Z3, Z3
    if i > 0 and meets(line, sea, moves, k, i - 1):
        f, f0, g0, L = half_cell(line, sea, k, i - 1, x, p, pd, scale(-1.0, get3(e, i - 1)), get3(v, i - 1), cv)
        N, DN, dN = N + f, DN + f0 + cv * g0, add(dN, scale(-g0, bent(curved, n, vi)))
        turned += g0
    if i < line.h.shape[0] and meets(line, sea, moves, k, i):
        f, f0, g0, R = half_cell(line, sea, k, i, x, p, pd, get3(e, i), get3(v, i + 1), cv)
        N, DN, dN = N + f, DN + f0 + cv * g0, add(dN, scale(-g0, bent(curved, n, vi)))
        turned += g0
    dN = add(dN, scale(-DN, n))
    if moves:
        dN = add(dN, scale(turned, cross(n, vector(sea.carried[k], TURNING))))
    return N, N != 0.0 or DN != 0.0, n, curved, dN, L, R


@linked_kernel(in_sea(0, 0, Z3, ROWS, ROWS, ROWS, 0.0), PUSH)
def force_of_obstacle(line, sea, k, i, x, u, v, e, cv):
    """As `obstacle_forces`, of obstacle k alone, which moves: whether it touches, F, D, GL, GR."""
    N, touches, n, curved, dN, L, R = normal_force(line, sea, True, k, i, x, v, e, cv)
    F, D, slope = Z3, Z9, n
    if touches:
        K = gradient_of_normal(curved, n)
        F, D = scale(N, n), mscale(N, K)
        if line.bits & FRICTION and sea.obstacles[k, MU] > 0.0 and N > 0.0:
            t = way_along(sea.carried, k, vector(sea.grip[i], 6 * k), x, get3(u, i))
            f, g, Df, _ = grip(t, n, K, N, sea.obstacles[k, MU], sea.obstacles[k, SLIP])
            F, D, slope = add(F, f), madd(D, Df), add(n, g)
        D = madd(D, madd(outer(slope, dN), madd(outer(slope, L), outer(slope, R))))
    return touches, F, D, mscale(-1.0, outer(slope, L)), outer(slope, R)


@linked_kernel(in_sea(0, Z3, ROWS, ROWS, ROWS, 0.0), PUSH)
def obstacle_forces(line, sea, i, x, u, v, e, cv):
    """Contact and friction of obstacles at node i: whether there are any, F, D, GL, GR (chord before, after)."""
    rows = sea.obstacles
    F, D, GL, GR = Z3, Z9, Z9, Z9
    lies = False
    if line.bits & SEABED:
        lies = sea.bed[i, 0] != 0.0 or sea.bed[i, 1] != 0.0 or sea.bed[i, 2] != 0.0
    t = add(get3(sea.slip, i), get3(u, i))
    kept = get3(sea.slid, i) if lies else t
    touches, rubs, moves = False, False, line.moved.shape[0] > 0
    for k in range(rows.shape[0]):
        N, presses, n, curved, dN, L, R = normal_force(line, sea, moves, k, i, x, v, e, cv)
        if not presses:
            continue
        touches = True
        K = gradient_of_normal(curved, n)
        slope = n
        F, D = add(F, scale(N, n)), madd(D, mscale(N, K))
        if line.bits & FRICTION and rows[k, MU] > 0.0 and N > 0.0:
            if moves:
                t = way_along(sea.carried, k, vector(sea.grip[i], 6 * k), x, get3(u, i))
            f, g, Df, _ = grip(t, n, K, N, rows[k, MU], rows[k, SLIP])
            F, D, slope = add(F, f), madd(D, Df), add(n, g)
            if not moves:
                _, _, _, kept = grip(kept, n, K, N, rows[k, MU], rows[k, SLIP])
                rubs = True
        # the neighbours lie at x - e before and x + e after: what they add by x they add by the chords too
        before, after = outer(slope, L), outer(slope, R)
        D = madd(D, madd(outer(slope, dN), madd(before, after)))
        GL, GR = madd(GL, mscale(-1.0, before)), madd(GR, after)
    if not rubs and not lies:
        kept = Z3
    sea.slid[i, 0], sea.slid[i, 1], sea.slid[i, 2] = kept
    if not line.bits & SEABED:
        sea.bed[i, 0], sea.bed[i, 1], sea.bed[i, 2] = F
    elif touches:
        sea.bed[i, 0], sea.bed[i, 1], sea.bed[i, 2] = add(get3(sea.bed, i), F)
    return touches, F, D, GL, GR


@inner
def depth_in(sea, k, r, i):
    """p of node i in obstacle k."""
    d, _, _ = surface(sea, k, (r[i, 0], r[i, 1], r[i, 2]))
    return 0.5 * sea.obstacles[k, ONSET_OF] - d


@linked_kernel(in_sea(ROWS), 0.0)
def stored_on_obstacles(line, sea, r):
    """Energy (J) that obstacles have stored against the line."""
    rows, energy, moves = sea.obstacles, 0.0, line.moved.shape[0] > 0
    for k in range(rows.shape[0]):
        stiffness, o = rows[k, STIFFNESS], rows[k, ONSET_OF]
        far, p1 = is_far(sea, k, get3(r, 0), 0.5 * o), 0.0
        for i in range(line.h.shape[0]):
            before, far = far, is_far(sea, k, get3(r, i + 1), 0.5 * o)
            if before and far:
                continue
            p0 = depth_in(sea, k, r, i) if before or i == 0 else p1
            p1 = depth_in(sea, k, r, i + 1)
            thin = thinner(line, rows, k, i) if rows.shape[1] > OBSTACLE else 0.0
            if (p0 > thin or p1 > thin) and meets(line, sea, moves, k, i):
                energy = with_cell(energy, p0 - thin, p1 - thin, line.h[i], stiffness, o)
    return energy


@inner
def stored_in_contact(line, sea, r):
    """Energy (J) that the bed and obstacles have stored against the line."""
    energy = 0.0
    if line.bits & SEABED and not line.bits & SOIL:  # what soil takes up counts as lost
        energy = stored(line, sea, r)
    if line.bits & OBSTACLES:
        energy += stored_on_obstacles(line, sea, r)
    return energy


@inner
def depth_before(sea, k, r, i):
    """p of node i in obstacle k, which moves, both where they were before the step."""
    d, _, _ = surface(sea, k, swept(sea.carried, k, (r[i, 0], r[i, 1], r[i, 2])))
    return 0.5 * sea.obstacles[k, ONSET_OF] - d


@inner
def stored_along(line, sea, r, c, before):
    """Energy per length (J/m) that the bed and obstacles have stored against cell c.

    before: whether r, and what moves, are those before the step.
    """
    energy, moves = 0.0, line.moved.shape[0] > 0
    if line.bits & SEABED:
        p0, p1 = depth_of(sea, r, c), depth_of(sea, r, c + 1)
        if p0 > 0.0 or p1 > 0.0:
            energy = with_cell(energy, p0, p1, 1.0, sea.stiffness, sea.onset)
    if line.bits & OBSTACLES:
        rows = sea.obstacles
        for k in range(rows.shape[0]):
            thin = thinner(line, rows, k, c) if rows.shape[1] > OBSTACLE else 0.0
            if moves and before:
                p0, p1 = depth_before(sea, k, r, c), depth_before(sea, k, r, c + 1)
            else:
                p0, p1 = depth_in(sea, k, r, c), depth_in(sea, k, r, c + 1)
            p0, p1 = p0 - thin, p1 - thin
            if (p0 > 0.0 or p1 > 0.0) and meets(line, sea, moves, k, c):
                energy = with_cell(energy, p0, p1, 1.0, rows[k, STIFFNESS], rows[k, ONSET_OF])
    return energy


@kernel
def stored_energy(line, sea, r):
    """The same for Python."""
    return stored_in_contact(line, sea, r)


@inner
def normal_at(line, sea, x, of_bed):
    """Normal at x of what is pressed on most deeply there, the bed or an obstacle; of_bed: of the bed alone."""
    n, deep = bed_under(sea, x)
    if line.bits & OBSTACLES and not of_bed:
        return normal_of_obstacles(sea, x, n, deep if line.bits & SEABED else -math.inf)
    return n


@linked_kernel(lambda: (no_sea(1), Z3, Z3, 0.0), Z3)
def normal_of_obstacles(sea, x, n, deep):
    """Normal at x of the obstacle that is pressed on most deeply there; n where none is more deeply than `deep`, m."""
    for k in range(sea.obstacles.shape[0]):
        d, m, _ = surface(sea, k, x)
        p = 0.5 * sea.obstacles[k, ONSET_OF] - d
        if p > deep:
            n, deep = m, p
    return n


# Of the radius of a strand: how near to being too deep a way counts as too deep.
REACHED = 1e-3


@linked_kernel(in_sea(ROWS, ROWS), 0)
def passes(line, sea, r, u):
    """The first node that a step leads deeper into an obstacle than by the strand's radius, or through it; -1: none.

    r: (N+1, 3) m, before the step; u: its displacements.  Of an obstacle that moves: against it.
    """
    rows = sea.obstacles
    moves = line.moved.shape[0] > 0
    for i in range(u.shape[0]):
        x, y = get3(r, i), get3(u, i)
        for k in range(rows.shape[0]):
            if moves:  # as seen from the obstacle
                x = swept(sea.carried, k, get3(r, i))
                y = sub(add(get3(r, i), get3(u, i)), x)
            thin = 0.0
            if rows.shape[1] > OBSTACLE:  # of the thinner side
                thin = thinner(line, rows, k, max(i - 1, 0))
                thin = max(thin, thinner(line, rows, k, min(i, line.h.shape[0] - 1)))
            size, solid = math.sqrt(dot(y, y)), rows[k, STRAND] - thin
            if is_far(sea, k, x, size):
                continue
            before, _, _ = surface(sea, k, x)
            most = min(before, -thin) - solid
            way = before - most
            while way < size:  # d changes by no more than the way: nothing is missed between
                d, _, _ = surface(sea, k, add(x, scale(way / size, y)))
                if d - most < REACHED * solid:
                    return i
                way += d - most
    return -1


# --- for Python ---------------------------------------------------------------------------------------


@kernel
def find_distances(sea, x, out):
    """Distances (M, n) m of points x (n, 3) m to the surfaces of obstacles, moved out by the strand's radius."""
    for k in range(sea.obstacles.shape[0]):
        for i in range(x.shape[0]):
            out[k, i], _, _ = surface(sea, k, get3(x, i))


def distances(sea: Sea, x: Floats) -> Floats:
    """The same as an array."""
    out = np.empty((len(sea.obstacles), len(x)))
    if len(out):
        find_distances(sea, np.ascontiguousarray(x), out)
    return out


def put_obstacles(rows: Floats, carried: Floats, seen: Floats) -> None:
    """Rows (M, OBSTACLE) where obstacles were that move; carried: as of `Sea`; seen: (M, SEEN) of them then."""
    rows[:, PLACE : PLACE + 3] = seen[:, :SEEN_TURN]
    turn = seen[:, SEEN_TURN:SEEN_FORCE].reshape(-1, 3, 3)
    for at, still in ((AXIS, STILL_AXIS), (SIDE, STILL_SIDE)):
        rows[:, at : at + 3] = np.einsum("kij,kj->ki", turn, carried[:, still : still + 3])


# Parts of a chord at which its distance is looked at; of the radius of an obstacle, how deep a chord may cut it.
PARTS, CUTS = 8, 0.125


def half_thickness(rows: Floats) -> Floats:
    """Half of how thick (M,) m obstacles are with the radius of the strand where they are thinnest; planes: infinite."""
    of_box = rows[:, HALF_LENGTH : HALF_HEIGHT + 1].min(axis=1)
    found = rows[:, RADIUS] + np.where(np.isin(rows[:, KIND], (BOX, MESH)), of_box, 0.0)
    of_sheave = rows[:, GROOVE] + 2.0 * rows[:, RIM]
    found = np.where(rows[:, KIND] == SHEAVE, np.minimum(found, of_sheave), found)
    return np.where(rows[:, KIND] == FLAT, np.inf, found)


def bend_radii(rows: Floats) -> Floats:
    """Radii (M,) m to which obstacles bend the centreline of a line that lies on them; of planes 0 with the strand's."""
    return np.asarray(rows[:, RADIUS] + np.where(rows[:, KIND] == MESH, rows[:, RING], 0.0))


def cells_met(carried: Floats, s: Floats) -> Floats:
    """Whether (M, N) cells between nodes s (N+1,) m meet obstacles that move (carried: as of `Sea`), 1.0 or 0.0."""
    near, far = carried[:, MEETS_FROM, None], carried[:, MEETS_TO, None]
    return np.asarray((s[:-1] - s[0] >= near) & (s[-1] - s[1:] >= far), float)


def thinner_cells(rows: Floats, s: Floats) -> Floats:
    """By how much (N,) m the radius of cells between nodes s (N+1,) m is smaller than that of the strand."""
    if rows.shape[1] == OBSTACLE or not len(rows):
        return np.zeros(s.size - 1)
    ends, thinner = rows[0, OBSTACLE + PIECE_END :: OF_PIECE], rows[0, OBSTACLE + THINNER :: OF_PIECE]
    return np.asarray(thinner[np.minimum(np.searchsorted(ends, 0.5 * (s[:-1] + s[1:])), thinner.size - 1)])


def thinner_nodes(rows: Floats, s: Floats) -> Floats:
    """The same of nodes (N+1,), on their thicker side."""
    thin = thinner_cells(rows, s)
    return np.minimum(np.append(thin[:1], thin), np.append(thin, thin[-1:]))


def depths_in_obstacles(sea: Sea, r: Floats, s: Floats, met: Floats | None = None) -> Floats:
    """How deep (M, N+1) the nodes r (N+1, 3) m and the cells after them lie in obstacles, over what they may.

    s: (N+1,) m, of the nodes; met: (M, N) as of `cells_met`; None: all do.  Nodes: by the radius of the line; cells,
    whose ends may lie on an obstacle that they cut, by an eighth of its radius more.  Beyond 1 a line is in what is
    solid, or has passed through it.
    """
    rows = sea.obstacles
    thin = thinner_cells(rows, s)
    of_node = np.maximum(np.append(thin[:1], thin), np.append(thin, thin[-1:]))
    strand = rows[:, STRAND, None]
    found = (-distances(sea, r) - of_node) / (strand - of_node)
    x = np.linspace(0.0, 1.0, PARTS + 1)[1:-1, None, None]
    points = ((1.0 - x) * r[:-1] + x * r[1:]).reshape(-1, 3)
    within = -distances(sea, points).reshape(len(rows), PARTS - 1, len(r) - 1).max(axis=1) - thin
    cut = np.where(within > 0.0, within / (strand - thin + CUTS * rows[:, RADIUS, None]), -np.inf)
    if met is not None:
        cut = np.where(met > 0.0, cut, -np.inf)
        apart = np.zeros((len(rows), 1))
        found[np.append(met, apart, axis=1) + np.append(apart, met, axis=1) == 0.0] = -np.inf
    found[:, :-1] = np.maximum(found[:, :-1], cut)
    return np.asarray(found)
