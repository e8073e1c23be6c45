"""Surfaces of obstacles: distances against closed forms and nearest points, normals and curvature against differences."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.laws import surfaces
from hybrid.kernels.laws.obstacles import half_thickness
from hybrid.model.build import build
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at

STRAND = 0.01
DATA = Path(__file__).parents[1] / "data"
OBSTACLES: dict[str, Any] = {
    "wall": {"kind": "plane", "at": [0.1, 0, 0], "normal": [1, 2, 3]},
    "ball": {"kind": "sphere", "at": [0.2, -0.1, 0.3], "radius": 0.4},
    "pipe": {"kind": "cylinder", "at": [0, 0.1, 0], "axis": [1, -1, 2], "radius": 0.2, "length": 0.6},
    "deck": {"kind": "box", "at": [0.1, 0.2, -0.1], "size": [1.2, 0.8, 0.5], "rounding": 0.1, "rotation": [20, -35, 50]},
    "ring": {"kind": "torus", "at": [0.1, 0, 0.2], "axis": [1, 1, -1], "ring": 0.6, "radius": 0.15},
    "sheave": {"kind": "sheave", "at": [0, 0.1, 0.1], "axis": [2, -1, 1], "radius": 0.5, "groove": 0.1, "rim": 0.04},
    "angle": {"kind": "mesh", "file": str(DATA / "angle.obj"), "scale": 0.1, "at": [-0.3, -0.4, 0], "rotation": [20, 15, -30]},
}  # fmt: skip


class Around(NamedTuple):
    """What `surface` reads of a Sea."""

    obstacles: np.ndarray
    boxes: np.ndarray
    facets: np.ndarray


@numba.njit
def at(sea: Any, k: int, x: Any) -> Any:
    d, n, curved = surfaces.surface(sea, k, x)
    return d, n, surfaces.gradient_of_normal(curved, n), surfaces.bent(curved, n, (0.3, -0.5, 0.7))


@numba.njit
def is_far(sea: Any, k: int, x: Any, way: float) -> Any:
    return surfaces.is_far(sea, k, x, way)


def scene(**tables: Any) -> hybrid.Scene:
    return hybrid.validate_scene(
        cable_scene({"length": 2.0, "mass": 0.1, "diameter": 2.0 * STRAND}, pinned_at(5, 5, 5), "free",
                    initial={"kind": "straight", "direction": [0, 0, -1]}, obstacles=OBSTACLES) | tables
    )  # fmt: skip


@pytest.fixture(scope="module")
def sea() -> Around:
    return around(scene())


def around(scene: hybrid.Scene) -> Around:
    values = build(one_line(scene)).sea.values
    return Around(values.obstacles, values.boxes, values.facets)


def places(count: int) -> np.ndarray:
    return np.random.default_rng(7).uniform(-1.2, 1.2, (count, 3))


@pytest.mark.long
@pytest.mark.parametrize("name", OBSTACLES)
def test_kernels_and_scene_have_the_same_distances(name: str, sea: Around) -> None:
    """The scene has closed forms of its own."""
    k, obstacle = list(OBSTACLES).index(name), scene().obstacles[name]
    for x in places(300):
        assert at(sea, k, tuple(x))[0] == pytest.approx(obstacle.distance(tuple(x)) - STRAND, abs=1e-12)


@pytest.mark.parametrize("name", OBSTACLES)
def test_normals_and_curvature_are_derivatives(name: str, sea: Around) -> None:
    """n of d, K of n, by central differences; where they are not, at an edge of a face of it, only rarely."""
    k, step, off = list(OBSTACLES).index(name), 1e-5, 0
    for x in places(300):
        _, n, K, bent = at(sea, k, tuple(x))
        sides = [[at(sea, k, tuple(x + e)) for e in (step * axis, -step * axis)] for axis in np.eye(3)]
        slope = np.array([(a[0] - b[0]) / (2 * step) for a, b in sides])
        turn = np.array([(np.array(a[1]) - b[1]) / (2 * step) for a, b in sides]).T
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-12)
        K = np.array(K).reshape(3, 3)
        np.testing.assert_allclose(bent, K @ [0.3, -0.5, 0.7], atol=1e-12)
        np.testing.assert_allclose(K @ n, 0.0, atol=1e-11 * max(1.0, np.abs(K).max()))
        same = np.allclose(slope, n, atol=1e-6) and np.allclose(turn, K, atol=1e-6 * (1.0 + np.abs(K).max() ** 3))
        off += not same
    assert off <= 1


@pytest.mark.parametrize("name", OBSTACLES)
def test_a_distance_is_that_to_the_nearest_place_and_changes_by_no_more_than_the_way(name: str, sea: Around) -> None:
    """From outside the way back along n ends on the surface; nothing between two places is missed by their distances."""
    k, x = list(OBSTACLES).index(name), places(400)
    d = np.array([at(sea, k, tuple(p))[0] for p in x])
    for p, far in zip(x, d, strict=True):
        if far > 0.0:
            _, n, _, _ = at(sea, k, tuple(p))
            assert abs(at(sea, k, tuple(p - far * np.array(n)))[0]) < 1e-12
    assert (np.abs(np.diff(d)) <= np.linalg.norm(np.diff(x, axis=0), axis=1) + 1e-12).all()


@pytest.mark.parametrize("name", OBSTACLES)
def test_what_is_far_by_the_size_of_an_obstacle_is_farther(name: str, sea: Around) -> None:
    """It is known of all but planes, which have no end, and meshes, of which the size is not known."""
    k = list(OBSTACLES).index(name)
    for x in 4.0 * places(400):
        assert not is_far(sea, k, tuple(x), at(sea, k, tuple(x))[0] + 1e-12)
    assert is_far(sea, k, (3.0, -3.0, 3.0), 1.0) == (name not in ("wall", "angle"))


def test_a_turned_box_has_turned_normals(sea: Around) -> None:
    """A box between its edges is its face: 0.4 m above the middle of a face of a half width of 0.25 m less 0.01."""
    deck = scene().obstacles["deck"]
    up = np.array(deck.axes[2])
    d, n, K, _ = at(sea, list(OBSTACLES).index("deck"), tuple(np.array(deck.at) + 0.4 * up))
    assert d == pytest.approx(0.4 - 0.25 - STRAND, abs=1e-12)
    np.testing.assert_allclose(n, up, atol=1e-12)
    np.testing.assert_array_equal(K, 0.0)


def test_how_thick_obstacles_are(sea: Around) -> None:
    half = np.array([np.inf, 0.4, 0.2, 0.25, 0.15, 0.18, 0.0]) + STRAND
    half[5] += STRAND - 0.01
    half[6] += 0.6 * 0.56 / (2 * 0.56 + 3.6 * 0.6)  # volume over surface
    np.testing.assert_allclose(half_thickness(sea.obstacles), half, rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "change", "where", "says"),
    [
        ("deck", {"rounding": 0.3}, "obstacles.deck.rounding", "at most half of the smallest"),
        ("deck", {"size": [1, 0, 1]}, "obstacles.deck.size", "a number > 0, in m"),
        ("ring", {"radius": 0.7}, "obstacles.ring.radius", "less than the radius of the ring"),
        ("sheave", {"groove": 0.01}, "obstacles.sheave.groove", "at least 0.0105 m"),
    ],
)  # fmt: skip
def test_shapes_that_cannot_be_are_refused(kind: str, change: dict[str, Any], where: str, says: str) -> None:
    with pytest.raises(SceneError, match=says) as refused:
        scene(obstacles={kind: OBSTACLES[kind] | change})
    assert any(x.where.startswith(where) for x in refused.value.complaints)
