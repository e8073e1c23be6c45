"""Several lines that start straight or along polylines, at rest where the scene has them, and not in equilibrium."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
from hybrid.errors import SceneError
from tests.problems import tables_with
from tests.scenes import cable_scene, network_scene, pinned_at

EA, LENGTH, MASS, GRAVITY = 4e4, 4.0, 60.0, 9.81
SECTION = {"length": LENGTH, "mass": 0.01, "axial_stiffness": EA, "bending_stiffness": 1e3, "diameter": 0.02}
DOWN = {"kind": "straight", "direction": [0, 0, -1]}


def between_springs(**changes: Any) -> dict[str, Any]:
    """A weight between two light rods, one above it and one below, both straight and without tension at first."""
    line = {"sections": [SECTION], "initial": DOWN, "mesh": {"cells": 2}, "model": "rod"}
    scene = network_scene(
        {"top": {"position": [0, 0, 0]}, "foot": {"position": [0, 0, -2 * LENGTH]},
         "weight": {"initial_guess": [0, 0, -LENGTH], "mass": MASS}},
        {"upper": {"start": "top", "end": "weight"} | line, "lower": {"start": "weight", "end": "foot"} | line},
        gravity=GRAVITY, time=(0.6, 0.002, 1.0), output=0.02
    )  # fmt: skip
    return dict(tables_with(scene, changes))


def test_a_weight_let_go_between_two_springs_oscillates_about_its_rest() -> None:
    """z = -g/w^2 (1 - cos w t), w^2 = 2 EA/(L m); the rods have 1e-3 of its mass, a third of which moves with it."""
    result = hybrid.run(between_springs())
    w = np.sqrt(2.0 * EA / (LENGTH * (MASS + 2.0 * LENGTH * SECTION["mass"] / 3.0)))
    sink = GRAVITY / w**2 * (1.0 - np.cos(w * result.times))
    moved = result["points/weight/position"][:, 2] + LENGTH
    assert 1.2 < w * result.times[-1] / (2.0 * np.pi) < 3.0
    assert np.abs(moved + sink).max() < 2e-3 * sink.max()
    assert np.abs(result.lines["upper"]["tension"][:, 0] - EA * sink / LENGTH).max() < 5e-3 * EA * sink.max() / LENGTH
    assert not {"static_path", "static_residual"} & {*result.attributes}


FLOOR = {"obstacles": {"floor": {"kind": "plane", "at": [0, 0, -9], "normal": [0, 0, 1]}}}
BALL = {"mass": 1.0, "inertia": [1, 1, 1], "shape": {"kind": "sphere", "radius": 0.3}}


@pytest.mark.parametrize("more", [FLOOR, {"bodies": {"ball": BALL | {"initial_guess": [0, 0, -5]}}}, {"dimension": 2}])
def test_a_straight_line_that_nothing_holds_begins_where_its_first_point_is(more: dict[str, Any]) -> None:
    """Beside an obstacle, a body with a shape and in a plane: pydantic missed the origin of s = 0, with a traceback."""
    line = {"start": "a", "end": "b", "sections": [SECTION], "initial": DOWN, "mesh": {"cells": 4}, "model": "rod"}
    result = hybrid.run({
        "points": {"a": {"initial_guess": [0.5, 0, 1]}, "b": {"initial_guess": [0.5, 0, 1 - LENGTH]}},
        "lines": {"one": line}, "time": {"duration": 0.2, "step": 0.02},
    } | more)  # fmt: skip
    fallen = result.lines["one"]["position"][-1] - result.lines["one"]["position"][0]
    np.testing.assert_allclose(result.lines["one"]["position"][0, 0], [0.5, 0, 1])
    np.testing.assert_allclose(fallen, np.tile([0, 0, -0.5 * GRAVITY * 0.2**2], (len(fallen), 1)), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"lines.lower.initial": None}, "line upper starts so"),
        ({"lines.upper.initial": DOWN | {"velocity": [1, 0, 0]}}, "the points of the line start at rest"),
        ({"lines.upper.initial": {"kind": "straight", "direction": [1, 0, 0]}}, "lines.upper.initial.direction"),
        ({"lines.lower.initial": {"kind": "points", "points": [[0, 0, -4], [0, 0, -7.9]]}}, "lines.lower.initial"),
    ],
)
def test_what_contradicts_is_refused_at_its_key(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        hybrid.run(between_springs(**changes))


def test_such_a_start_is_where_the_search_of_a_rest_begins() -> None:
    """Of the same scene the equilibrium alone: the weight hangs from two strings, 2 T cos(angle) = m g."""
    away, down = 2.0, np.sqrt(LENGTH**2 - 2.0**2)
    section = SECTION | {"bending_stiffness": None}
    line = {"sections": [section], "mesh": {"cells": 2}, "model": "catenary"}
    lines = {
        name: line | {"start": name, "end": "weight", "initial": {"kind": "straight", "direction": [side * away, 0, -down]}}
        for name, side in (("west", 1), ("east", -1))
    }  # fmt: skip
    result = hybrid.static(network_scene(
        {"west": {"position": [-away, 0, 0]}, "east": {"position": [away, 0, 0]},
         "weight": {"initial_guess": [0, 0, -down], "mass": MASS}},
        lines, gravity=GRAVITY
    ))  # fmt: skip

    def missing(z: float) -> float:
        long = np.hypot(away, z)
        return 2.0 * EA * (long / LENGTH - 1.0) * z / long - (MASS + LENGTH * SECTION["mass"]) * GRAVITY

    found = -result["points/weight/position"][-1, 2]
    assert found == pytest.approx(brentq(missing, down, 2.0 * down, xtol=1e-12), rel=1e-6)
    assert found > down + 1e-2


HANG = {"length": 2.0, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 2e3}
PULL = 20.0


def hanging(model: str, cells: int, **initial: Any) -> dict[str, Any]:
    """A soft line that hangs from a pin, pulled down: u = (F s + w (L s - s^2/2))/EA, in corners that are not even."""
    w = HANG["mass"] * GRAVITY
    s = 2.0 * np.linspace(0.0, 1.0, 9) ** 1.3
    depth = s + (PULL * s + w * (2.0 * s - 0.5 * s**2)) / HANG["axial_stiffness"]
    corners = np.column_stack([0.0 * s, 0.0 * s, -depth])
    return cable_scene(
        HANG | {"bending_stiffness": 0.1}, pinned_at(0, 0, 0), {"kind": "free", "force": [0, 0, -PULL]},
        gravity=GRAVITY, mesh=cells, model=model, time=(0.5, 0.005), output=0.01,
        initial={"kind": "points", "points": corners.tolist(), **initial}, dimension=3
    ) | ({"s": s.tolist()} if not initial else {})  # fmt: skip


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_a_line_that_starts_stretched_as_it_hangs_stays_there(model: str) -> None:
    """Spread evenly over the same polyline it bounces along its length by a third of what it is stretched."""
    scene = hanging(model, 40)
    s = scene.pop("s")
    stretch = HANG["mass"] * GRAVITY * 2.0 / HANG["axial_stiffness"]  # u at the end, m

    def moves(initial: dict[str, Any]) -> float:
        x = hybrid.run(hanging(model, 40, **initial))["position"][:, :, 2]
        return float(np.abs(x - x[0]).max())

    assert moves({"arc_lengths": s}) < 0.02 * stretch
    del scene["initial"]["points"][1:-1]
    x = hybrid.run(scene)["position"][:, :, 2]
    assert np.abs(x - x[0]).max() > 0.1 * stretch


def test_lines_that_nothing_holds_fall_and_have_no_equilibrium() -> None:
    """Two lines that meet at a free point: their middle falls by g t^2/2; at rest they are refused."""
    line = {"sections": [SECTION | {"length": 2.0}], "mesh": {"cells": 4}, "model": "rod"}
    scene = network_scene(
        {x: {"kind": "free", "initial_guess": [k, 0, 0]} for x, k in (("a", 0), ("b", 2), ("c", 4))},
        {"left": {"start": "a", "end": "b", "initial": {"kind": "straight", "direction": [1, 0, 0]}} | line,
         "right": {"start": "b", "end": "c", "initial": {"kind": "straight", "direction": [1, 0, 0]}} | line},
        gravity=GRAVITY, time=(0.5, 0.01)
    )  # fmt: skip
    result = hybrid.run(scene, progress=None)
    for name in scene["lines"]:
        fallen = result.lines[name]["position"][:, :, 2]
        assert np.abs(fallen + 0.5 * GRAVITY * result.times[:, None] ** 2).max() < 1e-9
    with pytest.raises(SceneError, match="nothing holds it"):
        hybrid.static(scene)
