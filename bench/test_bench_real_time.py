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
from hybrid.solve import network_steps as compiled

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
    steps, within = compiled.run_network, [0.0]

    def timed(table: np.ndarray) -> int:
        begin = time.thread_time()
        code: int = steps(table)
        within[0] += time.thread_time() - begin
        return code

    monkeypatch.setattr(compiled, "run_network", timed)
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


def test_a_tether_around_a_pile_in_real_time(tmp_path: Path) -> None:
    """A vehicle on a tether of 60 rods goes around a pile and back, both set from outside: 10 000 steps of 5 ms."""
    from examples.contact.mujoco_vehicle import DURATION, PILE, STEP, TETHER, wanted

    def place(t: float) -> np.ndarray:
        """Nearer to the pile the farther it is around it, so that the tether lies against it and is hardly stretched."""
        return np.asarray(PILE + (wanted(t) - PILE) * (1.0 - 0.45 * np.sin(np.pi * t / DURATION) ** 2))

    count = 10_000
    tables = TETHER | {"time": {"duration": count * STEP, "step": STEP}}
    wall, thread = np.zeros(count), np.zeros(count)
    with hybrid.Simulation(tables, tmp_path / "run.h5", most_iterations=4) as tether:
        for k in range(count):
            t = (k + 1) * STEP
            ahead, behind = place(t + 0.5 * STEP), place(t - 0.5 * STEP)
            sway = 0.02 * np.sin(2.0 * np.pi * t / 5.0)
            rate = 0.02 * 2.0 * np.pi / 5.0 * np.cos(2.0 * np.pi * t / 5.0)
            begin, used = time.perf_counter(), time.thread_time()
            tether.set_end("end", 0.5 * (ahead + behind), (ahead - behind) / STEP)
            tether.set_obstacle("pile", PILE + np.array([0.0, sway, 0.0]), (0.0, rate, 0.0))
            tether.step()
            tether.forces()
            wall[k], thread[k] = time.perf_counter() - begin, time.thread_time() - used
        cut, pull = tether.cut_short, float(np.linalg.norm(tether.forces().end))
    for name, taken in (("of the wall", wall[1:]), ("of the thread", thread[1:])):
        median, rare, worst = (1e3 * float(np.quantile(taken, q)) for q in (0.5, 0.999, 1.0))
        over = int((taken > 1e-3).sum())
        print(
            f"{count} steps, {name}: median {median:.3f} ms, 99.9 % below {rare:.3f} ms, worst {worst:.2f} ms, {over} over 1 ms"
        )
    print(f"{cut} steps cut short; the way takes {DURATION:g} s; {pull:.3g} N at the end")
    assert np.quantile(thread, 0.999) < 1e-3
