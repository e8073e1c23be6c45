"""On which side of an obstacle a shape lies, beside that which the scene gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.model.build import build
from hybrid.scene.read import as_scene, one_line
from hybrid.solve.stability import behind_obstacles, obstacles_left
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import over_pipe

RADIUS, AT = 0.5, np.array([5.0, 0.0, -1.0])
SHAPES = {
    "cylinder": {"kind": "cylinder", "axis": [0, 1, 0], "radius": RADIUS},
    "sphere": {"kind": "sphere", "radius": RADIUS},
    "box": {"kind": "box", "size": [2 * RADIUS] * 3, "rounding": 0.1},
}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_shape_on_the_other_side_of_an_obstacle_is_told_from_the_same_side(kind: str) -> None:
    tables = over_pipe(obstacles={"thing": SHAPES[kind] | {"at": AT.tolist()}})
    model = build(one_line(as_scene(tables)))
    line, sea = model.line, model.sea.at_time(0.0)
    width = 0.5 * float(model.cable.outer_diameter.max())
    x = np.linspace(-4.0, 4.0, line.s.size)
    rise = RADIUS + width - np.maximum(np.abs(x) - 0.2, 0.0)
    above, below, away = model.start.copy(), model.start.copy(), model.start.copy()
    for state, side in ((above, 1.0), (below, -1.0), (away, 9.0)):
        state.r[:] = AT + np.stack([x, 0.0 * x, side * rise], axis=1)
    middle = int(np.argmin(np.abs(x)))
    assert list(obstacles_left(line, sea, above, above)) == []
    ((which, node, behind),) = obstacles_left(line, sea, above, below)
    assert which == 0 and behind and abs(x[node]) < RADIUS
    ((_, near, behind),) = obstacles_left(line, sea, above, away)
    assert not behind and abs(near - middle) <= RADIUS / (x[1] - x[0])


@pytest.mark.parametrize(("axis", "height", "behind"), [("y", 0.71, False), ("y", -0.71, True), ("x", -0.49, False)])
def test_a_line_below_a_ring_is_behind_it_and_one_through_its_hole_is_not(
    axis: str, height: float, behind: bool
) -> None:
    """A line that was hung through a ring lay above or below it, by rounding, without an event."""
    ring = {
        "kind": "torus",
        "at": AT.tolist(),
        "axis": {"x": [1, 0, 0], "y": [0, 1, 0]}[axis],
        "ring": 0.6,
        "radius": 0.1,
    }
    model = build(one_line(as_scene(over_pipe(obstacles={"ring": ring}))))
    state = model.start.copy()
    width = float(np.sign(height) * 0.5 * model.cable.outer_diameter.max() * (1 if axis == "y" else -1))
    state.r[:] = AT + np.stack([np.linspace(-4.0, 4.0, model.line.s.size), *np.zeros((2, model.line.s.size))], axis=1)
    state.r[:, 2] += height + width - 0.01 * np.sign(width)
    state.r[[0, -1]] = [[0, 0, 0], [10, 0, 3]]
    assert bool([*behind_obstacles(model.line, model.sea.at_time(0.0), state)]) == behind


# --- A line at rest lies on the side of an obstacle on which the shape given has it, or its result says that it does
# not ---

PIPE = {"kind": "cylinder", "axis": [0, 1, 0], "at": [0, 0, 0], "radius": 0.1}
BOX = {"kind": "box", "at": [0, 0, 0], "size": [0.2, 0.2, 0.2], "rounding": 0.05}
BALL = {"kind": "sphere", "at": [0, 0, 0], "radius": 0.1}
ARCH = [[-1, 0, 0.1], [0, 0, 0.6], [1, 0, 0.1]]
ROPE = {"length": 2.2, "mass": 0.3, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02}


def cable(obstacle: dict[str, Any]) -> dict[str, Any]:
    """A rope between two pins as high as the top of an obstacle, begun as an arch high above it."""
    ends, initial = (pinned_at(*ARCH[0]), pinned_at(*ARCH[-1])), {"kind": "equilibrium", "points": ARCH}
    return cable_scene(ROPE, *ends, obstacles={"a": obstacle}, model="rod", mesh=60, initial=initial)


@pytest.mark.parametrize("obstacle", [PIPE, BOX], ids=["pipe", "box"])
def test_a_line_begun_above_an_obstacle_rests_on_it(obstacle: dict[str, Any]) -> None:
    found = hybrid.static(cable(obstacle))
    r = found.position[-1]
    middle = r[np.argmin(np.abs(r[:, 0]))]
    assert middle[2] == pytest.approx(0.11, abs=0.01)  # on its top, where cells of 0.037 m cut the corner
    assert not [x for x in found.events if "is between" in x.text]


def test_a_line_that_is_not_where_it_was_begun_is_told() -> None:
    found = hybrid.static(cable(BALL))  # from which it slides off to one side
    events = [x for x in found.events if x.kind == "several equilibria" and "obstacle a is between" in x.text]
    assert len(events) == 1
