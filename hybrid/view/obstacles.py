"""Obstacles for pictures: outlines in a plane of view, surfaces in space; where they are at an output, if they move."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from hybrid.store.obstacle_surfaces import (
    AROUND,
    MESH,
    PLANE,
    ROUND,
    TORUS,
    Body,
    across,
    moves_ever,
    obstacles_at,
    surface_rings,
    triangles_of,
)
from hybrid.store.reader import Result
from hybrid.view.figure import STONE, STONE_EDGE, Area, Item, Line, short
from hybrid.view.projections import View, line_extent_in

# Beyond the picture, in sizes of that, endless obstacles go on.
BEYOND = 0.2
MANY = 5000  # triangles of a mesh that is drawn as its hull in a plane


def outlines(result: Result, view: View, output: int, moving: bool | None = None) -> list[Item]:
    """Obstacles in a plane of view: filled outlines of round ones, and what is behind planes seen from the side."""
    items: list[Item] = []
    box = line_extent_in(view, result)
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
            rings = surface_rings(body, at - 3.0 * size, at + 3.0 * size)
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
        x = surface_rings(body, at - size, at + size)
        found += [*(np.vstack([ring, ring[:1]]) for ring in (x[0], x[len(x) // 2 - 1], x[len(x) // 2], x[-1]))]
        found += [x[:, k] for k in range(0, AROUND, AROUND // 8)]
    return found


def surfaces(result: Result, box: np.ndarray, moving: bool | None = None, output: int = -1) -> list[dict[str, Any]]:
    """Triangles of obstacles for a picture in space whose box (2, 3) m grows to hold those that are near."""
    found = obstacles_at(result, output, moving)
    size = float(np.ptp(box, axis=0).max()) or 1.0
    for body in found:
        if body.kind > ROUND:
            x = body.points if body.kind == MESH else surface_rings(body, 0.0, 0.0).reshape(-1, 3)
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
    x, triangles = triangles_of(body, box)
    look = {"name": body.name, "fill": STONE, "line": STONE_EDGE, "solid": 0.7, "text": f"obstacle {body.name}{when}"}
    look |= {axis: x[:, k].tolist() for k, axis in enumerate("xyz")}
    if body.kind == PLANE:
        return look
    n = len(x) // AROUND
    circles = [[*range(at, at + AROUND), at] for at in (0, n // 2 * AROUND, (n - 1) * AROUND)]
    rim = closed_way(x, triangles) if body.kind == MESH else [k for circle in circles for k in circle]
    return look | {name: triangles[:, k].tolist() for k, name in enumerate("ijk")} | {"rim": rim}


# Edges of surfaces of triangles, for pictures: those that are sharp, those between what is seen and what is not.

# Cosine of how far a surface turns at an edge that is drawn.
SHARP = np.cos(np.radians(30.0))

Edge = tuple[int, int]


def edges_of(triangles: np.ndarray) -> list[tuple[Edge, int, int]]:
    """Edges of a closed surface (m, 3): numbers of both corners, and of the triangles beside them."""
    at: dict[Edge, int] = {}
    for k, (a, b, c) in enumerate(triangles.tolist()):
        at |= {(a, b): k, (b, c): k, (c, a): k}
    return [((a, b), k, at[b, a]) for (a, b), k in at.items() if a < b and (b, a) in at]


def turned_to_eye(x: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, list[Edge]]:
    """Which triangles (m,) of corners x (n, 2) in a plane of view are seen from in front, and the edges around them."""
    a, b, c = (x[triangles[:, k]] for k in range(3))
    front = (b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0]
    return front, [pair for pair, first, second in edges_of(triangles) if front[first] != front[second]]


def sharp_edges(points: np.ndarray, triangles: np.ndarray) -> list[Edge]:
    """Edges at which a surface of corners (n, 3) turns much."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1)[:, None]
    return [pair for pair, first, second in edges_of(triangles) if n[first] @ n[second] < SHARP]


def closed_way(points: np.ndarray, triangles: np.ndarray) -> list[int]:
    """Corners of a way over all sharp edges and back, that leads along edges alone; of a round surface one corner."""
    sharp, all_edges = (_beside(x) for x in (sharp_edges(points, triangles), (x[0] for x in edges_of(triangles))))
    if not sharp:
        return [0]
    found: list[int] = []
    back: list[int] = []
    done: set[Edge] = set()
    here = next(iter(sharp))
    while True:
        found += _tour(here, sharp, done)
        to = _nearest(here, all_edges, {a for a, others in sharp.items() if any((a, b) not in done for b in others)})
        if not to:
            return found + back
        found += to[1:-1]
        back = to[-2::-1] + back
        here = to[-1]


def _beside(edges: Iterable[Edge]) -> dict[int, list[int]]:
    """Corners at the other end of the edges of each."""
    found: dict[int, list[int]] = {}
    for a, b in edges:
        found.setdefault(a, []).append(b)
        found.setdefault(b, []).append(a)
    return found


def _tour(start: int, edges: dict[int, list[int]], done: set[Edge]) -> list[int]:
    """A way over all edges that hang together with a corner, each there and back; done: what has been gone along."""
    found, stack = [start], [start]
    while stack:
        here = stack[-1]
        to = next((b for b in edges[here] if (here, b) not in done), None)
        if to is None:
            stack.pop()
            found += stack[-1:]
        else:
            done |= {(here, to), (to, here)}
            stack.append(to)
            found.append(to)
    return found


def _nearest(start: int, edges: dict[int, list[int]], wanted: set[int]) -> list[int]:
    """The shortest way along edges to one of the corners that are wanted; empty: there is none."""
    came, waiting = {start: -1}, [start]
    for here in waiting:
        if here in wanted:
            way = [here]
            while came[way[-1]] >= 0:
                way.append(came[way[-1]])
            return way[::-1]
        for to in edges[here]:
            if to not in came:
                came[to] = here
                waiting.append(to)
    return []
