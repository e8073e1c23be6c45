"""Surfaces of triangles of obstacles as arrays for kernels.laws.facets: normals of their features, a tree of boxes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.facet_rows import (
    ALONG,
    BEHIND,
    BOX_ROW,
    FACET,
    FEATURE,
    FEATURES,
    FIRST_CORNER,
    HIGHEST,
    LEAF,
    LOWEST,
    NO_BOXES,
    NO_FACETS,
    NORMAL,
    TURNS,
)
from hybrid.kernels.state.state import Floats
from hybrid.scene.mesh_file import Mesh, read_mesh
from hybrid.scene.obstacles import MeshObstacle, Obstacle

# rad: what turns by less at an edge is flat, as coordinates of single precision are; edges whose directions differ by
# less are one; what turns by more is a sharp edge, not a part of something round.
FLAT, STRAIGHT, SHARP = 1e-5, 1e-4, np.radians(40.0)


class Facets(NamedTuple):
    """A surface: boxes (B, BOX_ROW) and facets (F, FACET); the smallest radius of what is round on it, 0 where an edge

    is sharp, and half of how thick it is on average (volume over surface), m.
    """

    boxes: Floats
    facets: Floats
    rounding: float
    half_thickness: float


def facets_of(x: MeshObstacle) -> Facets:
    """The surface of an obstacle in axes of its own, m."""
    return _facets(*_key(x))


def facet_tables(obstacles: Mapping[str, Obstacle]) -> tuple[Floats, Floats, dict[str, int]]:
    """Sea.boxes and Sea.facets of all obstacles, and the first row of boxes of each that has some, by name."""
    meshes = {name: x for name, x in obstacles.items() if isinstance(x, MeshObstacle)}
    if not meshes:
        return NO_BOXES, NO_FACETS, {}
    boxes, facets, first = _joined(tuple(_key(x) for x in meshes.values()))
    return boxes, facets, dict(zip(meshes, first, strict=True))


Key = tuple[str, float, int, int]


def _key(x: MeshObstacle) -> Key:
    status = os.stat(x.file)
    return x.file, x.scale, status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8)
def _facets(path: str, scale: float, _changed: int, _size: int) -> Facets:
    mesh = read_mesh(path)
    return surface_of(Mesh(scale * mesh.points, mesh.triangles))


@lru_cache(maxsize=4)
def _joined(keys: tuple[Key, ...]) -> tuple[Floats, Floats, tuple[int, ...]]:
    """Surfaces one behind the other; the arrays are shared by all lines."""
    boxes, facets, first, row, facet = [], [], [], 0, 0
    for each in (_facets(*key) for key in keys):
        moved = each.boxes.copy()
        moved[:, BEHIND] += row
        moved[moved[:, LEAF] >= 0.0, LEAF] += facet
        boxes.append(moved)
        facets.append(each.facets)
        first.append(row)
        row, facet = row + len(moved), facet + len(each.facets)
    return np.concatenate(boxes), np.concatenate(facets), tuple(first)


def surface_of(mesh: Mesh) -> Facets:
    """The arrays of a surface, m."""
    x = mesh.points[mesh.triangles]
    sides = x[:, [1, 2, 0]] - x
    length = np.linalg.norm(sides, axis=2)
    across = np.cross(sides[:, 0], sides[:, 1])
    area = 0.5 * np.linalg.norm(across, axis=1)
    n = 0.5 * across / area[:, None]
    other, turn = _beside(mesh.triangles, n)
    along = sides / length[..., None]
    rows = np.zeros((len(x), FACET))
    rows[:, :NORMAL], rows[:, NORMAL : NORMAL + 3] = x.reshape(-1, 9), n
    features = rows[:, FEATURES:].reshape(-1, 6, FEATURE)
    features[:, :FIRST_CORNER, :TURNS] = _unit(n[:, None] + n[other], n[:, None])
    features[:, :FIRST_CORNER, TURNS] = turn > FLAT
    features[:, :FIRST_CORNER, ALONG:] = along
    _put_corners(features[:, FIRST_CORNER:], mesh, n, along, turn > FLAT)
    middle = x[:, 0] - 0.5 * (x.min(axis=(0, 1)) + x.max(axis=(0, 1)))
    volume = float(np.einsum("i,ij,ij->", area, middle, n)) / 3.0
    # between the middles of the circles through the corners of two triangles, what is round turns by its radius; where
    # triangles are so long that these tell nothing, between their centres
    opposite = -np.einsum("fki,fki->fk", sides[:, [1, 2, 0]], sides[:, [2, 0, 1]]) * length / (4.0 * area[:, None])
    height = 2.0 * area[:, None] / (3.0 * length)
    apart = [x + _of_other(x, mesh.triangles, other) for x in (opposite, height)]
    convex = np.einsum("fki,fi->fk", x[other].mean(axis=2) - x, n) < 0.0
    radius = np.where(turn > SHARP, 0.0, np.maximum(*apart) / np.maximum(turn, FLAT))
    rounding = radius[convex].min(initial=np.inf)
    return Facets(_tree(x), rows, float(rounding), volume / float(area.sum()))


def _beside(triangles: np.ndarray, n: Floats) -> tuple[np.ndarray, Floats]:
    """The triangle (F, 3) across each edge, and by how much, rad, the surface turns there."""
    begin, end = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    size = int(triangles.max()) + 1
    order = np.argsort(begin * size + end)
    other = order[np.searchsorted((begin * size + end)[order], end * size + begin)].reshape(-1, 3) // 3
    turned = np.linalg.norm(np.cross(n[:, None], n[other]), axis=2)
    return other, np.arctan2(turned, np.einsum("fi,fki->fk", n, n[other]))


def _of_other(values: Floats, triangles: np.ndarray, other: np.ndarray) -> Floats:
    """What (F, 3) the triangles across edges have of a value (F, 3) at these edges."""
    same = (triangles[other] == triangles[:, [1, 2, 0], None]).argmax(axis=2)  # where the edge begins there
    return np.asarray(values[other, same])


def _unit(x: Floats, otherwise: Floats) -> Floats:
    """Unit vectors of x; of those without a length another."""
    size = np.linalg.norm(x, axis=-1, keepdims=True)
    return np.asarray(np.where(size > 1e-9, x / np.maximum(size, 1e-9), otherwise))


def _put_corners(features: Floats, mesh: Mesh, n: Floats, along: Floats, turns: np.ndarray) -> None:
    """Features (F, 3, FEATURE) of corners: all facets around one have the same."""
    count, of = len(mesh.points), mesh.triangles
    before = np.roll(along, 1, axis=1)
    angle = np.arctan2(np.linalg.norm(np.cross(along, before), axis=2), -np.einsum("fki,fki->fk", along, before))
    normal = np.zeros((count, 3))
    np.add.at(normal, of, angle[..., None] * n[:, None])
    # each edge once from either end, in the triangle that it goes along; those at which the surface turns
    edges, least, most = np.zeros(count), np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.add.at(edges, of[turns], 1.0)
    reference = np.zeros((count, 3))
    reference[of[turns]] = along[turns]  # of any of them
    aligned = np.cross(along, reference[of])
    np.minimum.at(least, of[turns], aligned[turns])
    np.maximum.at(most, of[turns], aligned[turns])
    straight = (edges == 2.0) & (np.maximum(np.abs(least), np.abs(most)).max(axis=1) < STRAIGHT)
    features[..., :TURNS] = _unit(normal, np.zeros((count, 3)))[of]
    features[..., TURNS] = (edges > 0.0)[of]
    features[..., ALONG:] = np.where(straight[:, None], reference, 0.0)[of]


def _tree(x: Floats) -> Floats:
    """Boxes over triangles x (F, 3, 3), halved along their longest side down to one triangle each."""
    low, high, middle = x.min(axis=1), x.max(axis=1), x.mean(axis=1)
    boxes = np.zeros((2 * len(x) - 1, BOX_ROW))
    waiting = [np.arange(len(x))]
    for row, box in enumerate(boxes):
        held = waiting.pop()
        box[LOWEST:HIGHEST], box[HIGHEST:BEHIND] = low[held].min(axis=0), high[held].max(axis=0)
        box[BEHIND], box[LEAF] = row + 2 * held.size - 1, held[0] if held.size == 1 else -1.0
        if held.size > 1:
            order = held[np.argsort(middle[held, int(np.argmax(np.ptp(middle[held], axis=0)))], kind="stable")]
            waiting += [order[held.size // 2 :], order[: held.size // 2]]
    return boxes
