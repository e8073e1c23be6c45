"""What it costs to look after every step whether lines meet; random throws of lines that touch each other.

python -m pytest bench/test_bench_lines_watch.py -m bench -n 0 -q -s
"""

from __future__ import annotations

import os
import time as clock
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.model.obstacles import stiffness_at_impact
from hybrid.simulation import lines_contact
from tests.validation.thrown_lines import WIDTH, section, straight, throw

pytestmark = pytest.mark.bench

CELLS, RUNS = 100, 5
THROWS = int(os.environ.get("HYBRID_THROWS", "100"))
FIRST_THROW = int(os.environ.get("HYBRID_FIRST_THROW", "0"))


def hanging(gap: float, count: int, **more: Any) -> dict[str, Any]:
    """Lines side by side, every other one of which goes up and down at one end; gap: m between them."""
    section = {"length": 12.0, "mass": 2.0, "diameter": 0.05, "axial_stiffness": 1e5, "damping": {"mass": 0.2}}
    points: dict[str, Any] = {}
    for k in range(count):
        points[f"a{k}"] = {"position": [0, gap * k, 0]}
        points[f"b{k}"] = {"position": [10, gap * k, 0]}
        if k % 2 == 0:
            points[f"a{k}"]["motion"] = {"heave": {"amplitude": 0.2, "period": 1.0}, "ramp": 1.0}
    lines = {
        f"l{k}": {
            "start": f"a{k}",
            "end": f"b{k}",
            "sections": [section],
            "model": "catenary",
            "mesh": {"cells": CELLS},
        }
        for k in range(count)
    }
    time, output = {"duration": 4.0, "step": 0.02}, {"every": 1.0, "points": 11}
    return {"points": points, "lines": lines, "time": time, "output": output} | more


def cpu(tables: dict[str, Any]) -> float:
    begin = clock.process_time()
    hybrid.run(tables).close()
    return clock.process_time() - begin


@pytest.mark.parametrize("count", [20, 100])
def test_watching_that_finds_nothing(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every line beside every other one: contact would begin between any two of them."""
    tables = hanging(1.0, count)
    cpu(tables)  # compiles
    on, off = [], []
    for _ in range(RUNS):
        on.append(cpu(tables))
        with monkeypatch.context() as patch:
            patch.setattr(lines_contact, "watched_pairs", lambda *_: np.zeros((0, 2), np.int64))
            off.append(cpu(tables))
    print(f"\n{count} lines of {CELLS} cells: watched {min(on):.3f} s, not {min(off):.3f} s, {min(on) / min(off):.3f}")
    assert min(on) < 1.1 * min(off)


MESH = Path(__file__).parents[1] / "tests" / "data" / "angle.obj"


def underneath(random: np.random.Generator, speed: float) -> dict[str, Any]:
    """One to three obstacles under lines that come down: balls, pipes, boxes, rings and bars of triangles, turned anyhow.

    speed: m/s, of the fastest line, by which they are as stiff as a scene with that speed makes them.
    """
    found: dict[str, Any] = {}
    for k in range(int(random.integers(1, 4))):
        size, turn = float(random.uniform(0.03, 0.15)), random.uniform(-180, 180, 3).tolist()
        axis, kind = random.normal(size=3).tolist(), str(random.choice(["sphere", "cylinder", "box", "torus", "mesh"]))
        shape: dict[str, Any] = {
            "sphere": {"radius": size},
            "cylinder": {"radius": 0.5 * size, "axis": axis, "length": 1.7 * size},
            "box": {"size": [size, size, 1.5 * size], "rounding": 0.1 * size, "rotation": turn},
            "torus": {"ring": 0.8 * size, "radius": 0.3 * size, "axis": axis},
            "mesh": {"file": str(MESH), "scale": 0.1 * size, "rotation": turn},
        }[kind]
        low = -1.5 * size - 2.0 * WIDTH  # nothing of it is above the lowest line
        at = [*(0.2 * random.normal(size=2)).tolist(), low]
        found[f"o{k}"] = shape | {
            "kind": kind,
            "at": at,
            "friction": float(random.uniform(0.0, 0.6)),
            "stiffness": stiffness_at_impact(section(1.0)["mass"], speed, WIDTH),
        }
    return found


@pytest.mark.parametrize("among", ["each other", "obstacles"])
def test_random_throws(among: str) -> None:
    """Two to four lines, one above the other across each other, fly together at 2 to 20 m/s in steps of 0.3 to 10 diameters,

    or two to five down on obstacles.

    Prints how many gain energy, come nearer than 0.9 diameters (of the curves that touch, which cut the corners of polygons
    by up to 0.2) and than 0.5 (of polygons, on the way too), or fail.
    """
    gains, near, through, failed, met, deep, deepest = 0, 0, 0, 0, 0, 0, -np.inf
    below = among == "obstacles"
    for seed in range(FIRST_THROW, FIRST_THROW + THROWS):
        random = np.random.default_rng(seed)
        count, speed = (
            int(random.integers(2, 6 if below else 5)),
            float(np.exp(random.uniform(np.log(2.0), np.log(20.0)))),
        )
        step, friction = float(np.exp(random.uniform(np.log(0.3), np.log(10.0)))), random.uniform(0.0, 0.6)
        shapes, speeds = [], []
        for k in range(count):
            angle = np.pi * k / count + random.uniform(-0.2, 0.2)
            middle = np.append(0.1 * random.normal(size=2), 3.0 * WIDTH * k)
            shapes.append(straight(1.0, middle, np.array([np.cos(angle), np.sin(angle), 0.0]), 40))
            down = speed * (1.0 + 0.3 * k if below else k)
            speeds.append(np.tile(np.append(0.2 * speed * random.normal(size=2), -down), (41, 1)))
        fastest = max(float(np.linalg.norm(v[0])) for v in speeds)
        obstacles = underneath(random, fastest) if below else None
        duration = 20.0 * WIDTH / speed * max(1.0, step)
        try:
            found = throw(shapes, speeds, step * WIDTH / speed, duration, friction, obstacles=obstacles)
        except AssertionError as error:
            failed += 1
            print(f"throw {seed}: {error}")
            continue
        met += bool(found.shared.met())
        gains += max(found.energies) > 1.001 * found.energies[0]
        deep, deepest = deep + (found.deepest > 1.0), max(deepest, found.deepest)
        if found.deepest > 1.0 or found.apart < 0.9 * WIDTH:
            least = f"{found.apart / WIDTH:.3f} D, of polygons {found.least / WIDTH:.3f} D"
            print(f"throw {seed}: {speed:.3g} m/s, least {least}, {found.deepest:.3g} radii deep")
        near, through = near + (found.apart < 0.9 * WIDTH), through + (found.least < 0.5 * WIDTH)
    print(
        f"\n{THROWS} throws: {met} touch, {failed} fail, {gains} gain energy, {near} nearer than 0.9 D, {through} than 0.5 D; "
        f"in obstacles {deep} too deep, at most {deepest:.2g}"
    )
    assert failed == through == deep == 0
    assert gains <= 0.01 * THROWS
