"""Lines on fixed obstacles: capstans, pressure, statics over a pipe, energy, no tunnelling, what is refused.

Friction acts on the centreline (docs/theory.md), so that exponents are those of the angle alone.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.laws.obstacles import stored_energy
from hybrid.model.build import build
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import CENTRELINE, STRAND, capstan, heavy_capstan, over_pipe

MU = 0.3


def ran(tables: dict[str, Any]) -> Any:
    return hybrid.run(hybrid.validate_scene(tables))


def distances(result: Any, row: int, radius: float) -> Any:
    """From the axis of the drum, over its radius, of the upper half of the line."""
    x = result.position[row]
    return np.hypot(x[:, 0], x[:, 2])[x[:, 2] > 0.2 * radius] - radius


# --- capstans ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["catenary", "rod"])
def slid(request: pytest.FixtureRequest) -> Any:
    return ran(capstan(MU, 40.0, request.param))


def test_tension_grows_by_the_exponential_of_the_angle(slid: Any) -> None:
    """Euler and Eytelwein: T2/T1 = e^(mu phi) where a rope slides over an angle phi.

    By a hundredth of the exponent, of which what has not slid yet, elastically, takes a part.
    """
    T = slid.tension[-1]
    assert 0.99 < np.log(T[-1] / T[0]) / (MU * np.pi) < 1.0
    assert np.linalg.norm(slid.reaction_start[-1]) == pytest.approx(T[0], rel=1e-6)


def test_energy_of_a_capstan_is_booked(slid: Any) -> None:
    """What the pull does is stored, or lost by friction: 1e-4 of it is left to the time scheme."""
    done = slid["work/applied"][-1]
    assert -0.5 * done < slid["work/friction"][-1] < -0.2 * done
    assert abs(slid["work/scheme"][-1]) < 1e-4 * done
    assert 0.0 < slid["energy/contact"][-1] < done


def test_a_smooth_drum_presses_by_tension_over_radius() -> None:
    """T/R along the arc, by the law of contact from the penetration; and the tension is the same everywhere."""
    tables = capstan(0.0, 10.0)
    result, sea = ran(tables), build(one_line(hybrid.validate_scene(tables))).sea.values
    *_, stiffness, _, onset, _ = sea.obstacles[0]
    depth = -distances(result, -1, CENTRELINE) + 0.5 * onset
    pressure = stiffness * np.where(depth < onset, 0.5 * depth**2 / onset, depth - 0.5 * onset)
    np.testing.assert_allclose(pressure, 10.0 / CENTRELINE, rtol=0.01)
    np.testing.assert_allclose(result.tension[-1], 10.0, rtol=2e-3)
    assert 0.001 * 2 * STRAND < -distances(result, -1, CENTRELINE).max() < 0.02 * 2 * STRAND  # a fiftieth at most


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
def test_a_heavy_rope_slides_where_its_weight_says(friction: float) -> None:
    """The heavy side that slides over a light one of height h: e^(mu pi) h + 2 mu R (e^(mu pi) + 1)/(1 + mu^2).

    The pull of what holds the light end counts as height, T/w.
    """
    result = ran(heavy_capstan(friction))
    r, R = result.position[-1], 0.051
    light = -r[0, 2] + result.tension[-1, 0] / (0.01 * 9.81)
    more = np.exp(friction * np.pi)
    held = more * light + 2.0 * friction * R * (more + 1.0) / (1.0 + friction**2)
    assert -r[-1, 2] == pytest.approx(held, rel=0.01)


# --- over a pipe --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def laid() -> Any:
    return ran(over_pipe())


def test_an_equilibrium_over_a_pipe_is_found_from_the_scene_alone(laid: Any) -> None:
    """It lies over the pipe that its catenary would pass through, without tension that is not there, and in balance."""
    start = laid.position[0]
    pipe = over_pipe()["obstacles"]["pipe"]
    axis = np.array(pipe["axis"]) / np.linalg.norm(pipe["axis"])
    w = start - np.array(pipe["at"], float)
    away = np.linalg.norm(w - np.outer(w @ axis, axis), axis=1) - pipe["radius"] - 0.025
    assert -0.05 * 0.05 < away.min() < 0.0
    assert (away < 0.01).sum() > 3
    assert {e.kind for e in laid.events} == {"static friction neglected"}


def test_ends_and_pipe_bear_the_weight(laid: Any) -> None:
    """The force of the pipe as the derivative of the energy that it stores by a shift of the line."""
    model = build(one_line(hybrid.validate_scene(over_pipe())))
    r, shift = laid.position[0], 1e-7 * np.eye(3)
    energy = [stored_energy(model.line, model.sea.values, r + k * x) for x in shift for k in (-1.0, 1.0)]
    pressed = -np.diff(np.array(energy).reshape(3, 2), axis=1)[:, 0] / 2e-7
    forces = laid.reaction_start[0] + laid.reaction_end[0] + pressed
    np.testing.assert_allclose(forces, [0.0, 0.0, 2.0 * 9.81 * 12.0], atol=0.05)
    assert pressed[2] > 50.0


def test_energy_over_a_pipe_is_booked(laid: Any) -> None:
    put_in = np.abs(laid["work/end"]).max()
    assert np.abs(laid["work/scheme"]).max() < 0.01 * put_in
    assert laid["work/friction"][-1] < 0.0


# --- blows, and what is said ---------------------------------------------------------------------------


def falling(step: float, speed: float = 0.0, **more: Any) -> dict[str, Any]:
    """A rope that falls on a thin pipe across it, its ends free."""
    pipe = {"kind": "cylinder", "at": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.1, "friction": 0.5}
    section = {"length": 2.0, "mass": 0.2, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02,
               "damping": {"mass": 0.2}}  # fmt: skip
    return cable_scene(
        section, "free", "free", obstacles={"pipe": pipe},
        initial={"kind": "straight", "direction": [1, 0, 0], "origin": [-1.0, 0.3, 0.5], "velocity": [0, 0, -speed]},
        model="rod", mesh=100, contact={"self": False}, time=(0.6, step), output=(0.02, 101)
    ) | more  # fmt: skip


@pytest.mark.parametrize("speed", [0.0, 20.0])
def test_no_step_carries_a_line_through_a_pipe(speed: float) -> None:
    """Steps of 0.02 s in which it falls by 0.06 to 0.4 m, the diameter of the pipe being 0.2: some are repeated shorter."""
    result = ran(falling(0.02, speed))
    away = np.hypot(result.position[:, :, 0], result.position[:, :, 2])
    assert 0.099 < away.min() < 0.111  # it touches, and no part of it is within
    assert result.position[:, 50, 2].min() > 0.05  # the middle stays above
    assert result.steps.repeats.max() > 0 or speed == 0.0
    assert result["work/scheme"].max() < 1e-3 * np.abs(result["energy/kinetic"]).max()


def test_cells_that_do_not_follow_a_radius_are_said() -> None:
    result = ran(falling(0.01, mesh={"cells": 20}))
    said = [e for e in result.events if e.kind == "unresolved bend" and "obstacle pipe" in e.text]
    assert said
    assert "cells of 0.028 m" in said[0].text


def test_a_line_that_sinks_into_a_soft_obstacle_is_said() -> None:
    tables = falling(0.01)
    tables["obstacles"]["pipe"]["stiffness"] = 50.0
    said = [e for e in ran(tables).events if e.kind == "deep in an obstacle"]
    assert said
    assert "obstacles.pipe.stiffness" in said[0].text


def test_the_program_places_cells_that_follow_a_radius() -> None:
    tables = falling(0.01)
    del tables["mesh"]
    model = build(one_line(hybrid.validate_scene(tables)))
    assert model.line.h.max() <= 0.25 * (0.1 + 0.01)
    assert any(x.what.startswith("obstacle pipe: cylinder") and x.on for x in model.contents)


@pytest.mark.parametrize(
    ("change", "where", "says"),
    [
        ({"ends": {"start": {"kind": "pinned", "position": [0, 0, 0.05]}, "end": "free"}}, "ends.start.position", "obstacles.pipe"),
        ({"obstacles": {"pipe": {"kind": "cylinder", "at": [0, 0, 0], "radius": 1}}}, "obstacles.pipe.axis", ""),
    ],
)  # fmt: skip
def test_what_does_not_go_with_obstacles_is_refused(change: dict[str, Any], where: str, says: str) -> None:
    tables = falling(0.01) | change
    if "ends" in change:
        tables["initial"] = "equilibrium"
    with pytest.raises(SceneError) as refused:
        hybrid.run(hybrid.validate_scene(tables))
    assert any(x.where == where and says in str(refused.value) for x in refused.value.complaints), refused.value


@pytest.mark.long
def test_derivatives_of_a_line_on_a_sheave_lead_to_the_length_that_is_sought() -> None:
    """Against a difference of equilibria; what is found, put into the scene, has the tension that was asked for."""
    tables = over_pipe()
    tables["obstacles"]["pipe"]["bearing"] = {"inertia": 1.0}
    length = tables["cable"]["sections"][0]["length"]

    def tension(length: float) -> float:
        section = tables["cable"]["sections"][0] | {"length": length}
        scene = hybrid.validate_scene(tables | {"cable": {"sections": [section]}})
        return hybrid.sensitivity(scene, ["tension@0"], ["cable.sections[0].length"])[0].result

    scene = hybrid.validate_scene(tables)
    (found,) = hybrid.sensitivity(scene, ["tension@0"], ["cable.sections[0].length"])
    difference = (tension(length + 0.02) - tension(length - 0.02)) / 0.04
    assert abs(found.derivative - difference) <= found.error
    sought = hybrid.seek(scene, {"tension@0": 100.0}, ["cable.sections[0].length"])
    assert tension(sought.numbers["cable.sections[0].length"]) == pytest.approx(100.0, abs=1e-6)


def test_a_line_on_obstacles_has_a_diameter() -> None:
    tables = falling(0.01)
    section = tables["cable"]["sections"][0]
    bare = deepcopy(section)
    del bare["diameter"]
    tables["cable"]["sections"] = [bare]
    with pytest.raises(SceneError, match="touches obstacles"):
        hybrid.validate_scene(tables)


def test_a_wall_and_a_ball_hold_a_line_as_a_cylinder_does() -> None:
    """A rope lies on a floor: what it presses with is its weight, and it lies a fiftieth of its diameter deep."""
    floor = {"floor": {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 2]},
             "ball": {"kind": "sphere", "at": [0, 0, -9.9], "radius": 10.0}}  # fmt: skip
    tables = falling(0.01, obstacles=floor)
    tables["ends"]["start"] = {"kind": "pinned", "position": [-1.0, 0, 0.3]}
    tables["initial"] = "equilibrium"
    result = hybrid.static(hybrid.validate_scene(tables))
    z = result.position[0, :, 2]
    ball = np.linalg.norm(result.position[0] - [0, 0, -9.9], axis=1) - 10.0
    assert z.min() > 0.01 - 0.05 * 0.02
    assert ball.min() > 0.01 - 0.05 * 0.02
    held = float(result.reaction_start[0, 2])
    assert 0.0 < held < 0.5 * 0.2 * 9.81 * 2.0


def test_an_equilibrium_within_an_obstacle_is_refused() -> None:
    """A line between two points on both sides of a wall that it cannot go round."""
    tables = over_pipe(obstacles={"wall": {"kind": "sphere", "at": [5, 0, 1.5], "radius": 4.5}})
    del tables["time"]
    tables["cable"]["sections"][0]["length"] = 10.5
    with pytest.raises(hybrid.ComputationError):
        hybrid.static(hybrid.validate_scene(tables))


@pytest.mark.parametrize(("cells", "said"), [(31, True), (120, False)])
def test_a_thin_pipe_that_may_pass_between_nodes_is_said(cells: int, said: bool) -> None:
    """It goes through 31 cells of 0.32 m untouched, at a node in none of 16 outputs; 120 cells of 0.08 m stop it."""
    cable = {"length": 10.02, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 1.0}
    travel = {"travel": {"by": [0, 0, -1.0], "over": 1.0}}
    result = ran(cable_scene(
        cable | {"damping": {"mass": 0.5}}, pinned_at(0, 0, 0), pinned_at(10, 0, 0),
        obstacles={"p": {"kind": "cylinder", "at": [5.0, 0, 0.3], "axis": [0, 1, 0], "radius": 0.05, "motion": travel}},
        model="rod", mesh=cells, time=(1.5, 0.01), output=0.1
    ))  # fmt: skip
    assert (result.position[-1, :, 2].min() > -0.7) == said  # it is in the way of the line, or above it
    found = [x for x in result.events if x.kind == "unresolved contact"]
    assert bool(found) == said
    assert all("cells of 0.12 m would meet it" in x.text for x in found)


@pytest.mark.parametrize("several", [False, True], ids=["cable", "lines"])
@pytest.mark.parametrize("z", [0.0, 0.15])  # along the axis of the pipe, where its normal is not known, and within it
def test_a_start_in_an_obstacle_is_refused(several: bool, z: float) -> None:
    section = {"length": 2.0, "mass": 0.3, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02}
    straight = {"kind": "straight", "direction": [1, 0, 0]}
    common: dict[str, Any] = {
        "obstacles": {"pipe": {"kind": "cylinder", "at": [0, 0, 0], "axis": [1, 0, 0], "radius": 0.2}},
        "time": {"duration": 0.1, "step": 0.01},
    }
    line = {"sections": [section], "model": "rod", "mesh": {"cells": 20}}
    if several:
        points = {"a": {"initial_guess": [-1, 0, z]}, "b": {"initial_guess": [1, 0, z]}}
        scene = common | {"points": points, "lines": {"l": line | {"start": "a", "end": "b", "initial": straight}}}
    else:
        scene = (
            common | cable_scene(line.pop("sections"), "free", "free", initial=straight | {"origin": [-1, 0, z]}) | line
        )
    with pytest.raises(SceneError, match=r"outside of obstacles\.pipe" if several else "in obstacle pipe"):
        hybrid.run(scene)
