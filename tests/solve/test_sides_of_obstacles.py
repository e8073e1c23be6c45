"""On which side of an obstacle a shape lies, beside that which the scene gives."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.model.build import build
from hybrid.scene.read import as_scene
from hybrid.solve.flaws import obstacles_left
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
    model = build(as_scene(tables))
    line, sea = model.line, model.sea.at(0.0)
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
