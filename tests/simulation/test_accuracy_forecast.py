"""Orders that runs to compare with show, whatever the result is finer by; long storms have short pre-runs."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.accuracy.error_estimate import Estimate
from hybrid.model.resolution import Resolution
from hybrid.scene.read import one_line
from hybrid.simulation.mesh_survey import PERIODS, survey_duration
from hybrid.simulation.run_sample import RunSample
from tests.scenes import cable_scene, pinned_at

FIRST = Resolution(1.0, 0.1, 1e-3, 1e-3)


def run(resolution: Resolution, order: float, mesh: float = 0.01, time: float = 0.004) -> RunSample:
    """A run with errors of one order, of such sizes at FIRST, in position and in a force that stays taut."""
    t = np.linspace(0.0, 1.0, 9)[:: resolution.every]
    h, dt = 1.0 / resolution.fineness, resolution.step / FIRST.step
    wrong = (mesh * h**order + time * dt**order) * (1.0 + t)
    position = np.zeros((t.size, 4, 3))
    position[..., 2] = (np.sin(t) + wrong)[:, None]
    values = {"position": position, "reaction_end": (5.0 + wrong)[:, None] * [0.0, 0.0, 1.0]}
    return RunSample(resolution, values, round(1000 / h), round(1000 / dt), 0.0, resolution.every)


def runs(order: float, **sizes: float) -> tuple[RunSample, RunSample, RunSample]:
    each = FIRST.coarser(2, 2), FIRST.coarser(2, 4), FIRST.coarser(4, 4)
    coarse, rough, coarsest = (run(x, order, **sizes) for x in each)
    return coarse, rough, coarsest


@pytest.mark.parametrize("order", [1.5, 1.75, 2.0])
@pytest.mark.parametrize(("mesh", "time"), [(0.01, 0.004), (0.002, 0.02)])
def test_an_order_is_found_whatever_the_result_is_finer_by(order, mesh, time):
    """The estimate is that of errors of that order, for a result that is 2.6 times as fine in cells and 3.3 in steps."""
    finer = FIRST.coarser(1 / 1.3, 1 / 1.65)
    estimate = Estimate(run(finer, order, mesh, time), *runs(order, mesh=mesh, time=time))
    assert estimate.order["position"] == pytest.approx(order, abs=0.02)
    assert estimate.errors.largest("mesh", "position") == pytest.approx(2 * mesh / 1.3**order, rel=0.03)
    assert estimate.errors.largest("time", "position") == pytest.approx(2 * time / 1.65**order, rel=0.03)


def storm(duration: float, **more) -> hybrid.Scene:
    """A line whose end follows irregular waves of 10 s that grow for 60 s."""
    waves = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 10.0, "ramp": 60.0}
    start = {"kind": "pinned", "position": [0, 0, -5], "motion": {"follow": "waves", **more}}
    return hybrid.validate_scene(cable_scene(
        {"length": 30, "mass": 3, "diameter": 0.03, "drag": {"normal": 1.2}}, start, pinned_at(20, 0, -8),
        fluid={"density": 1025, "surface": 0.0, "waves": waves}, time={"duration": duration}
    ))  # fmt: skip


def test_a_long_storm_has_a_short_pre_run():
    """A stationary sea is known after so many waves; what moves otherwise is followed to the end."""
    assert survey_duration(one_line(storm(10800.0))) == 60.0 + PERIODS * 10.0
    assert survey_duration(one_line(storm(300.0))) == 300.0
    travel = {"travel": {"by": [1, 0, 0], "over": 100, "begin": 5000}}
    assert survey_duration(one_line(storm(10800.0, **travel))) == 5100.0 + PERIODS * 10.0
    assert survey_duration(one_line(storm(10800.0, velocity=[0.0001, 0, 0], ramp=10))) == 10800.0
