"""A cable and the network that is made of it are the same computation: every dataset, and every event."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError
from hybrid.scene.read import as_scene
from hybrid.scene.root import LINE, in_full
from hybrid.store.reader import open_result
from tests.combinations.networks import both, differences, events_differ
from tests.combinations.pairs import CLAMP, DRAG, END, FEATURES, START, WATER, S, scene_of
from tests.problems import tables_with
from tests.said import line_of
from tests.scenes import cable_scene, pinned_at

FREE = {"kind": "free", "force": [40, 3, 30]}
GUIDED = {"kind": "guided", "tangent": [1, 0.1, 0.2], "normal": [0, 1, 0], "force": [60, 3, 30]}
STIFF = {"cable.sections.0.bending_stiffness": 2e3}
TURNED = {"motion": {"pitch": {"amplitude": 2.0, "period": 1.0}, "ramp": 0.5}}
THROWN = {"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0.2], "velocity": [0, 1, 3]}
# Each with one thing that a cable has, and points, lines or their pre-runs had otherwise or not at all.
SCENES: dict[str, dict[str, Any]] = {
    "a free end with a force, in water": {END: FREE, "environment.fluid": WATER} | DRAG,
    "a moment at a free end": {START: CLAMP, END: FREE | {"moment": [0, 50, 10]}} | STIFF,
    "a guided end that turns": {END: GUIDED | TURNED, "time.duration": 0.3},
    "a guided catenary": {END: GUIDED, "model": "catenary"},
    "a vehicle": {END: {"kind": "body", "mass": 3.0, "thrust": {"value": [8, 2, 0], "until": 0.25}}},
    "thrown, both ends free": {START: {"kind": "free"}, END: {"kind": "free"}, "initial": THROWN},
    "a clamp beside a catenary": {START: CLAMP, "model": "catenary"},
    "arc lengths of outputs": {"output.points": [0.0, 3.1, 12.0], "output.history": [5.0]},
    "cells to a layer beside a clump": FEATURES["clump"][0] | FEATURES["layers"][0],
    "let go, with steps that follow": FEATURES["release"][0] | FEATURES["chosen steps"][0] | {"time.duration": 0.3},
    "falls on a hard bed, in steps that are cut": {
        "environment.seabed": {"z": -0.2, "stiffness": 5e5, "damping": 5e3},
        END: {"kind": "free"},
        "initial": {"kind": "straight", "origin": [0, 0, 1.0], "direction": [1, 0, 0.02]},
        START: pinned_at(0, 0, 1.0),
        "time": {"duration": 1.2, "step": 0.04},
        "output": {"every": 0.2, "points": 13},
    },
    "torque of tension through catenary zones": FEATURES["zones"][0]
    | FEATURES["turns"][0]
    | {S + "tension_torque": 2e-3, END + ".motion": {"heave": {"amplitude": 0.05, "period": 1.0}, "ramp": 0.3}},
    "zones that move": {"model": {"kind": "adaptive", "hold_time": 0.1, "force_rod": [[4, 8]]}},
    "zones that move, with a step that is tried again": FEATURES["zones that move"][0] | FEATURES["release"][0],
    "zones of which some stay catenary": {"model": {"kind": "adaptive", "hold_time": 0.1, "force_catenary": [[4, 8]]}}
    | STIFF,
}


@pytest.mark.parametrize("name", SCENES)
def test_a_cable_is_a_network_of_one_line(name: str) -> None:
    tables = tables_with(scene_of(), SCENES[name])
    cable, network = both(tables)
    assert [str(x) for x in differences(cable, network)] == []
    assert events_differ(cable, network) == []


def test_at_rest() -> None:
    cable, network = both(tables_with(scene_of("seabed"), {END: GUIDED, "time": None}), rest=True)
    assert [str(x) for x in differences(cable, network)] == []
    assert events_differ(cable, network) == []


def test_obstacles_at_rest_carry_what_they_do_as_a_run_begins() -> None:
    tables = tables_with(scene_of("sheave"), {"initial": "equilibrium"})
    rest, moves = hybrid.static(tables), hybrid.run(tables)
    for name in (x for x in rest.names if x.startswith("obstacles/")):
        np.testing.assert_allclose(rest[name][0], moves[name][0], rtol=1e-9, atol=1e-9, err_msg=name)
    assert rest["obstacles/pipe/force"][0, 2] < -20.0  # N


def test_no_errors_are_asked_of_steps_that_follow() -> None:
    """The usual accuracy, which nobody has asked for, is no reason to want an error figure."""
    tables = tables_with(scene_of("catenary"), {"output.errors": False, "time.step": None})
    cable, network = both(tables)
    assert [str(x) for x in differences(cable, network)] == []


def test_a_winch_at_rest_holds_its_line() -> None:
    """With a free end: nothing but springs without force holds the network that is made of it."""
    section = {"length": 60.0, "mass": 2.0, "axial_stiffness": 1e7}
    winch = {"kind": "pinned", "position": [0, 0, 0], "payout": {"rate": 0.5, "ramp": 2.0}}
    tables = cable_scene(section, {"kind": "free"}, winch, mesh=30, model="catenary", time=(5.0, 0.1))
    network = hybrid.static(in_full(hybrid.validate_scene(tables))).lines[LINE]
    cable = hybrid.static(tables)
    np.testing.assert_allclose(network.tension, cable.tension, rtol=1e-9)
    assert network.tension.max() > 100.0


@pytest.mark.parametrize("network", [False, True])
def test_a_start_from_which_no_step_leads_on_is_in_the_file(network: bool, tmp_path: Path) -> None:
    scene = as_scene(scene_of("obstacle") | {"dimension": 2})
    with pytest.raises(ComputationError, match="leaves the plane"):
        hybrid.run(in_full(scene) if network else scene, tmp_path / "run.h5")
    with open_result(tmp_path / "run.h5") as result:
        assert result.status == "failed"
        assert result.times.tolist() == [0.0]
        assert np.isfinite(line_of(result)["tension"]).all()
