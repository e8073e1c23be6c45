"""Random networks at rest: derivatives, targets that are reachable, and numbers from made measurements.

    pytest bench/test_bench_networks.py -m bench -n 0 -s

HYBRID_NETWORKS (60) scenes of bench/random_scenes.py (`random_network`), at most 20 cells a line.  Derivatives of four
results by four numbers are held against differences of equilibria; targets are results of the scene with up to three
lengths (within 3 %) and volumes (20 %) changed; measurements are five places of each line, with noise.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_scenes import random_network

import hybrid
from hybrid.errors import HybridError

pytestmark = pytest.mark.bench
SEEDS = range(int(os.environ.get("HYBRID_NETWORKS", "60")))
Scene = dict[str, Any]
# Noise of places (m) and of tensions, as a part of the largest; deviations from the truth that are no chance.
PLACE, PULL, CHANCE = 0.1, 0.01, 4.5
# Part by which targets may be missed: what the search leaves.
MISSED = 1e-3


def network(seed: int) -> Scene:
    _, scene = random_network(seed)
    for line in scene["lines"].values():
        line["mesh"] = {"cells": min(line["mesh"]["cells"], 20)}
        if isinstance(line["model"], dict):
            line["model"] = "catenary"
    scene["environment"]["seabed"].pop("friction", None)
    return scene


def keys_of(scene: Scene, names: tuple[str, ...]) -> list[str]:
    """Keys of sections and buoys with one of these names."""
    found = [
        f"lines.{name}.sections[{i}].{x}"
        for name, line in scene["lines"].items() for i, section in enumerate(line["sections"]) for x in section
    ] + [f"points.{name}.{x}" for name, point in scene["points"].items() if "volume" in point for x in point]  # fmt: skip
    return [x for x in found if x.rpartition(".")[2] in names]


def number(scene: Scene, key: str, factor: float | None = None) -> Any:
    """The number of a key, or the scene with a multiple of it."""
    copy = json.loads(json.dumps(scene))
    *path, last = key.replace("[", ".").replace("]", "").split(".")
    here = copy
    for part in path:
        here = here[int(part)] if isinstance(here, list) else here[part]
    if factor is None:
        return here[last]
    here[last] *= factor
    return copy


def results_of(scene: Scene) -> list[str]:
    middles = {name: 0.5 * sum(x["length"] for x in line["sections"]) for name, line in scene["lines"].items()}
    return [f"{n}/{x}" for n, m in middles.items() for x in ("tension@start", "tension@end", f"position.z@{m:.6g}")]


def value(result: hybrid.Result, name: str) -> float:
    line, _, rest = name.partition("/")
    quantity, _, at = rest.partition("@")
    of = result.lines[line]
    values = of.tension[-1] if quantity == "tension" else of.position[-1][:, 2]
    return float(np.interp({"start": of.s[0], "end": of.s[-1]}.get(at, at), of.s, values))


def test_derivatives() -> None:
    """Beyond what is stated, twice what differences leave, and 0.1 %: counted and named."""
    count, beyond = Counter[str](), []
    for seed in SEEDS:
        r, scene = np.random.default_rng(seed), network(seed)
        keys = r.choice(keys_of(scene, ("length", "mass", "axial_stiffness", "diameter", "volume")), 4, replace=False)
        of = r.choice(results_of(scene), 4, replace=False).tolist()
        try:
            found = {(x.of, x.by): x for x in hybrid.sensitivity(scene, of, keys.tolist())}
            rest = hybrid.static(scene)
            for key in keys.tolist():
                each = []
                for h in (1e-3, 5e-4):
                    more, less = (hybrid.static(number(scene, key, 1.0 + x)) for x in (h, -h))
                    each.append({x: (value(more, x) - value(less, x)) / (2 * h * number(scene, key)) for x in of})
                for x in of:
                    best, left = (4 * each[1][x] - each[0][x]) / 3, abs(each[1][x] - each[0][x])
                    off = abs(found[x, key].derivative - best)
                    small = 1e-5 * abs(value(rest, x)) / number(scene, key)
                    count["derivatives"] += 1
                    if off > max(2 * left, 1e-3 * abs(best), found[x, key].error) + small:
                        beyond.append(f"seed {seed}: {x} by {key}: {found[x, key].derivative:.5g}, {best:.5g} by runs")
        except HybridError as error:
            count[f"refused: {str(error).splitlines()[0][:60]}"] += 1
    print(f"\n{dict(count)}; beyond: {len(beyond)}", *beyond, sep="\n  ")
    assert len(beyond) <= 0.01 * count["derivatives"]


def changed(scene: Scene, r: np.random.Generator) -> tuple[Scene, list[str], list[str]]:
    """The scene with some numbers changed, their keys, and results of lines that they act on."""
    known = keys_of(scene, ("length", "volume"))
    keys, of, truth = r.choice(known, min(int(r.integers(1, 4)), len(known)), replace=False).tolist(), [], scene
    for key in keys:
        name = key.split(".")[1]
        joined = [x for x, line in scene["lines"].items() if name in (x, line["start"], line["end"])]
        of.append(r.choice([x for x in results_of(scene) if x.split("/")[0] == joined[0] and x not in of]))
        truth = number(truth, key, float(r.uniform(0.97, 1.03) if "length" in key else r.uniform(0.8, 1.25)))
    return truth, keys, of


def test_reachable_targets() -> None:
    """Found, with the results that were asked for, or refused; never another value without a word."""
    count, fell, most = Counter[str](), [], 0.0
    for seed in SEEDS:
        scene = network(seed)
        truth, keys, of = changed(scene, np.random.default_rng(1000 + seed))
        try:
            rest = hybrid.static(truth)
            hybrid.static(scene)
        except HybridError:
            count["no equilibrium"] += 1
            continue
        targets = {}
        for i, x in enumerate(of):
            line, _, what = x.partition("/")
            quantity, _, at = what.partition("@")
            place = at if at in ("start", "end") else float(at)
            targets[f"t{i}"] = {"quantity": quantity, "line": line, "at": place, "value": value(rest, x)}
        unknowns = {
            f"u{i}": {"key": x, "low": 0.5 * number(scene, x), "high": 2 * number(scene, x)} for i, x in enumerate(keys)
        }
        try:
            found = hybrid.design(scene, unknowns=unknowns, targets=targets)
        except HybridError as error:
            count["refused"] += 1
            fell.append(f"seed {seed}: {keys} for {of} refused: {str(error).splitlines()[0]}")
            continue
        there = scene
        for i, key in enumerate(keys):
            there = number(there, key, found.numbers[f"u{i}"] / number(scene, key))
        rest_there = hybrid.static(there)
        off = max(abs(value(rest_there, x) - value(rest, x)) / max(abs(value(rest, x)), 1.0) for x in of)
        count["found"] += 1
        most = max(most, off)
        if off > MISSED:
            fell.append(f"seed {seed}: {of} by {keys}: off by {100 * off:.2g} %")
    print(f"\n{dict(count)}; largest miss {100 * most:.2g} % of a target", *fell, sep="\n  ")
    assert count["found"] >= 0.9 * (count["found"] + count["refused"])


def test_numbers_from_made_measurements(tmp_path: Path) -> None:
    """Of all numbers that are known, how many lie within their 95 % of the truth, and how far off the worst is."""
    count, inside, worst = Counter[str](), [], (0.0, -1)
    for seed in SEEDS:
        r, scene = np.random.default_rng(2000 + seed), network(seed)
        known = keys_of(scene, ("length", "mass", "volume"))
        keys = r.choice(known, min(int(r.integers(1, 4)), len(known)), replace=False).tolist()
        try:
            rest = hybrid.static(scene)
        except HybridError:
            count["no equilibrium"] += 1
            continue
        pull, rows = PULL * max(float(line.tension[-1].max()) for line in rest.lines.values()), ["line,s,x,z,tension"]
        for name, line in rest.lines.items():
            for s in np.linspace(0.1, 0.9, 5) * line.s[-1]:
                at = [float(np.interp(s, line.s, a)) for a in (*line.position[-1].T[[0, 2]], line.tension[-1])]
                x, z, T = np.array(at) + [PLACE, PLACE, pull] * r.standard_normal(3)
                rows.append(f"{name},{s:.9g},{x:.12g},{z:.12g},{T:.12g}")
        (tmp_path / "m.csv").write_text("\n".join(rows) + "\n")
        unknowns, start = {}, scene
        for i, key in enumerate(keys):
            start = number(start, key, float(r.uniform(0.99, 1.01) if "length" in key else r.uniform(0.85, 1.2)))
            unknowns[f"u{i}"] = {"key": key, "low": 0.3 * number(scene, key), "high": 3 * number(scene, key)}
        measured = {"file": str(tmp_path / "m.csv"), "deviations": {"x": PLACE, "z": PLACE, "tension": pull}}
        try:
            found = hybrid.design(start, unknowns=unknowns, measured=measured)
        except HybridError as error:
            count[f"refused: {str(error).splitlines()[0][:60]}"] += 1
            continue
        for estimate, key in zip(found.estimates, keys, strict=True):
            if not np.isfinite(estimate.deviation):
                count["told apart from nothing"] += 1
                continue
            off = abs(estimate.value - number(scene, key)) / estimate.deviation
            inside.append(estimate.low <= number(scene, key) <= estimate.high)
            worst = max(worst, (off, seed))
    print(f"\n{dict(count)}; {sum(inside)} of {len(inside)} numbers within their 95 %; worst {worst[0]:.2f} "
          f"deviations, seed {worst[1]}")  # fmt: skip
    assert worst[0] < CHANCE
