"""Tension beside point loads, at ends of modules and at ends one cell away from a load: nothing is taken across a kink."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import line_between, network_scene

HEAVY = {"length": 100, "mass": 2.0, "axial_stiffness": 1e7}


def hung(span: float, depth: float = 0.0, **cable: Any) -> dict[str, Any]:
    """A catenary in air between two points of one height."""
    pinned = {name: {"kind": "pinned", "position": [x, 0, depth]} for name, x in (("start", 0.0), ("end", span))}
    return {"cable": cable, "ends": pinned, "initial": "equilibrium", "model": "catenary"}


def test_the_largest_tension_is_that_on_each_side_of_modules() -> None:
    """T^2 = H^2 + V^2 at s = 45 m, where lifting modules begin: the largest of the line."""
    section = {"length": 100, "mass": 20, "diameter": 0.05, "axial_stiffness": 1e8, "max_tension": 11600}
    scene = hung(
        20.0, -60.0, sections=[section], attachments=[{"kind": "modules", "range": [45, 55], "buoyancy": 2500}]
    )
    result = hybrid.static(scene | {"environment": {"fluid": {"density": 1025}}})
    horizontal, vertical = np.abs(result["reaction_start"].reshape(3)[[0, 2]])
    weight = (20.0 - 1025 * np.pi / 4 * 0.05**2) * 9.81
    assert result["envelope/tension_max"].max() == pytest.approx(np.hypot(horizontal, vertical + 45 * weight), rel=1e-4)
    assert "tension above limit" in {event.kind for event in result.events}


@pytest.mark.parametrize("at", [1.0, 2.0])
def test_the_tension_of_an_end_beside_a_load(at: float) -> None:
    """Cells of 1 m: the load is one cell from the end, or two; the reaction knows the tension."""
    clumps = [{"kind": "clump", "at": x, "mass": 1500} for x in (at, 100.0 - at)]
    result = hybrid.static(hung(99.5, sections=[HEAVY], attachments=clumps) | {"mesh": {"cells": 100}})
    tension = np.ravel(result.tension)
    for k, reaction in ((0, "reaction_start"), (-1, "reaction_end")):
        assert tension[k] == pytest.approx(np.linalg.norm(result[reaction]), rel=2e-3)
    assert result["envelope/tension_max"].max() == pytest.approx(tension.max(), rel=2e-3)


def test_the_force_of_a_line_on_a_free_point_beside_a_load() -> None:
    """What two lines pull balances the weight of the point between them."""
    lines = {
        "one": line_between("a", "k", HEAVY, attachments=[{"kind": "clump", "at": 99, "mass": 1500}]),
        "two": line_between("k", "b", HEAVY),
    }
    result = hybrid.static({
        "points": {"a": {"position": [0, 0, 0]}, "b": {"position": [198.5, 0, 0]},
                   "k": {"kind": "free", "initial_guess": [99.5, 0, -3], "mass": 10}},
        "lines": {name: line | {"mesh": {"cells": 100}} for name, line in lines.items()},
    })  # fmt: skip
    pulled = result.lines["one"]["reaction_end"] + result.lines["two"]["reaction_start"]
    assert pulled.reshape(3) == pytest.approx([0.0, 0.0, -10 * 9.81], abs=0.003 * 5e4)


def test_the_largest_tension_at_an_offset_beside_a_load() -> None:
    """The clump is one cell of 10 m from the upper end, where the tension is largest: the pull there."""
    line = {"start": "a", "end": "k", "sections": [HEAVY], "mesh": {"cells": 10}}
    line["attachments"] = [{"kind": "clump", "at": 10, "mass": 150}]
    scene = network_scene(
        {"a": {"position": [0, 0, 0]}, "k": {"position": [80, 0, -30]}}, {"one": line | {"model": "catenary"}}
    )
    found = hybrid.offsets(scene, "point:k", [0.0])
    pull = np.linalg.norm(hybrid.static(scene).lines["one"]["reaction_start"])
    assert found.tension["one"][0] == pytest.approx(pull, rel=2e-3)


@pytest.mark.parametrize("asked", [{"line_tension": "1%"}, {"curvature": "5%"}])
def test_what_is_asked_along_a_cable_without_bending_stiffness(asked: dict[str, str]) -> None:
    result = hybrid.static(hung(80.0, sections=[HEAVY]) | {"accuracy": asked})
    assert not [event for event in result.events if event.kind == "accuracy missed"]
    assert len(result.mesh[0].s) < 2000
