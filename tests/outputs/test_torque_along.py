"""Torque along a line in equilibrium: that of the moments at its nodes, also where output points lie on a seam or clamp."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

SECTION = {"length": 10, "mass": 3, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 200}


def hanging(sections: list[dict[str, Any]], attachments: list[dict[str, Any]]) -> hybrid.Result:
    """A rod with a round section between two pinned ends in a current that turns with depth: nothing twists it."""
    current = [{"z": -6, "velocity": [0.2, -1.0, 0]}, {"z": 0, "velocity": [0.3, 1.2, 0]}]
    scene = cable_scene(
        [x | {"drag": {"normal": 1.2}} for x in sections], pinned_at(0, 0, 0), pinned_at(6, 1, -1),
        attachments=attachments, fluid={"density": 1025, "current": current}, model="rod", mesh=50,
        output={"points": 201}
    )  # fmt: skip
    return hybrid.static(hybrid.validate_scene(scene))


@pytest.mark.parametrize(
    ("sections", "attachments"),
    [
        ([SECTION], [{"kind": "clump", "at": 4, "mass": 10}]),
        ([SECTION], [{"kind": "modules", "range": [4, 7], "buoyancy": 30}]),
        ([SECTION | {"length": 4}, SECTION | {"length": 6, "bending_stiffness": 800}], []),
    ],
    ids=["clump", "modules", "change of section"],
)
def test_no_torque_where_nothing_twists(sections: list[dict[str, Any]], attachments: list[dict[str, Any]]) -> None:
    result = hanging(sections, attachments)
    bending = float(result.bending_moment.max())
    assert bending > 10.0
    assert np.abs(result.torque).max() < 1e-8 * bending
    assert np.abs(result.right.torque).max() < 1e-8 * bending


def test_torque_at_clamps_is_that_of_their_moments() -> None:
    """A twisted line on a slope, in cells too long for its bend at the clamp: torque had the wrong sign there."""
    section = {
        "length": 130, "mass": 10, "diameter": 0.05, "axial_stiffness": 5e6, "bending_stiffness": 800,
        "torsional_stiffness": 600,
    }  # fmt: skip
    tangents = np.array([1.0, 0.0, 0.0]), np.array([0.3, 0.0, 1.0]) / np.hypot(0.3, 1.0)
    start = {"kind": "clamped", "position": [-10, 0, -40], "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    end = {"kind": "clamped", "position": [80, 0, 2], "tangent": [0.3, 0, 1], "normal": [1, 0, 0], "turns": 1.5}
    scene = cable_scene(
        section, start, end, fluid={"density": 1025, "surface": 0},
        seabed={"z": -40, "slope": [0.1, 0], "stiffness": 1e4}, model="rod", mesh=65, output={"points": 131}
    )  # fmt: skip
    result = hybrid.static(hybrid.validate_scene(scene))
    torque, moments = result.torque[-1], (result.moment_start[-1], result.moment_end[-1])
    assert torque[0] == pytest.approx(-moments[0] @ tangents[0], rel=1e-9)
    assert torque[-1] == pytest.approx(moments[1] @ tangents[1], rel=1e-9)
    assert torque == pytest.approx(np.median(torque), rel=0.04)
    bending = np.linalg.norm(moments[0] - (moments[0] @ tangents[0]) * tangents[0])
    assert result.bending_moment[-1, 0] == pytest.approx(bending, rel=1e-9)
