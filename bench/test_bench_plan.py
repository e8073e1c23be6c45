"""How long `hybrid plan` takes, and how well it foretells what a run takes, as processor time of this process.

pytest bench/test_bench_plan.py -n 0 -m bench -s
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
import warnings
from pathlib import Path
from statistics import median

import pytest
from plan_scenes import plan_scene

import hybrid

pytestmark = pytest.mark.bench
EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.yaml"))
FACTOR = 2.0  # within which an estimate is
ATTACHMENTS, LONGEST_PLAN = 20_000, 2.0  # s, imports included

# What else a scene may ask for, by the example that is changed.
VARIANTS = {
    "02_suspension in space": ("02_suspension", ["dimension=3"]),
    "02_suspension, 1000 cells": ("02_suspension", ["model=rod", "mesh.cells=1000", "time.duration=4"]),
    "02_suspension, errors": ("02_suspension", ["output.errors=true"]),
    "02_suspension, accuracy": ("02_suspension", ["accuracy=1%"]),
    "touchdown, rod": ("touchdown", ["model=rod"]),
    "touchdown, steps that follow the motion": ("touchdown", ["time={duration: 100}", "accuracy=1%"]),
    "irregular_sea, rod": ("irregular_sea", ["model=rod"]),
    "touchdown, rod of 400 cells": ("touchdown", ["model=rod", "mesh.cells=400"]),
    "s_tether in space": ("s_tether", ["dimension=3"]),
    "laying, accuracy": ("laying", ["accuracy=2%"]),
    "rov_tether, every step": ("rov_tether", ["output.every=0.1"]),
}
CASES = {path.stem: (path.stem, []) for path in EXAMPLES} | VARIANTS


def compared(scenes: dict[str, hybrid.Scene | dict]) -> dict[str, float]:
    """Processor time of runs over what the plan says, printed; kernels are loaded before."""
    ratios = {}
    print(f"\n{'scene':42s}{'measured':>10s}{'planned':>10s}{'at most':>10s}{'ratio':>7s}{'plan takes':>12s}")
    for name, scene in scenes.items():
        hybrid.plan(scene)
        begin = time.process_time()
        planned = hybrid.plan(scene)
        takes = time.process_time() - begin
        hybrid.run(scene)
        begin = time.process_time()
        hybrid.run(scene)
        measured = time.process_time() - begin
        ratios[name] = measured / planned.seconds
        most = planned.most_seconds or planned.seconds
        print(
            f"{name:42s}{measured:>8.2f} s{planned.seconds:>8.2f} s{most:>8.2f} s{ratios[name]:>7.2f}{takes:>10.2f} s"
        )
    inside = sum(1.0 / FACTOR <= x <= FACTOR for x in ratios.values())
    print(f"within a factor of {FACTOR:g}: {inside} of {len(ratios)}; median {median(ratios.values()):.2f}")
    return ratios


def test_estimates():
    """Of every example, of variants of them, and of the scenes of tests/data/defects that move."""
    for settings in ([], ["dimension=3"]):  # what they need compiled
        for example in ("02_suspension", "irregular_sea"):
            short = ["time.duration=1", "output.errors=true", *settings]
            hybrid.run(hybrid.load_scene(EXAMPLES[0].with_name(f"{example}.yaml"), short))
    scenes = {
        name: hybrid.load_scene(EXAMPLES[0].with_name(f"{stem}.yaml"), settings)
        for name, (stem, settings) in CASES.items()
    }
    ratios = compared(scenes)
    assert sum(1.0 / FACTOR <= x <= FACTOR for x in ratios.values()) >= 0.9 * len(ratios), ratios


def test_random_scenes():
    """100 random scenes: fixed steps, error figures, accuracies, several lines."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ratios = compared({f"{seed} {name}": scene for seed in range(100) for name, scene in [plan_scene(seed)]})
    assert sum(1.0 / FACTOR <= x <= FACTOR for x in ratios.values()) >= 90, ratios


def test_many_attachments(tmp_path):
    """Seconds of `hybrid plan` from the shell, of a scene with so many attachments."""
    rows = "".join(f"    - {{kind: clump, at: {0.5 + 0.9999 * i:.4f}, mass: 1.5}}\n" for i in range(ATTACHMENTS))
    text = f"""\
environment: {{fluid: {{density: 1025, surface: 0.0}}}}
cable:
  sections: [{{length: {ATTACHMENTS}, diameter: 0.05, mass: 4.0, axial_stiffness: 2.0e+8, drag: {{normal: 1.2}}}}]
  attachments:
{rows}\
ends:
  start: {{kind: pinned, position: [0, 0, -4000]}}
  end: {{kind: pinned, position: [15000, 0, 0]}}
initial: equilibrium
model: catenary
time: {{duration: 10.0, step: 0.1}}
"""
    (tmp_path / "many.yaml").write_text(text)
    command = [
        sys.executable,
        "-c",
        "from hybrid.cli.commands import main; main()",
        "plan",
        str(tmp_path / "many.yaml"),
    ]
    found = []
    for _ in range(3):
        begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        found.append((cpu, time.perf_counter() - begin))
    cpu, wall = min(found)
    print(f"\nplan of {ATTACHMENTS} attachments: {cpu:.2f} s of processor time, {wall:.2f} s of wall time")
    assert cpu <= LONGEST_PLAN


DEFAULTS = "touchdown", "s_tether", "rov_tether", "laying", "slack_on_seabed"


@pytest.mark.parametrize("name", DEFAULTS)
def test_default_is_no_dearer(name):
    """CPU time of everything at 1 %, medians of five: model not named over the cheaper of rods and catenaries.

    Catenaries count where they meet what is asked.  1.05 is asked of the project.
    """
    path = EXAMPLES[0].with_name(f"{name}.yaml")
    base = hybrid.load_scene(path).model_dump(mode="json", exclude_none=True, exclude_unset=True)
    base = {k: v for k, v in base.items() if k not in ("model", "mesh")}
    base |= {"time": {"duration": base["time"]["duration"]}, "accuracy": "1%"}
    scenes = {}
    for model in (None, "rod", "catenary"):
        scene = hybrid.validate_scene(base | ({"model": model} if model else {}))
        try:
            missed = "accuracy missed" in {e.kind for e in hybrid.run(scene).events}
        except hybrid.ComputationError:
            continue
        if not (missed and model == "catenary"):
            scenes[model or "default"] = scene
    tries: dict[str, list[float]] = {name: [] for name in scenes}
    for _ in range(5):  # in turn: what the machine does beside is shared alike
        for title, scene in scenes.items():
            begin = time.process_time()
            hybrid.run(scene)
            tries[title].append(time.process_time() - begin)
    cost = {title: median(x) for title, x in tries.items()}
    ratio = cost["default"] / min(cost[x] for x in cost if x != "default")
    each = ", ".join(f"{x} {y:.2f} s" for x, y in cost.items())
    print(f"{name}: {each}; default over the cheaper {ratio:.2f}")
    assert ratio <= 1.05
