"""Boxes, rings, sheaves and meshes beside what else a scene may have: motions, several lines, resume, zones, payout, accuracy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.validation.obstacle_scenes import CENTRELINE, DRUM, Tables, as_lines, over_pipe, paid_over_drum
from tests.validation.test_validation_moving_obstacles import pushed, stepped
from tests.validation.test_validation_obstacles_accuracy import ASKED, DRAGGED, LOW, parts

DATA = Path(__file__).parents[1] / "data"
SHAPES: dict[str, Tables] = {
    "box": {"kind": "box", "size": [0.3, 0.24, 0.6], "rounding": 0.06, "rotation": [10, 20, 30]},
    "torus": {"kind": "torus", "axis": [0.3, 0.1, 1], "ring": 0.12, "radius": 0.06},
    "sheave": {"kind": "sheave", "axis": [0.3, 0.1, 1], "radius": 0.12, "groove": 0.04, "rim": 0.03},
    "mesh": {"kind": "mesh", "file": str(DATA / "block.obj"), "scale": 0.1, "rotation": [10, 20, 30]},
}
STRAND = 0.01  # m, radius of the rope that is pushed


def by(kind: str, **more: Any) -> Tables:
    """The rope that a bar pushes aside, by a box, ring or sheave that moves and turns as the bar."""
    tables = pushed(**more)
    for end in tables["ends"].values():
        end["position"][2] = 0.35  # so that its middle is as high as what pushes it
    bar = tables["obstacles"]["bar"]
    tables["obstacles"]["bar"] = SHAPES[kind] | {key: bar[key] for key in ("at", "friction", "motion")}
    return tables


@pytest.fixture(scope="module", params=SHAPES)
def aside(request: pytest.FixtureRequest) -> Any:
    return hybrid.run(by(request.param)), request.param


def test_a_line_lies_on_what_has_moved_and_turned(aside: Any) -> None:
    """Gaps by the closed forms of the scene, in axes of the obstacle: none is deeper than the radius, contact is there."""
    result, kind = aside
    solid = hybrid.validate_scene(by(kind)).obstacles["bar"]
    still, gaps = np.array(solid.at), []
    for k, x in enumerate(result.position):
        place, vector = result["obstacles/bar/position"][k], np.radians(result["obstacles/bar/rotation"][k])
        angle = vector[1]  # it turns about the y axis alone
        assert np.abs(vector[[0, 2]]).max() < 1e-9
        c, s = np.cos(angle), np.sin(angle)
        local = (x - place) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) + still
        gaps.append(min(solid.distance(tuple(p)) for p in local) - STRAND)
    assert min(gaps) > -STRAND
    deep = 0.4 if kind == "mesh" else 0.2  # a sharp edge is pressed on at a point
    pressed = np.linalg.norm(result["obstacles/bar/force"], axis=1) > 0.5
    assert pressed.any() and np.abs(np.array(gaps)[pressed]).max() < deep * STRAND
    assert result.position[:, 15:45, 1].max() > 0.05


def test_what_a_moving_shape_does_is_booked(aside: Any) -> None:
    result, _ = aside
    done = result["work/obstacles"][-1]
    assert done > 0.0
    assert -0.1 * done < result["work/scheme"].min() <= result["work/scheme"].max() < 1e-3 * done


def test_a_shape_that_is_set_from_outside_moves_as_by_a_motion(aside: Any) -> None:
    result, kind = aside
    tables = by(kind)
    del tables["obstacles"]["bar"]["motion"]
    tables["obstacles"]["bar"]["from_outside"] = True
    _, other = stepped(tables, False)
    np.testing.assert_allclose(other.position, result.position, atol=1e-3)


# --- at rest: zones that move, accuracy, payout --------------------------------------------------------

BEAM = {"kind": "box", "at": [4, 0, -2.1], "size": [2.0, 3.0, 2.2], "rounding": 0.6, "rotation": [5, -10, 15],
        "friction": 0.3}  # fmt: skip


def test_zones_that_move_on_a_beam_have_the_answer_of_rods() -> None:
    tables = over_pipe(obstacles={"beam": BEAM}, mesh={"cells": 96}, time={"duration": 1.0, "step": 0.01})
    moving = {"kind": "adaptive", "always_move": True, "tolerance": 1e-3}
    rods, zones = hybrid.run(tables), hybrid.run(tables | {"model": moving})
    assert {x.kind for row in zones.zones for x in row} == {"rod", "catenary"}
    off = np.linalg.norm(np.array(zones.position) - np.array(rods.position), axis=2).max()
    assert off < 0.012  # their tolerance, 1e-3 of 12 m
    system = hybrid.run(as_lines(tables | {"model": moving})).lines["rope"]
    np.testing.assert_allclose(system.position, zones.position, atol=1e-4)


@pytest.mark.long
def test_what_is_asked_is_met_on_a_beam() -> None:
    tables = DRAGGED | {"obstacles": {"beam": BEAM | {"rounding": 1.0}}}
    duration = tables["time"]["duration"]
    truth = hybrid.run(tables | {"mesh": {"cells": 600}, "time": {"duration": duration, "step": 0.005}})
    result = hybrid.run(tables | {"accuracy": "2%"})
    assert "accuracy missed" not in {x.kind for x in result.events}
    for name, (said, true) in parts(result, truth).items():
        assert true < ASKED, (name, said, true)
        assert said > LOW * true, (name, said, true)


def test_a_line_is_paid_out_through_a_groove() -> None:
    """e^(mu phi) between winch and free end, as over a cylinder; a smooth groove passes the tension on."""
    tables = paid_over_drum(0.3, 0.1)
    tables["obstacles"]["drum"] = {"kind": "sheave", "at": [0, 0, 0], "axis": [0, 1, 0], "radius": DRUM, "groove": 0.02,
                                   "rim": 0.01, "friction": 0.3}  # fmt: skip
    result = hybrid.run(tables)
    pull = float(np.linalg.norm(result["reaction_end"][-1]))
    assert np.log(pull / 8.0) / (0.3 * 2.0) == pytest.approx(-1.0, abs=0.01)
    assert result["work/friction"][-1] < 0.0
    assert np.linalg.norm(result.position[-1][:, [0, 2]], axis=1).min() > CENTRELINE - 0.001
