"""`dimension: 2` where space is computed: beside obstacles, and of several lines, of which nothing may leave the plane."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError, Outcome, SceneError
from tests.combinations.pairs import Tables, as_network, seen_by
from tests.problems import tables_with
from tests.scenes import cable_scene, clamped_at, pinned_at

LENGTH = 12.0
SECTION: Tables = {
    "length": LENGTH, "mass": 4.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 30.0,
    "torsional_stiffness": 20.0, "damping": {"mass": 0.4}, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip
STEPS: Tables = {"time": {"duration": 1.0, "step": 0.02}, "output": {"every": 0.1, "points": 25, "exact": True}}


def hung(model: str = "rod", **more: Any) -> Tables:
    """A line in the plane of x and z whose upper end is moved in it."""
    motion = {"surge": {"amplitude": 0.4, "period": 1.5}, "heave": {"amplitude": 0.5, "period": 1.2}, "ramp": 0.5}
    fluid = {"density": 1025, "surface": 6.0, "current": [0.3, 0, 0]}
    return cable_scene(
        SECTION, clamped_at([0, 0, 0], [1, 0, -1]), pinned_at(8, 0, 3, motion=motion), fluid=fluid, model=model,
        contact={"self": False}, mesh=36, dimension=2
    ) | deepcopy(STEPS) | more  # fmt: skip


def network(tables: Tables) -> Tables:
    return as_network(tables | {"initial": {"kind": "equilibrium"}})


def over(kind: str = "cylinder", **obstacle: Any) -> Tables:
    """The same over something across the plane, or centred in it."""
    shapes: Tables = {
        "cylinder": {"axis": [0, 1, 0], "radius": 0.6}, "sphere": {"radius": 0.6},
        "box": {"size": [1.2, 3.0, 1.2], "rounding": 0.3, "rotation": [0, 20, 0]},
    }  # fmt: skip
    pipe = {"kind": kind, "at": [4.0, 0, -2.6], "friction": 0.3} | shapes[kind]
    found = hung(obstacles={"pipe": pipe | obstacle})
    if kind == "sphere":  # on which a line stays that is taut, and turned aside by less than the radius
        found["obstacles"]["pipe"] |= {"at": [4.0, 0, 0.9]} | obstacle
        found["ends"]["start"] = {"kind": "pinned", "position": [0, 0, 0]}
        found["cable"] = {"sections": [SECTION | {"length": 8.45}]}
        for way in ("surge", "heave"):
            found["ends"]["end"]["motion"][way]["amplitude"] *= 0.1
    return found


@pytest.mark.parametrize("kind", ["cylinder", "box", "sphere"])
def test_beside_obstacles_in_a_plane_nothing_leaves_it(kind: str) -> None:
    """It is the motion in space, whose parts across the plane are zero; in another plane they are round-off."""
    tables = over(kind)
    line = hybrid.run(tables)
    other = hybrid.run({key: x for key, x in tables.items() if key != "dimension"})
    assert not line.position[..., 1].any()
    assert np.abs(line.position - other.position).max() == 0.0
    away = np.linalg.norm((line.position - tables["obstacles"]["pipe"]["at"])[..., [0, 2]], axis=-1).min(axis=1)
    assert (away < (0.95 if kind == "box" else 0.7)).any() and away.min() > 0.6
    c, s = np.cos(0.7), np.sin(0.7)
    M = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    if kind != "box":  # whose rotation is about axes of the inertial frame
        motion = tables["ends"]["end"]["motion"]  # of which surge is in the plane that is turned
        ways = {
            key: motion["surge"] | {"amplitude": motion["surge"]["amplitude"] * x}
            for key, x in (("surge", c), ("sway", s))
        }
        again = seen_by(M, over(kind))
        again["ends"]["end"]["motion"] = motion | ways
        again["environment"]["fluid"]["current"] = [0.3 * c, 0.3 * s, 0.0]
        there = hybrid.run(again).position @ M
        assert np.abs(there[..., 1]).max() < 1e-9 * LENGTH
        assert np.abs(there - line.position).max() < 1e-6 * LENGTH


def with_body(**buoy: Any) -> Tables:
    """Two lines with a buoy between them, which turns in the plane."""
    line = {"sections": [SECTION | {"length": 6.0}], "model": "rod", "mesh": {"cells": 12}}
    body = {"mass": 40.0, "inertia": [3.0, 5.0, 4.0], "initial_guess": [4, 0, -2], "centre": [0.1, 0, -0.2]}
    motion = {"surge": {"amplitude": 0.4, "period": 1.5}, "ramp": 0.5}
    return {
        "points": {"a": {"position": [0, 0, 0]}, "b": {"position": [9, 0, 1], "motion": motion},
                   "l": {"body": "buoy", "place": [-0.3, 0, 0.1]}, "r": {"body": "buoy", "place": [0.3, 0, 0.2]}},
        "bodies": {"buoy": body | buoy}, "dimension": 2, "environment": {"fluid": {"density": 1025}},
        "lines": {"left": {"start": "a", "end": "l"} | line, "right": {"start": "r", "end": "b"} | line},
    } | deepcopy(STEPS)  # fmt: skip


def test_a_body_between_lines_turns_in_their_plane() -> None:
    found = hybrid.run(with_body())
    rotation, place = found.bodies["buoy/rotation"], found.bodies["buoy/position"]
    assert np.ptp(rotation[:, 1]) > 1.0 and not rotation[:, [0, 2]].any() and not place[:, 1].any()
    assert all(not x.position[..., 1].any() for x in found.lines.values())


def folded(**more: Any) -> Tables:
    """A loop whose clamped ends come together until its legs, which would cross, press against each other."""
    section = {
        "length": 4.0, "mass": 1.5, "diameter": 0.04, "axial_stiffness": 1e5, "bending_stiffness": 1.0,
        "torsional_stiffness": 1.0, "damping": {"mass": 2.0},
    }  # fmt: skip
    ends: Tables = {}
    for name, side in (("start", -1.0), ("end", 1.0)):
        motion = {"travel": {"by": [-0.3 * side, 0, 0], "over": 0.8}}
        ends[name] = {"kind": "clamped", "position": [0.35 * side, 0, 0], "tangent": [0.5, 0, side], "motion": motion}
    return hung(
        environment={}, cable={"sections": [section]}, ends=ends, contact={"self": True}, mesh={"cells": 60},
        time={"duration": 1.5, "step": 0.01}, output=STEPS["output"] | {"points": 61},
    ) | more  # fmt: skip


def test_a_line_that_touches_itself_in_a_plane_stays_in_it() -> None:
    """It is the motion in space, across which there is nothing; its legs stay a diameter apart, where they lie flat."""
    found = hybrid.run(folded())
    assert not found.position[..., 1].any() and any(x.kind == "line touches itself" for x in found.events)
    space = hybrid.run({key: x for key, x in folded().items() if key != "dimension"})
    assert np.abs(found.position - space.position).max() == 0.0
    apart = found.position[-1, ::-1, 0] - found.position[-1, :, 0]
    legs = slice(1, 12)
    assert apart[legs].min() == pytest.approx(0.04, rel=0.05)
    through = hybrid.run(folded(contact={"self": False})).position[-1]
    assert (through[::-1, 0] - through[:, 0])[legs].min() < 0.03
    again = hybrid.run(seen_by(np.diag([-1.0, 1.0, 1.0]), folded()))
    assert np.abs(again.position * [-1.0, 1.0, 1.0] - found.position).max() < 1e-9


OUT: list[tuple[Tables, str, float | None]] = [
    (over(axis=[0.4, 1, 0]), "", 0.0),
    (over("sphere", at=[4.0, 0.2, 0.9]), "", None),
    (network(over(axis=[0.4, 1, 0])), "line cable", 0.0),
    (with_body(centre=[0.1, 0.1, -0.2]), "buoy leaves it", 0.0),
    (with_body(moment={"value": [3, 0, 0], "ramp": 0.5}), "buoy leaves it", 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "words", "since"), OUT)
def test_what_leaves_the_plane_stops(tables: Tables, words: str, since: float | None) -> None:
    """At rest too; with what to write."""
    for compute in (hybrid.run, hybrid.static) if since is not None else (hybrid.static,):
        with pytest.raises(ComputationError, match="dimension: 3") as told:
            compute(tables)
        assert told.value.outcome == Outcome.LEFT_PLANE and words in str(told.value)


REFUSED: list[tuple[Tables, str]] = [
    (network(hung()) | {"environment": {"fluid": {"density": 1025, "current": [0.3, 0.1, 0]}}}, r"environment\.fluid"),
    (with_body() | {"points": with_body()["points"] | {"b": {"position": [9, 0.5, 1]}}}, r"points\.b\.position"),
    (tables_with(network(hung()), {"lines.cable.sections": [SECTION | {"tension_torque": 1e-3}]}), "there is no torsion"),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "words"), REFUSED)
def test_what_does_not_lie_in_the_plane_is_refused_where_it_stands(tables: Tables, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        hybrid.run(tables)
    three = tables | {"dimension": 3}
    assert hybrid.static({key: x for key, x in three.items() if key not in ("time", "output")}) is not None
