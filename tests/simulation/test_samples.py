"""Outputs within steps: they do not shape the motion, and are of the order of the scheme."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
import hybrid.solve.run
from hybrid.simulation import line_result, network_run
from hybrid.store.recorder import BaseRecorder

ROD = {
    "length": 10.0, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 1e5, "bending_stiffness": 5.0,
    "torsional_stiffness": 4.0,
}  # fmt: skip
FIELDS = (
    "position", "velocity", "tension", "curvature", "bending_moment", "torque", "reaction_end", "moment_start",
    "energy/kinetic", "energy/potential", "work/end",
)  # fmt: skip


def swinging(model: str, step: float, every: float, **output: Any) -> hybrid.Scene:
    """A sagging rod in space whose end is swayed and turned, or a catenary of the same."""
    end = {"kind": "clamped", "position": [7, 0, 0], "tangent": [1, 0, 0.7], "normal": [0, 1, 0]}
    end["motion"] = {
        "sway": {"amplitude": 0.5, "period": 2.5}, "roll": {"amplitude": 40, "period": 3.0}, "ramp": 2.0
    }  # fmt: skip
    return hybrid.validate_scene(
        {
            "cable": {"sections": [ROD | {"damping": {"mass": 0.2, "stiffness": 0.02}}]},
            "ends": {"start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.7]}, "end": end},
            "initial": "equilibrium", "model": model, "mesh": {"cells": 40}, "dimension": 3,
            "time": {"duration": 4.0, "step": step}, "output": {"every": every, "points": 21, **output},
        }
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_an_output_within_a_step_is_of_second_order(model: str) -> None:
    """Outputs that fall anywhere in steps, against the same times as ends of steps 8 to 32 times as short."""
    every = 4.0 / 37
    fine = hybrid.run(swinging(model, 0.02 / 32, every, exact=True))
    errors: dict[str, list[float]] = {}
    for step in (0.02, 0.01, 0.005):
        result = hybrid.run(swinging(model, step, every))
        assert np.array_equal(result.times, fine.times)
        for name in (x for x in FIELDS if x in fine.names):
            size = np.abs(fine[name]).max()
            errors.setdefault(name, []).append(float(np.abs(result[name] - fine[name]).max() / size))
    for name, found in errors.items():
        order = np.log2(np.array(found[:-1]) / found[1:])
        print(f"{model}, {name}: {found[-1]:.1e}, order {order.round(2)}")
        assert order[-1] > 1.7 or found[-1] < 1e-6, name


def test_outputs_and_buffers_do_not_shape_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same bits at the same times, whatever other outputs there are, and however many steps a call takes."""
    few = hybrid.run(swinging("rod", 0.03, 0.4))
    many = hybrid.run(swinging("rod", 0.03, 0.1))
    monkeypatch.setattr(hybrid.solve.run, "ROWS", 7)
    monkeypatch.setattr(network_run, "MOST_SAMPLED", 1)
    small = hybrid.run(swinging("rod", 0.03, 0.1))
    assert np.array_equal(few["steps/dt"], many["steps/dt"])
    for name in many.names:
        if "t" in many.dims(name)[:1]:
            assert np.array_equal(many[name], small[name]), name
            assert np.array_equal(np.array(many[name])[::4], few[name]), name


def test_exact_outputs_are_ends_of_steps() -> None:
    """As 0.5.0 did: every interval between outputs is cut into equal steps."""
    result = hybrid.run(swinging("catenary", 0.2, 0.5, exact=True))
    assert np.allclose(result["steps/dt"], 0.5 / 3, rtol=0, atol=1e-12)
    inside = hybrid.run(swinging("catenary", 0.2, 0.5))
    assert np.allclose(inside["steps/dt"], 0.2, rtol=0, atol=1e-12)


def asks_at_once(look: hybrid.NodeState) -> np.ndarray:
    """From 1 s on a stretch must be rod, so much that the step is taken again."""
    return np.where((look.t > 1.0) & (np.abs(look.s - 200.0) < 10.0), 10.0, 0.0)


