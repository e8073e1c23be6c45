"""Obstacles of a scene of several lines: a line that is cut is the line in one piece, a capstan, what a body asks for."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.state.report import STIFFNESS
from hybrid.model.network import build_network
from tests.scenes import system_of
from tests.validation.obstacle_scenes import CENTRELINE, DRUM, STRAND, Tables, drum, half_turn, over_pipe

MU, WEIGHT = 0.3, 100.0
CELLS = 64


# --- a line that is cut -------------------------------------------------------------------------------


def in_one_piece() -> Tables:
    """A rope over a pipe that its middle lies on."""
    tables = over_pipe(model="catenary", mesh={"cells": CELLS})
    tables["obstacles"]["pipe"]["at"] = [5.4, 0, -1.5]
    tables["output"] = {"every": 0.2, "points": CELLS + 1, "exact": True}
    return tables


def in_two_pieces(tables: Tables, shape: Any) -> Tables:
    """The same cut in its middle, at a free point on the pipe; shape: (N+1, 3) m, that it is looked for from."""
    found = deepcopy(tables)
    cable, ends = found.pop("cable"), found.pop("ends")
    for key in ("initial", "contact", "mesh", "model"):
        del found[key]
    half, section = CELLS // 2, cable["sections"][0]
    piece = {"sections": [section | {"length": 6.0}], "model": "catenary", "mesh": {"cells": half},
             "contact": {"self": False}}  # fmt: skip
    points = np.round(shape, 3).tolist()
    found["points"] = {
        "a": {"kind": "fixed"} | {k: x for k, x in ends["start"].items() if k != "kind"},
        "b": {"kind": "fixed"} | {k: x for k, x in ends["end"].items() if k != "kind"},
        "on": {"kind": "free", "initial_guess": points[half]},
    }
    initial = {"kind": "equilibrium"}
    found["lines"] = {
        "one": piece | {"start": "a", "end": "on", "initial": initial | {"points": points[: half + 1]}},
        "two": piece | {"start": "on", "end": "b", "initial": initial | {"points": points[half:]}},
    }
    found["output"]["points"] = half + 1
    return found


@pytest.fixture(scope="module")
def whole_and_cut() -> Any:
    tables = in_one_piece()
    whole = hybrid.run(tables)
    cut = hybrid.run(in_two_pieces(tables, whole.position[0]))
    return whole, cut.lines["one"], cut.lines["two"]


def test_a_line_that_is_cut_on_a_pipe_lies_as_in_one_piece(whole_and_cut: Any) -> None:
    """At rest to round-off; in motion, with friction on both sides of the cut, as far as Newton's method stops."""
    whole, one, two = whole_and_cut
    both = np.concatenate([one.position, two.position[:, 1:]], axis=1)
    assert np.abs(both[0] - whole.position[0]).max() < 1e-10
    assert np.abs(both - whole.position).max() < 2e-6
    # the point lies on the pipe
    pipe = in_one_piece()["obstacles"]["pipe"]
    axis = np.array(pipe["axis"]) / np.linalg.norm(pipe["axis"])
    w = two.position[:, 0] - np.array(pipe["at"], float)
    away = np.linalg.norm(w - np.outer(w @ axis, axis), axis=1) - pipe["radius"] - 0.025
    assert np.abs(away[:3]).max() < 0.02 * 0.05  # before it is lifted off


def test_energy_and_friction_of_the_pieces_are_those_of_the_whole(whole_and_cut: Any) -> None:
    whole, one, two = whole_and_cut
    for name in ("energy/contact", "work/friction", "work/contact"):
        np.testing.assert_allclose(one[name] + two[name], whole[name], rtol=2e-3, atol=1e-4)
    assert whole["work/friction"][-1] < -1.0


def test_what_is_neglected_at_rest_is_said_of_obstacles(whole_and_cut: Any) -> None:
    _, one, _ = whole_and_cut
    assert any(e.kind == "static friction neglected" and "on obstacles" in e.text for e in one.events)


# --- a weight over a drum -------------------------------------------------------------------------------


