"""What an accuracy costs when it is loosened: tethers with a float, with a float pack, and of 3000 m with a slack bend.

    pytest bench/test_bench_loosening.py -m bench -n 0 -s

CPU time is that of all runs, from the scene to the closed file, the median of ROUNDS after a first run that loads what
is needed.  Errors are the figures of end forces over what is asked of them; LOOSER and SPARE are asked of the project.
"""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest
import yaml

import hybrid

pytestmark = pytest.mark.bench
ROOT = Path(__file__).parents[1]
SCENES = {
    "rov_tether": ROOT / "examples" / "rov_tether.yaml",
    "float_pack_tension": ROOT / "tests" / "data" / "defects" / "float_pack_tension.yaml",
    "long_s_tether": ROOT / "tests" / "data" / "defects" / "long_s_tether.yaml",
}
ASKED, ROUNDS = (10.0, 5.0, 2.0, 1.0), 3  # per cent
LOOSER, SPARE = 1.5, 3.0  # times as much for the next finer accuracy, times better than asked at most


def scene(name: str, percent: float) -> dict[str, Any]:
    """Without its own step and model."""
    found: dict[str, Any] = yaml.safe_load(SCENES[name].read_text())
    found.pop("model", None)
    accuracy = {"position": f"{percent:g}%", "tension": f"{percent:g}%"}
    return found | {"time": {"duration": found["time"]["duration"]}, "accuracy": accuracy}


@pytest.mark.parametrize("name", SCENES)
def test_an_accuracy_that_is_looser_costs_less(name: str, tmp_path: Path) -> None:
    hybrid.run(scene(name, ASKED[0]), tmp_path / "run.h5").close()
    costs = []
    print(f"\n{name}")
    for percent in ASKED:
        spent = []
        for k in range(ROUNDS):
            begin = time.process_time()
            result = hybrid.run(scene(name, percent), tmp_path / "run.h5")
            if k < ROUNDS - 1:
                result.close()
            spent.append(time.process_time() - begin)
        with result:
            forces = [np.linalg.norm(result[x], axis=1).max() for x in ("reaction_start", "reaction_end")]
            part = result.attributes["error_total_end_force"] / (percent / 100.0 * max(forces))
            said = sorted(
                {e.kind for e in result.events} & {"accuracy missed", "error uncertain", "irregular motion", "snaps"}
            )
            cells, steps, runs = result.attributes["cells"], len(result["steps/t"]), result.attributes["effort_runs"]
        costs.append(median(spent))
        ratio = f"{costs[-1] / costs[-2]:.2f} times the one before" if len(costs) > 1 else ""
        spare = "" if 1.0 / SPARE <= part <= 1.0 else "(asked: 0.33 to 1)"
        print(
            f"{percent:4g} %: {costs[-1]:.2f} s, {cells} x {steps}, {runs} runs, figure/asked {part:.2f} {spare} {said} {ratio}"
        )
    steep = [b / a for a, b in pairwise(costs)]
    print(f"cost rises by {min(steep):.2f} to {max(steep):.2f} (asked: {LOOSER:g} or more each time)")
