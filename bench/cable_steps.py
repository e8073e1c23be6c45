"""Processor time of a step of one cable, us, or of a run, ms, of any `hybrid`: a case a line in, a time a line out.

echo "100 rod 3" | python bench/cable_steps.py       # a step
echo "100 rod 3 200" | python bench/cable_steps.py   # a run of 200 steps, from the scene to the closed file
python bench/cable_steps.py plane

The last compares the plane with space, in one process: medians of turns, and of the plane also without the small push
out of it that a run carries along.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import hybrid
from hybrid.simulation.lone_planes import LonePlane

CELLS, KINDS, DIMENSIONS = (20, 100, 1000), ("catenary", "rod", "zones"), (2, 3)
STEPS = {20: 20_000, 100: 5_000, 1000: 500}  # 0.1 s at least: the clock is read each 0.01 s
CASES = [f"{cells} {kind} {dimension}" for cells in CELLS for kind in KINDS for dimension in DIMENSIONS]
RUN_STEPS = 200
RUNS = [
    f"{n} {kind} {dim} {RUN_STEPS}" for n in (20, 100, 400, 1000) for kind in (*KINDS, "payout") for dim in DIMENSIONS
]
RUNS += [f"20 follows {dim} {RUN_STEPS}" for dim in DIMENSIONS]


MODELS = {"zones": "adaptive", "payout": "rod", "follows": {"kind": "adaptive", "curvature_error": 0.05}}


def scene(cells: int, kind: str, dimension: int, steps: int) -> dict[str, Any]:
    """A pinned line of 100 m in water, one end of which heaves by 0.5 m; fixed steps of 0.02 s.

    kind: catenary, rod, zones that move, a rod that is paid out as its end heaves, or cells that follow, of whatever
    number they are.  Extremes of all steps are kept, as by default.
    """
    section = {"length": 100.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    section |= {"drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
    section |= {"bending_stiffness": 50.0, "torsional_stiffness": 40.0} if kind != "catenary" else {}
    end = {
        "kind": "pinned",
        "position": [80, 0, 0],
        "motion": {"heave": {"amplitude": 0.5, "period": 5.0}, "ramp": 5.0},
    }
    end |= {"payout": {"rate": 0.2, "ramp": 1.0, "longest": 110.0}} if kind == "payout" else {}
    return {
        "environment": {"fluid": {"density": 1025.0}},
        "cable": {"sections": [section]},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, 0]},
            "end": end,
        },
        "model": MODELS.get(kind, kind), "dimension": dimension, "initial": "equilibrium",
        "time": {"duration": 0.02 * steps, "step": 0.02},
        "output": {"every": 0.01 * steps},
    } | ({"mesh": {"cells": cells}} if kind != "follows" else {})  # fmt: skip


def step(cells: int, kind: str, dimension: int) -> float:
    """Microseconds a step, without the first tenth of them."""
    with hybrid.run(scene(cells, kind, dimension, STEPS[cells]), progress=False) as result:
        cpu = result["steps/cpu"]
        first = len(cpu) // 10
        return 1e6 * float(cpu[-1] - cpu[first]) / (len(cpu) - 1 - first)


def run(cells: int, kind: str, dimension: int, steps: int, folder: Path) -> float:
    """Milliseconds of a run with its file."""
    data = scene(cells, kind, dimension, steps)
    start = time.process_time()
    hybrid.run(data, folder / "run.h5", progress=False).close()
    return 1e3 * (time.process_time() - start)


def plane_beside_space(turns: int = 9) -> None:
    """Medians of steps in the plane, in it without a push, and in space, and their ratios to space."""
    begin = LonePlane.begin

    def unpushed(self: LonePlane, *args: Any) -> None:
        begin(self, *args)
        self.speed = 0.0

    for cells in CELLS:
        for kind in KINDS:
            took = []
            for _ in range(turns):
                row = []
                for dimension, how in ((2, begin), (2, unpushed), (3, begin)):
                    setattr(LonePlane, "begin", how)  # noqa: B010
                    row.append(step(cells, kind, dimension))
                took.append(row)
            setattr(LonePlane, "begin", begin)  # noqa: B010
            plane, alone, space = np.median(took, axis=0)
            print(
                f"{cells:5} {kind:9} {plane:7.1f} {alone:7.1f} {space:7.1f} us, {plane / space:.2f}, {alone / space:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    if sys.argv[1:] == ["plane"]:
        plane_beside_space()
        sys.exit()
    with tempfile.TemporaryDirectory() as folder:
        for case in sys.stdin:
            cells, kind, dimension, *steps = case.split()
            args = int(cells), kind, int(dimension)
            print(run(*args, int(steps[0]), Path(folder)) if steps else step(*args), flush=True)
