"""What is asked of the outputs of a network: places on lines, gauges of the sea, steps that end at them."""

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


def asked(output: dict[str, Any], compute: Callable[..., hybrid.Result] = hybrid.run, **more: Any) -> hybrid.Result:
    """A line whose far end heaves, of which so much is asked."""
    high = {"position": HIGH, "motion": {"heave": {"amplitude": 0.3, "period": 4}, "ramp": 0.5}}
    tables = {
        "environment": SEA, "time": {"duration": 1.0, "step": 0.02}, "points": {"low": {"position": LOW}, "high": high},
        "lines": {"one": {"start": "low", "end": "high"} | LINE}, "output": {"every": 0.1, "points": 11} | output,
    }  # fmt: skip
    return compute(tables | more)


def test_places_of_histories_are_those_of_the_line() -> None:
    """Also in its grid: 7 and 41 m are none of its eleven points."""
    line = asked({"history": {"one": [7.0, 41.0]}}).lines["one"]
    assert np.array_equal(line["history"], [7.0, 41.0]) and line.s.size == 13 and np.isin([7.0, 41.0], line.s).all()
    assert np.ptp(line.tension, axis=0).min() > 1e-3 * line.tension.max()


@pytest.mark.parametrize("history, where", [
    ({"two": [1.0]}, "output.history.two"), ({"one": [70.0]}, r"output.history.one\[0\]"), ([1.0], "output.history"),
])  # fmt: skip
def test_a_place_on_no_line_is_refused_where_it_is(history: Any, where: str) -> None:
    with pytest.raises(SceneError, match=where):
        asked({"history": history})


@pytest.mark.parametrize("exact", [False, True])
def test_steps_end_at_outputs_if_that_is_asked(exact: bool) -> None:
    """Outputs are no multiples of steps here: else they are interpolated."""
    found = asked({"every": 0.13, "exact": exact, "history": {"one": [7.0]}})
    line = found.lines["one"]
    assert np.isin(line.times[1:], line.steps["t"]).all() == exact
    assert np.abs(found["points/high/position"] - line.position[:, -1]).max() < 1e-12
    assert np.abs(found["points/high/force"] + line["reaction_end"]).max() < 1e-9 * line.tension.max()


@pytest.mark.parametrize("compute", [hybrid.run, hybrid.static])
def test_the_sea_at_gauges_is_beside_the_points(compute: Callable[..., hybrid.Result]) -> None:
    places = [[3.0, -2.0], [40.0, 25.0]]
    found = asked({"elevation": places, "exact": True}, compute)
    assert found["elevation"].shape == (len(found.times), 2) and np.array_equal(found["elevation_at"], places)
    assert compute is hybrid.static or np.ptp(found["elevation"], axis=0).min() > 0.05


def test_gauges_ask_for_waves() -> None:
    still = {"fluid": {"density": 1025, "surface": 30.0}}
    with pytest.raises(SceneError, match="the sea has no waves"):
        asked({"elevation": [[0, 0]]}, environment=still)
