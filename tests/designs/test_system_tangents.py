"""Tangents along the steps of runs of several lines, against one cable and against differences of runs."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from hybrid.designs import in_motion as way
from hybrid.designs.in_motion import DIFFERENCES, TANGENTS, by_differences, by_tangents, in_motion
from hybrid.designs.numbers_and_results import number_of, parse_wanted, size_of
from hybrid.designs.replay import course_of
from hybrid.scene.read import as_scene

SECTION = {
    "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e7, "bending_stiffness": 2e3, "torsional_stiffness": 2e3,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip
HEAVE = {"heave": {"amplitude": 1.0, "period": 8.0}, "ramp": 4.0}
WAVES = {"kind": "jonswap", "significant_height": 3, "peak_period": 9, "seed": 1, "components": 12}
OUTPUT = {"time": {"duration": 5.0, "step": 0.05}, "output": {"every": 0.25, "points": 21}}


def water(waves: bool, bed: bool = False) -> dict[str, Any]:
    fluid = {"density": 1025, "surface": 10} | ({"waves": WAVES} if waves else {})
    return {"fluid": fluid} | ({"seabed": {"z": -60.0, "stiffness": 5e3, "damping": 500.0}} if bed else {})


def line(start: str, end: str, length: float, model: str) -> dict[str, Any]:
    sections = [SECTION | {"length": length}]
    return {"start": start, "end": end, "model": model, "mesh": {"cells": 12}, "sections": sections}


def at_a_point(model: str = "catenary", waves: bool = False) -> dict[str, Any]:
    """Three lines at a free point with mass and buoyancy, one of which is heaved at its end."""
    points = {
        "low": {"position": [0, 0, -60.0]}, "far": {"position": [60, 110, -60.0]},
        "top": {"position": [90, 0, -1.0], "motion": HEAVE},
        "mid": {"kind": "free", "initial_guess": [50, 30, -40], "mass": 100.0, "volume": 1.5},
    }  # fmt: skip
    lines = {
        "a": line("low", "mid", 70.0, model),
        "b": line("mid", "top", 70.0, model),
        "c": line("far", "mid", 100.0, "catenary"),
        "alone": line("low", "top", 120.0, "catenary"),
    }
    return {"environment": water(waves), "points": points, "lines": lines} | copy.deepcopy(OUTPUT)


def at_a_body(model: str = "catenary", waves: bool = False) -> dict[str, Any]:
    """The same with a buoy of six degrees of freedom in place of the point."""
    tables = at_a_point(model, waves)
    del tables["points"]["mid"], tables["lines"]["alone"]
    for k, place in enumerate(([-1, 0, -0.5], [1, 0.5, 0.5], [0, 1, -0.5])):
        tables["points"][f"f{k}"] = {"body": "buoy", "place": place}
    tables["lines"]["a"]["end"], tables["lines"]["b"]["start"], tables["lines"]["c"]["end"] = "f0", "f1", "f2"
    damping = [[500.0 * (i == k) for k in range(6)] for i in range(6)]
    tables["bodies"] = {
        "buoy": {
            "kind": "free", "initial_guess": [50, 30, -30], "mass": 4000.0, "inertia": [3000.0, 3500.0, 4000.0],
            "centre": [0, 0, -0.2], "volume": 5.0, "centre_of_buoyancy": [0, 0, 0.3], "damping": damping,
        }
    }  # fmt: skip
    return tables


def asked_of(tables: dict[str, Any], of: list[str], keys: list[str]) -> tuple[Any, ...]:
    scene = as_scene(tables)
    numbers = {key: number_of(scene, key) for key in keys}
    sizes = {key: size_of(scene, key, x) for key, x in numbers.items()}
    return scene, [parse_wanted(scene, x, moves=True) for x in of], course_of(scene), numbers, sizes


def agree(tables: dict[str, Any], of: list[str], keys: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """To 1e-5 of differences of runs, half of them to 1e-6, each by the best of some steps: waves make kinks in larger

    ones, rounding shows in smaller ones.  What answers less than a thousandth, in parts by parts, is compared with that.
    """
    asked = asked_of(tables, of, keys)
    ours, off = by_tangents(*asked), np.full((len(keys), len(of)), np.inf)
    floor = 1e-3 * np.abs(ours.values) / np.array(list(asked[-1].values()))[:, None]
    for part in (1e-3, 1e-5, 1e-6, 1e-4, 3e-4, 1e-7, 3e-5, 3e-6, 3e-7):
        monkeypatch.setattr(way, "STEP_PARTS", (part, 2.0 * part))
        theirs = by_differences(*asked)
        np.testing.assert_allclose(ours.values, theirs.values, rtol=1e-12)
        whole = np.maximum(np.abs(theirs.derivatives), floor)
        off = np.minimum(off, np.abs(ours.derivatives - theirs.derivatives) / whole)
        if (off < 1e-5).all():
            break
    print(np.sort(off.ravel())[[0, off.size // 2, -3, -2, -1]])
    assert (off < 1e-5).all() and np.median(off) < 1e-6, off
    assert (np.abs(ours.derivatives) > floor).mean() > 0.5  # else it would say nothing


NUMBERS = ["lines.a.sections[0].mass", "lines.b.sections[0].drag.normal", "lines.c.sections[0].length"]
NUMBERS += ["points.top.motion.heave.amplitude"]
RESULTS = [
    "max b/tension@end",
    "last a/tension@30",
    "std b/position.z@37",
    "last c/position.y@92",
    "t=3.31 c/tension@7",
]


@pytest.mark.long
@pytest.mark.parametrize("waves", [False, True])
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_lines_at_a_point(model: str, waves: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = [*NUMBERS, "points.mid.mass", "points.mid.volume", *([] if waves else ["environment.gravity"])]
    agree(at_a_point(model, waves), [*RESULTS, "last alone/tension@55"], keys, monkeypatch)


@pytest.mark.long
@pytest.mark.parametrize("waves", [False, True])
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_lines_at_a_body(model: str, waves: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    of_body = [f"bodies.buoy.{x}" for x in ("mass", "inertia[1]", "volume", "centre[2]", "damping[4][4]")]
    agree(at_a_body(model, waves), RESULTS, [*NUMBERS, *of_body, "points.f0.place[0]"], monkeypatch)


@pytest.mark.long  # two kernels of its own: 55 s
def test_what_is_not_followed_is_left_to_differences_and_said() -> None:
    tables, key, of = at_a_point(), "points.mid.mass", ["last a/tension@30"]
    tables["time"]["duration"] = 0.5
    assert in_motion(as_scene(tables), of, [key]).ways == (TANGENTS,)
    tables["environment"]["seabed"] = {"z": -60.0, "stiffness": 5e3, "friction": 0.5}
    assert in_motion(as_scene(tables), of, [key]).ways == (f"{DIFFERENCES}: friction of the bed",)
