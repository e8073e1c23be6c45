"""Zones of a line whose length is set from Python, after a step that was taken back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybrid

SCENE: dict[str, Any] = {
    "environment": {
        "fluid": {"density": 1025, "surface": 0, "current": [0.3, 0, 0]},
        "seabed": {"z": -40, "stiffness": 1e4, "damping": 100, "friction": 0.4},
    },
    "cable": {"sections": [{"length": 85, "mass": 8, "diameter": 0.04, "axial_stiffness": 5e6, "bending_stiffness": 300,
                            "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}]},
    "ends": {"start": {"kind": "pinned", "position": [0, 0, -40]},
             "end": {"kind": "pinned", "position": [60, 0, 0], "payout": {"longest": 110}}},
    "initial": "equilibrium", "model": "adaptive", "mesh": {"cells": 43},
    "time": {"duration": 10, "step": 0.05}, "output": {"every": 0.05},
}  # fmt: skip


def driven(again: int) -> hybrid.Result:
    """32 steps of a length that grows faster and faster; the step `again` is computed, taken back and computed."""
    with hybrid.Simulation(SCENE) as sim:
        for n in range(32):
            turned = 2.0 * math.pi * (sim.t + 0.05) / 10.0
            length, rate = 89.0 - 4.0 * math.cos(turned), 0.8 * math.pi * math.sin(turned)
            if n == again:
                saved = sim.save()
                sim.set_length(length, rate)
                sim.step()
                sim.restore(saved)
            sim.set_length(length, rate)
            sim.step()
        return sim.result()


@pytest.mark.long
def test_rods_at_a_winch_are_those_of_the_last_node_after_a_step_is_taken_back() -> None:
    assert np.array_equal(driven(-1).tension, driven(22).tension)
