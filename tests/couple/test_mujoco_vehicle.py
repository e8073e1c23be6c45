"""examples/contact/mujoco_vehicle.py: what its header says, where MuJoCo is installed."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "contact" / "mujoco_vehicle.py"


@pytest.mark.needs("mujoco")
def test_a_tether_in_mujocos_loop_pulls_the_vehicle_and_the_pile() -> None:
    script = runpy.run_path(str(EXAMPLE))
    found = script["main"](21.0)
    result, stiffness, mu = found.result, 2000.0, script["FRICTION"]
    assert not {x.kind for x in result.events} - {"static friction neglected"}
    # both programs have the same places, output for output
    at = np.searchsorted(script["STEP"] * np.arange(1, len(found.vehicle) + 1), result.times[1:] - 1e-9)
    np.testing.assert_allclose(result.position[1:, -1], found.vehicle[at], atol=1e-9)
    np.testing.assert_allclose(result["obstacles/pile/position"][1:], found.pile[at], atol=1e-9)
    # slow as it is, the pile stands where its springs bear what the tether does to it
    push = result["obstacles/pile/force"][-1]
    np.testing.assert_allclose(stiffness * (found.pile[-1] - script["PILE"])[:2], push[:2], rtol=0.05, atol=1.0)
    # the friction that the tether needs to slide: no more than all of it, round the angle between both ends' pulls
    first, last = found.tension[-1]
    x = result.position[-1]
    out, back = x[0] - x[5], x[-1] - x[-6]
    bend = np.pi - np.arccos(out @ back / (np.linalg.norm(out) * np.linalg.norm(back)))
    angle = bend if x[-1, 1] > 0.0 else 2.0 * np.pi - bend
    assert 1.2 * first < last < 1.05 * first * np.exp(mu * angle)
    assert np.linalg.norm(found.pile[-1] - script["PILE"]) > 0.01
