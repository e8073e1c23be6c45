"""Lines that are joined to nothing that moves, beside sheaves, bodies with a shape, winches and contact of other lines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_system_contact import CLOSER, HOSE, LOW, RUBS
from test_winch_of_joined import floating

import hybrid
from hybrid.solve.network_solver import NetworkSolver

Tables = dict[str, Any]
ROPE = {"mass": 2.0, "diameter": 0.04, "axial_stiffness": 2e5, "damping": {"mass": 0.2}}
SWAY = {"sway": {"amplitude": 1.0, "period": 4.0}, "ramp": 1}
DRUM = {"kind": "sheave", "at": [0.3, 0, -3.9], "axis": [0, 1, 0], "radius": 0.48, "groove": 0.03, "rim": 0.02}


def line(start: str, end: str, length: float, cells: int = 8, points: Any = None) -> Tables:
    """points: that it begins at; None: in equilibrium."""
    placed = {} if points is None else {"initial": {"kind": "points", "points": points}}
    return {"start": start, "end": end, "sections": [ROPE | {"length": length}], "mesh": {"cells": cells}} | placed


# Two spans, of which one end sways, far from all else; and such that hang in equilibrium.
SPANS: Tables = {
    "points": {
        "a0": {"position": [-4, 20, 0]}, "a1": {"position": [4, 20, 0], "motion": SWAY},
        "b0": {"position": [-4, 30, 0]}, "b1": {"position": [4, 30, 0], "motion": SWAY},
    },
    "lines": {
        name: line(f"{name}0", f"{name}1", 80**0.5, points=[[-4, y, 0], [0, y, -2], [4, y, 0]])
        for name, y in (("a", 20), ("b", 30))
    },
}  # fmt: skip
HUNG: Tables = {"points": SPANS["points"], "lines": {x: line(f"{x}0", f"{x}1", 9.0) for x in "ab"}}
# A rope over a sheave that turns freely, one end of which heaves.
OVER: Tables = {
    "obstacles": {"drum": DRUM | {"friction": 0.3, "stiffness": 1e5, "bearing": {"inertia": 0.5, "damping": 0.1}}},
    "points": {
        "left": {"position": [-3, 0, -2]},
        "right": {"position": [3, 0, -2], "motion": {"heave": {"amplitude": 0.3, "period": 3.0}, "ramp": 1}},
    },
    "lines": {"rope": line("left", "right", 6.9, 30)},
}  # fmt: skip
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
HANGS: Tables = {
    "points": {"low": {"position": LOW, "motion": CLOSER}, "high": {"position": [1.2, 0, 0]}},
    "lines": {"hose": {"start": "low", "end": "high", "model": "rod", "mesh": {"cells": 40}, "sections": [HOSE],
                       "contact": RUBS}},
}  # fmt: skip


def scene(*parts: Tables, duration: float = 1.0, step: float = 0.02, **more: Any) -> Tables:
    """Systems side by side."""
    merged: Tables = {"time": {"duration": duration, "step": step}, "output": {"every": 0.1}}
    for part in parts:
        for key in {"points", "bodies", "lines", "obstacles"} & {*part}:
            merged[key] = merged.get(key, {}) | part[key]
    return merged | more


# Two lines from a body that hangs between them, beside a line of rods that many cells and slack make hard to find.
JOINED: Tables = {
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
    names = JOINED["lines"] | BESIDE["lines"]
    lines = {name: names[name] for name in ("first", "bent", "last")}
    together = JOINED | {"points": JOINED["points"] | BESIDE["points"], "lines": lines}
    found = dict(hybrid.static(together).each_line())
    for apart in (JOINED, BESIDE):
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


def test_a_sheave_that_nothing_touches_turns_with_the_first_line(groups: list[list[int]]) -> None:
    """It is another Newton for that line alone."""
    beside = hybrid.run(scene(SPANS, obstacles=OVER["obstacles"], duration=0.2))
    assert groups[-1] == [0]
    same(beside, hybrid.run(scene(SPANS, duration=0.2)), "b")


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
    solver._near[solver._mixes] = -1


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
