"""Obstacles in pictures: outlines in a view, triangles in space, where they are at an output."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import hybrid
from hybrid.live.pictures import around, frames
from hybrid.view.figure import Area, Axis, Marks, Panel
from hybrid.view.matplotlib_backend import draw_panel
from hybrid.view.projections import extent_in, hull, obstacles_at, outlines, surfaces, view_named
from tests.scenes import cable_scene, pinned_at

BALL = {"kind": "sphere", "at": [0.5, 0.3, -0.4], "radius": 0.1}
PIPE = {"kind": "cylinder", "at": [1.0, 0.5, -0.6], "axis": [0, 1, 0], "radius": 0.05}
WALL = {"kind": "plane", "at": [0, 0, -1.5], "normal": [0.2, 0, 1]}
LIFT = {"travel": {"by": [0, 0.5, 0.25], "over": 0.05}}


@pytest.fixture(scope="module")
def result() -> Any:
    section = {"length": 2.2, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.05}
    return hybrid.run(hybrid.validate_scene(cable_scene(
        section, pinned_at(0, 0, 0.2), pinned_at(2, 0, 0.2),
        obstacles={"ball": BALL | {"motion": LIFT}, "pipe": PIPE, "wall": WALL}, model="rod", mesh=20,
        contact={"self": False}, time=(0.1, 0.01), output=(0.05, 21)
    )))  # fmt: skip


def test_obstacles_are_where_they_are_at_an_output(result: Any) -> None:
    first, last = (next(x for x in obstacles_at(result, k) if x.name == "ball") for k in (0, -1))
    np.testing.assert_allclose(first.place, [0.5, 0.3, -0.4])
    np.testing.assert_allclose(last.place, [0.5, 0.8, -0.15], atol=1e-12)
    assert [x.name for x in obstacles_at(result, 0, moving=True)] == ["ball"]
    assert [x.name for x in obstacles_at(result, 0, moving=False)] == ["pipe", "wall"]


def test_outlines_are_those_of_shapes(result: Any) -> None:
    """A ball is a circle from everywhere; an endless pipe a strip from above and a circle along it; a wall its section."""
    areas = [x.outlines[0] for x in outlines(result, view_named("xz"), -1) if isinstance(x, Area)]
    assert len(areas) == 3
    for corners, centre, radius in ((areas[0], [0.5, -0.15], 0.1), (areas[1], [1.0, -0.6], 0.05)):
        away = np.linalg.norm(corners - centre, axis=1)
        assert 0.98 * radius < away.min() <= away.max() < 1.001 * radius
    edge = areas[2][1] - areas[2][0]
    assert edge[1] / edge[0] == pytest.approx(-0.2)
    above = [x.outlines[0] for x in outlines(result, view_named("xy"), -1) if isinstance(x, Area)]
    assert len(above) == 2  # the wall is not seen from the side
    assert np.ptp(above[1], axis=0) == pytest.approx([0.1, np.ptp(above[1][:, 1])], rel=0.01)
    assert np.ptp(above[1][:, 1]) > 4.0


def test_surfaces_in_space_are_closed_triangles(result: Any) -> None:
    box = np.array([[0.0, 0.0, -0.3], [2.0, 0.1, 0.2]])
    ball, pipe, wall = surfaces(result, box)
    assert box[1, 1] >= 0.9 - 1e-9  # it has grown to hold the ball
    for each, place, radius in ((ball, [0.5, 0.8, -0.15], 0.1), (pipe, [1.0, 0.5, -0.6], 0.05)):
        x = np.column_stack([each[k] for k in "xyz"])
        w = x - place
        if each is pipe:
            w[:, 1] = 0.0
        np.testing.assert_allclose(np.linalg.norm(w, axis=1), radius, rtol=1e-9)
        assert max(*each["i"], *each["j"], *each["k"]) == len(x) - 1
    assert "t = 0.1 s" in ball["text"]
    assert "t =" not in pipe["text"]
    np.testing.assert_allclose(0.2 * np.array(wall["x"]) + np.array(wall["z"]) + 1.5, 0.0, atol=1e-9)


def test_a_page_moves_what_moves(result: Any) -> None:
    texts = [plane["text"] for plane in around(result)["planes"]]
    assert texts == ["obstacle pipe", "obstacle wall"]
    found = frames(result, [0, 2], 50)
    middles = [np.mean([p for arm in x["arms"] for p in arm], axis=0)[1] for x in found]
    assert middles[1] - middles[0] == pytest.approx(0.5, abs=1e-3)


def test_a_hull_holds_all_points() -> None:
    points = np.random.default_rng(0).normal(size=(200, 2))
    corners = hull(points)
    after = np.roll(corners, -1, axis=0) - corners
    for a, d in zip(corners, after, strict=True):
        assert (d[0] * (points[:, 1] - a[1]) - d[1] * (points[:, 0] - a[0]) > -1e-12).all()


def test_a_picture_shows_what_is_near_to_the_line_at_all_times(result: Any) -> None:
    """The ball from its first place to its last one, and the pipe seen from its end."""
    box = extent_in(view_named("xz"), result)
    assert box[1, 0] == pytest.approx(-0.65, abs=1e-3) and box[0].tolist() == [0.0, 2.0]


def test_marks_outside_of_a_panel_are_not_drawn_over_what_is_beside() -> None:
    ax = Figure().subplots()
    axis = Axis("x", "m", 0.0, 1.0)
    for at, clipped in ((0.5, False), (3.0, True)):
        marks = Marks(np.array([at]), np.array([0.5]), "o")
        draw_panel(Panel("p", "", axis, axis, [marks], aspect=1.0), ax)
        assert ax.lines[-1].get_clip_on() == clipped


def test_the_hull_of_points_on_one_line_is_its_ends() -> None:
    """A flat surface that is seen from its edge."""
    np.testing.assert_array_equal(hull(np.array([[1.0, 0.5], [0.0, 0.0], [2.0, 1.0], [1.0, 0.5]])), [[0, 0], [2, 1]])
