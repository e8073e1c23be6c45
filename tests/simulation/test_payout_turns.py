"""Turns of the ends of a catenary that is paid out: its torque in outputs that wait, and what is said of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid


def twisted(model: Any = "catenary", **more: Any) -> dict[str, Any]:
    section = {"length": 10.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 30.0,
               "torsional_stiffness": 40.0, "drag": {"normal": 1.2}}  # fmt: skip
    paid = {"rate": 0.5, "begin": 0.2, "ramp": 0.5, "longest": 11.0}
    start = {"kind": "clamped", "position": [6, 0, -7.5], "tangent": [-1, 0, 0.2], "turns": 0.3}
    return {
        "environment": {"fluid": {"density": 1025}}, "cable": {"sections": [section]}, "contact": {"self": False},
        "ends": {
            "start": start,
            "end": {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, 1], "payout": paid},
        },
        "initial": "equilibrium", "model": model, "mesh": {"cells": 24}, "dimension": 3,
        "time": {"duration": 1.2, "step": 0.03}, "output": {"every": 0.3},
    } | more  # fmt: skip


def test_outputs_that_wait_have_the_torque() -> None:
    """GJ theta / L, of the length when the last node entered, in every output; an event says how far off that may be."""
    result = hybrid.run(twisted())
    torque, length = np.abs(result.torque), np.asarray(result["payout/length"])
    exact = 40.0 * 2.0 * np.pi * 0.3 / length
    assert np.ptp(torque, axis=1) == pytest.approx(0.0, abs=1e-9)
    (event,) = (x for x in result.events if x.kind == "torque neglected")
    assert "up to 4.2 % wrong" in event.text
    assert np.abs(torque[:, 0] / exact - 1.0).max() < 0.042


def test_zones_by_hand_are_resumed(tmp_path: Path) -> None:
    zones = {"kind": "zones", "zones": [{"catenary": 4.0}, {"rod": 6.0}]}
    whole, half = hybrid.run(twisted(zones)), tmp_path / "half.h5"
    hybrid.run(twisted(zones, time={"duration": 0.6, "step": 0.03}), half).close()
    hybrid.resume(half, until=1.2)
    with hybrid.open(half) as resumed:
        for name in ("position", "tension", "torque"):
            np.testing.assert_array_equal(resumed[name], whole[name])
