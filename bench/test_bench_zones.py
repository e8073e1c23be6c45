"""Zones that move, fixed zones, catenaries and rods on one mesh: processor time of a step, and what zones leave out.

    pytest bench/test_bench_zones.py -m bench -n 0 -s

Times are of the time loop, smallest of ROUNDS runs in turns.  Errors are those of the whole field at all outputs after
the first period, s = 3 to 247 m, against a rod of many cells with half the step; of curvature over its largest.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ZONE_EVENTS
from hybrid.kernels.mesh.cell_errors import CURVATURE
from hybrid.simulation import initial_zones

pytestmark = pytest.mark.bench
EXAMPLES = Path(__file__).parents[1] / "examples"
ROUNDS, PERIOD = 3, 8.0
PLACES = np.arange(3.0, 247.01, 0.25)  # m: closer than sqrt(EI/T), 0.37 m
SHARE = 0.03  # of the largest curvature that leaving bending out may make
Text = dict[str, Any]


def graded(cells: int, middle: float, half: float, shortest: float, longest: float, growth: float) -> list[float]:
    """Nodes (m) of 250 m, shortest cells over 2 x half about the middle, growing with the distance from there."""
    s = np.linspace(0.0, 250.0, 20001)
    h = np.minimum(shortest + growth * np.maximum(np.abs(s - middle) - half, 0.0), longest)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (1.0 / h[1:] + 1.0 / h[:-1]) * np.diff(s))])
    found: list[float] = np.interp(np.linspace(0.0, count[-1], cells + 1), count, s).tolist()
    return found


MESHES: dict[str, Text] = {
    "graded, 120 cells": {"nodes": graded(120, 96.5, 6.5, 0.65, 4.0, 0.07)},
    "100 equal cells": {"cells": 100},
    "400 equal cells": {"cells": 400},
}


def touchdown(space: bool) -> Text:
    """The mooring line of the examples, in a current across it."""
    text = hybrid.load_scene(EXAMPLES / "touchdown.yaml").model_dump(exclude_none=True)
    if space:
        text["environment"]["fluid"]["current"] = [0.0, 0.5, 0.0]
    text["output"] = {"every": 1.0, "points": PLACES.tolist()}
    return text


def run(text: Text, mesh: Text, model: Text, share: float | None = None) -> hybrid.Result:
    """share: of curvature, as an accuracy asks for it, but without its runs to compare with."""
    scene = hybrid.validate_scene(copy.deepcopy(text) | {"mesh": mesh, "model": model})
    asked = initial_zones.shares_asked
    if share is not None:
        initial_zones.shares_asked = lambda *_: {CURVATURE: share}
    try:
        return hybrid.run(scene)
    finally:
        initial_zones.shares_asked = asked


def per_step(result: hybrid.Result) -> float:
    """us of processor time."""
    return 1e6 * float(result.steps["cpu"][-1]) / len(result.steps["t"])


def rod_cells(result: hybrid.Result) -> float:
    """On average over outputs."""
    return float(np.mean([(mesh.kinds == "rod").sum() for mesh in result.mesh]))


@cache
def reference(space: bool) -> hybrid.Result:
    text = touchdown(space)
    text["time"]["step"] /= 2
    return run(text, {"cells": 2500}, {"kind": "rod"})


def errors(result: hybrid.Result, fine: hybrid.Result) -> tuple[float, float, float, float]:
    """Largest and root mean square of curvature (parts of the largest), of position (m), of tension (of the largest)."""
    later = result.times > PERIOD
    curvature = np.abs(result.curvature - fine.curvature)[later] / fine.curvature.max()
    far = np.linalg.norm(result.position - fine.position, axis=2)[later].max()
    tension = np.abs(result.tension - fine.tension)[later].max() / fine.tension.max()
    return float(curvature.max()), float(np.sqrt(np.mean(curvature**2))), float(far), float(tension)


def compared(models: Mapping[str, Callable[[], hybrid.Result]]) -> dict[str, tuple[float, hybrid.Result]]:
    """us a step, the smallest of ROUNDS in turns, and a result of each."""
    for make in models.values():
        make()
    rounds = [{name: make() for name, make in models.items()} for _ in range(ROUNDS)]
    return {name: (min(per_step(x[name]) for x in rounds), rounds[0][name]) for name in models}


@pytest.mark.parametrize("space", [True, False], ids=["space", "plane"])
@pytest.mark.parametrize("mesh", MESHES)
def test_touchdown(mesh: str, space: bool) -> None:
    text, where = touchdown(space), MESHES[mesh]
    models: dict[str, Callable[[], hybrid.Result]] = {
        "rods": lambda: run(text, where, {"kind": "rod"}),
        "catenaries": lambda: run(text, where, {"kind": "catenary"}),
        "zones that move, 5 mm": lambda: run(text, where, {"kind": "adaptive", "tolerance": 2e-5}),
        "zones that move, 3 % of curvature": lambda: run(text, where, {"kind": "adaptive"}, SHARE),
    }
    fine = reference(space)
    print(f"\ntouchdown {'in space' if space else 'in a plane'}, {mesh}: us a step, over rods; rod cells; changes of")
    print(
        "zones, repeated steps; curvature off by at most, rms (of its largest); position (mm); tension (of its largest);"
        " curvature at most off rods on this mesh, after the first period"
    )
    found = compared(models)
    rods = found["rods"][0]
    for name, (time, result) in found.items():
        worst, rms, far, tension = errors(result, fine)
        changes = sum(e.kind in ZONE_EVENTS for e in result.events)
        repeats = int(np.sum(result["steps/repeats"][:]))
        from_rods = np.abs(result.curvature - found["rods"][1].curvature)[result.times > PERIOD].max()
        print(
            f"  {name:34s} {time:5.0f}  {rods / time:4.2f} x  {rod_cells(result):4.0f}  {changes:3d} {repeats:3d}"
            f"  {worst:6.2%} {rms:6.2%}  {1e3 * far:5.1f}  {tension:.2%}"
            f"  {from_rods / fine.curvature.max():6.2%}"
        )


@pytest.mark.parametrize("space", [True, False], ids=["space", "plane"])
@pytest.mark.parametrize("cells", [80, 1000, 10_000])
def test_suspension(cells: int, space: bool) -> None:
    """The suspension of the paper with its joint at 1.5 m of 2: whole runs of 50 steps, against a rod of its full length.

    In space a current across it, which leads it out of its plane.
    """
    text = hybrid.load_scene(EXAMPLES / "02_suspension.yaml").model_dump(exclude_none=True)
    if space:
        text["environment"]["fluid"]["current"] = [0.0, 1.0, 0.0]
    else:
        text["dimension"] = 2
    text["time"] |= {"duration": 50 * text["time"]["step"]}
    text["output"] = {"every": text["time"]["duration"], "points": 101}
    joined = {"kind": "zones", "zones": [{"catenary": 1.5}, {"rod": 0.5}]}
    found = compared({
        "rod": lambda: run(text, {"cells": cells}, {"kind": "rod"}),
        "joint": lambda: run(text, {"cells": cells}, joined),
    })  # fmt: skip
    rod, joint = (found[name][0] for name in ("rod", "joint"))
    where = "in space" if space else "in a plane"
    print(
        f"\nsuspension {where}, {cells} cells: rod {rod:.0f} us a step, joint at 1.5 m {joint:.0f}: {rod / joint:.2f} x"
    )


def test_accuracy_of_the_touchdown() -> None:
    """Rods, zones that move and the default at 1 % of position and tension and 3 % of curvature: all passes counted."""
    text = touchdown(True)
    for name in ("mesh", "model"):
        text.pop(name)
    text["time"].pop("step")
    text["accuracy"] = {"position": "1%", "tension": "1%", "curvature": "3%"}
    models: dict[str, Any] = {"default": None, "rods": "rod", "zones": {"kind": "adaptive", "always_move": True}}
    print("\ntouchdown in space, accuracy: s of processor time; runs, cells, rod cells, steps; events")
    for name, model in models.items():
        scene = copy.deepcopy(text) | ({"model": model} if model else {})
        for _ in range(2):
            begin = process_time()
            result = hybrid.run(copy.deepcopy(scene))
            spent = process_time() - begin
        kinds = sorted({e.kind for e in result.events if e.kind not in ZONE_EVENTS})
        runs, cells = result.attributes["effort_runs"], result.mesh[-1].kinds.size
        print(
            f"  {name:8s} {spent:5.2f}  {runs:3d} {cells:5d} {rod_cells(result):5.0f} {len(result.steps['t']):6d}  {kinds}"
        )
