"""A line that hits an obstacle at the speed that its scene gives: how deep it goes, and how fast it comes back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene

WIDTH, SPEED, MASS = 0.02, 10.0, 0.4


def thrown(obstacle: dict[str, Any], height: float, duration: float, speed: float = SPEED) -> hybrid.Result:
    """A rope of 1 m that flies level and down, without gravity."""
    section = {"length": 1.0, "mass": MASS, "diameter": WIDTH, "axial_stiffness": 2e5, "bending_stiffness": 0.1}
    start = {"kind": "straight", "origin": [-0.5, 0, height], "direction": [1, 0, 0], "velocity": [0, 0, -speed]}
    return hybrid.run(cable_scene(
        section, "free", "free", gravity=0, obstacles={"it": obstacle}, initial=start, model="rod", mesh=100,
        time=(duration, duration / 400), output=(duration / 400, 101)
    ))  # fmt: skip


@pytest.mark.parametrize("speed", [3.0, 10.0])
def test_a_rope_that_is_stopped_as_a_whole_goes_an_eighth_of_its_diameter_deep(speed: float) -> None:
    floor = {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 1]}
    result = thrown(floor, 0.6 * WIDTH, 8.0 * 0.125 * WIDTH / speed, speed)
    deep = 0.5 * WIDTH - result.position[:, :, 2].min()
    # p = v sqrt(m/k) = D/8; less than that by half of the onset of contact, 0.01 D, over which the force grows
    assert deep == pytest.approx(WIDTH / 8, rel=0.06)
    np.testing.assert_allclose(result.velocity[-1, :, 2], speed, rtol=1e-2)
    assert not [e for e in result.events if e.kind == "deep in an obstacle"]


def test_a_rope_that_is_stopped_at_a_point_goes_about_as_deep() -> None:
    pipe = {"kind": "cylinder", "at": [0, 0, -0.05], "axis": [0, 1, 0], "radius": 0.05}
    result = thrown(pipe, 0.6 * WIDTH, 0.005)
    deep = (0.05 + 0.5 * WIDTH - np.hypot(result.position[:, :, 0], result.position[:, :, 2] + 0.05)).max()
    assert WIDTH / 16 < deep < WIDTH / 4  # D/8 where it is pressed on slowly, twice that at once
    assert result.position[-1, 0, 2] < -1.5 * WIDTH < 0.9 * WIDTH / 2 < result.position[-1, 50, 2]
    assert not [e for e in result.events if e.kind == "deep in an obstacle"]
