"""What a run costs as the user lives it: from the scene to the closed file, processor time of this process on one core.

    pytest bench/test_bench_run.py -m bench -s

Each figure is the median of five runs; ratios are taken within one run.  examples/touchdown.yaml, 100 cells, 1000 steps
of 0.1 s.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest
from peers.hybrid_touchdown import described
from problems import StepsOfLine, at_rest

import hybrid
from hybrid.kernels.run import newton
from hybrid.kernels.run.newton import NO_PUSH, workspace_of
from hybrid.kernels.step.step import States
from hybrid.kernels.watch import observed_outputs
from hybrid.model.build import build, planar, untwist
from hybrid.outputs import observed_states
from hybrid.scene.read import one_line
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stability import seed
from hybrid.solve.stepper import MOST_ITERATIONS, REACH

pytestmark = pytest.mark.bench
EXAMPLES = Path(__file__).parents[1] / "examples"
RUNS = 5
PRICE = 2.5  # of a run with its error figure, over that without, at most


def touchdown(model: str, every: float = 0.2, *more: str) -> hybrid.Scene:
    usual = [f"model={model}", "mesh={cells: 100}", f"output.every={every}", "output.errors=false"]
    return hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*usual, *more])


def cpu(call: Callable[[], Any]) -> float:
    """Median processor time, s, after a first call that loads what is needed."""
    call()
    times = []
    for _ in range(RUNS):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return median(times)


@pytest.fixture
def kernel_time(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[float]]:
    """Processor times, s, of calls of the compiled run, and of the other kernels: statics, what outputs mean."""
    times: dict[str, list[float]] = {"run": [], "other": []}

    def timed(call: Callable[..., Any], key: str) -> Callable[..., Any]:
        def inside(*given: Any) -> Any:
            begin = time.process_time()
            out = call(*given)
            times[key].append(time.process_time() - begin)
            return out

        return inside

    monkeypatch.setattr(NetworkSteps, "go", timed(NetworkSteps.go, "run"))
    for room, name in (
        (newton, "in_plane"), (newton, "in_space"), (observed_outputs, "observe_outputs"), (observed_states, "add_rows"),
    ):  # fmt: skip
        monkeypatch.setattr(room, name, timed(getattr(room, name), "other"))
    return times


@pytest.mark.parametrize("every", [0.2, 0.05])
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_touchdown_from_the_scene_to_the_file(model: str, every: float, tmp_path: Path) -> None:
    scene = touchdown(model, every)
    plain = cpu(lambda: hybrid.run(scene, tmp_path / "run.h5").close())
    print(f"{model}, {round(100 / every) + 1} outputs: {plain:.3f} s")


@pytest.mark.parametrize(("EI", "cells"), [(0.0, 60), (2e3, 100)], ids=["catenary, 60 cells", "rod, 100 cells"])
def test_the_error_figure(EI: float, cells: int, tmp_path: Path) -> None:
    """501 outputs of 100 s of the line of bench/peers in steps of 0.25 s, in turns; PRICE is asked."""
    scenes = {
        errors: hybrid.validate_scene(described(cells, EI, 0.25, ()) | {"output": {"every": 0.2, "errors": errors}})
        for errors in (False, True)
    }
    times: dict[bool, list[float]] = {False: [], True: []}
    for _ in range(RUNS + 1):  # the first loads what is needed
        for errors, scene in scenes.items():
            begin = time.process_time()
            hybrid.run(scene, tmp_path / "run.h5").close()
            times[errors].append(time.process_time() - begin)
    plain, more = (median(times[x][1:]) for x in (False, True))
    price = f"{more / plain:.2f} times (asked: {PRICE:g})"
    print(f"EI {EI:g}, {cells} cells: {plain:.3f} s, with the error figure {more:.3f} s, {price}")


def test_variants_in_two_threads(tmp_path: Path) -> None:
    """Wall time: kernels release the GIL, what is Python of a run does not; both give the same numbers."""
    scenes = [touchdown("catenary", 0.2, f"ends.end.motion.heave.amplitude={1.0 + 0.1 * k}") for k in range(8)]

    def largest_tension(k: int) -> float:
        with hybrid.run(scenes[k], tmp_path / f"{k}.h5") as result:
            return float(result.tension.max())

    def wall(threads: int) -> tuple[float, list[float]]:
        begin = time.perf_counter()
        with ThreadPoolExecutor(threads) as pool:
            found = list(pool.map(largest_tension, range(len(scenes))))
        return time.perf_counter() - begin, found

    expected = wall(1)[1]
    times: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(RUNS):
        for threads, taken in times.items():
            spent, found = wall(threads)
            assert found == expected
            taken.append(spent)
    one, two = median(times[1]), median(times[2])
    print(f"8 variants: {one:.2f} s in one thread, {two:.2f} s in two, {two / one:.2f} times")


@pytest.mark.parametrize("cells", [100, 1000])
def test_part_inside_kernels(cells: int, tmp_path: Path, kernel_time: dict[str, list[float]]) -> None:
    scene = touchdown("catenary", 0.2, f"mesh={{cells: {cells}}}")
    hybrid.run(scene, tmp_path / "run.h5").close()
    parts: dict[str, list[float]] = {"run": [], "other": []}
    for _ in range(RUNS):
        for times in kernel_time.values():
            times.clear()
        begin = time.process_time()
        hybrid.run(scene, tmp_path / "run.h5").close()
        total = time.process_time() - begin
        for key, each in parts.items():
            each.append(sum(kernel_time[key]) / total)
    run, other = (100 * median(x) for x in parts.values())
    print(f"{cells} cells: {run + other:.0f} % inside kernels: {run:.0f} % the compiled run, {other:.0f} % others")


def test_ten_thousand_cells(tmp_path: Path) -> None:
    """A cell and iteration of a run, outputs, extremes and file included, against the bare solver's on the same line."""

    def of_duration(duration: float) -> hybrid.Scene:
        return touchdown("catenary", 0.2, "mesh={cells: 10000}", f"time={{duration: {duration}, step: 0.1}}")

    def spent(scene: hybrid.Scene) -> tuple[float, int]:
        begin = time.process_time()
        with hybrid.run(scene, tmp_path / "run.h5") as result:
            iterations = int(result.steps["iterations"].sum())
        return time.process_time() - begin, iterations

    def bare(steps: int, watched: bool) -> tuple[float, int]:
        new, old, total = start.copy(), start.copy(), 0
        now = seed(line.s, model.length / model.time_scale) if watched else NO_PUSH
        was = np.zeros_like(now)
        begin = time.process_time()
        for k in range(1, steps + 1):
            sea, ends, old, new, was, now = model.sea.at_time(0.1 * k), model.ends.at_time(0.1 * k), new, old, now, was
            task = newton.Task(newton.STEP, 0.1, 0.1 * (k > 1), 0.5, limits=limits, rho_before=0.5)
            outcome, iterations, *_ = newton.solve_task(task, line, sea, ends, States(old, new, was, now), work)
            assert outcome == hybrid.Outcome.OK
            total += iterations
        return time.process_time() - begin, total

    scenes = of_duration(4.0), of_duration(12.0)
    model = build(one_line(scenes[1]))
    ends, start = model.ends.at_time(0.0), at_rest(model).state.lines[0]
    assert model.plane is not None
    line = planar(model.line, model.plane)
    untwist(line, ends, model.cable.held_tangent, start)
    limits, work = newton.Limits(REACH * model.length, model.tension_scale, MOST_ITERATIONS), workspace_of(line)
    StepsOfLine(model, line).begin(start)
    spent(scenes[0])
    each: dict[str, list[float]] = {"run": [], "solver": [], "watched": []}
    for _ in range(RUNS):
        (short, few), (long, many) = spent(scenes[0]), spent(scenes[1])
        each["run"].append((long - short) / (many - few))
        for name in ("solver", "watched"):
            (short, few), (long, many) = (bare(steps, name == "watched") for steps in (40, 120))
            each[name].append((long - short) / (many - few))
    run, alone, watched = (median(x) / 10_000 for x in each.values())
    print(
        f"10 000 cells: {1e6 * run:.4f} us a cell and iteration of a run; of the bare solver {1e6 * alone:.4f} us, "
        f"{run / alone:.2f} times; with its watch on what leaves the plane {1e6 * watched:.4f} us, {run / watched:.2f}"
    )


