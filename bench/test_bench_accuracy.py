"""Accuracy that is asked for: what is achieved, how true the figures are, what it costs, and what steps that follow gain.

    pytest bench -m bench -s -k "accuracy and (asked or steps or share)"

The truth is an all-rod run asked for a fifth of the finest accuracy.  Scenes are the examples, without their own
step, mesh and tolerance; CPU time is that of all runs that an accuracy takes, the coarser ones included.
"""

from __future__ import annotations

import functools
import os
import sys
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
import pytest

import hybrid
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution
from hybrid.scene.root import LINE
from hybrid.simulation.case import Case

sys.path.insert(0, str(Path(__file__).parent.parent))
from problems import whip

pytestmark = pytest.mark.bench
EXAMPLES = Path(__file__).parents[1] / "examples"
ASKED = (10.0, 3.0, 1.0, 0.3, 0.1)  # %
TRUTH = "0.03%"
MOVING = {"kind": "adaptive", "always_move": True}
# Scenes, models they are run as, and settings.  Friction decides where a cable lies in `slack_on_seabed`.
SCENES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "touchdown": (("rod", "catenary", "adaptive"), ()),
    "s_tether": (("rod", "adaptive"), ()),
    "rov_tether": (("rod", "adaptive"), ()),
    "laying": (("rod", "adaptive"), ()),
    "slack_on_seabed": (("rod", "adaptive"), ()),
    "02_suspension": (("rod",), ()),
    "06_whip": (("rod",), ("time.duration=0.42", "output.every=0.01")),
}


def load(name, accuracy, model, settings=()):
    kind = "{kind: adaptive, always_move: true}" if model == "adaptive" else model  # not what costs less
    own = ("time.step=null", "mesh=null", f"model={kind}")
    return hybrid.load_scene(EXAMPLES / f"{name}.yaml", [f"accuracy={accuracy}", *own, *settings])


def reactions(result):
    return [np.array(result[x]) for x in ("reaction_start", "reaction_end")]


def pulls(result):
    return [np.linalg.norm(x, axis=1) for x in reactions(result)]


@functools.cache
def truth(name):
    result = hybrid.run(load(name, TRUTH, "rod", SCENES[name][1]))
    missed = [e.text for e in result.events if e.kind == "accuracy missed"]
    said = result.attributes
    print(
        f"{name}: truth of {said['cells']} cells, {len(result['steps/t'])} steps; its own error "
        f"{said['error_total_position']:.1e} m, {said['error_total_end_force']:.1e} N {missed}"
    )
    return result


@functools.cache
def row(name, model, percent):
    """Errors as parts of what is asked, effectivities, and CPU seconds."""
    exact = truth(name)
    begin = process_time()
    result = hybrid.run(load(name, f"{percent}%", model, SCENES[name][1]))
    cpu = process_time() - begin
    said, length = result.attributes, result.s[-1]
    position = np.linalg.norm(result.position - exact.position, axis=2).max()
    # as a vector, which is what is asked and what the figure is of; until 0.6 its magnitude was compared here, whose
    # error is half of that in a line that swings, and figures seemed twice as large as they are
    both = zip(reactions(result), reactions(exact), strict=True)
    force = max(np.linalg.norm(a - b, axis=1).max() for a, b in both)
    whole = max(x.max() for x in pulls(exact))
    kinds = {e.kind for e in result.events}
    out = {
        "position": position / (percent / 100 * length), "pull": force / (percent / 100 * whole),
        "effect position": said.get("error_total_position", np.nan) / position,
        "effect pull": said.get("error_total_end_force", np.nan) / force,
        "cpu": cpu, "missed": bool(kinds & {"accuracy missed", "no error figure"}),
    }  # fmt: skip
    print(
        f"  {name:16s} {model:9s} {percent:5g} %  cells {said['cells']:5d} steps {len(result['steps/t']):6d} runs "
        f"{said['effort_runs']}  achieved/asked {out['position']:.2f} {out['pull']:.2f}  estimated/true "
        f"{out['effect position']:.2f} {out['effect pull']:.2f}  {cpu:.2f} s {'MISSED, said' if out['missed'] else ''}"
    )
    return out


