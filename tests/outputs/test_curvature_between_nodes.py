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
