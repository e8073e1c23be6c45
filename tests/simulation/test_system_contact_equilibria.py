"""Equilibria of systems with lines that touch themselves: beside each other, at a body, and runs that begin there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import network_scene

WIDTH = 0.02
HOSE = {
    "length": 4.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.02,
    "torsional_stiffness": 0.016, "damping": {"mass": 0.5},
}  # fmt: skip
LINE = {
    "sections": [HOSE], "attachments": [{"kind": "clump", "at": 2.0, "mass": 2.0}], "mesh": {"cells": 160},
    "contact": {"self": True, "friction": 0.3},
}  # fmt: skip
Y = 0.9 * WIDTH  # m, between the ends of a U
OPEN = [[0, 0, 0], [-0.5, 0, -1.0], [0, 0.5 * Y, -1.85], [0.5, Y, -1.0], [0, Y, 0]]
COMMON = {"time": {"duration": 0.3, "step": 0.01}, "output": {"every": 0.1, "points": 81}}


def beside_each_other(*shifts: float) -> dict[str, Any]:
    """Us whose ends are 0.9 diameters apart, with a weight, y (m) apart; all have the first shape of the first."""
    points, lines = {}, {}
    for k, y in enumerate(shifts):
        points |= {f"a{k}": {"position": [0, y, 0]}, f"b{k}": {"position": [0, y + Y, 0]}}
        lines[f"line {k}"] = LINE | {"start": f"a{k}", "end": f"b{k}", "model": "adaptive", "initial": {"points": OPEN}}
    return COMMON | {"points": points, "lines": lines}


def at_a_body(y: float = -0.01) -> dict[str, Any]:
    """One leg hangs on a body that two ropes, which end at y (m), pull against the other leg; nothing holds its yaw."""
    rope = {"sections": [{"length": 1.1, "mass": 0.1, "axial_stiffness": 1e5}], "model": "catenary", "start": "free"}
    first = [[0, 0, 0], [-0.3, -0.3, -1.0], [0, 0, -1.8], [0.3, 0.3, -1], [0, 0.3, 0.1]]
    return COMMON | network_scene(
        {"a": {"position": [0, 0, 0]}, "left": {"position": [-0.6, y, 0.75]}, "right": {"position": [0.6, y, 0.75]},
         "free": {"kind": "fairlead", "body": "pod", "place": [0, 0, -0.05]}},
        {"hose": LINE | {"start": "a", "end": "free", "model": "rod", "initial": {"points": first}},
         "left": rope | {"end": "left", "mesh": {"cells": 5}}, "right": rope | {"end": "right", "mesh": {"cells": 5}}},
        bodies={"pod": {"kind": "free", "mass": 1.0, "inertia": [0.1] * 3, "initial_guess": [0, 0.3, 0.15]}}
    )  # fmt: skip


def stays(scene: dict[str, Any], static: hybrid.Result, name: str) -> None:
    """A run with friction begins in the equilibrium without, and stays."""
    run = hybrid.run(scene, progress=False).lines[name]
    assert np.abs(run.position - static.lines[name].position).max() < 1e-9
    energy = float(static.lines[name]["energy/self_contact"][0])
    assert run["energy/self_contact"] == pytest.approx(energy, rel=1e-5)


@pytest.mark.long
def test_a_line_that_a_body_presses_against_itself() -> None:
    scene = at_a_body()
    result = hybrid.static(scene)
    hose = result.lines["hose"]
    assert hose["energy/self_contact"][0] > 0.0 and 0.94 < float(hose["self_distance/distance"]) / WIDTH < 1.05
    assert result.attributes["static_residual"] < 1e-9
    without = at_a_body()
    without["lines"]["hose"]["contact"] = {"self": False}
    there = hybrid.static(without)["bodies/pod/position"][0]
    assert np.linalg.norm(result["bodies/pod/position"][0] - there) > 1e-4  # the contact holds it off
    stays(scene, result, "hose")


@pytest.mark.long
@pytest.mark.parametrize("y", [-0.005, -0.02])
def test_the_stiffness_of_a_body_in_contact(y: float) -> None:
    """That of the forces on the body held on both sides, with the contact of the node at its fairlead; yaw is free."""
    scene = at_a_body(y)
    K = hybrid.stiffness(scene, "body:pod").matrix
    assert np.abs(K - K.T).max() < 1e-4 * np.abs(K).max()
    assert np.abs(K[5]).max() < 1e-5 * np.abs(K[3:5]).max()
    for k, heading in enumerate((0.0, 90.0)):
        held = hybrid.offsets(scene, "body:pod", [-2e-5, 2e-5], heading=heading)
        for found, there in ((K[:3, k], held.force), (K[3:, k], held.moment)):
            assert found == pytest.approx((there[0] - there[1]) / 4e-5, rel=3e-3, abs=1e-4 * np.abs(found).max())


@pytest.mark.long
def test_without_a_seabed_no_friction_settles() -> None:
    """What settles is friction on the bed: a line that has none rests where it rests without."""
    scene = beside_each_other(0.0)
    neglected = hybrid.static(scene).lines["line 0"]
    scene["lines"]["line 0"] |= {"initial": {"points": OPEN, "friction": "settled"}}
    assert np.array_equal(hybrid.static(scene).lines["line 0"].position, neglected.position)
