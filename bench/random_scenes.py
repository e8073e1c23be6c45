"""Seeded random scenes in which zones come and go."""

from __future__ import annotations

from typing import Any

import numpy as np

KINDS = ("span", "slack", "in_out", "touchdown", "float")


def random_scene(seed: int) -> tuple[str, dict[str, Any]]:
    """A kind and a scene: lengths over two decades, EI over four, loads and speeds to match; zones that move."""
    rng = np.random.default_rng(seed)
    kind = str(rng.choice(KINDS))
    L, w = float(10 ** rng.uniform(0.5, 2.3)), float(10 ** rng.uniform(-1, 1.5))
    mass = w / 9.81 * rng.uniform(1.0, 1.5)
    EI = float(w * L**3 * 10 ** rng.uniform(-6, -2))
    EA = float(w * L * 10 ** rng.uniform(3.5, 5.5)) if rng.random() < 0.8 else None
    section: dict[str, Any] = {
        "length": L, "mass": mass, "diameter": float(np.sqrt(4 * mass / np.pi / 3000)), "bending_stiffness": EI,
        "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    if EA:
        section["axial_stiffness"] = EA
    current = [float(rng.uniform(-0.2, 0.2)), float(rng.uniform(-0.1, 0.1)), 0]
    around: dict[str, Any] = {"gravity": 9.81, "fluid": {"density": 1025, "current": current}}
    T, A = float(np.sqrt(L / 9.81) * rng.uniform(3, 8)), float(L * rng.uniform(0.005, 0.05))
    motion: dict[str, Any] = {
        "heave": {"amplitude": A, "period": T},
        "surge": {"amplitude": A * rng.uniform(0, 1), "period": T * 1.3},
        "ramp": 2 * T,
    }
    dt = T / float(rng.choice([40, 80]))
    spans = {
        "span": (0.7, 0.95),
        "slack": (0.2, 0.6),
        "in_out": (0.5, 0.8),
        "touchdown": (0.5, 0.8),
        "float": (0.4, 0.9),
    }
    span = {name: rng.uniform(*x) for name, x in spans.items()}[kind] * L
    one: list[float] = [0, 0, 0]
    two = [span, 0, float(rng.uniform(-0.2, 0.2) * L)]
    cable: dict[str, Any] = {"sections": [section]}
    if kind == "touchdown":
        depth = L * rng.uniform(0.2, 0.4)
        one, two = [0, 0, -depth], [float(min(span, 0.93 * np.sqrt(L**2 - depth**2))), 0, 0]
        k = w / (1e-2 * section["diameter"] + 1e-4 * L)
        around["seabed"] = {"z": -depth, "stiffness": float(k), "damping": float(5 * np.sqrt(k * mass))}
        if rng.random() < 0.5:
            around["seabed"]["friction"] = 0.4
    if kind == "float":
        cable["attachments"] = [
            {"kind": "float", "at": L * rng.uniform(0.3, 0.7), "buoyancy": w * L * rng.uniform(0.1, 0.6),
             "mass": mass * L * 0.05, "drag_area": 0.01 * L}
        ]  # fmt: skip
    if kind == "in_out":
        motion["travel"] = {"by": [float(-0.25 * L), 0, 0], "over": 2 * T, "begin": 2 * T}
    return kind, {
        "environment": around,
        "cable": cable,
        "ends": {
            "start": {"kind": "pinned", "position": one},
            "end": {"kind": "pinned", "position": two, "motion": motion},
        },
        "initial": {"kind": "equilibrium"},
        "model": {"kind": "adaptive", "tolerance": float(rng.choice([3e-3, 1e-3, 3e-4]))},
        "time": {"duration": 5 * T, "step": dt, "rho_inf": float(rng.choice([0.5, 0.8]))},
        "output": {"every": 5 * T / 40, "points": 51},
    }


def hanging_line(seed: int) -> dict[str, Any]:
    """A line at rest in air, clamped and pinned: lengths over two decades, bending layers over three."""
    rng = np.random.default_rng(seed)
    L, mass = float(10 ** rng.uniform(0, 2)), float(10 ** rng.uniform(-2, 0.5))
    EI = float(mass * 9.81 * L**3 * 10 ** rng.uniform(-8, -3))
    span, height, angle = L * rng.uniform(0.5, 0.95), L * rng.uniform(-0.2, 0.2), rng.uniform(-1.2, 1.2)
    tangent = [float(np.cos(angle)), 0.0, float(np.sin(angle))]
    return {
        "cable": {"sections": [{"length": L, "mass": mass, "bending_stiffness": EI}]},
        "ends": {
            "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": tangent},
            "end": {"kind": "pinned", "position": [float(span), 0, float(height)]},
        },
        "initial": "equilibrium",
        "output": {"points": int(rng.choice([41, 101, 201]))},
    }
