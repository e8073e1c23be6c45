"""Zones that move on obstacles: rods where a line touches, and the answer of rods everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import as_lines
from tests.validation.test_validation_obstacles_accuracy import DRAGGED, HEAVE, MOVES, PIPE

Tables = dict[str, Any]
MOVING = {"kind": "adaptive", "always_move": True, "tolerance": 1e-3}


def fixed(tables: Tables, model: Any) -> Tables:
    """The scene on given cells in given steps."""
    duration = tables["time"]["duration"]
    return tables | {"model": model, "mesh": {"cells": 96}, "time": {"duration": duration, "step": 0.01},
                     "output": {"every": 0.1, "points": 97}}  # fmt: skip


def apart(a: Any, b: Any) -> float:
    return float(np.linalg.norm(np.array(a.position) - np.array(b.position), axis=2).max())


@pytest.mark.long
@pytest.mark.parametrize("tables", [HEAVE, DRAGGED], ids=["heave", "dragged"])
def test_a_line_is_rod_where_it_touches_and_moves_as_one_that_is_rod_everywhere(tables: Tables) -> None:
    """Catenaries everywhere are off by 3 cm; zones by less than their tolerance, which is 12 mm."""
    rods, zones, catenary = (hybrid.run(fixed(tables, x)) for x in ("rod", MOVING, "catenary"))
    axis, s = np.array(PIPE["axis"]) / np.linalg.norm(PIPE["axis"]), np.array(zones.s)
    w = np.array(zones.position) - np.array(PIPE["at"])
    gap = np.linalg.norm(w - (w @ axis)[..., None] * axis, axis=2) - PIPE["radius"] - 0.025
    kinds = set()
    for row, here in zip(zones.zones, gap, strict=True):
        kinds |= {x.kind for x in row}
        touched = s[here < 0.02 * 0.05]
        assert all(any(x.kind == "rod" and x.s_a <= at <= x.s_b for x in row) for at in touched)
    assert kinds == {"rod", "catenary"} and (gap < 0.0).any()
    assert apart(catenary, rods) > 0.025
    assert 1e-4 < apart(zones, rods) < 0.01
    system = hybrid.run(as_lines(fixed(tables, MOVING))).lines["rope"]
    assert apart(system, zones) < 1e-4


@pytest.mark.long
@pytest.mark.parametrize("scene", [DRAGGED, MOVES], ids=["dragged", "pipe moves"])
def test_cells_that_follow_the_curvature_show_a_pipe(scene: Tables) -> None:
    """The curvature on it and elsewhere to the share that is asked."""
    tables = fixed(scene, {"kind": "adaptive", "curvature_error": 0.05})
    del tables["mesh"]
    follows, rods = hybrid.run(tables), hybrid.run(fixed(scene, "rod") | {"mesh": {"cells": 384}})
    kappa = np.array(rods["curvature"])
    error = np.abs(np.array(follows["curvature"]) - kappa).max() / kappa.max()
    assert 1e-3 < error < 0.05


def test_cells_that_follow_name_the_obstacle_whose_radius_they_do_not() -> None:
    """What a line knows of obstacles goes along where its cells change."""
    section = {"length": 11.62, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 20.0}
    over = [[0, 0, 0], [0.9, 0, -1.2], [4.4, 0, 0], [5.6, 0, 0], [9.1, 0, -1.2], [10, 0, 0]]
    result = hybrid.run(cable_scene(
        section | {"damping": {"mass": 1.0}}, pinned_at(0, 0, 0),
        pinned_at(10, 0, 0, motion={"heave": {"amplitude": 0.2, "period": 2}, "ramp": 2}),
        obstacles={"pipe": {"kind": "cylinder", "at": [5, 0, -0.6], "axis": [0, 1, 0], "radius": 0.5, "friction": 0.2}},
        initial={"kind": "points", "points": over}, model={"kind": "adaptive", "curvature_error": 0.05},
        time=(1.25, 0.005), output=0.25
    ))  # fmt: skip
    assert len(result.mesh[-1].s) != len(result.mesh[0].s)
    assert any("on obstacle pipe" in x.text for x in result.events)
