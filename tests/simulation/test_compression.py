"""Rods of an equilibrium that are in compression say so; a line that hangs does not."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.store.verdicts import MET, verdicts_of

SECTION = {"length": 10.0, "mass": 5.0, "axial_stiffness": 1e7, "bending_stiffness": 2e4}


def column(weight_down: bool) -> dict:
    """A rod that stands on a clamp, or hangs from it, under its own weight of 491 N."""
    way = 1.0 if weight_down else -1.0
    return {
        "cable": {"sections": [SECTION]},
        "ends": {"start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, way]}, "end": "free"},
        "initial": {"kind": "equilibrium", "points": [[0, 0, 0], [0, 0, way * 10.0]]},
        "model": "rod",
    }


def said(result: hybrid.Result) -> list[str]:
    return [event.text for event in result.events if event.kind == "compression"]


def test_a_rod_that_stands_is_in_compression() -> None:
    found = hybrid.static(column(True))
    (text,) = said(found)
    assert found.tension.min() == pytest.approx(-5.0 * 9.81 * 10.0, rel=0.02)
    (event,) = [x for x in found.events if x.kind == "compression"]
    assert event.s_a == 0.0 and event.s_b == pytest.approx(10.0)
    assert text.startswith("10 m of rod are in compression") and "most at s = 0 m: -4" in text


def test_one_that_hangs_is_not() -> None:
    assert not said(hybrid.static(column(False)))


def test_of_several_lines_each_says_it() -> None:
    lines = {
        "stands": {
            "start": "foot",
            "end": "top",
            "sections": [SECTION],
            "model": "rod",
        },
        "hangs": {
            "start": "top",
            "end": "deep",
            "sections": [SECTION | {"length": 11.0, "bending_stiffness": 10.0}],
            "model": "rod",
        },
    }
    points = {
        "foot": {"position": [0, 0, 0]},
        "top": {"kind": "fixed", "position": [0, 0, 9.999]},
        "deep": {"position": [8, 0, 9.0]},
    }
    found = hybrid.static({"points": points, "lines": lines})
    assert said(found.lines["stands"]) and not said(found.lines["hangs"])


@pytest.mark.long
def test_accuracy_of_a_line_without_tension_is_a_part_of_its_compression() -> None:
    """A mast and a pressed beam, at rest and in motion: met, of a tension that is never above zero."""
    moving = {"motion": {"surge": {"amplitude": 0.1, "period": 3}, "ramp": 3}}
    mast = column(True) | {"time": {"duration": 1.0}, "initial": "equilibrium", "model": "adaptive"}
    mast["ends"] = {"start": mast["ends"]["start"] | moving, "end": "free"}
    beam = mast | {"ends": {"start": column(True)["ends"]["start"], "end": {"kind": "clamped", "tangent": [0, 0, 1]}}}
    beam["ends"]["end"] |= {"position": [0, 0, 9.998]} | moving
    for scene, compute in ((mast, hybrid.run), (beam, hybrid.static)):
        found = compute(scene)
        (tension,) = [x for x in verdicts_of(found).accuracy if x.quantity == "tension"]
        largest = float(np.abs(found.tension).max())
        assert found.tension.max() <= 1e-9 * largest
        assert tension.asked == pytest.approx(0.01 * largest, rel=0.05) and tension.verdict == MET
