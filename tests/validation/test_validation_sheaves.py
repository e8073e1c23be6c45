"""Sheaves that turn freely beside lines that touch themselves, and under several lines.

Two ropes over one sheave by a closed form, what is kept in free flight, equivalences, and how Newton's method converges.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.kernels.state.report import SPIN
from tests.scenes import network_scene
from tests.validation.obstacle_scenes import CENTRELINE, DRUM, STRAND
from tests.validation.test_validation_moving_obstacles import weights
from tests.validation.thrown_lines import WIDTH, straight, throw

Tables = dict[str, Any]

# --- a rope whose legs touch below its sheave -----------------------------------------------------------


def crossed_legs(inertia: float, held: bool = True) -> Tables:
    """Legs cross below the sheave and are pressed on each other; one end is held, or pulled less than the other."""
    tables = weights(inertia)
    R, y, down, lean = CENTRELINE + 5e-5, 0.015, 1.4, 0.3
    over = [[R * np.cos(x), 0.0, R * np.sin(x)] for x in np.linspace(np.pi + lean, -lean, 129)]
    across, below = over[-1][0] - down * np.sin(lean), over[-1][2] - down * np.cos(lean)
    points = [[-across, y, below], *over, [across, -y, below]]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    section = tables["cable"]["sections"][0]
    section |= {"length": length, "bending_stiffness": 2e-3, "torsional_stiffness": 0.1}
    pulls = []
    for x in (0, -1):
        way = np.subtract(points[x], points[1 if x == 0 else -2])
        pulls.append(10.0 * way / np.linalg.norm(way) - [0.0, np.sign(points[x][1]), 0.0])
    light, heavy = pulls[0].tolist(), pulls[1].tolist()
    tables["ends"] = {
        "start": {"kind": "free", "force": {"history": [[0, 0, 0, 0], [0.2, *light]]}},
        "end": {"kind": "free", "force": {"history": [[0, 0, 0, 0], [0.2, *heavy], [0.3, *heavy],
                                                      [0.5, *(1.4 * pulls[1]).tolist()]]}},
    }  # fmt: skip
    if held:
        tables["ends"]["start"] = {"kind": "pinned", "position": points[0]}
    tables["initial"], tables["contact"] = {"kind": "points", "points": points}, {"self": True, "friction": 0.2}
    return tables | {"time": {"duration": 0.5, "step": 0.002}, "output": {"every": 0.01, "points": 101}}


@pytest.fixture(scope="module")
def pulled() -> Any:
    return hybrid.run(crossed_legs(0.02, held=False))


def test_legs_that_touch_turn_a_sheave(pulled: Any) -> None:
    """It has the energy that the rope has given, and energy is booked to a hundredth of what is put in."""
    assert pulled["self_contact"][-1].max() > 10.0
    turn = np.radians(pulled["obstacles/drum/rotation"][:, 1])
    assert turn[-1] > 0.1
    rate = np.gradient(turn, pulled.times)
    assert pulled["work/obstacles"][-2] == pytest.approx(-0.01 * rate[-2] ** 2, rel=0.01)
    assert np.abs(pulled["work/scheme"]).max() < 0.01 * pulled["work/applied"][-1]


@pytest.mark.long
def test_a_very_heavy_sheave_is_a_drum_that_stands() -> None:
    tables = crossed_legs(1e12)
    heavy = hybrid.run(tables)
    del tables["obstacles"]["drum"]["bearing"]
    still = hybrid.run(tables)
    assert still["self_contact"].max() > 10.0
    np.testing.assert_allclose(heavy.position, still.position, atol=1e-6)
    np.testing.assert_allclose(heavy["self_contact"], still["self_contact"], atol=1e-4 * still["self_contact"].max())
    light = hybrid.run(crossed_legs(0.02))
    print(f"\niterations: over a drum {still.steps.iterations.sum()}, a sheave {light.steps.iterations.sum()}")
    assert light.steps.iterations.sum() < 1.05 * still.steps.iterations.sum()  # derivatives are as exact


# --- two ropes over one sheave --------------------------------------------------------------------------

ROPES = {"left": (0.1, 14.0), "right": (-0.1, 12.0)}  # place along the axis, m; pull at the heavier end, N
WEIGHT, INERTIA = 0.3, 0.05


def two_ropes(apart: float = 0.1, **more: Any) -> Tables:
    """As `weights`, of two ropes with weights at their ends, which are pulled by 10 N, then one of each by more."""
    one = weights(INERTIA)
    section, over = one["cable"]["sections"][0], one["initial"]["points"]
    tables: Tables = network_scene(
        {}, {}, gravity=0, obstacles=one["obstacles"], bodies={}, time=(0.9, 0.002), output=one["output"]
    )
    for name, (side, pull) in ROPES.items():
        points = [[x, np.sign(side) * apart, z] for x, _, z in over]
        for end, at, most in (("start", points[0], 10.0), ("end", points[-1], pull)):
            force = [[0, 0, 0, 0], [0.2, 0, 0, -10], [0.3, 0, 0, -10], [0.5, 0, 0, -most]]
            tables["points"][f"{name} {end}"] = {"body": f"{name} {end}", "place": [0, 0, 0]}
            tables["bodies"][f"{name} {end}"] = {
                "initial_guess": at, "mass": WEIGHT, "inertia": [1e-3] * 3, "force": {"history": force},
                "shape": {"kind": "sphere", "radius": 0.005, "stiffness": 2e4},
            }  # fmt: skip
        tables["lines"][name] = {
            "start": f"{name} start", "end": f"{name} end", "sections": [section], "model": "rod",
            "mesh": one["mesh"], "contact": {"self": False}, "initial": {"kind": "points", "points": points},
        }  # fmt: skip
    tables["obstacles"]["drum"]["stiffness"] = 2e4
    return tables | more


def accelerations(result: Any) -> list[float]:
    late = result.times > 0.6
    return [float(np.polyfit(result.times[late], -result.lines[x].velocity[late, -1, 2], 1)[0]) for x in result.lines]


@pytest.fixture(scope="module")
def rolled() -> Any:
    return hybrid.run(two_ropes())


@pytest.mark.long
def test_two_ropes_turn_one_sheave_by_what_both_are_pulled(rolled: Any) -> None:
    """a = (sum of differences of pulls)/(all masses + I/rho^2), of both: the sheave passes on what one gives."""
    length = sum(x.s[-1] for x in rolled.lines.values())
    expected = (4.0 + 2.0) / (0.1 * length + 4 * WEIGHT + INERTIA / CENTRELINE**2)
    for found in accelerations(rolled):
        assert found == pytest.approx(expected, rel=3e-3)
    given = sum(x["work/obstacles"][-1] for x in rolled.lines.values())
    rate = float(rolled.lines["left"].velocity[-1, -1, 2]) / CENTRELINE
    assert given == pytest.approx(-0.5 * INERTIA * rate**2, rel=0.01)
    left, right = (x["obstacles/drum/rotation"] for x in rolled.lines.values())
    np.testing.assert_array_equal(left, right)


@pytest.mark.long
def test_ropes_that_lie_against_each_other_turn_it_the_same(rolled: Any) -> None:
    """Side by side on the sheave, within the reach of their contact."""
    beside = hybrid.run(two_ropes(0.99 * STRAND, contact={"friction": 0.2}))
    assert all(x["self_contact"].max() > 0.0 for x in beside.lines.values())
    np.testing.assert_allclose(accelerations(beside), accelerations(rolled), rtol=2e-3)


# --- free flight ----------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_lines_thrown_at_two_sheaves_and_each_other_keep_angular_momentum(friction: float) -> None:
    """About the axis, which both sheaves have in common: what the lines lose the sheaves have, to 1e-6."""
    drum = {
        "kind": "cylinder",
        "axis": [0, 1, 0],
        "radius": DRUM,
        "friction": friction,
        "stiffness": 1e4,
        "length": 0.4,
    }
    sheaves = {
        "one": drum | {"at": [0, 0.25, -0.33], "bearing": {"inertia": 2e-3}},
        "two": drum | {"at": [0, -0.25, -0.33], "bearing": {"inertia": 5e-3}},
    }  # fmt: skip
    lower = straight(1.0, np.array([0.1, 0.0, 0.0]), np.array([0.4, 1.0, 0.0]), 40)
    upper = straight(1.0, np.array([0.13, 0.05, 2.0 * WIDTH]), np.array([1.0, 0.3, 0.0]), 40)
    found = throw(
        [lower, upper], [np.zeros_like(lower) - [1.0, 0.0, 2.0], np.zeros_like(upper) - [1.0, 0.0, 6.0]],
        2.5e-5, 0.025, friction, obstacles=sheaves,
    )  # fmt: skip
    spins = found.states.lines[0].sheave[:, SPIN]
    assert found.shared.met() and (np.abs(spins) > 0.05).all()
    about = found.turning + np.cross([0.0, 0.0, 0.33], found.momentum)
    kept = np.diff(about[:, 1])[0] + np.array([2e-3, 5e-3]) @ spins
    assert abs(kept) < 1e-6 * found.size
    assert max(found.energies) < 1.001 * found.energies[0]
