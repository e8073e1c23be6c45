"""On which side of an obstacle a shape lies, beside that which the scene gives."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.model.build import build
from hybrid.scene.read import as_scene, one_line
from hybrid.solve.flaws import behind_obstacles, obstacles_left
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
