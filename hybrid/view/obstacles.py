"""Obstacles for pictures: outlines in a plane of view, surfaces in space; where they are at an output, if they move."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybrid.store.reader import Result
from hybrid.view.figure import Area, Item, Line
from hybrid.view.mesh_edges import closed_way, sharp_edges, turned_to_eye
from hybrid.view.projections import View, extent_in
from hybrid.view.style import STONE, STONE_EDGE, short

# Points around a round obstacle and along its half spheres; beyond the picture, in sizes of that, endless ones go on.
AROUND, OVER, BEYOND = 32, 7, 0.2
PLANE, ROUND, BOX, TORUS, SHEAVE, MESH = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0
MANY = 5000  # triangles of a mesh that is drawn as its hull in a plane


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


def obstacles_at(result: Result, output: int, moving: bool | None = None) -> list[Body]:
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


def moves_ever(result: Result, name: str) -> bool:
    """Whether an obstacle is ever elsewhere than at first."""
    if f"obstacles/{name}/position" not in result:  # none of the scene moves
        return False
    return any(bool(np.ptp(result[f"obstacles/{name}/{x}"], axis=0).any()) for x in ("position", "rotation"))


def names_of(result: Result) -> list[str]:
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


def _surface(body: Body, low: float, high: float) -> np.ndarray:
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
    n = np.stack([np.outer(np.sin(rise), np.ones(AROUND)), np.outer(np.cos(rise), np.cos(turn)),
                  np.outer(np.cos(rise), np.sin(turn))], axis=-1)  # fmt: skip
    sides = np.concatenate([-np.ones(OVER), np.ones(OVER)])[:, None]
    signs = np.stack(np.broadcast_arrays(sides, np.sign(np.cos(turn)), np.sign(np.sin(turn))), axis=-1)
    local = body.radius * n + signs * np.array([body.half, *body.more[:2]])
    return np.asarray(body.place + local @ axes)


def outlines(result: Result, view: View, output: int, moving: bool | None = None) -> list[Item]:
    """Obstacles in a plane of view: filled outlines of round ones, and what is behind planes seen from the side."""
    items: list[Item] = []
    box = extent_in(view, result)
    size = float(np.ptp(box, axis=1).max()) or 1.0
    for body in obstacles_at(result, output, moving):
        if body.kind == PLANE:
            corners = _half_plane(body, view, box, size)
        elif body.kind == MESH and len(body.triangles) <= MANY:
            x = np.column_stack(view.project(body.points))
            front, around = turned_to_eye(x, body.triangles)
            items.append(Area(x[body.triangles[front]], STONE, "obstacle"))
            gaps = np.array([[*x[[a, b]], [np.nan, np.nan]] for a, b in around]).reshape(-1, 2)
            items.append(Line(gaps[:, 0], gaps[:, 1], colour=STONE_EDGE, width=0.8))
            continue
        elif body.kind == MESH:
            corners = hull(np.column_stack(view.project(body.points)))
        else:
            at = float((result.position[output].mean(axis=0) - body.place) @ body.axis)
            rings = _surface(body, at - 3.0 * size, at + 3.0 * size)
            x, y = view.project(rings.reshape(-1, 3))
            if body.kind == TORUS:  # what is seen through its hole stays
                items.append(Area(_quads(np.stack([x, y], axis=-1).reshape(len(rings), AROUND, 2)), STONE, "obstacle"))
                continue
            corners = hull(np.column_stack([x, y]))
        if corners is not None:
            items.append(Area(corners[None], STONE, "obstacle"))
            edge = corners if body.kind != PLANE else corners[:2]
            closed = np.vstack([edge, edge[:1]]) if body.kind != PLANE else edge
            items.append(Line(closed[:, 0], closed[:, 1], colour=STONE_EDGE, width=0.8))
    return items


def _quads(rings: np.ndarray) -> np.ndarray:
    """Corners (m, 4, 2) of the faces between neighbouring points of rings (n, AROUND, 2)."""
    after = np.roll(rings, -1, axis=1)
    return np.stack([rings[:-1], after[:-1], after[1:], rings[1:]], axis=2).reshape(-1, 4, 2)


def _half_plane(body: Body, view: View, box: np.ndarray, size: float) -> np.ndarray | None:
    """Corners (4, 2) of what is behind a plane, its edge first; None: it is not seen from the side."""
    out = np.cross(view.across, view.up)
    if abs(float(body.axis @ out)) > 0.05:
        return None
    normal = np.array(view.project(body.axis))
    normal /= np.linalg.norm(normal)
    at, along = np.array(view.project(body.place)), np.array([-normal[1], normal[0]])
    at = at + ((box.mean(axis=1) - at) @ along) * along
    ends = at + 30.0 * size * np.array([-along, along])
    return np.vstack([ends, ends[::-1] - 30.0 * size * normal])


def hull(points: np.ndarray) -> np.ndarray:
    """The convex hull (m, 2) of points (n, 2), counter-clockwise."""
    order = points[np.lexsort(points.T[::-1])]

    def chain(rows: np.ndarray) -> list[np.ndarray]:
        kept: list[np.ndarray] = []
        for p in rows:
            while len(kept) > 1 and _left(kept[-2], kept[-1], p) <= 0.0:
                kept.pop()
            kept.append(p)
        return kept[:-1]

    return np.array(chain(order) + chain(order[::-1]))


def _left(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


# ---- in space -----------------------------------------------------------------------------------------


def rings(result: Result, output: int) -> list[np.ndarray]:
    """Curves (n, 3) m on the obstacles that move, where they are at an output: along them, and around their ends."""
    found = []
    size = float(np.ptp(result.position[output], axis=0).max()) or 1.0
    for body in obstacles_at(result, output, moving=True):
        if body.kind == PLANE:
            p, q = across(body.axis)
            found.append(body.place + size * np.array([-p - q, p - q, p + q, q - p, -p - q]))
            continue
        if body.kind == MESH:
            found += [body.points[list(pair)] for pair in sharp_edges(body.points, body.triangles)]
            continue
        at = float((result.position[output].mean(axis=0) - body.place) @ body.axis)
        x = _surface(body, at - size, at + size)
        found += [*(np.vstack([ring, ring[:1]]) for ring in (x[0], x[len(x) // 2 - 1], x[len(x) // 2], x[-1]))]
        found += [x[:, k] for k in range(0, AROUND, AROUND // 8)]
    return found


def surfaces(result: Result, box: np.ndarray, moving: bool | None = None, output: int = -1) -> list[dict[str, Any]]:
    """Triangles of obstacles for a picture in space whose box (2, 3) m grows to hold those that are near."""
    found = obstacles_at(result, output, moving)
    size = float(np.ptp(box, axis=0).max()) or 1.0
    for body in found:
        if body.kind > ROUND:
            x = body.points if body.kind == MESH else _surface(body, 0.0, 0.0).reshape(-1, 3)
            low, high = x.min(axis=0), x.max(axis=0)
        elif body.kind == ROUND:
            p = np.clip(body.place, *box) if not np.isfinite(body.half) else body.place
            reach = body.radius + (body.half if np.isfinite(body.half) else 0.0)
            if np.isfinite(body.half):
                low, high = p - reach, p + reach
            else:
                wide = body.radius * np.sqrt(1.0 - body.axis**2)
                low, high = body.place - wide, body.place + wide
                low, high = (np.where(np.abs(body.axis) > 0.9, p, x) for x in (low, high))
        if body.kind != PLANE and np.all(high > box[0] - size) and np.all(low < box[1] + size):
            box[0], box[1] = np.minimum(box[0], low), np.maximum(box[1], high)
    when = f" at t = {short(float(result.times[output]), 4)} s"
    return [_triangles(body, box, when if moves_ever(result, body.name) else "") for body in found]


def _triangles(body: Body, box: np.ndarray, when: str) -> dict[str, Any]:
    """The surface of an obstacle as triangles, as pictures in space take planes."""
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    look = {"name": body.name, "fill": STONE, "line": STONE_EDGE, "solid": 0.7, "text": f"obstacle {body.name}{when}"}
    if body.kind == PLANE:
        p, q = across(body.axis)
        a, b = ((corners - body.place) @ x for x in (p, q))
        x = np.array([body.place + s * p + t * q for s, t in
                      ((a.min(), b.min()), (a.max(), b.min()), (a.max(), b.max()), (a.min(), b.max()))])  # fmt: skip
        return look | {axis: x[:, k].tolist() for k, axis in enumerate("xyz")}
    if body.kind == MESH:
        x, mesh = body.points, {name: body.triangles[:, k].tolist() for k, name in enumerate("ijk")}
        return (
            look
            | {axis: x[:, k].tolist() for k, axis in enumerate("xyz")}
            | mesh
            | {"rim": closed_way(body.points, body.triangles)}
        )
    along = (corners - body.place) @ body.axis
    rings = _surface(body, float(along.min()), float(along.max()))
    x, n = rings.reshape(-1, 3), len(rings)
    i = (np.arange(n - 1)[:, None] * AROUND + np.arange(AROUND)).ravel()
    right = (np.arange(n - 1)[:, None] * AROUND + (np.arange(AROUND) + 1) % AROUND).ravel()
    sides = {"i": [*i, *right], "j": [*right, *(right + AROUND)], "k": [*(i + AROUND), *(i + AROUND)]}
    middle = (n // 2) * AROUND
    rim = [k for at in (0, middle, (n - 1) * AROUND) for k in (*range(at, at + AROUND), at)]
    numbers = {name: [int(v) for v in value] for name, value in (sides | {"rim": rim}).items()}
    return look | {axis: x[:, k].tolist() for k, axis in enumerate("xyz")} | numbers
