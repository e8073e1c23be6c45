"""A line that has buckled out of its plane and come back goes on in the plane, as it would in space."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bits import Stopping, differences, went_on

import hybrid
from hybrid.simulation.plane_monitor import PlaneMonitor

STEP = 0.1


def storm(duration: float) -> hybrid.Scene:
    """A mooring line in a storm: it buckles on the seabed at 118 s and again at 331 s."""
    section = {
        "length": 250, "mass": 20, "diameter": 0.05, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
        "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    waves = {"kind": "jonswap", "significant_height": 6, "peak_period": 11, "gamma": 2.5, "ramp": 60, "seed": 3}
    fluid = {"density": 1025, "surface": 0, "waves": waves | {"direction": 0}}
    return hybrid.validate_scene(
        {
            "environment": {"fluid": fluid, "seabed": {"z": -100, "stiffness": 5e3, "damping": 5e2}},
            "cable": {"sections": [section]},
            "ends": {
                "start": {"kind": "pinned", "position": [0, 0, -100]},
                "end": {"kind": "pinned", "position": [205, 0, -5], "motion": {"follow": "waves"}},
            },
            "initial": "equilibrium", "model": "rod", "mesh": {"cells": 40},
            "time": {"duration": duration, "step": STEP}, "output": {"every": 0.5},
        }
    )  # fmt: skip


@pytest.mark.long
def test_a_line_that_has_buckled_comes_back_to_its_plane(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the plane its forces are those in space, and what was left across it leads to the same next buckle."""
    flat = hybrid.run(storm(333.0))
    monkeypatch.setattr(PlaneMonitor, "attach", _never_back(PlaneMonitor.attach))
    space = hybrid.run(storm(333.0))
    assert [e.kind for e in flat.events].count("out of plane") == 1
    t, across, there = flat.t, *(np.abs(x.position[:, :, 1]).max(axis=1) for x in (flat, space))
    in_plane = (t > 120.0) & (across == 0.0)
    assert 30.0 < 0.5 * in_plane.sum() < 60.0  # s; it comes back at 283 s
    assert 0.0 < there[in_plane].max() < 2e-3
    force = np.linalg.norm(flat.reaction_end - space.reaction_end, axis=1)[in_plane]
    assert force.max() < 1e-4 * np.linalg.norm(space.reaction_end, axis=1).max()
    assert there[-1] > 0.01  # and buckles again, by centimetres, as what was 1e-7 of the length has grown
    assert abs(across[-1] / there[-1] - 1.0) < 0.05


@pytest.mark.slow
def test_a_run_that_comes_back_is_resumed_bit_for_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From before it leaves its plane, from space, and from the plane again."""
    scene = storm(333.0)
    hybrid.run(scene, tmp_path / "unbroken.h5").close()
    stopping = Stopping(monkeypatch)
    assert went_on(scene, tmp_path / "run.h5", stopping, [2000, 1000]) == 2
    assert differences(tmp_path / "unbroken.h5", tmp_path / "run.h5") == []


def _never_back(attach):
    def without(self, run, line):
        self.comes_back = False
        attach(self, run, line)

    return without
