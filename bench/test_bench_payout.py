"""What paying a line out costs: a sagging line of 100 cells that grows by 43 %, against the same line of fixed length."""

from __future__ import annotations

import time
from statistics import median
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.kernels.mesh import remesh
from hybrid.simulation.payout_nodes import NodeChanges
from hybrid.simulation.run_payout import RunPayout
from hybrid.solve.network_steps import NetworkSteps
from tests.simulation.test_payout import clamped, kicks
from tests.simulation.test_payout import sagging as swung

pytestmark = pytest.mark.bench

RUNS = 5


def sagging(paid: bool, every: float = 0.5, cells: int = 100) -> hybrid.Scene:
    """1500 steps; 43 nodes enter where it is `paid` out.  every: s, outputs."""
    winch: dict[str, Any] = {
        "kind": "pinned", "position": [80, 0, 0], "motion": {"surge": {"amplitude": 1.0, "period": 7.0}, "ramp": 7.0},
    }  # fmt: skip
    section = {"length": 100.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 2e6}
    return hybrid.validate_scene({
        "cable": {"sections": [section]}, "initial": "equilibrium", "model": "catenary", "mesh": {"cells": cells},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, 0]},
            "end": winch | ({"payout": {"rate": 0.6, "ramp": 4.0}} if paid else {}),
        },
        "time": {"duration": 75.0, "step": 0.05}, "output": {"every": every},
    })  # fmt: skip


def test_cost_of_paying_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processor time of whole runs in memory, medians, alternating."""
    cases = {
        "fixed length": (sagging(False), True),
        "fixed length, as many cells as there are on average, 150 outputs": (sagging(False, 0.5, 121), True),
        "fixed length, as many cells as there are on average, 2 outputs": (sagging(False, 37.5, 121), True),
        "paid out, 150 outputs": (sagging(True), True),
        "paid out, 150 outputs, looked at between nodes": (sagging(True), False),
        "paid out, 2 outputs": (sagging(True, 37.5), True),
    }
    together, taken = NodeChanges.may_change, {name: list[float]() for name in cases}
    in_steps, within, go = {name: list[float]() for name in cases}, [0.0], NetworkSteps.go

    def timed(run: NetworkSteps, *by: Any) -> int:
        begin = time.process_time()
        code = go(run, *by)
        within[0] += time.process_time() - begin
        return code

    monkeypatch.setattr(NetworkSteps, "go", timed)
    for _ in range(RUNS + 1):
        for name, (scene, joined) in cases.items():
            monkeypatch.setattr(NodeChanges, "may_change", staticmethod(together if joined else lambda *_: False))
            within[0] = 0.0
            begin = time.process_time()
            hybrid.run(scene)
            taken[name].append(time.process_time() - begin)
            in_steps[name].append(within[0])
    found = {name: median(times[1:]) for name, times in taken.items()}
    compiled = {name: median(times[1:]) for name, times in in_steps.items()}
    fixed, as_many, as_many_few, joined, alone, few = found.values()
    for name, x in found.items():
        part = compiled[name]
        print(
            f"{name}: {x:.3f} s, {x / fixed:.2f}; {part:.3f} s of it in compiled steps, {1e3 * (x - part):.0f} ms not"
        )
    print(f"150 outputs, against as many cells: {joined / as_many:.2f}; 2 outputs: {few / as_many_few:.2f}")
    _, _, steps, *_, paid = compiled.values()
    print(f"compiled steps alone, per cell and step, against a fixed line's: {paid / steps:.2f}")
    assert joined < alone


NODES = {
    "zones stay": ("catenary", {}),
    "tension over strain by a table": ("catenary", {"tension_strain": [[0, 0], [0.05, 1e5], [0.09, 2e5]]}),
    "zones that move": ({"kind": "adaptive", "tolerance": 1e-3, "hold_time": 1.0}, {"bending_stiffness": 500.0}),
    "cells that follow": (
        {"kind": "adaptive", "tolerance": 1e-3, "hold_time": 1.0, "curvature_error": 0.05, "rod_cell": 1.0},
        {"bending_stiffness": 500.0},
    ),
}


def test_cost_of_a_node(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processor time of a node that enters a line of 100 cells and more, alone: median of a run, least of three runs."""
    taken: list[float] = []

    compiled: list[float] = []

    def timed(change: Any, taken: list[float]) -> Any:
        def wrapped(self: Any, *more: Any) -> None:
            begin = time.process_time_ns()
            change(self, *more)
            taken.append(1e-6 * (time.process_time_ns() - begin))

        return wrapped

    monkeypatch.setattr(RunPayout, "_change", timed(RunPayout._change, taken))
    monkeypatch.setattr(RunPayout, "_change_by_itself", timed(RunPayout._change_by_itself, taken))
    monkeypatch.setattr(remesh, "change_cells", timed(remesh.change_cells, compiled))
    for name, (model, section) in NODES.items():
        scene = sagging(True, 37.5).model_dump(mode="json", exclude_none=True)
        scene["model"] = model
        scene["cable"]["sections"][0] |= section
        if "tension_strain" in section:
            del scene["cable"]["sections"][0]["axial_stiffness"]
        each, alone = [], []
        for _ in range(4):
            taken.clear()
            compiled.clear()
            hybrid.run(scene)
            each.append(median(taken))
            alone.append(median(compiled) if compiled else np.nan)
        within = (
            f", {min(alone[1:]):.3f} ms of it compiled, which is all inside the loop" if compiled else ", in Python"
        )
        print(f"{name}: {min(each[1:]):.2f} ms a node, of {len(taken)}{within}")
        assert not compiled or min(alone[1:]) < 0.3


