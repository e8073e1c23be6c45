"""Random pipes: wall tension, stress, capacity and codes of every output against formulas that are written out here.

    pytest bench/test_bench_code_checks.py -m bench -n 0 -s

HYBRID_PIPES (200) scenes of one to three sections in air and water, some curved without load, rods, catenaries and zones
that move, in two periods of a motion.  Stresses are looked for at seven diameters and nine places around the wall.
"""

from __future__ import annotations

import math
import os
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import HybridError
from hybrid.store.capacity import inside_of, rows_of

pytestmark = pytest.mark.bench
PIPES = int(os.environ.get("HYBRID_PIPES", "200"))
G, WATER = 9.81, 1025.0
CLASSES = {"low": 1.04, "normal": 1.14, "high": 1.26}
Scene = dict[str, Any]


def section_of(r: np.random.Generator, length: float, air: bool, curved: bool) -> Scene:
    """A pipe, some without wall, capacity or code."""
    D = float(10 ** r.uniform(-1.2, -0.3))
    t = min(float(D * 10 ** r.uniform(-1.9, -0.45)), 0.49 * D)
    d, E = D - 2 * t, 207e9 if r.random() < 0.6 else float(10 ** r.uniform(9, 11))
    A, I = math.pi / 4 * (D**2 - d**2), math.pi / 64 * (D**4 - d**4)
    content, bore = float(r.choice([0, 800, 1500])), math.pi / 4 * d**2
    mass = A * float(r.choice([2000, 4000, 7850])) + content * bore
    found: Scene = {
        "length": length, "mass": mass if air else max(mass, 1.1 * WATER * math.pi / 4 * D**2), "diameter": D,
        "axial_stiffness": E * A, "bending_stiffness": E * I * float(r.choice([1, 0.1])), "damping": 0.5,
        "torsional_stiffness": E / 1.3 * I,
        "pipe": {"wall": t, "modulus": E, "pressure": float(10 ** r.uniform(5, 7.3)), "content_density": content},
    }  # fmt: skip
    if r.random() < 0.3:
        found["pipe"]["pressure_z"] = float(r.uniform(-50, 50))
    if curved and r.random() < 0.6:
        found["intrinsic_curvature"] = [float(r.uniform(-0.3, 0.3)) / length, 0.0, 0.0]
    if r.random() < 0.6:
        found["capacity"] = polygon(r)
    if (draw := r.random()) < 0.5:
        y, moved = float(r.uniform(2e8, 6e8)), r.random() < 0.5
        found["code"] = {
            "kind": "F201", "yield_strength": y, "tensile_strength": y * float(r.uniform(1, 1.6)),
            "safety_class": str(r.choice([*CLASSES])), "ovality": float(10 ** r.uniform(-3, -1.5)),
            "functional_tension": float(10 ** r.uniform(3, 5)) * moved, "functional_moment": 1e3 * moved,
        }  # fmt: skip
    elif draw < 0.7:
        found["code"] = {"kind": "E301", "strength": float(10 ** r.uniform(5, 7)), "pretension_factor": 1.2,
                         "environment_factor": 1.5, "pretension": float(10 ** r.uniform(2, 4))}  # fmt: skip
    return found


def polygon(r: np.random.Generator) -> list[list[float]]:
    """Corners from tension round to bending, or on to compression; some are dented."""
    T, k, full = float(10 ** r.uniform(3.5, 6.5)), float(10 ** r.uniform(-2.5, 0)), r.random() < 0.5
    top = math.pi if full else math.pi / 2
    angles = np.sort(r.uniform(0.05, top - 0.05, int(r.integers(1 if full else 0, 4))))
    out = r.uniform(0.5, 1.5, angles.size)
    corners = np.stack([T * out * np.cos(angles), k * out * np.sin(angles)], axis=1).tolist()
    return [[T, 0.0], *corners, [-0.3 * T, 0.0] if full else [0.0, k]]


