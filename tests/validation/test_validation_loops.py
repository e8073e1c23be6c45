"""Clamped rods under thrust and torque, and the localised loop, against closed solutions (docs/loops.md).

EI = 1, L = 1, GJ = 0.8, 320 cells.  The figures are of a slack that goes to zero, so tolerances are of the slack.
"""

import math

import numpy as np
import pytest

import hybrid
from hybrid.store.capacity import formation_tension
from tests.scenes import cable_scene


def clamped(slack: float, turns: float) -> hybrid.Result:
    """The equilibrium of a rod whose clamps are nearer than its length by `slack`, and turned against each other."""
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": 0.8}
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    return hybrid.static(
        hybrid.validate_scene(
            cable_scene(
                section,
                {**clamp, "position": [0, 0, 0]},
                {**clamp, "position": [1.0 - slack, 0, 0], "turns": turns},
                gravity=0.0,
                model="rod",
                mesh=320,
            )
        )
    )


@pytest.mark.parametrize("slack", [1e-3, 4e-3])
def test_euler_load_of_a_clamped_rod(slack):
    """4 pi^2 EI/L^2 = 39.478, and half of the slack more beyond it."""
    force = -clamped(slack, 0.0)["reaction_end"][0, 0]
    assert force == pytest.approx(4.0 * math.pi**2 * (1.0 + 0.5 * slack), rel=1e-3)


@pytest.mark.parametrize("slack", [1e-3, 4e-3])
def test_torque_alone_buckles_a_clamped_rod(slack):
    """The end force vanishes at M L/EI = 2 x 4.4934 = 8.9868, the first root of tan x = x, doubled."""
    turns = [1.78, 1.79]
    forces, torques = zip(
        *((r["reaction_end"][0, 0], r["torque"][0].mean()) for r in (clamped(slack, x) for x in turns)), strict=True
    )
    part = -forces[0] / (forces[1] - forces[0])
    assert abs(part) < 10.0
    assert torques[0] + part * (torques[1] - torques[0]) == pytest.approx(8.9868, rel=5e-3)


def test_the_localised_loop():
    """Eight turns and a slack of 0.0614: M = 39.180, T from slack = 4 sqrt(1 - m^2) sqrt(EI/T) (Coyne 1990)."""
    found = clamped(0.0614, 8.0)
    torque, tension = found["torque"][0].mean(), found["reaction_end"][0, 0]
    assert torque == pytest.approx(39.180, rel=5e-4)
    m = torque / (2.0 * math.sqrt(tension))
    assert 4.0 * math.sqrt(1.0 - m * m) / math.sqrt(tension) == pytest.approx(
        0.0614, rel=3e-2
    )  # sensitive: m is near 1
    assert torque / 0.8 + 4.0 * math.acos(m) == pytest.approx(16.0 * math.pi, rel=1e-3)
    needed = formation_tension(np.array([torque]), np.ones(1))[0]
    assert needed == pytest.approx(tension, rel=0.12) and needed < tension  # near the margin of forming


def test_no_turn_is_lost_whatever_the_cells():
    """Six turns of a nearly straight rod: Newton at once ends without them with 324 cells."""
    section = {"length": 4, "mass": 0.3, "diameter": 0.015, "bending_stiffness": 1.0, "torsional_stiffness": 0.7}
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    ends = {"start": clamp | {"position": [0, 0, 0]}, "end": clamp | {"position": [3.99, 0, 0], "turns": 6}}
    scene = {"environment": {"gravity": 0}, "cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium"}
    torques = []
    for cells in (316, 324):
        found = hybrid.static(hybrid.validate_scene(scene | {"model": "rod", "mesh": {"cells": cells}}))
        assert found["turns/link"][0] == pytest.approx(6.0, abs=1e-9)
        torques.append(found["torque"][0].mean())
    assert torques[1] == pytest.approx(torques[0], rel=1e-5)


@pytest.mark.parametrize(("slack", "turns"), [(0.0614, 8.0), (0.0614, -8.0), (0.004, 1.3)])
def test_link_is_the_turns_put_in(slack, turns):
    """Twist goes into writhe, and their sum stays; a closed polygon has no error of cells in it."""
    found = clamped(slack, turns)
    assert found["turns/link"][0] == pytest.approx(turns, abs=1e-9)
    assert found["turns/twist"][0] == pytest.approx(found["torque"][0].mean() / (0.8 * 2.0 * math.pi), rel=2e-3)
    if abs(turns) == 8.0:  # 4 acos m of the localised loop, in turns
        m = abs(found["torque"][0].mean()) / (2.0 * math.sqrt(found["reaction_end"][0, 0]))
        writhe = math.copysign(4.0 * math.acos(m) / (2.0 * math.pi), turns)
        assert found["turns/writhe"][0] == pytest.approx(writhe, rel=0.02)
