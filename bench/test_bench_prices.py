"""What a step of rods, catenaries and zones that move costs on one mesh, over rods, against hybrid/model/plan.py.

    pytest bench/test_bench_prices.py -m bench -n 0 -s

Whole runs without an error figure, 50 to 400 equal cells, in space and in the plane; every model is run ROUNDS times in
turns.  Ratios are medians over the rounds of what two runs of one round took, so that what else the machine does falls
out of them.  Prices are slopes over the cells, per iteration, in parts of that of a bare rod's cell in space.
"""

from __future__ import annotations

import copy
import os
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.model.build import build
from hybrid.model.plan import step_time
from hybrid.scene.read import one_line

pytestmark = pytest.mark.bench
ROUNDS, STEPS = int(os.environ.get("HYBRID_BENCH_ROUNDS", "5")), 300
CELLS, LENGTH = (50, 100, 200, 400), 250.0
CLOSE = 1.2  # within which a ratio of two steps is that of their prices
QUARTER = (75.0, 137.5)  # m, of the zones that move with a rod of that length
LINE: dict[str, Any] = {
    "length": LENGTH,
    "diameter": 0.05,
    "mass": 20.0,
    "axial_stiffness": 2e8,
    "bending_stiffness": 2e3,
}
WET: dict[str, Any] = {"drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0}}
SEA = {"kind": "jonswap", "significant_height": 3.0, "peak_period": 11.0, "components": 50, "seed": 1, "ramp": 10.0}
BED = {"z": -100.0, "stiffness": 5e3, "damping": 5e2}
ZONES = {"kind": "adaptive", "always_move": True, "tolerance": 1e-2}
MODELS: dict[str, Any] = {
    "rods": {"kind": "rod"}, "catenaries": {"kind": "catenary"}, "zones, no rod": ZONES,
    "zones, a quarter": ZONES | {"force_rod": [QUARTER]},
}  # fmt: skip
KINDS = "bare", "wet", "on a bed", "in waves"


def scene(kind: str, space: bool) -> dict[str, Any]:
    """A line of 250 m between two ends, of which one heaves; without water, in a current, on a bed, in 50 waves."""
    across = 0.5 if space else 0.0
    around: dict[str, Any] = {} if kind == "bare" else {"fluid": {"density": 1025.0, "current": [0.2, across, 0.0]}}
    if kind == "on a bed":
        around["seabed"] = BED
    if kind == "in waves":
        around["fluid"] |= {"surface": 2.0, "waves": SEA | {"direction": 60.0 if space else 0.0}}
    top = {"heave": {"amplitude": 2.0, "period": 8.0}, "ramp": 16.0}
    if space:
        top["sway"] = {"amplitude": 1.0, "period": 9.0}
    return {
        "environment": around,
        "cable": {"sections": [LINE if kind == "bare" else LINE | WET]},
        "ends": {"start": {"kind": "pinned", "position": [0.0, 0.0, -100.0]},
                 "end": {"kind": "pinned", "position": [205.0, 0.0, 0.0], "motion": top}},
        "dimension": 3 if space else 2, "initial": "equilibrium", "contact": {"self": False},
        "time": {"duration": 0.1 * STEPS, "step": 0.1}, "output": {"every": 0.1 * STEPS, "points": 11},
    }  # fmt: skip


def timed(text: dict[str, Any], cells: int, model: Any) -> tuple[float, float, float]:
    """us of processor time of a step, its iterations, and cells that are rod."""
    found = hybrid.run(copy.deepcopy(text) | {"mesh": {"cells": cells}, "model": model})
    rods = float(np.mean([(mesh.kinds == "rod").sum() for mesh in found.mesh]))
    return 1e6 * float(found.steps["cpu"][-1]) / len(found.steps["t"]), float(found.steps["iterations"].mean()), rods


def foretold(text: dict[str, Any], cells: int, name: str, rods: float) -> float:
    """us of a step by the prices."""
    asked = hybrid.validate_scene(copy.deepcopy(text) | {"mesh": {"cells": cells}, "model": {"kind": "rod"}})
    return 1e6 * step_time(one_line(asked), build(one_line(asked)), rods, cells - rods, moves=name.startswith("zones"))


@pytest.mark.parametrize("space", [True, False], ids=["space", "plane"])
def test_prices(space: bool) -> None:
    """Every ratio to rods within CLOSE of that of the prices."""
    print(f"\n{'in space' if space else 'in the plane'}: us a step of rods; a step over that of rods, as priced")
    far, slopes = {}, {}
    for kind in KINDS:
        text = scene(kind, space)
        spent = np.zeros((len(CELLS), len(MODELS), ROUNDS, 3))
        for cells, each in zip(CELLS, spent, strict=True):
            for k in range(-1, ROUNDS):  # the first loads what is compiled
                for name, tries in zip(MODELS, each, strict=True):
                    tries[k] = timed(text, cells, MODELS[name])
            ratio = np.median(each[..., 0] / each[0, :, 0], axis=1)
            priced = np.array([foretold(text, cells, x, tries[0, 2]) for x, tries in zip(MODELS, each, strict=True)])
            priced /= priced[0]
            said = "  ".join(f"{x} {a:.2f} ({b:.2f})" for x, a, b in list(zip(MODELS, ratio, priced, strict=True))[1:])
            print(f"  {kind:9s} {cells:4d} cells  {each[0, :, 0].min():6.1f}  {said}", flush=True)
            far |= {(kind, cells, x): float(a / b) for x, a, b in zip(MODELS, ratio, priced, strict=True)}
        least = spent[..., 0].min(axis=2) / spent[:, :, 0, 1]
        slopes[kind] = [np.polyfit(CELLS, x, 1, w=1.0 / x) for x in least.T]
    print("  us per cell and iteration, and of a step's own per iteration:")
    for kind, found in slopes.items():
        said = "  ".join(f"{x} {a:.3f}, {b:.1f}" for x, (a, b) in zip(MODELS, found, strict=True))
        print(f"  {kind:9s} {said}")
    off = {x: r for x, r in far.items() if not 1.0 / CLOSE < r < CLOSE}
    assert not off, f"{len(off)} of {len(far)} are off by more than {CLOSE}: {off}"
