"""Special cases of the error estimate, each left out alone: figures over true errors, and what it costs.

    pytest bench/test_bench_leave_out.py -m bench -n 0 -s

92 scenes: random ones in motion with steps and cells of their own (bench/random_scenes.py), some as catenaries, lines at
rest on 80 equal cells as rods and catenaries, vibrations that last, and shocks (bench/test_bench_shocks.py).  Runs of a scene are computed once and kept; an estimate without a special case takes
them again.  The truth is a run on a quarter of cells and steps, at rest rods asked for 0.05 % of curvature.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from random_scenes import hanging_line, random_scene
from test_bench_lasting import random_line
from test_bench_shocks import SEEDS, shock

import hybrid
from hybrid.accuracy import error_control, error_estimate, error_order, line_errors, model_choice
from hybrid.accuracy.passes import Passes
from hybrid.model.network import NetworkResolution
from hybrid.scene.read import as_scene, scene_text
from hybrid.simulation.case import Case, CaseAtRest
from hybrid.simulation.run_sample import END_FORCES, Samples

pytestmark = pytest.mark.bench
QUANTITIES = {x: x for x in ("position", "tension", "curvature", "bending_moment")}
QUANTITIES |= {shown: raw for raw, shown in END_FORCES.items()}
BENDS = ("curvature", "bending_moment")  # that are judged at rest
LEAST = 1e-4  # of the largest value: smaller errors say nothing
SMALL, LARGE = 0.7, 3.0  # figures over true errors, asked of the project
MOVED = 0.02  # of a figure, beyond which it counts as changed

Patches = list[Any]


def off(module: Any, name: str, value: Any) -> Any:
    """A name of a module that has another value."""
    return mock.patch.object(module, name, value)


def by_counts(fast: Any, slow: Any) -> float:
    return float(fast.steps / max(slow.steps, 1))


# What is left out, by patches; a special case may stand in several modules.
SPECIAL: dict[str, Callable[[], Patches]] = {
    "edges of contact": lambda: [off(Kept, "at_edges", False)],
    "layers at rest": lambda: [off(Kept, "at_layers", False)],
    "vibrations that last: shares mixed": lambda: [off(error_estimate, "MOST_BY_STEPS", np.inf)],
    "a run in shorter steps": lambda: [off(error_control.ErrorController, "_in_shorter_steps", lambda self: None)],
    "order at the first output": lambda: [off(error_estimate, "start_order", lambda *_: np.inf)],
    "orders of a start that is a shock": lambda: [off(error_order, "START_ORDERS", error_order.ORDERS)],
    "outputs beside": lambda: [off(error_estimate, "with_neighbours", lambda x, a, b, starts: x[a:b].copy())],
    "end forces between outputs": lambda: [off(line_errors, "errors_between", lambda *_: {})],
    "steps around a moment": lambda: [off(error_estimate, "usual_ratio", by_counts)],
    "model error: cells at free ends": lambda: [off(model_choice, "_end_cells", lambda *_: ())],
    "model error: cells at loads and clamps": lambda: [off(model_choice, "_kinks", lambda *_: ())],
    "finer results: orders confirmed": lambda: [off(error_estimate, "confirmed_order", lambda name, p, *_: p)],
    "finer results: more than foretold": lambda: [off(error_estimate, "exceeds", lambda *_: False)],
    "finer results: no better": lambda: [off(error_estimate.Estimate, "set_apart", lambda self, finer: None)],
    "finer results: weighted mean": lambda: [off(error_estimate, "blended", lambda shown, *_: shown)],
}  # fmt: skip


class Kept:
    """One scene with its runs, which are computed when they are first asked for."""

    at_edges, at_layers = True, True

    def __init__(self, data: dict[str, Any]) -> None:
        self.scene, self.moves = as_scene(data), "time" in data
        self._runs = dict[str, Samples]()
        self.cpu = 0.0  # s, of the runs of the last estimate

    def estimate(self) -> Any:
        """What an estimate says of errors: the lines of its controller."""
        case = Case(self.scene, None) if self.moves else CaseAtRest(self.scene)
        passes, self.cpu = Passes(case, io.BytesIO()), 0.0
        computed = {"record": case.record, "sample": case.sample}

        def kept(how: str, finely: NetworkResolution, *more: Any) -> Samples:
            key = f"{how} {finely} {more[1:] if how == 'sample' else ''} {scene_text(case.scene)}"
            if key not in self._runs:
                self._runs[key] = computed[how](finely, *(more or ((io.BytesIO(),) if how == "record" else ())))
            found = self._runs[key]
            self.cpu += next(iter(found.values())).cpu
            edges = self.at_edges if self.moves else self.at_layers
            return found if edges else {name: replace(x, at_edges={}) for name, x in found.items()}

        case.sample = lambda finely, *more: kept("sample", finely, *more)  # type: ignore[method-assign]
        finely = passes._surveyed(NetworkResolution.of(case.lines))
        compute = SimpleNamespace(decide=lambda kept: None)  # of results, which nobody reads
        control = passes._controls(compute)  # type: ignore[arg-type]
        control.result = lambda finely: kept("record", finely)
        control.start(finely)
        return control


def scenes() -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Name, tables, and tables of the truth."""
    for seed in range(30):
        kind, data = random_scene(seed)
        data["output"]["errors"] = True
        time = data["time"] | {"step": data["time"]["step"] / 4}
        fine = data | {
            "model": "rod",
            "mesh": {"cells": 400},
            "time": time,
            "output": data["output"] | {"errors": False},
        }
        yield f"{kind} {seed}", data, fine
        if not seed % 4:
            yield f"{kind} {seed}, catenary", data | {"model": "catenary", "mesh": {"cells": 100}}, fine
    for seed in range(24):
        data, model = hanging_line(seed), "rod" if seed % 3 else "catenary"
        fixed = {"model": model, "mesh": {"cells": 80}, "output": data["output"] | {"errors": True}}
        yield f"at rest {seed}, {model}", data | fixed, data | {"model": "rod", "accuracy": {"curvature": "0.05%"}}
    for seed in range(17):
        data, asked = random_line(seed)
        duration = data["time"]["duration"]
        fine = {"mesh": {"cells": 200}, "time": {"duration": duration, "step": duration / 12_000}}
        yield f"lasting {seed}", data | {"accuracy": asked}, data | fine
    for seed in SEEDS[:12]:
        data, asked = shock(seed)
        duration = data["time"]["duration"]
        fine = {"mesh": {"cells": 250}, "time": {"duration": duration, "step": duration / 10_000}}
        yield f"shock {seed}", data | {"accuracy": asked}, data | fine


