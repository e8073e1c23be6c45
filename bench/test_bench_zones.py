"""Zones that move, fixed zones, catenaries and rods on one mesh: processor time of a step, and what zones leave out.

    pytest bench/test_bench_zones.py -m bench -n 0 -s
    HYBRID_BENCH_HOURS=3 HYBRID_BENCH_ROUNDS=0 pytest bench/test_bench_zones.py -m bench -n 0 -s -o faulthandler_timeout=0 -k riser

Times are of the time loop, smallest of ROUNDS runs in turns.  Errors are those of the whole field at all outputs after
the first period, s = 3 to 247 m, against a rod of many cells with half the step; of curvature over its largest.
"""

from __future__ import annotations

import copy
import os
import tempfile
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ZONE_EVENTS
from hybrid.kernels.mesh.cell_errors import CURVATURE
from hybrid.zones import change as zone_changes

pytestmark = pytest.mark.bench
EXAMPLES = Path(__file__).parents[1] / "examples"
ROUNDS, PERIOD = int(os.environ.get("HYBRID_BENCH_ROUNDS", "3")), 8.0
PLACES = np.arange(3.0, 247.01, 0.25)  # m: closer than sqrt(EI/T), 0.37 m
HOURS = float(os.environ.get("HYBRID_BENCH_HOURS", "0.25"))  # of the riser
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
    asked = zone_changes.shares_asked
    if share is not None:
        zone_changes.shares_asked = lambda *_: {CURVATURE: share}
    try:
        return hybrid.run(scene)
    finally:
        zone_changes.shares_asked = asked


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
    first = {name: make() for name, make in models.items()}  # which may compile; where no rounds are asked it counts
    rounds = [first] if ROUNDS == 0 else [{name: make() for name, make in models.items()} for _ in range(ROUNDS)]
    return {name: (min(per_step(x[name]) for x in rounds), rounds[0][name]) for name in models}


@pytest.mark.parametrize("space", [True, False], ids=["space", "plane"])
@pytest.mark.parametrize("mesh", MESHES)
def test_touchdown(mesh: str, space: bool) -> None:
    text, where = touchdown(space), MESHES[mesh]
    few = text | {"output": {"every": 50.0, "points": 11}}
    kinds: dict[str, tuple[Text, float | None]] = {
        "rods": ({"kind": "rod"}, None),
        "catenaries": ({"kind": "catenary"}, None),
        "zones that move, 5 mm": ({"kind": "adaptive", "tolerance": 2e-5}, None),
        "zones that move, 3 % of curvature": ({"kind": "adaptive"}, SHARE),
    }
    fine = reference(space)
    print(
        f"\ntouchdown {'in space' if space else 'in a plane'}, {mesh}: us a step with two outputs, over rods; with one of"
    )
    print(
        "977 points every second, over rods; rod cells; changes of zones, repeated steps; curvature off by at most, rms (of"
        " its largest); position (mm); tension (of its largest); curvature at most off rods on this mesh, after the first"
        " period"
    )
    steps = compared({name: partial(run, few, where, *x) for name, x in kinds.items()})
    found = compared({name: partial(run, text, where, *x) for name, x in kinds.items()})
    rods = found["rods"][0]
    for name, (time, result) in found.items():
        worst, rms, far, tension = errors(result, fine)
        changes = sum(e.kind in ZONE_EVENTS for e in result.events)
        repeats = int(np.sum(result["steps/repeats"][:]))
        from_rods = np.abs(result.curvature - found["rods"][1].curvature)[result.times > PERIOD].max()
        alone = steps[name][0]
        print(
            f"  {name:34s} {alone:5.0f}  {steps['rods'][0] / alone:4.2f} x  {time:5.0f}  {rods / time:4.2f} x"
            f"  {rod_cells(result):4.0f}  {changes:3d} {repeats:3d}"
            f"  {worst:6.2%} {rms:6.2%}  {1e3 * far:5.1f}  {tension:.2%}"
            f"  {from_rods / fine.curvature.max():6.2%}"
        )


SUSPENSION_STEPS = {80: 2000, 1000: 2000, 10_000: 400}  # the scene has 2000; of cells


