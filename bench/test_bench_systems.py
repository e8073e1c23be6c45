"""Fifty random networks: how many equilibria are found, and in which time; a thousand lines in one file.

pytest bench/test_bench_systems.py -m bench -s
"""

from __future__ import annotations

import math
import time as clock
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError

COUNT, DEPTH = 50, 100.0

pytestmark = pytest.mark.bench


class Drawing:
    """A network that is drawn at random: 1 to 6 buoys, 0 to 2 submerged bodies, 2 to 14 lines; bed and current."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.points: dict[str, Any] = {}
        self.bodies: dict[str, Any] = {}
        self.lines: dict[str, Any] = {}
        centres = [*self._buoys(int(self.rng.integers(1, 7))), *self._bodies(int(self.rng.integers(0, 3)))]
        for name, centre in centres:
            for _ in range(int(self.rng.integers(1, 4))):
                if len(self.lines) < 11:
                    self._mooring(name, centre)
            if not any(name in self.owners(line) for line in self.lines.values()):
                self._mooring(name, centre)
        for _ in range(int(self.rng.integers(0, 3)) if len(centres) > 1 else 0):
            i, j = self.rng.choice(len(centres), 2, replace=False)
            (a, first), (b, second) = centres[i], centres[j]
            distance = float(np.linalg.norm(first - second))
            self._line(self._end(a), self._end(b), distance * self.uniform(1.02, 1.3))

    def uniform(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def owners(self, line: dict[str, Any]) -> set[str]:
        return {self.points[line[end]].get("body", line[end]) for end in ("start", "end")}

    def _centre(self) -> np.ndarray:
        return np.array([self.uniform(-60, 60), self.uniform(-60, 60), self.uniform(-60, -20)])

    def _buoys(self, count: int) -> list[tuple[str, np.ndarray]]:
        made = [(f"buoy{k}", self._centre()) for k in range(count)]
        for name, centre in made:
            mass = self.uniform(200, 1000)
            volume = mass / 1025 + self.uniform(8, 20)
            self.points[name] = {"initial_guess": centre.tolist(), "mass": mass, "volume": volume}
        return made

    def _bodies(self, count: int) -> list[tuple[str, np.ndarray]]:
        made = [(f"body{k}", self._centre()) for k in range(count)]
        for name, centre in made:
            mass = self.uniform(5e3, 5e4)
            self.bodies[name] = {
                "initial_guess": centre.tolist(), "initial_rotation": self.rng.uniform(-20, 20, 3).tolist(),
                "mass": mass, "inertia": [8.0 * mass] * 3, "centre": [0, 0, -1],
                "volume": mass / 1025 + self.uniform(30, 60), "centre_of_buoyancy": [0, 0, 0.5],
            }  # fmt: skip
        return made

    def _end(self, name: str) -> str:
        if name not in self.bodies:
            return name
        point, angle = f"{name} {len(self.points)}", self.uniform(0, 2 * math.pi)
        place = [2 * math.cos(angle), 2 * math.sin(angle), self.uniform(-2, 0)]
        self.points[point] = {"body": name, "place": place}
        return point

    def _mooring(self, name: str, centre: np.ndarray) -> None:
        angle, radius, anchor = self.uniform(0, 2 * math.pi), self.uniform(40, 150), f"anchor{len(self.lines)}"
        place = np.array([centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle), -DEPTH])
        self.points[anchor] = {"position": place.tolist()}
        self._line(anchor, self._end(name), float(np.linalg.norm(place - centre)) * self.uniform(0.98, 1.08))

    def _line(self, start: str, end: str, length: float) -> None:
        d = self.uniform(0.04, 0.08)
        section = {
            "length": length, "mass": self.uniform(2000, 7000) * 0.25 * math.pi * d * d, "diameter": d,
            "axial_stiffness": 10 ** self.uniform(7, 8.5), "drag": {"normal": 1.1},
        }  # fmt: skip
        ends = (start, end) if self.rng.random() < 0.5 else (end, start)
        line = {"start": ends[0], "end": ends[1], "sections": [section], "mesh": {"cells": 40}}
        self.lines[f"line{len(self.lines)}"] = line

    @property
    def scene(self) -> dict[str, Any]:
        current = [self.uniform(-1, 1), self.uniform(-0.5, 0.5), 0.0]
        environment: dict[str, Any] = {"fluid": {"density": 1025, "current": current}}
        if self.rng.random() < 0.6:
            environment["seabed"] = {"z": -DEPTH, "stiffness": 1e5}
        tables = {"environment": environment, "points": self.points, "lines": self.lines}
        return tables | ({"bodies": self.bodies} if self.bodies else {})


def test_a_thousand_lines_run(tmp_path: Path) -> None:
    """Written to a file, with 50 cells each."""
    count = 1000
    rope = {"length": 100, "mass": 5, "diameter": 0.04, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
    heave = {"heave": {"amplitude": 1, "period": 8}, "ramp": 8}
    points = {f"a{k}": {"position": [20.0 * k, 0, -80]} for k in range(count)}
    points |= {f"b{k}": {"position": [20.0 * k, 50, 0], "motion": heave} for k in range(count)}
    lines = {
        f"l{k}": {"start": f"a{k}", "end": f"b{k}", "sections": [rope], "mesh": {"cells": 50}} for k in range(count)
    }
    scene = {"environment": {"fluid": {"density": 1025}}, "points": points, "lines": lines}
    begin = clock.process_time()
    with hybrid.run(scene | {"time": {"duration": 2.0, "step": 0.1}}, tmp_path / "many.h5") as result:
        print(f"\n{count} lines of 50 cells, 20 steps: {clock.process_time() - begin:.1f} s of processor time")
        assert result.status == "complete" and len(result.lines) == count


def test_equilibria_of_random_systems() -> None:
    found, times = 0, []
    print()
    for seed in range(COUNT):
        scene = Drawing(seed).scene
        begin = clock.process_time()
        try:
            hybrid.static(scene)
            found += 1
        except ComputationError as error:
            assert "line" in str(error)
            print(f"system {seed}, {len(scene['lines'])} lines: {str(error).splitlines()[0]}")
        times.append(clock.process_time() - begin)
    print(f"{found} of {COUNT} found; median {np.median(times):.2f} s, most {max(times):.1f} s of processor time")
    assert found >= 0.9 * COUNT and np.median(times) <= 0.3
