"""A line of several that passes through itself says so, with places and time, as one cable without contact does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import hybrid

HOSE = {
    "length": 50, "mass": 3.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 10,
    "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
}  # fmt: skip
SEA = {"fluid": {"density": 1025}}
TRAVEL = {"travel": {"by": [0, 0, -45], "over": 20}}
TIME = {"duration": 22.0, "step": 0.1}
LOWER, UPPER = [0, 0, -49.9], [0.5, 0, 0]


def hanging(duration: float = TIME["duration"]) -> dict[str, Any]:
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
    hybrid.run(hanging(), path, progress=False).close()
    return path


def test_a_line_that_meets_itself_says_so(file: Path) -> None:
    cable = {
        "environment": SEA, "cable": {"sections": [HOSE]}, "initial": "equilibrium", "model": "rod",
        "ends": {"start": {"kind": "pinned", "position": LOWER},
                 "end": {"kind": "pinned", "position": UPPER, "motion": TRAVEL}},
        "contact": {"self": False}, "mesh": {"cells": 40}, "time": TIME, "output": {"every": 1.0},
    }  # fmt: skip
    alone = hybrid.run(cable, progress=False)
    (expected, *_) = [event for event in alone.events if event.kind == "line meets itself"]
    with hybrid.open(file) as result:
        met = [event for event in result.lines["hose"].events if event.kind == "line meets itself"]
        assert met and not [x for x in result.lines["rope"].events if x.kind == "line meets itself"]
        assert met[0].t == pytest.approx(expected.t, abs=0.1)
        assert (met[0].s_a, met[0].s_b) == pytest.approx((expected.s_a, expected.s_b), abs=0.1)
        least = float(result.lines["hose"]["self_distance/clearance"])
        assert least == pytest.approx(float(alone["self_distance/clearance"]), abs=1e-4) and least < 0.0


@pytest.mark.long
def test_a_run_that_goes_on_knows_of_it(file: Path, tmp_path: Path) -> None:
    """The least clearance, and that it has been told, are in the checkpoint."""
    with hybrid.open(file) as whole:
        (first, *_) = [event.t for event in whole.lines["hose"].events if event.kind == "line meets itself"]
        middle = round(0.5 * (first + 22.0), 1)
        hybrid.run(hanging(middle), tmp_path / "part.h5", progress=False).close()
        with hybrid.resume(tmp_path / "part.h5", until=22.0) as more:
            for name in ("clearance", "s_a", "s_b", "time"):
                one, other = (x.lines["hose"][f"self_distance/{name}"] for x in (whole, more))
                assert float(one) == pytest.approx(float(other), rel=1e-9)
            counts = [sum(event.kind == "line meets itself" for event in x.lines["hose"].events) for x in (whole, more)]
            assert counts[0] == counts[1]