def suspension(cells: int, space: bool, model: Text) -> hybrid.Result:
    """The suspension of the paper as it is released; in space with a current across it, which leads it out of its plane."""
    text = hybrid.load_scene(EXAMPLES / "02_suspension.yaml").model_dump(exclude_none=True)
    if space:
        text["environment"]["fluid"]["current"] = [0.0, 1.0, 0.0]
    else:
        text["dimension"] = 2
    text["time"] |= {"duration": SUSPENSION_STEPS[cells] * text["time"]["step"]}
    text["output"] = {"every": text["time"]["duration"], "points": 101}
    return run(text, {"cells": cells}, model)


def gains_of_a_joint(cells: int, space: bool) -> tuple[float, float]:
    """Processor time of a rod over that of the hybrid with its joint at 1.5 m of 2: of a step, and of the whole run."""
    models = ({"kind": "rod"}, {"kind": "zones", "zones": [{"catenary": 1.5}, {"rod": 0.5}]})
    spent: list[list[tuple[float, float]]] = [[], []]
    for _ in range(ROUNDS + 1):  # the first compiles
        for model, times in zip(models, spent, strict=True):
            begin = process_time()
            result = suspension(cells, space, model)
            times.append((per_step(result), process_time() - begin))
    rod, joint = (np.min(x[1:], axis=0) for x in spent)
    step, whole = (float(x) for x in rod / joint)
    return step, whole


@pytest.mark.parametrize("space", [True, False], ids=["space", "plane"])
@pytest.mark.parametrize("cells", SUSPENSION_STEPS)
def test_suspension(cells: int, space: bool) -> None:
    """The joint of the paper against a rod of the full length."""
    step, whole = gains_of_a_joint(cells, space)
    where = "in space" if space else "in a plane"
    print(f"\nsuspension {where}, {cells} cells: a step {step:.2f} x, whole runs {whole:.2f} x")


@pytest.mark.parametrize("asked", [0.03, 0.01])
def test_anchor(asked: float) -> None:
    """Curvature beside the anchor of the touchdown line, which the default meshes, against 4000 rods and half the step."""
    text = hybrid.load_scene(EXAMPLES / "touchdown.yaml").model_dump(exclude_none=True)
    text["time"] = {"duration": 40.0, "step": 0.05}
    text["output"] = {"every": 0.5, "points": [*np.arange(0.0, 4.0, 0.1), *np.arange(4.0, 250.1, 1.0)]}
    fine = run(text, {"cells": 4000}, {"kind": "rod"})
    free = {key: x for key, x in text.items() if key not in ("mesh", "model")}
    result = hybrid.run(
        hybrid.validate_scene(free | {"accuracy": {"curvature": f"{asked:.0%}"}, "time": {"duration": 40.0}})
    )
    off = np.abs(result.curvature - fine.curvature)[2:].max(axis=0) / fine.curvature.max()
    near = result.s < 4.0
    print(
        f"\nanchor: {asked:.0%} of curvature asked, {result.mesh[0].kinds.size} cells: off by {off[near].max():.1%} within "
        f"4 m of the anchor, {off[~near].max():.1%} beyond"
    )
    assert off.max() < 2.0 * asked


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


def tether(size: float) -> Text:
    """The S tether of the examples in a current that also goes across it, `size` times as long and deep."""
    text = hybrid.load_scene(EXAMPLES / "s_tether.yaml").model_dump(exclude_none=True)
    text["environment"]["fluid"]["current"] = [
        {"z": 0.0, "velocity": [0.2, 0.1, 0.0]}, {"z": -40.0 * size, "velocity": [0.05, 0.0, 0.0]},
    ]  # fmt: skip
    for section in text["cable"]["sections"]:
        section["length"] *= size
    text["ends"]["end"]["position"] = [20.0 * size, 0.0, -30.0 * size]
    for name in ("mesh", "model"):
        text.pop(name, None)
    text["output"] = {"every": 1.0, "points": 241}
    return text


