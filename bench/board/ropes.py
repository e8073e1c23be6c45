"""The problems of cosseratbench by every one of its solvers that is installed, in its resolution, judged by its metrics.

Each pair runs in a process of its own: `python -m board.ropes PROBLEM SOLVER` prints what was found as JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import hybrid
from board.answers import Answer, references

SOLVERS = {"hybrid": "hybrid", "pyelastica": "PyElastica", "mujoco": "MuJoCo"}
SETTINGS: dict[str, dict[str, float]] = {"capstan": {"overhang": 0.95}}
LONGEST = 150.0  # s of wall time
OURS_ALONE = {"crossing", "pile", "twist"}  # take the peers minutes
KEPT = Path(__file__).parents[2] / "build" / "board"  # what pairs gave, of this version of hybrid


def cosseratbench(name: str) -> list[Answer]:
    """One row to a solver; nothing where cosseratbench is not installed."""
    there = {x.name for x in entry_points(group="cosseratbench.solvers")}
    table = references()["problems"][name]
    answers = []
    for solver in (x for x in SOLVERS if x in there):
        values, walls, silent = dict[str, float](), dict[str, float](), []
        for problem in table["metrics"]:
            if problem in OURS_ALONE and solver != "hybrid":
                silent.append(f"{problem} not run")
                continue
            found = elsewhere(problem, solver)
            if isinstance(found, str):
                silent.append(f"{problem} {found}")
                continue
            for quantity, metric in table["metrics"][problem].items():
                values[quantity], walls[quantity] = found["metrics"][metric], found["wall"]
        answers.append(Answer(SOLVERS[solver], values, words="; ".join(silent), walls=walls))
    return answers


def elsewhere(problem: str, solver: str) -> dict[str, Any] | str:
    """What a solver found, or in words why it found nothing."""
    file = KEPT / f"{hybrid.__version__}-{problem}-{solver}.json"
    if file.exists():
        return dict(json.loads(file.read_text(encoding="utf-8")))
    command = [sys.executable, "-m", "board.ropes", problem, solver]
    folder = Path(__file__).parents[1]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LONGEST, check=True)
    except subprocess.TimeoutExpired:
        return f"over {LONGEST:.0f} s"
    except subprocess.CalledProcessError as error:
        last = error.stderr.strip().splitlines()[-1:]
        return "not installed" if "ModuleNotFoundError" in error.stderr else f"fails: {''.join(last)[:80]}"
    found = json.loads(done.stdout.strip().splitlines()[-1])
    if isinstance(found, str):
        return found
    file.write_text(json.dumps(found), encoding="utf-8")
    return dict(found)


def solved(problem: str, solver: str) -> dict[str, Any] | str:
    """In this process: metrics and wall time (s), as cosseratbench measures it."""
    from cosseratbench import experiment, registry

    stated = registry.load_experiment(problem)
    result = experiment.run(stated, registry.load_solver(solver), values=SETTINGS.get(problem, {}))
    if not result.supported:
        return "not stated"
    if result.failure:
        return f"fails: {result.failure[:80]}"
    return {"metrics": result.metrics | result.observations, "wall": result.wall_time}


if __name__ == "__main__":
    print(json.dumps(solved(*sys.argv[1:]), default=float))
