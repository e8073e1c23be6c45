"""Equilibria of 200 random three-leg moorings: how many are right, wrong, refused, and what they cost.

    pytest bench/test_bench_system_statics.py -m bench -s -n 0

A buoy floats on three legs, of rods or catenaries, over a level or sloping bed, in still water or a current.  An
equilibrium is wrong where its largest tension is more than 5 % off that of the same mooring on 4 times the cells, where
a rod folds by more than a right angle from one cell to the next, or where a catenary is compressed.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError

pytestmark = pytest.mark.bench
SCENES, CELLS, FINER, SAME = 200, 40, 4, 0.05


def mooring(seed: int, cells: int) -> dict[str, Any]:
    """Legs of 1.01 to 1.3 times the distance to their anchors, over 10 to 100 m of water, weight and stiffness to match."""
    rng = np.random.default_rng(seed)
    depth, rod = float(rng.uniform(10, 100)), bool(rng.random() < 0.5)
    radius, longer = depth * float(rng.uniform(0.6, 1.8)), float(rng.uniform(1.01, 1.3))
    length = longer * float(np.hypot(radius, depth))
    slope = [float(x) for x in rng.uniform(-0.1, 0.1, 2)] if rng.random() < 0.5 else [0.0, 0.0]
    current = [float(rng.choice([0.0, 0.3, 0.6])), 0.0, 0.0]
    EI = float(8.0 * 9.81 * depth**3 * 10 ** rng.uniform(-6.5, -3.0))
    section: dict[str, Any] = {
        "length": length, "mass": 8.0, "diameter": 0.05, "axial_stiffness": 5e6, "drag": {"normal": 1.2},
    }  # fmt: skip
    points: dict[str, Any] = {
        "buoy": {"mass": 800.0, "volume": 6.0, "drag_area": 2.0, "initial_guess": [0, 0, -2]},
    }  # fmt: skip
    turn = float(rng.uniform(0, 2 * np.pi))
    for k in range(3):
        angle = turn + 2.0 * np.pi * k / 3.0 + float(rng.uniform(-0.2, 0.2))
        x, y = radius * float(np.cos(angle)), radius * float(np.sin(angle))
        points[f"a{k}"] = {"position": [x, y, -depth + slope[0] * x + slope[1] * y]}
    model = "rod" if rod else {"kind": "catenary", "slack": "warn"}
    line = {
        "sections": [section | ({"bending_stiffness": EI} if rod else {})],
        "model": model,
        "mesh": {"cells": cells},
    }
    return {
        "environment": {
            "fluid": {"density": 1025, "surface": 0.0, "current": current},
            "seabed": {"z": -depth, "stiffness": 3000.0, "slope": slope},
        },
        "points": points,
        "lines": {f"l{k}": line | {"start": f"a{k}", "end": "buoy"} for k in range(3)},
    }  # fmt: skip


def solved(scene: dict[str, Any]) -> tuple[float, set[str]]:
    """Largest tension, N, and what is wrong with the lines; ComputationError: refused."""
    found = hybrid.static(scene)
    largest, flaws = -np.inf, set[str]()
    for line in found.lines.values():
        T, kinds = np.ravel(line.tension), {event.kind for event in line.events}
        d = np.diff(line.position[-1], axis=0)
        if (np.einsum("ij,ij->i", d[1:], d[:-1]) < 0.0).any():
            flaws.add("folded")
        if T.min() < 0.0 and scene["lines"]["l0"]["model"] != "rod":
            flaws.add("slack, said" if "slack" in kinds else "slack in silence")
        largest = max(largest, float(T.max()))
    return largest, flaws


def test_two_hundred_moorings_rest_as_they_would(capsys: pytest.CaptureFixture[str]) -> None:
    wrong, said, refused, unknown, cpu = list[str](), list[str](), list[str](), list[int](), list[float]()
    for seed in range(SCENES):
        begin = time.process_time()
        try:
            largest, flaws = solved(mooring(seed, CELLS))
        except ComputationError as error:
            refused.append(f"{seed}: {str(error).splitlines()[0]}")
            continue
        finally:
            cpu.append(time.process_time() - begin)
        try:
            off = largest / solved(mooring(seed, FINER * CELLS))[0] - 1.0
        except ComputationError:
            unknown.append(seed)
            off = 0.0
        text = f"{seed}: {largest:.1f} N, {100 * off:+.1f} %, {', '.join(flaws) or 'no flaw'}"
        if abs(off) > SAME or flaws - {"slack, said"}:
            wrong.append(text)
        elif flaws:
            said.append(text)
    with capsys.disabled():
        print(f"\n{SCENES} moorings: {len(wrong)} wrong, {len(said)} slack with a word, {len(refused)} refused, "
              f"{len(unknown)} refused on {FINER} times the cells; CPU {np.median(cpu):.3f} s in the median, "
              f"{max(cpu):.2f} s at most")  # fmt: skip
        for text in (*wrong, *said, *refused, *(f"{seed}: finer one refused" for seed in unknown)):
            print("  ", text)
    assert not wrong
    assert len(refused) + len(unknown) <= 0.02 * SCENES
