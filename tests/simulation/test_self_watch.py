"""A line that meets itself is told of, with both places, the time and the distance; one that does not is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid

KEYS = [f"self_distance/{name}" for name in ("clearance", "distance", "s_a", "s_b", "time")]


def hanging(end: list[float], diameter: float | None = 0.02, **more: Any) -> dict[str, Any]:
    """A line of 4 m from the origin to an end (m)."""
    section = {"length": 4.0, "mass": 0.4, "axial_stiffness": 1e4, "bending_stiffness": 1e-3, "damping": {"mass": 1.0}}
    if diameter is not None:
        section["diameter"] = diameter
    return {
        "cable": {"sections": [section]}, "model": "catenary", "mesh": {"cells": 60}, "initial": "equilibrium",
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": end}},
    } | more  # fmt: skip


def meetings(result: hybrid.Result) -> list[Any]:
    return [event for event in result.events if event.kind == "line meets itself"]


def test_an_end_that_is_led_through_the_line() -> None:
    scene = hanging(
        [0.6, 0, -1.0], model="rod", time={"duration": 4.0, "step": 0.02}, output={"every": 0.02, "points": 101},
        contact={"self": False},
    )  # fmt: skip
    scene["ends"]["end"]["motion"] = {"travel": {"by": [-1.2, 0, 0], "over": 4.0}}
    result = hybrid.run(scene)
    first = meetings(result)[0]
    assert first.s_a < 1.4 and first.s_b > 3.9  # the end, and the leg of the start, which hangs 1 m deep there
    assert first.value < first.threshold == pytest.approx(0.02)
    near = np.linalg.norm(result["position"][:, 20:31] - result["position"][:, -1:], axis=2).min(axis=1)
    assert abs(result.times[np.argmin(near)] - first.t) < 0.2
    clearance, distance, s, other, t = (float(result[key]) for key in KEYS)
    assert clearance == pytest.approx(distance - 0.02) and distance <= first.value
    assert (s, other) == pytest.approx((first.s_a, first.s_b), abs=0.3) and abs(t - first.t) < 0.5


def test_a_line_that_hangs_is_not_told_of() -> None:
    result = hybrid.run(hanging([3.0, 0, 0], time={"duration": 0.2, "step": 0.1}))
    assert not meetings(result)
    assert all(np.isnan(result[key]) for key in KEYS)


def test_legs_of_an_equilibrium_that_are_in_each_other() -> None:
    assert not meetings(hybrid.static(hanging([0.1, 0, -0.5], diameter=0.02)))
    found = meetings(hybrid.static(hanging([0.1, 0, -0.5], diameter=0.09)))
    assert len(found) == 1 and found[0].value < 0.09


def test_without_a_diameter_there_is_nothing_to_look_for() -> None:
    result = hybrid.static(hanging([0.1, 0, -0.5], diameter=None))
    assert not meetings(result) and not any(key in result for key in KEYS)


# --- a line of several ---

HOSE = {
    "length": 50, "mass": 3.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 10,
    "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
}  # fmt: skip
SEA = {"fluid": {"density": 1025}}
TRAVEL = {"travel": {"by": [0, 0, -45], "over": 20}}
TIME = {"duration": 22.0, "step": 0.1}
LOWER, UPPER = [0, 0, -49.9], [0.5, 0, 0]


def lowered(duration: float = TIME["duration"]) -> dict[str, Any]:
    """A hose whose upper end is lowered until it lies across itself, and a rope beside it that stays straight."""
    rope = {"start": "deck", "end": "ground", "sections": [{"length": 49, "mass": 1.0, "diameter": 0.02}]}
    return {
        "environment": SEA,
        "points": {
            "low": {"position": LOWER}, "high": {"position": UPPER, "motion": TRAVEL},
            "deck": {"position": [9, 0, 0]}, "ground": {"position": [9, 0, -49.9]},
        },
        "lines": {
            "hose": {"start": "low", "end": "high", "model": "rod", "mesh": {"cells": 40}, "sections": [HOSE],
                     "contact": {"self": False}},
            "rope": rope | {"mesh": {"cells": 10}, "sections": [rope["sections"][0] | {"axial_stiffness": 1e5}]},
        },
        "time": TIME | {"duration": duration}, "output": {"every": 1.0},
    }  # fmt: skip


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("itself") / "hose.h5"
    hybrid.run(lowered(), path, progress=False).close()
    return path


def test_a_line_that_meets_itself_says_so(file: Path) -> None:
    with hybrid.open(file) as result:
        met = [[x for x in line.events if x.kind == "line meets itself"] for line in result.lines.values()]
        assert met[0] and not met[1] and float(result.lines["hose"]["self_distance/clearance"]) < 0.0


@pytest.mark.long
def test_a_run_that_goes_on_knows_of_it(file: Path, tmp_path: Path) -> None:
    """The least clearance, and that it has been told, are in the checkpoint."""
    with hybrid.open(file) as whole:
        (first, *_) = [event.t for event in whole.lines["hose"].events if event.kind == "line meets itself"]
        middle = round(0.5 * (first + 22.0), 1)
        hybrid.run(lowered(middle), tmp_path / "part.h5", progress=False).close()
        with hybrid.resume(tmp_path / "part.h5", until=22.0) as more:
            for name in ("clearance", "s_a", "s_b", "time"):
                one, other = (x.lines["hose"][f"self_distance/{name}"] for x in (whole, more))
                assert float(one) == pytest.approx(float(other), rel=1e-9)
            counts = [sum(event.kind == "line meets itself" for event in x.lines["hose"].events) for x in (whole, more)]
            assert counts[0] == counts[1]
