"""The curvature of outputs between nodes, where a line bends to one side before them and to the other side after them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from problems import order

import hybrid
from tests.scenes import cable_scene

LENGTH = 20.0


def beam(cells: int, dimension: int) -> hybrid.Result:
    """A heavy rod clamped at both ends, level: it bends upwards in the middle and downwards beside both clamps."""
    section = {
        "length": LENGTH,
        "mass": 2.0,
        "bending_stiffness": 2e4,
        "axial_stiffness": 1e8,
        "torsional_stiffness": 1e4,
    }
    held = {"kind": "clamped", "tangent": [1, 0, 0]}
    what: dict[str, Any] = cable_scene(
        section, held | {"position": [0, 0, 0]}, held | {"position": [19.995, 0, 0]}, model="rod", mesh=cells,
        output={"points": 1601, "errors": False}
    )  # fmt: skip
    return hybrid.static(what | {"dimension": dimension})


@pytest.mark.parametrize("dimension", [2, 3])
def test_curvature_is_interpolated_through_an_inflection(dimension: int) -> None:
    """Of second order there as elsewhere; its size alone, interpolated, would be of first order and never reach zero."""
    fine = beam(1600, dimension)
    k = fine.curvature[-1]
    inside = (fine.s > 2.0) & (fine.s < 8.0)
    assert k[inside].min() < 2e-3 * k.max()
    errors = []
    for cells in (17, 34, 68):
        found = beam(cells, dimension).curvature[-1]
        errors.append(np.abs(found - k)[inside].max() / k.max())
    assert order(errors)[-1] > 1.8 and errors[-1] < 2e-3, errors


def test_extremes_have_the_curvature_of_the_moment_and_of_the_unloaded_line_as_vectors() -> None:
    """0.3/m without load, and across them 0.4/m of a given moment make 0.5/m, behind the seam 0.2/m 0.36/m."""
    section = {"mass": 0.1, "axial_stiffness": 1e6, "torsional_stiffness": 1e3, "intrinsic_curvature": [0.3, 0.0, 0.0]}
    found = hybrid.run(
        {
            "environment": {"gravity": 0.0},
            "cable": {"sections": [section | {"length": 0.1, "bending_stiffness": EI} for EI in (100.0, 200.0)]},
            "ends": {
                "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [0, 1, 0]},
                "end": {"kind": "free", "moment": [0.0, 0.0, 40.0]},
            },
            "initial": "equilibrium", "model": "rod", "mesh": {"cells": 20}, "time": {"duration": 0.02, "step": 0.01},
            "output": {"every": 0.01, "points": 3},
        }
    )  # fmt: skip
    high, shown = np.asarray(found["envelope"]["curvature_max"]), found.curvature[0]
    assert high == pytest.approx(np.repeat([0.5, np.hypot(0.3, 0.2)], 11), rel=2e-4)
    assert high[[0, 10, -1]] == pytest.approx(shown, rel=1e-12)
    assert high[11] == pytest.approx(found["right/curvature"][0, 0], rel=1e-12)
