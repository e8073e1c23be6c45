"""A buoy that its lines pull under water is told, with the volume that would float them."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import hybrid
from hybrid import Result

HEIGHT = 2.0  # m


def two_chains(volume: float, **more: Any) -> dict[str, Any]:
    """A buoy of 2.5 t between two slack chains of 60 m in deep water."""
    chain = {"length": 60, "mass": 40, "diameter": 0.08, "axial_stiffness": 1.7e8, "drag": {"normal": 1.3}}
    line = {"end": "buoy", "sections": [chain], "mesh": {"cells": 20}}
    buoy = {"mass": 2500, "volume": volume, "height": HEIGHT, "shape": "cylinder"} | more
    return {
        "environment": {"fluid": {"density": 1025, "surface": 0}},
        "points": {
            "east": {"position": [20, 0, -35]}, "west": {"position": [-20, 0, -35]},
            "buoy": {"initial_guess": [0, 0, 0], "drag_area": 3, "added_mass": 3000} | buoy,
        },
        "lines": {"east": {"start": "east"} | line, "west": {"start": "west"} | line},
        "time": {"duration": 2.0, "step": 0.1}, "output": {"every": 0.5},
    }  # fmt: skip


def pulled(result: Result) -> list[str]:
    return [x.text for x in result.events if x.kind == "pulled under"]


def test_the_volume_that_is_named_floats_the_lines_and_a_smaller_one_does_not() -> None:
    few = hybrid.static(two_chains(3.5))
    (text,) = pulled(few)
    depth = -few["points/buoy/position"][0, 2] - 0.5 * HEIGHT
    assert f"its top is {depth:.3g} m below the surface" in text and depth > 1.0
    net = 9.81 * (1025 * 3.5 - 2500)
    assert f"less its weight is {net:.4g} N at most" in text
    volume = float(re.search(r"a volume of (\S+) m\^3 would float them", text)[1])  # type: ignore[index]
    assert volume > 3.5
    floats = hybrid.static(two_chains(1.02 * volume))
    assert not pulled(floats) and -0.5 * HEIGHT < floats["points/buoy/position"][0, 2] < 0.0
    assert pulled(hybrid.static(two_chains(0.98 * volume)))


def test_what_is_to_stay_in_the_depth_is_not_told() -> None:
    """Without height, and first put below the surface, as a buoy of a mooring that is submerged."""
    scene = two_chains(3.5, initial_guess=[0, 0, -15], height=None)
    del scene["points"]["buoy"]["height"]
    assert not pulled(hybrid.static(scene))


@pytest.mark.long  # 1.0 s
def test_a_buoy_is_told_once_in_waves_that_pass_over_it_and_again_where_it_is_much_deeper(tmp_path: Path) -> None:
    """A crest of 1 m stands over a buoy that its taut chains hold; the run that goes on does not tell it again."""
    scene = two_chains(4.0)
    scene["environment"]["fluid"]["waves"] = {"kind": "regular", "height": 2.0, "period": 8.0}
    whole = hybrid.run(scene)
    told = pulled(whole)
    assert told and "and its lines pull it down by" in told[0]
    tops = [float(re.search(r"top is (\S+) m", x)[1]) for x in told]  # type: ignore[index]
    assert all(b > 3.0 * a for a, b in pairwise(tops))
    file = tmp_path / "half.h5"
    scene["time"]["duration"] = 1.0
    hybrid.run(scene, file)
    assert pulled(hybrid.resume(file, until=2.0)) == told
