"""Tangents along the steps of runs: how far they are from differences of runs, and what they cost.

pytest bench/test_bench_tangents.py -m bench -n 0 -s

Differences are of runs in the same steps and cells, by several parts of a number; what changes least is believed.
Costs are of CPU time, least of several.
"""

from __future__ import annotations

import os
import time as clock
from typing import Any

import numpy as np
import pytest
from derivative_scenes import KINDS, keys_of, scene_at_anchor, scene_in_motion

import hybrid
from hybrid.designs import in_motion as way
from hybrid.designs.in_motion import Motion, by_tangents, size_of
from hybrid.designs.numbers_and_results import changed_scene, number_of, parse_wanted
from hybrid.designs.replay import Course, course_of, replay
from hybrid.designs.tangents import Unfollowed

pytestmark = pytest.mark.bench
SCENES, ROUNDS = int(os.environ.get("SCENES", "200")), 3
# Parts of a number by which runs differ, whose steps are solved to rounding.
STEPS = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7)
LEAST = 1e-3  # a result that answers less than this, in parts by parts, is compared with that
OF = ["max tension@0", "last tension@end", "std reaction_end.x"]


def differences(
    scene: hybrid.Scene, wanted: list[Any], course: Course, base: Motion, key: str
) -> tuple[np.ndarray, np.ndarray]:
    """(W,) of runs, and by how much the best two of them differ."""
    number, size, each = number_of(scene, key), size_of(scene, key, number_of(scene, key)), []
    for part in STEPS:
        d = part * size
        more, less = (Motion(changed_scene(scene, key, number + x), wanted, course, base).values for x in (d, -d))
        each.append((more - less) / (2.0 * d))
    stacked = np.array(each)
    finer = np.vstack([stacked[1:], (stacked[1:] * 11.0 - stacked[:-1]) / 10.0])  # and of fourth order, as h by 1/3.3
    changes = np.abs(np.diff(stacked, axis=0))
    best = changes.argmin(axis=0)
    return np.take_along_axis(finer, best[None], axis=0)[0], changes.min(axis=0)


def test_tangents_of_random_scenes() -> None:
    """The largest of a scene, over scenes of each kind; of the differences among themselves."""
    worst: dict[str, list[tuple[float, float]]] = {kind: [] for kind in KINDS}
    others: dict[str, int] = {}
    for seed in range(int(os.environ.get("FIRST", "0")), SCENES):
        kind, tables = scene_in_motion(seed)
        if not kind.startswith(os.environ.get("KIND", "")):
            continue
        scene = hybrid.validate_scene(tables)
        names = [*OF, f"std position.z@{0.45 * scene.length!r}"]
        wanted, keys = [parse_wanted(scene, x, moves=True) for x in names], keys_of(tables)
        try:
            course = course_of(scene)
            numbers = {key: number_of(scene, key) for key in keys}
            sizes = {key: size_of(scene, key, x) for key, x in numbers.items()}
            found = by_tangents(scene, wanted, course, numbers, sizes)
            base, off, own = Motion(scene, wanted, course), 0.0, 0.0
            for key, ours in zip(keys, found.derivatives, strict=True):
                theirs, unsure = differences(scene, wanted, course, base, key)
                floor = np.maximum(np.abs(theirs), LEAST * np.abs(base.values) / sizes[key])
                off, own = (
                    max(off, float((np.abs(ours - theirs) / floor).max())),
                    max(own, float((unsure / floor).max())),
                )
                if os.environ.get("EACH"):
                    print(seed, kind, key, np.abs(ours - theirs) / floor, unsure / floor)
        except Unfollowed as why:
            others[f"{kind}: {why}"] = others.get(f"{kind}: {why}", 0) + 1
            continue
        except hybrid.ComputationError as error:
            print(seed, kind, str(error).splitlines()[0])
            continue
        worst[kind].append((off, own))
    for kind, rows in worst.items():
        if rows:
            a = np.array(rows)
            print(
                f"{kind:14s} {len(a):3d} scenes: median {np.median(a[:, 0]):.1e}, 90 % {np.quantile(a[:, 0], 0.9):.1e}, "
                f"largest {a[:, 0].max():.1e}; differences among themselves {np.median(a[:, 1]):.1e}, {a[:, 1].max():.1e}"
            )
    for text, count in others.items():
        print(f"not followed: {text}: {count} scenes")


