"""Velocities of what is set from outside: left out they follow from the places, and those that contradict are told."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from test_stepping import PINNED, touchdown
from test_system_saving import STEP, VESSEL, scene

import hybrid
from hybrid.errors import Outcome
from hybrid.kernels.state.state import no_moves
from hybrid.model.ends import DrivenEnd
from tests.scenes import cable_scene, pinned_at

Said = Callable[[np.ndarray], Any]


def heaved(said: Said, size: float = 1.5, period: float = 8.0, steps: int = 80) -> hybrid.Result:
    """The fairlead of examples/touchdown.yaml goes up and down by `size`, m; said: what velocities (3,) m/s are given."""
    w = 2.0 * np.pi / period
    with hybrid.Simulation(touchdown("model=catenary", PINNED)) as simulation:
        for k in range(steps):
            phase = 0.05 * w * (k + 1)
            velocity = np.array([0.0, 0.0, size * w * np.sin(phase)])
            simulation.set_end("end", [205.0, 0.0, size * (1.0 - np.cos(phase))], said(velocity))
            simulation.step()
        return simulation.result()


def test_left_out_it_follows_from_the_places() -> None:
    right, left_out = heaved(lambda v: v), heaved(lambda v: None)
    work = right["work/end"][-1]
    assert np.array_equal(right.position, left_out.position), "the motion is that of the places"
    assert left_out["work/end"][-1] == pytest.approx(work, rel=0.01)
    assert abs(left_out["work/scheme"][-1]) < 0.01 * abs(work)
    assert not left_out.events


def test_one_that_contradicts_the_places_is_told_with_numbers() -> None:
    events = [x for x in heaved(lambda v: 0.5 * v).events if x.kind == "implausible"]
    assert len(events) == 1
    assert events[0].text.startswith("ends.end: the velocities given miss ")
    assert "in 16 steps" in events[0].text and "leave velocity out" in events[0].text
    assert not [x for x in heaved(lambda v: 1.2 * v).events if x.kind == "implausible"]


def test_a_run_that_stops_by_its_energy_says_so() -> None:
    with pytest.raises(hybrid.ComputationError) as caught:
        heaved(lambda v: -v)
    assert caught.value.outcome == Outcome.GAINS_ENERGY
    assert "try:      ends.end: the velocities given miss" in str(caught.value)


@pytest.mark.long
@pytest.mark.parametrize("again", [False, True])
def test_points_of_several_lines(again: bool) -> None:
    """Left out as for ends; again: every step is taken back once, which leaves the same bits and one event."""
    work, data = {}, scene()
    data["output"]["every"] = 0.9  # nothing is judged by its energy before it is told
    for name, said in {"right": 1.0, "left out": None, "half": 0.5}.items():
        with hybrid.Simulation(data) as lines:
            for k in range(18):
                place = VESSEL + np.array([0, 0, 0.2 * (1.0 - np.cos(2.0 * STEP * (k + 1)))])
                velocity = np.array([0, 0, 0.4 * np.sin(2.0 * STEP * (k + 1))])
                saved = lines.save() if again else None
                for _ in range(1 + again):
                    lines.set_point("vessel", place, None if said is None else said * velocity)
                    lines.advance(STEP * (k + 1))
                    if saved is not None and _ == 0:
                        lines.restore(saved)
            result = lines.result()
        work[name] = result.lines["hose"]["work/end"][-1] + result.lines["hose"]["work/start"][-1]
        told = [x.text for x in result.events if x.kind == "implausible" and "points.vessel" in x.text]
        assert len(told) == (name == "half")
    assert work["left out"] == pytest.approx(work["right"], rel=0.02)


def test_obstacles() -> None:
    rope = {"length": 2.2, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.05}
    arm = {"kind": "cylinder", "at": [1, -0.3, 0], "axis": [0, 0, 1], "length": 0.6, "radius": 0.15, "friction": 0.4}
    tables = cable_scene(
        rope, pinned_at(0, 0, 0.2), pinned_at(2, 0, 0.2), obstacles={"arm": arm | {"from_outside": True}}, model="rod",
        mesh=30, time=(0.2, 0.01)
    )  # fmt: skip
    told = {}
    for speed in (0.6, 0.06, None):
        with hybrid.Simulation(tables) as simulation:
            for k in range(20):
                simulation.set_obstacle("arm", [1.0, -0.3 + 0.006 * (k + 1), 0], speed and [0, speed, 0])
                simulation.advance(0.01 * (k + 1))
            told[speed] = [x.text for x in simulation.result().events if x.kind == "implausible"]
    assert not told[0.6] and not told[None]
    assert "obstacles.arm: the velocities given miss 0.08" in told[0.06][0]


def test_the_velocity_of_places() -> None:
    """At the end of the parabola through three places; from rest to rest trapezoids add up to the way."""
    end, dt, places = DrivenEnd(no_moves().paths[0], np.zeros(3), np.eye(3), True, False), 0.1, np.zeros((9, 3))
    places[1:6, 0], places[6:, 0] = 0.5 * np.arange(1, 6) ** 2, 12.5
    rates = [np.zeros(3)]
    for k, place in enumerate(places[1:]):
        end.set(k * dt, (k + 1) * dt, place, None, np.zeros(3), True)
        rates.append(end.path[11:14].copy())
    assert np.allclose([x[0] * dt for x in rates[2:6]], [2.0, 3.0, 4.0, 5.0])
    assert sum(0.5 * dt * (a[0] + b[0]) for a, b in pairwise(rates)) == pytest.approx(12.5)
    end.set(0.9, 5.0, [20.0, 0, 0], None, np.zeros(3), False)  # in what takes several steps: from rest to rest
    assert not end.path[5:8].any() and not end.path[11:14].any()


@pytest.mark.parametrize(("size", "told"), [(1e-9, False), (1e-3, True)])
def test_what_another_solver_leaves_of_a_thing_that_rests_is_no_way(size: float, told: bool) -> None:
    """Places that go back and forth by so many m, with velocities of the other sign."""
    found = heaved(lambda v: -v, size, 2.0, 40)
    assert bool([x for x in found.events if x.kind == "implausible"]) == told
