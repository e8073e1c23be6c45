"""Modes and responses of lines whose tension makes a torque and is no multiple of strain.

While tensions T stay on a piece s = a + b T of the law, a line of EA = (1 + a)/b that is 1 + a times as long, with stiffness
and mass that make it the same, has the same equations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene

TABLE = [[0, 0], [0.002, 100], [0.004, 240], [0.02, 2500]]
SLOPE = (2500.0 - 240.0) / 0.016
PIECE = (0.004 - 240.0 / SLOPE, 1.0 / SLOPE)
EA, E, T = 5e4, 2e5, 600.0
ROPE = {"axial_stiffness": EA, "dynamic_stiffness": {"constant": E, "relaxation_time": 100.0}}
LENGTH, C = 60.0, 5e-3


def line(law: dict[str, Any], gravity: float, x: float, longer: float = 1.0, **more: Any) -> dict[str, Any]:
    """A line between two clamps, twisted by a turn; longer: than 60 m, with the stiffness that makes it the same."""
    section = {
        "length": LENGTH * longer, "mass": 0.6 / longer, "bending_stiffness": 2.0 * longer,
        "torsional_stiffness": 8.0 * longer, "tension_torque": C, "rotary_inertia": 1e-3 / longer,
        "damping": 0.05, "max_strain": 0.05,
    } | law  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 1, 0]}
    motion = {"surge": {"amplitude": 0.01, "period": 3.0}, "heave": {"amplitude": 0.02, "period": 3.0}, "ramp": 6.0}
    return cable_scene(
        section, {**clamp, "position": [0, 0, 0]}, {**clamp, "position": [x, 0, 0], "turns": 1.0, "motion": motion},
        gravity=gravity, model="rod", mesh=24, time=(1.0, 0.05)
    ) | more  # fmt: skip


def same(law: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """A line by a law, and one of a constant stiffness with the same equations about its rest."""
    if law == "table":
        a, b = PIECE
        given, gravity, x = {"tension_strain": TABLE}, 9.81, 60.4
    else:  # straight and of one tension, about which it is as stiff as it is fast
        a, b = T / EA - T / E, 1.0 / E
        given, gravity, x = ROPE, 0.0, LENGTH * (1.0 + T / EA) - 2.0 * np.pi * C
    return line(given, gravity, x), line({"axial_stiffness": (1.0 + a) / b}, gravity, x, 1.0 + a)


@pytest.mark.parametrize("law", ["table", "rope"])
@pytest.mark.long  # 3 s of 2 cases
def test_modes_are_those_of_its_piece(law: str) -> None:
    one, other = (hybrid.modes(x, 12).modes for x in same(law))
    found, expected = (np.array([m.frequency for m in x]) for x in (one, other))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    made, _ = same(law)
    made["cable"]["sections"][0]["tension_torque"] = 0.0
    plain = np.array([m.frequency for m in hybrid.modes(made, 12).modes])
    assert np.abs(plain / found - 1.0).max() > 1e-3


@pytest.mark.parametrize("law", ["table", "rope"])
def test_a_response_is_that_of_its_piece(law: str) -> None:
    one, other = (hybrid.response(x).lines["cable"] for x in same(law))
    for name in ("position", "tension"):
        found, expected = getattr(one, name), getattr(other, name)
        assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max(), name


def test_a_response_as_in_time() -> None:
    """Of a rope, which is as stiff as it is fast where waves are short beside its relaxation time."""
    made, _ = same("rope")
    made |= {"time": {"duration": 60.0, "step": 0.02}, "output": {"every": 0.1, "points": [30.0]}}
    made["cable"]["sections"][0]["damping"] = 0.5
    here = hybrid.response(made).lines["cable"]
    result = hybrid.run(made)
    late = result.times > 42.0
    there = np.sqrt(2.0) * result.tension[late, 0].std()
    at = float(np.interp(30.0, here.middle, np.abs(here.tension[0])))
    assert at == pytest.approx(there, rel=1e-2)