def pipes(seed: int) -> Scene:
    r = np.random.default_rng(seed)
    L, air, curved = float(10 ** r.uniform(1.3, 2.5)), bool(r.random() < 0.2), bool(r.random() < 0.25)
    lengths = r.uniform(0.5, 1.5, int(r.integers(1, 4)))
    sections = [section_of(r, float(L * x / lengths.sum()), air, curved) for x in lengths]
    z, a, T = -float(r.uniform(1, 200)) * (not air), float(r.uniform(-1, 1)), float(r.uniform(6, 12))
    start: Scene = {"kind": "pinned", "position": [0, 0, z]}
    if r.random() < 0.5:
        start |= {"kind": "clamped", "tangent": [math.cos(a), float(r.uniform(-0.5, 0.5)), math.sin(a)]}
    heave = {"amplitude": float(0.01 * L * r.random()), "period": 1.3 * T}
    motion = {"surge": {"amplitude": 0.005 * L, "period": T}, "heave": heave, "ramp": T}
    place = [float(r.uniform(0.5, 0.97)) * L, 0, z + float(r.uniform(-0.25, 0.25)) * L]
    fluid = {"density": WATER, "surface": 0.0, "current": [float(r.uniform(-0.5, 0.5)), 0.2, 0]}
    return {
        "environment": {"gravity": G} | ({} if air else {"fluid": fluid}), "cable": {"sections": sections},
        "ends": {"start": start, "end": {"kind": "pinned", "position": place, "motion": motion}},
        "initial": "equilibrium", "model": str(r.choice(["rod", "rod", "catenary", "adaptive"])),
        "mesh": {"cells": int(r.integers(12, 41))}, "contact": {"self": False},
        "time": {"duration": 2 * T, "step": T / 40}, "output": {"every": T / 10, "points": 31},
    }  # fmt: skip


def stresses(scene: Scene, section: Scene, T: Any, k: Any, Q: Any, dp: Any) -> tuple[Any, Any]:
    """Wall tension and the largest von Mises stress under pressures dp = (outside, inside)."""
    pipe, D = section["pipe"], section["diameter"]
    d, (pe, pi) = D - 2 * pipe["wall"], dp
    wall, most = T + pi * math.pi / 4 * d**2 - pe * math.pi / 4 * D**2, np.zeros_like(T)
    for x in np.linspace(d, D, 7):
        m, w = (pi * d**2 - pe * D**2) / (D**2 - d**2), (pi - pe) * D**2 * d**2 / ((D**2 - d**2) * x**2)
        shear = Q * x / 2 / (math.pi / 32 * (D**4 - d**4))
        for angle in np.linspace(0, math.pi, 9):
            a = wall / (math.pi / 4 * (D**2 - d**2)) + pipe["modulus"] * k * x / 2 * math.cos(angle)
            square = 0.5 * ((a - m - w) ** 2 + (2 * w) ** 2 + (m - w - a) ** 2) + 3 * shear**2
            most = np.maximum(most, np.sqrt(square))
    return wall, most


def of_code(section: Scene, T: Any, M: Any, dp: Any) -> Any:
    """E301, or F201 with the pressure at collapse by bisection."""
    code = section["code"]
    if code["kind"] == "E301":
        used = 1.2 * code["pretension"] + 1.5 * (T - code["pretension"])
        return np.where(T < 0, used, np.maximum(used, 1.2 * T)) / code["strength"]
    D, t, E = section["diameter"], section["pipe"]["wall"], section["pipe"]["modulus"]
    y, u, g = code["yield_strength"], code["tensile_strength"], CLASSES[code["safety_class"]] * 1.15
    for name in ("tension", "moment"):
        x, f = (T, code["functional_tension"]) if name == "tension" else (M, code["functional_moment"])
        both = 1.1 * f + 1.3 * (x - f)
        T, M = (
            (np.where(x < 0, both, np.maximum(both, 1.1 * x)), M)
            if name == "tension"
            else (T, np.maximum(both, 1.1 * x))
        )
    p, burst = dp[1] - dp[0], 2 / math.sqrt(3) * 2 * t / (D - t) * min(y, u / 1.15)
    slim = min(max((60 - D / t) / 45, 0.0), 1.0)
    beta = (0.4 + np.where(p > 0, p / burst * 2 / math.sqrt(3), 0)) * slim
    hard = np.minimum(1 - beta + beta * u / y, 1.2)
    bent, pulled = M / (y * hard * (D - t) ** 2 * t), (T / (y * hard * math.pi * (D - t) * t)) ** 2
    elastic, plastic = 2 * E * (t / D) ** 3 / 0.91, 2 * t / D * y * 0.85
    low, high = 0.0, min(elastic, plastic)
    for _ in range(100):
        c = 0.5 * (low + high)
        left = (c - elastic) * (c**2 - plastic**2) > c * elastic * plastic * code["ovality"] * D / t
        low, high = (c, high) if left else (low, c)
    within = g * (bent * np.sqrt(np.maximum(1 - (p / burst) ** 2, 0)) + pulled) + (p / burst) ** 2
    return np.where(p >= 0, within, g**2 * ((bent + pulled) ** 2 + (p / low) ** 2))


