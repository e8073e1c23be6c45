"""Modes, response and derivatives of lines on a bed of depths: a trough, a plane, two equilibria."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybrid
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers import changed_scene
from hybrid.scene.sea import Depths
from tests.solve.test_bed_of_depths import PLANE, SLOPE, hill, mooring

G = 9.81


@pytest.mark.parametrize("several", [False, True])
def test_a_line_in_a_trough_swings_as_a_pendulum(several: bool) -> None:
    """As far off its bottom as it is high: w^2 = g kappa + (T/m) (n pi/L)^2, whatever the bed's stiffness."""
    y, length, mass = np.linspace(-8, 8, 17), 100.0, 10.0
    depths = {"x": [-50.0, 0.0, 100.0, 150.0], "y": y.tolist(), "depth": [(-0.025 * y**2).tolist()] * 4}
    slopes = [Depths(**depths).surface.depth_at(50.0, side)[2] for side in (-1e-3, 1e-3)]
    curvature = (slopes[0] - slopes[1]) / 2e-3
    line = {"sections": [{"length": length, "mass": mass, "diameter": 0.05, "axial_stiffness": 1e6}]}
    tables = {"environment": {"gravity": G, "seabed": {"z": 0.0, "stiffness": 1e5, "depths": depths}}}
    places = {"start": [0, 0, 0], "end": [1.0005 * length, 0, 0]}
    if several:
        here = line | {"start": "start", "end": "end", "model": "catenary", "mesh": {"cells": 80}}
        tables |= {"points": {name: {"position": x} for name, x in places.items()}, "lines": {"only": here}}
    else:
        ends = {name: {"kind": "pinned", "position": x} for name, x in places.items()}
        tables |= {"cable": line, "ends": ends, "initial": "equilibrium", "model": "catenary", "mesh": {"cells": 80}}
    found = hybrid.modes(tables, count=3, friction=False).modes
    assert {x.what for x in found} == {"sideways"}
    exact = [2.0 * math.pi / math.sqrt(G * curvature + 500.0 / mass * (math.pi * n / length) ** 2) for n in (1, 2, 3)]
    np.testing.assert_allclose([x.period for x in found], exact, rtol=5e-4)


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_derivatives_on_a_hill_are_those_of_two_equilibria(model: str) -> None:
    """Of a line that lies on its side; without what the turning normal does they are off by up to a tenth."""
    of = ["tension@250", "position.z@30", "position.y@30", "reaction_end.x"]
    made = mooring(hill(), model=model)
    rest = at_rest(made, of)
    for key in ("cable.sections[0].mass", "ends.end.position[0]", "environment.seabed.stiffness"):
        number = rest.number(key)
        ours, d = rest.by([key])[0], 1e-5 * number
        more, less = (at_rest(changed_scene(made, key, number + x), of).values for x in (d, -d))
        np.testing.assert_allclose(ours, (more - less) / (2.0 * d), rtol=1.5e-5, err_msg=key)


def test_a_response_on_depths_of_a_plane_is_that_on_the_plane() -> None:
    """With what it says of line that lifts off the bed."""
    plane, grid = (
        hybrid.response(mooring(x)) for x in ({"z": -100.0, "slope": list(SLOPE)}, {"z": 0.0, "depths": PLANE})
    )
    assert any("lift off the bed" in x for x in plane.notes)
    assert grid.notes == plane.notes
    for what in ("tension", "curvature"):
        there = plane.lines["cable"].deviation(what)
        np.testing.assert_allclose(grid.lines["cable"].deviation(what), there, rtol=1e-6, atol=1e-9 * there.max())
