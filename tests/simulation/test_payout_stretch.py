"""Lines that are paid out whose tension is no multiple of strain: tables and fibre ropes."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from test_payout import sagging

import hybrid
from hybrid.errors import SceneError

EA = 2e5
SAME = {"tension_strain": [[0, 0], [0.005, 0.005 * EA], [0.1, 0.1 * EA]]}
# Close to a constant stiffness, whatever its time.
NEAR = {"axial_stiffness": EA, "dynamic_stiffness": {"constant": 1.00001 * EA, "relaxation_time": 2.0}}
TABLE = {"tension_strain": [[0, 0], [0.008, 800], [0.012, 1800], [0.05, 20000]]}
ROPE = TABLE | {"dynamic_stiffness": {"constant": 6e5, "per_tension": 10.0, "relaxation_time": 4.0}}


def paid(
    section: dict[str, Any], rate: float = 0.8, step: float = 0.05, duration: float = 12.0, **more: Any
) -> dict[str, Any]:
    scene = sagging(rate=rate, step=step, duration=duration, **more)
    scene["cable"]["sections"][0] |= section
    return scene


@cache
def linear(rate: float) -> hybrid.Result:
    """The line of constant stiffness."""
    return hybrid.run(paid({"axial_stiffness": EA}, rate))


@pytest.mark.parametrize("rate", [0.8, -0.8])
@pytest.mark.parametrize(("same", "most"), [(SAME, 1e-7), (NEAR, 2e-5)], ids=["table", "rope"])
def test_a_law_that_is_a_constant_stiffness_does_as_that(rate: float, same: dict[str, Any], most: float) -> None:
    """Tension, places and energies, over nodes that enter and leave."""
    one, other = linear(rate), hybrid.run(paid(same, rate))
    assert np.abs(np.diff(one["payout/length"])).sum() > 5.0
    for name in ("reaction_end", "position", "energy/stretch", "work/end", "payout/power"):
        assert np.abs(other[name] - one[name]).max() < most * np.abs(one[name]).max()


def test_a_winch_holds_its_tension_on_a_rope() -> None:
    """The length is an unknown beside a tension that is no multiple of strain: what remains at rest is what is held."""
    winch = {"tension": 2200.0, "inertia": 200.0, "damping": 100.0, "ramp": 4.0}
    scene = paid(ROPE, duration=40.0, step=0.2)
    scene["ends"]["end"] |= {"payout": {"winch": winch, "longest": 130.0}, "motion": None}
    scene["environment"] = {"fluid": {"density": 1025}}
    scene["cable"]["sections"][0]["drag"] = {"normal": 1.2}
    found = hybrid.run(scene)
    pull = np.linalg.norm(found["reaction_end"], axis=1)
    assert pull[-1] == pytest.approx(2200.0, rel=5e-3) and pull[0] < 1900.0


def test_another_rope_on_the_reel_is_refused() -> None:
    scene = paid(ROPE)
    section = scene["cable"]["sections"][0]
    scene["ends"]["end"]["payout"]["reel"] = [{**section, **TABLE, "dynamic_stiffness": None}]
    with pytest.raises(SceneError) as refused:
        hybrid.plan(scene)
    assert "ends.end.payout.reel[0]" in str(refused.value)