# Ripple: the largest difference, %, of the pull at the winch from a line of 160 cells before neighbours of a new node were
# balanced (behind a clamp from a line that rippled itself).
RIPPLES = {
    "catenary": ("catenary", None, None, 40, False, 0.06),
    "catenary, EA 2e6": ("catenary", 2e6, None, 40, False, 0.08),
    "rod EI 2e4": ("rod", None, 2e4, 40, False, 0.09),
    "rod EI 2e4, EA 2e6": ("rod", 2e6, 2e4, 40, False, 0.28),
    "clamped": ("rod", None, 2e4, 40, True, 1.43),
    "clamped, EA 2e6": ("rod", 2e6, 2e4, 40, True, 1.22),
    "clamped, 80 cells": ("rod", None, 2e4, 80, True, 0.74),
    "clamped, EA 2e6, 80 cells": ("rod", 2e6, 2e4, 80, True, 0.46),
}


def swinging(
    model: str, EA: float | None, EI: float | None, clamp: bool, cells: int, paid: bool = True
) -> hybrid.Scene:
    """100 m over 80 m, `paid` out at 0.8 m/s; the winch surges by 1 m in 7 s."""
    section: dict[str, Any] = {"length": 100.0, "mass": 5.0, "diameter": 0.05}
    section |= ({"axial_stiffness": EA} if EA else {}) | ({"bending_stiffness": EI} if EI else {})
    winch: dict[str, Any] = {
        "kind": "pinned", "position": [80, 0, 0],
        "motion": {"surge": {"amplitude": 1.0, "period": 7.0}, "ramp": 7.0},
    }  # fmt: skip
    winch |= {"payout": {"rate": 0.8, "ramp": 4.0}} if paid else {}
    winch |= {"kind": "clamped", "tangent": [1.0, 0.0, 0.5]} if clamp else {}
    return hybrid.validate_scene({
        "cable": {"sections": [section]}, "initial": "equilibrium", "model": model, "mesh": {"cells": cells},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": winch},
        "time": {"duration": 20.0, "step": 0.05}, "output": {"every": 0.05},
    })  # fmt: skip


def pull(scene: hybrid.Scene) -> np.ndarray:
    """Force at the winch, N."""
    return np.asarray(np.linalg.norm(hybrid.run(scene)["reaction_end"], axis=1))


def test_ripple_of_the_pull() -> None:
    """All of a run but its first two seconds, so that the error of the mesh is in it, which a fixed length has alone."""
    fine: dict[Any, np.ndarray] = {}
    still: dict[Any, np.ndarray] = {}
    for name, (model, EA, EI, cells, clamp, before) in RIPPLES.items():
        line = model, EA, EI, clamp
        if line not in fine:
            fine[line], still[line] = pull(swinging(*line, 160)), pull(swinging(*line, 160, False))
        found = np.abs(pull(swinging(*line, cells)) - fine[line])[40:].max() / fine[line].mean()
        mesh = np.abs(pull(swinging(*line, cells, False)) - still[line])[40:].max() / still[line].mean()
        print(f"{name}: {100.0 * found:.3f} % (before: {before} %); of a fixed length {100.0 * mesh:.3f} %")
        assert found < 2e-3


@pytest.mark.parametrize("clamp", [False, True])
@pytest.mark.parametrize("EI", [2e4, 500.0])
@pytest.mark.parametrize("rate", [0.8, -0.8])
def test_kicks_where_cells_follow(rate: float, EI: float, clamp: bool) -> None:
    """Of the pull within five steps, by a node that enters or leaves and what merges with it; docs/payout.md."""
    model = {"kind": "adaptive", "tolerance": 1e-5, "hold_time": 1.0, "curvature_error": 0.05, "force_rod": [[0, 100]]}
    scene = swung("rod", 2e6, EI, rate, duration=12.0) | {"model": model}
    found = kicks(clamped(scene) if clamp else scene)
    print(f"EI {EI:g} N m2, {rate:g} m/s, {'clamped' if clamp else 'pinned'}: {100.0 * max(found):.3f} % of the mean")
    assert max(found) < 1e-3
