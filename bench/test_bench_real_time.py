"""Steps in real time: what a step of a line of 100 cells costs, from outside, over 10^5 steps.

    pytest bench/test_bench_real_time.py -m bench -n 0 -s

Times of the wall are what a real-time host feels, and have what other programs take; times of the thread have not.
"""

from __future__ import annotations

import resource
import time
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.solve import run as compiled

pytestmark = pytest.mark.bench
EXAMPLES = Path(__file__).parents[1] / "examples"
STEP, COUNT = 0.05, 100_000


def heave(t: float) -> tuple[float, float]:
    """Height (m) and velocity (m/s) of the fairlead."""
    w, x = 2.0 * np.pi / 8.0, min(t / 16.0, 1.0)
    r, dr = x**3 * (10 + x * (6 * x - 15)), 30.0 * x * x * (1 - x) ** 2 / 16.0
    return 2.0 * r * np.sin(w * t), 2.0 * (r * w * np.cos(w * t) + dr * np.sin(w * t))


def memory() -> float:
    """Largest memory of the process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


@pytest.mark.parametrize("most", [None, 2])
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_steps_in_real_time(model: str, most: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    count = COUNT if model == "catenary" and most is None else COUNT // 10
    settings = [f"time={{duration: {count * STEP}, step: {STEP}}}", f"model={model}", "mesh={cells: 100}",
                "ends.end={kind: pinned, position: [205, 0, 0]}", "output.every=100"]  # fmt: skip
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", settings)
    wall, thread, kernel = np.zeros(count), np.zeros(count), np.zeros(count)
    steps, within = compiled.run, [0.0]

    def timed(table: np.ndarray) -> int:
        begin = time.thread_time()
        code: int = steps(table)
        within[0] += time.thread_time() - begin
        return code

    monkeypatch.setattr(compiled, "run", timed)
    with hybrid.Simulation(scene, tmp_path / "run.h5", most_iterations=most) as cable:
        for k in range(count):
            z, v = heave((k + 1) * STEP)
            within[0] = 0.0
            begin, used = time.perf_counter(), time.thread_time()
            cable.set_end("end", (205.0, 0.0, z), (0.0, 0.0, v))
            cable.step()
            cable.forces()
            wall[k], thread[k], kernel[k] = time.perf_counter() - begin, time.thread_time() - used, within[0]
            if k == count // 2:
                early = memory()
        grown, cut = memory() - early, cable.cut_short
    around = thread - kernel
    parts = {"of the wall": wall, "of the thread": thread, "in the kernel": kernel, "around it": around}
    for name, taken in parts.items():
        median, rare, worst = (1e3 * float(np.quantile(taken, q)) for q in (0.5, 0.999, 1.0))
        print(f"{model}, {count} steps, {name}: median {median:.4f} ms, 99.9 % below {rare:.3f} ms, all {worst:.2f} ms")
    print(
        f"{grown:.2f} MB more after {count} steps than after half of them; {cut} steps cut short at {most} iterations"
    )
    assert grown < 2.0
    assert np.median(around) < 0.5 * np.median(kernel)
    if model == "catenary":
        assert np.median(thread) < 1e-4
        assert np.quantile(thread, 0.999) < 1e-3
