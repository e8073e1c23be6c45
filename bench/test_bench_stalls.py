"""Runs that stalled: what contact of a line with itself costs where nothing touches, and whether error figures hold.

    pytest bench/test_bench_stalls.py -m bench -s

Processor time of this process, kernels compiled; ratios are taken within one run, the smaller of two each.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

import hybrid

pytestmark = pytest.mark.bench
DEFECTS = Path(__file__).parents[1] / "tests" / "data" / "defects"
ALONE = "contact={self: false}"


def ran(name: str, *sets: str, times: int = 2) -> tuple[float, hybrid.Result]:
    """The least processor time, s, of some runs of a scene, and the last result."""
    least, scene = np.inf, hybrid.load_scene(DEFECTS / f"{name}.yaml", [*sets])
    for _ in range(times):
        begin = time.process_time()
        result = hybrid.run(scene, progress=False)
        least = min(least, time.process_time() - begin)
    return least, result


def told(result: hybrid.Result) -> str:
    return ", ".join(sorted({event.kind for event in result.events})) or "nothing"


def test_long_s_tether() -> None:
    """At defaults; the truth: the same with a tenth of the errors asked for, on rods."""
    ran("long_s_tether", "time.duration=1", times=1)  # compiled
    cpu, result = ran("long_s_tether")
    _, truth = ran("long_s_tether", "model=rod", "accuracy={curvature: 0.2%, position: 0.03 m}", times=1)
    print(
        f"\nlong_s_tether: {cpu:.2f} s of CPU, {result.attributes['effort_runs']} runs, {result.attributes['cells']} cells"
    )
    for name in ("position", "tension", "curvature"):
        off = np.asarray(result[name]) - np.asarray(truth[name])
        off = np.linalg.norm(off, axis=-1) if off.ndim == 3 else np.abs(off)
        figure = float(np.nanmax(result[f"errors/total/{name}"]))
        print(f"{name}: off by {off.max():.3g}, figure {figure:.3g}, {figure / off.max():.2f} of it")
    print(f"told: {told(result)}")
    assert cpu < 2.0


@pytest.mark.parametrize("name", ["contact_stalls_accuracy", "line_break_with_contact"])
def test_cost_of_contact_that_is_not_there(name: str) -> None:
    """What is computed by default, over the same without contact."""
    lines = [f"lines.l{k}.contact={{self: false}}" for k in (1, 2, 3)]
    cpu, result = ran(name)
    alone, _ = ran(name, *(lines if name.startswith("line") else [ALONE]))
    print(f"\n{name}: {cpu:.1f} s of CPU, {alone:.1f} without contact: {cpu / alone:.2f}; told: {told(result)}")
    assert cpu < 1.3 * alone


def test_cost_while_nothing_is_near() -> None:
    """The watch of a tether that is bent, and never within 100 diameters of itself: 120 s in 600 equal steps."""
    fixed = ("model=rod", "mesh={cells: 1000}", "accuracy=null", "time={duration: 120, step: 0.2}")
    each = [[ran("long_s_tether", *fixed, *more, times=1)[0] for more in ((), (ALONE,))] for _ in range(6)]
    both = np.min(each, axis=0)  # in turn, so that what else the machine does counts for both
    print(f"\nwatched: {both[0]:.2f} s of CPU, without contact {both[1]:.2f}: {both[0] / both[1]:.3f}")
    assert both[0] < 1.02 * both[1]