@pytest.mark.parametrize("size", [1.0, 10.0], ids=["60 m", "600 m"])
def test_tether(size: float) -> None:
    """On the graded mesh that rods have for 1 %, most of which is in the bend: zones are to cost no more than rods."""
    text = tether(size)
    free = copy.deepcopy(text) | {"model": "rod", "accuracy": "1%"}
    free["time"].pop("step")
    nodes = hybrid.run(free).mesh[-1].s
    mesh = {"nodes": [float(x) for x in nodes]}
    models: dict[str, Callable[[], hybrid.Result]] = {
        "rods": lambda: run(text, mesh, {"kind": "rod"}),
        "zones that move": lambda: run(text, mesh, {"kind": "adaptive"}),
        "zones that move, 3 % of curvature": lambda: run(text, mesh, {"kind": "adaptive"}, SHARE),
    }
    found = compared(models)
    rods = found["rods"]
    print(
        f"\nS tether of {text['ends']['end']['position']} m, {nodes.size - 1} graded cells of {np.diff(nodes).min():.2g} to "
        f"{np.diff(nodes).max():.2g} m: us a step, over rods; rod cells; changes; off rods, m"
    )
    for name, (time, result) in found.items():
        changes = sum(e.kind in ZONE_EVENTS for e in result.events)
        far = np.linalg.norm(result.position - rods[1].position, axis=2).max()
        print(f"  {name:34s} {time:5.0f}  {time / rods[0]:4.2f}  {rod_cells(result):4.0f} {changes:4d}  {far:.3f}")


def riser() -> Text:
    """2000 m from a vessel that heaves down to an anchor, in 50 waves at 30 degrees and a sheared current, 5 m cells."""
    steel = {
        "length": 2000.0, "diameter": 0.2, "mass": 55.0, "axial_stiffness": 4e8, "bending_stiffness": 1e5,
        "torsional_stiffness": 8e4, "drag": {"normal": 1.1, "tangential": 0.01}, "added_mass": {"normal": 1.0},
        "damping": {"mass": 0.01},
    }  # fmt: skip
    heave = {"heave": {"amplitude": 0.6, "period": 11.0}, "sway": {"amplitude": 1.0, "period": 13.0}, "ramp": 20.0}
    return {
        "environment": {"fluid": {
            "density": 1025.0, "surface": 0.0,
            "current": [{"z": 0.0, "velocity": [0.6, 0.3, 0.0]}, {"z": -1900.0, "velocity": [0.1, 0.0, 0.0]}],
            "waves": {"kind": "jonswap", "significant_height": 5.0, "peak_period": 11.0, "direction": 30.0, "components": 50, "seed": 1,
                      "ramp": 20.0},
        }},
        "cable": {"sections": [steel]},
        "ends": {"start": {"kind": "pinned", "position": [480.0, 0.0, -1900.0]},
                 "end": {"kind": "pinned", "position": [0.0, 0.0, 10.0], "motion": heave}},
        "initial": "equilibrium", "contact": {"self": False},
        "time": {"duration": HOURS * 3600.0, "step": 0.1},
        "output": {"every": 1.0, "points": 401},
    }  # fmt: skip


def compare_with_rods(name: str, text: Text, mesh: Text, asked: dict[str, float | None], short: Text) -> None:
    """Rods, and zones that move by their tolerance or with a share of curvature, on one mesh: cost and what they are off.

    short: the same mesh with cells at the pins that show the layers there, of the rods that all are held against.
    """
    models: dict[str, Callable[[], hybrid.Result]] = {"rods": lambda: run(text, mesh, {"kind": "rod"})}
    for said, share in asked.items():
        models[said] = partial(run, text, mesh, {"kind": "adaptive"}, share)
    print(
        f"\n{name}: us a step, over rods; rod cells; changes; curvature off rods with short cells at the pins, of its"
    )
    print(
        "largest: at most, 99.9 % of all outputs and places, root mean square; standard deviation of the tension off by"
    )
    print("at most, of its own")
    found = compared(models)
    rods = run(text, short, {"kind": "rod"})
    later = rods.times > 60.0
    for said, (time, result) in found.items():
        off = np.abs(result.curvature - rods.curvature)[later] / rods.curvature[later].max()
        spread = np.abs(result.tension[later].std(axis=0) / rods.tension[later].std(axis=0) - 1.0)
        changes = sum(e.kind in ZONE_EVENTS for e in result.events)
        print(
            f"  {said:34s} {time:5.0f}  {found['rods'][0] / time:4.2f} x  {rod_cells(result):4.0f} {changes:4d}"
            f"  {off.max():6.2%} {np.quantile(off, 0.999):6.2%} {np.sqrt(np.mean(off**2)):6.3%}  {spread.max():.3%}"
        )


