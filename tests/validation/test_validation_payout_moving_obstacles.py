"""Lines that a winch pays out, or takes in, over obstacles that move, turn, are set from outside or turn freely."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.combinations.pairs import seen_by, turned_and_mirrored
from tests.validation.obstacle_scenes import CENTRELINE, Tables, paid_over_drum
from tests.validation.test_validation_payout_obstacles import kick, pull, rests_as, slow

MU, ANGLE, PULL, RATE = 0.3, 2.0, 8.0, 0.1
WITH_IT = RATE / CENTRELINE  # 1/s, spin at which the drum runs as fast as line that is paid out at RATE


def over_turning(rate: float, spin: float, clear: float = 0.3, **more: Any) -> Tables:
    """Over a drum that turns, from when the winch begins; spin: 1/s, positive as a sheave that line is paid out over."""
    scene = paid_over_drum(MU, rate, clear, **more)
    scene["obstacles"]["drum"]["spin"] = {"rate": spin, "ramp": 0.4}
    return scene


def over_sheave(rate: float, inertia: float, damping: float, clear: float = 0.3, **more: Any) -> Tables:
    scene = paid_over_drum(0.5, rate, clear, **more)
    scene["obstacles"]["drum"]["bearing"] = {"inertia": inertia, "damping": damping}
    return scene


# --- drums that turn ------------------------------------------------------------------------------

# Rate (m/s), spin over that with which the drum is as fast as the line, clamped on the drum or pinned clear of it: the sign
# of the exponent, and how far it may be off.  What touches at a clamp on the drum presses there, too.
CASES = {
    (RATE, 2.0, False): (1.0, 0.01), (RATE, -2.0, False): (-1.0, 0.003), (-RATE, 2.0, False): (-1.0, 0.01),
    (-RATE, -2.0, False): (1.0, 0.003), (RATE, 2.0, True): (1.0, 0.04), (RATE, -2.0, True): (-1.0, 0.03),
}  # fmt: skip


@pytest.fixture(scope="module", params=CASES, ids=lambda x: f"{x[0]:g} m/s, {x[1]:g}, {'clamp' if x[2] else 'pin'}")
def turned(request: pytest.FixtureRequest) -> Any:
    rate, part, clamp = request.param
    spin = part * rate / CENTRELINE
    return hybrid.run(over_turning(rate, spin, 0.0 if clamp else 0.3, clamp=clamp)), request.param


def test_the_pull_is_that_of_a_capstan_by_the_way_against_the_drum(turned: Any) -> None:
    """T_winch = T e^(+-mu phi): a drum that turns faster than the line pulls that out, also on nodes that ride."""
    result, case = turned
    sign, off = CASES[case]
    assert np.log(pull(result)[-1] / PULL) / (MU * ANGLE) == pytest.approx(sign, abs=off)


def test_friction_takes_the_way_against_the_drum_and_the_drum_gives_its_own(turned: Any) -> None:
    """Friction: 0.28 m of line less the way of the drum, against both tensions; what the drum gives is moment times turn."""
    result, (rate, part, _) = turned
    apart = abs(pull(result)[-1] - PULL)
    assert result["work/friction"][-1] == pytest.approx(-0.28 * abs(1.0 - part) * apart, rel=0.04)
    moment = result["obstacles/drum/moment"][:, 1]
    spin = part * rate / CENTRELINE
    late = np.array(result.t) > 0.5
    power = np.gradient(result["work/obstacles"][late], np.array(result.t)[late])
    np.testing.assert_allclose(power, -moment[late] * spin, rtol=0.02)
    assert np.sign(result["work/obstacles"][-1]) == 1.0
    assert abs(result["work/scheme"][-1]) < 1e-4 * abs(result["work/end"][-1])


def test_a_node_that_enters_or_leaves_kicks_little(turned: Any) -> None:
    result, _ = turned
    assert 1e-5 < kick(result, pull(result)) < 4e-3


@pytest.mark.parametrize("clamp", [False, True])
def test_a_drum_that_runs_as_fast_as_the_line_has_no_work_of_friction(clamp: bool) -> None:
    """At rest against its surface nothing slides, on nodes that ride either: what is left is the elastic travel."""
    rests, against = (
        hybrid.run(over_turning(RATE, part * WITH_IT, 0.0 if clamp else 0.3, clamp=clamp)) for part in (1.0, -1.0)
    )
    assert against["work/friction"][-1] < -1.9
    assert abs(rests["work/friction"][-1]) < 2e-4 * abs(against["work/friction"][-1])
    assert -1.0 < np.log(pull(rests)[-1] / PULL) / (MU * ANGLE) < 0.0
    assert abs(rests["work/scheme"][-1]) < 1e-4 * abs(rests["work/end"][-1])


@pytest.mark.parametrize("clamp", [False, True])
def test_what_nodes_kick_that_come_onto_a_drum_as_fast_as_they_falls_with_the_mesh(clamp: bool) -> None:
    """A line that sticks keeps what a node brings: 0.7 % of the pull with cells of 30 mm (clamped 3 %), by their square."""
    found = []
    for h in (0.03, 0.015):
        result = hybrid.run(over_turning(RATE, WITH_IT, 0.0 if clamp else 0.3, clamp=clamp, h=h))
        found.append(kick(result, pull(result)))
    assert found[1] < 0.25 * found[0] and found[1] < 0.006


def test_a_winch_that_moves_along_with_its_drum_does_not_know_it() -> None:
    """Pull and exponent of a winch and a drum that travel together at 1 m/s, askew, are those of both at rest."""
    found = []
    for V in ([0.0, 0.0, 0.0], [0.5, 0.8, -0.3]):
        scene = paid_over_drum(MU, RATE, 0.0, clamp=True)
        scene["cable"]["sections"][0]["damping"] = {"stiffness": 1e-3}
        if any(V):
            motion = {"velocity": V, "ramp": 1.0}
            scene["ends"]["end"]["motion"], scene["obstacles"]["drum"]["motion"] = motion, motion
        found.append(hybrid.run(scene))
    still, moves = found
    np.testing.assert_allclose(pull(moves)[-5:], pull(still)[-5:], rtol=2e-3)
    assert abs(moves["work/scheme"][-1]) < 1e-3 * abs(moves["work/end"][-1])


# --- sheaves that turn freely ---------------------------------------------------------------------


@pytest.fixture(scope="module", params=[(RATE, 0.3), (-RATE, 0.3), (RATE, 0.0)], ids=str)
def rolled(request: pytest.FixtureRequest) -> Any:
    """Inertia 0.05 kg m2, bearing 0.5 N m s; the winch clear of the sheave, or on it, where nodes ride."""
    rate, clear = request.param
    return hybrid.run(over_sheave(rate, 0.05, 0.5, clear, clamp=clear == 0.0)), rate, clear


def angle_of(result: Any) -> Any:
    """Turn of the sheave about y, rad, counted on."""
    _, pitch, yaw = np.radians(result["obstacles/drum/rotation"]).T
    x, z = np.cos(yaw) * np.cos(pitch), -np.sin(pitch)  # of R e_x
    return np.unwrap(np.arctan2(-z, x))


def test_a_free_sheave_turns_by_what_passes(rolled: Any) -> None:
    result, _, _ = rolled
    way = result["payout/length"] - result["payout/length"][0]
    np.testing.assert_allclose(angle_of(result), way / CENTRELINE, atol=2e-3 * abs(way[-1]) / CENTRELINE)


def test_tensions_at_a_free_sheave_differ_by_its_inertia_and_its_bearing(rolled: Any) -> None:
    """(T2 - T1) R = I a + c w of the rate at which line passes, in the ramp too; friction takes nothing.

    The line itself is damped by its mass, 0.5 1/s.
    """
    result, _, clear = rolled
    t, c = np.array(result.t), result["payout/rate"]
    expected = 0.05 * np.gradient(c, t) / CENTRELINE + 0.5 * c / CENTRELINE
    np.testing.assert_allclose(
        -result["obstacles/drum/moment"][2:-1, 1], -expected[2:-1], atol=0.04 * abs(expected).max()
    )
    if clear:
        damped = 0.5 * 0.1 * c[-1] * result["payout/length"][-1]
        apart = (PULL - pull(result)[-6:].mean() - damped) * CENTRELINE  # over the time in which a node enters
        assert apart == pytest.approx(expected[-1], rel=5e-3)
    assert abs(result["work/friction"][-1]) < 1e-3 * abs(result["work/end"][-1])


def test_a_free_sheave_has_the_energy_that_the_line_has_given(rolled: Any) -> None:
    """I w^2/2, and c w^2 over time in the bearing."""
    result, _, _ = rolled
    t, w = np.array(result.t), result["payout/rate"] / CENTRELINE
    given = 0.5 * 0.05 * w[-1] ** 2 + np.trapezoid(0.5 * w**2, t)
    assert result["work/obstacles"][-1] == pytest.approx(-given, rel=5e-3)
    assert abs(result["work/scheme"][-1]) < 1e-4 * abs(result["work/end"][-1])
    assert 1e-6 < kick(result, pull(result)) < 4e-3


@pytest.mark.long
@pytest.mark.parametrize("rate", [0.1, -0.05])
def test_slow_payout_over_a_free_sheave_is_the_equilibrium_of_that_length_without_friction(rate: float) -> None:
    """At rest both legs pull alike, as on a smooth pipe."""
    scene = slow(12.0, "rod", rate)
    scene["obstacles"]["pipe"] |= {"friction": 0.4, "bearing": {"inertia": 0.5, "damping": 5.0}}
    scene["time"]["duration"] = 14.0
    result = hybrid.run(scene)
    rests_as(result, slow(float(result["payout/length"][-1]), "rod"), 1e-3, 2e-3)


def test_slow_payout_over_a_pipe_that_moves_is_the_equilibrium_where_it_ends() -> None:
    scene, by = slow(12.0, "rod", 0.1), [0.2, 0.1, 0.3]
    scene["obstacles"]["pipe"]["motion"] = {"travel": {"by": by, "over": 6.0}}
    result = hybrid.run(scene)
    there = slow(float(result["payout/length"][-1]), "rod")
    there["obstacles"]["pipe"]["at"] = np.add(there["obstacles"]["pipe"]["at"], by).tolist()
    rests_as(result, there, 3e-4, 3e-4)


# --- the same said otherwise ----------------------------------------------------------------------


def shortly(kind: str, winch: str = "end") -> Tables:
    """Clamped on a drum that turns and travels, or on a free sheave."""
    time: Tables = {"duration": 2.0, "step": 0.01}
    if kind == "sheave":
        scene = over_sheave(RATE, 0.05, 0.5, 0.0, clamp=True, winch=winch, time=time)
    else:
        scene = over_turning(RATE, 0.5 * WITH_IT, 0.0, clamp=True, winch=winch, time=time)
        scene["obstacles"]["drum"]["motion"] = {"travel": {"by": [-0.01, 0.02, -0.01], "over": 1.5}}
    scene["ends"][winch]["payout"]["longest"] = 2.5
    return scene


@pytest.mark.parametrize("kind", ["turns", "sheave"])
def test_a_scene_turned_and_mirrored_whose_winch_is_at_the_start_has_the_same_answer(kind: str) -> None:
    M = turned_and_mirrored()
    one, two = hybrid.run(shortly(kind)), hybrid.run(seen_by(M, shortly(kind, "start")))
    assert np.abs(two.position[:, ::-1] - one.position @ M.T).max() < 1e-8
    np.testing.assert_allclose(two.tension[:, ::-1], one.tension, rtol=1e-6)
    np.testing.assert_allclose(pull(two, "start"), pull(one), rtol=1e-6)
    for name, other in (("work/friction",) * 2, ("work/obstacles",) * 2, ("work/end", "work/start")):
        assert np.abs(two[other] - one[name]).max() < 1e-6 * np.abs(one["work/end"]).max(), name


def test_a_drum_that_is_set_from_outside_turns_as_by_a_spin() -> None:
    scene = over_turning(RATE, 2.0 * WITH_IT, 0.0, clamp=True, time={"duration": 1.5, "step": 0.01})
    one = hybrid.run(scene)
    scene["obstacles"]["drum"] = {x: y for x, y in scene["obstacles"]["drum"].items() if x != "spin"}
    scene["obstacles"]["drum"]["from_outside"] = True
    with hybrid.Simulation(scene) as simulation:
        for k in range(150):
            t = 0.01 * (k + 1)
            x = min(t / 0.4, 1.0)
            grown = 0.4 * (x**6 - 3.0 * x**5 + 2.5 * x**4) if x < 1.0 else t - 0.2  # of 10 x^3 - 15 x^4 + 6 x^5
            c, s = np.cos(2.0 * WITH_IT * grown), np.sin(2.0 * WITH_IT * grown)
            simulation.set_obstacle("drum", rotation=np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))
            simulation.advance(t)
        two = simulation.result()
    np.testing.assert_allclose(pull(two)[-1], pull(one)[-1], rtol=2e-4)
    assert two["work/friction"][-1] == pytest.approx(one["work/friction"][-1], rel=2e-3)
    assert two["work/obstacles"][-1] == pytest.approx(one["work/obstacles"][-1], rel=2e-3)
