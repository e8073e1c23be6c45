"""Lines that are joined to nothing that moves, beside sheaves, bodies with a shape, winches and contact of other lines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import resumed
from test_plane import storm, swinging
from test_system_contact import CLOSER, HOSE, LOW, RUBS
from test_winch import floating

import hybrid
from hybrid.kernels.junctions.borders import JOINED
from hybrid.kernels.state.report import PLANAR
from hybrid.scene.root import in_full
from hybrid.solve.network_solver import NetworkSolver
from tests.combinations.networks import differences, events_differ
from tests.inside import calls_of
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

Tables = dict[str, Any]
ROPE = {"mass": 2.0, "diameter": 0.04, "axial_stiffness": 2e5, "damping": {"mass": 0.2}}
SWAY = {"sway": {"amplitude": 1.0, "period": 4.0}, "ramp": 1}
DRUM = {"kind": "sheave", "at": [0.3, 0, -3.9], "axis": [0, 1, 0], "radius": 0.48, "groove": 0.03, "rim": 0.02}


def line(start: str, end: str, length: float, cells: int = 8, points: Any = None) -> Tables:
    """points: that it begins at; None: in equilibrium."""
    placed = {} if points is None else {"initial": {"kind": "points", "points": points}}
    return {"start": start, "end": end, "sections": [ROPE | {"length": length}], "mesh": {"cells": cells}} | placed


# Two spans, of which one end sways, far from all else; and such that hang in equilibrium.
SPANS: Tables = network_scene(
    {"a0": {"position": [-4, 20, 0]}, "a1": {"position": [4, 20, 0], "motion": SWAY}, "b0": {"position": [-4, 30, 0]},
     "b1": {"position": [4, 30, 0], "motion": SWAY}},
    {name: line(f"{name}0", f"{name}1", 80**0.5, points=[[-4, y, 0], [0, y, -2], [4, y, 0]]) for name,
     y in (("a", 20), ("b", 30))}
)  # fmt: skip
HUNG: Tables = {"points": SPANS["points"], "lines": {x: line(f"{x}0", f"{x}1", 9.0) for x in "ab"}}
# A rope over a sheave that turns freely, one end of which heaves.
OVER: Tables = network_scene(
    {"left": {"position": [-3, 0, -2]},
     "right": {"position": [3, 0, -2], "motion": {"heave": {"amplitude": 0.3, "period": 3.0}, "ramp": 1}}},
    {"rope": line("left", "right", 6.9, 30)},
    obstacles={"drum": DRUM | {"friction": 0.3, "stiffness": 1e5, "bearing": {"inertia": 0.5, "damping": 0.1}}}
)  # fmt: skip
# A rope under that sheave, which it does not touch.
PASSES: Tables = network_scene(
    {"p": {"position": [-3, 0.1, -6]}, "q": {"position": [3, 0.1, -6]}},
    {"passes": line("p", "q", 2 * 15.25**0.5, points=[[-3, 0.1, -6], [0, 0.1, -8.5], [3, 0.1, -6]])},
)
# A ball that hangs from a point that sways into the way of a taut line.
BALL: Tables = {
    "bodies": {"ball": {"initial_guess": [0, 0, -5], "mass": 30.0, "inertia": [3.0] * 3,
                        "shape": {"kind": "sphere", "radius": 0.5, "stiffness": 2e4}}},
    "points": {"top": {"position": [0, 0, 0], "motion": SWAY}, "eye": {"body": "ball", "place": [0, 0, 0.5]},
               "p0": {"position": [-3, 0.9, -5]}, "p1": {"position": [3, 0.9, -5]}},
    "lines": {"pendant": line("top", "eye", 4.5, 5, [[0, 0, 0], [0, 0, -4.5]]),
              "taut": line("p0", "p1", 5.99, 12, [[-3, 0.9, -5], [3, 0.9, -5]])},
}  # fmt: skip
# The legs of a U come to touch each other.
HANGS: Tables = network_scene(
    {"low": {"position": LOW, "motion": CLOSER}, "high": {"position": [1.2, 0, 0]}},
    {"hose": line_between("low", "high", HOSE, model="rod", mesh=40, contact=RUBS)},
)


def scene(*parts: Tables, duration: float = 1.0, step: float = 0.02, **more: Any) -> Tables:
    """Systems side by side."""
    merged: Tables = {"time": {"duration": duration, "step": step}, "output": {"every": 0.1}}
    for part in parts:
        for key in {"points", "bodies", "lines", "obstacles"} & {*part}:
            merged[key] = merged.get(key, {}) | part[key]
    return merged | more


# Two lines from a body that hangs between them, beside a line of rods that many cells and slack make hard to find.
BETWEEN: Tables = {
    "bodies": {"weight": {"initial_guess": [0, 0, -3], "mass": 40.0, "inertia": [1.0] * 3}},
    "points": {"left": {"position": [-4, 0, 0]}, "right": {"position": [4, 0, 0]},
               "eye": {"body": "weight", "place": [0, 0, 0.5]}},
    "lines": {"first": line("left", "eye", 5.0), "last": line("eye", "right", 5.5)},
}  # fmt: skip
BESIDE: Tables = {
    "points": {"c": {"position": [0, 20, 0]}, "d": {"position": [60, 20, 5]}},
    "lines": {"bent": line("c", "d", 150.0, 1100) | {"model": "rod"}},
}
BESIDE["lines"]["bent"]["sections"] = [ROPE | {"length": 150.0, "bending_stiffness": 5.0}]


def test_a_lone_line_comes_to_rest_as_by_itself() -> None:
    names = BETWEEN["lines"] | BESIDE["lines"]
    lines = {name: names[name] for name in ("first", "bent", "last")}
    together = BETWEEN | {"points": BETWEEN["points"] | BESIDE["points"], "lines": lines}
    found = dict(hybrid.static(together).each_line())
    for apart in (BETWEEN, BESIDE):
        for name, own in hybrid.static(apart).each_line():
            assert np.array_equal(found[name]["position"], own["position"])
            assert np.allclose(found[name]["tension"], own["tension"], rtol=1e-13)


@pytest.fixture
def groups(monkeypatch: pytest.MonkeyPatch) -> list[list[int]]:
    """Numbers of the lines that one Newton solves, whenever other ones are."""
    found: list[list[int]] = []
    group = NetworkSolver._group

    def noted(solver: NetworkSolver) -> None:
        group(solver)
        if [solver.joined] != found[-1:]:
            found.append(solver.joined)

    monkeypatch.setattr(NetworkSolver, "_group", noted)
    return found


def same(beside: Any, alone: Any, names: Sequence[str] = "ab", part: float = 0.0) -> None:
    """Lines of these names move in both results alike: bit for bit, or to a part of the largest value."""
    for name in names:
        for key in ("position", "velocity", "tension", "work/end", "energy/kinetic"):
            one, other = beside.lines[name][key], alone.lines[name][key]
            assert np.abs(one - other).max() <= part * np.abs(other).max(), (name, key)


def test_a_sheave_leaves_alone_what_does_not_touch_it(groups: list[list[int]]) -> None:
    """Other lines move as without it, but for round-off of the common equilibrium, and know how far it has turned."""
    beside = hybrid.run(scene(OVER, HUNG))
    assert groups[-1] == [0]
    same(beside, hybrid.run(scene(HUNG)), part=1e-10)
    turned = beside.lines["rope"]["obstacles/drum/rotation"]
    assert np.abs(turned[-1] - turned[0]).max() > 1e-3
    np.testing.assert_array_equal(beside.lines["b"]["obstacles/drum/rotation"], turned)


def test_a_sheave_that_nothing_touches_turns_with_the_first_line_that_may(groups: list[list[int]]) -> None:
    """It is another Newton for that line alone; with none where no line can reach it, and then it is at rest."""
    alone, drum = hybrid.run(scene(SPANS, duration=0.2)), {"obstacles": OVER["obstacles"]}
    for near, joined in ((SPANS, []), (scene(SPANS, PASSES), [2])):
        beside = hybrid.run(scene(near, drum, duration=0.2))
        assert groups[-1] == joined
        same(beside, alone)
        assert not beside.lines["b"]["obstacles/drum/rotation"].any()


def test_a_winch_of_a_joined_line_leaves_others_alone(groups: list[list[int]]) -> None:
    beside = hybrid.run(scene(HUNG, floating(0.0), duration=0.4))
    assert groups[-1] == [2]
    same(beside, hybrid.run(scene(HUNG, duration=0.4)), part=1e-9)


@pytest.mark.long
def test_a_line_that_touches_itself_is_solved_by_itself(groups: list[list[int]]) -> None:
    """As in a scene of its own, and others do not hear of it, but for round-off of the equilibrium."""
    both, hose = (hybrid.run(scene(x, HANGS, duration=1.7, step=0.01)) for x in (HUNG, {}))
    assert groups[-1] == [] and hose.lines["hose"]["energy/self_contact"].max() > 0.0
    same(both, hybrid.run(scene(HUNG, duration=1.7, step=0.01)), part=1e-9)
    same(both, hose, ["hose"], part=1e-9)


def all_together(solver: NetworkSolver, *_: Any) -> None:
    """Every line that may touch what is free moves with it always."""
    solver._near[solver._mixes] = JOINED


@pytest.mark.long
def test_a_body_that_comes_to_touch_a_line_moves_with_it(
    groups: list[list[int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """From there on, and no longer than it is near: the same as if both were always one Newton's, and resumed."""
    tables = scene(BALL, SPANS, duration=4.0)
    found = hybrid.run(tables, tmp_path / "whole.h5", progress=False)
    assert groups[0] == [0] and [0, 1] in groups and groups[-1] == [0]
    assert all({2, 3}.isdisjoint(x) for x in groups)
    force = np.linalg.norm(found.lines["taut"]["obstacles/ball/force"], axis=1)
    touching = found.times[force > 1.0]
    assert 2 < touching.size < force.size - 5
    part = tables | {"time": tables["time"] | {"duration": float(touching[1])}}
    hybrid.run(part, tmp_path / "part.h5", progress=False).close()
    again = hybrid.resume(tmp_path / "part.h5", until=4.0)
    same(again, found, ["pendant", "taut", "a"])
    monkeypatch.setattr(NetworkSolver, "find_near", all_together)
    together = hybrid.run(tables)
    assert groups[-1] == [0, 1, 2, 3]
    for name, x in together.lines.items():
        assert np.abs(x.position - found.lines[name].position).max() <= 1e-7, name


