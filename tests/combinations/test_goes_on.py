"""Whatever a scene has, a run that is stopped and resumed, or stepped from outside and taken back, is the run that is not.

Bit for bit, of the short form and of the network of one line: many features in a scene, what remembers its past beside
what changes nodes and cells; and scenes of several lines.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.combinations.pairs import END, FEATURES, as_network, scene_of
from tests.problems import tables_with
from tests.scenes import line_between, network_scene
from tests.simulation.bits import Stopping, differences, went_on
from tests.simulation.test_one_world import between_springs
from tests.simulation.test_releases import scene_break as carried
from tests.simulation.test_system_contact import RUBS
from tests.simulation.test_system_contact import network as touching
from tests.simulation.test_system_saving import clamped, mooring, spar
from tests.simulation.test_system_zones import followed
from tests.simulation.test_system_zones import mooring as slackening
from tests.validation.test_validation_body_contact import pushed
from tests.validation.test_validation_body_contact_of_lines import crossed
from tests.validation.test_validation_lines_contact import lowered
from tests.validation.test_validation_sheaves import crossed_legs, two_ropes
from tests.validation.test_validation_touching_zones import in_and_out, limp, with_zones

# Each feature is in one of these, ...
FEATURES_TOGETHER = (
    ("seabed", "vortices", "obstacle", "slip", "rope"),
    ("soil", "obstacle that moves", "moment table", "polyester", "torque of tension"),
    ("sheave", "stiffness by tension", "creep", "contact", "release"),
    ("table", "clamp", "clump", "two stiffnesses", "waves"),
    ("sprung clamp", "swivel", "curved", "layers", "body"),
    ("stiffener", "turns", "rotary inertia", "points"),
    ("zones", "turns", "torque of tension", "water"),
    ("catenary", "swivel at a clamp", "stiffness damping", "restrictor", "free end"),
)
# ... and what a line remembers of its motion is beside each that changes the nodes and cells which remember it.
CHANGES = ("zones that move", "cells that follow", "payout", "chosen steps")
REMEMBERS = (
    ("seabed", "vortices", "obstacle", "moment table", "rope"),
    ("soil", "obstacle that moves", "polyester", "torque of tension", "contact"),
    ("sheave", "creep"),
    ("table", "torque of tension"),
)
OTHERS = (
    ("slip", "payout"), ("slip", "chosen steps", "release"), ("zones that move", "release"), ("payout", "chosen steps"),
)  # fmt: skip
SCENES = (*FEATURES_TOGETHER, *((x, *y) for x in CHANGES for y in REMEMBERS), *OTHERS)
CASES = [*((names, False) for names in SCENES), *((names, True) for names in FEATURES_TOGETHER[:2])]
each_scene = pytest.mark.parametrize(
    ("names", "network"), CASES, ids=["+".join(names) + network * ", network" for names, network in CASES]
)


def scene_with(names: tuple[str, ...], network: bool, **changes: Any) -> dict[str, Any]:
    """The tiny scene with these features, and changes; what is paid out is enough for nodes to enter."""
    tables = tables_with(scene_of(*names), changes)
    if "payout" in tables["ends"]["end"]:
        tables["ends"]["end"]["payout"] = {"rate": 3.0, "ramp": 0.1}
    return as_network(tables) if network else tables


def test_every_feature_is_in_a_scene() -> None:
    assert {*FEATURES} == {name for names in SCENES for name in names}


def assert_it_goes_on(scene: Any, folder: Path, monkeypatch: pytest.MonkeyPatch, *parts: float) -> None:
    """The run that is stopped after these parts of its steps, between outputs, has the bits of the run that is not."""
    stopping = Stopping(monkeypatch)
    hybrid.run(scene, folder / "whole.h5", progress=stopping).close()
    stops = [round(part * stopping.heard) + 1 for part in parts]
    assert went_on(scene, folder / "run.h5", stopping, stops) == len(stops)
    assert differences(folder / "whole.h5", folder / "run.h5") == []
    assert {x.name for x in folder.iterdir()} == {"whole.h5", "run.h5"}


def taken_back(scene: Any) -> hybrid.Result:
    """The result of a scene stepped from outside, after asserting that steps that are taken back leave nothing."""
    results = []
    for again in (False, True):
        with hybrid.Simulation(scene) as simulation:
            every, duration = simulation.scene.output.every, simulation.scene.time.duration
            for k in range(round(duration / every)):
                saved, until = simulation.save(), every * (k + 1)
                simulation.advance(until)
                if again and k % 2 == 0:
                    simulation.restore(saved)
                    simulation.advance(until - 0.4 * every)
                    simulation.restore(saved)
                    simulation.advance(until)
            results.append(simulation.result())
    for (_, one), (_, other) in zip(*(x.each_line() for x in results), strict=True):
        assert one.names == other.names
        for name in [x for x in one.names if x != "steps/cpu"]:
            assert np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f"), name
    return results[0]


@pytest.mark.long
@each_scene
def test_a_stopped_run_goes_on(names: tuple[str, ...], network: bool, tmp_path: Path, monkeypatch: Any) -> None:
    """With outputs within steps, once nodes have entered where line is paid out."""
    assert_it_goes_on(scene_with(names, network, **{"output.every": 0.09}), tmp_path, monkeypatch, 0.7)


@pytest.mark.long
@each_scene
def test_steps_are_taken_back(names: tuple[str, ...], network: bool) -> None:
    """And are those of a run, whose steps end at outputs, but for a bit or two of their times."""
    scene = scene_with(names, network, **{"dimension": 3, "output.exact": True})
    run, stepped = hybrid.run(scene), taken_back(scene)
    if {"chosen steps", "layers"} & {*names}:
        return  # steps that end where they are asked to, and cells that a run of its own places
    for (_, one), (_, other) in zip(run.each_line(), stepped.each_line(), strict=True):
        np.testing.assert_allclose(one.position[: len(other.times)], other.position, rtol=0, atol=1e-7)


# Of several lines.
ROPE = {"length": 50.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 100.0}
HEAVES = {"heave": {"amplitude": 1.0, "period": 3.0}, "ramp": 1.0}
BREAKS = carried({"b": {"break_at": {"time": 0.5}}}, {"left": {"break_at": {"time": 0.8}}})
NETWORKS = {
    "friction on a bed, waves": tables_with(mooring(), {"time.duration": 4.0, "output": {"every": 0.4}}),
    "a body with members": tables_with(spar(), {"time.duration": 3.0, "output": {"every": 0.3}}),
    "clamped to bodies": tables_with(clamped(), {"time.duration": 1.0, "output": {"every": 0.1}}),
    "breaks": tables_with(BREAKS, {"time.duration": 1.0}),
    "a clamp breaks": tables_with(
        mooring(),
        {
            "time.duration": 1.0,
            "output": {"every": 0.1},
            "lines.hose.connections": {"end": {"tangent": [0.5, 0, 1]}},
            "lines.hose.break_at": {"time": 0.5},
        },
    ),
    "zones that move": slackening(time={"duration": 2.5, "step": 0.02}),
    "cells that follow": followed(time={"duration": 1.5, "step": 0.02}),
    "starts as placed": between_springs(**{"lines.upper.model": "adaptive", "time.duration": 0.2}),
    "touches itself": touching(),
    "contact begins": touching(contact={"friction": RUBS["friction"]}),
    "lines touch": lowered(),
    "lines touch from when they are near": tables_with(lowered(), {"contact": None, "time.duration": 0.8}),
    "lines touch, zones that move": with_zones(limp(lowered())),
    "lines touch, paid out and taken in": in_and_out(),
    "a ball on lines": tables_with(pushed(), {"time.duration": 0.3}),
    "a ball on lines that touch": crossed(),
    "legs that touch over a sheave": crossed_legs(0.02, held=False),
    "two ropes over a sheave": tables_with(two_ropes(), {"time.duration": 0.4}),
    "paid out at its start to a weight": network_scene(
        {"ship": {"position": [0, 0, 0]}, "weight": {"initial_guess": [30, 0, -40], "mass": 20.0, "volume": 0.01}},
        {
            "rope": line_between(
                "ship", "weight", ROPE, mesh=10, connections={"start": {"payout": {"rate": 2.0, "ramp": 0.1}}}
            )
        },
        environment={"fluid": {"density": 1025.0, "current": [0.5, 0, 0]}},
        time=(1.0, 0.02),
        output={"every": 0.1},
    ),
    "errors, on a bed": network_scene(
        {"west": {"position": [0, 0, -20]}, "east": {"position": [45, 0, 0], "motion": HEAVES}},
        {"rope": line_between("west", "east", ROPE | {"length": 60.0}, mesh=20, model="rod")},
        environment={"fluid": {"density": 1025.0}, "seabed": {"z": -20, "stiffness": 1e4}},
        time=(1.0, 0.02),
        output={"every": 0.1, "errors": True},
    ),
    "paid out fast": as_network(tables_with(scene_of("payout"), {END + ".payout": {"rate": 2.0, "ramp": 0.1}})),
}


@pytest.mark.long
@pytest.mark.parametrize("name", NETWORKS)
def test_a_stopped_run_of_several_lines_goes_on(name: str, tmp_path: Path, monkeypatch: Any) -> None:
    assert_it_goes_on(NETWORKS[name], tmp_path, monkeypatch, 0.5, 0.25)


@pytest.mark.long
@pytest.mark.parametrize("name", NETWORKS)
def test_steps_of_several_lines_are_taken_back(name: str) -> None:
    taken_back(NETWORKS[name])
