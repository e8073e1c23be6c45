"""What a cable's file of 1.0 holds of a run goes on as a network of one line, and is the run that was not stopped."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from bits import Stopping
from test_self_contact_default import led_through

import hybrid
from hybrid.scene.read import as_scene
from hybrid.simulation.old_checkpoints import as_of_line
from hybrid.simulation.progress import Progress
from hybrid.store.checkpoint import Checkpoint, read_checkpoint
from tests.combinations.networks import differences, events_differ
from tests.combinations.pairs import END, START, S, scene_of
from tests.problems import tables_with

QUANTITIES = {
    "slope": {"kind": "declination", "end": "start"},
    "turn": {"kind": "azimuth", "end": "end"},
    "way": {"kind": "touchdown_excursion", "end": "start"},
}
MOVED = {"heave": {"amplitude": 0.05, "period": 1.0}, "ramp": 0.3}
FLAT = {
    START: {"kind": "pinned", "position": [0, 0, 0]},
    END: {"kind": "pinned", "position": [8, 0, 0], "motion": MOVED},
}
PULLED = {"kind": "free", "force": {"value": [60, 3, 30], "until": 0.25}}
# Names of features of tests/combinations/pairs.py, and what else is other. Cut off at 0.33 s of 0.5 s.
CASES: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "catenary, waves": (("catenary", "waves"), {}),
    "rods, friction, quantities": (("seabed", "clamp"), {"output.quantities": QUANTITIES}),
    "zones that are fixed": (("zones", "soil"), {}),
    "zones that move": (("zones that move", "seabed"), {}),
    "cells that follow": (("cells that follow", "seabed"), {}),
    "paid out": (("payout", "seabed"), {}),
    "paid out, zones that move": (("payout", "zones that move"), {}),
    "paid out, cells that follow": (("payout", "cells that follow"), {}),
    "let go": (("release", "zones that move"), {}),
    "a load that has stopped": ((), {END: PULLED}),
    "a vehicle": (("body",), {START + ".motion": MOVED}),
    "self contact": (("contact", "seabed"), {}),
    "steps that follow": (("chosen steps", "zones that move"), {}),
    "torque through zones": (("zones", "turns"), {S + "tension_torque": 2e-3, END + ".motion": MOVED}),
    "a rope that remembers": (("polyester", "vortices"), {}),
    "a sheave": (("sheave", "slip"), {}),
    "in a plane": ((), FLAT),
    "what leaving bending out does": (("zones",), {"output.errors": True}),
    "in a plane, steps that follow": (("chosen steps",), FLAT | {"dimension": 2}),
}

pytestmark = pytest.mark.usefixtures("old_road")


class _Cut:
    """Stops a run after a time (s), from outside."""

    def __init__(self, t: float) -> None:
        self.t = t

    def __call__(self, now: Progress) -> None:
        if now.t > self.t:
            raise KeyboardInterrupt


def cut_off(scene: hybrid.Scene, path: Path, t: float) -> Checkpoint:
    """The last checkpoint of a run that is stopped from outside after t (s)."""
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene, path, progress=_Cut(t))
    with h5py.File(path) as file:
        return read_checkpoint(file)


class Roads:
    """Runs of a cable by its own road, and the rest of them as networks (simulation.switch)."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        Stopping(monkeypatch)
        monkeypatch.setattr("hybrid.simulation.time_loop.WORK", 1)
        self._set, self._path = monkeypatch.setenv, folder / "run.h5"

    def both(self, tables: Mapping[str, Any], t: float) -> tuple[hybrid.Result, hybrid.Result]:
        """A run of a cable, and its network that goes on from where the cable was stopped after t (s)."""
        self._set("HYBRID_CABLES", "cable")
        scene = as_scene(tables_with(tables, {"output.exact": True}))
        cable, old = hybrid.run(scene), cut_off(scene, self._path, t)
        assert 0.9 * t < old.state["t"] <= t + 0.05 and "lines" not in old.state
        return cable, self.rest()

    def rest(self) -> hybrid.Result:
        """The network goes on."""
        self._set("HYBRID_CABLES", "network")
        return hybrid.resume(self._path)


@pytest.mark.long  # 0.5 s each
@pytest.mark.parametrize("name", CASES)
def test_a_network_goes_on_where_a_cable_was_stopped(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    features, more = CASES[name]
    cable, network = Roads(monkeypatch, tmp_path).both(tables_with(scene_of(*features), more), 0.33)
    assert [str(x) for x in differences(cable, network)] == []
    assert events_differ(cable, network) == []
    assert len(cable.times) > 4 and np.ptp(cable.position[3:, 3:-3], axis=0).max() > 1e-4


@pytest.mark.slow
def test_contact_that_has_begun_by_itself_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cable, network = Roads(monkeypatch, tmp_path).both(led_through(), 2.4)
    assert cable["energy/self_contact"].max() > 0.0
    assert [str(x) for x in differences(cable, network)] == []


@pytest.mark.long
def test_loads_that_have_changed_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A line that is laid, in another current from 3 s on, stopped at 4 s."""
    roads, path = Roads(monkeypatch, tmp_path), tmp_path / "run.h5"
    monkeypatch.setenv("HYBRID_CABLES", "cable")
    begun = hybrid.load_scene(
        Path(__file__).parents[2] / "examples" / "laying.yaml", ["time.duration=2", "dimension=null"]
    )
    hybrid.run(begun, path).close()
    asked: dict[str, Any] = {"until": 5.0, "settings": ["environment.fluid.current=[0.4, 0.2, 0]"], "start": 3.0}
    cable = hybrid.resume(path, tmp_path / "cable.h5", **asked)
    with pytest.raises(KeyboardInterrupt):
        hybrid.resume(path, progress=_Cut(4.0), **asked)
    with h5py.File(path) as file:
        state = read_checkpoint(file).state
    assert state["changes"] == 1 and "lines" not in state
    network = roads.rest()
    assert [str(x) for x in differences(cable, network)] == []
    assert events_differ(cable, network) == []


def test_what_is_of_another_line_or_of_no_cable_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Stopping(monkeypatch)
    tables = scene_of("catenary")
    saved = cut_off(as_scene(tables), tmp_path / "cable.h5", 0.1).state
    model = hybrid.model.build.build(as_scene(tables))
    assert set(as_of_line(saved, "cable", model, ())["lines"]) == {"cable"}
    with pytest.raises(ValueError, match="surplus: not in the checkpoint of any cable"):
        as_of_line(saved | {"surplus": 1.0}, "cable", model, ())
    longer = hybrid.model.build.build(as_scene(tables_with(tables, {"mesh.cells": 20})))
    with pytest.raises(ValueError, match="nodes that are not those of the line"):
        as_of_line(saved, "cable", longer, ())
