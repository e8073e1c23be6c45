"""The problems of cosseratbench by every one of its solvers that is installed, in its resolution, judged by its metrics.

`pytest bench/test_bench_cosserat.py -m bench -n 0 -s`; SOLVERS=hybrid,pyelastica names some.  `pip install pyelastica
"mujoco<4"` brings the peers; MuJoCo takes minutes.  The catenary's reference has no bending: that of the cord makes 4.8e-4
of shape and 3.8e-4 of sag.
"""

from __future__ import annotations

import os
import time
from importlib.metadata import entry_points

import pytest

pytestmark = pytest.mark.bench

PROBLEMS = {
    "cantilever": ({}, ("tip_deflection_error",)),
    "catenary": ({}, ("shape_error", "sag_error")),
    "pendulum": ({}, ("period_error", "amplitude_change")),
    "crossing": ({}, ("shape_error", "lift_error", "max_rod_overlap")),
    "capstan": ({"overhang": 0.95}, ("slide", "max_penetration")),
    "pile": ({}, ("pile_height", "footprint", "max_rod_overlap", "max_penetration", "settling_residual")),
    "twist": ({}, ("critical_twist_error",)),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_errors_and_cost(name: str) -> None:
    registry = pytest.importorskip("cosseratbench.registry")
    experiments = pytest.importorskip("cosseratbench.experiment")
    values, shown = PROBLEMS[name]
    experiment = registry.load_experiment(name)
    wanted = os.environ["SOLVERS"].split(",") if "SOLVERS" in os.environ else None
    print(f"\n{name}, {experiment.n_elements} elements")
    for entry in sorted(entry_points(group=registry.SOLVERS), key=lambda x: (x.name != "hybrid", x.name)):
        if wanted is not None and entry.name not in wanted:
            continue
        try:
            solver = registry.load_solver(entry.name)
        except ImportError as error:
            print(f"{entry.name:12s} not installed ({error.name})")
            continue
        begin = time.process_time()
        result = experiments.run(experiment, solver, values=values)
        cpu = time.process_time() - begin
        found = result.metrics | result.observations
        text = "  ".join(f"{key} {found[key]:.3g}" for key in shown) if result.supported and not result.failure else ""
        what = text or result.failure or f"not stated: {', '.join(result.missing)}"
        print(
            f"{entry.name:12s} {what}   wall {result.wall_time or 0.0:.2f} s, CPU {cpu:.2f} s with a short run before"
        )
        if entry.name == "hybrid":
            assert name == "twist" or text, what
