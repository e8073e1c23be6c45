"""Equilibria of ten random systems of lines against MoorPy: quasi-static elastic catenaries on a bed without friction.

HYBRID_MOORPY names a Python that has MoorPy (`pip install moorpy` into an environment of its own):
HYBRID_MOORPY=.../bin/python pytest bench/test_bench_moorpy.py -m bench -s
"""

from __future__ import annotations

import json
import math
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid

PEER = Path(__file__).with_name("peers") / "moorpy_statics.py"
DENSITY, GRAVITY, DEPTH, BED, CELLS = 1025.0, 9.80665, 100.0, 1e6, 200
SAME = 1e-3  # of the largest tension of the system

pytestmark = pytest.mark.bench


def random_system(seed: int) -> dict[str, Any]:
    """Three to six chains from the seabed to a buoy (even seeds) or a submerged body (odd ones)."""
    rng = np.random.default_rng(seed)
    count, body = int(rng.integers(3, 7)), bool(seed % 2)
    depth = float(rng.uniform(35, 55))  # of the float below the surface
    lines: list[dict[str, Any]] = []
    weight = 0.0
    turn = rng.uniform(0, 2 * math.pi)
    for k in range(count):
        angle = turn + 2 * math.pi * (k + rng.uniform(-0.2, 0.2)) / count
        radius, height = float(rng.uniform(120, 300)), DEPTH - depth
        d = float(rng.uniform(0.05, 0.1))
        mass = float(rng.uniform(3000, 7000)) * 0.25 * math.pi * d * d
        length = math.hypot(radius, height) * float(rng.uniform(1.01, 1.10))
        lead = [4 * math.cos(angle), 4 * math.sin(angle), float(rng.uniform(-3, -1))]
        lines.append({
            "anchor": [radius * math.cos(angle), radius * math.sin(angle), -DEPTH], "fairlead": lead,
            "length": length, "mass": mass, "diameter": d, "EA": float(rng.uniform(1e8, 6e8)),
        })  # fmt: skip
        weight += 0.7 * mass * length
    size = float(rng.uniform(2.0, 4.0)) * weight
    what = {"kind": "body" if body else "point", "mass": size, "volume": (size + float(rng.uniform(0.5, 1.5)) * weight) / DENSITY,
            "guess": [0.0, 0.0, -depth], "centre": [0.3, 0.0, -1.5], "buoyancy": [0.0, 0.0, 1.0]}  # fmt: skip
    return {"float": what, "lines": lines}


def scene_of(given: dict[str, Any]) -> dict[str, Any]:
    """The same system as a scene."""
    what, points, lines = given["float"], {}, {}
    for k, line in enumerate(given["lines"]):
        points[f"anchor{k}"] = {"position": line["anchor"]}
        end = "float"
        if what["kind"] == "body":
            end = f"lead{k}"
            points[end] = {"body": "float", "place": line["fairlead"]}
        section = {
            "length": line["length"],
            "mass": line["mass"],
            "diameter": line["diameter"],
            "axial_stiffness": line["EA"],
        }
        lines[f"line{k}"] = {"start": f"anchor{k}", "end": end, "sections": [section], "mesh": {"cells": CELLS}}
    body = {"initial_guess": what["guess"], "mass": what["mass"], "volume": what["volume"]}
    scene: dict[str, Any] = {
        "environment": {"gravity": GRAVITY, "fluid": {"density": DENSITY}, "seabed": {"z": -DEPTH, "stiffness": BED}},
        "points": points, "lines": lines,
    }  # fmt: skip
    if what["kind"] == "point":
        points["float"] = {"kind": "free"} | body
    else:
        extra = {"inertia": [1e7] * 3, "centre": what["centre"], "centre_of_buoyancy": what["buoyancy"]}
        scene["bodies"] = {"float": body | extra}
    return scene


def test_equilibria_of_random_systems_are_those_of_moorpy() -> None:
    python = os.environ.get("HYBRID_MOORPY")
    if not python:
        pytest.skip("HYBRID_MOORPY names no Python with MoorPy")
    systems = [random_system(seed) for seed in range(10)]
    done = subprocess.run([python, PEER], input=json.dumps(systems), capture_output=True, text=True, check=True)
    worst, laid = 0.0, 0.0
    print()
    for seed, (given, theirs) in enumerate(zip(systems, json.loads(done.stdout), strict=True)):
        result = hybrid.static(scene_of(given))
        ours = np.array([[np.linalg.norm(result.lines[f"line{k}"][f"reaction_{end}"][-1]) for end in ("start", "end")]
                         for k in range(len(given["lines"]))])  # fmt: skip
        tensions = np.array(theirs["tensions"])
        kind = given["float"]["kind"]
        place = result[f"{'points' if kind == 'point' else 'bodies'}/float/position"][-1]
        shift = float(np.linalg.norm(place - np.array(theirs["place"][:3])))
        differ = float(np.abs(ours - tensions)[:, 1].max() / tensions.max())
        anchors = float(np.abs(ours - tensions)[:, 0].max() / tensions.max())
        low = [np.mean(result.lines[f"line{k}"].position[-1][:, 2] < 1e-3 - DEPTH) for k in range(len(ours))]
        lying = sum(part * line["length"] for part, line in zip(low, given["lines"], strict=True))
        turned = 0.0
        if kind == "body":
            turned = float(np.abs(result["bodies/float/rotation"][-1] - np.degrees(theirs["place"][3:])).max())
        print(f"system {seed}: {len(ours)} lines to a {kind}: fairlead tension {differ:.1e}, anchor tension {anchors:.1e} "
              f"of the largest, {tensions.max():.4g} N; on the seabed {lying:.0f} m; place {1e3 * shift:.2f} mm, rotation {turned:.1e} deg")  # fmt: skip
        assert place[2] < 0.0  # MoorPy knows the surface
        worst = max(worst, differ, anchors)
        laid += lying
    assert worst < SAME and laid > 500.0  # m on the seabed in all
