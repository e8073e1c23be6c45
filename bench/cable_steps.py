"""Processor time of a step of one cable, us, by cells, kind and dimension: printed as JSON, for whatever `hybrid` is imported.

python bench/cable_steps.py
"""

from __future__ import annotations

import json
from typing import Any

import hybrid

CELLS, KINDS, DIMENSIONS = (20, 100, 1000), ("catenary", "rod"), (2, 3)
STEPS = {20: 4000, 100: 1500, 1000: 150}


def scene(cells: int, kind: str, dimension: int) -> dict[str, Any]:
    """A pinned line of 100 m in water, one end of which heaves by 0.5 m; fixed steps of 0.02 s."""
    section = {"length": 100.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    section |= {"drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
    section |= {"bending_stiffness": 50.0, "torsional_stiffness": 40.0} if kind == "rod" else {}
    heave = {"heave": {"amplitude": 0.5, "period": 5.0}, "ramp": 5.0}
    return {
        "environment": {"fluid": {"density": 1025.0}},
        "cable": {"sections": [section]},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, 0]},
            "end": {"kind": "pinned", "position": [80, 0, 0], "motion": heave},
        },
        "model": kind, "dimension": dimension, "mesh": {"cells": cells}, "initial": "equilibrium",
        "time": {"duration": 0.02 * STEPS[cells], "step": 0.02},
        "output": {"every": 0.01 * STEPS[cells]},
    }  # fmt: skip


def main() -> None:
    found = {}
    for cells in CELLS:
        for kind in KINDS:
            for dimension in DIMENSIONS:
                data = scene(cells, kind, dimension)
                for _ in range(2):  # the first one warms caches
                    result = hybrid.run(data, progress=False)
                    cpu = result["steps/cpu"]
                    found[f"{cells} {kind} {dimension}D"] = 1e6 * float(cpu[-1]) / len(cpu)
                    result.close()
    print(json.dumps(found))


if __name__ == "__main__":
    main()