def test_accuracy_asked_and_achieved():
    """Achieved at most as asked in 95 % of cases; estimates 0.7 to 3 times the truth in 90 %, asked of the project."""
    rows = [row(n, m, p) for n, (models, _) in SCENES.items() for m in models for p in ASKED]
    within = [max(r["position"], r["pull"]) <= 1.0 for r in rows]
    silent = [max(r["position"], r["pull"]) > 1.0 and not r["missed"] for r in rows]
    for what in ("effect position", "effect pull"):
        e = np.array([r[what] for r in rows if np.isfinite(r[what])])
        print(
            f"{what}: {np.mean((e >= 0.7) & (e <= 3.0)):.0%} within 0.7 to 3, {np.mean(e < 0.5):.0%} below 0.5, median "
            f"{np.median(e):.2f}, 5 to 95 % {np.percentile(e, 5):.2f} to {np.percentile(e, 95):.2f}, {e.size} figures"
        )
    print(f"achieved at most as asked: {np.mean(within):.0%} of {len(rows)}; missed in silence: {np.mean(silent):.0%}")
    for n, (models, _) in SCENES.items():
        for m in models:
            cost = [row(n, m, p)["cpu"] for p in ASKED]
            slope = np.polyfit(np.log(ASKED), np.log(cost), 1)[0]
            print(f"  {n} {m}: CPU grows as asked^{slope:.2f}, {' '.join(f'{c:.2f}' for c in cost)} s")
    assert np.mean(within) >= 0.9
    assert np.mean(silent) <= 0.05


QUANTITIES = ("position", "tension", "curvature", "bending_moment", "end_force_start", "end_force_end")


def test_accuracy_is_met_without_much_to_spare():
    """The figure over what is asked, of what decides: position and forces asked for, then positions alone."""
    scenes = [*((name, more) for name, (_, more) in SCENES.items()), ("01_hanging_chain", ())]
    for asked, percents, names in (
        ("{0}%", (3, 1, 0.3), scenes), ("{{position: {0}%}}", (0.1, 0.03), [*scenes[:4], scenes[5]]),
    ):  # fmt: skip
        found = []
        for name, more in names:
            for percent in percents:
                sets = [f"accuracy={asked.format(percent)}", "time.step=null", "mesh=null", *more]
                what = hybrid.load_scene(EXAMPLES / f"{name}.yaml", sets).model_dump(exclude_unset=True, mode="json")
                what.pop("model", None)
                result, part = hybrid.run(what), percent / 100.0
                said = result.attributes["error_total_position"] / (part * result.s[-1])
                if asked == "{0}%":
                    force = part * max(x.max() for x in pulls(result))
                    said = max(said, result.attributes["error_total_end_force"] / force)
                found.append(said)
                print(
                    f"  {name:16s} {asked.format(percent):18s} figure/asked {said:.2f}, {result.attributes['cells']} cells"
                )
        print(f"{asked}: {min(found):.2f} to {max(found):.2f}, median {np.median(found):.2f}")
        assert np.median(found) > 1.0 / 3.0


def errors_of(result, exact, name):
    """Largest true error of one of QUANTITIES, a vector for forces at ends."""
    own = name.replace("end_force", "reaction")
    off = np.array(result[own]) - np.array(exact[own])
    vector = own != name or name == "position"
    return float(np.max(np.linalg.norm(off, axis=-1) if vector else np.abs(off)))