def test_riser() -> None:
    """HYBRID_BENCH_HOURS of it, a quarter of one if that is not given."""
    asked = {"zones that move": None, "zones that move, 1 % of curvature": 0.01}
    near = np.arange(0.0, 15.0, 0.25)
    nodes = np.unique(np.concatenate([near, np.linspace(0.0, 2000.0, 401), 2000.0 - near]))
    short = {"nodes": [float(x) for x in nodes]}
    compare_with_rods(f"riser of 2000 m, {HOURS:g} h", riser(), {"cells": 400}, asked, short)


def spread() -> Text:
    """Six lines of 2000 m from a vessel to anchors on a bed, in waves with a current; all fairleads move alike."""
    chain = {
        "length": 2000.0, "diameter": 0.15, "mass": 120.0, "axial_stiffness": 9e8, "bending_stiffness": 2e5,
        "torsional_stiffness": 1e5, "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    motion = {"heave": {"amplitude": 1.5, "period": 11.0}, "surge": {"amplitude": 2.0, "period": 60.0}, "ramp": 22.0}
    points: Text = {}
    lines: Text = {}
    for k in range(6):
        x, y = float(np.cos(np.pi * k / 3)), float(np.sin(np.pi * k / 3))
        points[f"anchor{k}"] = {"position": [1740 * x, 1740 * y, -800.0]}
        points[f"fairlead{k}"] = {"position": [20 * x, 20 * y, -10.0], "motion": motion}
        lines[f"line{k}"] = {
            "sections": [chain], "start": f"anchor{k}", "end": f"fairlead{k}", "mesh": {"cells": 200},
            "contact": {"self": False},
        }  # fmt: skip
    return {
        "environment": {
            "fluid": {
                "density": 1025.0, "surface": 0.0, "current": [0.3, 0.6, 0.0],
                "waves": {"kind": "jonswap", "significant_height": 5.0, "peak_period": 11.0, "direction": 30.0, "components": 50, "seed": 1,
                          "ramp": 20.0},
            },
            "seabed": {"z": -800.0, "stiffness": 2e5, "damping": 1e4, "friction": 0.5},
        },
        "points": points, "lines": lines, "time": {"duration": 300.0, "step": 0.1},
        "output": {"every": 1.0, "points": 201},
    }  # fmt: skip


def test_spread() -> None:
    """Whole runs with their files: rods, catenaries and zones that move by their tolerance, on the same mesh."""
    print(
        "\nspread of six lines of 2000 m, 200 cells each, 300 s: s of processor time, over rods; rod cells of a line on"
    )
    print("average; changes; tension off rods by at most, of its largest; position, m")
    models: dict[str, Any] = {"rods": "rod", "catenaries": "catenary", "zones that move": {"kind": "adaptive"}}
    found: dict[str, tuple[float, hybrid.Result]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(ROUNDS + 1):  # the first compiles
            for name, model in models.items():
                text = spread()
                for line in text["lines"].values():
                    line["model"] = model
                begin = process_time()
                result = hybrid.run(text, Path(folder) / f"{name}{k}.h5")
                spent = process_time() - begin
                if k > 0:
                    found[name] = (min(spent, found.get(name, (np.inf,))[0]), result)
        rods = found["rods"]
        for name, (spent, result) in found.items():
            pairs = [(result.lines[x], rods[1].lines[x]) for x in result.lines]
            cells = np.mean([rod_cells(x) for x, _ in pairs])
            changes = sum(e.kind in ZONE_EVENTS for e in result.events)
            tension = max(np.abs(x.tension - y.tension).max() / y.tension.max() for x, y in pairs)
            far = max(np.linalg.norm(x.position - y.position, axis=2).max() for x, y in pairs)
            print(
                f"  {name:16s} {spent:6.2f} {rods[0] / spent:5.2f} x  {cells:4.0f} {changes:4d}  {tension:.3%} {far:.4f}"
            )