# --- Lines of a network that are joined to nothing and lie in a plane: computed there, as one cable is ---


@pytest.fixture
def flat(monkeypatch: pytest.MonkeyPatch) -> list[list[int]]:
    """Numbers of the lines whose steps are made in a plane, of each solver of a motion."""
    return calls_of(
        monkeypatch, NetworkSolver, "swap_states", lambda x, _: [k for k in x.lone if x.lines[k].line.bits & PLANAR]
    )


def as_network(tables: Any) -> hybrid.Scene:
    return in_full(hybrid.validate_scene(tables))


# What changes cells or lengths of a line in motion: a third of them change within these scenes.
CHANGES: dict[str, Tables] = {
    "zones that move": {"model": {"kind": "adaptive", "always_move": True, "hold_time": 0.1}},
    "cells that follow": {"model": {"kind": "adaptive", "curvature_error": 0.02}, "mesh": {}},
    "payout": {"payout": {"rate": 1.5, "ramp": 0.5, "longest": 40}},
}  # fmt: skip


def changing(kind: str) -> Tables:
    """A swinging line whose cells, zones or length change; it lies in a plane, of which nothing is said."""
    tables = swinging(0.8, 0.0) | {"time": {"duration": 3.0, "step": 0.05}} | CHANGES[kind]
    if payout := tables.pop("payout", None):
        tables["ends"]["end"] |= {"payout": payout}
        tables["ends"]["end"].pop("motion")
    return tables


