"""Three hours of a storm by default, everything counted, and its first minutes against CableDyn's loop on one motion.

pytest bench/test_bench_storm.py -m bench -n 0 -s
"""

from __future__ import annotations

import tempfile
import time as clock
from pathlib import Path

import numpy as np
import pytest
from peers import cabledyn_touchdown, scene
from scipy.interpolate import CubicSpline
from test_bench_irregular import storm

import hybrid

pytestmark = pytest.mark.bench
SEED, HOURS, ASKED_CPU = 3, 3 * 3600.0, 40.0
MINUTES, STEP, ELEMENTS, ASKED_TIMES = 300.0, 0.1, 100, 5.0


def spent(scene: dict, path: Path) -> tuple[float, hybrid.Result]:
    """CPU time, s, of a whole run into a file, with its result."""
    begin = clock.process_time()
    result = hybrid.run(scene, path)
    return clock.process_time() - begin, result


def test_three_hours(tmp_path: Path) -> None:
    """CPU time of all runs, the file and its errors; 40 s are asked of the project on an idle core."""
    hybrid.run(storm(SEED) | {"time": {"duration": 400.0}}).close()  # compiles, contact with itself included
    cpu, result = spent(storm(SEED) | {"time": {"duration": HOURS}}, tmp_path / "run.h5")
    own = float(result["steps/cpu"][-1])
    print(
        f"\nthree hours: {cpu:.1f} s of CPU, of which the loop of the result {own:.1f} s for "
        f"{result.attributes['message']}; {result.attributes['effort_runs']} runs beside the pre-run"
    )
    assert cpu <= ASKED_CPU


def loop_of_cabledyn(path: CubicSpline, duration: float) -> tuple[float, float]:
    """CPU time, s, of its time loop with a fairlead that moves so, and the largest tension, N, there."""
    import cabledyn

    scene.FAIRLEAD = tuple(float(x) for x in path(0.0))
    steps = round(duration / STEP)
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "storm.dat"
        deck.write_text(cabledyn_touchdown.deck(ELEMENTS, 2e3, STEP, 0.0, ()))
        model = cabledyn.CableDyn(deck)
    times = STEP * np.arange(steps + 1)
    each = [path(times, k) for k in range(3)]
    most = 0.0
    with model:
        position, velocity, acceleration = model.get_coupled_motion()
        begin = clock.process_time()
        for k in range(1, steps + 1):
            position[:3], velocity[:3], acceleration[:3] = each[0][k], each[1][k], each[2][k]
            model.step(STEP, position, velocity, acceleration)
            most = max(most, model.channel("FairTen1"))
        return clock.process_time() - begin, most


def test_against_the_loop_of_cabledyn(tmp_path: Path) -> None:
    """Whole run by default over the loop alone; still water for CableDyn, which makes it cheaper."""
    pytest.importorskip("cabledyn")
    given = storm(SEED) | {"time": {"duration": MINUTES}}
    with hybrid.run(given | {"output": {"every": STEP, "points": 3, "errors": False}}, tmp_path / "path.h5") as result:
        path = CubicSpline(np.array(result["t"]), np.array(result.position[:, -1]))
    cpu, result = spent(given, tmp_path / "run.h5")
    most = float(np.max(result["steps/end_force_end"]))
    theirs, their_most = loop_of_cabledyn(path, MINUTES)
    print(
        f"\nfirst {MINUTES:g} s: {cpu:.2f} s, all runs included, CableDyn's loop {theirs:.1f} s: {theirs / cpu:.1f} "
        f"times; largest tension at the fairlead {most:.0f} N, CableDyn in still water {their_most:.0f} N"
    )
    assert theirs >= ASKED_TIMES * cpu
