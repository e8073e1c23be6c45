"""Problems against published values: power cables and chains of OrcaFlex, 123 equilibria, a helix in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from power_cables import scene_of, solve_all

import hybrid
from board.answers import Answer, references, timed

Floats = NDArray[np.float64]
STATIC = {"accuracy": {"line_tension": "0.1%", "curvature": "0.2%"}}
CHAIN = {"accuracy": {"line_tension": "0.1%"}}
MOVING = {"accuracy": {"tension": "0.3%", "curvature": "0.5%"}}
TENSION, CURVATURE = "total/tension", "total/curvature"
SEGMENT = 10.0  # m, of the references of chains, which their damping is of


def row_of(name: str, number: int | None = None) -> dict[str, Any]:
    """The cable of a problem, in the terms of power_cables.scene_of; number: of several."""
    table = references()
    problem = table["problems"][name]
    row = dict(problem["row"] if number is None else problem["rows"][number])
    return row | (table[row["line"]] if "line" in row else {})


def static_of(row: dict[str, Any], more: dict[str, Any]) -> tuple[hybrid.Result, float]:
    """The equilibrium of a cable, and its CPU time (s)."""
    return timed(lambda: hybrid.static(scene_of(row) | more))


def size(force: Floats) -> Floats:
    return np.asarray(np.linalg.norm(force, axis=-1))


def lazy_wave(name: str) -> list[Answer]:
    """Tension at the top and largest curvature of a lazy wave at rest."""
    found, cpu = static_of(row_of(name), STATIC)
    top, bend = references()["problems"][name]["quantities"]
    values = {top: float(size(found.reaction_start)[-1]) / 1e3, bend: float(np.abs(found.curvature[-1]).max())}
    figures = {
        top: float(found.errors["total/end_force_start"][-1]) / 1e3,
        bend: float(found.errors[CURVATURE][-1].max()),
    }
    return [Answer("hybrid", values, figures, cpu, asked(STATIC))]


def asked(more: dict[str, Any]) -> str:
    """What was asked of ours, in words."""
    return "accuracy " + ", ".join(f"{value} of {name.replace('_', ' ')}" for name, value in more["accuracy"].items())


def span(name: str) -> list[Answer]:
    """Curvature and top tension of the part of a lazy wave that hangs, at rest and in heave."""
    heave = references()["problems"][name]["heave"]
    row = row_of(name)
    length = sum(x[1] for x in row["sections"])
    more = {
        "time": {"duration": heave["duration"]},
        "output": {"every": 0.1, "points": [float(x) for x in np.linspace(0.03 * length, 0.97 * length, 401)]},
    }
    scene = scene_of(row) | more | MOVING
    motion = {"heave": {"amplitude": heave["amplitude"], "period": heave["period"]}, "ramp": heave["ramp"]}
    scene["ends"]["start"]["motion"] = motion
    found, cpu = timed(lambda: hybrid.run(scene, None))
    late = found.t >= heave["duration"] - heave["window"] - 1e-9
    inner = (found.s >= 0.03 * length - 1e-9) & (found.s <= 0.97 * length + 1e-9)
    bend, pull = np.abs(found.curvature[:, inner]), size(found.reaction_start)[late] / 1e3
    wrong, off = found.errors[CURVATURE][:, inner], found.errors["total/end_force_start"][late] / 1e3
    numbers = [bend[0].max(), bend[late].max(), pull[:-1].mean(), pull.min(), pull.max()]
    figures = [wrong[0].max(), wrong[late].max(), off.mean(), off[pull.argmin()], off[pull.argmax()]]
    names = list(references()["problems"][name]["quantities"])
    values, own = (dict(zip(names, map(float, x), strict=True)) for x in (numbers, figures))
    return [Answer("hybrid", values, own, cpu, asked(MOVING))]


def touchdown_bending(name: str) -> list[Answer]:
    """Tensions and curvature at the middle of the segments of the reference."""
    row = row_of(name)
    _, length, count = row["sections"][0]
    middle = (np.arange(count) + 0.5) * length / count
    found, cpu = static_of(row, STATIC)
    there = found.at(t=float(found.t[-1]), s=middle, names=["tension", "curvature"])
    wrong, bend = found.errors[TENSION][-1], np.abs(there["curvature"])
    names = list(references()["problems"][name]["quantities"])
    numbers = [there["tension"][0] / 1e3, there["tension"][-1] / 1e3, bend.max()]
    figures = [wrong.max() / 1e3, wrong.max() / 1e3, found.errors[CURVATURE][-1].max()]
    values, own = (dict(zip(names, map(float, x), strict=True)) for x in (numbers, figures))
    return [Answer("hybrid", values, own, cpu, asked(STATIC))]


def chain_current(name: str) -> list[Answer]:
    """Tensions at the middle of the end segments of the reference; CPU time of both directions."""
    row, names = row_of(name), list(references()["problems"][name]["quantities"])
    _, length, count = row["sections"][0]
    middle = np.array([0.5, count - 0.5]) * length / count
    values, figures, spent = dict[str, float](), dict[str, float](), 0.0
    for k, current in enumerate(([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])):
        found, cpu = static_of(row | {"current": current}, CHAIN)
        there = found.at(t=float(found.t[-1]), s=middle, names=["tension"])["tension"] / 1e3
        own = float(found.errors[TENSION][-1].max()) / 1e3
        for which, quantity in enumerate(names[2 * k : 2 * k + 2]):
            values[quantity], figures[quantity] = float(there[which]), own
        spent += cpu
    return [Answer("hybrid", values, figures, spent, asked(CHAIN))]


def first_harmonic(t: Floats, force: Floats, period: float, window: float) -> float:
    """Amplitude of the first harmonic over the last `window` seconds, whole periods of even samples."""
    late = t > t[-1] - window + 1e-9
    turn = np.exp(-2j * np.pi * t[late] / period)
    return float(2.0 * np.abs(np.mean(force[late] * turn)))


def chain_heave(name: str) -> list[Answer]:
    """First harmonics of the top tension of three chains in two heaves, each with a figure that bounds its error.

    An error e(t) changes a harmonic by at most sqrt(2) rms(e).
    """
    problem = references()["problems"][name]
    heave, names = problem["heave"], iter(problem["quantities"])
    values, figures, spent = dict[str, float](), dict[str, float](), 0.0
    for number in range(len(problem["rows"])):
        row = row_of(name, number)
        _, length, _ = row["sections"][0]
        _, mass, stiffness, *_ = row["types"]["chain"]
        for amplitude in heave["amplitudes"]:
            scene = scene_of(row) | {
                "time": {"duration": heave["duration"], "step": 0.025}, "mesh": {"cells": round(length / 2.5)},
                "output": {"every": 0.1, "errors": True},
            }  # fmt: skip
            # zeta = 1 of a segment of the references
            scene["cable"]["sections"][0]["damping"] = {"stiffness": SEGMENT * math.sqrt(mass / stiffness)}
            motion = {"heave": {"amplitude": amplitude, "period": heave["period"]}, "ramp": heave["ramp"]}
            scene["ends"]["start"]["motion"] = motion
            found, cpu = timed(lambda scene=scene: hybrid.run(scene, None))
            late = found.t > found.t[-1] - heave["window"] + 1e-9
            off = found.errors["total/end_force_start"][late] / 1e3
            quantity = next(names)
            force = size(found.reaction_start) / 1e3
            values[quantity] = first_harmonic(found.t, force, heave["period"], heave["window"])
            figures[quantity] = float(np.sqrt(2.0 * np.mean(off**2)))
            spent += cpu
    return [Answer("hybrid", values, figures, spent, "cells of 2.5 m, steps of 0.025 s, six runs")]


def power_cables(name: str) -> list[Answer]:
    """The matrix of equilibria as one line."""
    found = solve_all()
    must = [x for x in found.values() if x.admissible]
    good, silent = sum(x.good for x in must), [key for key, x in found.items() if x.silent]
    off = float(np.median([x.off for x in found.values() if x.judged_by_root]))
    wrong = [key for key, x in found.items() if x.admissible and not x.good]
    words = (
        f"{good} of {len(must)} that have an equilibrium within their bounds, median distance {100 * off:.2f} %; "
        f"not within: {', '.join(wrong) or 'none'}; in compression without a word: {', '.join(silent) or 'none'}"
    )
    return [Answer("hybrid", {}, {}, float(np.median([x.answer.cpu for x in found.values()])), words)]


def helix_scene(given: dict[str, Any], cells: int) -> dict[str, Any]:
    """A rod that is clamped as on the helix; it starts on the polyline of ten points to a cell."""
    radius, pitch = given["radius"], math.radians(given["pitch"])
    length = 2.0 * math.pi * radius / math.cos(pitch)

    def place(s: float) -> list[float]:
        turn = s * math.cos(pitch) / radius
        return [radius * math.cos(turn), radius * math.sin(turn), s * math.sin(pitch)]

    tangent = [0.0, math.cos(pitch), math.sin(pitch)]
    turns = given["torque"] / given["torsion"] * length / (2.0 * math.pi)
    section = {
        "length": length, "mass": 1.0, "bending_stiffness": given["bending"], "torsional_stiffness": given["torsion"]
    }  # fmt: skip
    return {
        "environment": {"gravity": 0.0}, "cable": {"sections": [section]}, "model": "rod", "mesh": {"cells": cells},
        "ends": {
            "start": {"kind": "clamped", "position": place(0.0), "tangent": tangent},
            "end": {"kind": "clamped", "position": place(length), "tangent": tangent, "turns": turns},
        },
        "initial": {"kind": "equilibrium", "points": [place(s) for s in np.linspace(0.0, length, 10 * cells + 1)]},
    }  # fmt: skip


def helix(name: str, cells: int = 200) -> list[Answer]:
    """Force along the axis and moment about it at the far end."""
    problem = references()["problems"][name]
    scene = helix_scene(problem, cells)
    found, cpu = timed(lambda: hybrid.static(scene))
    force, moment = found.reaction_end[-1], found.moment_end[-1]
    whole = moment + np.cross(found.position[-1, -1], force)
    values = dict(zip(problem["quantities"], (float(force[2]), float(whole[2])), strict=True))
    return [Answer("hybrid", values, {}, cpu, f"{cells} cells")]