def test_anchors_on_the_bed() -> None:
    """Forces at 40 anchors at or near the bed: off runs in the same steps, in parts, and what is stated of that.

    A scene is within where it is off by 1e-5 at most, or by what is stated and what differences differ by among themselves.
    """
    of = [
        "last tension@start",
        "last reaction_start.z",
        "last reaction_start.x",
        "max tension@start",
        "last contact_force",
    ]
    for seed in range(int(os.environ.get("FIRST", "0")), min(SCENES, 40)):
        kind, tables, key = scene_at_anchor(seed)
        scene = hybrid.validate_scene(tables)
        wanted = [parse_wanted(scene, x, moves=True) for x in of]
        try:
            found, course = way.in_motion(scene, of, [key]), course_of(scene)
        except hybrid.ComputationError as error:
            print(f"{seed} {kind}, {key}: refused: {error}")
            continue
        base, size = Motion(scene, wanted, course), size_of(scene, key, number_of(scene, key))
        theirs, unsure = differences(scene, wanted, course, base, key)
        scale = np.maximum(np.abs(theirs), 0.04 * np.abs(base.values) / size) + 1e-300
        off, own, stated = (x / scale for x in (np.abs(found.derivatives[0] - theirs), unsure, found.errors[0]))
        within = "within" if (off <= np.maximum(1e-5, stated + own)).all() else "BEYOND"
        print(
            f"{seed} {kind}, {key}: {within}, off {off.max():.1e}, stated {stated.max():.1e}, "
            f"differences {own.max():.1e}; {found.ways[0]}"
        )


def test_tension_is_even_on_a_bed_without_friction() -> None:
    """At the anchor its derivative is that of the line beside it."""
    scene, key = hybrid.validate_scene(scene_in_motion(3)[1]), "ends.end.position[0]"
    beside = scene.length / 20.0  # the first output point
    wanted = [parse_wanted(scene, x, moves=True) for x in ("last tension@0", f"last tension@{beside!r}")]
    course, number = course_of(scene), number_of(scene, key)
    asked = scene, wanted, course, {key: number}, {key: size_of(scene, key, number)}
    for way_of in (by_tangents, way.by_differences):
        anchor, near = way_of(*asked).derivatives[0]
        print(f"{way_of.__name__}: {anchor:.5g} N/m at the anchor, {near:.5g} beside it: {anchor / near - 1.0:.1e}")
        if way_of is by_tangents:
            assert abs(anchor / near - 1.0) < 5e-4


def moored(model: str, cells: int, dimension: int | None, waves: bool) -> hybrid.Scene:
    section = {
        "length": 250.0, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
        "torsional_stiffness": 2e3, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    fluid: dict[str, Any] = {"density": 1025, "surface": 0}
    if waves:
        fluid["waves"] = {"kind": "jonswap", "significant_height": 3, "peak_period": 9, "seed": 1, "components": 60}
    heave = {"heave": {"amplitude": 1.0, "period": 8.0}, "ramp": 4.0}
    tables = {
        "environment": {"fluid": fluid, "seabed": {"z": -100.0, "stiffness": 5e3, "damping": 500.0}},
        "cable": {"sections": [section]},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, -100.0]},
                 "end": {"kind": "pinned", "position": [205.0, 0, -1.0], "motion": heave}},
        "initial": "equilibrium", "model": model, "mesh": {"cells": cells},
        "time": {"duration": 60.0, "step": 0.05}, "output": {"every": 0.25, "points": 51},
    }  # fmt: skip
    return hybrid.validate_scene(tables | ({"dimension": dimension} if dimension else {}))


@pytest.mark.parametrize("waves", [False, True])
@pytest.mark.parametrize("dimension", [None, 3])
@pytest.mark.parametrize("model", ["catenary", "rod"])
@pytest.mark.parametrize("cells", [40, 100, 400])
def test_cost_of_a_tangent(model: str, cells: int, dimension: int | None, waves: bool) -> None:
    scene = moored(model, cells, dimension, waves)
    course = course_of(scene)
    sections = ("length", "mass", "diameter", "axial_stiffness", "drag.normal", "added_mass.normal")
    keys = [f"cable.sections[0].{x}" for x in sections]
    keys += ["ends.end.motion.heave.amplitude", "environment.seabed.stiffness"]
    wanted = [parse_wanted(scene, x, moves=True) for x in OF]
    numbers = {key: number_of(scene, key) for key in keys}
    sizes = {key: size_of(scene, key, x) for key, x in numbers.items()}

    def tangents(count: int) -> None:
        by_tangents(scene, wanted, course, dict(list(numbers.items())[:count]), sizes)

    least = [np.inf] * 3
    for _ in range(ROUNDS):
        for k, call in enumerate((lambda: replay(scene, course), lambda: tangents(1), lambda: tangents(len(keys)))):
            begin = clock.process_time()
            call()
            least[k] = min(least[k], clock.process_time() - begin)
    run, one, all_ = least
    more = (all_ - one) / (len(keys) - 1)
    print(
        f"{model}, {cells} cells, {'space' if dimension else 'plane'}{', waves' if waves else ''}: run {run:.2f} s of CPU; "
        f"the first number {(one - run) / run:.2f} of it, each other {more / run:.2f}; of {len(keys)} each "
        f"{(all_ - run) / run / len(keys):.2f}; {way.TANGENTS}"
    )
