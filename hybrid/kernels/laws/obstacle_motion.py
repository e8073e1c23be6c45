"""Obstacles that move: where they are at the ends of a step, and how their surfaces go.

    symbol   meaning                                                            shape  unit  frame
    c, R     place of an obstacle and its rotation since t = 0                  3, 9   m, -  inertial
    v, w     velocity of that place, and angular velocity                       3      m/s, 1/s
    x0, x    a point that goes with the obstacle, at the begin and the end of
             a step: x = c + R R0^T (x0 - c0)                                   3      m     inertial

An obstacle moves by a motion about its place, turns about its own axis by a spin, or is set from outside.  A spin leaves
the surface where it is, and carries along what rubs on it.
"""

from __future__ import annotations

from hybrid.kernels.algebra.rotations import add, cross, mat_mat, mat_vec, scale, sub
from hybrid.kernels.laws.end_motion import (
    driven_frame,
    driven_position,
    frame_at,
    position_at,
    rise,
    rise_integral,
    turn_by_vector,
)
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.state.obstacle_rows import (
    AXIS,
    BEGAN,
    ENDED,
    INERTIA,
    PLACE,
    RAMP,
    RATE,
    RIDES,
    ROLLED,
    ROLLED_BEFORE,
    ROLLING,
    SIDE,
    SPEED,
    STILL_AXIS,
    STILL_SIDE,
    SWEEP,
    TURNED,
    TURNING,
)


@inner
def row3(table, k, at):
    """Three numbers of a row."""
    return table[k, at], table[k, at + 1], table[k, at + 2]


@inner
def row9(table, k, at):
    """Nine numbers of a row."""
    return (
        table[k, at], table[k, at + 1], table[k, at + 2], table[k, at + 3], table[k, at + 4], table[k, at + 5],
        table[k, at + 6], table[k, at + 7], table[k, at + 8],
    )  # fmt: skip


@inner
def put_vector(table, k, at, x):
    """Write a vector into a row."""
    for j in range(3):
        table[k, at + j] = x[j]


@inner
def put_matrix(table, k, at, R):
    """Write a matrix into a row."""
    for j in range(9):
        table[k, at + j] = R[j]


@inner
def transposed(R):
    """The transpose of a matrix."""
    return R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8]


@called
def pose_at(t, k, sea, rolled):
    """c, v, R without spin, R, w of obstacle k at t (s); rolled: angle (rad) of one that turns freely."""
    moves = sea.courses
    x, v = row3(moves.position, k, 0), (0.0, 0.0, 0.0)
    if moves.prescribed[k, 0]:
        x, v = position_at(t, k, moves, sea)
    R, w = frame_at(t, k, moves)
    if moves.driven[k, 0]:
        x, v = driven_position(t, k, moves)
        R, w = driven_frame(t, k, moves)
    rate, ramp, whole = sea.carried[k, RATE], sea.carried[k, RAMP], R
    if rate != 0.0:
        a = row3(sea.carried, k, STILL_AXIS)
        angle = t
        if ramp > 0.0:
            angle = rise_integral(t, ramp)
        spun, _ = turn_by_vector(scale(rate * angle, a), (0.0, 0.0, 0.0))
        whole = mat_mat(R, spun)
        w = add(w, scale(rate * rise(t, ramp)[0], mat_vec(R, a)))
    if sea.carried[k, INERTIA] > 0.0:
        a = row3(sea.carried, k, STILL_AXIS)
        spun, _ = turn_by_vector(scale(rolled, a), (0.0, 0.0, 0.0))
        whole = mat_mat(R, spun)
        w = add(w, scale(sea.carried[k, ROLLING], mat_vec(R, a)))
    return x, v, R, whole, w


@kernel
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
        put_vector(sea.carried, k, BEGAN, c0)
        put_vector(sea.carried, k, ENDED, c)
        put_matrix(sea.carried, k, SWEEP, mat_mat(R, transposed(R0)))
        put_vector(sea.carried, k, SPEED, v)
        put_vector(sea.carried, k, TURNING, w)
        put_matrix(sea.carried, k, TURNED, R)
        put_vector(sea.obstacles, k, PLACE, c)
        put_vector(sea.obstacles, k, AXIS, mat_vec(bare, row3(sea.carried, k, STILL_AXIS)))
        put_vector(sea.obstacles, k, SIDE, mat_vec(bare, row3(sea.carried, k, STILL_SIDE)))


@inner
def surface_velocity(carried, k, x):
    """Velocity (m/s) of what goes with obstacle k at x, at the end of the step."""
    return add(row3(carried, k, SPEED), cross(row3(carried, k, TURNING), sub(x, row3(carried, k, ENDED))))


@inner
def swept(carried, k, x):
    """Where a point that goes with obstacle k has come in the step from x."""
    return add(row3(carried, k, ENDED), mat_vec(row9(carried, k, SWEEP), sub(x, row3(carried, k, BEGAN))))


@inner
def unswept(carried, k, x):
    """Where a point that goes with obstacle k has come from in the step to x."""
    R = transposed(row9(carried, k, SWEEP))
    return add(row3(carried, k, BEGAN), mat_vec(R, sub(x, row3(carried, k, ENDED))))


@inner
def way_with(carried, k, x, u):
    """Way of the surface of obstacle k under a node that has gone by u to x.

    The mean of that from where the node was and of that to where it is, which has no part across a surface that turns
    under a node at rest.
    """
    x0 = sub(x, u)
    return scale(0.5, add(sub(swept(carried, k, x0), x0), sub(x, unswept(carried, k, x))))


@inner
def way_along(carried, k, q, x, u):
    """Travel of a node against obstacle k after a step.

    Its travel q before the step, which turns with the obstacle, and its motion against the obstacle since; x: where it
    is, u: its displacement in the step.
    """
    return add(mat_vec(row9(carried, k, SWEEP), q), sub(x, swept(carried, k, sub(x, u))))
