"""What a linear response says that it leaves out, against closed forms and a run in time."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.modal import left_out

EA, LENGTH, T0 = 1e6, 50.0, 2e4
COUNT = 13
PERIODS = 32.0 * 10.0 / np.arange(20.0, 20.0 + COUNT)  # s, of which 320 s are a whole number


@pytest.fixture(autouse=True)
def many_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that what is found hardly scatters with the phases."""
    monkeypatch.setattr(left_out, "PARTS", 60)


def harmonics(amplitude: float, seed: int) -> list[dict[str, float]]:
    phases = np.random.default_rng(seed).uniform(0.0, 360.0, COUNT)
    return [{"amplitude": amplitude, "period": p, "phase": x} for p, x in zip(PERIODS.tolist(), phases, strict=True)]


def moved(t: np.ndarray, given: list[dict[str, float]]) -> np.ndarray:
    return sum(x["amplitude"] * np.sin(2.0 * np.pi * t / x["period"] + np.radians(x["phase"])) for x in given)


def test_the_stretch_by_swinging() -> None:
    """A light bar that is turned and stretched: EA (a/L + b^2/2L^2) for ends that move by a along and b across."""
    along, across = harmonics(0.002, 1), harmonics(0.3, 2)
    motion = {"surge": along, "sway": across, "ramp": 60.0}
    scene = {
        "environment": {"gravity": 0},
        "cable": {"sections": [{"length": LENGTH / (1.0 + T0 / EA), "mass": 1e-3, "axial_stiffness": EA}]},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, 0]},
            "end": {"kind": "pinned", "position": [LENGTH, 0, 0], "motion": motion},
        },
        "initial": "equilibrium",
        "model": "catenary",
        "mesh": {"cells": 8},
    }
    found = hybrid.response(scene).lines["cable"]
    t = np.linspace(0.0, 320.0, 20_001)[:-1]
    a, b = moved(t, along), moved(t, across)
    linear, square = (a / LENGTH).std(), (b**2 / (2.0 * LENGTH**2)).std()
    assert found.deviation("tension").max() == pytest.approx(EA * (1.0 + T0 / EA) * linear, rel=0.02)
    part = np.sqrt(1.0 + (square / linear) ** 2) - 1.0
    assert 0.05 < part < 1.0
    assert found.left_out["tension"] == pytest.approx(part, rel=0.1)


@pytest.mark.parametrize(
    ("waves", "part", "bound"),
    [
        ({"kind": "regular", "height": 0.5, "period": 12.0}, np.sqrt(3.0 / 8.0) / (8.0 / (3.0 * np.pi) / np.sqrt(2.0)) - 1.0, 0.02),
        ({"kind": "jonswap", "significant_height": 0.5, "peak_period": 14.0}, np.sqrt(3.0 * np.pi / 8.0) - 1.0, 0.25),
    ],
    ids=["one harmonic", "a sea"],
)  # fmt: skip
def test_the_rest_of_drag(waves: dict[str, object], part: float, bound: float) -> None:
    """Curvature of a taut string is its load over its tension: of c |u| u, u of one harmonic or normal, along a line.

    Of 1100 waves the square of what is left, whose kurtosis is about 20, scatters by 13 %.
    The whole load has sqrt(3/8) c U^2 and sqrt(3) c s^2, its linear part 8/(3 pi sqrt 2) c U^2 and sqrt(8/pi) c s^2.
    """
    section = {"length": 10.0, "mass": 0.2, "diameter": 0.01, "axial_stiffness": 1e8, "drag": {"normal": 1.2}}
    water = {"density": 1025, "surface": 0.0, "waves": waves | {"depth": 10.0, "direction": 90.0, "ramp": 10.0}}
    scene = {
        "environment": {"fluid": water},
        "cable": {"sections": [section]},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, -9.9]},
            "end": {"kind": "pinned", "position": [10.005, 0, -9.9]},
        },
        "initial": "equilibrium",
        "model": "catenary",
        "mesh": {"cells": 10},
    }
    line = hybrid.response(scene).lines["cable"]
    assert line.left_out["curvature"][2:-2] == pytest.approx(part, rel=bound)
