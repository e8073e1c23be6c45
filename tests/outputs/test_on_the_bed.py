"""What lies on the bed: contact force per length without overshoot, and the uplift of anchors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

W = (141.0 - 1025.0 * math.pi / 4 * 0.151**2) * 9.81  # N/m


def chain(**changes: Any) -> hybrid.Result:
    """A chain of 700 m in 100 m of water, at rest; its bed takes it up over sqrt(T/k) = 3 m."""
    data: dict[str, Any] = cable_scene(
        {"length": 700, "mass": 141, "diameter": 0.151, "axial_stiffness": 6e8}, pinned_at(0, 0, -100),
        pinned_at(655, 0, -12), fluid={"density": 1025, "surface": 0}, seabed={"z": -100, "stiffness": 5e4},
        model="catenary", mesh=100, output={"points": 101}
    )  # fmt: skip
    return hybrid.static(data | changes)


@pytest.mark.parametrize(("cells", "bound"), [(100, 0.02), (200, 0.02), (1000, 1e-3)])
def test_contact_is_the_weight_that_lies_there(cells: int, bound: float) -> None:
    result = chain(mesh={"cells": cells}, output={"points": cells + 1})
    contact, s = result["contact"][0], result.s
    assert contact.max() <= (1.0 + bound) * W and result["envelope/contact_max"].max() <= (1.0 + bound) * W
    assert contact[(s > 50.0) & (s < 500.0)] == pytest.approx(W, rel=2e-3)
    assert np.trapezoid(contact, s) == pytest.approx(float(result.contact_force[0]), rel=2e-3)


def test_an_anchor_is_lifted_by_what_the_weight_does_not_balance() -> None:
    lying = chain()
    assert lying.uplift("start")[0] == 0.0 and lying.uplift("start")[1] == 0.0
    short = {"length": 655.0, "mass": 141, "diameter": 0.151, "axial_stiffness": 6e8}
    taut = chain(cable={"sections": [short]}, ends={"start": pinned_at(0, 0, -100), "end": pinned_at(658.5, 0, -12)})
    force, angle = taut.uplift("start")
    top = taut["reaction_end"][0]
    assert force[0] == pytest.approx(top[2] - W * 655.0 + float(taut.contact_force[0]), rel=1e-6)
    assert force[0] > 1e4 and angle[0] == pytest.approx(math.degrees(math.atan2(force[0], top[0])), rel=1e-6)
