"""Moves of an end that are no single harmonic: lists, steady travel, moves, waves followed, leaps in a record."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scene_texts import OCEAN, change, complaints

from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Harmonic, Motion, Travel, smooth_step, way_of_smooth_step

Array = NDArray[np.float64]

PLACE = np.array([10.0, -2.0, 3.0])
SWELL = Harmonic(amplitude=1.0, period=9.0, phase=20.0)
CHOP = Harmonic(amplitude=0.3, period=4.0, phase=-70.0)

# A wave of 1.2 m amplitude and 60 m length that travels along (0.8, 0.6) and grows over 12 s.
K, W, A, RAMP = 2 * math.pi / 60.0, 1.0, 1.2, 12.0


def sea(x: float, y: float, t: float) -> tuple[float, float, float, float]:
    """Elevation, its rate at a place that stands, and its slopes."""
    grown, rate = smooth_step(t / RAMP)
    angle = K * (0.8 * x + 0.6 * y) - W * t + 0.4
    eta, down = grown * A * math.cos(angle), grown * A * math.sin(angle)
    return eta, A * rate / RAMP * math.cos(angle) + W * down, -0.8 * K * down, -0.6 * K * down


MOTIONS = {
    "a list": Motion(heave=(SWELL, CHOP), sway=SWELL, ramp=10.0),
    "velocity": Motion(velocity=(0.5, -0.3, 0.1), ramp=10.0),
    "travel": Motion(travel=Travel(by=(20.0, 5.0, -3.0), over=10.0, begin=4.0)),
    "waves": Motion(follow="waves"),
    "everything": Motion(
        surge=(SWELL, CHOP),
        velocity=(0.5, -0.3, 0.1),
        travel=Travel(by=(20.0, 5.0, -3.0), over=10.0, begin=4.0),
        follow="waves",
        ramp=10.0,
    ),
}


def derivative(f: Callable[[float], Array], t: float, h: float = 1e-3) -> Array:
    """Sixth-order central difference: error h^6 f''' / 140 and round-off eps / h, both below 1e-11 here."""
    w = {1: 45.0, 2: -9.0, 3: 1.0}
    return np.asarray(sum(c * (f(t + k * h) - f(t - k * h)) for k, c in w.items()) / (60.0 * h))


@pytest.mark.parametrize("name", MOTIONS)
def test_velocity_is_the_derivative_of_position(name: str) -> None:
    """Discretisation of the difference: 1e-9 m/s."""
    motion = EndMotion(MOTIONS[name], PLACE, elevation=sea)
    assert motion.moving
    for t in (0.7, 3.3, 4.6, 7.0, 9.5, 11.7, 13.8, 20.0, 47.3):
        np.testing.assert_allclose(motion.at_time(t)[1], derivative(lambda u: motion.at_time(u)[0], t), atol=1e-9)


@pytest.mark.parametrize("name", MOTIONS)
def test_everything_starts_from_rest_where_it_is_held(name: str) -> None:
    position, velocity, _, spin = EndMotion(MOTIONS[name], PLACE, elevation=sea).at_time(0.0)
    np.testing.assert_allclose(position, PLACE, atol=1e-14)
    assert np.abs(velocity).max() < 1e-12 and not spin.any()


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("t", [0.0, 4.0, 10.0, 12.0, 14.0])
def test_acceleration_is_continuous_where_something_begins_or_ends(name: str, t: float) -> None:
    """One-sided accelerations differ by O(h): they halve with h, or are round-off."""
    motion = EndMotion(MOTIONS[name], PLACE, elevation=sea)

    def jump(h: float) -> float:
        left = (motion.at_time(t)[1] - motion.at_time(t - h)[1]) / h
        right = (motion.at_time(t + h)[1] - motion.at_time(t)[1]) / h
        return float(np.abs(right - left).max())

    assert jump(1e-3) < 2e-2
    assert jump(1e-3) <= 0.6 * jump(2e-3) + 1e-9


def test_harmonics_of_a_list_add_up() -> None:
    both = EndMotion(Motion(heave=[SWELL, CHOP], ramp=10.0), PLACE)
    one, other = (EndMotion(Motion(heave=h, ramp=10.0), PLACE) for h in (SWELL, CHOP))
    for t in (3.0, 25.0):
        for k in (0, 1):
            rest = PLACE if k == 0 else 0.0
            np.testing.assert_allclose(both.at_time(t)[k], one.at_time(t)[k] + other.at_time(t)[k] - rest, atol=1e-14)
    assert Motion(heave=SWELL, yaw=[CHOP]).harmonics() == {"heave": (SWELL,), "yaw": (CHOP,)}


def test_turns_of_a_list_add_up() -> None:
    frame = np.eye(3)
    two = EndMotion(
        Motion(yaw=[Harmonic(amplitude=10, period=8), Harmonic(amplitude=20, period=8)], ramp=10.0), None, frame
    )
    one = EndMotion(Motion(yaw=Harmonic(amplitude=30, period=8), ramp=10.0), None, frame)
    np.testing.assert_allclose(two.at_time(23.0)[2], one.at_time(23.0)[2], atol=1e-14)
    np.testing.assert_allclose(two.at_time(23.0)[3], one.at_time(23.0)[3], atol=1e-14)


def test_steady_travel_reaches_its_velocity_and_lags_by_half_the_ramp() -> None:
    motion = EndMotion(Motion(velocity=(2.0, 0.0, -1.0), ramp=10.0), PLACE)
    np.testing.assert_allclose(motion.at_time(30.0)[1], (2.0, 0.0, -1.0), atol=1e-14)
    np.testing.assert_allclose(motion.at_time(30.0)[0] - PLACE, 25.0 * np.array([2.0, 0.0, -1.0]), atol=1e-12)
    np.testing.assert_allclose(motion.at_time(5.0)[1], (1.0, 0.0, -0.5), atol=1e-14)


def test_a_travel_arrives_and_stays() -> None:
    motion = EndMotion(MOTIONS["travel"], PLACE)
    for t in (0.0, 3.9, 4.0):
        np.testing.assert_array_equal(motion.at_time(t)[0], PLACE)
    np.testing.assert_allclose(motion.at_time(9.0)[0] - PLACE, (10.0, 2.5, -1.5), atol=1e-14)
    for t in (14.0, 1e6):
        np.testing.assert_allclose(motion.at_time(t)[0] - PLACE, (20.0, 5.0, -3.0), atol=1e-14)
        assert not motion.at_time(t)[1].any()


def test_the_smooth_step_is_the_derivative_of_its_way() -> None:
    for x in (-1.0, 0.2, 0.5, 0.9, 3.0):
        slope = derivative(lambda u: np.array(way_of_smooth_step(u)), x)
        assert smooth_step(x)[0] == pytest.approx(float(slope), abs=1e-12)
        assert smooth_step(x)[1] == pytest.approx(
            float(derivative(lambda u: np.array(smooth_step(u)[0]), x)), abs=1e-11
        )
    assert way_of_smooth_step(1.0) == 0.5 and way_of_smooth_step(4.0) == 3.5


def test_an_end_that_follows_waves_needs_them() -> None:
    with pytest.raises(ValueError, match="elevation"):
        EndMotion(MOTIONS["waves"], PLACE)
    position, velocity, *_ = EndMotion(MOTIONS["waves"], PLACE, elevation=sea).at_time(30.0)
    eta, rate, *_ = sea(10.0, -2.0, 30.0)
    np.testing.assert_array_equal(position, PLACE + np.array([0.0, 0.0, eta]))
    np.testing.assert_array_equal(velocity, (0.0, 0.0, rate))


def test_nothing_moves_without_a_way() -> None:
    assert not EndMotion(Motion(velocity=(0.0, 0.0, 0.0)), PLACE).moving
    assert EndMotion(Motion(follow="waves"), PLACE, elevation=sea).moving


# --- a record that leaps -----------------------------------------------------------------------

HEAVE = "{heave: {amplitude: 2.0, period: 8.0}, ramp: 16.0}"


@pytest.mark.parametrize("back", [False, True], ids=["for good", "and back"])
@pytest.mark.parametrize("row", [1, 2, 60, 197, 198, 199, 200])
@pytest.mark.parametrize("swell", [0.0, 2.0])
def test_a_leap_of_20_m_between_two_samples_is_refused(tmp_path: Path, swell: float, row: int, back: bool) -> None:
    """Wherever it is, also in the first and in the last rows of the record."""
    t = np.arange(0.0, 100.1, 0.5)
    z = np.array([swell * smooth_step(u / 16.0)[0] * math.sin(2 * math.pi * u / 8.0) for u in t])
    table = np.column_stack([t, 205.0 + 0.0 * t, 0.0 * t, z])
    name = tmp_path / "fairlead.csv"
    text = change(OCEAN, HEAVE, f"{{file: {name}}}")

    def said(rows: Array) -> list[str]:
        np.savetxt(name, rows, delimiter=",", header="t,x,y,z", comments="", fmt="%.6g")
        return [f"{c.where}: {c.value}" for c in complaints(text)]

    assert said(table) == []
    table[row : row + 1 if back else None, 3] += 20.0
    (complaint,) = said(table)
    assert complaint.startswith("ends.end.motion.file: fairlead.csv, whose velocity jumps by") or row <= 2
    assert "jumps by" in complaint or "starts with" in complaint
