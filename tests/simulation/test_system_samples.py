"""Outputs of several lines within steps: of the order of the scheme, and the same bits however they come about."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
import hybrid.simulation.network_run
from hybrid.simulation import progress

ROPE = {
    "length": 14.0, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 2e4, "drag": {"normal": 1.2},
    "damping": {"mass": 1.0, "stiffness": 0.1},
}  # fmt: skip
HOSE = ROPE | {"length": 9.0, "bending_stiffness": 8.0, "torsional_stiffness": 6.0}
BUOY = {
    "kind": "free", "initial_guess": [0, 0, -1], "mass": 400.0, "inertia": [120, 140, 90], "volume": 0.45,
    "centre_of_buoyancy": [0, 0, 0.4], "damping": [300, 300, 300, 150, 150, 150],
}  # fmt: skip


def moored(step: float, every: float, duration: float = 3.0, **output: Any) -> dict[str, Any]:
    """A buoy that turns on two ropes and a hose clamped to it, which a ship draws; the ropes meet at a point below."""
    sway = {
        "sway": {"amplitude": 0.3, "period": 3.0}, "roll": {"amplitude": 6.0, "period": 3.0}, "ramp": 3.0
    }  # fmt: skip
    return {
        "environment": {"fluid": {"density": 1025, "current": [0.2, 0.1, 0]}},
        "points": {
            "west": {"position": [-15, 0, -16]}, "east": {"position": [15, 2, -16]},
            "knot": {"initial_guess": [0, 0, -10], "mass": 30.0, "volume": 0.05, "drag_area": 0.3},
            "eye": {"body": "buoy", "place": [0.2, 0, -0.8]}, "flange": {"body": "buoy", "place": [0.6, 0.1, 0]},
            "rail": {"body": "ship", "place": [0, 0.5, 0]},
        },
        "bodies": {"buoy": BUOY, "ship": {"position": [9, 0, 1], "motion": sway}},
        "lines": {
            "west": {"start": "west", "end": "knot", "sections": [ROPE | {"length": 17.0}], "mesh": {"cells": 10}},
            "east": {"start": "knot", "end": "east", "sections": [ROPE | {"length": 17.0}], "mesh": {"cells": 10}},
            "up": {"start": "knot", "end": "eye", "sections": [ROPE | {"length": 9.0}], "mesh": {"cells": 8}},
            "hose": {
                "start": "flange", "end": "rail", "sections": [HOSE], "mesh": {"cells": 16}, "model": "rod",
                "connections": {"start": {"tangent": [1, 0, 0.2]}, "end": {"tangent": [1, 0, 0.3]}},
            },
        },
        "time": {"duration": duration, "step": step}, "output": {"every": every, "points": 9} | output,
    }  # fmt: skip


def fields(result: hybrid.Result) -> dict[str, np.ndarray]:
    """All that is recorded over time of points, bodies and lines."""
    parts = {"": result} | {f"{name} ": line for name, line in result.lines.items()}
    return {
        f"{part}{name}": np.array(x[name])
        for part, x in parts.items()
        for name in x.names
        if x.dims(name)[:1] == ("t",) and not name.startswith("steps/")
    }  # fmt: skip


def assert_same(one: hybrid.Result, other: hybrid.Result) -> None:
    """Bit for bit."""
    mine, its = fields(one), fields(other)
    assert mine.keys() == its.keys() and len(mine) > 60
    for name, x in mine.items():
        assert np.array_equal(x, its[name], equal_nan=True), name


EVERY = 3.0 / 37  # which falls anywhere in steps


def test_outputs_within_steps_are_of_second_order() -> None:
    """Of points, bodies and lines, all that is recorded, against the same times as ends of steps that are shorter."""
    fine = fields(hybrid.run(moored(0.02 / 16, EVERY, exact=True)))
    coarse, better = (fields(hybrid.run(moored(step, EVERY))) for step in (0.02, 0.01))
    known = [name for name, x in fine.items() if np.abs(x).max() > 0.0 and not name.endswith("work/scheme")]
    assert len(known) > 100 and np.ptp(fine["bodies/buoy/rotation"]) > 0.05
    for name in known:
        first, last = (float(np.abs(x[name] - fine[name]).max() / np.abs(fine[name]).max()) for x in (coarse, better))
        assert first < 3e-3 and (last < first / 3.0 or last < 1e-9), (name, first, last)


def test_ends_points_and_bodies_are_in_one_place_within_steps() -> None:
    result = hybrid.run(moored(0.02, EVERY))
    lines, knot = result.lines, result["points/knot/position"]
    assert not np.isin(result.times[1:-1], lines["up"].steps["t"]).any()
    for name, node in (("west", -1), ("east", 0), ("up", 0)):
        assert np.abs(lines[name].position[:, node] - knot).max() < 1e-12
    for name, place in (("eye", [0.2, 0, -0.8]), ("flange", [0.6, 0.1, 0])):
        reach = np.linalg.norm(result[f"points/{name}/position"] - result["bodies/buoy/position"], axis=1)
        assert np.abs(reach - np.linalg.norm(place)).max() < 1e-6
    balance = result["points/eye/force"] + result["points/flange/force"] - result["bodies/buoy/force"]
    assert np.abs(balance).max() < 1e-9 * np.abs(result["bodies/buoy/force"]).max()


def test_outputs_and_buffers_do_not_shape_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same bits at the same times, whatever other outputs there are, and however few of them a buffer takes."""
    many = hybrid.run(moored(0.03, 0.02, 1.2))
    few = hybrid.run(moored(0.03, 0.08, 1.2))
    monkeypatch.setattr(hybrid.simulation.network_run, "WAITING", 1)
    assert_same(many, hybrid.run(moored(0.03, 0.02, 1.2)))
    assert np.array_equal(many.lines["up"]["steps/dt"], few.lines["up"]["steps/dt"])
    mine = fields(many)
    for name, x in fields(few).items():
        if "rotation" not in name and not name.endswith("work/scheme"):  # which counts from output to output
            assert np.array_equal(mine[name][::4], x), name


