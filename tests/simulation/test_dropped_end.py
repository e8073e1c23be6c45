"""Intermittent contact of ends with a fixed plane, a deck or the bed: against motion in closed form, and to rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

LENGTH, MASS, STIFFNESS, HEIGHT, GRAVITY = 6.0, 4.0, 5e4, 0.4, 9.81  # m, kg/m, N/m per m, m, m/s2


def bouncing(t: np.ndarray) -> np.ndarray:
    """Height (m) above the plane of what falls from HEIGHT at rest on a spring that gives everything back."""
    fall, speed = np.sqrt(2.0 * HEIGHT / GRAVITY), np.sqrt(2.0 * GRAVITY * HEIGHT)
    w, sunk = np.sqrt(STIFFNESS / MASS), GRAVITY * MASS / STIFFNESS
    contact = 2.0 * (np.pi - np.arctan(speed / (w * sunk))) / w  # s, from touching to leaving
    t = (np.asarray(t) + fall) % (2.0 * fall + contact) - fall  # t = 0: at the top
    in_contact = t - fall
    depth = sunk * (np.cos(w * in_contact) - 1.0) - speed / w * np.sin(w * in_contact)
    return np.where(t <= fall, HEIGHT - 0.5 * GRAVITY * t * t, depth)


def scene(**tables: Any) -> dict[str, Any]:
    section = {"length": LENGTH, "mass": MASS, "axial_stiffness": 1e6, "bending_stiffness": 80.0, "diameter": 0.05}
    return cable_scene(
        section | {"torsional_stiffness": 60.0}, "free", "free", seabed={"z": 2.0, "stiffness": STIFFNESS},
        initial={"kind": "straight", "direction": [1, 0, 0], "origin": [0, 0, 2.0 + HEIGHT]}, model="rod", mesh=12,
        time=(1.9, 5e-4), output=0.01
    ) | tables  # fmt: skip


@pytest.mark.parametrize("step", [1e-3, 5e-4])
def test_a_line_that_falls_flat_on_a_deck_bounces_as_a_mass_on_a_spring(step: float) -> None:
    """Three bounces without damping: the ends as all other points; the error is that of the time at which it touches."""
    result = hybrid.run(scene(time={"duration": 1.9, "step": step, "rho_inf": 1.0}))
    height = result.position[:, :, 2] - 2.0
    expected = bouncing(result.times)
    assert (expected < 0.0).any() and (np.diff(np.sign(expected)) != 0).sum() >= 6
    off = np.abs(height - expected[:, None]).max()
    print(f"step {step:g} s: {off:.2e} m off")
    assert off < 0.005 * HEIGHT
    assert np.ptp(height, axis=1).max() < 1e-6 * HEIGHT  # ends as the middle


def test_an_end_that_is_released_over_a_deck_comes_to_rest_on_it() -> None:
    damped = {"z": 0.0, "stiffness": 1e5, "damping": 2e3, "friction": 0.4}
    section = {"length": 20.0, "diameter": 0.05, "mass": 5.0, "axial_stiffness": 1e6, "bending_stiffness": 50.0,
               "torsional_stiffness": 40.0, "damping": {"stiffness": 0.02, "mass": 0.3}}  # fmt: skip
    result = hybrid.run(scene(
        cable={"sections": [section]}, environment={"seabed": damped}, initial="equilibrium", mesh={"cells": 40},
        ends={"start": pinned_at(0, 0, 8), "end": pinned_at(12, 0, 3, release_at={"time": 0.5})},
        time={"duration": 20.0, "step": 0.01}, output={"every": 0.05}
    ))  # fmt: skip
    assert "end released" in {e.kind for e in result.events}
    height = result.position[:, -1, 2]
    touched = np.flatnonzero(height < 0.0)
    assert height[0] == pytest.approx(3.0) and touched.size and result.times[touched[0]] > 0.8
    assert height.min() > -0.1  # it does not go through
    assert -2e-3 < height[-1] < 1e-3 and np.abs(result.velocity[-1]).max() < 0.05
    carried = result.reaction_start[-1, 2]  # what is not on the deck hangs at the start
    lifted = result.position[-1, :, 2] > 0.0
    assert carried == pytest.approx(5.0 * 9.81 * 20.0 * lifted.mean(), rel=0.1)
