"""Features of a scene as fragments of a tiny one, and the same scene said in other ways."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from itertools import combinations
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from hybrid.scene.read import as_scene, scene_text
from hybrid.scene.root import in_full
from tests.problems import tables_with
from tests.scenes import cable_scene, pinned_at

LENGTH, OUTPUTS = 12.0, 5
Tables = dict[str, Any]
Matrix = NDArray[np.float64]

SECTION = {
    "length": LENGTH, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 20.0,
    "torsional_stiffness": 15.0, "damping": {"mass": 0.5},
}  # fmt: skip
BASE: Tables = cable_scene(
    SECTION, pinned_at(0, 0, 0), pinned_at(10, 0, 3, motion={"travel": {"by": [0.05, 0, 0.1], "over": 0.5}}),
    gravity=9.81, contact={"self": False}, model="rod", mesh=12, time=(0.1 * OUTPUTS, 0.02), output=(0.1, 13)
)  # fmt: skip

S, START, END = "cable.sections.0.", "ends.start", "ends.end"
WATER = {"density": 1025, "current": [0.3, 0.2, 0]}
DRAG = {S + "drag": {"normal": 1.2, "tangential": 0.05}, S + "added_mass": {"normal": 1.0}}
CLAMP = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.5], "normal": [0, 1, 0]}
FAR = {"kind": "clamped", "position": [10, 0, 3], "tangent": [1, 0, 0.8], "normal": [0, 1, 0]}
ZONES = {"kind": "zones", "zones": [{"rod": 4, "cells": 4}, {"catenary": 4, "cells": 4}, {"rod": 4, "cells": 4}]}
ADAPTIVE = {"kind": "adaptive", "hold_time": 0.1, "force_rod": [[4, 8]]}
PAYOUT = {"rate": 0.2, "ramp": 0.2}
TABLE = [[0.0, 0.0], [0.002, 100.0], [0.01, 1000.0], [0.1, 20000.0]]
# 12 m from end to end, above the bed.
POLYLINE = [[0, 0, 0], [3, 1.5, 1], [6.5, 2.5, 0.7551831916861387], [10, 0, 3]]
# By name: what the scene gets, and which keys it decides: two features that decide the same are no pair.
FEATURES: dict[str, tuple[Tables, str]] = {
    "catenary": ({"model": "catenary"}, "model"),
    "zones": ({"model": ZONES, "mesh": None}, "model"),
    "zones that move": ({"model": ADAPTIVE}, "model"),
    "cells that follow": ({"model": {"kind": "adaptive", "curvature_error": 0.1}}, "model"),
    "clamp": ({START: CLAMP}, "start"),
    "sprung clamp": ({START: CLAMP | {"bend_stiffness": 30.0}}, "start"),
    "swivel at a clamp": ({START: CLAMP | {"swivel": True}}, "start"),
    "turns": ({START: CLAMP, END: FAR | {"turns": 0.7}}, "start end"),
    "free end": ({END: {"kind": "free", "force": [40, 3, 30]}}, "end"),
    "body": ({END: {"kind": "body", "mass": 3.0, "initial_guess": [4, 0, -10], "thrust": [8, 2, 0]}}, "end bed place"),
    "points": ({"initial": {"kind": "points", "points": POLYLINE}}, "rest place"),
    "payout": ({END + ".payout": PAYOUT, END + ".motion": None}, "end"),
    "release": ({END + ".release_at": {"time": 0.25}}, "end"),
    "water": ({"environment.fluid": WATER} | DRAG, "sea"),
    "vortices": ({"environment.fluid": WATER, S + "vortices": {"ramp": 0.3}} | DRAG, "sea"),
    "waves": (
        {"environment.fluid": WATER | {"surface": 5, "waves": {
            "kind": "regular", "height": 1.0, "period": 4.0, "direction": 30, "ramp": 0.5}}} | DRAG, "sea",
    ),
    "seabed": (
        {"environment.seabed": {"z": -0.5, "stiffness": 2e3, "damping": 20, "friction": {"axial": 0.3, "lateral": 0.5},
                                "slope": [0.02, 0.01]}}, "bed",
    ),
    "soil": (
        {"environment.seabed": {"z": -0.5, "soil": {"shear_strength": 500, "gradient": 900, "lateral": {}}, "friction": {
            "axial": 0.3, "lateral": 0.5, "residual": [0.2, 0.3], "breakout": 0.02, "travel": 2e-3}, "slope": [0.02, 0.01]}},
        "bed",
    ),
    "clump": ({"cable.attachments": [{"kind": "clump", "at": 5.0, "mass": 2.0}]}, "items"),
    "swivel": ({"cable.attachments": [{"kind": "swivel", "at": 5.0}]}, "items"),
    "stiffener": (
        {"cable.attachments": [{"kind": "bend_stiffener", "range": [0, 1.5], "diameters": [0.09, 0.04], "bore": 0.03,
                                "modulus": 7e7, "density": 1100}]}, "items",
    ),
    "restrictor": ({"cable.attachments": [{"kind": "bend_restrictor", "range": [2, 5], "radius": 12}]}, "items"),
    "moment table": (
        {S + "moment_curvature": [[0, 0], [0.05, 1.0], [0.15, 2.0], [0.3, 8.0]], S + "bending_stiffness": None},
        "bending",
    ),
    "slip": (
        {S + "bending_stiffness": 8.0,
         S + "bending_slip": [{"stiffness": 12.0, "moment": 0.4, "per_tension": 1e-3}, {"stiffness": 5.0, "moment": 0.5}]},
        "bending",
    ),
    "stiffness by tension": ({S + "stiffness_per_tension": 0.03}, "bending"),
    "stiffness damping": ({S + "damping": {"mass": 0.5, "stiffness": 0.01}}, "damping"),
    # Pinned at both ends and not at rest, a line with a direction about its axis has none that the scene gives.
    "two stiffnesses": ({S + "bending_stiffness": [20.0, 8.0]}, "bending rest"),
    "rotary inertia": ({S + "rotary_inertia": 2e-3}, "rotary"),
    "curved": ({S + "intrinsic_curvature": [0.05, 0.03, 0.02]}, "curved rest"),
    "torque of tension": ({S + "tension_torque": 2e-3}, "torque"),
    "table": ({S + "tension_strain": TABLE, S + "axial_stiffness": None}, "stretch"),
    "rope": (
        {S + "dynamic_stiffness": {"constant": 2e5, "per_tension": 10.0, "relaxation_time": 100}}, "stretch",
    ),
    "polyester": (
        {S + "axial_stiffness": None,
         S + "syrope": {"curve": TABLE, "working": "exponential", "k1": 0.5, "k2": 0.5, "highest_tension": 2e3},
         S + "dynamic_stiffness": {"constant": 6e5, "per_tension": 10.0, "relaxation_time": 0.2}}, "stretch",
    ),
    "creep": ({S + "creep": {"per_decade": 1e-3, "loaded": 0.1}}, "stretch"),
    "contact": ({"contact.self": True}, "contact"),
    "obstacle": (
        {"obstacles": {"pipe": {"kind": "cylinder", "at": [4, 0, -2], "axis": [0.1, 1, 0.05], "radius": 0.8,
                                "friction": 0.3}}}, "obstacles",
    ),
    "obstacle that moves": (
        {"obstacles": {"pipe": {"kind": "cylinder", "at": [4, 0, -2], "axis": [0.1, 1, 0.05], "radius": 0.8,
                                "friction": 0.3, "motion": {"travel": {"by": [0.05, 0.1, 0.08], "over": 0.4}},
                                "spin": {"rate": 0.8, "ramp": 0.3}}}},
        "obstacles",
    ),
    "sheave": (
        {"obstacles": {"pipe": {"kind": "cylinder", "at": [4, 0, -2], "axis": [0.1, 1, 0.05], "radius": 0.8,
                                "friction": 0.3, "bearing": {"inertia": 0.5, "damping": 0.1}}}}, "obstacles",
    ),
    "layers": ({"resolution": {"cells_per_layer": 3}, "mesh": None}, "model"),
    "chosen steps": ({"time.tolerance": 1e-4, "time.step": None}, "time"),
}  # fmt: skip


def pairs() -> Iterator[tuple[str, str]]:
    """Two features each that do not decide the same."""
    for a, b in combinations(FEATURES, 2):
        if not {*FEATURES[a][1].split()} & {*FEATURES[b][1].split()}:
            yield a, b


def scene_of(*names: str) -> Tables:
    """The tiny scene with these features."""
    changes: Tables = {}
    for name in names:
        changes |= FEATURES[name][0]
    found: Tables = tables_with(BASE, changes)
    return found


# --- the same said otherwise --------------------------------------------------------------------

POLAR = (
    "position",
    "tangent",
    "normal",
    "current",
    "force",
    "thrust",
    "by",
    "initial_guess",
    "direction",
    "at",
    "axis",
)


def seen_by(M: Matrix, tables: Tables) -> Tables:
    """The scene, rotated about the vertical or mirrored in a plane that holds it by M (3, 3)."""
    odd = float(np.linalg.det(M))

    def walk(key: str, x: Any) -> Any:
        if key == "spin":
            return x | {"rate": odd * x["rate"]}
        if isinstance(x, dict):
            return {k: walk(k, y) for k, y in x.items()}
        if key == "points" and isinstance(x, list):
            return (np.array(x, float) @ M.T).tolist()
        if key in POLAR and isinstance(x, list):
            return (M @ np.array(x, float)).tolist()
        if key == "direction":  # of waves, deg
            way = M @ [np.cos(np.radians(x)), np.sin(np.radians(x)), 0.0]
            return float(np.degrees(np.arctan2(way[1], way[0])))
        if key == "slope":
            return (M[:2, :2] @ np.array(x, float)).tolist()
        if key == "intrinsic_curvature":
            return [odd * x[0], x[1], odd * x[2]]
        if key in ("turns", "tension_torque"):
            return odd * x
        return [walk(key, y) for y in x] if isinstance(x, list) else x

    found: Tables = walk("", tables)
    return found


def exchanged(tables: Tables) -> Tables:
    """The scene with its two ends exchanged."""
    found = deepcopy(tables)
    ends = {"start": found["ends"]["end"], "end": found["ends"]["start"]}
    for end in ends.values():
        if "tangent" in end:
            end["tangent"] = [-x for x in end["tangent"]]
        if "turns" in end:
            end["turns"] = -end["turns"]
    found["ends"] = ends
    found["cable"]["sections"].reverse()
    for section in found["cable"]["sections"]:
        if "intrinsic_curvature" in section:
            a, b, c = section["intrinsic_curvature"]
            section["intrinsic_curvature"] = [-a, b, c]
    for item in found["cable"].get("attachments", ()):
        if "range" in item:
            item["range"] = [LENGTH - x for x in item["range"]][::-1]
            item.get("diameters", []).reverse()
        else:
            item["at"] = LENGTH - item["at"]
    if isinstance(found["initial"], dict):
        found["initial"]["points"].reverse()
    model = found["model"]
    if isinstance(model, dict):
        model.get("zones", []).reverse()
        for key in {"force_rod", "force_catenary"} & {*model}:
            model[key] = [[LENGTH - b, LENGTH - a] for a, b in reversed(model[key])]
    return found


def as_network(tables: Tables) -> Tables:
    """The scene as a network of one line."""
    found: Tables = yaml.safe_load(scene_text(in_full(as_scene(tables))))
    return found


def turned_and_mirrored() -> Matrix:
    c, s = np.cos(0.7), np.sin(0.7)
    return np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, 1.0]])
