"""The first shape of a search for equilibrium."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.kernels.laws.water import body_drag, half_cell_drag
from hybrid.kernels.machine.compile import kernel
from hybrid.model.build import build
from hybrid.model.initial_shape import current_drag
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at


@kernel
def drag_of_a_half_cell(u, d, il, cn, ct):
    return half_cell_drag(u, d, il, cn, ct)[0]


@kernel
def drag_of_a_body(u, c):
    return body_drag(u, c)[0]


def test_drag_on_the_first_shape_is_that_of_the_kernels():
    scene = hybrid.validate_scene(
        cable_scene(
            {"length": 60, "mass": 3, "diameter": 0.05, "drag": {"normal": 1.2, "tangential": 0.1}},
            pinned_at(0, 0, 0),
            pinned_at(30, 0, -40),
            attachments=[{"kind": "clump", "at": 30, "mass": 20, "drag_area": 0.3}],
            fluid={
                "density": 1025,
                "current": [{"z": -50, "velocity": [0.2, 0.1, 0]}, {"z": 0, "velocity": [1, -1, 0]}],
            },
            model="catenary",
            mesh=6,
        )
    )
    model = build(one_line(scene))
    line, sea, r = model.line, model.sea.values, model.start.r
    expected = np.zeros_like(r)
    u = [tuple(-np.array([np.interp(z, sea.z, sea.current[:, k]) for k in range(3)])) for z in r[:, 2]]
    for c in range(6):
        e = r[c + 1] - r[c]
        size = float(np.linalg.norm(e))
        for i in (c, c + 1):
            expected[i] += drag_of_a_half_cell(u[i], tuple(e / size), 1 / size, line.drag_n[c], line.drag_t[c])
    for i in range(7):
        expected[i] += drag_of_a_body(u[i], line.point_drag[i])
    assert line.point_drag.any() and np.abs(expected).min(axis=0)[0] > 0
    assert current_drag(line, sea, r) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_line_that_falls_into_a_point_has_no_first_shape_of_loads():
    """Hardly any axial stiffness, a current: the catenary stretches until its cells have no directions."""
    section = {"length": 800, "mass": 1.5, "diameter": 0.03, "axial_stiffness": 1e-30, "drag": {"normal": 1.2}}
    scene = hybrid.validate_scene(
        cable_scene(
            section,
            "free",
            pinned_at(0, 0, 0),
            fluid={"density": 1025, "surface": 0, "current": [-2, 0, 0]},
            seabed={"z": -200, "stiffness": 2000},
            model="catenary",
            mesh=16,
        )
    )
    assert np.isfinite(build(one_line(scene)).start.r).all()
