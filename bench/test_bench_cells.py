"""Level C: curvature within 5 % of its largest everywhere and always, at the least CPU time of a whole run with file.

Cells that follow against uniform rods, and against the best of five meshes of rods that an expert would grade for the
very run: from the curvature of a fine rod, as short at every place as it needs at any time.

pytest bench/test_bench_cells.py -m bench -s -k touchdown
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from test_bench_adaptive import bight as bight_of_tether

import hybrid

EXAMPLES = Path(__file__).parents[1] / "examples"
pytestmark = pytest.mark.bench

LEVEL = {"curvature": 0.05, "position": 1e-3, "tension": 0.01}  # of the largest, of the length, of the mean pull
REPEATS = 3
SHARES = (0.05, 0.03, 0.02)  # curvature_error of cells that follow
GRADED = (0.08, 0.05, 0.035, 0.025, 0.015)  # the same of the five graded meshes

DRIFT: dict[str, Any] = {
    "environment": {"fluid": {"density": 1025}, "seabed": {"z": -500, "stiffness": 5.0e3, "damping": 5.0e2}},
    "cable": {
        "sections": [
            {
                "length": 2000, "diameter": 0.05, "mass": 20, "axial_stiffness": 2.0e8, "bending_stiffness": 2.0e4,
                "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
            }
        ]
    },
    "ends": {
        "start": {"kind": "pinned", "position": [0, 0, -500]},
        "end": {
            "kind": "pinned", "position": [1650, 0, 0],
            "motion": {"velocity": [0.8, 0, 0], "heave": {"amplitude": 1.0, "period": 10}, "ramp": 20},
        },
    },
    "initial": "equilibrium",
    "time": {"duration": 300.0, "step": 0.2},
    "output": {"every": 2, "points": 1001, "errors": False},
}  # fmt: skip


def scene_of(what: dict[str, Any], model: Any, mesh: dict[str, Any]) -> hybrid.Scene:
    """A dictionary with another model and mesh."""
    return hybrid.validate_scene(what | {"model": model, "mesh": mesh})


def from_file(name: str, *sets: str) -> Callable[[], dict[str, Any]]:
    """An example with other values."""

    def read() -> dict[str, Any]:
        return hybrid.load_scene(EXAMPLES / name, sets).model_dump(exclude_unset=True, mode="json")

    return read


def drifting(**section: float) -> Callable[[], dict[str, Any]]:
    """A line of 2000 m whose upper end drifts off and heaves."""
    (given,) = DRIFT["cable"]["sections"]
    return lambda: DRIFT | {"cable": {"sections": [given | section]}}


def surging() -> dict[str, Any]:
    """The same line, whose upper end stays where it is but for surge and heave."""
    start, end = DRIFT["ends"]["start"], DRIFT["ends"]["end"]
    motion = {"surge": {"amplitude": 8.0, "period": 40}, "heave": {"amplitude": 2.0, "period": 10}, "ramp": 20}
    return DRIFT | {"ends": {"start": start, "end": end | {"motion": motion}}, "time": {"duration": 120.0, "step": 0.2}}


def bight() -> dict[str, Any]:
    """1000 m of tether with a slack bight at its vehicle."""
    return bight_of_tether() | {"output": {"every": 1.0, "points": 2001, "errors": False}}


class Case(NamedTuple):
    """A scene of the table in issue 15, and what cells that follow are to gain there."""

    scene: Callable[[], dict[str, Any]]
    fine: int  # rods of the run that all are compared with
    uniform: Sequence[int]  # rods of uniform meshes, in increasing number
    base: int  # base cells of cells that follow
    gain: tuple[float, float]  # over uniform, over graded rods


TOUCHDOWN = ("time.duration=60", "output={errors: false, points: 1001, every: 0.5}")
CASES = {
    "touchdown": Case(from_file("touchdown.yaml", *TOUCHDOWN), 2000, (200, 400, 600, 800), 24, (10.0, 2.5)),
    "surge": Case(surging, 6400, (800, 1200, 1600, 2100), 32, (25.0, 2.0)),
    "drift": Case(drifting(), 6400, (800, 1200, 1600), 32, (15.0, 5.0)),
    "thin_drift": Case(drifting(bending_stiffness=2.7e3), 12800, (2400, 3200, 4800), 32, (30.0, 8.0)),
    "laying": Case(
        from_file("laying.yaml", "output={errors: false, points: 1601, every: 0.5}"), 3200, (600, 1200, 1600), 32,
        (12.0, 2.5),
    ),
    "bight": Case(bight, 6000, (750, 1500, 3000), 32, (20.0, 1.7)),
}  # fmt: skip


class Measured(NamedTuple):
    """A run: its mean number of cells, CPU time (s), errors of curvature, position and pull over what `LEVEL` is of."""

    cells: float
    cpu: float
    curvature: float
    position: float
    tension: float

    @property
    def reaches(self) -> bool:
        return all(getattr(self, name) <= most for name, most in LEVEL.items())


def measured(scene: hybrid.Scene, truth: hybrid.Result, folder: Path) -> Measured:
    """The median CPU time of whole runs with their files, and the errors from the second output on."""
    spent = []
    for _ in range(REPEATS):
        path = folder / "run.h5"
        path.unlink(missing_ok=True)
        begin = time.process_time()
        found = hybrid.run(scene, path)
        spent.append(time.process_time() - begin)
    curvature = np.abs(found.curvature - truth.curvature)[2:].max() / truth.curvature.max()
    position = np.linalg.norm(found.position - truth.position, axis=-1)[2:].max() / np.ptp(truth.s)
    pull = np.abs(found.tension - truth.tension)[2:, -1].max() / truth.tension[:, -1].mean()
    cells = np.mean([mesh.kinds.size for mesh in found.mesh])
    found.close()
    return Measured(float(cells), float(np.median(spent)), float(curvature), float(position), float(pull))


def graded(truth: hybrid.Result, share: float) -> list[float]:
    """Nodes of rods that interpolate the curvature of all outputs within a share of its largest."""
    s, k = truth.s, truth.curvature
    bend = np.abs(np.gradient(np.gradient(k, s, axis=1), s, axis=1)).max(axis=0)
    length = np.ptp(s)
    with np.errstate(divide="ignore"):
        wanted = np.clip(np.sqrt(8.0 * share * k.max() / bend), 2.0 * np.diff(s).min() * share**0.5, length / 60.0)
    step = np.diff(s)
    for i in range(1, s.size):
        wanted[i] = min(wanted[i], wanted[i - 1] + 0.3 * step[i - 1])
    for i in range(s.size - 2, -1, -1):
        wanted[i] = min(wanted[i], wanted[i + 1] + 0.3 * step[i])
    number = np.concatenate([[0.0], np.cumsum(step * 0.5 * (1.0 / wanted[1:] + 1.0 / wanted[:-1]))])
    nodes = np.interp(np.linspace(0.0, number[-1], int(np.ceil(number[-1])) + 1), number, s)
    return [float(x) for x in nodes]


def best(name: str, runs: dict[str, Measured]) -> Measured | None:
    """The cheapest that reaches the level, after all are shown."""
    for title, x in runs.items():
        print(
            f"{name}: {title:24s} {x.cells:6.0f} cells, {x.cpu:6.2f} s of CPU; curvature {100 * x.curvature:5.1f} %, "
            f"pull {100 * x.tension:.3f} %, position {x.position:.1e}{'' if x.reaches else '  misses level C'}"
        )
    return min((x for x in runs.values() if x.reaches), key=lambda x: x.cpu, default=None)


@pytest.mark.parametrize("name", CASES)
def test_level_c(name: str, tmp_path: Path) -> None:
    """What cells that follow gain is at least what issue 15 asks for; where none of the others gets there, the dearest

    of those counts that were tried.
    """
    case = CASES[name]
    what = case.scene()
    hybrid.run(scene_of(what, "rod", {"cells": 60}))
    hybrid.run(scene_of(what, {"kind": "adaptive", "curvature_error": 0.05}, {"cells": case.base}))  # compiles
    truth = hybrid.run(scene_of(what, "rod", {"cells": case.fine}))

    def run(model: Any, mesh: dict[str, Any]) -> Measured:
        return measured(scene_of(what, model, mesh), truth, tmp_path)

    follow = best(name, {
        f"cells that follow, {x}": run({"kind": "adaptive", "curvature_error": x}, {"cells": case.base}) for x in SHARES
    })  # fmt: skip
    uniform = {f"rod, {n}": run("rod", {"cells": n}) for n in case.uniform}
    by_hand = {f"rod, graded for {x}": run("rod", {"nodes": graded(truth, x)}) for x in GRADED}
    assert follow is not None, "cells that follow do not reach level C"
    missed = []
    for title, runs, least in (("uniform", uniform, case.gain[0]), ("graded", by_hand, case.gain[1])):
        other = best(name, runs)
        gain = (other or max(runs.values(), key=lambda x: x.cpu)).cpu / follow.cpu
        reached = "" if other else " (which misses level C)"
        print(f"{name}: {title} rods{reached} / cells that follow: {gain:.2f} times the CPU time, asked {least}")
        if gain < least:
            missed.append(f"{title}: {gain:.2f} instead of {least}")
    assert not missed, "; ".join(missed)
