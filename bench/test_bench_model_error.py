"""The model error against the truth, and what it costs: lines in motion and at rest.

    pytest bench/test_bench_model_error.py -m bench -s          # all, about 3 minutes
    HYBRID_BENCH_SEEDS=6 pytest bench/test_bench_model_error.py -m bench -s -k random

The truth is a rod on the same nodes with the same steps: what differs is bending alone.  Of 24 random scenes with zones
that move, 24 with catenaries (bench/random_scenes.py), and the scenes below.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from random_scenes import random_scene
from ruamel.yaml import YAML
from test_bench_adaptive import in_plane, length

import hybrid

pytestmark = pytest.mark.bench


def example(name: str, model: Any, **more: Any) -> hybrid.Scene:
    """An example with another model, errors on; more: tables to replace, or None to leave out."""
    with open(f"examples/{name}.yaml") as file:
        data = YAML(typ="safe", pure=True).load(file)
    data |= {"model": model} | more
    data.setdefault("output", {})["errors"] = True
    return hybrid.validate_scene({k: x for k, x in data.items() if x is not None})


def zones(*parts: tuple[str, float, int]) -> dict[str, Any]:
    return {"kind": "zones", "zones": [{kind: length, "cells": n} for kind, length, n in parts]}


def clamped(model: Any, kind: str = "clamped", EI: float = 30.0) -> hybrid.Scene:
    """A cable in a current across its plane, held by two clamps that bend it by up to 60 degrees (or two pins)."""
    start = {"kind": kind, "position": [0, 0, 0], "tangent": [0.3, 0.1, -1]}
    end = {"kind": kind, "position": [40, 5, -25], "tangent": [1, 0, 0.2]}
    start["motion"] = {
        "heave": {"amplitude": 0.5, "period": 6.0}, "sway": {"amplitude": 0.5, "period": 9.0}, "ramp": 8,
    }  # fmt: skip
    if kind == "pinned":
        start.pop("tangent"), end.pop("tangent")
    section = {
        "length": 60, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 2e6, "bending_stiffness": EI,
        "drag": {"normal": 1.2, "tangential": 0.02}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    return hybrid.validate_scene(
        {
            "environment": {"fluid": {"density": 1025, "current": {"kind": "uniform", "velocity": [0.3, 0.8, 0]}}},
            "cable": {"sections": [section]}, "ends": {"start": start, "end": end}, "initial": "equilibrium",
            "mesh": {"cells": 120}, "time": {"duration": 30, "step": 0.05}, "model": model,
            "output": {"every": 0.25, "errors": True},
        }
    )  # fmt: skip


def twisted(model: Any) -> hybrid.Scene:
    """A sag between clamps along it, 0.4 turns of one against the other: torque out of its plane."""
    a, slope = 2.0 * np.pi * 0.4, 0.55
    end = {
        "kind": "clamped", "position": [20, 0, 0], "tangent": [1, 0, slope],
        "normal": [0, -float(np.sin(a)), float(np.cos(a))], "motion": {"heave": {"amplitude": 0.2, "period": 3.0}, "ramp": 3},
    }  # fmt: skip
    section = {
        "length": 21.0, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 0.5, "torsional_stiffness": 80.0,
        "damping": 0.5,
    }  # fmt: skip
    return hybrid.validate_scene(
        {
            "cable": {"sections": [section]},
            "ends": {
                "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -slope], "normal": [0, 0, 1]},
                "end": end,
            },
            "initial": "equilibrium", "mesh": {"cells": 400}, "time": {"duration": 8.0, "step": 0.02}, "model": model,
            "output": {"every": 0.2, "errors": True},
        }
    )  # fmt: skip


def hung(joint: float, kind: str, at_rest: bool) -> hybrid.Scene:
    cells = round(50 * joint)
    parts = [(kind, joint, cells), ("rod", 2.0 - joint, 100 - cells)]
    more = {"initial": "equilibrium"} if at_rest else {}
    return example(
        "02_suspension", zones(*parts), time={"duration": 0.1 if at_rest else 10.0, "step": 0.01},
        output={"every": 0.1}, **more,
    )  # fmt: skip


TOUCHDOWN = {"time": {"duration": 60.0, "step": 0.1}}
BEDDED = {"mesh": None} | TOUCHDOWN
S = {"time": {"duration": 30.0, "step": 0.05}}
EVERY = {"kind": "adaptive"}  # base cells everywhere: the same nodes whatever they are


def cases() -> Iterator[tuple[str, hybrid.Scene, hybrid.Scene]]:
    """Name, scene of a model, of the rod."""
    for name, low, rod in (
        (
            "touchdown, catenary",
            example("touchdown", "catenary", **TOUCHDOWN), example("touchdown", "rod", **TOUCHDOWN),
        ),
        (
            "touchdown, rod 70 to 120 m",
            *(
                example("touchdown", zones((k, 70, 28), ("rod", 50, 20), (k, 130, 52)), **BEDDED)
                for k in ("catenary", "rod")
            ),
        ),
        (
            "s_tether, catenary",
            example("s_tether", {"kind": "catenary", "slack": "warn"}, **S), example("s_tether", "rod", **S),
        ),
        (
            "s_tether, rod 8 to 50 m",
            *(
                example("s_tether", zones((k, 8, 16), ("rod", 42, 84), (k, 10, 20)), mesh=None, **S)
                for k in ("catenary", "rod")
            ),
        ),
        ("pins, current across", *(clamped(k, "pinned", 300.0) for k in ("catenary", "rod"))),
        ("clamps, current across", *(clamped(k) for k in ("catenary", "rod"))),
        ("clamps, EI ten times", *(clamped(k, EI=300.0) for k in ("catenary", "rod"))),
        ("twisted by 0.4 turns", *(twisted(k) for k in ("catenary", "rod"))),
    ):  # fmt: skip
        yield name, low, rod
    for joint in (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.5, 1.7):
        yield f"suspension at rest, {joint} m", *(hung(joint, k, True) for k in ("catenary", "rod"))
    for joint in (0.5, 1.0, 1.5):
        yield f"suspension let go, {joint} m", *(hung(joint, k, False) for k in ("catenary", "rod"))
    for name, tolerance in (
        ("touchdown", 2e-5), ("s_tether", 1e-3), ("s_tether", 1e-2), ("slack_on_seabed", 1e-3), ("irregular_sea", 3e-3),
    ):  # fmt: skip
        plain = example(name, EVERY | {"tolerance": tolerance}, mesh={"cells": 120})
        plain = plain.model_copy(
            update={
                "time": plain.require_time().model_copy(update={"duration": min(plain.require_time().duration, 40.0)})
            }
        )
        model = plain.model.model_copy(update={"force_rod": ((0.0, plain.length),)})
        yield f"{name}, adaptive {tolerance:g}", plain, plain.model_copy(update={"model": model})


SEEDS = int(os.environ.get("HYBRID_BENCH_SEEDS", "24"))
# Quantities with a figure, and what of a result they are of.
FIGURES = {
    "position": "position", "tension": "tension", "curvature": "curvature", "bending_moment": "bending_moment",
    "end_force_start": "reaction_start", "end_force_end": "reaction_end",
}  # fmt: skip
LEAST = 1e-6  # of the largest value: less is round-off, and no error


class Row(NamedTuple):
    """Figures over true errors by quantity; processor time of a run with errors over that without."""

    name: str
    ratios: dict[str, float]
    cost: float


def computed(scene: hybrid.Scene, moves: bool, errors: bool) -> tuple[hybrid.Result, float]:
    output = scene.output.model_copy(update={"errors": errors})
    begin = time.process_time()
    result = (hybrid.run if moves else hybrid.static)(scene.model_copy(update={"output": output}))
    return result, time.process_time() - begin


def measured(name: str, low: hybrid.Scene, rod: hybrid.Scene, moves: bool) -> Row:
    """A scene against its rods; processor times: the lower of two."""
    found, took = min((computed(low, moves, True) for _ in range(2)), key=lambda x: x[1])
    plain = min(computed(low, moves, False)[1] for _ in range(2))
    truth, ratios = computed(rod, moves, False)[0], {}
    for quantity, raw in FIGURES.items():
        if raw not in found or raw not in truth or found[raw].shape != truth[raw].shape:
            continue
        x, y = (np.asarray(of[raw]) for of in (found, truth))
        vector = quantity == "position" or quantity.startswith("end_force")
        far, size = (np.linalg.norm(v, axis=-1) if vector else np.abs(v) for v in (x - y, y))
        if np.nanmax(far) > LEAST * np.nanmax(size):
            figure = found[f"errors/model/{quantity}"] if f"errors/model/{quantity}" in found else np.zeros(1)
            ratios[quantity] = float(np.nanmax(figure) / np.nanmax(far))
    return Row(name, ratios, took / plain)


def show(what: str, rows: list[Row]) -> None:
    cost = np.array([x.cost for x in rows])
    print(
        f"\n{what}: {len(rows)} scenes; with errors over without: median {np.median(cost):.2f}, most {cost.max():.2f}"
    )
    print(f"{'figure over true error':24s}    5 %  median    95 %   below 1, 0.7, 0.5    least")
    for quantity in FIGURES:
        found = sorted((x.ratios[quantity], x.name) for x in rows if quantity in x.ratios)
        if found:
            r = np.array([x for x, _ in found])
            low, middle, high = np.percentile(r, (5, 50, 95))
            few = ", ".join(f"{(r < x).sum():2d}" for x in (1.0, 0.7, 0.5))
            print(
                f"{quantity:16s} of {r.size:2d} {low:9.2f} {middle:7.2f} {high:7.2f}   {few:>14s}    {found[0][0]:.2f} {found[0][1]}"
            )


def random_cases(kind: str) -> Iterator[tuple[str, hybrid.Scene, hybrid.Scene]]:
    for seed in range(SEEDS) if kind == "adaptive" else range(100, 100 + SEEDS):
        what, text = random_scene(seed)
        if kind == "catenary" and what == "slack":
            continue
        if kind == "adaptive":
            text = in_plane(text) if seed % 4 == 3 else text
            low, rod = text, text | {"model": text["model"] | {"force_rod": [[0, length(text)]]}}
        else:
            text["mesh"] = {"cells": 100}
            low, rod = text | {"model": {"kind": "catenary", "slack": "warn"}}, text | {"model": "rod"}
        yield f"{seed} {what}", hybrid.validate_scene(low), hybrid.validate_scene(rod)


@pytest.mark.parametrize("moves", [True, False], ids=["motion", "rest"])
@pytest.mark.parametrize("kind", ["adaptive", "catenary"])
def test_model_error_random(kind: str, moves: bool) -> None:
    """Of places 5 % of the figures are less than 0.7 of the truth, or 0.6 of catenaries in motion: 0.63 to 0.97 when written."""
    rows = []
    for name, low, rod in random_cases(kind):
        try:
            rows.append(measured(name, low, rod, moves))
        except hybrid.ComputationError as error:
            print(f"{name}: {str(error).splitlines()[0]}")
    show(f"{kind}, random, {'in motion' if moves else 'at rest'}", rows)
    places = [x.ratios["position"] for x in rows if "position" in x.ratios]
    assert np.percentile(places, 5) > 0.6 and 0.9 < np.median(places) < 1.1


def test_model_error_cases() -> None:
    """The scenes above, each with its row."""
    rows = [measured(*each, moves=True) for each in cases()]
    for row in rows:
        figures = ", ".join(f"{name} {x:.2f}" for name, x in row.ratios.items())
        print(f"{row.name:28s} {figures}; with errors over without {row.cost:.2f}")
    show("cases", rows)
    places = [x.ratios["position"] for x in rows if "position" in x.ratios]
    assert min(places) > 0.6 and 0.9 < np.median(places) < 1.1