def of_capacity(corners: Any, T: Any, k: Any) -> Any:
    """Over which part of the way from no load to the polygon, by where a ray meets its sides."""
    c, T = np.array(corners), np.maximum(T, 0.0) if corners[-1][0] == 0.0 else T
    most = np.zeros_like(T)
    for a, b in pairwise(c):
        e = b - a
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (a[0] * e[1] - a[1] * e[0]) / (T * e[1] - k * e[0])  # of the ray
            along = (
                (far * T - a[0]) / e[0] if abs(e[0]) * c[:, 1].max() > abs(e[1]) * c[0, 0] else (far * k - a[1]) / e[1]
            )
        meets = (far > 0) & (along >= -1e-9) & (along <= 1 + 1e-9)
        most = np.where(meets, np.maximum(most, 1 / np.where(meets, far, 1.0)), most)
    return most


def worst_of(scene: Scene) -> dict[str, float]:
    """By quantity the largest deviation, as a part of the largest value of the section."""
    found: dict[str, float] = {}
    with hybrid.run(scene) as result:
        s, T = result.both_sides("tension")
        k, Q = (result.both_sides(x)[1] if x in result else np.zeros_like(T) for x in ("curvature", "torque"))
        moment = result.both_sides("bending_moment")[1] if "bending_moment" in result else np.zeros_like(T)
        z, surface = np.array([np.interp(s, result.s, x) for x in result.position[:, :, 2]]), 0.0
        kinds = {zone.kind for zones in result.zones for zone in zones}
        fluid, begin = "fluid" in scene["environment"], 0.0
        for section in scene["cable"]["sections"]:
            end, pipe = begin + section["length"], section["pipe"]
            at = inside_of(Row(begin, end), s)
            inside = pipe["pressure"] + pipe["content_density"] * G * (pipe.get("pressure_z", surface) - z)
            dp = WATER * G * np.maximum(-z, 0) * fluid, np.maximum(inside, 0)
            wall, stress = stresses(scene, section, T, k, Q, dp)
            own = {"wall_tension": wall}
            if "intrinsic_curvature" not in section:
                own["von_mises"] = stress
                if "code" in section and kinds in ({"rod"}, {"catenary"}):
                    M = moment if kinds == {"rod"} else section["bending_stiffness"] * k
                    own["code_used"] = 100 * of_code(section, T, M, dp)
            if "capacity" in section:
                own["capacity_used"] = 100 * of_capacity(section["capacity"], T, k)
            for name, values in own.items():
                off = np.abs(result.both_sides(name)[1] - values)[:, at].max() / np.abs(values[:, at]).max()
                found[name] = max(found.get(name, 0.0), float(off))
            begin = end
        assert all(np.isfinite(row).all() for row in rows_of(result))
    return found


class Row:
    """A section from `first` to `last` (m)."""

    def __init__(self, first: float, last: float) -> None:
        self.first, self.last = first, last


def test_random_pipes() -> None:
    worst: dict[str, tuple[float, int]] = {}
    count: dict[str, int] = {}
    refused = 0
    for seed in range(PIPES):
        try:
            found = worst_of(pipes(seed))
        except HybridError:
            refused += 1
            continue
        for name, off in found.items():
            worst[name], count[name] = max(worst.get(name, (0.0, -1)), (off, seed)), count.get(name, 0) + 1
        print(f"\r{seed + 1} of {PIPES}", end="", flush=True)
    print(f"\n{PIPES} random pipes, {refused} refused or stopped with a reason")
    for name, (off, seed) in worst.items():
        print(f"{name}: largest deviation {off:.2g} of the largest value, seed {seed}, of {count[name]} scenes")
    assert max(off for off, _ in worst.values()) < 1e-5