@pytest.mark.parametrize("kind", CHANGES)
def test_a_line_that_changes_in_a_plane_is_the_cable(kind: str, flat: list[list[int]]) -> None:
    """Zones, cells and nodes come and go in the plane; so they do on the way out of it."""
    tables = changing(kind)
    network = hybrid.run(as_network(tables))
    assert flat and all(x == [0] for x in flat)
    if kind != "zones that move":
        assert len(flat) == 1  # cells and nodes come and go without another solver
    cable = hybrid.run(tables | {"dimension": 3})
    assert flat[-1] == []
    assert [str(x) for x in differences(cable, network)] == []
    assert events_differ(cable, network) == []


def test_only_what_is_joined_to_nothing_is_computed_in_a_plane(flat: list[list[int]]) -> None:
    """A pendant with a body goes on in space, and lines that may touch a shape; lines that no plane holds do, too."""
    points = {name: BALL["points"][name] for name in ("top", "eye")}
    hanging = {"points": points, "lines": {"pendant": BALL["lines"]["pendant"]}}
    hanging["bodies"] = {"ball": {k: x for k, x in BALL["bodies"]["ball"].items() if k != "shape"}}
    still = {name: {"position": point["position"]} for name, point in SPANS["points"].items()}
    tables = scene(hanging, SPANS | {"points": still | {"b1": SPANS["points"]["b1"]}}, duration=0.1)
    hybrid.run(tables)
    assert flat[-1] == [1]  # an end of line b sways across
    hybrid.run(tables | {"bodies": BALL["bodies"]})
    assert flat[-1] == []


