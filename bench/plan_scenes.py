"""Seeded random scenes of all kinds of runs: fixed steps and accuracies, with and without error figures, several lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from random_scenes import random_scene

# What a run asks for; each as often as the others.
ASKS = ("steps", "rods", "errors", "1%", "2%", "5%", "10%", "lines")


def plan_scene(seed: int) -> tuple[str, dict[str, Any]]:
    """What the scene asks for, and the scene."""
    rng = np.random.default_rng(10_000 + seed)
    kind, scene = random_scene(seed)
    asks = ASKS[seed % len(ASKS)]
    scene["time"]["duration"] *= float(10 ** rng.uniform(-0.3, 0.8))
    scene["output"] = {
        "every": scene["time"]["duration"] / float(rng.choice([40, 200, 800])),
        "points": int(rng.choice([51, 101, 401])),
    }
    if asks == "rods":
        scene["model"] = "rod"
    if asks == "errors":
        scene["output"]["errors"] = True
    if asks.endswith("%"):
        del scene["model"], scene["time"]["step"]
        scene["accuracy"] = asks
    if asks == "lines":
        scene = lines_of(scene, rng)
    return f"{kind}, {asks}", scene


def lines_of(scene: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """The same line twice, as a network: from its start to a free point with a weight, and from there to its end."""
    section = scene["cable"]["sections"][0]
    part = float(rng.uniform(0.3, 0.7))
    sections = [[section | {"length": x * section["length"]}] for x in (part, 1.0 - part)]
    ends = scene["ends"]
    weight = section["mass"] * section["length"] * 0.05
    middle = [float(x) for x in 0.5 * (np.array(ends["start"]["position"]) + np.array(ends["end"]["position"]))]
    middle[2] = min(ends["start"]["position"][2], ends["end"]["position"][2]) + 0.05 * section["length"]
    points = {
        "low": {"position": ends["start"]["position"]},
        "joint": {"kind": "free", "mass": weight, "volume": weight / 3000, "initial_guess": middle},
        "high": {"position": ends["end"]["position"], "motion": ends["end"]["motion"]},
    }  # fmt: skip
    model = str(rng.choice(["rod", "catenary"]))
    lines = {
        "a": {"start": "low", "end": "joint", "model": model, "sections": sections[0]},
        "b": {"start": "joint", "end": "high", "model": model, "sections": sections[1]},
    }
    return {
        "environment": scene["environment"],
        "points": points,
        "lines": lines,
        "time": scene["time"],
        "output": scene["output"],
    }
