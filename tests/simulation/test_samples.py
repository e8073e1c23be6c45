"""Outputs within steps: they do not shape the motion, and are of the order of the scheme."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
import hybrid.simulation.run_record
from hybrid.errors import ZONE_EVENTS, SceneError
from hybrid.simulation import run_line
from hybrid.store.recorder import Rows
from tests.inside import calls_of
from tests.scenes import cable_scene, clamped_at, line_between, network_scene, pinned_at

ROD = {
    "length": 10.0, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 1e5, "bending_stiffness": 5.0,
    "torsional_stiffness": 4.0,
}  # fmt: skip


def swinging(model: str, step: float, every: float, **output: Any) -> hybrid.Scene:
    """A sagging rod in space whose end is swayed and turned, or a catenary of the same."""
    end = {"kind": "clamped", "position": [7, 0, 0], "tangent": [1, 0, 0.7], "normal": [0, 1, 0]}
    end["motion"] = {
        "sway": {"amplitude": 0.5, "period": 2.5}, "roll": {"amplitude": 40, "period": 3.0}, "ramp": 2.0
    }  # fmt: skip
    return hybrid.validate_scene(cable_scene(
        ROD | {"damping": {"mass": 0.2, "stiffness": 0.02}}, clamped_at([0, 0, 0], [1, 0, -0.7]), end, model=model,
        mesh=40, dimension=3, time=(4.0, step), output={"every": every, "points": 21, **output}
    ))  # fmt: skip


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
@pytest.mark.parametrize("name", ["touchdown", "s_tether", "repeated", "cells", "nodes"])
def test_outputs_wait_for_nothing_that_changes(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Zones that move: the same bits with outputs that wait in batches, and with a buffer of one."""
    settings = ["time={duration: 14, step: 0.1}", "output={every: 0.05, errors: false}"]
    file, criterion = name, None
    if name == "repeated":
        file, settings, criterion = "touchdown", ["time={duration: 2, step: 0.1}", *settings[1:]], asks_at_once
    if name == "cells":  # which follow the curvature
        model = "model={kind: adaptive, curvature_error: 0.05}"
        file, settings = "s_tether", ["time={duration: 3, step: 0.1}", settings[1], model]
    if name == "nodes":  # which enter at a winch
        file, settings = "laying_winch", ["time={duration: 9, step: 0.1}", settings[1]]
    scene = hybrid.load_scene(Path(__file__).parents[2] / "examples" / f"{file}.yaml", settings)
    batches = hybrid.run(scene, criterion=criterion)
    monkeypatch.setattr(run_line, "WAITING", 1)
    one_by_one = hybrid.run(scene, criterion=criterion)
    if name == "cells":
        assert len({x.s.size for x in batches.mesh}) > 1
    elif name != "nodes":
        assert (name if criterion else "bend") in " ".join(e.text for e in batches.events)
    for field in batches.names:
        if "t" in batches.dims(field)[:1]:
            assert np.array_equal(batches[field], one_by_one[field], equal_nan=True), field


