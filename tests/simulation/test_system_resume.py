"""A run of several lines that was stopped, however often, is the run that was not: bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping

import hybrid
import hybrid.simulation.run_record
from hybrid.errors import ResultError, SceneError
from tests.scenes import line_between, network_scene

WAVES = {"kind": "regular", "height": 1.0, "period": 7.0, "ramp": 5.0}
SEA = {"fluid": {"density": 1025, "current": [0.4, 0.1, 0], "surface": 0.0, "waves": WAVES}}
LEG = {"length": 140, "mass": 3.0, "diameter": 0.04, "axial_stiffness": 2e6, "drag": {"normal": 1.2}}
HOSE = {
    "length": 100,
    "mass": 6,
    "diameter": 0.08,
    "axial_stiffness": 5e6,
    "bending_stiffness": 300,
    "max_tension": 800,
}


def mooring(**tables: Any) -> dict[str, Any]:
    """Two legs with friction on the bed, a float with a force that stops, and a rod to a vessel that heaves."""
    heave = {"heave": {"amplitude": 1.5, "period": 8}, "ramp": 6}
    force = {"value": [200, 0, 0], "until": 3.1}
    return network_scene(
        {"west": {"position": [-110, 0, -100]}, "east": {"position": [110, 10, -100]},
         "float": {"kind": "free", "initial_guess": [0, 0, -20], "mass": 900, "volume": 6, "drag_area": 3,
                   "force": force},
         "vessel": {"position": [70, 0, 2], "motion": heave}},
        {"west": line_between("west", "float", LEG, mesh=30), "east": line_between("float", "east", LEG, mesh=30),
         "hose": line_between("float", "vessel", HOSE, mesh=30)},
        title="float", environment=SEA | {"seabed": {"z": -100, "stiffness": 5000, "friction": 0.5}}, time=(8.0, 0.05)
    ) | tables  # fmt: skip


def spar() -> dict[str, Any]:
    """A body that floats and one that is moved, between lines."""
    line = {
        "sections": [LEG | {"length": 425, "mass": 80, "diameter": 0.1, "axial_stiffness": 4e8}],
        "mesh": {"cells": 20},
    }
    places = {"east": (400, 0), "north": (-200, 346), "south": (-200, -346)}
    return network_scene(
        {name: {"position": [x, y, -150]} for name, (x, y) in places.items()} | {
            f"to_{name}": {"body": "spar", "place": [x / 80, y / 80, -20]} for name, (x, y) in places.items()},
        {name: {"start": name, "end": f"to_{name}"} | line for name in places},
        fluid={"density": 1025, "current": [0.4, 0, 0], "surface": 0.0},
        bodies={"spar": {"initial_guess": [0, 0, 9], "mass": 3e6, "centre": [0, 0, -25], "inertia": [8e8, 8e8, 4e7],
                         "added_mass": [2.6e6, 2.6e6, 3e5, 1.5e9, 1.5e9, 0], "damping": [2e5, 2e5, 1e5, 2e7, 2e7, 1e7],
                         "hydrostatics": {"heave": 7.8e5, "roll": 1.2e8, "pitch": 1.2e8},
                         "force": {"value": [3e5, 0, 0], "until": 5},
                         "members": [{"start": [0, 0, -50], "end": [0, 0, 20], "diameter": 8, "drag": 1,
                                      "added_mass": 1}]}},
        time=(7, 0.1)
    )  # fmt: skip


def clamped() -> dict[str, Any]:
    """Rods clamped to a free point, to a body that is moved and to one that is free, one of them by a spring."""
    pipe = {"mass": 3.0, "diameter": 0.04, "axial_stiffness": 2e6, "bending_stiffness": 300, "drag": {"normal": 1.2}}
    turns = {"roll": {"amplitude": 4, "period": 5}, "heave": {"amplitude": 0.3, "period": 4}, "ramp": 4}
    up = {"tangent": [0, 0, 1]}
    return network_scene(
        {"foot": {"position": [0, 0, -40]}, "tee": {"initial_guess": [1, 0, -21], "mass": 20, "volume": 0.2},
         "lug": {"body": "ship", "place": [1, 0, -4]}, "eye": {"body": "float", "place": [0, 0, -1]}},
        {"low": line_between("foot", "tee", pipe | {"length": 20}, connections={"start": up, "end": up}, mesh=20),
         "high": line_between("lug", "tee", pipe | {"length": 19.5}, mesh=20,
                              connections={"start": {"tangent": [0, 0, -1], "bend_stiffness": 5e3},
                                           "end": {"tangent": [0, 0, -1]}}),
         "branch": line_between("tee", "eye", pipe | {"length": 12},
                                connections={"start": {"tangent": [1, 0, 0]}, "end": up}, mesh=20)},
        environment=SEA,
        bodies={"ship": {"position": [1, 0, 2], "motion": turns},
                "float": {"initial_guess": [9, 0, -14], "mass": 200, "volume": 0.4, "inertia": [90, 90, 60]}},
        time=(2.0, 0.05)
    )  # fmt: skip


SCENES = {"mooring": mooring(), "spar": spar(), "clamped": clamped()}


@pytest.fixture
def stopping(monkeypatch: pytest.MonkeyPatch) -> Stopping:
    """Hears of every step, with a checkpoint every few and where the run is stopped."""
    return Stopping(monkeypatch)


def test_rotations_go_on_beyond_half_a_turn(tmp_path: Path) -> None:
    """The yaw of a body that is turned, through 180 deg and across a resume, is that of its motion."""
    turns = {"yaw": {"amplitude": 20.0, "period": 2.0}, "ramp": 1.0}
    scene = network_scene(
        {"foot": {"position": [0, 0, -30]}, "lug": {"body": "ship", "place": [0.1, 0, -1]}},
        {"leg": line_between("foot", "lug", LEG | {"length": 32}, mesh=6)}, environment=SEA,
        bodies={"ship": {"position": [1, 0, 0], "rotation": [0, 0, 180], "motion": turns}}, time=(1.3, 0.1), output=0.1
    )  # fmt: skip
    path = tmp_path / "run.h5"
    hybrid.run(scene, path).close()
    with hybrid.resume(path, until=4.0) as result:
        yaw = result["bodies/ship/rotation"][:, 2]
    assert yaw.min() < 165.0 and yaw.max() > 195.0 and np.abs(np.diff(yaw)).max() < 10.0


@pytest.mark.long
def test_a_run_goes_on_beyond_its_end_as_if_it_had_been_that_long(tmp_path: Path) -> None:
    every = {"output": {"every": 0.2}}
    hybrid.run(mooring(**every), tmp_path / "long.h5").close()
    hybrid.run(mooring(**every, time={"duration": 4.0, "step": 0.05}), tmp_path / "run.h5").close()
    with pytest.raises(ResultError, match="nothing left"):
        hybrid.resume(tmp_path / "run.h5")
    with pytest.raises(SceneError, match="4 s"):
        hybrid.resume(tmp_path / "run.h5", until=2.0)
    hybrid.resume(tmp_path / "run.h5", tmp_path / "more.h5", until=8.0).close()
    with hybrid.open(tmp_path / "long.h5") as long, hybrid.open(tmp_path / "more.h5") as more:
        for name, line in long.lines.items():
            assert np.array_equal(line.times, more.lines[name].times)
            assert np.array_equal(line.tension, more.lines[name].tension)
            assert np.array_equal(line.envelope["tension_max"], more.lines[name].envelope["tension_max"])
        assert [e for e in long.events if e.kind == "tension above limit"]
        assert [tuple(e) for e in long.events] == [tuple(e) for e in more.events]


@pytest.mark.long
def test_a_running_result_shows_all_lines(tmp_path: Path, stopping: Stopping, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every line has an output as soon as the points have it; extremes are those up to now."""
    monkeypatch.setattr(hybrid.simulation.run_record, "WORK", 0)  # the file is written whenever the run looks
    monkeypatch.setattr(hybrid.simulation.progress, "REPORT_EVERY", 0.0)
    path, seen = tmp_path / "run.h5", []

    def look(progress: Any) -> None:
        if progress.step >= 80 and not seen:
            with hybrid.open(path) as result:
                lines = result.lines.values()
                seen.append((result.status, len(result.times), [len(x.times) for x in lines]))
                assert all(np.isfinite(x.envelope["tension_max"]).all() for x in lines)
                assert all(x.status == "running" for x in lines)

    hybrid.run(mooring(), path, progress=look).close()
    ((status, outputs, of_lines),) = seen
    assert status == "running" and 40 <= outputs < 101 and of_lines == 3 * [outputs]
