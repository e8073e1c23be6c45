"""Friction that has settled in a current: what lies on the bed stays where it was laid in still water."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from random_scenes import random_network

import hybrid
from tests.scenes import cable_scene

Tables = dict[str, Any]
CHAIN = {
    "length": 90.0, "mass": 40.0, "diameter": 0.08, "axial_stiffness": 1.7e8, "drag": {"normal": 1.33, "tangential": 0.2},
    "added_mass": {"normal": 1.0}, "damping": {"mass": 0.3},
}  # fmt: skip
ANCHOR, TOP, MU = [75.0, 0.0, -35.0], [0.0, 0.0, -13.0], 0.5
WEIGHT = (40.0 - 1025.0 * np.pi * 0.04**2) * 9.80665  # N/m in water
DRAG = 0.5 * 1025.0 * 1.33 * 0.08 * 0.8**2  # N/m on what lies across the current


def sea(ramp: float = 0.0) -> Tables:
    current = {"velocity": [0, 0.8, 0], "ramp": ramp} if ramp else [0, 0.8, 0]
    bed = {"z": -35, "stiffness": 5e3, "damping": 5e2, "friction": MU}
    return {"fluid": {"density": 1025, "current": current}, "seabed": bed}


def chain(friction: str = "settled", **more: Any) -> Tables:
    """A chain along x, most of it on the bed, in a current along y."""
    return cable_scene(
        CHAIN, {"kind": "pinned", "position": ANCHOR}, {"kind": "pinned", "position": TOP}, environment=sea(),
        model="catenary", mesh=90, initial={"kind": "equilibrium", "friction": friction}, output={"points": 91}
    ) | more  # fmt: skip


def test_a_chain_across_a_current_lies_where_it_was_laid() -> None:
    """As where the current comes up in time; without friction it is swept ten times as far."""
    settled, swept = hybrid.static(chain()), hybrid.static(chain("neglected"))
    grown = hybrid.run(
        chain("neglected", environment=sea(ramp=60.0), time={"duration": 200.0, "step": 0.25}, output={"every": 50, "points": 91})
    )  # fmt: skip
    lies = settled.position[0, :, 2] < -34.99
    assert DRAG < 0.3 * MU * WEIGHT  # friction holds what lies
    bow, like, free = (np.abs(x.position[-1, :, 1]).max() for x in (settled, grown, swept))
    assert free > 8.0 * bow
    assert bow == pytest.approx(like, rel=0.08)
    assert np.abs(settled.position[0, lies, 1]).max() < 0.4 * bow
    assert float(settled.tension[0, -1]) == pytest.approx(float(grown.tension[-1, -1]), rel=0.01)
    assert "against friction from where it lay without tension in still water" in settled.attributes["static_path"]


def test_still_water_changes_nothing_where_no_current_acts() -> None:
    calm = sea()
    del calm["fluid"]["current"]
    one = hybrid.static(chain(environment=calm))
    assert "still water" not in one.attributes["static_path"]
    assert np.abs(one.position[0, :, 1]).max() < 1e-9


@pytest.mark.long
def test_a_network_is_found_that_friction_keeps_where_it_comes_to_rest() -> None:
    """Two lines, too long for where they hang from a buoy: no way without friction leads to an equilibrium."""
    found = hybrid.static(random_network(479)[1])
    assert "settled with friction from" in found.attributes["static_path"]
    largest = max(float(line.tension.max()) for line in found.lines.values())
    assert found.attributes["static_residual"] < 1e-6 * largest
    assert "unresolved bend" in {event.kind for event in found.lines["l0"].events}


def test_friction_of_a_network_settles_while_its_current_grows() -> None:
    """A row of knots, buoys and lines that no step of the growing current led through at once."""
    found = hybrid.static(random_network(60)[1])
    assert not [event for event in found.events if event.kind == "static friction neglected"]


def test_compression_that_friction_holds_is_told_at_rest() -> None:
    """Leg 1 of random network 516 lies in compression on the bed, by less than the friction of a cell."""
    leg = hybrid.static(random_network(516)[1]).lines["leg1"]
    assert leg.tension.min() < -0.01 * leg.tension.max()
    (told,) = [event for event in leg.events if event.kind == "slack"]
    lowest = float(leg.s[int(np.argmin(leg.tension))])
    assert "friction holds it on the seabed" in told.text and abs(told.s_a - lowest) < 3.0
