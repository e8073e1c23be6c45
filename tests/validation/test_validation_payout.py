"""Line that is paid out from a ship: Zajac's straight line, and the example."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.long
def test_laid_at_the_speed_of_the_ship_a_cable_is_a_straight_line() -> None:
    """w cos a = 1/2 rho Cd d V^2 sin^2 a (Zajac 1957): the angle to 1e-3, the pull steady within 0.1 %.

    Seen from the ship it is the line of examples/laying: one that stands still in a current (`towed`).
    """
    speed, depth, length = 1.0, 40.0, 160.0
    section = {
        "length": length, "mass": 2.0, "diameter": 0.04, "axial_stiffness": 2e6, "bending_stiffness": 50.0,
        "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    ship = pinned_at(
        length - 10.6, 0, 0, motion={"velocity": [speed, 0, 0], "ramp": 20}, payout={"rate": speed, "ramp": 20}
    )
    friction = {"axial": 0.5, "lateral": 0.5}
    fluid, bed = {"density": 1025}, {"z": -depth, "stiffness": 2e3, "damping": 5e2}
    result = hybrid.run(cable_scene(
        section, pinned_at(0, 0, -depth), ship, fluid=fluid, seabed={**bed, "friction": friction}, model="rod",
        dimension=2, mesh=160, time=(420, 0.1), output=(1.0, 1201)
    ))  # fmt: skip
    w, k = (2.0 - 1025 * np.pi * 0.04**2 / 4) * 9.81, 0.5 * 1025 * 1.2 * 0.04 * speed**2
    cosine = (np.sqrt(w * w + 4 * k * k) - w) / (2 * k)
    angle = 0.5 * np.pi - result["theta"][-1]
    z = result["position"][-1, :, 2]
    between = (z > -25.0) & (z < -2.0) & (result["s"] < result["payout/length"][-1])
    assert np.abs(angle[between] / np.arccos(cosine) - 1.0).max() < 1e-3
    pull = np.linalg.norm(result["reaction_end"], axis=1)[-60:]
    assert np.ptp(pull) < 1e-3 * pull.mean()
    laid = (result["s"] > 170.0) & (result["s"] < 300.0)
    assert np.abs(result["velocity"][-1, laid]).max() < 1e-3
    towed = hybrid.static(cable_scene(
        section, "free", pinned_at(0, 0, 0), fluid={**fluid, "current": [-speed, 0, 0]}, seabed=bed, model="rod",
        dimension=2, mesh=160, output={"points": 641}
    ))  # fmt: skip
    out, back = result["payout/length"][-1], np.linspace(1.0, 100.0, 100)  # m, from the ship along the cable
    ship_now = result["position"][-1, result["s"] >= out][0]
    for k, axis in ((0, "x"), (2, "z")):
        paid = np.interp(out - back, result["s"], result["position"][-1, :, k] - ship_now[k])
        still = np.interp(length - back, towed["s"], towed["position"][-1, :, k])
        assert np.abs(paid - still)[back < 60.0].max() < 5e-4, axis  # m, above the bend
        assert np.abs(paid - still).max() < 1e-3 * depth, axis  # and at the touchdown, where cells of 1 m bend
    # what is laid runs through this shape: T - (m + added mass) c^2 stands for T
    moves = (2.0 + 1025 * np.pi * 0.04**2 / 4) * speed**2
    assert abs((pull[-1] - moves) / np.linalg.norm(towed["reaction_end"][-1]) - 1.0) < 5e-3


@pytest.mark.long
def test_a_vehicle_goes_down_on_a_tether_that_is_paid_out() -> None:
    """What the head of the example says."""
    result = hybrid.run(EXAMPLES / "rov_descent.yaml")
    assert abs(result["payout/length"][-1] - 998.0) < 1e-9
    pull = np.linalg.norm(result["reaction_end"], axis=1)
    for begin, mean in ((40, 2.26e3), (900, 3.89e3), (1000, 5.70e3)):
        assert abs(pull[begin : begin + 40].mean() / mean - 1.0) < 0.01
    assert abs(result["position"][-1, 0, 2] + 1001.8) < 1.0 and abs(result["position"][-1, 0, 0] - 42.3) < 1.0
    assert abs(result["payout/power"].min() + 6.05e3) < 100.0