def ball(*at: float) -> Tables:
    """A small ball in the way of nothing."""
    return {"obstacles": {"ball": {"kind": "sphere", "at": [*at], "radius": 0.2, "stiffness": 1e5}}}


def test_an_obstacle_out_of_reach_leaves_a_line_in_its_plane(flat: list[list[int]]) -> None:
    """As without it, to the bit; one that the line could reach does not, and is written beside both."""
    alone, far, near = (
        hybrid.run(as_network(swinging(0.8, 0.0) | x)).lines["cable"] for x in ({}, ball(7, 10, -40), ball(7, 10, 5))
    )
    assert flat == [[0], [0], []]
    for key in ("position", "velocity", "tension", "curvature", "energy/kinetic", "steps/iterations"):
        np.testing.assert_array_equal(far[key], alone[key], err_msg=key)
    np.testing.assert_allclose(near.position, alone.position, rtol=0, atol=1e-9 * 30)
    assert not any(far["obstacles/ball/normal_force"].ravel())
    contents = {at: hybrid.plan(swinging(0.8, 0.0) | ball(7, 10, at)).contents for at in (-40, 5)}
    why = [{e.what: e.why for e in x}["computed in a plane (3 unknowns a node)"] for x in contents.values()]
    assert why[0].startswith("all of the scene lies in") and why[1].startswith("obstacles: contact with obstacles")
    assert [e.on for x in contents.values() for e in x if e.what.startswith("obstacle ball")] == [False, True]


def test_an_obstacle_takes_only_lines_out_of_their_planes_that_may_reach_it(flat: list[list[int]]) -> None:
    spans = {
        "points": {f"{x}{k}": {"position": [8 * k - 4, y, 0]} for x, y in zip("abc", (0, 20, 40), strict=True) for k in (0, 1)},
        "lines": {x: SPANS["lines"]["a"] | {"start": f"{x}0", "end": f"{x}1", "initial": "equilibrium"} for x in "abc"},
    }  # fmt: skip
    alone = hybrid.run(scene(spans, duration=0.2))
    assert flat[-1] == [0, 1, 2]
    turning = {"obstacles": {"drum": DRUM | {"at": [0, 20, 1], "stiffness": 1e5, "bearing": {"inertia": 0.5}}}}
    for near in (ball(0, 20, 1), turning):
        beside = hybrid.run(scene(spans, near, duration=0.2))
        assert flat[-1] == [0, 2]
        for name, x in alone.lines.items():
            np.testing.assert_allclose(beside.lines[name].position, x.position, rtol=0, atol=1e-8)


@pytest.mark.long
def test_other_loads_may_reach_an_obstacle(flat: list[list[int]], tmp_path: Path) -> None:
    """An end comes nearer from 1 s on, which lets the line come to the ball: it goes on in space."""
    tables = swinging(0.8, 0.0) | ball(7.5, 10, -10.6) | {"time": {"duration": 1.0, "step": 0.05}}
    hybrid.run(tables, tmp_path / "part.h5", progress=False).close()
    assert flat == [[0]]
    nearer = ["ends.end.motion.travel={by: [-3, -4, 0], over: 2, begin: 1}"]
    found = hybrid.resume(tmp_path / "part.h5", until=4.0, settings=nearer, progress=False)
    assert flat[-1] == [] and [e.kind for e in found.events].count("out of plane") == 1


