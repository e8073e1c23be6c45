"""Edges of surfaces of triangles, for pictures: those that are sharp, those between what is seen and what is not."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

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
