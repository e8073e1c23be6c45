"""The motion of examples/plectoneme.yaml with cells and friction as given: processor time (s), steps, tension at the end (N).

    python bench/plectoneme_run.py CELLS FRICTION

Of the `hybrid` that Python finds: bench/test_bench_contact_speed.py runs it with that of another checkout, too.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import yaml

import hybrid

RUNS = 3


def main(cells: int, friction: float) -> None:
    tables = yaml.safe_load((Path(__file__).parents[1] / "examples" / "plectoneme.yaml").read_text())
    tables["mesh"]["cells"] = cells
    tables["contact"] = {"self": True} | ({"friction": friction} if friction else {})
    least, steps, tension = float("inf"), 0, 0.0
    for _ in range(1 + RUNS):  # the first compiles
        simulation = hybrid.Simulation(hybrid.validate_scene(tables))
        begin = time.process_time()
        simulation.advance(14.0)
        least = min(least, time.process_time() - begin)
        result = simulation.result()
        steps, tension = len(result.steps["t"]), float(result.tension[-1, -1])
    print(json.dumps([least, steps, tension]))


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
