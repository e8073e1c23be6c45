"""What three hours of a buoy in an irregular sea cost, on three lines of 40 rods: a part of them is computed, and scaled.

    pytest bench/test_bench_buoy.py -m bench -s

The buoy is a spar of 3000 t in six degrees of freedom, with a member on which waves act.  Of memory the resident size is
measured before and after the part, in which the file grows.
"""

from __future__ import annotations

import resource
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid

pytestmark = pytest.mark.bench
HOURS, PART, STEP = 3 * 3600.0, 600.0, 0.1
ASKED = 60.0  # s of CPU time for three hours
MOST_GROWN = 20.0  # MB, in the second half of the part


def spar(duration: float) -> dict[str, Any]:
    """The scene."""
    section = {
        "length": 425.0, "mass": 80.0, "diameter": 0.1, "axial_stiffness": 4e8, "bending_stiffness": 2e4,
        "drag": {"normal": 1.6}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    places = {"east": (400, 0), "north": (-200, 346), "south": (-200, -346)}
    waves = {"kind": "jonswap", "significant_height": 6, "peak_period": 11, "gamma": 2.5, "ramp": 60, "seed": 1}
    return {
        "environment": {
            "fluid": {"density": 1025, "current": [0.4, 0, 0], "surface": 0.0, "waves": waves},
            "seabed": {"z": -150.5, "stiffness": 1e4},
        },
        "points": {name: {"position": [x, y, -150]} for name, (x, y) in places.items()}
        | {f"to_{name}": {"body": "spar", "place": [x / 80, y / 80, -20]} for name, (x, y) in places.items()},
        "bodies": {
            "spar": {
                "kind": "free", "initial_guess": [0, 0, 9], "mass": 3e6, "centre": [0, 0, -25],
                "inertia": [8e8, 8e8, 4e7], "damping": [2e5, 2e5, 1e5, 2e7, 2e7, 1e7],
                "hydrostatics": {"heave": 7.8e5, "roll": 1.2e8, "pitch": 1.2e8},
                "members": [{"start": [0, 0, -50], "end": [0, 0, 20], "diameter": 8, "drag": 1, "added_mass": 1}],
            }
        },
        "lines": {
            name: {
                "start": name, "end": f"to_{name}", "sections": [section], "mesh": {"cells": 40}, "model": "rod",
            }
            for name in places
        },
        "time": {"duration": duration, "step": STEP}, "output": {"every": 0.5, "points": 11},
    }  # fmt: skip


def megabytes() -> float:
    """The largest resident size so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def test_three_hours_of_a_buoy_in_irregular_waves(tmp_path: Path) -> None:
    hybrid.run(spar(5.0), tmp_path / "first.h5").close()  # compiles
    found = []
    for duration in (PART / 2, PART):
        begin = time.process_time()
        with hybrid.run(spar(duration), tmp_path / "run.h5") as result:
            found.append((time.process_time() - begin, megabytes()))
            heave = result["bodies/spar/position"][:, 2]
    (half, before), (whole, after) = found
    rate = (whole - half) / (0.5 * PART)
    steps = 0.5 * PART / STEP
    print(
        f"\n{PART:.0f} s in {whole:.1f} s of CPU time, {1e6 * (whole - half) / steps:.0f} us a step; three hours: ",
        end="",
    )
    print(
        f"{rate * HOURS:.0f} s ({ASKED:.0f} s asked); memory {before:.0f} MB, with as much again {after - before:+.1f} MB"
    )
    assert np.ptp(heave) > 0.1 and after - before < MOST_GROWN
