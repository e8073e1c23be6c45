"""Lines on base cells, compiled, are those of the material on nodes, whatever is rod."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.kernels.state.report import FRICTION, SEABED
from hybrid.model.build import build
from hybrid.model.failure import without_hold
from hybrid.model.line import NO_INERTIA, line_on
from hybrid.scene.read import one_line

EXAMPLES = Path(__file__).parents[2] / "examples"
ROUND = 4e-16  # a product and a sum may be one operation


@pytest.mark.parametrize("name", ["touchdown", "rov_tether", "laying", "irregular_sea"])
def test_a_line_on_base_cells_is_that_of_the_material(name: str) -> None:
    """Sections, floats, end bodies, waves, a seabed with friction; any base cells rod, any of their nodes there."""
    scene = hybrid.load_scene(EXAMPLES / f"{name}.yaml", ["model={kind: adaptive, curvature_error: 0.05}"])
    model = build(one_line(scene))
    assert model.layout is not None and model.on_base is not None
    random = np.random.default_rng(1)
    for _ in range(3):
        rod = random.random(model.layout.rod.size) < 0.5
        layout = model.layout._replace(rod=rod, here=random.random(model.layout.starts[-1] + 1) < 0.5)
        more = model.line.bits & (SEABED | FRICTION)
        same = line_on(model.cable, layout.nodes, layout.rod_cells, more, NO_INERTIA)
        line = model.on_base.line(layout, same.bits)
        for field, a, b in zip(line._fields, line, same, strict=True):
            np.testing.assert_allclose(a, b, rtol=ROUND, atol=0.0, err_msg=field)
        assert set(layout.base) <= set(layout.nodes.tolist()) and layout.nodes.size == line.s.size < model.line.s.size


def test_an_end_that_is_let_go_holds_no_later_line() -> None:
    """Zones that change after the release of a clamp make lines without it."""
    scene = hybrid.load_scene(EXAMPLES / "s_tether.yaml")
    data = scene.model_dump(mode="json", exclude_none=True)
    data["ends"]["end"] = {"kind": "clamped", "position": [20, 0, -30], "tangent": [0, 0, -1]}
    model = build(one_line(hybrid.validate_scene(data | {"model": "adaptive"})))
    assert model.layout is not None and model.on_base is not None
    assert model.on_base.line(model.layout, model.line.bits).element[-1] == 1
    free = without_hold(model, 1, 0.0)
    assert free.on_base is not None
    line = free.on_base.line(model.layout, free.line.bits)
    assert line.element[-1] == 0 and not line.kb[-1].any() and line.element[1:-1].all()