@pytest.mark.long
def test_other_loads_may_take_a_line_out_of_its_plane(flat: list[list[int]], tmp_path: Path) -> None:
    """A current across it from 2 s on: the same motion, but for the push by which it leaves, as computed in space."""
    across = ["environment.fluid.current=[0.4, -0.3, 0]"]
    found = []
    for dimension in (None, 3):
        tables = swinging(0.8, 0.0, dimension) | {"time": {"duration": 2.0, "step": 0.05}}
        path = tmp_path / f"{dimension}.h5"
        hybrid.run(as_network(tables), path, progress=False).close()
        found.append(hybrid.resume(path, until=4.0, settings=across, progress=False).lines["cable"])
    assert [0] in flat and flat[-1] == []
    normal = np.array([0.8, -0.6, 0.0])
    assert np.abs(found[1].position[-1] @ normal).max() > 0.1
    assert np.abs(found[0].position - found[1].position).max() < 1e-3


def test_a_line_that_comes_near_itself_leaves_its_plane(flat: list[list[int]]) -> None:
    """To touch itself in space."""
    closer = {"travel": {"by": [1.19, 0.0, 0.0], "over": 1.5}}
    tables = cable_scene(
        HOSE, pinned_at(0, 0, 0, motion=closer), pinned_at(1.2, 0, 0), model="rod", mesh=40, time=(1.6, 0.01),
        output=0.1
    )  # fmt: skip
    network = hybrid.run(as_network(tables))
    assert [e.kind for e in network.events].count("out of plane") == 1
    assert flat[0] == [0] and flat[-1] == []
    assert network.lines["cable"]["energy/self_contact"].max() > 0.0


@pytest.mark.long
def test_it_is_resumed_bit_for_bit(flat: list[list[int]], tmp_path: Path) -> None:
    """From its plane, from space, and from the plane again."""
    whole = hybrid.run(as_network(storm(300.0)), tmp_path / "whole.h5", progress=False)
    assert [x for k, x in enumerate(flat) if x != flat[k - 1] or not k] == [[0], [], [0]]
    hybrid.run(as_network(storm(100.0)), tmp_path / "part.h5", progress=False).close()
    for until in (200.0, 290.0, 300.0):
        found = hybrid.resume(tmp_path / "part.h5", until=until)
    for key in ("position", "tension", "envelope/tension_max", "work/end"):
        np.testing.assert_array_equal(found.lines["cable"][key], whole.lines["cable"][key], err_msg=key)


def test_a_line_that_is_paid_out_leaves_its_plane_in_a_resumed_run_as_in_the_whole(tmp_path: Path) -> None:
    """By a push that is a part of what is out then, wherever the run was resumed."""
    heave = {"heave": {"amplitude": 3.0, "period": 3.75}, "ramp": 4}
    winch = pinned_at(0, 0, 0, motion=heave, payout={"rate": 0.02, "ramp": 2.0, "longest": 22})
    tables = cable_scene(
        {"length": 20, "mass": 2, "axial_stiffness": 1e6, "bending_stiffness": 1}, "free", winch, model="rod", mesh=10,
        time=(46, 0.05), output=0.5
    )  # fmt: skip
    whole = resumed(tables, tmp_path, 40.0)
    (event,) = (e for e in whole.events if e.kind == "out of plane")
    assert 40.0 < event.t < 46.0 and np.abs(whole.position[-1, :, 1]).max() > 1e-5


def test_stepped_from_outside_it_is_computed_in_the_plane_that_a_scene_asks_for(flat: list[list[int]]) -> None:
    """Nothing is set out of the plane, and what is restored goes on there; else it moves in space."""
    for dimension in (2, None):
        tables, found = swinging(0.0, 0.0, dimension), []
        del tables["ends"]["end"]["motion"]
        for back in (False, True):
            with hybrid.Simulation(as_network(tables)) as network:
                saved = network.save()
                for k in [*range(1, 9), 0] * back + [*range(1, 9)]:
                    if k == 0:
                        network.restore(saved)
                        continue
                    network.set_point("end", (15 + 0.03 * k, 20 + 0.04 * k, 0.02 * k * k))
                    network.step()
                assert flat[-1] == ([0] if dimension == 2 else [])
                if dimension == 2:
                    with pytest.raises(ValueError, match="out of the plane"):
                        network.set_point("end", (15, 21, 0))
                found.append(network.result().lines["cable"].position)
        np.testing.assert_array_equal(*found)
