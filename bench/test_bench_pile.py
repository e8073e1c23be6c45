"""A pile of 20 lines of 50 cells that falls on a bed: what 5 s of it take, and whether the pile holds.

    pytest bench/test_bench_pile.py -m bench -n 0 -s

HYBRID_PILE=1.0 takes another duration (s).  Processor time of this process, of a second run: the first compiles.
"""

from __future__ import annotations

import os
import time as clock
from typing import Any

import numpy as np
import pytest

import hybrid

pytestmark = pytest.mark.bench
LINES, CELLS, WIDTH, LENGTH, MASS = 20, 50, 0.02, 1.0, 0.4
DURATION = float(os.environ.get("HYBRID_PILE", "5.0"))


def pile(duration: float, lines: int = LINES, friction: float = 0.3) -> dict[str, Any]:
    """Ropes that nothing holds, level and straight, one two diameters above the other, turned anyhow."""
    section = {
        "length": LENGTH, "mass": MASS, "diameter": WIDTH, "axial_stiffness": 2e4, "bending_stiffness": 0.02,
        "damping": {"mass": 1.0},
    }  # fmt: skip
    bed = {"z": 0.0, "stiffness": 2e4, "damping": 20.0, "friction": friction}
    points: dict[str, Any] = {}
    ropes: dict[str, Any] = {}
    random = np.random.default_rng(1)
    for k in range(lines):
        angle, middle = random.uniform(0.0, np.pi), 0.1 * random.normal(size=2)
        along = 0.5 * LENGTH * np.array([np.cos(angle), np.sin(angle)])
        ends = [[*(middle + side * along).tolist(), WIDTH * (1.0 + 2.0 * k)] for side in (-1.0, 1.0)]
        points |= {f"{name}{k}": {"kind": "free", "initial_guess": at} for name, at in zip("ab", ends, strict=True)}
        ropes[f"rope{k}"] = {
            "start": f"a{k}", "end": f"b{k}", "sections": [section], "model": "rod", "mesh": {"cells": CELLS},
            "initial": {"kind": "points", "points": ends}, "contact": {"self": True, "friction": friction},
        }  # fmt: skip
    return {
        "environment": {"seabed": bed}, "points": points, "lines": ropes, "contact": {"friction": friction},
        "time": {"duration": duration, "step": 0.01}, "output": {"every": 0.05, "points": CELLS + 1},
    }  # fmt: skip


def test_a_pile_falls_on_a_bed() -> None:
    """At most 60 s; at the end the bed bears the weight of all."""
    hybrid.run(pile(0.01)).close()  # compiles
    begin, wall = clock.process_time(), clock.perf_counter()
    result = hybrid.run(pile(DURATION))
    took, wall = clock.process_time() - begin, clock.perf_counter() - wall
    lines = list(result.lines.values())
    steps = lines[0].steps
    borne = sum(float(x.contact_force[-1]) for x in lines)
    speed = max(float(np.linalg.norm(x.velocity[-1], axis=1).max()) for x in lines)
    high = max(float(x.position[-1, :, 2].max()) for x in lines)
    print(
        f"\n{LINES} lines of {CELLS} cells, {DURATION:g} s: {took:.1f} s of processor time, {wall:.1f} s on the clock; "
        f"{len(steps['t'])} steps, {int(steps['repeats'].sum())} repeated, {steps['iterations'].mean():.2f} iterations"
    )
    print(f"the bed bears {borne / (LINES * LENGTH * MASS * 9.81):.4f} of the weight, {high / WIDTH:.1f} diameters high, "
          f"{speed:.2g} m/s at most; {len(result.contacts())} pairs touched")  # fmt: skip
    print(sorted({(e.kind) for e in result.events}))
    for pair in result.contacts()[:3]:
        print(f"{pair.partner}: {pair.text}")
