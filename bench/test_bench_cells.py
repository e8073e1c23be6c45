"""Cells that follow the curvature against uniform rods: cells, processor time and errors against a fine rod.

pytest bench/test_bench_cells.py -m bench -s
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid

EXAMPLES = Path(__file__).parents[1] / "examples"
pytestmark = pytest.mark.bench

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


def touchdown(model: Any, cells: int) -> hybrid.Scene:
    """The example in heave for 60 s."""
    sets = ["output={errors: false, points: 1001, every: 0.5}", "time.duration=60", f"mesh={{cells: {cells}}}"]
    return hybrid.load_scene(
        EXAMPLES / "touchdown.yaml", [*sets, f"model={model if isinstance(model, str) else str(model)}"]
    )


def drift(model: Any, cells: int) -> hybrid.Scene:
    """A line of 2000 m whose upper end drifts off and heaves; the layer at the touchdown is 1 m long."""
    return hybrid.validate_scene(DRIFT | {"model": model, "mesh": {"cells": cells}})


CASES: dict[str, Any] = {
    "touchdown, 250 m": (touchdown, 250, 2000, (100, 400, 800), 24),
    "drift, 2000 m": (drift, 2000, 6400, (200, 800, 1200, 1600), 32),
}


@pytest.mark.parametrize("name", CASES)
def test_cells_that_follow(name: str) -> None:
    """Position and pull are errors over the length and the mean; the field of curvature is over its largest."""
    scene, length, fine, uniform, base = CASES[name]
    hybrid.run(scene("rod", 100))
    hybrid.run(scene({"kind": "adaptive", "curvature_error": 0.05}, base))  # compiles
    truth = hybrid.run(scene("rod", fine))

    def show(title: str, of: hybrid.Scene) -> None:
        begin = time.process_time()
        found = hybrid.run(of)
        spent = time.process_time() - begin
        most = truth.curvature.max()
        field = np.abs(found.curvature - truth.curvature)[2:]
        pull = np.abs(found.tension - truth.tension)[2:, -1].max() / truth.tension[:, -1].mean()
        position = np.linalg.norm(found.position - truth.position, axis=-1)[2:].max() / length
        cells = np.mean([mesh.kinds.size for mesh in found.mesh])
        print(
            f"{name}: {title:24s} {cells:6.0f} cells, {spent:5.2f} s of CPU; curvature {100 * field.max() / most:4.1f} "
            f"% (rms {100 * np.sqrt((field**2).mean()) / most:.2f}), pull {100 * pull:.3f} %, position {position:.1e}"
        )

    for cells in uniform:
        show(f"rod, {cells}", scene("rod", cells))
    following = {"kind": "adaptive", "force_rod": [[0, length]]}
    for error in (0.05, 0.03):
        show(f"rods that follow, {error}", scene(following | {"curvature_error": error}, base))
    for error in (0.05, 0.03):
        show(f"kinds and cells, {error}", scene({"kind": "adaptive", "curvature_error": error}, base))
