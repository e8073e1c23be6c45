"""Free bodies with a shape beside lines that touch each other and themselves: both solves of contact in one.

Heavy bodies against obstacles, momentum of what flies freely, rest, equivalences, and how Newton's method converges.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import PLACE, V, W
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.report import STIFFNESS
from hybrid.model.network import build_network
from hybrid.scene.bodies import FreeBody
from hybrid.simulation.equilibrium import joined_lines
from hybrid.simulation.lines_contact import shared_of
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import NetworkState
from tests.scenes import each_line, line_between, network_scene, system_of
from tests.validation.test_validation_body_contact import MASS, on_two_lines, pushed, turns_with_its_scene
from tests.validation.thrown_lines import WIDTH, straight, throw

Tables = dict[str, Any]


def crossed(**shape: Any) -> Tables:
    """The ball falls on two lines that cross below it, a little apart, and presses the upper one on the lower."""
    tables = pushed(**shape)
    for side, y, z in (("left", 0.2, 0.012), ("right", -0.2, -0.012)):
        length = float(np.hypot(10.0, 2.0 * y))
        tables["points"][f"0{side}"]["position"] = [0, y, z]
        tables["points"][f"10{side}"]["position"] = [10, -y, z]
        line = tables["lines"][side]
        line["initial"] = {"kind": "straight", "direction": [10.0 / length, -2.0 * y / length, 0]}
        line["sections"] = [line["sections"][0] | {"length": length}]
        del line["contact"]
    tables["bodies"]["ball"]["initial_guess"] = [4.8, 0.02, 0.66]
    return tables | {"contact": {"friction": 0.3}, "time": {"duration": 0.3, "step": 0.005}}


@pytest.fixture(scope="module")
def fallen() -> Any:
    return hybrid.run(crossed())


def test_a_ball_presses_lines_on_each_other(fallen: Any) -> None:
    """It touches both, and they touch; what lines do to it is what it does to them, by force and by work."""
    assert any(x.kind == "lines touch" for x in fallen.events)
    assert not any(x.kind in ("deep in an obstacle", "gains energy") for x in fallen.events)
    for line in fallen.lines.values():
        assert np.linalg.norm(line["obstacles/ball/force"][-1]) > 20.0
        assert line["self_contact"][-1].max() > 20.0
    force = sum(x["obstacles/ball/force"] for x in fallen.lines.values())
    np.testing.assert_allclose(force, fallen["bodies/ball/force"], atol=1e-3 * np.abs(force).max())
    done = fallen["bodies/ball/work/lines"]
    by_lines = sum(x["work/obstacles"] for x in fallen.lines.values())
    np.testing.assert_allclose(done, -by_lines, atol=0.02 * np.abs(done).max())


def test_a_turned_scene_moves_the_same(fallen: Any) -> None:
    turns_with_its_scene(crossed(), fallen, 1e-7)


def test_legs_of_a_line_cross_below_the_body_that_it_hangs_over() -> None:
    """A line that touches itself alone: over a heavy body as over the obstacle there."""
    section = {"length": 1.6, "mass": 0.2, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 2e-3,
               "damping": {"mass": 0.5}}  # fmt: skip
    pin = {"kind": "cylinder", "axis": [0, 1, 0], "length": 0.5, "radius": 0.03, "friction": 0.2, "stiffness": 2e4}
    legs = [[-0.6, -0.03, -0.55], [-0.03, 0, 0.04], [0.03, 0, 0.04], [0.6, 0.03, -0.55]]
    length = float(np.linalg.norm(np.diff(legs, axis=0), axis=1).sum())
    across = {"a": [0.65, 0.015, -0.2], "b": [-0.65, -0.015, -0.2]}
    ends = {name: {"position": at, "motion": {"travel": {"by": across[name], "over": 0.4}}}
            for name, at in (("a", legs[0]), ("b", legs[3]))}  # fmt: skip
    tables: Tables = network_scene(
        ends,
        {"rope": line_between("a", "b", section | {"length": length}, model="rod", contact={"friction": 0.2},
                              initial={"kind": "points", "points": legs}, mesh=60)},
        bodies={"pin": {"initial_guess": [0, 0, 0], "mass": 1e12, "inertia": [1e12, 1e12, 1e12], "shape": pin,
                        "force": [0, 0, 9.81e12]}},
        time=(0.5, 0.002), output=(0.05, 61)
    )  # fmt: skip
    by_body = hybrid.run(tables).lines["rope"]
    assert by_body["self_contact"].max() > 1.0 and np.abs(by_body["obstacles/pin/force"]).max() > 1.0
    del tables["bodies"]
    tables["obstacles"] = {"pin": pin | {"at": [0, 0, 0]}}
    np.testing.assert_allclose(by_body.position, hybrid.run(tables).lines["rope"].position, atol=1e-6)


def test_contact_that_does_not_come_about_changes_nothing() -> None:
    """Lines side by side, which may touch themselves and each other: the run of tests that have no such contact."""
    tables = pushed() | {"time": {"duration": 0.25, "step": 0.005}}
    bare = hybrid.run(tables)
    for contact in ({}, {"contact": {"friction": 0.2}}):
        result = hybrid.run(each_line(tables, contact={"self": True}) | contact)
        for side, x in bare.lines.items():
            assert np.linalg.norm(x["obstacles/ball/force"], axis=1).max() > 1.0
            np.testing.assert_allclose(result.lines[side].position, x.position, atol=1e-9)


# --- at rest ------------------------------------------------------------------------------------------


def cradle() -> Tables:
    """The ball on two taut lines, which lie on two others across them."""
    tables = on_two_lines()
    del tables["time"]
    for name, x in (("fore", 4.7), ("aft", 5.3)):
        for end, y in (("0", -5.0), ("10", 5.0)):
            tables["points"][f"{end}{name}"] = {"position": [x, y, -0.03]}
        tables["lines"][name] = tables["lines"]["left"] | {"start": f"0{name}", "end": f"10{name}"}
    return each_line(tables, mesh=60) | {"contact": {}}


@pytest.mark.long
def test_a_ball_rests_on_lines_that_lie_on_others() -> None:
    """From the scene alone; all pins together bear what weighs, and an obstacle there holds the lines the same."""
    tables = cradle()
    rest = hybrid.static(tables)
    pins = sum(x.reaction_start[-1] + x.reaction_end[-1] for x in rest.lines.values())
    weight = (MASS + 4 * 9.9 * 0.05) * 9.81
    np.testing.assert_allclose(pins, [0, 0, weight], atol=1e-5 * weight)
    for line in rest.lines.values():
        assert line["self_contact"][-1].max() > 20.0
    for name in ("fore", "aft"):
        assert not rest.lines[name]["obstacles/ball/force"].any()
    stiffness = float(build_network(system_of(tables)).models[0].sea.values.obstacles[0, STIFFNESS])
    at = rest["bodies/ball/position"][-1].tolist()
    del tables["bodies"]
    tables["obstacles"] = {"ball": {"kind": "sphere", "at": at, "radius": 0.6, "stiffness": stiffness}}
    held = hybrid.static(tables)
    for name, line in rest.lines.items():
        np.testing.assert_allclose(held.lines[name].position, line.position, atol=1e-8)


# --- free flight ----------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_line_thrown_at_another_and_a_ball_keeps_momentum(friction: float) -> None:
    """The upper line meets the lower, which meets the ball; momentum and angular momentum to 1e-6 of what they are."""
    body = FreeBody(
        initial_guess=(0.05, 0.02, -0.36), initial_rotation=(10, 20, 30), mass=0.3, inertia=(0.01, 0.012, 0.015),
        centre=(0.02, 0.01, -0.03), shape={"kind": "sphere", "radius": 0.3, "friction": friction, "stiffness": 1e4},
    )  # fmt: skip
    lower = straight(1.0, np.zeros(3), np.array([1.0, 0.2, 0.0]), 40)
    upper = straight(1.0, np.array([0.03, 0.05, 2.0 * WIDTH]), np.array([0.3, 1.0, 0.0]), 40)
    speeds = [np.zeros_like(lower) - [0.0, 0.0, 2.0], np.zeros_like(upper) - [0.0, 0.0, 6.0]]
    found = throw([lower, upper], speeds, 1e-4, 0.05, friction, body=body)
    ball = found.states.bodies[0]
    assert found.shared.met() and np.linalg.norm(ball[V : V + 3]) > 0.5
    assert np.abs(np.diff(found.momentum, axis=0)).max() < 1e-6 * 0.4 * 8.0
    assert np.abs(np.diff(found.turning, axis=0)).max() < 1e-6 * found.size
    assert max(found.energies) < 1.001 * found.energies[0]
    assert found.least > 0.8 * WIDTH


# --- Newton's method --------------------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [MASS, 0.2])
def test_newtons_method_converges_quadratically(mass: float) -> None:
    """A step of a spinning ball that presses lines on each other, with friction: what is missing of the shifts of all

    nodes falls by squares once contact is found, and in six iterations all is done.
    """
    tables = crossed()
    tables["bodies"]["ball"] |= {"mass": mass, "inertia": [0.15 * mass] * 3}
    model = build_network(system_of(tables))
    lines, found = joined_lines(model, 0.0), []
    for most in (3, 4, 5, 12):
        solver = NetworkSolver(lines, 0, model.body_numbers(0.0), shared=shared_of(model))
        books = [blank_books(x.line.h.size)._replace(touch=np.zeros((3, x.line.s.size))) for x in lines]
        for each in books:
            each.clock.shortest = np.inf
        solver.keep_books(books)
        start = NetworkState([x.start for x in model.models], model.body_places).copy()
        start.lines[0].r[:, 2] -= 0.0035  # to the edge of contact with the lower line, and 6 mm into the ball
        start.bodies[0, PLACE + 2] = 0.6125
        start.bodies[0, V + 2], start.bodies[0, W : W + 3] = -1.0, (1.0, -3.0, 2.0)
        for x in solver.lines:
            x.sea.now[0] = 0.002
        taken = solver.step(start, start.copy(), 0.002, 0.9, 0.0, 0.9, 0.002, most=most)
        found.append(np.concatenate([x.u for x in solver.work]))
    assert taken.outcome == Outcome.OK and taken.iterations <= 6
    assert solver.in_contact() and solver.presses_bodies
    missing = [float(np.abs(x - found[-1]).max()) for x in found[:-1]]
    print(f"\nmissing of shifts, m: {', '.join(f'{x:.2g}' for x in missing)}")
    assert missing[0] > 1e-7 and all(b < 200.0 * a**2 + 1e-13 for a, b in pairwise(missing))
