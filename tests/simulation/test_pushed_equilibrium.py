"""Ways over unstable equilibria. A column beyond Greenhill's load falls to a side that nothing chooses, which is said; below it stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import hybrid
from tests.scenes import cable_scene, network_scene

DEFECTS = Path(__file__).parents[1] / "data" / "defects"

GREENHILL = 7.8373  # w L^3/EI at which a column that is clamped at its foot buckles under its own weight


@pytest.mark.parametrize(("load", "cells", "falls"), [(0.9, 20, False), (1.5, 20, True), (1.5, 300, True)])
def test_the_side_that_nothing_chooses(load: float, cells: int, falls: bool) -> None:
    section = {"length": 1.0, "mass": load * GREENHILL / 9.81, "diameter": 0.01, "bending_stiffness": 1.0}
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, 1]}
    what = cable_scene(section, clamp, {"kind": "free"}, gravity=9.81, model="rod", mesh=cells)
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


# --- equilibria that are wound up ---

PAGE = (Path(__file__).parents[2] / "docs" / "points.md").read_text(encoding="utf-8")
SCENE = next(x.partition("```")[0] for x in PAGE.split("```yaml\n")[1:] if x.startswith("# cantilever.yaml"))


@pytest.mark.parametrize(("guess", "wound"), [((7.9, -2.2, -21), ["lower", "upper"]), ((0, 0, -30), [])])
def test_a_line_that_rests_wound_up_is_noted(guess: tuple[float, ...], wound: list[str]) -> None:
    """The system is symmetric about y = 0; from the first guess it is found wound up about its lines."""
    given = "tee: {initial_guess: [0, 0, -30]}"
    assert given in SCENE
    system = yaml.safe_load(SCENE.replace(given, f"tee: {{initial_guess: {list(guess)}}}"))
    result = hybrid.static(system)
    assert [n for n, x in result.lines.items() if any(e.kind == "several equilibria" for e in x.events)] == wound
    twisted = abs(result.lines["lower"].torque[-1]).max() > 1e-3 * abs(result.lines["lower"].bending_moment[-1]).max()
    assert twisted == bool(wound)


def test_a_twist_that_a_moment_makes_is_no_news() -> None:
    line = {"mass": 1, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 100, "torsional_stiffness": 50}
    ends = {"start": {"tangent": [1, 0, 0]}, "end": {"tangent": [1, 0, 0]}}
    common = {"connections": ends, "sections": [{"length": 5, **line}], "mesh": {"cells": 10}}
    system = network_scene(
        {"low": {"position": [0, 0, 0]}, "high": {"position": [10.01, 0, 0]},
         "middle": {"kind": "free", "initial_guess": [5, 0, 0], "moment": [60, 0, 0]}},
        {"a": {"start": "low", "end": "middle", **common}, "b": {"start": "middle", "end": "high", **common}}, gravity=0
    )  # fmt: skip
    result = hybrid.static(system)
    for name, torque in (("a", 30.0), ("b", -30.0)):  # 3 rad between its ends
        assert result.lines[name].torque[-1] == pytest.approx(torque, rel=1e-6)
        assert all(e.kind != "several equilibria" for e in result.lines[name].events)
