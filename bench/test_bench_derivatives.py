"""Derivatives at rest: what they cost over their equilibrium, and how far they are from differences of equilibria.

pytest bench/test_bench_derivatives.py -m bench -s

Costs are of CPU time, least of several: of one more number among several, alone and with the error by half the cells.
"""

from __future__ import annotations

import os
import time as clock
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from derivative_scenes import KINDS, keys_of, scene_at_rest

import hybrid
from hybrid.designs.network_at_rest import Places, at_rest
from hybrid.designs.numbers_and_results import with_number
from hybrid.scene.read import as_scene
from tests.designs.test_body_derivatives import SCENES as SCENES_OF_BODIES

pytestmark = pytest.mark.bench
ROUNDS, SCENES = 9, int(os.environ.get("SCENES", "200"))
NUMBERS = [
    "cable.sections[0].length", "cable.sections[0].mass", "cable.sections[0].diameter", "environment.gravity",
    "cable.sections[0].axial_stiffness", "ends.end.position[0]",
]  # fmt: skip
# Parts of a number by which equilibria differ: coarser ones count kinks of contact; what changes least is believed.
STEPS = (1e-4, 3e-5, 1e-5, 3e-6, 1e-6)
# A result that answers less than this, in parts by parts, is compared with that.
LEAST = 1e-3
# Parts within which derivatives are asked to be: of the largest curvature ten times those of others.
WITHIN = np.array([1e-6, 1e-6, 1e-6, 1e-5, 1e-6])


def hung(model: str, cells: int) -> hybrid.Scene:
    section = {
        "length": 220.0, "mass": 3.0, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 50.0,
        "torsional_stiffness": 50.0,
    }  # fmt: skip
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [200, 0, 10]}}
    return hybrid.validate_scene(
        {
            "environment": {"fluid": {"density": 1025, "surface": 50}},
            "cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium", "model": model,
            "mesh": {"cells": cells},
        }
    )  # fmt: skip


def spent(*what: Callable[[], Any], rounds: int = ROUNDS) -> list[float]:
    """Least CPU time, s, of each, taken in turn after a first call."""
    least = [np.inf] * len(what)
    for x in what:
        x()
    for _ in range(rounds):
        for k, x in enumerate(what):
            begin = clock.process_time()
            x()
            least[k] = min(least[k], clock.process_time() - begin)
    return least


@pytest.mark.parametrize("model", ["catenary", "rod"])
@pytest.mark.parametrize("cells", [100, 400, 1000])
def test_a_derivative_over_its_equilibrium(model: str, cells: int) -> None:
    scene = hung(model, cells)
    of = ["tension@0", "max curvature"]
    rest = at_rest(scene, of)
    static, one, all_, once, error = spent(
        lambda: hybrid.static(scene), lambda: rest.by(NUMBERS[:1]), lambda: rest.by(NUMBERS * 4),
        lambda: hybrid.sensitivity(scene, of, NUMBERS[:1]), lambda: hybrid.sensitivity(scene, of, NUMBERS * 4),
    )  # fmt: skip
    more = 4 * len(NUMBERS) - 1
    print(
        f"{model}, {cells} cells: equilibrium {1e3 * static:.1f} ms; one more derivative {(all_ - one) / more / static:.3f} "
        f"of it, with its error {(error - once) / more / static:.3f}"
    )


@pytest.mark.parametrize("what", SCENES_OF_BODIES)
def test_a_derivative_beside_bodies(what: str) -> None:
    """Lines that turn freely at a body, and hoses that are clamped to bodies and points; every number alone."""
    tables, of, keys = SCENES_OF_BODIES[what]
    scene = as_scene(tables)
    rest = at_rest(scene, of)
    for key in [*keys, *(["bodies.hull.mass"] if "bodies" in tables else [])]:
        calls = lambda: hybrid.static(scene), lambda k=key: rest.by([k]), lambda k=key: rest.by(6 * [k])
        static, one, six = spent(*calls, rounds=3)
        print(f"{what}, {key}: equilibrium {1e3 * static:.1f} ms; one more {(six - one) / 5 / static:.2f} of it")


def believed(differences: list[np.ndarray]) -> np.ndarray:
    """Of differences by falling steps, for each result that which differs least from both beside it.

    Of two alone it may be chance: their last digits are few.
    """
    stacked = np.array(differences)
    changes = np.abs(np.diff(stacked, axis=0))
    best = np.maximum(changes[1:], changes[:-1]).argmin(axis=0)
    return np.take_along_axis(stacked[1:-1], best[None], axis=0)[0]


def results(scene: hybrid.Scene, wanted: list[str], places: Places) -> np.ndarray:
    """Of an equilibrium, whose last Newton correction is counted: what is left over would be the error of differences."""
    rest = at_rest(scene, wanted, 1.0, places)
    left = rest.lines[0].left(rest.lines[0].here)[0][:, None]
    return np.asarray(rest.values + rest.forward(rest._network.place.T @ left, [np.zeros_like(left)])[0][0])


def off(scene: hybrid.Scene, wanted: list[str], keys: list[str]) -> np.ndarray:
    """(keys, results) by how much derivatives differ from differences of equilibria on nodes that go along, in parts."""
    rest = at_rest(scene, wanted)
    found, out = rest.by(keys), []
    for key, ours in zip(keys, found, strict=True):
        number, each = rest.number(key), []
        for step in STEPS:
            d = step * (abs(number) or 1.0)
            try:
                more, less = (results(with_number(scene, key, number + x), wanted, rest.places) for x in (d, -d))
            except hybrid.ComputationError:
                continue
            each.append((more - less) / (2.0 * d))
        theirs = believed(each)
        floor = LEAST * np.abs(rest.values) / (abs(number) or scene.length)
        out.append(np.abs(ours - theirs) / np.maximum(np.abs(theirs), floor))
    return np.array(out)


def test_differences_of_equilibria() -> None:
    """Of random scenes of every kind: the largest of a scene, over scenes."""
    of = ["tension@0", "tension@end", "reaction_end.x", "max curvature"]
    worst: dict[str, list[np.ndarray]] = {kind: [] for kind in KINDS}
    within: list[np.ndarray] = []
    for seed in range(SCENES):
        kind, tables = scene_at_rest(seed)
        if not kind.startswith(os.environ.get("KIND", "")):
            continue
        scene = hybrid.validate_scene(tables)
        place = f"position.z@{0.4517 * scene.length!r}"  # at no node, beside which second derivatives jump
        wanted = [*of, place]
        try:
            found = off(scene, wanted, keys_of(tables))
        except hybrid.ComputationError as error:
            print(seed, kind, str(error).splitlines()[0])
            continue
        worst[kind].append(found.max(axis=0))
        within.append(found <= WITHIN)
        if os.environ.get("EACH"):
            for i, k in np.argwhere(found > WITHIN):
                print(seed, kind, keys_of(tables)[i], [*of, place][k], f"{found[i, k]:.1e}", flush=True)
    for kind, rows in worst.items():
        if rows:
            a = np.array(rows)
            plain, bend = np.delete(a, 3, axis=1).max(axis=1), a[:, 3]
            print(
                f"{kind:14s} {len(a):3d} scenes: median {np.median(plain):.1e}, largest {plain.max():.1e}; "
                f"largest curvature {np.median(bend):.1e}, {bend.max():.1e}"
            )
    share, whole = np.concatenate(within).mean(), np.mean([x.all() for x in within])
    print(
        f"within the figure: {100 * share:.2f} % of derivatives; all of a scene in {100 * whole:.1f} % of {len(within)}"
    )
