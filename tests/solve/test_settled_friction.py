"""Equilibria that settle with friction on the seabed: pulled tight from where the line would lie without tension."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybrid

MU, WEIGHT, EA = 0.8, 1000.0, 6.0e8


def chain(length: float = 700.0, stiffness: float = EA, cells: int = 1400, **changes: Any) -> dict[str, Any]:
    """A plain chain from an anchor over the bed to a point above it; WEIGHT N per m in water."""
    diameter = 0.15
    mass = WEIGHT / 9.81 + 1000.0 * math.pi * diameter**2 / 4.0
    section = {"length": length, "mass": mass, "diameter": diameter, "axial_stiffness": stiffness}
    return {
        "environment": {"gravity": 9.81, "fluid": {"density": 1000.0, "surface": 100.0},
                        "seabed": {"z": 0.0, "stiffness": 5.0e4, "friction": MU}},
        "cable": {"sections": [section]},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]},
                 "end": {"kind": "pinned", "position": [0.936 * length, 0, 88.0]}},
        "initial": {"kind": "equilibrium", "friction": "settled"},
        "mesh": {"cells": cells},
        "model": "catenary",
        "output": {"errors": False, "points": 701},
        "time": {"duration": 10.0},
    } | changes  # fmt: skip


def static(scene: dict[str, Any]) -> hybrid.Result:
    return hybrid.static(hybrid.validate_scene(scene))


def test_tension_falls_as_friction_that_sticks_says() -> None:
    """Where the travel is below its largest, T'' = (mu w/EA l) T: T falls by e over sqrt(EA l/(mu w)), l = D/100."""
    result = static(chain())
    T = np.ravel(result.tension)
    s = result.s
    fall = math.sqrt(EA * 0.0015 / (MU * WEIGHT))
    middle = (s > 380.0) & (s < 480.0)
    slope = np.polyfit(s[middle], np.log(T[middle]), 1)[0]
    assert slope == pytest.approx(1.0 / fall, rel=5e-3)
    assert T.min() < 1e-3 * T.max()


def test_tension_falls_by_mu_w_where_the_line_slides() -> None:
    """A soft line slides over most of the way to touchdown: T' = mu w there."""
    result = static(chain(stiffness=5.0e6))
    T, s = np.ravel(result.tension), result.s
    slides = (s > 535.0) & (s < 562.0)  # touchdown is at 572 m
    assert np.polyfit(s[slides], T[slides], 1)[0] == pytest.approx(MU * WEIGHT, rel=1e-6)
    assert abs(T[300]) < 1e-3  # friction holds what lies farther in: no tension, and no compression


def test_lateral_place_is_that_of_the_equilibrium_without_friction() -> None:
    """What does not stretch has no travel: settled and neglected friction give the same line."""
    settled = static(chain(stiffness=None, cells=200))
    plain = static(chain(stiffness=None, cells=200, initial={"kind": "equilibrium"}))
    assert np.abs(settled.position - plain.position).max() < 1e-9
    assert settled.tension == pytest.approx(plain.tension, rel=1e-9)


def test_a_stretch_between_two_hanging_ones_keeps_its_middle() -> None:
    """A line whose two ends hang lies on the bed between: tension falls towards the middle from both sides."""
    scene = chain(length=1000.0, cells=1000)
    scene["ends"] = {
        "start": {"kind": "pinned", "position": [0, 0, 88.0]}, "end": {"kind": "pinned", "position": [900, 0, 88.0]}
    }  # fmt: skip
    result = static(scene)
    T = np.ravel(result.tension)
    assert T[500 * 701 // 1001 :][::-1] == pytest.approx(T[: T.size - 500 * 701 // 1001], rel=1e-5, abs=0.1)
    assert T.min() < 1e-3 * T.max()


def test_compression_that_friction_holds_is_told_and_does_not_stop_the_run() -> None:
    """The anchor is pushed towards the line: what lies there is compressed, by less than friction bears."""
    scene = chain(cells=140)
    scene["ends"]["start"]["motion"] = {"surge": [{"amplitude": 5e-5, "period": 10.0}], "ramp": 2.0}
    result = hybrid.run(hybrid.validate_scene(scene))
    told = [event for event in result.events if event.kind == "slack"]
    assert told and "friction holds it on the seabed" in told[0].text
    assert -MU * WEIGHT * 5.0 < result.tension.min() < 0.0
