"""Zones that move on lines of several that are paid out: as of one cable, beside other lines, resumed, stepped."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_payout_zones import CHANGES, touching

import hybrid

Tables = dict[str, Any]
NAMES = ("position", "tension", "reaction_end", "work/end", "work/zones")


def as_system(scene: Tables) -> Tables:
    """The cable as the line `one` from point a to point b."""
    found = deepcopy(scene)
    ends, line = found.pop("ends"), found.pop("cable")
    line |= {key: found.pop(key) for key in ("model", "mesh")} | {"start": "a", "end": "b", "connections": {}}
    del found["initial"]
    points = {}
    for name, key in zip("ab", ("start", "end"), strict=True):
        end = ends[key]
        line["connections"][key] = {x: end.pop(x) for x in ("kind", "tangent", "payout") if x in end}
        points[name] = {"kind": "fixed"} | end
    return found | {"points": points, "lines": {"one": line}}


def to_a_buoy(rate: float = 0.8) -> Tables:
    """The line from a winch that heaves to a buoy, which another line with zones that move holds."""
    scene = as_system(touching(rate))
    line = scene["lines"]["one"]
    section = line["sections"][0]
    scene["environment"]["fluid"] = {"density": 1025, "current": [0.1, 0.2, 0]}
    scene["points"]["a"] = {"kind": "free", "initial_guess": [0, 0, -3], "mass": 50, "volume": 0.6}
    scene["points"]["ground"] = {"position": [-60, 0, -18]}
    scene["lines"]["stay"] = {
        "start": "ground", "end": "a", "sections": [section | {"length": 64.0}], "model": line["model"],
        "mesh": {"cells": 26},
    }  # fmt: skip
    return scene


@pytest.mark.parametrize("rate", [0.8, -0.8])
def test_a_system_of_one_line_is_the_cable(rate: float) -> None:
    cable = hybrid.run(touching(rate, dimension=3))
    line = hybrid.run(as_system(touching(rate))).lines["one"]
    assert sum(x.kind in CHANGES for x in line.events) >= 2
    assert [(x.kind, x.t) for x in line.events if x.kind in CHANGES] == [
        (x.kind, x.t) for x in cable.events if x.kind in CHANGES
    ]
    assert line.zones[-1] == cable.zones[-1]
    for name in NAMES:
        assert np.abs(line[name] - cable[name]).max() < 1e-6 * np.abs(cable[name]).max(), name


def test_beside_a_buoy_they_move_as_rods() -> None:
    scene = to_a_buoy()
    rods = deepcopy(scene)
    for line in rods["lines"].values():
        line["model"] = "rod"
    found, like = hybrid.run(scene), hybrid.run(rods)
    assert all(any(z.kind == "catenary" for z in x.zones[-1]) for x in found.lines.values())
    assert found.lines["one"]["payout/length"][-1] > 104.0
    for name, line in like.lines.items():
        assert np.abs(found.lines[name].position - line.position).max() < 2e-3 * 100.0
        pulls = [np.linalg.norm(x["reaction_end"], axis=1) for x in (found.lines[name], line)]
        assert np.abs(pulls[0] - pulls[1]).max() < 0.02 * pulls[1].mean()


@pytest.mark.long
def test_resumed_to_the_last_bit(tmp_path: Path) -> None:
    scene = to_a_buoy(-0.8)
    whole = hybrid.run(scene)
    hybrid.run(scene | {"time": {"duration": 5.0, "step": 0.05}}, output=tmp_path / "part.h5")
    resumed = hybrid.resume(tmp_path / "part.h5", until=8.0)
    for line, found in whole.lines.items():
        for name in NAMES:
            assert np.array_equal(found[name], resumed.lines[line][name], equal_nan=True), (line, name)
        assert found.zones[-1] == resumed.lines[line].zones[-1]


def test_a_step_is_taken_back() -> None:
    """`save` and `restore` over cells that enter and zones that change."""
    with hybrid.Simulation(to_a_buoy()) as sim:
        sim.advance(4.0)
        saved = sim.save()
        places = []
        for _ in range(2):
            sim.advance(6.0)
            places.append(sim.forces("one")[1])
            sim.restore(saved)
    assert np.array_equal(*places)


@pytest.mark.long
def test_loads_that_change_on_the_way(tmp_path: Path) -> None:
    """Another current from the middle on, as with rods."""
    pulls = []
    for k, model in enumerate(("adaptive", "rod")):
        scene = to_a_buoy()
        if model == "rod":
            for line in scene["lines"].values():
                line["model"] = "rod"
        path = tmp_path / f"{k}.h5"
        hybrid.run(scene | {"time": {"duration": 4.0, "step": 0.05}}, output=path)
        found = hybrid.resume(path, until=8.0, settings=["environment.fluid.current=[0.1, 0.6, 0]"])
        pulls.append(np.linalg.norm(found.lines["one"]["reaction_end"], axis=1))
    assert np.abs(pulls[0] - pulls[1]).max() < 0.02 * pulls[1].mean()