def test_cost_of_an_output(tmp_path: Path) -> None:
    """By two numbers of outputs of the same steps."""
    for model in ("catenary", "rod"):
        few, many = (
            cpu(lambda e=e, m=model: hybrid.run(touchdown(m, e), tmp_path / "r.h5").close()) for e in (1.0, 0.05)
        )
        print(f"{model}: {1e6 * (many - few) / 1900:.0f} us an output of 101 points, file included")


def test_before_the_first_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scene, model, equilibrium, file and first output of `hybrid.run` in a warm process; and all that is not steps."""
    from hybrid.simulation.run import Run

    begin, before = 0.0, list[float]()
    monkeypatch.setattr(Run, "go_to", lambda self, *_: before.append(time.process_time() - begin))

    def run(model: str) -> None:
        nonlocal begin
        scene = touchdown(model)
        begin = time.process_time()
        hybrid.run(scene, tmp_path / "r.h5").close()

    for model in ("catenary", "rod"):
        before.clear()
        whole = cpu(lambda m=model: run(m))
        first = median(before[1:])
        print(f"{model}: {1e3 * first:.1f} ms before the first step; {1e3 * whole:.1f} ms with reading the scene,")
        print("    closing the file and opening its result")


def test_stepping_from_outside() -> None:
    """A step of `hybrid.Simulation`, its end set every time, less a step in one call."""
    end = "ends.end={kind: pinned, position: [205, 0, 0]}"
    scene = touchdown("catenary", 100.0, "time={duration: 200, step: 0.1}", end)

    def steps(one_by_one: bool) -> float:
        with hybrid.Simulation(scene) as simulation:
            simulation.advance(1.0)
            begin = time.process_time()
            if one_by_one:
                for _ in range(1000):
                    simulation.set_end("end", (205.0, 0.0, 0.0), (0.0, 0.0, 0.0))
                    simulation.step()
            else:
                simulation.advance(101.0)
            return (time.process_time() - begin) / 1000

    inside, outside = (median(steps(one) for _ in range(RUNS)) for one in (False, True))
    print(f"{1e6 * inside:.1f} us a step in one call, {1e6 * (outside - inside):.1f} us more from outside")


def test_switches_of_zones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What watching, planning and switching take of a run whose zones move, and a switch."""
    from hybrid.simulation.run_zones import RunZones

    spent: dict[str, list[float]] = {}

    def timed(key: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def inside(*given: Any) -> Any:
            begin = time.perf_counter()
            out = call(*given)
            spent.setdefault(key, []).append(time.perf_counter() - begin)
            return out

        return inside

    for method in ("wants_retry", "note_step", "_switch"):
        monkeypatch.setattr(RunZones, method, timed(method, getattr(RunZones, method)))
    from test_bench_cells import CASES, DRIFT, scene_of

    names = ("touchdown", "s_tether", "laying")
    scenes = {name: hybrid.load_scene(EXAMPLES / f"{name}.yaml", ["output.errors=false"]) for name in names}
    follows = {"kind": "adaptive", "curvature_error": 0.05}
    scenes["drift, cells that follow"] = scene_of(DRIFT, follows, {"cells": CASES["drift"].base})
    for name, scene in scenes.items():
        hybrid.run(scene, tmp_path / "r.h5").close()
        spent.clear()
        begin = time.perf_counter()
        hybrid.run(scene, tmp_path / "r.h5").close()
        total = time.perf_counter() - begin
        watching = sum(map(sum, spent.values()))
        switch = median(spent.get("_switch", [0.0]))
        print(f"{name}: {100 * watching / total:.1f} % of {total:.2f} s; {1e3 * switch:.2f} ms a switch")