def ratios(control: Any, truth: hybrid.Result) -> dict[str, float]:
    """Figures over true errors, by quantity."""
    found = {}
    for line in (x for x in control.lines.values() if x.estimate is not None):
        run, errors = line.estimate.run, line.estimate.errors
        for name, raw in QUANTITIES.items():
            if raw not in run.values or name not in errors.fields.get("total", {}):
                continue
            mine, true = np.asarray(run.values[raw]), np.asarray(truth[raw])
            true = true[:, run.places] if run.places.size and name not in END_FORCES.values() else true
            wrong = (
                np.abs(mine - true) if raw not in (*END_FORCES, "position") else np.linalg.norm(mine - true, axis=-1)
            )
            if wrong.max() > LEAST * np.abs(true).max():
                found[name] = errors.largest("total", name) / float(wrong.max())
    return found


def row(name: str, found: dict[str, float], whole: dict[str, float], cpu: float) -> None:
    """Print what all scenes say without a special case."""
    each, before = np.array([*found.values()]), np.array([whole.get(x, np.nan) for x in found])
    within = np.mean((each >= SMALL) & (each <= LARGE))
    moved = int(np.sum(~(np.abs(each / before - 1.0) <= MOVED)))
    print(
        f"{name:40} {within:5.1%} of {each.size} within, {np.sum(each < 0.5):2d} below 0.5, {np.sum(each < SMALL):2d} "
        f"below 0.7, {np.sum(each > LARGE):2d} above 3, median {np.median(each):.2f}; {moved:3d} moved; runs {cpu:.2f}",
        flush=True,
    )


def test_special_cases_left_out() -> None:
    kept, truths = dict[str, Kept](), dict[str, hybrid.Result]()
    for name, data, fine in scenes():
        try:
            kept[name], truths[name] = Kept(data), hybrid.run(fine) if "time" in fine else hybrid.static(fine)
            kept[name].estimate()
        except hybrid.ComputationError as error:
            print(f"{name}: {str(error).splitlines()[0]}")
            kept.pop(name, None)
    print(f"\n{len(kept)} scenes", flush=True)
    whole, all_cpu = dict[str, float](), 1.0
    for what, patches in {"nothing": list, **SPECIAL}.items():
        found, cpu = dict[str, float](), 0.0
        with ExitStack() as stack:
            for patch in patches():
                stack.enter_context(patch)
            for name, x in kept.items():
                each = ratios(x.estimate(), truths[name])
                found |= {f"{name} {q}": r for q, r in each.items() if x.moves or q in BENDS}
                cpu += x.cpu
        if what == "nothing":
            whole, all_cpu = found, cpu
        row(what, found, whole, cpu / all_cpu)
    assert len(kept) >= 80