@pytest.mark.long
@pytest.mark.parametrize("automatic", [False, True])
def test_a_run_that_stops_between_outputs_goes_on_bit_for_bit(
    automatic: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its outputs within the next step are made of that before it, too."""
    scene = moored(0.03, 0.08, 0.9)
    if automatic:
        scene["time"] = {"duration": 0.9}
        scene["accuracy"] = {"tension": "5%"}
    monkeypatch.setattr(hybrid.simulation.network_run, "ROWS", 1)
    monkeypatch.setattr(hybrid.simulation.network_run, "WORK", 1)
    monkeypatch.setattr(progress, "REPORT_EVERY", -1.0)
    whole, path, heard = tmp_path / "whole.h5", tmp_path / "run.h5", 0
    hybrid.run(scene, whole).close()

    def stop(x: Any) -> None:
        nonlocal heard
        heard += 1
        if heard in (5, 13, 16):
            raise KeyboardInterrupt

    for k in range(4):
        try:
            (hybrid.resume(path, progress=stop) if k else hybrid.run(scene, path, progress=stop)).close()
            break
        except KeyboardInterrupt:
            pass
    assert k == 3 or automatic
    with hybrid.open(whole) as one, hybrid.open(path) as other:
        assert_same(one, other)


@pytest.mark.long
def test_what_is_stepped_from_outside_and_taken_back_has_the_same_outputs() -> None:
    """Steps end between outputs; each is computed twice."""
    scene, times = moored(0.03, 0.08, 0.9), [*(0.03 * np.arange(1, 30)), 0.9]  # to the bit the ends of its steps
    with hybrid.Simulation(scene) as simulation:
        for t in times:
            saved = simulation.save()
            simulation.advance(t)
            simulation.restore(saved)
            simulation.advance(t)
        result = simulation.result()
    assert_same(hybrid.run(scene), result)


def test_a_load_that_jumps_on_an_output_counts_in_it() -> None:
    """An output at the time of a jump has accelerations and forces of after it, and the next ones know of none before."""
    scene = moored(0.03, 0.15, 0.9)
    scene["points"]["knot"]["force"] = {"value": [0, 0, 120.0], "until": 0.45}
    at, inside = hybrid.run(scene), hybrid.run(scene | {"output": {"every": 0.05, "points": 9}})
    exact = hybrid.run(scene | {"output": {"every": 0.05, "points": 9, "exact": True}})
    force, tight, fine = (x["bodies/buoy/force"] for x in (at, inside, exact))
    assert np.abs(force - tight[::3]).max() == 0.0
    jump = np.abs(np.diff(fine[8:11], axis=0)).max()
    assert np.abs(tight - fine).max() < 0.2 * jump + 1e-3 * np.abs(fine).max()
