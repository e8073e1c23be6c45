"""Energy that a time scheme creates is held against all that is put in, not against what the first moments have put in."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.simulation.events import EventLog
from hybrid.simulation.watches import FIRST_MOMENTS, GAIN_NOTED, SchemeWatch
from tests.scenes import cable_scene, pinned_at

MODEL = build(one_line(hybrid.validate_scene(cable_scene(
    {"length": 10, "mass": 1.0}, pinned_at(0, 0, 0), "free", model="catenary", mesh=10
))))  # fmt: skip


def watched(gained: list[float], work: list[float], strain: float = 0.0, batches: int = 1) -> tuple[list[Any], Any]:
    """Events (t, kind, text) and what stopped a run whose scheme has created and whose ends have put in so much, J.

    Outputs follow each other by a second; strain: J, energy that is there from the start.
    """
    log = EventLog()
    watch, stop, t = SchemeWatch(MODEL, log), None, np.arange(float(len(gained)))
    for k, part in enumerate(np.array_split(np.arange(t.size), batches)):
        if k:  # as a run that is resumed
            before = watch
            watch = SchemeWatch(MODEL, log)
            for name in ("_created", "_put_in", "_potential", "_alive", "_gain", "_loss"):
                setattr(watch, name, getattr(before, name))
        batch = SimpleNamespace(t=t[part], work=np.array(work)[part, None], v=np.zeros((part.size, 11, 3)))
        values = {
            "work/scheme": np.array(gained)[part], "energy/potential": np.zeros(part.size),
            "energy/stretch": np.full(part.size, strain),
        }  # fmt: skip
        stop = stop or watch.judge(MODEL, batch, values)  # type: ignore[arg-type]
    watch.finish()
    return [(x[0], x[3], x[4]) for x in log.waiting()], stop


def test_the_first_moments_of_a_run_do_not_decide() -> None:
    """22 J of 280 J a moment after the motion begins, 1.1 kJ of 9.4 MJ at the end: as of an array that turns."""
    gained, work = [0.0, 22.4, 40.0, 800.0, 1100.0], [0.0, 24.0, 900.0, 4e6, 9.4e6]
    assert watched(gained, work, 256.0) == ([], None)
    (event,), stop = watched(gained[:2], work[:2], 256.0)  # had it ended there
    assert event[:2] == (1.0, "gains energy") and "22.4 J, 8 % of" in event[2] and stop is None


@pytest.mark.parametrize("part", [0.04, 0.06, 0.5, 0.99])
def test_what_is_created_steadily_is_noted_as_a_part_of_what_is_put_in(part: float) -> None:
    work = [100.0 * k for k in range(8)]
    for batches in (1, 3):
        found, stop = watched([part * x for x in work], work, batches=batches)
        assert bool(found) == (part > GAIN_NOTED) and stop is None
        assert not found or (found[0][0] == 7.0 and f"{100 * part:.0f} % of" in found[0][2])


def test_a_burst_in_the_run_is_noted_although_the_rest_is_sound() -> None:
    """60 J of 1 kJ, half a run before its end: it is 6 % when it comes and 3 % at the end."""
    found, _ = watched([0.0, 0.0, 60.0, 60.0, 60.0], [0.0, 500.0, 1000.0, 1500.0, 2000.0])
    assert [x[:2] for x in found] == [(2.0, "gains energy")] and "6 %" in found[0][2]


@pytest.mark.parametrize("later", [1e-3, 1e9], ids=["to the end", "before much is put in"])
def test_as_much_as_was_put_in_stops_a_run_wherever_it_comes(later: float) -> None:
    _, stop = watched([0.0, 101.0, 101.0], [0.0, 100.0, later])
    assert stop is not None and stop[0] is Outcome.GAINS_ENERGY


def test_the_first_moments_are_held_against_a_part_of_all() -> None:
    """Beyond GAIN_NOTED of FIRST_MOMENTS of all that is put in, energy of the first moments is noted, too."""
    share = GAIN_NOTED * FIRST_MOMENTS * 1e5  # J, which is 10 % of the 5 kJ that are put in then
    for part, noted in ((0.99, False), (1.01, True)):
        gained = part * share
        found, _ = watched([0.0, gained, gained], [0.0, 5e3, 1e5])
        assert bool(found) == noted


@pytest.mark.parametrize("kind", ["obstacle", "seabed"])
def test_a_rope_that_bounces_higher_than_it_fell_stops_the_run(kind: str) -> None:
    """10 mm above a floor without damping and friction: 2.94 J, of which steps of 5 ms make 22 J; not those of 1 ms."""
    floor = {"obstacles": {"floor": {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 1]}}}
    bed = {"environment": {"seabed": {"z": -0.02, "stiffness": 1e5}}}
    line = {"length": 5.0, "mass": 2.0, "diameter": 0.04, "axial_stiffness": 1e6, "bending_stiffness": 5.0}
    scene = (floor if kind == "obstacle" else bed) | {
        "cable": {"sections": [line]}, "ends": {"start": "free", "end": "free"}, "model": "rod",
        "initial": {"kind": "straight", "origin": [0, 0, 0.03], "direction": [1, 0, 0]}, "mesh": {"cells": 20},
    }  # fmt: skip
    with pytest.raises(ComputationError) as stopped:
        hybrid.run(scene | {"time": {"duration": 2.0, "step": 0.02 if kind == "seabed" else 0.005}})
    assert stopped.value.outcome == Outcome.GAINS_ENERGY
    stopped.value.snapshot.unlink()
    with hybrid.run(scene | {"time": {"duration": 0.5, "step": 0.0005}}) as fine:
        assert "gains energy" not in {x.kind for x in fine.events}
        assert fine.position[:, :, 2].max() < 0.0301
