"""Ways over unstable equilibria. A column beyond Greenhill's load falls to a side that nothing chooses, which is said; below it stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid

DEFECTS = Path(__file__).parents[1] / "data" / "defects"

GREENHILL = 7.8373  # w L^3/EI at which a column that is clamped at its foot buckles under its own weight


@pytest.mark.parametrize(("load", "cells", "falls"), [(0.9, 20, False), (1.5, 20, True), (1.5, 300, True)])
def test_the_side_that_nothing_chooses(load: float, cells: int, falls: bool) -> None:
    section = {"length": 1.0, "mass": load * GREENHILL / 9.81, "diameter": 0.01, "bending_stiffness": 1.0}
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, 1]}
    what = {
        "environment": {"gravity": 9.81}, "cable": {"sections": [section]}, "model": "rod", "mesh": {"cells": cells},
        "ends": {"start": clamp, "end": {"kind": "free"}}, "initial": "equilibrium",
    }  # fmt: skip
    result = hybrid.static(what)
    said = [x.text for x in result.events if x.kind == "several equilibria"]
    assert bool(said) == falls == (result.position[-1, -1, 2] < 0.9)
    assert all("initial.points" in text for text in said)


@pytest.mark.long
@pytest.mark.parametrize(("name", "cells", "orcaflex"), [("lazy_s", 200, 59640.7), ("lazy_wave", 400, 24172.9)])
def test_a_line_is_pushed_off_each_unstable_equilibrium_that_is_met(name: str, cells: int, orcaflex: float) -> None:
    """0.6.0 refused both, unless the scene said `guess: arc` or `guess: span`."""
    scene = hybrid.load_scene(DEFECTS / f"equilibrium_refused_{name}.yaml", [f"mesh.cells={cells}"])
    found = hybrid.static(scene)
    assert np.linalg.norm(found.reaction_start[-1]) == pytest.approx(orcaflex, rel=1e-3)
    assert "several equilibria" in {event.kind for event in found.events}
