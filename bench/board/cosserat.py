"""Problems of cosseratbench, by every one of its solvers that is installed; ours joins it by its entry point."""

from __future__ import annotations

import time
from importlib.metadata import entry_points
from statistics import median

from board.answers import ROUNDS, Answer, references

NAMES = {"hybrid": "hybrid", "pyelastica": "PyElastica", "mujoco": "MuJoCo", "dismech": "DisMech"}
LONG = 20.0  # s of CPU beyond which one run is enough


def solved_by_all(name: str) -> list[Answer]:
    """Errors as cosseratbench measures them, in its resolution, and the CPU time of a run (s)."""
    try:
        from cosseratbench import registry
        from cosseratbench.experiment import COMPLETED, UNSUPPORTED, run
    except ImportError:
        return []
    table = references()["problems"][name]
    experiment = registry.load_experiment(table["experiment"])
    found = []
    for entry in sorted(entry_points(group=registry.SOLVERS), key=lambda x: (x.name != "hybrid", x.name)):
        try:
            solver = registry.load_solver(entry.name)
        except ImportError:
            continue
        spent = []
        while len(spent) < ROUNDS and sum(spent) < LONG:
            begin = time.process_time()
            result = run(experiment, solver, values=table.get("values"))
            spent.append(time.process_time() - begin)
        program, words = NAMES.get(entry.name, entry.name), f"{result.n_elements} elements"
        if result.outcome != COMPLETED:
            why = "not stated" if result.outcome == UNSUPPORTED else f"stopped: {result.failure}"
            found.append(Answer(program, words=why))
            continue
        measured = result.metrics | result.observations
        values = {quantity: measured[key] for quantity, key in table["measured"].items()}
        found.append(Answer(program, values, {}, median(spent), words))
    return found
