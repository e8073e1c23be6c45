"""Steps that show a vibration along the line while it lasts, and longer ones once it has died out."""

from __future__ import annotations

import numpy as np
import pytest
from bits import Stopping, differences, went_on

import hybrid
from hybrid.kernels.state import books as b
from hybrid.model.resolution import first_resolution
from hybrid.simulation.vibration_steps import VibrationSteps
from tests.said import both_ways, line_of, said
from tests.scenes import cable_scene, pinned_at

PERIOD = 4.0 * 12.0 * (2.0 / 1e5) ** 0.5


def sag(ramp=1.0, accuracy="3%", duration=10.0, period=2.0):
    """A line that sags between two pins, one of which heaves; a short ramp sets off a vibration along it."""
    section = {
        "length": 12.0, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 1e5, "bending_stiffness": 20.0,
        "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    motion = {"heave": {"amplitude": 0.3, "period": period}, "ramp": ramp}
    return hybrid.validate_scene(cable_scene(
        section, pinned_at(0, 0, -5), pinned_at(10, 0, -5, motion=motion), fluid={"density": 1025}, model="rod",
        time={"duration": duration}, accuracy=accuracy, output=(0.1, 25)
    ))  # fmt: skip


def watched(scene=None):
    """Of a scene, at t = 0: the clock of its run and what chooses its longest step."""
    scene = scene or sag()
    resolution, clock = first_resolution(scene), b.Clock()
    clock.largest = clock.next_dt = resolution.step
    steps = VibrationSteps(scene, resolution)
    steps.begin(clock)
    return resolution, clock, steps


def look(steps, clock, amplitude):
    """Go to the next look, with so large a vibration (N) of the second end beside a force that changes slowly."""
    t = np.linspace(steps.look - 2.0 * PERIOD, steps.look, 97)[1:]
    force = 100.0 + 30.0 * np.sin(np.pi * t + 0.3) + amplitude * np.cos(2.0 * np.pi * t / PERIOD + 1.0)
    steps.log(np.column_stack([t, np.full_like(t, 50.0), force]))
    found = steps.amplitude()
    clock.now = steps.look
    steps.judge(clock)
    return found


def test_resolutions_have_both_steps():
    found = first_resolution(sag())
    assert found.step == pytest.approx(PERIOD / 48.0) and found.later == pytest.approx(1.0 / 12.0)
    coarse = found.coarser(2.0, 2.0)
    assert (coarse.step, coarse.later, coarse.still) == (2.0 * found.step, 2.0 * found.later, found.still)
    assert first_resolution(sag(ramp=4.0)).later == 0.0  # an ordinary ramp shakes nothing that matters


def test_steps_are_short_until_a_period_of_the_motion_has_shown_little():
    """Which begins where the ramp ends, and again where something has been seen."""
    resolution, clock, steps = watched()
    assert clock.largest == resolution.step and steps.begins == [0.0, 1.0]
    assert look(steps, clock, 20.0) == pytest.approx(20.0, rel=0.05)
    clock.now = 1.0
    steps.begin(clock)  # the ramp ends
    seen = 0.0
    while steps.look < np.inf:
        assert clock.largest == resolution.step
        seen = steps.look if abs(steps.look - 2.3) < PERIOD else seen
        look(steps, clock, 3.0 * resolution.still if abs(steps.look - 2.3) < PERIOD else 0.0)
    assert clock.largest == resolution.later and 0.0 <= clock.now - seen - 2.0 <= 2.0 * PERIOD


def test_a_vibration_that_stays_or_is_not_seen_keeps_steps_short():
    resolution, clock, steps = watched()
    for _ in range(40):
        look(steps, clock, 0.7 * resolution.still)
    assert clock.largest == resolution.step and steps.look < np.inf
    _, clock, steps = watched()
    for _ in range(40):
        assert steps.amplitude() == np.inf  # no steps
        steps.judge(clock)
    assert steps.look < np.inf


def test_a_checkpoint_goes_on_and_a_forged_one_does_not():
    _, clock, steps = watched()
    look(steps, clock, 20.0)
    steps.log(np.array([[clock.now + 0.01, 1.0, 2.0]]))
    again = watched()[2]
    again.restore(steps.checkpoint(), clock)
    assert {k: np.array(x).tolist() for k, x in again.checkpoint().items()} == {
        k: np.array(x).tolist() for k, x in steps.checkpoint().items()
    }
    for wrong in ({"look": 1e6}, {"rows": np.zeros((2, 2))}, {"from": "now"}):
        with pytest.raises(ValueError, match="vibration"):
            again.restore(steps.checkpoint() | wrong, clock)
    again.restore(None, clock)  # a file from before
    assert again.look > clock.now


@both_ways
@pytest.mark.long
def test_steps_are_longer_where_it_has_died_out_and_forces_stay_right(network):
    """Of 40 s with short steps throughout there were 8949 (docs/evidence/accuracy.md); drag stops the vibration in 2 s."""
    whole = hybrid.run(said(sag(), network))
    result = line_of(whole)
    t, step = np.array(result.steps["t"]), first_resolution(sag()).step
    dt = np.diff(t)
    assert dt[t[1:] < 3.0].max() <= 1.001 * step
    assert np.median(dt[t[1:] > 6.0]) > 4.0 * step
    fixed = sag().model_dump(exclude_none=True) | {"time": {"duration": 10.0, "step": 2e-3}, "mesh": {"cells": 80}}
    del fixed["accuracy"]
    truth = hybrid.run(fixed)
    ends = ("reaction_start", "reaction_end")
    off = max(float(np.linalg.norm(result[x] - truth[x], axis=1).max()) for x in ends)
    assert off <= 0.03 * max(float(np.linalg.norm(truth[x], axis=1).max()) for x in ends)
    assert 0.7 <= result.attributes["error_total_end_force"] / off <= 3.0


@both_ways
def test_drag_that_sets_it_off_again_in_every_period_keeps_steps_short(network):
    """At 1 %: steps that follow the motion alone damp 1.4 N of it in every period, which no run would show."""
    dt = np.diff(line_of(hybrid.run(said(sag(accuracy="1%", duration=8.0), network))).steps["t"])
    assert dt.max() <= 1.001 * PERIOD / 48.0


@both_ways
@pytest.mark.long
def test_a_stopped_run_goes_on_bit_for_bit(tmp_path, monkeypatch, network):
    scene, stopping = said(sag(duration=6.0, accuracy="10%", ramp=0.5), network), Stopping(monkeypatch)
    hybrid.run(scene, tmp_path / "whole.h5", progress=stopping).close()
    heard = stopping.heard
    assert went_on(scene, tmp_path / "run.h5", stopping, [round(0.6 * heard), heard // 5, heard // 10]) == 3
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