@pytest.mark.long
@pytest.mark.parametrize("name", ["touchdown", "s_tether", "repeated"])
def test_outputs_wait_for_nothing_that_changes(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Zones that move: the same bits with outputs that wait in batches, and with a buffer of one."""
    settings = ["time={duration: 14, step: 0.1}", "output={every: 0.05, errors: false}"]
    file, criterion = name, None
    if name == "repeated":
        file, settings, criterion = "touchdown", ["time={duration: 2, step: 0.1}", *settings[1:]], asks_at_once
    scene = hybrid.load_scene(Path(__file__).parents[2] / "examples" / f"{file}.yaml", settings)
    batches = hybrid.run(scene, criterion=criterion)
    monkeypatch.setattr(network_run, "MOST_SAMPLED", 1)
    one_by_one = hybrid.run(scene, criterion=criterion)
    assert (name if criterion else "bend") in " ".join(e.text for e in batches.events)
    for field in batches.names:
        if "t" in batches.dims(field)[:1]:
            assert np.array_equal(batches[field], one_by_one[field], equal_nan=True), field


@pytest.mark.long
def test_no_outputs_wait_for_the_search_for_garbage() -> None:
    """Batches, checkpoints and results go when they are done with: in a reference cycle they would fill the memory."""
    scene = swinging("rod", 0.02, 0.05)
    hybrid.run(scene)
    gc.collect()
    gc.disable()
    try:
        hybrid.run(scene)
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        found = {type(x).__name__ for x in gc.garbage if type(x).__module__.startswith("hybrid")}
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()
    assert not found


@pytest.mark.long
def test_outputs_with_criteria_wait_in_the_buffer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of a batch have each their own ratios: the same bits as one output at a time."""
    settings = ["time.duration=30", "output.criteria=true"]
    scene = hybrid.load_scene(Path(__file__).parents[2] / "examples" / "touchdown.yaml", settings)
    batches: list[int] = []
    save = BaseRecorder.save_batch

    def counted(self: BaseRecorder, times: np.ndarray, *more: Any) -> None:
        batches.append(times.size)
        save(self, times, *more)

    monkeypatch.setattr(BaseRecorder, "save_batch", counted)
    many = hybrid.run(scene)
    assert max(batches) > 20  # while lengths or bending are on their way, outputs do not wait
    monkeypatch.setattr(line_result, "WAITING", 1)
    batches.clear()
    one = hybrid.run(scene)
    assert set(batches) == {1}
    names = [x for x in many.names if x.startswith("criteria/")]
    assert len(names) > 3 and len({x.kind for x in many.events} & {"grow", "split"}) > 0
    for name in [*names, "position", "tension"]:
        assert np.array_equal(many[name], one[name]), name


@pytest.mark.parametrize("motion", [{"yaw": {"amplitude": 20, "period": 6}}, {"roll": {"amplitude": 90, "period": 12}}])
def test_outputs_within_a_step_follow_a_clamp_that_turns(motion: dict[str, Any]) -> None:
    """The moment at a clamp beside short cells, between ends of steps: an evenly turned frame was a tenth of it off."""
    section = {
        "length": 30, "mass": 3, "diameter": 0.04, "axial_stiffness": 2e6, "bending_stiffness": 60,
        "torsional_stiffness": 40, "drag": {"normal": 1.2},
    }  # fmt: skip
    start = {"kind": "clamped", "tangent": [1, 0, -0.5], "normal": [0, 1, 0], "position": [0, 0, 0]}
    end = {"kind": "clamped", "tangent": [1, 0, 0.5], "normal": [0, 1, 0], "position": [25, 0, 0]}
    graded = 30.0 - np.cumsum(0.02 * 1.25 ** np.arange(20))[::-1]  # m, cells of 20 mm and more beside the end
    graded = graded[graded > 0.0]
    nodes = [*np.linspace(0.0, graded[0], 12).tolist(), *graded[1:].tolist(), 30.0]
    scene = {
        "environment": {"fluid": {"density": 1025}}, "cable": {"sections": [section]}, "initial": "equilibrium",
        "ends": {"start": start, "end": end | {"motion": motion | {"ramp": 6}}}, "model": "rod", "mesh": {"nodes": nodes},
        "output": {"every": 0.1},
    }  # fmt: skip
    fine, coarse = (hybrid.run(scene | {"time": {"duration": 8, "step": step}}) for step in (0.01, 0.2))
    off = np.abs(coarse.moment_end - fine.moment_end).max(axis=1)
    assert off[1::2].max() < 3e-3 * np.abs(fine.moment_end).max()
    off = np.abs(coarse.torque - fine.torque).max(axis=1)
    assert off[1::2].max() < 0.02 * np.abs(fine.torque).max()  # a tenth of it was off
