"""Seeded random scenes of one cable at rest, of every kind that derivatives at rest are known of."""

from __future__ import annotations

from typing import Any

import numpy as np

KINDS = ("catenary", "rod", "clamped", "bed", "bed of rods", "zones", "sections", "buoyancy", "float", "rope")


def scene_at_rest(seed: int) -> tuple[str, dict[str, Any]]:
    """A kind and a scene: lengths over a decade and a half, bending over three decades, in still water or a current."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    L, w = float(10 ** rng.uniform(1.0, 2.5)), float(10 ** rng.uniform(0.0, 2.0))
    mass = w / 9.81 * rng.uniform(1.2, 1.5)
    section: dict[str, Any] = {
        "length": L, "mass": mass, "diameter": float(np.sqrt(4 * mass / np.pi / 3000)),
        "axial_stiffness": float(w * L * 10 ** rng.uniform(2.0, 4.0)), "drag": {"normal": 1.2, "tangential": 0.01},
    }  # fmt: skip
    if kind not in ("catenary", "bed", "sections", "float", "rope"):
        section["bending_stiffness"] = section["torsional_stiffness"] = float(w * L**3 * 10 ** rng.uniform(-6, -3))
    span, rise = L * rng.uniform(0.6, 0.95), L * rng.uniform(-0.2, 0.2)
    across = float(L * rng.uniform(-0.1, 0.1))
    one, two = [0.0, 0.0, -L], [span, across, -L + rise]
    current = [float(rng.uniform(-0.3, 0.3)), float(rng.uniform(-0.3, 0.3)), 0.0]
    around: dict[str, Any] = {"fluid": {"density": 1025.0, "current": current}}
    start: dict[str, Any] = {"kind": "pinned", "position": one}
    cable: dict[str, Any] = {"sections": [section]}
    model: Any = "catenary" if "bending_stiffness" not in section else "rod"
    cells = int(rng.choice([40, 80]))
    if kind.startswith("bed"):
        depth = L * rng.uniform(0.25, 0.4)
        one[:], two[:] = [0.0, 0.0, -depth], [float(0.93 * np.sqrt(L**2 - depth**2)), across, 0.0]
        around["seabed"] = {"z": -depth, "stiffness": float(w / (0.1 * section["diameter"]))}
    if kind in ("clamped", "zones"):
        start = {"kind": "clamped", "position": one, "tangent": [1.0, 0.0, float(rng.uniform(-0.5, 0.5))]}
    if kind == "zones":
        model = {"kind": "zones", "zones": [{"rod": 0.3 * L, "cells": cells}, {"catenary": 0.7 * L, "cells": 30}]}
    if kind == "sections":
        parts, factors = (0.3, 0.45, 0.25), (1.0, 0.6, 1.4)
        cable["sections"] = [
            {**section, "length": L * a, "mass": mass * b, "axial_stiffness": section["axial_stiffness"] * b}
            for a, b in zip(parts, factors, strict=True)
        ]
    if kind == "buoyancy":
        light = {**section, "diameter": section["diameter"] * 2.0, "mass": mass * 2.0}
        cable["sections"] = [
            {**section, "length": 0.4 * L},
            {**light, "length": 0.2 * L},
            {**section, "length": 0.4 * L},
        ]
    if kind == "float":
        cable["attachments"] = [{"kind": "float", "at": 0.4 * L, "buoyancy": 0.2 * w * L, "mass": 0.02 * mass * L}]
    if kind == "rope":
        T = w * L
        section["tension_strain"] = [[0.0, 0.0], [0.02, 0.4 * T], [0.06, 4.0 * T]]
        del section["axial_stiffness"]
    return kind, {
        "environment": around, "cable": cable, "ends": {"start": start, "end": {"kind": "pinned", "position": two}},
        "initial": "equilibrium", "model": model, "mesh": None if kind == "zones" else {"cells": cells},
    }  # fmt: skip


def keys_of(tables: dict[str, Any]) -> list[str]:
    """Numbers of a scene that matter, without those that zones must match."""
    keys = ["environment.gravity", "environment.fluid.density", "environment.fluid.current[1]"]
    keys += ["environment.seabed.stiffness"] if "seabed" in tables["environment"] else []
    for i, section in enumerate(tables["cable"]["sections"]):
        names = ["mass", "diameter", "axial_stiffness", "bending_stiffness", "length"]
        keys += [f"cable.sections[{i}].{x}" for x in names if x in section]
        keys.append(f"cable.sections[{i}].drag.normal")
    if isinstance(tables["model"], dict):
        keys = [x for x in keys if not x.endswith("length")]
    if "attachments" in tables["cable"]:
        keys += ["cable.attachments[0].buoyancy", "cable.attachments[0].mass"]
    return [*keys, "ends.end.position[0]", "ends.end.position[2]", "ends.start.position[1]"]


def scene_in_motion(seed: int) -> tuple[str, dict[str, Any]]:
    """The same whose end is heaved and surged for a period of its swing, with fixed steps."""
    kind, tables = scene_at_rest(seed)
    rng = np.random.default_rng(10_000 + seed)
    L = sum(x["length"] for x in tables["cable"]["sections"])
    period = float(2.0 * np.pi * np.sqrt(L / 9.81) * rng.uniform(0.7, 1.5))
    axes = {"heave": float(rng.uniform(0.002, 0.01)) * L, "surge": float(rng.uniform(0.002, 0.01)) * L}
    motion = {name: {"amplitude": x, "period": period, "phase": 40.0} for name, x in axes.items()}
    tables["ends"]["end"] |= {"motion": {**motion, "ramp": 0.5 * period}}
    tables["time"] = {"duration": period, "step": period / 80.0, "rho_inf": 0.6}
    tables["output"] = {"every": period / 40.0, "points": 21}
    return kind, tables


def scene_at_anchor(seed: int) -> tuple[str, dict[str, Any], str]:
    """A kind, a scene whose end is heaved and surged with fixed steps, and a number of it that matters.

    Its anchor lies at the level of the bed, at the depth at which the line rests, between both, or above.
    """
    g = np.random.default_rng(7000 + seed)
    model, clamp = ("catenary", "rod")[seed % 2], seed % 8 in (3, 7)
    L, d = float(g.uniform(40.0, 250.0)), float(g.uniform(0.02, 0.08))
    mass = np.pi / 4 * d * d * 1025 * float(g.uniform(1.5, 4.0))
    w = (mass - np.pi / 4 * d * d * 1025) * 9.81
    section: dict[str, Any] = {
        "length": L, "mass": mass, "diameter": d, "axial_stiffness": float(10 ** g.uniform(6, 7.5)),
        "drag": {"normal": float(g.uniform(0.8, 1.6)), "tangential": 0.02}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    if model == "rod":
        section |= {"bending_stiffness": float(10 ** g.uniform(0.0, 3.0)), "torsional_stiffness": 50.0}
    depth = L * float(g.uniform(0.25, 0.45))
    k = w / (d * 10 ** float(g.uniform(-1.5, 0)))
    rests = w / k  # m, the depth at which it does
    places = (0.0, 0.0, float(g.uniform(-1, 1)) * rests / 2, float(10 ** g.uniform(-2, 0)) * rests * 3)
    above = (*places, float(g.uniform(0.01, 0.3)) * d * 10)[seed // 2 % 5]
    if seed // 2 % 5 == 1:
        above = -rests * float(g.uniform(0.8, 1.2))
    bed = {"z": -depth - above, "stiffness": k, "damping": float(g.choice([0.0, 0.1 * k]))}
    if seed % 10 == 9:
        bed["friction"] = float(g.uniform(0.2, 0.6))
    start: dict[str, Any] = {"kind": "pinned", "position": [0.0, 0.0, -depth]}
    if clamp:
        start |= {"kind": "clamped", "tangent": [1.0, 0.0, float(g.uniform(-0.02, 0.05))]}
    far = float(np.sqrt(L**2 - depth**2)) * float(g.uniform(0.9, 0.985))
    period = float(g.uniform(4, 9))
    motion: dict[str, Any] = {"ramp": 0.5 * period}
    for axis, low, high in (("heave", 0.003, 0.01), ("surge", 0.001, 0.005)):
        size = float(g.uniform(low, high)) * L
        motion[axis] = {"amplitude": size, "period": period, "phase": float(g.uniform(0, 360))}
    end = {"kind": "pinned", "position": [far, float(g.choice([0.0, 0.1])) * far, 0.0], "motion": motion}
    keys = ["mass", "axial_stiffness", "drag.normal", "length"]
    keys = [f"cable.sections[0].{x}" for x in keys]
    keys += ["environment.seabed.stiffness", "ends.end.position[0]", "ends.start.position[2]"]
    keys += ["cable.sections[0].bending_stiffness"] if model == "rod" else []
    scene = {
        "environment": {"fluid": {"density": 1025.0}, "seabed": bed}, "cable": {"sections": [section]},
        "ends": {"start": start, "end": end}, "initial": "equilibrium", "model": model,
        "mesh": {"cells": int(g.choice([30, 50, 80]))},
        "time": {"duration": period, "step": period / 80.0, "rho_inf": 0.6},
        "output": {"every": period / 40, "points": 21},
    }  # fmt: skip
    return f"{model}, {start['kind']}, {above / rests:.2g} above", scene, keys[int(g.integers(len(keys)))]