@pytest.mark.parametrize("model", [None, MOVING], ids=["chosen", "zones that move"])
def test_accuracy_figures_of_random_scenes(model):
    """Estimated over true error of what a scene of bench/random_scenes.py has, asked for 1 %, against rods at 0.1 %.

    A truth whose own error is not below half of either says nothing and is left out.
    """
    from random_scenes import random_scene

    found = {name: [] for name in QUANTITIES}
    silent, missed = [], []
    for seed in range(40, 70):
        scene = random_scene(seed)[1]
        scene = {k: v for k, v in scene.items() if k != "model"} | {"time": {"duration": scene["time"]["duration"]}}
        try:
            exact = hybrid.run(scene | {"model": "rod", "accuracy": "0.1%"})
            result = hybrid.run(scene | {"accuracy": "1%"} | ({"model": model} if model else {}))
        except hybrid.ComputationError as error:
            print(f"seed {seed}: {str(error).splitlines()[0]}")
            continue
        kinds = {e.kind for e in result.events}
        if kinds & {"irregular motion", "no error figure"}:
            continue
        for name in QUANTITIES:
            if f"total/{name}" not in result.errors:
                continue
            said, true = (float(np.max(x.errors[f"total/{name}"])) for x in (result, exact))
            off = errors_of(result, exact, name)
            if off > 0.0 and true < 0.5 * max(said, off):
                found[name].append(said / off)
                uncertain = kinds & {"error uncertain", "not converged", "model error not estimated"}
                if said < 0.5 * off and not uncertain:
                    silent.append(f"{seed} {name} {said / off:.2f}")
                if not 0.7 <= said / off <= 3.0:
                    missed.append(f"{seed} {name} {said / off:.2f}")
    for name, each in found.items():
        e = np.array(each)
        print(
            f"{name:16s} {np.mean((e >= 0.7) & (e <= 3.0)):.0%} within 0.7 to 3 of {e.size}, median {np.median(e):.2f}"
        )
    each = np.concatenate([*found.values()])
    within = np.mean((each >= 0.7) & (each <= 3.0))
    print(f"model {model}: {within:.1%} of {each.size}; below 0.5 in silence: {silent}; outside: {missed}")
    assert within > (0.6 if model else 0.85)


@pytest.mark.parametrize("asked", ["1%", "curvature", "80 cells", "zones that move"])
def test_accuracy_figures_beside_ends(asked):
    """Error figure of curvature of lines at rest over the distance to rods asked for 0.05 % of it: layers at ends.

    Of 80 equal cells most layers are shorter than a cell.
    """
    from random_scenes import hanging_line

    curvature = {"accuracy": {"curvature": "2%"}}
    more = {"1%": {"accuracy": "1%"}, "curvature": curvature, "80 cells": {"model": "rod", "mesh": {"cells": 80}}}
    ratios, silent, said, off_most = [], [], 0, 0.0
    for seed in range(200):
        scene = hanging_line(seed)
        exact = hybrid.static(scene | {"model": "rod", "accuracy": {"curvature": "0.05%"}})
        figure = {"output": scene["output"] | {"errors": True}}
        try:
            result = hybrid.static(scene | figure | more.get(asked, curvature | {"model": MOVING}))
        except hybrid.ComputationError as error:
            print(f"seed {seed}: {str(error).splitlines()[0]}")
            continue
        off = float(np.abs(result["curvature"] - exact["curvature"]).max())
        own, largest = float(exact.errors["total/curvature"].max()), float(exact["curvature"].max())
        if "total/curvature" not in result.errors or off < 1e-3 * largest or off < 3.0 * own:
            continue
        if {e.kind for e in result.events} & {"error uncertain", "not converged", "several equilibria"}:
            said += 1
            continue
        ratios.append(float(result.errors["total/curvature"].max()) / off)
        if ratios[-1] < 0.5:
            silent.append(f"{seed}: {ratios[-1]:.2f}, off by {off / largest:.1e}")
            off_most = max(off_most, off / largest)
    e = np.array(ratios)
    print(
        f"{asked}: {np.mean((e >= 0.7) & (e <= 3.0)):.1%} of {e.size} within 0.7 to 3, {np.sum(e > 3.0)} above, median "
        f"{np.median(e):.2f}, {said} said to be uncertain; below 0.5 in silence: {silent}"
    )
    assert len(silent) <= 2 and off_most < 0.02  # what is asked


