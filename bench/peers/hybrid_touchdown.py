"""The touchdown scene in this code, with the same questions asked as of the peers."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import hybrid
from peers import scene
from peers.answer import Answer

NAME = "hybrid"
Zones = tuple[tuple[str, float, int, float], ...]  # kind, length (m), cells, ratio


def available() -> bool:
    """Whether the package is installed."""
    return True


def described(elements: int, EI: float, dt: float, zones: Zones) -> dict[str, Any]:
    """The scene as a table; `elements` count only without zones."""
    section = {
        "length": scene.LENGTH, "diameter": scene.DIAMETER, "mass": scene.MASS, "axial_stiffness": scene.EA,
        "drag": {"normal": scene.DRAG_NORMAL, "tangential": scene.DRAG_TANGENTIAL},
        "added_mass": {"normal": scene.ADDED_NORMAL},
    }  # fmt: skip
    model: dict[str, Any] = {"kind": "rod" if EI else "catenary"}
    if EI:
        section["bending_stiffness"] = EI
    if zones:
        model = {"kind": "zones", "zones": [{kind: s, "cells": n, "ratio": q} for kind, s, n, q in zones]}
    heave = {"heave": {"amplitude": scene.AMPLITUDE, "period": scene.PERIOD}, "ramp": scene.RAMP}
    return {
        "environment": {
            "gravity": scene.GRAVITY,
            "fluid": {"density": scene.DENSITY},
            "seabed": {"z": -scene.DEPTH, "stiffness": scene.SEABED_STIFFNESS, "damping": scene.SEABED_DAMPING},
        },
        "cable": {"sections": [section]},
        "ends": {
            "start": {"kind": "pinned", "position": scene.ANCHOR},
            "end": {"kind": "pinned", "position": scene.FAIRLEAD, "motion": heave},
        },
        "initial": {"kind": "equilibrium"},
        "model": model,
        "time": {"duration": scene.DURATION, "step": dt},
        "output": {"every": 20.0},
    } | ({} if zones else {"mesh": {"cells": elements}})


def run(elements: int, EI: float, dt: float = 0.1, zones: Zones = ()) -> Answer:
    """March the scene with `hybrid.run`: everything a user gets, step log and outputs included, in memory.

    The loop's time is that of all steps, scaled from those after the first, whose time holds the start of the file.
    """
    asked = hybrid.validate_scene(described(elements, EI, dt, tuple(tuple(z) for z in zones)))
    begin = time.process_time()
    result = hybrid.run(asked)
    whole = time.process_time() - begin
    steps = result.steps
    n = len(steps["t"])
    loop = float(steps["cpu"][-1] - steps["cpu"][0]) * n / (n - 1)
    words = f"dt {dt:g} s" + "".join(f", {kind} {s:g} m {c} cells (ratio {q:g})" for kind, s, c, q in zones)
    return answered(result, loop, whole - loop, words)


def answered(result: hybrid.Result, loop: float = 0.0, start: float = 0.0, words: str = "") -> Answer:
    """The tension at the fairlead of a result; loop, start: what it cost, s."""
    times = np.concatenate([[0.0], result.steps["t"]])
    first = float(np.linalg.norm(result.reaction_end[0]))
    return Answer(times, np.concatenate([[first], result.steps["end_force_end"]]), loop, start, words)
