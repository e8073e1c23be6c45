"""The table of the peers: from bench, `python -m peers.measure`, or with the names of some of them.

Each line is measured in a process of its own, one after the other; of a short run the fastest of three counts.
Errors are per cent of the figures in answer.py.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from peers import cabledyn_touchdown, exudyn_touchdown, hybrid_touchdown, moordyn_touchdown
from peers.answer import STATIC, Answer
from peers.scene import DURATION

MODULES = (hybrid_touchdown, cabledyn_touchdown, moordyn_touchdown, exudyn_touchdown)
PEERS: dict[str, ModuleType] = {p.NAME: p for p in MODULES}

SHORT = 4.0
"""CPU seconds up to which a run is repeated: the processor has other things to do."""

LOOSE = ("off ei0_substeps", "True modified_newton", "dynamic_solver 1e-4 1e-14 30 12")
LOW = ("2 axial_quadrature_order", "2 bending_quadrature_order")
BEST: dict[bool, dict[str, Any]] = {
    False: {"dt": 0.2, "options": (*LOOSE, "2 axial_quadrature_order")}, True: {"options": LOW},
}  # fmt: skip
"""Of CableDyn, by whether the line bends: no faster settings were found with the minimum within 1 %; with EI its steps of

0.125 s and more fail."""

# A rod around touchdown, and catenary cells that grow away from it.
FINE = (("catenary", 70, 4, 0.5), ("rod", 35, 14, 1), ("catenary", 145, 18, 8))
LEAN = (("catenary", 70, 4, 0.5), ("rod", 35, 14, 1), ("catenary", 145, 14, 6))

Run = tuple[str, int, float, dict[str, Any]]
RUNS: tuple[Run, ...] = (
    ("hybrid", 100, 0.0, {}),
    ("hybrid", 60, 0.0, {"dt": 0.25}),
    ("hybrid", 100, 2e3, {}),
    ("hybrid", 75, 2e3, {"dt": 0.25}),
    ("hybrid", 36, 2e3, {"dt": 0.1, "zones": FINE}),
    ("hybrid", 36, 2e3, {"dt": 0.25, "zones": FINE}),
    ("hybrid", 32, 2e3, {"dt": 0.4, "zones": LEAN}),
    ("CableDyn", 100, 0.0, {}),
    ("CableDyn", 75, 0.0, {"options": LOOSE}),
    ("CableDyn", 100, 0.0, {"options": LOOSE}),
    ("CableDyn", 100, 0.0, BEST[False]),
    ("CableDyn", 150, 0.0, {"options": LOOSE}),
    ("CableDyn", 400, 0.0, {"dt": 0.05, "options": ("off ei0_substeps",)}),
    ("CableDyn", 100, 2e3, {}),
    ("CableDyn", 100, 2e3, {"options": LOW}),
    ("CableDyn", 150, 2e3, {"dt": 0.0625}),
    ("CableDyn", 400, 2e3, {"dt": 0.05}),
    ("MoorDyn", 100, 0.0, {"dt": 1.1e-3, "couple": 1.1e-3}),
    ("MoorDyn", 200, 0.0, {}),
    ("MoorDyn", 200, 0.0, {"scheme": "RK2", "dt": 3.5e-4, "couple": 1.4e-3, "damping": -0.5}),
    ("MoorDyn", 200, 2e3, {}),
    ("MoorDyn", 800, 0.0, {"dt": 1.35e-4, "couple": 5.4e-4, "relaxation": 30.0}),
    ("Exudyn", 75, 0.0, {"radius": 0.2}),
    ("Exudyn", 100, 0.0, {"radius": 0.2}),
    ("Exudyn", 150, 0.0, {"dt": 0.05}),
    ("Exudyn", 75, 2e3, {}),
    ("Exudyn", 100, 2e3, {}),
    ("Exudyn", 150, 2e3, {}),
    ("Exudyn", 400, 2e3, {"dt": 0.05}),
)

HEAD = f"{'peer':9}{'el.':>5}{'EI':>6} {'rest %':>7}{'mean %':>7}{'peak %':>7}{'min %':>7}"
HEAD += f"{'start s':>9}{'loop s':>9}{'x real':>8}  settings"


def measured(name: str, elements: int, EI: float, settings: dict[str, Any]) -> dict[str, Any]:
    """One run in this process: of a short one the fastest of three.  Errors in %, CPU seconds of start and loop."""
    answer: Answer = PEERS[name].run(elements, EI, **settings)
    for _ in range(2 if answer.cpu < SHORT else 0):
        again = PEERS[name].run(elements, EI, **settings)
        answer = again if again.cpu < answer.cpu else answer
    rest = 100 * (answer.top_tension[0] / STATIC - 1)
    return {
        "errors": (rest, *answer.errors()), "start": answer.cpu_start, "loop": answer.cpu, "words": answer.settings
    }  # fmt: skip


def elsewhere(run: Run) -> dict[str, Any]:
    """`measured` in a process of its own; RuntimeError when that fails."""
    command = [sys.executable, "-m", "peers.measure", "--run", json.dumps(run)]
    done = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{run} fails: {done.stderr.strip()[-300:]}")
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


def row(run: Run, found: dict[str, Any]) -> str:
    """A line of the table."""
    name, elements, EI, _ = run
    figures = "".join(f"{error:7.2f}" for error in found["errors"])
    cost = f"{found['start']:9.3f}{found['loop']:9.3f}{DURATION / found['loop']:8.1f}"
    return f"{name:9}{elements:5d}{EI:6.0f} {figures}{cost}  {found['words']}"


def main() -> None:
    """Print the table."""
    wanted = sys.argv[1:]
    if wanted and wanted[0] == "--run":
        name, elements, EI, settings = json.loads(wanted[1])
        print(json.dumps(measured(name, elements, EI, settings)))
        return
    print(HEAD, flush=True)
    for run in RUNS:
        if wanted and run[0] not in wanted:
            continue
        if not PEERS[run[0]].available():
            print(f"{run[0]:9} is not installed", flush=True)
            continue
        try:
            print(row(run, elsewhere(run)), flush=True)
        except RuntimeError as failed:
            print(failed, flush=True)


if __name__ == "__main__":
    main()
