"""A line at rest lies on the side of an obstacle on which the shape given has it, or its result says that it does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid

PIPE = {"kind": "cylinder", "axis": [0, 1, 0], "at": [0, 0, 0], "radius": 0.1}
BOX = {"kind": "box", "at": [0, 0, 0], "size": [0.2, 0.2, 0.2], "rounding": 0.05}
BALL = {"kind": "sphere", "at": [0, 0, 0], "radius": 0.1}
ARCH = [[-1, 0, 0.1], [0, 0, 0.6], [1, 0, 0.1]]
ROPE = {"length": 2.2, "mass": 0.3, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02}


def cable(obstacle: dict[str, Any]) -> dict[str, Any]:
    """A rope between two pins as high as the top of an obstacle, begun as an arch high above it."""
    ends = {"start": {"kind": "pinned", "position": ARCH[0]}, "end": {"kind": "pinned", "position": ARCH[-1]}}
    return {
        "cable": {"sections": [ROPE]}, "obstacles": {"a": obstacle}, "ends": ends, "model": "rod", "mesh": {"cells": 60},
        "initial": {"kind": "equilibrium", "points": ARCH},
    }  # fmt: skip


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
