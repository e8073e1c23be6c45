"""What the choice of a model costs: scenes that name none, at 1 %, against rods and zones that move at the same accuracy.

    HYBRID_BENCH_SEEDS=100 pytest bench/test_bench_choice.py -m bench -n 0 -s -o faulthandler_timeout=0     (30 seeds if none are given)

    HYBRID_BENCH_ZONES=0 leaves out zones that move, which take most of the time and are seldom the cheapest
    OPENBLAS_NUM_THREADS=1 on a busy machine, where threads that wait for each other make 0.01 s of modes 1 s

Processor times are of whole runs, all passes counted, from the scene to its result in memory.  A default that makes the
same runs as the model that it takes (as many runs, steps and cells) costs what that costs, and the choice, a millisecond
(test_bench_plan.py): the smaller of both counts.  Where the default is dearer than DEARER it and the cheapest run again
in turns until it is not, at most MORE times, and the smallest of each count: a busy machine makes a run a quarter dearer
now and then, and the first of a kind loads its kernels.
"""

from __future__ import annotations

import copy
import os
import time
from collections import Counter
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene

import hybrid

pytestmark = pytest.mark.bench
SEEDS = int(os.environ.get("HYBRID_BENCH_SEEDS", "30"))
ASKED = {"all": "1%", "curvature": "none"}
MODELS: dict[str, Any] = {
    "default": None, "rod": "rod", "catenary": "catenary", "adaptive": {"kind": "adaptive", "always_move": True},
}  # fmt: skip
if os.environ.get("HYBRID_BENCH_ZONES") == "0":
    del MODELS["adaptive"]
DEARER, MORE = 1.05, 5


def scene(seed: int, model: Any) -> tuple[str, dict[str, Any]]:
    """Without steps and cells of its own; a third of them in a current across them."""
    kind, text = random_scene(seed)
    text = copy.deepcopy(text)
    text["time"].pop("step")
    text.pop("model")
    if seed % 3 == 0:
        text["environment"]["fluid"]["current"] = [0.0, 0.3, 0.0]
    return kind, text | {"accuracy": ASKED} | ({"model": model} if model else {})


def once(text: dict[str, Any]) -> tuple[float, hybrid.Result | None]:
    """s of processor time of a run; no result where it fails."""
    begin = time.process_time()
    try:
        result = hybrid.run(copy.deepcopy(text))
    except hybrid.ComputationError:
        return np.inf, None
    return time.process_time() - begin, result


def effort(result: hybrid.Result) -> tuple[int, ...]:
    """Runs, steps, cells and rods among them."""
    kinds = result.mesh[-1].kinds
    return int(result.attributes["effort_runs"]), len(result.steps["t"]), kinds.size, int((kinds == "rod").sum())


def kept(result: hybrid.Result | None) -> bool:
    """Whether it did not fail, and says that it met what was asked."""
    return result is not None and "accuracy missed" not in {e.kind for e in result.events}


def test_choice_random() -> None:
    print(
        "\nseed kind       cells rod of zones  s: default, rod, catenary, adaptive; default over the cheapest that meets"
    )
    ratios, taken = [], Counter[str]()
    for seed in range(SEEDS):
        times, found = {}, {}
        for name, model in MODELS.items():
            kind, text = scene(seed, model)
            times[name], found[name] = once(text)
        default = found["default"]
        assert default is not None, f"seed {seed}: the default fails"
        chosen = str(hybrid.parse_scene(default.scene_text).model.kind)
        taken[chosen] += 1
        named = found.get(chosen)
        same = named is not None and effort(named) == effort(default)
        one_of = ("default", chosen) if same else ("default",)
        ratio = np.nan
        for k in range(MORE + 1):
            least = min(times[x] for x in one_of)
            cheapest = min((x for x in MODELS if x != "default" and kept(found[x])), key=times.__getitem__, default="")
            if not (kept(default) and cheapest):
                break
            ratio = least / min(times[cheapest], least if cheapest in one_of else np.inf)
            if ratio <= DEARER or k == MORE:
                break
            for name in ("default", cheapest):
                times[name] = min(times[name], once(scene(seed, MODELS[name])[1])[0])
        ratios.append(ratio)
        zones = found.get("adaptive")
        rod = np.mean([(mesh.kinds == "rod").mean() for mesh in zones.mesh]) if zones is not None else np.nan
        line = ", ".join(f"{times[x]:6.2f}{'' if kept(found[x]) else '*'}" for x in MODELS)
        print(
            f"{seed:4d} {kind:10s} {rod:6.0%}  {line}  takes {chosen:9s}{'=' if same else ' '} {ratio:5.2f}", flush=True
        )
    x = np.array(ratios)[np.isfinite(ratios)]
    print(
        f"\n* misses 1 %, or fails; = the same runs as that model.  Chosen: {dict(taken)}; over the cheapest of {x.size} that meet: median {np.median(x):.2f}, ",
        end="",
    )
    print(", ".join(f"{p} % {np.percentile(x, p):.2f}" for p in (75, 90, 100)), end="; ")
    print(f"above {DEARER} in {np.sum(x > DEARER)}")