@pytest.mark.parametrize("seeds", [int(os.environ.get("HYBRID_BENCH_SEEDS", "200"))])
def test_accuracy_figures_of_fixed_settings(seeds):
    """Error figure of scenes of bench/random_scenes.py, steps and cells their own, over distance to rods on a quarter.

    Rods that begin from another of several equilibria are not the same scene: they are named and left out.
    """
    from random_scenes import random_scene

    found, others = [], []
    for seed in range(seeds):
        text = random_scene(seed)[1]
        result = hybrid.run(text | {"output": text["output"] | {"errors": True}})
        cells = min(4 * max(mesh.kinds.size for mesh in result.mesh), 1500)
        step = {"step": text["time"]["step"] / 4}
        fine = hybrid.run(text | {"model": "rod", "mesh": {"cells": cells}, "time": text["time"] | step})
        off = np.linalg.norm(result.position - fine.position, axis=2).max(axis=1)
        true = float(off.max())
        if off[0] > 0.05 * result.s[-1]:
            others.append(seed)
            continue
        kinds = {e.kind for e in result.events} & {"error uncertain", "several equilibria", "model error not estimated"}
        found.append((result.attributes["error_total_position"] / true, seed, true / result.s[-1], sorted(kinds)))
    ratios = np.array([x[0] for x in found])
    print(
        f"{len(found)} figures over true errors (rods from another equilibrium: seeds {others}): {np.mean((ratios >= 0.7) & (ratios <= 3)):.1%} within 0.7 to 3, "
        f"{np.mean(ratios > 3):.1%} above, median {np.median(ratios):.2f}, at least {ratios.min():.2f}"
    )
    print("\n".join(f"  seed {seed}: {x:.2f}, off by {far:.1e} L, {said}" for x, seed, far, said in found if x < 0.7))
    assert not [seed for x, seed, _, said in found if x < 0.5 and not said]


def runs(scene, resolutions):
    """Errors of position against the last of the resolutions, and CPU seconds, median of five."""
    case = Case(scene, None)
    exact = case.sample(NetworkResolution({LINE: resolutions[-1]}))[LINE]
    out = []
    for resolution in resolutions[:-1]:
        tries = [case.sample(NetworkResolution({LINE: resolution}))[LINE] for _ in range(5)]
        error = np.linalg.norm(tries[0].values["position"] - exact.values["position"], axis=2).max()
        out.append((float(error), median(t.cpu for t in tries), tries[0].steps))
    return out


STEPS = {
    "relaxation": (lambda: fixed("03_suspension_rod", "output.every=1.0"), (0.08, 0.04, 0.02, 0.01, 0.005), 2.0, 3.0),
    "whip, sharp": (lambda: whip(50, 1e-3, 0.6, 0.5, 0.02), (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5), 0.06, 3.0),
    "whip, example": (
        lambda: fixed("06_whip", "time.duration=0.6", "output.every=0.02"), (2e-3, 1e-3, 5e-4, 2.5e-4), 0.06, 3.0,
    ),
    "touchdown": (lambda: fixed("touchdown", "model=catenary"), (0.2, 0.1, 0.05, 0.025), 8 / 12, 1 / 1.1),
    "s_tether": (lambda: fixed("s_tether", "model=rod"), (0.25, 0.125, 0.0625, 0.03125), 7 / 12, 1 / 1.1),
}  # fmt: skip


def fixed(name, *settings):
    return hybrid.load_scene(EXAMPLES / f"{name}.yaml", list(settings))


@pytest.mark.parametrize("name", STEPS)
def test_accuracy_steps_that_follow(name):
    """CPU time of the best fixed step over that of steps that follow, at equal error, on one mesh."""
    make, steps, largest, asked = STEPS[name]
    scene = make()
    exact = Resolution(1.0, steps[-1] / 8, None, 1e-3)
    fix = runs(scene, [*(Resolution(1.0, dt, None, 1e-3) for dt in steps), exact])
    tolerances = 10.0 ** np.arange(-3.0, -9.0, -1.0) * scene.length / 2
    follow = runs(scene, [*(Resolution(1.0, largest, tol, 1e-3) for tol in tolerances), exact])
    errors, cpu = np.array(fix)[::-1, 0], np.array(fix)[::-1, 1]
    ratios = []
    for tol, (error, seconds, count) in zip(tolerances, follow, strict=True):
        if errors[0] <= error <= errors[-1]:
            ratios.append(np.exp(np.interp(np.log(error), np.log(errors), np.log(cpu))) / seconds)
            print(
                f"{name}: {count} steps, {tol:.1e} m a step: error {error:.1e} m, fixed over following {ratios[-1]:.2f}"
            )
    print(
        f"{name}: fixed over following {min(ratios):.2f} to {max(ratios):.2f}, median {median(ratios):.2f}; asked {asked:.2g}"
    )
    assert median(ratios) > 0.8


