"""What is recorded of several lines is what is recorded of one cable."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError

SECTION = {"length": 60, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
WAVES = {"kind": "regular", "height": 0.4, "period": 5.0, "direction": 30, "ramp": 0.5}
SEA = {"fluid": {"density": 1025, "surface": 30.0, "waves": WAVES}}
LOW, HIGH = [0, 0, 0], [40, 5, 25]
LINE: dict[str, Any] = {"sections": [SECTION], "mesh": {"cells": 12}, "model": "catenary"}


def both(
    of_cable: dict[str, Any],
    of_lines: dict[str, Any] | None = None,
    line: dict[str, Any] | None = None,
    compute: Callable[..., hybrid.Result] = hybrid.run,
    **more: Any,
) -> tuple[hybrid.Result, hybrid.Result]:
    """A cable whose far end heaves and a system of that line, with what the output of each is asked.

    line: its keys."""
    line = LINE | (line or {})
    high = {"position": HIGH, "motion": {"heave": {"amplitude": 0.3, "period": 4}, "ramp": 0.5}}
    common = {"environment": SEA, "time": {"duration": 1.0, "step": 0.02}} | more
    every = {"every": 0.1, "points": 11}
    ends = {"start": {"kind": "pinned", "position": LOW}, "end": {"kind": "pinned"} | high}
    rest = {"initial": "equilibrium", "contact": {"self": False}, "mesh": line["mesh"], "model": line["model"]}
    cable = {"cable": {"sections": line["sections"]}, "ends": ends, "output": every | of_cable} | rest
    system = {
        "points": {"low": {"position": LOW}, "high": high}, "lines": {"one": {"start": "low", "end": "high"} | line},
        "output": every | (of_cable if of_lines is None else of_lines),
    }  # fmt: skip
    return compute(common | cable), compute(common | system)


def test_places_of_histories_are_those_of_the_line() -> None:
    """Also in its grid: 7 and 41 m are none of its eleven points."""
    cable, system = both({"history": [7.0, 41.0], "exact": True}, {"history": {"one": [7.0, 41.0]}})
    line = system.lines["one"]
    assert np.array_equal(line["history"], [7.0, 41.0]) and np.array_equal(line.s, cable.s) and line.s.size == 13
    assert np.abs(line.tension - cable.tension).max() < 1e-8 * cable.tension.max()
    assert np.ptp(line.tension, axis=0).min() > 1e-3 * cable.tension.max()


@pytest.mark.parametrize("history, where", [
    ({"two": [1.0]}, "output.history.two"), ({"one": [70.0]}, r"output.history.one\[0\]"), ([1.0], "output.history"),
])  # fmt: skip
def test_a_place_on_no_line_is_refused_where_it_is(history: Any, where: str) -> None:
    with pytest.raises(SceneError, match=where):
        both({}, {"history": history})


@pytest.mark.parametrize("exact", [False, True])
def test_outputs_within_steps_are_those_of_the_cable(exact: bool) -> None:
    """Outputs are no multiples of steps here: steps end at them if that is asked, else they are interpolated."""
    asked = {"every": 0.13, "exact": exact}
    cable, system = both(asked | {"history": [7.0]}, asked | {"history": {"one": [7.0]}})
    line = system.lines["one"]
    assert np.array_equal(line.times, cable.times) and np.isin(line.times[1:], line.steps["t"]).all() == exact
    for name in ("tension", "position", "velocity", "reaction_start", "reaction_end", "work/end", "energy/kinetic"):
        assert np.abs(line[name] - cable[name]).max() < 1e-8 * np.abs(cable[name]).max(), name
    assert np.abs(system["points/high/position"] - line.position[:, -1]).max() < 1e-12
    assert np.abs(system["points/high/force"] + line["reaction_end"]).max() < 1e-9 * cable.tension.max()


@pytest.mark.parametrize("compute", [hybrid.run, hybrid.static])
def test_the_sea_at_gauges_is_beside_the_points(compute: Callable[..., hybrid.Result]) -> None:
    places = [[3.0, -2.0], [40.0, 25.0]]
    cable, system = both({"elevation": places, "exact": True}, compute=compute)
    assert system["elevation"].shape == (len(cable.times), 2) and np.array_equal(system["elevation_at"], places)
    assert np.abs(system["elevation"] - cable["elevation"]).max() < 1e-12
    assert compute is hybrid.static or np.ptp(system["elevation"], axis=0).min() > 0.05


def test_gauges_ask_for_waves() -> None:
    still = {"fluid": {"density": 1025, "surface": 30.0}}
    with pytest.raises(SceneError, match="the sea has no waves"):
        both({}, {"elevation": [[0, 0]]}, environment=still)
