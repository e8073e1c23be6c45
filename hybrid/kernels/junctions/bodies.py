"""Rigid bodies that lines are joined to: momentum, hydrostatics, and generalized-alpha on rotations (docs/theory.md, 18).

A body moves by its origin r and its frame R (columns: axes of the body, inertial); omega is in its own axes, and a
correction (dr, dtheta) is inertial: R becomes exp([dtheta]x) R.  In a step R' = R exp([n]x), and n is for omega what
the displacement u is for v.  Momentum p = M nu with nu = (R^T v, omega) and M all of mass, inertia and added mass:

    force   R (p1' + omega x p1 + (B nu)_1),    moment about the origin   R (p2' + omega x p2 + nu1 x p1 + (B nu)_2).

Numbers of a body stand in rows of arrays: its state, what it is, and what is worked in.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    hat,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    mat_mat,
    mat_vec,
    matrix,
    outer,
    put,
    put_matrix,
    scale,
    stack,
    sub,
    vec_mat,
    vector,
)
from hybrid.kernels.laws.water import (
    ALONG,
    MIDDLE,
    PUSH,
    WATER,
    WET,
    current_at,
    members_change,
    members_force,
    wave_kinematics,
)
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.state import Floats, Rows, Sea, blanks

# Numbers of a state; the motion of the origin, m, then that of the rotation, rad.
PLACE = 0  # 3, origin, m
FRAME = 3  # 9
V = 12  # 3, velocity
A = 15  # 3, algorithmic acceleration
VD = 18  # 3, true acceleration
W = 21  # 3, the same of the rotation
WA = 24  # 3
WD = 27  # 3
STATE = 30
# Numbers of a body.
MASS = 0  # 36, matrix
DAMPING = 36  # 36, matrix
LIFT = 72  # weight less buoyancy upwards, N
ARM = 73  # 3, of it, N m
LEVEL = 76  # height at which it floats, m
STIFFNESS = 77  # 3, of heave, roll and pitch
FORCE = 80  # 3, on it (inertial), N
MOMENT = 83  # 3, on it (inertial), N m
PIECES = 86  # number of pieces of its members, which follow (kernels.laws.water)
NUMBERS = 87
# Numbers that are worked in.
U = 0  # 3, displacement, m
N = 3  # 3, rotation vector
START = 6  # 9, frame at the start of the step
X = 15  # 6, correction
OWN = 21  # 6, force and moment of all but the lines
LINES = 27  # 6, of the lines
KINETIC = 33  # energy, J
POTENTIAL = 34  # energy, J
POWER = 35  # 3, of the lines, of damping and of prescribed loads, W
BEFORE = 38  # 3, the same before the step
DONE = 41  # 3, their work, J
SPRING = 44  # against turns in the equations alone, N m/rad
WORK = 45
# The spring of a body at first, as a part of its stiffest turn.  A turn that nothing holds would else follow the
# round-off of moments; one that is held as softly as 1e-4 of the stiffest converges by four digits an iteration still.
SOFTEST = 1e-8
VERTICAL = (0.0, 0.0, 1.0)


@inner
def rotation(n):
    """exp([n]x)."""
    q2 = dot(n, n)
    q = math.sqrt(q2)
    if q < 1e-4:
        a, b = 1.0 - q2 / 6.0, 0.5 - q2 / 24.0
    else:
        a, b = math.sin(q) / q, 2.0 * (math.sin(0.5 * q) / q) ** 2
    S, D = hat(n), outer(n, n)
    c = 1.0 - b * q2
    return stack(
        (c + b * D[0], a * S[1] + b * D[1], a * S[2] + b * D[2]),
        (a * S[3] + b * D[3], c + b * D[4], a * S[5] + b * D[5]),
        (a * S[6] + b * D[6], a * S[7] + b * D[7], c + b * D[8]),
    )


@inner
def row_times(row, o, x, y):
    """Six numbers of a row times (x, y)."""
    return dot(vector(row, o), x) + row[o + 3] * y[0] + row[o + 4] * y[1] + row[o + 5] * y[2]


@inner
def times(row, o, x, y):
    """The 6 x 6 matrix at o of a row times (x, y), as two vectors."""
    force = (row_times(row, o, x, y), row_times(row, o + 6, x, y), row_times(row, o + 12, x, y))
    return force, (row_times(row, o + 18, x, y), row_times(row, o + 24, x, y), row_times(row, o + 30, x, y))


@inner
def own_force(body, old, new, work):
    """Force and moment about the origin of all but the lines, and energies and powers that go with them, into `work`."""
    R, w = matrix(new, FRAME), vector(new, W)
    nu = vec_mat(vector(new, V), R)
    rate = sub(vec_mat(vector(new, VD), R), cross(w, nu))
    p1, p2 = times(body, MASS, nu, w)
    q1, q2 = times(body, MASS, rate, vector(new, WD))
    b1, b2 = times(body, DAMPING, nu, w)
    f = add(add(q1, cross(w, p1)), b1)
    m = add(add(add(q2, cross(w, p2)), cross(nu, p1)), b2)
    height = old[PLACE + 2] + work[U + 2] - body[LEVEL]
    t, arm = vec_mat(VERTICAL, R), mat_vec(R, vector(body, ARM))
    h = cross((-body[STIFFNESS + 2] * t[0], -body[STIFFNESS + 1] * t[1], 0.0), t)
    F = add(vector(body, FORCE), (0.0, 0.0, body[LIFT] - body[STIFFNESS] * height))
    M = add(vector(body, MOMENT), add(cross(arm, VERTICAL), mat_vec(R, h)))
    spin, wet = mat_vec(R, w), 0.0
    if body[PIECES] > 0.0:
        by, about, wet = members_force(body, NUMBERS, int(body[PIECES]), R, vector(new, V), spin)
        F, M = add(F, by), add(M, about)
    put(work, OWN, sub(F, mat_vec(R, f)))
    put(work, OWN + 3, sub(M, mat_vec(R, m)))
    work[KINETIC] = 0.5 * (dot(nu, p1) + dot(w, p2))
    work[POTENTIAL] = (
        0.5 * body[STIFFNESS] * height * height
        - body[LIFT] * (old[PLACE + 2] + work[U + 2])
        - arm[2]
        + 0.5 * (body[STIFFNESS + 2] * t[0] * t[0] + body[STIFFNESS + 1] * t[1] * t[1])
    )
    work[POWER] = dot(vector(work, LINES), vector(new, V)) + dot(vector(work, LINES + 3), spin)
    work[POWER + 1] = wet - dot(b1, nu) - dot(b2, w)
    work[POWER + 2] = dot(vector(body, FORCE), vector(new, V)) + dot(vector(body, MOMENT), spin)


@inner
def own_change(body, new, work, dr, turn, cv, ca):
    """Change of `own_force` by a shift and a turn (inertial) of the body, as two vectors."""
    R, w, v = matrix(new, FRAME), vector(new, W), vector(new, V)
    n = vector(work, N)
    g, _ = jacobian_functions(dot(n, n))
    dn = mat_vec(inverse_left_jacobian(n, g), vec_mat(turn, matrix(work, START)))
    nu = vec_mat(v, R)
    dnu = vec_mat(add(scale(cv, dr), cross(v, turn)), R)
    dw = scale(cv, dn)
    rate = sub(vec_mat(vector(new, VD), R), cross(w, nu))
    drate = vec_mat(add(scale(ca, dr), cross(vector(new, VD), turn)), R)
    drate = sub(drate, add(cross(dw, nu), cross(w, dnu)))
    p1, p2 = times(body, MASS, nu, w)
    d1, d2 = times(body, MASS, dnu, dw)
    q1, q2 = times(body, MASS, rate, vector(new, WD))
    e1, e2 = times(body, MASS, drate, scale(ca, dn))
    b1, b2 = times(body, DAMPING, nu, w)
    c1, c2 = times(body, DAMPING, dnu, dw)
    f = add(add(q1, cross(w, p1)), b1)
    m = add(add(add(q2, cross(w, p2)), cross(nu, p1)), b2)
    df = add(add(e1, c1), add(cross(dw, p1), cross(w, d1)))
    dm = add(add(e2, c2), add(cross(dw, p2), cross(w, d2)))
    dm = add(dm, add(cross(dnu, p1), cross(nu, d1)))
    t, dt = vec_mat(VERTICAL, R), vec_mat(cross(VERTICAL, turn), R)
    roll, pitch = body[STIFFNESS + 1], body[STIFFNESS + 2]
    a, da = (-pitch * t[0], -roll * t[1], 0.0), (-pitch * dt[0], -roll * dt[1], 0.0)
    h, dh = cross(a, t), add(cross(da, t), cross(a, dt))
    dF = sub((0.0, 0.0, -body[STIFFNESS] * dr[2]), add(mat_vec(R, df), cross(turn, mat_vec(R, f))))
    dM = cross(cross(turn, mat_vec(R, vector(body, ARM))), VERTICAL)
    dM = add(dM, add(mat_vec(R, dh), cross(turn, mat_vec(R, h))))
    if body[PIECES] > 0.0:
        spin = mat_vec(R, w)
        dspin = add(cross(turn, spin), mat_vec(R, dw))
        by, about = members_change(
            body, NUMBERS, int(body[PIECES]), R, vector(new, V), spin, scale(cv, dr), dspin, turn
        )
        dF, dM = add(dF, by), add(dM, about)
    return dF, sub(dM, add(mat_vec(R, dm), cross(turn, mat_vec(R, m))))


@inner
def add_own(network, at, m, cv, ca):
    """Forces of the bodies themselves into the equations A (m rows) of their places, from row `at` on.

    Those of `own_force` are known.
    """
    bodies, new, work, A = network.bodies, network.new, network.work, network.A
    for b in range(bodies.shape[0]):
        first = at + 6 * b
        for c in range(6):
            unit = (1.0 if c % 3 == 0 else 0.0, 1.0 if c % 3 == 1 else 0.0, 1.0 if c % 3 == 2 else 0.0)
            dr, turn = unit, (0.0, 0.0, 0.0)
            if c >= 3:
                dr, turn = (0.0, 0.0, 0.0), unit
            F, M = own_change(bodies[b], new[b], work[b], dr, turn, cv, ca)
            for k in range(3):
                A[first + k, first + c] += F[k]
                A[first + 3 + k, first + c] += M[k]
        for k in range(3):
            A[first + 3 + k, first + 3 + k] -= work[b, SPRING]
        for k in range(6):
            A[first + k, m] -= work[b, OWN + k]


@inner
def start_here(old, work):
    """A solution begins at the states as they are."""
    for b in range(old.shape[0]):
        put(work[b], U, (0.0, 0.0, 0.0))
        put(work[b], N, (0.0, 0.0, 0.0))
        put_matrix(work[b], START, matrix(old[b], FRAME))
        work[b, SPRING] = 0.0


@inner
def hold_turns(work, A, at):
    """Springs as weak as SOFTEST against turns of bodies, into the equations A of their places, from row `at` on.

    In the equations alone, not in what is out of balance: they change the way to an equilibrium, and nothing in it.
    """
    for b in range(work.shape[0]):
        first, stiffest = at + 6 * b + 3, 0.0
        for k in range(3):
            stiffest = max(stiffest, abs(A[first + k, first + k]))
        work[b, SPRING] = SOFTEST * stiffest
        for k in range(3):
            A[first + k, first + k] -= work[b, SPRING]


@inner
def adapt_springs(work, strength, turn, most):
    """The strength of springs that hold bodies, after a correction by a turn, rad.

    Stronger where a body was to turn by more than ten times `most`, rad, which is as far as it may, so that what hardly
    resists does not keep all else from moving; where it turns by little, weaker, down to strength 1.
    """
    new = strength
    if turn > 10.0 * most:
        new = 10.0 * strength * min(turn / most, 1e12)
    elif turn < 0.1 * most:
        new = max(0.01 * strength, 1.0)
    for b in range(work.shape[0]):
        work[b, SPRING] *= new / strength
    return new


@inner
def predict_bodies(old, new, work, s):
    """Predict a step with the algorithmic accelerations kept; the largest turn, rad, and its body."""
    dt, am, af, _, be, _, ca = s
    turn, worst = 0.0, -1
    start_here(old, work)
    for b in range(old.shape[0]):
        x, y, z = old[b], new[b], work[b]
        for k in range(3):
            for o, v, a, vd in ((U, V, A, VD), (N, W, WA, WD)):
                acceleration = x[a + k]
                z[o + k] = dt * x[v + k] + 0.5 * dt * dt * acceleration
                y[v + k] = x[v + k] + dt * acceleration
                y[vd + k] = (am * acceleration - af * x[vd + k]) / (1.0 - af) + ca * be * dt * dt * acceleration
        n = vector(z, N)
        put_matrix(y, FRAME, mat_mat(matrix(x, FRAME), rotation(n)))
        size = math.sqrt(dot(n, n))
        if not size <= turn:
            turn, worst = size, b
    return turn, worst


@inner
def move_bodies(new, work, cv, ca, part):
    """Apply a part of the corrections."""
    for b in range(new.shape[0]):
        y, z = new[b], work[b]
        dr, turn = scale(part, vector(z, X)), scale(part, vector(z, X + 3))
        put(z, U, add(vector(z, U), dr))
        put(y, V, add(vector(y, V), scale(cv, dr)))
        put(y, VD, add(vector(y, VD), scale(ca, dr)))
        R = mat_mat(rotation(turn), matrix(y, FRAME))
        S = matrix(z, START)
        n = log_rotation(mat_mat((S[0], S[3], S[6], S[1], S[4], S[7], S[2], S[5], S[8]), R))
        dn = sub(n, vector(z, N))
        put_matrix(y, FRAME, R)
        put(z, N, n)
        put(y, W, add(vector(y, W), scale(cv, dn)))
        put(y, WD, add(vector(y, WD), scale(ca, dn)))


@inner
def size_of_moves(work):
    """Largest shift (m) and turn (rad) of the corrections."""
    shift, turn = 0.0, 0.0
    for b in range(work.shape[0]):
        far = abs(work[b, X]) + abs(work[b, X + 1]) + abs(work[b, X + 2])
        angle = abs(work[b, X + 3]) + abs(work[b, X + 4]) + abs(work[b, X + 5])
        if not far <= shift:
            shift = far
        if not angle <= turn:
            turn = angle
    return shift, turn


@inner
def orthonormal(R):
    """A frame without the round-off that products of rotations have brought in."""
    x, y = (R[0], R[3], R[6]), (R[1], R[4], R[7])
    x = scale(1.0 / math.sqrt(dot(x, x)), x)
    y = sub(y, scale(dot(x, y), x))
    y = scale(1.0 / math.sqrt(dot(y, y)), y)
    z = cross(x, y)
    return (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])


@inner
def end_bodies(old, new, work, s):
    """Places and algorithmic accelerations after a step; its largest turn, rad."""
    dt, _, _, _, be, _, _ = s
    turn = 0.0
    for b in range(old.shape[0]):
        x, y, z = old[b], new[b], work[b]
        for k in range(3):
            y[PLACE + k] = x[PLACE + k] + z[U + k]
            y[A + k] = (z[U + k] - dt * x[V + k] - dt * dt * (0.5 - be) * x[A + k]) / (be * dt * dt)
            y[WA + k] = (z[N + k] - dt * x[W + k] - dt * dt * (0.5 - be) * x[WA + k]) / (be * dt * dt)
        n = vector(z, N)
        size = math.sqrt(dot(n, n))
        if size > 0.0:  # else to and fro by round-off
            put_matrix(y, FRAME, orthonormal(matrix(y, FRAME)))
        if not size <= turn:
            turn = size
    return turn


@inner
def book_bodies(work, dt):
    """Work of the powers in a step of dt, s; 0: powers from which a first step goes on."""
    for b in range(work.shape[0]):
        for k in range(3):
            if dt > 0.0:
                work[b, DONE + k] += 0.5 * dt * (work[b, BEFORE + k] + work[b, POWER + k])
            work[b, BEFORE + k] = work[b, POWER + k]


# The water around members of a body, before a try: it is taken where its velocity and acceleration at the start of the
# try lead it, so that a step has one water.


class MembersJob(NamedTuple):
    """Pieces of the members of a body, n of them."""

    sea: Sea  # with room for n places; at the time that is asked
    pieces: Rows  # (n, PIECE)
    sizes: Rows  # (n, 3) added mass across it (kg), length, diameter (m)
    places: Rows  # (n, 3) m, worked in
    still: Rows  # (n, 3) of zeros
    state: Floats  # (STATE,) of the body, from which it goes on
    dt: Floats  # (1,) s
    waves: Floats  # (1,) 1 where they count
    out: Rows  # (n, PIECE) of which wetness and water are written


blank_members_job = blanks(MembersJob)
read_members = reader(blank_members_job())


@kernel
def update_members(table):
    """Write how far the pieces of a body are wet, and the water around them."""
    job = read_members(table)
    sea, state, out, dt = job.sea, job.state, job.out, job.dt[0]
    R = matrix(state, FRAME)
    spin, shift = mat_vec(R, vector(state, W)), add(scale(dt, vector(state, V)), scale(0.5 * dt * dt, vector(state, A)))
    middle, waves = add(vector(state, PLACE), shift), sea.waves.shape[0] > 0 and job.waves[0] != 0.0
    for i in range(out.shape[0]):
        arm = mat_vec(R, vector(job.pieces[i], MIDDLE))
        place = add(middle, add(arm, scale(dt, cross(spin, arm))))
        job.places[i, 0], job.places[i, 1], job.places[i, 2] = place
    if waves:
        wave_kinematics(sea, job.places, job.still)
    for i in range(out.shape[0]):
        U, _ = current_at(sea.z, sea.current, sea.now[1], job.places[i, 2])
        level = sea.surface if abs(sea.surface) < math.inf else math.inf  # NaN: all is under water
        for k in range(3):
            out[i, WATER + k], out[i, PUSH + k] = U[k], 0.0
            if waves:
                out[i, WATER + k] += sea.flow[i, k]
                out[i, PUSH + k] = sea.flow[i, 3 + k]
        if waves:
            level += sea.flow[i, 6]
        up = min(abs(mat_vec(R, vector(job.pieces[i], ALONG))[2]), 1.0)
        high = up * job.sizes[i, 1] + math.sqrt(1.0 - up * up) * job.sizes[i, 2]
        out[i, WET] = min(max((level - job.places[i, 2]) / high + 0.5, 0.0), 1.0)
    return 0