def test_accuracy_share_of_coarser_runs():
    """What the error figure costs: CPU time of the coarser runs over that of the result."""
    for name in ("touchdown", "s_tether", "rov_tether"):
        scene = fixed(name, "model=rod")
        cost = []
        for errors in (False, True):
            asked = scene.model_copy(update={"output": scene.output.model_copy(update={"errors": errors})})
            tries = []
            for _ in range(3):
                begin = process_time()
                hybrid.run(asked)
                tries.append(process_time() - begin)
            cost.append(median(tries))
        print(
            f"{name}: {cost[0]:.2f} s without, {cost[1]:.2f} s with its error figure, {cost[1] / cost[0] - 1:.0%} more"
        )
        assert cost[1] < 3.0 * cost[0]


def test_accuracy_of_adaptive_against_a_rod():
    """At 1 %: CPU time of rods everywhere over that of `adaptive`, which takes what costs least, and of zones that move.

    Rods in their plane, and in space.
    """
    from test_bench_adaptive import bight

    def at(base, model, dimension):
        own = {"model": model, "dimension": dimension, "accuracy": "1%", "mesh": None}
        return hybrid.validate_scene(base | own | {"time": {"duration": base["time"]["duration"]}})

    scenes = {"ROV tether, 1000 m, slack bight": bight()}
    for name in ("s_tether", "touchdown"):
        scenes[name] = fixed(name).model_dump(exclude_none=True)
    for name, base in scenes.items():
        cost = {}
        for what, model, dimension in (
            ("adaptive", "adaptive", None),
            ("zones that move", MOVING, None),
            ("rod", "rod", None),
            ("rod in space", "rod", 3),
        ):
            tries = []
            for _ in range(3):
                begin = process_time()
                result = hybrid.run(at(base, model, dimension))
                tries.append(process_time() - begin)
            cost[what] = median(tries)
            said, e = result.attributes, {x.kind for x in result.events}
            print(
                f"{name}, {what}: {cost[what]:.2f} s, {said['cells']} cells, {len(result['steps/t'])} steps, "
                f"{said['effort_runs']} runs{', missed' if 'accuracy missed' in e else ''}"
            )
        gain = cost["rod"] / cost["adaptive"]
        print(
            f"{name}: rod over adaptive {gain:.2f}, over zones that move {cost['rod'] / cost['zones that move']:.2f}, "
            f"rod in space over adaptive {cost['rod in space'] / cost['adaptive']:.2f}"
        )
        assert 0.9 < gain < 2.5  # 0.95 is asked; medians of three differ by as much


def test_accuracy_of_adaptive_against_a_rod_in_random_scenes():
    """At 1 %: CPU time of rods everywhere over that of `adaptive`, the lesser of three alternating runs of each."""
    from random_scenes import random_scene

    ratios = []
    for seed in range(300, 400):
        scene = random_scene(seed)[1]
        scene = {k: v for k, v in scene.items() if k != "model"} | {"time": {"duration": scene["time"]["duration"]}}
        cost = {"rod": [], "adaptive": []}
        try:
            for _ in range(3):
                for model, tries in cost.items():
                    begin = process_time()
                    hybrid.run(scene | {"model": model, "accuracy": "1%"})
                    tries.append(process_time() - begin)
        except hybrid.ComputationError as error:
            print(f"seed {seed}: {str(error).splitlines()[0]}")
            continue
        ratios.append(min(cost["rod"]) / min(cost["adaptive"]))
        if ratios[-1] < 0.95:
            print(f"seed {seed}: {ratios[-1]:.2f}, {min(cost['rod']):.2f} s and {min(cost['adaptive']):.2f} s")
    found = np.percentile(ratios, (0, 5, 50, 95, 100))
    print(f"rod over adaptive, {len(ratios)} scenes: {' '.join(f'{x:.2f}' for x in found)}; 0.95 at least is asked")
    assert found[0] > 0.8  # the same runs of rods differ by as much on a busy machine
