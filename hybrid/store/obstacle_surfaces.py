"""Surfaces of the obstacles of a result, where they are at an output: rings of points, and triangles between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.store.stored_result import StoredResult

AROUND = 32  # points around a round obstacle
OVER = 7  # points along its half spheres
# Kinds of obstacles by their numbers in a file.
PLANE = 0.0
ROUND = 1.0
BOX = 2.0
TORUS = 3.0
SHEAVE = 4.0
MESH = 5.0


class Body(NamedTuple):
    """An obstacle where it is at an output."""

    name: str
    kind: float  # PLANE, ROUND, BOX, TORUS, SHEAVE or MESH
    place: np.ndarray  # (3,) m
    axis: np.ndarray  # (3,) of a cylinder, or the normal of a plane
    radius: float  # m
    half: float  # m, half its length; 0: a ball, infinite: endless
    more: tuple[float, ...] = ()  # of a box half its width and height; radii (m) of ring, groove and rims
    side: np.ndarray = np.zeros(3)  # (3,) second axis of a box or mesh
    points: np.ndarray = np.zeros((0, 3))  # (n, 3) m, corners of a mesh, where it is
    triangles: np.ndarray = np.zeros((0, 3), np.int64)  # (m, 3) of them, counter-clockwise from outside


def obstacles_at(result: StoredResult, output: int, moving: bool | None = None) -> list[Body]:
    """The obstacles of a result at an output; moving: those that move, or those that do not; None: all."""
    found = []
    for name in names_of(result):
        kind, *more = result[f"obstacles/{name}/shape"].tolist()
        place, axis, (radius, half) = np.array(more[:3]), np.array(more[3:6]), more[6:8]
        half, side = half if half >= 0.0 else np.inf, np.array(more[10:13])
        moves = moves_ever(result, name)
        if moving is not None and moves != moving:
            continue
        if f"obstacles/{name}/position" in result:
            place = result[f"obstacles/{name}/position"][output]
            turn = _rotation(np.radians(result[f"obstacles/{name}/rotation"][output]))
            axis, side = turn @ axis, turn @ side if side.size else side
        mesh: tuple[np.ndarray, ...] = ()
        if kind == MESH:
            axes = np.array([axis, side, np.cross(axis, side)])
            mesh = (place + result[f"obstacles/{name}/points"] @ axes, result[f"obstacles/{name}/triangles"])
        found.append(Body(name, kind, place, axis, radius, half, (*more[8:10], *more[13:]), side, *mesh))
    return found


def moves_ever(result: StoredResult, name: str) -> bool:
    """Whether an obstacle is ever elsewhere than at first."""
    if f"obstacles/{name}/position" not in result:  # none of the scene moves
        return False
    return any(bool(np.ptp(result[f"obstacles/{name}/{x}"], axis=0).any()) for x in ("position", "rotation"))


def names_of(result: StoredResult) -> list[str]:
    """Names of the obstacles of a result."""
    return [x.split("/")[1] for x in result.names if x.startswith("obstacles/") and x.endswith("/shape")]


def _rotation(angles: np.ndarray) -> np.ndarray:
    """Rz Ry Rx of roll, pitch, yaw."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors normal to a unit vector and to each other."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def surface_rings(body: Body, low: float, high: float) -> np.ndarray:
    """Rings (n, AROUND, 3) of an obstacle from end to end; low, high: m along its axis, of an endless one.

    Of a torus the last is the first.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    if body.kind == BOX:
        return _box(body)
    p, q = across(body.axis)
    round_ = np.cos(turn)[:, None] * p + np.sin(turn)[:, None] * q
    if body.kind == TORUS:
        along, out = _arc(body.more[2], 0.0, body.radius, np.linspace(0.0, 2.0 * np.pi, AROUND + 1))
    elif body.kind == SHEAVE:
        along, out = _profile(body)
    elif np.isfinite(body.half):
        rise = np.linspace(0.0, 0.5 * np.pi, OVER)
        cap, out = body.half + body.radius * np.sin(rise), body.radius * np.cos(rise)
        along, out = np.concatenate([-cap[::-1], cap]), np.concatenate([out[::-1], out])
    else:
        along, out = np.array([low, high]), np.full(2, body.radius)
    return np.asarray(body.place + along[:, None, None] * body.axis + out[:, None, None] * round_)


def _arc(away: float, along: float, radius: float, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of a circle about (along, away), m: along an axis and away from it; angle: rad, from outwards on."""
    return along + radius * np.sin(angle), away + radius * np.cos(angle)


def _profile(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """The section of a sheave from one side of its axis to the other: along that and away from it, m."""
    groove, rim = body.more[3:]
    ring, middle = body.radius + groove, groove + rim
    half = np.linspace(-0.5 * np.pi, 0.5 * np.pi, AROUND // 2)
    low, high = _arc(ring, -middle, rim, half), _arc(ring, middle, rim, half)
    bottom = _arc(ring, 0.0, groove, np.linspace(1.5 * np.pi, 0.5 * np.pi, AROUND // 2))
    ends = ([-middle - rim], [0.0]), ([middle + rim], [0.0])
    along, out = (np.concatenate([x[k] for x in (ends[0], low, bottom, high, ends[1])]) for k in (0, 1))
    return along, out


def _box(body: Body) -> np.ndarray:
    """Rings (n, AROUND, 3) of a box with rounded edges, from one face along its axis to the other."""
    axes = np.array([body.axis, body.side, np.cross(body.axis, body.side)])
    turn = (np.arange(AROUND) + 0.5) * 2.0 * np.pi / AROUND  # no direction lies in a face: it has a corner
    rise = np.linspace(0.5 * np.pi, 0.0, OVER)
    rise = np.concatenate([-rise, rise[::-1]])
    up, out = np.outer(np.sin(rise), np.ones(AROUND)), np.cos(rise)
    n = np.stack([up, np.outer(out, np.cos(turn)), np.outer(out, np.sin(turn))], axis=-1)
    sides = np.concatenate([-np.ones(OVER), np.ones(OVER)])[:, None]
    signs = np.stack(np.broadcast_arrays(sides, np.sign(np.cos(turn)), np.sign(np.sin(turn))), axis=-1)
    local = body.radius * n + signs * np.array([body.half, *body.more[:2]])
    return np.asarray(body.place + local @ axes)


def triangles_of(body: Body, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) m and triangles (m, 3) of them of an obstacle; box: (2, 3) m, in which endless ones end."""
    if body.kind == MESH:
        return body.points, body.triangles
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    if body.kind == PLANE:
        p, q = across(body.axis)
        a, b = ((corners - body.place) @ x for x in (p, q))
        ends = ((a.min(), b.min()), (a.max(), b.min()), (a.max(), b.max()), (a.min(), b.max()))
        return np.array([body.place + s * p + t * q for s, t in ends]), np.array([[0, 1, 2], [0, 2, 3]])
    along = (corners - body.place) @ body.axis
    rings = surface_rings(body, float(along.min()), float(along.max()))
    around = np.arange(AROUND)
    i = (np.arange(len(rings) - 1)[:, None] * AROUND + around).ravel()
    right = (np.arange(len(rings) - 1)[:, None] * AROUND + (around + 1) % AROUND).ravel()
    first, second = np.column_stack([i, right, i + AROUND]), np.column_stack([right, right + AROUND, i + AROUND])
    return rings.reshape(-1, 3), np.concatenate([first, second])