def test_outputs_that_wait_are_of_the_cells_of_their_own_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Taken in and paid out again: a cell that is whole in the first outputs lacks something when the last ones come."""
    section = {"length": 80.0, "mass": 60.0, "diameter": 0.15, "axial_stiffness": 5e7, "bending_stiffness": 2e5}
    winch = pinned_at(70, 0, 20, payout={"lengths": [[0.0, 80.0], [3.0, 78.5], [6.0, 80.0]]})
    more: dict[str, Any] = {"mesh": 80, "model": "rod", "dimension": 2, "time": (6.0, 0.05), "output": (0.5, 81)}
    scene = cable_scene(section | {"torsional_stiffness": 1e5}, pinned_at(0, 0, 0), winch, **more)
    batches = hybrid.run(scene)
    monkeypatch.setattr(run_line, "WAITING", 1)
    one_by_one = hybrid.run(scene)
    for field in ("position", "velocity", "energy/stretch", "work/scheme"):
        assert np.array_equal(batches[field], one_by_one[field]), field


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
    batches = calls_of(monkeypatch, Rows, "save_batch", lambda _, times, *more: times.size)
    many = hybrid.run(scene)
    assert max(batches) > 20  # while lengths or bending are on their way, outputs do not wait
    monkeypatch.setattr(run_line, "WAITING", 1)
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
    scene = cable_scene(
        section, start, end | {"motion": motion | {"ramp": 6}}, fluid={"density": 1025}, model="rod",
        mesh={"nodes": nodes}, output=0.1
    )  # fmt: skip
    fine, coarse = (hybrid.run(scene | {"time": {"duration": 8, "step": step}}) for step in (0.01, 0.2))
    off = np.abs(coarse.moment_end - fine.moment_end).max(axis=1)
    assert off[1::2].max() < 3e-3 * np.abs(fine.moment_end).max()
    off = np.abs(coarse.torque - fine.torque).max(axis=1)
    assert off[1::2].max() < 0.02 * np.abs(fine.torque).max()  # a tenth of it was off


# --- of several lines ---

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
    return network_scene(
        {"west": {"position": [-15, 0, -16]}, "east": {"position": [15, 2, -16]},
         "knot": {"initial_guess": [0, 0, -10], "mass": 30.0, "volume": 0.05, "drag_area": 0.3},
         "eye": {"body": "buoy", "place": [0.2, 0, -0.8]}, "flange": {"body": "buoy", "place": [0.6, 0.1, 0]},
         "rail": {"body": "ship", "place": [0, 0.5, 0]}},
        {"west": line_between("west", "knot", ROPE | {"length": 17.0}, mesh=10),
         "east": line_between("knot", "east", ROPE | {"length": 17.0}, mesh=10),
         "up": line_between("knot", "eye", ROPE | {"length": 9.0}, mesh=8),
         "hose": line_between("flange", "rail", HOSE, mesh=16, model="rod",
                              connections={"start": {"tangent": [1, 0, 0.2]}, "end": {"tangent": [1, 0, 0.3]}})},
        fluid={"density": 1025, "current": [0.2, 0.1, 0]},
        bodies={"buoy": BUOY, "ship": {"position": [9, 0, 1], "motion": sway}}, time=(duration, step),
        output={"every": every, "points": 9} | output
    )  # fmt: skip


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
    monkeypatch.setattr(run_line, "WAITING", 1)
    assert_same(many, hybrid.run(moored(0.03, 0.02, 1.2)))
    assert np.array_equal(many.lines["up"]["steps/dt"], few.lines["up"]["steps/dt"])
    mine = fields(many)
    for name, x in fields(few).items():
        if "rotation" not in name and not name.endswith("work/scheme"):  # which counts from output to output
            assert np.array_equal(mine[name][::4], x), name


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


# --- what is asked of outputs ---

SECTION = {"length": 60, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
WAVES = {"kind": "regular", "height": 0.4, "period": 5.0, "direction": 30, "ramp": 0.5}
SEA = {"fluid": {"density": 1025, "surface": 30.0, "waves": WAVES}}
LOW, HIGH = [0, 0, 0], [40, 5, 25]
LINE: dict[str, Any] = {"sections": [SECTION], "mesh": {"cells": 12}, "model": "catenary"}


def asked(output: dict[str, Any], compute: Callable[..., hybrid.Result] = hybrid.run, **more: Any) -> hybrid.Result:
    """A line whose far end heaves, of which so much is asked."""
    high = {"position": HIGH, "motion": {"heave": {"amplitude": 0.3, "period": 4}, "ramp": 0.5}}
    tables = {
        "environment": SEA, "time": {"duration": 1.0, "step": 0.02}, "points": {"low": {"position": LOW}, "high": high},
        "lines": {"one": {"start": "low", "end": "high"} | LINE}, "output": {"every": 0.1, "points": 11} | output,
    }  # fmt: skip
    return compute(tables | more)


def test_places_of_histories_are_those_of_the_line() -> None:
    """Also in its grid: 7 and 41 m are none of its eleven points."""
    line = asked({"history": {"one": [7.0, 41.0]}}).lines["one"]
    assert np.array_equal(line["history"], [7.0, 41.0]) and line.s.size == 13 and np.isin([7.0, 41.0], line.s).all()
    assert np.ptp(line.tension, axis=0).min() > 1e-3 * line.tension.max()


@pytest.mark.parametrize("history, where", [
    ({"two": [1.0]}, "output.history.two"), ({"one": [70.0]}, r"output.history.one\[0\]"), ([1.0], "output.history"),
])  # fmt: skip
def test_a_place_on_no_line_is_refused_where_it_is(history: Any, where: str) -> None:
    with pytest.raises(SceneError, match=where):
        asked({"history": history})


@pytest.mark.parametrize("exact", [False, True])
def test_steps_end_at_outputs_if_that_is_asked(exact: bool) -> None:
    """Outputs are no multiples of steps here: else they are interpolated."""
    found = asked({"every": 0.13, "exact": exact, "history": {"one": [7.0]}})
    line = found.lines["one"]
    assert np.isin(line.times[1:], line.steps["t"]).all() == exact
    assert np.abs(found["points/high/position"] - line.position[:, -1]).max() < 1e-12
    assert np.abs(found["points/high/force"] + line["reaction_end"]).max() < 1e-9 * line.tension.max()


@pytest.mark.parametrize("compute", [hybrid.run, hybrid.static])
def test_the_sea_at_gauges_is_beside_the_points(compute: Callable[..., hybrid.Result]) -> None:
    places = [[3.0, -2.0], [40.0, 25.0]]
    found = asked({"elevation": places, "exact": True}, compute)
    assert found["elevation"].shape == (len(found.times), 2) and np.array_equal(found["elevation_at"], places)
    assert compute is hybrid.static or np.ptp(found["elevation"], axis=0).min() > 0.05


def test_gauges_ask_for_waves() -> None:
    still = {"fluid": {"density": 1025, "surface": 30.0}}
    with pytest.raises(SceneError, match="the sea has no waves"):
        asked({"elevation": [[0, 0]]}, environment=still)


def test_outputs_within_steps_have_the_stiffness_of_their_time() -> None:
    """Where bending comes, moments between the ends of a step lie between those at its ends."""
    section = {"length": 50, "mass": 9, "diameter": 0.06, "axial_stiffness": 2e6, "bending_stiffness": 300}
    section |= {"drag": {"normal": 1.2}, "added_mass": {"normal": 1}}
    clump = {"kind": "clump", "at": 22, "mass": 60, "volume": 0.01, "drag_area": 0.05, "added_mass": 10}
    buoy = {"kind": "float", "at": 38, "buoyancy": 200, "mass": 20, "drag_area": 0.1, "added_mass": 15}
    surge = {"amplitude": 0.15, "period": 4, "phase": 60}
    end = pinned_at(41, 0, 0, motion={"heave": {"amplitude": 0.2, "period": 4}, "surge": surge, "ramp": 4})
    ends, inside = (hybrid.run(cable_scene(
        section, pinned_at(0, 0, -20), end, attachments=[clump, buoy], model={"kind": "adaptive", "always_move": True},
        mesh=50, fluid={"density": 1025}, seabed={"z": -20, "stiffness": 2e4, "damping": 500}, time=(2.6, 0.02),
        output={"every": every, "points": [float(x) for x in range(51)]}
    )) for every in (0.02, 0.004))  # fmt: skip
    changes = [x.t for x in ends.events if x.kind in ZONE_EVENTS]
    assert changes
    linear = np.stack([np.interp(inside.t, ends.t, x) for x in ends.bending_moment.T], axis=1)
    away = np.abs(inside.t[:, None] - np.array(changes)).min(axis=1) > 0.041
    assert np.abs(inside.bending_moment - linear)[away].max() < 0.003 * ends.bending_moment.max()