def weight_over_a_drum(friction: float) -> Tables:
    """A weightless rope over half a drum: a weight on a free point holds it, its other end is slowly lifted."""
    section = {"length": float(2.0 + np.pi * CENTRELINE), "mass": 5e-3, "diameter": 2 * STRAND,
               "axial_stiffness": 2e5, "bending_stiffness": 1e-5, "damping": {"mass": 20.0}}  # fmt: skip
    lifted = {"kind": "fixed", "position": [-CENTRELINE, 0, -1.0],
              "motion": {"travel": {"by": [0, 0, 0.1], "over": 2.0}}}  # fmt: skip
    hung = {"kind": "free", "mass": WEIGHT / 9.81, "initial_guess": [CENTRELINE, 0, -1.0]}
    line = {"start": "top", "end": "low", "sections": [section], "model": "catenary", "mesh": {"cells": 160},
            "contact": {"self": False}, "initial": {"points": half_turn(CENTRELINE, 1.0, 1.0)}}  # fmt: skip
    return {
        "points": {"top": lifted, "low": hung}, "lines": {"rope": line}, "obstacles": drum(friction),
        "time": {"duration": 2.0, "step": 0.01}, "output": {"every": 0.2, "points": 101, "exact": True},
    }  # fmt: skip


@pytest.fixture(scope="module")
def lifted() -> Any:
    return hybrid.run(weight_over_a_drum(MU)).lines["rope"]


def test_a_weight_at_a_point_presses_a_drum_by_tension_over_radius(lifted: Any) -> None:
    """At rest, without friction: T = W all along, and T/R along the arc by the law of contact from the penetration.

    What the obstacle is as stiff as is asked for by the weight at the point, which the line alone does not have.
    """
    rows = build_network(system_of(weight_over_a_drum(MU))).models[0].sea.values.obstacles
    *_, stiffness, _, onset, _ = rows[0]
    x = lifted.position[0]
    depth = CENTRELINE - np.hypot(x[:, 0], x[:, 2])[x[:, 2] > 0.2 * CENTRELINE] + 0.5 * onset
    pressure = stiffness * np.where(depth < onset, 0.5 * depth**2 / onset, depth - 0.5 * onset)
    np.testing.assert_allclose(pressure, WEIGHT / CENTRELINE, rtol=0.01)
    np.testing.assert_allclose(lifted.tension[0], WEIGHT, rtol=3e-3)
    assert 0.001 * 2 * STRAND < depth.max() < 0.025 * 2 * STRAND


def test_a_weight_that_is_let_down_over_a_drum_slides_by_the_exponential(lifted: Any) -> None:
    """Euler and Eytelwein: the end that is lifted lets the weight sink, and bears W e^(-mu pi)."""
    T = lifted.tension[-1]
    assert T[-1] == pytest.approx(WEIGHT, rel=0.03)
    assert 0.99 < np.log(T[-1] / T[0]) / (MU * np.pi) < 1.01


def test_a_body_makes_obstacles_stiff_enough() -> None:
    """A heavy body on a light rope, which by itself asks for little."""
    tables = weight_over_a_drum(0.0)
    tables["points"]["low"] = {"body": "block", "place": [0, 0, 0]}
    tables["bodies"] = {"block": {"mass": 100 * WEIGHT / 9.81, "inertia": [1, 1, 1],
                                  "initial_guess": [CENTRELINE, 0, -1.0]}}  # fmt: skip
    light, heavy = (
        build_network(system_of(x)).models[0].sea.values.obstacles[0, STIFFNESS]
        for x in (weight_over_a_drum(0.0), tables)
    )
    assert heavy == pytest.approx(100 * light, rel=0.02)


# --- what is refused -------------------------------------------------------------------------------------


def test_a_point_within_an_obstacle_is_refused() -> None:
    tables = weight_over_a_drum(MU)
    tables["points"]["top"]["position"] = [0, 0, 0.9 * DRUM]
    with pytest.raises(SceneError, match=r"points\.top\.position[\s\S]*obstacles\.drum"):
        hybrid.run(tables)
