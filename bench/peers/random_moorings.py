"""Ten random networks of chains at rest, in hybrid and in MoorPy: quasi-static elastic catenaries on a bed without friction."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

import hybrid

PEER = Path(__file__).with_name("moorpy_statics.py")
DENSITY, GRAVITY, DEPTH, BED, CELLS, COUNT = 1025.0, 9.80665, 100.0, 1e6, 200, 10


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


def scene_of(given: dict[str, Any], cells: int = CELLS) -> dict[str, Any]:
    """The same network as a scene."""
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
        lines[f"line{k}"] = {"start": f"anchor{k}", "end": end, "sections": [section], "mesh": {"cells": cells}}
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


def by_moorpy(networks: list[dict[str, Any]], python: str = sys.executable) -> list[dict[str, Any]]:
    """Of each network: end tensions (start and end of each line, N), place (m, rad) of its float, CPU time (s)."""
    done = subprocess.run([python, PEER], input=json.dumps(networks), capture_output=True, text=True, check=True)
    return list(json.loads(done.stdout))


def tensions_of(result: hybrid.Result) -> np.ndarray:
    """Sizes (lines, 2) N of the forces at the starts and ends of the lines of a result at its last time."""
    ends = ("start", "end")
    count = len(result.lines)
    return np.array(
        [[np.linalg.norm(result.lines[f"line{k}"][f"reaction_{end}"][-1]) for end in ends] for k in range(count)]
    )
