"""What a step costs of a rope that lies over a pipe: without it, with it at rest, with it moving, and turning.

pytest bench/test_bench_obstacles.py -m bench -s
"""

from __future__ import annotations

from typing import Any

import pytest

import hybrid

pytestmark = pytest.mark.bench
RUNS = 5
MOTION = {"travel": {"by": [0.1, 0.2, 0.15], "over": 1.5}}
SPIN = {"rate": 2.0, "ramp": 0.3}


def over_pipe(**pipe: Any) -> hybrid.Scene:
    """A rope of 64 rod cells over a pipe in its span, whose end moves."""
    section = {"length": 12.0, "mass": 2.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 5.0,
               "damping": {"mass": 0.5}}  # fmt: skip
    at = {"kind": "cylinder", "at": [4, 0, -1.7], "axis": [0.1, 1, 0.05], "radius": 1.2, "friction": 0.3}
    there = {"obstacles": {"pipe": at | pipe}} if pipe.get("friction", 1.0) >= 0.0 else {}
    return hybrid.validate_scene(
        {
            "cable": {"sections": [section]},
            "ends": {
                "start": {"kind": "pinned", "position": [0, 0, 0]},
                "end": {"kind": "pinned", "position": [10, 0, 3],
                        "motion": {"travel": {"by": [0.3, 0.3, 0.2], "over": 1.0}}},
            },
            "initial": "equilibrium", "model": "rod", "mesh": {"cells": 64}, "contact": {"self": False},
            "dimension": 3, "time": {"duration": 4.0, "step": 0.02}, "output": {"every": 0.5, "points": 65},
        } | there
    )  # fmt: skip


def test_a_step_on_obstacles() -> None:
    """Least processor time of some runs, us a step and Newton iteration, and how many of these a step takes."""
    kinds = {"none": {"friction": -1.0}, "at rest": {}, "moving": {"motion": MOTION}, "turning": {"spin": SPIN}}
    print(f"\n{'pipe':12}{'us a step':>12}{'iterations':>12}{'us an iteration':>18}")
    cost = {}
    for name, pipe in kinds.items():
        scene, least, done = over_pipe(**pipe), float("inf"), 0.0
        for _ in range(RUNS):
            with hybrid.run(scene) as result:
                least = min(least, float(result["steps/cpu"][-1]))
                steps, done = len(result.steps.iterations), float(result.steps.iterations.sum())
        cost[name] = 1e6 * least / done
        print(f"{name:12}{1e6 * least / steps:12.1f}{done / steps:12.2f}{cost[name]:18.1f}", flush=True)
    assert cost["moving"] < 3.0 * cost["none"]
