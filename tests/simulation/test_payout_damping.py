"""Lines that are paid out and damped in proportion to their stiffness: the material alone is strained, not what flows."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from test_payout import G, clamped, hanging, sagging

import hybrid
from tests.scenes import cable_scene, clamped_at

TAU = 0.05


def damped(scene: dict[str, Any], tau: float = TAU) -> dict[str, Any]:
    scene = deepcopy(scene)
    scene["cable"]["sections"][0]["damping"] = {"stiffness": tau}
    return scene


def rod(rate: float, step: float = 0.05, duration: float = 8.0) -> dict[str, Any]:
    return clamped(sagging("rod", 2e6, 2e4, rate, step, duration, output={"every": 1.0}))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("rate", [0.5, -0.5])
def test_steady_payout_strains_nothing(dimension: int, rate: float) -> None:
    """40 m that hang at a steady rate: strain and pull are those of the weight below, for a damping time of 0.3 s.

    Without the flow the cell that grows would be strained at c/h, and the pull be EA tau c/h = 7.5 kN more.
    """
    EA, w = 1e5, 2.0 * G
    scene = damped(hanging({"rate": rate, "begin": 0.5, "ramp": 4.0}, 16.0, dimension=dimension), 0.3)
    scene["cable"]["sections"][0]["axial_stiffness"] = EA
    result = hybrid.run(scene)
    steady, length = result.t > 6.0, result["payout/length"]
    assert np.abs(result["reaction_end"][steady, 2] / (w * length[steady]) - 1.0).max() < 2e-5
    z = -length * (1.0 + 0.5 * w * length / EA)
    assert np.abs(result.position[:, 0, 2] - z)[steady].max() < 1e-5
    assert np.abs(result["work/stiffness_damping"][-1]) < 1e-5 * np.abs(result["work/end"][-1])


@pytest.mark.parametrize("rate", [1.0, -1.0])
def test_the_bend_behind_a_clamp_flows_with_the_material(rate: float) -> None:
    """A taut rod that leaves a clamp at an angle phi to its pull P, and is straight on the reel.

    At a distance x the material bends by M = EI (kappa + tau c dkappa/dx), and M' = P (theta - theta of the pull): the
    rod is off the line of its pull by the integral of theta, of roots r < 0 of lam^2 r^2 (1 + tau c r) = 1.
    """
    EI, pull, mass, phi, tau = 4000.0, 1000.0, 1.0, 0.05, 0.5
    section = {"length": 20.0, "mass": mass, "bending_stiffness": EI, "damping": {"stiffness": tau, "mass": 1.0}}
    scene = cable_scene(
        section, {"kind": "free", "force": [-pull, 0, 0]},
        clamped_at([0, 0, 0], [np.cos(phi), 0, np.sin(phi)], payout={"rate": rate, "ramp": 4.0}), gravity=0.0,
        model="rod", mesh=40, time=(12.0, 0.04), output=1.0
    )  # fmt: skip
    square, flow = EI / (pull - mass * rate**2), tau * rate
    roots = np.roots([flow * square, square, 0.0, -1.0])
    roots = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    roots = roots[roots < 0.0]
    if rate > 0.0:
        parts = np.linalg.solve([[1.0, 1.0], roots], [phi, 0.0])  # theta = phi and kappa = 0 at the clamp
    else:
        roots, parts = roots[-1:], np.array([phi])
    exact = float((parts / -roots).sum())
    assert abs(exact / (phi * np.sqrt(square)) - 1.0) > 0.1  # what the flow makes of it
    assert abs(hybrid.run(scene).position[-1, 0, 2]) == pytest.approx(exact, rel=6e-3)


def test_halving_the_step_gives_second_order() -> None:
    """Before the first node enters, behind a clamp that surges: against a sixteenth of the step."""
    found = [hybrid.run(damped(rod(0.8, step, 4.0))) for step in (0.08, 0.04, 0.005)]
    off = [np.abs(x.position[-1] - found[-1].position[-1]).max() for x in found[:2]]
    assert 3.0 < off[0] / off[1] < 5.5


def test_a_winch_that_holds_a_tension() -> None:
    """It goes on as the strain of the line lets it, damped or not: the same length in the end."""
    scene = sagging("rod", 2e6, 2e4, duration=8.0, output={"every": 1.0})
    scene["ends"]["end"]["payout"] = {"longest": 130, "winch": {"tension": 2500, "inertia": 300, "damping": 900}}
    found, plain = hybrid.run(damped(scene)), hybrid.run(scene)
    assert found["payout/length"][-1] == pytest.approx(plain["payout/length"][-1], abs=0.02)
